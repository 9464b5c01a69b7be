//! States of targets and what a radar measures of them: range and range rate, with angles or without.
//!
//! Targets that have no angles move in one dimension: state (range, velocity). Those with an azimuth move in the plane,
//! those with an elevation too in space: state (position, velocity), in the coordinates of a sensor at rest. In D
//! dimensions a state has N = 2 D numbers, and the first M = D + 1 of range, velocity, azimuth and elevation are
//! measured.

use std::array::from_fn;

use super::matrix::{Matrix, product, product_transposed};

/// Nearer than this [m] there is no direction.
pub const SHORTEST_RANGE: f64 = 1e-3;

/// Expected measurement of a target, and its covariance.
pub struct Expected<const N: usize, const M: usize> {
    /// Range [m], velocity [m/s], azimuth, elevation [rad]: their mean, to second order.
    pub value: [f64; M],
    /// Derivative of the values by the state.
    pub jacobian: Matrix<M, N>,
    /// Covariance of the values, to first order.
    pub covariance: Matrix<M, M>,
    /// Second-order terms of that covariance.
    pub curvature: Matrix<M, M>,
}

/// Expected measurement of a target whose state is known to some covariance.
///
/// Range and velocity are taken to second order, as in the second-order extended Kalman filter (Bar-Shalom, Li and
/// Kirubarajan 2001, section 10.3): where angles or the velocity across are poorly known, the range rate varies with
/// the product of both errors, which first order does not see. Angles are taken to first order.
pub fn expect<const N: usize, const M: usize>(state: &[f64; N], covariance: &Matrix<N, N>) -> Expected<N, M> {
    let d = N / 2;
    let (mut value, jacobian) = observe::<N, M>(state);
    let first_order = product_transposed(&product(&jacobian, covariance), &jacobian);
    let mut curvature = [[0.0; M]; M];
    if d > 1 {
        // Half the traces of the second derivatives' products with the covariance, and of the products of two of those.
        let spread = second_derivatives(&value, &jacobian).map(|second| product(&second, covariance));
        for k in 0..2 {
            value[k] += 0.5 * (0..N).map(|i| spread[k][i][i]).sum::<f64>();
            for l in 0..2 {
                let trace = |i: usize| (0..N).map(|j| spread[k][i][j] * spread[l][j][i]).sum::<f64>();
                curvature[k][l] = 0.5 * (0..N).map(trace).sum::<f64>();
            }
        }
    }
    Expected {
        value,
        jacobian,
        covariance: first_order,
        curvature,
    }
}

/// Range, velocity, azimuth and elevation of a target, and their derivatives by the state.
fn observe<const N: usize, const M: usize>(state: &[f64; N]) -> ([f64; M], Matrix<M, N>) {
    let d = N / 2;
    let (mut value, mut jacobian) = ([0.0; M], [[0.0; N]; M]);
    if d == 1 {
        value[..2].copy_from_slice(state);
        (jacobian[0][0], jacobian[1][1]) = (1.0, 1.0);
        return (value, jacobian);
    }
    let (position, motion) = state.split_at(d);
    let square = position.iter().map(|x| x * x).sum::<f64>();
    let distance = square.sqrt().max(SHORTEST_RANGE);
    let rate = position.iter().zip(motion).map(|(x, v)| x / distance * v).sum::<f64>();
    (value[0], value[1]) = (distance, rate);
    for k in 0..d {
        let towards = position[k] / distance;
        jacobian[0][k] = towards;
        jacobian[1][d + k] = towards;
        jacobian[1][k] = (motion[k] - rate * towards) / distance;
    }

    // Angles: azimuth in the plane, elevation above it.
    let (x, y) = (position[0], position[1]);
    let across = x.hypot(y).max(SHORTEST_RANGE);
    let square = across * across;
    value[2] = y.atan2(x);
    (jacobian[2][0], jacobian[2][1]) = (-y / square, x / square);
    if d == 3 {
        let z = position[2];
        let slope = across / (distance * distance);
        value[3] = z.atan2(across);
        jacobian[3][2] = slope;
        (jacobian[3][0], jacobian[3][1]) = (-x * z * slope / square, -y * z * slope / square);
    }
    (value, jacobian)
}

