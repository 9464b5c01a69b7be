//! The boundary to Python: borrow arrays in, release the interpreter, move arrays out. No arithmetic here.

// Python hands arguments over by value, one by one.
#![allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]

use std::num::NonZero;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use glam::DVec3;
use num_complex::Complex64;
use numpy::ndarray::Dimension;
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray, PyReadonlyArray1,
    PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyMemoryError, PyOSError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::antennas::array::Array;
use crate::antennas::beam::Beam;
use crate::antennas::gain_table::Table;
use crate::antennas::pattern;
use crate::antennas::polarization::Seen;
use crate::bounces::Limits;
use crate::error::{Error, Result};
use crate::geometry::obj::{Obj, read_obj};
use crate::geometry::pose::Pose;
use crate::numeric::simd::Level;
use crate::paths::kinematics::Places;
use crate::paths::scatterers;
use crate::paths::series::Selection;
use crate::rays::camera::ImagePlane;
use crate::rays::image::{self, Cast};
use crate::rays::scene::{NO_BODY, Snapshot};
use crate::rays::smooth_hits::Shown;
use crate::rays::surface::{self, ShadingMode};
use crate::scattering::depth_image::Surfels;
use crate::scattering::material::{self, Dielectric, Response, Roughness};
use crate::scattering::physical_optics::Sampling;
use crate::scattering::samples;
use crate::scattering::sampling::{Leaf, Rule};
use crate::scattering::{patch, reflectance};
use crate::synthesis::beat;
use crate::synthesis::chirp;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::plan::{Method, Step};

mod bounces;

use bounces::Bounces;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(load_obj, module)?)?;
    module.add_function(wrap_pyfunction!(beat_signal, module)?)?;
    module.add_function(wrap_pyfunction!(plan_beat_signal, module)?)?;
    module.add_function(wrap_pyfunction!(levels, module)?)?;
    module.add_function(wrap_pyfunction!(image_scatterers, module)?)?;
    module.add_function(wrap_pyfunction!(bounces::cross_sections, module)?)?;
    module.add_class::<Waveform>()?;
    module.add_class::<Report>()?;
    module.add_class::<Surface>()?;
    module.add_class::<Material>()?;
    module.add_class::<Pattern>()?;
    module.add_class::<Antennas>()?;
    module.add_class::<Scene>()?;
    module.add_class::<Hits>()?;
    module.add_class::<Samples>()?;
    module.add_class::<Scatterers>()?;
    module.add_class::<Bounces>()?;
    Ok(())
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match &error {
            Error::Value(_) | Error::Format { .. } => PyValueError::new_err(error.to_string()),
            Error::Memory(_) => PyMemoryError::new_err(error.to_string()),
            Error::Io { path, source } => match source.raw_os_error() {
                // Python picks the subclass (FileNotFoundError, ...) by the number.
                Some(code) => {
                    let text = source.to_string();
                    let reason = text.strip_suffix(&format!(" (os error {code})")).unwrap_or(&text);
                    PyOSError::new_err((code, reason.to_owned(), path.display().to_string()))
                }
                None => PyOSError::new_err(error.to_string()),
            },
        }
    }
}

/// Most threads of a pool.
const MAX_THREADS: usize = 1024;

/// Pools of threads by their number, and the process they live in: a forked child has none of its parent's threads.
static POOLS: Mutex<(u32, Vec<Arc<ThreadPool>>)> = Mutex::new((0, Vec::new()));

/// Run without the interpreter, on `threads` threads or as many as there are cores.
fn compute<T: Send>(py: Python<'_>, threads: Option<usize>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    let num = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, NonZero::get));
    py.detach(|| pool(num)?.install(work).map_err(PyErr::from))
}

/// Refuses numbers of threads that no pool has.
fn check_threads(threads: Option<usize>) -> Result<()> {
    match threads {
        Some(number) if number == 0 || number > MAX_THREADS => {
            Err(Error::value("threads", format!("1 to {MAX_THREADS}"), number))
        }
        _ => Ok(()),
    }
}

