//! Direct sum: docs/theory.md eq. (1) evaluated at every sample of every path, in f64.
//!
//! The reference for all faster sums. The phase of every sample is evaluated on its own, so no error grows with the
//! number of samples: the error is the rounding of the phase, about `2 pi B tau` eps. The work is split by channel,
//! chirp and block of samples; every block adds its paths in a fixed order, so the result does not depend on the number
//! of threads. Still paths are added once, for all chirps.

use num_complex::Complex64;

use crate::cancel::Cancel;
use crate::numeric::chebyshev::chebyshev_matrix;
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Level};
use crate::numeric::trig::{cos_sin_turns, turns};
use crate::synthesis::block::Class;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::{Basis, PathSeries, basis_values};

/// Samples per block: their phases stay in registers and L1.
pub const BLOCK: usize = 64;

/// Paths that are added between two looks for a request to stop.
const CHECKED: usize = 1024;

type Lanes = [f64; BLOCK];

/// Complex beat samples `(channel, chirp, sample)` of the paths of a class, row-major; input as [`PathSeries::check`]
/// accepts it. After a request to stop they are worthless; the chirps of all channels count as steps.
pub fn beat_signal(
    waveform: &Waveform,
    series: &PathSeries,
    class: Class,
    level: Level,
    is_parallel: bool,
    cancel: Option<&Cancel>,
) -> Vec<Complex64> {
    // Per channel: constants of every path, one record after the other. Still paths are the same in every chirp.
    let channels: Vec<[Records; 2]> = parallel::map(is_parallel, (0..series.num_channels).collect(), |channel| {
        Records::still_and_moving(waveform, series, channel)
    });
    let num_chirps = waveform.chirp_times.len();
    let add_paths = |records: &Records, chirp: usize, block: usize| {
        let times = Times::new(waveform, series.basis, records, chirp, block * BLOCK);
        level.run(AddPaths {
            waveform,
            records,
            times: &times,
            cancel,
        })
    };
    let zero = || Sums {
        re: [0.0; BLOCK],
        im: [0.0; BLOCK],
    };

    // Per channel and block of samples: add all still paths.
    let blocks_per_chirp = waveform.num_samples.div_ceil(BLOCK);
    let still: Vec<Sums> = parallel::map(
        is_parallel,
        (0..series.num_channels * blocks_per_chirp).collect(),
        |i| {
            if class == Class::Moving {
                zero()
            } else {
                add_paths(&channels[i / blocks_per_chirp][0], 0, i % blocks_per_chirp)
            }
        },
    );

    // Per channel, chirp and block of samples: add all moving paths.
    let rows: Vec<Vec<Complex64>> =
        parallel::map(is_parallel, (0..series.num_channels * num_chirps).collect(), |row| {
            let (channel, chirp) = (row / num_chirps, row % num_chirps);
            let sum = |block: usize| {
                let moving = if class == Class::Still {
                    zero()
                } else {
                    add_paths(&channels[channel][1], chirp, block)
                };
                let still = &still[channel * blocks_per_chirp + block];
                (0..BLOCK).map(move |i| Complex64::new(still.re[i] + moving.re[i], still.im[i] + moving.im[i]))
            };
            let samples = (0..blocks_per_chirp).flat_map(sum).take(waveform.num_samples).collect();
            cancel.inspect(|cancel| cancel.advance(1));
            samples
        });
    rows.into_iter().flatten().collect()
}

/// Constants of some paths of one channel; `stride` numbers per path:
/// mean delay tau [s], phase f0 tau modulo one turn [cycles], the further terms of the delay [s], and real and
/// imaginary parts of the terms of conj(amplitude).
struct Records {
    numbers: Vec<f64>,
    num_delay_terms: usize,
    num_amplitude_terms: usize,
}

