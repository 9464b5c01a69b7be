//! Paths to sum, options, and what is known of them.

use num_complex::{Complex32, Complex64};

use crate::numeric::simd::Level;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::low_rank::residual_phase::Sample;
use crate::synthesis::plan::Method;
use crate::synthesis::statistics::PathStatistics;

/// How a sum is to be formed.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Bound on rms(error over the samples of a channel) / l2(amplitudes of that channel).
    pub tolerance: f64,
    /// Allowed steps.
    pub method: Method,
    /// Instruction set.
    pub level: Level,
    /// Use the threads of the pool that this runs in.
    pub is_parallel: bool,
    /// Sum paths that stand still apart from those that move.
    pub split_still: bool,
    /// Leave out velocity rows that no path touches.
    pub skip_rows: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            tolerance: 1e-4,
            method: Method::Auto,
            level: Level::best(),
            is_parallel: true,
            split_still: true,
            skip_rows: true,
        }
    }
}

/// Beat samples `(channel, chirp, sample)`, row-major.
pub enum Samples {
    /// For tolerances from [`SINGLE_TOLERANCE`] on.
    Single(Vec<Complex32>),
    /// For smaller ones.
    Double(Vec<Complex64>),
}

/// The paths and what is known of them.
pub(super) struct Job<'a> {
    pub(super) waveform: &'a Waveform,
    pub(super) series: &'a PathSeries<'a>,
    pub(super) options: &'a Options,
    /// Paths that stand still are summed apart from those that move.
    pub(super) is_split: bool,
    pub(super) statistics: PathStatistics,
    /// Paths that stand for all moving ones.
    pub(super) samples: Vec<Sample>,
    /// Chunks of paths `(channel, chunk)` that they did not stand for.
    pub(super) extra: Vec<(usize, usize)>,
    /// See [`Request::safety_factor`].
    pub(super) safety_factor: f64,
    /// See [`Request::allows_single`].
    pub(super) allows_single: bool,
    /// No plan kept what it had promised.
    pub(super) is_lost: bool,
    /// Amplitudes are multiplied by this power of two: it keeps the numbers of single precision in range.
    pub(super) scale: f64,
}
