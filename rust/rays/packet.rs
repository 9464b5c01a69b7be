//! Packets: rays of one origin that traverse a tree together, all children of a node, and 16 rays, at a time.
//!
//! The search is in single precision with bounds on every rounding. Where these cannot tell whether a ray meets a
//! triangle, or which of two triangles is nearer, an exact test decides, so that hits equal those of rays traced one by
//! one.

use glam::DVec3;

use crate::geometry::pose::Pose;
use crate::numeric::simd::{Isa, Vector, prefetch};
use crate::rays::camera::{ImagePlane, TILE, Tile};
use crate::rays::traversal::{Slabs, Visit, traverse};
use crate::rays::tree::{Node, Tree};
use crate::rays::triangle_block::{Table, TriangleBlock, UNIT};

/// Rays of a packet, tested at once in vectors.
pub const PACKET: usize = 16;
/// Packets of a tile.
pub const PACKETS: usize = 4;
/// Most rays of a tile.
pub const MOST_RAYS: usize = PACKET * PACKETS;

/// Side of the square of pixels that a packet holds.
const SIDE: usize = TILE / 2;

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
    #[inline(always)]
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

    /// Aim rays through at most 64 points of the image plane, in order.
    #[inline(always)]
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
    #[inline(always)]
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
    #[inline(always)]
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
#[repr(C, align(64))]
pub struct BodyRays {
    origin: [f32; 3],
    /// Bound of the coordinates of the origin.
    reach: f32,
    /// Bound of the coordinates of directions.
    length: f32,
    /// Directions, axis by axis.
    directions: [[f32; MOST_RAYS]; 3],
    /// Inverses of directions; set if the tree is fine.
    inverses: [[f32; MOST_RAYS]; 3],
    valid: [u32; PACKETS],
    /// Centre and half the sides of the box round the directions of every packet, and of all.
    center: [[f32; 3]; PACKETS + 1],
    half: [[f32; 3]; PACKETS + 1],
}

impl BodyRays {
    /// Without rays.
    pub const EMPTY: Self = Self {
        origin: [0.0; 3],
        reach: 0.0,
        length: 0.0,
        directions: [[0.0; MOST_RAYS]; 3],
        inverses: [[0.0; MOST_RAYS]; 3],
        valid: [0; PACKETS],
        center: [[0.0; 3]; PACKETS + 1],
        half: [[0.0; 3]; PACKETS + 1],
    };

    /// Transform rays to the frame of a body, with the origin relative to its point `middle`.
    #[inline(always)]
    pub fn aim<I: Isa>(&mut self, rays: &TileRays, view: &View, middle: DVec3, is_fine: bool) {
        let origin = view.origin - middle;
        let axes = &view.axes;
        self.origin = [origin.x as f32, origin.y as f32, origin.z as f32];
        self.reach = origin.abs().max_element() as f32 * (1.0 + 2.0 * UNIT);
        self.valid = rays.valid;
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
                if is_fine {
                    let inverse = <I::F32 as Vector>::splat(1.0).div(direction);
                    let most = <I::F32 as Vector>::splat(1e30);
                    let least = <I::F32 as Vector>::splat(-1e30);
                    inverse.max(least).min(most).store(&mut self.inverses[axis][first..]);
                }
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

    /// Box of the directions of a packet, or of all rays.
    #[inline(always)]
    fn slabs(&self, packet: usize) -> Slabs {
        let (center, half) = (&self.center[packet], &self.half[packet]);
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            (low[axis], high[axis]) = (center[axis] - half[axis], center[axis] + half[axis]);
        }
        Slabs::new(&self.origin, self.reach, &low, &high)
    }
}

/// Nearest triangles of the rays of a tile, over all bodies.
#[repr(C, align(64))]
pub struct PacketHits {
    /// Lower bound of the distance of the hit so far, in lengths of the direction; infinite without one.
    near: [f32; MOST_RAYS],
    /// Upper bound of the distance.
    far: [f32; MOST_RAYS],
    /// Largest upper bound of every packet.
    farthest: [f32; PACKETS],
    /// Number of the body.
    pub body: [[u32; PACKET]; PACKETS],
    /// Number of its triangle.
    pub triangle: [[u32; PACKET]; PACKETS],
    /// A bit per ray that lies in the plane of its triangle.
    pub edge_on: [u32; PACKETS],
}

impl PacketHits {
    /// Hits of no rays.
    pub const EMPTY: Self = Self {
        near: [f32::INFINITY; MOST_RAYS],
        far: [f32::INFINITY; MOST_RAYS],
        farthest: [f32::NEG_INFINITY; PACKETS],
        body: [[u32::MAX; PACKET]; PACKETS],
        triangle: [[u32::MAX; PACKET]; PACKETS],
        edge_on: [0; PACKETS],
    };

