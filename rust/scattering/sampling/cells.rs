//! Cells of the image plane, what they show, and what they say of their neighbours.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::DVec3;

use crate::antennas::beam::Beam;
use crate::error::{Error, Result, fits_memory};
use crate::rays::batch::Found;
use crate::rays::camera::{Cell, ImagePlane, morton};
use crate::rays::hits::Counts;

/// How often a cell of the base grid can be halved.
pub const MAX_LEVEL: usize = 6;

/// Cells are split until what each leaves open is this part of the field of the smallest cross-section of interest. Thousands of
/// cells together then leave open a tenth to a third of it (spheres of 5 to 20 cm).
pub(super) const SHARE: f64 = 1e-2;

/// Parts of meshes that are smaller than a cell get as many cells across.
pub(super) const CELLS_ACROSS: f64 = 2.0;

/// Phase of a neighbour up to which it lies in the plane that a cell shows [rad].
pub(super) const PLANE: f64 = 0.02;

/// Phase that is not explained up to which two cells show one smooth surface [rad].
pub(super) const SMOOTH: f64 = 0.5;

/// Half of what the phase turns over a cell from which on it stands for its ends [rad].
pub(super) const STEEP: f64 = 1.0;

/// What cells may leave open goes down by this factor, in the end by less if the next step would take more rays than there are:
/// cells that are done but for some leave edges where they end, which are worse than all of them somewhat coarser.
pub(super) const FIRST_STEP: f64 = 4.0;

pub(super) const LAST_STEP: f64 = 1.4;

/// The sides of a cell: axis, and 0 for the lower end of it.
pub(super) const SIDES: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

/// Most pieces of a long part of a mesh, and most parts that are looked at in pieces.
pub(super) const MOST_PIECES: f64 = 256.0;

pub(super) const FEW_PARTS: usize = 1000;

/// Rays of cells that lie in a square of so many cells along either side, as a power of two, are cast together.
pub(super) const BUNDLE: u32 = 4;

/// A number that is no node's.
pub(super) const NONE: u32 = u32::MAX;

/// Most cells of the base grid, along either side: rows and columns of the finest are numbered in 32 bits.
pub(super) const MAX_SIDE: usize = 1 << 14;

/// What cells are split for.
#[derive(Clone, Copy, Debug)]
pub struct Refinement<'a> {
    /// The coarsest cells.
    pub base: ImagePlane,
    /// Smallest cross-section of interest [m^2].
    pub rcs_floor: f64,
    /// Most rays to cast; without one, as many as the floor asks for.
    pub budget: Option<usize>,
    /// Whether cells whose phase turns fast stand for their ends; see [`Leaf`].
    pub end_points: bool,
    /// Directions with enough gain; none: all.
    pub beam: Option<&'a Beam>,
}

/// Cells of all levels, and what their rays hit.
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
    /// What is on the sides of every node, in the order of [`SIDES`]; up to date for those without parts.
    pub(super) links: Vec<[Link; 4]>,
    /// What rays have hit whose cells were taken back.
    pub(super) spare: HashMap<Place, Found>,
    /// Cells whose rays were cast, these included.
    pub(super) num_cast: usize,
    /// What was done for them.
    pub counts: Counts,
    /// Cells that were not split, though they could have been: nothing was to be gained.
    pub num_coarse: usize,
    /// How much cells may leave open: 1, or more where the budget does not pay for that.
    pub allowed: f64,
    pub(super) beam: Option<Beam>,
    pub(super) wavelength: f64,
    pub(super) end_points: bool,
}

/// What cancels the end of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Partner {
    /// Nothing.
    None,
    /// What is beyond the border of what is seen.
    Border,
    /// The end of the cell of a number.
    Cell(usize),
}

/// What two neighbours say of what is between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    /// Field per solid angle over what may be left open.
    pub(super) field: f32,
    /// What of it may be something else than one smooth surface.
    pub(super) jump: f32,
    /// What of it is left open; and what, if they share an end that both leave out.
    pub(super) apart: f32,
    pub(super) together: f32,
    /// Whether they show one surface, on which such an end is the same for both.
    pub(super) is_alike: bool,
}

