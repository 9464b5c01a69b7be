//! Residual phase of a moving path: its phase less that of its plane wave on the range-velocity grid.
//!
//! With the delay `tau = c_0 + c_1 x + D(x)`, `D = sum_(k>=2) c_k T_k(x)`, the phase of docs/theory.md eq. (1) is
//! exactly
//!
//! ```text
//! A + X t' + b xi(c, m) + R        t' = t - t_0,  xi = (f_c + S t') T'_c + S t'^2,  x = (T'_c + t') / half
//! X = S c_0 + b f_c                b = c_1 (1 - u / f_c) / half,  u = S (c_0 - middle delay)
//! R = (f_c + S t' - u) D + (S t' / f_c) u c_1 x - S (c_1 x + D)^2 / 2
//! ```
//!
//! in turns: a constant A, a beat frequency X and a rate b whose "keystone" frequency xi is the same for every path. X
//! and b are the axes of the grid; xi carries range migration and Doppler within a chirp through the transform. R is
//! all else: motion that is not uniform, and small products of the sweep. The residual of a path is `conj(a(x)) exp(2
//! pi j R)`.

use crate::numeric::simd::Vector;
use crate::synthesis::block::Block;
use crate::synthesis::delay::{Basis, PathSeries};

/// Constants of the plane waves in a block of chirps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Carrier f_c [Hz]: frequency of the middle sample, less the beat frequency of `middle_delay`.
    pub carrier: f64,
    /// Delay about which f_c is taken [s].
    pub middle_delay: f64,
    /// Slope over carrier, S / f_c [1/s].
    pub stretch: f64,
    /// Factor of the squared delay, S / (2 f_c^2) [turns per squared turn].
    pub bend: f64,
}

impl Frame {
    /// Constants for a carrier [Hz], a delay [s] and a slope S [Hz/s].
    pub fn new(carrier: f64, middle_delay: f64, slope: f64) -> Self {
        Self {
            carrier,
            middle_delay,
            stretch: slope / carrier,
            bend: 0.5 * slope / carrier / carrier,
        }
    }
}

/// Instant of a residual: slow time and fast time in a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Time in the block, -1 to 1.
    pub x: f64,
    /// Relative sweep within the chirp, S t' / f_c.
    pub sweep: f64,
}

/// Path in a block: coefficients of the delay in turns at the carrier, and of the amplitude [sqrt(W)].
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Beat frequency from that of the middle delay, relative to the carrier: u / f_c.
    pub offset: f64,
    /// Coefficient of degree 1 of the delay, f_c c_1 [turns].
    pub rate: f64,
    num_bends: usize,
    /// Bends, real and imaginary parts of the amplitude's coefficients: one allocation for each of hundreds of paths is
    /// faster than three.
    numbers: Vec<f64>,
}

impl Path {
    /// Path of an offset, a rate, bends, and the real and imaginary parts of the amplitude, equal in number.
    pub fn new(place: [f64; 2], bends: impl Iterator<Item = f64>, parts: [impl Iterator<Item = f64>; 2]) -> Self {
        let mut path = Self::default();
        path.set(place, bends, parts);
        path
    }

    /// Replace the path in the same memory, see [`Self::new`].
    pub fn set(
        &mut self,
        [offset, rate]: [f64; 2],
        bends: impl Iterator<Item = f64>,
        parts: [impl Iterator<Item = f64>; 2],
    ) {
        (self.offset, self.rate) = (offset, rate);
        self.numbers.clear();
        self.numbers.extend(bends);
        self.num_bends = self.numbers.len();
        for part in parts {
            self.numbers.extend(part);
        }
    }

    /// Coefficients of degrees k = 2, 3, ... of the delay, f_c c_k [turns].
    pub fn bends(&self) -> &[f64] {
        &self.numbers[..self.num_bends]
    }

    /// Number of coefficients of the amplitude.
    pub fn num_amplitudes(&self) -> usize {
        (self.numbers.len() - self.num_bends) / 2
    }

    /// Real parts of the amplitude's coefficients.
    pub fn re(&self) -> &[f64] {
        &self.numbers[self.num_bends..][..self.num_amplitudes()]
    }

    /// Imaginary parts of the amplitude's coefficients.
    pub fn im(&self) -> &[f64] {
        &self.numbers[self.num_bends + self.num_amplitudes()..]
    }

