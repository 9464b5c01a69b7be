//! Exact intersection of a ray with a triangle, in double precision and without gaps between neighbours.

use glam::DVec3;

/// Half-line of a search: points `origin + t direction` with `t > start`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin [m].
    pub origin: DVec3,
    /// Direction; `t` counts in lengths of it.
    pub direction: DVec3,
    /// Largest `t` at which there are no hits yet.
    pub start: f64,
}

/// Ray prepared for watertight tests: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013.
///
/// The edge functions of two triangles at a common edge come from the same products and differ in sign only,
/// so no ray passes between them. That needs products rounded one by one: no fused multiply-add.
pub struct WatertightTest {
    ray: Ray,
    axes: [usize; 3],
    shear: DVec3,
}

impl WatertightTest {
    /// Prepare a ray.
    pub fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let z = if d.x.abs() >= d.y.abs().max(d.z.abs()) {
            0
        } else if d.y.abs() >= d.z.abs() {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        Self {
            ray: *ray,
            axes: [x, y, z],
            shear: DVec3::new(d[x] / d[z], d[y] / d[z], 1.0 / d[z]),
        }
    }

    /// Intersection of the ray with a triangle beyond the ray's start; edges belong to the triangle.
    pub fn intersect(&self, triangle: &[DVec3; 3]) -> Option<Crossing> {
        let sheared = self.sheared(triangle);
        let [u, v, w] = sheared.sides();
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let sum = u + v + w;
        if sum == 0.0 {
            return None; // the ray lies in the triangle's plane
        }
        let crossing = if sheared.is_edge_on(sum) {
            sheared.first_edge(self.ray.start)?
        } else {
            // The distance to the plane, from the normal: the interpolated one is less exact on needles.
            let [a, b, c] = *triangle;
            let normal = (b - a).cross(c - a);
            Crossing {
                distance: normal.dot(a - self.ray.origin) / normal.dot(self.ray.direction),
                barycentric: [u / sum, v / sum, w / sum],
                is_edge_on: false,
            }
        };
        (crossing.distance > self.ray.start && crossing.distance.is_finite()).then_some(crossing)
    }

    /// Triangle in the axes of the ray.
    fn sheared(&self, triangle: &[DVec3; 3]) -> ShearedTriangle {
        let [x, y, z] = self.axes;
        let corners = triangle.map(|v| {
            let v = v - self.ray.origin;
            let (across, down) = (v[x] - self.shear.x * v[z], v[y] - self.shear.y * v[z]);
            DVec3::new(across, down, self.shear.z * v[z])
        });
        let max_coordinate = triangle.iter().fold(0.0, |largest: f64, v| {
            largest.max((v - self.ray.origin).abs().max_element())
        });
        ShearedTriangle {
            corners,
            max_coordinate,
        }
    }
}

/// Intersection of a ray with a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Parameter along the ray.
    pub distance: f64,
    /// Barycentric weights of the corners; their sum is one.
    pub barycentric: [f64; 3],
    /// True if the ray lies in the triangle's plane, to rounding: then it meets an edge.
    pub is_edge_on: bool,
}

/// Triangle in the axes of a ray, which passes (0, 0) along the third axis; the third coordinate is its parameter.
struct ShearedTriangle {
    corners: [DVec3; 3],
    /// Largest coordinate relative to the ray's origin.
    max_coordinate: f64,
}

impl ShearedTriangle {
    /// Edge functions: twice the signed areas between the ray's point and each edge.
    fn sides(&self) -> [f64; 3] {
        let [a, b, c] = self.corners;
        [c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x]
    }

    /// True if the edge functions, whose sum is `sum`, are no more than rounding.
    fn is_edge_on(&self, sum: f64) -> bool {
        let width = |v: &DVec3| v.x.abs().max(v.y.abs());
        let widest = self.corners.iter().map(width).fold(0.0, f64::max);
        sum.abs() <= 64.0 * f64::EPSILON * widest * self.max_coordinate
    }

    /// First intersection with an edge beyond the ray's start, for a triangle seen edge-on.
    fn first_edge(&self, start: f64) -> Option<Crossing> {
        let spread = |axis: usize| {
            let all = self.corners.map(|v| v[axis]);
            all.into_iter().fold(f64::NEG_INFINITY, f64::max) - all.into_iter().fold(f64::INFINITY, f64::min)
        };
        let axis = usize::from(spread(1) > spread(0));
        let mut first: Option<Crossing> = None;
        for i in 0..3 {
            let j = (i + 1) % 3;
            let (p, q) = (self.corners[i], self.corners[j]);
            let share = p[axis] / (p[axis] - q[axis]);
            if !(0.0..=1.0).contains(&share) {
                continue;
            }
            let distance = p.z + share * (q.z - p.z);
            if distance > start && first.is_none_or(|first| distance < first.distance) {
                let mut barycentric = [0.0; 3];
                (barycentric[i], barycentric[j]) = (1.0 - share, share);
                first = Some(Crossing {
                    distance,
                    barycentric,
                    is_edge_on: true,
                });
            }
        }
        first
    }
}
