//! From chunks of paths to records: phases and places in double precision, and what they leave out.

use std::f64::consts::TAU;

use super::errors::Errors;
use super::number::{FEWEST_TURNS, MAX_AMPLITUDES, MAX_EVEN, MAX_LANES, MAX_ODD, MAX_TURNS, Number};
use super::record::{Batch, Numbers};
use super::tables::{Moments, Tables};
use crate::numeric::simd::{Isa, Real, Vector};
use crate::numeric::trig::angle;
use crate::numeric::wide::{self, Wide, add, mul, mul_add, narrow, neg_mul_add, number, sub};
use crate::synthesis::chunk::{Block, Lane};

/// Share of the tolerance that coefficients beyond the degree of a path may turn its phase by [turns].
const TURNS_SHARE: f64 = 0.01;

/// Share of the tolerance for the quadrature of an amplitude.
const QUADRATURE_SHARE: f64 = 0.02;

/// Rms over the samples of a fourth power of fast time that takes its mean with it, at most.
const REST: f64 = 0.3;

/// Largest share of a delay in its phase relative to that at the carrier, and the error of phases beyond [rad].
const MOST_SHARE: f64 = 16.0;
const HOPELESS: f64 = 10.0;

/// Squared magnitude of scaled amplitudes that have no direction.
const NO_AMPLITUDE: f64 = 1e-36;

/// Coefficients of paths of a channel over a block, by degree: delays [s], parts of amplitudes times a scale.
#[derive(Clone, Copy)]
pub struct Coefficients<'a, T> {
    /// Number of paths; lanes after the last path have no amplitude.
    pub num_paths: usize,
    /// Coefficients of the delays.
    pub delay: &'a [Lane<f64>],
    /// Real parts of the coefficients of the amplitudes.
    pub re: &'a [Lane<T>],
    /// Imaginary parts.
    pub im: &'a [Lane<T>],
}

/// Builder of the records of a block.
#[derive(Clone, Debug)]
pub struct Builder<'a> {
    tables: &'a Tables<'a>,
    tolerance: f64,
    /// Weights of the coefficients of phases and of amplitudes.
    weights: Vec<Weights>,
}

/// Weights of a coefficient in bounds over a block of what changes within a chirp: |T_k'| <= k^2, and so on.
#[derive(Clone, Copy, Debug, Default)]
struct Weights {
    /// Orders 1 to 4 of fast time of the amplitude; the fourth as an error.
    slope: f64,
    bend: f64,
    third: f64,
    fourth: f64,
    /// Orders 2 to 4 of fast time of the phase [rad per turn]; the fourth as an error.
    phase_curvature: f64,
    phase_third: f64,
    phase_fourth: f64,
}

impl Weights {
    fn new(k: usize, step: f64, ratio: f64) -> Self {
        let square = (k * k) as f64;
        let slope = square * step;
        let bend = slope * (square - 1.0).max(0.0) / 3.0 * step / 2.0;
        let third = bend * (square - 4.0).max(0.0) / 5.0 * step / 3.0;
        let fourth = third * (square - 9.0).max(0.0) / 7.0 * step / 4.0;
        Self {
            slope,
            bend,
            third,
            fourth: REST * fourth,
            phase_curvature: TAU * (bend + ratio * slope),
            phase_third: TAU * (third + ratio * bend),
            phase_fourth: REST * TAU * (fourth + ratio * third),
        }
    }
}

/// Bounds of the phases of some paths over the block.
struct PhaseBounds<V> {
    /// Sum of the coefficients [turns].
    drift: V,
    /// Curvature and third order within a chirp [rad].
    curvature: V,
    third: V,
    /// Phases that are left out: whatever the grids, by a single grid, and as the block is long [rad].
    always: V,
    carrier: V,
    series: V,
}

