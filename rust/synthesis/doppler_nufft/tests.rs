use num_complex::Complex64;

use super::*;
use crate::numeric::random::mix;
use crate::numeric::simd::Level;
use crate::synthesis::arrays::ArrayPaths;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::direct;
use crate::synthesis::report::Known;

/// Paths as arrays, (channel, path).
struct Arrays {
    channels: usize,
    delay: Vec<f64>,
    rate: Vec<f64>,
    amplitude: Vec<Complex64>,
}

/// Pseudo-random number, 0 to 1.
fn uniform(seed: usize) -> f64 {
    (mix(seed as u64) >> 11) as f64 / (1_u64 << 53) as f64
}

impl Arrays {
    /// Paths of ranges to 8 m and velocities to 3 m/s.
    fn random(channels: usize, paths: usize) -> Self {
        let numbers = |seed: usize| (0..channels * paths).map(move |i| uniform(4 * i + seed));
        let complex = numbers(2)
            .zip(numbers(3))
            .map(|(a, b)| 1e-7 * a * Complex64::cis(7.0 * b));
        Self {
            channels,
            delay: numbers(0).map(|x| 3e-9 + 5e-8 * x).collect(),
            rate: numbers(1).map(|x| 2e-8 * (2.0 * x - 1.0)).collect(),
            amplitude: complex.collect(),
        }
    }

    /// Equal paths: delays and rates from their number.
    fn equal(paths: usize, delay: impl Fn(f64) -> f64, rate: impl Fn(f64) -> f64, turns: impl Fn(f64) -> f64) -> Self {
        let numbers = || (0..paths).map(|i| i as f64);
        Self {
            channels: 1,
            delay: numbers().map(delay).collect(),
            rate: numbers().map(rate).collect(),
            amplitude: numbers()
                .map(|i| Complex64::cis(std::f64::consts::TAU * turns(i)))
                .collect(),
        }
    }

    /// Call with delays, and amplitudes.
    fn with_series<R>(&self, call: impl FnOnce(&PathSeries) -> R) -> R {
        let rows: [&[f64]; 2] = [&self.delay, &self.rate];
        call(&PathSeries {
            basis: Basis::Taylor,
            delay: &rows,
            amplitude: &[&self.amplitude],
            num_channels: self.channels,
            num_paths: self.delay.len() / self.channels,
        })
    }

    fn exact(&self, waveform: &Waveform) -> Vec<Complex64> {
        let options = Options {
            tolerance: 1e-12,
            level: Level::best(),
            is_parallel: true,
            cancel: None,
            known: Known::NOTHING,
        };
        numbers(
            &self
                .with_groups(|groups| direct::sum(waveform, groups, &options))
                .unwrap(),
        )
    }

    fn sum(&self, waveform: &Waveform, options: &Options) -> Result<Sum> {
        self.with_groups(|groups| prepare(waveform, groups, options)?.run())
    }

    fn with_groups<R>(&self, call: impl FnOnce(&[PathGroup]) -> R) -> R {
        self.with_series(|series| {
            let sources = ArrayPaths::split(series);
            let group = |source| PathGroup {
                source,
                frequency_exponent: 0,
            };
            call(&sources.iter().map(|source| group(source)).collect::<Vec<_>>())
        })
    }

    /// Largest rms error of a channel over its l2(amplitudes), run once more if paths add up in phase.
    fn error(&self, waveform: &Waveform, exact: &[Complex64], options: &Options) -> f64 {
        let mut sum = self.sum(waveform, options).unwrap();
        let gain = self.largest_rms(&numbers(&sum));
        if sum.report.error.with_gain(gain.max(1.0)) > options.tolerance {
            let known = Known {
                gain,
                coherence: sum.coherence,
                needs_double: false,
            };
            sum = self.sum(waveform, &Options { known, ..*options }).unwrap();
            let error = sum.report.error.with_gain(gain);
            assert!(error <= options.tolerance, "{error:e} {:?}", sum.report);
        }
        let powers = self.powers();
        for (got, power) in sum.power.iter().zip(&powers) {
            assert!((got - power).abs() <= 1e-6 * power, "{got} {power}");
        }
        let differences: Vec<Complex64> = numbers(&sum).iter().zip(exact).map(|(a, b)| a - b).collect();
        self.largest_rms(&differences)
    }

    fn powers(&self) -> Vec<f64> {
        let channels = self.amplitude.chunks(self.amplitude.len() / self.channels);
        channels
            .map(|channel| channel.iter().map(Complex64::norm_sqr).sum())
            .collect()
    }

    /// Largest rms over the samples of a channel over its l2(amplitudes).
    fn largest_rms(&self, samples: &[Complex64]) -> f64 {
        let length = samples.len() / self.channels;
        let of_channel = |(channel, power): (&[Complex64], f64)| {
            (channel.iter().map(Complex64::norm_sqr).sum::<f64>() / length as f64 / power).sqrt()
        };
        samples
            .chunks(length)
            .zip(self.powers())
            .map(of_channel)
            .fold(0.0, f64::max)
    }
}

