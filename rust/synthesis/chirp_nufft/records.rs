//! Records of paths: phases and places, computed in double precision, and the errors of what records leave out.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::marker::PhantomData;
use std::ops::Range;

use super::fast_time::{FastTime, Orders};
use super::number::{LaneRow, MAX_LANES, MAX_ORDERS, Number};
use crate::numeric::simd::{Isa, Kernel, Level, Real, Vector};
use crate::numeric::trig::angle;
use crate::numeric::wide::{self, Wide, mul, narrow, neg_mul_add, number, sub, total};
use crate::synthesis::chunk::{Block, CHUNK, Chunk, expand};
use crate::synthesis::source::{PathSource, Request, Shape};

/// Shares of the tolerance below which coefficients do not count: of delays [turns], and of amplitudes relative to them.
const TURNS_SHARE: f64 = 0.004;
const AMPLITUDE_SHARE: f64 = 0.01;

/// Largest carrier over the frequency received.
const MAX_CARRIER_RATIO: f64 = 4.0;

/// Largest coefficient of a lower degree in a product of Legendre polynomials, relative to the factors.
const LOWER_DEGREE: f64 = 2.0;

/// Squared magnitude of scaled amplitudes that have no direction.
const NO_AMPLITUDE: f64 = 1e-36;

/// Safety factor of the truncation error: echoes of a smooth surface cancel except at its ends, which may have the
/// largest phase curvature. Without it, errors of plates were up to 1.25 times the bound.
const SAFETY: f64 = 1.5;

/// Rows of a record: constant part of the phase at the middle sample, with the argument of the amplitude [turns].
pub const PHASE: usize = 0;
/// Constant part of the place on the grid: the cell, and the place after it, -1/2 to 1/2 [cells].
pub const CELL: usize = 1;
pub const OFFSET: usize = 2;
/// Carrier over the frequency that is received at the same time.
pub const CARRIER_RATIO: usize = 3;
/// Number of these rows.
pub const HEAD: usize = 4;

/// Numbers of coefficients of static paths, see [`Batch::counts`].
pub const STATIC: [usize; 2] = [0, 1];

/// Records of some paths of a channel. Each has the rows of [`MAX_LANES`] paths: the head, the coefficients of the delay
/// after the constant one [turns at the frequency received], and of the amplitude in phase and in quadrature with the
/// first one.
#[derive(Clone, Debug)]
pub struct Batch<T> {
    /// Number of paths; lanes after the last path have no amplitude.
    pub num_paths: usize,
    /// Numbers of coefficients of the delay after the constant one, and of the amplitude.
    pub counts: [usize; 2],
    /// Records of every block.
    pub blocks: Vec<Vec<LaneRow<T>>>,
    /// Numbers of the coefficients that count in every record of every block: of the delay, of the amplitude in phase, and of
    /// that in quadrature.
    pub used: Vec<Vec<[usize; 3]>>,
    /// Errors of these paths.
    pub errors: Errors<f64>,
}

impl<T> Batch<T> {
    /// Rows of a record.
    pub fn num_rows(&self) -> usize {
        let [num_turns, num_amplitudes] = self.counts;
        HEAD + num_turns + 2 * num_amplitudes
    }

    /// Number of paths of a record.
    pub fn paths_of(&self, record: usize) -> usize {
        (self.num_paths - record * MAX_LANES).min(MAX_LANES)
    }
}

/// Numbers of coefficients in the records of paths, see [`Batch::counts`].
pub fn counts<T: Number>(shape: &Shape) -> [usize; 2] {
    let turns = (shape.delay_rows - 1).min(T::NUM_TURNS);
    [turns, shape.amplitude_rows.min(T::NUM_AMPLITUDES)]
}

