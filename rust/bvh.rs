//! Bounding-volume trees of 16 children per node; the only file that names obvhs.
//!
//! obvhs builds a tree of two children per node, which is collapsed at once. Boxes are f32, rounded outwards. What a leaf
//! holds, and how trees are walked, is told elsewhere (`leaf`, `bundle`).

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ploc::{PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

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

    /// The smallest box round both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Halfway between; the origin for the box that holds nothing.
    pub fn middle(&self) -> DVec3 {
        let middle = 0.5 * (self.min + self.max);
        if middle.is_finite() { middle } else { DVec3::ZERO }
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

/// Children of a node, and most primitives of a leaf.
pub const WIDTH: usize = 16;

/// Tree over boxes.
#[derive(Clone)]
pub struct Tree {
    /// Node 0 is the root; children come after their parents. Empty when there is nothing.
    pub nodes: Vec<Node>,
    /// Number of leaves.
    pub num_leaves: usize,
}

/// Boxes of the children, and what they are.
#[derive(Clone)]
#[repr(C, align(64))]
pub struct Node {
    /// Smallest coordinates, axis by axis; places without a child hold a box that nothing meets.
    pub min: [[f32; WIDTH]; 3],
    /// Largest coordinates.
    pub max: [[f32; WIDTH]; 3],
    /// What the boxes hold.
    pub child: [Child; WIDTH],
}

impl Node {
    const EMPTY: Self = Self {
        min: [[f32::INFINITY; WIDTH]; 3],
        max: [[f32::NEG_INFINITY; WIDTH]; 3],
        child: [Child(u32::MAX); WIDTH],
    };

    /// Give a child its box.
    fn set_box(&mut self, place: usize, aabb: &Aabb) {
        for axis in 0..3 {
            self.min[axis][place] = aabb.min[axis];
            self.max[axis][place] = aabb.max[axis];
        }
    }

    /// Box of a child.
    fn child_box(&self, place: usize) -> Aabb {
        Aabb {
            min: Vec3A::from_array(self.min.map(|x| x[place])),
            max: Vec3A::from_array(self.max.map(|x| x[place])),
        }
    }

    /// Number of children.
    fn num_children(&self) -> usize {
        self.child.iter().filter(|child| child.0 != u32::MAX).count()
    }
}

/// A node, or a leaf and how many primitives it holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Child(pub u32);

/// What a [`Child`] is.
pub enum Kind {
    /// A node and its number.
    Node(usize),
    /// A leaf, its number and that of its primitives.
    Leaf(usize, usize),
}

impl Child {
    const LEAF: u32 = 1 << 31;

    fn leaf(number: usize, count: usize) -> Self {
        Self(Self::LEAF | (number as u32) << 4 | (count - 1) as u32)
    }

    /// What it is.
    #[inline(always)]
    pub fn kind(self) -> Kind {
        if self.0 & Self::LEAF == 0 {
            Kind::Node(self.0 as usize)
        } else {
            Kind::Leaf(((self.0 & !Self::LEAF) >> 4) as usize, (self.0 & 15) as usize + 1)
        }
    }
}

/// Most primitives of a tree: numbers of leaves have 27 bits, and a leaf may hold a single one.
pub const MOST_PRIMITIVES: usize = 1 << 27;

/// Primitives of a leaf, the last one repeated.
pub type Primitives = [u32; WIDTH];

/// obvhs preset: trees whose images are within 15 % of the best at a seventh of the build time.
const BUILD: BvhBuildParams = BvhBuildParams {
    pre_split: false,
    ploc_search_distance: PlocSearchDistance::Low,
    search_depth_threshold: 2,
    reinsertion_batch_ratio: 0.02,
    post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
    sort_precision: SortPrecision::U64,
    max_prims_per_leaf: 1,
    collapse_traversal_cost: 1.0,
};

impl Tree {
    /// Tree over `number` boxes, at most [`MOST_PRIMITIVES`], finite and not empty, and the primitives of its leaves:
    /// at most `most` each.
    pub fn build(number: usize, most: usize, bounds: impl Fn(usize) -> Bounds + Sync) -> (Self, Vec<Primitives>) {
        let mut leaves = Vec::new();
        let nodes = match number {
            0 => Vec::new(),
            // Nothing to build.
            1..=WIDTH => {
                let mut root = Node::EMPTY;
                if number <= most {
                    let all = (0..number).fold(Bounds::EMPTY, |all, i| all.union(&bounds(i)));
                    root.set_box(0, &all.outward());
                    root.child[0] = Child::leaf(0, number);
                    leaves.push(std::array::from_fn(|i| i.min(number - 1) as u32));
                } else {
                    for i in 0..number {
                        root.set_box(i, &bounds(i).outward());
                        root.child[i] = Child::leaf(i, 1);
                        leaves.push([i as u32; WIDTH]);
                    }
                }
                vec![root]
            }
            _ => {
                let boxes: Vec<Aabb> = (0..number).into_par_iter().map(|i| bounds(i).outward()).collect();
                let binary = build_bvh2(&boxes, BUILD, &mut std::time::Duration::default());
                drop(boxes);
                collapse(&binary, most, &mut leaves)
            }
        };
        let tree = Self {
            nodes,
            num_leaves: leaves.len(),
        };
        (tree, leaves)
    }

    /// The same tree over boxes of other places and sizes; `bounds` of a leaf.
    pub fn refit(&self, bounds: impl Fn(usize) -> Bounds + Sync) -> Self {
        let mut nodes = self.nodes.clone();
        nodes.par_iter_mut().for_each(|node| {
            for place in 0..WIDTH {
                if node.child[place].0 != u32::MAX
                    && let Kind::Leaf(leaf, _) = node.child[place].kind()
                {
                    node.set_box(place, &bounds(leaf).outward());
                }
            }
        });
        // Children come after their parents.
        for parent in (0..nodes.len()).rev() {
            for place in 0..WIDTH {
                if nodes[parent].child[place].0 != u32::MAX
                    && let Kind::Node(child) = nodes[parent].child[place].kind()
                {
                    let aabb = nodes[child].bounds();
                    nodes[parent].set_box(place, &aabb);
                }
            }
        }
        Self {
            nodes,
            num_leaves: self.num_leaves,
        }
    }

    /// How many boxes and primitives a ray through the tree's box may expect to meet, roughly: areas over the root's.
    pub fn cost(&self) -> f64 {
        let Some(root) = self.nodes.first() else {
            return 0.0;
        };
        let whole = f64::from(root.bounds().half_area()).max(f64::MIN_POSITIVE);
        let areas = |node: &Node| -> f64 {
            (0..node.num_children())
                .map(|place| f64::from(node.child_box(place).half_area()))
                .sum()
        };
        self.nodes.iter().map(areas).sum::<f64>() / whole
    }

    /// Memory [bytes].
    pub fn memory(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }
}

impl Node {
    /// Box round all children.
    fn bounds(&self) -> Aabb {
        (0..self.num_children()).fold(Aabb::empty(), |all, place| all.union(&self.child_box(place)))
    }
}

/// Opens nodes of two children until there are [`WIDTH`], the largest first. Subtrees of at most `most` primitives become
/// a leaf.
fn collapse(binary: &Bvh2, most: usize, leaves: &mut Vec<Primitives>) -> Vec<Node> {
    let counts = counts(binary);
    let from = &binary.nodes;
    let is_leaf = |node: usize| counts[node] as usize <= most;
    let mut nodes = vec![Node::EMPTY];
    let mut rest = vec![(0, 0)];
    while let Some((node, to)) = rest.pop() {
        let mut children = [0; WIDTH];
        let mut areas = [f32::NEG_INFINITY; WIDTH];
        let area = |node: usize| {
            if is_leaf(node) {
                f32::NEG_INFINITY
            } else {
                from[node].aabb().half_area()
            }
        };
        (children[0], areas[0]) = (node, f32::INFINITY);
        let mut number = 1;
        while number < WIDTH {
            let mut largest = 0;
            for i in 1..number {
                largest = if areas[i] > areas[largest] { i } else { largest };
            }
            if areas[largest] == f32::NEG_INFINITY {
                break;
            }
            let first = from[children[largest]].first_index as usize;
            (children[largest], areas[largest]) = (first, area(first));
            (children[number], areas[number]) = (first + 1, area(first + 1));
            number += 1;
        }
        for (place, child) in children[..number].iter().copied().enumerate() {
            nodes[to].set_box(place, from[child].aabb());
            if is_leaf(child) {
                nodes[to].child[place] = Child::leaf(leaves.len(), counts[child] as usize);
                leaves.push(primitives(binary, child));
            } else {
                nodes[to].child[place] = Child(nodes.len() as u32);
                rest.push((child, nodes.len()));
                nodes.push(Node::EMPTY);
            }
        }
    }
    nodes
}

/// Primitives below every node.
fn counts(binary: &Bvh2) -> Vec<u32> {
    let mut counts = vec![0; binary.nodes.len()];
    let mut rest = vec![(0, false)];
    while let Some((node, is_known)) = rest.pop() {
        let first = binary.nodes[node].first_index as usize;
        if binary.nodes[node].prim_count > 0 {
            counts[node] = binary.nodes[node].prim_count;
        } else if is_known {
            counts[node] = counts[first] + counts[first + 1];
        } else {
            rest.extend([(node, true), (first, false), (first + 1, false)]);
        }
    }
    counts
}

/// The primitives below a node, at most [`WIDTH`].
fn primitives(binary: &Bvh2, node: usize) -> Primitives {
    let mut primitives = [0; WIDTH];
    let mut rest = [0; WIDTH];
    let (mut count, mut waiting) = (0, 1);
    rest[0] = node;
    while waiting > 0 {
        waiting -= 1;
        let node = &binary.nodes[rest[waiting]];
        let first = node.first_index as usize;
        if node.prim_count > 0 {
            for primitive in &binary.primitive_indices[first..first + node.prim_count as usize] {
                primitives[count..].fill(*primitive);
                count += 1;
            }
        } else {
            (rest[waiting], rest[waiting + 1]) = (first + 1, first);
            waiting += 2;
        }
    }
    primitives
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(number: usize) -> Vec<Bounds> {
        (0..number)
            .map(|i| {
                let at = DVec3::new((37 * i % 101) as f64, (53 * i % 97) as f64, i as f64);
                Bounds { min: at, max: at + 0.1 }
            })
            .collect()
    }

    /// Every primitive is in one leaf, and within all boxes above it.
    fn check(tree: &Tree, leaves: &[Primitives], boxes: &[Bounds], most: usize) {
        let mut seen = vec![0; boxes.len()];
        let mut rest: Vec<(usize, Vec<Aabb>)> = vec![(0, Vec::new())];
        while let Some((node, above)) = rest.pop() {
            let node = &tree.nodes[node];
            for place in 0..node.num_children() {
                let mut above = above.clone();
                above.push(node.child_box(place));
                match node.child[place].kind() {
                    Kind::Node(child) => rest.push((child, above)),
                    Kind::Leaf(leaf, count) => {
                        assert!(count <= most);
                        for i in &leaves[leaf][..count] {
                            seen[*i as usize] += 1;
                            let inner = &boxes[*i as usize];
                            for outer in &above {
                                assert!(outer.min.as_dvec3().cmple(inner.min).all());
                                assert!(outer.max.as_dvec3().cmpge(inner.max).all());
                            }
                        }
                    }
                }
            }
        }
        assert!(seen.iter().all(|n| *n == 1));
    }

    #[test]
    fn every_primitive_is_in_one_leaf_and_within_the_boxes_above_it() {
        for number in [1, 2, 15, 16, 17, 100, 5000] {
            for most in [1, WIDTH] {
                let boxes = boxes(number);
                let (tree, leaves) = Tree::build(number, most, |i| boxes[i]);
                assert_eq!(leaves.len(), tree.num_leaves);
                check(&tree, &leaves, &boxes, most);
            }
        }
    }

    #[test]
    fn nothing_makes_an_empty_tree() {
        let (tree, leaves) = Tree::build(0, 1, |_| Bounds::EMPTY);
        assert!(tree.nodes.is_empty() && leaves.is_empty());
    }

    #[test]
    fn a_refitted_tree_holds_what_has_moved_and_costs_more_when_it_is_torn() {
        let before = boxes(3000);
        let (tree, leaves) = Tree::build(before.len(), WIDTH, |i| before[i]);
        let refit = |boxes: &[Bounds]| {
            let of = |leaf: usize| {
                leaves[leaf]
                    .iter()
                    .fold(Bounds::EMPTY, |b, i| b.union(&boxes[*i as usize]))
            };
            tree.refit(of)
        };
        let moved: Vec<Bounds> = before
            .iter()
            .map(|b| Bounds {
                min: 2.0 * b.min + 1.0,
                max: 2.0 * b.max + 1.0,
            })
            .collect();
        check(&refit(&moved), &leaves, &moved, WIDTH);
        assert!((refit(&before).cost() / tree.cost() - 1.0).abs() < 1e-12);
        let torn: Vec<Bounds> = (0..before.len()).map(|i| before[i * 1009 % before.len()]).collect();
        check(&refit(&torn), &leaves, &torn, WIDTH);
        assert!(refit(&torn).cost() > 3.0 * tree.cost());
    }
}
