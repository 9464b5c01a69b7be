//! What a plan has to know of all paths: how many there are of each class, the ranges of their series, their power.

use std::ops::Range;

use crate::block::{Block, CHUNK, Lane, Rows, Selection, coefficient};
use crate::delay::PathSeries;
use crate::hash::mix;
use crate::parallel;
use crate::residual::Sample;
use crate::simd::{Isa, Kernel, Level, Vector};

/// A closed range of numbers; empty if `low > high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Smallest number.
    pub low: f64,
    /// Largest number.
    pub high: f64,
}

impl Interval {
    /// No number.
    pub const EMPTY: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };
    /// The number zero.
    pub const ZERO: Self = Self { low: 0.0, high: 0.0 };

    /// The smallest range that holds both.
    pub fn join(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// All sums.
    pub fn plus(self, other: Self) -> Self {
        Self {
            low: self.low + other.low,
            high: self.high + other.high,
        }
    }

    /// All products.
    pub fn times(self, other: Self) -> Self {
        let ends = [
            self.low * other.low,
            self.low * other.high,
            self.high * other.low,
            self.high * other.high,
        ];
        Self {
            low: ends.into_iter().fold(f64::INFINITY, f64::min),
            high: ends.into_iter().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// Multiplied by a number.
    pub fn scaled(self, factor: f64) -> Self {
        self.times(Self {
            low: factor,
            high: factor,
        })
    }

    /// Half way between the ends.
    pub fn middle(self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// Half of the distance of the ends.
    pub fn half(self) -> f64 {
        0.5 * (self.high - self.low)
    }

    /// Largest absolute value.
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }
}

/// The paths of one class.
#[derive(Clone, Debug)]
pub struct Group {
    /// Paths, over all channels.
    pub num_paths: usize,
    /// Range of the coefficients of the delay over the frame [s], by degree.
    pub delay: Vec<Interval>,
    /// Power of the coefficients of the amplitude over the frame, (degree, channel).
    pub power: Vec<Vec<f64>>,
}

impl Group {
    /// Mean over the nodes of the squared l2 norm of the amplitudes, per channel.
    pub fn own_power(&self) -> Vec<f64> {
        let mut own = self.power[0].clone();
        for change in &self.power[1..] {
            for (own, change) in own.iter_mut().zip(change) {
                *own += 0.5 * change;
            }
        }
        own
    }
}

/// All paths of a series.
#[derive(Clone, Debug)]
pub struct Survey {
    /// Those that never change.
    pub still: Group,
    /// All others.
    pub moving: Group,
    /// Mean over the nodes of the squared l2 norm of the amplitudes, per channel.
    pub power: Vec<f64>,
    /// Sum of the fourth powers of the first amplitudes, per channel.
    pub fourth: Vec<f64>,
    /// Largest real or imaginary part of the first amplitude of any path, and of the others' differences from it.
    pub largest: f64,
    /// False if any number may not be finite.
    pub is_finite: bool,
    /// A bit per path that moves, (channel, chunk).
    pub masks: Vec<u128>,
}

/// Chunks per part of the work: sums do not depend on the number of threads.
const PART: usize = 64;

impl Survey {
    /// Look at all paths of a frame, which is one block.
    pub fn new(series: &PathSeries, frame: &Block, level: Level, is_parallel: bool) -> Self {
        let look = |(channel, chunks): (usize, Range<usize>)| {
            level.run(Look {
                series,
                frame,
                channel,
                chunks,
            })
        };
        let looks: Vec<Self> = parallel::map(is_parallel, parts(series), look);
        let mut all = Self::empty(series);
        for look in &looks {
            all.join(look);
        }
        all
    }

    /// Number of paths of equal strength that would have the same ratio of fourth to second moments, the least of all
    /// channels; 1 if that cannot be said.
    pub fn effective_paths(&self) -> f64 {
        let channels = self.power.iter().zip(&self.fourth).filter(|(power, _)| **power > 0.0);
        let ratios = channels.map(|(power, fourth)| {
            let ratio = power * power / fourth;
            if ratio.is_finite() { ratio } else { 1.0 }
        });
        ratios.fold(1e9, f64::min).max(1.0)
    }

    /// All paths as moving ones.
    pub fn merge(&mut self) {
        let still = std::mem::replace(&mut self.still, self.moving.clone());
        let moving = &mut self.moving;
        moving.num_paths += still.num_paths;
        for (a, b) in moving.delay.iter_mut().zip(&still.delay) {
            *a = a.join(*b);
        }
        for (a, b) in moving.power.iter_mut().flatten().zip(still.power.iter().flatten()) {
            *a += b;
        }
        self.still.num_paths = 0;
    }

    /// The number of paths alone.
    pub fn count(series: &PathSeries) -> Self {
        let mut survey = Self::empty(series);
        survey.moving.num_paths = series.num_channels * series.num_paths;
        survey
    }

    fn empty(series: &PathSeries) -> Self {
        let group = Group {
            num_paths: 0,
            delay: vec![Interval::EMPTY; series.num_delay_terms()],
            power: vec![vec![0.0; series.num_channels]; series.num_amplitude_terms()],
        };
        Self {
            still: group.clone(),
            moving: group,
            power: vec![0.0; series.num_channels],
            fourth: vec![0.0; series.num_channels],
            largest: 0.0,
            is_finite: true,
            masks: Vec::new(),
        }
    }

    fn join(&mut self, other: &Self) {
        for (a, b) in [(&mut self.still, &other.still), (&mut self.moving, &other.moving)] {
            a.num_paths += b.num_paths;
            for (a, b) in a.delay.iter_mut().zip(&b.delay) {
                *a = a.join(*b);
            }
            for (a, b) in a.power.iter_mut().flatten().zip(b.power.iter().flatten()) {
                *a += b;
            }
        }
        let sums = self.power.iter_mut().chain(&mut self.fourth);
        for (a, b) in sums.zip(other.power.iter().chain(&other.fourth)) {
            *a += b;
        }
        self.largest = self.largest.max(other.largest);
        self.is_finite &= other.is_finite;
        self.masks.extend(&other.masks);
    }
}

/// At most `most` of the selected paths, spread evenly over them.
pub fn samples(series: &PathSeries, selection: Selection, most: usize) -> Vec<Sample> {
    let num_chunks = series.num_paths.div_ceil(CHUNK);
    let all = (0..series.num_channels).flat_map(|channel| (0..num_chunks).map(move |chunk| (channel, chunk)));
    let count = |(channel, chunk)| selection.count(series, channel, chunk);
    let total: usize = all.clone().map(count).sum();
    let num_samples = most.min(total);
    // One path in every `total / num_samples` of them, at a place that is as good as random.
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
    let look = |(channel, chunks): (usize, Range<usize>)| {
        level.run(LookAtBlocks {
            series,
            selection,
            blocks,
            channel,
            chunks,
        })
    };
    let looks: Vec<Vec<Vec<Interval>>> = parallel::map(is_parallel, parts(series), look);
    let mut all = vec![vec![Interval::EMPTY; series.num_delay_terms()]; blocks.len()];
    for look in looks {
        for (all, ranges) in all.iter_mut().flatten().zip(look.into_iter().flatten()) {
            *all = all.join(ranges);
        }
    }
    all
}

/// Channels and chunks of the parts of the work.
fn parts(series: &PathSeries) -> Vec<(usize, Range<usize>)> {
    let num_chunks = series.num_paths.div_ceil(CHUNK);
    let of_channel = |channel| {
        (0..num_chunks)
            .step_by(PART)
            .map(move |first| (channel, first..num_chunks.min(first + PART)))
    };
    (0..series.num_channels).flat_map(of_channel).collect()
}

struct LookAtBlocks<'a> {
    series: &'a PathSeries<'a>,
    selection: Selection<'a>,
    blocks: &'a [Block],
    channel: usize,
    chunks: Range<usize>,
}

impl Kernel for LookAtBlocks<'_> {
    type Output = Vec<Vec<Interval>>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<Vec<Interval>> {
        let mut ranges = vec![vec![Interval::EMPTY; self.series.num_delay_terms()]; self.blocks.len()];
        let mut rows = Rows::of_delays(self.series);
        for index in self.chunks {
            rows.gather(self.series, self.channel, index * CHUNK, self.selection);
            if rows.len == 0 {
                continue;
            }
            for number in 0..self.blocks.len() {
                for k in 0..ranges[number].len() {
                    let range = extent::<I>(&self.blocks[number], &rows, k, None);
                    ranges[number][k] = ranges[number][k].join(range);
                }
            }
        }
        ranges
    }
}

