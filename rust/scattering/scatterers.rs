//! Scatterers from samples: points of tiles and random points of surfaces become material points.
//!
//! A material point moves with its body, or with its triangle where the body deforms, and `paths` evaluates its delay
//! and amplitude at any time of the frame.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antennas::array::Array;
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::triangle::area;
use crate::paths::scatterers::Scatterers;
use crate::rays::scene::PosedScene;
use crate::scattering::lambert::Speckle;
use crate::scattering::material::Material;
use crate::scattering::material_frame::MaterialFrame;
use crate::scattering::samples::SceneSamples;
use crate::scattering::sampling::PointRange;
use crate::scattering::tile_point::{TilePoint, TilePoints};

/// Points that one task makes.
const BLOCK: usize = 1024;

impl Scatterers {
    /// Material points of the samples of sectors, in their scenes and arrays, ordered by `rank` of the body, by power of
    /// the frequency, and by body. `range_rates`: of the pixels that the points come from [m/s].
    pub fn of_samples(
        sectors: &[(&PosedScene, &Array)],
        samples: &SceneSamples,
        materials: &[Material],
        array: Array,
        rank: impl Fn(u32) -> u8,
        range_rates: Option<&[f64]>,
    ) -> Self {
        let num_weights = samples.tiles.num_weights;
        let mut diffuse = Vec::new();
        for (number, ((scene, array), speckles)) in sectors.iter().zip(&samples.speckles).enumerate() {
            for (body, speckle) in speckles.iter().enumerate() {
                let Some(speckle) = speckle else { continue };
                let surface = DiffuseSurface {
                    scene,
                    array,
                    body: body as u32,
                    material: &materials[body],
                    speckle,
                    has_common_weight: samples.tiles.has_common_weight,
                };
                let points = surface.points().into_iter();
                diffuse.extend(points.map(|points| PointRange::whole(number, Arc::new(points))));
            }
        }
        let pieces: Vec<&PointRange> = diffuse.iter().chain(&samples.tiles.pieces).collect();

        // Points body by body, edges and corners after all others.
        let num_bodies = sectors[0].0.num_bodies();
        let mut groups: Vec<Vec<(u32, u32)>> = Vec::new();
        let mut is_turning = false;
        for (number, piece) in (0..).zip(&pieces) {
            for (point, at) in piece.points().iter().zip(0..) {
                let group =
                    usize::from(piece.kind(at as usize).frequency_exponent()) * num_bodies + point.body as usize;
                if groups.len() <= group {
                    groups.resize(group + 1, Vec::new());
                }
                groups[group].push((number, at));
                is_turning |= piece.edges(at as usize) != [DVec3::ZERO; 2];
            }
        }
        let mut order: Vec<usize> = (0..groups.len()).collect();
        order.sort_by_key(|group| (rank((group % num_bodies) as u32), *group));
        let numbers: Vec<(u32, u32)> = order.iter().flat_map(|group| &groups[*group]).copied().collect();

        let scene = sectors[0].0;
        let is_deformed = (0..num_bodies as u32).any(|body| scene.surface(body).is_deformed());
        let point = |(piece, point): &(u32, u32)| &pieces[*piece as usize].points()[*point as usize];
        let points = || numbers.par_iter().with_min_len(BLOCK);
        let frame = |number: &(u32, u32)| {
            let point = point(number);
            let scene = sectors[pieces[number.0 as usize].sector].0;
            (point, MaterialFrame::new(scene, point.body, point.triangle))
        };
        let place = |number: &(u32, u32)| {
            let (point, frame) = frame(number);
            (frame.position(point.position), frame.normal(point.normal))
        };
        let (position, normal) = points().map(place).unzip();
        let corners = |number: &(u32, u32)| frame(number).1.corners();
        let piece = |number: &(u32, u32)| (pieces[number.0 as usize], number.1 as usize);
        let edges = |number: &(u32, u32)| {
            let (piece, point) = piece(number);
            frame(number).1.edges(piece.edges(point))
        };
        let kind = |number: &(u32, u32)| {
            let (piece, point) = piece(number);
            piece.kind(point)
        };
        let weights = |(piece, point): &(u32, u32)| pieces[*piece as usize].weights(*point as usize, num_weights);
        let has_kinds = groups.len() > num_bodies;
        Self {
            array,
            body: points().map(|number| point(number).body).collect(),
            kind: points().filter(|_| has_kinds).map(kind).collect(),
            corners: points().filter(|_| is_deformed).map(corners).collect(),
            position,
            normal,
            patch: points().filter(|_| is_turning).map(edges).collect(),
            weights: numbers.iter().flat_map(weights).copied().collect(),
            range_rate: range_rates.map_or_else(Vec::new, |rates| {
                numbers
                    .iter()
                    .map(|number| rates[point(number).triangle as usize])
                    .collect()
            }),
            rcs: Vec::new(),
        }
    }
}

/// Surface with random points.
struct DiffuseSurface<'a> {
    scene: &'a PosedScene,
    array: &'a Array,
    body: u32,
    material: &'a Material,
    speckle: &'a Speckle,
    has_common_weight: bool,
}

impl DiffuseSurface<'_> {
    /// Visible points and their weights, block by block: one weight for the middle of the array, or one per channel.
    fn points(&self) -> Vec<TilePoints> {
        let number = self.speckle.normal.len();
        let blocks = (0..number).into_par_iter().step_by(BLOCK);
        let points = |first: usize| {
            let mut points = TilePoints::default();
            let block = first..number.min(first + BLOCK);
            for point in block.filter(|point| self.speckle.normal[*point] != DVec3::ZERO) {
                self.add(point, &mut points);
            }
            points
        };
        blocks.map(points).collect()
    }

    fn add(&self, point: usize, points: &mut TilePoints) {
        let spread = &self.speckle.points;
        let (triangle, normal) = (spread.triangle[point], self.speckle.normal[point]);
        let surface = self.scene.surface(self.body);
        let position = self.scene.pose(self.body).point(spread.position(surface, point));
        // A surface that stretches keeps its points; the area of each grows.
        let stretch = area(&surface.corners(triangle)) / area(&surface.rest_corners(triangle));
        let phasor = Complex64::cis(TAU * spread.turns[point]);
        let wavelength = SPEED_OF_LIGHT / self.array.frequency;
        let weight = |directions: [DVec3; 2]| {
            let response = self.material.response_to(self.array, normal, directions);
            phasor * response.diffuse(stretch * spread.area, wavelength, normal, directions)
        };
        let point = TilePoint {
            position,
            normal,
            body: self.body,
            triangle,
        };
        points.add(point, self.array, self.has_common_weight, weight);
    }
}
