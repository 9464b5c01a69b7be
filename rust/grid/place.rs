//! Where paths lie on the grid, and with which strengths.

use super::{Job, Layout, Widths, origin};
use crate::block::{CHUNK, Rows, coefficient};
use crate::expansion::{Expansion, FactorKind, Term};
use crate::simd::{Isa, Kernel, Vector};
use crate::wide::{self, Wide, add, max, min, mul, mul_add, neg_mul_add, sub};

/// Most degrees of a delay that are followed.
pub const MAX_DEGREES: usize = 12;
/// As many as motion at constant velocity has, with the square of the delay's change.
pub const FEW_DEGREES: usize = 3;

/// Gathers the chunk of paths from `first` on and puts them in their places, as many at once as `P` vectors of f64 hold.
///
/// Fewer than `D` degrees are followed: small numbers of them stay in registers.
pub struct Place<'a, T, const P: usize, const D: usize> {
    pub job: &'a Job<'a>,
    pub map: &'a Map,
    pub first: usize,
    pub rows: &'a mut Rows,
    pub points: &'a mut Points<T>,
}

/// Numbers from which places and phases follow, the same for all paths of a job.
pub struct Map {
    /// S / f_c, and what it gives at the middle delay.
    stretch: [f64; 2],
    /// S / (2 f_c)
    bend: f64,
    /// Turns per sample: of a second of delay, and of a unit of the first degree.
    turns: [f64; 2],
    /// Cells of the range axis; half a cell past the first one of a patch around zero.
    cells: [f64; 2],
    /// The same for the velocity axis: rows per unit of the first degree, its middle.
    velocity: [f64; 3],
    last_row: f64,
    stride: f64,
    is_moving: bool,
    /// Turns of a second of delay, and of its square, less what the start frequency gives.
    swept: [f64; 2],
}

impl Map {
    /// The numbers of a job.
    pub fn new(job: &Job, layout: &Layout) -> Self {
        let (waveform, expansion) = (job.waveform, job.expansion);
        let (width, cells) = (job.width as f64, layout.num_cells as f64);
        let stretch = waveform.slope / expansion.carrier;
        let half = expansion.block.half;
        Self {
            stretch: [stretch, -stretch * expansion.middle_delay],
            bend: 0.5 * stretch,
            turns: [
                waveform.slope / waveform.sample_rate,
                expansion.carrier / (waveform.sample_rate * half),
            ],
            cells: [cells, 0.5 * (cells - width) + origin(job.width) as f64 + 0.5],
            velocity: [
                (expansion.step * half).recip(),
                expansion.middle_rate * half,
                0.5 * ((layout.rows - 1) as f64 - width) + 0.5,
            ],
            last_row: layout.rows.saturating_sub(job.width) as f64,
            stride: layout.stride as f64,
            is_moving: layout.rows > 1,
            swept: [waveform.slope * waveform.middle_time(), 0.5 * waveform.slope],
        }
    }
}

/// What a chunk of paths is on the grid.
pub struct Points<T> {
    /// Paths that are there.
    pub len: usize,
    /// First number of the patch of every path in a term's grid.
    pub start: [u32; CHUNK],
    /// Place between two cells and between two rows, -1 to 1.
    pub zx: [T; CHUNK],
    /// See `zx`.
    pub zy: [T; CHUNK],
    /// Strengths per degree of the amplitude.
    amplitudes: Vec<Strengths<T>>,
    /// Strengths of the terms that have factors.
    products: Vec<Strengths<T>>,
    /// Chebyshev polynomials of every factor, by order.
    chebyshev: Vec<Vec<[T; CHUNK]>>,
}

/// Real and imaginary parts.
pub type Strengths<T> = ([T; CHUNK], [T; CHUNK]);

impl<T: Widths> Points<T> {
    /// Room for the terms of an expansion.
    pub fn new(expansion: &Expansion) -> Self {
        let zero = [T::zero(); CHUNK];
        Self {
            len: 0,
            start: [0; CHUNK],
            zx: zero,
            zy: zero,
            amplitudes: vec![(zero, zero); expansion.num_amplitudes()],
            products: vec![(zero, zero); expansion.terms.len()],
            chebyshev: expansion.factors.iter().map(|f| vec![zero; f.max_order + 1]).collect(),
        }
    }

    /// Paths that lie within two rows of the one before.
    pub fn num_near(&self, layout: &Layout) -> usize {
        let start = &self.start[..self.len];
        let near = |pair: &&[u32]| pair[0].abs_diff(pair[1]) as usize <= 2 * layout.stride;
        start.windows(2).filter(near).count()
    }

