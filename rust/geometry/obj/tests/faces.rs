//! Faces: corners, indices and the faults of both.

use super::*;

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
    let error = read_obj(Path::new("/nowhere/part.obj"), &Cancel::default()).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
    assert!(error.to_string().starts_with("/nowhere/part.obj: "));
}

#[test]
fn file_on_disk_reads_as_the_same_text_in_memory() {
    let path = std::env::temp_dir().join(format!("radarcore-cube-{}.obj", std::process::id()));
    std::fs::write(&path, cube()).unwrap();
    let obj = read_obj(&path, &Cancel::default());
    std::fs::remove_file(&path).unwrap();
    assert_eq!(obj.unwrap(), read(&cube()));
}
