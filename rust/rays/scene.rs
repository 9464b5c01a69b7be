//! Scene of posed bodies: a tree over their boxes above the trees of their surfaces.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::geometry::aabb::Bounds;
use crate::geometry::pose::Pose;
use crate::numeric::random::mix;
use crate::numeric::simd::{Isa, Kernel, Level};
use crate::rays::packet::View;
use crate::rays::surface::{Nearest, Surface, above};
use crate::rays::traversal::{Single, Visit};
use crate::rays::tree::{Node, Ray, Tree};
use crate::rays::watertight::{Crossing, WatertightTest};

/// Body number of a ray that hit nothing.
pub const NO_BODY: u32 = u32::MAX;

/// Distance below which a ray from the antenna does not hit [m].
pub const NEAREST: f64 = 1e-9;

/// Surfaces of bodies at their poses in the sensor frame, at one time.
pub struct PosedScene {
    pub(super) surfaces: Vec<Arc<Surface>>,
    pub(super) poses: Vec<Pose>,
    pub(super) views: Vec<View>,
    /// Tree over the boxes of the bodies that have triangles: one body per leaf.
    pub(super) top: Tree,
    /// Body of every leaf of `top`.
    pub(super) bodies: Vec<u32>,
    /// Hashes of the bodies, see [`Self::content_hash`].
    pub(super) hashes: Vec<u64>,
}

/// Nearest surface along a ray.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance in lengths of the ray's direction; infinite where nothing was hit.
    pub distance: f64,
    /// Number of the body, or [`NO_BODY`].
    pub body: u32,
    /// Number of the triangle in the body's surface.
    pub triangle: u32,
    /// Barycentric weights of the triangle's corners.
    pub barycentric: [f64; 3],
}

impl Hit {
    /// Hit of a ray that meets nothing.
    pub const MISS: Self = Self {
        distance: f64::INFINITY,
        body: NO_BODY,
        triangle: u32::MAX,
        barycentric: [0.0; 3],
    };
}

/// Occlusion of points by bodies, seen from the sensor.
pub struct Occlusion {
    /// For every point, whether a body is in front of it.
    pub is_occluded: Vec<bool>,
    /// Number of searches that ended at an occluding triangle while boxes in front of it were not yet searched.
    pub ended_early: usize,
}

impl PosedScene {
    /// Put surface `i` at pose `i`. Surfaces keep their trees; only the tree over bodies is built.
    pub fn new(surfaces: Vec<Arc<Surface>>, poses: Vec<Pose>) -> Self {
        let with_triangles = |i: &u32| surfaces[*i as usize].num_triangles() > 0;
        let all: Vec<u32> = (0..surfaces.len() as u32).filter(with_triangles).collect();
        let bounds = |body: &u32| bounds(&surfaces[*body as usize], &poses[*body as usize]);
        let boxes: Vec<Bounds> = all.iter().map(bounds).collect();
        let (top, leaves) = Tree::build(boxes.len(), 1, |i| boxes[i]);
        let mut numbers = HashMap::new();
        let hash = |surface: &Arc<Surface>| {
            let number = numbers.entry(surface.content_hash()).or_insert(0_u64);
            *number += 1;
            // The first of equal bodies has the hash of its surface.
            surface.content_hash() ^ if *number > 1 { mix(*number) } else { 0 }
        };
        Self {
            hashes: surfaces.iter().map(hash).collect(),
            bodies: leaves.iter().map(|leaf| all[leaf[0] as usize]).collect(),
            surfaces,
            views: poses.iter().map(View::new).collect(),
            poses,
            top,
        }
    }

    /// View of the sensor from the frame of a body.
    pub fn view(&self, body: u32) -> &View {
        &self.views[body as usize]
    }

    /// Surface of a body.
    pub fn surface(&self, body: u32) -> &Surface {
        &self.surfaces[body as usize]
    }

    /// Hash of the vertices and triangles of a body, and of its number among the bodies of which these are equal: bodies
    /// with other ones do not change it.
    pub fn content_hash(&self, body: u32) -> u64 {
        self.hashes[body as usize]
    }

    /// Pose of a body in the sensor frame.
    pub fn pose(&self, body: u32) -> &Pose {
        &self.poses[body as usize]
    }

    /// Number of bodies, with triangles or without.
    pub fn num_bodies(&self) -> usize {
        self.surfaces.len()
    }

    /// Nearest hit of one ray of the sensor frame; of several at the same distance the first body's.
    pub fn cast(&self, ray: &Ray) -> Hit {
        self.cast_at(ray, Level::best())
    }

    /// [`Self::cast`] with a given instruction set.
    pub fn cast_at(&self, ray: &Ray, level: Level) -> Hit {
        let one = CastOne {
            scene: self,
            ray,
            far: f64::INFINITY,
            is_any_enough: false,
        };
        level.run(one).0
    }

    /// True if a ray of the sensor frame meets any triangle before `far`, in lengths of its direction. The search ends
    /// at the first triangle that it finds.
    pub fn blocks(&self, ray: &Ray, far: f64) -> bool {
        let one = CastOne {
            scene: self,
            ray,
            far,
            is_any_enough: true,
        };
        Level::best().run(one).0.body != NO_BODY
    }

