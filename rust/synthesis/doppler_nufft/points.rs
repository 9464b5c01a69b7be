//! Points of paths on the grid: coordinates and strengths.

use super::grid::Layout;
use super::plan::Plan;
use super::scan::turns;
use crate::numeric::simd::{Isa, Kernel, Precision, Vector, interleave};
use crate::numeric::wide::{self, Wide, add, max, min, mul, mul_add, neg_mul_add, sub};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{Block, CHUNK, Chunk, Lane};
use crate::synthesis::coherence::Coherence;

/// Constants of the map from paths to points, the same for all paths of a group.
pub struct PointMap {
    start_frequency: f64,
    /// Weights of the second row of the delay in its coefficients of degrees 0 and 1.
    rows: [f64; 2],
    /// Turns per sample of a second of delay, and of a unit of the rate `c_1 (1 - u)`.
    turns: [f64; 2],
    /// Phase of a second of delay beside that of the start frequency [turns], and minus that of a squared second.
    swept: [f64; 2],
    /// Range axis: cells of a turn, cell of no turns.
    range: [f64; 2],
    /// Cells of [coherence](Coherence): along range, along velocity, those of a unit of the rate.
    cells: [f64; 3],
    moving: Option<MovingMap>,
}

/// Constants of moving paths, see [`plan`](super::plan).
struct MovingMap {
    carrier: f64,
    middle_delay: f64,
    stretch: f64,
    /// Velocity axis: middle coefficient, rows per unit of it, row of the middle.
    velocity: [f64; 3],
    last_row: f64,
    stride: f64,
    /// Factor of the squared rate in the residual phase.
    square: f64,
    /// Middle of the factors p and q, and one over half of their ranges.
    middle: [f64; 2],
    inverse_half: [f64; 2],
    mean_square: f64,
    powers: Vec<[usize; 2]>,
}

impl PointMap {
    /// Map of the paths of a group that move or not.
    pub fn new(waveform: &Waveform, block: &Block, plan: &Plan, layout: &Layout, is_static: bool) -> Self {
        let width = layout.width as f64;
        let moving = plan.moving.as_ref().filter(|_| !is_static);
        let inverse = |x: f64| if x > 0.0 { x.recip() } else { 0.0 };
        Self {
            start_frequency: waveform.start_frequency,
            rows: if is_static {
                [0.0; 2]
            } else {
                [block.delay[0][1], block.delay[1][1]]
            },
            turns: [
                waveform.slope / waveform.sample_rate,
                moving.map_or(0.0, |(axis, _)| axis.carrier / (waveform.sample_rate * axis.half)),
            ],
            swept: [waveform.slope * waveform.middle_time(), 0.5 * waveform.slope],
            range: [
                layout.num_cells as f64,
                0.5 * (layout.num_cells as f64 - width) + layout.origin() as f64 + 0.5,
            ],
            cells: {
                let cells = Coherence::new(waveform.chirp_times.len(), waveform.num_samples);
                let [rows, columns] = cells.num_cells().map(|number| number as f64);
                [columns, rows, turns(waveform)[1] * cells.rows_per_turn() / rows]
            },
            moving: moving.map(|(axis, expansion)| MovingMap {
                carrier: axis.carrier,
                middle_delay: axis.middle_delay,
                stretch: axis.stretch,
                velocity: [
                    axis.middle_rate * axis.half,
                    (axis.step * axis.half).recip(),
                    0.5 * ((layout.rows - 1) as f64 - width) + 0.5,
                ],
                last_row: (layout.rows - layout.width) as f64,
                stride: layout.stride as f64,
                square: -0.5 * axis.stretch / axis.carrier,
                middle: [expansion.skew[0], expansion.square[0]],
                inverse_half: [inverse(expansion.skew[1]), inverse(expansion.square[1])],
                mean_square: expansion.mean_square,
                powers: expansion.powers.clone(),
            }),
        }
    }
}

