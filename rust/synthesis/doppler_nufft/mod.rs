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

use num_complex::{Complex, Complex32, Complex64};

use crate::cancel::Cancel;
use crate::error::{Error, Result, fits_memory};
use crate::numeric::parallel;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{Block, CHUNK, Chunk};
use crate::synthesis::doppler_nufft::grid::{Layout, RangeTransform};
use crate::synthesis::doppler_nufft::plan::Plan;
use crate::synthesis::doppler_nufft::points::{Measured, PointMap, Points, PointsOf};
use crate::synthesis::doppler_nufft::scan::Scan;
use crate::synthesis::doppler_nufft::slow_time::SlowTime;
use crate::synthesis::doppler_nufft::spread::{Scratch, SpreadPoints, Tables, Widths};
use crate::synthesis::report::{ErrorBound, Options, Report, SINGLE_TOLERANCE, Samples, Sum};
use crate::synthesis::source::{PathGroup, Request, Shape};

/// Channels that share the cosines of slow time, and whose spectra are held at the same time.
const MAX_CHANNELS: usize = 4;

/// Parts of the paths of few channels, on grids of their own: chunks of each, and most parts.
const CHUNKS_OF_PART: usize = 256;
const MAX_PARTS: usize = 8;

/// Sum that is planned.
pub struct Prepared<'a> {
    waveform: &'a Waveform,
    groups: &'a [PathGroup<'a>],
    options: &'a Options<'a>,
    block: Block,
    plan: Option<Plan>,
    /// Power of two that all amplitudes are multiplied by.
    scale: f64,
    /// Report of the sum before it runs; an infinite error if the paths are too fast for a velocity axis.
    pub report: Report,
}

/// Plan the sum of groups of paths at constant rates, of equal numbers of channels.
pub fn prepare<'a>(
    waveform: &'a Waveform,
    groups: &'a [PathGroup<'a>],
    options: &'a Options<'a>,
) -> Result<Prepared<'a>> {
    let shapes: Vec<Shape> = groups.iter().map(|group| group.source.shape()).collect();
    let num_channels = shapes.first().map_or(0, |shape| shape.channels);
    // The interval of time is the same for all groups.
    let Some(shape) = shapes.first() else {
        return Err(Error::value("groups", "at least one group of paths", 0));
    };
    let block = Block::new(waveform, shape, 0..waveform.chirp_times.len());
    let scale = groups
        .iter()
        .map(|group| group.source.scale())
        .fold(f64::INFINITY, f64::min);
    let mut scan = Scan::new(waveform, groups, scale, options)?;
    let plan = |scan: &Scan| Plan::new(waveform, &block, scan, options.tolerance, options.known);
    let mut found = plan(&scan);
    if found.as_ref().is_some_and(|plan| plan.num_terms() > 1) {
        // Fewer may do.
        scan.add_moments(waveform, groups, scale, options)?;
        found = plan(&scan);
    }
    let plan = found;
    let count = |shape: &Shape| shape.channels * shape.paths;
    let mut report = Report {
        engine: "range-Doppler NUFFT",
        num_blocks: 1,
        longest: scan
            .moving
            .as_ref()
            .map_or(0.0, |moving| moving.delay[0].magnitude() + moving.delay[1].magnitude()),
        num_paths: shapes.iter().map(count).sum(),
        num_static: shapes.iter().filter(|shape| shape.is_static()).map(count).sum(),
        ..Report::default()
    };
    report.error.truncation = f64::INFINITY;
    if let Some(plan) = &plan {
        let kernel = (plan.width, plan.is_fine);
        let layout = Layout::new(waveform.num_samples, kernel, plan.num_rows().max(1));
        let bytes = if plan.is_single { 4 } else { 8 };
        let num_grids = num_channels.min(MAX_CHANNELS)
            * (num_parts(num_channels, report.num_paths / num_channels.max(1)) + 1)
            * plan.num_terms();
        fits_memory("grid", &[num_grids, layout.rows, layout.stride], bytes)?;
        report.is_single = plan.is_single;
        report.width = plan.width;
        report.num_grids = plan.num_terms();
        report.num_rows = plan.num_rows();
        report.memory = num_grids * layout.size() * bytes;
        report.error = plan.error;
    }
    Ok(Prepared {
        waveform,
        groups,
        options,
        block,
        plan,
        scale,
        report,
    })
}

/// Parts of the paths of a channel, whatever the number of threads.
fn num_parts(num_channels: usize, num_paths: usize) -> usize {
    if num_channels >= MAX_CHANNELS {
        1
    } else {
        (num_paths.div_ceil(CHUNK) / CHUNKS_OF_PART).clamp(1, MAX_PARTS)
    }
}

/// Samples, scaled, and what is measured of every channel.
type Scaled<T> = (Vec<Complex<T>>, Vec<Measured>);

