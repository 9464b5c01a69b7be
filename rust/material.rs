//! What a surface does to a wave.

use num_complex::Complex64;

/// Reflection of a surface, the same at every angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Field reflection coefficient of the mirror-like part; -1 for a perfect conductor.
    pub reflection: Complex64,
    /// Diffuse albedo: power scattered after Lambert over incident power.
    pub albedo: f64,
}

impl Material {
    /// Power that comes back in either way over incident power.
    pub fn reflectance(&self) -> f64 {
        self.reflection.norm_sqr() + self.albedo
    }
}
