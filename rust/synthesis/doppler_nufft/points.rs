//! Points of paths on the grid: coordinates and strengths.

use super::grid::{Layout, STEP};
use super::plan::DopplerPlan;
use crate::numeric::simd::{Isa, Kernel, Precision, Real, Vector};
use crate::numeric::wide::{self, Wide, add, max, min, mul, mul_add, neg_mul_add, sub};
use crate::synthesis::chunk::{Block, CHUNK, Chunk, Lane};
use crate::synthesis::coherence::{CellAxis, CellSums};

/// Points of a chunk of paths.
pub struct Points<T> {
    /// Number of paths.
    pub len: usize,
    /// Indices of the first numbers of the patches in the grid of a term, plus [`Real::ROUND`].
    rounded_start: Lane<f64>,
    /// Twice the offsets between two cells and between two rows, -1 to 1.
    pub offset: [Lane<T>; 2],
    /// Turns of phase from sample to sample, and velocity rows from the middle of the axis.
    places: [Lane<T>; 2],
    /// Strengths of every term: real and imaginary part of a path side by side.
    pub strengths: Vec<[T; 2 * CHUNK]>,
}

impl<T: Precision> Points<T> {
    /// Memory for some strengths per path.
    pub fn new(num_terms: usize) -> Self {
        Self {
            len: 0,
            rounded_start: [0.0; CHUNK],
            offset: [[T::zero(); CHUNK]; 2],
            places: [[T::zero(); CHUNK]; 2],
            strengths: vec![[T::zero(); 2 * CHUNK]; num_terms],
        }
    }

    /// Index of the first number of the patch of a path in the grid of a term: the lowest bits of the rounded number.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub fn start(&self, path: usize) -> usize {
        self.rounded_start[path].to_bits() as u32 as usize
    }
}

/// Measurements of the paths of a channel by a run.
pub struct Measured {
    /// Sum of the squared amplitudes, scaled.
    pub power: f64,
    /// The largest of them.
    pub strongest: f64,
    /// Longest delay [s].
    pub longest: f64,
    /// Coherence beside the frame.
    pub cells: CellSums,
}

impl Measured {
    /// Of no paths yet.
    pub fn new(plan: &DopplerPlan) -> Self {
        let (num_samples, times) = (plan.waveform.num_samples, &plan.waveform.chirp_times);
        let num_cells = Layout::new(num_samples, plan.width, 1).num_cells;
        let range = CellAxis {
            turns: 1.0,
            cells: 2.0 * num_samples as f64,
            edge: (num_cells - num_samples / 2) as f64,
        };
        // Half a frame is `STEP` turns per row, a period of the grid one turn.
        let interval = (times[times.len() - 1] - times[0]) / (times.len().max(2) - 1) as f64;
        let velocity = CellAxis {
            turns: plan
                .moving
                .map_or(0.0, |moving| moving.carrier * moving.step * interval),
            cells: 2.0 * times.len() as f64,
            edge: plan.moving.map_or(0.0, |_| 1.0 - STEP),
        };
        Self {
            power: 0.0,
            strongest: 0.0,
            longest: 0.0,
            cells: CellSums::new([range, velocity], plan.step),
        }
    }

    /// Add the measurements of other paths.
    pub fn join(&mut self, other: &Self) {
        self.power += other.power;
        self.strongest = self.strongest.max(other.strongest);
        self.longest = self.longest.max(other.longest);
        self.cells.join(&other.cells);
    }
}

/// Kernel that computes the points of a chunk of paths of one channel, and measures the paths.
pub struct ComputePoints<'a, T> {
    /// Plan, and layout of the grid of static or of moving paths.
    pub plan: &'a DopplerPlan<'a>,
    pub layout: &'a Layout,
    /// Coefficients of the delay.
    pub block: &'a Block,
    /// The paths.
    pub chunk: &'a Chunk<T>,
    /// Results.
    pub points: &'a mut Points<T>,
    pub measured: &'a mut Measured,
}

impl<T: Precision> Kernel for ComputePoints<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(mut self) {
        if <T::In<I>>::LANES == 16 {
            self.compute::<I, 2>();
        } else {
            self.compute::<I, 1>();
        }
    }
}

