//! What is done for which paths: a plain value, chosen from bounds on the paths by a model of cost.
//!
//! Errors are relative to l2(amplitudes) of a channel and hold for paths whose phases have nothing to do with each
//! other; where many add up in phase, `beat.rs` sees it in the result and asks for a smaller tolerance.

use std::f64::consts::TAU;
use std::fmt;

use crate::block::{Block, CHUNK, Class};
use crate::chirp::Waveform;
use crate::delay::{PathSeries, chebyshev_matrix};
use crate::expansion::{Expansion, Factor, FactorKind, MAX_BESSEL, Term, offset};
use crate::grid::{Layout, MAX_DEGREES, MAX_PARTS};
use crate::kernel::{DOUBLE_WIDTHS, KaiserBessel, OVERSAMPLING, SINGLE_WIDTHS};
use crate::lanes;
use crate::survey::{Group, Interval, Moments, Survey};

/// What is done with a class of paths.
#[derive(Clone, Debug)]
pub enum Step {
    /// Eq. (1) sample by sample in double precision.
    Direct,
    /// Direct sum with phasor recurrences.
    Recurrence {
        /// In single precision.
        is_single: bool,
    },
    /// Range grids of many chirps side by side in single precision, any motion.
    Lanes {
        /// Width of the kernel.
        width: usize,
        /// Follow the frequency within a chirp.
        follows_sweep: bool,
    },
    /// The range-velocity grid.
    Grid {
        /// In single precision.
        is_single: bool,
        /// Width of the kernel.
        width: usize,
        /// One expansion per block of chirps.
        expansions: Vec<Expansion>,
    },
}

impl Step {
    /// `direct`, `recurrence`, `lanes` or `grid`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Recurrence { .. } => "recurrence",
            Self::Lanes { .. } => "lanes",
            Self::Grid { .. } => "grid",
        }
    }

    /// True if sums are formed in single precision.
    pub fn is_single(&self) -> bool {
        match self {
            Self::Direct => false,
            Self::Lanes { .. } => true,
            Self::Recurrence { is_single } | Self::Grid { is_single, .. } => *is_single,
        }
    }

    /// Width of the kernel, if there is one.
    pub fn width(&self) -> Option<usize> {
        match self {
            Self::Direct | Self::Recurrence { .. } => None,
            Self::Lanes { width, .. } | Self::Grid { width, .. } => Some(*width),
        }
    }
}

/// One class of paths and what is done with it.
#[derive(Clone, Debug)]
pub struct Part {
    /// The class.
    pub class: Class,
    /// Its paths, over all channels.
    pub num_paths: usize,
    /// What is done.
    pub step: Step,
    /// Predicted error relative to l2(amplitudes).
    pub error: f64,
    /// Predicted time on one thread [s], of use for comparison only.
    pub cost: f64,
    /// Memory beside the input and the result [bytes].
    pub memory: usize,
}

/// What is done with all paths.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Classes, in the order of their sums.
    pub parts: Vec<Part>,
}

/// Which steps a plan may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The cheapest.
    Auto,
    /// Only the exact direct sum.
    Direct,
    /// Only the recurrence sum.
    Recurrence,
    /// Only chirp lanes.
    Lanes,
    /// Only the grid.
    Grid,
}

/// What a plan is made for.
pub struct Request<'a> {
    /// The waveform.
    pub waveform: &'a Waveform,
    /// The paths.
    pub series: &'a PathSeries<'a>,
    /// Bound on the error relative to l2(amplitudes).
    pub tolerance: f64,
    /// Allowed steps.
    pub method: Method,
    /// Largest rms of the samples of a channel relative to its l2(amplitudes), as far as it is known; at least 1.
    pub gain: f64,
}

/// Errors of rounding, relative to l2(amplitudes).
const SINGLE_ROUNDING: f64 = 3e-7;
const DOUBLE_ROUNDING: f64 = 3e-14;
/// Rounding of the sum of n numbers in a cell, one after the other: relative to their l2 norm it grows with sqrt(n); and
/// relative to the sum, with n, if they are nearly equal. Measured, in single precision.
const SINGLE_SUM: f64 = 6e-8;
const SINGLE_EQUAL_SUM: f64 = 6e-9;
/// Largest error of a kernel in blocks of one or two chirps, which are at the end of its range, over that in many.
const FEW_CHIRPS: f64 = 1.5;
/// Errors of the recurrence sums.
const SINGLE_RECURRENCE: f64 = 6e-6;
const DOUBLE_RECURRENCE: f64 = 5e-13;
/// Share of the tolerance that predicted errors may fill.
const MARGIN: f64 = 0.9;
/// rms over time and paths of a Chebyshev polynomial to the power of the order.
const ORDER_RMS: [f64; 7] = [1.0, 0.68, 0.53, 0.45, 0.40, 0.36, 0.33];
/// Most terms of an expansion, and most combinations that are looked at.
const MAX_TERMS: usize = 48;
const MAX_COMBINATIONS: usize = 3000;
/// Largest grid of one block with all its terms [numbers].
const MAX_GRID: usize = 1 << 23;
/// Most rows of a series that are planned for; beyond it, the direct sum.
pub const MAX_PLANNED_TERMS: usize = 64;

