//! Edge terms of cells, and their cancellation between neighbours.

use rayon::prelude::*;

use super::cells::{EdgeTerms, Leaf, NONE, Partner, Place, Quadtree};

impl Quadtree {
    /// The cells that hit something and have no parts.
    pub fn leaves(&self) -> Vec<Leaf> {
        let nodes = 0..self.nodes.len();
        let edge_terms: Vec<EdgeTerms> = nodes.into_par_iter().map(|node| self.edge_terms(node)).collect();
        let leaves = self.nodes.par_iter().enumerate();
        leaves
            .filter(|(index, node)| self.parts[*index] == NONE && node.found.is_hit())
            .map(|(index, node)| Leaf {
                cell: node.cell,
                found: node.found,
                is_linear: edge_terms[index].is_linear,
                has_edge_terms: edge_terms[index].has,
                kept: self.kept(index, &edge_terms),
            })
            .collect()
    }

    /// Axes along which a cell has edge terms.
    pub(super) fn edge_terms(&self, index: usize) -> EdgeTerms {
        let node = &self.nodes[index];
        if self.parts[index] != NONE || !node.found.is_hit() || node.residual > self.allowed {
            return EdgeTerms::default();
        }
        EdgeTerms {
            is_linear: self.end_points,
            has: node.echo.steep,
        }
    }

    /// See [`Leaf::kept`].
    pub(super) fn kept(&self, index: usize, edge_terms: &[EdgeTerms]) -> u8 {
        let has_partner = |index, axis, side| self.partner(index, axis, side, edge_terms) != Partner::None;
        let mut kept = 0;
        match edge_terms[index].has {
            [false, false] => kept = 1,
            [true, true] => {
                for corner in 0..4 {
                    // A corner is shared with neighbours along both axes: those along u come first.
                    let (u, v) = (corner & 1, corner >> 1);
                    let along_v = || self.partner(index, 1, v, edge_terms);
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

    /// Partner that cancels the edge term of a cell on one side.
    pub(super) fn partner(&self, index: usize, axis: usize, side: usize, edge_terms: &[EdgeTerms]) -> Partner {
        match self.linked(index, axis, side) {
            None => Partner::Border,
            Some(other) if self.beside(index, axis, side, other, edge_terms).1 => Partner::Cell(other),
            Some(_) => Partner::None,
        }
    }

    /// Cell beside one along v, or the part of it, that shares a corner with the cell; none where a larger
    /// one has its side there.
    pub(super) fn at_corner(&self, index: usize, beside: usize, u: usize, v: usize) -> Option<usize> {
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
    pub(super) fn neighbour(&self, node: usize, axis: usize, side: usize) -> Option<usize> {
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
