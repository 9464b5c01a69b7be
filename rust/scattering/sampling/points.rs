//! Material points of the cells of a tile.

use super::cells::TileCells;
use super::context::{Context, weight_of};
use super::join::joined;
use crate::numeric::simd::Isa;
use crate::rays::camera::ImagePlane;
use crate::rays::packet::PACKET;
use crate::scattering::tile_point::{TilePoint, TilePoints};

/// Most groups of a quarter that wait to be joined: one half of every group round a single cell, and both of the last.
const MOST_GROUPS: usize = 5;

/// Neighbouring cells of a quarter, a bit each.
#[derive(Clone, Copy)]
struct CellGroup {
    cells: u32,
    rows: u32,
    columns: u32,
}

impl CellGroup {
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
    /// Append the points of a quarter of a tile on a plane.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub(super) fn add_quarter<I: Isa>(
        &mut self,
        context: &Context,
        cells: &TileCells,
        quarter: usize,
        plane: &ImagePlane,
    ) {
        let first = quarter * PACKET;
        if context.has_common_weight {
            self.add_joined::<I>(context, cells, first, plane);
        } else {
            for cell in (first..first + PACKET).filter(|cell| cells.hit >> cell & 1 == 1) {
                self.add_by_channel(context, cells, cell, plane);
            }
        }
    }

    /// Append the point of one cell. Its field is a mean over the cell where the body turns.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    fn add_cell(&mut self, cells: &TileCells, cell: usize, plane: &ImagePlane) {
        self.points.push(point_of(cells, cell));
        self.weights.push(weight_of(cells, cell));
        if cells.turning >> cell & 1 == 1 {
            self.set_edges(cells.edges(cell, plane));
        }
    }

    /// Append the points of a quarter, joined where phases allow: all cells, or halves of cells that cannot be joined.
    #[cfg_attr(optimised, inline(always))]
    fn add_joined<I: Isa>(&mut self, context: &Context, cells: &TileCells, first: usize, plane: &ImagePlane) {
        let lit = cells.with_weight::<I>(first / PACKET);
        if lit == 0 {
            return;
        }
        let leader = first + lit.trailing_zeros() as usize;
        let slope = [cells.slope[0][leader].abs(), cells.slope[1][leader].abs()];
        let (join, wavenumber) = (&context.join[cells.body[leader] as usize], context.wavenumber);
        if join.phase == 0.0 {
            for cell in (first..first + PACKET).filter(|cell| lit >> (cell - first) & 1 == 1) {
                self.add_cell(cells, cell, plane);
            }
            return;
        }
        let mut stack = [CellGroup::QUARTER; MOST_GROUPS];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let group = stack[depth];
            let lit = lit & group.cells;
            let number = lit.count_ones();
            if number > 1 {
                let length = cells.distance[leader] * group.length([plane.du, plane.dv]);
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
                self.add_cell(cells, cell, plane);
            }
        }
    }

    /// Append the point of a cell with the weight of every channel, tapered by the slopes seen by its antennas; none if
    /// all are zero.
    #[inline(never)]
    fn add_by_channel(&mut self, context: &Context, cells: &TileCells, cell: usize, plane: &ImagePlane) {
        let weight = |directions| context.weight(cells, cell, plane, directions);
        self.add(point_of(cells, cell), context.sector.array, false, weight);
    }
}

/// Material point of one cell.
#[cfg_attr(optimised, inline(always))]
fn point_of(cells: &TileCells, cell: usize) -> TilePoint {
    TilePoint {
        position: cells.distance[cell] * cells.direction(cell),
        normal: cells.normal_of(cell),
        body: cells.body[cell],
        triangle: cells.triangle[cell],
    }
}
