//! Legendre polynomials, normalised to a mean square of one on -1 ..= 1, and Gauss's quadrature.

use std::f64::consts::PI;

/// Nodes of Gauss's quadrature on -1 ..= 1, and the weights of values there in Legendre coefficients.
#[derive(Clone, Debug)]
pub struct Nodes<const N: usize> {
    /// Places of the nodes.
    pub places: Vec<f64>,
    /// Weights of the nodes in the coefficients of the Legendre polynomials (node, degree).
    pub weights: Vec<[f64; N]>,
}

impl<const N: usize> Nodes<N> {
    /// Nodes that determine the coefficients of the polynomials, one per polynomial.
    pub fn new(number: usize) -> Self {
        let (mut places, mut weights) = (Vec::new(), Vec::new());
        let norm = |n: usize| ((2 * n + 1) as f64).sqrt();
        for j in 0..number {
            let mut u = (PI * (j as f64 + 0.75) / (number as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..6 {
                // Newton's method: (u^2 - 1) P_n' = n (u P_n - P_(n-1)).
                let values: [f64; N] = legendre(u);
                let [value, before] = [number, number - 1].map(|n| values[n] / norm(n));
                slope = number as f64 * (u * value - before) / (u * u - 1.0);
                u -= value / slope;
            }
            let weight = ((1.0 - u * u) * slope * slope).recip();
            places.push(u);
            weights.push(legendre(u).map(|value| weight * value));
        }
        Self { places, weights }
    }

    /// Coefficient of a Legendre polynomial of a function of the node.
    pub fn coefficient(&self, degree: usize, value: impl Fn(usize) -> f64) -> f64 {
        (0..self.places.len()).map(|j| self.weights[j][degree] * value(j)).sum()
    }
}

/// Legendre polynomials of degrees 0, 1, ... at u, normalised to a mean square of one.
pub fn legendre<const N: usize>(u: f64) -> [f64; N] {
    let mut values = [1.0; N];
    values[1] = u;
    for n in 2..N {
        values[n] = ((2 * n - 1) as f64 * u * values[n - 1] - (n - 1) as f64 * values[n - 2]) / n as f64;
    }
    std::array::from_fn(|n| ((2 * n + 1) as f64).sqrt() * values[n])
}
