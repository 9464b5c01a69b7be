//! Quality of a mesh: topology, and distance of its triangles from the curved surface that they approximate.

use std::collections::HashSet;

use glam::DVec3;

use crate::geometry::smooth_normals::Shading;
use crate::geometry::topology::{distinct_positions, for_edges, join, next_corner, root};
use crate::geometry::triangle::area;

/// Ratio of longest edge to height above which a triangle is thin.
const THIN: f64 = 100.0;

/// Quality of a mesh; see the module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quality {
    /// Number of groups of triangles that share edges.
    pub num_parts: usize,
    /// Number of edges of one triangle.
    pub num_open_edges: usize,
    /// Number of edges of more than two triangles.
    pub num_nonmanifold_edges: usize,
    /// Number of edges that both of two triangles traverse in the same direction.
    pub num_inconsistent_edges: usize,
    /// Number of triangles between the same positions as an earlier one.
    pub num_duplicates: usize,
    /// Number of triangles whose longest edge is more than a hundred times their height over it.
    pub num_thin: usize,
    /// Area of all triangles [m^2].
    pub area: f64,
    /// Area of the triangles that approximate a curved surface [m^2].
    pub smooth_area: f64,
    /// Largest distance of the curved surface from the middle of a triangle [m].
    pub largest_sagitta: f64,
    /// Mean distance of the curved surface from the middle of its triangles, weighted by area [m].
    pub mean_sagitta: f64,
}

impl Quality {
    /// Quality of a mesh whose triangles approximate a curved surface where they meet at less than `crease_angle`
    /// [rad]. Triangles index into `vertices` and have an area.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]], crease_angle: f64) -> Self {
        let shading = Shading::smooth(vertices, triangles, crease_angle);
        let corners = |triangle: usize| triangles[triangle].map(|vertex| vertices[vertex as usize]);
        let mut quality = Self::default();
        quality.count_edges(vertices, triangles);
        quality.num_thin = (0..triangles.len())
            .filter(|triangle| is_thin(corners(*triangle)))
            .count();
        quality.measure(triangles.len(), corners, &shading);
        quality
    }

    /// Count edges and components; vertices at equal positions count as one.
    fn count_edges(&mut self, vertices: &[DVec3], triangles: &[[u32; 3]]) {
        let positions = distinct_positions(vertices);
        let position = |corner: usize| positions[triangles[corner / 3][corner % 3] as usize];
        let mut parents: Vec<u32> = (0..triangles.len() as u32).collect();
        for_edges(triangles.len(), position, |edge| {
            match *edge {
                [_] => self.num_open_edges += 1,
                [first, second] => {
                    let is_opposite = position(first as usize) == position(next_corner(second as usize));
                    self.num_inconsistent_edges += usize::from(!is_opposite);
                }
                _ => self.num_nonmanifold_edges += 1,
            }
            for pair in edge.windows(2) {
                join(&mut parents, pair[0] as usize / 3, pair[1] as usize / 3);
            }
        });
        let triangles_of = 0..triangles.len();
        self.num_parts = triangles_of
            .clone()
            .filter(|triangle| root(&mut parents, *triangle) == *triangle)
            .count();

        let mut seen = HashSet::new();
        for triangle in triangles_of {
            let mut places = [0, 1, 2].map(|i| position(3 * triangle + i));
            places.sort_unstable();
            self.num_duplicates += usize::from(!seen.insert(places));
        }
    }

    /// Measure areas, and distances of the curved surface.
    fn measure(&mut self, number: usize, corners: impl Fn(usize) -> [DVec3; 3], shading: &Shading) {
        let mut sum = 0.0;
        for triangle in 0..number {
            let corners = corners(triangle);
            let area = area(&corners);
            self.area += area;
            if let Some(normals) = shading.corner_normals(triangle) {
                let sagitta = sagitta(corners, normals);
                self.smooth_area += area;
                sum += area * sagitta;
                self.largest_sagitta = self.largest_sagitta.max(sagitta);
            }
        }
        if self.smooth_area > 0.0 {
            self.mean_sagitta = sum / self.smooth_area;
        }
    }
}

/// Distance of the curved surface from the middle of a triangle [m], as in
/// [`crate::geometry::curved_triangle::shade`].
fn sagitta(corners: [DVec3; 3], normals: [DVec3; 3]) -> f64 {
    let middle = corners.into_iter().sum::<DVec3>() / 3.0;
    let heights = (0..3).map(|i| (corners[i] - middle).dot(normals[i]));
    0.5 * (heights.sum::<f64>() / 3.0).abs()
}

fn is_thin([a, b, c]: [DVec3; 3]) -> bool {
    let longest = (b - a)
        .length_squared()
        .max((c - b).length_squared())
        .max((a - c).length_squared());
    // Height over the longest edge: twice the area over it.
    longest > THIN * 2.0 * area(&[a, b, c])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_4;

    use super::*;
    use crate::geometry::smooth_normals::tests::icosphere;

    #[test]
    fn sagitta_of_a_sphere_is_what_its_facets_lack_in_radius() {
        for level in 2..5 {
            let (vertices, triangles) = icosphere(level);
            let vertices: Vec<DVec3> = vertices.into_iter().map(|v| 0.1 * v).collect();
            let quality = Quality::new(&vertices, &triangles, FRAC_PI_4);
            let facets = triangles
                .iter()
                .map(|triangle| triangle.map(|vertex| vertices[vertex as usize]));
            let lacking = |facet: [DVec3; 3]| 0.1 - (facet.into_iter().sum::<DVec3>() / 3.0).length();
            let mean = facets.map(|facet| area(&facet) * lacking(facet)).sum::<f64>() / quality.area;
            assert!((quality.mean_sagitta / mean - 1.0).abs() < 0.01, "{level} {quality:?}");
            assert!((1.0..1.3).contains(&(quality.largest_sagitta / mean)));
            let closed = (
                quality.num_parts,
                quality.num_open_edges,
                quality.num_inconsistent_edges,
            );
            assert_eq!(closed, (1, 0, 0));
            assert!((quality.smooth_area - quality.area).abs() < 1e-12);
        }
    }
}
