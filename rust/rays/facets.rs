//! Facets: the triangles that rays of a tile hit.
//!
//! A triangle that several rays hit is prepared once for all of them. Where pixels are larger than triangles nearly every
//! ray has one of its own: corners of eight are gathered lane by lane, and planes and normals computed for all lanes at
//! once (`cargo bench --bench trace -- 'room|person'`).

use glam::DVec3;

use crate::numeric::simd::{Isa, Vector};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS};
use crate::rays::scene::NO_BODY;
use crate::rays::surface::Surface;

/// Rays that a vector of double precision holds: half a packet.
pub const HALF: usize = PACKET / 2;

/// Number of rays of a tile from which on a triangle is a group of its own.
const MANY_RAYS: u32 = 3;

/// Rays of a tile that have hit something and are not in any group yet, a bit each.
pub struct Groups<'a> {
    rest: u64,
    bodies: &'a [[u32; PACKET]; PACKETS],
    triangles: &'a [[u32; PACKET]; PACKETS],
}

/// Rays that hit one body: all of one triangle, or those of half a packet on several.
pub struct Group<'a> {
    /// Bit mask of the rays, in the tile.
    rays: u64,
    /// Number of the body.
    pub body: u32,
    /// Number of the triangle of the first ray.
    triangle: u32,
    /// Numbers of the triangles of the half packet with the first ray; none if all rays hit one.
    several: Option<&'a [u32]>,
}

impl<'a> Groups<'a> {
    /// All rays of a tile that have hit something; `valid`: bit masks of the rays of every packet.
    #[cfg_attr(optimised, inline(always))]
    pub fn new<I: Isa>(
        valid: &[u32; PACKETS],
        bodies: &'a [[u32; PACKET]; PACKETS],
        triangles: &'a [[u32; PACKET]; PACKETS],
    ) -> Self {
        let mut rest = 0;
        for packet in 0..PACKETS {
            let hit = valid[packet] & !I::equal(&bodies[packet], NO_BODY);
            rest |= u64::from(hit) << (packet * PACKET);
        }
        Self {
            rest,
            bodies,
            triangles,
        }
    }

    /// Take the group that holds the first of the rest of the rays.
    #[cfg_attr(optimised, inline(always))]
    pub fn take<I: Isa>(&mut self) -> Option<Group<'a>> {
        if self.rest == 0 {
            return None;
        }
        let first = self.rest.trailing_zeros() as usize % MOST_RAYS;
        let (packet, half) = (first / PACKET, first / HALF);
        let body = self.bodies[packet][first % PACKET];
        let triangle = self.triangles[packet][first % PACKET];
        let mut same = 0;
        for other in packet..PACKETS {
            let bits = I::equal(&self.triangles[other], triangle) & I::equal(&self.bodies[other], body);
            same |= u64::from(bits) << (other * PACKET);
        }
        same &= self.rest;
        let in_body = u64::from(I::equal(&self.bodies[packet], body)) << (packet * PACKET);
        let all = in_body & self.rest & (0xff << (half * HALF));
        let is_one = same.count_ones() >= MANY_RAYS || all & !same == 0;
        let rays = if is_one { same } else { all };
        self.rest &= !rays;
        let start = first % PACKET / HALF * HALF;
        Some(Group {
            rays,
            body,
            triangle,
            several: (!is_one).then(|| &self.triangles[packet][start..start + HALF]),
        })
    }
}

/// Bit mask of the rays of half a packet, from that of a tile.
#[cfg_attr(optimised, inline(always))]
fn of_half(rays: u64, half: usize) -> u32 {
    (rays >> (half * HALF)) as u32 & 0xff
}

