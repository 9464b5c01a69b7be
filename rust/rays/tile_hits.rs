//! Hits of the rays of a tile in double precision: distances to the triangles, and distances, normals and cosines of
//! the curved surfaces that they approximate, in one pass.
//!
//! A triangle that several rays hit is prepared once for all of them. Where pixels are larger than triangles nearly
//! every ray has one of its own: corners of eight are gathered lane by lane, and all is computed for eight lanes at
//! once (`cargo bench --bench trace -- 'room|person'`).

use glam::{DMat3, DVec3};

use crate::geometry::curved_triangle::MAX_CORRECTED_COSINE;
use crate::numeric::simd::{Isa, Vector};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS, TileRays};
use crate::rays::packet_hits::PacketHits;
use crate::rays::scene::{NO_BODY, PosedScene};

/// Rays that a vector of double precision holds: half a packet.
pub const HALF: usize = PACKET / 2;

/// Number of rays of a tile from which on a triangle is a group of its own.
const MANY_RAYS: u32 = 3;

/// Measured hits of the rays of a tile.
#[repr(C, align(64))]
pub struct TileHits {
    /// Lengths of the directions `(1, u, v)`.
    pub length: [f64; MOST_RAYS],
    /// Distance along the ray to the triangle [m]; infinite where nothing was hit.
    pub distance: [f64; MOST_RAYS],
    /// Distance to the curved surface [m].
    pub surface_distance: [f64; MOST_RAYS],
    /// Cosine of incidence; zero where nothing was hit.
    pub cosine: [f64; MOST_RAYS],
    /// Unit normal on the incident side in the sensor frame, axis by axis; zero where nothing was hit.
    pub normal: [[f64; MOST_RAYS]; 3],
}

impl TileHits {
    /// Hits of rays that hit nothing.
    pub const NOTHING: Self = Self {
        length: [1.0; MOST_RAYS],
        distance: [f64::INFINITY; MOST_RAYS],
        surface_distance: [f64::INFINITY; MOST_RAYS],
        cosine: [0.0; MOST_RAYS],
        normal: [[0.0; MOST_RAYS]; 3],
    };

    /// Unit normal at the hit of a ray.
    pub fn normal_of(&self, ray: usize) -> DVec3 {
        let [x, y, z] = &self.normal;
        DVec3::new(x[ray], y[ray], z[ray])
    }

    /// Measure the hits of a tile, as [`crate::geometry::curved_triangle::shade`] does.
    #[cfg_attr(optimised, inline(always))]
    pub fn measure<I: Isa>(&mut self, scene: &PosedScene, rays: &TileRays, hits: &PacketHits) {
        self.clear::<I>(rays);
        let known = self.measure_edge_on(scene, rays, hits);
        let mut rest = 0;
        for packet in 0..PACKETS {
            let is_hit = rays.valid[packet] & !I::equal(&hits.body[packet], NO_BODY);
            rest |= u64::from(is_hit) << (packet * PACKET);
        }
        while rest != 0 {
            // The group of the first ray: all rays on its triangle, or the rays of its half packet on its body.
            let first = rest.trailing_zeros() as usize % MOST_RAYS;
            let (packet, half) = (first / PACKET, first / HALF);
            let body = hits.body[packet][first % PACKET];
            let triangle = hits.triangle[packet][first % PACKET];
            let mut on_triangle = 0;
            for other in packet..PACKETS {
                let bits = I::equal(&hits.triangle[other], triangle) & I::equal(&hits.body[other], body);
                on_triangle |= u64::from(bits) << (other * PACKET);
            }
            on_triangle &= rest;
            let on_body = u64::from(I::equal(&hits.body[packet], body)) << (packet * PACKET);
            let on_body = on_body & rest & (0xff << (half * HALF));
            let is_one = on_triangle.count_ones() >= MANY_RAYS || on_body & !on_triangle == 0;
            let mut group = if is_one { on_triangle } else { on_body };
            rest &= !group;
            let mut triangles = [triangle; HALF];
            if !is_one {
                for lane in 0..HALF {
                    if of_half(group, half) >> lane & 1 == 1 {
                        triangles[lane] = hits.triangle[packet][half % 2 * HALF + lane];
                    }
                }
            }
            let facets = FacetLanes::<I::F64>::new(scene, body, &triangles[..if is_one { 1 } else { HALF }]);
            while group != 0 {
                let half = group.trailing_zeros() as usize / HALF;
                let bits = of_half(group, half);
                group &= !(0xff << (half * HALF));
                self.measure_half::<I>(scene, rays, body, &facets, half, (bits, of_half(known, half)));
            }
        }
    }

