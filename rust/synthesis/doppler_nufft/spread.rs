//! Spreading of points on the grid, each over a patch of cells.

use super::grid::Layout;
use super::points::{ComputePoints, Points, PointsOf};
use crate::numeric::simd::{Isa, Kernel, Level, Vector, add_patch, add_rows};
use crate::numeric::wide;
use crate::synthesis::chunk::{CHUNK, Lane};
use crate::synthesis::kaiser_bessel::{Taps, degree};
use crate::synthesis::source::Fill;

/// Polynomials of the kernels along range and velocity.
pub struct Tables<T> {
    /// Along range, `[power][number]`: for real and imaginary parts if they [fit](fits), else for all cells, in whole
    /// vectors.
    range: Vec<T>,
    /// Along range and along velocity, half a vector each, if they fit.
    both: Vec<T>,
    /// Along velocity.
    velocity: Taps<T>,
}

impl<T: Widths> Tables<T> {
    /// Polynomials for grids of a layout.
    pub fn new(layout: &Layout) -> Self {
        let width = layout.width;
        let (range, velocity) = (layout.kernel().taps::<T>(), layout.velocity_kernel().taps::<T>());
        let table = |lanes: usize, tap: &dyn Fn(usize, usize) -> T| {
            let rows = (0..=degree(width)).flat_map(|power| (0..lanes).map(move |lane| (lane, power)));
            rows.map(|(lane, power)| tap(lane, power)).collect()
        };
        let (lanes, half) = (T::LANES, T::LANES / 2);
        let along_range = |cell: usize, power: usize| range.coefficient(width, cell, power);
        Self {
            range: if fits::<T>(width) {
                table(lanes, &|lane, power| along_range(lane / 2, power))
            } else {
                table(width.next_multiple_of(lanes), &along_range)
            },
            both: table(if fits::<T>(width) { lanes } else { 0 }, &|lane, power| match lane {
                _ if lane < half => along_range(lane, power),
                _ => velocity.coefficient(width, lane - half, power),
            }),
            velocity,
        }
    }
}

/// True if the cells of a row, real and imaginary parts, fit into one vector.
const fn fits<T: Widths>(width: usize) -> bool {
    2 * width <= T::LANES
}

/// Taps of the points of a chunk.
pub struct Scratch<T> {
    /// Along range for real and imaginary parts, in whole vectors: (path, number).
    range: Vec<T>,
    /// Along velocity: (cell, path).
    velocity: Vec<Lane<T>>,
}

impl<T: Widths> Scratch<T> {
    /// Memory for a width.
    pub fn new(width: usize) -> Self {
        Self {
            range: vec![T::zero(); CHUNK * (2 * width).next_multiple_of(T::LANES)],
            velocity: vec![[T::zero(); CHUNK]; width],
        }
    }
}

/// Spreading of the points of a chunk.
pub struct SpreadPoints<'a, T> {
    /// Layout of the grid.
    pub layout: &'a Layout,
    /// Polynomials of the kernels.
    pub tables: &'a Tables<T>,
    /// The points.
    pub points: &'a Points<T>,
    /// Memory.
    pub scratch: &'a mut Scratch<T>,
    /// Grid `(term, row, cell)`.
    pub grid: &'a mut [T],
}

impl<T: Widths> SpreadPoints<'_, T> {
    /// Add the points to the grid, with a kernel of `W` cells, `N` vectors per row. Consecutive paths of one cell are
    /// merged in registers if `MERGES`.
    fn add<const W: usize, const N: usize, const MERGES: bool>(self, level: Level) {
        if self.layout.rows > 1 {
            level.run(Spread::<T, W, W, N, MERGES>(self));
        } else {
            level.run(Spread::<T, W, 1, N, MERGES>(self));
        }
    }
}

/// Kernel that spreads points with a width of `W` cells over `R` rows.
struct Spread<'a, T, const W: usize, const R: usize, const N: usize, const MERGES: bool>(SpreadPoints<'a, T>);

