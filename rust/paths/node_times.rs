//! Node times of paths: numbers of Chebyshev times of a frame at which delays and amplitudes are evaluated, so that the
//! series through them meet a tolerance.

use std::f64::consts::TAU;

use crate::numeric::chebyshev::chebyshev_matrix;
use crate::synthesis::chunk::{CHUNK, Chunk, Lane};

/// Numbers of times to choose from. Amplitudes of surfaces that turn out of sight have a kink, where series converge
/// slowly: doubling the times helps little.
const COUNTS: [usize; 9] = [4, 6, 8, 12, 16, 24, 32, 48, 64];

/// Number of times above which the series of a kink no longer improves.
const ENOUGH_FOR_KINKS: usize = 16;

/// Numbers of times at which a chunk of paths is evaluated, to choose one of [`COUNTS`] up to that.
const PROBED_COUNTS: [usize; 4] = [8, 16, 32, 64];

/// Shares of the tolerance for the errors of phases and of amplitudes.
const SHARES: [f64; 2] = [0.1, 0.2];

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

impl Default for NodeTimes {
    fn default() -> Self {
        Self::ONCE
    }
}

impl NodeTimes {
    /// Node times of static paths: one each.
    pub const ONCE: Self = Self {
        delays: 1,
        amplitudes: 1,
        phase: 0.0,
        weight: 0.0,
    };

    /// The larger numbers of both.
    pub fn max(self, other: Self) -> Self {
        Self {
            delays: self.delays.max(other.delays),
            amplitudes: self.amplitudes.max(other.amplitudes),
            phase: self.phase.max(other.phase),
            weight: self.weight.max(other.weight),
        }
    }
}

/// Choose numbers of times for paths of some channels, up to a highest frequency [Hz].
///
/// `fill` gives a chunk of the paths with delays and amplitudes at a number of Chebyshev times of the frame.
pub fn choose(num_channels: usize, highest: f64, tolerance: f64, fill: impl Fn(usize) -> Chunk<f64>) -> NodeTimes {
    let goals = SHARES.map(|share| share * tolerance);
    let (mut last_weight, mut chosen) = (f64::INFINITY, NodeTimes::ONCE);
    for number in PROBED_COUNTS {
        let errors = series_errors(&fill(number), num_channels, number, highest);
        let [(delays, phase), (amplitudes, weight)] = [0, 1].map(|kind| first_within(&errors[kind], goals[kind]));
        chosen = NodeTimes {
            delays,
            amplitudes,
            phase,
            weight,
        };
        let is_kink = number >= ENOUGH_FOR_KINKS && weight > 0.05 * last_weight;
        if phase <= goals[0] && (weight <= goals[1] || is_kink) {
            break;
        }
        if number == PROBED_COUNTS[PROBED_COUNTS.len() - 1] && phase > goals[0] {
            // Rounding of large absolute times is the limit: fewer times do as well.
            let least = errors[0].iter().copied().fold(f64::INFINITY, f64::min);
            (chosen.delays, chosen.phase) = first_within(&errors[0], 2.0 * least);
        }
        last_weight = weight;
    }
    chosen
}

/// The smallest of [`COUNTS`] whose error is within a goal, or the last with an error.
fn first_within(errors: &[f64], goal: f64) -> (usize, f64) {
    let at = errors.iter().position(|error| *error <= goal);
    let at = at.unwrap_or(errors.len() - 1);
    (COUNTS[at], errors[at])
}

