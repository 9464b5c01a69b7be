//! Names of objects, groups and materials.

use super::*;

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
