//! Spreading of paths over the cells of range grids: of one path in the chirps of all lanes.
//!
//! Within a chirp a path is a tone times a polynomial of fast time, known by its values at a few nodes. Every Legendre
//! polynomial that counts has a grid of its own, for the sum of the strengths that paths have in it.

use std::f64::consts::TAU;

use super::fast_time::{FastTime, LaneTables, Nodes};
use super::number::{LaneRow, MAX_DEGREE, MAX_LANES, Number};
use super::records::{Batch, CARRIER_RATIO, CELL, HEAD, OFFSET, PHASE};
use crate::numeric::kaiser_bessel::{KaiserBessel, Taps};
use crate::numeric::simd::{Isa, Vector, add_window};
use crate::numeric::trig::cos_sin_quarter;
use crate::numeric::wide::{cos_sin_of, number, product};

/// sin(pi x) / x and cos(pi x) in powers of x^2 up to x = 1/2: polynomials through five Chebyshev nodes, to 1e-8 and
/// 5e-8.
const SIN: [f64; 5] = [
    std::f64::consts::PI,
    -5.167_710_3,
    2.550_077_4,
    -0.598_290_4,
    0.077_655_91,
];
const COS: [f64; 5] = [0.999_999_94, -4.934_793, 4.058_410_6, -1.331_872_9, 0.219_682_43];

/// Cosine and sine of phases in turns, below 2^20 of them: to 5e-7 in single precision.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin<T: Number, I: Isa>(phase: T::In<I>) -> [T::In<I>; 2] {
    if size_of::<T>() == 8 {
        return cos_sin_of::<T, I>(phase);
    }
    let magic = <T::In<I>>::splat(T::ROUND);
    let x = phase.sub(phase.add(magic).sub(magic));
    let square = x.mul(x);
    let (mut s, mut c) = (number::<T, I>(SIN[4]), number::<T, I>(COS[4]));
    for n in (0..4).rev() {
        s = s.mul_add(square, number::<T, I>(SIN[n]));
        c = c.mul_add(square, number::<T, I>(COS[n]));
    }
    // Of half the angle: cos = 1 - 2 s^2, sin = 2 s c.
    let s = s.mul(x);
    let twice = s.add(s);
    [twice.neg_mul_add(s, number::<T, I>(1.0)), twice.mul(c)]
}

/// A number times an amplitude in phase and in quadrature.
#[cfg_attr(optimised, inline(always))]
fn modulated<V: Vector>(z: [V; 2], amplitude: [V; 2], is_real: bool) -> [V; 2] {
    if is_real {
        [z[0].mul(amplitude[0]), z[1].mul(amplitude[0])]
    } else {
        product(z, amplitude)
    }
}

/// Number of nodes by the highest degree of a grid, of few different ones. A single grid has so many that its tones are the
/// nearest to paths whose phases are curved.
const NUM_NODES: [usize; MAX_DEGREE + 1] = [3, 2, 3, 5, 5, 9, 9, 9, 9];

/// Complex strengths of the paths of a record on a grid.
type Strengths<V> = [[V; 2]; MAX_LANES];

/// Add the coefficients of a path times `N` tables of chirps each.
#[cfg_attr(optimised, inline(always))]
fn sum<V: Vector, const N: usize>(
    mut sums: [V; N],
    rows: &[LaneRow<V::Scalar>],
    path: usize,
    tables: &[LaneRow<V::Scalar>],
) -> [V; N] {
    for (row, tables) in rows.iter().zip(tables.chunks_exact(N)) {
        let own = V::splat(row[path]);
        for j in 0..N {
            sums[j] = own.mul_add(V::load(&tables[j]), sums[j]);
        }
    }
    sums
}

/// Steps of a sum.
#[derive(Clone, Debug)]
pub struct Steps {
    /// Width of the kernel [cells].
    pub width: usize,
    /// Degrees of fast time of the grids; 0 is the first.
    pub degrees: Vec<usize>,
    /// True if products of small changes within a chirp are left out.
    pub is_first_order: bool,
}

