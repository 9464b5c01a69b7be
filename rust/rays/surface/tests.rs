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
        assert_eq!(deformed.content_hash(), before.content_hash());
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
