//! Refinement: level by level, quarters of tiles are split where their residual error is large.

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use super::cells::TileCells;
use super::context::{Context, has_common_weight};
use super::contour::Contours;
use super::join::Join;
use super::level::TileLevel;
use super::residual::{BLOCKS, of_quarter};
use super::small_parts::SmallParts;
use super::tile::{ALL, SampledTile, Worker};
use super::tile_index::{TileIndex, base_tiles};
use crate::antennas::beam::Beam;
use crate::cancel::Cancel;
use crate::error::{Result, fits_memory};
use crate::geometry::pose::Pose;
use crate::paths::scatterers::PointKind;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Counts;
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS};
use crate::rays::tree::Tree;
use crate::scattering::material::Material;
use crate::scattering::refinement::{MAX_LEVEL, Refinement, SHARE, field_of};
use crate::scattering::sector::Sector;
use crate::scattering::tile_point::{NearestHit, TilePoint, TilePoints};

/// Factor by which the allowed residual error grows where the rays exceed the budget.
const STEP: f64 = 4.0;

/// Lowered floor relative to the cross-section of the tile of the base level with the strongest echo: of small bodies
/// alone in view, the residual error stays that far below their own echo.
const OF_STRONGEST: f64 = 0.1;

/// Least lowered floor, relative to the default one. Cells of the base level may be too large to show any echo.
const LEAST_FLOOR: f64 = 0.1;

/// Memory of a tile in which every cell is a point.
const MOST_BYTES: usize = size_of::<(SampledTile, TileCells)>() + MOST_RAYS * size_of::<(TilePoint, Complex64)>();

/// Refined tiles: material points of the specular part, and counts.
pub struct Tiles {
    /// Pieces with material points, base tile by base tile.
    pub pieces: Vec<PointRange>,
    /// Number of weights per point.
    pub num_weights: usize,
    /// True if a point has one weight for all channels.
    pub has_common_weight: bool,
    pub(super) levels: Vec<TileLevel>,
    /// Base plane and beam of every sector.
    sectors: Vec<(ImagePlane, Option<Beam>)>,
    turns: Vec<f32>,
    poses: Vec<Pose>,
    /// Flags of the flat regions of every body that have no cells.
    contours: Vec<Vec<bool>>,
    /// Cross-section that quarters were refined for [m^2]; none without refinement.
    pub rcs_floor: Option<f64>,
    /// Number of cells that would have been split, but for the finest level or the budget; none without refinement.
    pub num_coarse: Option<usize>,
    /// Number of cells that hit a body.
    pub num_hit: usize,
    /// Number of cells with a material point.
    pub num_lit: usize,
    /// Nearest hits of all bodies with a hit, the first of equal ones, by body.
    pub nearest: Vec<NearestHit>,
    /// Counts of rays and of base tiles.
    pub counts: Counts,
}

/// Material points of a quarter of a tile.
pub struct PointRange {
    /// Number of the sector in whose axes the points are.
    pub sector: usize,
    of_tile: Arc<TilePoints>,
    range: Range<usize>,
}

impl PointRange {
    /// All of some points.
    pub fn whole(sector: usize, of_tile: Arc<TilePoints>) -> Self {
        let range = 0..of_tile.points.len();
        Self { sector, of_tile, range }
    }

    /// The points.
    pub fn points(&self) -> &[TilePoint] {
        &self.of_tile.points[self.range.clone()]
    }

    /// Edges of the cell of a point on the surface [m].
    pub fn edges(&self, point: usize) -> [DVec3; 2] {
        self.of_tile.edges(self.range.start + point)
    }

    /// Kind of a point.
    pub fn kind(&self, point: usize) -> PointKind {
        self.of_tile.kind(self.range.start + point)
    }

    /// Weights of a point, one or one per channel.
    pub fn weights(&self, point: usize, num_weights: usize) -> &[Complex64] {
        let first = (self.range.start + point) * num_weights;
        &self.of_tile.weights[first..first + num_weights]
    }
}

