//! Which detections may belong to which tracks, and how likely; and the update of tracks by those that do.

use std::array::from_fn;

use super::kalman::{Innovation, update};
use super::matrix::{Matrix, sum};
use super::state_space::{Expected, expect};

/// When a detection may belong to a track.
pub struct Gate {
    /// Periods of range, velocity, azimuth and elevation; of those without, more than any value.
    pub periods: [f64; 4],
    /// Largest squared Mahalanobis distances of 0 to 4 measured values.
    pub limits: [f64; 5],
    /// Largest variance of an expected velocity [m^2/s^2] with which its period is known.
    pub velocity_known: f64,
}

/// Tracks or detections: vectors and their covariances.
#[derive(Clone, Copy)]
pub struct Known<'a, const N: usize> {
    pub value: &'a [[f64; N]],
    pub covariance: &'a [Matrix<N, N>],
}

/// A track and a detection.
pub type Pair = (usize, usize);

/// Pairs of tracks and detections within their gates, by track, and what each costs: minus twice the log likelihood,
/// `v' S^-1 v + log(det(S))`.
pub fn gated_pairs<const N: usize, const M: usize>(
    tracks: Known<N>,
    detections: Known<M>,
    gate: &Gate,
) -> (Vec<Pair>, Vec<f64>) {
    let (mut pairs, mut costs) = (Vec::new(), Vec::new());
    for (track, (state, covariance)) in tracks.value.iter().zip(tracks.covariance).enumerate() {
        let expected: Expected<N, M> = expect(state, covariance);
        let spread = sum(&expected.covariance, &expected.curvature);
        for (detection, (measured, noise)) in detections.value.iter().zip(detections.covariance).enumerate() {
            // The squared distance is at least that of each value alone: most pairs go at once.
            let between = gate.between(measured, &expected);
            let limit = gate.limits[M];
            if (0..M).any(|k| between[k] * between[k] > limit * (spread[k][k] + noise[k][k])) {
                continue;
            }
            let innovation = Innovation::new(&between, &sum(&spread, noise));
            let (square, number) = (innovation.square(), innovation.num_measured());
            if number > 0 && square <= gate.limits[number] {
                pairs.push((track, detection));
                costs.push(square + innovation.determinant.ln());
            }
        }
    }
    (pairs, costs)
}

/// Take detections into tracks, pair by pair.
pub fn update_pairs<const N: usize, const M: usize>(
    states: &mut [[f64; N]],
    covariances: &mut [Matrix<N, N>],
    detections: Known<M>,
    pairs: &[Pair],
    gate: &Gate,
) {
    for &(track, detection) in pairs {
        let (state, covariance) = (&mut states[track], &mut covariances[track]);
        let noise = &detections.covariance[detection];
        let expected: Expected<N, M> = expect(state, covariance);
        let spread = sum(&sum(&expected.covariance, &expected.curvature), noise);
        let innovation = Innovation::new(&gate.between(&detections.value[detection], &expected), &spread);
        update(state, covariance, &expected, &innovation, noise);
    }
}

impl Gate {
    /// Measured less expected values, by the shorter way around; NaN for what tells nothing.
    fn between<const N: usize, const M: usize>(&self, measured: &[f64; M], expected: &Expected<N, M>) -> [f64; M] {
        let is_known = expected.covariance[1][1] + expected.curvature[1][1] <= self.velocity_known;
        from_fn(|k| {
            if k == 1 && !is_known {
                return f64::NAN;
            }
            let difference = measured[k] - expected.value[k];
            difference - self.periods[k] * (difference / self.periods[k]).round_ties_even()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GATE: Gate = Gate {
        periods: [1e300, 4.0, 6.0, 6.0],
        limits: [0.0, 9.0, 9.0, 9.0, 9.0],
        velocity_known: 1.0,
    };

    /// Tracks at 2 and 5 m, known as well as detections are measured.
    const TRACKS: Known<2> = Known {
        value: &[[2.0, 0.0], [5.0, 1.9]],
        covariance: &[[[0.5, 0.0], [0.0, 0.5]]; 2],
    };

    #[test]
    fn pairs_are_within_their_gates_and_cost_what_is_unlikely() {
        let detections = Known {
            // At 1 m from the first; at the second, the other way around; from none.
            value: &[[3.0, 0.0], [5.0, -1.9], [20.0, 0.0]],
            covariance: &[[[0.5, 0.0], [0.0, 0.5]]; 3],
        };
        let (pairs, costs) = gated_pairs(TRACKS, detections, &GATE);
        assert_eq!(pairs, [(0, 0), (1, 0), (1, 1)]);
        // Of unit covariances: 1 m; 2 m and 1.9 m/s; 0.2 m/s.
        for (cost, expected) in costs.iter().zip([1.0, 4.0 + 3.61, 0.04]) {
            assert!((cost - expected).abs() < 1e-12, "{cost} {expected}");
        }
    }

    #[test]
    fn updated_track_lies_between_what_was_expected_and_measured() {
        let detections = Known {
            value: &[[3.0, f64::NAN]],
            covariance: &[[[0.5, 0.0], [0.0, 0.5]]],
        };
        let (mut states, mut covariances) = (TRACKS.value.to_vec(), TRACKS.covariance.to_vec());
        update_pairs(&mut states, &mut covariances, detections, &[(0, 0)], &GATE);
        assert!((states[0][0] - 2.5).abs() < 1e-15 && states[0][1] == 0.0);
        assert!((covariances[0][0][0] - 0.25).abs() < 1e-15 && covariances[0][1][1] == 0.5);
        assert_eq!(states[1], TRACKS.value[1]);
    }
}
