use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use num_complex::Complex64;

use super::*;
use crate::antennas::array::Array;
use crate::antennas::gain_table::Table;
use crate::antennas::pattern::Pattern;
use crate::geometry::pose::Pose;
use crate::numeric::simd::Level;
use crate::paths::scatterers::PathRange;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Cast;
use crate::rays::scene::PosedScene;
use crate::rays::smooth_hits::SmoothHits;
use crate::rays::surface::{ShadingMode, Surface as Mesh};
use crate::scattering::depth_image::Surfels;
use crate::scattering::material::{Material, Response};
use crate::scattering::physical_optics::Sampling;
use crate::scattering::refinement::Refinement;
use crate::scattering::samples::Samples;
use crate::scattering::sector::Sector;
use crate::synthesis::delay::Basis;
use crate::synthesis::source::Shape;

fn array(pattern: &Pattern) -> Array {
    Array {
        tx: vec![DVec3::new(0.0, 0.01, 0.0), DVec3::new(0.0, -0.03, 0.01)],
        rx: vec![DVec3::ZERO, DVec3::new(0.0, 0.0, 0.02)],
        tx_patterns: vec![pattern.clone(); 2],
        rx_patterns: vec![pattern.clone(); 2],
        power: 2.0,
        frequency: 60e9,
        polarization: None,
        responses: Vec::new(),
    }
}

fn pose(x: f64, y: f64, turn: f64) -> Pose {
    Pose {
        rotation: DMat3::from_euler(glam::EulerRot::XYZ, turn, 0.3 * turn, -0.2),
        translation: DVec3::new(x, y, 0.1),
    }
}

fn plate() -> Arc<Mesh> {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let vertices = corners.map(|[y, z]| DVec3::new(0.0, 0.3 * y, 0.3 * z));
    Arc::new(Mesh::new(&vertices, &[[0, 2, 1], [0, 3, 2]], ShadingMode::Flat).unwrap())
}

/// A chunk of some paths of some channels.
fn filled<T: Precision>(
    scatterers: &Scatterers,
    [delays, amplitudes]: [&Kinematics; 2],
    numbers: &[usize],
    channels: Range<usize>,
    level: Level,
) -> Chunk<T> {
    let request = Request {
        channels: channels.clone(),
        paths: 0..numbers.len(),
        scale: 1024.0,
        level,
    };
    let shape = Shape {
        channels: scatterers.num_channels(),
        paths: numbers.len(),
        delay_rows: delays.num_nodes,
        amplitude_rows: amplitudes.num_nodes,
        basis: Basis::Chebyshev,
    };
    let mut chunk = Chunk::new(&shape, channels.len());
    for row in &mut chunk.delay {
        row.fill(f64::NAN);
    }
    scatterers.fill([delays, amplitudes], numbers, &request, &mut chunk);
    chunk
}

/// Check a chunk against paths one by one; errors of amplitudes relative to each and to the strongest.
fn assert_is<T: Precision>(
    chunk: &Chunk<T>,
    scatterers: &Scatterers,
    [delays, amplitudes]: [&Kinematics; 2],
    numbers: &[usize],
    channels: Range<usize>,
    [relative, absolute]: [f64; 2],
) {
    assert_eq!(chunk.num_paths, numbers.len());
    for (at, channel) in channels.enumerate() {
        for i in 0..CHUNK {
            let number = numbers[i.min(numbers.len() - 1)];
            for node in 0..delays.num_nodes {
                let expected = scatterers.path(delays, node, channel, number).0;
                let rows = &chunk.delay[at * delays.num_nodes..];
                let delay = rows[0][i] + if node > 0 { rows[node][i] } else { 0.0 };
                assert!((delay - expected).abs() <= 1e-15 * expected, "{delay} {expected}");
            }
            for node in 0..amplitudes.num_nodes {
                let mut expected = scatterers.path(amplitudes, node, channel, number).1;
                if i >= numbers.len() {
                    expected = Complex64::ZERO;
                }
                let row = at * amplitudes.num_nodes;
                let [re, im] = [&chunk.re[row..], &chunk.im[row..]]
                    .map(|rows| rows[0][i].wide() + if node > 0 { rows[node][i].wide() } else { 0.0 });
                let error = (Complex64::new(re, im) / 1024.0 - expected).norm();
                assert!(error <= relative * expected.norm() + absolute, "{error} {expected}");
            }
        }
    }
}

/// Material points of adaptive samples.
fn of_cells(
    scene: &PosedScene,
    array: &Array,
    materials: &[Material],
    base: ImagePlane,
    end_points: bool,
) -> Scatterers {
    let refinement = Refinement {
        base,
        rcs_floor: 1e-3,
        follows_echo: false,
        budget: None,
        end_points,
        beam: None,
        join: 1.5,
        skip_dark: true,
        turns: &[],
        reflections: &[],
    };
    let sector = Sector {
        scene,
        array,
        cast: Cast::default(),
        refinement,
    };
    let samples = Samples::new(&[sector], materials, 1, None).unwrap();
    Scatterers::of_samples(&[(scene, array)], &samples, materials, array.clone(), |_| 0)
}

