//! Plan of a sum: kernel, velocity axis, and the expansion of the residual phases.
//!
//! With the delay `tau = c_0 + c_1 x` of a path, `x` from -1 to 1 over the frame, its phase (docs/theory.md eq. (1)) is
//! exactly
//!
//! ```text
//! constant + X t' + b xi + R       t' = t - t_0,  xi = (f_c + S t') T'_c + S t'^2,  x = (T'_c + t') / half
//! X = S c_0 + b f_c                b = c_1 (1 - u) / half,  u = S (c_0 - middle delay) / f_c
//! R = p x s + q x^2                p = u f_c c_1,  q = -S c_1^2 / 2,  s = S t' / f_c
//! ```
//!
//! in turns: a beat frequency X and a rate b whose "keystone" frequency xi is the same for every path. X and b are the
//! axes of the grid; xi carries range migration and Doppler within a chirp through the transform over slow time. The
//! residual R is small, and its deviation from the middle path is expanded in powers of `p` and `q`: 1, p, q, p^2, p q, q^2,
//! or the first of these. Every one is a strength of the path that has a grid of its own, and a factor of the samples.

use std::f64::consts::{SQRT_2, TAU};

use super::grid::STEP;
use crate::numeric::kaiser_bessel::ToneError;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::Block;
use crate::synthesis::report::{ErrorBound, Options};

/// Kernels, the fastest first: in single precision or not, width [cells].
const KERNELS: [(bool, usize); 6] = [(true, 4), (true, 6), (true, 8), (false, 10), (false, 12), (false, 14)];

/// Rounding errors, relative to l2(amplitudes); measured.
const SINGLE_ROUNDING: f64 = 3e-7;
const DOUBLE_ROUNDING: f64 = 3e-14;
/// Rounding of the sum of n numbers of a cell in single precision, one after the other, relative to the sum and sqrt(n);
/// measured.
const SINGLE_SUM: f64 = 6e-8;
/// Rounding per path of sums of nearly equal numbers in single precision, one after the other; measured.
const SINGLE_EQUAL_SUM: f64 = 6e-9;

/// Shares of the tolerance for the kernel with rounding, and for these and the expansion.
const KERNEL_SHARE: f64 = 0.9;
const MARGIN: f64 = 0.95;
/// Gain that first plans allow for: a wider kernel costs less than a rare second run.
const GAIN_RESERVE: f64 = 1.1;
/// Energy that first plans allow for, times the number of paths for one that is measured: many paths of independent phases
/// have less.
const ENERGY_RESERVE: f64 = 1.26;
/// Load of cells that first plans allow for, see [`kernel_error`].
const LOAD_RESERVE: f64 = 250.0;
/// Numbers of paths for one that is measured, if a tolerance leaves room for this energy times the number: the sum of
/// the others may be strong.
const STEPS: [usize; 3] = [8, 4, 2];
const ENERGY_PER_STEP: f64 = 7.0;
/// Fewest paths for a measurement by some of them; the order of fewer paths does not matter.
const FEWEST_SAMPLED: usize = 8192;

/// Largest velocity axis [rows].
const MAX_ROWS: f64 = 1e6;

/// Plan of a sum.
#[derive(Clone, Debug)]
pub struct DopplerPlan<'a> {
    /// Waveform of the frame.
    pub waveform: &'a Waveform,
    /// True for grids in single precision.
    pub is_single: bool,
    /// Width of the kernel [cells].
    pub width: usize,
    /// Velocity axis and expansion, if there are moving paths.
    pub moving: Option<Moving>,
    /// Number of paths for one that is [measured](crate::synthesis::coherence).
    pub step: usize,
    /// Error.
    pub error: ErrorBound,
}

/// Velocity axis of moving paths, and the expansion of their residual phases about the middle path, in powers of
/// p, which lies evenly about zero, and of q from its middle.
#[derive(Clone, Copy, Debug)]
pub struct Moving {
    /// Frequency f_c of the middle sample, less the beat frequency of the middle delay [Hz].
    pub carrier: f64,
    /// Middle of the delays [s].
    pub middle_delay: f64,
    /// Relative slope S / f_c [1/s].
    pub stretch: f64,
    /// Half of the duration of the frame [s].
    pub half: f64,
    /// Rate at the middle of the axis [s/s].
    pub middle_rate: f64,
    /// Distance of two velocity rows [s/s].
    pub step: f64,
    /// Number of velocity rows, even.
    pub rows: usize,
    /// Middle of the factors q of `x^2` [turns].
    pub middle_square: f64,
    /// Mean of x^2 over the frame: that part of q x^2 is constant.
    pub mean_square: f64,
    /// Number of strengths of a path.
    pub num_terms: usize,
    /// Bound of the rms over the samples of all that is left out.
    error: f64,
}

