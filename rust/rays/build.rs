//! Construction and refit of trees; the only file that names obvhs.
//!
//! obvhs builds a tree of two children per node, which is collapsed at once. Boxes are rounded outwards.

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ploc::{PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

use crate::geometry::aabb::Bounds;
use crate::rays::tree::{Child, Kind, Node, Primitives, Tree, WIDTH};

/// obvhs preset. Larger search distances and reinsertion make builds two to three times longer and images of the rooms
/// of `cargo bench --bench trace` no shorter: change it here and run that again.
const BUILD: BvhBuildParams = BvhBuildParams {
    pre_split: false,
    ploc_search_distance: PlocSearchDistance::VeryLow,
    search_depth_threshold: 2,
    reinsertion_batch_ratio: 0.0,
    post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
    sort_precision: SortPrecision::U64,
    max_prims_per_leaf: 1,
    collapse_traversal_cost: 1.0,
};

impl Tree {
    /// Tree over `number` boxes, at most [`MAX_PRIMITIVES`], finite and not empty, and the primitives of its leaves:
    /// at most `leaf_size` each.
    pub fn build(number: usize, leaf_size: usize, bounds: impl Fn(usize) -> Bounds + Sync) -> (Self, Vec<Primitives>) {
        let mut leaves = Vec::new();
        let nodes = match number {
            0 => Vec::new(),
            // Nothing to build.
            1..=WIDTH => {
                let mut root = Node::EMPTY;
                if number <= leaf_size {
                    let all = (0..number).fold(Bounds::EMPTY, |all, i| all.union(&bounds(i)));
                    root.set_box(0, &outward(&all));
                    root.child[0] = Child::leaf(0, number);
                    leaves.push(std::array::from_fn(|i| i.min(number - 1) as u32));
                } else {
                    for i in 0..number {
                        root.set_box(i, &outward(&bounds(i)));
                        root.child[i] = Child::leaf(i, 1);
                        leaves.push([i as u32; WIDTH]);
                    }
                }
                vec![root]
            }
            _ => {
                let boxes: Vec<Aabb> = (0..number).into_par_iter().map(|i| outward(&bounds(i))).collect();
                let binary = build_bvh2(&boxes, BUILD, &mut std::time::Duration::default());
                drop(boxes);
                let nodes;
                (nodes, leaves) = Collapse::new(&binary, leaf_size).run();
                nodes
            }
        };
        (Self { nodes }, leaves)
    }

    /// Refit the tree to moved boxes; `bounds` gives the box of a leaf.
    pub fn refit(&self, bounds: impl Fn(usize) -> Bounds + Sync) -> Self {
        let mut nodes = self.nodes.clone();
        nodes.par_iter_mut().for_each(|node| {
            for slot in 0..WIDTH {
                if node.child[slot].0 != u32::MAX
                    && let Kind::Leaf(leaf, _) = node.child[slot].kind()
                {
                    node.set_box(slot, &outward(&bounds(leaf)));
                }
            }
        });
        // Children come after their parents.
        for parent in (0..nodes.len()).rev() {
            for slot in 0..WIDTH {
                if nodes[parent].child[slot].0 != u32::MAX
                    && let Kind::Node(child) = nodes[parent].child[slot].kind()
                {
                    let aabb = nodes[child].bounds();
                    nodes[parent].set_box(slot, &aabb);
                }
            }
        }
        Self { nodes }
    }

    /// Cost by the surface-area heuristic: expected number of boxes that a ray through the root's box meets.
    pub fn cost(&self) -> f64 {
        let Some(root) = self.nodes.first() else {
            return 0.0;
        };
        let whole = f64::from(root.bounds().half_area()).max(f64::MIN_POSITIVE);
        let areas = |node: &Node| -> f64 {
            (0..node.num_children())
                .map(|slot| f64::from(node.child_box(slot).half_area()))
                .sum()
        };
        self.nodes.iter().map(areas).sum::<f64>() / whole
    }
}

impl Node {
    /// Set the box of a child.
    fn set_box(&mut self, slot: usize, aabb: &Aabb) {
        for axis in 0..3 {
            self.min[axis][slot] = aabb.min[axis];
            self.max[axis][slot] = aabb.max[axis];
        }
    }

    /// Box of a child.
    fn child_box(&self, slot: usize) -> Aabb {
        Aabb {
            min: Vec3A::from_array(self.min.map(|x| x[slot])),
            max: Vec3A::from_array(self.max.map(|x| x[slot])),
        }
    }

    /// Box round all children.
    fn bounds(&self) -> Aabb {
        (0..self.num_children()).fold(Aabb::empty(), |all, slot| all.union(&self.child_box(slot)))
    }
}

/// Round a box to f32, outwards.
fn outward(bounds: &Bounds) -> Aabb {
    // More than half a step of the nearest number, whatever its size.
    let step = |x: Vec3A| x.abs() * f32::EPSILON + Vec3A::splat(f32::MIN_POSITIVE);
    let (min, max) = (bounds.min.as_vec3a(), bounds.max.as_vec3a());
    Aabb {
        min: min - step(min),
        max: max + step(max),
    }
}

/// Collapse of a binary tree: opens nodes until there are [`WIDTH`] children, the largest first.
struct Collapse<'a> {
    binary: &'a Bvh2,
    /// Largest number of primitives of a subtree that becomes a leaf.
    leaf_size: usize,
    /// Number of primitives below every node.
    counts: Vec<u32>,
}

