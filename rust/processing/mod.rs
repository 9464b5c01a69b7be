//! Processing where arrays are small and calls are many: tones and peaks in the cells of a map.

pub mod peaks;
pub mod spheres;
pub mod tone_fit;
