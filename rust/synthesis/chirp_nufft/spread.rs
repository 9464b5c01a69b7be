//! Spreading of paths over the cells of range grids: of one path in the chirps of all lanes, and of static paths.
//!
//! Within a chirp, in fast time u and with v = u^2 less its mean, a path is a tone times
//! `(a + slope u + bend v) exp(j (curvature v + third u v))`. Every power of v, and u times every power of v, has a grid
//! of its own for the sum of the strengths that paths have there.

use std::f64::consts::TAU;

use super::number::{FEWEST_TURNS, MAX_EVEN, MAX_LANES, MAX_ODD, Number, PathRecord, Static};
use super::tables::{GroupTables, Tables};
use crate::numeric::simd::{Isa, Vector, add_window};
use crate::numeric::wide::{cos_sin_of, number};
use crate::synthesis::kaiser_bessel::{KaiserBessel, Taps};

/// Most grids.
const MAX_GRIDS: usize = 1 + MAX_EVEN + MAX_ODD;

/// sin(pi x) / x and cos(pi x) in powers of x^2 up to x = 1/2: polynomials through five Chebyshev nodes, to 1e-8 and
/// 5e-8.
const SIN: [f64; 5] = [
    std::f64::consts::PI,
    -5.167_710_3,
    2.550_077_4,
    -0.598_290_4,
    0.077_655_91,
];
const COS: [f64; 5] = [0.999_999_94, -4.934_793, 4.058_410_6, -1.331_872_9, 0.219_682_43];

/// Cosine and sine of phases in turns, below 2^20 of them: to 5e-7 in single precision.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin<T: Number, I: Isa>(phase: T::In<I>) -> [T::In<I>; 2] {
    if size_of::<T>() == 8 {
        return cos_sin_of::<T, I>(phase);
    }
    let magic = <T::In<I>>::splat(T::ROUND);
    let x = phase.sub(phase.add(magic).sub(magic));
    let square = x.mul(x);
    let (mut s, mut c) = (number::<T, I>(SIN[4]), number::<T, I>(COS[4]));
    for n in (0..4).rev() {
        s = s.mul_add(square, number::<T, I>(SIN[n]));
        c = c.mul_add(square, number::<T, I>(COS[n]));
    }
    // Of half the angle: cos = 1 - 2 s^2, sin = 2 s c.
    let s = s.mul(x);
    let twice = s.add(s);
    [twice.neg_mul_add(s, number::<T, I>(1.0)), twice.mul(c)]
}

/// Complex numbers of all lanes.
type Pair<V> = [V; 2];

/// `a z`
#[cfg_attr(optimised, inline(always))]
fn scale<V: Vector>(z: Pair<V>, a: V) -> Pair<V> {
    [z[0].mul(a), z[1].mul(a)]
}

/// `z + a w`
#[cfg_attr(optimised, inline(always))]
fn add_scaled<V: Vector>(z: Pair<V>, w: Pair<V>, a: V) -> Pair<V> {
    [w[0].mul_add(a, z[0]), w[1].mul_add(a, z[1])]
}

/// `j a z`
#[cfg_attr(optimised, inline(always))]
fn quarter_turned<V: Vector>(z: Pair<V>, a: V) -> Pair<V> {
    let zero = a.sub(a);
    [zero.sub(z[1].mul(a)), z[0].mul(a)]
}

/// Numbers of the lanes whose bit is set, zero elsewhere.
#[cfg_attr(optimised, inline(always))]
fn selected<V: Vector>(z: Pair<V>, bits: u32) -> Pair<V> {
    let zero = V::splat(V::Scalar::default());
    [z[0].select(bits, zero), z[1].select(bits, zero)]
}

/// Spreading kernel of a width, and the factors of samples that undo it.
pub struct Spreading<T> {
    /// Width [cells].
    pub width: usize,
    taps: Taps<T>,
    /// One over the transform of the kernel, by sample.
    pub factors: Vec<f64>,
}

impl<T: Number> Spreading<T> {
    /// Kernel of a width.
    pub fn new(width: usize, tables: &Tables) -> Self {
        let (num_samples, num_cells) = (tables.waveform.num_samples, tables.num_cells as f64);
        let kernel = KaiserBessel::new(width, num_samples as f64 / num_cells);
        let place = |sample: usize| sample as f64 - (num_samples / 2) as f64;
        Self {
            width,
            taps: kernel.taps(),
            factors: (0..num_samples)
                .map(|sample| kernel.transform(place(sample) / num_cells).recip())
                .collect(),
        }
    }
}