impl<'a> DopplerPlan<'a> {
    /// Fastest plan for a tolerance, or the most accurate one, for moving paths of some
    /// [ranges](super::scan::delay_ranges), and the number of all paths. Its error is infinite if no velocity axis can
    /// follow the paths.
    pub fn new(
        waveform: &'a Waveform,
        block: &Block,
        ranges: Option<&[[f64; 2]; 2]>,
        num_paths: usize,
        options: &Options,
    ) -> Self {
        let Options { tolerance, known, .. } = *options;
        let gain = if known.gain > 1.0 { known.gain } else { GAIN_RESERVE };
        let expected = |step: usize| known.coherence.powi(2).max(ENERGY_RESERVE * step as f64);
        let bound = |kernel, energy| kernel_error(waveform, kernel, ranges.is_some(), [energy, LOAD_RESERVE]);
        let is_enough = |kernel, energy| bound(kernel, energy).with_gain(gain) <= KERNEL_SHARE * tolerance;
        let mut kernels = KERNELS
            .into_iter()
            .filter(|(is_single, _)| !(*is_single && known.needs_double));
        let found = kernels.find(|kernel| is_enough(*kernel, expected(1)));
        let kernel = found.unwrap_or(KERNELS[KERNELS.len() - 1]);
        let mut steps = STEPS.into_iter().filter(|_| num_paths >= FEWEST_SAMPLED);
        let step = steps.find(|step| is_enough(kernel, ENERGY_PER_STEP * *step as f64));
        let step = step.unwrap_or(1);

        let error = bound(kernel, expected(step));
        let keeps = |truncation| ErrorBound { truncation, ..error }.with_gain(gain) <= MARGIN * tolerance;
        let moving = ranges.map(|ranges| Moving::new(waveform, block, ranges, kernel.1, keeps));
        Self {
            waveform,
            is_single: kernel.0,
            width: kernel.1,
            moving,
            step,
            error: ErrorBound {
                truncation: moving.map_or(0.0, |moving| moving.error),
                ..error
            },
        }
    }

    /// Number of strengths of a moving path.
    pub fn num_terms(&self) -> usize {
        self.moving.map_or(1, |moving| moving.num_terms)
    }
}

/// Errors of a kernel and of rounding, for paths of some [energy beside the frame](crate::synthesis::coherence), and of a
/// load: the number of paths of a cell times that energy.
pub fn kernel_error(
    waveform: &Waveform,
    (is_single, width): (bool, usize),
    is_moving: bool,
    [energy, load]: [f64; 2],
) -> ErrorBound {
    let mut tone = ToneError::new(width);
    if is_moving {
        // Of both axes; two chirps are at the ends of the velocity axis, where errors are largest.
        let share = (2.0 / waveform.chirp_times.len() as f64).min(1.0);
        tone.rms = (SQRT_2 * tone.rms).hypot(share.sqrt() * tone.largest);
    }
    let [rounding, equal_rounding] = if is_single {
        [SINGLE_ROUNDING.hypot(SINGLE_SUM * load.sqrt()), SINGLE_EQUAL_SUM]
    } else {
        [DOUBLE_ROUNDING, 0.0]
    };
    ErrorBound {
        kernel: waveform.fluctuation() * tone.with_energy(energy),
        rounding: waveform.fluctuation() * rounding,
        equal_rounding,
        ..ErrorBound::default()
    }
}

/// Times of the middle samples of the chirps from the centre of the frame [s].
pub fn slow_times<'a>(waveform: &'a Waveform, block: &Block) -> impl Iterator<Item = f64> + 'a {
    let start = waveform.middle_time() - block.center;
    waveform.chirp_times.iter().map(move |time| time + start)
}

/// Time of a sample from the middle one [s].
pub fn fast_time(waveform: &Waveform, sample: usize) -> f64 {
    (sample as f64 - (waveform.num_samples / 2) as f64) / waveform.sample_rate
}

