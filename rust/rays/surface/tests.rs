use super::*;
use crate::geometry::pose::Pose;
use crate::numeric::random::Random;
use crate::rays::scene::{NO_BODY, PosedScene};
use crate::rays::single_ray::Hit;
use crate::rays::tests::scenes::{half_line, star};

#[test]
fn a_deformed_surface_is_hit_as_one_made_of_its_vertices() {
    let (vertices, triangles) = star(10, |corner| 1.0 / corner.length());
    let mode = ShadingMode::Smooth { crease_angle: 0.8 };
    let before = Surface::new(&vertices, &triangles, mode, &Cancel::default()).unwrap();
    let bend = |p: &DVec3| DVec3::new(p.x + 0.4 * p.y * p.y, 1.3 * p.y, p.z + 0.2 * (3.0 * p.x).sin());
    let bent: Vec<DVec3> = vertices.iter().map(bend).collect();
    // So much that the tree is of no use any more.
    let torn: Vec<DVec3> = (0..vertices.len())
        .map(|i| vertices[i * 389 % vertices.len()])
        .collect();
    for (places, is_rebuilt) in [(bent, false), (torn, true)] {
        let deformed = before.deform(places.clone(), &Cancel::default()).unwrap();
        assert_eq!(deformed.built_cost != before.built_cost, is_rebuilt);
        assert_eq!(deformed.content_hash(), before.content_hash());
        assert_eq!(deformed.rest_corners(7), before.corners(7));
        let fresh = Surface::new(&places, &triangles, mode, &Cancel::default()).unwrap();
        let [deformed, fresh] =
            [deformed, fresh].map(|surface| PosedScene::new(vec![Arc::new(surface)], vec![Pose::IDENTITY]));
        let random = &mut Random(1);
        let mut hits = 0;
        for _ in 0..2000 {
            let ray = half_line(3.0 * random.point(), random.point(), 0.0);
            let [a, b] = [&deformed, &fresh].map(|scene| scene.cast(&ray));
            let of = |hit: Hit| (hit.triangle, hit.distance, hit.barycentric);
            assert_eq!(of(a), of(b));
            hits += usize::from(a.body != NO_BODY);
        }
        assert!(hits > 100, "{hits}");
    }
    let turn = |v: DVec3| DVec3::new(-v.y, v.x, v.z);
    let turned = before
        .deform(vertices.iter().map(|v| turn(*v)).collect(), &Cancel::default())
        .unwrap();
    for triangle in 0..triangles.len() as u32 {
        let expected = before.corner_normals(triangle).map(|normals| normals.map(turn));
        assert_eq!(turned.corner_normals(triangle), expected);
    }
    assert!(before.deform(vec![DVec3::ZERO; 3], &Cancel::default()).is_err());
    let nowhere = vec![DVec3::NAN; before.vertices().len()];
    assert!(before.deform(nowhere, &Cancel::default()).is_err());
}

#[test]
fn degenerate_triangles_are_dropped_and_the_rest_keep_their_rows() {
    let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y, 2.0 * DVec3::X];
    let triangles = [[0, 0, 1], [0, 1, 3], [0, 1, 2]];
    let surface = Surface::new(&vertices, &triangles, ShadingMode::Flat, &Cancel::default()).unwrap();
    assert_eq!((surface.num_triangles(), surface.kept()), (1, Some(&[2][..])));
}

#[test]
fn silly_meshes_are_refused_or_empty() {
    let flat = ShadingMode::Flat;
    let message = |v: &[DVec3], t: &[[u32; 3]]| Surface::new(v, t, flat, &Cancel::default()).err().unwrap().to_string();
    assert!(message(&[DVec3::NAN], &[]).starts_with("vertices: expected finite coordinates"));
    assert!(message(&[DVec3::splat(1e200)], &[]).contains("below 1e15 m"));
    assert!(message(&[DVec3::ZERO], &[[0, 0, 1]]).starts_with("triangles: expected vertex numbers below 1"));
    let empty = Surface::new(&[], &[], flat, &Cancel::default()).unwrap();
    assert_eq!(empty.num_triangles(), 0);
}
