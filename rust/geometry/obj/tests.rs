//! OBJ files of every kind that people have, and some that nobody should.

use super::*;
use glam::{DQuat, EulerRot};
use proptest::prelude::*;

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
    parse_obj(bytes, Path::new("part.obj"))
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

// Faces and indices.

#[test]
fn only_the_first_number_of_a_corner_counts() {
    let attributes = "vt 0 0\nvn 0 0 1\n";
    for corner in [
        |v| format!("{v}"),
        |v| format!("{v}/1"),
        |v| format!("{v}//1"),
        |v| format!("{v}/1/1"),
    ] {
        assert_unit_cube(&read(&(CORNERS.to_owned() + attributes + &sides(corner))));
    }
    // Texture and normal are not even looked for.
    let odd = "vt 0.5\nvt\nvn x y z\n".to_owned();
    assert_unit_cube(&read(&(odd + CORNERS + &sides(|vertex| format!("{vertex}/99/-7")))));
}

#[test]
fn negative_index_counts_back_from_the_last_vertex_read() {
    assert_unit_cube(&read(
        &(CORNERS.to_owned() + &sides(|vertex| format!("-{}", 9 - vertex))),
    ));
    // -1 is vertex 3 in the first face and vertex 4 in the second.
    let obj = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf 1 -3 -1\n");
    assert_eq!(obj.triangles, [[0, 1, 2], [0, 1, 3]]);
}

#[test]
fn face_may_name_vertices_that_follow_it() {
    assert_unit_cube(&read(&(sides(|vertex| vertex.to_string()) + CORNERS)));
}

#[test]
fn index_outside_the_file_is_refused_with_its_line() {
    let (line, message) = fault(&(CORNERS.to_owned() + "f 1 2 3\n\nf 4 12 2 1\nf 1 2 3\n"));
    assert_eq!(
        (line, message.as_str()),
        (11, "face: expected a vertex index of at most 8, got `12`")
    );
    let (line, message) = fault(&(CORNERS.to_owned() + "f 0 7 8 5\n"));
    assert_eq!(
        (line, message.as_str()),
        (9, "face: expected a vertex index counted from 1, got `0`")
    );
    let (line, message) = fault("v 0 0 0\nv 1 0 0\nf -1 -2 -3\nv 0 1 0\n");
    assert_eq!(
        (line, message.as_str()),
        (3, "face: expected at most 2 vertices back, got `-3`")
    );
}

#[test]
fn corner_that_is_no_index_is_refused_with_its_line() {
    for corner in ["x", "1.5", "1,", "99999999999999999999", "--1", "1/x", "1/1/1/1"] {
        let (line, message) = fault(&(CORNERS.to_owned() + "f 1 2 " + corner));
        assert_eq!(
            (line, message),
            (9, format!("face: expected vertex indices, got `1 2 {corner}`"))
        );
    }
    for corner in ["//1", &isize::MAX.to_string(), &isize::MIN.to_string(), "4294967297"] {
        let (line, message) = fault(&(CORNERS.to_owned() + "f 1 2 " + corner));
        assert_eq!(line, 9);
        assert!(message.starts_with("face: expected "), "{message}");
    }
}

#[test]
fn face_with_fewer_than_three_corners_is_refused_with_its_line() {
    for (face, corners) in [("f", ""), ("f 1", "1"), ("f 1 2", "1 2"), ("f 1 2 # 3", "1 2")] {
        let (line, message) = fault(&(CORNERS.to_owned() + "f 1 2 3\n" + face));
        assert_eq!(
            (line, message),
            (10, format!("face: expected at least 3 corners, got `{corners}`"))
        );
    }
}

#[test]
fn message_names_file_and_line_and_stays_short() {
    let error = parse(b"v 0 0 0\nf 1 1\n").unwrap_err();
    assert_eq!(
        error.to_string(),
        "part.obj:2: face: expected at least 3 corners, got `1 1`"
    );
    assert!(fault(&("v 0 0 ".to_owned() + &"\u{e9}".repeat(100_000))).1.len() < 200);
}

