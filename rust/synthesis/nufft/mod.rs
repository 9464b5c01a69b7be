//! NUFFT of moving paths on a range-velocity grid: spreading, one FFT per velocity row, a dense transform over slow
//! time.
//!
//! How phases become places on the grid and strengths is said in `residual_phase` and `cross_approximation`. Every term
//! has a grid of its own and shares the kernel's weights with the others.

mod coordinates;
mod job;
pub mod kernel;
mod layout;
mod scalar;
mod slow_time;
mod spectra;
mod spread;
mod transform;

pub use job::{Job, MAX_CHANNELS, MAX_PARTS};
pub use layout::{Layout, good_size};
pub use spread::Widths;
pub use transform::add_channels;
