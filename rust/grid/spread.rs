//! Paths are spread on the grid, each over a patch of cells.

use std::ops::Range;

use super::place::{Map, Points, Tracks};
use super::{Job, Layout, Widths};
use crate::block::{CHUNK, Rows};
use crate::kernel::{KaiserBessel, degree, tap_table};
use crate::simd::{Isa, Kernel, Level, Vector, add_patch, add_rows};

/// How far the residuals of paths are from their interpolation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Checked {
    /// Sum over paths of squared distances, the mean over the checks.
    pub sum: f64,
    /// Chunk with the largest share, and that share.
    pub worst: (usize, f64),
}

impl Checked {
    /// With the sums of other chunks.
    pub fn join(self, other: Self) -> Self {
        Self {
            sum: self.sum + other.sum,
            worst: if other.worst.1 > self.worst.1 {
                other.worst
            } else {
                self.worst
            },
        }
    }
}

/// Spread the paths of some chunks.
pub fn spread_chunks<T: Widths>(job: &Job, layout: &Layout, chunks: Range<usize>, grid: &mut [T]) -> Checked {
    let is_sorted = is_sorted::<T>(job, layout);
    // Sorting wants many paths; their taps take 128 kB, half of L1 if it does not.
    let room_for_taps = if is_sorted { 1 << 17 } else { 1 << 14 };
    let batch = (room_for_taps / (2 * half(job.width) * size_of::<T>() * CHUNK)).max(1);
    let mut rows = Rows::of_class(job.series, job.selection.class);
    let mut tracks = Tracks::new(job);
    let mut points = Points::new(job.expansion.modes.num_sets(), batch * CHUNK);
    let map = Map::new(job, layout);
    let table = tap_table::<T>(&KaiserBessel::new(job.width), half(job.width));
    let mut room = Room::new(batch * CHUNK, 2 * half(job.width));
    let mut checked = Checked::default();
    for first in chunks.clone().step_by(batch) {
        points.len = 0;
        for index in first..chunks.end.min(first + batch) {
            let sum = T::place(job, &map, index * CHUNK, &mut rows, &mut tracks, &mut points);
            checked = checked.join(Checked {
                sum,
                worst: (index, sum),
            });
        }
        room.order(&points, layout, is_sorted);
        T::add_points(Patches {
            level: job.level,
            width: job.width,
            layout,
            points: &points,
            table: &table,
            room: &mut room,
            grid,
        });
    }
    checked
}

/// Grids of this many bytes stay in L1.
const FAST_MEMORY: usize = 1 << 15;

/// Bytes of a column of a path's patches, over all modes, from which on sorting pays.
const MIN_BYTES: usize = 56;

/// Whether paths are sorted by cell: it pays where a path adds to many of them.
fn is_sorted<T>(job: &Job, layout: &Layout) -> bool {
    layout.rows > 1
        && layout.size() * size_of::<T>() > FAST_MEMORY
        && job.expansion.modes.num_sets() * job.width * size_of::<T>() >= MIN_BYTES
}

/// What is known of the paths of a batch in the order in which they are spread.
pub struct Room<T> {
    /// Numbers of the paths.
    order: Vec<u16>,
    /// Where their patches start.
    start: Vec<u32>,
    /// Taps, first those along range, from half of the width of a path's lanes on those along velocity.
    taps: Vec<T>,
    /// The same, by column alone.
    by_column: Vec<u16>,
    /// Places in the order by a key.
    ends: Vec<usize>,
}

impl<T: Widths> Room<T> {
    fn new(num_paths: usize, lanes: usize) -> Self {
        Self {
            order: vec![0; num_paths],
            by_column: vec![0; num_paths],
            start: vec![0; num_paths],
            taps: vec![T::zero(); num_paths * lanes],
            ends: Vec::new(),
        }
    }

    /// Choose the order of the paths: by cell, which keeps the rows at work in L1 and brings paths of one cell together, or
    /// as they are if they are so by themselves.
    fn order(&mut self, points: &Points<T>, layout: &Layout, is_sorted: bool) {
        let len = points.len;
        let (row, start) = (&points.row[..len], &points.start[..len]);
        let repeats = start.windows(2).filter(|pair| pair[0] == pair[1]).count();
        if !is_sorted || 2 * repeats > len {
            for (i, order) in self.order[..len].iter_mut().enumerate() {
                *order = i as u16;
            }
            self.start[..len].copy_from_slice(start);
            return;
        }
        if points.strengths.len() == 1 {
            count(&mut self.ends, layout.rows, row.iter().map(|row| *row as usize));
            for i in 0..len {
                let at = &mut self.ends[row[i] as usize];
                self.order[*at] = i as u16;
                self.start[*at] = start[i];
                *at += 1;
            }
            return;
        }
        // Two passes of counting: by column, then by row.
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
            *at += 1;
        }
    }
}

/// Places of the first of every key in sorted order.
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

/// The points of a batch of paths, to be spread.
pub struct Patches<'a, T> {
    level: Level,
    /// Cells of the kernel.
    pub width: usize,
    layout: &'a Layout,
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
            points,
            table,
            room,
            grid,
            ..
        } = self.0;
        let (len, half) = (points.len, half(W));
        let (order, start) = (&room.order[..len], &room.start[..len]);
        let taps = &mut room.taps[..len * 2 * half];
        // One set of strengths needs the taps of a path once.
        let is_single = points.strengths.len() == 1;
        let step = if is_single { 0 } else { 2 * half };
        if !is_single {
            for i in 0..len {
                let (path, taps) = (usize::from(order[i]), &mut taps[i * step..][..2 * half]);
                evaluate_taps::<T, I, W, R>(table, points.zx[path], points.zy[path], taps);
            }
        }
        let mut repeats = 0;
        for i in 1..len {
            repeats += usize::from(start[i] == start[i - 1]);
        }
        // One grid after the other: the rows at work stay in L1.
        for mode in 0..points.strengths.len() {
            let (re, im) = &points.strengths[mode];
            let grid = &mut grid[mode * layout.size()..][..layout.size()];
            if MERGES && 2 * repeats > len {
                let mut i = 0;
                while i < len {
                    let cell = start[i];
                    let mut patch = [[<T::In<I>>::splat(T::zero()); N]; R];
                    while i < len && start[i] == cell {
                        let (path, taps) = (usize::from(order[i]), &mut taps[i * step..][..2 * half]);
                        if is_single {
                            evaluate_taps::<T, I, W, R>(table, points.zx[path], points.zy[path], taps);
                        }
                        let value = weighted::<T, I, N>(taps, re[path], im[path]);
                        for j in 0..R {
                            let tap = <T::In<I>>::splat(if R == 1 { T::one() } else { taps[half + j] });
                            for n in 0..N {
                                patch[j][n] = tap.mul_add(value[n], patch[j][n]);
                            }
                        }
                        i += 1;
                    }
                    add_patch(grid, cell as usize, layout.stride, &patch);
                }
            } else {
                for i in 0..len {
                    let (path, taps) = (usize::from(order[i]), &mut taps[i * step..][..2 * half]);
                    if is_single {
                        evaluate_taps::<T, I, W, R>(table, points.zx[path], points.zy[path], taps);
                    }
                    let value = weighted::<T, I, N>(taps, re[path], im[path]);
                    if R == 1 {
                        add_patch(grid, start[i] as usize, layout.stride, &[value]);
                    } else {
                        add_rows::<_, R, N>(grid, start[i] as usize, layout.stride, &taps[half..], &value);
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
