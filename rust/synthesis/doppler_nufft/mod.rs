//! Range-Doppler NUFFT, for paths at constant rates: spreading on a grid of range and velocity, one FFT per velocity row,
//! a dense transform over slow time.
//!
//! The phases that such a plane wave leaves are expanded in closed form, see [`plan`]: every strength of a path has a
//! grid of its own; the weights of the kernel are shared. Static paths are spread over range alone, once for all chirps.

mod grid;
mod plan;
mod points;
mod scan;
mod slow_time;
mod spread;
#[cfg(test)]
mod tests;

use num_complex::Complex;

use crate::cancel::Cancel;
use crate::error::{Result, fits_memory};
use crate::numeric::parallel;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{Block, CHUNK, Chunk};
use crate::synthesis::coherence::CellSums;
use crate::synthesis::doppler_nufft::grid::{Grid, Layout};
use crate::synthesis::doppler_nufft::plan::{DopplerPlan, kernel_error};
use crate::synthesis::doppler_nufft::points::{ComputePoints, Measured, Points};
use crate::synthesis::doppler_nufft::slow_time::SlowTime;
use crate::synthesis::doppler_nufft::spread::SpreadPoints;
use crate::synthesis::report::{ErrorBound, Options, Report, Samples, Sum};
use crate::synthesis::source::{Fill, PathGroup, Request, Shape};

/// Channels that share the cosines of slow time, and whose spectra are held at the same time.
const MAX_CHANNELS: usize = 4;

/// Parts of the paths of few channels, on grids of their own, whatever the number of threads: chunks of each, and most
/// parts.
const CHUNKS_OF_PART: usize = 256;
const MAX_PARTS: usize = 8;

/// Sum that is planned.
struct DopplerSum<'a> {
    groups: &'a [PathGroup<'a>],
    options: &'a Options<'a>,
    block: Block,
    plan: DopplerPlan<'a>,
    num_parts: usize,
    /// Power of two that all amplitudes are multiplied by.
    scale: f64,
}

/// Sum over groups of paths at constant rates, which do not depend on frequency: at least one, of equal numbers of
/// channels. None if no plan is known to keep the tolerance, as for paths that are too fast for a velocity axis.
pub fn sum(waveform: &Waveform, groups: &[PathGroup], options: &Options) -> Result<Option<Sum>> {
    let shapes: Vec<Shape> = groups.iter().map(|group| group.source.shape()).collect();
    // The interval of time is the same for all groups.
    let block = Block::new(waveform, &shapes[0], 0..waveform.chirp_times.len());
    let ranges = scan::delay_ranges(waveform, groups, options)?;
    let (num_channels, num_paths) = (shapes[0].channels, shapes.iter().map(|shape| shape.paths).sum());
    let plan = DopplerPlan::new(waveform, &block, ranges.as_ref(), num_paths, options);
    let is_enough = plan.error.with_gain(options.known.gain) <= options.tolerance;
    if !is_enough {
        return Ok(None);
    }
    let num_parts = if num_channels < MAX_CHANNELS {
        (num_paths.div_ceil(CHUNK) / CHUNKS_OF_PART).clamp(1, MAX_PARTS)
    } else {
        1
    };
    let (bytes, num_rows) = (
        if plan.is_single { 4 } else { 8 },
        plan.moving.map_or(0, |moving| moving.rows),
    );
    let layout = Layout::new(waveform.num_samples, plan.width, num_rows.max(1));
    let num_spectra = num_channels.min(MAX_CHANNELS);
    let num_grids = num_spectra * (num_parts + 1);
    fits_memory("grid", &[num_grids, plan.num_terms(), layout.size()], bytes)?;
    let scales = groups.iter().map(|group| group.source.scale());
    let sum = DopplerSum {
        groups,
        options,
        block,
        plan,
        num_parts,
        scale: scales.fold(f64::INFINITY, f64::min),
    };
    let plan = &sum.plan;
    let (samples, measured) = if plan.is_single {
        sum.samples::<f32>()?
    } else {
        sum.samples::<f64>()?
    };
    let most = |of: &dyn Fn(&Measured) -> f64| measured.iter().map(of).fold(0.0, f64::max);
    let share = |channel: &Measured| (channel.strongest / channel.power.max(f64::MIN_POSITIVE)).min(1.0);
    let energy = most(&|channel| channel.cells.energy(share(channel)));
    let load = most(&|channel| channel.cells.population()) * energy;
    let kernel = (plan.is_single, plan.width);
    let numbers = num_grids * layout.size() + num_spectra * layout.rows * 2 * layout.padded();
    let longest_moving = ranges.map_or(0.0, |ranges| ranges.as_flattened().iter().map(|x| x.abs()).sum());
    let back = sum.scale.recip();
    Ok(Some(Sum {
        samples,
        power: measured.iter().map(|channel| channel.power * back * back).collect(),
        coherence: energy.sqrt(),
        report: Report {
            num_blocks: 1,
            longest: most(&|channel| channel.longest).max(longest_moving),
            is_single: plan.is_single,
            width: plan.width,
            num_grids: plan.num_terms(),
            num_rows,
            memory: plan.num_terms() * numbers * bytes + num_grids * CellSums::MEMORY,
            error: ErrorBound {
                truncation: plan.error.truncation,
                strongest: most(&share),
                num_weak: num_paths.saturating_sub(1) as f64,
                ..kernel_error(waveform, kernel, plan.moving.is_some(), [energy, load])
            },
            ..Report::new("range-Doppler NUFFT", groups)
        },
    }))
}

