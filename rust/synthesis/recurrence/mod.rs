//! Recurrence sum: sums over paths chirp by chirp, with chirps in the lanes of vectors.
//!
//! [`add_recurrence`] sums every sample of every path, by recurrences of phasors from sample to sample.

pub mod chirp_phases;
mod phasors;

pub use chirp_phases::Job;
pub use phasors::add_recurrence;
