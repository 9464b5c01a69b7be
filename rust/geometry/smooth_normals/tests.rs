use super::*;
use crate::geometry::curved_triangle::shade;

const CREASE: f64 = PI / 4.0;
/// Rounding of stored normals: half a unit in the last place of every component.
const STORED: f64 = f32::EPSILON as f64;

pub type Triangles = Vec<[u32; 3]>;

/// Unit icosahedron, split in four `level` times; 20, 80, 320, 1280 triangles.
pub fn icosphere(level: usize) -> (Vec<DVec3>, Triangles) {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut vertices = Vec::new();
    for (a, b) in [(-1.0, -golden), (1.0, -golden), (-1.0, golden), (1.0, golden)] {
        vertices.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)].map(DVec3::normalize));
    }
    // The faces are the triples of neighbours, wound outwards.
    let near = |a: usize, b: usize| vertices[a].dot(vertices[b]) > 0.4;
    let mut triangles = Triangles::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outwards = vertices[a].dot(vertices[b].cross(vertices[c])) > 0.0;
                    let (b, c) = if outwards { (b, c) } else { (c, b) };
                    triangles.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    for _ in 0..level {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                vertices.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    (vertices, triangles)
}

fn corners_of(vertices: &[DVec3], triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|vertex| vertices[vertex as usize])
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

/// Every triangle with vertices of its own, as an STL file has it.
fn soup(vertices: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<DVec3>, Triangles) {
    let vertices = triangles
        .iter()
        .flat_map(|&triangle| corners_of(vertices, triangle))
        .collect();
    (
        vertices,
        (0..triangles.len() as u32)
            .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
            .collect(),
    )
}

/// A profile in the x-y plane swept along z by `length`, normals to the right of the way along the profile.
fn swept(profile: &[(f64, f64)], length: f64, closed: bool) -> (Vec<DVec3>, Triangles) {
    let vertices = profile
        .iter()
        .flat_map(|&(x, y)| [0.0, length].map(|z| DVec3::new(x, y, z)))
        .collect();
    let n = profile.len() as u32;
    let strips = if closed { n } else { n - 1 };
    let triangles = (0..strips)
        .flat_map(|i| {
            let (a, b) = (2 * i, 2 * ((i + 1) % n));
            [[a, b, b + 1], [a, b + 1, a + 1]]
        })
        .collect();
    (vertices, triangles)
}

fn smooth(vertices: &[DVec3], triangles: &[[u32; 3]], crease_angle: f64) -> Shading {
    Shading::of_groups(vertices, triangles, &Groups::new(vertices, triangles, crease_angle))
}

fn all_flat(shading: &Shading, num_triangles: usize) -> bool {
    (0..num_triangles).all(|t| shading.corner_normals(t).is_none())
}

#[test]
fn normals_of_a_sphere_are_radial() {
    for level in 1..=4 {
        let (vertices, triangles) = icosphere(level);
        let shading = smooth(&vertices, &triangles, CREASE);
        // One facet's normal is 0.58 edges off at its corners. A ring of equal facets has none of that left; these
        // differ in area by up to a fifth between neighbours, and of what that leaves the correction leaves less than a
        // tenth.
        let edge = triangles
            .iter()
            .map(|&t| (vertices[t[0] as usize] - vertices[t[1] as usize]).length());
        let bound = 0.58 / 100.0 * edge.fold(0.0, f64::max) + STORED;
        for (t, &triangle) in triangles.iter().enumerate() {
            let normals = shading.corner_normals(t).expect("a sphere is smooth everywhere");
            for (normal, vertex) in normals.into_iter().zip(corners_of(&vertices, triangle)) {
                assert!(
                    normal.distance(vertex) <= bound,
                    "{level}: {} > {bound}",
                    normal.distance(vertex)
                );
                assert!((normal.length() - 1.0).abs() <= 2.0 * STORED);
            }
        }
    }
}