/// Errors of a sum that are known before it, summed over paths of a channel, mean over the blocks; amplitudes are scaled.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors<V> {
    /// Power: mean over the frame of the square of the amplitudes [W].
    pub power: V,
    /// Power of the strongest path in a block [W].
    pub strongest: V,
    /// Squared truncation error of a long block: coefficients beyond the records [W].
    pub series: V,
    /// Squares of the rounding of coefficients of delays, each of them rounded by one [rad^2 W].
    pub rounding: V,
    /// Squares of what the first order leaves out [rad^2 W]: products of changes within a chirp, phases of squared delays,
    /// and the effect of the frequency received on places.
    pub products: V,
    /// Squares of the Legendre polynomials of fast time within a chirp, by degree [W].
    pub orders: [V; MAX_ORDERS],
    /// Largest delay of a path with power [s].
    pub longest: V,
}

impl<V: Vector> Errors<V> {
    #[cfg_attr(optimised, inline(always))]
    fn new() -> Self {
        let zero = V::splat(V::Scalar::default());
        Self {
            power: zero,
            strongest: zero,
            series: zero,
            rounding: zero,
            products: zero,
            orders: [zero; MAX_ORDERS],
            longest: zero,
        }
    }

    /// Sums over the lanes.
    #[cfg_attr(optimised, inline(always))]
    fn total(&self) -> Errors<f64> {
        let mut orders = [0.0; MAX_ORDERS];
        for n in 0..MAX_ORDERS {
            orders[n] = total(self.orders[n]);
        }
        Errors {
            power: total(self.power),
            strongest: self.strongest.largest().wide(),
            series: total(self.series),
            rounding: total(self.rounding),
            products: total(self.products),
            orders,
            longest: self.longest.largest().wide(),
        }
    }
}

impl Errors<f64> {
    /// Add the errors of other paths, times a weight.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.power += weight * other.power;
        self.strongest = self.strongest.max(other.strongest);
        self.series += weight * other.series;
        self.rounding += weight * other.rounding;
        self.products += weight * other.products;
        for (sum, order) in self.orders.iter_mut().zip(other.orders) {
            *sum += weight * order;
        }
        self.longest = self.longest.max(other.longest);
    }

    /// Error of truncated series, rms over the samples relative to the l2 norm of the amplitudes, for paths of independent
    /// phases, where orders of fast time are left out whose squares have this sum.
    pub fn truncation(&self, fast_time: &FastTime, orders: f64) -> f64 {
        if self.power == 0.0 {
            return 0.0;
        }
        SAFETY * fast_time.waveform.fluctuation() * ((self.series + orders) / self.power).sqrt()
    }

    /// Error of blocks that are too long, which shorter ones have not; likewise.
    pub fn of_blocks<T: Number>(&self, fast_time: &FastTime) -> f64 {
        self.truncation(fast_time, 0.0).hypot(self.rounding::<T>())
    }

    /// Rounding of the coefficients of delays, likewise.
    pub fn rounding<T: Number>(&self) -> f64 {
        SAFETY * T::OF_COEFFICIENT * (self.rounding / self.power.max(f64::MIN_POSITIVE)).sqrt()
    }

    /// Share of the strongest path in the power, at most 1.
    pub fn share_of_strongest(&self) -> f64 {
        (self.strongest / self.power.max(f64::MIN_POSITIVE)).min(1.0)
    }
}

/// Records of some chunks of paths of some channels.
pub struct Build<'a, T> {
    pub fast_time: &'a FastTime<'a>,
    /// See [`FastTime::sizes`].
    pub sizes: &'a [f64; MAX_ORDERS],
    pub source: &'a dyn PathSource,
    /// Blocks of chirps, and the orders of fast time of Chebyshev polynomials in them.
    pub blocks: &'a [(Block, Vec<Orders>)],
    pub channels: Range<usize>,
    pub chunks: Range<usize>,
    pub scale: f64,
    pub tolerance: f64,
    pub level: Level,
    pub number: PhantomData<T>,
}