struct Look<'a> {
    series: &'a PathSeries<'a>,
    frame: &'a Block,
    channel: usize,
    chunks: Range<usize>,
}

impl Kernel for Look<'_> {
    type Output = Survey;

    #[inline(always)]
    fn run<I: Isa>(self) -> Survey {
        let (series, channel, frame) = (self.series, self.channel, self.frame);
        let mut survey = Survey::empty(series);
        let mut rows = Rows::new(series);
        for index in self.chunks {
            rows.gather(series, channel, index * CHUNK, Selection::ALL);
            let mask = rows.moving();
            survey.masks.push(mask);
            survey.is_finite &= is_finite::<I>(frame, &rows);
            for lane in rows.re.iter().chain(&rows.im) {
                survey.largest = survey.largest.max(magnitude::<I>(lane));
            }
            survey.fourth[channel] += fourth::<I>(&rows.re[0], &rows.im[0]);
            let num_moving = mask.count_ones() as usize;
            let is_mixed = num_moving > 0 && num_moving < rows.len;
            if num_moving > 0 {
                let members = is_mixed.then(|| lanes_of(mask));
                let group = &mut survey.moving;
                group.num_paths += num_moving;
                for k in 0..group.delay.len() {
                    group.delay[k] = group.delay[k].join(extent::<I>(frame, &rows, k, members.as_ref()));
                }
                for k in 0..group.power.len() {
                    group.power[k][channel] += power_of::<I>(frame, &rows, k, members.as_ref());
                }
            }
            if num_moving < rows.len {
                let members = is_mixed.then(|| lanes_of(!mask));
                let group = &mut survey.still;
                group.num_paths += rows.len - num_moving;
                group.delay[0] = group.delay[0].join(extent::<I>(frame, &rows, 0, members.as_ref()));
                for k in 1..group.delay.len() {
                    group.delay[k] = Interval::ZERO;
                }
                group.power[0][channel] += power_of::<I>(frame, &rows, 0, members.as_ref());
            }
        }
        // Mean over Chebyshev nodes, by the orthogonality of the polynomials there.
        for group in [&survey.still, &survey.moving] {
            for (degree, power) in group.power.iter().enumerate() {
                survey.power[channel] += if degree == 0 { 1.0 } else { 0.5 } * power[channel];
            }
        }
        survey
    }
}

