//! Records: all that the sum needs of a path of a channel, one cache line each, from coefficients in double precision.

use std::f64::consts::TAU;

use super::errors::Errors;
use super::tables::{LANES, NUM_AMPLITUDES, NUM_TURNS, Tables};
use crate::numeric::simd::{Isa, Vector};
use crate::numeric::trig::angle;
use crate::numeric::wide::{self, mul, narrow, neg_mul_add, sub};
use crate::synthesis::block::{Lane, SingleLane};
use crate::synthesis::coherence::Coherence;

/// Coefficients of the phase that every path has; further ones only where they count.
pub const FEWEST_TURNS: usize = 3;

/// Share of the tolerance that coefficients beyond the degree of a path may turn its phase by [turns].
const TURNS_SHARE: f64 = 0.01;

/// Share of the tolerance for the part of an amplitude that is a quarter turn off its mean.
const QUARTER_SHARE: f64 = 0.02;

/// Squared magnitude of scaled amplitudes that have no direction.
const NO_AMPLITUDE: f32 = 1e-36;

/// Vectors of f64 that make one of f32.
const P: usize = 2;

/// A path that moves: coefficients of Chebyshev polynomials over the frame. The amplitude is real, as its argument is
/// part of the phase.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Default)]
pub struct Record {
    /// Constant part of the phase at the middle samples, -1 to 1 [turns].
    pub phase: f32,
    /// Constant part of the place on the grid after `cell`, -1/2 to 1/2 [cells].
    pub offset: f32,
    /// Cell of the constant part.
    pub cell: u32,
    /// Number of the coefficients in `turns` that count, at least [`FEWEST_TURNS`].
    pub degree: u32,
    /// Coefficients of the phase [turns].
    pub turns: [f32; NUM_TURNS],
    /// Coefficients of the amplitude.
    pub amplitude: [f32; NUM_AMPLITUDES],
}

/// A path that stands still, with the first numbers of a [`Record`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Still {
    /// Phase at the middle samples [turns].
    pub phase: f32,
    /// Place on the grid after `cell` [cells].
    pub offset: f32,
    /// Cell of the place.
    pub cell: u32,
    /// Amplitude.
    pub amplitude: f32,
}

/// Some paths of a channel.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// Paths that move; an amplitude whose argument changes takes two records.
    pub moving: Vec<Record>,
    /// Paths that stand still.
    pub still: Vec<Still>,
    /// Number of the paths that move.
    pub num_moving: usize,
    /// Errors of these paths.
    pub errors: Errors,
}

impl Batch {
    /// Add the paths to cells of range and velocity.
    pub fn add_to(&self, cells: &mut Coherence, tables: &Tables) {
        let per_cell = (tables.num_cells as f64).recip();
        let range = |cell: u32, offset: f32| per_cell * (f64::from(cell) + f64::from(offset));
        for path in &self.moving {
            let velocity = 2.0 * f64::from(path.turns[0]);
            cells.add(
                range(path.cell, path.offset),
                velocity,
                f64::from(path.amplitude[0].abs()),
            );
        }
        for path in &self.still {
            cells.add(range(path.cell, path.offset), 0.0, f64::from(path.amplitude.abs()));
        }
    }
}

/// Coefficients of up to 128 paths of a channel over the frame of the tables, by degree: delays [s], real and imaginary
/// parts of amplitudes times a power of two. Lanes after the last path have no amplitude.
#[derive(Clone, Copy)]
pub struct Coefficients<'a> {
    /// Number of paths.
    pub len: usize,
    /// Coefficients of the delays.
    pub delay: &'a [Lane],
    /// Real parts of those of the amplitudes.
    pub re: &'a [SingleLane],
    /// Imaginary parts.
    pub im: &'a [SingleLane],
}

/// Builder of the records of a frame.
#[derive(Clone, Debug)]
pub struct Builder<'a> {
    tables: &'a Tables,
    /// Turns beyond the degree of a path that do not count.
    least_turns: f32,
    /// Squared ratio of the part of an amplitude that does not count.
    least_quarter: f32,
    /// True if series of delays and of amplitudes go on beyond the coefficients given, see [`Self::new`].
    goes_on: [bool; 2],
    weights: [Weights; NUM_TURNS],
}

