//! Rays against meshes that are hard on them, at every instruction set, compared with an exhaustive search and with answers
//! known on paper.

mod exhaustive;
mod meshes;

use std::sync::Arc;

use crate::{Cast, ImagePlane, Level, Pose, PosedScene, Ray, Traversals};
use exhaustive::{Answer, Exhaustive, TOLERANCE};
use glam::{DMat3, DVec3};
use meshes::{Bodies, Mesh, Random, join, lens, moved, prism, star, surface, turned, turns, wall};
use rayon::prelude::*;

/// Where rays of images start [m].
const START: f64 = 1e-9;

/// A scene as the ray engine has it, and as the exhaustive search has it.
struct Scene {
    snapshot: PosedScene,
    truth: Exhaustive,
}

impl Scene {
    /// For rays from origins with coordinates up to `origins`.
    fn new(bodies: Bodies, origins: f64) -> Self {
        let truth = Exhaustive::new(&bodies, origins);
        let (surfaces, poses) = bodies.into_iter().unzip();
        Self {
            snapshot: PosedScene::new(surfaces, poses),
            truth,
        }
    }

    fn of(mesh: &Mesh, pose: Pose) -> Self {
        Self::new(vec![(surface(mesh), pose)], 0.0)
    }

    /// Answers to all pixels: `judge` sees the level, the pixel's ray, its number and its answer.
    fn cast(&self, plane: &ImagePlane, mut judge: impl FnMut(Level, &Ray, usize, Answer) -> Result<(), String>) {
        let rays = rays(plane);
        for level in Level::available() {
            let [hits, together, apart] =
                [Traversals::Chosen, Traversals::Together, Traversals::Apart].map(|traversals| {
                    let cast = Cast {
                        level,
                        traversals,
                        ..Cast::default()
                    };
                    self.snapshot.cast_image_with(plane, &cast).unwrap()
                });
            assert_eq!(hits.distance.len(), rays.len());
            for other in [together, apart] {
                assert_eq!(hits.distance, other.distance);
                assert_eq!((&hits.body, &hits.triangle), (&other.body, &other.triangle));
            }
            for (pixel, ray) in rays.iter().enumerate() {
                let answer = Answer {
                    distance: hits.distance[pixel],
                    body: hits.body[pixel],
                    triangle: hits.triangle[pixel],
                };
                if let Err(reason) = judge(level, ray, pixel, answer) {
                    panic!("{level:?}, pixel {pixel} of {plane:?}: {reason}");
                }
            }
        }
    }

    /// All pixels against the exhaustive search. Returns how many hit, counted at one level.
    fn check(&self, plane: &ImagePlane) -> usize {
        let farthest = self.truth.farthest(&rays(plane));
        let mut num_hits = 0;
        self.cast(plane, |_, ray, pixel, answer| {
            num_hits += usize::from(answer.is_hit());
            self.truth.is_right(ray, farthest[pixel], &answer)
        });
        num_hits / Level::available().len()
    }

    /// All pixels of a sensor in a closed mesh of which every ray meets one point: it must be that one.
    fn check_closed(&self, plane: &ImagePlane) {
        self.cast(plane, |_, ray, _, answer| self.is_closed(ray, &answer));
    }

    fn is_closed(&self, ray: &Ray, answer: &Answer) -> Result<(), String> {
        if answer.is_hit() {
            self.truth.is_met(ray, answer)
        } else {
            Err(format!("leak: {ray:?}"))
        }
    }
}

/// The rays of an image, row by row.
fn rays(plane: &ImagePlane) -> Vec<Ray> {
    let direction = |pixel: usize| plane.direction(pixel / plane.columns, pixel % plane.columns);
    (0..plane.num_pixels())
        .map(|pixel| Ray {
            origin: DVec3::ZERO,
            direction: direction(pixel),
            start: START,
        })
        .collect()
}

/// Nothing, or that two distances differ.
fn is_near(distance: f64, expected: f64) -> Result<(), String> {
    if (distance - expected).abs() <= TOLERANCE * expected {
        Ok(())
    } else {
        Err(format!("{distance} m, expected {expected} m"))
    }
}