impl<'a> Collapse<'a> {
    fn new(binary: &'a Bvh2, leaf_size: usize) -> Self {
        let nodes = &binary.nodes;
        debug_assert!(binary.children_are_ordered_after_parents);
        let mut counts = vec![0; nodes.len()];
        for (i, node) in nodes.iter().enumerate().rev() {
            let first = node.first_index as usize;
            counts[i] = if node.prim_count > 0 {
                node.prim_count
            } else {
                counts[first] + counts[first + 1]
            };
        }
        Self {
            binary,
            leaf_size,
            counts,
        }
    }

    /// Nodes and leaves of the new tree.
    fn run(&self) -> (Vec<Node>, Vec<Primitives>) {
        let (mut nodes, mut leaves) = (vec![Node::EMPTY], Vec::new());
        let mut rest = vec![(0, 0)];
        while let Some((binary, node)) = rest.pop() {
            let (children, number) = self.open(binary);
            for (slot, child) in children[..number].iter().copied().enumerate() {
                nodes[node].set_box(slot, self.binary.nodes[child].aabb());
                nodes[node].child[slot] = if self.is_leaf(child) {
                    leaves.push(self.primitives(child));
                    Child::leaf(leaves.len() - 1, self.counts[child] as usize)
                } else {
                    rest.push((child, nodes.len()));
                    nodes.push(Node::EMPTY);
                    Child(nodes.len() as u32 - 1)
                };
            }
        }
        (nodes, leaves)
    }

    fn is_leaf(&self, node: usize) -> bool {
        self.counts[node] as usize <= self.leaf_size
    }

    /// Children of a node of the new tree, and their number.
    fn open(&self, node: usize) -> ([usize; WIDTH], usize) {
        let nodes = &self.binary.nodes;
        let area = |node: usize| {
            if self.is_leaf(node) {
                f32::NEG_INFINITY
            } else {
                nodes[node].aabb().half_area()
            }
        };
        let mut children = [node; WIDTH];
        let mut areas = [f32::INFINITY; WIDTH];
        let mut number = 1;
        while number < WIDTH {
            let mut largest = 0;
            for i in 1..number {
                largest = if areas[i] > areas[largest] { i } else { largest };
            }
            if areas[largest] == f32::NEG_INFINITY {
                break;
            }
            let first = nodes[children[largest]].first_index as usize;
            (children[largest], areas[largest]) = (first, area(first));
            (children[number], areas[number]) = (first + 1, area(first + 1));
            number += 1;
        }
        (children, number)
    }

