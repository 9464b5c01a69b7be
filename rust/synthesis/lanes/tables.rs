//! Tables of a frame: what multiplies the coefficients of paths in every chirp, and the factors of the samples.

use std::f64::consts::TAU;

use super::transform;
use crate::synthesis::block::Block;
use crate::synthesis::chirp::Waveform;

/// Chirps of a group: the lanes of a vector.
pub const LANES: usize = 16;

/// Coefficients of the phase after the constant one that a record has room for.
pub const NUM_TURNS: usize = 7;

/// Most rows of a series.
pub const MOST_TERMS: usize = NUM_TURNS + 1;

/// Coefficients of the amplitude that a record has room for.
pub const NUM_AMPLITUDES: usize = 4;

/// Fewest cells of a grid: transforms are made of passes of four.
const FEWEST_CELLS: usize = 16;

/// One number per chirp of a group.
pub type Chirps = [f32; LANES];

/// Tables of 16 chirps; lanes beyond the last chirp repeat it.
#[derive(Clone, Debug, Default)]
pub struct GroupTables {
    /// Phase per coefficient of the phase.
    pub phase: [Chirps; NUM_TURNS],
    /// Cells per coefficient of the phase [cells per turn].
    pub cell: [Chirps; NUM_TURNS],
    /// Strength of the second grid per coefficient of the phase [rad per turn].
    pub bend: [Chirps; NUM_TURNS],
    /// Basis functions 1, 2, 3.
    pub basis: [Chirps; NUM_AMPLITUDES - 1],
}

/// Constants of a frame: the same for all paths and channels.
#[derive(Clone, Debug)]
pub struct Tables {
    /// Half the duration of the frame, whose Chebyshev polynomials the coefficients are of [s].
    pub half: f64,
    /// Number of chirps.
    pub num_chirps: usize,
    /// Number of samples of a chirp.
    pub num_samples: usize,
    /// Number of cells of the grid, a power of two, at least twice the number of samples.
    pub num_cells: usize,
    /// Frequency at the middle sample [Hz].
    pub frequency: f64,
    /// Frequency that tables are made for [Hz]: that received at the middle delay [s].
    pub carrier: f64,
    /// Middle delay [s].
    pub middle_delay: f64,
    /// Slope of the ramp [Hz/s].
    pub slope: f64,
    /// Cells per frequency [s].
    pub cells_per_frequency: f64,
    /// Square of the time from the middle sample less its mean, over the mean, by sample.
    pub second: Vec<f64>,
    /// Ratio of the largest expected rms of errors with random phases to the mean: few samples fluctuate.
    pub fluctuation: f64,
    /// Moments of the samples of a chirp.
    pub moments: Moments,
    /// Tables of 16 chirps each.
    pub groups: Vec<GroupTables>,
    /// Factors of the transform, see [`transform`].
    pub twiddles: Vec<f32>,
}

/// Means over the samples of a chirp of powers of the time from the middle sample.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    /// Mean of the square [s^2].
    pub square: f64,
    /// Root mean square of the square less its mean [s^2].
    pub bend: f64,
    /// Root mean square of the square of the square less its mean [s^4].
    pub bend_squared: f64,
    /// Root mean square of the cube [s^3].
    pub cube: f64,
}

impl Moments {
    fn new(waveform: &Waveform) -> Self {
        let (number, middle) = (waveform.num_samples, waveform.num_samples / 2);
        let times = || (0..number).map(|sample| (sample as f64 - middle as f64) / waveform.sample_rate);
        let mean = |power: &dyn Fn(f64) -> f64| times().map(power).sum::<f64>() / number as f64;
        let square = mean(&|t| t * t);
        Self {
            square,
            bend: mean(&|t| (t * t - square).powi(2)).sqrt(),
            bend_squared: mean(&|t| (t * t - square).powi(4)).sqrt(),
            cube: mean(&|t| t.powi(6)).sqrt(),
        }
    }
}

impl Tables {
    /// Tables of a frame, the block of all chirps, for delays about `middle_delay` [s].
    pub fn new(waveform: &Waveform, frame: &Block, middle_delay: f64) -> Self {
        let (num_chirps, num_samples) = (waveform.chirp_times.len(), waveform.num_samples);
        let num_cells = Self::num_cells(num_samples);
        let frequency = waveform.start_frequency + waveform.slope * waveform.middle_time();
        let moments = Moments::new(waveform);
        let time = |sample: usize| (sample as f64 - (num_samples / 2) as f64) / waveform.sample_rate;
        let second = |sample: usize| {
            if moments.square > 0.0 {
                time(sample).powi(2) / moments.square - 1.0
            } else {
                0.0
            }
        };
        let mut tables = Self {
            num_chirps,
            num_samples,
            num_cells,
            frequency,
            carrier: frequency - waveform.slope * middle_delay,
            middle_delay,
            slope: waveform.slope,
            cells_per_frequency: num_cells as f64 / waveform.sample_rate,
            second: (0..num_samples).map(second).collect(),
            // Three standard deviations of the mean of squares of normal numbers.
            fluctuation: (1.0 + 3.0 / ((num_chirps * num_samples) as f64).sqrt()).sqrt(),
            moments,
            groups: Vec::new(),
            twiddles: transform::twiddles(num_cells),
            half: frame.half,
        };
        tables.groups = (0..num_chirps)
            .step_by(LANES)
            .map(|first| tables.group(waveform, frame, first))
            .collect();
        tables
    }

    /// Number of cells of the grid for a number of samples.
    pub fn num_cells(num_samples: usize) -> usize {
        (2 * num_samples).next_power_of_two().max(FEWEST_CELLS)
    }

    fn group(&self, waveform: &Waveform, frame: &Block, first: usize) -> GroupTables {
        let mut group = GroupTables::default();
        // Coefficients are in turns at the carrier: their share of the ramp's frequency.
        let ramp = self.slope / self.carrier;
        let per_second = self.half.recip();
        for lane in 0..LANES {
            let chirp = (first + lane).min(self.num_chirps - 1);
            let x = frame.x(waveform.chirp_times[chirp] + waveform.middle_time());
            let [value, rate, acceleration] = polynomials(x);
            for k in 0..NUM_TURNS {
                let (rate, acceleration) = (rate[k + 1] * per_second, acceleration[k + 1] * per_second.powi(2));
                let bend = ramp * rate + 0.5 * acceleration;
                group.phase[k][lane] = (value[k + 1] + self.moments.square * bend) as f32;
                group.cell[k][lane] = (self.cells_per_frequency * (ramp * value[k + 1] + rate)) as f32;
                group.bend[k][lane] = (TAU * self.moments.square * bend) as f32;
            }
            for k in 0..NUM_AMPLITUDES - 1 {
                group.basis[k][lane] = value[k + 1] as f32;
            }
        }
        group
    }
}

/// Chebyshev polynomials 0 to [`NUM_TURNS`] at x, and their first and second derivatives.
fn polynomials(x: f64) -> [[f64; NUM_TURNS + 1]; 3] {
    let mut t = [[0.0; NUM_TURNS + 1]; 3];
    (t[0][0], t[0][1], t[1][1]) = (1.0, x, 1.0);
    for k in 2..=NUM_TURNS {
        t[0][k] = 2.0 * x * t[0][k - 1] - t[0][k - 2];
        t[1][k] = 2.0 * (t[0][k - 1] + x * t[1][k - 1]) - t[1][k - 2];
        t[2][k] = 2.0 * (2.0 * t[1][k - 1] + x * t[2][k - 1]) - t[2][k - 2];
    }
    t
}
