//! The boundary to Python: borrow arrays in, release the interpreter, move arrays out. No arithmetic here.

// Python hands arguments over by value, one by one.
#![allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]

use pyo3::prelude::*;

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

/// Memory of tiles and records is allocated and freed by the thousand in every frame, on all threads.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[pymodule]
mod _core {
    use pyo3::prelude::*;

    use crate::numeric::simd::Level;
    #[pymodule_export]
    use crate::python::antennas::{PyAntennas, PyPattern};
    #[pymodule_export]
    use crate::python::cross_section::cross_sections;
    #[pymodule_export]
    use crate::python::geometry::load_obj;
    #[pymodule_export]
    use crate::python::processing::{above_sidelobes, between_cells, fit_spheres, fit_tones};
    #[pymodule_export]
    use crate::python::processing::{local_maxima, maxima_above, training_medians};
    #[pymodule_export]
    use crate::python::rays::{PySurface, reflectance};
    #[pymodule_export]
    use crate::python::receive::add_noise;
    #[pymodule_export]
    use crate::python::scattering::PyMaterial;
    #[pymodule_export]
    use crate::python::simulator::{DepthScene, IdealFrame, Placement, PyScene, Simulator};
    #[pymodule_export]
    use crate::python::synthesis::{PyWaveform, beat_signal, levels};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        Level::check()?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
