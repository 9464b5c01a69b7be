//! Rays from one origin, searched together: a bundle walks a tree once, all children of a node and all its rays at a time.
//!
//! What the bundle's box of directions cannot meet is left out in single precision, with bounds on every rounding; what
//! remains, pairs of a ray and a triangle, is for an exact test. Nothing is ever missed: hits are those of rays one by one.
//!
//! A ray `o + t D` meets a triangle of corners `a, b, c`, relative to `o`, only if `D . ((a + b) x (b - a))` and its like
//! for the other edges have one sign (Plücker coordinates for a common origin).

use glam::DVec3;

use crate::bvh::{WIDTH, WideNode, WideTree};
use crate::rays::TILE;
use crate::simd::{Isa, Kernel, Level, Vector};

/// Most rays of a bundle: those of a tile of an image.
pub const MOST_RAYS: usize = TILE * TILE;

/// Half the distance of 1 from the next number of single precision.
const UNIT: f32 = 0.5 * f32::EPSILON;

/// Triangles of a leaf as the search reads them, axis by axis: corners, and the largest coordinate.
pub struct Leaf {
    corners: [[[f32; WIDTH]; 3]; 3],
    reach: f32,
}

impl Leaf {
    /// From the corners of [`WIDTH`] triangles, of which those beyond the leaf's own do not count.
    pub fn new(triangles: [&[DVec3; 3]; WIDTH]) -> Self {
        let mut leaf = Self {
            corners: [[[0.0; WIDTH]; 3]; 3],
            reach: 0.0,
        };
        for (lane, triangle) in triangles.into_iter().enumerate() {
            for (corner, position) in triangle.iter().enumerate() {
                for axis in 0..3 {
                    let number = position[axis] as f32;
                    leaf.corners[corner][axis][lane] = number;
                    leaf.reach = leaf.reach.max(number.abs());
                }
            }
        }
        leaf
    }
}

/// Directions of some rays from one origin.
pub struct Bundle {
    /// How many there are.
    pub num_rays: usize,
    origin: [f32; 3],
    /// Largest coordinate of the origin.
    reach: f32,
    /// Directions, axis by axis; after the last ray, copies of it.
    directions: [[f32; MOST_RAYS]; 3],
    /// Smallest and largest coordinates of the directions.
    low: [f32; 3],
    high: [f32; 3],
}

impl Bundle {
    /// At most [`MOST_RAYS`] rays, at least one.
    pub fn new(origin: DVec3, rays: &[DVec3]) -> Self {
        let mut bundle = Self {
            num_rays: rays.len(),
            origin: origin.to_array().map(|x| x as f32),
            reach: origin.abs().max_element() as f32,
            directions: [[0.0; MOST_RAYS]; 3],
            low: [0.0; 3],
            high: [0.0; 3],
        };
        for axis in 0..3 {
            let directions = &mut bundle.directions[axis];
            for (number, ray) in directions.iter_mut().zip(rays) {
                *number = ray[axis] as f32;
            }
            let last = directions[rays.len() - 1];
            directions[rays.len()..].fill(last);
            let (mut low, mut high) = (last, last);
            for number in directions {
                low = if *number < low { *number } else { low };
                high = if *number > high { *number } else { high };
            }
            // A direction is at most half a step from its number.
            (bundle.low[axis], bundle.high[axis]) = (low.next_down(), high.next_up());
        }
        bundle
    }

    /// Visit all leaves whose boxes some ray may meet before `far`, near ones first.
    pub fn walk(&self, level: Level, tree: &WideTree, far: f32, visitor: impl Visit) {
        if !tree.nodes.is_empty() {
            level.run(Walk {
                bundle: self,
                tree,
                far,
                visitor,
            });
        }
    }
}

/// What is done at leaves.
pub trait Visit {
    /// Look at the primitives of a leaf, `count` of them. Returns the distance beyond which nothing is wanted any more if
    /// that may have changed.
    fn visit<I: Isa>(&mut self, leaf: usize, count: usize) -> Option<f32>;
}

struct Walk<'a, V> {
    bundle: &'a Bundle,
    tree: &'a WideTree,
    far: f32,
    visitor: V,
}

/// A node or a leaf that is still to be visited.
#[derive(Clone, Copy)]
struct Entry {
    near: f32,
    child: u32,
    /// 0: a node.
    num_primitives: u8,
}

