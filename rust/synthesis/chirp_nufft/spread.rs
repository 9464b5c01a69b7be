//! Spreading of paths over the cells of range grids: of one path in the chirps of all lanes, and of static paths.
//!
//! Within a chirp a path is a tone times a polynomial of fast time, known by its values at a few nodes. Every Legendre
//! polynomial that counts has a grid of its own, for the sum of the strengths that paths have in it.

use std::f64::consts::TAU;

use super::fast_time::{FastTime, LaneTables, Nodes};
use super::number::{LaneRow, MAX_DEGREE, MAX_LANES, Number};
use super::records::{Batch, CARRIER_RATIO, CELL, HEAD, OFFSET, PHASE, STATIC};
use crate::numeric::kaiser_bessel::{KaiserBessel, Taps};
use crate::numeric::simd::{Isa, Real, Vector, add_window};
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

/// Most paths that are added at once, and the strengths of each by grid.
const MOST_AT_ONCE: usize = 4;
type Strengths<V> = [[[V; 2]; MAX_DEGREE + 1]; MOST_AT_ONCE];

/// Add the coefficients of some `P` paths, by their number, times `N` tables of chirps each.
#[cfg_attr(optimised, inline(always))]
fn sum<V: Vector, const N: usize, const P: usize>(
    mut sums: [[V; N]; P],
    rows: &[LaneRow<V::Scalar>],
    paths: usize,
    tables: &[LaneRow<V::Scalar>],
) -> [[V; N]; P] {
    for (row, tables) in rows.iter().zip(tables.as_chunks::<N>().0) {
        let own = &row.as_chunks::<P>().0[paths];
        for j in 0..N {
            let table = V::load(&tables[j]);
            for i in 0..P {
                sums[i][j] = V::splat(own[i]).mul_add(table, sums[i][j]);
            }
        }
    }
    sums
}

