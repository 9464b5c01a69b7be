//! Smooth normals: normals of the curved surface that a triangle mesh approximates, at the corners of its triangles.
//!
//! A facet of a curved surface is a chord: a coherent sum over it would see facets, not the surface. Normals at
//! the corners say where the surface lies, to second order (docs/theory.md). The normals are area-weighted, as weights
//! by angle would bend planes next to fillets, less what area weights get wrong round a vertex of even curvature: there
//! they lean towards large facets. Triangles in one plane are one facet, whichever way its diagonals run, and facets
//! much smaller than one do not affect its normals.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::topology::{distinct_positions, for_edges, join, next_corner, root, two_sides};
use crate::geometry::triangle::MIN_AREA;

/// Shading of a triangle mesh: unit normals of the curved surface at the corners of the triangles that approximate one.
#[derive(Debug, Clone)]
pub struct Shading {
    /// Index into `normals` of every corner of every triangle, or `FLAT`; empty if all are flat.
    corners: Vec<[u32; 3]>,
    /// Unit normals, shared by corners.
    normals: Vec<Vec3>,
}

/// Indices of a triangle without normals.
const FLAT: [u32; 3] = [u32::MAX; 3];

/// Largest distance of the corners of an edge from the surface that its normals describe [m], rms over a triangle:
/// rounding of files written with a few digits.
const EDGE_TOLERANCE: f64 = 16e-6;

/// Margin [rad] by which edges at just the crease angle are sharp, whatever their rounding.
const CREASE_MARGIN: f64 = 1e-6;

/// Largest angle between normals across an edge at which two triangles lie in one plane [rad]: rounding of files.
pub const PLANE_ANGLE: f64 = 1e-3;

/// Largest fraction of a facet's area at which another facet does not affect its normals: a tenth, whatever the
/// rounding.
const SMALL_FACET: f64 = 0.1 * (1.0 + 1e-6);

impl Shading {
    /// Shading without curved surfaces.
    pub fn flat() -> Self {
        Self {
            corners: Vec::new(),
            normals: Vec::new(),
        }
    }

    /// Shading of facets that approximate one curved surface where they meet at less than the crease angle of the groups.
    /// The vertices may have moved since the groups were found.
    ///
    /// An edge is smooth when exactly two triangles share it, run through it in opposite directions and have an angle
    /// below the crease angle between normals. Vertices at equal positions count as one. The normal at a corner is the
    /// area-weighted mean over the triangles connected to it through smooth edges round its vertex, and on a sphere the
    /// radius. Facets of a tenth of its own area or less are left out: a tube is straight up to the chamfers at its
    /// ends. A triangle stays flat where these normals fit no smooth surface, or are all its own.
    ///
    /// Triangles index into `vertices` and have an area. The result depends on their order by rounding at most.
    pub fn of_groups(vertices: &[DVec3], triangles: &[[u32; 3]], groups: &Groups) -> Self {
        let rings = OneRings::new(vertices, triangles, groups);
        let groups = &groups.corners;
        let number = rings.means.len();
        let normals_of_groups: Vec<DVec3> = (0..number).into_par_iter().map(|group| rings.normal(group)).collect();
        let smallest: Vec<f64> = (0..number).into_par_iter().map(|group| rings.smallest(group)).collect();

        // Keep the normals where they describe a curved surface through the three vertices.
        let mut shading = Self {
            corners: vec![FLAT; triangles.len()],
            normals: Vec::new(),
        };
        let mut places = vec![u32::MAX; normals_of_groups.len()];
        let mut by_size = HashMap::new();
        for (index, triangle) in triangles.iter().enumerate() {
            let corners = triangle.map(|vertex| vertices[vertex as usize]);
            let own = [0, 1, 2].map(|i| groups[3 * index + i] as usize);
            let least = SMALL_FACET * rings.facets.areas[index];
            let is_shared = own.map(|group| smallest[group] > least);
            let normals = [0, 1, 2].map(|i| {
                if is_shared[i] {
                    normals_of_groups[own[i]]
                } else {
                    let by_size = by_size.entry(own[i]).or_insert_with(|| rings.by_size(own[i]));
                    by_size.normal(least)
                }
            });
            let face_normal = rings.area_normals[index].normalize_or_zero();
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
    #[inline]
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
    /// First triangle of the facet of every triangle.
    facets: Vec<u32>,
}

impl Groups {
    /// Groups by the rules of [`Shading::of_groups`] for a crease angle [rad].
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]], crease_angle: f64) -> Self {
        let area_normals = area_normals(vertices, triangles);
        smooth_groups(vertices, triangles, &area_normals, crease_angle)
    }

    /// Memory [bytes].
    pub fn memory(&self) -> usize {
        size_of_val(self.corners.as_slice()) + size_of_val(self.facets.as_slice())
    }
}

/// Areas and weights of facets: triangles in one plane together.
struct Facets {
    /// Twice the area of every triangle's facet [m^2].
    areas: Vec<f64>,
    /// Factor of every corner's triangle over its own area, so that a group counts all of a facet once.
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

        // Of facets of more than one triangle: data of a group.
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

/// Corners of every group.
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

    /// Corners of a group in the order of the triangles.
    fn of(&self, group: usize) -> impl Iterator<Item = usize> {
        let range = self.starts[group] as usize..self.starts[group + 1] as usize;
        self.corners[range].iter().map(|corner| *corner as usize)
    }
}

/// Twice the area times the unit normal of every triangle: sums are weighted by area.
fn area_normals(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let normal = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| vertices[vertex as usize]);
        (b - a).cross(c - a)
    };
    triangles.iter().map(normal).collect()
}

