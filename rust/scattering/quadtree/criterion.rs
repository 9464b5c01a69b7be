//! Criterion of refinement: the residual error that cells may have, and the parts of meshes that need smaller cells.

use std::f64::consts::TAU;

use glam::DVec3;

use super::cells::{BUNDLE, CELLS_ACROSS, CellEcho, FEW_PARTS, MAX_LEVEL, MOST_PIECES, Place, SHARE, STEEP, field};
use crate::antennas::array::Array;
use crate::antennas::polarization::Seen;
use crate::geometry::aabb::Bounds;
use crate::rays::batch::Found;
use crate::rays::camera::{Cell, ImagePlane};
use crate::rays::packet::MOST_RAYS;
use crate::rays::scene::PosedScene;
use crate::scattering::material::Material;
use crate::scattering::refinement::Refinement;

/// Part of a mesh on the image plane: a rectangle that needs cells of a size.
pub(super) struct Target {
    pub(super) u: [f64; 2],
    pub(super) v: [f64; 2],
    /// Widest cells.
    pub(super) width: [f64; 2],
}

/// Scene, materials, antennas and settings that the criterion depends on.
pub(super) struct Criterion<'a> {
    pub(super) snapshot: &'a PosedScene,
    pub(super) materials: &'a [Material],
    pub(super) array: &'a Array,
    pub(super) refinement: &'a Refinement<'a>,
    pub(super) wavelength: f64,
}

impl Criterion<'_> {
    /// Echo of a cell: its part of the sum.
    pub(super) fn look(&self, cell: &Cell, found: &Found) -> CellEcho {
        let direction = cell.direction();
        let cosine = -found.normal.dot(direction);
        if !found.is_hit() || cosine <= 0.0 || found.distance <= 0.0 {
            return CellEcho::NOTHING;
        }
        let polarization = self.array.polarization;
        let seen = polarization.map_or(Seen::SCALAR, |e| Seen::by(e, found.normal, direction, direction));
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

    /// Bodies, and parts of their meshes, that have the smallest cross-section of interest and may be missed by the
    /// base grid.
    pub(super) fn targets(&self) -> Vec<Target> {
        let bodies = 0..self.snapshot.num_bodies() as u32;
        let parts = bodies.flat_map(|body| {
            let pose = self.snapshot.pose(body);
            let parts = self.snapshot.surface(body).parts();
            let most = if parts.len() > FEW_PARTS { 1.0 } else { MOST_PIECES };
            parts.iter().flat_map(move |part| {
                let pieces = pieces(part, most);
                let number = pieces.len() as f64;
                let corners = move |piece: Bounds| piece.corners().map(|corner| pose.point(corner));
                pieces
                    .into_iter()
                    .filter_map(move |piece| self.target(&corners(piece), number))
            })
        });
        let base = &self.refinement.base;
        let is_small = |target: &Target| target.width[0] < base.du || target.width[1] < base.dv;
        parts.filter(is_small).collect()
    }

    /// Target of a box in the sensor frame, one of a number of pieces.
    pub(super) fn target(&self, corners: &[DVec3; 8], pieces: f64) -> Option<Target> {
        // A box that reaches behind the sensor is near and large.
        if corners.iter().any(|corner| corner.x <= 0.0) {
            return None;
        }
        let range = |axis: usize| {
            let (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
            let ratios = corners.iter().map(|corner| corner[axis] / corner.x);
            let (low, high) = ratios.fold((low, high), |(low, high), x| (low.min(x), high.max(x)));
            [low, high]
        };
        let (u, v) = (range(1), range(2));
        let distance = corners
            .iter()
            .map(|corner| corner.length())
            .fold(f64::INFINITY, f64::min);
        let is_bright = pieces * (u[1] - u[0]) * (v[1] - v[0]) >= field(self.refinement, distance, self.wavelength);
        let width = [u, v].map(|[low, high]| (high - low) / CELLS_ACROSS);
        is_bright.then_some(Target { u, v, width })
    }
}

/// Split a long box into pieces about as long as wide: the border of the image may cross the box.
pub(super) fn pieces(bounds: &Bounds, most: f64) -> Vec<Bounds> {
    let size = bounds.max - bounds.min;
    let longest = size.max_position();
    let mut others = size;
    others[longest] = 0.0;
    let number = (size[longest] / others.max_element()).ceil().clamp(1.0, most);
    if !number.is_finite() {
        return vec![*bounds];
    }
    let step = size[longest] / number;
    (0..number as usize)
        .map(|piece| {
            let mut part = *bounds;
            part.min[longest] = bounds.min[longest] + step * piece as f64;
            part.max[longest] = part.min[longest] + step;
            part
        })
        .collect()
}

/// Ends of the packets of cells in their order; the cells of a packet lie within a square of the image.
pub(super) fn bundles(cells: &[Place]) -> Vec<usize> {
    let mut ends = Vec::with_capacity(cells.len() / MOST_RAYS + 1);
    let mut first = 0;
    for (index, cell) in cells.iter().enumerate() {
        let apart = cell.order() ^ cells[first].order();
        let finer = (MAX_LEVEL as u32 - u32::from(cell.level)) + BUNDLE;
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
