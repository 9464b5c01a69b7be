//! Reflectance of every pixel, for depth images like a camera's.

use glam::DVec3;
use rayon::prelude::*;

use crate::antennas::polarization::PolarizationWeights;
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::scattering::material::Material;

/// Power reflectance of the material at every pixel, specular and diffuse, for antennas at the centre of the array;
/// zero where nothing was hit. Pixels have a body, negative for none, a cosine of incidence, a unit normal and the unit
/// direction of their ray.
pub fn pixel_reflectance(
    materials: &[Material],
    (bodies, cosines): (&[i32], &[f64]),
    (normals, directions): (&[[f64; 3]], &[[f64; 3]]),
    frequency: f64,
    polarization: Option<DVec3>,
    cancel: &Cancel,
) -> Result<Vec<f64>> {
    let wavelength = SPEED_OF_LIGHT / frequency;
    let of_pixel = |pixel: usize| {
        cancel.check()?;
        let body = usize::try_from(bodies[pixel]).ok();
        let Some(material) = body.and_then(|body| materials.get(body)) else {
            return Ok(0.0);
        };
        let direction = DVec3::from_array(directions[pixel]);
        let seen =
            polarization.map(|e| PolarizationWeights::by(e, DVec3::from_array(normals[pixel]), direction, direction));
        Ok(material.response(cosines[pixel], wavelength, seen).power())
    };
    (0..bodies.len()).into_par_iter().map(of_pixel).collect()
}
