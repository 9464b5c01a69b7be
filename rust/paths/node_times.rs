//! Node times of paths: numbers of Chebyshev times of a frame at which delays and amplitudes are evaluated, so that the
//! series through them meet a tolerance.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::error::Result;
use crate::numeric::chebyshev::chebyshev_matrix;
use crate::paths::series::{Paths, Selection};

/// Numbers of times to choose from. Amplitudes of surfaces that turn out of sight have a kink, where series converge
/// slowly: twice as many times help little.
const COUNTS: [usize; 9] = [4, 6, 8, 12, 16, 24, 32, 48, 64];

/// Number of times beyond which the series of a kink no longer improves.
const ENOUGH_FOR_KINKS: usize = 16;

/// Numbers of times at which a sample of paths is evaluated, to choose one of [`COUNTS`] up to that.
const PROBED_COUNTS: [usize; 4] = [8, 16, 32, 64];

/// Number of sampled paths.
const NUM_PROBES: usize = 512;

/// Share of the tolerance for the error of the series.
const SHARE: f64 = 0.1;

/// Relative error of delays by rounding.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Numbers of times, and the errors of the series through them: rms over the frame, relative to l2(amplitudes).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeTimes {
    /// Number of times at which delays are evaluated.
    pub delays: usize,
    /// Number of times at which amplitudes are evaluated.
    pub amplitudes: usize,
    /// Error of phases [rad].
    pub phase: f64,
    /// Error of amplitudes.
    pub weight: f64,
}

impl NodeTimes {
    /// Node times of static paths: one each.
    pub const ONCE: Self = Self {
        delays: 1,
        amplitudes: 1,
        phase: 0.0,
        weight: 0.0,
    };

    /// Sum of both errors.
    pub fn residual(&self) -> f64 {
        self.phase.hypot(self.weight)
    }
}

/// Choose numbers of times for paths up to a highest frequency [Hz].
///
/// `take` gives the selected paths with delays and amplitudes at a number of Chebyshev times of the frame.
pub fn choose(
    num_paths: usize,
    num_channels: usize,
    highest: f64,
    tolerance: f64,
    take: impl Fn(usize, Selection) -> Result<Paths>,
) -> Result<NodeTimes> {
    let probes = Selection {
        first: 0,
        last: num_paths,
        step: (num_paths / NUM_PROBES).max(1),
    };
    let goal = SHARE * tolerance;
    let (mut last_weight, mut chosen) = (f64::INFINITY, NodeTimes::ONCE);
    for probed in PROBED_COUNTS {
        let counts: Vec<usize> = COUNTS.into_iter().filter(|count| *count <= probed).collect();
        let errors = SeriesErrors::of(
            &take(probed, probes)?,
            [probed, num_channels, probes.len()],
            highest,
            &counts,
        );
        let [(delays, phase), (amplitudes, weight)] =
            [&errors.phase, &errors.weight].map(|errors| first_within(&counts, errors, goal));
        chosen = NodeTimes {
            delays,
            amplitudes,
            phase,
            weight,
        };
        let is_kink = probed >= ENOUGH_FOR_KINKS && weight > 0.05 * last_weight;
        if phase <= goal && (weight <= goal || is_kink) {
            return Ok(chosen);
        }
        if probed == PROBED_COUNTS[PROBED_COUNTS.len() - 1] && phase > goal {
            // Rounding of large absolute times is the limit: fewer times do as well.
            let least = errors.phase.iter().copied().fold(f64::INFINITY, f64::min);
            (chosen.delays, chosen.phase) = first_within(&counts, &errors.phase, 2.0 * least);
        }
        last_weight = weight;
    }
    Ok(chosen)
}

/// The smallest number of times whose error is within a goal, or the largest.
fn first_within(counts: &[usize], errors: &[f64], goal: f64) -> (usize, f64) {
    let mut pairs = counts.iter().copied().zip(errors.iter().copied());
    let last = (counts[counts.len() - 1], errors[errors.len() - 1]);
    pairs.find(|(_, error)| *error <= goal).unwrap_or(last)
}

/// Errors of the Chebyshev series of some lengths through the paths: rms over the frame relative to l2(amplitudes), the
/// worst channel's. They are twice the l2 norm of the coefficients beyond a length, as a series through so many times
/// folds them back; for the last length, that of the whole series, four times the larger of the last two coefficients.
struct SeriesErrors {
    phase: Vec<f64>,
    weight: Vec<f64>,
}

