//! Search of a scene for the nearest triangles of the rays of a tile, body by body.

use crate::numeric::simd::Isa;
use crate::rays::hits::Cast;
use crate::rays::packet::{BodyRays, MOST_RAYS, PACKETS, TileRays};
use crate::rays::packet_hits::{Exact, PacketHits};
use crate::rays::packet_search::{Traversals, Waiting};
use crate::rays::scene::{NEAREST, PosedScene};
use crate::rays::shade::Shade;
use crate::rays::traversal::Visit;
use crate::rays::tree::Node;
use crate::rays::triangle_block::Table;

/// Rays of a tile and their hits; memory kept from tile to tile.
pub(crate) struct Scratch {
    /// Rays of the tile; aim them, and keep the packets that are wanted.
    pub rays: TileRays,
    body_rays: BodyRays,
    /// Nearest triangles, from [`PosedScene::search`].
    pub hits: PacketHits,
    table: Table,
    pub(crate) top: Vec<u64>,
    stack: Vec<Waiting>,
    /// Distances [m], from [`PosedScene::measure`].
    pub distance: [f64; MOST_RAYS],
    /// Smooth hits, from [`Shade::fill`].
    pub shade: Shade,
}

impl Scratch {
    /// Memory without rays.
    pub fn new() -> Self {
        Self {
            rays: TileRays::EMPTY,
            body_rays: BodyRays::EMPTY,
            hits: PacketHits::EMPTY,
            table: Table::EMPTY,
            top: Vec::with_capacity(64),
            stack: Vec::with_capacity(256),
            distance: [0.0; MOST_RAYS],
            shade: Shade::NOTHING,
        }
    }
}

impl PosedScene {
    /// Search for the nearest triangles of the rays of a tile. Returns true if no body is in the tile: then hits are
    /// those of the tile before.
    #[cfg_attr(optimised, inline(always))]
    pub(crate) fn search<I: Isa>(&self, scratch: &mut Scratch, cast: &Cast) -> bool {
        let rays = &scratch.rays;
        if rays.valid == [0; PACKETS] {
            return true;
        }
        let mut bodies = Bodies {
            scene: self,
            rays,
            body_rays: &mut scratch.body_rays,
            hits: &mut scratch.hits,
            table: &mut scratch.table,
            stack: &mut scratch.stack,
            traversals: cast.traversals,
            num_leaves: 0,
            is_empty: true,
        };
        if cast.skip_empty {
            rays.traverse::<I>(&self.top, &mut scratch.top, &mut bodies);
            return bodies.is_empty;
        }
        bodies.hits.clear::<I>(&rays.valid);
        bodies.is_empty = false;
        for leaf in 0..self.bodies.len() {
            bodies.visit::<I>(leaf, 1, 0.0);
        }
        false
    }
}

/// Visitor of the bodies that the rays of a tile may hit.
struct Bodies<'a> {
    scene: &'a PosedScene,
    rays: &'a TileRays,
    body_rays: &'a mut BodyRays,
    hits: &'a mut PacketHits,
    table: &'a mut Table,
    stack: &'a mut Vec<Waiting>,
    traversals: Traversals,
    /// Number of leaves visited.
    num_leaves: usize,
    /// True if no body was visited.
    is_empty: bool,
}

impl Visit for Bodies<'_> {
    #[cfg_attr(optimised, inline(always))]
    fn expects<I: Isa>(&self, _: usize, _: &Node, _: usize) -> bool {
        true
    }

    #[cfg_attr(optimised, inline(always))] // part of a kernel
    fn visit<I: Isa>(&mut self, leaf: usize, _count: usize, _near: f32) -> f32 {
        if self.is_empty {
            self.hits.clear::<I>(&self.rays.valid);
            self.is_empty = false;
        }
        let body = self.scene.bodies[leaf];
        let surface = self.scene.surface(body);
        let view = &self.scene.views[body as usize];
        self.body_rays.aim::<I>(self.rays, view, surface.middle());
        let exact = ExactRays {
            scene: self.scene,
            rays: self.rays,
        };
        let traversal = (self.traversals, NEAREST as f32);
        let memory = (&mut *self.table, &mut *self.stack, &mut self.num_leaves);
        surface.search::<I, _>(body, self.body_rays, traversal, self.hits, &exact, memory);
        self.hits.farthest()
    }
}

/// Exact tests for the rays of a tile.
struct ExactRays<'a> {
    scene: &'a PosedScene,
    rays: &'a TileRays,
}

impl Exact for ExactRays<'_> {
    fn distance(&self, ray: usize, body: u32, triangle: u32) -> Option<(f64, bool)> {
        let crossing = self.scene.cross(self.rays.direction(ray), body, triangle)?;
        Some((crossing.distance, crossing.is_edge_on))
    }
}

/// Visitor that tests whether rays may meet any box of a tree.
pub(crate) struct Touch(pub bool);

impl Visit for Touch {
    #[cfg_attr(optimised, inline(always))]
    fn expects<I: Isa>(&self, _: usize, _: &Node, _: usize) -> bool {
        true
    }

    #[cfg_attr(optimised, inline(always))] // part of a kernel
    fn visit<I: Isa>(&mut self, _leaf: usize, _count: usize, _near: f32) -> f32 {
        self.0 = true;
        -1.0
    }
}

#[cfg(test)]
mod tests;
