//! Samples of a scene for a frame: tiles for the specular part, random points of the surfaces for the diffuse one.

use crate::antennas::array::Array;
use crate::antennas::beam::Beam;
use crate::error::Result;
use crate::rays::hits::{Cast, Counts};
use crate::rays::scene::PosedScene;
use crate::rays::tree::Tree;
use crate::scattering::lambert::Speckle;
use crate::scattering::material::Material;
use crate::scattering::quadtree::{Leaf, Quadtree};
use crate::scattering::refinement::Refinement;
use crate::scattering::sampling::{Nearest, Tiles, nearest_of};

/// Samples of the specular part.
pub enum Specular {
    /// Refined tiles, with material points.
    Tiles(Tiles),
    /// A quadtree and its leaves with a hit, whose fast phases are integrated by edge terms.
    Quadtree(Quadtree, Vec<Leaf>),
}

/// Samples of the specular part, and random points.
pub struct Samples {
    /// Samples of the specular part.
    pub specular: Specular,
    /// Random points of the bodies whose materials are diffuse.
    pub speckles: Vec<Option<Speckle>>,
    /// Counts of rays and of tiles.
    pub counts: Counts,
}

impl Samples {
    /// Cast rays by adaptive refinement and to the random points, drawn with `seed`. Samples of the frame `before` are
    /// reused where no body has moved since.
    pub fn new(
        scene: &PosedScene,
        cast: &Cast,
        materials: &[Material],
        array: &Array,
        refinement: &Refinement,
        seed: u64,
        before: Option<(&PosedScene, &Self)>,
    ) -> Result<Self> {
        refinement.check()?;
        let [u, v] = refinement.base.ranges();
        let in_front = |beam: &Beam| beam.in_front(|| scene.nearest_in_front(), u, v);
        let beam = refinement.beam.and_then(in_front);
        let refinement = &Refinement {
            beam: beam.as_ref(),
            ..*refinement
        };
        let is_outside = |u, v| beam.as_ref().is_some_and(|beam| beam.misses(u, v));
        let cast = &Cast {
            outside: beam.is_some().then_some(&is_outside),
            ..*cast
        };
        let moved = before.and_then(|(before, _)| scene.moved(before));
        let previous = before.map(|(_, samples)| samples);
        let known = previous.map(|samples| &samples.specular);
        let specular = Specular::new(scene, cast, materials, array, refinement, known.zip(moved.as_ref()))?;
        let mut counts = specular.counts();
        let mut speckles = Vec::with_capacity(materials.len());
        for (body, material) in materials.iter().enumerate() {
            if !material.is_diffuse() {
                speckles.push(None);
                continue;
            }
            let known = previous.and_then(|samples| samples.speckles[body].as_ref());
            let (speckle, more) = Speckle::new(scene, body as u32, cast, refinement, seed, known, moved.as_ref());
            counts = counts.plus(more);
            speckles.push(Some(speckle));
        }
        Ok(Self {
            specular,
            speckles,
            counts,
        })
    }
}

impl Specular {
    fn new(
        scene: &PosedScene,
        cast: &Cast,
        materials: &[Material],
        array: &Array,
        refinement: &Refinement,
        previous: Option<(&Self, &Tree)>,
    ) -> Result<Self> {
        if refinement.end_points {
            let known = match previous {
                Some((Self::Quadtree(tree, _), moved)) => Some((tree, moved)),
                _ => None,
            };
            let tree = Quadtree::grow(scene, cast, materials, array, refinement, known)?;
            let leaves = tree.leaves();
            return Ok(Self::Quadtree(tree, leaves));
        }
        let known = match previous {
            Some((Self::Tiles(tiles), moved)) => Some((tiles, moved)),
            _ => None,
        };
        Tiles::new(scene, cast, materials, array, refinement, known).map(Self::Tiles)
    }

    /// Counts of rays and of tiles.
    pub fn counts(&self) -> Counts {
        match self {
            Self::Tiles(tiles) => tiles.counts,
            Self::Quadtree(tree, _) => tree.counts,
        }
    }

    /// Number of cells with too large a residual error, which the finest level or the budget left.
    pub fn num_coarse(&self) -> usize {
        match self {
            Self::Tiles(tiles) => tiles.num_coarse,
            Self::Quadtree(tree, _) if tree.allowed > 1.0 => tree.num_coarse,
            Self::Quadtree(..) => 0,
        }
    }

    /// Number of cells that hit a body, and of those with a material point where that is known.
    pub fn num_hit(&self) -> (usize, Option<usize>) {
        match self {
            Self::Tiles(tiles) => (tiles.num_hit, Some(tiles.num_lit)),
            Self::Quadtree(_, leaves) => (leaves.len(), None),
        }
    }

    /// Distance of the hit of a leaf of a quadtree [m]; 0 otherwise.
    pub fn distance(&self, leaf: u32) -> f64 {
        match self {
            Self::Quadtree(_, leaves) => leaves.get(leaf as usize).map_or(0.0, |leaf| leaf.found.to_facet),
            Self::Tiles(_) => 0.0,
        }
    }

    /// Nearest hits of all bodies with a hit, the first of equal ones, by body.
    pub fn nearest(&self) -> Vec<Nearest> {
        match self {
            Self::Tiles(tiles) => tiles.nearest.clone(),
            Self::Quadtree(_, leaves) => {
                let hit = |leaf: &Leaf| Nearest {
                    body: leaf.found.body,
                    triangle: leaf.found.triangle,
                    distance: leaf.found.to_facet,
                    cell: leaf.cell,
                };
                nearest_of(leaves.iter().map(hit))
            }
        }
    }
}
