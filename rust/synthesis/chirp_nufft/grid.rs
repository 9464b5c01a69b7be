//! Sum of records: grids of every channel and of the chirps of all lanes, one task each, transformed and added to the
//! samples.

use num_complex::Complex;

use super::number::Number;
use super::record::Batch;
use super::spread::{Spread, Spreading, add_static, wrap_static};
use super::tables::{GroupTables, Tables};
use crate::cancel::Cancel;
use crate::numeric::fft::{self, twiddles};
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Real, Vector};
use crate::synthesis::report::Options;

/// Width of a kernel, and numbers of grids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Steps {
    /// Width of the kernel [cells].
    pub width: usize,
    /// Numbers of grids of even and of odd powers of fast time after the first grid.
    pub powers: [usize; 2],
}

impl Steps {
    /// Number of grids.
    pub fn num_grids(&self) -> usize {
        1 + self.powers[0] + self.powers[1]
    }
}

/// Paths whose series are over the same blocks, and whose samples have a common factor over fast time.
pub struct Part<'a, T: Number> {
    /// Batches by channel.
    pub batches: Vec<&'a [Batch<T>]>,
    /// Number of blocks.
    pub num_blocks: usize,
    /// Tables of every group of chirps.
    pub tables: &'a [GroupTables<T>],
}

/// Paths whose samples have a common factor over fast time.
pub struct Layer<'a, T: Number> {
    /// The paths.
    pub parts: Vec<Part<'a, T>>,
    /// Factors of the samples of a chirp.
    pub factors: Vec<f64>,
}

/// Layer with all that its grids need.
struct Prepared<'a, T: Number> {
    parts: &'a [Part<'a, T>],
    /// Factors of the samples by grid.
    factors: Vec<Vec<T>>,
    /// Grids of one chirp of static paths, by channel; empty where there are none.
    statics: Vec<Vec<T>>,
}

/// Samples `(channel, chirp, sample)` of all layers times `factor`. Tasks are channels and groups of chirps, and each adds
/// its paths in their order: the samples do not depend on the number of threads.
pub fn samples<T: Number>(
    tables: &Tables,
    steps: Steps,
    layers: &[Layer<T>],
    factor: f64,
    num_channels: usize,
    options: &Options,
) -> Vec<Complex<T>> {
    let (num_samples, num_chirps) = (tables.waveform.num_samples, tables.waveform.chirp_times.len());
    let spreading = Spreading::new(steps.width, tables);
    let factors_of = |layer: &Layer<T>| -> Vec<Vec<T>> {
        // Even powers of fast time, then odd ones.
        let (mut powers, v) = (Vec::new(), |u: f64| u * u - tables.moments.square);
        let mut power = vec![factor; num_samples];
        for _ in 0..=steps.powers[0].max(steps.powers[1]) {
            let next = power
                .iter()
                .zip(&tables.times)
                .map(|(power, u)| power * v(*u))
                .collect();
            powers.push(std::mem::replace(&mut power, next));
        }
        let odd = |power: &Vec<f64>| power.iter().zip(&tables.times).map(|(power, u)| power * u).collect();
        let odd: Vec<Vec<f64>> = powers[..steps.powers[1]].iter().map(odd).collect();
        let own = |(sample, power): (usize, &f64)| T::of(layer.factors[sample] * spreading.factors[sample] * power);
        let all = powers[..=steps.powers[0]].iter().chain(&odd);
        all.map(|powers| powers.iter().enumerate().map(own).collect()).collect()
    };
    let static_grids = |layer: &Layer<T>| -> Vec<Vec<T>> {
        let of_channel = |channel: usize| {
            options.level.run(SpreadStatic {
                parts: &layer.parts,
                channel,
                spreading: &spreading,
                num_cells: tables.num_cells,
            })
        };
        parallel::map(options.is_parallel, (0..num_channels).collect(), of_channel)
    };
    let prepared: Vec<Prepared<T>> = layers
        .iter()
        .map(|layer| Prepared {
            parts: &layer.parts,
            factors: factors_of(layer),
            statics: static_grids(layer),
        })
        .collect();
    let twiddles = twiddles(tables.num_cells);
    let mut out = vec![Complex::new(T::zero(), T::zero()); num_channels * num_chirps * num_samples];
    let rows = out.chunks_mut(num_chirps * num_samples).enumerate();
    let tasks: Vec<_> = rows
        .flat_map(|(channel, samples)| {
            let groups = samples.chunks_mut(T::LANES * num_samples).enumerate();
            groups.map(move |(group, samples)| (channel, group, samples))
        })
        .collect();
    parallel::map(options.is_parallel, tasks, |(channel, group, out)| {
        options.level.run(AddGroup {
            tables,
            spreading: &spreading,
            steps,
            twiddles: &twiddles,
            layers: &prepared,
            channel,
            group,
            cancel: options.cancel,
            out,
        });
    });
    out
}

/// Grid of one chirp of the static paths of a channel; empty if there are none.
struct SpreadStatic<'a, T: Number> {
    parts: &'a [Part<'a, T>],
    channel: usize,
    spreading: &'a Spreading<T>,
    num_cells: usize,
}

