//! Sum over paths: the chirp-wise NUFFT, the range-Doppler NUFFT and the direct sum.
//!
//! Paths lie between 0.5 and 8 m at up to 3 m/s, in random order or in the order of an image. Names of benches are
//! `beat/<what varies>/<method>/<value>`; everything else is 65 536 paths, 64 chirps of 128 samples over 1 GHz, one
//! thread and the best instruction set.

mod common;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Throughput};
use num_complex::Complex64;
use radarcore::stages::{Basis, Known, Level, Options, PathSeries, beat_signal};
use radarcore::{Method, Waveform};

const C: f64 = 299_792_458.0;

/// Case of a bench: waveform, paths and method.
#[derive(Clone, Copy)]
struct Case {
    num_paths: usize,
    num_chirps: usize,
    num_samples: usize,
    /// Swept bandwidth [GHz].
    bandwidth: usize,
    is_image: bool,
    method: Method,
    tolerance: f64,
    level: Level,
    threads: usize,
}

impl Case {
    fn new(method: Method, tolerance: f64) -> Self {
        let [num_paths, num_chirps, num_samples] = if common::is_once_through() {
            [300, 4, 16]
        } else {
            [65_536, 64, 128]
        };
        Self {
            num_paths,
            num_chirps,
            num_samples,
            bandwidth: 1,
            is_image: false,
            method,
            tolerance,
            level: Level::best(),
            threads: 1,
        }
    }

    fn run(&self, group: &mut BenchmarkGroup<WallTime>, id: BenchmarkId) {
        let waveform = Waveform {
            start_frequency: 58e9,
            slope: 1e9 * self.bandwidth as f64 * 2e6 / self.num_samples as f64,
            sample_rate: 2e6,
            adc_delay: 3.1e-6,
            num_samples: self.num_samples,
            chirp_times: (0..self.num_chirps).map(|chirp| 400e-6 * chirp as f64).collect(),
        };
        // Neighbours in an image differ little; the golden ratio scatters them.
        let place = |path: usize| {
            let steps = if self.is_image {
                path as f64 / self.num_paths as f64
            } else {
                0.618_034 * path as f64
            };
            steps.fract()
        };
        let delay: Vec<f64> = (0..self.num_paths).map(|p| 2.0 / C * (0.5 + 7.5 * place(p))).collect();
        let rate: Vec<f64> = (0..self.num_paths)
            .map(|p| 2.0 / C * 3.0 * (2.0 * (7.3 * place(p)).fract() - 1.0))
            .collect();
        let amplitude: Vec<Complex64> = (0..self.num_paths)
            .map(|p| Complex64::from_polar(1.0, 5e4 * (0.754_877 * p as f64).fract()))
            .collect();
        let rows = [&delay[..], &rate];
        let series = PathSeries {
            basis: Basis::Taylor,
            delay: &rows,
            amplitude: &[&amplitude],
            num_channels: 1,
            num_paths: self.num_paths,
        };
        let options = Options {
            tolerance: self.tolerance,
            level: self.level,
            is_parallel: self.threads > 1,
            cancel: None,
            known: Known::NOTHING,
        };
        let pool = common::pool(self.threads);
        group.throughput(Throughput::Elements(self.num_paths as u64));
        group.bench_function(id, |bencher| {
            bencher.iter(|| pool.install(|| beat_signal(&waveform, &series, self.method, &options).unwrap()));
        });
    }
}

