//! Tests of OBJ files of every kind that people have, and of some that nobody should.

use super::*;

mod polygons;
mod properties;

/// One face of vertices of its own.
const FACE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n";
/// Corners of the cube between (0, 0, 0) and (1, 1, 1): vertex 1 + x + 2 y + 4 z.
const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n";
/// Sides of that cube, seen counter-clockwise from outside.
const SIDES: &str = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

const NO_FACES: &str = "file: expected faces that have an area, got none";
const NUL: &str = "text: expected UTF-8, or UTF-16 with a byte-order mark, got a NUL character";

fn parse(bytes: &[u8]) -> Result<Obj> {
    parse_obj(bytes, Path::new("part.obj"), &Cancel::default())
}

fn read(text: &str) -> Obj {
    parse(text.as_bytes()).unwrap()
}

fn lines(lines: impl Iterator<Item = String>) -> String {
    lines.collect()
}

#[track_caller]
fn assert_refused(text: impl AsRef<[u8]>, line: usize, message: &str) {
    let got = parse(text.as_ref()).err().map(|error| error.to_string());
    assert_eq!(got, Some(format!("part.obj:{line}: {message}")));
}

/// Every triangle's area times its normal: the winding shows in the sign.
fn area_vectors(obj: &Obj) -> Vec<DVec3> {
    let vertex = |vertex: u32| DVec3::from(obj.vertices[vertex as usize]);
    let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a) / 2.0;
    obj.triangles
        .iter()
        .map(|triangle| normal(triangle.map(vertex)))
        .collect()
}

fn area(obj: &Obj) -> f64 {
    area_vectors(obj).iter().map(|vector| vector.length()).sum()
}

/// A file with one vertex per point and one face through all of them.
fn polygon_file(points: &[DVec3]) -> String {
    let vertices = lines(points.iter().map(|p| format!("v {:?} {:?} {:?}\n", p.x, p.y, p.z)));
    let corners = lines((1..=points.len()).map(|index| format!(" {index}")));
    format!("{vertices}f{corners}\n")
}

/// Polygon in a plane that no axis lies in, and the normal of that plane.
fn tilted(points: &[[f64; 2]]) -> (Vec<DVec3>, DVec3) {
    let (u, v) = (DVec3::new(2.0, 2.0, -1.0) / 3.0, DVec3::new(-1.0, 2.0, 2.0) / 3.0);
    let at = |[x, y]: &[f64; 2]| DVec3::new(3.0, -2.0, 5.0) + u * *x + v * *y;
    (points.iter().map(at).collect(), u.cross(v))
}

/// Object, group and material of every triangle, and number of the names that are listed.
fn names(obj: &Obj) -> (String, usize) {
    let name = |i: usize| {
        let object = &obj.object_names[obj.object[i] as usize];
        let group = &obj.group_names[obj.group[i] as usize];
        format!("{object}/{group}/{}", obj.material_names[obj.material[i] as usize])
    };
    let num_listed = obj.object_names.len() + obj.group_names.len() + obj.material_names.len();
    let names: Vec<String> = (0..obj.triangles.len()).map(name).collect();
    (names.join(", "), num_listed)
}

