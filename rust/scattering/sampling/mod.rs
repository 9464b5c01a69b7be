//! Adaptive sampling: a quadtree of cells of the image plane, fine where what is seen through a cell is not yet known.
//!
//! Every cell has a ray through its centre, and what that hits stands for the cell with a phase that varies linearly over it
//! (README eq. (2) and its footprint). A cell is compared with its neighbours: where they differ by more than that allows, and
//! the cell's part of the sum is large enough to matter, it is split in four. All cells of a round are one batch of rays.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use crate::antennas::array::Array;
use crate::antennas::beam::Beam;
use crate::antennas::polarization::Seen;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result, fits_memory};
use crate::geometry::aabb::Bounds;
use crate::rays::batch::{Found, Known};
use crate::rays::camera::{Cell, ImagePlane, morton};
use crate::rays::hits::{Cast, Counts};
use crate::rays::packet::MOST_RAYS;
use crate::rays::scene::Snapshot;
use crate::rays::tree::Tree;
use crate::scattering::material::Material;

/// How often a cell of the base grid can be halved.
pub const MAX_LEVEL: usize = 6;

/// Cells are split until what each leaves open is this part of the field of the smallest cross-section of interest. Thousands of
/// cells together then leave open a tenth to a third of it (spheres of 5 to 20 cm).
const SHARE: f64 = 1e-2;

/// Parts of meshes that are smaller than a cell get as many cells across.
const CELLS_ACROSS: f64 = 2.0;

/// Phase of a neighbour up to which it lies in the plane that a cell shows [rad].
const PLANE: f64 = 0.02;

/// Phase that is not explained up to which two cells show one smooth surface [rad].
const SMOOTH: f64 = 0.5;

/// Half of what the phase turns over a cell from which on it stands for its ends [rad].
const STEEP: f64 = 1.0;

/// What cells may leave open goes down by this factor, in the end by less if the next step would take more rays than there are:
/// cells that are done but for some leave edges where they end, which are worse than all of them somewhat coarser.
const FIRST_STEP: f64 = 4.0;
const LAST_STEP: f64 = 1.4;

/// The sides of a cell: axis, and 0 for the lower end of it.
const SIDES: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

/// Most pieces of a long part of a mesh, and most parts that are looked at in pieces.
const MOST_PIECES: f64 = 256.0;
const FEW_PARTS: usize = 1000;

/// Rays of cells that lie in a square of so many cells along either side, as a power of two, are cast together.
const BUNDLE: u32 = 4;

/// A number that is no node's.
const NONE: u32 = u32::MAX;

/// Most cells of the base grid, along either side: rows and columns of the finest are numbered in 32 bits.
const MAX_SIDE: usize = 1 << 14;

/// What cells are split for.
#[derive(Clone, Copy, Debug)]
pub struct Rule<'a> {
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
    planes: Vec<ImagePlane>,
    /// Node of every cell of the base grid, row by row.
    roots: Vec<u32>,
    /// First those of the base grid, then the four parts of one cell after those of another.
    nodes: Vec<Node>,
    /// The first part of every node, or [`NONE`].
    parts: Vec<u32>,
    /// The node of every four parts.
    wholes: Vec<u32>,
    /// What is on the sides of every node, in the order of [`SIDES`]; up to date for those without parts.
    links: Vec<[Link; 4]>,
    /// What rays have hit whose cells were taken back.
    spare: HashMap<Place, Found>,
    /// Cells whose rays were cast, these included.
    num_cast: usize,
    /// What was done for them.
    pub counts: Counts,
    /// Cells that were not split, though they could have been: nothing was to be gained.
    pub num_coarse: usize,
    /// How much cells may leave open: 1, or more where the budget does not pay for that.
    pub allowed: f64,
    beam: Option<Beam>,
    wavelength: f64,
    end_points: bool,
}

/// What cancels the end of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Partner {
    /// Nothing.
    None,
    /// What is beyond the border of what is seen.
    Border,
    /// The end of the cell of a number.
    Cell(usize),
}

/// What two neighbours say of what is between them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pair {
    /// Field per solid angle over what may be left open.
    field: f32,
    /// What of it may be something else than one smooth surface.
    jump: f32,
    /// What of it is left open; and what, if they share an end that both leave out.
    apart: f32,
    together: f32,
    /// Whether they show one surface, on which such an end is the same for both.
    is_alike: bool,
}

/// What is on one side of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Link {
    /// The node of the same level, or the finest one round that; [`NONE`] beyond the border, or as long as it is not known.
    other: u32,
    /// What both say. It depends on what they see alone, so it stays as long as they are neighbours.
    pair: Pair,
}

impl Link {
    const NONE: Self = Self {
        other: NONE,
        pair: Pair::NOTHING,
    };
}

impl Pair {
    /// At the border of what is seen: surfaces go on there, and what they would add cancels ends.
    const NOTHING: Self = Self {
        field: 0.0,
        jump: 0.0,
        apart: 0.0,
        together: 0.0,
        is_alike: true,
    };

    /// Of all pairs along a side: the worst of each.
    fn and(self, other: Self) -> Self {
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
struct Ends {
    is_linear: bool,
    has: [bool; 2],
}

/// Where a cell is on the grid of its level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Place {
    level: u8,
    row: u32,
    column: u32,
}

/// A cell.
#[derive(Clone, Copy, Debug)]
struct Node {
    place: Place,
    cell: Cell,
    /// [sr]
    solid_angle: f64,
    found: Found,
    look: Look,
    /// How much it leaves open, relative to what it may, once that is known.
    open: f64,
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
struct Look {
    /// Field reflected and received, relative to a conductor where the gain is largest.
    amplitude: f64,
    /// Half of what the phase turns over the cell, along u and v [rad].
    slope: [f64; 2],
    /// Along which axes it may have ends: where every channel's phase turns fast, in the same sense.
    steep: [bool; 2],
    /// Field per solid angle that may be left open here [sr].
    tolerance: f64,
    /// Where its ray ends [m], and by how much that advances along the normal per length.
    point: DVec3,
    advance: f64,
}

impl Place {
    /// The four parts, in Morton's order.
    fn parts(self) -> [Self; 4] {
        [0, 1, 2, 3].map(|part| Self {
            level: self.level + 1,
            row: 2 * self.row + part / 2,
            column: 2 * self.column + part % 2,
        })
    }

