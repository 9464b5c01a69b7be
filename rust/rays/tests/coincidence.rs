//! Of triangles that coincide the first is hit, and of those a billionth apart the nearer.

use super::exhaustive::Answer;
use super::meshes::{Mesh, Random, join, moved, star, surface, wall};
use super::{Scene, cut_out, is_near};
use crate::{ImagePlane, Pose};
use glam::DVec3;

#[test]
fn of_coinciding_triangles_the_first_is_hit_whatever_the_level() {
    let mut random = Random::new(1);
    let mesh = star(4, |_| random.between(0.5, 1.0));
    for copies in [2, 3, 20] {
        // Copies of all triangles after all triangles: those with small numbers are hit.
        let num = mesh.1.len() as u32;
        let repeated = (mesh.0.clone(), mesh.1.repeat(copies));
        let (body, pose) = moved(&repeated, random.rotation(), random.point());
        let one_body = Scene::of(&body, pose);
        // The same surface several times: the first body is hit.
        let (single, pose) = moved(&mesh, random.rotation(), random.point());
        let single = surface(&single);
        let bodies = Scene::new(vec![(single, pose); copies], 0.0);
        let plane = ImagePlane::centered(30, 40, 1.0, 0.8);
        for scene in [&one_body, &bodies] {
            scene.cast(&plane, |_, ray, _, answer| {
                if answer.triangle >= num || answer.body != 0 {
                    return Err(format!("{answer:?} is not the first of several"));
                }
                let alone = Answer::from(scene.posed.cast(ray));
                if (alone.triangle, alone.body) != (answer.triangle, 0) {
                    return Err(format!("{answer:?}, but alone {alone:?}"));
                }
                scene.is_closed(ray, &answer)
            });
        }
    }
}

#[test]
fn of_triangles_in_one_plane_the_first_is_hit_whatever_their_corners() {
    // In front of the sensor, with coordinates that nothing rounds: both halves of a square and, overlapping them, others.
    let corners = [
        [-4.0, -4.0],
        [4.0, -4.0],
        [4.0, 4.0],
        [-4.0, 4.0],
        [0.0, 8.0],
        [0.0, -8.0],
    ];
    let vertices: Vec<DVec3> = corners.iter().map(|[y, z]| DVec3::new(2.0, *y, *z)).collect();
    let own = [[2, 0, 1], [0, 2, 3]];
    let others = [
        [0, 1, 2],
        [2, 1, 0],
        [1, 2, 0],
        [5, 1, 4],
        [5, 4, 3],
        [3, 4, 5],
        [0, 3, 2],
    ];
    let plane = ImagePlane::centered(24, 24, 0.99, 0.99);
    for behind in 1..20 {
        let triangles: Vec<[u32; 3]> = own.iter().chain(others.iter().cycle().take(behind)).copied().collect();
        let scene = Scene::of(&(vertices.clone(), triangles), Pose::IDENTITY);
        scene.cast(&plane, |_, ray, _, answer| {
            if answer.triangle > 1 {
                return Err(format!("{answer:?} is not the first of several"));
            }
            is_near(answer.distance, 2.0 / ray.direction.x)
        });
    }
}

#[test]
fn a_hundred_times_the_same_triangle_is_hit_once() {
    let (vertices, triangles) = wall(2.0, 5.0);
    let scene = Scene::of(&(vertices, triangles.repeat(100)), Pose::IDENTITY);
    scene.cast(&ImagePlane::centered(16, 16, 0.9, 0.9), |_, ray, _, answer| {
        if answer.triangle > 1 {
            return Err(format!("{answer:?}"));
        }
        is_near(answer.distance, 2.0 / ray.direction.x)
    });
}

#[test]
fn sheets_that_are_a_billionth_apart_are_told_apart() {
    // The nearer sheet comes last, so that taking both for one place would find the other.
    for (distance, gap) in [(1.0, 1e-9), (1e3, 1e-6), (1e-3, 1e-12)] {
        let [back, front] = [distance * (1.0 + gap / distance), distance].map(|x| wall(x, 2.0 * distance));
        let plane = ImagePlane::centered(17, 23, 0.8, 0.9);
        let one_body = Scene::of(&join(back.clone(), front.clone()), Pose::IDENTITY);
        one_body.cast(&plane, |_, ray, _, answer| {
            if answer.triangle < 2 {
                return Err(format!("{answer:?} is the back"));
            }
            is_near(answer.distance, distance / ray.direction.x)
        });
        let bodies = [back, front].map(|mesh| (surface(&mesh), Pose::IDENTITY));
        Scene::new(bodies.to_vec(), 0.0).cast(&plane, |_, ray, _, answer| {
            if answer.body != 1 {
                return Err(format!("{answer:?} is the back"));
            }
            is_near(answer.distance, distance / ray.direction.x)
        });
    }
}

#[test]
fn small_squares_just_before_a_slanted_wall_hide_it() {
    // Boxes of the wall begin before those of the squares, so that the wall is found first; what is barely nearer than a
    // find must still be looked at.
    for gap in [1e-3, 1e-6, 1e-9] {
        let (vertices, triangles) = wall(1.0, 1.0);
        let slanted = vertices.iter().map(|v| DVec3::new(1.0 + 0.5 * v.y, v.y, v.z));
        let mut mesh: Mesh = (slanted.collect(), triangles);
        let places: Vec<[f64; 2]> = (0..64)
            .map(|i| [i % 8, i / 8].map(|k| 0.2 * f64::from(k) - 0.7))
            .collect();
        for [y, z] in &places {
            // The corner of a square that is nearest to the wall is `gap` from it.
            let (vertices, triangles) = wall(1.0 + 0.5 * y - 1.5 * gap, gap);
            let square = vertices.iter().map(|v| *v + DVec3::new(0.0, *y, *z)).collect();
            mesh = join(mesh, (square, triangles));
        }
        let (wall, squares) = mesh.1.split_at(2);
        let bodies = [wall, squares].map(|triangles| (surface(&(mesh.0.clone(), triangles.to_vec())), Pose::IDENTITY));
        for scene in [Scene::of(&mesh, Pose::IDENTITY), Scene::new(bodies.to_vec(), 0.0)] {
            for [y, z] in &places {
                let x = 1.0 + 0.5 * y - 1.5 * gap;
                let plane = cut_out(16, 16, 0.1 * gap / x, 0.1 * gap / x, [y / x, z / x]);
                scene.cast(&plane, |_, ray, _, answer| {
                    if answer.body == 0 && answer.triangle < 2 {
                        return Err(format!("{answer:?} is the wall"));
                    }
                    is_near(answer.distance, x / ray.direction.x)
                });
            }
        }
    }
}
