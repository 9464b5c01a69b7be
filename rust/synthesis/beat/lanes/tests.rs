use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::*;
use crate::constants::SPEED_OF_LIGHT as C;
use crate::numeric::random::mix;
use crate::numeric::simd::Level;
use crate::synthesis::beat::signal::beat_signal;
use crate::synthesis::delay::Basis;
use crate::synthesis::direct;

const NUM_CHANNELS: usize = 2;

/// Numbers from 0 to 1 that are as good as random.
fn units(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = mix(state);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn waveform(num_chirps: usize, num_samples: usize, bandwidth: f64) -> Waveform {
    Waveform {
        start_frequency: 58e9,
        slope: bandwidth * 2e6 / num_samples.max(16) as f64,
        sample_rate: 2e6,
        adc_delay: 3.1e-6,
        num_samples,
        chirp_times: (0..num_chirps).map(|chirp| 300e-6 * chirp as f64).collect(),
    }
}

/// Paths of all channels, one row per term.
struct Paths {
    basis: Basis,
    delay: Vec<Vec<f64>>,
    amplitude: Vec<Vec<Complex64>>,
}

impl Paths {
    /// Accelerated motion at up to 3 m/s, 0.5 to 8 m away; every fifth path stands still.
    fn accelerating(number: usize) -> Self {
        let mut unit = units(7);
        let mut row = |low: f64, high: f64, rests: bool| -> Vec<f64> {
            let numbers = (0..NUM_CHANNELS * number).map(|i| {
                let moves = if rests && i % 5 == 0 { 0.0 } else { 1.0 };
                2.0 / C * moves * (low + (high - low) * unit())
            });
            numbers.collect()
        };
        let delay = vec![row(0.5, 8.0, false), row(-3.0, 3.0, true), row(-50.0, 50.0, true)];
        let amplitude = (0..NUM_CHANNELS * number).map(|_| Complex64::from_polar(1e-5 * (0.5 + unit()), TAU * unit()));
        Self {
            basis: Basis::Taylor,
            delay,
            amplitude: vec![amplitude.collect()],
        }
    }

    /// Limbs that swing at 1.5 Hz by 0.4 m, seen at eight times; amplitudes follow the distance, and turn their argument
    /// by `turn` [rad].
    fn swinging(waveform: &Waveform, number: usize, turn: f64) -> Self {
        let mut unit = units(5);
        let limbs: Vec<[f64; 4]> = (0..NUM_CHANNELS * number)
            .map(|_| [1.0 + 4.0 * unit(), 0.4 * unit(), unit(), unit()])
            .collect();
        let mut paths = Self {
            basis: Basis::Chebyshev,
            delay: Vec::new(),
            amplitude: Vec::new(),
        };
        for node in 0..8 {
            let x = -(PI * f64::from(2 * node + 1) / 16.0).cos();
            let time = 0.5 * waveform.duration() * (1.0 + x);
            let range = |limb: &[f64; 4]| limb[0] + limb[1] * (TAU * (1.5 * time + limb[2])).sin();
            paths
                .delay
                .push(limbs.iter().map(|limb| 2.0 / C * range(limb)).collect());
            let amplitude =
                |limb: &[f64; 4]| Complex64::from_polar(1e-3 / range(limb).powi(2), TAU * limb[3] + turn * x);
            paths.amplitude.push(limbs.iter().map(amplitude).collect());
        }
        paths
    }

    fn with_series<T>(&self, run: impl FnOnce(&PathSeries) -> T) -> T {
        let delay: Vec<&[f64]> = self.delay.iter().map(Vec::as_slice).collect();
        let amplitude: Vec<&[Complex64]> = self.amplitude.iter().map(Vec::as_slice).collect();
        run(&PathSeries {
            basis: self.basis,
            delay: &delay,
            amplitude: &amplitude,
            num_channels: NUM_CHANNELS,
            num_paths: self.delay[0].len() / NUM_CHANNELS,
        })
    }

    fn exact(&self, waveform: &Waveform) -> Vec<Complex64> {
        self.with_series(|series| direct::beat_signal(waveform, series, Class::All, Level::best(), true, None))
    }

    fn sum(&self, waveform: &Waveform, options: Options) -> (Vec<Complex32>, Report) {
        let (samples, report) = self
            .with_series(|series| beat_signal(waveform, series, &options))
            .unwrap();
        match samples {
            Samples::Single(samples) => (samples, report),
            Samples::Double(_) => panic!("{}", report.plan),
        }
    }

    /// Largest error of the channels, rms relative to l2(amplitudes).
    fn error(&self, got: &[Complex32], exact: &[Complex64]) -> f64 {
        let channel = |rows: &[Vec<Complex64>], at: usize| -> f64 {
            let number = rows[0].len() / NUM_CHANNELS;
            let own = rows.iter().flat_map(|row| &row[at * number..(at + 1) * number]);
            own.map(Complex64::norm_sqr).sum::<f64>() / rows.len() as f64
        };
        let size = got.len() / NUM_CHANNELS;
        let pairs = got.chunks(size).zip(exact.chunks(size)).enumerate();
        let errors = pairs.map(|(at, (got, exact))| {
            let difference =
                |(a, b): (&Complex32, &Complex64)| (Complex64::new(f64::from(a.re), f64::from(a.im)) - b).norm_sqr();
            let square: f64 = got.iter().zip(exact).map(difference).sum();
            (square / size as f64 / channel(&self.amplitude, at)).sqrt()
        });
        errors.fold(0.0, f64::max)
    }
}

fn options(tolerance: f64, level: Level) -> Options<'static> {
    Options {
        tolerance,
        method: Method::Lanes,
        level,
        is_parallel: false,
        ..Options::default()
    }
}

