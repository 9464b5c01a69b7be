//! Packets: rays of a tile, 16 at a time, in the sensor frame and in those of bodies.

use glam::DVec3;

use crate::geometry::pose::Pose;
use crate::numeric::simd::{Isa, Vector};
use crate::rays::camera::{ImagePlane, TILE, Tile};
use crate::rays::traversal::{Slabs, Visit, traverse};
use crate::rays::tree::{Node, Tree};
use crate::rays::triangle_block::UNIT;

/// Rays of a packet, tested at once in vectors.
pub const PACKET: usize = 16;
/// Packets of a tile.
pub const PACKETS: usize = 4;
/// Most rays of a tile.
pub const MOST_RAYS: usize = PACKET * PACKETS;

/// Side of the square of pixels that a packet holds.
pub const SIDE: usize = TILE / 2;

/// Row and column of every ray in the tile, packet by packet.
const PLACES: [[f64; MOST_RAYS]; 2] = {
    let mut places = [[0.0; MOST_RAYS]; 2];
    let mut ray = 0;
    while ray < MOST_RAYS {
        let (packet, lane) = (ray / PACKET, ray % PACKET);
        places[0][ray] = (packet / 2 * SIDE + lane / SIDE) as f64;
        places[1][ray] = (packet % 2 * SIDE + lane % SIDE) as f64;
        ray += 1;
    }
    places
};

/// Directions `(1, u, v)` of the rays of a tile, in the sensor frame.
#[repr(C, align(64))]
pub struct TileRays {
    /// Coordinate u = y/x of every ray, to the left.
    pub u: [f64; MOST_RAYS],
    /// Coordinate v = z/x of every ray, up.
    pub v: [f64; MOST_RAYS],
    /// A bit per valid ray of every packet; the others repeat rays at the edge of the tile.
    pub valid: [u32; PACKETS],
    /// Middle, and half of the extent, of `u` and `v` of every packet, and of all rays.
    middle: [[f64; 2]; PACKETS + 1],
    half: [[f64; 2]; PACKETS + 1],
}

impl TileRays {
    /// Without rays.
    pub const EMPTY: Self = Self {
        u: [0.0; MOST_RAYS],
        v: [0.0; MOST_RAYS],
        valid: [0; PACKETS],
        middle: [[0.0; 2]; PACKETS + 1],
        half: [[0.0; 2]; PACKETS + 1],
    };

    /// Aim rays through the centres of the pixels of a tile, in squares of 4 x 4.
    #[cfg_attr(optimised, inline(always))]
    pub fn aim<I: Isa>(&mut self, plane: &ImagePlane, tile: &Tile) {
        self.valid = [0; PACKETS];
        let splat = <I::F64 as Vector>::splat;
        let last_row = splat((tile.rows - 1) as f64);
        let last_column = splat((tile.columns - 1) as f64);
        let first_row = splat(tile.row as f64 + 0.5);
        let first_column = splat(tile.column as f64 + 0.5);
        for first in (0..MOST_RAYS).step_by(I::F64::LANES) {
            // The operations of `ImagePlane::center`.
            let row = I::F64::load(&PLACES[0][first..]);
            let column = I::F64::load(&PLACES[1][first..]);
            let u = splat(plane.axis_column).sub(column.min(last_column).add(first_column));
            let v = splat(plane.axis_row).sub(row.min(last_row).add(first_row));
            u.mul(splat(plane.du)).store(&mut self.u[first..]);
            v.mul(splat(plane.dv)).store(&mut self.v[first..]);
            let is_valid = row.at_most(last_row) & column.at_most(last_column);
            self.valid[first / PACKET] |= is_valid << (first % PACKET);
        }
        // Pixels of a packet fill a rectangle from its first to its last, and so do those of the tile.
        for packet in 0..=PACKETS {
            let first = packet % PACKETS * PACKET;
            let last = if packet == PACKETS { MOST_RAYS } else { first + PACKET } - 1;
            self.middle[packet] = [
                0.5 * (self.u[first] + self.u[last]),
                0.5 * (self.v[first] + self.v[last]),
            ];
            self.half[packet] = [
                0.5 * (self.u[first] - self.u[last]),
                0.5 * (self.v[first] - self.v[last]),
            ];
        }
    }

