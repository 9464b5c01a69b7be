//! Pyramids from the sensor to a rectangle, and the triangles that reach into one.

use glam::DVec3;

use crate::geometry::pose::Pose;
use crate::rays::scene::PosedScene;
use crate::rays::tree::{Kind, Tree, WIDTH};

/// Depth by which a surface may reach through a side of a pyramid [m].
pub const THROUGH_SIDE: f64 = 1e-6;

/// Depth by which a surface may reach through its base [m].
pub const THROUGH_BASE: f64 = 2e-5;

/// Pyramid with the apex at the origin of the sensor frame: the half spaces of its sides and of its base, and the half
/// space in front of the apex.
pub struct Pyramid {
    /// Inward unit normals, and distances of the planes from the origin along them [m].
    planes: [(DVec3, f64); 6],
}

impl Pyramid {
    /// Pyramid over the smallest rectangle with a side along a direction that contains points of a plane; `normal`: the
    /// unit normal of the plane, away from the sensor.
    pub fn over(points: &[DVec3], normal: DVec3, along: DVec3) -> Self {
        let axes = [along, normal.cross(along)];
        let height = points[0].dot(normal);
        let [u, v] = axes.map(|axis| extent(points, axis));
        let corner = |i: usize, j: usize| height * normal + u[i] * axes[0] + v[j] * axes[1];
        let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        let middle = 0.25 * corners.iter().sum::<DVec3>();
        let mut planes = [(-normal, THROUGH_BASE - height); 6];
        planes[5] = (normal, 0.0);
        for i in 0..4 {
            let side = corners[i].cross(corners[(i + 1) % 4]).normalize_or_zero();
            planes[i] = (side * side.dot(middle).signum(), THROUGH_SIDE);
        }
        Self { planes }
    }

    /// The pyramid in the frame of a body, about a point of it.
    fn to_body(&self, pose: &Pose, about: DVec3) -> Self {
        let planes = self.planes.map(|(normal, distance)| {
            let shift = normal.dot(pose.point(about));
            (pose.direction_to_body(normal), distance - shift)
        });
        Self { planes }
    }

    /// True unless a box is outside one of the planes.
    fn may_meet(&self, min: DVec3, max: DVec3) -> bool {
        let corner = |normal: DVec3| DVec3::select(normal.cmpgt(DVec3::ZERO), max, min);
        // Slots without a child hold an empty box.
        let mut planes = self.planes.iter();
        min.cmple(max).all() && planes.all(|(normal, distance)| normal.dot(corner(*normal)) > *distance)
    }

    /// True if a part of a triangle is inside: some of it is left when all planes have cut it.
    fn meets(&self, triangle: [DVec3; 3]) -> bool {
        let is_beyond =
            |(normal, distance): &(DVec3, f64)| triangle.iter().all(|corner| normal.dot(*corner) <= *distance);
        if self.planes.iter().any(is_beyond) {
            return false;
        }
        let mut polygon = triangle.to_vec();
        for (normal, distance) in &self.planes {
            let beyond = |point: DVec3| normal.dot(point) - distance;
            let mut inside = Vec::with_capacity(polygon.len() + 1);
            for (i, point) in polygon.iter().enumerate() {
                let next = polygon[(i + 1) % polygon.len()];
                let [here, there] = [beyond(*point), beyond(next)];
                if here > 0.0 {
                    inside.push(*point);
                }
                if (here > 0.0) != (there > 0.0) {
                    inside.push(point.lerp(next, here / (here - there)));
                }
            }
            polygon = inside;
            if polygon.is_empty() {
                return false;
            }
        }
        true
    }

    /// True if a leaf of a tree, by number and count, is one that the pyramid meets.
    fn meets_any(&self, tree: &Tree, meets: impl Fn(usize, usize) -> bool) -> bool {
        let mut stack = if tree.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(node) = stack.pop() {
            let node = &tree.nodes[node];
            for slot in 0..WIDTH {
                let side = |of: &[[f32; WIDTH]; 3]| DVec3::from_array(of.map(|axis| f64::from(axis[slot])));
                if !self.may_meet(side(&node.min), side(&node.max)) {
                    continue;
                }
                match node.child[slot].kind() {
                    Kind::Node(child) => stack.push(child),
                    Kind::Leaf(leaf, count) if meets(leaf, count) => return true,
                    Kind::Leaf(..) => {}
                }
            }
        }
        false
    }
}

