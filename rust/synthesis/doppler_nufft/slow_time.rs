//! Dense transform from velocity rows to chirps: pairs of rows and of chirps share cosines and sines.

use std::f64::consts::TAU;

use num_complex::Complex;

use super::grid::Layout;
use super::plan::{Axis, Expansion, FACTORIALS, fast_time, slow_times};
use super::spread::Widths;
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Level, Vector, interleave};
use crate::numeric::wide::{self, Wide, add, mul, mul_add, sub};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::Block;
use crate::synthesis::kaiser_bessel::monomials;

/// Degree of the polynomial of the square root of 1 / transform of the kernel.
const ROOT_DEGREE: usize = 11;

/// Pairs of rows from one directly computed phasor to the next.
const GROUP: usize = 16;

/// Transform over slow time, the same for all channels.
pub struct SlowTime<'a> {
    waveform: &'a Waveform,
    axis: &'a Axis,
    expansion: &'a Expansion,
    layout: Layout,
    /// Coefficients of the square root of 1 / transform of the kernel in powers of (4 xi)^2, for a frequency xi of at
    /// most a quarter of a turn per row: the root keeps digits where it is small.
    inverse_root: Vec<f64>,
    /// Pairs of chirps at equal times before and after the centre of the frame [s]; a chirp without partner stands alone.
    chirps: Vec<(f64, [Option<usize>; 2])>,
}

impl<'a> SlowTime<'a> {
    /// Transform of the spectra of grids of a layout.
    pub fn new(
        waveform: &'a Waveform,
        block: &Block,
        (axis, expansion): &'a (Axis, Expansion),
        layout: Layout,
    ) -> Self {
        let kernel = layout.velocity_kernel();
        // The nearest pole lies at (4 xi)^2 > 8: every power adds 1.5 digits.
        let in_z = monomials(ROOT_DEGREE, |z| {
            kernel.transform(0.25 * (0.5 * (z + 1.0)).sqrt()).recip().sqrt()
        });
        // z = 2 s - 1, by Horner's rule on polynomials.
        let mut inverse_root = vec![0.0; in_z.len()];
        for coefficient in in_z.iter().rev() {
            let mut next = vec![0.0; in_z.len()];
            for (power, value) in inverse_root.iter().enumerate() {
                next[power] -= value;
                if power + 1 < next.len() {
                    next[power + 1] += 2.0 * value;
                }
            }
            next[0] += coefficient;
            inverse_root = next;
        }

        // Chirps by distance from the centre; equal distances on both sides share their cosines and sines.
        let mut times: Vec<(f64, usize)> = slow_times(waveform, block).zip(0..).collect();
        times.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let mut chirps: Vec<(f64, [Option<usize>; 2])> = Vec::new();
        for (time, chirp) in times {
            match chirps.last_mut() {
                // Differences by rounding of absolute times do not count.
                Some((at, [Some(_), after @ None])) if (time + *at).abs() <= 1e-12 * block.half => *after = Some(chirp),
                _ => chirps.push((time, [Some(chirp), None])),
            }
        }
        Self {
            waveform,
            axis,
            expansion,
            layout,
            inverse_root,
            chirps,
        }
    }

    /// Add the samples `(chirp, sample)` of some channels, from their spectra `(term, row, part, sample)`.
    pub fn add<T: Widths>(
        &self,
        level: Level,
        is_parallel: bool,
        spectra: &[Vec<T>],
        samples: &mut [&mut [Complex<T>]],
    ) {
        let (num_samples, num_chirps) = (self.waveform.num_samples, self.waveform.chirp_times.len());
        let tiles: Vec<usize> = (0..num_samples).step_by(T::LANES).collect();
        let tiles = parallel::map(is_parallel, tiles, |first| {
            let slow = self;
            (first, level.run(Tile { slow, spectra, first }))
        });
        for (first, tile) in tiles {
            let len = T::LANES.min(num_samples - first);
            for (row, values) in tile.chunks_exact(2 * T::LANES).enumerate() {
                let (channel, chirp) = (row / num_chirps, row % num_chirps);
                let samples = &mut samples[channel][chirp * num_samples + first..][..len];
                for (sample, [re, im]) in samples.iter_mut().zip(values.as_chunks().0) {
                    *sample = *sample + Complex::new(*re, *im);
                }
            }
        }
    }
}

/// Consecutive samples of all chirps, as many as a vector has lanes.
struct Tile<'a, T> {
    slow: &'a SlowTime<'a>,
    spectra: &'a [Vec<T>],
    first: usize,
}

/// Cosine and sine.
type Phasor<V> = [V; 2];

