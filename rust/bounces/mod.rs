//! Paths of several reflections, by shooting and bouncing rays: docs/theory.md eqs. (7) to (9).
//!
//! A cell of the image launches a ray tube, and is quartered where more detail counts (`refine`). The tube goes from surface to surface by geometrical optics (`tube`,
//! `interaction`), carries a field (`field`), and at every surface after the first its footprint radiates
//! to every visible receiver by physical optics; `scattering` has the first reflection. The points of reflection
//! become a path of material points, which move with their bodies (`path`). A plane wave gives far fields
//! (`cross_section`; `first_reflection` integrates over triangles).

mod aspect;
mod cross_section;
mod direction;
mod field;
mod first_reflection;
mod interaction;
mod lattice;
mod launch;
mod path;
mod refine;
mod shooting;
mod tube;

pub use aspect::Aspect;
pub use cross_section::cross_sections;
pub use path::Bounces;
pub use refine::{CELLS_ACROSS, TubeImage};
pub use shooting::{Limits, TubeCounts};