/// The pool with this number of threads; the last few are kept.
fn pool(num_threads: usize) -> PyResult<Arc<ThreadPool>> {
    const MAX_KEPT: usize = 4;
    check_threads(Some(num_threads))?;
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if pools.0 != process {
        // Dropping the parent's pools would wait for threads that are not here.
        std::mem::forget(std::mem::take(&mut pools.1));
        pools.0 = process;
    }
    if let Some(pool) = pools.1.iter().find(|pool| pool.current_num_threads() == num_threads) {
        return Ok(pool.clone());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(num_threads)
        .build()
        .map_err(|error| PyRuntimeError::new_err(format!("threads: {num_threads} cannot be started: {error}")))?;
    if pools.1.len() == MAX_KEPT {
        pools.1.remove(0);
    }
    pools.1.push(Arc::new(pool));
    Ok(pools.1[pools.1.len() - 1].clone())
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

/// Times and frequencies of a frame.
#[pyclass(frozen, module = "radarcore._core")]
struct Waveform(chirp::Waveform);

#[pymethods]
impl Waveform {
    #[new]
    #[pyo3(signature = (*, start_frequency, slope, sample_rate, adc_delay, num_samples, chirp_times))]
    fn new(
        start_frequency: f64,
        slope: f64,
        sample_rate: f64,
        adc_delay: f64,
        num_samples: usize,
        chirp_times: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        let waveform = chirp::Waveform {
            start_frequency,
            slope,
            sample_rate,
            adc_delay,
            num_samples,
            chirp_times: numbers("chirp_times", &chirp_times, [None])?.to_vec(),
        };
        waveform.check()?;
        Ok(Self(waveform))
    }
}

/// Paths as arrays (path,), (channel, path) or, at nodes, (node, channel, path).
struct PathArrays<'py> {
    basis: Basis,
    delay: Vec<PyReadonlyArrayDyn<'py, f64>>,
    amplitude: PyReadonlyArrayDyn<'py, Complex64>,
    num_channels: usize,
    num_paths: usize,
}

impl<'py> PathArrays<'py> {
    /// Refuses shapes that do not fit together.
    fn new(
        delay: PyReadonlyArrayDyn<'py, f64>,
        amplitude: PyReadonlyArrayDyn<'py, Complex64>,
        delay_rate: Option<PyReadonlyArrayDyn<'py, f64>>,
        delay_acceleration: Option<PyReadonlyArrayDyn<'py, f64>>,
    ) -> Result<Self> {
        let shape = delay.shape().to_vec();
        let (num_channels, num_paths) = match shape[..] {
            [paths] => (1, paths),
            [channels, paths] | [_, channels, paths] => (channels, paths),
            _ => return Err(Error::value("delay", "one to three axes", format!("{shape:?}"))),
        };
        let is_nodal = shape.len() == 3;
        if is_nodal && shape[0] == 0 {
            return Err(Error::value("delay", "1 to 4096 nodes", 0));
        }
        let of_amplitudes = amplitude.shape();
        let expected = if is_nodal { &shape[1..] } else { &shape[..] };
        let fits = match of_amplitudes {
            [nodes, rest @ ..] if is_nodal && rest.len() == 2 => *nodes > 0 && rest == expected,
            _ => of_amplitudes == expected,
        };
        if !fits {
            let nodes = if is_nodal { ", or those with nodes in front" } else { "" };
            let got = format!("{of_amplitudes:?}");
            return Err(Error::value("amplitude", format!("shape {expected:?}{nodes}"), got));
        }
        let mut rows = vec![delay];
        for (name, row) in [("delay_rate", &delay_rate), ("delay_acceleration", &delay_acceleration)] {
            if let Some(row) = row
                && (is_nodal || row.shape() != shape)
            {
                let got = format!("{:?}", row.shape());
                return Err(Error::value(
                    name,
                    format!("shape {shape:?} of delays without nodes"),
                    got,
                ));
            }
        }
        if delay_acceleration.is_some() && delay_rate.is_none() {
            return Err(Error::value(
                "delay_rate",
                "one together with delay_acceleration",
                "none",
            ));
        }
        rows.extend(delay_rate);
        rows.extend(delay_acceleration);
        Ok(Self {
            basis: if is_nodal { Basis::Chebyshev } else { Basis::Taylor },
            delay: rows,
            amplitude,
            num_channels,
            num_paths,
        })
    }

    /// Run something with the series of these paths.
    fn with_series<T>(&self, run: impl FnOnce(&PathSeries) -> PyResult<T>) -> PyResult<T> {
        let plane = (self.num_channels * self.num_paths).max(1);
        let mut delay: Vec<&[f64]> = Vec::new();
        for row in &self.delay {
            delay.extend(contiguous("delay", row)?.chunks(plane));
        }
        let mut amplitude: Vec<&[Complex64]> = contiguous("amplitude", &self.amplitude)?.chunks(plane).collect();
        // No paths leave no rows.
        if delay.is_empty() || amplitude.is_empty() {
            (delay, amplitude) = (vec![&[][..]], vec![&[][..]]);
        }
        run(&PathSeries {
            basis: self.basis,
            delay: &delay,
            amplitude: &amplitude,
            num_channels: self.num_channels,
            num_paths: self.num_paths,
        })
    }
}

/// The numbers of an array of any number of axes.
fn contiguous<'a, T: Element>(name: &str, array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<&'a [T]> {
    match array.as_slice() {
        Ok(numbers) if array.is_c_contiguous() => Ok(numbers),
        _ => Err(PyTypeError::new_err(format!("{name}: expected a C-contiguous array"))),
    }
}

/// How to sum, from Python's words.
fn options(
    tolerance: f64,
    method: &str,
    level: Option<&str>,
    split_still: bool,
    skip_rows: bool,
    is_parallel: bool,
) -> Result<beat::Options> {
    let method = match method {
        "auto" => Method::Auto,
        "direct" => Method::Direct,
        "grid" => Method::Grid,
        "recurrence" => Method::Recurrence,
        "lanes" => Method::Lanes,
        _ => {
            let expected = "'auto', 'direct', 'grid', 'recurrence' or 'lanes'";
            return Err(Error::value("method", expected, format!("{method:?}")));
        }
    };
    let levels = Level::available();
    let level = match level {
        None => Level::best(),
        Some(name) => *levels.iter().find(|level| level.name() == name).ok_or_else(|| {
            let names: Vec<&str> = levels.iter().map(|level| level.name()).collect();
            Error::value("level", format!("one of {names:?}"), name)
        })?,
    };
    Ok(beat::Options {
        tolerance,
        method,
        level,
        is_parallel,
        split_still,
        skip_rows,
    })
}

/// Path-samples that are summed before a thread of a pool would have woken up.
const SMALL_SUM: usize = 1 << 21;

/// Beat samples (channel, chirp, sample) of paths, and what was done.
#[pyfunction(signature = (
    delay, amplitude, delay_rate=None, delay_acceleration=None, *, waveform, tolerance, method, threads=None, level=None,
    split_still=true, skip_rows=true
))]
fn beat_signal<'py>(
    py: Python<'py>,
    delay: PyReadonlyArrayDyn<'py, f64>,
    amplitude: PyReadonlyArrayDyn<'py, Complex64>,
    delay_rate: Option<PyReadonlyArrayDyn<'py, f64>>,
    delay_acceleration: Option<PyReadonlyArrayDyn<'py, f64>>,
    waveform: PyRef<'py, Waveform>,
    tolerance: f64,
    method: &str,
    threads: Option<usize>,
    level: Option<&str>,
    split_still: bool,
    skip_rows: bool,
) -> PyResult<(Bound<'py, PyAny>, Report)> {
    check_threads(threads)?;
    let paths = PathArrays::new(delay, amplitude, delay_rate, delay_acceleration)?;
    let waveform = &waveform.0;
    let (num_chirps, num_samples) = (waveform.chirp_times.len(), waveform.num_samples);
    let work = [paths.num_channels, paths.num_paths, num_chirps, num_samples];
    let is_small = work
        .iter()
        .try_fold(1_usize, |product, n| product.checked_mul(*n))
        .is_some_and(|n| n < SMALL_SUM);
    let is_parallel = threads != Some(1) && !is_small;
    let options = options(tolerance, method, level, split_still, skip_rows, is_parallel)?;
    let (samples, report) = paths.with_series(|series| {
        let sum = || beat::beat_signal(waveform, series, &options);
        if is_parallel {
            compute(py, threads, sum)
        } else {
            py.detach(|| sum().map_err(PyErr::from))
        }
    })?;
    let shape = [paths.num_channels, num_chirps, num_samples];
    let samples = match samples {
        beat::Samples::Single(samples) => samples.into_pyarray(py).reshape(shape)?.into_any(),
        beat::Samples::Double(samples) => samples.into_pyarray(py).reshape(shape)?.into_any(),
    };
    Ok((samples, Report(report)))
}

