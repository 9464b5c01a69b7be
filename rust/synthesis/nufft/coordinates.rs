//! Coordinates and strengths of paths on the range-velocity grid, and the interpolation errors of their residuals.

use super::job::Job;
use super::layout::{Layout, PAD, origin};
use super::measured::Measured;
use crate::numeric::simd::{Isa, Kernel, Precision, Vector, interleave};
use crate::numeric::wide::{self, Wide, add, max, min, mul, mul_add, neg_mul_add, sub};
use crate::synthesis::block::{CHUNK, Class, Rows, coefficient};
use crate::synthesis::low_rank::residual_phase::{Instant, turns};

/// Constants of the map from paths to coordinates, phases and strengths, the same for all paths of a job.
pub struct Map<T> {
    /// Turns per sample of a second of delay, and of a unit of the coefficient of degree 1.
    turns: [f64; 2],
    /// Cells of the range axis, and offset of the first cell of a patch around zero, plus one half.
    cells: [f64; 2],
    /// Velocity axis: rows per unit of the coefficient of degree 1, middle coefficient, offset of the first row of a
    /// patch.
    velocity: [f64; 3],
    last_row: f64,
    stride: f64,
    /// Columns of the cells of range and velocity.
    columns: f64,
    is_moving: bool,
    /// Turns of a second of delay, and of a squared second, beside those of the start frequency.
    swept: [f64; 2],
    /// Factor of the squared delay in a residual phase.
    bend: T,
    /// Weights of the rows of the amplitude after the first in its mean, and in its further coefficients.
    mean: Vec<T>,
    amplitudes: Vec<Vec<T>>,
    /// Probes of the strengths, one per term; none if strengths are the mean amplitudes.
    probes: Vec<Probe<T>>,
    /// Probes of the checks, with the weights of the strengths.
    checks: Vec<(Probe<T>, Vec<[T; 2]>)>,
    /// Residual phase of the mean path at the checks [turns].
    common: Vec<T>,
}

/// Probe of residuals at an instant.
struct Probe<T> {
    x: T,
    sweep: T,
    /// Chebyshev polynomials from degree 2 on.
    polynomials: Vec<T>,
    /// Chebyshev polynomials from degree 1 on, for amplitudes.
    amplitude: Vec<T>,
    /// Weights of the rows of the amplitude after the first.
    rows: Vec<T>,
}

impl<T: Precision> Probe<T> {
    fn new(job: &Job, instant: &Instant) -> Self {
        let matrix = &job.block_plan.block.amplitude;
        let mut polynomials = vec![1.0, instant.x];
        for k in 2..job.block_plan.num_degrees.max(matrix.len()) {
            polynomials.push(2.0 * instant.x * polynomials[k - 1] - polynomials[k - 2]);
        }
        let weight = |row: usize| matrix.iter().zip(&polynomials).map(|(m, t)| m[row] * t).sum();
        Self {
            x: T::of(instant.x),
            sweep: T::of(instant.sweep),
            amplitude: (1..job.block_plan.num_amplitudes)
                .map(|k| T::of(polynomials[k]))
                .collect(),
            rows: (1..matrix.len()).map(weight).map(T::of).collect(),
            polynomials: (2..job.block_plan.num_degrees).map(|k| T::of(polynomials[k])).collect(),
        }
    }
}

