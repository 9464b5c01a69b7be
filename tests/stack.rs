//! Threads with 512 kB of stack run every kernel, optimised or not, at every instruction set of the machine.

use std::f64::consts::TAU;
use std::process::Command;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use num_complex::Complex64;
use radarcore::stages::{
    Aspect, Basis, Known, Level, Material, Options, PathSeries, PosedScene, Ray, SurfaceResponse, TimeSeries,
    add_normal, beat_signal, cross_sections, image, paths as frame_paths,
};
use radarcore::{
    Answer, Array, CONDUCTOR, Cancel, ImagePlane, Limits, Memory, Method, Model, Pattern, Pose, RaySampling,
    Refinement, Sampling, Scene, Settings, ShadingMode, Source, Surface, Switches, Waveform, World, simulate,
};

const STACK: usize = 512 * 1024;

/// A process has one level, and a stack overflow ends it: one process per level.
#[test]
fn threads_with_512_kb_of_stack_run_every_kernel_at_every_level() {
    for level in Level::available() {
        let output = Command::new(std::env::current_exe().unwrap())
            .args(["every_kernel", "--exact", "--ignored"])
            .env("RADARCORE_SIMD", level.name())
            .output()
            .unwrap();
        let (out, errors) = (
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr),
        );
        assert!(
            output.status.success(),
            "{}: {}\n{out}{errors}",
            level.name(),
            output.status
        );
        assert!(out.contains("1 passed"), "{out}");
    }
}

#[test]
#[ignore = "run by the test above, with a level each"]
fn every_kernel() {
    // Many threads split work many times, and every split is a frame.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(16)
        .stack_size(STACK)
        .build()
        .unwrap();
    pool.install(|| {
        sums();
        rays();
        frames();
        let (mut single, mut double) = ([0_f32; 100], [0_f64; 100]);
        add_normal(Level::best(), &mut single, 1.0, 1, 2);
        add_normal(Level::best(), &mut double, 1.0, 1, 2);
        assert!(single.iter().all(|x| *x != 0.0) && double.iter().all(|x| *x != 0.0));
    });
}

fn waveform(num_chirps: usize) -> Waveform {
    Waveform {
        start_frequency: 60e9,
        slope: 3e13,
        sample_rate: 2e6,
        adc_delay: 1e-6,
        num_samples: 32,
        chirp_times: (0..num_chirps).map(|chirp| 3e-4 * chirp as f64).collect(),
    }
}

/// Sums of every method, to tolerances that take every width, precision and number of terms.
fn sums() {
    let waveform = waveform(20);
    let number = 60;
    let place = |path: usize, step: f64| (step * path as f64).fract();
    // Distances at the Chebyshev times: a third of the paths stands still, a third moves steadily, a third turns fast.
    let delay: Vec<Vec<f64>> = (0..9)
        .map(|node| {
            let x = -(TAU * f64::from(2 * node + 1) / 36.0).cos();
            let distance = |path: usize| {
                let moved = match path % 3 {
                    0 => 0.0,
                    1 => 0.01 * x,
                    _ => 0.02 * (2.0 * x + TAU * place(path, 0.7)).sin(),
                };
                1.0 + 3.0 * place(path, 0.618) + moved
            };
            (0..number).map(|path| 2.0 / 3e8 * distance(path)).collect()
        })
        .collect();
    let amplitude: Vec<Complex64> = (0..number)
        .map(|path| Complex64::cis(TAU * place(path, 0.37)))
        .collect();
    let nodes: Vec<&[f64]> = delay.iter().map(Vec::as_slice).collect();
    let rates: Vec<f64> = (0..number).map(|path| 1e-8 * (place(path, 0.7) - 0.5)).collect();
    let all = [
        (Basis::Chebyshev, nodes),
        (Basis::Taylor, vec![&delay[0][..], &rates[..]]),
    ];
    for (basis, delay) in &all {
        let series = PathSeries {
            basis: *basis,
            delay,
            amplitude: &[&amplitude],
            num_channels: 1,
            num_paths: number,
        };
        for method in [Method::Direct, Method::Grid, Method::Auto] {
            for digits in [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.5, 7.0, 7.5, 8.0, 9.0, 10.0, 12.0, 13.0] {
                let options = Options {
                    tolerance: 0.1_f64.powf(digits),
                    level: Level::best(),
                    is_parallel: true,
                    cancel: None,
                    known: Known::NOTHING,
                };
                let sum = beat_signal(&waveform, &series, method, &options);
                assert!(sum.is_ok(), "{method:?} 1e-{digits}");
            }
        }
    }
}

/// A wavy plate, 20 cm wide, that faces the sensor.
fn plate(number: usize, mode: ShadingMode) -> Arc<Surface> {
    let side = |i: usize| 0.2 * (i as f64 / number as f64 - 0.5);
    let corners = (0..=number).flat_map(|i| (0..=number).map(move |j| (side(i), side(j))));
    let vertices: Vec<DVec3> = corners
        .map(|(y, z)| DVec3::new(0.01 * (30.0 * y).sin(), y, z))
        .collect();
    let squares = (0..number).flat_map(|i| (0..number).map(move |j| i * (number + 1) + j));
    let triangles: Vec<[u32; 3]> = squares
        .flat_map(|a| {
            let [a, b, c, d] = [a, a + 1, a + number + 1, a + number + 2].map(|vertex| vertex as u32);
            [[a, b, d], [a, d, c]]
        })
        .collect();
    Arc::new(Surface::new(&vertices, &triangles, mode, &Cancel::default()).unwrap())
}

