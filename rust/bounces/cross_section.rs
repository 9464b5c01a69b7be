//! Far fields and radar cross-sections of bodies in a plane wave.
//!
//! The first reflection is an integral over the triangles (`first_reflection`). Paths of several reflections are ray
//! tubes, cell by cell of a plane across the wave; a cell whose quarters radiate another field is quartered.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use super::aspect::Aspect;
use super::first_reflection::{Reflected, first_reflection};
use super::launch::quarter_centers;
use super::shooting::{Limits, Radiation, Shooter};
use super::tube::Tube;
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result};
use crate::geometry::aabb::Bounds;
use crate::rays::scene::PosedScene;
use crate::scattering::material::Material;
use crate::scattering::refinement::Sampling;

/// Number of cells across the scene at first, along the longer side of the rectangle that covers it.
const CELLS: f64 = 128.0;

/// Side of the smallest cells [wavelengths].
const FINEST: f64 = 1.0 / 6.0;

/// Largest difference between the fields radiated by a cell and by its quarters, relative to a plate of its size that
/// faces the radar.
const MOST_DIFFERENT: f64 = 0.02;

/// Radar cross-sections [m^2] of the bodies of a scene at a frequency [Hz], by up to `max_bounces` reflections; one
/// material per body. `done` is called after every aspect.
pub fn cross_sections(
    scene: &PosedScene,
    materials: &[Material],
    frequency: f64,
    aspects: &[Aspect],
    max_bounces: usize,
    cancel: &Cancel,
) -> Result<Vec<f64>> {
    if !(frequency > 0.0 && frequency.is_finite()) {
        return Err(Error::value("frequency", "a positive number [Hz]", frequency));
    }
    let shooter = Shooter {
        scene,
        materials,
        wavelength: SPEED_OF_LIGHT / frequency,
        limits: Limits {
            max_bounces,
            floor: 0.0,
        },
    };
    let of = |aspect: &Aspect| {
        let Reflected { field, diffuse } = shooter.far_field(aspect, cancel)?;
        cancel.advance(1);
        Ok(4.0 * PI * field.norm_sqr() + diffuse)
    };
    aspects.par_iter().map(of).collect()
}

impl Shooter<'_> {
    fn far_field(&self, aspect: &Aspect, cancel: &Cancel) -> Result<Reflected> {
        let mut reflected = first_reflection(self, aspect, cancel)?;
        if self.limits.max_bounces > 1 {
            reflected.field += self.bounced(aspect, cancel)?;
        }
        // j k / (2 pi) times the sum.
        reflected.field *= Complex64::I / self.wavelength;
        Ok(reflected)
    }

    /// Field of all paths of two and more reflections, without the factor `j / lambda`.
    fn bounced(&self, aspect: &Aspect, cancel: &Cancel) -> Result<Complex64> {
        let Some((wave, grid)) = PlaneWave::over(self, aspect) else {
            return Ok(Complex64::ZERO);
        };
        // Sums of rows, added in their order.
        let row = |row: usize| -> Result<Complex64> {
            cancel.check()?;
            let cells = (0..grid.columns).map(|column| {
                let center = grid.center(row, column);
                wave.quartered(center, grid.size, wave.bounced(center, grid.size))
            });
            Ok(cells.sum())
        };
        let rows: Result<Vec<Complex64>> = (0..grid.rows).into_par_iter().map(row).collect();
        Ok(rows?.into_iter().sum())
    }
}

/// Cells of a rectangle across a plane wave.
struct CellGrid {
    rows: usize,
    columns: usize,
    /// Size of a cell [m].
    size: [f64; 2],
    /// Corner of the rectangle [m].
    first: [f64; 2],
}

impl CellGrid {
    fn center(&self, row: usize, column: usize) -> [f64; 2] {
        let at = |axis: usize, number: usize| self.first[axis] + (number as f64 + 0.5) * self.size[axis];
        [at(0, column), at(1, row)]
    }
}

