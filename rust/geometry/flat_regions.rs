//! Flat regions of a triangle mesh: connected triangles in one plane, up to sharp edges all round.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use crate::geometry::smooth_normals::PLANE_ANGLE;
use crate::geometry::topology::{distinct_positions, for_edges, join, next_corner, root, two_sides};

/// Least angle between the normals on both sides of a sharp edge [rad]. At smaller ones surfaces approximate a curve.
const SHARP: f64 = 0.35;

/// Largest distance of a vertex from the plane of its region [m].
const FLATNESS: f64 = 1e-5;

/// Largest distance of a vertex from the line between its neighbours at which one edge continues through it [m].
const STRAIGHTNESS: f64 = 2e-6;

/// Least area of a region [m^2]: about a square wavelength at 60 GHz.
const LEAST_AREA: f64 = 25e-6;

/// Largest number of edges of a region.
const MOST_EDGES: usize = 1000;

/// Largest number of regions of a mesh.
const MOST_REGIONS: usize = 255;

/// Region of a triangle in none.
const NONE: u32 = u32::MAX;

/// Connected triangles in one plane.
pub struct FlatRegion {
    /// The first of the triangles.
    pub triangle: u32,
    /// Unit normal of the triangles.
    pub normal: DVec3,
    /// Directed edges all round, from one vertex to the next: seen against the normal, the region lies on their left.
    pub outline: Vec<[DVec3; 2]>,
}

/// Flat regions of a mesh.
#[derive(Default)]
pub struct FlatRegions {
    /// The regions.
    pub regions: Vec<FlatRegion>,
    /// Number of the region of every triangle, or [`NONE`]; empty without regions.
    of_triangle: Vec<u32>,
}

impl FlatRegions {
    /// Regions of the triangles that are flat; the largest of very many. Triangles have an area.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]], is_flat: impl Fn(usize) -> bool) -> Self {
        let positions = distinct_positions(vertices);
        let position = |corner: usize| positions[triangles[corner / 3][corner % 3] as usize];
        let place = |corner: usize| vertices[triangles[corner / 3][corner % 3] as usize];
        let area_normal = |triangle: usize| {
            let [a, b, c] = [0, 1, 2].map(|i| place(3 * triangle + i));
            0.5 * (b - a).cross(c - a)
        };
        let normals: Vec<DVec3> = (0..triangles.len())
            .map(|triangle| area_normal(triangle).normalize())
            .collect();
        let angle = |a: usize, b: usize| normals[a].cross(normals[b]).length().atan2(normals[a].dot(normals[b]));

        let mut parents: Vec<u32> = (0..triangles.len() as u32).collect();
        for_edges(triangles.len(), position, |edge| {
            if let Some((first, second)) = two_sides(edge, position) {
                let (a, b) = (first / 3, second / 3);
                if is_flat(a) && is_flat(b) && angle(a, b) < PLANE_ANGLE {
                    join(&mut parents, a, b);
                }
            }
        });
        let roots: Vec<usize> = (0..triangles.len())
            .map(|triangle| root(&mut parents, triangle))
            .collect();

        // By the first triangle: area times normal, the outline, and whether the region is one.
        let mut found: BTreeMap<usize, (DVec3, Vec<[usize; 2]>, bool)> = BTreeMap::new();
        let mut members: HashMap<usize, Vec<usize>> = HashMap::new();
        for triangle in (0..triangles.len()).filter(|triangle| is_flat(*triangle)) {
            let region = found.entry(roots[triangle]).or_insert((DVec3::ZERO, Vec::new(), true));
            region.0 += area_normal(triangle);
            members.entry(roots[triangle]).or_default().push(triangle);
        }
        for_edges(triangles.len(), position, |edge| {
            let both = two_sides(edge, position).map(|(first, second)| (first / 3, second / 3));
            if both.is_some_and(|(a, b)| roots[a] == roots[b]) {
                return;
            }
            let is_sharp = both.is_none_or(|(a, b)| angle(a, b) > SHARP);
            for corner in edge.iter().map(|corner| *corner as usize) {
                if let Some(region) = found.get_mut(&roots[corner / 3]) {
                    region.1.push([corner, next_corner(corner)]);
                    region.2 &= is_sharp;
                }
            }
        });
        let mut kept: Vec<(usize, f64, FlatRegion)> = found
            .into_iter()
            .filter_map(|(root, (area_normal, outline, is_sharp))| {
                let outline = straightened(&outline, position, place);
                let area = area_normal.length();
                let normal = area_normal / area;
                let is_on_plane = |corner: usize| (place(corner) - outline[0][0]).dot(normal).abs() < FLATNESS;
                let is_plane = members[&root]
                    .iter()
                    .all(|triangle| (0..3).all(|i| is_on_plane(3 * triangle + i)));
                let is_region = is_sharp && area >= LEAST_AREA && outline.len() <= MOST_EDGES && is_plane;
                let triangle = root as u32;
                is_region.then_some((
                    root,
                    area,
                    FlatRegion {
                        triangle,
                        normal,
                        outline,
                    },
                ))
            })
            .collect();
        kept.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        kept.truncate(MOST_REGIONS);

