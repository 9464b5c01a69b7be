//! Sums of amplitudes over cells of range and velocity: bound of what paths can add up to, whatever their phases.
//!
//! A spreading kernel leaves aliases: samples of other times, a period of the grid away, times a small factor. Paths
//! whose phases are unrelated within the frame may add up there, as the echo of a plate does that faces the radar a
//! frame later. Paths of different cells cannot keep in phase for long: over any interval as long as the frame, the
//! energy of a sum is about that of its cells, each with the sum of its amplitudes (large sieve).

use crate::numeric::simd::Real;

/// Most cells along velocity and along range: what is finer is merged, which the bound allows.
const MOST_ROWS: usize = 64;
const MOST_COLUMNS: usize = 128;

/// Sums of amplitudes over cells of velocity and range of some paths of a channel; no memory before the first path.
#[derive(Clone, Debug, Default)]
pub struct Coherence {
    /// Cells along velocity, a power of two: at most one per turn of phase over the frame.
    rows: usize,
    /// Cells along range: at most one per turn of phase over a chirp.
    columns: usize,
    /// Rows per turn of phase over the frame.
    rows_per_turn: f64,
    /// Sums of amplitudes, (row, column).
    cells: Vec<f32>,
    /// Sum of the squares of amplitudes.
    squares: f64,
}

impl Coherence {
    /// Cells of a frame.
    pub fn new(num_chirps: usize, num_samples: usize) -> Self {
        let most = num_chirps.clamp(1, MOST_ROWS);
        let rows = 1 << most.ilog2();
        Self {
            rows,
            columns: num_samples.clamp(1, MOST_COLUMNS),
            rows_per_turn: rows as f64 / num_chirps.max(1) as f64,
            ..Self::default()
        }
    }

    /// Numbers of cells along velocity and along range.
    pub fn num_cells(&self) -> [usize; 2] {
        [self.rows, self.columns]
    }

    /// Cells along velocity per turn of phase over the frame.
    pub fn rows_per_turn(&self) -> f64 {
        self.rows_per_turn
    }

    /// Add a path: turns of phase from sample to sample, turns over the frame, amplitude.
    pub fn add(&mut self, range: f64, velocity: f64, amplitude: f64) {
        let number = |turns: f64, cells: usize| ((turns - turns.floor()) * cells as f64) as usize % cells;
        let row = number(velocity * self.rows_per_turn / self.rows as f64, self.rows);
        let cell = row * self.columns + number(range, self.columns);
        self.add_to(&[cell as u32], &[amplitude], amplitude * amplitude);
    }

    /// Add the amplitudes of paths to the cells of some indices, and the sum of their squares.
    #[cfg_attr(optimised, inline(always))] // within loops over paths
    pub fn add_to<T: Real>(&mut self, cells: &[u32], amplitudes: &[T], squares: f64) {
        if self.cells.is_empty() {
            self.cells.resize(self.rows * self.columns, 0.0);
        }
        self.squares += squares;
        // Neighbouring paths are often in one cell: sums in registers, two at once, need not wait for memory.
        let store = &mut self.cells[..];
        let half = cells.len() / 2;
        let (mut last, mut sums) = ([0_u32; 2], [T::zero(); 2]);
        for i in 0..half {
            for (side, path) in [i, half + i].into_iter().enumerate() {
                if cells[path] != last[side] {
                    store[last[side] as usize] += sums[side].wide() as f32;
                    (last[side], sums[side]) = (cells[path], T::zero());
                }
                sums[side] = sums[side] + amplitudes[path];
            }
        }
        for side in 0..2 {
            store[last[side] as usize] += sums[side].wide() as f32;
        }
        for path in 2 * half..cells.len() {
            store[cells[path] as usize] += amplitudes[path].wide() as f32;
        }
    }

    /// Add the paths of another one of the same frame.
    pub fn join(&mut self, other: &Self) {
        if self.cells.is_empty() {
            *self = other.clone();
            return;
        }
        for (sum, cell) in self.cells.iter_mut().zip(&other.cells) {
            *sum += cell;
        }
        self.squares += other.squares;
    }

    /// Largest energy of the sum for parts of the frame that are `count` times as short, and that of independent
    /// phases.
    pub fn energy(&self, count: usize) -> [f64; 2] {
        if self.cells.is_empty() {
            return [0.0; 2];
        }
        // Over a shorter time neighbouring velocities keep in phase.
        let merged = count.next_power_of_two().min(self.rows);
        let mut sums = vec![0.0; self.columns];
        let mut energy = 0.0;
        for rows in self.cells.chunks(merged * self.columns) {
            sums.fill(0.0);
            for row in rows.chunks_exact(self.columns) {
                for (sum, cell) in sums.iter_mut().zip(row) {
                    *sum += f64::from(*cell);
                }
            }
            energy += sums.iter().map(|sum| sum * sum).sum::<f64>();
        }
        [energy, self.squares]
    }

    /// Root of the ratio of the two [energies](Self::energy), at least 1.
    pub fn gain(&self, count: usize) -> f64 {
        let [energy, squares] = self.energy(count);
        let ratio = energy / squares;
        if ratio.is_finite() { ratio.max(1.0).sqrt() } else { 1.0 }
    }
}
