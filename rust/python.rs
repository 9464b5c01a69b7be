//! The boundary to Python: borrow arrays in, release the interpreter, move arrays out. No arithmetic here.

// Python hands arguments over by value, one by one.
#![allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]

use std::num::NonZero;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use num_complex::Complex64;
use numpy::ndarray::Dimension;
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray, PyReadonlyArray1,
    PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::antenna::Array;
use crate::beat;
use crate::chirp;
use crate::delay::{Basis, PathSeries};
use crate::error::{Error, Result};
use crate::frame;
use crate::material::{self, Dielectric, Response, Roughness};
use crate::mesh::{Obj, read_obj};
use crate::motion::Pose;
use crate::pattern;
use crate::plan::{Method, Step};
use crate::polarization::Seen;
use crate::scatter::{self, Sampling};
use crate::simd::Level;
use crate::surface::{self, ShadingMode};
use crate::trace::{self, NO_BODY};

mod cross_section;
mod simulator;


#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(load_obj, module)?)?;
    module.add_function(wrap_pyfunction!(beat_signal, module)?)?;
    module.add_function(wrap_pyfunction!(plan_beat_signal, module)?)?;
    module.add_function(wrap_pyfunction!(levels, module)?)?;
    module.add_function(wrap_pyfunction!(cross_section::cross_sections, module)?)?;
    module.add_class::<Waveform>()?;
    module.add_class::<Report>()?;
    module.add_class::<Surface>()?;
    module.add_class::<Material>()?;
    module.add_class::<Pattern>()?;
    module.add_class::<Antennas>()?;
    module.add_class::<Hits>()?;
    module.add_class::<simulator::Scene>()?;
    module.add_class::<simulator::DepthScene>()?;
    module.add_class::<simulator::Settings>()?;
    module.add_class::<simulator::Placement>()?;
    module.add_class::<simulator::IdealFrame>()?;
    module.add_class::<simulator::Simulator>()?;
    Ok(())
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match &error {
            Error::Value(_) | Error::Format { .. } => PyValueError::new_err(error.to_string()),
            Error::Memory(_) => PyMemoryError::new_err(error.to_string()),
            Error::Interrupted => PyKeyboardInterrupt::new_err(()),
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
    py.detach(|| pool(num_threads(threads))?.install(work).map_err(PyErr::from))
}

/// As many threads as are asked for, or as there are cores.
fn num_threads(threads: Option<usize>) -> usize {
    threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, NonZero::get))
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

/// A way to sum, from Python's words.
fn method(name: &str) -> Result<Method> {
    match name {
        "auto" => Ok(Method::Auto),
        "direct" => Ok(Method::Direct),
        "grid" => Ok(Method::Grid),
        "recurrence" => Ok(Method::Recurrence),
        "lanes" => Ok(Method::Lanes),
        _ => {
            let expected = "'auto', 'direct', 'grid', 'recurrence' or 'lanes'";
            Err(Error::value("method", expected, format!("{name:?}")))
        }
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
    let method = self::method(method)?;
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
    let is_parallel = threads != Some(1) && beat::is_worth_threads(work);
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
        let table = pattern::Table::new(azimuth, elevation, gain_db)?;
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

type ShadedArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);

/// What the rays of an image hit.
#[pyclass(frozen, module = "radarcore._core")]
struct Hits(Arc<frame::Image>);

#[pymethods]
impl Hits {
    /// Distance along the ray [m], (rows, columns); inf where nothing was hit.
    fn distance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.image(PyArray1::from_slice(py, &self.0.hits.distance))
    }

    /// Rays that were cast, and tiles that were skipped and taken over.
    #[getter]
    fn counts(&self) -> (usize, usize, usize) {
        let trace::Counts {
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
        let shown = compute(py, threads, || Ok(self.0.smooth()))?;
        self.image(PyArray1::from_slice(py, &shown.cosine))
    }

    /// Distance along the ray to the surface that the facets stand for [m], (rows, columns), and its unit normal
    /// towards the sensor, (rows, columns, 3); inf and 0 where nothing was hit.
    #[pyo3(signature = (*, threads=None))]
    fn shaded<'py>(&self, py: Python<'py>, threads: Option<usize>) -> PyResult<ShadedArrays<'py>> {
        let shown = compute(py, threads, || Ok(self.0.smooth()))?;
        let plane = &self.0.hits.plane;
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
        let materials = self::materials(&materials, self.0.scene.num_bodies())?;
        let polarization = polarization.map(DVec3::from_array);
        let reflectance = compute(py, threads, || {
            let shown = || self.0.smooth();
            Ok(scatter::reflectance(
                &self.0.hits,
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
        let numbers: Vec<i32> = self.0.hits.body.iter().map(|body| body.cast_signed()).collect();
        self.image(numbers.into_pyarray(py))
    }

    /// The vertices of the triangle that a pixel hit and their weights there; the pixel hit something.
    fn place_on_mesh(&self, pixel: usize) -> PyResult<([u32; 3], [f64; 3])> {
        let body = self.0.hits.body.get(pixel).copied().filter(|body| *body != NO_BODY);
        let body = body.ok_or_else(|| Error::value("pixel", "one that hit something", pixel))?;
        let plane = &self.0.hits.plane;
        let cell = plane.cell(pixel / plane.columns, pixel % plane.columns);
        let triangle = self.0.hits.triangle[pixel];
        Ok(scatter::place_on_mesh(&self.0.scene, &cell, body, triangle))
    }

    /// Unit direction of the ray of a pixel in the sensor frame.
    fn direction(&self, pixel: usize) -> PyResult<[f64; 3]> {
        let plane = &self.0.hits.plane;
        if pixel >= plane.num_pixels() {
            let expected = format!("a number below {}", plane.num_pixels());
            return Err(Error::value("pixel", expected, pixel).into());
        }
        Ok(plane.direction(pixel / plane.columns, pixel % plane.columns).to_array())
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

fn sampling(is_footprint: bool) -> Sampling {
    if is_footprint {
        Sampling::Footprint
    } else {
        Sampling::Point
    }
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
