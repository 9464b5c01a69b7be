//! Sum of records: grids of every channel and 16 chirps, one task each, transformed and added to the samples.

use num_complex::Complex32;

use super::kernel::{Spreading, WIDTHS};
use super::record::Batch;
use super::spread::{Spread, add_still, wrap_still};
use super::tables::{LANES, Tables};
use super::transform::{self, STRIDE};
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Level, Vector};

/// Steps of a sum: width of the kernel, and a second grid or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Steps {
    /// Width of the kernel [cells], 4 to 7.
    pub width: usize,
    /// Follow the curvature of phases within a chirp to first order: a second strength per path, on a grid of its own
    /// that is multiplied by the square of time.
    pub has_second: bool,
}

impl Steps {
    /// All steps, the cheapest first.
    pub fn all() -> impl Iterator<Item = Self> {
        let widths = |has_second| WIDTHS.into_iter().map(move |width| Self { width, has_second });
        [false, true].into_iter().flat_map(widths)
    }
}

/// Paths whose samples have a common factor over fast time.
pub struct Layer<'a> {
    /// Batches of every channel, in a fixed order.
    pub batches: &'a [Vec<Batch>],
    /// Factors of the samples of a chirp.
    pub factors: &'a [f64],
}

/// Layer with all factors ready for the grids.
struct Prepared<'a> {
    batches: &'a [Vec<Batch>],
    /// Factors of the samples of the first and of the second grid.
    factors: [Vec<f32>; 2],
    /// Grids of one chirp of what stands still, by channel; empty where nothing does.
    still: Vec<Vec<f32>>,
}

/// Add samples `(channel, chirp, sample)` of all layers to `out`, times `factor`. Tasks are channels and groups of 16
/// chirps, and each adds its paths in their order: the samples do not depend on the number of threads.
pub fn add_samples(
    tables: &Tables,
    steps: Steps,
    layers: &[Layer],
    factor: f64,
    (level, is_parallel): (Level, bool),
    out: &mut [Complex32],
) {
    let spreading = Spreading::new(steps.width, tables.num_samples, tables.num_cells);
    let prepare = |layer: &Layer| {
        let both = layer.factors.iter().zip(&spreading.factors);
        let first: Vec<f64> = both.map(|(own, kernel)| own * kernel * factor).collect();
        let second = first.iter().zip(&tables.second).map(|(first, second)| first * second);
        [
            first.iter().map(|number| *number as f32).collect(),
            second.map(|number| number as f32).collect(),
        ]
    };
    let still = |(layer, channel): (&Layer, usize)| {
        level.run(SpreadStill {
            batches: &layer.batches[channel],
            spreading: &spreading,
            num_cells: tables.num_cells,
        })
    };
    let channels = |layer: &Layer| 0..layer.batches.len();
    let pairs: Vec<_> = layers
        .iter()
        .flat_map(|layer| channels(layer).map(move |channel| (layer, channel)))
        .collect();
    let mut stills = parallel::map(is_parallel, pairs, still).into_iter();
    let mut prepared = Vec::new();
    for layer in layers {
        prepared.push(Prepared {
            batches: layer.batches,
            factors: prepare(layer),
            still: stills.by_ref().take(layer.batches.len()).collect(),
        });
    }
    let rows = out.chunks_mut(tables.num_chirps * tables.num_samples).enumerate();
    let tasks: Vec<_> = rows
        .flat_map(|(channel, samples)| {
            let groups = samples.chunks_mut(LANES * tables.num_samples).enumerate();
            groups.map(move |(group, samples)| (channel, group, samples))
        })
        .collect();
    parallel::map(is_parallel, tasks, |(channel, group, out)| {
        level.run(AddGroup {
            spread: Spread {
                tables,
                group: &tables.groups[group],
                spreading: &spreading,
            },
            has_second: steps.has_second,
            layers: &prepared,
            channel,
            out,
        });
    });
}

/// Grid of one chirp of the still paths of a channel; empty if there are none.
struct SpreadStill<'a> {
    batches: &'a [Batch],
    spreading: &'a Spreading,
    num_cells: usize,
}

