//! Records of all paths in one precision, in blocks of chirps short enough for them, and the cheapest steps that keep a
//! tolerance.

use std::marker::PhantomData;
use std::ops::Range;

use num_complex::Complex;

use super::build::{Builder, Coefficients};
use super::coherence::{Coherence, Measure, Sketch};
use super::errors::Errors;
use super::grid::{self, Layer, Part, Steps, block_of};
use super::number::Number;
use super::record::Batch;
use super::tables::{GroupTables, Tables};
use crate::cancel::Cancel;
use crate::error::Result;
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Level};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{Block, CHUNK, Chunk, Lane, expand};
use crate::synthesis::kaiser_bessel::ToneError;
use crate::synthesis::report::{ErrorBound, Known, Options, SINGLE_TOLERANCE};
use crate::synthesis::source::{PathGroup, Request, Shape};

/// Share of the tolerance that errors of long blocks may have.
const BLOCK_SHARE: f64 = 0.3;

/// Share of the tolerance that the bound of the error may fill.
pub const MARGIN: f64 = 0.95;

/// Gain that steps allow for where it costs nothing but cells: more makes a second run.
const RESERVE: f64 = 2.0;

/// Rounding of samples in single precision, rms relative to them.
const OF_SAMPLES: f64 = 2.2e-8;

/// Chunks of paths of one task, a constant: sums of errors do not depend on the number of threads.
const CHUNKS: usize = 8;

/// Tasks that tell whether blocks are short enough, before all are built.
const NUM_PROBES: usize = 2;

/// Parts of the batches of a channel that are measured side by side, a constant.
const SHARES: usize = 4;

/// Records of the paths of a group.
struct Group<'a, T: Number> {
    paths: &'a PathGroup<'a>,
    blocks: Vec<Block>,
    /// Batches of every channel, in a fixed order.
    batches: Vec<Vec<Batch<T>>>,
}

/// Records of all paths.
pub struct Plan<'a, T: Number> {
    tables: Tables<'a>,
    options: &'a Options<'a>,
    groups: Vec<Group<'a, T>>,
    /// Factor of amplitudes, a power of two.
    scale: f64,
    /// Number of paths of a channel.
    num_paths: usize,
    /// Errors by channel.
    pub errors: Vec<Errors>,
    /// Coherence beside the chirps, by channel.
    pub coherence: Vec<Coherence>,
    /// Cheapest steps that keep the tolerance, or the finest.
    pub steps: Steps,
    /// Error of these steps.
    pub error: ErrorBound,
}