    /// Paths of some chunks, in any order.
    pub fn take(&mut self, chunks: &[Self], order: &[u16]) {
        self.len = order.len();
        let places = || {
            order
                .iter()
                .map(|i| (usize::from(*i) / CHUNK, usize::from(*i) % CHUNK))
                .enumerate()
        };
        for (at, (chunk, i)) in places() {
            let from = &chunks[chunk];
            (self.start[at], self.zx[at], self.zy[at]) = (from.start[i], from.zx[i], from.zy[i]);
        }
        for k in 0..self.amplitudes.len() {
            let (re, im) = &mut self.amplitudes[k];
            for (at, (chunk, i)) in places() {
                let from = &chunks[chunk].amplitudes[k];
                (re[at], im[at]) = (from.0[i], from.1[i]);
            }
        }
        for k in 0..self.products.len() {
            let (re, im) = &mut self.products[k];
            for (at, (chunk, i)) in places() {
                let from = &chunks[chunk].products[k];
                (re[at], im[at]) = (from.0[i], from.1[i]);
            }
        }
    }

    /// Strengths of a term.
    pub fn strengths(&self, index: usize, term: &Term) -> &Strengths<T> {
        if term.has_factors() {
            &self.products[index]
        } else {
            &self.amplitudes[term.amplitude]
        }
    }
}

impl<T: Widths, const P: usize, const D: usize> Kernel for Place<'_, T, P, D> {
    type Output = ();

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(self) {
        let Self {
            job,
            map,
            first,
            rows,
            points,
        } = self;
        rows.gather(job.series, job.channel, first, job.class);
        points.len = rows.len;
        let mut at = 0;
        while at < rows.len {
            place::<T, I, P, D>(job, map, rows, at, points);
            at += 8 * P;
        }
        // Strengths of the terms that have factors, from those of the amplitudes.
        for index in 0..job.expansion.terms.len() {
            let term = &job.expansion.terms[index];
            if !term.has_factors() {
                continue;
            }
            let (re, im) = &mut points.products[index];
            (*re, *im) = points.amplitudes[term.amplitude];
            for k in 0..term.orders.len() {
                if term.orders[k] > 0 {
                    let factor = &points.chebyshev[k][term.orders[k]];
                    for i in 0..CHUNK {
                        re[i] = re[i] * factor[i];
                        im[i] = im[i] * factor[i];
                    }
                }
            }
        }
    }
}

/// Run [`Place`] with as few degrees as will do.
pub fn place_chunk<T: Widths, const P: usize>(
    job: &Job,
    map: &Map,
    first: usize,
    rows: &mut Rows,
    points: &mut Points<T>,
) {
    let is_few = job.expansion.num_degrees <= FEW_DEGREES && job.expansion.num_squared <= 1;
    macro_rules! place {
        ($degrees:expr) => {
            job.level.run(Place::<T, P, $degrees> {
                job,
                map,
                first,
                rows,
                points,
            })
        };
    }
    if is_few {
        place!(FEW_DEGREES);
    } else {
        place!(MAX_DEGREES);
    }
}

/// Number k of an array that stays in registers.
#[inline(always)]
fn pick<I: Isa, const P: usize, const D: usize>(numbers: &[Wide<I, P>; D], k: usize) -> Wide<I, P> {
    if D > FEW_DEGREES {
        return numbers[k];
    }
    let mut picked = numbers[0];
    for i in 1..D {
        if i == k {
            picked = numbers[i];
        }
    }
    picked
}

