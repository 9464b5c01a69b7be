//! Rays of a frame and of images, and their hits.

use std::sync::{Arc, OnceLock};

use super::model::{Model, RaySampling, Source};
use crate::antennas::beam::Beam;
use crate::bounces::{self, Bounces, TubeImage};
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::paths::scatterers::Scatterers;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::{Cast, Hits};
use crate::rays::scene::{NO_BODY, PosedScene};
use crate::rays::smooth_hits::SmoothHits;
use crate::scattering::mesh_parts::MeshPart;
use crate::scattering::physical_optics::Sampling;
use crate::scattering::refinement::{Refinement, field_of};
use crate::scattering::samples::Samples;
use crate::scattering::sampling::{Nearest, nearest_of};
use crate::scattering::sector::Sector;

/// Hits of the pixels of an image.
pub struct Image {
    /// The bodies.
    pub scene: Arc<PosedScene>,
    /// The hits.
    pub hits: Hits,
    beam: Option<Beam>,
    smooth: OnceLock<SmoothHits>,
}

impl Image {
    /// Cast the rays of an image; static tiles of the image `before` are reused.
    fn cast(
        scene: Arc<PosedScene>,
        plane: &ImagePlane,
        beam: Option<&Beam>,
        cast: &Cast,
        before: Option<&Self>,
    ) -> Result<Self> {
        plane.check()?;
        let [u, v] = plane.ranges();
        let beam = beam.and_then(|beam| beam.in_front(|| scene.nearest_in_front(), u, v));
        let is_outside = |u, v| beam.as_ref().is_some_and(|beam| beam.misses(u, v));
        let cast = Cast {
            outside: beam.is_some().then_some(&is_outside),
            previous: before
                .filter(|before| before.beam == beam)
                .map(|before| (&*before.scene, &before.hits)),
            ..*cast
        };
        let hits = scene.cast_image_with(plane, &cast)?;
        Ok(Self {
            scene,
            hits,
            beam,
            smooth: OnceLock::new(),
        })
    }

    /// Distances and normals of the curved surfaces that the triangles approximate, until a request to stop; computed
    /// once.
    pub fn smooth(&self, cancel: &Cancel) -> Result<&SmoothHits> {
        if let Some(smooth) = self.smooth.get() {
            return Ok(smooth);
        }
        let smooth = SmoothHits::until(&self.scene, &self.hits, cancel)?;
        Ok(self.smooth.get_or_init(|| smooth))
    }

    /// Nearest hit of every body with a hit, the first of equal ones; `sector`: number of the image.
    fn nearest(&self, sector: usize) -> Vec<Nearest> {
        let hits = &self.hits;
        let mut nearest = vec![(f64::INFINITY, 0); self.scene.num_bodies()];
        for (pixel, (body, distance)) in hits.body.iter().zip(&hits.distance).enumerate() {
            if *body != NO_BODY && *distance < nearest[*body as usize].0 {
                nearest[*body as usize] = (*distance, pixel);
            }
        }
        let seen = nearest.into_iter().zip(0..);
        seen.filter(|((distance, _), _)| distance.is_finite())
            .map(|((distance, pixel), body)| Nearest {
                body,
                triangle: hits.triangle[pixel],
                distance,
                cell: hits.plane.cell(pixel / hits.plane.columns, pixel % hits.plane.columns),
                sector,
            })
            .collect()
    }
}

/// Rays of a frame and their hits.
pub enum Rays {
    /// Cells of adaptive sampling, and random points of rough surfaces; the bodies in the axes of every sector.
    Cells(Vec<Arc<PosedScene>>, Box<Samples>),
    /// Pixels, of every sector.
    Pixels(Vec<Image>),
    /// No rays: the surfaces are pixels of a depth image.
    None,
}