fn numbers(sum: &Sum) -> Vec<Complex64> {
    match &sum.samples {
        Samples::Single(samples) => samples
            .iter()
            .map(|s| Complex64::new(s.re.into(), s.im.into()))
            .collect(),
        Samples::Double(samples) => samples.clone(),
    }
}

fn waveform(bandwidth: f64, num_chirps: usize, num_samples: usize) -> Waveform {
    let sample_rate = 2e6;
    Waveform {
        start_frequency: 58e9,
        slope: bandwidth * sample_rate / num_samples as f64,
        sample_rate,
        adc_delay: 4e-6,
        num_samples,
        chirp_times: (0..num_chirps).map(|c| c as f64 * 4e-4).collect(),
    }
}

fn options(tolerance: f64) -> Options<'static> {
    Options {
        tolerance,
        level: Level::best(),
        is_parallel: false,
        cancel: None,
        known: Known::NOTHING,
    }
}

#[test]
fn tolerances_are_kept_at_every_level() {
    for (bandwidth, finest) in [(1e9, 11), (5e9, 10), (-2e9, 10)] {
        let wf = waveform(bandwidth, 24, 50);
        let paths = Arrays::random(2, 300);
        let exact = paths.exact(&wf);
        for level in Level::available() {
            for digits in 1..=finest {
                let options = Options {
                    level,
                    ..options(10_f64.powi(-digits))
                };
                let error = paths.error(&wf, &exact, &options);
                assert!(error <= options.tolerance, "{bandwidth:e} {level:?} {error:e}");
                assert!(
                    digits > 8 || error > 1e-4 * options.tolerance,
                    "{error:e} is too cautious"
                );
            }
        }
    }
}

#[test]
fn sizes_from_one_on_keep_the_tolerance() {
    for (num_chirps, num_samples) in [(1, 1), (1, 64), (2, 30), (3, 1), (4, 17), (64, 2), (200, 8)] {
        let wf = waveform(1e9, num_chirps, num_samples);
        for (channels, num_paths) in [(1, 1), (5, 3), (1, 129)] {
            let paths = Arrays::random(channels, num_paths);
            let exact = paths.exact(&wf);
            for tolerance in [1e-2, 1e-4, 1e-6, 1e-9] {
                let error = paths.error(&wf, &exact, &options(tolerance));
                let case = (num_chirps, num_samples, channels, num_paths);
                assert!(error <= tolerance, "{case:?} {error:e} for {tolerance:e}");
            }
        }
    }
}

#[test]
fn irregular_chirps_keep_the_tolerance() {
    let mut wf = waveform(1e9, 30, 40);
    for (chirp, time) in wf.chirp_times.iter_mut().enumerate() {
        *time += 2e-4 * uniform(chirp);
    }
    let paths = Arrays::random(1, 200);
    let exact = paths.exact(&wf);
    for tolerance in [1e-3, 1e-5, 1e-7, 1e-10] {
        let error = paths.error(&wf, &exact, &options(tolerance));
        assert!(error <= tolerance, "{error:e} for {tolerance:e}");
    }
}

#[test]
fn static_paths_are_summed_once_and_with_moving_ones() {
    let wf = waveform(1e9, 20, 32);
    for share in [1, 2] {
        let mut paths = Arrays::random(2, 120);
        for (path, rate) in paths.rate.iter_mut().enumerate() {
            if path % 120 % share == 0 {
                *rate = 0.0;
            }
        }
        let exact = paths.exact(&wf);
        for tolerance in [1e-2, 1e-5, 1e-8, 1e-11] {
            let error = paths.error(&wf, &exact, &options(tolerance));
            assert!(error <= tolerance, "{share} {error:e} for {tolerance:e}");
        }
        let report = paths.sum(&wf, &options(1e-3)).unwrap().report;
        assert_eq!(report.num_static, 240 / share);
        assert_eq!(report.num_rows > 0, share > 1);
    }
}

