//! Pairs of adjacent cells with edge terms: what they leave open, and whether they share the term between them.

use glam::DVec3;

use super::cells::Cells;
use super::context::Context;
use super::residual::{BLOCKS, block};
use crate::rays::camera::{ImagePlane, TILE};
use crate::rays::packet::{MOST_RAYS, TileRays};
use crate::rays::scene::NO_BODY;

/// Half of what the phase turns over a cell from which on edge terms stand for it [rad].
const STEEP: f32 = 1.0;

/// Phase of an adjacent cell up to which it lies in the plane that a cell shows [rad].
const PLANE: f64 = 0.02;

/// Phase that is not explained up to which two cells show one smooth surface [rad].
const SMOOTH: f64 = 0.5;

/// Share of a cell's field that is left open where one of two adjacent cells hits alone: the edge of the surface lies
/// anywhere between both.
const SILHOUETTE: f32 = 1.0;

/// Cells of an evaluated tile that are kept for comparison with others.
#[derive(Clone, Debug)]
pub(super) struct KeptCells {
    pub(super) cells: Cells,
    /// A bit per cell over which the phase of every channel turns fast, with one sign; along u and along v.
    steep: [u64; 2],
    /// Pairs of every cell and the one beside it in the tile, on the lower side along u and along v; row by row.
    pairs: [[PairError; MOST_RAYS]; 2],
}

/// Cell as another one compares it.
#[derive(Clone, Copy)]
pub(super) struct CellEcho {
    /// Centre and size.
    center: [f64; 2],
    width: [f64; 2],
    /// Distance and position of the hit [m].
    distance: f64,
    position: DVec3,
    normal: DVec3,
    cosine: f64,
    slope: [f64; 2],
    pub(super) steep: [bool; 2],
    field: f64,
    /// Number of the body, or [`NO_BODY`].
    body: u32,
}

/// Difference between two adjacent cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairError {
    /// Field per solid angle and times distance squared, of which the rest are shares [m^2].
    field: f32,
    /// Share that may be other than one smooth surface.
    jump: f32,
    /// Share that is left open; and the same if both leave out the edge term between them.
    apart: f32,
    together: f32,
    /// True if both are on one surface, where the edge term between them is equal for both.
    pub(super) is_alike: bool,
}

impl KeptCells {
    /// Cells on a plane.
    pub(super) fn new(cells: &Cells, plane: &ImagePlane, context: &Context) -> Self {
        let (array, wavenumber) = (context.sector.array, context.wavenumber);
        let mut steep = [0; 2];
        for cell in (0..MOST_RAYS).filter(|cell| cells.hit >> cell & 1 == 1) {
            let mut least = [cells.least_slope[0][cell], cells.least_slope[1][cell]];
            if !context.has_common_weight {
                let (edges, point) = (cells.edges(cell, plane), cells.distance[cell] * cells.direction(cell));
                for channel in 0..array.num_channels() {
                    let [t, r] = array.directions(channel, point);
                    let bisector = 0.5 * wavenumber * (t + r);
                    for axis in 0..2 {
                        let slope = bisector.dot(edges[axis]) as f32;
                        least[axis] = least[axis].min(slope * cells.slope[axis][cell].signum());
                    }
                }
            }
            for axis in 0..2 {
                steep[axis] |= u64::from(least[axis] > STEEP) << cell;
            }
        }
        let mut kept = Self {
            cells: cells.clone(),
            steep,
            pairs: [[PairError::NOTHING; MOST_RAYS]; 2],
        };
        let mut echoes = [CellEcho::nothing(plane); MOST_RAYS];
        for row in 0..TILE {
            for column in 0..TILE {
                echoes[TILE * row + column] = kept.echo(TileRays::ray(row, column), plane);
            }
        }
        for (axis, step) in [1, TILE].into_iter().enumerate() {
            for cell in 0..MOST_RAYS - step {
                if axis == 1 || cell % TILE + 1 < TILE {
                    kept.pairs[axis][cell] = echoes[cell].compare(&echoes[cell + step], axis, wavenumber);
                }
            }
        }
        kept
    }

    /// Pair of the cell of a row and a column with that beside it in the tile, on the lower side of an axis.
    pub(super) fn pair(&self, row: usize, column: usize, axis: usize) -> &PairError {
        &self.pairs[axis][TILE * row + column]
    }

