//! Direct sum over paths: the oracle that all other engines are measured against.
//!
//! In double precision from end to end. Every path and sample is evaluated on its own, so no error grows with the
//! number of samples: the error is the rounding of the phase, about `2 pi B tau` eps. The work is split by channel and
//! chirp; every chirp adds its paths in a fixed order, so the result does not depend on the number of threads. Static
//! paths are added once, for all chirps.

use num_complex::{Complex32, Complex64};

use crate::cancel::Cancel;
use crate::error::Result;
use crate::numeric::chebyshev::chebyshev_matrix;
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Level};
use crate::numeric::trig::{cos_sin_turns, turns};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{CHUNK, Chunk};
use crate::synthesis::delay::{Basis, basis_values};
use crate::synthesis::report::{Options, Report, SINGLE_TOLERANCE, Samples, Sum};
use crate::synthesis::source::{PathGroup, Request, Shape};

/// Samples that are summed together: their phases stay in registers and L1.
const BLOCK: usize = 64;

/// Paths that are added between two looks for a request to stop.
const CHECKED: usize = 1024;

type Lanes = [f64; BLOCK];

/// Sum over the paths of all groups. The chirps of all channels count as steps of the work.
pub fn sum(waveform: &Waveform, groups: &[PathGroup], options: &Options) -> Result<Sum> {
    let num_channels = groups.first().map_or(0, |group| group.source.shape().channels);
    let (num_chirps, num_samples) = (waveform.chirp_times.len(), waveform.num_samples);
    let tones: Vec<Vec<Tones>> = parallel::map(options.is_parallel, (0..num_channels).collect(), |channel| {
        let of_group = |group: &PathGroup| Tones::new(waveform, group, channel, options.level);
        groups.iter().map(of_group).collect()
    });
    let power: Vec<f64> = tones
        .iter()
        .map(|tones| tones.iter().map(|tones| tones.power).sum())
        .collect();
    if let Some(bad) = tones
        .iter()
        .position(|tones| !tones.iter().all(|tones| tones.is_finite))
    {
        let group = tones[bad].iter().position(|tones| !tones.is_finite).unwrap_or(0);
        return Err(groups[group].source.not_finite());
    }
    let add = |channel: usize, chirp: usize, is_static: bool| {
        let mut samples = vec![Complex64::ZERO; num_samples];
        for tones in tones[channel].iter().filter(|tones| tones.is_static == is_static) {
            options.level.run(AddTones {
                waveform,
                tones,
                chirp,
                cancel: options.cancel,
                samples: &mut samples,
            });
        }
        samples
    };
    let all = (0..num_channels).collect();
    let of_static: Vec<_> = parallel::map(options.is_parallel, all, |channel| add(channel, 0, true));
    let rows = (0..num_channels * num_chirps).collect();
    let rows: Vec<Vec<Complex64>> = parallel::map(options.is_parallel, rows, |row| {
        let mut samples = add(row / num_chirps, row % num_chirps, false);
        for (sample, more) in samples.iter_mut().zip(&of_static[row / num_chirps]) {
            *sample += more;
        }
        options.cancel.inspect(|cancel| cancel.advance(1));
        samples
    });
    options.cancel.map_or(Ok(()), Cancel::check)?;
    let samples = rows.into_iter().flatten();
    let shapes = || groups.iter().map(|group| group.source.shape());
    let numbers = tones.iter().flatten().map(|tones| tones.numbers.len()).sum::<usize>();
    Ok(Sum {
        samples: if options.tolerance >= SINGLE_TOLERANCE {
            Samples::Single(samples.map(|s| Complex32::new(s.re as f32, s.im as f32)).collect())
        } else {
            Samples::Double(samples.collect())
        },
        power,
        coherence: 1.0,
        report: Report {
            engine: "direct",
            num_paths: shapes().map(|shape| num_channels * shape.paths).sum(),
            num_static: shapes()
                .filter(Shape::is_static)
                .map(|shape| num_channels * shape.paths)
                .sum(),
            longest: tones.iter().flatten().map(|tones| tones.longest).fold(0.0, f64::max),
            memory: size_of::<f64>() * numbers,
            ..Report::default()
        },
    })
}

/// Constants of the paths of a group in one channel.
struct Tones {
    /// Per path: mean delay tau [s], phase f0 tau modulo one turn, the further terms of the delay [s], and real and
    /// imaginary parts of the terms of conj(amplitude).
    numbers: Vec<f64>,
    delay_terms: usize,
    amplitude_terms: usize,
    basis: Basis,
    is_static: bool,
    /// Factor of every sample; none for one.
    weights: Vec<f64>,
    /// Mean over the nodes of the squared l2 norm of the amplitudes [W].
    power: f64,
    /// True if all numbers are finite.
    is_finite: bool,
    /// Bound on the longest delay of a path with power [s]; of edge terms, which may lie beyond a surface, none.
    longest: f64,
}

