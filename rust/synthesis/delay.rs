//! Delays and amplitudes over a frame: value, rate and acceleration, or values at Chebyshev times.

use num_complex::Complex64;

use crate::error::{Error, Result};
use crate::synthesis::chirp::Waveform;

/// Most values per path: the matrix from values to coefficients has the square of that.
const MAX_NODES: usize = 4096;

/// Basis of a series: the meaning of the first axis of [`PathSeries`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// Value, rate [1/s] and acceleration [1/s^2] at the start of the frame: `1, T, T^2/2`.
    Taylor,
    /// Values at the Chebyshev times of the first kind on `[0, duration]`, increasing.
    Chebyshev,
}

/// Delays [s] and amplitudes [sqrt(W)] of all paths of all channels; row-major.
#[derive(Clone, Copy, Debug)]
pub struct PathSeries<'a> {
    /// Meaning of the first axis of `delay`.
    pub basis: Basis,
    /// One row `(num_channels, num_paths)` per term [s].
    pub delay: &'a [&'a [f64]],
    /// One row `(num_channels, num_paths)`: constant; or values at their own Chebyshev times together with such delays.
    pub amplitude: &'a [&'a [Complex64]],
    /// Number of channels.
    pub num_channels: usize,
    /// Paths per channel.
    pub num_paths: usize,
}

impl PathSeries<'_> {
    /// Refuse shapes that do not agree.
    pub fn check_shapes(&self) -> Result<()> {
        let plane = self.num_channels * self.num_paths;
        let lengths = self.delay.iter().map(|row| ("delay", row.len()));
        for (name, length) in lengths.chain(self.amplitude.iter().map(|row| ("amplitude", row.len()))) {
            if length != plane {
                let expected = format!("{} x {} numbers", self.num_channels, self.num_paths);
                return Err(Error::value(name, expected, length));
            }
        }
        let nodes = (MAX_NODES, format!("1 to {MAX_NODES} nodes"));
        let limits = match self.basis {
            Basis::Taylor => [(3, "1 to 3 terms".to_owned()), (1, "one amplitude per path".to_owned())],
            Basis::Chebyshev => [nodes.clone(), nodes],
        };
        let numbers = [("delay", self.delay.len()), ("amplitude", self.amplitude.len())];
        for ((name, number), (most, expected)) in numbers.into_iter().zip(limits) {
            if number == 0 || number > most {
                return Err(Error::value(name, expected, number));
            }
        }
        Ok(())
    }

    /// Refuse numbers that are not finite.
    pub fn check_numbers(&self) -> Result<()> {
        let plane = self.num_channels * self.num_paths;
        for (j, row) in self.delay.iter().enumerate() {
            if let Some(bad) = row.iter().position(|x| !x.is_finite()) {
                let (name, index) = match self.basis {
                    Basis::Taylor => (["delay", "delay_rate", "delay_acceleration"][j], bad),
                    Basis::Chebyshev => ("delay", j * plane + bad),
                };
                let got = format!("{} at flat index {index}", row[bad]);
                return Err(Error::value(name, "finite numbers", got));
            }
        }
        for (j, row) in self.amplitude.iter().enumerate() {
            if let Some(bad) = row.iter().position(|a| !a.is_finite()) {
                let got = format!("{} at flat index {}", row[bad], j * plane + bad);
                return Err(Error::value("amplitude", "finite numbers", got));
            }
        }
        Ok(())
    }
}

/// Values of the basis functions at time `t` [s] after the start of the frame, `terms` of them into `out`.
pub fn basis_values(basis: Basis, waveform: &Waveform, t: f64, out: &mut [f64]) {
    let duration = waveform.duration();
    // One sample of one chirp at time zero: every node is that time.
    let x = if duration > 0.0 { 2.0 * t / duration - 1.0 } else { 0.0 };
    for k in 0..out.len() {
        out[k] = match (basis, k) {
            (_, 0) => 1.0,
            (Basis::Taylor, 1) => t,
            (Basis::Taylor, _) => 0.5 * t * t,
            (Basis::Chebyshev, 1) => x,
            (Basis::Chebyshev, _) => 2.0 * x * out[k - 1] - out[k - 2],
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::chebyshev::{chebyshev_matrix, chebyshev_nodes};
    use crate::synthesis::tests::waveform;

    #[test]
    fn polynomial_through_chebyshev_times_is_recovered_everywhere() {
        let wf = waveform(8, 64, 1e9);
        let f = |t: f64| 1.0 + 3.0e3 * t - 2.0e6 * t * t + 1.0e9 * t.powi(3) - 4.0e11 * t.powi(4);
        let times = chebyshev_nodes(5).into_iter().map(|x| 0.5 * wf.duration() * (1.0 + x));
        let values: Vec<f64> = times.map(f).collect();
        for t in [0.0, 1e-4, 3.3e-4, wf.duration()] {
            let mut functions = [0.0; 5];
            basis_values(Basis::Chebyshev, &wf, t, &mut functions);
            let coefficient = |weights: &[f64]| weights.iter().zip(&values).map(|(a, b)| a * b).sum::<f64>();
            let coefficients = chebyshev_matrix(5);
            let terms = coefficients.chunks(5).map(coefficient).zip(functions);
            let got: f64 = terms.map(|(a, b)| a * b).sum();
            assert!((got / f(t) - 1.0).abs() < 1e-13, "{got} {}", f(t));
        }
    }
}