    /// Clear all hits of the valid rays.
    #[inline(always)]
    pub fn clear<I: Isa>(&mut self, valid: &[u32; PACKETS]) {
        for packet in 0..PACKETS {
            let all = packet * PACKET..(packet + 1) * PACKET;
            let everywhere = <I::F32 as Vector>::splat(f32::INFINITY);
            let nowhere = <I::F32 as Vector>::splat(f32::NEG_INFINITY);
            everywhere.store(&mut self.near[all.clone()]);
            everywhere.select(valid[packet], nowhere).store(&mut self.far[all]);
            I::put(&mut self.body[packet], u32::MAX, u32::MAX);
            I::put(&mut self.triangle[packet], u32::MAX, u32::MAX);
            self.edge_on[packet] = 0;
            self.farthest[packet] = if valid[packet] == 0 {
                f32::NEG_INFINITY
            } else {
                f32::INFINITY
            };
        }
    }

    /// Distance beyond which no ray can find a nearer triangle.
    #[inline(always)]
    pub fn farthest(&self) -> f32 {
        let [a, b, c, d] = self.farthest;
        a.max(b).max(c.max(d))
    }
}

impl<E: Exact, const P: usize> Search<'_, E, P> {
    /// Number of the box round the directions of all packets of the search; see [`BodyRays::center`].
    #[inline(always)]
    fn all(&self) -> usize {
        const { assert!(P == PACKETS || P == 1) };
        if P == PACKETS { PACKETS } else { self.from }
    }

    /// Distance beyond which no ray can find a nearer triangle.
    #[inline(always)]
    fn farthest(&self) -> f32 {
        let mut farthest = self.best.farthest[self.from];
        for packet in self.from + 1..self.from + P {
            farthest = farthest.max(self.best.farthest[packet]);
        }
        farthest
    }

    /// Visit all leaves whose boxes any ray may meet, near ones first.
    #[inline(always)]
    pub fn traverse<I: Isa>(&mut self, tree: &Tree, stack: &mut Vec<u64>) {
        let (slabs, far) = (self.rays.slabs(self.all()), self.farthest());
        traverse::<I>(&slabs, tree, far, stack, self);
    }

    /// True if any ray meets the box of a child before its hit so far.
    #[inline(always)]
    fn some_ray_meets<I: Isa>(&self, node: &Node, place: usize) -> bool {
        let splat = <I::F32 as Vector>::splat;
        let rays = self.rays;
        // More than the rounding of directions moves a ray within reach.
        let pad = 32.0 * UNIT * (self.reach + rays.reach);
        let mut sides = [[splat(0.0); 2]; 3];
        for axis in 0..3 {
            sides[axis] = [
                splat(node.min[axis][place] - rays.origin[axis] - pad),
                splat(node.max[axis][place] - rays.origin[axis] + pad),
            ];
        }
        for packet in self.from..self.from + P {
            let first = packet * PACKET;
            let (mut entry, mut exit) = (splat(0.0), I::F32::load(&self.best.far[first..]));
            for axis in 0..3 {
                let inverse = I::F32::load(&rays.inverses[axis][first..]);
                let (a, b) = (sides[axis][0].mul(inverse), sides[axis][1].mul(inverse));
                (entry, exit) = (entry.max(a.min(b)), exit.min(a.max(b)));
            }
            let is_met = entry
                .mul(splat(1.0 - 16.0 * UNIT))
                .at_most(exit.mul(splat(1.0 + 16.0 * UNIT)));
            if is_met & rays.valid[packet] != 0 {
                return true;
            }
        }
        false
    }
}

impl PacketHits {
    /// Decide by the exact test whether a triangle is the nearest of a ray so far; of several at one distance the
    /// first.
    #[inline(never)]
    fn decide(&mut self, packet: usize, lane: usize, body: u32, triangle: u32, exact: &impl Exact) -> bool {
        let ray = packet * PACKET + lane;
        let Some((distance, is_edge_on)) = exact.distance(ray, body, triangle) else {
            return false;
        };
        if distance > f64::from(self.far[ray]) {
            return false;
        }
        if distance >= f64::from(self.near[ray]) {
            let before = (self.body[packet][lane], self.triangle[packet][lane]);
            let other = exact.distance(ray, before.0, before.1);
            let other = other.map_or(f64::INFINITY, |(distance, _)| distance);
            if distance > other || (distance == other && before <= (body, triangle)) {
                return false;
            }
        }
        self.near[ray] = (distance as f32).next_down();
        self.far[ray] = (distance as f32).next_up();
        (self.body[packet][lane], self.triangle[packet][lane]) = (body, triangle);
        self.edge_on[packet] = self.edge_on[packet] & !(1 << lane) | u32::from(is_edge_on) << lane;
        true
    }
}

