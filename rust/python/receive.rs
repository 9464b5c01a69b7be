//! Receiver: from the ideal beat signal to the samples that it delivers.

use num_complex::Complex;
use numpy::{Element, IntoPyArray, PyArray1, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::error::{Error, fits_memory};
use crate::numeric::normal::add_normal;
use crate::numeric::simd::{Level, Real};

/// Ideal samples in single or double precision.
#[derive(FromPyObject)]
pub(super) enum Ideal<'py> {
    Single(Bound<'py, PyArray3<Complex<f32>>>),
    Double(Bound<'py, PyArray3<Complex<f64>>>),
}

/// Deliver the samples of ideal cubes, one after the other along the first axis and each with a seed of its own, with
/// white noise: "iq" in the memory of the ideal ones, or their "real" parts.
///
/// `deviation`: of every real number. The noise belongs to the seed and to the start of the frame [s].
#[pyfunction(signature = (ideal, *, output, deviation, seeds, start))]
pub(super) fn receive<'py>(
    py: Python<'py>,
    ideal: Ideal<'py>,
    output: &str,
    deviation: f64,
    seeds: Vec<u64>,
    start: f64,
) -> PyResult<Bound<'py, PyAny>> {
    if !(deviation >= 0.0 && deviation.is_finite()) {
        return Err(Error::value("deviation", "zero or a positive number", deviation).into());
    }
    let is_real = match output {
        "real" => true,
        "iq" => false,
        _ => return Err(Error::value("output", "'iq' or 'real'", format!("{output:?}")).into()),
    };
    let length = match &ideal {
        Ideal::Single(cube) => cube.shape()[0],
        Ideal::Double(cube) => cube.shape()[0],
    };
    if seeds.is_empty() || length % seeds.len() != 0 {
        return Err(Error::value(
            "seeds",
            format!("a divisor of {length}, the length of ideal"),
            seeds.len(),
        )
        .into());
    }
    let noise = Noise::new(deviation, seeds, start);
    match ideal {
        Ideal::Single(cube) => deliver(py, cube, is_real, &noise),
        Ideal::Double(cube) => deliver(py, cube, is_real, &noise),
    }
}

/// Independent numbers of the standard normal distribution, which belong to the seed and to the start of a frame [s].
#[pyfunction(signature = (num, *, seed, start))]
pub(super) fn normal(py: Python<'_>, num: usize, seed: u64, start: f64) -> PyResult<Bound<'_, PyArray1<f32>>> {
    fits_memory("num", &[num], size_of::<f32>())?;
    let noise = Noise::new(1.0, vec![seed], start);
    let numbers = py.detach(|| {
        let mut numbers = vec![0.0; num];
        noise.add(&mut numbers);
        numbers
    });
    Ok(numbers.into_pyarray(py))
}

/// White noise of frames, each with a seed.
struct Noise {
    deviation: f64,
    seeds: Vec<u64>,
    stream: u64,
}

impl Noise {
    fn new(deviation: f64, seeds: Vec<u64>, start: f64) -> Self {
        Self {
            deviation,
            seeds,
            // The bits of -0.0 differ from 0.0.
            stream: (start + 0.0).to_bits(),
        }
    }

    fn add<T: Real>(&self, samples: &mut [T]) {
        if self.deviation > 0.0 && !samples.is_empty() {
            let frames = samples.chunks_mut(samples.len() / self.seeds.len());
            for (frame, seed) in frames.zip(&self.seeds) {
                add_normal(Level::best(), frame, self.deviation, *seed, self.stream);
            }
        }
    }
}

fn deliver<'py, T: Real + Element>(
    py: Python<'py>,
    cube: Bound<'py, PyArray3<Complex<T>>>,
    is_real: bool,
    noise: &Noise,
) -> PyResult<Bound<'py, PyAny>>
where
    Complex<T>: Element,
{
    if !cube.is_c_contiguous() {
        return Err(PyTypeError::new_err("ideal: expected a C-contiguous array"));
    }
    if !is_real {
        let view = cube.call_method1("view", (T::get_dtype(py),))?;
        let mut numbers = view.cast_into::<PyArray3<T>>()?.try_readwrite()?;
        let numbers = numbers.as_slice_mut()?;
        py.detach(|| noise.add(numbers));
        return Ok(cube.into_any());
    }
    let ideal = cube.try_readonly()?;
    let ideal = ideal.as_slice()?;
    let samples = py.detach(|| {
        let mut samples: Vec<T> = ideal.iter().map(|sample| sample.re).collect();
        noise.add(&mut samples);
        samples
    });
    Ok(samples.into_pyarray(py).reshape(cube.dims())?.into_any())
}
