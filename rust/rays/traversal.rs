//! Traversal of a tree: all children of a node at a time, for one ray or for all directions of a box.
//!
//! Boxes are in single precision with bounds on every rounding: no box that a ray meets is missed.

use crate::numeric::simd::{Isa, Vector, prefetch};
use crate::rays::tree::{Child, Kind, Node, Tree, WIDTH};
use crate::rays::triangle_block::UNIT;

/// Child that waits to be visited.
#[derive(Clone, Copy)]
pub struct StackEntry {
    /// Distance of entry above, child below: distances are not negative, and ordered as their bits.
    key: u64,
    /// Bit mask of the packets that may meet it.
    packets: u32,
}

/// Search of a tree by `N` packets of rays.
pub trait Search<const N: usize> {
    /// Distance above which nothing is visited.
    fn far(&self) -> f32;

    /// Bit mask of the children of a node that a packet may meet; lowers `near` to distances of entry.
    fn enter<I: Isa>(&self, packet: usize, node: &Node, near: &mut [f32; WIDTH]) -> u32;

    /// Bit mask of the packets that visit a leaf, child of a node, from a mask of the packets that meet its box.
    #[cfg_attr(optimised, inline(always))]
    fn should_visit<I: Isa>(&self, packets: u32, _leaf: usize, _node: &Node, _slot: usize) -> u32 {
        packets
    }

    /// Visit a leaf of `count` primitives that packets of a mask enter at `near`.
    fn visit<I: Isa>(&mut self, packets: u32, leaf: usize, count: usize, near: f32);
}

/// Visit all leaves whose boxes any packet of a mask may meet, near ones first.
#[cfg_attr(optimised, inline(always))]
pub fn traverse<I: Isa, const N: usize>(
    tree: &Tree,
    packets: u32,
    stack: &mut Vec<StackEntry>,
    search: &mut impl Search<N>,
) {
    stack.clear();
    if !tree.nodes.is_empty() && packets != 0 {
        stack.push(StackEntry { key: 0, packets });
    }
    while let Some(StackEntry { key, packets }) = stack.pop() {
        let near = f32::from_bits((key >> 32) as u32);
        if near > search.far() {
            continue;
        }
        let node = match Child(key as u32).kind() {
            Kind::Leaf(leaf, count) => {
                search.visit::<I>(packets, leaf, count, near);
                continue;
            }
            Kind::Node(node) => &tree.nodes[node],
        };
        let mut nears = [f32::INFINITY; WIDTH];
        let mut met_by = [0; N];
        let mut met = 0;
        for packet in 0..N {
            if packets >> packet & 1 == 1 {
                met_by[packet] = search.enter::<I>(packet, node, &mut nears);
                met |= met_by[packet];
            }
        }
        let first = stack.len();
        while met != 0 {
            let slot = met.trailing_zeros() as usize;
            met &= met - 1;
            let mut packets = 0;
            for packet in 0..N {
                packets |= (met_by[packet] >> slot & 1) << packet;
            }
            let child = node.child[slot];
            match child.kind() {
                Kind::Node(node) => prefetch(&tree.nodes[node]),
                Kind::Leaf(leaf, _) => {
                    packets = search.should_visit::<I>(packets, leaf, node, slot);
                    if packets == 0 {
                        continue;
                    }
                }
            }
            let key = u64::from(nears[slot].to_bits()) << 32 | u64::from(child.0);
            let entry = StackEntry { key, packets };
            // The nearest on top.
            let mut at = stack.len();
            stack.push(entry);
            while at > first && stack[at - 1].key < key {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = entry;
        }
    }
}

/// Box of directions from one origin, prepared for slab tests of the boxes of children.
#[derive(Clone, Copy)]
pub struct Slabs {
    /// Origin, moved outwards for both sides of a box by more than the rounding of all coordinates.
    origin: [[f32; 2]; 3],
    inverse: [[f32; 2]; 3],
    sign: [Sign; 3],
}

/// Sign of all directions along an axis.
#[derive(Clone, Copy, PartialEq)]
enum Sign {
    Forward,
    Backward,
    Both,
}

impl Slabs {
    /// Slabs of no directions.
    pub const EMPTY: Self = Self {
        origin: [[0.0; 2]; 3],
        inverse: [[0.0; 2]; 3],
        sign: [Sign::Both; 3],
    };

    /// Slabs from smallest and largest directions; `max_coordinate` bounds the coordinates of the origin.
    #[cfg_attr(optimised, inline(always))]
    pub fn new(origin: &[f32; 3], max_coordinate: f32, low: &[f32; 3], high: &[f32; 3]) -> Self {
        let mut slabs = Self::EMPTY;
        for axis in 0..3 {
            let (low, high) = (low[axis], high[axis]);
            slabs.sign[axis] = if low > 0.0 {
                Sign::Forward
            } else if high < 0.0 {
                Sign::Backward
            } else {
                Sign::Both
            };
            slabs.inverse[axis] = [low.recip().clamp(-1e30, 1e30), high.recip().clamp(-1e30, 1e30)];
            let pad = 8.0 * UNIT * max_coordinate;
            slabs.origin[axis] = [origin[axis] + pad, origin[axis] - pad];
        }
        slabs
    }

    /// Bit mask of the children whose boxes any direction may meet before `far`; lowers `near` to distances of entry.
    #[cfg_attr(optimised, inline(always))]
    pub fn enter<I: Isa>(&self, node: &Node, far: f32, near: &mut [f32; WIDTH]) -> u32 {
        let splat = <I::F32 as Vector>::splat;
        let (mut entry, mut exit) = (splat(0.0), splat(far));
        for axis in 0..3 {
            let low = I::F32::load(&node.min[axis]).sub(splat(self.origin[axis][0]));
            let high = I::F32::load(&node.max[axis]).sub(splat(self.origin[axis][1]));
            let (first, last) = (splat(self.inverse[axis][0]), splat(self.inverse[axis][1]));
            let (enters, exits) = match self.sign[axis] {
                Sign::Forward => (low.mul(first).min(low.mul(last)), high.mul(first).max(high.mul(last))),
                Sign::Backward => (high.mul(first).min(high.mul(last)), low.mul(first).max(low.mul(last))),
                // Only a box to one side of the origin bounds the distance of entry.
                Sign::Both => (low.mul(last).max(high.mul(first)), splat(f32::INFINITY)),
            };
            (entry, exit) = (entry.max(enters), exit.min(exits));
        }
        // A few roundings per bound.
        let entry = entry.mul(splat(1.0 - 16.0 * UNIT));
        entry.min(I::F32::load(near)).store(near);
        // Slots without a child lie beyond every distance.
        entry.at_most(exit.mul(splat(1.0 + 16.0 * UNIT))) & entry.at_most(splat(f32::MAX))
    }
}