impl<T: Precision> Map<T> {
    /// Constants of a job.
    pub fn new(job: &Job, layout: &Layout) -> Self {
        let (waveform, block_plan) = (job.waveform, job.block_plan);
        let (width, cells) = (job.width as f64, layout.num_cells as f64);
        let (half, carrier, approximation) = (
            block_plan.block.half,
            block_plan.frame.carrier,
            &block_plan.approximation,
        );
        let check = |check: &crate::synthesis::low_rank::cross_approximation::Check| {
            let weights = check.weights.iter().map(|w| [T::of(w.re), T::of(w.im)]);
            (Probe::new(job, &check.instant), weights.collect())
        };
        // Still paths have one row.
        let coefficients = |k: usize| {
            let factors = &block_plan.block.amplitude[k];
            let num_rows = if job.selection.class == Class::Still {
                1
            } else {
                factors.len()
            };
            factors[..num_rows]
                .iter()
                .skip(1)
                .map(|factor| T::of(*factor))
                .collect()
        };
        Self {
            turns: [
                waveform.slope / waveform.sample_rate,
                carrier / (waveform.sample_rate * half),
            ],
            cells: [cells, 0.5 * (cells - width) + origin(job.width) as f64 + 0.5],
            velocity: [
                (block_plan.step * half).recip(),
                block_plan.middle_rate * half,
                0.5 * ((layout.rows - 1) as f64 - width) + 0.5,
            ],
            last_row: layout.rows.saturating_sub(job.width) as f64,
            stride: layout.stride as f64,
            columns: Measured::columns(job) as f64,
            is_moving: layout.rows > 1,
            swept: [waveform.slope * waveform.middle_time(), 0.5 * waveform.slope],
            bend: T::of(block_plan.frame.bend),
            mean: coefficients(0),
            amplitudes: (1..block_plan.num_amplitudes).map(coefficients).collect(),
            probes: approximation
                .instants
                .iter()
                .map(|instant| Probe::new(job, instant))
                .collect(),
            checks: approximation.checks.iter().map(check).collect(),
            common: approximation
                .checks
                .iter()
                .map(|check| T::of(approximation.mean.turns(&block_plan.frame, &check.instant)))
                .collect(),
        }
    }
}

/// One number per path of a chunk.
type Lane<T> = [T; CHUNK];

/// Points of a batch of paths on the grid: coordinates and strengths.
pub struct Points<T> {
    /// Number of paths.
    pub len: usize,
    /// First velocity row of the patch of every path.
    pub row: Vec<u32>,
    /// Index of the first number of the patch in the grid of a term.
    pub start: Vec<u32>,
    /// Offset between two cells, -1 to 1.
    pub zx: Vec<T>,
    /// Offset between two rows, -1 to 1.
    pub zy: Vec<T>,
    /// Strengths of every term: real and imaginary part of a path side by side.
    pub strengths: Vec<Vec<T>>,
}

impl<T: Precision> Points<T> {
    /// Memory for some paths.
    pub fn new(num_terms: usize, num_paths: usize) -> Self {
        // A chunk is written in whole vectors.
        let padded = num_paths + PAD;
        let zero = || vec![T::zero(); padded];
        Self {
            len: 0,
            row: vec![0; padded],
            start: vec![0; padded],
            zx: zero(),
            zy: zero(),
            strengths: vec![vec![T::zero(); 2 * padded]; num_terms],
        }
    }
}

/// Phases and amplitudes of a chunk of paths, independent of the instant.
pub struct Tracks<T> {
    /// Cosine and sine of the constant phase.
    phasor: (Lane<T>, Lane<T>),
    /// Offset, rate and bends, as in `residual_phase::Path`.
    offset: Lane<T>,
    rate: Lane<T>,
    bends: Vec<Lane<T>>,
    /// Rows of the amplitude, real and imaginary parts: the first, and the others' differences from it.
    rows: [Vec<Lane<T>>; 2],
    /// Coefficients of the amplitude by degree, real and imaginary parts.
    amplitude: [Vec<Lane<T>>; 2],
    /// Strengths of every term, real and imaginary parts.
    strengths: Vec<[Lane<T>; 2]>,
    /// Cells of range and velocity, and magnitudes of the mean amplitudes.
    cells: [u32; CHUNK],
    magnitudes: Lane<T>,
}

