//! Sources of paths: whatever fills chunks with delays and amplitudes. Engines see nothing else of paths.

use std::ops::Range;

use crate::error::Error;
use crate::numeric::simd::{Level, Precision};
use crate::synthesis::chunk::{CHUNK, Chunk};

pub use crate::synthesis::chunk::Shape;

/// Paths to fill a chunk with.
#[derive(Clone, Debug)]
pub struct Request {
    /// Channels; they come one after the other in the chunk.
    pub channels: Range<usize>,
    /// Paths, at most [`CHUNK`].
    pub paths: Range<usize>,
    /// Power of two that amplitudes are multiplied by, which keeps them in the range of single precision.
    pub scale: f64,
    /// Instruction set.
    pub level: Level,
}

impl Request {
    /// Request for a chunk, by number, of all paths of a source.
    pub fn of_chunk(number: usize, shape: &Shape, channels: Range<usize>, scale: f64, level: Level) -> Self {
        Self {
            channels,
            paths: number * CHUNK..shape.paths.min((number + 1) * CHUNK),
            scale,
            level,
        }
    }
}

/// Source of paths.
pub trait PathSource: Sync {
    /// Numbers of channels, paths and rows.
    fn shape(&self) -> Shape;

    /// Channels that are best filled together, as they share the work.
    fn channels_together(&self) -> usize {
        1
    }

    /// Power of two near the inverse of the largest amplitudes, for [`Request::scale`].
    fn scale(&self) -> f64;

    /// Fill a chunk, with amplitudes in single precision.
    fn fill_single(&self, request: &Request, chunk: &mut Chunk<f32>);

    /// Fill a chunk, with amplitudes in double precision.
    fn fill_double(&self, request: &Request, chunk: &mut Chunk<f64>);

    /// Fill the delays of a chunk alone, if that takes less time.
    fn fill_delays(&self, request: &Request, chunk: &mut Chunk<f64>) {
        self.fill_double(request, chunk);
    }

    /// Error for delays or amplitudes that are no finite numbers.
    fn not_finite(&self) -> Error;
}

/// Precision of the amplitudes of a chunk.
pub trait Fill: Precision {
    /// Fill a chunk of this precision.
    fn fill(source: &dyn PathSource, request: &Request, chunk: &mut Chunk<Self>);
}

impl Fill for f32 {
    fn fill(source: &dyn PathSource, request: &Request, chunk: &mut Chunk<Self>) {
        source.fill_single(request, chunk);
    }
}

impl Fill for f64 {
    fn fill(source: &dyn PathSource, request: &Request, chunk: &mut Chunk<Self>) {
        source.fill_double(request, chunk);
    }
}

/// Paths that are summed with one factor over the samples of a chirp.
#[derive(Clone, Copy)]
pub struct PathGroup<'a> {
    /// The paths.
    pub source: &'a dyn PathSource,
    /// Amplitudes fall with this power of the frequency, see [`Waveform::over_frequency`]; they are given for the centre
    /// of the band.
    pub frequency_exponent: u8,
}
