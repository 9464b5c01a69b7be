//! Job of the NUFFT: the paths of one channel in one block of chirps.

use crate::cancel::Cancel;
use crate::numeric::simd::Level;
use crate::synthesis::block::Selection;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::low_rank::block_plan::BlockPlan;

/// Largest number of parts of the paths of a job.
pub const MAX_PARTS: usize = 8;

/// Job of the NUFFT: one class of paths of a channel on the grid of one block.
pub struct Job<'a> {
    /// The waveform.
    pub waveform: &'a Waveform,
    /// Delays and amplitudes of all paths.
    pub series: &'a PathSeries<'a>,
    /// Index of the channel.
    pub channel: usize,
    /// Selected paths.
    pub selection: Selection<'a>,
    /// Power of two that amplitudes are multiplied by.
    pub scale: f64,
    /// Plan of the block.
    pub block_plan: &'a BlockPlan,
    /// Width of the kernel [cells].
    pub width: usize,
    /// Instruction set.
    pub level: Level,
    /// Number of parts of the paths, spread on separate grids in parallel.
    pub num_parts: usize,
    /// Run parts and tiles on the threads of the pool.
    pub is_parallel: bool,
    /// Transform velocity rows that no path touches as well, for tests.
    pub keep_empty_rows: bool,
    /// Request to stop: what is left of the paths is left out.
    pub cancel: Option<&'a Cancel>,
}

/// Largest number of channels whose spectra are held at the same time.
pub const MAX_CHANNELS: usize = 4;
