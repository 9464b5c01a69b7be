//! Depth images of other programs: distance, normal and reflection of every pixel.

use glam::DVec3;
use num_complex::Complex64;

use crate::error::{Error, Result, fits_memory};
use crate::rays::camera::ImagePlane;
use crate::scattering::material_points::POINT_SIZE;
use crate::scattering::patch::Patch;

/// Surface elements of an image of another program, one per pixel, row by row. The frames of the bodies are the sensor
/// frame at the time of the image.
pub struct Surfels {
    /// Image plane.
    pub plane: ImagePlane,
    /// Distance along the ray [m]; no return where it is not a positive, finite number.
    pub distance: Vec<f64>,
    /// Unit normals towards the incident side, sensor frame.
    pub normal: Vec<DVec3>,
    /// Field reflection coefficient of the specular part.
    pub reflection: Vec<Complex64>,
    /// Diffuse albedo.
    pub albedo: Vec<f64>,
    /// Number of the body; no return where it is negative.
    pub body: Vec<i32>,
    /// Number of bodies.
    pub num_bodies: usize,
}

impl Surfels {
    /// Check the image plane and the numbers of the bodies.
    pub(crate) fn check(&self) -> Result<()> {
        self.plane.check()?;
        fits_memory("scatterers", &[self.plane.rows, self.plane.columns], POINT_SIZE)?;
        let is_beyond = |body: &&i32| usize::try_from(**body).is_ok_and(|body| body >= self.num_bodies);
        match self.body.iter().find(is_beyond) {
            Some(body) => Err(Error::value("body", format!("numbers below {}", self.num_bodies), body)),
            None => Ok(()),
        }
    }

    /// Patch of surface of one pixel; none without a return.
    pub(crate) fn patch(&self, pixel: usize) -> Option<Patch> {
        let (distance, normal) = (self.distance[pixel], self.normal[pixel]);
        if !(distance > 0.0 && distance.is_finite() && normal.is_finite()) {
            return None;
        }
        Some(Patch {
            index: pixel,
            body: u32::try_from(self.body[pixel]).ok()?,
            cell: self.plane.cell(pixel / self.plane.columns, pixel % self.plane.columns),
            distance,
            normal,
        })
    }
}