impl<'a> Builder<'a> {
    /// Builder for a tolerance.
    pub fn new(tables: &'a Tables, block: &Block, num_rows: usize, tolerance: f64) -> Self {
        let (step, ratio) = (tables.waveform.half_sweep() / block.half, tables.ratio().abs());
        Self {
            tables,
            tolerance,
            weights: (0..=num_rows.max(MAX_TURNS))
                .map(|k| Weights::new(k, step, ratio))
                .collect(),
        }
    }

    /// Add paths to block `number` of a batch, or to its static ones.
    #[cfg_attr(optimised, inline(always))]
    pub fn add<T: Number, I: Isa, const P: usize>(
        &self,
        paths: &Coefficients<T>,
        (number, share): (usize, f64),
        is_static: bool,
        batch: &mut Batch<T>,
    ) {
        let mut sums = Sums::<T::In<I>>::new();
        let mut numbers = Numbers::new((self.tables.num_cells - 1) as u32, paths.re.len());
        for at in (0..paths.num_paths).step_by(T::LANES) {
            self.vector::<T, I, P>(paths, at, &mut sums, &mut numbers);
            for lane in 0..T::LANES.min(paths.num_paths - at) {
                if is_static {
                    numbers.add_static(lane, &mut batch.statics);
                } else {
                    numbers.add_moving(lane, &mut batch.blocks[number]);
                }
            }
        }
        batch.errors.add(&sums.errors(), share);
    }

    /// Numbers of the paths of a vector, from `at` on.
    #[cfg_attr(optimised, inline(always))]
    fn vector<T: Number, I: Isa, const P: usize>(
        &self,
        paths: &Coefficients<T>,
        at: usize,
        sums: &mut Sums<T::In<I>>,
        numbers: &mut Numbers<T>,
    ) {
        let tables = self.tables;
        let zero = <T::In<I>>::splat(T::zero());
        let constant = wide::load::<I, P>(&paths.delay[0][at..]);
        let cells = mul(constant, wide::splat::<I, P>(tables.cells_per_delay()));
        let whole = wide::round::<I, P>(cells);
        let mut offset = sub(cells, whole);
        let num_cells = tables.num_cells as f64;
        let rounds = wide::round::<I, P>(mul(whole, wide::splat::<I, P>(num_cells.recip())));
        let cell = neg_mul_add(rounds, wide::splat::<I, P>(num_cells), whole);

        // Phase at the constant delay: f tau - S tau^2 / 2.
        let half_slope = wide::splat::<I, P>(0.5 * tables.waveform.slope);
        let mut phase = wide::turns::<I, P>(tables.carrier, constant);
        phase = neg_mul_add(mul(constant, half_slope), constant, phase);
        let mut turns = [zero; MAX_TURNS];
        let mut tail = zero;
        let squares = Self::turns::<T, I, P>(tables, paths, at, &mut turns, &mut tail);
        phase = sub(phase, squares);

        // Received at f - S tau, the delay is a larger share of the phase than at the carrier.
        let received = wide::splat::<I, P>(-tables.waveform.slope / tables.carrier);
        let received = mul_add(constant, received, wide::splat::<I, P>(1.0));
        let most = wide::splat::<I, P>(MOST_SHARE);
        let share = wide::max(
            wide::min(wide::div(wide::splat::<I, P>(1.0), received), most),
            wide::splat::<I, P>(-MOST_SHARE),
        );
        let per_turn = wide::splat::<I, P>(tables.cells_per_turn * tables.ratio());
        offset = neg_mul_add(mul(squares, share), per_turn, offset);
        let carrier_offset = mul(sub(share, wide::splat::<I, P>(1.0)), per_turn);
        let delay = narrow::<T, I, P>(constant);
        let share = narrow::<T, I, P>(share);
        let (bounds, counts) = self.phase_bounds::<T, I>(&turns, tail, share, paths.delay.len());

        let (direction, argument) = direction::<T, I>(paths, at);
        let phase = narrow::<T, I, P>(wide::reduce::<I, P>(phase)).add(argument);
        let (mut in_phase, mut quadrature) = ([zero; MAX_AMPLITUDES], [zero; MAX_AMPLITUDES]);
        let amplitude = self.amplitude::<T, I>(paths, at, direction, &mut in_phase, &mut quadrature);
        let least = (QUADRATURE_SHARE * self.tolerance).powi(2);
        let has_quadrature = !amplitude.quadrature.at_most(amplitude.power.mul(number::<T, I>(least)));

        let left_out = zero.select(has_quadrature, amplitude.quadrature);
        sums.add((&tables.moments, T::MOST_GRIDS), &bounds, &amplitude, left_out);
        // Numbers that are not finite show in the sum.
        sums.power = delay.mul_add(zero, sums.power);
        let longest = bounds
            .drift
            .mul_add(number::<T, I>(tables.carrier.abs().recip()), absolute(delay));
        let is_zero = amplitude.power.at_most(zero);
        sums.longest = sums.longest.max(zero.select(is_zero, longest));
        phase.store(&mut numbers.phase);
        narrow::<T, I, P>(offset).store(&mut numbers.offset);
        narrow::<T, I, P>(carrier_offset).store(&mut numbers.carrier_offset);
        narrow::<T, I, P>(cell).store(&mut numbers.cell);
        for k in 0..T::NUM_TURNS {
            turns[k].store(&mut numbers.turns[k]);
        }
        for k in 0..T::NUM_AMPLITUDES {
            in_phase[k].store(&mut numbers.in_phase[k]);
            quadrature[k].store(&mut numbers.quadrature[k]);
        }
        (numbers.counts, numbers.has_quadrature) = (counts, has_quadrature);
    }

