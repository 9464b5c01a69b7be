//! Distances of the triangles that the rays of a tile hit, in double precision.

use crate::numeric::simd::{Isa, Vector};
use crate::rays::facets::{Group, HALF, HELD, Held, cross, difference, in_all, rounded_dot};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS, TileRays};
use crate::rays::packet_hits::PacketHits;
use crate::rays::scene::{NO_BODY, PosedScene};

impl PosedScene {
    /// Measure the distances of the triangles that were found [m]; infinite where there is none.
    #[inline(always)]
    pub(crate) fn measure<I: Isa>(&self, rays: &TileRays, hits: &PacketHits, distance: &mut [f64; MOST_RAYS]) {
        let splat = <I::F64 as Vector>::splat;
        // Normals of planes, not of unit length, and their scalar products with points in them.
        let mut planes = [([splat(0.0); 3], splat(0.0)); HELD + 1];
        let mut held = Held::NOTHING;
        for first in (0..MOST_RAYS).step_by(HALF) {
            let (packet, half) = (first / PACKET, first % PACKET / HALF);
            let (bodies, triangles) = (&hits.body[packet], &hits.triangle[packet]);
            let hit = rays.valid[packet] & !I::equal(bodies, NO_BODY);
            let mut rest = hit >> (half * HALF) & 0xff;
            splat(f64::INFINITY).store(&mut distance[first..]);
            if rest == 0 {
                continue;
            }
            let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
            let length = splat(1.0).add(u.mul(u)).add(v.mul(v)).sqrt();
            while rest != 0 {
                let group = Group::take::<I>(bodies, triangles, half, &mut rest);
                let view = &self.views[group.body as usize];
                let (place, is_there) = held.place(&group);
                // The operations of `WatertightTest::intersect`.
                if !is_there {
                    let triangles = &triangles[half * HALF..];
                    let [a, b, c] = group.corners::<I::F64>(self.surface(group.body), triangles);
                    let origin = in_all(view.origin);
                    let (a, b, c) = (difference(a, origin), difference(b, origin), difference(c, origin));
                    let normal = cross(difference(b, a), difference(c, a));
                    planes[place] = (normal, rounded_dot(normal, a));
                }
                let (normal, above) = planes[place];
                let along = rounded_dot(normal, view.direction(u, v));
                let keep = I::F64::load(&distance[first..]);
                let there = above.div(along).mul(length);
                there.select(group.bits, keep).store(&mut distance[first..]);
            }
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
