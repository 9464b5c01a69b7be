use std::f64::consts::TAU;

use num_complex::Complex64;

use super::*;
use crate::constants::SPEED_OF_LIGHT as C;
use crate::error::Error;
use crate::numeric::chebyshev::chebyshev_nodes;
use crate::numeric::random::mix;
use crate::numeric::simd::Level;
use crate::synthesis::arrays::ArrayPaths;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::direct;
use crate::synthesis::report::Known;

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
#[derive(Clone)]
struct Paths {
    basis: Basis,
    num_channels: usize,
    delay: Vec<Vec<f64>>,
    amplitude: Vec<Vec<Complex64>>,
}

impl Paths {
    /// Ranges, velocities and accelerations of one channel, and amplitudes.
    fn taylor(rows: &[Vec<f64>], amplitude: Vec<Complex64>) -> Self {
        Self {
            basis: Basis::Taylor,
            num_channels: 1,
            delay: rows
                .iter()
                .map(|row| row.iter().map(|x| 2.0 / C * x).collect())
                .collect(),
            amplitude: vec![amplitude],
        }
    }

    /// Accelerated motion at up to 3 m/s, 0.5 to 8 m away, in two channels; every fifth path stands still.
    fn accelerating(number: usize) -> Self {
        let mut unit = units(7);
        let mut row = |low: f64, high: f64, rests: bool| -> Vec<f64> {
            let moves = |i: usize| if rests && i.is_multiple_of(5) { 0.0 } else { 1.0 };
            (0..2 * number)
                .map(|i| moves(i % number) * (low + (high - low) * unit()))
                .collect()
        };
        let rows = [row(0.5, 8.0, false), row(-3.0, 3.0, true), row(-50.0, 50.0, true)];
        let amplitude = (0..2 * number).map(|_| Complex64::from_polar(1e-5 * (0.5 + unit()), TAU * unit()));
        Self {
            num_channels: 2,
            ..Self::taylor(&rows, amplitude.collect())
        }
    }

    /// Limbs that swing by some length at some rate, seen at some times; amplitudes follow the distance, and turn their
    /// argument by `turn` [rad].
    fn swinging(waveform: &Waveform, number: usize, (length, rate, times): (f64, f64, usize), turn: f64) -> Self {
        let mut unit = units(5);
        let limbs: Vec<[f64; 4]> = (0..2 * number)
            .map(|_| [1.0 + 4.0 * unit(), length * unit(), unit(), unit()])
            .collect();
        let mut paths = Self {
            basis: Basis::Chebyshev,
            num_channels: 2,
            delay: Vec::new(),
            amplitude: Vec::new(),
        };
        for x in chebyshev_nodes(times) {
            let time = 0.5 * waveform.duration() * (1.0 + x);
            let range = |limb: &[f64; 4]| limb[0] + limb[1] * (TAU * (rate * time + limb[2])).sin();
            paths
                .delay
                .push(limbs.iter().map(|limb| 2.0 / C * range(limb)).collect());
            let amplitude =
                |limb: &[f64; 4]| Complex64::from_polar(1e-3 / range(limb).powi(2), TAU * limb[3] + turn * x);
            paths.amplitude.push(limbs.iter().map(amplitude).collect());
        }
        paths
    }

    /// Echoes of a plate of some depth [m], whose parts move at up to `speed`, that are in phase at a sample and a chirp.
    fn plate(waveform: &Waveform, depth: f64, speed: f64, (sample, chirp): (f64, f64)) -> Self {
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
        Self::taylor(&[range, velocity], amplitude)
    }

    fn series<T>(&self, run: impl FnOnce(&PathSeries) -> T) -> T {
        let delay: Vec<&[f64]> = self.delay.iter().map(Vec::as_slice).collect();
        let amplitude: Vec<&[Complex64]> = self.amplitude.iter().map(Vec::as_slice).collect();
        run(&PathSeries {
            basis: self.basis,
            delay: &delay,
            amplitude: &amplitude,
            num_channels: self.num_channels,
            num_paths: self.delay[0].len() / self.num_channels,
        })
    }

    /// Run something with the paths as groups: static ones apart, all with powers of the frequency from some on.
    fn groups<T>(&self, exponent: u8, run: impl FnOnce(&[PathGroup]) -> T) -> T {
        self.series(|series| {
            let sources = ArrayPaths::split(series);
            let group = |(number, source)| PathGroup {
                source,
                frequency_exponent: exponent + number as u8 * exponent.min(1),
            };
            let groups: Vec<PathGroup> = sources
                .iter()
                .enumerate()
                .map(|(n, source)| group((n, source as _)))
                .collect();
            run(&groups)
        })
    }

