//! Points of tiles, and their weights.

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::array::Array;
use crate::paths::scatterers::PointKind;
use crate::rays::camera::Cell;

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
}

/// Nearest hit of a body.
#[derive(Clone, Copy, Debug)]
pub struct NearestHit {
    /// Number of the body.
    pub body: u32,
    /// Number of the triangle.
    pub triangle: u32,
    /// Distance along the ray to the triangle [m].
    pub distance: f64,
    /// Cell of the ray, and number of its sector.
    pub cell: Cell,
    pub sector: usize,
}

/// Points in order, and their weights: one per point, or one per point and channel.
#[derive(Clone, Debug, Default)]
pub struct TilePoints {
    /// The points.
    pub points: Vec<TilePoint>,
    /// Weights `(point, channel)`, or `(point,)`; see [`crate::paths::scatterers::Scatterers`].
    pub weights: Vec<Complex64>,
    /// Edges of the cell on the surface that the field of a point is a mean over, where bodies turn [m]; zero for the
    /// points that are missing.
    edges: Vec<[DVec3; 2]>,
    /// Kinds of the points; areas where they are missing.
    kinds: Vec<PointKind>,
}

impl TilePoints {
    /// Edges of the cell of a point on the surface [m].
    pub fn edges(&self, point: usize) -> [DVec3; 2] {
        self.edges.get(point).copied().unwrap_or_default()
    }

    /// Kind of a point.
    pub fn kind(&self, point: usize) -> PointKind {
        self.kinds.get(point).copied().unwrap_or_default()
    }

    /// Set the edges of the last point [m].
    pub fn set_edges(&mut self, edges: [DVec3; 2]) {
        self.edges.resize(self.points.len() - 1, [DVec3::ZERO; 2]);
        self.edges.push(edges);
    }

    /// Set the kind of the last point.
    pub fn set_kind(&mut self, kind: PointKind) {
        self.kinds.resize(self.points.len() - 1, PointKind::Area);
        self.kinds.push(kind);
    }

    /// Copy without spare memory.
    pub fn copy(&self) -> Self {
        Self {
            points: self.points.as_slice().to_vec(),
            weights: self.weights.as_slice().to_vec(),
            edges: self.edges.as_slice().to_vec(),
            kinds: self.kinds.as_slice().to_vec(),
        }
    }

    /// Remove all points.
    pub fn clear(&mut self) {
        self.points.clear();
        self.weights.clear();
        self.edges.clear();
        self.kinds.clear();
    }

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
