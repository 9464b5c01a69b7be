//! Direct sum over paths: the oracle that all other engines are measured against.
//!
//! In double precision from end to end. Every path and sample is evaluated on its own, so no error grows with the
//! number of samples: the error is the rounding of the phase, about `2 pi B tau` eps. The work is split by channel and
//! chirp; every chirp adds its paths in a fixed order, so the result does not depend on the number of threads. Static
//! paths are added once, for all chirps.

use num_complex::Complex64;

use crate::cancel::Cancel;
use crate::error::Result;
use crate::numeric::chebyshev::chebyshev_matrix;
use crate::numeric::parallel;
use crate::numeric::simd::Level;
use crate::numeric::trig::{cos_sin_turns, turns};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{CHUNK, Chunk};
use crate::synthesis::delay::{Basis, basis_values};
use crate::synthesis::report::{Options, Report, Samples, Sum};
use crate::synthesis::source::{PathGroup, Request, Shape};

/// Samples that are summed together: their phases stay in registers and L1.
const BLOCK: usize = 64;

/// Paths that are added between two looks for a request to stop.
const CHECKED: usize = 1024;

/// One number per sample of a block.
type PerSample = [f64; BLOCK];

/// Sum over the paths of all groups. The chirps of all channels count as steps of the work.
pub fn sum(waveform: &Waveform, groups: &[PathGroup], options: &Options) -> Result<Sum> {
    let num_channels = groups.first().map_or(0, |group| group.source.shape().channels);
    let (num_chirps, num_samples) = (waveform.chirp_times.len(), waveform.num_samples);
    let channels: Vec<usize> = (0..num_channels).collect();
    // By group, and by channel.
    let mut tones = Vec::new();
    for group in groups {
        let of_channel = |channel| Tones::new(waveform, group, channel, options.level);
        let own: Vec<Tones> = parallel::map(options.is_parallel, channels.clone(), of_channel);
        if !own.iter().all(Tones::are_finite) {
            return Err(group.source.not_finite());
        }
        tones.push(own);
    }
    let add = |channel: usize, chirp: usize, is_static: bool, samples: &mut [Complex64]| {
        for own in tones.iter().filter(|own| own[channel].shape.is_static() == is_static) {
            options.level.run_loops(
                #[inline(always)]
                || own[channel].add(waveform, chirp, options.cancel, samples),
            );
        }
    };
    let of_static = parallel::map(options.is_parallel, channels, |channel| {
        let mut samples = vec![Complex64::ZERO; num_samples];
        add(channel, 0, true, &mut samples);
        samples
    });
    let rows = (0..num_channels * num_chirps).collect();
    let rows = parallel::map(options.is_parallel, rows, |row| {
        let (channel, chirp) = (row / num_chirps, row % num_chirps);
        let mut samples = of_static[channel].clone();
        add(channel, chirp, false, &mut samples);
        options.cancel.inspect(|cancel| cancel.advance(1));
        samples
    });
    options.cancel.map_or(Ok(()), Cancel::check)?;
    let samples: Vec<Complex64> = rows.into_iter().flatten().collect();
    let all = || tones.iter().flatten();
    let power = |channel: usize| tones.iter().map(|own| own[channel].power).sum();
    Ok(Sum {
        samples: Samples::new(&samples, 1.0, options.tolerance),
        power: (0..num_channels).map(power).collect(),
        coherence: 1.0,
        report: Report {
            longest: all().map(|tones| tones.longest).fold(0.0, f64::max),
            memory: size_of::<f64>() * all().map(|tones| tones.numbers.len()).sum::<usize>(),
            ..Report::new("direct", groups)
        },
    })
}

/// Constants of the paths of a group in one channel.
struct Tones {
    shape: Shape,
    /// Per path: mean delay tau [s], phase f0 tau modulo one turn, the further terms of the delay [s], and real and
    /// imaginary parts of the terms of conj(amplitude).
    numbers: Vec<f64>,
    /// Factor of every sample; none for one.
    weights: Vec<f64>,
    /// Mean over the nodes of the squared l2 norm of the amplitudes [W].
    power: f64,
    /// Bound on the longest delay of a path with power [s].
    longest: f64,
}

