//! Patterns and arrays of antennas.

use std::sync::Arc;

use glam::DVec3;
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::arrays::{numbers, points};
use crate::antennas::array::Array;
use crate::antennas::gain_table::Table;
use crate::antennas::pattern;

/// Power gain of an antenna over directions.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Pattern(pub(super) pattern::Pattern);

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

    /// Table of gains [dB] (azimuth, elevation) at increasing angles [rad]; bilinear interpolation, zero power outside.
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

    /// Power gains at angles (n,) [rad]; azimuths within half a turn.
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
pub(super) struct Antennas(pub(super) Array);

#[pymethods]
impl Antennas {
    /// Antennas at rows (x, y, z) of the sensor frame [m], with a pattern each; `polarization`: unit vector along the
    /// field.
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
