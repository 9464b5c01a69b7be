//! All searches against an exhaustive one, to the last bit, and the exact test against integers.

pub mod scenes;

use std::sync::Arc;

use crate::geometry::pose::Pose;
use crate::numeric::random::Random;
use crate::numeric::simd::Level;
use crate::rays::hits::Cast;
use crate::rays::scene::{NEAREST, NO_BODY, PosedScene};
use crate::rays::single_ray::{Hit, RayCast};
use crate::rays::surface::Surface;
use crate::rays::watertight::{Ray, WatertightTest};
use glam::{DMat3, DVec3, I64Vec3};
use rayon::prelude::*;
use scenes::{Case, half_line, star, surface, wall};

/// Tests of a ray and a triangle in the exhaustive searches of a case.
const MOST_TESTS: usize = 100_000;

/// The slow truth: the exact test of every triangle. Of several at the same distance the first is hit.
fn exhaustive(scene: &PosedScene, ray: &Ray) -> Hit {
    let mut nearest = Hit::MISS;
    for body in 0..scene.num_bodies() as u32 {
        let pose = scene.pose(body);
        let test = WatertightTest::new(&half_line(
            pose.point_to_body(ray.origin),
            pose.direction_to_body(ray.direction),
            ray.start,
        ));
        for triangle in 0..scene.surface(body).num_triangles() as u32 {
            if let Some(crossing) = test.intersect(&scene.surface(body).corners(triangle))
                && crossing.distance < nearest.distance
            {
                nearest = Hit {
                    distance: crossing.distance,
                    body,
                    triangle,
                    barycentric: crossing.barycentric,
                };
            }
        }
    }
    nearest
}

fn cast(scene: &PosedScene, ray: &Ray, far: f64, level: Level) -> Hit {
    level.run(RayCast {
        scene,
        ray,
        far,
        any_hit: false,
    })
}

/// Check all rays of a case: pixels hit what single rays hit at every level, and some of these what an exhaustive search
/// hits. Returns the number of hits.
fn check(case: &Case) -> usize {
    let (surfaces, poses) = case.bodies.iter().cloned().unzip();
    let scene = PosedScene::new(surfaces, poses);
    let mut rays = case.rays.clone();
    for plane in &case.planes {
        rays.extend((0..plane.num_pixels()).map(|pixel| {
            let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
            half_line(DVec3::ZERO, DVec3::new(1.0, u, v), NEAREST)
        }));
    }
    let single: Vec<Hit> = rays.iter().map(|ray| scene.cast(ray)).collect();

    let mut first = case.rays.len();
    for plane in &case.planes {
        for level in Level::available() {
            let options = Cast {
                level,
                ..Cast::default()
            };
            let hits = scene.cast_image(plane, &options).unwrap();
            for pixel in 0..plane.num_pixels() {
                let (ray, hit) = (&rays[first + pixel], &single[first + pixel]);
                let expected = (hit.body, hit.triangle, hit.distance * ray.direction.length());
                let packet = (hits.body[pixel], hits.triangle[pixel], hits.distance[pixel]);
                assert_eq!(packet, expected, "{}: pixel {pixel} of {plane:?}, {level:?}", case.name);
            }
        }
        first += plane.num_pixels();
    }

    let num_triangles: usize = case.bodies.iter().map(|(surface, _)| surface.num_triangles()).sum();
    let step = 1 + rays.len() * num_triangles / MOST_TESTS;
    for (i, (ray, hit)) in rays.iter().zip(&single).enumerate() {
        let context = || format!("{}: {ray:?} {hit:?}", case.name);
        assert!((case.expect)(ray, hit), "{}", context());
        if i % step != 0 {
            continue;
        }
        let key = |hit: &Hit| (hit.body, hit.triangle, hit.distance, hit.barycentric);
        assert_eq!(key(hit), key(&exhaustive(&scene, ray)), "{}", context());
        // Before the hit there is nothing.
        let [before, behind] = [1.0 - 1e-12, 1.0 + 1e-12].map(|factor| hit.distance * factor);
        for level in Level::available() {
            for far in [f64::INFINITY, behind] {
                assert_eq!(key(&cast(&scene, ray, far, level)), key(hit), "{level:?} {}", context());
            }
        }
        assert_eq!(scene.blocks(ray, behind), hit.body != NO_BODY, "{}", context());
        if before > ray.start && hit.body != NO_BODY {
            assert!(!scene.blocks(ray, before), "{}", context());
        }
    }
    single.iter().filter(|hit| hit.body != NO_BODY).count()
}

#[test]
fn every_ray_hits_what_an_exhaustive_search_hits() {
    let num_hits: usize = scenes::cases().par_iter().map(check).sum();
    assert!(num_hits > 250_000, "{num_hits}");
}

