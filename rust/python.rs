//! The boundary to Python: borrow arrays in, release the interpreter, move arrays out. No arithmetic here.

// Python hands arguments over by value, one by one.
#![allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyReadonlyArray4, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::antenna::{Array, Pattern};
use crate::beat;
use crate::chirp::Waveform;
use crate::delay::{Basis, PathSeries};
use crate::error::{Error, Result};
use crate::material::Material;
use crate::mesh::{Obj, read_obj};
use crate::motion::Pose;
use crate::rays::ImagePlane;
use crate::scatter::{self, Points, Sampling};
use crate::surface::{self, ShadingMode};
use crate::trace::{self, NO_BODY, Snapshot};

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(load_obj, module)?)?;
    module.add_function(wrap_pyfunction!(beat_signal, module)?)?;
    module.add_class::<Surface>()?;
    module.add_class::<Scene>()?;
    module.add_class::<Hits>()?;
    module.add_class::<Samples>()?;
    Ok(())
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match &error {
            Error::Value(_) | Error::Format { .. } => PyValueError::new_err(error.to_string()),
            Error::Io { path, source } => match source.raw_os_error() {
                // Python picks the subclass (FileNotFoundError, ...) by the number.
                Some(code) => PyOSError::new_err((code, source.to_string(), path.clone())),
                None => PyOSError::new_err(error.to_string()),
            },
        }
    }
}

/// Run without the interpreter, on a pool of `threads` threads or on the common pool of all cores.
fn compute<T: Send>(py: Python<'_>, threads: Option<usize>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    py.detach(|| match threads {
        None => work().map_err(PyErr::from),
        Some(0) => Err(PyValueError::new_err("threads: expected at least 1, got 0")),
        Some(num) => rayon::ThreadPoolBuilder::new()
            .num_threads(num)
            .build()
            .map_err(|error| PyRuntimeError::new_err(format!("threads: {num} cannot be started: {error}")))?
            .install(work)
            .map_err(PyErr::from),
    })
}

type ObjArrays<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<u32>>,
    Vec<(Bound<'py, PyArray1<u32>>, Vec<String>)>,
);

/// Vertices, triangles and, for objects, groups and materials, the number per triangle and the names.
#[pyfunction]
fn load_obj(py: Python<'_>, path: PathBuf) -> PyResult<ObjArrays<'_>> {
    let Obj {
        vertices,
        triangles,
        object,
        group,
        material,
        object_names,
        group_names,
        material_names,
    } = compute(py, None, || read_obj(&path))?;
    let parts = [(object, object_names), (group, group_names), (material, material_names)];
    let parts = parts
        .into_iter()
        .map(|(numbers, names)| (numbers.into_pyarray(py), names))
        .collect();
    Ok((matrix(py, vertices)?, matrix(py, triangles)?, parts))
}

/// Beat samples `(channel, chirp, sample)` of paths given as `(term, channel, path)`.
#[pyfunction(signature = (
    delay, amplitude, *, is_chebyshev, start_frequency, slope, sample_rate, adc_delay, num_samples, chirp_times,
    threads=None
))]
fn beat_signal<'py>(
    py: Python<'py>,
    delay: PyReadonlyArray3<'py, f64>,
    amplitude: PyReadonlyArray3<'py, Complex64>,
    is_chebyshev: bool,
    start_frequency: f64,
    slope: f64,
    sample_rate: f64,
    adc_delay: f64,
    num_samples: usize,
    chirp_times: PyReadonlyArray1<'py, f64>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray3<Complex64>>> {
    let chirp_times = chirp_times.as_slice()?.to_vec();
    let num_chirps = chirp_times.len();
    let waveform = Waveform {
        start_frequency,
        slope,
        sample_rate,
        adc_delay,
        num_samples,
        chirp_times,
    };
    let [num_delay_terms, num_channels, num_paths] = *delay.shape() else {
        unreachable!("three axes")
    };
    let series = PathSeries {
        basis: if is_chebyshev { Basis::Chebyshev } else { Basis::Taylor },
        delay: delay.as_slice()?,
        num_delay_terms,
        amplitude: amplitude.as_slice()?,
        num_amplitude_terms: amplitude.shape()[0],
        num_channels,
        num_paths,
    };
    let samples = compute(py, threads, || beat::beat_signal(&waveform, &series))?;
    samples
        .into_pyarray(py)
        .reshape([num_channels, num_chirps, num_samples])
}

/// Triangles, tree and shading of one body.
#[pyclass(frozen, module = "radarcore._core")]
struct Surface(Arc<surface::Surface>);

#[pymethods]
impl Surface {
    #[new]
    #[pyo3(signature = (vertices, triangles, *, crease_angle=None))]
    fn new(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        triangles: PyReadonlyArray2<'_, u32>,
        crease_angle: Option<f64>,
    ) -> PyResult<Self> {
        let vertices = points("vertices", vertices.as_slice()?)?;
        let triangles = rows::<3, u32>("triangles", triangles.as_slice()?)?;
        let mode = crease_angle.map_or(ShadingMode::Flat, |crease_angle| ShadingMode::Smooth { crease_angle });
        let surface = compute(py, None, || surface::Surface::new(&vertices, &triangles, mode))?;
        Ok(Self(Arc::new(surface)))
    }