impl<'a, T: Number> Plan<'a, T> {
    /// Build the records of all paths, and choose the steps.
    pub fn new(waveform: &'a Waveform, groups: &'a [PathGroup<'a>], options: &'a Options<'a>) -> Result<Self> {
        let mut plan = Self {
            tables: Tables::new(waveform),
            options,
            groups: Vec::new(),
            scale: groups
                .iter()
                .map(|group| group.source.scale())
                .fold(f64::INFINITY, f64::min),
            num_paths: groups.iter().map(|group| group.source.shape().paths).sum(),
            errors: Vec::new(),
            coherence: Vec::new(),
            steps: Steps {
                width: T::WIDTHS[0],
                powers: [0; 2],
            },
            error: ErrorBound::default(),
        };
        for group in groups.iter().filter(|group| group.source.shape().paths > 0) {
            let group = plan.build(group)?;
            plan.groups.push(group);
        }
        let num_channels = groups.first().map_or(0, |group| group.source.shape().channels);
        plan.errors = (0..num_channels).map(|channel| plan.sum_errors(channel)).collect();
        plan.coherence = plan.measure(num_channels);
        plan.choose();
        Ok(plan)
    }

    /// Number of groups of chirps that are spread side by side.
    fn num_lane_groups(&self) -> usize {
        self.tables.waveform.chirp_times.len().div_ceil(T::LANES)
    }

    /// Blocks of chirps of whole groups.
    fn blocks(&self, shape: &Shape, number: usize) -> Vec<Block> {
        let (num_groups, num_chirps) = (self.num_lane_groups(), self.tables.waveform.chirp_times.len());
        let first = |block: usize| {
            (0..num_groups)
                .filter(|group| block_of(*group, num_groups, number) < block)
                .count()
        };
        let chirps = |block: usize| T::LANES * first(block)..(T::LANES * first(block + 1)).min(num_chirps);
        (0..number)
            .map(|block| Block::new(self.tables.waveform, shape, chirps(block)))
            .collect()
    }

    /// Build the records of a group, with half as long blocks until they are short enough.
    fn build(&self, group: &'a PathGroup<'a>) -> Result<Group<'a, T>> {
        let (source, shape) = (group.source, group.source.shape());
        let num_chunks = shape.paths.div_ceil(CHUNK);
        let together = source.channels_together().clamp(1, shape.channels);
        let channels = (0..shape.channels)
            .step_by(together)
            .map(|first| first..shape.channels.min(first + together));
        let parts = || {
            (0..num_chunks)
                .step_by(CHUNKS)
                .map(|first| first..num_chunks.min(first + CHUNKS))
        };
        let tasks: Vec<_> = channels
            .flat_map(|channels| parts().map(move |chunks| (channels.clone(), chunks)))
            .collect();
        let (mut number, mut step) = (1, 1);
        loop {
            let blocks = self.blocks(&shape, number);
            let builders: Vec<Builder> = blocks
                .iter()
                .map(|block| {
                    Builder::new(
                        &self.tables,
                        block,
                        shape.delay_rows.max(shape.amplitude_rows),
                        self.options.tolerance,
                    )
                })
                .collect();
            let some = tasks.iter().step_by(step).cloned().collect();
            let built = parallel::map(
                self.options.is_parallel,
                some,
                |(channels, chunks): (Range<usize>, Range<usize>)| {
                    self.options.cancel.map_or(Ok(()), Cancel::check)?;
                    Ok(self.options.level.run(Build {
                        group,
                        shape: &shape,
                        blocks: &blocks,
                        builders: &builders,
                        channels,
                        chunks,
                        scale: self.scale,
                        level: self.options.level,
                        number: PhantomData,
                    }))
                },
            );
            let built: Vec<Vec<Batch<T>>> = built.into_iter().collect::<Result<_>>()?;
            let mut errors = vec![Errors::default(); shape.channels];
            for ((channels, _), batches) in tasks.iter().step_by(step).zip(&built) {
                for (channel, batch) in channels.clone().zip(batches) {
                    errors[channel].add(&batch.errors, 1.0);
                }
            }
            if errors.iter().any(|errors| !errors.power.is_finite()) {
                return Err(source.not_finite());
            }
            let of_blocks = largest(errors.iter().map(|errors| errors.of_blocks::<T>(&self.tables)));
            let is_short = of_blocks <= BLOCK_SHARE * self.options.tolerance;
            if !is_short && 2 * number <= self.num_lane_groups() {
                (number, step) = (2 * number, tasks.len().div_ceil(NUM_PROBES));
                continue;
            }
            if step > 1 {
                step = 1;
                continue;
            }
            let mut batches: Vec<Vec<Batch<T>>> = (0..shape.channels).map(|_| Vec::new()).collect();
            for ((channels, _), built) in tasks.iter().zip(built) {
                for (channel, batch) in channels.clone().zip(built) {
                    batches[channel].push(batch);
                }
            }
            return Ok(Group {
                paths: group,
                blocks,
                batches,
            });
        }
    }

    /// Errors of a channel.
    fn sum_errors(&self, channel: usize) -> Errors {
        let mut errors = Errors::default();
        for batch in self.groups.iter().flat_map(|group| &group.batches[channel]) {
            errors.add(&batch.errors, 1.0);
        }
        errors
    }

    /// Coherence beside the chirps, by channel: means over blocks and groups.
    fn measure(&self, num_channels: usize) -> Vec<Coherence> {
        if self.num_paths <= 1 {
            return vec![Coherence::NONE; num_channels];
        }
        let mut numbers: Vec<usize> = self.groups.iter().map(|group| group.blocks.len()).collect();
        numbers.sort_unstable();
        numbers.dedup();
        // Groups of as many blocks share them.
        let of_channel = |channel: usize| {
            let mut sum = Coherence::NONE;
            for number in &numbers {
                let own: Vec<&Group<T>> = self
                    .groups
                    .iter()
                    .filter(|group| group.blocks.len() == *number)
                    .collect();
                let batches: Vec<&Batch<T>> = own.iter().flat_map(|group| &group.batches[channel]).collect();
                for (block, place) in own[0].blocks.iter().enumerate() {
                    let shares = batches.chunks(batches.len().div_ceil(SHARES).max(1)).collect();
                    let sketches = parallel::map(self.options.is_parallel, shares, |batches: &[&Batch<T>]| {
                        self.options.level.run(Measure {
                            tables: &self.tables,
                            block: place,
                            number: block,
                            batches,
                            tolerance: self.options.tolerance,
                        })
                    });
                    let mut sketch = Sketch::default();
                    for share in &sketches {
                        sketch.join(share);
                    }
                    sum.add(&sketch.coherence(), 1.0 / *number as f64);
                }
            }
            sum
        };
        parallel::map(self.options.is_parallel, (0..num_channels).collect(), of_channel)
    }

