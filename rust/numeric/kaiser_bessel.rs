//! Kaiser-Bessel kernel, which spreads a point over `width` cells of a grid, and its Fourier transform.
//!
//! Kaiser-Bessel pair: `phi(x) = I0(beta sqrt(1 - (2x/w)^2)) / I0(beta)` for |x| <= w/2 cells, transform
//! `w sinh(r) / (r I0(beta))`, `r^2 = beta^2 - (pi w xi)^2`, with Beatty's beta (Beatty, Nishimura, Pauly, IEEE Trans.
//! Med. Imaging 24, 2005). With two cells per output every cell of width adds one decimal digit.

use std::f64::consts::PI;

use crate::numeric::chebyshev::{chebyshev_matrix, chebyshev_nodes};
use crate::numeric::simd::{Real, Vector};

const MAX_WIDTH: usize = 14;
const MAX_DEGREE: usize = degree(MAX_WIDTH);

/// Degree of the polynomials of one cell of the kernel: errors of tones do not exceed the errors of the kernel itself.
pub const fn degree(width: usize) -> usize {
    if width <= 4 { 4 } else { width - 1 }
}

/// Errors of a tone on a grid of one axis, relative to its amplitude, wherever it lies between two cells.
#[derive(Clone, Copy, Debug)]
pub struct ToneError {
    /// Root mean square over the outputs.
    pub rms: f64,
    /// Largest of all outputs.
    pub largest: f64,
    /// Largest alias of all outputs, a tone some periods of the grid away.
    pub alias: f64,
}

impl ToneError {
    /// Errors of a width on a grid with two cells per output; larger grids have less. Measured.
    pub fn new(width: usize) -> Self {
        let [rms, largest, alias] = match width {
            ..=4 => [6.0e-4, 1.4e-3, 6.8e-4],
            5..=6 => [7.0e-6, 2.0e-5, 1.12e-5],
            7..=8 => [9.5e-8, 2.9e-7, 1.7e-7],
            9..=10 => [9.0e-10, 3.1e-9, 2.45e-9],
            11..=12 => [1.0e-11, 3.8e-11, 3.1e-11],
            _ => [1.2e-13, 5.5e-13, 4.7e-13],
        };
        Self { rms, largest, alias }
    }
}

/// Kaiser-Bessel kernel.
#[derive(Clone, Copy, Debug)]
pub struct KaiserBessel {
    /// Width [cells], even.
    pub width: usize,
    beta: f64,
    norm: f64,
}

impl KaiserBessel {
    /// Kernel of a width for a ratio of the numbers of outputs and cells, at most one half.
    pub fn new(width: usize, ratio: f64) -> Self {
        let beta = PI * ((width as f64 * (1.0 - 0.5 * ratio)).powi(2) - 0.8).sqrt();
        Self {
            width,
            beta,
            norm: bessel_i0(beta),
        }
    }

    /// Value at a distance in cells.
    pub fn value(&self, x: f64) -> f64 {
        let root = 1.0 - (2.0 * x / self.width as f64).powi(2);
        bessel_i0(self.beta * root.max(0.0).sqrt()) / self.norm
    }

    /// Fourier transform at a frequency in cycles per cell.
    pub fn transform(&self, xi: f64) -> f64 {
        let square = self.beta.powi(2) - (PI * self.width as f64 * xi).powi(2);
        let r = square.abs().sqrt();
        let ratio = match r {
            0.0 => 1.0,
            _ if square > 0.0 => r.sinh() / r,
            _ => r.sin() / r,
        };
        self.width as f64 * ratio / self.norm
    }

    /// Polynomials of the cells.
    pub fn taps<T: Real>(&self) -> Taps<T> {
        let mut taps = [[T::zero(); MAX_DEGREE + 1]; MAX_WIDTH];
        let half = 0.5 * self.width as f64;
        for (cell, tap) in taps[..self.width].iter_mut().enumerate() {
            let value = |z: f64| self.value(cell as f64 + 0.5 * (1.0 + z) - half);
            for (number, coefficient) in tap.iter_mut().zip(monomials(degree(self.width), value)) {
                *number = T::of(coefficient);
            }
        }
        Taps(taps)
    }
}

