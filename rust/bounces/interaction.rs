//! Where a ray meets a surface: at the facet, which says what is in sight, and on the curved surface that the facet stands
//! for, which says how long paths are.

use glam::{DMat3, DVec3};

use crate::geometry::curved_triangle::{bend, shade};
use crate::rays::scene::Snapshot;

/// How far before a surface rays leave it, of their largest coordinate, and of a metre at least [m].
const LEAVING: f64 = 1e-7;

/// Rays at a smaller cosine to a facet do not meet it.
const MIN_COSINE: f64 = 1e-6;

/// A place on a surface, in the sensor frame.
#[derive(Clone, Copy, Debug)]
pub struct Interaction {
    /// Number of the body.
    pub body: u32,
    /// Number of the triangle in its surface.
    pub triangle: u32,
    /// On the curved surface [m].
    pub point: DVec3,
    /// A little before the facet on the way there [m]. Rays leave from here: they do not meet the facet again, and of what
    /// touches it at the place only what the way led to as well, like the other wall where two of them meet.
    pub before: DVec3,
    /// Unit normal of the curved surface towards the incident side.
    pub normal: DVec3,
    /// Unit normal of the facet towards the incident side.
    pub face: DVec3,
    /// How the normal changes along the surface [1/m]; zero where it is flat.
    pub bend: DMat3,
}

impl Interaction {
    /// Where a ray with a unit direction meets a triangle, on the plane beyond its edges if need be, and how far that is
    /// [m]. None where the ray is along the facet, or comes from behind the surface.
    pub fn new(snapshot: &Snapshot, body: u32, triangle: u32, origin: DVec3, direction: DVec3) -> Option<(Self, f64)> {
        let (surface, pose) = (snapshot.surface(body), snapshot.pose(body));
        let (o, d) = (pose.point_to_body(origin), pose.direction_to_body(direction));
        let corners @ [a, b, c] = surface.corners(triangle);

        // The place on the facet, and the weights of its corners there.
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

        // The curved surface, unless it would send the ray into the facet.
        let normals = surface.corner_normals(triangle);
        let lit = -slope.signum() * face;
        let (mut normal, mut correction) = shade(corners, normals, weights, face, d);
        let mut bend = bend(corners, normals, weights, face, d);
        if (d - 2.0 * normal.dot(d) * normal).dot(lit) <= 0.0 {
            (normal, correction, bend) = (lit, 0.0, DMat3::ZERO);
        }

        let length = distance + correction;
        let on_facet = origin + distance * direction;
        let step = leaving(on_facet);
        let turn = pose.rotation;
        let interaction = Self {
            body,
            triangle,
            point: origin + length * direction,
            before: on_facet - step * direction,
            normal: turn * normal,
            face: turn * lit,
            bend: turn * bend * turn.transpose(),
        };
        (length > -step).then_some((interaction, length))
    }
}

/// How far before a point of a surface a ray leaves it [m].
pub fn leaving(point: DVec3) -> f64 {
    LEAVING * point.abs().max_element().max(1.0)
}
