//! Surface of one body: checked triangles with a bounding-volume tree and shading, built once and shared.

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use rayon::prelude::*;

use crate::cancel::Cancel;
use crate::error::{Error, Result};
use crate::geometry::aabb::Bounds;
use crate::geometry::components::Components;
use crate::geometry::flat_regions::FlatRegions;
use crate::geometry::smooth_normals::{Groups, Shading};
use crate::geometry::topology::Topology;
use crate::geometry::triangle::{MIN_AREA, area};
use crate::numeric::random::mix;
use crate::rays::nearest_point;
use crate::rays::tree::{MAX_PRIMITIVES, Primitives, Tree, WIDTH};
use crate::rays::triangle_block::TriangleBlock;

/// Largest coordinate that is accepted [m]: squares of lengths must stay finite.
const LARGEST: f64 = 1e15;

/// Normals of a surface from its triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShadingMode {
    /// Normal of the triangle everywhere.
    Flat,
    /// Triangles that meet below the crease angle [rad] approximate a curved surface.
    Smooth {
        /// Largest angle between the normals of two neighbouring triangles of one curved surface [rad].
        crease_angle: f64,
    },
}

/// Mesh ready to be traced, in body coordinates.
pub struct Surface {
    mesh: Arc<Mesh>,
    /// Positions of the vertices of the mesh.
    vertices: Arc<Vec<DVec3>>,
    /// Tree over boxes relative to `anchor`.
    pub(super) tree: Tree,
    /// Triangles of every leaf, relative to `anchor`.
    pub(super) blocks: Vec<TriangleBlock>,
    /// Cost of the tree when it was built.
    built_cost: f64,
    /// Largest coordinate relative to `anchor`.
    pub(super) max_coordinate: f32,
    shading: Shading,
    bounds: Bounds,
    /// Point of the body that coordinates in single precision are relative to.
    pub(super) anchor: DVec3,
    /// Boxes of the connected components; if asked for.
    part_bounds: OnceLock<Vec<Bounds>>,
}

/// Part of a surface that deformation does not change.
struct Mesh {
    /// Positions of the vertices before deformation.
    rest: Arc<Vec<DVec3>>,
    /// Triangles that were kept.
    triangles: Vec<[u32; 3]>,
    /// Rows of the triangles that were kept in the original mesh, unless all were.
    kept: Option<Vec<u32>>,
    mode: ShadingMode,
    /// Corners that share a normal; for surfaces that were deformed.
    groups: OnceLock<Groups>,
    /// Connected components of the triangles; if asked for.
    parts: OnceLock<Components>,
    /// Flat regions of the surface as it was before deformation; if asked for.
    flat_regions: OnceLock<FlatRegions>,
    content_hash: u64,
}

/// Growth of the cost of a refitted tree above which it is built anew: there, images take a seventh longer than with a
/// new tree (`cargo bench --bench trace -- twisted`, a little below it).
const DECAY: f64 = 2.0;

impl Surface {
    /// Check a mesh, drop its degenerate triangles (area below 1e-18 m^2) and build its tree, until a request to stop, in
    /// steps of a thousandth of the work.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]], mode: ShadingMode, cancel: &Cancel) -> Result<Self> {
        check_vertices(vertices)?;
        if triangles.len() > MAX_PRIMITIVES {
            let expected = format!("at most {MAX_PRIMITIVES}");
            return Err(Error::value("triangles", expected, triangles.len()));
        }
        if let Some(bad) = triangles
            .iter()
            .position(|t| t.iter().any(|&i| i as usize >= vertices.len()))
        {
            let expected = format!("vertex numbers below {}", vertices.len());
            return Err(Error::value(
                "triangles",
                expected,
                format!("{:?} at row {bad}", triangles[bad]),
            ));
        }