/// Exact test of a ray and a triangle.
pub trait Exact {
    /// Distance of a triangle of a body in lengths of the direction, and whether the ray lies in the triangle's plane;
    /// none if the ray misses.
    fn distance(&self, ray: usize, body: u32, triangle: u32) -> Option<(f64, bool)>;
}

/// Search for the nearest triangles of one body, for `P` packets: all of a tile together, or one.
pub struct Search<'a, E, const P: usize> {
    /// Rays in the frame of the body.
    pub rays: &'a BodyRays,
    /// First packet.
    pub from: usize,
    /// Triangle block of every leaf.
    pub leaves: &'a [TriangleBlock],
    /// Bound of the coordinates of the triangles.
    pub reach: f32,
    /// Number of the body.
    pub body: u32,
    /// True if leaves are so small that rays of a tile may pass between them.
    pub is_fine: bool,
    /// Distance at or below which there are no hits.
    pub start: f32,
    /// Hits so far.
    pub best: &'a mut PacketHits,
    /// Exact test.
    pub exact: &'a E,
    /// Planes of the triangle block at hand.
    pub table: &'a mut Table,
    /// Number of leaves visited.
    pub num_leaves: usize,
}

impl<E: Exact, const P: usize> Visit for Search<'_, E, P> {
    #[inline(always)]
    fn expects<I: Isa>(&self, leaf: usize, node: &Node, place: usize) -> bool {
        if self.is_fine && !self.some_ray_meets::<I>(node, place) {
            return false;
        }
        prefetch(&self.leaves[leaf]);
        true
    }

    #[inline(always)] // part of a kernel
    fn visit<I: Isa>(&mut self, leaf: usize, count: usize, near: f32) -> f32 {
        self.num_leaves += 1;
        let (rays, leaf) = (self.rays, &self.leaves[leaf]);
        let planes = leaf.planes::<I>(&rays.origin, self.reach + rays.reach, rays.length);
        let all = planes.may_meet(&rays.center[self.all()], &rays.half[self.all()]) & ((1 << count) - 1);
        if all == 0 {
            return self.farthest();
        }
        planes.store(self.table);
        let table = &*self.table;
        for packet in self.from..self.from + P {
            if near > self.best.farthest[packet] {
                continue;
            }
            let mut triangles = all;
            if P > 1 {
                triangles &= planes.may_meet(&rays.center[packet], &rays.half[packet]);
                if triangles == 0 {
                    continue;
                }
            }
            let first = packet * PACKET;
            let mut directions = [<I::F32 as Vector>::splat(0.0); 3];
            for axis in 0..3 {
                directions[axis] = I::F32::load(&rays.directions[axis][first..]);
            }
            let mut has_changed = false;
            while triangles != 0 {
                let lane = triangles.trailing_zeros() as usize;
                triangles &= triangles - 1;
                let number = leaf.triangles[lane];
                let (mut unsure, least) = table.meet(lane, &directions);
                if planes.unclear >> lane & 1 == 1 {
                    unsure = table.meet_unclear(lane, &directions) & rays.valid[packet];
                } else {
                    unsure &= rays.valid[packet];
                    if unsure == 0 {
                        continue;
                    }
                    let crossing = table.cross(lane, &directions, least);
                    let best_near = I::F32::load(&self.best.near[first..]);
                    let best_far = I::F32::load(&self.best.far[first..]);
                    let is_behind = best_far.at_most(crossing.near) & crossing.measured;
                    let is_nearest = unsure
                        & crossing.measured
                        & crossing.certain
                        & crossing.far.at_most(best_near)
                        & <I::F32 as Vector>::splat(self.start).at_most(crossing.near);
                    if is_nearest != 0 {
                        crossing
                            .near
                            .select(is_nearest, best_near)
                            .store(&mut self.best.near[first..]);
                        crossing
                            .far
                            .select(is_nearest, best_far)
                            .store(&mut self.best.far[first..]);
                        I::put(&mut self.best.body[packet], is_nearest, self.body);
                        I::put(&mut self.best.triangle[packet], is_nearest, number);
                        self.best.edge_on[packet] &= !is_nearest;
                        has_changed = true;
                    }
                    unsure &= !(is_behind | is_nearest);
                }
                while unsure != 0 {
                    let ray = unsure.trailing_zeros() as usize;
                    unsure &= unsure - 1;
                    has_changed |= self.best.decide(packet, ray, self.body, number, self.exact);
                }
            }
            if has_changed {
                self.best.farthest[packet] = I::F32::load(&self.best.far[first..]).largest();
            }
        }
        self.farthest()
    }
}
