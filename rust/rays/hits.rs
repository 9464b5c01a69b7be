//! Hits of the pixels of an image, and options of how they are cast.

use crate::numeric::simd::Level;
use crate::rays::camera::ImagePlane;
use crate::rays::packet::TileRays;
use crate::rays::scene::PosedScene;

/// Hits of all pixels of an image, row by row.
pub struct Hits {
    /// The image they belong to.
    pub plane: ImagePlane,
    /// Distance along the ray [m]; infinite where nothing was hit.
    pub distance: Vec<f64>,
    /// Number of the body, or [`NO_BODY`].
    pub body: Vec<u32>,
    /// Number of the triangle in the body's surface.
    pub triangle: Vec<u32>,
    /// Cosine of incidence, zero where nothing was hit; where these were wanted.
    pub cosine: Option<Vec<f64>>,
    /// What was done for them.
    pub counts: Counts,
}

/// What the hits of an image took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rays that searched a tree.
    pub rays: usize,
    /// Tiles in which there is no body, or nothing to be seen through the antennas.
    pub tiles_skipped: usize,
    /// Tiles taken over from the hits before.
    pub tiles_reused: usize,
}

impl Counts {
    /// Both together.
    pub fn plus(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            tiles_skipped: self.tiles_skipped + other.tiles_skipped,
            tiles_reused: self.tiles_reused + other.tiles_reused,
        }
    }
}

/// Whether all directions `(1, u, v)` within ranges of u and of v are of no interest.
pub type Outside<'a> = dyn Fn([f64; 2], [f64; 2]) -> bool + Sync + 'a;

/// How rays are cast; nothing of it changes what they hit, but for those outside.
#[derive(Clone, Copy)]
pub struct Cast<'a> {
    /// Instruction set.
    pub level: Level,
    /// Whether tiles without bodies are left out.
    pub skip_empty: bool,
    /// Directions that are not cast.
    pub outside: Option<&'a Outside<'a>>,
    /// Whether cosines of incidence are wanted as well.
    pub with_cosines: bool,
    /// How the rays of a tile search the tree of a body.
    pub traversals: Traversals,
    /// Hits of another time with the same directions outside. Tiles are taken over if no body has moved there.
    pub previous: Option<(&'a PosedScene, &'a Hits)>,
}

/// How the rays of a tile search the tree of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversals {
    /// As is faster, by how many leaves of the body were in the tiles before.
    Chosen,
    /// 8 x 8 rays on one walk.
    Together,
    /// Four walks of 4 x 4 rays.
    Apart,
}

impl Cast<'_> {
    /// Whether no ray of a tile is of interest.
    pub(super) fn is_outside(&self, rays: &TileRays) -> bool {
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
        }
    }
}
