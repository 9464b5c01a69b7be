//! Properties of any file, drawn at random.

use glam::{DQuat, EulerRot};
use proptest::prelude::*;

use super::*;

proptest! {
    #[test]
    fn no_bytes_and_no_words_make_it_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..400),
        tokens in prop::collection::vec(token(), 0..200),
        mark in prop::sample::select(vec![&[][..], &[0xef, 0xbb, 0xbf], &[0xff, 0xfe], &[0xfe, 0xff]]),
    ) {
        check(&bytes)?;
        check(&[mark, CORNERS.as_bytes(), tokens.concat().as_bytes()].concat())?;
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
        for end in ["\r\n", "\r", "\t \n "] {
            prop_assert_eq!(&result(&text.replace('\n', end)), &expected);
        }
        prop_assert_eq!(&result(&(text.clone() + "\n# f 1 2 999")), &expected);
        let without_line = |result: std::result::Result<Obj, String>| {
            result.map_err(|error| error.trim_start_matches(|c: char| c != ' ').to_owned())
        };
        prop_assert_eq!(without_line(result(&text.replace('\n', "\n\n#\n"))), without_line(expected));
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
        let ring: Vec<DVec3> = points.iter().map(|&[x, y]| origin + u * x + v * y).collect();
        let next = points.iter().cycle().skip(1);
        let true_area = points.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0;

        // No part of the area is missing, none is counted twice, and the winding equals the ring's.
        let rounding = 1e-13; // of coordinates up to 3 in 38 triangles
        let obj = read(&polygon_file(&ring));
        prop_assert_eq!(obj.triangles.len(), points.len() - 2);
        prop_assert!((area(&obj) - true_area.abs()).abs() <= rounding, "{} {}", area(&obj), true_area);
        prop_assert!((area_vectors(&obj).iter().sum::<DVec3>() - normal * true_area).length() <= rounding);
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
        let (ring, normal) = tilted(&points);
        let obj = read(&polygon_file(&ring));
        prop_assert!((area(&obj) / true_area - 1.0).abs() <= 1e-12);
        prop_assert!((area_vectors(&obj).iter().sum::<DVec3>() / true_area - normal).length() <= 1e-12);
    }

    #[test]
    fn any_face_is_refused_or_has_the_area_of_its_ring(corners in prop::collection::vec(0..25_usize, 3..40)) {
        // Corners on a grid of 5 x 5 meet, repeat, double back and cross.
        let ring: Vec<DVec3> = corners.iter().map(|i| DVec3::new((i % 5) as f64, (i / 5) as f64, 0.0)).collect();
        if let Some(obj) = check(polygon_file(&ring).as_bytes())? {
            prop_assert!((area(&obj) - area_vectors(&obj).iter().sum::<DVec3>().length()).abs() <= 1e-9);
        }
    }
}

fn token() -> impl Strategy<Value = String> {
    let words = [
        "v", "f", "o", "g", "usemtl", "mtllib", "l", "p", "vn", "#", "\\", "\\\n", "\r", "\n", "\nf ", "1", "2", "8",
        "-1", "-8", "0", "9", "1/2/3", "1//", "/", "1e308", "-1e308", "1e-320", "nan", "\0", "\u{a0}", "\u{feff}",
    ];
    let words = [&words[..], &["\nf 1 2 4 3 ", "\nv 1 2 3"]].concat();
    (prop::sample::select(words), any::<bool>()).prop_map(|(word, glue)| word.to_owned() + if glue { "" } else { " " })
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
    let name = any_of(&["", "a", "b", "a b", "#", "\u{1f4e6}", "\u{feff}a", "a\\b", "v 1 2 3"]);
    let other = ["", "l 1 2", "p 1", "vt 0", "s off", "# f 1 2 9", "end", "V", "\t", "\\"];
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
        let mut edges = (0..ring.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        edges.find(|&(i, j)| cross(ring[i], ring[i + 1], ring[j], ring[(j + 1) % ring.len()]))
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
    prop_assert!(obj.vertices.iter().flatten().all(|x| x.is_finite()));
    let num_vertices = obj.vertices.len();
    let mut corners = obj.triangles.iter().flatten();
    prop_assert!(corners.all(|&vertex| (vertex as usize) < num_vertices));
    prop_assert!(num_vertices <= bytes.len() && obj.triangles.len() <= bytes.len());
    for (index, names) in [
        (&obj.object, &obj.object_names),
        (&obj.group, &obj.group_names),
        (&obj.material, &obj.material_names),
    ] {
        prop_assert_eq!(index.len(), obj.triangles.len());
        prop_assert!(index.iter().all(|&name| (name as usize) < names.len()));
    }
    Ok(Some(obj))
}
