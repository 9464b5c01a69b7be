//! Beam of an array: directions outside of it are not cast.
//!
//! Rays start at the centre of the array, but every antenna sees a hit from its own position: the nearer the hit, the
//! more its direction differs.

use glam::DVec3;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;

/// Directions in which any pair of antennas has a gain of interest.
#[derive(Clone, Debug, PartialEq)]
pub struct Beam {
    /// Distinct patterns of the transmitters and of the receivers.
    patterns: [Vec<Pattern>; 2],
    /// Box round the antennas [m].
    low: DVec3,
    high: DVec3,
    /// Natural logarithm of the peak over the least two-way gain of interest.
    depth: f64,
    /// Upper bound of 1 / distance of bodies in front of the antennas [1/m].
    closeness: f64,
}

impl Beam {
    /// Beam of an array; `floor` is the least two-way gain of interest, relative to the product of a pair's peaks.
    pub fn new(array: &Array, floor: f64) -> Self {
        let once = |patterns: &[Pattern]| {
            patterns.iter().fold(Vec::new(), |mut seen: Vec<Pattern>, pattern| {
                if !seen.contains(pattern) {
                    seen.push(pattern.clone());
                }
                seen
            })
        };
        let places = || array.tx.iter().chain(&array.rx).copied();
        Self {
            patterns: [once(&array.tx_patterns), once(&array.rx_patterns)],
            low: places().fold(DVec3::INFINITY, DVec3::min),
            high: places().fold(DVec3::NEG_INFINITY, DVec3::max),
            depth: -floor.ln(),
            closeness: 0.0,
        }
    }

    /// Beam for bodies with the nearest at a distance [m]; none if all directions `(1, u, v)` within ranges are
    /// in it.
    pub fn in_front(&self, nearest: impl FnOnce() -> f64, u: [f64; 2], v: [f64; 2]) -> Option<Self> {
        let [_, most] = self.decay(u, v);
        if most <= self.depth {
            return None;
        }
        let mut beam = self.clone();
        if self.low != DVec3::ZERO || self.high != DVec3::ZERO {
            // Rounded to a power of two, so that it is equal for most images of moving bodies: only images with equal
            // beams share tiles.
            beam.closeness = nearest().recip().log2().ceil().exp2();
        }
        Some(beam)
    }

    /// True if all rays with directions within ranges are out of the beam.
    pub fn misses(&self, u: [f64; 2], v: [f64; 2]) -> bool {
        self.seen(u, v).is_some_and(|[u, v]| self.decay(u, v)[0] > self.depth)
    }

    /// Bounds of two-way ln(peaks / gain) of the pair with the most gain, over directions within ranges.
    fn decay(&self, u: [f64; 2], v: [f64; 2]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for patterns in &self.patterns {
            let mut of_best = [f64::INFINITY; 2];
            for decay in patterns.iter().map(|pattern| pattern.decay(u, v)) {
                of_best = [of_best[0].min(decay[0]), of_best[1].min(decay[1])];
            }
            sum = [sum[0] + of_best[0], sum[1] + of_best[1]];
        }
        sum
    }

    /// Ranges of directions `(1, u, v)` from antennas to hits of rays within ranges; none if they are unbounded.
    fn seen(&self, u: [f64; 2], v: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        let most = |[low, high]: [f64; 2]| low.abs().max(high.abs());
        // From an antenna at o a hit at x (1, u, v) is in the direction (u - o_y / x) / (1 - o_x / x), likewise v.
        let inverse_x = self.closeness * (1.0 + most(u).powi(2) + most(v).powi(2)).sqrt();
        if inverse_x * self.high.x >= 1.0 {
            return None;
        }
        let along = [self.low.x, self.high.x];
        let widened = |range: [f64; 2], across: [f64; 2]| {
            let [mut low, mut high] = range;
            for u in range {
                for o in across {
                    for o_x in along {
                        let seen = (u - o * inverse_x) / (1.0 - o_x * inverse_x);
                        (low, high) = (low.min(seen), high.max(seen));
                    }
                }
            }
            [low, high]
        };
        Some([
            widened(u, [self.low.y, self.high.y]),
            widened(v, [self.low.z, self.high.z]),
        ])
    }
}
