//! Tests of OBJ files of every kind that people have, and of some that nobody should.

use super::*;

mod faces;
mod names;
mod polygons;
mod properties;
mod text;
mod vertices;

/// One face of vertices of its own.
const FACE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n";
/// Corners of the cube between (0, 0, 0) and (1, 1, 1): vertex 1 + x + 2 y + 4 z.
const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n";
/// Sides of that cube, seen counter-clockwise from outside.
const SIDES: [[usize; 4]; 6] = [
    [1, 3, 4, 2],
    [5, 6, 8, 7],
    [1, 2, 6, 5],
    [3, 7, 8, 4],
    [1, 5, 7, 3],
    [2, 4, 8, 6],
];

fn parse(bytes: &[u8]) -> Result<Obj> {
    parse_obj(bytes, Path::new("part.obj"), &Cancel::default())
}

fn read(text: &str) -> Obj {
    parse(text.as_bytes()).unwrap()
}

/// Line and message of the fault in a file.
fn fault(text: &str) -> (usize, String) {
    match parse(text.as_bytes()) {
        Err(Error::Format { line, message, path }) if path == Path::new("part.obj") => (line, message),
        other => panic!("expected a fault in part.obj, got {other:?}"),
    }
}

/// Statements of the cube's sides with every corner written by `corner`.
fn sides(corner: impl Fn(usize) -> String) -> String {
    lines(SIDES.iter().map(|side| format!("f {}\n", side.map(&corner).join(" "))))
}

fn lines(lines: impl Iterator<Item = String>) -> String {
    lines.collect()
}

fn cube() -> String {
    CORNERS.to_owned() + &sides(|vertex| vertex.to_string())
}

fn triangles(obj: &Obj) -> impl Iterator<Item = [DVec3; 3]> {
    obj.triangles
        .iter()
        .map(|triangle| triangle.map(|vertex| DVec3::from(obj.vertices[vertex as usize])))
}

fn area(obj: &Obj) -> f64 {
    triangles(obj)
        .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
        .sum()
}

/// Sum of the triangles' areas times their normals: the winding shows in its sign.
fn area_vector(obj: &Obj) -> DVec3 {
    triangles(obj).map(|[a, b, c]| (b - a).cross(c - a) / 2.0).sum()
}

#[track_caller]
fn assert_unit_cube(obj: &Obj) {
    assert_eq!(
        obj.vertices,
        [0, 1, 2, 3, 4, 5, 6, 7].map(|i| [i & 1, i >> 1 & 1, i >> 2].map(f64::from))
    );
    assert_eq!(obj.triangles.len(), 12);
    assert_eq!([obj.object.len(), obj.group.len(), obj.material.len()], [12; 3]);
    let volume: f64 = triangles(obj).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    assert!((volume - 1.0).abs() <= 1e-15, "volume {volume}");
    for [a, b, c] in triangles(obj) {
        let outward = (a + b + c) / 3.0 - DVec3::splat(0.5);
        assert!((b - a).cross(c - a).dot(outward) > 0.0, "inward: {a} {b} {c}");
    }
}

/// A file with one vertex per point and one face through all of them.
fn polygon_file(points: &[[f64; 3]]) -> String {
    let vertices = lines(points.iter().map(|[x, y, z]| format!("v {x:?} {y:?} {z:?}\n")));
    let corners: Vec<String> = (1..=points.len()).map(|index| index.to_string()).collect();
    format!("{vertices}f {}\n", corners.join(" "))
}

/// The file of a polygon in a plane that no axis lies in, and the normal of that plane.
fn tilted_file(points: &[[f64; 2]]) -> (String, DVec3) {
    let (u, v) = (DVec3::new(2.0, 2.0, -1.0) / 3.0, DVec3::new(-1.0, 2.0, 2.0) / 3.0);
    let at = |&[x, y]: &[f64; 2]| (DVec3::new(3.0, -2.0, 5.0) + u * x + v * y).to_array();
    (polygon_file(&points.iter().map(at).collect::<Vec<_>>()), u.cross(v))
}

#[test]
fn a_request_to_stop_ends_the_reading() {
    let cancel = Cancel::default();
    cancel.ask();
    for text in [FACE, "f 1 2 3\n", ""] {
        let got = parse_obj(text.as_bytes(), Path::new("part.obj"), &cancel);
        assert!(matches!(got, Err(Error::Interrupted)), "{got:?}");
    }
}
