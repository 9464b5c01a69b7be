//! Numerics that know neither radar nor geometry: vectors for every instruction set, exact phase, series, threads.

pub mod chebyshev;
pub mod parallel;
pub mod random;
pub mod simd;
pub mod trig;
pub mod wide;
