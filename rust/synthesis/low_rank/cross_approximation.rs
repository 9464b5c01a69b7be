//! Adaptive cross approximation of the residuals of all paths (Bebendorf, Numer. Math. 86, 2000), also known as
//! empirical interpolation.
//!
//! In a block of chirps, residuals (`residual_phase`) are functions of chirp and sample that differ little from path to
//! path. A residual g is interpolated between its values at `n` instants, each of which has a grid of its own:
//!
//! ```text
//! g = sum_i c_i q_i        c_i = g(x_i) - sum_(j<i) q_j(x_i) c_j       q_i = (g_i - sum_(j<i) c_j(g_i) q_j) / c_i(g_i)
//! ```
//!
//! with `g_i` the residual of a reference path. Instants and references are the pivots of a matrix of samples (paths,
//! instants): the largest elements of its remainder, one after the other, until the remainder is small. All paths are
//! compared with the interpolation at the instants of [`Check`]s when their coordinates on the grid are computed.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::numeric::wide;
use crate::synthesis::block::Block;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::low_rank::residual_phase::{Frame, Instant, Path, turns};

/// Largest number of terms, the rank, in a block.
pub const MAX_TERMS: usize = 48;

/// Adaptive cross approximation of the residuals in a block: instants, references and triangular factors.
#[derive(Clone, Debug)]
pub struct CrossApproximation {
    /// Instant of every term, whose residuals are its strengths. Empty: residuals are the mean amplitudes of the paths
    /// with the phase of one path.
    pub instants: Vec<Instant>,
    /// Mean path, whose residual phase stands for that of all paths if there are no terms.
    pub mean: Path,
    /// Values `q_j(x_i)`, (i, j < i).
    pub lower: Vec<Vec<Complex64>>,
    /// Reference path of every term, with its own `1 / c_i` and `c_j / c_i`, j < i.
    pub references: Vec<(Path, Complex64, Vec<Complex64>)>,
    /// Checks of residuals against their interpolation.
    pub checks: Vec<Check>,
    /// rms of the residual phases of the samples, weighted by power [turns].
    pub turns: f64,
}

/// Check of the interpolation: an instant, and the weights of the strengths of all terms in the interpolation there.
#[derive(Clone, Debug)]
pub struct Check {
    /// Instant of the check.
    pub instant: Instant,
    /// Weight of the strength of every term.
    pub weights: Vec<Complex64>,
}

impl CrossApproximation {
    /// Approximation of residuals that never change.
    pub fn none() -> Self {
        Self {
            instants: Vec::new(),
            mean: Path::default(),
            lower: Vec::new(),
            references: Vec::new(),
            checks: Vec::new(),
            turns: 0.0,
        }
    }

    /// Approximation of residuals by the phase of one path, checked at some instants.
    pub fn of_one_phase(mean: Path, instants: &[Instant]) -> Self {
        let check = |instant: &Instant| Check {
            instant: *instant,
            weights: Vec::new(),
        };
        Self {
            mean,
            checks: instants.iter().map(check).collect(),
            ..Self::none()
        }
    }

    /// Number of sets of strengths, one per term; one without terms.
    pub fn num_sets(&self) -> usize {
        self.instants.len().max(1)
    }

    /// Number of terms of the longest series of a reference path.
    pub fn num_degrees(&self) -> usize {
        let paths = self.references.iter().map(|(path, ..)| path).chain([&self.mean]);
        let degrees = paths.map(|path| path.num_amplitudes().max(path.bends().len() + 2));
        degrees.max().unwrap_or(0)
    }

    /// True if residuals are the mean amplitudes of the paths with one phase.
    pub fn are_flat(&self) -> bool {
        self.instants.is_empty()
    }
}

/// Budgets below this count as small.
const FINE: f64 = 1e-6;
/// Chirps and samples per chirp at which residuals are evaluated.
const NUM_CHIRPS: usize = 16;
const NUM_FAST: usize = 3;
/// Chirps and samples per chirp for small budgets.
const MANY_CHIRPS: usize = 28;
const MANY_FAST: usize = 5;
/// Largest number of chirps, for residual phases of many turns: twice the largest number of terms.
const MOST_CHIRPS: usize = 2 * MAX_TERMS;
/// Further instants between those of the terms, for checks.
const NUM_OTHERS: usize = 8;
/// Number of checks.
const NUM_CHECKS: usize = 4;
/// Squares that differ by less than this factor count as equal, so that rounding does not choose the pivot.
const TIE: f64 = 1.0 + 1e-9;
/// Share of the allowed error for the samples, which the terms fit; other paths may have more.
pub const SHARE: f64 = 0.85;

