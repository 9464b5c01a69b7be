//! The boundary to Python: borrow arrays in, release the interpreter, move arrays out. No arithmetic here.

// Python hands arguments over by value, one by one.
#![allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]

use pyo3::prelude::*;

use crate::numeric::simd::Level;

mod antennas;
mod arrays;
mod cross_section;
mod error;
mod geometry;
mod processing;
mod rays;
mod receive;
mod scattering;
mod settings;
mod simulator;
mod synthesis;
mod threads;

use antennas::{PyAntennas, PyPattern};
use rays::PySurface;
use scattering::PyMaterial;
use simulator::{DepthScene, IdealFrame, Placement, PyScene, Simulator};
use synthesis::{PyWaveform, SumReport};

/// Memory of tiles and records is allocated and freed by the thousand in every frame, on all threads.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    Level::check()?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(geometry::load_obj, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::beat_signal, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::levels, module)?)?;
    module.add_function(wrap_pyfunction!(rays::reflectance, module)?)?;
    module.add_function(wrap_pyfunction!(receive::receive, module)?)?;
    module.add_function(wrap_pyfunction!(receive::normal, module)?)?;
    module.add_function(wrap_pyfunction!(cross_section::cross_sections, module)?)?;
    module.add_function(wrap_pyfunction!(processing::local_maxima, module)?)?;
    module.add_function(wrap_pyfunction!(processing::between_cells, module)?)?;
    module.add_function(wrap_pyfunction!(processing::maxima_above, module)?)?;
    module.add_function(wrap_pyfunction!(processing::above_sidelobes, module)?)?;
    module.add_function(wrap_pyfunction!(processing::training_medians, module)?)?;
    module.add_function(wrap_pyfunction!(processing::fit_tones, module)?)?;
    module.add_function(wrap_pyfunction!(processing::fit_spheres, module)?)?;
    module.add_class::<PyWaveform>()?;
    module.add_class::<SumReport>()?;
    module.add_class::<PySurface>()?;
    module.add_class::<PyMaterial>()?;
    module.add_class::<PyPattern>()?;
    module.add_class::<PyAntennas>()?;
    module.add_class::<PyScene>()?;
    module.add_class::<DepthScene>()?;
    module.add_class::<Placement>()?;
    module.add_class::<IdealFrame>()?;
    module.add_class::<Simulator>()?;
    Ok(())
}
