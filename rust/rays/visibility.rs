//! Visibility of points of a body from the sensor, 64 at a time.

use glam::DVec3;
use rayon::prelude::*;

use crate::numeric::simd::{Isa, Kernel};
use crate::rays::hits::{Cast, Counts};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS};
use crate::rays::scene::{NO_BODY, PosedScene};
use crate::rays::search::Scratch;

/// Number of targets that one thread tests in a row.
const BLOCK: usize = 16 * MOST_RAYS;

/// Relative tolerance of the distance at which a hit is the target itself.
const AT_TARGET: f64 = 1e-9;

/// Point on a triangle of a body, in front of the sensor.
#[derive(Clone, Copy)]
pub struct Target {
    /// Coordinates u = y/x and v = z/x.
    pub point: [f64; 2],
    /// Coordinate x [m].
    pub depth: f64,
    /// Number of the triangle.
    pub triangle: u32,
}

impl PosedScene {
    /// Unit normals on the incident side at points of a body, in the sensor frame; zero where a surface occludes the
    /// point. Points one after another should be close together.
    pub fn visible_normals(&self, body: u32, targets: &[Target], cast: &Cast) -> (Vec<DVec3>, Counts) {
        let mut normals = vec![DVec3::ZERO; targets.len()];
        let blocks = targets.par_chunks(BLOCK).zip(normals.par_chunks_mut(BLOCK));
        let counts = blocks.map(|(targets, normals)| {
            cast.level.run(Visibility {
                scene: self,
                cast,
                body,
                targets,
                normals,
            })
        });
        let counts = counts.reduce(Counts::default, Counts::plus);
        (normals, counts)
    }
}

/// Kernel of [`PosedScene::visible_normals`].
struct Visibility<'a> {
    scene: &'a PosedScene,
    cast: &'a Cast<'a>,
    body: u32,
    targets: &'a [Target],
    normals: &'a mut [DVec3],
}

impl Kernel for Visibility<'_> {
    type Output = Counts;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> Counts {
        let (scene, body) = (self.scene, self.body);
        let mut scratch = Scratch::new();
        let mut counts = Counts::default();
        for (targets, normals) in self.targets.chunks(MOST_RAYS).zip(self.normals.chunks_mut(MOST_RAYS)) {
            scratch.rays.set_points(targets.len(), |ray| targets[ray].point);
            if self.cast.is_outside(&scratch.rays) {
                counts.tiles_skipped += 1;
                continue;
            }
            counts.rays += targets.len();
            // Nothing beyond the target matters.
            for (limit, target) in scratch.limit.iter_mut().zip(targets) {
                *limit = (target.depth as f32).next_up();
            }
            scene.search::<I>(&mut scratch, self.cast);
            let hits = &mut scratch.hits;
            hits.edge_on = [0; PACKETS];
            for (ray, target) in targets.iter().enumerate() {
                let (packet, lane) = (ray / PACKET, ray % PACKET);
                let found = (hits.body[packet][lane], hits.triangle[packet][lane]);
                let is_free = found.0 == NO_BODY || found == (body, target.triangle) || {
                    let crossing = scene.cross(scratch.rays.direction(ray), found.0, found.1);
                    crossing.is_none_or(|crossing| crossing.distance >= target.depth * (1.0 - AT_TARGET))
                };
                hits.body[packet][lane] = if is_free { body } else { NO_BODY };
                hits.triangle[packet][lane] = target.triangle;
            }
            scratch.measure::<I>(scene);
            for (ray, normal) in normals.iter_mut().enumerate() {
                *normal = scratch.measured.normal_of(ray);
            }
        }
        counts
    }
}
