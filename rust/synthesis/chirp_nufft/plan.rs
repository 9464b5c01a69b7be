//! Records of all paths in one precision, in blocks of chirps short enough for them, and the cheapest steps that keep a
//! tolerance.

use std::marker::PhantomData;
use std::ops::Range;

use super::coherence::SumCells;
use super::fast_time::{FastTime, LaneTables, Nodes, Orders};
use super::number::{LaneRow, MAX_ORDERS, Number};
use super::records::{Batch, Build, Errors, counts};
use super::spread::Steps;
use crate::cancel::Cancel;
use crate::error::Result;
use crate::numeric::kaiser_bessel::ToneError;
use crate::numeric::parallel;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{Block, CHUNK};
use crate::synthesis::report::{ErrorBound, Options, SINGLE_TOLERANCE, largest};
use crate::synthesis::source::{PathGroup, PathSource};

/// Share of the tolerance that errors of long blocks may have.
const BLOCK_SHARE: f64 = 0.3;

/// Share of the tolerance that the bound of the error may fill.
const MARGIN: f64 = 0.95;

/// Gain that steps allow for where it costs nothing but cells: more makes a second run.
const RESERVE: f64 = 1.4;

/// Cost of the values at nodes, relative to the first order.
const NODES: f64 = 1.5;

/// Cost of a likely second run, in cells of a grid that a path is spread on.
const SECOND_RUN: f64 = 2.5;

/// Rounding of samples in single precision, rms relative to them.
const OF_SAMPLES: f64 = 2.2e-8;

/// Chunks of paths of one task, a constant: sums of errors do not depend on the number of threads.
const CHUNKS: usize = 8;

/// Tolerance from which one record in [`STEP`] is enough to measure energies: the energy of the others may be equally
/// strong, which the narrowest kernel allows.
const COARSE: f64 = 1e-2;
const STEP: usize = 4;

/// Fewest paths for a measurement by some of them.
const FEWEST_SAMPLED: usize = 4096;

/// Tasks that tell whether blocks are short enough, before all are built.
const NUM_PROBES: usize = 2;

/// Parts of the batches of a channel that are measured side by side, a constant.
const SHARES: usize = 4;

/// Records of a group of paths.
pub struct RecordGroup<T> {
    /// Power of the frequency, see [`PathGroup`].
    pub frequency_exponent: u8,
    /// True if paths do not move.
    pub is_static: bool,
    /// Blocks of chirps.
    pub blocks: Vec<Block>,
    /// Batches of every channel, in a fixed order.
    pub batches: Vec<Vec<Batch<T>>>,
}

/// Records of all paths.
pub struct ChirpPlan<'a, T> {
    /// Constants of the frame.
    pub fast_time: FastTime<'a>,
    /// See [`FastTime::sizes`].
    sizes: [f64; MAX_ORDERS],
    /// Options of the sum.
    pub options: &'a Options<'a>,
    /// Groups of paths.
    pub groups: Vec<RecordGroup<T>>,
    /// Factor of amplitudes, a power of two.
    pub scale: f64,
    /// Number of paths of a channel.
    num_paths: usize,
    /// Errors by channel.
    pub errors: Vec<Errors<f64>>,
    /// Energy beside the chirps, relative to paths of independent phases; the largest of all channels.
    pub energy: f64,
    /// Cheapest steps that keep the tolerance, or the finest.
    pub steps: Steps,
    /// Error of these steps.
    pub error: ErrorBound,
}

impl<'a, T: Number> ChirpPlan<'a, T> {
    /// Build the records of all paths, and choose the steps.
    pub fn new(waveform: &'a Waveform, groups: &[PathGroup], options: &'a Options<'a>) -> Result<Self> {
        let fast_time = FastTime::new(waveform);
        let scales = groups.iter().map(|group| group.source.scale());
        let mut plan = Self {
            sizes: fast_time.sizes(),
            fast_time,
            options,
            groups: Vec::new(),
            scale: scales.fold(f64::INFINITY, f64::min),
            num_paths: groups.iter().map(|group| group.source.shape().paths).sum(),
            errors: Vec::new(),
            energy: options.known.coherence.powi(2),
            steps: Steps::default(),
            error: ErrorBound::default(),
        };
        for group in groups {
            let (group, errors) = plan.build(group)?;
            plan.groups.push(group);
            plan.errors.resize(errors.len(), Errors::default());
            for (sum, own) in plan.errors.iter_mut().zip(&errors) {
                sum.add(own, 1.0);
            }
        }
        plan.energy = largest(plan.measure().into_iter().chain([plan.energy]));
        plan.choose();
        Ok(plan)
    }

    /// Number of groups of chirps that are spread side by side.
    fn num_lane_groups(&self) -> usize {
        self.fast_time.waveform.chirp_times.len().div_ceil(T::LANES)
    }

