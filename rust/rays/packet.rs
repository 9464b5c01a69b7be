//! Packets: rays of a tile, 16 at a time, in the sensor frame and in body frames.

use glam::DVec3;

use crate::geometry::pose::Pose;
use crate::numeric::simd::{Isa, Vector};
use crate::rays::camera::{ImagePlane, PixelTile, TILE};
use crate::rays::traversal::Slabs;
use crate::rays::tree::Node;
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
const ROW_AND_COLUMN: [[f64; MOST_RAYS]; 2] = {
    let mut rows_and_columns = [[0.0; MOST_RAYS]; 2];
    let mut ray = 0;
    while ray < MOST_RAYS {
        let (packet, lane) = (ray / PACKET, ray % PACKET);
        rows_and_columns[0][ray] = (packet / 2 * SIDE + lane / SIDE) as f64;
        rows_and_columns[1][ray] = (packet % 2 * SIDE + lane % SIDE) as f64;
        ray += 1;
    }
    rows_and_columns
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
    /// Middle, and half of the extent, of `u` and `v` of every packet.
    middle: [[f64; 2]; PACKETS],
    half: [[f64; 2]; PACKETS],
}

impl TileRays {
    /// Without rays.
    pub const EMPTY: Self = Self {
        u: [0.0; MOST_RAYS],
        v: [0.0; MOST_RAYS],
        valid: [0; PACKETS],
        middle: [[0.0; 2]; PACKETS],
        half: [[0.0; 2]; PACKETS],
    };

    /// Aim rays through the centres of the pixels of a tile, in squares of 4 x 4.
    #[cfg_attr(optimised, inline(always))]
    pub fn generate<I: Isa>(&mut self, plane: &ImagePlane, tile: &PixelTile) {
        self.valid = [0; PACKETS];
        let splat = <I::F64 as Vector>::splat;
        let last_row = splat((tile.rows - 1) as f64);
        let last_column = splat((tile.columns - 1) as f64);
        let first_row = splat(tile.row as f64 + 0.5);
        let first_column = splat(tile.column as f64 + 0.5);
        for first in (0..MOST_RAYS).step_by(I::F64::LANES) {
            // The operations of `ImagePlane::center`.
            let row = I::F64::load(&ROW_AND_COLUMN[0][first..]);
            let column = I::F64::load(&ROW_AND_COLUMN[1][first..]);
            let u = splat(plane.axis_column).sub(column.min(last_column).add(first_column));
            let v = splat(plane.axis_row).sub(row.min(last_row).add(first_row));
            u.mul(splat(plane.du)).store(&mut self.u[first..]);
            v.mul(splat(plane.dv)).store(&mut self.v[first..]);
            let is_valid = row.at_most(last_row) & column.at_most(last_column);
            self.valid[first / PACKET] |= is_valid << (first % PACKET);
        }
        // Pixels of a packet fill a rectangle from its first to its last.
        for packet in 0..PACKETS {
            let (first, last) = (packet * PACKET, packet * PACKET + PACKET - 1);
            for (axis, coordinates) in [&self.u, &self.v].into_iter().enumerate() {
                self.middle[packet][axis] = 0.5 * (coordinates[first] + coordinates[last]);
                self.half[packet][axis] = 0.5 * (coordinates[first] - coordinates[last]);
            }
        }
    }

    /// Keep the packets of a bit mask; the others become invalid, and cost nothing.
    pub fn mask(&mut self, packets: u32) {
        for packet in 0..PACKETS {
            if packets >> packet & 1 == 0 {
                self.valid[packet] = 0;
            }
        }
    }

    /// Bit mask of the packets that have valid rays.
    #[cfg_attr(optimised, inline(always))]
    pub fn packets(&self) -> u32 {
        (0..PACKETS).fold(0, |bits, packet| bits | u32::from(self.valid[packet] != 0) << packet)
    }

    /// Aim rays through `number` points of the image plane, 1 to 64.
    #[cfg_attr(optimised, inline(always))]
    pub fn set_points(&mut self, number: usize, point: impl Fn(usize) -> [f64; 2]) {
        for ray in 0..MOST_RAYS {
            [self.u[ray], self.v[ray]] = point(ray.min(number - 1));
        }
        for packet in 0..PACKETS {
            let first = packet * PACKET;
            let in_packet = number.saturating_sub(first).min(PACKET);
            self.valid[packet] = (1 << in_packet) - 1;
            for (axis, coordinates) in [&self.u, &self.v].into_iter().enumerate() {
                let (mut low, mut high) = (coordinates[first], coordinates[first]);
                for ray in first..first + PACKET {
                    (low, high) = (low.min(coordinates[ray]), high.max(coordinates[ray]));
                }
                self.middle[packet][axis] = 0.5 * (low + high);
                self.half[packet][axis] = 0.5 * (high - low);
            }
        }
    }

    /// Smallest and largest `u`, and `v`, of the packets that have valid rays.
    #[cfg_attr(optimised, inline(always))]
    pub fn ranges(&self) -> [[f64; 2]; 2] {
        let mut ranges = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for packet in 0..PACKETS {
            if self.valid[packet] != 0 {
                for axis in 0..2 {
                    let (middle, half) = (self.middle[packet][axis], self.half[packet][axis]);
                    let [low, high] = ranges[axis];
                    ranges[axis] = [low.min(middle - half), high.max(middle + half)];
                }
            }
        }
        ranges
    }

