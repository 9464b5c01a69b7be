//! Rays at edges, vertices, needles and seams of closed meshes do not leak.

use super::exhaustive::Answer;
use super::meshes::{Mesh, Random, lens, moved, prism, star, surface, turned, turns};
use super::{Scene, is_near, odd};
use crate::numeric::simd::Level;
use crate::rays::tree::Ray;
use crate::{ImagePlane, Pose};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Half the pixels between two vertices of a [`star`], so that every pixel looks at a vertex or at the middle of an edge.
const CELLS: usize = 32;

/// The image that is one face of a [`star`] of [`CELLS`], with some pixels of the neighbours' first.
fn face(shift: usize) -> ImagePlane {
    odd([CELLS, CELLS], [1.0 / CELLS as f64; 2], shift)
}

#[test]
fn a_million_rays_at_edges_and_vertices_of_closed_meshes_do_not_leak_at_any_level() {
    let (mut cases, mut seed) = (Vec::new(), 0);
    for scale in [1e-4, 1.0, 1e3] {
        for roughness in [0.0, 0.05, 0.8] {
            // The sensor is at the origin of the body's coordinates, near it and far from it.
            for offset in [0.0, 0.3, 1e3] {
                for is_turned in [false, true] {
                    seed += 1;
                    cases.push((seed, scale, roughness, offset, is_turned));
                }
            }
        }
    }
    let counts: Vec<usize> = cases
        .into_par_iter()
        .map(|(seed, scale, roughness, offset, is_turned)| {
            let mut random = Random::new(seed);
            let mesh = star(CELLS, |_| scale * random.between(1.0 - roughness, 1.0));
            let rotation = if is_turned { random.rotation() } else { DMat3::IDENTITY };
            let (mesh, pose) = moved(&mesh, rotation, scale * offset * random.direction());
            let surface = surface(&mesh);
            let mut num_rays = 0;
            for (i, turn) in turns().into_iter().enumerate() {
                let scene = Scene::new(vec![(surface.clone(), turned(turn, &pose))], 0.0);
                let plane = face((i + seed as usize) % 8);
                scene.cast(&plane, |_, ray, _, answer| {
                    scene.is_closed(ray, &answer)?;
                    if roughness == 0.0 {
                        // A cube: the nearest of its planes.
                        is_near(answer.distance, scale / ray.direction.abs().max_element())?;
                    }
                    Ok(())
                });
                num_rays += (2 * CELLS + 1).pow(2);
            }
            num_rays
        })
        .collect();
    let rays: usize = counts.iter().sum();
    assert!(rays > 1_000_000, "{rays}");
    println!("{rays} rays at {} levels", Level::available().len());
}

#[test]
fn a_closed_mesh_of_two_bodies_does_not_leak_at_their_seams() {
    for seed in 0..6 {
        let mut random = Random::new(seed);
        let mesh = star(CELLS, |_| random.between(0.5, 1.0));
        let ((vertices, triangles), pose) = moved(&mesh, random.rotation(), 3.0 * random.point());
        let halves = [0, 1].map(|half| {
            let own = triangles.iter().enumerate().filter(|(i, _)| i % 2 == half);
            surface(&(vertices.clone(), own.map(|(_, t)| *t).collect()))
        });
        let pose = turned(turns()[seed as usize % 6], &pose);
        Scene::new(halves.into_iter().map(|half| (half, pose)).collect(), 0.0).check_closed(&face(0));
    }
}

#[test]
fn a_million_single_rays_at_edges_and_vertices_of_spheres_do_not_leak() {
    (0..40_u64).into_par_iter().for_each(|seed| {
        let mut random = Random::new(seed);
        let scale = 10_f64.powf(random.between(-4.0, 3.0));
        let mesh = star(8, |corner| scale / corner.length());
        let offset = if seed % 3 == 0 { 1e3 * scale } else { scale };
        let (body, pose) = moved(&mesh, random.rotation(), offset * random.direction());
        let scene = Scene::new(vec![(surface(&body), pose)], scale);
        for round in 0..12 {
            let origin = if round == 0 {
                DVec3::ZERO
            } else {
                0.4 * scale * random.point()
            };
            for triangle in &mesh.1 {
                let [a, b, _] = triangle.map(|i| mesh.0[i as usize]);
                for share in [0.0, 0.5, random.between(0.0, 1.0)] {
                    let to = a + share * (b - a) - origin;
                    let ray = Ray {
                        origin,
                        direction: to.normalize(),
                        start: 0.0,
                    };
                    let answer = Answer::from(scene.posed.cast(&ray));
                    let result = scene.is_closed(&ray, &answer);
                    if let Err(reason) = result.and_then(|()| is_near(answer.distance, to.length())) {
                        panic!("seed {seed}: {reason}");
                    }
                }
            }
        }
    });
}

