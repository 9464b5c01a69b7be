//! Source of paths whose delays and amplitudes are arrays.

use std::ops::Range;

use num_complex::Complex64;

use crate::error::Error;
use crate::numeric::simd::{Precision, prefetch};
use crate::synthesis::chunk::{CHUNK, Chunk, Lane};
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::source::{PathSource, Request, Shape};

/// Static paths are summed by themselves from this share of all paths on: a second pass must be worth its cost.
const WORTHWHILE: usize = 16;

/// All paths of some arrays, or the paths of a list.
pub struct ArrayPaths<'a> {
    arrays: &'a PathSeries<'a>,
    /// Numbers of the paths; none for all of them.
    numbers: Option<Vec<u32>>,
    is_static: bool,
    /// Largest part of an amplitude, see [`largest`].
    largest: f64,
}

impl<'a> ArrayPaths<'a> {
    /// Static paths and moving paths, if it is worth while to separate them; else all paths.
    pub fn split(arrays: &'a PathSeries<'a>) -> Vec<Self> {
        let largest = largest(arrays);
        let list = |numbers: Option<Vec<u32>>, is_static| Self {
            arrays,
            numbers,
            is_static,
            largest,
        };
        if arrays.delay.len().max(arrays.amplitude.len()) == 1 || arrays.num_paths == 0 {
            return vec![list(None, true)];
        }
        let Some(moves) = moves(arrays) else {
            return vec![list(None, false)];
        };
        if !moves.contains(&true) {
            return vec![list(None, true)];
        }
        let numbers = |is_static| {
            let all = moves.iter().zip(0..).filter(|(moves, _)| **moves != is_static);
            list(Some(all.map(|(_, number)| number).collect()), is_static)
        };
        vec![numbers(true), numbers(false)]
    }

    /// Fill a chunk, with some rows of amplitudes.
    fn fill<T: Precision>(&self, request: &Request, chunk: &mut Chunk<T>, num_amplitudes: usize) {
        request.level.run_loops(
            #[inline(always)]
            || self.fill_rows(request, chunk, num_amplitudes),
        );
    }

    #[cfg_attr(optimised, inline(always))] // part of a kernel
    fn fill_rows<T: Precision>(&self, request: &Request, chunk: &mut Chunk<T>, num_amplitudes: usize) {
        let (arrays, shape, places) = (self.arrays, self.shape(), &request.paths);
        let numbers = self.numbers.as_ref().map(|numbers| &numbers[places.clone()]);
        let are_values = arrays.basis == Basis::Chebyshev;
        chunk.num_paths = places.len();
        for (at, channel) in request.channels.clone().enumerate() {
            let first = channel * arrays.num_paths;
            let rows = &mut chunk.delay[at * shape.delay_rows..][..shape.delay_rows];
            for j in 0..shape.delay_rows {
                let from = &arrays.delay[j][first..][..arrays.num_paths];
                copy(from, places, numbers, &mut rows[j]);
                let last = rows[j][places.len() - 1];
                rows[j][places.len()..].fill(last);
                if j > 0 && are_values {
                    for i in 0..CHUNK {
                        rows[j][i] -= rows[0][i];
                    }
                }
            }
            for j in 0..num_amplitudes {
                let [from, start] = [j, 0].map(|j| &arrays.amplitude[j][first..][..arrays.num_paths]);
                let at = at * shape.amplitude_rows + j;
                let (re, im) = (&mut chunk.re[at], &mut chunk.im[at]);
                for i in 0..places.len().min(CHUNK) {
                    let path = numbers.map_or(places.start + i, |numbers| numbers[i] as usize);
                    let less = if j == 0 { Complex64::ZERO } else { start[path] };
                    re[i] = T::of((from[path].re - less.re) * request.scale);
                    im[i] = T::of((from[path].im - less.im) * request.scale);
                }
                re[places.len()..].fill(T::zero());
                im[places.len()..].fill(T::zero());
            }
            if shape.delay_rows > 2 && numbers.is_none() {
                // Many rows are read in turns, so that the processor does not foresee the next chunk.
                let next = first + places.end;
                let delays = arrays.delay.iter().filter_map(|row| row[next..].first_chunk::<CHUNK>());
                delays.for_each(prefetch);
                let amplitudes = arrays
                    .amplitude
                    .iter()
                    .filter_map(|row| row[next..].first_chunk::<CHUNK>());
                amplitudes.for_each(prefetch);
            }
        }
    }
}