impl Records {
    /// Records of the still paths of a channel, and of the moving ones.
    fn still_and_moving(waveform: &Waveform, series: &PathSeries, channel: usize) -> [Self; 2] {
        let at = |path: usize| channel * series.num_paths + path;
        let (num_delays, num_amplitudes) = (series.num_delay_terms(), series.num_amplitude_terms());
        let is_nodal = series.basis == Basis::Chebyshev;
        let matrices = is_nodal.then(|| [num_delays, num_amplitudes].map(chebyshev_matrix));

        // Terms of every path: given, or from values at the nodes. Differences from the first node are exact enough to
        // keep small terms, and vanish where nothing changes.
        let mut delay_terms = vec![0.0; num_delays * series.num_paths];
        let mut amplitude_terms = vec![Complex64::ZERO; num_amplitudes * series.num_paths];
        for path in 0..series.num_paths {
            let delays = &mut delay_terms[path * num_delays..][..num_delays];
            let amplitudes = &mut amplitude_terms[path * num_amplitudes..][..num_amplitudes];
            let first = (series.delay[0][at(path)], series.amplitude[0][at(path)]);
            amplitudes[0] = first.1.conj();
            match &matrices {
                None => (0..num_delays).for_each(|k| delays[k] = series.delay[k][at(path)]),
                Some([of_delays, of_amplitudes]) => {
                    for (k, row) in of_delays.chunks(num_delays).enumerate() {
                        delays[k] = (0..num_delays)
                            .map(|j| row[j] * (series.delay[j][at(path)] - first.0))
                            .sum();
                    }
                    delays[0] += first.0;
                    for (k, row) in of_amplitudes.chunks(num_amplitudes).enumerate() {
                        let change: Complex64 = (0..num_amplitudes)
                            .map(|j| (series.amplitude[j][at(path)] - first.1).conj() * row[j])
                            .sum();
                        amplitudes[k] = if k == 0 { amplitudes[0] + change } else { change };
                    }
                }
            }
        }

        let (still, moving): (Vec<usize>, Vec<usize>) = (0..series.num_paths).partition(|&path| {
            delay_terms[path * num_delays..][1..num_delays]
                .iter()
                .all(|tau| *tau == 0.0)
                && amplitude_terms[path * num_amplitudes..][1..num_amplitudes]
                    .iter()
                    .all(|a| *a == Complex64::ZERO)
        });
        [still, moving].map(|paths| {
            let delays = |path: usize| &delay_terms[path * num_delays..][..num_delays];
            let amplitudes = |path: usize| &amplitude_terms[path * num_amplitudes..][..num_amplitudes];
            let used_delays = paths
                .iter()
                .map(|&p| used(delays(p), |tau| *tau != 0.0))
                .max()
                .unwrap_or(1);
            let used_amplitudes = paths
                .iter()
                .map(|&p| used(amplitudes(p), |a| *a != Complex64::ZERO))
                .max()
                .unwrap_or(1);
            let mut numbers = Vec::with_capacity(paths.len() * (1 + used_delays + 2 * used_amplitudes));
            for path in paths {
                let delays = delays(path);
                numbers.extend([delays[0], turns(waveform.start_frequency, delays[0])]);
                numbers.extend(&delays[1..used_delays]);
                numbers.extend(amplitudes(path)[..used_amplitudes].iter().flat_map(|a| [a.re, a.im]));
            }
            Self {
                numbers,
                num_delay_terms: used_delays,
                num_amplitude_terms: used_amplitudes,
            }
        })
    }

    fn stride(&self) -> usize {
        1 + self.num_delay_terms + 2 * self.num_amplitude_terms
    }
}

/// Number of leading terms that a path uses, at least one.
fn used<T>(terms: &[T], is_used: impl Fn(&T) -> bool) -> usize {
    terms.iter().rposition(is_used).map_or(1, |k| k + 1)
}

/// Times and basis functions at the samples of one block, the same for all paths.
struct Times {
    /// Fast time, after the start of the chirp's ramp [s].
    fast: Lanes,
    /// Basis functions 1, 2, ... of the delays and amplitudes; function 0 is one.
    basis: Vec<Lanes>,
}

impl Times {
    fn new(waveform: &Waveform, basis: Basis, records: &Records, chirp: usize, first: usize) -> Self {
        let num_terms = records.num_delay_terms.max(records.num_amplitude_terms);
        let mut times = Self {
            fast: [0.0; BLOCK],
            basis: vec![[0.0; BLOCK]; num_terms - 1],
        };
        let mut values = vec![0.0; num_terms];
        for lane in 0..BLOCK.min(waveform.num_samples - first) {
            let t = waveform.sample_time(first + lane);
            times.fast[lane] = t;
            basis_values(basis, waveform, waveform.chirp_times[chirp] + t, &mut values);
            for (row, value) in times.basis.iter_mut().zip(&values[1..]) {
                row[lane] = *value;
            }
        }
        times
    }
}

