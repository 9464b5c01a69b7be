//! Creases of triangle meshes: edges at which triangles meet at large angles.

use glam::DVec3;

use crate::geometry::topology::{distinct_positions, for_edges};

/// Distance below which vertices are one [m].
const SAME_PLACE: f64 = 1e-6;

/// Largest cosine between the planes of two triangles at a crease, to either side of a right angle.
const MOST_COSINE: f64 = 0.5;

/// Number of triangles at one edge from which on it counts as a crease, whatever their planes.
const MANY: usize = 8;

/// Triangles that meet another at an edge at 60 to 120 degrees, in ascending order. They have an area.
pub fn triangles_at_creases(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<u32> {
    let places: Vec<DVec3> = vertices.iter().map(|vertex| (*vertex / SAME_PLACE).round()).collect();
    let positions = distinct_positions(&places);
    let position = |corner: usize| positions[triangles[corner / 3][corner % 3] as usize];
    let normal = |triangle: usize| {
        let [a, b, c] = triangles[triangle].map(|vertex| vertices[vertex as usize]);
        (b - a).cross(c - a)
    };
    let mut is_found = vec![false; triangles.len()];
    for_edges(triangles.len(), position, |edge| {
        let sides = edge.iter().map(|corner| *corner as usize / 3);
        if edge.len() >= MANY {
            sides.for_each(|triangle| is_found[triangle] = true);
            return;
        }
        for (rank, one) in sides.clone().enumerate() {
            for other in sides.clone().skip(rank + 1) {
                let (n1, n2) = (normal(one), normal(other));
                let most = MOST_COSINE * n1.length() * n2.length();
                if n1.dot(n2).abs() <= most {
                    is_found[one] = true;
                    is_found[other] = true;
                }
            }
        }
    });
    let found = is_found.iter().enumerate().filter(|(_, is_found)| **is_found);
    found.map(|(triangle, _)| triangle as u32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles of different size on either side of an edge, with vertices of their own.
    fn hinge(angle: f64) -> [DVec3; 6] {
        let (start, end) = (DVec3::ZERO, DVec3::Z);
        let leaf = 2.0 * DVec3::new(angle.cos(), angle.sin(), 0.3);
        [start, end, DVec3::X, end, start, leaf]
    }

    #[test]
    fn hinges_count_from_60_to_120_degrees() {
        for (degrees, count) in [
            (5.0, 0),
            (59.0, 0),
            (61.0, 2),
            (90.0, 2),
            (119.0, 2),
            (121.0, 0),
            (180.0, 0_usize),
        ] {
            let found = triangles_at_creases(&hinge(f64::to_radians(degrees)), &[[0, 1, 2], [3, 4, 5]]);
            assert_eq!(found.len(), count, "{degrees}");
        }
    }

    #[test]
    fn walls_of_many_triangles_are_told_from_their_floor() {
        // Eight triangles in one plane and one across it, all at one edge.
        let mut vertices = vec![DVec3::ZERO, DVec3::Z, DVec3::Y];
        vertices.extend((0..8).map(|i| DVec3::new(1.0 + f64::from(i), 0.0, 0.5)));
        let triangles: Vec<[u32; 3]> = (2..11).map(|vertex| [0, 1, vertex]).collect();
        assert_eq!(triangles_at_creases(&vertices, &triangles).len(), 9);
        // A single one further off meets none.
        vertices.extend([DVec3::splat(5.0), DVec3::splat(6.0), DVec3::new(5.0, 6.0, 7.0)]);
        let all: Vec<[u32; 3]> = triangles.iter().copied().chain([[11, 12, 13]]).collect();
        assert_eq!(triangles_at_creases(&vertices, &all), (0..9).collect::<Vec<u32>>());
    }
}