impl<T: Precision> Tracks<T> {
    /// Memory for the series of a job.
    pub fn new(job: &Job) -> Self {
        let zero = [T::zero(); CHUNK];
        // Still paths have one row.
        let num_amplitudes = if job.selection.class == Class::Still {
            1
        } else {
            job.series.num_amplitude_terms()
        };
        Self {
            phasor: (zero, zero),
            offset: zero,
            rate: zero,
            bends: vec![zero; job.block_plan.num_degrees.saturating_sub(2)],
            rows: [vec![zero; num_amplitudes], vec![zero; num_amplitudes]],
            amplitude: [
                vec![zero; job.block_plan.num_amplitudes],
                vec![zero; job.block_plan.num_amplitudes],
            ],
            strengths: vec![[zero; 2]; job.block_plan.approximation.num_sets()],
            cells: [0; CHUNK],
            magnitudes: zero,
        }
    }
}

/// Coordinates and strengths of the chunk of paths from `first` on, and measurements of these paths.
pub struct Coordinates<'a, T> {
    pub job: &'a Job<'a>,
    pub map: &'a Map<T>,
    pub first: usize,
    pub rows: &'a mut Rows,
    pub tracks: &'a mut Tracks<T>,
    pub points: &'a mut Points<T>,
    pub measured: &'a mut Measured,
}

/// Kernel that computes them, `P` vectors of f64 at once: one vector of `T`.
pub struct Placing<'a, T, const P: usize>(pub Coordinates<'a, T>);

impl<T: Precision, const P: usize> Kernel for Placing<'_, T, P> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let Coordinates {
            job,
            map,
            first,
            rows,
            tracks,
            points,
            measured,
        } = self.0;
        rows.gather(job.series, job.channel, first, job.selection);
        let to = points.len;
        for at in (0..rows.len).step_by(8 * P) {
            coordinates::<T, I, P>(job, map, rows, at, tracks, points, to + at);
        }
        expand::<T, I, P>(map, rows.len, tracks);
        if job.block_plan.block.chirps.start == 0 {
            measured.power += rows.power();
        }
        let squares = magnitudes::<T, I, P>(tracks, rows.len);
        let len = rows.len.min(CHUNK);
        measured
            .coherence
            .add_to(&tracks.cells[..len], &tracks.magnitudes[..len], squares);
        let is_flat = job.block_plan.approximation.are_flat();
        for term in 0..points.strengths.len() {
            let strengths = &mut points.strengths[term][2 * to..];
            for at in (0..rows.len).step_by(8 * P) {
                let [a, b] = if is_flat {
                    let load = <T::In<I> as Vector>::load;
                    let mean = [load(&tracks.amplitude[0][0][at..]), load(&tracks.amplitude[1][0][at..])];
                    turned::<T, I>(mean, tracks, at)
                } else {
                    let probe = &map.probes[term];
                    let phase = residual_turns::<T, I>(map, probe, tracks, at);
                    residual::<T, I>(phase, interpolated::<T, I>(probe, tracks, at), tracks, at)
                };
                let [re, im] = &mut tracks.strengths[term];
                a.store(&mut re[at..]);
                b.store(&mut im[at..]);
                wide::store(interleave(a, b), &mut strengths[2 * at..]);
            }
        }
        points.len += rows.len;
        measured.add_rest(first / CHUNK, check::<T, I, P>(map, is_flat, tracks, rows.len));
    }
}

/// Magnitudes of the mean amplitudes; returns the sum of their squares. Lanes after the last path have no amplitude.
#[cfg_attr(optimised, inline(always))]
fn magnitudes<T: Precision, I: Isa, const P: usize>(tracks: &mut Tracks<T>, len: usize) -> f64 {
    let mut sum = <T::In<I>>::splat(T::zero());
    for at in (0..len).step_by(8 * P) {
        let re = <T::In<I>>::load(&tracks.amplitude[0][0][at..]);
        let im = <T::In<I>>::load(&tracks.amplitude[1][0][at..]);
        let square = re.mul_add(re, im.mul(im));
        square.sqrt().store(&mut tracks.magnitudes[at..]);
        sum = sum.add(square);
    }
    total::<T, I, P>(sum)
}

