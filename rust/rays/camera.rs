//! Camera: image plane of the sensor, directions of pixels, and tiles.

use std::ops::Range;

use glam::DVec3;

use crate::error::{Error, Result};

/// Largest number of pixels of an image: pixel numbers have 32 bits.
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
    /// Position of the optical axis, in pixels from the left edge of the image; the centre of column j is j + 1/2.
    pub axis_column: f64,
    /// Position of the optical axis, in pixels from the top edge of the image.
    pub axis_row: f64,
}

/// Rectangle of the image plane with a ray through its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Plane coordinate u = y/x of the centre.
    pub u: f64,
    /// Plane coordinate v = z/x of the centre.
    pub v: f64,
    /// Width in u.
    pub du: f64,
    /// Height in v.
    pub dv: f64,
}

impl Cell {
    /// Unit direction through the centre.
    pub fn direction(&self) -> DVec3 {
        DVec3::new(1.0, self.u, self.v).normalize()
    }

    /// Solid angle [sr], du dv / w^3.
    pub fn solid_angle(&self) -> f64 {
        self.du * self.dv / (1.0 + self.u * self.u + self.v * self.v).powf(1.5)
    }

    /// Cell of equal size about a point that is offset by `along_u` widths in u and `along_v` heights in v.
    pub fn about(&self, [along_u, along_v]: [f64; 2]) -> Self {
        Self {
            u: self.u + along_u * self.du,
            v: self.v + along_v * self.dv,
            ..*self
        }
    }

    /// Edges du and dv of the patch that the cell covers on the plane with a unit normal at a distance along its ray:
    /// dx/du du and dx/dv dv [m].
    pub fn edges(&self, distance: f64, normal: DVec3) -> [DVec3; 2] {
        let w = (1.0 + self.u * self.u + self.v * self.v).sqrt();
        let d = DVec3::new(1.0, self.u, self.v) / w;
        let edge = |axis: DVec3, coordinate: f64, width: f64| {
            let dd = (axis - d * (coordinate / w)) / w; // dd/du of d = (1, u, v) / w
            let dr = -distance * normal.dot(dd) / normal.dot(d); // dR/du on the plane
            (dr * d + distance * dd) * width
        };
        [edge(DVec3::Y, self.u, self.du), edge(DVec3::Z, self.v, self.dv)]
    }
}

/// Rectangle of pixels.
#[derive(Clone, Copy, Debug)]
pub struct PixelTile {
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
    /// Image plane with the axis in its middle, from half its extents tan(field of view / 2).
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

    /// Refuse planes without pixels or without extent.
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

    /// Plane coordinates of the centres of all pixels: smallest and largest u, and v.
    pub fn ranges(&self) -> [[f64; 2]; 2] {
        let (first, last) = (self.center(0, 0), self.center(self.rows - 1, self.columns - 1));
        [[last.0, first.0], [last.1, first.1]]
    }

    /// Row and column of a point `(u, v)`, in pixels from the upper left corner.
    pub fn pixel(&self, [u, v]: [f64; 2]) -> (f64, f64) {
        (self.axis_row - v / self.dv, self.axis_column - u / self.du)
    }

    /// Rows and columns of the pixels that show some of a rectangle, ranges of u and v.
    pub fn pixels_of(&self, u: [f64; 2], v: [f64; 2]) -> [Range<usize>; 2] {
        let range = |[low, high]: [f64; 2], axis: f64, width: f64, number: usize| {
            let first = (axis - high / width).floor().max(0.0) as usize;
            let end = (axis - low / width).floor().min(number as f64 - 1.0) + 1.0;
            first..end.max(0.0) as usize
        };
        [
            range(v, self.axis_row, self.dv, self.rows),
            range(u, self.axis_column, self.du, self.columns),
        ]
    }

    /// Cell of the plane that a pixel covers.
    pub fn cell(&self, row: usize, column: usize) -> Cell {
        let (u, v) = self.center(row, column);
        let (du, dv) = (self.du, self.dv);
        Cell { u, v, du, dv }
    }

    /// Image plane with every pixel cut into `parts` x `parts`.
    pub fn divided(&self, parts: usize) -> Self {
        Self {
            rows: self.rows * parts,
            columns: self.columns * parts,
            du: self.du / parts as f64,
            dv: self.dv / parts as f64,
            axis_column: self.axis_column * parts as f64,
            axis_row: self.axis_row * parts as f64,
        }
    }

    /// Unit direction through the centre of a pixel.
    pub fn direction(&self, row: usize, column: usize) -> DVec3 {
        let (u, v) = self.center(row, column);
        DVec3::new(1.0, u, v).normalize()
    }

