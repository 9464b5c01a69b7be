//! Sum of records: grids of every channel and of the chirps of all lanes, one task each, transformed and added to the
//! samples.

use num_complex::Complex;

use super::fast_time::LaneTables;
use super::number::Number;
use super::plan::{ChirpPlan, RecordGroup, block_of, by_key};
use super::spread::Spreading;
use crate::cancel::Cancel;
use crate::numeric::fft::{self, twiddles};
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel};

/// Paths whose samples have a common factor over fast time.
struct Layer<'a, T> {
    /// Groups of paths, and the tables of every group of chirps.
    groups: Vec<(&'a RecordGroup<T>, Vec<LaneTables<T>>)>,
    /// Factors of the samples by grid.
    factors: Vec<Vec<T>>,
}

/// Samples `(channel, chirp, sample)` of a plan, scaled. Tasks are channels and groups of chirps, and each adds its
/// paths in their order: the samples do not depend on the number of threads.
pub fn samples<T: Number>(plan: &ChirpPlan<T>) -> Vec<Complex<T>> {
    let waveform = plan.fast_time.waveform;
    let (num_samples, num_chirps) = (waveform.num_samples, waveform.chirp_times.len());
    let spreading = Spreading::new(&plan.steps, &plan.fast_time);
    let twiddles = twiddles(plan.fast_time.num_cells);
    let add = |layers: &[Layer<T>], tasks: Vec<(usize, usize, &mut [Complex<T>])>| {
        parallel::map(plan.options.is_parallel, tasks, |(channel, chirps, out)| {
            plan.options.level.run(AddChirps {
                layers,
                spreading: &spreading,
                twiddles: &twiddles,
                channel,
                chirps,
                cancel: plan.options.cancel,
                out,
            });
        });
    };
    // Static paths first, in one chirp, whose samples all chirps have.
    let mut out = vec![Complex::new(T::zero(), T::zero()); plan.errors.len() * num_samples];
    let channels = out.chunks_mut(num_samples).enumerate();
    let tasks = channels.map(|(channel, samples)| (channel, 0, samples)).collect();
    add(&layers(plan, &spreading, true), tasks);
    let rows = out
        .chunks(num_samples)
        .flat_map(|row| std::iter::repeat_n(row, num_chirps));
    out = rows.collect::<Vec<_>>().concat();
    let channels = out.chunks_mut(num_chirps * num_samples).enumerate();
    let tasks = channels.flat_map(|(channel, samples)| {
        let groups = samples.chunks_mut(T::LANES * num_samples).enumerate();
        groups.map(move |(chirps, samples)| (channel, chirps, samples))
    });
    let tasks = tasks.collect();
    add(&layers(plan, &spreading, false), tasks);
    out
}

/// Static paths, or the others, by the power of the frequency.
fn layers<'a, T: Number>(plan: &'a ChirpPlan<T>, spreading: &Spreading<T>, is_static: bool) -> Vec<Layer<'a, T>> {
    let groups = plan.groups.iter().filter(|group| group.is_static == is_static);
    let mut of_grids = spreading.factors();
    if is_static {
        // Nothing changes with fast time.
        of_grids.truncate(1);
    }
    let layer = |groups: Vec<&'a RecordGroup<T>>| {
        let mut over_frequency = plan.fast_time.waveform.over_frequency(groups[0].frequency_exponent);
        over_frequency.resize(plan.fast_time.waveform.num_samples, 1.0);
        let factors = |of_grid: &Vec<f64>| {
            let both = of_grid.iter().zip(&over_frequency);
            both.map(|(a, b)| T::of(a * b)).collect()
        };
        Layer {
            groups: groups
                .into_iter()
                .map(|group| (group, plan.tables(group, &spreading.nodes)))
                .collect(),
            factors: of_grids.iter().map(factors).collect(),
        }
    };
    let layers = by_key(groups, |group| group.frequency_exponent).into_iter();
    layers.map(layer).collect()
}

/// Samples of a channel in the chirps of a group.
struct AddChirps<'a, T> {
    layers: &'a [Layer<'a, T>],
    spreading: &'a Spreading<'a, T>,
    twiddles: &'a [T],
    channel: usize,
    /// Number of the group.
    chirps: usize,
    cancel: Option<&'a Cancel>,
    out: &'a mut [Complex<T>],
}

impl<T: Number> Kernel for AddChirps<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) {
        let num_cells = self.spreading.fast_time.num_cells;
        let size = (num_cells + self.spreading.steps.width) * 2 * T::LANES;
        let mut scratch = vec![T::zero(); size];
        for layer in self.layers {
            let mut grids = vec![vec![T::zero(); size]; layer.factors.len()];
            for (group, tables) in &layer.groups {
                if self.cancel.is_some_and(Cancel::is_asked) {
                    return;
                }
                let block = block_of(self.chirps, tables.len(), group.blocks.len());
                for batch in &group.batches[self.channel] {
                    self.spreading.add::<I>(batch, block, &tables[self.chirps], &mut grids);
                }
            }
            for (grid, factors) in grids.iter_mut().zip(&layer.factors) {
                // Cells beyond the last are the first ones.
                let (cells, beyond) = grid.split_at_mut(num_cells * 2 * T::LANES);
                for i in 0..beyond.len() {
                    cells[i] = cells[i] + beyond[i];
                }
                let spectrum = fft::inverse::<T::In<I>>(grid, &mut scratch, num_cells, self.twiddles);
                add_to_samples(num_cells, spectrum, factors, self.out);
            }
        }
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