/// Tile that is wanted: number of its base tile, place, and a bit per packet of rays.
#[derive(Clone, Copy)]
struct TileRequest {
    base: u32,
    place: TileIndex,
    packets: u8,
}

/// Tiles of another time that may be taken over.
struct PreviousTiles<'a> {
    levels: &'a [TileLevel],
    /// Base tiles that no moved body touches, then or now.
    is_static: Vec<bool>,
}

impl Tiles {
    /// Cast and refine the tiles of all sectors (at least one). `previous`: tiles at another time, and
    /// boxes where bodies have moved since, in the axes of every sector; static tiles are taken over.
    pub fn new(sectors: &[Sector], materials: &[Material], previous: Option<(&Self, &[Tree])>) -> Result<Self> {
        for sector in sectors {
            sector.check()?;
        }
        let width = sectors.iter().fold(0.0, |width: f64, Sector { plane, .. }| {
            width.max(plane.du).max(plane.dv)
        });
        let has_common_weight = has_common_weight(sectors[0].array, width);
        let contours = Contours::new(sectors, materials, has_common_weight);
        let contexts: Vec<Context> = sectors
            .iter()
            .map(|sector| Context::new(sector, materials, &contours, has_common_weight))
            .collect();
        let refinement = sectors[0].refinement;
        let small_parts = refinement.map_or_else(Vec::new, |Refinement { rcs_floor, .. }| {
            let of = |context| SmallParts::new(context, rcs_floor);
            contexts.iter().map(of).collect()
        });
        let previous = previous.filter(|(tiles, _)| {
            let mut sectors = sectors.iter().zip(&tiles.sectors);
            let is_alike = sectors.all(|(now, (base, beam))| now.plane == *base && now.beam == beam.as_ref());
            // Tiles that a moved body touches are cast anew in any case.
            let first = &contexts[0];
            let mut bodies = first.join.iter().zip(&tiles.turns).zip(&tiles.poses).zip(0..);
            let is_known = |(((now, before), pose), body): (((&Join, &f32), &Pose), u32)| {
                now.turn == *before || pose != first.sector.scene.pose(body)
            };
            is_alike && tiles.sectors.len() == contexts.len() && bodies.all(is_known)
        });
        let known = previous.map(|(tiles, moved)| {
            let changed = |sector: &Sector| contours.changed(&tiles.contours, sector.scene);
            let changed: Vec<Tree> = sectors.iter().map(changed).collect();
            PreviousTiles::new(&contexts, &tiles.levels, [moved, &changed])
        });

        let mut refine = RefineTiles {
            contexts: &contexts,
            sectors,
            small_parts: &small_parts,
            known: known.as_ref(),
            refinement,
            floor: None,
            most_forced: MAX_LEVEL,
            counts: Counts::default(),
        };
        let (mut levels, mut is_whole) = refine.levels(&[])?;
        while !is_whole {
            // Too many rays: again, with the tiles that are there. In the end nothing is split.
            refine.floor = refine.floor.map(|floor| STEP * STEP * floor);
            refine.most_forced = refine.most_forced.saturating_sub(1);
            (levels, is_whole) = refine.levels(&levels)?;
        }
        let mut tiles = Self::gather(levels, &refine);
        refine.check()?;
        let points = contours.points.iter().cloned();
        tiles.pieces.extend(points.map(|points| PointRange::whole(0, points)));
        tiles.contours = contours.into_flags();
        Ok(tiles)
    }

    /// Number of rays of all tiles.
    #[cfg(test)]
    pub(super) fn num_rays(&self) -> usize {
        self.levels.iter().map(TileLevel::rays).sum()
    }

    /// All material points, piece by piece.
    #[cfg(test)]
    pub(super) fn points(&self) -> TilePoints {
        let mut all = TilePoints::default();
        for piece in &self.pieces {
            for (number, point) in piece.points().iter().enumerate() {
                all.points.push(*point);
                all.weights.extend(piece.weights(number, self.num_weights));
                all.set_edges(piece.edges(number));
                all.set_kind(piece.kind(number));
            }
        }
        all
    }