impl Request<'_> {
    /// The plan for some paths. None if the allowed steps cannot reach the tolerance.
    ///
    /// `look` surveys the paths in blocks.
    pub fn plan(&self, frame: &Survey, look: impl Fn(&[Block]) -> Survey) -> Option<Plan> {
        let mut plan = Plan::default();
        if self.method == Method::Direct && self.series.num_paths > 0 {
            plan.parts.push(Part {
                class: Class::All,
                num_paths: self.series.num_channels * self.series.num_paths,
                step: Step::Direct,
                error: 0.0,
                cost: 0.0,
                memory: 0,
            });
            return Some(plan);
        }
        let classes = [(Class::Still, &frame.still), (Class::Moving, &frame.moving)];
        let num_classes = classes.iter().filter(|(_, group)| group.num_paths > 0).count();
        for (class, group) in classes {
            if group.num_paths == 0 {
                continue;
            }
            // What a class has of the power, it may have of the error.
            let share = share(&group.own_power(), &frame.power);
            let tolerance = self.tolerance / (num_classes as f64).sqrt() / share.max(1e-30);
            let goal = Goal {
                request: self,
                // Paths in phase are as one path, and their place may be the worst.
                effective_paths: if self.gain > 1.5 { 1.0 } else { frame.effective_paths() },
                class,
                group,
                own: group.own_power(),
                tolerance: tolerance.max(self.tolerance).min(0.1_f64.max(self.tolerance)),
                share: share.min(1.0),
            };
            plan.parts.push(goal.part(&look)?);
        }
        Some(plan)
    }
}

impl Plan {
    /// Predicted error, relative to l2(amplitudes).
    pub fn error(&self) -> f64 {
        self.parts.iter().map(|part| part.error.powi(2)).sum::<f64>().sqrt()
    }

    /// Memory beside the input and the result [bytes].
    pub fn memory(&self) -> usize {
        self.parts.iter().map(|part| part.memory).max().unwrap_or(0)
    }
}

/// Largest share of the amplitude over the channels.
fn share(power: &[f64], total: &[f64]) -> f64 {
    power
        .iter()
        .zip(total)
        .map(|(part, total)| if *total > 0.0 { (part / total).sqrt() } else { 0.0 })
        .fold(0.0, f64::max)
}

/// The paths of one class and the error they may have, relative to their own l2(amplitudes).
struct Goal<'a> {
    request: &'a Request<'a>,
    class: Class,
    group: &'a Group,
    /// Power of the class, per channel: what its errors are relative to.
    own: Vec<f64>,
    tolerance: f64,
    share: f64,
    /// See [`Survey::effective_paths`].
    effective_paths: f64,
}

