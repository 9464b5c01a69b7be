//! Fast time u, the time from the middle sample of a chirp in units of the longest one, and what a path does within it.
//!
//! Delays and amplitudes are polynomials of u. Their values at the nodes of Gauss's quadrature tell the coefficients of
//! Legendre polynomials, normalised to a mean square of one: the first two are the tone nearest to the path.

use std::f64::consts::PI;

use super::number::{LaneRow, MAX_LANES, MAX_ORDERS, MAX_TURNS, Number};
use crate::numeric::fft;
use crate::numeric::legendre::{self, legendre};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::Block;

/// Nodes of fast time.
pub type Nodes = legendre::Nodes<MAX_ORDERS>;

/// Chirps of a block at which orders of fast time are measured, its ends among them: Chebyshev polynomials change most
/// there.
const NUM_CHIRPS: usize = 5;

/// Constants of a frame: the same for all paths and channels.
#[derive(Clone, Debug)]
pub struct FastTime<'a> {
    /// Times and frequencies.
    pub waveform: &'a Waveform,
    /// Number of cells of the grid, a power of two, at least twice the number of samples.
    pub num_cells: usize,
    /// Frequency at the middle sample [Hz].
    pub carrier: f64,
    /// Change of the frequency from the middle sample to the farthest one, relative to the carrier.
    pub ratio: f64,
    /// Cells per turn of phase from the middle sample to the farthest one.
    pub cells_per_turn: f64,
    /// Turns of phase per squared turn of the delay at the carrier, to be subtracted: half the slope times the squared
    /// delay.
    pub per_square: f64,
}

impl<'a> FastTime<'a> {
    /// Constants of a frame.
    pub fn new(waveform: &'a Waveform) -> Self {
        let half = waveform.half_sweep();
        let num_cells = fft::num_cells(waveform.num_samples);
        let carrier = waveform.start_frequency + waveform.slope * waveform.middle_time();
        Self {
            waveform,
            num_cells,
            carrier,
            ratio: waveform.slope * half / carrier,
            cells_per_turn: num_cells as f64 / waveform.sample_rate / half,
            per_square: 0.5 * waveform.slope / carrier.powi(2),
        }
    }

    /// Legendre polynomials of degrees 0, 1, ... at every sample.
    pub fn polynomials(&self) -> impl Iterator<Item = [f64; MAX_ORDERS]> {
        let num_samples = self.waveform.num_samples;
        let longest = self.waveform.half_sweep() * self.waveform.sample_rate;
        (0..num_samples).map(move |sample| legendre((sample as f64 - (num_samples / 2) as f64) / longest))
    }

    /// Root mean squares of the Legendre polynomials over the samples.
    pub fn sizes(&self) -> [f64; MAX_ORDERS] {
        let mut squares = [0.0; MAX_ORDERS];
        for values in self.polynomials() {
            for n in 0..MAX_ORDERS {
                squares[n] += values[n] * values[n] / self.waveform.num_samples as f64;
            }
        }
        squares.map(f64::sqrt)
    }

    /// The first Chebyshev polynomials (degree, node) of the time of a block at the nodes of a chirp.
    fn chebyshev(
        &self,
        block: &Block,
        chirp: usize,
        number: usize,
        nodes: &Nodes,
    ) -> [[f64; MAX_ORDERS]; MAX_TURNS + 1] {
        let middle = self.waveform.chirp_times[chirp] + self.waveform.middle_time();
        let mut values = [[0.0; MAX_ORDERS]; MAX_TURNS + 1];
        for (j, u) in nodes.places.iter().enumerate() {
            let x = block.x(middle + u * self.waveform.half_sweep());
            (values[0][j], values[1][j]) = (1.0, x);
            for k in 2..number {
                values[k][j] = 2.0 * x * values[k - 1][j] - values[k - 2][j];
            }
        }
        values
    }