impl Moving {
    /// Axis and expansion for ranges of the delays, a kernel of some width, and an error of the expansion that is small
    /// enough if possible; infinite if plane waves cannot follow the phases: the carrier is too low, or the paths are too
    /// fast.
    fn new(
        waveform: &Waveform,
        block: &Block,
        ranges: &[[f64; 2]; 2],
        width: usize,
        is_enough: impl Fn(f64) -> bool,
    ) -> Self {
        let [[middle_delay, half_delay], [middle_rate, half_rate]] = *ranges;
        let most_rate = middle_rate.abs() + half_rate;
        let carrier = waveform.start_frequency + waveform.slope * (waveform.middle_time() - middle_delay);
        let stretch = waveform.slope / carrier;
        // Rates b = c_1 (1 - u) / half, with one part in 10^9 for rounding.
        let offset = (stretch * half_delay * most_rate).abs();
        let half_range = ((half_rate + offset) * (1.0 + 1e-9)) / block.half;

        let slow: Vec<f64> = slow_times(waveform, block).collect();
        let most_slow = slow.iter().fold(0.0, |most: f64, time| most.max(time.abs()));
        let (slope, fast) = (waveform.slope.abs(), waveform.half_sweep());
        let keystone = (carrier.abs() + slope * fast) * most_slow + slope * fast * fast;
        let step = if keystone > 0.0 { STEP / keystone } else { 1.0 };
        let rows = 2.0 * half_range / step + 1e-6;
        let is_followed = (0.5 * stretch / carrier).abs() <= 1.0 && rows <= MAX_ROWS;

        // Rates of no sign include zero.
        let most = carrier.abs() * most_rate;
        let least = carrier.abs() * (middle_rate.abs() - half_rate).max(0.0);
        // Halves of the ranges of p and of q [turns].
        let skew = stretch.abs() * half_delay * most;
        let factor = -0.25 * stretch / carrier;
        let square = (factor * (most * most - least * least)).abs();
        let slow: Vec<f64> = slow.iter().map(|time| time / block.half).collect();
        let mean_square = slow.iter().map(|x| x * x).sum::<f64>() / slow.len() as f64;
        let deviation: Vec<f64> = slow.iter().map(|x| x * x - mean_square).collect();
        let fast = (0..waveform.num_samples).map(|sample| fast_time(waveform, sample) / block.half);
        let fast: Vec<f64> = fast.collect();
        // Largest norms of both parts of the phase over the frame, by the triangle inequality: slow and fast time are
        // independent.
        let phases = |p: i32| {
            let both = norm(&slow, p) * norm(&fast, p);
            let squared = norm(&fast, 2 * p).powi(2);
            let skewed = (stretch * block.half).abs() * (both + squared);
            let bent = norm(&deviation, p) + 2.0 * both + squared;
            [TAU * skew * skewed, TAU * square * bent]
        };
        let [first, second, third] = [2, 4, 6].map(phases);
        let second_order = (second[0] + second[1]).powi(2) / 2.0;
        let third_order = (third[0] + third[1]).powi(3) / 6.0;
        let errors = [
            (1, first[0] + first[1]),
            (2, first[1] + second_order),
            (3, second_order),
            (4, second[0] * second[1] + second[1].powi(2) / 2.0 + third_order),
            (6, third_order),
        ];
        let errors = errors.map(|(num_terms, error)| (num_terms, error * waveform.fluctuation()));
        let (num_terms, error) = errors
            .into_iter()
            .find(|(_, error)| is_enough(*error))
            .unwrap_or(errors[4]);
        Self {
            carrier,
            middle_delay,
            stretch,
            half: block.half,
            middle_rate: middle_rate / block.half,
            step,
            rows: (rows.min(MAX_ROWS).ceil() as usize + width + 2).next_multiple_of(2),
            middle_square: factor * (most * most + least * least),
            mean_square,
            num_terms,
            error: if is_followed { error } else { f64::INFINITY },
        }
    }
}

/// Mean of the p-th powers of magnitudes, to the power of 1/p.
fn norm(numbers: &[f64], p: i32) -> f64 {
    let sum: f64 = numbers.iter().map(|x| x.abs().powi(p)).sum();
    (sum / numbers.len() as f64).powf(f64::from(p).recip())
}