/// Spreading of paths by a kernel.
pub struct Spreading<'a, T> {
    /// Constants of the frame.
    pub fast_time: &'a FastTime<'a>,
    /// Steps of the sum.
    pub steps: &'a Steps,
    taps: Taps<T>,
    /// Nodes that tell their coefficients.
    pub nodes: Nodes,
    /// Fast time of the nodes.
    times: Vec<T>,
    /// Weights of the nodes by grid.
    weights: Vec<Vec<T>>,
}

impl<'a, T: Number> Spreading<'a, T> {
    /// Kernel and polynomials of some steps.
    pub fn new(steps: &'a Steps, fast_time: &'a FastTime) -> Self {
        let most = steps.degrees.iter().copied().max().unwrap_or(0);
        let nodes = Nodes::new(NUM_NODES[most]);
        let weights = |degree: &usize| nodes.weights.iter().map(|of_node| T::of(of_node[*degree])).collect();
        Self {
            fast_time,
            steps,
            taps: kernel(steps.width, fast_time).taps(),
            times: nodes.times.iter().map(|u| T::of(*u)).collect(),
            weights: steps.degrees.iter().map(weights).collect(),
            nodes,
        }
    }

    /// Factors of the samples by grid, which undo the kernel: one over its transform, times the polynomial.
    pub fn factors(&self) -> Vec<Vec<f64>> {
        let kernel = kernel(self.steps.width, self.fast_time);
        let (num_samples, num_cells) = (self.fast_time.waveform.num_samples, self.fast_time.num_cells as f64);
        let place = |sample: usize| (sample as f64 - (num_samples / 2) as f64) / num_cells;
        let of_degree = |degree: &usize| {
            let polynomials = self.fast_time.polynomials().enumerate();
            polynomials
                .map(|(sample, values)| values[*degree] / kernel.transform(place(sample)))
                .collect()
        };
        self.steps.degrees.iter().map(of_degree).collect()
    }

    /// Add the paths of a block to grids.
    #[cfg_attr(optimised, inline(always))]
    pub fn add<I: Isa>(&self, batch: &Batch<T>, block: usize, tables: &LaneTables<T>, grids: &mut [Vec<T>]) {
        let zero = number::<T, I>(0.0);
        let mut places = [zero; MAX_LANES];
        let mut strengths = [[[zero; 2]; MAX_LANES]; MAX_DEGREE + 1];
        let strengths = &mut strengths[..grids.len()];
        for (number, record) in batch.blocks[block].chunks_exact(batch.num_rows()).enumerate() {
            let counts = (batch.counts, batch.used[block][number]);
            let record = (record, batch.paths_of(number));
            // Two loops, as a processor looks ahead over few paths.
            match if self.steps.is_first_order { 0 } else { self.times.len() } {
                0 => self.compute::<I, 0>(counts, record, tables, &mut places, strengths),
                2 => self.compute::<I, 2>(counts, record, tables, &mut places, strengths),
                3 => self.compute::<I, 3>(counts, record, tables, &mut places, strengths),
                5 => self.compute::<I, 5>(counts, record, tables, &mut places, strengths),
                9 => self.compute::<I, 9>(counts, record, tables, &mut places, strengths),
                _ => unreachable!("numbers of nodes are these"),
            }
            match (size_of::<T>(), self.steps.width) {
                (4, 4) => self.add_record::<I, 4>(record, &places, strengths, grids),
                (4, 6) => self.add_record::<I, 6>(record, &places, strengths, grids),
                (_, 8) => self.add_record::<I, 8>(record, &places, strengths, grids),
                (8, 10) => self.add_record::<I, 10>(record, &places, strengths, grids),
                (8, 12) => self.add_record::<I, 12>(record, &places, strengths, grids),
                (8, 14) => self.add_record::<I, 14>(record, &places, strengths, grids),
                _ => unreachable!("widths of the precision"),
            }
        }
    }

