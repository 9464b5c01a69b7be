//! Triangle block: the triangles of a leaf in single precision, tested against rays of one origin with bounds on every
//! rounding.
//!
//! A ray `o + t D` meets a triangle of corners `a, b, c`, relative to `o`, if `D . ((a + b) x (b - a))` and its like
//! for the other edges have one sign (Plücker coordinates for a common origin). All planes of the leaf are computed at
//! once.
//!
//! Errors, in units of `u = 2^-24`, where `R` bounds relative coordinates, `L` is the longest edge (sum of
//! coordinates), and `l` bounds the coordinates of directions. A relative corner is off by `2 u R` along every axis.
//!
//! - Sides: moving a corner changes `D . n` by twice the distance of the ray from the other corner, at most `L` for a
//!   ray that meets the triangle: `14 u R L l` for both; the cross product adds 14, the scalar product 10, directions
//!   15: [`SIDE`].
//! - Slopes `D . N`: `37 u R L l`. Distances hold where the slope is at least twice the tolerance of sides.
//! - Distances: the corner adds `4 u R`, the normal `22 u R L` over at most `L`, the height 6 and the slope 18 `u R`,
//!   all along the normal: `50 u R L^2 / (D . N)` in `t`, and 1.4 times that with the error of the slope itself:
//!   [`DISTANCE`].
//! - Which side of a triangle the origin is on: `55 u R^2 L`: [`FACE`].
//!
//! A ray with all sides above twice the tolerance meets the triangle, wherever it passes: at a distance of `r L` from
//! the triangle the error of sides is below `(53 + 14 r) u R L l`. For `r < 3` that is less than twice the tolerance.
//! From there on a barycentric coordinate is below `(1 - r) / 3`, and the side, `2 (D . N)` times that, is below by
//! more than the error grows.

use glam::DVec3;

use crate::numeric::simd::{Isa, Vector};
use crate::rays::tree::WIDTH;

/// Half the distance of 1 from the next number of single precision.
pub const UNIT: f32 = 0.5 * f32::EPSILON;

const SIDE: f32 = 64.0 * UNIT;
const DISTANCE: f32 = 96.0 * UNIT;
const FACE: f32 = 64.0 * UNIT;

/// Triangle block: up to 16 triangles of a leaf in single precision, axis by axis.
#[derive(Clone)]
#[repr(C, align(64))]
pub struct TriangleBlock {
    corners: [[[f32; WIDTH]; 3]; 3],
    /// Numbers of the triangles; the last one repeated.
    pub triangles: [u32; WIDTH],
}

impl TriangleBlock {
    /// Block from the corners of [`WIDTH`] triangles, relative to the anchor of the surface.
    pub fn new(triangles: [u32; WIDTH], mut corners: impl FnMut(u32) -> [DVec3; 3]) -> Self {
        let mut block = Self {
            corners: [[[0.0; WIDTH]; 3]; 3],
            triangles,
        };
        for (lane, triangle) in triangles.into_iter().enumerate() {
            for (corner, position) in corners(triangle).into_iter().enumerate() {
                for axis in 0..3 {
                    block.corners[corner][axis][lane] = position[axis] as f32;
                }
            }
        }
        block
    }
}

#[cfg_attr(optimised, inline(always))]
fn abs<V: Vector>(x: V) -> V {
    x.max(V::splat(V::Scalar::default()).sub(x))
}

#[cfg_attr(optimised, inline(always))]
fn cross<V: Vector>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [
        a[2].neg_mul_add(b[1], a[1].mul(b[2])),
        a[0].neg_mul_add(b[2], a[2].mul(b[0])),
        a[1].neg_mul_add(b[0], a[0].mul(b[1])),
    ]
}

/// Planes of the triangles of a block, with signs such that rays that meet a triangle are above all of its planes.
#[repr(C, align(64))]
pub struct Planes {
    /// Normals of the planes of every edge, axis by axis.
    edges: [[[f32; WIDTH]; 3]; 3],
    normal: [[f32; WIDTH]; 3],
    /// Height of the triangle's plane over the origin, times the length of the normal.
    height: [f32; WIDTH],
    /// Error of `D . edges`.
    tolerance: [f32; WIDTH],
    /// Error of distances, times `D . normal`.
    slack: [f32; WIDTH],
    /// A bit per triangle whose plane goes through the origin, as far as single precision can tell: the signs of its
    /// planes may be wrong.
    pub unclear: u32,
}

/// Distances of a packet of rays to a triangle.
pub struct Distances<V> {
    /// Bit mask of the rays that certainly meet the triangle.
    pub certain: u32,
    /// Bit mask of the rays whose bounds hold if they meet.
    pub measured: u32,
    /// Lower bound of the distance.
    pub near: V,
    /// Upper bound of the distance.
    pub far: V,
}

impl Planes {
    /// Planes of no triangles.
    pub const EMPTY: Self = Self {
        edges: [[[0.0; WIDTH]; 3]; 3],
        normal: [[0.0; WIDTH]; 3],
        height: [0.0; WIDTH],
        tolerance: [0.0; WIDTH],
        slack: [0.0; WIDTH],
        unclear: 0,
    };

