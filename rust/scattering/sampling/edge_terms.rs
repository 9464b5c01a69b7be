//! Edge terms: cells over which the phase turns fast are represented by their ends (docs/theory.md eq. (10)).
//!
//! Terms on a side that two cells have in common cancel where both show one smooth surface, and are left out. Of cells of
//! different levels the larger one decides: it must be like the cell of its own size beside it, and like all cells that
//! this one was split into along the side. Terms are known when all tiles are; the tiles keep their cells until then.

use std::f64::consts::PI;

use glam::DVec3;
use num_complex::Complex64;

use super::cells::{MIN_COSINE, TileCells};
use super::context::Context;
use super::level::TileLevel;
use super::residual::{BLOCKS, block};
use super::tile::SampledTile;
use super::tile_index::{TileIndex, step};
use crate::rays::camera::{Cell, ImagePlane, TILE};
use crate::rays::packet::{MOST_RAYS, PACKET, TileRays};
use crate::rays::scene::NO_BODY;
use crate::scattering::tile_point::{TilePoint, TilePoints};

/// Half of what the phase turns over a cell from which on edge terms stand for it [rad].
const STEEP: f32 = 1.0;

/// Phase of an adjacent cell up to which it lies in the plane that a cell shows [rad].
const PLANE: f64 = 0.02;

/// Phase that is not explained up to which two cells show one smooth surface [rad].
const SMOOTH: f64 = 0.5;

/// Share of a cell's field that is left open where one of two adjacent cells hits alone: the edge of the surface lies
/// anywhere between both.
const SILHOUETTE: f32 = 1.0;

/// Cell as another one compares it.
#[derive(Clone, Copy)]
struct ComparedCell {
    /// Centre and size.
    center: [f64; 2],
    width: [f64; 2],
    /// Distance and position of the hit [m].
    distance: f64,
    position: DVec3,
    normal: DVec3,
    cosine: f64,
    slope: [f64; 2],
    steep: [bool; 2],
    field: f64,
    /// Number of the body, or [`NO_BODY`].
    body: u32,
}

/// Difference between two adjacent cells.
#[derive(Clone, Copy, Debug)]
struct PairResidual {
    /// Field per solid angle and times distance squared [m^2]; the residuals are fractions of it.
    field: f32,
    /// Fraction that may be other than one smooth surface.
    jump: f32,
    /// Residual with the edge term between both cells, and without it.
    separate: f32,
    together: f32,
    /// True if both are on one surface, where the edge term between them is equal for both.
    is_alike: bool,
}

/// Pairs of every cell of a tile and the one beside it in the tile, on the lower side along u and along v; row by row.
struct Pairs([[PairResidual; MOST_RAYS]; 2]);

impl Pairs {
    fn new(cells: &TileCells, plane: &ImagePlane, context: &Context) -> Self {
        let mut pairs = [[PairResidual::NOTHING; MOST_RAYS]; 2];
        let mut echoes = [ComparedCell::nothing(plane); MOST_RAYS];
        for row in 0..TILE {
            for column in 0..TILE {
                echoes[TILE * row + column] = ComparedCell::new(cells, TileRays::ray(row, column), plane, context);
            }
        }
        for (axis, step) in [1, TILE].into_iter().enumerate() {
            for cell in 0..MOST_RAYS - step {
                if axis == 1 || cell % TILE + 1 < TILE {
                    pairs[axis][cell] = echoes[cell].compare(&echoes[cell + step], axis, context.wavenumber);
                }
            }
        }
        Self(pairs)
    }

    /// Pair of the cell of a row and a column with the one beside it in the tile, on the lower side of an axis.
    fn of(&self, row: usize, column: usize, axis: usize) -> &PairResidual {
        &self.0[axis][TILE * row + column]
    }
}

/// Axes along which a cell has edge terms: the phase of every channel turns fast over it, with one sign.
pub(super) fn steep(cells: &TileCells, cell: usize, plane: &ImagePlane, context: &Context) -> [bool; 2] {
    let mut least = [cells.least_slope[0][cell], cells.least_slope[1][cell]];
    if !context.has_common_weight {
        let array = context.sector.array;
        let (edges, point) = (cells.edges(cell, plane), cells.distance[cell] * cells.direction(cell));
        for channel in 0..array.num_channels() {
            let [t, r] = array.directions(channel, point);
            let bisector = 0.5 * context.wavenumber * (t + r);
            for axis in 0..2 {
                let slope = bisector.dot(edges[axis]) as f32;
                least[axis] = least[axis].min(slope * cells.slope[axis][cell].signum());
            }
        }
    }
    least.map(|least| least > STEEP)
}

