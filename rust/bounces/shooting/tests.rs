use std::sync::Arc;

use super::*;
use crate::bounces::field::{Field, Incidence};
use crate::bounces::path::Bounces;
use crate::bounces::refine::TubeImage;
use crate::geometry::pose::Pose;
use crate::numeric::random::Random;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Cast;
use crate::rays::scene::NO_BODY;
use crate::rays::surface::{ShadingMode, Surface};
use crate::rays::tests::scenes::{grid, half_line, shaded, surface};
use crate::scattering::material::{CONDUCTOR, SurfaceResponse};

/// Return of one cell to the centre of the array by its last reflection.
#[derive(Clone, Copy, Debug)]
struct Echo {
    /// Number of reflections, from 2 on.
    order: usize,
    /// Half the length of the path [m].
    half_path: f64,
    /// Derivatives of `half_path` by the plane coordinates of the image [m].
    slope: [f64; 2],
    /// The path has the amplitude `sqrt(P Gt Gr) j / (4 pi)` times this; one reflection has `Gamma dOmega` here.
    amplitude: Complex64,
}

/// Echoes of the cell at plane coordinates by two and more reflections at conductors.
fn echoes(scene: &PosedScene, u: f64, v: f64) -> Vec<Echo> {
    let limits = Limits {
        max_bounces: 5,
        floor: 0.0,
    };
    let (array, materials) = (array(&[DVec3::ZERO], None), vec![CONDUCTOR; scene.num_bodies()]);
    let sensor = Sensor::new(scene, &materials, &array, limits);
    let launch = cell(scene, u, v).unwrap();
    let mut echoes = Vec::new();
    sensor.shoot(&launch, (DVec3::ZERO, &array.tx_patterns[0]), |tube, interactions| {
        if let Some((radiated, distance)) = sensor.receive(tube, &launch, DVec3::ZERO, Sampling::Point) {
            echoes.push(Echo {
                order: interactions.len(),
                half_path: 0.5 * (tube.length + distance),
                slope: tube.slope(-tube.interaction.point.normalize()),
                amplitude: radiated.amplitude / distance,
            });
        }
    });
    echoes
}

fn array(rx: &[DVec3], polarization: Option<DVec3>) -> Array {
    Array {
        polarization,
        ..Array::isotropic(&[DVec3::ZERO], rx)
    }
}

/// A rectangle from one corner along two edges.
fn rectangle(corner: DVec3, first: DVec3, second: DVec3) -> Arc<Surface> {
    let middle = corner + 0.5 * (first + second);
    surface(&grid(1, |row, column| middle + 0.5 * (column * first + row * second)))
}

/// A smooth patch of a sphere about a point, to both sides of a direction.
fn patch_of_sphere(center: DVec3, radius: f64, towards: DVec3, half_angle: f64, cells: usize) -> Arc<Surface> {
    let (x, y) = towards.any_orthonormal_pair();
    let slope = |share: f64| (half_angle * share).tan();
    let place = |row, column| center + radius * (towards + slope(row) * x + slope(column) * y).normalize();
    shaded(&grid(cells, place), ShadingMode::Smooth { crease_angle: 0.8 })
}

fn scene(surfaces: Vec<Arc<Surface>>) -> PosedScene {
    let poses = vec![Pose::IDENTITY; surfaces.len()];
    PosedScene::new(surfaces, poses)
}

/// Two walls at a right angle whose common edge is vertical, 2 m in front of the sensor.
fn walls() -> [Arc<Surface>; 2] {
    let apex = DVec3::new(2.0, 0.0, -0.5);
    [0.7, -0.7].map(|side| rectangle(apex, DVec3::new(-0.7, side, 0.0), DVec3::Z))
}

