//! Options, results and reports of sums.

use std::fmt;

use num_complex::{Complex, Complex32, Complex64};

use crate::cancel::Cancel;
use crate::numeric::simd::{Level, Real};
use crate::synthesis::source::PathGroup;

/// Smallest tolerance whose samples are in single precision.
pub const SINGLE_TOLERANCE: f64 = 1e-6;

/// Largest error of a truncated series in a frame over its rms.
const PEAK: f64 = 2.0;

/// Options of an engine.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Bound on rms(error over the samples of a channel) / l2(amplitudes of that channel).
    pub tolerance: f64,
    /// Instruction set.
    pub level: Level,
    /// Use the threads of the current pool.
    pub is_parallel: bool,
    /// Request to stop the sum.
    pub cancel: Option<&'a Cancel>,
    /// Measurements of a first run, or [`Known::NOTHING`].
    pub known: Known,
}

/// Coherent gain of the paths, as a first run has measured it.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Largest rms of the samples of a channel, relative to its l2(amplitudes); at least 1.
    pub gain: f64,
    /// Root of the largest [energy](crate::synthesis::coherence::CellSums::energy) of the paths of a channel beside the
    /// frame, or the gain where that is larger.
    pub coherence: f64,
    /// True if single precision was too coarse.
    pub needs_double: bool,
}

impl Known {
    /// Paths of independent phases.
    pub const NOTHING: Self = Self {
        gain: 1.0,
        coherence: 1.0,
        needs_double: false,
    };
}

/// Error of a sum, rms over the samples of a channel relative to its l2(amplitudes); the largest of all channels.
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorBound {
    /// Of a spreading kernel, whatever the phases of the paths.
    pub kernel: f64,
    /// Of truncated series, for paths of independent phases.
    pub truncation: f64,
    /// Of rounding, for paths of independent phases.
    pub rounding: f64,
    /// Of rounding per path of equal paths: with a gain g, g^2 paths add up in phase.
    pub equal_rounding: f64,
    /// Share of the strongest path in the power, where rounding is measured without it, and the number of other paths.
    pub strongest: f64,
    pub num_weak: f64,
}

impl ErrorBound {
    /// Number of equal paths that add up times their sum: `gain^2` paths, or weak ones beside the strongest path.
    fn of_equal(&self, gain: f64) -> f64 {
        if self.strongest == 0.0 {
            return gain.powi(3);
        }
        let rest = 1.0 - self.strongest;
        let number = ((gain * gain - self.strongest).max(0.0) / rest.max(f64::EPSILON)).min(self.num_weak);
        number.max(1.0).powf(1.5) * rest.sqrt()
    }

    /// Error of rounding for samples whose rms is `gain` times the rms for independent phases.
    pub fn rounding_with_gain(&self, gain: f64) -> f64 {
        (gain * self.rounding).hypot(self.of_equal(gain) * self.equal_rounding)
    }

    /// Error for samples whose rms is `gain` times the rms for independent phases.
    pub fn with_gain(&self, gain: f64) -> f64 {
        // Paths may add up in phase where the errors of their series are largest.
        let in_phase = (1.0 + PEAK * PEAK * (gain * gain - 1.0).max(0.0)).sqrt();
        self.kernel
            .hypot(self.rounding_with_gain(gain))
            .hypot(in_phase * self.truncation)
    }
}

/// Beat samples `(channel, chirp, sample)`, row-major.
#[derive(Debug)]
pub enum Samples {
    /// Samples for tolerances from [`SINGLE_TOLERANCE`] on.
    Single(Vec<Complex32>),
    /// Samples for smaller tolerances.
    Double(Vec<Complex64>),
}

impl Samples {
    /// Samples times a factor, in the precision of a tolerance. In double precision before: the factor may be out of the range
    /// of single precision where samples times it are not.
    pub fn new<T: Real>(samples: &[Complex<T>], factor: f64, tolerance: f64) -> Self {
        let scaled = samples
            .iter()
            .map(|s| Complex64::new(s.re.wide() * factor, s.im.wide() * factor));
        if tolerance >= SINGLE_TOLERANCE {
            Self::Single(scaled.map(|s| Complex32::new(s.re as f32, s.im as f32)).collect())
        } else {
            Self::Double(scaled.collect())
        }
    }

    /// Zeros, in the precision of a tolerance.
    pub fn zeros(shape: [usize; 3], tolerance: f64) -> Self {
        let number = shape.iter().product();
        if tolerance >= SINGLE_TOLERANCE {
            Self::Single(vec![Complex32::ZERO; number])
        } else {
            Self::Double(vec![Complex64::ZERO; number])
        }
    }
}

/// Sum of an engine.
#[derive(Debug)]
pub struct Sum {
    /// The samples, without a scale.
    pub samples: Samples,
    /// Mean over the nodes of the squared l2 norm of the amplitudes, per channel [W].
    pub power: Vec<f64>,
    /// [Coherence](Known::coherence) of the paths.
    pub coherence: f64,
    /// Report of the sum.
    pub report: Report,
}

/// Report of a sum.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Name of the engine: `direct`, `chirp-wise NUFFT` or `range-Doppler NUFFT`.
    pub engine: &'static str,
    /// True if sums are formed in single precision.
    pub is_single: bool,
    /// Width of the spreading kernel [cells]; 0 for none.
    pub width: usize,
    /// Number of grids: of polynomials of time within a chirp, or of strengths.
    pub num_grids: usize,
    /// Number of blocks of chirps, the most of all groups.
    pub num_blocks: usize,
    /// Rows of velocity; 0 for none.
    pub num_rows: usize,
    /// Number of paths of all channels.
    pub num_paths: usize,
    /// Number of paths of all channels that stand still.
    pub num_static: usize,
    /// Bound on the longest delay of a path with power [s].
    pub longest: f64,
    /// Working memory beside input and result [bytes].
    pub memory: usize,
    /// Error by its causes.
    pub error: ErrorBound,
    /// Error with the measured gain; set by `beat_signal`.
    pub total_error: f64,
    /// Largest rms of the samples of a channel relative to its l2(amplitudes); set by `beat_signal`.
    pub gain: f64,
    /// Number of runs; set by `beat_signal`.
    pub num_runs: usize,
}

impl Report {
    /// Report of an engine that sums some groups, in double precision.
    pub fn new(engine: &'static str, groups: &[PathGroup]) -> Self {
        let mut report = Self {
            engine,
            ..Self::default()
        };
        for shape in groups.iter().map(|group| group.source.shape()) {
            let number = shape.channels * shape.paths;
            report.num_paths += number;
            report.num_static += if shape.is_static() { number } else { 0 };
        }
        report
    }
}

/// Largest number, at least zero, or NaN.
pub fn largest(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |a, b| if a.is_nan() || a > b { a } else { b })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.num_paths == 0 {
            return f.write_str("no paths");
        }
        let counted = |number: usize, name| format!("{number} {name}{}", if number == 1 { "" } else { "s" });
        f.write_str(&counted(self.num_paths, "path"))?;
        if self.num_static > 0 {
            write!(f, " ({} static)", self.num_static)?;
        }
        let precision = if self.is_single { "single" } else { "double" };
        write!(f, ": {}, {precision} precision", self.engine)?;
        for (number, name) in [
            (self.num_rows, "velocity row"),
            (self.num_blocks, "block"),
            (self.num_grids, "grid"),
        ] {
            if number > 0 {
                write!(f, ", {}", counted(number, name))?;
            }
        }
        if self.width > 0 {
            write!(f, ", kernel of {} cells", self.width)?;
        }
        write!(f, ", error {:.1e}", self.total_error)
    }
}
