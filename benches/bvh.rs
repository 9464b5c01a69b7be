//! Construction of bounding-volume trees and surfaces from triangles: triangles per second.
//!
//! `tree`: the bounding-volume tree over the boxes alone; `surface_flat`, `surface_smooth`: with the checks of the
//! mesh, and with the normals of curved surfaces, as a body is built. `deform`: the same for vertices that have moved.

mod common;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput};
use glam::DVec3;
use radarcore::stages::{Bounds, Tree, WIDTH};
use radarcore::{Cancel, ShadingMode, Surface};

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bvh/build");
    for size in common::sizes([5000, 100_000, 1_000_000], 100) {
        let (vertices, triangles) = common::room(size);
        let boxes: Vec<Bounds> = triangles
            .iter()
            .map(|t| Bounds::of(t.map(|vertex| vertices[vertex as usize])))
            .collect();
        let room = format!("room_{}", common::size_id(size));
        group.throughput(Throughput::Elements(triangles.len() as u64));
        group.bench_function(BenchmarkId::new("tree", &room), |bencher| {
            bencher.iter(|| Tree::build(boxes.len(), WIDTH, |i| boxes[i]));
        });
        for (name, mode) in [
            ("surface_flat", ShadingMode::Flat),
            (
                "surface_smooth",
                ShadingMode::Smooth {
                    crease_angle: 45_f64.to_radians(),
                },
            ),
        ] {
            group.bench_function(BenchmarkId::new(name, &room), |bencher| {
                bencher.iter(|| Surface::new(&vertices, &triangles, mode, &Cancel::default()).unwrap());
            });
        }
    }
    group.finish();
}

/// Deformation: new positions for all vertices, against a new construction.
fn deform(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bvh/deform");
    for size in common::sizes([5000, 100_000, 1_000_000], 100) {
        let (vertices, triangles) = common::room(size);
        let surface = Surface::new(&vertices, &triangles, ShadingMode::Flat, &Cancel::default()).unwrap();
        let bent: Vec<DVec3> = vertices
            .iter()
            .map(|p| *p + 0.01 * DVec3::splat((5.0 * p.x).sin()))
            .collect();
        group.throughput(Throughput::Elements(triangles.len() as u64));
        group.bench_function(
            BenchmarkId::new("surface_flat", format!("room_{}", common::size_id(size))),
            |bencher| {
                bencher.iter_batched(
                    || bent.clone(),
                    |bent| surface.deform(bent, &Cancel::default()).unwrap(),
                    BatchSize::PerIteration,
                );
            },
        );
    }
    group.finish();
}

fn main() {
    let mut criterion = common::criterion();
    build(&mut criterion);
    deform(&mut criterion);
    criterion.final_summary();
}
