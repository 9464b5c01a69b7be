//! Vertices: order, numbers, and the faults of both.

use super::*;

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