/// Sizes of the coefficients of a vector of paths in a block, with the part that their records leave out.
struct Sizes<V> {
    /// Coefficients of the delay after the constant one, and those beyond records [turns].
    drift: V,
    tail: V,
    /// Orders of the phase and of the amplitude, see [`Orders`], of coefficients of even and of odd degree.
    phase: [[V; MAX_ORDERS]; 2],
    change: [[V; MAX_ORDERS]; 2],
    /// Power, and its part beyond records [W].
    power: V,
    beyond: V,
    /// Coefficients of the amplitude that do not count.
    small: V,
    /// See [`CARRIER_RATIO`].
    carrier_ratio: V,
}

impl<T: Number> Kernel for Build<'_, T> {
    type Output = Vec<Batch<T>>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Vec<Batch<T>> {
        let shape = self.source.shape();
        let [delay_rows, amplitude_rows] = [shape.delay_rows, shape.amplitude_rows];
        let mut batches = Vec::with_capacity(self.channels.len());
        for _ in self.channels.clone() {
            let mut batch = Batch {
                num_paths: 0,
                counts: counts::<T>(&shape),
                blocks: vec![Vec::new(); self.blocks.len()],
                used: vec![Vec::new(); self.blocks.len()],
                errors: Errors::default(),
            };
            let most = (CHUNK * self.chunks.len()).min(shape.paths).div_ceil(MAX_LANES) * batch.num_rows();
            for records in &mut batch.blocks {
                records.reserve_exact(most);
            }
            batches.push(batch);
        }
        let mut chunk = Chunk::<T>::new(&shape, self.channels.len());
        // By degree in place of rows.
        let mut coefficients = Chunk::<T>::new(&shape, 1);
        let num_chirps = self.fast_time.waveform.chirp_times.len() as f64;
        for index in self.chunks.clone() {
            let request = Request::of_chunk(index, &shape, self.channels.clone(), self.scale, self.level);
            T::fill(self.source, &request, &mut chunk);
            coefficients.num_paths = chunk.num_paths;
            for (at, batch) in batches.iter_mut().enumerate() {
                let delays = &chunk.delay[at * delay_rows..][..delay_rows];
                let [re, im] = [&chunk.re, &chunk.im].map(|rows| &rows[at * amplitude_rows..][..amplitude_rows]);
                for (number, (block, orders)) in self.blocks.iter().enumerate() {
                    expand::<f64, I>(&block.delay, delays, &mut coefficients.delay);
                    expand::<T, I>(&block.amplitude, re, &mut coefficients.re);
                    expand::<T, I>(&block.amplitude, im, &mut coefficients.im);
                    let errors = if size_of::<T>() == 4 {
                        self.add::<I, 2>(&coefficients, orders, number, batch)
                    } else {
                        self.add::<I, 1>(&coefficients, orders, number, batch)
                    };
                    batch.errors.add(&errors, block.chirps.len() as f64 / num_chirps);
                }
                batch.num_paths += chunk.num_paths;
            }
        }
        batches
    }
}

