//! Search of one body for the nearest triangles of the rays of a tile, all children of a node, and 16 rays or 16
//! triangles, at a time.
//!
//! A tile goes through the tree once. Where it meets many children of a node, or has met many leaves of any body, they
//! are smaller than the tile: there every packet is tested apart, and every ray against the boxes of leaves. A leaf that many rays of a packet may
//! meet is tested triangle by triangle, 16 rays at a time, one that few may meet ray by ray, 16 triangles at a time.
//!
//! The search is in single precision with bounds on every rounding. Where these cannot tell whether a ray meets a
//! triangle, or which of two triangles is nearer, an exact test decides, so that hits equal those of rays traced one by
//! one, in whatever order leaves are visited.

use crate::numeric::simd::{Isa, Vector, prefetch};
use crate::rays::packet::{BodyRays, PACKET, PACKETS};
use crate::rays::packet_hits::{Exact, PacketHits};
use crate::rays::traversal::Slabs;
use crate::rays::tree::{Child, Kind, Tree, WIDTH};
use crate::rays::triangle_block::{Planes, Table, TriangleBlock, UNIT};

/// Number of children of a node that rays meet together, above which they are tested apart: beside one or two that
/// hold a tile there are two or three at its border (`cargo bench --bench trace -- 'traversals|person'`).
const FEW_CHILDREN: u32 = 4;

/// Number of leaves of all bodies that a tile has met, above which its rays are tested apart everywhere: a tile over
/// large triangles meets fewer (`cargo bench --bench trace -- 'room|person'`).
const FEW_LEAVES: usize = 16;

/// Number of rays of a packet up to which they are tested one by one against a leaf: as many tests of 16 triangles cost
/// what tests of 16 rays do for half a leaf (`cargo bench --bench trace -- person`).
const FEW_RAYS: u32 = 5;

/// Traversal of the tree of a body by the rays of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversals {
    /// The faster choice at every node.
    Chosen,
    /// 8 x 8 rays together at every node.
    Together,
    /// Every 4 x 4 rays apart at every node.
    Apart,
}

/// Bits of the rays of one packet in a mask of all.
const PACKET_BITS: u64 = (1 << PACKET) - 1;

/// Child that waits to be visited.
#[derive(Clone, Copy)]
pub struct Waiting {
    /// Distance above, child below: distances are not negative, and ordered as their bits.
    key: u64,
    /// Bit mask of the rays that may meet it; of nodes all rays of every packet that may.
    rays: u64,
}

/// Search for the nearest triangles of one body.
pub struct Search<'a, E> {
    /// Rays in the frame of the body.
    pub rays: &'a mut BodyRays,
    /// Triangle block of every leaf.
    pub blocks: &'a [TriangleBlock],
    /// Bound of the coordinates of the triangles.
    pub reach: f32,
    /// Number of the body.
    pub body: u32,
    /// Traversal of the tree.
    pub traversals: Traversals,
    /// Distance at or below which there are no hits.
    pub start: f32,
    /// Hits so far.
    pub hits: &'a mut PacketHits,
    /// Exact test.
    pub exact: &'a E,
    /// Planes of the triangle block at hand.
    pub table: &'a mut Table,
    /// Number of leaves that the tile has met, of all bodies.
    pub num_leaves: &'a mut usize,
}

/// Bit mask of a packet's rays from that of all.
#[cfg_attr(optimised, inline(always))]
fn of_packet(rays: u64, packet: usize) -> u32 {
    (rays >> (packet * PACKET) & PACKET_BITS) as u32
}

/// True if all rays of a mask are of one packet.
#[cfg_attr(optimised, inline(always))]
fn is_one_packet(rays: u64) -> bool {
    let first = rays.trailing_zeros() as usize / PACKET * PACKET;
    rays >> first >> (PACKET - 1) >> 1 == 0
}

