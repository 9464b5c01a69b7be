//! Statistics of the paths that a plan is made from: number of paths, ranges of delays and power of amplitudes, by
//! class.

use std::f64::consts::TAU;
use std::ops::Range;

use crate::numeric::parallel;
use crate::numeric::random::mix;
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::numeric::wide;
use crate::synthesis::block::{Block, CHUNK, Lane, Rows, Selection, coefficient};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::coherence::Coherence;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::interval::Interval;
use crate::synthesis::low_rank::residual_phase::Sample;

/// Statistics of the paths of one class.
#[derive(Clone, Debug)]
pub struct Group {
    /// Number of paths, over all channels.
    pub num_paths: usize,
    /// Range of the coefficients of the delay over the frame [s], by degree.
    pub delay: Vec<Interval>,
    /// Power of the coefficients of the amplitude over the frame, (degree, channel).
    pub power: Vec<Vec<f64>>,
    /// Sums of amplitudes over cells of range and velocity, per channel.
    pub coherence: Vec<Coherence>,
}

impl Group {
    /// Mean over the nodes of the squared l2 norm of the amplitudes [W], per channel.
    pub fn own_power(&self) -> Vec<f64> {
        let mut own = self.power[0].clone();
        for change in &self.power[1..] {
            for (own, change) in own.iter_mut().zip(change) {
                *own += 0.5 * change;
            }
        }
        own
    }

    /// Largest [`Coherence::gain`] of all channels.
    pub fn coherence(&self, count: usize) -> f64 {
        let gains = self.coherence.iter().map(|cells| cells.gain(count));
        gains.fold(1.0, f64::max)
    }

    /// Add the paths of another group.
    fn join(&mut self, other: &Self) {
        self.num_paths += other.num_paths;
        for (a, b) in self.delay.iter_mut().zip(&other.delay) {
            *a = a.join(*b);
        }
        for (a, b) in self.power.iter_mut().flatten().zip(other.power.iter().flatten()) {
            *a += b;
        }
        for (a, b) in self.coherence.iter_mut().zip(&other.coherence) {
            a.join(b);
        }
    }
}

/// Statistics of all paths of a series.
#[derive(Clone, Debug)]
pub struct PathStatistics {
    /// Paths whose delay and amplitude never change.
    pub still: Group,
    /// All other paths.
    pub moving: Group,
    /// Mean over the nodes of the squared l2 norm of the amplitudes [W], per channel.
    pub power: Vec<f64>,
    /// Largest real or imaginary part of the first row of the amplitudes, and of the differences of the other rows from
    /// it.
    pub largest: f64,
    /// True if all numbers are certainly finite.
    pub is_finite: bool,
    /// Bit masks of the moving paths, (channel, chunk).
    pub masks: Vec<u128>,
    /// Largest bounds of the change of residuals, of every part of the work, in decreasing order.
    pub bounds: Vec<Bound>,
}

/// Upper bound of the change of residuals in a group of neighbouring paths, and the path that attains it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bound {
    /// Estimate of the squared change of the residual over the frame [W].
    pub change: f64,
    /// Number of the path in its channel.
    pub path: usize,
    /// Number of the channel.
    pub channel: usize,
}

/// Largest number of bounds that are kept.
const NUM_BOUNDS: usize = 12;
/// Paths that share one bound.
const NEIGHBOURS: usize = 32;

/// Fewest chunks per part of the work, and most parts per channel, each with cells of its own; constants: sums do not
/// depend on the number of threads.
const PART: usize = 64;
const MOST_PARTS: usize = 64;

impl PathStatistics {
    /// Statistics of all paths over a frame, as one block, for phases at a carrier [Hz].
    pub fn new(
        waveform: &Waveform,
        series: &PathSeries,
        frame: &Block,
        carrier: f64,
        level: Level,
        is_parallel: bool,
    ) -> Self {
        let of_part = |(channel, chunks): (usize, Range<usize>)| {
            level.run(PartStatistics {
                waveform,
                series,
                frame,
                carrier,
                channel,
                chunks,
            })
        };
        let partial: Vec<Self> = parallel::map(is_parallel, parts(series), of_part);
        let mut all = Self::empty(series);
        for part in &partial {
            all.join(part);
        }
        sort(&mut all.bounds);
        all
    }

    /// Count all paths as moving.
    pub fn merge(&mut self) {
        let still = std::mem::replace(&mut self.still, self.moving.clone());
        self.moving.join(&still);
        self.still.num_paths = 0;
    }

