//! Coherent sum of the errors of a kernel.
//!
//! The kernel's error of a tone is what the transform of the grid has of other fast times, a period of the grid away:
//! the sum over the paths there, times a small factor. Paths whose phases are unrelated within the chirps may add up
//! there, as the echo of a plate does that faces the radar a frame later. So the energy of the sum is estimated there, on
//! either side: paths of a cell of range and velocity, half a turn of phase over the samples by half a turn over the
//! chirps, keep in phase and add up as complex numbers; those of different cells do not over the frame (Parseval).
//! Neighbouring cells of range that are in phase tell that the energy is that of a short time, where the factor may be
//! largest. Cells share few slots, with signs as good as random: the expected products are the same (Charikar, Chen,
//! Farach-Colton, "Finding frequent items in data streams").

use std::fmt::Debug;

use super::number::{MAX_LANES, Number, Tone};
use super::record::Batch;
use super::spread::cos_sin;
use super::tables::Tables;
use crate::numeric::simd::{Isa, Kernel, Vector};
use crate::synthesis::chunk::Block;

/// Number of slots, a power of two.
const SLOTS: usize = 1024;

/// Tolerance from which one vector of paths in [`STEP`] is enough, chosen as if at random: what adds up in the others may
/// be as strong again, which the narrowest kernel allows.
const COARSE: f64 = 1e-2;
const STEP: usize = 4;

/// Safety factor of the energy: paths at opposite borders of a cell are a quarter of a turn apart at the ends of the frame,
/// where the mean over a cell has 0.81 of the energy; and three standard deviations of the estimate by slots.
const SAFETY: f64 = 1.13 / 0.81;

/// Strengths on both sides of the chirps, real and imaginary parts.
type Slot = [f32; 4];

/// Sums of strengths by slot.
#[derive(Clone, Debug)]
pub struct Sketch {
    /// Those of the cell of a path, and of the next one in range.
    slots: [Vec<Slot>; 2],
    /// Sum of the squares of amplitudes.
    power: f64,
    /// Number of paths.
    count: usize,
    /// Number of paths for one that is measured.
    step: f64,
}

impl Default for Sketch {
    fn default() -> Self {
        Self {
            slots: [vec![[0.0; 4]; SLOTS], vec![[0.0; 4]; SLOTS]],
            power: 0.0,
            count: 0,
            step: 1.0,
        }
    }
}

/// Bound of the coherent sum of some paths beside the chirps.
#[derive(Clone, Copy, Debug)]
pub struct Coherence {
    /// Sum of the squares of amplitudes.
    pub power: f64,
    /// Bound of the energy beside the chirps over that of independent phases, at least 1.
    pub energy: f64,
    /// Share of the energy that may lie within a short time.
    pub peak: f64,
}

impl Coherence {
    /// Coherence of one path, or of none.
    pub const NONE: Self = Self {
        power: 0.0,
        energy: 1.0,
        peak: 0.0,
    };

    /// Add other paths, or the paths of another block, times a weight.
    pub fn add(&mut self, other: &Self, weight: f64) {
        let power = weight * other.power;
        if power > 0.0 {
            let energies = [self.power * self.energy, power * other.energy];
            let energy = energies[0] + energies[1];
            self.peak = (energies[0] * self.peak + energies[1] * other.peak) / energy;
            self.power += power;
            self.energy = energy / self.power;
        }
    }
}

impl Sketch {
    /// Bound by this sketch.
    pub fn coherence(&self) -> Coherence {
        let [own, next] = &self.slots;
        let (mut squares, mut fourth, mut products) = (0.0, 0.0, [[0.0; 2]; 2]);
        for (a, b) in own.iter().zip(next) {
            for side in 0..2 {
                let [x, y, u, v] = [a[2 * side], a[2 * side + 1], b[2 * side], b[2 * side + 1]].map(f64::from);
                let square = x * x + y * y;
                squares += square;
                fourth += square * square;
                products[side][0] += x * u + y * v;
                products[side][1] += x * v - y * u;
            }
        }
        // Cells that are independent have products of this size by chance, at two standard deviations.
        let chance = 2.0 * (2.0 * fourth).sqrt() / squares;
        let product = products.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max) / (0.5 * squares);
        let peak = ((product - chance) / (1.0 - chance)).min(1.0);
        Coherence {
            power: self.power,
            energy: (SAFETY * (1.0 + self.step * (0.5 * squares / self.power - 1.0)))
                .min(self.count as f64)
                .max(1.0),
            peak: if chance < 1.0 { peak.max(0.0) } else { 0.0 },
        }
    }

    /// Add what another one has.
    pub fn join(&mut self, other: &Self) {
        for (own, other) in self.slots.iter_mut().zip(&other.slots) {
            for (sum, slot) in own.iter_mut().zip(other) {
                for i in 0..4 {
                    sum[i] += slot[i];
                }
            }
        }
        self.power += other.power;
        self.count += other.count;
        self.step = self.step.max(other.step);
    }
}

/// Sketch of a block of some batches.
pub struct Measure<'a, T: Number> {
    pub tables: &'a Tables<'a>,
    pub block: &'a Block,
    /// Number of the block.
    pub number: usize,
    pub batches: &'a [&'a Batch<T>],
    pub tolerance: f64,
}