/// Sum of the numbers of a vector.
#[cfg_attr(optimised, inline(always))]
fn total<T: Precision, I: Isa, const P: usize>(vector: T::In<I>) -> f64 {
    let mut lanes = [T::zero(); 16];
    vector.store(&mut lanes);
    let mut total = 0.0;
    for i in 0..8 * P {
        total += lanes[i].wide();
    }
    total
}

/// Coordinates of the paths of the chunk from `at` on, into the points from `to` on; symbols as in `residual_phase`.
#[cfg_attr(optimised, inline(always))]
fn coordinates<T: Precision, I: Isa, const P: usize>(
    job: &Job,
    map: &Map<T>,
    rows: &Rows,
    at: usize,
    tracks: &mut Tracks<T>,
    points: &mut Points<T>,
    to: usize,
) {
    let (waveform, block_plan) = (job.waveform, job.block_plan);
    let (delay, frame) = (&block_plan.block.delay, &block_plan.frame);
    let splat = wide::splat::<I, P>;

    // Row, cell and the offsets between them.
    let base = wide::load::<I, P>(&rows.delay[0][at..]);
    let shift = coefficient::<I, P>(delay, &rows.delay, 0, at);
    let tau = add(base, shift);
    let mut x = mul(tau, splat(map.turns[0]));
    let (mut start, mut cell) = (splat(0.0), splat(0.0));
    if map.is_moving {
        let offset = mul(sub(tau, splat(frame.middle_delay)), splat(frame.stretch));
        let rate = coefficient::<I, P>(delay, &rows.delay, 1, at);
        let e = neg_mul_add(offset, rate, rate);
        x = mul_add(e, splat(map.turns[1]), x);
        let [scale, middle, first] = map.velocity;
        let y = mul_add(sub(e, splat(middle)), splat(scale), splat(first));
        let row = max(wide::round::<I, P>(y), splat(0.0));
        let row = min(row, splat(map.last_row));
        let z = wide::narrow::<T, I, P>(sub(row, y));
        z.add(z).store(&mut points.zy[to..]);
        store_small::<I, P>(row, &mut points.row[to..]);
        start = mul(row, splat(map.stride));
        // Two rows are a turn over the block; without ties.
        let turn = wide::round::<I, P>(mul_add(row, splat(0.5), splat(-0.125)));
        cell = mul(turn, splat(map.columns));

        wide::narrow::<T, I, P>(offset).store(&mut tracks.offset[at..]);
        let carrier = splat(frame.carrier);
        wide::narrow::<T, I, P>(mul(rate, carrier)).store(&mut tracks.rate[at..]);
        for k in 0..tracks.bends.len() {
            let bend = mul(coefficient::<I, P>(delay, &rows.delay, k + 2, at), carrier);
            wide::narrow::<T, I, P>(bend).store(&mut tracks.bends[k][at..]);
        }
    }
    let x = wide::reduce::<I, P>(x);
    let column = wide::round::<I, P>(mul_add(x, splat(map.columns), splat(0.5 * map.columns - 0.5)));
    let column = min(max(column, splat(0.0)), splat(map.columns - 1.0));
    store_small::<I, P>(add(cell, column), &mut tracks.cells[at..]);
    let x = mul_add(x, splat(map.cells[0]), splat(map.cells[1]));
    let column = wide::round::<I, P>(x);
    let z = wide::narrow::<T, I, P>(sub(column, x));
    z.add(z).store(&mut points.zx[to..]);
    store_small::<I, P>(mul_add(column, splat(2.0), start), &mut points.start[to..]);

    // Constant phase, and the amplitudes.
    let swept = mul(tau, neg_mul_add(tau, splat(map.swept[1]), splat(map.swept[0])));
    let phase = mul_add(
        shift,
        splat(waveform.start_frequency),
        wide::turns::<I, P>(waveform.start_frequency, base),
    );
    let [cos, sin] = wide::cos_sin::<T, I, P>(add(phase, swept));
    cos.store(&mut tracks.phasor.0[at..]);
    sin.store(&mut tracks.phasor.1[at..]);
    let scale = splat(job.scale);
    for part in 0..2 {
        let (lanes, to) = ([&rows.re, &rows.im][part], &mut tracks.rows[part]);
        for j in 0..to.len().min(lanes.len()) {
            let lane = mul(wide::load::<I, P>(&lanes[j][at..]), scale);
            wide::narrow::<T, I, P>(lane).store(&mut to[j][at..]);
        }
    }
}