impl Tones {
    fn new(waveform: &Waveform, group: &PathGroup, channel: usize, level: Level) -> Self {
        let shape = group.source.shape();
        let [delay_terms, amplitude_terms] = [shape.delay_rows, shape.amplitude_rows];
        let mut tones = Self {
            numbers: Vec::with_capacity(shape.paths * (1 + delay_terms + 2 * amplitude_terms)),
            delay_terms,
            amplitude_terms,
            basis: shape.basis,
            is_static: shape.is_static(),
            weights: waveform.over_frequency(group.frequency_exponent),
            power: 0.0,
            is_finite: true,
            longest: 0.0,
        };
        let mut chunk = Chunk::<f64>::new(&shape, 1);
        let (mut delay, mut re, mut im) = (
            vec![0.0; delay_terms],
            vec![0.0; amplitude_terms],
            vec![0.0; amplitude_terms],
        );
        for first in (0..shape.paths).step_by(CHUNK) {
            let request = Request {
                channels: channel..channel + 1,
                paths: first..shape.paths.min(first + CHUNK),
                scale: 1.0,
                level,
            };
            group.source.fill_double(&request, &mut chunk);
            for lane in 0..chunk.num_paths {
                terms(shape.basis, &chunk.delay, lane, &mut delay);
                terms(shape.basis, &chunk.re, lane, &mut re);
                terms(shape.basis, &chunk.im, lane, &mut im);
                let power = mean_square(&chunk.re, lane) + mean_square(&chunk.im, lane);
                tones.power += power;
                // All terms of the delay count: phases of rates that no time could show lose their digits as well.
                let term = |(k, term): (usize, &f64)| match shape.basis {
                    Basis::Taylor => term.abs() * waveform.duration().powf(k as f64),
                    Basis::Chebyshev => term.abs(),
                };
                if power > 0.0 && group.frequency_exponent == 0 {
                    tones.longest = tones.longest.max(delay.iter().enumerate().map(term).sum());
                }
                tones
                    .numbers
                    .extend([delay[0], turns(waveform.start_frequency, delay[0])]);
                tones.numbers.extend(&delay[1..]);
                tones.numbers.extend(re.iter().zip(&im).flat_map(|(re, im)| [*re, -im]));
            }
        }
        tones.is_finite = tones.power.is_finite() && tones.numbers.iter().all(|x| x.is_finite());
        tones
    }

    fn stride(&self) -> usize {
        1 + self.delay_terms + 2 * self.amplitude_terms
    }
}

/// Terms of the frame's basis from the rows of a path: as they are, or from values at the nodes.
fn terms(basis: Basis, rows: &[[f64; CHUNK]], lane: usize, terms: &mut [f64]) {
    let number = terms.len();
    match basis {
        Basis::Taylor => terms.iter_mut().zip(rows).for_each(|(term, row)| *term = row[lane]),
        Basis::Chebyshev => {
            let matrix = chebyshev_matrix(number);
            for (term, weights) in terms.iter_mut().zip(matrix.chunks(number)) {
                *term = (1..number).map(|j| weights[j] * rows[j][lane]).sum();
            }
            terms[0] += rows[0][lane];
        }
    }
}

/// Mean over the nodes of the square of a part of an amplitude.
fn mean_square(rows: &[[f64; CHUNK]], lane: usize) -> f64 {
    let value = |j: usize| rows[0][lane] + if j > 0 { rows[j][lane] } else { 0.0 };
    (0..rows.len()).map(|j| value(j).powi(2)).sum::<f64>() / rows.len() as f64
}

/// Addition of some paths to the samples of a chirp.
struct AddTones<'a> {
    waveform: &'a Waveform,
    tones: &'a Tones,
    chirp: usize,
    cancel: Option<&'a Cancel>,
    samples: &'a mut [Complex64],
}

