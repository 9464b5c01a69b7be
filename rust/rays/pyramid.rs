//! Pyramids from the sensor to a rectangle, and whether surfaces reach into one.

use glam::DVec3;

use crate::geometry::pose::Pose;
use crate::rays::scene::PosedScene;
use crate::rays::surface::Surface;
use crate::rays::tree::{Kind, WIDTH};

/// Depth by which a surface may reach through a side of a pyramid [m].
pub const THROUGH_SIDE: f64 = 1e-6;

/// Depth by which a surface may reach through its base [m].
pub const THROUGH_BASE: f64 = 2e-5;

/// Pyramid with the apex at the origin of the sensor frame: the half spaces of its sides and of its base. A point is
/// inside where all are larger than zero.
pub struct Pyramid {
    /// Inward unit normals, and distances of the planes from the origin along them [m].
    planes: [(DVec3, f64); 5],
}

impl Pyramid {
    /// Pyramid over the smallest rectangle with a side along a direction that contains points of a plane; `normal`: that of
    /// the plane, away from the sensor.
    pub fn over(points: &[DVec3], normal: DVec3, along: DVec3) -> Self {
        let axes = [along, normal.cross(along)];
        let height = points[0].dot(normal);
        let [u, v] = axes.map(|axis| {
            let places = points.iter().map(|point| point.dot(axis));
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            })
        });
        let corner = |i: usize, j: usize| height * normal + u[i] * axes[0] + v[j] * axes[1];
        let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        let middle = 0.25 * corners.iter().sum::<DVec3>();
        let mut planes = [(-normal, THROUGH_BASE - height); 5];
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

    /// True if a point may be inside that is the one farthest along every normal.
    fn may_meet(&self, farthest: impl Fn(DVec3) -> f64) -> bool {
        self.planes
            .iter()
            .all(|(normal, distance)| farthest(*normal) > *distance)
    }

    /// True if a triangle of a surface may reach into the pyramid, which is in the frame of the surface's boxes.
    fn may_meet_surface(&self, surface: &Surface) -> bool {
        let mut stack = if surface.tree.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(node) = stack.pop() {
            let node = &surface.tree.nodes[node];
            for slot in 0..WIDTH {
                let side = |of: &[[f32; WIDTH]; 3]| DVec3::from_array(of.map(|axis| f64::from(axis[slot])));
                let (min, max) = (side(&node.min), side(&node.max));
                // Slots without a child hold an empty box.
                let is_box = min.cmple(max).all();
                let corner = |normal: DVec3| DVec3::select(normal.cmpgt(DVec3::ZERO), max, min);
                if !is_box || !self.may_meet(|normal| normal.dot(corner(normal))) {
                    continue;
                }
                match node.child[slot].kind() {
                    Kind::Node(child) => stack.push(child),
                    Kind::Leaf(leaf, count) => {
                        for triangle in &surface.blocks[leaf].triangles[..count] {
                            let corners = surface.corners(*triangle).map(|corner| corner - surface.anchor);
                            let along = |normal: DVec3| corners.map(|corner| normal.dot(corner));
                            if self.may_meet(|normal| along(normal).into_iter().fold(f64::NEG_INFINITY, f64::max)) {
                                return true;
                            }
                        }
                    }
                }
            }
        }
        false
    }
}

impl PosedScene {
    /// True if no triangle reaches into a pyramid. Triangles that pass a corner outside may count as reaching in.
    pub fn is_empty(&self, pyramid: &Pyramid) -> bool {
        self.bodies.iter().all(|body| {
            let (surface, pose) = (self.surface(*body), self.pose(*body));
            let within = pyramid.to_body(pose, surface.anchor);
            !within.may_meet_surface(surface)
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DMat3;

    use super::*;
    use crate::cancel::Cancel;
    use crate::rays::surface::ShadingMode;

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
