//! Records of paths, and the two precisions of a sum: sizes of records, widths of kernels, and rounding.

use std::fmt::Debug;

use crate::numeric::simd::Real;
use crate::synthesis::source::Fill;

/// Most lanes of a vector.
pub const MAX_LANES: usize = 16;

/// Most coefficients of a phase after the constant one, and most of an amplitude, of all precisions.
pub const MAX_TURNS: usize = 16;
pub const MAX_AMPLITUDES: usize = 12;

/// Most grids of even and of odd powers of fast time after the first grid.
pub const MAX_EVEN: usize = 4;
pub const MAX_ODD: usize = 4;

/// Coefficients of the phase that every path has; further ones only where they count.
pub const FEWEST_TURNS: usize = 3;

/// First numbers of a [`Record`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct Head<T> {
    /// Constant part of the phase at the middle samples, with the argument of the amplitude [turns].
    pub phase: T,
    /// Constant part of the place on the grid after `cell`, -1/2 to 1/2 [cells].
    pub offset: T,
    /// Change of the place per turn where the frequency received is not the carrier [cells per turn].
    pub carrier_offset: T,
    /// Cell of the constant part.
    pub cell: u32,
    /// Numbers of the coefficients of phase and amplitude that count; at least [`FEWEST_TURNS`] of the phase.
    pub degrees: [u16; 2],
}

/// A moving path: coefficients of Chebyshev polynomials over a block of chirps. The amplitude is real.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct Record<T, const K: usize, const A: usize> {
    head: Head<T>,
    /// Coefficients of the phase after the constant one [turns].
    turns: [T; K],
    /// Coefficients of the amplitude.
    amplitude: [T; A],
}

/// A record of any precision.
pub trait PathRecord<T>: Copy + Debug + Send + Sync {
    /// Record of the coefficients of one lane.
    fn new(head: Head<T>, turns: &[[T; MAX_LANES]], amplitude: &[[T; MAX_LANES]], lane: usize) -> Self;
    /// First numbers.
    fn head(&self) -> &Head<T>;
    /// Coefficients of the phase after the constant one [turns].
    fn turns(&self) -> &[T];
    /// Coefficients of the amplitude.
    fn amplitude(&self) -> &[T];
}

impl<T: Real + Debug + Send + Sync, const K: usize, const A: usize> PathRecord<T> for Record<T, K, A> {
    #[cfg_attr(optimised, inline(always))]
    fn new(head: Head<T>, turns: &[[T; MAX_LANES]], amplitude: &[[T; MAX_LANES]], lane: usize) -> Self {
        let mut record = Self {
            head,
            turns: [T::zero(); K],
            amplitude: [T::zero(); A],
        };
        for k in 0..K {
            record.turns[k] = turns[k][lane];
        }
        for k in 0..A {
            record.amplitude[k] = amplitude[k][lane];
        }
        record
    }

    #[cfg_attr(optimised, inline(always))]
    fn head(&self) -> &Head<T> {
        &self.head
    }

    #[cfg_attr(optimised, inline(always))]
    fn turns(&self) -> &[T] {
        &self.turns
    }

    #[cfg_attr(optimised, inline(always))]
    fn amplitude(&self) -> &[T] {
        &self.amplitude
    }
}

/// A static path.
#[derive(Clone, Copy, Debug, Default)]
pub struct Static<T> {
    /// Phase at the middle samples [turns].
    pub phase: T,
    /// Place on the grid after `cell` [cells].
    pub offset: T,
    /// Cell of the place.
    pub cell: u32,
    /// Amplitude.
    pub amplitude: T,
}

/// Numbers of a path for a sketch: phase [turns], cell, place after it [cells], linear coefficient of the phase [turns], and
/// amplitude.
pub trait Tone<T> {
    /// These numbers.
    fn tone(&self) -> (T, u32, T, T, T);
}

impl<T: Number> Tone<T> for Static<T> {
    #[cfg_attr(optimised, inline(always))]
    fn tone(&self) -> (T, u32, T, T, T) {
        (self.phase, self.cell, self.offset, T::zero(), self.amplitude)
    }
}

impl<T: Real + Debug + Send + Sync, const K: usize, const A: usize> Tone<T> for Record<T, K, A> {
    #[cfg_attr(optimised, inline(always))]
    fn tone(&self) -> (T, u32, T, T, T) {
        let head = self.head();
        (head.phase, head.cell, head.offset, self.turns()[0], self.amplitude()[0])
    }
}

/// Precision of records and grids. Phases are evaluated in double precision up to the record in both.
pub trait Number: Fill + Send + Sync {
    /// Record of a path.
    type Record: PathRecord<Self> + Tone<Self>;
    /// Lanes of a vector: chirps that are spread side by side.
    const LANES: usize;
    /// Coefficients of the phase after the constant one that a record has room for.
    const NUM_TURNS: usize;
    /// Coefficients of the amplitude that a record has room for.
    const NUM_AMPLITUDES: usize;
    /// Widths of the kernel [cells].
    const WIDTHS: &'static [usize];
    /// Most grids of even and of odd powers of fast time after the first grid.
    const MOST_GRIDS: [usize; 2];
    /// Coefficients of the delay whose products count in the phase.
    const NUM_SQUARES: usize;
    /// Rounding of a tone and of sums, rms relative to the l2 norm of the amplitudes.
    const ROUNDING: f64;
    /// Rounding of a sum per path of equal paths, relative to their amplitudes.
    const EQUAL_ROUNDING: f64;
    /// Rounding of cells, rms relative to what adds up at any fast time.
    const OF_CELLS: f64;
    /// Rounding of a coefficient, rms relative to it.
    const OF_COEFFICIENT: f64;
}

impl Number for f32 {
    type Record = Record<Self, 7, 4>; // 64 bytes
    const LANES: usize = 16;
    const NUM_TURNS: usize = 7;
    const NUM_AMPLITUDES: usize = 4;
    const WIDTHS: &'static [usize] = &[4, 6, 8];
    const MOST_GRIDS: [usize; 2] = [2, 2];
    const NUM_SQUARES: usize = 1;
    const ROUNDING: f64 = 5e-7;
    const EQUAL_ROUNDING: f64 = 8e-9;
    const OF_CELLS: f64 = 1e-7;
    const OF_COEFFICIENT: f64 = 5e-8;
}

impl Number for f64 {
    type Record = Record<Self, 16, 12>; // 256 bytes
    const LANES: usize = 8;
    const NUM_TURNS: usize = 16;
    const NUM_AMPLITUDES: usize = 12;
    const WIDTHS: &'static [usize] = &[8, 10, 12, 14];
    const MOST_GRIDS: [usize; 2] = [MAX_EVEN, MAX_ODD];
    const NUM_SQUARES: usize = 16;
    const ROUNDING: f64 = 3e-15;
    const EQUAL_ROUNDING: f64 = 1.5e-17;
    const OF_CELLS: f64 = 2e-16;
    const OF_COEFFICIENT: f64 = 1e-16;
}