    /// Rows of the triangles that were kept.
    fn kept<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.0.kept())
    }
}

/// Surfaces with materials.
#[pyclass(frozen, module = "radarcore._core")]
struct Scene {
    surfaces: Vec<Arc<surface::Surface>>,
    materials: Vec<Material>,
}

#[pymethods]
impl Scene {
    #[new]
    fn new(
        surfaces: Vec<PyRef<'_, Surface>>,
        reflection: PyReadonlyArray1<'_, Complex64>,
        albedo: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        let (reflection, albedo) = (reflection.as_slice()?, albedo.as_slice()?);
        same_length("reflection", reflection.len(), surfaces.len())?;
        same_length("albedo", albedo.len(), surfaces.len())?;
        let materials = reflection
            .iter()
            .zip(albedo)
            .map(|(&reflection, &albedo)| Material { reflection, albedo });
        Ok(Self {
            surfaces: surfaces.iter().map(|s| s.0.clone()).collect(),
            materials: materials.collect(),
        })
    }

    /// Cast the rays of an image with the bodies at `poses` (body, 3, 4), body to sensor.
    #[pyo3(signature = (poses, *, rows, columns, half_width, half_height, threads=None))]
    fn cast(
        &self,
        py: Python<'_>,
        poses: PyReadonlyArray3<'_, f64>,
        rows: usize,
        columns: usize,
        half_width: f64,
        half_height: f64,
        threads: Option<usize>,
    ) -> PyResult<Hits> {
        let poses = self::poses(poses.as_slice()?)?;
        same_length("poses", poses.len(), self.surfaces.len())?;
        let plane = ImagePlane {
            rows,
            columns,
            half_width,
            half_height,
        };
        let surfaces = self.surfaces.clone();
        let (snapshot, hits) = compute(py, threads, || {
            let snapshot = Snapshot::new(surfaces, poses);
            let hits = snapshot.cast_image(&plane)?;
            Ok((snapshot, hits))
        })?;
        Ok(Hits {
            snapshot,
            rays: hits,
            materials: self.materials.clone(),
        })
    }
}

/// What the rays of an image hit.
#[pyclass(frozen, module = "radarcore._core")]
struct Hits {
    snapshot: Snapshot,
    rays: trace::Hits,
    materials: Vec<Material>,
}

#[pymethods]
impl Hits {
    /// Distance along the ray [m], (rows, columns); inf where nothing was hit.
    fn distance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.image(PyArray1::from_slice(py, &self.rays.distance))
    }

    /// Cosine of the angle of incidence, (rows, columns); 0 where nothing was hit.
    #[pyo3(signature = (*, threads=None))]
    fn cos_incidence<'py>(&self, py: Python<'py>, threads: Option<usize>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let cosines = compute(py, threads, || Ok(scatter::cos_incidence(&self.snapshot, &self.rays)))?;
        self.image(cosines.into_pyarray(py))
    }

    /// Power reflectance of the material, (rows, columns); 0 where nothing was hit.
    fn reflectance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let of = |body: &u32| self.materials.get(*body as usize).map_or(0.0, Material::reflectance);
        self.image(PyArray1::from_iter(py, self.rays.body.iter().map(of)))
    }

    /// Number of the body, (rows, columns); -1 where nothing was hit.
    fn body<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let number = |body: &u32| if *body == NO_BODY { -1 } else { (*body).cast_signed() };
        self.image(PyArray1::from_iter(py, self.rays.body.iter().map(number)))
    }

    /// Unit directions of the rays in the sensor frame, (rows, columns, 3).
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let plane = &self.rays.plane;
        let pixels = (0..plane.rows).flat_map(|row| (0..plane.columns).map(move |column| (row, column)));
        let numbers = pixels.flat_map(|(row, column)| plane.direction(row, column).to_array());
        PyArray1::from_iter(py, numbers).reshape([plane.rows, plane.columns, 3])
    }

    /// Material points of all hits that send anything back.
    #[pyo3(signature = (*, tx, rx, pattern, power, frequency, is_footprint, seed, threads=None))]
    fn samples(
        &self,
        py: Python<'_>,
        tx: PyReadonlyArray2<'_, f64>,
        rx: PyReadonlyArray2<'_, f64>,
        pattern: (f64, f64, f64),
        power: f64,
        frequency: f64,
        is_footprint: bool,
        seed: u64,
        threads: Option<usize>,
    ) -> PyResult<Samples> {
        let (peak, azimuth, elevation) = pattern;
        let array = Array {
            tx: points("tx", tx.as_slice()?)?,
            rx: points("rx", rx.as_slice()?)?,
            pattern: Pattern {
                peak,
                azimuth,
                elevation,
            },
            power,
            frequency,
        };
        let sampling = if is_footprint {
            Sampling::Footprint
        } else {
            Sampling::Point
        };
        let samples = compute(py, threads, || {
            Ok(scatter::Samples::new(
                &self.snapshot,
                &self.rays,
                &self.materials,
                array,
                sampling,
                seed,
            ))
        })?;
        Ok(Samples {
            samples,
            num_bodies: self.snapshot.num_bodies(),
        })
    }
}

