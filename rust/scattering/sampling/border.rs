//! Border of a tile: cells along its sides, for comparison with cells of adjacent tiles.

use super::cells::TileCells;
use super::residual::{
    BLOCKS, CellFeatures, FEATURES, Features, NOTHING, PHASE, SURFACE, VALID, block, load, pair_error,
};
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::rays::camera::TILE;
use crate::rays::packet::{PACKET, TileRays};

/// Cells on all sides of a tile.
const AROUND: usize = 4 * TILE;

/// Cells along the sides of a tile: the left and the right one from top to bottom, the top and the bottom one from left
/// to right.
#[derive(Clone, Debug)]
pub(super) struct Border {
    /// Features; cells without a ray are not valid, as surfaces go on there.
    features: Features<[f32; AROUND]>,
    /// Distances [m].
    distance: [f64; AROUND],
}

impl Border {
    /// Border of a tile whose directions are not cast.
    pub(super) const OUTSIDE: Self = {
        let mut features = [[0.0; AROUND]; FEATURES];
        features[SURFACE] = [NOTHING; AROUND];
        Self {
            features,
            distance: [0.0; AROUND],
        }
    };

    /// Border of a tile, of some rows and columns, whose rays hit nothing.
    pub(super) fn empty(rays: &TileRays, rows: usize, columns: usize) -> Self {
        let mut border = Self::OUTSIDE;
        for place in 0..AROUND {
            if let Some((row, column)) = cell(place, rows, columns) {
                let ray = TileRays::ray(row, column);
                border.features[VALID][place] = (rays.valid[ray / PACKET] >> (ray % PACKET) & 1) as f32;
            }
        }
        border
    }

    /// Border of evaluated cells, in a tile of some rows and columns.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub(super) fn new(features: &CellFeatures, cells: &TileCells, rows: usize, columns: usize) -> Self {
        let mut border = Self::OUTSIDE;
        for place in 0..AROUND {
            let Some((row, column)) = cell(place, rows, columns) else {
                continue;
            };
            for feature in 0..FEATURES {
                border.features[feature][place] = features.0[feature][row * TILE + column];
            }
            border.distance[place] = cells.distance[TileRays::ray(row, column)];
        }
        border
    }

    /// Raise the residual fields of blocks to the fields of the pairs with adjacent tiles. `wavenumber`
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

    /// Copy the side of another border to a side of this one.
    #[cfg_attr(optimised, inline(always))]
    fn copy(&mut self, to: usize, from: &Self, side: usize) {
        let (to, side) = (to * TILE, side * TILE);
        for feature in 0..FEATURES {
            let (row, other) = (&mut self.features[feature], &from.features[feature]);
            row[to..to + TILE].copy_from_slice(&other[side..side + TILE]);
        }
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
            let mut step = [0.0; PACKET];
            for i in 0..PACKET {
                let (near, far) = (self.border.distance[first + i], there.distance[first + i]);
                // u and v fall to the right and downwards.
                let length = if i < TILE { near - far } else { far - near };
                step[i] = (2.0 * self.wavenumber * length) as f32;
            }
            // The tile beyond comes first on the left and on top: the step has that order, the rest is alike both ways.
            let mut here = load::<I::F32, AROUND>(&self.border.features, first);
            let mut beyond = load(&there.features, first);
            (here[PHASE], beyond[PHASE]) = (<I::F32 as Vector>::splat(0.0), I::F32::load(&step));
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
