//! Paths for the tests of engines, and tests of sums by whichever engine is chosen.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT as C;
use crate::error::{Error, Result};
use crate::numeric::chebyshev::chebyshev_nodes;
use crate::numeric::random::mix;
use crate::numeric::simd::Level;
use crate::synthesis::arrays::ArrayPaths;
use crate::synthesis::beat_signal::beat_signal;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::choose::Method;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::direct;
use crate::synthesis::report::{Known, Options, Report, Samples, Sum};
use crate::synthesis::source::PathGroup;

/// Numbers that are as good as random, 0 to 1.
pub fn units(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = mix(state);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Frame of chirps every 300 us at 2 MHz.
pub fn waveform(num_chirps: usize, num_samples: usize, bandwidth: f64) -> Waveform {
    Waveform {
        start_frequency: 58e9,
        slope: bandwidth * 2e6 / num_samples.max(16) as f64,
        sample_rate: 2e6,
        adc_delay: 3.1e-6,
        num_samples,
        chirp_times: (0..num_chirps).map(|chirp| 300e-6 * chirp as f64).collect(),
    }
}

/// Options on one thread of the best instruction set.
pub fn options(tolerance: f64) -> Options<'static> {
    Options {
        tolerance,
        level: Level::best(),
        is_parallel: false,
        cancel: None,
        known: Known::NOTHING,
    }
}

/// Samples in double precision.
pub fn wide(samples: Samples) -> Vec<Complex64> {
    let widened = |z: num_complex::Complex32| Complex64::new(z.re.into(), z.im.into());
    match samples {
        Samples::Single(samples) => samples.into_iter().map(widened).collect(),
        Samples::Double(samples) => samples,
    }
}

/// Paths of all channels, one row per term.
#[derive(Clone)]
pub struct Rows {
    pub basis: Basis,
    pub num_channels: usize,
    pub delay: Vec<Vec<f64>>,
    pub amplitude: Vec<Vec<Complex64>>,
}

impl Rows {
    /// Ranges [m], velocities and accelerations, and amplitudes, of one channel.
    pub fn taylor(rows: &[Vec<f64>], amplitude: Vec<Complex64>) -> Self {
        let delays = |row: &Vec<f64>| row.iter().map(|x| 2.0 / C * x).collect();
        Self {
            basis: Basis::Taylor,
            num_channels: 1,
            delay: rows.iter().map(delays).collect(),
            amplitude: vec![amplitude],
        }
    }

    /// Paths 0.5 to 8 m away at up to 3 m/s and 50 m/s^2, with the requested number of these terms; one in five is
    /// static.
    pub fn random(num_channels: usize, num_paths: usize, num_terms: usize) -> Self {
        let (mut unit, number) = (units(7), num_channels * num_paths);
        let mut row = |k: usize, low: f64, high: f64| -> Vec<f64> {
            let stands = |i: usize| k > 0 && (i % num_paths) % 5 == 1;
            (0..number)
                .map(|i| if stands(i) { 0.0 } else { low + (high - low) * unit() })
                .collect()
        };
        let rows = [row(0, 0.5, 8.0), row(1, -3.0, 3.0), row(2, -50.0, 50.0)];
        let amplitude = (0..number).map(|_| Complex64::from_polar(1e-5 * (0.5 + unit()), TAU * unit()));
        Self {
            num_channels,
            ..Self::taylor(&rows[..num_terms], amplitude.collect())
        }
    }

    /// Limbs in two channels that swing by some length [m] at some rate [Hz], seen at some times; amplitudes follow the
    /// distance, and turn their argument by `turn` [rad].
    pub fn swinging(waveform: &Waveform, number: usize, (length, rate, times): (f64, f64, usize), turn: f64) -> Self {
        let mut unit = units(5);
        let limbs: Vec<[f64; 4]> = (0..2 * number)
            .map(|_| [1.0 + 4.0 * unit(), length * unit(), unit(), unit()])
            .collect();
        let mut rows = Self {
            num_channels: 2,
            basis: Basis::Chebyshev,
            ..Self::taylor(&[], Vec::new())
        };
        rows.amplitude.clear();
        for x in chebyshev_nodes(times) {
            let time = 0.5 * waveform.duration() * (1.0 + x);
            let range = |limb: &[f64; 4]| limb[0] + limb[1] * (TAU * (rate * time + limb[2])).sin();
            let amplitude =
                |limb: &[f64; 4]| Complex64::from_polar(1e-3 / range(limb).powi(2), TAU * limb[3] + turn * x);
            rows.delay
                .push(limbs.iter().map(|limb| 2.0 / C * range(limb)).collect());
            rows.amplitude.push(limbs.iter().map(amplitude).collect());
        }
        rows
    }

