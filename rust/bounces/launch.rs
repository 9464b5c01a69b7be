//! Cells of an image from which ray tubes are launched.

use glam::{DMat3, DVec3};

use crate::rays::hits::Hits;
use crate::rays::scene::{NEAREST, NO_BODY, PosedScene};
use crate::rays::watertight::Ray;

/// Hit of a cell of the image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Launch {
    /// Rotation from the axes of the image to the axes of the sensor.
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
    /// Launch of a cell of these plane coordinates and size, of what the ray through its centre hits; none for a miss.
    pub fn at(scene: &PosedScene, rotation: DMat3, center: [f64; 2], size: [f64; 2]) -> Option<Self> {
        let hit = scene.cast(&Ray {
            origin: DVec3::ZERO,
            direction: rotation * DVec3::new(1.0, center[0], center[1]),
            start: NEAREST,
        });
        (hit.body != NO_BODY).then_some(Self {
            rotation,
            center,
            size,
            body: hit.body,
            triangle: hit.triangle,
        })
    }

    /// Launch of a pixel; none for one that hits nothing.
    pub(super) fn of_pixel(hits: &Hits, rotation: DMat3, pixel: usize) -> Option<Self> {
        let plane = &hits.plane;
        let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
        (hits.body[pixel] != NO_BODY).then_some(Self {
            rotation,
            center: [u, v],
            size: [plane.du, plane.dv],
            body: hits.body[pixel],
            triangle: hits.triangle[pixel],
        })
    }
}

/// Centres of the quarters of a cell.
pub(super) fn quarter_centers(center: [f64; 2], size: [f64; 2]) -> [[f64; 2]; 4] {
    [[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]]
        .map(|sides: [f64; 2]| [0, 1].map(|axis| center[axis] + sides[axis] * size[axis]))
}
