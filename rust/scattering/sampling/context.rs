//! Sector, tables and limits that tiles are evaluated with.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use num_complex::Complex64;

use super::cells::TileCells;
use super::contour::Contours;
use super::join::Join;
use super::tile_index::planes;
use crate::antennas::array::Array;
use crate::constants::SPEED_OF_LIGHT;
use crate::numeric::random::mix;
use crate::paths::scatterers::bisector;
use crate::rays::camera::ImagePlane;
use crate::rays::packet::MOST_RAYS;
use crate::scattering::material::Material;
use crate::scattering::refinement::Sampling;
use crate::scattering::sector::Sector;
use crate::scattering::taper::taper;

/// Rotation of a body [rad] above which the phase over a cell is followed, and points are not joined.
const MOST_TURN: f32 = 0.05;

/// Largest distance of an antenna from the middle of the array [m] with weights of the middle: angles of incidence and
/// polarisation differ by a few degrees at arm's length.
const SMALL_ARRAY: f64 = 0.025;

/// Largest change of the slope of a cell from the middle of the array to the middle of a pair of antennas, for all
/// channels to share one weight [rad].
const ONE_WEIGHT: f64 = 0.25;

/// Sector, tables and limits that tiles are evaluated with.
pub(super) struct Context<'a> {
    pub(super) sector: &'a Sector<'a>,
    pub(super) materials: &'a [Material],
    /// Flat regions that cells leave out.
    pub(super) contours: &'a Contours,
    /// Image planes of all levels.
    pub(super) planes: Vec<ImagePlane>,
    /// True if the array is small: points have one weight for all channels, otherwise one each.
    pub(super) has_common_weight: bool,
    /// True if cells have diffuse power: no random points stand for it.
    pub(super) has_diffuse_cells: bool,
    /// Limits of joined points, per body.
    pub(super) join: Vec<Join>,
    /// Angle by which every body turns [rad]; 0 where its cells keep their tapers.
    pub(super) turns: Vec<f32>,
    pub(super) wavenumber: f64,
}

impl<'a> Context<'a> {
    /// Context of a sector; `has_common_weight`: see [`has_common_weight`].
    pub(super) fn new(
        sector: &'a Sector,
        materials: &'a [Material],
        contours: &'a Contours,
        has_common_weight: bool,
    ) -> Self {
        let scene = sector.scene;
        let wavenumber = TAU / (SPEED_OF_LIGHT / sector.array.frequency);
        let is_point = sector.sampling == Sampling::Point;
        let turn = |body| sector.turns.get(body).map_or(0.0, |turn| *turn as f32);
        let turns = || (0..scene.num_bodies()).map(turn);
        let join = turns().zip(0..).map(|(turn, body)| {
            // Points of a body that deforms lie on triangles; joined points do not turn against each other.
            let is_rigid = !scene.surface(body).is_deformed();
            let is_joined = is_rigid && turn <= MOST_TURN;
            let phase = if is_joined { sector.join as f32 } else { 0.0 };
            Join { phase, turn }
        });
        let follows = |turn: f32| turn > MOST_TURN && sector.refinement.is_some();
        Self {
            sector,
            materials,
            contours,
            planes: planes(&sector.plane),
            has_common_weight,
            has_diffuse_cells: sector.image.is_some() || is_point && materials.iter().any(Material::is_diffuse),
            join: join.collect(),
            turns: turns().map(|turn| if follows(turn) { turn } else { 0.0 }).collect(),
            wavenumber,
        }
    }

    /// Number of weights of a point.
    pub(super) fn num_weights(&self) -> usize {
        if self.has_common_weight {
            1
        } else {
            self.sector.array.num_channels()
        }
    }

    /// Material of the surface behind a cell.
    pub(super) fn material(&self, cells: &TileCells, cell: usize) -> Material {
        match self.sector.image {
            Some(image) => Material::Constant(image.response_of(cells.triangle[cell] as usize)),
            None => self.materials[cells.body[cell] as usize],
        }
    }

