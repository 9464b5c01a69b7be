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
//! residual R is small, and its deviation from the middle path is expanded in powers: every product of powers of `p` and
//! `q` is a strength of the path that has a grid of its own, and a factor of the samples.

use std::f64::consts::{SQRT_2, TAU};

use super::grid::{FINE_STEP, STEP};
use super::scan::{Moving, Range, Scan};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::Block;
use crate::synthesis::kaiser_bessel::ToneError;
use crate::synthesis::report::{ErrorBound, Known, SINGLE_TOLERANCE};

/// Kernel: in single precision or not, width [cells], on a [fine](super::grid::Layout::is_fine) grid or not.
type Kernel = (bool, usize, bool);

/// Kernels, the fastest for many paths first.
const KERNELS: [Kernel; 7] = [
    (true, 4, false),
    (true, 6, false),
    (true, 8, false),
    (true, 8, true),
    (false, 10, false),
    (false, 12, false),
    (false, 14, false),
];

/// Fewest paths for a fine grid, over the number of samples: its transforms take longer than a wider kernel does for
/// fewer.
const PATHS_OF_FINE: f64 = 0.5;

/// Rounding errors, relative to l2(amplitudes); measured.
const SINGLE_ROUNDING: f64 = 3e-7;
const DOUBLE_ROUNDING: f64 = 3e-14;
/// Rounding of the sum of n numbers of a cell in single precision, one after the other, relative to their l2 norm and
/// sqrt(n); measured.
const SINGLE_SUM: f64 = 6e-8;
/// Rounding per path of sums of nearly equal numbers in single precision, one after the other; measured.
const SINGLE_EQUAL_SUM: f64 = 6e-9;

/// Shares of the tolerance for the kernel with rounding, and for these and the expansion.
const KERNEL_SHARE: f64 = 0.9;
const MARGIN: f64 = 0.95;
/// Gain that first plans in single precision allow for: a wider kernel costs less than a rare second run.
const GAIN_RESERVE: f64 = 1.2;
/// Smallest tolerance with that reserve: others would take double precision for it.
const LEAST_RESERVED: f64 = 2.0 * SINGLE_TOLERANCE;

/// Highest order of the expansion of residual phases.
const MAX_ORDER: usize = 2;

/// Largest velocity axis [rows].
const MAX_ROWS: f64 = 1e6;

/// Carrier that phases are taken about, and the velocity axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Frequency f_c of the middle sample, less the beat frequency of the middle delay [Hz].
    pub carrier: f64,
    /// Middle of the delays [s].
    pub middle_delay: f64,
    /// Relative slope S / f_c [1/s].
    pub stretch: f64,
    /// Half of its duration [s].
    pub half: f64,
    /// Rate at the middle of the axis [s/s].
    pub middle_rate: f64,
    /// Distance of two velocity rows [s/s].
    pub step: f64,
    /// Number of velocity rows, even.
    pub rows: usize,
}

/// Expansion of the residual phases about those of the middle path, by powers of `(p - middle) / half` and
/// `(q - middle) / half`.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// Middle and half of the range of the factors `p` of `x s` [turns].
    pub skew: [f64; 2],
    /// Middle and half of the range of the factors `q` of `x^2` [turns].
    pub square: [f64; 2],
    /// Mean of x^2 over the frame: that part of q x^2 is constant.
    pub mean_square: f64,
    /// Powers of both in every strength.
    pub powers: Vec<[usize; 2]>,
    /// Bound of the rms over the samples of all that is left out.
    pub error: f64,
}

/// Plan of a sum.
#[derive(Clone, Debug)]
pub struct Plan {
    /// True for grids in single precision.
    pub is_single: bool,
    /// Width of the kernel [cells].
    pub width: usize,
    /// True for a [fine](super::grid::Layout::is_fine) grid.
    pub is_fine: bool,
    /// Velocity axis and expansion, if there are moving paths.
    pub moving: Option<(Axis, Expansion)>,
    /// Error.
    pub error: ErrorBound,
}