impl Goal<'_> {
    /// The cheapest step that reaches the tolerance.
    fn part(&self, look: impl Fn(&[Block]) -> Survey) -> Option<Part> {
        let method = self.request.method;
        // Series of more rows are not surveyed.
        let is_planned = self.request.series.num_delay_terms() <= MAX_PLANNED_TERMS;
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
            offer(Some(self.simple(Step::Direct, 0.0, 5.0)));
        }
        if allowed(Method::Recurrence) {
            // Chunks are summed first, and added up then.
            let equal = SINGLE_EQUAL_SUM * (self.request.gain.powi(2) / CHUNK as f64);
            let rest = self.recurrence_rest();
            let single = SINGLE_RECURRENCE.hypot(equal).hypot(rest);
            let double = DOUBLE_RECURRENCE.hypot(rest);
            if single <= MARGIN * self.tolerance {
                offer(Some(self.simple(
                    Step::Recurrence { is_single: true },
                    single,
                    0.1 * self.detail(),
                )));
            } else if double <= MARGIN * self.tolerance {
                offer(Some(self.simple(
                    Step::Recurrence { is_single: false },
                    double,
                    0.2 * self.detail(),
                )));
            }
        }
        // Planning a grid takes a fraction of a millisecond.
        let is_cheap = best.as_ref().is_some_and(|best| best.cost < 2e-4);
        if is_cheap {
            return best;
        }
        let mut offer = |part: Option<Part>| {
            if let Some(part) = part
                && best.as_ref().is_none_or(|best| part.cost < best.cost)
            {
                best = Some(part);
            }
        };
        if allowed(Method::Lanes) && self.class == Class::Moving {
            offer(self.lanes());
        }
        if allowed(Method::Grid) {
            let limit = best.as_ref().map_or(f64::INFINITY, |best| best.cost);
            if let Some(part) = self.grid(look, limit)
                && part.cost < limit
            {
                best = Some(part);
            }
        }
        best
    }

    /// How much more a path costs the recurrences if it has more than a delay and a rate.
    fn detail(&self) -> f64 {
        let series = self.request.series;
        let (delays, amplitudes) = (series.num_delay_terms() as f64, series.num_amplitude_terms() as f64);
        1.0 + 0.03 * (delays - 2.0).max(0.0) + 0.06 * (amplitudes - 1.0)
    }

    /// A step whose cost is a time per path and sample [ns].
    fn simple(&self, step: Step, error: f64, nanoseconds: f64) -> Part {
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
            error: error * self.share,
            cost: 1e-9 * nanoseconds * self.group.num_paths as f64 * (chirps * waveform.num_samples) as f64,
            memory: 0,
        }
    }

    /// Bound on what the recurrence sum leaves out: in a chirp it follows delays to fourth order in time, amplitudes to
    /// second.
    fn recurrence_rest(&self) -> f64 {
        let waveform = self.request.waveform;
        let frame = Block::new(waveform, self.request.series, 0..waveform.chirp_times.len());
        let ratio = waveform.half_sweep() / frame.half;
        // Taylor term n of T_k at an end of -1 ..= 1, where it is largest: prod_(i<n) (k^2 - i^2) / (2 i + 1) / n!.
        let term = |k: usize, n: usize| -> f64 {
            (0..n)
                .map(|i| ((k * k) as f64 - (i * i) as f64).max(0.0) / ((2 * i + 1) * (i + 1)) as f64 * ratio)
                .product()
        };
        let delay = &self.group.delay[0];
        let fifth: f64 = (5..delay.len()).map(|k| term(k, 5) * delay[k].magnitude()).sum();
        let top = waveform.start_frequency.abs()
            + waveform.slope.abs() * waveform.sample_time(waveform.num_samples - 1).abs();
        let power = &self.group.power[0];
        let third: f64 = (3..power.len()).map(|k| term(k, 3) * share(&power[k], &self.own)).sum();
        // rms of t^5 and t^3 over a chirp.
        (0.3 * TAU * top * fifth).hypot(0.38 * third)
    }

    /// Chirp lanes with the narrowest kernel.
    fn lanes(&self) -> Option<Part> {
        let waveform = self.request.waveform;
        let num_chirps = waveform.chirp_times.len();
        let frame = Block::new(waveform, self.request.series, 0..num_chirps);
        // Bounds of rate and acceleration: |T_k'| <= k^2, |T_k''| <= k^2 (k^2 - 1) / 3.
        let (mut rate, mut acceleration) = (0.0, 0.0);
        for (k, range) in self.group.delay[0].iter().enumerate().skip(1) {
            let square = (k * k) as f64;
            rate += square * range.magnitude() / frame.half;
            acceleration += square * (square - 1.0) / 3.0 * range.magnitude() / frame.half.powi(2);
        }
        let (slope, sweep) = (waveform.slope.abs(), waveform.half_sweep());
        let top = waveform.start_frequency.abs() + slope * (waveform.sample_time(waveform.num_samples - 1)).abs();
        let bend = TAU * (slope * rate + 0.5 * top * acceleration) * sweep * sweep;
        let skew = TAU * (0.5 * slope * acceleration) * sweep.powi(3);
        // Amplitudes are those in the middle of the chirp.
        let change: f64 = (1..self.group.power[0].len())
            .map(|k| (k * k) as f64 * share(&self.group.power[0][k], &self.own) * sweep / frame.half)
            .sum();
        let fixed = (0.3 * skew).hypot(change);
        let follows_sweep = (0.3 * bend).hypot(fixed) > 0.4 * self.tolerance;
        let rest = fixed.hypot(if follows_sweep { 0.035 * bend * bend } else { 0.3 * bend });
        let errors = |kernel: &Kernel| kernel.error.hypot(rest);
        // Lanes put their sums aside after this many paths.
        let is_allowed = |kernel: &Kernel| kernel.is_single && lanes::WIDTHS.contains(&kernel.width);
        let kernel = self
            .all_kernels(1.0, lanes::FLUSH as f64)
            .find(|kernel| is_allowed(kernel) && errors(kernel) <= MARGIN * self.tolerance)?;
        let lanes = 16;
        let groups = num_chirps.div_ceil(lanes);
        let group_time = 2.0 * frame.half * lanes as f64 / num_chirps.max(lanes) as f64;
        let cells = rate * group_time * slope / waveform.sample_rate * 2.0 * waveform.num_samples as f64;
        let w = kernel.width as f64;
        let series = self.request.series;
        let rows = 2.0 * (series.num_delay_terms() as f64 - 2.0).max(0.0)
            + if series.num_amplitude_terms() > 1 {
                4.0 * series.num_amplitude_terms() as f64
            } else {
                0.0
            };
        let second = if follows_sweep { 15.0 } else { 0.0 };
        let per_path = 50.0 + 2.0 * (w - 4.0) + second + rows + 10.0 * cells;
        let per_group = 16.0 * waveform.num_samples as f64 * 8.0;
        Some(Part {
            class: self.class,
            num_paths: self.group.num_paths,
            step: Step::Lanes {
                width: kernel.width,
                follows_sweep,
            },
            error: errors(&kernel) * self.share,
            cost: 1e-9
                * groups as f64
                * (self.group.num_paths as f64 * per_path + self.request.series.num_channels as f64 * per_group),
            memory: 0,
        })
    }

    /// The grid with the best width and number of blocks, if it seems cheaper than `limit` [s].
    fn grid(&self, look: impl Fn(&[Block]) -> Survey, limit: f64) -> Option<Part> {
        let request = self.request;
        let (waveform, series) = (request.waveform, request.series);
        let num_chirps = waveform.chirp_times.len();
        let counts: Vec<usize> = if self.class == Class::Still {
            vec![1]
        } else {
            std::iter::successors(Some(1), |n| Some(2 * n))
                .take_while(|n| *n <= num_chirps)
                .collect()
        };
        // Estimate by bounds that follow from those of the whole frame.
        let mut best: Option<(f64, usize, Kernel)> = None;
        for count in counts {
            let blocks = Block::split(waveform, series, count);
            let sample: Vec<usize> = if count > 2 {
                vec![0, count / 2, count - 1]
            } else {
                (0..count).collect()
            };
            for kernel in self.kernels(num_chirps / count) {
                let mut cost = 0.0;
                let is_feasible = sample.iter().all(|i| {
                    let bounds = self.enclose(&blocks[*i]);
                    self.expand(&blocks[*i], &bounds, kernel).is_some_and(|(expansion, _)| {
                        cost += self.cost(kernel, &expansion) * count as f64 / sample.len() as f64;
                        true
                    })
                });
                if is_feasible && best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                    best = Some((cost, count, kernel));
                }
            }
            // More blocks only help where there are terms to save or rows are many: each spreads all paths.
            if let Some((least, best_count, kernel)) = best
                && (count >= 4 * best_count || least <= 2.0 * count as f64 * self.spread_cost(kernel, 1))
            {
                break;
            }
        }
        let (estimate, count, kernel) = best?;
        if estimate >= limit {
            // What is at hand is cheaper: no need to look at the paths again.
            return None;
        }
        let blocks = Block::split(waveform, series, count);
        let survey = (count > 1).then(|| look(&blocks));
        let mut expansions = Vec::new();
        let (mut error, mut cost): (f64, f64) = (0.0, 0.0);
        for (i, block) in blocks.iter().enumerate() {
            let bounds = match &survey {
                None => self.enclose(block),
                Some(survey) => Bounds {
                    delay: survey.moving.delay[i].clone(),
                    amplitude: survey.moving.power[i].iter().map(|p| share(p, &self.own)).collect(),
                    moments: weighted(&survey.moving.moments[i], &survey.moving.power[i][0]),
                },
            };
            let (expansion, expected) = self.expand(block, &bounds, kernel)?;
            cost += self.cost(kernel, &expansion);
            error = error.max(expected);
            expansions.push(expansion);
        }
        // Parts of the paths have grids of their own; so have channels and blocks, on as many threads as there may be.
        let grids = (series.num_channels * count).clamp(MAX_PARTS, 16);
        let numbers = expansions
            .iter()
            .map(|e| e.terms.len() * Layout::new(waveform.num_samples, kernel.width, e.rows).size())
            .max()
            .unwrap_or(0);
        Some(Part {
            class: self.class,
            num_paths: self.group.num_paths,
            step: Step::Grid {
                is_single: kernel.is_single,
                width: kernel.width,
                expansions,
            },
            error: error * self.share,
            cost,
            memory: (grids + 1) * numbers * if kernel.is_single { 4 } else { 8 },
        })
    }

    /// All kernels, the fastest first; `stress` multiplies the kernel's error, `most` numbers are added one after the
    /// other.
    fn all_kernels(&self, stress: f64, most: f64) -> impl Iterator<Item = Kernel> + use<> {
        let num_points = self.effective_paths;
        let widths = SINGLE_WIDTHS
            .map(|width| (true, width))
            .into_iter()
            .chain(DOUBLE_WIDTHS.map(|width| (false, width)));
        let single = self.single_rounding(most);
        widths.map(move |(is_single, width)| Kernel {
            is_single,
            width,
            error: (stress * KaiserBessel::error(width, num_points)).hypot(if is_single {
                single
            } else {
                DOUBLE_ROUNDING
            }),
        })
    }

    /// Rounding of sums in single precision, of which at most `most` numbers are added one after the other.
    fn single_rounding(&self, most: f64) -> f64 {
        let (waveform, series) = (self.request.waveform, self.request.series);
        // Cells between the nearest and the farthest path.
        let span = 2.0 * self.group.delay[0][0].half() * (waveform.slope / waveform.sample_rate).abs();
        let cells = 1.0 + span.min(1.0) * (OVERSAMPLING * waveform.num_samples) as f64;
        let paths = (self.group.num_paths as f64 / series.num_channels as f64).min(most);
        // The paths of a cell that add up in phase are gain^2.
        let equal = self.request.gain.powi(2).min(most);
        SINGLE_ROUNDING
            .hypot(SINGLE_SUM * (paths / cells).sqrt())
            .hypot(SINGLE_EQUAL_SUM * equal)
    }

    /// Kernels that leave room for other errors in blocks of so many chirps: the narrowest, and the next one.
    fn kernels(&self, num_chirps: usize) -> Vec<Kernel> {
        let stress = if num_chirps <= 2 { FEW_CHIRPS } else { 1.0 };
        let fitting = self
            .all_kernels(stress, f64::INFINITY)
            .filter(|kernel| kernel.error <= 0.85 * self.tolerance);
        let mut kernels: Vec<Kernel> = fitting.take(2).collect();
        if let [first, second] = kernels[..]
            && first.is_single != second.is_single
        {
            kernels.pop();
        }
        kernels
    }

    /// Predicted time to spread all paths on the grids of some terms [s].
    fn spread_cost(&self, kernel: Kernel, num_terms: usize) -> f64 {
        let w = kernel.width as f64;
        let (first, further) = if kernel.is_single {
            (7.0 + 1.2 * w, 0.5 + 1.0 * w)
        } else {
            (8.0 + 2.2 * w, 2.0 * w)
        };
        1e-9 * self.group.num_paths as f64 * (first + further * (num_terms as f64 - 1.0))
    }

    /// Predicted time of one block [s].
    fn cost(&self, kernel: Kernel, expansion: &Expansion) -> f64 {
        let terms = expansion.terms.len() as f64;
        let channels = self.request.series.num_channels as f64;
        let samples = self.request.waveform.num_samples as f64 / 128.0;
        let slow = 0.6 + 0.01 * expansion.block.chirps.len() as f64;
        let scale = if kernel.is_single { 1.0 } else { 2.0 };
        let transform = if expansion.rows == 1 {
            1e3
        } else {
            1e3 * expansion.rows as f64 * terms * slow * samples * scale
        };
        // Every block reads all rows of the series: those of amplitudes are twice as long.
        let series = self.request.series;
        let rows =
            2.0 * (series.num_delay_terms() as f64 - 2.0).max(0.0) + 3.0 * (series.num_amplitude_terms() as f64 - 1.0);
        let reading = rows * self.group.num_paths as f64;
        self.spread_cost(kernel, expansion.terms.len()) + 1e-9 * (reading + channels * (transform + 1e3))
    }

    /// Bounds in a block that follow from those of the frame.
    fn enclose(&self, block: &Block) -> Bounds {
        let (waveform, series) = (self.request.waveform, self.request.series);
        let num_chirps = waveform.chirp_times.len();
        let whole = &self.group.delay[0];
        let shares: Vec<f64> = self.group.power[0].iter().map(|p| share(p, &self.own)).collect();
        if block.chirps.len() == num_chirps {
            return Bounds {
                delay: whole.clone(),
                amplitude: shares,
                moments: weighted(&self.group.moments[0], &self.group.power[0][0]),
            };
        }
        let frame = Block::new(waveform, series, 0..num_chirps);
        let delay_map = restriction(&frame, block, whole.len());
        let amplitude_map = restriction(&frame, block, shares.len());
        let delay = delay_map
            .iter()
            .map(|row| {
                row.iter()
                    .zip(whole)
                    .fold(Interval::ZERO, |sum, (factor, range)| sum.plus(range.scaled(*factor)))
            })
            .collect();
        let amplitude = amplitude_map
            .iter()
            .map(|row| row.iter().zip(&shares).map(|(f, s)| f.abs() * s).sum())
            .collect();
        // Rates are those of the frame: good enough to choose the number of blocks.
        let square = (block.half / frame.half).powi(2);
        let moments: Vec<Moments> = self.group.moments[0].iter().map(|m| m.scaled(square)).collect();
        Bounds {
            delay,
            amplitude,
            moments: weighted(&moments, &self.group.power[0][0]),
        }
    }

    /// How the paths are expanded in a block, and the error that is expected. None if the tolerance cannot be reached.
    #[allow(clippy::too_many_lines)] // one derivation, read from top to bottom
    fn expand(&self, block: &Block, bounds: &Bounds, kernel: Kernel) -> Option<(Expansion, f64)> {
        let waveform = self.request.waveform;
        let tolerance = self.tolerance;
        let delay = &bounds.delay;
        let num_given = delay.len();
        let slope = waveform.slope;
        let middle_delay = delay[0].middle();
        let carrier = waveform.start_frequency + slope * (waveform.middle_time() - middle_delay);
        if self.class == Class::Still {
            let expansion = Expansion {
                block: block.clone(),
                carrier,
                middle_delay,
                middle_rate: 0.0,
                step: 1.0,
                rows: 1,
                num_degrees: 1,
                num_squared: 0,
                factors: Vec::new(),
                terms: vec![Term {
                    amplitude: 0,
                    orders: Vec::new(),
                }],
            };
            return Some((expansion, kernel.error));
        }

        // The square of the delay's change: as many degrees as count.
        let sizes: Vec<f64> = delay.iter().map(|range| range.magnitude()).collect();
        let total: f64 = sizes[1..].iter().sum();
        let dropped_square = |num: usize| {
            let kept: f64 = sizes[1..=num].iter().sum();
            TAU * 0.5 * slope.abs() * (total * total - kept * kept)
        };
        let num_squared = (0..num_given)
            .find(|num| dropped_square(*num) <= 0.02 * tolerance)
            .unwrap_or(num_given - 1);
        if 2 * num_squared + 1 > MAX_DEGREES {
            return None;
        }
        let num_degrees = num_given.max(2 * num_squared + 1).max(2);
        let mut squares = vec![Interval::ZERO; num_degrees];
        for a in 1..=num_squared {
            for b in 1..=num_squared {
                let product = if a == b {
                    delay[a].squared()
                } else {
                    delay[a].times(delay[b])
                };
                for at in [a + b, a.abs_diff(b)] {
                    squares[at] = squares[at].plus(product.scaled(0.5));
                }
            }
        }
        let mut left_over = dropped_square(num_squared).powi(2);

        // Terms of the phase.
        let bend = 0.5 * slope / carrier;
        let stretch = Interval {
            low: delay[0].low - middle_delay,
            high: delay[0].high - middle_delay,
        }
        .scaled(2.0 * bend);
        let unstretched = Interval {
            low: 1.0 - stretch.high,
            high: 1.0 - stretch.low,
        };
        let given = |k: usize| delay.get(k).copied().unwrap_or(Interval::ZERO);
        let phase_term = |k: usize| given(k).times(unstretched).plus(squares[k].scaled(-bend));
        let half_sweep = waveform.half_sweep();
        let sweep_term = |k: usize| {
            stretch
                .times(given(k))
                .plus(squares[k].scaled(bend))
                .scaled(slope * half_sweep)
        };

        // Velocity axis; one part in 10^9 for rounding.
        let rate = phase_term(1).scaled(block.half.recip());
        let keystone = Expansion::max_keystone(waveform, block, carrier);
        let step = if keystone > 0.0 { 0.25 / keystone } else { 1.0 };
        let span = (rate.high - rate.low) / step * (1.0 + 1e-9) + 1e-6;
        if !span.is_finite() || span > 1e7 {
            return None;
        }
        let rows = (span.ceil() as usize + kernel.width + 2).next_multiple_of(2);

        // Factors, where what they leave is too much. Phases first: their products are the larger ones.
        // In a part of the frame amplitudes may be larger than in the mean.
        let kernel_error = kernel.error * bounds.level();
        let budget = ((MARGIN * tolerance).powi(2) - kernel_error.powi(2)).max(0.0).sqrt();
        let top = carrier.abs() + slope.abs() * half_sweep;
        let mut factors = Vec::new();
        let mut spreads = Vec::new();
        let candidates = (2..num_degrees)
            .map(|k| (FactorKind::Phase(k), phase_term(k), top))
            .chain((1..num_degrees).map(|k| (FactorKind::Sweep(k), sweep_term(k), 1.0)));
        for (kind, term, largest_basis) in candidates {
            let whole = 0.7 * TAU * largest_basis * term.magnitude();
            if whole <= 0.03 * budget {
                left_over += whole * whole;
                continue;
            }
            let z = TAU * largest_basis * term.half();
            let (FactorKind::Phase(degree) | FactorKind::Sweep(degree)) = kind;
            if z > MAX_BESSEL || degree >= MAX_DEGREES {
                return None;
            }
            factors.push(Factor {
                kind,
                middle: term.middle(),
                half: term.half(),
                max_order: 0,
                is_expanded: true,
            });
            // Where the bound of every path is too coarse, the rms over all of them.
            let path_rms = match kind {
                FactorKind::Sweep(1) => {
                    let skew = bounds.rms(|moments, _| moments.skew_about(middle_delay));
                    let rest = bend.abs() * squares[1].magnitude();
                    slope.abs() * half_sweep * (2.0 * bend.abs() * skew + rest) + term.middle().abs()
                }
                FactorKind::Phase(2) if num_given == 2 && num_squared == 1 => {
                    // e = -bend c_1^2 / 2
                    let square = -2.0 * term.middle() / bend;
                    0.5 * bend.abs()
                        * bounds.rms(|m, power| (m.fourth + square * (square * power - 2.0 * m.skew[0])).max(0.0))
                }
                _ => f64::INFINITY,
            };
            let fast_rms = match kind {
                FactorKind::Phase(_) => 1.0,
                FactorKind::Sweep(_) => (1.0 + 2.0 / (waveform.num_samples as f64).powi(2)).sqrt() / 3f64.sqrt(),
            };
            let rms = if path_rms.is_finite() {
                TAU * largest_basis * path_rms * fast_rms * time_rms(waveform, block, degree)
            } else {
                f64::INFINITY
            };
            spreads.push(Spread {
                z,
                rms: rms.min(ORDER_RMS[1] * z),
            });
        }
        let used_degrees = factors
            .iter()
            .map(|factor| match factor.kind {
                FactorKind::Phase(k) | FactorKind::Sweep(k) => k + 1,
            })
            .max()
            .unwrap_or(2)
            .max(num_squared + 1)
            .max(2);

        let budget = (budget * budget - left_over).max(0.0).sqrt();
        let (terms, omitted) = choose_terms(&bounds.amplitude, &spreads, budget)?;
        for (i, factor) in factors.iter_mut().enumerate() {
            factor.max_order = terms.iter().map(|term| term.orders[i]).max().unwrap_or(0);
            // 1 - J_0(z) < z^2 / 4: less than the first order, which was left out.
            factor.is_expanded = factor.max_order > 0 || spreads[i].z > 0.1 * budget;
        }
        let size = Layout::new(waveform.num_samples, kernel.width, rows).size();
        if terms.len().saturating_mul(size) > MAX_GRID {
            return None;
        }
        let error = (kernel_error.powi(2) + left_over + omitted * omitted).sqrt();
        if error > tolerance {
            return None;
        }
        let expansion = Expansion {
            block: block.clone(),
            carrier,
            middle_delay,
            middle_rate: rate.middle(),
            step,
            rows,
            num_degrees: used_degrees,
            num_squared,
            factors,
            terms,
        };
        Some((expansion, error))
    }
}

