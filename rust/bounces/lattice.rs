//! Lattices of points of a triangle that are illuminated or in shadow.

use glam::DVec3;

/// Part of a triangle that is illuminated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Illumination {
    /// All of it.
    Full,
    /// Some of its points.
    Partial,
    /// None of its points.
    None,
}

/// Lattice of points of a triangle, `side` steps along every side.
pub(super) struct ShadowLattice {
    side: i32,
    /// True for points that are illuminated, row by row.
    points: Vec<bool>,
}

impl ShadowLattice {
    pub(super) fn new(side: i32, is_seen: impl Fn(DVec3) -> bool) -> Self {
        let mut lattice = Self {
            side,
            points: Vec::new(),
        };
        for row in 0..=side {
            for column in 0..=side - row {
                let seen = is_seen(lattice.weights([column, row]));
                lattice.points.push(seen);
            }
        }
        lattice
    }

    /// Barycentric weights of a point.
    pub(super) fn weights(&self, [column, row]: [i32; 2]) -> DVec3 {
        let [second, third] = [column, row].map(|steps| f64::from(steps) / f64::from(self.side));
        DVec3::new(1.0 - second - third, second, third)
    }

    pub(super) fn at(&self, [column, row]: [i32; 2]) -> bool {
        // Rows of side + 1, side, ... points.
        self.points[(row * (self.side + 1) - row * (row - 1) / 2 + column) as usize]
    }

    /// Part of the points of a triangle that are illuminated; `side`: its steps.
    pub(super) fn seen(&self, [a, b, c]: [[i32; 2]; 3], side: i32) -> Illumination {
        let step = |from: i32, to: i32| (to - from) / side;
        let [along, across] = [b, c].map(|end| [step(a[0], end[0]), step(a[1], end[1])]);
        let (mut all, mut any) = (true, false);
        for i in 0..=side {
            for j in 0..=side - i {
                let at = [0, 1].map(|axis| a[axis] + i * along[axis] + j * across[axis]);
                let seen = self.at(at);
                all &= seen;
                any |= seen;
            }
        }
        match (all, any) {
            (true, _) => Illumination::Full,
            (_, true) => Illumination::Partial,
            _ => Illumination::None,
        }
    }
}
