//! Sums in lanes: every path spread over range in 16 chirps at once, one transform over range per chirp, and no plan.
//!
//! Within a chirp a path is a tone, whose phase and frequency in the middle of every chirp follow from a short series
//! over the frame. A [`Record`] of 64 bytes has the coefficients; [`Tables`] have what multiplies them, the same for all
//! paths. The tone is spread over a few cells of a periodic grid of ranges; the transform of the grid, divided by that of
//! the kernel, has its samples. What stands still is spread once for all chirps.
//!
//! The error is known before the sum: that of the kernel, and what the series leave out, see [`Errors`].

mod errors;
mod kernel;
mod record;
mod spread;
mod sum;
mod tables;
mod transform;

pub use errors::Errors;
pub use record::{Batch, Builder, Coefficients, Record};
pub use sum::{Layer, Steps, add_samples};
pub use tables::{MOST_TERMS, Tables};
