//! Poses of bodies, positions of points and of vertices, at the times of a frame.

use glam::DVec3;

use crate::geometry::pose::Pose;

/// Where everything is at a number of times, in the sensor frame.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics<'a> {
    /// Number of times.
    pub num_nodes: usize,
    /// Number of bodies.
    pub num_bodies: usize,
    /// Poses `(node, body)`.
    pub poses: &'a [Pose],
    /// Positions of the point targets `(node, point)` [m].
    pub points: &'a [DVec3],
    /// Radar cross-sections of the point targets [m^2].
    pub rcs: &'a [f64],
    /// Vertices `(node, vertex)` of the bodies of [`Scatterers::deforming`], one after the other, in body coordinates [m].
    pub vertices: &'a [&'a [[f64; 3]]],
}
