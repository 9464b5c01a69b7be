//! Plans of the NUFFT: kernel, blocks of chirps, velocity rows, terms of the cross approximation.

use std::f64::consts::TAU;

use super::goal::{Goal, Kernel, MARGIN, SINGLE_EQUAL_SUM, fluctuation};
use super::parts::{Part, Step, in_phase};
use super::times;
use crate::synthesis::block::{Block, Class};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::interval::Interval;
use crate::synthesis::low_rank::block_plan::BlockPlan;
use crate::synthesis::low_rank::cross_approximation::{self, CrossApproximation};
use crate::synthesis::low_rank::residual_phase::{Frame, Instant, Path};
use crate::synthesis::nufft::kernel::{DOUBLE_WIDTHS, KaiserBessel, OVERSAMPLING, SINGLE_WIDTHS};
use crate::synthesis::nufft::{Layout, MAX_CHANNELS, MAX_PARTS};

/// Rounding errors, relative to l2(amplitudes).
const SINGLE_ROUNDING: f64 = 3e-7;
const DOUBLE_ROUNDING: f64 = 3e-14;
/// Rounding of the sum of n numbers of a cell in single precision, one after the other, relative to their l2 norm and
/// sqrt(n); measured.
const SINGLE_SUM: f64 = 6e-8;
/// Largest error of a kernel in blocks of one or two chirps, at the end of its range, over that in blocks of many.
const FEW_CHIRPS: f64 = 1.5;
/// Rounding of residual phases in single precision [rad per turn].
const SINGLE_TURN: f64 = 5e-7;
/// Share of the error budget for truncated series of delays and of amplitudes.
const LEAST_SHARE: f64 = 0.02;
/// Largest number of terms for which a wider kernel may save one.
const FEW_TERMS: usize = 3;
/// Largest grid of one block with all terms [numbers].
const MAX_GRID: usize = 1 << 23;

/// Bound of the error of a kernel of some width in `count` blocks of the frame, relative to the l2 norm of the
/// amplitudes, for paths of some [coherence](crate::synthesis::coherence), whatever their phases.
pub fn kernel_error(waveform: &Waveform, class: Class, (width, count): (usize, usize), coherence: f64) -> f64 {
    let num_samples = waveform.num_samples;
    // What stands still is spread over range alone.
    let end = match class {
        Class::Still => (num_samples / 2) as f64 / (OVERSAMPLING * num_samples) as f64,
        _ => 0.5 / OVERSAMPLING as f64,
    };
    let is_short = waveform.chirp_times.len() / count <= 2;
    let stress = if is_short { FEW_CHIRPS } else { 1.0 };
    stress * KaiserBessel::error(width, end, coherence)
}

