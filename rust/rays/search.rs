//! Search of a scene for the nearest triangles of the rays of a tile, body by body.

use crate::numeric::simd::Isa;
use crate::rays::hits::Cast;
use crate::rays::packet::{BodyRays, MOST_RAYS, PACKETS, TileRays};
use crate::rays::packet_hits::PacketHits;
use crate::rays::packet_search::PacketSearch;
use crate::rays::scene::PosedScene;
use crate::rays::tile_hits::TileHits;
use crate::rays::traversal::{Search, Slabs, StackEntry, traverse};
use crate::rays::tree::{Node, Tree, WIDTH};
use crate::rays::triangle_block::Planes;

/// Rays of a tile and their hits; memory kept from tile to tile.
pub(crate) struct Scratch {
    /// Rays of the tile.
    pub rays: TileRays,
    body_rays: BodyRays,
    /// Distances at which the search ends, in lengths of the directions.
    pub limit: [f32; MOST_RAYS],
    /// Nearest triangles, from [`PosedScene::search`].
    pub hits: PacketHits,
    planes: Planes,
    stacks: [Vec<StackEntry>; 2],
    /// Measured hits, from [`Self::measure`].
    pub measured: TileHits,
}

impl Scratch {
    /// Memory without rays.
    pub fn new() -> Self {
        Self {
            rays: TileRays::EMPTY,
            body_rays: BodyRays::EMPTY,
            limit: [f32::INFINITY; MOST_RAYS],
            hits: PacketHits::EMPTY,
            planes: Planes::EMPTY,
            stacks: [64, 256].map(Vec::with_capacity),
            measured: TileHits::NOTHING,
        }
    }

    /// Measure the hits of the tile; see [`TileHits::measure`].
    #[cfg_attr(optimised, inline(always))]
    pub fn measure<I: Isa>(&mut self, scene: &PosedScene) {
        self.measured.measure::<I>(scene, &self.rays, &self.hits);
    }

    /// True if the rays of the tile may meet any box of a tree in the sensor frame.
    #[cfg_attr(optimised, inline(always))]
    pub fn overlaps<I: Isa>(&mut self, boxes: &Tree) -> bool {
        let mut overlap = Overlap {
            slabs: self.rays.slabs(),
            is_met: false,
        };
        traverse::<I, 1>(boxes, 1, &mut self.stacks[0], &mut overlap);
        overlap.is_met
    }
}

impl PosedScene {
    /// Search for the nearest triangles of the rays of a tile. Returns true if no body is in the tile.
    #[cfg_attr(optimised, inline(always))]
    pub(crate) fn search<I: Isa>(&self, scratch: &mut Scratch, cast: &Cast) -> bool {
        let rays = &scratch.rays;
        scratch.hits.clear::<I>(&rays.valid, &scratch.limit);
        if rays.packets() == 0 {
            return true;
        }
        let [top, stack] = &mut scratch.stacks;
        let mut bodies = Bodies {
            scene: self,
            slabs: rays.slabs(),
            rays,
            body_rays: &mut scratch.body_rays,
            hits: &mut scratch.hits,
            planes: &mut scratch.planes,
            stack,
            is_empty: true,
        };
        if cast.skip_empty {
            traverse::<I, 1>(&self.top, 1, top, &mut bodies);
            return bodies.is_empty;
        }
        for leaf in 0..self.bodies.len() {
            bodies.visit::<I>(1, leaf, 1, 0.0);
        }
        false
    }
}

/// Search of the bodies that the rays of a tile may hit.
struct Bodies<'a> {
    scene: &'a PosedScene,
    slabs: Slabs,
    rays: &'a TileRays,
    body_rays: &'a mut BodyRays,
    hits: &'a mut PacketHits,
    planes: &'a mut Planes,
    stack: &'a mut Vec<StackEntry>,
    /// True if no body was visited.
    is_empty: bool,
}

impl Search<1> for Bodies<'_> {
    #[cfg_attr(optimised, inline(always))]
    fn far(&self) -> f32 {
        self.hits.farthest()
    }

    #[cfg_attr(optimised, inline(always))]
    fn enter<I: Isa>(&self, _: usize, node: &Node, near: &mut [f32; WIDTH]) -> u32 {
        self.slabs.enter::<I>(node, self.far(), near)
    }

    #[cfg_attr(optimised, inline(always))]
    fn visit<I: Isa>(&mut self, _: u32, leaf: usize, _: usize, _: f32) {
        self.is_empty = false;
        let (scene, rays) = (self.scene, self.rays);
        let body = scene.bodies[leaf];
        let surface = scene.surface(body);
        let view = &scene.sensor_poses[body as usize];
        self.body_rays.transform::<I>(rays, view, surface.anchor);
        let mut search = PacketSearch {
            rays: self.body_rays,
            blocks: &surface.blocks,
            max_coordinate: surface.max_coordinate,
            body,
            hits: self.hits,
            exact: &|ray: usize, body: u32, triangle: u32| scene.cross(rays.direction(ray), body, triangle),
            planes: self.planes,
        };
        traverse::<I, PACKETS>(&surface.tree, rays.packets(), self.stack, &mut search);
    }
}

/// Search for any box of a tree that directions may meet.
struct Overlap {
    slabs: Slabs,
    is_met: bool,
}

impl Search<1> for Overlap {
    #[cfg_attr(optimised, inline(always))]
    fn far(&self) -> f32 {
        if self.is_met { -1.0 } else { f32::MAX }
    }

    #[cfg_attr(optimised, inline(always))]
    fn enter<I: Isa>(&self, _: usize, node: &Node, near: &mut [f32; WIDTH]) -> u32 {
        self.slabs.enter::<I>(node, f32::MAX, near)
    }

    #[cfg_attr(optimised, inline(always))]
    fn visit<I: Isa>(&mut self, _: u32, _: usize, _: usize, _: f32) {
        self.is_met = true;
    }
}
