//! Radar cross-sections of a body: ray tubes of a plane wave, and the far field radiated in one direction.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use super::shooting::{Limits, Radiation, Shooter};
use super::tube::Tube;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result};
use crate::geometry::pose::Pose;
use crate::rays::scene::PosedScene;
use crate::rays::surface::Surface;
use crate::scattering::material::Material;
use crate::scattering::physical_optics::Sampling;

/// Rays per wavelength across a body.
const RAYS_PER_WAVELENGTH: f64 = 6.0;

/// Least and largest number of rays across a body.
const RAYS: [f64; 2] = [64.0, 1024.0];

/// Directions and polarisations of incidence and of reception.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aspect {
    /// Unit vectors from the body to the transmitter and to the receiver.
    pub directions: [DVec3; 2],
    /// Field vectors of both antennas, whose transverse part counts; none: antennas without a polarisation.
    pub polarizations: Option<[DVec3; 2]>,
}

/// Radar cross-sections [m^2] of a body of one material at a frequency [Hz], by up to `max_bounces` reflections.
pub fn cross_sections(
    surface: &Arc<Surface>,
    material: Material,
    frequency: f64,
    aspects: &[Aspect],
    max_bounces: usize,
) -> Result<Vec<f64>> {
    if !(frequency > 0.0 && frequency.is_finite()) {
        return Err(Error::value("frequency", "a positive number [Hz]", frequency));
    }
    if surface.num_triangles() == 0 {
        return Ok(vec![0.0; aspects.len()]);
    }
    let snapshot = PosedScene::new(vec![surface.clone()], vec![Pose::IDENTITY]);
    let shooter = Shooter {
        snapshot: &snapshot,
        materials: &[material],
        wavelength: SPEED_OF_LIGHT / frequency,
        limits: Limits {
            max_bounces,
            floor: 0.0,
        },
    };
    Ok(aspects.iter().map(|aspect| shooter.cross_section(aspect)).collect())
}

impl Shooter<'_> {
    fn cross_section(&self, aspect: &Aspect) -> f64 {
        let k = -aspect.directions[0];
        let bounds = self.snapshot.surface(0).bounds();
        let corners = bounds.corners();

        // A rectangle across the wave that covers the body, one side of it horizontal where there is one.
        let across = DVec3::Z.cross(k).try_normalize().unwrap_or(DVec3::Y);
        let axes = [across, k.cross(across)];
        let range = |axis: DVec3| {
            let positions = corners.map(|corner| corner.dot(axis));
            let low = positions.iter().copied().fold(f64::INFINITY, f64::min);
            (low, positions.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low)
        };
        let [first, second] = axes.map(range);
        let finest = RAYS_PER_WAVELENGTH / self.wavelength;
        let number = |extent: f64| (extent * finest).ceil().clamp(RAYS[0], RAYS[1]) as usize;
        let (columns, rows) = (number(first.1), number(second.1));
        let size = [first.1 / columns as f64, second.1 / rows as f64];
        if size[0] * size[1] == 0.0 {
            return 0.0; // seen edge-on
        }
        let (near, depth) = range(k);

        // Sums of rows, added in their order.
        let row = |row: usize| -> Complex64 {
            let height = second.0 + (row as f64 + 0.5) * size[1];
            let cell = |column: usize| {
                let origin = (first.0 + (column as f64 + 0.5) * size[0]) * axes[0] + height * axes[1];
                self.cell(aspect, origin + (near - 0.1 * depth.max(size[0])) * k, axes, size)
            };
            (0..columns).map(cell).sum()
        };
        let rows: Vec<Complex64> = (0..rows).into_par_iter().map(row).collect();

        // sigma = 4 pi |f|^2 of the far field f exp(-j k R) / R, f = j k / (2 pi) times the sum.
        let total: Complex64 = rows.into_iter().sum();
        4.0 * PI * total.norm_sqr() / (self.wavelength * self.wavelength)
    }

    /// Field radiated by one cell towards the receiver.
    fn cell(&self, aspect: &Aspect, origin: DVec3, axes: [DVec3; 2], size: [f64; 2]) -> Complex64 {
        let ([from, to], polarizations) = (aspect.directions, aspect.polarizations);
        let Some(tube) = Tube::plane_wave(self.snapshot, origin, -from, axes, polarizations.map(|e| e[0])) else {
            return Complex64::ZERO;
        };
        let radiate = |tube: &Tube| {
            let radiated = self.radiate(tube, size, to, polarizations.map(|e| e[1]), Sampling::Footprint);
            let seen = radiated.filter(|_| !self.is_occluded(&tube.interaction, to, f64::INFINITY));
            seen.map_or(Complex64::ZERO, |Radiation { amplitude, weight, .. }| {
                let path = tube.length - to.dot(tube.interaction.point);
                amplitude * weight * Complex64::cis(-TAU * (path / self.wavelength).fract())
            })
        };
        let mut total = radiate(&tube);
        self.trace(tube, 1.0, |tube, _| total += radiate(tube));
        total
    }
}