/// Weights of a coefficient of the phase in bounds over the frame: |T_k'| <= k^2, and so on.
#[derive(Clone, Copy, Debug, Default)]
struct Weights {
    /// Rate [1/s].
    rate: f32,
    /// Phase that bends within a chirp beyond its mean, rms [rad].
    bend: f32,
    /// Phase at third order of time within a chirp, rms [rad].
    cube: f32,
}

impl<'a> Builder<'a> {
    /// Builder for a tolerance; `goes_on` if the series of delays and of amplitudes go on beyond the coefficients given,
    /// as those through values at some times do: errors then include what the last coefficients tell of further ones.
    pub fn new(tables: &'a Tables, tolerance: f64, goes_on: [bool; 2]) -> Self {
        let (per_second, moments) = (tables.half.recip(), &tables.moments);
        let ramp = (tables.slope / tables.carrier).abs();
        let mut weights = [Weights::default(); NUM_TURNS];
        for (i, weights) in weights.iter_mut().enumerate() {
            let square = ((i + 1) * (i + 1)) as f64;
            let first = square * per_second;
            let second = square * (square - 1.0) / 3.0 * per_second.powi(2);
            let third = square * (square - 1.0) * (square - 4.0) / 15.0 * per_second.powi(3);
            *weights = Weights {
                rate: first as f32,
                bend: (TAU * moments.bend * (ramp * first + 0.5 * second)) as f32,
                cube: (TAU * moments.cube * (0.5 * ramp * second + third.max(0.0) / 6.0)) as f32,
            };
        }
        Self {
            tables,
            least_turns: (TURNS_SHARE * tolerance) as f32,
            least_quarter: (QUARTER_SHARE * tolerance).powi(2) as f32,
            goes_on,
            weights,
        }
    }

    /// Add paths to a batch; bit i of `moving` is set where path i moves.
    #[cfg_attr(optimised, inline(always))]
    pub fn add<I: Isa>(&self, paths: &Coefficients, moving: u128, batch: &mut Batch) {
        let mut sums = Sums::<I::F32>::new();
        for at in (0..paths.len).step_by(LANES) {
            let numbers = self.sixteen::<I>(paths, at, &mut sums);
            for lane in 0..LANES.min(paths.len - at) {
                numbers.put(lane, moving >> (at + lane) & 1 == 1, batch);
            }
        }
        batch.errors.add(&sums.errors());
    }

