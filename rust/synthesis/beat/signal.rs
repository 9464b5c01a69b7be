//! Beat signals: checks of the input, then plans and runs until the tolerance is reached.

use num_complex::Complex64;

use super::job::{Job, Options, Report, Samples, gain, scale, too_large};
use super::lanes::{LaneSum, largest};
use super::run::Outcome;
use crate::cancel::Cancel;
use crate::error::{Error, Result, fits_memory};
use crate::numeric::simd::Level;
use crate::synthesis::block::{Block, Class, Selection};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::direct;
use crate::synthesis::interval::Interval;
use crate::synthesis::plan::{self, Method, Plan, Request, Step};
use crate::synthesis::statistics::{self, Group};

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
    Level::check()?;
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
        let mut plan = job.plan(known_gain)?;
        fits_memory("grids", &[plan.memory()], 1)?;
        let (samples, outcomes) = job.run(&plan, is_single);
        options.cancel.map_or(Ok(()), Cancel::check)?;
        runs += 1;
        let power = job.power(&outcomes)?;
        if job.is_rescaled(&power) {
            continue;
        }
        let gain = gain(&samples, &power, waveform);
        if !gain.is_finite() {
            return Err(too_large(largest(series)));
        }
        job.compare(&mut plan, &outcomes, &power);
        let measured = interpolation(&outcomes, &power) * plan::fluctuation(waveform);
        // A few checks say less of paths that are unlike the samples.
        let interpolation = measured + (UNLIKE - 1.0) * (measured - plan.series()).max(0.0);
        // Errors allow for what is due to few samples.
        let coherent = (gain / plan::fluctuation(waveform)).max(1.0);
        if plan.error_with(interpolation, coherent) <= options.tolerance {
            let report = Report {
                plan,
                rows: outcomes.iter().map(|outcome| outcome.rows).sum(),
                rows_skipped: outcomes.iter().map(|outcome| outcome.rows_skipped).sum(),
                runs,
                gain,
            };
            return Ok((samples, report));
        }
        job.remember(&plan, &outcomes);
        if plan.error_with(0.0, coherent) > options.tolerance {
            // Paths add up in phase, and so do their errors.
            known_gain = coherent.max(1.01 * known_gain);
        }
        if interpolation > plan.series() {
            job.learn(&outcomes, interpolation / plan.series());
        }
    }
}

