//! Coherence of the paths of records beside the chirps.

use super::fast_time::FastTime;
use super::number::{LaneRow, Number};
use super::records::{Batch, CELL, HEAD, OFFSET, PHASE};
use super::spread::cos_sin;
use crate::numeric::random::mix;
use crate::numeric::simd::{Isa, Kernel, Vector};
use crate::synthesis::chunk::Block;
use crate::synthesis::coherence::{CellAxis, CellSums, LANES};

/// Sums over cells of the paths of some batches in a block, see [`CellSums`].
pub struct SumCells<'a, T> {
    pub fast_time: &'a FastTime<'a>,
    pub block: &'a Block,
    /// Number of the block.
    pub number: usize,
    pub batches: &'a [&'a Batch<T>],
    /// Number of records for one that is measured.
    pub step: usize,
}

impl<T: Number> Kernel for SumCells<'_, T> {
    type Output = CellSums;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> CellSums {
        let waveform = self.fast_time.waveform;
        let times = &waveform.chirp_times[self.block.chirps.clone()];
        let (num_samples, num_cells) = (waveform.num_samples, self.fast_time.num_cells as f64);
        // In cells of the grid, and in turns of the first coefficient of the phase.
        let range = CellAxis {
            turns: num_cells.recip(),
            cells: 2.0 * num_samples as f64,
            edge: 1.0 - (num_samples / 2) as f64 / num_cells,
        };
        let span = times[times.len() - 1] - times[0];
        let velocity = CellAxis {
            turns: span / (times.len().max(2) - 1) as f64 / self.block.half,
            cells: 2.0 * times.len() as f64,
            edge: 0.0,
        };
        let middle = self.block.x(times[times.len() / 2] + waveform.middle_time());
        let mut sums = CellSums::new([range, velocity], self.step);
        for batch in self.batches {
            let records = batch.blocks[self.number].chunks_exact(batch.num_rows());
            for (number, record) in records.enumerate() {
                let len = batch.paths_of(number);
                let is_measured = mix(sums.count as u64).is_multiple_of(self.step as u64);
                sums.count += len;
                if is_measured {
                    let lanes = lanes::<T, I>(record, batch.counts, middle);
                    sums.add_lanes::<I>(len, &lanes);
                }
            }
        }
        sums
    }
}

/// Place, Doppler phase of the block, and strength in the middle of it, of the paths of a record.
#[cfg_attr(optimised, inline(always))]
fn lanes<T: Number, I: Isa>(record: &[LaneRow<T>], counts: [usize; 2], middle: f64) -> [[f32; LANES]; 4] {
    let mut lanes = [[0.0; LANES]; 4];
    for at in (0..LANES).step_by(T::LANES) {
        let load = |row: usize| <T::In<I>>::load(&record[row][at..]);
        let mut turns = <T::In<I>>::splat(T::zero());
        if counts[0] > 0 {
            turns = load(HEAD);
        }
        let amplitude = load(HEAD + counts[0]);
        let [c, s] = cos_sin::<T, I>(turns.mul_add(<T::In<I>>::splat(T::of(middle)), load(PHASE)));
        let place = load(CELL).add(load(OFFSET));
        let numbers = [place, turns, c.mul(amplitude), s.mul(amplitude)];
        for row in 0..numbers.len() {
            let mut stored = [T::zero(); LANES];
            numbers[row].store(&mut stored);
            for lane in 0..T::LANES {
                lanes[row][at + lane] = stored[lane].wide() as f32;
            }
        }
    }
    lanes
}