    /// Pieces of all quarters that were not split, base tile by base tile and level by level.
    fn gather(levels: Vec<TileLevel>, refine: &RefineTiles) -> Self {
        let (first, sectors) = (&refine.contexts[0], refine.sectors);
        let mut counts = refine.counts;
        counts.tiles_skipped = levels[0].tiles.iter().filter(|tile| tile.rays == 0).count();
        if let Some(known) = refine.known {
            counts.tiles_reused = known.is_static.iter().filter(|is_static| **is_static).count();
        }
        let mut tiles = Self {
            pieces: Vec::new(),
            num_weights: first.num_weights(),
            has_common_weight: first.has_common_weight,
            sectors: sectors
                .iter()
                .map(|sector| (sector.plane, sector.beam.cloned()))
                .collect(),
            turns: first.join.iter().map(|join| join.turn).collect(),
            poses: (0..first.turns.len() as u32)
                .map(|body| *first.sector.scene.pose(body))
                .collect(),
            contours: Vec::new(),
            rcs_floor: refine.floor,
            num_coarse: refine
                .refinement
                .map(|refinement| refine.num_coarse(&levels, &refinement)),
            num_hit: 0,
            num_lit: 0,
            nearest: nearest_of(&levels, &first.contours.nearest),
            counts,
            levels: Vec::new(),
        };

        // Level and number of all tiles with a hit.
        let mut of_base: Vec<Vec<(usize, usize)>> = vec![Vec::new(); levels[0].tiles.len()];
        for (number, level) in levels.iter().enumerate() {
            for (index, base) in level.base.iter().enumerate() {
                if !level.tiles[index].nearest.is_empty() {
                    of_base[*base as usize].push((number, index));
                }
            }
        }
        let order: Vec<(usize, usize)> = of_base.into_iter().flatten().collect();
        tiles.add_quarters(&levels, &order);
        tiles.levels = levels;
        tiles
    }

    /// Add the points of the quarters that were not split.
    fn add_quarters(&mut self, levels: &[TileLevel], order: &[(usize, usize)]) {
        for (level, index) in order {
            let (level, index) = (&levels[*level], *index);
            let tile = &level.tiles[index];
            for quarter in (0..PACKETS).filter(|quarter| level.keeps(index, *quarter)) {
                let range = tile.quarter(quarter);
                if let Some(points) = tile.points.as_ref().filter(|_| !range.is_empty()) {
                    self.pieces.push(PointRange {
                        sector: tile.place.sector,
                        of_tile: points.clone(),
                        range,
                    });
                }
                self.num_hit += tile.hits[quarter];
                self.num_lit += tile.hits[quarter] - tile.silent[quarter];
            }
        }
    }
}

/// Refinement in progress.
#[derive(Clone, Copy)]
struct RefineTiles<'a> {
    /// Of every sector.
    contexts: &'a [Context<'a>],
    sectors: &'a [Sector<'a>],
    small_parts: &'a [SmallParts],
    known: Option<&'a PreviousTiles<'a>>,
    /// Settings; none: no cell is split.
    refinement: Option<Refinement>,
    /// Smallest cross-section of interest [m^2]; none: not yet chosen.
    floor: Option<f64>,
    /// Number of levels, from the base level on, whose quarters small parts may split.
    most_forced: usize,
    counts: Counts,
}

