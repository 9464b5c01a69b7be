//! Images of a posed scene: selection of the tiles to cast, and hits of their rays.
//!
//! A tile of 8 x 8 pixels is cast by these steps, on one `Scratch` per thread that is used for tile after tile:
//!
//! 1. [`TileRays::aim`] sets the rays, four packets of 4 x 4; `keep` drops packets that are not wanted.
//! 2. [`PosedScene::search`] finds the nearest triangles (`scratch.hits`), or says that no body is in the tile.
//! 3. [`PosedScene::measure`] computes their distances in double precision (`scratch.distance`).
//! 4. `Shade::fill` adds distance, cosine and normal of the curved surface (`scratch.shade`).

use std::sync::Arc;

use rayon::prelude::*;

use crate::cancel::Cancel;
use crate::error::{Result, fits_memory};
use crate::geometry::aabb::Bounds;
use crate::numeric::simd::{Isa, Kernel, Level};
use crate::rays::camera::{ImagePlane, TILE, Tile};
use crate::rays::hits::{Cast, Counts, Hits};
use crate::rays::packet::TileRays;
use crate::rays::scene::{NO_BODY, PosedScene, bounds};
use crate::rays::search::{Scratch, Touch};
use crate::rays::tree::Tree;

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
                cast.cancel.map_or(Ok(()), Cancel::check)?;
                Ok(cast.level.run(CastBand {
                    scene: self,
                    cast,
                    previous: previous.as_ref().map(|(hits, moved)| (*hits, moved)),
                    plane,
                    index,
                    distance,
                    body,
                    triangle,
                    cosine: cosine.as_deref_mut(),
                }))
            });
        hits.counts = counts.try_reduce(Counts::default, |a, b| Ok(a.plus(b)))?;
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

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(mut self) -> Counts {
        let tiles = self.plane.columns.div_ceil(TILE);
        let mut scratch = Scratch::new();
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
                scratch.rays.traverse::<I>(moved, &mut scratch.top, &mut touch);
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
                .measure::<I>(&scratch.rays, &scratch.hits, &mut scratch.distance);
            if self.cosine.is_some() {
                let (hits, distance) = (&scratch.hits, &scratch.distance);
                scratch
                    .shade
                    .fill::<I, false>(self.scene, &scratch.rays, &hits.body, &hits.triangle, distance);
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
    #[cfg_attr(optimised, inline(always))]
    fn write(&mut self, tile: &Tile, scratch: &Scratch) {
        let hits = &scratch.hits;
        for row in 0..tile.rows {
            let pixel = row * self.plane.columns + tile.column;
            // A row of a tile is in two packets.
            for first in (0..tile.columns).step_by(TILE / 2) {
                let (from, to) = (TileRays::ray(row, first), pixel + first);
                let number = (tile.columns - first).min(TILE / 2);
                copy(&mut self.distance[to..], &scratch.distance[from..], number);
                copy(&mut self.body[to..], &hits.body.as_flattened()[from..], number);
                copy(&mut self.triangle[to..], &hits.triangle.as_flattened()[from..], number);
                if let Some(cosine) = &mut self.cosine {
                    copy(&mut cosine[to..], &scratch.shade.cosine[from..], number);
                }
            }
        }
    }
}

/// Copy the first `number` values; nearly always half a row of a tile, copied as one block.
#[cfg_attr(optimised, inline(always))]
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

#[cfg(test)]
mod tests;