impl Plan {
    /// Fastest plan for a tolerance, or the most accurate one, for paths that may have some gain. None if no velocity axis
    /// can follow the paths.
    pub fn new(waveform: &Waveform, block: &Block, scan: &Scan, tolerance: f64, known: Known) -> Option<Self> {
        let reserve = if tolerance >= LEAST_RESERVED { GAIN_RESERVE } else { 1.0 };
        let gain = if known.gain > 1.0 { known.gain } else { reserve };
        let bound = |kernel: Kernel| kernel_bound(waveform, kernel, scan.moving.is_some(), scan.coherence);
        let num_samples = (waveform.chirp_times.len() * waveform.num_samples) as f64;
        let are_many = scan.num_paths as f64 > PATHS_OF_FINE * num_samples;
        let is_allowed =
            |(is_single, _, is_fine): &Kernel| (are_many || !is_fine) && !(*is_single && known.needs_double);
        let is_enough =
            |kernel: &Kernel| is_allowed(kernel) && bound(*kernel).with_gain(gain) <= KERNEL_SHARE * tolerance;
        let found = KERNELS.into_iter().find(is_enough);
        let (is_single, width, is_fine) = found.unwrap_or(KERNELS[KERNELS.len() - 1]);

        let mut error = bound((is_single, width, is_fine));
        let mut plan_of_moving = None;
        if let Some(moving) = &scan.moving {
            let axis = Axis::new(waveform, block, &moving.delay, (width, is_fine))?;
            let one = ErrorBound {
                truncation: 1.0,
                ..ErrorBound::default()
            };
            let budget = (MARGIN * tolerance).powi(2) - error.with_gain(gain).powi(2);
            let budget = budget.max(0.0).sqrt() / one.with_gain(gain);
            let expansion = Expansion::new(waveform, block, &axis, moving, budget);
            error.truncation = expansion.error;
            plan_of_moving = Some((axis, expansion));
        }
        Some(Self {
            is_single,
            width,
            is_fine,
            moving: plan_of_moving,
            error,
        })
    }

    /// Error for paths of a measured coherence.
    pub fn error_for(&self, waveform: &Waveform, coherence: f64) -> ErrorBound {
        let kernel = (self.is_single, self.width, self.is_fine);
        ErrorBound {
            truncation: self.error.truncation,
            ..kernel_bound(waveform, kernel, self.moving.is_some(), coherence)
        }
    }

    /// Number of strengths of a moving path.
    pub fn num_terms(&self) -> usize {
        self.moving.as_ref().map_or(1, |(_, expansion)| expansion.powers.len())
    }

    /// Number of velocity rows; 0 for static paths alone.
    pub fn num_rows(&self) -> usize {
        self.moving.as_ref().map_or(0, |(axis, _)| axis.rows)
    }
}

/// Errors of a kernel and of rounding, for paths of some coherence.
fn kernel_bound(
    waveform: &Waveform,
    (is_single, width, is_fine): Kernel,
    is_moving: bool,
    coherence: f64,
) -> ErrorBound {
    let mut tone = if is_fine {
        ToneError::on_fine_grid(width)
    } else {
        ToneError::new(width)
    };
    if is_moving {
        // Of both axes.
        tone.rms *= SQRT_2;
        if waveform.chirp_times.len() <= 2 {
            // All chirps are at the ends of the velocity axis, where errors are largest.
            tone.rms = tone.rms.hypot(tone.largest);
        }
    }
    ErrorBound {
        kernel: tone.with_coherence(coherence),
        truncation: 0.0,
        rounding: if is_single {
            SINGLE_ROUNDING.hypot(SINGLE_SUM * coherence)
        } else {
            DOUBLE_ROUNDING
        },
        equal_rounding: if is_single { SINGLE_EQUAL_SUM } else { 0.0 },
        ..ErrorBound::default()
    }
}

