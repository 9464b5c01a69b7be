//! The slow truth: every ray against every triangle, in f64, by the sides on which the ray passes the three edges.
//!
//! Edges and rays are lines in Plücker coordinates; their reciprocal product is the distance between them times the sine of
//! the angle between them. An answer has to pass two tests, both with a margin for rounding, so that no answer is
//! refused because the truth itself is rounded: does the ray meet the triangle that it is said to hit, there? And is there
//! no triangle, met clearly inside its edges, that is clearly nearer?

use std::sync::Arc;

use crate::rays::scene::{Hit, NO_BODY};
use crate::rays::tree::Ray;
use crate::{Pose, Surface};
use glam::DVec3;
use rayon::prelude::*;

/// Relative error of a distance that is not forgiven.
pub const TOLERANCE: f64 = 1e-9;

/// Rounding of coordinates, poses and products, relative to the largest coordinate: some 5000 roundings.
const MARGIN: f64 = 1e-12;

/// Rays that are compared with a triangle at once.
const BLOCK: usize = 64;

/// Hit of a ray, as the search under test says.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    pub distance: f64,
    pub body: u32,
    pub triangle: u32,
}

impl From<Hit> for Answer {
    fn from(hit: Hit) -> Self {
        Self {
            distance: hit.distance,
            body: hit.body,
            triangle: hit.triangle,
        }
    }
}

impl Answer {
    pub const MISS: Self = Self {
        distance: f64::INFINITY,
        body: NO_BODY,
        triangle: u32::MAX,
    };

    pub fn is_hit(&self) -> bool {
        self.body != NO_BODY
    }
}

/// A triangle of the sensor frame.
struct Facet {
    corners: [DVec3; 3],
    /// Unit vectors along the edges, and moments of the edges.
    edges: [DVec3; 3],
    moments: [DVec3; 3],
    /// Unit normal.
    normal: DVec3,
    /// Distance of the plane from the origin, along the normal.
    offset: f64,
    /// Error of positions [m].
    margin: f64,
    /// Error of the plane at the triangle [m].
    slack: f64,
    /// Rays at a smaller cosine of the angle of incidence are not clear.
    least_cosine: f64,
}

impl Facet {
    /// `reach`: the largest coordinate that had a part in the corners, or has in the rays.
    fn new(corners: [DVec3; 3], reach: f64) -> Self {
        let [a, b, c] = corners;
        let sides = [b - a, c - b, a - c];
        let edges = sides.map(DVec3::normalize);
        let normal = (b - a).cross(c - a).normalize();
        let longest = sides.iter().fold(0.0, |longest: f64, side| longest.max(side.length()));
        let height = (b - a).cross(c - a).length() / longest;
        Self {
            corners,
            edges,
            moments: [a.cross(edges[0]), b.cross(edges[1]), c.cross(edges[2])],
            normal,
            offset: normal.dot(a),
            margin: MARGIN * reach,
            // The normal of a needle tilts by the rounding of a product of two long edges.
            slack: MARGIN * reach + 16.0 * f64::EPSILON * longest * longest / height,
            least_cosine: 1e-6 + 1e3 * f64::EPSILON * reach / height,
        }
    }

    /// On which sides of the edges a ray passes, with its moment `origin x direction` [m].
    fn sides(&self, direction: DVec3, moment: DVec3) -> [f64; 3] {
        [0, 1, 2].map(|k| direction.dot(self.moments[k]) + moment.dot(self.edges[k]))
    }

    /// Distance of a point from the triangle.
    fn distance(&self, point: DVec3) -> f64 {
        let from = self.corners.map(|corner| point - corner);
        let turns = [0, 1, 2].map(|k| self.edges[k].cross(from[k]).dot(self.normal));
        let is_above = turns.iter().all(|turn| *turn >= 0.0);
        let to_edge = |k: usize| {
            let length = (self.corners[(k + 1) % 3] - self.corners[k]).length();
            (from[k] - from[k].dot(self.edges[k]).clamp(0.0, length) * self.edges[k]).length()
        };
        let nearest = (0..3).map(to_edge).fold(f64::INFINITY, f64::min);
        if is_above {
            nearest.min(from[0].dot(self.normal).abs())
        } else {
            nearest
        }
    }

    /// Fails unless a ray of unit direction meets the triangle at this distance.
    fn is_met(&self, ray: &Ray, distance: f64) -> Result<(), String> {
        if distance <= ray.start {
            return Err("before the start".to_owned());
        }
        let sides = self.sides(ray.direction, ray.origin.cross(ray.direction));
        let (least, most) = extremes(sides);
        if least < -self.margin && most > self.margin {
            return Err(format!("beside the triangle, which the ray passes at {sides:?} m"));
        }
        let cosine = self.normal.dot(ray.direction);
        let off = self.distance(ray.origin + distance * ray.direction);
        if off > TOLERANCE * distance + self.slack {
            return Err(format!(
                "the point of the hit is {off:e} m off the triangle (cosine of incidence {cosine:e})"
            ));
        }
        let exact = (self.offset - self.normal.dot(ray.origin)) / cosine;
        let error = (distance - exact).abs();
        if error > TOLERANCE * distance + self.slack / cosine.abs() {
            return Err(format!("expected {exact}, off by {error:e} m, cosine {cosine:e}"));
        }
        Ok(())
    }
}

