//! Nearest triangles of the rays of a tile, and the exact test that decides where single precision cannot.

use crate::numeric::simd::{Isa, Vector};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS};

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

    /// Clear all hits of the valid rays.
    #[cfg_attr(optimised, inline(always))]
    pub fn clear<I: Isa>(&mut self, valid: &[u32; PACKETS]) {
        for packet in 0..PACKETS {
            let all = packet * PACKET..(packet + 1) * PACKET;
            let everywhere = <I::F32 as Vector>::splat(f32::INFINITY);
            let nowhere = <I::F32 as Vector>::splat(f32::NEG_INFINITY);
            everywhere.store(&mut self.near[all.clone()]);
            everywhere.select(valid[packet], nowhere).store(&mut self.far[all]);
            I::put(&mut self.body[packet], u32::MAX, u32::MAX);
            I::put(&mut self.triangle[packet], u32::MAX, u32::MAX);
            self.edge_on[packet] = 0;
            self.farthest[packet] = if valid[packet] == 0 {
                f32::NEG_INFINITY
            } else {
                f32::INFINITY
            };
        }
    }

    /// Distance beyond which no ray can find a nearer triangle.
    #[cfg_attr(optimised, inline(always))]
    pub fn farthest(&self) -> f32 {
        let [a, b, c, d] = self.farthest;
        a.max(b).max(c.max(d))
    }

    /// Decide by the exact test whether a triangle is the nearest of a ray so far; of several at one distance the
    /// first.
    #[inline(never)]
    pub(super) fn decide(&mut self, packet: usize, lane: usize, body: u32, triangle: u32, exact: &impl Exact) -> bool {
        let ray = packet * PACKET + lane;
        let Some((distance, is_edge_on)) = exact.distance(ray, body, triangle) else {
            return false;
        };
        if distance > f64::from(self.far[ray]) {
            return false;
        }
        if distance >= f64::from(self.near[ray]) {
            let before = (self.body[packet][lane], self.triangle[packet][lane]);
            let other = exact.distance(ray, before.0, before.1);
            let other = other.map_or(f64::INFINITY, |(distance, _)| distance);
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

/// Exact test of a ray and a triangle.
pub trait Exact {
    /// Distance of a triangle of a body in lengths of the direction, and whether the ray lies in the triangle's plane;
    /// none if the ray misses.
    fn distance(&self, ray: usize, body: u32, triangle: u32) -> Option<(f64, bool)>;
}
