//! Edge terms: cells over which the phase turns fast are represented by their ends (docs/theory.md eq. (10)).
//!
//! Terms on a side that two cells have in common cancel where both show one smooth surface, and are left out. Of cells of
//! different levels the larger one decides: it must be like the cell of its own size beside it, and like all cells that
//! this one was split into along the side.

use std::f64::consts::PI;

use glam::DVec3;
use num_complex::Complex64;

use super::cells::{Cells, MIN_COSINE};
use super::context::Context;
use super::level::Level;
use super::pairs::{CellEcho, KeptCells};
use super::place::CellPlace;
use super::residual::block;
use super::tile::Tile;
use crate::rays::camera::{Cell, ImagePlane, TILE};
use crate::rays::packet::{MOST_RAYS, PACKET, TileRays};
use crate::scattering::tile_point::{TilePoint, TilePoints};

/// Least rate of the phase at the end of a cell, relative to the rate in the centre.
const LEAST_TURN: f64 = 0.5;

/// Lower and upper side of a cell along an axis.
const SIDES: [i8; 2] = [-1, 1];

/// Cells of all levels that were not split.
#[derive(Clone, Copy)]
pub(super) struct Leaves<'a> {
    /// Of every sector.
    pub(super) contexts: &'a [Context<'a>],
    pub(super) levels: &'a [Level],
}

/// Material points of a tile with edge terms, and counts of its cells that were not split.
#[derive(Default)]
pub(super) struct Found {
    pub(super) points: TilePoints,
    /// Number that hit a body, and of those with a point.
    pub(super) num_hit: usize,
    pub(super) num_lit: usize,
    /// Distance of the farthest with edge terms [m].
    pub(super) farthest: f64,
}

/// What cancels the edge term of a cell.
#[derive(Clone, Copy, PartialEq)]
enum Partner {
    None,
    /// Surface beyond the border of what is seen.
    Border,
    /// Cell as large or larger, perhaps split.
    Cell(CellPlace),
}

impl<'a> Leaves<'a> {
    /// Material points of the cells of a tile that were not split.
    pub(super) fn points(&self, level: usize, number: usize) -> Found {
        let (tile, split) = (&*self.levels[level].tiles[number], self.levels[level].split[number]);
        let mut found = Found::default();
        let Some(kept) = &tile.kept else { return found };
        let first = CellPlace::first(&tile.place);
        for cell in (0..MOST_RAYS).filter(|cell| kept.cells.hit >> cell & 1 == 1) {
            let (row, column) = TileRays::place(cell);
            if split >> block(row, column) & 1 == 1 {
                continue;
            }
            let at = CellPlace {
                row: first.row + row,
                column: first.column + column,
                ..first
            };
            let before = found.points.points.len();
            self.add(at, (tile, split, kept), cell, &mut found);
            found.num_hit += 1;
            found.num_lit += usize::from(found.points.points.len() > before);
        }
        found
    }

    /// Append the points of a cell of a tile: its centre, or those ends or corners that nothing cancels.
    fn add(&self, at: CellPlace, (tile, split, kept): (&Tile, u16, &KeptCells), cell: usize, found: &mut Found) {
        let context = &self.contexts[at.sector];
        let plane = &context.planes[at.level];
        let partner = |axis: usize, side: usize| {
            // Most are beside a cell of the same tile.
            let beside = at.beside(axis, side).filter(|beside| beside.tile() == tile.place);
            let beside = beside.filter(|beside| tile.casts(beside.ray(), plane) && split >> beside.block() & 1 == 0);
            match beside {
                Some(beside) => {
                    let first = if side == 0 { at } else { beside };
                    if kept.pair(first.row % TILE, first.column % TILE, axis).is_alike {
                        Partner::Cell(beside)
                    } else {
                        Partner::None
                    }
                }
                None => self.partner(at, axis, side),
            }
        };
        let mut add = |sides: [i8; 2]| {
            found.farthest = found.farthest.max(kept.cells.distance[cell]);
            found.points.add_edge_term(context, &kept.cells, cell, plane, sides);
        };
        match kept.steep(cell) {
            [false, false] => found.points.add_center(context, &kept.cells, cell, plane),
            [true, true] => {
                // A corner is shared with cells along both axes: those along u come first.
                for u in (0..2).filter(|u| partner(0, *u) == Partner::None) {
                    for v in 0..2 {
                        let is_cancelled = match partner(1, v) {
                            Partner::None => false,
                            Partner::Border => true,
                            Partner::Cell(other) => self
                                .at_corner(at, other, u, v)
                                .is_none_or(|other| self.partner(other, 0, u) == Partner::None),
                        };
                        if !is_cancelled {
                            add([SIDES[u], SIDES[v]]);
                        }
                    }
                }
            }
            [is_along_u, _] => {
                let axis = usize::from(!is_along_u);
                for side in (0..2).filter(|side| partner(axis, *side) == Partner::None) {
                    let mut sides = [0; 2];
                    sides[axis] = SIDES[side];
                    add(sides);
                }
            }
        }
    }

