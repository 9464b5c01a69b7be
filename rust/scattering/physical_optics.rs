//! Amplitudes of patches: physical optics for the specular part, Lambert's law for the diffuse one.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::array::Array;
use crate::antennas::polarization::Seen;
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::triangle::area;
use crate::paths::scatterers::{Weight, bisector};
use crate::rays::scene::PosedScene;
use crate::scattering::lambert::Speckle;
use crate::scattering::material::{Material, Response};
use crate::scattering::material_frame::{MaterialFrame, speckle_turns};
use crate::scattering::material_points::{NO_CELL, Points, SurfaceSample};
use crate::scattering::patch::Patch;
use crate::scattering::taper::taper;

/// Sampling of the patch behind a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// One point, no phase variation over the patch and no random phase: one phasor per pixel as in Stetco et al., ICRA
    /// 2020, but with the weight of the patch. It does not converge; for comparison.
    Point,
    /// The phase varies linearly over the patch, tapered so that steep patches drop out.
    Footprint,
}

pub(crate) struct Weigh<'a> {
    pub(crate) array: &'a Array,
    pub(crate) sampling: Sampling,
}

impl Weigh<'_> {
    /// Response of the material of a surface with a unit normal to antennas in unit directions. The cosine of incidence
    /// is the mean of both cosines, which is exact in the specular direction.
    pub(crate) fn response(&self, material: &Material, normal: DVec3, t: DVec3, r: DVec3) -> Response {
        let cosine = 0.5 * ((-normal.dot(t)).max(0.0) + (-normal.dot(r)).max(0.0));
        let polarization = self.array.polarization;
        let seen = polarization.map(|e| Seen::by(e, normal, t, r));
        material.response(cosine, SPEED_OF_LIGHT / self.array.frequency, seen)
    }

    /// Append the material point of a patch, with specular and diffuse weights for every channel.
    pub(crate) fn patch(&self, patch: &Patch, frame: &MaterialFrame, material: &Material, points: &mut Points) {
        let Some(area) = patch.area() else { return };
        let point = patch.point();
        let position = frame.position(point);
        let cube = frame.cube(position);
        let phase = match self.sampling {
            Sampling::Point => 0.0,
            Sampling::Footprint => TAU * speckle_turns(cube),
        };
        let phasor = Complex64::cis(phase);
        let [along_u, along_v] = patch.cell.edges(patch.distance, patch.normal);
        for channel in 0..self.array.num_channels() {
            let [t, r] = self.array.directions(channel, point);
            let response = self.response(material, patch.normal, t, r);
            let mut specular = specular(&response, area);
            if self.sampling == Sampling::Footprint && specular != Complex64::ZERO {
                let bisector = bisector(self.array.frequency, t, r);
                specular *= taper(bisector.dot(along_u)) * taper(bisector.dot(along_v));
            }
            let diffuse = phasor * self.diffuse(&response, area);
            points.weights.push(Weight { specular, diffuse });
        }
        let sample = SurfaceSample {
            position,
            edges: [DVec3::ZERO; 2],
            order: 0,
            area,
            cube,
        };
        points.push(patch, frame, sample, self.array.num_channels());
    }

    /// Append a diffuse point of a surface.
    pub(crate) fn diffuse_point(
        &self,
        scene: &PosedScene,
        body: u32,
        speckle: &Speckle,
        point: usize,
        material: &Material,
        points: &mut Points,
    ) {
        let Speckle {
            points: spread, normal, ..
        } = speckle;
        let frame = MaterialFrame::of_mesh(scene, body, spread.triangle[point], 0);
        let (surface, triangle) = (scene.surface(body), spread.triangle[point]);
        let position = spread.position(surface, point);
        let place = frame.pose.point(position);
        // A surface that stretches keeps its points; the area of each grows.
        let stretch = area(&surface.corners(triangle)) / area(&surface.rest_corners(triangle));
        let phasor = Complex64::cis(TAU * spread.turns[point]);
        for channel in 0..self.array.num_channels() {
            let [t, r] = self.array.directions(channel, place);
            let response = self.response(material, normal[point], t, r);
            points.weights.push(Weight {
                specular: Complex64::ZERO,
                diffuse: phasor * self.diffuse(&response, stretch * spread.area),
            });
        }
        let patch = Patch {
            index: NO_CELL as usize,
            body,
            normal: normal[point],
            ..Patch::NOTHING
        };
        let sample = SurfaceSample {
            position: frame.position(place),
            edges: [DVec3::ZERO; 2],
            order: 0,
            area: 0.0,
            cube: 0,
        };
        points.push(&patch, &frame, sample, self.array.num_channels());
    }

    /// Magnitude of the diffuse weight `(lambda / 4 pi) sqrt(rho dA / pi)`.
    pub(crate) fn diffuse(&self, response: &Response, area: f64) -> f64 {
        SPEED_OF_LIGHT / self.array.frequency / (4.0 * PI) * (response.albedo * area / PI).sqrt()
    }
}

/// Specular weight `(j / 4 pi) Gamma dA / 2`.
pub(crate) fn specular(response: &Response, area: f64) -> Complex64 {
    Complex64::new(0.0, 1.0 / (8.0 * PI)) * response.reflection * area
}
