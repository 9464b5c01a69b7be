//! Coherence of paths beside the frame: the sum of the errors of a spreading kernel.
//!
//! A spreading kernel leaves aliases: the samples of other times, a period of the grid away, times a small factor.
//! Paths whose phases are unrelated within the frame may be in phase there, as the echo of a plate does that faces the
//! radar a frame later. The energy of the sum is estimated at the nearest of these times, on either side along range
//! and along velocity: paths of a cell of range and velocity, half a turn of phase over the samples by half a turn over
//! the chirps, add up as complex numbers; different cells do not, on average over the frame (Parseval). Cells share few
//! slots, with pseudo-random signs: the expected energy is the same (Charikar, Chen, Farach-Colton, "Finding frequent
//! items in data streams").

use crate::numeric::kaiser_bessel::ToneError;
use crate::numeric::random::mix;
use crate::numeric::simd::{Isa, Precision, Real, Vector};
use crate::numeric::wide;
use crate::synthesis::chunk::{CHUNK, Lane};

/// Number of slots, a power of two.
const SLOTS: usize = 512;

/// Products of cosine and sine along range and along velocity with a strength, real and imaginary part.
const NUMBERS: usize = 8;

/// Paths that are added at once.
pub const LANES: usize = 16;

/// Safety factor of the energy of paths in phase: the sum over a cell has 0.81 of the energy if its paths differ by a
/// quarter of a turn.
const SAFETY: f64 = 1.0 / 0.81;

/// Relative error of an energy by slots: three standard deviations, and the largest of four sides.
const SLOT_ERROR: f64 = 0.14;

/// Excess of an energy that is measured where paths have independent phases.
const MEASUREMENT: f64 = 0.25;

/// Axis of cells, in units of a coordinate of the paths.
#[derive(Clone, Copy, Debug)]
pub struct CellAxis {
    /// Turns per unit, modulo which cells repeat.
    pub turns: f64,
    /// Cells per turn.
    pub cells: f64,
    /// Turns per unit from the middle of the frame to the nearest alias; 0 without a grid along the axis.
    pub edge: f64,
}

/// Sums by slot of one path in some of a channel.
#[derive(Clone, Debug)]
pub struct CellSums {
    axes: [CellAxis; 2],
    step: usize,
    /// Sums of strengths, with signs.
    strengths: Box<[[f32; NUMBERS]; SLOTS]>,
    /// Sums of squared strengths, and numbers of paths.
    powers: Box<[[f32; 2]; SLOTS]>,
    /// Number of paths, measured or not.
    pub count: usize,
}

impl CellSums {
    /// Memory [bytes].
    pub const MEMORY: usize = SLOTS * (NUMBERS + 2) * size_of::<f32>();

    /// Sums of no paths, for cells of range and velocity, of one path in `step`.
    pub fn new(axes: [CellAxis; 2], step: usize) -> Self {
        Self {
            axes,
            step,
            strengths: Box::new([[0.0; NUMBERS]; SLOTS]),
            powers: Box::new([[0.0; 2]; SLOTS]),
            count: 0,
        }
    }

    /// Add some of the first `count` paths of a chunk, by their coordinates on both axes and the parts of their strengths
    /// in the middle of the frame, side by side.
    #[cfg_attr(optimised, inline(always))] // part of kernels
    pub fn add<T: Precision, I: Isa>(&mut self, count: usize, places: &[Lane<T>; 2], strengths: &[T; 2 * CHUNK]) {
        // One of several neighbours, the first at a pseudo-random place.
        let start = mix(self.count as u64) as usize % self.step;
        let count = count.min(CHUNK);
        self.count += count;
        for first in (start..count).step_by(LANES * self.step) {
            let mut lanes = [[0.0; LANES]; 4];
            let len = (count - first).div_ceil(self.step).min(LANES);
            for lane in 0..len {
                let path = first + lane * self.step;
                lanes[0][lane] = places[0][path].wide() as f32;
                lanes[1][lane] = places[1][path].wide() as f32;
                lanes[2][lane] = strengths[2 * path].wide() as f32;
                lanes[3][lane] = strengths[2 * path + 1].wide() as f32;
            }
            self.add_lanes::<I>(len, &lanes);
        }
    }