/// Cross approximation of some paths and its rms error relative to the l2 norm of the amplitudes, at most `budget`.
/// None if it takes too many terms.
///
/// No pivot is below the `rounding` of strengths, relative to the rms of residuals.
pub fn find(
    waveform: &Waveform,
    block: &Block,
    frame: &Frame,
    paths: &[Path],
    (budget, rounding): (f64, f64),
    level: Level,
) -> Option<(CrossApproximation, f64)> {
    let is_fine = budget < FINE;
    let (chirps, fast) = if is_fine {
        (MANY_CHIRPS, MANY_FAST)
    } else {
        (NUM_CHIRPS, NUM_FAST)
    };
    // exp(2 pi j z T_2(x)) is a polynomial of degree 4 pi z and a few more.
    let bends = |path: &Path| path.bends().iter().map(|bend| bend.abs()).sum::<f64>();
    let most = paths.iter().map(bends).fold(0.0, f64::max);
    let chirps = chirps.max(((2.0 * TAU * most) as usize).saturating_add(6).min(MOST_CHIRPS));
    let instant = |chirp: usize, sample: usize| {
        let fine = waveform.sample_time(sample) - waveform.middle_time();
        Instant {
            x: (block.offset(waveform, chirp) + fine) / block.half,
            sweep: frame.stretch * fine,
        }
    };
    let (num_chirps, num_samples) = (block.chirps.len(), waveform.num_samples);
    let mut instants = Vec::new();
    // Few chirps allow more samples of each.
    let num_instants = chirps * fast;
    let chirps = spread(num_chirps, chirps);
    let samples = spread(num_samples, num_instants / chirps.len());
    // The weight of an instant is the number of samples around it.
    let mut weights = Vec::new();
    for (chirp, slow) in &chirps {
        instants.extend(samples.iter().map(|(sample, _)| instant(*chirp, *sample)));
        weights.extend(samples.iter().map(|(_, fast)| slow * fast));
    }
    let mean = weights.iter().sum::<f64>() / weights.len() as f64;
    for weight in &mut weights {
        *weight /= mean;
    }
    let is_complete = instants.len() == num_chirps * num_samples;
    let num_trained = instants.len();
    // Further instants by a sequence that fills the plane evenly (Roberts' R2).
    for i in 1..=NUM_OTHERS {
        let place =
            |step: f64, count: usize| (((0.5 + step * i as f64).fract() * count as f64) as usize).min(count - 1);
        instants.push(instant(
            place(0.754_877_666_246_692_8, num_chirps),
            place(0.569_840_290_998_053_3, num_samples),
        ));
    }
    let max_terms = if is_complete { num_trained } else { num_trained * 2 / 5 };
    level.run(Search {
        frame,
        paths,
        instants: &instants,
        weights: &weights,
        num_trained,
        max_terms: max_terms.min(MAX_TERMS),
        budget: SHARE * budget,
        rounding,
    })
}

/// Up to `most` numbers below `count`, ends included and denser towards them, each with the number of integers it
/// represents.
fn spread(count: usize, most: usize) -> Vec<(usize, f64)> {
    if count <= most {
        return (0..count).map(|place| (place, 1.0)).collect();
    }
    let place = |i: usize| {
        let angle = std::f64::consts::PI * i as f64 / (most - 1) as f64;
        (0.5 * (1.0 - angle.cos()) * (count - 1) as f64).round() as usize
    };
    let mut places: Vec<usize> = (0..most).map(place).collect();
    places.dedup();
    let middle = |i: usize| 0.5 * (places[i] + places[i + 1]) as f64;
    let stands_for = |i: usize| {
        let low = if i == 0 { -0.5 } else { middle(i - 1) };
        let high = if i + 1 == places.len() {
            count as f64 - 0.5
        } else {
            middle(i)
        };
        (places[i], high - low)
    };
    (0..places.len()).map(stands_for).collect()
}