    /// Slabs of all directions in the sensor frame.
    #[cfg_attr(optimised, inline(always))]
    pub fn slabs(&self) -> Slabs {
        let [u, v] = self.ranges();
        let low = [1.0, (u[0] as f32).next_down(), (v[0] as f32).next_down()];
        let high = [1.0, (u[1] as f32).next_up(), (v[1] as f32).next_up()];
        Slabs::new(&[0.0; 3], 0.0, &low, &high)
    }

    /// Number of the ray of a row and a column of the tile; the next columns follow to the end of the packet.
    pub fn ray(row: usize, column: usize) -> usize {
        let packet = row / SIDE * 2 + column / SIDE;
        packet * PACKET + row % SIDE * SIDE + column % SIDE
    }

    /// Direction of a ray.
    pub fn direction(&self, ray: usize) -> DVec3 {
        DVec3::new(1.0, self.u[ray], self.v[ray])
    }
}

/// Position and orientation of the sensor in the frame of a body.
pub struct SensorPose {
    /// Position of the sensor [m].
    pub origin: DVec3,
    /// Axes of the sensor frame.
    pub axes: [DVec3; 3],
}

impl SensorPose {
    /// Pose of the sensor from a body's pose in the sensor frame.
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
    /// Inverses of directions.
    inverses: [[f32; MOST_RAYS]; 3],
    pub(super) origin: [f32; 3],
    /// Bound of the coordinates of the origin.
    pub(super) max_coordinate: f32,
    /// Bound of the coordinates of directions.
    pub(super) length: f32,
    pub(super) valid: [u32; PACKETS],
    /// Centre and half the sides of the box round the directions of every packet, and its slabs.
    pub(super) center: [[f32; 3]; PACKETS],
    pub(super) half: [[f32; 3]; PACKETS],
    pub(super) slabs: [Slabs; PACKETS],
}

impl BodyRays {
    /// Without rays.
    pub const EMPTY: Self = Self {
        directions: [[0.0; MOST_RAYS]; 3],
        inverses: [[0.0; MOST_RAYS]; 3],
        origin: [0.0; 3],
        max_coordinate: 0.0,
        length: 0.0,
        valid: [0; PACKETS],
        center: [[0.0; 3]; PACKETS],
        half: [[0.0; 3]; PACKETS],
        slabs: [Slabs::EMPTY; PACKETS],
    };

    /// Transform rays to the frame of a body, with the origin relative to a point of the body.
    #[cfg_attr(optimised, inline(always))]
    pub fn transform<I: Isa>(&mut self, rays: &TileRays, view: &SensorPose, anchor: DVec3) {
        let splat = <I::F32 as Vector>::splat;
        let origin = view.origin - anchor;
        let axes = &view.axes;
        self.origin = [origin.x as f32, origin.y as f32, origin.z as f32];
        self.max_coordinate = origin.abs().max_element() as f32 * (1.0 + 2.0 * UNIT);
        self.valid = rays.valid;
        let [u, v] = rays.ranges();
        let length = 1.0 + u[0].abs().max(u[1].abs()) + v[0].abs().max(v[1].abs());
        self.length = length as f32 * (1.0 + UNIT);
        // More than the rounding of directions.
        let pad = 8.0 * f64::from(UNIT) * length;
        for packet in 0..PACKETS {
            let first = packet * PACKET;
            let second = first + PACKET / 2;
            let u = I::narrow(I::F64::load(&rays.u[first..]), I::F64::load(&rays.u[second..]));
            let v = I::narrow(I::F64::load(&rays.v[first..]), I::F64::load(&rays.v[second..]));
            let ([mu, mv], [du, dv]) = (rays.middle[packet], rays.half[packet]);
            let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
            for axis in 0..3 {
                let (x, y, z) = (axes[0][axis], axes[1][axis], axes[2][axis]);
                let direction = v.mul_add(splat(z as f32), u.mul_add(splat(y as f32), splat(x as f32)));
                direction.store(&mut self.directions[axis][first..]);
                let inverse = splat(1.0).div(direction).max(splat(-1e30)).min(splat(1e30));
                inverse.store(&mut self.inverses[axis][first..]);
                let center = (x + y * mu + z * mv) as f32;
                let half = (y.abs() * du + z.abs() * dv + pad) as f32;
                (self.center[packet][axis], self.half[packet][axis]) = (center, half);
                (low[axis], high[axis]) = (center - half, center + half);
            }
            self.slabs[packet] = Slabs::new(&self.origin, self.max_coordinate, &low, &high);
        }
    }

    /// True if any ray of a packet meets the box of a child at most at distances `far`; `max_coordinate` bounds the
    /// coordinates of the body.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn meets<I: Isa>(
        &self,
        packet: usize,
        node: &Node,
        slot: usize,
        max_coordinate: f32,
        far: I::F32,
    ) -> bool {
        let splat = <I::F32 as Vector>::splat;
        let first = packet * PACKET;
        // More than the rounding of directions moves a ray.
        let pad = 32.0 * UNIT * (max_coordinate + self.max_coordinate);
        let (mut entry, mut exit) = (splat(0.0), far);
        for axis in 0..3 {
            let inverse = I::F32::load(&self.inverses[axis][first..]);
            let low = splat(node.min[axis][slot] - self.origin[axis] - pad);
            let high = splat(node.max[axis][slot] - self.origin[axis] + pad);
            let (a, b) = (low.mul(inverse), high.mul(inverse));
            (entry, exit) = (entry.max(a.min(b)), exit.min(a.max(b)));
        }
        let entry = entry.mul(splat(1.0 - 16.0 * UNIT));
        entry.at_most(exit.mul(splat(1.0 + 16.0 * UNIT))) & self.valid[packet] != 0
    }
}
