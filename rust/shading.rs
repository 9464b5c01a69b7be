//! Shading of triangle meshes: which facets stand for a curved surface, its normal there and its distance from them.
//!
//! A facet of a curved surface is a chord: a coherent sum over it would see facets, not the surface. Normals at
//! the corners say where the surface lies, to second order (README, Model). The normals are area-weighted, as weights by
//! angle would bend planes next to fillets, less what area weights get wrong round a vertex of even curvature: there they
//! lean towards large facets. Triangles in one plane are one facet, whichever way its diagonals run, and facets much smaller
//! than one have no say in how that bends.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::surface::MIN_AREA;

/// Shading of a triangle mesh: which facets stand for a curved surface, and its normals at their corners.
#[derive(Debug, Clone)]
pub struct Shading {
    /// Per triangle the places of its corners in `normals`, or `FLAT`; empty when all are flat.
    corners: Vec<[u32; 3]>,
    /// Unit normals that corners share.
    normals: Vec<Vec3>,
}

/// Places of a triangle without normals of its own.
const FLAT: [u32; 3] = [u32::MAX; 3];

/// How far the corners of an edge may stand off the surface that its normals describe [m], rms over a triangle, and still
/// count as on it: rounding of files written with a few digits.
const EDGE_TOLERANCE: f64 = 16e-6;

/// Edges that meet at just the crease angle are sharp, whatever their rounding [rad].
const CREASE_MARGIN: f64 = 1e-6;

/// Largest cosine between ray and normal at which the surface is corrected: beyond (87 degrees off the normal)
/// the correction along the ray is no longer small.
pub const MAX_CORRECTED_COSINE: f64 = -0.05;

/// Triangles whose normals are this much apart across an edge lie in one plane [rad]: rounding of files again.
const PLANE_ANGLE: f64 = 1e-3;

/// Facets up to this part of a facet's area are too small to say how that bends; just a tenth is, whatever the rounding.
const SMALL_FACET: f64 = 0.1 * (1.0 + 1e-6);

impl Shading {
    /// Every facet is what it is.
    pub fn flat() -> Self {
        Self {
            corners: Vec::new(),
            normals: Vec::new(),
        }
    }

    /// Facets that meet at less than `crease_angle` (radians) stand for one curved surface.
    ///
    /// An edge is smooth when exactly two triangles share it, run through it in opposite directions and have
    /// normals less than the crease angle apart. Vertices at equal positions count as one. The normal at a corner
    /// is that of the triangles connected to it through smooth edges round its vertex: their area-weighted mean, and
    /// on a sphere the radius. Facets of a tenth of its own area or less have no say: a tube is straight up to the chamfers
    /// at its ends. A triangle stays flat where these normals fit no smooth surface, or are all its own.
    ///
    /// Triangles index into `vertices` and have an area. The result depends on their order by rounding at most.
    pub fn smooth(vertices: &[DVec3], triangles: &[[u32; 3]], crease_angle: f64) -> Self {
        Self::of_groups(vertices, triangles, &Groups::new(vertices, triangles, crease_angle))
    }

    /// The same for vertices that have moved since the groups were found.
    pub fn of_groups(vertices: &[DVec3], triangles: &[[u32; 3]], groups: &Groups) -> Self {
        let stars = Stars::new(vertices, triangles, groups);
        let groups = &groups.corners;
        let number = stars.means.len();
        let normals_of_groups: Vec<DVec3> = (0..number).into_par_iter().map(|group| stars.normal(group)).collect();
        let smallest: Vec<f64> = (0..number).into_par_iter().map(|group| stars.smallest(group)).collect();

        // Keep the normals where they describe a curved surface through the three vertices.
        let mut shading = Self {
            corners: vec![FLAT; triangles.len()],
            normals: Vec::new(),
        };
        let mut places = vec![u32::MAX; normals_of_groups.len()];
        let mut ladders = HashMap::new();
        for (index, triangle) in triangles.iter().enumerate() {
            let corners = triangle.map(|vertex| vertices[vertex as usize]);
            let own = [0, 1, 2].map(|i| groups[3 * index + i] as usize);
            let least = SMALL_FACET * stars.facets.areas[index];
            let is_shared = own.map(|group| smallest[group] > least);
            let normals = [0, 1, 2].map(|i| {
                if is_shared[i] {
                    normals_of_groups[own[i]]
                } else {
                    let ladder = ladders.entry(own[i]).or_insert_with(|| stars.ladder(own[i]));
                    ladder.normal(least)
                }
            });
            let face_normal = stars.area_normals[index].normalize_or_zero();
            if !(is_curved(normals, face_normal) && is_consistent(corners, normals)) {
                continue;
            }
            for i in 0..3 {
                let mut next = u32::MAX;
                let place = if is_shared[i] { &mut places[own[i]] } else { &mut next };
                if *place == u32::MAX {
                    *place = shading.normals.len() as u32;
                    shading.normals.push(normals[i].as_vec3());
                }
                shading.corners[index][i] = *place;
            }
        }
        if shading.normals.is_empty() {
            return Self::flat();
        }
        shading.normals.shrink_to_fit();
        shading
    }

    /// Memory [bytes].
    pub fn memory(&self) -> usize {
        size_of_val(self.corners.as_slice()) + size_of_val(self.normals.as_slice())
    }

    /// Unit normals at the three corners (to f32 precision), None where the triangle is flat.
    pub fn corner_normals(&self, triangle: usize) -> Option<[DVec3; 3]> {
        let [a, b, c] = *self.corners.get(triangle)?;
        let normal = |place: u32| self.normals.get(place as usize).map(|normal| normal.as_dvec3());
        Some([normal(a)?, normal(b)?, normal(c)?])
    }
}

