//! Nearest point of the triangles of a tree, on one side of a plane.

use glam::DVec3;

use crate::geometry::triangle::distance_to_point;
use crate::rays::tree::{Kind, Tree, WIDTH};

/// Distance [m] of a point of the tree's frame from the nearest point of all triangles that are not all behind the
/// plane through the point with normal `forward`; at most `limit`. `corners` gives the triangles of a leaf of a number,
/// and count.
pub fn distance_in_front<Triangles: Iterator<Item = [DVec3; 3]>>(
    tree: &Tree,
    point: DVec3,
    forward: DVec3,
    mut limit: f64,
    corners: impl Fn(usize, usize) -> Triangles,
) -> f64 {
    let is_in_front = |corner: DVec3| (corner - point).dot(forward) > 0.0;
    let mut stack = if tree.nodes.is_empty() { vec![] } else { vec![0] };
    while let Some(node) = stack.pop() {
        let node = &tree.nodes[node];
        for slot in 0..WIDTH {
            let side = |of: &[[f32; WIDTH]; 3]| DVec3::from_array(of.map(|axis| f64::from(axis[slot])));
            let (min, max) = (side(&node.min), side(&node.max));
            // Slots without a child hold an empty box.
            if min.cmpgt(max).any() || point.clamp(min, max).distance(point) >= limit {
                continue;
            }
            if !is_in_front(DVec3::select(forward.cmpgt(DVec3::ZERO), max, min)) {
                continue;
            }
            match node.child[slot].kind() {
                Kind::Node(child) => stack.push(child),
                Kind::Leaf(leaf, count) => {
                    for triangle in corners(leaf, count) {
                        if triangle.into_iter().any(is_in_front) {
                            limit = limit.min(distance_to_point(triangle, point));
                        }
                    }
                }
            }
        }
    }
    limit
}
