//! Parts that the benches share: generated meshes, sizes for a once-through, and threads.

#![allow(dead_code)] // every bench is a crate of its own and uses a part

use std::time::Duration;

use criterion::Criterion;
use glam::DVec3;

/// Vertices and triangles.
pub type Triangles = (Vec<DVec3>, Vec<[u32; 3]>);

/// True in criterion's test mode, `cargo bench -- --test`, which runs every bench once: sizes are then tiny.
pub fn is_once_through() -> bool {
    std::env::args().any(|argument| argument == "--test")
}

/// Sizes to measure, or the one of a once-through; with criterion's `--quick` the first of several unless it is large.
pub fn sizes<const N: usize>(measured: [usize; N], once: usize) -> Vec<usize> {
    let is_quick = std::env::args().any(|argument| argument == "--quick");
    if is_once_through() || is_quick && (N == 1 || measured[0] > 10_000) {
        vec![once]
    } else if is_quick {
        measured[..1].to_vec()
    } else {
        measured.to_vec()
    }
}

/// Short measurements: the ratio of neighbours in one run matters, not the third digit.
pub fn criterion() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args()
}

/// A pool of its own; work runs on it inside `install`.
pub fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

/// `1_thread`, `2_threads`.
pub fn threads_id(threads: usize) -> String {
    format!("{threads}_thread{}", if threads == 1 { "" } else { "s" })
}

/// `5k`, `100k`, `1M`.
pub fn size_id(size: usize) -> String {
    match size {
        1_000_000.. => format!("{}M", size / 1_000_000),
        1000.. => format!("{}k", size / 1000),
        _ => size.to_string(),
    }
}

/// A room of 6 x 5 x 2.8 m with bumpy walls and four spheres, about `num_triangles` in all.
///
/// The sensor frame's origin is inside the room, half a metre from the wall behind it; the spheres are in front.
pub fn room(num_triangles: usize) -> Triangles {
    // Walls take half of the triangles, 12 (2 m)^2, and every sphere an eighth, 12 m^2.
    let m = (num_triangles as f64 / 96.0).sqrt().round().max(1.0) as usize;
    let walls = box_grid(2 * m, |p| {
        let wall = DVec3::new(2.5, 0.0, 0.4) + p * DVec3::new(3.0, 2.5, 1.4);
        let bump = 0.02 * ((7.0 * wall.x).sin() + (9.0 * wall.y).sin() + (11.0 * wall.z).sin());
        wall - bump * p
    });
    let places = [(1.5, 0.4, 0.0), (2.5, -0.7, 0.3), (3.5, 0.9, -0.3), (4.5, -0.2, 0.6)];
    let spheres = places.map(|(x, y, z)| box_grid(m, |p| DVec3::new(x, y, z) + 0.3 * p.normalize()));
    spheres.into_iter().fold(walls, join)
}

/// A sphere about the origin of about `num_triangles`.
pub fn sphere(radius: f64, num_triangles: usize) -> Triangles {
    let m = (num_triangles as f64 / 12.0).sqrt().round().max(1.0) as usize;
    box_grid(m, |p| radius * p.normalize())
}

/// The parts of a person of 1.8 m, standing at the origin: 16 ellipsoids of equal numbers of triangles.
pub fn person(num_triangles: usize) -> Vec<Triangles> {
    // Centre and half axes of each; limbs and their mirror images.
    let middle = [
        ([0.0, 0.0, 0.70], [0.10, 0.08, 0.12]),
        ([0.0, 0.0, 0.50], [0.06, 0.06, 0.10]),
        ([0.0, 0.0, 0.22], [0.12, 0.18, 0.32]),
        ([0.0, 0.0, -0.10], [0.12, 0.17, 0.14]),
    ];
    let left = [
        ([0.0, 0.22, 0.25], [0.05, 0.05, 0.17]),
        ([0.05, 0.24, -0.02], [0.04, 0.04, 0.15]),
        ([0.10, 0.24, -0.20], [0.03, 0.05, 0.09]),
        ([0.0, 0.10, -0.35], [0.08, 0.08, 0.24]),
        ([0.0, 0.10, -0.73], [0.06, 0.06, 0.22]),
        ([0.07, 0.10, -0.94], [0.13, 0.05, 0.04]),
    ];
    let mirrored = left.map(|([x, y, z], axes)| ([x, -y, z], axes));
    let parts = middle.iter().chain(&left).chain(&mirrored);
    parts
        .map(|(center, axes)| {
            let place = |p: &DVec3| DVec3::from(*center) + DVec3::from(*axes) * *p;
            let (vertices, triangles) = sphere(1.0, num_triangles / 16);
            (vertices.iter().map(place).collect(), triangles)
        })
        .collect()
}

/// The faces of the cube from -1 to 1, `n` by `n` squares each, cut into triangles and mapped: 12 n^2 triangles.
fn box_grid(n: usize, map: impl Fn(DVec3) -> DVec3) -> Triangles {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for (axis, side) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
        let first = vertices.len() as u32;
        for i in 0..=n {
            for j in 0..=n {
                let mut point = DVec3::splat(side);
                point[(axis + 1) % 3] = 2.0 * i as f64 / n as f64 - 1.0;
                point[(axis + 2) % 3] = 2.0 * j as f64 / n as f64 - 1.0;
                vertices.push(map(point));
            }
        }
        let row = n as u32 + 1;
        for i in 0..n as u32 {
            for j in 0..n as u32 {
                let a = first + i * row + j;
                let (b, c, d) = (a + row, a + row + 1, a + 1);
                triangles.extend(if side > 0.0 {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, c, b], [a, d, c]]
                });
            }
        }
    }
    (vertices, triangles)
}

/// Two meshes as one.
fn join((mut vertices, mut triangles): Triangles, (more, others): Triangles) -> Triangles {
    let first = vertices.len() as u32;
    triangles.extend(others.iter().map(|t| t.map(|vertex| vertex + first)));
    vertices.extend(more);
    (vertices, triangles)
}