struct Search<'a> {
    frame: &'a Frame,
    paths: &'a [Path],
    instants: &'a [Instant],
    /// Weights of the trained instants; the others have weight one.
    weights: &'a [f64],
    /// Number of trained instants, the candidates for terms, which come first.
    num_trained: usize,
    max_terms: usize,
    budget: f64,
    rounding: f64,
}

/// Times and sweeps of the instants in whole vectors.
struct Times {
    /// Chebyshev polynomials, (degree, instant).
    polynomials: Vec<Vec<f64>>,
    sweeps: Vec<f64>,
}

/// Residuals of all samples, (path, instant), in whole vectors; the last instant is repeated.
#[derive(Clone)]
struct Matrix {
    stride: usize,
    re: Vec<f64>,
    im: Vec<f64>,
}

impl Matrix {
    fn at(&self, row: usize, column: usize) -> Complex64 {
        let at = row * self.stride + column;
        Complex64::new(self.re[at], self.im[at])
    }
}

impl Kernel for Search<'_> {
    type Output = Option<(CrossApproximation, f64)>;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> Option<(CrossApproximation, f64)> {
        let (paths, num_instants) = (self.paths, self.instants.len());
        let (mut matrix, turns) = self.residuals::<I>();
        let counts = self.weights(&matrix);
        let zero = vec![0.0; matrix.stride];
        let none = vec![0.0; paths.len()];
        let all = Self::reduce::<I, false>(&mut matrix, &counts, [&zero, &zero], [&none, &none]);
        let power = all.sum;
        if !power.is_finite() {
            return None;
        }
        if power == 0.0 {
            // Samples without amplitude say nothing of the other paths.
            let mut approximation = CrossApproximation::none();
            let (checks, _) = self.checks(&matrix, &approximation.instants);
            self.add_checks(&checks, &[], &mut approximation);
            return Some((approximation, 0.0));
        }
        let bound = self.budget * self.budget;

        // No terms: the mean amplitudes with one phase.
        let mut approximation = CrossApproximation {
            turns,
            ..CrossApproximation::of_one_phase(mean(paths), &[])
        };
        let [common_re, common_im] = self.phasors::<I>(&approximation.mean, matrix.stride);
        let mean_re: Vec<f64> = paths.iter().map(|path| path.re()[0]).collect();
        let mean_im: Vec<f64> = paths.iter().map(|path| -path.im()[0]).collect();
        let (row, multiples) = ([&common_re[..], &common_im], [&mean_re[..], &mean_im]);
        let flat = Self::reduce::<I, false>(&mut matrix, &counts, row, multiples);
        if flat.relative(&all) <= bound {
            let mut matrix = matrix.clone();
            Self::reduce::<I, true>(&mut matrix, &counts, row, multiples);
            let (checks, seen) = self.checks(&matrix, &[]);
            let error = flat.relative(&all).max(seen / all.sum);
            if error <= bound {
                self.add_checks(&checks, &[], &mut approximation);
                return Some((approximation, error.sqrt()));
            }
        }

        // Cross approximation with full pivoting.
        let mut rows: Vec<Vec<Complex64>> = Vec::new();
        // Coefficients of all paths, (term, path).
        let mut coefficients: Vec<[Vec<f64>; 2]> = Vec::new();
        let mut left = all;
        loop {
            if left.relative(&all) <= bound {
                // The run sees what is left at the checks.
                let (checks, seen) = self.checks(&matrix, &approximation.instants);
                let error = left.relative(&all).max(seen / all.sum);
                if error <= bound {
                    self.add_checks(&checks, &rows, &mut approximation);
                    return Some((approximation, error.sqrt()));
                }
            }
            if approximation.instants.len() == self.max_terms {
                return None;
            }
            let path = left.row;
            let column = self.largest_in(&matrix, path);
            let pivot = matrix.at(path, column);
            // A pivot of rounding errors would magnify those of its evaluation.
            let mean = power / (num_instants * paths.len()) as f64;
            if pivot.norm_sqr() <= mean * (0.01 * bound).max(self.rounding.powi(2)) {
                return None;
            }
            let row: Vec<Complex64> = (0..matrix.stride).map(|x| matrix.at(path, x) / pivot).collect();
            approximation.lower.push(rows.iter().map(|row| row[column]).collect());
            let own = coefficients
                .iter()
                .map(|[re, im]| Complex64::new(re[path], im[path]) / pivot);
            approximation
                .references
                .push((paths[path].clone(), pivot.inv(), own.collect()));
            approximation.instants.push(self.instants[column]);
            let row_parts = [
                row.iter().map(|c| c.re).collect::<Vec<f64>>(),
                row.iter().map(|c| c.im).collect(),
            ];
            let taken = [&matrix.re, &matrix.im].map(|part| -> Vec<f64> {
                let rows = part.chunks_exact(matrix.stride);
                rows.map(|row| row[column]).collect()
            });
            left = Self::reduce::<I, true>(
                &mut matrix,
                &counts,
                [&row_parts[0], &row_parts[1]],
                [&taken[0], &taken[1]],
            );
            coefficients.push(taken);
            rows.push(row);
        }
    }
}

