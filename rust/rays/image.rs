//! Images of a posed scene: selection of the tiles to cast, and hits of their rays.

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Result, fits_memory};
use crate::geometry::aabb::Bounds;
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::rays::camera::{ImagePlane, TILE, Tile};
use crate::rays::hits::{Cast, Counts, Hits, Traversals};
use crate::rays::packet::{BodyRays, Exact, MOST_RAYS, PACKET, PACKETS, PacketHits, TileRays};
use crate::rays::scene::{NEAREST, NO_BODY, PosedScene, bounds};
use crate::rays::smooth_hits::Shade;
use crate::rays::traversal::Visit;
use crate::rays::tree::{Node, Tree};
use crate::rays::triangle_block::Table;

/// Number of leaves that a traversal for 8 x 8 rays visits, above which four traversals for 4 x 4 rays are faster: each
/// visits fewer. It is 15 for rooms, and 25 for spheres, whose coarse images lose less
/// (`cargo bench --bench trace -- traversals`).
const MANY_LEAVES: usize = 24;

impl PosedScene {
    /// Hits of all pixels, tile by tile in parallel; bit for bit those of [`Self::cast`], ray by ray.
    pub fn cast_image(&self, plane: &ImagePlane) -> Result<Hits> {
        self.cast_image_at(plane, Level::best())
    }

    /// [`Self::cast_image`] with a given instruction set.
    pub fn cast_image_at(&self, plane: &ImagePlane, level: Level) -> Result<Hits> {
        self.cast_image_with(
            plane,
            &Cast {
                level,
                ..Cast::default()
            },
        )
    }

    /// [`Self::cast_image`] with options.
    pub fn cast_image_with(&self, plane: &ImagePlane, cast: &Cast) -> Result<Hits> {
        plane.check()?;
        fits_memory(
            "hits",
            &[plane.rows, plane.columns],
            size_of::<f64>() + 2 * size_of::<u32>(),
        )?;
        let num_pixels = plane.num_pixels();
        let mut hits = Hits {
            plane: *plane,
            distance: vec![0.0; num_pixels],
            body: vec![0; num_pixels],
            triangle: vec![0; num_pixels],
            cosine: cast.with_cosines.then(|| vec![0.0; num_pixels]),
            counts: Counts::default(),
        };
        let previous = cast.previous.and_then(|(scene, before)| {
            let has_all = before.cosine.is_some() || !cast.with_cosines;
            let is_alike = before.plane == *plane && has_all;
            let moved = if is_alike { self.moved(scene) } else { None };
            moved.map(|moved| (before, moved))
        });
        let band = TILE * plane.columns;
        let distance = hits.distance.par_chunks_mut(band);
        let body = hits.body.par_chunks_mut(band);
        let triangle = hits.triangle.par_chunks_mut(band);
        let mut cosine: Vec<Option<&mut [f64]>> = match &mut hits.cosine {
            Some(cosine) => cosine.chunks_mut(band).map(Some).collect(),
            None => (0..plane.rows.div_ceil(TILE)).map(|_| None).collect(),
        };
        let counts = distance
            .zip_eq(body)
            .zip_eq(triangle)
            .zip_eq(cosine.par_iter_mut())
            .enumerate()
            .map(|(index, (((distance, body), triangle), cosine))| {
                cast.level.run(CastBand {
                    scene: self,
                    cast,
                    previous: previous.as_ref().map(|(hits, moved)| (*hits, moved)),
                    plane,
                    index,
                    distance,
                    body,
                    triangle,
                    cosine: cosine.as_deref_mut(),
                })
            });
        hits.counts = counts.reduce(Counts::default, Counts::plus);
        Ok(hits)
    }

    /// Tree over the boxes, before and now, of bodies whose surface or pose differs from another scene of the same
    /// bodies. None if all bodies differ.
    pub fn moved(&self, before: &Self) -> Option<Tree> {
        if self.surfaces.len() != before.surfaces.len() {
            return None;
        }
        let has_moved = |body: &usize| {
            let is_same = Arc::ptr_eq(&self.surfaces[*body], &before.surfaces[*body]);
            !is_same || self.poses[*body] != before.poses[*body]
        };
        let moved: Vec<usize> = (0..self.surfaces.len()).filter(has_moved).collect();
        if moved.len() == self.surfaces.len() {
            return None;
        }
        let of = |scene: &Self, body: usize| bounds(&scene.surfaces[body], &scene.poses[body]);
        let both = moved.iter().flat_map(|body| [of(self, *body), of(before, *body)]);
        let boxes: Vec<Bounds> = both.filter(|b| b.min.is_finite()).collect();
        Some(Tree::build(boxes.len(), 1, |i| boxes[i]).0)
    }
}

