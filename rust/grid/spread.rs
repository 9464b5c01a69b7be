//! Paths are spread on the grid, each over a patch of cells.

use std::ops::Range;

use super::place::{Map, Points};
use super::{Job, Layout, Widths};
use crate::block::{CHUNK, Rows};
use crate::expansion::Term;
use crate::kernel::{KaiserBessel, degree, tap_table};
use crate::simd::{Isa, Kernel, Level, Vector, add_patch, add_rows};

/// Spread the paths of some chunks.
pub fn spread_chunks<T: Widths>(job: &Job, layout: &Layout, chunks: Range<usize>, grid: &mut [T]) {
    let mut rows = Rows::new(job.series);
    let num_chunks = if is_sorted::<T>(job, layout) { SORTED_CHUNKS } else { 1 };
    let mut placed: Vec<Points<T>> = (0..num_chunks).map(|_| Points::new(job.expansion)).collect();
    let mut sorted = Points::new(job.expansion);
    let map = Map::new(job, layout);
    let table = tap_table::<T>(&KaiserBessel::new(job.width), half(job.width));
    let mut room = Box::new(Room([T::zero(); CHUNK * MAX_TAPS]));
    let mut add = |points: &Points<T>| {
        T::add_points(Patches {
            level: job.level,
            width: job.width,
            layout,
            terms: &job.expansion.terms,
            points,
            table: &table,
            room: &mut room,
            grid,
        });
    };
    for first in chunks.clone().step_by(num_chunks) {
        let last = chunks.end.min(first + num_chunks);
        for (index, points) in (first..last).zip(&mut placed) {
            T::place(job, &map, index * CHUNK, &mut rows, points);
        }
        let placed = &placed[..last - first];
        if num_chunks == 1
            || placed.iter().map(|points| points.num_near(layout)).sum::<usize>() > placed.len() * CHUNK / 2
        {
            placed.iter().for_each(&mut add);
            continue;
        }
        for order in by_row(placed, layout).chunks(CHUNK) {
            sorted.take(placed, order);
            add(&sorted);
        }
    }
}

/// Chunks whose paths are sorted together.
const SORTED_CHUNKS: usize = 16;

/// Whether paths are sorted by velocity row: it keeps the rows at work in L1, and pays where every path adds to many cells.
fn is_sorted<T: Widths>(job: &Job, layout: &Layout) -> bool {
    const FAST_MEMORY: usize = 1 << 16;
    const MIN_BYTES: usize = 96; // of a column of a patch, over all terms
    let is_large = layout.rows > 1 && layout.size() * size_of::<T>() > FAST_MEMORY;
    is_large && job.expansion.terms.len() * job.width * size_of::<T>() >= MIN_BYTES
}

/// Numbers of all paths of some chunks, `CHUNK` times that of the chunk and that in it, by velocity row.
fn by_row<T: Widths>(chunks: &[Points<T>], layout: &Layout) -> Vec<u16> {
    let row = |start: u32| start as usize / layout.stride;
    let mut ends = vec![0; layout.rows + 1];
    for points in chunks {
        for start in &points.start[..points.len] {
            ends[row(*start) + 1] += 1;
        }
    }
    for i in 0..layout.rows {
        ends[i + 1] += ends[i];
    }
    let mut order = vec![0; ends[layout.rows]];
    for (chunk, points) in chunks.iter().enumerate() {
        for (i, start) in points.start[..points.len].iter().enumerate() {
            let at = &mut ends[row(*start)];
            order[*at] = (chunk * CHUNK + i) as u16;
            *at += 1;
        }
    }
    order
}

/// Most taps of a path along both axes.
const MAX_TAPS: usize = 32;

/// Taps of the paths of a chunk, first those along range, from half of the width of a row on those along velocity. Rows
/// are as wide as the kernel needs, for a row to stay within lines of the cache.
#[repr(align(64))]
pub struct Room<T>([T; CHUNK * MAX_TAPS]);

/// The points of a chunk of paths, to be spread.
pub struct Patches<'a, T> {
    level: Level,
    /// Cells of the kernel.
    pub width: usize,
    layout: &'a Layout,
    terms: &'a [Term],
    points: &'a Points<T>,
    table: &'a [T],
    room: &'a mut Room<T>,
    grid: &'a mut [T],
}

impl<T: Widths> Patches<'_, T> {
    /// Add them, with a kernel of `W` cells, `N` vectors per row. Paths that follow each other in one cell are merged in
    /// registers if `MERGES`.
    pub fn add<const W: usize, const N: usize, const MERGES: bool>(self) {
        if self.layout.rows > 1 {
            self.level.run(Spread::<T, W, W, N, MERGES>(self));
        } else {
            self.level.run(Spread::<T, W, 1, N, MERGES>(self));
        }
    }
}

