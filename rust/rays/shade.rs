//! Shade of a tile: distances and normals of the curved surface at the hits of its rays.

use glam::{DMat3, DVec3};

use crate::geometry::curved_triangle::MAX_CORRECTED_COSINE;
use crate::numeric::simd::{Isa, Vector};
use crate::rays::facets::{Group, Groups, HALF, cross, difference, in_all, rounded_dot};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS, TileRays};
use crate::rays::scene::PosedScene;

/// Smooth hits of the rays of a tile; see [`crate::rays::hits::Hits`].
pub struct Shade {
    /// Cosine of incidence.
    pub cosine: [f64; MOST_RAYS],
    /// Distance to the curved surface [m].
    pub distance: [f64; MOST_RAYS],
    /// Unit normal in the sensor frame, axis by axis.
    normal: [[f64; MOST_RAYS]; 3],
}

impl Shade {
    /// Shade of rays that hit nothing.
    pub const NOTHING: Self = Self {
        cosine: [0.0; MOST_RAYS],
        distance: [f64::INFINITY; MOST_RAYS],
        normal: [[0.0; MOST_RAYS]; 3],
    };

    /// Unit normals in the sensor frame, axis by axis.
    pub fn normal(&self) -> &[[f64; MOST_RAYS]; 3] {
        &self.normal
    }

    /// Unit normal at the hit of a ray, in the sensor frame.
    pub fn normal_of(&self, ray: usize) -> DVec3 {
        let [x, y, z] = &self.normal;
        DVec3::new(x[ray], y[ray], z[ray])
    }

    /// Shade the hits of a tile, eight rays at a time, as [`crate::geometry::curved_triangle::shade`]
    /// does. Distances and normals are computed only if `ALL`.
    #[cfg_attr(optimised, inline(always))]
    pub fn fill<I: Isa, const ALL: bool>(
        &mut self,
        scene: &PosedScene,
        rays: &TileRays,
        bodies: &[[u32; PACKET]; PACKETS],
        triangles: &[[u32; PACKET]; PACKETS],
        distances: &[f64; MOST_RAYS],
    ) {
        let splat = <I::F64 as Vector>::splat;
        let mut lengths = [0.0; MOST_RAYS];
        for first in (0..MOST_RAYS).step_by(HALF) {
            let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
            let length = splat(1.0).add(u.mul(u)).add(v.mul(v)).sqrt();
            length.store(&mut lengths[first..]);
            splat(0.0).store(&mut self.cosine[first..]);
            if ALL {
                I::F64::load(&distances[first..]).store(&mut self.distance[first..]);
                for axis in 0..3 {
                    splat(0.0).store(&mut self.normal[axis][first..]);
                }
            }
        }
        let mut groups = Groups::new::<I>(&rays.valid, bodies, triangles);
        while let Some(mut group) = groups.take::<I>() {
            let facets = ShadedFacets::<I::F64>::new(scene, &group);
            let (view, rotation) = (scene.view(group.body), &scene.pose(group.body).rotation);
            while let Some((half, bits)) = group.take_half() {
                let first = half * HALF;
                let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
                let (length, distance) = (I::F64::load(&lengths[first..]), I::F64::load(&distances[first..]));
                let (cosine, correction, normal) = facets.shade(view.direction(u, v), length, distance);
                let keep = I::F64::load(&self.cosine[first..]);
                cosine.select(bits, keep).store(&mut self.cosine[first..]);
                if ALL {
                    let keep = I::F64::load(&self.distance[first..]);
                    let corrected = distance.add(correction);
                    corrected.select(bits, keep).store(&mut self.distance[first..]);
                    let normal = turn(rotation, normal);
                    for axis in 0..3 {
                        let keep = I::F64::load(&self.normal[axis][first..]);
                        normal[axis].select(bits, keep).store(&mut self.normal[axis][first..]);
                    }
                }
            }
        }
    }
}

/// Triangles in the frame of their body, one in every lane, prepared to shade rays that meet them.
#[derive(Clone, Copy)]
struct ShadedFacets<V> {
    /// First corner relative to the sensor [m].
    corner: [V; 3],
    /// Normal of twice the area's length, and the inverse of that length.
    face: [V; 3],
    inverse: V,
    /// Bit mask of the lanes whose triangles approximate a curved surface: what follows is theirs.
    curved: u32,
    /// Vectors whose scalar products with a point relative to the first corner are the weights of the second and the
    /// third.
    weights: [[V; 3]; 2],
    /// Normal at the first corner, and differences of the other two from it.
    normal: [V; 3],
    turns: [[V; 3]; 2],
    /// Heights of the second and the third corner over the first, along the normals at them [m].
    heights: [V; 2],
}

