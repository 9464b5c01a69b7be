//! Adaptive sampling with edge terms: a quadtree of cells of the image plane, refined where the residual error of a cell is large.
//!
//! Every cell has a ray through its centre, and the hit represents the cell with a phase that varies linearly over it
//! (docs/theory.md eq. (2) and its footprint). A cell is compared with its neighbours: where they differ by more than
//! that allows, and the cell's part of the sum is large enough to matter, it is split in four. All cells of a round are
//! one batch of rays.

mod cells;
mod criterion;
mod edge_terms;
mod pairs;
mod refine;

pub use cells::{Leaf, Quadtree};

#[cfg(test)]
mod tests;
