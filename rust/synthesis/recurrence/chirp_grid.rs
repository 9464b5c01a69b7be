//! Chirp grid: every path spread over range, at its exact coordinate in every chirp; one FFT over range per chirp.
//!
//! Within a chirp a path is a tone, `phi = phi_0 + phi_1 j`, at cell `y = n1 phi_1` of a periodic grid of `n1 >= 2 M`
//! cells. It is spread over the `w` nearest cells with a Kaiser-Bessel kernel; the FFT of the grid, divided by the
//! kernel's transform, has its samples. The mean of `phi_2 j^2` over the chirp goes into the phase; what is left of it
//! can be added to first order, by a second strength on a second grid that is multiplied by `j^2` less its mean.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use num_complex::Complex;
use radarcore_fft::Fft;

use super::chirp_phases::{Amplitudes, FLUSH, Group, Job, MAX_LANES, Phases, complex_mul, cos_sin, splat};
use crate::numeric::simd::{Isa, Kernel, Level, Precision, Vector};
use crate::numeric::wide::{ROUND, add, mul, mul_add, round, sub};
use crate::synthesis::block::{CHUNK, Chunk, Lane};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::nufft::good_size;
use crate::synthesis::nufft::kernel::{KaiserBessel, monomials};

/// Widths of the kernel [cells]. Truncation of phases within a chirp makes wider kernels of little use.
pub const WIDTHS: [usize; 3] = [4, 5, 6];

/// Width of the widest kernel [cells].
const MAX_WIDTH: usize = 6;

/// Degree of the polynomials for a width.
const fn degree(width: usize) -> usize {
    width + 3
}

/// Chirp grid: constants of the kernel and the transform, the same for all groups of chirps; holds no paths.
pub struct LaneGrid<T: Precision> {
    /// Width of the kernel [cells].
    width: usize,
    /// Cells of the grid.
    num_cells: usize,
    /// Polynomials of the cells 0 .. (w + 1) / 2 in `z`, twice the offset from the middle cell.
    taps: [[T; degree(MAX_WIDTH) + 1]; MAX_WIDTH],
    /// Mean of `j^2` over the samples.
    mean: f64,
    /// Factors per sample: one over the transform of the kernel, and that of the second grid if there is one.
    factors: Vec<[T; 2]>,
    has_second: bool,
    fft: Arc<dyn Fft<T>>,
}

impl<T: Precision> LaneGrid<T> {
    /// Chirp grid with a kernel of 4 to 6 cells, see [`WIDTHS`].
    ///
    /// With `has_second`, [the first order](self) of the phase's curvature within a chirp is added.
    pub fn new(waveform: &Waveform, width: usize, has_second: bool) -> Self {
        let width = width.clamp(WIDTHS[0], MAX_WIDTH);
        let num_samples = waveform.num_samples;
        let num_cells = good_size(2 * num_samples.max(width));
        let (w, middle) = (width as f64, (num_samples / 2) as f64);
        // Barnett, Magland, af Klinteberg, "A parallel nonuniform fast Fourier transform library", eq. (4.1), for the
        // oversampling that there is.
        let beta = 0.98 * PI * w * (1.0 - 0.5 * num_samples as f64 / num_cells as f64);
        let kernel = KaiserBessel::with_beta(width, beta);

        let mut taps = [[T::zero(); degree(MAX_WIDTH) + 1]; MAX_WIDTH];
        for (i, tap) in taps[..width].iter_mut().enumerate() {
            let value = |z: f64| kernel.value(i as f64 + 0.5 * (1.0 + z - w));
            for (number, coefficient) in tap.iter_mut().zip(monomials(degree(width), value)) {
                *number = T::of(coefficient);
            }
        }
        let js = (0..num_samples).map(|m| m as f64 - middle);
        let mean = js.clone().map(|j| j * j).sum::<f64>() / num_samples as f64;
        let factors = js
            .map(|j| {
                let factor = kernel.transform(j / num_cells as f64).recip();
                [T::of(factor), T::of(factor * (j * j - mean) / mean.max(1.0))]
            })
            .collect();
        Self {
            width,
            num_cells,
            taps,
            mean,
            factors,
            has_second,
            fft: T::inverse_fft(num_cells),
        }
    }

    /// Adds `scale conj(a) exp(2 pi j phi)` of every path to samples `(chirp, sample)`, row-major, of a job's chirps.
    ///
    /// Errors relative to the amplitudes, beside the kernel's `10^(1 - w)`: the amplitude is that in the middle of the
    /// chirp; with `e = 2 pi phi_2 (M / 2)^2`, 0.3 e without the second grid and 0.035 e^2 with it.
    pub fn add(&self, level: Level, job: &Job, out: &mut [Complex<T>]) {
        job.check(out.len());
        level.run(AddLanes { plan: self, job, out });
    }

