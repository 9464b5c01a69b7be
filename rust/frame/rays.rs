//! Rays of a frame and of images, and their hits.

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use super::model::{Model, RaySampling, Source};
use crate::antennas::beam::Beam;
use crate::bounces::{self, Bounces, Launch};
use crate::error::Result;
use crate::geometry::pose::Pose;
use crate::paths::scatterers::Scatterers;
use crate::rays::camera::{Cell, ImagePlane};
use crate::rays::hits::{self, Cast, Hits};
use crate::rays::scene::{NO_BODY, PosedScene};
use crate::rays::smooth_hits::SmoothHits;
use crate::scattering::material_points::NO_CELL;
use crate::scattering::patch::place_on_mesh;
use crate::scattering::physical_optics::Sampling;
use crate::scattering::refinement::Refinement;
use crate::scattering::samples::Samples;

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

    /// Distances and normals of the curved surfaces that the triangles approximate; computed once.
    pub fn smooth(&self) -> &SmoothHits {
        self.smooth.get_or_init(|| SmoothHits::new(&self.scene, &self.hits))
    }
}

/// Rays of a frame and their hits.
pub enum Rays {
    /// Cells of adaptive sampling, and random points of rough surfaces.
    Cells(Arc<PosedScene>, Samples),
    /// Pixels.
    Pixels(Image),
    /// No rays: the surfaces are pixels of a depth image.
    None,
}

/// Nearest hit of a body to the sensor.
pub struct NearestHit {
    /// Number of the body.
    pub body: usize,
    /// Position in the sensor frame at the time of the cast [m].
    pub point: DVec3,
    /// Vertices of the triangle and barycentric weights of the hit.
    pub corners: ([u32; 3], [f64; 3]),
}

impl Model {
    fn cast(&self) -> Cast<'_> {
        Cast {
            skip_empty: self.settings.skip_empty,
            ..Cast::default()
        }
    }

    /// Cast the whole image, with cosines of incidence.
    pub(super) fn cast_image(&self, scene: Arc<PosedScene>, before: Option<&Image>) -> Result<Image> {
        let cast = Cast {
            with_cosines: true,
            ..self.cast()
        };
        let before = before.filter(|_| self.settings.reuse_tiles);
        Image::cast(scene, &self.settings.image, None, &cast, before)
    }
}

impl Rays {
    /// Cast the rays of a frame, or of a part of one within which bodies turn by some angles [rad]; static tiles of the
    /// frame `before` are reused.
    pub fn cast(model: &Model, scene: Arc<PosedScene>, turns: &[f64], before: Option<&Self>) -> Result<Self> {
        if let Source::Depth(_) = &model.source {
            return Ok(Self::None);
        }
        let before = before.filter(|_| model.settings.reuse_tiles);
        match &model.settings.rays {
            &RaySampling::Adaptive {
                base,
                rcs_floor,
                follows_echo,
                budget,
                end_points,
            } => {
                let refinement = Refinement {
                    base,
                    rcs_floor,
                    follows_echo,
                    budget,
                    end_points,
                    beam: model.beam(),
                    join: model.join(),
                    skip_dark: true,
                    turns,
                    reflections: model.reflections(),
                };
                let before = match before {
                    Some(Self::Cells(scene, samples)) => Some((&**scene, samples)),
                    _ => None,
                };
                let (cast, seed) = (model.cast(), model.settings.seed);
                let samples = Samples::new(&scene, &cast, &model.materials, &model.array, &refinement, seed, before)?;
                Ok(Self::Cells(scene, samples))
            }
            RaySampling::Pixels(plane, _) => {
                let before = match before {
                    Some(Self::Pixels(image)) => Some(image),
                    _ => None,
                };
                Ok(Self::Pixels(Image::cast(
                    scene,
                    plane,
                    model.beam(),
                    &model.cast(),
                    before,
                )?))
            }
        }
    }

    /// Material points of all hits that return power; those of tiles are ordered by `rank` of the body.
    pub fn scatterers(&self, model: &Model, rank: impl Fn(u32) -> u8) -> Result<Scatterers> {
        let (array, seed) = (model.array.clone(), model.settings.seed);
        let sampling = match model.settings.rays {
            RaySampling::Adaptive { .. } => Sampling::Footprint,
            RaySampling::Pixels(_, sampling) => sampling,
        };
        match (self, &model.source) {
            (Self::Cells(scene, samples), _) => {
                let materials = &model.materials;
                Ok(Scatterers::of_samples(scene, samples, materials, array, rank))
            }
            (Self::Pixels(image), _) => Ok(Scatterers::new(
                &image.scene,
                &image.hits,
                image.smooth(),
                &model.materials,
                array,
                sampling,
                seed,
            )),
            (Self::None, Source::Depth(image)) => Scatterers::from_surfels(&image.surfels(), array, sampling, seed),
            (Self::None, Source::Scene(_)) => unreachable!("rays are cast of scenes"),
        }
    }