/// What `beat_signal` would do.
#[pyfunction(signature = (
    delay, amplitude, delay_rate=None, delay_acceleration=None, *, waveform, tolerance, method, threads=None, level=None,
    split_still=true, skip_rows=true
))]
fn plan_beat_signal<'py>(
    py: Python<'py>,
    delay: PyReadonlyArrayDyn<'py, f64>,
    amplitude: PyReadonlyArrayDyn<'py, Complex64>,
    delay_rate: Option<PyReadonlyArrayDyn<'py, f64>>,
    delay_acceleration: Option<PyReadonlyArrayDyn<'py, f64>>,
    waveform: PyRef<'py, Waveform>,
    tolerance: f64,
    method: &str,
    threads: Option<usize>,
    level: Option<&str>,
    split_still: bool,
    skip_rows: bool,
) -> PyResult<Report> {
    let paths = PathArrays::new(delay, amplitude, delay_rate, delay_acceleration)?;
    let options = options(tolerance, method, level, split_still, skip_rows, true)?;
    let waveform = &waveform.0;
    let plan = paths.with_series(|series| compute(py, threads, || beat::plan(waveform, series, &options)))?;
    Ok(Report(beat::Report {
        plan,
        ..beat::Report::default()
    }))
}

/// See `Report::parts`.
type PlanPart = (String, usize, String, String, usize, Vec<usize>, Vec<usize>, f64, usize);

/// What is done with which paths.
#[pyclass(frozen, module = "radarcore._core")]
struct Report(beat::Report);

#[pymethods]
impl Report {
    /// One line per class of paths.
    fn __str__(&self) -> String {
        self.0.plan.to_string()
    }

    /// Predicted error of the plan, relative to l2(amplitudes).
    #[getter]
    fn error(&self) -> f64 {
        self.0.plan.error()
    }

    /// Memory beside input and result [bytes].
    #[getter]
    fn memory(&self) -> usize {
        self.0.plan.memory()
    }

    /// Velocity rows that were transformed.
    #[getter]
    fn rows(&self) -> usize {
        self.0.rows
    }

    /// Velocity rows that no path had touched.
    #[getter]
    fn rows_skipped(&self) -> usize {
        self.0.rows_skipped
    }

    /// How many plans were run: more than one where paths add up in phase, or differ from the samples.
    #[getter]
    fn runs(&self) -> usize {
        self.0.runs
    }

    /// Largest rms of the samples of a channel relative to its l2(amplitudes).
    #[getter]
    fn gain(&self) -> f64 {
        self.0.gain
    }

    /// Per class of paths: its name, number of paths, method, precision, width of the kernel (0: none), velocity rows per
    /// block, terms per block, predicted error, and memory [bytes].
    fn parts(&self) -> Vec<PlanPart> {
        let parts = self.0.plan.parts.iter().map(|part| {
            let (rows, terms) = match &part.step {
                Step::Grid { expansions, .. } => (
                    expansions.iter().map(|e| e.rows).collect(),
                    expansions.iter().map(|e| e.modes.num_sets()).collect(),
                ),
                _ => (Vec::new(), Vec::new()),
            };
            (
                part.class.name().to_owned(),
                part.num_paths,
                part.step.name().to_owned(),
                if part.step.is_single() { "single" } else { "double" }.to_owned(),
                part.step.width().unwrap_or(0),
                rows,
                terms,
                part.error,
                part.memory,
            )
        });
        parts.collect()
    }
}

/// Names of the instruction sets that this processor has, slowest first.
#[pyfunction]
fn levels() -> Vec<&'static str> {
    Level::available().into_iter().map(Level::name).collect()
}

/// Triangles, tree and shading of one body.
#[pyclass(frozen, module = "radarcore._core")]
struct Surface(Arc<surface::Surface>);

#[pymethods]
impl Surface {
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
        let tell = |share: f64| {
            if let Some(report) = &report {
                Python::attach(|py| {
                    if let Err(error) = report.call1(py, (share,)) {
                        error.write_unraisable(py, Some(report.bind(py)));
                    }
                });
            }
        };
        let surface = compute(py, None, || {
            surface::Surface::new_with(&vertices, &triangles, mode, &tell)
        })?;
        Ok(Self(Arc::new(surface)))
    }

    /// Rows of the triangles that were kept; none where all were.
    fn kept<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<u32>>> {
        self.0.kept().map(|kept| PyArray1::from_slice(py, kept))
    }

    /// The same triangles between vertices (n, 3) at other places.
    #[pyo3(signature = (vertices, *, threads=None))]
    fn deform(&self, py: Python<'_>, vertices: PyReadonlyArray2<'_, f64>, threads: Option<usize>) -> PyResult<Self> {
        let vertices = points(numbers("vertices", &vertices, [None, Some(3)])?);
        let surface = compute(py, threads, || self.0.deform(vertices))?;
        Ok(Self(Arc::new(surface)))
    }

    /// What the mesh is good for, if facets that meet below the crease angle [rad] stand for a curved surface, at a
    /// wavelength [m]: numbers of parts, of open, non-manifold and inconsistent edges, of doubled and of thin triangles; area
    /// and smooth area [m^2], largest and mean sagitta [m], largest and rms difference of the echoes of flat facets.
    #[pyo3(signature = (*, crease_angle, wavelength, threads=None))]
    fn quality(
        &self,
        py: Python<'_>,
        crease_angle: f64,
        wavelength: f64,
        threads: Option<usize>,
    ) -> PyResult<([usize; 6], [f64; 6])> {
        let q = compute(py, threads, || Ok(self.0.quality(crease_angle, wavelength)))?;
        let counts = [
            q.num_parts,
            q.num_open_edges,
            q.num_nonmanifold_edges,
            q.num_inconsistent_edges,
            q.num_duplicates,
            q.num_thin,
        ];
        let measures = [
            q.area,
            q.smooth_area,
            q.largest_sagitta,
            q.mean_sagitta,
            q.largest_difference,
            q.rms_difference,
        ];
        Ok((counts, measures))
    }

    /// Memory of triangles, tree and shading, and of the vertices [bytes].
    #[getter]
    fn memory(&self) -> (usize, usize) {
        (self.0.memory(), self.0.vertex_memory())
    }
}

/// What a surface does to waves of one frequency.
#[pyclass(frozen, module = "radarcore._core")]
struct Material(material::Material);

#[pymethods]
impl Material {
    /// The same at every angle; the field reflection coefficient as (real, imaginary).
    #[staticmethod]
    fn constant(reflection: (f64, f64), albedo: f64) -> Self {
        Self(material::Material::Constant(Response {
            reflection: Complex64::new(reflection.0, reflection.1),
            albedo,
        }))
    }

