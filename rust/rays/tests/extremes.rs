//! Scenes from a tenth of a millimetre to a kilometre, numbers with zeros in them, and no triangles at all.

use std::sync::Arc;

use super::meshes::{Mesh, Random, join, moved, star, surface, turns, wall};
use super::{Scene, cut_out, is_near};
use crate::numeric::simd::Level;
use crate::rays::scene::PosedScene;
use crate::rays::tree::Ray;
use crate::{ImagePlane, Pose};
use glam::{DMat3, DVec3};

#[test]
fn a_part_of_a_tenth_of_a_millimetre_is_seen_before_a_wall_of_a_kilometre() {
    let (part, far) = (wall(1.0, 5e-5), wall(500.0, 500.0));
    let one_body = vec![(surface(&join(part.clone(), far.clone())), Pose::IDENTITY)];
    let bodies = [part, far].map(|mesh| (surface(&mesh), Pose::IDENTITY)).to_vec();
    // From the whole part in one pixel to a pixel of a ten thousandth of it.
    for (bodies, parts_triangles) in [(one_body, true), (bodies, false)] {
        let scene = Scene::new(bodies, 0.0);
        for size in [9e-5, 1e-5, 3e-7, 1e-8] {
            for middle in [[0.0, 0.0], [5.1e-5, -4.9e-5], [4.9e-5, 0.0]] {
                let plane = cut_out(41, 37, size, size, middle);
                scene.cast(&plane, |_, ray, pixel, answer| {
                    let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
                    let beyond = u.abs().max(v.abs()) - 5e-5;
                    if beyond.abs() < 1e-12 {
                        return Ok(()); // on the outline
                    }
                    let is_part = if parts_triangles {
                        answer.triangle < 2
                    } else {
                        answer.body == 0
                    };
                    if is_part != (beyond < 0.0) {
                        return Err(format!("{answer:?} at {beyond} from the outline"));
                    }
                    let plane_at = if is_part { 1.0 } else { 500.0 };
                    is_near(answer.distance, plane_at / ray.direction.x)
                });
            }
        }
    }
}

#[test]
fn sizes_from_a_tenth_of_a_millimetre_to_a_kilometre_make_one_scene() {
    for seed in 0..2 {
        let mut random = Random::new(seed);
        // Shells about the sensor and parts between them, ten times larger from one to the next; the last is closed.
        let mut mesh = star(2, |_| 500.0);
        let mut parts = Vec::new();
        for size in [5e-5, 5e-4, 5e-3, 0.05, 0.5, 5.0, 50.0] {
            let place = 4.0 * size * (DVec3::X + 0.5 * random.point());
            parts.push(place);
            let (vertices, triangles) = star(2, |_| size * random.between(0.5, 1.0));
            mesh = join(mesh, (vertices.iter().map(|v| *v + place).collect(), triangles));
        }
        let (body, pose) = moved(&mesh, random.rotation(), 100.0 * random.point());
        let scene = Scene::of(&body, pose);
        for place in parts {
            for half in [1e-2, 0.3, 2.0] {
                let middle = [place.y / place.x, place.z / place.x];
                let plane = cut_out(61, 53, 2.0 * half / 53.0, 2.0 * half / 61.0, middle);
                assert_eq!(scene.check(&plane), plane.num_pixels(), "leak");
            }
        }
    }
}

#[test]
fn a_scene_a_kilometre_from_the_origin_is_the_same_scene() {
    // Coordinates are multiples of 2^-20 m, so that moving them by a kilometre rounds nothing.
    let mut random = Random::new(1);
    let steps = |x: f64| (x * 1_048_576.0).round() / 1_048_576.0;
    let mesh = star(8, |_| 1.0);
    let rough = |v: &DVec3| (*v * random.between(0.5, 1.0)).map(steps);
    let mesh: Mesh = (mesh.0.iter().map(rough).collect(), mesh.1);
    let here = Scene::of(&mesh, Pose::IDENTITY);
    let plane = ImagePlane::centered(64, 64, 1.2, 1.1);
    let shifts = [DVec3::X, DVec3::ONE, DVec3::new(0.0, -1.0, 1.0)].map(|axis| 1024.0 * axis);
    for shift in shifts {
        let (moved, pose) = moved(&mesh, DMat3::IDENTITY, -shift);
        let there = Scene::of(&moved, pose);
        for level in Level::available() {
            let [here, there] = [&here, &there].map(|scene| scene.posed.cast_image_at(&plane, level).unwrap().distance);
            for (here, there) in here.iter().zip(&there) {
                is_near(*there, *here).unwrap();
            }
        }
    }
}

#[test]
fn leaves_hold_any_number_of_triangles() {
    // A band of 1, 2, 3, ... triangles: what fills up a leaf after the last of them is not hit.
    for num in 1..=70_u32 {
        let place = |i: u32| {
            let side = if i.is_multiple_of(2) { -1.0 } else { 1.0 };
            DVec3::new(1.0, 0.9 - 1.7 * f64::from(i) / f64::from(num + 1), 0.7 * side)
        };
        let mesh = (
            (0..num + 2).map(place).collect(),
            (0..num).map(|i| [i, i + 1, i + 2]).collect(),
        );
        let scene = Scene::of(&mesh, Pose::IDENTITY);
        let num_hits = scene.check(&ImagePlane::centered(33, 65, 1.0, 1.0));
        // The band's area: its height times its mean length.
        let area = 1.4 * (1.7 * f64::from(num) / f64::from(num + 1)) / 4.0;
        let share = num_hits as f64 / (33.0 * 65.0);
        assert!((share - area).abs() < 0.04, "{num}: {share} {area}"); // a row or two of pixels on the outline
    }
}

#[test]
fn rays_along_the_axes_hit_edges_and_vertices_of_a_grid_of_squares() {
    // Every ray runs in faces of boxes of the tree, with zeros of both signs among its numbers.
    let cube = surface(&star(8, |_| 1.0));
    for turn in turns() {
        let pose = Pose {
            rotation: turn,
            translation: DVec3::ZERO,
        };
        let scene = PosedScene::new(vec![cube.clone()], vec![pose]);
        for row in -3..=3 {
            for column in -3..=3 {
                let [y, z] = [column, row].map(|i| f64::from(i) / 4.0);
                for zero in [0.0, -0.0] {
                    for (x, distance) in [(-3.0, 2.0), (0.25, 0.75)] {
                        let ray = Ray {
                            origin: DVec3::new(x, y, z),
                            direction: DVec3::new(1.0, zero, zero),
                            start: 0.0,
                        };
                        assert_eq!(scene.cast(&ray).distance, distance, "{ray:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn nothing_at_all_is_hit_by_nothing() {
    let empty = || surface(&(Vec::new(), Vec::new()));
    let some: Vec<(Arc<_>, Pose)> = vec![(empty(), Pose::IDENTITY), (surface(&wall(1.0, 2.0)), Pose::IDENTITY)];
    let plane = ImagePlane::centered(3, 5, 0.5, 0.5);
    Scene::new(some, 0.0).cast(&plane, |_, ray, _, answer| {
        assert_eq!(answer.body, 1);
        is_near(answer.distance, 1.0 / ray.direction.x)
    });
    for bodies in [Vec::new(), vec![(empty(), Pose::IDENTITY)]] {
        assert_eq!(Scene::new(bodies, 0.0).check(&plane), 0);
    }
}