impl Hits {
    fn image<'py, T: numpy::Element>(&self, pixels: Bound<'py, PyArray1<T>>) -> PyResult<Bound<'py, PyArray2<T>>> {
        pixels.reshape([self.rays.plane.rows, self.rays.plane.columns])
    }
}

/// Material points; delays and amplitudes follow from where their bodies are.
#[pyclass(frozen, module = "radarcore._core")]
struct Samples {
    samples: scatter::Samples,
    num_bodies: usize,
}

type PathArrays<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray3<Complex64>>);

#[pymethods]
impl Samples {
    fn __len__(&self) -> usize {
        self.samples.len()
    }

    /// Number of the body of every material point.
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.samples.bodies())
    }

    /// Flat pixel number of every material point.
    fn pixel<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.samples.pixels())
    }

    /// Delay [s] and amplitude [sqrt(W)], (node, channel, path): first the material points with their bodies at
    /// `poses` (node, body, 3, 4), then the point targets at `points` (node, point, 3).
    #[pyo3(signature = (poses, points, rcs, *, threads=None))]
    fn paths<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray4<'py, f64>,
        points: PyReadonlyArray3<'py, f64>,
        rcs: PyReadonlyArray1<'py, f64>,
        threads: Option<usize>,
    ) -> PyResult<PathArrays<'py>> {
        let (num_nodes, rcs) = (poses.shape()[0], rcs.as_slice()?);
        let poses = self::poses(poses.as_slice()?)?;
        let position = self::points("points", points.as_slice()?)?;
        same_length("poses", poses.len(), num_nodes * self.num_bodies)?;
        same_length("points", position.len(), num_nodes * rcs.len())?;
        let paths = compute(py, threads, || {
            Ok(self.samples.paths(
                &poses,
                self.num_bodies,
                num_nodes,
                &Points {
                    position: &position,
                    rcs,
                },
            ))
        })?;
        let shape = [num_nodes, self.samples.num_channels(), self.samples.len() + rcs.len()];
        Ok((
            paths.delay.into_pyarray(py).reshape(shape)?,
            paths.amplitude.into_pyarray(py).reshape(shape)?,
        ))
    }

    /// Rate of every delay [s/s], (channel, path), from poses and points and their time derivatives.
    #[pyo3(signature = (poses, pose_rates, points, point_rates, *, threads=None))]
    fn delay_rates<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray3<'py, f64>,
        pose_rates: PyReadonlyArray3<'py, f64>,
        points: PyReadonlyArray2<'py, f64>,
        point_rates: PyReadonlyArray2<'py, f64>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (poses, pose_rates) = (self::poses(poses.as_slice()?)?, self::poses(pose_rates.as_slice()?)?);
        let position = self::points("points", points.as_slice()?)?;
        let velocity = self::points("point_rates", point_rates.as_slice()?)?;
        same_length("poses", poses.len(), self.num_bodies)?;
        same_length("pose_rates", pose_rates.len(), self.num_bodies)?;
        same_length("point_rates", velocity.len(), position.len())?;
        let shape = [self.samples.num_channels(), self.samples.len() + position.len()];
        let rates = compute(py, threads, || {
            Ok(self.samples.delay_rates(&poses, &pose_rates, &position, &velocity))
        })?;
        rates.into_pyarray(py).reshape(shape)
    }
}

/// Rows of N numbers.
fn rows<const N: usize, T: Copy>(name: &str, numbers: &[T]) -> Result<Vec<[T; N]>> {
    let (rows, rest) = numbers.as_chunks::<N>();
    if rest.is_empty() {
        Ok(rows.to_vec())
    } else {
        Err(Error::value(
            name,
            format!("rows of {N} numbers"),
            format!("{} numbers", numbers.len()),
        ))
    }
}

fn points(name: &str, numbers: &[f64]) -> Result<Vec<DVec3>> {
    Ok(rows::<3, f64>(name, numbers)?.into_iter().map(DVec3::from).collect())
}

fn poses(numbers: &[f64]) -> Result<Vec<Pose>> {
    Ok(rows::<12, f64>("poses", numbers)?.iter().map(Pose::from_rows).collect())
}

fn same_length(name: &str, got: usize, expected: usize) -> Result<()> {
    if got == expected {
        Ok(())
    } else {
        Err(Error::value(name, format!("{expected} entries"), got))
    }
}

fn matrix<T: numpy::Element>(py: Python<'_>, rows: Vec<[T; 3]>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let shape = [rows.len(), 3];
    rows.into_flattened().into_pyarray(py).reshape(shape)
}
