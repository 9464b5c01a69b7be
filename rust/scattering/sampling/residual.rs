//! Residual error of the blocks of a tile, from the differences of adjacent cells, and blocks that cannot echo.

use super::cells::{TileCells, magnitude};
use crate::numeric::simd::{Isa, Vector};
use crate::rays::camera::TILE;
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS, SIDE, TileRays};
use crate::scattering::taper::STEEPEST;

/// Residual share of a cell's field at an edge in the cell: where one cell hits and the adjacent one misses, or
/// where distances step. The larger phase error of such pairs would double the rays for an equal error of the sum.
const EDGE: f32 = 0.1;

/// Share of a cell's field for adjacent cells of two surfaces.
const OTHER_SURFACE: f32 = 0.1;

/// Part of the change of a slope from cell to cell by which it may change within a block: cells of half the size have
/// their centres a quarter from the middle.
const WITHIN: f32 = 0.5;

/// Bits of a positive number without its mantissa: the largest power of two that is not above it.
const EXPONENT: u32 = 0x7f80_0000;

/// Number of blocks of 2 x 2 cells of a tile; each is a packet of the tile that its quarter is split into.
pub(super) const BLOCKS: usize = MOST_RAYS / 4;

/// Numbers of cells that adjacent ones compare, a row each.
pub(super) type Features<T> = [T; FEATURES];

/// Number of rows, and their order.
pub(super) const FEATURES: usize = 9;

/// Phase relative to others [rad], or zero where the step is known.
pub(super) const PHASE: usize = 0;

/// Half of what the phase turns over a cell, along u and, in the next row, along v [rad].
const SLOPE: usize = 1;

/// Least magnitudes of the slopes while the body turns, along u and, in the next row, along v.
const LEAST: usize = 3;

/// Ratio of the largest size at which half cells pass the tapers to the cell's, a power of two of at most 1; 0 without a
/// hit.
const ALIAS_SCALE: usize = 5;

/// Field per solid angle times distance squared [m^2].
const FIELD: usize = 6;

/// Number of the surface, see [`TileCells::surface`], or [`NOTHING`].
pub(super) const SURFACE: usize = 7;

/// 1 for cells with a ray, 0 for others.
pub(super) const VALID: usize = 8;

/// Surface of cells without a hit.
pub(super) const NOTHING: f32 = -1.0;

/// Load a vector of every row from a place on.
#[cfg_attr(optimised, inline(always))] // part of kernels
pub(super) fn load<V: Vector<Scalar = f32>, const N: usize>(rows: &Features<[f32; N]>, first: usize) -> Features<V> {
    let mut loaded = [V::splat(0.0); FEATURES];
    for row in 0..FEATURES {
        loaded[row] = V::load(&rows[row][first..]);
    }
    loaded
}

/// Residual fields of adjacent cells along an axis; u and v fall from the first to the second.
///
/// Phases of two cells that vary linearly agree with the mean of their slopes; the rest, the change of the slopes and
/// of the body are the residual. Fast phases leave less: an edge term has the field over the slopes. Where tapers stop
/// these until cells are smaller, the residual of the last split before that is decisive: cells up to there return
/// nothing.
#[cfg_attr(optimised, inline(always))] // part of a kernel
pub(super) fn pair_error<V: Vector<Scalar = f32>>(a: &Features<V>, b: &Features<V>, axis: usize) -> V {
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let phase = b[PHASE].sub(a[PHASE]).add(a[SLOPE + axis]).add(b[SLOPE + axis]);
    let change = magnitude(b[SLOPE].sub(a[SLOPE])).add(magnitude(b[SLOPE + 1].sub(a[SLOPE + 1])));
    let is_same = a[SURFACE].equal(b[SURFACE]);
    let other_surface = zero.select(is_same, V::splat(OTHER_SURFACE));
    let residual = magnitude(phase).add(change.mul(V::splat(0.25))).add(other_surface);
    let is_silhouette = zero.at_most(a[SURFACE]) ^ zero.at_most(b[SURFACE]);
    let is_edge = is_silhouette | one.at_most(residual);
    let scale = a[ALIAS_SCALE].max(b[ALIAS_SCALE]);
    // A stationary point may lie between slopes of opposite signs: of one surface, or within a cell that is not steep.
    let may_reflect = [
        is_same | one.at_most(a[ALIAS_SCALE]),
        is_same | one.at_most(b[ALIAS_SCALE]),
    ];
    let mut damping = [one; 2];
    for axis in 0..2 {
        let is_steady = zero.at_most(a[SLOPE + axis].mul(b[SLOPE + axis]));
        for (cell, features) in [a, b].into_iter().enumerate() {
            let factor = scale.select(is_steady | !may_reflect[cell], zero);
            damping[cell] = damping[cell].mul(one.add(features[LEAST + axis].mul(factor)));
        }
    }
    let field = a[FIELD].div(damping[0]).max(b[FIELD].div(damping[1]));
    let area = scale.mul(scale);
    let share = V::splat(EDGE).select(is_edge, residual.mul(area));
    field.mul(share).mul(area).mul(a[VALID]).mul(b[VALID])
}

