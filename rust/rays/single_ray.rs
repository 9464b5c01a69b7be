//! Search of a scene for one ray: the nearest triangle, or any.

use glam::DVec3;
use rayon::prelude::*;

use crate::numeric::simd::{Isa, Kernel, Level, prefetch};
use crate::rays::scene::{NEAREST, NO_BODY, PosedScene};
use crate::rays::surface::Surface;
use crate::rays::traversal::{Search, Slabs, StackEntry, traverse};
use crate::rays::tree::{Node, WIDTH};
use crate::rays::triangle_block::{Planes, UNIT};
use crate::rays::watertight::{Ray, WatertightTest};

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

impl PosedScene {
    /// Nearest hit of one ray of the sensor frame; of several at the same distance the first body's.
    pub fn cast(&self, ray: &Ray) -> Hit {
        Level::best().run(RayCast {
            scene: self,
            ray,
            far: f64::INFINITY,
            any_hit: false,
        })
    }

    /// True if a ray of the sensor frame meets any triangle before `far`, in lengths of its direction. The search ends
    /// at the first triangle that it finds.
    pub fn blocks(&self, ray: &Ray, far: f64) -> bool {
        let cast = RayCast {
            scene: self,
            ray,
            far,
            any_hit: true,
        };
        Level::best().run(cast).body != NO_BODY
    }

    /// For every point [m] of the sensor frame, whether a body is in front of it.
    pub fn occluded(&self, points: &[DVec3]) -> Vec<bool> {
        let is_occluded = |point: &DVec3| {
            let ray = Ray {
                origin: DVec3::ZERO,
                direction: *point,
                start: NEAREST / point.length(),
            };
            // A surface does not occlude its own points.
            self.blocks(&ray, 1.0 - 1e-9)
        };
        points.par_iter().map(is_occluded).collect()
    }
}

/// Kernel that searches a scene for one ray in the sensor frame.
pub struct RayCast<'a> {
    /// Scene to search.
    pub scene: &'a PosedScene,
    /// Ray in the sensor frame.
    pub ray: &'a Ray,
    /// Distance at which the search ends, in lengths of the direction.
    pub far: f64,
    /// True if the first triangle found is enough, nearest or not.
    pub any_hit: bool,
}

impl Kernel for RayCast<'_> {
    type Output = Hit;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> Hit {
        let mut search = BodySearch {
            slabs: SingleRay::new(self.ray.origin, self.ray.direction).slabs(),
            hit: Hit {
                distance: self.far,
                ..Hit::MISS
            },
            planes: Planes::EMPTY,
            stack: Vec::with_capacity(64),
            cast: self,
        };
        traverse::<I, 1>(&search.cast.scene.top, 1, &mut Vec::with_capacity(64), &mut search);
        search.hit
    }
}

/// Distance at which a search ends after a hit, in single precision and rounded up.
#[cfg_attr(optimised, inline(always))]
fn end(hit: &Hit, any_hit: bool) -> f32 {
    if any_hit && hit.body != NO_BODY {
        return -1.0;
    }
    (hit.distance.min(f64::from(f32::MAX)) as f32).next_up()
}

/// Search of the bodies that a ray may hit.
struct BodySearch<'a> {
    cast: RayCast<'a>,
    slabs: Slabs,
    hit: Hit,
    planes: Planes,
    stack: Vec<StackEntry>,
}

