//! Rays against meshes that are hard on them, at every instruction set, compared with an exhaustive search and with answers
//! known on paper.

mod closed_meshes;
mod coincidence;
mod edge_on;
mod exhaustive;
mod extremes;
mod meshes;
mod origins;
mod random_rays;

use crate::numeric::simd::Level;
use crate::rays::hits::Cast;
use crate::rays::packet_search::Traversals;
use crate::rays::scene::PosedScene;
use crate::rays::tree::Ray;
use crate::{ImagePlane, Pose};
use exhaustive::{Answer, Exhaustive, TOLERANCE};
use glam::DVec3;
use meshes::{Bodies, Mesh, surface};

/// Distance at which rays of images start [m].
const START: f64 = 1e-9;

/// A scene as the ray engine has it, and as the exhaustive search has it.
struct Scene {
    posed: PosedScene,
    truth: Exhaustive,
}

impl Scene {
    /// For rays from origins with coordinates up to `origins`.
    fn new(bodies: Bodies, origins: f64) -> Self {
        let truth = Exhaustive::new(&bodies, origins);
        let (surfaces, poses) = bodies.into_iter().unzip();
        Self {
            posed: PosedScene::new(surfaces, poses),
            truth,
        }
    }

    fn of(mesh: &Mesh, pose: Pose) -> Self {
        Self::new(vec![(surface(mesh), pose)], 0.0)
    }

    /// Answers to all pixels: `criterion` sees the level, the pixel's ray, its number and its answer.
    fn cast(&self, plane: &ImagePlane, mut criterion: impl FnMut(Level, &Ray, usize, Answer) -> Result<(), String>) {
        let rays = rays(plane);
        for level in Level::available() {
            let [hits, together, apart] =
                [Traversals::Chosen, Traversals::Together, Traversals::Apart].map(|traversals| {
                    let cast = Cast {
                        level,
                        traversals,
                        ..Cast::default()
                    };
                    self.posed.cast_image_with(plane, &cast).unwrap()
                });
            assert_eq!(hits.distance.len(), rays.len());
            for other in [together, apart] {
                assert_eq!(hits.distance, other.distance);
                assert_eq!((&hits.body, &hits.triangle), (&other.body, &other.triangle));
            }
            for (pixel, ray) in rays.iter().enumerate() {
                let answer = Answer {
                    distance: hits.distance[pixel],
                    body: hits.body[pixel],
                    triangle: hits.triangle[pixel],
                };
                if let Err(reason) = criterion(level, ray, pixel, answer) {
                    panic!("{level:?}, pixel {pixel} of {plane:?}: {reason}");
                }
            }
        }
    }

    /// All pixels against the exhaustive search. Returns how many hit, counted at one level.
    fn check(&self, plane: &ImagePlane) -> usize {
        let farthest = self.truth.farthest(&rays(plane));
        let mut num_hits = 0;
        self.cast(plane, |_, ray, pixel, answer| {
            num_hits += usize::from(answer.is_hit());
            self.truth.is_right(ray, farthest[pixel], &answer)
        });
        num_hits / Level::available().len()
    }

    /// All pixels of a sensor in a closed mesh of which every ray meets one point: it must be that one.
    fn check_closed(&self, plane: &ImagePlane) {
        self.cast(plane, |_, ray, _, answer| self.is_closed(ray, &answer));
    }

    fn is_closed(&self, ray: &Ray, answer: &Answer) -> Result<(), String> {
        if answer.is_hit() {
            self.truth.is_met(ray, answer)
        } else {
            Err(format!("leak: {ray:?}"))
        }
    }
}

/// The rays of an image, row by row.
fn rays(plane: &ImagePlane) -> Vec<Ray> {
    let direction = |pixel: usize| plane.direction(pixel / plane.columns, pixel % plane.columns);
    (0..plane.num_pixels())
        .map(|pixel| Ray {
            origin: DVec3::ZERO,
            direction: direction(pixel),
            start: START,
        })
        .collect()
}

/// Nothing, or that two distances differ.
fn is_near(distance: f64, expected: f64) -> Result<(), String> {
    if (distance - expected).abs() <= TOLERANCE * expected {
        Ok(())
    } else {
        Err(format!("{distance} m, expected {expected} m"))
    }
}

/// A cut-out of an image somewhere off its axis: `rows` x `columns` pixels round (u, v) = `middle`.
fn cut_out(rows: usize, columns: usize, du: f64, dv: f64, middle: [f64; 2]) -> ImagePlane {
    ImagePlane {
        rows,
        columns,
        du,
        dv,
        axis_column: 0.5 * columns as f64 + middle[0] / du,
        axis_row: 0.5 * rows as f64 + middle[1] / dv,
    }
}

/// `num` pixels to either side of one that looks along the axis, `shift` more on top and on the left.
fn odd(num: [usize; 2], size: [f64; 2], shift: usize) -> ImagePlane {
    ImagePlane {
        rows: 2 * num[0] + 1 + shift,
        columns: 2 * num[1] + 1 + shift,
        du: size[1],
        dv: size[0],
        axis_column: (num[1] + shift) as f64 + 0.5,
        axis_row: (num[0] + shift) as f64 + 0.5,
    }
}
