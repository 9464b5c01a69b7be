//! Polynomials through values at Chebyshev nodes of the first kind.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Matrix `(num_nodes, num_nodes)` from values at increasing Chebyshev times to coefficients of `T_k(x)`.
pub fn chebyshev_matrix(num_nodes: usize) -> Cow<'static, [f64]> {
    // Plans ask for small matrices hundreds of times.
    static KEPT: [OnceLock<Vec<f64>>; 17] = [const { OnceLock::new() }; 17];
    match KEPT.get(num_nodes) {
        Some(kept) => Cow::Borrowed(kept.get_or_init(|| matrix(num_nodes))),
        None => Cow::Owned(matrix(num_nodes)),
    }
}

/// [`chebyshev_matrix`], computed.
fn matrix(num_nodes: usize) -> Vec<f64> {
    let n = num_nodes as f64;
    let mut matrix = Vec::with_capacity(num_nodes * num_nodes);
    for k in 0..num_nodes {
        let scale = if k == 0 { 1.0 } else { 2.0 } / n;
        for j in 0..num_nodes {
            // Nodes increase: x_j = -cos(pi (2j + 1) / (2n)), and T_k(-x) = (-1)^k T_k(x).
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            matrix.push(sign * scale * (PI * (k * (2 * j + 1)) as f64 / (2.0 * n)).cos());
        }
    }
    matrix
}

/// Chebyshev nodes of the first kind on [-1, 1], increasing.
pub fn chebyshev_nodes(number: usize) -> Vec<f64> {
    let angle = |j: usize| PI * (2 * j + 1) as f64 / (2 * number) as f64;
    // The middle of an odd number is exact.
    let node = |j: usize| if 2 * j + 1 == number { 0.0 } else { -angle(j).cos() };
    (0..number).map(node).collect()
}

/// Weights of the values at `number` Chebyshev nodes in the value at `x` of the polynomial through them: the
/// barycentric formula (Berrut and Trefethen, Barycentric Lagrange interpolation, eq. (4.2)).
pub fn interpolation_weights(number: usize, x: f64) -> Vec<f64> {
    let nodes = chebyshev_nodes(number);
    if let Some(at) = nodes.iter().position(|node| *node == x) {
        return (0..number).map(|j| f64::from(u8::from(j == at))).collect();
    }
    let term = |j: usize| {
        let sign = if j.is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * (PI * (2 * j + 1) as f64 / (2 * number) as f64).sin() / (x - nodes[j])
    };
    let terms: Vec<f64> = (0..number).map(term).collect();
    let sum: f64 = terms.iter().sum();
    terms.into_iter().map(|term| term / sum).collect()
}

/// Weights of the values at `number` Chebyshev nodes in the derivative, by `x` at 0, of the polynomial through them.
pub fn slope_weights(number: usize) -> Vec<f64> {
    let matrix = chebyshev_matrix(number);
    let mut weights = vec![0.0; number];
    // The derivative of T_k at 0 is k sin(k pi / 2).
    for k in (1..number).step_by(2) {
        let slope = if k % 4 == 1 { k as f64 } else { -(k as f64) };
        for (weight, value) in weights.iter_mut().zip(&matrix[k * number..]) {
            *weight += slope * value;
        }
    }
    weights
}

/// Error of the series through values at Chebyshev nodes: twice the larger of its last two coefficients, by component.
pub fn series_tail<const N: usize>(values: &[[f64; N]]) -> [f64; N] {
    let number = values.len();
    let mut tail = [0.0_f64; N];
    for order in number.saturating_sub(2).max(1)..number {
        let mut coefficient = [0.0; N];
        for (j, value) in values.iter().enumerate() {
            let angle = PI * (order * (2 * (number - j) - 1)) as f64 / (2 * number) as f64;
            let weight = 2.0 / number as f64 * angle.cos();
            for k in 0..N {
                coefficient[k] += weight * value[k];
            }
        }
        for k in 0..N {
            tail[k] = tail[k].max(2.0 * coefficient[k].abs());
        }
    }
    tail
}

/// Bound of what a series of `number` terms leaves out of the one through values at more Chebyshev nodes, by component.
pub fn series_beyond<const N: usize>(values: &[[f64; N]], number: usize) -> [f64; N] {
    let matrix = chebyshev_matrix(values.len());
    let mut beyond = [0.0; N];
    for weights in matrix.chunks(values.len()).skip(number) {
        let mut coefficient = [0.0; N];
        for (weight, value) in weights.iter().zip(values) {
            for k in 0..N {
                coefficient[k] += weight * value[k];
            }
        }
        for k in 0..N {
            beyond[k] += coefficient[k].abs();
        }
    }
    beyond
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_leave_out_the_coefficients_beyond_theirs() {
        // T_2 + 0.1 T_9 - 0.01 T_11, T_k(x) = cos(k arccos(x)).
        let chebyshev = |k: f64, x: f64| (k * x.acos()).cos();
        let value = |x: f64| {
            [
                chebyshev(2.0, x) + 0.1 * chebyshev(9.0, x) - 0.01 * chebyshev(11.0, x),
                1.0,
            ]
        };
        let values: Vec<[f64; 2]> = chebyshev_nodes(17).into_iter().map(value).collect();
        for (number, expected) in [(2, 1.11), (8, 0.11), (10, 0.01), (12, 0.0)] {
            let [beyond, constant] = series_beyond(&values, number);
            assert!(
                (beyond - expected).abs() < 1e-13 && constant < 1e-13,
                "{number} {beyond} {constant}"
            );
        }
    }

    #[test]
    fn slopes_of_polynomials_are_exact() {
        for number in 1..=33 {
            let weights = slope_weights(number);
            for power in (0..12_i32).take(number) {
                let values = chebyshev_nodes(number).into_iter().map(|x| (0.3 + x).powi(power));
                let slope: f64 = values.zip(&weights).map(|(value, weight)| value * weight).sum();
                let expected = f64::from(power) * 0.3_f64.powi(power - 1);
                assert!((slope - expected).abs() < 1e-11, "{number} {power} {slope} {expected}");
            }
        }
    }
}
