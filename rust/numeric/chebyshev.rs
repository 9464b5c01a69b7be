//! Polynomials through values at Chebyshev times of the first kind.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Matrix `(num_nodes, num_nodes)` from values at increasing Chebyshev times to coefficients of `T_k(x)`.
pub fn chebyshev_matrix(num_nodes: usize) -> Cow<'static, [f64]> {
    // Plans ask for small ones hundreds of times.
    static KEPT: [OnceLock<Vec<f64>>; 17] = [const { OnceLock::new() }; 17];
    match KEPT.get(num_nodes) {
        Some(kept) => Cow::Borrowed(kept.get_or_init(|| matrix(num_nodes))),
        None => Cow::Owned(matrix(num_nodes)),
    }
}

/// The same, computed.
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