    /// Coefficients of the phase [turns], and the sum of the magnitudes of those beyond: those of the delay times the
    /// frequency received, less S / 2 times the square of the change of the delay. Returns the constant part of the latter.
    #[cfg_attr(optimised, inline(always))]
    fn turns<T: Number, I: Isa, const P: usize>(
        tables: &Tables,
        paths: &Coefficients<T>,
        at: usize,
        turns: &mut [T::In<I>; MAX_TURNS],
        tail: &mut T::In<I>,
    ) -> Wide<I, P> {
        let slope = wide::splat::<I, P>(tables.waveform.slope);
        let constant = wide::load::<I, P>(&paths.delay[0][at..]);
        let received = neg_mul_add(slope, constant, wide::splat::<I, P>(tables.carrier));
        let zero = wide::splat::<I, P>(0.0);
        let mut wide_turns = [zero; MAX_TURNS];
        let num_rows = paths.delay.len();
        let number = num_rows.min(T::NUM_TURNS + 1);
        for k in 1..number {
            wide_turns[k - 1] = mul(wide::load::<I, P>(&paths.delay[k][at..]), received);
        }
        for k in number..num_rows {
            let beyond = mul(wide::load::<I, P>(&paths.delay[k][at..]), received);
            *tail = tail.add(absolute(narrow::<T, I, P>(beyond)));
        }
        // T_i T_j = (T_(i+j) + T_|i-j|) / 2.
        let quarter = wide::splat::<I, P>(0.25 * tables.waveform.slope);
        let half = wide::splat::<I, P>(0.5 * tables.waveform.slope);
        let mut constant = zero;
        let num_squares = number.min(T::NUM_SQUARES + 1);
        for i in 1..num_squares {
            let first = wide::load::<I, P>(&paths.delay[i][at..]);
            for j in i..num_squares {
                let product = mul(first, wide::load::<I, P>(&paths.delay[j][at..]));
                let product = mul(product, if i == j { quarter } else { half });
                if i == j {
                    constant = add(constant, product);
                } else {
                    wide_turns[j - i - 1] = sub(wide_turns[j - i - 1], product);
                }
                if i + j <= T::NUM_TURNS {
                    wide_turns[i + j - 1] = sub(wide_turns[i + j - 1], product);
                } else {
                    *tail = tail.add(absolute(narrow::<T, I, P>(product)));
                }
            }
        }
        for k in 0..T::NUM_TURNS {
            turns[k] = narrow::<T, I, P>(wide_turns[k]);
        }
        constant
    }

