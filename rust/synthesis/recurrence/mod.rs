//! Recurrence sum and chirp grid: sums over paths chirp by chirp, with chirps in the lanes of vectors.
//!
//! [`add_recurrence`] sums every sample of every path, by recurrences of phasors from sample to sample.
//! [`LaneGrid`] spreads the paths over range and transforms every chirp.

mod chirp_grid;
pub mod chirp_phases;
mod phasors;

pub use chirp_grid::{LaneGrid, WIDTHS};
pub use chirp_phases::{FLUSH, Job};
pub use phasors::add_recurrence;