#[test]
fn every_spelling_of_a_cube_is_the_same_cube() {
    let cube = CORNERS.to_owned() + SIDES;
    let expected = read(&cube);
    assert_eq!(expected.vertices.len(), 8);
    assert_eq!(expected.triangles.len(), 12);
    let vectors = area_vectors(&expected);
    assert!(vectors.iter().all(|vector| vector.length() == 0.5));
    let corner = |triangle: &[u32; 3]| DVec3::from(expected.vertices[triangle[0] as usize]);
    let volume = |(triangle, vector): (_, &DVec3)| corner(triangle).dot(*vector) / 3.0;
    let volume: f64 = expected.triangles.iter().zip(&vectors).map(volume).sum();
    assert!((volume - 1.0).abs() < 1e-15, "{volume}");

    let corners = |corner: &dyn Fn(u32) -> String| {
        let spelled = |c: char| c.to_digit(10).map_or(c.to_string(), corner);
        CORNERS.to_owned() + &SIDES.chars().map(spelled).collect::<String>()
    };
    let long = |text: &str| text.repeat(1_000_000 / text.len());
    // tobj takes lines of three points and more for faces.
    let noise =
        "p 1 2\nl 1 2 3\nl 1 2 3 4\nl 1\nl 9\ns off\nvp 0 0\ncstype bezier\ncurv 0 1 1 2\nend\nfoo bar\nvertex 1\n";
    let mut texts = vec![
        // Texture and normal are not even looked for.
        corners(&|vertex| format!("{vertex}/1")),
        corners(&|vertex| format!("{vertex}//1")),
        corners(&|vertex| format!("{vertex}/99/-7")),
        format!("vt 0\nvt 0 0 0\nvt x\nvn 1\nvn x y z\nvn\n{cube}"),
        corners(&|vertex| format!("-{}", 9 - vertex)),
        // Faces may name vertices that follow them.
        SIDES.to_owned() + CORNERS,
        format!("{noise}{cube}{noise}"),
        // A comment may end in a backslash by accident, as in a path.
        cube.replace(' ', " \\\n").replace("4 \\", "4 \\ \r"),
        format!("# exported to C:\\parts\\\n{cube}"),
        cube.replace('\n', " # see C:\\parts\\\n"),
        // Files put together have marks in their midst.
        format!("\u{feff}{}", cube.replace('f', "\u{feff}# second\n\u{feff}f")),
    ];
    let extra_numbers = ["1", "0", "0.5", "0.1 0.2 0.3", "0.1 0.2", "1 2 3 4 5", "x", "# comment"];
    texts.extend(extra_numbers.map(|extra| CORNERS.replace('\n', &format!(" {extra}\n")) + SIDES));
    let libraries = "missing.mtl|./missing.mtl|wrong.mat|with blanks.mtl||/nowhere/a.mtl b.mtl".split('|');
    texts.extend(libraries.map(|library| format!("mtllib {library}\nusemtl undefined\n{cube}")));
    // In quadratic time these would take minutes.
    let lines = [
        format!("# {}\n", long("f 1 2 999 ")),
        format!("# {}\n", long("\\ ")),
        format!("g {}\n", long("name")),
        format!("mtllib {}\n", long("a.mtl ")),
        format!("l{}\n", long(" 1 2")),
        long("\\\n") + "\n",
        long(" "),
        lines((0..100_000).map(|i| format!("g {i}\n"))),
    ];
    texts.extend(lines.map(|line| CORNERS.to_owned() + &line + SIDES));
    texts.push(format!("v 0 0 0.{}{}", long("0"), cube.trim_start_matches("v 0 0 0")));
    texts.push(SIDES.replacen("f 1", &format!("f 1{}", long(" \\\n 1")), 1) + CORNERS);
    for text in texts {
        let obj = read(&text);
        let is_same = obj.vertices == expected.vertices && obj.triangles == expected.triangles;
        assert!(is_same, "{text:.300}");
    }
}

