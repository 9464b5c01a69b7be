//! Choice of the cheapest steps that reach the tolerance.

use std::cell::RefCell;
use std::f64::consts::TAU;

use super::goal::{Goal, MARGIN, Request, SINGLE_EQUAL_SUM};
use super::parts::{Method, Part, Plan, Step};
use super::times;
use crate::synthesis::block::{Block, CHUNK, Class};
use crate::synthesis::interval::Interval;
use crate::synthesis::statistics::Group;

/// Errors of the recurrence sums, relative to l2(amplitudes).
const SINGLE_RECURRENCE: f64 = 6e-6;
const DOUBLE_RECURRENCE: f64 = 5e-13;

impl Request<'_> {
    /// Plan of the sum. None if the allowed steps cannot reach the tolerance.
    ///
    /// `delay_ranges` returns the ranges of the coefficients of the delays of moving paths in blocks [s].
    pub fn plan(
        &self,
        groups: &[(Class, Group)],
        delay_ranges: impl Fn(&[Block]) -> Vec<Vec<Interval>>,
    ) -> Option<Plan> {
        let mut plan = Plan {
            gain: self.gain,
            ..Plan::default()
        };
        if self.method == Method::Direct && self.series.num_paths > 0 {
            plan.parts.push(Part {
                class: Class::All,
                num_paths: self.series.num_channels * self.series.num_paths,
                step: Step::Direct,
                share: 1.0,
                kernel: 0.0,
                rounding: 0.0,
                equal: 0.0,
                series: 0.0,
                cost: 0.0,
                memory: 0,
            });
            return Some(plan);
        }
        let groups = groups.iter().filter(|(_, group)| group.num_paths > 0);
        let num_classes = groups.clone().count();
        let total = |channel: usize| groups.clone().map(|(_, group)| group.own[channel]).sum();
        let power: Vec<f64> = (0..self.series.num_channels).map(total).collect();
        for (class, group) in groups.clone() {
            // Share of the error of a class: its share of the power.
            let share = share(&group.own, &power);
            let tolerance = self.tolerance / (num_classes as f64).sqrt() / share.max(1e-30);
            let goal = Goal {
                request: self,
                class: *class,
                group,
                tolerance: tolerance.max(self.tolerance).min(0.1_f64.max(self.tolerance)),
                share: share.min(1.0),
                scratch: RefCell::default(),
            };
            plan.parts.push(goal.part(&delay_ranges)?);
        }
        Some(plan)
    }
}

/// Largest ratio of rms amplitudes over the channels.
pub fn share(power: &[f64], total: &[f64]) -> f64 {
    power
        .iter()
        .zip(total)
        .map(|(part, total)| if *total > 0.0 { (part / total).sqrt() } else { 0.0 })
        .fold(0.0, f64::max)
}

