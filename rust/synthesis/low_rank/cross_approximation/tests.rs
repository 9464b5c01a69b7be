use super::*;
use crate::numeric::random::mix;
use crate::synthesis::delay::{Basis, PathSeries};

fn waveform() -> Waveform {
    Waveform {
        start_frequency: 58e9,
        slope: 2e13,
        sample_rate: 2e6,
        adc_delay: 3e-6,
        num_samples: 64,
        chirp_times: (0..40).map(|c| f64::from(c) * 4e-4).collect(),
    }
}

/// Random paths in the whole frame, with accelerations and changing amplitudes.
fn paths(wf: &Waveform, count: usize) -> (Block, Frame, Vec<Path>) {
    let mut state = 3;
    let mut unit = || {
        state = mix(state);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let empty: [&[f64]; 3] = [&[], &[], &[]];
    let series = PathSeries {
        basis: Basis::Taylor,
        delay: &empty,
        amplitude: &[&[]],
        num_channels: 1,
        num_paths: 0,
    };
    let block = Block::new(wf, &series, 0..wf.chirp_times.len());
    let frame = Frame::new(wf.start_frequency, 2e-8, wf.slope);
    let paths = (0..count)
        .map(|_| {
            let mut about = |middle: f64, span: f64| middle + span * (unit() - 0.5);
            Path::new(
                [about(0.0, 1e-5), about(0.0, 40.0)],
                [about(0.0, 0.3), about(0.0, 0.05)].into_iter(),
                [1.5, 0.5].map(|middle| [about(middle, 1.0), about(0.0, 0.05)].into_iter()),
            )
        })
        .collect();
    (block, frame, paths)
}

/// The residual by its definition.
fn residual(path: &Path, frame: &Frame, instant: &Instant) -> Complex64 {
    let chebyshev = |k: usize| (k as f64 * instant.x.clamp(-1.0, 1.0).acos()).cos();
    let sum = |series: &[f64], first: usize| -> f64 {
        series.iter().enumerate().map(|(k, c)| c * chebyshev(first + k)).sum()
    };
    let delta = sum(path.bends(), 2);
    let turns = delta * (1.0 + instant.sweep - path.offset) + instant.x * instant.sweep * path.offset * path.rate
        - frame.bend * (path.rate * instant.x + delta).powi(2);
    let phasor = Complex64::from_polar(1.0, std::f64::consts::TAU * turns);
    Complex64::new(sum(path.re(), 0), -sum(path.im(), 0)) * phasor
}

/// Value at an instant of the interpolation between those at the terms' instants.
fn interpolated(approximation: &CrossApproximation, frame: &Frame, path: &Path, instant: &Instant) -> Complex64 {
    let mut functions: Vec<Complex64> = Vec::new();
    let mut coefficients: Vec<Complex64> = Vec::new();
    for (i, (reference, inverse, own)) in approximation.references.iter().enumerate() {
        let mut function = residual(reference, frame, instant) * inverse;
        let mut coefficient = residual(path, frame, &approximation.instants[i]);
        for j in 0..i {
            function -= own[j] * functions[j];
            coefficient -= approximation.lower[i][j] * coefficients[j];
        }
        functions.push(function);
        coefficients.push(coefficient);
    }
    functions.iter().zip(&coefficients).map(|(q, c)| q * c).sum()
}

#[test]
fn every_path_is_interpolated_within_the_budget() {
    let wf = waveform();
    let (block, frame, paths) = paths(&wf, 400);
    let mut last = 0;
    for budget in [1e-2, 1e-4, 1e-8] {
        for level in Level::available() {
            let (approximation, error) = find(&wf, &block, &frame, &paths[..200], (budget, 1e-14), level).unwrap();
            assert!(error <= budget);
            assert!(
                approximation.num_sets() >= last,
                "{} terms for {budget}",
                approximation.num_sets()
            );
            last = approximation.num_sets();
            // Also paths and instants that the search has not seen.
            let (mut left, mut power) = (0.0, 0.0);
            for path in &paths {
                for i in 0..50 {
                    let instant = Instant {
                        x: f64::from(i) / 24.5 - 1.0,
                        sweep: frame.stretch * wf.half_sweep() * (f64::from(i * 7 % 50) / 24.5 - 1.0),
                    };
                    let exact = residual(path, &frame, &instant);
                    left += (interpolated(&approximation, &frame, path, &instant) - exact).norm_sqr();
                    power += exact.norm_sqr();
                }
            }
            let measured = (left / power).sqrt();
            assert!(measured <= 1.5 * budget, "{measured:e} for {budget:e}");
            // Weights of the checks are those of the interpolation.
            for check in &approximation.checks {
                let values = approximation
                    .instants
                    .iter()
                    .map(|instant| residual(&paths[7], &frame, instant));
                let sum: Complex64 = values.zip(&check.weights).map(|(value, weight)| value * weight).sum();
                let expected = interpolated(&approximation, &frame, &paths[7], &check.instant);
                assert!((sum - expected).norm() < 1e-10, "{}", (sum - expected).norm());
            }
        }
    }
}

#[test]
fn paths_at_constant_velocity_need_one_phase() {
    let wf = waveform();
    let (block, frame, mut paths) = paths(&wf, 50);
    for path in &mut paths {
        let parts = [path.re()[0], path.im()[0]].map(std::iter::once);
        *path = Path::new([path.offset, path.rate], std::iter::empty(), parts);
    }
    let (approximation, error) = find(&wf, &block, &frame, &paths, (1e-3, 1e-14), Level::best()).unwrap();
    assert!(approximation.are_flat() && approximation.num_sets() == 1 && error < 1e-3);
    assert_eq!(approximation.checks.len(), NUM_CHECKS);
    // A rounding error is within no sum of a few.
    assert!(find(&wf, &block, &frame, &paths, (1e-18, 1e-14), Level::best()).is_none());
}

#[test]
fn places_are_spread_to_both_ends() {
    assert_eq!(spread(3, 16), [(0, 1.0), (1, 1.0), (2, 1.0)]);
    let places = spread(100, 16);
    assert_eq!((places[0].0, places[places.len() - 1].0), (0, 99));
    assert!(places.windows(2).all(|pair| pair[0].0 < pair[1].0));
    let all: f64 = places.iter().map(|(_, weight)| weight).sum();
    assert!((all - 100.0).abs() < 1e-9, "{all}");
}