impl PosedScene {
    /// True if no triangle reaches into a pyramid.
    pub fn is_empty(&self, pyramid: &Pyramid) -> bool {
        !pyramid.meets_any(&self.top, |leaf, _| {
            let body = self.bodies[leaf];
            let surface = self.surface(body);
            let within = pyramid.to_body(self.pose(body), surface.anchor);
            within.meets_any(&surface.tree, |leaf, count| {
                let mut triangles = surface.blocks[leaf].triangles[..count].iter();
                triangles.any(|triangle| within.meets(surface.corners(*triangle).map(|corner| corner - surface.anchor)))
            })
        })
    }
}

/// Smallest and largest coordinate of points along an axis.
pub fn extent(points: &[DVec3], axis: DVec3) -> [f64; 2] {
    let places = points.iter().map(|point| point.dot(axis));
    places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DMat3;

    use super::*;
    use crate::cancel::Cancel;
    use crate::rays::surface::{ShadingMode, Surface};

    #[test]
    fn triangles_in_front_beside_behind_and_at_the_rim_of_a_square() {
        let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| DVec3::new(2.0, y, z));
        // A triangle of 0.2 m about a point.
        let small = |x: f64, y: f64, z: f64| {
            let corners = [[0.0, 0.1], [0.1, -0.1], [-0.1, -0.1]];
            corners.map(|[a, b]| DVec3::new(x, y + a, z + b))
        };
        let cases = [
            (small(1.0, 0.0, 0.0), false),
            (small(1.0, 0.55, 0.0), false),
            (small(1.0, 0.65, 0.0), true),
            (small(1.0, 0.0, -0.65), true),
            (small(2.0, 0.0, 0.0), true),
            (small(3.0, 0.0, 0.0), true),
            (small(-1.0, 0.0, 0.0), true),
            // A side of a box that ends at the rim: behind, beside in the plane, and towards the sensor along the rays.
            ([square[0], square[1], DVec3::new(3.0, 0.0, -1.0)], true),
            ([square[0], square[1], DVec3::new(2.0, 0.0, -2.0)], true),
            ([square[0], square[1], 0.5 * square[0]], true),
            ([square[0], square[1], DVec3::new(1.0, 0.0, 0.0)], false),
            // A floor that continues behind, and a large triangle that passes behind the sensor.
            (
                [
                    DVec3::new(0.1, -9.0, -1.0),
                    DVec3::new(0.1, 9.0, -1.0),
                    DVec3::new(9.0, 0.0, -1.0),
                ],
                true,
            ),
            (
                [
                    DVec3::new(-0.1, -9.0, 9.0),
                    DVec3::new(-0.1, 9.0, 9.0),
                    DVec3::new(-0.1, 0.0, -9.0),
                ],
                true,
            ),
            (
                [
                    DVec3::new(0.1, -9.0, 9.0),
                    DVec3::new(0.1, 9.0, 9.0),
                    DVec3::new(0.1, 0.0, -9.0),
                ],
                false,
            ),
        ];
        let rotation = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(0.3);
        let pose = Pose {
            rotation,
            translation: DVec3::new(3.0, -2.0, 5.0),
        };
        for (triangle, is_empty) in cases {
            let vertices = triangle.map(|corner| pose.point_to_body(corner));
            let surface = Surface::new(&vertices, &[[0, 1, 2]], ShadingMode::Flat, &Cancel::default()).unwrap();
            let scene = PosedScene::new(vec![Arc::new(surface)], vec![pose]);
            for along in [DVec3::Y, -DVec3::Z] {
                let pyramid = Pyramid::over(&square, DVec3::X, along);
                assert_eq!(scene.is_empty(&pyramid), is_empty, "{triangle:?}");
            }
        }
    }
}
