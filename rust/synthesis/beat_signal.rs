//! Beat signals: checks, one engine chosen by one rule, a run, and the test of how far paths add up in phase.

use num_complex::{Complex, Complex64};

use crate::error::{Error, Result, fits_memory};
use crate::numeric::simd::{Level, Real};
use crate::synthesis::arrays::ArrayPaths;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chirp_nufft;
use crate::synthesis::choose::{Engine, Method, choose};
use crate::synthesis::delay::PathSeries;
use crate::synthesis::direct;
use crate::synthesis::doppler_nufft;
use crate::synthesis::report::{Known, Options, Report, Samples, Sum};
use crate::synthesis::source::PathGroup;

/// Path-samples that are summed in the time that waking a thread of a pool takes.
const SMALL_SUM: usize = 1 << 21;

/// Largest number of turns of a phase that keeps some digits after the point.
const MOST_TURNS: f64 = 1e12;

/// True if a sum over these numbers of paths, channels, chirps and samples is worth more than one thread.
pub fn is_worth_threads(work: [usize; 4]) -> bool {
    let product = work.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
    product.is_none_or(|n| n >= SMALL_SUM)
}

/// Complex beat samples `(channel, chirp, sample)` [sqrt(W)], row-major, docs/theory.md eq. (1): the sum over all paths
/// of `conj(amplitude) exp(2 pi j (f0 tau + S tau t - S tau^2 / 2))`. No paths give zeros.
pub fn beat_signal(
    waveform: &Waveform,
    arrays: &PathSeries,
    method: Method,
    options: &Options,
) -> Result<(Samples, Report)> {
    Level::check()?;
    waveform.check()?;
    arrays.check_shapes()?;
    let sources = ArrayPaths::split(arrays);
    let group = |source| PathGroup {
        source,
        frequency_exponent: 0,
    };
    let groups: Vec<PathGroup> = sources.iter().map(|source| group(source)).collect();
    sum_groups(waveform, arrays.num_channels, &groups, method, options)
}

/// Beat samples as [`beat_signal`], of groups of paths of `num_channels` channels.
pub fn sum_groups(
    waveform: &Waveform,
    num_channels: usize,
    groups: &[PathGroup],
    method: Method,
    options: &Options,
) -> Result<(Samples, Report)> {
    let shape = [num_channels, waveform.chirp_times.len(), waveform.num_samples];
    // Samples, and as much again in progress.
    fits_memory("samples", &shape, 3 * size_of::<Complex64>())?;
    let groups: Vec<PathGroup> = groups
        .iter()
        .filter(|group| group.source.shape().paths > 0)
        .copied()
        .collect();
    if groups.is_empty() || num_channels == 0 {
        return Ok((Samples::zeros(shape, options.tolerance), Report::default()));
    }
    let engine = choose(waveform, &groups, options.tolerance, method);
    let mut options = *options;
    let mut num_runs = 0;
    while engine != Engine::Direct && num_runs < 2 {
        let sum = if engine == Engine::Doppler {
            let prepared = doppler_nufft::prepare(waveform, &groups, &options)?;
            check_turns(waveform, &prepared.report)?;
            holds(&prepared.report, &options).then(|| prepared.run())
        } else {
            let prepared = chirp_nufft::prepare(waveform, &groups, &options)?;
            check_turns(waveform, &prepared.report)?;
            holds(&prepared.report, &options).then(|| prepared.run())
        };
        let Some(sum) = sum.transpose()? else {
            break;
        };
        num_runs += 1;
        check_turns(waveform, &sum.report)?;
        let sum = sum.measured(waveform, &groups, num_runs)?;
        if sum.report.total_error <= options.tolerance {
            return Ok((sum.samples, sum.report));
        }
        // Paths add up in phase, and so do their errors.
        let gain = 1.01 * sum.report.gain.max(1.0);
        options.known = Known {
            gain,
            coherence: sum.coherence,
            needs_double: sum.report.error.rounding_with_gain(gain) > 0.5 * options.tolerance,
        };
    }
    let sum = direct::sum(waveform, &groups, &options)?;
    check_turns(waveform, &sum.report)?;
    let sum = sum.measured(waveform, &groups, num_runs + 1)?;
    Ok((sum.samples, sum.report))
}

/// True if a sum is within the tolerance, as far as is known of the paths.
fn holds(report: &Report, options: &Options) -> bool {
    report.error.with_gain(options.known.gain) <= options.tolerance
}

