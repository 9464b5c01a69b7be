//! Beat signals: checks of the input, then plans and runs until the tolerance is reached.

use num_complex::Complex64;

use super::job::{Job, Options, Report, Samples, gain, scale, too_large};
use super::lanes::LaneSum;
use crate::cancel::Cancel;
use crate::error::{Error, Result, fits_memory};
use crate::synthesis::block::{Block, Class, Selection};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::direct;
use crate::synthesis::interval::Interval;
use crate::synthesis::plan::{self, Method, Plan, Request};
use crate::synthesis::statistics::{self, PathStatistics};

/// Smallest tolerance whose samples are in single precision.
pub const SINGLE_TOLERANCE: f64 = 1e-6;

/// Path-samples that are summed in the time that waking a thread of a pool takes.
const SMALL_SUM: usize = 1 << 21;

/// True if a sum over these numbers of paths, channels, chirps and samples is worth more than one thread.
pub fn is_worth_threads(work: [usize; 4]) -> bool {
    let product = work.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
    product.is_none_or(|n| n >= SMALL_SUM)
}

/// Complex beat samples `(channel, chirp, sample)` [sqrt(W)], row-major, docs/theory.md eq. (1): the sum over all paths
/// of `conj(amplitude) exp(2 pi j (f0 tau + S tau t - S tau^2 / 2))`. No paths give zeros.
pub fn beat_signal(waveform: &Waveform, series: &PathSeries, options: &Options) -> Result<(Samples, Report)> {
    waveform.check()?;
    series.check_shapes()?;
    // Samples, and half as much again for tiles in progress.
    let num_samples = waveform.num_samples.saturating_add(direct::BLOCK);
    let shape = [series.num_channels, waveform.chirp_times.len(), num_samples];
    fits_memory("samples", &shape, 2 * size_of::<Complex64>())?;
    let is_single = options.tolerance >= SINGLE_TOLERANCE;
    let lanes = LaneSum::of(waveform, series, options);
    if let Some(lanes) = &lanes
        && let Some(done) = lanes.samples(&lanes.errors(options.is_parallel), waveform, options)?
    {
        return Ok(done);
    }
    let mut job = Job::new(waveform, series, options)?;
    job.check_lanes()?;
    let mut known_gain: f64 = 1.0;
    let mut runs = 0;
    loop {
        let plan = job.plan(known_gain)?;
        fits_memory("grids", &[plan.memory()], 1)?;
        let (samples, outcome) = job.run(&plan, is_single);
        options.cancel.map_or(Ok(()), Cancel::check)?;
        runs += 1;
        let gain = gain(&samples, &job.statistics.power, waveform);
        if !gain.is_finite() {
            return Err(too_large(job.statistics.largest));
        }
        let interpolation = outcome.interpolation(&job.statistics.power) * plan::fluctuation(waveform);
        // Errors allow for what is due to few samples.
        let coherent = (gain / plan::fluctuation(waveform)).max(1.0);
        if plan.error_with(interpolation, coherent) <= options.tolerance {
            let report = Report {
                plan,
                rows: outcome.rows,
                rows_skipped: outcome.rows_skipped,
                runs,
                gain,
            };
            return Ok((samples, report));
        }
        if plan.error_with(0.0, coherent) > options.tolerance {
            // Paths add up in phase, and so do their errors.
            known_gain = coherent.max(1.01 * known_gain);
        }
        if interpolation > plan.series() {
            job.learn(&outcome.worst, interpolation / plan.series());
        }
    }
}

/// Plan of the first run of [`beat_signal`].
pub fn plan(waveform: &Waveform, series: &PathSeries, options: &Options) -> Result<Plan> {
    waveform.check()?;
    series.check_shapes()?;
    let lanes = LaneSum::of(waveform, series, options);
    if let Some(lanes) = &lanes
        && let Some((_, plan)) = lanes.plan(&lanes.errors(options.is_parallel), options.tolerance, 1.0)
    {
        return Ok(plan);
    }
    let job = Job::new(waveform, series, options)?;
    job.check_lanes()?;
    job.plan(1.0)
}

