//! Bounding-volume tree over boxes; the only file that names obvhs.
//!
//! obvhs builds; the walk is ours: it knows boxes and primitive numbers, never what they hold. Boxes are f32,
//! rounded outwards; rays are f64, so a box is never missed by rounding, however far away the origin is.

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ploc::{PlocSearchDistance, SortPrecision};

/// Axis-aligned box in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: DVec3,
    /// Largest coordinates.
    pub max: DVec3,
}

impl Bounds {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    /// The smallest box round some points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self {
            min: b.min.min(p),
            max: b.max.max(p),
        })
    }

    /// The eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    self.min[axis]
                } else {
                    self.max[axis]
                }
            };
            DVec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// The same box in f32, rounded outwards.
    fn outward(&self) -> Aabb {
        let down = |x: f64| {
            if f64::from(x as f32) > x {
                (x as f32).next_down()
            } else {
                x as f32
            }
        };
        let up = |x: f64| {
            if f64::from(x as f32) < x {
                (x as f32).next_up()
            } else {
                x as f32
            }
        };
        Aabb {
            min: Vec3A::new(down(self.min.x), down(self.min.y), down(self.min.z)),
            max: Vec3A::new(up(self.max.x), up(self.max.y), up(self.max.z)),
        }
    }
}

/// Half-line of a search: points `origin + t direction` with `t > start`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts [m].
    pub origin: DVec3,
    /// Where it goes; `t` counts in its length.
    pub direction: DVec3,
    /// Nothing at or before this `t` is a hit.
    pub start: f64,
}

/// Tree over boxes, built once and shared.
pub struct Tree {
    bvh: Bvh2,
}

/// Deepest tree the walk takes without a larger stack; obvhs reports its own depth.
const STACK: usize = 128;

/// obvhs preset: trees whose images are within 15 % of the best at a seventh of the build time.
const BUILD: BvhBuildParams = BvhBuildParams {
    pre_split: false,
    ploc_search_distance: PlocSearchDistance::Low,
    search_depth_threshold: 2,
    reinsertion_batch_ratio: 0.02,
    post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
    sort_precision: SortPrecision::U64,
    max_prims_per_leaf: 4,
    collapse_traversal_cost: 1.0,
};

impl Tree {
    /// Tree over `boxes`; primitive `i` is box `i`. Boxes must be finite and not empty.
    pub fn build(boxes: &[Bounds]) -> Self {
        let boxes: Vec<Aabb> = boxes.iter().map(Bounds::outward).collect();
        let bvh = if boxes.is_empty() {
            Bvh2::default()
        } else {
            build_bvh2(&boxes, BUILD, &mut std::time::Duration::default())
        };
        Self { bvh }
    }

    /// Call `visit(primitive, far)` for every primitive whose box the ray meets before `far`, near boxes first.
    /// `visit` returns the new `far`, the distance beyond which nothing is wanted any more.
    pub fn walk(&self, ray: &Ray, mut far: f64, mut visit: impl FnMut(u32, f64) -> f64) {
        if self.bvh.nodes.is_empty() {
            return;
        }
        let slabs = Slabs::new(ray);
        let Some(near) = slabs.enter(&self.bvh.nodes[0].aabb, far) else {
            return;
        };

        let mut stack = Stack::new(self.bvh.max_depth + 1);
        stack.push(0, near);
        while let Some((index, near)) = stack.pop() {
            if near > far * SLACK {
                continue;
            }
            let node = &self.bvh.nodes[index as usize];
            if node.prim_count > 0 {
                let first = node.first_index as usize;
                for &primitive in &self.bvh.primitive_indices[first..first + node.prim_count as usize] {
                    far = visit(primitive, far);
                }
                continue;
            }
            // Push the farther child first, so that the nearer one is walked first.
            let children = [node.first_index, node.first_index + 1];
            match children.map(|child| slabs.enter(&self.bvh.nodes[child as usize].aabb, far)) {
                [Some(left), Some(right)] if left <= right => {
                    stack.push(children[1], right);
                    stack.push(children[0], left);
                }
                [Some(left), Some(right)] => {
                    stack.push(children[0], left);
                    stack.push(children[1], right);
                }
                [Some(left), None] => stack.push(children[0], left),
                [None, Some(right)] => stack.push(children[1], right),
                [None, None] => {}
            }
        }
    }
}

