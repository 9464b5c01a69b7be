//! Spreading of paths on the grid, each over a patch of cells.

use std::ops::Range;

use super::coordinates::{Coordinates, Map, Placing, Points, Tracks};
use super::job::Job;
use super::layout::Layout;
use super::measured::Measured;
use super::scalar::Scalar;
use crate::cancel::Cancel;
use crate::numeric::simd::{Isa, Kernel, Level, Vector, add_patch, add_rows};
use crate::numeric::wide;
use crate::synthesis::block::{CHUNK, Rows};
use crate::synthesis::nufft::kernel::{KaiserBessel, degree, tap_table};

/// Spread the paths of some chunks on the grid, and measure them.
pub fn spread_chunks<T: Widths>(job: &Job, layout: &Layout, chunks: Range<usize>, grid: &mut [T]) -> Measured {
    let is_sorted = is_sorted::<T>(job, layout);
    // Sorting gains from many paths; without it, points stay in the L1 cache.
    let bytes = if is_sorted { 1 << 17 } else { 1 << 14 };
    let batch = (bytes / (2 * job.width.next_multiple_of(8) * size_of::<T>() * CHUNK)).max(1);
    let mut rows = Rows::of_class(job.series, job.selection.class);
    let mut tracks = Tracks::new(job);
    let mut points = Points::new(job.block_plan.approximation.num_sets(), batch * CHUNK);
    let map = Map::new(job, layout);
    let tables = Tables::new(job.width);
    let mut scratch = Scratch::new(batch * CHUNK, job.width);
    let mut measured = Measured::new(job);
    for first in chunks.clone().step_by(batch) {
        if job.cancel.is_some_and(Cancel::is_asked) {
            break;
        }
        points.len = 0;
        for index in first..chunks.end.min(first + batch) {
            T::place(Coordinates {
                job,
                map: &map,
                first: index * CHUNK,
                rows: &mut rows,
                tracks: &mut tracks,
                points: &mut points,
                measured: &mut measured,
            });
        }
        scratch.order(&points, layout, is_sorted);
        T::add_points(Patches {
            level: job.level,
            width: job.width,
            layout,
            points: &points,
            tables: &tables,
            scratch: &mut scratch,
            grid,
        });
    }
    measured
}

/// Grids that stay in the L1 cache [bytes].
const FAST_MEMORY: usize = 1 << 15;

/// Size of a column of a path's patches, over all terms, from which on sorting pays [bytes].
const MIN_BYTES: usize = 56;

/// True if paths are sorted by cell, which pays where a path adds to many cells.
fn is_sorted<T>(job: &Job, layout: &Layout) -> bool {
    layout.rows > 1
        && layout.size() * size_of::<T>() > FAST_MEMORY
        && job.block_plan.approximation.num_sets() * job.width * size_of::<T>() >= MIN_BYTES
}

/// Polynomials of the kernel, `[power][number]`.
struct Tables<T> {
    /// Polynomials along range: for real and imaginary parts if they [fit](fits), else for all cells, in whole vectors.
    range: Vec<T>,
    /// Polynomials along velocity, for all cells.
    velocity: Vec<T>,
    /// Polynomials along range and along velocity, half a vector each, if they fit.
    both: Vec<T>,
}

impl<T: Widths> Tables<T> {
    fn new(width: usize) -> Self {
        let kernel = KaiserBessel::new(width);
        let fits = fits::<T>(width);
        Self {
            range: if fits {
                tap_table(&kernel, T::LANES, |lane| lane / 2)
            } else {
                tap_table(&kernel, width.next_multiple_of(T::LANES), |lane| lane)
            },
            velocity: tap_table(&kernel, width, |lane| lane),
            both: tap_table(&kernel, if fits { T::LANES } else { 0 }, |lane| lane % (T::LANES / 2)),
        }
    }
}

/// True if the cells of a row, real and imaginary parts, fit into one vector.
const fn fits<T: Widths>(width: usize) -> bool {
    2 * width <= T::LANES
}

/// Points of a batch in the order of spreading.
pub struct Scratch<T> {
    /// Indices of the paths.
    order: Vec<u16>,
    /// Indices of the paths sorted by column alone.
    by_column: Vec<u16>,
    /// First index of every key in sorted order.
    ends: Vec<usize>,
    /// Start of the patch of every path in the grid.
    start: Vec<u32>,
    /// Offsets between two cells, -1 to 1.
    zx: Vec<T>,
    /// Offsets between two rows, -1 to 1.
    zy: Vec<T>,
    /// Taps along range for real and imaginary parts, in whole vectors: (path, number).
    range: Vec<T>,
    /// Taps along velocity: (chunk, cell, path).
    velocity: Vec<[T; CHUNK]>,
}