    /// Occlusion of points [m] of the sensor frame. With `ends_early` a search ends at the first triangle that it
    /// finds, otherwise at the nearest; the answers are equal.
    pub fn occluded(&self, points: &[DVec3], ends_early: bool) -> Occlusion {
        let search = |point: &DVec3| {
            let ray = Ray {
                origin: DVec3::ZERO,
                direction: *point,
                start: NEAREST / point.length(),
            };
            // A surface does not occlude its own points.
            let one = CastOne {
                scene: self,
                ray: &ray,
                far: 1.0 - 1e-9,
                is_any_enough: ends_early,
            };
            let (hit, has_ended_early) = Level::best().run(one);
            (hit.body != NO_BODY, has_ended_early)
        };
        let (is_occluded, early): (Vec<bool>, Vec<bool>) = points.par_iter().map(search).unzip();
        Occlusion {
            is_occluded,
            ended_early: early.into_iter().filter(|early| *early).count(),
        }
    }

    /// The scene in other axes at the sensor, by the rotation to them.
    pub fn turned(&self, rotation: &DMat3) -> Self {
        let poses = self.poses.iter().map(|pose| pose.turned(rotation));
        Self::new(self.surfaces.clone(), poses.collect())
    }

    /// Distance of the nearest triangle that is not all behind the sensor [m].
    pub fn nearest_in_front(&self) -> f64 {
        self.bodies.iter().fold(f64::INFINITY, |nearest, &body| {
            let pose = &self.poses[body as usize];
            let (origin, forward) = (pose.point_to_body(DVec3::ZERO), pose.direction_to_body(DVec3::X));
            self.surface(body).distance_in_front(origin, forward, nearest)
        })
    }

    /// Barycentric weights of the point at which a ray `(1, u, v)` meets a triangle; of the centroid if the ray misses.
    pub fn barycentric(&self, body: u32, triangle: u32, direction: DVec3) -> [f64; 3] {
        let crossing = self.cross(direction, body, triangle);
        crossing.map_or([1.0 / 3.0; 3], |crossing| crossing.barycentric)
    }

    /// Intersection of a ray `(1, u, v)` with a triangle.
    pub(super) fn cross(&self, direction: DVec3, body: u32, triangle: u32) -> Option<Crossing> {
        let ray = self.ray_to_body(body, direction);
        WatertightTest::new(&ray).intersect(&self.surfaces[body as usize].corners(triangle))
    }

    /// Ray from the sensor in the frame of a body.
    pub(super) fn ray_to_body(&self, body: u32, direction: DVec3) -> Ray {
        let pose = &self.poses[body as usize];
        Ray {
            origin: pose.point_to_body(DVec3::ZERO),
            direction: pose.direction_to_body(direction),
            start: NEAREST,
        }
    }
}

/// Box of a surface in the sensor frame; empty if it has no triangles.
pub(super) fn bounds(surface: &Surface, pose: &Pose) -> Bounds {
    if surface.num_triangles() == 0 {
        return Bounds::EMPTY;
    }
    Bounds::of(surface.bounds().corners().map(|corner| pose.point(corner)))
}

/// Search for one ray. Returns the hit, with body [`NO_BODY`] if there is none, and whether boxes in front of it were
/// left out.
struct CastOne<'a> {
    scene: &'a PosedScene,
    ray: &'a Ray,
    /// Distance at which the search ends.
    far: f64,
    /// True if the first triangle found is enough, nearest or not.
    is_any_enough: bool,
}

impl Kernel for CastOne<'_> {
    type Output = (Hit, bool);

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> (Hit, bool) {
        let mut visitor = OneAtBodies {
            scene: self.scene,
            ray: self.ray,
            hit: Hit {
                distance: self.far,
                ..Hit::MISS
            },
            is_any_enough: self.is_any_enough,
            ended_early: false,
        };
        let single = Single::new(self.ray.origin, self.ray.direction);
        single.traverse::<I>(
            &self.scene.top,
            above(self.far),
            &mut Vec::with_capacity(64),
            &mut visitor,
        );
        (visitor.hit, visitor.ended_early)
    }
}

/// Visitor of the bodies that one ray may hit.
struct OneAtBodies<'a> {
    scene: &'a PosedScene,
    ray: &'a Ray,
    hit: Hit,
    is_any_enough: bool,
    ended_early: bool,
}

impl Visit for OneAtBodies<'_> {
    #[cfg_attr(optimised, inline(always))]
    fn expects<I: Isa>(&self, _: usize, _: &Node, _: usize) -> bool {
        true
    }

    #[cfg_attr(optimised, inline(always))] // part of a kernel
    fn visit<I: Isa>(&mut self, leaf: usize, _count: usize, _near: f32) -> f32 {
        let body = self.scene.bodies[leaf];
        let pose = self.scene.pose(body);
        let ray = Ray {
            origin: pose.point_to_body(self.ray.origin),
            direction: pose.direction_to_body(self.ray.direction),
            start: self.ray.start,
        };
        let nearest = Nearest {
            surface: self.scene.surface(body),
            ray: &ray,
            far: self.hit.distance,
            is_any_enough: self.is_any_enough,
        };
        let found = nearest.run::<I>();
        self.ended_early |= found.ended_early;
        if let Some(hit) = found.hit
            && (hit.distance < self.hit.distance || body < self.hit.body)
        {
            self.hit = Hit {
                distance: hit.distance,
                body,
                triangle: hit.triangle,
                barycentric: hit.barycentric,
            };
        }
        if self.is_any_enough && self.hit.body != NO_BODY {
            return -1.0;
        }
        above(self.hit.distance)
    }

    #[cfg_attr(optimised, inline(always))]
    fn leave_out(&mut self, near: f32) {
        self.ended_early |= near <= above(self.hit.distance);
    }
}

#[cfg(test)]
pub(super) mod tests;
