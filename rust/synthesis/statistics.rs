//! Statistics of the paths that a plan is made from: ranges of delays of all paths, and samples of them for all else.
//!
//! What samples only suggest, the run measures, see [`crate::synthesis::nufft`].

use std::f64::consts::TAU;
use std::ops::Range;

use crate::numeric::parallel;
use crate::numeric::random::mix;
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::numeric::wide;
use crate::synthesis::block::{Block, CHUNK, Class, Lane, Rows, Selection, coefficient};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::coherence::Coherence;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::interval::Interval;
use crate::synthesis::low_rank::residual_phase::Sample;

/// Statistics of the paths of one class.
#[derive(Clone, Debug, Default)]
pub struct Group {
    /// Number of paths, over all channels.
    pub num_paths: usize,
    /// Range of the coefficients of the delay over the frame [s], by degree.
    pub delay: Vec<Interval>,
    /// Power of the coefficients of the amplitude over the frame, (degree, channel), of the sampled paths times their
    /// share [W].
    pub power: Vec<Vec<f64>>,
    /// Sampled paths, which residuals are interpolated for, with amplitudes times the weight of their channel.
    pub samples: Vec<Sample>,
    /// Weight of every channel: errors are relative to its own amplitudes.
    pub weights: Vec<f64>,
    /// Largest real or imaginary part of the first amplitudes of the sampled paths.
    pub largest: f64,
    /// Number of sampled paths, and of those whose delay and amplitude never change.
    pub num_sampled: usize,
    /// See [`Self::num_sampled`].
    pub num_still: usize,
    /// Mean over the nodes of the squared l2 norm of the amplitudes, per channel, of the samples or measured [W].
    pub own: Vec<f64>,
    /// Gain of the paths in phase that was measured, largest in any of some number of blocks.
    pub measured: Option<(usize, f64)>,
    /// Sums of amplitudes of the sampled paths over cells of range and velocity, and pairs of all paths of a channel
    /// per pair of them.
    cells: Vec<Coherence>,
    pairs: f64,
}

/// Paths that are sampled, evenly spread over all.
const NUM_SAMPLED: usize = 512;
/// One in so many of them is a sample for the interpolation of residuals.
const ONE_IN: usize = 2;
/// And of the others those that change most.
const NUM_CHANGING: usize = 32;

/// Fewest chunks per part of the work, and most parts per channel; constants: results do not depend on the number of
/// threads.
const PART: usize = 64;
const MOST_PARTS: usize = 64;

impl Group {
    /// Statistics of the selected paths over the frame; of all of them instead of samples if they `take_all`.
    pub fn new(waveform: &Waveform, series: &PathSeries, selection: Selection, take_all: bool) -> Self {
        let frame = Block::new(waveform, series, 0..waveform.chirp_times.len());
        let carrier = waveform.start_frequency + waveform.slope * waveform.middle_time();
        let (num_paths, mut sampled) = sampled(series, selection, if take_all { usize::MAX } else { NUM_SAMPLED });
        let share = num_paths as f64 / sampled.len().max(1) as f64;
        let largest = sampled.iter().map(|(_, sample)| sample.largest()).fold(0.0, f64::max);
        let mut group = Self {
            num_paths,
            power: vec![vec![0.0; series.num_channels]; series.num_amplitude_terms()],
            num_sampled: sampled.len(),
            largest,
            own: vec![0.0; series.num_channels],
            cells: vec![Coherence::new(waveform.chirp_times.len(), waveform.num_samples); series.num_channels],
            // Of each channel n of N paths are sampled.
            pairs: if sampled.len() > series.num_channels {
                (num_paths - series.num_channels) as f64 / (sampled.len() - series.num_channels) as f64
            } else {
                1.0
            },
            ..Self::default()
        };
        let turns = [waveform.slope / waveform.sample_rate, 2.0 * carrier];
        let (mut changes, mut powers) = (Vec::with_capacity(sampled.len()), Vec::new());
        for (channel, sample) in &sampled {
            powers.clear();
            powers.extend(sample.powers(&frame));
            group.num_still += usize::from(sample.is_still());
            for (degree, power) in powers.iter().copied().enumerate() {
                group.power[degree][*channel] += share * power;
                // Mean over Chebyshev nodes, by the orthogonality of the polynomials there.
                group.own[*channel] += share * if degree == 0 { power } else { 0.5 * power };
            }
            let mut delay = sample.delay(&frame).zip(turns).map(|(c, turns)| c * turns);
            let (range, velocity) = (delay.next().unwrap_or(0.0), delay.next().unwrap_or(0.0));
            let mean = powers[0];
            if mean > 0.0 {
                // In the range of single precision.
                group.cells[*channel].add(range, velocity, mean.sqrt() / largest);
            }
            let bends: f64 = sample.delay(&frame).skip(2).map(|c| (TAU * carrier * c).powi(2)).sum();
            changes.push(bends * mean + powers[1..].iter().sum::<f64>());
        }
        if sampled.len() > NUM_SAMPLED / ONE_IN + NUM_CHANGING && !take_all {
            let mut order: Vec<usize> = (0..sampled.len()).collect();
            let is_other = |index: usize| !index.is_multiple_of(ONE_IN);
            order.sort_by(|a, b| {
                let first = is_other(*a).cmp(&is_other(*b));
                first.then(changes[*b].total_cmp(&changes[*a]))
            });
            order.truncate(sampled.len().div_ceil(ONE_IN) + NUM_CHANGING);
            order.sort_unstable();
            let mut keep = order.into_iter().peekable();
            let mut index = 0;
            sampled.retain(|_| {
                index += 1;
                keep.next_if_eq(&(index - 1)).is_some()
            });
        }
        let mean = group.own.iter().sum::<f64>() / series.num_channels.max(1) as f64;
        let weight = |own: &f64| if *own > 0.0 { (mean / own).sqrt() } else { 1.0 };
        group.weights = group.own.iter().map(weight).collect();
        group.add(sampled);
        group
    }

