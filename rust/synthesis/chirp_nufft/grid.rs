//! Sum of records: grids of every channel and of the chirps of all lanes, one task each, transformed and added to the
//! samples.

use num_complex::Complex;

use super::fast_time::LaneTables;
use super::number::Number;
use super::plan::{ChirpPlan, RecordGroup, block_of};
use super::spread::Spreading;
use crate::cancel::Cancel;
use crate::numeric::fft::{self, twiddles};
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Real, Vector};

/// Paths whose samples have a common factor over fast time.
struct Layer<'a, T> {
    /// Groups of paths, and the tables of every group of chirps; none where paths are static.
    groups: Vec<(&'a RecordGroup<T>, Vec<LaneTables<T>>)>,
    /// Factors of the samples by grid.
    factors: Vec<Vec<T>>,
    /// Grids of one chirp of static paths, by channel; empty where there are none.
    statics: Vec<Vec<T>>,
}

/// Samples `(channel, chirp, sample)` of a plan, scaled. Tasks are channels and groups of chirps, and each adds its
/// paths in their order: the samples do not depend on the number of threads.
pub fn samples<T: Number>(plan: &ChirpPlan<T>) -> Vec<Complex<T>> {
    let (fast_time, options) = (&plan.fast_time, plan.options);
    let (num_samples, num_chirps) = (fast_time.waveform.num_samples, fast_time.waveform.chirp_times.len());
    let spreading = Spreading::new(&plan.steps, fast_time);
    let of_grids = spreading.factors();
    let mut exponents: Vec<u8> = plan.groups.iter().map(|group| group.frequency_exponent).collect();
    exponents.sort_unstable();
    exponents.dedup();
    let layer = |exponent: &u8| {
        let own = plan.groups.iter().filter(|group| group.frequency_exponent == *exponent);
        let groups = own
            .map(|group| (group, plan.tables(group, &spreading.nodes, spreading.degrees)))
            .collect();
        let mut over_frequency = fast_time.waveform.over_frequency(*exponent);
        over_frequency.resize(num_samples, 1.0);
        let factors = |of_grid: &Vec<f64>| {
            let both = of_grid.iter().zip(&over_frequency);
            both.map(|(a, b)| T::of(a * b)).collect()
        };
        let mut layer = Layer {
            groups,
            factors: of_grids.iter().map(factors).collect(),
            statics: Vec::new(),
        };
        let statics = |channel: usize| {
            options.level.run(SpreadStatic {
                layer: &layer,
                channel,
                spreading: &spreading,
                num_cells: fast_time.num_cells,
            })
        };
        layer.statics = parallel::map(options.is_parallel, (0..plan.errors.len()).collect(), statics);
        layer
    };
    let layers: Vec<Layer<T>> = exponents.iter().map(layer).collect();
    let twiddles = twiddles(fast_time.num_cells);
    let mut out = vec![Complex::new(T::zero(), T::zero()); plan.errors.len() * num_chirps * num_samples];
    let rows = out.chunks_mut(num_chirps * num_samples).enumerate();
    let tasks: Vec<_> = rows
        .flat_map(|(channel, samples)| {
            let groups = samples.chunks_mut(T::LANES * num_samples).enumerate();
            groups.map(move |(group, samples)| (channel, group, samples))
        })
        .collect();
    parallel::map(options.is_parallel, tasks, |(channel, chirps, out)| {
        options.level.run(AddChirps {
            layers: &layers,
            spreading: &spreading,
            num_cells: fast_time.num_cells,
            twiddles: &twiddles,
            channel,
            chirps,
            cancel: options.cancel,
            out,
        });
    });
    out
}

/// Grid of one chirp of the static paths of a channel; empty if there are none.
struct SpreadStatic<'a, T> {
    layer: &'a Layer<'a, T>,
    channel: usize,
    spreading: &'a Spreading<'a, T>,
    num_cells: usize,
}

impl<T: Number> Kernel for SpreadStatic<'_, T> {
    type Output = Vec<T>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Vec<T> {
        let mut grids = [Vec::new()];
        for (group, tables) in &self.layer.groups {
            if tables.is_empty() {
                grids[0].resize(2 * (self.num_cells + self.spreading.width), T::zero());
                for batch in &group.batches[self.channel] {
                    self.spreading.add::<I>(batch, 0, None, &mut grids);
                }
            }
        }
        let [mut grid] = grids;
        if !grid.is_empty() {
            wrap(&mut grid, 2 * self.num_cells);
        }
        grid
    }
}

/// Samples of a channel in the chirps of a group.
struct AddChirps<'a, T> {
    layers: &'a [Layer<'a, T>],
    spreading: &'a Spreading<'a, T>,
    num_cells: usize,
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
        let num_cells = self.num_cells;
        let size = (num_cells + self.spreading.width) * 2 * T::LANES;
        let num_grids = self.layers.iter().map(|layer| layer.factors.len()).max().unwrap_or(1);
        let mut grids = vec![vec![T::zero(); size]; num_grids];
        let mut scratch = vec![T::zero(); size];
        for (number, layer) in self.layers.iter().enumerate() {
            if number > 0 {
                for grid in &mut grids {
                    grid.fill(T::zero());
                }
            }
            let statics = &layer.statics[self.channel];
            for (part, cell) in statics
                .iter()
                .take(2 * num_cells)
                .zip(grids[0].chunks_exact_mut(T::LANES))
            {
                <T::In<I>>::splat(*part).store(cell);
            }
            let mut is_moving = false;
            for (group, tables) in &layer.groups {
                if tables.is_empty() || self.cancel.is_some_and(Cancel::is_asked) {
                    continue;
                }
                is_moving = true;
                let block = block_of(self.chirps, tables.len(), group.blocks.len());
                for batch in &group.batches[self.channel] {
                    self.spreading
                        .add::<I>(batch, block, Some(&tables[self.chirps]), &mut grids);
                }
            }
            let num_grids = if is_moving { grids.len() } else { 1 };
            for (grid, factors) in grids[..num_grids].iter_mut().zip(&layer.factors) {
                wrap(grid, num_cells * 2 * T::LANES);
                let spectrum = fft::inverse::<T::In<I>>(grid, &mut scratch, num_cells, self.twiddles);
                add_to_samples(num_cells, spectrum, factors, self.out);
            }
        }
    }
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
