//! Material frame: coordinates of the body, or of the triangle where the body deforms.

use glam::DVec3;

use crate::geometry::moving_triangle::MovingTriangle;
use crate::geometry::pose::Pose;
use crate::rays::scene::PosedScene;

/// Frame of reference of material points.
pub struct MaterialFrame<'a> {
    pose: &'a Pose,
    /// Triangle that carries the points, where the body deforms, and its vertices.
    triangle: Option<([u32; 3], MovingTriangle)>,
}

impl<'a> MaterialFrame<'a> {
    /// Material frame of a triangle of a body.
    pub fn new(scene: &'a PosedScene, body: u32, triangle: u32) -> Self {
        let surface = scene.surface(body);
        let moving = || {
            (
                surface.vertices_of(triangle),
                MovingTriangle::new(surface.corners(triangle)),
            )
        };
        Self {
            pose: scene.pose(body),
            triangle: surface.is_deformed().then(moving),
        }
    }

    /// Vertices of the triangle that carries the points.
    pub fn corners(&self) -> Option<[u32; 3]> {
        self.triangle.as_ref().map(|(corners, _)| *corners)
    }

    /// Map a point of the sensor frame [m] to the material frame.
    pub fn position(&self, point: DVec3) -> DVec3 {
        let position = self.pose.point_to_body(point);
        self.triangle
            .as_ref()
            .map_or(position, |(_, triangle)| triangle.coordinates(position))
    }

    /// Map a unit normal of the sensor frame to the material frame: a vector, or slopes along the triangle.
    pub fn normal(&self, normal: DVec3) -> DVec3 {
        let normal = self.pose.direction_to_body(normal);
        self.triangle
            .as_ref()
            .map_or(normal, |(_, triangle)| triangle.slopes(normal))
    }

    /// Map the edges of a patch [m] to the material frame.
    pub fn edges(&self, edges: [DVec3; 2]) -> [DVec3; 2] {
        edges.map(|edge| {
            let edge = self.pose.direction_to_body(edge);
            self.triangle
                .as_ref()
                .map_or(edge, |(_, triangle)| triangle.coordinates_of_vector(edge))
        })
    }
}