    /// Axes along which a cell has edge terms.
    pub(super) fn steep(&self, cell: usize) -> [bool; 2] {
        self.steep.map(|steep| steep >> cell & 1 == 1)
    }

    /// Cell as others compare it.
    pub(super) fn echo(&self, cell: usize, plane: &ImagePlane) -> CellEcho {
        let cells = &self.cells;
        if cells.hit >> cell & 1 == 0 {
            return CellEcho::nothing(plane);
        }
        CellEcho {
            center: [cells.u[cell], cells.v[cell]],
            width: [plane.du, plane.dv],
            distance: cells.distance[cell],
            position: cells.distance[cell] * cells.direction(cell),
            normal: cells.normal_of(cell),
            cosine: f64::from(cells.cosine[cell]),
            slope: [0, 1].map(|axis| f64::from(cells.slope[axis][cell])),
            steep: self.steep(cell),
            field: f64::from(cells.field[cell]),
            body: cells.body[cell],
        }
    }
}

impl PairError {
    /// Between cells of which neither hit a body.
    const NOTHING: Self = Self {
        field: 0.0,
        jump: 0.0,
        apart: 0.0,
        together: 0.0,
        is_alike: false,
    };
}

impl CellEcho {
    /// Cell of a plane that hit nothing.
    pub(super) fn nothing(plane: &ImagePlane) -> Self {
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
    pub(super) fn compare(&self, other: &Self, axis: usize, wavenumber: f64) -> PairError {
        if self.body == NO_BODY && other.body == NO_BODY {
            return PairError::NOTHING;
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
            return PairError {
                field: field as f32,
                jump: SILHOUETTE,
                apart: SILHOUETTE,
                together: SILHOUETTE,
                is_alike: false,
            };
        }

        // Phase at the other that neither the mean of both slopes nor the planes explain, over a cell of this size.
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
        let apart = explained + sag + 0.25 * (bend(0) + bend(1)) / square.sqrt() + step;
        PairError {
            field: field as f32,
            jump: jump as f32,
            apart: apart as f32,
            together: together as f32,
            is_alike,
        }
    }
}

/// Residual field of every block of a tile, per solid angle and times distance squared [m^2]. `beyond`: cell of a row
/// and a column beside the tile, on the side of an axis, lower or upper; none where no ray was cast, or only one of larger
/// cells.
pub(super) fn residual(
    kept: Option<&KeptCells>,
    plane: &ImagePlane,
    is_cast: impl Fn(usize) -> bool,
    wavenumber: f64,
    beyond: impl Fn(usize, usize, [usize; 2]) -> Option<CellEcho>,
) -> [f32; BLOCKS] {
    const LAST: usize = TILE - 1;
    let mut residual = [0.0; BLOCKS];
    for row in 0..TILE {
        for column in 0..TILE {
            let cell = TileRays::ray(row, column);
            if !is_cast(cell) {
                continue;
            }
            let beside = |axis: usize, side: usize| {
                let (along, last) = if axis == 0 { (column, LAST) } else { (row, LAST) };
                if along == if side == 0 { last } else { 0 } {
                    let here = kept.map_or(CellEcho::nothing(plane), |kept| kept.echo(cell, plane));
                    return beyond(row, column, [axis, side]).map(|there| here.compare(&there, axis, wavenumber));
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
                let kept = kept.filter(|_| is_cast(TileRays::ray(other.0, other.1)));
                kept.map(|kept| *kept.pair(above, left, axis))
            };
            let steep = kept.map_or([false; 2], |kept| kept.steep(cell));
            let is_hit = kept.is_some_and(|kept| kept.cells.hit >> cell & 1 == 1);
            let pairs = [[beside(0, 0), beside(0, 1)], [beside(1, 0), beside(1, 1)]];
            let residual = &mut residual[block(row, column)];
            *residual = open(&pairs, is_hit, steep).max(*residual);
        }
    }
    residual
}

/// Residual field of a cell, from its pairs along u and v, lower and upper.
fn open(pairs: &[[Option<PairError>; 2]; 2], is_hit: bool, steep: [bool; 2]) -> f32 {
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
                (false, false) => pair.apart,
            };
            most = most.max(pair.field * share.min(1.0));
        }
    }
    most
}
