//! Kinematics: poses of bodies, positions of points and of vertices, at node times of a frame.

use glam::DVec3;

use crate::geometry::moving_triangle::MovingTriangle;
use crate::geometry::pose::Pose;

/// Poses, points and vertices at node times, in the sensor frame; or their time derivatives.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// Number of times.
    pub num_nodes: usize,
    /// Number of bodies.
    pub num_bodies: usize,
    /// Poses `(node, body)`.
    pub poses: Vec<Pose>,
    /// Positions of the point targets `(node, point)` [m].
    pub points: Vec<DVec3>,
    /// Radar cross-sections of the point targets [m^2].
    pub rcs: Vec<f64>,
    /// Bodies that deform, with their vertices `(node, vertex)` in body coordinates [m]; others may be left out.
    pub vertices: Vec<(u32, Vec<[f64; 3]>)>,
}

impl Kinematics {
    /// Triangle that carries a material point of a body that deforms; the corners may be velocities.
    ///
    /// `corners`: vertices of the triangle, none on bodies that do not deform.
    pub(crate) fn moving_triangle(&self, node: usize, body: u32, corners: Option<[u32; 3]>) -> Option<MovingTriangle> {
        let corners = corners?;
        let (_, vertices) = self.vertices.iter().find(|deforming| deforming.0 == body)?;
        let vertices = &vertices[node * (vertices.len() / self.num_nodes)..];
        Some(MovingTriangle::new(
            corners.map(|vertex| DVec3::from_array(vertices[vertex as usize])),
        ))
    }

    /// Position [m] and velocity [m/s] of a material point at the first node, sensor frame; `rates` are the time
    /// derivatives. See [`Self::moving_triangle`].
    pub(crate) fn motion(
        &self,
        rates: &Self,
        body: u32,
        corners: Option<[u32; 3]>,
        mut position: DVec3,
    ) -> (DVec3, DVec3) {
        let (pose, rate) = (&self.poses[body as usize], &rates.poses[body as usize]);
        let triangles = [self, rates].map(|kinematics| kinematics.moving_triangle(0, body, corners));
        let mut velocity = DVec3::ZERO;
        if let [Some(triangle), Some(triangle_rate)] = triangles {
            velocity = triangle.velocity(&triangle_rate, position);
            position = triangle.point(position);
        }
        (pose.point(position), rate.point(position) + pose.direction(velocity))
    }
}
