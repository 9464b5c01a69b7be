//! Samples of a scene for a frame: tiles for the specular part, random points of the surfaces for the diffuse one.

use std::sync::Arc;

use crate::error::Result;
use crate::rays::hits::Counts;
use crate::rays::scene::PosedScene;
use crate::rays::tree::Tree;
use crate::scattering::lambert::Speckle;
use crate::scattering::material::Material;
use crate::scattering::refinement::Sampling;
use crate::scattering::sampling::Tiles;
use crate::scattering::sector::Sector;

/// Samples of the specular part, and random points.
pub struct SceneSamples {
    /// Refined tiles, with the material points of the specular part.
    pub tiles: Tiles,
    /// For every sector, random points of the bodies whose materials are diffuse.
    pub speckles: Vec<Vec<Option<Speckle>>>,
    /// Counts of rays and of tiles.
    pub counts: Counts,
}

impl SceneSamples {
    /// Cast rays through cells and to random points. Samples of the frame `before` are reused where no body has moved
    /// since.
    pub fn new(
        sectors: &[Sector],
        materials: &[Material],
        before: Option<(&[Arc<PosedScene>], &Self)>,
    ) -> Result<Self> {
        let before = before.filter(|(scenes, _)| scenes.len() == sectors.len());
        let moved: Option<Vec<Tree>> = before.and_then(|(scenes, _)| {
            let both = sectors.iter().zip(scenes);
            both.map(|(sector, before)| sector.scene.moved(before)).collect()
        });
        let previous = before.map(|(_, samples)| samples);
        let known = previous.map(|samples| &samples.tiles);
        let tiles = Tiles::new(sectors, materials, known.zip(moved.as_deref()))?;
        let mut counts = tiles.counts;
        let mut speckles: Vec<Vec<Option<Speckle>>> = Vec::with_capacity(sectors.len());
        for (number, sector) in sectors.iter().enumerate() {
            let mut of_sector = Vec::with_capacity(materials.len());
            for (body, material) in materials.iter().enumerate() {
                if !material.is_diffuse() || sector.sampling == Sampling::Point {
                    of_sector.push(None);
                    continue;
                }
                let before = previous.and_then(|samples| samples.speckles[number][body].as_ref());
                let drawn = speckles.first().map_or(before, |first| first[body].as_ref());
                let drawn = drawn.map(|speckle| &speckle.points);
                let (speckle, more) = Speckle::new(sector, body as u32, sector.seed, drawn);
                counts = counts.plus(more);
                of_sector.push(Some(speckle));
            }
            speckles.push(of_sector);
        }
        Ok(Self {
            tiles,
            speckles,
            counts,
        })
    }
}