    /// Near for cells that are near, of whatever level: Morton's order of their first finest cells.
    fn order(&self) -> u64 {
        let finer = MAX_LEVEL as u8 - self.level;
        morton(self.row << finer, self.column << finer)
    }
}

impl Look {
    const NOTHING: Self = Self {
        amplitude: 0.0,
        slope: [0.0; 2],
        steep: [false; 2],
        tolerance: f64::INFINITY,
        point: DVec3::ZERO,
        advance: 1.0,
    };
}

/// A part of a mesh as the sensor sees it: a rectangle of the image plane that wants cells of a size.
struct Target {
    u: [f64; 2],
    v: [f64; 2],
    /// Widest cells.
    width: [f64; 2],
}

/// Everything that cells are judged by.
struct Judge<'a> {
    snapshot: &'a Snapshot,
    materials: &'a [Material],
    array: &'a Array,
    rule: &'a Rule<'a>,
    wavelength: f64,
}

impl Quadtree {
    /// Split cells until they are fine enough. `previous`: at another time, and boxes where bodies have moved since.
    pub fn grow(
        snapshot: &Snapshot,
        cast: &Cast,
        materials: &[Material],
        array: &Array,
        rule: &Rule,
        previous: Option<(&Self, &Tree)>,
    ) -> Result<Self> {
        let judge = Judge {
            snapshot,
            materials,
            array,
            rule,
            wavelength: SPEED_OF_LIGHT / array.frequency,
        };
        let previous = previous.filter(|(tree, _)| tree.planes[0] == rule.base && tree.beam.as_ref() == rule.beam);
        let mut tree = Self {
            planes: (0..=MAX_LEVEL).map(|level| rule.base.divided(1 << level)).collect(),
            roots: vec![NONE; rule.base.num_pixels()],
            nodes: Vec::new(),
            parts: Vec::new(),
            wholes: Vec::new(),
            links: Vec::new(),
            spare: HashMap::new(),
            num_cast: 0,
            counts: Counts::default(),
            num_coarse: 0,
            allowed: 1.0,
            beam: rule.beam.cloned(),
            wavelength: judge.wavelength,
            end_points: rule.end_points,
        };
        let add = |tree: &mut Self, cells: Vec<Place>| tree.add(&judge, cast, previous, &cells);

        // The base grid.
        let cells = rule.base_cells();
        for (node, cell) in cells.iter().enumerate() {
            tree.roots[cell.row as usize * rule.base.columns + cell.column as usize] = node as u32;
        }
        add(&mut tree, cells)?;

        // Parts of meshes that it may have missed.
        let targets = judge.targets();
        for level in 0..MAX_LEVEL {
            let mut split = tree.cells_on(&targets, level);
            split.truncate(rule.budget.map_or(usize::MAX, |budget| tree.affordable(budget)));
            let cells = tree.split(&mut split);
            add(&mut tree, cells)?;
        }

        // Cells that leave too much open, of a smaller and smaller target, as far as the budget goes.
        let all: Vec<u32> = (0..tree.nodes.len() as u32).collect();
        tree.link(&all);
        tree.measure(&all);
        tree.raise(&all);
        tree.allowed = tree.nodes.iter().map(|node| node.open).fold(1.0, f64::max);
        let (mut step, most) = (FIRST_STEP, rule.budget.unwrap_or(usize::MAX));
        while tree.allowed > 1.0 && step >= LAST_STEP {
            let before = tree.allowed;
            tree.allowed = (before / step).max(1.0);
            let open: Vec<f64> = tree.nodes.iter().map(|node| node.open).collect();
            if !tree.refine(most, add)? {
                tree.go_back(&open);
                tree.allowed = before;
                step = step.sqrt();
            }
        }
        tree.spare = HashMap::new();
        tree.num_coarse = (0..tree.nodes.len()).filter(|node| tree.could_be_split(*node)).count();
        Ok(tree)
    }

    /// Split cells until none leaves more open than is allowed, unless that takes more rays than some number.
    fn refine(&mut self, most: usize, mut add: impl FnMut(&mut Self, Vec<Place>) -> Result<()>) -> Result<bool> {
        let mut split: Vec<u32> = (0..self.nodes.len() as u32).collect();
        split.retain(|node| self.is_open(*node));
        while !split.is_empty() {
            let first = self.nodes.len();
            let parts = split.iter().flat_map(|node| self.nodes[*node as usize].place.parts());
            let number = parts.filter(|part| !self.spare.contains_key(part)).count();
            if self.num_cast.saturating_add(number) > most {
                return Ok(false);
            }
            let cells = self.split(&mut split);
            add(self, cells)?;
            let mut changed: Vec<u32> = (first as u32..self.nodes.len() as u32).collect();
            self.beside_all(&split, &mut changed);
            changed.sort_unstable();
            changed.dedup();
            self.link(&changed);
            self.measure(&changed);
            split = self.with_coarser(&changed);
            self.raise(&split);
            split.retain(|node| self.is_open(*node));
        }
        Ok(true)
    }

    /// Take back the last cells, and how much the others had left open.
    fn go_back(&mut self, open: &[f64]) {
        let number = open.len();
        self.spare
            .extend(self.nodes.drain(number..).map(|node| (node.place, node.found)));
        self.wholes.truncate((number - self.roots.len()) / 4);
        self.parts.truncate(number);
        self.links.truncate(number);
        let mut changed = Vec::new();
        for (node, open) in open.iter().enumerate() {
            self.nodes[node].open = *open;
            if self.parts[node] != NONE && self.parts[node] as usize >= number {
                self.parts[node] = NONE;
            }
            if self.links[node].iter().any(|link| link.other as usize >= number) {
                changed.push(node as u32);
            }
        }
        self.link(&changed);
    }

    /// Bring the links of some cells up to date.
    fn link(&mut self, nodes: &[u32]) {
        let links: Vec<[Link; 4]> = nodes.par_iter().map(|node| self.links_of(*node as usize)).collect();
        for (node, links) in nodes.iter().zip(links) {
            self.links[*node as usize] = links;
        }
    }

