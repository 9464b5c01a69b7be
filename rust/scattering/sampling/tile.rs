//! Tiles: 8 x 8 rays, their material points quarter by quarter, and what a refinement decides by.

use std::ops::Range;

use super::cells::Cells;
use super::place::Place;
use super::points::{Channels, TilePoints};
use super::residual::{self, BOTTOM, Border, LEFT, RIGHT, TOP};
use crate::antennas::array::Array;
use crate::numeric::simd::{Isa, Kernel};
use crate::rays::camera::{Cell, ImagePlane, Tile as Pixels};
use crate::rays::hits::Cast;
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS};
use crate::rays::scene::PosedScene;
use crate::rays::search::{Scratch, Touch};
use crate::rays::tree::Tree;
use crate::scattering::reflection_table::Reflection;

/// Scene, antennas and tables that tiles are evaluated by.
pub(super) struct Scenery<'a> {
    pub(super) scene: &'a PosedScene,
    pub(super) cast: &'a Cast<'a>,
    pub(super) array: &'a Array,
    /// Image planes of all levels.
    pub(super) planes: Vec<ImagePlane>,
    pub(super) reflections: Vec<Reflection>,
    pub(super) channels: Channels<'a>,
    /// Largest phase of joined points from their mean [rad], per body.
    pub(super) join: Vec<f32>,
    /// Angle by which every body turns [rad]; 0 where its cells keep their tapers.
    pub(super) turns: Vec<f32>,
    pub(super) wavenumber: f64,
}

/// Evaluated tile. It depends on the surfaces that its rays meet alone, not on the refinement.
#[derive(Debug)]
pub(super) struct Tile {
    pub(super) place: Place,
    /// Number of rays cast.
    pub(super) rays: usize,
    /// Field that the pairs of cells of every quarter leave open; see [`residual`].
    pub(super) open: [f32; 4],
    border: Border,
    /// Points of all quarters, and the end of every quarter.
    pub(super) points: TilePoints,
    ends: [usize; 4],
    /// Cells of every quarter that hit a body, and of those the ones without a point.
    pub(super) hits: [usize; 4],
    pub(super) silent: [usize; 4],
    pub(super) nearest: Vec<Nearest>,
    /// Echo of all cells together [m^2]; see [`Cells::echo`].
    pub(super) echo: f64,
}

/// Nearest hit of a body.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// Number of the body.
    pub body: u32,
    /// Number of the triangle.
    pub triangle: u32,
    /// Distance along the ray to the triangle [m].
    pub distance: f64,
    /// Cell of the ray.
    pub cell: Cell,
}

/// Memory of a thread, kept from tile to tile.
pub(super) struct Worker {
    scratch: Scratch,
    cells: Cells,
}

impl Worker {
    pub(super) fn new() -> Self {
        Self {
            scratch: Scratch::new(),
            cells: Cells::EMPTY,
        }
    }
}

impl Scenery<'_> {
    /// Cast and evaluate a tile.
    pub(super) fn tile(&self, worker: &mut Worker, place: Place) -> Tile {
        self.cast.level.run(Evaluate {
            scenery: self,
            worker,
            place,
        })
    }

    /// True if no ray of a tile may meet a box of a tree.
    pub(super) fn is_static(&self, worker: &mut Worker, place: Place, moved: &Tree) -> bool {
        self.cast.level.run(Meets {
            scenery: self,
            worker,
            place,
            moved,
        })
    }

    /// Two-way field gain in the middle of a tile, relative to the peaks.
    fn gain(&self, plane: &ImagePlane, pixels: &Pixels) -> f64 {
        let u = (plane.axis_column - (pixels.column as f64 + 0.5 * pixels.columns as f64)) * plane.du;
        let v = (plane.axis_row - (pixels.row as f64 + 0.5 * pixels.rows as f64)) * plane.dv;
        self.array.relative_gain(u, v)
    }
}

/// Kernel that evaluates a tile.
struct Evaluate<'a> {
    scenery: &'a Scenery<'a>,
    worker: &'a mut Worker,
    place: Place,
}

