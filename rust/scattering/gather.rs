//! Scatterers from hits of rays, from adaptive samples, or from pixels of a depth image.
//!
//! Two mechanisms per material (docs/theory.md eqs. (2) and (3)): the specular one is physical optics over the solid
//! angle of a pixel, the diffuse one is Lambert's law with a random phase of every surface point.
//! A hit becomes a material point of its body; the point moves with the body, or with its triangle where the body
//! deforms, and `paths` evaluates its delay and amplitude at any time of the frame.

use glam::DVec3;
use rayon::prelude::*;

use crate::antennas::array::Array;
use crate::error::Result;
use crate::geometry::pose::Pose;
use crate::numeric::random::mix;
use crate::paths::scatterers::{Edges, Scatterers, Weight};
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
        scene: &PosedScene,
        hits: &Hits,
        smooth: &SmoothHits,
        materials: &[Material],
        array: Array,
        sampling: Sampling,
        seed: u64,
    ) -> Self {
        Self::gather(hits.plane.num_pixels(), array, sampling, |weigh, pixel, points| {
            if let Some(patch) = patch(hits, smooth, pixel) {
                let frame = MaterialFrame::of_mesh(scene, patch.body, hits.triangle[pixel], seed);
                weigh.patch(&patch, &frame, &materials[patch.body as usize], points);
            }
        })
        .with_vertices(|body| scene.surface(body).vertices().len())
    }

    /// Material points of adaptive samples: specular ones, and diffuse ones. Those of tiles are ordered by `rank` of the
    /// body, and by body.
    pub fn of_samples(
        scene: &PosedScene,
        samples: &Samples,
        materials: &[Material],
        array: Array,
        rank: impl Fn(u32) -> u8,
    ) -> Self {
        let weigh = Weigh {
            array: &array,
            sampling: Sampling::Footprint,
        };
        let of_leaf = |leaf: &Leaf, index: usize, points: &mut Points| {
            let patch = Patch {
                index,
                body: leaf.found.body,
                cell: leaf.cell,
                distance: leaf.found.distance,
                normal: leaf.found.normal,
            };
            let frame = MaterialFrame::of_mesh(scene, patch.body, leaf.found.triangle, 0);
            weigh.leaf(&patch, leaf, &frame, &materials[patch.body as usize], points);
        };
        let mut points = match &samples.specular {
            Specular::Tiles(_) => Points::default(),
            Specular::Quadtree(_, leaves) => {
                gather(leaves.len(), |index, points| of_leaf(&leaves[index], index, points))
            }
        };
        for (body, speckle) in samples.speckles.iter().enumerate() {
            let Some(speckle) = speckle else { continue };
            points.append(gather(speckle.normal.len(), |point, points| {
                if speckle.normal[point] != DVec3::ZERO {
                    weigh.diffuse_point(scene, body as u32, speckle, point, &materials[body], points);
                }
            }));
        }
        let mut scatterers = points.with_array(array);
        if let Specular::Tiles(tiles) = &samples.specular {
            scatterers.append(of_tiles(scene, tiles, scatterers.array.clone(), rank));
        }
        scatterers.with_vertices(|body| scene.surface(body).vertices().len())
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

/// Material points of tiles, ordered by `rank` of the body and by body.
fn of_tiles(scene: &PosedScene, tiles: &Tiles, array: Array, rank: impl Fn(u32) -> u8) -> Scatterers {
    const BLOCK: usize = 512;
    let mut bodies: Vec<u32> = (0..scene.num_bodies() as u32).collect();
    bodies.sort_by_key(|body| (rank(*body), *body));
    let mut ends = vec![0; bodies.len()];
    let all = || tiles.pieces.iter().zip(0_u32..);
    let (mut is_turning, mut is_deformed) = (false, false);
    for point in all().flat_map(|(piece, _)| piece.points()) {
        ends[point.body as usize] += 1;
        is_turning |= point.edges != [DVec3::ZERO; 2];
    }
    let mut number = 0;
    for body in &bodies {
        is_deformed |= scene.surface(*body).is_deformed();
        (ends[*body as usize], number) = (number, number + ends[*body as usize]);
    }
    // Piece and number of every point in the new order.
    let mut origin = vec![(0, 0); number];
    for (piece, index) in all() {
        for (point, number) in piece.points().iter().zip(0_u32..) {
            let place = &mut ends[point.body as usize];
            origin[*place] = (index, number);
            *place += 1;
        }
    }

    let num_weights = tiles.num_weights;
    let mut scatterers = Points::default().with_array(array);
    scatterers.body = vec![0; number];
    scatterers.position = vec![DVec3::ZERO; number];
    scatterers.normal = vec![DVec3::ZERO; number];
    scatterers.weights = vec![Weight::NONE; number * num_weights];
    if is_turning {
        scatterers.patch = vec![Edges::default(); number];
    }
    if is_deformed {
        scatterers.corners = vec![None; number];
    }
    let blocks: Vec<_> = origin
        .chunks(BLOCK)
        .zip(scatterers.body.chunks_mut(BLOCK))
        .zip(scatterers.position.chunks_mut(BLOCK))
        .zip(scatterers.normal.chunks_mut(BLOCK))
        .zip(scatterers.weights.chunks_mut(BLOCK * num_weights))
        .zip(blocks_or_none(&mut scatterers.patch, number, BLOCK))
        .zip(blocks_or_none(&mut scatterers.corners, number, BLOCK))
        .collect();
    blocks.into_par_iter().for_each(|block| {
        let ((((((origin, body), position), normal), weights), patch), corners) = block;
        for (i, (piece, number)) in origin.iter().enumerate() {
            let piece = &tiles.pieces[*piece as usize];
            let point = &piece.points()[*number as usize];
            for (to, from) in weights[i * num_weights..]
                .iter_mut()
                .zip(piece.weights(*number as usize, num_weights))
            {
                to.specular = *from;
            }
            body[i] = point.body;
            if !is_deformed && !is_turning {
                let pose = scene.pose(point.body);
                position[i] = pose.point_to_body(point.position);
                normal[i] = pose.direction_to_body(point.normal);
                continue;
            }
            let frame = MaterialFrame::of_mesh(scene, point.body, point.triangle, 0);
            position[i] = frame.position(point.position);
            normal[i] = frame.normal(point.normal);
            if !patch.is_empty() && point.edges != [DVec3::ZERO; 2] {
                patch[i] = frame.edges(point.edges);
            }
            if !corners.is_empty() {
                corners[i] = frame.moved.as_ref().map(|moved| moved.vertices);
            }
        }
    });
    scatterers
}

/// Blocks of elements, or as many empty ones for none.
fn blocks_or_none<T>(elements: &mut [T], number: usize, size: usize) -> Vec<&mut [T]> {
    if elements.is_empty() {
        (0..number.div_ceil(size)).map(|_| &mut [][..]).collect()
    } else {
        elements.chunks_mut(size).collect()
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
