//! Refinement: cells are split until their residual error is small enough.

use std::collections::HashMap;

use rayon::prelude::*;

use super::cells::{FIRST_STEP, LAST_STEP, Link, NONE, Node, Place, Quadtree, SIDES, base_cells};
use super::criterion::{Criterion, cell, groups};
use crate::antennas::array::Array;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result, fits_memory};
use crate::rays::batch::{Found, Known};
use crate::rays::camera::Cell;
use crate::rays::hits::{Cast, Counts};
use crate::rays::scene::PosedScene;
use crate::rays::tree::Tree;
use crate::scattering::material::Material;
use crate::scattering::mesh_parts::MeshPart;
use crate::scattering::refinement::{MAX_LEVEL, Refinement};

impl Quadtree {
    /// Split cells until they are fine enough. `previous`: at another time, and boxes where bodies have moved since.
    pub fn grow(
        scene: &PosedScene,
        cast: &Cast,
        materials: &[Material],
        array: &Array,
        refinement: &Refinement,
        previous: Option<(&Self, &Tree)>,
    ) -> Result<Self> {
        let criterion = Criterion {
            scene,
            materials,
            array,
            refinement,
            wavelength: SPEED_OF_LIGHT / array.frequency,
        };
        let previous =
            previous.filter(|(tree, _)| tree.planes[0] == refinement.base && tree.beam.as_ref() == refinement.beam);
        let mut tree = Self {
            planes: (0..=MAX_LEVEL)
                .map(|level| refinement.base.divided(1 << level))
                .collect(),
            roots: vec![NONE; refinement.base.num_pixels()],
            nodes: Vec::new(),
            parts: Vec::new(),
            wholes: Vec::new(),
            links: Vec::new(),
            spare: HashMap::new(),
            num_cast: 0,
            counts: Counts::default(),
            num_coarse: 0,
            allowed: 1.0,
            beam: refinement.beam.cloned(),
            wavelength: criterion.wavelength,
            end_points: refinement.end_points,
        };
        let add = |tree: &mut Self, cells: Vec<Place>| tree.add(&criterion, cast, previous, &cells);

        // The base grid.
        let cells = base_cells(refinement);
        for (node, cell) in cells.iter().enumerate() {
            tree.roots[cell.row as usize * refinement.base.columns + cell.column as usize] = node as u32;
        }
        add(&mut tree, cells)?;

        // Parts of meshes that it may have missed.
        let targets = criterion.targets();
        for level in 0..MAX_LEVEL {
            let mut split = tree.cells_on(&targets, level);
            split.truncate(refinement.budget.map_or(usize::MAX, |budget| tree.affordable(budget)));
            let cells = tree.split(&mut split);
            add(&mut tree, cells)?;
        }

        // Cells with too large a residual error, of a smaller and smaller target, as far as the budget goes.
        let all: Vec<u32> = (0..tree.nodes.len() as u32).collect();
        tree.link(&all);
        tree.measure(&all);
        tree.raise(&all);
        tree.allowed = tree.nodes.iter().map(|node| node.residual).fold(1.0, f64::max);
        let (mut step, most) = (FIRST_STEP, refinement.budget.unwrap_or(usize::MAX));
        while tree.allowed > 1.0 && step >= LAST_STEP {
            let before = tree.allowed;
            tree.allowed = (before / step).max(1.0);
            let residual: Vec<f64> = tree.nodes.iter().map(|node| node.residual).collect();
            if !tree.refine(most, add)? {
                tree.go_back(&residual);
                tree.allowed = before;
                step = step.sqrt();
            }
        }
        tree.spare = HashMap::new();
        tree.num_coarse = (0..tree.nodes.len()).filter(|node| tree.could_be_split(*node)).count();
        Ok(tree)
    }