impl PairResidual {
    /// Residual of two cells without a hit.
    const NOTHING: Self = Self {
        field: 0.0,
        jump: 0.0,
        separate: 0.0,
        together: 0.0,
        is_alike: false,
    };
}

impl ComparedCell {
    fn new(cells: &TileCells, cell: usize, plane: &ImagePlane, context: &Context) -> Self {
        if cells.hit >> cell & 1 == 0 {
            return Self::nothing(plane);
        }
        Self {
            center: [cells.u[cell], cells.v[cell]],
            width: [plane.du, plane.dv],
            distance: cells.distance[cell],
            position: cells.distance[cell] * cells.direction(cell),
            normal: cells.normal_of(cell),
            cosine: f64::from(cells.cosine[cell]),
            slope: [0, 1].map(|axis| f64::from(cells.slope[axis][cell])),
            steep: steep(cells, cell, plane, context),
            field: f64::from(cells.field[cell]),
            body: cells.body[cell],
        }
    }

    /// Cell of a plane that hit nothing.
    fn nothing(plane: &ImagePlane) -> Self {
        Self {
            center: [0.0; 2],
            width: [plane.du, plane.dv],
            distance: 0.0,
            position: DVec3::ZERO,
            normal: DVec3::ZERO,
            cosine: 1.0,
            slope: [0.0; 2],
            steep: [false; 2],
            field: 0.0,
            body: NO_BODY,
        }
    }

    /// Compare with a cell beside along an axis, which is as large or larger; `wavenumber` [rad/m].
    fn compare(&self, other: &Self, axis: usize, wavenumber: f64) -> PairResidual {
        if self.body == NO_BODY && other.body == NO_BODY {
            return PairResidual::NOTHING;
        }
        // Slopes of the other over a cell of this size.
        let slopes = [
            self.slope,
            [0, 1].map(|axis| other.slope[axis] * self.width[axis] / other.width[axis]),
        ];
        // A stationary point between the two is seen by neither.
        let mut damping = [1.0; 2];
        for axis in 0..2 {
            let is_steady = slopes[0][axis] * slopes[1][axis] >= 0.0;
            for cell in 0..2 {
                damping[cell] *= if is_steady { 1.0 + slopes[cell][axis].abs() } else { 1.0 };
            }
        }
        let field = (self.field / damping[0]).max(other.field / damping[1]);
        if self.body == NO_BODY || other.body == NO_BODY {
            return PairResidual {
                field: field as f32,
                jump: SILHOUETTE,
                separate: SILHOUETTE,
                together: SILHOUETTE,
                is_alike: false,
            };
        }

        // Phase at the other beyond the mean of both slopes and the planes, over a cell of this size.
        let offset = [0, 1].map(|axis| (other.center[axis] - self.center[axis]) / self.width[axis]);
        let square = offset[0] * offset[0] + offset[1] * offset[1];
        let expected: f64 = (0..2).map(|i| (slopes[0][i] + slopes[1][i]) * offset[i]).sum();
        let from_slopes = (2.0 * wavenumber * (other.distance - self.distance) - expected).abs();
        let between = other.position - self.position;
        let height = |cell: &Self| (cell.normal.dot(between) / cell.cosine).abs();
        let from_planes = 2.0 * wavenumber * height(self).max(height(other));

        // The change of the slopes. An edge term leaves less open, by the slopes: of the cell, or in a plane its own.
        let is_plane = from_planes < PLANE;
        let bend = |axis: usize| {
            let bend = (slopes[1][axis] - slopes[0][axis]).abs();
            let slope = slopes[0][axis].abs().min(slopes[1][axis].abs());
            match (self.steep[axis], is_plane) {
                (false, _) => bend,
                (true, false) => bend / slope.max(1.0),
                (true, true) => 2.0 * bend / (slope * slope).max(2.0),
            }
        };
        let is_one_body = self.body == other.body;
        let largest = self.field.max(other.field).max(f64::MIN_POSITIVE);
        let step = 0.5 * (self.field - other.field).abs() / largest;
        let jump = from_slopes.min(from_planes) / square + if is_one_body { 0.0 } else { step };
        // In a plane, corners of one cell and the means over ends of another are the same numbers.
        let is_alike = is_one_body
            && self.steep[axis]
            && other.steep[axis]
            && (is_plane || self.steep == other.steep)
            && slopes[0][axis] * slopes[1][axis] > 0.0
            && jump < SMOOTH;
        let (explained, sag) = if self.steep == [false; 2] {
            (from_slopes / square, 0.0)
        } else {
            (jump, 0.25 * from_planes / square)
        };
        let together = jump + if is_plane { 0.0 } else { 0.25 * bend(axis) };
        let separate = explained + sag + 0.25 * (bend(0) + bend(1)) / square.sqrt() + step;
        PairResidual {
            field: field as f32,
            jump: jump as f32,
            separate: separate as f32,
            together: together as f32,
            is_alike,
        }
    }
}