        let corners = |t: &[u32; 3]| t.map(|i| vertices[i as usize]);
        let is_kept = |t: &[u32; 3]| area(&corners(t)) >= MIN_AREA;
        let kept: Option<Vec<u32>> = (!triangles.iter().all(is_kept)).then(|| {
            let rows = 0..triangles.len() as u32;
            rows.filter(|&row| is_kept(&triangles[row as usize])).collect()
        });
        let triangles: Vec<[u32; 3]> = match &kept {
            None => triangles.to_vec(),
            Some(kept) => kept.iter().map(|&row| triangles[row as usize]).collect(),
        };
        let content_hash = content_hash(vertices, &triangles);
        finished(cancel, 100)?;
        let shading = match mode {
            ShadingMode::Flat => Shading::flat(),
            ShadingMode::Smooth { crease_angle } => {
                let groups = Groups::new(vertices, &triangles, crease_angle);
                finished(cancel, 200)?;
                Shading::of_groups(vertices, &triangles, &groups)
            }
        };
        finished(cancel, 200)?;
        let rest = Arc::new(vertices.to_vec());
        let mesh = Mesh {
            rest: rest.clone(),
            triangles,
            kept,
            mode,
            groups: OnceLock::new(),
            parts: OnceLock::new(),
            flat_regions: OnceLock::new(),
            content_hash,
        };
        Self::build(Arc::new(mesh), rest, shading, cancel)
    }

    /// Surface with a new tree.
    fn build(mesh: Arc<Mesh>, vertices: Arc<Vec<DVec3>>, shading: Shading, cancel: &Cancel) -> Result<Self> {
        let anchor = mesh.bounds(&vertices).middle();
        let relative = |triangle: usize| mesh.relative(&vertices, triangle, anchor);
        let (tree, primitives) = Tree::build(mesh.triangles.len(), WIDTH, |i| Bounds::of_triangle(&relative(i)));
        finished(cancel, 350)?;
        let fitted = Fitted::new(&mesh, &vertices, anchor, primitives.into_par_iter());
        finished(cancel, 150)?;
        Ok(Self {
            blocks: fitted.blocks,
            built_cost: tree.cost(),
            tree,
            max_coordinate: max_coordinate(&fitted.bounds),
            shading,
            bounds: fitted.bounds.moved(anchor),
            anchor,
            part_bounds: OnceLock::new(),
            vertices,
            mesh,
        })
    }

    /// Surface with the same triangles and moved vertices [m]. The tree keeps its topology and gets new boxes, unless
    /// its cost has grown too much since it was built; then a new one is built, until a request to stop.
    pub fn deform(&self, vertices: Vec<DVec3>, cancel: &Cancel) -> Result<Self> {
        if vertices.len() != self.vertices.len() {
            let expected = format!("{} as the mesh has", self.vertices.len());
            return Err(Error::value("vertices", expected, vertices.len()));
        }
        check_vertices(&vertices)?;
        let (mesh, vertices) = (self.mesh.clone(), Arc::new(vertices));
        let shading = match mesh.mode {
            ShadingMode::Flat => Shading::flat(),
            ShadingMode::Smooth { crease_angle } => {
                let groups = mesh
                    .groups
                    .get_or_init(|| Groups::new(&mesh.rest, &mesh.triangles, crease_angle));
                cancel.check()?;
                Shading::of_groups(&vertices, &mesh.triangles, groups)
            }
        };
        cancel.check()?;
        let fit = |anchor: DVec3| {
            let primitives = self.blocks.par_iter().map(|block| block.triangles);
            Fitted::new(&mesh, &vertices, anchor, primitives)
        };
        let (mut anchor, mut fitted) = (self.anchor, fit(self.anchor));
        // Coordinates relative to a point far away are inexact in single precision.
        let half = 0.5 * (fitted.bounds.max - fitted.bounds.min).max_element();
        if f64::from(max_coordinate(&fitted.bounds)) > 4.0 * half {
            anchor += fitted.bounds.middle();
            fitted = fit(anchor);
        }
        cancel.check()?;
        let tree = self.tree.refit(|leaf| fitted.boxes[leaf]);
        if tree.cost() > DECAY * self.built_cost {
            return Self::build(mesh, vertices, shading, cancel);
        }
        Ok(Self {
            blocks: fitted.blocks,
            tree,
            built_cost: self.built_cost,
            max_coordinate: max_coordinate(&fitted.bounds),
            shading,
            bounds: fitted.bounds.moved(anchor),
            anchor,
            part_bounds: OnceLock::new(),
            vertices,
            mesh,
        })
    }

    /// Number of parts, and numbers of edges by kind.
    pub fn topology(&self) -> Topology {
        Topology::new(&self.vertices, &self.mesh.triangles)
    }

    /// Memory of triangles, tree and shading [bytes], without the vertices.
    pub fn memory(&self) -> usize {
        let mesh = &self.mesh;
        size_of_val(mesh.triangles.as_slice())
            + mesh.kept.as_ref().map_or(0, |kept| size_of_val(kept.as_slice()))
            + mesh.groups.get().map_or(0, Groups::memory)
            + mesh.parts.get().map_or(0, Components::memory)
            + mesh.flat_regions.get().map_or(0, FlatRegions::memory)
            + self
                .part_bounds
                .get()
                .map_or(0, |bounds| size_of_val(bounds.as_slice()))
            + size_of_val(self.tree.nodes.as_slice())
            + size_of_val(self.blocks.as_slice())
            + self.shading.memory()
    }

    /// Memory of the vertices [bytes].
    pub fn vertex_memory(&self) -> usize {
        let both = 1 + usize::from(self.is_deformed());
        both * size_of_val(self.vertices.as_slice())
    }

    /// True if [`Self::deform`] made this surface.
    pub fn is_deformed(&self) -> bool {
        !Arc::ptr_eq(&self.vertices, &self.mesh.rest)
    }

    /// Number of triangles that were kept.
    pub fn num_triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Row in the original mesh of every triangle that was kept; none if all were.
    pub fn kept(&self) -> Option<&[u32]> {
        self.mesh.kept.as_deref()
    }

    /// Hash of the triangles in their order.
    pub fn content_hash(&self) -> u64 {
        self.mesh.content_hash
    }

    /// Box round all triangles.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Boxes of the connected components; of very many only the boxes of the largest.
    pub fn parts(&self) -> &[Bounds] {
        let mesh = &self.mesh;
        self.part_bounds.get_or_init(|| {
            let parts = mesh.parts.get_or_init(|| Components::new(&mesh.rest, &mesh.triangles));
            parts.bounds(self.bounds, |triangle| mesh.corners(&self.vertices, triangle))
        })
    }

    /// Flat regions with sharp edges all round; none of a deformed surface.
    pub fn flat_regions(&self) -> Option<&FlatRegions> {
        let new = || {
            let is_flat = |triangle: usize| self.shading.corner_normals(triangle).is_none();
            FlatRegions::new(&self.vertices, &self.mesh.triangles, is_flat)
        };
        (!self.is_deformed()).then(|| self.mesh.flat_regions.get_or_init(new))
    }

    /// Corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.mesh.corners(&self.vertices, triangle as usize)
    }

    /// Vertex numbers of a triangle.
    pub fn vertices_of(&self, triangle: u32) -> [u32; 3] {
        self.mesh.triangles[triangle as usize]
    }

    /// Positions of all vertices [m].
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Corners of a triangle before the surface was deformed.
    pub fn rest_corners(&self, triangle: u32) -> [DVec3; 3] {
        self.mesh.corners(&self.mesh.rest, triangle as usize)
    }

    /// Normals at the corners of a triangle that approximates a curved surface; none if it is flat.
    #[inline]
    pub fn corner_normals(&self, triangle: u32) -> Option<[DVec3; 3]> {
        self.shading.corner_normals(triangle as usize)
    }

    /// Distance [m] of a point from the nearest triangle that is not all behind the plane through the point with normal
    /// `forward`; at most `limit`.
    pub fn distance_in_front(&self, point: DVec3, forward: DVec3, limit: f64) -> f64 {
        let corners = |leaf: usize, count: usize| {
            let triangles = self.blocks[leaf].triangles[..count].iter();
            triangles.map(|triangle| self.mesh.relative(&self.vertices, *triangle as usize, self.anchor))
        };
        nearest_point::distance_in_front(&self.tree, point - self.anchor, forward, limit, corners)
    }
}

