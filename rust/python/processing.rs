//! Processing: peaks of maps, and tones in the cells about them.

use std::ops::Range;

use num_complex::Complex;
use num_traits::AsPrimitive;
use numpy::ndarray::Dimension;
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyReadonlyArray4, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::arrays::{matrix, numbers, shape_text};
use crate::error::Error;
use crate::processing::peaks::{Map, Sidelobes};
use crate::processing::spheres::{self, Aperture};
use crate::processing::tone_fit::{Axes, MapCells, NUM_LOBES, Tone, fit_all};

/// True for cells of a map with power that none of their neighbours exceeds.
#[pyfunction]
pub(super) fn local_maxima<'py>(
    py: Python<'py>,
    power: PyReadonlyArray2<'py, f64>,
    cells: PyReadonlyArray2<'py, i64>,
    is_cyclic: bool,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let (map, cells) = map_and_cells(&power, is_cyclic, &cells)?;
    let found: Vec<_> = cells.into_iter().map(|cell| map.is_local_maximum(cell)).collect();
    Ok(found.into_pyarray(py))
}

/// Offsets from the middle of local maxima, and their heights, by parabolas through the log power.
#[pyfunction]
pub(super) fn between_cells<'py>(
    py: Python<'py>,
    power: PyReadonlyArray2<'py, f64>,
    cells: PyReadonlyArray2<'py, i64>,
    is_cyclic: bool,
) -> PyResult<impl IntoPyObject<'py>> {
    let (map, cells) = map_and_cells(&power, is_cyclic, &cells)?;
    let tops: Vec<_> = cells.into_iter().map(|cell| map.top(cell)).collect();
    let heights: Vec<_> = tops.iter().map(|top| top.height).collect();
    let offsets = tops.iter().map(|top| top.offset).collect();
    Ok((matrix(py, offsets)?, heights.into_pyarray(py)))
}

/// Medians of the training cells of some cells.
#[pyfunction]
pub(super) fn training_medians<'py>(
    py: Python<'py>,
    power: PyReadonlyArray2<'py, f64>,
    cells: PyReadonlyArray2<'py, i64>,
    guards: [usize; 2],
    trainings: [usize; 2],
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (map, cells) = map_and_cells(&power, false, &cells)?;
    let medians = cells
        .into_iter()
        .map(|cell| map.training_median(cell, guards, trainings));
    let found: Vec<_> = py.detach(|| medians.collect());
    Ok(found.into_pyarray(py))
}

/// Local maxima of some columns of a map above thresholds, and the thresholds.
#[pyfunction]
pub(super) fn maxima_above<'py>(
    py: Python<'py>,
    power: PyReadonlyArray2<'py, f64>,
    trained: PyReadonlyArray2<'py, f64>,
    scale: PyReadonlyArray2<'py, f64>,
    first: usize,
    guards: [usize; 2],
    trainings: [usize; 2],
    is_cyclic: bool,
) -> PyResult<impl IntoPyObject<'py>> {
    let map = map_of(&power, is_cyclic)?;
    let searched = within("trained", first..first + trained.shape()[1], map.shape[1])?;
    let shape = [Some(map.shape[0]), Some(searched.len())];
    let (trained, scale) = (numbers("trained", &trained, shape)?, numbers("scale", &scale, shape)?);
    let (cells, thresholds) = py.detach(|| map.maxima_above(trained, scale, searched, guards, trainings));
    Ok((index_array(py, cells)?, thresholds.into_pyarray(py)))
}