/// Largest safety factor in single precision.
const MAX_SAFETY_FACTOR: f64 = 10.0;
/// Largest safety factor in double precision: beyond it the series do not describe the delays.
const MAX_DOUBLE_SAFETY_FACTOR: f64 = 1e4;
/// Number of random samples, which represent all moving paths.
const NUM_SAMPLES: usize = 256;
/// Gain that plans in single precision allow for: a second run costs more than the finer plan.
const RESERVE: f64 = 2.0;
/// Tolerances from which plans with that reserve are tried: smaller ones would need double precision.
const LEAST_RESERVED: f64 = 2e-6;

impl<'a> Job<'a> {
    fn new(waveform: &'a Waveform, series: &'a PathSeries<'a>, options: &'a Options<'a>) -> Result<Self> {
        // The direct sum needs no statistics, whatever the motion.
        let is_direct = options.method == Method::Direct || !series.can_be_planned(waveform);
        let statistics = if is_direct {
            series.check_numbers()?;
            let longest = longest_delay(waveform, series);
            check_turns(waveform, longest)?;
            PathStatistics::count(series)
        } else {
            let frame = Block::new(waveform, series, 0..waveform.chirp_times.len());
            let carrier = waveform.start_frequency + waveform.slope * waveform.middle_time();
            let statistics = PathStatistics::new(waveform, series, &frame, carrier, options.level, options.is_parallel);
            if !statistics.is_finite {
                series.check_numbers()?;
            }
            check_phases(waveform, &statistics)?;
            statistics
        };
        let scale = scale(statistics.largest);
        let mut job = Self {
            waveform,
            series,
            options,
            // A second pass over all paths is not worth its cost for a few still paths.
            is_split: options.split_still && 16 * statistics.still.num_paths > statistics.moving.num_paths,
            statistics,
            samples: Vec::new(),
            extra: Vec::new(),
            safety_factor: 1.0,
            allows_single: true,
            is_lost: false,
            scale,
        };
        if !is_direct {
            if !job.is_split {
                job.statistics.merge();
            }
            job.draw();
        }
        Ok(job)
    }

