//! What a surface does to a wave: Fresnel's coefficients of half-spaces and slabs, and what roughness makes of them.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::antennas::polarization::Seen;

/// Cosines of incidence from here down are taken for this one: coefficients have their limits there.
const GRAZING: f64 = 1e-12;

/// A surface, by numbers that hold at the frequency of the radar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// The same at every angle.
    Constant(Response),
    /// What Fresnel says of a permittivity.
    Dielectric(Dielectric),
}

/// A perfect conductor.
pub const CONDUCTOR: Material = Material::Constant(Response {
    reflection: Complex64::new(-1.0, 0.0),
    albedo: 0.0,
});

/// What comes back from a surface at one angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Field reflection coefficient of the specular part; -1 for a perfect conductor.
    pub reflection: Complex64,
    /// Diffuse albedo: power scattered after Lambert over incident power.
    pub albedo: f64,
}

/// A half-space or a slab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Relative permittivity `eps' - j eps''`.
    pub permittivity: Complex64,
    /// Thickness of a slab with air behind it [m]; none for a half-space.
    pub thickness: Option<f64>,
    /// How its surface scatters.
    pub roughness: Roughness,
}

/// How much of what is reflected is scattered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Roughness {
    /// Nothing.
    Smooth,
    /// What heights of this rms [m] turn out of phase.
    Height(f64),
    /// This part S of the field: `S^2` of the power, at every angle (effective roughness).
    Scattering(f64),
}

impl Response {
    /// Power that comes back in either way over incident power.
    pub fn power(&self) -> f64 {
        self.reflection.norm_sqr() + self.albedo
    }
}

impl Material {
    /// What comes back at a cosine of incidence of waves of a length [m], as antennas see it.
    pub fn response(&self, cosine: f64, wavelength: f64, seen: Seen) -> Response {
        match self {
            // r_TE = -r_TM = reflection.
            Self::Constant(constant) => Response {
                reflection: constant.reflection * (seen.te + seen.tm),
                ..*constant
            },
            Self::Dielectric(dielectric) => dielectric.response(cosine, wavelength, seen),
        }
    }

    /// What is mirrored of the field across the plane of incidence and of that in it, `r_TE` and `r_TM` with the coherent
    /// part of what a rough surface reflects, at a cosine of incidence of waves of a length [m].
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
    /// Whether anything of what comes back is diffuse.
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

impl Dielectric {
    /// README eqs. (4) to (6).
    fn response(&self, cosine: f64, wavelength: f64, seen: Seen) -> Response {
        let (cosine, k) = (cosine.max(GRAZING), TAU / wavelength);

        // What antennas see of it, and what part of that is scattered.
        let [te, tm] = self.fresnel(cosine, k);
        let gamma = te * seen.te - tm * seen.tm;
        let (kept, scattered) = self.roughness.parts(cosine, k);
        Response {
            reflection: gamma * kept,
            albedo: gamma.norm_sqr() * scattered,
        }
    }