/// Peaks above the sidelobes of stronger ones, and their offsets from the middle of their cells.
#[pyfunction]
pub(super) fn above_sidelobes<'py>(
    py: Python<'py>,
    power: PyReadonlyArray2<'py, f64>,
    peaks: PyReadonlyArray2<'py, i64>,
    least: PyReadonlyArray1<'py, f64>,
    envelopes: [PyReadonlyArray1<'py, f64>; 2],
    mean_envelope: PyReadonlyArray1<'py, f64>,
    mean_gain: PyReadonlyArray1<'py, f64>,
    searched: [usize; 2],
    smallest: f64,
    smear: f64,
    num_samples: usize,
    is_cyclic: bool,
) -> PyResult<impl IntoPyObject<'py>> {
    let (map, cells) = map_and_cells(&power, is_cyclic, &peaks)?;
    let [num_rows, num_columns] = map.shape;
    let lobes = Sidelobes {
        envelopes: [
            numbers("envelopes", &envelopes[0], [None])?,
            numbers("envelopes", &envelopes[1], [None])?,
        ],
        mean_envelope: numbers("mean_envelope", &mean_envelope, [None])?,
        mean_gain: numbers("mean_gain", &mean_gain, [Some(num_rows)])?,
        periods: [num_rows as f64, num_samples as f64],
        smear,
        is_mirrored: !is_cyclic && num_columns > 1,
    };
    let least = numbers("least", &least, [Some(cells.len())])?;
    let searched = within("searched", searched[0]..searched[1], num_columns)?;
    let (kept, offsets): (Vec<_>, Vec<_>) = map
        .above_sidelobes(&cells, least, &lobes, searched, smallest)
        .into_iter()
        .map(|(index, offset)| (cells[index], offset))
        .unzip();
    Ok((index_array(py, kept)?, matrix(py, offsets)?))
}

/// Columns, which a map with a number of them must have.
fn within(name: &str, columns: Range<usize>, number: usize) -> PyResult<Range<usize>> {
    if columns.start <= columns.end && columns.end <= number {
        return Ok(columns);
    }
    Err(Error::value(name, format!("columns up to {number}"), format!("{columns:?}")).into())
}

/// Rows and columns of cells, (cell, 2).
fn index_array(py: Python<'_>, cells: Vec<[usize; 2]>) -> PyResult<Bound<'_, PyArray2<i64>>> {
    matrix(
        py,
        cells
            .into_iter()
            .map(|cell| cell.map(|index| index.cast_signed() as i64))
            .collect(),
    )
}

fn map_and_cells<'a>(
    power: &'a PyReadonlyArray2<'_, f64>,
    is_cyclic: bool,
    cells: &PyReadonlyArray2<'_, i64>,
) -> PyResult<(Map<'a>, Vec<[usize; 2]>)> {
    let map = map_of(power, is_cyclic)?;
    let cells = indices("cells", cells, map.shape)?;
    Ok((map, cells))
}

fn map_of<'a>(power: &'a PyReadonlyArray2<'_, f64>, is_cyclic: bool) -> PyResult<Map<'a>> {
    let shape = [power.shape()[0], power.shape()[1]];
    let power = numbers("power", power, [None; 2])?;
    Ok(Map {
        power,
        shape,
        is_cyclic,
    })
}

/// Rows and columns, which a map of a shape must have.
fn indices(name: &str, cells: &PyReadonlyArray2<'_, i64>, shape: [usize; 2]) -> PyResult<Vec<[usize; 2]>> {
    let cells: &[[i64; 2]] = numbers(name, cells, [None, Some(2)])?.as_chunks().0;
    let inside = |[row, column]: [i64; 2]| {
        let index = [usize::try_from(row).ok()?, usize::try_from(column).ok()?];
        (index[0] < shape[0] && index[1] < shape[1]).then_some(index)
    };
    let outside = |cell: &[i64; 2]| {
        let expected = format!("cells of a map of shape {}", shape_text(shape.map(Some)));
        Error::value(name, expected, format!("{cell:?}"))
    };
    let found: Result<_, _> = cells
        .iter()
        .map(|cell| inside(*cell).ok_or_else(|| outside(cell)))
        .collect();
    Ok(found?)
}