    /// What Fresnel says of a relative permittivity (real, imaginary), of a half-space or a slab of some thickness [m].
    /// `roughness`: rms height [m], none for a smooth surface; or `scattering`: the part of the field that is scattered.
    #[staticmethod]
    #[pyo3(signature = (permittivity, *, roughness=None, scattering=None, thickness=None))]
    fn dielectric(
        permittivity: (f64, f64),
        roughness: Option<f64>,
        scattering: Option<f64>,
        thickness: Option<f64>,
    ) -> PyResult<Self> {
        let roughness = match (roughness, scattering) {
            (None, None) => Roughness::Smooth,
            (Some(height), None) => Roughness::Height(height),
            (None, Some(part)) => Roughness::Scattering(part),
            (Some(_), Some(_)) => return Err(Error::value("scattering", "none with roughness", "both").into()),
        };
        Ok(Self(material::Material::Dielectric(Dielectric {
            permittivity: Complex64::new(permittivity.0, permittivity.1),
            thickness,
            roughness,
        })))
    }

    /// Field reflection coefficients and albedos at cosines of incidence (n,), as antennas see them that get the parts
    /// `te` and `tm` of both polarisations.
    #[pyo3(signature = (cosine, *, wavelength, te, tm))]
    fn response<'py>(
        &self,
        py: Python<'py>,
        cosine: PyReadonlyArray1<'_, f64>,
        wavelength: f64,
        te: f64,
        tm: f64,
    ) -> PyResult<ResponseArrays<'py>> {
        let cosines = numbers("cosine", &cosine, [None])?.iter();
        let of = |cosine: &f64| self.0.response(*cosine, wavelength, Seen { te, tm });
        let (reflection, albedo): (Vec<_>, Vec<_>) = cosines.map(of).map(|r| (r.reflection, r.albedo)).unzip();
        Ok((reflection.into_pyarray(py), albedo.into_pyarray(py)))
    }
}

type ResponseArrays<'py> = (Bound<'py, PyArray1<Complex64>>, Bound<'py, PyArray1<f64>>);

/// One material per body.
fn materials(materials: &[PyRef<'_, Material>], num_bodies: usize) -> Result<Vec<material::Material>> {
    if materials.len() != num_bodies {
        let expected = format!("{num_bodies}, one per body");
        return Err(Error::value("materials", expected, materials.len()));
    }
    Ok(materials.iter().map(|material| material.0).collect())
}

/// Power gain of an antenna over directions.
#[pyclass(frozen, module = "radarcore._core")]
struct Pattern(pattern::Pattern);

#[pymethods]
impl Pattern {
    /// `peak exp(-azimuth az^2 - elevation el^2)`, the exponents [1/rad^2]; zero: isotropic.
    #[staticmethod]
    fn gaussian(peak: f64, azimuth: f64, elevation: f64) -> Self {
        Self(pattern::Pattern::Gaussian {
            peak,
            azimuth,
            elevation,
        })
    }

    /// Gains [dB] (azimuth, elevation) at increasing angles [rad], bilinear between them, nothing outside.
    #[staticmethod]
    fn table(
        azimuth: PyReadonlyArray1<'_, f64>,
        elevation: PyReadonlyArray1<'_, f64>,
        gain_db: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let azimuth = numbers("azimuth", &azimuth, [None])?;
        let elevation = numbers("elevation", &elevation, [None])?;
        let gain_db = numbers("gain_db", &gain_db, [Some(azimuth.len()), Some(elevation.len())])?;
        let table = Table::new(azimuth, elevation, gain_db)?;
        Ok(Self(pattern::Pattern::Table(Arc::new(table))))
    }

    /// Power gains at angles (n,) [rad], azimuths within half a turn.
    fn gain<'py>(
        &self,
        py: Python<'py>,
        azimuth: PyReadonlyArray1<'_, f64>,
        elevation: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let azimuth = numbers("azimuth", &azimuth, [None])?;
        let elevation = numbers("elevation", &elevation, [Some(azimuth.len())])?;
        let pairs = azimuth.iter().zip(elevation);
        Ok(PyArray1::from_iter(py, pairs.map(|(az, el)| self.0.gain_at(*az, *el))))
    }
}

/// Antennas of the sensor.
#[pyclass(frozen, module = "radarcore._core")]
struct Antennas(Array);

#[pymethods]
impl Antennas {
    /// At rows (x, y, z) of the sensor frame, with a pattern each; `polarization`: unit vector along their field.
    #[new]
    #[pyo3(signature = (*, tx, rx, tx_patterns, rx_patterns, power, frequency, polarization=None))]
    fn new(
        tx: PyReadonlyArray2<'_, f64>,
        rx: PyReadonlyArray2<'_, f64>,
        tx_patterns: Vec<PyRef<'_, Pattern>>,
        rx_patterns: Vec<PyRef<'_, Pattern>>,
        power: f64,
        frequency: f64,
        polarization: Option<[f64; 3]>,
    ) -> PyResult<Self> {
        let patterns = |given: Vec<PyRef<'_, Pattern>>| given.iter().map(|pattern| pattern.0.clone()).collect();
        let array = Array {
            tx: points(numbers("tx", &tx, [None, Some(3)])?),
            rx: points(numbers("rx", &rx, [None, Some(3)])?),
            tx_patterns: patterns(tx_patterns),
            rx_patterns: patterns(rx_patterns),
            power,
            frequency,
            polarization: polarization.map(DVec3::from_array),
        };
        array.check()?;
        Ok(Self(array))
    }
}

/// Surfaces.
#[pyclass(frozen, module = "radarcore._core")]
struct Scene {
    surfaces: Vec<Arc<surface::Surface>>,
}

#[pymethods]
impl Scene {
    #[new]
    fn new(surfaces: Vec<PyRef<'_, Surface>>) -> Self {
        Self {
            surfaces: surfaces.iter().map(|s| s.0.clone()).collect(),
        }
    }