impl<T: Widths, const W: usize, const R: usize, const N: usize, const MERGES: bool> Kernel
    for Spread<'_, T, W, R, N, MERGES>
{
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let SpreadPoints {
            layout,
            tables,
            points,
            scratch,
            grid,
        } = self.0;
        let len = points.len.min(CHUNK);
        let mut repeats = 0;
        for i in 1..len {
            repeats += usize::from(points.start[i] == points.start[i - 1]);
        }
        let is_merged = MERGES && 2 * repeats > len;
        if fits::<T>(W) && R > 1 && !is_merged && points.strengths.len() == 1 {
            add_single::<T, I, W, R>(layout, &tables.both, points, grid);
            return;
        }
        if R > 1 {
            velocity_taps::<T, I, W>(&tables.velocity, &points.zy, &mut scratch.velocity);
        }
        range_taps::<T, I, W, N>(&tables.range, &points.zx[..len], &mut scratch.range);
        // One grid after the other: the rows at work stay in L1.
        for term in 0..points.strengths.len() {
            let grid = &mut grid[term * layout.size()..][..layout.size()];
            if is_merged {
                merge::<T, I, R, N>(layout, points, term, scratch, grid);
            } else {
                add::<T, I, R, N>(layout, points, term, scratch, grid);
            }
        }
    }
}

/// Add the patch of every path of one strength, with taps of both axes in one vector: shuffles are free here, loads and
/// stores are not.
#[cfg_attr(optimised, inline(always))]
fn add_single<T: Widths, I: Isa, const W: usize, const R: usize>(
    layout: &Layout,
    table: &[T],
    points: &Points<T>,
    grid: &mut [T],
) {
    let lanes = <T::In<I>>::LANES;
    let mut polynomials = [<T::In<I>>::splat(T::zero()); degree(8) + 1];
    for power in 0..=degree(W) {
        polynomials[power] = <T::In<I>>::load(&table[power * lanes..]);
    }
    for i in 0..points.len.min(CHUNK) {
        let z = <T::In<I>>::halves(points.zx[i], points.zy[i]);
        let mut tap = polynomials[degree(W)];
        for power in (0..degree(W)).rev() {
            tap = tap.mul_add(z, polynomials[power]);
        }
        let values = tap.pairs()[0].mul(strength::<T, I>(points, 0, i));
        let mut numbers = [T::zero(); 16];
        tap.store(&mut numbers);
        let mut taps = [T::one(); R];
        for j in 0..R {
            taps[j] = numbers[lanes / 2 + j];
        }
        add_rows::<_, R, 1>(grid, points.start[i] as usize, layout.stride, &taps, &[values]);
    }
}

/// Add the patch of every path.
#[cfg_attr(optimised, inline(always))]
fn add<T: Widths, I: Isa, const R: usize, const N: usize>(
    layout: &Layout,
    points: &Points<T>,
    term: usize,
    scratch: &Scratch<T>,
    grid: &mut [T],
) {
    let lanes = <T::In<I>>::LANES;
    let velocity = &scratch.velocity[..R];
    for i in 0..points.len.min(CHUNK) {
        let range = wide::load_vectors::<T::In<I>, N>(&scratch.range[i * N * lanes..]);
        let values = wide::mul(range, [strength::<T, I>(points, term, i); N]);
        let start = points.start[i] as usize;
        if R > 1 {
            let mut taps = [T::one(); R];
            for j in 0..R {
                taps[j] = velocity[j][i];
            }
            add_rows::<_, R, N>(grid, start, layout.stride, &taps, &values);
        } else {
            add_patch(grid, start, layout.stride, &[values]);
        }
    }
}

/// Add the patches of all paths, those of consecutive paths in one cell summed in registers first.
#[cfg_attr(optimised, inline(always))]
fn merge<T: Widths, I: Isa, const R: usize, const N: usize>(
    layout: &Layout,
    points: &Points<T>,
    term: usize,
    scratch: &Scratch<T>,
    grid: &mut [T],
) {
    let lanes = <T::In<I>>::LANES;
    let velocity = &scratch.velocity[..R];
    let len = points.len.min(CHUNK);
    let mut i = 0;
    while i < len {
        let cell = points.start[i];
        let mut patch = [[<T::In<I>>::splat(T::zero()); N]; R];
        while i < len && points.start[i] == cell {
            let range = wide::load_vectors::<T::In<I>, N>(&scratch.range[i * N * lanes..]);
            let values = wide::mul(range, [strength::<T, I>(points, term, i); N]);
            for j in 0..R {
                let tap = <T::In<I>>::splat(if R == 1 { T::one() } else { velocity[j][i] });
                for n in 0..N {
                    patch[j][n] = tap.mul_add(values[n], patch[j][n]);
                }
            }
            i += 1;
        }
        add_patch(grid, cell as usize, layout.stride, &patch);
    }
}

