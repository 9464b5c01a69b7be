//! The sum over paths: paths x chirps x samples per second.
//!
//! `constant`: one delay and one amplitude per path, a scene at rest. `nodal`: both at 8 Chebyshev times, a scene
//! that moves.

mod common;

use criterion::{BenchmarkId, Criterion, Throughput};
use num_complex::Complex64;
use radarcore::chirp::Waveform;
use radarcore::delay::{Basis, PathSeries};
use radarcore::direct;
use radarcore::simd::Level;

const NUM_SAMPLES: usize = 128;
const NUM_NODES: usize = 8;

/// Delays and amplitudes of paths between 0.5 and 8 m, `(node, path)`.
struct Paths {
    delay: Vec<f64>,
    amplitude: Vec<Complex64>,
    num_nodes: usize,
}

impl Paths {
    fn new(num_paths: usize, num_nodes: usize) -> Self {
        let (mut delay, mut amplitude) = (Vec::new(), Vec::new());
        for node in 0..num_nodes {
            // Half the paths recede and half approach by up to 5 cm; not linearly, so that no term is zero.
            let moved = 0.05 * (node as f64 / num_nodes as f64).powf(1.3);
            for path in 0..num_paths {
                let place = (0.618_034 * path as f64).fract();
                let range = 0.5 + 7.5 * place + if path % 2 == 0 { moved } else { -moved };
                delay.push(2.0 * range / 299_792_458.0);
                amplitude.push(Complex64::from_polar(1e-4 / (range * range), 50.0 * place));
            }
        }
        Self {
            delay,
            amplitude,
            num_nodes,
        }
    }

    fn series(&self) -> PathSeries<'_> {
        PathSeries {
            basis: Basis::Chebyshev,
            delay: &self.delay,
            num_delay_terms: self.num_nodes,
            amplitude: &self.amplitude,
            num_amplitude_terms: self.num_nodes,
            num_channels: 1,
            num_paths: self.delay.len() / self.num_nodes,
        }
    }
}

fn waveform(num_chirps: usize) -> Waveform {
    Waveform {
        start_frequency: 60e9,
        slope: 1.5e9 / 64e-6,
        sample_rate: 2e6,
        adc_delay: 3.1e-6,
        num_samples: NUM_SAMPLES,
        chirp_times: (0..num_chirps).map(|chirp| 300e-6 * chirp as f64).collect(),
    }
}

/// How the number of paths and chirps, the motion, the instruction set and the number of threads change the rate.
fn direct_sum(criterion: &mut Criterion) {
    let motions = [("constant", 1), ("nodal", NUM_NODES)];
    let mut group = criterion.benchmark_group("beat/direct");
    let mut measure = |level: Level, threads: usize, (motion, num_nodes), num_paths, num_chirps: usize| {
        let (paths, waveform) = (Paths::new(num_paths, num_nodes), waveform(num_chirps));
        let pool = common::pool(threads);
        // `Level(Avx2)` to `avx2`
        let set = format!("{level:?}")
            .to_lowercase()
            .replace("level(", "")
            .replace(')', "");
        let name = format!("{motion}/{num_chirps}_chirps/{set}/{}", common::threads_id(threads));
        group.throughput(Throughput::Elements((num_paths * num_chirps * NUM_SAMPLES) as u64));
        group.bench_function(BenchmarkId::new(name, format!("{num_paths}_paths")), |bencher| {
            bencher.iter(|| pool.install(|| direct::beat_signal(&waveform, &paths.series(), level)));
        });
    };

    for motion in motions {
        // The best level, by size and threads.
        for num_chirps in common::sizes([1, 64], 2) {
            for num_paths in common::sizes([100, 1000, 10_000], 10) {
                for threads in [1, 2] {
                    measure(Level::best(), threads, motion, num_paths, num_chirps);
                }
            }
        }
        // The other levels, at one size.
        for level in Level::available().into_iter().filter(|level| *level != Level::best()) {
            measure(
                level,
                1,
                motion,
                common::sizes([1000], 10)[0],
                common::sizes([64], 2)[0],
            );
        }
    }
    group.finish();
}

fn main() {
    let mut criterion = common::criterion();
    direct_sum(&mut criterion);
    criterion.final_summary();
}
