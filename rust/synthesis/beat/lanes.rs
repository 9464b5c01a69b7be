//! Sums in lanes: records of all paths, and the steps that reach a tolerance.

use std::ops::Range;

use num_complex::Complex32;

use super::job::{Options, Report, Samples, gain, scale, too_large};
use crate::error::{Result, fits_memory};
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Real};
use crate::synthesis::block::{Block, CHUNK, Chunk, Class, Selection};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::coherence::Coherence;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::lanes::{self, Batch, Builder, Coefficients, Errors, Layer, Steps, Tables};
use crate::synthesis::plan::{Method, Part, Plan, SINGLE_EQUAL_SUM, Step, in_phase, times};
use crate::synthesis::statistics;

/// Smallest tolerance of sums in lanes. Single precision and kernels of seven cells miss a smaller one in most frames,
/// which shows only after half of the work.
const LEAST_TOLERANCE: f64 = 3e-5;

/// Share of the tolerance that the bound of the error may fill.
const MARGIN: f64 = 0.95;

/// Gain that steps allow for where they can.
const RESERVE: f64 = 2.0;

/// Chunks of paths of one task, a constant: sums of errors do not depend on the number of threads.
const PART: usize = 8;

/// Number of tasks that are tried before all, and share of the tolerance that what series leave out may fill in them.
const NUM_TRIED: usize = 4;
const LIKELY: f64 = 0.8;

/// Shares of the batches of a channel whose cells are filled side by side, a constant.
const SHARES: usize = 4;

/// Largest magnitude of amplitudes whose squares are numbers.
const LARGEST_AMPLITUDE: f64 = 1e150;

/// Largest exponent of two of factors of samples in single precision.
const EXPONENT: f64 = 60.0;

/// Most turns of a delay, of which double precision keeps enough digits.
const MOST_TURNS: f64 = 1e9;

/// Numbers that decide if a sum in lanes is the fastest.
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Number of channels.
    pub channels: usize,
    /// Number of paths per channel.
    pub paths: usize,
    /// Number of those that stand still, as far as is known.
    pub still: usize,
    /// Number of rows of the series.
    pub terms: usize,
}

impl Work {
    /// True if a sum in lanes is the fastest for a waveform.
    fn is_for_lanes(&self, waveform: &Waveform) -> bool {
        let (num_chirps, num_samples) = (waveform.chirp_times.len() as f64, waveform.num_samples);
        let (channels, paths) = (self.channels as f64, (self.channels * self.paths) as f64);
        let moving = channels * (self.paths - self.still.min(self.paths)) as f64;
        let cells = channels * Tables::num_cells(num_samples) as f64;
        let lanes = times::lanes(paths, moving, ((num_chirps / 16.0).ceil(), cells));
        lanes < times::nufft(paths, num_chirps, self.terms, moving > 0.0)
            && lanes < times::recurrence(paths, num_chirps * num_samples as f64)
    }
}

/// Sum in lanes: records of all paths, in layers of a common factor over fast time.
pub struct LaneSum {
    /// Constants of the frame.
    pub tables: Tables,
    /// Batches of every channel and factors of the samples, by layer.
    pub layers: Vec<LaneLayer>,
    /// Power of two that amplitudes are multiplied by.
    pub scale: f64,
}

/// Batches of every channel, in a fixed order, and factors of the samples of a chirp.
pub struct LaneLayer {
    /// Batches, (channel, number).
    pub batches: Vec<Vec<Batch>>,
    /// Factors of the samples.
    pub factors: Vec<f64>,
}

impl LaneSum {
    /// True if paths are to be summed in lanes, if they can.
    pub fn is_wanted(waveform: &Waveform, work: Work, options: &Options) -> bool {
        let is_wanted = match options.method {
            Method::Lanes => true,
            Method::Auto => work.is_for_lanes(waveform),
            _ => false,
        };
        is_wanted && work.paths > 0 && options.tolerance >= LEAST_TOLERANCE
    }

