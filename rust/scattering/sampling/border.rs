//! Border of a tile: cells along its sides, for comparison with those of adjacent tiles.

use super::cells::Cells;
use super::residual::{BLOCKS, Echo, Echoes, NOTHING, block, pair_error};
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::rays::camera::TILE;
use crate::rays::packet::{PACKET, TileRays};

/// Cells on all sides of a tile.
const AROUND: usize = 4 * TILE;

/// Cells along the sides of a tile: the left and the right one from top to bottom, the top and the bottom one from left
/// to right.
#[derive(Clone, Debug)]
pub(super) struct Border {
    /// Numbers of [`Echo`], without phases.
    slope: [[f32; AROUND]; 2],
    least: [[f32; AROUND]; 2],
    shrink: [f32; AROUND],
    field: [f32; AROUND],
    body: [f32; AROUND],
    /// Zero where no ray was cast: surfaces go on there.
    valid: [f32; AROUND],
    /// Distances [m].
    distance: [f64; AROUND],
}

impl Border {
    /// Border of a tile whose directions are not cast.
    pub(super) const OUTSIDE: Self = Self {
        slope: [[0.0; AROUND]; 2],
        least: [[0.0; AROUND]; 2],
        shrink: [0.0; AROUND],
        field: [0.0; AROUND],
        body: [NOTHING; AROUND],
        valid: [0.0; AROUND],
        distance: [0.0; AROUND],
    };

    /// Border of a tile, of some rows and columns, whose rays hit nothing.
    pub(super) fn empty(rays: &TileRays, rows: usize, columns: usize) -> Self {
        let mut border = Self::OUTSIDE;
        for place in 0..AROUND {
            if let Some((row, column)) = cell(place, rows, columns) {
                let ray = TileRays::ray(row, column);
                border.valid[place] = (rays.valid[ray / PACKET] >> (ray % PACKET) & 1) as f32;
            }
        }
        border
    }

    /// Border of evaluated cells, in a tile of some rows and columns.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub(super) fn new(echoes: &Echoes, cells: &Cells, rows: usize, columns: usize) -> Self {
        let mut border = Self::OUTSIDE;
        for place in 0..AROUND {
            let Some((row, column)) = cell(place, rows, columns) else {
                continue;
            };
            let at = row * TILE + column;
            for axis in 0..2 {
                border.slope[axis][place] = echoes.slope[axis][at];
                border.least[axis][place] = echoes.least[axis][at];
            }
            border.shrink[place] = echoes.shrink[at];
            border.field[place] = echoes.field[at];
            border.body[place] = echoes.body[at];
            border.valid[place] = echoes.valid[at];
            border.distance[place] = cells.distance[TileRays::ray(row, column)];
        }
        border
    }

    /// Raise the residual fields of blocks to those of the pairs with the tiles `beyond` the sides. `wavenumber`
    /// [rad/m].
    pub(super) fn raise(
        &self,
        level: Level,
        beyond: [Option<&Self>; 4],
        wavenumber: f64,
        residual: &mut [f32; BLOCKS],
    ) {
        if beyond.iter().any(Option::is_some) {
            level.run(Compare {
                border: self,
                beyond,
                wavenumber,
                residual,
            });
        }
    }

    /// Echoes at two sides from one place on; phases [rad] relative to those of other distances.
    #[cfg_attr(optimised, inline(always))]
    fn load<V: Vector<Scalar = f32>>(&self, first: usize, phase: V) -> Echo<V> {
        Echo {
            phase,
            slope: [V::load(&self.slope[0][first..]), V::load(&self.slope[1][first..])],
            least: [V::load(&self.least[0][first..]), V::load(&self.least[1][first..])],
            shrink: V::load(&self.shrink[first..]),
            field: V::load(&self.field[first..]),
            body: V::load(&self.body[first..]),
            valid: V::load(&self.valid[first..]),
        }
    }

    /// Copy the side of another border to a side of this one.
    #[cfg_attr(optimised, inline(always))]
    fn copy(&mut self, to: usize, from: &Self, side: usize) {
        let (to, side) = (to * TILE, side * TILE);
        for axis in 0..2 {
            self.slope[axis][to..to + TILE].copy_from_slice(&from.slope[axis][side..side + TILE]);
            self.least[axis][to..to + TILE].copy_from_slice(&from.least[axis][side..side + TILE]);
        }
        self.shrink[to..to + TILE].copy_from_slice(&from.shrink[side..side + TILE]);
        self.field[to..to + TILE].copy_from_slice(&from.field[side..side + TILE]);
        self.body[to..to + TILE].copy_from_slice(&from.body[side..side + TILE]);
        self.valid[to..to + TILE].copy_from_slice(&from.valid[side..side + TILE]);
        self.distance[to..to + TILE].copy_from_slice(&from.distance[side..side + TILE]);
    }
}

/// Row and column of the cell at a place of the border of a tile of some rows and columns.
#[cfg_attr(optimised, inline(always))]
fn cell(place: usize, rows: usize, columns: usize) -> Option<(usize, usize)> {
    let along = place % TILE;
    let (row, column) = match place / TILE {
        0 => (along, 0),
        1 => (along, columns - 1),
        2 => (0, along),
        _ => (rows - 1, along),
    };
    (row < rows && column < columns).then_some((row, column))
}

/// Kernel of [`Border::raise`].
struct Compare<'a> {
    border: &'a Border,
    beyond: [Option<&'a Border>; 4],
    wavenumber: f64,
    residual: &'a mut [f32; BLOCKS],
}

impl Kernel for Compare<'_> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        // Opposite sides meet.
        let mut there = Border::OUTSIDE;
        for side in 0..4 {
            if let Some(beyond) = self.beyond[side] {
                there.copy(side, beyond, side ^ 1);
            }
        }
        for axis in 0..2 {
            let first = axis * 2 * TILE;
            let mut turn = [0.0; PACKET];
            for i in 0..PACKET {
                let (near, far) = (self.border.distance[first + i], there.distance[first + i]);
                // u and v fall to the right and downwards.
                let step = if i < TILE { near - far } else { far - near };
                turn[i] = (2.0 * self.wavenumber * step) as f32;
            }
            let turn = I::F32::load(&turn);
            let zero = <I::F32 as Vector>::splat(0.0);
            // The tile beyond comes first on the left and on top: the turn has that order, the rest is alike both ways.
            let here = self.border.load(first, zero);
            let beyond = there.load(first, turn);
            let mut fields = [0.0; PACKET];
            pair_error(&here, &beyond, axis).store(&mut fields);
            for i in 0..PACKET {
                const LAST: usize = TILE - 1;
                let along = i % TILE;
                let (row, column) = [(along, 0), (along, LAST), (0, along), (LAST, along)][2 * axis + i / TILE];
                let residual = &mut self.residual[block(row, column)];
                *residual = residual.max(fields[i]);
            }
        }
    }
}