    /// Which of `points` (n, 3) in the sensor frame hide behind bodies at `poses` (body, 3, 4), and how many searches ended
    /// at a triangle in the way while there were boxes in front of it: none unless `ends_early`.
    #[pyo3(signature = (poses, points, *, ends_early=true, threads=None))]
    fn hide<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray3<'_, f64>,
        points: PyReadonlyArray2<'_, f64>,
        ends_early: bool,
        threads: Option<usize>,
    ) -> PyResult<(Bound<'py, PyArray1<bool>>, usize)> {
        let poses = self::poses(numbers("poses", &poses, [Some(self.surfaces.len()), Some(3), Some(4)])?);
        let points = self::points(numbers("points", &points, [None, Some(3)])?);
        let hidden = compute(py, threads, || Ok(self.snapshot(&poses).hide(&points, ends_early)))?;
        Ok((hidden.is_hidden.into_pyarray(py), hidden.ended_early))
    }

    /// Cast the rays of an image with the bodies at `poses` (body, 3, 4), body to sensor. `previous` hits of the same scene
    /// are taken over where no body has moved. `beam`, antennas and their least gain of interest there and back relative to
    /// the peaks, and `skip_empty` say which tiles of the image are left out.
    #[pyo3(signature = (
        poses, *, rows, columns, half_width, half_height, previous=None, beam=None, skip_empty=true, with_cosines=false,
        threads=None
    ))]
    fn cast(
        &self,
        py: Python<'_>,
        poses: PyReadonlyArray3<'_, f64>,
        rows: usize,
        columns: usize,
        half_width: f64,
        half_height: f64,
        previous: Option<PyRef<'_, Hits>>,
        beam: Option<(PyRef<'_, Antennas>, f64)>,
        skip_empty: bool,
        with_cosines: bool,
        threads: Option<usize>,
    ) -> PyResult<Hits> {
        let poses = self::poses(numbers("poses", &poses, [Some(self.surfaces.len()), Some(3), Some(4)])?);
        let plane = ImagePlane::centered(rows, columns, half_width, half_height);
        let beam = beam.map(|(antennas, floor)| Beam::new(&antennas.0, floor));
        let cast = Cast {
            beam: beam.as_ref(),
            skip_empty,
            with_cosines,
            previous: previous.as_ref().map(|hits| (&hits.snapshot, &hits.image)),
            ..Cast::default()
        };
        let (snapshot, hits) = compute(py, threads, || {
            let snapshot = self.snapshot(&poses);
            let hits = snapshot.cast_image_with(&plane, &cast)?;
            Ok((snapshot, hits))
        })?;
        Ok(Hits {
            snapshot,
            image: hits,
            shown: OnceLock::new(),
        })
    }

    /// Cast rays where they are needed with the bodies at `poses` (body, 3, 4), body to sensor: through a base grid of `rows`
    /// x `columns` cells, which are split until they leave open less than `rcs_floor` asks for, as far as `budget` rays go.
    /// `end_points`: cells whose phase turns fast stand for their ends.
    /// What was sampled of the same scene before is taken over where no body has moved. `beam` and `skip_empty` as in `cast`.
    #[pyo3(signature = (
        poses, materials, *, rows, columns, half_width, half_height, antennas, rcs_floor, budget=None, end_points, seed,
        previous=None, beam=None, skip_empty=true, threads=None
    ))]
    fn sample(
        &self,
        py: Python<'_>,
        poses: PyReadonlyArray3<'_, f64>,
        materials: Vec<PyRef<'_, Material>>,
        rows: usize,
        columns: usize,
        half_width: f64,
        half_height: f64,
        antennas: PyRef<'_, Antennas>,
        rcs_floor: f64,
        budget: Option<usize>,
        end_points: bool,
        seed: u64,
        previous: Option<PyRef<'_, Samples>>,
        beam: Option<(PyRef<'_, Antennas>, f64)>,
        skip_empty: bool,
        threads: Option<usize>,
    ) -> PyResult<Samples> {
        let poses = self::poses(numbers("poses", &poses, [Some(self.surfaces.len()), Some(3), Some(4)])?);
        let materials = self::materials(&materials, self.surfaces.len())?;
        let array = &antennas.0;
        let rule = Rule {
            base: ImagePlane::centered(rows, columns, half_width, half_height),
            rcs_floor,
            budget,
            end_points,
        };
        let beam = beam.map(|(antennas, floor)| Beam::new(&antennas.0, floor));
        let cast = Cast {
            beam: beam.as_ref(),
            skip_empty,
            ..Cast::default()
        };
        let before = previous.as_ref().map(|before| (&before.snapshot, &before.samples));
        let (snapshot, samples) = compute(py, threads, || {
            let snapshot = self.snapshot(&poses);
            let samples = samples::Samples::new(&snapshot, &cast, &materials, array, &rule, seed, before)?;
            Ok((snapshot, samples))
        })?;
        Ok(Samples { snapshot, samples })
    }
}

/// Snapshots of a scene.
impl Scene {
    fn snapshot(&self, poses: &[Pose]) -> Snapshot {
        Snapshot::new(self.surfaces.clone(), poses.to_vec())
    }
}

type ShadedArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);

/// What the rays of an image hit.
#[pyclass(frozen, module = "radarcore._core")]
struct Hits {
    snapshot: Snapshot,
    image: image::Hits,
    shown: OnceLock<Shown>,
}