impl<T: Number> Build<'_, T> {
    /// Add the records of paths to block `number` of a batch. Returns their errors.
    #[cfg_attr(optimised, inline(always))]
    fn add<I: Isa, const P: usize>(
        &self,
        paths: &Chunk<T>,
        orders: &[Orders],
        number: usize,
        batch: &mut Batch<T>,
    ) -> Errors<f64> {
        let mut errors = Errors::<T::In<I>>::new();
        let (num_rows, counts) = (batch.num_rows(), batch.counts);
        let (records, used) = (&mut batch.blocks[number], &mut batch.used[number]);
        for at in (0..paths.num_paths).step_by(T::LANES) {
            if at.is_multiple_of(MAX_LANES) {
                records.resize(records.len() + num_rows, [T::zero(); MAX_LANES]);
                used.push([0, 1, 0]);
            }
            let first = records.len() - num_rows;
            let record = &mut records[first..];
            let own = self.put::<I, P>(paths, at, (counts, record), orders, &mut errors);
            let last = used.len() - 1;
            for i in 0..3 {
                used[last][i] = used[last][i].max(own[i]);
            }
        }
        errors.total()
    }

    /// Put the paths of a vector, from `at` on, into a record, and add their errors. Returns the numbers of the coefficients
    /// that count, see [`Batch::used`].
    #[cfg_attr(optimised, inline(always))]
    fn put<I: Isa, const P: usize>(
        &self,
        paths: &Chunk<T>,
        at: usize,
        ([num_turns, num_amplitudes], record): ([usize; 2], &mut [LaneRow<T>]),
        orders: &[Orders],
        errors: &mut Errors<T::In<I>>,
    ) -> [usize; 3] {
        let lane = at % MAX_LANES;
        let zero = number::<T, I>(0.0);
        let (head, rows) = record.split_at_mut(HEAD);
        let (turns, amplitudes) = rows.split_at_mut(num_turns);
        let (direction, argument) = direction::<T, I>(paths, at);
        let (received, carrier_ratio) = self.put_constant::<I, P>(&paths.delay[0][at..], argument, head, lane);
        let (all, mut used) = (u32::MAX >> (32 - T::LANES), [0; 3]);

        let mut sizes = Sizes {
            drift: zero,
            tail: zero,
            phase: [[zero; MAX_ORDERS]; 2],
            change: [[zero; MAX_ORDERS]; 2],
            power: zero,
            beyond: zero,
            small: zero,
            carrier_ratio,
        };
        for k in 1..paths.delay.len() {
            let own = narrow::<T, I, P>(mul(wide::load::<I, P>(&paths.delay[k][at..]), received));
            let size = absolute(own);
            if k > num_turns {
                sizes.tail = sizes.tail.add(size);
                continue;
            }
            own.store(&mut turns[k - 1][lane..]);
            let is_small = size.at_most(number::<T, I>(TURNS_SHARE * self.tolerance));
            sizes.tail = sizes.tail.add(size.select(is_small, zero));
            if is_small != all {
                used[0] = k;
            }
            sizes.drift = sizes.drift.add(size);
            for n in 1..=T::DEGREE + 2 {
                let sum = &mut sizes.phase[k % 2][n];
                *sum = size.mul_add(number::<T, I>(orders[k].phase[n]), *sum);
            }
        }

        // Amplitudes along the direction of the first coefficient, and in quadrature; the conjugates.
        for k in 0..paths.re.len() {
            let re = <T::In<I>>::load(&paths.re[k][at..]);
            let im = zero.sub(<T::In<I>>::load(&paths.im[k][at..]));
            let r = im.mul_add(direction[1], re.mul(direction[0]));
            let s = re.neg_mul_add(direction[1], im.mul(direction[0]));
            let weight = number::<T, I>(if k == 0 { 1.0 } else { 0.5 });
            let square = r.mul_add(r, s.mul(s)).mul(weight);
            sizes.power = sizes.power.add(square);
            if k >= num_amplitudes {
                sizes.beyond = sizes.beyond.add(square);
                continue;
            }
            r.store(&mut amplitudes[k][lane..]);
            s.store(&mut amplitudes[num_amplitudes + k][lane..]);
            let size = absolute(r).add(absolute(s));
            if k > 0 {
                for n in 1..=T::DEGREE + 2 {
                    let order = number::<T, I>(orders[k].amplitude[n]);
                    sizes.change[k % 2][n] = size.mul_add(order, sizes.change[k % 2][n]);
                }
            }
        }
        let least = sizes.power.sqrt().mul(number::<T, I>(AMPLITUDE_SHARE * self.tolerance));
        for (part, of_part) in amplitudes.chunks_exact(num_amplitudes).enumerate() {
            let (sum, count) = small_ones::<T, I>(of_part, lane, least);
            (sizes.small, used[1 + part]) = (sizes.small.add(sum), count);
        }
        let constant = narrow::<T, I, P>(wide::load::<I, P>(&paths.delay[0][at..]));
        self.add_errors::<I>(&sizes, constant, errors);
        used
    }

    /// Add the errors of the paths of a vector.
    #[cfg_attr(optimised, inline(always))]
    fn add_errors<I: Isa>(&self, sizes: &Sizes<T::In<I>>, constant: T::In<I>, errors: &mut Errors<T::In<I>>) {
        let zero = number::<T, I>(0.0);
        let (drift, power, carrier_ratio) = (sizes.drift, sizes.power, sizes.carrier_ratio);
        // Orders of the amplitude times exp(j phase): of the factors, where even and odd functions of the time over the
        // block are orthogonal, and of products by their degree. A product of two polynomials has smaller coefficients of
        // all degrees than both together, of three somewhat larger ones.
        let size = power.sqrt();
        let detuned = absolute(carrier_ratio.sub(number::<T, I>(1.0)));
        let [mut phase, mut change, mut sums, mut products] = [[zero; MAX_ORDERS]; 4];
        for n in 1..=T::DEGREE + 2 {
            let [mut even, mut odd] = [sizes.phase[0][n], sizes.phase[1][n]];
            if n == 1 {
                (even, odd) = (even.mul(detuned), odd.mul(detuned));
            }
            phase[n] = even.add(odd);
            let [x, y] = [&sizes.change[0], &sizes.change[1]];
            (even, odd) = (size.mul_add(even, x[n]), size.mul_add(odd, y[n]));
            change[n] = even.mul_add(even, odd.mul(odd)).sqrt();
            for m in 2..n {
                let part = number::<T, I>(m as f64 / (n - 1) as f64);
                products[n] = phase[m].mul(part).mul_add(sums[n - m], products[n]);
            }
            sums[n] = change[n].add(products[n]);
        }
        for n in 1..=T::DEGREE + 2 {
            let mut sum = change[n].add(products[n]);
            for m in (n + 2..=T::DEGREE + 2).step_by(2) {
                sum = products[m].mul_add(number::<T, I>(LOWER_DEGREE), sum);
            }
            let sum = sum.mul(number::<T, I>(self.sizes[n]));
            errors.orders[n] = sum.mul_add(sum, errors.orders[n]);
        }
        // Numbers that are not finite show in the sum.
        errors.power = constant.mul_add(zero, errors.power.add(power));
        errors.strongest = errors.strongest.max(power);
        let mut turned = zero;
        for n in 2..=T::DEGREE + 2 {
            turned = phase[n].mul_add(number::<T, I>(((2 * n + 1) as f64).sqrt()), turned);
        }
        let series = sizes.tail.mul(number::<T, I>(TAU));
        // Far from the carrier, the ratio has no digits; phases that turn tones by more have other cosines.
        let far = number::<T, I>(MAX_CARRIER_RATIO).at_most(absolute(carrier_ratio));
        let far = far | number::<T, I>(FRAC_PI_2).at_most(turned);
        let series = number::<T, I>(1.0).select(far, series).mul_add(size, sizes.small);
        errors.series = series.mul_add(series, errors.series.add(sizes.beyond));
        let curved = drift
            .mul(carrier_ratio)
            .mul(carrier_ratio)
            .mul(number::<T, I>(self.fast_time.per_square.abs()));
        let ramp = detuned.mul_add(number::<T, I>(self.fast_time.ratio.abs()), curved);
        let mut left = ramp.mul(drift).mul(size).mul(number::<T, I>(TAU));
        for n in 1..=T::DEGREE + 2 {
            // Root mean square of a product of polynomials of half its degree.
            let size = self.sizes[n] * ((n + 1) as f64).sqrt();
            left = products[n].mul_add(number::<T, I>(size), left);
        }
        errors.products = left.mul_add(left, errors.products);
        let rounding = drift.mul(number::<T, I>(TAU)).mul(size);
        errors.rounding = rounding.mul_add(rounding, errors.rounding);
        let per_turn = carrier_ratio.mul(number::<T, I>(self.fast_time.carrier.recip()));
        let longest = drift.mul_add(absolute(per_turn), absolute(constant));
        errors.longest = errors.longest.max(zero.select(power.at_most(zero), longest));
    }

    /// Put the head of a record for constant delays and arguments of the amplitudes [turns]. Returns the frequency received
    /// [Hz], and the carrier over it.
    #[cfg_attr(optimised, inline(always))]
    fn put_constant<I: Isa, const P: usize>(
        &self,
        delay: &[f64],
        argument: T::In<I>,
        head: &mut [LaneRow<T>],
        lane: usize,
    ) -> (Wide<I, P>, T::In<I>) {
        let fast_time = self.fast_time;
        let delay = wide::load::<I, P>(delay);
        let slope = fast_time.waveform.slope;
        // f tau - S tau^2 / 2
        let phase = wide::turns::<I, P>(fast_time.carrier, delay);
        let phase = neg_mul_add(mul(delay, wide::splat::<I, P>(0.5 * slope)), delay, phase);
        let phase = narrow::<T, I, P>(wide::reduce::<I, P>(phase)).add(argument);
        let carrier = wide::splat::<I, P>(fast_time.carrier);
        let received = neg_mul_add(delay, wide::splat::<I, P>(slope), carrier);
        let carrier_ratio = narrow::<T, I, P>(carrier).div(narrow::<T, I, P>(received));
        let per_delay = fast_time.cells_per_turn * fast_time.ratio * fast_time.carrier;
        let place = mul(delay, wide::splat::<I, P>(per_delay));
        let cell = wide::round::<I, P>(place);
        let offset = narrow::<T, I, P>(sub(place, cell));
        let num_cells = fast_time.num_cells as f64;
        let rounds = wide::round::<I, P>(mul(cell, wide::splat::<I, P>(num_cells.recip())));
        let cell = narrow::<T, I, P>(neg_mul_add(rounds, wide::splat::<I, P>(num_cells), cell));
        phase.store(&mut head[PHASE][lane..]);
        cell.store(&mut head[CELL][lane..]);
        offset.store(&mut head[OFFSET][lane..]);
        carrier_ratio.store(&mut head[CARRIER_RATIO][lane..]);
        (received, carrier_ratio)
    }
}

