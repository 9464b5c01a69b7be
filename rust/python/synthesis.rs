//! Waveforms and beat signals.

use num_complex::Complex64;
use numpy::ndarray::Dimension;
use numpy::{Element, IntoPyArray, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;

use super::arrays::numbers;
use super::threads::{check_threads, compute};
use crate::error::{Error, Result};
use crate::numeric::simd::Level;
use crate::synthesis::beat_signal as sums;
use crate::synthesis::chirp;
use crate::synthesis::choose::Method;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::report::{Known, Options, Samples};

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

/// Rows (channel, path) of a series.
fn rows<'a, T: Element>(name: &str, rows: &'a [PyReadonlyArray2<'_, T>], shape: [usize; 2]) -> PyResult<Vec<&'a [T]>> {
    let rows = rows.iter().map(|row| numbers(name, row, shape.map(Some)));
    rows.collect()
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

/// Instruction set, from its name in Python; without one the best.
pub(super) fn level(name: Option<&str>) -> Result<Level> {
    let Some(name) = name else { return Ok(Level::best()) };
    let index = levels().iter().position(|known| *known == name);
    index
        .map(|index| Level::available()[index])
        .ok_or_else(|| Error::value("level", format!("one of {:?}", levels()), name))
}

/// Beat samples (channel, chirp, sample) of paths, the report of the sum, and its numbers. Delays and amplitudes are rows (channel,
/// path): at nodes with `is_nodal`, else delay, rate and acceleration, and one row of amplitudes. `report` receives the
/// number of chirps of all channels that a direct sum has done, from time to time.
#[pyfunction(signature = (
    delay, amplitude, *, is_nodal, waveform, tolerance, method, threads=None, level=None, report=None
))]
pub(super) fn beat_signal<'py>(
    py: Python<'py>,
    delay: Vec<PyReadonlyArray2<'py, f64>>,
    amplitude: Vec<PyReadonlyArray2<'py, Complex64>>,
    is_nodal: bool,
    waveform: PyRef<'py, PyWaveform>,
    tolerance: f64,
    method: &str,
    threads: Option<usize>,
    level: Option<&str>,
    report: Option<Py<PyAny>>,
) -> PyResult<impl IntoPyObject<'py>> {
    check_threads(threads)?;
    let first = delay.first().map(|row| row.dims());
    let first = first.or_else(|| amplitude.first().map(|row| row.dims()));
    let (num_channels, num_paths) = first.unwrap_or_default().into_pattern();
    let series = PathSeries {
        basis: if is_nodal { Basis::Chebyshev } else { Basis::Taylor },
        delay: &rows("delay", &delay, [num_channels, num_paths])?,
        amplitude: &rows("amplitude", &amplitude, [num_channels, num_paths])?,
        num_channels,
        num_paths,
    };
    let waveform = &waveform.0;
    let shape = [num_channels, waveform.chirp_times.len(), waveform.num_samples];
    let is_long = sums::is_worth_threads([num_paths, shape[0], shape[1], shape[2]]);
    let method = self::method(method)?;
    let options = Options {
        level: self::level(level)?,
        tolerance,
        is_parallel: is_long && threads != Some(1),
        cancel: None,
        known: Known::NOTHING,
    };
    let sum = |options: &Options| sums::beat_signal(waveform, &series, method, options);
    let (samples, report) = if is_long {
        compute(py, threads, report.as_ref(), |cancel| {
            let cancel = Some(cancel);
            sum(&Options { cancel, ..options })
        })?
    } else {
        py.detach(|| sum(&options))?
    };
    let numbers = [
        ("width", report.width),
        ("static_paths", report.num_static),
        ("memory", report.memory),
    ];
    let numbers = numbers.into_py_dict(py)?;
    numbers.set_item("engine", report.engine)?;
    numbers.set_item("is_single", report.is_single)?;
    numbers.set_item("error", report.total_error)?;
    Ok((samples_array(py, samples, shape)?, report.to_string(), numbers))
}

/// Samples as an array, in their precision.
pub(super) fn samples_array(py: Python<'_>, samples: Samples, shape: [usize; 3]) -> PyResult<Bound<'_, PyAny>> {
    Ok(match samples {
        Samples::Single(samples) => samples.into_pyarray(py).reshape(shape)?.into_any(),
        Samples::Double(samples) => samples.into_pyarray(py).reshape(shape)?.into_any(),
    })
}

/// Names of the instruction sets of this processor, slowest first, up to ``RADARCORE_SIMD``.
#[pyfunction]
pub(super) fn levels() -> Vec<&'static str> {
    Level::available().into_iter().map(Level::name).collect()
}
