//! Facets: the triangles that eight rays of a tile hit, one in every lane.
//!
//! Where pixels are larger than triangles nearly every ray has one of its own: corners are gathered lane by lane, and
//! planes and normals computed for all lanes at once. Where several rays have the same, it is computed once for all
//! (`cargo bench --bench trace -- 'room|person'`).

use crate::numeric::simd::{Isa, Vector};
use crate::rays::packet::PACKET;
use crate::rays::surface::Surface;

/// Rays that a vector of double precision holds: half a packet.
pub const HALF: usize = PACKET / 2;

/// Number of the triangles that are remembered: walls meet in two of them at an edge.
pub const HELD: usize = 2;

/// Number of rays from which on a triangle is a group of its own.
const MANY_RAYS: u32 = 3;

/// Rays of half a packet that hit one body: those of one triangle, or of several.
pub struct Group {
    /// Bit mask of the rays, in the half.
    pub bits: u32,
    /// Number of the body.
    pub body: u32,
    /// Number of the triangle of the first ray.
    pub triangle: u32,
    /// True if all of them hit that triangle.
    pub is_one: bool,
}

/// Numbers of the triangles, with their bodies, whose planes are kept from group to group.
pub struct Held {
    keys: [(u32, u32); HELD],
    next: usize,
}

impl Held {
    /// No triangles.
    pub const NOTHING: Self = Self {
        keys: [(u32::MAX, u32::MAX); HELD],
        next: 0,
    };

    /// Place of what a group needs, and whether it is there: places of single triangles keep them, and the last place
    /// is for groups of several.
    #[inline(always)]
    pub fn place(&mut self, group: &Group) -> (usize, bool) {
        if !group.is_one {
            return (HELD, false);
        }
        let key = (group.body, group.triangle);
        for place in 0..HELD {
            if self.keys[place] == key {
                return (place, true);
            }
        }
        let place = self.next;
        self.keys[place] = key;
        self.next = (place + 1) % HELD;
        (place, false)
    }
}

impl Group {
    /// Take a group that holds the first ray out of the rest of a half (0 or 1) of a packet.
    #[inline(always)]
    pub fn take<I: Isa>(bodies: &[u32; PACKET], triangles: &[u32; PACKET], half: usize, rest: &mut u32) -> Self {
        let lane = half * HALF + rest.trailing_zeros() as usize % HALF;
        let (body, triangle) = (bodies[lane], triangles[lane]);
        let all = *rest & I::equal(bodies, body) >> (half * HALF);
        let same = all & I::equal(triangles, triangle) >> (half * HALF);
        let is_one = same == all || same.count_ones() >= MANY_RAYS;
        let bits = if is_one { same } else { all };
        *rest &= !bits;
        Self {
            bits,
            body,
            triangle,
            is_one,
        }
    }

    /// Triangle of a lane of the half; that of the first ray where the lane is not in the group.
    #[inline(always)]
    fn triangle_of(&self, triangles: &[u32], lane: usize) -> u32 {
        if self.bits >> lane & 1 == 1 {
            triangles[lane]
        } else {
            self.triangle
        }
    }

    /// Corners of the triangles in the frame of the body, corner by corner and axis by axis [m].
    #[inline(always)]
    pub fn corners<V: Vector<Scalar = f64>>(&self, surface: &Surface, triangles: &[u32]) -> [[V; 3]; 3] {
        let mut vectors = [[V::splat(0.0); 3]; 3];
        if self.is_one {
            let corners = surface.corners(self.triangle);
            for corner in 0..3 {
                for axis in 0..3 {
                    vectors[corner][axis] = V::splat(corners[corner][axis]);
                }
            }
            return vectors;
        }
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

    /// Normals at the corners of the triangles, corner by corner and axis by axis, and a bit mask of the lanes that have
    /// any.
    #[inline(always)]
    pub fn normals<V: Vector<Scalar = f64>>(&self, surface: &Surface, triangles: &[u32]) -> ([[V; 3]; 3], u32) {
        let mut vectors = [[V::splat(0.0); 3]; 3];
        if self.is_one {
            let Some(normals) = surface.corner_normals(self.triangle) else {
                return (vectors, 0);
            };
            for corner in 0..3 {
                for axis in 0..3 {
                    vectors[corner][axis] = V::splat(normals[corner][axis]);
                }
            }
            return (vectors, u32::MAX);
        }
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
#[inline(always)]
pub fn difference<V: Vector>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

/// Cross product, rounded as [`glam::DVec3::cross`] does.
#[inline(always)]
pub fn cross<V: Vector>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [
        a[1].mul(b[2]).sub(b[1].mul(a[2])),
        a[2].mul(b[0]).sub(b[2].mul(a[0])),
        a[0].mul(b[1]).sub(b[0].mul(a[1])),
    ]
}

/// Scalar product, rounded as [`glam::DVec3::dot`] does.
#[inline(always)]
pub fn rounded_dot<V: Vector>(a: [V; 3], b: [V; 3]) -> V {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// Vector in all lanes.
#[inline(always)]
pub fn in_all<V: Vector<Scalar = f64>>(x: glam::DVec3) -> [V; 3] {
    [V::splat(x.x), V::splat(x.y), V::splat(x.z)]
}
