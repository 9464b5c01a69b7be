//! Rays of an image against a room: rays per second.
//!
//! `room_*`: all triangles in one body; `spheres`: a room and spheres, every one a body with a pose of its own, or all
//! as one; fineness: triangles from larger than pixels to far smaller; person: fine triangles of many bodies; motion:
//! cost of new poses; twisted: a tree after a large refit; `occluded`: points behind spheres, per second.

mod common;

use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::{DMat3, DVec3};
use radarcore::stages::{Cast, Level, PosedScene, Ray};
use radarcore::{Cancel, ImagePlane, Pose, ShadingMode, Surface};

/// Square image of 60 degrees.
fn plane() -> ImagePlane {
    square(common::sizes([256], 8)[0])
}

/// Image plane of another size.
fn square(side: usize) -> ImagePlane {
    let half = 30_f64.to_radians().tan();
    ImagePlane::centered(side, side, half, half)
}

fn surface((vertices, triangles): &common::Triangles) -> Arc<Surface> {
    Arc::new(Surface::new(vertices, triangles, ShadingMode::Flat, &Cancel::default()).unwrap())
}

/// Rays per second through `PosedScene::cast_image` on one thread, at every level and on two; and of rays one by one.
fn cast(criterion: &mut Criterion, name: &str, scene: &PosedScene) {
    let plane = plane();
    let mut group = criterion.benchmark_group("trace");
    group.throughput(Throughput::Elements(plane.num_pixels() as u64));
    for threads in [1, 2] {
        let pool = common::pool(threads);
        group.bench_function(BenchmarkId::new(name, common::threads_id(threads)), |bencher| {
            bencher.iter(|| pool.install(|| scene.cast_image(&plane, &Cast::default()).unwrap()));
        });
    }
    let pool = common::pool(1);
    for level in Level::available() {
        group.bench_function(BenchmarkId::new(name, level.name()), |bencher| {
            bencher.iter(|| {
                pool.install(|| {
                    scene
                        .cast_image(
                            &plane,
                            &Cast {
                                level,
                                ..Cast::default()
                            },
                        )
                        .unwrap()
                })
            });
        });
    }
    group.bench_function(BenchmarkId::new(name, "one_by_one"), |bencher| {
        bencher.iter(|| {
            let cast = |pixel: usize| {
                let ray = Ray {
                    origin: DVec3::ZERO,
                    direction: plane.direction(pixel / plane.columns, pixel % plane.columns),
                    start: 1e-9,
                };
                scene.cast(&ray).distance
            };
            (0..plane.num_pixels()).map(cast).fold(0.0, f64::max)
        });
    });
    group.finish();
}

/// One body of more and more triangles.
fn rooms(criterion: &mut Criterion) {
    for size in common::sizes([5000, 100_000, 1_000_000], 100) {
        let scene = PosedScene::new(vec![surface(&common::room(size))], vec![Pose::IDENTITY]);
        cast(criterion, &format!("room_{}", common::size_id(size)), &scene);
    }
}

/// A room and spheres that share one surface, at places spread evenly over the space in front of the sensor.
fn furnished(room: Arc<Surface>, sphere: &Arc<Surface>, num_bodies: usize) -> (Vec<Arc<Surface>>, Vec<Pose>) {
    let (mut surfaces, mut poses) = (vec![room], vec![Pose::IDENTITY]);
    for i in 1..num_bodies {
        // Multiples of golden ratios, modulo one.
        let spread = |step: f64| (step * i as f64).fract() - 0.5;
        surfaces.push(sphere.clone());
        poses.push(Pose {
            rotation: DMat3::from_rotation_z(i as f64),
            translation: DVec3::new(3.0, 0.0, 0.4)
                + DVec3::new(4.0, 4.0, 2.0) * DVec3::new(spread(0.819_17), spread(0.671_04), spread(0.549_70)),
        });
    }
    (surfaces, poses)
}

/// More and more bodies: the room of 5 k triangles, then spheres of 1 k triangles, every one a body; and all of them as
/// one.
fn two_levels(criterion: &mut Criterion) {
    let room = surface(&common::room(common::sizes([5000], 100)[0]));
    let sphere = surface(&common::sphere(0.1, common::sizes([1000], 100)[0]));
    for num_bodies in common::sizes([1, 10, 50, 200], 3) {
        let (surfaces, poses) = furnished(room.clone(), &sphere, num_bodies);
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for (surface, pose) in surfaces.iter().zip(&poses) {
            for triangle in 0..surface.num_triangles() as u32 {
                triangles.push([0, 1, 2].map(|corner| vertices.len() as u32 + corner));
                vertices.extend(surface.corners(triangle).map(|corner| pose.point(corner)));
            }
        }
        let flat = PosedScene::new(vec![self::surface(&(vertices, triangles))], vec![Pose::IDENTITY]);
        cast(
            criterion,
            &format!("spheres/{num_bodies}_bodies"),
            &PosedScene::new(surfaces, poses),
        );
        cast(criterion, &format!("spheres/{num_bodies}_bodies_as_one"), &flat);
    }
}

