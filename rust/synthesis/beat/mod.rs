//! Beat signal of a set of paths: input checks, planning, summation, and repetition until the tolerance is reached.

mod job;
mod lanes;
mod run;
mod signal;

pub use job::{Options, Report, Samples};
pub use lanes::{LaneLayer, LaneSum, SomePaths, Work, batch};
pub use signal::{SINGLE_TOLERANCE, beat_signal, is_worth_threads, plan};
