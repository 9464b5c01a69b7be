//! Recurrence sum: phasors that turn from sample to sample, in every chirp of a group at once.
//!
//! A chirp is cut into segments. About the middle sample of one, a path is `g(j) w^j`: a phasor `w`, and an envelope
//! `g(j) = sum_n g_n j^n` that holds the amplitude, its change, and the phase beyond its slope. With `c + i s = w^j`,
//! and `p` and `q` the even and odd parts of the envelope, the samples to either side share their recurrence:
//!
//! ```text
//! g(+-j) w^(+-j) = (p c + i q s) +- (q c + i p s)
//! ```
//!
//! Both brackets are summed over the paths and put together at the end of a chunk. Where `q` is negligible this takes
//! 4 multiplications (or fused multiply-adds) for the recurrence and 4 for the sums, per two samples.

use std::f64::consts::TAU;

use num_complex::Complex;

use super::chirp_phases::{Amplitudes, Group, Job, MAX_LANES, Phases, TERMS, Wide, complex_mul, cos_sin, splat};
use crate::cancel::Cancel;
use crate::numeric::simd::{Isa, Kernel, Level, Precision, Vector};
use crate::numeric::wide::{mul, mul_add};
use crate::synthesis::block::{CHUNK, Chunk};

/// Adds `scale conj(a) exp(2 pi j phi)` of every path to samples `(chirp, sample)`, row-major, of the chirps of a job.
///
/// Error relative to the l2 norm of the amplitudes: below 5e-6 (f32) and 2e-12 (f64) for paths at a few metres. Within
/// a chirp delays are followed to fourth order in time, and amplitudes to second: of what turns or fades in a few
/// milliseconds, f64 leaves out 1e-9 (chirps of 60 us) to 2e-8 (250 us).
pub fn add_recurrence<T: Precision>(level: Level, job: &Job, out: &mut [Complex<T>]) {
    job.check(out.len());
    level.run(AddRecurrence { job, out });
}

struct AddRecurrence<'a, T> {
    job: &'a Job<'a>,
    out: &'a mut [Complex<T>],
}

impl<T: Precision> Kernel for AddRecurrence<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) {
        let Job {
            waveform,
            series,
            channel,
            selection,
            ..
        } = *self.job;
        let (lanes, num_samples) = (<T::In<I>>::LANES, waveform.num_samples);
        let mut chunk = Chunk::new(series);
        let mut sums = Sums::<T>::new(num_samples);
        for first_chirp in self.job.chirps.clone().step_by(lanes) {
            let chirps = first_chirp..self.job.chirps.end.min(first_chirp + lanes);
            let group = Group::new(waveform, series, chirps.clone());
            sums.total.fill(T::zero());
            for first in self.job.paths.clone().step_by(CHUNK) {
                if self.job.cancel.is_some_and(Cancel::is_asked) {
                    break;
                }
                chunk.load::<I>(series, channel, first, &group.block, selection);
                let phases = Phases::new(waveform, &group, &chunk, 0.1 * tolerance::<T>());
                let amplitudes = Amplitudes::new(&group, &chunk, self.job.scale, num_samples, 0.1 * tolerance::<T>());
                let form = Form::new::<T>(&phases, &amplitudes, num_samples);
                let chunk = ChunkSum {
                    phases: &phases,
                    amplitudes: &amplitudes,
                    num_samples,
                    half: form.half,
                };
                // Two paths at once where there are registers for them.
                match (form.terms, I::REGISTERS) {
                    ((1, 0), 1) => chunk.add::<T, I, 1, 0, 2>(&mut sums),
                    ((2, 0), 1) => chunk.add::<T, I, 2, 0, 2>(&mut sums),
                    ((3, 0), 1) => chunk.add::<T, I, 3, 0, 2>(&mut sums),
                    (_, 1) => chunk.add::<T, I, 3, 3, 2>(&mut sums),
                    ((1, 0), _) => chunk.add::<T, I, 1, 0, 1>(&mut sums),
                    ((2, 0), _) => chunk.add::<T, I, 2, 0, 1>(&mut sums),
                    ((3, 0), _) => chunk.add::<T, I, 3, 0, 1>(&mut sums),
                    _ => chunk.add::<T, I, 3, 3, 1>(&mut sums),
                }
            }
            // Samples of a lane are a row of the output.
            let start = (chirps.start - self.job.chirps.start) * num_samples;
            for (lane, row) in self.out[start..].chunks_mut(num_samples).take(chirps.len()).enumerate() {
                for (sample, total) in row.iter_mut().zip(sums.total.chunks(2 * lanes)) {
                    *sample = *sample + Complex::new(total[lane], total[lanes + lane]);
                }
            }
        }
    }
}