    /// Samples of a group's grid, one FFT per chirp and strength.
    fn add_samples(&self, grid: &mut [T], lanes: usize, out: &mut [Complex<T>], work: &mut [Vec<Complex<T>>; 2]) {
        let num_grids = 1 + usize::from(self.has_second);
        let stride = 2 * lanes * num_grids;
        let (num_samples, num_cells) = (self.factors.len(), self.num_cells);
        // The cells beyond the last are the first.
        let (cells, beyond) = grid.split_at_mut(num_cells * stride);
        for (cell, more) in cells.iter_mut().zip(beyond) {
            *cell = *cell + *more;
        }
        let [row, scratch] = work;
        row.resize(num_cells, Complex::default());
        scratch.resize(self.fft.get_inplace_scratch_len(), Complex::default());
        for (lane, samples) in out.chunks_mut(num_samples).enumerate() {
            for strength in 0..num_grids {
                for (value, cell) in row.iter_mut().zip(cells.chunks_exact(stride)) {
                    let at = 2 * lanes * strength + lane;
                    *value = Complex::new(cell[at], cell[at + lanes]);
                }
                self.fft.process_with_scratch(row, scratch);
                for (m, (sample, factors)) in samples.iter_mut().zip(&self.factors).enumerate() {
                    let j = (m + num_cells - num_samples / 2) % num_cells;
                    *sample = *sample + row[j] * factors[strength];
                }
            }
        }
    }
}

struct AddLanes<'a, T: Precision> {
    plan: &'a LaneGrid<T>,
    job: &'a Job<'a>,
    out: &'a mut [Complex<T>],
}

impl<T: Precision> Kernel for AddLanes<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Job {
            waveform,
            series,
            channel,
            selection,
            scale,
            ..
        } = *self.job;
        let plan = self.plan;
        let (lanes, num_samples) = (<T::In<I>>::LANES, waveform.num_samples);
        // The kernel's error, `10^(1 - w)`, is far above this.
        let tolerance = 0.03 * 0.1_f64.powf(plan.width as f64 - 1.0);
        let stride = 2 * lanes * (1 + usize::from(plan.has_second));
        let mut grid = vec![T::zero(); (plan.num_cells + plan.width) * stride];
        let mut total = vec![T::zero(); if self.job.paths.len() > FLUSH { grid.len() } else { 0 }];
        let mut chunk = Chunk::new(series);
        let mut work = [Vec::new(), Vec::new()];
        for first_chirp in self.job.chirps.clone().step_by(lanes) {
            let chirps = first_chirp..self.job.chirps.end.min(first_chirp + lanes);
            let group = Group::new(waveform, series, chirps.clone());
            grid.fill(T::zero());
            total.fill(T::zero());
            for first in self.job.paths.clone().step_by(CHUNK) {
                chunk.load::<I>(series, channel, first, &group.block, selection);
                let phases = Phases::new(waveform, &group, &chunk, tolerance);
                let amplitudes = Amplitudes::new(&group, &chunk, scale, num_samples, tolerance);
                let chunk = ChunkSpread {
                    plan,
                    phases: &phases,
                    amplitudes: &amplitudes,
                };
                match plan.width {
                    4 => chunk.add::<I, 4>(&mut grid),
                    5 => chunk.add::<I, 5>(&mut grid),
                    _ => chunk.add::<I, 6>(&mut grid),
                }
                let next = first + CHUNK;
                if !total.is_empty() && (next.is_multiple_of(FLUSH) || next >= self.job.paths.end) {
                    for (sum, cell) in total.iter_mut().zip(&mut grid) {
                        *sum = *sum + *cell;
                        *cell = T::zero();
                    }
                }
            }
            if !total.is_empty() {
                std::mem::swap(&mut grid, &mut total);
            }
            let start = (chirps.start - self.job.chirps.start) * num_samples;
            let out = &mut self.out[start..][..chirps.len() * num_samples];
            plan.add_samples(&mut grid, lanes, out, &mut work);
        }
    }
}

/// A chunk of paths in a group of chirps.
struct ChunkSpread<'a, T: Precision> {
    plan: &'a LaneGrid<T>,
    phases: &'a Phases<'a>,
    amplitudes: &'a Amplitudes<'a>,
}