/// Corners of triangles that share a normal, and triangles that share a plane.
#[derive(Debug, Clone)]
pub struct Groups {
    /// Number of the group of every corner.
    corners: Vec<u32>,
    /// The first triangle of the facet of every triangle.
    facets: Vec<u32>,
}

impl Groups {
    /// See [`Shading::smooth`].
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]], crease_angle: f64) -> Self {
        let area_normals = area_normals(vertices, triangles);
        smooth_groups(vertices, triangles, &area_normals, crease_angle)
    }

    /// Memory [bytes].
    pub fn memory(&self) -> usize {
        size_of_val(self.corners.as_slice()) + size_of_val(self.facets.as_slice())
    }
}

/// What triangles in one plane count together.
struct Facets {
    /// Twice the area of every triangle's facet [m^2].
    areas: Vec<f64>,
    /// By how much every corner's triangle counts for more than its own area, so that a group has all of a facet once.
    weights: Vec<f64>,
}

impl Facets {
    fn new(groups: &Groups, area_normals: &[DVec3]) -> Self {
        let own: Vec<f64> = area_normals.iter().map(|normal| normal.length()).collect();
        let mut areas = vec![0.0; own.len()];
        for (facet, area) in groups.facets.iter().zip(&own) {
            areas[*facet as usize] += area;
        }
        let areas: Vec<f64> = groups.facets.iter().map(|facet| areas[*facet as usize]).collect();

        // Of facets of more than one triangle: what a group has of them.
        let facet = |corner: usize| (groups.corners[corner], groups.facets[corner / 3]);
        let mut shared: Vec<usize> = (0..groups.corners.len())
            .filter(|corner| areas[corner / 3] > own[corner / 3])
            .collect();
        shared.sort_by_key(|corner| facet(*corner));
        let mut weights = vec![1.0; groups.corners.len()];
        for corners in shared.chunk_by(|a, b| facet(*a) == facet(*b)) {
            let there: f64 = corners.iter().map(|corner| own[corner / 3]).sum();
            // Nothing is there where a deformed body has folded it away.
            if there > 0.0 {
                for corner in corners {
                    weights[*corner] = areas[corner / 3] / there;
                }
            }
        }
        Self { areas, weights }
    }
}

/// The corners of every group.
struct Members {
    corners: Vec<u32>,
    starts: Vec<u32>,
}

impl Members {
    fn new(groups: &[u32]) -> Self {
        let number = groups.iter().max().map_or(0, |&group| group as usize + 1);
        let mut starts = vec![0; number + 1];
        for &group in groups {
            starts[group as usize + 1] += 1;
        }
        for group in 0..number {
            starts[group + 1] += starts[group];
        }
        let (mut next, mut corners) = (starts.clone(), vec![0; groups.len()]);
        for (corner, &group) in groups.iter().enumerate() {
            corners[next[group as usize] as usize] = corner as u32;
            next[group as usize] += 1;
        }
        Self { corners, starts }
    }

    /// Number of groups.
    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// In the order of the triangles.
    fn of(&self, group: usize) -> impl Iterator<Item = usize> {
        let range = self.starts[group] as usize..self.starts[group + 1] as usize;
        self.corners[range].iter().map(|corner| *corner as usize)
    }
}

/// Twice the area times the normal of every triangle: sums of these are weighted by area.
fn area_normals(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let normal = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| vertices[vertex as usize]);
        (b - a).cross(c - a)
    };
    triangles.iter().map(normal).collect()
}

/// The triangles of a group round its vertex, weighted by area.
#[derive(Clone, Copy, Default)]
struct Star {
    /// Sum of the normals, and of the areas.
    normal: DVec3,
    area: f64,
    /// Sum of the offsets of the circumcentres from the vertex.
    offset: DVec3,
    /// Sums of the squares of how far normals turn along the edges, of that times their lengths, and of the squares of these.
    turn: [f64; 3],
}

impl Star {
    /// Unit normal at the vertex.
    ///
    /// A facet's normal is that of the surface at its circumcentre. Where these do not lie evenly round the vertex, the mean
    /// leans by the curvature times their mean offset. That is taken off as far as normals turn evenly: in proportion to the
    /// length of an edge, whatever its direction. The squared correlation of the two is 1 on a sphere and two thirds on a
    /// cylinder, less where facets are long; from there on down, as where a plane ends in a fillet, the mean is left alone. So
    /// it is where all facets are one plane: what turns is not here.
    fn unit_normal(&self) -> DVec3 {
        if self.normal.length() >= (1.0 - 0.5 * PLANE_ANGLE * PLANE_ANGLE) * self.area {
            return self.normal.normalize_or_zero();
        }
        let [turned, product, length] = self.turn;
        let curvature = product / length;
        let evenness = 3.0 * (curvature * product / turned) - 2.0;
        if evenness > 0.0 {
            (self.normal - evenness * curvature * self.offset).normalize_or_zero()
        } else {
            self.normal.normalize_or_zero()
        }
    }
}

/// What normals of groups are made of.
struct Stars<'a> {
    vertices: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    /// Group of every corner, and corners of every group.
    groups: &'a [u32],
    members: Members,
    area_normals: Vec<DVec3>,
    facets: Facets,
    /// Of every group, of all facets.
    means: Vec<DVec3>,
}