    /// What cancels the edge term of a cell on one side: the lower, 0, or the upper, 1, end of an axis.
    fn partner(&self, at: CellPlace, axis: usize, side: usize) -> Partner {
        let plane = &self.contexts[at.sector].planes[at.level];
        let beside = at.beside(axis, side);
        let Some(beside) = beside.filter(|beside| beside.row < plane.rows && beside.column < plane.columns) else {
            return Partner::Border;
        };
        // The cell of the same level, or the finest one round that.
        for coarser in 0..=at.level {
            let (here, there) = (at.within(coarser), beside.within(coarser));
            let Some((tile, _)) = self.tile(there) else { continue };
            if !tile.is_seen {
                return Partner::Border;
            }
            let is_shared = if coarser == 0 {
                self.echo(here)
                    .is_some_and(|here| self.are_alike(there, &here, axis, 1 - side))
            } else {
                self.echo(there)
                    .is_some_and(|there| self.are_alike(here, &there, axis, side))
            };
            return if is_shared { Partner::Cell(there) } else { Partner::None };
        }
        Partner::Border
    }

    /// True if a cell, and all that it was split into along a side, show one smooth surface with another there.
    fn are_alike(&self, at: CellPlace, other: &CellEcho, axis: usize, side: usize) -> bool {
        let Some((tile, split)) = self.tile(at) else {
            return true;
        };
        if !tile.is_seen {
            return true;
        }
        let wavenumber = self.contexts[at.sector].wavenumber;
        let is_alike = self
            .echo(at)
            .is_some_and(|echo| echo.compare(other, axis, wavenumber).is_alike);
        let is_split = split >> at.block() & 1 == 1;
        is_alike
            && (!is_split
                || at
                    .halves(axis, side)
                    .iter()
                    .all(|half| self.are_alike(*half, other, axis, side)))
    }

    /// Cell beside one along v, or what it was split into, that has a corner in common with it; none where a larger one
    /// has its side there.
    fn at_corner(&self, at: CellPlace, beside: CellPlace, u: usize, v: usize) -> Option<CellPlace> {
        let last = (1 << (at.level - beside.level)) - 1;
        if at.column & last != if u == 0 { last } else { 0 } {
            return None;
        }
        let mut corner = beside;
        while self.is_split(corner) {
            // The first of two halves has the smaller column, and the larger u.
            corner = corner.halves(1, 1 - v)[1 - u];
        }
        Some(corner)
    }

    fn is_split(&self, at: CellPlace) -> bool {
        self.tile(at).is_some_and(|(_, split)| split >> at.block() & 1 == 1)
    }

    /// Tile of a cell whose ray is of those that are wanted, and its split blocks.
    fn tile(&self, at: CellPlace) -> Option<(&'a Tile, u16)> {
        let level = self.levels.get(at.level)?;
        let number = level.find(&at.tile())?;
        let tile = &level.tiles[number];
        let packet = at.ray() / PACKET;
        (tile.packets >> packet & 1 == 1).then_some((tile, level.split[number]))
    }

    /// Cell as others compare it; none without a hit in its tile.
    fn echo(&self, at: CellPlace) -> Option<CellEcho> {
        let kept = self.tile(at)?.0.kept.as_ref()?;
        Some(kept.echo(at.ray(), &self.contexts[at.sector].planes[at.level]))
    }
}