/// Coefficients of the amplitudes.
#[cfg_attr(optimised, inline(always))]
fn expand<T: Precision, I: Isa, const P: usize>(map: &Map<T>, len: usize, tracks: &mut Tracks<T>) {
    for part in 0..2 {
        for k in 0..tracks.amplitude[part].len() {
            let weights = if k == 0 { &map.mean } else { &map.amplitudes[k - 1] };
            for at in (0..len).step_by(8 * P) {
                let rows = &tracks.rows[part];
                let mut sum = <T::In<I>>::splat(T::zero());
                if k == 0 {
                    sum = <T::In<I>>::load(&rows[0][at..]);
                }
                for j in 0..weights.len() {
                    let row = <T::In<I>>::load(&rows[j + 1][at..]);
                    sum = <T::In<I>>::splat(weights[j]).mul_add(row, sum);
                }
                sum.store(&mut tracks.amplitude[part][k][at..]);
            }
        }
    }
}

/// Amplitudes at an instant, from their coefficients.
#[cfg_attr(optimised, inline(always))]
fn interpolated<T: Precision, I: Isa>(probe: &Probe<T>, tracks: &Tracks<T>, at: usize) -> [T::In<I>; 2] {
    weighted::<T, I>(&probe.amplitude, &tracks.amplitude, at)
}

/// Amplitudes at an instant, from their rows.
#[cfg_attr(optimised, inline(always))]
fn exact<T: Precision, I: Isa>(probe: &Probe<T>, tracks: &Tracks<T>, at: usize) -> [T::In<I>; 2] {
    weighted::<T, I>(&probe.rows, &tracks.rows, at)
}

/// First lane plus weighted others, of both parts.
#[cfg_attr(optimised, inline(always))]
fn weighted<T: Precision, I: Isa>(weights: &[T], lanes: &[Vec<Lane<T>>; 2], at: usize) -> [T::In<I>; 2] {
    let load = <T::In<I> as Vector>::load;
    let (mut re, mut im) = (load(&lanes[0][0][at..]), load(&lanes[1][0][at..]));
    for j in 0..weights.len() {
        let weight = <T::In<I>>::splat(weights[j]);
        re = weight.mul_add(load(&lanes[0][j + 1][at..]), re);
        im = weight.mul_add(load(&lanes[1][j + 1][at..]), im);
    }
    [re, im]
}

/// `conj(a)` times the phasor of the constant phase.
#[cfg_attr(optimised, inline(always))]
fn turned<T: Precision, I: Isa>(amplitude: [T::In<I>; 2], tracks: &Tracks<T>, at: usize) -> [T::In<I>; 2] {
    let load = <T::In<I> as Vector>::load;
    conjugate_product([load(&tracks.phasor.0[at..]), load(&tracks.phasor.1[at..])], amplitude)
}

/// `p conj(a)`
#[cfg_attr(optimised, inline(always))]
fn conjugate_product<V: Vector>([cos, sin]: [V; 2], [re, im]: [V; 2]) -> [V; 2] {
    [im.mul_add(sin, re.mul(cos)), im.neg_mul_add(cos, re.mul(sin))]
}

