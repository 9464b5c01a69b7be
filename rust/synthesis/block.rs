//! Blocks of chirps, and the Chebyshev series of delays and amplitudes of a chunk of paths in one of them.
//!
//! Within a block, time runs as `x = (T - center) / half` from -1 to 1; delay and amplitude of a path are
//! `sum_k c_k T_k(x)`. The coefficients follow from what the caller gave, values at the nodes of the frame or
//! derivatives at its start, by one small matrix per block: exactly, as both are polynomials.

use std::ops::Range;

use num_complex::Complex64;

use crate::numeric::chebyshev::chebyshev_matrix;
use crate::numeric::simd::{Isa, Vector};
use crate::numeric::wide::{self, Wide};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::{Basis, PathSeries, basis_values};

/// Paths per chunk, processed together: their numbers stay in the L1 cache.
pub const CHUNK: usize = 128;

/// One number per path of a chunk.
pub type Lane = [f64; CHUNK];

/// One number per path of a chunk, in single precision.
pub type SingleLane = [f32; CHUNK];

/// Consecutive chirps, and the interval of time about its centre in which their samples lie.
#[derive(Clone, Debug)]
pub struct Block {
    /// Indices of the chirps.
    pub chirps: Range<usize>,
    /// Centre of the interval, after the start of the frame [s].
    pub center: f64,
    /// Half of the length of the interval [s], positive.
    pub half: f64,
    /// Matrix (degree, row) from the rows of a series to the coefficients of the delay, see [`coefficient`].
    pub delay: Vec<Vec<f64>>,
    /// Matrix (degree, row) of the amplitude.
    pub amplitude: Vec<Vec<f64>>,
}

impl Block {
    /// Block of some chirps for series of the form of `series`.
    pub fn new(waveform: &Waveform, series: &PathSeries, chirps: Range<usize>) -> Self {
        let times = &waveform.chirp_times[chirps.clone()];
        let first = times.iter().copied().fold(f64::INFINITY, f64::min);
        let last = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let center = 0.5 * (first + last) + waveform.middle_time();
        let half = 0.5 * (last - first) + waveform.half_sweep();
        let matrix = |terms: usize| block_matrix(waveform, series.basis, terms, center, half);
        Self {
            chirps,
            center,
            half,
            delay: matrix(series.num_delay_terms()),
            amplitude: matrix(series.num_amplitude_terms()),
        }
    }

    /// Split of the frame into `count` blocks of nearly equal numbers of chirps.
    pub fn split(waveform: &Waveform, series: &PathSeries, count: usize) -> Vec<Self> {
        let num_chirps = waveform.chirp_times.len();
        let bound = |i: usize| i * num_chirps / count;
        (0..count)
            .map(|i| Self::new(waveform, series, bound(i)..bound(i + 1)))
            .collect()
    }

    /// Time of a sample in units of the block, -1 to 1.
    pub fn x(&self, time: f64) -> f64 {
        (time - self.center) / self.half
    }

    /// Time of the middle sample of a chirp of the block after the block's centre [s].
    pub fn offset(&self, waveform: &Waveform, chirp: usize) -> f64 {
        waveform.chirp_times[self.chirps.start + chirp] + waveform.middle_time() - self.center
    }
}

/// Matrix (degree, row) from the rows of a series to its Chebyshev coefficients on `center - half ..= center + half`.
///
/// Rows after the first act on differences from the first row where rows are values, see [`Rows`].
fn block_matrix(waveform: &Waveform, basis: Basis, terms: usize, center: f64, half: f64) -> Vec<Vec<f64>> {
    let to_block = chebyshev_matrix(terms);
    let to_frame = (basis == Basis::Chebyshev).then_some(&to_block);
    // Values of the frame's basis functions at the nodes of the block.
    let mut values = vec![vec![0.0; terms]; terms];
    for (j, row) in values.iter_mut().enumerate() {
        let x = -(std::f64::consts::PI * (2 * j + 1) as f64 / (2 * terms) as f64).cos();
        basis_values(basis, waveform, center + half * x, row);
    }
    (0..terms)
        .map(|k| {
            let per_function: Vec<f64> = (0..terms)
                .map(|n| (0..terms).map(|j| to_block[k * terms + j] * values[j][n]).sum())
                .collect();
            match to_frame {
                None => per_function,
                Some(to_frame) => (0..terms)
                    .map(|row| (0..terms).map(|n| per_function[n] * to_frame[n * terms + row]).sum())
                    .collect(),
            }
        })
        .collect()
}