    /// The links of a cell, those anew that are not up to date.
    fn links_of(&self, index: usize) -> [Link; 4] {
        let mut links = self.links[index];
        if self.parts[index] != NONE {
            return links;
        }
        let level = self.nodes[index].place.level;
        for (link, (axis, side)) in links.iter_mut().zip(SIDES) {
            let parts = self.parts.get(link.other as usize);
            if parts.is_some_and(|parts| *parts == NONE || self.nodes[link.other as usize].place.level == level) {
                continue;
            }
            *link = Link::NONE;
            if let Some(other) = self.neighbour(index, axis, side) {
                link.other = other as u32;
                if self.nodes[index].found.is_seen && self.nodes[other].found.is_seen {
                    link.pair = self.compare(index, other, axis);
                }
            }
        }
        links
    }

    /// What is on one side of a cell, if that is seen.
    fn linked(&self, index: usize, axis: usize, side: usize) -> Option<usize> {
        let other = self.links[index][2 * axis + side].other as usize;
        let node = self.nodes.get(other)?;
        node.found.is_seen.then_some(other)
    }

    /// Neighbours of cells that were split: they may have lost what cancels their ends.
    fn beside_all(&self, nodes: &[u32], cells: &mut Vec<u32>) {
        for (node, (axis, side)) in nodes.iter().flat_map(|node| SIDES.map(|side| (*node as usize, side))) {
            let Some(other) = self.neighbour(node, axis, side) else {
                continue;
            };
            // All along the side of the larger of both.
            cells.push(other as u32);
            self.along(other, axis, 1 - side, cells);
            if self.nodes[other].place.level < self.nodes[node].place.level
                && let Some(whole) = self.neighbour(other, axis, 1 - side)
            {
                self.along(whole, axis, side, cells);
            }
        }
    }

    /// Find out how much some cells leave open.
    fn measure(&mut self, nodes: &[u32]) {
        let left_open = |node: &u32| {
            let node = *node as usize;
            if self.parts[node] == NONE {
                self.left_open(node)
            } else {
                0.0
            }
        };
        let open: Vec<f64> = nodes.par_iter().map(left_open).collect();
        for (node, open) in nodes.iter().zip(open) {
            self.nodes[*node as usize].open = open;
        }
    }