/// Sums over the triangles of a group round its vertex, weighted by area.
#[derive(Clone, Copy, Default)]
struct OneRing {
    /// Sum of the normals, and of the areas.
    normal: DVec3,
    area: f64,
    /// Sum of the offsets of the circumcentres from the vertex.
    offset: DVec3,
    /// Sums over the edges of the squared change of the normal, of the change times the length, and of the squared length.
    moments: [f64; 3],
}

impl OneRing {
    /// Unit normal at the vertex.
    ///
    /// A facet's normal is the surface normal at its circumcentre. Where these do not lie evenly round the vertex, the
    /// mean leans by the curvature times their mean offset. This is corrected for evenly turning normals: in proportion
    /// to the length of an edge, in any direction. The squared correlation of the two is 1 on a sphere and two thirds
    /// on a cylinder, less where facets are long; from there on down, as where a plane ends in a fillet, the mean is
    /// left alone. The same holds if all facets are one plane.
    fn unit_normal(&self) -> DVec3 {
        if self.normal.length() >= (1.0 - 0.5 * PLANE_ANGLE * PLANE_ANGLE) * self.area {
            return self.normal.normalize_or_zero();
        }
        let [change, product, length] = self.moments;
        let curvature = product / length;
        let evenness = 3.0 * (curvature * product / change) - 2.0;
        if evenness > 0.0 {
            (self.normal - evenness * curvature * self.offset).normalize_or_zero()
        } else {
            self.normal.normalize_or_zero()
        }
    }
}

/// One-ring neighbourhoods of the groups, from which their normals are computed.
struct OneRings<'a> {
    vertices: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    /// Group of every corner, and corners of every group.
    groups: &'a [u32],
    members: Members,
    area_normals: Vec<DVec3>,
    facets: Facets,
    /// Unit normal of every group from all its facets.
    means: Vec<DVec3>,
}

impl<'a> OneRings<'a> {
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
        let mut ring = OneRing::default();
        for corner in self.members.of(group) {
            self.add(&mut ring, corner);
        }
        ring.unit_normal()
    }

    /// Facets of a group, from the largest to the smallest.
    fn by_size(&self, group: usize) -> NormalsBySize {
        let area = |corner: &usize| self.facets.areas[corner / 3];
        let mut corners: Vec<usize> = self.members.of(group).collect();
        corners.sort_by(|a, b| area(b).total_cmp(&area(a)));
        let mut ring = OneRing::default();
        let mut rings = vec![ring];
        for corner in &corners {
            self.add(&mut ring, *corner);
            rings.push(ring);
        }
        NormalsBySize {
            areas: corners.iter().map(area).collect(),
            rings,
        }
    }

    fn add(&self, ring: &mut OneRing, corner: usize) {
        let (triangle, first) = (corner / 3, corner % 3);
        let weight = self.facets.weights[corner];
        let area_normal = self.area_normals[triangle];
        let area = area_normal.length();
        // Deformed bodies may have triangles without.
        if 0.5 * area < MIN_AREA {
            return;
        }
        let face_normal = area_normal / area;
        ring.normal += weight * area_normal;
        ring.area += weight * area;

        // The edges from this corner and to it.
        let vertex = |i: usize| self.vertices[self.triangles[triangle][i] as usize];
        let mean = |i: usize| self.means[self.groups[3 * triangle + i] as usize];
        let (next, before) = ((first + 1) % 3, (first + 2) % 3);
        let (from, to) = (vertex(next) - vertex(first), vertex(first) - vertex(before));
        let squares = [from, to].map(DVec3::length_squared);
        ring.offset += 0.5 * weight * (squares[1] * face_normal.cross(from) - squares[0] * to.cross(face_normal));
        // By the length of the edge: angle and length, and not their products.
        let changes = [
            (mean(next) - mean(first)).dot(from),
            (mean(first) - mean(before)).dot(to),
        ];
        for (change, square) in changes.into_iter().zip(squares) {
            let moments = [change * change / square, change, square];
            for k in 0..3 {
                ring.moments[k] += weight * area * moments[k];
            }
        }
    }
}

/// Normals of a group from its largest facets: from none, from the largest, from the two largest, ...
struct NormalsBySize {
    /// Areas of the facets, decreasing.
    areas: Vec<f64>,
    rings: Vec<OneRing>,
}

impl NormalsBySize {
    /// Unit normal from the facets larger than an area.
    fn normal(&self, least: f64) -> DVec3 {
        let number = self.areas.partition_point(|area| *area > least);
        self.rings[number].unit_normal()
    }
}

/// True if a corner normal differs from the face normal by more than the rounding of storage. On a plane none does:
/// it needs no normals and stays exact.
fn is_curved(normals: [DVec3; 3], face_normal: DVec3) -> bool {
    normals
        .iter()
        .any(|normal| normal.distance(face_normal) > f64::from(f32::EPSILON))
}

/// True if the edges can be chords of the surface with these normals at their ends.
///
/// A chord e of a smooth surface has (`n_a` + `n_b`).e = 0 to second order: the rise of the surface at one end equals
/// its fall at the other. Not so where a plane ends in a fillet: one normal is bent, the other not. The three edges
/// share what they may be off: along the axis of a tube nothing bends, and noise would decide.
fn is_consistent(corners: [DVec3; 3], normals: [DVec3; 3]) -> bool {
    let (mut off, mut curved) = (0.0, 0.0);
    for i in 0..3 {
        let j = (i + 1) % 3;
        let edge = corners[j] - corners[i];
        let (at_start, at_end) = (normals[i].dot(edge), normals[j].dot(edge));
        off += (at_start + at_end).powi(2);
        curved += (at_end - at_start).powi(2);
    }
    off <= 0.5 * curved + 3.0 * EDGE_TOLERANCE.powi(2)
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

#[cfg(test)]
mod tests;
