//! Settings of sampling.

use std::f64::consts::PI;

use crate::antennas::beam::Beam;
use crate::error::{Error, Result, fits_memory};
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

/// Settings of the refinement.
#[derive(Clone, Copy, Debug)]
pub struct Refinement<'a> {
    /// Coarsest cells.
    pub base: ImagePlane,
    /// Sampling of a cell.
    pub sampling: Sampling,
    /// True if cells are split; all further settings but the beam and the turns are for these.
    pub is_adaptive: bool,
    /// Smallest cross-section of interest [m^2].
    pub rcs_floor: f64,
    /// True if the floor is lowered where the strongest echo in view is weak.
    pub follows_echo: bool,
    /// Largest number of rays; none: as many as the floor asks for.
    pub budget: Option<usize>,
    /// True if cells whose phase varies fast are integrated by edge terms.
    pub end_points: bool,
    /// Directions with enough gain; none: all.
    pub beam: Option<&'a Beam>,
    /// Largest difference of the phases of joined points from their mean, below half a turn [rad]; 0: no points are
    /// joined.
    pub join: f64,
    /// Option to leave out the parts of split quarters whose rays cannot return power.
    pub skip_dark: bool,
    /// Angle by which every body turns from the cast to the ends of its use, seen from the sensor [rad].
    pub turns: &'a [f64],
}

impl Refinement<'_> {
    /// Check the settings.
    pub fn check(&self) -> Result<()> {
        self.base.check()?;
        let (rows, columns) = (self.base.rows, self.base.columns);
        if self.is_adaptive && rows.max(columns) > MAX_SIDE {
            let expected = format!("at most {MAX_SIDE} cells along either side of the base grid");
            return Err(Error::value("resolution", expected, format!("{rows} x {columns}")));
        }
        // Bytes of a cell, at least.
        fits_memory("cells", &[rows, columns], 256)?;
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
