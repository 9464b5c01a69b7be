//! Errors of a sum that are known before it: sums over paths of what their series leave out.

use super::kernel::Spreading;
use super::tables::Tables;

/// Rounding of phases and of sums in single precision, relative to the amplitudes.
const ROUNDING: f64 = 1e-6;

/// Safety factor of what series leave out: echoes of a smooth surface cancel but for those of its ends, whose phases may
/// bend most. Without it, errors of plates were up to 1.25 times the bound.
const SURFACE: f64 = 1.5;

/// Sums over the paths of a channel, each weighted with the power of the path.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    /// Power: mean over the frame of the square of the amplitudes [W].
    pub power: f64,
    /// Bounds of phases that are left out at any order of time within a chirp, squared [rad^2 W].
    pub phase: f64,
    /// Phases that bend within a chirp beyond their mean, squared [rad^2 W].
    pub bend: f64,
    /// Fourth powers of those phases [rad^4 W].
    pub bend_squared: f64,
    /// Amplitudes that are left out, squared [W].
    pub amplitude: f64,
    /// Phases beyond the last coefficients of series through values, squared [rad^2 W].
    pub further_phase: f64,
    /// Amplitudes beyond the last coefficients of series through values, squared [W].
    pub further_amplitude: f64,
    /// Phases of the coefficients after the third, squared: part of no error [rad^2 W].
    pub beyond_third: f64,
    /// Amplitudes of the coefficients after the fourth, squared: part of `amplitude` [W].
    pub beyond_fourth: f64,
    /// Largest delay of a path with power [s].
    pub longest: f64,
    /// [Gain](crate::synthesis::coherence::Coherence::gain) that paths may have in phase.
    pub coherence: f64,
}

impl Errors {
    /// Add those of other paths.
    pub fn add(&mut self, other: &Self) {
        self.power += other.power;
        self.phase += other.phase;
        self.bend += other.bend;
        self.bend_squared += other.bend_squared;
        self.amplitude += other.amplitude;
        self.further_phase += other.further_phase;
        self.further_amplitude += other.further_amplitude;
        self.beyond_third += other.beyond_third;
        self.beyond_fourth += other.beyond_fourth;
        self.longest = self.longest.max(other.longest);
        self.coherence = self.coherence.max(other.coherence);
    }

    /// Error of a sum that no choice of the kernel changes, rms over the samples relative to the l2 norm of the
    /// amplitudes, for paths of independent phases; with or without [the second grid](super::sum::Steps).
    pub fn rest(&self, tables: &Tables, has_second: bool) -> f64 {
        if self.power == 0.0 {
            return 0.0;
        }
        let moments = &tables.moments;
        let bend = if has_second {
            // The second order of exp(j e), e the phase at a sample, is e^2 / 2.
            let ratio = 0.5 * moments.bend_squared / moments.bend.powi(2).max(f64::MIN_POSITIVE);
            ratio * ratio * self.bend_squared
        } else {
            self.bend
        };
        let further = self.further_phase + self.further_amplitude;
        let left_out = self.phase + self.amplitude + bend + further;
        ((SURFACE * tables.fluctuation).powi(2) * left_out / self.power + ROUNDING * ROUNDING).sqrt()
    }

    /// Bound of the error of a kernel of `width` cells, in chirps of `num_samples`, whatever the phases of the paths; infinite for no such kernel.
    pub fn kernel(&self, width: usize, num_samples: usize) -> f64 {
        Spreading::error(width, num_samples, self.coherence).unwrap_or(f64::INFINITY)
    }
}
