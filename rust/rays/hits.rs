//! Hits of the pixels of an image, and options of casting.

use crate::cancel::Cancel;
use crate::numeric::simd::Level;
use crate::rays::camera::ImagePlane;
use crate::rays::packet::TileRays;
use crate::rays::packet_search::Traversals;
use crate::rays::scene::PosedScene;

/// Hits of all pixels of an image, row by row.
pub struct Hits {
    /// Image plane of the hits.
    pub plane: ImagePlane,
    /// Distance along the ray [m]; infinite where nothing was hit.
    pub distance: Vec<f64>,
    /// Number of the body, or [`NO_BODY`].
    pub body: Vec<u32>,
    /// Number of the triangle in the body's surface.
    pub triangle: Vec<u32>,
    /// Cosine of incidence, zero where nothing was hit; only if asked for.
    pub cosine: Option<Vec<f64>>,
    /// Work done for the hits.
    pub counts: Counts,
}

/// Work done for the hits of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rays that searched a tree.
    pub rays: usize,
    /// Tiles without bodies, or outside the beam of the antennas.
    pub tiles_skipped: usize,
    /// Tiles copied from previous hits.
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
    /// Option to compute cosines of incidence.
    pub with_cosines: bool,
    /// Traversal of the tree of a body by the rays of a tile.
    pub traversals: Traversals,
    /// Scene and hits of another time with the same directions outside. Tiles where no body has moved are copied.
    pub previous: Option<(&'a PosedScene, &'a Hits)>,
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
            with_cosines: false,
            traversals: Traversals::Chosen,
            previous: None,
            cancel: None,
        }
    }
}
