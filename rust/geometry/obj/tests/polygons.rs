//! Polygons of areas known on paper, and rings that are refused; `properties` has polygons of any shape.

use super::*;

#[test]
fn repeated_corner_leaves_the_triangle() {
    let obj = read(&(CORNERS.to_owned() + "f 5 8 8 1\n"));
    assert_eq!(obj.triangles, [[4, 7, 0]]);
    let obj = read(&(CORNERS.to_owned() + "f 1 1 2 4 4 3 1\n"));
    assert_eq!((obj.triangles.len(), area(&obj)), (2, 1.0));
}

#[test]
fn face_without_area_gives_none() {
    for face in [
        "f 1 1 1 1",
        "f 1 2 1 2",
        "f 1 2 2 1",
        "f 1 2 4 2",
        "f 1 2 4 8 4 2",
        "f 1 1 1 1 1 1",
        "f 1 1 2",
    ] {
        let obj = read(&format!("{CORNERS}{face}\n{FACE}"));
        assert!((area(&obj) - 0.5).abs() <= f64::EPSILON, "{face}");
    }
    let line: Vec<DVec3> = (0..9).map(|i| DVec3::new(0.1, 0.3, -0.7) * f64::from(i)).collect();
    let there_and_back: Vec<DVec3> = line.iter().chain(line[1..8].iter().rev()).copied().collect();
    for ring in [line, there_and_back] {
        let points: Vec<[f64; 3]> = ring.iter().map(DVec3::to_array).collect();
        assert!((area(&read(&(polygon_file(&points) + FACE))) - 0.5).abs() <= 1e-12);
    }
}

#[test]
fn quad_that_is_not_flat_is_cut_along_a_diagonal() {
    // Alternate corners of a cube span a regular tetrahedron of edge sqrt(2), whose sides measure sqrt(3)/2.
    let obj = read(&(CORNERS.to_owned() + "f 1 4 6 7\n"));
    assert_eq!(obj.triangles.len(), 2);
    assert!((area(&obj) - 3.0_f64.sqrt()).abs() <= 1e-14);
    // Bent by 90 degrees along one diagonal: the cut follows the crease that has less area.
    for bend in [1e-9, 1e-6, 1e-3, 0.1, 1.0] {
        let obj = read(&polygon_file(&[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, bend],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
        ]));
        assert_eq!(obj.triangles.len(), 2);
    }
}

#[test]
fn polygon_has_its_area_at_any_scale_and_far_away() {
    let keyhole = |at: &dyn Fn(f64) -> f64| {
        let points = [0, 0, 4, 0, 4, 4, 0, 4, 0, 0, 1, 1, 1, 3, 3, 3, 3, 1, 1, 1].map(|x| at(f64::from(x)));
        points
            .chunks_exact(2)
            .map(|point| [point[0], at(0.0), point[1]])
            .collect::<Vec<_>>()
    };
    let area = |scale: f64, points: &[[f64; 3]]| {
        let points: Vec<DVec3> = points.iter().map(|&point| point.into()).collect();
        let corner = |corner: u32| points[corner as usize] / scale;
        let triangles = triangulate(&points).unwrap().into_iter();
        triangles
            .map(|triangle| triangle.map(corner))
            .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
            .sum::<f64>()
    };
    for scale in [1e-9, 1e9, 1e14] {
        let area = area(scale, &keyhole(&|x| x * scale));
        assert!((area / 12.0 - 1.0).abs() <= 1e-12, "{scale}: {area}");
    }
    assert!((area(1.0, &keyhole(&|x| x + 1e9)) / 12.0 - 1.0).abs() <= 1e-12);
}

