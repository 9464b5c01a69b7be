//! Cells of the quadtree, their echoes, and the pair errors of neighbours.

use std::collections::HashMap;

use glam::DVec3;

use crate::antennas::beam::Beam;
use crate::rays::batch::Found;
use crate::rays::camera::{Cell, ImagePlane, morton};
use crate::rays::hits::Counts;
use crate::scattering::refinement::{MAX_LEVEL, Refinement, field_of};

/// Parts of meshes that are smaller than a cell get as many cells across.
pub(super) const CELLS_ACROSS: f64 = 2.0;

/// Phase of a neighbour up to which it lies in the plane that a cell shows [rad].
pub(super) const PLANE: f64 = 0.02;

/// Phase that is not explained up to which two cells show one smooth surface [rad].
pub(super) const SMOOTH: f64 = 0.5;

/// Half of what the phase turns over a cell from which on it stands for its ends [rad].
pub(super) const STEEP: f64 = 1.0;

/// Factor by which the allowed residual error decreases from step to step, in the end by less if the next step would
/// take more rays than there are: cells that are done but for some leave edges where they end, which are worse than all
/// of them somewhat coarser.
pub(super) const FIRST_STEP: f64 = 4.0;

pub(super) const LAST_STEP: f64 = 1.4;

/// The sides of a cell: axis, and 0 for the lower end of it.
pub(super) const SIDES: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

/// Rays of cells that lie in a square of so many cells along either side, as a power of two, are cast together.
pub(super) const TOGETHER: u32 = 4;

/// A number that is no node's.
pub(super) const NONE: u32 = u32::MAX;

/// Quadtree: cells of all levels, with the hits of their rays.
pub struct Quadtree {
    pub(super) planes: Vec<ImagePlane>,
    /// Node of every cell of the base grid, row by row.
    pub(super) roots: Vec<u32>,
    /// First those of the base grid, then the four parts of one cell after those of another.
    pub(super) nodes: Vec<Node>,
    /// The first part of every node, or [`NONE`].
    pub(super) parts: Vec<u32>,
    /// The node of every four parts.
    pub(super) wholes: Vec<u32>,
    /// Links to the neighbours on the sides of every node, in the order of [`SIDES`]; up to date for those without
    /// parts.
    pub(super) links: Vec<[Link; 4]>,
    /// Hits of rays whose cells were removed again.
    pub(super) spare: HashMap<Place, Found>,
    /// Cells whose rays were cast, these included.
    pub(super) num_cast: usize,
    /// Counts of rays and of tiles.
    pub counts: Counts,
    /// Number of cells that could be split further: the criterion does not ask for finer ones, or the budget is
    /// exhausted.
    pub num_coarse: usize,
    /// Residual error allowed per cell: 1, or more where the budget is exhausted.
    pub allowed: f64,
    pub(super) beam: Option<Beam>,
    pub(super) wavelength: f64,
    pub(super) end_points: bool,
}

/// Partner that cancels the edge term of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Partner {
    /// Nothing.
    None,
    /// Surface beyond the border of the image.
    Border,
    /// The end of the cell of a number.
    Cell(usize),
}

/// Pair error: difference between two neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PairError {
    /// Field per solid angle over the allowed residual field.
    pub(super) field: f32,
    /// Part that may be other than one smooth surface.
    pub(super) jump: f32,
    /// Residual error; and residual error if both leave out a shared edge term.
    pub(super) apart: f32,
    pub(super) together: f32,
    /// True if both are on one surface, where a shared edge term is equal for both.
    pub(super) is_alike: bool,
}

/// Link to the neighbour on one side of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Link {
    /// The node of the same level, or the finest one round that; [`NONE`] beyond the border, or as long as it is not
    /// known.
    pub(super) other: u32,
    /// Pair error of both. It depends on their hits alone and stays valid as long as they are neighbours.
    pub(super) pair: PairError,
}

impl Link {
    pub(super) const NONE: Self = Self {
        other: NONE,
        pair: PairError::NOTHING,
    };
}

impl PairError {
    /// At the border of what is seen: surfaces go on there, and what they would add cancels edge terms.
    pub(super) const NOTHING: Self = Self {
        field: 0.0,
        jump: 0.0,
        apart: 0.0,
        together: 0.0,
        is_alike: true,
    };