/// Boundary that sums start at [bytes]: vectors across two lines of the cache load and store at half the speed.
const CACHE_LINE: usize = 64;

/// Tolerance of the truncation of a path, relative to its amplitude.
const fn tolerance<T: Precision>() -> f64 {
    if size_of::<T>() == 4 { 2e-6 } else { 1e-12 }
}

/// Form of the sum: length of the segments, and terms of the envelope: `p` to `j^(2 even)`, `q` to `j^(2 odd - 1)`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Form {
    /// Half length of a segment of `2 half + 1` samples.
    half: usize,
    /// Terms of the envelope, (even, odd).
    terms: (usize, usize),
}

impl Form {
    /// Cheapest form whose error is within the tolerance.
    #[cfg_attr(optimised, inline(always))]
    fn new<T: Precision>(phases: &Phases, amplitudes: &Amplitudes, num_samples: usize) -> Self {
        // Few, as each is compiled for every instruction set: those of paths at constant rates, and that of all others.
        const TERMS: [(usize, usize); 4] = [(1, 0), (2, 0), (3, 0), (3, 3)];
        // Cost of a segment's start in operations; see the `beat/recurrence` bench.
        const START: usize = 150;
        // The rounding of a phasor grows with its turns: after 64 it is 1e-5 (f32) or 1e-14 (f64) at most.
        const LONGEST: usize = 64;
        let reach = (num_samples / 2 + 1) as f64;
        let phi = phases.bounds();
        let alpha = amplitudes.bounds;

        let mut num_segments = num_samples.div_ceil(2 * LONGEST + 1);
        let mut best = (usize::MAX, Self { half: 0, terms: (3, 3) });
        loop {
            let half = num_samples.div_ceil(num_segments) / 2;
            let errors = errors(&phi, &alpha, reach, half as f64);
            for (terms, error) in TERMS.into_iter().zip(errors) {
                let (even, odd) = terms;
                let operations = 8 + 2 * even + if odd > 0 { 4 + 2 * odd } else { 0 };
                let cost = num_segments * (START + half * operations);
                if cost < best.0 && (error <= tolerance::<T>() || (half <= 2 && terms == (3, 3))) {
                    best = (cost, Self { half, terms });
                }
            }
            if half <= 2 {
                return best.1;
            }
            num_segments *= 2;
        }
    }
}

/// Bounds of the truncation errors of all forms, for segments reaching `half` samples from their middle, `reach` from
/// the chirp's.
fn errors(phi: &[f64; TERMS], alpha: &[f64; 3], reach: f64, half: f64) -> [f64; 4] {
    // Coefficients about the middle of a segment, for j = half.
    let e2 = TAU * half.powi(2) * (phi[2] + reach * (3.0 * phi[3] + reach * 6.0 * phi[4]));
    let e3 = TAU * half.powi(3) * (phi[3] + reach * 4.0 * phi[4]);
    let e4 = TAU * half.powi(4) * phi[4];
    let a = [
        alpha[0],
        half * (alpha[1] + 2.0 * reach * alpha[2]),
        half * half * alpha[2],
    ];
    // Majorant of the envelope's coefficients: amplitude times exponential, by (n + 1) x_(n+1) = sum m e_m x_(n+1-m).
    let mut exponential = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for n in 1..9 {
        let term = |m: usize, e: f64| if n >= m { m as f64 * e * exponential[n - m] } else { 0.0 };
        exponential[n] = (term(2, e2) + term(3, e3) + term(4, e4)) / n as f64;
    }
    let mut g = [0.0; 9];
    for n in 0..9 {
        for m in 0..3.min(n + 1) {
            g[n] += a[m] * exponential[n - m];
        }
    }
    let even = |from: usize| (from..=4).map(|n| g[2 * n]).sum::<f64>();
    let odd = |from: usize| (from..4).map(|n| g[2 * n + 1]).sum::<f64>();
    // Without odd terms the slope takes the best part of the cubic.
    let no_odd = g[1] + 0.4 * e3 + odd(1) - e3 * a[0];
    [even(2) + no_odd, even(3) + no_odd, even(4) + no_odd, even(4) + odd(3)]
}

/// Sums over the paths, in numbers of vectors of lanes.
struct Sums<T> {
    /// Sums of a chunk: the even bracket (re, im) and the odd one, per segment and `j`.
    chunk: Vec<T>,
    /// Sums of all chunks: (re, im) per sample.
    total: Vec<T>,
    /// Numbers 0, 1, 2, ...
    numbers: Vec<T>,
    /// Squares of `numbers`.
    squares: Vec<T>,
}