    /// Selection of the paths of a class; of all paths if the classes are not split.
    pub(super) fn selection(&self, class: Class) -> Selection<'_> {
        let class = if self.is_split { class } else { Class::All };
        Selection::new(class, &self.statistics.masks, self.series.num_channels)
    }

    /// Draw the samples that represent all moving paths.
    fn draw(&mut self) {
        let selection = self.selection(Class::Moving);
        let mut samples = statistics::samples(self.series, selection, NUM_SAMPLES);
        if samples.len() == NUM_SAMPLES {
            samples.extend(statistics::bounding_paths(self.series, &self.statistics));
        }
        // Paths with a large share of the power are samples in any case.
        let share = 1.0 / NUM_SAMPLES as f64;
        let most = 2.0 * self.statistics.largest.powi(2);
        if self.statistics.power.iter().any(|power| most > share * power) {
            samples.extend(statistics::strongest(
                self.series,
                selection,
                &self.statistics.power,
                share,
            ));
        }
        for (channel, chunk) in &self.extra {
            samples.extend(statistics::samples_of(self.series, selection, *channel, *chunk));
        }
        self.samples = samples;
    }

    /// Add chunks of paths to the samples, whose interpolation errors were larger than predicted by a factor.
    fn learn(&mut self, chunks: &[(usize, usize)], factor: f64) {
        for chunk in chunks {
            if !self.extra.contains(chunk) {
                self.extra.push(*chunk);
            }
        }
        self.safety_factor *= (1.2 * factor).clamp(1.2, 3.0);
        if self.safety_factor > MAX_SAFETY_FACTOR && self.allows_single {
            // The remaining error may be rounding.
            (self.safety_factor, self.allows_single) = (1.0, false);
        }
        self.is_lost |= self.safety_factor > MAX_DOUBLE_SAFETY_FACTOR;
        self.draw();
    }

    /// Ranges of the coefficients of the delays of moving paths in blocks [s], (block, degree).
    fn delay_ranges(&self, blocks: &[Block]) -> Vec<Vec<Interval>> {
        let selection = self.selection(Class::Moving);
        statistics::ranges(
            self.series,
            selection,
            blocks,
            self.options.level,
            self.options.is_parallel,
        )
    }

    /// Plan for a known gain.
    fn plan(&self, gain: f64) -> Result<Plan> {
        if self.is_lost && self.options.method != Method::Auto {
            return Err(self.refused(None));
        }
        let is_unplanned = self.is_lost || !self.series.can_be_planned(self.waveform);
        let is_direct = is_unplanned && self.options.method == Method::Auto;
        let method = if is_direct { Method::Direct } else { self.options.method };
        let try_plan = |reserve: f64| self.try_plan(self.options.tolerance, gain.max(reserve), method);
        let is_single = |plan: &Plan| plan.parts.iter().all(|part| part.step.is_single());
        let safe = if self.options.tolerance > LEAST_RESERVED {
            try_plan(RESERVE).filter(is_single)
        } else {
            None
        };
        safe.or_else(|| try_plan(1.0)).ok_or_else(|| self.refusal(gain))
    }

    fn try_plan(&self, tolerance: f64, gain: f64, method: Method) -> Option<Plan> {
        let request = Request {
            waveform: self.waveform,
            series: self.series,
            tolerance,
            method,
            gain,
            safety_factor: self.safety_factor,
            allows_single: self.allows_single,
            samples: &self.samples,
            num_random: NUM_SAMPLES.min(self.samples.len()),
            level: self.options.level,
        };
        request.plan(&self.statistics, |blocks| self.delay_ranges(blocks))
    }

    /// Error that names a reachable tolerance.
    fn refusal(&self, gain: f64) -> Error {
        let is_reachable = |tolerance: f64| {
            let Some(plan) = self.try_plan(tolerance, gain, self.options.method) else {
                return false;
            };
            // An unknown gain takes a run to measure.
            let gain = if gain > 1.0 { gain } else { self.gain_of(&plan) };
            self.try_plan(tolerance, gain.max(1.0), self.options.method).is_some()
        };
        self.refused(reachable(|tolerance| {
            tolerance > self.options.tolerance && is_reachable(tolerance)
        }))
    }

    /// Refuse paths that cannot be summed in lanes, where nothing else is allowed.
    fn check_lanes(&self) -> Result<()> {
        if self.options.method != Method::Lanes || self.series.num_paths == 0 {
            return Ok(());
        }
        // Only a sum shows by how much paths add up in phase, and their errors with them.
        let is_reachable = |tolerance: f64| {
            let options = Options {
                tolerance,
                ..*self.options
            };
            let sum = LaneSum::of(self.waveform, self.series, &options);
            let samples = sum.and_then(|sum| {
                let errors = sum.errors(options.is_parallel);
                sum.samples(&errors, self.waveform, &options).ok()
            });
            samples.flatten().is_some()
        };
        Err(self.refused(reachable(|tolerance| {
            tolerance > self.options.tolerance && is_reachable(tolerance)
        })))
    }

    fn refused(&self, reachable: Option<f64>) -> Error {
        let expected = match reachable {
            Some(reachable) => format!("at least {reachable:.0e} with this method for these paths"),
            None => "the method \"auto\" for these paths: this one cannot follow them".to_owned(),
        };
        Error::value("tolerance", expected, format!("{:e}", self.options.tolerance))
    }

    /// Largest rms of the samples of a channel of a plan, relative to its l2(amplitudes).
    fn gain_of(&self, plan: &Plan) -> f64 {
        gain(&self.run(plan, false).0, &self.statistics.power, self.waveform)
    }
}

/// Smallest round tolerance that can be reached.
fn reachable(is_reachable: impl Fn(f64) -> bool) -> Option<f64> {
    // 1, 2, 5, 10, ...: numbers that are exact in print.
    let decades = (1..=12)
        .rev()
        .flat_map(|digit| [1.0, 2.0, 5.0].map(|first| (first, digit)));
    decades
        .map(|(first, digit)| first * 10f64.powi(-digit))
        .filter(|tolerance| *tolerance < 0.15)
        .find(|tolerance| is_reachable(*tolerance))
}

/// Refuse delays whose phases lose all digits, and powers that are not finite.
fn check_phases(waveform: &Waveform, statistics: &PathStatistics) -> Result<()> {
    let longest: f64 = [&statistics.still, &statistics.moving]
        .iter()
        .filter(|group| group.num_paths > 0)
        .map(|group| group.delay.iter().map(|range| range.magnitude()).sum::<f64>())
        .fold(0.0, f64::max);
    check_turns(waveform, longest)?;
    if statistics.power.iter().any(|power| !power.is_finite()) {
        return Err(Error::value(
            "amplitude",
            "squares that are finite numbers",
            format!("{:e}", statistics.largest),
        ));
    }
    Ok(())
}