/// Real and imaginary part of a strength of a path, repeated over a vector.
#[cfg_attr(optimised, inline(always))]
fn strength<T: Widths, I: Isa>(points: &Points<T>, term: usize, path: usize) -> T::In<I> {
    let strength = &points.strengths[term][2 * path..2 * path + 2];
    <T::In<I>>::alternate(strength[0], strength[1])
}

/// Taps along velocity of all paths.
#[cfg_attr(optimised, inline(always))]
fn velocity_taps<T: Widths, I: Isa, const W: usize>(table: &Taps<T>, z: &Lane<T>, taps: &mut [Lane<T>]) {
    let taps = &mut taps[..W];
    for at in (0..CHUNK).step_by(<T::In<I>>::LANES) {
        let values = table.values::<T::In<I>, W>(<T::In<I>>::load(&z[at..]));
        for cell in 0..W {
            values[cell].store(&mut taps[cell][at..]);
        }
    }
}

/// Taps along range of all paths, for real and imaginary parts.
#[cfg_attr(optimised, inline(always))]
fn range_taps<T: Widths, I: Isa, const W: usize, const N: usize>(table: &[T], z: &[T], taps: &mut [T]) {
    let lanes = <T::In<I>>::LANES;
    let stride = if fits::<T>(W) { lanes } else { W.next_multiple_of(lanes) };
    let table = &table[..(degree(W) + 1) * stride];
    let taps = &mut taps[..CHUNK * N * lanes];
    for path in 0..z.len() {
        let z = <T::In<I>>::splat(z[path]);
        for i in 0..N.div_ceil(2) {
            let mut tap = <T::In<I>>::load(&table[degree(W) * stride + i * lanes..]);
            for power in (0..degree(W)).rev() {
                tap = tap.mul_add(z, <T::In<I>>::load(&table[power * stride + i * lanes..]));
            }
            let at = (path * N + 2 * i) * lanes;
            if fits::<T>(W) {
                tap.store(&mut taps[at..]);
                continue;
            }
            let [low, high] = tap.pairs();
            low.store(&mut taps[at..]);
            if 2 * i + 1 < N {
                high.store(&mut taps[at + lanes..]);
            }
        }
    }
}

/// Precisions of a grid, with the widths that are compiled for them.
pub trait Widths: Fill {
    /// Numbers in a vector.
    const LANES: usize;
    /// Compute the points of a chunk of a channel, and measure the paths.
    fn compute_points(level: Level, points: PointsOf<Self>);
    /// Spread the points of a chunk.
    fn spread(level: Level, points: SpreadPoints<Self>);
}

impl Widths for f32 {
    const LANES: usize = 16;

    fn compute_points(level: Level, points: PointsOf<Self>) {
        level.run(ComputePoints::<_, 2>(points));
    }

    fn spread(level: Level, points: SpreadPoints<Self>) {
        match points.layout.width {
            4 => points.add::<4, 1, true>(level),
            6 => points.add::<6, 1, true>(level),
            _ => points.add::<8, 1, true>(level),
        }
    }
}

impl Widths for f64 {
    const LANES: usize = 8;

    fn compute_points(level: Level, points: PointsOf<Self>) {
        level.run(ComputePoints::<_, 1>(points));
    }

    fn spread(level: Level, points: SpreadPoints<Self>) {
        // Wider patches do not fit into the registers that merging needs.
        match points.layout.width {
            10 => points.add::<10, 3, true>(level),
            12 => points.add::<12, 3, false>(level),
            _ => points.add::<14, 4, false>(level),
        }
    }
}