    fn sum(&self, waveform: &Waveform, options: &Options) -> Result<Sum> {
        self.groups(0, |groups| prepare(waveform, groups, options)?.run())
    }

    fn exact(&self, waveform: &Waveform, exponent: u8) -> Vec<Complex64> {
        let sum = self.groups(exponent, |groups| direct::sum(waveform, groups, &options(1e-12)));
        wide(sum.unwrap().samples)
    }

    /// Largest error of the channels, and largest rms of their samples over the expected one, relative to l2(amplitudes).
    fn error(&self, waveform: &Waveform, got: &[Complex64], exact: &[Complex64]) -> [f64; 2] {
        let (size, mut largest) = (got.len() / self.num_channels, [0.0_f64; 2]);
        for (channel, (got, exact)) in got.chunks(size).zip(exact.chunks(size)).enumerate() {
            let number = self.delay[0].len() / self.num_channels;
            let own = self
                .amplitude
                .iter()
                .flat_map(|row| &row[channel * number..(channel + 1) * number]);
            let power = own.map(Complex64::norm_sqr).sum::<f64>() / self.amplitude.len() as f64;
            let errors: f64 = got.iter().zip(exact).map(|(a, b)| (a - b).norm_sqr()).sum();
            let energy: f64 = exact.iter().map(Complex64::norm_sqr).sum();
            let relative = |square: f64| (square / size as f64 / power).sqrt();
            largest[0] = largest[0].max(relative(errors));
            largest[1] = largest[1].max(relative(energy) / waveform.fluctuation());
        }
        largest
    }

    /// Check that a sum keeps its predicted error, and the tolerance in one more run at most. Returns its report.
    fn check(&self, waveform: &Waveform, exact: &[Complex64], tolerance: f64, level: Level) -> Report {
        let mut options = Options {
            level,
            ..options(tolerance)
        };
        for run in 0..2 {
            let sum = self.sum(waveform, &options).unwrap();
            let [error, gain] = self.error(waveform, &wide(sum.samples), exact);
            let (report, gain) = (sum.report, gain.max(1.0));
            let bound = report.error.with_gain(gain);
            // Both sums round delays of some thousand turns.
            assert!(
                error <= bound.hypot(2e-12 * gain),
                "{tolerance:e} {run} {level:?}: {error:e} {report:?}"
            );
            if bound <= tolerance {
                return report;
            }
            options.known = Known {
                gain: 1.01 * gain,
                coherence: sum.coherence,
                needs_double: false,
            };
        }
        panic!("{tolerance:e} {level:?}: out of reach");
    }
}

fn wide(samples: Samples) -> Vec<Complex64> {
    match samples {
        Samples::Single(samples) => samples
            .iter()
            .map(|z| Complex64::new(z.re.into(), z.im.into()))
            .collect(),
        Samples::Double(samples) => samples,
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
            Paths::accelerating(200),
            Paths::swinging(&waveform, 200, swing, 0.0),
            Paths::swinging(&waveform, 200, swing, 0.005 * num_chirps as f64),
            Paths::accelerating(1),
        ] {
            let exact = paths.exact(&waveform, 0);
            for level in Level::available() {
                for tolerance in [1e-2, 1e-3, 1e-4, 1e-5, 1e-7, 1e-9] {
                    paths.check(&waveform, &exact, tolerance, level);
                }
            }
        }
    }
}

#[test]
fn precision_width_and_grids_follow_the_tolerance() {
    let waveform = waveform(64, 128, 1e9);
    let paths = Paths::swinging(&waveform, 300, (0.4, 1.5, 12), 0.0);
    let exact = paths.exact(&waveform, 0);
    for (tolerance, expected) in [
        (1e-2, (true, 4, 1)),
        (1e-3, (true, 4, 1)),
        (1e-5, (true, 6, 3)),
        (1e-6, (false, 8, 3)),
        (1e-10, (false, 12, 6)),
    ] {
        let report = paths.check(&waveform, &exact, tolerance, Level::best());
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
                let paths = Paths::plate(&waveform, depth, speed, (sample, chirp));
                let exact = paths.exact(&waveform, 0);
                for tolerance in [1e-2, 1e-3, 1e-4] {
                    paths.check(&waveform, &exact, tolerance, Level::best());
                }
            }
        }
    }
}

