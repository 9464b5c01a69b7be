//! Topology of triangle meshes: vertices at one position, edges, and parts joined by union-find.

use std::collections::HashMap;

use glam::DVec3;

/// Number of parts of a mesh, and numbers of edges by kind. Vertices at equal positions count as one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Topology {
    /// Number of groups of triangles that share edges.
    pub parts: usize,
    /// Number of edges of one triangle.
    pub open_edges: usize,
    /// Number of edges of more than two triangles.
    pub nonmanifold_edges: usize,
    /// Number of edges that both of two triangles traverse in the same direction.
    pub inconsistent_edges: usize,
}

impl Topology {
    /// Topology of triangles that index into `vertices`.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut topology = Self::default();
        let positions = distinct_positions(vertices);
        let position = |corner: usize| positions[triangles[corner / 3][corner % 3] as usize];
        let mut parents: Vec<u32> = (0..triangles.len() as u32).collect();
        for_edges(triangles.len(), position, |edge| {
            match edge {
                [_] => topology.open_edges += 1,
                [_, _] => topology.inconsistent_edges += usize::from(two_sides(edge, position).is_none()),
                _ => topology.nonmanifold_edges += 1,
            }
            for pair in edge.windows(2) {
                join(&mut parents, pair[0] as usize / 3, pair[1] as usize / 3);
            }
        });
        let is_root = |triangle: &usize| parents[*triangle] as usize == *triangle;
        topology.parts = (0..triangles.len()).filter(is_root).count();
        topology
    }
}

/// Number of the distinct position of every vertex, counted in order of appearance. Bit-equal is equal, and -0 is 0.
pub fn distinct_positions(vertices: &[DVec3]) -> Vec<u32> {
    let mut numbers = HashMap::new();
    vertices
        .iter()
        .map(|&vertex| {
            // Adding +0 turns -0 into +0 and changes nothing else.
            let bits = (vertex + DVec3::ZERO).to_array().map(f64::to_bits);
            let next = numbers.len() as u32;
            *numbers.entry(bits).or_insert(next)
        })
        .collect()
}

/// Corners at which an edge starts, if exactly two triangles share it and traverse it in opposite directions.
pub fn two_sides(edge: &[u32], position: impl Fn(usize) -> u32) -> Option<(usize, usize)> {
    let &[first, second] = edge else { return None };
    let (first, second) = (first as usize, second as usize);
    (position(first) == position(next_corner(second))).then_some((first, second))
}

/// Call `visit` for every edge with the corners at which it starts in its triangles, in increasing order. `position` is
/// the number of a corner's vertex.
pub fn for_edges(num_triangles: usize, position: impl Fn(usize) -> u32, mut visit: impl FnMut(&[u32])) {
    let ends = |corner: usize| (position(corner), position(next_corner(corner)));
    let low = |corner: usize| ends(corner).0.min(ends(corner).1) as usize;
    let high = |corner: usize| ends(corner).0.max(ends(corner).1);
    let num_corners = 3 * num_triangles;

    // Sort the edges into one bucket per lower end: count, then fill from the back.
    let num_positions = (0..num_corners)
        .map(|corner| position(corner) as usize + 1)
        .max()
        .unwrap_or(0);
    let mut starts = vec![0_u32; num_positions + 1];
    for corner in 0..num_corners {
        starts[low(corner)] += 1;
    }
    let mut total = 0;
    for start in &mut starts {
        total += *start;
        *start = total;
    }
    let mut edges = vec![0_u32; num_corners];
    for corner in (0..num_corners).rev() {
        let start = &mut starts[low(corner)];
        *start -= 1;
        edges[*start as usize] = corner as u32;
    }

    // Within a bucket (about three edges) bring edges with the same upper end together.
    for bucket in starts.windows(2) {
        let bucket = &mut edges[bucket[0] as usize..bucket[1] as usize];
        bucket.sort_unstable_by_key(|&corner| (high(corner as usize), corner));
        for same in bucket.chunk_by(|&a, &b| high(a as usize) == high(b as usize)) {
            visit(same);
        }
    }
}

/// Next corner round the triangle of a corner.
pub fn next_corner(corner: usize) -> usize {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

/// Join the groups of two corners, or triangles (union-find); the root of a group is its lowest member.
pub fn join(parents: &mut [u32], a: usize, b: usize) {
    let (a, b) = (root(parents, a), root(parents, b));
    parents[a.max(b)] = a.min(b) as u32;
}

/// Lowest member of a group. Halves the path to it (union-find).
pub fn root(parents: &mut [u32], mut corner: usize) -> usize {
    while parents[corner] as usize != corner {
        parents[corner] = parents[parents[corner] as usize];
        corner = parents[corner] as usize;
    }
    corner
}