#[test]
fn vertices_keep_file_order_and_corners_their_vertices() {
    let face = |statements: &str| FACE.to_owned() + statements;
    let of_cube = |statements: &str| CORNERS.to_owned() + statements;
    for (text, triangles) in [
        // Unused, equal and late vertices stay where they are, whatever the faces use first.
        (
            face("v 0 0 0\nf 7 4 2\nv 1 0 0\nv 0 9 0\nv 8 8 8\n"),
            &[[0, 1, 2], [6, 3, 1]][..],
        ),
        ("v 1 2 3\n".repeat(4) + "f 1 2 3\n", &[[0, 1, 2]]),
        (face("v -9.9e14 9.9e14 1e-308\nv 0.1 +1 123456789.125\n"), &[[0, 1, 2]]),
        // -1 is vertex 3 in the first face and vertex 4 in the second.
        (face("v 0 0 1\nf 1 -3 -1\n"), &[[0, 1, 2], [0, 1, 3]]),
        // Corners that repeat the one before add nothing.
        (of_cube("f 5 8 8 1\n"), &[[4, 7, 0]]),
        (of_cube("f 1 1 2 4 4 3 1\n"), &[[0, 1, 3], [0, 3, 2]]),
    ] {
        let obj = read(&text);
        let number = |word: &str| word.parse::<f64>().unwrap();
        let lines = text.lines().filter_map(|line| line.strip_prefix("v "));
        let vertices: Vec<Vec<f64>> = lines.map(|line| line.split(' ').map(number).collect()).collect();
        assert_eq!(
            obj.vertices.iter().map(|vertex| vertex.to_vec()).collect::<Vec<_>>(),
            vertices
        );
        assert_eq!(obj.triangles, triangles, "{text}");
    }
}

#[test]
fn triangles_have_the_names_of_their_face() {
    for (statements, expected, num_listed) in [
        ("f 1 2 4 3\nusemtl red\ng a\nf 1 2 3\n", "//, //, /a/red", 5),
        (
            "o b\nusemtl r\nf 1 2 5\ng a\nusemtl s\nf 1 2 4 3 3\ng\nf 1 2 3\n",
            "b//r, b/a/s, b/a/s, b//s",
            5,
        ),
        // A name used twice is listed once, and a name without a face not at all.
        (
            "usemtl a\nf 1 2 3\nusemtl b\nusemtl a\nf 1 2 4\nusemtl c\n",
            "//a, //a",
            3,
        ),
        // A name is the rest of the line.
        (
            "o  big  box \t\ng left right\nusemtl\tred # 2\nf 1 2 3\n",
            "big  box/left right/red # 2",
            3,
        ),
        ("o W\u{fc}rfel \u{1f4e6}\r\nf 1 2 3\n", "W\u{fc}rfel \u{1f4e6}//", 3),
    ] {
        let obj = read(&(CORNERS.to_owned() + statements));
        assert_eq!(names(&obj), (expected.to_owned(), num_listed));
    }
    let latin1 = parse(&[b"# caf\xe9\ng caf\xe9\n", FACE.as_bytes()].concat()).unwrap();
    assert_eq!(latin1.group_names, ["caf\u{fffd}"]);
    // In quadratic time these would take minutes.
    let faces = lines((0..100_000).map(|i| format!("g {i}\nf 1 2 3\n")));
    let obj = read(&(CORNERS.to_owned() + &faces));
    assert_eq!((obj.triangles.len(), obj.group_names.len()), (100_000, 100_000));
    assert!(obj.group.iter().zip(0..).all(|(&group, i)| group == i));
}

#[test]
fn malformed_vertices_are_refused_with_their_line() {
    for values in "|1|1 2|0 3.1+e2 0|1,5 0 0|0 0 0x10|0 1e 0|0 1_000 0|0 1.0f 0".split('|') {
        let message = format!("vertex: expected three numbers, got `{values}`");
        assert_refused(format!("v 0 0 0\n# comment\nv {values} # 3\n"), 3, &message);
    }
    for number in "nan -inf 1e999 1e15 -1e15 1e+0000308 1000000000000000".split(' ') {
        let message = format!("vertex: expected finite numbers between -1e15 and 1e15, got `0 0 {number}`");
        // The vertex need not have a face.
        assert_refused(format!("{FACE}\nv 0 0 {number}\n{FACE}"), 6, &message);
        assert_refused(format!("v 0 0 0\n#\n\n\n\nv 0 0 {number}\n{FACE}"), 6, &message);
    }
}

