//! Request for a plan, and the goals for classes of paths.

use std::cell::RefCell;

use super::parts::Method;
use crate::numeric::simd::Level;
use crate::synthesis::block::Class;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::low_rank::residual_phase::Path;
use crate::synthesis::statistics::Group;

/// Relative rounding per addend of sums of nearly equal numbers in single precision, one after the other; measured.
pub const SINGLE_EQUAL_SUM: f64 = 6e-9;

/// Share of the tolerance that predicted errors may fill.
pub(super) const MARGIN: f64 = 0.9;

/// Ratio of the largest expected rms error in a frame to the mean: errors of paths have random phases, and few samples
/// fluctuate.
pub fn fluctuation(waveform: &Waveform) -> f64 {
    let num_samples = (waveform.chirp_times.len() * waveform.num_samples) as f64;
    // Three standard deviations of the mean of squares of normal numbers.
    (1.0 + 3.0 / num_samples.sqrt()).sqrt()
}

/// Request for a plan: waveform, paths, tolerance and allowed steps.
pub struct Request<'a> {
    /// The waveform.
    pub waveform: &'a Waveform,
    /// The paths.
    pub series: &'a PathSeries<'a>,
    /// Bound on the error relative to l2(amplitudes).
    pub tolerance: f64,
    /// Allowed steps.
    pub method: Method,
    /// Largest rms of the samples of a channel relative to its l2(amplitudes) that the plan allows for; at least 1.
    pub gain: f64,
    /// Safety factor of the error that the samples may have: above 1 after other paths turned out to have more.
    pub safety_factor: f64,
    /// True if grids may be in single precision.
    pub allows_single: bool,
    /// Instruction set.
    pub level: Level,
}

/// Goal for the paths of one class: the allowed error, relative to their own l2(amplitudes).
pub(super) struct Goal<'a> {
    pub(super) request: &'a Request<'a>,
    pub(super) class: Class,
    pub(super) group: &'a Group,
    pub(super) tolerance: f64,
    pub(super) share: f64,
    /// Scratch memory for the samples in a block.
    pub(super) scratch: RefCell<Vec<Path>>,
}

/// Spreading kernel and its errors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel {
    pub(super) is_single: bool,
    pub(super) width: usize,
    /// Bound of the error of the kernel, whatever the phases of the paths.
    pub(super) bound: f64,
    /// Rounding for paths of independent phases.
    pub(super) rounding: f64,
    /// Rounding per path of paths in phase.
    pub(super) equal: f64,
    /// Both, for the gain of the request.
    pub(super) error: f64,
}
