//! Numerics without radar or geometry: vectors for every instruction set, exact phase, series, random numbers, threads.

pub mod chebyshev;
pub mod fft;
pub mod normal;
pub mod parallel;
pub mod random;
pub mod simd;
pub mod trig;
pub mod wide;