    /// Statistics of the number of paths alone.
    pub fn count(series: &PathSeries) -> Self {
        let mut statistics = Self::empty(series);
        statistics.moving.num_paths = series.num_channels * series.num_paths;
        statistics
    }

    fn empty(series: &PathSeries) -> Self {
        let group = Group {
            num_paths: 0,
            delay: vec![Interval::EMPTY; series.num_delay_terms()],
            power: vec![vec![0.0; series.num_channels]; series.num_amplitude_terms()],
            coherence: vec![Coherence::default(); series.num_channels],
        };
        Self {
            still: group.clone(),
            moving: group,
            power: vec![0.0; series.num_channels],
            largest: 0.0,
            is_finite: true,
            masks: Vec::new(),
            bounds: Vec::new(),
        }
    }

    fn join(&mut self, other: &Self) {
        self.still.join(&other.still);
        self.moving.join(&other.moving);
        for (a, b) in self.power.iter_mut().zip(&other.power) {
            *a += b;
        }
        self.largest = self.largest.max(other.largest);
        self.is_finite &= other.is_finite;
        self.masks.extend(&other.masks);
        self.bounds.extend(&other.bounds);
    }
}

/// Sample of at most `most` of the selected paths, spread evenly over them.
pub fn samples(series: &PathSeries, selection: Selection, most: usize) -> Vec<Sample> {
    let num_chunks = series.num_paths.div_ceil(CHUNK);
    let all = (0..series.num_channels).flat_map(|channel| (0..num_chunks).map(move |chunk| (channel, chunk)));
    let count = |(channel, chunk)| selection.count(series, channel, chunk);
    let total: usize = all.clone().map(count).sum();
    let num_samples = most.min(total);
    // One path in every `total / num_samples` of them, at a pseudo-random rank.
    let mut ranks = (0..num_samples).map(|i| {
        let (low, high) = (i * total / num_samples, (i + 1) * total / num_samples);
        low + (mix(i as u64) % (high - low).max(1) as u64) as usize
    });
    let mut samples = Vec::new();
    let (mut before, mut next) = (0, ranks.next());
    for (channel, chunk) in all {
        let after = before + count((channel, chunk));
        while let Some(rank) = next.filter(|rank| *rank < after) {
            samples.push(sample(series, selection, (channel, chunk), rank - before));
            next = ranks.next();
        }
        before = after;
    }
    samples
}

/// All selected paths of a chunk.
pub fn samples_of(series: &PathSeries, selection: Selection, channel: usize, chunk: usize) -> Vec<Sample> {
    let count = selection.count(series, channel, chunk);
    (0..count)
        .map(|rank| sample(series, selection, (channel, chunk), rank))
        .collect()
}

/// Paths that attain the largest bounds, at most one of each group of neighbours over all channels.
pub fn bounding_paths(series: &PathSeries, statistics: &PathStatistics) -> Vec<Sample> {
    let mut chosen: Vec<&Bound> = Vec::new();
    for bound in &statistics.bounds {
        if chosen.len() == NUM_BOUNDS {
            break;
        }
        if chosen
            .iter()
            .all(|other| other.path / NEIGHBOURS != bound.path / NEIGHBOURS)
        {
            chosen.push(bound);
        }
    }
    chosen
        .iter()
        .map(|bound| Sample::new(series, bound.channel * series.num_paths + bound.path))
        .collect()
}

/// Sort bounds, the largest change first.
fn sort(bounds: &mut [Bound]) {
    bounds.sort_by(|a, b| b.change.total_cmp(&a.change));
}

/// All selected paths whose first amplitude has more than a share of the power of their channel.
pub fn strongest(series: &PathSeries, selection: Selection, power: &[f64], share: f64) -> Vec<Sample> {
    let first = series.amplitude[0];
    let is_strong = |channel: usize, path: usize| {
        power[channel] > 0.0 && first[channel * series.num_paths + path].norm_sqr() > share * power[channel]
    };
    let mut samples = Vec::new();
    for channel in 0..series.num_channels {
        for chunk in 0..series.num_paths.div_ceil(CHUNK) {
            let paths = chunk * CHUNK..series.num_paths.min((chunk + 1) * CHUNK);
            if !paths.clone().any(|path| is_strong(channel, path)) {
                continue;
            }
            for rank in 0..selection.count(series, channel, chunk) {
                let path = chunk * CHUNK + selection.place(series, channel, chunk, rank);
                if is_strong(channel, path) {
                    samples.push(Sample::new(series, channel * series.num_paths + path));
                }
            }
        }
    }
    samples
}