/// Kernel that casts the rays of a row of tiles.
struct CastBand<'a> {
    scene: &'a PosedScene,
    cast: &'a Cast<'a>,
    /// Hits of another time, and boxes where bodies have moved.
    previous: Option<(&'a Hits, &'a Tree)>,
    plane: &'a ImagePlane,
    /// Number of the row of tiles.
    index: usize,
    distance: &'a mut [f64],
    body: &'a mut [u32],
    triangle: &'a mut [u32],
    cosine: Option<&'a mut [f64]>,
}

impl Kernel for CastBand<'_> {
    type Output = Counts;

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(mut self) -> Counts {
        let tiles = self.plane.columns.div_ceil(TILE);
        let mut scratch = Scratch::new(self.scene.num_bodies());
        let mut counts = Counts::default();
        for index in 0..tiles {
            let tile = self.plane.tile(self.index * tiles + index);
            scratch.rays.aim::<I>(self.plane, &tile);
            if self.cast.is_outside(&scratch.rays) {
                self.clear(&tile);
                counts.tiles_skipped += 1;
                continue;
            }
            if let Some((hits, moved)) = self.previous {
                let mut touch = Touch(false);
                scratch.rays.traverse::<I>(moved, &mut scratch.stacks[0], &mut touch);
                if !touch.0 {
                    self.take_over(&tile, hits);
                    counts.tiles_reused += 1;
                    continue;
                }
            }
            let is_empty = self.scene.search::<I>(&mut scratch, self.cast);
            if is_empty {
                self.clear(&tile);
                counts.tiles_skipped += 1;
                continue;
            }
            counts.rays += tile.rows * tile.columns;
            self.scene
                .measure::<I>(&scratch.rays, &scratch.best, &mut scratch.distance);
            if self.cosine.is_some() {
                let (best, distance) = (&scratch.best, &scratch.distance);
                scratch
                    .shade
                    .fill::<I, false>(self.scene, &scratch.rays, &best.body, &best.triangle, distance);
            }
            self.write(&tile, &scratch);
        }
        counts
    }
}

impl CastBand<'_> {
    /// Pixel ranges of the rows of a tile, counted in this row of tiles.
    fn rows(&self, tile: &Tile) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        let (columns, first, number) = (self.plane.columns, tile.column, tile.columns);
        (0..tile.rows).map(move |row| row * columns + first..row * columns + first + number)
    }

    /// Write a tile without hits.
    fn clear(&mut self, tile: &Tile) {
        for pixels in self.rows(tile) {
            self.distance[pixels.clone()].fill(f64::INFINITY);
            self.body[pixels.clone()].fill(NO_BODY);
            self.triangle[pixels.clone()].fill(u32::MAX);
            if let Some(cosine) = &mut self.cosine {
                cosine[pixels].fill(0.0);
            }
        }
    }

    /// Copy the hits of a tile from another time.
    fn take_over(&mut self, tile: &Tile, hits: &Hits) {
        let first = self.index * TILE * self.plane.columns;
        for pixels in self.rows(tile) {
            let from = first + pixels.start..first + pixels.end;
            self.distance[pixels.clone()].copy_from_slice(&hits.distance[from.clone()]);
            self.body[pixels.clone()].copy_from_slice(&hits.body[from.clone()]);
            self.triangle[pixels.clone()].copy_from_slice(&hits.triangle[from.clone()]);
            if let (Some(cosine), Some(before)) = (&mut self.cosine, &hits.cosine) {
                cosine[pixels].copy_from_slice(&before[from]);
            }
        }
    }

    /// Write the hits of a tile.
    #[inline(always)]
    fn write(&mut self, tile: &Tile, scratch: &Scratch) {
        let best = &scratch.best;
        for row in 0..tile.rows {
            let pixel = row * self.plane.columns + tile.column;
            // A row of a tile is in two packets.
            for first in (0..tile.columns).step_by(TILE / 2) {
                let (from, to) = (TileRays::ray(row, first), pixel + first);
                let number = (tile.columns - first).min(TILE / 2);
                copy(&mut self.distance[to..], &scratch.distance[from..], number);
                copy(&mut self.body[to..], &best.body.as_flattened()[from..], number);
                copy(&mut self.triangle[to..], &best.triangle.as_flattened()[from..], number);
                if let Some(cosine) = &mut self.cosine {
                    copy(&mut cosine[to..], &scratch.shade.cosine[from..], number);
                }
            }
        }
    }
}