/// Residual phases at an instant [turns].
#[cfg_attr(optimised, inline(always))]
fn residual_turns<T: Precision, I: Isa>(map: &Map<T>, probe: &Probe<T>, tracks: &Tracks<T>, at: usize) -> T::In<I> {
    let (load, splat) = (<T::In<I> as Vector>::load, <T::In<I> as Vector>::splat);
    let mut delta = splat(T::zero());
    for k in 0..probe.polynomials.len() {
        delta = splat(probe.polynomials[k]).mul_add(load(&tracks.bends[k][at..]), delta);
    }
    turns(
        delta,
        load(&tracks.offset[at..]),
        load(&tracks.rate[at..]),
        splat(probe.x),
        splat(probe.sweep),
        splat(map.bend),
    )
}

/// Residuals of phases [turns] and amplitudes, times the phasor of the constant phase.
#[cfg_attr(optimised, inline(always))]
fn residual<T: Precision, I: Isa>(
    phase: T::In<I>,
    amplitude: [T::In<I>; 2],
    tracks: &Tracks<T>,
    at: usize,
) -> [T::In<I>; 2] {
    let [cos, sin] = wide::cos_sin_of::<T, I>(phase);
    let [re, im] = turned::<T, I>(amplitude, tracks, at);
    [im.neg_mul_add(sin, re.mul(cos)), im.mul_add(cos, re.mul(sin))]
}

/// Squared interpolation error of the residuals, summed over paths, the mean over the checks.
#[cfg_attr(optimised, inline(always))]
fn check<T: Precision, I: Isa, const P: usize>(map: &Map<T>, is_flat: bool, tracks: &Tracks<T>, len: usize) -> f64 {
    let (load, splat) = (<T::In<I> as Vector>::load, <T::In<I> as Vector>::splat);
    let mut sum = splat(T::zero());
    for number in 0..map.checks.len() {
        let (probe, weights) = &map.checks[number];
        for at in (0..len).step_by(8 * P) {
            let (mut re, mut im);
            let phase = residual_turns::<T, I>(map, probe, tracks, at);
            if is_flat {
                // Error to first order in the phase.
                let phase = phase
                    .sub(splat(map.common[number]))
                    .mul(splat(T::of(std::f64::consts::TAU)));
                let [a, b] = &tracks.strengths[0];
                let (a, b) = (load(&a[at..]), load(&b[at..]));
                (re, im) = (splat(T::zero()).sub(b.mul(phase)), a.mul(phase));
                if !probe.rows.is_empty() {
                    let [c, d] = turned::<T, I>(exact::<T, I>(probe, tracks, at), tracks, at);
                    (re, im) = (re.add(c.sub(a)), im.add(d.sub(b)));
                }
            } else {
                [re, im] = residual::<T, I>(phase, exact::<T, I>(probe, tracks, at), tracks, at);
                for term in 0..weights.len().min(tracks.strengths.len()) {
                    let [a, b] = &tracks.strengths[term];
                    let (a, b) = (load(&a[at..]), load(&b[at..]));
                    let (c, d) = (splat(weights[term][0]), splat(weights[term][1]));
                    re = b.mul_add(d, a.neg_mul_add(c, re));
                    im = b.neg_mul_add(c, a.neg_mul_add(d, im));
                }
            }
            sum = re.mul_add(re, im.mul_add(im, sum));
        }
    }
    total::<T, I, P>(sum) / map.checks.len().max(1) as f64
}

/// Store whole numbers below 2^32; unlike a conversion this vectorises everywhere.
#[cfg_attr(optimised, inline(always))]
fn store_small<I: Isa, const P: usize>(x: Wide<I, P>, to: &mut [u32]) {
    let shifted = add(x, wide::splat::<I, P>(4_503_599_627_370_496.0)); // 2^52
    let mut numbers = [0.0; 16];
    wide::store(shifted, &mut numbers);
    // One check of bounds, or the compiler stores number by number.
    let to = &mut to[..8 * P];
    for i in 0..8 * P {
        to[i] = numbers[i].to_bits() as u32;
    }
}
