//! Chunks of paths: rows of their delays and amplitudes, and the Chebyshev series of these over a block of chirps.
//!
//! Within a block, time runs as `x = (T - center) / half` from -1 to 1; delay and amplitude of a path are
//! `sum_k c_k T_k(x)`. The coefficients follow from the rows of a source, values at the nodes of the frame or
//! derivatives at its start, by one small matrix per block: exactly, as both are polynomials.

use std::ops::Range;

use crate::numeric::chebyshev::{chebyshev_matrix, chebyshev_nodes};
use crate::numeric::simd::{Isa, Precision, Vector};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::{Basis, basis_values};

/// Numbers of channels, paths and rows of a source.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Number of channels.
    pub channels: usize,
    /// Paths per channel.
    pub paths: usize,
    /// Rows of the delay of a path.
    pub delay_rows: usize,
    /// Rows of the amplitude of a path.
    pub amplitude_rows: usize,
    /// Meaning of the rows.
    pub basis: Basis,
}

impl Shape {
    /// True if delays and amplitudes are constant.
    pub fn is_static(&self) -> bool {
        self.delay_rows == 1 && self.amplitude_rows == 1
    }

    /// True if there are few rows, and none grows outside the frame, where blocks of chirps, which are symmetric about
    /// middle samples, may end.
    pub fn is_smooth(&self, waveform: &Waveform) -> bool {
        let degree = self.delay_rows.max(self.amplitude_rows) - 1;
        let beyond = waveform.middle_time() + waveform.half_sweep() - waveform.sample_time(waveform.num_samples - 1);
        let growth = || (degree as f64 * (1.0 + 2.0 * beyond / waveform.duration()).max(1.0).acosh()).cosh();
        degree < MOST_ROWS && (degree == 0 || self.basis == Basis::Taylor || growth() <= MOST_GROWTH)
    }

    /// True if delays change at constant rates, and amplitudes do not change.
    pub fn has_constant_rates(&self) -> bool {
        self.delay_rows <= 2 && self.amplitude_rows == 1
    }
}

/// Most rows of delays or amplitudes that are summed by other engines than the oracle.
const MOST_ROWS: usize = 64;

/// Largest growth of a term of a series outside the frame, by which rounding grows as well.
const MOST_GROWTH: f64 = 1e3;

/// Paths per chunk, processed together: their numbers stay in the cache.
pub const CHUNK: usize = 128;

/// One number per path of a chunk.
pub type Lane<T> = [T; CHUNK];

/// Rows of up to [`CHUNK`] paths of some channels, `(channel, row)`: where rows are values at nodes, those after the
/// first are differences from it, which keeps small changes exact and constants constant.
pub struct Chunk<T> {
    /// Number of paths; lanes after the last path have its delay and no amplitude.
    pub num_paths: usize,
    /// Delays [s].
    pub delay: Vec<Lane<f64>>,
    /// Real parts of the amplitudes times a scale.
    pub re: Vec<Lane<T>>,
    /// Imaginary parts.
    pub im: Vec<Lane<T>>,
}

impl<T: Precision> Chunk<T> {
    /// Memory for paths of `num_channels` channels of a source.
    pub fn new(shape: &Shape, num_channels: usize) -> Self {
        Self {
            num_paths: 0,
            delay: vec![[0.0; CHUNK]; num_channels * shape.delay_rows],
            re: vec![[T::zero(); CHUNK]; num_channels * shape.amplitude_rows],
            im: vec![[T::zero(); CHUNK]; num_channels * shape.amplitude_rows],
        }
    }
}

/// Consecutive chirps, and the interval of time about its centre in which their samples lie.
#[derive(Clone, Debug)]
pub struct Block {
    /// Indices of the chirps.
    pub chirps: Range<usize>,
    /// Centre of the interval, after the start of the frame [s].
    pub center: f64,
    /// Half of the length of the interval [s], positive.
    pub half: f64,
    /// Matrix (degree, row) from the rows of a source to the coefficients of the delay, see [`expand`].
    pub delay: Vec<Vec<f64>>,
    /// Matrix (degree, row) of the amplitude.
    pub amplitude: Vec<Vec<f64>>,
}

impl Block {
    /// Block of some chirps for the rows of a source.
    pub fn new(waveform: &Waveform, shape: &Shape, chirps: Range<usize>) -> Self {
        let times = &waveform.chirp_times[chirps.clone()];
        let first = times.iter().copied().fold(f64::INFINITY, f64::min);
        let last = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let center = 0.5 * (first + last) + waveform.middle_time();
        let half = 0.5 * (last - first) + waveform.half_sweep();
        let matrix = |rows: usize| block_matrix(waveform, shape.basis, rows, center, half);
        Self {
            chirps,
            center,
            half,
            delay: matrix(shape.delay_rows),
            amplitude: matrix(shape.amplitude_rows),
        }
    }

    /// Time of a sample in units of the block, -1 to 1.
    pub fn x(&self, time: f64) -> f64 {
        (time - self.center) / self.half
    }
}

/// Matrix (degree, row) from the rows of a source to its Chebyshev coefficients on `center - half ..= center + half`.
fn block_matrix(waveform: &Waveform, basis: Basis, rows: usize, center: f64, half: f64) -> Vec<Vec<f64>> {
    let to_coefficients: Vec<Vec<f64>> = chebyshev_matrix(rows)
        .chunks(rows.max(1))
        .map(<[f64]>::to_vec)
        .collect();
    // Values of the frame's basis functions at the nodes of the block.
    let mut values = vec![vec![0.0; rows]; rows];
    for (x, of_node) in chebyshev_nodes(rows).into_iter().zip(&mut values) {
        basis_values(basis, waveform, center + half * x, of_node);
    }
    let per_function = product(&to_coefficients, &values);
    match basis {
        Basis::Taylor => per_function,
        Basis::Chebyshev => product(&per_function, &to_coefficients),
    }
}

/// Product of square matrices.
fn product(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let number = |row: &[f64], j: usize| row.iter().zip(b).map(|(x, b)| x * b[j]).sum();
    a.iter()
        .map(|row| (0..b.len()).map(|j| number(row, j)).collect())
        .collect()
}

/// Coefficients of degrees 0, 1, ... of a chunk of one channel from its rows; rows after the first are differences from it
/// or derivatives, and `matrix` has no weight for the first.
#[cfg_attr(optimised, inline(always))] // part of kernels, see simd.rs
pub fn expand<T: Precision, I: Isa>(matrix: &[Vec<f64>], rows: &[Lane<T>], coefficients: &mut [Lane<T>]) {
    const AT_ONCE: usize = 4; // as every sum waits for the one before
    let lanes = <T::In<I> as Vector>::LANES;
    for k in 0..coefficients.len() {
        for at in (0..CHUNK).step_by(AT_ONCE * lanes) {
            let mut sums = [<T::In<I>>::splat(T::zero()); AT_ONCE];
            for j in 1..rows.len() {
                let factor = <T::In<I>>::splat(T::of(matrix[k][j]));
                for i in 0..AT_ONCE {
                    sums[i] = <T::In<I>>::load(&rows[j][at + i * lanes..]).mul_add(factor, sums[i]);
                }
            }
            for i in 0..AT_ONCE {
                let place = at + i * lanes;
                if k == 0 {
                    sums[i] = sums[i].add(<T::In<I>>::load(&rows[0][place..]));
                }
                sums[i].store(&mut coefficients[k][place..]);
            }
        }
    }
}
