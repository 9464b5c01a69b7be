//! What a plan has to know of all paths: how many there are of each class, the ranges of their series, their power.

use std::ops::Range;

use crate::block::{Block, CHUNK, Class, Lane, Rows, coefficient};
use crate::delay::PathSeries;
use crate::parallel;
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

    /// All squares.
    pub fn squared(self) -> Self {
        let ends = [self.low * self.low, self.high * self.high];
        let crosses = self.low <= 0.0 && self.high >= 0.0;
        Self {
            low: if crosses { 0.0 } else { ends[0].min(ends[1]) },
            high: ends[0].max(ends[1]),
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
    /// Range of the coefficients of the delay [s], (block, degree).
    pub delay: Vec<Vec<Interval>>,
    /// Power of the coefficients of the amplitude, (block, degree, channel).
    pub power: Vec<Vec<Vec<f64>>>,
    /// Moments of the two first coefficients of the delay, (block, channel).
    pub moments: Vec<Vec<Moments>>,
}

/// Sums over paths of the power of their constant amplitude times products of the delay's first coefficients.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    /// `(c_0 - r)^k c_1^2` for k = 0, 1, 2, with r the same delay for all paths.
    pub skew: [f64; 3],
    /// `c_1^4`
    pub fourth: f64,
    /// r [s]
    pub reference: f64,
}

impl Moments {
    /// Sum of `(c_0 - delay)^2 c_1^2`.
    pub fn skew_about(&self, delay: f64) -> f64 {
        let shift = self.reference - delay;
        (self.skew[2] + shift * (2.0 * self.skew[1] + shift * self.skew[0])).max(0.0)
    }

    /// With `c_1^2` multiplied by a number.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            skew: self.skew.map(|sum| factor * sum),
            fourth: factor * factor * self.fourth,
            ..*self
        }
    }

    fn add(&mut self, other: &Self) {
        for (a, b) in self.skew.iter_mut().zip(other.skew) {
            *a += b;
        }
        self.fourth += other.fourth;
    }
}

impl Group {
    /// Mean over the nodes of the squared l2 norm of the amplitudes, per channel.
    pub fn own_power(&self) -> Vec<f64> {
        let mut own = self.power[0][0].clone();
        for change in &self.power[0][1..] {
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
}

/// Chunks per part of the work: sums do not depend on the number of threads.
const PART: usize = 64;

impl Survey {
    /// Look at all paths, in some blocks.
    pub fn new(series: &PathSeries, blocks: &[Block], level: Level, is_parallel: bool) -> Self {
        let num_chunks = series.num_paths.div_ceil(CHUNK);
        let parts: Vec<(usize, Range<usize>)> = (0..series.num_channels)
            .flat_map(|channel| {
                (0..num_chunks)
                    .step_by(PART)
                    .map(move |first| (channel, first..num_chunks.min(first + PART)))
            })
            .collect();
        let look = |(channel, chunks): (usize, Range<usize>)| {
            level.run(Look {
                series,
                blocks,
                channel,
                chunks,
            })
        };
        let looks: Vec<Self> = parallel::map(is_parallel, parts, look);
        let mut all = Self::empty(series, blocks);
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
        for (a, b) in moving.delay.iter_mut().flatten().zip(still.delay.iter().flatten()) {
            *a = a.join(*b);
        }
        for (a, b) in moving
            .power
            .iter_mut()
            .flatten()
            .flatten()
            .zip(still.power.iter().flatten().flatten())
        {
            *a += b;
        }
        self.still.num_paths = 0;
    }

    /// The number of paths alone.
    pub fn count(series: &PathSeries) -> Self {
        let mut survey = Self::empty(series, &[]);
        survey.moving.num_paths = series.num_channels * series.num_paths;
        survey.moving.power = vec![vec![vec![0.0; series.num_channels]]];
        survey
    }

    fn empty(series: &PathSeries, blocks: &[Block]) -> Self {
        let moments = Moments {
            reference: series.delay[0].first().copied().unwrap_or(0.0),
            ..Moments::default()
        };
        let group = Group {
            num_paths: 0,
            delay: vec![vec![Interval::EMPTY; series.num_delay_terms()]; blocks.len()],
            power: vec![vec![vec![0.0; series.num_channels]; series.num_amplitude_terms()]; blocks.len()],
            moments: vec![vec![moments; series.num_channels]; blocks.len()],
        };
        Self {
            still: group.clone(),
            moving: group,
            power: vec![0.0; series.num_channels],
            fourth: vec![0.0; series.num_channels],
            largest: 0.0,
            is_finite: true,
        }
    }

    fn join(&mut self, other: &Self) {
        for (a, b) in [(&mut self.still, &other.still), (&mut self.moving, &other.moving)] {
            a.num_paths += b.num_paths;
            for (a, b) in a.delay.iter_mut().flatten().zip(b.delay.iter().flatten()) {
                *a = a.join(*b);
            }
            for (a, b) in a
                .power
                .iter_mut()
                .flatten()
                .flatten()
                .zip(b.power.iter().flatten().flatten())
            {
                *a += b;
            }
            for (a, b) in a.moments.iter_mut().flatten().zip(b.moments.iter().flatten()) {
                a.add(b);
            }
        }
        let sums = self.power.iter_mut().chain(&mut self.fourth);
        for (a, b) in sums.zip(other.power.iter().chain(&other.fourth)) {
            *a += b;
        }
        self.largest = self.largest.max(other.largest);
        self.is_finite &= other.is_finite;
    }
}

struct Look<'a> {
    series: &'a PathSeries<'a>,
    blocks: &'a [Block],
    channel: usize,
    chunks: Range<usize>,
}

impl Kernel for Look<'_> {
    type Output = Survey;