/// Triangles from larger than tiles to far smaller, in all directions and in some.
fn fineness(criterion: &mut Criterion) {
    let ahead = Pose {
        translation: DVec3::new(2.0, 0.0, 0.0),
        ..Pose::IDENTITY
    };
    let pool = common::pool(1);
    let mut group = criterion.benchmark_group("fineness");
    for size in common::sizes([100_000, 400_000, 1_000_000], 100) {
        let room = PosedScene::new(vec![surface(&common::room(size))], vec![Pose::IDENTITY]);
        let sphere = PosedScene::new(vec![surface(&common::sphere(1.0, size))], vec![ahead]);
        for (name, scene) in [("room", room), ("sphere", sphere)] {
            for side in common::sizes([128, 256, 512], 8) {
                let plane = square(side);
                group.throughput(Throughput::Elements(plane.num_pixels() as u64));
                let id = BenchmarkId::new(format!("{name}_{}", common::size_id(size)), side);
                group.bench_function(id, |bencher| {
                    bencher.iter(|| pool.install(|| scene.cast_image(&plane, &Cast::default()).unwrap()));
                });
            }
        }
    }
    group.finish();
}

/// A person of 16 bodies, from pixels far larger than triangles to smaller ones.
fn people(criterion: &mut Criterion) {
    let ahead = Pose {
        rotation: DMat3::from_rotation_z(2.6),
        translation: DVec3::new(2.0, 0.0, 0.0),
    };
    let mode = ShadingMode::Smooth { crease_angle: 0.6 };
    let parts = common::person(common::sizes([109_000], 1000)[0]);
    let surfaces: Vec<Arc<Surface>> = parts
        .iter()
        .map(|(vertices, triangles)| Arc::new(Surface::new(vertices, triangles, mode, &Cancel::default()).unwrap()))
        .collect();
    let poses = vec![ahead; surfaces.len()];
    let scene = PosedScene::new(surfaces, poses);
    let pool = common::pool(1);
    let mut group = criterion.benchmark_group("person");
    for side in common::sizes([64, 128, 256, 512, 1024], 8) {
        let plane = square(side);
        group.throughput(Throughput::Elements(plane.num_pixels() as u64));
        group.bench_function(BenchmarkId::new("hits", side), |bencher| {
            bencher.iter(|| pool.install(|| scene.cast_image(&plane, &Cast::default()).unwrap()));
        });
    }
    group.finish();
}

/// Run time of new poses of 50 bodies of 10 k triangles, before rays are cast.
fn motion(criterion: &mut Criterion) {
    let room = surface(&common::room(common::sizes([10_000], 100)[0]));
    let sphere = surface(&common::sphere(0.1, common::sizes([10_000], 100)[0]));
    let (surfaces, poses) = furnished(room, &sphere, common::sizes([50], 3)[0]);
    criterion.bench_function("motion/50_bodies", |bencher| {
        bencher.iter(|| PosedScene::new(surfaces.clone(), poses.clone()));
    });
    cast(criterion, "motion/50_bodies", &PosedScene::new(surfaces, poses));
}

/// A sphere that was twisted as far as its tree is kept, and the same built anew.
fn twisted(criterion: &mut Criterion) {
    let (vertices, triangles) = common::sphere(1.0, common::sizes([100_000], 100)[0]);
    let twist = |p: &DVec3| DMat3::from_rotation_z(1.8 * p.z) * *p;
    let bent: Vec<DVec3> = vertices.iter().map(twist).collect();
    let deformed = surface(&(vertices, triangles.clone()))
        .deform(bent.clone(), &Cancel::default())
        .unwrap();
    let ahead = Pose {
        translation: DVec3::new(2.0, 0.0, 0.0),
        ..Pose::IDENTITY
    };
    cast(
        criterion,
        "twisted/refitted",
        &PosedScene::new(vec![Arc::new(deformed)], vec![ahead]),
    );
    let rebuilt = surface(&(bent, triangles));
    cast(
        criterion,
        "twisted/rebuilt",
        &PosedScene::new(vec![rebuilt], vec![ahead]),
    );
}

/// Occlusion of points amid spheres.
fn occluded(criterion: &mut Criterion) {
    let room = surface(&common::room(common::sizes([5000], 100)[0]));
    let sphere = surface(&common::sphere(0.1, common::sizes([1000], 100)[0]));
    let plane = plane();
    let point = |pixel: usize| 3.0 * plane.direction(pixel / plane.columns, pixel % plane.columns);
    let points: Vec<DVec3> = (0..plane.num_pixels()).map(point).collect();
    let pool = common::pool(1);
    let mut group = criterion.benchmark_group("occluded");
    group.throughput(Throughput::Elements(points.len() as u64));
    for num_bodies in common::sizes([10, 200], 3) {
        let (surfaces, poses) = furnished(room.clone(), &sphere, num_bodies);
        let scene = PosedScene::new(surfaces, poses);
        group.bench_function(format!("{num_bodies}_bodies"), |bencher| {
            bencher.iter(|| pool.install(|| scene.occluded(&points)));
        });
    }
    group.finish();
}

fn main() {
    let mut criterion = common::criterion();
    rooms(&mut criterion);
    two_levels(&mut criterion);
    fineness(&mut criterion);
    people(&mut criterion);
    motion(&mut criterion);
    twisted(&mut criterion);
    occluded(&mut criterion);
    criterion.final_summary();
}