impl Kernel for AddTones<'_> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let Self {
            waveform,
            tones,
            chirp,
            cancel,
            samples,
        } = self;
        let (f0, slope, stride) = (waveform.start_frequency, waveform.slope, tones.stride());
        let num_terms = tones.delay_terms.max(tones.amplitude_terms);
        let (mut values, mut basis) = (vec![0.0; num_terms], vec![[0.0; BLOCK]; num_terms]);
        for first in (0..samples.len()).step_by(BLOCK) {
            let len = BLOCK.min(samples.len() - first);
            // Fast time of every sample [s], and the functions of the basis.
            let mut fast: Lanes = [0.0; BLOCK];
            for lane in 0..len {
                fast[lane] = waveform.sample_time(first + lane);
                basis_values(
                    tones.basis,
                    waveform,
                    waveform.chirp_times[chirp] + fast[lane],
                    &mut values,
                );
                for k in 0..num_terms {
                    basis[k][lane] = values[k];
                }
            }
            let mut sums: [Lanes; 2] = [[0.0; BLOCK]; 2];
            for some in tones.numbers.chunks(CHECKED * stride) {
                if cancel.is_some_and(Cancel::is_asked) {
                    return;
                }
                for path in some.chunks_exact(stride) {
                    add_path(path, tones.delay_terms, &basis, &fast, [f0, slope], &mut sums);
                }
            }
            for lane in 0..len {
                let weight = tones.weights.get(first + lane).copied().unwrap_or(1.0);
                samples[first + lane] += weight * Complex64::new(sums[0][lane], sums[1][lane]);
            }
        }
    }
}

/// Add a path to a block of samples.
#[cfg_attr(optimised, inline(always))]
fn add_path(
    path: &[f64],
    delay_terms: usize,
    basis: &[Lanes],
    fast: &Lanes,
    [f0, slope]: [f64; 2],
    sums: &mut [Lanes; 2],
) {
    let (delays, amplitudes) = path[2..].split_at(delay_terms - 1);
    // Delay of every sample, as the departure from its mean.
    let mut delta = [0.0; BLOCK];
    for k in 0..delays.len() {
        for i in 0..BLOCK {
            delta[i] += delays[k] * basis[k + 1][i];
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
            re[i] += amplitudes[2 * k] * basis[k][i];
            im[i] += amplitudes[2 * k + 1] * basis[k][i];
        }
    }
    for i in 0..BLOCK {
        sums[0][i] += re[i] * cos[i] - im[i] * sin[i];
        sums[1][i] += re[i] * sin[i] + im[i] * cos[i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::arrays::ArrayPaths;
    use crate::synthesis::delay::PathSeries;
    use crate::synthesis::report::Known;
    use std::f64::consts::TAU;

    fn samples(waveform: &Waveform, arrays: &PathSeries, level: Level) -> Vec<Complex64> {
        let options = Options {
            tolerance: 1e-12,
            level,
            is_parallel: false,
            cancel: None,
            known: Known::NOTHING,
        };
        let sources = ArrayPaths::split(arrays);
        let groups: Vec<PathGroup> = sources
            .iter()
            .map(|source| PathGroup {
                source,
                frequency_exponent: 0,
            })
            .collect();
        match sum(waveform, &groups, &options).unwrap().samples {
            Samples::Double(samples) => samples,
            Samples::Single(_) => unreachable!(),
        }
    }

    #[test]
    fn every_level_gives_the_same_bits() {
        let wf = waveform(100);
        let delay: Vec<f64> = (0..30).map(|p| 1e-9 * f64::from(p) + 3e-9).collect();
        let amplitude = vec![Complex64::new(1.0, 0.5); 10];
        let arrays = PathSeries {
            basis: Basis::Taylor,
            delay: &delay.chunks(10).collect::<Vec<_>>(),
            amplitude: &[&amplitude],
            num_channels: 1,
            num_paths: 10,
        };
        let results: Vec<_> = Level::available()
            .into_iter()
            .map(|level| samples(&wf, &arrays, level))
            .collect();
        assert!(results.iter().all(|r| r == &results[0]));
        assert_eq!(results[0].len(), 300);
    }

    #[test]
    fn what_stands_still_is_the_same_in_every_chirp_beside_what_moves() {
        let wf = waveform(70);
        // Nodes (4) of two paths: the first stands still.
        let delay = [10e-9, 20e-9, 10e-9, 20.001e-9, 10e-9, 20.002e-9, 10e-9, 20.004e-9];
        let amplitude = [Complex64::new(1.0, 0.5), Complex64::new(0.3, 0.0)];
        let of = |delay: &[f64], amplitude: &[Complex64]| {
            let num_paths = amplitude.len();
            let arrays = PathSeries {
                basis: Basis::Chebyshev,
                delay: &delay.chunks(num_paths).collect::<Vec<_>>(),
                amplitude: &[amplitude],
                num_channels: 1,
                num_paths,
            };
            samples(&wf, &arrays, Level::best())
        };
        let one = |path: usize| of(&[0, 2, 4, 6].map(|k| delay[k + path]), &amplitude[path..=path]);
        let (both, still, moving) = (of(&delay, &amplitude), one(0), one(1));
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
        let arrays = PathSeries {
            basis: Basis::Taylor,
            delay: &[&[tau]],
            amplitude: &[&[Complex64::new(2.0, 0.0)]],
            num_channels: 1,
            num_paths: 1,
        };
        let got = samples(&wf, &arrays, Level::best());
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
