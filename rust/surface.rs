//! The surface of one body: checked triangles, their tree and their shading; built once and shared.

use glam::DVec3;

use crate::bundle::{Bundle, Leaf, MOST_RAYS, Triangles, farthest};
use crate::bvh::{Bounds, Ray, Tree, WIDTH, WideTree};
use crate::error::{Error, Result};
use crate::hash::mix;
use crate::shading::Shading;
use crate::simd::Level;

/// Triangles below this area are dropped [m^2].
const MIN_AREA: f64 = 1e-18;

/// Coordinates above this are refused: squares of lengths must stay finite [m].
const LARGEST: f64 = 1e15;

/// How normals follow from triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShadingMode {
    /// Every facet is what it is.
    Flat,
    /// Facets that meet below the crease angle [rad] stand for a curved surface.
    Smooth {
        /// Largest angle between the normals of two facets of one curved surface [rad].
        crease_angle: f64,
    },
}

/// A mesh ready to be traced, in body coordinates.
pub struct Surface {
    triangles: Vec<[DVec3; 3]>,
    kept: Vec<u32>,
    tree: Tree,
    /// The same tree for bundles of rays.
    wide: WideTree,
    leaves: Vec<Leaf>,
    shading: Shading,
    bounds: Bounds,
    fingerprint: u64,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug)]
pub struct TriangleHit {
    /// Parameter along the ray.
    pub distance: f64,
    /// Number of the triangle in the surface.
    pub triangle: u32,
    /// Weights of the three corners, adding up to one.
    pub barycentric: [f64; 3],
}

impl Surface {
    /// Check a mesh, drop its degenerate triangles (area below 1e-18 m^2) and build its tree.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]], mode: ShadingMode) -> Result<Self> {
        if let Some(bad) = vertices.iter().position(|v| !v.is_finite()) {
            return Err(Error::value(
                "vertices",
                "finite coordinates [m]",
                format!("{} at row {bad}", vertices[bad]),
            ));
        }
        if let Some(bad) = vertices.iter().position(|v| v.abs().max_element() > LARGEST) {
            let got = format!("{} at row {bad}", vertices[bad]);
            return Err(Error::value(
                "vertices",
                format!("coordinates below {LARGEST:e} m"),
                got,
            ));
        }
        if let Some(bad) = triangles
            .iter()
            .position(|t| t.iter().any(|&i| i as usize >= vertices.len()))
        {
            let expected = format!("vertex numbers below {}", vertices.len());
            return Err(Error::value(
                "triangles",
                expected,
                format!("{:?} at row {bad}", triangles[bad]),
            ));
        }

