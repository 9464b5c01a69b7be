//! Plans: one step of summation for each class of paths.

use std::fmt;

use crate::synthesis::block::Class;
use crate::synthesis::low_rank::block_plan::BlockPlan;

/// Largest error of a truncated series in a frame over its rms.
const PEAK: f64 = 2.0;

/// Factor of errors of truncated series in a sum whose rms is `gain` times that of independent phases: paths may add up
/// in phase where errors are largest.
pub fn in_phase(gain: f64) -> f64 {
    (1.0 + (PEAK * PEAK) * (gain * gain - 1.0).max(0.0)).sqrt()
}

/// Step that sums a class of paths.
#[derive(Clone, Debug)]
pub enum Step {
    /// Direct sum: docs/theory.md eq. (1) sample by sample in double precision.
    Direct,
    /// Direct sum with phasor recurrences.
    Recurrence {
        /// True for sums in single precision.
        is_single: bool,
    },
    /// Sum in lanes: range grids of 16 chirps at once, in single precision, see [`crate::synthesis::lanes`].
    Lanes {
        /// Width of the kernel [cells].
        width: usize,
        /// Follow the curvature of phases within a chirp to first order.
        has_second: bool,
    },
    /// NUFFT: one range-velocity grid per block of chirps and term.
    Grid {
        /// True for sums in single precision.
        is_single: bool,
        /// Width of the kernel [cells].
        width: usize,
        /// Block plans, in the order of the chirps.
        block_plans: Vec<BlockPlan>,
    },
}

impl Step {
    /// Name of the step: `direct`, `recurrence`, `lanes` or `grid`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Recurrence { .. } => "recurrence",
            Self::Lanes { .. } => "lanes",
            Self::Grid { .. } => "grid",
        }
    }

    /// True if sums are formed in single precision.
    pub fn is_single(&self) -> bool {
        match self {
            Self::Direct => false,
            Self::Lanes { .. } => true,
            Self::Recurrence { is_single } | Self::Grid { is_single, .. } => *is_single,
        }
    }

    /// Width of the kernel [cells], for steps with a kernel.
    pub fn width(&self) -> Option<usize> {
        match self {
            Self::Direct | Self::Recurrence { .. } => None,
            Self::Lanes { width, .. } | Self::Grid { width, .. } => Some(*width),
        }
    }
}

/// Part of a plan: a class of paths and its step.
#[derive(Clone, Debug)]
pub struct Part {
    /// Class of the paths.
    pub class: Class,
    /// Number of paths of the class, over all channels.
    pub num_paths: usize,
    /// Step that sums them.
    pub step: Step,
    /// Ratio of the l2 norm of their amplitudes, which errors are relative to, to that of all.
    pub share: f64,
    /// Bound of the error of a spreading kernel, whatever the phases of the paths.
    pub kernel: f64,
    /// Predicted rounding, for paths of independent phases; of recurrences with what they leave out.
    pub rounding: f64,
    /// Rounding per path of a sum of equal numbers: with a gain g, g^2 paths add up in phase.
    pub equal: f64,
    /// Predicted error of truncated series, for paths of independent phases; of the NUFFT, whose series interpolate
    /// residuals, estimated from samples of the paths.
    pub series: f64,
    /// Predicted time on one thread [s], of use for comparison only.
    pub cost: f64,
    /// Working memory, beside the input and the result [bytes].
    pub memory: usize,
}

/// Plan of the sum over all paths.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Parts, in the order of summation.
    pub parts: Vec<Part>,
    /// Rms of the samples of a channel relative to its l2(amplitudes) that the plan allows for.
    pub gain: f64,
}

/// Methods: the steps that a plan may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The cheapest step.
    Auto,
    /// Only the exact direct sum.
    Direct,
    /// Only the recurrence sum.
    Recurrence,
    /// Only sums in lanes.
    Lanes,
    /// Only the NUFFT.
    Grid,
}

impl Plan {
    /// Predicted error relative to l2(amplitudes), for the gain that the plan allows for.
    pub fn error(&self) -> f64 {
        self.error_with(0.0, self.gain)
    }

    /// Predicted error of truncated series, for paths of independent phases.
    pub fn series(&self) -> f64 {
        self.parts
            .iter()
            .map(|part| (part.share * part.series).powi(2))
            .sum::<f64>()
            .sqrt()
    }

    /// Error for a gain, with the measured error of truncated series in place of the estimate if it is larger.
    pub fn error_with(&self, series: f64, gain: f64) -> f64 {
        let more = series.powi(2) - self.series().powi(2);
        let squares = self.parts.iter().map(|part| part.error(gain).powi(2)).sum::<f64>();
        (squares + in_phase(gain).powi(2) * more.max(0.0)).sqrt()
    }

    /// Working memory, beside the input and the result [bytes].
    pub fn memory(&self) -> usize {
        self.parts.iter().map(|part| part.memory).max().unwrap_or(0)
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, part) in self.parts.iter().enumerate() {
            if i > 0 {
                f.write_str("\n")?;
            }
            part.write(f, self.gain)?;
        }
        if self.parts.is_empty() {
            f.write_str("no paths")?;
        }
        Ok(())
    }
}

impl Part {
    /// Predicted error relative to l2(amplitudes) of all paths, for a gain.
    pub fn error(&self, gain: f64) -> f64 {
        let rounding = gain * self.rounding.hypot(gain * gain * self.equal);
        self.share * self.kernel.hypot(rounding).hypot(in_phase(gain) * self.series)
    }

    /// Text with the error for a gain.
    fn write(&self, f: &mut fmt::Formatter<'_>, gain: f64) -> fmt::Result {
        let precision = |is_single: bool| if is_single { "single" } else { "double" };
        let class = match self.class {
            Class::Still => "still ",
            Class::Moving => "moving ",
            Class::All => "",
        };
        write!(f, "{} {class}paths: ", self.num_paths)?;
        match &self.step {
            Step::Direct => write!(f, "direct sum, double precision"),
            Step::Recurrence { is_single } => write!(f, "recurrence sum, {} precision", precision(*is_single)),
            Step::Lanes { width, .. } => write!(f, "lanes, single precision, kernel of {width} cells"),
            Step::Grid {
                is_single,
                width,
                block_plans,
            } => {
                let rows = block_plans.iter().map(|plan| plan.rows).max().unwrap_or(0);
                let terms: Vec<String> = block_plans
                    .iter()
                    .map(|plan| plan.approximation.num_sets().to_string())
                    .collect();
                write!(
                    f,
                    "grid, {} precision, kernel of {width} cells, {} block{}, {rows} velocity row{}, {} term{}",
                    precision(*is_single),
                    block_plans.len(),
                    if block_plans.len() == 1 { "" } else { "s" },
                    if rows == 1 { "" } else { "s" },
                    terms.join("+"),
                    if terms == ["1"] { "" } else { "s" },
                )
            }
        }?;
        write!(f, ", error {:.1e}", self.error(gain))
    }
}
