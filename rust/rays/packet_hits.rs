//! Nearest triangles of the rays of a tile, and the exact test that decides where single precision cannot.

use crate::numeric::simd::{Isa, Vector};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS};
use crate::rays::watertight::Crossing;

/// Nearest triangles of the rays of a tile, over all bodies.
///
/// Vectors come first, each on a cache line of its own: stores across two lines are slow
/// (`cargo bench --bench trace -- room_5k`).
#[repr(C, align(64))]
pub struct PacketHits {
    /// Lower bound of the distance of the hit so far, in lengths of the direction; infinite without one.
    pub(super) near: [f32; MOST_RAYS],
    /// Upper bound of the distance.
    pub(super) far: [f32; MOST_RAYS],
    /// Number of the body.
    pub body: [[u32; PACKET]; PACKETS],
    /// Number of its triangle.
    pub triangle: [[u32; PACKET]; PACKETS],
    /// Largest upper bound of every packet.
    pub(super) farthest: [f32; PACKETS],
    /// A bit per ray that lies in the plane of its triangle.
    pub edge_on: [u32; PACKETS],
}

impl PacketHits {
    /// Hits of no rays.
    pub const EMPTY: Self = Self {
        near: [f32::INFINITY; MOST_RAYS],
        far: [f32::INFINITY; MOST_RAYS],
        body: [[u32::MAX; PACKET]; PACKETS],
        triangle: [[u32::MAX; PACKET]; PACKETS],
        farthest: [f32::NEG_INFINITY; PACKETS],
        edge_on: [0; PACKETS],
    };

    /// Clear all hits of the valid rays, which end at distances `limit`.
    #[cfg_attr(optimised, inline(always))]
    pub fn clear<I: Isa>(&mut self, valid: &[u32; PACKETS], limit: &[f32; MOST_RAYS]) {
        for packet in 0..PACKETS {
            let all = packet * PACKET..(packet + 1) * PACKET;
            let nowhere = <I::F32 as Vector>::splat(f32::NEG_INFINITY);
            let far = I::F32::load(&limit[all.clone()]).select(valid[packet], nowhere);
            <I::F32 as Vector>::splat(f32::INFINITY).store(&mut self.near[all.clone()]);
            far.store(&mut self.far[all]);
            self.farthest[packet] = far.largest();
            self.body[packet] = [u32::MAX; PACKET];
            self.triangle[packet] = [u32::MAX; PACKET];
            self.edge_on[packet] = 0;
        }
    }

    /// Distance above which no ray can find a nearer triangle.
    #[cfg_attr(optimised, inline(always))]
    pub fn farthest(&self) -> f32 {
        let [a, b, c, d] = self.farthest;
        a.max(b).max(c.max(d))
    }

    /// Decide by the exact test whether a triangle is the nearest of a ray so far; of several at one distance the
    /// first.
    #[inline(never)]
    pub(super) fn decide<Exact>(&mut self, packet: usize, lane: usize, body: u32, triangle: u32, exact: &Exact) -> bool
    where
        Exact: Fn(usize, u32, u32) -> Option<Crossing>,
    {
        let ray = packet * PACKET + lane;
        let Some(Crossing {
            distance, is_edge_on, ..
        }) = exact(ray, body, triangle)
        else {
            return false;
        };
        if distance > f64::from(self.far[ray]) {
            return false;
        }
        if distance >= f64::from(self.near[ray]) {
            let before = (self.body[packet][lane], self.triangle[packet][lane]);
            let other = exact(ray, before.0, before.1).map_or(f64::INFINITY, |crossing| crossing.distance);
            if distance > other || (distance == other && before <= (body, triangle)) {
                return false;
            }
        }
        self.near[ray] = (distance as f32).next_down();
        self.far[ray] = (distance as f32).next_up();
        (self.body[packet][lane], self.triangle[packet][lane]) = (body, triangle);
        self.edge_on[packet] = self.edge_on[packet] & !(1 << lane) | u32::from(is_edge_on) << lane;
        true
    }
}
