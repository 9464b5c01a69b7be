//! Quality of a mesh: topology, distance of its triangles from the curved surface that they approximate, and error of
//! the radar echo that follows.

use std::collections::HashSet;
use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::geometry::echo;
use crate::geometry::smooth_normals::Shading;
use crate::geometry::topology::{distinct_positions, for_edges, join, next_corner, root};

/// Ratio of longest edge to height above which a triangle is thin.
const THIN: f64 = 100.0;

/// Number of triangles whose echoes are summed together: the order of sums does not depend on threads.
const BLOCK: usize = 1024;

/// Number of directions in which echoes are compared.
const NUM_DIRECTIONS: usize = 64;

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
    /// Largest difference of the far-field echoes of flat triangles and of curved surfaces, in 64 directions and
    /// without occlusion, relative to the rms of these echoes.
    pub largest_difference: f64,
    /// Root mean square of the difference of echoes, relative to the same rms.
    pub rms_difference: f64,
}

impl Quality {
    /// Quality of a mesh whose triangles approximate a curved surface where they meet at less than `crease_angle`
    /// [rad], with echoes at a wavelength [m]. Triangles index into `vertices` and have an area.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]], crease_angle: f64, wavelength: f64) -> Self {
        let shading = Shading::smooth(vertices, triangles, crease_angle);
        let corners = |triangle: usize| triangles[triangle].map(|vertex| vertices[vertex as usize]);
        let mut quality = Self::default();
        quality.count_edges(vertices, triangles);
        quality.num_thin = (0..triangles.len())
            .filter(|triangle| is_thin(corners(*triangle)))
            .count();
        quality.measure(triangles.len(), corners, &shading);
        if quality.smooth_area > 0.0 {
            quality.compare(
                triangles.len(),
                corners,
                &shading,
                wavelength,
                &echo::directions(NUM_DIRECTIONS),
            );
        }
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
            let area = area(corners);
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

    /// Compare the echoes of flat triangles with those of the curved surface.
    fn compare(
        &mut self,
        number: usize,
        corners: impl Fn(usize) -> [DVec3; 3] + Sync,
        shading: &Shading,
        wavelength: f64,
        directions: &[DVec3],
    ) {
        // From the middle of the mesh, so that phases are small.
        let middle = (0..number)
            .map(|i| corners(i).into_iter().sum::<DVec3>())
            .sum::<DVec3>()
            / (3 * number) as f64;
        let wavenumber = TAU / wavelength;
        // Echo of the surface, and difference of that of the triangles, per direction.
        let of_block = |block: usize| {
            let mut sums = vec![[Complex64::ZERO; 2]; directions.len()];
            for triangle in block * BLOCK..((block + 1) * BLOCK).min(number) {
                let facet = corners(triangle).map(|corner| corner - middle);
                let pieces = shading
                    .corner_normals(triangle)
                    .map(|normals| echo::cut(facet, normals, sagitta(facet, normals), wavelength));
                for (sum, direction) in sums.iter_mut().zip(directions) {
                    let flat = echo::of_facet(facet, *direction, wavenumber);
                    let of_piece = |piece: &[DVec3; 3]| echo::of_facet(*piece, *direction, wavenumber);
                    let smooth = pieces.as_ref().map_or(flat, |pieces| pieces.iter().map(of_piece).sum());
                    sum[0] += smooth;
                    sum[1] += flat - smooth;
                }
            }
            sums
        };
        let blocks: Vec<_> = (0..number.div_ceil(BLOCK)).into_par_iter().map(of_block).collect();
        let (mut echo, mut difference) = (0.0, 0.0);
        let mut largest = 0.0_f64;
        for i in 0..directions.len() {
            let [smooth, other] = [0, 1].map(|k| blocks.iter().map(|sums| sums[i][k]).sum::<Complex64>().norm_sqr());
            echo += smooth;
            difference += other;
            largest = largest.max(other);
        }
        if echo > 0.0 {
            self.rms_difference = (difference / echo).sqrt();
            self.largest_difference = (largest * directions.len() as f64 / echo).sqrt();
        }
    }
}

/// Distance of the curved surface from the middle of a triangle [m].
fn sagitta(corners: [DVec3; 3], normals: [DVec3; 3]) -> f64 {
    echo::raised(corners, normals, [1.0 / 3.0; 3]).1.abs()
}

fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

fn is_thin([a, b, c]: [DVec3; 3]) -> bool {
    let longest = (b - a)
        .length_squared()
        .max((c - b).length_squared())
        .max((a - c).length_squared());
    // Height over the longest edge: twice the area over it.
    longest > THIN * 2.0 * area([a, b, c])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::smooth_normals::tests::icosphere;

    const WAVELENGTH: f64 = 4.996_540_966_667e-3;
    const CREASE: f64 = std::f64::consts::FRAC_PI_4;

    fn sphere(level: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let (vertices, triangles) = icosphere(level);
        (vertices.into_iter().map(|v| 0.1 * v).collect(), triangles)
    }

    #[test]
    fn cut_sphere_has_the_cross_section_of_the_sphere_and_its_facets_have_not() {
        // Physical optics: sigma = pi a^2, that is a sum of lambda a / 2.
        let (vertices, triangles) = sphere(3);
        let shading = Shading::smooth(&vertices, &triangles, CREASE);
        let mut off = 0.0_f64;
        for direction in echo::directions(20) {
            let (mut smooth, mut flat) = (Complex64::ZERO, Complex64::ZERO);
            for (i, triangle) in triangles.iter().enumerate() {
                let facet = triangle.map(|vertex| vertices[vertex as usize]);
                let normals = shading.corner_normals(i).unwrap();
                flat += echo::of_facet(facet, direction, TAU / WAVELENGTH);
                for piece in echo::cut(facet, normals, sagitta(facet, normals), WAVELENGTH) {
                    smooth += echo::of_facet(piece, direction, TAU / WAVELENGTH);
                }
            }
            let expected = 0.5 * WAVELENGTH * 0.1;
            assert!(
                (smooth.norm() / expected - 1.0).abs() < 0.06,
                "{}",
                smooth.norm() / expected
            );
            off = off.max((flat.norm() / expected - 1.0).abs());
        }
        assert!(off > 0.3, "{off}");
    }

    #[test]
    fn sagitta_of_a_sphere_is_what_its_facets_lack_in_radius() {
        let mut last = f64::INFINITY;
        for level in 2..5 {
            let (vertices, triangles) = sphere(level);
            let quality = Quality::new(&vertices, &triangles, CREASE, WAVELENGTH);
            let facets = triangles
                .iter()
                .map(|triangle| triangle.map(|vertex| vertices[vertex as usize]));
            let lacking = |facet: [DVec3; 3]| 0.1 - (facet.into_iter().sum::<DVec3>() / 3.0).length();
            let mean = facets.map(|facet| area(facet) * lacking(facet)).sum::<f64>() / quality.area;
            assert!((quality.mean_sagitta / mean - 1.0).abs() < 0.01, "{level} {quality:?}");
            assert!((1.0..1.3).contains(&(quality.largest_sagitta / mean)));
            // Every halving of edges quarters it, and the echo differs the less.
            assert!(quality.rms_difference < 0.6 * last, "{level} {quality:?}");
            last = quality.rms_difference;
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
