//! Low-rank residual phases: the departure of moving paths from their plane waves, as combinations of a few functions.

pub mod block_plan;
pub mod cross_approximation;
pub mod residual_phase;