#[test]
fn equal_paths_and_a_strong_one_among_weak_ones_keep_the_tolerance() {
    let waveform = waveform(32, 64, 1e9);
    let equal = |number: usize| {
        let rows = [vec![3.01; number], vec![1.2; number]];
        Paths::taylor(&rows, vec![Complex64::ONE; number])
    };
    let (mut unit, number) = (units(11), 1000);
    let mut strong = Paths::taylor(
        &[
            (0..number).map(|_| 0.5 + 8.0 * unit()).collect(),
            (0..number)
                .map(|i| if i == 500 { -28.0 } else { 2.0 * unit() - 1.0 })
                .collect(),
            (0..number).map(|i| if i == 500 { 5.0 } else { 0.0 }).collect(),
        ],
        (0..number).map(|_| Complex64::cis(TAU * unit())).collect(),
    );
    strong.amplitude[0][500] *= 5e3;
    for paths in [equal(2), equal(5), equal(50), strong] {
        let exact = paths.exact(&waveform, 0);
        for tolerance in [1e-2, 1e-3, 1e-5, 1e-7] {
            paths.check(&waveform, &exact, tolerance, Level::best());
        }
    }
}

#[test]
fn fast_motion_gets_blocks_of_chirps() {
    let waveform = waveform(64, 64, 1e9);
    let paths = Paths::swinging(&waveform, 50, (1e-3, 150.0, 48), 0.0);
    let exact = paths.exact(&waveform, 0);
    for tolerance in [1e-1, 1e-2, 1e-3, 1e-4] {
        let report = paths.check(&waveform, &exact, tolerance, Level::best());
        assert!(report.num_blocks > 1 || !report.is_single, "{tolerance:e}: {report:?}");
    }
    let slow = Paths::swinging(&waveform, 50, (0.4, 1.5, 8), 0.0);
    let report = slow.check(&waveform, &slow.exact(&waveform, 0), 1e-3, Level::best());
    assert_eq!(report.num_blocks, 1);
}

#[test]
fn groups_have_their_power_of_the_frequency() {
    let (waveform, paths) = (waveform(20, 64, 4e9), Paths::accelerating(100));
    for exponent in [1, 2] {
        let exact = paths.exact(&waveform, exponent);
        let sum = paths.groups(exponent, |groups| {
            prepare(&waveform, groups, &options(1e-3)).unwrap().run()
        });
        let [error, _] = paths.error(&waveform, &wide(sum.unwrap().samples), &exact);
        assert!(error < 1e-3, "{exponent}: {error:e}");
        let [error, _] = paths.error(&waveform, &paths.exact(&waveform, 0), &exact);
        assert!(error > 1e-2, "{exponent}: {error:e}");
    }
}

#[test]
fn number_of_threads_changes_no_bit() {
    let (waveform, paths) = (waveform(40, 64, 1e9), Paths::accelerating(5000));
    for tolerance in [1e-3, 1e-8] {
        let sum = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let options = Options {
                is_parallel: threads > 1,
                ..options(tolerance)
            };
            pool.install(|| wide(paths.sum(&waveform, &options).unwrap().samples))
        };
        let one = sum(1);
        assert!(one == sum(2) && one == sum(3));
    }
}

#[test]
fn power_and_counts_are_those_of_the_paths() {
    let (waveform, paths) = (waveform(8, 32, 1e9), Paths::accelerating(100));
    let sum = paths.sum(&waveform, &options(1e-3)).unwrap();
    assert_eq!((sum.report.num_paths, sum.report.num_static), (200, 40));
    let power: f64 = paths.amplitude[0][100..].iter().map(Complex64::norm_sqr).sum();
    assert!((sum.power[1] / power - 1.0).abs() < 1e-6);
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    for bad in [f64::NAN, f64::INFINITY] {
        for tolerance in [1e-3, 1e-8] {
            for row in 0..4 {
                let mut paths = Paths::accelerating(40);
                match row {
                    3 => paths.amplitude[0][17].re = bad,
                    row => paths.delay[row][17] = bad,
                }
                let result = paths.sum(&waveform(4, 16, 1e9), &options(tolerance));
                assert!(matches!(result, Err(Error::Value(_))), "{bad} {tolerance:e} {row}");
            }
        }
    }
}

#[test]
fn a_request_stops_the_sum() {
    let cancel = Cancel::default();
    cancel.ask();
    let options = Options {
        cancel: Some(&cancel),
        ..options(1e-3)
    };
    let result = Paths::accelerating(10).sum(&waveform(4, 16, 1e9), &options);
    assert!(matches!(result, Err(Error::Interrupted)));
}