/// Visitor that tests whether rays may meet any box of a tree.
pub(super) struct Touch(pub bool);

impl Visit for Touch {
    #[inline(always)]
    fn expects<I: Isa>(&self, _: usize, _: &Node, _: usize) -> bool {
        true
    }

    #[inline(always)] // part of a kernel
    fn visit<I: Isa>(&mut self, _leaf: usize, _count: usize, _near: f32) -> f32 {
        self.0 = true;
        -1.0
    }
}

/// Copy the first `number` values; nearly always half a row of a tile, copied as one block.
#[inline(always)]
fn copy<T: Copy>(to: &mut [T], from: &[T], number: usize) {
    const ALL: usize = TILE / 2;
    if number == ALL
        && let (Some(to), Some(from)) = (to.first_chunk_mut::<ALL>(), from.first_chunk::<ALL>())
    {
        *to = *from;
    } else {
        to[..number].copy_from_slice(&from[..number]);
    }
}

/// Rays of a tile and their hits; memory kept from tile to tile.
pub(super) struct Scratch {
    pub rays: TileRays,
    body_rays: BodyRays,
    pub best: PacketHits,
    table: Table,
    pub stacks: [Vec<u64>; 2],
    /// Distances [m].
    pub distance: [f64; MOST_RAYS],
    pub shade: Shade,
    /// For every body, number of leaves that the last tiles visited: a running mean with weights halved from tile to
    /// tile.
    num_leaves: Vec<usize>,
}

impl Scratch {
    pub fn new(num_bodies: usize) -> Self {
        Self {
            rays: TileRays::EMPTY,
            body_rays: BodyRays::EMPTY,
            best: PacketHits::EMPTY,
            table: Table::EMPTY,
            stacks: [Vec::with_capacity(64), Vec::with_capacity(256)],
            distance: [0.0; MOST_RAYS],
            shade: Shade::NOTHING,
            num_leaves: vec![0; num_bodies],
        }
    }
}

impl PosedScene {
    /// Search for the nearest triangles of the rays of a tile. Returns true if no body is in the tile.
    #[inline(always)]
    pub(super) fn search<I: Isa>(&self, scratch: &mut Scratch, cast: &Cast) -> bool {
        let rays = &scratch.rays;
        let [top, stack] = &mut scratch.stacks;
        let mut bodies = Bodies {
            scene: self,
            rays,
            body_rays: &mut scratch.body_rays,
            best: &mut scratch.best,
            table: &mut scratch.table,
            stack,
            traversals: cast.traversals,
            num_leaves: &mut scratch.num_leaves,
            is_empty: true,
        };
        if cast.skip_empty {
            rays.traverse::<I>(&self.top, top, &mut bodies);
            return bodies.is_empty;
        }
        bodies.best.clear::<I>(&rays.valid);
        bodies.is_empty = false;
        for leaf in 0..self.bodies.len() {
            bodies.visit::<I>(leaf, 1, 0.0);
        }
        false
    }

