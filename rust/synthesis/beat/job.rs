//! Job of a sum over paths: waveform, paths, options and statistics.

use num_complex::{Complex32, Complex64};

use crate::numeric::simd::Level;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::low_rank::residual_phase::Sample;
use crate::synthesis::plan::Method;
use crate::synthesis::statistics::PathStatistics;

/// Options of a sum over paths.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Bound on rms(error over the samples of a channel) / l2(amplitudes of that channel).
    pub tolerance: f64,
    /// Allowed steps.
    pub method: Method,
    /// Instruction set.
    pub level: Level,
    /// Use the threads of the current pool.
    pub is_parallel: bool,
    /// Sum still paths apart from moving paths.
    pub split_still: bool,
    /// Skip velocity rows that no path touches.
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
    /// Samples for tolerances from [`SINGLE_TOLERANCE`] on.
    Single(Vec<Complex32>),
    /// Samples for smaller tolerances.
    Double(Vec<Complex64>),
}

/// Job of a sum over paths, with the statistics of the paths.
pub(super) struct Job<'a> {
    pub(super) waveform: &'a Waveform,
    pub(super) series: &'a PathSeries<'a>,
    pub(super) options: &'a Options,
    /// True if still paths are summed apart from moving paths.
    pub(super) is_split: bool,
    pub(super) statistics: PathStatistics,
    /// Sampled paths, which represent all moving paths.
    pub(super) samples: Vec<Sample>,
    /// Chunks of paths `(channel, chunk)` that the samples failed to represent.
    pub(super) extra: Vec<(usize, usize)>,
    /// Safety factor of the error that the samples may have, as in `Request`.
    pub(super) safety_factor: f64,
    /// True if grids may be in single precision, as in `Request`.
    pub(super) allows_single: bool,
    /// True if no plan kept its predicted error.
    pub(super) is_lost: bool,
    /// Power of two that amplitudes are multiplied by, which keeps numbers in the range of single precision.
    pub(super) scale: f64,
}
