//! Bounding-volume trees of 16 children per node, with boxes in f32.

/// Number of children of a node, and largest number of primitives of a leaf.
pub const WIDTH: usize = 16;

/// Bounding-volume tree over boxes.
#[derive(Clone)]
pub struct Tree {
    /// Node 0 is the root; children come after their parents. Empty if there are no boxes.
    pub nodes: Vec<Node>,
}

/// Inner node: boxes of the children, and their kinds.
#[derive(Clone)]
#[repr(C, align(64))]
pub struct Node {
    /// Smallest coordinates, axis by axis; slots without a child hold a box that nothing meets.
    pub min: [[f32; WIDTH]; 3],
    /// Largest coordinates.
    pub max: [[f32; WIDTH]; 3],
    /// Child in each box.
    pub child: [Child; WIDTH],
}

impl Node {
    /// Node without children.
    pub(super) const EMPTY: Self = Self {
        min: [[f32::INFINITY; WIDTH]; 3],
        max: [[f32::NEG_INFINITY; WIDTH]; 3],
        child: [Child(u32::MAX); WIDTH],
    };

    /// Number of children.
    pub(super) fn num_children(&self) -> usize {
        self.child.iter().filter(|child| child.0 != u32::MAX).count()
    }
}

/// Packed number of a node, or of a leaf with its number of primitives.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Child(pub u32);

/// Kind of a [`Child`].
pub enum Kind {
    /// Node of a number.
    Node(usize),
    /// Leaf of a number, and how many primitives it holds.
    Leaf(usize, usize),
}

impl Child {
    const LEAF: u32 = 1 << 31;

    /// Leaf of a number, and how many primitives it holds.
    pub(super) fn leaf(number: usize, count: usize) -> Self {
        Self(Self::LEAF | (number as u32) << 4 | (count - 1) as u32)
    }

    /// Kind, unpacked.
    #[cfg_attr(optimised, inline(always))]
    pub fn kind(self) -> Kind {
        if self.0 & Self::LEAF == 0 {
            Kind::Node(self.0 as usize)
        } else {
            Kind::Leaf(((self.0 & !Self::LEAF) >> 4) as usize, (self.0 & 15) as usize + 1)
        }
    }
}

/// Largest number of primitives of a tree: numbers of leaves have 27 bits, and a leaf may hold a single one.
pub const MAX_PRIMITIVES: usize = 1 << 27;

/// Primitives of a leaf, the last one repeated.
pub type Primitives = [u32; WIDTH];
