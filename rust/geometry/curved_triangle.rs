//! Curved surface that a triangle approximates: normal, and distance from the triangle.

use glam::{DMat3, DVec3};

/// Largest cosine between ray and normal at which the surface is corrected: beyond (87 degrees off the normal)
/// the correction along the ray is no longer small.
pub const MAX_CORRECTED_COSINE: f64 = -0.05;

/// Unit normal of the curved surface at a hit of its triangle, and distance along the ray from the triangle to it [m].
///
/// The hit is at `barycentric` weights of the triangle with vertices `corners`; `direction` is the ray's unit vector.
/// The normal points to the incident side, `n.d < 0`: a triangle hit from behind is the same surface seen from
/// there. `face_normal` is a unit vector on the side of the corner normals.
///
/// With n = normalise(sum `b_i` `n_i`) and h = sum `b_i` (`v_i` - x).`n_i` the surface is h/2 above the triangle, and
/// the ray meets it h / (2 n.d) later; exact for quadrics to second order. Where the ray grazes the surface,
/// n.d > -0.05, the triangle counts as flat.
pub fn shade(
    corners: [DVec3; 3],
    corner_normals: Option<[DVec3; 3]>,
    barycentric: [f64; 3],
    face_normal: DVec3,
    direction: DVec3,
) -> (DVec3, f64) {
    // Turning all normals to the incident side changes the signs of h and n.d, and leaves the correction as it is.
    let side = if face_normal.dot(direction) > 0.0 { -1.0 } else { 1.0 };
    let flat = (side * face_normal, 0.0);
    let Some(normals) = corner_normals else { return flat };

    let mean = |values: [DVec3; 3]| -> DVec3 { (0..3).map(|i| barycentric[i] * values[i]).sum() };
    let Some(normal) = mean(normals).try_normalize() else {
        return flat;
    };
    let normal = side * normal;
    let cosine = normal.dot(direction);
    if cosine > MAX_CORRECTED_COSINE {
        return flat;
    }
    let point = mean(corners);
    let height: f64 = (0..3)
        .map(|i| barycentric[i] * (corners[i] - point).dot(side * normals[i]))
        .sum();
    (normal, height / (2.0 * cosine))
}

/// Shape operator of the surface of [`shade`]: derivative of its normal, as a map of displacements on the surface; zero
/// where the triangle counts as flat.
///
/// A displacement on the surface leads along the ray to one on the triangle, which changes the weights of the corners.
pub fn shape_operator(
    corners: [DVec3; 3],
    corner_normals: Option<[DVec3; 3]>,
    barycentric: [f64; 3],
    face_normal: DVec3,
    direction: DVec3,
) -> DMat3 {
    let Some(normals) = corner_normals else {
        return DMat3::ZERO;
    };
    let side = if face_normal.dot(direction) > 0.0 { -1.0 } else { 1.0 };
    let mean: DVec3 = (0..3).map(|i| barycentric[i] * normals[i]).sum();
    let length = mean.length();
    if length == 0.0 || side * mean.dot(direction) > MAX_CORRECTED_COSINE * length {
        return DMat3::ZERO;
    }
    let normal = mean / length;

    // Gradients of the weights of the second and third corner.
    let (first, second) = (corners[1] - corners[0], corners[2] - corners[0]);
    let area = first.cross(second).dot(face_normal);
    let gradients = [second.cross(face_normal) / area, face_normal.cross(first) / area];

    let onto_facet = DMat3::IDENTITY - outer(direction, face_normal) * face_normal.dot(direction).recip();
    let change = outer(normals[1] - normals[0], gradients[0]) + outer(normals[2] - normals[0], gradients[1]);
    let onto_tangent_plane = DMat3::IDENTITY - outer(normal, normal);
    onto_tangent_plane * change * onto_facet * (side / length)
}

/// Outer product: the map `x -> a (b.x)`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