impl Prepared<'_> {
    /// Form the sum.
    pub fn run(mut self) -> Result<Sum> {
        let Some(plan) = &self.plan else {
            let expected = "rates that a velocity axis can follow";
            return Err(Error::value("delay", expected, "faster ones"));
        };
        let is_single = self.options.tolerance >= SINGLE_TOLERANCE;
        let back = self.scale.recip();
        // In double precision: the scale may be out of the range of single precision where the samples are not.
        let (samples, measured) = if plan.is_single {
            let (samples, measured) = self.sum::<f32>(plan)?;
            (unscaled(&samples, back, is_single), measured)
        } else {
            let (samples, measured) = self.sum::<f64>(plan)?;
            (unscaled(&samples, back, is_single), measured)
        };
        let most = |numbers: &mut dyn Iterator<Item = f64>| numbers.fold(0.0, f64::max);
        let coherence = most(&mut measured.iter().map(|channel| channel.coherence.gain(1))).max(1.0);
        self.report.longest = most(&mut measured.iter().map(|channel| channel.longest)).max(self.report.longest);
        let share = |channel: &Measured| channel.strongest / channel.power.max(f64::MIN_POSITIVE);
        self.report.error = ErrorBound {
            strongest: most(&mut measured.iter().map(share)).min(1.0),
            num_weak: (self.report.num_paths / measured.len().max(1)).saturating_sub(1) as f64,
            ..plan.error_for(self.waveform, coherence)
        };
        Ok(Sum {
            samples,
            power: measured.iter().map(|channel| channel.power * back * back).collect(),
            coherence,
            report: self.report,
        })
    }

    /// Sum in the precision of the plan.
    fn sum<T: Widths>(&self, plan: &Plan) -> Result<Scaled<T>> {
        let num_samples = self.waveform.num_samples;
        let num_channels = self.groups[0].source.shape().channels;
        let num_chirp_samples = self.waveform.chirp_times.len() * num_samples;
        fits_memory("samples", &[num_channels, num_chirp_samples], size_of::<Complex<T>>())?;
        let mut samples = vec![Complex::new(T::zero(), T::zero()); num_channels * num_chirp_samples];
        let kernel = (plan.width, plan.is_fine);
        let axes = [
            Axes::<T>::new(Layout::new(num_samples, kernel, 1)),
            Axes::<T>::new(Layout::new(num_samples, kernel, plan.num_rows().max(1))),
        ];
        let slow_time = plan
            .moving
            .as_ref()
            .map(|moving| SlowTime::new(self.waveform, &self.block, moving, axes[1].layout));
        let channels: Vec<usize> = (0..num_channels).collect();
        let tasks = channels
            .chunks(MAX_CHANNELS)
            .zip(samples.chunks_mut(MAX_CHANNELS * num_chirp_samples))
            .collect();
        let results = parallel::map(self.options.is_parallel, tasks, |(channels, samples)| {
            let of_channel = |channel: &usize| self.spectra(plan, &axes, *channel);
            let spectra = parallel::map(self.options.is_parallel, channels.iter().collect(), of_channel);
            let spectra = spectra.into_iter().collect::<Result<Vec<Spectra<T>>>>()?;
            let mut samples: Vec<_> = samples.chunks_mut(num_chirp_samples).collect();
            for (samples, spectra) in samples.iter_mut().zip(&spectra) {
                add_to_chirps(&spectra.of_static, num_samples, samples);
            }
            let mut moving = Vec::new();
            let mut measured = Vec::new();
            for spectra in spectra {
                moving.push(spectra.moving);
                measured.push(spectra.measured);
            }
            if let Some(slow_time) = &slow_time {
                slow_time.add(self.options.level, self.options.is_parallel, &moving, &mut samples);
            }
            Ok(measured)
        });
        let mut measured = Vec::new();
        for result in results {
            measured.extend(result?);
        }
        self.options.cancel.map_or(Ok(()), Cancel::check)?;
        Ok((samples, measured))
    }

    /// Spectra of a channel over range, of all groups.
    fn spectra<T: Widths>(&self, plan: &Plan, axes: &[Axes<T>; 2], channel: usize) -> Result<Spectra<T>> {
        let num_channels = self.groups[0].source.shape().channels;
        let mut spectra = Spectra {
            of_static: Vec::new(),
            moving: Vec::new(),
            measured: Measured::new(self.waveform),
        };
        for (is_static, axes) in [true, false].into_iter().zip(axes) {
            let layout = &axes.layout;
            let num_terms = if is_static { 1 } else { plan.num_terms() };
            let mut sum = Vec::new();
            let mut exponents: Vec<u8> = Vec::new();
            let groups = || {
                self.groups
                    .iter()
                    .filter(|group| group.source.shape().is_static() == is_static)
            };
            for group in groups().filter(|group| group.source.shape().paths > 0) {
                if !exponents.contains(&group.frequency_exponent) {
                    exponents.push(group.frequency_exponent);
                }
            }
            for exponent in exponents {
                let layer: Vec<_> = groups().filter(|group| group.frequency_exponent == exponent).collect();
                let num_parts = num_parts(num_channels, self.report.num_paths / num_channels);
                let part = |part: usize| self.fill_grid(plan, axes, &layer, (channel, part, num_parts));
                let parts = parallel::map(self.options.is_parallel, (0..num_parts).collect(), part);
                let mut parts = parts.into_iter();
                let Some(first) = parts.next() else {
                    unreachable!("at least one part")
                };
                let (mut grid, measured) = first?;
                spectra.measured.join(&measured);
                for other in parts {
                    let (other, measured) = other?;
                    spectra.measured.join(&measured);
                    for (a, b) in grid.iter_mut().zip(&other) {
                        *a = *a + *b;
                    }
                }
                sum.resize(num_terms * layout.rows * 2 * layout.padded(), T::zero());
                let factors = self.waveform.over_frequency(exponent);
                let Options { level, is_parallel, .. } = *self.options;
                axes.range.add(level, is_parallel, &grid, &factors, &mut sum);
            }
            if is_static {
                spectra.of_static = sum;
            } else if sum.is_empty() {
                spectra.moving = vec![T::zero(); num_terms * layout.rows * 2 * layout.padded()];
            } else {
                spectra.moving = sum;
            }
        }
        Ok(spectra)
    }

    /// Spread a part of the paths of groups: grid `(term, row, cell)`.
    fn fill_grid<T: Widths>(
        &self,
        plan: &Plan,
        axes: &Axes<T>,
        groups: &[&PathGroup],
        (channel, part, num_parts): (usize, usize, usize),
    ) -> Result<(Vec<T>, Measured)> {
        let Options { level, cancel, .. } = *self.options;
        let layout = &axes.layout;
        let is_static = groups[0].source.shape().is_static();
        let num_terms = if is_static { 1 } else { plan.num_terms() };
        let mut grid = vec![T::zero(); num_terms * layout.size()];
        let mut measured = Measured::new(self.waveform);
        let mut points = Points::new(num_terms);
        let mut scratch = Scratch::new(layout.width);
        for group in groups {
            let shape = group.source.shape();
            let block = Block::new(self.waveform, &shape, self.block.chirps.clone());
            let map = PointMap::new(self.waveform, &block, plan, layout, is_static);
            let mut chunk = Chunk::<T>::new(&shape, 1);
            let num_chunks = shape.paths.div_ceil(CHUNK);
            for index in part * num_chunks / num_parts..(part + 1) * num_chunks / num_parts {
                if cancel.is_some_and(Cancel::is_asked) {
                    break;
                }
                let request = Request {
                    channels: channel..channel + 1,
                    paths: index * CHUNK..shape.paths.min((index + 1) * CHUNK),
                    scale: self.scale,
                    level,
                };
                T::fill(group.source, &request, &mut chunk);
                let points_of = PointsOf {
                    map: &map,
                    chunk: &chunk,
                    points: &mut points,
                    measured: &mut measured,
                };
                T::compute_points(level, points_of);
                let points = SpreadPoints {
                    layout,
                    tables: &axes.tables,
                    points: &points,
                    scratch: &mut scratch,
                    grid: &mut grid,
                };
                T::spread(level, points);
            }
            if !measured.power.is_finite() {
                return Err(group.source.not_finite());
            }
        }
        Ok((grid, measured))
    }
}

