//! Waveforms and beat signals.

use num_complex::Complex64;
use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{contiguous, numbers};
use super::threads::{check_threads, compute};
use crate::error::{Error, Result};
use crate::numeric::simd::Level;
use crate::synthesis::beat_signal as sums;
use crate::synthesis::chirp;
use crate::synthesis::choose::Method;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::report::{self, Known, Options, Samples};

/// Times and frequencies of a frame.
#[pyclass(frozen, name = "Waveform", module = "radarcore._core")]
pub(super) struct PyWaveform(pub(super) chirp::Waveform);

#[pymethods]
impl PyWaveform {
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
pub(super) struct PathRows<'py> {
    pub(super) basis: Basis,
    pub(super) delay: Vec<PyReadonlyArrayDyn<'py, f64>>,
    pub(super) amplitude: PyReadonlyArrayDyn<'py, Complex64>,
    pub(super) num_channels: usize,
    pub(super) num_paths: usize,
}

impl<'py> PathRows<'py> {
    /// Borrow the arrays; an error for shapes that do not fit together.
    pub(super) fn new(
        delay: PyReadonlyArrayDyn<'py, f64>,
        amplitude: PyReadonlyArrayDyn<'py, Complex64>,
        delay_rate: Option<PyReadonlyArrayDyn<'py, f64>>,
        delay_acceleration: Option<PyReadonlyArrayDyn<'py, f64>>,
    ) -> Result<Self> {
        let shape = delay.shape().to_vec();
        let is_nodal = shape.len() == 3;
        if shape.is_empty() || shape.len() > 3 {
            return Err(Error::value("delay", "one to three axes", format!("{shape:?}")));
        }
        if is_nodal && shape[0] == 0 {
            return Err(Error::value("delay", "1 to 4096 nodes", 0));
        }
        let expected = &shape[usize::from(is_nodal)..];
        let got = amplitude.shape();
        let has_nodes = is_nodal && got.len() == 3 && got[0] > 0;
        if got[usize::from(has_nodes)..] != *expected {
            let nodes = if is_nodal { ", or those with nodes in front" } else { "" };
            return Err(Error::value(
                "amplitude",
                format!("shape {expected:?}{nodes}"),
                format!("{got:?}"),
            ));
        }
        for (name, row) in [("delay_rate", &delay_rate), ("delay_acceleration", &delay_acceleration)] {
            if let Some(row) = row.as_ref().filter(|row| is_nodal || row.shape() != shape) {
                let expected = format!("shape {shape:?} of delays without nodes");
                return Err(Error::value(name, expected, format!("{:?}", row.shape())));
            }
        }
        if delay_acceleration.is_some() && delay_rate.is_none() {
            let expected = "one together with delay_acceleration";
            return Err(Error::value("delay_rate", expected, "none"));
        }
        let (num_channels, num_paths) = match *expected {
            [channels, paths] => (channels, paths),
            _ => (1, expected[0]),
        };
        let mut rows = vec![delay];
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

    /// Run a function with the series of these paths.
    pub(super) fn with_series<T>(&self, run: impl FnOnce(&PathSeries) -> PyResult<T>) -> PyResult<T> {
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

/// Method of the sum, from the name in Python.
pub(super) fn method(name: &str) -> Result<Method> {
    match name {
        "auto" => Ok(Method::Auto),
        "direct" => Ok(Method::Direct),
        "grid" => Ok(Method::Grid),
        _ => Err(Error::value(
            "method",
            "'auto', 'direct' or 'grid'",
            format!("{name:?}"),
        )),
    }
}

/// Bound on the error of the sum. Zero asks for the best there is.
pub(super) fn tolerance(value: f64) -> Result<f64> {
    if value >= 0.0 {
        Ok(value)
    } else {
        Err(Error::value("tolerance", "zero or a positive number", value))
    }
}

/// Instruction set, from its name in Python; without one the best.
pub(super) fn level(name: Option<&str>) -> Result<Level> {
    let Some(name) = name else { return Ok(Level::best()) };
    let index = levels().iter().position(|known| *known == name);
    index
        .map(|index| Level::available()[index])
        .ok_or_else(|| Error::value("level", format!("one of {:?}", levels()), name))
}

/// Beat samples (channel, chirp, sample) of paths, and the report of the sum. `report` receives the number of chirps of
/// all channels that a direct sum has done, from time to time.
#[pyfunction(signature = (
    delay, amplitude, delay_rate=None, delay_acceleration=None, *, waveform, tolerance, method, threads=None, level=None,
    report=None
))]
pub(super) fn beat_signal<'py>(
    py: Python<'py>,
    delay: PyReadonlyArrayDyn<'py, f64>,
    amplitude: PyReadonlyArrayDyn<'py, Complex64>,
    delay_rate: Option<PyReadonlyArrayDyn<'py, f64>>,
    delay_acceleration: Option<PyReadonlyArrayDyn<'py, f64>>,
    waveform: PyRef<'py, PyWaveform>,
    tolerance: f64,
    method: &str,
    threads: Option<usize>,
    level: Option<&str>,
    report: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyAny>, SumReport)> {
    check_threads(threads)?;
    let paths = PathRows::new(delay, amplitude, delay_rate, delay_acceleration)?;
    let waveform = &waveform.0;
    let shape = [paths.num_channels, waveform.chirp_times.len(), waveform.num_samples];
    let is_long = sums::is_worth_threads([paths.num_paths, shape[0], shape[1], shape[2]]);
    let method = self::method(method)?;
    let options = Options {
        level: self::level(level)?,
        tolerance: self::tolerance(tolerance)?,
        is_parallel: is_long && threads != Some(1),
        cancel: None,
        known: Known::NOTHING,
    };
    let (samples, report) = paths.with_series(|series| {
        let sum = |options: &Options| sums::beat_signal(waveform, series, method, options);
        if is_long {
            compute(py, threads, report.as_ref(), |cancel| {
                sum(&Options {
                    cancel: Some(cancel),
                    ..options
                })
            })
        } else {
            py.detach(|| sum(&options).map_err(PyErr::from))
        }
    })?;
    let array = match samples {
        Samples::Single(samples) => samples.into_pyarray(py).reshape(shape).map(Bound::into_any),
        Samples::Double(samples) => samples.into_pyarray(py).reshape(shape).map(Bound::into_any),
    };
    Ok((array?, report.into()))
}

/// Report of a sum, see the stub.
#[pyclass(frozen, get_all, str = "{text}", module = "radarcore._core")]
pub(super) struct SumReport {
    text: String,
    engine: &'static str,
    precision: &'static str,
    width: usize,
    grids: usize,
    blocks: usize,
    static_paths: usize,
    error: f64,
    memory: usize,
    runs: usize,
    gain: f64,
}

impl From<report::Report> for SumReport {
    fn from(report: report::Report) -> Self {
        Self {
            text: report.to_string(),
            engine: report.engine,
            precision: if report.is_single { "single" } else { "double" },
            width: report.width,
            grids: report.num_grids,
            blocks: report.num_blocks,
            static_paths: report.num_static,
            error: report.total_error,
            memory: report.memory,
            runs: report.num_runs,
            gain: report.gain,
        }
    }
}

/// Names of the instruction sets of this processor, slowest first, up to ``RADARCORE_SIMD``.
#[pyfunction]
pub(super) fn levels() -> Vec<&'static str> {
    Level::available().into_iter().map(Level::name).collect()
}