/// Plane patch of surface behind a cell.
#[derive(Clone, Copy)]
struct Patch {
    cell: Cell,
    /// Distance [m], and unit normal towards the incident side.
    distance: f64,
    normal: DVec3,
}

impl Patch {
    /// Patch of the same plane behind the cell that is `sides` widths away along u and v. None at grazing angles.
    fn about(&self, sides: [f64; 2]) -> Option<Self> {
        let cell = self.cell.about(sides);
        let distance = self.distance * self.normal.dot(self.cell.direction()) / self.normal.dot(cell.direction());
        let is_near = distance > 0.5 * self.distance && distance < 2.0 * self.distance;
        is_near.then_some(Self {
            cell,
            distance,
            ..*self
        })
    }

    /// Point in the middle of the patch [m].
    fn point(&self) -> DVec3 {
        self.distance * self.cell.direction()
    }

    /// Edges along u and v [m].
    fn edges(&self) -> [DVec3; 2] {
        self.cell.edges(self.distance, self.normal)
    }

    /// Area [m^2]; none where the patch faces away from the sensor.
    fn area(&self) -> Option<f64> {
        let cosine = -self.normal.dot(self.cell.direction());
        let area = self.distance * self.distance * self.cell.solid_angle() / cosine;
        (cosine >= MIN_COSINE && self.distance > 0.0).then_some(area)
    }
}

impl TilePoints {
    /// Append the end or corner of a cell of a plane, on the sides -1 or 1 along u and v; 0 along an axis stands for the
    /// mean over the cell.
    pub(super) fn add_edge_term(
        &mut self,
        context: &Context,
        cells: &Cells,
        cell: usize,
        plane: &ImagePlane,
        sides: [i8; 2],
    ) {
        let patch = Patch {
            cell: cells.cell(cell, plane),
            distance: cells.distance[cell],
            normal: cells.normal_of(cell),
        };
        let (array, wavenumber) = (context.sector.array, context.wavenumber);
        let sides = sides.map(|side| 0.5 * f64::from(side));
        let edges = patch.edges();
        // At grazing angles the plane has no point there.
        let there = patch.about(sides);
        let end = there.map_or_else(
            || patch.point() + sides[0] * edges[0] + sides[1] * edges[1],
            |there| there.point(),
        );
        let there = there.unwrap_or(patch);
        let Some(area) = there.area().or(patch.area()) else {
            return;
        };
        let edges_there = there.edges();
        for channel in 0..context.num_weights() {
            let (reflection, slopes, slopes_there) = if context.has_common_weight {
                let reflection = [0, 1].map(|part| f64::from(cells.reflection[part][cell]));
                let slopes =
                    |edges: [DVec3; 2], point: DVec3| edges.map(|edge| wavenumber * edge.dot(point.normalize()));
                (
                    Complex64::new(reflection[0], reflection[1]),
                    slopes(edges, patch.point()),
                    slopes(edges_there, end),
                )
            } else {
                let [t, r] = array.directions(channel, patch.point());
                let response = context.material(cells, cell).response_to(array, patch.normal, [t, r]);
                let [t_end, r_end] = array.directions(channel, end);
                (
                    response.reflection,
                    edges.map(|edge| 0.5 * wavenumber * edge.dot(t + r)),
                    edges_there.map(|edge| 0.5 * wavenumber * edge.dot(t_end + r_end)),
                )
            };
            let mut weight = Complex64::new(0.0, area / (8.0 * PI)) * reflection;
            for axis in (0..2).filter(|axis| sides[*axis] != 0.0) {
                // (j/2x) exp(-j(phi+x)) at the upper end, less (j/2x) exp(-j(phi-x)) at the lower.
                let (x, x_there) = (slopes[axis], slopes_there[axis]);
                let x = if x_there / x > LEAST_TURN { x_there } else { x };
                weight *= Complex64::new(0.0, sides[axis] / x);
            }
            self.weights.push(weight);
        }
        self.points.push(TilePoint {
            position: end,
            normal: patch.normal,
            body: cells.body[cell],
            triangle: cells.triangle[cell],
            edges: [0, 1].map(|axis| {
                if sides[axis] == 0.0 {
                    edges_there[axis]
                } else {
                    DVec3::ZERO
                }
            }),
            order: sides.iter().filter(|side| **side != 0.0).count() as u8,
        });
    }
}
