//! Paths of one channel and block, and how they are laid out.

use crate::numeric::simd::Level;
use crate::synthesis::block::Selection;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::low_rank::block_plan::BlockPlan;

/// Most parts of the paths of a job.
pub const MAX_PARTS: usize = 8;

/// One class of paths of a channel on the grid of one block.
pub struct Job<'a> {
    /// The waveform.
    pub waveform: &'a Waveform,
    /// All paths.
    pub series: &'a PathSeries<'a>,
    /// Number of the channel.
    pub channel: usize,
    /// The paths that take part.
    pub selection: Selection<'a>,
    /// Amplitudes are multiplied by this power of two.
    pub scale: f64,
    /// How they are expanded.
    pub block_plan: &'a BlockPlan,
    /// Width of the kernel.
    pub width: usize,
    /// Instruction set.
    pub level: Level,
    /// Parts of the paths that are spread on grids of their own, at the same time where there are threads.
    pub num_parts: usize,
    /// Run parts and tiles on the threads of the pool.
    pub is_parallel: bool,
    /// Transform velocity rows that no path has touched as well, for tests.
    pub keep_empty_rows: bool,
}

/// Most channels whose spectra are held at the same time.
pub const MAX_CHANNELS: usize = 4;