    /// Measure the distances of the triangles that were found [m]; infinite where there is none.
    #[inline(always)]
    pub(super) fn measure<I: Isa>(&self, rays: &TileRays, best: &PacketHits, distance: &mut [f64; MOST_RAYS]) {
        let splat = <I::F64 as Vector>::splat;
        let lanes = I::F64::LANES;
        let mut height = [f64::INFINITY; MOST_RAYS];
        let mut slope = [1.0; MOST_RAYS];
        let mut rest = rays.valid;
        for packet in 0..PACKETS {
            rest[packet] &= !I::equal(&best.body[packet], NO_BODY);
        }
        for packet in 0..PACKETS {
            while rest[packet] != 0 {
                // All rays that meet one triangle, with the operations of `WatertightTest::intersect`.
                let lane = rest[packet].trailing_zeros() as usize;
                let (body, triangle) = (best.body[packet][lane], best.triangle[packet][lane]);
                let view = &self.views[body as usize];
                let [a, b, c] = self.surface(body).corners(triangle);
                let (a, b, c) = (a - view.origin, b - view.origin, c - view.origin);
                let normal = (b - a).cross(c - a);
                let above = splat(normal.dot(a));
                let (x, y, z) = (splat(normal.x), splat(normal.y), splat(normal.z));
                for other in packet..PACKETS {
                    let same =
                        rest[other] & I::equal(&best.triangle[other], triangle) & I::equal(&best.body[other], body);
                    rest[other] &= !same;
                    for half in 0..PACKET / lanes {
                        let bits = same >> (half * lanes) & 0xff;
                        if bits == 0 {
                            continue;
                        }
                        let first = other * PACKET + half * lanes;
                        let direction = view.direction(I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
                        let [dx, dy, dz] = direction;
                        let along = x.mul(dx).add(y.mul(dy)).add(z.mul(dz));
                        along
                            .select(bits, I::F64::load(&slope[first..]))
                            .store(&mut slope[first..]);
                        above
                            .select(bits, I::F64::load(&height[first..]))
                            .store(&mut height[first..]);
                    }
                }
            }
        }
        for first in (0..MOST_RAYS).step_by(lanes) {
            let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
            let length = splat(1.0).add(u.mul(u)).add(v.mul(v)).sqrt();
            let t = I::F64::load(&height[first..]).div(I::F64::load(&slope[first..]));
            t.mul(length).store(&mut distance[first..]);
        }
        for packet in 0..PACKETS {
            let mut edge_on = best.edge_on[packet];
            while edge_on != 0 {
                let lane = edge_on.trailing_zeros() as usize;
                edge_on &= edge_on - 1;
                let direction = rays.direction(packet * PACKET + lane);
                let crossing = self.cross(direction, best.body[packet][lane], best.triangle[packet][lane]);
                let t = crossing.map_or(f64::INFINITY, |crossing| crossing.distance);
                distance[packet * PACKET + lane] = t * direction.length();
            }
        }
    }
}

/// Visitor of the bodies that the rays of a tile may hit.
struct Bodies<'a> {
    scene: &'a PosedScene,
    rays: &'a TileRays,
    body_rays: &'a mut BodyRays,
    best: &'a mut PacketHits,
    table: &'a mut Table,
    stack: &'a mut Vec<u64>,
    traversals: Traversals,
    num_leaves: &'a mut [usize],
    /// True if no body was visited.
    is_empty: bool,
}

impl Visit for Bodies<'_> {
    #[inline(always)]
    fn expects<I: Isa>(&self, _: usize, _: &Node, _: usize) -> bool {
        true
    }

    #[inline(always)] // part of a kernel
    fn visit<I: Isa>(&mut self, leaf: usize, _count: usize, _near: f32) -> f32 {
        if self.is_empty {
            self.best.clear::<I>(&self.rays.valid);
            self.is_empty = false;
        }
        let body = self.scene.bodies[leaf];
        let surface = self.scene.surface(body);
        let view = &self.scene.views[body as usize];
        self.body_rays
            .aim::<I>(self.rays, view, surface.middle(), surface.is_fine());
        let exact = ExactRays {
            scene: self.scene,
            rays: self.rays,
        };
        let (body_rays, best, start) = (&*self.body_rays, &mut *self.best, NEAREST as f32);
        let mean = &mut self.num_leaves[body as usize];
        let goes_apart = match self.traversals {
            Traversals::Chosen => *mean > MANY_LEAVES,
            Traversals::Together => false,
            Traversals::Apart => true,
        };
        let mut num_leaves = 0;
        if goes_apart {
            for packet in 0..PACKETS {
                let scratch = (&mut *self.table, &mut *self.stack);
                num_leaves += surface.search::<I, _, 1>(body, (body_rays, packet), start, best, &exact, scratch);
            }
            // Where both choices are equally fast, four traversals visit a leaf 1.5 times.
            num_leaves = num_leaves * 2 / 3;
        } else {
            let scratch = (&mut *self.table, &mut *self.stack);
            num_leaves = surface.search::<I, _, PACKETS>(body, (body_rays, 0), start, best, &exact, scratch);
        }
        *mean = usize::midpoint(*mean, num_leaves);
        self.best.farthest()
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

#[cfg(test)]
mod tests;
