use std::f64::consts::TAU;

use num_complex::Complex64;

use super::*;
use crate::numeric::simd::Level;
use crate::synthesis::delay::Basis;
use crate::synthesis::tests::{Rows, options, units, waveform};

const TOLERANCES: [f64; 9] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9];

/// Equal paths: delays, rates and phases [turns] from their number.
fn equal(paths: usize, delay: impl Fn(f64) -> f64, rate: impl Fn(f64) -> f64, turns: impl Fn(f64) -> f64) -> Rows {
    let numbers = || (0..paths).map(|i| i as f64);
    Rows {
        basis: Basis::Taylor,
        num_channels: 1,
        delay: vec![numbers().map(delay).collect(), numbers().map(rate).collect()],
        amplitude: vec![numbers().map(|i| Complex64::cis(TAU * turns(i))).collect()],
    }
}

/// Largest error of the channels, and the report.
fn sum(rows: &Rows, waveform: &Waveform, exact: &[Complex64], options: Options) -> (f64, Report) {
    rows.sum(waveform, exact, options, |groups, options| {
        super::sum(waveform, groups, options)
    })
}

fn check(rows: &Rows, waveform: &Waveform, tolerances: &[f64]) {
    let exact = rows.exact(waveform, 0);
    for tolerance in tolerances {
        sum(rows, waveform, &exact, options(*tolerance));
    }
}

#[test]
fn tolerances_are_kept_at_every_level() {
    for (bandwidth, finest) in [(1e9, 11), (5e9, 10), (-2e9, 10)] {
        let (wf, rows) = (waveform(24, 50, bandwidth), Rows::random(2, 300, 2));
        let exact = rows.exact(&wf, 0);
        for level in Level::available() {
            for digits in 1..=finest {
                let options = Options {
                    level,
                    ..options(10_f64.powi(-digits))
                };
                let (error, _) = sum(&rows, &wf, &exact, options);
                let is_cautious = digits <= 8 && error < 1e-4 * options.tolerance;
                assert!(!is_cautious, "{error:e} is too cautious: {options:?}");
            }
        }
    }
}

#[test]
fn sizes_from_one_on_and_irregular_chirps_keep_the_tolerance() {
    for (num_chirps, num_samples) in [(1, 1), (1, 64), (2, 30), (3, 1), (4, 17), (64, 2), (200, 8), (30, 40)] {
        let (mut wf, mut unit) = (waveform(num_chirps, num_samples, 1e9), units(3));
        for time in wf.chirp_times.iter_mut().filter(|_| num_chirps == 30) {
            *time += 2e-4 * unit();
        }
        for (channels, num_paths) in [(1, 1), (5, 3), (1, 129)] {
            check(&Rows::random(channels, num_paths, 2), &wf, &[1e-2, 1e-4, 1e-6, 1e-9]);
        }
    }
}

#[test]
fn static_paths_are_summed_once_and_with_moving_ones() {
    let wf = waveform(20, 32, 1e9);
    for share in [1, 2] {
        let mut rows = Rows::random(2, 120, 2);
        for (path, rate) in rows.delay[1].iter_mut().enumerate() {
            *rate = if path % 120 % share == 0 { 0.0 } else { 1e-8 };
        }
        let exact = rows.exact(&wf, 0);
        for tolerance in [1e-2, 1e-5, 1e-8, 1e-11] {
            let (_, report) = sum(&rows, &wf, &exact, options(tolerance));
            assert_eq!((report.num_static, report.num_rows > 0), (240 / share, share > 1));
        }
    }
}

#[test]
fn paths_in_phase_keep_the_tolerance() {
    // Plates face the radar in the frame, or beside it along range or along velocity: phases of their centre, and turns of
    // phase per path.
    let wf = waveform(32, 64, 1e9);
    let plate = |n, step: f64, offset: f64| {
        let delay = move |i: f64| 1e-8 + i * step;
        equal(n, delay, |_| 1e-9, move |i| -(58e9 - offset) * delay(i))
    };
    let per_rate = 58e9 * wf.chirp_times[31];
    let turning =
        |n, step: f64, turns: f64| equal(n, |_| 1e-8, move |i| i * step / per_rate, move |i| turns * i * step);
    let worst = |i: f64| 1e-8 + 0.2e-9 * (i / 400.0).floor();
    // One after the other and in no order, so many that some of them are measured.
    let mixed = |i: f64| (i * 0.618_034).fract();
    for rows in [
        equal(400, |_| 1.03e-8, |_| 1e-9, |_| 0.0),
        equal(2000, worst, |_| 3e-9, |_| 0.0),
        plate(500, 0.05e-9, 0.0),
        plate(500, 0.04e-9, 1.2e9),
        turning(500, 0.02, 0.8),
        turning(500, 0.02, -1.7),
        plate(12_000, 0.002e-9, 2.1e9),
        equal(
            8000,
            |_| 1e-8,
            |i| 4e-8 * mixed(i),
            |i| per_rate * 4e-8 * 1.1 * mixed(i),
        ),
    ] {
        check(&rows, &wf, &TOLERANCES);
    }
}

#[test]
fn strong_paths_in_phase_among_weak_ones_keep_the_tolerance() {
    // The strong ones are in phase 1.6 frames after its middle.
    let (wf, mut rows, mut unit) = (waveform(32, 64, 1e9), Rows::random(1, 12_000, 2), units(9));
    for path in (7..12_000).step_by(149) {
        let (delay, rate) = (1e-8 + 1e-11 * unit(), 1e-8 + 1e-10 * unit());
        (rows.delay[0][path], rows.delay[1][path]) = (delay, rate);
        let turns = 58e9 * (delay + rate * 2.1 * wf.chirp_times[31]);
        rows.amplitude[0][path] = Complex64::cis(TAU * turns.fract());
    }
    check(&rows, &wf, &TOLERANCES[1..6]);
}

#[test]
fn strengths_are_as_few_as_the_ranges_allow() {
    let rows = Rows::random(1, 200, 2);
    for (bandwidth, tolerance, expected) in [
        (1e9, 1e-3, 1..=1),
        (1e9, 1e-5, 1..=1),
        (1e9, 1e-8, 3..=3),
        (1e9, 1e-10, 3..=3),
        (5e9, 1e-3, 1..=1),
        (5e9, 1e-8, 3..=3),
        (5e9, 1e-10, 4..=6),
    ] {
        let wf = waveform(64, 128, bandwidth);
        let (_, report) = sum(&rows, &wf, &rows.exact(&wf, 0), options(tolerance));
        assert!(expected.contains(&report.num_grids), "{bandwidth:e} {report:?}");
    }
}

#[test]
fn rates_that_are_too_fast_are_told() {
    let (wf, mut rows, options) = (waveform(8, 16, 1e9), Rows::random(1, 300, 2), options(1e-3));
    rows.delay[1][0] = 1e3;
    rows.groups(0, |groups| {
        assert!(super::sum(&wf, groups, &options).unwrap().is_none());
    });
}