/// Points of a chunk of paths.
pub struct Points<T> {
    /// Number of paths.
    pub len: usize,
    /// Index of the first number of the patch of every path in the grid of a term.
    pub start: [u32; CHUNK],
    /// Twice the offset between two cells, -1 to 1.
    pub zx: Lane<T>,
    /// Twice the offset between two rows, -1 to 1.
    pub zy: Lane<T>,
    /// Strengths of every term: real and imaginary part of a path side by side.
    pub strengths: Vec<[T; 2 * CHUNK]>,
    /// Cell of coherence.
    cells: [u32; CHUNK],
    /// Magnitude of the amplitude.
    magnitudes: Lane<T>,
}

/// Measurements of the paths of a channel by a run.
pub struct Measured {
    /// Sum of the squared amplitudes, scaled.
    pub power: f64,
    /// The largest of them.
    pub strongest: f64,
    /// Their coherence.
    pub coherence: Coherence,
    /// Longest delay [s].
    pub longest: f64,
}

impl Measured {
    /// Of no paths yet.
    pub fn new(waveform: &Waveform) -> Self {
        Self {
            power: 0.0,
            strongest: 0.0,
            coherence: Coherence::new(waveform.chirp_times.len(), waveform.num_samples),
            longest: 0.0,
        }
    }

    /// Add the measurements of other paths.
    pub fn join(&mut self, other: &Self) {
        self.power += other.power;
        self.strongest = self.strongest.max(other.strongest);
        self.coherence.join(&other.coherence);
        self.longest = self.longest.max(other.longest);
    }
}

impl<T: Precision> Points<T> {
    /// Memory for some strengths per path.
    pub fn new(num_terms: usize) -> Box<Self> {
        let zero = [T::zero(); CHUNK];
        Box::new(Self {
            len: 0,
            start: [0; CHUNK],
            zx: zero,
            zy: zero,
            strengths: vec![[T::zero(); 2 * CHUNK]; num_terms],
            cells: [0; CHUNK],
            magnitudes: zero,
        })
    }
}

/// Points of a chunk to compute.
pub struct PointsOf<'a, T> {
    /// The map.
    pub map: &'a PointMap,
    /// The paths of one channel.
    pub chunk: &'a Chunk<T>,
    /// The points.
    pub points: &'a mut Points<T>,
    /// Measurements.
    pub measured: &'a mut Measured,
}

/// Kernel that computes the points of a chunk, and measures the paths; `P` vectors of f64 for one of `T`.
pub struct ComputePoints<'a, T, const P: usize>(pub PointsOf<'a, T>);

impl<T: Precision, const P: usize> Kernel for ComputePoints<'_, T, P> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let PointsOf {
            map,
            chunk,
            points,
            measured,
        } = self.0;
        let len = chunk.num_paths.min(CHUNK);
        points.len = len;
        let (re, im) = (&chunk.re[0], &chunk.im[0]);
        let [mut sum, mut strongest] = [<T::In<I>>::splat(T::zero()); 2];
        let mut longest = wide::splat::<I, P>(0.0);
        for at in (0..len).step_by(8 * P) {
            let (phase, powers) = place::<T, I, P>(map, &chunk.delay, at, points, &mut longest);
            let [cos, sin] = wide::cos_sin::<T, I, P>(phase);
            let (re, im) = (<T::In<I>>::load(&re[at..]), <T::In<I>>::load(&im[at..]));
            // conj(amplitude) times the phasor.
            let strength = [im.mul_add(sin, re.mul(cos)), im.neg_mul_add(cos, re.mul(sin))];
            let square = strength[0].mul_add(strength[0], strength[1].mul(strength[1]));
            square.sqrt().store(&mut points.magnitudes[at..]);
            sum = sum.add(square);
            strongest = strongest.max(square);
            wide::store(interleave(strength[0], strength[1]), &mut points.strengths[0][2 * at..]);
            if let Some(moving) = &map.moving {
                for term in 1..points.strengths.len().min(moving.powers.len()) {
                    let [mut re, mut im] = strength;
                    for variable in 0..2 {
                        for _ in 0..moving.powers[term][variable] {
                            (re, im) = (re.mul(powers[variable]), im.mul(powers[variable]));
                        }
                    }
                    wide::store(interleave(re, im), &mut points.strengths[term][2 * at..]);
                }
            }
        }
        let mut lanes = [T::zero(); 16];
        sum.store(&mut lanes);
        let mut squares = 0.0;
        for i in 0..8 * P {
            squares += lanes[i].wide();
        }
        measured.power += squares;
        measured.strongest = measured.strongest.max(strongest.largest().wide());
        measured
            .coherence
            .add_to(&points.cells[..len], &points.magnitudes[..len], squares);
        for p in 0..P {
            measured.longest = measured.longest.max(longest[p].largest());
        }
    }
}