impl Search<'_> {
    /// Residuals, and the rms of their phases weighted by power [turns].
    #[cfg_attr(optimised, inline(always))]
    fn residuals<I: Isa>(&self) -> (Matrix, f64) {
        let stride = self.instants.len().next_multiple_of(8);
        let mut matrix = Matrix {
            stride,
            re: vec![0.0; self.paths.len() * stride],
            im: vec![0.0; self.paths.len() * stride],
        };
        let times = self.times(stride);
        let splat = <I::F64 as Vector>::splat;
        let (mut squares, mut power) = (splat(0.0), 0.0);
        for p in 0..self.paths.len() {
            let path = &self.paths[p];
            let (res, ims) = (path.re(), path.im());
            let own = res[0] * res[0] + ims[0] * ims[0];
            power += own;
            for at in (0..stride).step_by(8) {
                let (mut re, mut im) = (splat(res[0]), splat(ims[0]));
                for k in 1..res.len() {
                    let polynomial = I::F64::load(&times.polynomials[k][at..]);
                    re = polynomial.mul_add(splat(res[k]), re);
                    im = polynomial.mul_add(splat(ims[k]), im);
                }
                let phase = self.phases::<I>(path, &times, at);
                squares = phase.mul(splat(own)).mul_add(phase, squares);
                let [cos, sin] = wide::cos_sin::<f64, I, 1>([phase]);
                let to = p * stride + at;
                im.mul_add(sin, re.mul(cos)).store(&mut matrix.re[to..]);
                im.neg_mul_add(cos, re.mul(sin)).store(&mut matrix.im[to..]);
            }
        }
        let mut lanes = [0.0; 8];
        squares.store(&mut lanes);
        let total = power * stride as f64;
        let turns = if total > 0.0 {
            (lanes.iter().sum::<f64>() / total).sqrt()
        } else {
            0.0
        };
        (matrix, turns)
    }

    /// Cosine and sine of the residual phase of a path.
    #[cfg_attr(optimised, inline(always))]
    fn phasors<I: Isa>(&self, path: &Path, stride: usize) -> [Vec<f64>; 2] {
        let times = self.times(stride);
        let mut phasors = [vec![0.0; stride], vec![0.0; stride]];
        for at in (0..stride).step_by(8) {
            let phase = self.phases::<I>(path, &times, at);
            let [cos, sin] = wide::cos_sin::<f64, I, 1>([phase]);
            cos.store(&mut phasors[0][at..]);
            sin.store(&mut phasors[1][at..]);
        }
        phasors
    }

    /// Residual phases of a path at the instants from `at` on [turns].
    #[cfg_attr(optimised, inline(always))]
    fn phases<I: Isa>(&self, path: &Path, times: &Times, at: usize) -> I::F64 {
        let splat = <I::F64 as Vector>::splat;
        let bends = path.bends();
        let mut delta = splat(0.0);
        for k in 0..bends.len() {
            delta = I::F64::load(&times.polynomials[k + 2][at..]).mul_add(splat(bends[k]), delta);
        }
        let (offset, rate) = (splat(path.offset), splat(path.rate));
        let (x, sweep) = (
            I::F64::load(&times.polynomials[1][at..]),
            I::F64::load(&times.sweeps[at..]),
        );
        turns(delta, offset, rate, x, sweep, splat(self.frame.bend))
    }

    /// Times and sweeps of the instants, the last repeated to fill whole vectors.
    fn times(&self, stride: usize) -> Times {
        let instant = |i: usize| &self.instants[i.min(self.instants.len() - 1)];
        let x: Vec<f64> = (0..stride).map(|i| instant(i).x).collect();
        let degrees = self
            .paths
            .iter()
            .map(|path| path.num_amplitudes().max(path.bends().len() + 2));
        let num_degrees = degrees.max().unwrap_or(0);
        let mut polynomials = vec![vec![1.0; stride], x];
        for k in 2..num_degrees {
            let next = |i: usize| 2.0 * polynomials[1][i] * polynomials[k - 1][i] - polynomials[k - 2][i];
            polynomials.push((0..stride).map(next).collect());
        }
        Times {
            polynomials,
            sweeps: (0..stride).map(|i| instant(i).sweep).collect(),
        }
    }

    /// Instant of the largest element of a path at the trained instants.
    fn largest_in(&self, matrix: &Matrix, path: usize) -> usize {
        let square = |x: usize| matrix.at(path, x).norm_sqr();
        let largest = (0..self.num_trained).map(square).fold(0.0, f64::max);
        (0..self.num_trained).find(|x| square(*x) * TIE >= largest).unwrap_or(0)
    }

    /// Weights of all instants, and ones at the trained instants; zeros after them.
    fn weights(&self, matrix: &Matrix) -> [Vec<f64>; 2] {
        let mut counted = self.weights.to_vec();
        counted.resize(self.instants.len(), 1.0);
        counted.resize(matrix.stride, 0.0);
        let mut trained = vec![1.0; self.num_trained];
        trained.resize(matrix.stride, 0.0);
        [counted, trained]
    }

    /// Instants of the checks of a remainder, and the sum of its squares at all instants by those at the checks. Half
    /// of them are where most is left, the others far from the instants of the terms, for paths unlike the samples.
    fn checks(&self, rest: &Matrix, instants: &[Instant]) -> (Vec<usize>, f64) {
        let mut all = vec![0.0; self.instants.len()];
        for (re, im) in rest.re.chunks_exact(rest.stride).zip(rest.im.chunks_exact(rest.stride)) {
            for ((sum, re), im) in all.iter_mut().zip(re).zip(im) {
                *sum += re * re + im * im;
            }
        }
        // Samples that are all references leave nothing but rounding.
        let power: f64 = self
            .paths
            .iter()
            .map(|path| path.re()[0].powi(2) + path.im()[0].powi(2))
            .sum();
        let is_exact = all.iter().sum::<f64>() <= 1e-24 * power * all.len() as f64;
        let mut chosen: Vec<usize> = Vec::new();
        for number in 0..NUM_CHECKS {
            let distance = |x: usize| {
                let taken = instants.iter().chain(chosen.iter().map(|x| &self.instants[*x]));
                // Residuals are near to even functions of time: what vanishes at x may do so at -x.
                let distances = taken.map(|other| (other.x.abs() - self.instants[x].x.abs()).abs());
                distances.fold(2.0, f64::min)
            };
            let best = if number % 2 == 0 && !is_exact {
                let apart = |x: &usize| {
                    chosen
                        .iter()
                        .all(|other| self.instants[*other].x != self.instants[*x].x)
                };
                (0..all.len()).filter(apart).max_by(|a, b| all[*a].total_cmp(&all[*b]))
            } else {
                (0..all.len()).max_by(|a, b| distance(*a).total_cmp(&distance(*b)))
            };
            chosen.extend(best);
        }
        let seen: f64 = chosen.iter().map(|x| all[*x]).sum();
        let ratio = all.len() as f64 / chosen.len() as f64;
        (chosen, seen * ratio)
    }

    /// Add the checks at some instants, with the weights of the terms there.
    fn add_checks(&self, checks: &[usize], rows: &[Vec<Complex64>], approximation: &mut CrossApproximation) {
        for x in checks {
            // Weights w of g(x_i) in sum_i c_i q_i(x): L^T w = q(x), with the lower triangle L of q_j(x_i).
            let mut weights: Vec<Complex64> = rows.iter().map(|row| row[*x]).collect();
            for i in (0..weights.len()).rev() {
                let weight = weights[i];
                for (j, value) in approximation.lower[i].iter().enumerate() {
                    weights[j] -= value * weight;
                }
            }
            approximation.checks.push(Check {
                instant: self.instants[*x],
                weights,
            });
        }
    }
}

