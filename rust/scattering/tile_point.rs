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
    /// Edges of the cell on the surface that the field is a mean over, where the body turns or beside an edge term [m];
    /// zero otherwise.
    pub edges: [DVec3; 2],
    /// Power of the frequency by which the field falls: number of axes of an edge term.
    pub order: u8,
}