/// Hit of a cell, if any.
fn cell(scene: &PosedScene, u: f64, v: f64) -> Option<Launch> {
    let hit = scene.cast(&half_line(DVec3::ZERO, DVec3::new(1.0, u, v), 0.0));
    (hit.body != NO_BODY).then_some(Launch {
        rotation: DMat3::IDENTITY,
        center: [u, v],
        size: [1e-3, 1e-3],
        body: hit.body,
        triangle: hit.triangle,
    })
}

#[test]
fn what_a_corner_returns_comes_from_the_image_of_the_sensor_in_its_first_wall() {
    let scene = scene(walls().to_vec());
    // The left wall is x + y = 2, the right one x - y = 2, met in `last`.
    let (image, normal) = (DVec3::new(2.0, 2.0, 0.0), DVec3::new(-0.5, 0.5, 0.0).normalize());
    let last = |u: f64, v: f64| image - 2.0 / (1.0 - u) * DVec3::new(u, 1.0, -v);
    let half_path = |u: f64, v: f64| 0.5 * (last(u, v).distance(image) + last(u, v).length());
    let step = 1e-5;
    for (u, v) in [(0.01, 0.0), (0.05, 0.07), (0.11, -0.1), (0.2, 0.02)] {
        let echoes = echoes(&scene, u, v);
        let [echo] = echoes[..] else { panic!("{echoes:?}") };
        assert_eq!(echo.order, 2);
        assert!((echo.half_path - half_path(u, v)).abs() < 1e-13);
        for (slope, [du, dv]) in echo.slope.iter().zip([[step, 0.0], [0.0, step]]) {
            let expected = (half_path(u + du, v + dv) - half_path(u - du, v - dv)) / (2.0 * step);
            assert!((slope - expected).abs() < 1e-7, "{echo:?}");
        }
        // W dOmega L / (R cos_i): the wave from the image is a wave from a point.
        let (direction, back) = (last(u, v) - image, last(u, v));
        let cosine = -normal.dot(direction.normalize());
        let weight = 0.5 * (cosine - normal.dot(back.normalize()));
        let solid_angle = 1e-6 * (1.0 + u * u + v * v).powf(-1.5);
        let expected = weight * solid_angle * direction.length() / (back.length() * cosine);
        assert!((echo.amplitude - expected).norm() < 1e-12 * expected, "{echo:?}");
    }
}

#[test]
fn rays_onto_the_fold_of_a_corner_return_like_those_beside_it() {
    // Two walls; a third below them; the two, each a body of its own.
    let [left, right] = walls();
    let floor = rectangle(DVec3::new(2.0, -1.0, -0.5), DVec3::NEG_X, 2.0 * DVec3::Y);
    for (surfaces, order, slope) in [
        (vec![left.clone(), right.clone()], 2, 0.0),
        (vec![left.clone(), right.clone()], 2, 0.13),
        (vec![left, right, floor], 3, -0.25), // onto the apex
    ] {
        let scene = scene(surfaces);
        let echo = |u: f64, v: f64| {
            let echoes = echoes(&scene, u, v);
            let of_order: Vec<&Echo> = echoes.iter().filter(|echo| echo.order == order).collect();
            let [echo] = of_order[..] else { panic!("{echoes:?}") };
            *echo
        };
        // The third wall is met by what looks down a little more or less.
        let beside = echo(1e-5, slope + 3e-6);
        for u in [0.0, 1e-17, -1e-12, 1e-9, -1e-7] {
            let met = echo(u, slope);
            assert!((met.half_path - beside.half_path).abs() < 2e-5);
            assert!((met.amplitude - beside.amplitude).norm() < 1e-4 * beside.amplitude.norm());
        }
    }
}