impl Tones {
    fn new(waveform: &Waveform, group: &PathGroup, channel: usize, level: Level) -> Self {
        let shape = group.source.shape();
        let mut tones = Self {
            shape,
            numbers: Vec::new(),
            weights: waveform.over_frequency(group.frequency_exponent),
            power: 0.0,
            longest: 0.0,
        };
        let mut chunk = Chunk::<f64>::new(&shape, 1);
        for number in 0..shape.paths.div_ceil(CHUNK) {
            let request = Request::of_chunk(number, &shape, channel..channel + 1, 1.0, level);
            group.source.fill_double(&request, &mut chunk);
            for path in 0..chunk.num_paths {
                let [delay, re, im] = [&chunk.delay, &chunk.re, &chunk.im].map(|rows| terms(shape.basis, rows, path));
                let power = mean_square(&chunk.re, path) + mean_square(&chunk.im, path);
                tones.power += power;
                // All terms of the delay count: phases of rates that no time could show lose their digits as well.
                let term = |(k, term): (usize, &f64)| match shape.basis {
                    Basis::Taylor => term.abs() * waveform.duration().powf(k as f64),
                    Basis::Chebyshev => term.abs(),
                };
                if power > 0.0 {
                    tones.longest = tones.longest.max(delay.iter().enumerate().map(term).sum());
                }
                let constant = [delay[0], turns(waveform.start_frequency, delay[0])];
                tones.numbers.extend(constant.iter().chain(&delay[1..]));
                tones.numbers.extend(re.iter().zip(&im).flat_map(|(re, im)| [*re, -im]));
            }
        }
        tones
    }

    /// Add the paths to the samples of a chirp.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    fn add(&self, waveform: &Waveform, chirp: usize, cancel: Option<&Cancel>, samples: &mut [Complex64]) {
        let Shape {
            basis,
            delay_rows,
            amplitude_rows,
            ..
        } = self.shape;
        let num_terms = delay_rows.max(amplitude_rows);
        let stride = 1 + delay_rows + 2 * amplitude_rows;
        let (mut values, mut functions) = (vec![0.0; num_terms], vec![[0.0; BLOCK]; num_terms]);
        for (block, samples) in samples.chunks_mut(BLOCK).enumerate() {
            // Fast time of every sample [s], and the functions of the basis.
            let mut fast = [0.0; BLOCK];
            for i in 0..samples.len() {
                fast[i] = waveform.sample_time(block * BLOCK + i);
                basis_values(basis, waveform, waveform.chirp_times[chirp] + fast[i], &mut values);
                for k in 0..num_terms {
                    functions[k][i] = values[k];
                }
            }
            let mut sums = [[0.0; BLOCK]; 2];
            for some in self.numbers.chunks(CHECKED * stride) {
                if cancel.is_some_and(Cancel::is_asked) {
                    return;
                }
                for path in some.chunks_exact(stride) {
                    add_path(waveform, path, delay_rows, &functions, &fast, &mut sums);
                }
            }
            for i in 0..samples.len() {
                let weight = self.weights.get(block * BLOCK + i).copied().unwrap_or(1.0);
                samples[i] += weight * Complex64::new(sums[0][i], sums[1][i]);
            }
        }
    }

    fn are_finite(&self) -> bool {
        self.power.is_finite() && self.numbers.iter().all(|x| x.is_finite())
    }
}

/// Terms of the frame's basis from the rows of a path: as they are, or from values at the nodes.
fn terms(basis: Basis, rows: &[[f64; CHUNK]], path: usize) -> Vec<f64> {
    let row = |j: usize| rows[j][path];
    let number = rows.len();
    if basis == Basis::Taylor {
        return (0..number).map(row).collect();
    }
    let matrix = chebyshev_matrix(number);
    let term = |weights: &[f64]| (1..number).map(|j| weights[j] * row(j)).sum();
    let mut terms: Vec<f64> = matrix.chunks(number).map(term).collect();
    terms[0] += row(0);
    terms
}

/// Mean over the nodes of the square of a part of an amplitude.
fn mean_square(rows: &[[f64; CHUNK]], path: usize) -> f64 {
    let value = |j: usize| rows[0][path] + if j > 0 { rows[j][path] } else { 0.0 };
    (0..rows.len()).map(|j| value(j).powi(2)).sum::<f64>() / rows.len() as f64
}

