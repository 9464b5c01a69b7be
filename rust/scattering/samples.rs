//! Samples of a scene for a frame: tiles for the specular part, random points of the surfaces for the diffuse one.

use std::sync::Arc;

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
use crate::scattering::sector::Sector;

/// Samples of the specular part.
pub enum Specular {
    /// Refined tiles, with material points.
    Tiles(Tiles),
    /// For every sector a quadtree and its leaves with a hit, whose fast phases are integrated by edge terms.
    Quadtrees(Vec<(Quadtree, Vec<Leaf>)>),
}

/// Samples of the specular part, and random points.
pub struct Samples {
    /// Samples of the specular part.
    pub specular: Specular,
    /// For every sector, random points of the bodies whose materials are diffuse.
    pub speckles: Vec<Vec<Option<Speckle>>>,
    /// Counts of rays and of tiles.
    pub counts: Counts,
}

impl Samples {
    /// Cast rays by adaptive refinement and to the random points, drawn with `seed`. Samples of the frame `before` are
    /// reused where no body has moved since.
    pub fn new(
        sectors: &[Sector],
        materials: &[Material],
        seed: u64,
        before: Option<(&[Arc<PosedScene>], &Self)>,
    ) -> Result<Self> {
        let mut beams = Vec::with_capacity(sectors.len());
        for Sector { scene, refinement, .. } in sectors {
            refinement.check()?;
            let [u, v] = refinement.base.ranges();
            let in_front = |beam: &Beam| beam.in_front(|| scene.nearest_in_front(), u, v);
            beams.push(refinement.beam.and_then(in_front));
        }
        let outside: Vec<_> = beams
            .iter()
            .map(|beam: &Option<Beam>| move |u, v| beam.as_ref().is_some_and(|beam| beam.misses(u, v)))
            .collect();
        let in_beam = sectors.iter().zip(&beams).zip(&outside);
        let sectors: Vec<Sector> = in_beam
            .map(|((sector, beam), outside)| Sector {
                cast: Cast {
                    outside: beam.is_some().then_some(outside),
                    ..sector.cast
                },
                refinement: Refinement {
                    beam: beam.as_ref(),
                    ..sector.refinement
                },
                ..*sector
            })
            .collect();
        let before = before.filter(|(scenes, _)| scenes.len() == sectors.len());
        let moved: Option<Vec<Tree>> = before.and_then(|(scenes, _)| {
            let both = sectors.iter().zip(scenes);
            both.map(|(sector, before)| sector.scene.moved(before)).collect()
        });
        let previous = before.map(|(_, samples)| samples);
        let known = previous.map(|samples| &samples.specular);
        let specular = Specular::new(&sectors, materials, known.zip(moved.as_deref()))?;
        let mut counts = specular.counts();
        let mut speckles: Vec<Vec<Option<Speckle>>> = Vec::with_capacity(sectors.len());
        for (number, sector) in sectors.iter().enumerate() {
            let mut of_sector = Vec::with_capacity(materials.len());
            for (body, material) in materials.iter().enumerate() {
                if !material.is_diffuse() {
                    of_sector.push(None);
                    continue;
                }
                let known = previous.and_then(|samples| samples.speckles[number][body].as_ref());
                let drawn = speckles.first().and_then(|first| first[body].as_ref());
                let drawn = drawn.map(|speckle| &speckle.points);
                let moved = moved.as_ref().map(|moved| &moved[number]);
                let (speckle, more) = Speckle::new(sector, body as u32, seed, drawn, known, moved);
                counts = counts.plus(more);
                of_sector.push(Some(speckle));
            }
            speckles.push(of_sector);
        }
        Ok(Self {
            specular,
            speckles,
            counts,
        })
    }
}

impl Specular {
    fn new(sectors: &[Sector], materials: &[Material], previous: Option<(&Self, &[Tree])>) -> Result<Self> {
        let refinement = &sectors[0].refinement;
        if !refinement.end_points {
            let known = match previous {
                Some((Self::Tiles(tiles), moved)) => Some((tiles, moved)),
                _ => None,
            };
            return Tiles::new(sectors, materials, known).map(Self::Tiles);
        }
        let num_cells = |sector: &Sector| sector.refinement.base.num_pixels();
        let all: usize = sectors.iter().map(num_cells).sum();
        let grow = |(number, sector): (usize, &Sector)| {
            let known = match previous {
                Some((Self::Quadtrees(trees), moved)) => Some((&trees[number].0, &moved[number])),
                _ => None,
            };
            // Every sector has the share of the budget that it has of the base grid.
            let share = num_cells(sector) as f64 / all as f64;
            let share = |budget: usize| ((budget as f64 * share) as usize).max(num_cells(sector));
            let refinement = Refinement {
                budget: sector.refinement.budget.map(share),
                ..sector.refinement
            };
            let (scene, cast, array) = (sector.scene, &sector.cast, sector.array);
            let tree = Quadtree::grow(scene, cast, materials, array, &refinement, known)?;
            let leaves = tree.leaves();
            Ok((tree, leaves))
        };
        let trees: Result<_> = sectors.iter().enumerate().map(grow).collect();
        trees.map(Self::Quadtrees)
    }

    /// Counts of rays and of tiles.
    pub fn counts(&self) -> Counts {
        match self {
            Self::Tiles(tiles) => tiles.counts,
            Self::Quadtrees(trees) => trees
                .iter()
                .fold(Counts::default(), |all, (tree, _)| all.plus(tree.counts)),
        }
    }

    /// Number of cells with too large a residual error, which the finest level or the budget left.
    pub fn num_coarse(&self) -> usize {
        match self {
            Self::Tiles(tiles) => tiles.num_coarse,
            Self::Quadtrees(trees) => {
                let coarse = trees.iter().filter(|(tree, _)| tree.allowed > 1.0);
                coarse.map(|(tree, _)| tree.num_coarse).sum()
            }
        }
    }

    /// Number of cells that hit a body, and of those with a material point where that is known.
    pub fn num_hit(&self) -> (usize, Option<usize>) {
        match self {
            Self::Tiles(tiles) => (tiles.num_hit, Some(tiles.num_lit)),
            Self::Quadtrees(trees) => (trees.iter().map(|(_, leaves)| leaves.len()).sum(), None),
        }
    }

    /// Distance of the hit of a leaf of the quadtrees, one after the other [m]; 0 otherwise.
    pub fn distance(&self, leaf: u32) -> f64 {
        let mut index = leaf as usize;
        let Self::Quadtrees(trees) = self else { return 0.0 };
        for (_, leaves) in trees {
            match leaves.get(index) {
                Some(leaf) => return leaf.found.to_facet,
                None => index -= leaves.len(),
            }
        }
        0.0
    }

    /// Nearest hits of all bodies with a hit, the first of equal ones, by body.
    pub fn nearest(&self) -> Vec<Nearest> {
        match self {
            Self::Tiles(tiles) => tiles.nearest.clone(),
            Self::Quadtrees(trees) => {
                let hits = trees.iter().enumerate().flat_map(|(sector, (_, leaves))| {
                    leaves.iter().map(move |leaf| Nearest {
                        body: leaf.found.body,
                        triangle: leaf.found.triangle,
                        distance: leaf.found.to_facet,
                        cell: leaf.cell,
                        sector,
                    })
                });
                nearest_of(hits)
            }
        }
    }
}
