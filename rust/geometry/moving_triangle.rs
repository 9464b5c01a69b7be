//! Frame of a triangle that moves and deforms, in which material points keep their coordinates.

use glam::DVec3;

/// Frame of a moving triangle: a material point keeps its coordinates in it, wherever the corners move.
#[derive(Clone, Copy, Debug)]
pub struct MovingTriangle {
    /// First corner [m].
    origin: DVec3,
    /// Edges from the first corner to the others [m].
    edges: [DVec3; 2],
    /// Normal with the length of twice the area [m^2].
    area_normal: DVec3,
    /// Unit normal; zero where there is no area.
    normal: DVec3,
}

impl MovingTriangle {
    /// Frame from the corners of a triangle [m].
    pub fn new([a, b, c]: [DVec3; 3]) -> Self {
        let edges = [b - a, c - a];
        let area_normal = edges[0].cross(edges[1]);
        Self {
            origin: a,
            edges,
            area_normal,
            normal: area_normal.normalize_or_zero(),
        }
    }

    /// Coordinates of a point: weights of the second and the third corner at its projection onto the plane, and height
    /// above the plane [m]. The triangle must have an area.
    pub fn coordinates(&self, point: DVec3) -> DVec3 {
        let offset = point - self.origin;
        let [e, f] = self.duals();
        DVec3::new(offset.dot(e), offset.dot(f), 0.0) / self.area_normal.length() + DVec3::Z * offset.dot(self.normal)
    }

    /// Point with given coordinates.
    pub fn point(&self, coordinates: DVec3) -> DVec3 {
        self.origin + self.vector(coordinates)
    }

    /// Coordinates of a vector between two points.
    pub fn coordinates_of_vector(&self, vector: DVec3) -> DVec3 {
        self.coordinates(self.origin + vector)
    }

    /// Vector with given coordinates.
    pub fn vector(&self, coordinates: DVec3) -> DVec3 {
        let [e, f] = self.edges;
        coordinates.x * e + coordinates.y * f + coordinates.z * self.normal
    }

    /// Velocity of the point with given coordinates; `rate` is the frame of the velocities of the corners.
    pub fn velocity(&self, rate: &Self, coordinates: DVec3) -> DVec3 {
        let [e, f] = rate.edges;
        let along = rate.origin + coordinates.x * e + coordinates.y * f;
        let length = self.area_normal.length();
        if length == 0.0 {
            return along;
        }
        // Derivative of the unit normal: the part of the change that is perpendicular to the normal.
        let turning = (e.cross(self.edges[1]) + self.edges[0].cross(f)) / length;
        along + coordinates.z * (turning - self.normal * self.normal.dot(turning))
    }

    /// Components of a surface normal along the edges and along the normal of the triangle: coordinates that deform
    /// with it.
    pub fn slopes(&self, normal: DVec3) -> DVec3 {
        DVec3::new(
            normal.dot(self.edges[0]),
            normal.dot(self.edges[1]),
            normal.dot(self.normal),
        )
    }

    /// Unit normal with given slopes, inverse of [`Self::slopes`]; zero if the triangle has no area.
    pub fn normal(&self, slopes: DVec3) -> DVec3 {
        let [e, f] = self.duals();
        (slopes.x * e + slopes.y * f + slopes.z * self.area_normal).normalize_or_zero()
    }

    /// Dual vectors of the edges in the plane: each perpendicular to the other edge, with a product of twice the area
    /// with its own.
    fn duals(&self) -> [DVec3; 2] {
        [self.edges[1].cross(self.normal), self.normal.cross(self.edges[0])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_without_area_has_no_normal_and_finite_points() {
        let needle = MovingTriangle::new([DVec3::ZERO, DVec3::X, 2.0 * DVec3::X]);
        assert_eq!(needle.normal(DVec3::new(0.1, 0.2, 0.9)), DVec3::ZERO);
        assert_eq!(needle.point(DVec3::new(0.5, 0.0, 0.1)), 0.5 * DVec3::X);
        assert_eq!(needle.velocity(&needle, DVec3::new(0.5, 0.0, 0.1)), 0.5 * DVec3::X);
    }
}
