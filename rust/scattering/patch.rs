//! Patches of surfaces behind the cells of an image.

use glam::DVec3;

use crate::rays::camera::Cell;
use crate::rays::hits::Hits;
use crate::rays::scene::{NO_BODY, PosedScene};
use crate::rays::smooth_hits::SmoothHits;

/// Smallest cosine of incidence at which a surface returns power.
pub(crate) const MIN_COSINE: f64 = 1e-6;

/// Plane patch of surface behind one cell.
#[derive(Clone, Copy)]
pub(crate) struct Patch {
    /// Number of the cell.
    pub(crate) index: usize,
    pub(crate) body: u32,
    pub(crate) cell: Cell,
    /// Distance to the curved surface that the triangle approximates [m].
    pub(crate) distance: f64,
    /// Unit normal towards the incident side, sensor frame.
    pub(crate) normal: DVec3,
}

impl Patch {
    pub(crate) const NOTHING: Self = Self {
        index: 0,
        body: NO_BODY,
        cell: Cell {
            u: 0.0,
            v: 0.0,
            du: 0.0,
            dv: 0.0,
        },
        distance: 0.0,
        normal: DVec3::ZERO,
    };

    /// Patch of the same plane behind the cell that is `sides` widths away along u and v. None at grazing angles.
    pub(crate) fn about(&self, sides: [f64; 2]) -> Option<Self> {
        let cell = self.cell.about(sides);
        let distance = self.distance * self.normal.dot(self.cell.direction()) / self.normal.dot(cell.direction());
        let is_near = distance > 0.5 * self.distance && distance < 2.0 * self.distance;
        is_near.then_some(Self {
            cell,
            distance,
            ..*self
        })
    }

    /// Point in the middle of the patch, sensor frame [m].
    pub(crate) fn point(&self) -> DVec3 {
        self.distance * self.cell.direction()
    }

    /// Area of the patch [m^2]; none where it faces away from the sensor.
    pub(crate) fn area(&self) -> Option<f64> {
        let cosine = -self.normal.dot(self.cell.direction());
        let area = self.distance * self.distance * self.cell.solid_angle() / cosine;
        (cosine >= MIN_COSINE && self.distance > 0.0).then_some(area)
    }
}

/// Vertices of the triangle that the ray of a cell hit, and barycentric weights of the hit.
pub fn place_on_mesh(scene: &PosedScene, cell: &Cell, body: u32, triangle: u32) -> ([u32; 3], [f64; 3]) {
    let weights = scene.barycentric(body, triangle, DVec3::new(1.0, cell.u, cell.v));
    (scene.surface(body).vertices_of(triangle), weights)
}

/// Patch of the hit of one pixel; none where nothing was hit.
pub(crate) fn patch(hits: &Hits, smooth: &SmoothHits, pixel: usize) -> Option<Patch> {
    let body = hits.body[pixel];
    let (row, column) = (pixel / hits.plane.columns, pixel % hits.plane.columns);
    (body != NO_BODY).then(|| Patch {
        index: pixel,
        body,
        cell: hits.plane.cell(row, column),
        distance: smooth.distance[pixel],
        normal: smooth.normal[pixel],
    })
}