    /// Paths of several reflections, from the rays, or from an image where the rays are adaptive; the image replaces
    /// `tubes`, the image of the frame before.
    pub fn bounces(&self, model: &Model, tubes: &mut Option<Image>) -> Result<(Bounces, bounces::Counts)> {
        let none = || (Bounces::empty(model.array.clone()), bounces::Counts::default());
        if model.settings.limits.max_bounces <= 1 {
            return Ok(none());
        }
        let shoot = |image: &Image, sampling: Sampling| {
            let launches = Launch::of_image(&image.hits);
            let array = model.array.clone();
            let limits = model.settings.limits;
            Bounces::new(&image.scene, &launches, &model.materials, array, limits, sampling)
        };
        match (self, model.settings.rays) {
            (Self::Pixels(image), RaySampling::Pixels(_, sampling)) => Ok(shoot(image, sampling)),
            (Self::Cells(scene, _), _) => {
                let before = tubes.as_ref().filter(|_| model.settings.reuse_tiles);
                let plane = &model.settings.image;
                let image = Image::cast(scene.clone(), plane, model.beam(), &model.cast(), before)?;
                let found = shoot(&image, Sampling::Footprint);
                *tubes = Some(image);
                Ok(found)
            }
            _ => Ok(none()),
        }
    }

    /// Counts of rays cast, of tiles skipped and reused.
    pub fn counts(&self) -> hits::Counts {
        match self {
            Self::Cells(_, samples) => samples.counts,
            Self::Pixels(image) => image.hits.counts,
            Self::None => hits::Counts::default(),
        }
    }

    /// Number of cells of adaptive sampling that could be split further; none without adaptive sampling.
    pub fn num_coarse(&self) -> Option<usize> {
        match self {
            Self::Cells(_, samples) => Some(samples.specular.num_coarse()),
            _ => None,
        }
    }

    /// Number of hits with a material point; none where the cells of material points tell.
    pub fn num_lit(&self) -> Option<usize> {
        match self {
            Self::Cells(_, samples) => samples.specular.num_hit().1,
            _ => None,
        }
    }

    /// Number of rays that hit a body.
    pub fn num_hit(&self) -> usize {
        match self {
            Self::Cells(_, samples) => samples.specular.num_hit().0,
            Self::Pixels(image) => image.hits.body.iter().filter(|body| **body != NO_BODY).count(),
            Self::None => 0,
        }
    }

    /// Distance of the hit of a cell [m]; 0 for points without a cell.
    pub fn distance(&self, cell: u32) -> f64 {
        match self {
            Self::Cells(_, samples) => samples.specular.distance(cell),
            Self::Pixels(image) if cell != NO_CELL => image.hits.distance[cell as usize],
            _ => 0.0,
        }
    }

    /// Pose of a body in the sensor frame when rays were cast.
    pub fn pose(&self, body: usize) -> &Pose {
        match self {
            Self::Cells(scene, _) => scene.pose(body as u32),
            Self::Pixels(image) => image.scene.pose(body as u32),
            Self::None => &Pose::IDENTITY,
        }
    }

    /// Nearest hit of every body with a hit, the first of equal ones.
    pub fn nearest(&self) -> Vec<NearestHit> {
        match self {
            Self::Cells(scene, samples) => {
                let nearest = samples.specular.nearest().into_iter();
                nearest
                    .map(|hit| NearestHit::new(scene, &hit.cell, hit.body, hit.triangle, hit.distance))
                    .collect()
            }
            Self::Pixels(image) => image.nearest(),
            Self::None => Vec::new(),
        }
    }
}

impl Image {
    /// Nearest hit of every body with a hit, the first of equal ones.
    fn nearest(&self) -> Vec<NearestHit> {
        let hits = &self.hits;
        let mut nearest = vec![(f64::INFINITY, 0); self.scene.num_bodies()];
        for (pixel, (body, distance)) in hits.body.iter().zip(&hits.distance).enumerate() {
            if *body != NO_BODY && *distance < nearest[*body as usize].0 {
                nearest[*body as usize] = (*distance, pixel);
            }
        }
        let seen = nearest.into_iter().zip(0..);
        seen.filter(|((distance, _), _)| distance.is_finite())
            .map(|((distance, pixel), body)| {
                let cell = hits.plane.cell(pixel / hits.plane.columns, pixel % hits.plane.columns);
                NearestHit::new(&self.scene, &cell, body, hits.triangle[pixel], distance)
            })
            .collect()
    }
}

impl NearestHit {
    fn new(scene: &PosedScene, cell: &Cell, body: u32, triangle: u32, distance: f64) -> Self {
        Self {
            body: body as usize,
            point: distance * cell.direction(),
            corners: place_on_mesh(scene, cell, body, triangle),
        }
    }
}