fn sample(series: &PathSeries, selection: Selection, (channel, chunk): (usize, usize), rank: usize) -> Sample {
    let place = selection.place(series, channel, chunk, rank);
    Sample::new(series, channel * series.num_paths + chunk * CHUNK + place)
}

/// Ranges of the coefficients of the delays of the selected paths in some blocks [s], (block, degree).
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
        for (all, ranges) in all.iter_mut().flatten().zip(part.into_iter().flatten()) {
            *all = all.join(ranges);
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

struct BlockRanges<'a> {
    series: &'a PathSeries<'a>,
    selection: Selection<'a>,
    blocks: &'a [Block],
    channel: usize,
    chunks: Range<usize>,
}

impl Kernel for BlockRanges<'_> {
    type Output = Vec<Vec<Interval>>;

    #[inline(always)]
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
                ranges[i].take_in::<I>(block, &rows, k, None, None);
            }
        }
        let mut intervals = Vec::new();
        for block in ranges.chunks(num_delays) {
            intervals.push(Ends::intervals::<I>(block));
        }
        intervals
    }
}

struct PartStatistics<'a> {
    waveform: &'a Waveform,
    series: &'a PathSeries<'a>,
    frame: &'a Block,
    carrier: f64,
    channel: usize,
    chunks: Range<usize>,
}

impl Kernel for PartStatistics<'_> {
    type Output = PathStatistics;

    #[inline(always)]
    fn run<I: Isa>(self) -> PathStatistics {
        let (series, channel, frame) = (self.series, self.channel, self.frame);
        let mut statistics = PathStatistics::empty(series);
        let mut rows = Rows::new(series);
        let zero = wide::splat::<I, AT_ONCE>(0.0);
        let (mut nothing, mut largest) = (zero, zero);
        let ends = vec![Ends::<I::F64>::empty(); series.num_delay_terms()];
        let mut ranges = [ends.clone(), ends];
        let sums = vec![zero; series.num_amplitude_terms()];
        let mut powers = [sums.clone(), sums];
        let mut counts = [0, 0];
        let phase = (TAU * self.carrier).powi(2);
        let cells = Coherence::new(frame.chirps.len(), self.waveform.num_samples);
        let mut coherence = [cells.clone(), cells];
        let turns = [self.waveform.slope / self.waveform.sample_rate, 2.0 * self.carrier];
        for index in self.chunks {
            rows.gather(series, channel, index * CHUNK, Selection::ALL);
            let mask = rows.moving();
            statistics.masks.push(mask);
            nothing = wide::add(nothing, times_zero::<I>(frame, &rows));
            for j in 0..rows.re.len() {
                largest = magnitude::<I>(&rows.re[j], magnitude::<I>(&rows.im[j], largest));
            }
            let num_moving = mask.count_ones() as usize;
            let numbers = [rows.len - num_moving, num_moving];
            let is_mixed = numbers[0] > 0 && numbers[1] > 0;
            let places = places::<I>(frame, &rows, turns);
            for i in 0..rows.len {
                let class = (mask >> i & 1) as usize;
                coherence[class].add(places[0][i], places[1][i], places[2][i]);
            }
            let (mut bends, mut changes) = ([0.0; CHUNK], [0.0; CHUNK]);
            for (class, bits) in [!mask, mask].into_iter().enumerate() {
                if numbers[class] == 0 {
                    continue;
                }
                counts[class] += numbers[class];
                let members = is_mixed.then(|| lanes_of(bits, [0.0, 1.0]));
                let far = is_mixed.then(|| lanes_of(bits, [FAR, 0.0]));
                // Still paths have one coefficient.
                let most = if class == 0 { 1 } else { usize::MAX };
                for k in 0..ranges[class].len().min(most) {
                    let squares = (k >= 2).then_some(&mut bends);
                    ranges[class][k].take_in::<I>(frame, &rows, k, far.as_ref(), squares);
                }
                for k in 0..powers[class].len().min(most) {
                    let squares = (k >= 1).then_some(&mut changes);
                    powers[class][k] = add_power::<I>(frame, &rows, k, members.as_ref(), powers[class][k], squares);
                }
            }
            for first in (0..rows.len).step_by(NEIGHBOURS) {
                let mut most = Bound::default();
                for place in first..rows.len.min(first + NEIGHBOURS) {
                    let (re, im) = (rows.re[0][place], rows.im[0][place]);
                    let change = phase * bends[place] * (re * re + im * im) + changes[place];
                    if change > most.change {
                        most = Bound {
                            change,
                            path: index * CHUNK + place,
                            channel,
                        };
                    }
                }
                if most.change > 0.0 {
                    statistics.bounds.push(most);
                }
            }
        }
        let [still, moving] = coherence;
        statistics.still.coherence[channel] = still;
        statistics.moving.coherence[channel] = moving;
        sort(&mut statistics.bounds);
        statistics.bounds.truncate(NUM_BOUNDS);
        statistics.is_finite = sum_of::<I>(nothing) == 0.0;
        statistics.largest = -least_of::<I>(wide::sub(zero, largest));
        for (class, group) in [&mut statistics.still, &mut statistics.moving].into_iter().enumerate() {
            group.num_paths = counts[class];
            if counts[class] == 0 {
                continue;
            }
            group.delay = Ends::intervals::<I>(&ranges[class]);
            if class == 0 {
                group.delay[1..].fill(Interval::ZERO);
            }
            for (degree, sums) in powers[class].iter().enumerate() {
                let power = sum_of::<I>(*sums);
                group.power[degree][channel] = power;
                // Mean over Chebyshev nodes, by the orthogonality of the polynomials there.
                statistics.power[channel] += if degree == 0 { 1.0 } else { 0.5 } * power;
            }
        }
        statistics
    }
}