    /// Numbers of the 16 paths from `at` on.
    #[cfg_attr(optimised, inline(always))]
    fn sixteen<I: Isa>(&self, paths: &Coefficients, at: usize, sums: &mut Sums<I::F32>) -> Numbers {
        let tables = self.tables;
        let zero = I::F32::splat(0.0);

        // Constant part of phase and place: f_m tau - S tau^2 / 2, and S tau over the width of a cell.
        let constant = wide::load::<I, P>(&paths.delay[0][at..]);
        let half_slope = wide::splat::<I, P>(0.5 * tables.slope);
        let mut phase = wide::turns::<I, P>(tables.frequency, constant);
        phase = neg_mul_add(mul(constant, half_slope), constant, phase);
        let cells = mul(constant, wide::splat::<I, P>(tables.slope * tables.cells_per_frequency));
        let cell = wide::round::<I, P>(cells);
        let offset = narrow::<f32, I, P>(sub(cells, cell));
        let num_cells = tables.num_cells as f64;
        let rounds = wide::round::<I, P>(mul(cell, wide::splat::<I, P>(num_cells.recip())));
        let cell = neg_mul_add(rounds, wide::splat::<I, P>(num_cells), cell);

        // Coefficients of the phase: those of the delay times the frequency received. The square of the change of the
        // delay is that of the linear term, x^2 = (1 + T_2) / 2.
        let slope = wide::splat::<I, P>(tables.slope);
        let received = neg_mul_add(slope, constant, wide::splat::<I, P>(tables.frequency));
        let mut turns = [zero; NUM_TURNS];
        let num_turns = (paths.delay.len() - 1).min(NUM_TURNS);
        if num_turns > 0 {
            let rate = wide::load::<I, P>(&paths.delay[1][at..]);
            let square = mul(mul(rate, rate), wide::splat::<I, P>(0.25 * tables.slope));
            phase = sub(phase, square);
            for k in 0..num_turns {
                let coefficient = wide::load::<I, P>(&paths.delay[k + 1][at..]);
                let mut turned = mul(coefficient, received);
                if k == 1 {
                    turned = sub(turned, square);
                }
                turns[k] = narrow::<f32, I, P>(turned);
            }
            if num_turns == 1 {
                turns[1] = zero.sub(narrow::<f32, I, P>(square));
            }
        }

        let detuned = narrow::<f32, I, P>(mul(
            sub(constant, wide::splat::<I, P>(tables.middle_delay)),
            wide::splat::<I, P>(tables.slope / tables.carrier),
        ));
        let (left_out, bend, beyond_third, degree) = self.left_out::<I>(&turns, detuned);

        // Conjugate amplitudes: along the direction of the first coefficient, and a quarter turn off.
        let (direction, argument) = Self::direction::<I>(paths, at);
        let phase = narrow::<f32, I, P>(wide::reduce::<I, P>(phase)).add(argument);
        let (mut along, mut across) = ([zero; NUM_AMPLITUDES], [zero; NUM_AMPLITUDES]);
        let (mut power, mut quarter, mut beyond, mut change) = (zero, zero, zero, zero);
        let mut further = [zero; 2];
        for k in 0..paths.re.len() {
            let re = I::F32::load(&paths.re[k][at..]);
            let im = zero.sub(I::F32::load(&paths.im[k][at..]));
            let r = im.mul_add(direction[1], re.mul(direction[0]));
            let s = re.neg_mul_add(direction[1], im.mul(direction[0]));
            let weight = I::F32::splat(if k == 0 { 1.0 } else { 0.5 });
            let (r_square, s_square) = (r.mul(r).mul(weight), s.mul(s).mul(weight));
            power = power.add(r_square.add(s_square));
            if k < NUM_AMPLITUDES {
                (along[k], across[k]) = (r, s);
                quarter = quarter.add(s_square);
            } else {
                beyond = beyond.add(r_square.add(s_square));
            }
            if self.goes_on[1] && k > 0 && k + 2 >= paths.re.len() {
                // Twice a coefficient of the last two, which those beyond are folded back to.
                further[1] = further[1].max(r.mul_add(r, s.mul(s)).mul(I::F32::splat(4.0)));
            }
            let size = absolute(r).add(absolute(s));
            change = size.mul_add(I::F32::splat((k * k) as f32), change);
        }
        let has_quarter = !quarter.at_most(power.mul(I::F32::splat(self.least_quarter)));
        let counted = zero.select(has_quarter, quarter);
        let change = change.mul(I::F32::splat((tables.moments.square.sqrt() / tables.half) as f32));
        let amplitude = change.mul_add(change, beyond.add(counted));
        if self.goes_on[0] && num_turns > 0 {
            let last = absolute(turns[num_turns - 1]).max(absolute(turns[num_turns.max(2) - 2]));
            let phase = last.mul(I::F32::splat(2.0 * std::f32::consts::TAU));
            further[0] = phase.mul(phase).mul(power);
        }
        let mut longest = absolute(narrow::<f32, I, P>(constant));
        for k in 0..num_turns {
            longest = absolute(turns[k]).mul_add(I::F32::splat((1.0 / tables.carrier.abs()) as f32), longest);
        }
        sums.take_in(power, left_out, bend, amplitude);
        let tail = beyond_third.mul(I::F32::splat(std::f32::consts::TAU));
        sums.beyond = [
            tail.mul(tail).mul_add(power, sums.beyond[0]),
            sums.beyond[1].add(beyond),
        ];
        sums.further = [sums.further[0].add(further[0]), sums.further[1].add(further[1])];
        sums.longest = sums.longest.max(longest.select(!power.at_most(zero), zero));

        Numbers {
            phase: stored(phase),
            offset: stored(offset),
            cell: stored(narrow::<f32, I, P>(cell)),
            mask: (tables.num_cells - 1) as u32,
            degree,
            turns: stored_all(turns),
            along: stored_all(along),
            across: stored_all(across),
            has_quarter,
        }
    }