/// Second derivatives of range and range rate: of the direction, as both are its products with place and motion.
fn second_derivatives<const N: usize, const M: usize>(value: &[f64; M], jacobian: &Matrix<M, N>) -> [Matrix<N, N>; 2] {
    let d = N / 2;
    let (distance, rate) = (value[0], value[1]);
    let (towards, turning) = (&jacobian[0], &jacobian[1]);
    let mut second = [[[0.0; N]; N]; 2];
    for i in 0..d {
        for j in 0..d {
            let bend = (f64::from(u8::from(i == j)) - towards[i] * towards[j]) / distance;
            second[0][i][j] = bend;
            second[1][i][d + j] = bend;
            second[1][d + i][j] = bend;
            second[1][i][j] = -(towards[i] * turning[j] + turning[i] * towards[j] + rate * bend) / distance;
        }
    }
    second
}

/// State and covariance of a target from its first measurement, whose velocity may be NaN.
///
/// `speed_deviation` [m/s]: along each axis where nothing was measured.
pub fn begin<const N: usize, const M: usize>(
    measured: &[f64; M],
    noise: &Matrix<M, M>,
    speed_deviation: f64,
) -> ([f64; N], Matrix<N, N>) {
    let d = N / 2;
    let (mut measured, mut noise, unknown) = (*measured, *noise, speed_deviation * speed_deviation);
    if measured[1].is_nan() {
        measured[1] = 0.0;
        for k in 0..M {
            let variance = if k == 1 { unknown } else { 0.0 };
            (noise[1][k], noise[k][1]) = (variance, variance);
        }
    }
    if d == 1 {
        return (from_fn(|k| measured[k]), from_fn(|i| from_fn(|j| noise[i][j])));
    }

    // Unit vectors towards the target, to the left and up.
    let (distance, rate) = (measured[0], measured[1]);
    let (sa, ca) = measured[2].sin_cos();
    let (se, ce) = if d == 3 { measured[3].sin_cos() } else { (0.0, 1.0) };
    let [towards, left, up] = [
        [ce * ca, ce * sa, se],
        [-ce * sa, ce * ca, 0.0],
        [-se * ca, -se * sa, ce],
    ];

    // Derivative of the state by what was measured; of the velocity across the line of sight nothing is known.
    let (mut state, mut slope) = ([0.0; N], [[0.0; M]; N]);
    for k in 0..d {
        (state[k], state[d + k]) = (distance * towards[k], rate * towards[k]);
        (slope[k][0], slope[d + k][1]) = (towards[k], towards[k]);
        for (angle, turn) in [left, up].iter().enumerate().take(d - 1) {
            (slope[k][2 + angle], slope[d + k][2 + angle]) = (distance * turn[k], rate * turn[k]);
        }
    }
    let mut covariance = product_transposed(&product(&slope, &noise), &slope);
    for i in 0..d {
        for j in 0..d {
            covariance[d + i][d + j] += unknown * (f64::from(u8::from(i == j)) - towards[i] * towards[j]);
        }
    }
    (state, covariance)
}

#[cfg(test)]
mod tests {
    use super::super::matrix::dot;
    use super::*;

    /// A target 5 m away that moves along and across the line of sight.
    const STATE: [f64; 4] = [4.0, 3.0, 1.0, 2.0];

    #[test]
    fn exactly_known_state_is_measured_as_geometry_says() {
        let found: Expected<4, 3> = expect(&STATE, &[[0.0; 4]; 4]);
        // (4, 3) / 5 times (1, 2), and the arc tangent of 3 / 4.
        let expected = [5.0, 2.0, 0.75_f64.atan()];
        assert!((0..3).all(|k| (found.value[k] - expected[k]).abs() < 1e-15));
        assert!(found.covariance == [[0.0; 3]; 3] && found.curvature == [[0.0; 3]; 3]);
    }

    #[test]
    fn begun_state_is_measured_as_it_began() {
        let (measured, noise) = ([3.0, -0.5, 0.4, -0.2], [0.1, 0.2, 0.03, 0.04]);
        let noise: Matrix<4, 4> = from_fn(|i| from_fn(|j| if i == j { noise[i] } else { 0.0 }));
        let (state, covariance) = begin::<6, 4>(&measured, &noise, 2.0);
        let (value, jacobian) = observe::<6, 4>(&state);
        let spread = product_transposed(&product(&jacobian, &covariance), &jacobian);
        for i in 0..4 {
            assert!((value[i] - measured[i]).abs() < 1e-15);
            assert!((0..4).all(|j| (spread[i][j] - noise[i][j]).abs() < 1e-14));
        }
        assert!(dot(&jacobian[0], &jacobian[0]) > 0.999);
    }
}