/// Error of the interpolation relative to l2(amplitudes), the largest of all channels.
fn interpolation(outcomes: &[Outcome], power: &[f64]) -> f64 {
    let of_channel = |(channel, power): (usize, &f64)| {
        let rest: f64 = outcomes.iter().filter_map(|outcome| outcome.rest.get(channel)).sum();
        if *power > 0.0 { (rest / power).sqrt() } else { 0.0 }
    };
    power.iter().enumerate().map(of_channel).fold(0.0, f64::max)
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

/// Safety factor of what paths have more than their samples.
const UNLIKE: f64 = 2.0;
/// Largest safety factor in single precision.
const MAX_SAFETY_FACTOR: f64 = 10.0;
/// Largest safety factor in double precision: beyond it the series do not describe the delays.
const MAX_DOUBLE_SAFETY_FACTOR: f64 = 1e4;
/// Gain that plans in single precision allow for: series for a larger one take more terms than a rare second run costs.
const RESERVE: f64 = 1.2;
/// Tolerances from which plans with that reserve are tried: smaller ones would need double precision.
const LEAST_RESERVED: f64 = 2e-6;

impl<'a> Job<'a> {
    fn new(waveform: &'a Waveform, series: &'a PathSeries<'a>, options: &'a Options<'a>) -> Result<Self> {
        // The direct sum needs no statistics, whatever the motion.
        let is_direct = options.method == Method::Direct || !series.can_be_planned(waveform);
        let mut job = Self {
            waveform,
            series,
            options,
            masks: Vec::new(),
            groups: Vec::new(),
            safety_factor: 1.0,
            allows_single: true,
            is_lost: false,
            scale: 1.0,
        };
        if is_direct {
            series.check_numbers()?;
            check_turns(waveform, longest_delay(waveform, series))?;
            job.groups.push((Class::Moving, Group::count(series)));
            return Ok(job);
        }
        job.classify();
        let frame = [Block::new(waveform, series, 0..waveform.chirp_times.len())];
        for i in 0..job.groups.len() {
            let ranges = job.delay_ranges(job.groups[i].0, &frame);
            job.groups[i].1.delay.extend(&ranges[0]);
        }
        let is_finite = |group: &Group| group.num_paths == 0 || group.delay.iter().all(|range| range.low.is_finite());
        if !job.groups.iter().all(|(_, group)| is_finite(group)) {
            series.check_numbers()?;
        }
        job.check_phases()?;
        job.check_power(job.groups.iter().flat_map(|(_, group)| &group.own))?;
        job.scale = scale(job.groups.iter().map(|(_, group)| group.largest).fold(0.0, f64::max));
        Ok(job)
    }

    /// Sort the paths by class, and sample each.
    fn classify(&mut self) {
        let (waveform, series, options) = (self.waveform, self.series, self.options);
        let is_constant = series.num_terms() == 1;
        // Recurrences bound what they leave out of long series of amplitudes.
        let take_all = options.method == Method::Recurrence && series.num_amplitude_terms() > 3;
        let all = Group::new(waveform, series, Selection::ALL, take_all);
        // A second pass over all paths is not worth its cost for a few still paths.
        let is_worth = |still: usize, moving: usize| options.split_still && 16 * still > moving;
        if is_constant && options.split_still {
            self.groups.push((Class::Still, all));
            return;
        }
        if !is_worth(all.num_still, all.num_sampled - all.num_still) {
            self.groups.push((Class::Moving, all));
            return;
        }
        self.masks = statistics::moving(series, options.level, options.is_parallel);
        let groups = [Class::Still, Class::Moving].map(|class| {
            let group = Group::new(waveform, series, self.selection(class), take_all);
            (class, group)
        });
        if is_worth(groups[0].1.num_paths, groups[1].1.num_paths) {
            self.groups.extend(groups);
        } else {
            self.masks.clear();
            self.groups.push((Class::Moving, all));
        }
    }

    /// Mean over the nodes of the squared l2 norm of the amplitudes per channel, by what the parts measured [W].
    fn power(&self, outcomes: &[Outcome]) -> Result<Vec<f64>> {
        let of_channel = |channel: usize| outcomes.iter().filter_map(|outcome| outcome.power.get(channel)).sum();
        let power: Vec<f64> = (0..self.series.num_channels).map(of_channel).collect();
        self.check_power(&power)?;
        Ok(power)
    }

    /// Refuse amplitudes whose squares are no finite numbers.
    fn check_power<'p>(&self, power: impl IntoIterator<Item = &'p f64>) -> Result<()> {
        if power.into_iter().all(|power| power.is_finite()) {
            return Ok(());
        }
        self.series.check_numbers()?;
        let got = format!("{:e}", largest(self.series));
        Err(Error::value("amplitude", "squares that are finite numbers", got))
    }

    /// True if amplitudes were far from those of the samples; their scale is another one then.
    fn is_rescaled(&mut self, power: &[f64]) -> bool {
        // Powers of two that single precision can hold with some room for sums and small parts.
        const USUAL: std::ops::RangeInclusive<f64> = -40.0..=40.0;
        let norm = power.iter().copied().fold(0.0, f64::max).sqrt();
        let (before, now) = (self.scale, scale(norm));
        if norm > 0.0 && !USUAL.contains(&(norm.log2() + before.log2())) {
            self.scale = now;
        }
        self.scale != before
    }

    /// Raise the errors of a plan to those for what the run measured, where samples suggested less.
    fn compare(&self, plan: &mut Plan, outcomes: &[Outcome], power: &[f64]) {
        for (part, outcome) in plan.parts.iter_mut().zip(outcomes) {
            if let Step::Grid { width, block_plans, .. } = &part.step {
                let kernel = (*width, block_plans.len());
                let bound = plan::kernel_error(self.waveform, part.class, kernel, outcome.coherence);
                part.kernel = part.kernel.max(bound);
                part.share = part.share.max(plan::share(&outcome.power, power));
            }
        }
    }

    /// Plan the next run for what this one has measured.
    fn remember(&mut self, plan: &Plan, outcomes: &[Outcome]) {
        let groups = self.groups.iter_mut().map(|(_, group)| group);
        let groups = groups.filter(|group| group.num_paths > 0);
        for ((part, outcome), group) in plan.parts.iter().zip(outcomes).zip(groups) {
            if let Step::Grid { block_plans, .. } = &part.step {
                group.measured = Some((block_plans.len(), outcome.coherence));
                group.own.clone_from(&outcome.power);
            }
        }
    }

    /// Add chunks of paths to the samples, whose interpolation errors were larger than predicted by a factor.
    fn learn(&mut self, outcomes: &[Outcome], factor: f64) {
        let selection = self.selection(Class::Moving);
        let chunks = outcomes.iter().flat_map(|outcome| &outcome.worst);
        let more: Vec<_> = chunks
            .flat_map(|(channel, chunk)| {
                let samples = statistics::samples_of(self.series, selection, *channel, *chunk);
                samples.into_iter().map(|sample| (*channel, sample))
            })
            .collect();
        if let Some((_, moving)) = self.groups.iter_mut().find(|(class, _)| *class == Class::Moving) {
            moving.add(more);
        }
        self.safety_factor *= (1.2 * factor).clamp(1.2, 3.0);
        if self.safety_factor > MAX_SAFETY_FACTOR && self.allows_single {
            // The remaining error may be rounding.
            (self.safety_factor, self.allows_single) = (1.0, false);
        }
        self.is_lost |= self.safety_factor > MAX_DOUBLE_SAFETY_FACTOR;
    }

    /// Ranges of the coefficients of the delays of the paths of a class in blocks [s], (block, degree).
    fn delay_ranges(&self, class: Class, blocks: &[Block]) -> Vec<Vec<Interval>> {
        let selection = self.selection(class);
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
            level: self.options.level,
        };
        request.plan(&self.groups, |blocks| self.delay_ranges(Class::Moving, blocks))
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
        let (samples, outcomes) = self.run(plan, false);
        self.power(&outcomes)
            .map_or(1.0, |power| gain(&samples, &power, self.waveform))
    }

    /// Refuse delays whose phases lose all digits.
    fn check_phases(&self) -> Result<()> {
        let groups = self.groups.iter().filter(|(_, group)| group.num_paths > 0);
        let longest = groups.map(|(_, group)| group.delay.iter().map(|range| range.magnitude()).sum::<f64>());
        check_turns(
            self.waveform,
            longest.fold(0.0, |a, b| if b.is_nan() || b > a { b } else { a }),
        )
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
    use crate::numeric::simd::Real;
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
    fn what_samples_miss_is_measured_and_planned_for() {
        let wf = waveform(32, 32, 1e9);
        let mut unit = units(3);
        let n = 40_000;
        let delay: Vec<f64> = (0..n).map(|_| 2.0 / C * (0.5 + 7.5 * unit())).collect();
        let rate: Vec<f64> = (0..n).map(|_| 2.0 / C * (6.0 * unit() - 3.0)).collect();
        let phases: Vec<f64> = (0..n).map(|_| 6.3 * unit()).collect();
        // Strong neighbours in one place, of which about one in 52 paths is a sample; a path beyond single precision.
        for (count, strong, tolerance) in [(50, 1e3, 8e-6), (1, 1e45, 1e-3)] {
            let mut runs = 0;
            for first in [5000, 20_000, 35_000] {
                let is_strong = |path: usize| (first..first + count).contains(&path);
                let of_place = |row: &[f64]| -> Vec<f64> {
                    (0..n)
                        .map(|path| row[if is_strong(path) { first } else { path }])
                        .collect()
                };
                let magnitude = |path: usize| if is_strong(path) { strong } else { 1.0 };
                let amplitude: Vec<Complex64> = (0..n)
                    .map(|path| Complex64::from_polar(magnitude(path) / strong, phases[path]))
                    .collect();
                let rows = [of_place(&delay), of_place(&rate)];
                let series = PathSeries {
                    basis: Basis::Taylor,
                    delay: &[&rows[0], &rows[1]],
                    amplitude: &[&amplitude],
                    num_channels: 1,
                    num_paths: n,
                };
                let options = Options {
                    tolerance,
                    method: Method::Grid,
                    ..Options::default()
                };
                let (samples, report) = beat_signal(&wf, &series, &options).unwrap();
                runs += report.runs;
                let exact = direct::beat_signal(&wf, &series, Class::All, Level::best(), true, None);
                let error = error(&samples, &exact, &amplitude);
                assert!(error <= tolerance, "{error:e} {}", report.plan);
            }
            assert!(runs > 3, "{strong:e}: all strong paths were samples");
        }
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
        assert!(report.gain > 1.5 && report.gain < 2.0, "{}", report.gain);
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