impl Kernel for Evaluate<'_> {
    type Output = Tile;

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(self) -> Tile {
        let Self {
            scenery,
            worker: Worker { scratch, cells },
            place,
        } = self;
        let plane = &scenery.planes[place.level];
        let Some(pixels) = place.pixels(plane) else {
            return Tile::without_hits(place, Border::OUTSIDE, 0);
        };
        scratch.rays.aim::<I>(plane, &pixels);
        if scenery.cast.is_outside(&scratch.rays) {
            return Tile::without_hits(place, Border::OUTSIDE, 0);
        }
        let (rows, columns) = (pixels.rows, pixels.columns);
        if scenery.scene.search::<I>(scratch, scenery.cast) {
            return Tile::without_hits(place, Border::empty(rows, columns), 0);
        }
        scenery
            .scene
            .measure::<I>(&scratch.rays, &scratch.best, &mut scratch.distance);
        let (best, distance) = (&scratch.best, &scratch.distance);
        scratch
            .shade
            .fill::<I, true>(scenery.scene, &scratch.rays, &best.body, &best.triangle, distance);

        let gain = scenery.gain(plane, &pixels);
        cells.evaluate::<I>(
            scratch,
            plane,
            scenery.wavenumber,
            gain,
            (&scenery.reflections, &scenery.turns),
        );
        if cells.hit == 0 {
            return Tile::without_hits(place, Border::empty(rows, columns), rows * columns);
        }
        let mut tile = Tile::without_hits(place, Border::new(cells, rows, columns), rows * columns);
        tile.open = residual::of_quarters(cells);
        find_nearest(cells, &scratch.distance, plane, &mut tile.nearest);
        cells.weigh();
        tile.echo = cells.echo();
        for quarter in 0..PACKETS {
            let width = [plane.du, plane.dv];
            tile.points.add(
                cells,
                quarter,
                scenery.wavenumber,
                &scenery.join,
                width,
                &scenery.channels,
            );
            tile.ends[quarter] = tile.points.points.len();
            let hit = cells.hit >> (quarter * PACKET) & 0xffff;
            tile.hits[quarter] = hit.count_ones() as usize;
            for i in 0..PACKET {
                let is_silent = cells.weight[quarter * PACKET + i] == 0.0;
                tile.silent[quarter] += usize::from(hit >> i & 1 == 1 && is_silent);
            }
        }
        tile
    }
}

/// Kernel of [`Scenery::is_static`].
struct Meets<'a> {
    scenery: &'a Scenery<'a>,
    worker: &'a mut Worker,
    place: Place,
    moved: &'a Tree,
}

impl Kernel for Meets<'_> {
    type Output = bool;

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(self) -> bool {
        let plane = &self.scenery.planes[self.place.level];
        let Some(pixels) = self.place.pixels(plane) else {
            return true;
        };
        let scratch = &mut self.worker.scratch;
        scratch.rays.aim::<I>(plane, &pixels);
        let mut touch = Touch(false);
        scratch.rays.traverse::<I>(self.moved, &mut scratch.top, &mut touch);
        !touch.0
    }
}

impl Tile {
    fn without_hits(place: Place, border: Border, rays: usize) -> Self {
        Self {
            place,
            rays,
            open: [0.0; 4],
            border,
            points: TilePoints::default(),
            ends: [0; 4],
            hits: [0; 4],
            silent: [0; 4],
            nearest: Vec::new(),
            echo: 0.0,
        }
    }

    /// Points of a quarter.
    pub(super) fn quarter(&self, number: usize) -> Range<usize> {
        number.checked_sub(1).map_or(0, |before| self.ends[before])..self.ends[number]
    }

    /// Field that every quarter leaves open, with the cells of adjacent tiles of the same level.
    pub(super) fn open_with<'a>(&self, wavenumber: f64, adjacent: impl Fn(Place) -> Option<&'a Self>) -> [f32; 4] {
        let mut open = self.open;
        let Place { level, row, column } = self.place;
        let beside = |row: Option<usize>, column: Option<usize>| {
            adjacent(Place {
                level,
                row: row?,
                column: column?,
            })
        };
        for (side, other, quarters) in [
            (LEFT, beside(Some(row), column.checked_sub(1)), [0, 2]),
            (RIGHT, beside(Some(row), Some(column + 1)), [1, 3]),
            (TOP, beside(row.checked_sub(1), Some(column)), [0, 1]),
            (BOTTOM, beside(Some(row + 1), Some(column)), [2, 3]),
        ] {
            let Some(other) = other else { continue };
            if self.nearest.is_empty() && other.nearest.is_empty() {
                continue;
            }
            let halves = self.border.open(side, &other.border, wavenumber);
            for (quarter, half) in quarters.into_iter().zip(halves) {
                open[quarter] = open[quarter].max(half);
            }
        }
        open
    }
}

/// Add the nearest hits of the bodies of a tile, from distances to triangles [m].
#[inline(always)] // part of a kernel
fn find_nearest(cells: &Cells, distances: &[f64; MOST_RAYS], plane: &ImagePlane, found: &mut Vec<Nearest>) {
    let mut rest = cells.hit;
    while rest != 0 {
        let first = rest.trailing_zeros() as usize;
        let body = cells.body[first];
        let (mut nearest, mut at) = (f64::INFINITY, first);
        for i in 0..MOST_RAYS {
            let is_here = rest >> i & 1 == 1 && cells.body[i] == body;
            rest &= !(u64::from(is_here) << i);
            if is_here && distances[i] < nearest {
                (nearest, at) = (distances[i], i);
            }
        }
        let cell = Cell {
            u: cells.u[at],
            v: cells.v[at],
            du: plane.du,
            dv: plane.dv,
        };
        found.push(Nearest {
            body,
            triangle: cells.triangle[at],
            distance: nearest,
            cell,
        });
    }
}