impl<V: Visit> Kernel for Walk<'_, V> {
    type Output = ();

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let slabs = Slabs::new(self.bundle);
        let mut stack = Vec::with_capacity(128);
        stack.push(Entry {
            near: 0.0,
            child: 0,
            num_primitives: 0,
        });
        while let Some(entry) = stack.pop() {
            if entry.near > self.far {
                continue;
            }
            if entry.num_primitives > 0 {
                let far = self
                    .visitor
                    .visit::<I>(entry.child as usize, usize::from(entry.num_primitives));
                self.far = far.unwrap_or(self.far);
                continue;
            }
            let node = &self.tree.nodes[entry.child as usize];
            let mut near = [0.0; WIDTH];
            let mut met = slabs.enter::<I>(node, self.far, &mut near);
            let first = stack.len();
            while met != 0 {
                let place = met.trailing_zeros() as usize;
                met &= met - 1;
                stack.push(Entry {
                    near: near[place],
                    child: node.child[place],
                    num_primitives: node.num_primitives[place],
                });
            }
            // The nearest on top.
            let hits = &mut stack[first..];
            for i in 1..hits.len() {
                let mut j = i;
                while j > 0 && hits[j - 1].near < hits[j].near {
                    hits.swap(j - 1, j);
                    j -= 1;
                }
            }
        }
    }
}

/// Offers every pair of a ray and a triangle that may meet: `test` of a ray, a leaf, a place in it and the ray's best
/// distance returns the new one.
pub struct Triangles<'a, F> {
    /// The rays.
    pub bundle: &'a Bundle,
    /// The triangles of every leaf of the tree.
    pub leaves: &'a [Leaf],
    /// The best distance of every ray.
    pub best: &'a mut [f64; MOST_RAYS],
    /// The exact test.
    pub test: F,
}

/// Largest of the best distances, rounded up.
pub fn farthest(best: &[f64]) -> f32 {
    // Directions have length one to rounding.
    (best.iter().fold(0.0, |far: f64, x| far.max(*x)) * (1.0 + 1e-6)) as f32
}

impl<F: FnMut(usize, usize, usize, f64) -> f64> Visit for Triangles<'_, F> {
    #[inline(always)] // part of a kernel
    fn visit<I: Isa>(&mut self, number: usize, count: usize) -> Option<f32> {
        let (bundle, leaf) = (self.bundle, &self.leaves[number]);
        let splat = <I::F32 as Vector>::splat;
        let zero = splat(0.0);
        // Corners relative to the origin, and their edges: normals of the planes through the origin and an edge.
        let mut corners = [[zero; 3]; 3];
        for corner in 0..3 {
            for axis in 0..3 {
                corners[corner][axis] = I::F32::load(&leaf.corners[corner][axis]).sub(splat(bundle.origin[axis]));
            }
        }
        let mut normals = [[zero; 3]; 3];
        let mut longest = zero;
        for edge in 0..3 {
            let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
            let (mut sum, mut difference, mut length) = ([zero; 3], [zero; 3], zero);
            for axis in 0..3 {
                sum[axis] = a[axis].add(b[axis]);
                difference[axis] = b[axis].sub(a[axis]);
                length = length.add(difference[axis].max(zero.sub(difference[axis])));
            }
            longest = longest.max(length);
            for axis in 0..3 {
                let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
                normals[edge][axis] = sum[k].neg_mul_add(difference[j], sum[j].mul(difference[k]));
            }
        }
        // A corner is off by its own rounding, the origin's and that of their difference, 6 units of the reach along every
        // axis; for a ray that meets the triangle that changes D . n by at most 2 x 6 sqrt(3) units times the two distances to
        // the corners of an edge, each at most the longest edge. Products, sums and directions add some 40 units. Twice that.
        let reach = leaf.reach + bundle.reach;
        let tolerance = longest.mul(splat(256.0 * UNIT * reach));

        // Triangles that the box of directions may meet: those with all planes on one side of some direction.
        let (mut may_be_above, mut may_be_below) = (u32::MAX, u32::MAX);
        for edge in 0..3 {
            let (mut most, mut least) = (zero, zero);
            for axis in 0..3 {
                let ends = [
                    normals[edge][axis].mul(splat(bundle.low[axis])),
                    normals[edge][axis].mul(splat(bundle.high[axis])),
                ];
                most = most.add(ends[0].max(ends[1]));
                least = least.add(ends[0].min(ends[1]));
            }
            let twice = tolerance.add(tolerance);
            may_be_above &= zero.sub(twice).at_most(most);
            may_be_below &= least.at_most(twice);
        }
        let mut survivors = (may_be_above | may_be_below) & ((1_u32 << count) - 1);
        if survivors == 0 {
            return None;
        }

        // Now with rays as lanes.
        let mut planes = [[[0.0; WIDTH]; 3]; 3];
        let mut tolerances = [0.0; WIDTH];
        for edge in 0..3 {
            for axis in 0..3 {
                normals[edge][axis].store(&mut planes[edge][axis]);
            }
        }
        tolerance.store(&mut tolerances);
        let mut has_changed = false;
        while survivors != 0 {
            let lane = survivors.trailing_zeros() as usize;
            survivors &= survivors - 1;
            for first in (0..bundle.num_rays).step_by(16) {
                let (mut least, mut most) = (splat(f32::INFINITY), splat(f32::NEG_INFINITY));
                for edge in 0..3 {
                    let mut side = zero;
                    for axis in 0..3 {
                        let direction = I::F32::load(&bundle.directions[axis][first..]);
                        side = direction.mul_add(splat(planes[edge][axis][lane]), side);
                    }
                    (least, most) = (least.min(side), most.max(side));
                }
                let tolerance = splat(tolerances[lane]);
                let mut met = zero.sub(tolerance).at_most(least) | most.at_most(tolerance);
                while met != 0 {
                    let ray = first + met.trailing_zeros() as usize;
                    met &= met - 1;
                    if ray < bundle.num_rays {
                        let best = (self.test)(ray, number, lane, self.best[ray]);
                        has_changed |= best < self.best[ray];
                        self.best[ray] = best;
                    }
                }
            }
        }
        has_changed.then(|| farthest(&self.best[..bundle.num_rays]))
    }
}