    #[inline(always)]
    fn run<I: Isa>(self) -> Survey {
        let (series, channel) = (self.series, self.channel);
        let mut survey = Survey::empty(series, self.blocks);
        let mut rows = Rows::new(series);
        for index in self.chunks {
            rows.gather(series, channel, index * CHUNK, Class::All);
            rows.find_change();
            survey.is_finite &= is_finite::<I>(&rows);
            for lane in rows.re.iter().chain(&rows.im) {
                survey.largest = survey.largest.max(magnitude::<I>(lane));
            }
            survey.fourth[channel] += fourth::<I>(&rows.re[0], &rows.im[0]);
            let num_moving = rows.num_moving();
            let is_mixed = num_moving > 0 && num_moving < rows.len;
            for class in [Class::Still, Class::Moving] {
                let count = if class == Class::Moving {
                    num_moving
                } else {
                    rows.len - num_moving
                };
                if count == 0 {
                    continue;
                }
                if is_mixed {
                    rows.gather(series, channel, index * CHUNK, class);
                }
                let group = if class == Class::Moving {
                    &mut survey.moving
                } else {
                    &mut survey.still
                };
                group.num_paths += count;
                for number in 0..self.blocks.len() {
                    let block = &self.blocks[number];
                    for k in 0..group.delay[number].len() {
                        let range = &mut group.delay[number][k];
                        *range = range.join(extent::<I>(block, &rows, k));
                    }
                    for k in 0..group.power[number].len() {
                        group.power[number][k][channel] += power_of::<I>(block, &rows, k);
                    }
                    if class == Class::Moving {
                        let sum = &mut group.moments[number][channel];
                        sum.add(&moments::<I>(block, &rows, sum.reference));
                    }
                }
            }
        }
        // Mean over Chebyshev nodes, by the orthogonality of the polynomials there; exact for one block.
        for group in [&survey.still, &survey.moving] {
            for (degree, power) in group.power[0].iter().enumerate() {
                survey.power[channel] += if degree == 0 { 1.0 } else { 0.5 } * power[channel];
            }
        }
        survey
    }
}