impl<T: Precision> ChunkSpread<'_, T> {
    /// Spread the chunk of paths on the grid.
    #[inline(always)]
    fn add<I: Isa, const W: usize>(&self, grid: &mut [T]) {
        let lanes = <T::In<I>>::LANES;
        let (phases, num_cells) = (self.phases, self.plan.num_cells as f64);
        let mean = splat::<I>(self.plan.mean);
        let cells = splat::<I>(num_cells);
        let turns = whole_turns(phases.step, &phases.chunk.delay[0]);
        for path in 0..phases.chunk.len {
            // Coordinate on the grid: the first of the cells, and the offset from the middle of its tap.
            let phi = phases.of::<I, 3>(path);
            let place = mul(sub(phi[1], splat::<I>(turns[path])), cells);
            let start = sub(place, splat::<I>(0.5 * (W as f64 - 1.0)));
            let first = round::<I, 2>(start);
            let offset = sub(first, start);
            let z = T::narrow::<I>(add(offset, offset));
            let taps = self.taps::<T::In<I>, W>(z);

            // Strength with the mean of the curvature, and second strength of the remainder.
            let base = cos_sin::<T, I>(mul_add(phi[2], mean, phi[0]));
            let q = complex_mul(self.amplitudes.in_the_middle::<T, I>(path), base);
            let mut second = q;
            if self.plan.has_second {
                let e = T::narrow::<I>(mul(phi[2], splat::<I>(TAU * self.plan.mean.max(1.0))));
                second = [<T::In<I>>::splat(T::zero()).sub(e.mul(q[1])), e.mul(q[0])];
            }

            // One pass per distinct first cell of the chirps: usually one or two.
            let first = T::narrow::<I>(first);
            let mut firsts = [T::zero(); MAX_LANES];
            first.store(&mut firsts[..lanes]);
            let (low, high) = bounds(&firsts, lanes);
            if low == high {
                self.add_window::<T::In<I>, W>(grid, low, &taps, q, second);
            } else if high - low == T::one() {
                let mask = first.sub(<T::In<I>>::splat(low));
                let (q_high, second_high) = (
                    [q[0].mul(mask), q[1].mul(mask)],
                    [second[0].mul(mask), second[1].mul(mask)],
                );
                let q_low = [q[0].sub(q_high[0]), q[1].sub(q_high[1])];
                let second_low = [second[0].sub(second_high[0]), second[1].sub(second_high[1])];
                self.add_window::<T::In<I>, W>(grid, low, &taps, q_low, second_low);
                self.add_window::<T::In<I>, W>(grid, high, &taps, q_high, second_high);
            } else {
                let mut cell = low;
                while cell <= high {
                    let mut mask = [T::zero(); MAX_LANES];
                    let mut is_any = false;
                    for i in 0..lanes {
                        let is_here = firsts[i] == cell;
                        is_any |= is_here;
                        mask[i] = if is_here { T::one() } else { T::zero() };
                    }
                    if is_any {
                        let mask = <T::In<I>>::load(&mask);
                        let q = [q[0].mul(mask), q[1].mul(mask)];
                        let second = [second[0].mul(mask), second[1].mul(mask)];
                        self.add_window::<T::In<I>, W>(grid, cell, &taps, q, second);
                    }
                    cell = cell + T::one();
                }
            }
        }
    }

    /// Taps of the kernel at the cells: `tap_(w-1-i)(z) = tap_i(-z)`, so even and odd powers serve two.
    #[inline(always)]
    fn taps<V: Vector<Scalar = T>, const W: usize>(&self, z: V) -> [V; W] {
        let square = z.mul(z);
        let mut taps = [z; W];
        for i in 0..W.div_ceil(2) {
            let coefficients = &self.plan.taps[i];
            let (top_even, top_odd) = if degree(W).is_multiple_of(2) {
                (degree(W), degree(W) - 1)
            } else {
                (degree(W) - 1, degree(W))
            };
            let mut even = V::splat(coefficients[top_even]);
            for n in (0..top_even / 2).rev() {
                even = even.mul_add(square, V::splat(coefficients[2 * n]));
            }
            taps[i] = even;
            if 2 * i + 1 != W {
                let mut odd = V::splat(coefficients[top_odd]);
                for n in (0..top_odd / 2).rev() {
                    odd = odd.mul_add(square, V::splat(coefficients[2 * n + 1]));
                }
                taps[i] = odd.mul_add(z, even);
                taps[W - 1 - i] = odd.neg_mul_add(z, even);
            }
        }
        taps
    }

    /// Add strengths times taps to the cells from `first` on, modulo the number of cells.
    #[inline(always)]
    fn add_window<V: Vector<Scalar = T>, const W: usize>(
        &self,
        grid: &mut [T],
        first: T,
        taps: &[V; W],
        q: [V; 2],
        second: [V; 2],
    ) {
        let num_cells = self.plan.num_cells as f64;
        let mut first = first.wide();
        if !(0.0..num_cells).contains(&first) {
            first = wrapped(first, num_cells);
        }
        let first = first as usize;
        if self.plan.has_second {
            let stride = 4 * V::LANES;
            let window = &mut grid[first * stride..][..W * stride];
            for (cell, tap) in window.chunks_exact_mut(stride).zip(taps) {
                for (part, value) in [q[0], q[1], second[0], second[1]].into_iter().enumerate() {
                    let sum = &mut cell[part * V::LANES..][..V::LANES];
                    tap.mul_add(value, V::load(sum)).store(sum);
                }
            }
        } else {
            let stride = 2 * V::LANES;
            let window = &mut grid[first * stride..][..W * stride];
            for (cell, tap) in window.chunks_exact_mut(stride).zip(taps) {
                let (re, im) = cell.split_at_mut(V::LANES);
                tap.mul_add(q[0], V::load(re)).store(re);
                tap.mul_add(q[1], V::load(im)).store(im);
            }
        }
    }
}

