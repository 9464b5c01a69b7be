//! Places of tiles on the image planes of all levels.

use crate::rays::camera::{ImagePlane, PixelTile, TILE};
use crate::scattering::refinement::MAX_LEVEL;

/// Image planes of all levels.
pub(super) fn planes(base: &ImagePlane) -> Vec<ImagePlane> {
    (0..=MAX_LEVEL).map(|level| base.divided(1 << level)).collect()
}

/// Places of the tiles of the base level and their numbers, sector by sector and row by row.
pub(super) fn base_tiles<'a>(bases: impl Iterator<Item = &'a ImagePlane>) -> Vec<(u32, TileIndex)> {
    let places = bases.enumerate().flat_map(|(sector, base)| {
        let columns = base.columns.div_ceil(TILE);
        (0..base.num_tiles()).map(move |index| TileIndex {
            sector,
            level: 0,
            row: index / columns,
            column: index % columns,
        })
    });
    (0..).zip(places).collect()
}

/// Place of a tile: sector, level, and row and column among the tiles of the level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TileIndex {
    pub(super) sector: usize,
    pub(super) level: usize,
    pub(super) row: usize,
    pub(super) column: usize,
}

impl TileIndex {
    /// Tile of half the cell size that covers a quarter.
    pub(super) fn quarter(&self, number: usize) -> Self {
        Self {
            sector: self.sector,
            level: self.level + 1,
            row: 2 * self.row + number / 2,
            column: 2 * self.column + number % 2,
        }
    }

    /// Tile of the same size beside it, on the lower, 0, or upper, 1, side of an axis, u or v.
    pub(super) fn beside(&self, axis: usize, side: usize) -> Option<Self> {
        let (row, column) = step(self.row, self.column, axis, side)?;
        Some(Self { row, column, ..*self })
    }

    /// Number of the tile, unique within its level.
    pub(super) fn key(&self) -> u64 {
        // Rows and columns of tiles have 20 bits, see `Refinement::check`.
        (self.sector as u64) << 56 | (self.row as u64) << 28 | self.column as u64
    }

    /// Pixels of the tile on the image plane of its level; none beyond the plane.
    pub(super) fn pixels(&self, plane: &ImagePlane) -> Option<PixelTile> {
        let (row, column) = (TILE * self.row, TILE * self.column);
        (row < plane.rows && column < plane.columns).then(|| PixelTile {
            row,
            column,
            rows: TILE.min(plane.rows - row),
            columns: TILE.min(plane.columns - column),
        })
    }
}

/// Row and column beside others; none beyond the first ones. u and v grow to the left and upwards.
pub(super) fn step(row: usize, column: usize, axis: usize, side: usize) -> Option<(usize, usize)> {
    let step = if side == 0 { 1 } else { -1 };
    if axis == 0 {
        Some((row, column.checked_add_signed(step)?))
    } else {
        Some((row.checked_add_signed(step)?, column))
    }
}