    /// Split cells until no residual error exceeds the allowed one, unless that takes more rays than some number.
    pub(super) fn refine(
        &mut self,
        most: usize,
        mut add: impl FnMut(&mut Self, Vec<Place>) -> Result<()>,
    ) -> Result<bool> {
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

    /// Remove the last cells, and restore the residual errors of the others.
    pub(super) fn go_back(&mut self, residual: &[f64]) {
        let number = residual.len();
        self.spare
            .extend(self.nodes.drain(number..).map(|node| (node.place, node.found)));
        self.wholes.truncate((number - self.roots.len()) / 4);
        self.parts.truncate(number);
        self.links.truncate(number);
        let mut changed = Vec::new();
        for (node, residual) in residual.iter().enumerate() {
            self.nodes[node].residual = *residual;
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
    pub(super) fn link(&mut self, nodes: &[u32]) {
        let links: Vec<[Link; 4]> = nodes.par_iter().map(|node| self.links_of(*node as usize)).collect();
        for (node, links) in nodes.iter().zip(links) {
            self.links[*node as usize] = links;
        }
    }

    /// The links of a cell, those anew that are not up to date.
    pub(super) fn links_of(&self, index: usize) -> [Link; 4] {
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

    /// Link to the neighbour on one side of a cell, if there is one.
    pub(super) fn linked(&self, index: usize, axis: usize, side: usize) -> Option<usize> {
        let other = self.links[index][2 * axis + side].other as usize;
        let node = self.nodes.get(other)?;
        node.found.is_seen.then_some(other)
    }

    /// Neighbours of cells that were split: they may have lost what cancels their edge terms.
    pub(super) fn beside_all(&self, nodes: &[u32], cells: &mut Vec<u32>) {
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

    /// Update the residual errors of cells.
    pub(super) fn measure(&mut self, nodes: &[u32]) {
        let residual_error = |node: &u32| {
            let node = *node as usize;
            if self.parts[node] == NONE {
                self.residual_error(node)
            } else {
                0.0
            }
        };
        let residual: Vec<f64> = nodes.par_iter().map(residual_error).collect();
        for (node, residual) in nodes.iter().zip(residual) {
            self.nodes[*node as usize].residual = residual;
        }
    }

    /// Some cells and the coarser ones beside them, in their order.
    pub(super) fn with_coarser(&self, nodes: &[u32]) -> Vec<u32> {
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

    /// Raise the residual errors of cells by those of finer neighbours: what a fine cell at the border sees is
    /// not what the ray in the middle of a coarse one does.
    pub(super) fn raise(&mut self, nodes: &[u32]) {
        let raised: Vec<f64> = nodes.par_iter().map(|node| self.raised(*node as usize)).collect();
        for (node, raised) in nodes.iter().zip(raised) {
            let residual = &mut self.nodes[*node as usize].residual;
            *residual = residual.max(raised);
        }
    }

    /// Residual error of a cell by the finer cells beside it.
    pub(super) fn raised(&self, index: usize) -> f64 {
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
                .filter(|node| self.nodes[*node].residual > 1.0)
            {
                let pair = self.links[node][2 * axis + 1 - side].pair;
                let residual = if is_shared { pair.together } else { pair.apart };
                most = most.max(f64::from(pair.field * residual.min(1.0)) * self.nodes[node].solid_angle);
            }
        }
        if most > 1.0 { most } else { 0.0 }
    }

    /// True if the residual error of a cell is too large and the cell can be split.
    pub(super) fn is_open(&self, node: u32) -> bool {
        let node = node as usize;
        self.nodes[node].residual > self.allowed && self.could_be_split(node)
    }

    /// True if a cell has no parts and can be split.
    pub(super) fn could_be_split(&self, node: usize) -> bool {
        self.parts[node] == NONE && usize::from(self.nodes[node].place.level) < MAX_LEVEL
    }

    /// Cast the rays of new cells.
    pub(super) fn add(
        &mut self,
        criterion: &Criterion,
        cast: &Cast,
        previous: Option<(&Self, &Tree)>,
        cells: &[Place],
    ) -> Result<()> {
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
        let (found, counts) = criterion.scene.cast_batch(&points, &groups(&new), cast, known.as_ref());
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
                echo: criterion.echo(&cell, &found),
                found,
                residual: 0.0,
            }
        };
        self.parts.resize(number, NONE);
        self.links.resize(number, [Link::NONE; 4]);
        self.nodes.par_extend(cells.par_iter().zip_eq(found).map(node));
        Ok(())
    }

    /// The places of the four parts of every cell, those near each other one after the other; they will be the next
    /// nodes.
    pub(super) fn split(&mut self, nodes: &mut [u32]) -> Vec<Place> {
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
    pub(super) fn find(&self, cell: &Place) -> Option<usize> {
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
    pub(super) fn cells_on(&self, targets: &[MeshPart], level: usize) -> Vec<u32> {
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

    /// Number of cells that can be split within a budget.
    pub(super) fn affordable(&self, budget: usize) -> usize {
        budget.saturating_sub(self.num_cast) / 4
    }
}
