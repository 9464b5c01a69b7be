//! Sectors: parts of the field of view, each with an image plane and axes of its own.

use crate::antennas::array::Array;
use crate::antennas::beam::Beam;
use crate::error::{Result, fits_memory};
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Cast;
use crate::rays::scene::PosedScene;
use crate::scattering::refinement::{Refinement, Sampling};
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
    /// Coarsest cells.
    pub plane: ImagePlane,
    /// Directions with enough gain; none: all.
    pub beam: Option<&'a Beam>,
    /// Sampling of a cell.
    pub sampling: Sampling,
    /// Settings of the refinement; none: no cell is split.
    pub refinement: Option<Refinement>,
    /// Largest difference of the phases of joined points from their mean, below half a turn [rad]; 0: no points are
    /// joined.
    pub join: f64,
    /// Option to integrate flat regions along their outline, where cells are refined.
    pub has_contours: bool,
    /// Option to leave out the parts of split quarters whose rays cannot return power.
    pub skip_aliased: bool,
    /// Angle by which every body turns from the cast to the ends of its use, seen from the sensor [rad].
    pub turns: &'a [f64],
    /// Seed of random points and phases.
    pub seed: u64,
}

impl Sector<'_> {
    /// Check plane, settings and image.
    pub fn check(&self) -> Result<()> {
        self.plane.check()?;
        // Bytes of a cell, at least.
        fits_memory("cells", &[self.plane.rows, self.plane.columns], 256)?;
        self.refinement
            .map_or(Ok(()), |refinement| refinement.check(&self.plane))?;
        self.image.map_or(Ok(()), SurfaceImage::check)
    }
}