    /// Choose the cheapest steps that keep the tolerance, or the steps of the least error.
    fn choose(&mut self) {
        let (known, tolerance) = (self.options.known.gain, MARGIN * self.options.tolerance);
        let mut best = (f64::INFINITY, f64::INFINITY);
        for width in T::WIDTHS {
            for even in 0..=T::MOST_GRIDS[0] {
                for odd in 0..=T::MOST_GRIDS[1] {
                    let steps = Steps {
                        width: *width,
                        powers: [even, odd],
                    };
                    let bound = self.bound(steps);
                    // What is exceeded, then what it costs.
                    let excess = bound.with_gain(known) / tolerance;
                    let excess = if excess.is_nan() {
                        f64::INFINITY
                    } else {
                        excess.max(1.0)
                    };
                    let more = if bound.with_gain(known.max(RESERVE)) <= tolerance {
                        0.0
                    } else {
                        3.0
                    };
                    let cost = (width * (2 + steps.num_grids())) as f64 + more;
                    if (excess, cost) < best || best.0 == f64::INFINITY {
                        best = (excess, cost);
                        (self.steps, self.error) = (steps, bound);
                    }
                }
            }
        }
    }

    /// Bounds of errors, the largest of all channels.
    fn bound(&self, steps: Steps) -> ErrorBound {
        let of_all = |bound: &dyn Fn(&Errors) -> f64| largest(self.errors.iter().map(bound));
        let ToneError { rms, largest: most, .. } = ToneError::new(steps.width);
        // What adds up did so where the factor is up to a tenth above its mean.
        let kernel = |own: &Coherence| {
            let energy = own.energy + 0.2 * (own.energy - 1.0);
            (energy * (rms * rms + own.peak * (most * most - rms * rms))).sqrt()
        };
        // Cells hold what adds up beside the chirps as well.
        let of_cells = largest(self.coherence.iter().map(|own| own.energy.sqrt())) * T::OF_CELLS;
        let of_samples = if self.options.tolerance >= SINGLE_TOLERANCE {
            OF_SAMPLES
        } else {
            0.0
        };
        let of_coefficients = of_all(&|errors| errors.coefficients::<T>(&self.tables));
        ErrorBound {
            kernel: largest(self.coherence.iter().map(kernel)),
            truncation: of_all(&|errors| errors.truncation(&self.tables, steps.powers)),
            rounding: of_coefficients.hypot(T::ROUNDING).hypot(of_cells).hypot(of_samples),
            equal_rounding: T::EQUAL_ROUNDING,
            strongest: of_all(&Errors::share_of_strongest),
            num_weak: self.num_paths.saturating_sub(1) as f64,
        }
    }

    /// True if the error keeps the tolerance for a gain.
    pub fn keeps(&self, known: Known) -> bool {
        self.error.with_gain(known.gain) <= self.options.tolerance
    }

    /// Samples without a scale, times `scale`; and that.
    pub fn samples(&self) -> (Vec<Complex<T>>, f64) {
        // Factors of the samples take back the scale where single precision can.
        let back = if size_of::<T>() == 8 || self.scale.log2().abs() <= 60.0 {
            self.scale.recip()
        } else {
            1.0
        };
        let tables: Vec<Vec<GroupTables<T>>> = self.groups.iter().map(|group| self.group_tables(group)).collect();
        let mut exponents: Vec<u8> = self.groups.iter().map(|group| group.paths.frequency_exponent).collect();
        exponents.sort_unstable();
        exponents.dedup();
        let layer = |exponent: &u8| {
            let own = self
                .groups
                .iter()
                .zip(&tables)
                .filter(|(group, _)| group.paths.frequency_exponent == *exponent);
            let mut factors = self.tables.waveform.over_frequency(*exponent);
            factors.resize(self.tables.waveform.num_samples, 1.0);
            Layer {
                parts: own
                    .map(|(group, tables)| Part {
                        batches: group.batches.iter().map(Vec::as_slice).collect(),
                        num_blocks: group.blocks.len(),
                        tables,
                    })
                    .collect(),
                factors,
            }
        };
        let layers: Vec<Layer<T>> = exponents.iter().map(layer).collect();
        let samples = grid::samples(&self.tables, self.steps, &layers, back, self.errors.len(), self.options);
        (samples, self.scale * back)
    }

