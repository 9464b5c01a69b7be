//! Low-rank phases: what a moving path adds to its plane wave on the grid, as a combination of a few functions.

pub mod block_plan;
pub mod cross_approximation;
pub mod residual_phase;
