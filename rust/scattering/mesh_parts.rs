//! Parts of meshes on the image plane that rays of coarse cells may miss.

use glam::DVec3;

use crate::geometry::aabb::Bounds;
use crate::rays::camera::ImagePlane;
use crate::rays::scene::PosedScene;

/// Largest number of pieces of a long part of a mesh.
const MOST_PIECES: f64 = 256.0;

/// Largest number of parts of a mesh that are cut into pieces.
const FEW_PARTS: usize = 1000;

/// Part of a mesh on the image plane: a rectangle that needs cells of a size.
pub struct MeshPart {
    /// Range of u.
    pub u: [f64; 2],
    /// Range of v.
    pub v: [f64; 2],
    /// Widest cells in u and v.
    pub width: [f64; 2],
}

impl MeshPart {
    /// Parts of the meshes of all bodies that can have the smallest cross-section of interest and are less than some
    /// cells of the base grid across; `field`: of the smallest cross-section, see [`field_of`] [m^2].
    ///
    /// [`field_of`]: crate::scattering::refinement::field_of
    pub fn small(scene: &PosedScene, base: &ImagePlane, field: f64, cells_across: f64) -> Vec<Self> {
        let mut small = Vec::new();
        for body in 0..scene.num_bodies() as u32 {
            let (pose, parts) = (scene.pose(body), scene.surface(body).parts());
            let most = if parts.len() > FEW_PARTS { 1.0 } else { MOST_PIECES };
            for part in parts {
                let pieces = pieces(part, most);
                for piece in &pieces {
                    let corners = piece.corners().map(|corner| pose.point(corner));
                    let part = Self::new(&corners, pieces.len() as f64, field, cells_across);
                    small.extend(part.filter(|part| part.width[0] < base.du || part.width[1] < base.dv));
                }
            }
        }
        small
    }

    /// Part of a box in the sensor frame, one of a number of pieces; none where all of them have less than a field
    /// times distance squared [m^2], or the box reaches behind the sensor, and is near and large.
    fn new(corners: &[DVec3; 8], pieces: f64, field: f64, cells_across: f64) -> Option<Self> {
        if corners.iter().any(|corner| corner.x <= 0.0) {
            return None;
        }
        let range = |axis: usize| {
            let ratios = corners.iter().map(|corner| corner[axis] / corner.x);
            let (low, high) = ratios.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            [low, high]
        };
        let (u, v) = (range(1), range(2));
        let lengths = corners.iter().map(|corner| corner.length_squared());
        let nearest = lengths.fold(f64::INFINITY, f64::min);
        let is_bright = pieces * (u[1] - u[0]) * (v[1] - v[0]) * nearest >= field;
        let width = [u, v].map(|[low, high]| (high - low) / cells_across);
        is_bright.then_some(Self { u, v, width })
    }
}

/// Split a long box into pieces about as long as wide: the border of the image may cross the box.
fn pieces(bounds: &Bounds, most: f64) -> Vec<Bounds> {
    let size = bounds.max - bounds.min;
    let longest = size.max_position();
    let mut others = size;
    others[longest] = 0.0;
    let number = (size[longest] / others.max_element()).ceil().clamp(1.0, most);
    if !number.is_finite() {
        return vec![*bounds];
    }
    let step = size[longest] / number;
    (0..number as usize)
        .map(|piece| {
            let mut part = *bounds;
            part.min[longest] = bounds.min[longest] + step * piece as f64;
            part.max[longest] = part.min[longest] + step;
            part
        })
        .collect()
}