impl SeriesErrors {
    /// `shape`: numbers of nodes, channels and paths.
    fn of(paths: &Paths, shape: [usize; 3], frequency: f64, counts: &[usize]) -> Self {
        let [num_nodes, num_channels, num_paths] = shape;
        let matrix = chebyshev_matrix(num_nodes);
        let (mut phase, mut weight) = (vec![0.0_f64; counts.len()], vec![0.0_f64; counts.len()]);
        let mut values = vec![0.0; num_nodes];
        let mut squares = vec![0.0; num_nodes];
        for channel in 0..num_channels {
            let at = |node: usize, path: usize| (node * num_channels + channel) * num_paths + path;
            let (mut of_phases, mut of_weights) = (vec![0.0; counts.len()], vec![0.0; counts.len()]);
            let mut total = 0.0;
            for path in 0..num_paths {
                let amplitude = |node: usize| paths.amplitude[at(node, path)];
                let power = (0..num_nodes)
                    .map(|node| amplitude(node).norm_sqr())
                    .fold(0.0, f64::max);
                total += power;
                // Relative to the first delay: the rounding of large delays is no part of the phases.
                let first = paths.delay[at(0, path)];
                for (node, value) in values.iter_mut().enumerate() {
                    *value = paths.delay[at(node, path)] - first;
                }
                square_coefficients(&matrix, &values, &mut squares);
                add_left_out(&squares, counts, (TAU * frequency).powi(2) * power, &mut of_phases);
                let parts: [fn(Complex64) -> f64; 2] = [|a| a.re, |a| a.im];
                for part in parts {
                    for (node, value) in values.iter_mut().enumerate() {
                        *value = part(amplitude(node));
                    }
                    square_coefficients(&matrix, &values, &mut squares);
                    add_left_out(&squares, counts, 1.0, &mut of_weights);
                }
            }
            let total = total.sqrt().max(f64::MIN_POSITIVE);
            for (worst, sums) in [(&mut phase, of_phases), (&mut weight, of_weights)] {
                for (worst, sum) in worst.iter_mut().zip(sums) {
                    *worst = worst.max(f64::sqrt(sum) / total);
                }
            }
        }
        // Rounding of delays is no error of a series: more times do not help.
        let longest = paths.delay.iter().copied().fold(0.0, f64::max);
        let rounding = ROUNDING * TAU * frequency * longest;
        for phase in phase.iter_mut().filter(|phase| **phase <= rounding) {
            *phase = 0.0;
        }
        Self { phase, weight }
    }
}

/// Squares of the Chebyshev coefficients of the series through values.
fn square_coefficients(matrix: &[f64], values: &[f64], squares: &mut [f64]) {
    for (row, square) in matrix.chunks(values.len()).zip(squares) {
        let coefficient: f64 = row.iter().zip(values).map(|(a, b)| a * b).sum();
        *square = coefficient * coefficient;
    }
}

/// Add the squares of the coefficients beyond series of `counts` terms, times a weight.
fn add_left_out(squares: &[f64], counts: &[usize], weight: f64, sums: &mut [f64]) {
    let number = squares.len();
    for (count, sum) in counts.iter().zip(sums) {
        *sum += weight
            * if *count < number {
                4.0 * squares[*count..].iter().sum::<f64>()
            } else {
                16.0 * squares[number - 2].max(squares[number - 1])
            };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::chebyshev::chebyshev_nodes;

    const FREQUENCY: f64 = 60e9;

    /// Two paths of one channel with a delay and an amplitude that are functions of x.
    fn choice(tolerance: f64, delay: impl Fn(f64) -> f64, amplitude: impl Fn(f64) -> f64) -> NodeTimes {
        choose(2, 1, FREQUENCY, tolerance, |number, selection| {
            Paths::of([number; 2], 1, selection, |_, _, _| 0.0, |_, _, _| Complex64::ZERO).map(|mut paths| {
                for (node, x) in chebyshev_nodes(number).into_iter().enumerate() {
                    for path in 0..2 {
                        paths.delay[2 * node + path] = 1e-8 + delay(x);
                        paths.amplitude[2 * node + path] = Complex64::from(amplitude(x));
                    }
                }
                paths
            })
        })
        .unwrap()
    }

    #[test]
    fn steady_motion_takes_few_times_and_quick_turns_more() {
        let steady = choice(1e-4, |x| 1e-10 * x, |_| 1.0);
        assert_eq!((steady.delays, steady.amplitudes), (4, 4));
        // cos(3 x): coefficients 2 J_k(3), times 2 pi f 1e-11 s = 3.8 rad; J_12(3) is 2e-7, J_10(3) 1e-5.
        let turning = choice(1e-4, |x| 1e-11 * (3.0 * x).cos(), |_| 1.0);
        assert_eq!(turning.delays, 12);
        assert!(turning.phase <= 1e-5);
    }

    #[test]
    fn kinks_of_amplitudes_end_the_search() {
        let kink = choice(1e-6, |x| 1e-10 * x, f64::abs);
        assert!(kink.amplitudes <= 32, "{kink:?}");
        assert!(kink.weight > 1e-4 && kink.residual() >= kink.weight);
    }

    #[test]
    fn noise_of_delays_takes_no_more_times_than_help() {
        let noise = |x: f64| 1e-12 * (1e5 * x).sin();
        let chosen = choice(1e-6, noise, |_| 1.0);
        assert!(chosen.phase > 1e-7 && chosen.delays <= 64);
    }
}