impl Group<'_> {
    /// Take the first half packet with rays of the group: its number, and the bit mask of the rays.
    #[cfg_attr(optimised, inline(always))]
    pub fn take_half(&mut self) -> Option<(usize, u32)> {
        if self.rays == 0 {
            return None;
        }
        let half = self.rays.trailing_zeros() as usize / HALF;
        let bits = of_half(self.rays, half);
        self.rays &= !(0xff << (half * HALF));
        Some((half, bits))
    }

    /// Triangle of a lane of half a packet; that of the first ray where the lane is not in the group.
    #[cfg_attr(optimised, inline(always))]
    fn triangle_of(&self, triangles: &[u32], lane: usize) -> u32 {
        let half = self.rays.trailing_zeros() as usize / HALF;
        if of_half(self.rays, half) >> lane & 1 == 1 {
            triangles[lane]
        } else {
            self.triangle
        }
    }

    /// Corners of the triangles in the frame of the body, corner by corner and axis by axis [m].
    #[cfg_attr(optimised, inline(always))]
    pub fn corners<V: Vector<Scalar = f64>>(&self, surface: &Surface) -> [[V; 3]; 3] {
        let mut vectors = [[V::splat(0.0); 3]; 3];
        let Some(triangles) = self.several else {
            let corners = surface.corners(self.triangle);
            for corner in 0..3 {
                for axis in 0..3 {
                    vectors[corner][axis] = V::splat(corners[corner][axis]);
                }
            }
            return vectors;
        };
        let mut places = [[[0.0; HALF]; 3]; 3];
        for lane in 0..HALF {
            let corners = surface.corners(self.triangle_of(triangles, lane));
            for corner in 0..3 {
                for axis in 0..3 {
                    places[corner][axis][lane] = corners[corner][axis];
                }
            }
        }
        for corner in 0..3 {
            for axis in 0..3 {
                vectors[corner][axis] = V::load(&places[corner][axis]);
            }
        }
        vectors
    }

    /// Planes of the triangles in the frame of the body: normals of twice the areas' length, and heights over `origin` times
    /// that length. Rounded as [`WatertightTest::intersect`](crate::rays::watertight::WatertightTest::intersect) does.
    #[cfg_attr(optimised, inline(always))]
    pub fn planes<V: Vector<Scalar = f64>>(&self, surface: &Surface, origin: DVec3) -> ([V; 3], V) {
        if self.several.is_none() {
            let [a, b, c] = surface.corners(self.triangle);
            let (a, b, c) = (a - origin, b - origin, c - origin);
            let normal = (b - a).cross(c - a);
            return (in_all(normal), V::splat(normal.dot(a)));
        }
        let origin = in_all(origin);
        let [a, b, c] = self.corners::<V>(surface);
        let (a, b, c) = (difference(a, origin), difference(b, origin), difference(c, origin));
        let normal = cross(difference(b, a), difference(c, a));
        (normal, rounded_dot(normal, a))
    }

    /// Normals at the corners of the triangles, corner by corner and axis by axis, and a bit mask of the lanes that have
    /// any.
    #[cfg_attr(optimised, inline(always))]
    pub fn normals<V: Vector<Scalar = f64>>(&self, surface: &Surface) -> ([[V; 3]; 3], u32) {
        let mut vectors = [[V::splat(0.0); 3]; 3];
        let Some(triangles) = self.several else {
            let Some(normals) = surface.corner_normals(self.triangle) else {
                return (vectors, 0);
            };
            for corner in 0..3 {
                for axis in 0..3 {
                    vectors[corner][axis] = V::splat(normals[corner][axis]);
                }
            }
            return (vectors, u32::MAX);
        };
        let (mut places, mut curved) = ([[[0.0; HALF]; 3]; 3], 0);
        for lane in 0..HALF {
            let Some(normals) = surface.corner_normals(self.triangle_of(triangles, lane)) else {
                continue;
            };
            curved |= 1 << lane;
            for corner in 0..3 {
                for axis in 0..3 {
                    places[corner][axis][lane] = normals[corner][axis];
                }
            }
        }
        for corner in 0..3 {
            for axis in 0..3 {
                vectors[corner][axis] = V::load(&places[corner][axis]);
            }
        }
        (vectors, curved)
    }
}

/// `a - b`
#[cfg_attr(optimised, inline(always))]
pub fn difference<V: Vector>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

/// Cross product, rounded as [`glam::DVec3::cross`] does.
#[cfg_attr(optimised, inline(always))]
pub fn cross<V: Vector>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [
        a[1].mul(b[2]).sub(b[1].mul(a[2])),
        a[2].mul(b[0]).sub(b[2].mul(a[0])),
        a[0].mul(b[1]).sub(b[0].mul(a[1])),
    ]
}

/// Scalar product, rounded as [`glam::DVec3::dot`] does.
#[cfg_attr(optimised, inline(always))]
pub fn rounded_dot<V: Vector>(a: [V; 3], b: [V; 3]) -> V {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// Vector in all lanes.
#[cfg_attr(optimised, inline(always))]
pub fn in_all<V: Vector<Scalar = f64>>(x: DVec3) -> [V; 3] {
    [V::splat(x.x), V::splat(x.y), V::splat(x.z)]
}