#[test]
fn neighbours_of_a_ray_are_where_its_differentials_say() {
    // A ball, or a hollow round the middle of one, and a wall that meets what it reflects.
    let towards = DVec3::new(-0.8, 0.6, 0.0);
    for (center, towards, middle) in [
        (DVec3::new(2.0, 0.0, 0.0), towards, 0.18),
        (DVec3::new(1.1, -0.1, 0.0), -towards, -0.267),
    ] {
        let ball = patch_of_sphere(center, 0.5, towards, 0.6, 100);
        let wall = rectangle(DVec3::new(-2.0, 1.2, -3.0), DVec3::X * 6.0, DVec3::Z * 6.0);
        let scene = scene(vec![ball, wall]);
        let twice = |u: f64, v: f64| {
            let mut tube = Tube::launch(&scene, &cell(&scene, u, v)?, DVec3::ZERO, None)?;
            tube.reflect([Complex64::ONE; 2]);
            tube.advance(&scene).then_some(tube)
        };
        let (step, mut count) = (1e-6, 0);
        for (u, v) in [(0.05, 0.01), (0.02, -0.03), (-0.03, 0.04), (-0.06, 0.0), (0.001, 0.02)] {
            let u = u + middle;
            let Some(tube) = twice(u, v) else { continue };
            for (i, (du, dv)) in [(step, 0.0), (0.0, step)].into_iter().enumerate() {
                let [Some(next), Some(last)] = [twice(u + du, v + dv), twice(u - du, v - dv)] else {
                    continue;
                };
                let antenna = DVec3::new(0.0, 0.3, 0.1);
                let half_path = |tube: &Tube| 0.5 * (tube.length + tube.interaction.point.distance(antenna));
                let difference = (half_path(&next) - half_path(&last)) / (2.0 * step);
                let slope = tube.slope((antenna - tube.interaction.point).normalize())[i];
                // The interpolated surface is not quite across its normals: errors of third order in the facets.
                let error = (slope - difference).abs() / slope.abs().max(1.0);
                assert!(error < 3e-3, "{slope} {difference}");
                let edge = (next.interaction.point - last.interaction.point) / (2.0 * step);
                let turn = (next.direction - last.direction) / (2.0 * step);
                for (got, expected) in [(tube.edges[i], edge), (tube.direction_slopes[i], turn)] {
                    assert!(got.distance(expected) < 2e-3 * expected.length(), "{got} {expected}");
                }
                count += 1;
            }
        }
        assert!(count >= 6, "{count}");
    }
}

#[test]
fn conductors_turn_fields_round_and_normal_incidence_sends_gamma() {
    let random = &mut Random(3);
    for _ in 0..1000 {
        let [k, mut n, e] = [0; 3].map(|_| random.direction());
        n *= -n.dot(k).signum();
        let conductor = Incidence {
            direction: k,
            normal: n,
            coefficients: [Complex64::from(-1.0), Complex64::ONE],
        };
        let field = Field::launch(Some(e), k);
        let Field::Vector([re, _]) = field else { unreachable!() };
        let Field::Vector([got, im]) = field.reflect(&conductor) else {
            unreachable!()
        };
        assert!(got.distance(2.0 * n * n.dot(re) - re) < 1e-12 && im == DVec3::ZERO);

        // Back to the antenna: Gamma cos of docs/theory.md eqs. (2) and (5), for every material.
        let (te, tm) = (Complex64::new(-0.6, 0.2), Complex64::new(0.3, -0.1));
        let any = Incidence {
            coefficients: [te, tm],
            ..conductor
        };
        let seen = crate::antennas::polarization::PolarizationWeights::by(e, n, k, k);
        let gamma = te * seen.te - tm * seen.tm;
        let radiated = field.radiate(&any, -k, Some(transverse(e, -k)));
        assert!((radiated - gamma * any.cosine()).norm() < 1e-12, "{radiated} {gamma}");
        // In the specular direction: cos E_r.
        let Field::Vector([re, im]) = field.reflect(&any) else {
            unreachable!()
        };
        let to = any.reflected();
        let received = transverse(e, to);
        let expected = Complex64::new(re.dot(received), im.dot(received)) * any.cosine();
        assert!((field.radiate(&any, to, Some(received)) - expected).norm() < 1e-12);
        // Without a polarisation likewise.
        let radiated = Field::Scalar(Complex64::ONE).radiate(&conductor, to, None);
        assert!((radiated + conductor.cosine()).norm() < 1e-12);
    }
}

