//! The image plane: which direction each pixel looks into, and its tiles.

use glam::DVec3;

use crate::error::{Error, Result};

/// Most pixels of an image; they are numbered in 32 bits.
const MAX_PIXELS: usize = 1 << 28;

/// Side of a tile [pixels].
pub const TILE: usize = 8;

/// Pinhole image of the sensor: row 0 on top (+z), column 0 on the left (+y); plane coordinates u = y/x, v = z/x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImagePlane {
    /// Pixels from top to bottom.
    pub rows: usize,
    /// Pixels from left to right.
    pub columns: usize,
    /// Width of a pixel in u: 1 / (horizontal focal length in pixels).
    pub du: f64,
    /// Height of a pixel in v: 1 / (vertical focal length in pixels).
    pub dv: f64,
    /// Where the axis passes, in pixels from the left edge of the image; the centre of column j is j + 1/2.
    pub axis_column: f64,
    /// Where the axis passes, in pixels from the top edge of the image.
    pub axis_row: f64,
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug)]
pub struct Tile {
    /// First row.
    pub row: usize,
    /// First column.
    pub column: usize,
    /// Number of rows, at most [`TILE`].
    pub rows: usize,
    /// Number of columns, at most [`TILE`].
    pub columns: usize,
}

impl ImagePlane {
    /// A plane with the axis in its middle, from half its extents tan(field of view / 2).
    pub const fn centered(rows: usize, columns: usize, half_width: f64, half_height: f64) -> Self {
        Self {
            rows,
            columns,
            du: 2.0 * half_width / columns as f64,
            dv: 2.0 * half_height / rows as f64,
            axis_column: 0.5 * columns as f64,
            axis_row: 0.5 * rows as f64,
        }
    }

    /// Refuses planes without pixels or without extent.
    pub fn check(&self) -> Result<()> {
        if self.rows == 0 || self.columns == 0 {
            let got = format!("{} x {}", self.rows, self.columns);
            return Err(Error::value("resolution", "at least one row and one column", got));
        }
        if self
            .rows
            .checked_mul(self.columns)
            .is_none_or(|pixels| pixels > MAX_PIXELS)
        {
            let got = format!("{} x {}", self.rows, self.columns);
            return Err(Error::value("resolution", format!("at most {MAX_PIXELS} rays"), got));
        }
        let sides = [self.du, self.dv];
        if sides.iter().any(|side| !side.is_finite() || *side <= 0.0) {
            return Err(Error::value(
                "field_of_view",
                "angles between 0 and 180 degrees",
                format!("pixels of {sides:?} in the plane at distance 1"),
            ));
        }
        let axis = [self.axis_column, self.axis_row];
        if axis.iter().any(|place| !place.is_finite()) {
            return Err(Error::value(
                "principal_point",
                "finite numbers [pixels]",
                format!("{axis:?}"),
            ));
        }
        Ok(())
    }

    /// Number of pixels.
    pub fn num_pixels(&self) -> usize {
        self.rows * self.columns
    }

    /// Plane coordinates (u, v) of the centre of a pixel.
    pub fn center(&self, row: usize, column: usize) -> (f64, f64) {
        // From the axis outwards, so that a centred image is exactly symmetric.
        let u = (self.axis_column - (column as f64 + 0.5)) * self.du;
        let v = (self.axis_row - (row as f64 + 0.5)) * self.dv;
        (u, v)
    }

    /// Unit direction through the centre of a pixel.
    pub fn direction(&self, row: usize, column: usize) -> DVec3 {
        let (u, v) = self.center(row, column);
        DVec3::new(1.0, u, v).normalize()
    }

    /// Solid angle of a pixel [sr], du dv / w^3.
    pub fn solid_angle(&self, row: usize, column: usize) -> f64 {
        let (u, v) = self.center(row, column);
        self.du * self.dv / (1.0 + u * u + v * v).powf(1.5)
    }

    /// The tile of a number from 0 to [`Self::num_tiles`], row by row.
    pub fn tile(&self, index: usize) -> Tile {
        let per_row = self.columns.div_ceil(TILE);
        let (row, column) = (index / per_row * TILE, index % per_row * TILE);
        Tile {
            row,
            column,
            rows: TILE.min(self.rows - row),
            columns: TILE.min(self.columns - column),
        }
    }

    /// Number of tiles that cover the image.
    pub fn num_tiles(&self) -> usize {
        self.rows.div_ceil(TILE) * self.columns.div_ceil(TILE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANE: ImagePlane = ImagePlane::centered(20, 30, 0.6, 0.4);

    #[test]
    fn first_pixel_looks_up_and_to_the_left() {
        let d = PLANE.direction(0, 0);
        assert!(d.x > 0.0 && d.y > 0.0 && d.z > 0.0);
        assert!((d.y / d.x - (0.6 - 0.02)).abs() < 1e-15 && (d.z / d.x - (0.4 - 0.02)).abs() < 1e-15);
    }

    #[test]
    fn a_cut_out_of_an_image_looks_where_the_whole_does() {
        let cut = ImagePlane {
            rows: 7,
            columns: 5,
            axis_column: PLANE.axis_column - 3.0,
            axis_row: PLANE.axis_row - 11.0,
            ..PLANE
        };
        assert_eq!(cut.direction(2, 4), PLANE.direction(13, 7));
        assert!((cut.solid_angle(2, 4) - PLANE.solid_angle(13, 7)).abs() < 1e-18);
    }

    #[test]
    fn tiles_cover_every_pixel_once() {
        let mut seen = vec![0; PLANE.num_pixels()];
        for tile in (0..PLANE.num_tiles()).map(|i| PLANE.tile(i)) {
            for row in tile.row..tile.row + tile.rows {
                for column in tile.column..tile.column + tile.columns {
                    seen[row * PLANE.columns + column] += 1;
                }
            }
        }
        assert!(seen.iter().all(|n| *n == 1));
    }

    #[test]
    fn solid_angles_add_up_to_that_of_the_pyramid() {
        // Rectangle seen from its foot point: 4 asin(a b / sqrt((1 + a^2)(1 + b^2))).
        let fine = ImagePlane::centered(400, 400, 0.6, 0.4);
        let sum: f64 = (0..400)
            .flat_map(|i| (0..400).map(move |j| fine.solid_angle(i, j)))
            .sum();
        let (a, b) = (0.6_f64, 0.4_f64);
        let exact = 4.0 * (a * b / ((1.0 + a * a) * (1.0 + b * b)).sqrt()).asin();
        assert!((sum - exact).abs() < 1e-5 * exact); // midpoint rule, (du)^2 / 6
    }
}
