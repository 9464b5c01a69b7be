//! Samples of a frame, and images.

use std::sync::Arc;

use super::model::{Model, RaySampling, Source};
use crate::antennas::beam::Beam;
use crate::bounces::{self, Bounces, TubeImage};
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::paths::scatterers::Scatterers;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::{Cast, Hits};
use crate::rays::scene::PosedScene;
use crate::scattering::mesh_parts::MeshPart;
use crate::scattering::refinement::field_of;
use crate::scattering::samples::SceneSamples;
use crate::scattering::sector::Sector;
use crate::scattering::tile_point::NearestHit;

/// Samples of a frame: cells of tiles, and random points of rough surfaces.
pub struct Rays {
    /// The bodies in the axes of every sector.
    scenes: Vec<Arc<PosedScene>>,
    /// The samples.
    pub samples: SceneSamples,
}

impl Model {
    fn cast<'a>(&self, cancel: &'a Cancel) -> Cast<'a> {
        Cast {
            skip_empty: self.settings.debug.skip_empty,
            level: self.settings.debug.level,
            cancel: Some(cancel),
            ..Cast::default()
        }
    }

    /// Hits of the whole image.
    pub(super) fn cast_image(&self, scene: &PosedScene, cancel: &Cancel) -> Result<Hits> {
        scene.cast_image(&self.settings.image, &self.cast(cancel))
    }

    /// Hits of images of all sectors within the beam.
    fn cast_images(&self, scenes: &[Arc<PosedScene>], planes: &[ImagePlane], cancel: &Cancel) -> Result<Vec<Hits>> {
        let sectors = self.sectors.iter().zip(scenes).zip(planes);
        sectors
            .map(|((facing, scene), plane)| {
                plane.check()?;
                let beam = facing.beam_over(scene, plane);
                let is_outside = |u, v| beam.as_ref().is_some_and(|beam| beam.misses(u, v));
                let cast = Cast {
                    outside: beam.is_some().then_some(&is_outside),
                    ..self.cast(cancel)
                };
                scene.cast_image(plane, &cast)
            })
            .collect()
    }
}

impl Rays {
    /// Cast the rays of a frame, or of a part of one within which bodies turn by some angles [rad]; static tiles of the
    /// frame `before` are reused.
    pub fn cast(
        model: &Model,
        scene: &Arc<PosedScene>,
        turns: &[f64],
        before: Option<&Self>,
        cancel: &Cancel,
    ) -> Result<Self> {
        let settings = &model.settings;
        let RaySampling {
            planes,
            sampling,
            refinement,
        } = &settings.rays;
        // An image has the axes of the sensor, and all of it is seen.
        let image = match &model.source {
            Source::Scene(_) => None,
            Source::Depth(image) => Some(&**image),
        };
        let facing = if image.is_some() {
            &model.sectors[..1]
        } else {
            &model.sectors
        };
        let scenes: Vec<Arc<PosedScene>> = facing.iter().map(|sector| sector.scene(scene)).collect();
        let planes: Vec<ImagePlane> = match image {
            Some(image) => vec![image.plane],
            None => planes.clone(),
        };
        planes.iter().try_for_each(ImagePlane::check)?;
        let beams = facing.iter().zip(&scenes).zip(&planes);
        let beams: Vec<Option<Beam>> = beams
            .map(|((facing, scene), plane)| facing.beam_over(scene, plane).filter(|_| image.is_none()))
            .collect();
        let misses = beams
            .iter()
            .map(|beam| move |u, v| beam.as_ref().is_some_and(|beam| beam.misses(u, v)));
        let misses: Vec<_> = misses.collect();
        let sectors: Vec<Sector> = (0..scenes.len())
            .map(|number| Sector {
                scene: &scenes[number],
                image,
                array: &facing[number].array,
                reflections: &facing[number].reflections,
                cast: Cast {
                    outside: beams[number].is_some().then_some(&misses[number]),
                    ..model.cast(cancel)
                },
                plane: planes[number],
                beam: beams[number].as_ref(),
                sampling: *sampling,
                refinement: *refinement,
                join: if refinement.is_some() { model.join() } else { 0.0 },
                has_contours: true,
                skip_aliased: true,
                turns,
                seed: settings.seed,
            })
            .collect();
        let before = before.filter(|_| settings.debug.reuse_tiles && image.is_none());
        let before = before.map(|before| (&*before.scenes, &before.samples));
        let samples = SceneSamples::new(&sectors, &model.materials, before)?;
        Ok(Self { scenes, samples })
    }

    /// Material points of all samples that return power, ordered by `rank` of the body.
    pub fn scatterers(&self, model: &Model, rank: impl Fn(u32) -> u8) -> Scatterers {
        let sectors = self.scenes.iter().zip(&model.sectors);
        let sectors: Vec<_> = sectors.map(|(scene, facing)| (&**scene, &facing.array)).collect();
        let range_rates = match &model.source {
            Source::Scene(_) => None,
            Source::Depth(image) => image.range_rate.as_deref(),
        };
        let array = model.array.clone();
        Scatterers::of_samples(&sectors, &self.samples, &model.materials, array, rank, range_rates)
    }

    /// Paths of several reflections, from images of their own.
    pub fn bounces(&self, model: &Model, cancel: &Cancel) -> Result<(Bounces, bounces::TubeCounts)> {
        let (array, limits, materials) = (&model.array, model.settings.limits, &model.materials);
        if limits.max_bounces <= 1 || matches!(model.source, Source::Depth(_)) {
            return Ok((Bounces::empty(array.clone()), bounces::TubeCounts::default()));
        }
        let scenes = &self.scenes;
        let images = model.cast_images(scenes, &model.settings.tubes, cancel)?;
        // The first sector has the axes of the sensor.
        let (sampling, refinement) = (model.settings.rays.sampling, model.settings.rays.refinement);
        let wavelength = SPEED_OF_LIGHT / array.frequency;
        let field = refinement.map_or(f64::INFINITY, |refinement| field_of(refinement.rcs_floor, wavelength));
        let each = images.iter().zip(scenes).zip(&model.sectors);
        let tube_images: Vec<TubeImage> = each
            .map(|((hits, scene), facing)| TubeImage {
                rotation: facing.rotation.transpose(),
                hits,
                parts: if field.is_finite() {
                    MeshPart::small(scene, &hits.plane, field, bounces::CELLS_ACROSS)
                } else {
                    Vec::new()
                },
            })
            .collect();
        Ok(Bounces::new(
            &scenes[0],
            &tube_images,
            materials,
            array,
            limits,
            sampling,
            field,
        ))
    }

    /// Nearest hit of every body with a hit, the first of equal ones, and the scene in which it was hit.
    pub fn nearest(&self) -> Vec<(&PosedScene, NearestHit)> {
        let nearest = self.samples.tiles.nearest.iter();
        nearest.map(|hit| (&*self.scenes[hit.sector], *hit)).collect()
    }
}
