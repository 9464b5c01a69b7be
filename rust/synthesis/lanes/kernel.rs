//! Spreading kernel of 4 to 7 cells: polynomials of its cells, and one over its transform.

use std::f64::consts::PI;

use crate::numeric::simd::Vector;
use crate::synthesis::nufft::kernel::{KaiserBessel, monomials, with_coherence};

/// Widths of the kernel [cells].
pub const WIDTHS: [usize; 4] = [4, 5, 6, 7];

/// Largest error of a tone between two cells, rms over the samples, for every one of [`WIDTHS`] on a grid of twice as
/// many cells as samples; larger grids have less.
const ERRORS: [f64; 4] = [6.2e-4, 8.2e-5, 8.4e-6, 9.0e-7];

/// Largest error of a tone in any sample, likewise; the first is the worst.
const LARGEST: [f64; 4] = [2.0e-3, 1.6e-4, 1.9e-5, 2.0e-6];

/// Error of a tone in chirps of one sample.
const OF_ONE: [f64; 4] = [9.0e-5, 4.0e-6, 7.0e-8, 6.0e-8];

/// Width of the widest kernel [cells].
const MAX_WIDTH: usize = WIDTHS[WIDTHS.len() - 1];

/// Degree of the polynomials: their error is a tenth of the kernel's.
const fn degree(width: usize) -> usize {
    match width {
        ..=4 => 4,
        5..=6 => 5,
        _ => 7,
    }
}

/// Spreading kernel of a width, and the factors that undo it.
#[derive(Clone, Debug)]
pub struct Spreading {
    /// Width [cells].
    pub width: usize,
    /// Coefficients of the powers of `z`, twice the offset of the middle of the cells, of cell 0 and those after it up
    /// to the middle one.
    taps: [[f32; degree(MAX_WIDTH) + 1]; MAX_WIDTH.div_ceil(2)],
    /// One over the transform of the kernel, by sample.
    pub factors: Vec<f64>,
}

impl Spreading {
    /// Kernel of a width for tones of `num_samples` on a grid of `num_cells`.
    pub fn new(width: usize, num_samples: usize, num_cells: usize) -> Self {
        let (w, ratio) = (width as f64, num_samples as f64 / num_cells as f64);
        let kernel = Self::kernel(width, ratio);
        let mut taps = [[0.0; degree(MAX_WIDTH) + 1]; MAX_WIDTH.div_ceil(2)];
        for (i, tap) in taps[..width.div_ceil(2)].iter_mut().enumerate() {
            let value = |z: f64| kernel.value(i as f64 + 0.5 * (1.0 + z - w));
            for (number, coefficient) in tap.iter_mut().zip(monomials(degree(width), value)) {
                *number = coefficient as f32;
            }
        }
        let place = |sample: usize| sample as f64 - (num_samples / 2) as f64;
        let factor = |sample: usize| kernel.transform(place(sample) / num_cells as f64).recip();
        Self {
            width,
            taps,
            factors: (0..num_samples).map(factor).collect(),
        }
    }

    /// Kaiser-Bessel kernel for a ratio of the numbers of samples and cells.
    fn kernel(width: usize, ratio: f64) -> KaiserBessel {
        // Barnett, Magland, af Klinteberg, "A parallel nonuniform fast Fourier transform library", eq. (4.1); the factor
        // is the best for few cells.
        KaiserBessel::with_beta(width, 0.975 * PI * width as f64 * (1.0 - 0.5 * ratio))
    }

    /// Bound of the error of a sum of tones, rms over the samples, relative to the l2 norm of their amplitudes, for tones
    /// that may add up by some [coherence](crate::synthesis::coherence); none for a width that there is not.
    pub fn error(width: usize, num_samples: usize, coherence: f64) -> Option<f64> {
        let at = WIDTHS.iter().position(|known| *known == width)?;
        Some(if num_samples == 1 {
            with_coherence(OF_ONE[at], OF_ONE[at], coherence)
        } else {
            with_coherence(ERRORS[at], LARGEST[at], coherence)
        })
    }

