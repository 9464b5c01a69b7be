//! Materials: Fresnel coefficients of half-spaces and slabs, and scattering of rough surfaces.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::array::Array;
use crate::antennas::polarization::PolarizationWeights;
use crate::constants::SPEED_OF_LIGHT;

/// Smallest cosine of incidence; smaller ones are clamped, as coefficients have their limits there.
const GRAZING: f64 = 1e-12;

/// Material of a surface at the frequency of the radar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// Constant response at every angle.
    Constant(SurfaceResponse),
    /// Fresnel coefficients of a permittivity.
    Dielectric(Dielectric),
}

/// A perfect conductor.
pub const CONDUCTOR: Material = Material::Constant(SurfaceResponse {
    reflection: Complex64::new(-1.0, 0.0),
    albedo: 0.0,
});

/// Response of a surface at one angle of incidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceResponse {
    /// Field reflection coefficient of the specular part; -1 for a perfect conductor.
    pub reflection: Complex64,
    /// Diffuse albedo: power scattered by Lambert's law over incident power.
    pub albedo: f64,
}

/// A half-space or a slab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Relative permittivity `eps' - j eps''`.
    pub permittivity: Complex64,
    /// Thickness of a slab with air behind it [m]; none for a half-space.
    pub thickness: Option<f64>,
    /// Roughness of the surface.
    pub roughness: Roughness,
}

/// Roughness: share of the reflected field that is scattered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Roughness {
    /// Smooth surface, nothing scattered.
    Smooth,
    /// Gaussian heights of this rms [m].
    Height(f64),
    /// Scattered part S of the field: `S^2` of the power, at every angle (effective roughness).
    Scattering(f64),
}

impl SurfaceResponse {
    /// Specular and diffuse power over incident power.
    pub fn power(&self) -> f64 {
        self.reflection.norm_sqr() + self.albedo
    }

    /// Specular weight `(j / 4 pi) Gamma dA / 2` of an area [m^2].
    pub fn specular(&self, area: f64) -> Complex64 {
        Complex64::new(0.0, 1.0 / (8.0 * PI)) * self.reflection * area
    }

    /// Diffuse weight `(lambda / 4 pi) sqrt(rho dA / pi)` of an area [m^2] over the sum of the cosines to antennas in
    /// unit directions, which amplitudes are proportional to, and times the root of their product.
    pub fn diffuse(&self, area: f64, wavelength: f64, normal: DVec3, directions: [DVec3; 2]) -> f64 {
        let [t, r] = directions.map(|direction| (-normal.dot(direction)).max(0.0));
        if t == 0.0 || r == 0.0 {
            return 0.0;
        }
        wavelength / (4.0 * PI) * (self.albedo * area / PI).sqrt() * (t * r).sqrt() / (t + r)
    }
}

impl Material {
    /// Response of a surface with a unit normal to antennas in unit directions. The cosine of incidence is the mean of
    /// both cosines, which is exact in the specular direction.
    pub fn response_to(&self, array: &Array, normal: DVec3, [t, r]: [DVec3; 2]) -> SurfaceResponse {
        let cosine = 0.5 * ((-normal.dot(t)).max(0.0) + (-normal.dot(r)).max(0.0));
        let seen = array.polarization.map(|e| PolarizationWeights::by(e, normal, t, r));
        self.response(cosine, SPEED_OF_LIGHT / array.frequency, seen)
    }

    /// Response at a cosine of incidence and a wavelength [m], as received by antennas; none: without a polarisation.
    pub fn response(&self, cosine: f64, wavelength: f64, seen: Option<PolarizationWeights>) -> SurfaceResponse {
        match self {
            // r_TE = -r_TM = reflection.
            Self::Constant(constant) => SurfaceResponse {
                reflection: constant.reflection * seen.map_or(1.0, |seen| seen.te + seen.tm),
                ..*constant
            },
            Self::Dielectric(dielectric) => dielectric.response(cosine, wavelength, seen),
        }
    }

    /// Reflection coefficients `r_TE` and `r_TM` for the field across the plane of incidence and in it, at a cosine of
    /// incidence and a wavelength [m]; of a rough surface the coherent part.
    pub fn reflection_coefficients(&self, cosine: f64, wavelength: f64) -> [Complex64; 2] {
        match self {
            Self::Constant(constant) => [constant.reflection, -constant.reflection],
            Self::Dielectric(dielectric) => {
                let (cosine, k) = (cosine.max(GRAZING), TAU / wavelength);
                let (kept, _) = dielectric.roughness.parts(cosine, k);
                dielectric.fresnel(cosine, k).map(|r| r * kept)
            }
        }
    }
}

impl Material {
    /// True if some of the reflected power is diffuse.
    pub fn is_diffuse(&self) -> bool {
        match self {
            Self::Constant(response) => response.albedo > 0.0,
            Self::Dielectric(dielectric) => match dielectric.roughness {
                Roughness::Smooth => false,
                Roughness::Height(height) => height > 0.0,
                Roughness::Scattering(part) => part > 0.0,
            },
        }
    }
}

