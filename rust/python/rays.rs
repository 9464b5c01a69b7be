//! Surfaces, and hits of images.

use std::sync::Arc;

use glam::DVec3;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::arrays::{numbers, points};
use super::scattering::PyMaterial;
use super::threads::{compute, compute_owned};
use crate::error::Error;
use crate::rays::hits::Hits;
use crate::rays::scene::NO_BODY;
use crate::rays::surface::{self, ShadingMode};
use crate::scattering::reflectance::pixel_reflectance;

/// Triangles, tree and shading of one body.
#[pyclass(frozen, name = "Surface", module = "radarcore._core")]
pub(super) struct PySurface(pub(super) Arc<surface::Surface>);

#[pymethods]
impl PySurface {
    /// `report` receives the thousandths of the build that are done, from time to time.
    #[new]
    #[pyo3(signature = (vertices, triangles, *, crease_angle=None, report=None))]
    fn new(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        triangles: PyReadonlyArray2<'_, u32>,
        crease_angle: Option<f64>,
        report: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let vertices = points(numbers("vertices", &vertices, [None, Some(3)])?);
        let triangles = numbers("triangles", &triangles, [None, Some(3)])?
            .as_chunks()
            .0
            .to_vec();
        let mode = crease_angle.map_or(ShadingMode::Flat, |crease_angle| ShadingMode::Smooth { crease_angle });
        let surface = compute_owned(py, report.as_ref(), move |cancel| {
            surface::Surface::new(&vertices, &triangles, mode, cancel)
        })?;
        Ok(Self(Arc::new(surface)))
    }

    /// Rows of the triangles that were kept; none if all were kept.
    fn kept<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<u32>>> {
        self.0.kept().map(|kept| PyArray1::from_slice(py, kept))
    }

    /// Surface of the same triangles with moved vertices (n, 3) [m].
    #[pyo3(signature = (vertices, *, threads=None))]
    fn deform(&self, py: Python<'_>, vertices: PyReadonlyArray2<'_, f64>, threads: Option<usize>) -> PyResult<Self> {
        let vertices = points(numbers("vertices", &vertices, [None, Some(3)])?);
        let surface = compute(py, threads, None, |cancel| self.0.deform(vertices, cancel))?;
        Ok(Self(Arc::new(surface)))
    }

    /// Numbers of parts, and of open, non-manifold and inconsistently wound edges.
    fn topology(&self, py: Python<'_>) -> [usize; 4] {
        let topology = py.detach(|| self.0.topology());
        [
            topology.parts,
            topology.open_edges,
            topology.nonmanifold_edges,
            topology.inconsistent_edges,
        ]
    }

    /// Memory of triangles, tree and shading, and of the vertices [bytes].
    #[getter]
    fn memory(&self) -> (usize, usize) {
        (self.0.memory(), self.0.vertex_memory())
    }
}

/// Distance along the ray [m], cosine of incidence and body of every pixel, (rows, columns), distance to the curved
/// surface [m] and unit normals, (rows, columns, 3).
pub(super) fn image_arrays(py: Python<'_>, hits: Hits) -> PyResult<impl IntoPyObject<'_>> {
    const { assert!(NO_BODY.cast_signed() == -1) };
    let shape = [hits.plane.rows, hits.plane.columns];
    let body: Vec<i32> = hits.body.into_iter().map(u32::cast_signed).collect();
    Ok((
        hits.distance.into_pyarray(py).reshape(shape)?,
        hits.cosine.into_pyarray(py).reshape(shape)?,
        body.into_pyarray(py).reshape(shape)?,
        hits.surface_distance.into_pyarray(py).reshape(shape)?,
        hits.normal
            .into_flattened()
            .into_pyarray(py)
            .reshape([shape[0], shape[1], 3])?,
    ))
}

/// Power reflectance of materials, one per body, in pixels with a body, a cosine of incidence, a normal and a direction of
/// the ray; 0 where the body is negative.
#[pyfunction]
#[pyo3(signature = (materials, body, cos_incidence, normals, directions, *, frequency, polarization=None, threads=None))]
pub(super) fn reflectance<'py>(
    py: Python<'py>,
    materials: Vec<PyRef<'_, PyMaterial>>,
    body: PyReadonlyArray2<'_, i32>,
    cos_incidence: PyReadonlyArray2<'_, f64>,
    normals: PyReadonlyArray3<'_, f64>,
    directions: PyReadonlyArray3<'_, f64>,
    frequency: f64,
    polarization: Option<[f64; 3]>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let materials: Vec<_> = materials.iter().map(|material| material.0).collect();
    let [rows, columns] = [body.shape()[0], body.shape()[1]];
    let (image, vectors) = ([Some(rows), Some(columns)], [Some(rows), Some(columns), Some(3)]);
    let scalars = (
        numbers("body", &body, image)?,
        numbers("cos_incidence", &cos_incidence, image)?,
    );
    let vectors = (
        numbers("normals", &normals, vectors)?.as_chunks().0,
        numbers("directions", &directions, vectors)?.as_chunks().0,
    );
    let is_beyond = |body: &&i32| usize::try_from(**body).is_ok_and(|body| body >= materials.len());
    if let Some(beyond) = scalars.0.iter().find(is_beyond) {
        return Err(Error::value("body", format!("numbers below {}", materials.len()), beyond).into());
    }
    let polarization = polarization.map(DVec3::from_array);
    let reflectance = compute(py, threads, None, |cancel| {
        pixel_reflectance(&materials, scalars, vectors, frequency, polarization, cancel)
    })?;
    reflectance.into_pyarray(py).reshape([rows, columns])
}