impl Kernel for SpreadStill<'_> {
    type Output = Vec<f32>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Vec<f32> {
        let mut grid = Vec::new();
        for batch in self.batches {
            if batch.still.is_empty() {
                continue;
            }
            grid.resize(2 * (self.num_cells + self.spreading.width), 0.0);
            let (spreading, paths, num_cells) = (self.spreading, &batch.still, self.num_cells);
            match spreading.width {
                4 => add_still::<I, 4>(spreading, paths, num_cells, &mut grid),
                5 => add_still::<I, 5>(spreading, paths, num_cells, &mut grid),
                6 => add_still::<I, 6>(spreading, paths, num_cells, &mut grid),
                _ => add_still::<I, 7>(spreading, paths, num_cells, &mut grid),
            }
        }
        if !grid.is_empty() {
            wrap_still(self.num_cells, &mut grid);
        }
        grid
    }
}

/// Samples of a channel in 16 chirps.
struct AddGroup<'a> {
    spread: Spread<'a>,
    has_second: bool,
    layers: &'a [Prepared<'a>],
    channel: usize,
    out: &'a mut [Complex32],
}

impl Kernel for AddGroup<'_> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) {
        let tables = self.spread.tables;
        let width = self.spread.spreading.width;
        let size = (tables.num_cells + width) * STRIDE;
        let (mut grid, mut scratch) = (vec![0.0; size], vec![0.0; size]);
        let mut second = vec![0.0; if self.has_second { size } else { 0 }];
        for layer in self.layers {
            let (batches, still) = (&layer.batches[self.channel], &layer.still[self.channel]);
            let mut is_moving = false;
            for batch in batches {
                is_moving |= !batch.moving.is_empty();
            }
            if !is_moving && still.is_empty() {
                continue;
            }
            grid.fill(0.0);
            second.fill(0.0);
            if !still.is_empty() {
                for cell in 0..tables.num_cells {
                    for part in 0..2 {
                        let number = I::F32::splat(still[2 * cell + part]);
                        number.store(&mut grid[cell * STRIDE + part * LANES..]);
                    }
                }
            }
            for batch in batches {
                match width {
                    4 => self.spread.add::<I, 4>(&batch.moving, &mut grid, &mut second),
                    5 => self.spread.add::<I, 5>(&batch.moving, &mut grid, &mut second),
                    6 => self.spread.add::<I, 6>(&batch.moving, &mut grid, &mut second),
                    _ => self.spread.add::<I, 7>(&batch.moving, &mut grid, &mut second),
                }
            }
            let num_grids = if self.has_second && is_moving { 2 } else { 1 };
            for number in 0..num_grids {
                let own = if number == 0 { &mut grid } else { &mut second };
                wrap(own, tables.num_cells);
                let spectrum = transform::inverse::<I::F32>(own, &mut scratch, tables.num_cells, &tables.twiddles);
                add_to_samples(tables, spectrum, &layer.factors[number], self.out);
            }
        }
    }
}

/// Add the cells beyond the last of a grid to the first ones.
#[cfg_attr(optimised, inline(always))]
fn wrap(grid: &mut [f32], num_cells: usize) {
    let (cells, beyond) = grid.split_at_mut(num_cells * STRIDE);
    for i in 0..beyond.len() {
        cells[i] += beyond[i];
    }
}

/// Add a spectrum to the samples `(chirp, sample)`: the middle sample is that of cell zero.
#[cfg_attr(optimised, inline(always))]
fn add_to_samples(tables: &Tables, spectrum: &[f32], factors: &[f32], out: &mut [Complex32]) {
    let (num_samples, num_cells) = (tables.num_samples, tables.num_cells);
    let num_chirps = out.len() / num_samples;
    for sample in 0..num_samples {
        let cell = (sample + num_cells - num_samples / 2) % num_cells;
        let parts = &spectrum[cell * STRIDE..][..STRIDE];
        let factor = factors[sample];
        for chirp in 0..num_chirps.min(LANES) {
            let sum = &mut out[chirp * num_samples + sample];
            sum.re += factor * parts[chirp];
            sum.im += factor * parts[chirp + LANES];
        }
    }
}