impl<'a> Stars<'a> {
    fn new(vertices: &'a [DVec3], triangles: &'a [[u32; 3]], groups: &'a Groups) -> Self {
        let area_normals = area_normals(vertices, triangles);
        let facets = Facets::new(groups, &area_normals);
        let members = Members::new(&groups.corners);
        let mean = |group: usize| -> DVec3 {
            let normals = members
                .of(group)
                .map(|corner| facets.weights[corner] * area_normals[corner / 3]);
            normals.sum::<DVec3>().normalize_or_zero()
        };
        let means = (0..members.len()).into_par_iter().map(mean).collect();
        Self {
            vertices,
            triangles,
            groups: &groups.corners,
            members,
            area_normals,
            facets,
            means,
        }
    }

    /// Area of the smallest facet of a group.
    fn smallest(&self, group: usize) -> f64 {
        let areas = self.members.of(group).map(|corner| self.facets.areas[corner / 3]);
        areas.fold(f64::INFINITY, f64::min)
    }

    /// Unit normal of a group, in the order of the triangles.
    fn normal(&self, group: usize) -> DVec3 {
        let mut star = Star::default();
        for corner in self.members.of(group) {
            self.add(&mut star, corner);
        }
        star.unit_normal()
    }

    /// The facets of a group, from the largest to the smallest.
    fn ladder(&self, group: usize) -> Ladder {
        let area = |corner: &usize| self.facets.areas[corner / 3];
        let mut corners: Vec<usize> = self.members.of(group).collect();
        corners.sort_by(|a, b| area(b).total_cmp(&area(a)));
        let mut star = Star::default();
        let mut stars = vec![star];
        for corner in &corners {
            self.add(&mut star, *corner);
            stars.push(star);
        }
        Ladder {
            areas: corners.iter().map(area).collect(),
            stars,
        }
    }

    fn add(&self, star: &mut Star, corner: usize) {
        let (triangle, first) = (corner / 3, corner % 3);
        let weight = self.facets.weights[corner];
        let area_normal = self.area_normals[triangle];
        let area = area_normal.length();
        // Deformed bodies may have triangles without.
        if 0.5 * area < MIN_AREA {
            return;
        }
        let face_normal = area_normal / area;
        star.normal += weight * area_normal;
        star.area += weight * area;

        // The edges from this corner and to it.
        let vertex = |i: usize| self.vertices[self.triangles[triangle][i] as usize];
        let mean = |i: usize| self.means[self.groups[3 * triangle + i] as usize];
        let (next, before) = ((first + 1) % 3, (first + 2) % 3);
        let (from, to) = (vertex(next) - vertex(first), vertex(first) - vertex(before));
        let squares = [from, to].map(DVec3::length_squared);
        star.offset += 0.5 * weight * (squares[1] * face_normal.cross(from) - squares[0] * to.cross(face_normal));
        // By the length of the edge: angle and length, and not their products.
        let bends = [
            (mean(next) - mean(first)).dot(from),
            (mean(first) - mean(before)).dot(to),
        ];
        for (bend, square) in bends.into_iter().zip(squares) {
            let turn = [bend * bend / square, bend, square];
            for k in 0..3 {
                star.turn[k] += weight * area * turn[k];
            }
        }
    }
}

/// What the largest facets of a group say: of none, of the largest, of the two largest, ...
struct Ladder {
    /// Of the facets, falling.
    areas: Vec<f64>,
    stars: Vec<Star>,
}

impl Ladder {
    /// Unit normal of the facets of more than some area.
    fn normal(&self, least: f64) -> DVec3 {
        let number = self.areas.partition_point(|area| *area > least);
        self.stars[number].unit_normal()
    }
}

