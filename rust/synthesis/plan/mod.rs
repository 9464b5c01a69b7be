//! Plans of a sum over paths: a method for every class of paths, chosen by a model of cost from statistics of the
//! paths.
//!
//! Errors are relative to l2(amplitudes) of a channel. Those of a spreading kernel hold whatever the phases of the
//! paths, see [`super::coherence`]; others for paths of independent phases, or with the gain that `beat` measures in
//! the result where many paths add up in phase.

mod choose;
mod goal;
mod nufft;
mod parts;
pub mod times;

pub use choose::share;
pub use goal::{Request, SINGLE_EQUAL_SUM, fluctuation};
pub use nufft::kernel_error;
pub use parts::{Method, Part, Plan, Step, in_phase};
