//! Hits of the pixels of an image, and options of casting.

use crate::cancel::Cancel;
use crate::numeric::simd::Level;
use crate::rays::camera::ImagePlane;
use crate::rays::packet::TileRays;

/// Hits of all pixels of an image, row by row.
pub struct Hits {
    /// Image plane of the hits.
    pub plane: ImagePlane,
    /// Distance along the ray [m]; infinite where nothing was hit.
    pub distance: Vec<f64>,
    /// Cosine of incidence; zero where nothing was hit.
    pub cosine: Vec<f64>,
    /// Number of the body, or [`NO_BODY`].
    pub body: Vec<u32>,
    /// Number of the triangle in the body's surface.
    pub triangle: Vec<u32>,
    /// Distance along the ray to the curved surface that the triangles approximate [m]; infinite where nothing was hit.
    pub surface_distance: Vec<f64>,
    /// Unit normal of the curved surface on the incident side, in the sensor frame; zero where nothing was hit.
    pub normal: Vec<[f64; 3]>,
}

/// Work done for hits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rays that searched a tree.
    pub rays: usize,
    /// Tiles without bodies, or outside the beam of the antennas.
    pub tiles_skipped: usize,
    /// Tiles taken over from another time.
    pub tiles_reused: usize,
}

impl Counts {
    /// Sum of two counts.
    pub fn plus(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            tiles_skipped: self.tiles_skipped + other.tiles_skipped,
            tiles_reused: self.tiles_reused + other.tiles_reused,
        }
    }
}

/// Predicate of ranges of u and of v: true if no direction `(1, u, v)` within them is of interest.
pub type Outside<'a> = dyn Fn([f64; 2], [f64; 2]) -> bool + Sync + 'a;

/// Options of casting. Only `outside` changes hits: directions outside have none.
#[derive(Clone, Copy)]
pub struct Cast<'a> {
    /// Instruction set.
    pub level: Level,
    /// Option to leave out tiles without bodies.
    pub skip_empty: bool,
    /// Predicate of directions that are not cast.
    pub outside: Option<&'a Outside<'a>>,
    /// Request to stop.
    pub cancel: Option<&'a Cancel>,
}

impl Cast<'_> {
    /// True if no ray of a tile is of interest.
    pub(crate) fn is_outside(&self, rays: &TileRays) -> bool {
        let [u, v] = rays.ranges();
        self.outside.is_some_and(|is_outside| is_outside(u, v))
    }
}

impl Default for Cast<'_> {
    fn default() -> Self {
        Self {
            level: Level::best(),
            skip_empty: true,
            outside: None,
            cancel: None,
        }
    }
}
