//! Far fields and radar cross-sections of a body: ray tubes of a plane wave, and the field radiated in one direction.

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

/// Rays of cross-sections.
const RAYS: Rays = Rays {
    per_wavelength: 6.0,
    least: 64.0,
    most: 1024.0,
};

/// Number of rays across a body, along each side of the rectangle that covers it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rays {
    /// Rays per wavelength.
    pub(super) per_wavelength: f64,
    /// Least number of rays.
    pub(super) least: f64,
    /// Largest number of rays.
    pub(super) most: f64,
}

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
    let fields = far_fields(
        surface,
        material,
        SPEED_OF_LIGHT / frequency,
        aspects,
        max_bounces,
        RAYS,
    );
    Ok(fields.into_iter().map(|f| 4.0 * PI * f.norm_sqr()).collect())
}

/// Far fields f of a body of one material, with `f exp(-j k R) / R` at a distance R in a unit wave [m].
pub(super) fn far_fields(
    surface: &Arc<Surface>,
    material: Material,
    wavelength: f64,
    aspects: &[Aspect],
    max_bounces: usize,
    rays: Rays,
) -> Vec<Complex64> {
    if surface.num_triangles() == 0 {
        return vec![Complex64::ZERO; aspects.len()];
    }
    let scene = PosedScene::new(vec![surface.clone()], vec![Pose::IDENTITY]);
    let shooter = Shooter {
        scene: &scene,
        materials: &[material],
        wavelength,
        limits: Limits {
            max_bounces,
            floor: 0.0,
        },
    };
    aspects.iter().map(|aspect| shooter.far_field(aspect, rays)).collect()
}

impl Shooter<'_> {
    fn far_field(&self, aspect: &Aspect, rays: Rays) -> Complex64 {
        let k = -aspect.directions[0];
        let bounds = self.scene.surface(0).bounds();
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
        let finest = rays.per_wavelength / self.wavelength;
        let number = |extent: f64| (extent * finest).ceil().clamp(rays.least, rays.most) as usize;
        let (columns, rows) = (number(first.1), number(second.1));
        let size = [first.1 / columns as f64, second.1 / rows as f64];
        if size[0] * size[1] == 0.0 {
            return Complex64::ZERO; // seen edge-on
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

        // j k / (2 pi) times the sum.
        rows.into_iter().sum::<Complex64>() * Complex64::I / self.wavelength
    }

    /// Field radiated by one cell towards the receiver.
    fn cell(&self, aspect: &Aspect, origin: DVec3, axes: [DVec3; 2], size: [f64; 2]) -> Complex64 {
        let ([from, to], polarizations) = (aspect.directions, aspect.polarizations);
        let Some(tube) = Tube::plane_wave(self.scene, origin, -from, axes, polarizations.map(|e| e[0])) else {
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