    /// Phase that is left out whatever the steps [rad], phase that bends within a chirp [rad], sum of the coefficients
    /// after the third [turns], and masks of the paths that need coefficient 4, 5, 6, 7.
    #[cfg_attr(optimised, inline(always))]
    fn left_out<I: Isa>(
        &self,
        turns: &[I::F32; NUM_TURNS],
        detuned: I::F32,
    ) -> (I::F32, I::F32, I::F32, [u32; NUM_TURNS - FEWEST_TURNS]) {
        let tables = self.tables;
        let zero = I::F32::splat(0.0);
        let (mut drift, mut rate, mut bend, mut cube) = (zero, zero, zero, zero);
        let (mut tail, mut degree) = (zero, [0; NUM_TURNS - FEWEST_TURNS]);
        let least = I::F32::splat(self.least_turns);
        for k in (0..NUM_TURNS).rev() {
            let size = absolute(turns[k]);
            let weights = &self.weights[k];
            drift = drift.add(size);
            rate = size.mul_add(I::F32::splat(weights.rate), rate);
            bend = size.mul_add(I::F32::splat(weights.bend), bend);
            cube = size.mul_add(I::F32::splat(weights.cube), cube);
            if k >= FEWEST_TURNS {
                tail = tail.add(size);
                degree[k - FEWEST_TURNS] = !tail.at_most(least);
            }
        }
        let turn = std::f32::consts::TAU;
        let ramp = (tables.slope / tables.carrier).abs();
        let detuned = absolute(detuned);
        // Coefficients beyond the degree, and the third order.
        let mut left_out = tail.min(least).mul_add(I::F32::splat(turn), cube);
        // Places of records whose frequency is not the carrier, or that is no more for long ways.
        let shift = detuned.mul_add(
            drift,
            drift.mul(rate).mul(I::F32::splat((1.0 / tables.carrier.abs()) as f32)),
        );
        let per_shift = TAU * tables.moments.square.sqrt() * ramp;
        left_out = shift.mul_add(I::F32::splat(per_shift as f32), left_out);
        left_out = bend.mul(detuned).mul_add(I::F32::splat(1.2), left_out);
        // Squares of changes of the delay beyond that of the linear term.
        let first = absolute(turns[0]);
        let further = drift.sub(first);
        let square = first.add(first).add(further).mul(further);
        let per_square = 0.5 * TAU * ramp / tables.carrier.abs();
        left_out = square.mul_add(I::F32::splat(per_square as f32), left_out);
        // Rounding of turns in single precision.
        left_out = drift.mul_add(I::F32::splat(turn * f32::EPSILON), left_out);
        (left_out, bend, tail, degree)
    }

    /// Directions of the conjugates of the first coefficients of amplitudes, and their arguments [turns].
    #[cfg_attr(optimised, inline(always))]
    fn direction<I: Isa>(paths: &Coefficients, at: usize) -> ([I::F32; 2], I::F32) {
        let none = I::F32::splat(0.0);
        let (x, y) = (
            I::F32::load(&paths.re[0][at..]),
            none.sub(I::F32::load(&paths.im[0][at..])),
        );
        let square = x.mul_add(x, y.mul(y));
        let least = I::F32::splat(NO_AMPLITUDE);
        let one = I::F32::splat(1.0);
        let inverse = one.div(square.max(least).sqrt());
        let is_none = square.at_most(least);
        let size = angle(y, x).mul(I::F32::splat(std::f32::consts::TAU.recip()));
        let argument = none.select(is_none, none.sub(size).select(y.at_most(none), size));
        (
            [
                one.select(is_none, x.mul(inverse)),
                none.select(is_none, y.mul(inverse)),
            ],
            argument,
        )
    }
}

/// Sixteen paths, by number.
struct Numbers {
    phase: [f32; LANES],
    offset: [f32; LANES],
    cell: [f32; LANES],
    /// Number of cells less one.
    mask: u32,
    degree: [u32; NUM_TURNS - FEWEST_TURNS],
    turns: [[f32; LANES]; NUM_TURNS],
    along: [[f32; LANES]; NUM_AMPLITUDES],
    across: [[f32; LANES]; NUM_AMPLITUDES],
    has_quarter: u32,
}