/// Lane of `numbers[bit]`, by the bits of a mask.
#[inline(always)]
fn lanes_of(bits: u128, numbers: [f64; 2]) -> Lane {
    let halves = [bits as u64, (bits >> 64) as u64];
    let mut lanes = [0.0; CHUNK];
    for i in 0..CHUNK {
        let is_set = halves[i / 64] >> (i % 64) & 1 == 1;
        lanes[i] = if is_set { numbers[1] } else { numbers[0] };
    }
    lanes
}

/// Vectors at once, which share the cost of a loop over rows.
const AT_ONCE: usize = 4;
type Wide<I> = wide::Wide<I, AT_ONCE>;

/// Sum of all numbers.
#[inline(always)]
fn sum_of<I: Isa>(vectors: Wide<I>) -> f64 {
    let mut numbers = [0.0; 8 * AT_ONCE];
    wide::store(vectors, &mut numbers);
    numbers.iter().sum()
}

/// Least of all numbers.
#[inline(always)]
fn least_of<I: Isa>(vectors: Wide<I>) -> f64 {
    let mut numbers = [0.0; 8 * AT_ONCE];
    wide::store(vectors, &mut numbers);
    numbers.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Coefficient k of the paths from `at` on.
#[inline(always)]
fn whole<I: Isa>(matrix: &[Vec<f64>], rows: &[Lane], k: usize, at: usize) -> Wide<I> {
    let value = coefficient::<I, AT_ONCE>(matrix, rows, k, at);
    if k == 0 {
        return wide::add(value, wide::load::<I, AT_ONCE>(&rows[0][at..]));
    }
    value
}

/// Turns of phase of paths from sample to sample and over the frame, for factors of the first two coefficients of the
/// delay, and the magnitudes of their mean amplitudes.
#[inline(always)]
fn places<I: Isa>(frame: &Block, rows: &Rows, turns: [f64; 2]) -> [Lane; 3] {
    let mut places = [[0.0; CHUNK]; 3];
    for at in (0..CHUNK).step_by(8 * AT_ONCE) {
        for k in 0..rows.delay.len().min(2) {
            let value = whole::<I>(&frame.delay, &rows.delay, k, at);
            let factor = wide::splat::<I, AT_ONCE>(turns[k]);
            wide::store(wide::mul(value, factor), &mut places[k][at..]);
        }
        let re = whole::<I>(&frame.amplitude, &rows.re, 0, at);
        let im = whole::<I>(&frame.amplitude, &rows.im, 0, at);
        let square = wide::mul_add(re, re, wide::mul(im, im));
        for i in 0..AT_ONCE {
            square[i].sqrt().store(&mut places[2][at + 8 * i..]);
        }
    }
    places
}

/// Zero if the means over the frame of all series are finite; NaN if any number or any mean is not.
#[inline(always)]
fn times_zero<I: Isa>(frame: &Block, rows: &Rows) -> Wide<I> {
    let zero = wide::splat::<I, AT_ONCE>(0.0);
    let mut sum = zero;
    for (matrix, lanes) in [
        (&frame.delay, &rows.delay),
        (&frame.amplitude, &rows.re),
        (&frame.amplitude, &rows.im),
    ] {
        for at in (0..CHUNK).step_by(8 * AT_ONCE) {
            // Zero times infinity or NaN is NaN.
            sum = wide::mul_add(whole::<I>(matrix, lanes, 0, at), zero, sum);
        }
    }
    sum
}

/// Running maximum of absolute values.
#[inline(always)]
fn magnitude<I: Isa>(lane: &Lane, mut largest: Wide<I>) -> Wide<I> {
    let zero = wide::splat::<I, AT_ONCE>(0.0);
    for at in (0..CHUNK).step_by(8 * AT_ONCE) {
        let value = wide::load::<I, AT_ONCE>(&lane[at..]);
        largest = wide::max(wide::max(value, wide::sub(zero, value)), largest);
    }
    largest
}

/// Add the squared magnitudes of coefficient k of the amplitude, of all paths or of the members, to `power` and, path
/// by path, to `squares`. Lanes after the last path have no amplitude.
#[inline(always)]
fn add_power<I: Isa>(
    block: &Block,
    rows: &Rows,
    k: usize,
    members: Option<&Lane>,
    mut power: Wide<I>,
    mut squares: Option<&mut Lane>,
) -> Wide<I> {
    for at in (0..CHUNK).step_by(8 * AT_ONCE) {
        for lanes in [&rows.re, &rows.im] {
            let mut value = whole::<I>(&block.amplitude, lanes, k, at);
            if let Some(members) = members {
                value = wide::mul(value, wide::load::<I, AT_ONCE>(&members[at..]));
            }
            power = wide::mul_add(value, value, power);
            if let Some(squares) = &mut squares {
                add_squares::<I>(value, squares, at);
            }
        }
    }
    power
}

/// Add squares of values to the numbers from `at` on.
#[inline(always)]
fn add_squares<I: Isa>(value: Wide<I>, squares: &mut Lane, at: usize) {
    let sum = wide::load::<I, AT_ONCE>(&squares[at..]);
    wide::store(wide::mul_add(value, value, sum), &mut squares[at..]);
}

/// Number beyond every delay [s].
const FAR: f64 = 1e300;

/// Running lower and upper ends of ranges, one per number of the vectors.
#[derive(Clone, Copy)]
struct Ends<V> {
    low: [V; AT_ONCE],
    high: [V; AT_ONCE],
}

impl<V: Vector<Scalar = f64>> Ends<V> {
    /// Ends of the empty range.
    #[inline(always)]
    fn empty() -> Self {
        Self {
            low: [V::splat(f64::INFINITY); AT_ONCE],
            high: [V::splat(f64::NEG_INFINITY); AT_ONCE],
        }
    }

    /// Widen the range by coefficient k of the delay of all paths, or of those that are not `far`, and add its square
    /// to `squares`, path by path. Lanes after the last path of a chunk are copies of that path.
    #[inline(always)]
    fn take_in<I: Isa<F64 = V>>(
        &mut self,
        block: &Block,
        rows: &Rows,
        k: usize,
        far: Option<&Lane>,
        mut squares: Option<&mut Lane>,
    ) {
        let Self { mut low, mut high } = *self;
        for at in (0..CHUNK).step_by(8 * AT_ONCE) {
            let value = whole::<I>(&block.delay, &rows.delay, k, at);
            if let Some(squares) = &mut squares {
                add_squares::<I>(value, squares, at);
            }
            let mut ends = [value; 2];
            if let Some(far) = far {
                let far = wide::load::<I, AT_ONCE>(&far[at..]);
                ends = [wide::add(value, far), wide::sub(value, far)];
            }
            (low, high) = (wide::min(ends[0], low), wide::max(ends[1], high));
        }
        *self = Self { low, high };
    }

    #[inline(always)]
    fn intervals<I: Isa<F64 = V>>(ranges: &[Self]) -> Vec<Interval> {
        let mut intervals = Vec::new();
        for i in 0..ranges.len() {
            let opposite = wide::sub(wide::splat::<I, AT_ONCE>(0.0), ranges[i].high);
            intervals.push(Interval {
                low: least_of::<I>(ranges[i].low),
                high: -least_of::<I>(opposite),
            });
        }
        intervals
    }
}

#[cfg(test)]
mod tests;
