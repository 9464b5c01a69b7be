use super::*;
use crate::geometry::curved_triangle::shade;

const CREASE: f64 = PI / 4.0;
/// Rounding of stored normals: half a unit in the last place of every component.
const STORED: f64 = f32::EPSILON as f64;

/// Vertices and triangles.
type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// Unit icosahedron, split in four `level` times; 20, 80, 320, 1280 triangles.
fn icosphere(level: usize) -> Mesh {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut vertices = Vec::new();
    for (a, b) in [(-1.0, -golden), (1.0, -golden), (-1.0, golden), (1.0, golden)] {
        vertices.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)].map(DVec3::normalize));
    }
    // The faces are the triples of neighbours, wound outwards.
    let near = |a: usize, b: usize| vertices[a].dot(vertices[b]) > 0.4;
    let is_face = |&[a, b, c]: &[usize; 3]| {
        let is_outward = vertices[a].dot(vertices[b].cross(vertices[c])) > 0.1;
        a < b.min(c) && near(a, b) && near(b, c) && near(c, a) && is_outward
    };
    let triples = (0..12 * 12 * 12).map(|i| [i / 144, i / 12 % 12, i % 12]);
    let mut triangles: Vec<[u32; 3]> = triples.filter(is_face).map(|face| face.map(|i| i as u32)).collect();
    for _ in 0..level {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                vertices.len() as u32 - 1
            })
        };
        let split = |&[a, b, c]: &[u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.iter().flat_map(split).collect();
    }
    (vertices, triangles)
}

/// Rings of points one above the other, joined by quads of two triangles; the rings may be closed.
fn swept(rings: &[Vec<DVec3>], is_closed: bool) -> Mesh {
    let num = rings[0].len() as u32;
    let strips = if is_closed { num } else { num - 1 };
    let quads = (1..rings.len() as u32).flat_map(|ring| (0..strips).map(move |i| (ring * num, i)));
    let triangles = quads.flat_map(|(above, i)| {
        let (a, b) = (above - num + i, above - num + (i + 1) % num);
        [[a, b, b + num], [a, b + num, a + num]]
    });
    let triangles = triangles.collect();
    (rings.concat(), triangles)
}

/// Profile in the x-y plane swept along z, with normals to the right of the way along it.
fn extruded(profile: &[(f64, f64)], length: f64, is_closed: bool) -> Mesh {
    let ring = |z: f64| profile.iter().map(|&(x, y)| DVec3::new(x, y, z)).collect();
    swept(&[ring(0.0), ring(length)], is_closed)
}

/// Points of an arc about (x, y), `num` steps of `step` from the x axis counter-clockwise.
fn arc((x, y): (f64, f64), radius: f64, step: f64, num: u32) -> Vec<(f64, f64)> {
    let angles = (0..num).map(|i| step * f64::from(i));
    angles
        .map(|angle| (x + radius * angle.cos(), y + radius * angle.sin()))
        .collect()
}

/// Prism about the z axis with corners at radius 1: two triangles for each of its sides first, then two caps.
fn prism(sides: u32) -> Mesh {
    let (vertices, mut triangles) = extruded(&arc((0.0, 0.0), 1.0, 2.0 * PI / f64::from(sides), sides), 3.0, true);
    for i in 1..sides - 1 {
        triangles.extend([[0, i + 1, i], [sides, sides + i, sides + i + 1]]);
    }
    (vertices, triangles)
}

fn corners_of((vertices, triangles): &Mesh, triangle: usize) -> [DVec3; 3] {
    triangles[triangle].map(|vertex| vertices[vertex as usize])
}

fn face_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize()
}

/// Points all over a triangle, rim included.
fn barycentric_grid() -> impl Iterator<Item = [f64; 3]> {
    (0..=6).flat_map(|i| (0..=6 - i).map(move |j| [i, j, 6 - i - j].map(|weight| f64::from(weight) / 6.0)))
}

fn mean(values: [DVec3; 3], barycentric: [f64; 3]) -> DVec3 {
    (0..3).map(|i| barycentric[i] * values[i]).sum()
}