    /// Some cells and the coarser ones beside them, in their order.
    fn with_coarser(&self, nodes: &[u32]) -> Vec<u32> {
        let mut cells = nodes.to_vec();
        for node in nodes
            .iter()
            .map(|node| *node as usize)
            .filter(|node| self.parts[*node] == NONE)
        {
            for Link { other, .. } in self.links[node] {
                let level = self.nodes.get(other as usize).map(|other| other.place.level);
                if level.is_some_and(|level| level < self.nodes[node].place.level) {
                    cells.push(other);
                }
            }
        }
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    /// Cells leave more open than they show where finer ones beside them say so: what a fine cell at the border sees is not what
    /// the ray in the middle of a coarse one does.
    fn raise(&mut self, nodes: &[u32]) {
        let raised: Vec<f64> = nodes.par_iter().map(|node| self.raised(*node as usize)).collect();
        for (node, raised) in nodes.iter().zip(raised) {
            let open = &mut self.nodes[*node as usize].open;
            *open = open.max(raised);
        }
    }

    /// What finer cells beside a cell that are open themselves say that it leaves open.
    fn raised(&self, index: usize) -> f64 {
        let mut most: f64 = 0.0;
        if self.parts[index] != NONE {
            return most;
        }
        let mut finer = Vec::new();
        for (axis, side) in SIDES {
            let Some(other) = self
                .linked(index, axis, side)
                .filter(|other| self.parts[*other] != NONE)
            else {
                continue;
            };
            let (_, is_shared) = self.beside(index, axis, side, other, &[]);
            finer.clear();
            self.along(other, axis, 1 - side, &mut finer);
            for node in finer
                .iter()
                .map(|node| *node as usize)
                .filter(|node| self.nodes[*node].open > 1.0)
            {
                let pair = self.links[node][2 * axis + 1 - side].pair;
                let residual = if is_shared { pair.together } else { pair.apart };
                most = most.max(f64::from(pair.field * residual.min(1.0)) * self.nodes[node].solid_angle);
            }
        }
        if most > 1.0 { most } else { 0.0 }
    }

    /// Whether a cell leaves too much open and can be split.
    fn is_open(&self, node: u32) -> bool {
        let node = node as usize;
        self.nodes[node].open > self.allowed && self.could_be_split(node)
    }

    /// Whether a cell has no parts and can have some.
    fn could_be_split(&self, node: usize) -> bool {
        self.parts[node] == NONE && usize::from(self.nodes[node].place.level) < MAX_LEVEL
    }

    /// Cast the rays of new cells.
    fn add(&mut self, judge: &Judge, cast: &Cast, previous: Option<(&Self, &Tree)>, cells: &[Place]) -> Result<()> {
        if cells.is_empty() {
            return Ok(());
        }
        let number = self.nodes.len() + cells.len();
        if u32::try_from(number).is_err() {
            return Err(Error::value(
                "rcs_floor",
                "one that takes fewer than 2^32 cells",
                number,
            ));
        }
        fits_memory("cells", &[number], 2 * size_of::<(Node, u32, [Link; 4])>())?;
        let is_new = |place: &&Place| !self.spare.contains_key(*place);
        let new: Vec<Place> = cells.iter().filter(is_new).copied().collect();
        let points: Vec<[f64; 2]> = new
            .iter()
            .map(|place| {
                let Cell { u, v, .. } = cell(&self.planes, place);
                [u, v]
            })
            .collect();
        let known = previous.map(|(tree, moved)| Known {
            moved,
            found: |ray: usize| {
                let node = tree.find(&new[ray])?;
                (tree.nodes[node].place == new[ray]).then_some(tree.nodes[node].found)
            },
        });
        let (found, counts) = judge.snapshot.cast_batch(&points, &bundles(&new), cast, known.as_ref());
        self.counts = self.counts.plus(counts);
        self.num_cast += new.len();
        let mut found = found.into_iter();
        let found: Vec<Found> = cells
            .iter()
            .map(|place| {
                self.spare
                    .get(place)
                    .copied()
                    .or_else(|| found.next())
                    .unwrap_or(Found::NOTHING)
            })
            .collect();
        let planes = &self.planes;
        let node = |(place, found): (&Place, Found)| {
            let cell = cell(planes, place);
            Node {
                place: *place,
                cell,
                solid_angle: cell.solid_angle(),
                look: judge.look(&cell, &found),
                found,
                open: 0.0,
            }
        };
        self.parts.resize(number, NONE);
        self.links.resize(number, [Link::NONE; 4]);
        self.nodes.par_extend(cells.par_iter().zip_eq(found).map(node));
        Ok(())
    }

    /// The places of the four parts of every cell, those near each other one after the other; they will be the next nodes.
    fn split(&mut self, nodes: &mut [u32]) -> Vec<Place> {
        nodes.sort_by_cached_key(|node| self.nodes[*node as usize].place.order());
        let mut cells = Vec::with_capacity(4 * nodes.len());
        let mut next = self.nodes.len() as u32;
        for node in nodes {
            self.wholes.push(*node);
            self.parts[*node as usize] = next;
            next += 4;
            cells.extend(self.nodes[*node as usize].place.parts());
        }
        cells
    }

    /// The node of a cell, or of the finest one round it.
    fn find(&self, cell: &Place) -> Option<usize> {
        let base = &self.planes[0];
        let (row, column) = (cell.row >> cell.level, cell.column >> cell.level);
        if row as usize >= base.rows || column as usize >= base.columns {
            return None;
        }
        let mut node = self.roots[row as usize * base.columns + column as usize] as usize;
        for level in (0..cell.level).rev() {
            let parts = self.parts[node];
            if parts == NONE {
                break;
            }
            node = (parts + 2 * (cell.row >> level & 1) + (cell.column >> level & 1)) as usize;
        }
        Some(node)
    }

    /// Cells of a level, not split so far, on which targets want finer ones.
    fn cells_on(&self, targets: &[Target], level: usize) -> Vec<u32> {
        let plane = &self.planes[level];
        // Rows and columns that a range of the plane covers.
        let range = |[low, high]: [f64; 2], axis: f64, width: f64, number: usize| {
            let first = (axis - high / width).floor().max(0.0) as usize;
            let last = (axis - low / width).floor().min(number as f64 - 1.0);
            if last < 0.0 { 0..0 } else { first..last as usize + 1 }
        };
        let mut nodes: Vec<u32> = Vec::new();
        for target in targets {
            if plane.du <= target.width[0] && plane.dv <= target.width[1] {
                continue;
            }
            for row in range(target.v, plane.axis_row, plane.dv, plane.rows) {
                for column in range(target.u, plane.axis_column, plane.du, plane.columns) {
                    let cell = Place {
                        level: level as u8,
                        row: row as u32,
                        column: column as u32,
                    };
                    let node = self
                        .find(&cell)
                        .filter(|node| self.nodes[*node].place == cell && self.parts[*node] == NONE);
                    nodes.extend(node.map(|node| node as u32));
                }
            }
        }
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// How many cells can be split within a budget.
    fn affordable(&self, budget: usize) -> usize {
        budget.saturating_sub(self.num_cast) / 4
    }

    /// How much a cell leaves open, at most, relative to what it may.
    fn left_open(&self, index: usize) -> f64 {
        let node = &self.nodes[index];
        if !node.found.is_seen {
            return 0.0;
        }
        // Surfaces go on at the border of what is seen, and what they would add cancels the end there.
        let pair = |axis: usize, side: usize| match self.linked(index, axis, side) {
            Some(other) => self.beside(index, axis, side, other, &[]),
            None => (Pair::NOTHING, node.look.steep[axis]),
        };
        let pairs = [[pair(0, 0), pair(0, 1)], [pair(1, 0), pair(1, 1)]];

        // Nothing of a cell is left where neighbours cancel both ends.
        let is_cancelled = pairs.each_ref().map(|sides| {
            let are_shared = sides.iter().all(|(_, is_shared)| *is_shared);
            node.found.is_hit() && are_shared
        });
        let mut most: f32 = 0.0;
        for axis in 0..2 {
            for (pair, is_shared) in pairs[axis] {
                let share = match (is_shared, is_cancelled[1 - axis]) {
                    (true, _) => pair.together,
                    (false, true) => pair.jump,
                    (false, false) => pair.apart,
                };
                most = most.max(pair.field * share.min(1.0));
            }
        }
        f64::from(most) * node.solid_angle
    }

    /// What a cell and what is beside it say of what is between them, and whether the end of the cell on that side is cancelled:
    /// by cells as large or smaller all along it, or by a larger one that is cancelled all along its side. With `ends`, those of
    /// all cells, linear ones only.
    fn beside(&self, index: usize, axis: usize, side: usize, other: usize, ends: &[Ends]) -> (Pair, bool) {
        let is_linear = |node: usize| ends.get(node).is_none_or(|ends| ends.is_linear);
        let pair = self.links[index][2 * axis + side].pair;
        if self.parts[other] != NONE {
            return match self.pair_along(other, axis, 1 - side) {
                pair if pair.is_alike && is_linear(index) && self.are_linear(other, axis, 1 - side, ends) => {
                    (pair, true)
                }
                _ => (pair, false),
            };
        }
        if !(pair.is_alike && is_linear(index) && is_linear(other)) {
            return (pair, false);
        }
        if self.nodes[other].place.level == self.nodes[index].place.level {
            return (pair, true);
        }
        let is_shared = self
            .linked(other, axis, 1 - side)
            .is_some_and(|whole| self.beside(other, axis, 1 - side, whole, ends).1);
        (pair, is_shared)
    }

    /// What all cells along a side of one, and the one beside that, say of what is between them.
    fn pair_along(&self, node: usize, axis: usize, side: usize) -> Pair {
        if self.parts[node] == NONE {
            return self.links[node][2 * axis + side].pair;
        }
        let [first, last] = self.halves(node, axis, side);
        self.pair_along(first, axis, side)
            .and(self.pair_along(last, axis, side))
    }

    /// Whether all cells along a side of one are linear.
    fn are_linear(&self, node: usize, axis: usize, side: usize, ends: &[Ends]) -> bool {
        if self.parts[node] == NONE {
            return ends.get(node).is_none_or(|ends| ends.is_linear);
        }
        let halves = self.halves(node, axis, side);
        halves.into_iter().all(|half| self.are_linear(half, axis, side, ends))
    }

    /// The cells along a side of one that has parts.
    fn along(&self, node: usize, axis: usize, side: usize, cells: &mut Vec<u32>) {
        if self.parts[node] == NONE {
            cells.push(node as u32);
            return;
        }
        for half in self.halves(node, axis, side) {
            self.along(half, axis, side, cells);
        }
    }

    /// The two parts of a cell on one of its sides.
    fn halves(&self, node: usize, axis: usize, side: usize) -> [usize; 2] {
        // u and v grow to the left and upwards: to smaller columns and rows.
        let first = self.parts[node] as usize + if side == 0 { 1 << axis } else { 0 };
        [first, first + (2 >> axis)]
    }

    /// What a cell and a neighbour along an axis say of what is between them.
    fn compare(&self, index: usize, beside: usize, axis: usize) -> Pair {
        let (node, other) = (&self.nodes[index], &self.nodes[beside]);
        // The other's slopes over a cell of this size, which is no larger.
        let scale = 1.0 / f64::from(1_u32 << (node.place.level - other.place.level));
        let slopes = [node.look.slope, other.look.slope.map(|slope| slope * scale)];

        // Field per solid angle; a stationary point between the two is not seen by either.
        let mut damped = [1.0; 2];
        for axis in 0..2 {
            let turns_round = slopes[0][axis] * slopes[1][axis] < 0.0;
            for (slopes, damped) in slopes.iter().zip(&mut damped) {
                *damped /= if turns_round { 1.0 } else { 1.0 + slopes[axis].abs() };
            }
        }
        let of = |look: &Look, damped: f64| look.amplitude * damped / look.tolerance;
        let field = of(&node.look, damped[0])
            .max(of(&other.look, damped[1]))
            .min(f64::from(f32::MAX));
        if !(node.found.is_hit() && other.found.is_hit()) {
            return Pair {
                field: field as f32,
                jump: 1.0,
                apart: 1.0,
                together: 1.0,
                is_alike: false,
            };
        }

        // Phase at the neighbour that neither the mean of both slopes nor the planes explain, over a cell of this size.
        let (here, there) = (&node.cell, &other.cell);
        let offset = [(there.u - here.u) / here.du, (there.v - here.v) / here.dv];
        let square = offset[0] * offset[0] + offset[1] * offset[1];
        let wavenumber = 2.0 * TAU / self.wavelength;
        let expected: f64 = (0..2).map(|i| (slopes[0][i] + slopes[1][i]) * offset[i]).sum();
        let from_slopes = wavenumber * (other.found.distance - node.found.distance) - expected;
        let between = other.look.point - node.look.point;
        let height = |node: &Node| (node.found.normal.dot(between) / node.look.advance).abs();
        let from_planes = wavenumber * height(node).max(height(other));
        let jump = from_slopes.abs().min(from_planes) / square;

        // What the slopes differ by. Where the cell has ends, that is so much less as these have slopes: of the cell, or in a
        // plane their own. Amplitudes of one material only differ smoothly.
        let is_plane = from_planes < PLANE;
        let steep = node.look.steep;
        let bend = |axis: usize| {
            let bend = (slopes[1][axis] - slopes[0][axis]).abs();
            let slope = slopes[0][axis].abs().min(slopes[1][axis].abs());
            match (steep[axis], is_plane) {
                (false, _) => bend,
                (true, false) => bend / slope.max(1.0),
                (true, true) => 2.0 * bend / (slope * slope).max(2.0),
            }
        };
        let (a, b) = (node.look.amplitude, other.look.amplitude);
        let step = 0.5 * (a - b).abs() / a.max(b).max(f64::MIN_POSITIVE);
        let is_one_body = node.found.body == other.found.body;
        let jump = jump + if is_one_body { 0.0 } else { step };

        let is_alike = is_one_body
            && steep[axis]
            && steep == other.look.steep
            && slopes[0][axis] * slopes[1][axis] > 0.0
            && jump < SMOOTH;
        let (explained, sag) = if steep == [false; 2] {
            (from_slopes.abs() / square, 0.0)
        } else {
            (jump, 0.25 * from_planes / square)
        };
        let apart = explained + sag + 0.25 * (bend(0) + bend(1)) / square.sqrt() + step;
        let together = jump + if is_plane { 0.0 } else { 0.25 * bend(axis) };
        Pair {
            field: field as f32,
            jump: jump as f32,
            apart: apart as f32,
            together: together as f32,
            is_alike,
        }
    }

    /// The cells that hit something and have no parts.
    pub fn leaves(&self) -> Vec<Leaf> {
        let nodes = 0..self.nodes.len();
        let ends: Vec<Ends> = nodes.into_par_iter().map(|node| self.ends(node)).collect();
        let leaves = self.nodes.par_iter().enumerate();
        leaves
            .filter(|(index, node)| self.parts[*index] == NONE && node.found.is_hit())
            .map(|(index, node)| Leaf {
                cell: node.cell,
                found: node.found,
                is_linear: ends[index].is_linear,
                has_ends: ends[index].has,
                kept: self.kept(index, &ends),
            })
            .collect()
    }

    /// Of which axes a cell has ends.
    fn ends(&self, index: usize) -> Ends {
        let node = &self.nodes[index];
        if self.parts[index] != NONE || !node.found.is_hit() || node.open > self.allowed {
            return Ends::default();
        }
        Ends {
            is_linear: self.end_points,
            has: node.look.steep,
        }
    }

    /// See [`Leaf::kept`].
    fn kept(&self, index: usize, ends: &[Ends]) -> u8 {
        let has_partner = |index, axis, side| self.partner(index, axis, side, ends) != Partner::None;
        let mut kept = 0;
        match ends[index].has {
            [false, false] => kept = 1,
            [true, true] => {
                for corner in 0..4 {
                    // A corner is shared with neighbours along both axes: those along u come first.
                    let (u, v) = (corner & 1, corner >> 1);
                    let along_v = || self.partner(index, 1, v, ends);
                    let is_cancelled = has_partner(index, 0, u)
                        || match along_v() {
                            Partner::None => false,
                            Partner::Border => true,
                            Partner::Cell(other) => self
                                .at_corner(index, other, u, v)
                                .is_none_or(|other| !has_partner(other, 0, u)),
                        };
                    kept |= u8::from(!is_cancelled) << corner;
                }
            }
            [is_along_u, _] => {
                let axis = usize::from(!is_along_u);
                for side in 0..2 {
                    kept |= u8::from(!has_partner(index, axis, side)) << side;
                }
            }
        }
        kept
    }

    /// What cancels the end of a cell on one side.
    fn partner(&self, index: usize, axis: usize, side: usize, ends: &[Ends]) -> Partner {
        match self.linked(index, axis, side) {
            None => Partner::Border,
            Some(other) if self.beside(index, axis, side, other, ends).1 => Partner::Cell(other),
            Some(_) => Partner::None,
        }
    }

    /// Of the cell beside one along v, or its parts, the one that has a corner where that one has; none where a larger one has
    /// its side there.
    fn at_corner(&self, index: usize, beside: usize, u: usize, v: usize) -> Option<usize> {
        let (place, other) = (&self.nodes[index].place, &self.nodes[beside].place);
        let last = (1 << (place.level - other.level)) - 1;
        if place.column & last != if u == 0 { last } else { 0 } {
            return None;
        }
        let mut node = beside;
        while self.parts[node] != NONE {
            // The first of two halves has the smaller column.
            node = self.halves(node, 1, 1 - v)[1 - u];
        }
        Some(node)
    }

    /// The cell of the same level on one side, or the finest one round that.
    fn neighbour(&self, node: usize, axis: usize, side: usize) -> Option<usize> {
        // u and v grow to the left and upwards: to smaller columns and rows.
        let Some(part) = node.checked_sub(self.roots.len()) else {
            let Place { row, column, .. } = self.nodes[node].place;
            let step = |x: u32| if side == 1 { x.checked_sub(1) } else { Some(x + 1) };
            let (row, column) = match axis {
                0 => (row, step(column)?),
                _ => (step(row)?, column),
            };
            return self.find(&Place { level: 0, row, column });
        };
        // The other half of the same cell, or that half of its neighbour which is next to this one.
        let half = 1 << axis;
        if (part & half == 0) == (side == 0) {
            return Some(self.roots.len() + (part ^ half));
        }
        let whole = self.wholes[part / 4] as usize;
        let beside = self.neighbour(whole, axis, side)?;
        let is_as_fine = self.nodes[beside].place.level == self.nodes[whole].place.level;
        match self.parts[beside] {
            parts if parts != NONE && is_as_fine => Some(parts as usize + ((part % 4) ^ half)),
            _ => Some(beside),
        }
    }
}

/// A long box in pieces about as long as it is wide: the frame of the image may lie across it.
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

/// Where the bundles of cells in their order end: cells of one lie within a square of the image.
fn bundles(cells: &[Place]) -> Vec<usize> {
    let mut ends = Vec::with_capacity(cells.len() / MOST_RAYS + 1);
    let mut first = 0;
    for (index, cell) in cells.iter().enumerate() {
        let apart = cell.order() ^ cells[first].order();
        let finer = (MAX_LEVEL as u32 - u32::from(cell.level)) + BUNDLE;
        if index - first == MOST_RAYS || apart >> (2 * finer) != 0 {
            ends.push(index);
            first = index;
        }
    }
    if !cells.is_empty() {
        ends.push(cells.len());
    }
    ends
}

/// The part of the image plane at a place.
fn cell(planes: &[ImagePlane], place: &Place) -> Cell {
    planes[place.level as usize].cell(place.row as usize, place.column as usize)
}

impl Rule<'_> {
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
    fn base_cells(&self) -> Vec<Place> {
        let (rows, columns) = (self.base.rows as u32, self.base.columns as u32);
        let place = |row, column| Place { level: 0, row, column };
        let mut cells: Vec<Place> = (0..rows).flat_map(|i| (0..columns).map(move |j| place(i, j))).collect();
        cells.sort_unstable_by_key(|cell| morton(cell.row, cell.column));
        cells
    }

    /// Field per solid angle that a target of the smallest cross-section of interest has at a distance [sr].
    fn field(&self, distance: f64, wavelength: f64) -> f64 {
        wavelength * (self.rcs_floor / (4.0 * PI)).sqrt() / (distance * distance)
    }
}

impl Judge<'_> {
    /// What a cell adds to the sum.
    fn look(&self, cell: &Cell, found: &Found) -> Look {
        let direction = cell.direction();
        let cosine = -found.normal.dot(direction);
        if !found.is_hit() || cosine <= 0.0 || found.distance <= 0.0 {
            return Look::NOTHING;
        }
        let polarization = self.array.polarization;
        let seen = polarization.map_or(Seen::SCALAR, |e| Seen::by(e, found.normal, direction, direction));
        let response = self.materials[found.body as usize].response(cosine, self.wavelength, seen);
        let wavenumber = TAU / self.wavelength;
        let edges = cell.edges(found.distance, found.normal);
        let slope = edges.map(|edge| wavenumber * edge.dot(direction));
        let mut least = slope.map(f64::abs);
        for channel in 0..self.array.num_channels() {
            let [t, r] = self.array.directions(channel, found.distance * direction);
            let bisector = 0.5 * wavenumber * (t + r);
            for axis in 0..2 {
                least[axis] = least[axis].min(bisector.dot(edges[axis]) * slope[axis].signum());
            }
        }
        Look {
            amplitude: response.reflection.norm() * self.array.relative_gain(cell.u, cell.v),
            slope,
            steep: least.map(|least| self.rule.end_points && least > STEEP),
            tolerance: SHARE * self.rule.field(found.distance, self.wavelength),
            point: found.distance * direction,
            advance: -cosine,
        }
    }