/// Children of a node of a [`WideTree`], and most primitives of one of its leaves.
pub const WIDTH: usize = 16;

/// The same tree with [`WIDTH`] children per node, for walks that test all of them at once.
pub struct WideTree {
    /// Node 0 is the root; children come after their parents.
    pub nodes: Vec<WideNode>,
    /// Primitives of every leaf, the last one repeated; how many they are, its parent says.
    pub leaves: Vec<[u32; WIDTH]>,
}

/// Boxes of the children, and what they are.
#[derive(Clone)]
#[repr(C, align(64))]
pub struct WideNode {
    /// Smallest coordinates, axis by axis; places without a child hold a box that nothing meets.
    pub min: [[f32; WIDTH]; 3],
    /// Largest coordinates.
    pub max: [[f32; WIDTH]; 3],
    /// Number of a node, or of a leaf where there are primitives.
    pub child: [u32; WIDTH],
    /// Primitives of the child; 0: it is a node.
    pub num_primitives: [u8; WIDTH],
}

impl WideNode {
    const EMPTY: Self = Self {
        min: [[f32::INFINITY; WIDTH]; 3],
        max: [[f32::NEG_INFINITY; WIDTH]; 3],
        child: [0; WIDTH],
        num_primitives: [0; WIDTH],
    };
}

impl Tree {
    /// The tree with many children per node. Subtrees of at most `most` primitives become a leaf.
    pub fn widen(&self, most: usize) -> WideTree {
        let mut wide = WideTree {
            nodes: Vec::new(),
            leaves: Vec::new(),
        };
        let nodes = &self.bvh.nodes;
        if nodes.is_empty() {
            return wide;
        }
        let counts = self.counts();
        // Leaves of the binary tree cannot be opened.
        let is_leaf = |node: usize| counts[node] as usize <= most || nodes[node].prim_count > 0;
        wide.nodes.push(WideNode::EMPTY);
        let mut rest = vec![(0, 0)];
        while let Some((from, to)) = rest.pop() {
            // Open the largest child until there is no more room.
            let mut children: Vec<usize> = vec![from];
            while children.len() < WIDTH {
                let inner = (0..children.len()).filter(|i| !is_leaf(children[*i]));
                let area = |i: &usize| nodes[children[*i]].aabb.half_area();
                let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else {
                    break;
                };
                let first = nodes[children[largest]].first_index as usize;
                children[largest] = first;
                children.push(first + 1);
            }
            for (place, child) in children.into_iter().enumerate() {
                let (min, max) = (nodes[child].aabb.min, nodes[child].aabb.max);
                for axis in 0..3 {
                    wide.nodes[to].min[axis][place] = min[axis];
                    wide.nodes[to].max[axis][place] = max[axis];
                }
                if is_leaf(child) {
                    wide.nodes[to].child[place] = wide.leaves.len() as u32;
                    wide.nodes[to].num_primitives[place] = counts[child] as u8;
                    wide.leaves.push(self.primitives(child));
                } else {
                    wide.nodes[to].child[place] = wide.nodes.len() as u32;
                    rest.push((child, wide.nodes.len()));
                    wide.nodes.push(WideNode::EMPTY);
                }
            }
        }
        wide
    }

    /// Primitives below every node.
    fn counts(&self) -> Vec<u32> {
        let nodes = &self.bvh.nodes;
        let mut counts = vec![0; nodes.len()];
        let mut rest = vec![(0, false)];
        while let Some((node, is_known)) = rest.pop() {
            let first = nodes[node].first_index as usize;
            if nodes[node].prim_count > 0 {
                counts[node] = nodes[node].prim_count;
            } else if is_known {
                counts[node] = counts[first] + counts[first + 1];
            } else {
                rest.extend([(node, true), (first, false), (first + 1, false)]);
            }
        }
        counts
    }

    /// The primitives below a node, at most [`WIDTH`], the last one repeated.
    fn primitives(&self, node: usize) -> [u32; WIDTH] {
        let mut primitives = [0; WIDTH];
        let (mut count, mut rest) = (0, vec![node]);
        while let Some(node) = rest.pop() {
            let node = &self.bvh.nodes[node];
            let first = node.first_index as usize;
            if node.prim_count > 0 {
                for primitive in &self.bvh.primitive_indices[first..first + node.prim_count as usize] {
                    primitives[count..].fill(*primitive);
                    count += 1;
                }
            } else {
                rest.extend([first + 1, first]);
            }
        }
        primitives
    }
}

