//! Processing where arrays are small and calls are many: tones in the cells about a peak, and the steps of a tracker.

pub mod assignment;
pub mod kalman;
pub mod matrix;
pub mod peaks;
pub mod spheres;
pub mod state_space;
pub mod targets;
pub mod tone_fit;