/// Normal of the surface that a hit facet stands for, and how much farther along the ray it lies (metres).
///
/// The hit is at `barycentric` of the facet with vertices `corners`; `direction` is the ray's unit vector.
/// The normal points to the incident side, `n.d < 0`: a facet hit from behind is the same surface seen from
/// there. `face_normal` is a unit vector on the side of the corner normals.
///
/// With n = normalise(sum `b_i` `n_i`) and h = sum `b_i` (`v_i` - x).`n_i` the surface is h/2 above the facet, and
/// the ray meets it h / (2 n.d) later; exact for quadrics to second order. Where the ray grazes the surface,
/// n.d > -0.05, the facet stands for itself.
pub fn shade(
    corners: [DVec3; 3],
    corner_normals: Option<[DVec3; 3]>,
    barycentric: [f64; 3],
    face_normal: DVec3,
    direction: DVec3,
) -> (DVec3, f64) {
    // Which side is lit: turning all normals round turns h and n.d, and leaves the correction as it is.
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

/// How the normal of [`shade`] changes along the surface, as a map of displacements on it: zero where the facet stands
/// for itself.
///
/// A displacement leads along the ray to one on the facet, and with it the weights of the corners change.
pub fn bend(
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
    let turning = DMat3::IDENTITY - outer(normal, normal);
    turning * change * onto_facet * (side / length)
}

/// The map `x -> a (b.x)`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Whether a corner normal differs from the face normal by more than its storage can tell. Not so on a plane,
/// which then needs no normals and stays exact.
fn is_curved(normals: [DVec3; 3], face_normal: DVec3) -> bool {
    normals
        .iter()
        .any(|normal| normal.distance(face_normal) > f64::from(f32::EPSILON))
}

/// Whether the edges can be chords of the surface with these normals at their ends.
///
/// A chord e of a smooth surface has (`n_a` + `n_b`).e = 0 to second order: as much as the surface rises from one
/// end, it has to fall towards the other. Not so where a plane ends in a fillet: one normal is bent, the other not.
/// The three edges share what they may be off: along the axis of a tube nothing bends, and noise would decide.
fn is_consistent(corners: [DVec3; 3], normals: [DVec3; 3]) -> bool {
    let (mut off, mut bend) = (0.0, 0.0);
    for i in 0..3 {
        let j = (i + 1) % 3;
        let edge = corners[j] - corners[i];
        let (at_start, at_end) = (normals[i].dot(edge), normals[j].dot(edge));
        off += (at_start + at_end).powi(2);
        bend += (at_end - at_start).powi(2);
    }
    off <= 0.5 * bend + 3.0 * EDGE_TOLERANCE.powi(2)
}

/// Number of the smooth group of every corner (corner i of triangle t at 3 t + i), counted from 0, and facets.
///
/// Corners at one vertex are in a group where smooth edges connect their triangles.
fn smooth_groups(vertices: &[DVec3], triangles: &[[u32; 3]], area_normals: &[DVec3], crease_angle: f64) -> Groups {
    let positions = distinct_positions(vertices);
    let position = |corner: usize| positions[triangles[corner / 3][corner % 3] as usize];
    let min_cosine = (crease_angle - CREASE_MARGIN).clamp(0.0, PI).cos();

    // Join the corners at both ends of every smooth edge, and triangles in one plane.
    let mut facets: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut parents: Vec<u32> = (0..3 * triangles.len() as u32).collect();
    for_edges(triangles.len(), position, |edge| {
        let Some((first, second)) = two_sides(edge, position) else {
            return;
        };
        let (n1, n2) = (area_normals[first / 3], area_normals[second / 3]);
        if n1.dot(n2) > min_cosine * (n1.length() * n2.length()) {
            join(&mut parents, first, next_corner(second));
            join(&mut parents, next_corner(first), second);
            if n1.cross(n2).length() < PLANE_ANGLE * n1.dot(n2) {
                join(&mut facets, first / 3, second / 3);
            }
        }
    });
    for triangle in 0..facets.len() {
        facets[triangle] = root(&mut facets, triangle) as u32;
    }

    // Number the groups. A root comes before the other corners of its group, so its number is there when they ask.
    let mut num_groups = 0;
    for corner in 0..parents.len() {
        let parent = parents[corner] as usize;
        if parent == corner {
            parents[corner] = num_groups;
            num_groups += 1;
        } else {
            parents[corner] = parents[parent];
        }
    }
    Groups {
        corners: parents,
        facets,
    }
}

/// Number of the distinct position of every vertex, counted in order of appearance. Bit-equal is equal, and -0 is 0.
pub(crate) fn distinct_positions(vertices: &[DVec3]) -> Vec<u32> {
    let mut numbers = HashMap::new();
    vertices
        .iter()
        .map(|&vertex| {
            // Adding +0 turns -0 into +0 and changes nothing else.
            let bits = (vertex + DVec3::ZERO).to_array().map(f64::to_bits);
            let next = numbers.len() as u32;
            *numbers.entry(bits).or_insert(next)
        })
        .collect()
}

/// The two corners that an edge has if exactly two triangles share it and run through it in opposite directions.
fn two_sides(edge: &[u32], position: impl Fn(usize) -> u32) -> Option<(usize, usize)> {
    let &[first, second] = edge else { return None };
    let (first, second) = (first as usize, second as usize);
    (position(first) == position(next_corner(second))).then_some((first, second))
}

/// Calls `visit` for every edge with the corners at which it starts in its triangles, in increasing order. `position` is the
/// number of a corner's vertex.
pub(crate) fn for_edges(num_triangles: usize, position: impl Fn(usize) -> u32, mut visit: impl FnMut(&[u32])) {
    let ends = |corner: usize| (position(corner), position(next_corner(corner)));
    let low = |corner: usize| ends(corner).0.min(ends(corner).1) as usize;
    let high = |corner: usize| ends(corner).0.max(ends(corner).1);
    let num_corners = 3 * num_triangles;

    // Sort the edges into one bucket per lower end: count, then fill from the back.
    let num_positions = (0..num_corners)
        .map(|corner| position(corner) as usize + 1)
        .max()
        .unwrap_or(0);
    let mut starts = vec![0_u32; num_positions + 1];
    for corner in 0..num_corners {
        starts[low(corner)] += 1;
    }
    let mut total = 0;
    for start in &mut starts {
        total += *start;
        *start = total;
    }
    let mut edges = vec![0_u32; num_corners];
    for corner in (0..num_corners).rev() {
        let start = &mut starts[low(corner)];
        *start -= 1;
        edges[*start as usize] = corner as u32;
    }

    // Within a bucket (about three edges) bring those with the same upper end together.
    for bucket in starts.windows(2) {
        let bucket = &mut edges[bucket[0] as usize..bucket[1] as usize];
        bucket.sort_unstable_by_key(|&corner| (high(corner as usize), corner));
        for same in bucket.chunk_by(|&a, &b| high(a as usize) == high(b as usize)) {
            visit(same);
        }
    }
}

/// The corner after this one, round its triangle.
pub(crate) fn next_corner(corner: usize) -> usize {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

/// Joins the groups of two corners, or triangles (union-find); the root of a group is its lowest one.
pub(crate) fn join(parents: &mut [u32], a: usize, b: usize) {
    let (a, b) = (root(parents, a), root(parents, b));
    parents[a.max(b)] = a.min(b) as u32;
}

/// The lowest member of a group. Halves the path to it on the way.
pub(crate) fn root(parents: &mut [u32], mut corner: usize) -> usize {
    while parents[corner] as usize != corner {
        parents[corner] = parents[parents[corner] as usize];
        corner = parents[corner] as usize;
    }
    corner
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    const CREASE: f64 = PI / 4.0;
    /// Rounding of stored normals: half a unit in the last place of every component.
    const STORED: f64 = f32::EPSILON as f64;

    pub type Triangles = Vec<[u32; 3]>;

    /// Unit icosahedron, split in four `level` times; 20, 80, 320, 1280 triangles.
    pub fn icosphere(level: usize) -> (Vec<DVec3>, Triangles) {
        let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
        let mut vertices = Vec::new();
        for (a, b) in [(-1.0, -golden), (1.0, -golden), (-1.0, golden), (1.0, golden)] {
            vertices
                .extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)].map(DVec3::normalize));
        }
        // The faces are the triples of neighbours, wound outwards.
        let near = |a: usize, b: usize| vertices[a].dot(vertices[b]) > 0.4;
        let mut triangles = Triangles::new();
        for a in 0..12 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    if near(a, b) && near(b, c) && near(c, a) {
                        let outwards = vertices[a].dot(vertices[b].cross(vertices[c])) > 0.0;
                        let (b, c) = if outwards { (b, c) } else { (c, b) };
                        triangles.push([a as u32, b as u32, c as u32]);
                    }
                }
            }
        }
        for _ in 0..level {
            let mut middles = HashMap::new();
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                    vertices.len() as u32 - 1
                })
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        (vertices, triangles)
    }

    fn corners_of(vertices: &[DVec3], triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|vertex| vertices[vertex as usize])
    }

    fn face_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
        (b - a).cross(c - a).normalize()
    }

    /// Points all over a triangle, rim included.
    fn barycentric_grid() -> impl Iterator<Item = [f64; 3]> {
        (0..=6).flat_map(|i| (0..=6 - i).map(move |j| [i, j, 6 - i - j].map(|weight| f64::from(weight) / 6.0)))
    }

    fn mean(values: [DVec3; 3], barycentric: [f64; 3]) -> DVec3 {
        (0..3).map(|i| barycentric[i] * values[i]).sum()
    }

    /// Every triangle with vertices of its own, as an STL file has it.
    fn soup(vertices: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<DVec3>, Triangles) {
        let vertices = triangles
            .iter()
            .flat_map(|&triangle| corners_of(vertices, triangle))
            .collect();
        (
            vertices,
            (0..triangles.len() as u32)
                .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
                .collect(),
        )
    }

    /// A profile in the x-y plane swept along z by `length`, normals to the right of the way along the profile.
    fn swept(profile: &[(f64, f64)], length: f64, closed: bool) -> (Vec<DVec3>, Triangles) {
        let vertices = profile
            .iter()
            .flat_map(|&(x, y)| [0.0, length].map(|z| DVec3::new(x, y, z)))
            .collect();
        let n = profile.len() as u32;
        let strips = if closed { n } else { n - 1 };
        let triangles = (0..strips)
            .flat_map(|i| {
                let (a, b) = (2 * i, 2 * ((i + 1) % n));
                [[a, b, b + 1], [a, b + 1, a + 1]]
            })
            .collect();
        (vertices, triangles)
    }

    fn all_flat(shading: &Shading, num_triangles: usize) -> bool {
        (0..num_triangles).all(|t| shading.corner_normals(t).is_none())
    }

    /// Distance [m] from the facet's plane to the surface it stands for, at its deepest point.
    fn largest_depth(corners: [DVec3; 3], normals: Option<[DVec3; 3]>) -> f64 {
        let n = face_normal(corners);
        barycentric_grid()
            .map(|b| shade(corners, normals, b, n, -n).1.abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn normals_of_a_sphere_are_radial() {
        for level in 1..=4 {
            let (vertices, triangles) = icosphere(level);
            let shading = Shading::smooth(&vertices, &triangles, CREASE);
            // One facet's normal is 0.58 edges off at its corners. A ring of equal facets has none of that left; these
            // differ in area by up to a fifth between neighbours, and of what that leaves the correction leaves less than a
            // tenth.
            let edge = triangles
                .iter()
                .map(|&t| (vertices[t[0] as usize] - vertices[t[1] as usize]).length());
            let bound = 0.58 / 100.0 * edge.fold(0.0, f64::max) + STORED;
            for (t, &triangle) in triangles.iter().enumerate() {
                let normals = shading.corner_normals(t).expect("a sphere is smooth everywhere");
                for (normal, vertex) in normals.into_iter().zip(corners_of(&vertices, triangle)) {
                    assert!(
                        normal.distance(vertex) <= bound,
                        "{level}: {} > {bound}",
                        normal.distance(vertex)
                    );
                    assert!((normal.length() - 1.0).abs() <= 2.0 * STORED);
                }
            }
        }
    }

    /// Every facet of the 1280-triangle sphere from outside and inside, at up to 60 degrees: triangle, its corners,
    /// a point on it, and a ray.
    fn rays_at_a_sphere(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<(usize, [DVec3; 3], [f64; 3], DVec3)> {
        let mut rays = Vec::new();
        for (t, &triangle) in triangles.iter().enumerate() {
            let corners = corners_of(vertices, triangle);
            let n = face_normal(corners);
            for b in barycentric_grid() {
                for (angle, side) in [
                    (0.0, -1.0),
                    (0.5, -1.0),
                    (-1.05, -1.0),
                    (0.0, 1.0),
                    (0.5, 1.0),
                    (-1.05, 1.0),
                ] {
                    let (sin, cos) = f64::sin_cos(angle);
                    rays.push((t, corners, b, side * cos * n + sin * n.any_orthonormal_vector()));
                }
            }
        }
        rays
    }

    fn largest_sagitta(vertices: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
        let depth = |&t: &[u32; 3]| 1.0 - corners_of(vertices, t)[0].dot(face_normal(corners_of(vertices, t)));
        triangles.iter().map(depth).fold(0.0, f64::max)
    }

    #[test]
    fn true_normals_put_hits_on_the_sphere_from_outside_and_from_inside() {
        let (vertices, triangles) = icosphere(3);
        let sagitta = largest_sagitta(&vertices, &triangles);
        for (t, corners, b, d) in rays_at_a_sphere(&vertices, &triangles) {
            let (normal, correction) = shade(corners, Some(corners), b, face_normal(corners), d);
            let x = mean(corners, b);
            // With n = x/|x| and e = 1 - |x| the hit moves to |x|^2 = 1 - 2 e^2 + e^2 / cos^2 + ...; cos > 0.4 here.
            let error = ((x + correction * d).length() - 1.0).abs();
            assert!(
                error <= 2.2 * sagitta * sagitta,
                "{error} at {b:?} of {t}, direction {d}"
            );
            let outside = face_normal(corners).dot(d) < 0.0;
            assert!(normal.distance(if outside { x.normalize() } else { -x.normalize() }) < 1e-12);
            assert!(normal.dot(d) < 0.0, "the normal points to the incident side");
        }
    }

    #[test]
    fn hits_on_a_mesh_of_a_sphere_lie_on_the_sphere_to_second_order() {
        let (vertices, triangles) = icosphere(3);
        let shading = Shading::smooth(&vertices, &triangles, CREASE);
        let sagitta = largest_sagitta(&vertices, &triangles);
        let rays = rays_at_a_sphere(&vertices, &triangles);
        let mut sum = 0.0;
        for &(t, corners, b, d) in &rays {
            let (normal, correction) = shade(corners, shading.corner_normals(t), b, face_normal(corners), d);
            let x = mean(corners, b);
            let error = ((x + correction * d).length() - 1.0).abs();
            // The surface between true normals is off by 2.2 sagittas squared (above), and normals are nearly true.
            assert!(
                error <= 3.0 * sagitta * sagitta,
                "{error} at {b:?} of {t}, direction {d}"
            );
            sum += error * error;
            let outwards = if face_normal(corners).dot(d) < 0.0 {
                normal
            } else {
                -normal
            };
            assert!(
                outwards.distance(x.normalize()) <= (2.0 * sagitta).sqrt() / 100.0,
                "{} at {b:?} of {t}: facets lean by sqrt(2 sagitta)",
                outwards.distance(x.normalize())
            );
        }
        let rms = (sum / rays.len() as f64).sqrt();
        assert!(rms <= 0.5 * sagitta * sagitta, "{rms} {sagitta}");
    }

    #[test]
    fn a_facet_seen_from_behind_is_the_same_surface() {
        let (vertices, triangles) = icosphere(2);
        let shading = Shading::smooth(&vertices, &triangles, CREASE);
        let corners = corners_of(&vertices, triangles[7]);
        let (n, b) = (face_normal(corners), [0.2, 0.3, 0.5]);
        let d = (-n + 0.3 * n.any_orthonormal_vector()).normalize();
        let (front, nearer) = shade(corners, shading.corner_normals(7), b, n, d);
        let (back, farther) = shade(corners, shading.corner_normals(7), b, n, -d);
        assert_eq!((front, nearer), (-back, -farther));
        assert!(nearer < 0.0, "from outside, a sphere comes before its chord");
    }

    #[test]
    fn grazing_hits_keep_the_facet() {
        let (vertices, triangles) = icosphere(2);
        let shading = Shading::smooth(&vertices, &triangles, CREASE);
        let corners = corners_of(&vertices, triangles[0]);
        let n = face_normal(corners);
        for cosine in [-0.02, -1e-9, 1e-9, 0.02] {
            let d = (n * cosine + n.any_orthonormal_vector()).normalize();
            let (normal, correction) = shade(corners, shading.corner_normals(0), [1.0 / 3.0; 3], n, d);
            assert_eq!((normal, correction), (if cosine > 0.0 { -n } else { n }, 0.0));
        }
    }

    #[test]
    fn flat_shading_is_the_facets_themselves() {
        let shading = Shading::flat();
        assert!(all_flat(&shading, 2));
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let (normal, correction) = shade(corners, shading.corner_normals(0), [0.2, 0.3, 0.5], DVec3::Z, DVec3::Z);
        assert_eq!((normal, correction), (-DVec3::Z, 0.0));
        assert!(
            Shading::smooth(&[], &[], CREASE).corner_normals(0).is_none(),
            "nor is a triangle that is not there"
        );
    }

    #[test]
    fn cubes_stay_flat_below_their_crease() {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let (vertices, mut triangles) = swept(&square, 1.0, true);
        triangles.extend([[0, 6, 4], [0, 4, 2], [1, 3, 5], [1, 5, 7]]);
        assert!(all_flat(&Shading::smooth(&vertices, &triangles, CREASE), 12));
        assert!(
            all_flat(&Shading::smooth(&vertices, &triangles, PI / 2.0), 12),
            "90 degrees is not below 90 degrees"
        );
        assert!(!all_flat(&Shading::smooth(&vertices, &triangles, 1.6), 12));
        assert!(all_flat(&Shading::smooth(&vertices, &triangles, 0.0), 12));
        assert!(all_flat(&Shading::smooth(&vertices, &triangles, f64::NAN), 12));
    }

    /// Cylinder of radius 1 along z: the sides (two triangles each) first, then two caps.
    fn cylinder(segments: u32) -> (Vec<DVec3>, Triangles) {
        let angles = (0..segments).map(|i| 2.0 * PI * f64::from(i) / f64::from(segments));
        let profile: Vec<_> = angles.map(|angle| (angle.cos(), angle.sin())).collect();
        let (vertices, mut triangles) = swept(&profile, 3.0, true);
        for i in 1..segments - 1 {
            triangles.extend([[0, 2 * i + 2, 2 * i], [1, 2 * i + 1, 2 * i + 3]]);
        }
        (vertices, triangles)
    }

    #[test]
    fn cylinders_have_smooth_sides_and_flat_caps() {
        let (vertices, triangles) = cylinder(24);
        let shading = Shading::smooth(&vertices, &triangles, CREASE);
        for (t, &triangle) in triangles.iter().enumerate() {
            let normals = shading.corner_normals(t);
            if t >= 48 {
                assert!(normals.is_none(), "cap {t}");
                continue;
            }
            for (normal, vertex) in normals.expect("side").into_iter().zip(corners_of(&vertices, triangle)) {
                let radial = vertex.with_z(0.0);
                assert!(normal.z.abs() <= STORED, "caps do not reach into the side");
                // A vertex has two triangles of one neighbour and one of the other, which count alike.
                assert!(normal.distance(radial) <= 2.0 * STORED);
            }
        }
    }

    #[test]
    fn the_sides_of_a_tube_are_round_up_to_the_chamfers_at_its_ends() {
        // 72 sides of 430 mm x 4.7 mm, and chamfers of 3 mm at 30 degrees, within the crease angle.
        let angles: Vec<f64> = (0..72).map(|i| 2.0 * PI * f64::from(i) / 72.0).collect();
        let (reach, drop) = (3e-3 * (PI / 6.0).cos(), 3e-3 * (PI / 6.0).sin());
        let rings = [
            (54e-3 - drop, -reach),
            (54e-3, 0.0),
            (54e-3, 0.43),
            (54e-3 - drop, 0.43 + reach),
        ];
        let ring = |(radius, z): (f64, f64)| {
            angles
                .iter()
                .map(move |angle| DVec3::new(radius * angle.cos(), radius * angle.sin(), z))
        };
        let vertices: Vec<DVec3> = rings.into_iter().flat_map(ring).collect();
        let quad = |ring: u32, i: u32| {
            let (a, b) = (72 * ring + i, 72 * ring + (i + 1) % 72);
            [[a, b, b + 72], [a, b + 72, a + 72]]
        };
        let triangles: Triangles = [1, 0, 2]
            .iter()
            .flat_map(|r| (0..72).flat_map(|i| quad(*r, i)))
            .collect();
        let shading = Shading::smooth(&vertices, &triangles, CREASE);
        for (t, &triangle) in triangles.iter().enumerate().take(144) {
            let normals = shading.corner_normals(t).expect("side");
            for (normal, vertex) in normals.into_iter().zip(corners_of(&vertices, triangle)) {
                assert!(normal.distance(vertex.with_z(0.0).normalize()) <= 2.0 * STORED);
            }
        }
    }

    #[test]
    fn triangles_without_area_say_nothing() {
        // A body that is deformed may fold some away: all corners on one line, or two of them at one place.
        let (vertices, triangles) = icosphere(2);
        let groups = Groups::new(&vertices, &triangles, CREASE);
        let [a, b, c] = triangles[37].map(|vertex| vertex as usize);
        for place in [0.5, 1.0] {
            let folded = |x: f64| {
                let mut vertices = vertices.clone();
                vertices[a] = vertices[b].lerp(vertices[c], x);
                Shading::of_groups(&vertices, &triangles, &groups)
            };
            // As with an area of next to nothing.
            let (without, nearly) = (folded(place), folded(place - 1e-7));
            for t in (0..triangles.len()).filter(|t| *t != 37) {
                match (without.corner_normals(t), nearly.corner_normals(t)) {
                    (Some(without), Some(nearly)) => {
                        for (without, nearly) in without.into_iter().zip(nearly) {
                            assert!(without.distance(nearly) < 1e-4, "{t}: {without} {nearly}");
                        }
                    }
                    (without, nearly) => assert_eq!(without, nearly, "{t}"),
                }
            }
        }
    }

    #[test]
    fn a_prism_that_meets_at_the_crease_angle_is_a_prism() {
        let (vertices, triangles) = cylinder(8);
        assert!(all_flat(
            &Shading::smooth(&vertices, &triangles, CREASE),
            triangles.len()
        ));
        let (vertices, triangles) = cylinder(9);
        assert!(!all_flat(
            &Shading::smooth(&vertices, &triangles, CREASE),
            triangles.len()
        ));
    }

    /// Points of a quarter circle about (x, y), from angle `start` counter-clockwise.
    fn fillet((x, y): (f64, f64), radius: f64, start: f64) -> impl Iterator<Item = (f64, f64)> {
        (0..=8).map(move |i| {
            let angle = start + PI / 16.0 * f64::from(i);
            (x + radius * angle.cos(), y + radius * angle.sin())
        })
    }

    #[test]
    fn planes_beside_a_fillet_stay_planes_and_the_fillet_is_round() {
        // A wall of 0.2 m, a fillet of 5 mm in 8 strips, another wall: the rounded edge of a box.
        let profile: Vec<_> = [(0.105, -0.2)]
            .into_iter()
            .chain(fillet((0.1, 0.0), 0.005, 0.0))
            .chain([(-0.1, 0.005)])
            .collect();
        let (vertices, triangles) = swept(&profile, 0.1, false);
        let shading = Shading::smooth(&vertices, &triangles, CREASE);
        let last = triangles.len() - 2;
        for t in [0, 1, last, last + 1] {
            assert!(shading.corner_normals(t).is_none(), "wall {t}");
        }
        let sagitta = 0.005 * (1.0 - (PI / 32.0).cos());
        for (t, &triangle) in triangles.iter().enumerate().take(last).skip(2) {
            let corners = corners_of(&vertices, triangle);
            let normals = shading.corner_normals(t).expect("fillet");
            let n = face_normal(corners);
            for b in barycentric_grid() {
                let surface = mean(corners, b) - shade(corners, Some(normals), b, n, -n).1 * n;
                let off = (surface - DVec3::new(0.1, 0.0, surface.z)).length() - 0.005;
                // To second order; at its seams the normals are a hundredth of a strip's angle off.
                assert!(off.abs() <= 0.02 * sagitta, "{off} of {sagitta} in {t}");
            }
        }
        // At the seam the normal is the wall's: the fillet's strip weighs a hundredth. Weighted by angle it would lie
        // in the middle between the two, 0.05 rad off.
        let seam = shading.corner_normals(2).expect("fillet")[0];
        assert!(seam.distance(DVec3::X) < 0.002, "{seam}");
    }

    #[test]
    fn a_plane_between_two_fillets_bulges_by_no_more_than_their_share_of_its_area() {
        let profile: Vec<_> = [(0.105, -0.2)]
            .into_iter()
            .chain(fillet((0.1, 0.0), 0.005, 0.0))
            .chain(fillet((-0.1, 0.0), 0.005, PI / 2.0))
            .chain([(-0.105, -0.2)])
            .collect();
        let (vertices, triangles) = swept(&profile, 0.1, false);
        let shading = Shading::smooth(&vertices, &triangles, CREASE);
        // At most two triangles of a strip of the fillet, 1/16 pi off, weigh against one of the plane; a plane whose
        // ends bend down by that angle rises by a quarter of it times its length.
        let strip = 2.0 * 0.005 * (PI / 32.0).sin();
        let bend = 2.0 * strip / 0.2 * (PI / 32.0).sin();
        for t in [18, 19] {
            let corners = corners_of(&vertices, triangles[t]);
            assert!(face_normal(corners).distance(DVec3::Y) < 1e-12);
            let depth = largest_depth(corners, shading.corner_normals(t));
            assert!(depth <= 0.25 * bend * 0.2, "{depth} in {t}");
        }
    }

    #[test]
    fn neighbours_wound_the_other_way_are_not_smoothed() {
        let (vertices, triangles) = cylinder(24);
        let mut turned = triangles.clone();
        turned[10].swap(0, 1);
        let shading = Shading::smooth(&vertices, &turned, CREASE);
        assert!(
            shading.corner_normals(10).is_none(),
            "all its edges are sharp: its normals are its own"
        );
        let whole = Shading::smooth(&vertices, &triangles, CREASE);
        for t in [30, 31] {
            assert_eq!(
                shading.corner_normals(t),
                whole.corner_normals(t),
                "far away nothing changes"
            );
        }
    }

    #[test]
    fn an_edge_of_three_faces_is_sharp() {
        // An arc of eight strips, and a fin along the edge between strips 3 and 4.
        let profile: Vec<_> = fillet((0.0, 0.0), 1.0, 0.0).collect();
        let (mut vertices, mut triangles) = swept(&profile, 1.0, false);
        let smooth = Shading::smooth(&vertices, &triangles, CREASE);
        vertices.push(DVec3::ZERO);
        triangles.push([8, 9, 18]);
        let finned = Shading::smooth(&vertices, &triangles, CREASE);
        for t in 6..10 {
            assert!(smooth.corner_normals(t).is_some());
            // The surface ends at the fin, and half a bend fits no smooth surface.
            assert!(finned.corner_normals(t).is_none());
        }
        for t in [2, 3, 12, 13] {
            assert_eq!(
                smooth.corner_normals(t),
                finned.corner_normals(t),
                "far away nothing changes"
            );
        }
    }

    #[test]
    fn both_sides_of_a_sheet_stay_apart() {
        // The same triangle from both sides: one shared contour, wound consistently, but at 180 degrees.
        let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert!(all_flat(&Shading::smooth(&vertices, &[[0, 1, 2], [0, 2, 1]], PI), 2));
    }

    #[test]
    fn triangles_without_shared_vertices_have_the_same_normals() {
        let (vertices, triangles) = icosphere(3);
        let indexed = Shading::smooth(&vertices, &triangles, CREASE);
        let (vertices, triangles) = soup(&vertices, &triangles);
        // Zeros of either sign are one position.
        let mixed: Vec<_> = vertices
            .iter()
            .enumerate()
            .map(|(i, v)| {
                if i % 2 == 0 {
                    *v
                } else {
                    v.map(|x| if x == 0.0 { -0.0 } else { x })
                }
            })
            .collect();
        assert!(
            mixed
                .iter()
                .any(|v| v.to_array().iter().any(|x| *x == 0.0 && x.is_sign_negative()))
        );
        for vertices in [vertices, mixed] {
            let shading = Shading::smooth(&vertices, &triangles, CREASE);
            for t in 0..triangles.len() {
                assert_eq!(shading.corner_normals(t), indexed.corner_normals(t));
            }
        }
    }

    #[test]
    fn turning_every_triangle_over_turns_every_normal() {
        let (vertices, triangles) = icosphere(2);
        let over: Triangles = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let (front, back) = (
            Shading::smooth(&vertices, &triangles, CREASE),
            Shading::smooth(&vertices, &over, CREASE),
        );
        for t in 0..triangles.len() {
            let [a, b, c] = front.corner_normals(t).expect("smooth");
            assert_eq!(back.corner_normals(t).expect("smooth"), [-a, -c, -b]);
        }
    }
}