/// Records of one channel to be spread on the grids of the chirps of all lanes.
pub struct Spread<'a, T> {
    /// Constants of the frame.
    pub tables: &'a Tables<'a>,
    /// Tables of the chirps.
    pub group: &'a GroupTables<T>,
    /// The kernel.
    pub spreading: &'a Spreading<T>,
    /// Numbers of grids of even and of odd powers of fast time after the first grid.
    pub powers: [usize; 2],
}

impl<T: Number> Spread<'_, T> {
    /// Add records to a grid, and to those of further powers of fast time if there are any: the even ones, then the odd.
    #[cfg_attr(optimised, inline(always))]
    pub fn add<I: Isa, const W: usize>(&self, records: &[T::Record], grid: &mut [T], further: &mut [Vec<T>]) {
        let group = self.group;
        let lanes = <T::In<I>>::LANES;
        let all = (1_u32 << lanes) - 1;
        let zero = number::<T, I>(0.0);
        let (mut phases, mut places) = ([zero; FEWEST_TURNS], [zero; FEWEST_TURNS]);
        for k in 0..FEWEST_TURNS {
            phases[k] = <T::In<I>>::load(&group.phase[k]);
            places[k] = <T::In<I>>::load(&group.place[k]);
        }
        let magic = <T::In<I>>::splat(T::ROUND);
        let start = T::of(-0.5 * (W as f64 - 1.0));
        let mask = self.tables.num_cells - 1;
        // S t' times the second order of the delay in the phase, in cells per squared turn.
        let per_square = self.tables.cells_per_turn * self.tables.ratio() * self.per_turn();
        let per_square = number::<T, I>(per_square);
        let mean = number::<T, I>(self.tables.moments.square / TAU);
        let mut strengths = [[zero; 2]; MAX_GRIDS];
        for record in records {
            // Phase and place in the middle of every chirp.
            let (head, turns) = (record.head(), record.turns());
            let (mut phase, mut place) = (zero, <T::In<I>>::splat(head.offset + start));
            for k in 0..FEWEST_TURNS {
                let turns = <T::In<I>>::splat(turns[k]);
                phase = turns.mul_add(phases[k], phase);
                place = turns.mul_add(places[k], place);
            }
            let mut k = FEWEST_TURNS;
            while k < T::NUM_TURNS.min(head.degrees[0] as usize) {
                let turns = <T::In<I>>::splat(turns[k]);
                phase = turns.mul_add(<T::In<I>>::load(&group.phase[k]), phase);
                place = turns.mul_add(<T::In<I>>::load(&group.place[k]), place);
                k += 1;
            }
            let (mut change, mut curvature) = (phase, zero);
            if !further.is_empty() {
                let mut k = 0;
                while k < T::NUM_TURNS.min(head.degrees[0] as usize) {
                    let turns = <T::In<I>>::splat(turns[k]);
                    curvature = turns.mul_add(<T::In<I>>::load(&group.curvature[k]), curvature);
                    k += 1;
                }
                change = curvature.neg_mul_add(mean, phase);
            }
            if size_of::<T>() == 8 || !further.is_empty() {
                // Places follow the delay, which at the frequency received is a larger share of the phase than at the
                // carrier, and larger still by its square.
                let ratio = per_square.mul_add(change, <T::In<I>>::splat(head.carrier_offset));
                place = ratio.mul_add(change, place);
            }
            phase = phase.add(<T::In<I>>::splat(head.phase));
            let amplitudes = record.amplitude();
            let mut amplitude = <T::In<I>>::splat(amplitudes[0]);
            // Single precision has few enough for all of them, unrolled.
            let degree = if size_of::<T>() == 4 {
                T::NUM_AMPLITUDES
            } else {
                head.degrees[1] as usize
            };
            let mut k = 1;
            while k < T::NUM_AMPLITUDES.min(degree) {
                let own = <T::In<I>>::splat(amplitudes[k]);
                amplitude = own.mul_add(<T::In<I>>::load(&group.amplitude[k]), amplitude);
                k += 1;
            }
            let tone = cos_sin::<T, I>(phase);

            // First of the cells, and the offset from the middle of theirs.
            let first = place.add(magic).sub(magic);
            let offset = first.sub(place);
            let values = self.spreading.taps.values::<T::In<I>, W>(offset.add(offset));
            let lowest = first.first();
            let here = first.equal(<T::In<I>>::splat(lowest));
            let strength = scale(tone, amplitude);
            if here == all && further.is_empty() {
                let cell = (head.cell as usize).wrapping_add_signed(lowest.wide() as isize) & mask;
                add_window::<T::In<I>, W, 2>(grid, cell * 2 * lanes, 2 * lanes, &values, &strength);
                continue;
            }
            strengths[0] = strength;
            if !further.is_empty() {
                self.powers::<I>(record, (change, curvature), (tone, amplitude), &mut strengths);
            }
            if here == all {
                let start = ((head.cell as usize).wrapping_add_signed(lowest.wide() as isize) & mask) * 2 * lanes;
                add_window::<T::In<I>, W, 2>(grid, start, 2 * lanes, &values, &strengths[0]);
                for number in 0..further.len() {
                    let (grid, strength) = (&mut further[number], &strengths[number + 1]);
                    add_window::<T::In<I>, W, 2>(grid, start, 2 * lanes, &values, strength);
                }
                continue;
            }
            // One pass for every first cell that there is.
            let mut firsts = [T::zero(); MAX_LANES];
            first.store(&mut firsts);
            let (mut rest, mut here, mut lowest) = (all, here, lowest);
            // A place that is no number is in no cell.
            while rest != 0 && here != 0 {
                let start = ((head.cell as usize).wrapping_add_signed(lowest.wide() as isize) & mask) * 2 * lanes;
                let own = selected(strengths[0], here);
                add_window::<T::In<I>, W, 2>(grid, start, 2 * lanes, &values, &own);
                for number in 0..further.len() {
                    let own = selected(strengths[number + 1], here);
                    add_window::<T::In<I>, W, 2>(&mut further[number], start, 2 * lanes, &values, &own);
                }
                rest &= !here;
                lowest = firsts[rest.trailing_zeros() as usize % lanes];
                here = first.equal(<T::In<I>>::splat(lowest)) & rest;
            }
        }
    }

    /// Half of the relative change of the frequency received per turn of phase.
    fn per_turn(&self) -> f64 {
        0.5 * self.tables.waveform.slope / self.tables.carrier.powi(2)
    }

    /// Strengths of all grids.
    #[cfg_attr(optimised, inline(always))]
    fn powers<I: Isa>(
        &self,
        record: &T::Record,
        (change, mut curvature): (T::In<I>, T::In<I>),
        (mut tone, amplitude): (Pair<T::In<I>>, T::In<I>),
        strengths: &mut [Pair<T::In<I>>; MAX_GRIDS],
    ) {
        let (group, tables, moments) = (self.group, self.tables, &self.tables.moments);
        let [num_even, num_odd] = self.powers;
        let zero = number::<T, I>(0.0);
        let (mut third, mut moved) = (zero, zero);
        let (degrees, turns, amplitudes) = (record.head().degrees, record.turns(), record.amplitude());
        let mut k = 0;
        while k < T::NUM_TURNS.min(degrees[0] as usize) {
            let turns = <T::In<I>>::splat(turns[k]);
            third = turns.mul_add(<T::In<I>>::load(&group.third[k]), third);
            moved = turns.mul_add(<T::In<I>>::load(&group.place[k]), moved);
            k += 1;
        }
        // Delays change by their share of the Doppler phase at the frequency received.
        let cells = tables.cells_per_turn;
        let ratio = number::<T, I>(tables.ratio());
        let doppler = change.neg_mul_add(ratio.mul(number::<T, I>(cells)), moved);
        let share = <T::In<I>>::splat(record.head().carrier_offset);
        let share = change.mul_add(number::<T, I>(2.0 * cells * tables.ratio() * self.per_turn()), share);
        let more = doppler.mul(share).mul(number::<T, I>(TAU / cells / cells));
        curvature = curvature.add(more);
        let mean = quarter_turned(tone, more.mul(number::<T, I>(moments.square)));
        tone = [tone[0].add(mean[0]), tone[1].add(mean[1])];
        strengths[0] = scale(tone, amplitude);
        let (mut slope, mut bend, mut cube) = (zero, zero, zero);
        let mut k = 1;
        while k < T::NUM_AMPLITUDES.min(degrees[1] as usize) {
            let own = <T::In<I>>::splat(amplitudes[k]);
            slope = own.mul_add(<T::In<I>>::load(&group.slope[k]), slope);
            bend = own.mul_add(<T::In<I>>::load(&group.bend[k]), bend);
            cube = own.mul_add(<T::In<I>>::load(&group.cube[k]), cube);
            k += 1;
        }
        // The line nearest to u^3 is part of places, but for what the frequency received adds to the third order; u^3 is
        // u (v + mean), u^3 less that line u (v + mean less slope).
        let doppler_slope = curvature
            .mul(number::<T, I>(TAU.recip()))
            .sub(doppler.mul(number::<T, I>(tables.ratio() / cells)));
        let more = doppler_slope.mul(share).mul(number::<T, I>(TAU / cells));
        let turning = third.add(more).mul(amplitude);
        let of_line = third.mul(amplitude).mul(number::<T, I>(moments.cube_slope));
        let mean = number::<T, I>(moments.square);
        let (lines, slope) = (mean.mul(turning).sub(of_line), mean.mul_add(cube, slope));
        // tone (j curvature)^n / n!, for this and the last n.
        let (mut power, mut last) = (tone, [zero; 2]);
        for n in 0..=num_even.max(num_odd.max(1) - 1) {
            if n > 0 {
                last = power;
                power = quarter_turned(power, curvature.mul(number::<T, I>((n as f64).recip())));
                if n <= num_even {
                    strengths[n] = add_scaled(scale(power, amplitude), last, bend);
                }
            }
            if n < num_odd {
                let mut odd = scale(power, slope);
                if num_odd > 1 {
                    let turned = add_scaled(scale(power, lines), last, turning);
                    odd = add_scaled([odd[0].sub(turned[1]), odd[1].add(turned[0])], last, cube);
                }
                strengths[num_even + 1 + n] = odd;
            }
        }
    }
}