    /// Add samples with their channels.
    pub fn add(&mut self, samples: impl IntoIterator<Item = (usize, Sample)>) {
        for (channel, mut sample) in samples {
            sample.weigh(self.weights[channel]);
            self.samples.push(sample);
        }
    }

    /// Count of the paths alone, for direct sums.
    pub fn count(series: &PathSeries) -> Self {
        Self {
            num_paths: series.num_channels * series.num_paths,
            delay: vec![Interval::EMPTY; series.num_delay_terms()],
            power: vec![vec![0.0; series.num_channels]; series.num_amplitude_terms()],
            own: vec![0.0; series.num_channels],
            ..Self::default()
        }
    }

    /// Estimate of the largest [`Coherence::gain`] in `count` blocks of the frame.
    pub fn coherence(&self, count: usize) -> f64 {
        if let Some((known, gain)) = self.measured {
            // The square of a sum is at most that of its parts, times their number.
            return gain * (count as f64 / known as f64).max(1.0).sqrt();
        }
        let [energy, squares] = self
            .cells
            .iter()
            .map(|cells| cells.energy(count))
            .fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
        let beyond = if squares > 0.0 {
            (energy / squares - 1.0).max(0.0)
        } else {
            0.0
        };
        (1.0 + self.pairs * beyond).sqrt()
    }
}

/// Estimate of the percentage of paths that stand still.
pub fn still_percent(series: &PathSeries) -> usize {
    const MOST: usize = 100;
    if series.num_terms() == 1 {
        return 100;
    }
    let (_, some) = sampled(series, Selection::ALL, MOST);
    100 * some.iter().filter(|(_, sample)| sample.is_still()).count() / some.len().max(1)
}

/// Bit masks of the moving paths, (channel, chunk).
pub fn moving(series: &PathSeries, level: Level, is_parallel: bool) -> Vec<u128> {
    let of_part = |(channel, chunks): (usize, Range<usize>)| {
        level.run(Masks {
            series,
            channel,
            chunks,
        })
    };
    parallel::map(is_parallel, parts(series), of_part).concat()
}

/// Mean over the nodes of the squared l2 norm of the amplitudes of the selected paths [W], per channel.
pub fn power(series: &PathSeries, selection: Selection) -> Vec<f64> {
    let num_chunks = series.num_paths.div_ceil(CHUNK);
    let of_channel = |channel: usize| {
        let mut rows = Rows::new(series);
        let mut sum = 0.0;
        for chunk in 0..num_chunks {
            rows.gather(series, channel, chunk * CHUNK, selection);
            sum += rows.power();
        }
        sum
    };
    (0..series.num_channels).map(of_channel).collect()
}

