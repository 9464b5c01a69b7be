//! The surface of one body: checked triangles, their tree and their shading; built once and shared.

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::aabb::Bounds;
use crate::geometry::components::Parts;
use crate::geometry::quality::Quality;
use crate::geometry::smooth_normals::{Groups, Shading};
use crate::geometry::triangle::{MIN_AREA, area};
use crate::numeric::random::mix;
use crate::numeric::simd::{Isa, Kernel, Level, prefetch};
use crate::rays::nearest_point;
use crate::rays::packet::{Best, Bundle, Exact, Search};
use crate::rays::traversal::{Single, Visit};
use crate::rays::tree::{MOST_PRIMITIVES, Node, Primitives, Ray, Tree, WIDTH};
use crate::rays::triangle_block::{Leaf, Table};
use crate::rays::watertight::{Crossing, Woop};

/// Coordinates above this are refused: squares of lengths must stay finite [m].
const LARGEST: f64 = 1e15;

/// Leaves of a tree from which on rays are tested against their boxes one by one: where leaves are smaller than a tile, rays
/// pass between them.
const FINE: usize = 2000;

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
    mesh: Arc<Mesh>,
    /// Where the vertices of the mesh are now.
    vertices: Arc<Vec<DVec3>>,
    /// Over boxes relative to the middle of `bounds`.
    tree: Tree,
    leaves: Vec<Leaf>,
    /// Cost of the tree when it was built.
    built_cost: f64,
    /// Largest coordinate relative to the middle.
    reach: f32,
    shading: Shading,
    bounds: Bounds,
    middle: DVec3,
    /// Boxes round its connected parts; where they were asked for.
    part_bounds: OnceLock<Vec<Bounds>>,
}

/// What stays when a surface is deformed.
struct Mesh {
    /// Where the vertices were when the surface was made.
    rest: Arc<Vec<DVec3>>,
    /// Triangles that were kept.
    triangles: Vec<[u32; 3]>,
    /// Their rows in the mesh they came from, unless that is all of them.
    kept: Option<Vec<u32>>,
    mode: ShadingMode,
    /// Corners that share a normal; for surfaces that were deformed.
    groups: OnceLock<Groups>,
    /// Which triangles hang together, where that was asked for.
    parts: OnceLock<Parts>,
    fingerprint: u64,
}

