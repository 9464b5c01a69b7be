//! Rays of an image against a room: rays per second.
//!
//! `room_*`: all triangles in one body; `spheres`: a room and spheres, every one a body with a pose of its own.

mod common;

use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::{DMat3, DVec3};
use radarcore::bvh::Ray;
use radarcore::motion::Pose;
use radarcore::rays::ImagePlane;
use radarcore::simd::Level;
use radarcore::surface::{ShadingMode, Surface};
use radarcore::trace::Snapshot;

/// Square image of 60 degrees.
fn plane() -> ImagePlane {
    let side = common::sizes([256], 8)[0];
    let half = 30_f64.to_radians().tan();
    ImagePlane::centered(side, side, half, half)
}

fn surface((vertices, triangles): &common::Triangles) -> Arc<Surface> {
    Arc::new(Surface::new(vertices, triangles, ShadingMode::Flat).unwrap())
}

/// Rays per second through `Snapshot::cast_image` on one thread, at every level and on two; and of rays one by one.
fn cast(criterion: &mut Criterion, name: &str, snapshot: &Snapshot) {
    let plane = plane();
    let mut group = criterion.benchmark_group("trace");
    group.throughput(Throughput::Elements(plane.num_pixels() as u64));
    for threads in [1, 2] {
        let pool = common::pool(threads);
        group.bench_function(BenchmarkId::new(name, common::threads_id(threads)), |bencher| {
            bencher.iter(|| pool.install(|| snapshot.cast_image(&plane).unwrap()));
        });
    }
    let pool = common::pool(1);
    for level in Level::available() {
        group.bench_function(BenchmarkId::new(name, level.name()), |bencher| {
            bencher.iter(|| pool.install(|| snapshot.cast_image_at(&plane, level).unwrap()));
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
                snapshot.cast(&ray).distance
            };
            (0..plane.num_pixels()).map(cast).fold(0.0, f64::max)
        });
    });
    group.finish();
}

/// One body of more and more triangles.
fn rooms(criterion: &mut Criterion) {
    for size in common::sizes([5000, 100_000, 1_000_000], 100) {
        let snapshot = Snapshot::new(vec![surface(&common::room(size))], vec![Pose::IDENTITY]);
        cast(criterion, &format!("room_{}", common::size_id(size)), &snapshot);
    }
}

/// More and more bodies: the room of 5 k triangles, then spheres of 1 k triangles that share one surface.
fn two_levels(criterion: &mut Criterion) {
    let room = surface(&common::room(common::sizes([5000], 100)[0]));
    let sphere = surface(&common::sphere(0.1, common::sizes([1000], 100)[0]));
    for num_bodies in common::sizes([1, 10, 50], 3) {
        let (mut surfaces, mut poses) = (vec![room.clone()], vec![Pose::IDENTITY]);
        for i in 1..num_bodies {
            // Spread evenly over the space in front of the sensor (multiples of golden ratios, modulo one).
            let spread = |step: f64| (step * i as f64).fract() - 0.5;
            surfaces.push(sphere.clone());
            poses.push(Pose {
                rotation: DMat3::from_rotation_z(i as f64),
                translation: DVec3::new(3.0, 0.0, 0.4)
                    + DVec3::new(4.0, 4.0, 2.0) * DVec3::new(spread(0.819_17), spread(0.671_04), spread(0.549_70)),
            });
        }
        let name = format!("spheres/{num_bodies}_bodies");
        cast(criterion, &name, &Snapshot::new(surfaces, poses));
    }
}

fn main() {
    let mut criterion = common::criterion();
    rooms(&mut criterion);
    two_levels(&mut criterion);
    criterion.final_summary();
}