    /// Primitives below a node, at most [`WIDTH`].
    fn primitives(&self, node: usize) -> Primitives {
        let mut primitives = [0; WIDTH];
        let mut rest = [0; WIDTH];
        let (mut count, mut waiting) = (0, 1);
        rest[0] = node;
        while waiting > 0 {
            waiting -= 1;
            let node = &self.binary.nodes[rest[waiting]];
            let first = node.first_index as usize;
            if node.prim_count > 0 {
                for primitive in &self.binary.primitive_indices[first..first + node.prim_count as usize] {
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
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn boxes(number: usize) -> Vec<Bounds> {
        let at = |i: usize| DVec3::new((37 * i % 101) as f64, (53 * i % 97) as f64, i as f64);
        let of = |min: DVec3| Bounds { min, max: min + 0.1 };
        (0..number).map(at).map(of).collect()
    }

    /// Assert that every primitive is in one leaf, and within all boxes above it.
    fn check(tree: &Tree, leaves: &[Primitives], boxes: &[Bounds], most: usize) {
        let mut seen = vec![0; boxes.len()];
        let mut rest: Vec<(usize, Vec<Aabb>)> = Vec::new();
        rest.extend((!tree.nodes.is_empty()).then_some((0, Vec::new())));
        while let Some((node, above)) = rest.pop() {
            let node = &tree.nodes[node];
            for slot in 0..node.num_children() {
                let mut above = above.clone();
                above.push(node.child_box(slot));
                match node.child[slot].kind() {
                    Kind::Node(child) => rest.push((child, above)),
                    Kind::Leaf(leaf, count) => {
                        assert!(count <= most);
                        for i in &leaves[leaf][..count] {
                            seen[*i as usize] += 1;
                            let inner = &boxes[*i as usize];
                            assert!(above.iter().all(|outer| outer.min.as_dvec3().cmple(inner.min).all()));
                            assert!(above.iter().all(|outer| outer.max.as_dvec3().cmpge(inner.max).all()));
                        }
                    }
                }
            }
        }
        assert!(seen.iter().all(|n| *n == 1));
    }

    #[test]
    fn every_primitive_is_in_one_leaf_and_within_the_boxes_above_it() {
        for number in [0, 1, 2, 15, 16, 17, 100, 5000] {
            for most in [1, WIDTH] {
                let boxes = boxes(number);
                let (tree, leaves) = Tree::build(number, most, |i| boxes[i]);
                check(&tree, &leaves, &boxes, most);
            }
        }
    }

    #[test]
    fn a_refitted_tree_holds_what_has_moved_and_costs_more_when_it_is_torn() {
        let before = boxes(3000);
        let (tree, leaves) = Tree::build(before.len(), WIDTH, |i| before[i]);
        let refit = |boxes: &[Bounds]| {
            let all = |leaf: usize| leaves[leaf].iter().map(|i| boxes[*i as usize]);
            tree.refit(|leaf| all(leaf).fold(Bounds::EMPTY, |sum, b| sum.union(&b)))
        };
        let larger = |b: &Bounds| Bounds {
            min: 2.0 * b.min + 1.0,
            max: 2.0 * b.max + 1.0,
        };
        let moved: Vec<Bounds> = before.iter().map(larger).collect();
        check(&refit(&moved), &leaves, &moved, WIDTH);
        assert!((refit(&before).cost() / tree.cost() - 1.0).abs() < 1e-12);
        let torn: Vec<Bounds> = (0..before.len()).map(|i| before[i * 1009 % before.len()]).collect();
        check(&refit(&torn), &leaves, &torn, WIDTH);
        assert!(refit(&torn).cost() > 3.0 * tree.cost());
    }
}