    /// Tables of the chirps from number `first` on for series of some numbers of coefficients over a block.
    pub fn tables<T: Number>(
        &self,
        block: &Block,
        first: usize,
        counts: [usize; 2],
        (nodes, degrees): (&Nodes, &[usize]),
    ) -> LaneTables<T> {
        let none = [T::zero(); MAX_LANES];
        let [num_turns, num_amplitudes] = counts;
        let num_nodes = nodes.places.len();
        let mut tables = LaneTables {
            turns: vec![none; 2 * num_turns],
            tones: vec![none; 2 * num_turns],
            orders: vec![
                OrderTables {
                    phase: vec![none; num_turns],
                    amplitude: vec![none; num_amplitudes],
                };
                degrees.len()
            ],
            node_turns: vec![none; num_nodes * num_turns],
            node_amplitude: vec![none; num_nodes * num_amplitudes],
        };
        for lane in 0..T::LANES {
            let chirp = (first + lane).min(block.chirps.end - 1);
            let values = self.chebyshev(block, chirp, num_amplitudes.max(num_turns + 1), nodes);
            for k in 0..num_turns {
                // Frequency and delay change together. The slope of the phase has two parts: by the delay, and Doppler.
                let values = &values[k + 1];
                let [phase, slope] =
                    [0, 1].map(|n| nodes.coefficient(n, |j| (1.0 + self.ratio * nodes.places[j]) * values[j]));
                let doppler = 3.0_f64.sqrt() * slope - self.ratio * phase;
                tables.turns[2 * k][lane] = T::of(phase);
                tables.turns[2 * k + 1][lane] = T::of(doppler);
                tables.tones[2 * k][lane] = T::of(phase);
                tables.tones[2 * k + 1][lane] = T::of(self.cells_per_turn * (doppler + self.ratio * phase));
                for (tables, degree) in tables.orders.iter_mut().zip(degrees).filter(|(_, degree)| **degree > 1) {
                    let turns = nodes.coefficient(*degree, |j| (1.0 + self.ratio * nodes.places[j]) * values[j]);
                    tables.phase[k][lane] = T::of(2.0 * PI * turns);
                }
                for (j, u) in nodes.places.iter().enumerate() {
                    tables.node_turns[k * num_nodes + j][lane] = T::of(values[j] - phase - u * doppler);
                }
            }
            for k in 0..num_amplitudes {
                for (tables, degree) in tables.orders.iter_mut().zip(degrees) {
                    tables.amplitude[k][lane] = T::of(nodes.coefficient(*degree, |j| values[k][j]));
                }
                for j in 0..num_nodes {
                    tables.node_amplitude[k * num_nodes + j][lane] = T::of(values[k][j]);
                }
            }
        }
        tables
    }

    /// Orders of fast time of the first Chebyshev polynomials of a block.
    pub fn orders<T: Number>(&self, block: &Block, number: usize) -> Vec<Orders> {
        let nodes = Nodes::new(T::DEGREE + 3);
        let mut orders = vec![Orders::default(); number];
        let last = block.chirps.len() - 1;
        for at in 0..NUM_CHIRPS {
            let chirp = block.chirps.start + at * last / (NUM_CHIRPS - 1);
            let values = self.chebyshev(block, chirp, number, &nodes);
            for (values, orders) in values.iter().zip(&mut orders) {
                let phase = |j: usize| (1.0 + self.ratio * nodes.places[j]) * values[j];
                for n in 1..=T::DEGREE + 2 {
                    let amplitude = nodes.coefficient(n, |j| values[j]);
                    let mut turns = nodes.coefficient(n, phase);
                    if n == 1 {
                        turns = amplitude - turns + self.ratio / 3.0_f64.sqrt() * nodes.coefficient(0, phase);
                    }
                    orders.phase[n] += (2.0 * PI * turns).powi(2) / NUM_CHIRPS as f64;
                    orders.amplitude[n] += amplitude.powi(2) / NUM_CHIRPS as f64;
                }
            }
        }
        for Orders { phase, amplitude } in &mut orders {
            (*phase, *amplitude) = (phase.map(f64::sqrt), amplitude.map(f64::sqrt));
        }
        orders
    }
}

/// Orders of fast time within a chirp of a Chebyshev polynomial: coefficients of Legendre polynomials, their rms over
/// chirps.
#[derive(Clone, Copy, Debug, Default)]
pub struct Orders {
    /// Phase but for the tone, of a delay of one turn [rad]. The first order comes from the delay, and counts by the
    /// offset of the received frequency from the carrier.
    pub phase: [f64; MAX_ORDERS],
    /// Amplitude.
    pub amplitude: [f64; MAX_ORDERS],
}

/// Tables of the chirps of all lanes; lanes beyond the last chirp repeat it.
#[derive(Clone, Debug)]
pub struct LaneTables<T> {
    /// Coefficients of the delay after the constant one: the phase of the tone [turns] and its Doppler of each.
    pub turns: Vec<LaneRow<T>>,
    /// Likewise, the phase of the tone [turns] and its place [cells], but for squares of delays.
    pub tones: Vec<LaneRow<T>>,
    /// By grid.
    pub orders: Vec<OrderTables<T>>,
    /// Delay but for the tone [turns], and amplitude, at all nodes by coefficient.
    pub node_turns: Vec<LaneRow<T>>,
    pub node_amplitude: Vec<LaneRow<T>>,
}

/// Tables of a Legendre polynomial of fast time by coefficient: phases beside the tone [rad], and amplitudes.
#[derive(Clone, Debug)]
pub struct OrderTables<T> {
    pub phase: Vec<LaneRow<T>>,
    pub amplitude: Vec<LaneRow<T>>,
}