impl<T: Precision> Sums<T> {
    fn new(num_samples: usize) -> Self {
        // Segments of 2 half + 1 samples, of which half + 1 are stored: with half >= 1, at most two thirds of twice.
        let capacity = 2 * num_samples + 4;
        let numbers: Vec<T> = (0..=num_samples / 2 + 1).map(|j| T::of(j as f64)).collect();
        Self {
            chunk: vec![T::zero(); 4 * MAX_LANES * capacity + CACHE_LINE / size_of::<T>()],
            total: vec![T::zero(); 2 * MAX_LANES * num_samples],
            squares: numbers.iter().map(|j| *j * *j).collect(),
            numbers,
        }
    }
}

/// Start of a path in a segment: the phasor of its recurrence and its envelope.
#[derive(Clone, Copy)]
struct Start<V> {
    /// Phasor from sample to sample.
    w: [V; 2],
    /// Envelope.
    g: [[V; 2]; 7],
}

impl<V: Vector> Start<V> {
    #[cfg_attr(optimised, inline(always))]
    fn zero() -> Self {
        let zero = [V::splat(V::Scalar::default()); 2];
        Self { w: zero, g: [zero; 7] }
    }
}

/// Sum of a chunk of paths in a group of chirps.
struct ChunkSum<'a> {
    phases: &'a Phases<'a>,
    amplitudes: &'a Amplitudes<'a>,
    num_samples: usize,
    half: usize,
}

