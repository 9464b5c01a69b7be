//! Matrices of a few rows and columns, row by row.

/// Matrix of R rows and C columns.
pub type Matrix<const R: usize, const C: usize> = [[f64; C]; R];

/// The product `a b`.
pub fn product<const R: usize, const K: usize, const C: usize>(a: &Matrix<R, K>, b: &Matrix<K, C>) -> Matrix<R, C> {
    a.map(|row| std::array::from_fn(|j| (0..K).map(|k| row[k] * b[k][j]).sum()))
}

/// The product `a b'`.
pub fn product_transposed<const R: usize, const K: usize, const C: usize>(
    a: &Matrix<R, K>,
    b: &Matrix<C, K>,
) -> Matrix<R, C> {
    a.map(|row| std::array::from_fn(|j| dot(&row, &b[j])))
}

/// The product `a v`.
pub fn times<const R: usize, const C: usize>(a: &Matrix<R, C>, v: &[f64; C]) -> [f64; R] {
    a.map(|row| dot(&row, v))
}

/// Element by element.
pub fn sum<const R: usize, const C: usize>(a: &Matrix<R, C>, b: &Matrix<R, C>) -> Matrix<R, C> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
}

pub fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    (0..N).map(|k| a[k] * b[k]).sum()
}

pub fn unit<const N: usize>() -> Matrix<N, N> {
    std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))))
}

/// Inverse and determinant, by elimination with row pivots; not finite where the matrix has no inverse.
pub fn inverse<const N: usize>(matrix: &Matrix<N, N>) -> (Matrix<N, N>, f64) {
    let (mut rest, mut inverse, mut determinant) = (*matrix, unit::<N>(), 1.0);
    for column in 0..N {
        let size = |row: &usize| rest[*row][column].abs();
        let pivot = (column..N).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(column);
        if pivot != column {
            rest.swap(pivot, column);
            inverse.swap(pivot, column);
            determinant = -determinant;
        }
        let value = rest[column][column];
        determinant *= value;
        for j in 0..N {
            rest[column][j] /= value;
            inverse[column][j] /= value;
        }
        for row in (0..N).filter(|row| *row != column) {
            let factor = rest[row][column];
            for j in 0..N {
                rest[row][j] -= factor * rest[column][j];
                inverse[row][j] -= factor * inverse[column][j];
            }
        }
    }
    (inverse, determinant)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_undoes_a_matrix_that_needs_pivots() {
        let matrix = [[0.0, 2.0, 1.0], [1.0, 0.0, 3.0], [4.0, 1.0, 0.0]];
        let (inverse, determinant) = inverse(&matrix);
        // 0 (0 - 3) - 2 (0 - 12) + 1 (1 - 0).
        assert!((determinant - 25.0).abs() < 1e-13);
        let found = product(&matrix, &inverse);
        let unit = unit::<3>();
        assert!((0..9).all(|k| (found[k / 3][k % 3] - unit[k / 3][k % 3]).abs() < 1e-14));
    }

    #[test]
    fn inverse_of_a_singular_matrix_is_not_finite() {
        let (inverse, determinant) = inverse(&[[1.0, 2.0], [2.0, 4.0]]);
        assert!(determinant == 0.0 && inverse.iter().flatten().all(|value| !value.is_finite()));
    }
}