#[test]
fn corners_on_a_straight_edge_stay() {
    // A neighbour has them too: without them there would be a gap between the faces.
    let points = [[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [3, 3], [2, 3], [0, 3], [0, 2]].map(|p| p.map(f64::from));
    for first in 0..points.len() {
        let mut points = points;
        points.rotate_left(first);
        let (text, normal) = tilted_file(&points);
        let obj = read(&text);
        assert!((area_vector(&obj) - normal * 9.0).length() <= 1e-13);
        let is_edge = |a: u32, b: u32| {
            obj.triangles
                .iter()
                .any(|&[p, q, r]| [(p, q), (q, r), (r, p)].contains(&(a, b)))
        };
        assert!((0..9).all(|corner| is_edge(corner, (corner + 1) % 9)));
    }
}

#[test]
fn warped_polygon_is_cut_as_seen_along_its_normal() {
    // A hexagon whose corners are lifted in turn; seen from above it has area 3 sqrt(3) / 2.
    let corner = |i: i32| {
        let angle = f64::from(i) * std::f64::consts::FRAC_PI_3;
        [angle.cos(), angle.sin(), 0.2 * f64::from(i % 2)]
    };
    let obj = read(&polygon_file(&(0..6).map(corner).collect::<Vec<_>>()));
    assert_eq!(obj.triangles.len(), 4);
    assert!((area_vector(&obj).z - 1.5 * 3.0_f64.sqrt()).abs() <= 1e-14);
}

#[test]
fn edges_that_cross_are_refused_with_their_line() {
    let bow_tie = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
    let unequal = [[0.0, 0.0], [3.0, 3.0], [3.0, 0.0], [0.0, 1.0]];
    let eight = [[0.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let star: Vec<[f64; 2]> = (0..5)
        .map(|i| f64::from(2 * i) * 0.4 * std::f64::consts::PI)
        .map(|t| [t.cos(), t.sin()])
        .collect();
    for points in [&bow_tie[..], &unequal, &eight, &star] {
        let (text, _) = tilted_file(points);
        let (line, message) = fault(&text);
        assert_eq!(line, points.len() + 1);
        assert!(
            message.contains("expected a polygon whose edges do not cross"),
            "{message}"
        );
    }
}

#[test]
fn ears_that_wind_the_other_way_are_refused_though_their_areas_add_up() {
    // Corners on a grid of 5 x 5: six ears of 5 in all, as much as the ring, of which one of 1.5 is turned over.
    let ring = [
        25, 9, 14, 18, 13, 14, 21, 22, 5, 7, 24, 6, 17, 13, 22, 10, 9, 3, 16, 8, 4,
    ];
    let vertices = lines((0..25).map(|i| format!("v {} {} 0\n", i % 5, i / 5)));
    let (line, message) = fault(&format!(
        "{vertices}f {}\n",
        ring.map(|corner| corner.to_string()).join(" ")
    ));
    assert_eq!(line, 26);
    assert!(
        message.contains("expected a polygon whose edges do not cross"),
        "{message}"
    );
}

#[test]
fn edges_that_cross_by_less_than_the_digits_of_the_file_are_accepted() {
    let sliver = [
        [0.0, 0.0, 0.0],
        [100.0, 0.0, 0.0],
        [100.0, 0.000_1, 0.0],
        [0.0, -0.000_1, 0.0],
    ];
    assert!(area(&read(&polygon_file(&sliver))) < 0.02);
}

#[test]
fn large_convex_polygon_is_cut_quickly() {
    let corner = |i: i32| (std::f64::consts::TAU * f64::from(i) / 4_000.0).sin_cos();
    let points: Vec<[f64; 2]> = (0..4_000).map(corner).map(|(y, x)| [x, y]).collect();
    let obj = read(&tilted_file(&points).0);
    assert!((area(&obj) / std::f64::consts::PI - 1.0).abs() <= 5e-7); // 2 pi^2 / (3 n^2)
}

/// A curve of `num_corners / 2` corners and the way back along it, `noise` beside it.
fn there_and_back(num_corners: usize, noise: f64) -> Vec<DVec3> {
    let corner = |i: usize| {
        let step = i.min(num_corners - 1 - i);
        let radius = 1.0 + noise * ((i * 7919) % 1000) as f64 / 1000.0;
        let angle = std::f64::consts::TAU * step as f64 / (num_corners / 2) as f64;
        radius * DVec3::new(angle.cos(), angle.sin(), 0.0)
    };
    (0..num_corners).map(corner).collect()
}

#[test]
fn hopeless_ring_is_given_up_soon() {
    // What takes cubic time takes several seconds here.
    for noise in [1e-15, 1e-12, 1e-9, 1e-3] {
        let _ = triangulate(&there_and_back(2_000, noise));
    }
    let almost_laps = |i: i32| f64::from(i) * (std::f64::consts::TAU / 3.0 + 1e-5);
    let star: Vec<DVec3> = (0..2_000)
        .map(almost_laps)
        .map(|t| DVec3::new(t.cos(), t.sin(), 0.0))
        .collect();
    assert!(triangulate(&star).unwrap_err().contains("whose edges do not cross"));
}

#[test]
fn polygon_with_too_many_corners_is_refused() {
    let points: Vec<DVec3> = (0..20_000)
        .map(|i| DVec3::new(f64::from(i), f64::from(i % 7), 0.0))
        .collect();
    assert!(triangulate(&points).unwrap_err().contains("at most 4096 corners"));
}
