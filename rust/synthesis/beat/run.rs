//! Execution of plans: the parts one after the other; channels, blocks and groups of chirps in parallel.

use num_complex::{Complex, Complex32, Complex64};

use super::job::{Job, Options, Samples};
use crate::numeric::parallel;
use crate::numeric::simd::Real;
use crate::synthesis::block::{CHUNK, Selection};
use crate::synthesis::direct;
use crate::synthesis::low_rank::block_plan::BlockPlan;
use crate::synthesis::nufft::{self, Widths};
use crate::synthesis::plan::{Part, Plan, Step};
use crate::synthesis::recurrence;
use crate::synthesis::statistics;

/// Outcome of a part of a plan: rows, and what was measured of the paths.
#[derive(Default)]
pub(super) struct Outcome {
    /// Number of velocity rows that were transformed.
    pub rows: usize,
    /// Number of velocity rows that were skipped, as no path touched them.
    pub rows_skipped: usize,
    /// Mean over the nodes of the squared l2 norm of the amplitudes, per channel; none of direct sums [W].
    pub power: Vec<f64>,
    /// Largest gain that the paths of a channel may have in phase, in any block; 0 for steps without a kernel.
    pub coherence: f64,
    /// Mean square error over the frame of the interpolation of residuals, summed over paths, per channel [W].
    pub rest: Vec<f64>,
    /// Chunks `(channel, chunk)` with the largest shares of that error.
    pub worst: Vec<(usize, usize)>,
}

impl Outcome {
    fn of(num_channels: usize) -> Self {
        Self {
            power: vec![0.0; num_channels],
            rest: vec![0.0; num_channels],
            ..Self::default()
        }
    }

    fn join(&mut self, other: Self) {
        self.rows += other.rows;
        self.rows_skipped += other.rows_skipped;
        self.coherence = self.coherence.max(other.coherence);
        for (sum, power) in self.power.iter_mut().zip(other.power) {
            *sum += power;
        }
        for (sum, rest) in self.rest.iter_mut().zip(other.rest) {
            *sum += rest;
        }
        self.worst.extend(other.worst);
    }
}

