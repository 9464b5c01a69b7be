//! Samples of a scene for a frame: cells for the specular part, random points of the surfaces for the diffuse one.

use crate::antennas::array::Array;
use crate::antennas::beam::Beam;
use crate::error::Result;
use crate::rays::hits::{Cast, Counts};
use crate::rays::scene::PosedScene;
use crate::scattering::lambert::Speckle;
use crate::scattering::material::Material;
use crate::scattering::sampling::{Leaf, Quadtree, Refinement};

/// Cells and random points.
pub struct Samples {
    tree: Quadtree,
    /// Leaves of the quadtree with a hit.
    pub leaves: Vec<Leaf>,
    /// Random points of the bodies whose materials are diffuse.
    pub speckles: Vec<Option<Speckle>>,
    /// Counts of rays and of tiles.
    pub counts: Counts,
}

impl Samples {
    /// Cast rays by adaptive refinement and to the random points, drawn with `seed`. Samples of the frame `before` are
    /// reused where no body has moved since.
    pub fn new(
        snapshot: &PosedScene,
        cast: &Cast,
        materials: &[Material],
        array: &Array,
        refinement: &Refinement,
        seed: u64,
        before: Option<(&PosedScene, &Self)>,
    ) -> Result<Self> {
        refinement.check()?;
        let [u, v] = refinement.base.ranges();
        let in_front = |beam: &Beam| beam.in_front(|| snapshot.nearest_in_front(), u, v);
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
        let moved = before.and_then(|(before, _)| snapshot.moved(before));
        let previous = before.map(|(_, samples)| samples);
        let tree = Quadtree::grow(
            snapshot,
            cast,
            materials,
            array,
            refinement,
            previous.map(|samples| &samples.tree).zip(moved.as_ref()),
        )?;
        let mut counts = tree.counts;
        let mut speckles = Vec::with_capacity(materials.len());
        for (body, material) in materials.iter().enumerate() {
            if !material.is_diffuse() {
                speckles.push(None);
                continue;
            }
            let known = previous.and_then(|samples| samples.speckles[body].as_ref());
            let (speckle, more) = Speckle::new(snapshot, body as u32, cast, refinement, seed, known, moved.as_ref());
            counts = counts.plus(more);
            speckles.push(Some(speckle));
        }
        Ok(Self {
            leaves: tree.leaves(),
            tree,
            speckles,
            counts,
        })
    }

    /// Number of cells that could be split further.
    pub fn num_coarse(&self) -> usize {
        self.tree.num_coarse
    }
}
