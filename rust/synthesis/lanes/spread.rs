//! Spreading of paths over the cells of range grids: of one path in 16 chirps, and of 16 still paths at once.

use super::kernel::Spreading;
use super::record::{FEWEST_TURNS, Record, Still};
use super::tables::{GroupTables, LANES, NUM_AMPLITUDES, NUM_TURNS, Tables};
use super::transform::STRIDE;
use crate::numeric::simd::{Isa, Vector, add_window};

/// Number whose addition and subtraction rounds to the nearest integer.
const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23

/// All chirps of a group.
const ALL: u32 = (1 << LANES) - 1;

/// sin(pi x) / x and cos(pi x) in powers of x^2 up to x = 1/2: polynomials through five Chebyshev nodes, to 1e-8 and
/// 5e-8.
const SIN: [f32; 5] = [
    std::f32::consts::PI,
    -5.167_710_3,
    2.550_077_4,
    -0.598_290_4,
    0.077_655_91,
];
const COS: [f32; 5] = [0.999_999_94, -4.934_793, 4.058_410_6, -1.331_872_9, 0.219_682_43];

/// Cosine and sine of phases in turns, below 2^20 of them, to 5e-7.
#[cfg_attr(optimised, inline(always))]
fn cos_sin<V: Vector<Scalar = f32>>(phase: V) -> [V; 2] {
    let magic = V::splat(ROUND);
    let x = phase.sub(phase.add(magic).sub(magic));
    let square = x.mul(x);
    let (mut s, mut c) = (V::splat(SIN[4]), V::splat(COS[4]));
    for n in (0..4).rev() {
        s = s.mul_add(square, V::splat(SIN[n]));
        c = c.mul_add(square, V::splat(COS[n]));
    }
    // Of half the angle: cos = 1 - 2 s^2, sin = 2 s c.
    let s = s.mul(x);
    let twice = s.add(s);
    [twice.neg_mul_add(s, V::splat(1.0)), twice.mul(c)]
}

/// Records of one channel to be spread on the grids of 16 chirps.
pub struct Spread<'a> {
    /// Constants of the frame.
    pub tables: &'a Tables,
    /// Tables of the chirps.
    pub group: &'a GroupTables,
    /// The kernel.
    pub spreading: &'a Spreading,
}

impl Spread<'_> {
    /// Add records to a grid, and what bends them within a chirp to a second one unless that is empty.
    #[cfg_attr(optimised, inline(always))]
    pub fn add<I: Isa, const W: usize>(&self, records: &[Record], grid: &mut [f32], second: &mut [f32]) {
        let group = self.group;
        let zero = I::F32::splat(0.0);
        let (mut phases, mut cells) = ([zero; FEWEST_TURNS], [zero; FEWEST_TURNS]);
        for k in 0..FEWEST_TURNS {
            (phases[k], cells[k]) = (I::F32::load(&group.phase[k]), I::F32::load(&group.cell[k]));
        }
        let mut basis = [zero; NUM_AMPLITUDES - 1];
        for k in 0..NUM_AMPLITUDES - 1 {
            basis[k] = I::F32::load(&group.basis[k]);
        }
        let magic = I::F32::splat(ROUND);
        let start = -0.5 * (W as f32 - 1.0);
        let mask = self.tables.num_cells - 1;
        for record in records {
            // Phase and place in the middle of every chirp.
            let mut phase = I::F32::splat(record.phase);
            let mut place = I::F32::splat(record.offset + start);
            let mut amplitude = I::F32::splat(record.amplitude[0]);
            for k in 0..FEWEST_TURNS {
                let turns = I::F32::splat(record.turns[k]);
                phase = turns.mul_add(phases[k], phase);
                place = turns.mul_add(cells[k], place);
            }
            let mut k = FEWEST_TURNS;
            while k < NUM_TURNS.min(record.degree as usize) {
                let turns = I::F32::splat(record.turns[k]);
                phase = turns.mul_add(I::F32::load(&group.phase[k]), phase);
                place = turns.mul_add(I::F32::load(&group.cell[k]), place);
                k += 1;
            }
            for k in 0..NUM_AMPLITUDES - 1 {
                amplitude = I::F32::splat(record.amplitude[k + 1]).mul_add(basis[k], amplitude);
            }
            let [c, s] = cos_sin(phase);
            let tone = [c.mul(amplitude), s.mul(amplitude)];

            // First of the cells, and the offset from the middle of theirs.
            let first = place.add(magic).sub(magic);
            let offset = first.sub(place);
            let values = self.spreading.values::<I::F32, W>(offset.add(offset));
            let lowest = first.first();
            let here = first.equal(I::F32::splat(lowest));
            if here == ALL && second.is_empty() {
                let cell = (record.cell as usize).wrapping_add_signed(lowest as isize) & mask;
                add_window::<I::F32, W, 2>(grid, cell * STRIDE, STRIDE, &values, &tone);
                continue;
            }
            let mut bent = [zero; 2];
            if !second.is_empty() {
                let mut bend = zero;
                for k in 0..NUM_TURNS {
                    bend = I::F32::splat(record.turns[k]).mul_add(I::F32::load(&group.bend[k]), bend);
                }
                bent = [zero.sub(bend.mul(tone[1])), bend.mul(tone[0])];
            }
            // One pass for every first cell that there is.
            let mut firsts = [0.0; LANES];
            first.store(&mut firsts);
            let (mut rest, mut here, mut lowest) = (ALL, here, lowest);
            // A place that is no number is in no cell.
            while rest != 0 && here != 0 {
                let cell = (record.cell as usize).wrapping_add_signed(lowest as isize) & mask;
                let some = [tone[0].select(here, zero), tone[1].select(here, zero)];
                add_window::<I::F32, W, 2>(grid, cell * STRIDE, STRIDE, &values, &some);
                if !second.is_empty() {
                    let some = [bent[0].select(here, zero), bent[1].select(here, zero)];
                    add_window::<I::F32, W, 2>(second, cell * STRIDE, STRIDE, &values, &some);
                }
                rest &= !here;
                lowest = firsts[rest.trailing_zeros() as usize % LANES];
                here = first.equal(I::F32::splat(lowest)) & rest;
            }
        }
    }
}

