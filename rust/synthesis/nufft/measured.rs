//! What a run measures of its paths, beside their sum: all that a plan supposes of them.

use super::job::Job;
use crate::synthesis::coherence::Coherence;

/// Most columns of the cells of range and velocity: what is finer is merged, which the bound of coherence allows.
const MOST_COLUMNS: usize = 128;

/// Measurements of the paths of a job: power, coherence, and what the interpolation of residuals leaves.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// Mean over the nodes of the squared l2 norm of the amplitudes, in the first block [W].
    pub power: f64,
    /// Sums of amplitudes over cells of range and velocity.
    pub coherence: Coherence,
    /// Squared interpolation error, summed over paths, the mean over the checks.
    pub rest: f64,
    /// Chunk with the largest share of that error, and the share.
    pub worst: (usize, f64),
}

impl Measured {
    /// Measurements of no paths yet.
    pub(super) fn new(job: &Job) -> Self {
        Self {
            coherence: Coherence::of_grid(job.block_plan.rows.div_ceil(2), Self::columns(job)),
            ..Self::default()
        }
    }

    /// Columns of the cells: at most one per turn over a chirp.
    pub(super) fn columns(job: &Job) -> usize {
        job.waveform.num_samples.clamp(1, MOST_COLUMNS)
    }

    /// Add the interpolation error of a chunk.
    #[cfg_attr(optimised, inline(always))] // part of kernels, see simd.rs
    pub(super) fn add_rest(&mut self, chunk: usize, rest: f64) {
        self.rest += rest;
        if rest > self.worst.1 {
            self.worst = (chunk, rest);
        }
    }

    /// Add those of other paths of the job.
    pub(super) fn join(&mut self, other: &Self) {
        self.power += other.power;
        self.coherence.join(&other.coherence);
        self.rest += other.rest;
        if other.worst.1 > self.worst.1 {
            self.worst = other.worst;
        }
    }
}