/// Class of paths, by their motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Still paths: delay and amplitude never change.
    Still,
    /// Moving paths: all others.
    Moving,
    /// Selection of all paths.
    All,
}

impl Class {
    /// Name of the class: `still`, `moving` or `all`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Still => "still",
            Self::Moving => "moving",
            Self::All => "all",
        }
    }
}

/// Selection of the paths of a class.
#[derive(Clone, Copy, Debug)]
pub struct Selection<'a> {
    /// The class.
    pub class: Class,
    /// Bit masks of the moving paths, (channel, chunk).
    moving: &'a [u128],
    chunks_per_channel: usize,
}

impl<'a> Selection<'a> {
    /// Selection of all paths.
    pub const ALL: Selection<'static> = Selection {
        class: Class::All,
        moving: &[],
        chunks_per_channel: 0,
    };

    /// Selection of a class, by bit masks of the moving paths, (channel, chunk).
    pub fn new(class: Class, moving: &'a [u128], num_channels: usize) -> Self {
        Self {
            class,
            moving,
            chunks_per_channel: moving.len() / num_channels.max(1),
        }
    }

    /// Number of selected paths of a chunk.
    pub fn count(&self, series: &PathSeries, channel: usize, chunk: usize) -> usize {
        let len = CHUNK.min(series.num_paths - chunk * CHUNK);
        self.wanted(channel, chunk, len).count_ones() as usize
    }

    /// Index within a chunk of the selected path of some rank.
    pub fn place(&self, series: &PathSeries, channel: usize, chunk: usize, rank: usize) -> usize {
        let len = CHUNK.min(series.num_paths - chunk * CHUNK);
        let mut bits = self.wanted(channel, chunk, len);
        if bits == first_bits(len) {
            return rank;
        }
        for _ in 0..rank {
            bits &= bits - 1;
        }
        bits.trailing_zeros() as usize
    }

    /// Bit mask of the selected paths among the `len` of a chunk.
    fn wanted(&self, channel: usize, chunk: usize, len: usize) -> u128 {
        let all = first_bits(len);
        let moving = || self.moving[channel * self.chunks_per_channel + chunk];
        match self.class {
            Class::All => all,
            Class::Moving => moving() & all,
            Class::Still => !moving() & all,
        }
    }
}

/// Mask of the first `len` bits.
fn first_bits(len: usize) -> u128 {
    u128::MAX.checked_shr((CHUNK - len) as u32).unwrap_or(0)
}

/// Rows of the series of up to [`CHUNK`] paths of one channel.
pub struct Rows {
    /// Number of paths; lanes after the last path hold copies of it without amplitude.
    pub len: usize,
    /// Rows of the delays [s]; where rows are values, those after the first are differences from it.
    pub delay: Vec<Lane>,
    /// Real parts of the rows of the amplitudes, likewise [sqrt(W)].
    pub re: Vec<Lane>,
    /// Imaginary parts, as `re`.
    pub im: Vec<Lane>,
}

impl Rows {
    /// Memory for the rows of a series.
    pub fn new(series: &PathSeries) -> Self {
        Self::with(series.num_delay_terms(), series.num_amplitude_terms())
    }

    /// Memory for the rows that a class needs: one per quantity for still paths.
    pub fn of_class(series: &PathSeries, class: Class) -> Self {
        if class == Class::Still {
            Self::with(1, 1)
        } else {
            Self::new(series)
        }
    }