/// Add static paths to a grid of one chirp, `(cell, part)`, with room for `width` cells beyond the last, which are added to
/// the first ones by [`wrap_static`].
#[cfg_attr(optimised, inline(always))]
pub fn add_static<T: Number, I: Isa, const W: usize>(
    spreading: &Spreading<T>,
    paths: &[Static<T>],
    num_cells: usize,
    grid: &mut [T],
) {
    let magic = <T::In<I>>::splat(T::ROUND);
    let start = T::of(-0.5 * (W as f64 - 1.0));
    let none = [T::zero(); MAX_LANES];
    for some in paths.chunks(T::LANES) {
        let (mut phase, mut place, mut amplitude) = (none, none, none);
        for lane in 0..some.len() {
            let path = &some[lane];
            (phase[lane], place[lane], amplitude[lane]) = (path.phase, path.offset + start, path.amplitude);
        }
        let [c, s] = cos_sin::<T, I>(<T::In<I>>::load(&phase));
        let size = <T::In<I>>::load(&amplitude);
        let place = <T::In<I>>::load(&place);
        let first = place.add(magic).sub(magic);
        let offset = first.sub(place);
        let values = spreading.taps.values::<T::In<I>, W>(offset.add(offset));
        let (mut firsts, mut re, mut im) = (none, none, none);
        first.store(&mut firsts);
        c.mul(size).store(&mut re);
        s.mul(size).store(&mut im);
        let mut taps = [none; W];
        for j in 0..W {
            values[j].store(&mut taps[j]);
        }
        for lane in 0..some.len() {
            let cell = (some[lane].cell as usize).wrapping_add_signed(firsts[lane].wide() as isize) & (num_cells - 1);
            let window = &mut grid[2 * cell..][..2 * W];
            for j in 0..W {
                window[2 * j] = window[2 * j] + taps[j][lane] * re[lane];
                window[2 * j + 1] = window[2 * j + 1] + taps[j][lane] * im[lane];
            }
        }
    }
}

/// Add the cells beyond the last of a grid of one chirp to the first ones.
pub fn wrap_static<T: Number>(num_cells: usize, grid: &mut [T]) {
    let (cells, beyond) = grid.split_at_mut(2 * num_cells);
    for (cell, more) in cells.iter_mut().zip(beyond) {
        *cell = *cell + *more;
    }
}