impl Model {
    fn cast<'a>(&self, cancel: &'a Cancel) -> Cast<'a> {
        Cast {
            skip_empty: self.settings.skip_empty,
            cancel: Some(cancel),
            ..Cast::default()
        }
    }

    /// Cast the rays of images of all sectors within the beam; static tiles of the images `before` are reused.
    fn cast_images(
        &self,
        scene: &Arc<PosedScene>,
        planes: &[ImagePlane],
        before: &[Image],
        cancel: &Cancel,
    ) -> Result<Vec<Image>> {
        let sectors = self.sectors.iter().zip(planes).enumerate();
        sectors
            .map(|(number, (facing, plane))| {
                let (beam, before) = (facing.beam.as_ref(), before.get(number));
                Image::cast(facing.scene(scene), plane, beam, &self.cast(cancel), before)
            })
            .collect()
    }

    /// Cast the whole image, with cosines of incidence.
    pub(super) fn cast_image(&self, scene: Arc<PosedScene>, before: Option<&Image>, cancel: &Cancel) -> Result<Image> {
        let cast = Cast {
            with_cosines: true,
            ..self.cast(cancel)
        };
        let before = before.filter(|_| self.settings.reuse_tiles);
        Image::cast(scene, &self.settings.image, None, &cast, before)
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
        if let Source::Depth(_) = &model.source {
            return Ok(Self::None);
        }
        let before = before.filter(|_| model.settings.reuse_tiles);
        let facing = &model.sectors;
        match &model.settings.rays {
            RaySampling::Adaptive {
                base,
                rcs_floor,
                follows_echo,
                budget,
                end_points,
            } => {
                let scenes: Vec<Arc<PosedScene>> = facing.iter().map(|sector| sector.scene(scene)).collect();
                let refinement = Refinement {
                    base: base[0],
                    rcs_floor: *rcs_floor,
                    follows_echo: *follows_echo,
                    budget: *budget,
                    end_points: *end_points,
                    beam: None,
                    join: model.join(),
                    skip_dark: true,
                    turns,
                    reflections: &[],
                };
                let sectors: Vec<Sector> = scenes
                    .iter()
                    .zip(facing)
                    .zip(base)
                    .map(|((scene, facing), base)| Sector {
                        scene,
                        array: &facing.array,
                        cast: model.cast(cancel),
                        refinement: Refinement {
                            base: *base,
                            beam: facing.beam.as_ref(),
                            reflections: &facing.reflections,
                            ..refinement
                        },
                    })
                    .collect();
                let before = match before {
                    Some(Self::Cells(scenes, samples)) => Some((&**scenes, &**samples)),
                    _ => None,
                };
                let samples = Samples::new(&sectors, &model.materials, model.settings.seed, before)?;
                Ok(Self::Cells(scenes, Box::new(samples)))
            }
            RaySampling::Pixels(planes, _) => {
                let before = match before {
                    Some(Self::Pixels(images)) => &**images,
                    _ => &[],
                };
                model.cast_images(scene, planes, before, cancel).map(Self::Pixels)
            }
        }
    }

    /// Material points of all hits that return power; those of tiles are ordered by `rank` of the body.
    pub fn scatterers(&self, model: &Model, rank: impl Fn(u32) -> u8, cancel: &Cancel) -> Result<Scatterers> {
        let (array, materials, seed) = (model.array.clone(), &model.materials, model.settings.seed);
        let sampling = match model.settings.rays {
            RaySampling::Adaptive { .. } => Sampling::Footprint,
            RaySampling::Pixels(_, sampling) => sampling,
        };
        match (self, &model.source) {
            (Self::Cells(scenes, samples), _) => {
                let sectors = scenes.iter().zip(&model.sectors);
                let sectors: Vec<_> = sectors.map(|(scene, facing)| (&**scene, &facing.array)).collect();
                Ok(Scatterers::of_samples(&sectors, samples, materials, array, rank))
            }
            (Self::Pixels(images), _) => {
                let images = images.iter().zip(&model.sectors);
                let images = images
                    .map(|(image, facing)| Ok((&*image.scene, &image.hits, image.smooth(cancel)?, &facing.array)))
                    .collect::<Result<Vec<_>>>()?;
                Ok(Scatterers::of_images(&images, materials, array, sampling, seed))
            }
            (Self::None, Source::Depth(image)) => Scatterers::from_surfels(&image.surfels, array, sampling, seed),
            (Self::None, Source::Scene(_)) => unreachable!("rays are cast of scenes"),
        }
    }

    /// Paths of several reflections, from the rays, or from images where the rays are adaptive; these replace `tubes`,
    /// the images of the frame before.
    pub fn bounces(
        &self,
        model: &Model,
        tubes: &mut Vec<Image>,
        cancel: &Cancel,
    ) -> Result<(Bounces, bounces::TubeCounts)> {
        let none = || (Bounces::empty(model.array.clone()), bounces::TubeCounts::default());
        if model.settings.limits.max_bounces <= 1 {
            return Ok(none());
        }
        // The first sector has the axes of the sensor.
        let shoot = |images: &[Image], sampling: Sampling, field: f64| {
            let each = images.iter().zip(&model.sectors);
            let tube_images: Vec<TubeImage> = each
                .map(|(image, facing)| TubeImage {
                    rotation: facing.rotation.transpose(),
                    hits: &image.hits,
                    parts: if field.is_finite() {
                        MeshPart::small(&image.scene, &image.hits.plane, field, bounces::CELLS_ACROSS)
                    } else {
                        Vec::new()
                    },
                })
                .collect();
            let (scene, limits) = (&images[0].scene, model.settings.limits);
            Bounces::new(
                scene,
                &tube_images,
                &model.materials,
                &model.array,
                limits,
                sampling,
                field,
            )
        };
        match (self, &model.settings.rays) {
            (Self::Pixels(images), RaySampling::Pixels(_, sampling)) => Ok(shoot(images, *sampling, f64::INFINITY)),
            (Self::Cells(scenes, _), RaySampling::Adaptive { rcs_floor, .. }) => {
                let before = if model.settings.reuse_tiles { &**tubes } else { &[] };
                let images = model.cast_images(&scenes[0], &model.settings.tubes, before, cancel)?;
                let field = field_of(*rcs_floor, SPEED_OF_LIGHT / model.array.frequency);
                let found = shoot(&images, Sampling::Footprint, field);
                *tubes = images;
                Ok(found)
            }
            _ => Ok(none()),
        }
    }

    /// Nearest hit of every body with a hit, the first of equal ones, and the scene in which it was hit.
    pub fn nearest(&self) -> Vec<(&PosedScene, Nearest)> {
        match self {
            Self::Cells(scenes, samples) => {
                let nearest = samples.tiles.nearest.iter();
                nearest.map(|hit| (&*scenes[hit.sector], *hit)).collect()
            }
            Self::Pixels(images) => {
                let hits = images.iter().enumerate();
                let nearest = nearest_of(hits.flat_map(|(sector, image)| image.nearest(sector)));
                let nearest = nearest.into_iter();
                nearest.map(|hit| (&*images[hit.sector].scene, hit)).collect()
            }
            Self::None => Vec::new(),
        }
    }
}