        if kept.is_empty() {
            return Self::default();
        }
        let mut number_of = vec![NONE; triangles.len()];
        for (number, (root, ..)) in (0..).zip(&kept) {
            number_of[*root] = number;
        }
        Self {
            of_triangle: roots.iter().map(|root| number_of[*root]).collect(),
            regions: kept.into_iter().map(|(_, _, region)| region).collect(),
        }
    }

    /// Number of the region of a triangle.
    pub fn of_triangle(&self, triangle: u32) -> Option<usize> {
        let number = *self.of_triangle.get(triangle as usize)?;
        (number != NONE).then_some(number as usize)
    }

    /// Memory [bytes].
    pub fn memory(&self) -> usize {
        let outlines = self.regions.iter().map(|region| size_of_val(region.outline.as_slice()));
        size_of_val(self.of_triangle.as_slice()) + outlines.sum::<usize>()
    }
}

/// Edges of an outline from corner to corner, without vertices at which an edge goes straight on.
fn straightened(
    edges: &[[usize; 2]],
    position: impl Fn(usize) -> u32,
    place: impl Fn(usize) -> DVec3,
) -> Vec<[DVec3; 2]> {
    // The edge that starts at a position, if it is the only one.
    let mut next: HashMap<u32, Option<usize>> = HashMap::new();
    for (number, [start, _]) in edges.iter().enumerate() {
        next.entry(position(*start))
            .and_modify(|edge| *edge = None)
            .or_insert(Some(number));
    }
    let after = |edge: usize| next.get(&position(edges[edge][1])).copied().flatten();
    let is_straight = |start: DVec3, middle: DVec3, end: DVec3| {
        let along = (end - start).normalize_or_zero();
        let offset = middle - start;
        (middle - start).dot(end - middle) > 0.0 && (offset - offset.dot(along) * along).length() < STRAIGHTNESS
    };
    let goes_on = |edge: usize| {
        let next = after(edge)?;
        let [start, middle] = edges[edge].map(&place);
        is_straight(start, middle, place(edges[next][1])).then_some(next)
    };
    // Edges without a straight predecessor come first; the others are rings without a corner.
    let mut has_before = vec![false; edges.len()];
    for edge in 0..edges.len() {
        if let Some(next) = goes_on(edge) {
            has_before[next] = true;
        }
    }
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_by_key(|edge| has_before[*edge]);
    let mut is_done = vec![false; edges.len()];
    let mut outline = Vec::new();
    for first in order {
        if is_done[first] {
            continue;
        }
        is_done[first] = true;
        let [start, mut end] = edges[first].map(&place);
        let mut last = first;
        while let Some(next) = after(last).filter(|next| !is_done[*next]) {
            let further = place(edges[next][1]);
            if !is_straight(start, end, further) {
                break;
            }
            is_done[next] = true;
            (last, end) = (next, further);
        }
        outline.push([start, end]);
    }
    outline
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of a box with sides 1, 2 and 3 cm, and its triangles.
    fn cuboid() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let vertices =
            (0..8_u32).map(|i| 0.01 * DVec3::new(f64::from(i & 1), f64::from(i & 2), f64::from(3 * (i >> 2))));
        let sides = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
        (vertices.collect(), triangles.collect())
    }

    #[test]
    fn straight_sides_of_many_edges_are_one() {
        const SIDE: u32 = 7;
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        for i in 0..=SIDE {
            for j in 0..=SIDE {
                vertices.push(0.03 * DVec3::new(f64::from(i), f64::from(j), 0.1 * f64::from(i)));
                if i < SIDE && j < SIDE {
                    let first = i * (SIDE + 1) + j;
                    triangles.extend([
                        [first, first + SIDE + 1, first + SIDE + 2],
                        [first, first + SIDE + 2, first + 1],
                    ]);
                }
            }
        }
        let flat = FlatRegions::new(&vertices, &triangles, |_| true);
        let outline = &flat.regions[0].outline;
        assert_eq!((flat.regions.len(), outline.len()), (1, 4));
        let length: f64 = outline.iter().map(|[a, b]| a.distance(*b)).sum();
        assert!((length - 2.0 * 0.21 * (1.0 + 1.01_f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn small_bent_and_curved_surfaces_are_no_regions() {
        let (vertices, triangles) = cuboid();
        let small: Vec<DVec3> = vertices.iter().map(|vertex| 0.1 * *vertex).collect();
        assert!(FlatRegions::new(&small, &triangles, |_| true).regions.is_empty());
        assert!(FlatRegions::new(&vertices, &triangles, |_| false).regions.is_empty());
        // Two squares with a fold between them.
        for (angle, number) in [(0.0_f64, 1), (0.1, 0), (0.5, 2)] {
            let end = 0.1 * DVec3::new(-angle.cos(), 0.0, angle.sin());
            let corners = [0.1 * DVec3::X, DVec3::ZERO, end].map(|x| [x, x + 0.1 * DVec3::Y]);
            let fold = [[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]];
            let flat = FlatRegions::new(corners.as_flattened(), &fold, |_| true);
            assert_eq!(flat.regions.len(), number, "{angle}");
        }
    }
}