    /// Residual phase R at an instant [turns].
    pub fn turns(&self, frame: &Frame, instant: &Instant) -> f64 {
        let (mut before, mut current, mut delta) = (1.0, instant.x, 0.0);
        for bend in self.bends() {
            (before, current) = (current, 2.0 * instant.x * current - before);
            delta += bend * current;
        }
        let moved = self.rate * instant.x + delta;
        delta * (1.0 + instant.sweep - self.offset) + instant.x * instant.sweep * self.offset * self.rate
            - frame.bend * moved * moved
    }
}

/// Sampled path: its numbers in the rows of a series; where rows are values, rows after the first are differences from
/// it.
#[derive(Clone, Debug)]
pub struct Sample {
    num_delays: usize,
    /// Rows of the delay, of the real and of the imaginary part of the amplitude: one allocation for each of hundreds
    /// of samples is faster than three.
    numbers: Vec<f64>,
}

impl Sample {
    /// Sample of the path `index`, counted over all channels.
    pub fn new(series: &PathSeries, index: usize) -> Self {
        let first = series.amplitude[0][index];
        let change = |j: usize| {
            if j == 0 {
                first
            } else {
                series.amplitude[j][index] - first
            }
        };
        let base = if series.basis == Basis::Chebyshev {
            series.delay[0][index]
        } else {
            0.0
        };
        let (num_delays, num_amplitudes) = (series.num_delay_terms(), series.num_amplitude_terms());
        let mut numbers = Vec::with_capacity(num_delays + 2 * num_amplitudes);
        for (j, row) in series.delay.iter().enumerate() {
            numbers.push(if j == 0 { row[index] } else { row[index] - base });
        }
        numbers.extend((0..num_amplitudes).map(|j| change(j).re));
        numbers.extend((0..num_amplitudes).map(|j| change(j).im));
        Self { num_delays, numbers }
    }

    /// Coefficients of the delay in a block [s].
    pub fn delay<'a>(&'a self, block: &'a Block) -> impl Iterator<Item = f64> + 'a {
        series(&block.delay, &self.numbers[..self.num_delays])
    }

    /// Largest real or imaginary part of the first amplitude, and of the differences of the others from it.
    pub fn largest(&self) -> f64 {
        self.numbers[self.num_delays..]
            .iter()
            .fold(0.0, |largest, x| largest.max(x.abs()))
    }

    /// Multiply the amplitudes by a factor.
    pub fn weigh(&mut self, factor: f64) {
        for amplitude in &mut self.numbers[self.num_delays..] {
            *amplitude *= factor;
        }
    }

    /// True if delay and amplitude never change.
    pub fn is_still(&self) -> bool {
        let (delays, amplitudes) = self.numbers.split_at(self.num_delays);
        let is_constant = |rows: &[f64]| rows.iter().skip(1).all(|change| *change == 0.0);
        let (re, im) = amplitudes.split_at(amplitudes.len() / 2);
        is_constant(delays) && is_constant(re) && is_constant(im)
    }

    /// Real and imaginary parts of the coefficients of the amplitude in a block.
    fn amplitude<'a>(&'a self, block: &'a Block) -> [impl Iterator<Item = f64> + 'a; 2] {
        let numbers = &self.numbers[self.num_delays..];
        let (re, im) = numbers.split_at(numbers.len() / 2);
        [re, im].map(|rows| series(&block.amplitude, rows))
    }

    /// Squared magnitudes of the coefficients of the amplitude in a block [W].
    pub fn powers<'a>(&'a self, block: &'a Block) -> impl Iterator<Item = f64> + 'a {
        let [re, im] = self.amplitude(block);
        re.zip(im).map(|(re, im)| re * re + im * im)
    }

    /// Set `path` to the sample in a block.
    pub fn set_in_block(&self, block: &Block, frame: &Frame, path: &mut Path) {
        let mut delay = self.delay(block);
        let (offset, rate) = (delay.next().unwrap_or(0.0), delay.next().unwrap_or(0.0));
        path.set(
            [frame.stretch * (offset - frame.middle_delay), frame.carrier * rate],
            delay.map(|c| frame.carrier * c),
            self.amplitude(block),
        );
    }
}

