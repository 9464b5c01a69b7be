//! Waveforms and beat signals.

use num_complex::Complex64;
use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::arrays::{contiguous, numbers};
use super::threads::{check_threads, compute};
use crate::error::{Error, Result};
use crate::numeric::simd::Level;
use crate::synthesis::beat;
use crate::synthesis::chirp;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::low_rank::block_plan::BlockPlan;
use crate::synthesis::plan::{Method, Part, Step};

/// Times and frequencies of a frame.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Waveform(pub(super) chirp::Waveform);

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
pub(super) struct PathArrays<'py> {
    pub(super) basis: Basis,
    pub(super) delay: Vec<PyReadonlyArrayDyn<'py, f64>>,
    pub(super) amplitude: PyReadonlyArrayDyn<'py, Complex64>,
    pub(super) num_channels: usize,
    pub(super) num_paths: usize,
}

impl<'py> PathArrays<'py> {
    /// Borrow the arrays; an error for shapes that do not fit together.
    pub(super) fn new(
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
        "recurrence" => Ok(Method::Recurrence),
        "lanes" => Ok(Method::Lanes),
        _ => {
            let expected = "'auto', 'direct', 'grid', 'recurrence' or 'lanes'";
            Err(Error::value("method", expected, format!("{name:?}")))
        }
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
fn level(name: Option<&str>) -> Result<Level> {
    let Some(name) = name else { return Ok(Level::best()) };
    let index = levels().iter().position(|known| *known == name);
    index
        .map(|index| Level::available()[index])
        .ok_or_else(|| Error::value("level", format!("one of {:?}", levels()), name))
}

/// Beat samples (channel, chirp, sample) of paths, and the report of the sum; with `plan_only` its plan alone. `report`
/// receives the number of chirps of all channels that a direct sum has done, from time to time.
#[pyfunction(signature = (
    delay, amplitude, delay_rate=None, delay_acceleration=None, *, waveform, tolerance, method, threads=None, level=None,
    split_still=true, skip_rows=true, plan_only=false, report=None
))]
pub(super) fn beat_signal<'py>(
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
    plan_only: bool,
    report: Option<Py<PyAny>>,
) -> PyResult<(Option<Bound<'py, PyAny>>, Report)> {
    check_threads(threads)?;
    let paths = PathArrays::new(delay, amplitude, delay_rate, delay_acceleration)?;
    let waveform = &waveform.0;
    let shape = [paths.num_channels, waveform.chirp_times.len(), waveform.num_samples];
    let is_long = beat::is_worth_threads([paths.num_paths, shape[0], shape[1], shape[2]]);
    let options = beat::Options {
        method: self::method(method)?,
        level: self::level(level)?,
        tolerance: self::tolerance(tolerance)?,
        is_parallel: is_long && threads != Some(1),
        split_still,
        skip_rows,
        cancel: None,
    };
    let (samples, report) = paths.with_series(|series| {
        let sum = |options: &beat::Options| {
            if plan_only {
                let report = beat::Report {
                    plan: beat::plan(waveform, series, options)?,
                    ..beat::Report::default()
                };
                return Ok((None, report));
            }
            beat::beat_signal(waveform, series, options).map(|(samples, report)| (Some(samples), report))
        };
        if is_long {
            compute(py, threads, report.as_ref(), |cancel| {
                sum(&beat::Options {
                    cancel: Some(cancel),
                    ..options
                })
            })
        } else {
            py.detach(|| sum(&options).map_err(PyErr::from))
        }
    })?;
    let array = |samples| match samples {
        beat::Samples::Single(samples) => samples.into_pyarray(py).reshape(shape).map(Bound::into_any),
        beat::Samples::Double(samples) => samples.into_pyarray(py).reshape(shape).map(Bound::into_any),
    };
    Ok((samples.map(array).transpose()?, Report(report)))
}

/// Report of a sum: classes of paths and their methods.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Report(pub(super) beat::Report);

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

    /// Number of plans that were run: more than one where paths add up in phase, or differ from the samples.
    #[getter]
    fn runs(&self) -> usize {
        self.0.runs
    }

    /// Largest rms of the samples of a channel relative to its l2(amplitudes).
    #[getter]
    fn gain(&self) -> f64 {
        self.0.gain
    }

    /// Classes of paths: name, number of paths, method, precision, width of the kernel (0: none), velocity rows per
    /// block, terms per block, predicted error, and memory [bytes].
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyTuple>>> {
        let part = |part: &Part| {
            let block_plans: &[BlockPlan] = match &part.step {
                Step::Grid { block_plans, .. } => block_plans,
                _ => &[],
            };
            (
                part.class.name(),
                part.num_paths,
                part.step.name(),
                if part.step.is_single() { "single" } else { "double" },
                part.step.width().unwrap_or(0),
                PyTuple::new(py, block_plans.iter().map(|plan| plan.rows))?,
                PyTuple::new(py, block_plans.iter().map(|plan| plan.approximation.num_sets()))?,
                part.error(self.0.plan.gain),
                part.memory,
            )
                .into_pyobject(py)
        };
        self.0.plan.parts.iter().map(part).collect()
    }
}

/// Names of the instruction sets of this processor, slowest first, up to ``RADARCORE_SIMD``.
#[pyfunction]
pub(super) fn levels() -> Vec<&'static str> {
    Level::available().into_iter().map(Level::name).collect()
}