    /// Tables of every group of chirps for the blocks of a group.
    fn group_tables(&self, group: &Group<T>) -> Vec<GroupTables<T>> {
        let (num_groups, num_blocks) = (self.num_lane_groups(), group.blocks.len());
        let tables = |number: usize| {
            let block = &group.blocks[block_of(number, num_groups, num_blocks)];
            self.tables.group(block, T::LANES * number)
        };
        (0..num_groups).map(tables).collect()
    }

    /// Power of every channel, without the scale [W].
    pub fn power(&self) -> Vec<f64> {
        let back = self.scale.recip();
        self.errors.iter().map(|errors| errors.power * back * back).collect()
    }

    /// Most blocks of a group.
    pub fn num_blocks(&self) -> usize {
        self.groups.iter().map(|group| group.blocks.len()).max().unwrap_or(0)
    }

    /// Memory of records and grids [bytes].
    pub fn memory(&self) -> usize {
        let batches = self.groups.iter().flat_map(|group| group.batches.iter().flatten());
        let records: usize = batches
            .map(|batch| batch.blocks.iter().map(Vec::len).sum::<usize>())
            .sum();
        let grids = (1 + self.steps.num_grids()) * (self.tables.num_cells + self.steps.width) * 2 * T::LANES;
        records * size_of::<T::Record>() + grids * size_of::<T>()
    }
}

/// Largest number, or NaN.
fn largest(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |a, b| if a.is_nan() || a > b { a } else { b })
}

/// Records of some chunks of paths of some channels.
struct Build<'a, T: Number> {
    group: &'a PathGroup<'a>,
    shape: &'a Shape,
    blocks: &'a [Block],
    builders: &'a [Builder<'a>],
    channels: Range<usize>,
    chunks: Range<usize>,
    scale: f64,
    level: Level,
    number: PhantomData<T>,
}

impl<T: Number> Kernel for Build<'_, T> {
    type Output = Vec<Batch<T>>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Vec<Batch<T>> {
        let Shape {
            delay_rows,
            amplitude_rows,
            ..
        } = *self.shape;
        let is_static = self.shape.is_static();
        let most = (CHUNK * self.chunks.len()).min(self.shape.paths);
        let empty = || {
            let [statics, moving] = if is_static { [most, 0] } else { [0, most] };
            Batch {
                blocks: self.blocks.iter().map(|_| Vec::with_capacity(moving)).collect(),
                statics: Vec::with_capacity(statics),
                errors: Errors::default(),
            }
        };
        let mut batches: Vec<Batch<T>> = self.channels.clone().map(|_| empty()).collect();
        let mut chunk = Chunk::<T>::new(self.shape, self.channels.len());
        let mut delay: Vec<Lane<f64>> = vec![[0.0; CHUNK]; delay_rows];
        let mut re: Vec<Lane<T>> = vec![[T::zero(); CHUNK]; amplitude_rows];
        let mut im = re.clone();
        let num_chirps = self.blocks[self.blocks.len() - 1].chirps.end as f64;
        for index in self.chunks {
            let request = Request {
                channels: self.channels.clone(),
                paths: index * CHUNK..self.shape.paths.min((index + 1) * CHUNK),
                scale: self.scale,
                level: self.level,
            };
            T::fill(self.group.source, &request, &mut chunk);
            for (at, batch) in batches.iter_mut().enumerate() {
                let delays = &chunk.delay[at * delay_rows..][..delay_rows];
                let [real, imaginary] =
                    [&chunk.re, &chunk.im].map(|rows| &rows[at * amplitude_rows..][..amplitude_rows]);
                for (number, block) in self.blocks.iter().enumerate() {
                    expand::<f64, I>(&block.delay, delays, &mut delay);
                    expand::<T, I>(&block.amplitude, real, &mut re);
                    expand::<T, I>(&block.amplitude, imaginary, &mut im);
                    let paths = Coefficients {
                        num_paths: chunk.num_paths,
                        delay: &delay,
                        re: &re,
                        im: &im,
                    };
                    let of_block = (number, block.chirps.len() as f64 / num_chirps);
                    let builder = &self.builders[number];
                    if size_of::<T>() == 4 {
                        builder.add::<T, I, 2>(&paths, of_block, is_static, batch);
                    } else {
                        builder.add::<T, I, 1>(&paths, of_block, is_static, batch);
                    }
                }
            }
        }
        batches
    }
}
