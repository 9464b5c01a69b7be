//! Dense transform from velocity rows to chirps: pairs of rows and of chirps share cosines and sines.

use std::f64::consts::TAU;

use num_complex::Complex;

use super::grid::{Layout, VECTOR};
use super::plan::{Moving, fast_time, slow_times};
use crate::numeric::kaiser_bessel::monomials;
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Level, Precision, Vector};
use crate::numeric::wide::{self, Wide, add, mul, mul_add, product, sub};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::Block;

/// Degree of the polynomial of the square root of 1 / transform of the kernel.
const ROOT_DEGREE: usize = 11;

/// Pairs of rows from one directly computed phasor to the next.
const GROUP: usize = 16;

/// Transform over slow time, the same for all channels.
pub struct SlowTime<'a> {
    waveform: &'a Waveform,
    moving: &'a Moving,
    layout: Layout,
    /// Coefficients of the square root of 1 / transform of the kernel in powers of 2 (4 xi)^2 - 1, for a frequency xi of
    /// at most a quarter of a turn per row: the root keeps digits where it is small.
    inverse_root: Vec<f64>,
    /// Times from the centre of the frame [s], each with the chirp at this time and, if there is one, the chirp at its
    /// negative: their signs.
    chirps: Vec<(f64, Vec<(usize, f64)>)>,
}

impl<'a> SlowTime<'a> {
    /// Transform of the spectra of grids of a layout.
    pub fn new(waveform: &'a Waveform, block: &Block, moving: &'a Moving, layout: Layout) -> Self {
        let kernel = layout.velocity_kernel();
        // The nearest pole lies at (4 xi)^2 > 8: every power adds 1.5 digits.
        let root = |z: f64| kernel.transform(0.25 * (0.5 * (z + 1.0)).sqrt()).recip().sqrt();

        // Chirps by distance from the centre; equal distances on both sides share their cosines and sines.
        let mut times: Vec<(f64, usize)> = slow_times(waveform, block).zip(0..).collect();
        times.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let mut chirps: Vec<(f64, Vec<(usize, f64)>)> = Vec::new();
        for (time, chirp) in times {
            match chirps.last_mut() {
                // Differences by rounding of absolute times do not count.
                Some((at, pair)) if pair.len() == 1 && (time + *at).abs() <= 1e-12 * block.half => {
                    pair.push((chirp, -1.0));
                }
                _ => chirps.push((time, vec![(chirp, 1.0)])),
            }
        }
        Self {
            waveform,
            moving,
            layout,
            inverse_root: monomials(ROOT_DEGREE, root),
            chirps,
        }
    }

    /// Add the samples `(chirp, sample)` of some channels, from their spectra `(term, row, part, sample)`.
    pub fn add<T: Precision>(
        &self,
        level: Level,
        is_parallel: bool,
        spectra: &[Vec<T>],
        samples: &mut [&mut [Complex<T>]],
    ) {
        let (num_samples, num_chirps) = (self.waveform.num_samples, self.waveform.chirp_times.len());
        let lanes = VECTOR / size_of::<T>();
        let tiles: Vec<usize> = (0..num_samples).step_by(lanes).collect();
        let tiles = parallel::map(is_parallel, tiles, |first| {
            let slow = self;
            (first, level.run(Tile { slow, spectra, first }))
        });
        for (first, tile) in tiles {
            let len = lanes.min(num_samples - first);
            for (row, values) in tile.chunks_exact(2 * lanes).enumerate() {
                let (channel, chirp) = (row / num_chirps, row % num_chirps);
                let samples = &mut samples[channel][chirp * num_samples + first..][..len];
                for (sample, [re, im]) in samples.iter_mut().zip(values.as_chunks().0) {
                    *sample = *sample + Complex::new(*re, *im);
                }
            }
        }
    }
}

/// Consecutive samples of all chirps, one per lane of a vector.
struct Tile<'a, T> {
    slow: &'a SlowTime<'a>,
    spectra: &'a [Vec<T>],
    first: usize,
}

impl<T: Precision> Kernel for Tile<'_, T> {
    type Output = Vec<T>;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> Vec<T> {
        if <T::In<I>>::LANES == 16 {
            self.tile::<I, 2>()
        } else {
            self.tile::<I, 1>()
        }
    }
}