impl<T: Number> Kernel for Measure<'_, T> {
    type Output = Sketch;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Sketch {
        let mut sketch = Sketch::default();
        let cells = Cells::new(self.tables, self.block, self.tolerance >= COARSE);
        for batch in self.batches {
            if let Some(records) = batch.blocks.get(self.number) {
                cells.add::<T, I, _>(records, &mut sketch);
            }
            cells.add::<T, I, _>(&batch.statics, &mut sketch);
        }
        sketch
    }
}

/// Cells of range and velocity of a block.
struct Cells {
    /// Factors of the linear coefficient of a phase: at the middle chirp, and over the time from chirp to chirp.
    middle: f64,
    interval: f64,
    /// Rows of velocity, two per turn over the chirps; columns of range, two per turn over the samples.
    rows: f64,
    columns: f64,
    /// Turns per cell of the grid, in a period and at the nearest of the times outside the chirps.
    per_cell: f64,
    edge: f64,
    /// One vector of paths of so many is taken.
    step: usize,
}

impl Cells {
    fn new(tables: &Tables, block: &Block, is_coarse: bool) -> Self {
        let times = &tables.waveform.chirp_times[block.chirps.clone()];
        let count = times.len();
        let (num_cells, num_samples) = (tables.num_cells as f64, tables.waveform.num_samples);
        let span = times[count - 1] - times[0];
        Self {
            middle: block.x(times[count / 2] + tables.waveform.middle_time()),
            interval: span / (count.max(2) - 1) as f64 / block.half,
            rows: 2.0 * count as f64,
            columns: 2.0 * num_samples as f64,
            per_cell: num_cells.recip(),
            step: if is_coarse { STEP } else { 1 },
            edge: 1.0 - (num_samples / 2) as f64 / num_cells,
        }
    }

    #[cfg_attr(optimised, inline(always))]
    fn add<T: Number, I: Isa, P: Tone<T>>(&self, paths: &[P], sketch: &mut Sketch) {
        let none = [T::zero(); MAX_LANES];
        let splat = <T::In<I>>::splat;
        let magic = splat(T::ROUND);
        let mut squares = splat(T::zero());
        sketch.step = sketch.step.max(self.step as f64);
        for (number, some) in paths.chunks(T::LANES).enumerate() {
            if self.step > 1
                && !(number as u32)
                    .wrapping_mul(0x9E37_79B1)
                    .rotate_left(8)
                    .is_multiple_of(STEP as u32)
            {
                continue;
            }
            let (mut phase, mut cell, mut offset) = (none, none, none);
            let (mut turns, mut amplitude) = (none, none);
            for lane in 0..some.len() {
                let own = some[lane].tone();
                (phase[lane], cell[lane], offset[lane]) = (own.0, T::of(f64::from(own.1)), own.2);
                (turns[lane], amplitude[lane]) = (own.3, own.4);
            }
            let turns = <T::In<I>>::load(&turns);
            let size = <T::In<I>>::load(&amplitude);
            squares = size.mul_add(size, squares);
            let phase = turns.mul_add(splat(T::of(self.middle)), <T::In<I>>::load(&phase));
            let place = <T::In<I>>::load(&cell).add(<T::In<I>>::load(&offset));
            let edge = place.mul(splat(T::of(self.edge)));
            let (mut strengths, mut keys) = ([none; 4], [none; 2]);
            for side in 0..2 {
                let [c, s] = cos_sin::<T, I>(if side == 0 { phase.add(edge) } else { phase.sub(edge) });
                c.mul(size).store(&mut strengths[2 * side]);
                s.mul(size).store(&mut strengths[2 * side + 1]);
            }
            // Parts of a turn after the nearest whole one, -1/2 to 1/2, in units of cells.
            let range = place.mul(splat(T::of(self.per_cell)));
            let velocity = turns.mul(splat(T::of(self.interval)));
            for (turns, (number, key)) in [range, velocity]
                .into_iter()
                .zip([self.columns, self.rows].into_iter().zip(&mut keys))
            {
                let part = turns.sub(turns.add(magic).sub(magic));
                let part = part.mul_add(splat(T::of(number)), splat(T::of(0.5 * number)));
                part.max(splat(T::zero())).store(key);
            }
            for lane in 0..some.len() {
                let (row, column) = (keys[1][lane].wide() as u32, keys[0][lane].wide() as u32);
                let mut own = [0.0; 4];
                for i in 0..4 {
                    own[i] = strengths[i][lane].wide() as f32;
                }
                for next in 0..2 {
                    let key = row << 16 ^ (column + next);
                    let slot = key.wrapping_mul(0x9E37_79B1) >> 22;
                    let sign = key.wrapping_mul(0x85EB_CA6B) >> 31 << 31;
                    let slot = &mut sketch.slots[next as usize][slot as usize % SLOTS];
                    for i in 0..4 {
                        slot[i] += f32::from_bits(own[i].to_bits() ^ sign);
                    }
                }
            }
        }
        let mut lanes = none;
        squares.store(&mut lanes);
        sketch.power += lanes.iter().map(|square| square.wide()).sum::<f64>();
        sketch.count += paths.len();
    }
}