/// A kernel of the grid and its error.
#[derive(Clone, Copy, Debug)]
struct Kernel {
    is_single: bool,
    width: usize,
    error: f64,
}

/// Bounds on the paths in a block.
struct Bounds {
    /// Coefficients of the delay by degree [s].
    delay: Vec<Interval>,
    /// l2 norm of the coefficients of the amplitude by degree, relative to l2(amplitudes).
    amplitude: Vec<f64>,
    /// Moments of every channel and its power; none if they are not known.
    moments: Vec<(Moments, f64)>,
}

impl Bounds {
    /// rms over the paths, weighted with their power, of what is summed in the moments.
    fn rms(&self, sum: impl Fn(&Moments, f64) -> f64) -> f64 {
        if self.moments.is_empty() {
            return f64::INFINITY;
        }
        let squares = self.moments.iter().map(|(moments, power)| sum(moments, *power) / power);
        squares.fold(0.0, f64::max).sqrt()
    }
}

/// Moments of the channels that have any power; none where powers are so small or large that products vanish.
fn weighted(moments: &[Moments], power: &[f64]) -> Vec<(Moments, f64)> {
    let all = moments.iter().copied().zip(power.iter().copied());
    let known: Vec<(Moments, f64)> = all.filter(|(_, power)| *power > 0.0).collect();
    if known.iter().any(|(_, power)| !(1e-200..1e200).contains(power)) {
        return Vec::new();
    }
    known
}

