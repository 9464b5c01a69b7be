//! Sampling: tiles of 8 x 8 cells of the image plane, refined where the residual error of a quarter is large.
//!
//! Every cell has a ray through its centre, and the hit represents the cell with a phase that varies linearly over it
//! (docs/theory.md eq. (2) and its footprint). Adjacent cells of a tile are compared: where they differ by more than
//! that allows, and the field of the cells is large enough to matter, the quarter of 4 x 4 cells becomes a tile of half
//! the cell size. Of that tile only those packets of 4 x 4 rays are cast whose surface may return power. Where the phase
//! of cells turns so fast that tapers leave nothing of them for several levels, the residual error after these decides.
//! All other quarters keep their material points; points whose phases differ little are joined. A tile depends on the
//! surfaces that its rays meet alone, so that tiles are independent tasks, and static ones are taken over from the frame
//! before. Without refinement the tiles of the base level are pixels, of a scene or of an image of another program.
//! Flat regions that nothing occludes are integrated along their outline instead.

mod border;
mod cells;
mod context;
mod contour;
mod join;
mod level;
mod points;
mod refine;
mod residual;
mod small_parts;
mod tile;
mod tile_index;

pub use refine::{PointRange, Tiles};

#[cfg(test)]
mod tests;
