//! Request for a plan, and the goal for each class of paths.

use std::cell::{OnceCell, RefCell};

use super::parts::Method;
use crate::numeric::simd::Level;
use crate::synthesis::block::Class;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::low_rank::residual_phase::{Path, Sample};
use crate::synthesis::statistics::Group;

/// Rounding of the sum of n nearly equal numbers one after the other in single precision: so much times n. Measured.
pub(super) const SINGLE_EQUAL_SUM: f64 = 6e-9;

/// Share of the tolerance that predicted errors may fill.
pub(super) const MARGIN: f64 = 0.9;

/// Errors of paths add up with phases of their own: in a frame of few samples, to so much more than on average.
pub fn fluctuation(waveform: &Waveform) -> f64 {
    let num_samples = (waveform.chirp_times.len() * waveform.num_samples) as f64;
    // Three standard deviations of the mean of squares of normal numbers.
    (1.0 + 3.0 / num_samples.sqrt()).sqrt()
}

/// What a plan is made for.
pub struct Request<'a> {
    /// The waveform.
    pub waveform: &'a Waveform,
    /// The paths.
    pub series: &'a PathSeries<'a>,
    /// Bound on the error relative to l2(amplitudes).
    pub tolerance: f64,
    /// Allowed steps.
    pub method: Method,
    /// Largest rms of the samples of a channel relative to its l2(amplitudes), as far as it is known; at least 1.
    pub gain: f64,
    /// Divides the error that the samples may have: more than 1 where other paths turned out to have more.
    pub safety_factor: f64,
    /// Grids may be in single precision.
    pub allows_single: bool,
    /// Paths that stand for all moving ones.
    pub samples: &'a [Sample],
    /// So many of them, the first, were drawn from all.
    pub num_random: usize,
    /// Instruction set.
    pub level: Level,
}

/// The paths of one class and the error they may have, relative to their own l2(amplitudes).
pub(super) struct Goal<'a> {
    pub(super) request: &'a Request<'a>,
    pub(super) class: Class,
    pub(super) group: &'a Group,
    /// Power of the class, per channel: what its errors are relative to.
    pub(super) own: Vec<f64>,
    pub(super) tolerance: f64,
    pub(super) share: f64,
    /// See [`PathStatistics::effective_paths`].
    pub(super) effective_paths: f64,
    /// Whether all paths are like the samples, once that is known.
    pub(super) are_alike: OnceCell<bool>,
    /// Memory for the samples in a block.
    pub(super) room: RefCell<Vec<Path>>,
}

/// A kernel of the grid and its error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel {
    pub(super) is_single: bool,
    pub(super) width: usize,
    pub(super) error: f64,
}