/// Path of the mean residual phase: means of `rate^2`, `offset rate` and the bends, weighted by power.
pub fn mean(paths: &[Path]) -> Path {
    let power = |path: &Path| path.re()[0].powi(2) + path.im()[0].powi(2);
    let total: f64 = paths.iter().map(power).sum();
    let mean = |value: &dyn Fn(&Path) -> f64| {
        if total > 0.0 {
            paths.iter().map(|path| power(path) * value(path)).sum::<f64>() / total
        } else {
            0.0
        }
    };
    let rate = mean(&|path| path.rate * path.rate).sqrt();
    let skew = mean(&|path| path.offset * path.rate);
    let num_bends = paths.iter().map(|path| path.bends().len()).max().unwrap_or(0);
    let offset = if rate > 0.0 { skew / rate } else { 0.0 };
    let bends = (0..num_bends).map(|k| mean(&|path| path.bends()[k]));
    Path::new([offset, rate], bends, [std::iter::empty(), std::iter::empty()])
}

/// Remainder of a matrix after some terms.
#[derive(Clone, Copy)]
struct Left {
    /// Sum of the squares at all instants.
    sum: f64,
    /// Path with the largest element at the trained instants.
    row: usize,
}

impl Left {
    /// Sum relative to that of `all`.
    fn relative(&self, all: &Self) -> f64 {
        if all.sum > 0.0 { self.sum / all.sum } else { 0.0 }
    }
}

