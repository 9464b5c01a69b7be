//! Pair errors of neighbouring cells.

use std::f64::consts::TAU;

use super::cells::{CellEcho, EdgeTerms, NONE, Node, PLANE, PairError, Quadtree, SMOOTH};

impl Quadtree {
    /// Bound on the residual error of a cell, relative to the allowed one.
    pub(super) fn residual_error(&self, index: usize) -> f64 {
        let node = &self.nodes[index];
        if !node.found.is_seen {
            return 0.0;
        }
        // Surfaces go on at the border of what is seen, and what they would add cancels the end there.
        let pair = |axis: usize, side: usize| match self.linked(index, axis, side) {
            Some(other) => self.beside(index, axis, side, other, &[]),
            None => (PairError::NOTHING, node.echo.steep[axis]),
        };
        let pairs = [[pair(0, 0), pair(0, 1)], [pair(1, 0), pair(1, 1)]];

        // Nothing of a cell is left where neighbours cancel both edge terms.
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

    /// Pair error of a cell and the neighbour on one side, and true if the edge term of the cell on that side is
    /// cancelled: by cells as large or smaller all along it, or by a larger one that is cancelled all along its side.
    /// With `edge_terms`, those of all cells, linear ones only.
    pub(super) fn beside(
        &self,
        index: usize,
        axis: usize,
        side: usize,
        other: usize,
        edge_terms: &[EdgeTerms],
    ) -> (PairError, bool) {
        let is_linear = |node: usize| edge_terms.get(node).is_none_or(|edge_terms| edge_terms.is_linear);
        let pair = self.links[index][2 * axis + side].pair;
        if self.parts[other] != NONE {
            return match self.pair_along(other, axis, 1 - side) {
                pair if pair.is_alike && is_linear(index) && self.are_linear(other, axis, 1 - side, edge_terms) => {
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
            .is_some_and(|whole| self.beside(other, axis, 1 - side, whole, edge_terms).1);
        (pair, is_shared)
    }

    /// Pair errors of all cells along a side of one with the neighbour on that side.
    pub(super) fn pair_along(&self, node: usize, axis: usize, side: usize) -> PairError {
        if self.parts[node] == NONE {
            return self.links[node][2 * axis + side].pair;
        }
        let [first, last] = self.halves(node, axis, side);
        self.pair_along(first, axis, side)
            .and(self.pair_along(last, axis, side))
    }

    /// True if all cells along a side of one are linear.
    pub(super) fn are_linear(&self, node: usize, axis: usize, side: usize, edge_terms: &[EdgeTerms]) -> bool {
        if self.parts[node] == NONE {
            return edge_terms.get(node).is_none_or(|edge_terms| edge_terms.is_linear);
        }
        let halves = self.halves(node, axis, side);
        halves
            .into_iter()
            .all(|half| self.are_linear(half, axis, side, edge_terms))
    }

    /// The cells along a side of one that has parts.
    pub(super) fn along(&self, node: usize, axis: usize, side: usize, cells: &mut Vec<u32>) {
        if self.parts[node] == NONE {
            cells.push(node as u32);
            return;
        }
        for half in self.halves(node, axis, side) {
            self.along(half, axis, side, cells);
        }
    }

    /// The two parts of a cell on one of its sides.
    pub(super) fn halves(&self, node: usize, axis: usize, side: usize) -> [usize; 2] {
        // u and v grow to the left and upwards: to smaller columns and rows.
        let first = self.parts[node] as usize + if side == 0 { 1 << axis } else { 0 };
        [first, first + (2 >> axis)]
    }

    /// Pair error of a cell and a neighbour along an axis.
    pub(super) fn compare(&self, index: usize, beside: usize, axis: usize) -> PairError {
        let (node, other) = (&self.nodes[index], &self.nodes[beside]);
        // The other's slopes over a cell of this size, which is no larger.
        let scale = 1.0 / f64::from(1_u32 << (node.place.level - other.place.level));
        let slopes = [node.echo.slope, other.echo.slope.map(|slope| slope * scale)];

        // Field per solid angle; a stationary point between the two is not seen by either.
        let mut damped = [1.0; 2];
        for axis in 0..2 {
            let turns_round = slopes[0][axis] * slopes[1][axis] < 0.0;
            for (slopes, damped) in slopes.iter().zip(&mut damped) {
                *damped /= if turns_round { 1.0 } else { 1.0 + slopes[axis].abs() };
            }
        }
        let of = |echo: &CellEcho, damped: f64| echo.amplitude * damped / echo.tolerance;
        let field = of(&node.echo, damped[0])
            .max(of(&other.echo, damped[1]))
            .min(f64::from(f32::MAX));
        if !(node.found.is_hit() && other.found.is_hit()) {
            return PairError {
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
        let between = other.echo.point - node.echo.point;
        let height = |node: &Node| (node.found.normal.dot(between) / node.echo.advance).abs();
        let from_planes = wavenumber * height(node).max(height(other));
        let jump = from_slopes.abs().min(from_planes) / square;

        // The difference of the slopes. Where the cell has edge terms, that is less by their slopes: of the
        // cell, or in a plane their own. Amplitudes of one material only differ smoothly.
        let is_plane = from_planes < PLANE;
        let steep = node.echo.steep;
        let bend = |axis: usize| {
            let bend = (slopes[1][axis] - slopes[0][axis]).abs();
            let slope = slopes[0][axis].abs().min(slopes[1][axis].abs());
            match (steep[axis], is_plane) {
                (false, _) => bend,
                (true, false) => bend / slope.max(1.0),
                (true, true) => 2.0 * bend / (slope * slope).max(2.0),
            }
        };
        let (a, b) = (node.echo.amplitude, other.echo.amplitude);
        let step = 0.5 * (a - b).abs() / a.max(b).max(f64::MIN_POSITIVE);
        let is_one_body = node.found.body == other.found.body;
        let jump = jump + if is_one_body { 0.0 } else { step };

        let is_alike = is_one_body
            && steep[axis]
            && steep == other.echo.steep
            && slopes[0][axis] * slopes[1][axis] > 0.0
            && jump < SMOOTH;
        let (explained, sag) = if steep == [false; 2] {
            (from_slopes.abs() / square, 0.0)
        } else {
            (jump, 0.25 * from_planes / square)
        };
        let apart = explained + sag + 0.25 * (bend(0) + bend(1)) / square.sqrt() + step;
        let together = jump + if is_plane { 0.0 } else { 0.25 * bend(axis) };
        PairError {
            field: field as f32,
            jump: jump as f32,
            apart: apart as f32,
            together: together as f32,
            is_alike,
        }
    }
}