impl<E: Exact> Search<'_, E> {
    /// Visit all leaves whose boxes any ray may meet before its hit so far, near ones first.
    #[cfg_attr(optimised, inline(always))]
    pub fn traverse<I: Isa>(&mut self, tree: &Tree, stack: &mut Vec<Waiting>) {
        let mut rays = 0;
        for packet in 0..PACKETS {
            rays |= u64::from(self.rays.valid[packet]) << (packet * PACKET);
        }
        if tree.nodes.is_empty() || rays == 0 {
            return;
        }
        let slabs = self.rays.slabs(PACKETS);
        let mut far = self.hits.farthest();
        stack.clear();
        stack.push(Waiting { key: 0, rays });
        while let Some(Waiting { key, rays }) = stack.pop() {
            let near = f32::from_bits((key >> 32) as u32);
            if near > far {
                continue;
            }
            match Child(key as u32).kind() {
                Kind::Leaf(leaf, count) => {
                    self.visit::<I>(leaf, count, near, rays);
                    far = self.hits.farthest();
                }
                Kind::Node(node) => self.open::<I>(tree, node, (rays, far), &slabs, stack),
            }
        }
    }

    /// Push the children of a node that rays may meet, the nearest on top.
    #[cfg_attr(optimised, inline(always))]
    fn open<I: Isa>(
        &mut self,
        tree: &Tree,
        node: usize,
        (rays, far): (u64, f32),
        slabs: &Slabs,
        stack: &mut Vec<Waiting>,
    ) {
        let node = &tree.nodes[node];
        // Number of children up to which they are tested for all rays together.
        let few = match self.traversals {
            Traversals::Chosen if *self.num_leaves <= FEW_LEAVES => FEW_CHILDREN,
            Traversals::Together => WIDTH as u32,
            _ => 0,
        };
        let mut nears = [0.0; WIDTH];
        // Bit mask of children that every packet may meet.
        let mut met_by = [0; PACKETS];
        let is_one = is_one_packet(rays);
        let mut met;
        let is_fine;
        if is_one {
            self.rays.part::<I>();
            let packet = rays.trailing_zeros() as usize / PACKET;
            met = self
                .rays
                .slabs_of(packet)
                .enter::<I>(node, self.hits.farthest[packet], &mut nears);
            is_fine = met.count_ones() > few;
            met_by[packet] = met;
        } else {
            met = slabs.enter::<I>(node, far, &mut nears);
            is_fine = met.count_ones() > few;
            if is_fine {
                self.rays.part::<I>();
                let (mut any, mut entries) = (0, [0.0; WIDTH]);
                for packet in 0..PACKETS {
                    if of_packet(rays, packet) != 0 {
                        let slabs = self.rays.slabs_of(packet);
                        met_by[packet] = met & slabs.enter::<I>(node, self.hits.farthest[packet], &mut entries);
                        any |= met_by[packet];
                    }
                }
                met = any;
            }
        }
        // More than the rounding of directions moves a ray within reach.
        let pad = 32.0 * UNIT * (self.reach + self.rays.reach);
        let first = stack.len();
        while met != 0 {
            let place = met.trailing_zeros() as usize;
            met &= met - 1;
            let child = node.child[place];
            let mut rays = rays;
            if is_fine {
                let is_leaf = matches!(child.kind(), Kind::Leaf(..));
                for packet in 0..PACKETS {
                    let all = PACKET_BITS << (packet * PACKET);
                    if met_by[packet] >> place & 1 == 0 {
                        rays &= !all;
                    } else if is_leaf && rays & all != 0 {
                        let far = I::F32::load(&self.hits.far[packet * PACKET..]);
                        let met = self.rays.meet::<I>(packet, node, place, pad, far);
                        rays &= !all | u64::from(met) << (packet * PACKET);
                    }
                }
                if rays == 0 {
                    continue;
                }
            }
            match child.kind() {
                Kind::Node(node) => prefetch(&tree.nodes[node]),
                Kind::Leaf(leaf, _) => prefetch(&self.blocks[leaf]),
            }
            let key = u64::from(nears[place].to_bits()) << 32 | u64::from(child.0);
            let waiting = Waiting { key, rays };
            let mut at = stack.len();
            stack.push(waiting);
            while at > first && stack[at - 1].key < key {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = waiting;
        }
    }

    /// Test the triangles of a leaf that rays enter at `near`.
    #[cfg_attr(optimised, inline(always))]
    fn visit<I: Isa>(&mut self, leaf: usize, count: usize, near: f32, rays: u64) {
        *self.num_leaves += 1;
        let block = &self.blocks[leaf];
        let planes = block.planes::<I>(&self.rays.origin, self.reach + self.rays.reach, self.rays.length);
        let real = (1 << count) - 1;
        let mut is_stored = false;
        // Triangles that any ray may meet; not known yet.
        let mut all = real;
        if !is_one_packet(rays) {
            all &= planes.may_meet(&self.rays.center[PACKETS], &self.rays.half[PACKETS]);
            if all == 0 {
                return;
            }
        }
        for packet in 0..PACKETS {
            let wanted = of_packet(rays, packet);
            if wanted == 0 || near > self.hits.farthest[packet] {
                continue;
            }
            let is_whole = wanted == PACKET_BITS as u32;
            let has_changed = if !is_whole && wanted.count_ones() <= FEW_RAYS {
                self.test_rays::<I>(&planes, block, all, packet, wanted)
            } else {
                let met = all & planes.may_meet(&self.rays.center[packet], &self.rays.half[packet]);
                if met == 0 {
                    continue;
                }
                if !is_stored {
                    planes.store(self.table);
                    is_stored = true;
                }
                self.test_triangles::<I>(block, planes.unclear, met, packet)
            };
            if has_changed {
                self.hits.farthest[packet] = I::F32::load(&self.hits.far[packet * PACKET..]).largest();
            }
        }
    }

    /// Test some triangles of a leaf, one by one, against all rays of a packet. Returns true if any hit is new.
    #[cfg_attr(optimised, inline(always))]
    fn test_triangles<I: Isa>(
        &mut self,
        block: &TriangleBlock,
        unclear: u32,
        mut triangles: u32,
        packet: usize,
    ) -> bool {
        let first = packet * PACKET;
        let valid = self.rays.valid[packet];
        let mut directions = [<I::F32 as Vector>::splat(0.0); 3];
        for axis in 0..3 {
            directions[axis] = I::F32::load(&self.rays.directions[axis][first..]);
        }
        let mut has_changed = false;
        while triangles != 0 {
            let lane = triangles.trailing_zeros() as usize;
            triangles &= triangles - 1;
            let number = block.triangles[lane];
            let (mut unsure, least) = self.table.meet(lane, &directions);
            if unclear >> lane & 1 == 1 {
                unsure = self.table.meet_unclear(lane, &directions) & valid;
            } else {
                unsure &= valid;
                if unsure == 0 {
                    continue;
                }
                let crossing = self.table.cross(lane, &directions, least);
                let hit_near = I::F32::load(&self.hits.near[first..]);
                let hit_far = I::F32::load(&self.hits.far[first..]);
                let is_behind = hit_far.at_most(crossing.near) & crossing.measured;
                let is_nearest = unsure
                    & crossing.measured
                    & crossing.certain
                    & crossing.far.at_most(hit_near)
                    & <I::F32 as Vector>::splat(self.start).at_most(crossing.near);
                if is_nearest != 0 {
                    crossing
                        .near
                        .select(is_nearest, hit_near)
                        .store(&mut self.hits.near[first..]);
                    crossing
                        .far
                        .select(is_nearest, hit_far)
                        .store(&mut self.hits.far[first..]);
                    I::put(&mut self.hits.body[packet], is_nearest, self.body);
                    I::put(&mut self.hits.triangle[packet], is_nearest, number);
                    self.hits.edge_on[packet] &= !is_nearest;
                    has_changed = true;
                }
                unsure &= !(is_behind | is_nearest);
            }
            while unsure != 0 {
                let ray = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                has_changed |= self.hits.decide(packet, ray, self.body, number, self.exact);
            }
        }
        has_changed
    }

    /// Test some rays of a packet, one by one, against some triangles of a leaf. Returns true if any hit is new.
    #[cfg_attr(optimised, inline(always))]
    fn test_rays<I: Isa>(
        &mut self,
        planes: &Planes<I::F32>,
        block: &TriangleBlock,
        triangles: u32,
        packet: usize,
        mut rays: u32,
    ) -> bool {
        let mut has_changed = false;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize;
            rays &= rays - 1;
            let ray = packet * PACKET + lane;
            let mut direction = [<I::F32 as Vector>::splat(0.0); 3];
            for axis in 0..3 {
                direction[axis] = <I::F32 as Vector>::splat(self.rays.directions[axis][ray]);
            }
            let (met, least) = planes.meet(&direction);
            let mut met = met & !planes.unclear & triangles;
            let unclear = planes.unclear & triangles;
            if met != 0 {
                let crossing = planes.cross(&direction, least);
                let (mut near, mut far) = ([0.0; WIDTH], [0.0; WIDTH]);
                crossing.near.store(&mut near);
                crossing.far.store(&mut far);
                while met != 0 {
                    let place = met.trailing_zeros() as usize;
                    met &= met - 1;
                    let number = block.triangles[place];
                    let is_measured = crossing.measured >> place & 1 == 1;
                    if is_measured && self.hits.far[ray] <= near[place] {
                        continue;
                    }
                    let is_certain = is_measured && crossing.certain >> place & 1 == 1;
                    if is_certain && far[place] <= self.hits.near[ray] && self.start <= near[place] {
                        (self.hits.near[ray], self.hits.far[ray]) = (near[place], far[place]);
                        self.hits.body[packet][lane] = self.body;
                        self.hits.triangle[packet][lane] = number;
                        self.hits.edge_on[packet] &= !(1 << lane);
                        has_changed = true;
                    } else {
                        has_changed |= self.hits.decide(packet, lane, self.body, number, self.exact);
                    }
                }
            }
            if unclear != 0 {
                let mut met = unclear & planes.meet_unclear(&direction);
                while met != 0 {
                    let number = block.triangles[met.trailing_zeros() as usize];
                    met &= met - 1;
                    has_changed |= self.hits.decide(packet, lane, self.body, number, self.exact);
                }
            }
        }
        has_changed
    }
}