impl<T: Number> Kernel for SpreadStatic<'_, T> {
    type Output = Vec<T>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Vec<T> {
        let mut grid = Vec::new();
        for part in self.parts {
            for batch in part.batches[self.channel] {
                if batch.statics.is_empty() {
                    continue;
                }
                grid.resize(2 * (self.num_cells + self.spreading.width), T::zero());
                let (spreading, paths, num_cells) = (self.spreading, &batch.statics, self.num_cells);
                match (size_of::<T>(), spreading.width) {
                    (4, 4) => add_static::<T, I, 4>(spreading, paths, num_cells, &mut grid),
                    (4, 6) => add_static::<T, I, 6>(spreading, paths, num_cells, &mut grid),
                    (_, 8) => add_static::<T, I, 8>(spreading, paths, num_cells, &mut grid),
                    (8, 10) => add_static::<T, I, 10>(spreading, paths, num_cells, &mut grid),
                    (8, 12) => add_static::<T, I, 12>(spreading, paths, num_cells, &mut grid),
                    (8, 14) => add_static::<T, I, 14>(spreading, paths, num_cells, &mut grid),
                    _ => unreachable!("widths are those of the precision"),
                }
            }
        }
        if !grid.is_empty() {
            wrap_static(self.num_cells, &mut grid);
        }
        grid
    }
}

/// Samples of a channel in the chirps of a group.
struct AddGroup<'a, T: Number> {
    tables: &'a Tables<'a>,
    spreading: &'a Spreading<T>,
    steps: Steps,
    twiddles: &'a [T],
    layers: &'a [Prepared<'a, T>],
    channel: usize,
    group: usize,
    cancel: Option<&'a Cancel>,
    out: &'a mut [Complex<T>],
}

impl<T: Number> Kernel for AddGroup<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) {
        let num_cells = self.tables.num_cells;
        let size = (num_cells + self.steps.width) * 2 * T::LANES;
        let (mut grid, mut scratch) = (vec![T::zero(); size], vec![T::zero(); size]);
        let mut further = vec![vec![T::zero(); size]; self.steps.num_grids() - 1];
        let mut is_first = true;
        for layer in self.layers {
            let statics = &layer.statics[self.channel];
            if !std::mem::take(&mut is_first) {
                grid.fill(T::zero());
                for grid in &mut further {
                    grid.fill(T::zero());
                }
            }
            if !statics.is_empty() {
                for cell in 0..num_cells {
                    for part in 0..2 {
                        let number = <T::In<I>>::splat(statics[2 * cell + part]);
                        number.store(&mut grid[(2 * cell + part) * T::LANES..]);
                    }
                }
            }
            let mut is_moving = false;
            for part in layer.parts {
                is_moving |= self.spread::<I>(part, &mut grid, &mut further);
            }
            if statics.is_empty() && !is_moving {
                continue;
            }
            for number in 0..if is_moving { self.steps.num_grids() } else { 1 } {
                let own = if number == 0 {
                    &mut grid
                } else {
                    &mut further[number - 1]
                };
                wrap(own, num_cells * 2 * T::LANES);
                let spectrum = fft::inverse::<T::In<I>>(own, &mut scratch, num_cells, self.twiddles);
                add_to_samples(num_cells, spectrum, &layer.factors[number], self.out);
            }
        }
    }
}

impl<T: Number> AddGroup<'_, T> {
    /// Spread the moving paths of a part. Returns true if there are any.
    #[cfg_attr(optimised, inline(always))]
    fn spread<I: Isa>(&self, part: &Part<T>, grid: &mut [T], further: &mut [Vec<T>]) -> bool {
        let spread = Spread {
            tables: self.tables,
            group: &part.tables[self.group],
            spreading: self.spreading,
            powers: self.steps.powers,
        };
        let block = block_of(self.group, part.tables.len(), part.num_blocks);
        let mut is_moving = false;
        for batch in part.batches[self.channel] {
            let Some(records) = batch.blocks.get(block).filter(|records| !records.is_empty()) else {
                continue;
            };
            if self.cancel.is_some_and(Cancel::is_asked) {
                break;
            }
            is_moving = true;
            match (size_of::<T>(), self.steps.width) {
                (4, 4) => spread.add::<I, 4>(records, grid, further),
                (4, 6) => spread.add::<I, 6>(records, grid, further),
                (_, 8) => spread.add::<I, 8>(records, grid, further),
                (8, 10) => spread.add::<I, 10>(records, grid, further),
                (8, 12) => spread.add::<I, 12>(records, grid, further),
                (8, 14) => spread.add::<I, 14>(records, grid, further),
                _ => unreachable!("widths are those of the precision"),
            }
        }
        is_moving
    }
}

/// Block of a group of chirps.
pub fn block_of(group: usize, num_groups: usize, num_blocks: usize) -> usize {
    group * num_blocks / num_groups
}

/// Add the cells beyond the last of a grid to the first ones.
#[cfg_attr(optimised, inline(always))]
fn wrap<T: Real>(grid: &mut [T], end: usize) {
    let (cells, beyond) = grid.split_at_mut(end);
    for i in 0..beyond.len() {
        cells[i] = cells[i] + beyond[i];
    }
}

/// Add a spectrum to the samples `(chirp, sample)`: cell zero has the middle sample.
#[cfg_attr(optimised, inline(always))]
fn add_to_samples<T: Number>(num_cells: usize, spectrum: &[T], factors: &[T], out: &mut [Complex<T>]) {
    let num_samples = factors.len();
    let num_chirps = out.len() / num_samples;
    for sample in 0..num_samples {
        let cell = (sample + num_cells - num_samples / 2) % num_cells;
        let parts = &spectrum[cell * 2 * T::LANES..][..2 * T::LANES];
        let factor = factors[sample];
        for chirp in 0..num_chirps.min(T::LANES) {
            let sum = &mut out[chirp * num_samples + sample];
            sum.re = sum.re + factor * parts[chirp];
            sum.im = sum.im + factor * parts[chirp + T::LANES];
        }
    }
}