/// Residual field of a cell, from its pairs along u and v, lower and upper.
fn open(pairs: &[[Option<PairResidual>; 2]; 2], is_hit: bool, steep: [bool; 2]) -> f32 {
    // Nothing of a cell is left where others cancel both of its edge terms. Surfaces go on where nothing is cast, and
    // larger cells were compared before.
    let is_cancelled = [0, 1].map(|axis| {
        let mut sides = pairs[axis].iter();
        is_hit && sides.all(|pair| pair.map_or(steep[axis], |pair| pair.is_alike))
    });
    let mut most: f32 = 0.0;
    for axis in 0..2 {
        for pair in pairs[axis].iter().flatten() {
            let share = match (pair.is_alike, is_cancelled[1 - axis]) {
                (true, _) => pair.together,
                (false, true) => pair.jump,
                (false, false) => pair.separate,
            };
            most = most.max(pair.field * share.min(1.0));
        }
    }
    most
}

/// Place of a cell: sector, level, and row and column among the cells of the level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CellIndex {
    pub(super) sector: usize,
    pub(super) level: usize,
    pub(super) row: usize,
    pub(super) column: usize,
}

impl CellIndex {
    /// First cell of a tile.
    pub(super) fn first(tile: &TileIndex) -> Self {
        let TileIndex {
            sector,
            level,
            row,
            column,
        } = *tile;
        Self {
            sector,
            level,
            row: TILE * row,
            column: TILE * column,
        }
    }

    /// Tile of the cell.
    pub(super) fn tile(&self) -> TileIndex {
        let Self {
            sector,
            level,
            row,
            column,
        } = *self;
        TileIndex {
            sector,
            level,
            row: row / TILE,
            column: column / TILE,
        }
    }

    /// Number of its ray in the tile.
    pub(super) fn ray(&self) -> usize {
        TileRays::ray(self.row % TILE, self.column % TILE)
    }

    /// Number of its block in the tile.
    pub(super) fn block(&self) -> usize {
        block(self.row % TILE, self.column % TILE)
    }

    /// Cell of the same size beside it, on the lower, 0, or upper, 1, side of an axis, u or v.
    pub(super) fn beside(&self, axis: usize, side: usize) -> Option<Self> {
        let (row, column) = step(self.row, self.column, axis, side)?;
        Some(Self { row, column, ..*self })
    }

    /// Cell some levels coarser that the cell is a part of.
    pub(super) fn within(&self, levels: usize) -> Self {
        Self {
            level: self.level - levels,
            row: self.row >> levels,
            column: self.column >> levels,
            ..*self
        }
    }

    /// The two parts, one level finer, on the lower, 0, or upper, 1, side of an axis, u or v.
    pub(super) fn halves(&self, axis: usize, side: usize) -> [Self; 2] {
        // u and v grow to the left and upwards: to smaller columns and rows.
        let across = 1 - side;
        [0, 1].map(|along| {
            let (row, column) = if axis == 0 { (along, across) } else { (across, along) };
            Self {
                level: self.level + 1,
                row: 2 * self.row + row,
                column: 2 * self.column + column,
                ..*self
            }
        })
    }
}

/// Least rate of the phase at the end of a cell, relative to the rate in the centre.
const LEAST_TURN: f64 = 0.5;

/// Lower and upper side of a cell along an axis.
const SIDES: [i8; 2] = [-1, 1];

/// Cells of all levels that were not split.
#[derive(Clone, Copy)]
pub(super) struct Leaves<'a> {
    /// Of every sector.
    pub(super) contexts: &'a [Context<'a>],
    pub(super) levels: &'a [TileLevel],
}