    /// Lengths of all directions, and no hits.
    #[cfg_attr(optimised, inline(always))]
    fn clear<I: Isa>(&mut self, rays: &TileRays) {
        let splat = <I::F64 as Vector>::splat;
        for first in (0..MOST_RAYS).step_by(HALF) {
            let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
            let length = splat(1.0).add(u.mul(u)).add(v.mul(v)).sqrt();
            length.store(&mut self.length[first..]);
            splat(f64::INFINITY).store(&mut self.distance[first..]);
            splat(f64::INFINITY).store(&mut self.surface_distance[first..]);
            splat(0.0).store(&mut self.cosine[first..]);
            for axis in 0..3 {
                splat(0.0).store(&mut self.normal[axis][first..]);
            }
        }
    }

    /// Distances of the rays that lie in the planes of their triangles, by the exact test. Returns a bit per ray.
    #[cfg_attr(optimised, inline(always))]
    fn measure_edge_on(&mut self, scene: &PosedScene, rays: &TileRays, hits: &PacketHits) -> u64 {
        let mut known = 0;
        for packet in 0..PACKETS {
            known |= u64::from(hits.edge_on[packet]) << (packet * PACKET);
        }
        let mut rest = known;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let (packet, lane) = (ray / PACKET, ray % PACKET);
            let crossing = scene.cross(
                rays.direction(ray),
                hits.body[packet][lane],
                hits.triangle[packet][lane],
            );
            self.distance[ray] = crossing.map_or(f64::INFINITY, |crossing| crossing.distance * self.length[ray]);
        }
        known
    }

    /// Measure the hits of the rays `bits` of half a packet on triangles of a body; the distances of `known` are.
    #[cfg_attr(optimised, inline(always))]
    fn measure_half<I: Isa>(
        &mut self,
        scene: &PosedScene,
        rays: &TileRays,
        body: u32,
        facets: &FacetLanes<I::F64>,
        half: usize,
        (bits, known): (u32, u32),
    ) {
        let first = half * HALF;
        let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
        let direction = scene.view(body).direction(u, v);
        let length = I::F64::load(&self.length[first..]);
        let slope = rounded_dot(facets.face, direction);
        let mut distance = facets.height.div(slope).mul(length);
        if bits & known != 0 {
            distance = I::F64::load(&self.distance[first..]).select(known, distance);
        }
        put(distance, bits, &mut self.distance[first..]);
        let (cosine, correction, normal) = facets.shade(direction, slope, length, distance);
        put(distance.add(correction), bits, &mut self.surface_distance[first..]);
        put(cosine, bits, &mut self.cosine[first..]);
        let normal = rotated(&scene.pose(body).rotation, normal);
        for axis in 0..3 {
            put(normal[axis], bits, &mut self.normal[axis][first..]);
        }
    }
}

/// Store the lanes of a bit mask. Masked stores are slow on some processors, and most masks have all bits.
#[cfg_attr(optimised, inline(always))]
fn put<V: Vector<Scalar = f64>>(x: V, bits: u32, to: &mut [f64]) {
    if bits == 0xff {
        x.store(to);
    } else {
        x.select(bits, V::load(to)).store(to);
    }
}