    /// Bounds of phases, and masks of the paths for which each coefficient counts.
    #[cfg_attr(optimised, inline(always))]
    fn phase_bounds<T: Number, I: Isa>(
        &self,
        turns: &[T::In<I>; MAX_TURNS],
        tail: T::In<I>,
        share: T::In<I>,
        num_rows: usize,
    ) -> (PhaseBounds<T::In<I>>, [u32; MAX_TURNS]) {
        let tables = self.tables;
        let zero = <T::In<I>>::splat(T::zero());
        let (mut drift, mut curvature, mut third, mut fourth) = (zero, zero, zero, zero);
        let (mut beyond, mut squares, mut counts) = (zero, zero, [0; MAX_TURNS]);
        let least = number::<T, I>(TURNS_SHARE * self.tolerance);
        for k in (0..T::NUM_TURNS).rev() {
            let (size, weights) = (absolute(turns[k]), &self.weights[k + 1]);
            drift = drift.add(size);
            curvature = size.mul_add(number::<T, I>(weights.phase_curvature), curvature);
            third = size.mul_add(number::<T, I>(weights.phase_third), third);
            fourth = size.mul_add(number::<T, I>(weights.phase_fourth), fourth);
            if k >= FEWEST_TURNS {
                beyond = beyond.add(size);
                counts[k] = !beyond.at_most(least);
            }
            if k + 1 > T::NUM_SQUARES {
                squares = drift;
            }
        }
        let last = &self.weights[num_rows.max(1) - 1];
        curvature = tail.mul_add(number::<T, I>(last.phase_curvature), curvature);
        // The delay is (s r + p s^3 r^2 / 2 + p^2 s^5 r^3 / 2 + ..) / carrier for a phase of r turns, a share s and p per turn.
        let one = number::<T, I>(1.0);
        let (size, carrier_offset) = (absolute(share), absolute(share.sub(one)));
        let (square, more) = (size.mul(size), size.max(one));
        let cube = square.mul(size);
        (curvature, third) = (curvature.mul(more), third.mul(more));
        let mut always = beyond.min(least).mul_add(number::<T, I>(TAU), fourth);
        always = third.mul(third).mul_add(number::<T, I>(0.5), always);
        let rms = tables.moments.square.sqrt();
        let ratio = tables.ratio().abs();
        let per_turn = tables.waveform.slope.abs() / tables.carrier.powi(2);
        // Places and curvatures of a single grid are those of the carrier.
        let share = drift.mul(cube).mul_add(number::<T, I>(0.5 * per_turn), carrier_offset);
        let shift = drift.mul(share).mul(number::<T, I>(TAU * rms * ratio));
        let carrier = curvature
            .mul(carrier_offset)
            .mul_add(number::<T, I>(tables.moments.even[1]), shift);
        // The square of r has no share, the cube is left out, and so is the square of the mean of what the share bends.
        let cubes = drift.mul(cube.mul(square)).mul(number::<T, I>(per_turn));
        let cubes = cubes.add(absolute(cube.sub(one)));
        let weight = number::<T, I>(0.5 * per_turn * TAU * rms * ratio);
        always = drift.mul(drift).mul(cubes).mul_add(weight, always);
        let bent = curvature.mul(carrier_offset);
        always = bent.mul(bent).mul_add(number::<T, I>(0.5), always);
        // Squares of the change of the delay without most products.
        let product = drift.add(drift).mul(squares).mul(square);
        always = product.mul_add(number::<T, I>(0.5 * TAU * per_turn), always);
        if num_rows > 1 {
            // Received near frequency zero, the phase does not tell the delay.
            let is_told = size.at_most(number::<T, I>(0.99 * MOST_SHARE));
            always = always.select(is_told, number::<T, I>(HOPELESS));
        }
        let bounds = PhaseBounds {
            drift: drift.add(tail),
            curvature,
            third,
            always,
            carrier,
            series: tail.mul(number::<T, I>(TAU)),
        };
        (bounds, counts)
    }