    /// Weight of the point of a cell for antennas in unit directions.
    pub(super) fn weight(
        &self,
        cells: &TileCells,
        cell: usize,
        plane: &ImagePlane,
        directions: [DVec3; 2],
    ) -> Complex64 {
        let array = self.sector.array;
        let (area, normal) = (cells.area(cell, plane), cells.normal_of(cell));
        let response = self.material(cells, cell).response_to(array, normal, directions);
        let mut weight = response.specular(area);
        let is_tapered = self.sector.sampling == Sampling::Footprint;
        if is_tapered && weight != Complex64::ZERO {
            let bisector = bisector(array.frequency, directions[0], directions[1]);
            weight *= cells
                .edges(cell, plane)
                .map(|edge| taper(bisector.dot(edge)))
                .iter()
                .product::<f64>();
        }
        if self.has_diffuse_cells {
            let wavelength = SPEED_OF_LIGHT / array.frequency;
            weight += self.phasor(cells.triangle[cell]) * response.diffuse(area, wavelength, normal, directions);
        }
        weight
    }

    /// Add the diffuse power of cells to their weights for antennas in the middle of the array; `untapered`: weights
    /// before the tapers.
    pub(super) fn add_diffuse(&self, cells: &mut TileCells, untapered: &[f32; MOST_RAYS]) {
        let wavelength = TAU / self.wavenumber;
        for cell in (0..MOST_RAYS).filter(|cell| cells.hit >> cell & 1 == 1) {
            let (directions, normal) = ([cells.direction(cell); 2], cells.normal_of(cell));
            let response = match self.sector.image {
                Some(image) => image.response_of(cells.triangle[cell] as usize),
                None => self
                    .material(cells, cell)
                    .response_to(self.sector.array, normal, directions),
            };
            if response.albedo == 0.0 {
                continue;
            }
            let area = 8.0 * PI * f64::from(untapered[cell]);
            let diffuse = self.phasor(cells.triangle[cell]) * response.diffuse(area, wavelength, normal, directions);
            let weight = weight_of(cells, cell) + diffuse;
            // The weight is j times the reflection.
            cells.weight[cell] = 1.0;
            (cells.reflection[0][cell], cells.reflection[1][cell]) = (weight.im as f32, -weight.re as f32);
        }
    }

    /// Phase factor of the diffuse power of a cell: random for every pixel of an image of another program.
    fn phasor(&self, pixel: u32) -> Complex64 {
        match self.sector.sampling {
            Sampling::Point => Complex64::ONE,
            Sampling::Footprint => {
                let random = mix(mix(self.sector.seed) ^ u64::from(pixel)) >> 11;
                Complex64::cis(TAU * random as f64 / (1_u64 << 53) as f64)
            }
        }
    }
}

/// Weight of the point of one cell for antennas in the middle of the array, `(j / 8 pi) Gamma dA T T`.
#[cfg_attr(optimised, inline(always))] // part of a kernel
pub(super) fn weight_of(cells: &TileCells, cell: usize) -> Complex64 {
    let weight = f64::from(cells.weight[cell]);
    let [re, im] = &cells.reflection;
    Complex64::new(-f64::from(im[cell]) * weight, f64::from(re[cell]) * weight)
}

/// True if one weight does for all channels of an array, with cells of a width at most.
pub(super) fn has_common_weight(array: &Array, width: f64) -> bool {
    let wavenumber = TAU / (SPEED_OF_LIGHT / array.frequency);
    let middles = (0..array.num_channels()).map(|channel| {
        let [tx, rx] = [channel / array.rx.len(), channel % array.rx.len()];
        0.5 * (array.tx[tx] + array.rx[rx]).length()
    });
    let antennas = array.tx.iter().chain(&array.rx);
    antennas.map(|antenna| antenna.length()).fold(0.0, f64::max) <= SMALL_ARRAY
        && wavenumber * width * middles.fold(0.0, f64::max) <= ONE_WEIGHT
}