/// Bit mask of the rays of half a packet, from a mask of a tile.
#[cfg_attr(optimised, inline(always))]
fn of_half(rays: u64, half: usize) -> u32 {
    (rays >> (half * HALF)) as u32 & 0xff
}

/// Triangles in the frame of their body, one in every lane.
#[derive(Clone, Copy)]
struct FacetLanes<V> {
    /// First corner relative to the sensor [m].
    corner: [V; 3],
    /// Normal of twice the area's length, and the height of the plane over the sensor times that length. Rounded as in
    /// [`WatertightTest::intersect`](crate::rays::watertight::WatertightTest::intersect).
    face: [V; 3],
    height: V,
    /// Inverse of the length of `face`.
    inverse: V,
    /// Bit mask of the lanes whose triangles approximate a curved surface: the fields below are for them.
    curved: u32,
    /// Vectors whose scalar products with a point relative to the first corner are the weights of the second and the
    /// third.
    weights: [[V; 3]; 2],
    /// Normal at the first corner, and differences of the other two from it.
    normal: [V; 3],
    normal_change: [[V; 3]; 2],
    /// Heights of the second and the third corner over the first, along the normals at them [m].
    heights: [V; 2],
}

impl<V: Vector<Scalar = f64>> FacetLanes<V> {
    /// Prepare one triangle for all lanes, or one for each.
    #[cfg_attr(optimised, inline(always))]
    fn new(scene: &PosedScene, body: u32, triangles: &[u32]) -> Self {
        let (surface, origin) = (scene.surface(body), in_all(scene.view(body).origin));
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let ([a, b, c], _) = gather::<V>(triangles, |triangle| Some(surface.corners(triangle)));
        let (first, second) = (difference(b, a), difference(c, a));
        let corner = difference(a, origin);
        let face = cross(first, second);
        let mut facets = Self {
            corner,
            face,
            height: rounded_dot(face, corner),
            inverse: zero,
            curved: 0,
            weights: [[zero; 3]; 2],
            normal: [zero; 3],
            normal_change: [[zero; 3]; 2],
            heights: [zero; 2],
        };
        let square = rounded_dot(face, face);
        facets.inverse = one.div(square.sqrt());
        let ([a, b, c], curved) = gather::<V>(triangles, |triangle| surface.corner_normals(triangle));
        facets.curved = curved;
        if curved != 0 {
            let inverse = one.div(square);
            facets.weights = [scale(cross(second, face), inverse), scale(cross(face, first), inverse)];
            facets.normal = a;
            facets.normal_change = [difference(b, a), difference(c, a)];
            facets.heights = [rounded_dot(first, b), rounded_dot(second, c)];
        }
        facets
    }

    /// Cosine of incidence, distance from the triangle to the curved surface along the ray [m], and unit normal on the
    /// incident side, from directions, their components along `face`, their lengths, and distances along them [m].
    #[cfg_attr(optimised, inline(always))]
    fn shade(&self, direction: [V; 3], slope: V, length: V, distance: V) -> (V, V, [V; 3]) {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let inverse = one.div(length);
        // Sign that turns the normal to the incident side.
        let side = V::splat(-1.0).select(zero.at_most(slope), one);
        let signed = side.mul(self.inverse);
        let mut normal = scale(self.face, signed);
        let mut cosine = slope.mul(signed).mul(inverse);
        let mut correction = zero;
        if self.curved != 0 {
            let mut point = scale(direction, distance.mul(inverse));
            for axis in 0..3 {
                point[axis] = point[axis].sub(self.corner[axis]);
            }
            let second = dot(self.weights[0], point);
            let third = dot(self.weights[1], point);
            let mut mean = self.normal;
            for axis in 0..3 {
                let [b, c] = &self.normal_change;
                mean[axis] = c[axis].mul_add(third, b[axis].mul_add(second, mean[axis]));
            }
            let unit = side.div(dot(mean, mean).sqrt());
            let curved = dot(mean, direction).mul(unit).mul(inverse);
            let is_curved = self.curved & curved.at_most(V::splat(MAX_CORRECTED_COSINE));
            let height = second
                .mul(self.heights[0])
                .add(third.mul(self.heights[1]))
                .sub(dot(mean, point))
                .mul(side);
            correction = height.div(curved.add(curved)).select(is_curved, correction);
            cosine = curved.select(is_curved, cosine);
            let mean = scale(mean, unit);
            for axis in 0..3 {
                normal[axis] = mean[axis].select(is_curved, normal[axis]);
            }
        }
        (zero.sub(cosine).max(zero).min(one), correction, normal)
    }
}