    /// Memory for delays alone.
    pub fn of_delays(series: &PathSeries) -> Self {
        Self::with(series.num_delay_terms(), 0)
    }

    fn with(num_delays: usize, num_amplitudes: usize) -> Self {
        let lanes = |n: usize| vec![[0.0; CHUNK]; n];
        Self {
            len: 0,
            delay: lanes(num_delays),
            re: lanes(num_amplitudes),
            im: lanes(num_amplitudes),
        }
    }

    /// Load the selected paths among the [`CHUNK`] from `first` on, in their order, into the rows that were allocated.
    #[cfg_attr(optimised, inline(always))] // part of kernels, see simd.rs
    pub fn gather(&mut self, series: &PathSeries, channel: usize, first: usize, selection: Selection) {
        let len = CHUNK.min(series.num_paths - first);
        let wanted = selection.wanted(channel, first / CHUNK, len);
        self.len = wanted.count_ones() as usize;
        if self.len == 0 {
            return;
        }
        let at = channel * series.num_paths + first;
        let is_difference = series.basis == Basis::Chebyshev;
        if self.len == len {
            for j in 0..self.delay.len() {
                copy(&series.delay[j][at..at + len], &mut self.delay, j, is_difference);
            }
            for j in 0..self.re.len() {
                copy_parts(&series.amplitude[j][at..at + len], &mut self.re, &mut self.im, j);
            }
        } else {
            let places = places(wanted);
            for j in 0..self.delay.len() {
                pick(
                    &series.delay[j][at..at + len],
                    &places[..self.len],
                    &mut self.delay,
                    j,
                    is_difference,
                );
            }
            for j in 0..self.re.len() {
                let row = &series.amplitude[j][at..at + len];
                pick_parts(row, &places[..self.len], &mut self.re, &mut self.im, j);
            }
        }
    }

    /// Mean over the rows of the squared magnitudes of the amplitudes, summed over paths [W].
    #[cfg_attr(optimised, inline(always))]
    pub fn power(&self) -> f64 {
        // Lanes after the last path have no amplitude, or that of rows before if there are no paths.
        if self.len == 0 {
            return 0.0;
        }
        let mut sums = [0.0; 16];
        for lanes in [&self.re, &self.im] {
            for j in 0..lanes.len() {
                for at in (0..CHUNK).step_by(16) {
                    for i in 0..16 {
                        let first = if j == 0 { 0.0 } else { lanes[0][at + i] };
                        let value = first + lanes[j][at + i];
                        sums[i] += value * value;
                    }
                }
            }
        }
        sums.iter().sum::<f64>() / self.re.len() as f64
    }

    /// Bit mask of the paths that change.
    #[cfg_attr(optimised, inline(always))]
    pub fn moving(&self) -> u128 {
        let all = first_bits(self.len);
        let mut change = [0.0; CHUNK];
        add_changes(&self.delay, &mut change);
        let mut count = count_changed(&change);
        if count < CHUNK {
            add_changes(&self.re, &mut change);
            add_changes(&self.im, &mut change);
            count = count_changed(&change);
        }
        if count == 0 || count == CHUNK {
            return if count == 0 { 0 } else { all };
        }
        let mut bits = [0_u64; 2];
        for i in 0..CHUNK {
            bits[i / 64] |= u64::from(change[i] != 0.0) << (i % 64);
        }
        (u128::from(bits[0]) | u128::from(bits[1]) << 64) & all
    }
}

/// Add the absolute values of all lanes after the first.
#[cfg_attr(optimised, inline(always))]
fn add_changes(lanes: &[Lane], change: &mut Lane) {
    for j in 1..lanes.len() {
        for i in 0..CHUNK {
            change[i] += lanes[j][i].abs();
        }
    }
}

/// Number of lanes that are not zero.
#[cfg_attr(optimised, inline(always))]
fn count_changed(change: &Lane) -> usize {
    let mut count: u64 = 0;
    for i in 0..CHUNK {
        count += u64::from(change[i] != 0.0);
    }
    count as usize
}