impl Search<'_> {
    /// Subtract multiples of a row, one per path, from all paths; in place if it `STORES`. The weights are those of
    /// [`Self::weights`]; complex numbers are in two parts.
    #[cfg_attr(optimised, inline(always))]
    fn reduce<I: Isa, const STORES: bool>(
        matrix: &mut Matrix,
        [counted, trained]: &[Vec<f64>; 2],
        [row_re, row_im]: [&[f64]; 2],
        [multiple_re, multiple_im]: [&[f64]; 2],
    ) -> Left {
        let splat = <I::F64 as Vector>::splat;
        let mut total = splat(0.0);
        let (mut largest, mut row) = (0.0, 0);
        for path in 0..multiple_re.len() {
            let (a, b) = (splat(multiple_re[path]), splat(multiple_im[path]));
            let (mut sum, mut most) = (splat(0.0), splat(0.0));
            for at in (0..matrix.stride).step_by(8) {
                let (c, d) = (I::F64::load(&row_re[at..]), I::F64::load(&row_im[at..]));
                let to = path * matrix.stride + at;
                let re = b.mul_add(d, a.neg_mul_add(c, I::F64::load(&matrix.re[to..])));
                let im = b.neg_mul_add(c, a.neg_mul_add(d, I::F64::load(&matrix.im[to..])));
                if STORES {
                    re.store(&mut matrix.re[to..]);
                    im.store(&mut matrix.im[to..]);
                }
                let square = re.mul_add(re, im.mul(im));
                sum = square.mul_add(I::F64::load(&counted[at..]), sum);
                most = square.mul(I::F64::load(&trained[at..])).max(most);
            }
            total = total.add(sum);
            let mut lanes = [0.0_f64; 8];
            most.store(&mut lanes);
            for half in [4, 2, 1] {
                for i in 0..half {
                    lanes[i] = lanes[i].max(lanes[i + half]);
                }
            }
            if lanes[0] > largest * TIE {
                (largest, row) = (lanes[0], path);
            }
        }
        let mut lanes = [0.0; 8];
        total.store(&mut lanes);
        Left {
            sum: lanes.iter().sum(),
            row,
        }
    }
}

#[cfg(test)]
mod tests;