#[pymethods]
impl Hits {
    /// Distance along the ray [m], (rows, columns); inf where nothing was hit.
    fn distance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.image(PyArray1::from_slice(py, &self.image.distance))
    }

    /// Rays that were cast, and tiles that were skipped and taken over.
    #[getter]
    fn counts(&self) -> (usize, usize, usize) {
        let image::Counts {
            rays,
            tiles_skipped,
            tiles_reused,
        } = self.image.counts;
        (rays, tiles_skipped, tiles_reused)
    }

    /// Cosine of the angle of incidence, (rows, columns); 0 where nothing was hit.
    #[pyo3(signature = (*, threads=None))]
    fn cos_incidence<'py>(&self, py: Python<'py>, threads: Option<usize>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        check_threads(threads)?;
        if let Some(cosine) = &self.image.cosine {
            return self.image(PyArray1::from_slice(py, cosine));
        }
        let shown = compute(py, threads, || Ok(self.shown()))?;
        self.image(PyArray1::from_slice(py, &shown.cosine))
    }

    /// Distance along the ray to the surface that the facets stand for [m], (rows, columns), and its unit normal
    /// towards the sensor, (rows, columns, 3); inf and 0 where nothing was hit.
    #[pyo3(signature = (*, threads=None))]
    fn shaded<'py>(&self, py: Python<'py>, threads: Option<usize>) -> PyResult<ShadedArrays<'py>> {
        let shown = compute(py, threads, || Ok(self.shown()))?;
        let plane = &self.image.plane;
        let normals = shown.normal.iter().flat_map(DVec3::to_array);
        Ok((
            self.image(PyArray1::from_slice(py, &shown.distance))?,
            PyArray1::from_iter(py, normals).reshape([plane.rows, plane.columns, 3])?,
        ))
    }

    /// Power reflectance of the materials, one per body, at the angles of the pixels, (rows, columns); 0 where nothing was hit.
    #[pyo3(signature = (materials, *, frequency, polarization=None, threads=None))]
    fn reflectance<'py>(
        &self,
        py: Python<'py>,
        materials: Vec<PyRef<'_, Material>>,
        frequency: f64,
        polarization: Option<[f64; 3]>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let materials = self::materials(&materials, self.snapshot.num_bodies())?;
        let polarization = polarization.map(DVec3::from_array);
        let reflectance = compute(py, threads, || {
            let shown = || self.shown();
            Ok(reflectance::reflectance(
                &self.image,
                &materials,
                frequency,
                polarization,
                shown,
            ))
        })?;
        self.image(reflectance.into_pyarray(py))
    }

    /// Number of the body, (rows, columns); -1 where nothing was hit.
    fn body<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        const { assert!(NO_BODY.cast_signed() == -1) };
        let numbers: Vec<i32> = self.image.body.iter().map(|body| body.cast_signed()).collect();
        self.image(numbers.into_pyarray(py))
    }

    /// The vertices of the triangle that a pixel hit and their weights there; the pixel hit something.
    fn place_on_mesh(&self, pixel: usize) -> PyResult<([u32; 3], [f64; 3])> {
        let body = self.image.body.get(pixel).copied().filter(|body| *body != NO_BODY);
        let body = body.ok_or_else(|| Error::value("pixel", "one that hit something", pixel))?;
        let plane = &self.image.plane;
        let cell = plane.cell(pixel / plane.columns, pixel % plane.columns);
        let triangle = self.image.triangle[pixel];
        Ok(patch::place_on_mesh(&self.snapshot, &cell, body, triangle))
    }

    /// Unit direction of the ray of a pixel in the sensor frame.
    fn direction(&self, pixel: usize) -> PyResult<[f64; 3]> {
        let plane = &self.image.plane;
        if pixel >= plane.num_pixels() {
            let expected = format!("a number below {}", plane.num_pixels());
            return Err(Error::value("pixel", expected, pixel).into());
        }
        Ok(plane.direction(pixel / plane.columns, pixel % plane.columns).to_array())
    }

    /// Unit directions of the rays in the sensor frame, (rows, columns, 3).
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let plane = &self.image.plane;
        let pixels = (0..plane.rows).flat_map(|row| (0..plane.columns).map(move |column| (row, column)));
        let numbers = pixels.flat_map(|(row, column)| plane.direction(row, column).to_array());
        PyArray1::from_iter(py, numbers).reshape([plane.rows, plane.columns, 3])
    }

    /// Material points of all hits that send anything back; `materials` has one per body.
    #[pyo3(signature = (materials, *, antennas, is_footprint, seed, threads=None))]
    fn scatterers(
        &self,
        py: Python<'_>,
        materials: Vec<PyRef<'_, Material>>,
        antennas: PyRef<'_, Antennas>,
        is_footprint: bool,
        seed: u64,
        threads: Option<usize>,
    ) -> PyResult<Scatterers> {
        let materials = self::materials(&materials, self.snapshot.num_bodies())?;
        let array = antennas.0.clone();
        let sampling = sampling(is_footprint);
        let scatterers = compute(py, threads, || {
            Ok(scatterers::Scatterers::new(
                &self.snapshot,
                &self.image,
                self.shown(),
                &materials,
                array,
                sampling,
                seed,
            ))
        })?;
        Ok(Scatterers {
            scatterers,
            num_bodies: self.snapshot.num_bodies(),
        })
    }

    /// Routes of two to `max_bounces` reflections of all hits; `materials` has one per body. Tubes end where their power is
    /// less than `floor` of what was launched.
    #[pyo3(signature = (materials, *, antennas, is_footprint, max_bounces, floor, threads=None))]
    fn bounces(
        &self,
        py: Python<'_>,
        materials: Vec<PyRef<'_, Material>>,
        antennas: PyRef<'_, Antennas>,
        is_footprint: bool,
        max_bounces: usize,
        floor: f64,
        threads: Option<usize>,
    ) -> PyResult<Bounces> {
        let limits = Limits { max_bounces, floor };
        let array = antennas.0.clone();
        Bounces::new(py, self, materials, array, is_footprint, limits, threads)
    }
}

impl Hits {
    /// What the pixels show; computed once.
    fn shown(&self) -> &Shown {
        self.shown.get_or_init(|| Shown::new(&self.snapshot, &self.image))
    }

    fn image<'py, T: numpy::Element>(&self, pixels: Bound<'py, PyArray1<T>>) -> PyResult<Bound<'py, PyArray2<T>>> {
        pixels.reshape([self.image.plane.rows, self.image.plane.columns])
    }
}

/// Cells of the image plane, fine where they need to be, and what their rays hit.
#[pyclass(frozen, module = "radarcore._core")]
struct Samples {
    snapshot: Snapshot,
    samples: samples::Samples,
}

#[pymethods]
impl Samples {
    fn __len__(&self) -> usize {
        self.samples.leaves.len()
    }

    /// Rays that were cast, bundles of rays that were skipped and taken over, and cells that could have been split.
    #[getter]
    fn counts(&self) -> (usize, usize, usize, usize) {
        let image::Counts {
            rays,
            tiles_skipped,
            tiles_reused,
        } = self.samples.counts;
        (rays, tiles_skipped, tiles_reused, self.samples.num_coarse())
    }

    /// Centre (u, v) and widths of the cells that hit something, (cell, 4).
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = self
            .samples
            .leaves
            .iter()
            .map(|leaf| leaf.cell)
            .map(|c| [c.u, c.v, c.du, c.dv]);
        matrix(py, rows.collect())
    }

    /// Number of the body that every cell hit, (cell,).
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i32>> {
        PyArray1::from_iter(py, self.samples.leaves.iter().map(|leaf| leaf.found.body.cast_signed()))
    }

    /// Distance along the ray [m], (cell,).
    fn distance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.samples.leaves.iter().map(|leaf| leaf.found.to_facet))
    }

    /// Unit direction of the ray of a cell in the sensor frame.
    fn direction(&self, cell: usize) -> PyResult<[f64; 3]> {
        Ok(self.leaf(cell)?.cell.direction().to_array())
    }

    /// The vertices of the triangle that a cell hit and their weights there.
    fn place_on_mesh(&self, cell: usize) -> PyResult<([u32; 3], [f64; 3])> {
        let Leaf { cell, found, .. } = self.leaf(cell)?;
        Ok(patch::place_on_mesh(&self.snapshot, cell, found.body, found.triangle))
    }

    /// Material points of all cells that send anything back; `materials` has one per body.
    #[pyo3(signature = (materials, *, antennas, threads=None))]
    fn scatterers(
        &self,
        py: Python<'_>,
        materials: Vec<PyRef<'_, Material>>,
        antennas: PyRef<'_, Antennas>,
        threads: Option<usize>,
    ) -> PyResult<Scatterers> {
        let materials = self::materials(&materials, self.snapshot.num_bodies())?;
        let array = antennas.0.clone();
        let scatterers = compute(py, threads, || {
            let (snapshot, samples) = (&self.snapshot, &self.samples);
            Ok(scatterers::Scatterers::of_samples(snapshot, samples, &materials, array))
        })?;
        Ok(Scatterers {
            scatterers,
            num_bodies: self.snapshot.num_bodies(),
        })
    }
}

