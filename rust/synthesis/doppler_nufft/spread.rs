//! Spreading of points on the grid, each over a patch of cells.

use super::grid::Grid;
use super::points::Points;
use crate::numeric::kaiser_bessel::degree;
use crate::numeric::simd::{Isa, Kernel, Precision, Vector, add_rows};
use crate::numeric::wide;
use crate::synthesis::chunk::CHUNK;

/// Highest degree of the polynomials.
const MAX_DEGREE: usize = degree(14);

/// Kernel that spreads the points of a chunk.
pub struct SpreadPoints<'a, T> {
    /// Grid of static or of moving paths.
    pub grid: &'a Grid<T>,
    /// The points.
    pub points: &'a Points<T>,
    /// Numbers of the grid, `(term, row, cell)`.
    pub cells: &'a mut [T],
}

impl<T: Precision> Kernel for SpreadPoints<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        match (<T::In<I>>::LANES, self.grid.layout.width) {
            (16, 4) => self.spread::<I, 4, 1>(),
            (16, 6) => self.spread::<I, 6, 1>(),
            (16, _) => self.spread::<I, 8, 1>(),
            (_, 10) => self.spread::<I, 10, 3>(),
            (_, 12) => self.spread::<I, 12, 3>(),
            _ => self.spread::<I, 14, 4>(),
        }
    }
}

impl<T: Precision> SpreadPoints<'_, T> {
    /// Spread with a kernel of `W` cells, `N` vectors per row of a patch.
    #[cfg_attr(optimised, inline(always))]
    fn spread<I: Isa, const W: usize, const N: usize>(self) {
        let len = self.points.len.min(CHUNK);
        let mut repeats = 0;
        for i in 1..len {
            repeats += usize::from(self.points.start(i) == self.points.start(i - 1));
        }
        // Wider patches do not fit into registers.
        match (N == 1 && 2 * repeats > len, self.grid.layout.rows > 1) {
            (true, true) => self.merge::<I, W, W, N>(),
            (true, false) => self.merge::<I, W, 1, N>(),
            (false, true) => self.add::<I, W, W, N>(),
            (false, false) => self.add::<I, W, 1, N>(),
        }
    }

    /// Add the patch of every path, of `R` rows.
    #[cfg_attr(optimised, inline(always))]
    fn add<I: Isa, const W: usize, const R: usize, const N: usize>(self) {
        let (points, layout) = (self.points, &self.grid.layout);
        let table = table::<T, I, W, N>(&self.grid.taps);
        for i in 0..points.len.min(CHUNK) {
            let (range, velocity) = taps::<T, I, W, R, N>(&table, points, i);
            for term in 0..points.strengths.len() {
                let values = wide::mul(range, [strength::<T, I>(points, term, i); N]);
                let start = term * layout.size() + points.start(i);
                add_rows::<_, R, N>(self.cells, start, layout.stride, &velocity, &values);
            }
        }
    }

    /// Add the patches of all paths; consecutive paths in one cell are summed in registers first.
    #[cfg_attr(optimised, inline(always))]
    fn merge<I: Isa, const W: usize, const R: usize, const N: usize>(self) {
        let (points, layout) = (self.points, &self.grid.layout);
        let table = table::<T, I, W, N>(&self.grid.taps);
        let len = points.len.min(CHUNK);
        for term in 0..points.strengths.len() {
            let mut i = 0;
            while i < len {
                let start = points.start(i);
                let mut patch = [[<T::In<I>>::splat(T::zero()); N]; R];
                while i < len && points.start(i) == start {
                    let (range, velocity) = taps::<T, I, W, R, N>(&table, points, i);
                    let values = wide::mul(range, [strength::<T, I>(points, term, i); N]);
                    for j in 0..R {
                        for n in 0..N {
                            patch[j][n] = <T::In<I>>::splat(velocity[j]).mul_add(values[n], patch[j][n]);
                        }
                    }
                    i += 1;
                }
                for j in 0..R {
                    let row = term * layout.size() + start + j * layout.stride;
                    add_rows::<_, 1, N>(self.cells, row, 0, &[T::one()], &patch[j]);
                }
            }
        }
    }
}

/// Vectors of the [table](Grid::taps).
#[cfg_attr(optimised, inline(always))]
fn table<T: Precision, I: Isa, const W: usize, const N: usize>(table: &[T]) -> [[T::In<I>; N]; MAX_DEGREE + 1] {
    let mut polynomials = [[<T::In<I>>::splat(T::zero()); N]; MAX_DEGREE + 1];
    for power in 0..=degree(W) {
        polynomials[power] = wide::load_vectors(&table[power * N * <T::In<I>>::LANES..]);
    }
    polynomials
}

/// Taps of a path along range, for real and imaginary parts, and along velocity: both axes share vectors, as shuffles
/// are free here, and loads and stores are not.
#[cfg_attr(optimised, inline(always))]
fn taps<T: Precision, I: Isa, const W: usize, const R: usize, const N: usize>(
    table: &[[T::In<I>; N]; MAX_DEGREE + 1],
    points: &Points<T>,
    path: usize,
) -> ([T::In<I>; N], [T; R]) {
    let lanes = <T::In<I>>::LANES;
    let z = [points.offset[0][path], points.offset[1][path]];
    let mut offsets = [<T::In<I>>::splat(T::zero()); N];
    for n in 0..N {
        offsets[n] = <T::In<I>>::halves(z[2 * n / N], z[(2 * n + 1) / N]);
    }
    let mut taps = table[degree(W)];
    for power in (0..degree(W)).rev() {
        taps = wide::mul_add(taps, offsets, table[power]);
    }
    let mut range = taps;
    for n in 0..N {
        range[n] = taps[n / 2].pairs()[n % 2];
    }
    let mut velocity = [T::one(); R];
    if R > 1 {
        let mut numbers = [T::zero(); 32];
        wide::store(taps, &mut numbers);
        for j in 0..R {
            velocity[j] = numbers[N * lanes / 2 + j];
        }
    }
    (range, velocity)
}

/// Real and imaginary part of a strength of a path, repeated over a vector.
#[cfg_attr(optimised, inline(always))]
fn strength<T: Precision, I: Isa>(points: &Points<T>, term: usize, path: usize) -> T::In<I> {
    let strength = &points.strengths[term][2 * path..2 * path + 2];
    <T::In<I>>::alternate(strength[0], strength[1])
}
