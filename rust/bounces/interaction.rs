//! Interactions of rays with surfaces: on the triangle, which decides visibility, and on the curved surface that the
//! triangle approximates, which gives path lengths.

use glam::{DMat3, DVec3};

use crate::geometry::curved_triangle::{shade, shape_operator};
use crate::numeric::random::mix;
use crate::rays::scene::PosedScene;

/// Distance before a surface at which rays start, relative to their largest coordinate, which counts as a metre at
/// least.
const RAY_EPSILON: f64 = 1e-7;

/// Smallest cosine between a ray and the normal of a triangle that it hits.
const MIN_COSINE: f64 = 1e-6;

/// Interaction of a ray with a surface, in the sensor frame.
#[derive(Clone, Copy, Debug)]
pub struct Interaction {
    /// Number of the body.
    pub body: u32,
    /// Number of the triangle in its surface.
    pub triangle: u32,
    /// Point on the curved surface [m].
    pub point: DVec3,
    /// Point on the incident ray a little before the triangle [m]. Reflected rays start here: they do not hit the
    /// triangle again, but do hit surfaces that touch it on the incident side, like the other wall of a corner.
    pub offset_origin: DVec3,
    /// Unit normal of the curved surface towards the incident side.
    pub normal: DVec3,
    /// Unit normal of the triangle towards the incident side.
    pub face: DVec3,
    /// Shape operator (Weingarten map): derivative of the normal along the surface [1/m]; zero where it is flat.
    pub shape_operator: DMat3,
}

impl Interaction {
    /// Interaction of a ray with a unit direction and the plane of a triangle, also beyond its edges, and its distance
    /// [m]. None where the ray is parallel to the triangle, or comes from behind the surface.
    pub fn new(scene: &PosedScene, body: u32, triangle: u32, origin: DVec3, direction: DVec3) -> Option<(Self, f64)> {
        let (surface, pose) = (scene.surface(body), scene.pose(body));
        let (o, d) = (pose.point_to_body(origin), pose.direction_to_body(direction));
        let corners @ [a, b, c] = surface.corners(triangle);

        // The point on the triangle, and its barycentric weights.
        let area_normal = (b - a).cross(c - a);
        let area = area_normal.length();
        let face = area_normal / area;
        let slope = face.dot(d);
        if slope.abs() < MIN_COSINE {
            return None;
        }
        let distance = face.dot(a - o) / slope;
        let offset = o + distance * d - a;
        let second = (c - a).cross(face).dot(offset) / area;
        let third = face.cross(b - a).dot(offset) / area;
        let weights = [1.0 - second - third, second, third];

        // The curved surface, unless it would reflect the ray into the triangle.
        let normals = surface.corner_normals(triangle);
        let lit = -slope.signum() * face;
        let (mut normal, mut correction) = shade(corners, normals, weights, face, d);
        let mut curvature = shape_operator(corners, normals, weights, face, d);
        if (d - 2.0 * normal.dot(d) * normal).dot(lit) <= 0.0 {
            (normal, correction, curvature) = (lit, 0.0, DMat3::ZERO);
        }

        let length = distance + correction;
        let on_facet = origin + distance * direction;
        let step = ray_epsilon(on_facet);
        let rotation = pose.rotation;
        let interaction = Self {
            body,
            triangle,
            point: origin + length * direction,
            offset_origin: on_facet - step * direction,
            normal: rotation * normal,
            face: rotation * lit,
            shape_operator: rotation * curvature * rotation.transpose(),
        };
        (length > -step).then_some((interaction, length))
    }
}

impl Interaction {
    /// Hash of the body, and of the plane of the triangle where the surface is flat, to a thousandth of a radian and a
    /// tenth of a millimetre.
    pub fn surface(&self) -> u64 {
        let mut hash = mix(u64::from(self.body) + 1);
        if self.shape_operator == DMat3::ZERO {
            let rounded = (1e3 * self.face).round();
            // The sum with zero has no negative zeros.
            for number in [
                rounded.x,
                rounded.y,
                rounded.z,
                (1e4 * self.face.dot(self.point)).round(),
            ] {
                hash = mix(hash ^ (number + 0.0).to_bits());
            }
        }
        hash
    }
}

/// Distance before a point of a surface at which rays start [m].
pub fn ray_epsilon(point: DVec3) -> f64 {
    RAY_EPSILON * point.abs().max_element().max(1.0)
}