    /// Add paths by their coordinates on both axes and the parts of their strengths.
    #[cfg_attr(optimised, inline(always))] // part of kernels
    pub fn add_lanes<I: Isa>(&mut self, len: usize, lanes: &[[f32; LANES]; 4]) {
        let strength = [I::F32::load(&lanes[2]), I::F32::load(&lanes[3])];
        let square = strength[0].mul_add(strength[0], strength[1].mul(strength[1]));
        let mut squares = [0.0; LANES];
        square.store(&mut squares);
        let mut products = [strength[0]; NUMBERS];
        let mut cells = [[0.0; LANES]; 2];
        for axis in 0..2 {
            let CellAxis {
                turns,
                cells: number,
                edge,
            } = self.axes[axis];
            let place = I::F32::load(&lanes[axis]);
            let phasor = wide::cos_sin_of::<f32, I>(place.mul(wide::number::<f32, I>(edge)));
            for i in 0..4 {
                products[4 * axis + i] = phasor[i / 2].mul(strength[i % 2]);
            }
            let magic = I::F32::splat(f32::ROUND);
            let turns = place.mul(wide::number::<f32, I>(turns));
            let turns = turns.sub(turns.add(magic).sub(magic));
            turns
                .mul_add(wide::number::<f32, I>(number), magic)
                .store(&mut cells[axis]);
        }
        // Transpose: the numbers of a path side by side.
        for _ in 0..NUMBERS.ilog2() {
            let before = products;
            for i in 0..NUMBERS / 2 {
                [products[2 * i], products[2 * i + 1]] = before[i].interleave(before[i + NUMBERS / 2]);
            }
        }
        let mut numbers = [0.0; LANES * NUMBERS];
        wide::store(products, &mut numbers);
        for path in 0..len {
            // Slot and sign by the highest and the lowest bits of a hash of both cells.
            let hash = (cells[0][path].to_bits() ^ cells[1][path].to_bits() << 16).wrapping_mul(0x9E37_79B1);
            let hash = (hash ^ hash >> 15).wrapping_mul(0x85EB_CA6B);
            let slot = (hash >> 16) as usize % SLOTS;
            let sign = hash >> 31 << 31;
            self.powers[slot][0] += squares[path];
            self.powers[slot][1] += 1.0;
            for i in 0..NUMBERS {
                self.strengths[slot][i] += f32::from_bits(numbers[NUMBERS * path + i].to_bits() ^ sign);
            }
        }
    }

    /// Add the paths of another one.
    pub fn join(&mut self, other: &Self) {
        let others = other.strengths.as_flattened().iter().chain(other.powers.as_flattened());
        let sums = self.strengths.as_flattened_mut().iter_mut();
        for (sum, other) in sums.chain(self.powers.as_flattened_mut()).zip(others) {
            *sum += other;
        }
        self.count += other.count;
    }

    /// Sums over all slots of the power, the number of paths, and their product.
    fn totals(&self) -> [f64; 3] {
        let slots = self.powers.iter().map(|slot| slot.map(f64::from));
        slots.fold([0.0; 3], |sum, [power, number]| {
            [sum[0] + power, sum[1] + number, sum[2] + power * number]
        })
    }

    /// Sum of the powers of the measured paths.
    pub fn power(&self) -> f64 {
        self.totals()[0]
    }

    /// Bound of the energy beside the frame, relative to paths of independent phases, from 1 to the number of paths; `strongest` is
    /// the share of the strongest path in the power.
    pub fn energy(&self, strongest: f64) -> f64 {
        // Both sides are cos + j sin and cos - j sin.
        let mut sides = [0.0_f64; NUMBERS / 2];
        for slot in self.strengths.iter() {
            let slot = slot.map(f64::from);
            for (axis, [a, b, c, d]) in slot.as_chunks().0.iter().enumerate() {
                if self.axes[axis].edge == 0.0 {
                    continue;
                }
                sides[2 * axis] += (a - d).powi(2) + (b + c).powi(2);
                sides[2 * axis + 1] += (a + d).powi(2) + (b - c).powi(2);
            }
        }
        let largest = sides.into_iter().fold(0.0, f64::max);
        let (step, energy) = (self.step as f64, (1.0 + SLOT_ERROR) * largest / self.power());
        let measured = 1.0 + SAFETY * step * (energy - 1.0).max(0.0);
        // Two standard deviations of the sum of paths in phase by a sample. These paths have no larger share of the power
        // than the strongest has of their energy, by the inequality of Hoelder.
        let share = (strongest * measured).sqrt().min(1.0);
        let bound = (measured.sqrt() + 2.0 * ((step - 1.0) * share).sqrt()).powi(2);
        bound.min(self.count as f64).max(1.0)
    }

    /// Mean number of paths in the cell of a path, weighted by power.
    pub fn population(&self) -> f64 {
        let [power, number, product] = self.totals();
        // Without paths of different cells that share a slot by chance.
        let measured = product / power - number / SLOTS as f64;
        1.0 + self.step as f64 * (measured - 1.0).max(0.0)
    }
}

impl ToneError {
    /// Bound of the rms error of a sum of tones, relative to the l2 norm of their amplitudes, for an
    /// [energy](CellSums::energy) beside the frame: it may lie where aliases are largest, but for what the
    /// measurement alone may have added.
    pub fn with_energy(&self, energy: f64) -> f64 {
        let in_phase = (energy - 1.0 - MEASUREMENT).max(0.0).sqrt();
        (energy.sqrt() * self.rms).hypot(in_phase * self.alias.max(self.rms))
    }
}
