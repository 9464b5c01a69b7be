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
use crate::synthesis::report::{ErrorBound, Known, Options, Report, Samples, Sum, largest};
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

/// Beat samples as [`beat_signal`], of groups of paths of `num_channels` channels; none may be empty beside others.
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
    let num_paths: usize = groups.iter().map(|group| group.source.shape().paths).sum();
    if num_paths * num_channels == 0 {
        return Ok((Samples::zeros(shape, options.tolerance), Report::default()));
    }
    let engine = choose(waveform, groups, options.tolerance, method);
    let mut options = *options;
    let (mut num_runs, mut memory) = (0, 0);
    while engine != Engine::Direct && num_runs < 2 {
        let sum = if engine == Engine::Doppler {
            doppler_nufft::sum(waveform, groups, &options)?
        } else {
            chirp_nufft::sum(waveform, groups, &options)?
        };
        let Some(sum) = sum else { break };
        num_runs += 1;
        let mut sum = sum.measured(waveform, groups, num_runs)?;
        // Grids of another size do not take the memory of those before.
        memory += sum.report.memory;
        sum.report.memory = memory;
        if sum.report.total_error <= options.tolerance {
            return Ok((sum.samples, sum.report));
        }
        // Paths add up in phase, and so do their errors.
        let gain = 1.01 * sum.report.gain.max(1.0);
        options.known = Known {
            gain,
            coherence: sum.coherence.max(gain),
            needs_double: sum.report.error.rounding_with_gain(gain) > 0.5 * options.tolerance,
        };
    }
    let sum = direct::sum(waveform, groups, &options)?.measured(waveform, groups, num_runs + 1)?;
    Ok((sum.samples, sum.report))
}

impl Sum {
    /// This sum, with its gain; an error if phases lose all digits, or if a sample is no finite number.
    fn measured(mut self, waveform: &Waveform, groups: &[PathGroup], num_runs: usize) -> Result<Self> {
        fn energies<T: Real>(samples: &[Complex<T>], per_channel: usize) -> Vec<f64> {
            let square = |sample: &Complex<T>| sample.re.wide().powi(2) + sample.im.wide().powi(2);
            let channels = samples.chunks(per_channel);
            channels.map(|channel| channel.iter().map(square).sum()).collect()
        }
        check_turns(waveform, &self.report)?;
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
        self.report.gain = largest(energies.iter().zip(&self.power).map(gain));
        self.report.num_runs = num_runs;
        // Errors allow for what is due to few samples.
        let in_phase = (self.report.gain / waveform.fluctuation()).max(1.0);
        // Paths that add up for a moment within the frame do so beside its chirps, too.
        let error = self.report.error;
        let kernel = error.kernel * (in_phase / self.coherence).max(1.0);
        self.report.total_error = ErrorBound { kernel, ..error }.with_gain(in_phase);
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
