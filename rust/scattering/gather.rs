//! Scatterers from hits of rays, from adaptive samples, or from pixels of a depth image.
//!
//! Two mechanisms per material (docs/theory.md eqs. (2) and (3)): the specular one is physical optics over the solid
//! angle of a pixel, the diffuse one is Lambert's law with a random phase of every surface point.
//! A hit becomes a material point of its body; the point moves with the body, or with its triangle where the body
//! deforms, and `paths` evaluates its delay and amplitude at any time of the frame.

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antennas::array::Array;
use crate::error::Result;
use crate::geometry::pose::Pose;
use crate::numeric::random::mix;
use crate::paths::scatterers::{Scatterers, Weight};
use crate::rays::hits::Hits;
use crate::rays::scene::PosedScene;
use crate::rays::smooth_hits::SmoothHits;
use crate::scattering::depth_image::Surfels;
use crate::scattering::material::{Material, Response};
use crate::scattering::material_frame::MaterialFrame;
use crate::scattering::material_points::Points;
use crate::scattering::patch::{Patch, patch};
use crate::scattering::physical_optics::{Sampling, Weigh};
use crate::scattering::quadtree::Leaf;
use crate::scattering::samples::{Samples, Specular};
use crate::scattering::sampling::Tiles;

impl Scatterers {
    /// Material points of all hits that return power; `materials` per body, `seed` for the diffuse phases.
    pub fn new(
        snapshot: &PosedScene,
        hits: &Hits,
        smooth: &SmoothHits,
        materials: &[Material],
        array: Array,
        sampling: Sampling,
        seed: u64,
    ) -> Self {
        Self::gather(hits.plane.num_pixels(), array, sampling, |weigh, pixel, points| {
            if let Some(patch) = patch(hits, smooth, pixel) {
                let frame = MaterialFrame::of_mesh(snapshot, patch.body, hits.triangle[pixel], seed);
                weigh.patch(&patch, &frame, &materials[patch.body as usize], points);
            }
        })
        .with_vertices(|body| snapshot.surface(body).vertices().len())
    }

    /// Material points of adaptive samples: specular ones of the tiles, and diffuse ones.
    pub fn of_samples(snapshot: &PosedScene, samples: &Samples, materials: &[Material], array: Array) -> Self {
        let weigh = Weigh {
            array: &array,
            sampling: Sampling::Footprint,
        };
        let num_channels = array.num_channels();
        let of_tiles = |tiles: &Tiles, index: usize, points: &mut Points| {
            let point = &tiles.points.points[index];
            let weights = &tiles.points.weights[tiles.num_weights * index..][..tiles.num_weights];
            let weights = weights.iter().cycle().take(num_channels);
            points.weights.extend(weights.map(|weight| Weight {
                specular: *weight,
                diffuse: Complex64::ZERO,
            }));
            let frame = MaterialFrame::of_mesh(snapshot, point.body, point.triangle, 0);
            points.push_specular(point, &frame);
        };
        let of_leaf = |leaf: &Leaf, index: usize, points: &mut Points| {
            let patch = Patch {
                index,
                body: leaf.found.body,
                cell: leaf.cell,
                distance: leaf.found.distance,
                normal: leaf.found.normal,
            };
            let frame = MaterialFrame::of_mesh(snapshot, patch.body, leaf.found.triangle, 0);
            weigh.leaf(&patch, leaf, &frame, &materials[patch.body as usize], points);
        };
        let mut points = match &samples.specular {
            Specular::Tiles(tiles) => gather(tiles.points.points.len(), |index, points| {
                of_tiles(tiles, index, points);
            }),
            Specular::Quadtree(_, leaves) => {
                gather(leaves.len(), |index, points| of_leaf(&leaves[index], index, points))
            }
        };
        for (body, speckle) in samples.speckles.iter().enumerate() {
            let Some(speckle) = speckle else { continue };
            points.append(gather(speckle.normal.len(), |point, points| {
                if speckle.normal[point] != DVec3::ZERO {
                    weigh.diffuse_point(snapshot, body as u32, speckle, point, &materials[body], points);
                }
            }));
        }
        points
            .with_array(array)
            .with_vertices(|body| snapshot.surface(body).vertices().len())
    }

    /// Material points of all surface elements that return power; `seed` for the diffuse phases.
    pub fn from_surfels(surfels: &Surfels, array: Array, sampling: Sampling, seed: u64) -> Result<Self> {
        surfels.check()?;
        let num_pixels = surfels.plane.num_pixels();
        Ok(Self::gather(num_pixels, array, sampling, |weigh, pixel, points| {
            if let Some(patch) = surfels.patch(pixel) {
                let material = Material::Constant(Response {
                    reflection: surfels.reflection[pixel],
                    albedo: surfels.albedo[pixel],
                });
                let frame = MaterialFrame {
                    pose: &Pose::IDENTITY,
                    moved: None,
                    speckle: mix(seed ^ u64::from(patch.body)),
                };
                weigh.patch(&patch, &frame, &material, points);
            }
        }))
    }

    /// Gather the material points of all cells of an image.
    fn gather(
        num_cells: usize,
        array: Array,
        sampling: Sampling,
        add: impl Fn(&Weigh, usize, &mut Points) + Sync,
    ) -> Self {
        let weigh = Weigh {
            array: &array,
            sampling,
        };
        let mut points = gather(num_cells, |cell, points| add(&weigh, cell, points));
        if sampling == Sampling::Footprint {
            points.share_speckle(array.num_channels());
        }
        points.with_array(array)
    }
}

/// Gather material points over indices up to `number`, block by block in parallel.
fn gather(number: usize, add: impl Fn(usize, &mut Points) + Sync) -> Points {
    const BLOCK: usize = 1024;
    let blocks: Vec<Points> = (0..number.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut points = Points::default();
            for thing in block * BLOCK..number.min((block + 1) * BLOCK) {
                add(thing, &mut points);
            }
            points
        })
        .collect();
    let mut points = Points::default();
    for block in blocks {
        points.append(block);
    }
    points
}