    /// Conjugate amplitudes along the direction of the first coefficient and in quadrature, and their bounds.
    #[cfg_attr(optimised, inline(always))]
    fn amplitude<T: Number, I: Isa>(
        &self,
        paths: &Coefficients<T>,
        at: usize,
        direction: [T::In<I>; 2],
        in_phase: &mut [T::In<I>; MAX_AMPLITUDES],
        quadrature: &mut [T::In<I>; MAX_AMPLITUDES],
    ) -> AmplitudeBounds<T::In<I>> {
        let zero = <T::In<I>>::splat(T::zero());
        let mut bounds = AmplitudeBounds {
            power: zero,
            quadrature: zero,
            beyond: zero,
            slope: zero,
            bend: zero,
            third: zero,
            fourth: zero,
        };
        for k in 0..paths.re.len() {
            let re = <T::In<I>>::load(&paths.re[k][at..]);
            let im = zero.sub(<T::In<I>>::load(&paths.im[k][at..]));
            let r = im.mul_add(direction[1], re.mul(direction[0]));
            let s = re.neg_mul_add(direction[1], im.mul(direction[0]));
            let weight = number::<T, I>(if k == 0 { 1.0 } else { 0.5 });
            let (r_square, s_square) = (r.mul(r).mul(weight), s.mul(s).mul(weight));
            bounds.power = bounds.power.add(r_square.add(s_square));
            if k < T::NUM_AMPLITUDES {
                (in_phase[k], quadrature[k]) = (r, s);
                bounds.quadrature = bounds.quadrature.add(s_square);
            } else {
                bounds.beyond = bounds.beyond.add(r_square.add(s_square));
            }
            let (size, weights) = (absolute(r).add(absolute(s)), &self.weights[k]);
            bounds.slope = size.mul_add(number::<T, I>(weights.slope), bounds.slope);
            bounds.bend = size.mul_add(number::<T, I>(weights.bend), bounds.bend);
            bounds.third = size.mul_add(number::<T, I>(weights.third), bounds.third);
            bounds.fourth = size.mul_add(number::<T, I>(weights.fourth), bounds.fourth);
        }
        bounds
    }
}

/// Bounds of the amplitudes of some paths over the block.
struct AmplitudeBounds<V> {
    /// Mean square.
    power: V,
    /// Mean squares of the quadrature, and of the coefficients beyond those of a record.
    quadrature: V,
    beyond: V,
    /// Orders 1 to 4 of fast time within a chirp.
    slope: V,
    bend: V,
    third: V,
    fourth: V,
}

/// Directions of the conjugates of the first coefficients of amplitudes, and their arguments [turns].
#[cfg_attr(optimised, inline(always))]
fn direction<T: Number, I: Isa>(paths: &Coefficients<T>, at: usize) -> ([T::In<I>; 2], T::In<I>) {
    let none = <T::In<I>>::splat(T::zero());
    let (x, y) = (
        <T::In<I>>::load(&paths.re[0][at..]),
        none.sub(<T::In<I>>::load(&paths.im[0][at..])),
    );
    let square = x.mul_add(x, y.mul(y));
    let least = number::<T, I>(NO_AMPLITUDE);
    let one = number::<T, I>(1.0);
    let inverse = one.div(square.max(least).sqrt());
    let is_none = square.at_most(least);
    let size = angle(y, x).mul(number::<T, I>(TAU.recip()));
    let argument = none.select(is_none, none.sub(size).select(y.at_most(none), size));
    let direction = [
        one.select(is_none, x.mul(inverse)),
        none.select(is_none, y.mul(inverse)),
    ];
    (direction, argument)
}

/// Sums of errors, one per lane.
struct Sums<V> {
    power: V,
    strongest: V,
    always: V,
    carrier: V,
    series: V,
    rounding: V,
    even: [V; MAX_EVEN + 2],
    odd: [V; MAX_ODD + 1],
    longest: V,
}