    /// Tile of a number from 0 to [`Self::num_tiles`], row by row.
    pub fn tile(&self, index: usize) -> PixelTile {
        let per_row = self.columns.div_ceil(TILE);
        let (row, column) = (index / per_row * TILE, index % per_row * TILE);
        PixelTile {
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

/// Morton code of a pixel: bits of row and column interleaved, so that near pixels have near codes.
pub fn morton(row: u32, column: u32) -> u64 {
    spread(row) << 1 | spread(column)
}

/// Bits of a number with a zero between each two.
fn spread(number: u32) -> u64 {
    let mut bits = u64::from(number);
    for (shift, mask) in [
        (16, 0x0000_ffff_0000_ffff),
        (8, 0x00ff_00ff_00ff_00ff),
        (4, 0x0f0f_0f0f_0f0f_0f0f),
        (2, 0x3333_3333_3333_3333),
        (1, 0x5555_5555_5555_5555),
    ] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANE: ImagePlane = ImagePlane::centered(20, 30, 0.6, 0.4);

    #[test]
    fn pixels_look_from_the_upper_left_on_in_the_whole_and_in_a_cut_out() {
        let d = PLANE.direction(0, 0);
        assert!(d.x > 0.0 && d.y > 0.0 && d.z > 0.0);
        assert!((d.y / d.x - (0.6 - 0.02)).abs() < 1e-15 && (d.z / d.x - (0.4 - 0.02)).abs() < 1e-15);
        let cut = ImagePlane {
            rows: 7,
            columns: 5,
            axis_column: PLANE.axis_column - 3.0,
            axis_row: PLANE.axis_row - 11.0,
            ..PLANE
        };
        assert_eq!(cut.direction(2, 4), PLANE.direction(13, 7));
        assert!((cut.cell(2, 4).solid_angle() - PLANE.cell(13, 7).solid_angle()).abs() < 1e-18);
    }

    #[test]
    fn mortons_order_visits_squares_one_after_the_other() {
        let order = [(0, 0), (0, 1), (1, 0), (1, 1), (0, 2)].map(|(row, column)| morton(row, column));
        assert_eq!(order, [0, 1, 2, 3, 4]);
        assert_eq!(morton(u32::MAX, u32::MAX), u64::MAX);
    }

    #[test]
    fn cells_of_a_divided_plane_fill_the_pixels_they_come_from() {
        let fine = PLANE.divided(4);
        let (mut u, mut v, mut angle) = (0.0, 0.0, 0.0);
        for (row, column) in (0..4).flat_map(|i| (0..4).map(move |j| (4 * 13 + i, 4 * 7 + j))) {
            let cell = fine.cell(row, column);
            u += cell.u / 16.0;
            v += cell.v / 16.0;
            angle += cell.solid_angle();
        }
        let whole = PLANE.cell(13, 7);
        assert!((u - whole.u).abs() < 1e-15 && (v - whole.v).abs() < 1e-15);
        assert!((angle / whole.solid_angle() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn edges_of_a_cell_lie_in_the_plane_it_shows_and_reach_as_far_as_its_rays() {
        let cell = Cell {
            u: 0.3,
            v: -0.2,
            du: 1e-6,
            dv: 2e-6,
        };
        let normal = DVec3::new(-0.8, 0.36, 0.48);
        let at = |u: f64, v: f64| {
            // Where the ray meets the plane through the point 2 m along the cell's.
            let d = DVec3::new(1.0, u, v);
            d * (2.0 * normal.dot(cell.direction()) / normal.dot(d))
        };
        let [along_u, along_v] = cell.edges(2.0, normal);
        assert!(normal.dot(along_u).abs() < 1e-20 && normal.dot(along_v).abs() < 1e-20);
        let (half_u, half_v) = (0.5 * cell.du, 0.5 * cell.dv);
        assert!((at(cell.u + half_u, cell.v) - at(cell.u - half_u, cell.v) - along_u).length() < 1e-14);
        assert!((at(cell.u, cell.v + half_v) - at(cell.u, cell.v - half_v) - along_v).length() < 1e-14);
    }

    #[test]
    fn solid_angles_add_up_to_that_of_the_pyramid() {
        // Rectangle seen from its foot point: 4 asin(a b / sqrt((1 + a^2)(1 + b^2))).
        let fine = ImagePlane::centered(400, 400, 0.6, 0.4);
        let sum: f64 = (0..400)
            .flat_map(|i| (0..400).map(move |j| fine.cell(i, j).solid_angle()))
            .sum();
        let (a, b) = (0.6_f64, 0.4_f64);
        let exact = 4.0 * (a * b / ((1.0 + a * a) * (1.0 + b * b)).sqrt()).asin();
        assert!((sum - exact).abs() < 1e-5 * exact); // midpoint rule, (du)^2 / 6
    }
}
