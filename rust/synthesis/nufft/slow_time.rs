//! Dense transform from velocity rows to chirps: pairs of rows and of chirps share cosines and sines.

use num_complex::Complex;

use super::job::Job;
use super::layout::Layout;
use super::scalar::Scalar;
use super::spectra::Channel;
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Vector, interleave};
use crate::numeric::wide::{self, Wide, add, mul, mul_add};
use crate::synthesis::low_rank::residual_phase::{Path, turns};
use crate::synthesis::nufft::kernel::KaiserBessel;

/// Add the samples of all chirps of a block, (chirp, sample), for channels that share a job's block plan.
pub fn add_chirps<T: Scalar>(
    job: &Job,
    layout: &Layout,
    kernel: &KaiserBessel,
    channels: &[Channel<T>],
    out: &mut [&mut [Complex<T>]],
) {
    let num_samples = job.waveform.num_samples;
    let slow = SlowTime::<T>::new(job, layout, kernel, channels);
    let tile = |i: usize| {
        job.level.run(Tile {
            job,
            slow: &slow,
            channels,
            first: i * T::LANES,
        })
    };
    let num_tiles = num_samples.div_ceil(T::LANES);
    let tiles: Vec<Vec<T>> = parallel::map(job.is_parallel, (0..num_tiles).collect(), tile);
    let num_chirps = job.block_plan.block.chirps.len();
    for (i, tile) in tiles.iter().enumerate() {
        let first = i * T::LANES;
        let len = T::LANES.min(num_samples - first);
        for (row, values) in tile.chunks_exact(2 * T::LANES).enumerate() {
            let (channel, chirp) = (row / num_chirps, row % num_chirps);
            let samples = &mut out[channel][chirp * num_samples + first..][..len];
            for (sample, [re, im]) in samples.iter_mut().zip(values.as_chunks().0) {
                *sample = *sample + Complex::new(*re, *im);
            }
        }
    }
}

/// Constants of slow time, the same for all tiles of samples.
struct SlowTime<T> {
    /// Coefficients of the square root of 1 / transform of the kernel in powers of (4 xi h)^2.
    inverse_root: Vec<T>,
    /// Groups of `GROUP` pairs of rows at equal distances from the middle of the axis.
    groups: Vec<Group>,
    num_rows: usize,
    /// Number of sums per chirp: channels times terms.
    num_sums: usize,
    /// Number of terms of the longest series of a reference path.
    num_degrees: usize,
    /// Power of two that keeps the amplitudes of references in range.
    scale: f64,
    /// Pairs of chirps at equal times before and after the block's centre [s]; a chirp without partner stands alone.
    chirps: Vec<(f64, Option<usize>, Option<usize>)>,
}

/// Group of consecutive pairs of rows.
struct Group {
    /// Steps from the middle of the axis to the first pair, less one half.
    first: usize,
    /// Row above the middle and row below, if in use. Unused pairs at the end are left out.
    pairs: Vec<[Option<usize>; 2]>,
}

impl<T: Scalar> SlowTime<T> {
    fn new(job: &Job, layout: &Layout, kernel: &KaiserBessel, channels: &[Channel<T>]) -> Self {
        let used = |row: usize| channels.iter().any(|channel| channel.is_used[row]).then_some(row);
        let half = layout.rows / 2;
        let groups = (0..half).step_by(GROUP).map(|first| {
            let last = half.min(first + GROUP);
            let mut pairs: Vec<_> = (first..last).map(|k| [used(half + k), used(half - 1 - k)]).collect();
            while pairs.last() == Some(&[None, None]) {
                pairs.pop();
            }
            Group { first, pairs }
        });
        let groups = groups.filter(|group| !group.pairs.is_empty()).collect();

        // Chirps by distance from the centre; equal distances on both sides share their cosines and sines.
        let block = &job.block_plan.block;
        let mut offsets: Vec<(f64, usize)> = (0..block.chirps.len())
            .map(|c| (block.offset(job.waveform, c), c))
            .collect();
        offsets.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let mut chirps: Vec<(f64, Option<usize>, Option<usize>)> = Vec::new();
        for (time, c) in offsets {
            match chirps.last_mut() {
                // Differences by rounding of absolute times do not count.
                Some((at, Some(_), after @ None)) if (time + *at).abs() <= 1e-12 * block.half => *after = Some(c),
                _ => chirps.push((time, Some(c), None)),
            }
        }
        Self {
            inverse_root: kernel.tables().inverse_root.iter().map(|c| T::of(*c)).collect(),
            groups,
            num_rows: layout.rows,
            num_sums: channels.len() * job.block_plan.approximation.num_sets(),
            num_degrees: job.block_plan.approximation.num_degrees(),
            scale: job.scale,
            chirps,
        }
    }
}

