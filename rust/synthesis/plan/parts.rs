//! Plans: which paths are summed by which step.

use std::fmt;

use crate::synthesis::block::Class;
use crate::synthesis::low_rank::block_plan::BlockPlan;

/// What is done with a class of paths.
#[derive(Clone, Debug)]
pub enum Step {
    /// Eq. (1) sample by sample in double precision.
    Direct,
    /// Direct sum with phasor recurrences.
    Recurrence {
        /// In single precision.
        is_single: bool,
    },
    /// Range grids of many chirps side by side in single precision, any motion.
    Lanes {
        /// Width of the kernel.
        width: usize,
        /// Follow the frequency within a chirp.
        follows_sweep: bool,
    },
    /// The range-velocity grid.
    Grid {
        /// In single precision.
        is_single: bool,
        /// Width of the kernel.
        width: usize,
        /// One plan per block of chirps.
        expansions: Vec<BlockPlan>,
    },
}

impl Step {
    /// `direct`, `recurrence`, `lanes` or `grid`.
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

    /// Width of the kernel, if there is one.
    pub fn width(&self) -> Option<usize> {
        match self {
            Self::Direct | Self::Recurrence { .. } => None,
            Self::Lanes { width, .. } | Self::Grid { width, .. } => Some(*width),
        }
    }
}

/// One class of paths and what is done with it.
#[derive(Clone, Debug)]
pub struct Part {
    /// The class.
    pub class: Class,
    /// Its paths, over all channels.
    pub num_paths: usize,
    /// What is done.
    pub step: Step,
    /// Predicted error relative to l2(amplitudes).
    pub error: f64,
    /// What the interpolation of residuals has in it, as far as samples of the paths say.
    pub interpolation: f64,
    /// Predicted time on one thread [s], of use for comparison only.
    pub cost: f64,
    /// Memory beside the input and the result [bytes].
    pub memory: usize,
}

/// What is done with all paths.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Classes, in the order of their sums.
    pub parts: Vec<Part>,
}

/// Which steps a plan may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The cheapest.
    Auto,
    /// Only the exact direct sum.
    Direct,
    /// Only the recurrence sum.
    Recurrence,
    /// Only chirp lanes.
    Lanes,
    /// Only the grid.
    Grid,
}

impl Plan {
    /// Predicted error, relative to l2(amplitudes).
    pub fn error(&self) -> f64 {
        self.parts.iter().map(|part| part.error.powi(2)).sum::<f64>().sqrt()
    }

    /// Part of the error that is due to the interpolation of residuals, as far as samples of the paths say.
    pub fn interpolation(&self) -> f64 {
        self.parts
            .iter()
            .map(|part| part.interpolation.powi(2))
            .sum::<f64>()
            .sqrt()
    }

    /// The error with what the interpolation turned out to leave, if that is more.
    pub fn error_with(&self, interpolation: f64) -> f64 {
        let more = interpolation.powi(2) - self.interpolation().powi(2);
        (self.error().powi(2) + more.max(0.0)).sqrt()
    }

    /// Memory beside the input and the result [bytes].
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
            write!(f, "{part}")?;
        }
        if self.parts.is_empty() {
            f.write_str("no paths")?;
        }
        Ok(())
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
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
            Step::Lanes { width, .. } => write!(f, "chirp lanes, single precision, kernel of {width} cells"),
            Step::Grid {
                is_single,
                width,
                expansions,
            } => {
                let rows = expansions.iter().map(|e| e.rows).max().unwrap_or(0);
                let terms: Vec<String> = expansions.iter().map(|e| e.modes.num_sets().to_string()).collect();
                write!(
                    f,
                    "grid, {} precision, kernel of {width} cells, {} block{}, {rows} velocity row{}, {} term{}",
                    precision(*is_single),
                    expansions.len(),
                    if expansions.len() == 1 { "" } else { "s" },
                    if rows == 1 { "" } else { "s" },
                    terms.join("+"),
                    if terms == ["1"] { "" } else { "s" },
                )
            }
        }?;
        write!(f, ", error {:.1e}", self.error)
    }
}