impl Mesh {
    #[inline]
    fn corners(&self, vertices: &[DVec3], triangle: usize) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[triangle];
        [vertices[a as usize], vertices[b as usize], vertices[c as usize]]
    }

    #[inline]
    fn relative(&self, vertices: &[DVec3], triangle: usize, to: DVec3) -> [DVec3; 3] {
        let [a, b, c] = self.corners(vertices, triangle);
        [a - to, b - to, c - to]
    }

    fn bounds(&self, vertices: &[DVec3]) -> Bounds {
        let all = self.triangles.iter().flatten();
        Bounds::of(all.map(|vertex| vertices[*vertex as usize]))
    }
}

/// Count thousandths of a build that are done; an error after a request to stop.
fn finished(cancel: &Cancel, thousandths: usize) -> Result<()> {
    cancel.advance(thousandths);
    cancel.check()
}

/// Refuse coordinates that cannot be traced.
fn check_vertices(vertices: &[DVec3]) -> Result<()> {
    if let Some(bad) = vertices.iter().position(|v| !v.is_finite()) {
        return Err(Error::value(
            "vertices",
            "finite coordinates [m]",
            format!("{} at row {bad}", vertices[bad]),
        ));
    }
    if let Some(bad) = vertices.iter().position(|v| v.abs().max_element() > LARGEST) {
        let got = format!("{} at row {bad}", vertices[bad]);
        return Err(Error::value(
            "vertices",
            format!("coordinates below {LARGEST:e} m"),
            got,
        ));
    }
    Ok(())
}