/// Methods that every group compares: the NUFFT at two tolerances, and the direct sum.
fn methods() -> [(&'static str, Case); 3] {
    [
        ("grid_1e-5", Case::new(Method::Grid, 1e-5)),
        ("grid_1e-10", Case::new(Method::Grid, 1e-10)),
        ("direct", Case::new(Method::Direct, 1e-10)),
    ]
}

fn main() {
    let mut criterion = common::criterion();

    // Every width of the kernel, in both orders.
    let mut group = criterion.benchmark_group("beat/tolerance");
    for digits in common::sizes([2, 3, 4, 5, 6, 7, 8, 10, 12], 4) {
        for (order, is_image) in [("random", false), ("image", true)] {
            let case = Case {
                is_image,
                ..Case::new(Method::Grid, 0.1_f64.powf(digits as f64))
            };
            case.run(&mut group, BenchmarkId::new(order, format!("1e-{digits}")));
        }
    }
    group.finish();

    let mut vary = |what: &str, values: Vec<usize>, change: &dyn Fn(&mut Case, usize)| {
        let mut group = criterion.benchmark_group(format!("beat/{what}"));
        for value in values {
            for (name, mut case) in methods() {
                change(&mut case, value);
                // Direct sums of more than a second add no information.
                if case.num_paths * case.num_chirps * case.num_samples < 1 << 27 || name.starts_with("grid") {
                    case.run(&mut group, BenchmarkId::new(name, value));
                }
            }
        }
        group.finish();
    };
    vary(
        "paths",
        common::sizes([10, 100, 1000, 10_000, 100_000, 1_000_000], 10),
        &|case, n| case.num_paths = n,
    );
    vary("chirps", common::sizes([1, 16, 64, 128, 256, 1024], 2), &|case, n| {
        case.num_chirps = n;
    });
    vary("samples", common::sizes([64, 128, 256, 1024], 8), &|case, n| {
        case.num_samples = n;
    });
    vary("bandwidth", common::sizes([1, 5], 5), &|case, n| case.bandwidth = n);
    vary("threads", common::sizes([1, 2], 2), &|case, n| case.threads = n);
    vary(
        "paths_2_threads",
        common::sizes([10, 1000, 10_000, 100_000, 1_000_000], 10),
        &|case, n| (case.num_paths, case.threads) = (n, 2),
    );
    let levels = Level::available();
    vary("level", (0..levels.len()).collect(), &|case, n| case.level = levels[n]);

    // Frames of three channels by every engine, for the constants of the rule that chooses.
    let mut group = criterion.benchmark_group("beat/take_over");
    let engines = [
        ("chirp", Method::Grid, true),
        ("doppler", Method::Grid, false),
        ("direct", Method::Direct, true),
    ];
    for num_chirps in common::sizes([1, 16, 64, 256, 512], 2) {
        for num_points in common::sizes([1, 30, 1000, 4_000, 10_000, 33_000], 10) {
            for (name, method, is_bending) in engines {
                for tolerance in [1e-3, 1e-7] {
                    let frame = Frame {
                        num_points,
                        num_chirps,
                        is_bending,
                        method,
                        tolerance,
                    };
                    if method != Method::Direct || num_points * num_chirps < 20_000 {
                        let value = format!("{num_points}_points_{num_chirps}_chirps_{tolerance:e}");
                        frame.run(&mut group, BenchmarkId::new(name, value));
                    }
                }
            }
        }
    }
    group.finish();
    criterion.final_summary();
}

/// Frame of three channels: points half a metre to five metres away that swing, with delays at eight times and amplitudes
/// at four, which the chirp-wise NUFFT sums; or their motion at constant rates, which the range-Doppler NUFFT sums where
/// it is the faster one.
#[derive(Clone, Copy)]
struct Frame {
    num_points: usize,
    num_chirps: usize,
    is_bending: bool,
    method: Method,
    tolerance: f64,
}

impl Frame {
    fn run(&self, group: &mut BenchmarkGroup<WallTime>, id: BenchmarkId) {
        const NUM_CHANNELS: usize = 3;
        let num_samples = Case::new(Method::Grid, self.tolerance).num_samples;
        let waveform = Waveform {
            start_frequency: 60e9,
            slope: 1e9 * 2e6 / num_samples as f64,
            sample_rate: 2e6,
            adc_delay: 3.1e-6,
            num_samples,
            chirp_times: (0..self.num_chirps).map(|chirp| 300e-6 * chirp as f64).collect(),
        };
        let number = NUM_CHANNELS * self.num_points;
        let place = |path: usize, step: f64| (step * path as f64).fract();
        let duration = waveform.duration();
        let distance = |path: usize, time: f64| {
            let swing = std::f64::consts::TAU * (2.0 * time + place(path, 0.754_877));
            0.5 + 4.5 * place(path, 0.618_034) + 0.1 * place(path, 0.569_84) * swing.sin()
        };
        let times = |count: usize| {
            let angle = move |node: usize| std::f64::consts::PI * (2 * node + 1) as f64 / (2 * count) as f64;
            (0..count).map(move |node| 0.5 * duration * (1.0 - angle(node).cos()))
        };
        // Two Chebyshev nodes are a constant rate.
        let (num_delays, num_amplitudes) = if self.is_bending { (8, 4) } else { (2, 1) };
        let delays: Vec<Vec<f64>> = times(num_delays)
            .map(|time| (0..number).map(|path| 2.0 / C * distance(path, time)).collect())
            .collect();
        let amplitude =
            |path: usize, time: f64| Complex64::from_polar(distance(path, time).powi(-2), 5e4 * place(path, 0.37));
        let amplitudes: Vec<Vec<Complex64>> = times(num_amplitudes)
            .map(|time| (0..number).map(|path| amplitude(path, time)).collect())
            .collect();
        let delay: Vec<&[f64]> = delays.iter().map(Vec::as_slice).collect();
        let amplitude: Vec<&[Complex64]> = amplitudes.iter().map(Vec::as_slice).collect();
        let series = PathSeries {
            basis: Basis::Chebyshev,
            delay: &delay,
            amplitude: &amplitude,
            num_channels: NUM_CHANNELS,
            num_paths: self.num_points,
        };
        let options = Options {
            tolerance: self.tolerance,
            level: Level::best(),
            is_parallel: false,
            cancel: None,
            known: Known::NOTHING,
        };
        group.throughput(Throughput::Elements(number as u64));
        group.bench_function(id, |bencher| {
            bencher.iter(|| beat_signal(&waveform, &series, self.method, &options).unwrap());
        });
    }
}
