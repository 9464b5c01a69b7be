//! Block plans: the range-velocity grid of a class of paths in a block of chirps.

use crate::synthesis::block::Block;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::low_rank::cross_approximation::CrossApproximation;
use crate::synthesis::low_rank::residual_phase::Frame;

/// Plan of the range-velocity grid of a class of paths in one block of chirps.
#[derive(Clone, Debug)]
pub struct BlockPlan {
    /// Block of chirps.
    pub block: Block,
    /// Constants of the plane waves.
    pub frame: Frame,
    /// Rate at the centre of the velocity axis [s/s].
    pub middle_rate: f64,
    /// Distance of two velocity rows [s/s].
    pub step: f64,
    /// Number of velocity rows; 1 for still paths, which need no velocity axis.
    pub rows: usize,
    /// Number of terms of the delay's series that count, the constant included.
    pub num_degrees: usize,
    /// Number of terms of the amplitude's series that count.
    pub num_amplitudes: usize,
    /// Cross approximation of the residuals: one set of strengths and one grid per term.
    pub approximation: CrossApproximation,
}

impl BlockPlan {
    /// Largest keystone frequency in the block [Hz s].
    pub fn max_keystone(waveform: &Waveform, block: &Block, carrier: f64) -> f64 {
        let slow = (0..block.chirps.len())
            .map(|c| block.offset(waveform, c).abs())
            .fold(0.0, f64::max);
        let fast = waveform.half_sweep();
        (carrier.abs() + waveform.slope.abs() * fast) * slow + waveform.slope.abs() * fast * fast
    }
}