/// Cells of a map in single or double precision.
#[derive(FromPyObject)]
pub(super) enum AnyCells<'py> {
    Single(PyReadonlyArray3<'py, Complex<f32>>),
    Double(PyReadonlyArray3<'py, Complex<f64>>),
}

/// Offsets (tone, 2), amplitudes (tone, look), energy gains (tone,) and information (tone, 2) of the tones about peaks.
#[pyfunction]
pub(super) fn fit_tones<'py>(
    py: Python<'py>,
    cells: AnyCells<'py>,
    peaks: PyReadonlyArray2<'py, i64>,
    start: PyReadonlyArray2<'py, f64>,
    series: PyReadonlyArray4<'py, f64>,
    lobes: PyReadonlyArray3<'py, Complex<f64>>,
    num_cells: [usize; 2],
    is_cyclic: bool,
    has_images: bool,
) -> PyResult<impl IntoPyObject<'py>> {
    let (num_looks, num_rows, num_columns) = match &cells {
        AnyCells::Single(cells) => cells.dims().into_pattern(),
        AnyCells::Double(cells) => cells.dims().into_pattern(),
    };
    if num_cells[0] > num_rows || num_cells[1] > num_columns || num_cells.contains(&0) {
        let expected = format!("1 to {num_rows} and 1 to {num_columns}");
        return Err(Error::value("num_cells", expected, format!("{num_cells:?}")).into());
    }
    let most = num_cells[0].max(num_cells[1]);
    let axes = Axes {
        series: numbers("series", &series, [Some(2), Some(most), None, Some(8 * most)])?,
        most,
        num_cells,
        lobes: numbers("lobes", &lobes, [Some(2), None, Some(NUM_LOBES)])?,
    };
    let peaks = indices("peaks", &peaks, [num_rows, num_columns])?;
    let number = peaks.len();
    let start = numbers("start", &start, [Some(number), Some(2)])?.as_chunks().0;
    let columns = [is_cyclic, has_images];
    let tones = match &cells {
        AnyCells::Single(cells) => tones(py, cells, columns, &peaks, start, &axes)?,
        AnyCells::Double(cells) => tones(py, cells, columns, &peaks, start, &axes)?,
    };
    let amplitudes: Vec<_> = tones.iter().flat_map(|tone| &tone.amplitude).copied().collect();
    let energy_gains: Vec<_> = tones.iter().map(|tone| tone.energy_gain).collect();
    Ok((
        matrix(py, tones.iter().map(|tone| tone.offset).collect())?,
        amplitudes.into_pyarray(py).reshape([number, num_looks])?,
        energy_gains.into_pyarray(py),
        matrix(py, tones.iter().map(|tone| tone.information).collect())?,
    ))
}

fn tones<T: AsPrimitive<f64>>(
    py: Python<'_>,
    cells: &PyReadonlyArray3<'_, Complex<T>>,
    [is_cyclic, has_images]: [bool; 2],
    peaks: &[[usize; 2]],
    start: &[[f64; 2]],
    axes: &Axes,
) -> PyResult<Vec<Tone>>
where
    Complex<T>: Element,
{
    let map = MapCells {
        values: numbers("cells", cells, [None; 3])?,
        shape: cells.dims().into_pattern().into(),
        is_cyclic,
        has_images,
    };
    Ok(py.detach(|| fit_all(&map, peaks, start, axes)))
}

/// Sines of targets with spherical waves, and the share of the power that each does not explain.
#[pyfunction]
pub(super) fn fit_spheres<'py>(
    py: Python<'py>,
    waves: PyReadonlyArray2<'py, Complex<f64>>,
    sines: PyReadonlyArray2<'py, f64>,
    distance: PyReadonlyArray1<'py, f64>,
    antennas: PyReadonlyArray2<'py, f64>,
    channels: PyReadonlyArray2<'py, f64>,
    num_receivers: usize,
    wavenumber: f64,
    observable: [bool; 2],
) -> PyResult<impl IntoPyObject<'py>> {
    let (number, num_channels) = (waves.shape()[0], channels.shape()[0]);
    let num_senders = antennas.shape()[0].saturating_sub(num_receivers);
    if num_receivers == 0 || num_senders.max(1) * num_receivers != num_channels {
        let expected = format!("receivers of {num_channels} channels");
        return Err(Error::value("num_receivers", expected, num_receivers.to_string()).into());
    }
    let array = Aperture {
        antennas: numbers("antennas", &antennas, [None, Some(3)])?.as_chunks().0,
        num_receivers,
        channels: numbers("channels", &channels, [None, Some(3)])?.as_chunks().0,
        observable,
        wavenumber,
    };
    let sines: &[[f64; 2]] = numbers("sines", &sines, [Some(number), Some(2)])?.as_chunks().0;
    let distance = numbers("distance", &distance, [Some(number)])?;
    let waves = numbers("waves", &waves, [None, Some(num_channels)])?.chunks_exact(num_channels);
    let found: Vec<_> = waves
        .zip(sines)
        .zip(distance)
        .map(|((waves, plane), distance)| spheres::fit(&array, waves, *plane, *distance))
        .collect();
    let missing: Vec<_> = found.iter().map(|one| one.missing).collect();
    Ok((
        matrix(py, found.iter().map(|one| one.sines).collect())?,
        missing.into_pyarray(py),
    ))
}
