//! Tiles: 8 x 8 rays, their material points quarter by quarter, and what a refinement decides by.

use std::ops::Range;
use std::sync::Arc;

use super::border::Border;
use super::cells::TileCells;
use super::context::Context;
use super::residual::{BLOCKS, Blocks, CellFeatures};
use super::tile_index::TileIndex;
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::rays::camera::{ImagePlane, PixelTile as Pixels};
use crate::rays::packet::{MOST_RAYS, PACKETS};
use crate::rays::search::Scratch;
use crate::rays::tile_hits::HALF;
use crate::rays::tree::Tree;
use crate::scattering::refinement::Sampling;
use crate::scattering::tile_point::{NearestHit, TilePoints};

/// Bits of all packets of a tile.
pub(super) const ALL: u8 = (1 << PACKETS) - 1;

/// Evaluated tile. It depends on the surfaces that its rays meet alone, not on the refinement.
#[derive(Debug)]
pub(super) struct SampledTile {
    pub(super) place: TileIndex,
    /// A bit per packet of rays that is wanted.
    pub(super) packets: u8,
    /// Number of rays cast.
    pub(super) rays: usize,
    /// Criteria of refinement.
    pub(super) blocks: Blocks,
    border: Border,
    /// Points of all quarters, if there are any, and the end of every quarter.
    pub(super) points: Option<Arc<TilePoints>>,
    ends: [usize; 4],
    /// Cells of every quarter that hit a body, and of those the ones without a point.
    pub(super) hits: [usize; 4],
    pub(super) silent: [usize; 4],
    pub(super) nearest: Vec<NearestHit>,
    /// Scattering length of all cells together [m^2], of tiles of the base level; see [`TileCells::scattering_length`].
    pub(super) scattering_length: f64,
}

/// Memory of a thread, kept from tile to tile.
pub(super) struct Worker {
    scratch: Scratch,
    cells: TileCells,
    points: TilePoints,
}

impl Worker {
    /// On the heap, as parallel iterators hold one per level of their recursion.
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            scratch: Scratch::new(),
            cells: TileCells::EMPTY,
            points: TilePoints::default(),
        })
    }
}

impl Context<'_> {
    /// Cast and evaluate some packets of a tile, a bit each.
    pub(super) fn tile(&self, worker: &mut Worker, place: TileIndex, packets: u8) -> SampledTile {
        self.sector.cast.level.run(EvaluateTile {
            context: self,
            worker,
            place,
            packets,
        })
    }

    /// True if no ray of a tile may meet a box of a tree.
    pub(super) fn is_static(&self, worker: &mut Worker, place: TileIndex, moved: &Tree) -> bool {
        self.sector.cast.level.run(Meets {
            context: self,
            worker,
            place,
            moved,
        })
    }

    /// Two-way field gain in the middle of a tile, relative to the peaks.
    fn gain(&self, plane: &ImagePlane, pixels: &Pixels) -> f64 {
        let u = (plane.axis_column - (pixels.column as f64 + 0.5 * pixels.columns as f64)) * plane.du;
        let v = (plane.axis_row - (pixels.row as f64 + 0.5 * pixels.rows as f64)) * plane.dv;
        self.sector.array.relative_gain(u, v)
    }
}

/// Kernel that evaluates a tile.
struct EvaluateTile<'a> {
    context: &'a Context<'a>,
    worker: &'a mut Worker,
    place: TileIndex,
    packets: u8,
}

impl Kernel for EvaluateTile<'_> {
    type Output = SampledTile;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> SampledTile {
        let Self {
            context,
            worker: Worker { scratch, cells, points },
            place,
            packets,
        } = self;
        let (sector, plane) = (context.sector, &context.planes[place.level]);
        let Some(pixels) = place.pixels(plane) else {
            return SampledTile::unseen(place, packets);
        };
        scratch.rays.generate::<I>(plane, &pixels);
        if packets != ALL {
            scratch.rays.mask(u32::from(packets));
        }
        if sector.cast.is_outside(&scratch.rays) {
            return SampledTile::unseen(place, packets);
        }
        let (rows, columns) = (pixels.rows, pixels.columns);
        if let Some(image) = sector.image {
            cells.read(&scratch.rays, image, &pixels);
            scratch.measured.distance = cells.distance;
        } else if sector.scene.search::<I>(scratch, &sector.cast) {
            return SampledTile::without_hits(place, packets, Border::empty(&scratch.rays, rows, columns), 0);
        } else {
            scratch.measure::<I>(sector.scene);
            cells.take(scratch);
        }

        let gain = context.gain(plane, &pixels);
        let tables = (sector.reflections, &*context.turns);
        cells.evaluate::<I>(plane, context.wavenumber, gain, tables);
        let rays = cells.valid.count_ones() as usize;
        if cells.hit == 0 {
            return SampledTile::without_hits(place, packets, Border::empty(&scratch.rays, rows, columns), rays);
        }
        let mut tile = SampledTile::without_hits(place, packets, Border::OUTSIDE, rays);
        find_nearest::<I>(
            cells,
            &scratch.measured.distance,
            (place.sector, plane),
            &mut tile.nearest,
        );
        let untapered = cells.weight;
        if sector.sampling == Sampling::Footprint {
            cells.weigh::<I>();
        }
        if context.has_diffuse_cells {
            context.add_diffuse(cells, &untapered);
        }
        for quarter in 0..PACKETS {
            tile.hits[quarter] = cells.hits(quarter).count_ones() as usize;
        }
        if sector.refinement.is_some() {
            if place.level == 0 {
                tile.scattering_length = cells.scattering_length();
            }
            context.contours.number_surfaces(cells, sector);
            let features = CellFeatures::new::<I>(cells);
            tile.border = Border::new(&features, cells, rows, columns);
            tile.blocks = Blocks::new::<I>(&features);
        }
        points.clear();
        for quarter in 0..PACKETS {
            let hit = cells.hits(quarter);
            if hit != 0 {
                points.add_quarter::<I>(context, cells, quarter, plane);
                tile.silent[quarter] = (hit & !cells.with_weight::<I>(quarter)).count_ones() as usize;
            }
            tile.ends[quarter] = points.points.len();
        }
        tile.points = (!points.points.is_empty()).then(|| Arc::new(points.copy()));
        tile
    }
}

