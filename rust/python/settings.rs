//! Settings of a simulator, from a dict with a value per field.

use glam::DMat3;
use pyo3::prelude::*;

use super::synthesis::{level, method};
use crate::bounces::Limits;
use crate::error::{Error, Result};
use crate::frame::{self, RaySampling, Switches};
use crate::rays::camera::ImagePlane;
use crate::scattering::refinement::{Refinement, Sampling};

/// Image plane: rows, columns, width and height of a pixel at distance 1, and column and row of the axis [pixels].
#[derive(FromPyObject)]
pub(super) struct Plane(usize, usize, f64, f64, f64, f64);

/// Settings of a simulation, see the stub.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct SettingsFields {
    sampling: String,
    rotations: Vec<[[f64; 3]; 3]>,
    rays: Vec<Plane>,
    tubes: Vec<Plane>,
    image: Plane,
    rcs_floor: f64,
    follows_echo: bool,
    ray_budget: Option<usize>,
    gain_floor: Option<f64>,
    max_bounces: usize,
    bounce_floor: f64,
    retrace: f64,
    seed: u64,
    tolerance: f64,
    method: String,
    debug: Debug,
}

/// Switches of tests and benches, which change no result.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Debug {
    skip_empty: bool,
    reuse_tiles: bool,
    level: Option<String>,
}

impl TryFrom<SettingsFields> for frame::Settings {
    type Error = Error;

    fn try_from(settings: SettingsFields) -> Result<Self> {
        let of_rows = |rows: &[[f64; 3]; 3]| DMat3::from_cols_array_2d(rows).transpose();
        let rotations: Vec<DMat3> = settings.rotations.iter().map(of_rows).collect();
        let numbers = [rotations.len(), settings.rays.len(), settings.tubes.len()];
        if rotations.first() != Some(&DMat3::IDENTITY) || numbers != [numbers[0]; 3] {
            let expected = "the identity first, and equal numbers of planes of rays and of tubes";
            return Err(Error::value("rotations", expected, format!("{numbers:?}")));
        }
        let planes = |planes: Vec<Plane>| planes.into_iter().map(ImagePlane::from).collect();
        let (sampling, is_adaptive) = match settings.sampling.as_str() {
            "adaptive" => (Sampling::Footprint, true),
            "footprint" => (Sampling::Footprint, false),
            "point" => (Sampling::Point, false),
            name => {
                let expected = "'adaptive', 'footprint' or 'point'";
                return Err(Error::value("sampling", expected, format!("{name:?}")));
            }
        };
        let rays = RaySampling {
            planes: planes(settings.rays),
            sampling,
            refinement: is_adaptive.then_some(Refinement {
                rcs_floor: settings.rcs_floor,
                follows_echo: settings.follows_echo,
                budget: settings.ray_budget,
            }),
        };
        Ok(Self {
            rotations,
            rays,
            tubes: planes(settings.tubes),
            image: settings.image.into(),
            gain_floor: settings.gain_floor,
            debug: Switches {
                skip_empty: settings.debug.skip_empty,
                reuse_tiles: settings.debug.reuse_tiles,
                level: level(settings.debug.level.as_deref())?,
            },
            limits: Limits {
                max_bounces: settings.max_bounces,
                floor: settings.bounce_floor,
            },
            retrace: settings.retrace,
            seed: settings.seed,
            tolerance: settings.tolerance,
            method: method(&settings.method)?,
        })
    }
}

impl From<Plane> for ImagePlane {
    fn from(Plane(rows, columns, du, dv, axis_column, axis_row): Plane) -> Self {
        Self {
            rows,
            columns,
            du,
            dv,
            axis_column,
            axis_row,
        }
    }
}
