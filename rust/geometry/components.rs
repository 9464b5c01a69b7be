//! Connected components of a mesh.

use glam::DVec3;

use crate::geometry::aabb::Bounds;
use crate::geometry::topology::{distinct_positions, join, root};

/// Largest number of components that are distinguished; of more only the largest are.
const MOST: usize = 10_000;

/// Connected components of the triangles of a mesh.
#[derive(Debug)]
pub struct Components {
    /// Component number of every triangle; empty if there is one component.
    part: Vec<u32>,
    /// Number of components.
    number: usize,
}

impl Components {
    /// Find components: triangles that share a vertex, or have vertices at one position, belong together.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let places = distinct_positions(vertices);
        let mut parents: Vec<u32> = (0..places.len() as u32).collect();
        let place = |vertex: u32| places[vertex as usize] as usize;
        for [a, b, c] in triangles {
            join(&mut parents, place(*a), place(*b));
            join(&mut parents, place(*a), place(*c));
        }
        let mut numbers = vec![u32::MAX; parents.len()];
        let mut number = 0;
        let mut part = Vec::with_capacity(triangles.len());
        for [a, ..] in triangles {
            let root = root(&mut parents, place(*a));
            if numbers[root] == u32::MAX {
                numbers[root] = number;
                number += 1;
            }
            part.push(numbers[root]);
        }
        if number <= 1 {
            part = Vec::new();
        }
        Self {
            part,
            number: number as usize,
        }
    }

    /// Boxes of the components, at most ten thousand, from the corners of their triangles.
    pub fn bounds(&self, whole: Bounds, corners: impl Fn(usize) -> [DVec3; 3]) -> Vec<Bounds> {
        if self.number <= 1 {
            return vec![whole; self.number];
        }
        let mut bounds = vec![Bounds::EMPTY; self.number];
        for (triangle, part) in self.part.iter().enumerate() {
            let bounds = &mut bounds[*part as usize];
            *bounds = bounds.union(&Bounds::of_triangle(&corners(triangle)));
        }
        if bounds.len() > MOST {
            let size = |bounds: &Bounds| (bounds.max - bounds.min).length_squared();
            bounds.sort_by(|a, b| size(b).total_cmp(&size(a)));
            bounds.truncate(MOST);
        }
        bounds
    }

    /// Memory [bytes].
    pub fn memory(&self) -> usize {
        size_of_val(self.part.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_what_touches() {
        // Two triangles with an edge of separate vertices, and a distant one.
        let vertices: Vec<DVec3> = [[0, 0], [1, 0], [0, 1], [1, 0], [1, 1], [0, 1], [5, 5], [6, 5], [5, 7]]
            .map(|[x, y]| DVec3::new(f64::from(x), f64::from(y), 2.0))
            .to_vec();
        let triangles = [[0, 1, 2], [3, 4, 5], [6, 7, 8]];
        let parts = Components::new(&vertices, &triangles);
        let corners = |t: usize| triangles[t].map(|vertex: u32| vertices[vertex as usize]);
        let whole = Bounds::of(vertices.iter().copied());
        let bounds = parts.bounds(whole, corners);
        assert_eq!(bounds.len(), 2);
        assert_eq!(bounds[0].max, DVec3::new(1.0, 1.0, 2.0));
        assert_eq!(bounds[1].min, DVec3::new(5.0, 5.0, 2.0));
        let one = Components::new(&vertices, &triangles[..2]);
        assert_eq!(one.memory(), 0);
        assert_eq!(one.bounds(bounds[0], corners).len(), 1);
        assert!(
            Components::new(&vertices, &[])
                .bounds(Bounds::EMPTY, corners)
                .is_empty()
        );
    }
}
