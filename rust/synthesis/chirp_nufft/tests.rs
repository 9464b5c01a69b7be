use std::f64::consts::TAU;

use num_complex::Complex64;

use super::*;
use crate::constants::SPEED_OF_LIGHT as C;
use crate::numeric::simd::Level;
use crate::synthesis::tests::{Rows, options, units, waveform, wide};

/// Echoes of a plate of some depth [m], whose parts move at up to `speed`, that are in phase at a sample and a chirp.
fn plate(waveform: &Waveform, depth: f64, speed: f64, (sample, chirp): (f64, f64)) -> Rows {
    let (number, mut unit) = (500, units(3));
    let range: Vec<f64> = (0..number)
        .map(|i| 4.0 + depth * (f64::from(i) / f64::from(number) - 0.5))
        .collect();
    let velocity: Vec<f64> = range.iter().map(|_| speed * (unit() - 0.5)).collect();
    let fast = waveform.adc_delay + sample / waveform.sample_rate;
    let amplitude = range.iter().zip(&velocity).map(|(range, velocity)| {
        let delay = 2.0 / C * (range + velocity * (300e-6 * chirp + fast));
        let phase = waveform.start_frequency * delay + waveform.slope * delay * (fast - 0.5 * delay);
        Complex64::from_polar(1.0, TAU * phase.fract())
    });
    let amplitude = amplitude.collect();
    Rows::taylor(&[range, velocity], amplitude)
}

/// Check a sum, which keeps its predicted error and the tolerance. Returns its report.
fn check(rows: &Rows, waveform: &Waveform, exact: &[Complex64], tolerance: f64, level: Level) -> Report {
    let options = Options {
        level,
        ..options(tolerance)
    };
    let run = |groups: &[PathGroup], options: &Options| sum(waveform, groups, options);
    rows.sum(waveform, exact, options, run).1
}

#[test]
fn sums_keep_their_tolerance_on_every_instruction_set() {
    for (num_chirps, num_samples, bandwidth) in [
        (1, 128, 1e9),
        (2, 16, -1e9),
        (17, 100, 1e9),
        (64, 128, -4e9),
        (33, 1, 1e9),
    ] {
        let mut waveform = waveform(num_chirps, num_samples, bandwidth);
        for time in waveform.chirp_times.iter_mut().step_by(3) {
            *time += 37e-6;
        }
        let swing = (0.4, 1.5, 8);
        for paths in [
            Rows::random(2, 200, 3),
            Rows::swinging(&waveform, 200, swing, 0.0),
            Rows::swinging(&waveform, 200, swing, 0.005 * num_chirps as f64),
            Rows::random(2, 1, 3),
        ] {
            let exact = paths.exact(&waveform, 0);
            for level in Level::available() {
                for tolerance in [1e-2, 1e-3, 1e-4, 1e-5, 1e-7, 1e-9] {
                    check(&paths, &waveform, &exact, tolerance, level);
                }
            }
        }
    }
}

#[test]
fn precision_width_and_grids_follow_the_tolerance() {
    let waveform = waveform(64, 128, 1e9);
    let paths = Rows::swinging(&waveform, 300, (0.4, 1.5, 12), 0.0);
    let exact = paths.exact(&waveform, 0);
    for (tolerance, expected) in [
        (1e-2, (true, 4, 1)),
        (1e-3, (true, 4, 1)),
        (1e-5, (true, 6, 3)),
        (1e-6, (false, 8, 3)),
        (1e-10, (false, 12, 5)),
    ] {
        let report = check(&paths, &waveform, &exact, tolerance, Level::best());
        assert_eq!(
            (report.is_single, report.width, report.num_grids),
            expected,
            "{tolerance:e}"
        );
    }
}

#[test]
fn plates_in_phase_beside_the_chirps_keep_the_tolerance() {
    let waveform = waveform(32, 64, 1e9);
    for depth in [0.05, 0.3, 1.0, 4.0] {
        for sample in [32.0, 128.0, -64.0, 131.0, 160.0, -96.0] {
            for (speed, chirp) in [(0.0, 0.0), (0.5, 16.0), (0.5, 32.0), (3.0, -16.0)] {
                let paths = plate(&waveform, depth, speed, (sample, chirp));
                let exact = paths.exact(&waveform, 0);
                for tolerance in [1e-2, 1e-3, 1e-4] {
                    check(&paths, &waveform, &exact, tolerance, Level::best());
                }
            }
        }
    }
}

#[test]
fn equal_paths_keep_the_tolerance() {
    let waveform = waveform(32, 64, 1e9);
    let equal = |number: usize| {
        let rows = [vec![3.01; number], vec![1.2; number]];
        Rows::taylor(&rows, vec![Complex64::ONE; number])
    };
    for paths in [2, 5, 50].map(equal) {
        let exact = paths.exact(&waveform, 0);
        for tolerance in [1e-2, 1e-3, 1e-5, 1e-7] {
            check(&paths, &waveform, &exact, tolerance, Level::best());
        }
    }
}

#[test]
fn fast_motion_gets_blocks_of_chirps() {
    let waveform = waveform(64, 64, 1e9);
    let paths = Rows::swinging(&waveform, 50, (1e-3, 150.0, 48), 0.0);
    let exact = paths.exact(&waveform, 0);
    for tolerance in [1e-1, 1e-2, 1e-3, 1e-4] {
        let report = check(&paths, &waveform, &exact, tolerance, Level::best());
        assert!(report.num_blocks > 1 || !report.is_single, "{tolerance:e}: {report:?}");
    }
    let slow = Rows::swinging(&waveform, 50, (0.4, 1.5, 8), 0.0);
    let report = check(&slow, &waveform, &slow.exact(&waveform, 0), 1e-3, Level::best());
    assert_eq!(report.num_blocks, 1);
}

#[test]
fn groups_have_their_power_of_the_frequency() {
    let (waveform, paths) = (waveform(20, 64, 4e9), Rows::random(2, 100, 3));
    for exponent in [1, 2] {
        let exact = paths.exact(&waveform, exponent);
        let sum = paths.groups(exponent, |groups| sum(&waveform, groups, &options(1e-3)).unwrap());
        let [error, _] = paths.error(&wide(sum.unwrap().samples), &exact);
        assert!(error < 1e-3, "{exponent}: {error:e}");
        let [error, _] = paths.error(&paths.exact(&waveform, 0), &exact);
        assert!(error > 1e-2, "{exponent}: {error:e}");
    }
}
