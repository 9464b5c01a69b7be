//! Polygons of areas known on paper, and rings that are refused; `properties` has polygons of any shape.

use std::f64::consts::{FRAC_PI_3, PI, TAU};

use super::*;

const CROSSED: &str = "a polygon whose edges do not cross";

/// Areas times normals of the triangles of a ring.
fn cut(ring: &[DVec3]) -> Vec<DVec3> {
    area_vectors(&Obj {
        vertices: ring.iter().map(DVec3::to_array).collect(),
        triangles: triangulate(ring).unwrap(),
        ..Obj::default()
    })
}

fn circle(angles: impl Iterator<Item = f64>) -> Vec<[f64; 2]> {
    angles.map(|angle| [angle.cos(), angle.sin()]).collect()
}

#[test]
fn rings_without_area_give_none() {
    // Corners of a cube: x + 2 y + 4 z.
    let corner = |digit: u8| DVec3::from([digit & 1, digit >> 1 & 1, digit >> 2 & 1].map(f64::from));
    let of_cube = ["0000", "0101", "0110", "0131", "013731", "001"].map(|ring| ring.bytes().map(corner).collect());
    let line: Vec<DVec3> = (0..9).map(|i| DVec3::new(0.1, 0.3, -0.7) * f64::from(i)).collect();
    let back = line.iter().chain(line[1..8].iter().rev()).copied().collect();
    for ring in of_cube.into_iter().chain([line, back]) {
        let area: f64 = cut(&ring).iter().map(|vector| vector.length()).sum();
        assert!(area <= 1e-12, "{ring:?}: {area}");
    }
}

#[test]
fn rings_have_the_triangles_and_areas_known_on_paper() {
    let keyhole = |scale: f64, shift: f64| -> Vec<DVec3> {
        let corners = [0, 0, 4, 0, 4, 4, 0, 4, 0, 0, 1, 1, 1, 3, 3, 3, 3, 1, 1, 1];
        let at = |x: i32| scale * (f64::from(x) + shift);
        let corner = |&[x, z]: &[i32; 2]| DVec3::new(at(x), at(0), at(z));
        corners.as_chunks().0.iter().map(corner).collect()
    };
    let many = (0..4000).map(|i| TAU * f64::from(i) / 4000.0);
    // Alternate corners of a cube span a regular tetrahedron of edge sqrt(2), whose sides measure sqrt(3)/2.
    let tetrahedron = [[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]].map(|corner| DVec3::from(corner.map(f64::from)));
    for (ring, number, area, tolerance) in [
        (keyhole(1e-9, 0.0), 8, 12e-18, 1e-12),
        (keyhole(1e9, 0.0), 8, 12e18, 1e-12),
        (keyhole(1e14, 0.0), 8, 12e28, 1e-12),
        (keyhole(1.0, 1e9), 8, 12.0, 1e-12),
        (tilted(&circle(many)).0, 3998, PI, 5e-7), // 2 pi^2 / (3 n^2)
        (tetrahedron.to_vec(), 2, 3.0_f64.sqrt(), 1e-14),
    ] {
        let vectors = cut(&ring);
        assert_eq!(vectors.len(), number);
        let got: f64 = vectors.iter().map(|vector| vector.length()).sum();
        assert!((got / area - 1.0).abs() <= tolerance, "{got} {area}");
    }
    // Quads that are bent, down to what rounding hides, have two triangles.
    for bend in [1e-9, 1e-6, 1e-3, 0.1, 1.0] {
        assert_eq!(
            cut(&[
                DVec3::ZERO,
                DVec3::new(1.0, 0.0, bend),
                DVec3::new(1.0, 1.0, 0.0),
                DVec3::Y
            ])
            .len(),
            2
        );
    }
    // A hexagon whose corners are lifted in turn, as seen from above.
    let hexagon = circle((0..6).map(|i| f64::from(i) * FRAC_PI_3))
        .into_iter()
        .zip([0.0, 0.2].into_iter().cycle());
    let lifted = cut(&hexagon.map(|([x, y], z)| DVec3::new(x, y, z)).collect::<Vec<_>>());
    assert_eq!(lifted.len(), 4);
    assert!((lifted.iter().sum::<DVec3>().z - 1.5 * 3.0_f64.sqrt()).abs() <= 1e-14);
    // Edges may cross by less than the digits of the file.
    let sliver = [[0.0, 0.0], [100.0, 0.0], [100.0, 1e-4], [0.0, -1e-4]];
    assert!(triangulate(&tilted(&sliver).0).is_ok());
}

#[test]
fn corners_on_a_straight_edge_stay() {
    // A neighbour has them too: without them there would be a gap between the faces.
    let points = [[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [3, 3], [2, 3], [0, 3], [0, 2]].map(|p| p.map(f64::from));
    for first in 0..points.len() {
        let mut points = points;
        points.rotate_left(first);
        let (ring, normal) = tilted(&points);
        assert!((cut(&ring).iter().sum::<DVec3>() - normal * 9.0).length() <= 1e-13);
        let edges = |[p, q, r]: [u32; 3]| [(p, q), (q, r), (r, p)];
        let edges: Vec<(u32, u32)> = triangulate(&ring).unwrap().into_iter().flat_map(edges).collect();
        assert!((0..9).all(|corner| edges.contains(&(corner, (corner + 1) % 9))));
    }
}

#[test]
fn edges_that_cross_are_refused_with_their_line() {
    for ring in [
        vec![[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]],
        vec![[0.0, 0.0], [3.0, 3.0], [3.0, 0.0], [0.0, 1.0]],
        vec![[0.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        circle((0..5).map(|i| f64::from(i) * 0.8 * PI)),
    ] {
        let corners = lines((2..=ring.len()).map(|index| format!(" {index}")));
        let message = format!("face: expected {CROSSED}, got `1{corners}`");
        assert_refused(polygon_file(&tilted(&ring).0), ring.len() + 1, &message);
    }
    // Corners on a grid of 5 x 5: six ears of 5 in all, equal to the ring; one of 1.5 is turned over.
    let ring = [
        25, 9, 14, 18, 13, 14, 21, 22, 5, 7, 24, 6, 17, 13, 22, 10, 9, 3, 16, 8, 4,
    ];
    let corner = |i: i32| DVec3::new(f64::from((i - 1) % 5), f64::from((i - 1) / 5), 0.0);
    assert_eq!(triangulate(&ring.map(corner)), Err(CROSSED.to_owned()));
}

#[test]
fn rings_beyond_hope_are_given_up_soon() {
    // Cubic algorithms take seconds here: a curve and its reverse, with noise.
    for noise in [1e-15, 1e-9, 1e-3] {
        let corner = |i: i32| {
            let angle = TAU * f64::from(i.min(1499 - i)) / 750.0;
            (1.0 + noise * f64::from(i * 7919 % 1000) / 1000.0) * DVec3::new(angle.cos(), angle.sin(), 0.0)
        };
        let _ = triangulate(&(0..1500).map(corner).collect::<Vec<_>>());
    }
    let almost_laps = circle((0..1500).map(|i| f64::from(i) * (TAU / 3.0 + 1e-5)));
    assert_eq!(triangulate(&tilted(&almost_laps).0), Err(CROSSED.to_owned()));
    let many = (0..5000).map(|i| DVec3::new(f64::from(i), f64::from(i % 7), 0.0));
    assert_eq!(
        triangulate(&many.collect::<Vec<_>>()),
        Err("at most 4096 corners".to_owned())
    );
}
