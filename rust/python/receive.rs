//! Noise of the receiver.

use numpy::{Element, PyReadwriteArray1};
use pyo3::prelude::*;

use crate::error::Error;
use crate::numeric::normal;
use crate::numeric::simd::{Level, Real};

/// Samples in single or double precision, real and imaginary parts in turn.
#[derive(FromPyObject)]
pub(super) enum Samples<'py> {
    Single(PyReadwriteArray1<'py, f32>),
    Double(PyReadwriteArray1<'py, f64>),
}

/// Add white noise of a standard deviation to samples, in place. Equal seeds and streams give equal noise.
#[pyfunction(signature = (samples, *, deviation, seed, stream))]
pub(super) fn add_noise(py: Python<'_>, samples: Samples<'_>, deviation: f64, seed: u64, stream: u64) -> PyResult<()> {
    if !(deviation >= 0.0 && deviation.is_finite()) {
        return Err(Error::value("deviation", "zero or a positive number", deviation).into());
    }
    match samples {
        Samples::Single(mut samples) => add(py, &mut samples, deviation, seed, stream),
        Samples::Double(mut samples) => add(py, &mut samples, deviation, seed, stream),
    }
}

fn add<T: Real + Element>(
    py: Python<'_>,
    samples: &mut PyReadwriteArray1<'_, T>,
    deviation: f64,
    seed: u64,
    stream: u64,
) -> PyResult<()> {
    let samples = samples.as_slice_mut()?;
    py.detach(|| normal::add_normal(Level::best(), samples, deviation, seed, stream));
    Ok(())
}