    /// Keep the packets of a bit mask; the others become invalid, and cost nothing.
    #[cfg_attr(optimised, inline(always))]
    pub fn keep(&mut self, packets: u32) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for packet in 0..PACKETS {
            if packets >> packet & 1 == 0 {
                self.valid[packet] = 0;
            }
            if self.valid[packet] == 0 {
                continue;
            }
            for axis in 0..2 {
                let (middle, half) = (self.middle[packet][axis], self.half[packet][axis]);
                (low[axis], high[axis]) = (low[axis].min(middle - half), high[axis].max(middle + half));
            }
        }
        if self.valid == [0; PACKETS] {
            return;
        }
        for axis in 0..2 {
            self.middle[PACKETS][axis] = 0.5 * (low[axis] + high[axis]);
            self.half[PACKETS][axis] = 0.5 * (high[axis] - low[axis]);
        }
    }

    /// Aim rays through at most 64 points of the image plane, in order.
    #[cfg_attr(optimised, inline(always))]
    pub fn hold(&mut self, points: &[[f64; 2]]) {
        let last = points.len() - 1;
        for ray in 0..MOST_RAYS {
            [self.u[ray], self.v[ray]] = points[ray.min(last)];
        }
        let (mut low, mut high) = ([[0.0; 2]; PACKETS + 1], [[0.0; 2]; PACKETS + 1]);
        for packet in 0..PACKETS {
            let first = packet * PACKET;
            let number = points.len().saturating_sub(first).min(PACKET);
            self.valid[packet] = ((1_u64 << number) - 1) as u32;
            for (axis, places) in [&self.u, &self.v].into_iter().enumerate() {
                let (mut least, mut most) = (places[first], places[first]);
                for ray in first..first + PACKET {
                    (least, most) = (least.min(places[ray]), most.max(places[ray]));
                }
                (low[packet][axis], high[packet][axis]) = (least, most);
            }
        }
        (low[PACKETS], high[PACKETS]) = (low[0], high[0]);
        for packet in 1..PACKETS {
            for axis in 0..2 {
                low[PACKETS][axis] = low[PACKETS][axis].min(low[packet][axis]);
                high[PACKETS][axis] = high[PACKETS][axis].max(high[packet][axis]);
            }
        }
        for packet in 0..=PACKETS {
            for axis in 0..2 {
                self.middle[packet][axis] = 0.5 * (low[packet][axis] + high[packet][axis]);
                self.half[packet][axis] = 0.5 * (high[packet][axis] - low[packet][axis]);
            }
        }
    }

    /// Smallest and largest `u`, and `v`.
    pub fn ranges(&self) -> [[f64; 2]; 2] {
        let (middle, half) = (&self.middle[PACKETS], &self.half[PACKETS]);
        [0, 1].map(|i| [middle[i] - half[i], middle[i] + half[i]])
    }

    /// Bound of the coordinates of all directions, in any frame.
    fn length(&self) -> f64 {
        let (middle, half) = (&self.middle[PACKETS], &self.half[PACKETS]);
        1.0 + middle[0].abs() + half[0] + middle[1].abs() + half[1]
    }

    /// Visit all leaves of a tree in the sensor frame whose boxes any ray may meet, near ones first.
    #[cfg_attr(optimised, inline(always))]
    pub fn traverse<I: Isa>(&self, tree: &Tree, stack: &mut Vec<u64>, visitor: &mut impl Visit) {
        let (middle, half) = (&self.middle[PACKETS], &self.half[PACKETS]);
        let (mut low, mut high) = ([1.0; 3], [1.0; 3]);
        for axis in 0..2 {
            low[axis + 1] = ((middle[axis] - half[axis]) as f32).next_down();
            high[axis + 1] = ((middle[axis] + half[axis]) as f32).next_up();
        }
        let slabs = Slabs::new(&[0.0; 3], 0.0, &low, &high);
        traverse::<I>(&slabs, tree, f32::MAX, stack, visitor);
    }

    /// Number of the ray of a row and a column of the tile; the next columns follow to the end of the packet.
    pub fn ray(row: usize, column: usize) -> usize {
        let packet = row / SIDE * 2 + column / SIDE;
        packet * PACKET + row % SIDE * SIDE + column % SIDE
    }

    /// Row and column of a ray.
    pub fn place(ray: usize) -> (usize, usize) {
        let (packet, within) = (ray / PACKET, ray % PACKET);
        (packet / 2 * SIDE + within / SIDE, packet % 2 * SIDE + within % SIDE)
    }

    /// Direction of a ray.
    pub fn direction(&self, ray: usize) -> DVec3 {
        DVec3::new(1.0, self.u[ray], self.v[ray])
    }
}

