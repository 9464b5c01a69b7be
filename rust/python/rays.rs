//! Surfaces, and hits of images.

use std::sync::Arc;

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

use super::arrays::{numbers, points};
use super::scattering::{Material, materials};
use super::threads::{check_threads, compute, compute_owned};
use crate::frame;
use crate::rays::hits;
use crate::rays::scene::NO_BODY;
use crate::rays::surface::{self, ShadingMode};
use crate::scattering::reflectance;

/// Triangles, tree and shading of one body.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Surface(pub(super) Arc<surface::Surface>);

#[pymethods]
impl Surface {
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
            surface::Surface::new_until(&vertices, &triangles, mode, cancel)
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
        let surface = compute(py, threads, None, |cancel| self.0.deform_until(vertices, cancel))?;
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

pub(super) type SmoothArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);

/// Hits of the rays of an image.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Hits(pub(super) Arc<frame::Image>);

#[pymethods]
impl Hits {
    /// Distance along the ray [m], (rows, columns); inf where nothing was hit.
    fn distance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.image(PyArray1::from_slice(py, &self.0.hits.distance))
    }

    /// Numbers of rays cast, of tiles skipped and of tiles reused.
    #[getter]
    fn counts(&self) -> (usize, usize, usize) {
        let hits::Counts {
            rays,
            tiles_skipped,
            tiles_reused,
        } = self.0.hits.counts;
        (rays, tiles_skipped, tiles_reused)
    }

    /// Cosine of the angle of incidence, (rows, columns); 0 where nothing was hit.
    #[pyo3(signature = (*, threads=None))]
    fn cos_incidence<'py>(&self, py: Python<'py>, threads: Option<usize>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        check_threads(threads)?;
        if let Some(cosine) = &self.0.hits.cosine {
            return self.image(PyArray1::from_slice(py, cosine));
        }
        let smooth = compute(py, threads, None, |cancel| self.0.smooth(cancel))?;
        self.image(PyArray1::from_slice(py, &smooth.cosine))
    }

    /// Distance along the ray to the curved surface that the triangles approximate [m], (rows, columns), and the unit
    /// normal towards the sensor, (rows, columns, 3); inf and 0 where nothing was hit.
    #[pyo3(signature = (*, threads=None))]
    fn smooth<'py>(&self, py: Python<'py>, threads: Option<usize>) -> PyResult<SmoothArrays<'py>> {
        let smooth = compute(py, threads, None, |cancel| self.0.smooth(cancel))?;
        let plane = &self.0.hits.plane;
        let normals = smooth.normal.iter().flat_map(DVec3::to_array);
        Ok((
            self.image(PyArray1::from_slice(py, &smooth.distance))?,
            PyArray1::from_iter(py, normals).reshape([plane.rows, plane.columns, 3])?,
        ))
    }

    /// Power reflectance of the materials, one per body, at the angles of the pixels, (rows, columns); 0 where nothing
    /// was hit.
    #[pyo3(signature = (materials, *, frequency, polarization=None, threads=None))]
    fn reflectance<'py>(
        &self,
        py: Python<'py>,
        materials: Vec<PyRef<'_, Material>>,
        frequency: f64,
        polarization: Option<[f64; 3]>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let materials = self::materials(&materials, self.0.scene.num_bodies())?;
        let polarization = polarization.map(DVec3::from_array);
        let reflectance = compute(py, threads, None, |cancel| {
            let smooth = || self.0.smooth(cancel);
            reflectance::reflectance(&self.0.hits, &materials, frequency, polarization, smooth, cancel)
        })?;
        self.image(reflectance.into_pyarray(py))
    }

    /// Number of the body, (rows, columns); -1 where nothing was hit.
    fn body<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        const { assert!(NO_BODY.cast_signed() == -1) };
        let numbers: Vec<i32> = self.0.hits.body.iter().map(|body| body.cast_signed()).collect();
        self.image(numbers.into_pyarray(py))
    }

    /// Unit directions of the rays in the sensor frame, (rows, columns, 3).
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let plane = &self.0.hits.plane;
        let pixels = (0..plane.rows).flat_map(|row| (0..plane.columns).map(move |column| (row, column)));
        let numbers = pixels.flat_map(|(row, column)| plane.direction(row, column).to_array());
        PyArray1::from_iter(py, numbers).reshape([plane.rows, plane.columns, 3])
    }
}

impl Hits {
    fn image<'py, T: numpy::Element>(&self, pixels: Bound<'py, PyArray1<T>>) -> PyResult<Bound<'py, PyArray2<T>>> {
        pixels.reshape([self.0.hits.plane.rows, self.0.hits.plane.columns])
    }
}