/// Sum over all paths at the samples of one block.
struct Sums {
    re: Lanes,
    im: Lanes,
}

struct AddPaths<'a> {
    waveform: &'a Waveform,
    records: &'a Records,
    times: &'a Times,
    cancel: Option<&'a Cancel>,
}

impl Kernel for AddPaths<'_> {
    type Output = Sums;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> Sums {
        let (f0, slope) = (self.waveform.start_frequency, self.waveform.slope);
        let num_delays = self.records.num_delay_terms;
        let fast = self.times.fast;
        let mut sums = Sums {
            re: [0.0; BLOCK],
            im: [0.0; BLOCK],
        };
        let stride = self.records.stride();
        let some = self.records.numbers.chunks(CHECKED * stride);
        let some = some.take_while(|_| !self.cancel.is_some_and(Cancel::is_asked));
        for record in some.flat_map(|records| records.chunks_exact(stride)) {
            let (tau_0, turns_0) = (record[0], record[1]);
            let (delays, amplitudes) = record[2..].split_at(num_delays - 1);

            // Delay of every sample, as the departure from its mean.
            let mut delta = [0.0; BLOCK];
            for (term, basis) in delays.iter().zip(&self.times.basis) {
                for i in 0..BLOCK {
                    delta[i] += term * basis[i];
                }
            }

            // Phase f0 tau + S tau (t - tau / 2) in turns, eq. (1).
            let mut phase = [0.0; BLOCK];
            for i in 0..BLOCK {
                let tau = tau_0 + delta[i];
                phase[i] = turns_0 + f0 * delta[i] + slope * tau * (fast[i] - 0.5 * tau);
            }
            let (cos, sin) = cos_sin_turns::<f64, BLOCK>(&phase);

            // Amplitude of every sample.
            let (mut re, mut im) = ([amplitudes[0]; BLOCK], [amplitudes[1]; BLOCK]);
            for (term, basis) in amplitudes[2..].chunks_exact(2).zip(&self.times.basis) {
                for i in 0..BLOCK {
                    re[i] += term[0] * basis[i];
                    im[i] += term[1] * basis[i];
                }
            }

            for i in 0..BLOCK {
                sums.re[i] += re[i] * cos[i] - im[i] * sin[i];
                sums.im[i] += re[i] * sin[i] + im[i] * cos[i];
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn every_level_gives_the_same_bits() {
        let wf = waveform(100);
        let delay: Vec<f64> = (0..30).map(|p| 1e-9 * f64::from(p) + 3e-9).collect();
        let amplitude = vec![Complex64::new(1.0, 0.5); 10];
        let series = PathSeries {
            basis: Basis::Taylor,
            delay: &delay.chunks(10).collect::<Vec<_>>(),
            amplitude: &[&amplitude],
            num_channels: 1,
            num_paths: 10,
        };
        let results: Vec<_> = Level::available()
            .into_iter()
            .map(|level| beat_signal(&wf, &series, Class::All, level, false, None))
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
        let series = |delay: &[f64], amplitude: &[Complex64]| {
            let num_paths = amplitude.len();
            beat_signal(
                &wf,
                &PathSeries {
                    basis: Basis::Chebyshev,
                    delay: &delay.chunks(num_paths).collect::<Vec<_>>(),
                    amplitude: &[amplitude],
                    num_channels: 1,
                    num_paths,
                },
                Class::All,
                Level::best(),
                false,
                None,
            )
        };
        let of = |path: usize| series(&[0, 2, 4, 6].map(|k| delay[k + path]), &amplitude[path..=path]);
        let (both, still, moving) = (series(&delay, &amplitude), of(0), of(1));
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
        let series = PathSeries {
            basis: Basis::Taylor,
            delay: &[&[tau]],
            amplitude: &[&[Complex64::new(2.0, 0.0)]],
            num_channels: 1,
            num_paths: 1,
        };
        let got = beat_signal(&wf, &series, Class::All, Level::best(), false, None);
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