impl Job<'_> {
    /// Run all parts of a plan: samples, and the outcome of every part.
    pub(super) fn run(&self, plan: &Plan, is_single: bool) -> (Samples, Vec<Outcome>) {
        let size = self.series.num_channels * self.waveform.chirp_times.len() * self.waveform.num_samples;
        let selection = |part: &Part| self.selection(part.class);
        let needs_double = |part: &Part| !part.step.is_single();
        let mut outcomes = Vec::new();
        let mut add = |part: Outcome| outcomes.push(part);
        if plan.parts.iter().any(needs_double) || !is_single {
            let mut sum = vec![Complex64::ZERO; size];
            for part in &plan.parts {
                if needs_double(part) {
                    add(self.part(part, selection(part), &mut sum));
                } else {
                    let mut single = vec![Complex32::ZERO; size];
                    add(self.part(part, selection(part), &mut single));
                    for (a, b) in sum.iter_mut().zip(&single) {
                        *a += Complex64::new(f64::from(b.re), f64::from(b.im));
                    }
                }
            }
            let back = self.scale.recip();
            for sample in &mut sum {
                *sample *= back;
            }
            (narrow(sum, is_single), outcomes)
        } else {
            let mut sum = vec![Complex32::ZERO; size];
            for part in &plan.parts {
                add(self.part(part, selection(part), &mut sum));
            }
            if self.scale != 1.0 {
                // In double precision: the scale may be out of the range of single precision where the samples are not.
                let back = self.scale.recip();
                for sample in &mut sum {
                    *sample = Complex32::new((sample.re.wide() * back) as f32, (sample.im.wide() * back) as f32);
                }
            }
            (Samples::Single(sum), outcomes)
        }
    }

    /// Add the paths of one part.
    fn part<T: Widths>(&self, part: &Part, selection: Selection, out: &mut [Complex<T>]) -> Outcome {
        match &part.step {
            Step::Direct => {
                let &Options {
                    level,
                    is_parallel,
                    cancel,
                    ..
                } = self.options;
                let samples =
                    direct::beat_signal(self.waveform, self.series, selection.class, level, is_parallel, cancel);
                for (sum, sample) in out.iter_mut().zip(samples) {
                    *sum = *sum + Complex::new(T::of(sample.re * self.scale), T::of(sample.im * self.scale));
                }
                Outcome::default()
            }
            Step::Recurrence { .. } => {
                self.lanes(selection, out, |job, samples| {
                    recurrence::add_recurrence(self.options.level, job, samples);
                });
                Outcome {
                    power: statistics::power(self.series, selection),
                    ..Outcome::default()
                }
            }
            Step::Lanes { .. } => unreachable!("sums in lanes have no job"),
            Step::Grid { width, block_plans, .. } => self.grid(selection, *width, block_plans, out),
        }
    }

    /// Run `add` for every channel and group of chirps.
    fn lanes<T: Widths>(
        &self,
        selection: Selection,
        out: &mut [Complex<T>],
        add: impl Fn(&recurrence::Job, &mut [Complex<T>]) + Sync + Send,
    ) {
        const GROUP: usize = 16;
        let (num_chirps, num_samples) = (self.waveform.chirp_times.len(), self.waveform.num_samples);
        let tasks: Vec<_> = out
            .chunks_mut(num_chirps * num_samples)
            .enumerate()
            .flat_map(|(channel, samples)| {
                let groups = samples.chunks_mut(GROUP * num_samples).enumerate();
                groups.map(move |(group, samples)| (channel, group * GROUP, samples))
            })
            .collect();
        parallel::map(self.options.is_parallel, tasks, |(channel, first, samples)| {
            let job = recurrence::Job {
                waveform: self.waveform,
                series: self.series,
                channel,
                selection,
                paths: 0..self.series.num_paths,
                chirps: first..(first + GROUP).min(num_chirps),
                scale: self.scale,
                cancel: self.options.cancel,
            };
            add(&job, samples);
        });
    }

    /// Add the samples of every channel and block of chirps by NUFFT.
    fn grid<T: Widths>(
        &self,
        selection: Selection,
        width: usize,
        block_plans: &[BlockPlan],
        out: &mut [Complex<T>],
    ) -> Outcome {
        let num_samples = self.waveform.num_samples;
        // Samples by block and channel; one task per block and some channels.
        let mut samples: Vec<Vec<&mut [Complex<T>]>> = block_plans.iter().map(|_| Vec::new()).collect();
        let mut rest = out;
        for _ in 0..self.series.num_channels {
            for (block_plan, samples) in block_plans.iter().zip(&mut samples) {
                let (own, behind) = rest.split_at_mut(block_plan.block.chirps.len() * num_samples);
                samples.push(own);
                rest = behind;
            }
        }
        let mut tasks = Vec::new();
        for (block_plan, samples) in block_plans.iter().zip(samples) {
            let mut samples = samples.into_iter();
            for first in (0..self.series.num_channels).step_by(nufft::MAX_CHANNELS) {
                let some: Vec<_> = samples.by_ref().take(nufft::MAX_CHANNELS).collect();
                tasks.push((first, block_plan, some));
            }
        }
        let num_chunks = self.series.num_paths.div_ceil(CHUNK);
        let num_parts = if self.series.num_channels * block_plans.len() >= 4 {
            1
        } else {
            (num_chunks / 256).clamp(1, nufft::MAX_PARTS)
        };
        let outcomes = parallel::map(self.options.is_parallel, tasks, |(first, block_plan, samples)| {
            let job = |channel: usize| nufft::Job {
                waveform: self.waveform,
                series: self.series,
                channel,
                selection,
                scale: self.scale,
                block_plan,
                width,
                level: self.options.level,
                num_parts,
                is_parallel: self.options.is_parallel,
                keep_empty_rows: !self.options.skip_rows,
                cancel: self.options.cancel,
            };
            let jobs: Vec<nufft::Job> = (first..first + samples.len()).map(job).collect();
            let share = block_plan.block.chirps.len() as f64 / self.waveform.chirp_times.len() as f64;
            let mut outcome = Outcome::of(self.series.num_channels);
            for (job, (used, measured)) in jobs.iter().zip(nufft::add_channels(&jobs, samples)) {
                outcome.rows += used;
                outcome.rows_skipped += block_plan.rows - used;
                outcome.power[job.channel] = measured.power;
                outcome.coherence = outcome.coherence.max(measured.coherence.gain(1));
                outcome.rest[job.channel] = share * measured.rest;
                outcome.worst.push((job.channel, measured.worst.0));
            }
            outcome
        });
        let none = Outcome::of(self.series.num_channels);
        outcomes.into_iter().fold(none, |mut sum, outcome| {
            sum.join(outcome);
            sum
        })
    }
}

/// Samples in the precision of the result.
fn narrow(samples: Vec<Complex64>, is_single: bool) -> Samples {
    if is_single {
        Samples::Single(
            samples
                .iter()
                .map(|s| Complex32::new(s.re as f32, s.im as f32))
                .collect(),
        )
    } else {
        Samples::Double(samples)
    }
}