/// Triangle blocks of the leaves, relative to a point, and their boxes.
struct Fitted {
    blocks: Vec<TriangleBlock>,
    boxes: Vec<Bounds>,
    /// Box of all leaves.
    bounds: Bounds,
}

impl Fitted {
    fn new(
        mesh: &Mesh,
        vertices: &[DVec3],
        anchor: DVec3,
        primitives: impl IndexedParallelIterator<Item = Primitives>,
    ) -> Self {
        let fit = |triangles: Primitives| {
            let mut bounds = Bounds::EMPTY;
            let block = TriangleBlock::new(triangles, |triangle| {
                let corners = mesh.relative(vertices, triangle as usize, anchor);
                bounds = bounds.union(&Bounds::of_triangle(&corners));
                corners
            });
            (block, bounds)
        };
        let (blocks, boxes): (Vec<TriangleBlock>, Vec<Bounds>) = primitives.map(fit).unzip();
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
        Self { blocks, boxes, bounds }
    }
}

/// Largest coordinate of a box.
fn max_coordinate(bounds: &Bounds) -> f32 {
    let largest = bounds.max.max(-bounds.min).max_element();
    (largest.max(0.0) as f32).next_up()
}

/// Hash of triangles in their order.
fn content_hash(vertices: &[DVec3], triangles: &[[u32; 3]]) -> u64 {
    let of = |triangles: &[[u32; 3]]| {
        triangles.iter().flatten().fold(0, |state, vertex| {
            let [x, y, z] = vertices[*vertex as usize].to_array().map(f64::to_bits);
            mix(state ^ x ^ y.rotate_left(21) ^ z.rotate_left(42))
        })
    };
    let parts: Vec<u64> = triangles.par_chunks(4096).map(of).collect();
    parts.into_iter().fold(0, |state, part| mix(state ^ part))
}

#[cfg(test)]
mod tests;