/// A tree that has become so many times dearer than it was is built anew: at that, images take a seventh longer than with a
/// new tree (`cargo bench --bench trace -- twisted`, a little below it).
const DECAY: f64 = 2.0;

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
        Self::new_with(vertices, triangles, mode, &|_| ())
    }

    /// The same; `report` gets the share of the work that is done, from time to time.
    pub fn new_with(
        vertices: &[DVec3],
        triangles: &[[u32; 3]],
        mode: ShadingMode,
        report: &dyn Fn(f64),
    ) -> Result<Self> {
        check_vertices(vertices)?;
        if triangles.len() > MOST_PRIMITIVES {
            let expected = format!("at most {MOST_PRIMITIVES}");
            return Err(Error::value("triangles", expected, triangles.len()));
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
        let is_kept = |t: &[u32; 3]| area(&corners(t)) >= MIN_AREA;
        let kept: Option<Vec<u32>> = (!triangles.iter().all(is_kept)).then(|| {
            let rows = 0..triangles.len() as u32;
            rows.filter(|&row| is_kept(&triangles[row as usize])).collect()
        });
        let triangles: Vec<[u32; 3]> = match &kept {
            None => triangles.to_vec(),
            Some(kept) => kept.iter().map(|&row| triangles[row as usize]).collect(),
        };
        let fingerprint = fingerprint(vertices, &triangles);
        report(0.1);
        let shading = match mode {
            ShadingMode::Flat => Shading::flat(),
            ShadingMode::Smooth { crease_angle } => Shading::smooth(vertices, &triangles, crease_angle),
        };
        report(0.5);
        let rest = Arc::new(vertices.to_vec());
        let mesh = Mesh {
            rest: rest.clone(),
            triangles,
            kept,
            mode,
            groups: OnceLock::new(),
            parts: OnceLock::new(),
            fingerprint,
        };
        Ok(Self::build(Arc::new(mesh), rest, shading, report))
    }

    /// With a tree of its own.
    fn build(mesh: Arc<Mesh>, vertices: Arc<Vec<DVec3>>, shading: Shading, report: &dyn Fn(f64)) -> Self {
        let middle = mesh.bounds(&vertices).middle();
        let relative = |triangle: usize| mesh.relative(&vertices, triangle, middle);
        let (tree, primitives) = Tree::build(mesh.triangles.len(), WIDTH, |i| Bounds::of_triangle(&relative(i)));
        report(0.85);
        let fitted = Fitted::new(&mesh, &vertices, middle, primitives.into_par_iter());
        report(1.0);
        Self {
            leaves: fitted.leaves,
            built_cost: tree.cost(),
            tree,
            reach: reach(&fitted.bounds),
            shading,
            bounds: fitted.bounds.moved(middle),
            middle,
            part_bounds: OnceLock::new(),
            vertices,
            mesh,
        }
    }

    /// The same triangles between vertices at other places: the tree keeps its shape and gets new boxes, unless it has become
    /// much worse than it was when it was built; then a new one is built.
    pub fn deform(&self, vertices: Vec<DVec3>) -> Result<Self> {
        if vertices.len() != self.vertices.len() {
            let expected = format!("{} as the mesh has", self.vertices.len());
            return Err(Error::value("vertices", expected, vertices.len()));
        }
        check_vertices(&vertices)?;
        let (mesh, vertices) = (self.mesh.clone(), Arc::new(vertices));
        let shading = match mesh.mode {
            ShadingMode::Flat => Shading::flat(),
            ShadingMode::Smooth { crease_angle } => {
                let groups = mesh
                    .groups
                    .get_or_init(|| Groups::new(&mesh.rest, &mesh.triangles, crease_angle));
                Shading::of_groups(&vertices, &mesh.triangles, groups)
            }
        };
        let fit = |middle: DVec3| {
            let primitives = self.leaves.par_iter().map(|leaf| leaf.triangles);
            Fitted::new(&mesh, &vertices, middle, primitives)
        };
        let (mut middle, mut fitted) = (self.middle, fit(self.middle));
        // Coordinates relative to a place far away are not exact.
        let half = 0.5 * (fitted.bounds.max - fitted.bounds.min).max_element();
        if f64::from(reach(&fitted.bounds)) > 4.0 * half {
            middle += fitted.bounds.middle();
            fitted = fit(middle);
        }
        let tree = self.tree.refit(|leaf| fitted.boxes[leaf]);
        if tree.cost() > DECAY * self.built_cost {
            return Ok(Self::build(mesh, vertices, shading, &|_| ()));
        }
        Ok(Self {
            leaves: fitted.leaves,
            tree,
            built_cost: self.built_cost,
            reach: reach(&fitted.bounds),
            shading,
            bounds: fitted.bounds.moved(middle),
            middle,
            part_bounds: OnceLock::new(),
            vertices,
            mesh,
        })
    }

    /// What the mesh is good for; see [`Quality::new`].
    pub fn quality(&self, crease_angle: f64, wavelength: f64) -> Quality {
        Quality::new(&self.vertices, &self.mesh.triangles, crease_angle, wavelength)
    }

    /// Memory of triangles, tree and shading [bytes], without that of the vertices.
    pub fn memory(&self) -> usize {
        let mesh = &self.mesh;
        size_of_val(mesh.triangles.as_slice())
            + mesh.kept.as_ref().map_or(0, |kept| size_of_val(kept.as_slice()))
            + mesh.groups.get().map_or(0, Groups::memory)
            + mesh.parts.get().map_or(0, Parts::memory)
            + self
                .part_bounds
                .get()
                .map_or(0, |bounds| size_of_val(bounds.as_slice()))
            + self.tree.memory()
            + size_of_val(self.leaves.as_slice())
            + self.shading.memory()
    }

    /// Memory of the vertices [bytes].
    pub fn vertex_memory(&self) -> usize {
        let both = 1 + usize::from(self.is_deformed());
        both * size_of_val(self.vertices.as_slice())
    }

    /// Whether this is what [`Self::deform`] made of a surface: one whose vertices move.
    pub fn is_deformed(&self) -> bool {
        !Arc::ptr_eq(&self.vertices, &self.mesh.rest)
    }

    /// Number of triangles that were kept.
    pub fn num_triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// For every triangle that was kept, its row in the mesh it came from; none where all were.
    pub fn kept(&self) -> Option<&[u32]> {
        self.mesh.kept.as_deref()
    }

    /// A number that belongs to these triangles in this order.
    pub fn fingerprint(&self) -> u64 {
        self.mesh.fingerprint
    }

    /// Box round all triangles.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Boxes round its connected parts; of very many only those of the largest.
    pub fn parts(&self) -> &[Bounds] {
        let mesh = &self.mesh;
        self.part_bounds.get_or_init(|| {
            let parts = mesh.parts.get_or_init(|| Parts::new(&mesh.rest, &mesh.triangles));
            parts.bounds(self.bounds, |triangle| mesh.corners(&self.vertices, triangle))
        })
    }

    /// Corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.mesh.corners(&self.vertices, triangle as usize)
    }

    /// The vertices of a triangle.
    pub fn vertices_of(&self, triangle: u32) -> [u32; 3] {
        self.mesh.triangles[triangle as usize]
    }

    /// Where all vertices are.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Corners of a triangle before the surface was deformed.
    pub fn rest_corners(&self, triangle: u32) -> [DVec3; 3] {
        self.mesh.corners(&self.mesh.rest, triangle as usize)
    }

    /// Normals at the corners of a triangle that stands for a curved surface.
    pub fn corner_normals(&self, triangle: u32) -> Option<[DVec3; 3]> {
        self.shading.corner_normals(triangle as usize)
    }

    /// Nearest triangle that the ray meets before `far`; of several at the same distance the first.
    pub fn nearest(&self, ray: &Ray, far: f64) -> Option<TriangleHit> {
        self.nearest_at(ray, far, Level::best())
    }

    /// The same with an instruction set.
    pub fn nearest_at(&self, ray: &Ray, far: f64, level: Level) -> Option<TriangleHit> {
        level
            .run(Nearest {
                surface: self,
                ray,
                far,
                is_any_enough: false,
            })
            .hit
    }

    /// Distance of a point from the nearest triangle that is not all behind the plane through the point across `forward`;
    /// `limit` where that is farther.
    pub fn distance_in_front(&self, point: DVec3, forward: DVec3, limit: f64) -> f64 {
        let corners = |leaf: usize, count: usize| {
            let triangles = self.leaves[leaf].triangles[..count].iter();
            triangles.map(|triangle| self.mesh.relative(&self.vertices, *triangle as usize, self.middle))
        };
        nearest_point::distance_in_front(&self.tree, point - self.middle, forward, limit, corners)
    }

    /// Whether the ray meets any triangle before `far`; ends at the first that is found.
    pub fn blocks(&self, ray: &Ray, far: f64) -> bool {
        let nearest = Nearest {
            surface: self,
            ray,
            far,
            is_any_enough: true,
        };
        Level::best().run(nearest).hit.is_some()
    }

    /// Whether leaves are so many that rays of a bundle may pass between.
    pub fn is_fine(&self) -> bool {
        self.leaves.len() > FINE
    }

    /// Point that the tree's coordinates are relative to.
    pub fn middle(&self) -> DVec3 {
        self.middle
    }

    /// Look for triangles that are nearer than those that `P` packets of a bundle, from one on, have met so far; see
    /// [`Search`]. Returns how many leaves were looked at.
    #[inline(always)]
    pub fn search<I: Isa, E: Exact, const P: usize>(
        &self,
        body: u32,
        (bundle, from): (&Bundle, usize),
        start: f32,
        best: &mut Best,
        exact: &E,
        (table, stack): (&mut Table, &mut Vec<u64>),
    ) -> usize {
        let mut search = Search::<E, P> {
            bundle,
            from,
            leaves: &self.leaves,
            reach: self.reach,
            body,
            is_fine: self.is_fine(),
            start,
            best,
            exact,
            table,
            num_leaves: 0,
        };
        search.walk::<I>(&self.tree, stack);
        search.num_leaves
    }
}