impl<V: Vector<Scalar = f64>> ShadedFacets<V> {
    /// No triangles.
    #[cfg_attr(optimised, inline(always))]
    fn none() -> Self {
        let zero = V::splat(0.0);
        Self {
            corner: [zero; 3],
            face: [zero; 3],
            inverse: zero,
            curved: 0,
            weights: [[zero; 3]; 2],
            normal: [zero; 3],
            turns: [[zero; 3]; 2],
            heights: [zero; 2],
        }
    }

    #[cfg_attr(optimised, inline(always))]
    fn new(scene: &PosedScene, group: &Group) -> Self {
        let (surface, view) = (scene.surface(group.body), scene.view(group.body));
        let mut facets = Self::none();
        let [a, b, c] = group.corners::<V>(surface);
        let (first, second) = (difference(b, a), difference(c, a));
        let one = V::splat(1.0);
        facets.corner = difference(a, in_all(view.origin));
        facets.face = cross(first, second);
        let square = rounded_dot(facets.face, facets.face);
        facets.inverse = one.div(square.sqrt());
        let ([a, b, c], curved) = group.normals::<V>(surface);
        facets.curved = curved;
        if curved != 0 {
            let inverse = one.div(square);
            facets.weights = [
                scale(cross(second, facets.face), inverse),
                scale(cross(facets.face, first), inverse),
            ];
            facets.normal = a;
            facets.turns = [difference(b, a), difference(c, a)];
            facets.heights = [rounded_dot(first, b), rounded_dot(second, c)];
        }
        facets
    }

    /// Cosine of incidence, distance from the triangle to the curved surface along the ray [m], and unit normal on the
    /// incident side, from directions, their lengths, and distances along them [m].
    #[cfg_attr(optimised, inline(always))]
    fn shade(&self, direction: [V; 3], length: V, distance: V) -> (V, V, [V; 3]) {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let inverse = one.div(length);
        let slope = dot(self.face, direction);
        // Sign that turns the normal to the incident side.
        let side = V::splat(-1.0).select(zero.at_most(slope), one);
        let turn = side.mul(self.inverse);
        let mut normal = scale(self.face, turn);
        let mut cosine = slope.mul(turn).mul(inverse);
        let mut correction = zero;
        if self.curved != 0 {
            let mut place = scale(direction, distance.mul(inverse));
            for axis in 0..3 {
                place[axis] = place[axis].sub(self.corner[axis]);
            }
            let second = dot(self.weights[0], place);
            let third = dot(self.weights[1], place);
            let mut mean = self.normal;
            for axis in 0..3 {
                mean[axis] = self.turns[1][axis].mul_add(third, self.turns[0][axis].mul_add(second, mean[axis]));
            }
            let unit = side.div(dot(mean, mean).sqrt());
            let curved = dot(mean, direction).mul(unit).mul(inverse);
            let is_curved = self.curved & curved.at_most(V::splat(MAX_CORRECTED_COSINE));
            let height = second
                .mul(self.heights[0])
                .add(third.mul(self.heights[1]))
                .sub(dot(mean, place))
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

#[cfg_attr(optimised, inline(always))]
fn dot<V: Vector>(a: [V; 3], b: [V; 3]) -> V {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
}

#[cfg_attr(optimised, inline(always))]
fn scale<V: Vector>(a: [V; 3], by: V) -> [V; 3] {
    [a[0].mul(by), a[1].mul(by), a[2].mul(by)]
}

#[cfg_attr(optimised, inline(always))]
fn turn<V: Vector<Scalar = f64>>(rotation: &DMat3, x: [V; 3]) -> [V; 3] {
    let (a, b, c) = (
        in_all::<V>(rotation.x_axis),
        in_all::<V>(rotation.y_axis),
        in_all::<V>(rotation.z_axis),
    );
    let mut turned = x;
    for axis in 0..3 {
        turned[axis] = c[axis].mul_add(x[2], b[axis].mul_add(x[1], a[axis].mul(x[0])));
    }
    turned
}