#[test]
fn the_exact_test_agrees_with_integers() {
    let random = &mut Random(1);
    let (mut num_hits, mut num_misses) = (0, 0);
    for _ in 0..100_000 {
        let mut draw = |size: f64| (size * random.point()).round().as_i64vec3();
        let [a, b, c] = [(); 3].map(|()| draw(1000.0));
        // Towards a point in or about the triangle.
        let weights = draw(8.0).abs() - I64Vec3::splat(1);
        let direction = weights.x * a + weights.y * b + weights.z * c + draw(1.0);
        let dot = |a: I64Vec3, b: I64Vec3| a.x * b.x + a.y * b.y + a.z * b.z;
        let sides = [(b, c), (c, a), (a, b)].map(|(p, q)| dot(direction, p.cross(q)));
        let slope: i64 = sides.iter().sum();
        if slope == 0 || sides.contains(&0) {
            continue;
        }
        let distance = dot((b - a).cross(c - a), a) as f64 / slope as f64;
        let is_inside = sides.iter().all(|side| side.signum() == slope.signum());
        // The same from another origin.
        let shift = draw(1000.0).as_dvec3();
        let ray = half_line(shift, direction.as_dvec3(), 0.0);
        let crossing = WatertightTest::new(&ray).intersect(&[a, b, c].map(|v| v.as_dvec3() + shift));
        let context = format!("{a} {b} {c} {direction}");
        assert_eq!(crossing.is_some(), is_inside && distance > 0.0, "{context}");
        let Some(crossing) = crossing else {
            num_misses += 1;
            continue;
        };
        num_hits += 1;
        assert!((crossing.distance - distance).abs() < 1e-12 * distance, "{context}");
        let weights = sides.map(|side| side as f64 / slope as f64);
        let errors = [0, 1, 2].map(|i| (crossing.barycentric[i] - weights[i]).abs());
        assert!(errors.iter().all(|error| *error < 1e-9), "{context}");
    }
    assert!(num_hits > 15_000 && num_misses > 15_000, "{num_hits} {num_misses}");
}

#[test]
fn a_ray_towards_a_corner_of_a_triangle_seen_edge_on_does_not_end_in_the_air() {
    // In the plane of p and q through the origin, 3 to 5 m away.
    let (p, q) = (DVec3::new(0.6, 0.8, 0.1), DVec3::new(0.3, -0.2, 0.9));
    let corners = [3.0 * p + 1.1 * q, 4.0 * p + q, 3.5 * p + 2.3 * q];
    let ray = half_line(DVec3::ZERO, corners[1].normalize(), 0.0);
    // Rounding may let it miss; else it enters at the far corner or, nearer, at the edge across.
    if let Some(hit) = WatertightTest::new(&ray).intersect(&corners) {
        let depths = corners.map(|corner| corner.dot(ray.direction));
        assert!(hit.distance >= depths.into_iter().fold(f64::INFINITY, f64::min));
    }
}

/// A wall at x = 6 m, and ten small squares at 3 m.
pub fn furnished() -> (Vec<Arc<Surface>>, Vec<Pose>) {
    let pose = |angle: f64, translation: DVec3| Pose {
        rotation: DMat3::from_rotation_z(angle),
        translation,
    };
    let (mut surfaces, mut poses) = (vec![surface(&wall(0.0, 4.0))], vec![pose(0.0, 6.0 * DVec3::X)]);
    for i in 0..10 {
        let place = DVec3::new(3.0, 0.4 * f64::from(i % 5) - 0.8, 0.5 * f64::from(i / 5) - 0.25);
        surfaces.push(surface(&wall(0.0, 0.05 + 0.01 * f64::from(i))));
        poses.push(pose(0.1 * f64::from(i), place));
    }
    (surfaces, poses)
}

#[test]
fn a_ray_that_leaves_a_surface_does_not_hit_it_again() {
    // From where other rays hit a rough closed mesh, to both sides.
    let random = &mut Random(1);
    let mesh = star(16, |_| random.between(0.2, 1.0));
    let scene = PosedScene::new(vec![surface(&mesh)], vec![Pose::IDENTITY]);
    for _ in 0..20_000 {
        let first = half_line(DVec3::ZERO, random.direction(), 0.0);
        let hit = scene.cast(&first);
        let [a, b, c] = scene.surface(0).corners(hit.triangle).map(|v| scene.pose(0).point(v));
        let second = half_line(hit.distance * first.direction, random.direction(), NEAREST);
        // Along the surface it is a matter of rounding.
        if second.direction.dot((b - a).cross(c - a).normalize()).abs() > 1e-5 {
            assert_ne!(scene.cast(&second).triangle, hit.triangle, "{second:?}");
        }
    }
}

#[test]
fn a_point_is_occluded_if_the_nearest_hit_of_its_ray_is_before_it() {
    let (surfaces, poses) = furnished();
    let scene = PosedScene::new(surfaces, poses);
    let random = &mut Random(5);
    let mut place = || 4.0 * DVec3::X + DVec3::new(4.0, 2.0, 2.0) * random.point();
    let points: Vec<DVec3> = (0..5000).map(|_| place()).collect();
    let is_behind = |point: &DVec3| scene.cast(&half_line(DVec3::ZERO, *point, NEAREST)).distance < 1.0;
    let expected: Vec<bool> = points.iter().map(is_behind).collect();
    assert_eq!(scene.occluded(&points), expected);
    let between = |i: &usize| points[*i].x > 3.2 && points[*i].x < 6.0;
    let num_occluded = (0..5000).filter(between).filter(|i| expected[*i]).count();
    assert!((20..1000).contains(&num_occluded), "{num_occluded}");
}
