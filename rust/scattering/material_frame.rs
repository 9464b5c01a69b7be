//! Material frame: coordinates of the body, or of the triangle where the body deforms.

use glam::DVec3;

use crate::geometry::moving_triangle::MovingTriangle;
use crate::geometry::pose::Pose;
use crate::numeric::random::mix;
use crate::rays::scene::PosedScene;

/// Edge of the cubes whose surface points share a diffuse phase [m]: a sixteenth of a wavelength at 60 GHz. Waves from
/// both ends of a cube arrive at most a quarter of a turn apart, which costs 0.2 dB at grazing incidence.
pub(crate) const SPECKLE_CELL: f64 = 0.3e-3;

/// Origin of the cubes, in edges: off the planes through the origin of the body, where rounding would assign points of
/// a plate to either of two cubes.
pub(crate) const SPECKLE_ORIGIN: DVec3 = DVec3::new(0.381_966, 0.414_214, 0.302_776);

/// Frame of reference of material points.
pub(crate) struct MaterialFrame<'a> {
    pub(crate) pose: &'a Pose,
    /// Triangle that carries the points, where the body deforms.
    pub(crate) moved: Option<MovedTriangle>,
    /// Seed of the diffuse phases.
    pub(crate) speckle: u64,
}

impl<'a> MaterialFrame<'a> {
    /// Material frame of a triangle of a body.
    pub(crate) fn of_mesh(scene: &'a PosedScene, body: u32, triangle: u32, seed: u64) -> Self {
        let surface = scene.surface(body);
        let moved = surface.is_deformed().then(|| MovedTriangle {
            vertices: surface.vertices_of(triangle),
            triangle: MovingTriangle::new(surface.corners(triangle)),
            rest: MovingTriangle::new(surface.rest_corners(triangle)),
        });
        Self {
            pose: scene.pose(body),
            moved,
            speckle: mix(seed ^ scene.content_hash(body)),
        }
    }

    /// Map a point of the sensor frame [m] to the material frame.
    pub(crate) fn position(&self, point: DVec3) -> DVec3 {
        let position = self.pose.point_to_body(point);
        self.moved
            .as_ref()
            .map_or(position, |moved| moved.triangle.coordinates(position))
    }

    /// Map a unit normal of the sensor frame to the material frame: a vector, or slopes along the triangle.
    pub(crate) fn normal(&self, normal: DVec3) -> DVec3 {
        let normal = self.pose.direction_to_body(normal);
        self.moved
            .as_ref()
            .map_or(normal, |moved| moved.triangle.slopes(normal))
    }

    /// Map the edges of a patch [m] to the material frame.
    pub(crate) fn edges(&self, edges: [DVec3; 2]) -> [DVec3; 2] {
        edges.map(|edge| {
            let edge = self.pose.direction_to_body(edge);
            self.moved
                .as_ref()
                .map_or(edge, |moved| moved.triangle.coordinates_of_vector(edge))
        })
    }

    /// Number of the cube of the undeformed surface at a position in the material frame.
    pub(crate) fn cube(&self, position: DVec3) -> u64 {
        let on_surface = self.moved.as_ref().map_or(position, |moved| moved.rest.point(position));
        speckle_cube(self.speckle, on_surface / SPECKLE_CELL + SPECKLE_ORIGIN)
    }
}

/// Triangle that carries a material point of a body that deforms.
pub(crate) struct MovedTriangle {
    pub(crate) vertices: [u32; 3],
    /// Triangle at the time of the rays.
    pub(crate) triangle: MovingTriangle,
    /// Triangle of the undeformed body.
    pub(crate) rest: MovingTriangle,
}

/// Random number of a cube of the surface, equal in every chirp, frame and cell.
pub(crate) fn speckle_cube(speckle: u64, cube: DVec3) -> u64 {
    let cube = cube.floor().to_array().map(|x| x as i64 as u64);
    cube.into_iter().fold(speckle, |state, word| mix(state ^ word))
}

/// Diffuse phase of a cube in turns, uniform in [0, 1).
pub(crate) fn speckle_turns(cube: u64) -> f64 {
    (cube >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use num_complex::Complex64;

    use super::*;

    #[test]
    fn speckle_phases_are_uniform_and_uncorrelated_between_neighbours() {
        let turns: Vec<f64> = (0..20_000)
            .map(|i| speckle_turns(speckle_cube(3, DVec3::new(f64::from(i) + 0.5, -2.5, 0.5))))
            .collect();
        let mean = |values: &mut dyn Iterator<Item = Complex64>| values.sum::<Complex64>().norm() / 20_000.0;
        // Sums of n random phasors have rms sqrt(n): four sigma of 1 / sqrt(20000).
        let phasors: Vec<Complex64> = turns.iter().map(|t| Complex64::cis(TAU * t)).collect();
        assert!(mean(&mut phasors.iter().copied()) < 0.03);
        assert!(mean(&mut phasors.windows(2).map(|p| p[0] * p[1].conj())) < 0.03);
    }
}
