//! Criterion of refinement: the residual error that cells may have, and the parts of meshes that need smaller cells.

use std::f64::consts::TAU;

use super::cells::{CELLS_ACROSS, CellEcho, Place, STEEP, TOGETHER, field};
use crate::antennas::array::Array;
use crate::antennas::polarization::Seen;
use crate::rays::batch::Found;
use crate::rays::camera::{Cell, ImagePlane};
use crate::rays::packet::MOST_RAYS;
use crate::rays::scene::PosedScene;
use crate::scattering::material::Material;
use crate::scattering::mesh_parts::MeshPart;
use crate::scattering::refinement::{MAX_LEVEL, Refinement, SHARE, field_of};

/// Scene, materials, antennas and settings that the criterion depends on.
pub(super) struct Criterion<'a> {
    pub(super) scene: &'a PosedScene,
    pub(super) materials: &'a [Material],
    pub(super) array: &'a Array,
    pub(super) refinement: &'a Refinement<'a>,
    pub(super) wavelength: f64,
}

impl Criterion<'_> {
    /// Echo of a cell: its part of the sum.
    pub(super) fn echo(&self, cell: &Cell, found: &Found) -> CellEcho {
        let direction = cell.direction();
        let cosine = -found.normal.dot(direction);
        if !found.is_hit() || cosine <= 0.0 || found.distance <= 0.0 {
            return CellEcho::NOTHING;
        }
        let polarization = self.array.polarization;
        let seen = polarization.map(|e| Seen::by(e, found.normal, direction, direction));
        let response = self.materials[found.body as usize].response(cosine, self.wavelength, seen);
        let wavenumber = TAU / self.wavelength;
        let edges = cell.edges(found.distance, found.normal);
        let slope = edges.map(|edge| wavenumber * edge.dot(direction));
        let mut least = slope.map(f64::abs);
        for channel in 0..self.array.num_channels() {
            let [t, r] = self.array.directions(channel, found.distance * direction);
            let bisector = 0.5 * wavenumber * (t + r);
            for axis in 0..2 {
                least[axis] = least[axis].min(bisector.dot(edges[axis]) * slope[axis].signum());
            }
        }
        CellEcho {
            amplitude: response.reflection.norm() * self.array.relative_gain(cell.u, cell.v),
            slope,
            steep: least.map(|least| self.refinement.end_points && least > STEEP),
            tolerance: SHARE * field(self.refinement, found.distance, self.wavelength),
            point: found.distance * direction,
            advance: -cosine,
        }
    }

    /// Parts of meshes that have the smallest cross-section of interest and may be missed by the base grid.
    pub(super) fn targets(&self) -> Vec<MeshPart> {
        MeshPart::small(
            self.scene,
            &self.refinement.base,
            field_of(self.refinement.rcs_floor, self.wavelength),
            CELLS_ACROSS,
        )
    }
}

/// Ends of the groups of cells in their order; the cells of a group lie within a square of the image.
pub(super) fn groups(cells: &[Place]) -> Vec<usize> {
    let mut ends = Vec::with_capacity(cells.len() / MOST_RAYS + 1);
    let mut first = 0;
    for (index, cell) in cells.iter().enumerate() {
        let apart = cell.order() ^ cells[first].order();
        let finer = (MAX_LEVEL as u32 - u32::from(cell.level)) + TOGETHER;
        if index - first == MOST_RAYS || apart >> (2 * finer) != 0 {
            ends.push(index);
            first = index;
        }
    }
    if !cells.is_empty() {
        ends.push(cells.len());
    }
    ends
}

/// Cell of the image plane at a place of the quadtree.
pub(super) fn cell(planes: &[ImagePlane], place: &Place) -> Cell {
    planes[place.level as usize].cell(place.row as usize, place.column as usize)
}