    /// README eq. (4).
    fn fresnel(&self, cosine: f64, k: f64) -> [Complex64; 2] {
        // Fresnel's coefficients of the half-space; eps - sin^2 so that it is exact for eps = 1.
        let eps = self.permittivity;
        let q = root(eps - 1.0 + cosine * cosine);
        let te = (cosine - q) / (cosine + q);
        let tm = (eps * cosine - q) / (eps * cosine + q);

        // Of the slab: the waves that come back from its other side.
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
    /// What is kept of the field, and what is scattered of the power, README eq. (6).
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

/// The square root of a number with no positive imaginary part that has none either: waves that fade as they go in.
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

    const WAVELENGTH: f64 = 299_792_458.0 / 60e9;

    fn half_space(permittivity: Complex64) -> Dielectric {
        Dielectric {
            permittivity,
            thickness: None,
            roughness: Roughness::Smooth,
        }
    }

    fn gamma(dielectric: Dielectric, cosine: f64, seen: Seen) -> Complex64 {
        Material::Dielectric(dielectric)
            .response(cosine, WAVELENGTH, seen)
            .reflection
    }

    #[test]
    fn roots_square_to_what_they_are_of_and_fade() {
        for (re, im) in [
            (2.0, -0.0),
            (-2.0, -0.0),
            (-2.0, 0.0),
            (0.0, -3e6),
            (-4.0, -1e-9),
            (5.2, -0.3),
        ] {
            let z = Complex64::new(re, im);
            let root = root(z);
            assert!((root * root - z).norm() <= 1e-15 * z.norm(), "{z}");
            assert!(root.re >= 0.0 && root.im <= 0.0, "{z}");
        }
        assert_eq!(root(Complex64::ZERO), Complex64::ZERO);
    }

    #[test]
    fn glass_of_index_three_halves_reflects_a_fifth_of_the_field_and_nothing_at_brewsters_angle() {
        let glass = half_space(Complex64::new(2.25, 0.0));
        for seen in [Seen::SCALAR, Seen::TE, Seen::TM] {
            assert!((gamma(glass, 1.0, seen) + 0.2).norm() < 1e-15);
        }
        let brewster = 1.5_f64.atan().cos();
        assert!(gamma(glass, brewster, Seen::TM).norm() < 1e-15);
        // At Brewster's angle r_TE = cos 2 theta.
        assert!((gamma(glass, brewster, Seen::TE) - (2.0 * 1.5_f64.atan()).cos()).norm() < 1e-15);
    }

    #[test]
    fn what_is_no_denser_than_air_reflects_nothing_and_what_conducts_everything() {
        let (air, metal) = (half_space(Complex64::ONE), half_space(Complex64::new(1.0, -1e24)));
        for cosine in [1.0, 0.5, 1e-3, 0.0, -1.0] {
            for seen in [Seen::SCALAR, Seen::TE, Seen::TM] {
                assert_eq!(gamma(air, cosine, seen), Complex64::ZERO);
            }
        }
        for cosine in [1.0, 0.5, 1e-3] {
            for seen in [Seen::SCALAR, Seen::TE, Seen::TM] {
                assert!((gamma(metal, cosine, seen) + 1.0).norm() < 1e-8, "{cosine}");
            }
        }
    }

    #[test]
    fn waves_reflect_whole_beyond_the_critical_angle() {
        let thin = half_space(Complex64::new(0.25, 0.0)); // critical angle 30 degrees
        assert!((gamma(thin, 0.5, Seen::TE).norm() - 1.0).abs() < 1e-15);
        assert!((gamma(thin, 0.5, Seen::TM).norm() - 1.0).abs() < 1e-15);
        assert!(gamma(thin, 0.9, Seen::TE).norm() < 0.9);
    }

    #[test]
    fn slab_of_half_a_wavelength_vanishes_and_one_that_absorbs_is_a_half_space() {
        let (index, cosine) = (2.0_f64, 0.8_f64);
        let inside = (index * index - 1.0 + cosine * cosine).sqrt(); // n cos of the angle inside
        let slab = Dielectric {
            thickness: Some(0.5 * WAVELENGTH / inside),
            ..half_space(Complex64::new(index * index, 0.0))
        };
        assert!(gamma(slab, cosine, Seen::TE).norm() < 1e-15);
        assert!(gamma(slab, cosine, Seen::TM).norm() < 1e-15);
        assert!(gamma(slab, 1.0, Seen::SCALAR).norm() > 0.1);
        let skin = half_space(Complex64::new(7.975, -10.904));
        let thick = Dielectric {
            thickness: Some(0.02),
            ..skin
        };
        assert!((gamma(thick, cosine, Seen::TE) - gamma(skin, cosine, Seen::TE)).norm() < 1e-15);
    }

    #[test]
    fn mirrored_fields_are_what_antennas_of_one_polarisation_see() {
        let skin = half_space(Complex64::new(7.975, -10.904));
        let rough = Dielectric {
            roughness: Roughness::Height(0.3e-3),
            ..skin
        };
        let constant = Response {
            reflection: Complex64::new(0.3, -0.2),
            albedo: 0.1,
        };
        for material in [
            Material::Dielectric(skin),
            Material::Dielectric(rough),
            Material::Constant(constant),
        ] {
            for cosine in [1.0, 0.6, 0.1] {
                let [te, tm] = material.reflection_coefficients(cosine, WAVELENGTH);
                assert_eq!(te, material.response(cosine, WAVELENGTH, Seen::TE).reflection);
                assert_eq!(-tm, material.response(cosine, WAVELENGTH, Seen::TM).reflection);
            }
        }
    }

    #[test]
    fn specular_and_scattered_parts_are_what_is_reflected() {
        let skin = half_space(Complex64::new(7.975, -10.904));
        for roughness in [Roughness::Height(0.3e-3), Roughness::Scattering(0.6)] {
            for cosine in [1.0, 0.5, 0.1] {
                let rough = Material::Dielectric(Dielectric { roughness, ..skin });
                let power = rough.response(cosine, WAVELENGTH, Seen::SCALAR).power();
                assert!((power - gamma(skin, cosine, Seen::SCALAR).norm_sqr()).abs() < 1e-15);
            }
        }
    }
}