impl ChunkSum<'_> {
    /// Add the chunk to the total.
    #[cfg_attr(optimised, inline(always))]
    fn add<T: Precision, I: Isa, const EVEN: usize, const ODD: usize, const PATHS: usize>(&self, sums: &mut Sums<T>) {
        let lanes = <T::In<I>>::LANES;
        let length = 2 * self.half + 1;
        let num_segments = self.num_samples.div_ceil(length);
        let stride = 4 * lanes * (self.half + 1);
        let Sums {
            chunk,
            total,
            numbers,
            squares,
        } = sums;
        let start = chunk.as_ptr().align_offset(CACHE_LINE);
        let chunk = &mut chunk[start..][..num_segments * stride];
        let (numbers, squares) = (&numbers[..=self.half], &squares[..=self.half]);

        // Two paths at a time share the loads and stores of the sums, where there are registers for them. After the
        // last path of a chunk comes one without amplitude.
        chunk.fill(T::zero());
        for path in (0..self.phases.chunk.len).step_by(PATHS) {
            let mut phi = [[splat::<I>(0.0); TERMS]; PATHS];
            let mut amplitude = [[[splat::<I>(0.0); 2]; 3]; PATHS];
            for i in 0..PATHS {
                phi[i] = if size_of::<T>() == 4 {
                    self.phases.of::<I, 4>(path + i)
                } else {
                    self.phases.of::<I, TERMS>(path + i)
                };
                amplitude[i] = self.amplitudes.of::<I>(path + i);
            }
            for (segment, sums) in chunk.chunks_exact_mut(stride).enumerate() {
                let middle = (segment * length + self.half) as f64 - (self.num_samples / 2) as f64;
                let mut starts = [Start::zero(); PATHS];
                for i in 0..PATHS {
                    starts[i] = self.start::<T, I, EVEN, ODD>(&phi[i], &amplitude[i], middle);
                }
                add_segment::<T::In<I>, EVEN, ODD, PATHS>(&starts, numbers, squares, sums);
            }
        }

        // Samples from the brackets.
        for (segment, sums) in chunk.chunks_exact(stride).enumerate() {
            let middle = segment * length + self.half;
            for (j, sums) in sums.chunks_exact(4 * lanes).enumerate() {
                let (even, odd) = sums.split_at(2 * lanes);
                let samples = [(middle - j, -T::one()), (middle + j, T::one())];
                for (sample, sign) in samples.into_iter().skip(usize::from(j == 0)) {
                    if sample < self.num_samples {
                        let total = &mut total[2 * lanes * sample..][..2 * lanes];
                        for i in 0..2 * lanes {
                            total[i] = total[i] + (even[i] + sign * odd[i]);
                        }
                    }
                }
            }
        }
    }

    /// Start of a path in the segment about `middle`, in samples from the middle of the chirp.
    #[cfg_attr(optimised, inline(always))]
    fn start<T: Precision, I: Isa, const EVEN: usize, const ODD: usize>(
        &self,
        phi: &[Wide<I>; TERMS],
        amplitude: &[[Wide<I>; 2]; 3],
        middle: f64,
    ) -> Start<T::In<I>> {
        let number = |x: f64| <T::In<I>>::splat(T::of(x));
        // Move the middle of the Taylor series: synthetic division.
        let mut phi = *phi;
        let by = splat::<I>(middle);
        for first in 0..TERMS - 1 {
            for n in (first..TERMS - 1).rev() {
                phi[n] = mul_add(phi[n + 1], by, phi[n]);
            }
        }
        if ODD == 0 {
            // The straight line nearest to j^3 has slope 3/5 of half^2.
            phi[1] = mul_add(phi[3], splat::<I>(0.6 * (self.half * self.half) as f64), phi[1]);
        }
        let base = cos_sin::<T, I>(phi[0]);
        let w = cos_sin::<T, I>(phi[1]);

        // Amplitude about the middle, turned by the phase there.
        let zero = [number(0.0); 2];
        let turned = |a: [Wide<I>; 2]| complex_mul([T::narrow::<I>(a[0]), T::narrow::<I>(a[1])], base);
        let mut g = [zero; 7];
        let mut a = *amplitude;
        if self.amplitudes.num_terms > 1 {
            for part in 0..2 {
                a[1][part] = mul_add(a[2][part], by, a[1][part]);
                a[0][part] = mul_add(a[1][part], by, a[0][part]);
                a[1][part] = mul_add(a[2][part], by, a[1][part]);
            }
        }
        let a = if self.amplitudes.num_terms > 1 {
            [turned(a[0]), turned(a[1]), turned(a[2])]
        } else {
            [turned(a[0]), zero, zero]
        };

        // Envelope: amplitude times exp(i (e2 j^2 + e3 j^3 + e4 j^4)).
        let angle = |phi: Wide<I>| T::narrow::<I>(mul(phi, splat::<I>(TAU)));
        let (e2, e3, e4) = (angle(phi[2]), angle(phi[3]), angle(phi[4]));
        let half = number(0.5);
        g[0] = a[0];
        if ODD >= 1 {
            g[1] = a[1];
        }
        if EVEN >= 1 {
            g[2] = add_i(a[2], e2, a[0]);
        }
        if ODD >= 2 {
            g[3] = add_i(add_i(zero, e2, a[1]), e3, a[0]);
        }
        if EVEN >= 2 {
            // x_4 = -e2^2 / 2 + i e4
            let square = e2.mul(e2).mul(half);
            g[4] = add_i(add_real(zero, number(0.0).sub(square), a[0]), e4, a[0]);
            g[4] = add_i(add_i(g[4], e3, a[1]), e2, a[2]);
        }
        if ODD >= 3 {
            // x_5 = -e2 e3
            let (square, product) = (e2.mul(e2).mul(half), e2.mul(e3));
            g[5] = add_real(zero, number(0.0).sub(product), a[0]);
            g[5] = add_i(add_real(g[5], number(0.0).sub(square), a[1]), e4, a[1]);
            g[5] = add_i(g[5], e3, a[2]);
        }
        if EVEN >= 3 {
            // x_6 = -i e2^3 / 6 - e3^2 / 2 - e2 e4
            let square = e2.mul(e2);
            let real = e3.mul(e3).mul(half).add(e2.mul(e4));
            g[6] = add_real(zero, number(0.0).sub(real), a[0]);
            g[6] = add_i(g[6], number(0.0).sub(square.mul(e2).mul(number(1.0 / 6.0))), a[0]);
            g[6] = add_real(g[6], number(0.0).sub(square.mul(half)), a[2]);
            g[6] = add_real(g[6], number(0.0).sub(e2.mul(e3)), a[1]);
        }
        Start { w, g }
    }
}

/// `sum + i x a`
#[cfg_attr(optimised, inline(always))]
fn add_i<V: Vector>(sum: [V; 2], x: V, a: [V; 2]) -> [V; 2] {
    [x.neg_mul_add(a[1], sum[0]), x.mul_add(a[0], sum[1])]
}

/// `sum + x a`
#[cfg_attr(optimised, inline(always))]
fn add_real<V: Vector>(sum: [V; 2], x: V, a: [V; 2]) -> [V; 2] {
    [x.mul_add(a[0], sum[0]), x.mul_add(a[1], sum[1])]
}