    /// Sum of the paths of a series. None where other steps are faster or the sum cannot be had: long series, fine
    /// tolerances, numbers that are not finite.
    pub(super) fn of(waveform: &Waveform, series: &PathSeries, options: &Options) -> Option<Self> {
        let fits = series.num_terms() <= lanes::MOST_TERMS && series.can_be_planned(waveform);
        let work = Work {
            channels: series.num_channels,
            paths: series.num_paths,
            still: series.num_paths * statistics::still_percent(series) / 100,
            terms: series.num_terms(),
        };
        if !fits || !Self::is_wanted(waveform, work, options) {
            return None;
        }
        let largest = largest(series);
        if largest.is_nan() || largest >= LARGEST_AMPLITUDE {
            return None;
        }
        let scale = scale(largest);
        let frame = Block::new(waveform, series, 0..waveform.chirp_times.len());
        let tables = Tables::new(waveform, &frame, middle_delay(series.delay[0]));
        let builder = Builder::new(&tables, options.tolerance, [false; 2]);
        let num_chunks = series.num_paths.div_ceil(CHUNK);
        let tasks = (0..series.num_channels).flat_map(|channel| {
            let firsts = (0..num_chunks).step_by(PART);
            firsts.map(move |first| (channel, first..num_chunks.min(first + PART)))
        });
        let build = |(channel, chunks): (usize, Range<usize>)| {
            let paths = SomePaths {
                series,
                channel,
                chunks,
                scale,
            };
            batch(&builder, &frame, paths, options)
        };
        let tasks: Vec<_> = tasks.collect();
        if options.method == Method::Auto && tasks.len() > 4 * NUM_TRIED {
            // Some paths show in a fraction of the time where a tolerance is out of reach.
            let mut errors = Errors::default();
            for task in tasks.iter().step_by(tasks.len() / NUM_TRIED) {
                errors.add(&build(task.clone()).errors);
            }
            if errors.rest(&tables, true) > LIKELY * options.tolerance {
                return None;
            }
        }
        let mut built = parallel::map(options.is_parallel, tasks, build);
        let num_parts = num_chunks.div_ceil(PART);
        let batches = (0..series.num_channels).map(|_| built.drain(..num_parts).collect());
        let layer = LaneLayer {
            batches: batches.collect(),
            factors: vec![1.0; waveform.num_samples],
        };
        Some(Self {
            tables,
            layers: vec![layer],
            scale,
        })
    }

    /// Errors of every channel, with the gain that its paths may have in phase.
    pub fn errors(&self, is_parallel: bool) -> Vec<Errors> {
        let num_channels = self.layers.first().map_or(0, |layer| layer.batches.len());
        let batches: Vec<Vec<&Batch>> = (0..num_channels)
            .map(|channel| self.layers.iter().flat_map(|layer| &layer.batches[channel]).collect())
            .collect();
        let shares = batches
            .iter()
            .flat_map(|batches| batches.chunks(batches.len().div_ceil(SHARES).max(1)));
        let cells = parallel::map(is_parallel, shares.collect(), |share: &[&Batch]| {
            let mut cells = Coherence::new(self.tables.num_chirps, self.tables.num_samples);
            for batch in share {
                batch.add_to(&mut cells, &self.tables);
            }
            cells
        });
        let mut cells = cells.into_iter();
        let of_channel = |batches: &Vec<&Batch>| {
            let mut errors = Errors::default();
            for batch in batches {
                errors.add(&batch.errors);
            }
            let num_shares = batches.chunks(batches.len().div_ceil(SHARES).max(1)).len();
            let mut coherence = Coherence::default();
            for share in cells.by_ref().take(num_shares) {
                coherence.join(&share);
            }
            errors.coherence = coherence.gain(1);
            errors
        };
        batches.iter().map(of_channel).collect()
    }