impl Samples {
    fn leaf(&self, number: usize) -> Result<&Leaf> {
        let expected = || format!("a number below {}", self.samples.leaves.len());
        let leaf = self.samples.leaves.get(number);
        leaf.ok_or_else(|| Error::value("cell", expected(), number))
    }
}

/// Material points of the surface elements of an image that send anything back; the bodies' frames are the sensor frame.
#[pyfunction(signature = (
    distance, normals, reflection, albedo, body, *, num_bodies, focal_length, principal_point, antennas, is_footprint, seed,
    threads=None
))]
fn image_scatterers(
    py: Python<'_>,
    distance: PyReadonlyArray2<'_, f64>,
    normals: PyReadonlyArray3<'_, f64>,
    reflection: PyReadonlyArray2<'_, Complex64>,
    albedo: PyReadonlyArray2<'_, f64>,
    body: PyReadonlyArray2<'_, i32>,
    num_bodies: usize,
    focal_length: (f64, f64),
    principal_point: (f64, f64),
    antennas: PyRef<'_, Antennas>,
    is_footprint: bool,
    seed: u64,
    threads: Option<usize>,
) -> PyResult<Scatterers> {
    let [rows, columns] = *distance.shape() else {
        unreachable!("two axes")
    };
    let image = [Some(rows), Some(columns)];
    let normal = points(numbers("normals", &normals, [image[0], image[1], Some(3)])?);
    let surfels = Surfels {
        plane: ImagePlane {
            rows,
            columns,
            du: focal_length.0.recip(),
            dv: focal_length.1.recip(),
            axis_column: principal_point.0,
            axis_row: principal_point.1,
        },
        distance: numbers("distance", &distance, image)?,
        normal: &normal,
        reflection: numbers("reflection", &reflection, image)?,
        albedo: numbers("albedo", &albedo, image)?,
        body: numbers("body", &body, image)?,
        num_bodies,
    };
    let array = antennas.0.clone();
    let scatterers = compute(py, threads, || {
        scatterers::Scatterers::from_surfels(&surfels, array, sampling(is_footprint), seed)
    })?;
    Ok(Scatterers { scatterers, num_bodies })
}

fn sampling(is_footprint: bool) -> Sampling {
    if is_footprint {
        Sampling::Footprint
    } else {
        Sampling::Point
    }
}

/// Material points; delays and amplitudes follow from where their bodies are.
#[pyclass(frozen, module = "radarcore._core")]
struct Scatterers {
    scatterers: scatterers::Scatterers,
    num_bodies: usize,
}

type DelaysAndAmplitudes<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray3<Complex64>>);

#[pymethods]
impl Scatterers {
    fn __len__(&self) -> usize {
        self.scatterers.len()
    }

    /// Number of the body of every material point.
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.scatterers.bodies())
    }

    /// Number of the cell of every material point: of the pixel, row by row, or of the cell of samples.
    fn cell<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.scatterers.cells())
    }

    /// Numbers of the bodies that deform and have material points here, increasing.
    fn deforming<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_iter(py, self.scatterers.deforming().iter().map(|(body, _)| *body))
    }

    /// By which power of the frequency the field of every material point falls.
    fn order<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        PyArray1::from_slice(py, self.scatterers.orders())
    }

    /// The material points of the bodies for which `wanted` (body,) is true, and of an order, in the same order.
    fn select(&self, wanted: PyReadonlyArray1<'_, bool>, order: u8) -> PyResult<Self> {
        let wanted = numbers("wanted", &wanted, [Some(self.num_bodies)])?;
        Ok(Self {
            scatterers: self.scatterers.select(|body, of| wanted[body as usize] && of == order),
            num_bodies: self.num_bodies,
        })
    }

    /// Delay [s] and amplitude [sqrt(W)], (node, channel, path), of every `step`-th path from `first` up to `last`:
    /// first the material points with their bodies at `poses` (node, body, 3, 4), then the point targets at `points`
    /// (node, point, 3). `vertices` has those of the bodies of `deforming` (node, vertex, 3). Amplitudes are those at
    /// `amplitudes_at`, which are such poses, points and vertices at other nodes.
    #[pyo3(signature = (
        poses, points, rcs, *, vertices=None, amplitudes_at=None, first=0, last=None, step=1, threads=None
    ))]
    fn paths<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray4<'py, f64>,
        points: PyReadonlyArray3<'py, f64>,
        rcs: PyReadonlyArray1<'py, f64>,
        vertices: Option<Vec<PyReadonlyArray3<'py, f64>>>,
        amplitudes_at: Option<PosesPointsVertices<'py>>,
        first: usize,
        last: Option<usize>,
        step: usize,
        threads: Option<usize>,
    ) -> PyResult<DelaysAndAmplitudes<'py>> {
        let rcs = numbers("rcs", &rcs, [None])?;
        let bodies = self.scatterers.deforming();
        let vertices = vertices.unwrap_or_default();
        let names = ["poses", "points", "vertices"];
        let nodes = Nodes::new(
            names,
            &poses,
            Some((&points, rcs.len())),
            &vertices,
            self.num_bodies,
            bodies,
        )?;
        let others = match &amplitudes_at {
            None => None,
            Some((poses, points, vertices)) => {
                let points = Some((points, rcs.len()));
                Some(Nodes::new(
                    AMPLITUDES_AT,
                    poses,
                    points,
                    vertices,
                    self.num_bodies,
                    bodies,
                )?)
            }
        };
        let places = nodes.places(rcs);
        let amplitudes_at = others.as_ref().map_or(places, |nodes| nodes.places(rcs));
        let num_paths = self.scatterers.len() + rcs.len();
        let last = last.unwrap_or(num_paths);
        if step == 0 || last > num_paths {
            let expected = format!("a step of at least 1 and at most {num_paths} paths");
            return Err(Error::value("step, last", expected, format!("{step}, {last}")).into());
        }
        let selection = Selection { first, last, step };
        let paths = compute(py, threads, || {
            self.scatterers.paths(&places, &amplitudes_at, selection)
        })?;
        let shape = |nodes| [nodes, self.scatterers.num_channels(), selection.len()];
        Ok((
            paths.delay.into_pyarray(py).reshape(shape(places.num_nodes))?,
            paths
                .amplitude
                .into_pyarray(py)
                .reshape(shape(amplitudes_at.num_nodes))?,
        ))
    }

    /// Rate of every delay [s/s], (channel, path), from poses (body, 3, 4) and points (point, 3) and their time
    /// derivatives; likewise the vertices (vertex, 3) of the bodies of `deforming`.
    #[pyo3(signature = (poses, pose_rates, points, point_rates, *, vertices=None, vertex_rates=None, threads=None))]
    fn delay_rates<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray3<'py, f64>,
        pose_rates: PyReadonlyArray3<'py, f64>,
        points: PyReadonlyArray2<'py, f64>,
        point_rates: PyReadonlyArray2<'py, f64>,
        vertices: Option<Vec<PyReadonlyArray2<'py, f64>>>,
        vertex_rates: Option<Vec<PyReadonlyArray2<'py, f64>>>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let per_body = [Some(self.num_bodies), Some(3), Some(4)];
        let poses = self::poses(numbers("poses", &poses, per_body)?);
        let pose_rates = self::poses(numbers("pose_rates", &pose_rates, per_body)?);
        let per_point = [Some(points.shape()[0]), Some(3)];
        let point_rates = self::points(numbers("point_rates", &point_rates, per_point)?);
        let points = self::points(numbers("points", &points, per_point)?);
        let (vertices, vertex_rates) = (vertices.unwrap_or_default(), vertex_rates.unwrap_or_default());
        let shape = |n| [Some(n), Some(3)];
        let bodies = self.scatterers.deforming();
        let vertices = self::vertices("vertices", bodies, &vertices, shape)?;
        let vertex_rates = self::vertices("vertex_rates", bodies, &vertex_rates, shape)?;
        let places = self.places(1, &poses, &points, &[], &vertices);
        let rates = self.places(1, &pose_rates, &point_rates, &[], &vertex_rates);
        let shape = [self.scatterers.num_channels(), self.scatterers.len() + points.len()];
        let rates = compute(py, threads, || Ok(self.scatterers.delay_rates(&places, &rates)))?;
        rates.into_pyarray(py).reshape(shape)
    }
}