/// Material points of a tile with edge terms, and counts of its cells that were not split.
#[derive(Default)]
pub(super) struct EdgeTermPoints {
    pub(super) points: TilePoints,
    /// Number that hit a body, and of those with a point.
    pub(super) num_hit: usize,
    pub(super) num_lit: usize,
    /// Distance of the farthest with edge terms [m].
    pub(super) farthest: f64,
}

/// Surface beside a cell that cancels its edge term.
#[derive(Clone, Copy, PartialEq)]
enum Partner {
    None,
    /// Surface beyond the border of what is seen.
    Border,
    /// Cell as large or larger, perhaps split.
    Cell(CellIndex),
}

impl<'a> Leaves<'a> {
    /// Material points of the cells of a tile that were not split.
    pub(super) fn points(&self, level: usize, number: usize) -> EdgeTermPoints {
        let (tile, split) = (&*self.levels[level].tiles[number], self.levels[level].split[number]);
        let mut found = EdgeTermPoints::default();
        let Some(cells) = &tile.cells else { return found };
        let context = &self.contexts[tile.place.sector];
        let pairs = Pairs::new(cells, &context.planes[level], context);
        let first = CellIndex::first(&tile.place);
        for cell in (0..MOST_RAYS).filter(|cell| cells.hit >> cell & 1 == 1) {
            let (row, column) = TileRays::place(cell);
            if split >> block(row, column) & 1 == 1 {
                continue;
            }
            let at = CellIndex {
                row: first.row + row,
                column: first.column + column,
                ..first
            };
            let before = found.points.points.len();
            self.add(at, (tile, split), (cells, &pairs), &mut found);
            found.num_hit += 1;
            found.num_lit += usize::from(found.points.points.len() > before);
        }
        found
    }