/// Sum of the coefficients of the paths of a vector that are at most `least`, and the number of the others.
#[cfg_attr(optimised, inline(always))]
fn small_ones<T: Number, I: Isa>(rows: &[LaneRow<T>], lane: usize, least: T::In<I>) -> (T::In<I>, usize) {
    let (mut sum, mut count) = (number::<T, I>(0.0), 0);
    for (k, row) in rows.iter().enumerate() {
        let size = absolute(<T::In<I>>::load(&row[lane..]));
        let is_small = size.at_most(least);
        sum = sum.add(size.select(is_small, number::<T, I>(0.0)));
        if is_small != u32::MAX >> (32 - T::LANES) {
            count = k + 1;
        }
    }
    (sum, count)
}

/// Directions of the conjugates of the first coefficients of amplitudes, and their arguments [turns].
#[cfg_attr(optimised, inline(always))]
fn direction<T: Number, I: Isa>(paths: &Chunk<T>, at: usize) -> ([T::In<I>; 2], T::In<I>) {
    let zero = number::<T, I>(0.0);
    let (x, y) = (
        <T::In<I>>::load(&paths.re[0][at..]),
        zero.sub(<T::In<I>>::load(&paths.im[0][at..])),
    );
    let square = x.mul_add(x, y.mul(y));
    let least = number::<T, I>(NO_AMPLITUDE);
    let one = number::<T, I>(1.0);
    let inverse = one.div(square.max(least).sqrt());
    let is_none = square.at_most(least);
    let size = angle(y, x).mul(number::<T, I>(TAU.recip()));
    let argument = zero.select(is_none, zero.sub(size).select(y.at_most(zero), size));
    let direction = [
        one.select(is_none, x.mul(inverse)),
        zero.select(is_none, y.mul(inverse)),
    ];
    (direction, argument)
}

#[cfg_attr(optimised, inline(always))]
fn absolute<V: Vector>(x: V) -> V {
    x.max(V::splat(V::Scalar::default()).sub(x))
}