#[test]
fn sums_keep_their_predicted_errors_on_every_instruction_set() {
    for (num_chirps, num_samples, bandwidth) in [
        (1, 128, 1e9),
        (2, 16, -1e9),
        (17, 100, 1e9),
        (64, 128, -1e9),
        (33, 1, 1e9),
    ] {
        let mut waveform = waveform(num_chirps, num_samples, bandwidth);
        waveform
            .chirp_times
            .iter_mut()
            .step_by(3)
            .for_each(|time| *time += 37e-6);
        // Amplitudes are those in the middle of a chirp: they may change by a few parts in 10^4 there.
        let turn = if num_chirps < 16 {
            0.0
        } else {
            0.005 * num_chirps as f64
        };
        for (name, paths, finest) in [
            ("accelerating", Paths::accelerating(300), 2e-4),
            ("swinging", Paths::swinging(&waveform, 300, 0.0), 2e-3),
            ("turning", Paths::swinging(&waveform, 300, turn), 2e-3),
            ("one", Paths::accelerating(1), 2e-4),
        ] {
            let exact = paths.exact(&waveform);
            for tolerance in [1e-2, 2e-3, 2e-4].into_iter().filter(|tolerance| *tolerance >= finest) {
                for level in Level::available() {
                    let (samples, report) = paths.sum(&waveform, options(tolerance, level));
                    let (error, case) = (paths.error(&samples, &exact), (num_chirps, num_samples, name, level));
                    assert!(error <= report.plan.error(), "{error:e} {case:?}: {}", report.plan);
                    assert!(report.plan.error() <= tolerance, "{case:?}: {}", report.plan);
                }
            }
        }
    }
}

#[test]
fn steady_amplitudes_are_summed_to_the_finest_tolerance() {
    for bandwidth in [1e9, -1e9] {
        let waveform = waveform(64, 128, bandwidth);
        let mut paths = Paths::swinging(&waveform, 300, 0.0);
        paths.amplitude.truncate(1);
        let exact = paths.exact(&waveform);
        for (tolerance, has_second) in [(1e-2, false), (1e-3, false), (1e-4, true), (5e-5, true)] {
            let (samples, report) = paths.sum(&waveform, options(tolerance, Level::best()));
            let error = paths.error(&samples, &exact);
            assert!(error <= report.plan.error(), "{tolerance:e}: {error:e} {}", report.plan);
            let Step::Lanes { has_second: got, .. } = report.plan.parts[0].step else {
                panic!("{}", report.plan)
            };
            assert_eq!(got, has_second, "{tolerance:e} {}", report.plan);
        }
    }
}

#[test]
fn number_of_threads_changes_no_bit() {
    let waveform = waveform(40, 64, 1e9);
    let paths = Paths::accelerating(5000);
    let sums: Vec<_> = [1, 2, 3]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let options = Options {
                is_parallel: threads > 1,
                ..options(1e-3, Level::best())
            };
            pool.install(|| paths.sum(&waveform, options).0)
        })
        .collect();
    assert!(sums[0] == sums[1] && sums[0] == sums[2]);
}

#[test]
fn still_paths_apart_are_those_among_moving_ones() {
    let waveform = waveform(20, 64, 1e9);
    let paths = Paths::accelerating(500);
    let [apart, together] = [true, false].map(|split_still| {
        let options = Options {
            split_still,
            ..options(1e-3, Level::best())
        };
        paths.sum(&waveform, options)
    });
    assert_eq!(apart.1.plan.parts[0].num_paths, NUM_CHANNELS * 100);
    assert_eq!(together.1.plan.parts.len(), 1);
    let exact: Vec<Complex64> = together
        .0
        .iter()
        .map(|z| Complex64::new(f64::from(z.re), f64::from(z.im)))
        .collect();
    assert!(paths.error(&apart.0, &exact) < 1e-6);
}

#[test]
fn tolerances_out_of_reach_name_one_that_is_not() {
    let waveform = waveform(16, 64, 1e9);
    let paths = Paths::accelerating(100);
    let refused = paths.with_series(|series| beat_signal(&waveform, series, &options(2e-6, Level::best())).map(|_| ()));
    let message = refused.unwrap_err().to_string();
    assert!(message.starts_with("tolerance: expected"), "{message}");
}

#[test]
fn tolerances_below_single_precision_are_not_tried() {
    let work = Work {
        channels: 3,
        paths: 30_000,
        still: 0,
        terms: 8,
    };
    let is_wanted = |tolerance, method| {
        let options = Options {
            method,
            ..options(tolerance, Level::best())
        };
        LaneSum::is_wanted(&waveform(64, 128, 1e9), work, &options)
    };
    for (tolerance, wanted) in [(1e-3, true), (3e-5, true), (2e-5, false), (1e-5, false)] {
        assert_eq!(is_wanted(tolerance, Method::Auto), wanted, "{tolerance:e}");
        assert_eq!(is_wanted(tolerance, Method::Lanes), wanted, "{tolerance:e}");
    }
}
