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
use crate::paths::scatterers::{Scatterers, Weight};
use crate::rays::hits::Hits;
use crate::rays::scene::PosedScene;
use crate::rays::smooth_hits::SmoothHits;
use crate::scattering::depth_image::Surfels;
use crate::scattering::material::{Material, Response};
use crate::scattering::material_frame::MaterialFrame;
use crate::scattering::material_points::Points;
use crate::scattering::patch::patch;
use crate::scattering::physical_optics::{Sampling, Weigh};
use crate::scattering::samples::Samples;
use crate::scattering::sampling::{Piece, Tiles};

impl Scatterers {
    /// Material points of all hits of images that return power, one image after the other; `materials` per body, `seed`
    /// for the diffuse phases. Images have axes of their own, in which they have the array beside them.
    pub fn of_images(
        images: &[(&PosedScene, &Hits, &SmoothHits, &Array)],
        materials: &[Material],
        array: Array,
        sampling: Sampling,
        seed: u64,
    ) -> Self {
        let mut points = Points::default();
        let mut num_pixels = 0;
        for (scene, hits, smooth, array) in images {
            let weigh = Weigh { array, sampling };
            let of_image = gather(hits.plane.num_pixels(), |pixel, points| {
                if let Some(patch) = patch(hits, smooth, pixel) {
                    let frame = MaterialFrame::of_mesh(scene, patch.body, hits.triangle[pixel], seed);
                    weigh.patch(&patch, &frame, &materials[patch.body as usize], points);
                }
            });
            points.append(of_image.with_cells_from(num_pixels));
            num_pixels += hits.plane.num_pixels() as u32;
        }
        points.shared(sampling, array)
    }

    /// Material points of adaptive samples of sectors, in their scenes and arrays: specular ones, and diffuse ones. Those
    /// of tiles are ordered by `rank` of the body, and by body.
    pub fn of_samples(
        sectors: &[(&PosedScene, &Array)],
        samples: &Samples,
        materials: &[Material],
        array: Array,
        rank: impl Fn(u32) -> u8,
    ) -> Self {
        let mut points = Points::default();
        let weigh = |array| Weigh {
            array,
            sampling: Sampling::Footprint,
        };
        for ((scene, array), speckles) in sectors.iter().zip(&samples.speckles) {
            for (body, speckle) in speckles.iter().enumerate() {
                let Some(speckle) = speckle else { continue };
                points.append(gather(speckle.normal.len(), |point, points| {
                    if speckle.normal[point] != DVec3::ZERO {
                        weigh(*array).diffuse_point(scene, body as u32, speckle, point, &materials[body], points);
                    }
                }));
            }
        }
        let mut scatterers = points.with_array(array);
        let scenes: Vec<&PosedScene> = sectors.iter().map(|(scene, _)| *scene).collect();
        scatterers.append(of_tiles(&scenes, &samples.tiles, scatterers.array.clone(), rank));
        scatterers
    }

    /// Material points of all surface elements that return power; `seed` for the diffuse phases.
    pub fn from_surfels(surfels: &Surfels, array: Array, sampling: Sampling, seed: u64) -> Result<Self> {
        surfels.check()?;
        let weigh = Weigh {
            array: &array,
            sampling,
        };
        let points = gather(surfels.plane.num_pixels(), |pixel, points| {
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
        });
        Ok(points.shared(sampling, array))
    }
}

impl Points {
    /// Material points whose cells are numbered from `first` on.
    fn with_cells_from(mut self, first: u32) -> Self {
        self.cell.iter_mut().for_each(|cell| *cell += first);
        self
    }

    /// Scatterers of all pixels, whose diffuse points share the power of the surface.
    fn shared(mut self, sampling: Sampling, array: Array) -> Scatterers {
        if sampling == Sampling::Footprint {
            self.share_speckle(array.num_channels());
        }
        self.with_array(array)
    }
}

/// Neighbouring points of a piece on one body.
#[derive(Clone, Copy)]
struct Run {
    body: u32,
    piece: u32,
    first: u32,
    number: u32,
}

/// Runs of the points of some pieces.
#[derive(Default)]
struct Runs {
    all: Vec<Run>,
    /// True if the edges of a point turn.
    is_turning: bool,
    /// True if the field of a point falls with the frequency.
    has_orders: bool,
}