impl<T: Widths> Scratch<T> {
    fn new(num_paths: usize, width: usize) -> Self {
        let zero = || vec![T::zero(); num_paths];
        Self {
            order: vec![0; num_paths],
            by_column: vec![0; num_paths],
            ends: Vec::new(),
            start: vec![0; num_paths],
            zx: zero(),
            zy: zero(),
            range: vec![T::zero(); num_paths * (2 * width).next_multiple_of(T::LANES)],
            velocity: vec![[T::zero(); CHUNK]; num_paths / CHUNK * width],
        }
    }

    /// Choose the order of the paths: by cell, which keeps the rows at work in L1 and makes paths of one cell
    /// consecutive, or the given order if that does so already.
    fn order(&mut self, points: &Points<T>, layout: &Layout, is_sorted: bool) {
        let len = points.len;
        let (row, start) = (&points.row[..len], &points.start[..len]);
        let repeats = start.windows(2).filter(|pair| pair[0] == pair[1]).count();
        if !is_sorted || 2 * repeats > len {
            for (i, order) in self.order[..len].iter_mut().enumerate() {
                *order = i as u16;
            }
            self.start[..len].copy_from_slice(start);
            self.zx[..len].copy_from_slice(&points.zx[..len]);
            self.zy[..len].copy_from_slice(&points.zy[..len]);
            return;
        }
        // Counting sort in two passes: by column, then by row.
        let column = |i: usize| (start[i] as usize - row[i] as usize * layout.stride) / 2;
        count(&mut self.ends, layout.stride / 2, (0..len).map(column));
        for i in 0..len {
            let at = &mut self.ends[column(i)];
            self.by_column[*at] = i as u16;
            *at += 1;
        }
        count(&mut self.ends, layout.rows, row.iter().map(|row| *row as usize));
        for i in &self.by_column[..len] {
            let path = usize::from(*i);
            let at = &mut self.ends[row[path] as usize];
            self.order[*at] = *i;
            self.start[*at] = start[path];
            self.zx[*at] = points.zx[path];
            self.zy[*at] = points.zy[path];
            *at += 1;
        }
    }
}

/// Index of the first of every key in sorted order.
fn count(ends: &mut Vec<usize>, num_keys: usize, keys: impl Iterator<Item = usize>) {
    ends.clear();
    ends.resize(num_keys + 1, 0);
    for key in keys {
        ends[key + 1] += 1;
    }
    for i in 0..num_keys {
        ends[i + 1] += ends[i];
    }
}

/// Spreading of the points of a batch of paths.
pub struct Patches<'a, T> {
    level: Level,
    /// Width of the kernel [cells].
    pub width: usize,
    layout: &'a Layout,
    points: &'a Points<T>,
    tables: &'a Tables<T>,
    scratch: &'a mut Scratch<T>,
    grid: &'a mut [T],
}

impl<T: Widths> Patches<'_, T> {
    /// Add the points to the grid, with a kernel of `W` cells, `N` vectors per row. Consecutive paths of one cell are
    /// merged in registers if `MERGES`.
    pub fn add<const W: usize, const N: usize, const MERGES: bool>(self) {
        if self.layout.rows > 1 {
            self.level.run(Spread::<T, W, W, N, MERGES>(self));
        } else {
            self.level.run(Spread::<T, W, 1, N, MERGES>(self));
        }
    }
}

/// Kernel that spreads points with a width of `W` cells over `R` rows.
struct Spread<'a, T, const W: usize, const R: usize, const N: usize, const MERGES: bool>(Patches<'a, T>);

impl<T: Widths, const W: usize, const R: usize, const N: usize, const MERGES: bool> Kernel
    for Spread<'_, T, W, R, N, MERGES>
{
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let Patches {
            layout,
            points,
            tables,
            scratch,
            grid,
            ..
        } = self.0;
        let len = points.len;
        let mut repeats = 0;
        for i in 1..len {
            repeats += usize::from(scratch.start[i] == scratch.start[i - 1]);
        }
        let is_merged = MERGES && 2 * repeats > len;
        // One set of strengths needs the taps of a path once.
        let is_single = points.strengths.len() == 1;
        if R > 1 && (is_merged || !is_single || !fits::<T>(W)) {
            scratch.evaluate_velocity::<I, W>(&tables.velocity, len);
        }
        if !is_single {
            let polynomials = polynomials::<T, I, W>(&tables.range);
            for i in 0..len {
                let taps = range_taps::<T, I, W, N>(&polynomials, &tables.range, scratch.zx[i]);
                wide::store(taps, &mut scratch.range[i * N * <T::In<I>>::LANES..]);
            }
        }
        // One grid after the other: the rows at work stay in L1.
        for term in 0..points.strengths.len() {
            let grid = &mut grid[term * layout.size()..][..layout.size()];
            for first in (0..len).step_by(CHUNK) {
                let chunk = Chunk {
                    len: CHUNK.min(len - first),
                    stride: layout.stride,
                    strengths: &points.strengths[term],
                    tables,
                    order: &scratch.order[first..],
                    start: &scratch.start[first..],
                    zx: &scratch.zx[first..],
                    zy: &scratch.zy[first..],
                    range: &scratch.range[first * N * <T::In<I>>::LANES..],
                    velocity: &scratch.velocity[first / CHUNK * W..],
                };
                if is_merged && is_single {
                    chunk.merge::<I, W, R, N, true>(grid);
                } else if is_merged {
                    chunk.merge::<I, W, R, N, false>(grid);
                } else if is_single {
                    chunk.add::<I, W, R, N, true>(grid);
                } else {
                    chunk.add::<I, W, R, N, false>(grid);
                }
            }
        }
    }
}