/// Consecutive samples of all chirps, as many as a vector has lanes.
struct Tile<'a, T> {
    job: &'a Job<'a>,
    slow: &'a SlowTime<T>,
    channels: &'a [Channel<T>],
    first: usize,
}

/// Pairs of rows from one directly computed phasor to the next.
const GROUP: usize = 16;

/// Cosine and sine.
type Phasor<V> = [V; 2];

impl<T: Scalar> Kernel for Tile<'_, T> {
    type Output = Vec<T>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Vec<T> {
        if T::LANES == 16 {
            self.tile::<I, 2>()
        } else {
            self.tile::<I, 1>()
        }
    }
}

/// Fast time of the samples of a tile about the middle one, and the frequency that a rate sees then.
struct Fast<I: Isa, const P: usize> {
    time: Wide<I, P>,
    frequency: Wide<I, P>,
}

impl<T: Scalar> Tile<'_, T> {
    /// All chirps at `8 P` samples, (channel, chirp, lane, [re, im]).
    #[cfg_attr(optimised, inline(always))]
    fn tile<I: Isa, const P: usize>(self) -> Vec<T> {
        let (job, slow) = (self.job, self.slow);
        let (waveform, block_plan) = (job.waveform, job.block_plan);
        let num_sums = slow.num_sums;
        let mut time = [0.0; 16];
        for i in 0..16 {
            time[i] = ((self.first + i) as f64 - (waveform.num_samples / 2) as f64) / waveform.sample_rate;
        }
        let time = wide::load::<I, P>(&time);
        let splat = wide::splat::<I, P>;
        let fast = Fast::<I, P> {
            time,
            frequency: mul_add(time, splat(waveform.slope), splat(block_plan.frame.carrier)),
        };

        let sums = self.even_and_odd::<I, P>(&fast);
        let zero = <T::In<I>>::splat(T::zero());
        let num_numbers = block_plan.block.chirps.len() * 2 * T::LANES;
        let mut out = vec![T::zero(); self.channels.len() * num_numbers];
        let mut transformed = vec![[zero; 4]; 2 * num_sums];
        let mut scratch = Scratch::default();
        let mut number = 0;
        while number < slow.chirps.len() {
            let chirps = &slow.chirps[number..slow.chirps.len().min(number + 2)];
            number += 2;
            let turns = |i: usize| block_plan.step * chirps[i].0;
            if chirps.len() == 2 {
                self.transform::<I, P, 2>(&fast, [turns(0), turns(1)], &sums, &mut transformed);
            } else {
                self.transform::<I, P, 1>(&fast, [turns(0)], &sums, &mut transformed);
            }
            for i in 0..chirps.len() {
                let (time, one, other) = chirps[i];
                let transformed = &transformed[i * num_sums..][..num_sums];
                for (sign, chirp) in [(1.0, one), (-1.0, other)] {
                    let Some(chirp) = chirp else {
                        continue;
                    };
                    self.weights::<I, P>(sign * time, &fast, &mut scratch);
                    for channel in 0..self.channels.len() {
                        let num_terms = scratch.weights.len();
                        let sums = &transformed[channel * num_terms..][..num_terms];
                        let samples = &mut out[channel * num_numbers + chirp * 2 * T::LANES..][..2 * T::LANES];
                        let [re, im] = weighted::<T, I>(sums, sign, &scratch.weights);
                        wide::store(interleave(re, im), samples);
                    }
                }
            }
        }
        out
    }

    /// Sums and differences of the rows of every pair, (group, term, pair, [sum re, im, difference re, im]).
    #[cfg_attr(optimised, inline(always))]
    fn even_and_odd<I: Isa, const P: usize>(&self, fast: &Fast<I, P>) -> Vec<[T::In<I>; 4]> {
        let (block_plan, slow) = (self.job.block_plan, self.slow);
        let (num_sums, num_terms) = (slow.num_sums, block_plan.approximation.num_sets());
        let zero = <T::In<I>>::splat(T::zero());
        let mut sums = vec![[zero; 4]; slow.groups.len() * num_sums * GROUP];
        let square = mul(mul(fast.time, fast.time), wide::splat::<I, P>(self.job.waveform.slope));
        for g in 0..slow.groups.len() {
            let group = &slow.groups[g];
            for p in 0..group.pairs.len() {
                let rate = block_plan.step * ((group.first + p) as f64 + 0.5);
                let [cos, sin] = wide::cos_sin::<T, I, P>(mul(square, wide::splat::<I, P>(rate)));
                for index in 0..num_sums {
                    let spectra = &self.channels[index / num_terms].spectra;
                    let term = index % num_terms;
                    let [mut a_re, mut a_im, mut b_re, mut b_im] = [zero; 4];
                    if let Some(row) = group.pairs[p][0] {
                        let at = (term * slow.num_rows + row) * spectra.padded + self.first;
                        a_re = <T::In<I>>::load(&spectra.re[at..]);
                        a_im = <T::In<I>>::load(&spectra.im[at..]);
                    }
                    if let Some(row) = group.pairs[p][1] {
                        let at = (term * slow.num_rows + row) * spectra.padded + self.first;
                        b_re = <T::In<I>>::load(&spectra.re[at..]);
                        b_im = <T::In<I>>::load(&spectra.im[at..]);
                    }
                    let [a_re, a_im] = product([a_re, a_im], [cos, sin]);
                    let [b_re, b_im] = product([b_re, b_im], [cos, zero.sub(sin)]);
                    sums[(g * num_sums + index) * GROUP + p] =
                        [a_re.add(b_re), a_im.add(b_im), a_re.sub(b_re), a_im.sub(b_im)];
                }
            }
        }
        sums
    }

    /// Sums over all pairs of rows for `N` chirps, (chirp, sum): real and imaginary part of the even sum, and of the
    /// odd sum turned by a quarter, imaginary first. `step` is the distance of the rows [turns per Hz].
    #[cfg_attr(optimised, inline(always))]
    fn transform<I: Isa, const P: usize, const N: usize>(
        &self,
        fast: &Fast<I, P>,
        step: [f64; N],
        sums: &[[T::In<I>; 4]],
        transformed: &mut [[T::In<I>; 4]],
    ) {
        let num_sums = self.slow.num_sums;
        let zero = <T::In<I>>::splat(T::zero());
        transformed.fill([zero; 4]);
        // Phasors (k + 1/2) steps from the middle, as products of two: within a group, and to its first pair.
        let mut turns = [fast.frequency; N];
        let mut fine = [[[zero; 2]; GROUP]; N];
        for i in 0..N {
            turns[i] = mul(turns[i], wide::splat::<I, P>(step[i]));
            fine[i] = powers::<T, I, P>(turns[i]);
        }
        let mut phasors = [[[zero; 2]; N]; GROUP];
        for g in 0..self.slow.groups.len() {
            let group = &self.slow.groups[g];
            let len = group.pairs.len().min(GROUP);
            for i in 0..N {
                let middle = wide::splat::<I, P>(group.first as f64 + 0.5);
                let coarse = wide::cos_sin::<T, I, P>(mul(turns[i], middle));
                for p in 0..len {
                    phasors[p][i] = product(coarse, fine[i][p]);
                }
            }
            for index in 0..num_sums {
                let sums = &sums[(g * num_sums + index) * GROUP..][..GROUP];
                let mut acc = [[zero; 4]; N];
                for i in 0..N {
                    acc[i] = transformed[i * num_sums + index];
                }
                for p in 0..len {
                    let [e_re, e_im, o_re, o_im] = sums[p];
                    for i in 0..N {
                        let [cos, sin] = phasors[p][i];
                        acc[i] = [
                            e_re.mul_add(cos, acc[i][0]),
                            e_im.mul_add(cos, acc[i][1]),
                            o_im.mul_add(sin, acc[i][2]),
                            o_re.mul_add(sin, acc[i][3]),
                        ];
                    }
                }
                for i in 0..N {
                    transformed[i * num_sums + index] = acc[i];
                }
            }
        }
    }

    /// Factors of the sums of all terms for one chirp: interpolation of the residuals, phase of the middle rate,
    /// transform of the kernel. The same for all channels.
    #[cfg_attr(optimised, inline(always))]
    fn weights<I: Isa, const P: usize>(&self, time: f64, fast: &Fast<I, P>, scratch: &mut Scratch<T::In<I>>) {
        let (waveform, block_plan) = (self.job.waveform, self.job.block_plan);
        let splat = wide::splat::<I, P>;
        let square = mul(mul(fast.time, fast.time), splat(waveform.slope));
        let keystone = mul_add(fast.frequency, splat(time), square);
        let phase = mul(keystone, splat(block_plan.middle_rate));
        let angle = wide::narrow::<T, I, P>(mul(keystone, splat(4.0 * block_plan.step)));
        let root = polynomial(&self.slow.inverse_root, angle.mul(angle));
        let weight = root.mul(root);

        let x = mul(add(fast.time, splat(time)), splat(block_plan.block.half.recip()));
        let x = wide::narrow::<T, I, P>(x);
        let sweep = wide::narrow::<T, I, P>(mul(fast.time, splat(block_plan.frame.stretch)));
        self.interpolate::<I>(x, sweep, scratch);
        let [cos, sin] = wide::cos_sin::<T, I, P>(phase);
        let common = [cos.mul(weight), sin.mul(weight)];
        for term in 0..scratch.weights.len() {
            scratch.weights[term] = product(scratch.weights[term], common);
        }
    }

    /// Weights of the sums of the terms in the interpolation; symbols as in `cross_approximation`: `L^T w = q`.
    #[cfg_attr(optimised, inline(always))]
    fn interpolate<I: Isa>(&self, x: T::In<I>, sweep: T::In<I>, scratch: &mut Scratch<T::In<I>>) {
        let approximation = &self.job.block_plan.approximation;
        let zero = <T::In<I>>::splat(T::zero());
        let number = wide::number::<T, I>;
        // Chebyshev polynomials of time.
        let num_degrees = self.slow.num_degrees;
        scratch.polynomials.clear();
        scratch.polynomials.extend([number(1.0), x]);
        for k in 2..num_degrees {
            let (before, current) = (scratch.polynomials[k - 2], scratch.polynomials[k - 1]);
            scratch.polynomials.push(x.add(x).mul(current).sub(before));
        }
        scratch.weights.clear();
        if approximation.are_flat() {
            scratch
                .weights
                .push(self.phasor::<I>(&approximation.mean, x, sweep, &scratch.polynomials));
            return;
        }
        for i in 0..approximation.references.len() {
            let (path, inverse, own) = &approximation.references[i];
            let (mut re, mut im) = (zero, zero);
            for k in 0..path.num_amplitudes() {
                re = scratch.polynomials[k].mul_add(number(path.re()[k] * self.slow.scale), re);
                im = scratch.polynomials[k].mul_add(number(path.im()[k] * self.slow.scale), im);
            }
            let phasor = self.phasor::<I>(path, x, sweep, &scratch.polynomials);
            let residual = product(phasor, [re, zero.sub(im)]);
            let inverse = inverse / self.slow.scale;
            let mut function = product(residual, [number(inverse.re), number(inverse.im)]);
            for j in 0..i {
                function = less_product::<T, I>(function, scratch.weights[j], own[j].re, own[j].im);
            }
            scratch.weights.push(function);
        }
        for i in (0..approximation.lower.len()).rev() {
            let weight = scratch.weights[i];
            for j in 0..i {
                let value = approximation.lower[i][j];
                scratch.weights[j] = less_product::<T, I>(scratch.weights[j], weight, value.re, value.im);
            }
        }
    }

    /// Cosine and sine of the residual phase of a path.
    #[cfg_attr(optimised, inline(always))]
    fn phasor<I: Isa>(&self, path: &Path, x: T::In<I>, sweep: T::In<I>, polynomials: &[T::In<I>]) -> Phasor<T::In<I>> {
        let number = wide::number::<T, I>;
        let mut delta = <T::In<I>>::splat(T::zero());
        for k in 0..path.bends().len() {
            delta = polynomials[k + 2].mul_add(number(path.bends()[k]), delta);
        }
        let (offset, rate, bend) = (path.offset, path.rate, self.job.block_plan.frame.bend);
        wide::cos_sin_of::<T, I>(turns(delta, number(offset), number(rate), x, sweep, number(bend)))
    }
}