impl Goal<'_> {
    /// The cheapest step that reaches the tolerance.
    fn part(&self, delay_ranges: impl Fn(&[Block]) -> Vec<Vec<Interval>>) -> Option<Part> {
        let method = self.request.method;
        // Series of more rows have no statistics.
        let is_planned = self.request.series.can_be_planned(self.request.waveform);
        let allowed =
            |wanted: Method| (method == wanted || method == Method::Auto) && (is_planned || wanted == Method::Direct);
        let mut best: Option<Part> = None;
        let mut offer = |part: Option<Part>| {
            if let Some(part) = part
                && best.as_ref().is_none_or(|best| part.cost < best.cost)
            {
                best = Some(part);
            }
        };
        if allowed(Method::Direct) {
            offer(Some(self.simple(Step::Direct, (0.0, 0.0), times::DIRECT)));
        }
        // What amplitudes of many terms leave out is known of sampled paths alone.
        let is_known = self.group.num_sampled == self.group.num_paths || self.group.power.len() <= 3;
        if allowed(Method::Recurrence) && is_known {
            // Chunks are summed one by one, then added up.
            let equal = SINGLE_EQUAL_SUM / CHUNK as f64;
            let [single_rest, double_rest] = self.recurrence_rest();
            let single = (SINGLE_RECURRENCE.hypot(single_rest), equal);
            let double = (DOUBLE_RECURRENCE.hypot(double_rest), 0.0);
            let Request { gain, series, .. } = *self.request;
            let terms = (series.num_delay_terms(), series.num_amplitude_terms());
            let time = |is_single| times::recurrence_of_sample(is_single, terms);
            let is_enough =
                |(rounding, equal): (f64, f64)| gain * rounding.hypot(gain * gain * equal) <= MARGIN * self.tolerance;
            // In single precision on request alone: sums in lanes and the grid are faster.
            if method == Method::Recurrence && is_enough(single) {
                let step = Step::Recurrence { is_single: true };
                offer(Some(self.simple(step, single, time(true))));
            } else if is_enough(double) {
                let step = Step::Recurrence { is_single: false };
                offer(Some(self.simple(step, double, time(false))));
            }
        }
        let is_cheap = best.as_ref().is_some_and(|best| best.cost < times::NO_NUFFT);
        if is_cheap {
            return best;
        }
        if allowed(Method::Grid) {
            let limit = best.as_ref().map_or(f64::INFINITY, |best| best.cost);
            if let Some(part) = self.grid(delay_ranges, limit)
                && part.cost < limit
            {
                best = Some(part);
            }
        }
        best
    }

    /// Part of a step by its errors, [`Part::rounding`] and [`Part::equal`], and a time per path and sample [s].
    fn simple(&self, step: Step, (rounding, equal): (f64, f64), time: f64) -> Part {
        let waveform = self.request.waveform;
        let chirps = if self.class == Class::Still && matches!(step, Step::Direct) {
            1
        } else {
            waveform.chirp_times.len()
        };
        Part {
            class: self.class,
            num_paths: self.group.num_paths,
            step,
            share: self.share,
            kernel: 0.0,
            rounding,
            equal,
            series: 0.0,
            cost: time * self.group.num_paths as f64 * (chirps * waveform.num_samples) as f64,
            memory: 0,
        }
    }

    /// Bounds of the truncation errors of the recurrence sums in single and in double precision. Within a chirp the
    /// sums follow phases to third and to fourth order in time, amplitudes to second. Double precision leaves out the
    /// squares of the delays in the fourth order, and all of the fifth.
    fn recurrence_rest(&self) -> [f64; 2] {
        let waveform = self.request.waveform;
        let frame = Block::new(waveform, self.request.series, 0..waveform.chirp_times.len());
        let ratio = waveform.half_sweep() / frame.half;
        // Taylor term n of T_k at an end of -1 ..= 1, where it is largest: prod_(i<n) (k^2 - i^2) / (2 i + 1) / n!.
        let term = |k: usize, n: usize| -> f64 {
            (0..n)
                .map(|i| ((k * k) as f64 - (i * i) as f64).max(0.0) / ((2 * i + 1) * (i + 1)) as f64 * ratio)
                .product()
        };
        let delay = &self.group.delay;
        let order = |n: usize| -> f64 { (n..delay.len()).map(|k| term(k, n) * delay[k].magnitude()).sum() };
        let top = waveform.start_frequency.abs()
            + waveform.slope.abs() * waveform.sample_time(waveform.num_samples - 1).abs();
        let power = &self.group.power;
        let third: f64 = (3..power.len())
            .map(|k| term(k, 3) * share(&power[k], &self.group.own))
            .sum();
        // rms of t^3, t^4 and t^5 over a chirp.
        let sweep = waveform.slope.abs() * waveform.half_sweep();
        let squares = waveform.slope.abs() * (0.5 * order(2).powi(2) + order(1) * order(3));
        let fifth = 0.3 * TAU * (top * order(5) + sweep * order(4));
        let fourth = 0.33 * TAU * squares;
        // Phases that bend within the shortest segment, of two samples to either side, are followed to seventh order.
        let samples = waveform.half_sweep() * waveform.sample_rate;
        let bend = TAU * (top * (order(2) + 3.0 * order(3) + 6.0 * order(4)) + sweep * order(1));
        let within = (bend * (2.0_f64.min(samples) / samples).powi(2)).powi(4) / 24.0;
        let double = fifth.hypot(fourth).hypot(0.38 * third).hypot(within);
        [double.hypot(0.33 * TAU * top * order(4)), double]
    }
}
