//! All searches against an exhaustive one, to the last bit, and the exact test against integers.

pub mod scenes;

use std::sync::Arc;

use crate::cancel::Cancel;
use crate::geometry::pose::Pose;
use crate::numeric::simd::{Isa, Kernel, Level};
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Cast;
use crate::rays::packet::{PACKET, PACKETS};
use crate::rays::scene::{NEAREST, NO_BODY, PosedScene};
use crate::rays::search::Scratch;
use crate::rays::single_ray::{Hit, RayCast};
use crate::rays::surface::{ShadingMode, Surface};
use crate::rays::watertight::{Ray, WatertightTest};
use glam::{DMat3, DVec3, I64Vec3};
use rayon::prelude::*;
use scenes::{Case, Random};

/// Tests of a ray and a triangle in the exhaustive searches of a case.
const MOST_TESTS: usize = 600_000;

/// The slow truth: the exact test of every triangle. Of several at the same distance the first is hit.
fn exhaustive(scene: &PosedScene, ray: &Ray) -> Hit {
    let mut nearest = Hit::MISS;
    for body in 0..scene.num_bodies() as u32 {
        let pose = scene.pose(body);
        let test = WatertightTest::new(&Ray {
            origin: pose.point_to_body(ray.origin),
            direction: pose.direction_to_body(ray.direction),
            start: ray.start,
        });
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

/// Check all rays of a case at all levels: pixels hit what single rays hit, and some of these what an exhaustive search
/// hits. Returns the number of hits.
fn check(case: &Case) -> usize {
    let (surfaces, poses) = case.bodies.iter().cloned().unzip();
    let scene = PosedScene::new(surfaces, poses);
    let mut rays = case.rays.clone();
    for plane in &case.planes {
        let first = rays.len();
        for (row, column) in (0..plane.rows).flat_map(|row| (0..plane.columns).map(move |column| (row, column))) {
            let (u, v) = plane.center(row, column);
            rays.push(Ray {
                origin: DVec3::ZERO,
                direction: DVec3::new(1.0, u, v),
                start: NEAREST,
            });
        }
        for level in Level::available() {
            let options = Cast {
                level,
                ..Cast::default()
            };
            let hits = scene.cast_image(plane, &options).unwrap();
            for (pixel, ray) in rays[first..].iter().enumerate() {
                let hit = cast(&scene, ray, f64::INFINITY, level);
                let distance = hit.distance * ray.direction.length();
                let single = (hit.body, hit.triangle, distance);
                let packet = (hits.body[pixel], hits.triangle[pixel], hits.distance[pixel]);
                assert_eq!(packet, single, "{}: pixel {pixel} of {plane:?}, {level:?}", case.name);
            }
        }
    }
    let num_triangles: usize = case.bodies.iter().map(|(surface, _)| surface.num_triangles()).sum();
    let step = 1 + rays.len() * num_triangles / MOST_TESTS;
    let mut num_hits = 0;
    for (i, ray) in rays.iter().enumerate() {
        let hit = scene.cast(ray);
        let context = || format!("{}: {ray:?} {hit:?}", case.name);
        assert!((case.expect)(ray, &hit), "{}", context());
        num_hits += usize::from(hit.body != NO_BODY);
        if i % step != 0 {
            continue;
        }
        let key = |hit: &Hit| (hit.body, hit.triangle, hit.distance, hit.barycentric);
        assert_eq!(key(&hit), key(&exhaustive(&scene, ray)), "{}", context());
        for level in Level::available() {
            assert_eq!(
                key(&cast(&scene, ray, f64::INFINITY, level)),
                key(&hit),
                "{}",
                context()
            );
        }
        // Before the hit there is nothing.
        let [before, behind] = [1.0 - 1e-12, 1.0 + 1e-12].map(|factor| hit.distance * factor);
        assert_eq!(scene.blocks(ray, behind), hit.body != NO_BODY, "{}", context());
        if before > ray.start && hit.body != NO_BODY {
            assert!(!scene.blocks(ray, before), "{}", context());
            assert_eq!(
                key(&cast(&scene, ray, behind, Level::best())),
                key(&hit),
                "{}",
                context()
            );
        }
    }
    num_hits
}

#[test]
fn every_ray_hits_what_an_exhaustive_search_hits() {
    let cases = scenes::cases();
    let num_hits: usize = cases.par_iter().map(check).sum();
    assert!(num_hits > 1_000_000, "{num_hits}");
}

#[test]
fn the_exact_test_agrees_with_integers() {
    let random = &mut Random(1);
    let (mut num_hits, mut num_misses) = (0, 0);
    for _ in 0..300_000 {
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
        let ray = Ray {
            origin: shift,
            direction: direction.as_dvec3(),
            start: 0.0,
        };
        let crossing = WatertightTest::new(&ray).intersect(&[a, b, c].map(|v| v.as_dvec3() + shift));
        assert_eq!(
            crossing.is_some(),
            is_inside && distance > 0.0,
            "{a} {b} {c} {direction}"
        );
        let Some(crossing) = crossing else {
            num_misses += 1;
            continue;
        };
        num_hits += 1;
        assert!(
            (crossing.distance - distance).abs() < 1e-12 * distance,
            "{a} {b} {c} {direction}"
        );
        for (weight, side) in crossing.barycentric.into_iter().zip(sides) {
            assert!(
                (weight - side as f64 / slope as f64).abs() < 1e-9,
                "{a} {b} {c} {direction}"
            );
        }
    }
    assert!(num_hits > 50_000 && num_misses > 50_000, "{num_hits} {num_misses}");
}

#[test]
fn a_ray_towards_a_corner_of_a_triangle_seen_edge_on_does_not_end_in_the_air() {
    // In the plane of p and q through the origin, 3 to 5 m away.
    let (p, q) = (DVec3::new(0.6, 0.8, 0.1), DVec3::new(0.3, -0.2, 0.9));
    let corners = [3.0 * p + 1.1 * q, 4.0 * p + q, 3.5 * p + 2.3 * q];
    let ray = Ray {
        origin: DVec3::ZERO,
        direction: corners[1].normalize(),
        start: 0.0,
    };
    // Rounding may let it miss; else it enters at the far corner or, nearer, at the edge across.
    if let Some(hit) = WatertightTest::new(&ray).intersect(&corners) {
        let depths = corners.map(|corner| corner.dot(ray.direction));
        assert!(hit.distance >= depths.into_iter().fold(f64::INFINITY, f64::min));
    }
}

/// Square of two triangles about the origin, across the x axis.
pub fn square(half: f64) -> Arc<Surface> {
    let vertices = [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[y, z]| DVec3::new(0.0, y, z));
    Arc::new(
        Surface::new(
            &vertices,
            &[[0, 2, 1], [0, 3, 2]],
            ShadingMode::Flat,
            &Cancel::default(),
        )
        .unwrap(),
    )
}

/// A wall at x = 6 m, and ten small squares at 3 m.
pub fn furnished() -> (Vec<Arc<Surface>>, Vec<Pose>) {
    let pose = |angle: f64, translation: DVec3| Pose {
        rotation: DMat3::from_rotation_z(angle),
        translation,
    };
    let (mut surfaces, mut poses) = (vec![square(4.0)], vec![pose(0.0, 6.0 * DVec3::X)]);
    for i in 0..10 {
        let place = DVec3::new(3.0, 0.4 * f64::from(i % 5) - 0.8, 0.5 * f64::from(i / 5) - 0.25);
        surfaces.push(square(0.05 + 0.01 * f64::from(i)));
        poses.push(pose(0.1 * f64::from(i), place));
    }
    (surfaces, poses)
}

#[test]
fn a_ray_that_leaves_a_surface_does_not_hit_it_again() {
    // From where other rays hit a rough closed mesh, to both sides.
    let random = &mut Random(1);
    let case = scenes::cases()
        .into_iter()
        .find(|case| case.name.starts_with("star 1 0.8 0.3"))
        .unwrap();
    let (surfaces, poses) = case.bodies.into_iter().unzip();
    let scene = PosedScene::new(surfaces, poses);
    for _ in 0..50_000 {
        let first = Ray {
            origin: DVec3::ZERO,
            direction: random.direction(),
            start: 0.0,
        };
        let hit = scene.cast(&first);
        let [a, b, c] = scene.surface(0).corners(hit.triangle).map(|v| scene.pose(0).point(v));
        let second = Ray {
            origin: hit.distance * first.direction,
            direction: random.direction(),
            start: NEAREST,
        };
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
    let points: Vec<DVec3> = (0..5000)
        .map(|_| 4.0 * DVec3::X + DVec3::new(4.0, 2.0, 2.0) * random.point())
        .collect();
    let is_behind = |point: &DVec3| {
        let ray = Ray {
            origin: DVec3::ZERO,
            direction: *point,
            start: NEAREST,
        };
        scene.cast(&ray).distance < 1.0
    };
    let expected: Vec<bool> = points.iter().map(is_behind).collect();
    assert_eq!(scene.occluded(&points), expected);
    let between = |i: &usize| points[*i].x > 3.2 && points[*i].x < 6.0;
    let num_occluded = (0..5000).filter(between).filter(|i| expected[*i]).count();
    assert!((20..1000).contains(&num_occluded), "{num_occluded}");
}

/// Hits of a tile, for all packets and for the packets of a mask.
struct Masked<'a> {
    scene: &'a PosedScene,
    plane: &'a ImagePlane,
    tile: usize,
    packets: u32,
}

impl Kernel for Masked<'_> {
    type Output = [Box<Scratch>; 2];

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Self::Output {
        [u32::MAX, self.packets].map(|packets| {
            let mut scratch = Box::new(Scratch::new());
            scratch.rays.generate::<I>(self.plane, &self.plane.tile(self.tile));
            scratch.rays.mask(packets);
            self.scene.search::<I>(&mut scratch, &Cast::default());
            scratch.measure::<I>(self.scene);
            scratch
        })
    }
}

#[test]
fn masked_packets_hit_what_they_hit_in_the_whole_tile() {
    let (surfaces, poses) = furnished();
    let scene = PosedScene::new(surfaces, poses);
    let plane = ImagePlane::centered(53, 61, 0.8, 0.8);
    let mut num_hits = 0;
    for (level, tile) in Level::available()
        .into_iter()
        .flat_map(|level| (0..plane.num_tiles()).map(move |i| (level, i)))
    {
        let packets = tile as u32 % 16;
        let masked = Masked {
            scene: &scene,
            plane: &plane,
            tile,
            packets,
        };
        let [whole, part] = level.run(masked);
        for packet in 0..PACKETS {
            let rays = packet * PACKET..(packet + 1) * PACKET;
            if packets >> packet & 1 == 0 {
                assert!(
                    part.measured.distance[rays]
                        .iter()
                        .all(|distance| distance.is_infinite())
                );
                continue;
            }
            assert_eq!(part.hits.body[packet], whole.hits.body[packet]);
            assert_eq!(part.hits.triangle[packet], whole.hits.triangle[packet]);
            assert_eq!(
                part.measured.distance[rays.clone()],
                whole.measured.distance[rays.clone()]
            );
            assert_eq!(part.measured.cosine[rays.clone()], whole.measured.cosine[rays]);
            num_hits += part.hits.body[packet].iter().filter(|body| **body != NO_BODY).count();
        }
    }
    assert!(num_hits > 1000, "{num_hits}");
}
