//! Residual error of the quarters of a tile, from the differences of adjacent cells.

use super::cells::Cells;
use crate::rays::camera::TILE;
use crate::rays::packet::{MOST_RAYS, TileRays};
use crate::rays::scene::NO_BODY;

/// Share of a cell's field that an edge in the cell leaves open: where one cell hits and the adjacent one misses, or
/// where distances step. The larger phase error of such pairs would double the rays for an equal error of the sum.
const EDGE: f32 = 0.1;

/// Share of a cell's field for adjacent cells of two bodies.
const OTHER_BODY: f32 = 0.1;

/// Cell as adjacent ones compare it.
#[derive(Clone, Copy, Debug)]
struct Look {
    slope: [f32; 2],
    /// Least magnitude of the slopes.
    least: [f32; 2],
    field: f32,
    body: u32,
}

/// Field that two adjacent cells along an axis leave open; u and v fall from the first to the second. `turn`: phase of
/// the second beyond that of the first [rad].
#[inline(always)] // part of a kernel
fn pair(a: Look, b: Look, axis: usize, turn: f32) -> f32 {
    let (s, t) = (a.slope, b.slope);
    // A stationary point may lie between slopes of opposite signs.
    let damped = |least: [f32; 2]| {
        let u = if s[0] * t[0] < 0.0 { 1.0 } else { 1.0 + least[0] };
        let v = if s[1] * t[1] < 0.0 { 1.0 } else { 1.0 + least[1] };
        u * v
    };
    let field = (a.field / damped(a.least)).max(b.field / damped(b.least));
    let phase = turn + s[axis] + t[axis];
    let bend = (t[0] - s[0]).abs() + (t[1] - s[1]).abs();
    let body = if a.body == b.body { 0.0 } else { OTHER_BODY };
    let open = phase.abs() + 0.25 * bend + body;
    let is_edge = ((a.body == NO_BODY) != (b.body == NO_BODY)) || open >= 1.0;
    field * if is_edge { EDGE } else { open }
}

/// Cells of a tile row by row: the numbers that adjacent cells are compared by.
struct Rows {
    phase: [f32; MOST_RAYS],
    slope: [[f32; MOST_RAYS]; 2],
    least: [[f32; MOST_RAYS]; 2],
    field: [f32; MOST_RAYS],
    /// Number of the body.
    body: [u32; MOST_RAYS],
    /// 1 for cells with a ray, 0 for others.
    valid: [f32; MOST_RAYS],
}

/// Largest field that any pair of cells of a quarter leaves open, per solid angle and times distance squared [m^2], of
/// the four quarters.
///
/// Phases of two cells that vary linearly agree with the mean of their slopes; the rest, the change of the slopes and
/// of the body are left open. Fast phases leave less: an edge term has the field over the slopes.
#[inline(always)] // part of a kernel
pub(super) fn of_quarters(cells: &Cells) -> [f32; 4] {
    let rows = Rows::new(cells);
    let mut open = [0.0_f32; MOST_RAYS];
    let mut right = [0.0_f32; MOST_RAYS];
    let mut below = [0.0_f32; MOST_RAYS];
    for i in 0..MOST_RAYS - 1 {
        let pair = rows.pair(i, i + 1, 0);
        right[i] = if i % TILE == TILE - 1 { 0.0 } else { pair };
    }
    for i in 0..MOST_RAYS - TILE {
        below[i] = rows.pair(i, i + TILE, 1);
    }
    for i in 0..MOST_RAYS {
        open[i] = right[i].max(below[i]);
    }
    for i in 1..MOST_RAYS {
        open[i] = open[i].max(right[i - 1]);
    }
    for i in TILE..MOST_RAYS {
        open[i] = open[i].max(below[i - TILE]);
    }
    let mut quarters = [0.0_f32; 4];
    for (row, cells) in open.chunks_exact(TILE).enumerate() {
        for (half, cells) in cells.chunks_exact(TILE / 2).enumerate() {
            let quarter = &mut quarters[row / (TILE / 2) * 2 + half];
            for cell in cells {
                *quarter = quarter.max(*cell);
            }
        }
    }
    quarters
}