impl Sum {
    /// This sum, with its gain; an error if a sample is no finite number.
    fn measured(mut self, waveform: &Waveform, groups: &[PathGroup], num_runs: usize) -> Result<Self> {
        fn energies<T: Real>(samples: &[Complex<T>], per_channel: usize) -> Vec<f64> {
            let square = |sample: &Complex<T>| sample.re.wide().powi(2) + sample.im.wide().powi(2);
            let channels = samples.chunks(per_channel);
            channels.map(|channel| channel.iter().map(square).sum()).collect()
        }
        let per_channel = waveform.chirp_times.len() * waveform.num_samples;
        let energies = match &self.samples {
            Samples::Single(samples) => energies(samples, per_channel),
            Samples::Double(samples) => energies(samples, per_channel),
        };
        let gain = |(energy, power): (&f64, &f64)| {
            if *power > 0.0 {
                (energy / per_channel as f64 / power).sqrt()
            } else {
                energy * 0.0
            }
        };
        let larger = |a: f64, b: f64| if b.is_nan() || b > a { b } else { a };
        self.report.gain = energies.iter().zip(&self.power).map(gain).fold(0.0, larger);
        self.report.num_runs = num_runs;
        // Errors allow for what is due to few samples.
        let in_phase = (self.report.gain / waveform.fluctuation()).max(1.0);
        self.report.total_error = self.report.error.with_gain(in_phase);
        if self.report.gain.is_finite() {
            Ok(self)
        } else {
            Err(groups[0].source.not_finite())
        }
    }
}

