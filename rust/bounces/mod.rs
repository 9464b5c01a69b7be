//! Paths of several reflections, by shooting and bouncing rays: README eqs. (7) to (9).
//!
//! A cell of the image launches a ray tube. It goes from surface to surface as geometrical optics says (`tube`,
//! `interaction`), carries a field (`field`), and at every surface after the first its footprint sends on what physical
//! optics says to every receiver that is in sight: the first reflection is that of `scattering`. The places where it was
//! reflected become a path of material points, which move with their bodies (`path`).

mod cross_section;
mod direction;
mod field;
mod interaction;
mod launch;
mod path;
mod shooting;
mod tube;

pub use cross_section::{Aspect, cross_sections};
pub use launch::Launch;
pub use path::Bounces;
pub use shooting::{Counts, Limits};
