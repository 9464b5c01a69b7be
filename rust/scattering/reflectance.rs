//! Reflectance of every pixel, for depth images like those of a camera.

use glam::DVec3;
use rayon::prelude::*;

use crate::antennas::polarization::Seen;
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::rays::hits::Hits;
use crate::rays::smooth_hits::SmoothHits;
use crate::scattering::material::Material;

/// Power reflectance of the material at every pixel, specular and diffuse, for antennas at the centre of the array;
/// zero where nothing was hit. `smooth` is evaluated only for materials that depend on the angle.
pub fn reflectance<'a>(
    hits: &Hits,
    materials: &[Material],
    frequency: f64,
    polarization: Option<DVec3>,
    smooth: impl FnOnce() -> Result<&'a SmoothHits>,
    cancel: &Cancel,
) -> Result<Vec<f64>> {
    let wavelength = SPEED_OF_LIGHT / frequency;
    if materials.iter().all(|m| matches!(m, Material::Constant(_))) {
        let of = |m: &Material| m.response(1.0, wavelength, None).power();
        let per_body: Vec<f64> = materials.iter().map(of).collect();
        let of = |body: &u32| per_body.get(*body as usize).copied().unwrap_or(0.0);
        return Ok(hits.body.iter().map(of).collect());
    }
    let smooth = smooth()?;
    (0..hits.plane.num_pixels())
        .into_par_iter()
        .map(|pixel| {
            cancel.check()?;
            let Some(material) = materials.get(hits.body[pixel] as usize) else {
                return Ok(0.0);
            };
            let direction = hits
                .plane
                .direction(pixel / hits.plane.columns, pixel % hits.plane.columns);
            let seen = polarization.map(|e| Seen::by(e, smooth.normal[pixel], direction, direction));
            Ok(material.response(smooth.cosine[pixel], wavelength, seen).power())
        })
        .collect()
}