/// Refuse delays whose phases lose all digits.
fn check_turns(waveform: &Waveform, report: &Report) -> Result<()> {
    let longest = report.longest;
    let fast = waveform.sample_time(waveform.num_samples - 1).abs();
    let turns = longest * (waveform.start_frequency.abs() + waveform.slope.abs() * (fast + longest));
    if turns > MOST_TURNS || !turns.is_finite() {
        return Err(Error::value(
            "delay",
            format!("phases of at most {MOST_TURNS:e} turns"),
            format!("{turns:.1e} (a delay of {longest:.3e} s)"),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::constants::SPEED_OF_LIGHT as C;
    use crate::numeric::chebyshev::chebyshev_nodes;
    use crate::numeric::random::mix;
    use crate::synthesis::delay::Basis;

    fn waveform(num_chirps: usize, num_samples: usize, bandwidth: f64) -> Waveform {
        let sample_rate = 2e6;
        Waveform {
            start_frequency: 58e9,
            slope: bandwidth * sample_rate / num_samples as f64,
            sample_rate,
            adc_delay: 3.1e-6,
            num_samples,
            chirp_times: (0..num_chirps).map(|c| 400e-6 * c as f64).collect(),
        }
    }

    /// Numbers that are as good as random, 0 to 1.
    fn units(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = mix(state);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// Rows of delays and amplitudes of one channel.
    struct Rows {
        basis: Basis,
        delay: Vec<Vec<f64>>,
        amplitude: Vec<Vec<Complex64>>,
        num_channels: usize,
    }

    impl Rows {
        fn sum(
            &self,
            waveform: &Waveform,
            method: Method,
            tolerance: f64,
            level: Level,
            is_parallel: bool,
        ) -> (Vec<Complex64>, Report) {
            let delay: Vec<&[f64]> = self.delay.iter().map(Vec::as_slice).collect();
            let amplitude: Vec<&[Complex64]> = self.amplitude.iter().map(Vec::as_slice).collect();
            let arrays = PathSeries {
                basis: self.basis,
                delay: &delay,
                amplitude: &amplitude,
                num_channels: self.num_channels,
                num_paths: self.delay[0].len() / self.num_channels,
            };
            let options = Options {
                tolerance,
                level,
                is_parallel,
                cancel: None,
                known: Known::NOTHING,
            };
            let (samples, report) = beat_signal(waveform, &arrays, method, &options).unwrap();
            let samples = match samples {
                Samples::Single(samples) => samples
                    .iter()
                    .map(|s| Complex64::new(s.re.wide(), s.im.wide()))
                    .collect(),
                Samples::Double(samples) => samples,
            };
            (samples, report)
        }

        /// Errors of all channels must be within the tolerance, and the rounding of samples in single precision.
        fn check(&self, waveform: &Waveform, method: Method, tolerance: f64, level: Level) -> Report {
            let (exact, _) = self.sum(waveform, Method::Direct, 1e-12, Level::best(), false);
            let (got, report) = self.sum(waveform, method, tolerance, level, false);
            let per_channel = exact.len() / self.num_channels;
            let num_paths = self.delay[0].len() / self.num_channels;
            for channel in 0..self.num_channels {
                let of_row = |row: &Vec<Complex64>| -> f64 {
                    row[channel * num_paths..][..num_paths]
                        .iter()
                        .map(Complex64::norm_sqr)
                        .sum()
                };
                let power = self.amplitude.iter().map(of_row).sum::<f64>() / self.amplitude.len() as f64;
                let range = channel * per_channel..(channel + 1) * per_channel;
                let square: f64 = range.clone().map(|i| (got[i] - exact[i]).norm_sqr()).sum();
                let rounding: f64 = range.map(|i| exact[i].norm_sqr()).sum::<f64>() * 6e-8_f64.powi(2);
                let error = (square / per_channel as f64 / power).sqrt();
                let allowed = if tolerance >= 1e-6 {
                    (rounding / per_channel as f64 / power).sqrt()
                } else {
                    3e-12
                };
                assert!(
                    error <= tolerance + allowed,
                    "{error:e} of {tolerance:e} at {level:?}, channel {channel}: {report}"
                );
            }
            report
        }
    }

    /// Random paths: terms of delays by `num_rows`, or values at nodes with amplitudes that change.
    fn random(
        num_paths: usize,
        num_rows: usize,
        is_nodal: bool,
        num_channels: usize,
        duration: f64,
        seed: u64,
    ) -> Rows {
        let mut unit = units(seed);
        let number = num_paths * num_channels;
        let motions: Vec<[f64; 4]> = (0..number)
            .map(|_| [0.5 + 7.5 * unit(), 6.0 * unit() - 3.0, 40.0 * unit() - 10.0, unit()])
            .collect();
        let phases: Vec<Complex64> = motions
            .iter()
            .map(|m| Complex64::from_polar(m[3], TAU * unit()))
            .collect();
        if !is_nodal {
            let row = |k: usize| motions.iter().map(|motion| 2.0 / C * motion[k]).collect();
            return Rows {
                basis: Basis::Taylor,
                delay: (0..num_rows).map(row).collect(),
                amplitude: vec![phases],
                num_channels,
            };
        }
        let times = chebyshev_nodes(num_rows)
            .into_iter()
            .map(|x| 0.5 * duration * (1.0 + x));
        let distance = |motion: &[f64; 4], t: f64| motion[0] + motion[1] * t + 0.1 * (30.0 * t + 6.0 * motion[3]).sin();
        let delay = times
            .clone()
            .map(|t| motions.iter().map(|m| 2.0 / C * distance(m, t)).collect());
        let amplitude = times.map(|t| {
            motions
                .iter()
                .zip(&phases)
                .map(|(m, a)| a / distance(m, t).powi(2))
                .collect()
        });
        Rows {
            basis: Basis::Chebyshev,
            delay: delay.collect(),
            amplitude: amplitude.collect(),
            num_channels,
        }
    }

    #[test]
    fn every_tolerance_is_kept_at_every_level() {
        for (num_chirps, num_samples, bandwidth) in [(33, 64, 1e9), (1, 16, -1e9), (16, 1, 1e9), (17, 100, 5e9)] {
            let wf = waveform(num_chirps, num_samples, bandwidth);
            for (num_rows, is_nodal) in [(1, false), (2, false), (3, false), (7, true)] {
                let rows = random(300, num_rows, is_nodal, 1, wf.duration(), 7);
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
            for num_rows in [2, 3] {
                for at in [1, 2000, 3999] {
                    let mut rows = random(4000, num_rows, false, 1, wf.duration(), 3);
                    for (path, amplitude) in rows.amplitude[0].iter_mut().enumerate() {
                        *amplitude *= if path == at { 1.0 } else { 1.0 / strong };
                    }
                    if num_rows == 3 {
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
        for num_rows in [1, 2, 3] {
            let mut rows = random(2000, num_rows, false, 1, wf.duration(), 5);
            for k in 0..num_rows {
                let first = rows.delay[k][0];
                rows.delay[k].fill(first);
            }
            rows.amplitude[0].fill(Complex64::ONE);
            for tolerance in [1e-2, 1e-3, 1e-4, 1e-6, 1e-9] {
                let report = rows.check(&wf, Method::Grid, tolerance, Level::best());
                assert!((report.gain / 2000_f64.sqrt() - 1.0).abs() < 0.02, "{}", report.gain);
                assert!(report.num_runs <= 2, "{tolerance:e} with {num_rows} rows: {report}");
            }
        }
    }

    #[test]
    fn channels_and_threads_change_nothing() {
        let wf = waveform(40, 50, 1e9);
        for (num_rows, is_nodal) in [(2, false), (3, false), (6, true)] {
            let rows = random(700, num_rows, is_nodal, 5, wf.duration(), 11);
            for tolerance in [1e-3, 1e-5, 1e-9] {
                rows.check(&wf, Method::Auto, tolerance, Level::best());
                let [one, many] = [false, true].map(|is| rows.sum(&wf, Method::Grid, tolerance, Level::best(), is).0);
                assert!(one == many);
            }
        }
    }
}