impl DopplerSum<'_> {
    /// Samples in the precision of the plan, and what is measured of every channel.
    fn samples<T: Fill>(&self) -> Result<(Samples, Vec<Measured>)> {
        let (plan, is_parallel) = (&self.plan, self.options.is_parallel);
        let num_samples = plan.waveform.num_samples;
        let size = plan.waveform.chirp_times.len() * num_samples;
        let zero = Complex::new(T::zero(), T::zero());
        let mut samples = vec![zero; self.groups[0].source.shape().channels * size];
        let has_static = self.groups.iter().any(|group| group.source.shape().is_static());
        let static_grid = has_static.then(|| Grid::<T>::new(Layout::new(num_samples, plan.width, 1)));
        let moving = plan.moving.as_ref().map(|moving| {
            let grid = Grid::<T>::new(Layout::new(num_samples, plan.width, moving.rows));
            let slow_time = SlowTime::new(plan.waveform, &self.block, moving, grid.layout);
            (grid, slow_time)
        });
        let batches = samples.chunks_mut(MAX_CHANNELS * size).enumerate().collect();
        let results = parallel::map(is_parallel, batches, |(batch, samples)| {
            let mut samples: Vec<_> = samples.chunks_mut(size).collect();
            let tasks = (batch * MAX_CHANNELS..).zip(&mut samples).collect();
            let results = parallel::map(is_parallel, tasks, |(channel, samples)| {
                let mut measured = Measured::new(plan);
                if let Some(grid) = &static_grid {
                    let spectrum = self.spectra(grid, channel, &mut measured)?;
                    let (re, im) = spectrum.split_at(grid.layout.padded());
                    for chirp in samples.chunks_exact_mut(num_samples) {
                        for ((sample, re), im) in chirp.iter_mut().zip(re).zip(im) {
                            *sample = *sample + Complex::new(*re, *im);
                        }
                    }
                }
                let spectra = match &moving {
                    Some((grid, _)) => self.spectra(grid, channel, &mut measured)?,
                    None => Vec::new(),
                };
                Ok((spectra, measured))
            });
            let results: Result<Vec<(Vec<T>, Measured)>> = results.into_iter().collect();
            let (spectra, measured): (Vec<_>, Vec<_>) = results?.into_iter().unzip();
            if let Some((_, slow_time)) = &moving {
                slow_time.add(self.options.level, is_parallel, &spectra, &mut samples);
            }
            Ok(measured)
        });
        let measured: Result<Vec<Vec<Measured>>> = results.into_iter().collect();
        self.options.cancel.map_or(Ok(()), Cancel::check)?;
        let samples = Samples::new(&samples, self.scale.recip(), self.options.tolerance);
        Ok((samples, measured?.into_iter().flatten().collect()))
    }

    /// Spectra `(term, row, part, sample)` of the static or the moving paths of a channel.
    fn spectra<T: Fill>(&self, grid: &Grid<T>, channel: usize, measured: &mut Measured) -> Result<Vec<T>> {
        let Options { level, is_parallel, .. } = *self.options;
        let parts = parallel::map(is_parallel, (0..self.num_parts).collect(), |part| {
            self.fill_grid(grid, channel, part)
        });
        let mut sum: Vec<T> = Vec::new();
        for part in parts {
            let (cells, of_part) = part?;
            measured.join(&of_part);
            if sum.is_empty() {
                sum = cells;
            } else {
                for (a, b) in sum.iter_mut().zip(&cells) {
                    *a = *a + *b;
                }
            }
        }
        Ok(grid.spectra(level, is_parallel, &sum))
    }

    /// Spread a part of the static or the moving paths: grid `(term, row, cell)`.
    fn fill_grid<T: Fill>(&self, grid: &Grid<T>, channel: usize, part: usize) -> Result<(Vec<T>, Measured)> {
        let Options { level, cancel, .. } = *self.options;
        let is_static = grid.layout.rows == 1;
        let num_terms = if is_static { 1 } else { self.plan.num_terms() };
        let mut cells = vec![T::zero(); num_terms * grid.layout.size()];
        let mut measured = Measured::new(&self.plan);
        let mut points = Points::new(num_terms);
        let groups = self.groups.iter();
        for group in groups.filter(|group| group.source.shape().is_static() == is_static) {
            let shape = group.source.shape();
            let block = Block::new(self.plan.waveform, &shape, 0..self.plan.waveform.chirp_times.len());
            let mut chunk = Chunk::<T>::new(&shape, 1);
            let num_chunks = shape.paths.div_ceil(CHUNK);
            for index in part * num_chunks / self.num_parts..(part + 1) * num_chunks / self.num_parts {
                if cancel.is_some_and(Cancel::is_asked) {
                    break;
                }
                let request = Request::of_chunk(index, &shape, channel..channel + 1, self.scale, level);
                T::fill(group.source, &request, &mut chunk);
                level.run(ComputePoints {
                    plan: &self.plan,
                    layout: &grid.layout,
                    block: &block,
                    chunk: &chunk,
                    points: &mut points,
                    measured: &mut measured,
                });
                level.run(SpreadPoints {
                    grid,
                    points: &points,
                    cells: &mut cells,
                });
            }
            if !measured.power.is_finite() {
                return Err(group.source.not_finite());
            }
        }
        Ok((cells, measured))
    }
}