impl Axis {
    /// Axis for ranges of the delays and a kernel of some width. None if plane waves cannot follow the phases: the
    /// carrier is too low, or the paths are too fast.
    fn new(waveform: &Waveform, block: &Block, delay: &[Range; 2], (width, is_fine): (usize, bool)) -> Option<Self> {
        let middle_delay = delay[0].middle();
        let carrier = waveform.start_frequency + waveform.slope * (waveform.middle_time() - middle_delay);
        let stretch = waveform.slope / carrier;
        // Rates b = c_1 (1 - u) / half, with one part in 10^9 for rounding.
        let offset = (stretch * delay[0].half() * delay[1].magnitude()).abs();
        let middle_rate = delay[1].middle() / block.half;
        let half = ((delay[1].half() + offset) * (1.0 + 1e-9)) / block.half;

        let slow = slow_times(waveform, block).fold(0.0, |most: f64, time| most.max(time.abs()));
        let (slope, fast) = (waveform.slope.abs(), waveform.half_sweep());
        let keystone = (carrier.abs() + slope * fast) * slow + slope * fast * fast;
        let turns = if is_fine { FINE_STEP } else { STEP };
        let step = if keystone > 0.0 { turns / keystone } else { 1.0 };
        let rows = 2.0 * half / step + 1e-6;
        let is_followed = (0.5 * stretch / carrier).abs() <= 1.0 && rows <= MAX_ROWS;
        is_followed.then(|| Self {
            carrier,
            middle_delay,
            stretch,
            half: block.half,
            middle_rate,
            step,
            rows: (rows.ceil() as usize + width + 2).next_multiple_of(2),
        })
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

impl Expansion {
    /// Fewest strengths whose error is within `budget`, for known paths.
    fn new(waveform: &Waveform, block: &Block, axis: &Axis, moving: &Moving, budget: f64) -> Self {
        let delay = &moving.delay;
        // The offsets u lie evenly about zero, and so do p.
        let most = axis.carrier.abs() * delay[1].magnitude();
        let skew = [0.0, axis.stretch.abs() * delay[0].half() * most];
        let least = if delay[1].low < 0.0 && delay[1].high > 0.0 {
            0.0
        } else {
            axis.carrier.abs() * delay[1].low.abs().min(delay[1].high.abs())
        };
        let factor = -0.5 * axis.stretch / axis.carrier;
        let square = [
            0.5 * factor * (most * most + least * least),
            (0.5 * factor * (most * most - least * least)).abs(),
        ];

        let slow: Vec<f64> = slow_times(waveform, block).map(|time| time / block.half).collect();
        let fast: Vec<f64> = (0..waveform.num_samples)
            .map(|sample| fast_time(waveform, sample) / block.half)
            .collect();
        let mean_square = slow.iter().map(|x| x * x).sum::<f64>() / slow.len() as f64;
        let deviation: Vec<f64> = slow.iter().map(|x| x * x - mean_square).collect();
        // Largest norms of both parts of the phase over the frame, by the triangle inequality: slow and fast time are
        // independent.
        let phases = |p: i32| {
            let sweep = (axis.stretch * block.half).abs();
            let (of_slow, of_fast, squared) = (norm(&slow, p), norm(&fast, p), norm(&fast, 2 * p).powi(2));
            let skewed = sweep * (of_slow * of_fast + squared);
            let bent = norm(&deviation, p) + 2.0 * of_slow * of_fast + squared;
            [TAU * skew[1] * skewed, TAU * square[1] * bent]
        };
        let norms = [2, 4, 6].map(phases);
        let shares = moving.shares(axis, skew[1], square);
        let mut terms = vec![];
        for order in 1..=MAX_ORDER {
            let [skewed, bent] = norms[order - 1];
            for j in 0..=order {
                let i = order - j;
                let share = (if i > 0 { shares[0] } else { 1.0 }).min(if j > 0 { shares[1] } else { 1.0 });
                let bound = share * skewed.powf(i as f64) * bent.powf(j as f64) / (FACTORIALS[i] * FACTORIALS[j]);
                terms.push((bound, [i, j]));
            }
        }
        terms.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut error =
            shares[0].max(shares[1]) * (norms[MAX_ORDER][0] + norms[MAX_ORDER][1]).powi(3) / FACTORIALS[MAX_ORDER + 1];
        let mut num_omitted = 0;
        while num_omitted < terms.len() && error + terms[num_omitted].0 <= budget {
            error += terms[num_omitted].0;
            num_omitted += 1;
        }
        error *= waveform.fluctuation();
        let further = terms[num_omitted..].iter().rev().map(|(_, powers)| *powers);
        Self {
            skew,
            square,
            mean_square,
            powers: std::iter::once([0, 0]).chain(further).collect(),
            error,
        }
    }
}

impl Moving {
    /// Weighted rms of the factors p and q from their middle over the largest deviation, the largest of all channels; 1
    /// without moments.
    fn shares(&self, axis: &Axis, most_skew: f64, [middle, most_square]: [f64; 2]) -> [f64; 2] {
        if self.moments.is_empty() {
            return [1.0; 2];
        }
        let mut shares = [0.0_f64; 2];
        let factor = -0.5 * axis.stretch * axis.carrier;
        for [power, rate, fourth, skew] in &self.moments {
            let skew = (axis.stretch * axis.carrier).powi(2) * skew;
            let square = factor * factor * fourth - 2.0 * factor * middle * rate + middle * middle * power;
            for (share, (sum, most)) in shares.iter_mut().zip([(skew, most_skew), (square, most_square)]) {
                // Sums cancel to their rounding.
                let mean = (sum / power).max(0.0).sqrt() / most;
                *share = share.max(if mean.is_finite() { mean + 1e-3 } else { 0.0 });
            }
        }
        shares.map(|share| share.min(1.0))
    }
}

/// Factorials of the powers of an expansion.
pub const FACTORIALS: [f64; MAX_ORDER + 2] = [1.0, 1.0, 2.0, 6.0];

/// Mean of the p-th powers of magnitudes, to the power of 1/p.
fn norm(numbers: &[f64], p: i32) -> f64 {
    let sum: f64 = numbers.iter().map(|x| x.abs().powi(p)).sum();
    (sum / numbers.len() as f64).powf(f64::from(p).recip())
}