/// Polynomials of the cells of a kernel in `z`, from -1 to 1: a point at `p` touches the cells from
/// `k = ceil(p - w/2)` on, and `z = 2 (k - (p - w/2)) - 1` is twice its offset between two cells. Coefficients of the
/// powers of z by cell; the kernel is even: `tap_(w-1-i)(z) = tap_i(-z)`.
#[derive(Clone, Debug)]
pub struct Taps<T>([[T; MAX_DEGREE + 1]; MAX_WIDTH]);

impl<T: Real> Taps<T> {
    /// Coefficient of a power of z of a cell; 0 for cells beyond the last.
    pub fn coefficient(&self, cell: usize, power: usize) -> T {
        self.0.get(cell).map_or(T::zero(), |tap| tap[power])
    }

    /// Values of the kernel at its `W` cells: even and odd powers serve two of them.
    #[cfg_attr(optimised, inline(always))]
    pub fn values<V: Vector<Scalar = T>, const W: usize>(&self, z: V) -> [V; W] {
        let square = z.mul(z);
        let mut values = [z; W];
        for i in 0..W / 2 {
            let tap = &self.0[i];
            let degree = degree(W);
            let mut even = V::splat(tap[degree & !1]);
            for n in (0..degree / 2).rev() {
                even = even.mul_add(square, V::splat(tap[2 * n]));
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

/// Coefficients of the powers of z of the polynomial through a function at Chebyshev points on -1 ..= 1.
pub fn monomials(degree: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
    let n = degree + 1;
    let values: Vec<f64> = chebyshev_nodes(n).into_iter().map(f).collect();
    // Chebyshev coefficients, then T_k by its recurrence in powers.
    let matrix = chebyshev_matrix(n);
    let (mut before, mut current) = (vec![0.0; n], vec![0.0; n]);
    current[0] = 1.0;
    let mut result = vec![0.0; n];
    for k in 0..n {
        let c: f64 = (0..n).map(|j| matrix[k * n + j] * values[j]).sum();
        for power in 0..n {
            result[power] += c * current[power];
        }
        let mut next = vec![0.0; n];
        for power in 0..n {
            let shifted = if power > 0 { current[power - 1] } else { 0.0 };
            next[power] = if k == 0 { shifted } else { 2.0 * shifted - before[power] };
        }
        before = std::mem::replace(&mut current, next);
    }
    result
}

/// Modified Bessel function of order zero, by its power series: all terms are positive.
fn bessel_i0(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..200 {
        term *= quarter / f64::from(k * k);
        sum += term;
        if term < 1e-17 * sum {
            break;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::numeric::simd::{Isa, Kernel, Level};

    const WIDTHS: [usize; 6] = [4, 6, 8, 10, 12, 14];

    #[test]
    fn transform_is_the_integral_of_the_kernel() {
        for width in WIDTHS {
            let kernel = KaiserBessel::new(width, 0.5);
            for xi in [0.0, 0.1, 0.25, 0.75] {
                let n = 200_000;
                let step = width as f64 / f64::from(n);
                let integral: f64 = (0..n)
                    .map(|i| {
                        let x = (f64::from(i) + 0.5) * step - 0.5 * width as f64;
                        step * kernel.value(x) * (2.0 * PI * xi * x).cos()
                    })
                    .sum();
                assert!((integral - kernel.transform(xi)).abs() < 1e-8, "{width} {xi}");
            }
        }
    }

    struct Values<'a, const W: usize>(&'a Taps<f64>, f64);

    impl<const W: usize> Kernel for Values<'_, W> {
        type Output = Vec<f64>;
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> Vec<f64> {
            let values = self.0.values::<I::F64, W>(I::F64::splat(self.1));
            (0..W).map(|i| values[i].first()).collect()
        }
    }

    fn values(width: usize, taps: &Taps<f64>, z: f64) -> Vec<f64> {
        let level = Level::best();
        match width {
            4 => level.run(Values::<4>(taps, z)),
            6 => level.run(Values::<6>(taps, z)),
            8 => level.run(Values::<8>(taps, z)),
            10 => level.run(Values::<10>(taps, z)),
            12 => level.run(Values::<12>(taps, z)),
            _ => level.run(Values::<14>(taps, z)),
        }
    }

    /// Largest errors of a tone, over its offsets between two cells: rms over the outputs, of any output, and the largest
    /// coefficient of its Fourier series over the offsets.
    fn tone_errors(width: usize, num_outputs: usize, num_cells: usize) -> [f64; 3] {
        let kernel = KaiserBessel::new(width, num_outputs as f64 / num_cells as f64);
        let taps = kernel.taps::<f64>();
        let (mut rms, mut largest) = (0.0_f64, 0.0_f64);
        let mut series = vec![[Complex64::ZERO; 4]; num_outputs];
        for step in 0..=64 {
            let offset = f64::from(step) / 64.0 - 0.5;
            let values = values(width, &taps, 2.0 * offset);
            let error = |output: usize| {
                let j = output as f64 - (num_outputs / 2) as f64;
                let turn = |cells: f64| Complex64::cis(2.0 * PI * j * cells / num_cells as f64);
                let sum: Complex64 = values
                    .iter()
                    .enumerate()
                    .map(|(i, value)| *value * turn(i as f64))
                    .sum();
                // The tone lies `offset` before the middle of the cells.
                let tone = turn(0.5 * (width as f64 - 1.0) - offset);
                (sum / kernel.transform(j / num_cells as f64) - tone) / tone
            };
            let errors: Vec<Complex64> = (0..num_outputs).map(error).collect();
            for (series, error) in series.iter_mut().zip(&errors).filter(|_| step > 0) {
                for (coefficient, period) in series.iter_mut().zip([-2.0, -1.0, 1.0, 2.0]) {
                    *coefficient += error * Complex64::cis(2.0 * PI * period * offset) / 64.0;
                }
            }
            let errors: Vec<f64> = errors.iter().map(|error| error.norm()).collect();
            let mean = errors.iter().map(|e| e * e).sum::<f64>() / num_outputs as f64;
            rms = rms.max(mean.sqrt());
            largest = errors.iter().copied().fold(largest, f64::max);
        }
        let alias = series.iter().flatten().map(|alias| alias.norm()).fold(0.0, f64::max);
        [rms, largest, alias]
    }

    #[test]
    fn errors_of_tones_are_the_known_ones() {
        for width in WIDTHS {
            let known = ToneError::new(width);
            for (num_outputs, num_cells) in [(128, 256), (100, 256), (1, 16), (2, 16), (16, 32), (33, 128)] {
                let errors = tone_errors(width, num_outputs, num_cells);
                for (error, known) in errors.into_iter().zip([known.rms, known.largest, known.alias]) {
                    let is_near = num_outputs != 128 || error >= 0.7 * known;
                    assert!(
                        error <= known && is_near,
                        "{width} {num_outputs} {num_cells} {errors:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn coefficients_are_those_of_the_values() {
        for width in WIDTHS {
            let taps = KaiserBessel::new(width, 0.4).taps::<f64>();
            for (cell, value) in values(width, &taps, 0.3).into_iter().enumerate() {
                let powers = (0..=degree(width)).rev();
                let sum = powers.fold(0.0, |sum, power| sum * 0.3 + taps.coefficient(cell, power));
                assert!((sum - value).abs() < 1e-14, "{width} {cell}");
            }
            assert_eq!(taps.coefficient(width, 0), 0.0);
        }
    }
}
