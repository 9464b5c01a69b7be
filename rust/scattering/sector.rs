//! Sectors: parts of the field of view, each with an image plane and axes of its own.

use crate::antennas::array::Array;
use crate::rays::hits::Cast;
use crate::rays::scene::PosedScene;
use crate::scattering::refinement::Refinement;
use crate::scattering::reflection_table::Reflection;
use crate::scattering::surface_image::SurfaceImage;

/// Part of the field of view that samples cover by one image plane: all in axes whose x is normal to it.
///
/// Sectors differ in what depends on the axes alone: they have the bodies, the antennas and the settings in common.
#[derive(Clone, Copy)]
pub struct Sector<'a> {
    /// The bodies.
    pub scene: &'a PosedScene,
    /// Hits of the rays, from another program; none: rays are cast.
    pub image: Option<&'a SurfaceImage>,
    /// The antennas.
    pub array: &'a Array,
    /// Tables of the reflection coefficients of all bodies.
    pub reflections: &'a [Reflection],
    /// Options of casting.
    pub cast: Cast<'a>,
    /// Settings of the refinement.
    pub refinement: Refinement<'a>,
    /// Seed of random points and phases.
    pub seed: u64,
}