impl RefineTiles<'_> {
    /// Tiles of all levels; false where the rays would exceed the budget, and finer levels are missing. Tiles that were
    /// `tried` for a smaller cross-section are taken over.
    fn levels(&mut self, tried: &[TileLevel]) -> Result<(Vec<TileLevel>, bool)> {
        let budget = self.refinement.and_then(|refinement| refinement.budget);
        let budget = budget.unwrap_or(usize::MAX);
        let mut levels: Vec<TileLevel> = Vec::new();
        let whole = |(base, place)| TileRequest {
            base,
            place,
            packets: ALL,
        };
        let bases = self.sectors.iter().map(|sector| &sector.plane);
        let mut next: Vec<TileRequest> = base_tiles(bases).into_iter().map(whole).collect();
        let mut rays = 0;
        while !next.is_empty() {
            fits_memory("tiles", &[next.len()], MOST_BYTES)?;
            let most = || next.iter().map(|wanted| PACKET * wanted.packets.count_ones() as usize);
            if !levels.is_empty() && rays + most().sum::<usize>() > budget {
                return Ok((levels, false));
            }
            let mut level = self.evaluate(&next, tried);
            self.check()?;
            rays += level.rays();
            if levels.is_empty() && self.floor.is_none() {
                self.floor = self.refinement.map(|refinement| self.chosen_floor(&level, &refinement));
            }
            next = self.split(&mut level, levels.len());
            self.check()?;
            levels.push(level);
        }
        Ok((levels, true))
    }

    /// An error after a request to stop.
    fn check(&self) -> Result<()> {
        self.sectors[0].cast.cancel.map_or(Ok(()), Cancel::check)
    }

    /// Tiles that are wanted, cast or taken over; without rays after a request to stop.
    fn evaluate(&mut self, all: &[TileRequest], tried: &[TileLevel]) -> TileLevel {
        let tile = |worker: &mut Worker, wanted: &TileRequest| {
            let here = tried
                .get(wanted.place.level)
                .and_then(|level| level.known(&wanted.place, wanted.packets));
            let known = here.or_else(|| self.known.and_then(|known| known.tile(wanted)));
            let is_new = known.is_none();
            let context = &self.contexts[wanted.place.sector];
            let mut new = || match self.check() {
                Ok(()) => context.tile(worker, wanted.place, wanted.packets),
                Err(_) => SampledTile::unseen(wanted.place, wanted.packets),
            };
            let tile = known.unwrap_or_else(|| Arc::new(new()));
            (tile, is_new)
        };
        let tiles: Vec<(Arc<SampledTile>, bool)> = all
            .par_iter()
            .map_init(Worker::new, |worker, wanted| tile(worker, wanted))
            .collect();
        let cast = tiles.iter().filter(|(_, is_new)| *is_new);
        self.counts.rays += cast.map(|(tile, _)| tile.rays).sum::<usize>();
        let tiles = tiles.into_iter().map(|(tile, _)| tile).collect();
        TileLevel::new(tiles, all.iter().map(|wanted| wanted.base).collect())
    }

    /// Split the quarters of a level whose residual error is too large; tiles of the next level.
    fn split(&self, level: &mut TileLevel, number: usize) -> Vec<TileRequest> {
        let Some(refinement) = self.refinement.filter(|_| number < MAX_LEVEL) else {
            return Vec::new();
        };
        let tiles = level.tiles.par_iter();
        let split: Vec<u16> = tiles
            .map(|tile| self.wanted(level, tile, number, &refinement))
            .collect();
        let mut next = Vec::new();
        for (index, split) in split.iter().enumerate() {
            let (base, place) = (level.base[index], level.tiles[index].place);
            for quarter in 0..PACKETS {
                let packets = of_quarter(*split, quarter);
                if packets != 0 {
                    let place = place.quarter(quarter);
                    next.push(TileRequest { base, place, packets });
                }
            }
        }
        level.split = split;
        next
    }

    /// Blocks of a tile, a bit each, that become packets of the next level: of quarters with too large a residual
    /// error, blocks whose own error is too large or that may return power there, and all blocks of quarters that show
    /// a small part of a mesh.
    fn wanted(&self, level: &TileLevel, tile: &SampledTile, number: usize, refinement: &Refinement) -> u16 {
        let sector = tile.place.sector;
        let context = &self.contexts[sector];
        let plane = &context.planes[number];
        let field = field_of(self.floor.unwrap_or(refinement.rcs_floor), TAU / context.wavenumber);
        // Per solid angle and times distance squared [m^2].
        let allowed = SHARE * field / (plane.du * plane.dv);
        let (set, wavenumber) = (context.sector.cast.level, context.wavenumber);
        let adjacent = |place| level.tile(&place);
        let residual = tile.residual_with(set, wavenumber, adjacent);
        let mut wanted = 0_u16;
        for block in 0..BLOCKS {
            wanted |= u16::from(f64::from(residual[block]) > allowed) << block;
        }
        for quarter in 0..PACKETS {
            let all = u16::from(ALL) << (PACKETS * quarter);
            if number < self.most_forced && self.small_parts[sector].wants(&tile.place, quarter) {
                wanted |= all;
            } else if of_quarter(wanted, quarter) != 0 {
                wanted |= if context.sector.skip_aliased {
                    tile.blocks.unaliased & all
                } else {
                    all
                };
            }
        }
        wanted
    }

    /// Smallest cross-section of interest, from the tiles of the base level [m^2].
    fn chosen_floor(&self, base: &TileLevel, refinement: &Refinement) -> f64 {
        let strongest = base.tiles.iter().map(|tile| tile.scattering_length).fold(0.0, f64::max);
        let floor = refinement.rcs_floor;
        if !refinement.follows_echo {
            return floor;
        }
        let wavelength = TAU / self.contexts[0].wavenumber;
        let cross_section = 4.0 * PI * (strongest / wavelength).powi(2);
        (OF_STRONGEST * cross_section).clamp(LEAST_FLOOR * floor, floor)
    }

    /// Number of cells of quarters that the settings ask to split, where the finest level or the budget ended the
    /// refinement.
    fn num_coarse(&self, levels: &[TileLevel], refinement: &Refinement) -> usize {
        let asked = Self {
            floor: None,
            most_forced: MAX_LEVEL,
            ..*self
        };
        let first = if self.most_forced < MAX_LEVEL { 0 } else { MAX_LEVEL };
        let mut number = 0;
        for (depth, level) in levels.iter().enumerate().skip(first) {
            let tiles = level.tiles.par_iter().enumerate();
            let cells = tiles.map(|(index, tile)| {
                let wanted = asked.wanted(level, tile, depth, refinement);
                let is_coarse = |quarter: &usize| level.keeps(index, *quarter) && of_quarter(wanted, *quarter) != 0;
                PACKET * (0..PACKETS).filter(is_coarse).count()
            });
            number += cells.sum::<usize>();
        }
        number
    }
}