/// Add paths to the brackets of a segment.
#[cfg_attr(optimised, inline(always))]
fn add_segment<V: Vector, const EVEN: usize, const ODD: usize, const PATHS: usize>(
    starts: &[Start<V>; PATHS],
    numbers: &[V::Scalar],
    squares: &[V::Scalar],
    sums: &mut [V::Scalar],
) {
    let lanes = V::LANES;
    for part in 0..2 {
        let sum = &mut sums[part * lanes..][..lanes];
        let mut total = V::load(sum);
        for start in starts {
            total = total.add(start.g[0][part]);
        }
        total.store(sum);
    }
    let mut turned = [starts[0].w; PATHS]; // w^j
    for i in 1..PATHS {
        turned[i] = starts[i].w;
    }
    // By index: an iterator that the compiler leaves as a call would spill all registers at every step.
    for j in 1..numbers.len() {
        let sums = &mut sums[4 * lanes * j..][..4 * lanes];
        let (j, square) = (V::splat(numbers[j]), V::splat(squares[j]));
        let mut even = [V::load(sums), V::load(&sums[lanes..])];
        let mut odd = [V::load(&sums[2 * lanes..]), V::load(&sums[3 * lanes..])];
        for i in 0..PATHS {
            let Start { w, g } = &starts[i];
            let [c, s] = turned[i];
            // p c + i p s
            let mut p = g[2 * EVEN];
            for n in (0..EVEN).rev() {
                p = [p[0].mul_add(square, g[2 * n][0]), p[1].mul_add(square, g[2 * n][1])];
            }
            even = [p[0].mul_add(c, even[0]), p[1].mul_add(c, even[1])];
            odd = [p[1].neg_mul_add(s, odd[0]), p[0].mul_add(s, odd[1])];
            // q c + i q s
            if ODD > 0 {
                let mut q = g[2 * ODD - 1];
                for n in (1..ODD).rev() {
                    q = [
                        q[0].mul_add(square, g[2 * n - 1][0]),
                        q[1].mul_add(square, g[2 * n - 1][1]),
                    ];
                }
                let q = [q[0].mul(j), q[1].mul(j)];
                odd = [q[0].mul_add(c, odd[0]), q[1].mul_add(c, odd[1])];
                even = [q[1].neg_mul_add(s, even[0]), q[0].mul_add(s, even[1])];
            }
            turned[i] = complex_mul([c, s], *w);
        }
        even[0].store(sums);
        even[1].store(&mut sums[lanes..]);
        odd[0].store(&mut sums[2 * lanes..]);
        odd[1].store(&mut sums[3 * lanes..]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::chirp_phases::tests::*;
    use super::*;

    fn errors_of<T: Precision>(waveform: &crate::synthesis::chirp::Waveform, paths: &Paths) -> f64 {
        Level::available()
            .into_iter()
            .map(|level| error::<T>(waveform, paths, |job, out| add_recurrence(level, job, out)))
            .fold(0.0, f64::max)
    }

    #[test]
    fn sums_agree_with_the_direct_sum() {
        // Every length with a slope, and one with all of them.
        let slopes = [1e9, -1e9, 5e9].map(|slope| (17, 128, slope));
        let sizes = [
            (1, 128, 1e9),
            (2, 16, -1e9),
            (17, 1, 5e9),
            (40, 128, -1e9),
            (3, 500, 5e9),
        ];
        for (num_chirps, num_samples, slope) in slopes.into_iter().chain(sizes) {
            let mut wf = waveform(slope, num_samples, num_chirps);
            for staggered in [false, true] {
                if staggered {
                    wf.chirp_times.iter_mut().step_by(3).for_each(|t| *t += 37e-6);
                }
                for (name, paths) in [
                    ("linear", polynomial(300, 0.0)),
                    ("accelerating", polynomial(300, 50.0)),
                    ("fan", fan(&wf, 300, 16, 20.0, false)),
                    ("fading fan", fan(&wf, 300, 16, 20.0, true)),
                    ("one", polynomial(1, 9.0)),
                    ("none", polynomial(0, 9.0)),
                ] {
                    let single = errors_of::<f32>(&wf, &paths);
                    let double = errors_of::<f64>(&wf, &paths);
                    assert!(single < 5e-6, "{num_chirps} {num_samples} {slope} {name}: {single}");
                    // The third order of an amplitude within a chirp is left out, and the fifth of a delay, which
                    // shows in a fan's long chirps.
                    let bound = match name {
                        "fading fan" => 5e-8,
                        "fan" => 1e-8,
                        _ => 2e-12,
                    };
                    assert!(double < bound, "{num_chirps} {num_samples} {slope} {name}: {double}");
                }
            }
        }
    }
}
