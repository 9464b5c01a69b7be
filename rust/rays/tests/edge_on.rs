//! Rays in the plane of a triangle hit it where it is, or what is behind.

use super::meshes::{Mesh, Random, moved, surface, wall};
use super::{Scene, is_near, odd};
use crate::Pose;
use crate::rays::tree::Ray;
use glam::DVec3;

/// Triangles in the plane y = 0 of the sensor, seen edge-on, and a wall behind them at x = 2.
fn blades(random: &mut Random) -> Mesh {
    let mut mesh = wall(2.0, 4.0);
    for i in 0..20 {
        let corner = |_| DVec3::new(random.between(0.5, 1.5), 0.0, random.between(-1.0, 1.0));
        mesh.0.extend([0; 3].map(corner));
        mesh.1.push([3 * i + 4, 3 * i + 5, 3 * i + 6]);
    }
    mesh
}

#[test]
fn rays_in_the_plane_of_a_triangle_miss_it_and_hit_what_is_behind() {
    // The middle column looks along the blades; their coordinates and those of the rays are exact.
    let mesh = blades(&mut Random::new(1));
    let scene = Scene::of(&mesh, Pose::IDENTITY);
    scene.cast(&odd([60, 3], [0.025, 0.1], 0), |_, ray, _, answer| {
        if answer.triangle > 1 {
            return Err(format!("{answer:?} is seen edge-on"));
        }
        is_near(answer.distance, 2.0 / ray.direction.x)
    });
}

#[test]
fn a_ray_towards_a_corner_of_a_triangle_seen_edge_on_does_not_end_in_the_air() {
    // In the plane of p and q through the origin, 3 to 5 m away.
    let (p, q) = (DVec3::new(0.6, 0.8, 0.1), DVec3::new(0.3, -0.2, 0.9));
    let corners = vec![3.0 * p + 1.1 * q, 4.0 * p + q, 3.5 * p + 2.3 * q];
    let surface = surface(&(corners.clone(), vec![[0, 1, 2]]));
    let ray = Ray {
        origin: DVec3::ZERO,
        direction: corners[1].normalize(),
        start: 0.0,
    };
    // Rounding may let it miss; else it enters at the far corner or, nearer, at the edge across.
    let Some(hit) = surface.nearest(&ray, f64::INFINITY) else {
        return;
    };
    let nearest = corners
        .iter()
        .map(|c| c.dot(ray.direction))
        .fold(f64::INFINITY, f64::min);
    assert!(hit.distance >= nearest, "hit at {} m, before {nearest} m", hit.distance);
}

#[test]
fn rays_in_the_plane_of_a_turned_triangle_hit_the_triangle_itself_or_what_is_behind() {
    // Rounding turns rays out of the plane: they may meet its triangles, but only where these are.
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let mesh = blades(&mut random);
        let (mesh, pose) = moved(&mesh, random.rotation(), random.point());
        Scene::of(&mesh, pose).check(&odd([60, 3], [0.025, 0.1], seed as usize % 8));
    }
}

#[test]
fn single_rays_in_the_plane_of_a_triangle_hit_the_triangle_itself_or_what_is_behind() {
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let mesh = blades(&mut random);
        let (body, pose) = moved(&mesh, random.rotation(), random.point());
        let scene = Scene::new(vec![(surface(&body), pose)], 2.0);
        let rays: Vec<Ray> = (0..500)
            .map(|_| {
                // From anywhere in the plane, inside of triangles too.
                let place = |random: &mut Random| DVec3::new(random.between(0.0, 1.9), 0.0, random.between(-1.0, 1.0));
                let origin = place(&mut random);
                Ray {
                    origin,
                    direction: (place(&mut random) - origin).normalize(),
                    start: 0.0,
                }
            })
            .collect();
        for (ray, farthest) in rays.iter().zip(scene.truth.farthest(&rays)) {
            let answer = scene.posed.cast(ray).into();
            if let Err(reason) = scene.truth.is_right(ray, farthest, &answer) {
                panic!("seed {seed}: {reason}");
            }
        }
    }
}