impl Numbers {
    /// Put one path into a batch.
    #[cfg_attr(optimised, inline(always))]
    fn put(&self, lane: usize, is_moving: bool, batch: &mut Batch) {
        let cell = self.cell[lane] as i32;
        let cell = cell.cast_unsigned() & self.mask;
        if !is_moving {
            batch.still.push(Still {
                phase: self.phase[lane],
                offset: self.offset[lane],
                cell,
                amplitude: self.along[0][lane],
            });
            return;
        }
        batch.num_moving += 1;
        let mut record = Record {
            phase: self.phase[lane],
            offset: self.offset[lane],
            cell,
            degree: FEWEST_TURNS as u32,
            ..Record::default()
        };
        for k in 0..NUM_TURNS {
            record.turns[k] = self.turns[k][lane];
        }
        for k in 0..NUM_TURNS - FEWEST_TURNS {
            record.degree += self.degree[k] >> lane & 1;
        }
        for k in 0..NUM_AMPLITUDES {
            record.amplitude[k] = self.along[k][lane];
        }
        if record.amplitude != [0.0; NUM_AMPLITUDES] {
            batch.moving.push(record);
        }
        if self.has_quarter >> lane & 1 == 1 {
            record.phase += 0.25;
            for k in 0..NUM_AMPLITUDES {
                record.amplitude[k] = self.across[k][lane];
            }
            batch.moving.push(record);
        }
    }
}

/// Sums of errors, one per lane.
struct Sums<V> {
    power: V,
    phase: V,
    bend: V,
    bend_squared: V,
    amplitude: V,
    further: [V; 2],
    beyond: [V; 2],
    longest: V,
}

impl<V: Vector<Scalar = f32>> Sums<V> {
    #[cfg_attr(optimised, inline(always))]
    fn new() -> Self {
        let zero = V::splat(0.0);
        Self {
            power: zero,
            phase: zero,
            bend: zero,
            bend_squared: zero,
            amplitude: zero,
            further: [zero; 2],
            beyond: [zero; 2],
            longest: zero,
        }
    }

    #[cfg_attr(optimised, inline(always))]
    fn take_in(&mut self, power: V, left_out: V, bend: V, amplitude: V) {
        let square = bend.mul(bend);
        self.power = self.power.add(power);
        self.phase = left_out.mul(left_out).mul_add(power, self.phase);
        self.bend = square.mul_add(power, self.bend);
        self.bend_squared = square.mul(square).mul_add(power, self.bend_squared);
        self.amplitude = self.amplitude.add(amplitude);
    }

    #[cfg_attr(optimised, inline(always))]
    fn errors(&self) -> Errors {
        Errors {
            power: total(self.power),
            phase: total(self.phase),
            bend: total(self.bend),
            bend_squared: total(self.bend_squared),
            amplitude: total(self.amplitude),
            further_phase: total(self.further[0]),
            further_amplitude: total(self.further[1]),
            beyond_third: total(self.beyond[0]),
            beyond_fourth: total(self.beyond[1]),
            longest: f64::from(self.longest.largest()),
            coherence: 1.0,
        }
    }
}

/// Sum of the lanes.
#[cfg_attr(optimised, inline(always))]
fn total<V: Vector<Scalar = f32>>(numbers: V) -> f64 {
    let mut sum = 0.0;
    for number in stored(numbers) {
        sum += f64::from(number);
    }
    sum
}

#[cfg_attr(optimised, inline(always))]
fn absolute<V: Vector>(x: V) -> V {
    x.max(V::splat(V::Scalar::default()).sub(x))
}

#[cfg_attr(optimised, inline(always))]
fn stored<V: Vector<Scalar = f32>>(numbers: V) -> [f32; LANES] {
    let mut lanes = [0.0; LANES];
    numbers.store(&mut lanes);
    lanes
}

#[cfg_attr(optimised, inline(always))]
fn stored_all<V: Vector<Scalar = f32>, const N: usize>(numbers: [V; N]) -> [[f32; LANES]; N] {
    let mut lanes = [[0.0; LANES]; N];
    for k in 0..N {
        numbers[k].store(&mut lanes[k]);
    }
    lanes
}
