//! How the phase of moving paths is expanded about the centre of a block of chirps.
//!
//! With the delay `tau = c_0 + sum_k c_k T_k(x)`, the phase of eq. (1) is exactly
//!
//! ```text
//! A + X t' + b xi(c, m) + sum_i e_i B_i(c, m)        t' = t - t_0,  xi = (f_c + S t') T'_c + S t'^2
//! ```
//!
//! in turns: a constant A, a beat frequency X, a rate b whose "keystone" frequency xi is the same for every path, and
//! the further terms e_i B_i of motion that is not uniform ([`Factor`]). X and b are the two axes of the grid; xi carries
//! range migration and Doppler within a chirp through the transform. What is left, `exp(2 pi j e B)`, is expanded with
//! Bessel functions of B and Chebyshev polynomials of e (Jacobi-Anger): every [`Term`] is one more set of strengths.

use crate::block::Block;
use crate::chirp::Waveform;

/// What kind of motion a factor follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorKind {
    /// Degree k of the delay: `B = (f_c + S t') T_k(x)`.
    Phase(usize),
    /// What the sweep adds to degree k: `B = (t'/t_h) T_k(x)`, t_h half of the sampled sweep.
    Sweep(usize),
}

/// A factor `exp(2 pi j e B(c, m))` of every path, `e` between `middle - half` and `middle + half`.
#[derive(Clone, Debug)]
pub struct Factor {
    /// Which e and B.
    pub kind: FactorKind,
    /// Middle of e: taken off all paths alike.
    pub middle: f64,
    /// Largest distance of e from its middle.
    pub half: f64,
    /// Largest order in any term.
    pub max_order: usize,
    /// False if what is off the middle is left out: every Bessel function of order 0 is taken as 1.
    pub is_expanded: bool,
}

/// One product of a degree of the amplitude and one order per factor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Term {
    /// Degree of the amplitude's series.
    pub amplitude: usize,
    /// Order of the Bessel function and Chebyshev polynomial of every factor.
    pub orders: Vec<usize>,
}

/// How the paths of a class are expanded in one block.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// The chirps.
    pub block: Block,
    /// f_c [Hz]: frequency of the middle sample, less the beat frequency of `middle_delay`.
    pub carrier: f64,
    /// Delay about which f_c is taken [s].
    pub middle_delay: f64,
    /// Rate at the centre of the velocity axis [s/s].
    pub middle_rate: f64,
    /// Distance of two velocity rows [s/s].
    pub step: f64,
    /// Velocity rows; 1 means that nothing moves and there is no velocity axis.
    pub rows: usize,
    /// Degrees of the delay's series that are followed, the constant included.
    pub num_degrees: usize,
    /// Degrees that count in the square of the delay's change.
    pub num_squared: usize,
    /// Further terms of the phase.
    pub factors: Vec<Factor>,
    /// Sets of strengths, each on its own grid.
    pub terms: Vec<Term>,
}

impl Term {
    /// False if its strengths are those of its amplitude.
    pub fn has_factors(&self) -> bool {
        self.orders.iter().any(|order| *order > 0)
    }
}

impl Expansion {
    /// Largest degree of the amplitude that any term needs, plus one.
    pub fn num_amplitudes(&self) -> usize {
        self.terms.iter().map(|term| term.amplitude).max().unwrap_or(0) + 1
    }

    /// Largest keystone frequency in the block [Hz s].
    pub fn max_keystone(waveform: &Waveform, block: &Block, carrier: f64) -> f64 {
        let (first, last) = (
            offset(waveform, block, 0),
            offset(waveform, block, block.chirps.len() - 1),
        );
        let slow = block
            .chirps
            .clone()
            .map(|c| (waveform.chirp_times[c] + waveform.middle_time() - block.center).abs())
            .fold(first.abs().max(last.abs()), f64::max);
        let fast = waveform.half_sweep();
        (carrier.abs() + waveform.slope.abs() * fast) * slow + waveform.slope.abs() * fast * fast
    }
}

/// Start of a chirp of a block, from the block's centre to the chirp's middle sample [s].
pub fn offset(waveform: &Waveform, block: &Block, chirp: usize) -> f64 {
    waveform.chirp_times[block.chirps.start + chirp] + waveform.middle_time() - block.center
}

/// Largest argument of a Bessel function: beyond it the terms are too many, and their series loses digits.
pub const MAX_BESSEL: f64 = 8.0;
