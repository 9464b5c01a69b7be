//! Random rays into scenes drawn by lot hit what the exhaustive search finds.

use super::exhaustive::{Answer, Exhaustive, TOLERANCE};
use super::meshes::{self, Bodies, Random, turns};
use super::{START, Scene, cut_out};
use crate::Pose;
use crate::rays::tree::Ray;
use glam::DVec3;
use rayon::prelude::*;

#[test]
fn two_million_random_rays_of_images_hit_what_the_exhaustive_search_finds_at_every_level() {
    let counts: Vec<[usize; 2]> = (0..140)
        .into_par_iter()
        .map(|seed| {
            let mut random = Random::new(seed);
            let (bodies, _) = meshes::scene(&mut random);
            let targets: Vec<DVec3> = bodies
                .iter()
                .flat_map(|(surface, pose)| surface.corners(0).map(|v| pose.point(v)))
                .collect();
            let scene = Scene::new(bodies, 0.0);
            let (mut num_rays, mut num_hits) = (0, 0);
            while num_rays < 16_000 {
                // Towards some vertex, from a wide angle to a thousandth of a radian.
                let target = targets[random.below(targets.len())];
                let middle = [target.y, target.z].map(|x| (x / target.x.abs()).clamp(-5.0, 5.0));
                let half = 10_f64.powf(random.between(-3.0, 0.7));
                let (rows, columns) = (1 + random.below(100), 1 + random.below(100));
                let (du, dv) = (
                    2.0 * half / columns as f64,
                    half * random.between(1.0, 3.0) / rows as f64,
                );
                let plane = cut_out(rows, columns, du, dv, middle);
                num_hits += scene.check(&plane);
                num_rays += plane.num_pixels();
            }
            [num_rays, num_hits]
        })
        .collect();
    let [rays, hits] = [0, 1].map(|i| counts.iter().map(|count| count[i]).sum::<usize>());
    assert!(rays > 2_000_000 && hits > rays / 3, "{rays} {hits}");
    println!("{rays} rays, {hits} hits");
}

/// A ray from anywhere in a scene: along an axis or nearly in a plane of two, at a triangle, or anywhere.
fn random_ray(random: &mut Random, bodies: &Bodies, scale: f64) -> Ray {
    let origin = 3.0 * scale * random.between(0.0, 1.0) * random.point();
    let direction = match random.below(8) {
        0 => turns()[random.below(6)].x_axis,
        1 => (random.direction() * DVec3::new(1.0, 1.0, 1e-20)).normalize(),
        2..5 => random.direction(),
        _ => {
            let (surface, pose) = &bodies[random.below(bodies.len())];
            let [a, b, c] = surface.corners(random.below(surface.num_triangles()) as u32);
            let (s, t) = (random.between(0.0, 1.0), random.between(0.0, 1.0));
            (pose.point(a + s * (b - a) + s * t * (c - b)) - origin).normalize()
        }
    };
    let start = match random.below(3) {
        0 => 0.0,
        1 => START,
        _ => random.between(0.0, scale),
    };
    Ray {
        origin,
        direction,
        start,
    }
}

#[test]
fn two_million_random_rays_one_by_one_hit_what_the_exhaustive_search_finds() {
    let counts: Vec<[usize; 2]> = (1000..1140)
        .into_par_iter()
        .map(|seed| {
            let mut random = Random::new(seed);
            let (bodies, scale) = meshes::scene(&mut random);
            let rays: Vec<Ray> = (0..16_000).map(|_| random_ray(&mut random, &bodies, scale)).collect();
            let scene = Scene::new(bodies, 3.0 * scale);
            let mut num_hits = 0;
            for (ray, farthest) in rays.iter().zip(scene.truth.farthest(&rays)) {
                let answer = Answer::from(scene.posed.cast(ray));
                num_hits += usize::from(answer.is_hit());
                if let Err(reason) = scene.truth.is_right(ray, farthest, &answer) {
                    panic!("seed {seed}: {reason}");
                }
            }
            [rays.len(), num_hits]
        })
        .collect();
    let [rays, hits] = [0, 1].map(|i| counts.iter().map(|count| count[i]).sum::<usize>());
    assert!(rays > 2_000_000 && hits > rays / 5, "{rays} {hits}");
    println!("{rays} rays, {hits} hits");
}

#[test]
fn rays_of_any_length_hit_the_nearest_triangle_of_a_surface_before_a_distance() {
    (2000..2200_u64).into_par_iter().for_each(|seed| {
        let mut random = Random::new(seed);
        let (bodies, scale) = meshes::scene(&mut random);
        let (surface, pose) = bodies[0].clone();
        let rays: Vec<Ray> = (0..4000)
            .map(|_| {
                let ray = random_ray(&mut random, &bodies, scale);
                Ray {
                    origin: pose.point_to_body(ray.origin),
                    direction: pose.direction_to_body(ray.direction).normalize(),
                    ..ray
                }
            })
            .collect();
        let origins = rays
            .iter()
            .fold(0.0, |most: f64, ray| most.max(ray.origin.abs().max_element()));
        let truth = Exhaustive::new(&[(surface.clone(), Pose::IDENTITY)], origins);
        for (ray, farthest) in rays.iter().zip(truth.farthest(&rays)) {
            // Distances count in the length of the direction.
            let length = 10_f64.powf(random.between(-3.0, 3.0));
            let stretched = Ray {
                direction: length * ray.direction,
                start: ray.start / length,
                ..*ray
            };
            let before = if random.chance(0.5) { f64::INFINITY } else { 2.0 * scale };
            let answer = match surface.nearest(&stretched, before / length) {
                Some(hit) => Answer {
                    distance: length * hit.distance,
                    body: 0,
                    triangle: hit.triangle,
                },
                None => Answer::MISS,
            };
            assert!(
                answer.distance <= before * (1.0 + TOLERANCE) || !answer.is_hit(),
                "{answer:?}"
            );
            // What lies beyond need not be found.
            let farthest = if farthest <= before { farthest } else { f64::INFINITY };
            if let Err(reason) = truth.is_right(ray, farthest, &answer) {
                panic!("seed {seed}: {reason}");
            }
        }
    });
}
