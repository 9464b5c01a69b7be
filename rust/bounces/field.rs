//! Fields along ray tubes: launch, reflection, and radiation from a surface.

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::polarization::{NORMAL, transverse};
use crate::scattering::material::mean_reflection;

/// Field relative to the launched field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Field {
    /// Scalar field, of antennas without a polarisation.
    Scalar(Complex64),
    /// Real and imaginary part of a vector field across the ray.
    Vector([DVec3; 2]),
}

/// A ray that meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Incidence {
    /// Unit direction of the ray.
    pub direction: DVec3,
    /// Unit normal towards the incident side.
    pub normal: DVec3,
    /// `r_TE` and `r_TM`.
    pub coefficients: [Complex64; 2],
}

impl Incidence {
    /// Cosine of the angle of incidence.
    pub fn cosine(&self) -> f64 {
        -self.normal.dot(self.direction)
    }

    /// Unit direction of the specular reflection.
    pub fn reflected(&self) -> DVec3 {
        self.direction + 2.0 * self.cosine() * self.normal
    }
}

impl Field {
    /// Field launched by an antenna of a polarisation, or of none, in a unit direction.
    pub fn launch(polarization: Option<DVec3>, direction: DVec3) -> Self {
        polarization.map_or(Self::Scalar(Complex64::ONE), |e| {
            Self::Vector([transverse(e, direction), DVec3::ZERO])
        })
    }

    /// Power relative to the launched power.
    pub fn power(&self) -> f64 {
        match self {
            Self::Scalar(field) => field.norm_sqr(),
            Self::Vector([re, im]) => re.length_squared() + im.length_squared(),
        }
    }

    /// Product with a complex factor.
    pub fn times(&self, factor: Complex64) -> Self {
        match *self {
            Self::Scalar(field) => Self::Scalar(field * factor),
            Self::Vector(field) => Self::Vector(times(field, factor)),
        }
    }

    /// Field after the reflection.
    pub fn reflect(&self, incidence: &Incidence) -> Self {
        match *self {
            Self::Scalar(field) => Self::Scalar(field * mean_reflection(incidence.coefficients)),
            Self::Vector(field) => Self::Vector(reflect(field, incidence)),
        }
    }

    /// Field radiated in a unit direction to an antenna with the transverse unit vector `received`: W of docs/theory.md
    /// eqs. (8) and (9).
    pub fn radiate(&self, incidence: &Incidence, direction: DVec3, received: Option<DVec3>) -> Complex64 {
        match (*self, received) {
            (Self::Vector(field), Some(received)) => {
                let (n, k) = (incidence.normal, incidence.direction);
                let (reflected, reflected_field) = (incidence.reflected(), reflect(field, incidence));
                let part = |i: usize| {
                    let magnetic = k.cross(field[i]) + reflected.cross(reflected_field[i]);
                    let electric = n.cross(field[i] + reflected_field[i]);
                    -0.5 * received.dot(n.cross(magnetic) + direction.cross(electric))
                };
                Complex64::new(part(0), part(1))
            }
            (Self::Scalar(field), _) => {
                let mean = 0.5 * (incidence.cosine() + incidence.normal.dot(direction));
                field * mean_reflection(incidence.coefficients) * mean
            }
            (Self::Vector(_), None) => Complex64::ZERO,
        }
    }
}

fn times([re, im]: [DVec3; 2], factor: Complex64) -> [DVec3; 2] {
    [re * factor.re - im * factor.im, re * factor.im + im * factor.re]
}

/// Reflected vector field `E_r = r_TE (E.s) s + r_TM (E.p) p'`, s across the plane of incidence, p and p' in it.
fn reflect(field: [DVec3; 2], incidence: &Incidence) -> [DVec3; 2] {
    let (n, k) = (incidence.normal, incidence.direction);
    let across = n.cross(k);
    let s = if across.length_squared() > NORMAL {
        across.normalize()
    } else {
        k.any_orthonormal_vector()
    };
    let (p, p_reflected) = (k.cross(s), incidence.reflected().cross(s));
    let along = |axis: DVec3| Complex64::new(field[0].dot(axis), field[1].dot(axis));
    let [te, tm] = incidence.coefficients;
    let (te, tm) = (te * along(s), tm * along(p));
    [s * te.re + p_reflected * tm.re, s * te.im + p_reflected * tm.im]
}
