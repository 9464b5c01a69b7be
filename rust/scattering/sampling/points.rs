//! Material points of the cells of a tile.

use glam::DVec3;
use num_complex::Complex64;

use super::cells::Cells;
use super::join::{Join, joined};
use crate::antennas::array::Array;
use crate::numeric::simd::{Isa, Vector};
use crate::rays::camera::Cell;
use crate::rays::packet::PACKET;
use crate::scattering::material::Material;
use crate::scattering::patch::Patch;
use crate::scattering::physical_optics::{Weigh, specular};
use crate::scattering::taper::taper;
use crate::scattering::tile_point::TilePoint;

/// Material points in order, and their weights: one per point, or one per point and channel.
#[derive(Clone, Debug, Default)]
pub struct TilePoints {
    /// The points.
    pub points: Vec<TilePoint>,
    /// Weights `(point, channel)`, or `(point,)`: specular weights of [`crate::paths::scatterers::Weight`].
    pub weights: Vec<Complex64>,
}

/// Largest distance of an antenna from the middle of the array [m] with weights of the middle: angles of incidence and
/// polarisation differ by a few degrees at arm's length.
const SMALL_ARRAY: f64 = 0.025;

/// Largest phase of a cell by which the middle of a pair of antennas may shift its slope for the weights of all
/// channels to be those of the middle of the array [rad].
const ONE_WEIGHT: f64 = 0.25;

/// Rule for the weights of the points of all channels.
#[derive(Clone, Copy)]
pub enum Channels<'a> {
    /// The array is small: one weight for all channels.
    Common,
    /// One weight per channel.
    Each(&'a Array, &'a [Material]),
}

impl<'a> Channels<'a> {
    /// Rule for an array, a width of the cells of the base grid and the materials of all bodies.
    pub fn new(array: &'a Array, materials: &'a [Material], width: f64, wavenumber: f64) -> Self {
        let middles = (0..array.num_channels()).map(|channel| {
            let [tx, rx] = [channel / array.rx.len(), channel % array.rx.len()];
            0.5 * (array.tx[tx] + array.rx[rx]).length()
        });
        let antennas = array.tx.iter().chain(&array.rx);
        let is_small = antennas.map(|antenna| antenna.length()).fold(0.0, f64::max) <= SMALL_ARRAY;
        if is_small && wavenumber * width * middles.fold(0.0, f64::max) <= ONE_WEIGHT {
            Self::Common
        } else {
            Self::Each(array, materials)
        }
    }

    /// Number of weights per point.
    pub fn number(&self) -> usize {
        match self {
            Self::Common => 1,
            Self::Each(array, _) => array.num_channels(),
        }
    }
}

/// Most groups of a quarter that wait to be joined: one half of every group round a single cell, and both of the last.
const MOST_GROUPS: usize = 5;

/// Neighbouring cells of a quarter, a bit each.
#[derive(Clone, Copy)]
struct Group {
    cells: u32,
    rows: u32,
    columns: u32,
}

impl Group {
    const SIDE: u32 = 4;
    const QUARTER: Self = Self {
        cells: (1 << PACKET) - 1,
        rows: Self::SIDE,
        columns: Self::SIDE,
    };

    /// Largest distance between the centres of its cells at a distance of 1, for cells of a size.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    fn length(&self, [du, dv]: [f64; 2]) -> f64 {
        (f64::from(self.columns - 1) * du).max(f64::from(self.rows - 1) * dv)
    }

    /// Halves of the group across the axis along which the phase varies most; `slope`: of a cell along u and v.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    fn halves(self, slope: [f32; 2]) -> [Self; 2] {
        let Self { cells, rows, columns } = self;
        let across_u = slope[0] * (columns - 1) as f32 >= slope[1] * (rows - 1) as f32;
        if columns > 1 && (rows == 1 || across_u) {
            let columns = columns / 2;
            let left = if columns == 2 { 0x3333 } else { 0x5555 };
            let half = |cells| Self { cells, rows, columns };
            [half(cells & left), half(cells & !left)]
        } else {
            let rows = rows / 2;
            let top = if rows == 2 { 0x00ff } else { 0x0f0f };
            let half = |cells| Self { cells, rows, columns };
            [half(cells & top), half(cells & !top)]
        }
    }
}

impl TilePoints {
    /// Copy without spare memory.
    pub(super) fn copy(&self) -> Self {
        Self {
            points: self.points.as_slice().to_vec(),
            weights: self.weights.as_slice().to_vec(),
        }
    }