#[test]
fn paths_in_phase_keep_the_tolerance() {
    let wf = waveform(1e9, 32, 64);
    // Turns of phase over a chirp per second, and over the frame per unit of rate.
    let (chirp, frame) = (1e9, 58e9 * 31.0 * 4e-4);
    let worst = |i: f64| 1e-8 + 0.2e-9 * (i / 400.0).floor();
    let cases = [
        // Equal paths at any place between two cells; plates that face the radar in the frame, or beside it along range
        // or along velocity.
        ("equal", Arrays::equal(400, |_| 1.03e-8, |_| 1e-9, |_| 0.0)),
        ("worst", Arrays::equal(2000, worst, |_| 3e-9, |_| 0.0)),
        (
            "plate",
            Arrays::equal(
                500,
                |i| 1e-8 + i * 0.05 / chirp,
                |_| 0.0 + 1e-9,
                |i| -58e9 * (1e-8 + i * 0.05 / chirp),
            ),
        ),
        (
            "range",
            Arrays::equal(
                500,
                |i| 1e-8 + i * 0.04 / chirp,
                |_| 1e-9,
                |i| -(58e9 - 1.2e9) * (1e-8 + i * 0.04 / chirp),
            ),
        ),
        (
            "velocity",
            Arrays::equal(500, |_| 1e-8, |i| i * 0.02 / frame, |i| 0.8 * i * 0.02),
        ),
        (
            "before",
            Arrays::equal(500, |_| 1e-8, |i| i * 0.02 / frame, |i| -1.7 * i * 0.02),
        ),
    ];
    for (name, paths) in cases {
        let exact = paths.exact(&wf);
        for digits in 1..=9 {
            let tolerance = 10_f64.powi(-digits);
            let error = paths.error(&wf, &exact, &options(tolerance));
            assert!(error <= tolerance, "{name} {error:e} for {tolerance:e}");
        }
    }
}

#[test]
fn strengths_are_as_few_as_the_ranges_allow() {
    let paths = Arrays::random(1, 200);
    let terms = |bandwidth: f64, tolerance: f64| {
        let sum = paths.sum(&waveform(bandwidth, 64, 128), &options(tolerance)).unwrap();
        sum.report.num_grids
    };
    assert_eq!(
        [1e-3, 1e-5, 1e-8, 1e-10].map(|tolerance| terms(1e9, tolerance)),
        [1, 1, 3, 3]
    );
    assert_eq!([1e-3, 1e-8].map(|tolerance| terms(5e9, tolerance)), [1, 3]);
    assert!((4..=6).contains(&terms(5e9, 1e-10)));
}

#[test]
fn sums_do_not_depend_on_threads() {
    let wf = waveform(1e9, 16, 32);
    let paths = Arrays::random(2, 70_000);
    for tolerance in [1e-3, 1e-8] {
        let parallel = Options {
            is_parallel: true,
            ..options(tolerance)
        };
        let [one, many] = [options(tolerance), parallel].map(|options| numbers(&paths.sum(&wf, &options).unwrap()));
        assert!(one == many);
    }
}

#[test]
fn frequency_exponents_multiply_the_samples() {
    let wf = waveform(1e9, 8, 16);
    let paths = Arrays::random(1, 50);
    let plain = numbers(&paths.sum(&wf, &options(1e-8)).unwrap());
    let both = paths.with_series(|series| {
        let sources = ArrayPaths::split(series);
        let groups = [0, 2].map(|frequency_exponent| PathGroup {
            source: &sources[0],
            frequency_exponent,
        });
        numbers(&prepare(&wf, &groups, &options(1e-8)).unwrap().run().unwrap())
    });
    let factors = wf.over_frequency(2);
    for (at, (both, plain)) in both.iter().zip(&plain).enumerate() {
        let expected = plain * (1.0 + factors[at % 16]);
        assert!(
            (both - expected).norm() <= 1e-7 * expected.norm().max(1e-7),
            "{both} {expected}"
        );
    }
}

#[test]
fn numbers_that_are_not_finite_and_rates_that_are_too_fast_are_told() {
    let wf = waveform(1e9, 8, 16);
    for bad in [f64::NAN, f64::INFINITY] {
        let mut paths = Arrays::random(1, 300);
        paths.delay[200] = bad;
        assert!(
            paths
                .sum(&wf, &options(1e-3))
                .unwrap_err()
                .to_string()
                .contains("delay")
        );
        let mut paths = Arrays::random(1, 300);
        paths.rate[299] = bad;
        assert!(paths.sum(&wf, &options(1e-3)).unwrap_err().to_string().contains("rate"));
        let mut paths = Arrays::random(1, 300);
        paths.amplitude[7].im = bad;
        assert!(
            paths
                .sum(&wf, &options(1e-3))
                .unwrap_err()
                .to_string()
                .contains("amplitude")
        );
    }
    let mut paths = Arrays::random(1, 300);
    paths.rate[0] = 1e3;
    paths.with_series(|series| {
        let sources = ArrayPaths::split(series);
        let groups = [PathGroup {
            source: &sources[0],
            frequency_exponent: 0,
        }];
        let options = options(1e-3);
        let prepared = prepare(&wf, &groups, &options).unwrap();
        assert!(prepared.report.error.with_gain(1.0) > 1e9);
        assert!(prepared.run().is_err());
    });
}

#[test]
fn requests_to_stop_are_answered() {
    let cancel = Cancel::default();
    cancel.ask();
    let options = Options {
        cancel: Some(&cancel),
        ..options(1e-3)
    };
    let stopped = Arrays::random(1, 300).sum(&waveform(1e9, 8, 16), &options);
    assert!(matches!(stopped, Err(Error::Interrupted)));
}
