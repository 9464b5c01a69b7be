//! Cells of an image from which ray tubes are launched.

use glam::DMat3;

use crate::rays::hits::Hits;
use crate::rays::scene::NO_BODY;

/// Hit of a cell of the image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Launch {
    /// Rotation from the axes of the image to those of the sensor.
    pub rotation: DMat3,
    /// Plane coordinates of the centre of the cell, y/x and z/x.
    pub center: [f64; 2],
    /// Width and height of the cell in plane coordinates.
    pub size: [f64; 2],
    /// Number of the body that the ray through the centre hits.
    pub body: u32,
    /// Number of the triangle in the body's surface.
    pub triangle: u32,
}

impl Launch {
    /// Launches of all pixels that hit a body, row by row; `rotation` from the axes of the image to those of the sensor.
    pub fn of_image(hits: &Hits, rotation: DMat3) -> Vec<Self> {
        let plane = &hits.plane;
        let pixels = (0..plane.num_pixels()).filter(|pixel| hits.body[*pixel] != NO_BODY);
        let launch = |pixel: usize| {
            let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
            Self {
                rotation,
                center: [u, v],
                size: [plane.du, plane.dv],
                body: hits.body[pixel],
                triangle: hits.triangle[pixel],
            }
        };
        pixels.map(launch).collect()
    }
}