/// Three vectors of every triangle, one after the other and axis by axis: of one triangle in all lanes, or of one per
/// lane. Also a bit mask of the lanes that have any.
#[cfg_attr(optimised, inline(always))]
fn gather<V: Vector<Scalar = f64>>(triangles: &[u32], of: impl Fn(u32) -> Option<[DVec3; 3]>) -> ([[V; 3]; 3], u32) {
    let mut vectors = [[V::splat(0.0); 3]; 3];
    if let [triangle] = triangles {
        let Some(all) = of(*triangle) else {
            return (vectors, 0);
        };
        for i in 0..3 {
            vectors[i] = in_all(all[i]);
        }
        return (vectors, u32::MAX);
    }
    let (mut values, mut has_any) = ([[[0.0; HALF]; 3]; 3], 0);
    for lane in 0..HALF {
        if let Some(all) = of(triangles[lane]) {
            has_any |= 1 << lane;
            for i in 0..3 {
                for axis in 0..3 {
                    values[i][axis][lane] = all[i][axis];
                }
            }
        }
    }
    for i in 0..3 {
        for axis in 0..3 {
            vectors[i][axis] = V::load(&values[i][axis]);
        }
    }
    (vectors, has_any)
}

/// `a - b`
#[cfg_attr(optimised, inline(always))]
fn difference<V: Vector>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

/// Cross product, rounded as [`glam::DVec3::cross`] does.
#[cfg_attr(optimised, inline(always))]
fn cross<V: Vector>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [
        a[1].mul(b[2]).sub(b[1].mul(a[2])),
        a[2].mul(b[0]).sub(b[2].mul(a[0])),
        a[0].mul(b[1]).sub(b[0].mul(a[1])),
    ]
}

/// Scalar product, rounded as [`glam::DVec3::dot`] does.
#[cfg_attr(optimised, inline(always))]
fn rounded_dot<V: Vector>(a: [V; 3], b: [V; 3]) -> V {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// Scalar product with fewer roundings.
#[cfg_attr(optimised, inline(always))]
fn dot<V: Vector>(a: [V; 3], b: [V; 3]) -> V {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
}

#[cfg_attr(optimised, inline(always))]
fn scale<V: Vector>(a: [V; 3], by: V) -> [V; 3] {
    [a[0].mul(by), a[1].mul(by), a[2].mul(by)]
}

/// Vector in all lanes.
#[cfg_attr(optimised, inline(always))]
fn in_all<V: Vector<Scalar = f64>>(x: DVec3) -> [V; 3] {
    [V::splat(x.x), V::splat(x.y), V::splat(x.z)]
}

#[cfg_attr(optimised, inline(always))]
fn rotated<V: Vector<Scalar = f64>>(rotation: &DMat3, x: [V; 3]) -> [V; 3] {
    let (a, b): ([V; 3], [V; 3]) = (in_all(rotation.x_axis), in_all(rotation.y_axis));
    let c: [V; 3] = in_all(rotation.z_axis);
    let mut rotated = x;
    for axis in 0..3 {
        rotated[axis] = c[axis].mul_add(x[2], b[axis].mul_add(x[1], a[axis].mul(x[0])));
    }
    rotated
}
