//! Plans of a sum over paths: a method for every class of paths, chosen by a model of cost from statistics of the
//! paths.
//!
//! Errors are relative to l2(amplitudes) of a channel and hold for paths of independent phases. Where many paths add up
//! in phase, `beat` measures the gain in the result and asks for a smaller tolerance.

mod choose;
mod goal;
mod nufft;
mod parts;

pub use goal::{Request, fluctuation};
pub use parts::{Method, Part, Plan, Step};