/// Modulo, in a cold function: most calls need no division.
#[cold]
#[inline(never)]
fn wrapped(cell: f64, num_cells: f64) -> f64 {
    cell - num_cells * (cell / num_cells).floor()
}

/// Whole turns per sample of the constant delay, which bring its cell to the grid.
#[inline(always)]
fn whole_turns(step: f64, delay: &Lane) -> Lane {
    let mut turns = [0.0; CHUNK];
    for i in 0..CHUNK {
        turns[i] = ((step * delay[i] - 0.5) + ROUND) - ROUND;
    }
    turns
}

/// Smallest and largest of the lanes.
#[inline(always)]
fn bounds<T: Precision>(numbers: &[T; MAX_LANES], lanes: usize) -> (T, T) {
    const FOUR: usize = 4;
    let fours = numbers[..lanes].as_chunks::<FOUR>().0;
    let (mut low, mut high) = (fours[0], fours[0]);
    for four in &fours[1..] {
        for i in 0..FOUR {
            low[i] = if four[i] < low[i] { four[i] } else { low[i] };
            high[i] = if four[i] > high[i] { four[i] } else { high[i] };
        }
    }
    let smaller = |a: T, b: T| if b < a { b } else { a };
    let larger = |a: T, b: T| if b > a { b } else { a };
    (
        smaller(smaller(low[0], low[1]), smaller(low[2], low[3])),
        larger(larger(high[0], high[1]), larger(high[2], high[3])),
    )
}

#[cfg(test)]
mod tests {
    use super::super::chirp_phases::tests::*;
    use super::*;

    fn error_of<T: Precision>(waveform: &Waveform, paths: &Paths, width: usize, has_second: bool) -> f64 {
        let plan = LaneGrid::<T>::new(waveform, width, has_second);
        Level::available()
            .into_iter()
            .map(|level| error::<T>(waveform, paths, |job, out| plan.add(level, job, out)))
            .fold(0.0, f64::max)
    }

    #[test]
    fn kernel_error_falls_tenfold_per_cell() {
        let wf = waveform(1e9, 128, 17);
        let paths = polynomial(300, 0.0);
        for (width, bound) in [(4, 1e-3), (5, 1e-4), (6, 1e-5)] {
            let error = error_of::<f32>(&wf, &paths, width, true);
            assert!(error < bound, "{width}: {error}");
        }
    }

    #[test]
    fn any_motion_and_chirp_times_agree_with_the_direct_sum() {
        for (num_chirps, num_samples) in [(1, 128), (2, 16), (17, 1), (17, 128), (64, 128)] {
            for bandwidth in [1e9, -1e9, 5e9] {
                let mut wf = waveform(bandwidth, num_samples, num_chirps);
                wf.chirp_times.iter_mut().step_by(3).for_each(|t| *t += 37e-6);
                for (name, paths) in [
                    ("linear", polynomial(300, 0.0)),
                    ("accelerating", polynomial(300, 50.0)),
                    ("fan", fan(&wf, 300, 16, 20.0, false)),
                    ("fading fan", fan(&wf, 300, 16, 20.0, true)),
                    ("one", polynomial(1, 9.0)),
                    ("none", polynomial(0, 9.0)),
                ] {
                    let single = error_of::<f32>(&wf, &paths, 6, true);
                    // Amplitudes of the fading fan change by up to 2 x 19 m/s x 32 us / 1 m = 1e-3 in half a chirp.
                    let bound = match name {
                        "fading fan" => 5e-4,
                        "fan" => 1e-4,
                        _ => 2e-5,
                    };
                    assert!(
                        single < bound,
                        "{num_chirps} {num_samples} {bandwidth} {name}: {single}"
                    );
                }
            }
        }
    }
}