        let corners = |t: &[u32; 3]| t.map(|i| vertices[i as usize]);
        let kept: Vec<u32> = (0..triangles.len() as u32)
            .filter(|&i| area(&corners(&triangles[i as usize])) >= MIN_AREA)
            .collect();
        let indices: Vec<[u32; 3]> = kept.iter().map(|&i| triangles[i as usize]).collect();
        let shading = match mode {
            ShadingMode::Flat => Shading::flat(indices.len()),
            ShadingMode::Smooth { crease_angle } => Shading::smooth(vertices, &indices, crease_angle),
        };
        let triangles: Vec<[DVec3; 3]> = indices.iter().map(corners).collect();
        let boxes: Vec<Bounds> = triangles.iter().map(|t| Bounds::of(*t)).collect();
        let bounds = Bounds::of(triangles.iter().flatten().copied());
        let fingerprint = triangles
            .iter()
            .flatten()
            .flat_map(DVec3::to_array)
            .fold(0, |state, x| mix(state ^ x.to_bits()));
        let tree = Tree::build(&boxes);
        let wide = tree.widen(WIDTH);
        let leaves = wide
            .leaves
            .iter()
            .map(|leaf| Leaf::new(leaf.map(|i| &triangles[i as usize])));
        Ok(Self {
            fingerprint,
            kept,
            leaves: leaves.collect(),
            wide,
            tree,
            shading,
            bounds,
            triangles,
        })
    }

    /// Number of triangles that were kept.
    pub fn num_triangles(&self) -> usize {
        self.triangles.len()
    }

    /// For every triangle that was kept, its row in the mesh it came from.
    pub fn kept(&self) -> &[u32] {
        &self.kept
    }

    /// A number that belongs to these triangles in this order.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Box round all triangles.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize]
    }

    /// Normals at the corners of a triangle that stands for a curved surface.
    pub fn corner_normals(&self, triangle: u32) -> Option<[DVec3; 3]> {
        self.shading.corner_normals(triangle as usize)
    }

    /// Nearest triangle that the ray meets before `far`; of several at the same distance the first.
    pub fn nearest(&self, ray: &Ray, far: f64) -> Option<TriangleHit> {
        let woop = Woop::new(ray);
        let mut best: Option<TriangleHit> = None;
        self.tree.walk(ray, far, |triangle, far| {
            let Some((distance, barycentric)) = woop.intersect(&self.triangles[triangle as usize]) else {
                return far;
            };
            let is_nearer = match &best {
                None => distance <= far,
                Some(hit) => distance < hit.distance || (distance <= hit.distance && triangle < hit.triangle),
            };
            if !is_nearer {
                return far;
            }
            best = Some(TriangleHit {
                distance,
                triangle,
                barycentric,
            });
            distance
        });
        best
    }

    /// Offer the triangles that rays of unit directions from one origin meet, near ones first, as far as they may be nearer
    /// than the rays' `best` distances: `offer` of a ray and where it meets a triangle returns the ray's best distance.
    pub fn search(
        &self,
        level: Level,
        rays: &[Ray],
        best: &mut [f64; MOST_RAYS],
        mut offer: impl FnMut(usize, TriangleHit) -> f64,
    ) {
        let Some(first) = rays.first() else {
            return;
        };
        let mut directions = [DVec3::ZERO; MOST_RAYS];
        for (direction, ray) in directions.iter_mut().zip(rays) {
            *direction = ray.direction;
        }
        let bundle = Bundle::new(first.origin, &directions[..rays.len()]);
        let far = farthest(&best[..rays.len()]);
        let mut exact: [Option<Woop>; MOST_RAYS] = [const { None }; MOST_RAYS];
        let triangles = Triangles {
            bundle: &bundle,
            leaves: &self.leaves,
            best,
            test: |ray: usize, leaf: usize, place: usize, best: f64| {
                let triangle = self.wide.leaves[leaf][place];
                let woop = exact[ray].get_or_insert_with(|| Woop::new(&rays[ray]));
                match woop.intersect(&self.triangles[triangle as usize]) {
                    Some((distance, barycentric)) if distance <= best => offer(
                        ray,
                        TriangleHit {
                            distance,
                            triangle,
                            barycentric,
                        },
                    ),
                    _ => best,
                }
            },
        };
        bundle.walk(level, &self.wide, far, triangles);
    }
}

/// Area of a triangle [m^2].
pub fn area(t: &[DVec3; 3]) -> f64 {
    0.5 * (t[1] - t[0]).cross(t[2] - t[0]).length()
}

/// A ray prepared for watertight tests: Woop, Benthin, Wald, Watertight Ray/Triangle Intersection, JCGT 2013.
///
/// The edge functions of two triangles at a common edge come from the same products and differ in sign only,
/// so no ray passes between them. That needs products rounded one by one: no fused multiply-add.
struct Woop {
    ray: Ray,
    axes: [usize; 3],
    shear: DVec3,
}

