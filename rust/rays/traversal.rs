//! Traversal of a tree: all children of a node at a time, for one ray or for all directions of a box.
//!
//! Boxes are in single precision with bounds on every rounding: no box that a ray meets is missed.

use glam::DVec3;

use crate::numeric::simd::{Isa, Vector, prefetch};
use crate::rays::tree::{Child, Kind, Node, Tree, WIDTH};
use crate::rays::triangle_block::{TriangleBlock, UNIT};

/// Visitor of the leaves of a tree.
pub trait Visit {
    /// True if a leaf, child of a node, is to be visited.
    fn expects<I: Isa>(&self, leaf: usize, node: &Node, place: usize) -> bool;

    /// Visit a leaf of `count` primitives that rays enter at `near`. Returns the distance at which the search
    /// ends.
    fn visit<I: Isa>(&mut self, leaf: usize, count: usize, near: f32) -> f32;

    /// Note a box that rays enter at `near` and that is left out, as the search ends before it.
    #[cfg_attr(optimised, inline(always))]
    fn leave_out(&mut self, _near: f32) {}
}

/// Visit all leaves whose boxes any direction may meet before `far`, near ones first.
#[cfg_attr(optimised, inline(always))]
pub fn traverse<I: Isa>(slabs: &Slabs, tree: &Tree, mut far: f32, stack: &mut Vec<u64>, visitor: &mut impl Visit) {
    if tree.nodes.is_empty() {
        return;
    }
    // Distance above, child below: distances are not negative, and ordered as their bits.
    let bottom = stack.len();
    stack.push(0);
    while stack.len() > bottom {
        let Some(entry) = stack.pop() else { break };
        let near = f32::from_bits((entry >> 32) as u32);
        if near > far {
            visitor.leave_out(near);
            continue;
        }
        let node = match Child(entry as u32).kind() {
            Kind::Leaf(leaf, count) => {
                far = visitor.visit::<I>(leaf, count, near);
                continue;
            }
            Kind::Node(node) => &tree.nodes[node],
        };
        let mut nears = [0.0; WIDTH];
        let mut met = slabs.enter::<I>(node, far, &mut nears);
        let first = stack.len();
        while met != 0 {
            let place = met.trailing_zeros() as usize;
            met &= met - 1;
            let child = node.child[place];
            match child.kind() {
                Kind::Node(node) => prefetch(&tree.nodes[node]),
                Kind::Leaf(leaf, _) => {
                    if !visitor.expects::<I>(leaf, node, place) {
                        continue;
                    }
                }
            }
            let entry = u64::from(nears[place].to_bits()) << 32 | u64::from(child.0);
            // The nearest on top.
            let mut at = stack.len();
            stack.push(entry);
            while at > first && stack[at - 1] < entry {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = entry;
        }
    }
}

/// Single ray in single precision, with bounds of its coordinates.
pub struct Single {
    origin: [f32; 3],
    reach: f32,
    direction: [f32; 3],
    length: f32,
}

impl Single {
    /// Ray from an origin relative to a point of the body.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self {
            origin: origin.to_array().map(|x| x as f32),
            reach: origin.abs().max_element() as f32 * (1.0 + 2.0 * UNIT),
            direction: direction.to_array().map(|x| x as f32),
            length: direction.abs().element_sum() as f32 * (1.0 + 2.0 * UNIT),
        }
    }

    /// Visit all leaves whose boxes the ray may meet before `far`, near ones first.
    #[cfg_attr(optimised, inline(always))]
    pub fn traverse<I: Isa>(&self, tree: &Tree, far: f32, stack: &mut Vec<u64>, visitor: &mut impl Visit) {
        let low = self.direction.map(f32::next_down);
        let high = self.direction.map(f32::next_up);
        let slabs = Slabs::new(&self.origin, self.reach, &low, &high);
        traverse::<I>(&slabs, tree, far, stack, visitor);
    }

    /// Bit mask of the triangles of a block that the ray may meet; `reach` bounds the coordinates of the triangles.
    #[cfg_attr(optimised, inline(always))]
    pub fn may_meet<I: Isa>(&self, block: &TriangleBlock, count: usize, reach: f32) -> u32 {
        let planes = block.planes::<I>(&self.origin, reach + self.reach, self.length);
        planes.may_be_met_by(&self.direction) & ((1 << count) - 1)
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

    /// Slabs from smallest and largest directions; `reach` bounds the coordinates of the origin.
    #[cfg_attr(optimised, inline(always))]
    pub fn new(origin: &[f32; 3], reach: f32, low: &[f32; 3], high: &[f32; 3]) -> Self {
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
            let pad = 8.0 * UNIT * reach;
            slabs.origin[axis] = [origin[axis] + pad, origin[axis] - pad];
        }
        slabs
    }

    /// Bit mask of the children whose boxes any direction may meet before `far`; `near` gets the distances of entry.
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
        entry.store(near);
        // Places without a child lie beyond every distance.
        entry.at_most(exit.mul(splat(1.0 + 16.0 * UNIT))) & entry.at_most(splat(f32::MAX))
    }
}
