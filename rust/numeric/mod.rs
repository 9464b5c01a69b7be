//! Numerics without radar or geometry: vectors for every instruction set, exact phase, series, transforms and their
//! kernel, random numbers, threads.

pub mod chebyshev;
pub mod fft;
pub mod kaiser_bessel;
pub mod legendre;
pub mod normal;
pub mod parallel;
pub mod random;
pub mod simd;
pub mod trig;
pub mod wide;
