//! Job of a sum over paths: waveform, paths, options and statistics.

use num_complex::{Complex32, Complex64};

use crate::cancel::Cancel;
use crate::error::Error;
use crate::numeric::simd::{Level, Real};
use crate::synthesis::block::{Class, Selection};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::plan::{Method, Plan};
use crate::synthesis::statistics::Group;

/// Options of a sum over paths.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
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
    /// Request to stop the sum.
    pub cancel: Option<&'a Cancel>,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self {
            tolerance: 1e-4,
            method: Method::Auto,
            level: Level::best(),
            is_parallel: true,
            split_still: true,
            skip_rows: true,
            cancel: None,
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

/// Report of a sum over paths.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Plan of the last run.
    pub plan: Plan,
    /// Number of velocity rows that were transformed.
    pub rows: usize,
    /// Number of velocity rows that were skipped, as no path touched them.
    pub rows_skipped: usize,
    /// Number of runs: more than one if paths add up in phase, or are unlike the samples of the plan.
    pub runs: usize,
    /// Largest rms of the samples of a channel, relative to its l2(amplitudes).
    pub gain: f64,
}

/// Job of a sum over paths, with their statistics.
pub(super) struct Job<'a> {
    pub(super) waveform: &'a Waveform,
    pub(super) series: &'a PathSeries<'a>,
    pub(super) options: &'a Options<'a>,
    /// Bit masks of the moving paths, (channel, chunk); none if all paths are of one class.
    pub(super) masks: Vec<u128>,
    /// Paths by class.
    pub(super) groups: Vec<(Class, Group)>,
    /// Safety factor of the error that the samples may have, as in `Request`.
    pub(super) safety_factor: f64,
    /// True if grids may be in single precision, as in `Request`.
    pub(super) allows_single: bool,
    /// True if no plan kept its predicted error.
    pub(super) is_lost: bool,
    /// Power of two that amplitudes are multiplied by, which keeps numbers in the range of single precision.
    pub(super) scale: f64,
}

impl Job<'_> {
    /// Selection of the paths of a class.
    pub(super) fn selection(&self, class: Class) -> Selection<'_> {
        if self.masks.is_empty() {
            return Selection::ALL;
        }
        Selection::new(class, &self.masks, self.series.num_channels)
    }
}

/// Power of two near the inverse of the largest amplitude.
pub(super) fn scale(largest: f64) -> f64 {
    if largest > 0.0 {
        // The scale and its inverse are both finite.
        (-largest.log2().round()).clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
    }
}

/// Largest rms over the samples of a channel, relative to l2(amplitudes).
pub(super) fn gain(samples: &Samples, power: &[f64], waveform: &Waveform) -> f64 {
    let per_channel = waveform.chirp_times.len() * waveform.num_samples;
    let mean: Vec<f64> = match samples {
        Samples::Single(samples) => samples
            .chunks(per_channel)
            .map(|channel| {
                channel
                    .iter()
                    .map(|s| s.re.wide().powi(2) + s.im.wide().powi(2))
                    .sum::<f64>()
            })
            .collect(),
        Samples::Double(samples) => samples
            .chunks(per_channel)
            .map(|channel| channel.iter().map(num_complex::Complex::norm_sqr).sum::<f64>())
            .collect(),
    };
    mean.iter()
        .zip(power)
        .map(|(sum, power)| {
            if *power > 0.0 {
                (sum / per_channel as f64 / power).sqrt()
            } else {
                0.0
            }
        })
        .fold(0.0, f64::max)
}

/// Error of samples that are no numbers, for the largest amplitude.
pub(super) fn too_large(largest: f64) -> Error {
    let expected = "sums that samples can hold, below 3e38 in single precision";
    Error::value("amplitude", expected, format!("{largest:.1e} as the largest"))
}
