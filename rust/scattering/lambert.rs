//! Diffuse scattering: random points on the surface of a body, each with a random phase.
//!
//! SurfacePoints are stratified by area and stand for equal parts of it, so that the expected power of a surface is
//! independent of the number of points and of the rays (docs/theory.md eq. (3)); phases are uniform and independent, so
//! the intensity of many points is exponentially distributed. Every frame has the same points.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::geometry::triangle::area;
use crate::numeric::random::mix;
use crate::rays::camera::morton;
use crate::rays::hits::Counts;
use crate::rays::surface::Surface;
use crate::rays::visibility::Target;
use crate::scattering::sector::Sector;

/// Least and largest number of points of a body.
const NUMBERS: (f64, f64) = (1024.0, 131_072.0);

/// Cross-section of a point of a white surface that faces the sensor, relative to the smallest of interest.
const POINT_RCS: f64 = 10.0;

/// Smallest cross-section of interest [m^2] of points at most: speckle takes many points per cell of range and velocity.
const FLOOR: f64 = 1e-5;

/// Refinement of the base grid that rays are sorted by.
const SUBDIVISION: f64 = 256.0;

/// Random points on a surface.
#[derive(Debug)]
pub struct SurfacePoints {
    /// Number of the triangle of every point.
    pub triangle: Vec<u32>,
    /// Barycentric coordinates in the triangle.
    pub barycentric: Vec<[f64; 3]>,
    /// Phase in turns.
    pub turns: Vec<f64>,
    /// Area per point [m^2].
    pub area: f64,
    /// Hash of the surface, floor and seed that the points were drawn from.
    source: (u64, u64, u64),
}

/// Random points of a body and their visibility.
pub struct Speckle {
    /// Random points of the surface.
    pub points: Arc<SurfacePoints>,
    /// Unit normal of the surface at every point towards the incident side, in the sensor frame; zero where occluded.
    pub normal: Vec<DVec3>,
}

impl SurfacePoints {
    /// Random points of a surface, in a number within [`NUMBERS`] for which no single point matters; `rcs_floor` [m^2].
    /// The seed belongs to the body.
    pub fn new(surface: &Surface, rcs_floor: f64, seed: u64) -> Self {
        let number_of_triangles = surface.num_triangles() as u32;
        let mut sums = Vec::with_capacity(number_of_triangles as usize);
        let mut total = 0.0;
        for triangle in 0..number_of_triangles {
            total += area(&surface.rest_corners(triangle));
            sums.push(total);
        }
        let wanted = (4.0 * total / (POINT_RCS * rcs_floor)).ceil();
        let number = if total > 0.0 {
            wanted.clamp(NUMBERS.0, NUMBERS.1) as usize
        } else {
            0
        };

        let mut points = Self {
            triangle: Vec::with_capacity(number),
            barycentric: Vec::with_capacity(number),
            turns: Vec::with_capacity(number),
            area: total / number as f64,
            source: source(surface, rcs_floor, seed),
        };
        let mut triangle = 0;
        let mut state = mix(seed);
        let mut draw = || {
            state = mix(state);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for point in 0..number {
            // One in every stretch of equal area.
            let place = (point as f64 + draw()) / number as f64 * total;
            while sums[triangle] < place && triangle + 1 < sums.len() {
                triangle += 1;
            }
            let (root, along) = (draw().sqrt(), draw());
            points.triangle.push(triangle as u32);
            points
                .barycentric
                .push([1.0 - root, root * (1.0 - along), root * along]);
            points.turns.push(draw());
        }
        points
    }

    /// Position of a point in body coordinates [m].
    pub fn position(&self, surface: &Surface, point: usize) -> DVec3 {
        let corners = surface.corners(self.triangle[point]);
        let weights = self.barycentric[point];
        (0..3).map(|i| weights[i] * corners[i]).sum()
    }

    fn is_of(&self, surface: &Surface, rcs_floor: f64, seed: u64) -> bool {
        self.source == source(surface, rcs_floor, seed)
    }
}

/// Key of points: hash of the surface, bits of the floor, seed.
fn source(surface: &Surface, rcs_floor: f64, seed: u64) -> (u64, u64, u64) {
    (surface.content_hash(), rcs_floor.to_bits(), seed)
}

impl Speckle {
    /// SurfacePoints of a body and their visibility within a sector. `drawn`: points of the body from another sector or frame.
    pub fn new(sector: &Sector, body: u32, seed: u64, drawn: Option<&Arc<SurfacePoints>>) -> (Self, Counts) {
        let Sector {
            scene,
            cast,
            plane,
            refinement,
            ..
        } = sector;
        let surface = scene.surface(body);
        let floor = refinement.map_or(FLOOR, |refinement| refinement.rcs_floor.min(FLOOR));
        let seed = seed ^ scene.content_hash(body);
        let drawn = drawn.filter(|points| points.is_of(surface, floor, seed)).cloned();
        let points = drawn.unwrap_or_else(|| Arc::new(SurfacePoints::new(surface, floor, seed)));

        // Points within the image, near ones after each other: near points have near keys.
        let target = |point: usize| {
            let position = scene.pose(body).point(points.position(surface, point));
            let target = Target {
                point: [position.y / position.x, position.z / position.x],
                depth: position.x,
                triangle: points.triangle[point],
            };
            let (row, column) = plane.pixel(target.point);
            let (rows, columns) = (plane.rows as f64, plane.columns as f64);
            let is_inside = position.x > 0.0 && (0.0..rows).contains(&row) && (0.0..columns).contains(&column);
            let key = morton((SUBDIVISION * row) as u32, (SUBDIVISION * column) as u32);
            is_inside.then_some((key, point, target))
        };
        let mut targets: Vec<(u64, usize, Target)> =
            (0..points.turns.len()).into_par_iter().filter_map(target).collect();
        targets.par_sort_unstable_by_key(|(key, point, _)| (*key, *point));

        let (order, targets): (Vec<usize>, Vec<Target>) = targets.into_iter().map(|(_, i, target)| (i, target)).unzip();
        let (normals, counts) = scene.visible_normals(body, &targets, cast);
        let mut normal = vec![DVec3::ZERO; points.turns.len()];
        for (point, visible) in order.into_iter().zip(normals) {
            normal[point] = visible;
        }
        (Self { points, normal }, counts)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::cancel::Cancel;
    use crate::rays::surface::ShadingMode;

    /// Two squares in one plane, one of nine times the other's area.
    fn squares() -> Surface {
        let square = |x: f64, side: f64| {
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[u, v]| DVec3::new(x + side * u, side * v, 0.0))
        };
        let vertices: Vec<DVec3> = square(0.0, 0.1).into_iter().chain(square(1.0, 0.3)).collect();
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        Surface::new(&vertices, &triangles, ShadingMode::Flat, &Cancel::default()).unwrap()
    }