    /// Samples `(channel, chirp, sample)` and their report, for [`Self::errors`]; none if the tolerance cannot be
    /// reached.
    pub fn samples(
        &self,
        errors: &[Errors],
        waveform: &Waveform,
        options: &Options,
    ) -> Result<Option<(Samples, Report)>> {
        // Factors of the samples take back the scale where single precision can.
        let back = if self.scale.log2().abs() <= EXPONENT {
            self.scale.recip()
        } else {
            1.0
        };
        let power: Vec<f64> = errors.iter().map(|errors| errors.power * back * back).collect();
        let (mut known_gain, mut runs) = (1.0, 0);
        while let Some((steps, plan)) = self.plan(errors, options.tolerance, known_gain) {
            fits_memory("grids", &[plan.memory()], 1)?;
            let samples = Samples::Single(self.run(steps, options, back));
            runs += 1;
            let gain = gain(&samples, &power, waveform);
            if !gain.is_finite() {
                break;
            }
            // Errors allow for what is due to few samples.
            let coherent = (gain / self.tables.fluctuation).max(1.0);
            if plan.error_with(0.0, coherent) <= options.tolerance {
                let report = Report {
                    plan,
                    runs,
                    gain,
                    ..Report::default()
                };
                return Ok(Some((unscaled(samples, self.scale * back)?, report)));
            }
            // Paths that add up in phase add up their errors.
            known_gain = coherent.max(1.01 * known_gain);
        }
        Ok(None)
    }

    /// Cheapest steps that reach a tolerance with a known gain, and their plan.
    pub(super) fn plan(&self, errors: &[Errors], tolerance: f64, gain: f64) -> Option<(Steps, Plan)> {
        let longest = errors.iter().map(|errors| errors.longest).fold(0.0, f64::max);
        if longest * self.tables.frequency.abs() > MOST_TURNS {
            return None;
        }
        let reaches = |gain: f64| {
            let is_enough = |steps: &Steps| {
                let [kernel, rest] = self.bounds(errors, *steps);
                let error = kernel
                    .hypot(in_phase(gain) * rest)
                    .hypot(gain.powi(3) * SINGLE_EQUAL_SUM);
                error <= MARGIN * tolerance
            };
            Steps::all().find(is_enough).map(|steps| (steps, gain))
        };
        let least = reaches(gain)?;
        // One more cell costs less than a second run, a second grid does not.
        let safe = reaches(gain.max(RESERVE)).filter(|safe| safe.0.has_second == least.0.has_second);
        let (steps, gain) = safe.unwrap_or(least);
        let [kernel, rest] = self.bounds(errors, steps);
        let all = || self.layers.iter().flat_map(|layer| &layer.batches).flatten();
        let moving = all().map(|batch| batch.num_moving).sum::<usize>();
        let still = all().map(|batch| batch.still.len()).sum::<usize>();
        let num_records: usize = all().map(|batch| batch.moving.len()).sum();
        let mut plan = Plan {
            gain,
            ..Plan::default()
        };
        for (class, num_paths) in [(Class::Still, still), (Class::Moving, moving)] {
            if num_paths > 0 {
                plan.parts.push(Part {
                    class,
                    num_paths,
                    step: Step::Lanes {
                        width: steps.width,
                        has_second: steps.has_second,
                    },
                    // Errors of classes add up in squares.
                    share: (num_paths as f64 / (still + moving) as f64).sqrt(),
                    kernel,
                    rounding: 0.0,
                    equal: SINGLE_EQUAL_SUM,
                    series: rest,
                    cost: 0.0,
                    memory: num_records * size_of::<lanes::Record>(),
                });
            }
        }
        Some((steps, plan))
    }

    /// Largest bounds of all channels: of the error of the kernel, and of what else is left out for independent phases;
    /// NaN if a number is not finite.
    fn bounds(&self, errors: &[Errors], steps: Steps) -> [f64; 2] {
        let larger = |a: f64, b: f64| if a.is_nan() || a > b { a } else { b };
        let largest = |bound: &dyn Fn(&Errors) -> f64| errors.iter().map(bound).fold(0.0, larger);
        [
            largest(&|errors| errors.kernel(steps.width, self.tables.num_samples)),
            largest(&|errors| errors.rest(&self.tables, steps.has_second)),
        ]
    }

