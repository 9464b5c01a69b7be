//! White noise of receivers.

use numpy::{Element, PyReadwriteArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::numeric::normal::add_normal;
use crate::numeric::simd::{Level, Real};

/// Numbers in single or double precision.
#[derive(FromPyObject)]
pub(super) enum AnySamples<'py> {
    Single(PyReadwriteArrayDyn<'py, f32>),
    Double(PyReadwriteArrayDyn<'py, f64>),
}

/// Add white noise to the samples of frames, one after the other and each with a seed.
///
/// `deviation`: of every number. The noise belongs to the seed and to the start of the frame [s].
#[pyfunction]
pub(super) fn add_noise(
    py: Python<'_>,
    samples: AnySamples<'_>,
    seeds: Vec<u64>,
    deviation: f64,
    start: f64,
) -> PyResult<()> {
    match samples {
        AnySamples::Single(samples) => add(py, samples, &seeds, deviation, start),
        AnySamples::Double(samples) => add(py, samples, &seeds, deviation, start),
    }
}

fn add<T: Real + Element>(
    py: Python<'_>,
    mut samples: PyReadwriteArrayDyn<'_, T>,
    seeds: &[u64],
    deviation: f64,
    start: f64,
) -> PyResult<()> {
    if !samples.is_c_contiguous() {
        return Err(PyTypeError::new_err("samples: expected a C-contiguous array"));
    }
    let samples = samples.as_slice_mut()?;
    let size = samples.len().div_ceil(seeds.len().max(1)).max(1);
    // The bits of -0.0 differ from 0.0.
    let stream = (start + 0.0).to_bits();
    py.detach(|| {
        for (frame, seed) in samples.chunks_mut(size).zip(seeds) {
            add_normal(Level::best(), frame, deviation, *seed, stream);
        }
    });
    Ok(())
}