    /// Values of the kernel at its cells: `tap_(w-1-i)(z) = tap_i(-z)`, so even and odd powers serve two.
    #[cfg_attr(optimised, inline(always))]
    pub fn values<V: Vector<Scalar = f32>, const W: usize>(&self, z: V) -> [V; W] {
        let square = z.mul(z);
        let mut values = [z; W];
        for i in 0..W.div_ceil(2) {
            let tap = &self.taps[i];
            let degree = degree(W);
            let mut even = V::splat(tap[degree & !1]);
            for n in (0..degree / 2).rev() {
                even = even.mul_add(square, V::splat(tap[2 * n]));
            }
            if 2 * i + 1 == W {
                values[i] = even;
                continue;
            }
            let mut odd = V::splat(tap[(degree - 1) | 1]);
            for n in (0..degree.div_ceil(2) - 1).rev() {
                odd = odd.mul_add(square, V::splat(tap[2 * n + 1]));
            }
            values[i] = odd.mul_add(z, even);
            values[W - 1 - i] = odd.neg_mul_add(z, even);
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::numeric::simd::{Isa, Kernel, Level};

    /// Values of the kernel of a width at one offset.
    struct Values<'a, const W: usize>(&'a Spreading, f32);

    impl<const W: usize> Kernel for Values<'_, W> {
        type Output = Vec<f64>;
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> Vec<f64> {
            let mut values = Vec::new();
            for tap in self.0.values::<I::F32, W>(I::F32::splat(self.1)) {
                let mut lanes = [0.0; 16];
                tap.store(&mut lanes);
                values.push(f64::from(lanes[5]));
            }
            values
        }
    }

    #[test]
    fn errors_of_tones_are_the_known_ones() {
        for (num_samples, num_cells) in [(128, 256), (100, 256), (1, 16), (2, 16), (33, 128)] {
            for (at, width) in WIDTHS.into_iter().enumerate() {
                let (known, known_largest) = match num_samples {
                    1 => (OF_ONE[at], OF_ONE[at]),
                    _ => (ERRORS[at], LARGEST[at]),
                };
                let spreading = Spreading::new(width, num_samples, num_cells);
                let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
                for step in 0..=64 {
                    let offset = f64::from(step) / 64.0 - 0.5;
                    let z = 2.0 * offset as f32;
                    let best = Level::best();
                    let values = match width {
                        4 => best.run(Values::<4>(&spreading, z)),
                        5 => best.run(Values::<5>(&spreading, z)),
                        6 => best.run(Values::<6>(&spreading, z)),
                        _ => best.run(Values::<7>(&spreading, z)),
                    };
                    let square = |sample: usize| {
                        let j = sample as f64 - (num_samples / 2) as f64;
                        let turn = |cells: f64| Complex64::cis(2.0 * PI * j * cells / num_cells as f64);
                        let cells = values.iter().enumerate();
                        let sum: Complex64 = cells.map(|(i, value)| *value * turn(i as f64)).sum();
                        // The tone lies `offset` before the middle of the cells.
                        let tone = turn(0.5 * (width as f64 - 1.0) - offset);
                        (sum * spreading.factors[sample] - tone).norm_sqr()
                    };
                    let mean = (0..num_samples).map(square).sum::<f64>() / num_samples as f64;
                    worst = worst.max(mean.sqrt());
                    largest = (0..num_samples).map(square).fold(largest * largest, f64::max).sqrt();
                }
                assert!(worst <= known, "{num_samples} {num_cells} {width}: {worst:e}");
                assert!(
                    largest <= known_largest,
                    "{num_samples} {num_cells} {width}: {largest:e}"
                );
                if 2 * num_samples == num_cells {
                    assert!(worst >= 0.6 * known, "{width}: {worst:e}");
                    assert!(largest >= 0.6 * known_largest, "{width}: {largest:e}");
                }
            }
        }
    }
}