    /// Worst pair errors of all pairs along a side.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            field: self.field.max(other.field),
            jump: self.jump.max(other.jump),
            apart: self.apart.max(other.apart),
            together: self.together.max(other.together),
            is_alike: self.is_alike && other.is_alike,
        }
    }
}

/// Edge terms of a cell; see [`Leaf`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EdgeTerms {
    pub(super) is_linear: bool,
    pub(super) has: [bool; 2],
}

/// Place of a cell: level, row and column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Place {
    pub(super) level: u8,
    pub(super) row: u32,
    pub(super) column: u32,
}

/// A cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) place: Place,
    pub(super) cell: Cell,
    /// [sr]
    pub(super) solid_angle: f64,
    pub(super) found: Found,
    pub(super) echo: CellEcho,
    /// Residual error relative to the allowed one, once known.
    pub(super) residual: f64,
}

/// A cell that was not split.
///
/// The phase of a linear cell varies linearly over it, as far as that matters. Where it turns by more than a radian or
/// so to either side along an axis, the integral over the cell is that of its two ends, at every frequency: `sin(x)/x
/// exp(-j phi) = (j/2x) (exp(-j(phi+x)) - exp(-j(phi-x)))`, and ends that two cells share cancel.
#[derive(Clone, Copy, Debug)]
pub struct Leaf {
    /// Place in the quadtree.
    pub cell: Cell,
    /// Hit of the ray.
    pub found: Found,
    /// True if the phase is linear over the cell.
    pub is_linear: bool,
    /// The axes, u and v, along which it has edge terms.
    pub has_edge_terms: [bool; 2],
    /// Points that no neighbour cancels, a bit each: the lower and the upper end, or the corner `u + 2 v` where both
    /// axes have ends, or the centre.
    pub kept: u8,
}

/// Echo of a cell: its part of the sum, and derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellEcho {
    /// Field reflected and received, relative to a conductor where the gain is largest.
    pub(super) amplitude: f64,
    /// Half of what the phase turns over the cell, along u and v [rad].
    pub(super) slope: [f64; 2],
    /// Axes with edge terms: the phase of every channel varies fast, with the same sign.
    pub(super) steep: [bool; 2],
    /// Allowed residual field per solid angle [sr].
    pub(super) tolerance: f64,
    /// Position of the hit [m], and its advance along the normal per length.
    pub(super) point: DVec3,
    pub(super) advance: f64,
}

impl Place {
    /// The four parts, in Morton's order.
    pub(super) fn parts(self) -> [Self; 4] {
        [0, 1, 2, 3].map(|part| Self {
            level: self.level + 1,
            row: 2 * self.row + part / 2,
            column: 2 * self.column + part % 2,
        })
    }

    /// Near for cells that are near, of whatever level: Morton's order of their first finest cells.
    pub(super) fn order(&self) -> u64 {
        let finer = MAX_LEVEL as u8 - self.level;
        morton(self.row << finer, self.column << finer)
    }
}

impl CellEcho {
    pub(super) const NOTHING: Self = Self {
        amplitude: 0.0,
        slope: [0.0; 2],
        steep: [false; 2],
        tolerance: f64::INFINITY,
        point: DVec3::ZERO,
        advance: 1.0,
    };
}

/// Cells of the base grid, those near each other one after the other: in Morton's order.
pub(super) fn base_cells(refinement: &Refinement) -> Vec<Place> {
    let (rows, columns) = (refinement.base.rows as u32, refinement.base.columns as u32);
    let place = |row, column| Place { level: 0, row, column };
    let mut cells: Vec<Place> = (0..rows).flat_map(|i| (0..columns).map(move |j| place(i, j))).collect();
    cells.sort_unstable_by_key(|cell| morton(cell.row, cell.column));
    cells
}

/// Field per solid angle that a target of the smallest cross-section of interest has at a distance [sr].
pub(super) fn field(refinement: &Refinement, distance: f64, wavelength: f64) -> f64 {
    field_of(refinement.rcs_floor, wavelength) / (distance * distance)
}