/// Grid of range and velocity, or of range alone, and what belongs to it.
struct Axes<T> {
    layout: Layout,
    tables: Tables<T>,
    range: RangeTransform<T>,
}

impl<T: Widths> Axes<T> {
    fn new(layout: Layout) -> Self {
        Self {
            layout,
            tables: Tables::new(&layout),
            range: RangeTransform::new(layout),
        }
    }
}

/// Spectra over range of a channel, and what is measured of its paths.
struct Spectra<T> {
    /// Of static paths: `(part, sample)`; empty without any.
    of_static: Vec<T>,
    /// Of moving paths: `(term, row, part, sample)`.
    moving: Vec<T>,
    measured: Measured,
}

/// Add a spectrum `(part, sample)` to all chirps.
fn add_to_chirps<T: Widths>(spectrum: &[T], num_samples: usize, samples: &mut [Complex<T>]) {
    let (re, im) = spectrum.split_at(spectrum.len() / 2);
    for chirp in samples.chunks_exact_mut(num_samples) {
        for ((sample, re), im) in chirp.iter_mut().zip(re).zip(im) {
            *sample = *sample + Complex::new(*re, *im);
        }
    }
}

/// Samples times a factor, in the precision of the result.
fn unscaled<T: Widths>(samples: &[Complex<T>], back: f64, is_single: bool) -> Samples {
    let scaled = samples
        .iter()
        .map(|s| Complex64::new(s.re.wide() * back, s.im.wide() * back));
    if is_single {
        Samples::Single(scaled.map(|s| Complex32::new(s.re as f32, s.im as f32)).collect())
    } else {
        Samples::Double(scaled.collect())
    }
}
