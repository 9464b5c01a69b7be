//! Polynomials through values at Chebyshev nodes of the first kind.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Matrix `(num_nodes, num_nodes)` from values at increasing Chebyshev times to coefficients of `T_k(x)`.
pub fn chebyshev_matrix(num_nodes: usize) -> Cow<'static, [f64]> {
    // Motions have up to 65 times, and plans ask for small matrices hundreds of times.
    static KEPT: [OnceLock<Vec<f64>>; 66] = [const { OnceLock::new() }; 66];
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

#[cfg(test)]
mod tests {
    use super::*;

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