impl Woop {
    fn new(ray: &Ray) -> Self {
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

    /// Distance and barycentric weights where the ray meets the triangle behind its start; edges belong to it.
    fn intersect(&self, triangle: &[DVec3; 3]) -> Option<(f64, [f64; 3])> {
        let [x, y, z] = self.axes;
        let [a, b, c] = triangle.map(|v| v - self.ray.origin);
        let shear = |v: DVec3| (v[x] - self.shear.x * v[z], v[y] - self.shear.y * v[z]);
        let ((ax, ay), (bx, by), (cx, cy)) = (shear(a), shear(b), shear(c));

        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let sum = u + v + w;
        if sum == 0.0 {
            return None; // the ray lies in the triangle's plane
        }

        // The distance to the plane, from the normal: the interpolated one is less exact on needles.
        let normal = (b - a).cross(c - a);
        let distance = normal.dot(a) / normal.dot(self.ray.direction);
        (distance > self.ray.start && distance.is_finite()).then(|| (distance, [u / sum, v / sum, w / sum]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
        [range.clone(), range.clone(), range].prop_map(DVec3::from)
    }

    fn soup() -> impl Strategy<Value = Vec<DVec3>> {
        prop::collection::vec(vector(-1.0..1.0), 3..60)
    }

    fn indexed(corners: &[DVec3]) -> Vec<[u32; 3]> {
        (0..corners.len() as u32 / 3)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect()
    }

    /// Möller-Trumbore in f64 over all triangles: the slow truth.
    fn brute_force(triangles: &[[DVec3; 3]], ray: &Ray) -> Option<(f64, usize)> {
        let hits = triangles.iter().enumerate().filter_map(|(i, [a, b, c])| {
            let (e1, e2, s) = (b - a, c - a, ray.origin - a);
            let p = ray.direction.cross(e2);
            let q = s.cross(e1);
            let det = e1.dot(p);
            let (u, v, t) = (s.dot(p) / det, ray.direction.dot(q) / det, e2.dot(q) / det);
            (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > ray.start).then_some((t, i))
        });
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    proptest! {
        #[test]
        fn nearest_triangle_of_a_soup_agrees_with_brute_force(corners in soup(), o in vector(-2.0..2.0), d in vector(-1.0..1.0)) {
            prop_assume!(d.length() > 0.1);
            let ray = Ray { origin: o, direction: d.normalize(), start: 0.0 };
            let surface = Surface::new(&corners, &indexed(&corners), ShadingMode::Flat).unwrap();
            let triangles: Vec<_> = (0..surface.num_triangles() as u32).map(|t| surface.corners(t)).collect();
            match (surface.nearest(&ray, f64::INFINITY), brute_force(&triangles, &ray)) {
                (Some(hit), Some((t, i))) => {
                    prop_assert!((hit.distance - t).abs() < 1e-9);
                    prop_assert!(hit.triangle as usize == i || (hit.distance - t).abs() < 1e-12);
                }
                (None, None) => {}
                (got, expected) => prop_assert!(false, "{got:?} {expected:?}"),
            }
        }
    }

    /// Closed sphere of 20 * 4^n triangles.
    fn icosphere(subdivisions: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let g = f64::midpoint(1.0, 5.0_f64.sqrt());
        let mut vertices: Vec<DVec3> = [(1.0, g), (1.0, -g), (-1.0, g), (-1.0, -g)]
            .iter()
            .flat_map(|&(a, b)| [DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)])
            .map(DVec3::normalize)
            .collect();
        let mut triangles = Vec::new();
        for a in 0..12_u32 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    let v = [a, b, c].map(|i| vertices[i as usize]);
                    let is_edge = |p: DVec3, q: DVec3| (p - q).length() < 1.1;
                    if is_edge(v[0], v[1]) && is_edge(v[1], v[2]) && is_edge(v[2], v[0]) {
                        let outward = (v[1] - v[0]).cross(v[2] - v[0]).dot(v[0]) > 0.0;
                        triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                    }
                }
            }
        }
        for _ in 0..subdivisions {
            let mut middle = std::collections::HashMap::new();
            let mut split = Vec::new();
            for t in &triangles {
                let [a, b, c] = *t;
                let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                    *middle.entry((p.min(q), p.max(q))).or_insert_with(|| {
                        vertices.push((vertices[p as usize] + vertices[q as usize]).normalize());
                        vertices.len() as u32 - 1
                    })
                });
                split.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
            }
            triangles = split;
        }
        (vertices, triangles)
    }

    /// A million rays from inside at edges and vertices of a closed mesh, in single rays of the release path.
    #[test]
    fn no_ray_leaks_through_edges_or_vertices_of_a_closed_mesh() {
        let (vertices, triangles) = icosphere(4);
        let surface = Surface::new(&vertices, &triangles, ShadingMode::Flat).unwrap();
        assert_eq!(surface.num_triangles(), 5120);
        // A cheap generator of points in the middle half of the sphere and of places on edges.
        let mut state = 1_u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut rays, mut leaks) = (0, 0);
        while rays < 1_000_000 {
            let origin = 0.5 * (2.0 * DVec3::new(random(), random(), random()) - DVec3::ONE);
            for t in &triangles {
                let [a, b] = [t[0], t[1]].map(|i| vertices[i as usize]);
                let s = random();
                for target in [a, 0.5 * (a + b), a + s * (b - a)] {
                    let ray = Ray {
                        origin,
                        direction: (target - origin).normalize(),
                        start: 0.0,
                    };
                    let hit = surface.nearest(&ray, f64::INFINITY);
                    leaks += usize::from(hit.is_none_or(|h| (h.distance - (target - origin).length()).abs() > 1e-9));
                    rays += 1;
                }
            }
        }
        assert_eq!(leaks, 0, "of {rays} rays");
    }

    #[test]
    fn degenerate_triangles_are_dropped_and_the_rest_keep_their_rows() {
        let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y, 2.0 * DVec3::X];
        let surface = Surface::new(&vertices, &[[0, 0, 1], [0, 1, 3], [0, 1, 2]], ShadingMode::Flat).unwrap();
        assert_eq!((surface.num_triangles(), surface.kept()), (1, &[2][..]));
    }

    #[test]
    fn silly_meshes_are_refused_or_empty() {
        let flat = ShadingMode::Flat;
        let message = |v: &[DVec3], t: &[[u32; 3]]| Surface::new(v, t, flat).err().unwrap().to_string();
        assert!(message(&[DVec3::NAN], &[]).starts_with("vertices: expected finite coordinates"));
        assert!(message(&[DVec3::splat(1e200)], &[]).contains("below 1e15 m"));
        assert!(message(&[DVec3::ZERO], &[[0, 0, 1]]).starts_with("triangles: expected vertex numbers below 1"));
        let empty = Surface::new(&[], &[], flat).unwrap();
        let ray = Ray {
            origin: DVec3::ZERO,
            direction: DVec3::X,
            start: 0.0,
        };
        assert!(empty.nearest(&ray, f64::INFINITY).is_none());
    }

    #[test]
    fn a_ray_in_the_plane_of_a_triangle_misses_it_and_hits_what_is_behind() {
        let wall = [
            DVec3::new(2.0, -1.0, -1.0),
            DVec3::new(2.0, 1.0, -1.0),
            DVec3::new(2.0, 0.0, 1.0),
        ];
        let blade = [
            DVec3::new(1.0, 0.0, 0.0),
            DVec3::new(1.5, 0.0, 0.5),
            DVec3::new(1.5, 0.0, -0.5),
        ];
        let vertices: Vec<DVec3> = blade.into_iter().chain(wall).collect();
        let surface = Surface::new(&vertices, &[[0, 1, 2], [3, 4, 5]], ShadingMode::Flat).unwrap();
        let ray = Ray {
            origin: DVec3::ZERO,
            direction: DVec3::X,
            start: 0.0,
        };
        let hit = surface.nearest(&ray, f64::INFINITY).unwrap();
        assert_eq!((hit.triangle, hit.distance), (1, 2.0));
    }
}