    /// Planes through the origin and each edge, of all triangles of a block; `max_coordinate` bounds the coordinates of
    /// origin and corners together, `length` the coordinates of directions. Without `DISTANCES` only for
    /// [`Self::may_meet`].
    #[cfg_attr(optimised, inline(always))]
    pub fn fill<I: Isa, const DISTANCES: bool>(
        &mut self,
        block: &TriangleBlock,
        origin: &[f32; 3],
        max_coordinate: f32,
        length: f32,
    ) {
        let splat = <I::F32 as Vector>::splat;
        let zero = splat(0.0);
        let mut corners = [[zero; 3]; 3];
        for corner in 0..3 {
            for axis in 0..3 {
                corners[corner][axis] = I::F32::load(&block.corners[corner][axis]).sub(splat(origin[axis]));
            }
        }
        let mut edges = [[zero; 3]; 3];
        let mut sides = [[zero; 3]; 3];
        let mut longest = zero;
        for edge in 0..3 {
            let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
            let mut sum = [zero; 3];
            for axis in 0..3 {
                sum[axis] = a[axis].add(b[axis]);
                sides[edge][axis] = b[axis].sub(a[axis]);
            }
            edges[edge] = cross(sum, sides[edge]);
            let [x, y, z] = sides[edge];
            longest = longest.max(abs(x).add(abs(y)).add(abs(z)));
        }
        let normal = cross(sides[0], sides[1]);
        let [x, y, z] = normal;
        let [a, b, c] = corners[0];
        let height = a.mul(x).add(b.mul(y)).add(c.mul(z));

        // Planes of triangles seen from behind change sign.
        let sign = splat(-1.0).select(height.at_most(zero), splat(1.0));
        let height = height.mul(sign);
        for axis in 0..3 {
            for edge in 0..3 {
                edges[edge][axis].mul(sign).store(&mut self.edges[edge][axis]);
            }
            if DISTANCES {
                normal[axis].mul(sign).store(&mut self.normal[axis]);
            }
        }
        longest
            .mul(splat(SIDE * max_coordinate * length))
            .store(&mut self.tolerance);
        if DISTANCES {
            height.store(&mut self.height);
            longest
                .mul(longest)
                .mul(splat(DISTANCE * max_coordinate))
                .store(&mut self.slack);
        }
        self.unclear = height.at_most(longest.mul(splat(FACE * max_coordinate * max_coordinate)));
    }

    /// Bit mask of triangles that any direction within `half` of `center` may meet.
    #[cfg_attr(optimised, inline(always))]
    pub fn may_meet<I: Isa>(&self, center: &[f32; 3], half: &[f32; 3]) -> u32 {
        let splat = <I::F32 as Vector>::splat;
        let tolerance = I::F32::load(&self.tolerance);
        let mut bits = u32::MAX;
        for edge in 0..3 {
            let mut side = tolerance.add(tolerance);
            for axis in 0..3 {
                let plane = I::F32::load(&self.edges[edge][axis]);
                side = plane.mul_add(splat(center[axis]), side);
                side = abs(plane).mul_add(splat(half[axis]), side);
            }
            bits &= splat(0.0).at_most(side);
        }
        bits | self.unclear
    }

    /// Bit mask of rays that may meet a triangle, and depth inside: the least distance from an edge's plane plus
    /// the tolerance.
    #[cfg_attr(optimised, inline(always))]
    pub fn meet<V: Vector<Scalar = f32>>(&self, triangle: usize, directions: &[V; 3]) -> (u32, V) {
        let tolerance = V::splat(self.tolerance[triangle]);
        let mut sides = [tolerance; 3];
        for edge in 0..3 {
            for axis in 0..3 {
                sides[edge] = directions[axis].mul_add(V::splat(self.edges[edge][axis][triangle]), sides[edge]);
            }
        }
        let least = sides[0].min(sides[1]).min(sides[2]);
        let mut met = V::splat(0.0).at_most(least);
        if self.unclear >> triangle & 1 == 1 {
            // The ray may also be below all planes.
            let most = sides[0].max(sides[1]).max(sides[2]);
            met |= most.at_most(tolerance.add(tolerance));
        }
        (met, least)
    }

    /// Distances of rays to a triangle, from the depth that [`Self::meet`] returned.
    #[cfg_attr(optimised, inline(always))]
    pub fn distances<V: Vector<Scalar = f32>>(&self, triangle: usize, directions: &[V; 3], depth: V) -> Distances<V> {
        let mut slope = V::splat(0.0);
        for axis in 0..3 {
            slope = directions[axis].mul_add(V::splat(self.normal[axis][triangle]), slope);
        }
        let inverse = V::splat(1.0).div(slope);
        let distance = inverse.mul(V::splat(self.height[triangle]));
        let slack = inverse.mul(V::splat(self.slack[triangle]));
        Distances {
            certain: V::splat(3.0 * self.tolerance[triangle]).at_most(depth),
            measured: V::splat(2.0 * self.tolerance[triangle]).at_most(slope),
            near: distance.sub(slack),
            far: distance.add(slack),
        }
    }
}
