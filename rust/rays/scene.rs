//! Scene of posed bodies: a tree over their boxes above the trees of their surfaces.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::geometry::aabb::Bounds;
use crate::geometry::pose::Pose;
use crate::numeric::random::mix;
use crate::rays::packet::SensorPose;
use crate::rays::surface::Surface;
use crate::rays::tree::Tree;
use crate::rays::watertight::{Crossing, Ray, WatertightTest};

/// Body number of a ray that hit nothing.
pub const NO_BODY: u32 = u32::MAX;

/// Distance below which a ray from the antenna does not hit [m].
pub const NEAREST: f64 = 1e-9;

/// Surfaces of bodies at their poses in the sensor frame, at one time.
pub struct PosedScene {
    pub(super) surfaces: Vec<Arc<Surface>>,
    pub(super) poses: Vec<Pose>,
    pub(super) sensor_poses: Vec<SensorPose>,
    /// Tree over the boxes of the bodies that have triangles: one body per leaf.
    pub(super) top: Tree,
    /// Body of every leaf of `top`.
    pub(super) bodies: Vec<u32>,
    /// Hashes of the bodies, see [`Self::content_hash`].
    pub(super) hashes: Vec<u64>,
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
            sensor_poses: poses.iter().map(SensorPose::new).collect(),
            poses,
            top,
        }
    }

    /// Position and axes of the sensor in the frame of a body.
    pub fn view(&self, body: u32) -> &SensorPose {
        &self.sensor_poses[body as usize]
    }

    /// Surface of a body.
    pub fn surface(&self, body: u32) -> &Surface {
        &self.surfaces[body as usize]
    }

    /// Hash of the vertices and triangles of a body, and of its number among bodies with equal ones: other bodies do
    /// not change it.
    pub fn content_hash(&self, body: u32) -> u64 {
        self.hashes[body as usize]
    }

    /// Pose of a body in the sensor frame.
    pub fn pose(&self, body: u32) -> &Pose {
        &self.poses[body as usize]
    }

    /// Corners of the box of a body, in the sensor frame.
    pub fn corners(&self, body: u32) -> [DVec3; 8] {
        let pose = self.pose(body);
        self.surface(body).bounds().corners().map(|corner| pose.point(corner))
    }

    /// Number of bodies, with triangles or without.
    pub fn num_bodies(&self) -> usize {
        self.surfaces.len()
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