    /// Paths per channel.
    pub fn num_paths(&self) -> usize {
        self.delay[0].len() / self.num_channels
    }

    pub fn series<T>(&self, run: impl FnOnce(&PathSeries) -> T) -> T {
        let delay: Vec<&[f64]> = self.delay.iter().map(Vec::as_slice).collect();
        let amplitude: Vec<&[Complex64]> = self.amplitude.iter().map(Vec::as_slice).collect();
        run(&PathSeries {
            basis: self.basis,
            delay: &delay,
            amplitude: &amplitude,
            num_channels: self.num_channels,
            num_paths: self.num_paths(),
        })
    }

    /// Run something with the paths as groups: static ones separate, all with powers of the frequency from some on.
    pub fn groups<T>(&self, exponent: u8, run: impl FnOnce(&[PathGroup]) -> T) -> T {
        self.series(|series| {
            let sources = ArrayPaths::split(series);
            let group = |(number, source)| PathGroup {
                source,
                frequency_exponent: exponent + number * exponent.min(1),
            };
            let sources = (0..).zip(sources.iter().map(|source| source as _));
            run(&sources.map(group).collect::<Vec<_>>())
        })
    }

    /// Samples of the oracle.
    pub fn exact(&self, waveform: &Waveform, exponent: u8) -> Vec<Complex64> {
        let sum = self.groups(exponent, |groups| direct::sum(waveform, groups, &options(1e-12)));
        wide(sum.unwrap().samples)
    }

    /// Mean over the nodes of the squared l2(amplitudes) of a channel.
    fn power(&self, channel: usize) -> f64 {
        let number = self.num_paths();
        let own = |row: &Vec<Complex64>| -> f64 {
            let own = &row[channel * number..][..number];
            own.iter().map(Complex64::norm_sqr).sum()
        };
        self.amplitude.iter().map(own).sum::<f64>() / self.amplitude.len() as f64
    }

    /// Largest error of the channels, and largest rms of their samples, relative to l2(amplitudes).
    pub fn error(&self, got: &[Complex64], exact: &[Complex64]) -> [f64; 2] {
        let (size, mut largest) = (got.len() / self.num_channels, [0.0_f64; 2]);
        for (channel, (got, exact)) in got.chunks(size).zip(exact.chunks(size)).enumerate() {
            let power = self.power(channel);
            let error: f64 = got.iter().zip(exact).map(|(a, b)| (a - b).norm_sqr()).sum();
            let energy: f64 = exact.iter().map(Complex64::norm_sqr).sum();
            for (largest, square) in largest.iter_mut().zip([error, energy]) {
                *largest = largest.max((square / size as f64 / power).sqrt());
            }
        }
        largest
    }

    /// Largest error of the channels of a sum by an engine, and its report. Errors are within their predicted bound, and the
    /// bound within the tolerance in two runs.
    pub fn sum(
        &self,
        waveform: &Waveform,
        exact: &[Complex64],
        options: Options,
        run: impl Fn(&[PathGroup], &Options) -> Result<Option<Sum>>,
    ) -> (f64, Report) {
        let mut options = options;
        for _ in 0..2 {
            let sum = self
                .groups(0, |groups| run(groups, &options))
                .unwrap()
                .expect("in reach");
            for (channel, power) in sum.power.iter().enumerate() {
                assert!((power / self.power(channel) - 1.0).abs() < 0.01, "{power}");
            }
            let [error, gain] = self.error(&wide(sum.samples), exact);
            let gain = (gain / waveform.fluctuation()).max(1.0);
            let bound = sum.report.error.with_gain(gain);
            // Both sums round delays of some thousand turns; samples may be in single precision.
            let rounding = if options.tolerance >= 1e-6 { 6e-8 } else { 2e-12 };
            assert!(
                error <= bound.hypot(rounding * gain),
                "{error:e} {options:?} {:?}",
                sum.report
            );
            if bound <= options.tolerance {
                return (error, sum.report);
            }
            options.known = Known {
                gain: 1.01 * gain,
                coherence: sum.coherence,
                needs_double: sum.report.error.rounding_with_gain(gain) > 0.5 * options.tolerance,
            };
        }
        panic!("{options:?}: out of reach");
    }

    /// Sum by a method; its error must be within the tolerance, beside the rounding of samples in single precision.
    fn check(&self, waveform: &Waveform, method: Method, tolerance: f64, level: Level) -> Report {
        let options = Options {
            level,
            ..options(tolerance)
        };
        let (samples, report) = self
            .series(|series| beat_signal(waveform, series, method, &options))
            .unwrap();
        let [error, gain] = self.error(&wide(samples), &self.exact(waveform, 0));
        let rounding = if tolerance >= 1e-6 { 6e-8 * gain } else { 3e-12 };
        assert!(
            error <= tolerance + rounding,
            "{error:e} of {tolerance:e} at {level:?}: {report}"
        );
        report
    }
}