    /// Compute places on the grids [cells after the path's], and strengths, of the paths of a record in the
    /// chirps of all lanes; with `N` nodes, or none for the first order.
    #[cfg_attr(optimised, inline(always))]
    fn compute<I: Isa, const N: usize>(
        &self,
        (counts, [num_turns, num_in_phase, num_quadrature]): ([usize; 2], [usize; 3]),
        (record, num_paths): (&[LaneRow<T>], usize),
        tables: &LaneTables<T>,
        places: &mut [T::In<I>; MAX_LANES],
        strengths: &mut [Strengths<T::In<I>>],
    ) {
        let (splat, zero) = (<T::In<I>>::splat, number::<T, I>(0.0));
        let (head, rows) = record.split_at(HEAD);
        let (delays, amplitudes) = rows.split_at(counts[0]);
        let (in_phase, quadrature) = amplitudes.split_at(counts[1]);
        let (delays, in_phase, quadrature) = (
            &delays[..num_turns],
            &in_phase[..num_in_phase],
            &quadrature[..num_quadrature],
        );
        for path in 0..num_paths.min(MAX_LANES) {
            let middle = [PHASE, OFFSET].map(|row| splat(head[row][path]));
            if N == 0 {
                let [phase, place] = sum(middle, delays, path, &tables.tones);
                places[path] = place;
                let tone = cos_sin::<T, I>(phase);
                let mut first = [zero; 2];
                for (grid, (strengths, tables)) in strengths.iter_mut().zip(&tables.orders).enumerate() {
                    let [re] = sum([zero], in_phase, path, &tables.amplitude);
                    let [im] = sum([zero], quadrature, path, &tables.amplitude);
                    let mut strength = modulated(tone, [re, im], quadrature.is_empty());
                    if grid == 0 {
                        first = strength;
                    } else {
                        // A small phase turns the tone.
                        let [turned] = sum([zero], delays, path, &tables.phase);
                        strength = [
                            turned.neg_mul_add(first[1], strength[0]),
                            turned.mul_add(first[0], strength[1]),
                        ];
                    }
                    strengths[path] = strength;
                }
            } else {
                let rows = [delays, in_phase, quadrature];
                let carrier_ratio = splat(head[CARRIER_RATIO][path]);
                places[path] = self.expand::<I, N>(rows, path, tables, (middle, carrier_ratio), strengths);
            }
        }
    }

    /// Place of a path, and its strengths on all grids, from the values at `N` nodes of what it is besides a tone.
    #[cfg_attr(optimised, inline(always))]
    fn expand<I: Isa, const N: usize>(
        &self,
        [delays, in_phase, quadrature]: [&[LaneRow<T>]; 3],
        path: usize,
        tables: &LaneTables<T>,
        ([phase, offset], carrier_ratio): ([T::In<I>; 2], T::In<I>),
        strengths: &mut [Strengths<T::In<I>>],
    ) -> T::In<I> {
        let (splat, zero) = (<T::In<I>>::splat, number::<T, I>(0.0));
        let ratio = carrier_ratio.mul(number::<T, I>(self.fast_time.ratio));
        let per_square = carrier_ratio
            .mul(carrier_ratio)
            .mul(number::<T, I>(self.fast_time.per_square));
        let twice = per_square.add(per_square);
        // Delay [turns] and Doppler in the middle of every chirp, and the tone.
        let [turns, doppler] = sum([zero; 2], delays, path, &tables.turns);
        let square = turns.mul(turns);
        let tone = cos_sin::<T, I>(square.neg_mul_add(per_square, phase.add(turns)));
        let received = turns.neg_mul_add(twice, number::<T, I>(1.0));
        let slope = received.mul_add(doppler, ratio.mul(turns));
        // Phases beside the tone, from delays beside the tone.
        let delay: [_; N] = sum([zero; N], delays, path, &tables.node_turns);
        let re: [_; N] = sum([zero; N], in_phase, path, &tables.node_amplitude);
        let im: [_; N] = sum([zero; N], quadrature, path, &tables.node_amplitude);
        let mut values = [[zero; 2]; N];
        for j in 0..N {
            let u = splat(self.times[j]);
            let change = doppler.mul_add(u, delay[j]);
            let change_of_frequency = change.neg_mul_add(per_square, ratio.mul(u));
            let phase = change.mul_add(change_of_frequency, received.mul(delay[j]));
            let (c, s) = cos_sin_quarter(phase.mul(number::<T, I>(TAU)));
            values[j] = modulated([c, s], [re[j], im[j]], quadrature.is_empty());
        }
        for (strengths, weights) in strengths.iter_mut().zip(&self.weights) {
            let mut strength = [splat(T::zero()); 2];
            for j in 0..N {
                let weight = splat(weights[j]);
                strength = [
                    values[j][0].mul_add(weight, strength[0]),
                    values[j][1].mul_add(weight, strength[1]),
                ];
            }
            strengths[path] = product(tone, strength);
        }
        slope.mul_add(number::<T, I>(self.fast_time.cells_per_turn), offset)
    }