fn smooth((vertices, triangles): &Mesh, crease_angle: f64) -> Shading {
    Shading::of_groups(vertices, triangles, &Groups::new(vertices, triangles, crease_angle))
}

/// Assert that triangles are curved, with normals away from the z axis, or from the origin.
#[track_caller]
fn assert_radial(mesh: &Mesh, shading: &Shading, triangles: std::ops::Range<usize>, weight: DVec3, bound: f64) {
    for t in triangles {
        let normals = shading.corner_normals(t).expect("curved");
        for (normal, vertex) in normals.into_iter().zip(corners_of(mesh, t)) {
            let off = normal.distance((weight * vertex).normalize());
            assert!(off <= bound, "{t}: {off} > {bound}");
            assert!((normal.length() - 1.0).abs() <= 2.0 * STORED);
        }
    }
}

#[track_caller]
fn assert_flat(shading: &Shading, triangles: impl IntoIterator<Item = usize>) {
    for t in triangles {
        assert_eq!(shading.corner_normals(t), None, "{t}");
    }
}

/// Assert that two meshes have the same normals at some triangles.
#[track_caller]
fn assert_same(a: &Shading, b: &Shading, triangles: impl IntoIterator<Item = usize>) {
    for t in triangles {
        assert_eq!(a.corner_normals(t), b.corner_normals(t), "{t}");
    }
}

#[test]
fn normals_of_spheres_and_tubes_are_radial() {
    for level in 1..=4 {
        let mesh = icosphere(level);
        // One facet's normal is 0.58 edges off at its corners. A ring of equal facets has none of that left; these
        // differ in area by up to a fifth between neighbours, and of what that leaves the correction leaves less than a
        // tenth.
        let edge = |t: usize| corners_of(&mesh, t)[0].distance(corners_of(&mesh, t)[1]);
        let num = mesh.1.len();
        let bound = 0.58 / 100.0 * (0..num).map(edge).fold(0.0, f64::max) + STORED;
        assert_radial(&mesh, &smooth(&mesh, CREASE), 0..num, DVec3::ONE, bound);
    }
    // A vertex has two triangles of one neighbour and one of the other, which count alike; caps do not reach into sides.
    let across = DVec3::new(1.0, 1.0, 0.0);
    let mesh = prism(24);
    let shading = smooth(&mesh, CREASE);
    assert_radial(&mesh, &shading, 0..48, across, 2.0 * STORED);
    assert_flat(&shading, 48..mesh.1.len());
    // 72 sides of 430 mm x 4.7 mm, and chamfers of 3 mm at 30 degrees, within the crease angle.
    let (reach, drop) = (3e-3 * (PI / 6.0).cos(), 3e-3 * (PI / 6.0).sin());
    let rings = [
        (54e-3 - drop, -reach),
        (54e-3, 0.0),
        (54e-3, 0.43),
        (54e-3 - drop, 0.43 + reach),
    ];
    let ring = |(radius, z): (f64, f64)| {
        let arc = arc((0.0, 0.0), radius, 2.0 * PI / 72.0, 72);
        arc.into_iter().map(|(x, y)| DVec3::new(x, y, z)).collect()
    };
    let mesh = swept(&rings.map(ring), true);
    assert_radial(&mesh, &smooth(&mesh, CREASE), 144..288, across, 2.0 * STORED);
}

