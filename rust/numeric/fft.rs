//! Inverse FFT of a power of two of many grids at once, not scaled: one grid per lane of a vector.
//!
//! Stockham's passes of four cells (van Loan, Computational Frameworks for the Fast Fourier Transform, section 1.7),
//! and one of two cells where the number of cells is no power of four. A cell has the real parts of all lanes, then
//! their imaginary parts. As grids have two cells per output, only the first and the last quarter of the
//! result are formed.

use std::f64::consts::TAU;

use crate::numeric::simd::{Real, Vector};

/// Number of cells of a grid for some outputs: a power of two, at least twice the outputs, and at least 16, as
/// transforms consist of passes of four.
pub fn num_cells(num_outputs: usize) -> usize {
    (2 * num_outputs).next_power_of_two().max(16)
}

/// Factors of all passes but the last, in their order: per butterfly of its outputs except the first.
pub fn twiddles<T: Real>(num_cells: usize) -> Vec<T> {
    let mut factors = Vec::new();
    let mut put = |turns: f64| factors.extend([T::of((TAU * turns).cos()), T::of((TAU * turns).sin())]);
    let mut size = num_cells;
    if !num_cells.trailing_zeros().is_multiple_of(2) {
        for p in 0..size / 2 {
            put(p as f64 / size as f64);
        }
        size /= 2;
    }
    while size > 4 {
        for p in 0..size / 4 {
            for output in 1..4 {
                put((output * p) as f64 / size as f64);
            }
        }
        size /= 4;
    }
    factors
}

/// Transform of a grid of `num_cells` cells, see [the module](self): `twiddles` belong to the number of cells,
/// `scratch` has the size of the grid; the result is in one of the two.
#[cfg_attr(optimised, inline(always))]
pub fn inverse<'a, V: Vector>(
    grid: &'a mut [V::Scalar],
    scratch: &'a mut [V::Scalar],
    num_cells: usize,
    twiddles: &[V::Scalar],
) -> &'a [V::Scalar] {
    let (mut from, mut to) = (
        &mut grid[..num_cells * 2 * V::LANES],
        &mut scratch[..num_cells * 2 * V::LANES],
    );
    let (mut size, mut step, mut factors) = (num_cells, 1, twiddles);
    if !num_cells.trailing_zeros().is_multiple_of(2) {
        let (own, rest) = factors.split_at(num_cells);
        pass_of_two::<V>(from, to, own);
        (size, step, factors) = (num_cells / 2, 2, rest);
        (from, to) = (to, from);
    }
    while size > 4 {
        let (own, rest) = factors.split_at(6 * (size / 4));
        pass_of_four::<V>(from, to, step, own);
        (size, step, factors) = (size / 4, 4 * step, rest);
        (from, to) = (to, from);
    }
    last_pass::<V>(from, to, step);
    to
}

#[cfg_attr(optimised, inline(always))]
fn load<V: Vector>(cells: &[V::Scalar], cell: usize) -> [V; 2] {
    let cell = &cells[cell * 2 * V::LANES..][..2 * V::LANES];
    [V::load(cell), V::load(&cell[V::LANES..])]
}

#[cfg_attr(optimised, inline(always))]
fn store<V: Vector>(cells: &mut [V::Scalar], cell: usize, value: [V; 2]) {
    let cell = &mut cells[cell * 2 * V::LANES..][..2 * V::LANES];
    value[0].store(cell);
    value[1].store(&mut cell[V::LANES..]);
}

#[cfg_attr(optimised, inline(always))]
fn add<V: Vector>(a: [V; 2], b: [V; 2]) -> [V; 2] {
    [a[0].add(b[0]), a[1].add(b[1])]
}

#[cfg_attr(optimised, inline(always))]
fn sub<V: Vector>(a: [V; 2], b: [V; 2]) -> [V; 2] {
    [a[0].sub(b[0]), a[1].sub(b[1])]
}

/// `a + j b`
#[cfg_attr(optimised, inline(always))]
fn add_turned<V: Vector>(a: [V; 2], b: [V; 2]) -> [V; 2] {
    [a[0].sub(b[1]), a[1].add(b[0])]
}

/// `a - j b`
#[cfg_attr(optimised, inline(always))]
fn sub_turned<V: Vector>(a: [V; 2], b: [V; 2]) -> [V; 2] {
    [a[0].add(b[1]), a[1].sub(b[0])]
}

