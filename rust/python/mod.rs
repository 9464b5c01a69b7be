//! The boundary to Python: borrow arrays in, release the interpreter, move arrays out. No arithmetic here.

// Python hands arguments over by value, one by one.
#![allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]

use pyo3::prelude::*;

mod antennas;
mod arrays;
mod bounces;
mod cross_section;
mod error;
mod geometry;
mod paths;
mod rays;
mod scattering;
mod synthesis;
mod threads;

use antennas::{Antennas, Pattern};
use bounces::Bounces;
use paths::Scatterers;
use rays::{Hits, Scene, Surface};
use scattering::{Material, Samples};
use synthesis::{Report, Waveform};

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(geometry::load_obj, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::beat_signal, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::plan_beat_signal, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::levels, module)?)?;
    module.add_function(wrap_pyfunction!(scattering::image_scatterers, module)?)?;
    module.add_function(wrap_pyfunction!(cross_section::cross_sections, module)?)?;
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