#[test]
fn hits_on_a_mesh_of_a_sphere_lie_on_the_sphere_to_second_order() {
    // From outside and inside, at up to 60 degrees to every facet.
    let (vertices, triangles) = icosphere(3);
    let shading = smooth(&vertices, &triangles, CREASE);
    let depth = |&t: &[u32; 3]| 1.0 - corners_of(&vertices, t)[0].dot(face_normal(corners_of(&vertices, t)));
    let sagitta = triangles.iter().map(depth).fold(0.0, f64::max);
    let (mut sum, mut number) = (0.0, 0.0);
    for (t, &triangle) in triangles.iter().enumerate() {
        let corners = corners_of(&vertices, triangle);
        let n = face_normal(corners);
        for (b, side, angle) in barycentric_grid()
            .flat_map(|b| [-1.0, 1.0].map(|side| (b, side)))
            .flat_map(|(b, side)| [0.0, 0.5, -1.05].map(|angle| (b, side, angle)))
        {
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
            assert!(normal.dot(d) < 0.0, "the normal points to the incident side");
            let lean = (-side * normal).distance(x.normalize());
            assert!(
                lean <= (2.0 * sagitta).sqrt() / 100.0,
                "{lean} at {b:?} of {t}: facets lean by sqrt(2 sagitta)"
            );
        }
    }
    let rms = f64::sqrt(sum / number);
    assert!(rms <= 0.5 * sagitta * sagitta, "{rms} {sagitta}");
}

#[test]
fn a_facet_seen_from_behind_is_the_same_surface() {
    let (vertices, triangles) = icosphere(2);
    let shading = smooth(&vertices, &triangles, CREASE);
    let corners = corners_of(&vertices, triangles[7]);
    let (n, b) = (face_normal(corners), [0.2, 0.3, 0.5]);
    let d = (-n + 0.3 * n.any_orthonormal_vector()).normalize();
    let (front, nearer) = shade(corners, shading.corner_normals(7), b, n, d);
    let (back, farther) = shade(corners, shading.corner_normals(7), b, n, -d);
    assert_eq!((front, nearer), (-back, -farther));
    assert!(nearer < 0.0, "from outside, a sphere comes before its chord");
}

#[test]
fn grazing_hits_keep_the_facet() {
    let (vertices, triangles) = icosphere(2);
    let shading = smooth(&vertices, &triangles, CREASE);
    let corners = corners_of(&vertices, triangles[0]);
    let n = face_normal(corners);
    for cosine in [-0.02, -1e-9, 1e-9, 0.02] {
        let d = (n * cosine + n.any_orthonormal_vector()).normalize();
        let (normal, correction) = shade(corners, shading.corner_normals(0), [1.0 / 3.0; 3], n, d);
        assert_eq!((normal, correction), (if cosine > 0.0 { -n } else { n }, 0.0));
    }
}

#[test]
fn cubes_stay_flat_below_their_crease() {
    let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let (vertices, mut triangles) = swept(&square, 1.0, true);
    triangles.extend([[0, 6, 4], [0, 4, 2], [1, 3, 5], [1, 5, 7]]);
    assert!(all_flat(&smooth(&vertices, &triangles, CREASE), 12));
    assert!(
        all_flat(&smooth(&vertices, &triangles, PI / 2.0), 12),
        "90 degrees is not below 90 degrees"
    );
    assert!(!all_flat(&smooth(&vertices, &triangles, 1.6), 12));
    assert!(all_flat(&smooth(&vertices, &triangles, 0.0), 12));
    assert!(all_flat(&smooth(&vertices, &triangles, f64::NAN), 12));
    // Prisms of 8 and 9 sides meet at 45 and 40 degrees.
    for (sides, is_flat) in [(8, true), (9, false)] {
        let (vertices, triangles) = cylinder(sides);
        assert_eq!(
            all_flat(&smooth(&vertices, &triangles, CREASE), triangles.len()),
            is_flat
        );
    }
}