/// Errors of phases and of amplitudes of the Chebyshev series of every one of [`COUNTS`] up to the number of rows of a
/// chunk: rms over the frame relative to l2(amplitudes), the worst channel's.
fn series_errors(chunk: &Chunk<f64>, num_channels: usize, number: usize, frequency: f64) -> [Vec<f64>; 2] {
    let counts = || COUNTS.into_iter().take_while(|count| *count <= number);
    let mut worst = [(); 2].map(|()| vec![0.0_f64; counts().count()]);
    let mut longest = 0.0_f64;
    for channel in 0..num_channels {
        let rows = channel * number..(channel + 1) * number;
        let (delay, re, im) = (&chunk.delay[rows.clone()], &chunk.re[rows.clone()], &chunk.im[rows]);
        let mut power = [0.0_f64; CHUNK];
        for node in 0..number {
            for path in 0..CHUNK {
                let [re, im] = [re, im].map(|rows| rows[0][path] + if node > 0 { rows[node][path] } else { 0.0 });
                power[path] = power[path].max(re * re + im * im);
            }
        }
        let total = power.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let of_delays = squares(delay, &power.map(|power| power * (TAU * frequency).powi(2)));
        let [of_re, of_im] = [re, im].map(|part| squares(part, &[1.0; CHUNK]));
        let of_amplitudes = of_re.iter().zip(of_im).map(|(re, im)| re + im).collect();
        for (worst, squares) in worst.iter_mut().zip([of_delays, of_amplitudes]) {
            for (worst, count) in worst.iter_mut().zip(counts()) {
                *worst = worst.max((left_out(&squares, count) / total).sqrt());
            }
        }
        longest = delay[0].iter().copied().fold(longest, f64::max);
    }
    // Rounding of delays is no error of a series: more times do not help.
    let rounding = ROUNDING * TAU * frequency * longest;
    for phase in worst[0].iter_mut().filter(|phase| **phase <= rounding) {
        *phase = 0.0;
    }
    worst
}

/// Sums over paths of the squares of the coefficients of their series, times weights, by degree; rows after the
/// first are differences from it, and the mean is not added back.
fn squares(rows: &[Lane<f64>], weights: &Lane<f64>) -> Vec<f64> {
    let matrix = chebyshev_matrix(rows.len());
    let of_degree = |factors: &[f64]| {
        let mut coefficients = [0.0; CHUNK];
        for (row, factor) in rows.iter().zip(factors).skip(1) {
            for path in 0..CHUNK {
                coefficients[path] += factor * row[path];
            }
        }
        let terms = coefficients.iter().zip(weights);
        terms
            .map(|(coefficient, weight)| weight * coefficient * coefficient)
            .sum()
    };
    matrix.chunks(rows.len()).map(of_degree).collect()
}

/// Square of the error of a series of `count` terms, for squared coefficients of a series through at least `count`
/// values. It is twice the l2 norm of the truncated coefficients, as a series through so many values folds them back.
/// For the whole series it extrapolates four times the larger of the last two coefficients, if further ones fall half
/// as fast.
fn left_out(squares: &[f64], count: usize) -> f64 {
    let number = squares.len();
    if count < number {
        return 4.0 * squares[count..].iter().sum::<f64>();
    }
    let last = squares[number - 2].max(squares[number - 1]);
    let before = squares[number - 4].max(squares[number - 3]);
    if last == 0.0 {
        0.0
    } else {
        16.0 * last * (4.0 * last / before).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::chebyshev::chebyshev_nodes;
    use crate::paths::evaluate::finish;
    use crate::synthesis::delay::Basis;
    use crate::synthesis::source::Shape;

    const FREQUENCY: f64 = 60e9;

    /// Two paths of one channel with a delay and an amplitude that are functions of x.
    fn choice(tolerance: f64, delay: impl Fn(f64) -> f64, amplitude: impl Fn(f64) -> f64) -> NodeTimes {
        choose(1, FREQUENCY, tolerance, |number| {
            let shape = Shape {
                channels: 1,
                paths: 2,
                delay_rows: number,
                amplitude_rows: number,
                basis: Basis::Chebyshev,
            };
            let mut chunk = Chunk::new(&shape, 1);
            chunk.num_paths = 2;
            for (node, x) in chebyshev_nodes(number).into_iter().enumerate() {
                chunk.delay[node][..2].fill(1e-8 + delay(x));
                chunk.re[node][..2].fill(amplitude(x));
            }
            finish(&mut chunk, [number; 2], 1);
            chunk
        })
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
        assert!(kink.weight > 1e-4);
    }

    #[test]
    fn noise_of_delays_takes_no_more_times_than_help() {
        let noise = |x: f64| 1e-12 * (1e5 * x).sin();
        let chosen = choice(1e-6, noise, |_| 1.0);
        assert!(chosen.phase > 1e-7 && chosen.delays <= 64);
    }
}