/// Coefficient k of the paths from `at` on; coefficient 0 without the first row.
#[cfg_attr(optimised, inline(always))]
pub fn coefficient<I: Isa, const P: usize>(matrix: &[Vec<f64>], rows: &[Lane], k: usize, at: usize) -> Wide<I, P> {
    let mut sum = wide::splat::<I, P>(0.0);
    if let Some(factors) = matrix.get(k) {
        for j in 1..rows.len() {
            let row = wide::load::<I, P>(&rows[j][at..]);
            sum = wide::mul_add(row, wide::splat::<I, P>(factors[j]), sum);
        }
    }
    sum
}

/// Coefficients of delay and amplitude in a block, for up to [`CHUNK`] paths of one channel.
pub struct Chunk {
    /// Number of paths; lanes after the last path hold copies of it without amplitude.
    pub len: usize,
    /// Coefficients of the delay by degree [s].
    pub delay: Vec<Lane>,
    /// Real parts of the coefficients of the amplitude by degree [sqrt(W)].
    pub re: Vec<Lane>,
    /// Imaginary parts, as `re`.
    pub im: Vec<Lane>,
    rows: Rows,
}

impl Chunk {
    /// Memory for all degrees of a series.
    pub fn new(series: &PathSeries) -> Self {
        let rows = Rows::new(series);
        Self {
            len: 0,
            delay: rows.delay.clone(),
            re: rows.re.clone(),
            im: rows.im.clone(),
            rows,
        }
    }

    /// Load the selected paths among the [`CHUNK`] from `first` on, in their order.
    ///
    /// Coefficients are formed from differences to the first row, which keeps small changes exact and constants
    /// constant.
    #[cfg_attr(optimised, inline(always))] // part of kernels, see simd.rs
    pub fn load<I: Isa>(
        &mut self,
        series: &PathSeries,
        channel: usize,
        first: usize,
        block: &Block,
        selection: Selection,
    ) {
        self.rows.gather(series, channel, first, selection);
        self.len = self.rows.len;
        expand::<I>(&block.delay, &self.rows.delay, &mut self.delay);
        expand::<I>(&block.amplitude, &self.rows.re, &mut self.re);
        expand::<I>(&block.amplitude, &self.rows.im, &mut self.im);
    }

    /// Bit mask of the paths that change.
    #[cfg_attr(optimised, inline(always))]
    pub fn moving(&self) -> u128 {
        self.rows.moving()
    }
}

/// Coefficients of all degrees from rows: values at the first node, and differences to them at the others.
#[cfg_attr(optimised, inline(always))]
pub fn expand<I: Isa>(matrix: &[Vec<f64>], rows: &[Lane], coefficients: &mut [Lane]) {
    // Four vectors at once, as every sum waits for the one before.
    for k in 0..coefficients.len() {
        for at in (0..CHUNK).step_by(32) {
            let mut sum = coefficient::<I, 4>(matrix, rows, k, at);
            if k == 0 {
                sum = wide::add(sum, wide::load::<I, 4>(&rows[0][at..]));
            }
            wide::store(sum, &mut coefficients[k][at..]);
        }
    }
}

/// Coefficients as [`expand`], in single precision.
#[cfg_attr(optimised, inline(always))]
pub fn expand_single<I: Isa>(matrix: &[Vec<f64>], rows: &[SingleLane], coefficients: &mut [SingleLane]) {
    for k in 0..coefficients.len() {
        for at in (0..CHUNK).step_by(I::F32::LANES) {
            let zero = I::F32::splat(0.0);
            let mut sum = if k == 0 { I::F32::load(&rows[0][at..]) } else { zero };
            for j in 1..rows.len() {
                let factor = I::F32::splat(matrix[k][j] as f32);
                sum = I::F32::load(&rows[j][at..]).mul_add(factor, sum);
            }
            sum.store(&mut coefficients[k][at..]);
        }
    }
}

