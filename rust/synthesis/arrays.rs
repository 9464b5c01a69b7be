//! Source of paths whose delays and amplitudes are arrays.

use num_complex::Complex64;

use crate::error::Error;
use crate::numeric::simd::{Isa, Kernel, Precision, Real};
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
}

impl<'a> ArrayPaths<'a> {
    /// Static paths and moving paths, where it is worth while to tell them apart; else all together.
    pub fn split(arrays: &'a PathSeries<'a>) -> Vec<Self> {
        let all = |is_static| {
            vec![Self {
                arrays,
                numbers: None,
                is_static,
            }]
        };
        if arrays.num_terms() == 1 || arrays.num_paths == 0 {
            return all(true);
        }
        let Some(moves) = moves(arrays) else {
            return all(false);
        };
        if moves.iter().all(|moves| !moves) {
            return all(true);
        }
        let list = |is_static: bool| {
            let numbers = (0..moves.len()).filter(|path| moves[*path] != is_static);
            Self {
                arrays,
                numbers: Some(numbers.map(|path| path as u32).collect()),
                is_static,
            }
        };
        vec![list(true), list(false)]
    }

    fn fill<T: Precision>(&self, request: &Request, chunk: &mut Chunk<T>, num_amplitudes: usize) {
        request.level.run(FillChunk {
            paths: self,
            request,
            num_amplitudes,
            chunk,
        });
    }
}

impl PathSource for ArrayPaths<'_> {
    fn shape(&self) -> Shape {
        let rows = |all: usize| if self.is_static { 1 } else { all };
        Shape {
            channels: self.arrays.num_channels,
            paths: self.numbers.as_ref().map_or(self.arrays.num_paths, Vec::len),
            delay_rows: rows(self.arrays.num_delay_terms()),
            amplitude_rows: rows(self.arrays.num_amplitude_terms()),
            basis: self.arrays.basis,
        }
    }

    fn scale(&self) -> f64 {
        let largest = largest(self.arrays);
        if largest > 0.0 {
            // The scale and its inverse are both finite.
            (-largest.log2().round()).clamp(-1000.0, 1000.0).exp2()
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
            let got = format!("{:e}", largest(self.arrays));
            Error::value("amplitude", "squares that are finite numbers", got)
        };
        self.arrays.check_numbers().err().unwrap_or_else(too_large)
    }
}

/// Largest real or imaginary part of the amplitudes at a time of the frame; at all times if they are zero there.
pub fn largest(arrays: &PathSeries) -> f64 {
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

/// True for every path whose delay or amplitude changes in any channel; none if too few do not.
fn moves(arrays: &PathSeries) -> Option<Vec<bool>> {
    let num_paths = arrays.num_paths;
    let is_few = |num_static: usize| WORTHWHILE * num_static <= num_paths;
    if arrays.basis == Basis::Taylor && arrays.num_channels == 1 && arrays.delay.len() > 1 {
        // At a glance.
        let num_static: u64 = arrays.delay[1].iter().map(|rate| u64::from(*rate == 0.0)).sum();
        if is_few(num_static as usize) {
            return None;
        }
    }
    let mut moves = vec![false; num_paths];
    let is_worthwhile = |moves: &[bool]| !is_few(moves.iter().filter(|moves| !**moves).count());
    // The first row after the first tells for nearly all paths.
    for row in &arrays.delay[1..] {
        for (row, first) in row.chunks(num_paths).zip(arrays.delay[0].chunks(num_paths)) {
            for (moves, (value, first)) in moves.iter_mut().zip(row.iter().zip(first)) {
                *moves |= match arrays.basis {
                    Basis::Chebyshev => value != first,
                    Basis::Taylor => *value != 0.0,
                };
            }
        }
        if !is_worthwhile(&moves) {
            return None;
        }
    }
    for row in &arrays.amplitude[1..] {
        for (row, first) in row.chunks(num_paths).zip(arrays.amplitude[0].chunks(num_paths)) {
            for (moves, (value, first)) in moves.iter_mut().zip(row.iter().zip(first)) {
                *moves |= value != first;
            }
        }
    }
    is_worthwhile(&moves).then_some(moves)
}

/// Filling of a chunk with paths of arrays.
struct FillChunk<'a, T> {
    paths: &'a ArrayPaths<'a>,
    request: &'a Request,
    /// Rows of amplitudes to fill.
    num_amplitudes: usize,
    chunk: &'a mut Chunk<T>,
}

impl<T: Precision> Kernel for FillChunk<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) {
        let Self {
            paths,
            request,
            num_amplitudes,
            chunk,
        } = self;
        let (arrays, shape) = (paths.arrays, paths.shape());
        let places = &request.paths;
        chunk.num_paths = places.len();
        let numbers = paths.numbers.as_ref().map(|numbers| &numbers[places.clone()]);
        let is_difference = arrays.basis == Basis::Chebyshev;
        for (at, channel) in request.channels.clone().enumerate() {
            let first = channel * arrays.num_paths;
            for j in 0..shape.delay_rows {
                let row = &arrays.delay[j][first..first + arrays.num_paths];
                let (before, lane) = chunk.delay.split_at_mut(at * shape.delay_rows + j);
                copy(row, places.start, numbers, &mut lane[0], chunk.num_paths);
                if j > 0 && is_difference {
                    subtract(&mut lane[0], &before[at * shape.delay_rows]);
                }
            }
            for j in 0..num_amplitudes {
                let row = &arrays.amplitude[j][first..first + arrays.num_paths];
                let base = &arrays.amplitude[0][first..first + arrays.num_paths];
                let lane = at * shape.amplitude_rows + j;
                let (re, im) = (&mut chunk.re[lane], &mut chunk.im[lane]);
                if j == 0 && numbers.is_none() {
                    let row = &row[places.clone()];
                    for i in 0..row.len().min(CHUNK) {
                        re[i] = T::of(row[i].re * request.scale);
                        im[i] = T::of(row[i].im * request.scale);
                    }
                } else {
                    for i in 0..places.len().min(CHUNK) {
                        let path = if let Some(numbers) = numbers {
                            numbers[i] as usize
                        } else {
                            places.start + i
                        };
                        let less = if j == 0 { Complex64::ZERO } else { base[path] };
                        re[i] = T::of((row[path].re - less.re) * request.scale);
                        im[i] = T::of((row[path].im - less.im) * request.scale);
                    }
                }
                for i in places.len()..CHUNK {
                    (re[i], im[i]) = (T::zero(), T::zero());
                }
            }
        }
    }
}

/// Copy numbers of a row to the first `len` entries of a lane, and the last of them to the rest.
#[cfg_attr(optimised, inline(always))]
fn copy(row: &[f64], start: usize, numbers: Option<&[u32]>, lane: &mut Lane<f64>, len: usize) {
    if let Some(numbers) = numbers {
        for i in 0..len {
            lane[i] = row[numbers[i] as usize];
        }
    } else {
        lane[..len].copy_from_slice(&row[start..start + len]);
    }
    let last = lane[len - 1];
    for i in len..CHUNK {
        lane[i] = last;
    }
}

#[cfg_attr(optimised, inline(always))]
fn subtract<T: Real>(lane: &mut Lane<T>, first: &Lane<T>) {
    for i in 0..CHUNK {
        lane[i] = lane[i] - first[i];
    }
}
