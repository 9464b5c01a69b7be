//! Search of one body for the nearest triangles of the rays of a tile: packets of 16 rays against all children of a node
//! at a time, then against one triangle of a leaf after the other.
//!
//! The search is in single precision with bounds on every rounding. Where these cannot decide whether a ray meets a
//! triangle, or which of two triangles is nearer, an exact test decides, so that hits equal hits of single rays, in any
//! order of leaves.

use crate::numeric::simd::{Isa, Vector, prefetch};
use crate::rays::packet::{BodyRays, PACKET, PACKETS};
use crate::rays::packet_hits::PacketHits;
use crate::rays::scene::NEAREST;
use crate::rays::traversal::Search;
use crate::rays::tree::{Node, WIDTH};
use crate::rays::triangle_block::{Planes, TriangleBlock};
use crate::rays::watertight::Crossing;

/// Search for the nearest triangles of one body; `exact` intersects a ray with a triangle of a body.
pub struct PacketSearch<'a, E> {
    /// Rays in the frame of the body.
    pub rays: &'a BodyRays,
    /// Triangle block of every leaf.
    pub blocks: &'a [TriangleBlock],
    /// Bound of the coordinates of the triangles.
    pub max_coordinate: f32,
    /// Number of the body.
    pub body: u32,
    /// Hits so far.
    pub hits: &'a mut PacketHits,
    /// Exact test of a ray, a body and a triangle.
    pub exact: &'a E,
    /// Planes of the triangle block at hand.
    pub planes: &'a mut Planes,
}

impl<E: Fn(usize, u32, u32) -> Option<Crossing>> Search<PACKETS> for PacketSearch<'_, E> {
    #[cfg_attr(optimised, inline(always))]
    fn far(&self) -> f32 {
        self.hits.farthest()
    }

    #[cfg_attr(optimised, inline(always))]
    fn enter<I: Isa>(&self, packet: usize, node: &Node, near: &mut [f32; WIDTH]) -> u32 {
        self.rays.slabs[packet].enter::<I>(node, self.hits.farthest[packet], near)
    }

    #[cfg_attr(optimised, inline(always))]
    fn should_visit<I: Isa>(&self, packets: u32, leaf: usize, node: &Node, slot: usize) -> u32 {
        let mut met = 0;
        for packet in 0..PACKETS {
            if packets >> packet & 1 == 1 {
                let far = I::F32::load(&self.hits.far[packet * PACKET..]);
                let is_met = self.rays.meets::<I>(packet, node, slot, self.max_coordinate, far);
                met |= u32::from(is_met) << packet;
            }
        }
        if met != 0 {
            prefetch(&self.blocks[leaf]);
        }
        met
    }

    #[cfg_attr(optimised, inline(always))]
    fn visit<I: Isa>(&mut self, packets: u32, leaf: usize, count: usize, near: f32) {
        let block = &self.blocks[leaf];
        let rays = self.rays;
        let max_coordinate = self.max_coordinate + rays.max_coordinate;
        self.planes
            .fill::<I, true>(block, &rays.origin, max_coordinate, rays.length);
        for packet in 0..PACKETS {
            if packets >> packet & 1 == 0 || near > self.hits.farthest[packet] {
                continue;
            }
            let met = self.planes.may_meet::<I>(&rays.center[packet], &rays.half[packet]) & ((1 << count) - 1);
            if met != 0 && self.test::<I>(block, met, packet) {
                self.hits.farthest[packet] = I::F32::load(&self.hits.far[packet * PACKET..]).largest();
            }
        }
    }
}

impl<E: Fn(usize, u32, u32) -> Option<Crossing>> PacketSearch<'_, E> {
    /// Test some triangles of a leaf, one by one, against all rays of a packet. Returns true if any hit is new.
    #[cfg_attr(optimised, inline(always))]
    fn test<I: Isa>(&mut self, block: &TriangleBlock, mut triangles: u32, packet: usize) -> bool {
        let first = packet * PACKET;
        let mut directions = [<I::F32 as Vector>::splat(0.0); 3];
        for axis in 0..3 {
            directions[axis] = I::F32::load(&self.rays.directions[axis][first..]);
        }
        let start = <I::F32 as Vector>::splat(NEAREST as f32);
        let mut has_changed = false;
        while triangles != 0 {
            let lane = triangles.trailing_zeros() as usize;
            triangles &= triangles - 1;
            let triangle = block.triangles[lane];
            let (met, depth) = self.planes.meet(lane, &directions);
            // Rays that the exact test decides.
            let mut unsure = met & self.rays.valid[packet];
            if unsure == 0 {
                continue;
            }
            if self.planes.unclear >> lane & 1 == 0 {
                let bounds = self.planes.distances(lane, &directions, depth);
                let near = I::F32::load(&self.hits.near[first..]);
                let far = I::F32::load(&self.hits.far[first..]);
                let is_behind = far.at_most(bounds.near) & bounds.measured;
                let is_nearest =
                    unsure & bounds.measured & bounds.certain & bounds.far.at_most(near) & start.at_most(bounds.near);
                if is_nearest == 0xffff {
                    // Without masked stores, which are slow on some processors.
                    bounds.near.store(&mut self.hits.near[first..]);
                    bounds.far.store(&mut self.hits.far[first..]);
                    self.hits.body[packet] = [self.body; PACKET];
                    self.hits.triangle[packet] = [triangle; PACKET];
                } else if is_nearest != 0 {
                    bounds.near.select(is_nearest, near).store(&mut self.hits.near[first..]);
                    bounds.far.select(is_nearest, far).store(&mut self.hits.far[first..]);
                    I::put(&mut self.hits.body[packet], is_nearest, self.body);
                    I::put(&mut self.hits.triangle[packet], is_nearest, triangle);
                }
                self.hits.edge_on[packet] &= !is_nearest;
                has_changed |= is_nearest != 0;
                unsure &= !(is_behind | is_nearest);
            }
            while unsure != 0 {
                let ray = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                has_changed |= self.hits.decide(packet, ray, self.body, triangle, self.exact);
            }
        }
        has_changed
    }
}