    #[test]
    fn points_are_spread_by_area_and_stay_where_they_are() {
        let surface = squares();
        let points = SurfacePoints::new(&surface, 1e-6, 3);
        let number = points.turns.len();
        assert!((40_000..40_002).contains(&number)); // 4 x 0.1 m^2 / (10 x 1e-6 m^2)
        assert!((points.area * number as f64 - 0.1).abs() < 1e-12);
        let on_small = points.triangle.iter().filter(|triangle| **triangle < 2).count();
        assert!(on_small.abs_diff(number / 10) <= 2, "{on_small}");

        // Even within a triangle: the mean of the large square is its middle, to four sigma.
        let large = (0..number).filter(|point| points.triangle[*point] >= 2);
        let mean: DVec3 = large.map(|point| points.position(&surface, point)).sum::<DVec3>() / (0.9 * number as f64);
        let sigma = 0.3 / 12.0_f64.sqrt() / (0.9 * number as f64).sqrt();
        assert!((mean - DVec3::new(1.15, 0.15, 0.0)).length() < 4.0 * sigma, "{mean}");

        let again = SurfacePoints::new(&surface, 1e-6, 3);
        assert_eq!((&again.turns, &again.barycentric), (&points.turns, &points.barycentric));
        assert_ne!(SurfacePoints::new(&surface, 1e-6, 4).turns, points.turns);
    }

    #[test]
    fn phases_are_uniform_and_independent() {
        let points = SurfacePoints::new(&squares(), 1e-6, 5);
        let phasors: Vec<(f64, f64)> = points.turns.iter().map(|t| (TAU * t).sin_cos()).collect();
        let number = phasors.len() as f64;
        let bound = 4.0 / number.sqrt();
        let (s, c) = phasors.iter().fold((0.0, 0.0), |(s, c), p| (s + p.0, c + p.1));
        assert!(s.hypot(c) / number < bound);
        let beside = phasors
            .windows(2)
            .map(|p| p[0].0 * p[1].0 + p[0].1 * p[1].1)
            .sum::<f64>();
        assert!(beside.abs() / number < bound);
    }
}