/// Cells of a tile row by row, and of cells below the last row.
const CAPACITY: usize = MOST_RAYS + PACKET;

/// Features of the cells of a tile, row by row.
#[repr(C, align(64))]
pub(super) struct CellFeatures(pub(super) Features<[f32; CAPACITY]>);

impl CellFeatures {
    /// Features of evaluated cells.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn new<I: Isa>(cells: &TileCells) -> Self {
        // Packet by packet.
        let (mut surface, mut valid) = ([0.0; MOST_RAYS], [0.0; MOST_RAYS]);
        for i in 0..MOST_RAYS {
            surface[i] = cells.surface[i] as f32;
        }
        let splat = <I::F32 as Vector>::splat;
        for packet in 0..PACKETS {
            let first = packet * PACKET;
            let seen = I::F32::load(&surface[first..]).select(cells.hits(packet), splat(NOTHING));
            seen.store(&mut surface[first..]);
            let bits = (cells.valid >> first) as u32 & 0xffff;
            splat(1.0).select(bits, splat(0.0)).store(&mut valid[first..]);
        }
        let mut rows = [[0.0; CAPACITY]; FEATURES];
        rows[SURFACE] = [NOTHING; CAPACITY];
        let by_packet = [
            (PHASE, &cells.phase),
            (SLOPE, &cells.slope[0]),
            (SLOPE + 1, &cells.slope[1]),
            (LEAST, &cells.least_slope[0]),
            (LEAST + 1, &cells.least_slope[1]),
            (FIELD, &cells.field),
            (SURFACE, &surface),
            (VALID, &valid),
        ];
        for (feature, numbers) in by_packet {
            for row in 0..TILE {
                for first in [0, SIDE] {
                    let (to, from) = (row * TILE + first, TileRays::ray(row, first));
                    rows[feature][to..to + SIDE].copy_from_slice(&numbers[from..from + SIDE]);
                }
            }
        }
        let mut features = Self(rows);
        features.set_alias_scales::<I>();
        features
    }

    /// Find the sizes at which half cells pass the tapers.
    #[cfg_attr(optimised, inline(always))]
    fn set_alias_scales<I: Isa>(&mut self) {
        let splat = <I::F32 as Vector>::splat;
        let rows = &mut self.0;
        let mut steep = [splat(1.0); MOST_RAYS / PACKET];
        for axis in 0..2 {
            let slope = &rows[SLOPE + axis];
            // Changes to the right, with those to the left in front, and downwards, with those upwards in front.
            let mut right = [0.0_f32; CAPACITY];
            let mut below = [0.0_f32; CAPACITY];
            for first in (0..MOST_RAYS).step_by(PACKET) {
                let (here, surface) = (I::F32::load(&slope[first..]), I::F32::load(&rows[SURFACE][first..]));
                let is_same = surface.equal(I::F32::load(&rows[SURFACE][first + 1..])) & INNER;
                let change = magnitude(I::F32::load(&slope[first + 1..]).sub(here));
                change.select(is_same, splat(0.0)).store(&mut right[first + 1..]);
                let is_same = surface.equal(I::F32::load(&rows[SURFACE][first + TILE..]));
                let change = magnitude(I::F32::load(&slope[first + TILE..]).sub(here));
                change.select(is_same, splat(0.0)).store(&mut below[first + TILE..]);
            }
            for (number, steep) in steep.iter_mut().enumerate() {
                let first = number * PACKET;
                let change = I::F32::load(&right[first..]).max(I::F32::load(&right[first + 1..]));
                let change = change.max(I::F32::load(&below[first..]));
                let change = change.max(I::F32::load(&below[first + TILE..]));
                let least = I::F32::load(&rows[LEAST + axis][first..]).sub(change.mul(splat(WITHIN)));
                *steep = steep.max(least.mul(splat(0.5 / STEEPEST)));
            }
        }
        for (number, steep) in steep.into_iter().enumerate() {
            let first = number * PACKET;
            let is_hit = splat(0.0).at_most(I::F32::load(&rows[SURFACE][first..]));
            let scale = splat(1.0).div(steep).select(is_hit, splat(0.0));
            scale.store(&mut rows[ALIAS_SCALE][first..]);
        }
        // Cells are halved: sizes at which they pass are powers of two.
        for scale in &mut rows[ALIAS_SCALE] {
            *scale = f32::from_bits(scale.to_bits() & EXPONENT);
        }
    }
}