impl Search<1> for BodySearch<'_> {
    #[cfg_attr(optimised, inline(always))]
    fn far(&self) -> f32 {
        end(&self.hit, self.cast.any_hit)
    }

    #[cfg_attr(optimised, inline(always))]
    fn enter<I: Isa>(&self, _: usize, node: &Node, near: &mut [f32; WIDTH]) -> u32 {
        self.slabs.enter::<I>(node, self.far(), near)
    }

    #[cfg_attr(optimised, inline(always))]
    fn visit<I: Isa>(&mut self, _: u32, leaf: usize, _: usize, _: f32) {
        let scene = self.cast.scene;
        let body = scene.bodies[leaf];
        let (surface, pose) = (scene.surface(body), scene.pose(body));
        let ray = Ray {
            origin: pose.point_to_body(self.cast.ray.origin),
            direction: pose.direction_to_body(self.cast.ray.direction),
            start: self.cast.ray.start,
        };
        let single = SingleRay::new(ray.origin - surface.anchor, ray.direction);
        let mut search = TriangleSearch {
            surface,
            body,
            slabs: single.slabs(),
            single,
            test: WatertightTest::new(&ray),
            planes: &mut self.planes,
            hit: &mut self.hit,
            any_hit: self.cast.any_hit,
        };
        traverse::<I, 1>(&surface.tree, 1, &mut self.stack, &mut search);
    }
}

/// Search of the triangles of a body that a ray may hit.
struct TriangleSearch<'a> {
    surface: &'a Surface,
    body: u32,
    slabs: Slabs,
    single: SingleRay,
    test: WatertightTest,
    planes: &'a mut Planes,
    hit: &'a mut Hit,
    any_hit: bool,
}

impl Search<1> for TriangleSearch<'_> {
    #[cfg_attr(optimised, inline(always))]
    fn far(&self) -> f32 {
        end(self.hit, self.any_hit)
    }

    #[cfg_attr(optimised, inline(always))]
    fn enter<I: Isa>(&self, _: usize, node: &Node, near: &mut [f32; WIDTH]) -> u32 {
        self.slabs.enter::<I>(node, self.far(), near)
    }

    #[cfg_attr(optimised, inline(always))]
    fn should_visit<I: Isa>(&self, packets: u32, leaf: usize, _: &Node, _: usize) -> u32 {
        prefetch(&self.surface.blocks[leaf]);
        packets
    }

    #[cfg_attr(optimised, inline(always))]
    fn visit<I: Isa>(&mut self, _: u32, leaf: usize, count: usize, _: f32) {
        let (surface, single) = (self.surface, &self.single);
        let block = &surface.blocks[leaf];
        let max_coordinate = surface.max_coordinate + single.max_coordinate;
        self.planes
            .fill::<I, false>(block, &single.origin, max_coordinate, single.length);
        let mut met = self.planes.may_meet::<I>(&single.direction, &[0.0; 3]) & ((1 << count) - 1);
        while met != 0 {
            let triangle = block.triangles[met.trailing_zeros() as usize];
            met &= met - 1;
            let Some(crossing) = self.test.intersect(&surface.corners(triangle)) else {
                continue;
            };
            // Of several at the same distance the first.
            let is_first = (self.body, triangle) < (self.hit.body, self.hit.triangle);
            if crossing.distance < self.hit.distance || crossing.distance == self.hit.distance && is_first {
                *self.hit = Hit {
                    distance: crossing.distance,
                    body: self.body,
                    triangle,
                    barycentric: crossing.barycentric,
                };
            }
        }
    }
}

/// Ray in single precision relative to a point of a body, with bounds of its coordinates.
struct SingleRay {
    origin: [f32; 3],
    /// Bound of the coordinates of the origin.
    max_coordinate: f32,
    direction: [f32; 3],
    /// Bound of the coordinates of the direction.
    length: f32,
}

impl SingleRay {
    #[cfg_attr(optimised, inline(always))]
    fn new(origin: DVec3, direction: DVec3) -> Self {
        Self {
            origin: origin.to_array().map(|x| x as f32),
            max_coordinate: origin.abs().max_element() as f32 * (1.0 + 2.0 * UNIT),
            direction: direction.to_array().map(|x| x as f32),
            length: direction.abs().element_sum() as f32 * (1.0 + 2.0 * UNIT),
        }
    }

    #[cfg_attr(optimised, inline(always))]
    fn slabs(&self) -> Slabs {
        let low = self.direction.map(f32::next_down);
        let high = self.direction.map(f32::next_up);
        Slabs::new(&self.origin, self.max_coordinate, &low, &high)
    }
}
