//! Small parts of meshes: quarters that are refined because rays of coarser cells may miss a connected component.

use glam::DVec3;

use super::place::{MAX_LEVEL, Place};
use crate::geometry::aabb::Bounds;
use crate::rays::camera::{ImagePlane, TILE};
use crate::rays::scene::PosedScene;
use crate::scattering::refinement::{Refinement, field_of};

/// Number of cells across a part that is not missed.
const CELLS_ACROSS: f64 = 5.0;

/// Largest number of pieces of a long part of a mesh, and of parts that are cut into pieces.
const MOST_PIECES: f64 = 256.0;
const FEW_PARTS: usize = 1000;

/// Side of a quarter [cells].
const SIDE: usize = TILE / 2;

/// Part of a mesh on the image plane: a rectangle that needs cells of a size.
struct Part {
    u: [f64; 2],
    v: [f64; 2],
    /// Widest cells.
    width: [f64; 2],
}

/// Quarters, by level, that show parts smaller than two of their cells.
pub(super) struct SmallParts {
    /// A bit per quarter, row by row; empty for levels without parts.
    levels: Vec<Vec<u64>>,
    /// Number of quarters of a row.
    columns: Vec<usize>,
}

impl SmallParts {
    /// Small parts of all bodies that can have the smallest cross-section of interest.
    pub(super) fn new(scene: &PosedScene, refinement: &Refinement, planes: &[ImagePlane], wavelength: f64) -> Self {
        let mut small = Self {
            levels: vec![Vec::new(); MAX_LEVEL],
            columns: planes.iter().map(|plane| plane.columns.div_ceil(SIDE)).collect(),
        };
        let field = field_of(refinement.rcs_floor, wavelength);
        let base = &refinement.base;
        for body in 0..scene.num_bodies() as u32 {
            let (pose, parts) = (scene.pose(body), scene.surface(body).parts());
            let most = if parts.len() > FEW_PARTS { 1.0 } else { MOST_PIECES };
            for part in parts {
                let pieces = pieces(part, most);
                for piece in &pieces {
                    let corners = piece.corners().map(|corner| pose.point(corner));
                    let Some(part) = Part::new(&corners, pieces.len() as f64, field) else {
                        continue;
                    };
                    if part.width[0] < base.du || part.width[1] < base.dv {
                        small.mark(&part, planes);
                    }
                }
            }
        }
        small
    }

    /// True if a quarter of a tile must be refined.
    pub(super) fn wants(&self, place: &Place, quarter: usize) -> bool {
        let Some(level) = self.levels.get(place.level).filter(|level| !level.is_empty()) else {
            return false;
        };
        let (row, column) = (2 * place.row + quarter / 2, 2 * place.column + quarter % 2);
        let bit = row * self.columns[place.level] + column;
        level.get(bit / 64).is_some_and(|word| word >> (bit % 64) & 1 == 1)
    }

    /// Mark the quarters of all levels whose cells are too large for a part.
    fn mark(&mut self, part: &Part, planes: &[ImagePlane]) {
        // Cells that a range of the plane covers, along an axis.
        let range = |[low, high]: [f64; 2], axis: f64, width: f64, number: usize| {
            let first = (axis - high / width).floor().max(0.0) as usize;
            let last = (axis - low / width).floor().min(number as f64 - 1.0);
            if last < 0.0 {
                0..0
            } else {
                first / SIDE..last as usize / SIDE + 1
            }
        };
        for (level, plane) in planes.iter().enumerate().take(MAX_LEVEL) {
            if plane.du <= part.width[0] && plane.dv <= part.width[1] {
                return;
            }
            let columns = self.columns[level];
            let bits = &mut self.levels[level];
            bits.resize((plane.rows.div_ceil(SIDE) * columns).div_ceil(64), 0);
            for row in range(part.v, plane.axis_row, plane.dv, plane.rows) {
                for column in range(part.u, plane.axis_column, plane.du, plane.columns) {
                    let bit = row * columns + column;
                    bits[bit / 64] |= 1 << (bit % 64);
                }
            }
        }
    }
}

impl Part {
    /// Part of a box in the sensor frame, one of a number of pieces; none where it is smaller than a field times
    /// distance squared [m^2] or reaches behind the sensor, and is near and large.
    fn new(corners: &[DVec3; 8], pieces: f64, field: f64) -> Option<Self> {
        if corners.iter().any(|corner| corner.x <= 0.0) {
            return None;
        }
        let range = |axis: usize| {
            let ratios = corners.iter().map(|corner| corner[axis] / corner.x);
            let (low, high) = ratios.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            [low, high]
        };
        let (u, v) = (range(1), range(2));
        let lengths = corners.iter().map(|corner| corner.length_squared());
        let nearest = lengths.fold(f64::INFINITY, f64::min);
        let is_bright = pieces * (u[1] - u[0]) * (v[1] - v[0]) * nearest >= field;
        let width = [u, v].map(|[low, high]| (high - low) / CELLS_ACROSS);
        is_bright.then_some(Self { u, v, width })
    }
}

/// Split a long box into pieces about as long as wide: the border of the image may cross the box.
fn pieces(bounds: &Bounds, most: f64) -> Vec<Bounds> {
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