/// Cylinder of radius 1 along z: the sides (two triangles each) first, then two caps.
fn cylinder(segments: u32) -> (Vec<DVec3>, Triangles) {
    let angles = (0..segments).map(|i| 2.0 * PI * f64::from(i) / f64::from(segments));
    let profile: Vec<_> = angles.map(|angle| (angle.cos(), angle.sin())).collect();
    let (vertices, mut triangles) = swept(&profile, 3.0, true);
    for i in 1..segments - 1 {
        triangles.extend([[0, 2 * i + 2, 2 * i], [1, 2 * i + 1, 2 * i + 3]]);
    }
    (vertices, triangles)
}

#[test]
fn cylinders_have_smooth_sides_and_flat_caps() {
    let (vertices, triangles) = cylinder(24);
    let shading = smooth(&vertices, &triangles, CREASE);
    for (t, &triangle) in triangles.iter().enumerate() {
        let normals = shading.corner_normals(t);
        if t >= 48 {
            assert!(normals.is_none(), "cap {t}");
            continue;
        }
        for (normal, vertex) in normals.expect("side").into_iter().zip(corners_of(&vertices, triangle)) {
            let radial = vertex.with_z(0.0);
            assert!(normal.z.abs() <= STORED, "caps do not reach into the side");
            // A vertex has two triangles of one neighbour and one of the other, which count alike.
            assert!(normal.distance(radial) <= 2.0 * STORED);
        }
    }
}

#[test]
fn the_sides_of_a_tube_are_round_up_to_the_chamfers_at_its_ends() {
    // 72 sides of 430 mm x 4.7 mm, and chamfers of 3 mm at 30 degrees, within the crease angle.
    let angles: Vec<f64> = (0..72).map(|i| 2.0 * PI * f64::from(i) / 72.0).collect();
    let (reach, drop) = (3e-3 * (PI / 6.0).cos(), 3e-3 * (PI / 6.0).sin());
    let rings = [
        (54e-3 - drop, -reach),
        (54e-3, 0.0),
        (54e-3, 0.43),
        (54e-3 - drop, 0.43 + reach),
    ];
    let ring = |(radius, z): (f64, f64)| {
        angles
            .iter()
            .map(move |angle| DVec3::new(radius * angle.cos(), radius * angle.sin(), z))
    };
    let vertices: Vec<DVec3> = rings.into_iter().flat_map(ring).collect();
    let quad = |ring: u32, i: u32| {
        let (a, b) = (72 * ring + i, 72 * ring + (i + 1) % 72);
        [[a, b, b + 72], [a, b + 72, a + 72]]
    };
    let triangles: Triangles = [1, 0, 2]
        .iter()
        .flat_map(|r| (0..72).flat_map(|i| quad(*r, i)))
        .collect();
    let shading = smooth(&vertices, &triangles, CREASE);
    for (t, &triangle) in triangles.iter().enumerate().take(144) {
        let normals = shading.corner_normals(t).expect("side");
        for (normal, vertex) in normals.into_iter().zip(corners_of(&vertices, triangle)) {
            assert!(normal.distance(vertex.with_z(0.0).normalize()) <= 2.0 * STORED);
        }
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
            match (without.corner_normals(t), nearly.corner_normals(t)) {
                (Some(without), Some(nearly)) => {
                    for (without, nearly) in without.into_iter().zip(nearly) {
                        assert!(without.distance(nearly) < 1e-4, "{t}: {without} {nearly}");
                    }
                }
                (without, nearly) => assert_eq!(without, nearly, "{t}"),
            }
        }
    }
}

/// Points of a quarter circle about (x, y), from angle `start` counter-clockwise.
fn fillet((x, y): (f64, f64), radius: f64, start: f64) -> impl Iterator<Item = (f64, f64)> {
    (0..=8).map(move |i| {
        let angle = start + PI / 16.0 * f64::from(i);
        (x + radius * angle.cos(), y + radius * angle.sin())
    })
}