/// The paths from `at` on: symbols as in `expansion.rs`.
#[inline(always)]
fn place<T: Widths, I: Isa, const P: usize, const D: usize>(
    job: &Job,
    map: &Map,
    rows: &Rows,
    at: usize,
    points: &mut Points<T>,
) {
    let (waveform, expansion) = (job.waveform, job.expansion);
    let splat = wide::splat::<I, P>;

    // Coefficients of the delay, and of the square of its change.
    let base = wide::load::<I, P>(&rows.delay[0][at..]);
    let shift = coefficient::<I, P>(&expansion.block.delay, &rows.delay, 0, at);
    let tau = add(base, shift);
    let mut delay = [splat(0.0); D];
    for k in 1..D {
        if k < expansion.num_degrees {
            delay[k] = coefficient::<I, P>(&expansion.block.delay, &rows.delay, k, at);
        }
    }
    let mut squares = [splat(0.0); D];
    if D <= FEW_DEGREES {
        if expansion.num_squared > 0 {
            let product = mul(mul(delay[1], delay[1]), splat(0.5));
            (squares[0], squares[2]) = (product, product);
        }
    } else {
        for a in 1..=expansion.num_squared {
            for b in 1..=expansion.num_squared {
                let product = mul(mul(delay[a], delay[b]), splat(0.5));
                squares[a + b] = add(squares[a + b], product);
                squares[a.abs_diff(b)] = add(squares[a.abs_diff(b)], product);
            }
        }
    }
    let stretch = mul_add(tau, splat(map.stretch[0]), splat(map.stretch[1]));

    // Row, cell and the places between them.
    let mut x = mul(tau, splat(map.turns[0]));
    let mut start = splat(0.0);
    if map.is_moving {
        // Term k as it counts at the carrier: c_k u less the square's share.
        let mut e = neg_mul_add(stretch, delay[1], delay[1]);
        if D > FEW_DEGREES {
            e = neg_mul_add(splat(map.bend), squares[1], e);
        }
        x = mul_add(e, splat(map.turns[1]), x);
        let [scale, middle, first] = map.velocity;
        let y = mul_add(sub(e, splat(middle)), splat(scale), splat(first));
        let row = max(wide::round::<I, P>(y), splat(0.0));
        let row = min(row, splat(map.last_row));
        let z = wide::narrow::<T, I, P>(sub(row, y));
        z.add(z).store(&mut points.zy[at..]);
        start = mul(row, splat(map.stride));
    }
    let x = mul_add(wide::reduce::<I, P>(x), splat(map.cells[0]), splat(map.cells[1]));
    let column = wide::round::<I, P>(x);
    let z = wide::narrow::<T, I, P>(sub(column, x));
    z.add(z).store(&mut points.zx[at..]);
    store_small::<I, P>(mul_add(column, splat(2.0), start), &mut points.start[at..]);

    // Constant phase, and the strengths it turns.
    let mut swept = mul(tau, neg_mul_add(tau, splat(map.swept[1]), splat(map.swept[0])));
    if expansion.num_squared > 0 {
        swept = neg_mul_add(splat(map.swept[1]), squares[0], swept);
    }
    let phase = mul_add(
        shift,
        splat(waveform.start_frequency),
        wide::turns::<I, P>(waveform.start_frequency, base),
    );
    let [cos, sin] = wide::cos_sin::<T, I, P>(add(phase, swept));
    let scale = splat(job.scale);
    for k in 0..points.amplitudes.len() {
        let (re, im) = (&rows.re, &rows.im);
        let mut a = coefficient::<I, P>(&expansion.block.amplitude, re, k, at);
        let mut b = coefficient::<I, P>(&expansion.block.amplitude, im, k, at);
        if k == 0 {
            a = add(a, wide::load::<I, P>(&re[0][at..]));
            b = add(b, wide::load::<I, P>(&im[0][at..]));
        }
        let a = wide::narrow::<T, I, P>(mul(a, scale));
        let b = wide::narrow::<T, I, P>(mul(b, scale));
        // conj(a + j b) (cos + j sin)
        let (re, im) = &mut points.amplitudes[k];
        b.mul_add(sin, a.mul(cos)).store(&mut re[at..]);
        b.neg_mul_add(cos, a.mul(sin)).store(&mut im[at..]);
    }

    // Further terms of the phase.
    for i in 0..expansion.factors.len() {
        let factor = &expansion.factors[i];
        if factor.max_order == 0 {
            continue;
        }
        let (FactorKind::Phase(k) | FactorKind::Sweep(k)) = factor.kind;
        let (delay, square) = (
            pick::<I, P, D>(&delay, k),
            mul(pick::<I, P, D>(&squares, k), splat(map.bend)),
        );
        let e = match factor.kind {
            FactorKind::Phase(_) => sub(neg_mul_add(stretch, delay, delay), square),
            FactorKind::Sweep(_) => mul(
                mul_add(stretch, delay, square),
                splat(waveform.slope * waveform.half_sweep()),
            ),
        };
        let s = mul(sub(e, splat(factor.middle)), splat(factor.half.recip()));
        let s = wide::narrow::<T, I, P>(s);
        let twice = s.add(s);
        let (mut before, mut current) = (wide::number::<T, I>(1.0), s);
        for order in 1..=factor.max_order {
            current.store(&mut points.chebyshev[i][order][at..]);
            (before, current) = (current, twice.mul(current).sub(before));
        }
    }
}

/// Whole numbers below 2^32; unlike a conversion this vectorises everywhere.
#[inline(always)]
fn store_small<I: Isa, const P: usize>(x: Wide<I, P>, to: &mut [u32]) {
    let shifted = add(x, wide::splat::<I, P>(4_503_599_627_370_496.0)); // 2^52
    let mut numbers = [0.0; 16];
    wide::store(shifted, &mut numbers);
    for i in 0..8 * P {
        to[i] = numbers[i].to_bits() as u32;
    }
}
