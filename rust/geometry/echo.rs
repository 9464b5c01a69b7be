//! Far-field echoes of triangles, to compare a mesh with the curved surface that it approximates.
//!
//! Physical optics of every triangle by itself, from its outer side, without occlusion.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex64;

/// Largest number of pieces into which sides of a curved triangle are cut.
const MOST_PIECES: usize = 16;

/// Largest distance of the cut surface from the curved one, in wavelengths.
const CLOSENESS: f64 = 1.0 / 200.0;

/// Integral of (-n.d) exp(-2jk d.x) over a flat triangle [m^2], with d the unit vector from the radar to it; zero from
/// behind.
pub fn of_facet([a, b, c]: [DVec3; 3], direction: DVec3, wavenumber: f64) -> Complex64 {
    let projected = -0.5 * (b - a).cross(c - a).dot(direction);
    if projected <= 0.0 {
        return Complex64::ZERO;
    }
    let phase = |x: DVec3| -2.0 * wavenumber * direction.dot(x);
    2.0 * projected * divided_difference([phase(a), phase(b), phase(c)])
}

/// Cut a triangle with normals at its corners into smaller ones whose corners lie on the curved surface.
pub fn cut(corners: [DVec3; 3], normals: [DVec3; 3], sagitta: f64, wavelength: f64) -> Vec<[DVec3; 3]> {
    // Every halving of a side quarters the distance.
    let pieces = (sagitta / (CLOSENESS * wavelength)).sqrt().ceil();
    let n = (pieces as usize).clamp(2, MOST_PIECES);
    let place = |i: usize, j: usize| {
        let weights = [i, j, n - i - j].map(|part| part as f64 / n as f64);
        let (point, height, normal) = raised(corners, normals, weights);
        point + height * normal
    };
    let mut pieces = Vec::with_capacity(n * n);
    for i in 0..n {
        for j in 0..n - i {
            pieces.push([place(i + 1, j), place(i, j + 1), place(i, j)]);
            if i + j + 1 < n {
                pieces.push([place(i + 1, j), place(i + 1, j + 1), place(i, j + 1)]);
            }
        }
    }
    pieces
}

/// Point of a triangle, height of the curved surface above it [m], and unit normal of that surface, as in
/// [`crate::geometry::curved_triangle::shade`].
pub fn raised(corners: [DVec3; 3], normals: [DVec3; 3], weights: [f64; 3]) -> (DVec3, f64, DVec3) {
    let mean = |values: [DVec3; 3]| -> DVec3 { (0..3).map(|i| weights[i] * values[i]).sum() };
    let point = mean(corners);
    let twice: f64 = (0..3).map(|i| weights[i] * (corners[i] - point).dot(normals[i])).sum();
    (point, 0.5 * twice, mean(normals).normalize_or_zero())
}

/// Divided difference of exp(j x): its integral over the triangle of weights is that of exp(j x) with x linear in
/// between (Hermite, Genocchi).
fn divided_difference(mut x: [f64; 3]) -> Complex64 {
    x.sort_unstable_by(f64::total_cmp);
    let [low, middle, high] = x;
    if high - low > 0.5 {
        return (of_two(middle, high) - of_two(low, middle)) / Complex64::new(0.0, high - low);
    }
    // Complete homogeneous polynomials h_n over (n + 2)!, about the middle.
    let (p, q) = (low - middle, high - middle);
    let (mut sum, mut power, mut weight) = (Complex64::ZERO, Complex64::ONE, 0.5);
    let (mut of_both, mut of_q) = (1.0, 1.0);
    for n in 1..=8 {
        sum += power * of_both * weight;
        power *= Complex64::I;
        weight /= f64::from(n) + 2.0;
        of_q *= q;
        of_both = p * of_both + of_q;
    }
    Complex64::cis(middle) * sum
}

/// (exp(j b) - exp(j a)) / (j (b - a)).
fn of_two(a: f64, b: f64) -> Complex64 {
    let half = 0.5 * (b - a);
    let sinc = if half.abs() < 1e-4 {
        1.0 - half * half / 6.0
    } else {
        half.sin() / half
    };
    Complex64::cis(0.5 * (a + b)) * sinc
}

/// Unit vectors spread evenly over the sphere (Fibonacci lattice).
pub fn directions(number: usize) -> Vec<DVec3> {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    (0..number)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / number as f64;
            let (sine, angle) = ((1.0 - z * z).sqrt(), TAU * golden * i as f64);
            DVec3::new(sine * angle.cos(), sine * angle.sin(), z)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn divided_differences_are_the_integral_over_the_triangle() {
        for x in [
            [0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0],
            [0.3, 0.3, 0.5],
            [3.0, 2.9, 2.6],
            [0.0, 0.5001, 0.2],
            [-4.0, 9.0, 9.0],
            [100.0, 107.0, 250.0],
        ] {
            // The middles of small triangles.
            let n = 1000_usize;
            let mut sum = Complex64::ZERO;
            for i in 0..n {
                for j in 0..n - i {
                    let at = |shift: f64| {
                        let (s, t) = ((i as f64 + shift) / n as f64, (j as f64 + shift) / n as f64);
                        Complex64::cis(x[0] + s * (x[1] - x[0]) + t * (x[2] - x[0]))
                    };
                    sum += at(1.0 / 3.0);
                    if i + j + 1 < n {
                        sum += at(2.0 / 3.0);
                    }
                }
            }
            let expected = sum * 0.5 / (n * n) as f64;
            let got = divided_difference(x);
            assert!(
                (got - expected).norm() < 2e-4 * got.norm().max(1e-2),
                "{x:?} {got} {expected}"
            );
        }
        let (below, above) = (
            divided_difference([0.0, 0.2, 0.499_999_9]),
            divided_difference([0.0, 0.2, 0.500_000_1]),
        );
        assert!((below - above).norm() < 1e-7);
    }

    #[test]
    fn plate_has_the_cross_section_of_its_area() {
        let corners =
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(y, z)| DVec3::new(0.3, 0.05 * y, 0.05 * z));
        let triangles = [[0, 2, 1], [0, 3, 2]].map(|t: [usize; 3]| t.map(|i| corners[i]));
        let echo = |d: DVec3| -> Complex64 { triangles.iter().map(|t| of_facet(*t, d, 1257.5)).sum() };
        assert!((echo(DVec3::X).norm() - 0.01).abs() < 1e-15);
        assert_eq!(echo(-DVec3::X), Complex64::ZERO);
        // sin(x) / x of half the phase over the side, times the cosine.
        let (sine, cosine) = 0.02_f64.sin_cos();
        let x = 1257.5 * 0.1 * sine;
        let aside = echo(DVec3::new(cosine, sine, 0.0)).norm();
        assert!((aside - 0.01 * cosine * (x.sin() / x).abs()).abs() < 1e-15);
    }

    #[test]
    fn directions_are_spread_evenly() {
        let all = directions(64);
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-15));
        assert!(all.iter().sum::<DVec3>().length() < 1.0);
        let moment = all.iter().map(|d| d.x * d.x).sum::<f64>() / 64.0;
        assert!((moment - 1.0 / 3.0).abs() < 0.01);
    }
}