/// Add a path to a block of samples.
#[cfg_attr(optimised, inline(always))]
fn add_path(
    waveform: &Waveform,
    path: &[f64],
    delay_rows: usize,
    functions: &[PerSample],
    fast: &PerSample,
    sums: &mut [PerSample; 2],
) {
    let (f0, slope) = (waveform.start_frequency, waveform.slope);
    let (delays, amplitudes) = path[2..].split_at(delay_rows - 1);
    // Delay of every sample, as the departure from its mean.
    let mut delta = [0.0; BLOCK];
    for k in 0..delays.len() {
        for i in 0..BLOCK {
            delta[i] += delays[k] * functions[k + 1][i];
        }
    }
    // Phase f0 tau + S tau (t - tau / 2) in turns, eq. (1).
    let mut phase = [0.0; BLOCK];
    for i in 0..BLOCK {
        let tau = path[0] + delta[i];
        phase[i] = path[1] + f0 * delta[i] + slope * tau * (fast[i] - 0.5 * tau);
    }
    let (cos, sin) = cos_sin_turns::<f64, BLOCK>(&phase);
    // Amplitude of every sample.
    let (mut re, mut im) = ([amplitudes[0]; BLOCK], [amplitudes[1]; BLOCK]);
    for k in 1..amplitudes.len() / 2 {
        for i in 0..BLOCK {
            re[i] += amplitudes[2 * k] * functions[k][i];
            im[i] += amplitudes[2 * k + 1] * functions[k][i];
        }
    }
    for i in 0..BLOCK {
        sums[0][i] += re[i] * cos[i] - im[i] * sin[i];
        sums[1][i] += re[i] * sin[i] + im[i] * cos[i];
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::synthesis::tests::{Rows, options, wide};

    fn samples(waveform: &Waveform, rows: &Rows, level: Level) -> Vec<Complex64> {
        let options = Options {
            level,
            ..options(1e-12)
        };
        rows.groups(0, |groups| wide(sum(waveform, groups, &options).unwrap().samples))
    }

    #[test]
    fn every_level_gives_the_same_bits() {
        let wf = waveform(100);
        let row = |start: f64, step: f64| (0..10).map(|p| start + step * f64::from(p)).collect();
        let rows = Rows {
            basis: Basis::Taylor,
            num_channels: 1,
            delay: vec![row(3e-9, 1e-9), row(1e-8, 1e-9), row(2e-8, -1e-9)],
            amplitude: vec![vec![Complex64::new(1.0, 0.5); 10]],
        };
        let results = Level::available().into_iter().map(|level| samples(&wf, &rows, level));
        assert!(results.collect::<Vec<_>>().windows(2).all(|two| two[0] == two[1]));
    }

    #[test]
    fn what_stands_still_is_the_same_in_every_chirp_beside_what_moves() {
        let wf = waveform(70);
        // Nodes (4) of two paths: the first stands still.
        let delay = [
            [10e-9, 20e-9],
            [10e-9, 20.001e-9],
            [10e-9, 20.002e-9],
            [10e-9, 20.004e-9],
        ];
        let amplitude = [Complex64::new(1.0, 0.5), Complex64::new(0.3, 0.0)];
        let of = |paths: std::ops::Range<usize>| {
            let rows = Rows {
                basis: Basis::Chebyshev,
                num_channels: 1,
                delay: delay.iter().map(|row| row[paths.clone()].to_vec()).collect(),
                amplitude: vec![amplitude[paths.clone()].to_vec()],
            };
            samples(&wf, &rows, Level::best())
        };
        let (both, still, moving) = (of(0..2), of(0..1), of(1..2));
        assert_eq!(still[..70], still[70..140]);
        assert_ne!(moving[..70], moving[70..140]);
        for i in 0..210 {
            assert!((both[i] - still[i] - moving[i]).norm() < 1e-15);
        }
    }

    #[test]
    fn one_path_is_one_tone_to_1e12_over_4096_samples() {
        let wf = waveform(4096);
        let tau = 41.3e-9; // 6.2 m
        let rows = Rows {
            basis: Basis::Taylor,
            num_channels: 1,
            delay: vec![vec![tau]],
            amplitude: vec![vec![Complex64::new(2.0, 0.0)]],
        };
        let got = samples(&wf, &rows, Level::best());
        // The tone by exact steps: its phase is linear in the sample, so double-double is not needed per sample.
        let start = turns(wf.start_frequency, tau) - 0.5 * wf.slope * tau * tau + wf.slope * tau * wf.adc_delay;
        let step = wf.slope * tau / wf.sample_rate;
        for (m, sample) in got[..4096].iter().enumerate() {
            let expected = Complex64::cis(TAU * (start + (step * m as f64).fract()).fract()) * 2.0;
            assert!((sample - expected).norm() < 2e-12, "sample {m}: {sample} {expected}");
        }
    }

    fn waveform(num_samples: usize) -> Waveform {
        Waveform {
            start_frequency: 60e9,
            slope: 1e9 / (num_samples as f64 / 2e6),
            sample_rate: 2e6,
            adc_delay: 3.1e-6,
            num_samples,
            chirp_times: vec![0.0, 4e-3, 9e-3],
        }
    }
}