impl Goal<'_> {
    /// Part by the NUFFT with the best width and number of blocks, if its estimate is below `limit` [s].
    pub(super) fn grid(&self, delay_ranges: impl Fn(&[Block]) -> Vec<Vec<Interval>>, limit: f64) -> Option<Part> {
        let request = self.request;
        let (waveform, series) = (request.waveform, request.series);
        // Double precision where single precision is too coarse for the terms.
        let single = if request.allows_single {
            self.cheapest(true)
        } else {
            None
        };
        let (estimate, blocks, kernel, mut laid) = single.or_else(|| self.cheapest(false))?;
        if estimate >= limit {
            // The other step is cheaper: no need for statistics of the blocks.
            return None;
        }
        if blocks.len() > 1 {
            // Fit the grids to the ranges of all paths in the blocks; the terms do not depend on these.
            let mut known = laid.into_iter().peekable();
            let expand = |(block, ranges): (&Block, Vec<Interval>)| {
                let is_known = |laid: &Laid| laid.block_plan.block.chirps == block.chirps;
                match known.next_if(is_known) {
                    Some(laid) => self.fit(laid, &ranges, kernel),
                    None => self.expand(block, &ranges, kernel),
                }
            };
            laid = blocks
                .iter()
                .zip(delay_ranges(&blocks))
                .map(expand)
                .collect::<Option<_>>()?;
        }
        let cost = laid.iter().map(|laid| self.cost(kernel, &laid.block_plan, false)).sum();
        let largest = |number: fn(&Laid) -> f64| laid.iter().map(number).fold(0.0, f64::max);
        let interpolation = largest(|laid| laid.interpolation);
        let count = blocks.len();
        let block_plans: Vec<BlockPlan> = laid.into_iter().map(|laid| laid.block_plan).collect();
        // Parts of the paths, channels and blocks have separate grids, on as many threads as there may be.
        let num_grids = series.num_channels * count;
        // Spectra are half as large, and are held until those of other channels are complete.
        let grids = num_grids.clamp(MAX_PARTS, 16) + num_grids.min(16 * MAX_CHANNELS).div_ceil(2);
        let numbers = block_plans
            .iter()
            .map(|plan| {
                plan.approximation.num_sets() * Layout::new(waveform.num_samples, kernel.width, plan.rows).size()
            })
            .max()
            .unwrap_or(0);
        Some(Part {
            class: self.class,
            num_paths: self.group.num_paths,
            step: Step::Grid {
                is_single: kernel.is_single,
                width: kernel.width,
                block_plans,
            },
            share: self.share,
            kernel: kernel.bound,
            rounding: kernel.rounding,
            equal: kernel.equal,
            series: interpolation,
            cost,
            memory: (grids + 1) * numbers * if kernel.is_single { 4 } else { 8 },
        })
    }

    /// Estimate for the cheapest number of blocks, from samples of the paths.
    fn cheapest(&self, allows_single: bool) -> Option<Estimate> {
        let (waveform, series) = (self.request.waveform, self.request.series);
        let num_chirps = waveform.chirp_times.len();
        let counts: Vec<usize> = if self.class == Class::Still {
            vec![1]
        } else {
            std::iter::successors(Some(1), |n| Some(2 * n))
                .take_while(|n| *n <= num_chirps)
                .collect()
        };
        let mut best: Option<Estimate> = None;
        for count in counts {
            let blocks = Block::split(waveform, series, count);
            let sample: Vec<usize> = if count > 2 {
                vec![0, count / 2, count - 1]
            } else {
                (0..count).collect()
            };
            let share = count as f64 / sample.len() as f64;
            let lay = |kernel: Kernel| {
                let of_block = |i: &usize| self.expand(&blocks[*i], &self.ranges(&blocks[*i]), kernel);
                Some((kernel, sample.iter().map(of_block).collect::<Option<Vec<Laid>>>()?))
            };
            let costs = |kernel: Kernel, laid: &[Laid], is_halved: bool| -> f64 {
                let costs = laid.iter().map(|laid| self.cost(kernel, &laid.block_plan, is_halved));
                share * costs.sum::<f64>()
            };
            let kernels = self.kernels(count, allows_single);
            let mut laid = kernels.first().and_then(|kernel| lay(*kernel));
            // A kernel of one cell more may save one of a few terms.
            let is_few = |(_, laid): &(Kernel, Vec<Laid>)| {
                laid.iter()
                    .all(|laid| laid.block_plan.approximation.num_sets() <= FEW_TERMS)
                    && laid.iter().any(|laid| laid.block_plan.approximation.num_sets() > 1)
            };
            if let ([_, wider], Some(narrow)) = (&kernels[..], laid.as_ref())
                && is_few(narrow)
                && let Some(wide) = lay(*wider)
                && costs(wide.0, &wide.1, false) < costs(narrow.0, &narrow.1, false)
            {
                laid = Some(wide);
            }
            let Some((kernel, laid)) = laid else {
                continue;
            };
            let (cost, next) = (costs(kernel, &laid, false), 2.0 * costs(kernel, &laid, true));
            if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                best = Some((cost, blocks, kernel, laid));
            }
            if best
                .as_ref()
                .is_some_and(|(least, ..)| *least <= next + times::MORE_BLOCKS)
            {
                break;
            }
        }
        best
    }

    /// All kernels for `count` blocks, the fastest first.
    fn all_kernels(&self, count: usize) -> impl Iterator<Item = Kernel> + use<'_> {
        let (coherence, gain) = (self.group.coherence(count), self.request.gain);
        let widths = SINGLE_WIDTHS
            .map(|width| (true, width))
            .into_iter()
            .chain(DOUBLE_WIDTHS.map(|width| (false, width)));
        let single = self.single_rounding();
        widths.map(move |(is_single, width)| {
            let bound = kernel_error(self.request.waveform, self.class, (width, count), coherence);
            let (rounding, equal) = if is_single {
                (single, SINGLE_EQUAL_SUM)
            } else {
                (DOUBLE_ROUNDING, 0.0)
            };
            Kernel {
                is_single,
                width,
                bound,
                rounding,
                equal,
                error: bound.hypot(gain * rounding.hypot(gain * gain * equal)),
            }
        })
    }

    /// Rounding of sums in single precision.
    fn single_rounding(&self) -> f64 {
        let (waveform, series) = (self.request.waveform, self.request.series);
        // Cells between the nearest and the farthest path.
        let span = 2.0 * self.group.delay[0].half() * (waveform.slope / waveform.sample_rate).abs();
        let cells = 1.0 + span.min(1.0) * (OVERSAMPLING * waveform.num_samples) as f64;
        let paths = self.group.num_paths as f64 / series.num_channels as f64;
        SINGLE_ROUNDING.hypot(SINGLE_SUM * (paths / cells).sqrt())
    }

    /// Narrowest kernel that leaves room for other errors in `count` blocks, and the next one of the same precision.
    fn kernels(&self, count: usize, allows_single: bool) -> Vec<Kernel> {
        let mut kernels: Vec<Kernel> = self
            .all_kernels(count)
            .filter(|kernel| kernel.error <= 0.8 * self.tolerance && (allows_single || !kernel.is_single))
            .take(2)
            .collect();
        if let [first, second] = kernels[..]
            && first.is_single != second.is_single
        {
            kernels.pop();
        }
        kernels
    }

    /// Predicted time of one block [s]; or of each of its halves, with about as many terms as they can be hoped to
    /// have: delays bend a quarter as much.
    fn cost(&self, kernel: Kernel, block_plan: &BlockPlan, is_halved: bool) -> f64 {
        let (series, num_samples) = (self.request.series, self.request.waveform.num_samples);
        let mut num_terms = block_plan.approximation.num_sets();
        let (mut rows, mut num_chirps) = (block_plan.rows, block_plan.block.chirps.len());
        if is_halved {
            num_terms = num_terms.div_ceil(2).min(num_terms / 4 + 4);
            (rows, num_chirps) = ((rows / 2).max(1), num_chirps / 2);
        }
        let size = num_terms * Layout::new(num_samples, kernel.width, rows).size();
        let bytes = (size * if kernel.is_single { 4 } else { 8 }) as f64;
        let per_path = times::spreading(kernel.width, kernel.is_single, num_terms)
            + times::reading(series.num_delay_terms(), series.num_amplitude_terms())
            + times::fetching(bytes);
        let per_channel = times::transforms(rows, num_terms, (num_chirps, num_samples), kernel.is_single);
        self.group.num_paths as f64 * per_path + series.num_channels as f64 * per_channel
    }

    /// Ranges of the coefficients of the delay in a block: known for the frame, else about those of the samples.
    fn ranges(&self, block: &Block) -> Vec<Interval> {
        if block.chirps.len() == self.request.waveform.chirp_times.len() {
            return self.group.delay.clone();
        }
        let mut ranges = vec![Interval::EMPTY; self.group.delay.len()];
        for sample in &self.group.samples {
            for (range, c) in ranges.iter_mut().zip(sample.delay(block)) {
                *range = range.join(Interval { low: c, high: c });
            }
        }
        for range in &mut ranges {
            let more = 0.1 * range.half();
            *range = Interval {
                low: range.low - more,
                high: range.high + more,
            };
        }
        ranges
    }

    /// Plan of a block. None if the tolerance cannot be reached.
    fn expand(&self, block: &Block, delay: &[Interval], kernel: Kernel) -> Option<Laid> {
        let waveform = self.request.waveform;
        let middle_delay = delay[0].middle();
        let carrier = waveform.start_frequency + waveform.slope * (waveform.middle_time() - middle_delay);
        let frame = Frame::new(carrier, middle_delay, waveform.slope);
        if self.class == Class::Still {
            let block_plan = BlockPlan {
                block: block.clone(),
                frame,
                middle_rate: 0.0,
                step: 1.0,
                rows: 1,
                num_degrees: 1,
                num_amplitudes: 1,
                approximation: CrossApproximation::none(),
            };
            return Some(Laid {
                block_plan,
                interpolation: 0.0,
            });
        }

        if frame.bend.is_nan() || frame.bend.abs() > 1.0 {
            // The carrier is too low to follow the phase by a plane wave and its residual.
            return None;
        }

        let budget = self.budget(kernel);
        let mut paths = self.scratch.take();
        paths.resize_with(self.group.samples.len(), Path::default);
        for (path, sample) in paths.iter_mut().zip(&self.group.samples) {
            sample.set_in_block(block, &frame, path);
        }
        let fluctuation = fluctuation(waveform);
        let allowed = budget / self.request.safety_factor / fluctuation;
        if let Some((approximation, left)) = self.one_phase(block, &frame, (delay, &paths), (budget, allowed)) {
            self.scratch.replace(paths);
            return self.lay(block, delay, frame, kernel, (approximation, left, 1));
        }
        let rounding = if kernel.is_single {
            SINGLE_ROUNDING
        } else {
            DOUBLE_ROUNDING
        };
        let found = cross_approximation::find(waveform, block, &frame, &paths, (allowed, rounding), self.request.level);
        let num_amplitudes = num_amplitudes(&paths, LEAST_SHARE * budget);
        self.scratch.replace(paths);
        let (approximation, left) = found?;
        self.lay(
            block,
            delay,
            frame,
            kernel,
            (approximation, left * fluctuation, num_amplitudes),
        )
    }

    /// Plan of a block by an approximation, its error and the number of terms of the amplitudes.
    fn lay(
        &self,
        block: &Block,
        delay: &[Interval],
        frame: Frame,
        kernel: Kernel,
        (approximation, left, num_amplitudes): (CrossApproximation, f64, usize),
    ) -> Option<Laid> {
        let rounding = if kernel.is_single {
            SINGLE_TURN * approximation.turns
        } else {
            0.0
        };
        // The checks see this rounding as well.
        let interpolation = left.hypot(rounding);
        if kernel.error.hypot(in_phase(self.request.gain) * interpolation) > self.tolerance {
            return None;
        }
        let block_plan = BlockPlan {
            block: block.clone(),
            frame,
            middle_rate: 0.0,
            step: 1.0,
            rows: 1,
            num_degrees: 2,
            num_amplitudes,
            approximation,
        };
        let laid = Laid {
            block_plan,
            interpolation,
        };
        self.fit(laid, delay, kernel)
    }

    /// Residuals of paths at constant rates and amplitudes over the whole frame as the phase of their mean, and the
    /// error. None for other paths, or if the error is more than allowed.
    ///
    /// Residual phases are `x s u r - bend (x r)^2`, with the sweep `s`, the offset `u` and the rate `r`. Their mean
    /// square over the frame needs no more than those of `x s` and of `x^2`. Up to the `budget`, the ranges of all
    /// paths bound it, and no path is checked. Up to what samples are allowed, it is that of the samples, and checks at
    /// two instants measure it exactly.
    fn one_phase(
        &self,
        block: &Block,
        frame: &Frame,
        (delay, paths): (&[Interval], &[Path]),
        (budget, allowed): (f64, f64),
    ) -> Option<(CrossApproximation, f64)> {
        let waveform = self.request.waveform;
        let is_whole = block.chirps.len() == waveform.chirp_times.len();
        if !is_whole || delay.len() != 2 || self.request.series.num_amplitude_terms() != 1 {
            return None;
        }
        // Mean squares over the frame, by the moments of slow and of fast time.
        let slow = |n: i32| {
            let x = |chirp: usize| (block.offset(waveform, chirp) / block.half).powi(n);
            (0..block.chirps.len()).map(x).sum::<f64>() / block.chirps.len() as f64
        };
        let fast = |n: i32| {
            let x = |sample: usize| ((waveform.sample_time(sample) - waveform.middle_time()) / block.half).powi(n);
            (0..waveform.num_samples).map(x).sum::<f64>() / waveform.num_samples as f64
        };
        let sweep = (frame.stretch * block.half).powi(2);
        let swept = sweep * (slow(2) * fast(2) + 2.0 * slow(1) * fast(3) + fast(4));
        let squared = slow(4) + 4.0 * (slow(3) * fast(1) + slow(1) * fast(3)) + 6.0 * slow(2) * fast(2) + fast(4);
        let mean = cross_approximation::mean(paths);

        // The path that is farthest from the mean.
        let rate = delay[1].scaled(frame.carrier);
        let offset = [delay[0].low, delay[0].high].map(|delay| frame.stretch * (delay - frame.middle_delay));
        let offset = Interval {
            low: offset[0].min(offset[1]),
            high: offset[0].max(offset[1]),
        };
        let (skew, most) = (offset.times(rate), rate.magnitude().powi(2));
        let middle = mean.offset * mean.rate;
        let far = (skew.high - middle).max(middle - skew.low) * swept.sqrt();
        let square = mean.rate * mean.rate;
        let bent = frame.bend * (most - square).max(square) * squared.sqrt();
        let bound = TAU * far.hypot(bent);
        if bound <= budget {
            return Some((CrossApproximation::of_one_phase(mean, &[]), bound));
        }

        // Sums and differences of both terms: their product drops out of the mean of the squares.
        let x = squared.powf(0.25);
        let instants = [1.0, -1.0].map(|sign| Instant {
            x,
            sweep: sign * swept.sqrt() / x,
        });
        let (mut error, mut power) = (0.0, 0.0);
        for path in paths {
            let own = path.re()[0].powi(2) + path.im()[0].powi(2);
            let left = |instant: &Instant| path.turns(frame, instant) - mean.turns(frame, instant);
            error += own * instants.iter().map(|instant| left(instant).powi(2)).sum::<f64>() / 2.0;
            power += own;
        }
        let error = TAU * (error / power).sqrt();
        let is_enough = error <= cross_approximation::SHARE * allowed;
        is_enough.then(|| {
            (
                CrossApproximation::of_one_phase(mean, &instants),
                error * fluctuation(waveform),
            )
        })
    }

    /// Fit the velocity axis and the degrees of delays of a plan to ranges of delays [s].
    fn fit(&self, mut laid: Laid, delay: &[Interval], kernel: Kernel) -> Option<Laid> {
        let (waveform, block_plan) = (self.request.waveform, &mut laid.block_plan);
        let axis = self.velocity_axis(&block_plan.block, delay, &block_plan.frame, kernel)?;
        let size = Layout::new(waveform.num_samples, kernel.width, axis.rows).size();
        if block_plan.approximation.num_sets().saturating_mul(size) > MAX_GRID {
            return None;
        }
        (block_plan.middle_rate, block_plan.step, block_plan.rows) = (axis.middle_rate, axis.step, axis.rows);
        // Degrees that count: in the others, no phase turns by more than a share of the budget.
        let top = (block_plan.frame.carrier.abs() + waveform.slope.abs() * waveform.half_sweep()) * TAU;
        let counts = |k: &usize| top * delay[*k].magnitude() > LEAST_SHARE * self.budget(kernel);
        block_plan.num_degrees = (2..delay.len()).rev().find(counts).map_or(2, |k| k + 1);
        Some(laid)
    }

    /// Error budget that a kernel leaves to other errors.
    ///
    /// Errors are relative to the amplitudes in the block, whose mean square over all blocks is that in the frame.
    fn budget(&self, kernel: Kernel) -> f64 {
        let square = (MARGIN * self.tolerance).powi(2) - kernel.error.powi(2);
        square.max(0.0).sqrt() / in_phase(self.request.gain)
    }

    /// Velocity axis of a block. None if its span is not finite or too large.
    fn velocity_axis(&self, block: &Block, delay: &[Interval], frame: &Frame, kernel: Kernel) -> Option<Axis> {
        let unstretched = Interval {
            low: 1.0 - frame.stretch * (delay[0].high - frame.middle_delay),
            high: 1.0 - frame.stretch * (delay[0].low - frame.middle_delay),
        };
        let rate = delay.get(1).map_or(Interval::ZERO, |rate| rate.times(unstretched));
        let rate = rate.scaled(block.half.recip());
        let keystone = BlockPlan::max_keystone(self.request.waveform, block, frame.carrier);
        let step = if keystone > 0.0 { 0.25 / keystone } else { 1.0 };
        // One part in 10^9 for rounding.
        let span = (rate.high - rate.low) / step * (1.0 + 1e-9) + 1e-6;
        if !span.is_finite() || span > 1e7 {
            return None;
        }
        let rows = (span.ceil() as usize + kernel.width + 2).next_multiple_of(2);
        Some(Axis {
            middle_rate: rate.middle(),
            step,
            rows,
        })
    }
}

/// Number of terms of the amplitudes that count: later ones are below a share of the total.
fn num_amplitudes(paths: &[Path], least: f64) -> usize {
    let num_terms = paths.first().map_or(1, Path::num_amplitudes);
    let power = |k: usize| {
        let squares = paths.iter().map(|path| path.re()[k].powi(2) + path.im()[k].powi(2));
        squares.sum::<f64>()
    };
    let total: f64 = (0..num_terms).map(power).sum();
    let counts = |k: &usize| power(*k) > least * least * total;
    (1..num_terms).rev().find(counts).map_or(1, |k| k + 1)
}

/// Velocity axis of a grid.
struct Axis {
    /// Middle of the axis [s/s].
    middle_rate: f64,
    /// Distance of two rows [s/s].
    step: f64,
    rows: usize,
}

/// Predicted time [s], blocks, their kernel, and the plans of some of them.
type Estimate = (f64, Vec<Block>, Kernel, Vec<Laid>);

/// Plan of a block and its predicted error.
struct Laid {
    block_plan: BlockPlan,
    /// Error due to the interpolation of residuals and their rounding.
    interpolation: f64,
}
