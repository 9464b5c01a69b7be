//! What is done for which paths: a plain value, chosen from bounds on the paths by a model of cost.
//!
//! Errors are relative to l2(amplitudes) of a channel and hold for paths whose phases have nothing to do with each
//! other; where many add up in phase, `beat` sees it in the result and asks for a smaller tolerance.

mod choose;
mod goal;
mod nufft;
mod parts;

pub use goal::{Request, fluctuation};
pub use parts::{Method, Part, Plan, Step};