/// Product with the complex number that begins `factor`.
#[cfg_attr(optimised, inline(always))]
fn turn<V: Vector>(a: [V; 2], factor: &[V::Scalar]) -> [V; 2] {
    let (re, im) = (V::splat(factor[0]), V::splat(factor[1]));
    [a[1].neg_mul_add(im, a[0].mul(re)), a[1].mul_add(re, a[0].mul(im))]
}

#[cfg_attr(optimised, inline(always))]
fn pass_of_two<V: Vector>(from: &[V::Scalar], to: &mut [V::Scalar], factors: &[V::Scalar]) {
    let half = from.len() / (2 * V::LANES) / 2;
    for p in 0..half {
        let (a, b) = (load::<V>(from, p), load::<V>(from, p + half));
        store(to, 2 * p, add(a, b));
        store(to, 2 * p + 1, turn(sub(a, b), &factors[2 * p..][..2]));
    }
}

#[cfg_attr(optimised, inline(always))]
fn pass_of_four<V: Vector>(from: &[V::Scalar], to: &mut [V::Scalar], step: usize, factors: &[V::Scalar]) {
    let quarter = from.len() / (2 * V::LANES) / 4;
    let num_butterflies = quarter / step;
    for p in 0..num_butterflies {
        let own = &factors[6 * p..][..6];
        for q in 0..step {
            let at = q + step * p;
            let (a, b) = (load::<V>(from, at), load::<V>(from, at + quarter));
            let (c, d) = (load::<V>(from, at + 2 * quarter), load::<V>(from, at + 3 * quarter));
            let (even, odd) = (add(a, c), sub(a, c));
            let (even_b, odd_b) = (add(b, d), sub(b, d));
            let out = q + 4 * step * p;
            store(to, out, add(even, even_b));
            store(to, out + step, turn(add_turned(odd, odd_b), &own[0..2]));
            store(to, out + 2 * step, turn(sub(even, even_b), &own[2..4]));
            store(to, out + 3 * step, turn(sub_turned(odd, odd_b), &own[4..6]));
        }
    }
}

/// Last pass, which has no factors; the middle half of the result is left out.
#[cfg_attr(optimised, inline(always))]
fn last_pass<V: Vector>(from: &[V::Scalar], to: &mut [V::Scalar], step: usize) {
    for q in 0..step {
        let (a, b) = (load::<V>(from, q), load::<V>(from, q + step));
        let (c, d) = (load::<V>(from, q + 2 * step), load::<V>(from, q + 3 * step));
        store(to, q, add(add(a, c), add(b, d)));
        store(to, q + 3 * step, sub_turned(sub(a, c), sub(b, d)));
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::numeric::random::mix;
    use crate::numeric::simd::{Isa, Kernel, Level, Precision};

    struct Inverse<'a, T>(&'a mut [T], usize, &'a [T]);

    impl<T: Precision> Kernel for Inverse<'_, T> {
        type Output = Vec<T>;
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> Vec<T> {
            let mut scratch = vec![T::zero(); self.0.len()];
            inverse::<T::In<I>>(self.0, &mut scratch, self.1, self.2).to_vec()
        }
    }

    /// Compare with the definition for `T` with some lanes.
    fn check<T: Precision>(lanes: usize, tolerance: f64) {
        for num_cells in [16, 32, 64, 256, 512] {
            let number = |i: usize| T::of((mix(i as u64) >> 40) as f64 / f64::from(1 << 24) - 0.5);
            let grid: Vec<T> = (0..num_cells * 2 * lanes).map(number).collect();
            for level in Level::available() {
                let got = level.run(Inverse(&mut grid.clone(), num_cells, &twiddles(num_cells)));
                for j in (0..num_cells / 4).chain(3 * num_cells / 4..num_cells) {
                    for lane in [0, lanes - 3, lanes - 1] {
                        let at = |cells: &[T], cell: usize| {
                            let [re, im] = [0, lanes].map(|part| cells[2 * cell * lanes + part + lane].wide());
                            Complex64::new(re, im)
                        };
                        let turn = |cell: usize| Complex64::cis(TAU * (j * cell % num_cells) as f64 / num_cells as f64);
                        let expected: Complex64 = (0..num_cells).map(|cell| at(&grid, cell) * turn(cell)).sum();
                        let error = (at(&got, j) - expected).norm();
                        assert!(error < tolerance, "{num_cells} {level:?} {j} {lane}: {error:e}");
                    }
                }
            }
        }
    }

    #[test]
    fn transform_is_the_sum_of_its_definition() {
        check::<f32>(16, 1e-5);
        check::<f64>(8, 1e-13);
    }
}
