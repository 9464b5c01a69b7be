use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use num_complex::Complex64;

use super::*;
use crate::antennas::array::Array;
use crate::antennas::gain_table::GainTable;
use crate::antennas::pattern::Pattern;
use crate::geometry::pose::Pose;
use crate::numeric::random::mix;
use crate::numeric::simd::Level;
use crate::paths::kinematics::TimeSeries;
use crate::synthesis::delay::Basis;
use crate::synthesis::source::Shape;

const SCALE: f64 = 1024.0;

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

fn beam(azimuth: f64, elevation: f64) -> Pattern {
    Pattern::Gaussian {
        peak: 3.0,
        azimuth,
        elevation,
    }
}

fn pose(x: f64, y: f64, turn: f64) -> Pose {
    Pose {
        rotation: DMat3::from_euler(glam::EulerRot::XYZ, turn, 0.3 * turn, -0.2),
        translation: DVec3::new(x, y, 0.1),
    }
}

/// Random material points on two bodies, each with or without a patch and with a weight per channel or one, and one
/// point target per cross-section.
fn scatterers(array: &Array, number: usize, has_patches: bool, num_weights: usize, rcs: &[f64]) -> Scatterers {
    let mut state = 1;
    let mut random = || {
        state = mix(state);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let mut vector = |size: f64| size * DVec3::from_array([(); 3].map(|()| random()));
    let position: Vec<DVec3> = (0..number).map(|_| vector(0.3)).collect();
    let normal = (0..number).map(|_| (vector(0.5) - DVec3::X).normalize()).collect();
    // Every third stands for a point.
    let patch = (0..number).map(|i| [0, 1].map(|_| vector(if i % 3 == 0 { 0.0 } else { 2e-3 })));
    let patch: Vec<_> = patch.filter(|_| has_patches).collect();
    let weights = (0..number * num_weights).map(|_| Complex64::new(vector(1.0).x, vector(1.0).y));
    Scatterers {
        array: array.clone(),
        body: (0..number).map(|i| u32::from(3 * i > 2 * number)).collect(),
        kind: Vec::new(),
        corners: Vec::new(),
        weights: weights.collect(),
        range_rate: Vec::new(),
        rcs: rcs.to_vec(),
        position,
        normal,
        patch,
    }
}

/// Delay and amplitude of a lane of a chunk at nodes of delays and of amplitudes.
fn value<T: Real>(chunk: &Chunk<T>, [delays, amplitudes]: [usize; 2], channel: usize, lane: usize) -> [Vec<f64>; 3] {
    fn rows<T: Real>(rows: &[Lane<T>], lane: usize) -> Vec<f64> {
        let first = rows[0][lane].wide();
        let others = rows[1..].iter().map(|row| first + row[lane].wide());
        [first].into_iter().chain(others).collect()
    }
    let of_channel = channel * amplitudes..(channel + 1) * amplitudes;
    [
        rows(&chunk.delay[channel * delays..(channel + 1) * delays], lane),
        rows(&chunk.re[of_channel.clone()], lane),
        rows(&chunk.im[of_channel], lane),
    ]
}

/// Fill a chunk and compare it with paths one by one; errors of amplitudes relative to each, and absolute ones.
fn check<T: Precision>(
    scatterers: &Scatterers,
    nodes: [&Kinematics; 2],
    numbers: &[usize],
    (channels, level): (Range<usize>, Level),
    [relative, absolute]: [f64; 2],
) {
    let request = Request {
        channels: channels.clone(),
        paths: 0..numbers.len(),
        scale: SCALE,
        level,
    };
    let num_nodes = nodes.map(Kinematics::num_times);
    let shape = Shape {
        channels: channels.len(),
        paths: numbers.len(),
        delay_rows: num_nodes[0],
        amplitude_rows: num_nodes[1],
        basis: Basis::Chebyshev,
    };
    let mut chunk = Chunk::<T>::new(&shape, channels.len());
    for row in &mut chunk.delay {
        row.fill(f64::NAN);
    }
    scatterers.fill(nodes, numbers, &request, &mut chunk);
    assert_eq!(chunk.num_paths, numbers.len());
    for (at, channel) in channels.enumerate() {
        for lane in 0..CHUNK {
            let number = numbers[lane.min(numbers.len() - 1)];
            let [delay, re, im] = value(&chunk, num_nodes, at, lane);
            for (node, delay) in delay.into_iter().enumerate() {
                let expected = scatterers.path(nodes[0], node, channel, number).0;
                assert!((delay - expected).abs() <= 1e-15 * expected, "{delay} {expected}");
            }
            for (node, (re, im)) in re.into_iter().zip(im).enumerate() {
                let mut expected = scatterers.path(nodes[1], node, channel, number).1;
                if lane >= numbers.len() {
                    expected = Complex64::ZERO;
                }
                let error = (Complex64::new(re, im) / SCALE - expected).norm();
                assert!(error <= relative * expected.norm() + absolute, "{error} {expected}");
            }
        }
    }
}

#[test]
fn paths_together_are_those_one_by_one_on_every_instruction_set() {
    let angles = [-1.5, 0.0, 1.5];
    let gains = [-20.0, 3.0, -20.0, 0.0, 10.0, 0.0, -20.0, 3.0, -20.0];
    let table = Pattern::Table(Arc::new(GainTable::new(&angles, &angles, &gains).unwrap()));
    let poses = [
        pose(1.0, -0.3, 0.1),
        pose(1.5, 0.4, -0.3),
        pose(1.1, -0.2, 0.4),
        pose(1.4, 0.5, 1.0),
    ];
    let points = [DVec3::new(2.0, 0.0, 0.0), DVec3::new(2.1, 0.0, 0.0)];
    let at = |times: Range<usize>| Kinematics {
        poses: TimeSeries::new(times.len(), poses[2 * times.start..2 * times.end].to_vec()),
        points: TimeSeries::new(times.len(), points[times].to_vec()),
        vertices: Vec::new(),
    };
    // Amplitudes at a time of their own.
    let nodes = [&at(0..2), &at(1..2)];
    for pattern in [beam(2.0, 1.0), beam(0.0, 0.0), table] {
        for (has_patches, num_weights) in [(false, 1), (true, 1), (true, 4)] {
            // The point target comes last.
            let last = 300;
            let scatterers = scatterers(&array(&pattern), last, has_patches, num_weights, &[1.0]);
            let amplitude = |number: usize| scatterers.path(nodes[1], 0, 0, number).1.norm();
            let strongest = (0..=last).map(amplitude).fold(0.0, f64::max);
            let spread = (0..last).step_by(3).chain([last]);
            for numbers in [(0..CHUNK).collect(), spread.collect::<Vec<usize>>(), vec![last]] {
                for level in Level::available() {
                    for channels in [0..4, 1..2] {
                        let of = (channels, level);
                        check::<f64>(&scatterers, nodes, &numbers, of.clone(), [0.0, 1e-13 * strongest]);
                        check::<f32>(&scatterers, nodes, &numbers, of, [2e-6, 1e-7 * strongest]);
                    }
                }
            }
        }
    }
}

#[test]
fn point_targets_have_delays_and_amplitudes_of_the_radar_equation() {
    let array = array(&beam(0.0, 0.0));
    let scatterers = scatterers(&array, 0, false, 1, &[0.5]);
    // A point target that passes the antennas, at four times.
    let points: Vec<DVec3> = (0..4).map(|node| DVec3::new(2.0, f64::from(node), 0.3)).collect();
    let kinematics = Kinematics {
        poses: TimeSeries::new(4, Vec::new()),
        points: TimeSeries::new(4, points.clone()),
        vertices: Vec::new(),
    };
    for channel in 0..4 {
        for (node, point) in points.iter().enumerate() {
            let [t, r] = [array.tx[channel / 2], array.rx[channel % 2]].map(|place| (*point - place).length());
            let (delay, amplitude) = scatterers.path(&kinematics, node, channel, 0);
            let expected = (t + r) / SPEED_OF_LIGHT;
            assert!((delay - expected).abs() < 1e-15 * expected);
            // sqrt(P G G) lambda sqrt(sigma) / ((4 pi)^(3/2) R R)
            let wavelength = SPEED_OF_LIGHT / 60e9;
            let expected = 2.0_f64.sqrt() * 3.0 * wavelength * (0.5 / (4.0 * PI).powi(3)).sqrt() / (t * r);
            assert!((amplitude - expected).norm() < 1e-13 * expected);
        }
    }
    check::<f64>(&scatterers, [&kinematics; 2], &[0], (0..4, Level::best()), [1e-13, 0.0]);
}