/// Refuse delays [s] whose phases lose all digits.
fn check_turns(waveform: &Waveform, longest: f64) -> Result<()> {
    const MAX_TURNS: f64 = 1e12;
    let fast = waveform.sample_time(waveform.num_samples - 1).abs();
    let turns = longest * (waveform.start_frequency.abs() + waveform.slope.abs() * (fast + longest));
    if turns > MAX_TURNS || !turns.is_finite() {
        return Err(Error::value(
            "delay",
            format!("phases of at most {MAX_TURNS:e} turns"),
            format!("{turns:.1e} (a delay of {longest:.3e} s)"),
        ));
    }
    Ok(())
}

/// Bound on all delays in a frame [s], without statistics.
fn longest_delay(waveform: &Waveform, series: &PathSeries) -> f64 {
    let largest = |row: &[f64]| row.iter().fold(0.0, |max: f64, x| max.max(x.abs()));
    let rows = series.delay.iter().map(|row| largest(row));
    match series.basis {
        Basis::Taylor => {
            let time = waveform.duration();
            rows.zip([1.0, time, 0.5 * time * time])
                .map(|(row, power)| row * power)
                .sum()
        }
        Basis::Chebyshev => rows.fold(0.0, f64::max),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::SPEED_OF_LIGHT as C;
    use crate::numeric::random::mix;
    use crate::numeric::simd::{Level, Real};
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

    /// Relative to l2(amplitudes).
    fn error(got: &Samples, expected: &[Complex64], amplitude: &[Complex64]) -> f64 {
        let got: Vec<Complex64> = match got {
            Samples::Single(samples) => samples
                .iter()
                .map(|s| Complex64::new(s.re.wide(), s.im.wide()))
                .collect(),
            Samples::Double(samples) => samples.clone(),
        };
        let power: f64 = amplitude.iter().map(Complex64::norm_sqr).sum();
        let sum: f64 = got.iter().zip(expected).map(|(a, b)| (a - b).norm_sqr()).sum();
        (sum / got.len() as f64 / power).sqrt()
    }

    #[test]
    fn grid_keeps_to_every_tolerance_at_every_level() {
        let mut state = 7;
        let mut unit = || {
            state = mix(state);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let n = 500;
        for (num_chirps, num_samples, bandwidth) in [(33, 64, 1e9), (1, 16, -1e9), (16, 1, 1e9), (17, 100, 5e9)] {
            let wf = waveform(num_chirps, num_samples, bandwidth);
            let delay: Vec<f64> = (0..n).map(|_| 2.0 / C * (0.5 + 7.5 * unit())).collect();
            let rate: Vec<f64> = (0..n).map(|_| 2.0 / C * (6.0 * unit() - 3.0)).collect();
            let acceleration: Vec<f64> = (0..n).map(|_| 2.0 / C * (40.0 * unit() - 10.0)).collect();
            let amplitude: Vec<Complex64> = (0..n).map(|_| Complex64::from_polar(unit(), 6.3 * unit())).collect();
            for num_terms in 1..=3 {
                let rows = [&delay[..], &rate, &acceleration];
                let series = PathSeries {
                    basis: Basis::Taylor,
                    delay: &rows[..num_terms],
                    amplitude: &[&amplitude],
                    num_channels: 1,
                    num_paths: n,
                };
                let exact = direct::beat_signal(&wf, &series, Class::All, Level::best(), false, None);
                for tolerance in [1e-2, 1e-4, 1e-6, 1e-9, 1e-11] {
                    for level in Level::available() {
                        let options = Options {
                            tolerance,
                            method: Method::Grid,
                            is_parallel: false,
                            level,
                            ..Options::default()
                        };
                        let (samples, report) = beat_signal(&wf, &series, &options).unwrap();
                        let error = error(&samples, &exact, &amplitude);
                        assert!(error <= tolerance, "{error:e} {level:?} {}", report.plan);
                    }
                }
            }
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

    /// Delay, rate, acceleration and amplitude of paths of many channels that hardly turn, but for every `rare`-th.
    fn rarely_turning(num_paths: usize, rare: usize) -> ([Vec<f64>; 3], Vec<Complex64>) {
        let mut unit = units(11);
        let delay = (0..num_paths).map(|_| 2.0 / C * (0.5 + 7.5 * unit())).collect();
        let rate = (0..num_paths).map(|_| 2.0 / C * (2.0 * unit() - 1.0)).collect();
        let amplitude = (0..num_paths)
            .map(|_| Complex64::from_polar(unit(), 6.3 * unit()))
            .collect();
        let bend = |i: usize| if i % rare == rare / 2 { 60.0 } else { 2.0 };
        let acceleration = (0..num_paths).map(|i| 2.0 / C * bend(i) * unit()).collect();
        ([delay, rate, acceleration], amplitude)
    }

    #[test]
    fn rare_paths_that_turn_are_planned_for_at_once() {
        let wf = waveform(64, 64, 1e9);
        let ([delay, rate, acceleration], amplitude) = rarely_turning(20_000, 4000);
        let series = PathSeries {
            basis: Basis::Taylor,
            delay: &[&delay, &rate, &acceleration],
            amplitude: &[&amplitude],
            num_channels: 1,
            num_paths: delay.len(),
        };
        let (samples, report) = beat_signal(&wf, &series, &Options::default()).unwrap();
        assert_eq!(report.runs, 1, "{}", report.plan);
        let exact = direct::beat_signal(&wf, &series, Class::All, Level::best(), true, None);
        let error = error(&samples, &exact, &amplitude);
        assert!(error <= 1e-4, "{error:e} {}", report.plan);
    }

    #[test]
    fn paths_somewhat_in_phase_need_one_run() {
        let wf = waveform(32, 64, 1e9);
        let mut unit = units(5);
        let n = 5000;
        // Two in three of them are equal in groups of four.
        let position: Vec<f64> = (0..n).map(|_| 0.5 + 7.5 * unit()).collect();
        let place = |i: usize| if i % 6 < 4 { i / 6 * 6 } else { i };
        let delay: Vec<f64> = (0..n).map(|i| 2.0 / C * position[place(i)]).collect();
        let rate: Vec<f64> = (0..n).map(|i| 2.0 / C * (position[place(i)] - 4.0)).collect();
        let amplitude = vec![Complex64::new(1.0, 0.0); n];
        let series = PathSeries {
            basis: Basis::Taylor,
            delay: &[&delay, &rate],
            amplitude: &[&amplitude],
            num_channels: 1,
            num_paths: n,
        };
        let options = Options {
            method: Method::Grid,
            ..Options::default()
        };
        let (_, report) = beat_signal(&wf, &series, &options).unwrap();
        assert!(report.gain > 1.5 && report.gain < RESERVE, "{}", report.gain);
        assert_eq!(report.runs, 1, "{}", report.plan);
    }

    #[test]
    fn channels_that_are_summed_together_are_as_exact_as_one() {
        let wf = waveform(48, 50, 1e9);
        let (num_channels, num_paths) = (2 * crate::synthesis::nufft::MAX_CHANNELS - 1, 300);
        let ([delay, rate, acceleration], amplitude) = rarely_turning(num_channels * num_paths, 7);
        let series = PathSeries {
            basis: Basis::Taylor,
            delay: &[&delay, &rate, &acceleration],
            amplitude: &[&amplitude],
            num_channels,
            num_paths,
        };
        let exact = direct::beat_signal(&wf, &series, Class::All, Level::best(), true, None);
        for (tolerance, is_parallel) in [(1e-4, false), (1e-4, true), (1e-9, false)] {
            let options = Options {
                tolerance,
                method: Method::Grid,
                is_parallel,
                ..Options::default()
            };
            let (samples, report) = beat_signal(&wf, &series, &options).unwrap();
            let per_channel = exact.len() / num_channels;
            for channel in 0..num_channels {
                let range = channel * per_channel..(channel + 1) * per_channel;
                let own = match &samples {
                    Samples::Single(samples) => Samples::Single(samples[range.clone()].to_vec()),
                    Samples::Double(samples) => Samples::Double(samples[range.clone()].to_vec()),
                };
                let amplitude = &amplitude[channel * num_paths..][..num_paths];
                let error = error(&own, &exact[range], amplitude);
                assert!(error <= tolerance, "{error:e} {channel} {}", report.plan);
            }
        }
    }
}