impl Mesh {
    #[inline]
    fn corners(&self, vertices: &[DVec3], triangle: usize) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[triangle];
        [vertices[a as usize], vertices[b as usize], vertices[c as usize]]
    }

    #[inline]
    fn relative(&self, vertices: &[DVec3], triangle: usize, to: DVec3) -> [DVec3; 3] {
        let [a, b, c] = self.corners(vertices, triangle);
        [a - to, b - to, c - to]
    }

    fn bounds(&self, vertices: &[DVec3]) -> Bounds {
        let all = self.triangles.iter().flatten();
        Bounds::of(all.map(|vertex| vertices[*vertex as usize]))
    }
}

/// Refuses coordinates that cannot be traced.
fn check_vertices(vertices: &[DVec3]) -> Result<()> {
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
    Ok(())
}

/// Leaves of a surface, relative to a place, and their boxes.
struct Fitted {
    leaves: Vec<Leaf>,
    boxes: Vec<Bounds>,
    /// Round all.
    bounds: Bounds,
}

impl Fitted {
    fn new(
        mesh: &Mesh,
        vertices: &[DVec3],
        middle: DVec3,
        primitives: impl IndexedParallelIterator<Item = Primitives>,
    ) -> Self {
        let fit = |triangles: Primitives| {
            let mut bounds = Bounds::EMPTY;
            let leaf = Leaf::new(triangles, |triangle| {
                let corners = mesh.relative(vertices, triangle as usize, middle);
                bounds = bounds.union(&Bounds::of_triangle(&corners));
                corners
            });
            (leaf, bounds)
        };
        let (leaves, boxes): (Vec<Leaf>, Vec<Bounds>) = primitives.map(fit).unzip();
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
        Self { leaves, boxes, bounds }
    }
}

