//! Sums over paths chirp by chirp, many chirps side by side in the lanes of vectors.
//!
//! [`add_recurrence`] is the fast direct sum: every sample of every path, by phasors that turn from sample to sample.
//! [`LaneGrid`] spreads the paths over range, and transforms every chirp.

mod chirp_grid;
pub mod chirp_phases;
mod phasors;

pub use chirp_grid::{LaneGrid, WIDTHS};
pub use chirp_phases::{FLUSH, Job};
pub use phasors::add_recurrence;