/// Closed prism about the origin with 65 corners `width` apart in front, bent by up to `bend` widths, fans at `apex`.
fn needle_prism(width: f64, bend: f64, apex: f64, random: &mut Random) -> Mesh {
    let mut polygon = vec![[1.0, -1.0]];
    for k in -32..=32 {
        let x = 1.0 + bend * width * random.between(-1.0, 1.0);
        polygon.push([x, x * f64::from(k) * width]);
    }
    polygon.extend([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]);
    prism(&polygon, apex)
}

#[test]
fn needles_and_slivers_of_closed_meshes_do_not_leak() {
    // Slivers and needles are 1 to 2 long: aspects of 1e-6 and 1e-9, halved exactly.
    for (i, width) in [19, 20, 29].map(|digits| 0.5_f64.powi(digits)).into_iter().enumerate() {
        for (j, (bend, apex)) in [(0.0, 1.0), (0.1, 1.0), (0.1, 0.5), (3.0, 2.0)].into_iter().enumerate() {
            // Every width and every shape with two offsets, every shape with two widths.
            let k = (i + j) % 3;
            if (i + 2 * j) % 3 == 2 {
                continue;
            }
            let offset = [0.0, 1.0, 1e3][k];
            let mut random = Random::new((100 * i + 10 * j + k) as u64);
            let mesh = needle_prism(width, bend, apex, &mut random);
            let rotation = if k == 0 { DMat3::IDENTITY } else { random.rotation() };
            let (mesh, pose) = moved(&mesh, rotation, offset * random.direction());
            let surface = surface(&mesh);
            let scene = |turn: DMat3| Scene::new(vec![(surface.clone(), turned(turn, &pose))], 0.0);
            // Walls: a pixel at every vertical edge and one between, where the diagonals are met at half their height.
            let walls = scene(turns()[0]);
            for size in [1.0, 0.25] {
                walls.cast(
                    &odd([33, 70], [1.0 / 32.0, 0.5 * width * size], i),
                    |_, ray, _, answer| {
                        walls.is_closed(ray, &answer)?;
                        if bend == 0.0 && width > 1e-8 {
                            is_near(answer.distance, 1.0 / ray.direction.abs().max_element())?;
                        }
                        Ok(())
                    },
                );
            }
            // Fans, from their common corner outwards: in every row, pixels at all spokes.
            for turn in [turns()[4], turns()[5]] {
                scene(turn).check_closed(&odd([9, 8 * 33], [1.0 / 8.0, width / 8.0], i));
            }
        }
    }
}

#[test]
fn single_rays_at_edges_of_needles_do_not_leak() {
    for (seed, width) in [19, 29].map(|digits| 0.5_f64.powi(digits)).into_iter().enumerate() {
        let mut random = Random::new(seed as u64);
        let mesh = needle_prism(width, 0.0, 1.0, &mut random);
        let (body, pose) = moved(&mesh, random.rotation(), random.direction());
        let scene = Scene::new(vec![(surface(&body), pose)], 1.0);
        for _ in 0..50 {
            let origin = 0.9 * random.point();
            for triangle in &mesh.1 {
                let [a, b, _] = triangle.map(|i| mesh.0[i as usize]);
                for share in [0.0, 0.5, random.between(0.0, 1.0)] {
                    let ray = Ray {
                        origin,
                        direction: (a + share * (b - a) - origin).normalize(),
                        start: 0.0,
                    };
                    let result = scene.is_closed(&ray, &scene.posed.cast(&ray).into());
                    if let Err(reason) = result {
                        panic!("width {width}: {reason}");
                    }
                }
            }
        }
    }
}

#[test]
fn the_front_of_a_closed_body_hides_its_back() {
    // Seen from outside: pixels look at vertices and at middles of edges of the front. None looks at the rim.
    for half in [0.5, 1e-3] {
        let plane = odd([CELLS - 1; 2], [half / CELLS as f64; 2], 0);
        for distance in [1e-3, 1.0, 1e3] {
            let mut random = Random::new(1);
            let mesh = lens(CELLS, half, |_| distance * (1.0 + half * random.between(-1e-3, 1e-3)));
            let num_front = 2 * (CELLS * CELLS) as u32;
            let turned = moved(&mesh, random.rotation(), distance * random.direction());
            for (mesh, pose) in [(mesh, Pose::IDENTITY), turned] {
                let scene = Scene::of(&mesh, pose);
                scene.cast(&plane, |_, ray, _, answer| {
                    if answer.triangle >= num_front {
                        return Err(format!("leak: {answer:?} is behind the front"));
                    }
                    scene.is_closed(ray, &answer)
                });
            }
        }
    }
}