#[test]
fn paths_together_are_those_one_by_one_on_every_instruction_set() {
    let beam = Pattern::Gaussian {
        peak: 3.0,
        azimuth: 2.0,
        elevation: 1.0,
    };
    let all_round = Pattern::Gaussian {
        peak: 3.0,
        azimuth: 0.0,
        elevation: 0.0,
    };
    let angles = [-1.5, 0.0, 1.5];
    let gains = [-20.0, 3.0, -20.0, 0.0, 10.0, 0.0, -20.0, 3.0, -20.0];
    let table = Pattern::Table(Arc::new(Table::new(&angles, &angles, &gains).unwrap()));
    let half_matt = Material::Constant(Response {
        reflection: Complex64::new(-0.7, 0.1),
        albedo: 0.3,
    });
    let plane = ImagePlane::centered(20, 20, 0.6, 0.6);
    let poses = vec![pose(1.0, -0.3, 0.1), pose(1.5, 0.4, -0.3)];
    let scene = PosedScene::new(vec![plate(), plate()], poses.clone());
    for pattern in [beam, all_round, table] {
        let array = array(&pattern);
        let materials = vec![half_matt; 2];
        let hits = scene.cast_image(&plane).unwrap();
        let smooth = SmoothHits::at(&scene, &hits, Level::best());
        let image = (&scene, &hits, &smooth, &array);
        let of_pixels = Scatterers::of_images(&[image], &materials, array.clone(), Sampling::Footprint, 1);
        let of_cells = [false, true].map(|end_points| of_cells(&scene, &array, &materials, plane, end_points));
        let [of_tiles, of_leaves] = of_cells;
        for scatterers in [of_pixels, of_tiles, of_leaves] {
            let moved = [poses.clone(), vec![pose(1.1, -0.2, 0.4), pose(1.4, 0.5, 1.0)]].concat();
            let kinematics = Kinematics {
                num_nodes: 2,
                num_bodies: 2,
                poses: moved.clone(),
                points: vec![DVec3::new(2.0, 0.0, 0.0), DVec3::new(2.1, 0.0, 0.0)],
                rcs: vec![1.0],
                vertices: Vec::new(),
            };
            // Amplitudes at a time of their own.
            let other = Kinematics {
                num_nodes: 1,
                poses: moved[2..].to_vec(),
                points: vec![kinematics.points[1]],
                ..kinematics.clone()
            };
            // Point targets come last.
            let last = scatterers.len();
            let all = PathRange {
                surfaces: 0..last,
                num_points: 1,
            };
            assert_eq!((all.len(), all.number(&scatterers, last)), (last + 1, last));
            let nodes = [&kinematics, &other];
            let amplitude = |number: usize| scatterers.path(&other, 0, 0, number).1.norm();
            let strongest = (0..=last).map(amplitude).fold(0.0, f64::max);
            assert!(strongest > 0.0 && last > 20);
            let spread = (0..=last).step_by(last.div_ceil(100)).chain([last]);
            for numbers in [
                (0..=last).take(CHUNK).collect(),
                spread.collect::<Vec<usize>>(),
                vec![last],
            ] {
                for channels in [0..4, 1..2] {
                    for level in Level::available() {
                        let chunk = filled::<f64>(&scatterers, nodes, &numbers, channels.clone(), level);
                        let errors = [0.0, 1e-13 * strongest];
                        assert_is(&chunk, &scatterers, nodes, &numbers, channels.clone(), errors);
                        let chunk = filled::<f32>(&scatterers, nodes, &numbers, channels.clone(), level);
                        let errors = [2e-6, 1e-7 * strongest];
                        assert_is(&chunk, &scatterers, nodes, &numbers, channels.clone(), errors);
                    }
                }
            }
        }
    }
}

#[test]
fn chunk_of_points_has_delays_and_amplitudes_of_the_radar_equation() {
    // A point target that passes the antennas, at the places of four times.
    let all_round = Pattern::Gaussian {
        peak: 3.0,
        azimuth: 0.0,
        elevation: 0.0,
    };
    let array = array(&all_round);
    let scatterers = Scatterers::from_surfels(
        &Surfels {
            plane: ImagePlane::centered(1, 1, 0.1, 0.1),
            distance: &[0.0],
            normal: &[DVec3::X],
            reflection: &[Complex64::ONE],
            albedo: &[0.0],
            body: &[-1],
            num_bodies: 0,
        },
        array.clone(),
        Sampling::Point,
        1,
    )
    .unwrap();
    let points: Vec<DVec3> = (0..4).map(|node| DVec3::new(2.0, f64::from(node), 0.3)).collect();
    let kinematics = Kinematics {
        num_nodes: 4,
        num_bodies: 0,
        poses: Vec::new(),
        points: points.clone(),
        rcs: vec![0.5],
        vertices: Vec::new(),
    };
    let chunk = filled::<f64>(&scatterers, [&kinematics; 2], &[0], 0..4, Level::best());
    for channel in 0..4 {
        for (node, point) in points.iter().enumerate() {
            let [t, r] = [array.tx[channel / 2], array.rx[channel % 2]].map(|place| (*point - place).length());
            let rows = 4 * channel..;
            let value = |rows: &[Lane<f64>]| rows[0][0] + if node > 0 { rows[node][0] } else { 0.0 };
            let delay = (t + r) / SPEED_OF_LIGHT;
            assert!((value(&chunk.delay[rows.clone()]) - delay).abs() < 1e-15 * delay);
            // sqrt(P G G) lambda sqrt(sigma) / ((4 pi)^(3/2) R R)
            let wavelength = SPEED_OF_LIGHT / 60e9;
            let expected = 1024.0 * 2.0_f64.sqrt() * 3.0 * wavelength * (0.5 / (4.0 * PI).powi(3)).sqrt() / (t * r);
            assert!((value(&chunk.re[rows.clone()]) - expected).abs() < 1e-13 * expected);
            assert!(value(&chunk.im[rows]).abs() < 1e-13 * expected);
        }
    }
}