#[test]
fn every_tolerance_is_kept_at_every_level() {
    for (num_chirps, num_samples, bandwidth) in [(33, 64, 1e9), (1, 16, -1e9), (16, 1, 1e9), (17, 100, 5e9)] {
        let wf = waveform(num_chirps, num_samples, bandwidth);
        let terms = (1..=3).map(|num_terms| Rows::random(1, 300, num_terms));
        for rows in terms.chain([Rows::swinging(&wf, 150, (0.1, 4.8, 7), 0.0)]) {
            for tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-11] {
                for level in Level::available() {
                    rows.check(&wf, Method::Grid, tolerance, level);
                }
            }
        }
    }
}

#[test]
fn strong_paths_among_weak_ones_count_by_their_power() {
    let wf = waveform(32, 32, 1e9);
    for (strong, tolerance) in [(1e3, 8e-6), (1e3, 1e-3), (1e45, 1e-3), (30.0, 1e-5)] {
        for num_terms in [2, 3] {
            for at in [1, 2000, 3999] {
                let mut rows = Rows::random(1, 4000, num_terms);
                for (path, amplitude) in rows.amplitude[0].iter_mut().enumerate() {
                    *amplitude *= if path == at { 1.0 } else { 1.0 / strong };
                }
                if num_terms == 3 {
                    rows.delay[2][at] = 2.0 / C * 60.0;
                }
                rows.check(&wf, Method::Grid, tolerance, Level::best());
            }
        }
    }
}

#[test]
fn paths_in_phase_are_as_exact_and_take_two_runs_at_most() {
    let wf = waveform(24, 48, 1e9);
    for num_terms in [1, 2, 3] {
        let mut rows = Rows::random(1, 2000, num_terms);
        for row in &mut rows.delay {
            let first = row[0];
            row.fill(first);
        }
        rows.amplitude[0].fill(Complex64::ONE);
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-6, 1e-9] {
            let report = rows.check(&wf, Method::Grid, tolerance, Level::best());
            assert!((report.gain / 2000_f64.sqrt() - 1.0).abs() < 0.02, "{}", report.gain);
            assert!(report.num_runs <= 2, "{tolerance:e} with {num_terms} terms: {report}");
        }
    }
}

#[test]
fn channels_and_threads_change_nothing() {
    let wf = waveform(40, 50, 1e9);
    for rows in [
        Rows::random(5, 1000, 2),
        Rows::random(1, 70_000, 2),
        Rows::random(5, 5000, 3),
        Rows::swinging(&wf, 700, (0.1, 4.8, 6), 0.0),
    ] {
        let exact = rows.exact(&wf, 0);
        for tolerance in [1e-3, 1e-5, 1e-9] {
            let sum = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let options = Options {
                    is_parallel: threads > 1,
                    ..options(tolerance)
                };
                let sum = |series: &PathSeries| beat_signal(&wf, series, Method::Grid, &options).unwrap().0;
                wide(pool.install(|| rows.series(sum)))
            };
            let one = sum(1);
            let [error, _] = rows.error(&one, &exact);
            assert!(error <= tolerance + 6e-8, "{error:e} of {tolerance:e}");
            assert!(one == sum(2) && one == sum(3));
        }
    }
}

#[test]
fn numbers_that_are_not_finite_are_told() {
    let wf = waveform(4, 16, 1e9);
    for num_terms in [2, 3] {
        for (bad, tolerance) in [
            (f64::NAN, 1e-3),
            (f64::INFINITY, 1e-3),
            (f64::NAN, 1e-8),
            (f64::INFINITY, 1e-8),
        ] {
            for row in 0..=num_terms {
                let mut rows = Rows::random(2, 300, num_terms);
                match rows.delay.get_mut(row) {
                    Some(row) => row[207] = bad,
                    None => rows.amplitude[0][17].re = bad,
                }
                let sum = rows.series(|series| beat_signal(&wf, series, Method::Grid, &options(tolerance)));
                let name = if row < num_terms { "delay" } else { "amplitude" };
                let message = sum.unwrap_err().to_string();
                assert!(message.contains(name), "{message}");
            }
        }
    }
}

#[test]
fn a_request_stops_sums() {
    let (wf, cancel) = (waveform(8, 16, 1e9), Cancel::default());
    cancel.ask();
    for (num_terms, method) in [(2, Method::Grid), (3, Method::Grid), (3, Method::Direct)] {
        let options = Options {
            cancel: Some(&cancel),
            ..options(1e-3)
        };
        let sum = Rows::random(1, 300, num_terms).series(|series| beat_signal(&wf, series, method, &options));
        assert!(matches!(sum, Err(Error::Interrupted)));
    }
}