/// Nodes still to walk and where the ray enters them; on the heap only for trees deeper than [`STACK`].
struct Stack {
    short: [(u32, f64); STACK],
    len: usize,
    rest: Vec<(u32, f64)>,
}

impl Stack {
    fn new(depth: usize) -> Self {
        Self {
            short: [(0, 0.0); STACK],
            len: 0,
            rest: Vec::with_capacity(depth.saturating_sub(STACK)),
        }
    }

    fn push(&mut self, node: u32, near: f64) {
        if self.len < STACK {
            self.short[self.len] = (node, near);
            self.len += 1;
        } else {
            self.rest.push((node, near));
        }
    }

    fn pop(&mut self) -> Option<(u32, f64)> {
        self.rest.pop().or_else(|| {
            self.len = self.len.checked_sub(1)?;
            Some(self.short[self.len])
        })
    }
}

/// Three roundings per plane: the far bound grows by that much (Ize, Robust BVH Ray Traversal, 2013).
const SLACK: f64 = 1.0 + 8.0 * f64::EPSILON;

/// A ray prepared for the slab test.
struct Slabs {
    origin: DVec3,
    inverse: DVec3,
    is_backward: [bool; 3],
    start: f64,
}

impl Slabs {
    fn new(ray: &Ray) -> Self {
        let inverse = ray.direction.recip();
        Self {
            origin: ray.origin,
            inverse,
            is_backward: inverse.to_array().map(f64::is_sign_negative),
            start: ray.start,
        }
    }

    /// Where the ray enters the box, if it does so before `far`.
    ///
    /// Along an axis that the ray does not move on, a plane lies at infinity, or, if the ray runs in that plane,
    /// at 0 * inf = NaN, which `min` and `max` of f64 pass over: such a ray is inside.
    fn enter(&self, aabb: &Aabb, far: f64) -> Option<f64> {
        let (min, max) = (aabb.min.as_dvec3(), aabb.max.as_dvec3());
        let (mut near, mut out) = (self.start, far);
        for axis in 0..3 {
            let (first, last) = if self.is_backward[axis] { (max, min) } else { (min, max) };
            near = near.max((first[axis] - self.origin[axis]) * self.inverse[axis]);
            out = out.min((last[axis] - self.origin[axis]) * self.inverse[axis]);
        }
        (near <= out * SLACK).then_some(near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_tree_visits_nothing() {
        let ray = Ray {
            origin: DVec3::ZERO,
            direction: DVec3::X,
            start: 0.0,
        };
        Tree::build(&[]).walk(&ray, f64::INFINITY, |_, _| panic!("visited"));
    }

    #[test]
    fn every_box_on_the_ray_is_visited_near_ones_first() {
        for num in [1_u32, 2, 3, 100] {
            let boxes: Vec<Bounds> = (0..num)
                .map(|i| Bounds {
                    min: DVec3::new(f64::from(2 * i), -1.0, 0.0),
                    max: DVec3::new(f64::from(2 * i + 1), 1.0, 0.0),
                })
                .collect();
            let tree = Tree::build(&boxes);
            // In the plane of the flat boxes, along their common face.
            let ray = Ray {
                origin: DVec3::new(-1.0, 1.0, 0.0),
                direction: DVec3::X,
                start: 0.0,
            };
            let mut seen = Vec::new();
            tree.walk(&ray, f64::INFINITY, |i, far| {
                seen.push(i);
                far
            });
            seen.sort_unstable();
            assert_eq!(seen, (0..num).collect::<Vec<_>>());
        }
    }

    #[test]
    fn boxes_beyond_far_are_not_visited() {
        let boxes: Vec<Bounds> = (0..64)
            .map(|i| Bounds {
                min: DVec3::splat(f64::from(i)),
                max: DVec3::splat(f64::from(i) + 0.5),
            })
            .collect();
        let ray = Ray {
            origin: DVec3::splat(-1.0),
            direction: DVec3::ONE,
            start: 0.0,
        };
        let mut seen = 0;
        Tree::build(&boxes).walk(&ray, 5.2, |i, far| {
            seen += 1;
            assert!(i <= 7, "box {i} is visited with its leaf only");
            far
        });
        assert!(seen >= 5);
    }
}