impl PathSource for ArrayPaths<'_> {
    fn shape(&self) -> Shape {
        let rows = |all: usize| if self.is_static { 1 } else { all };
        Shape {
            channels: self.arrays.num_channels,
            paths: self.numbers.as_ref().map_or(self.arrays.num_paths, Vec::len),
            delay_rows: rows(self.arrays.delay.len()),
            amplitude_rows: rows(self.arrays.amplitude.len()),
            basis: self.arrays.basis,
        }
    }

    fn scale(&self) -> f64 {
        if self.largest > 0.0 {
            // The scale and its inverse are both finite.
            (-self.largest.log2().round()).clamp(-1000.0, 1000.0).exp2()
        } else {
            1.0
        }
    }

    fn fill_single(&self, request: &Request, chunk: &mut Chunk<f32>) {
        self.fill(request, chunk, self.shape().amplitude_rows);
    }

    fn fill_double(&self, request: &Request, chunk: &mut Chunk<f64>) {
        self.fill(request, chunk, self.shape().amplitude_rows);
    }

    fn fill_delays(&self, request: &Request, chunk: &mut Chunk<f64>) {
        self.fill(request, chunk, 0);
    }

    fn not_finite(&self) -> Error {
        let too_large = || {
            let got = format!("{:e}", self.largest);
            Error::value("amplitude", "squares that are finite numbers", got)
        };
        self.arrays.check_numbers().err().unwrap_or_else(too_large)
    }
}

/// Largest real or imaginary part of the amplitudes at a time of the frame; at all times if they are zero there.
fn largest(arrays: &PathSeries) -> f64 {
    let of_row = |row: &&[Complex64]| {
        // Several at once, as each waits for the one before.
        let mut most = [0.0_f64; 8];
        for some in row.chunks(8) {
            for (most, a) in most.iter_mut().zip(some) {
                *most = most.max(a.re.abs()).max(a.im.abs());
            }
        }
        most.into_iter().fold(0.0, f64::max)
    };
    let middle = of_row(&arrays.amplitude[arrays.amplitude.len() / 2]);
    if middle > 0.0 {
        middle
    } else {
        arrays.amplitude.iter().map(of_row).fold(0.0, f64::max)
    }
}

/// True for every path whose delay or amplitude changes in any channel; none if few of them do not.
fn moves(arrays: &PathSeries) -> Option<Vec<bool>> {
    let are_many = |num_static: usize| WORTHWHILE * num_static > arrays.num_paths;
    let changes = |value: &f64, first: &f64| match arrays.basis {
        Basis::Chebyshev => value != first,
        Basis::Taylor => *value != 0.0,
    };
    if let Some(row) = arrays.delay.get(1) {
        // At a glance: the first row after the first tells for nearly all paths, in any channel.
        let values = row.iter().zip(arrays.delay[0]).take(arrays.num_paths);
        let num_static: usize = values.map(|(value, first)| usize::from(!changes(value, first))).sum();
        if !are_many(num_static) {
            return None;
        }
    }
    let mut moves = vec![false; arrays.num_paths];
    for row in &arrays.delay[1..] {
        mark(&mut moves, row, arrays.delay[0], changes);
    }
    for row in &arrays.amplitude[1..] {
        mark(&mut moves, row, arrays.amplitude[0], |value, first| value != first);
    }
    are_many(moves.iter().filter(|moves| !**moves).count()).then_some(moves)
}

/// Mark the paths whose number in a row differs from their number in the first row, in any channel.
fn mark<N>(moves: &mut [bool], row: &[N], first: &[N], changes: impl Fn(&N, &N) -> bool) {
    let num_paths = moves.len();
    for (row, first) in row.chunks(num_paths).zip(first.chunks(num_paths)) {
        for (moves, (value, first)) in moves.iter_mut().zip(row.iter().zip(first)) {
            *moves |= changes(value, first);
        }
    }
}

/// Copy numbers of a row: at some places, or of the paths of a list.
#[cfg_attr(optimised, inline(always))]
fn copy<N: Copy>(row: &[N], places: &Range<usize>, numbers: Option<&[u32]>, to: &mut Lane<N>) {
    if let Some(numbers) = numbers {
        for i in 0..numbers.len().min(CHUNK) {
            to[i] = row[numbers[i] as usize];
        }
    } else {
        to[..places.len()].copy_from_slice(&row[places.clone()]);
    }
}