/// Indices of the bits that are set.
#[cfg_attr(optimised, inline(always))]
fn places(mut bits: u128) -> [u8; CHUNK] {
    let mut places = [0; CHUNK];
    let mut count = 0;
    while bits != 0 && count < CHUNK {
        places[count] = bits.trailing_zeros() as u8;
        count += 1;
        bits &= bits - 1;
    }
    places
}

/// Lane j, and the first one if `j > 0`.
#[cfg_attr(optimised, inline(always))]
fn lane_and_first(lanes: &mut [Lane], j: usize) -> (&mut Lane, Option<&Lane>) {
    let (before, from) = lanes.split_at_mut(j);
    (&mut from[0], before.first())
}

/// Copy some numbers of a row into lane j, less the first lane if it `is_difference`; repeat the last number.
#[cfg_attr(optimised, inline(always))]
fn pick(row: &[f64], places: &[u8], lanes: &mut [Lane], j: usize, is_difference: bool) {
    let (lane, first) = lane_and_first(lanes, j);
    let first = if is_difference { first } else { None };
    let mut last = 0.0;
    for i in 0..places.len().min(CHUNK) {
        last = row[usize::from(places[i])] - first.map_or(0.0, |first| first[i]);
        lane[i] = last;
    }
    lane[places.len()..].fill(last);
}

/// Copy the real and imaginary parts of some numbers of a row, less the first lane; zeros after them.
#[cfg_attr(optimised, inline(always))]
fn pick_parts(row: &[Complex64], places: &[u8], re: &mut [Lane], im: &mut [Lane], j: usize) {
    let ((re, first_re), (im, first_im)) = (lane_and_first(re, j), lane_and_first(im, j));
    (*re, *im) = ([0.0; CHUNK], [0.0; CHUNK]);
    for i in 0..places.len().min(CHUNK) {
        let a = row[usize::from(places[i])];
        re[i] = a.re - first_re.map_or(0.0, |first| first[i]);
        im[i] = a.im - first_im.map_or(0.0, |first| first[i]);
    }
}

/// Copy a row into lane j, less the first lane if it `is_difference`; repeat the last number.
#[cfg_attr(optimised, inline(always))]
fn copy(row: &[f64], lanes: &mut [Lane], j: usize, is_difference: bool) {
    let (lane, first) = lane_and_first(lanes, j);
    match (<&Lane>::try_from(row), first) {
        (Ok(row), Some(first)) if is_difference => {
            for i in 0..CHUNK {
                lane[i] = row[i] - first[i];
            }
        }
        (Ok(row), _) => *lane = *row,
        (Err(_), first) => {
            let last = row.len() - 1;
            for i in 0..CHUNK {
                let less = if is_difference {
                    first.map_or(0.0, |first| first[i])
                } else {
                    0.0
                };
                lane[i] = row[i.min(last)] - less;
            }
        }
    }
}

/// Copy the real and imaginary parts of a row, less the first lane; zeros after its end.
#[cfg_attr(optimised, inline(always))]
fn copy_parts(row: &[Complex64], re: &mut [Lane], im: &mut [Lane], j: usize) {
    let ((re, first_re), (im, first_im)) = (lane_and_first(re, j), lane_and_first(im, j));
    match (<&[Complex64; CHUNK]>::try_from(row), first_re, first_im) {
        (Ok(row), Some(first_re), Some(first_im)) => {
            for i in 0..CHUNK {
                re[i] = row[i].re - first_re[i];
                im[i] = row[i].im - first_im[i];
            }
        }
        (Ok(row), ..) => {
            for i in 0..CHUNK {
                re[i] = row[i].re;
                im[i] = row[i].im;
            }
        }
        (Err(_), ..) => {
            (*re, *im) = ([0.0; CHUNK], [0.0; CHUNK]);
            for i in 0..row.len().min(CHUNK) {
                re[i] = row[i].re - first_re.map_or(0.0, |first| first[i]);
                im[i] = row[i].im - first_im.map_or(0.0, |first| first[i]);
            }
        }
    }
}

#[cfg(test)]
mod tests;