/// Reflection coefficient without a polarisation, docs/theory.md eq. (5), from `r_TE` and `r_TM`: the power is the mean
/// of both polarisations, the phase belongs to the field across the plane of incidence. A mean of both fields would
/// vanish where two walls meet at a right angle.
pub(crate) fn mean_reflection([te, tm]: [Complex64; 2]) -> Complex64 {
    let power = 0.5 * (te.norm_sqr() + tm.norm_sqr());
    if te == Complex64::ZERO {
        return Complex64::from(power.sqrt());
    }
    te * (power / te.norm_sqr()).sqrt()
}

impl Dielectric {
    /// Response by docs/theory.md eqs. (4) to (6).
    fn response(&self, cosine: f64, wavelength: f64, seen: Option<PolarizationWeights>) -> SurfaceResponse {
        let (cosine, k) = (cosine.max(GRAZING), TAU / wavelength);

        // The polarisations of the antennas, and the part that is scattered.
        let [te, tm] = self.fresnel(cosine, k);
        let gamma = seen.map_or_else(|| mean_reflection([te, tm]), |seen| te * seen.te - tm * seen.tm);
        let (kept, scattered) = self.roughness.parts(cosine, k);
        SurfaceResponse {
            reflection: gamma * kept,
            albedo: gamma.norm_sqr() * scattered,
        }
    }

    /// Fresnel coefficients `r_TE` and `r_TM`, docs/theory.md eq. (4).
    fn fresnel(&self, cosine: f64, k: f64) -> [Complex64; 2] {
        // Fresnel's coefficients of the half-space; eps - sin^2 so that it is exact for eps = 1.
        let eps = self.permittivity;
        let q = root(eps - 1.0 + cosine * cosine);
        let te = (cosine - q) / (cosine + q);
        let tm = (eps * cosine - q) / (eps * cosine + q);

        // A slab adds the reflections from the other side.
        let there_and_back = self
            .thickness
            .map(|thickness| (Complex64::new(0.0, -2.0 * k * thickness) * q).exp());
        [te, tm].map(|r| match there_and_back {
            None => r,
            Some(turn) => r * (1.0 - turn) / (1.0 - r * r * turn),
        })
    }
}

impl Roughness {
    /// Coherent factor of the field and scattered share of the power, docs/theory.md eq. (6).
    fn parts(self, cosine: f64, k: f64) -> (f64, f64) {
        match self {
            Self::Smooth => (1.0, 0.0),
            Self::Height(height) => {
                let g = (2.0 * k * height * cosine).powi(2);
                ((-0.5 * g).exp(), -(-g).exp_m1())
            }
            Self::Scattering(part) => ((1.0 - part * part).sqrt(), part * part),
        }
    }
}

/// Square root with a non-positive imaginary part, of a number with one: waves that decay inside the material.
fn root(z: Complex64) -> Complex64 {
    let large = (0.5 * (z.norm_sqr().sqrt() + z.re.abs())).sqrt();
    if large == 0.0 {
        return Complex64::ZERO;
    }
    let small = 0.5 * z.im.abs() / large;
    if z.re >= 0.0 {
        Complex64::new(large, -small)
    } else {
        Complex64::new(small, -large)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::SPEED_OF_LIGHT;

    const WAVELENGTH: f64 = SPEED_OF_LIGHT / 60e9;
    const TE: Option<PolarizationWeights> = Some(PolarizationWeights::TE);
    const TM: Option<PolarizationWeights> = Some(PolarizationWeights::TM);
    const SKIN: Complex64 = Complex64::new(7.975, -10.904);

    fn half_space(permittivity: Complex64) -> Dielectric {
        Dielectric {
            permittivity,
            thickness: None,
            roughness: Roughness::Smooth,
        }
    }

    #[test]
    fn what_is_no_denser_than_air_reflects_nothing() {
        let air = Material::Dielectric(half_space(Complex64::ONE));
        for seen in [None, TE, TM] {
            for cosine in [1.0, 0.5, 1e-3, 0.0, -1.0] {
                assert_eq!(air.response(cosine, WAVELENGTH, seen).reflection, Complex64::ZERO);
            }
        }
    }

    #[test]
    fn roots_square_to_what_they_are_of_and_fade() {
        let z = |re: f64, im: f64| Complex64::new(re, im);
        for z in [
            z(2.0, -0.0),
            z(-2.0, -0.0),
            z(-2.0, 0.0),
            z(0.0, -3e6),
            z(-4.0, -1e-9),
            z(5.2, -0.3),
        ] {
            let root = root(z);
            assert!((root * root - z).norm() <= 1e-15 * z.norm(), "{z}");
            assert!(root.re >= 0.0 && root.im <= 0.0, "{z}");
        }
        assert_eq!(root(Complex64::ZERO), Complex64::ZERO);
    }

    #[test]
    fn reflection_coefficients_are_what_antennas_of_one_polarisation_see() {
        let skin = half_space(SKIN);
        let rough = Dielectric {
            roughness: Roughness::Height(0.3e-3),
            ..skin
        };
        let constant = SurfaceResponse {
            reflection: Complex64::new(0.3, -0.2),
            albedo: 0.1,
        };
        for material in [
            Material::Dielectric(skin),
            Material::Dielectric(rough),
            Material::Constant(constant),
        ] {
            for cosine in [1.0, 0.6, 0.1] {
                let coefficients = material.reflection_coefficients(cosine, WAVELENGTH);
                let [te, tm] = [TE, TM].map(|seen| material.response(cosine, WAVELENGTH, seen).reflection);
                assert_eq!(coefficients, [te, -tm]);
            }
        }
    }
}
