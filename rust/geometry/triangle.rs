//! Area of a triangle, and its distance from a point.

use glam::DVec3;

/// Least area of a triangle [m^2]; smaller ones are dropped.
pub const MIN_AREA: f64 = 1e-18;

/// Area of a triangle [m^2].
pub fn area(t: &[DVec3; 3]) -> f64 {
    0.5 * (t[1] - t[0]).cross(t[2] - t[0]).length()
}

/// Distance of a point from the nearest point of a triangle [m], which may have no area.
pub fn distance_to_point([a, b, c]: [DVec3; 3], point: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let is_inside = |a: DVec3, b: DVec3| (b - a).cross(point - a).dot(normal) > 0.0;
    if is_inside(a, b) && is_inside(b, c) && is_inside(c, a) {
        return (point - a).dot(normal).abs() / normal.length();
    }
    let to_edge = |a: DVec3, b: DVec3| {
        let (edge, offset) = (b - a, point - a);
        let along = offset.dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE);
        (offset - along.clamp(0.0, 1.0) * edge).length()
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_to_a_triangle_is_that_to_its_face_edges_and_corners() {
        let triangle = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, 4.0, 0.0)];
        for (point, distance) in [
            (DVec3::new(1.0, 1.0, 3.0), 3.0),
            (DVec3::new(1.0, 1.0, -2.0), 2.0),
            (DVec3::new(2.0, -3.0, 4.0), 5.0),
            (DVec3::new(3.0, 3.0, 0.0), 2.0_f64.sqrt()),
            (DVec3::new(-3.0, -4.0, 12.0), 13.0),
            (DVec3::new(1.0, 1.0, 0.0), 0.0),
        ] {
            assert!((distance_to_point(triangle, point) - distance).abs() < 1e-15, "{point}");
        }
        let line = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        assert_eq!(distance_to_point(line, DVec3::new(3.0, 0.0, 0.0)), 1.0);
        assert_eq!(distance_to_point([DVec3::ZERO; 3], DVec3::Y), 1.0);
    }
}