#[test]
fn waves_pass_two_focal_lines_of_a_hollow_mirror() {
    // Hollow sphere of radius 1 round (1, 0, 0), met at its far end from its middle's other side: from 1.5 m before the
    // mirror, the image lies at 1/b = 2/r - 1/g, 0.75 m before it.
    let bowl = patch_of_sphere(DVec3::new(0.5, 0.0, 0.0), 1.0, DVec3::X, 0.3, 80);
    for (wall, expected) in [(0.85, -Complex64::ONE), (0.65, Complex64::ONE)] {
        let back = rectangle(DVec3::new(1.5 - wall, -0.01, -1.0), 2.0 * DVec3::Y, 2.0 * DVec3::Z);
        let scene = scene(vec![bowl.clone(), back]);
        // Beside the wall onto the bowl, so that the reflected ray meets the wall.
        let launch = cell(&scene, -0.02, 0.005).unwrap();
        assert_eq!(launch.body, 0);
        let mut tube = Tube::launch(&scene, &launch, DVec3::ZERO, None).unwrap();
        tube.reflect([Complex64::ONE, -Complex64::ONE]);
        assert!(tube.advance(&scene));
        assert_eq!(tube.interaction.body, 1);
        let Field::Scalar(field) = tube.field else {
            unreachable!()
        };
        assert!((field - expected).norm() < 1e-9, "{wall}: {field}");
        // The section of a wave that comes from the image.
        let shrunk = (1.0 - wall / 0.75_f64).powi(2) * 1.5 * 1.5;
        let section = tube.section();
        assert!((section - shrunk).abs() < 0.05 * shrunk, "{section} {shrunk}");
    }
}

#[test]
fn floors_end_tubes_and_paths_split_by_their_bodies() {
    let scene = scene(walls().to_vec());
    let wood = Material::Constant(SurfaceResponse {
        reflection: Complex64::new(0.0, -0.1),
        albedo: 0.0,
    });
    let array = array(&[DVec3::ZERO, DVec3::Y * 0.0025], Some(DVec3::Z));
    let plane = ImagePlane::centered(40, 40, 0.2, 0.2);
    let hits = scene.cast_image(&plane, &Cast::default()).unwrap();
    let num_hit = hits.body.iter().filter(|body| **body != NO_BODY).count();
    let images = [TubeImage {
        rotation: DMat3::IDENTITY,
        hits: &hits,
        parts: Vec::new(),
    }];
    let run = |floor: f64| {
        let limits = Limits { max_bounces: 3, floor };
        let sampling = Sampling::Footprint;
        Bounces::new(
            &scene,
            &images,
            &[CONDUCTOR, wood],
            &array,
            limits,
            sampling,
            f64::INFINITY,
        )
    };
    // Half the tubes meet the wood first, which leaves 1 % of their power, and end; the others end at it.
    let ((all, counts), (fewer, fewer_counts)) = (run(1e-8), run(0.02));
    assert!(all.len() > 100 && all.orders().all(|order| order == 2));
    assert_eq!(counts.stopped, 0);
    assert!(fewer.len() < all.len() && fewer.len() > all.len() / 3);
    assert!(fewer_counts.stopped > num_hit / 3, "{fewer_counts:?}");
    let (none, counts) = run(2.0);
    // From the transmitter, and from the middle of the receivers.
    assert_eq!((none.len(), counts.rays, counts.stopped), (0, 0, 2 * num_hit));

    // Every path meets both walls.
    let (number, others) = (all.len(), fewer.len());
    assert_eq!(all.split(|body| body == 0).map(|paths| paths.len()), [0, number]);
    assert_eq!(fewer.split(|_| true).map(|paths| paths.len()), [others, 0]);
}