fn at(x: f64, y: f64) -> Pose {
    Pose {
        translation: DVec3::new(x, y, 0.0),
        ..Pose::IDENTITY
    }
}

/// Rays one by one, far fields with several reflections, and trees of many equal triangles.
fn rays() {
    let corner = PosedScene::new(
        vec![plate(2, ShadingMode::Flat); 2],
        vec![
            at(1.0, 0.0),
            Pose {
                rotation: DMat3::from_rotation_z(1.5),
                ..at(0.9, 0.1)
            },
        ],
    );
    let ray = Ray {
        origin: DVec3::ZERO,
        direction: DVec3::X,
        start: 0.0,
    };
    assert!(corner.cast(&ray).distance.is_finite());
    let aspect = Aspect {
        directions: [DVec3::NEG_X; 2],
        polarizations: None,
    };
    let found = cross_sections(&corner, &[CONDUCTOR; 2], 3e9, &[aspect], 3, &Cancel::default()).unwrap();
    assert!(found[0] > 0.0);

    let corners = [DVec3::ZERO, DVec3::Y, DVec3::Z];
    let equal = Surface::new(&corners, &vec![[0, 1, 2]; 2_000], ShadingMode::Flat, &Cancel::default()).unwrap();
    let behind = Ray {
        origin: DVec3::new(-1.0, 0.2, 0.2),
        ..ray
    };
    let equal = PosedScene::new(vec![Arc::new(equal)], vec![Pose::IDENTITY]);
    assert!(equal.cast(&behind).distance.is_finite());
}

/// Frames, paths and images of bodies that stand, move, turn and deform, of every sampling and with several reflections.
fn frames() {
    let plane = ImagePlane::centered(24, 24, 0.3, 0.3);
    let rays = |refinement| RaySampling {
        planes: vec![plane],
        sampling: Sampling::Footprint,
        refinement,
    };
    let adaptive = || {
        rays(Some(Refinement {
            rcs_floor: 1e-4,
            follows_echo: true,
            budget: Some(20_000),
        }))
    };
    let rough = Material::Constant(SurfaceResponse {
        reflection: Complex64::new(-0.5, 0.0),
        albedo: 0.5,
    });
    let cases = [(adaptive(), 1e-3, 3), (adaptive(), 1e-5, 1), (rays(None), 1e-8, 3)];
    for (rays, tolerance, max_bounces) in cases {
        let settings = Settings {
            rotations: vec![DMat3::IDENTITY],
            rays,
            tubes: vec![plane],
            image: plane,
            gain_floor: Some(1e-8),
            debug: Switches::default(),
            limits: Limits {
                max_bounces,
                floor: 1e-8,
            },
            retrace: 0.2,
            seed: 0,
            tolerance,
            method: Method::Auto,
        };
        let surfaces = vec![
            plate(6, ShadingMode::Flat),
            plate(6, ShadingMode::Smooth { crease_angle: 1.0 }),
            plate(3, ShadingMode::Flat),
        ];
        let rest = surfaces[2].vertices().to_vec();
        let model = Model::new(
            Source::Scene(Scene {
                surfaces,
                deforming: vec![2],
                rcs: vec![1.0],
                body_numbers: vec![0, 1, 2],
                point_numbers: vec![3],
            }),
            vec![CONDUCTOR, rough, CONDUCTOR],
            antennas(),
            waveform(64),
            DVec3::ZERO,
            settings,
        )
        .unwrap();
        let (motion, instant) = (world(&rest, 17), world(&rest, 1));
        let (mut memory, cancel) = (Memory::default(), Cancel::default());
        for _ in 0..2 {
            let answer = simulate(&model, &motion, None, &mut memory, &cancel).unwrap();
            assert!(matches!(answer, Answer::Done(frame) if frame.counts.paths > 0));
        }
        frame_paths(&model, &motion, (&instant, &instant), &mut memory, &cancel).unwrap();
        image(&model, &instant, &mut memory, &cancel).unwrap();
    }
}

fn antennas() -> Array {
    let pattern = Pattern::Gaussian {
        peak: 4.0,
        azimuth: 2.0,
        elevation: 2.0,
    };
    Array {
        tx: vec![DVec3::ZERO],
        rx: vec![DVec3::ZERO, DVec3::new(0.0, 2.5e-3, 0.0)],
        tx_patterns: vec![pattern.clone()],
        rx_patterns: vec![pattern; 2],
        power: 1.0,
        frequency: 60e9,
        polarization: Some(DVec3::Z),
        responses: Vec::new(),
    }
}

/// Motion at a number of Chebyshev times: the first body stands, the second turns, the vertices of the third move.
fn world(rest: &[DVec3], num_times: usize) -> World {
    let times = (0..num_times).map(|node| -(TAU * (2 * node + 1) as f64 / (4 * num_times) as f64).cos());
    let poses = times.clone().flat_map(|x| {
        let turned = Pose {
            rotation: DMat3::from_rotation_z(0.02 * x),
            ..at(1.2 + 0.01 * x, 0.2)
        };
        [at(1.0, 0.0), turned, at(1.1, -0.2)]
    });
    let vertices = times
        .clone()
        .flat_map(|x| rest.iter().map(move |vertex| *vertex * (1.0 + 0.01 * x)));
    World {
        sensor: vec![Pose::IDENTITY; num_times],
        poses: poses.collect(),
        points: times.map(|x| DVec3::new(2.0 + 0.01 * x, 0.1, 0.0)).collect(),
        vertices: vec![TimeSeries::new(num_times, vertices.collect())],
    }
}