impl<T: Precision> Tile<'_, T> {
    /// All chirps at `8 P` samples, (channel, chirp, lane, [re, im]).
    #[cfg_attr(optimised, inline(always))]
    fn tile<I: Isa, const P: usize>(self) -> Vec<T> {
        let slow = self.slow;
        let num_terms = slow.moving.num_terms;
        let mut time = [0.0; 16];
        for i in 0..16 {
            time[i] = fast_time(slow.waveform, self.first + i);
        }
        let time = wide::load::<I, P>(&time);
        let slope = wide::splat::<I, P>(slow.waveform.slope);
        // Fast time about the middle sample, the frequency that a rate sees then, and the constant part of its phase.
        let fast = [
            time,
            mul_add(time, slope, wide::splat::<I, P>(slow.moving.carrier)),
            mul(mul(time, time), slope),
        ];

        let sums = self.even_and_odd::<I, P>(&fast);
        let zero = <T::In<I>>::splat(T::zero());
        let num_numbers = slow.waveform.chirp_times.len() * 2 * <T::In<I>>::LANES;
        let mut out = vec![T::zero(); self.spectra.len() * num_numbers];
        let mut transformed = vec![[[zero; 4]; 2]; self.spectra.len() * num_terms];
        let mut factors = vec![[zero; 2]; num_terms];
        for pairs in slow.chirps.chunks(2) {
            let times = [pairs[0].0, pairs[pairs.len() - 1].0];
            self.transform::<I, P>(&fast, times, &sums, &mut transformed);
            for i in 0..pairs.len() {
                let (time, chirps) = &pairs[i];
                for &(chirp, sign) in chirps {
                    self.factors::<I, P>(sign * time, &fast, &mut factors);
                    let sign = wide::number::<T, I>(sign);
                    for channel in 0..self.spectra.len() {
                        let mut total = [zero; 2];
                        for term in 0..num_terms {
                            let [p_re, p_im, q_im, q_re] = transformed[channel * num_terms + term][i];
                            let sum = [sign.neg_mul_add(q_im, p_re), sign.mul_add(q_re, p_im)];
                            let [re, im] = product(sum, factors[term]);
                            total = [total[0].add(re), total[1].add(im)];
                        }
                        let at = channel * num_numbers + chirp * 2 * <T::In<I>>::LANES;
                        wide::store(total[0].interleave(total[1]), &mut out[at..]);
                    }
                }
            }
        }
        out
    }

    /// Sums and differences of the rows of every pair at equal distances from the middle of the axis,
    /// (group, sum), (pair, [sum re, im, difference re, im]).
    #[cfg_attr(optimised, inline(always))]
    fn even_and_odd<I: Isa, const P: usize>(&self, fast: &[Wide<I, P>; 3]) -> Vec<[[T::In<I>; 4]; GROUP]> {
        let slow = self.slow;
        let num_terms = slow.moving.num_terms;
        let num_sums = self.spectra.len() * num_terms;
        let (rows, padded) = (slow.layout.rows, slow.layout.padded());
        let zero = <T::In<I>>::splat(T::zero());
        let half = rows / 2;
        let mut sums = vec![[[zero; 4]; GROUP]; half.div_ceil(GROUP) * num_sums];
        let square = mul(fast[2], wide::splat::<I, P>(slow.moving.step));
        for pair in 0..half {
            let [cos, sin] = wide::cos_sin::<T, I, P>(mul(square, wide::splat::<I, P>(pair as f64 + 0.5)));
            for index in 0..num_sums {
                let (spectra, term) = (&self.spectra[index / num_terms], index % num_terms);
                let at = [half + pair, half - 1 - pair].map(|row| (term * rows + row) * 2 * padded + self.first);
                let (above, below) = (&spectra[at[0]..], &spectra[at[1]..]);
                let above = [<T::In<I>>::load(above), <T::In<I>>::load(&above[padded..])];
                let below = [<T::In<I>>::load(below), <T::In<I>>::load(&below[padded..])];
                let [a_re, a_im] = product(above, [cos, sin]);
                let [b_re, b_im] = product(below, [cos, zero.sub(sin)]);
                sums[pair / GROUP * num_sums + index][pair % GROUP] =
                    [a_re.add(b_re), a_im.add(b_im), a_re.sub(b_re), a_im.sub(b_im)];
            }
        }
        sums
    }

    /// Sums over all pairs of rows for two chirps at some times, (sum, chirp): real and imaginary part of the even sum, and
    /// of the odd sum turned by a quarter, imaginary first.
    #[cfg_attr(optimised, inline(always))]
    fn transform<I: Isa, const P: usize>(
        &self,
        fast: &[Wide<I, P>; 3],
        times: [f64; 2],
        sums: &[[[T::In<I>; 4]; GROUP]],
        transformed: &mut [[[T::In<I>; 4]; 2]],
    ) {
        let half = self.slow.layout.rows / 2;
        let zero = <T::In<I>>::splat(T::zero());
        transformed.fill([[zero; 4]; 2]);
        // Phasors (k + 1/2) steps from the middle, as products of two: within a group, and to its first pair.
        let mut turns = [fast[1]; 2];
        let mut fine = [[[zero; 2]; GROUP]; 2];
        for i in 0..2 {
            turns[i] = mul(fast[1], wide::splat::<I, P>(self.slow.moving.step * times[i]));
            fine[i] = powers::<T, I, P>(turns[i], half.min(GROUP));
        }
        let mut phasors = [[[zero; 2]; 2]; GROUP];
        for first in (0..half).step_by(GROUP) {
            let len = GROUP.min(half - first);
            for i in 0..2 {
                let middle = wide::splat::<I, P>(first as f64 + 0.5);
                let coarse = wide::cos_sin::<T, I, P>(mul(turns[i], middle));
                for p in 0..len {
                    phasors[p][i] = product(coarse, fine[i][p]);
                }
            }
            for index in 0..transformed.len() {
                let sums = &sums[first / GROUP * transformed.len() + index];
                let mut acc = transformed[index];
                for p in 0..len {
                    let [e_re, e_im, o_re, o_im] = sums[p];
                    for i in 0..2 {
                        let [cos, sin] = phasors[p][i];
                        acc[i] = [
                            e_re.mul_add(cos, acc[i][0]),
                            e_im.mul_add(cos, acc[i][1]),
                            o_im.mul_add(sin, acc[i][2]),
                            o_re.mul_add(sin, acc[i][3]),
                        ];
                    }
                }
                transformed[index] = acc;
            }
        }
    }

    /// Factors of all terms for one chirp: phase of the middle rate and of the middle residual, one over the transform
    /// of the kernel, powers of the expansion. The same for all channels.
    #[cfg_attr(optimised, inline(always))]
    fn factors<I: Isa, const P: usize>(&self, time: f64, fast: &[Wide<I, P>; 3], factors: &mut [[T::In<I>; 2]]) {
        let moving = self.slow.moving;
        let splat = wide::splat::<I, P>;
        let keystone = mul_add(fast[1], splat(time), fast[2]);
        let angle = wide::narrow::<T, I, P>(mul(keystone, splat(4.0 * moving.step)));
        let number = wide::number::<T, I>;
        let z = angle.mul(angle).mul_add(number(2.0), number(-1.0));
        let mut root = number(0.0);
        for coefficient in self.slow.inverse_root.iter().rev() {
            root = root.mul_add(z, number(*coefficient));
        }
        let weight = root.mul(root);

        let x = mul(add(fast[0], splat(time)), splat(moving.half.recip()));
        let skewed = mul(mul(x, fast[0]), splat(moving.stretch));
        let bent = sub(mul(x, x), splat(moving.mean_square));
        let phase = mul_add(
            bent,
            splat(moving.middle_square),
            mul(keystone, splat(moving.middle_rate)),
        );
        let [cos, sin] = wide::cos_sin::<T, I, P>(phase);
        let first = [cos.mul(weight), sin.mul(weight)];

        // Products of powers of j p and j q, over the factorials.
        let p = wide::narrow::<T, I, P>(mul(skewed, splat(TAU)));
        let q = wide::narrow::<T, I, P>(mul(bent, splat(TAU)));
        let (zero, half) = (number(0.0), number(-0.5));
        let powers = [
            [number(1.0), zero],
            [zero, p],
            [zero, q],
            [p.mul(p).mul(half), zero],
            [p.mul(q).mul(number(-1.0)), zero],
            [q.mul(q).mul(half), zero],
        ];
        for term in 0..factors.len().min(powers.len()) {
            factors[term] = product(first, powers[term]);
        }
    }
}

/// Phasors of 0, 1, 2, ... times some turns, `len` of them: of powers of two, and their products.
#[cfg_attr(optimised, inline(always))]
fn powers<T: Precision, I: Isa, const P: usize>(turns: Wide<I, P>, len: usize) -> [[T::In<I>; 2]; GROUP] {
    let mut powers = [[<T::In<I>>::splat(T::one()), <T::In<I>>::splat(T::zero())]; GROUP];
    for k in 1..len {
        let low = k & k.wrapping_neg();
        powers[k] = if k == low {
            wide::cos_sin::<T, I, P>(mul(turns, wide::splat::<I, P>(k as f64)))
        } else {
            product(powers[k - low], powers[low])
        };
    }
    powers
}