/// Spreads points with a kernel of `W` cells over `R` rows.
struct Spread<'a, T, const W: usize, const R: usize, const N: usize, const MERGES: bool>(Patches<'a, T>);

impl<T: Widths, const W: usize, const R: usize, const N: usize, const MERGES: bool> Kernel
    for Spread<'_, T, W, R, N, MERGES>
{
    type Output = ();

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(self) {
        let Patches {
            layout,
            terms,
            points,
            table,
            room,
            grid,
            ..
        } = self.0;
        let len = points.len.min(CHUNK);
        let half = half(W);
        let taps = &mut room.0[..CHUNK * 2 * half];
        let mut repeats = 0;
        for path in 1..len {
            repeats += usize::from(points.start[path] == points.start[path - 1]);
        }
        for term in 0..terms.len() {
            let (re, im) = points.strengths(term, &terms[term]);
            let grid = &mut grid[term * layout.size()..][..layout.size()];
            if MERGES && 2 * repeats > len {
                let mut path = 0;
                while path < len {
                    let start = points.start[path];
                    let mut patch = [[<T::In<I>>::splat(T::zero()); N]; R];
                    while path < len && points.start[path] == start {
                        let taps = &mut taps[path * 2 * half..][..2 * half];
                        if term == 0 {
                            evaluate_taps::<T, I, W, R>(table, points.zx[path], points.zy[path], taps);
                        }
                        let value = weighted::<T, I, N>(taps, re[path], im[path]);
                        for j in 0..R {
                            let tap = <T::In<I>>::splat(if R == 1 { T::one() } else { taps[half + j] });
                            for i in 0..N {
                                patch[j][i] = tap.mul_add(value[i], patch[j][i]);
                            }
                        }
                        path += 1;
                    }
                    add_patch(grid, start as usize, layout.stride, &patch);
                }
            } else {
                for path in 0..len {
                    let taps = &mut taps[path * 2 * half..][..2 * half];
                    if term == 0 {
                        evaluate_taps::<T, I, W, R>(table, points.zx[path], points.zy[path], taps);
                    }
                    let value = weighted::<T, I, N>(taps, re[path], im[path]);
                    let start = points.start[path] as usize;
                    if R == 1 {
                        add_patch(grid, start, layout.stride, &[value]);
                    } else {
                        add_rows::<_, R, N>(grid, start, layout.stride, &taps[half..], &value);
                    }
                }
            }
        }
    }
}

/// Lanes of the taps of one axis: one vector of single precision holds both axes.
const fn half(width: usize) -> usize {
    width.next_multiple_of(8)
}

/// Taps of a path along range times its strength.
#[inline(always)]
fn weighted<T: Widths, I: Isa, const N: usize>(taps: &[T], re: T, im: T) -> [T::In<I>; N] {
    let lanes = <T::In<I> as Vector>::LANES;
    let strength = <T::In<I>>::alternate(re, im);
    let mut value = [strength; N];
    for i in 0..N.div_ceil(2) {
        let [low, high] = <T::In<I>>::load(&taps[i * lanes..]).pairs();
        value[2 * i] = low.mul(strength);
        if 2 * i + 1 < N {
            value[2 * i + 1] = high.mul(strength);
        }
    }
    value
}

/// Taps of a path along range, and along velocity if there is more than one row.
#[inline(always)]
fn evaluate_taps<T: Widths, I: Isa, const W: usize, const R: usize>(table: &[T], x: T, y: T, taps: &mut [T]) {
    let (lanes, half) = (<T::In<I> as Vector>::LANES, half(W));
    if lanes == 2 * half {
        horner::<T, I, W>(table, 0, <T::In<I>>::halves(x, y)).store(taps);
        return;
    }
    for first in (0..half).step_by(lanes) {
        horner::<T, I, W>(table, first, <T::In<I>>::splat(x)).store(&mut taps[first..]);
        if R > 1 {
            horner::<T, I, W>(table, half + first, <T::In<I>>::splat(y)).store(&mut taps[half + first..]);
        }
    }
}

/// The polynomials of the cells from `first` on.
#[inline(always)]
fn horner<T: Widths, I: Isa, const W: usize>(table: &[T], first: usize, z: T::In<I>) -> T::In<I> {
    let stride = 2 * half(W);
    let table = &table[..(degree(W) + 1) * stride];
    let mut tap = <T::In<I>>::load(&table[degree(W) * stride + first..]);
    for power in (0..degree(W)).rev() {
        tap = tap.mul_add(z, <T::In<I>>::load(&table[power * stride + first..]));
    }
    tap
}
