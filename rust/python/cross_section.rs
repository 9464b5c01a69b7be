//! Radar cross-sections of surfaces.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{numbers, points};
use super::rays::Surface;
use super::threads::compute;
use crate::bounces::{self, Aspect};
use crate::scattering::material;

/// Radar cross-sections [m^2] of a perfect conductor for unit vectors (direction, 3) to the transmitter and the
/// receiver; `polarization` has the fields of both antennas (direction, 3).
#[pyfunction(signature = (surface, transmitter, receiver, *, frequency, polarization=None, max_bounces, threads=None))]
#[allow(clippy::too_many_arguments)] // as Python hands them over
pub(super) fn cross_sections<'py>(
    py: Python<'py>,
    surface: PyRef<'py, Surface>,
    transmitter: PyReadonlyArray2<'py, f64>,
    receiver: PyReadonlyArray2<'py, f64>,
    frequency: f64,
    polarization: Option<(PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>)>,
    max_bounces: usize,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let shape = [Some(transmitter.shape()[0]), Some(3)];
    let vectors = |name: &str, array: &PyReadonlyArray2<'py, f64>| PyResult::Ok(points(numbers(name, array, shape)?));
    let directions = [vectors("transmitter", &transmitter)?, vectors("receiver", &receiver)?];
    let fields = match &polarization {
        None => None,
        Some((sent, received)) => Some([vectors("polarization", sent)?, vectors("polarization", received)?]),
    };
    let aspect = |i: usize| Aspect {
        directions: [directions[0][i], directions[1][i]],
        polarizations: fields.as_ref().map(|fields| [fields[0][i], fields[1][i]]),
    };
    let aspects: Vec<Aspect> = (0..transmitter.shape()[0]).map(aspect).collect();
    let surface = &surface.0;
    let sections = compute(py, threads, || {
        bounces::cross_sections(surface, material::CONDUCTOR, frequency, &aspects, max_bounces)
    })?;
    Ok(sections.into_pyarray(py))
}