impl<T: Widths> Kernel for Tile<'_, T> {
    type Output = Vec<T>;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
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

impl<T: Widths> Tile<'_, T> {
    /// All chirps at `8 P` samples, (channel, chirp, lane, [re, im]).
    #[cfg_attr(optimised, inline(always))]
    fn tile<I: Isa, const P: usize>(self) -> Vec<T> {
        let slow = self.slow;
        let num_terms = slow.expansion.powers.len();
        let num_sums = self.spectra.len() * num_terms;
        let mut time = [0.0; 16];
        for i in 0..16 {
            time[i] = fast_time(slow.waveform, self.first + i);
        }
        let time = wide::load::<I, P>(&time);
        let splat = wide::splat::<I, P>;
        let fast = Fast::<I, P> {
            time,
            frequency: mul_add(time, splat(slow.waveform.slope), splat(slow.axis.carrier)),
        };

        let sums = self.even_and_odd::<I, P>(&fast);
        let zero = <T::In<I>>::splat(T::zero());
        let num_numbers = slow.waveform.chirp_times.len() * 2 * T::LANES;
        let mut out = vec![T::zero(); self.spectra.len() * num_numbers];
        let mut transformed = vec![[zero; 4]; 2 * num_sums];
        let mut factors = vec![[zero; 2]; num_terms];
        for chirps in slow.chirps.chunks(2) {
            let turns = slow.axis.step;
            if let [(one, _), (two, _)] = chirps {
                self.transform::<I, P, 2>(&fast, [turns * one, turns * two], &sums, &mut transformed);
            } else {
                self.transform::<I, P, 1>(&fast, [turns * chirps[0].0], &sums, &mut transformed);
            }
            for i in 0..chirps.len() {
                let (time, pair) = chirps[i];
                for side in 0..2 {
                    let Some(chirp) = pair[side] else {
                        continue;
                    };
                    let sign = if side == 0 { 1.0 } else { -1.0 };
                    self.factors::<I, P>(sign * time, &fast, &mut factors);
                    for channel in 0..self.spectra.len() {
                        let transformed = &transformed[i * num_sums + channel * num_terms..][..num_terms];
                        let samples = &mut out[channel * num_numbers + chirp * 2 * T::LANES..][..2 * T::LANES];
                        let [re, im] = weighted::<T, I>(transformed, sign, &factors);
                        wide::store(interleave(re, im), samples);
                    }
                }
            }
        }
        out
    }

    /// Sums and differences of the rows of every pair at equal distances from the middle of the axis,
    /// (group, sum, pair, [sum re, im, difference re, im]).
    #[cfg_attr(optimised, inline(always))]
    fn even_and_odd<I: Isa, const P: usize>(&self, fast: &Fast<I, P>) -> Vec<[T::In<I>; 4]> {
        let slow = self.slow;
        let num_terms = slow.expansion.powers.len();
        let num_sums = self.spectra.len() * num_terms;
        let (rows, padded) = (slow.layout.rows, slow.layout.padded());
        let zero = <T::In<I>>::splat(T::zero());
        let half = rows / 2;
        let mut sums = vec![[zero; 4]; half.div_ceil(GROUP) * num_sums * GROUP];
        let square = mul(
            mul(fast.time, fast.time),
            wide::splat::<I, P>(slow.waveform.slope * slow.axis.step),
        );
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
                sums[(pair / GROUP * num_sums + index) * GROUP + pair % GROUP] =
                    [a_re.add(b_re), a_im.add(b_im), a_re.sub(b_re), a_im.sub(b_im)];
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
        let num_sums = self.spectra.len() * self.slow.expansion.powers.len();
        let half = self.slow.layout.rows / 2;
        let zero = <T::In<I>>::splat(T::zero());
        transformed.fill([zero; 4]);
        // Phasors (k + 1/2) steps from the middle, as products of two: within a group, and to its first pair.
        let mut turns = [fast.frequency; N];
        let mut fine = [[[zero; 2]; GROUP]; N];
        for i in 0..N {
            turns[i] = mul(turns[i], wide::splat::<I, P>(step[i]));
            fine[i] = powers::<T, I, P>(turns[i], half.min(GROUP));
        }
        let mut phasors = [[[zero; 2]; N]; GROUP];
        for first in (0..half).step_by(GROUP) {
            let len = GROUP.min(half - first);
            for i in 0..N {
                let middle = wide::splat::<I, P>(first as f64 + 0.5);
                let coarse = wide::cos_sin::<T, I, P>(mul(turns[i], middle));
                for p in 0..len {
                    phasors[p][i] = product(coarse, fine[i][p]);
                }
            }
            for index in 0..num_sums {
                let sums = &sums[first * num_sums + index * GROUP..][..GROUP];
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

    /// Factors of all terms for one chirp: phase of the middle rate and of the middle residual, one over the transform
    /// of the kernel, powers of the expansion. The same for all channels.
    #[cfg_attr(optimised, inline(always))]
    fn factors<I: Isa, const P: usize>(&self, time: f64, fast: &Fast<I, P>, factors: &mut [Phasor<T::In<I>>]) {
        let (axis, expansion) = (self.slow.axis, self.slow.expansion);
        let splat = wide::splat::<I, P>;
        let square = mul(mul(fast.time, fast.time), splat(self.slow.waveform.slope));
        let keystone = mul_add(fast.frequency, splat(time), square);
        let angle = wide::narrow::<T, I, P>(mul(keystone, splat(4.0 * axis.step)));
        let angle = angle.mul(angle);
        let mut root = <T::In<I>>::splat(T::zero());
        for i in (0..self.slow.inverse_root.len()).rev() {
            root = root.mul_add(angle, wide::number::<T, I>(self.slow.inverse_root[i]));
        }
        let weight = root.mul(root);

        let x = mul(add(fast.time, splat(time)), splat(axis.half.recip()));
        let skewed = mul(mul(x, fast.time), splat(axis.stretch));
        let bent = sub(mul(x, x), splat(expansion.mean_square));
        let mut phase = mul(keystone, splat(axis.middle_rate));
        phase = mul_add(skewed, splat(expansion.skew[0]), phase);
        phase = mul_add(bent, splat(expansion.square[0]), phase);
        let [cos, sin] = wide::cos_sin::<T, I, P>(phase);
        let phasor = [cos.mul(weight), sin.mul(weight)];

        let variables = [
            wide::narrow::<T, I, P>(mul(skewed, splat(TAU * expansion.skew[1]))),
            wide::narrow::<T, I, P>(mul(bent, splat(TAU * expansion.square[1]))),
        ];
        for term in 0..factors.len() {
            // (j v)^n / n!
            let [mut re, mut im] = phasor;
            for i in 0..2 {
                let power = expansion.powers[term][i];
                for _ in 0..power {
                    (re, im) = (
                        <T::In<I>>::splat(T::zero()).sub(im.mul(variables[i])),
                        re.mul(variables[i]),
                    );
                }
                let inverse = wide::number::<T, I>(FACTORIALS[power].recip());
                (re, im) = (re.mul(inverse), im.mul(inverse));
            }
            factors[term] = [re, im];
        }
    }
}

/// Weighted sum of one channel's terms at the chirp before or after the middle, by `sign`.
#[cfg_attr(optimised, inline(always))]
fn weighted<T: Widths, I: Isa>(sums: &[[T::In<I>; 4]], sign: f64, factors: &[Phasor<T::In<I>>]) -> Phasor<T::In<I>> {
    let zero = <T::In<I>>::splat(T::zero());
    let sign = wide::number::<T, I>(sign);
    let mut total = [zero, zero];
    for term in 0..sums.len() {
        let ([p_re, p_im, q_im, q_re], [a, b]) = (sums[term], factors[term]);
        let (re, im) = (sign.neg_mul_add(q_im, p_re), sign.mul_add(q_re, p_im));
        total = [
            b.neg_mul_add(im, re.mul_add(a, total[0])),
            b.mul_add(re, im.mul_add(a, total[1])),
        ];
    }
    total
}

/// Phasors of 0, 1, 2, ... times some turns, at least `len` of them, as products of directly computed phasors.
#[cfg_attr(optimised, inline(always))]
fn powers<T: Widths, I: Isa, const P: usize>(turns: Wide<I, P>, len: usize) -> [Phasor<T::In<I>>; GROUP] {
    let mut powers = [[<T::In<I>>::splat(T::one()), <T::In<I>>::splat(T::zero())]; GROUP];
    let mut high = 1;
    while high < len {
        powers[high] = wide::cos_sin::<T, I, P>(mul(turns, wide::splat::<I, P>(high as f64)));
        for low in 1..high {
            powers[high + low] = product(powers[high], powers[low]);
        }
        high *= 2;
    }
    powers
}

/// Product of two complex numbers.
#[cfg_attr(optimised, inline(always))]
fn product<V: Vector>(a: Phasor<V>, b: Phasor<V>) -> Phasor<V> {
    [
        a[1].neg_mul_add(b[1], a[0].mul(b[0])),
        a[1].mul_add(b[0], a[0].mul(b[1])),
    ]
}
