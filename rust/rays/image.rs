//! Images of a posed scene: selection of the tiles to cast, and hits of their rays.
//!
//! A tile of 8 x 8 pixels is cast by these steps, on one `Scratch` per thread that is used for tile after tile:
//!
//! 1. [`TileRays::generate`] sets the rays, four packets of 4 x 4; `mask` drops packets that are not wanted.
//! 2. [`PosedScene::search`] finds the nearest triangles (`scratch.hits`), or says that no body is in the tile.
//! 3. `Scratch::measure` computes their distances in double precision, and distance, cosine and normal of the curved
//!    surface if they are wanted (`scratch.measured`).

use std::sync::Arc;

use rayon::prelude::*;

use crate::cancel::Cancel;
use crate::error::{Result, fits_memory};
use crate::geometry::aabb::Bounds;
use crate::numeric::simd::{Isa, Kernel};
use crate::rays::camera::{ImagePlane, PixelTile, TILE};
use crate::rays::hits::{Cast, Hits};
use crate::rays::packet::TileRays;
use crate::rays::scene::{NO_BODY, PosedScene, bounds};
use crate::rays::search::Scratch;
use crate::rays::tree::Tree;

impl PosedScene {
    /// Hits of all pixels, tile by tile in parallel; bit for bit equal to [`Self::cast`], ray by ray.
    pub fn cast_image(&self, plane: &ImagePlane, cast: &Cast) -> Result<Hits> {
        plane.check()?;
        fits_memory("hits", &[plane.rows, plane.columns], PIXEL_SIZE)?;
        let num_pixels = plane.num_pixels();
        let mut hits = Hits {
            plane: *plane,
            distance: vec![0.0; num_pixels],
            cosine: vec![0.0; num_pixels],
            body: vec![0; num_pixels],
            triangle: vec![0; num_pixels],
            surface_distance: vec![0.0; num_pixels],
            normal: vec![[0.0; 3]; num_pixels],
        };
        let band = TILE * plane.columns;
        let bands = hits
            .distance
            .par_chunks_mut(band)
            .zip_eq(hits.cosine.par_chunks_mut(band))
            .zip_eq(hits.body.par_chunks_mut(band))
            .zip_eq(hits.triangle.par_chunks_mut(band))
            .zip_eq(hits.surface_distance.par_chunks_mut(band))
            .zip_eq(hits.normal.par_chunks_mut(band))
            .enumerate()
            .map(|(index, pixels)| {
                let (((((distance, cosine), body), triangle), surface_distance), normal) = pixels;
                cast.cancel.map_or(Ok(()), Cancel::check)?;
                cast.level.run(CastBand {
                    scene: self,
                    cast,
                    plane,
                    index,
                    distance,
                    cosine,
                    body,
                    triangle,
                    surface_distance,
                    normal,
                });
                Ok(())
            });
        bands.collect::<Result<()>>()?;
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

/// Memory of a pixel of [`Hits`] [bytes].
const PIXEL_SIZE: usize = size_of::<([f64; 3], [f64; 3], [u32; 2])>();

/// Kernel that casts the rays of a row of tiles.
struct CastBand<'a> {
    scene: &'a PosedScene,
    cast: &'a Cast<'a>,
    plane: &'a ImagePlane,
    /// Number of the row of tiles.
    index: usize,
    distance: &'a mut [f64],
    cosine: &'a mut [f64],
    body: &'a mut [u32],
    triangle: &'a mut [u32],
    surface_distance: &'a mut [f64],
    normal: &'a mut [[f64; 3]],
}

impl Kernel for CastBand<'_> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let tiles = self.plane.columns.div_ceil(TILE);
        let mut scratch = Scratch::new();
        for index in 0..tiles {
            let tile = self.plane.tile(self.index * tiles + index);
            scratch.rays.generate::<I>(self.plane, &tile);
            if self.cast.is_outside(&scratch.rays) || self.scene.search::<I>(&mut scratch, self.cast) {
                self.clear(&tile);
            } else {
                scratch.measure::<I>(self.scene);
                self.write(&tile, &scratch);
            }
        }
    }
}

impl CastBand<'_> {
    /// Write a tile without hits.
    fn clear(&mut self, tile: &PixelTile) {
        for row in 0..tile.rows {
            let first = row * self.plane.columns + tile.column;
            let pixels = first..first + tile.columns;
            self.distance[pixels.clone()].fill(f64::INFINITY);
            self.cosine[pixels.clone()].fill(0.0);
            self.body[pixels.clone()].fill(NO_BODY);
            self.triangle[pixels.clone()].fill(u32::MAX);
            self.surface_distance[pixels.clone()].fill(f64::INFINITY);
            self.normal[pixels].fill([0.0; 3]);
        }
    }

    /// Write the hits of a tile.
    #[cfg_attr(optimised, inline(always))]
    fn write(&mut self, tile: &PixelTile, scratch: &Scratch) {
        let (hits, measured) = (&scratch.hits, &scratch.measured);
        for row in 0..tile.rows {
            let pixel = row * self.plane.columns + tile.column;
            // A row of a tile is in two packets.
            for first in (0..tile.columns).step_by(TILE / 2) {
                let (from, to) = (TileRays::ray(row, first), pixel + first);
                let number = (tile.columns - first).min(TILE / 2);
                copy(&mut self.distance[to..], &measured.distance[from..], number);
                copy(&mut self.cosine[to..], &measured.cosine[from..], number);
                copy(&mut self.body[to..], &hits.body.as_flattened()[from..], number);
                copy(&mut self.triangle[to..], &hits.triangle.as_flattened()[from..], number);
                copy(
                    &mut self.surface_distance[to..],
                    &measured.surface_distance[from..],
                    number,
                );
                for i in 0..number {
                    self.normal[to + i] = measured.normal_of(from + i).to_array();
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