    /// Bodies, and parts of their meshes, that have the smallest cross-section of interest and may be missed by the base grid.
    fn targets(&self) -> Vec<Target> {
        let bodies = 0..self.snapshot.num_bodies() as u32;
        let parts = bodies.flat_map(|body| {
            let pose = self.snapshot.pose(body);
            let parts = self.snapshot.surface(body).parts();
            let most = if parts.len() > FEW_PARTS { 1.0 } else { MOST_PIECES };
            parts.iter().flat_map(move |part| {
                let pieces = pieces(part, most);
                let number = pieces.len() as f64;
                let corners = move |piece: Bounds| piece.corners().map(|corner| pose.point(corner));
                pieces
                    .into_iter()
                    .filter_map(move |piece| self.target(&corners(piece), number))
            })
        });
        let base = &self.rule.base;
        let is_small = |target: &Target| target.width[0] < base.du || target.width[1] < base.dv;
        parts.filter(is_small).collect()
    }

    /// A box in the sensor frame, one of a number of pieces.
    fn target(&self, corners: &[DVec3; 8], pieces: f64) -> Option<Target> {
        // What reaches behind the sensor is near, and large.
        if corners.iter().any(|corner| corner.x <= 0.0) {
            return None;
        }
        let range = |axis: usize| {
            let (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
            let ratios = corners.iter().map(|corner| corner[axis] / corner.x);
            let (low, high) = ratios.fold((low, high), |(low, high), x| (low.min(x), high.max(x)));
            [low, high]
        };
        let (u, v) = (range(1), range(2));
        let distance = corners
            .iter()
            .map(|corner| corner.length())
            .fold(f64::INFINITY, f64::min);
        let is_bright = pieces * (u[1] - u[0]) * (v[1] - v[0]) >= self.rule.field(distance, self.wavelength);
        let width = [u, v].map(|[low, high]| (high - low) / CELLS_ACROSS);
        is_bright.then_some(Target { u, v, width })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use num_complex::Complex64;

    use super::*;
    use crate::antennas::pattern::Pattern;
    use crate::geometry::pose::Pose;
    use crate::rays::surface::{ShadingMode, Surface};
    use crate::scattering::material::Response;

    fn plate(half: [f64; 2]) -> Arc<Surface> {
        let corner = |y: f64, z: f64| DVec3::new(0.0, y * half[0], z * half[1]);
        let vertices = [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ];
        Arc::new(Surface::new(&vertices, &[[0, 2, 1], [0, 3, 2]], ShadingMode::Flat).unwrap())
    }

    fn at(x: f64, y: f64, z: f64, yaw: f64) -> Pose {
        Pose {
            rotation: glam::DMat3::from_rotation_z(yaw),
            translation: DVec3::new(x, y, z),
        }
    }

    const ISOTROPIC: Pattern = Pattern::Gaussian {
        peak: 1.0,
        azimuth: 0.0,
        elevation: 0.0,
    };

    fn array() -> Array {
        Array {
            tx: vec![DVec3::ZERO],
            rx: vec![DVec3::ZERO],
            tx_patterns: vec![ISOTROPIC],
            rx_patterns: vec![ISOTROPIC],
            power: 1.0,
            frequency: 60e9,
            polarization: None,
        }
    }

    const BASE: ImagePlane = ImagePlane::centered(33, 40, 0.5, 0.6);
    const RULE: Rule<'static> = Rule {
        beam: None,
        base: BASE,
        rcs_floor: 1e-6,
        budget: None,
        end_points: true,
    };

    fn grow(scene: &Snapshot, rule: &Rule, previous: Option<(&Quadtree, &Tree)>) -> Quadtree {
        let conductor = Material::Constant(Response {
            reflection: Complex64::from(-1.0),
            albedo: 0.0,
        });
        let materials = vec![conductor; scene.num_bodies()];
        Quadtree::grow(scene, &Cast::default(), &materials, &array(), rule, previous).unwrap()
    }

    /// A wall and two plates, of which one is shifted.
    fn scene(shift: f64) -> Snapshot {
        scene_of(&[plate([2.0, 2.0]), plate([0.1, 0.2]), plate([0.15, 0.1])], shift)
    }

    fn scene_of(surfaces: &[Arc<Surface>], shift: f64) -> Snapshot {
        let poses = vec![
            at(3.0, 0.0, 0.0, 0.6),
            at(1.5, -0.4, 0.2, 0.1),
            at(1.2, 0.3 + shift, -0.1, -0.2),
        ];
        Snapshot::new(surfaces.to_vec(), poses)
    }

    #[test]
    fn cells_that_were_not_split_cover_the_image_once() {
        let tree = grow(&scene(0.0), &RULE, None);
        let finest = 1_usize << MAX_LEVEL;
        let (rows, columns) = (BASE.rows * finest, BASE.columns * finest);
        let mut covered = vec![false; rows * columns];
        for (node, _) in tree.nodes.iter().zip(&tree.parts).filter(|(_, parts)| **parts == NONE) {
            let side = finest >> node.place.level;
            let (row, column) = (node.place.row as usize * side, node.place.column as usize * side);
            for row in row..row + side {
                let cells = &mut covered[row * columns + column..row * columns + column + side];
                assert!(cells.iter().all(|cell| !cell));
                cells.fill(true);
            }
        }
        assert!(covered.into_iter().all(|cell| cell));
    }

    #[test]
    fn what_is_found_does_not_depend_on_threads_nor_on_what_is_known() {
        let alike = |a: &Quadtree, b: &Quadtree| {
            assert_eq!(a.parts, b.parts);
            for (a, b) in a.nodes.iter().zip(&b.nodes) {
                assert_eq!((a.place, a.found, a.open), (b.place, b.found, b.open));
            }
        };
        let surfaces = [plate([2.0, 2.0]), plate([0.1, 0.2]), plate([0.15, 0.1])];
        let (before, now) = (scene_of(&surfaces, 0.0), scene_of(&surfaces, 0.01));
        let fresh = grow(&now, &RULE, None);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        alike(&fresh, &pool.install(|| grow(&now, &RULE, None)));

        let old = grow(&before, &RULE, None);
        let moved = now.moved(&before).unwrap();
        let again = grow(&now, &RULE, Some((&old, &moved)));
        alike(&fresh, &again);
        assert!(again.counts.tiles_reused > 50 && again.counts.rays < fresh.counts.rays);
    }

    #[test]
    fn a_small_target_between_the_rays_of_the_base_grid_is_found() {
        // 6 mm at 2 m, where cells are 60 mm wide.
        let (y, z) = (2.0 * 4.0 * BASE.du, 2.0 * 3.0 * BASE.dv + 0.5 * 2.0 * BASE.dv);
        let scene = Snapshot::new(vec![plate([3e-3, 3e-3])], vec![at(2.0, y, z, 0.0)]);
        let leaves = grow(&scene, &RULE, None).leaves();
        let area: f64 = leaves.iter().map(|leaf| leaf.cell.du * leaf.cell.dv * 4.0).sum();
        assert!((area / 36e-6 - 1.0).abs() < 0.3, "{area}");
        // One that is less than asked for is not looked for.
        let dim = Rule {
            rcs_floor: 10.0,
            ..RULE
        };
        assert!(grow(&scene, &dim, None).leaves().is_empty());
    }

    #[test]
    fn a_thin_tilted_strip_is_found_all_along() {
        // 8 mm x 1 m at 2 m, where cells are 60 mm wide, rolled by 33 and 45 degrees.
        for roll in [0.6, 0.25 * PI] {
            let mut pose = at(2.0, 0.013, 0.007, 0.0);
            pose.rotation = glam::DMat3::from_rotation_x(roll);
            let scene = Snapshot::new(vec![plate([0.5, 4e-3])], vec![pose]);
            let leaves = grow(&scene, &RULE, None).leaves();
            let area: f64 = leaves.iter().map(|leaf| leaf.cell.du * leaf.cell.dv * 4.0).sum();
            assert!((area / 8e-3 - 1.0).abs() < 0.1, "{roll} {area}");
        }
    }

    #[test]
    fn a_budget_is_kept_and_cells_leave_as_little_open_as_it_pays_for() {
        let needed = grow(&scene(0.0), &RULE, None).nodes.len();
        let mut last = f64::INFINITY;
        for budget in [needed / 8, needed / 2, 2 * needed] {
            let rule = Rule {
                budget: Some(budget),
                ..RULE
            };
            let tree = grow(&scene(0.0), &rule, None);
            assert!(tree.counts.rays <= budget);
            assert!(
                tree.nodes.len() >= (budget / 2).min(needed) && tree.nodes.len() <= needed,
                "{} of {budget}, {needed}",
                tree.nodes.len()
            );
            let could_be = (0..tree.nodes.len()).filter(|node| tree.could_be_split(*node));
            let open = could_be.map(|node| tree.nodes[node].open).fold(0.0, f64::max);
            assert!(open <= tree.allowed && tree.allowed < last);
            last = tree.allowed;
        }
        assert_eq!(last, 1.0);
    }

    #[test]
    fn links_are_those_of_the_neighbours_in_the_end() {
        // Steps are taken back where there is a budget.
        let needed = grow(&scene(0.0), &RULE, None).nodes.len();
        for budget in [None, Some(needed / 2)] {
            let tree = grow(&scene(0.0), &Rule { budget, ..RULE }, None);
            let mut num_finer = 0;
            for index in (0..tree.nodes.len()).filter(|index| tree.parts[*index] == NONE) {
                for (link, (axis, side)) in tree.links[index].iter().zip(SIDES) {
                    let other = tree.neighbour(index, axis, side);
                    assert_eq!(link.other, other.map_or(NONE, |other| other as u32));
                    if let Some(other) = other {
                        assert_eq!(link.pair, tree.compare(index, other, axis));
                        num_finer += usize::from(tree.nodes[other].place.level < tree.nodes[index].place.level);
                    }
                }
            }
            assert!(num_finer > 100);
        }
    }

    #[test]
    fn the_inside_of_an_oblique_wall_is_neither_split_nor_summed() {
        let wall = Snapshot::new(vec![plate([9.0, 9.0])], vec![at(3.0, 0.0, 0.0, 0.9)]);
        let tree = grow(&wall, &RULE, None);
        assert_eq!(tree.nodes.len(), BASE.num_pixels());
        assert!(tree.leaves().iter().all(|leaf| leaf.kept == 0));
        // Without ends every cell has to be fine enough for its centre to stand for it.
        let centres = Rule {
            end_points: false,
            ..RULE
        };
        assert!(grow(&wall, &centres, None).nodes.len() > 10 * BASE.num_pixels());
    }

    #[test]
    fn ends_of_all_cells_add_up_to_those_that_are_kept() {
        // The field of a plate by all ends of its linear cells, and by those that no neighbour cancels.
        let scene = scene(0.0);
        let tree = grow(&scene, &RULE, None);
        let (mut all, mut kept, mut size) = (Complex64::ZERO, Complex64::ZERO, 0.0);
        for leaf in tree.leaves().iter().filter(|leaf| leaf.has_ends == [true, false]) {
            let cell = leaf.cell;
            let edges = cell.edges(leaf.found.distance, leaf.found.normal);
            let wavenumber = TAU * 60e9 / SPEED_OF_LIGHT;
            for side in 0..2_u8 {
                let there = cell.about([f64::from(side) - 0.5, 0.0]);
                let distance = leaf.found.distance * leaf.found.normal.dot(cell.direction())
                    / leaf.found.normal.dot(there.direction());
                let slope = wavenumber * there.edges(distance, leaf.found.normal)[0].dot(there.direction());
                let across = wavenumber * edges[1].dot(cell.direction());
                let end = Complex64::cis(-2.0 * wavenumber * distance)
                    * (f64::from(side) - 0.5)
                    * (there.solid_angle() / slope * across.sin() / across);
                all += end;
                size += end.norm();
                if leaf.kept >> side & 1 == 1 {
                    kept += end;
                }
            }
        }
        let tolerance = SHARE * RULE.field(2.0, SPEED_OF_LIGHT / 60e9);
        assert!((all - kept).norm() < 1e-4 * size, "{all} {kept} {size}");
        assert!(size > 1000.0 * tolerance, "{size} {tolerance}");
    }
}
