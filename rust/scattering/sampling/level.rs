//! Evaluated tiles of one level.

use std::sync::Arc;

use super::residual::of_quarter;
use super::tile::SampledTile;
use super::tile_index::TileIndex;

/// Evaluated tiles of one level.
#[derive(Default)]
pub(super) struct TileLevel {
    pub(super) tiles: Vec<Arc<SampledTile>>,
    /// Base tile of every tile.
    pub(super) base: Vec<u32>,
    /// A bit per block of every tile that became a packet of the next level.
    pub(super) split: Vec<u16>,
    /// Keys of the places, increasing, and numbers of the tiles.
    keys: Vec<(u64, u32)>,
}

impl TileLevel {
    /// Level without splits.
    pub(super) fn new(tiles: Vec<Arc<SampledTile>>, base: Vec<u32>) -> Self {
        let mut keys: Vec<(u64, u32)> = tiles.iter().map(|tile| tile.place.key()).zip(0..).collect();
        keys.sort_unstable();
        Self {
            split: vec![0; tiles.len()],
            tiles,
            base,
            keys,
        }
    }

    /// True if a quarter of a tile was not split.
    pub(super) fn keeps(&self, tile: usize, quarter: usize) -> bool {
        of_quarter(self.split[tile], quarter) == 0
    }

    /// Tile at a place, if its rays belong to the packets.
    pub(super) fn known(&self, place: &TileIndex, packets: u8) -> Option<Arc<SampledTile>> {
        let tile = &self.tiles[self.find(place)?];
        (tile.packets == packets).then(|| tile.clone())
    }

    /// Number of the tile at a place.
    pub(super) fn find(&self, place: &TileIndex) -> Option<usize> {
        let key = place.key();
        let at = self.keys.binary_search_by_key(&key, |(key, _)| *key).ok()?;
        Some(self.keys[at].1 as usize)
    }

    /// Tile at a place.
    pub(super) fn tile(&self, place: &TileIndex) -> Option<&SampledTile> {
        self.find(place).map(|number| &*self.tiles[number])
    }

    /// Number of rays of all tiles.
    pub(super) fn rays(&self) -> usize {
        self.tiles.iter().map(|tile| tile.rays).sum()
    }
}