/// Largest coordinate of a box.
fn reach(bounds: &Bounds) -> f32 {
    let largest = bounds.max.max(-bounds.min).max_element();
    (largest.max(0.0) as f32).next_up()
}

/// A number that belongs to these triangles in this order.
fn fingerprint(vertices: &[DVec3], triangles: &[[u32; 3]]) -> u64 {
    let of = |triangles: &[[u32; 3]]| {
        triangles.iter().flatten().fold(0, |state, vertex| {
            let [x, y, z] = vertices[*vertex as usize].to_array().map(f64::to_bits);
            mix(state ^ x ^ y.rotate_left(21) ^ z.rotate_left(42))
        })
    };
    let parts: Vec<u64> = triangles.par_chunks(4096).map(of).collect();
    parts.into_iter().fold(0, |state, part| mix(state ^ part))
}

/// Looks for the nearest triangle of a ray.
pub struct Nearest<'a> {
    /// Where.
    pub surface: &'a Surface,
    /// In body coordinates.
    pub ray: &'a Ray,
    /// Nothing beyond is wanted.
    pub far: f64,
    /// Whether to end at the first that is found.
    pub is_any_enough: bool,
}

/// What a search found.
pub struct Found {
    /// The triangle.
    pub hit: Option<TriangleHit>,
    /// Whether boxes that the ray enters before the triangle were left out, where another is enough.
    pub ended_early: bool,
}

impl Kernel for Nearest<'_> {
    type Output = Found;

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(self) -> Found {
        let surface = self.surface;
        let single = Single::new(self.ray.origin - surface.middle(), self.ray.direction);
        let mut visitor = NearestVisitor {
            surface,
            single: &single,
            woop: Woop::new(self.ray),
            best: None,
            far: self.far,
            is_any_enough: self.is_any_enough,
            ended_early: false,
        };
        single.walk::<I>(
            &surface.tree,
            above(self.far),
            &mut Vec::with_capacity(64),
            &mut visitor,
        );
        Found {
            hit: visitor.best,
            ended_early: visitor.ended_early,
        }
    }
}

/// A distance in single precision that is no nearer.
pub fn above(distance: f64) -> f32 {
    let distance = distance.min(f64::from(f32::MAX)) as f32;
    distance.next_up()
}