impl<'a> PreviousTiles<'a> {
    /// Tiles at another time; `changed`: boxes where bodies have moved since, and of flat regions that were left to cells
    /// at one of both times alone, in the axes of every sector.
    fn new(contexts: &[Context], levels: &'a [TileLevel], changed: [&[Tree]; 2]) -> Self {
        let tiles = base_tiles(contexts.iter().map(|context| &context.planes[0]));
        let is_static = tiles.par_iter().map_init(Worker::new, |worker, (_, place)| {
            let mut changed = changed.iter().map(|trees| &trees[place.sector]);
            changed.all(|boxes| contexts[place.sector].is_static(worker, *place, boxes))
        });
        Self {
            levels,
            is_static: is_static.collect(),
        }
    }

    /// Static tile as it is wanted.
    fn tile(&self, wanted: &TileRequest) -> Option<Arc<SampledTile>> {
        if !self.is_static[wanted.base as usize] {
            return None;
        }
        let level = self.levels.get(wanted.place.level)?;
        level.known(&wanted.place, wanted.packets)
    }
}

/// Nearest hit of every body, the first of equal ones, by body; `of_contours`: of flat regions.
fn nearest_of(levels: &[TileLevel], of_contours: &[NearestHit]) -> Vec<NearestHit> {
    let mut nearest: Vec<Option<NearestHit>> = Vec::new();
    let tiles = levels.iter().flat_map(|level| &level.tiles);
    for hit in tiles.flat_map(|tile| &tile.nearest).chain(of_contours) {
        let body = hit.body as usize;
        if nearest.len() <= body {
            nearest.resize_with(body + 1, || None);
        }
        let known = &mut nearest[body];
        if known.is_none_or(|known| hit.distance < known.distance) {
            *known = Some(*hit);
        }
    }
    nearest.into_iter().flatten().collect()
}
