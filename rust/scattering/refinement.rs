//! Settings of sampling.

use std::f64::consts::PI;

use crate::error::{Error, Result};
use crate::rays::camera::ImagePlane;

/// Largest number of cells of the base grid, along either side: rows and columns of the finest have 23 bits.
const MAX_SIDE: usize = 1 << 14;

/// Largest number of times that a cell of the base grid is halved.
pub(crate) const MAX_LEVEL: usize = 9;

/// Residual error of a cell or quarter relative to the field of the smallest cross-section of interest, at which
/// splitting stops. Thousands of cells together then have a residual error of a tenth to a third of it (spheres of 5 to
/// 20 cm).
pub(crate) const SHARE: f64 = 1e-2;

/// Sampling of the surface behind a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// One phasor per cell as in Stetco et al., ICRA 2020, but with the weight of the surface, and no random phases. It
    /// does not converge; for comparison.
    Point,
    /// The phase varies linearly over the cell, tapered so that steep surfaces drop out.
    Footprint,
}

/// Settings of the refinement of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// Smallest cross-section of interest [m^2].
    pub rcs_floor: f64,
    /// True if the floor is lowered where the strongest echo in view is weak.
    pub follows_echo: bool,
    /// Largest number of rays; none: enough for the floor.
    pub budget: Option<usize>,
}

impl Refinement {
    /// Check the settings for a grid of coarsest cells.
    pub fn check(&self, base: &ImagePlane) -> Result<()> {
        let (rows, columns) = (base.rows, base.columns);
        if rows.max(columns) > MAX_SIDE {
            let expected = format!("at most {MAX_SIDE} cells along either side of the base grid");
            return Err(Error::value("resolution", expected, format!("{rows} x {columns}")));
        }
        if !(self.rcs_floor > 0.0 && self.rcs_floor.is_finite()) {
            return Err(Error::value("rcs_floor", "a positive number [m^2]", self.rcs_floor));
        }
        match self.budget {
            Some(budget) if budget < rows * columns => {
                let expected = format!("at least {}, the cells of the base grid", rows * columns);
                Err(Error::value("ray_budget", expected, budget))
            }
            _ => Ok(()),
        }
    }
}

/// Field times distance squared of a target of a cross-section [m^2], at a wavelength [m].
pub fn field_of(rcs: f64, wavelength: f64) -> f64 {
    wavelength * (rcs / (4.0 * PI)).sqrt()
}