impl Run {
    /// Piece and number of every point.
    fn points(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let [piece, first, number] = [self.piece, self.first, self.number].map(|each| each as usize);
        (first..first + number).map(move |point| (piece, point))
    }
}

impl Runs {
    /// Runs of pieces, whose numbers start at `first`.
    fn new(pieces: &[Piece], first: usize) -> Self {
        let mut runs = Self::default();
        for (piece, number) in pieces.iter().zip(first as u32..) {
            let mut last: Option<Run> = None;
            for (point, place) in piece.points().iter().zip(0..) {
                runs.is_turning |= point.edges != [DVec3::ZERO; 2];
                runs.has_orders |= point.order > 0;
                match &mut last {
                    Some(run) if run.body == point.body => run.number += 1,
                    _ => {
                        let run = Run {
                            body: point.body,
                            piece: number,
                            first: place,
                            number: 1,
                        };
                        runs.all.extend(last.replace(run));
                    }
                }
            }
            runs.all.extend(last);
        }
        runs
    }
}

/// Material points of tiles, ordered by `rank` of the body and by body.
fn of_tiles(scenes: &[&PosedScene], tiles: &Tiles, array: Array, rank: impl Fn(u32) -> u8) -> Scatterers {
    const PIECES: usize = 64;
    const BLOCK: usize = 512;
    let scene = scenes[0];
    let pieces = tiles.pieces.par_chunks(PIECES).enumerate();
    let found: Vec<Runs> = pieces
        .map(|(chunk, pieces)| Runs::new(pieces, chunk * PIECES))
        .collect();
    let is_turning = found.iter().any(|runs| runs.is_turning);
    let has_orders = found.iter().any(|runs| runs.has_orders);
    let mut of_body: Vec<Vec<Run>> = vec![Vec::new(); scene.num_bodies()];
    for run in found.iter().flat_map(|runs| &runs.all) {
        of_body[run.body as usize].push(*run);
    }
    let mut bodies: Vec<u32> = (0..scene.num_bodies() as u32).collect();
    bodies.sort_by_key(|body| (rank(*body), *body));
    let is_deformed = bodies.iter().any(|body| scene.surface(*body).is_deformed());
    // Numbers of the first points of all runs, and the runs.
    let (mut number, mut runs) = (0, Vec::new());
    for run in bodies.iter().flat_map(|body| &of_body[*body as usize]) {
        runs.push((number, *run));
        number += run.number as usize;
    }

    let num_weights = tiles.num_weights;
    let mut scatterers = Points::default().with_array(array);
    scatterers.body = vec![0; number];
    scatterers.position = vec![DVec3::ZERO; number];
    scatterers.normal = vec![DVec3::ZERO; number];
    scatterers.weights = vec![Weight::NONE; number * num_weights];
    if is_turning {
        scatterers.patch = vec![[DVec3::ZERO; 2]; number];
    }
    if has_orders {
        scatterers.frequency_exponent = vec![0; number];
    }
    if is_deformed {
        scatterers.corners = vec![None; number];
    }
    let blocks: Vec<_> = scatterers
        .body
        .chunks_mut(BLOCK)
        .zip(scatterers.position.chunks_mut(BLOCK))
        .zip(scatterers.normal.chunks_mut(BLOCK))
        .zip(scatterers.weights.chunks_mut(BLOCK * num_weights))
        .zip(blocks_or_none(&mut scatterers.patch, number, BLOCK))
        .zip(blocks_or_none(&mut scatterers.corners, number, BLOCK))
        .zip(blocks_or_none(&mut scatterers.frequency_exponent, number, BLOCK))
        .zip((0..number).step_by(BLOCK))
        .collect();
    blocks.into_par_iter().for_each(|block| {
        let (((((((body, position), normal), weights), patch), corners), order), first) = block;
        let at = runs.partition_point(|(start, _)| *start <= first) - 1;
        let points = runs[at..].iter().flat_map(|(_, run)| run.points());
        for (i, (piece, number)) in points.skip(first - runs[at].0).take(body.len()).enumerate() {
            let piece = &tiles.pieces[piece];
            let scene = scenes[piece.sector];
            let point = &piece.points()[number];
            for (to, from) in weights[i * num_weights..]
                .iter_mut()
                .zip(piece.weights(number, num_weights))
            {
                to.specular = *from;
            }
            body[i] = point.body;
            if has_orders {
                order[i] = point.order;
            }
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
