//! Images of other programs: distance, normal and reflection of the surface in every pixel.

use glam::DVec3;
use num_complex::Complex64;

use crate::error::{Error, Result};
use crate::rays::camera::ImagePlane;
use crate::rays::scene::NO_BODY;
use crate::scattering::material::SurfaceResponse;

/// Surface elements of an image of another program, one per pixel, row by row. The frames of the bodies are the sensor
/// frame at the time of the image.
pub struct SurfaceImage {
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
    /// Range rate of every pixel beside the motion of its body [m/s]; none: all zero.
    pub range_rate: Option<Vec<f64>>,
    /// Start of the frame, since the image was taken [s].
    pub age: f64,
}

impl SurfaceImage {
    /// Check the image plane and the numbers of the bodies.
    pub fn check(&self) -> Result<()> {
        self.plane.check()?;
        let is_beyond = |body: &&i32| usize::try_from(**body).is_ok_and(|body| body >= self.num_bodies);
        match self.body.iter().find(is_beyond) {
            Some(body) => Err(Error::value("body", format!("numbers below {}", self.num_bodies), body)),
            None => Ok(()),
        }
    }

    /// Number of the body in a pixel, or [`NO_BODY`].
    pub fn body_of(&self, pixel: usize) -> u32 {
        let (distance, normal) = (self.distance[pixel], self.normal[pixel]);
        if distance > 0.0 && distance.is_finite() && normal.is_finite() {
            u32::try_from(self.body[pixel]).unwrap_or(NO_BODY)
        } else {
            NO_BODY
        }
    }

    /// Response of the surface in a pixel, at every angle.
    pub fn response_of(&self, pixel: usize) -> SurfaceResponse {
        SurfaceResponse {
            reflection: self.reflection[pixel],
            albedo: self.albedo[pixel],
        }
    }
}
