//! Patterns and arrays of antennas.

use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::arrays::{numbers, points};
use crate::antennas::array::Array;
use crate::antennas::gain_table::GainTable;
use crate::antennas::pattern;
use crate::antennas::response::ReceiverResponse;
use crate::error::Result;

/// Power gain of an antenna over directions.
#[pyclass(frozen, name = "Pattern", module = "radarcore._core")]
pub(super) struct PyPattern(pub(super) pattern::Pattern);

#[pymethods]
impl PyPattern {
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
        let table = GainTable::new(azimuth, elevation, gain_db)?;
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
#[pyclass(frozen, name = "Antennas", module = "radarcore._core")]
pub(super) struct PyAntennas(pub(super) Array);

#[pymethods]
impl PyAntennas {
    /// Antennas at rows (x, y, z) of the sensor frame [m], with a pattern each; `polarization`: unit vector along the
    /// field. `responses`: complex gain of the receiver for the echoes of every transmit antenna (tx, step), over lengths
    /// of paths from 0 to `longest_path` [m] in equal steps.
    #[new]
    #[pyo3(signature = (*, tx, rx, tx_patterns, rx_patterns, power, frequency, polarization=None, responses=None, longest_path=0.0))]
    fn new(
        tx: PyReadonlyArray2<'_, f64>,
        rx: PyReadonlyArray2<'_, f64>,
        tx_patterns: Vec<PyRef<'_, PyPattern>>,
        rx_patterns: Vec<PyRef<'_, PyPattern>>,
        power: f64,
        frequency: f64,
        polarization: Option<[f64; 3]>,
        responses: Option<PyReadonlyArray2<'_, Complex64>>,
        longest_path: f64,
    ) -> PyResult<Self> {
        let patterns = |given: Vec<PyRef<'_, PyPattern>>| given.iter().map(|pattern| pattern.0.clone()).collect();
        let responses = responses.map_or(Ok(Vec::new()), |gains| {
            let rows = gains.as_array();
            let of_row = |row: usize| ReceiverResponse::new(longest_path, rows.row(row).to_vec()).map(Arc::new);
            (0..rows.nrows()).map(of_row).collect::<Result<_>>()
        })?;
        let array = Array {
            tx: points(numbers("tx", &tx, [None, Some(3)])?),
            rx: points(numbers("rx", &rx, [None, Some(3)])?),
            tx_patterns: patterns(tx_patterns),
            rx_patterns: patterns(rx_patterns),
            power,
            frequency,
            polarization: polarization.map(DVec3::from_array),
            responses,
        };
        array.check()?;
        Ok(Self(array))
    }
}
