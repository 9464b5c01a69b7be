//! Materials.

use num_complex::Complex64;
use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;

use super::arrays::numbers;
use crate::antennas::polarization::PolarizationWeights;
use crate::error::{Error, Result};
use crate::scattering::material::{self, Dielectric, Roughness, SurfaceResponse};

/// Material of a surface at one frequency.
#[pyclass(frozen, name = "Material", module = "radarcore._core")]
pub(super) struct PyMaterial(pub(super) material::Material);

#[pymethods]
impl PyMaterial {
    /// Constant response at every angle; the field reflection coefficient as (real, imaginary).
    #[staticmethod]
    fn constant(reflection: (f64, f64), albedo: f64) -> Self {
        Self(material::Material::Constant(SurfaceResponse {
            reflection: Complex64::new(reflection.0, reflection.1),
            albedo,
        }))
    }

    /// Fresnel response of a relative permittivity (real, imaginary), for a half-space or a slab of a thickness [m].
    /// `roughness`: rms height [m], none for a smooth surface; or `scattering`: the scattered part of the field.
    #[staticmethod]
    #[pyo3(signature = (permittivity, *, roughness=None, scattering=None, thickness=None))]
    fn dielectric(
        permittivity: (f64, f64),
        roughness: Option<f64>,
        scattering: Option<f64>,
        thickness: Option<f64>,
    ) -> PyResult<Self> {
        let roughness = match (roughness, scattering) {
            (None, None) => Roughness::Smooth,
            (Some(height), None) => Roughness::Height(height),
            (None, Some(part)) => Roughness::Scattering(part),
            (Some(_), Some(_)) => return Err(Error::value("scattering", "none with roughness", "both").into()),
        };
        Ok(Self(material::Material::Dielectric(Dielectric {
            permittivity: Complex64::new(permittivity.0, permittivity.1),
            thickness,
            roughness,
        })))
    }

    /// Field reflection coefficients and albedos (n,) at cosines of incidence (n,), for antennas that receive the parts
    /// `te` and `tm` of both polarisations; none: for antennas without a polarisation.
    #[pyo3(signature = (cosine, *, wavelength, seen))]
    fn response<'py>(
        &self,
        py: Python<'py>,
        cosine: PyReadonlyArray1<'_, f64>,
        wavelength: f64,
        seen: Option<(f64, f64)>,
    ) -> PyResult<impl IntoPyObject<'py>> {
        let cosines = numbers("cosine", &cosine, [None])?.iter();
        let seen = seen.map(|(te, tm)| PolarizationWeights { te, tm });
        let of = |cosine: &f64| self.0.response(*cosine, wavelength, seen);
        let (reflection, albedo): (Vec<_>, Vec<_>) = cosines.map(of).map(|r| (r.reflection, r.albedo)).unzip();
        Ok((reflection.into_pyarray(py), albedo.into_pyarray(py)))
    }
}

/// One material per body.
pub(super) fn materials(materials: &[PyRef<'_, PyMaterial>], num_bodies: usize) -> Result<Vec<material::Material>> {
    if materials.len() != num_bodies {
        let expected = format!("{num_bodies}, one per body");
        return Err(Error::value("materials", expected, materials.len()));
    }
    Ok(materials.iter().map(|material| material.0).collect())
}