#[test]
fn malformed_faces_are_refused_with_their_line() {
    for (corners, expected, before) in [
        (
            "10 12 4294967297 9223372036854775807",
            "a vertex index of at most 9",
            "",
        ),
        ("-9 -9223372036854775808", "at most 8 vertices back", ""),
        ("0 -0", "a vertex index counted from 1", ""),
        (
            "x 1.5 1, --1 1/x 1/1/1/1 99999999999999999999",
            "vertex indices",
            "1 2 ",
        ),
    ] {
        for corner in corners.split(' ') {
            let message = format!("face: expected {expected}, got `{before}{corner}`");
            assert_refused(
                format!("{CORNERS}f 1 2 9\n\nf 1 2 {corner}\nf 1 2 3\nv 0 0 0"),
                11,
                &message,
            );
        }
    }
    assert_refused(
        "v 0 0 0\nf 1 //1 1",
        2,
        "face: expected a vertex index counted from 1, got ``",
    );
    for corners in ["", "1", "1 2"] {
        let message = format!("face: expected at least 3 corners, got `{corners}`");
        assert_refused(format!("{CORNERS}f 1 2 3\nf {corners} # 3"), 10, &message);
    }
}

#[test]
fn lines_of_faults_are_counted_as_in_the_file() {
    let message = |corners: &str| format!("face: expected at least 3 corners, got `{corners}`");
    assert_refused("v 0 0 0\r\n\r\nf 1 1\r\n", 3, &message("1 1"));
    // A joined statement has its first line, and the lines after it keep their numbers.
    assert_refused("v 0 0 0\nf 1 \\\n 1\n", 2, &message("1   1"));
    assert_refused("v 0 0 \\\n 0\nf 1 1\n", 3, &message("1 1"));
    // Messages are one short line of printable characters.
    let escaped = "vertex: expected three numbers, got `0 0 \\u{1b}[2J\\u{7}\\u{202e}`";
    assert_refused("v 0 0 \u{1b}[2J\u{7}\u{202e}", 1, escaped);
    let cut = format!("vertex: expected three numbers, got `0 0 {}...`", "\u{e9}".repeat(36));
    assert_refused(format!("v 0 0 {}", "\u{e9}".repeat(100_000)), 1, &cut);

    for text in "|\n|\r\n| |# nothing|\\|\u{feff}|v 1 2 3|o a|l 1 2".split('|') {
        assert_refused(text, 1, NO_FACES);
    }
    assert_refused("g\r\r", 2, NO_FACES);
    assert_refused(CORNERS, 8, NO_FACES);
    assert_refused(CORNERS.to_owned() + "f 1 1 1 1\n", 9, NO_FACES);

    let utf16: Vec<u8> = FACE.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let utf32 = [b"\xff\xfe\0\0", &utf16[..]].concat();
    let object_file = b"\x64\x86\x03\x00\xd6\x2e\x00\x00.text\x00\x00\x00"; // of a compiler, which are .obj too
    for bytes in [&utf16, &utf32, &object_file[..], b"\x1f\x8b\x08\x00\x00\x00\x00\x00"] {
        assert_refused(bytes, 1, NUL);
    }
    // A file whose end was never written.
    assert_refused(CORNERS.to_owned() + SIDES + "f 1 2\0\0\0\0", 15, NUL);
}

#[test]
fn files_on_disk_read_as_text_in_memory_until_a_request_to_stop() {
    let error = read_obj(Path::new("/nowhere/part.obj"), &Cancel::default()).unwrap_err();
    assert!(matches!(error, Error::Io { .. }) && error.to_string().starts_with("/nowhere/part.obj: "));
    let path = std::env::temp_dir().join(format!("radarcore-face-{}.obj", std::process::id()));
    std::fs::write(&path, FACE).unwrap();
    let obj = read_obj(&path, &Cancel::default());
    std::fs::remove_file(&path).unwrap();
    assert_eq!(obj.unwrap(), read(FACE));

    let cancel = Cancel::default();
    cancel.ask();
    for text in [FACE, "f 1 2 3\n", ""] {
        let got = parse_obj(text.as_bytes(), Path::new("part.obj"), &cancel);
        assert!(matches!(got, Err(Error::Interrupted)), "{got:?}");
    }
}