/// Steps of a sum.
#[derive(Clone, Debug, Default)]
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

    /// Add the paths of a block to grids; static ones to the first chirp of the first grid.
    #[cfg_attr(optimised, inline(always))]
    pub fn add<I: Isa>(&self, batch: &Batch<T>, block: usize, tables: &LaneTables<T>, grids: &mut [Vec<T>]) {
        match (size_of::<T>(), self.steps.width) {
            (4, 4) => self.add_batch::<I, 4>(batch, block, tables, grids),
            (4, 6) => self.add_batch::<I, 6>(batch, block, tables, grids),
            (_, 8) => self.add_batch::<I, 8>(batch, block, tables, grids),
            (8, 10) => self.add_batch::<I, 10>(batch, block, tables, grids),
            (8, 12) => self.add_batch::<I, 12>(batch, block, tables, grids),
            (8, 14) => self.add_batch::<I, 14>(batch, block, tables, grids),
            _ => unreachable!("widths of the precision"),
        }
    }

    /// Add paths by a kernel of `W` cells.
    #[cfg_attr(optimised, inline(always))]
    fn add_batch<I: Isa, const W: usize>(
        &self,
        batch: &Batch<T>,
        block: usize,
        tables: &LaneTables<T>,
        grids: &mut [Vec<T>],
    ) {
        let mut strengths = [[[number::<T, I>(0.0); 2]; MAX_DEGREE + 1]; MOST_AT_ONCE];
        for (number, record) in batch.blocks[block].chunks_exact(batch.num_rows()).enumerate() {
            let num_paths = batch.paths_of(number).min(MAX_LANES);
            if batch.counts == STATIC {
                self.add_static::<I, W>(record, num_paths, &mut grids[0]);
                continue;
            }
            let (head, rows) = record.split_at(HEAD);
            let (delays, amplitudes) = rows.split_at(batch.counts[0]);
            let (in_phase, quadrature) = amplitudes.split_at(batch.counts[1]);
            let used = batch.used[block][number];
            let rows = [&delays[..used[0]], &in_phase[..used[1]], &quadrature[..used[2]]];
            if self.steps.is_first_order {
                // More at once would not fit into the registers.
                if I::IS_REGISTER {
                    self.add_first_order::<I, W, 4>(head, rows, num_paths, tables, (&mut strengths, grids));
                } else {
                    self.add_first_order::<I, W, 2>(head, rows, num_paths, tables, (&mut strengths, grids));
                }
                continue;
            }
            for path in 0..num_paths {
                let strengths = &mut strengths[0][..grids.len()];
                let place = match self.nodes.places.len() {
                    2 => self.expand::<I, 2>(head, rows, path, tables, strengths),
                    3 => self.expand::<I, 3>(head, rows, path, tables, strengths),
                    5 => self.expand::<I, 5>(head, rows, path, tables, strengths),
                    9 if size_of::<T>() == 8 => self.expand::<I, 9>(head, rows, path, tables, strengths),
                    _ => unreachable!("numbers of nodes are these"),
                };
                self.add_path::<I, W>(head[CELL][path], place, strengths, grids);
            }
        }
    }

    /// Add the paths of a record, `P` at once: they share tables. To the first order of changes within a chirp.
    #[cfg_attr(optimised, inline(always))]
    fn add_first_order<I: Isa, const W: usize, const P: usize>(
        &self,
        head: &[LaneRow<T>],
        [delays, in_phase, quadrature]: [&[LaneRow<T>]; 3],
        num_paths: usize,
        tables: &LaneTables<T>,
        (strengths, grids): (&mut Strengths<T::In<I>>, &mut [Vec<T>]),
    ) {
        let (splat, none) = (<T::In<I>>::splat, [[number::<T, I>(0.0)]; P]);
        for at in (0..num_paths).step_by(P) {
            let [mut tones, mut phasors] = [[[none[0][0]; 2]; P]; 2];
            for i in 0..P {
                tones[i] = [splat(head[PHASE][at + i]), splat(head[OFFSET][at + i])];
            }
            // Phases [turns] and places [cells after the path's] in every chirp.
            let tones = sum(tones, delays, at / P, &tables.tones);
            for i in 0..P {
                phasors[i] = cos_sin::<T, I>(tones[i][0]);
            }
            for (grid, tables) in tables.orders.iter().enumerate() {
                let re = sum(none, in_phase, at / P, &tables.amplitude);
                let im = sum(none, quadrature, at / P, &tables.amplitude);
                let turned = sum(none, if grid == 0 { &[] } else { delays }, at / P, &tables.phase);
                for i in 0..P {
                    let mut strength = modulated(phasors[i], [re[i][0], im[i][0]], quadrature.is_empty());
                    if grid > 0 {
                        // A small phase turns the tone.
                        let ([x, y], [turned]) = (strengths[i][0], turned[i]);
                        strength = [turned.neg_mul_add(y, strength[0]), turned.mul_add(x, strength[1])];
                    }
                    strengths[i][grid] = strength;
                }
            }
            for i in 0..P.min(num_paths - at) {
                self.add_path::<I, W>(head[CELL][at + i], tones[i][1], &strengths[i], grids);
            }
        }
    }

    /// Place and strengths of a path from the values at `N` nodes of what it is besides a tone.
    #[cfg_attr(optimised, inline(always))]
    fn expand<I: Isa, const N: usize>(
        &self,
        head: &[LaneRow<T>],
        [delays, in_phase, quadrature]: [&[LaneRow<T>]; 3],
        path: usize,
        tables: &LaneTables<T>,
        strengths: &mut [[T::In<I>; 2]],
    ) -> T::In<I> {
        let (splat, zero) = (<T::In<I>>::splat, number::<T, I>(0.0));
        let [phase, offset] = [splat(head[PHASE][path]), splat(head[OFFSET][path])];
        let carrier_ratio = splat(head[CARRIER_RATIO][path]);
        let ratio = carrier_ratio.mul(number::<T, I>(self.fast_time.ratio));
        let per_square = carrier_ratio
            .mul(carrier_ratio)
            .mul(number::<T, I>(self.fast_time.per_square));
        let twice = per_square.add(per_square);
        // Delay [turns] and Doppler in the middle of every chirp, and the tone.
        let [[turns, doppler]] = sum([[zero; 2]], delays, path, &tables.turns);
        let square = turns.mul(turns);
        let tone = cos_sin::<T, I>(square.neg_mul_add(per_square, phase.add(turns)));
        let received = turns.neg_mul_add(twice, number::<T, I>(1.0));
        let slope = received.mul_add(doppler, ratio.mul(turns));
        // Phases beside the tone, from delays beside the tone.
        let [delay] = sum([[zero; N]], delays, path, &tables.node_turns);
        let [re] = sum([[zero; N]], in_phase, path, &tables.node_amplitude);
        let [im] = sum([[zero; N]], quadrature, path, &tables.node_amplitude);
        let mut values = [[zero; 2]; N];
        for j in 0..N {
            let u = number::<T, I>(self.nodes.places[j]);
            let change = doppler.mul_add(u, delay[j]);
            let change_of_frequency = change.neg_mul_add(per_square, ratio.mul(u));
            let phase = change.mul_add(change_of_frequency, received.mul(delay[j]));
            let (c, s) = cos_sin_quarter(phase.mul(number::<T, I>(TAU)));
            values[j] = modulated([c, s], [re[j], im[j]], quadrature.is_empty());
        }
        for (strength, weights) in strengths.iter_mut().zip(&self.weights) {
            let mut sum = [zero; 2];
            for j in 0..N {
                let weight = splat(weights[j]);
                sum = [
                    values[j][0].mul_add(weight, sum[0]),
                    values[j][1].mul_add(weight, sum[1]),
                ];
            }
            *strength = product(tone, sum);
        }
        slope.mul_add(number::<T, I>(self.fast_time.cells_per_turn), offset)
    }

    /// First of the cells about some places, and the values of the kernel there.
    #[cfg_attr(optimised, inline(always))]
    fn cells<I: Isa, const W: usize>(&self, place: T::In<I>) -> (T::In<I>, [T::In<I>; W]) {
        let magic = <T::In<I>>::splat(T::ROUND);
        let place = place.add(number::<T, I>(-0.5 * (W as f64 - 1.0)));
        let first = place.add(magic).sub(magic);
        // The offset from the middle of the cells.
        let offset = first.sub(place);
        (first, self.taps.values::<T::In<I>, W>(offset.add(offset)))
    }

    /// Add the static paths of a record to the first chirp of a grid.
    #[cfg_attr(optimised, inline(always))]
    fn add_static<I: Isa, const W: usize>(&self, record: &[LaneRow<T>], num_paths: usize, grid: &mut [T]) {
        let none = [T::zero(); MAX_LANES];
        for at in (0..num_paths).step_by(T::LANES) {
            let load = |row: usize| <T::In<I>>::load(&record[row][at..]);
            let [c, s] = cos_sin::<T, I>(load(PHASE));
            let (first, values) = self.cells::<I, W>(load(OFFSET));
            let (mut firsts, mut re, mut im, mut taps) = (none, none, none, [none; W]);
            first.store(&mut firsts);
            c.mul(load(HEAD)).store(&mut re);
            s.mul(load(HEAD)).store(&mut im);
            for j in 0..W {
                values[j].store(&mut taps[j]);
            }
            for lane in 0..T::LANES.min(num_paths - at) {
                let start = self.cell(record[CELL][at + lane], firsts[lane]) * 2 * T::LANES;
                let window = &mut grid[start..][..2 * W * T::LANES];
                for j in 0..W {
                    let at = 2 * j * T::LANES;
                    window[at] = window[at] + taps[j][lane] * re[lane];
                    window[at + T::LANES] = window[at + T::LANES] + taps[j][lane] * im[lane];
                }
            }
        }
    }

    /// Add a path to the cells of the grids about its places.
    #[cfg_attr(optimised, inline(always))]
    fn add_path<I: Isa, const W: usize>(
        &self,
        cell: T,
        place: T::In<I>,
        strengths: &[[T::In<I>; 2]],
        grids: &mut [Vec<T>],
    ) {
        let (all, zero) = (u32::MAX >> (32 - T::LANES), number::<T, I>(0.0));
        let (first, values) = self.cells::<I, W>(place);
        // One pass for every first cell that there is. A place that is no number is in no cell.
        let (mut rest, mut lowest) = (all, first.first());
        loop {
            let here = first.equal(<T::In<I>>::splat(lowest)) & rest;
            if here == 0 {
                break;
            }
            let start = self.cell(cell, lowest) * 2 * T::LANES;
            for (grid, strength) in grids.iter_mut().zip(strengths) {
                let mut own = *strength;
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
        // The lowest bits of an integer beside a large constant.
        (f64::ROUND + (cell + after).wide()).to_bits() as usize & (self.fast_time.num_cells - 1)
    }
}

fn kernel(width: usize, fast_time: &FastTime) -> KaiserBessel {
    KaiserBessel::new(
        width,
        fast_time.waveform.num_samples as f64 / fast_time.num_cells as f64,
    )
}