    /// Blocks of chirps of whole groups, and the orders of fast time in them.
    fn blocks(&self, source: &dyn PathSource, number: usize) -> Vec<(Block, Vec<Orders>)> {
        let (shape, num_groups) = (source.shape(), self.num_lane_groups());
        let waveform = self.fast_time.waveform;
        // The first group of a block.
        let first = |block: usize| (block * num_groups).div_ceil(number);
        let of_block = |block: usize| {
            let end = (T::LANES * first(block + 1)).min(waveform.chirp_times.len());
            let block = Block::new(waveform, &shape, T::LANES * first(block)..end);
            let [num_turns, num_amplitudes] = counts::<T>(&shape);
            let orders = self.fast_time.orders::<T>(&block, num_amplitudes.max(num_turns + 1));
            (block, orders)
        };
        (0..number).map(of_block).collect()
    }

    /// Build the records of a group, with half as long blocks until they are short enough, and sum their errors by channel.
    fn build(&self, group: &PathGroup) -> Result<(RecordGroup<T>, Vec<Errors<f64>>)> {
        let (source, shape) = (group.source, group.source.shape());
        let parts = |number: usize, size: usize| {
            let firsts = (0..number).step_by(size.clamp(1, number));
            firsts.map(move |first| first..number.min(first + size))
        };
        let tasks: Vec<(Range<usize>, Range<usize>)> = parts(shape.channels, source.channels_together())
            .flat_map(|channels| {
                let chunks = parts(shape.paths.div_ceil(CHUNK), CHUNKS);
                chunks.map(move |chunks| (channels.clone(), chunks))
            })
            .collect();
        let (mut number, mut step) = (1, 1);
        loop {
            let blocks = self.blocks(source, number);
            let build = |(channels, chunks): (Range<usize>, Range<usize>)| {
                self.options.cancel.map_or(Ok(()), Cancel::check)?;
                let batches = self.options.level.run(Build {
                    fast_time: &self.fast_time,
                    sizes: &self.sizes,
                    source,
                    blocks: &blocks,
                    channels: channels.clone(),
                    chunks,
                    scale: self.scale,
                    tolerance: self.options.tolerance / self.options.known.gain,
                    level: self.options.level,
                    number: PhantomData,
                });
                Ok((channels.start, batches))
            };
            let some = tasks.iter().step_by(step).cloned().collect();
            let mut batches: Vec<Vec<Batch<T>>> = (0..shape.channels).map(|_| Vec::new()).collect();
            let mut errors = vec![Errors::default(); shape.channels];
            for built in parallel::map(self.options.is_parallel, some, build) {
                let (first, built) = built?;
                for (channel, batch) in (first..).zip(built) {
                    errors[channel].add(&batch.errors, 1.0);
                    batches[channel].push(batch);
                }
            }
            if errors.iter().any(|errors| !errors.power.is_finite()) {
                return Err(source.not_finite());
            }
            let of_blocks = largest(errors.iter().map(|errors| errors.of_blocks::<T>(&self.fast_time)));
            let is_short = of_blocks <= BLOCK_SHARE * self.options.tolerance;
            if !is_short && 2 * number <= self.num_lane_groups() {
                (number, step) = (2 * number, tasks.len().div_ceil(NUM_PROBES));
            } else if step > 1 {
                step = 1;
            } else {
                let group = RecordGroup {
                    frequency_exponent: group.frequency_exponent,
                    is_static: shape.is_static(),
                    blocks: blocks.into_iter().map(|(block, _)| block).collect(),
                    batches,
                };
                return Ok((group, errors));
            }
        }
    }

    /// Energies beside the chirps, by channel: means over blocks and groups.
    fn measure(&self) -> Vec<f64> {
        if self.num_paths <= 1 {
            return vec![1.0; self.errors.len()];
        }
        let is_coarse = self.options.tolerance >= COARSE && self.num_paths >= FEWEST_SAMPLED;
        let step = if is_coarse { STEP } else { 1 };
        // Groups with the same number of blocks share them.
        let sharing = by_key(self.groups.iter(), |group| group.blocks.len());
        let of_channel = |channel: usize| {
            let (mut power, mut energy) = (0.0, 0.0);
            for groups in &sharing {
                let batches: Vec<&Batch<T>> = groups.iter().flat_map(|group| &group.batches[channel]).collect();
                let blocks = &groups[0].blocks;
                for (number, block) in blocks.iter().enumerate() {
                    let shares = batches.chunks(batches.len().div_ceil(SHARES).max(1)).collect();
                    let sums = parallel::map(self.options.is_parallel, shares, |batches: &[&Batch<T>]| {
                        self.options.level.run(SumCells {
                            fast_time: &self.fast_time,
                            block,
                            number,
                            batches,
                            step,
                        })
                    });
                    let sums = sums.into_iter().reduce(|mut sums, others| {
                        sums.join(&others);
                        sums
                    });
                    if let Some(sums) = sums.filter(|sums| sums.power() > 0.0) {
                        let own = sums.power() / blocks.len() as f64;
                        power += own;
                        energy += own * sums.energy(self.errors[channel].share_of_strongest());
                    }
                }
            }
            if power > 0.0 { energy / power } else { 1.0 }
        };
        parallel::map(self.options.is_parallel, (0..self.errors.len()).collect(), of_channel)
    }