impl<V: Vector> Sums<V> {
    #[cfg_attr(optimised, inline(always))]
    fn new() -> Self {
        let zero = V::splat(V::Scalar::of(0.0));
        Self {
            power: zero,
            strongest: zero,
            always: zero,
            carrier: zero,
            series: zero,
            rounding: zero,
            even: [zero; MAX_EVEN + 2],
            odd: [zero; MAX_ODD + 1],
            longest: zero,
        }
    }

    #[cfg_attr(optimised, inline(always))]
    fn add(
        &mut self,
        (moments, most_grids): (&Moments, [usize; 2]),
        phase: &PhaseBounds<V>,
        amplitude: &AmplitudeBounds<V>,
        left_out: V,
    ) {
        let (power, size) = (amplitude.power, amplitude.power.sqrt());
        self.power = self.power.add(power);
        self.strongest = self.strongest.max(power);
        let always = phase.always.mul_add(size, amplitude.fourth);
        self.always = always.mul_add(always, self.always.add(left_out));
        let carrier = phase.carrier.mul(size);
        self.carrier = carrier.mul_add(carrier, self.carrier);
        let series = phase.series.mul(size);
        self.series = series.mul_add(series, self.series.add(amplitude.beyond));
        let drift = phase.drift.mul(splat(TAU));
        self.rounding = drift.mul(drift).mul_add(power, self.rounding);

        // Orders of (1 + slope u + bend v) exp(j (curvature v + third u^3)).
        let third = phase.third.mul_add(size, amplitude.third);
        let first = amplitude.slope.mul(splat(moments.odd[0]));
        let first = third.mul_add(splat(moments.cube), first);
        self.odd[0] = first.mul_add(first, self.odd[0]);
        let (mut even, mut bend) = (phase.curvature.mul(size), amplitude.bend);
        for n in 0..most_grids[0] + 2 {
            let sum = even.add(bend);
            self.even[n] = sum.mul_add(sum, self.even[n]);
            bend = bend.mul(phase.curvature).mul(splat(((n + 1) as f64).recip()));
            even = even.mul(phase.curvature).mul(splat(((n + 2) as f64).recip()));
        }
        let (mut odd, mut cube) = (amplitude.slope, third);
        for n in 1..=most_grids[1] {
            let share = phase.curvature.mul(splat((n as f64).recip()));
            odd = odd.mul(share);
            let sum = odd.add(cube);
            self.odd[n] = sum.mul_add(sum, self.odd[n]);
            cube = cube.mul(share);
        }
    }

    #[cfg_attr(optimised, inline(always))]
    fn errors(&self) -> Errors {
        let mut errors = Errors {
            power: total(self.power),
            strongest: self.strongest.largest().wide(),
            always: total(self.always),
            carrier: total(self.carrier),
            series: total(self.series),
            rounding: total(self.rounding),
            longest: self.longest.largest().wide(),
            ..Errors::default()
        };
        for n in 0..errors.even.len() {
            errors.even[n] = total(self.even[n]);
        }
        for n in 0..errors.odd.len() {
            errors.odd[n] = total(self.odd[n]);
        }
        errors
    }
}

#[cfg_attr(optimised, inline(always))]
fn splat<V: Vector>(x: f64) -> V {
    V::splat(V::Scalar::of(x))
}

/// Sum of the lanes.
#[cfg_attr(optimised, inline(always))]
fn total<V: Vector>(numbers: V) -> f64 {
    let mut sum = 0.0;
    for number in stored(numbers) {
        sum += number.wide();
    }
    sum
}

#[cfg_attr(optimised, inline(always))]
fn absolute<V: Vector>(x: V) -> V {
    x.max(V::splat(V::Scalar::default()).sub(x))
}

#[cfg_attr(optimised, inline(always))]
fn stored<V: Vector>(numbers: V) -> [V::Scalar; MAX_LANES] {
    let mut lanes = [V::Scalar::default(); MAX_LANES];
    numbers.store(&mut lanes);
    lanes
}