/// Coordinates of the paths from `at` on. Returns their constant phases [turns], and the variables of the expansion.
#[cfg_attr(optimised, inline(always))]
fn place<T: Precision, I: Isa, const P: usize>(
    map: &PointMap,
    delay: &[Lane<f64>],
    at: usize,
    points: &mut Points<T>,
    longest: &mut Wide<I, P>,
) -> (Wide<I, P>, [T::In<I>; 2]) {
    let splat = wide::splat::<I, P>;
    let base = wide::load::<I, P>(&delay[0][at..]);
    let mut phase = wide::turns::<I, P>(map.start_frequency, base);
    let mut powers = [<T::In<I>>::splat(T::zero()); 2];
    let (mut tau, mut start) = (base, splat(0.0));
    let mut x = mul(base, splat(map.turns[0]));
    let mut cell = splat(0.0);
    if let Some(moving) = &map.moving {
        let rate = wide::load::<I, P>(&delay[1][at..]);
        let shift = mul(rate, splat(map.rows[0]));
        let rate = mul(rate, splat(map.rows[1]));
        phase = mul_add(shift, splat(map.start_frequency), phase);
        tau = add(base, shift);
        let offset = mul(sub(tau, splat(moving.middle_delay)), splat(moving.stretch));
        let seen = neg_mul_add(offset, rate, rate);
        x = mul_add(seen, splat(map.turns[1]), mul(tau, splat(map.turns[0])));

        let turns = wide::reduce::<I, P>(mul(rate, splat(map.cells[2])));
        cell = mul(cell_of::<I, P>(turns, map.cells[1]), splat(map.cells[0]));
        let [middle, scale, first] = moving.velocity;
        let y = mul_add(sub(seen, splat(middle)), splat(scale), splat(first));
        let row = max(wide::round::<I, P>(y), splat(0.0));
        let row = min(row, splat(moving.last_row));
        let z = wide::narrow::<T, I, P>(sub(row, y));
        z.add(z).store(&mut points.zy[at..]);
        start = mul(row, splat(moving.stride));

        let cycles = mul(rate, splat(moving.carrier));
        let square = mul(mul(cycles, cycles), splat(moving.square));
        phase = mul_add(square, splat(moving.mean_square), phase);
        let variables = [mul(offset, cycles), square];
        for i in 0..2 {
            let deviation = sub(variables[i], splat(moving.middle[i]));
            powers[i] = wide::narrow::<T, I, P>(mul(deviation, splat(moving.inverse_half[i])));
        }
    }
    let swept = mul(tau, neg_mul_add(tau, splat(map.swept[1]), splat(map.swept[0])));

    // Within half a turn, whatever the delay.
    let x = min(max(wide::reduce::<I, P>(x), splat(-0.5)), splat(0.5));
    cell = add(cell, cell_of::<I, P>(x, map.cells[0]));
    store_small::<I, P>(cell, &mut points.cells[at..]);
    *longest = max(*longest, max(tau, sub(splat(0.0), tau)));
    let x = mul_add(x, splat(map.range[0]), splat(map.range[1]));
    let column = wide::round::<I, P>(x);
    let z = wide::narrow::<T, I, P>(sub(column, x));
    z.add(z).store(&mut points.zx[at..]);
    store_small::<I, P>(mul_add(column, splat(2.0), start), &mut points.start[at..]);
    (add(phase, swept), powers)
}

/// Number of the cell of a reduced phase [turns]: one of `number`, after which they repeat.
#[cfg_attr(optimised, inline(always))]
fn cell_of<I: Isa, const P: usize>(turns: Wide<I, P>, number: f64) -> Wide<I, P> {
    let splat = wide::splat::<I, P>;
    let place = wide::round::<I, P>(mul_add(turns, splat(number), splat(0.5 * number - 0.5)));
    min(max(place, splat(0.0)), splat(number - 1.0))
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