#[test]
fn missing_file_is_an_io_error_that_names_it() {
    let error = read_obj(Path::new("/nowhere/part.obj")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
    assert!(error.to_string().starts_with("/nowhere/part.obj: "));
}

#[test]
fn file_on_disk_reads_as_the_same_text_in_memory() {
    let path = std::env::temp_dir().join(format!("radarcore-cube-{}.obj", std::process::id()));
    std::fs::write(&path, cube()).unwrap();
    let obj = read_obj(&path);
    std::fs::remove_file(&path).unwrap();
    assert_eq!(obj.unwrap(), read(&cube()));
}

// Vertices.

#[test]
fn vertices_keep_file_order_and_count() {
    // Unused, equal and late vertices stay where they are, whatever the faces use first.
    let obj = read("v 9 9 9\nv 0 0 0\nf 5 4 2\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 8 8 8\n");
    let expected = [[9.0; 3], [0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [8.0; 3]];
    assert_eq!(obj.vertices, expected);
    assert_eq!(obj.triangles, [[4, 3, 1]]);
    for num_vertices in 3..6 {
        let obj = read(&("v 1 2 3\n".repeat(num_vertices) + "f 1 2 3\n"));
        assert_eq!((obj.vertices.len(), obj.triangles.len()), (num_vertices, 1));
    }
}

#[test]
fn numbers_after_the_third_are_ignored() {
    for extra in [
        " 1",
        " 0",
        " 0.5",
        " 0.1 0.2 0.3",
        " 0.1 0.2",
        " 1 2 3 4 5",
        " x",
        " # comment",
    ] {
        let vertices = CORNERS.replace('\n', &format!("{extra}\n"));
        assert_unit_cube(&read(&cube().replace(CORNERS, &vertices)));
    }
    let attributes = "vt 0\nvt 0 0 0\nvt x\nvn 1\nvn\n";
    assert_unit_cube(&read(&(attributes.to_owned() + &cube())));
}

#[test]
fn malformed_vertex_is_refused_with_its_line() {
    for values in [
        "",
        "1",
        "1 2",
        "0 3.1+e2 0",
        "1,5 0 0",
        "0 0 0x10",
        "0 1e 0",
        "0 1_000 0",
        "0 1.0f 0",
    ] {
        let (line, message) = fault(&format!("v 0 0 0\n# comment\nv {values} # 3\n"));
        assert_eq!(
            (line, message),
            (3, format!("vertex: expected three numbers, got `{values}`"))
        );
    }
}

#[test]
fn coordinate_that_is_not_finite_or_from_1e15_on_is_refused_with_its_line() {
    for number in [
        "nan",
        "-inf",
        "1e999",
        "1e15",
        "-1e15",
        "1e+0000308",
        "1000000000000000",
    ] {
        // The vertex need not have a face.
        for text in [FACE.to_owned() + "\nv 0 0 ", "v 0 0 0\n#\n\n\n\nv 0 0 ".to_owned()] {
            let (line, message) = fault(&format!("{text}{number}\n{FACE}"));
            let expected = "finite numbers between -1e15 and 1e15";
            assert_eq!(
                (line, message),
                (6, format!("vertex: expected {expected}, got `0 0 {number}`"))
            );
        }
    }
    let obj = read(&(FACE.to_owned() + "v -9.9e14 9.9e14 1e-308\nv 0.1 +1 123456789.125\n"));
    assert_eq!(
        obj.vertices[3..],
        [[-9.9e14, 9.9e14, 1e-308], [0.1, 1.0, 123_456_789.125]]
    );
}

// Text.

#[test]
fn blanks_line_ends_and_comments_do_not_matter() {
    let cube = cube();
    for text in [
        cube.replace(' ', "   "),
        cube.replace(' ', "\t"),
        cube.replace('\n', " \t \n"),
        cube.replace('\n', "\n  "),
        cube.replace('\n', "\r\n"),
        cube.replace('\n', "\r"),
        cube.replace('\n', "\n\n# f 1 2 999\n\n"),
        cube.replace('\n', " # f 1 2 999\n"),
        cube.trim_end().to_owned(),
    ] {
        assert_unit_cube(&read(&text));
    }
}

#[test]
fn crlf_counts_as_one_line() {
    assert_eq!(fault("v 0 0 0\r\n\r\nf 1\r\n").0, 3);
}

#[test]
fn file_without_faces_is_refused() {
    let expected = "file: expected faces that have an area, got none";
    for text in [
        "",
        "\n",
        "\r\n",
        " ",
        "# nothing",
        "\\",
        "\u{feff}",
        "v 1 2 3",
        "o a",
        "l 1 2",
        "g\r\r",
    ] {
        assert_eq!(fault(text).1, expected);
    }
    assert_eq!(fault(CORNERS), (8, expected.to_owned()));
}

#[test]
fn utf16_and_byte_order_marks_are_decoded() {
    let text = "o W\u{fc}rfel \u{1f4e6}\r\n".to_owned() + &cube().replace('\n', "\r\n");
    let units = || std::iter::once(0xfeff).chain(text.encode_utf16());
    let little: Vec<u8> = units().flat_map(u16::to_le_bytes).collect();
    let big: Vec<u8> = units().flat_map(u16::to_be_bytes).collect();
    for bytes in [
        text.clone().into_bytes(),
        format!("\u{feff}{text}").into_bytes(),
        little,
        big,
    ] {
        let obj = parse(&bytes).unwrap();
        assert_unit_cube(&obj);
        assert_eq!(obj.object_names, ["W\u{fc}rfel \u{1f4e6}"]);
    }
}

#[test]
fn marks_between_files_put_together_are_skipped() {
    let obj = read("\u{feff}v 0 0 0\nv 1 0 0\n\u{feff}# second\n\u{feff}v 0 1 0\n\u{feff}f 1 2 3\n");
    assert_eq!((obj.vertices.len(), obj.triangles.len()), (3, 1));
}

#[test]
fn file_with_nul_is_refused_with_its_line() {
    let utf16: Vec<u8> = cube().encode_utf16().flat_map(u16::to_le_bytes).collect();
    let utf32: Vec<u8> = format!("\u{feff}{}", cube())
        .chars()
        .flat_map(|c| u32::from(c).to_le_bytes())
        .collect();
    let object_file = b"\x64\x86\x03\x00\xd6\x2e\x00\x00.text\x00\x00\x00"; // of a compiler, which are .obj too
    let gzip = b"\x1f\x8b\x08\x00\x00\x00\x00\x00";
    let expected = "text: expected UTF-8, or UTF-16 with a byte-order mark, got a NUL character";
    for bytes in [&utf16, &utf32, &object_file[..], gzip] {
        assert_eq!(parse(bytes).unwrap_err().to_string(), format!("part.obj:1: {expected}"));
    }
    // A file whose end was never written.
    assert_eq!(fault(&(cube() + "f 1 2\0\0\0\0")), (15, expected.to_owned()));
}

#[test]
fn message_is_one_line_of_printable_characters() {
    assert_eq!(
        fault("v 0 0 \u{1b}[2J\u{7}\u{202e}").1,
        "vertex: expected three numbers, got `0 0 \\u{1b}[2J\\u{7}\\u{202e}`"
    );
}

#[test]
fn lines_of_a_million_characters_are_read() {
    let long = |text: &str| text.repeat(1_000_000 / text.len());
    let faces = sides(|vertex| vertex.to_string());
    for text in [
        format!("# {}\n", long("f 1 2 999 ")),
        format!("# {}\n", long("\\ ")),
        format!("g {}\n", long("name")),
        format!("mtllib {}\n", long("a.mtl ")),
        format!("l{}\n", long(" 1 2")),
        format!("v 0 0 0.{}\n", long("0")),
        long("\\\n") + "\n",
        long(" "),
    ] {
        assert_eq!(read(&(CORNERS.to_owned() + &text + &faces)).triangles.len(), 12);
    }
    let obj = read(&format!("{CORNERS}f 1{} 4 3\n", long(" \\\n 2")));
    assert_eq!((obj.triangles.len(), area(&obj)), (2, 1.0));
}

#[test]
fn latin1_in_comments_and_names_does_no_harm() {
    let bytes = [b"# caf\xe9\ng caf\xe9\n", cube().as_bytes()].concat();
    let obj = parse(&bytes).unwrap();
    assert_unit_cube(&obj);
    assert_eq!(obj.group_names, ["caf\u{fffd}"]);
}

#[test]
fn backslash_joins_lines_and_keeps_their_numbers() {
    assert_unit_cube(&read(&cube().replace(' ', " \\\n").replace("4 \\", "4 \\ \r")));
    // The fault of a joined statement is at its first line, and the lines after it keep their numbers.
    assert_eq!(fault("v 0 0 0\nf 1 \\\n 1 \\\n 2\n").0, 2);
    assert_eq!(fault("v 0 0 \\\n 0\nf 1 1\n").0, 3);
}

#[test]
fn comment_that_ends_in_a_backslash_hides_nothing() {
    assert_unit_cube(&read(&("# exported to C:\\parts\\\n".to_owned() + &cube())));
    assert_unit_cube(&read(&cube().replace('\n', " # see C:\\parts\\\n")));
}

#[test]
fn points_lines_and_unknown_words_are_ignored() {
    // tobj takes lines of three points and more for faces.
    let noise =
        "p 1 2\nl 1 2 3\nl 1 2 3 4\nl 1\nl 9\ns off\nvp 0 0\ncstype bezier\ncurv 0 1 1 2\nend\nfoo bar\nvertex 1\n";
    assert_unit_cube(&read(&(noise.to_owned() + &cube() + noise)));
}

// Names.

#[test]
fn material_file_need_not_exist() {
    for library in [
        "missing.mtl",
        "./missing.mtl",
        "wrong.mat",
        "with blanks.mtl",
        "",
        "/nowhere/a.mtl b.mtl",
    ] {
        let cube = cube();
        assert_unit_cube(&read(&format!("mtllib {library}\ng box\n{cube}")));
        assert_unit_cube(&read(&format!("g box\nmtllib {library}\nusemtl undefined\n{cube}")));
    }
}

#[test]
fn name_is_the_rest_of_the_line() {
    let obj = read(&(CORNERS.to_owned() + "o  big  box \t\ng left right\nusemtl\tred # 2 paint\nf 1 2 3\n"));
    assert_eq!(obj.object_names, ["big  box"]);
    assert_eq!(obj.group_names, ["left right"]);
    assert_eq!(obj.material_names, ["red # 2 paint"]);
}

#[test]
fn triangles_inherit_the_names_of_their_face() {
    let faces = "f 1 2 4 3\nusemtl red\ng a\nf 1 2 3\no box\ng\nusemtl blue\nusemtl red\nf 1 2 5\n\
                 g a\nusemtl blue\nf 1 2 4 3 3\n";
    let obj = read(&(CORNERS.to_owned() + faces));
    assert_eq!(obj.triangles.len(), 6);
    let names = |list: &[String], index: &[u32]| index.iter().map(|&i| list[i as usize].clone()).collect::<Vec<_>>();
    assert_eq!(names(&obj.object_names, &obj.object), ["", "", "", "box", "box", "box"]);
    assert_eq!(names(&obj.group_names, &obj.group), ["", "", "a", "", "a", "a"]);
    assert_eq!(
        names(&obj.material_names, &obj.material),
        ["", "", "red", "red", "blue", "blue"]
    );
}

#[test]
fn name_used_twice_is_listed_once_and_name_without_face_not_at_all() {
    let obj = read(&(CORNERS.to_owned() + "usemtl a\nf 1 2 3\nusemtl b\nusemtl a\nf 1 2 4\nusemtl c\n"));
    assert_eq!((obj.material, obj.material_names), (vec![0, 0], vec!["a".to_owned()]));
    assert_eq!(
        (obj.object_names, obj.group_names),
        (vec![String::new()], vec![String::new()])
    );
}

#[test]
fn hundreds_of_thousands_of_names_are_read() {
    // In quadratic time these would take minutes.
    let groups = |i: usize| format!("g {i}\n");
    assert_eq!(read(&(lines((0..300_000).map(groups)) + FACE)).group_names, ["299999"]);
    let faces = lines((0..300_000).map(|i| groups(i) + "f 1 2 3\n"));
    let obj = read(&(CORNERS.to_owned() + &faces));
    assert_eq!((obj.triangles.len(), obj.group_names.len()), (300_000, 300_000));
    assert!(obj.group.iter().zip(0..).all(|(&group, i)| group == i));
}

// Polygons. Areas are known on paper; a fan from the first corner would miss them by far more than 1e-12.

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
fn concave_quad_is_cut_inside_whichever_corner_comes_first() {
    let dart = [[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]];
    for first in 0..4 {
        let mut points = dart;
        points.rotate_left(first);
        let (text, normal) = tilted_file(&points);
        let obj = read(&text);
        assert!((area(&obj) - 0.5).abs() <= 1e-14);
        assert!((area_vector(&obj) - normal * 0.5).length() <= 1e-14);
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
fn concave_polygon_keeps_area_and_winding() {
    // A comb of 20 teeth: a bar of 39 x 1 and teeth of 1 x 2.
    let mut points = vec![[39.0, 0.0], [0.0, 0.0]];
    points.reverse();
    for tooth in (0..20).rev() {
        let x = f64::from(2 * tooth);
        points.extend([[x + 1.0, 3.0], [x, 3.0]]);
        if tooth > 0 {
            points.extend([[x, 1.0], [x - 1.0, 1.0]]);
        }
    }
    let true_area = 39.0 + 20.0 * 2.0;
    for backwards in [false, true] {
        if backwards {
            points.reverse();
        }
        let (text, normal) = tilted_file(&points);
        let obj = read(&text);
        let winding = if backwards { -1.0 } else { 1.0 };
        assert!((area(&obj) / true_area - 1.0).abs() <= 1e-12, "{}", area(&obj));
        assert!((area_vector(&obj) / true_area - normal * winding).length() <= 1e-12);
    }
}

/// A ring round the square of side 4 that enters along an edge, rounds the hole of side 2, and leaves by that edge.
const KEYHOLE: &str = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 1 1 0\nv 1 3 0\nv 3 3 0\nv 3 1 0\n\
                       f 1 2 3 4 1 5 6 7 8 5\n";

#[test]
fn ring_with_a_doubled_edge_leaves_its_hole_open() {
    let obj = read(KEYHOLE);
    assert!((area(&obj) / 12.0 - 1.0).abs() <= 1e-12, "{}", area(&obj));
    assert!((area_vector(&obj) / 12.0 - DVec3::Z).length() <= 1e-12);
    for [a, b, c] in triangles(&obj) {
        let centre = (a + b + c) / 3.0 - DVec3::new(2.0, 2.0, 0.0);
        assert!(centre.abs().max_element() > 1.0, "a triangle covers the hole");
    }
}

#[test]
fn annulus_of_66_corners_has_its_area() {
    // Two circles of 32 corners, joined by an edge that the ring runs along twice.
    let circle = |radius: f64, i: i32| {
        let angle = std::f64::consts::TAU * f64::from(i) / 32.0;
        [radius * angle.cos(), radius * angle.sin()]
    };
    let mut points: Vec<[f64; 2]> = (0..=32).map(|i| circle(1.0, i % 32)).collect();
    points.extend((0..=32).rev().map(|i| circle(0.9, i % 32)));
    let (text, normal) = tilted_file(&points);
    let true_area = 16.0 * (std::f64::consts::TAU / 32.0).sin() * (1.0 - 0.9 * 0.9);
    let obj = read(&text);
    assert_eq!(points.len(), 66);
    assert!(
        (area(&obj) / true_area - 1.0).abs() <= 1e-12,
        "{}",
        area(&obj) / true_area - 1.0
    );
    assert!((area_vector(&obj) / true_area - normal).length() <= 1e-12);
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
fn ring_of_many_laps_is_refused() {
    let text = CORNERS.to_owned() + &format!("f{}\n", " 1 3 4 2".repeat(1_000));
    assert!(fault(&text).1.contains("expected a polygon whose edges do not cross"));
}

#[test]
fn hopeless_ring_is_given_up_soon() {
    // What takes cubic time takes half a minute here.
    for noise in [1e-15, 1e-12, 1e-9, 1e-3] {
        let _ = triangulate(&there_and_back(4_000, noise));
    }
    let almost_laps = |i: i32| f64::from(i) * (std::f64::consts::TAU / 3.0 + 1e-5);
    let star: Vec<DVec3> = (0..4_000)
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

// Anything.

proptest! {
    #[test]
    fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        check(&bytes)?;
    }

    #[test]
    fn no_words_make_it_panic(tokens in prop::collection::vec(token(), 0..200), mark in mark()) {
        let text = CORNERS.to_owned() + &tokens.concat();
        check(&[mark, text.into_bytes()].concat())?;
    }

    #[test]
    fn no_statements_make_it_panic(statements in prop::collection::vec(statement(), 0..30)) {
        check((CORNERS.to_owned() + &statements.concat()).as_bytes())?;
    }

    #[test]
    fn encoding_line_ends_blanks_and_comments_never_matter(statements in prop::collection::vec(statement(), 0..30)) {
        let text = FACE.to_owned() + CORNERS + &statements.concat().replace(['\r', '\\'], "\n");
        let result_of = |bytes: &[u8]| parse(bytes).map_err(|error| error.to_string());
        let result = |text: &str| result_of(text.as_bytes());
        let expected = result(&text);
        let utf16 = || std::iter::once(0xfeff).chain(text.encode_utf16());
        prop_assert_eq!(&result_of(&utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>()), &expected);
        prop_assert_eq!(&result_of(&utf16().flat_map(u16::to_be_bytes).collect::<Vec<_>>()), &expected);
        prop_assert_eq!(&result(&text.replace('\n', "\r\n")), &expected);
        prop_assert_eq!(&result(&text.replace('\n', "\r")), &expected);
        prop_assert_eq!(&result(&text.replace('\n', "\t \n ")), &expected);
        prop_assert_eq!(&result(&(text.clone() + "\n# f 1 2 999")), &expected);
        let without_line = |result: std::result::Result<Obj, String>| {
            result.map_err(|error| error.trim_start_matches(|c: char| c != ' ').to_owned())
        };
        prop_assert_eq!(without_line(result(&text.replace('\n', "\n\n#\n"))), without_line(expected));
    }

    #[test]
    fn any_star_shaped_polygon_is_cut_whole(radii in prop::collection::vec(0.05..1.0, 5..150)) {
        let step = std::f64::consts::TAU / radii.len() as f64;
        let corner = |(i, radius): (usize, &f64)| [radius * (step * i as f64).cos(), radius * (step * i as f64).sin()];
        let points: Vec<[f64; 2]> = radii.iter().enumerate().map(corner).collect();
        let next = radii.iter().cycle().skip(1);
        let true_area: f64 = radii.iter().zip(next).map(|(a, b)| a * b * step.sin() / 2.0).sum();
        let (text, normal) = tilted_file(&points);
        let obj = read(&text);
        prop_assert!((area(&obj) / true_area - 1.0).abs() <= 1e-12);
        prop_assert!((area_vector(&obj) / true_area - normal).length() <= 1e-12);
    }

    #[test]
    fn any_simple_polygon_in_any_plane_is_cut_whole(
        mut points in prop::collection::vec(prop::array::uniform2(0.0..1.0), 3..40),
        turns in prop::array::uniform3(0.0..std::f64::consts::TAU),
        origin in prop::array::uniform3(-1.0..1.0),
    ) {
        untangle(&mut points);
        let plane = DQuat::from_euler(EulerRot::XYZ, turns[0], turns[1], turns[2]);
        let (u, v, normal) = (plane * DVec3::X, plane * DVec3::Y, plane * DVec3::Z);
        let origin = DVec3::from(origin);
        let ring: Vec<[f64; 3]> = points.iter().map(|&[x, y]| (origin + u * x + v * y).to_array()).collect();
        let next = points.iter().cycle().skip(1);
        let true_area = points.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0;

        // No part of the area is missing, none is counted twice, and the winding is that of the ring.
        let rounding = 1e-13; // of coordinates up to 3 in 38 triangles
        let obj = read(&polygon_file(&ring));
        prop_assert_eq!(obj.triangles.len(), points.len() - 2);
        prop_assert!((area(&obj) - true_area.abs()).abs() <= rounding, "{} {}", area(&obj), true_area);
        prop_assert!((area_vector(&obj) - normal * true_area).length() <= rounding);
    }

    #[test]
    fn any_perforated_plate_keeps_its_holes(
        columns in 1..6_i32,
        holes in prop::collection::vec((0..6_i32, 0.01..0.49), 1..6),
        first in any::<prop::sample::Index>(),
    ) {
        // A hole is a square on its corner; edges along the middle of each row lead from the border to its holes.
        let rows = i32::try_from(holes.len()).unwrap();
        let mut points: Vec<[f64; 2]> = [[0, 0], [columns, 0], [columns, rows], [0, rows]].map(|p| p.map(f64::from)).into();
        let mut true_area = f64::from(columns * rows);
        for (row, &(num_holes, half)) in (0..rows).rev().zip(&holes) {
            let (y, num_holes) = (f64::from(row) + 0.5, num_holes.min(columns));
            let x = |hole: i32| f64::from(hole) + 0.5;
            points.push([0.0, y]);
            points.extend((0..num_holes).flat_map(|i| [[x(i) - half, y], [x(i), y + half], [x(i) + half, y]]));
            points.extend((0..num_holes).rev().flat_map(|i| [[x(i) + half, y], [x(i), y - half], [x(i) - half, y]]));
            points.push([0.0, y]);
            true_area -= f64::from(num_holes) * 2.0 * half * half;
        }
        let first = first.index(points.len());
        points.rotate_left(first);
        let (text, normal) = tilted_file(&points);
        let obj = read(&text);
        prop_assert!((area(&obj) / true_area - 1.0).abs() <= 1e-12);
        prop_assert!((area_vector(&obj) / true_area - normal).length() <= 1e-12);
    }

    #[test]
    fn any_face_is_refused_or_has_the_area_of_its_ring(corners in prop::collection::vec(1..26_usize, 3..40)) {
        // Corners on a grid of 5 x 5 meet, repeat, double back and cross.
        let vertices = lines((0..25).map(|i| format!("v {} {} 0\n", i % 5, i / 5)));
        let ring: Vec<String> = corners.iter().map(usize::to_string).collect();
        if let Some(obj) = check(format!("{vertices}f {}\n", ring.join(" ")).as_bytes())? {
            prop_assert!((area(&obj) - area_vector(&obj).length()).abs() <= 1e-9);
        }
    }
}

fn mark() -> impl Strategy<Value = Vec<u8>> {
    prop::sample::select(vec![vec![], vec![0xef, 0xbb, 0xbf], vec![0xff, 0xfe], vec![0xfe, 0xff]])
}

fn token() -> impl Strategy<Value = String> {
    let word = [
        "v",
        "f",
        "o",
        "g",
        "usemtl",
        "mtllib",
        "l",
        "p",
        "vn",
        "#",
        "\\",
        "\\\n",
        "\r",
        "\n",
        "\nf ",
        "\nf 1 2 4 3 ",
        "\nv 1 2 3",
        "1",
        "2",
        "8",
        "-1",
        "-8",
        "0",
        "9",
        "1/2/3",
        "1//",
        "/",
        "1e308",
        "-1e308",
        "1e-320",
        "nan",
        "\0",
        "\u{a0}",
        "\u{feff}",
    ];
    (prop::sample::select(word.to_vec()), any::<bool>())
        .prop_map(|(word, glue)| word.to_owned() + if glue { "" } else { " " })
}

/// One statement, now and then a malformed one.
fn statement() -> impl Strategy<Value = String> {
    let any_of = |words: &[&'static str]| prop::sample::select(words.to_vec()).prop_map(str::to_owned);
    let number = prop_oneof![
        100 => (-4..4_i32).prop_map(|number| number.to_string()),
        10 => any_of(&["+.5", "-1.", "2.5e-1", "1e-400", "-9e14", "00000000000000000000000000000000000000001"]),
        1 => any_of(&["nan", "inf", "1e15", "1e308", "-1e999", "0x1", "1,5", "\u{b2}", "\0", "#"]),
    ];
    let corner = prop_oneof![
        200 => (1..9_i32).prop_map(|index| index.to_string()),
        50 => (-8..0_i32).prop_map(|index| index.to_string()),
        50 => (1..9_i32, any_of(&["/", "//", "/1", "//-1", "/1/1", "/x/9"])).prop_map(|(index, rest)| format!("{index}{rest}")),
        1 => (9..20_i32).prop_map(|index| index.to_string()),
        1 => any_of(&["0", "-0", "-9", "4294967297", "18446744073709551617", "-9223372036854775808", "/1", "1.0", "#"]),
    ];
    let num_corners = prop_oneof![60 => Just(3), 1 => 2..9_usize];
    let corners = num_corners.prop_flat_map(move |number| prop::collection::vec(corner.clone(), number));
    let laps = prop_oneof![20 => Just(1), 1 => 1..2000_usize];
    let keyword = any_of(&["o", "g", "usemtl", "mtllib", "call"]);
    let name = any_of(&[
        "",
        "a",
        "b",
        "a b",
        "#",
        "\u{1f4e6}",
        "\u{feff}a",
        "a\\b",
        "v 1 2 3",
        "f 1 2 3",
    ]);
    let other = [
        "",
        "l 1 2",
        "p 1",
        "vt 0",
        "vn 0 0 1",
        "s off",
        "# f 1 2 999",
        "end",
        "V",
        "\t",
        "\\",
    ];
    let text = prop_oneof![
        3 => prop::collection::vec(number, 3..5).prop_map(|numbers| format!("v {}", numbers.join(" "))),
        6 => (corners, laps).prop_map(|(corners, laps)| "f".to_owned() + &format!(" {}", corners.join(" ")).repeat(laps)),
        3 => (keyword, name).prop_map(|(keyword, name)| format!("{keyword} {name}")),
        1 => any_of(&other),
    ];
    let end = prop_oneof![
        10 => any_of(&["\n"]),
        1 => any_of(&["\r\n", "\r", "\n\n", " # x\n", " \\\n", " # \\\n", "\n\r\n"]),
    ];
    (text, end).prop_map(|(text, end)| text + &end)
}

/// Reverses parts of a ring until its edges do not cross: each time it becomes shorter.
fn untangle(ring: &mut [[f64; 2]]) {
    let side = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let cross = |a, b, c, d| side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0;
    let crossing = |ring: &[[f64; 2]]| {
        let edges = (0..ring.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        edges
            .into_iter()
            .find(|&(i, j)| cross(ring[i], ring[i + 1], ring[j], ring[(j + 1) % ring.len()]))
    };
    while let Some((i, j)) = crossing(ring) {
        ring[i + 1..=j].reverse();
    }
}

/// Content of a file, checked to be within bounds; none if it is refused with a fault in one of its lines.
fn check(bytes: &[u8]) -> std::result::Result<Option<Obj>, TestCaseError> {
    let obj = match parse(bytes) {
        Ok(obj) => obj,
        Err(Error::Format { line, message, .. }) => {
            prop_assert!(line >= 1 && line <= bytes.len() + 1);
            prop_assert!(message.contains(": expected ") && message.len() < 500, "{}", message);
            prop_assert!(!message.contains(char::is_control), "{}", message);
            return Ok(None);
        }
        Err(error) => return Err(TestCaseError::fail(error.to_string())),
    };
    prop_assert!(obj.vertices.len() <= bytes.len() && obj.triangles.len() <= bytes.len());
    let num_triangles = obj.triangles.len();
    prop_assert!(obj.vertices.iter().flatten().all(|x| x.is_finite()));
    prop_assert!(
        obj.triangles
            .iter()
            .flatten()
            .all(|&vertex| (vertex as usize) < obj.vertices.len())
    );
    for (index, names) in [
        (&obj.object, &obj.object_names),
        (&obj.group, &obj.group_names),
        (&obj.material, &obj.material_names),
    ] {
        prop_assert_eq!(index.len(), num_triangles);
        prop_assert!(index.iter().all(|&name| (name as usize) < names.len()));
    }
    Ok(Some(obj))
}