/// Ray tubes of a plane wave.
struct PlaneWave<'a> {
    shooter: &'a Shooter<'a>,
    aspect: &'a Aspect,
    /// Unit vectors across the wave.
    axes: [DVec3; 2],
    /// Point in front of the scene.
    front: DVec3,
}

impl<'a> PlaneWave<'a> {
    /// Plane wave with a grid of cells that covers the scene; none for a scene that is empty or seen edge-on.
    fn over(shooter: &'a Shooter<'a>, aspect: &'a Aspect) -> Option<(Self, CellGrid)> {
        let (scene, k) = (shooter.scene, -aspect.directions[0]);
        let bodies = (0..scene.num_bodies() as u32).filter(|body| scene.surface(*body).num_triangles() > 0);
        let corners = bodies.flat_map(|body| scene.corners(body));

        // One side of the rectangle is horizontal where there is one.
        let across = DVec3::Z.cross(k).try_normalize().unwrap_or(DVec3::Y);
        let axes = [across, k.cross(across)];
        let seen = Bounds::of(corners.map(|at| DVec3::new(at.dot(axes[0]), at.dot(axes[1]), at.dot(k))));
        let extent = seen.max - seen.min;
        if !(extent.x > 0.0 && extent.y > 0.0) {
            return None;
        }
        let side = extent.x.max(extent.y) / CELLS;
        let [columns, rows] = [extent.x, extent.y].map(|length| (length / side).ceil().max(1.0));
        let grid = CellGrid {
            rows: rows as usize,
            columns: columns as usize,
            size: [extent.x / columns, extent.y / rows],
            first: [seen.min.x, seen.min.y],
        };
        let wave = Self {
            shooter,
            aspect,
            axes,
            front: (seen.min.z - 0.1 * extent.z.max(side)) * k,
        };
        Some((wave, grid))
    }
}

impl PlaneWave<'_> {
    /// Field radiated by a cell after two and more reflections, by way of its quarters where these radiate another one.
    fn quartered(&self, center: [f64; 2], size: [f64; 2], whole: Complex64) -> Complex64 {
        let half = size.map(|size| 0.5 * size);
        let parts = quarter_centers(center, size).map(|center| (center, self.bounced(center, half)));
        let sum: Complex64 = parts.iter().map(|(_, field)| field).sum();
        let is_finest = half[0].max(half[1]) <= FINEST * self.shooter.wavelength;
        if is_finest || (sum - whole).norm() <= MOST_DIFFERENT * size[0] * size[1] {
            return sum;
        }
        parts
            .iter()
            .map(|(center, field)| self.quartered(*center, half, *field))
            .sum()
    }

    /// Field radiated by one cell towards the receiver after two and more reflections.
    fn bounced(&self, center: [f64; 2], size: [f64; 2]) -> Complex64 {
        let Some(tube) = self.tube(center) else {
            return Complex64::ZERO;
        };
        let mut total = Complex64::ZERO;
        self.shooter
            .trace(tube, 1.0, |tube, _| total += self.radiated(tube, size));
        total
    }

    fn tube(&self, center: [f64; 2]) -> Option<Tube> {
        let origin = self.front + center[0] * self.axes[0] + center[1] * self.axes[1];
        let sent = self.aspect.polarizations.map(|e| e[0]);
        Tube::plane_wave(self.shooter.scene, origin, -self.aspect.directions[0], self.axes, sent)
    }

    fn radiated(&self, tube: &Tube, size: [f64; 2]) -> Complex64 {
        let (shooter, to) = (self.shooter, self.aspect.directions[1]);
        let received = self.aspect.polarizations.map(|e| e[1]);
        let radiated = shooter.radiate(tube, size, to, received, Sampling::Footprint);
        let seen = radiated.filter(|_| !shooter.is_occluded(&tube.interaction, to, f64::INFINITY));
        seen.map_or(Complex64::ZERO, |Radiation { amplitude, weight, .. }| {
            let path = tube.length - to.dot(tube.interaction.point);
            amplitude * weight * Complex64::cis(-TAU * (path / shooter.wavelength).fract())
        })
    }
}
