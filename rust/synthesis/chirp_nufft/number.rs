//! The two precisions of a sum: sizes of records, widths of kernels, and rounding.

use crate::synthesis::source::Fill;

/// Most lanes of a vector.
pub const MAX_LANES: usize = 16;

/// One number per chirp of a group, or per path of a record.
pub type LaneRow<T> = [T; MAX_LANES];

/// Most coefficients of a delay after the constant one, of all precisions.
pub const MAX_TURNS: usize = 16;

/// Highest degree of fast time of a grid, of all precisions, and number of polynomials to tell the errors of two more.
pub const MAX_DEGREE: usize = 8;
pub const MAX_ORDERS: usize = MAX_DEGREE + 4;

/// Precision of records and grids. Phases and places of constant delays are computed in double precision in both.
pub trait Number: Fill + Send + Sync {
    /// Lanes of a vector: chirps that are spread side by side.
    const LANES: usize;
    /// Most coefficients of a delay after the constant one.
    const NUM_TURNS: usize;
    /// Most coefficients of an amplitude.
    const NUM_AMPLITUDES: usize;
    /// Widths of the kernel [cells].
    const WIDTHS: &'static [usize];
    /// Highest degree of fast time of a grid.
    const DEGREE: usize;
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
    const LANES: usize = 16;
    const NUM_TURNS: usize = 7;
    const NUM_AMPLITUDES: usize = 4;
    const WIDTHS: &'static [usize] = &[4, 6, 8];
    const DEGREE: usize = 4;
    const ROUNDING: f64 = 5e-7;
    const EQUAL_ROUNDING: f64 = 8e-9;
    const OF_CELLS: f64 = 1e-7;
    const OF_COEFFICIENT: f64 = 5e-8;
}

impl Number for f64 {
    const LANES: usize = 8;
    const NUM_TURNS: usize = MAX_TURNS;
    const NUM_AMPLITUDES: usize = 12;
    const WIDTHS: &'static [usize] = &[8, 10, 12, 14];
    const DEGREE: usize = MAX_DEGREE;
    const ROUNDING: f64 = 3e-15;
    const EQUAL_ROUNDING: f64 = 1.5e-17;
    const OF_CELLS: f64 = 2e-16;
    const OF_COEFFICIENT: f64 = 1e-16;
}