/// One where the bit is set, else zero.
#[inline(always)]
fn lanes_of(bits: u128) -> Lane {
    let halves = [bits as u64, (bits >> 64) as u64];
    let mut lanes = [0.0; CHUNK];
    for i in 0..CHUNK {
        lanes[i] = if halves[i / 64] >> (i % 64) & 1 == 1 { 1.0 } else { 0.0 };
    }
    lanes
}

/// Whether no number is infinite or NaN: then means over the frame are numbers; false as well where these are beyond the
/// largest.
#[inline(always)]
fn is_finite<I: Isa>(frame: &Block, rows: &Rows) -> bool {
    let zero = I::F64::splat(0.0);
    let mut sum = zero;
    for (matrix, lanes) in [
        (&frame.delay, &rows.delay),
        (&frame.amplitude, &rows.re),
        (&frame.amplitude, &rows.im),
    ] {
        for at in (0..CHUNK).step_by(8) {
            let [change] = coefficient::<I, 1>(matrix, lanes, 0, at);
            // No number times zero is zero, if it is none.
            sum = change.add(I::F64::load(&lanes[0][at..])).mul_add(zero, sum);
        }
    }
    let mut lanes = [0.0; 8];
    sum.store(&mut lanes);
    lanes == [0.0; 8]
}

