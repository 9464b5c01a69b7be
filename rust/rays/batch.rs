//! Hits and smooth normals of rays through any points of the image plane, in groups of 64.

use glam::DVec3;
use rayon::prelude::*;

use crate::numeric::simd::{Isa, Kernel};
use crate::rays::hits::{Cast, Counts};
use crate::rays::packet::{MOST_RAYS, PACKET};
use crate::rays::scene::{NO_BODY, PosedScene};
use crate::rays::search::{Scratch, Touch};
use crate::rays::tree::Tree;

/// Number of rays that one thread casts in a row.
const BLOCK: usize = 16 * MOST_RAYS;

/// Hit of one ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Distance along the ray to the triangle [m]; infinite where nothing was hit.
    pub to_facet: f64,
    /// Unit normal of the curved surface on the incident side, in the sensor frame; zero where nothing was hit.
    pub normal: DVec3,
    /// Number of the body, or [`NO_BODY`].
    pub body: u32,
    /// Number of the triangle in the body's surface.
    pub triangle: u32,
    /// True if the direction is within the beam of the antennas; otherwise it was not cast.
    pub is_seen: bool,
}

impl Found {
    /// Hit of a ray that meets nothing.
    pub const NOTHING: Self = Self {
        to_facet: f64::INFINITY,
        normal: DVec3::ZERO,
        body: NO_BODY,
        triangle: u32::MAX,
        is_seen: true,
    };

    /// True if a body was hit.
    pub fn is_hit(&self) -> bool {
        self.body != NO_BODY
    }
}

/// Hits of rays at another time.
pub struct Known<'a, F> {
    /// Boxes where bodies have moved, and hits may not be copied; see [`PosedScene::moved`].
    pub moved: &'a Tree,
    /// Hit of the ray of a number, if it was cast.
    pub found: F,
}

/// Known hits of one type, so that the kernel, which is large, is compiled once for all callers.
type AnyKnown<'a> = Known<'a, &'a (dyn Fn(usize) -> Option<Found> + Sync)>;

impl PosedScene {
    /// Hits of rays through points `(u, v)` of the image plane, in groups of 64 in parallel; equal to those of
    /// [`Self::cast_image`] at the same points. Rays one after another should be close together.
    pub fn cast_batch<F>(&self, points: &[[f64; 2]], cast: &Cast, known: Option<&Known<F>>) -> (Vec<Found>, Counts)
    where
        F: Fn(usize) -> Option<Found> + Sync,
    {
        let known = known.map(|known| AnyKnown {
            moved: known.moved,
            found: &known.found,
        });
        let mut found = vec![Found::NOTHING; points.len()];
        let counts = points
            .par_chunks(BLOCK)
            .zip(found.par_chunks_mut(BLOCK))
            .enumerate()
            .map(|(block, (points, found))| {
                cast.level.run(CastBlock {
                    scene: self,
                    cast,
                    known: known.as_ref(),
                    first: block * BLOCK,
                    points,
                    found,
                })
            })
            .reduce(Counts::default, Counts::plus);
        (found, counts)
    }
}

/// Kernel that casts rays, group by group.
struct CastBlock<'a> {
    scene: &'a PosedScene,
    cast: &'a Cast<'a>,
    known: Option<&'a AnyKnown<'a>>,
    /// Number of the first ray.
    first: usize,
    /// Plane coordinates (u, v) of the rays.
    points: &'a [[f64; 2]],
    found: &'a mut [Found],
}

impl Kernel for CastBlock<'_> {
    type Output = Counts;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> Counts {
        let Self {
            scene,
            cast,
            known,
            first,
            points,
            found,
        } = self;
        let mut scratch = Scratch::new();
        let mut counts = Counts::default();
        let groups = points.chunks(MOST_RAYS).zip(found.chunks_mut(MOST_RAYS));
        for (group, (points, found)) in groups.enumerate() {
            scratch.rays.hold(points);
            if cast.is_outside(&scratch.rays) {
                counts.tiles_skipped += 1;
                for found in found {
                    found.is_seen = false;
                }
                continue;
            }
            if let Some(known) = known {
                let mut touch = Touch(false);
                scratch.rays.traverse::<I>(known.moved, &mut scratch.top, &mut touch);
                if !touch.0 && take_over(found, known, first + group * MOST_RAYS) {
                    counts.tiles_reused += 1;
                    continue;
                }
            }
            if scene.search::<I>(&mut scratch, cast) {
                counts.tiles_skipped += 1;
                continue;
            }
            counts.rays += points.len();
            scene.measure::<I>(&scratch.rays, &scratch.hits, &mut scratch.distance);
            let (hits, distance) = (&scratch.hits, &scratch.distance);
            scratch
                .shade
                .fill::<I, true>(scene, &scratch.rays, &hits.body, &hits.triangle, distance);
            for (ray, found) in found.iter_mut().enumerate() {
                let (packet, lane) = (ray / PACKET, ray % PACKET);
                *found = Found {
                    to_facet: scratch.distance[ray],
                    normal: scratch.shade.normal_of(ray),
                    body: scratch.hits.body[packet][lane],
                    triangle: scratch.hits.triangle[packet][lane],
                    is_seen: true,
                };
            }
        }
        counts
    }
}

/// Copy the known hits of a group of rays from number `first` on, if all are known. Returns whether they are.
fn take_over(found: &mut [Found], known: &AnyKnown, first: usize) -> bool {
    for ray in 0..found.len() {
        match (known.found)(first + ray) {
            Some(before) if before.is_seen => found[ray] = before,
            _ => {
                found.fill(Found::NOTHING);
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::simd::Level;
    use crate::rays::camera::ImagePlane;
    use crate::rays::scene::tests::furnished;

    /// Type of known hits where there are none.
    type Unknown = fn(usize) -> Option<Found>;

    #[test]
    fn rays_in_any_order_have_the_hits_of_an_image() {
        let (surfaces, poses) = furnished();
        let scene = PosedScene::new(surfaces, poses);
        let plane = ImagePlane::centered(53, 61, 0.8, 0.8);
        for level in Level::available() {
            let cast = Cast {
                level,
                ..Cast::default()
            };
            let hits = scene.cast_image_with(&plane, &cast).unwrap();
            // Every seventh pixel after the other: groups that reach all over the image.
            let pixels: Vec<usize> = (0..plane.num_pixels()).map(|i| i * 7 % plane.num_pixels()).collect();
            let points: Vec<[f64; 2]> = pixels
                .iter()
                .map(|pixel| plane.center(pixel / plane.columns, pixel % plane.columns).into())
                .collect();
            let (found, counts) = scene.cast_batch::<Unknown>(&points, &cast, None);
            assert!(counts.rays + 64 * counts.tiles_skipped >= points.len() && counts.rays > 3000);
            let mut num_hits = 0;
            for (pixel, found) in pixels.into_iter().zip(found) {
                assert_eq!((found.body, found.triangle), (hits.body[pixel], hits.triangle[pixel]));
                assert_eq!(found.to_facet, hits.distance[pixel]);
                assert_eq!(found.normal.to_array(), hits.normal[pixel]);
                num_hits += usize::from(found.is_hit());
            }
            assert!(num_hits > 1000);
        }
    }
}
