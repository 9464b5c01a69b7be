//! Sectors: parts of the field of view, each with an image plane and axes of its own.

use crate::antennas::array::Array;
use crate::rays::hits::Cast;
use crate::rays::scene::PosedScene;
use crate::scattering::refinement::Refinement;

/// Part of the field of view that adaptive sampling covers by one image plane: all in axes whose x is normal to it.
///
/// Sectors differ in what depends on the axes alone: they have the bodies, the antennas and the settings in common.
#[derive(Clone, Copy)]
pub struct Sector<'a> {
    /// The bodies.
    pub scene: &'a PosedScene,
    /// The antennas.
    pub array: &'a Array,
    /// Options of casting.
    pub cast: Cast<'a>,
    /// Settings of the refinement.
    pub refinement: Refinement<'a>,
}
