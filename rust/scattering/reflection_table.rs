//! Reflection coefficients over the cosine of incidence, tabulated per material.

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::polarization::PolarizationWeights;
use crate::scattering::material::Material;

/// Number of intervals of the table over the cosine. Linear interpolation is then exact to 1e-4 for slabs of a few
/// wavelengths.
const INTERVALS: usize = 256;

/// Reflection coefficient of a material towards the antennas.
#[derive(Debug)]
pub enum Reflection {
    /// Equal at every angle.
    Constant([f32; 2]),
    /// Coefficients at equidistant cosines, for antennas without a polarisation.
    Scalar(Vec<[f32; 2]>),
    /// Coefficients `r_TE` and `r_TM` at equidistant cosines, and the polarisation of the antennas.
    Polarized(Vec<[[f32; 2]; 2]>, DVec3),
}

impl Reflection {
    /// Table of a material at a wavelength [m].
    pub fn new(material: &Material, wavelength: f64, polarization: Option<DVec3>) -> Self {
        let parts = |number: Complex64| [number.re as f32, number.im as f32];
        let cosines = || (0..=INTERVALS).map(|i| i as f64 / INTERVALS as f64);
        match (material, polarization) {
            (Material::Constant(constant), None) => Self::Constant(parts(constant.reflection)),
            (_, None) => Self::Scalar(
                cosines()
                    .map(|cosine| parts(material.response(cosine, wavelength, None).reflection))
                    .collect(),
            ),
            (_, Some(polarization)) => Self::Polarized(
                cosines()
                    .map(|cosine| material.reflection_coefficients(cosine, wavelength).map(parts))
                    .collect(),
                polarization,
            ),
        }
    }

    /// Coefficient at a cosine of incidence, real and imaginary part. `place`: unit normal and direction of the ray,
    /// which a polarisation needs.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub fn at(&self, cosine: f32, place: impl FnOnce() -> (DVec3, DVec3)) -> [f32; 2] {
        let position = cosine.clamp(0.0, 1.0) * INTERVALS as f32;
        let index = (position as usize).min(INTERVALS - 1);
        let share = position - index as f32;
        match self {
            Self::Constant(reflection) => *reflection,
            Self::Scalar(table) => between(table[index], table[index + 1], share),
            Self::Polarized(table, polarization) => {
                let (normal, direction) = place();
                let seen = PolarizationWeights::by(*polarization, normal, direction, direction);
                let (low, high) = (&table[index], &table[index + 1]);
                let (te, tm) = (between(low[0], high[0], share), between(low[1], high[1], share));
                let (a, b) = (seen.te as f32, seen.tm as f32);
                [a * te[0] - b * tm[0], a * te[1] - b * tm[1]]
            }
        }
    }
}

/// Linear interpolation; a closure in `map` would be a call out of the kernel.
#[cfg_attr(optimised, inline(always))]
fn between(a: [f32; 2], b: [f32; 2], share: f32) -> [f32; 2] {
    [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::SPEED_OF_LIGHT;
    use crate::scattering::material::{Dielectric, Roughness, SurfaceResponse};

    const WAVELENGTH: f64 = SPEED_OF_LIGHT / 60e9;

    #[test]
    fn tables_are_the_response_of_the_material_to_a_thousandth() {
        let skin = Dielectric {
            permittivity: Complex64::new(7.975, -10.904),
            thickness: None,
            roughness: Roughness::Height(0.3e-3),
        };
        let glass = Dielectric {
            permittivity: Complex64::new(6.3, -0.1),
            thickness: Some(6e-3),
            roughness: Roughness::Smooth,
        };
        let constant = Material::Constant(SurfaceResponse {
            reflection: Complex64::new(-0.6, 0.2),
            albedo: 0.1,
        });
        let up = DVec3::Z;
        for material in [constant, Material::Dielectric(skin), Material::Dielectric(glass)] {
            let tables = [None, Some(up)].map(|polarization| Reflection::new(&material, WAVELENGTH, polarization));
            for i in 1..1000 {
                let cosine = f64::from(i) / 1000.0;
                let normal = DVec3::new(
                    -cosine,
                    0.6 * (1.0 - cosine * cosine).sqrt(),
                    0.8 * (1.0 - cosine * cosine).sqrt(),
                );
                for (table, seen) in tables
                    .iter()
                    .zip([None, Some(PolarizationWeights::by(up, normal, DVec3::X, DVec3::X))])
                {
                    let exact = material.response(cosine, WAVELENGTH, seen).reflection;
                    let [re, im] = table.at(cosine as f32, || (normal, DVec3::X)).map(f64::from);
                    assert!((Complex64::new(re, im) - exact).norm() < 1e-3, "{cosine} {exact}");
                }
            }
        }
    }
}
