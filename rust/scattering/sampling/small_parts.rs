//! Small parts of meshes: quarters that are refined because rays of coarser cells may miss a connected component.

use std::f64::consts::TAU;

use super::context::Context;
use super::tile_index::TileIndex;
use crate::rays::camera::ImagePlane;
use crate::rays::packet::SIDE;
use crate::scattering::mesh_parts::MeshPart;
use crate::scattering::refinement::{MAX_LEVEL, field_of};

/// Number of cells across a part that is not missed.
const CELLS_ACROSS: f64 = 5.0;

/// Quarters, by level, that show parts smaller than two of their cells.
pub(super) struct SmallParts {
    /// A bit per quarter, row by row; empty for levels without parts.
    levels: Vec<Vec<u64>>,
    /// Number of quarters of a row.
    columns: Vec<usize>,
}

impl SmallParts {
    /// Small parts of all bodies that can have the smallest cross-section of interest.
    pub(super) fn new(context: &Context, rcs_floor: f64) -> Self {
        let (planes, sector) = (&context.planes, context.sector);
        let mut small = Self {
            levels: vec![Vec::new(); MAX_LEVEL],
            columns: planes.iter().map(|plane| plane.columns.div_ceil(SIDE)).collect(),
        };
        let field = field_of(rcs_floor, TAU / context.wavenumber);
        for part in MeshPart::small(sector.scene, &planes[0], field, CELLS_ACROSS) {
            small.mark(&part, planes);
        }
        small
    }

    /// True if a quarter of a tile must be refined.
    pub(super) fn wants(&self, place: &TileIndex, quarter: usize) -> bool {
        let Some(level) = self.levels.get(place.level).filter(|level| !level.is_empty()) else {
            return false;
        };
        let (row, column) = (2 * place.row + quarter / 2, 2 * place.column + quarter % 2);
        let bit = row * self.columns[place.level] + column;
        level.get(bit / 64).is_some_and(|word| word >> (bit % 64) & 1 == 1)
    }

    /// Mark the quarters of all levels whose cells are too large for a part.
    fn mark(&mut self, part: &MeshPart, planes: &[ImagePlane]) {
        for (level, plane) in planes.iter().enumerate().take(MAX_LEVEL) {
            if plane.du <= part.width[0] && plane.dv <= part.width[1] {
                return;
            }
            let columns = self.columns[level];
            let bits = &mut self.levels[level];
            bits.resize((plane.rows.div_ceil(SIDE) * columns).div_ceil(64), 0);
            let [rows, quarters] = plane
                .pixels_of(part.u, part.v)
                .map(|pixels| pixels.start / SIDE..pixels.end.div_ceil(SIDE));
            for row in rows {
                for column in quarters.clone() {
                    let bit = row * columns + column;
                    bits[bit / 64] |= 1 << (bit % 64);
                }
            }
        }
    }
}
