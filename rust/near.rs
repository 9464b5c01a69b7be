//! How near triangles come to a point, on one side of a plane through it.

use glam::DVec3;

use crate::bvh::{Kind, Tree, WIDTH};

/// Distance [m] of a point of the tree's frame from the nearest triangle that is not all behind the plane through the point
/// across `forward`; `limit` where that is farther. `corners` of the triangles of a leaf.
pub fn distance_in_front<Triangles: Iterator<Item = [DVec3; 3]>>(
    tree: &Tree,
    point: DVec3,
    forward: DVec3,
    mut limit: f64,
    corners: impl Fn(usize, usize) -> Triangles,
) -> f64 {
    let is_in_front = |place: DVec3| (place - point).dot(forward) > 0.0;
    let mut stack = if tree.nodes.is_empty() { vec![] } else { vec![0] };
    while let Some(node) = stack.pop() {
        let node = &tree.nodes[node];
        for place in 0..WIDTH {
            let side = |of: &[[f32; WIDTH]; 3]| DVec3::from_array(of.map(|axis| f64::from(axis[place])));
            let (min, max) = (side(&node.min), side(&node.max));
            // Places without a child hold a box that is empty.
            if min.cmpgt(max).any() || point.clamp(min, max).distance(point) >= limit {
                continue;
            }
            if !is_in_front(DVec3::select(forward.cmpgt(DVec3::ZERO), max, min)) {
                continue;
            }
            match node.child[place].kind() {
                Kind::Node(child) => stack.push(child),
                Kind::Leaf(leaf, count) => {
                    for triangle in corners(leaf, count) {
                        if triangle.into_iter().any(is_in_front) {
                            limit = limit.min(distance_to_triangle(point, triangle));
                        }
                    }
                }
            }
        }
    }
    limit
}

/// Distance of a point from a triangle, which may have no area.
fn distance_to_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let is_inside = |a: DVec3, b: DVec3| (b - a).cross(point - a).dot(normal) > 0.0;
    if is_inside(a, b) && is_inside(b, c) && is_inside(c, a) {
        return (point - a).dot(normal).abs() / normal.length();
    }
    let to_edge = |a: DVec3, b: DVec3| {
        let (edge, offset) = (b - a, point - a);
        let along = offset.dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE);
        (offset - along.clamp(0.0, 1.0) * edge).length()
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_to_a_triangle_is_that_to_its_face_edges_and_corners() {
        let triangle = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, 4.0, 0.0)];
        for (point, distance) in [
            (DVec3::new(1.0, 1.0, 3.0), 3.0),
            (DVec3::new(1.0, 1.0, -2.0), 2.0),
            (DVec3::new(2.0, -3.0, 4.0), 5.0),
            (DVec3::new(3.0, 3.0, 0.0), 2.0_f64.sqrt()),
            (DVec3::new(-3.0, -4.0, 12.0), 13.0),
            (DVec3::new(1.0, 1.0, 0.0), 0.0),
        ] {
            assert!(
                (distance_to_triangle(point, triangle) - distance).abs() < 1e-15,
                "{point}"
            );
        }
        let line = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        assert_eq!(distance_to_triangle(DVec3::new(3.0, 0.0, 0.0), line), 1.0);
        assert_eq!(distance_to_triangle(DVec3::Y, [DVec3::ZERO; 3]), 1.0);
    }
}