/// Kernel of [`Context::is_static`].
struct Meets<'a> {
    context: &'a Context<'a>,
    worker: &'a mut Worker,
    place: TileIndex,
    moved: &'a Tree,
}

impl Kernel for Meets<'_> {
    type Output = bool;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> bool {
        let plane = &self.context.planes[self.place.level];
        let Some(pixels) = self.place.pixels(plane) else {
            return true;
        };
        let scratch = &mut self.worker.scratch;
        scratch.rays.generate::<I>(plane, &pixels);
        !scratch.overlaps::<I>(self.moved)
    }
}

impl SampledTile {
    /// Tile without rays.
    pub(super) fn unseen(place: TileIndex, packets: u8) -> Self {
        Self::without_hits(place, packets, Border::OUTSIDE, 0)
    }

    fn without_hits(place: TileIndex, packets: u8, border: Border, rays: usize) -> Self {
        Self {
            place,
            packets,
            rays,
            blocks: Blocks::EMPTY,
            border,
            points: None,
            ends: [0; 4],
            hits: [0; 4],
            silent: [0; 4],
            nearest: Vec::new(),
            scattering_length: 0.0,
        }
    }

    /// Points of a quarter.
    pub(super) fn quarter(&self, number: usize) -> Range<usize> {
        number.checked_sub(1).map_or(0, |before| self.ends[before])..self.ends[number]
    }

    /// Residual field of every block, with the cells of adjacent tiles of the same level.
    pub(super) fn residual_with<'a>(
        &self,
        level: Level,
        wavenumber: f64,
        adjacent: impl Fn(TileIndex) -> Option<&'a Self>,
    ) -> [f32; BLOCKS] {
        let beside = |axis, side| {
            let other = self.place.beside(axis, side).and_then(&adjacent);
            other.filter(|other| !(self.nearest.is_empty() && other.nearest.is_empty()))
        };
        let beyond = [beside(0, 1), beside(0, 0), beside(1, 1), beside(1, 0)];
        let beyond = beyond.map(|tile| tile.map(|tile| &tile.border));
        let mut residual = self.blocks.residual;
        self.border.raise(level, beyond, wavenumber, &mut residual);
        residual
    }
}

/// Add the nearest hits of the bodies of a tile, from distances to triangles [m].
#[cfg_attr(optimised, inline(always))] // part of a kernel
fn find_nearest<I: Isa>(
    cells: &TileCells,
    distances: &[f64; MOST_RAYS],
    (sector, plane): (usize, &ImagePlane),
    found: &mut Vec<NearestHit>,
) {
    let far = <I::F64 as Vector>::splat(f64::INFINITY);
    let mut rest = cells.hit;
    while rest != 0 {
        let body = cells.body[rest.trailing_zeros() as usize];
        let mut mine = cells.hits_of::<I>(body);
        let mut nearest = far;
        for first in (0..MOST_RAYS).step_by(HALF) {
            let here = (mine >> first) as u32 & 0xff;
            nearest = nearest.min(I::F64::load(&distances[first..]).select(here, far));
        }
        rest &= !mine;
        let zero = <I::F64 as Vector>::splat(0.0);
        let nearest = -zero.sub(nearest).largest();
        // The first of equal ones.
        let mut at = mine.trailing_zeros() as usize;
        while mine != 0 && distances[at] > nearest {
            mine &= mine - 1;
            at = mine.trailing_zeros() as usize % MOST_RAYS;
        }
        found.push(NearestHit {
            body,
            triangle: cells.triangle[at],
            distance: distances[at],
            cell: cells.cell(at, plane),
            sector,
        });
    }
}