/// Largest absolute value.
#[inline(always)]
fn magnitude<I: Isa>(lane: &Lane) -> f64 {
    let zero = I::F64::splat(0.0);
    let mut largest = zero;
    for at in (0..CHUNK).step_by(8) {
        let value = I::F64::load(&lane[at..]);
        largest = value.max(zero.sub(value)).max(largest);
    }
    let mut lanes = [0.0; 8];
    largest.store(&mut lanes);
    lanes.iter().copied().fold(0.0, f64::max)
}

/// Sum of the fourth powers of the magnitudes.
#[inline(always)]
fn fourth<I: Isa>(re: &Lane, im: &Lane) -> f64 {
    let mut sum = I::F64::splat(0.0);
    for at in (0..CHUNK).step_by(8) {
        let (re, im) = (I::F64::load(&re[at..]), I::F64::load(&im[at..]));
        let square = re.mul_add(re, im.mul(im));
        sum = square.mul_add(square, sum);
    }
    let mut lanes = [0.0; 8];
    sum.store(&mut lanes);
    lanes.iter().sum()
}

/// Beyond every delay.
const FAR: f64 = 1e300;

/// Range of coefficient k of the delay, of all paths or of the members. What follows the last path of a chunk is a copy of
/// it.
#[inline(always)]
fn extent<I: Isa>(block: &Block, rows: &Rows, k: usize, members: Option<&Lane>) -> Interval {
    let (mut low, mut high) = (I::F64::splat(f64::INFINITY), I::F64::splat(f64::NEG_INFINITY));
    for at in (0..CHUNK).step_by(8) {
        let [mut value] = coefficient::<I, 1>(&block.delay, &rows.delay, k, at);
        if k == 0 {
            value = value.add(I::F64::load(&rows.delay[0][at..]));
        }
        if let Some(members) = members {
            // Far outside if it does not take part.
            let far = I::F64::load(&members[at..]).neg_mul_add(I::F64::splat(FAR), I::F64::splat(FAR));
            (low, high) = (value.add(far).min(low), value.sub(far).max(high));
        } else {
            (low, high) = (value.min(low), value.max(high));
        }
    }
    let mut lanes = [[0.0; 8]; 2];
    low.store(&mut lanes[0]);
    high.store(&mut lanes[1]);
    Interval {
        low: lanes[0].iter().copied().fold(f64::INFINITY, f64::min),
        high: lanes[1].iter().copied().fold(f64::NEG_INFINITY, f64::max),
    }
}

/// Sum of the squared magnitudes of coefficient k of the amplitude, of all paths or of the members. What follows the last
/// path has none.
#[inline(always)]
fn power_of<I: Isa>(block: &Block, rows: &Rows, k: usize, members: Option<&Lane>) -> f64 {
    let mut power = I::F64::splat(0.0);
    for at in (0..CHUNK).step_by(8) {
        for lanes in [&rows.re, &rows.im] {
            let [mut value] = coefficient::<I, 1>(&block.amplitude, lanes, k, at);
            if k == 0 {
                value = value.add(I::F64::load(&lanes[0][at..]));
            }
            if let Some(members) = members {
                value = value.mul(I::F64::load(&members[at..]));
            }
            power = value.mul_add(value, power);
        }
    }
    let mut lanes = [0.0; 8];
    power.store(&mut lanes);
    lanes.iter().sum()
}