    /// Samples times the scale and another factor.
    fn run(&self, steps: Steps, options: &Options, factor: f64) -> Vec<Complex32> {
        let num_channels = self.layers.first().map_or(0, |layer| layer.batches.len());
        let mut samples = vec![Complex32::ZERO; num_channels * self.tables.num_chirps * self.tables.num_samples];
        let layers: Vec<Layer> = self
            .layers
            .iter()
            .map(|layer| Layer {
                batches: &layer.batches,
                factors: &layer.factors,
            })
            .collect();
        let how = (options.level, options.is_parallel);
        lanes::add_samples(&self.tables, steps, &layers, factor, how, &mut samples);
        samples
    }
}

/// Samples without the factor of their amplitudes.
fn unscaled(samples: Samples, scale: f64) -> Result<Samples> {
    let Samples::Single(mut samples) = samples else {
        return Ok(samples);
    };
    if scale == 1.0 {
        return Ok(Samples::Single(samples));
    }
    let (back, mut largest) = (scale.recip(), 0.0_f64);
    for sample in &mut samples {
        // In double precision: the scale may be out of the range of single precision where the samples are not.
        let parts = [sample.re.wide() * back, sample.im.wide() * back];
        largest = largest.max(parts[0].abs()).max(parts[1].abs());
        *sample = Complex32::new(parts[0] as f32, parts[1] as f32);
    }
    if largest > f64::from(f32::MAX) {
        return Err(too_large(largest));
    }
    Ok(Samples::Single(samples))
}

/// Some chunks of the paths of a channel.
pub struct SomePaths<'a> {
    /// Delays and amplitudes.
    pub series: &'a PathSeries<'a>,
    /// Number of the channel.
    pub channel: usize,
    /// Numbers of the chunks.
    pub chunks: Range<usize>,
    /// Power of two that amplitudes are multiplied by.
    pub scale: f64,
}

/// Records of some paths; `frame` is the block of all chirps for the series.
pub fn batch(builder: &Builder, frame: &Block, paths: SomePaths, options: &Options) -> Batch {
    options.level.run(Build {
        builder,
        frame,
        paths,
        split_still: options.split_still,
    })
}

/// Records of some chunks of paths of a channel.
struct Build<'a> {
    builder: &'a Builder<'a>,
    frame: &'a Block,
    paths: SomePaths<'a>,
    split_still: bool,
}

impl Kernel for Build<'_> {
    type Output = Batch;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Batch {
        let SomePaths {
            series,
            channel,
            chunks,
            scale,
        } = self.paths;
        let num_paths = (CHUNK * chunks.len()).min(series.num_paths);
        let mut batch = Batch::default();
        if series.num_terms() > 1 {
            batch.moving.reserve(num_paths);
        } else {
            batch.still.reserve(num_paths);
        }
        let mut chunk = Chunk::new(series);
        let [mut re, mut im] = [(); 2].map(|()| vec![[0.0; CHUNK]; chunk.re.len()]);
        for index in chunks {
            chunk.load::<I>(series, channel, index * CHUNK, self.frame, Selection::ALL);
            let moving = if self.split_still { chunk.moving() } else { u128::MAX };
            for k in 0..re.len() {
                for i in 0..CHUNK {
                    re[k][i] = (chunk.re[k][i] * scale) as f32;
                    im[k][i] = (chunk.im[k][i] * scale) as f32;
                }
            }
            let paths = Coefficients {
                len: chunk.len,
                delay: &chunk.delay,
                re: &re,
                im: &im,
            };
            self.builder.add::<I>(&paths, moving, &mut batch);
        }
        batch
    }
}

/// Largest real or imaginary part of the amplitudes at a time of the frame; at all times if they are zero there.
pub(super) fn largest(series: &PathSeries) -> f64 {
    let of_row = |row: &&[num_complex::Complex64]| {
        row.iter()
            .fold(0.0_f64, |most, a| most.max(a.re.wide().abs()).max(a.im.wide().abs()))
    };
    let middle = of_row(&series.amplitude[series.amplitude.len() / 2]);
    if middle > 0.0 {
        middle
    } else {
        series.amplitude.iter().map(of_row).fold(0.0, f64::max)
    }
}

/// Middle of a range of delays [s].
fn middle_delay(delays: &[f64]) -> f64 {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = delays.iter().fold(start, |(low, high), x| (low.min(*x), high.max(*x)));
    0.5 * (low + high)
}

#[cfg(test)]
mod tests;