/// Bits of the cells of two rows that have a cell to their right.
const INNER: u32 = 0x7f7f;

/// Criteria of the blocks of a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Blocks {
    /// Largest residual field of any pair of cells, per solid angle and times distance squared [m^2].
    pub(super) residual: [f32; BLOCKS],
    /// A bit per block in which a cell of half the size may return power: one with slopes that the taper passes.
    pub(super) unaliased: u16,
}

impl Blocks {
    /// Blocks without hits.
    pub(super) const EMPTY: Self = Self {
        residual: [0.0; BLOCKS],
        unaliased: 0,
    };

    /// Criteria of the blocks of evaluated cells.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub(super) fn new<I: Isa>(features: &CellFeatures) -> Self {
        let rows = &features.0;
        let zero = <I::F32 as Vector>::splat(0.0);
        let mut right = [0.0_f32; CAPACITY];
        let mut below = [0.0_f32; CAPACITY];
        let mut unaliased = 0_u64;
        for first in (0..MOST_RAYS).step_by(PACKET) {
            let here = load::<I::F32, CAPACITY>(rows, first);
            let residual = pair_error(&here, &load(rows, first + 1), 0);
            residual.select(INNER, zero).store(&mut right[first + 1..]);
            pair_error(&here, &load(rows, first + TILE), 1).store(&mut below[first + TILE..]);
            let one = <I::F32 as Vector>::splat(1.0);
            unaliased |= u64::from(one.at_most(here[ALIAS_SCALE])) << first;
        }
        let mut residual = [0.0_f32; MOST_RAYS];
        for first in (0..MOST_RAYS).step_by(PACKET) {
            let across = I::F32::load(&right[first..]).max(I::F32::load(&right[first + 1..]));
            let along = I::F32::load(&below[first..]).max(I::F32::load(&below[first + TILE..]));
            across.max(along).store(&mut residual[first..]);
        }
        let mut blocks = Self::EMPTY;
        for row in (0..TILE).step_by(2) {
            for column in (0..TILE).step_by(2) {
                let (block, cell) = (block(row, column), row * TILE + column);
                let [a, b] = [cell, cell + TILE];
                blocks.residual[block] = residual[a].max(residual[a + 1]).max(residual[b].max(residual[b + 1]));
                let is_unaliased = unaliased >> a & 0b11 != 0 || unaliased >> b & 0b11 != 0;
                blocks.unaliased |= u16::from(is_unaliased) << block;
            }
        }
        blocks
    }
}

/// Number of the block of a row and a column of the tile: quarter by quarter.
pub(super) const fn block(row: usize, column: usize) -> usize {
    let quarter = row / SIDE * 2 + column / SIDE;
    4 * quarter + row % SIDE / 2 * 2 + column % SIDE / 2
}