/// Number of the selected paths, and a sample of at most `most` of them, spread evenly, with their channels.
fn sampled(series: &PathSeries, selection: Selection, most: usize) -> (usize, Vec<(usize, Sample)>) {
    let num_chunks = series.num_paths.div_ceil(CHUNK);
    let all = (0..series.num_channels).flat_map(|channel| (0..num_chunks).map(move |chunk| (channel, chunk)));
    let count = |(channel, chunk)| selection.count(series, channel, chunk);
    let total: usize = all.clone().map(count).sum();
    let num_samples = most.min(total);
    // One path in every `total / num_samples` of them, at a pseudo-random rank.
    let mut ranks = (0..num_samples).map(|i| {
        let bound = |i: usize| (i as u128 * total as u128 / num_samples as u128) as usize;
        let (low, high) = (bound(i), bound(i + 1));
        low + (mix(i as u64) % (high - low).max(1) as u64) as usize
    });
    let mut samples = Vec::with_capacity(num_samples);
    let (mut before, mut next) = (0, ranks.next());
    for (channel, chunk) in all {
        let after = before + count((channel, chunk));
        while let Some(rank) = next.filter(|rank| *rank < after) {
            samples.push((channel, sample(series, selection, (channel, chunk), rank - before)));
            next = ranks.next();
        }
        before = after;
    }
    (total, samples)
}

/// All selected paths of a chunk.
pub fn samples_of(series: &PathSeries, selection: Selection, channel: usize, chunk: usize) -> Vec<Sample> {
    let count = selection.count(series, channel, chunk);
    (0..count)
        .map(|rank| sample(series, selection, (channel, chunk), rank))
        .collect()
}

fn sample(series: &PathSeries, selection: Selection, (channel, chunk): (usize, usize), rank: usize) -> Sample {
    let place = selection.place(series, channel, chunk, rank);
    Sample::new(series, channel * series.num_paths + chunk * CHUNK + place)
}

const NOT_A_NUMBER: Interval = Interval {
    low: f64::NAN,
    high: f64::NAN,
};

/// Ranges of the coefficients of the delays of the selected paths in some blocks [s], (block, degree); of still paths
/// of their first coefficient. NaN where a number is not finite.
pub fn ranges(
    series: &PathSeries,
    selection: Selection,
    blocks: &[Block],
    level: Level,
    is_parallel: bool,
) -> Vec<Vec<Interval>> {
    let of_part = |(channel, chunks): (usize, Range<usize>)| {
        level.run(BlockRanges {
            series,
            selection,
            blocks,
            channel,
            chunks,
        })
    };
    let partial: Vec<Vec<Vec<Interval>>> = parallel::map(is_parallel, parts(series), of_part);
    let mut all = vec![vec![Interval::EMPTY; series.num_delay_terms()]; blocks.len()];
    for part in partial {
        for (all, range) in all.iter_mut().flatten().zip(part.into_iter().flatten()) {
            // Minimum and maximum drop what is no number.
            let is_number = !all.low.is_nan() && !range.low.is_nan();
            *all = if is_number { all.join(range) } else { NOT_A_NUMBER };
        }
    }
    if selection.class == Class::Still {
        for ranges in &mut all {
            ranges[1..].fill(Interval::ZERO);
        }
    }
    all
}

/// Channel and chunks of every part of the work.
fn parts(series: &PathSeries) -> Vec<(usize, Range<usize>)> {
    let num_chunks = series.num_paths.div_ceil(CHUNK);
    let part = PART.max(num_chunks.div_ceil(MOST_PARTS));
    let of_channel = |channel| {
        (0..num_chunks)
            .step_by(part)
            .map(move |first| (channel, first..num_chunks.min(first + part)))
    };
    (0..series.num_channels).flat_map(of_channel).collect()
}

struct Masks<'a> {
    series: &'a PathSeries<'a>,
    channel: usize,
    chunks: Range<usize>,
}

impl Kernel for Masks<'_> {
    type Output = Vec<u128>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Vec<u128> {
        let mut rows = Rows::new(self.series);
        let mut masks = Vec::new();
        for index in self.chunks {
            rows.gather(self.series, self.channel, index * CHUNK, Selection::ALL);
            masks.push(rows.moving());
        }
        masks
    }
}