/// Coefficients of a series from its rows.
fn series<'a>(matrix: &'a [Vec<f64>], rows: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    matrix.iter().enumerate().map(|(k, factors)| {
        let change: f64 = rows.iter().zip(factors).skip(1).map(|(row, f)| row * f).sum();
        if k == 0 { rows[0] + change } else { change }
    })
}

/// Residual phase R [turns]; `delta` is f_c D, the others are as in [`Path`], [`Instant`] and [`Frame`].
#[cfg_attr(optimised, inline(always))] // part of kernels, see simd.rs
pub fn turns<V: Vector>(delta: V, offset: V, rate: V, x: V, sweep: V, bend: V) -> V {
    let moved = rate.mul_add(x, delta);
    let sum = delta.mul_add(sweep.sub(offset), delta);
    let skew = x.mul(sweep).mul(offset);
    bend.mul(moved).neg_mul_add(moved, skew.mul_add(rate, sum))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::simd::{Isa, Kernel, Level};
    use crate::synthesis::chirp::Waveform;
    use num_complex::Complex64;

    struct Turns([f64; 6]);

    impl Kernel for Turns {
        type Output = f64;
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> f64 {
            let [delta, offset, rate, x, sweep, bend] = self.0;
            let splat = <I::F64 as Vector>::splat;
            let mut out = [0.0; 8];
            turns(
                splat(delta),
                splat(offset),
                splat(rate),
                splat(x),
                splat(sweep),
                splat(bend),
            )
            .store(&mut out);
            out[3]
        }
    }

    #[test]
    fn plane_wave_and_residual_are_the_phase() {
        let wf = Waveform {
            start_frequency: 58e9,
            slope: 2e13,
            sample_rate: 2e6,
            adc_delay: 3e-6,
            num_samples: 64,
            chirp_times: (0..20).map(|c| f64::from(c) * 3e-4).collect(),
        };
        // Value, rate and acceleration at the start.
        let (d, r, a) = ([2.0e-8], [3.3e-8], [6e-7]);
        let rows: [&[f64]; 3] = [&d, &r, &a];
        let series = PathSeries {
            basis: Basis::Taylor,
            delay: &rows,
            amplitude: &[&[Complex64::new(1.0, 2.0)]],
            num_channels: 1,
            num_paths: 1,
        };
        let block = Block::new(&wf, &series, 5..17);
        let middle_delay = 1.7e-8;
        let t0 = wf.middle_time();
        let frame = Frame::new(
            wf.start_frequency + wf.slope * (t0 - middle_delay),
            middle_delay,
            wf.slope,
        );
        let mut path = Path::default();
        Sample::new(&series, 0).set_in_block(&block, &frame, &mut path);
        assert_eq!((path.re()[0], path.im()[0]), (1.0, 2.0));

        let c_0 = path.offset / frame.stretch + middle_delay;
        let b = path.rate / frame.carrier * (1.0 - path.offset) / block.half;
        let constant = wf.start_frequency * c_0 + wf.slope * (c_0 * t0 - 0.5 * c_0 * c_0);
        let mut largest: f64 = 0.0;
        for chirp in [5, 9, 16] {
            for sample in [0, 20, 63] {
                let fast = wf.sample_time(sample);
                let time = wf.chirp_times[chirp] + fast;
                let tau = d[0] + r[0] * time + 0.5 * a[0] * time * time;
                let phase = tau * (wf.start_frequency + wf.slope * (fast - 0.5 * tau));
                let (fine, slow) = (fast - t0, time - block.center);
                let wave = (wf.slope * c_0 + b * frame.carrier) * fine
                    + b * ((frame.carrier + wf.slope * fine) * (slow - fine) + wf.slope * fine * fine);
                let x = block.x(time);
                let instant = [
                    path.bends()[0] * (2.0 * x * x - 1.0),
                    path.offset,
                    path.rate,
                    x,
                    frame.stretch * fine,
                    frame.bend,
                ];
                for level in Level::available() {
                    let rest = level.run(Turns(instant));
                    let scalar = path.turns(&frame, &Instant { x, sweep: instant[4] });
                    assert!((rest - scalar).abs() < 1e-14);
                    let error = constant + wave + rest - phase;
                    largest = largest.max(rest.abs());
                    assert!(error.abs() < 1e-11, "{error} of {phase}, residual {rest}");
                }
            }
        }
        assert!(largest > 0.01, "{largest}");
    }
}