#[test]
fn hits_on_a_mesh_of_a_sphere_lie_on_the_sphere_to_second_order() {
    // From outside and inside, at up to 60 degrees to every facet.
    let mesh = icosphere(3);
    let shading = smooth(&mesh, CREASE);
    let all = || (0..mesh.1.len()).map(|t| (t, corners_of(&mesh, t), face_normal(corners_of(&mesh, t))));
    let sagitta = all().map(|(_, corners, n)| 1.0 - corners[0].dot(n)).fold(0.0, f64::max);
    let (mut sum, mut number) = (0.0, 0.0);
    for (t, corners, n) in all() {
        let views = [-1.0, 1.0]
            .into_iter()
            .flat_map(|side| [0.0, 0.5, -1.05].map(|angle| (side, angle)));
        for ((side, angle), b) in views.flat_map(|view| barycentric_grid().map(move |b| (view, b))) {
            let (sin, cos) = f64::sin_cos(angle);
            let d = side * cos * n + sin * n.any_orthonormal_vector();
            let (normal, correction) = shade(corners, shading.corner_normals(t), b, n, d);
            let x = mean(corners, b);
            // With n = x/|x| and e = 1 - |x| the hit moves to |x|^2 = 1 - 2 e^2 + e^2 / cos^2 + ...; cos > 0.4 here.
            let error = ((x + correction * d).length() - 1.0).abs();
            assert!(
                error <= 3.0 * sagitta * sagitta,
                "{error} at {b:?} of {t}, direction {d}"
            );
            sum += error * error;
            number += 1.0;
            // The normal points to the incident side. Facets lean by sqrt(2 sagitta).
            let lean = (-side * normal).distance(x.normalize());
            assert!(lean <= (2.0 * sagitta).sqrt() / 100.0, "{lean} at {b:?} of {t}");
        }
    }
    let rms = f64::sqrt(sum / number);
    assert!(rms <= 0.5 * sagitta * sagitta, "{rms} {sagitta}");
}

#[test]
fn facets_seen_from_behind_are_the_same_surface_and_grazing_hits_keep_theirs() {
    let mesh = icosphere(2);
    let (corners, normals) = (corners_of(&mesh, 7), smooth(&mesh, CREASE).corner_normals(7));
    let n = face_normal(corners);
    let seen = |b: [f64; 3], d: DVec3| shade(corners, normals, b, n, d);
    let d = (-n + 0.3 * n.any_orthonormal_vector()).normalize();
    let [(front, nearer), (back, farther)] = [d, -d].map(|d| seen([0.2, 0.3, 0.5], d));
    assert_eq!((front, nearer), (-back, -farther));
    assert!(nearer < 0.0, "from outside, a sphere comes before its chord");
    for cosine in [-0.02, -1e-9, 1e-9, 0.02] {
        let d = (n * cosine + n.any_orthonormal_vector()).normalize();
        assert_eq!(seen([1.0 / 3.0; 3], d), (if cosine > 0.0 { -n } else { n }, 0.0));
    }
}

#[test]
fn edges_from_the_crease_angle_on_are_sharp() {
    // The same triangle from both sides: one shared contour, wound consistently, but at 180 degrees.
    let sheet = (vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2], [0, 2, 1]]);
    for (mesh, crease_angle, is_flat) in [
        (&prism(4), CREASE, true),
        (&prism(4), PI / 2.0, true),
        (&prism(4), 1.6, false),
        (&prism(4), 0.0, true),
        (&prism(4), f64::NAN, true),
        // 45 and 40 degrees.
        (&prism(8), CREASE, true),
        (&prism(9), CREASE, false),
        (&sheet, PI, true),
    ] {
        let shading = smooth(mesh, crease_angle);
        let are_flat = (0..mesh.1.len()).all(|t| shading.corner_normals(t).is_none());
        assert_eq!(are_flat, is_flat, "{} {crease_angle}", mesh.1.len());
    }
}

#[test]
fn triangles_without_area_say_nothing() {
    // A body that is deformed may fold some away: all corners on one line, or two of them at one place.
    let (vertices, triangles) = icosphere(2);
    let groups = Groups::new(&vertices, &triangles, CREASE);
    let [a, b, c] = triangles[37].map(|vertex| vertex as usize);
    for place in [0.5, 1.0] {
        let folded = |x: f64| {
            let mut vertices = vertices.clone();
            vertices[a] = vertices[b].lerp(vertices[c], x);
            Shading::of_groups(&vertices, &triangles, &groups)
        };
        // As with an area of next to nothing.
        let (without, nearly) = (folded(place), folded(place - 1e-7));
        for t in (0..triangles.len()).filter(|t| *t != 37) {
            let [without, nearly] = [&without, &nearly].map(|shading| shading.corner_normals(t));
            assert_eq!(without.is_some(), nearly.is_some(), "{t}");
            for (without, nearly) in without.into_iter().flatten().zip(nearly.into_iter().flatten()) {
                assert!(without.distance(nearly) < 1e-4, "{t}: {without} {nearly}");
            }
        }
    }
}