/// A scene as a list of triangles.
pub struct Exhaustive {
    facets: Vec<Facet>,
    /// Number of the first facet of every body.
    first: Vec<usize>,
}

impl Exhaustive {
    /// Of surfaces at their poses, for rays from origins with coordinates up to `origins`.
    pub fn new(bodies: &[(Arc<Surface>, Pose)], origins: f64) -> Self {
        let (mut facets, mut first) = (Vec::new(), Vec::new());
        for (surface, pose) in bodies {
            first.push(facets.len());
            let body: Vec<[DVec3; 3]> = (0..surface.num_triangles() as u32)
                .map(|triangle| surface.corners(triangle))
                .collect();
            let sensor: Vec<[DVec3; 3]> = body.iter().map(|t| t.map(|v| pose.point(v))).collect();
            let largest = |t: &[DVec3; 3]| t.iter().fold(0.0, |most: f64, v| most.max(v.abs().max_element()));
            let reach = body.iter().chain(&sensor).map(largest).fold(origins, f64::max);
            let reach = reach.max(pose.translation.abs().max_element());
            facets.extend(sensor.into_iter().map(|corners| Facet::new(corners, reach)));
        }
        Self { facets, first }
    }

    /// For every ray of unit direction the distance before which it clearly meets something; infinite if it does not.
    pub fn farthest(&self, rays: &[Ray]) -> Vec<f64> {
        rays.par_chunks(BLOCK)
            .flat_map_iter(|rays| self.farthest_of_block(rays).into_iter().take(rays.len()))
            .collect()
    }

    /// The rays side by side and without branches, so that the compiler vectorises the loop over them.
    #[allow(clippy::needless_bitwise_bool)] // see above
    fn farthest_of_block(&self, rays: &[Ray]) -> [f64; BLOCK] {
        let mut lines = [[0.0; BLOCK]; 10];
        for (i, ray) in rays.iter().enumerate() {
            let moment = ray.origin.cross(ray.direction);
            for axis in 0..3 {
                lines[axis][i] = ray.direction[axis];
                lines[3 + axis][i] = moment[axis];
                lines[6 + axis][i] = ray.origin[axis];
            }
            lines[9][i] = ray.start;
        }
        let [dx, dy, dz, mx, my, mz, ox, oy, oz, start] = &lines;
        let mut farthest = [f64::INFINITY; BLOCK];
        for facet in &self.facets {
            let (e, m, n) = (&facet.edges, &facet.moments, facet.normal);
            for i in 0..BLOCK {
                let side = |k: usize| {
                    (dx[i] * m[k].x + dy[i] * m[k].y + dz[i] * m[k].z)
                        + (mx[i] * e[k].x + my[i] * e[k].y + mz[i] * e[k].z)
                };
                let (least, most) = extremes([side(0), side(1), side(2)]);
                let cosine = dx[i] * n.x + dy[i] * n.y + dz[i] * n.z;
                let inverse = 1.0 / cosine;
                let distance = (facet.offset - (ox[i] * n.x + oy[i] * n.y + oz[i] * n.z)) * inverse;
                let error = TOLERANCE * distance.abs() + facet.slack * inverse.abs();
                let is_clear = ((least >= facet.margin) | (most <= -facet.margin))
                    & (cosine.abs() >= facet.least_cosine)
                    & (distance - error > start[i]);
                let far = if is_clear { distance + error } else { f64::INFINITY };
                farthest[i] = if far < farthest[i] { far } else { farthest[i] };
            }
        }
        farthest
    }

    /// Fails unless a ray meets the triangle of its answer, there. A miss is none of this function's business.
    pub fn is_met(&self, ray: &Ray, answer: &Answer) -> Result<(), String> {
        if !answer.is_hit() {
            return if answer.distance == f64::INFINITY {
                Ok(())
            } else {
                Err(format!("a miss has a distance: {answer:?}"))
            };
        }
        let facet = &self.facets[self.first[answer.body as usize] + answer.triangle as usize];
        facet
            .is_met(ray, answer.distance)
            .map_err(|reason| format!("{answer:?}: {reason}; {ray:?} {:?}", facet.corners))
    }

    /// Fails unless [`Self::is_met`] holds and nothing nearer was missed: `farthest` is the ray's own of [`Self::farthest`].
    pub fn is_right(&self, ray: &Ray, farthest: f64, answer: &Answer) -> Result<(), String> {
        if answer.distance > farthest {
            return Err(format!("{answer:?}: nearer than {farthest} there is another; {ray:?}"));
        }
        self.is_met(ray, answer)
    }
}

/// Smallest and largest of three numbers.
fn extremes([a, b, c]: [f64; 3]) -> (f64, f64) {
    // As `min` and `max` of the processor do it: without care for NaN.
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    (if c < low { c } else { low }, if c > high { c } else { high })
}