    /// Remove all points.
    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.weights.clear();
    }

    /// Append the points of a quarter. `join`: limits of joined cells, per body; `width`: size
    /// of the cells in u and v.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub(super) fn add<I: Isa>(
        &mut self,
        cells: &Cells,
        quarter: usize,
        wavenumber: f64,
        join: &[Join],
        width: [f64; 2],
        channels: &Channels,
    ) {
        let first = quarter * PACKET;
        match channels {
            Channels::Common => self.add_quarter::<I>(cells, first, wavenumber, join, width),
            Channels::Each(array, materials) => {
                for cell in (first..first + PACKET).filter(|cell| cells.hit >> cell & 1 == 1) {
                    self.add_by_channel(cells, cell, width, array, materials);
                }
            }
        }
    }

    /// Append the point of one cell, unless it has no weight.
    pub(super) fn add_center(&mut self, cells: &Cells, cell: usize, width: [f64; 2], channels: &Channels) {
        match channels {
            Channels::Common if cells.weight[cell] > 0.0 => {
                self.points.push(point_of(cells, cell, width));
                self.weights.push(weight_of(cells, cell));
            }
            Channels::Common => {}
            Channels::Each(array, materials) => self.add_by_channel(cells, cell, width, array, materials),
        }
    }

    /// Append the points of a quarter, joined where phases allow: all cells, or halves of those that cannot be joined.
    #[cfg_attr(optimised, inline(always))]
    fn add_quarter<I: Isa>(&mut self, cells: &Cells, first: usize, wavenumber: f64, join: &[Join], width: [f64; 2]) {
        let weight = I::F32::load(&cells.weight[first..]);
        let is_lit = !weight.at_most(<I::F32 as Vector>::splat(0.0));
        let lit = is_lit & cells.hits(first / PACKET);
        if lit == 0 {
            return;
        }
        let leader = first + lit.trailing_zeros() as usize;
        let slope = [cells.slope[0][leader].abs(), cells.slope[1][leader].abs()];
        let join = &join[cells.body[leader] as usize];
        let mut stack = [Group::QUARTER; MOST_GROUPS];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let group = stack[depth];
            let lit = lit & group.cells;
            let number = lit.count_ones();
            if number > 1 {
                let length = cells.distance[leader] * group.length(width);
                let mut point = None;
                if join.allows(wavenumber, length) {
                    point = joined::<I>(cells, first, lit, wavenumber, join.phase);
                }
                if let Some((point, weight)) = point {
                    self.points.push(point);
                    self.weights.push(weight);
                } else {
                    let [one, other] = group.halves(slope);
                    (stack[depth], stack[depth + 1]) = (other, one);
                    depth += 2;
                }
            } else if number == 1 {
                let cell = first + lit.trailing_zeros() as usize;
                self.points.push(point_of(cells, cell, width));
                self.weights.push(weight_of(cells, cell));
            }
        }
    }

    /// Append the point of a cell with the weight of every channel, whose taper is that of the slopes seen by its
    /// antennas; none if all are zero.
    #[inline(never)]
    fn add_by_channel(&mut self, cells: &Cells, cell: usize, width: [f64; 2], array: &Array, materials: &[Material]) {
        let patch = patch_of(cells, cell, width);
        let Some(area) = patch.area() else { return };
        let weigh = Weigh {
            array,
            sampling: crate::scattering::physical_optics::Sampling::Footprint,
        };
        let [along_u, along_v] = patch.cell.edges(patch.distance, patch.normal);
        let start = self.weights.len();
        for channel in 0..array.num_channels() {
            let [t, r] = array.directions(channel, patch.point());
            let response = weigh.response(&materials[patch.body as usize], patch.normal, t, r);
            let bisector = crate::paths::scatterers::bisector(array.frequency, t, r);
            let tapers = taper(bisector.dot(along_u)) * taper(bisector.dot(along_v));
            self.weights.push(specular(&response, area) * tapers);
        }
        if self.weights[start..].iter().all(|weight| *weight == Complex64::ZERO) {
            self.weights.truncate(start);
        } else {
            let edges = [DVec3::ZERO; 2];
            let point = point_of(cells, cell, width);
            self.points.push(TilePoint { edges, ..point });
        }
    }
}

/// Material point of one cell of a size.
#[cfg_attr(optimised, inline(always))]
pub(super) fn point_of(cells: &Cells, cell: usize, [du, dv]: [f64; 2]) -> TilePoint {
    let mut edges = [DVec3::ZERO; 2];
    if cells.turning >> cell & 1 == 1 {
        let (u, v) = (cells.u[cell], cells.v[cell]);
        edges = Cell { u, v, du, dv }.edges(cells.distance[cell], cells.normal_of(cell));
    }
    TilePoint {
        edges,
        position: cells.distance[cell] * cells.direction(cell),
        normal: cells.normal_of(cell),
        body: cells.body[cell],
        triangle: cells.triangle[cell],
        order: 0,
    }
}

/// Patch of surface behind a cell of a size.
pub(super) fn patch_of(cells: &Cells, cell: usize, [du, dv]: [f64; 2]) -> Patch {
    let (u, v) = (cells.u[cell], cells.v[cell]);
    Patch {
        index: cell,
        body: cells.body[cell],
        cell: Cell { u, v, du, dv },
        distance: cells.distance[cell],
        normal: cells.normal_of(cell),
    }
}

/// Weight of the point of one cell, `(j / 8 pi) Gamma dA T T`.
#[cfg_attr(optimised, inline(always))]
pub(super) fn weight_of(cells: &Cells, cell: usize) -> Complex64 {
    let weight = f64::from(cells.weight[cell]);
    let [re, im] = &cells.reflection;
    Complex64::new(-f64::from(im[cell]) * weight, f64::from(re[cell]) * weight)
}
