//! Layout of moving paths on the range-velocity grid in a block of chirps.

use crate::synthesis::block::Block;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::low_rank::cross_approximation::CrossApproximation;
use crate::synthesis::low_rank::residual_phase::Frame;

/// The grid of a class of paths in one block.
#[derive(Clone, Debug)]
pub struct BlockPlan {
    /// The chirps.
    pub block: Block,
    /// Constants of the plane waves.
    pub frame: Frame,
    /// Rate at the centre of the velocity axis [s/s].
    pub middle_rate: f64,
    /// Distance of two velocity rows [s/s].
    pub step: f64,
    /// Velocity rows; 1 means that nothing moves and there is no velocity axis.
    pub rows: usize,
    /// Degrees of the delay's series that are followed, the constant included.
    pub num_degrees: usize,
    /// The same of the amplitude's series.
    pub num_amplitudes: usize,
    /// Sets of strengths, each on its own grid.
    pub modes: CrossApproximation,
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