/// Add still paths to a grid of one chirp, `(cell, part)`, with room for `width` cells beyond the last, which are added to
/// the first ones by [`wrap_still`].
#[cfg_attr(optimised, inline(always))]
pub fn add_still<I: Isa, const W: usize>(spreading: &Spreading, paths: &[Still], num_cells: usize, grid: &mut [f32]) {
    let magic = I::F32::splat(ROUND);
    let start = -0.5 * (W as f32 - 1.0);
    for sixteen in paths.chunks(LANES) {
        let (mut phase, mut place, mut amplitude) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for lane in 0..sixteen.len() {
            let path = &sixteen[lane];
            (phase[lane], place[lane], amplitude[lane]) = (path.phase, path.offset + start, path.amplitude);
        }
        let [c, s] = cos_sin(I::F32::load(&phase));
        let size = I::F32::load(&amplitude);
        let place = I::F32::load(&place);
        let first = place.add(magic).sub(magic);
        let offset = first.sub(place);
        let values = spreading.values::<I::F32, W>(offset.add(offset));
        let (mut firsts, mut re, mut im) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        first.store(&mut firsts);
        c.mul(size).store(&mut re);
        s.mul(size).store(&mut im);
        let mut taps = [[0.0; LANES]; W];
        for j in 0..W {
            values[j].store(&mut taps[j]);
        }
        for lane in 0..sixteen.len() {
            let cell = (sixteen[lane].cell as usize).wrapping_add_signed(firsts[lane] as isize) & (num_cells - 1);
            let window = &mut grid[2 * cell..][..2 * W];
            for j in 0..W {
                window[2 * j] += taps[j][lane] * re[lane];
                window[2 * j + 1] += taps[j][lane] * im[lane];
            }
        }
    }
}

/// Add the cells beyond the last of a grid of one chirp to the first ones.
pub fn wrap_still(num_cells: usize, grid: &mut [f32]) {
    let (cells, beyond) = grid.split_at_mut(2 * num_cells);
    for (cell, more) in cells.iter_mut().zip(beyond) {
        *cell += *more;
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::numeric::simd::{Kernel, Level};

    struct CosSin(f32);

    impl Kernel for CosSin {
        type Output = [f32; 2];
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> [f32; 2] {
            let [c, s] = cos_sin(I::F32::splat(self.0));
            [c.first(), s.first()]
        }
    }

    #[test]
    fn cosine_and_sine_agree_with_the_library_to_rounding() {
        for level in Level::available() {
            for trial in -4000_i16..4000 {
                let phase = f32::from(trial) * 0.003_17;
                let got = level.run(CosSin(phase));
                let x = TAU * f64::from(phase).fract();
                for (got, expected) in got.into_iter().zip([x.cos(), x.sin()]) {
                    assert!((f64::from(got) - expected).abs() < 6e-7, "{phase}: {got} {expected}");
                }
            }
        }
    }
}
