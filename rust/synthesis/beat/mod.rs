//! Beat signal of a set of paths: input checks, planning, summation, and repetition until the tolerance is reached.

mod job;
mod run;
mod signal;

pub use job::{Options, Samples};
pub use signal::{Report, SINGLE_TOLERANCE, beat_signal, is_worth_threads, plan};