/// Bits of a quarter's blocks among all blocks: packets of the finer tile of the quarter.
pub(super) fn of_quarter(blocks: u16, quarter: usize) -> u8 {
    (blocks >> (PACKETS * quarter)) as u8 & 0xf
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::simd::{Kernel, Level};

    /// Residual field of cells with a field of 1, beside others without a hit. `slope`: along u [rad].
    struct AtEdge {
        slope: f32,
        scale: f32,
    }

    impl Kernel for AtEdge {
        type Output = f32;

        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> f32 {
            let splat = <I::F32 as Vector>::splat;
            let mut nothing = [splat(0.0); FEATURES];
            (nothing[SURFACE], nothing[VALID]) = (splat(NOTHING), splat(1.0));
            let mut hit = [splat(0.0); FEATURES];
            (hit[SLOPE], hit[LEAST]) = (splat(self.slope), splat(self.slope));
            (hit[ALIAS_SCALE], hit[FIELD], hit[VALID]) = (splat(self.scale), splat(1.0), splat(1.0));
            let mut residual = [0.0; PACKET];
            pair_error(&hit, &nothing, 1).store(&mut residual);
            residual[0]
        }
    }

    #[test]
    fn silhouettes_of_steep_cells_leave_what_they_do_at_the_size_that_returns_power() {
        for level in Level::available() {
            // Half of the steep cell turns by 5 rad to either side, beyond the tapers; a quarter passes.
            let whole = level.run(AtEdge { slope: 1.0, scale: 1.0 });
            let steep = level.run(AtEdge {
                slope: 10.0,
                scale: 0.5,
            });
            assert!((whole - 0.1 / 2.0).abs() < 1e-6, "{whole}");
            assert!((steep - 0.1 * 0.25 / 6.0).abs() < 1e-6, "{steep}");
        }
    }

    /// Residual field of cells with slopes of opposite signs, of one surface or of two.
    struct AtFold {
        is_one: bool,
    }

    impl Kernel for AtFold {
        type Output = f32;

        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> f32 {
            let splat = <I::F32 as Vector>::splat;
            let cell = |slope: f32, surface: f32| {
                let mut cell = [splat(0.0); FEATURES];
                (cell[SLOPE], cell[LEAST], cell[SURFACE]) = (splat(slope), splat(slope.abs()), splat(surface));
                (cell[ALIAS_SCALE], cell[FIELD], cell[VALID]) = (splat(0.5), splat(1.0), splat(1.0));
                cell
            };
            let mut residual = [0.0; PACKET];
            let other = if self.is_one { 0.0 } else { 1.0 };
            pair_error(&cell(10.0, 0.0), &cell(-10.0, other), 0).store(&mut residual);
            residual[0]
        }
    }

    #[test]
    fn between_steep_cells_of_two_surfaces_no_point_is_stationary() {
        for level in Level::available() {
            // One surface may reflect like a mirror between the cells; at a fold of two both fade by their slopes.
            assert!((level.run(AtFold { is_one: true }) - 0.1 * 0.25).abs() < 1e-6);
            assert!((level.run(AtFold { is_one: false }) - 0.1 * 0.25 / 6.0).abs() < 1e-6);
        }
    }

    /// Alias scales of the first cells of a tile, of slopes along u [rad].
    struct Steepened([f32; 4]);

    impl Kernel for Steepened {
        type Output = [f32; 4];

        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> [f32; 4] {
            let mut cells = TileCells::EMPTY;
            // Of surfaces of their own, so that no slope changes from cell to cell; the last misses.
            for (column, slope) in self.0.into_iter().enumerate() {
                let cell = TileRays::ray(0, column);
                cells.surface[cell] = column as u32;
                cells.slope[0][cell] = slope;
                cells.least_slope[0][cell] = slope;
                cells.valid |= 1 << cell;
                cells.hit |= u64::from(column < 3) << cell;
            }
            let features = CellFeatures::new::<I>(&cells);
            [0, 1, 2, 3].map(|column| features.0[ALIAS_SCALE][column])
        }
    }

    #[test]
    fn cells_pass_the_tapers_at_sizes_that_are_powers_of_two() {
        for level in Level::available() {
            // Half cells turn by half of the slope, and pass below pi.
            let got = level.run(Steepened([6.0, 7.0, 13.0, 9.0]));
            assert_eq!(got, [1.0, 0.5, 0.25, 0.0]);
        }
    }
}