/// Scratch memory of one chirp, beyond the registers.
struct Scratch<V> {
    polynomials: Vec<V>,
    /// Weights of the sums of the terms.
    weights: Vec<Phasor<V>>,
}

impl<V> Default for Scratch<V> {
    fn default() -> Self {
        Self {
            polynomials: Vec::new(),
            weights: Vec::new(),
        }
    }
}

/// Weighted sum of one channel's terms at the chirp before or after the middle, by `sign`.
#[cfg_attr(optimised, inline(always))]
fn weighted<T: Scalar, I: Isa>(sums: &[[T::In<I>; 4]], sign: f64, weights: &[Phasor<T::In<I>>]) -> Phasor<T::In<I>> {
    let zero = <T::In<I>>::splat(T::zero());
    let sign = <T::In<I>>::splat(T::of(sign));
    let mut total = [zero, zero];
    for term in 0..sums.len() {
        let ([p_re, p_im, q_im, q_re], [a, b]) = (sums[term], weights[term]);
        let (re, im) = (sign.neg_mul_add(q_im, p_re), sign.mul_add(q_re, p_im));
        total = [
            b.neg_mul_add(im, re.mul_add(a, total[0])),
            b.mul_add(re, im.mul_add(a, total[1])),
        ];
    }
    total
}