/// Moments of the paths of a chunk. What follows the last path has no power.
#[inline(always)]
fn moments<I: Isa>(block: &Block, rows: &Rows, reference: f64) -> Moments {
    let zero = I::F64::splat(0.0);
    let (mut skew, mut fourth) = ([zero; 3], zero);
    for at in (0..CHUNK).step_by(8) {
        let mut power = zero;
        for lanes in [&rows.re, &rows.im] {
            let [change] = coefficient::<I, 1>(&block.amplitude, lanes, 0, at);
            let value = I::F64::load(&lanes[0][at..]).add(change);
            power = value.mul_add(value, power);
        }
        let [shift] = coefficient::<I, 1>(&block.delay, &rows.delay, 0, at);
        let [rate] = coefficient::<I, 1>(&block.delay, &rows.delay, 1, at);
        let from_reference = I::F64::load(&rows.delay[0][at..])
            .sub(I::F64::splat(reference))
            .add(shift);
        let square = rate.mul(rate);
        let mut sum = power.mul(square);
        fourth = sum.mul_add(square, fourth);
        for k in 0..3 {
            skew[k] = skew[k].add(sum);
            sum = sum.mul(from_reference);
        }
    }
    let mut lanes = [[0.0; 8]; 4];
    for k in 0..3 {
        skew[k].store(&mut lanes[k]);
    }
    fourth.store(&mut lanes[3]);
    let mut sums = [0.0; 4];
    for k in 0..4 {
        for i in 0..8 {
            sums[k] += lanes[k][i];
        }
    }
    Moments {
        skew: [sums[0], sums[1], sums[2]],
        fourth: sums[3],
        reference,
    }
}

/// Whether no number is infinite or NaN; false as well where differences are beyond the largest number.
#[inline(always)]
fn is_finite<I: Isa>(rows: &Rows) -> bool {
    let zero = I::F64::splat(0.0);
    let mut sum = zero;
    for lanes in [&rows.delay, &rows.re, &rows.im] {
        for j in 0..lanes.len() {
            for at in (0..CHUNK).step_by(8) {
                sum = I::F64::load(&lanes[j][at..]).mul_add(zero, sum);
            }
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

/// Range of coefficient k of the delay. What follows the last path of a chunk is a copy of it.
#[inline(always)]
fn extent<I: Isa>(block: &Block, rows: &Rows, k: usize) -> Interval {
    let (mut low, mut high) = (I::F64::splat(f64::INFINITY), I::F64::splat(f64::NEG_INFINITY));
    for at in (0..CHUNK).step_by(8) {
        let [mut value] = coefficient::<I, 1>(&block.delay, &rows.delay, k, at);
        if k == 0 {
            value = value.add(I::F64::load(&rows.delay[0][at..]));
        }
        (low, high) = (value.min(low), value.max(high));
    }
    let mut lanes = [[0.0; 8]; 2];
    low.store(&mut lanes[0]);
    high.store(&mut lanes[1]);
    Interval {
        low: lanes[0].iter().copied().fold(f64::INFINITY, f64::min),
        high: lanes[1].iter().copied().fold(f64::NEG_INFINITY, f64::max),
    }
}

/// Sum of the squared magnitudes of coefficient k of the amplitude. What follows the last path has none.
#[inline(always)]
fn power_of<I: Isa>(block: &Block, rows: &Rows, k: usize) -> f64 {
    let mut power = I::F64::splat(0.0);
    for at in (0..CHUNK).step_by(8) {
        for lanes in [&rows.re, &rows.im] {
            let [mut value] = coefficient::<I, 1>(&block.amplitude, lanes, k, at);
            if k == 0 {
                value = value.add(I::F64::load(&lanes[0][at..]));
            }
            power = value.mul_add(value, power);
        }
    }
    let mut lanes = [0.0; 8];
    power.store(&mut lanes);
    lanes.iter().sum()
}