    /// Choose the cheapest steps that keep the tolerance, or the steps of the least error.
    fn choose(&mut self) {
        let (known, tolerance) = (self.options.known.gain, MARGIN * self.options.tolerance);
        // Degrees of fast time, the largest first.
        let relative = |errors: &Errors<f64>, n: usize| errors.orders[n] / errors.power.max(f64::MIN_POSITIVE);
        let size = |n| largest(self.errors.iter().map(|errors| relative(errors, n)));
        let mut degrees: Vec<usize> = (1..=T::DEGREE).collect();
        degrees.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
        let mut best = (f64::INFINITY, f64::INFINITY);
        for number in 0..=T::DEGREE {
            let degrees: Vec<usize> = [0].iter().chain(&degrees[..number]).copied().collect();
            let left_out = |errors: &Errors<f64>| -> f64 {
                let orders = (1..MAX_ORDERS).filter(|n| !degrees.contains(n));
                orders.map(|n| errors.orders[n]).sum::<f64>()
            };
            let all_steps = T::WIDTHS.iter().flat_map(|width| [(*width, true), (*width, false)]);
            for (width, is_first_order) in all_steps.filter(|(_, first)| *first || number > 0) {
                let bound = self.bound(width, |errors| {
                    left_out(errors) + if is_first_order { errors.products } else { 0.0 }
                });
                // The exceeded error, then the cost.
                let excess = bound.with_gain(known) / tolerance;
                let excess = if excess.is_nan() {
                    f64::INFINITY
                } else {
                    excess.max(1.0)
                };
                let has_reserve = bound.with_gain(known.max(RESERVE)) <= tolerance;
                let of_nodes = if is_first_order { 1.0 } else { NODES };
                let cost = of_nodes * (width * (1 + number)) as f64 + if has_reserve { 0.0 } else { SECOND_RUN };
                if (excess, cost) < best || best.0 == f64::INFINITY {
                    best = (excess, cost);
                    self.error = bound;
                    self.steps = Steps {
                        width,
                        degrees: degrees.clone(),
                        is_first_order,
                    };
                }
            }
        }
    }

    /// Bounds of errors, the largest of all channels.
    fn bound(&self, width: usize, left_out: impl Fn(&Errors<f64>) -> f64) -> ErrorBound {
        let of_all = |bound: &dyn Fn(&Errors<f64>) -> f64| largest(self.errors.iter().map(bound));
        // Cells hold what adds up beside the chirps as well.
        let of_cells = self.energy.sqrt() * T::OF_CELLS;
        let of_samples = if self.options.tolerance >= SINGLE_TOLERANCE {
            OF_SAMPLES
        } else {
            0.0
        };
        let of_coefficients = of_all(&Errors::rounding::<T>);
        ErrorBound {
            kernel: ToneError::new(width).with_energy(self.energy),
            truncation: of_all(&|errors| errors.truncation(&self.fast_time, left_out(errors))),
            rounding: of_coefficients.hypot(T::ROUNDING).hypot(of_cells).hypot(of_samples),
            equal_rounding: T::EQUAL_ROUNDING,
            strongest: of_all(&Errors::share_of_strongest),
            num_weak: self.num_paths.saturating_sub(1) as f64,
        }
    }

    /// Tables of every group of chirps for the blocks of a group of paths; of one for static paths.
    pub fn tables(&self, group: &RecordGroup<T>, nodes: &Nodes) -> Vec<LaneTables<T>> {
        let num_groups = if group.is_static { 1 } else { self.num_lane_groups() };
        let num_blocks = group.blocks.len();
        let counts = group.batches[0][0].counts;
        let tables = |number: usize| {
            let block = &group.blocks[block_of(number, num_groups, num_blocks)];
            self.fast_time
                .tables(block, T::LANES * number, counts, (nodes, &self.steps.degrees))
        };
        (0..num_groups).map(tables).collect()
    }

    /// Memory of records and grids [bytes].
    pub fn memory(&self) -> usize {
        let batches = self.groups.iter().flat_map(|group| group.batches.iter().flatten());
        let rows: usize = batches.flat_map(|batch| &batch.blocks).map(Vec::len).sum();
        let num_grids = 1 + self.steps.degrees.len();
        let grids = num_grids * (self.fast_time.num_cells + self.steps.width) * 2 * T::LANES;
        rows * size_of::<LaneRow<T>>() + grids * size_of::<T>()
    }
}

/// Block of a group of chirps.
pub fn block_of(group: usize, num_groups: usize, num_blocks: usize) -> usize {
    group * num_blocks / num_groups
}

/// Groups with equal keys together, by increasing key.
pub fn by_key<'a, T, K: Ord>(
    groups: impl Iterator<Item = &'a RecordGroup<T>>,
    key: impl Fn(&RecordGroup<T>) -> K,
) -> Vec<Vec<&'a RecordGroup<T>>> {
    let mut sorted: Vec<&RecordGroup<T>> = groups.collect();
    sorted.sort_by_key(|group| key(group));
    let runs = sorted.chunk_by(|a, b| key(a) == key(b));
    runs.map(<[_]>::to_vec).collect()
}