/// Run of paths in their order, and the strengths of all paths.
struct Chunk<'a, T> {
    len: usize,
    stride: usize,
    strengths: &'a [T],
    tables: &'a Tables<T>,
    order: &'a [u16],
    start: &'a [u32],
    zx: &'a [T],
    zy: &'a [T],
    range: &'a [T],
    velocity: &'a [[T; CHUNK]],
}

impl<T: Widths> Chunk<'_, T> {
    /// Add the patch of every path to the grid. `SINGLE`: compute the taps along range, and those along velocity if
    /// both fit into a vector.
    #[cfg_attr(optimised, inline(always))]
    fn add<I: Isa, const W: usize, const R: usize, const N: usize, const SINGLE: bool>(&self, grid: &mut [T]) {
        // Shuffles are free here, loads and stores are not.
        let is_both = SINGLE && R > 1 && fits::<T>(W);
        let table = if is_both { &self.tables.both } else { &self.tables.range };
        let polynomials = polynomials::<T, I, W>(table);
        let len = self.len.min(CHUNK);
        let (order, start) = (&self.order[..len], &self.start[..len]);
        let (zx, zy) = (&self.zx[..len], &self.zy[..len]);
        let velocity = &self.velocity[..if R > 1 { R } else { 0 }];
        for i in 0..len {
            let strength = self.strength::<I>(order[i]);
            let mut taps = [T::one(); R];
            let mut values = [strength; N];
            if is_both {
                let tap = horner(&polynomials[..=degree(W)], <T::In<I>>::halves(zx[i], zy[i]));
                values[0] = tap.pairs()[0].mul(strength);
                let mut lanes = [T::zero(); 16];
                tap.store(&mut lanes);
                for j in 0..R {
                    taps[j] = lanes[T::LANES / 2 + j];
                }
            } else {
                let range = if SINGLE {
                    range_taps::<T, I, W, N>(&polynomials, table, zx[i])
                } else {
                    wide::load_vectors(&self.range[i * N * <T::In<I>>::LANES..])
                };
                values = wide::mul(range, values);
                for j in 0..velocity.len() {
                    taps[j] = velocity[j][i];
                }
            }
            if R > 1 {
                add_rows::<_, R, N>(grid, start[i] as usize, self.stride, &taps, &values);
            } else {
                add_patch(grid, start[i] as usize, self.stride, &[values]);
            }
        }
    }

    /// Add the patches of all paths to the grid, those of consecutive paths in one cell summed in registers first. Taps
    /// along velocity are given.
    #[cfg_attr(optimised, inline(always))]
    fn merge<I: Isa, const W: usize, const R: usize, const N: usize, const SINGLE: bool>(&self, grid: &mut [T]) {
        let table = &self.tables.range;
        let polynomials = polynomials::<T, I, W>(table);
        let len = self.len.min(CHUNK);
        let (order, start, zx) = (&self.order[..len], &self.start[..len], &self.zx[..len]);
        let velocity = &self.velocity[..if R > 1 { R } else { 0 }];
        let mut i = 0;
        while i < len {
            let cell = start[i];
            let mut patch = [[<T::In<I>>::splat(T::zero()); N]; R];
            while i < len && start[i] == cell {
                let range = if SINGLE {
                    range_taps::<T, I, W, N>(&polynomials, table, zx[i])
                } else {
                    wide::load_vectors(&self.range[i * N * <T::In<I>>::LANES..])
                };
                let values = wide::mul(range, [self.strength::<I>(order[i]); N]);
                for j in 0..R {
                    let tap = <T::In<I>>::splat(if R == 1 { T::one() } else { velocity[j][i] });
                    for n in 0..N {
                        patch[j][n] = tap.mul_add(values[n], patch[j][n]);
                    }
                }
                i += 1;
            }
            add_patch(grid, cell as usize, self.stride, &patch);
        }
    }

    /// Real and imaginary part of the strength of a path, repeated over a vector.
    #[cfg_attr(optimised, inline(always))]
    fn strength<I: Isa>(&self, path: u16) -> T::In<I> {
        let at = 2 * usize::from(path);
        let strength = &self.strengths[at..at + 2];
        <T::In<I>>::alternate(strength[0], strength[1])
    }
}

