//! Points of tiles, and their weights.

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::array::Array;

/// Point that stands for a part of a surface, in the sensor frame.
#[derive(Clone, Copy, Debug)]
pub struct TilePoint {
    /// Position [m].
    pub position: DVec3,
    /// Unit normal on the incident side.
    pub normal: DVec3,
    /// Number of the body.
    pub body: u32,
    /// Number of the triangle, or of the pixel of an image of another program.
    pub triangle: u32,
    /// Edges of the cell on the surface that the field is a mean over, where the body turns or beside an edge term [m];
    /// zero otherwise.
    pub edges: [DVec3; 2],
    /// Power of the frequency by which the field falls: number of axes of an edge term.
    pub order: u8,
}

/// Points in order, and their weights: one per point, or one per point and channel.
#[derive(Clone, Debug, Default)]
pub struct TilePoints {
    /// The points.
    pub points: Vec<TilePoint>,
    /// Weights `(point, channel)`, or `(point,)`; see [`crate::paths::scatterers::Scatterers`].
    pub weights: Vec<Complex64>,
}

impl TilePoints {
    /// Append a point, unless it has no power. `weight`: that for antennas in two unit directions.
    pub fn add(
        &mut self,
        point: TilePoint,
        array: &Array,
        has_common_weight: bool,
        weight: impl Fn([DVec3; 2]) -> Complex64,
    ) {
        let start = self.weights.len();
        if has_common_weight {
            self.weights.push(weight([point.position.normalize(); 2]));
        } else {
            let channels = 0..array.num_channels();
            self.weights
                .extend(channels.map(|channel| weight(array.directions(channel, point.position))));
        }
        if self.weights[start..].iter().all(|weight| *weight == Complex64::ZERO) {
            self.weights.truncate(start);
        } else {
            self.points.push(point);
        }
    }
}