#[test]
fn planes_beside_a_fillet_stay_planes_and_the_fillet_is_round() {
    // A wall of 0.2 m, a fillet of 5 mm in 8 strips, another wall: the rounded edge of a box.
    let fillet = arc((0.1, 0.0), 0.005, PI / 16.0, 9);
    let mesh = extruded(&[&[(0.105, -0.2)], &fillet[..], &[(-0.1, 0.005)]].concat(), 0.1, false);
    let shading = smooth(&mesh, CREASE);
    let last = mesh.1.len() - 2;
    assert_flat(&shading, [0, 1, last, last + 1]);
    let sagitta = 0.005 * (1.0 - (PI / 32.0).cos());
    for t in 2..last {
        let (corners, normals) = (corners_of(&mesh, t), shading.corner_normals(t));
        assert!(normals.is_some());
        let n = face_normal(corners);
        for b in barycentric_grid() {
            let surface = mean(corners, b) - shade(corners, normals, b, n, -n).1 * n;
            let off = (surface - DVec3::new(0.1, 0.0, surface.z)).length() - 0.005;
            // To second order; at its seams the normals are a hundredth of a strip's angle off.
            assert!(off.abs() <= 0.02 * sagitta, "{off} of {sagitta} in {t}");
        }
    }
    // At the seam the normal is the wall's: the fillet's strip weighs a hundredth. Weighted by angle it would lie
    // in the middle between the two, 0.05 rad off.
    let seam = shading.corner_normals(2).expect("fillet")[0];
    assert!(seam.distance(DVec3::X) < 0.002, "{seam}");
}

#[test]
fn flipped_neighbours_and_fins_have_sharp_edges() {
    // A neighbour wound the other way has normals of its own; far away nothing changes.
    let mesh = prism(24);
    let mut turned = mesh.clone();
    turned.1[10].swap(0, 1);
    let (whole, turned) = (smooth(&mesh, CREASE), smooth(&turned, CREASE));
    assert_flat(&turned, [10]);
    assert_same(&turned, &whole, [30, 31]);
    // An arc of eight strips, and a fin along the edge between strips 3 and 4. The surface ends at the fin, and half a
    // bend fits no smooth surface.
    let mut mesh = extruded(&arc((0.0, 0.0), 1.0, PI / 16.0, 9), 1.0, false);
    let without = smooth(&mesh, CREASE);
    mesh.0.push(DVec3::ZERO);
    mesh.1.push([4, 13, 18]);
    let finned = smooth(&mesh, CREASE);
    assert!((6..10).all(|t| without.corner_normals(t).is_some()));
    assert_flat(&finned, 6..10);
    assert_same(&finned, &without, [2, 3, 12, 13]);
}

#[test]
fn triangles_without_shared_vertices_have_the_same_normals_and_turned_over_the_opposite_ones() {
    let mesh = icosphere(3);
    let (num, indexed) = (mesh.1.len(), smooth(&mesh, CREASE));
    // Every triangle with vertices of its own, as an STL file has it. Zeros of either sign are one position.
    let vertices: Vec<DVec3> = (0..num).flat_map(|t| corners_of(&mesh, t)).collect();
    let negative = |v: DVec3| v.map(|x| if x == 0.0 { -0.0 } else { x });
    let mixed: Vec<DVec3> = vertices
        .iter()
        .enumerate()
        .map(|(i, v)| if i % 2 == 0 { *v } else { negative(*v) })
        .collect();
    assert!(
        mixed
            .iter()
            .flat_map(DVec3::to_array)
            .any(|x| x == 0.0 && x.is_sign_negative())
    );
    for vertices in [vertices, mixed] {
        let triangles = (0..num as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        assert_same(&smooth(&(vertices, triangles), CREASE), &indexed, 0..num);
    }
    let over = mesh.1.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let over = smooth(&(mesh.0, over), CREASE);
    for t in 0..num {
        let [a, b, c] = indexed.corner_normals(t).expect("smooth");
        assert_eq!(over.corner_normals(t).expect("smooth"), [-a, -c, -b]);
    }
}