impl<T: Widths> Scratch<T> {
    /// Taps along velocity of all paths.
    #[cfg_attr(optimised, inline(always))]
    fn evaluate_velocity<I: Isa, const W: usize>(&mut self, table: &[T], len: usize) {
        let lanes = <T::In<I> as Vector>::LANES;
        let table = &table[..(degree(W) + 1) * W];
        for first in (0..len).step_by(CHUNK) {
            let zy = &self.zy[first..first + CHUNK];
            let taps = &mut self.velocity[first / CHUNK * W..][..W];
            for at in (0..CHUNK.min(len - first)).step_by(lanes) {
                let z = <T::In<I>>::load(&zy[at..]);
                for cell in 0..W {
                    let mut tap = <T::In<I>>::splat(table[degree(W) * W + cell]);
                    for power in (0..degree(W)).rev() {
                        tap = tap.mul_add(z, <T::In<I>>::splat(table[power * W + cell]));
                    }
                    tap.store(&mut taps[cell][at..]);
                }
            }
        }
    }
}

/// Coefficients of the polynomials of one vector.
type Polynomials<V> = [V; degree(8) + 1];

/// Coefficients of a table, if the cells of a row fit into one vector.
#[cfg_attr(optimised, inline(always))]
fn polynomials<T: Widths, I: Isa, const W: usize>(table: &[T]) -> Polynomials<T::In<I>> {
    let lanes = <T::In<I> as Vector>::LANES;
    let mut polynomials = [<T::In<I>>::splat(T::zero()); degree(8) + 1];
    if fits::<T>(W) {
        for power in 0..=degree(W) {
            polynomials[power] = <T::In<I>>::load(&table[power * lanes..]);
        }
    }
    polynomials
}

/// Polynomials by Horner's rule.
#[cfg_attr(optimised, inline(always))]
fn horner<V: Vector>(polynomials: &[V], z: V) -> V {
    let mut sum = polynomials[polynomials.len() - 1];
    for power in (0..polynomials.len() - 1).rev() {
        sum = sum.mul_add(z, polynomials[power]);
    }
    sum
}

/// Taps along range of a path, for real and imaginary parts.
#[cfg_attr(optimised, inline(always))]
fn range_taps<T: Widths, I: Isa, const W: usize, const N: usize>(
    polynomials: &Polynomials<T::In<I>>,
    table: &[T],
    z: T,
) -> [T::In<I>; N] {
    let lanes = <T::In<I> as Vector>::LANES;
    let z = <T::In<I>>::splat(z);
    if fits::<T>(W) {
        return [horner(&polynomials[..=degree(W)], z); N];
    }
    let mut taps = [z; N];
    let stride = W.next_multiple_of(lanes);
    let table = &table[..(degree(W) + 1) * stride];
    for i in 0..N.div_ceil(2) {
        let mut tap = <T::In<I>>::load(&table[degree(W) * stride + i * lanes..]);
        for power in (0..degree(W)).rev() {
            tap = tap.mul_add(z, <T::In<I>>::load(&table[power * stride + i * lanes..]));
        }
        let [low, high] = tap.pairs();
        taps[2 * i] = low;
        if 2 * i + 1 < N {
            taps[2 * i + 1] = high;
        }
    }
    taps
}

/// Kernel widths that are compiled for a precision.
pub trait Widths: Scalar {
    /// Compute the coordinates and strengths of a chunk of paths.
    fn place(chunk: Coordinates<Self>);
    /// Spread the points of a chunk of paths.
    fn add_points(chunk: Patches<Self>);
}

impl Widths for f32 {
    fn place(chunk: Coordinates<Self>) {
        chunk.job.level.run(Placing::<_, 2>(chunk));
    }

    fn add_points(chunk: Patches<Self>) {
        match chunk.width {
            3 => chunk.add::<3, 1, true>(),
            4 => chunk.add::<4, 1, true>(),
            5 => chunk.add::<5, 1, true>(),
            6 => chunk.add::<6, 1, true>(),
            7 => chunk.add::<7, 1, true>(),
            _ => chunk.add::<8, 1, true>(),
        }
    }
}

impl Widths for f64 {
    fn place(chunk: Coordinates<Self>) {
        chunk.job.level.run(Placing::<_, 1>(chunk));
    }

    fn add_points(chunk: Patches<Self>) {
        // Wider patches do not fit into the registers that merging needs.
        match chunk.width {
            8 => chunk.add::<8, 2, true>(),
            10 => chunk.add::<10, 3, true>(),
            12 => chunk.add::<12, 3, false>(),
            _ => chunk.add::<14, 4, false>(),
        }
    }
}