impl<T: Precision> ComputePoints<'_, T> {
    /// Compute all points, `8 P` at once.
    #[cfg_attr(optimised, inline(always))]
    fn compute<I: Isa, const P: usize>(&mut self) {
        let len = self.chunk.num_paths.min(CHUNK);
        self.points.len = len;
        let [mut sum, mut strongest] = [<T::In<I>>::splat(T::zero()); 2];
        let mut longest = wide::splat::<I, P>(0.0);
        for at in (0..len).step_by(8 * P) {
            let (tau, phase, [p, q]) = self.place::<I, P>(at);
            longest = max(longest, max(tau, sub(wide::splat::<I, P>(0.0), tau)));
            let [cos, sin] = wide::cos_sin::<T, I, P>(phase);
            let (re, im) = (&self.chunk.re[0][at..], &self.chunk.im[0][at..]);
            let (re, im) = (<T::In<I>>::load(re), <T::In<I>>::load(im));
            // conj(amplitude) times the phasor.
            let strength = [im.mul_add(sin, re.mul(cos)), im.neg_mul_add(cos, re.mul(sin))];
            let square = strength[0].mul_add(strength[0], strength[1].mul(strength[1]));
            sum = sum.add(square);
            strongest = strongest.max(square);
            let factors = [<T::In<I>>::splat(T::one()), p, q, p.mul(p), p.mul(q), q.mul(q)];
            for term in 0..self.points.strengths.len().min(factors.len()) {
                let [re, im] = [strength[0].mul(factors[term]), strength[1].mul(factors[term])];
                wide::store(re.interleave(im), &mut self.points.strengths[term][2 * at..]);
            }
        }
        let (points, measured) = (&self.points, &mut *self.measured);
        measured.power += wide::total(sum);
        measured.strongest = measured.strongest.max(strongest.largest().wide());
        for part in longest {
            measured.longest = measured.longest.max(part.largest());
        }
        measured.cells.add::<T, I>(len, &points.places, &points.strengths[0]);
    }

    /// Coordinates of the paths from `at` on. Returns their delays and constant phases [turns], and the variables of the
    /// expansion.
    #[cfg_attr(optimised, inline(always))]
    fn place<I: Isa, const P: usize>(&mut self, at: usize) -> (Wide<I, P>, Wide<I, P>, [T::In<I>; 2]) {
        let splat = wide::splat::<I, P>;
        let (waveform, layout, points) = (self.plan.waveform, self.layout, &mut *self.points);
        let rows = &self.chunk.delay;
        let base = wide::load::<I, P>(&rows[0][at..]);
        let mut phase = wide::turns::<I, P>(waveform.start_frequency, base);
        let [mut tau, mut doppler, mut start] = [base, splat(0.0), splat(0.0)];
        let [mut p, mut q] = [<T::In<I>>::splat(T::zero()); 2];
        if let Some(moving) = self.plan.moving.as_ref().filter(|_| layout.rows > 1) {
            let rate = wide::load::<I, P>(&rows[1][at..]);
            let shift = mul(rate, splat(self.block.delay[0][1]));
            let rate = mul(rate, splat(self.block.delay[1][1]));
            phase = mul_add(shift, splat(waveform.start_frequency), phase);
            tau = add(base, shift);
            let offset_ratio = mul(sub(tau, splat(moving.middle_delay)), splat(moving.stretch));
            let seen = neg_mul_add(offset_ratio, rate, rate);
            doppler = mul(seen, splat(moving.carrier / (waveform.sample_rate * moving.half)));

            let y = mul_add(
                seen,
                splat((moving.step * moving.half).recip()),
                splat(-moving.middle_rate / moving.step),
            );
            wide::narrow::<T, I, P>(y).store(&mut points.places[1][at..]);
            let y = add(y, splat(layout.first(layout.rows - 1)));
            let row = min(
                max(wide::round::<I, P>(y), splat(0.0)),
                splat((layout.rows - layout.width) as f64),
            );
            let z = wide::narrow::<T, I, P>(sub(row, y));
            z.add(z).store(&mut points.offset[1][at..]);
            start = mul(row, splat(layout.stride as f64));

            let cycles = mul(rate, splat(moving.carrier));
            let square = mul(mul(cycles, cycles), splat(-0.5 * moving.stretch / moving.carrier));
            phase = mul_add(square, splat(moving.mean_square), phase);
            p = wide::narrow::<T, I, P>(mul(offset_ratio, cycles));
            q = wide::narrow::<T, I, P>(sub(square, splat(moving.middle_square)));
        }
        let swept = neg_mul_add(
            tau,
            splat(0.5 * waveform.slope),
            splat(waveform.slope * waveform.middle_time()),
        );
        phase = mul_add(tau, swept, phase);

        let x = mul_add(tau, splat(waveform.slope / waveform.sample_rate), doppler);
        // Within half a turn, whatever the delay.
        let x = min(max(wide::reduce::<I, P>(x), splat(-0.5)), splat(0.5));
        wide::narrow::<T, I, P>(x).store(&mut points.places[0][at..]);
        let x = mul_add(
            x,
            splat(layout.num_cells as f64),
            splat(layout.first(layout.num_cells + 2 * layout.origin())),
        );
        let column = wide::round::<I, P>(x);
        let z = wide::narrow::<T, I, P>(sub(column, x));
        z.add(z).store(&mut points.offset[0][at..]);
        let start = add(mul_add(column, splat(2.0), start), splat(f64::ROUND));
        wide::store(start, &mut points.rounded_start[at..]);
        (tau, phase, [p, q])
    }
}