/// What is on one side of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Link {
    /// The node of the same level, or the finest one round that; [`NONE`] beyond the border, or as long as it is not known.
    pub(super) other: u32,
    /// What both say. It depends on what they see alone, so it stays as long as they are neighbours.
    pub(super) pair: Pair,
}

impl Link {
    pub(super) const NONE: Self = Self {
        other: NONE,
        pair: Pair::NOTHING,
    };
}

impl Pair {
    /// At the border of what is seen: surfaces go on there, and what they would add cancels ends.
    pub(super) const NOTHING: Self = Self {
        field: 0.0,
        jump: 0.0,
        apart: 0.0,
        together: 0.0,
        is_alike: true,
    };

    /// Of all pairs along a side: the worst of each.
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

/// How a cell stands for what is seen through it; see [`Leaf`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ends {
    pub(super) is_linear: bool,
    pub(super) has: [bool; 2],
}

/// Where a cell is on the grid of its level.
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
    pub(super) look: CellEcho,
    /// How much it leaves open, relative to what it may, once that is known.
    pub(super) open: f64,
}

/// A cell that was not split.
///
/// The phase of a linear cell varies linearly over it, as far as that matters. Where it turns by more than a radian or so to
/// either side along an axis, the integral over the cell is that of its two ends, at every frequency:
/// `sin(x)/x exp(-j phi) = (j/2x) (exp(-j(phi+x)) - exp(-j(phi-x)))`, and ends that two cells share cancel.
#[derive(Clone, Copy, Debug)]
pub struct Leaf {
    /// Where it is.
    pub cell: Cell,
    /// What its ray hit.
    pub found: Found,
    /// Whether its phase is linear.
    pub is_linear: bool,
    /// The axes, u and v, of which it has ends.
    pub has_ends: [bool; 2],
    /// Which of its points no neighbour cancels, a bit each: the lower and the upper end, or the corner `u + 2 v` where both axes
    /// have ends, or the centre.
    pub kept: u8,
}

/// What a cell adds to the sum, and how it varies.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellEcho {
    /// Field reflected and received, relative to a conductor where the gain is largest.
    pub(super) amplitude: f64,
    /// Half of what the phase turns over the cell, along u and v [rad].
    pub(super) slope: [f64; 2],
    /// Along which axes it may have ends: where every channel's phase turns fast, in the same sense.
    pub(super) steep: [bool; 2],
    /// Field per solid angle that may be left open here [sr].
    pub(super) tolerance: f64,
    /// Where its ray ends [m], and by how much that advances along the normal per length.
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

impl Refinement<'_> {
    /// Refuses what cannot be.
    pub fn check(&self) -> Result<()> {
        self.base.check()?;
        let (rows, columns) = (self.base.rows, self.base.columns);
        if rows.max(columns) > MAX_SIDE {
            let expected = format!("at most {MAX_SIDE} cells along either side of the base grid");
            return Err(Error::value("resolution", expected, format!("{rows} x {columns}")));
        }
        fits_memory("cells", &[rows, columns], size_of::<Node>())?;
        if !(self.rcs_floor > 0.0 && self.rcs_floor.is_finite()) {
            return Err(Error::value("rcs_floor", "a positive number [m^2]", self.rcs_floor));
        }
        match self.budget {
            Some(budget) if budget < rows * columns => {
                let expected = format!("at least {}, the cells of the base grid", rows * columns);
                Err(Error::value("ray_budget", expected, budget))
            }
            _ => Ok(()),
        }
    }

    /// Cells of the base grid, those near each other one after the other: in Morton's order.
    pub(super) fn base_cells(&self) -> Vec<Place> {
        let (rows, columns) = (self.base.rows as u32, self.base.columns as u32);
        let place = |row, column| Place { level: 0, row, column };
        let mut cells: Vec<Place> = (0..rows).flat_map(|i| (0..columns).map(move |j| place(i, j))).collect();
        cells.sort_unstable_by_key(|cell| morton(cell.row, cell.column));
        cells
    }

    /// Field per solid angle that a target of the smallest cross-section of interest has at a distance [sr].
    pub(super) fn field(&self, distance: f64, wavelength: f64) -> f64 {
        wavelength * (self.rcs_floor / (4.0 * PI)).sqrt() / (distance * distance)
    }
}
