//! The beat signal of a set of paths: checks the input, plans, runs the plan and sees to the tolerance.

mod job;
mod run;
mod signal;

pub use job::{Options, Samples};
pub use signal::{Report, SINGLE_TOLERANCE, beat_signal, is_worth_threads, plan};