#[test]
fn planes_beside_a_fillet_stay_planes_and_the_fillet_is_round() {
    // A wall of 0.2 m, a fillet of 5 mm in 8 strips, another wall: the rounded edge of a box.
    let profile: Vec<_> = [(0.105, -0.2)]
        .into_iter()
        .chain(fillet((0.1, 0.0), 0.005, 0.0))
        .chain([(-0.1, 0.005)])
        .collect();
    let (vertices, triangles) = swept(&profile, 0.1, false);
    let shading = smooth(&vertices, &triangles, CREASE);
    let last = triangles.len() - 2;
    for t in [0, 1, last, last + 1] {
        assert!(shading.corner_normals(t).is_none(), "wall {t}");
    }
    let sagitta = 0.005 * (1.0 - (PI / 32.0).cos());
    for (t, &triangle) in triangles.iter().enumerate().take(last).skip(2) {
        let corners = corners_of(&vertices, triangle);
        let normals = shading.corner_normals(t).expect("fillet");
        let n = face_normal(corners);
        for b in barycentric_grid() {
            let surface = mean(corners, b) - shade(corners, Some(normals), b, n, -n).1 * n;
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
fn neighbours_wound_the_other_way_are_not_smoothed() {
    let (vertices, triangles) = cylinder(24);
    let mut turned = triangles.clone();
    turned[10].swap(0, 1);
    let shading = smooth(&vertices, &turned, CREASE);
    assert!(
        shading.corner_normals(10).is_none(),
        "all its edges are sharp: its normals are its own"
    );
    let whole = smooth(&vertices, &triangles, CREASE);
    for t in [30, 31] {
        assert_eq!(
            shading.corner_normals(t),
            whole.corner_normals(t),
            "far away nothing changes"
        );
    }
}

#[test]
fn an_edge_of_three_faces_is_sharp() {
    // An arc of eight strips, and a fin along the edge between strips 3 and 4.
    let profile: Vec<_> = fillet((0.0, 0.0), 1.0, 0.0).collect();
    let (mut vertices, mut triangles) = swept(&profile, 1.0, false);
    let without = smooth(&vertices, &triangles, CREASE);
    vertices.push(DVec3::ZERO);
    triangles.push([8, 9, 18]);
    let finned = smooth(&vertices, &triangles, CREASE);
    for t in 6..10 {
        assert!(without.corner_normals(t).is_some());
        // The surface ends at the fin, and half a bend fits no smooth surface.
        assert!(finned.corner_normals(t).is_none());
    }
    for t in [2, 3, 12, 13] {
        assert_eq!(
            without.corner_normals(t),
            finned.corner_normals(t),
            "far away nothing changes"
        );
    }
}

#[test]
fn both_sides_of_a_sheet_stay_apart() {
    // The same triangle from both sides: one shared contour, wound consistently, but at 180 degrees.
    let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y];
    assert!(all_flat(&smooth(&vertices, &[[0, 1, 2], [0, 2, 1]], PI), 2));
}

#[test]
fn triangles_without_shared_vertices_have_the_same_normals() {
    let (vertices, triangles) = icosphere(3);
    let indexed = smooth(&vertices, &triangles, CREASE);
    let (vertices, triangles) = soup(&vertices, &triangles);
    // Zeros of either sign are one position.
    let mixed: Vec<_> = vertices
        .iter()
        .enumerate()
        .map(|(i, v)| {
            if i % 2 == 0 {
                *v
            } else {
                v.map(|x| if x == 0.0 { -0.0 } else { x })
            }
        })
        .collect();
    assert!(
        mixed
            .iter()
            .any(|v| v.to_array().iter().any(|x| *x == 0.0 && x.is_sign_negative()))
    );
    for vertices in [vertices, mixed] {
        let shading = smooth(&vertices, &triangles, CREASE);
        for t in 0..triangles.len() {
            assert_eq!(shading.corner_normals(t), indexed.corner_normals(t));
        }
    }
}

#[test]
fn turning_every_triangle_over_turns_every_normal() {
    let (vertices, triangles) = icosphere(2);
    let over: Triangles = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let (front, back) = (smooth(&vertices, &triangles, CREASE), smooth(&vertices, &over, CREASE));
    for t in 0..triangles.len() {
        let [a, b, c] = front.corner_normals(t).expect("smooth");
        assert_eq!(back.corner_normals(t).expect("smooth"), [-a, -c, -b]);
    }
}