    /// Add the paths of a record to the cells of the grids about their places, by a kernel of `W` cells.
    #[cfg_attr(optimised, inline(always))]
    fn add_record<I: Isa, const W: usize>(
        &self,
        (record, num_paths): (&[LaneRow<T>], usize),
        places: &[T::In<I>; MAX_LANES],
        strengths: &[Strengths<T::In<I>>],
        grids: &mut [Vec<T>],
    ) {
        for path in 0..num_paths.min(MAX_LANES) {
            self.add_path::<I, W>(record[CELL][path], (path, places[path]), strengths, grids);
        }
    }

    /// Add a path to the cells of the grids about its places.
    #[cfg_attr(optimised, inline(always))]
    fn add_path<I: Isa, const W: usize>(
        &self,
        cell: T,
        (path, place): (usize, T::In<I>),
        strengths: &[Strengths<T::In<I>>],
        grids: &mut [Vec<T>],
    ) {
        let all = u32::MAX >> (32 - T::LANES);
        let zero = number::<T, I>(0.0);
        let magic = <T::In<I>>::splat(T::ROUND);
        // First of the cells, and the offset from the middle of theirs.
        let place = place.add(number::<T, I>(-0.5 * (W as f64 - 1.0)));
        let first = place.add(magic).sub(magic);
        let offset = first.sub(place);
        let values = self.taps.values::<T::In<I>, W>(offset.add(offset));
        // One pass for every first cell that there is. A place that is no number is in no cell.
        let (mut rest, mut lowest) = (all, first.first());
        loop {
            let here = first.equal(<T::In<I>>::splat(lowest)) & rest;
            if here == 0 {
                break;
            }
            let start = self.cell(cell, lowest) * 2 * T::LANES;
            for (grid, strengths) in grids.iter_mut().zip(strengths) {
                let mut own = strengths[path];
                if here != all {
                    own = [own[0].select(here, zero), own[1].select(here, zero)];
                }
                add_window::<T::In<I>, W, 2>(grid, start, 2 * T::LANES, &values, &own);
            }
            rest &= !here;
            if rest == 0 {
                break;
            }
            let mut firsts = [T::zero(); MAX_LANES];
            first.store(&mut firsts);
            lowest = firsts[rest.trailing_zeros() as usize % T::LANES];
        }
    }

    /// Cell of the grid that is some cells after another one.
    #[cfg_attr(optimised, inline(always))]
    fn cell(&self, cell: T, after: T) -> usize {
        (cell + after).wide() as isize as usize & (self.fast_time.num_cells - 1)
    }
}

fn kernel(width: usize, fast_time: &FastTime) -> KaiserBessel {
    KaiserBessel::new(
        width,
        fast_time.waveform.num_samples as f64 / fast_time.num_cells as f64,
    )
}
