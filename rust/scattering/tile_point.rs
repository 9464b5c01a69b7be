//! Material point of tiles.

use glam::DVec3;

/// Material point of the specular part of one or several cells, in the sensor frame.
#[derive(Clone, Copy, Debug)]
pub struct TilePoint {
    /// Position [m].
    pub position: DVec3,
    /// Unit normal on the incident side.
    pub normal: DVec3,
    /// Body and triangle that were hit.
    pub body: u32,
    /// Number of the triangle.
    pub triangle: u32,
    /// Edges of the cell on the surface where the body turns [m]; zero otherwise.
    pub edges: [DVec3; 2],
}
