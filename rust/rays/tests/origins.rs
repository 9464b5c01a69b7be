//! Rays that start on a surface or near it hit the next one.

use super::exhaustive::Answer;
use super::meshes::{Random, moved, star, surface, turned, turns, wall};
use super::{START, Scene, is_near};
use crate::rays::tree::Ray;
use crate::{ImagePlane, Pose};
use glam::DVec3;

#[test]
fn a_surface_that_the_sensor_touches_is_not_hit_and_the_next_one_is() {
    // The sensor is on the front face of a cube from x = 0 to 1: in the middle of it, on an edge and at a corner.
    let cube = star(2, |_| 1.0);
    // Without pixels that look along the faces that meet on an edge.
    let plane = ImagePlane::centered(16, 20, 0.9, 1.1);
    for [y, z] in [[0.1, 0.2], [0.0, 0.0], [0.0, 0.5], [0.5, 0.0]] {
        for seed in 0..20 {
            let mut random = Random::new(seed);
            let place = |v: &DVec3| 0.5 * *v + DVec3::new(0.5, y, z);
            let mesh = (cube.0.iter().map(place).collect(), cube.1.clone());
            let (body, pose) = if seed == 0 {
                (mesh, Pose::IDENTITY)
            } else {
                moved(&mesh, random.rotation(), random.point())
            };
            let surface = surface(&body);
            let inwards = Scene::new(vec![(surface.clone(), pose)], 0.0);
            // Where a ray meets the other faces: the planes x = 1, y = y +- 1/2 and z = z +- 1/2. On an edge some of them
            // are here, and who looks along one may hit it or not.
            inwards.cast(&plane, |_, ray, _, answer| {
                let d = ray.direction;
                let exit = |at: f64, d: f64| (at + 0.5 * d.signum()) / d;
                let [left, up] = [exit(y, d.y), exit(z, d.z)];
                if left.min(up) < 1e-3 {
                    return Ok(());
                }
                is_near(answer.distance, (1.0 / d.x).min(left).min(up))
            });
            let outwards = turned(turns()[1], &pose);
            Scene::new(vec![(surface, outwards)], 0.0).cast(&plane, |_, _, _, answer| {
                if answer.is_hit() {
                    Err(format!("{answer:?}, but nothing is there"))
                } else {
                    Ok(())
                }
            });
        }
    }
}

#[test]
fn images_begin_a_billionth_of_a_metre_from_the_sensor() {
    let behind = wall(1.0, 3.0);
    for (distance, is_hit) in [(0.0, false), (0.4e-9, false), (2e-9, true), (1e-6, true)] {
        let near = wall(distance, 3.0);
        let bodies = [near, behind.clone()].map(|mesh| (surface(&mesh), Pose::IDENTITY));
        Scene::new(bodies.to_vec(), 0.0).cast(&ImagePlane::centered(9, 9, 0.5, 0.5), |_, ray, _, answer| {
            let expected = if is_hit { distance } else { 1.0 };
            is_near(answer.distance, expected / ray.direction.x)
        });
    }
}

#[test]
fn a_ray_that_leaves_a_surface_does_not_hit_it_again() {
    // From where other rays hit a rough closed mesh, to both sides: bounces.
    let mut random = Random::new(1);
    let mesh = star(3, |_| random.between(0.5, 1.0));
    let (body, pose) = moved(&mesh, random.rotation(), random.point());
    let scene = Scene::new(vec![(surface(&body), pose)], 2.0);
    let mut leaving = Vec::new();
    while leaving.len() < 200_000 {
        let first = Ray {
            origin: DVec3::ZERO,
            direction: random.direction(),
            start: 0.0,
        };
        let hit = scene.posed.cast(&first);
        let [a, b, c] = scene.posed.surface(0).corners(hit.triangle).map(|v| pose.point(v));
        let normal = (b - a).cross(c - a).normalize();
        let ray = Ray {
            origin: hit.distance * first.direction,
            direction: random.direction(),
            start: START,
        };
        // Along the surface it is a matter of rounding.
        if ray.direction.dot(normal).abs() > 1e-5 {
            leaving.push((ray, hit.triangle));
        }
    }
    let (rays, from): (Vec<Ray>, Vec<u32>) = leaving.into_iter().unzip();
    let farthest = scene.truth.farthest(&rays);
    for (i, ray) in rays.iter().enumerate() {
        let answer = Answer::from(scene.posed.cast(ray));
        assert_ne!(answer.triangle, from[i], "{ray:?} {answer:?}");
        if let Err(reason) = scene.truth.is_right(ray, farthest[i], &answer) {
            panic!("{reason}");
        }
    }
}