/// Position and orientation of the sensor in the frame of a body.
pub struct View {
    /// Position of the sensor [m].
    pub origin: DVec3,
    /// Axes of the sensor frame.
    pub axes: [DVec3; 3],
}

impl View {
    /// View from a body's pose in the sensor frame.
    pub fn new(pose: &Pose) -> Self {
        Self {
            origin: pose.point_to_body(DVec3::ZERO),
            axes: [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| pose.direction_to_body(axis)),
        }
    }

    /// Direction in the frame of the body, as [`Pose::direction_to_body`] rounds it.
    #[cfg_attr(optimised, inline(always))]
    pub fn direction<V: Vector<Scalar = f64>>(&self, u: V, v: V) -> [V; 3] {
        let mut direction = [u; 3];
        for axis in 0..3 {
            let [x, y, z] = &self.axes;
            let (x, y, z) = (V::splat(x[axis]), V::splat(y[axis]), V::splat(z[axis]));
            direction[axis] = x.add(u.mul(y)).add(v.mul(z));
        }
        direction
    }
}

/// Rays of a tile ([`TileRays`]) in the frame of a body, in single precision.
///
/// Vectors come first, each on a cache line of its own.
#[repr(C, align(64))]
pub struct BodyRays {
    /// Directions, axis by axis.
    pub(super) directions: [[f32; MOST_RAYS]; 3],
    /// Inverses of directions; see [`Self::part`].
    inverses: [[f32; MOST_RAYS]; 3],
    pub(super) origin: [f32; 3],
    /// Bound of the coordinates of the origin.
    pub(super) reach: f32,
    /// Bound of the coordinates of directions.
    pub(super) length: f32,
    pub(super) valid: [u32; PACKETS],
    /// Centre and half the sides of the box round the directions of every packet, and of all.
    pub(super) center: [[f32; 3]; PACKETS + 1],
    pub(super) half: [[f32; 3]; PACKETS + 1],
    /// Slabs of every packet; see [`Self::part`].
    slabs: [Slabs; PACKETS],
    /// True once [`Self::part`] has prepared inverses and slabs.
    is_parted: bool,
}

impl BodyRays {
    /// Without rays.
    pub const EMPTY: Self = Self {
        directions: [[0.0; MOST_RAYS]; 3],
        inverses: [[0.0; MOST_RAYS]; 3],
        origin: [0.0; 3],
        reach: 0.0,
        length: 0.0,
        valid: [0; PACKETS],
        center: [[0.0; 3]; PACKETS + 1],
        half: [[0.0; 3]; PACKETS + 1],
        slabs: [Slabs::EMPTY; PACKETS],
        is_parted: false,
    };