/// The bundle's box of directions, prepared for boxes of children.
struct Slabs {
    /// The origin, moved outwards for both sides of a box: by more than all coordinates are rounded.
    origin: [[f32; 2]; 3],
    inverse: [[f32; 2]; 3],
    sign: [Sign; 3],
}

/// Where a bundle goes along an axis.
#[derive(Clone, Copy, PartialEq)]
enum Sign {
    Forward,
    Backward,
    Both,
}

impl Slabs {
    fn new(bundle: &Bundle) -> Self {
        let inverse = |x: f32| x.recip().clamp(-1e30, 1e30);
        let mut slabs = Self {
            origin: [[0.0; 2]; 3],
            inverse: [[0.0; 2]; 3],
            sign: [Sign::Both; 3],
        };
        for axis in 0..3 {
            let (low, high) = (bundle.low[axis], bundle.high[axis]);
            slabs.sign[axis] = if low > 0.0 {
                Sign::Forward
            } else if high < 0.0 {
                Sign::Backward
            } else {
                Sign::Both
            };
            slabs.inverse[axis] = [inverse(low), inverse(high)];
            let pad = 8.0 * UNIT * bundle.reach;
            slabs.origin[axis] = [bundle.origin[axis] + pad, bundle.origin[axis] - pad];
        }
        slabs
    }

    /// A bit per child whose box some direction may meet before `far`, and where.
    #[inline(always)]
    fn enter<I: Isa>(&self, node: &WideNode, far: f32, near: &mut [f32; WIDTH]) -> u32 {
        let splat = <I::F32 as Vector>::splat;
        let (mut entry, mut exit) = (splat(0.0), splat(far));
        for axis in 0..3 {
            let low = I::F32::load(&node.min[axis]).sub(splat(self.origin[axis][0]));
            let high = I::F32::load(&node.max[axis]).sub(splat(self.origin[axis][1]));
            let [first, last] = self.inverse[axis].map(splat);
            let (enters, exits) = match self.sign[axis] {
                Sign::Forward => (low.mul(first).min(low.mul(last)), high.mul(first).max(high.mul(last))),
                Sign::Backward => (high.mul(first).min(high.mul(last)), low.mul(first).max(low.mul(last))),
                // Only a box to one side of the origin bounds the way there.
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
