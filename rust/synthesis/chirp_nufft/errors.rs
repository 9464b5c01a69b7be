//! Errors of a sum that are known before it: sums over paths of what their records leave out.

use super::number::{MAX_EVEN, MAX_ODD, Number};
use super::tables::Tables;

/// Safety factor of what series leave out: echoes of a smooth surface cancel but for those of its ends, whose phases may
/// bend most. Without it, errors of plates were up to 1.25 times the bound.
const SAFETY: f64 = 1.5;

/// Sums over the paths of a channel, means over the blocks; scaled as their amplitudes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    /// Power: mean over the frame of the square of the amplitudes [W].
    pub power: f64,
    /// Power of the strongest path in a block [W].
    pub strongest: f64,
    /// Squares of what is left out whatever the grids [W].
    pub always: f64,
    /// Squares of what places and curvatures of the carrier leave out, where there is only one grid [W].
    pub carrier: f64,
    /// Squares of what a block is too long for: coefficients beyond those of records [W].
    pub series: f64,
    /// Squares of the rounding of coefficients of phases, each of them rounded by one [rad^2 W].
    pub rounding: f64,
    /// Squares of the even and of the odd orders of fast time within a chirp, from the first on [W].
    pub even: [f64; MAX_EVEN + 2],
    pub odd: [f64; MAX_ODD + 1],
    /// Largest delay of a path with power [s].
    pub longest: f64,
}

impl Errors {
    /// Add the errors of other paths, times a weight.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.power += weight * other.power;
        self.strongest = self.strongest.max(other.strongest);
        self.always += weight * other.always;
        self.carrier += weight * other.carrier;
        self.series += weight * other.series;
        self.rounding += weight * other.rounding;
        for (sum, order) in self.even.iter_mut().zip(other.even) {
            *sum += weight * order;
        }
        for (sum, order) in self.odd.iter_mut().zip(other.odd) {
            *sum += weight * order;
        }
        self.longest = self.longest.max(other.longest);
    }

    /// Error of truncated series, rms over the samples relative to the l2 norm of the amplitudes, for paths of independent
    /// phases and numbers of even and odd grids after the first.
    pub fn truncation(&self, tables: &Tables, [even, odd]: [usize; 2]) -> f64 {
        let moments = &tables.moments;
        let mut left_out = self.always + self.series;
        if even + odd == 0 {
            left_out += self.carrier;
        }
        for order in even..even + 2 {
            left_out += moments.even[order + 1].powi(2) * self.even[order];
        }
        // The first order comes with its moments.
        let odd_moment = if odd == 0 { 1.0 } else { moments.odd[odd] };
        left_out += odd_moment.powi(2) * self.odd[odd];
        self.relative(tables, left_out)
    }

    /// Error of blocks that are too long, which shorter ones have not; likewise.
    pub fn of_blocks<T: Number>(&self, tables: &Tables) -> f64 {
        self.relative(tables, self.series).hypot(self.coefficients::<T>(tables))
    }

    /// Rounding of the coefficients of phases, likewise.
    pub fn coefficients<T: Number>(&self, tables: &Tables) -> f64 {
        T::OF_COEFFICIENT * self.relative(tables, self.rounding)
    }

    /// Share of the strongest path in the power, at most 1.
    pub fn share_of_strongest(&self) -> f64 {
        (self.strongest / self.power.max(f64::MIN_POSITIVE)).min(1.0)
    }

    fn relative(&self, tables: &Tables, square: f64) -> f64 {
        if self.power == 0.0 {
            return 0.0;
        }
        SAFETY * tables.waveform.fluctuation() * (square / self.power).sqrt()
    }
}
