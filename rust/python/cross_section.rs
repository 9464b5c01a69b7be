//! Radar cross-sections of bodies.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{numbers, points, poses};
use super::rays::PySurface;
use super::scattering::{PyMaterial, materials};
use super::threads::compute;
use crate::bounces::{self, Aspect};
use crate::rays::scene::PosedScene;

/// Radar cross-sections [m^2] of bodies at poses (body, 3, 4) for unit vectors (direction, 3) to the transmitter and the
/// receiver; `polarization` has the fields of both antennas (direction, 3). `report` receives the number of directions
/// that are done, from time to time.
#[pyfunction(signature = (
    surfaces, body_poses, body_materials, transmitter, receiver, *,
    frequency, polarization=None, max_bounces, threads=None, report=None,
))]
pub(super) fn cross_sections<'py>(
    py: Python<'py>,
    surfaces: Vec<PyRef<'py, PySurface>>,
    body_poses: PyReadonlyArray3<'py, f64>,
    body_materials: Vec<PyRef<'py, PyMaterial>>,
    transmitter: PyReadonlyArray2<'py, f64>,
    receiver: PyReadonlyArray2<'py, f64>,
    frequency: f64,
    polarization: Option<(PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>)>,
    max_bounces: usize,
    threads: Option<usize>,
    report: Option<Py<PyAny>>,
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
    let poses = poses(numbers("poses", &body_poses, [Some(surfaces.len()), Some(3), Some(4)])?);
    let materials = materials(&body_materials, surfaces.len())?;
    let scene = PosedScene::new(surfaces.iter().map(|surface| surface.0.clone()).collect(), poses);
    let sections = compute(py, threads, report.as_ref(), |cancel| {
        bounces::cross_sections(&scene, &materials, frequency, &aspects, max_bounces, cancel)
    })?;
    Ok(sections.into_pyarray(py))
}