/// `a - b (re + j im)`
#[cfg_attr(optimised, inline(always))]
fn less_product<T: Scalar, I: Isa>(a: Phasor<T::In<I>>, b: Phasor<T::In<I>>, re: f64, im: f64) -> Phasor<T::In<I>> {
    let (re, im) = (wide::number::<T, I>(re), wide::number::<T, I>(im));
    [
        b[1].mul_add(im, b[0].neg_mul_add(re, a[0])),
        b[1].neg_mul_add(re, b[0].neg_mul_add(im, a[1])),
    ]
}

/// Phasors of 0, 1, 2, ... times some turns, as products of directly computed phasors.
#[cfg_attr(optimised, inline(always))]
fn powers<T: Scalar, I: Isa, const P: usize>(turns: Wide<I, P>) -> [Phasor<T::In<I>>; GROUP] {
    let mut powers = [[<T::In<I>>::splat(T::one()), <T::In<I>>::splat(T::zero())]; GROUP];
    let mut high = 1;
    while high < GROUP {
        powers[high] = wide::cos_sin::<T, I, P>(mul(turns, wide::splat::<I, P>(high as f64)));
        for low in 1..high {
            powers[high + low] = product(powers[high], powers[low]);
        }
        high *= 2;
    }
    powers
}

/// Polynomial of every number.
#[cfg_attr(optimised, inline(always))]
fn polynomial<V: Vector>(coefficients: &[V::Scalar], x: V) -> V {
    let mut value = V::splat(V::Scalar::default());
    for i in (0..coefficients.len()).rev() {
        value = value.mul_add(x, V::splat(coefficients[i]));
    }
    value
}

/// Product of two complex numbers.
#[cfg_attr(optimised, inline(always))]
fn product<V: Vector>(a: Phasor<V>, b: Phasor<V>) -> Phasor<V> {
    [
        a[1].neg_mul_add(b[1], a[0].mul(b[0])),
        a[1].mul_add(b[0], a[0].mul(b[1])),
    ]
}
