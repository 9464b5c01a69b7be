//! Tables of a frame: what multiplies the coefficients of paths in every chirp.

use std::f64::consts::TAU;

use super::number::{MAX_AMPLITUDES, MAX_LANES, MAX_TURNS, Number};
use crate::numeric::fft;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::Block;

/// One number per chirp of a group; lanes of fewer chirps use the first ones.
pub type Chirps<T> = [T; MAX_LANES];

/// Tables of the chirps of all lanes; lanes beyond the last chirp repeat it.
#[derive(Clone, Debug)]
pub struct GroupTables<T> {
    /// Phase per coefficient of the phase, with the mean of its curvature.
    pub phase: [Chirps<T>; MAX_TURNS],
    /// Place per coefficient of the phase [cells per turn], with the slope nearest to its third order.
    pub place: [Chirps<T>; MAX_TURNS],
    /// Second and third order of the phase over fast time per coefficient of the phase [rad per turn].
    pub curvature: [Chirps<T>; MAX_TURNS],
    pub third: [Chirps<T>; MAX_TURNS],
    /// Amplitude per coefficient after the first, with the mean of its curvature; and its orders 1 to 3 of fast
    /// time.
    pub amplitude: [Chirps<T>; MAX_AMPLITUDES],
    pub slope: [Chirps<T>; MAX_AMPLITUDES],
    pub bend: [Chirps<T>; MAX_AMPLITUDES],
    pub cube: [Chirps<T>; MAX_AMPLITUDES],
}

/// Means over the samples of a chirp of fast time u, the time from the middle sample in units of the longest one.
#[derive(Clone, Debug)]
pub struct Moments {
    /// Mean of u^2.
    pub square: f64,
    /// Slope of the line nearest to u^3.
    pub cube_slope: f64,
    /// Root mean square of u^3 less that line.
    pub cube: f64,
    /// Root mean squares of v^n and of u v^n, v = u^2 less its mean.
    pub even: Vec<f64>,
    pub odd: Vec<f64>,
}

impl Moments {
    fn new(times: &[f64]) -> Self {
        let mean = |f: &dyn Fn(f64) -> f64| times.iter().map(|u| f(*u)).sum::<f64>() / times.len() as f64;
        let square = mean(&|u| u * u);
        let cube_slope = mean(&|u| u.powi(4)) / square.max(f64::MIN_POSITIVE);
        let powers = 0..7;
        Self {
            square,
            cube_slope,
            cube: mean(&|u| (u.powi(3) - cube_slope * u).powi(2)).sqrt(),
            even: powers
                .clone()
                .map(|n| mean(&|u| (u * u - square).powi(2 * n)).sqrt())
                .collect(),
            odd: powers
                .map(|n| mean(&|u| (u * (u * u - square).powi(n)).powi(2)).sqrt())
                .collect(),
        }
    }
}

/// Constants of a frame: the same for all paths and channels.
#[derive(Clone, Debug)]
pub struct Tables<'a> {
    /// Times and frequencies.
    pub waveform: &'a Waveform,
    /// Number of cells of the grid, a power of two, at least twice the number of samples.
    pub num_cells: usize,
    /// Frequency at the middle sample, which tables are made for [Hz].
    pub carrier: f64,
    /// Change of the frequency from the middle sample to the farthest one [Hz].
    pub sweep: f64,
    /// Cells per turn of phase from the middle sample to the farthest one.
    pub cells_per_turn: f64,
    /// Fast time u of every sample.
    pub times: Vec<f64>,
    /// Moments of the samples of a chirp.
    pub moments: Moments,
}

impl<'a> Tables<'a> {
    /// Tables of a frame.
    pub fn new(waveform: &'a Waveform) -> Self {
        let (num_samples, half) = (waveform.num_samples, waveform.half_sweep());
        let num_cells = fft::num_cells(num_samples);
        let time = |sample: usize| (sample as f64 - (num_samples / 2) as f64) / waveform.sample_rate / half;
        let times: Vec<f64> = (0..num_samples).map(time).collect();
        Self {
            waveform,
            num_cells,
            carrier: waveform.start_frequency + waveform.slope * waveform.middle_time(),
            sweep: waveform.slope * half,
            cells_per_turn: num_cells as f64 / waveform.sample_rate / half,
            moments: Moments::new(&times),
            times,
        }
    }

    /// Cells per delay [1/s].
    pub fn cells_per_delay(&self) -> f64 {
        self.cells_per_turn * self.sweep
    }

    /// Turns of phase from the middle sample to the farthest one per turn of phase at the carrier.
    pub fn ratio(&self) -> f64 {
        self.sweep / self.carrier
    }

    /// Tables of the chirps from number `first` on for series over a block.
    pub fn group<T: Number>(&self, block: &Block, first: usize) -> GroupTables<T> {
        let none = [T::zero(); MAX_LANES];
        let mut group = GroupTables {
            phase: [none; MAX_TURNS],
            place: [none; MAX_TURNS],
            curvature: [none; MAX_TURNS],
            third: [none; MAX_TURNS],
            amplitude: [none; MAX_AMPLITUDES],
            slope: [none; MAX_AMPLITUDES],
            bend: [none; MAX_AMPLITUDES],
            cube: [none; MAX_AMPLITUDES],
        };
        let (moments, ratio) = (&self.moments, self.ratio());
        let u = self.waveform.half_sweep() / block.half;
        for lane in 0..T::LANES {
            let chirp = (first + lane).min(block.chirps.end - 1);
            let x = block.x(self.waveform.chirp_times[chirp] + self.waveform.middle_time());
            let orders = taylor(x, u);
            for k in 0..T::NUM_TURNS {
                let [value, slope, second, third] = orders[k + 1];
                // Frequency and delay change together: the ramp adds one order of the delay.
                let (second, third) = (second + ratio * slope, third + ratio * second);
                group.phase[k][lane] = T::of(value + moments.square * second);
                let place = ratio * value + slope + moments.cube_slope * third;
                group.place[k][lane] = T::of(self.cells_per_turn * place);
                group.curvature[k][lane] = T::of(TAU * second);
                group.third[k][lane] = T::of(TAU * third);
            }
            for k in 1..T::NUM_AMPLITUDES {
                let [value, slope, second, third] = orders[k];
                group.amplitude[k][lane] = T::of(value + moments.square * second);
                group.slope[k][lane] = T::of(slope);
                group.bend[k][lane] = T::of(second);
                group.cube[k][lane] = T::of(third);
            }
        }
        group
    }
}

/// Taylor coefficients of orders 0 to 3 in u of Chebyshev polynomials at `x + step u`.
fn taylor(x: f64, step: f64) -> [[f64; 4]; MAX_TURNS + 1] {
    let mut t = [[0.0; 4]; MAX_TURNS + 1];
    (t[0], t[1]) = ([1.0, 0.0, 0.0, 0.0], [x, step, 0.0, 0.0]);
    for k in 2..=MAX_TURNS {
        for order in 0..4 {
            let before = if order > 0 { step * t[k - 1][order - 1] } else { 0.0 };
            t[k][order] = 2.0 * (x * t[k - 1][order] + before) - t[k - 2][order];
        }
    }
    t
}
