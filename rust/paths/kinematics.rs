//! Kinematics: poses of bodies, positions of points and of vertices, at node times of a frame.

use glam::DVec3;

use crate::geometry::pose::Pose;

/// Poses, points and vertices at node times, in the sensor frame; borrowed.
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
    /// Vertices `(node, vertex)` of the bodies of [`Scatterers::deforming`], one after the other, in body coordinates
    /// [m].
    pub vertices: &'a [&'a [[f64; 3]]],
}