/// What a factor leaves if it is not expanded.
struct Spread {
    /// Largest argument of its Bessel functions.
    z: f64,
    /// rms of its first order over paths and time.
    rms: f64,
}

/// rms over the chirps of a block of a Chebyshev polynomial of time, the largest value at the middle and the ends of each.
fn time_rms(waveform: &Waveform, block: &Block, degree: usize) -> f64 {
    let sweep = waveform.half_sweep();
    let squares = (0..block.chirps.len()).map(|c| {
        let middle = offset(waveform, block, c);
        let squares = [middle - sweep, middle, middle + sweep].map(|time| {
            let x = (time / block.half).clamp(-1.0, 1.0);
            (degree as f64 * x.acos()).cos().powi(2)
        });
        squares.into_iter().fold(0.0, f64::max)
    });
    (squares.sum::<f64>() / block.chirps.len() as f64).sqrt()
}

impl Bounds {
    /// l2 norm of the amplitudes in the block, relative to that in the frame; at least 1.
    fn level(&self) -> f64 {
        let change: f64 = self.amplitude[1..].iter().map(|share| 0.5 * share * share).sum();
        (self.amplitude[0].powi(2) + change).sqrt().max(1.0)
    }
}

/// Matrix from Chebyshev coefficients on one interval to those on a part of it.
fn restriction(whole: &Block, part: &Block, terms: usize) -> Vec<Vec<f64>> {
    let to_part = chebyshev_matrix(terms);
    let mut values = vec![vec![0.0; terms]; terms];
    for (j, row) in values.iter_mut().enumerate() {
        let x = -(std::f64::consts::PI * (2 * j + 1) as f64 / (2 * terms) as f64).cos();
        let at = whole.x(part.center + part.half * x);
        for k in 0..terms {
            row[k] = match k {
                0 => 1.0,
                1 => at,
                _ => 2.0 * at * row[k - 1] - row[k - 2],
            };
        }
    }
    (0..terms)
        .map(|k| {
            (0..terms)
                .map(|n| (0..terms).map(|j| to_part[k * terms + j] * values[j][n]).sum())
                .collect()
        })
        .collect()
}

