//! Distances of the triangles that the rays of a tile hit, in double precision.

use crate::numeric::simd::{Isa, Vector};
use crate::rays::facets::{Groups, HALF, rounded_dot};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS, TileRays};
use crate::rays::packet_hits::PacketHits;
use crate::rays::scene::PosedScene;

impl PosedScene {
    /// Measure the distances of the triangles that were found [m]; infinite where there is none.
    #[cfg_attr(optimised, inline(always))]
    pub(crate) fn measure<I: Isa>(&self, rays: &TileRays, hits: &PacketHits, distance: &mut [f64; MOST_RAYS]) {
        let splat = <I::F64 as Vector>::splat;
        // Heights of planes over the sensor, along normals that are not of unit length, and components of directions along
        // them.
        let mut height = [f64::INFINITY; MOST_RAYS];
        let mut slope = [1.0; MOST_RAYS];
        let mut groups = Groups::new::<I>(&rays.valid, &hits.body, &hits.triangle);
        while let Some(mut group) = groups.take::<I>() {
            let view = &self.views[group.body as usize];
            let (normal, above) = group.planes::<I::F64>(self.surface(group.body), view.origin);
            while let Some((half, bits)) = group.take_half() {
                let first = half * HALF;
                let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
                let along = rounded_dot(normal, view.direction(u, v));
                along
                    .select(bits, I::F64::load(&slope[first..]))
                    .store(&mut slope[first..]);
                above
                    .select(bits, I::F64::load(&height[first..]))
                    .store(&mut height[first..]);
            }
        }
        for first in (0..MOST_RAYS).step_by(HALF) {
            let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
            let length = splat(1.0).add(u.mul(u)).add(v.mul(v)).sqrt();
            let t = I::F64::load(&height[first..]).div(I::F64::load(&slope[first..]));
            t.mul(length).store(&mut distance[first..]);
        }
        for packet in 0..PACKETS {
            let mut edge_on = hits.edge_on[packet];
            while edge_on != 0 {
                let lane = edge_on.trailing_zeros() as usize;
                edge_on &= edge_on - 1;
                let direction = rays.direction(packet * PACKET + lane);
                let crossing = self.cross(direction, hits.body[packet][lane], hits.triangle[packet][lane]);
                let t = crossing.map_or(f64::INFINITY, |crossing| crossing.distance);
                distance[packet * PACKET + lane] = t * direction.length();
            }
        }
    }
}