    /// Append the points of a cell of a tile: its centre, or those ends or corners that nothing cancels.
    fn add(
        &self,
        at: CellIndex,
        (tile, split): (&SampledTile, u16),
        (cells, pairs): (&TileCells, &Pairs),
        found: &mut EdgeTermPoints,
    ) {
        let (context, cell) = (&self.contexts[at.sector], at.ray());
        let plane = &context.planes[at.level];
        let partner = |axis: usize, side: usize| {
            // Most are beside a cell of the same tile.
            let beside = at.beside(axis, side).filter(|beside| beside.tile() == tile.place);
            let beside = beside.filter(|beside| tile.casts(beside.ray(), plane) && split >> beside.block() & 1 == 0);
            match beside {
                Some(beside) => {
                    let first = if side == 0 { at } else { beside };
                    if pairs.of(first.row % TILE, first.column % TILE, axis).is_alike {
                        Partner::Cell(beside)
                    } else {
                        Partner::None
                    }
                }
                None => self.partner(at, axis, side),
            }
        };
        let mut add = |sides: [i8; 2]| {
            found.farthest = found.farthest.max(cells.distance[cell]);
            found.points.add_edge_term(context, cells, cell, plane, sides);
        };
        match steep(cells, cell, plane, context) {
            [false, false] => found.points.add_center(context, cells, cell, plane),
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

    /// Partner of a cell on one side: the lower, 0, or the upper, 1, end of an axis.
    fn partner(&self, at: CellIndex, axis: usize, side: usize) -> Partner {
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
    fn are_alike(&self, at: CellIndex, other: &ComparedCell, axis: usize, side: usize) -> bool {
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
    fn at_corner(&self, at: CellIndex, beside: CellIndex, u: usize, v: usize) -> Option<CellIndex> {
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

    fn is_split(&self, at: CellIndex) -> bool {
        self.tile(at).is_some_and(|(_, split)| split >> at.block() & 1 == 1)
    }

    /// Tile of a cell whose ray is of those that are wanted, and its split blocks.
    fn tile(&self, at: CellIndex) -> Option<(&'a SampledTile, u16)> {
        let level = self.levels.get(at.level)?;
        let number = level.find(&at.tile())?;
        let tile = &level.tiles[number];
        let packet = at.ray() / PACKET;
        (tile.packets >> packet & 1 == 1).then_some((tile, level.split[number]))
    }

    /// Cell as others compare it; none without a hit in its tile.
    fn echo(&self, at: CellIndex) -> Option<ComparedCell> {
        let (context, cells) = (&self.contexts[at.sector], self.tile(at)?.0.cells.as_ref()?);
        Some(ComparedCell::new(cells, at.ray(), &context.planes[at.level], context))
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

impl SampledTile {
    /// Residual field of every block with edge terms, per solid angle and times distance squared [m^2], with the cells of
    /// `adjacent` tiles of the same level.
    pub(super) fn residual_of_edge_terms<'a>(
        &self,
        context: &Context,
        adjacent: impl Fn(TileIndex) -> Option<&'a Self>,
    ) -> [f32; BLOCKS] {
        const LAST: usize = TILE - 1;
        let (plane, wavenumber) = (&context.planes[self.place.level], context.wavenumber);
        let beside = |axis, side| self.place.beside(axis, side).and_then(&adjacent);
        let adjacent = [[beside(0, 0), beside(0, 1)], [beside(1, 0), beside(1, 1)]];
        let cells = self.cells.as_deref();
        let mut residual = [0.0; BLOCKS];
        if cells.is_none()
            && adjacent
                .as_flattened()
                .iter()
                .flatten()
                .all(|tile| tile.cells.is_none())
        {
            return residual;
        }
        let pairs = cells.map(|cells| Pairs::new(cells, plane, context));
        // Cell beside the tile; none where no ray was cast, or only one of larger cells.
        let beyond = |row: usize, column: usize, axis: usize, side: usize| {
            // Opposite sides meet.
            let across = if side == 0 { 0 } else { LAST };
            let cell = if axis == 0 {
                TileRays::ray(row, across)
            } else {
                TileRays::ray(across, column)
            };
            let tile = adjacent[axis][side].filter(|tile| tile.casts(cell, plane))?;
            Some(tile.echo(cell, plane, context))
        };
        for row in 0..TILE {
            for column in 0..TILE {
                let cell = TileRays::ray(row, column);
                if !self.casts(cell, plane) {
                    continue;
                }
                let beside = |axis: usize, side: usize| {
                    let (along, last) = if axis == 0 { (column, LAST) } else { (row, LAST) };
                    if along == if side == 0 { last } else { 0 } {
                        let here = self.echo(cell, plane, context);
                        return beyond(row, column, axis, side).map(|there| here.compare(&there, axis, wavenumber));
                    }
                    // u and v fall to the right and downwards.
                    let (above, left) = match (axis, side) {
                        (_, 0) => (row, column),
                        (0, _) => (row, column - 1),
                        _ => (row - 1, column),
                    };
                    let (below, right) = if axis == 0 {
                        (above, left + 1)
                    } else {
                        (above + 1, left)
                    };
                    let other = if side == 0 { (below, right) } else { (above, left) };
                    let pairs = pairs
                        .as_ref()
                        .filter(|_| self.casts(TileRays::ray(other.0, other.1), plane));
                    pairs.map(|pairs| *pairs.of(above, left, axis))
                };
                let steep = self.echo(cell, plane, context).steep;
                let is_hit = cells.is_some_and(|cells| cells.hit >> cell & 1 == 1);
                let pairs = [[beside(0, 0), beside(0, 1)], [beside(1, 0), beside(1, 1)]];
                let residual = &mut residual[block(row, column)];
                *residual = open(&pairs, is_hit, steep).max(*residual);
            }
        }
        residual
    }

    /// True if the ray of a cell was cast; `plane`: image plane of the level.
    fn casts(&self, cell: usize, plane: &ImagePlane) -> bool {
        let (row, column) = TileRays::place(cell);
        let is_inside = TILE * self.place.row + row < plane.rows && TILE * self.place.column + column < plane.columns;
        self.is_seen && self.packets >> (cell / PACKET) & 1 == 1 && is_inside
    }

    /// Cell as another one compares it.
    fn echo(&self, cell: usize, plane: &ImagePlane, context: &Context) -> ComparedCell {
        self.cells.as_ref().map_or(ComparedCell::nothing(plane), |cells| {
            ComparedCell::new(cells, cell, plane, context)
        })
    }
}

impl TilePoints {
    /// Append the end or corner of a cell of a plane, on the sides -1 or 1 along u and v; 0 along an axis stands for the
    /// mean over the cell.
    pub(super) fn add_edge_term(
        &mut self,
        context: &Context,
        cells: &TileCells,
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
        });
        self.set_edges([0, 1].map(|axis| {
            if sides[axis] == 0.0 {
                edges_there[axis]
            } else {
                DVec3::ZERO
            }
        }));
        self.set_order(sides.iter().filter(|side| **side != 0.0).count() as u8);
    }
}