/// A cut-out of an image somewhere off its axis: `rows` x `columns` pixels round (u, v) = `middle`.
fn cut_out(rows: usize, columns: usize, du: f64, dv: f64, middle: [f64; 2]) -> ImagePlane {
    ImagePlane {
        rows,
        columns,
        du,
        dv,
        axis_column: 0.5 * columns as f64 + middle[0] / du,
        axis_row: 0.5 * rows as f64 + middle[1] / dv,
    }
}

/// `num` pixels to either side of one that looks along the axis, `shift` more on top and on the left.
fn odd(num: [usize; 2], size: [f64; 2], shift: usize) -> ImagePlane {
    ImagePlane {
        rows: 2 * num[0] + 1 + shift,
        columns: 2 * num[1] + 1 + shift,
        du: size[1],
        dv: size[0],
        axis_column: (num[1] + shift) as f64 + 0.5,
        axis_row: (num[0] + shift) as f64 + 0.5,
    }
}

#[test]
fn five_million_random_rays_of_images_hit_what_the_exhaustive_search_finds_at_every_level() {
    let counts: Vec<[usize; 2]> = (0..320)
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
    assert!(rays > 5_000_000 && hits > rays / 3, "{rays} {hits}");
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
fn five_million_random_rays_one_by_one_hit_what_the_exhaustive_search_finds() {
    let counts: Vec<[usize; 2]> = (1000..1320)
        .into_par_iter()
        .map(|seed| {
            let mut random = Random::new(seed);
            let (bodies, scale) = meshes::scene(&mut random);
            let rays: Vec<Ray> = (0..16_000).map(|_| random_ray(&mut random, &bodies, scale)).collect();
            let scene = Scene::new(bodies, 3.0 * scale);
            let mut num_hits = 0;
            for (ray, farthest) in rays.iter().zip(scene.truth.farthest(&rays)) {
                let answer = Answer::from(scene.snapshot.cast(ray));
                num_hits += usize::from(answer.is_hit());
                if let Err(reason) = scene.truth.is_right(ray, farthest, &answer) {
                    panic!("seed {seed}: {reason}");
                }
            }
            [rays.len(), num_hits]
        })
        .collect();
    let [rays, hits] = [0, 1].map(|i| counts.iter().map(|count| count[i]).sum::<usize>());
    assert!(rays > 5_000_000 && hits > rays / 5, "{rays} {hits}");
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
                    let answer = Answer::from(scene.snapshot.cast(&ray));
                    let verdict = scene.is_closed(&ray, &answer);
                    if let Err(reason) = verdict.and_then(|()| is_near(answer.distance, to.length())) {
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
            // Every offset with every width and with every shape.
            let k = (i + j) % 3;
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
        for _ in 0..100 {
            let origin = 0.9 * random.point();
            for triangle in &mesh.1 {
                let [a, b, _] = triangle.map(|i| mesh.0[i as usize]);
                for share in [0.0, 0.5, random.between(0.0, 1.0)] {
                    let ray = Ray {
                        origin,
                        direction: (a + share * (b - a) - origin).normalize(),
                        start: 0.0,
                    };
                    let verdict = scene.is_closed(&ray, &scene.snapshot.cast(&ray).into());
                    if let Err(reason) = verdict {
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

#[test]
fn of_coinciding_triangles_the_first_is_hit_whatever_the_level() {
    let mut random = Random::new(1);
    let mesh = star(4, |_| random.between(0.5, 1.0));
    for copies in [2, 3, 20] {
        // Copies of all triangles after all triangles: those with small numbers are hit.
        let num = mesh.1.len() as u32;
        let repeated = (mesh.0.clone(), mesh.1.repeat(copies));
        let (body, pose) = moved(&repeated, random.rotation(), random.point());
        let one_body = Scene::of(&body, pose);
        // The same surface several times: the first body is hit.
        let (single, pose) = moved(&mesh, random.rotation(), random.point());
        let single = surface(&single);
        let bodies = Scene::new(vec![(single, pose); copies], 0.0);
        let plane = ImagePlane::centered(30, 40, 1.0, 0.8);
        for scene in [&one_body, &bodies] {
            scene.cast(&plane, |_, ray, _, answer| {
                if answer.triangle >= num || answer.body != 0 {
                    return Err(format!("{answer:?} is not the first of several"));
                }
                let alone = Answer::from(scene.snapshot.cast(ray));
                if (alone.triangle, alone.body) != (answer.triangle, 0) {
                    return Err(format!("{answer:?}, but alone {alone:?}"));
                }
                scene.is_closed(ray, &answer)
            });
        }
    }
}

#[test]
fn of_triangles_in_one_plane_the_first_is_hit_whatever_their_corners() {
    // In front of the sensor, with coordinates that nothing rounds: both halves of a square and, overlapping them, others.
    let corners = [
        [-4.0, -4.0],
        [4.0, -4.0],
        [4.0, 4.0],
        [-4.0, 4.0],
        [0.0, 8.0],
        [0.0, -8.0],
    ];
    let vertices: Vec<DVec3> = corners.iter().map(|[y, z]| DVec3::new(2.0, *y, *z)).collect();
    let own = [[2, 0, 1], [0, 2, 3]];
    let others = [
        [0, 1, 2],
        [2, 1, 0],
        [1, 2, 0],
        [5, 1, 4],
        [5, 4, 3],
        [3, 4, 5],
        [0, 3, 2],
    ];
    let plane = ImagePlane::centered(24, 24, 0.99, 0.99);
    for behind in 1..20 {
        let triangles: Vec<[u32; 3]> = own.iter().chain(others.iter().cycle().take(behind)).copied().collect();
        let scene = Scene::of(&(vertices.clone(), triangles), Pose::IDENTITY);
        scene.cast(&plane, |_, ray, _, answer| {
            if answer.triangle > 1 {
                return Err(format!("{answer:?} is not the first of several"));
            }
            is_near(answer.distance, 2.0 / ray.direction.x)
        });
    }
}

#[test]
fn a_hundred_times_the_same_triangle_is_hit_once() {
    let (vertices, triangles) = wall(2.0, 5.0);
    let scene = Scene::of(&(vertices, triangles.repeat(100)), Pose::IDENTITY);
    scene.cast(&ImagePlane::centered(16, 16, 0.9, 0.9), |_, ray, _, answer| {
        if answer.triangle > 1 {
            return Err(format!("{answer:?}"));
        }
        is_near(answer.distance, 2.0 / ray.direction.x)
    });
}

#[test]
fn sheets_that_are_a_billionth_apart_are_told_apart() {
    // The nearer sheet comes last, so that taking both for one place would find the other.
    for (distance, gap) in [(1.0, 1e-9), (1e3, 1e-6), (1e-3, 1e-12)] {
        let [back, front] = [distance * (1.0 + gap / distance), distance].map(|x| wall(x, 2.0 * distance));
        let plane = ImagePlane::centered(17, 23, 0.8, 0.9);
        let one_body = Scene::of(&join(back.clone(), front.clone()), Pose::IDENTITY);
        one_body.cast(&plane, |_, ray, _, answer| {
            if answer.triangle < 2 {
                return Err(format!("{answer:?} is the back"));
            }
            is_near(answer.distance, distance / ray.direction.x)
        });
        let bodies = [back, front].map(|mesh| (surface(&mesh), Pose::IDENTITY));
        Scene::new(bodies.to_vec(), 0.0).cast(&plane, |_, ray, _, answer| {
            if answer.body != 1 {
                return Err(format!("{answer:?} is the back"));
            }
            is_near(answer.distance, distance / ray.direction.x)
        });
    }
}

#[test]
fn small_squares_just_before_a_slanted_wall_hide_it() {
    // Boxes of the wall begin before those of the squares, so that the wall is found first; what is barely nearer than a
    // find must still be looked at.
    for gap in [1e-3, 1e-6, 1e-9] {
        let (vertices, triangles) = wall(1.0, 1.0);
        let slanted = vertices.iter().map(|v| DVec3::new(1.0 + 0.5 * v.y, v.y, v.z));
        let mut mesh: Mesh = (slanted.collect(), triangles);
        let places: Vec<[f64; 2]> = (0..64)
            .map(|i| [i % 8, i / 8].map(|k| 0.2 * f64::from(k) - 0.7))
            .collect();
        for [y, z] in &places {
            // The corner of a square that is nearest to the wall is `gap` from it.
            let (vertices, triangles) = wall(1.0 + 0.5 * y - 1.5 * gap, gap);
            let square = vertices.iter().map(|v| *v + DVec3::new(0.0, *y, *z)).collect();
            mesh = join(mesh, (square, triangles));
        }
        let (wall, squares) = mesh.1.split_at(2);
        let bodies = [wall, squares].map(|triangles| (surface(&(mesh.0.clone(), triangles.to_vec())), Pose::IDENTITY));
        for scene in [Scene::of(&mesh, Pose::IDENTITY), Scene::new(bodies.to_vec(), 0.0)] {
            for [y, z] in &places {
                let x = 1.0 + 0.5 * y - 1.5 * gap;
                let plane = cut_out(16, 16, 0.1 * gap / x, 0.1 * gap / x, [y / x, z / x]);
                scene.cast(&plane, |_, ray, _, answer| {
                    if answer.body == 0 && answer.triangle < 2 {
                        return Err(format!("{answer:?} is the wall"));
                    }
                    is_near(answer.distance, x / ray.direction.x)
                });
            }
        }
    }
}

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
            let answer = scene.snapshot.cast(ray).into();
            if let Err(reason) = scene.truth.is_right(ray, farthest, &answer) {
                panic!("seed {seed}: {reason}");
            }
        }
    }
}

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
        let hit = scene.snapshot.cast(&first);
        let [a, b, c] = scene.snapshot.surface(0).corners(hit.triangle).map(|v| pose.point(v));
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
        let answer = Answer::from(scene.snapshot.cast(ray));
        assert_ne!(answer.triangle, from[i], "{ray:?} {answer:?}");
        if let Err(reason) = scene.truth.is_right(ray, farthest[i], &answer) {
            panic!("{reason}");
        }
    }
}

#[test]
fn a_part_of_a_tenth_of_a_millimetre_is_seen_before_a_wall_of_a_kilometre() {
    let (part, far) = (wall(1.0, 5e-5), wall(500.0, 500.0));
    let one_body = vec![(surface(&join(part.clone(), far.clone())), Pose::IDENTITY)];
    let bodies = [part, far].map(|mesh| (surface(&mesh), Pose::IDENTITY)).to_vec();
    // From the whole part in one pixel to a pixel of a ten thousandth of it.
    for (bodies, parts_triangles) in [(one_body, true), (bodies, false)] {
        let scene = Scene::new(bodies, 0.0);
        for size in [9e-5, 1e-5, 3e-7, 1e-8] {
            for middle in [[0.0, 0.0], [5.1e-5, -4.9e-5], [4.9e-5, 0.0]] {
                let plane = cut_out(41, 37, size, size, middle);
                scene.cast(&plane, |_, ray, pixel, answer| {
                    let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
                    let beyond = u.abs().max(v.abs()) - 5e-5;
                    if beyond.abs() < 1e-12 {
                        return Ok(()); // on the outline
                    }
                    let is_part = if parts_triangles {
                        answer.triangle < 2
                    } else {
                        answer.body == 0
                    };
                    if is_part != (beyond < 0.0) {
                        return Err(format!("{answer:?} at {beyond} from the outline"));
                    }
                    let plane_at = if is_part { 1.0 } else { 500.0 };
                    is_near(answer.distance, plane_at / ray.direction.x)
                });
            }
        }
    }
}

#[test]
fn sizes_from_a_tenth_of_a_millimetre_to_a_kilometre_make_one_scene() {
    for seed in 0..2 {
        let mut random = Random::new(seed);
        // Shells about the sensor and parts between them, ten times larger from one to the next; the last is closed.
        let mut mesh = star(2, |_| 500.0);
        let mut parts = Vec::new();
        for size in [5e-5, 5e-4, 5e-3, 0.05, 0.5, 5.0, 50.0] {
            let place = 4.0 * size * (DVec3::X + 0.5 * random.point());
            parts.push(place);
            let (vertices, triangles) = star(2, |_| size * random.between(0.5, 1.0));
            mesh = join(mesh, (vertices.iter().map(|v| *v + place).collect(), triangles));
        }
        let (body, pose) = moved(&mesh, random.rotation(), 100.0 * random.point());
        let scene = Scene::of(&body, pose);
        for place in parts {
            for half in [1e-2, 0.3, 2.0] {
                let middle = [place.y / place.x, place.z / place.x];
                let plane = cut_out(61, 53, 2.0 * half / 53.0, 2.0 * half / 61.0, middle);
                assert_eq!(scene.check(&plane), plane.num_pixels(), "leak");
            }
        }
    }
}

#[test]
fn a_scene_a_kilometre_from_the_origin_is_the_same_scene() {
    // Coordinates are multiples of 2^-20 m, so that moving them by a kilometre rounds nothing.
    let mut random = Random::new(1);
    let steps = |x: f64| (x * 1_048_576.0).round() / 1_048_576.0;
    let mesh = star(8, |_| 1.0);
    let rough = |v: &DVec3| (*v * random.between(0.5, 1.0)).map(steps);
    let mesh: Mesh = (mesh.0.iter().map(rough).collect(), mesh.1);
    let here = Scene::of(&mesh, Pose::IDENTITY);
    let plane = ImagePlane::centered(64, 64, 1.2, 1.1);
    let shifts = [DVec3::X, DVec3::ONE, DVec3::new(0.0, -1.0, 1.0)].map(|axis| 1024.0 * axis);
    for shift in shifts {
        let (moved, pose) = moved(&mesh, DMat3::IDENTITY, -shift);
        let there = Scene::of(&moved, pose);
        for level in Level::available() {
            let [here, there] =
                [&here, &there].map(|scene| scene.snapshot.cast_image_at(&plane, level).unwrap().distance);
            for (here, there) in here.iter().zip(&there) {
                is_near(*there, *here).unwrap();
            }
        }
    }
}

#[test]
fn leaves_hold_any_number_of_triangles() {
    // A band of 1, 2, 3, ... triangles: what fills up a leaf after the last of them is not hit.
    for num in 1..=70_u32 {
        let place = |i: u32| {
            let side = if i.is_multiple_of(2) { -1.0 } else { 1.0 };
            DVec3::new(1.0, 0.9 - 1.7 * f64::from(i) / f64::from(num + 1), 0.7 * side)
        };
        let mesh = (
            (0..num + 2).map(place).collect(),
            (0..num).map(|i| [i, i + 1, i + 2]).collect(),
        );
        let scene = Scene::of(&mesh, Pose::IDENTITY);
        let num_hits = scene.check(&ImagePlane::centered(33, 65, 1.0, 1.0));
        // The band's area: its height times its mean length.
        let area = 1.4 * (1.7 * f64::from(num) / f64::from(num + 1)) / 4.0;
        let share = num_hits as f64 / (33.0 * 65.0);
        assert!((share - area).abs() < 0.04, "{num}: {share} {area}"); // a row or two of pixels on the outline
    }
}

#[test]
fn rays_along_the_axes_hit_edges_and_vertices_of_a_grid_of_squares() {
    // Every ray runs in faces of boxes of the tree, with zeros of both signs among its numbers.
    let cube = surface(&star(8, |_| 1.0));
    for turn in turns() {
        let pose = Pose {
            rotation: turn,
            translation: DVec3::ZERO,
        };
        let snapshot = PosedScene::new(vec![cube.clone()], vec![pose]);
        for row in -3..=3 {
            for column in -3..=3 {
                let [y, z] = [column, row].map(|i| f64::from(i) / 4.0);
                for zero in [0.0, -0.0] {
                    for (x, distance) in [(-3.0, 2.0), (0.25, 0.75)] {
                        let ray = Ray {
                            origin: DVec3::new(x, y, z),
                            direction: DVec3::new(1.0, zero, zero),
                            start: 0.0,
                        };
                        assert_eq!(snapshot.cast(&ray).distance, distance, "{ray:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn nothing_at_all_is_hit_by_nothing() {
    let empty = || surface(&(Vec::new(), Vec::new()));
    let some: Vec<(Arc<_>, Pose)> = vec![(empty(), Pose::IDENTITY), (surface(&wall(1.0, 2.0)), Pose::IDENTITY)];
    let plane = ImagePlane::centered(3, 5, 0.5, 0.5);
    Scene::new(some, 0.0).cast(&plane, |_, ray, _, answer| {
        assert_eq!(answer.body, 1);
        is_near(answer.distance, 1.0 / ray.direction.x)
    });
    for bodies in [Vec::new(), vec![(empty(), Pose::IDENTITY)]] {
        assert_eq!(Scene::new(bodies, 0.0).check(&plane), 0);
    }
}
