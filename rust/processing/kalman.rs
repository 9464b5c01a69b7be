//! Kalman filter of a target: prediction by the white-acceleration model, and the update by a measurement.
//!
//! The formulas are those of Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation
//! (2001), chapters 5 and 6.

use std::array::from_fn;

use super::matrix::{Matrix, dot, inverse, product, product_transposed, sum, times, unit};
use super::state_space::Expected;

/// Move a target on by a time [s] at a constant velocity, which white acceleration of a power spectral density
/// [m^2/s^3] along each axis disturbs (their section 6.2.2).
pub fn predict<const N: usize>(state: &mut [f64; N], covariance: &mut Matrix<N, N>, time: f64, density: f64) {
    let (d, p) = (N / 2, *covariance);
    for i in 0..d {
        state[i] += time * state[d + i];
        for j in 0..d {
            let disturbed = if i == j { density * time } else { 0.0 };
            covariance[i][j] =
                p[i][j] + time * (p[d + i][j] + p[i][d + j] + time * p[d + i][d + j]) + disturbed * time * time / 3.0;
            covariance[i][d + j] = p[i][d + j] + time * p[d + i][d + j] + disturbed * time / 2.0;
            covariance[d + i][j] = p[d + i][j] + time * p[d + i][d + j] + disturbed * time / 2.0;
            covariance[d + i][d + j] = p[d + i][d + j] + disturbed;
        }
    }
}

/// Innovation of a measurement, and the inverse of its covariance; values that were not measured have no part.
pub struct Innovation<const M: usize> {
    /// Measured less expected values; 0 for what was not measured.
    pub value: [f64; M],
    pub is_measured: [bool; M],
    /// Of the covariance of the value; the unit matrix in what was not measured.
    pub inverse: Matrix<M, M>,
    pub determinant: f64,
}

impl<const M: usize> Innovation<M> {
    /// From measured less expected values, NaN for what was not measured, and their covariance.
    pub fn new(value: &[f64; M], covariance: &Matrix<M, M>) -> Self {
        let is_measured = value.map(|number| !number.is_nan());
        let (inverse, determinant) = inverse(&alone(covariance, &is_measured));
        Self {
            value: from_fn(|k| if is_measured[k] { value[k] } else { 0.0 }),
            is_measured,
            inverse,
            determinant,
        }
    }

    /// Squared Mahalanobis distance.
    pub fn square(&self) -> f64 {
        dot(&self.value, &times(&self.inverse, &self.value))
    }

    pub fn num_measured(&self) -> usize {
        self.is_measured.iter().filter(|is_measured| **is_measured).count()
    }
}

/// A covariance in which what was not measured is independent of the rest, with variance 1.
fn alone<const M: usize>(covariance: &Matrix<M, M>, is_measured: &[bool; M]) -> Matrix<M, M> {
    let unit = unit::<M>();
    let kept = |i: usize, j: usize| is_measured[i] && is_measured[j];
    from_fn(|i| from_fn(|j| if kept(i, j) { covariance[i][j] } else { unit[i][j] }))
}

/// Take a measurement of covariance `noise` into a target.
///
/// The covariance is updated in Joseph's form, `(I - K H) P (I - K H)' + K R K'`, which rounding leaves symmetric and
/// positive definite where `(I - K H) P` in time does not.
pub fn update<const N: usize, const M: usize>(
    state: &mut [f64; N],
    covariance: &mut Matrix<N, N>,
    expected: &Expected<N, M>,
    innovation: &Innovation<M>,
    noise: &Matrix<M, M>,
) {
    let is_measured = &innovation.is_measured;
    let jacobian: Matrix<M, N> = from_fn(|k| if is_measured[k] { expected.jacobian[k] } else { [0.0; N] });
    let noise = alone(&sum(noise, &expected.curvature), is_measured);

    let crossed = product(&jacobian, covariance);
    let gain: Matrix<N, M> = product(&from_fn(|i| from_fn(|k| crossed[k][i])), &innovation.inverse);
    let taken = product(&gain, &jacobian);
    let unit = unit::<N>();
    let kept: Matrix<N, N> = from_fn(|i| from_fn(|j| unit[i][j] - taken[i][j]));
    let updated = sum(
        &product_transposed(&product(&kept, covariance), &kept),
        &product_transposed(&product(&gain, &noise), &gain),
    );
    let change = times(&gain, &innovation.value);
    *state = from_fn(|i| state[i] + change[i]);
    *covariance = from_fn(|i| from_fn(|j| 0.5 * (updated[i][j] + updated[j][i])));
}

#[cfg(test)]
mod tests {
    use super::super::state_space::expect;
    use super::*;

    #[test]
    fn two_predictions_are_one_over_both_intervals() {
        let begin = ([1.0, 0.5], [[0.3, 0.1], [0.1, 0.2]]);
        let (mut once, mut twice) = (begin, begin);
        predict(&mut once.0, &mut once.1, 0.07, 2.0);
        predict(&mut twice.0, &mut twice.1, 0.02, 2.0);
        predict(&mut twice.0, &mut twice.1, 0.05, 2.0);
        assert!((0..2).all(|i| (once.0[i] - twice.0[i]).abs() < 1e-15));
        assert!((0..4).all(|k| (once.1[k / 2][k % 2] - twice.1[k / 2][k % 2]).abs() < 1e-15));
    }

    #[test]
    fn update_of_a_known_prior_is_the_weighted_mean() {
        // Range 2 with variance 4, measured as 5 with variance 12: mean weighted by 1/4 and 1/12, variance 3.
        let (mut state, mut covariance) = ([2.0, 0.0], [[4.0, 0.0], [0.0, 1.0]]);
        let expected: Expected<2, 2> = expect(&state, &covariance);
        let noise = [[12.0, 0.0], [0.0, 1.0]];
        let innovation = Innovation::new(&[3.0, f64::NAN], &sum(&expected.covariance, &noise));
        update(&mut state, &mut covariance, &expected, &innovation, &noise);
        assert!((state[0] - 2.75).abs() < 1e-15 && state[1] == 0.0);
        assert!((covariance[0][0] - 3.0).abs() < 1e-14 && (covariance[1][1] - 1.0).abs() < 1e-15);
        // v' S^-1 v of the range alone: 9 / 16.
        assert!((innovation.square() - 0.5625).abs() < 1e-15 && innovation.num_measured() == 1);
    }
}