impl Scatterers {
    fn places<'a>(
        &self,
        num_nodes: usize,
        poses: &'a [Pose],
        points: &'a [DVec3],
        rcs: &'a [f64],
        vertices: &'a [&'a [[f64; 3]]],
    ) -> Places<'a> {
        Places {
            num_nodes,
            num_bodies: self.num_bodies,
            poses,
            points,
            rcs,
            vertices,
        }
    }
}

/// Poses (node, body, 3, 4), points (node, point, 3), and vertices (node, vertex, 3) of every body that deforms.
type PosesPointsVertices<'py> = (
    PyReadonlyArray4<'py, f64>,
    PyReadonlyArray3<'py, f64>,
    Vec<PyReadonlyArray3<'py, f64>>,
);

/// Names of the parts of an argument.
const AMPLITUDES_AT: [&str; 3] = ["amplitudes_at[0]", "amplitudes_at[1]", "amplitudes_at[-1]"];

/// Where everything is at some nodes, as the core takes it.
struct Nodes<'a> {
    number: usize,
    num_bodies: usize,
    poses: Vec<Pose>,
    points: Vec<DVec3>,
    vertices: Vec<&'a [[f64; 3]]>,
}

impl<'a> Nodes<'a> {
    /// Refuses shapes that do not fit together; `names` are those of the arrays, the points come with their number.
    fn new(
        names: [&str; 3],
        poses: &PyReadonlyArray4<'_, f64>,
        points: Option<(&PyReadonlyArray3<'_, f64>, usize)>,
        vertices: &'a [PyReadonlyArray3<'_, f64>],
        num_bodies: usize,
        deforming: &[(u32, usize)],
    ) -> PyResult<Self> {
        let number = poses.shape()[0];
        let poses = self::poses(numbers(names[0], poses, [None, Some(num_bodies), Some(3), Some(4)])?);
        let points = match points {
            None => Vec::new(),
            Some((points, num_points)) => {
                self::points(numbers(names[1], points, [Some(number), Some(num_points), Some(3)])?)
            }
        };
        Ok(Self {
            number,
            num_bodies,
            poses,
            points,
            vertices: self::vertices(names[2], deforming, vertices, |n| [Some(number), Some(n), Some(3)])?,
        })
    }

    fn places<'b>(&'b self, rcs: &'b [f64]) -> Places<'b> {
        Places {
            num_nodes: self.number,
            num_bodies: self.num_bodies,
            poses: &self.poses,
            points: &self.points,
            rcs,
            vertices: &self.vertices,
        }
    }
}

/// One array for every body that deforms, of the shape that its number of vertices asks for.
fn vertices<'a, D: Dimension, const N: usize>(
    name: &str,
    bodies: &[(u32, usize)],
    arrays: &'a [PyReadonlyArray<'_, f64, D>],
    shape: impl Fn(usize) -> [Option<usize>; N],
) -> PyResult<Vec<&'a [[f64; 3]]>> {
    if arrays.len() != bodies.len() {
        let expected = format!("{} arrays, one per body that deforms", bodies.len());
        return Err(Error::value(name, expected, arrays.len()).into());
    }
    let arrays = arrays.iter().zip(bodies);
    arrays
        .map(|(array, (_, number))| Ok(numbers(name, array, shape(*number))?.as_chunks().0))
        .collect()
}

/// The numbers of an array in C order; other layouts and lengths than expected (`None`: any) are refused.
fn numbers<'a, T: Element, D: Dimension, const N: usize>(
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

/// Lengths as Python writes them, `(n, 3)` for free ones.
fn shape_text(lengths: impl IntoIterator<Item = Option<usize>>) -> String {
    let lengths: Vec<String> = lengths
        .into_iter()
        .map(|length| length.map_or_else(|| "n".into(), |length| length.to_string()))
        .collect();
    format!("({}{})", lengths.join(", "), if lengths.len() == 1 { "," } else { "" })
}

/// Rows (x, y, z).
fn points(numbers: &[f64]) -> Vec<DVec3> {
    numbers.as_chunks().0.iter().copied().map(DVec3::from_array).collect()
}

/// Matrices (3, 4), row by row.
fn poses(numbers: &[f64]) -> Vec<Pose> {
    numbers.as_chunks().0.iter().map(Pose::from_rows).collect()
}

fn matrix<T: Element, const N: usize>(py: Python<'_>, rows: Vec<[T; N]>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let shape = [rows.len(), N];
    rows.into_flattened().into_pyarray(py).reshape(shape)
}