struct NearestVisitor<'a> {
    surface: &'a Surface,
    single: &'a Single,
    woop: Woop,
    best: Option<TriangleHit>,
    far: f64,
    is_any_enough: bool,
    ended_early: bool,
}

impl Visit for NearestVisitor<'_> {
    #[inline(always)]
    fn expects<I: Isa>(&self, leaf: usize, _: &Node, _: usize) -> bool {
        prefetch(&self.surface.leaves[leaf]);
        true
    }

    #[inline(always)] // part of a kernel
    fn visit<I: Isa>(&mut self, leaf: usize, count: usize, _near: f32) -> f32 {
        let leaf = &self.surface.leaves[leaf];
        let mut met = self.single.may_meet::<I>(leaf, count, self.surface.reach);
        while met != 0 {
            let triangle = leaf.triangles[met.trailing_zeros() as usize];
            met &= met - 1;
            let Some(crossing) = self.woop.intersect(&self.surface.corners(triangle)) else {
                continue;
            };
            let Crossing {
                distance, barycentric, ..
            } = crossing;
            let is_first = self
                .best
                .is_none_or(|best| distance < best.distance || triangle < best.triangle);
            if distance < self.far || (distance <= self.far && is_first) {
                self.far = distance;
                self.best = Some(TriangleHit {
                    distance,
                    triangle,
                    barycentric,
                });
            }
        }
        if self.is_any_enough && self.best.is_some() {
            return -1.0;
        }
        above(self.far)
    }

    #[inline(always)]
    fn leave_out(&mut self, near: f32) {
        self.ended_early |= near <= above(self.far);
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

    #[test]
    fn a_deformed_surface_is_hit_as_one_made_of_its_vertices() {
        let (vertices, triangles) = icosphere(3);
        let mode = ShadingMode::Smooth { crease_angle: 0.8 };
        let before = Surface::new(&vertices, &triangles, mode).unwrap();
        let bend = |p: &DVec3| DVec3::new(p.x + 0.4 * p.y * p.y, 1.3 * p.y, p.z + 0.2 * (3.0 * p.x).sin());
        let bent: Vec<DVec3> = vertices.iter().map(bend).collect();
        // So much that the tree is of no use any more.
        let torn: Vec<DVec3> = (0..vertices.len())
            .map(|i| vertices[i * 389 % vertices.len()])
            .collect();
        for (places, is_rebuilt) in [(bent, false), (torn, true)] {
            let deformed = before.deform(places.clone()).unwrap();
            assert_eq!(deformed.built_cost != before.built_cost, is_rebuilt);
            assert_eq!(deformed.fingerprint(), before.fingerprint());
            assert_eq!(deformed.rest_corners(7), before.corners(7));
            let fresh = Surface::new(&places, &triangles, mode).unwrap();
            let mut state = 1;
            let mut hits = 0;
            for _ in 0..2000 {
                let mut unit = || {
                    state = mix(state);
                    (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
                };
                let ray = Ray {
                    origin: 3.0 * DVec3::new(unit(), unit(), unit()),
                    direction: DVec3::new(unit(), unit(), unit()),
                    start: 0.0,
                };
                let [a, b] = [&deformed, &fresh].map(|s| s.nearest(&ray, f64::INFINITY));
                let of = |hit: Option<TriangleHit>| hit.map(|h| (h.triangle, h.distance, h.barycentric));
                assert_eq!(of(a), of(b));
                assert_eq!(deformed.blocks(&ray, f64::INFINITY), a.is_some());
                hits += usize::from(a.is_some());
                if let Some(hit) = a {
                    assert!(!deformed.blocks(&ray, hit.distance * (1.0 - 1e-12)));
                }
            }
            assert!(hits > 100, "{hits}");
        }
        let same = before.deform(vertices).unwrap();
        for triangle in 0..triangles.len() as u32 {
            assert_eq!(same.corner_normals(triangle), before.corner_normals(triangle));
        }
        assert!(before.deform(vec![DVec3::ZERO; 3]).is_err());
        assert!(before.deform(vec![DVec3::NAN; before.vertices().len()]).is_err());
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
        assert_eq!((surface.num_triangles(), surface.kept()), (1, Some(&[2][..])));
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
