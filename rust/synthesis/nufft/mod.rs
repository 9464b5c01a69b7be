//! NUFFT of moving paths on a range-velocity grid: spreading, one FFT per velocity row, a dense transform over slow
//! time.
//!
//! Coordinates and strengths follow from the phases as in `residual_phase` and `cross_approximation`. Every term of the
//! cross approximation has a separate grid; the weights of the kernel are shared.

mod coordinates;
mod job;
pub mod kernel;
mod layout;
mod measured;
mod scalar;
mod slow_time;
mod spectra;
mod spread;
mod transform;

pub use job::{Job, MAX_CHANNELS, MAX_PARTS};
pub use layout::Layout;
pub use spread::Widths;
pub use transform::add_channels;
