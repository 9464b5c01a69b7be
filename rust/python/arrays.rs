//! Views of numpy arrays, checked for shape.

use glam::DVec3;
use numpy::ndarray::Dimension;
use numpy::{Element, IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::error::Error;
use crate::geometry::pose::Pose;

/// Values of an array in C order; an error for other layouts and for lengths other than expected (`None`: any).
pub(super) fn numbers<'a, T: Element, D: Dimension, const N: usize>(
    name: &str,
    array: &'a PyReadonlyArray<'_, T, D>,
    expected: [Option<usize>; N],
) -> PyResult<&'a [T]> {
    let lengths = array.shape().iter().copied().map(Some);
    if lengths
        .clone()
        .zip(expected)
        .any(|(got, want)| want.is_some() && want != got)
    {
        let error = Error::value(name, format!("shape {}", shape_text(expected)), shape_text(lengths));
        return Err(error.into());
    }
    // `as_slice` alone would take Fortran order too and read the numbers in the wrong order.
    if !array.is_c_contiguous() {
        return Err(PyTypeError::new_err(format!("{name}: expected a C-contiguous array")));
    }
    Ok(array.as_slice()?)
}

/// Text of a shape in Python's notation, `n` for free lengths: `(n, 3)`.
pub(super) fn shape_text(lengths: impl IntoIterator<Item = Option<usize>>) -> String {
    let lengths: Vec<String> = lengths
        .into_iter()
        .map(|length| length.map_or_else(|| "n".into(), |length| length.to_string()))
        .collect();
    format!("({}{})", lengths.join(", "), if lengths.len() == 1 { "," } else { "" })
}

/// Vectors from rows (x, y, z).
pub(super) fn points(numbers: &[f64]) -> Vec<DVec3> {
    numbers.as_chunks().0.iter().copied().map(DVec3::from_array).collect()
}

/// Poses from matrices (3, 4), row by row.
pub(super) fn poses(numbers: &[f64]) -> Vec<Pose> {
    numbers.as_chunks().0.iter().map(Pose::from_rows).collect()
}

pub(super) fn matrix<T: Element, const N: usize>(
    py: Python<'_>,
    rows: Vec<[T; N]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let shape = [rows.len(), N];
    rows.into_flattened().into_pyarray(py).reshape(shape)
}