    /// Transform rays to the frame of a body, with the origin relative to its point `middle`.
    #[cfg_attr(optimised, inline(always))]
    pub fn aim<I: Isa>(&mut self, rays: &TileRays, view: &View, middle: DVec3) {
        let origin = view.origin - middle;
        let axes = &view.axes;
        self.origin = [origin.x as f32, origin.y as f32, origin.z as f32];
        self.reach = origin.abs().max_element() as f32 * (1.0 + 2.0 * UNIT);
        self.valid = rays.valid;
        self.is_parted = false;
        for packet in 0..PACKETS {
            let first = packet * PACKET;
            let middle = first + PACKET / 2;
            let u = I::narrow(I::F64::load(&rays.u[first..]), I::F64::load(&rays.u[middle..]));
            let v = I::narrow(I::F64::load(&rays.v[first..]), I::F64::load(&rays.v[middle..]));
            for axis in 0..3 {
                let x = <I::F32 as Vector>::splat(axes[0][axis] as f32);
                let y = <I::F32 as Vector>::splat(axes[1][axis] as f32);
                let z = <I::F32 as Vector>::splat(axes[2][axis] as f32);
                let direction = v.mul_add(z, u.mul_add(y, x));
                direction.store(&mut self.directions[axis][first..]);
            }
        }
        // More than the rounding of directions.
        let length = rays.length();
        let pad = 8.0 * f64::from(UNIT) * length;
        for packet in 0..=PACKETS {
            let ([u, v], [du, dv]) = (rays.middle[packet], rays.half[packet]);
            for axis in 0..3 {
                let (x, y, z) = (axes[0][axis], axes[1][axis], axes[2][axis]);
                self.center[packet][axis] = (x + y * u + z * v) as f32;
                self.half[packet][axis] = (y.abs() * du + z.abs() * dv + pad) as f32;
            }
        }
        self.length = length as f32 * (1.0 + UNIT);
    }

    /// Prepare what tests of packets and of single rays need, if nothing has so far: few tiles over coarse meshes do.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn part<I: Isa>(&mut self) {
        if self.is_parted {
            return;
        }
        self.is_parted = true;
        let (most, least) = (<I::F32 as Vector>::splat(1e30), <I::F32 as Vector>::splat(-1e30));
        for packet in 0..PACKETS {
            self.slabs[packet] = self.slabs(packet);
            for axis in 0..3 {
                let direction = I::F32::load(&self.directions[axis][packet * PACKET..]);
                let inverse = <I::F32 as Vector>::splat(1.0).div(direction);
                let inverse = inverse.max(least).min(most);
                inverse.store(&mut self.inverses[axis][packet * PACKET..]);
            }
        }
    }

    /// Slabs of a packet, once they are prepared.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn slabs_of(&self, packet: usize) -> &Slabs {
        &self.slabs[packet]
    }

    /// Bit mask of the rays of a packet that meet the box of a child at most at distances `far`, once they are
    /// prepared.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn meet<I: Isa>(&self, packet: usize, node: &Node, place: usize, pad: f32, far: I::F32) -> u32 {
        let splat = <I::F32 as Vector>::splat;
        let first = packet * PACKET;
        let (mut entry, mut exit) = (splat(0.0), far);
        for axis in 0..3 {
            let inverse = I::F32::load(&self.inverses[axis][first..]);
            let low = splat(node.min[axis][place] - self.origin[axis] - pad);
            let high = splat(node.max[axis][place] - self.origin[axis] + pad);
            let (a, b) = (low.mul(inverse), high.mul(inverse));
            (entry, exit) = (entry.max(a.min(b)), exit.min(a.max(b)));
        }
        let is_met = entry
            .mul(splat(1.0 - 16.0 * UNIT))
            .at_most(exit.mul(splat(1.0 + 16.0 * UNIT)));
        is_met & self.valid[packet]
    }

    /// Box of the directions of a packet, or of all rays.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn slabs(&self, packet: usize) -> Slabs {
        let (center, half) = (&self.center[packet], &self.half[packet]);
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            (low[axis], high[axis]) = (center[axis] - half[axis], center[axis] + half[axis]);
        }
        Slabs::new(&self.origin, self.reach, &low, &high)
    }
}