impl Rows {
    #[inline(always)]
    fn new(cells: &Cells) -> Self {
        let mut rows = Self {
            phase: [0.0; MOST_RAYS],
            slope: [[0.0; MOST_RAYS]; 2],
            least: [[0.0; MOST_RAYS]; 2],
            field: [0.0; MOST_RAYS],
            body: [NO_BODY; MOST_RAYS],
            valid: [0.0; MOST_RAYS],
        };
        for row in 0..TILE {
            for first in [0, TILE / 2] {
                let (to, from) = (row * TILE + first, TileRays::ray(row, first));
                for i in 0..TILE / 2 {
                    rows.phase[to + i] = cells.phase[from + i];
                    rows.slope[0][to + i] = cells.slope[0][from + i];
                    rows.slope[1][to + i] = cells.slope[1][from + i];
                    rows.least[0][to + i] = cells.least_slope[0][from + i];
                    rows.least[1][to + i] = cells.least_slope[1][from + i];
                    rows.field[to + i] = cells.field[from + i];
                    rows.body[to + i] = cells.body_of(from + i);
                    rows.valid[to + i] = (cells.valid >> (from + i) & 1) as f32;
                }
            }
        }
        rows
    }

    #[inline(always)]
    fn look(&self, cell: usize) -> Look {
        Look {
            slope: [self.slope[0][cell], self.slope[1][cell]],
            least: [self.least[0][cell], self.least[1][cell]],
            field: self.field[cell],
            body: self.body[cell],
        }
    }

    /// Field that the adjacent cells `a` and `b`, along an axis, leave open.
    #[inline(always)]
    fn pair(&self, a: usize, b: usize, axis: usize) -> f32 {
        let open = pair(self.look(a), self.look(b), axis, self.phase[b] - self.phase[a]);
        open * self.valid[a] * self.valid[b]
    }
}

/// Cells along the sides of a tile, for comparison with adjacent tiles.
#[derive(Clone, Debug)]
pub(super) struct Border {
    /// Left, right, top and bottom side: cells from top to bottom, or from left to right; none where no ray was cast.
    sides: [[Option<(Look, f64)>; TILE]; 4],
}

/// Sides of a tile, as [`Border`] orders them.
pub(super) const LEFT: usize = 0;
pub(super) const RIGHT: usize = 1;
pub(super) const TOP: usize = 2;
pub(super) const BOTTOM: usize = 3;

impl Border {
    /// Border of a tile whose directions are not cast: surfaces go on there.
    pub(super) const OUTSIDE: Self = Self {
        sides: [[None; TILE]; 4],
    };

    /// Border of a tile whose rays hit nothing.
    pub(super) fn empty(rows: usize, columns: usize) -> Self {
        let look = Look {
            slope: [0.0; 2],
            least: [0.0; 2],
            field: 0.0,
            body: NO_BODY,
        };
        let mut border = Self::OUTSIDE;
        for (side, number) in [(LEFT, rows), (RIGHT, rows), (TOP, columns), (BOTTOM, columns)] {
            border.sides[side][..number].fill(Some((look, 0.0)));
        }
        border
    }

    /// Border of evaluated cells, in a tile of some rows and columns.
    #[inline(always)] // part of a kernel
    pub(super) fn new(cells: &Cells, rows: usize, columns: usize) -> Self {
        let mut border = Self::OUTSIDE;
        for i in 0..TILE {
            for (side, row, column) in [
                (LEFT, i, 0),
                (RIGHT, i, columns - 1),
                (TOP, 0, i),
                (BOTTOM, rows - 1, i),
            ] {
                if row < rows && column < columns {
                    let cell = TileRays::ray(row, column);
                    let look = Look {
                        slope: [cells.slope[0][cell], cells.slope[1][cell]],
                        least: [cells.least_slope[0][cell], cells.least_slope[1][cell]],
                        field: cells.field[cell],
                        body: cells.body_of(cell),
                    };
                    border.sides[side][i] = Some((look, cells.distance[cell]));
                }
            }
        }
        border
    }

    /// Largest fields that the cells on a side and those of the tile beyond leave open, of the first and of the second
    /// half of the side. `wavenumber` [rad/m].
    pub(super) fn open(&self, side: usize, beyond: &Self, wavenumber: f64) -> [f32; 2] {
        let other = side ^ 1;
        let axis = side / 2;
        let mut halves = [0.0_f32; 2];
        for i in 0..TILE {
            let (Some(here), Some(there)) = (&self.sides[side][i], &beyond.sides[other][i]) else {
                continue;
            };
            // u and v fall to the right and downwards.
            let (first, second) = if side % 2 == 1 { (here, there) } else { (there, here) };
            let turn = (2.0 * wavenumber * (second.1 - first.1)) as f32;
            let half = &mut halves[i / (TILE / 2)];
            *half = half.max(pair(first.0, second.0, axis, turn));
        }
        halves
    }
}