/// Terms by falling bound until what is left out is within the budget; None if they are too many.
fn choose_terms(amplitude: &[f64], spreads: &[Spread], budget: f64) -> Option<(Vec<Term>, f64)> {
    // Bound of order n of a factor: r_n 2 J_n(z) <= r_n 2 (z/2)^n / n!.
    let order_bound = |spread: &Spread, n: usize| -> f64 {
        let z = spread.z;
        if n == 0 {
            return 1.0;
        }
        if n == 1 {
            return spread.rms.min(1.2 * ORDER_RMS[1]);
        }
        let power = (1..=n).fold(2.0, |product, k| product * 0.5 * z / k as f64);
        power.min(1.2) * ORDER_RMS[n.min(ORDER_RMS.len() - 1)]
    };
    let least = budget / 30.0;
    if least <= 0.0 && !spreads.is_empty() {
        return None;
    }
    let mut found: Vec<(f64, Term)> = Vec::new();
    let mut tail = 0.0;
    for (degree, share) in amplitude.iter().enumerate() {
        // Chebyshev polynomials of time have rms 0.7.
        let bound = if degree == 0 { share.max(1e-30) } else { 0.7 * share };
        let mut partial = vec![(bound, Vec::new())];
        for spread in spreads {
            let mut next = Vec::new();
            for (bound, orders) in partial {
                for n in 0.. {
                    let product = bound * order_bound(spread, n);
                    // Beyond its largest order, a factor's bounds fall faster than geometrically.
                    if product < least && n as f64 > 0.5 * spread.z {
                        tail += product * product;
                        break;
                    }
                    let mut longer: Vec<usize> = orders.clone();
                    longer.push(n);
                    next.push((product, longer));
                }
                if next.len() > MAX_COMBINATIONS {
                    return None;
                }
            }
            partial = next;
        }
        found.extend(partial.into_iter().map(|(bound, orders)| {
            (
                bound,
                Term {
                    amplitude: degree,
                    orders,
                },
            )
        }));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    // Leave out from the small end.
    let mut omitted = 2.0 * tail;
    while let Some((bound, _)) = found.last() {
        if found.len() == 1 || omitted + bound * bound > budget * budget {
            break;
        }
        omitted += bound * bound;
        found.pop();
    }
    if found.len() > MAX_TERMS || omitted > budget * budget {
        return None;
    }
    Some((found.into_iter().map(|(_, term)| term).collect(), omitted.sqrt()))
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, part) in self.parts.iter().enumerate() {
            if i > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{part}")?;
        }
        if self.parts.is_empty() {
            f.write_str("no paths")?;
        }
        Ok(())
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let precision = |is_single: bool| if is_single { "single" } else { "double" };
        let class = match self.class {
            Class::Still => "still ",
            Class::Moving => "moving ",
            Class::All => "",
        };
        write!(f, "{} {class}paths: ", self.num_paths)?;
        match &self.step {
            Step::Direct => write!(f, "direct sum, double precision"),
            Step::Recurrence { is_single } => write!(f, "recurrence sum, {} precision", precision(*is_single)),
            Step::Lanes { width, .. } => write!(f, "chirp lanes, single precision, kernel of {width} cells"),
            Step::Grid {
                is_single,
                width,
                expansions,
            } => {
                let rows = expansions.iter().map(|e| e.rows).max().unwrap_or(0);
                let terms: Vec<String> = expansions.iter().map(|e| e.terms.len().to_string()).collect();
                write!(
                    f,
                    "grid, {} precision, kernel of {width} cells, {} block{}, {rows} velocity row{}, {} term{}",
                    precision(*is_single),
                    expansions.len(),
                    if expansions.len() == 1 { "" } else { "s" },
                    if rows == 1 { "" } else { "s" },
                    terms.join("+"),
                    if terms == ["1"] { "" } else { "s" },
                )
            }
        }?;
        write!(f, ", error {:.1e}", self.error)
    }
}