struct BlockRanges<'a> {
    series: &'a PathSeries<'a>,
    selection: Selection<'a>,
    blocks: &'a [Block],
    channel: usize,
    chunks: Range<usize>,
}

impl Kernel for BlockRanges<'_> {
    type Output = Vec<Vec<Interval>>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Vec<Vec<Interval>> {
        let num_delays = self.series.num_delay_terms();
        let mut ranges = vec![Ends::<I::F64>::empty(); self.blocks.len() * num_delays];
        let mut rows = Rows::of_delays(self.series);
        for index in self.chunks {
            rows.gather(self.series, self.channel, index * CHUNK, self.selection);
            if rows.len == 0 {
                continue;
            }
            for i in 0..ranges.len() {
                let (block, k) = (&self.blocks[i / num_delays], i % num_delays);
                ranges[i].take_in::<I>(block, &rows, k);
            }
        }
        let mut intervals = Vec::new();
        for block in ranges.chunks(num_delays) {
            intervals.push(Ends::intervals::<I>(block));
        }
        intervals
    }
}

/// Vectors at once, which share the cost of a loop over rows.
const AT_ONCE: usize = 4;
type Wide<I> = wide::Wide<I, AT_ONCE>;

/// Numbers of some vectors.
#[cfg_attr(optimised, inline(always))]
fn numbers<I: Isa>(vectors: Wide<I>) -> [f64; 8 * AT_ONCE] {
    let mut numbers = [0.0; 8 * AT_ONCE];
    wide::store(vectors, &mut numbers);
    numbers
}

/// Coefficient k of the paths from `at` on.
#[cfg_attr(optimised, inline(always))]
fn whole<I: Isa>(matrix: &[Vec<f64>], rows: &[Lane], k: usize, at: usize) -> Wide<I> {
    let value = coefficient::<I, AT_ONCE>(matrix, rows, k, at);
    if k == 0 {
        return wide::add(value, wide::load::<I, AT_ONCE>(&rows[0][at..]));
    }
    value
}

/// Running lower and upper ends of ranges, one per number of the vectors, and zeros, or NaN once a number was not
/// finite.
#[derive(Clone, Copy)]
struct Ends<V> {
    low: [V; AT_ONCE],
    high: [V; AT_ONCE],
    zero: [V; AT_ONCE],
}

impl<V: Vector<Scalar = f64>> Ends<V> {
    /// Ends of the empty range.
    #[cfg_attr(optimised, inline(always))]
    fn empty() -> Self {
        Self {
            low: [V::splat(f64::INFINITY); AT_ONCE],
            high: [V::splat(f64::NEG_INFINITY); AT_ONCE],
            zero: [V::splat(0.0); AT_ONCE],
        }
    }

    /// Widen the range by coefficient k of the delay of all paths. Lanes after the last path of a chunk are copies of
    /// that path.
    #[cfg_attr(optimised, inline(always))]
    fn take_in<I: Isa<F64 = V>>(&mut self, block: &Block, rows: &Rows, k: usize) {
        let Self {
            mut low,
            mut high,
            mut zero,
        } = *self;
        let nothing = wide::splat::<I, AT_ONCE>(0.0);
        for at in (0..CHUNK).step_by(8 * AT_ONCE) {
            let value = whole::<I>(&block.delay, &rows.delay, k, at);
            (low, high) = (wide::min(value, low), wide::max(value, high));
            // Zero times infinity or NaN is NaN.
            zero = wide::mul_add(value, nothing, zero);
        }
        *self = Self { low, high, zero };
    }

    #[cfg_attr(optimised, inline(always))]
    fn intervals<I: Isa<F64 = V>>(ranges: &[Self]) -> Vec<Interval> {
        let mut intervals = Vec::new();
        for range in ranges {
            let zero: f64 = numbers::<I>(range.zero).iter().sum();
            intervals.push(Interval {
                low: zero + numbers::<I>(range.low).iter().copied().fold(f64::INFINITY, f64::min),
                high: zero
                    + numbers::<I>(range.high)
                        .iter()
                        .copied()
                        .fold(f64::NEG_INFINITY, f64::max),
            });
        }
        intervals
    }
}

#[cfg(test)]
mod tests;
