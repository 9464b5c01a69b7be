//! Cells of a tile: hits of the rays through their centres, slopes of the phase, fields and weights.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use glam::DVec3;

use crate::numeric::simd::{Isa, Vector};
use crate::numeric::trig::cos_sin_turns;
use crate::rays::camera::{Cell, ImagePlane, PixelTile};
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS, TileRays};
use crate::rays::scene::NO_BODY;
use crate::rays::search::Scratch;
use crate::rays::tile_hits::HALF;
use crate::scattering::reflection_table::Reflection;
use crate::scattering::surface_image::SurfaceImage;
use crate::scattering::taper::{roll_off, tapers};

/// Smallest cosine of incidence at which a surface returns power.
pub(super) const MIN_COSINE: f64 = 1e-6;

/// Cells of a tile, in the order of its rays: packet by packet.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct TileCells {
    /// Plane coordinates of the centres.
    pub(super) u: [f64; MOST_RAYS],
    pub(super) v: [f64; MOST_RAYS],
    /// Lengths of the directions `(1, u, v)`.
    length: [f64; MOST_RAYS],
    /// Distances to the curved surface [m], and the shortest.
    pub(super) distance: [f64; MOST_RAYS],
    pub(super) shortest: f64,
    /// Unit normals on the incident side, axis by axis.
    pub(super) normal: [[f64; MOST_RAYS]; 3],
    /// Cosine of incidence, and the same as it was found.
    pub(super) cosine: [f32; MOST_RAYS],
    facing: [f64; MOST_RAYS],
    /// Half of what the phase turns over a cell, along u and v [rad].
    pub(super) slope: [[f32; MOST_RAYS]; 2],
    /// Least magnitude of the slopes while the body turns, and a bit per cell whose body turns.
    pub(super) least_slope: [[f32; MOST_RAYS]; 2],
    pub(super) turning: u64,
    /// Phase relative to the shortest distance [rad].
    pub(super) phase: [f32; MOST_RAYS],
    /// Reflection coefficient.
    pub(super) reflection: [[f32; MOST_RAYS]; 2],
    /// Field per solid angle times distance squared, relative to a conductor where the gain is largest [m^2]; zero
    /// without a hit.
    pub(super) field: [f32; MOST_RAYS],
    pub(super) body: [u32; MOST_RAYS],
    /// Number of the surface without sharp edges that is hit: of a flat region, or of the rest of the body.
    pub(super) surface: [u32; MOST_RAYS],
    pub(super) triangle: [u32; MOST_RAYS],
    /// A bit per cell with a ray, and with a hit that returns power.
    pub(super) valid: u64,
    pub(super) hit: u64,
    /// Weight of every cell over `j Gamma` [m^2]: `dA / 8 pi`, times the tapers once they are weighed.
    pub(super) weight: [f32; MOST_RAYS],
}

impl TileCells {
    pub(super) const EMPTY: Self = Self {
        u: [0.0; MOST_RAYS],
        v: [0.0; MOST_RAYS],
        length: [1.0; MOST_RAYS],
        distance: [0.0; MOST_RAYS],
        shortest: 0.0,
        normal: [[0.0; MOST_RAYS]; 3],
        cosine: [0.0; MOST_RAYS],
        facing: [0.0; MOST_RAYS],
        slope: [[0.0; MOST_RAYS]; 2],
        least_slope: [[0.0; MOST_RAYS]; 2],
        turning: 0,
        phase: [0.0; MOST_RAYS],
        reflection: [[0.0; MOST_RAYS]; 2],
        field: [0.0; MOST_RAYS],
        body: [NO_BODY; MOST_RAYS],
        surface: [0; MOST_RAYS],
        triangle: [0; MOST_RAYS],
        valid: 0,
        hit: 0,
        weight: [0.0; MOST_RAYS],
    };

    /// Take over the hits of rays.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub(super) fn take(&mut self, scratch: &Scratch) {
        self.aim(&scratch.rays);
        self.body.copy_from_slice(scratch.hits.body.as_flattened());
        self.triangle.copy_from_slice(scratch.hits.triangle.as_flattened());
        self.length = scratch.measured.length;
        self.distance = scratch.measured.surface_distance;
        self.normal = scratch.measured.normal;
        self.facing = scratch.measured.cosine;
    }

    /// Take over the pixels of a tile of an image of another program, whose numbers stand in place of triangles.
    pub(super) fn read(&mut self, rays: &TileRays, image: &SurfaceImage, tile: &PixelTile) {
        self.aim(rays);
        self.body = [NO_BODY; MOST_RAYS];
        for cell in 0..MOST_RAYS {
            self.length[cell] = rays.direction(cell).length();
        }
        for row in 0..tile.rows {
            for column in 0..tile.columns {
                let cell = TileRays::ray(row, column);
                let pixel = (tile.row + row) * image.plane.columns + tile.column + column;
                self.body[cell] = image.body_of(pixel);
                self.triangle[cell] = pixel as u32;
                self.distance[cell] = image.distance[pixel];
                let reflection = image.reflection[pixel];
                (self.reflection[0][cell], self.reflection[1][cell]) = (reflection.re as f32, reflection.im as f32);
                let normal = image.normal[pixel];
                for axis in 0..3 {
                    self.normal[axis][cell] = normal[axis];
                }
                self.facing[cell] = -normal.dot(rays.direction(cell)) / self.length[cell];
            }
        }
    }

    #[cfg_attr(optimised, inline(always))]
    fn aim(&mut self, rays: &TileRays) {
        (self.u, self.v, self.valid) = (rays.u, rays.v, 0);
        for packet in 0..PACKETS {
            self.valid |= u64::from(rays.valid[packet]) << (packet * PACKET);
        }
    }

    /// Evaluate the hits of a tile; `gain`: relative two-way field gain in its middle.
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub(super) fn evaluate<I: Isa>(
        &mut self,
        plane: &ImagePlane,
        wavenumber: f64,
        gain: f64,
        (reflections, turns): (&[Reflection], &[f32]),
    ) {
        self.face::<I>();
        if self.hit == 0 {
            return;
        }
        self.measure::<I>(plane, wavenumber, gain);
        self.follow::<I>(plane, wavenumber, reflections, turns);
        for first in (0..MOST_RAYS).step_by(PACKET) {
            let field = I::F32::load(&self.field[first..]);
            let re = I::F32::load(&self.reflection[0][first..]);
            let im = I::F32::load(&self.reflection[1][first..]);
            let magnitude = re.mul(re).add(im.mul(im)).sqrt();
            field.mul(magnitude).store(&mut self.field[first..]);
        }
    }

    /// Find the cells that return power.
    #[cfg_attr(optimised, inline(always))]
    fn face<I: Isa>(&mut self) {
        let zero = <I::F64 as Vector>::splat(0.0);
        let far = <I::F64 as Vector>::splat(f64::INFINITY);
        let mut shortest = far;
        (self.hit, self.turning) = (0, 0);
        for packet in 0..PACKETS {
            let valid = (self.valid >> (packet * PACKET)) as u32 & 0xffff;
            let found = valid & !I::equal(&self.bodies(packet), NO_BODY);
            if found == 0 {
                continue;
            }
            for first in [packet * PACKET, packet * PACKET + HALF] {
                let facing = I::F64::load(&self.facing[first..]);
                let distance = I::F64::load(&self.distance[first..]);
                let is_lit = found >> (first % PACKET)
                    & <I::F64 as Vector>::splat(MIN_COSINE).at_most(facing)
                    & <I::F64 as Vector>::splat(f64::MIN_POSITIVE).at_most(distance)
                    & 0xff;
                self.hit |= u64::from(is_lit) << first;
                shortest = shortest.min(distance.select(is_lit, far));
            }
        }
        self.shortest = -zero.sub(shortest).largest();
    }

    /// Slopes, phases, fields and weights of the hits without reflection and tapers.
    #[cfg_attr(optimised, inline(always))]
    fn measure<I: Isa>(&mut self, plane: &ImagePlane, wavenumber: f64, gain: f64) {
        let (zero, one) = (<I::F64 as Vector>::splat(0.0), <I::F64 as Vector>::splat(1.0));
        for packet in 0..PACKETS {
            let first = packet * PACKET;
            if self.hits(packet) == 0 {
                // Numbers of cells without a hit stay finite; their fields are zero.
                self.clear(first..first + PACKET);
                continue;
            }
            let mut halves = [[zero; 6]; 2];
            for half in 0..2 {
                let at = first + half * HALF;
                let is_hit = (self.hit >> at) as u32 & 0xff;
                let splat = <I::F64 as Vector>::splat;
                let (u, v) = (I::F64::load(&self.u[at..]), I::F64::load(&self.v[at..]));
                let w = one.div(I::F64::load(&self.length[at..]));
                let nearest = splat(self.shortest);
                let distance = I::F64::load(&self.distance[at..]).select(is_hit, nearest);
                let c = I::F64::load(&self.facing[at..]).select(is_hit, one);
                let lit = one.select(is_hit, zero);
                let along = distance.mul(w).mul(splat(wavenumber)).mul(lit);
                let over = one.div(c);
                let [_, y, z] = &self.normal;
                let y = I::F64::load(&y[at..]).select(is_hit, zero);
                let z = I::F64::load(&z[at..]).select(is_hit, zero);
                let square = distance.mul(distance).mul(lit);
                let cube = w.mul(w).mul(w);
                halves[half] = [
                    c,
                    along.mul(splat(plane.du)).mul(y.mul(over).add(u.mul(w))),
                    along.mul(splat(plane.dv)).mul(z.mul(over).add(v.mul(w))),
                    distance.sub(nearest).mul(splat(2.0 * wavenumber)),
                    square.mul(splat(gain)),
                    square.mul(cube).mul(over).mul(splat(plane.du * plane.dv / (8.0 * PI))),
                ];
                distance.store(&mut self.distance[at..]);
            }
            let [low, high] = halves;
            I::narrow(low[0], high[0]).store(&mut self.cosine[first..]);
            for axis in 0..2 {
                let slope = I::narrow(low[1 + axis], high[1 + axis]);
                slope.store(&mut self.slope[axis][first..]);
                magnitude(slope).store(&mut self.least_slope[axis][first..]);
            }
            I::narrow(low[3], high[3]).store(&mut self.phase[first..]);
            I::narrow(low[4], high[4]).store(&mut self.field[first..]);
            I::narrow(low[5], high[5]).store(&mut self.weight[first..]);
        }
    }

    /// Clear the numbers of cells without a hit.
    #[cfg_attr(optimised, inline(always))]
    fn clear(&mut self, cells: Range<usize>) {
        self.cosine[cells.clone()].fill(1.0);
        for axis in 0..2 {
            self.slope[axis][cells.clone()].fill(0.0);
            self.least_slope[axis][cells.clone()].fill(0.0);
        }
        self.phase[cells.clone()].fill(0.0);
        self.field[cells.clone()].fill(0.0);
        self.weight[cells.clone()].fill(0.0);
        self.distance[cells].fill(self.shortest);
    }

    /// Remove the hit of a cell.
    pub(super) fn remove(&mut self, cell: usize) {
        self.hit &= !(1 << cell);
        self.clear(cell..cell + 1);
    }

    /// Reflection coefficients of the materials, and least slopes of cells whose bodies turn.
    #[cfg_attr(optimised, inline(always))]
    fn follow<I: Isa>(&mut self, plane: &ImagePlane, wavenumber: f64, reflections: &[Reflection], turns: &[f32]) {
        let mut rest = self.hit;
        while rest != 0 {
            // All cells of a body at once.
            let body = self.body[rest.trailing_zeros() as usize];
            let mut mine = self.hits_of::<I>(body);
            rest &= !mine;
            // Pixels of images have reflections of their own.
            let Some(reflection) = reflections.get(body as usize) else {
                continue;
            };
            let turn = turns[body as usize];
            if turn > 0.0 {
                self.turning |= mine;
            }
            while mine != 0 {
                let i = mine.trailing_zeros() as usize;
                mine &= mine - 1;
                let [re, im] = match reflection {
                    Reflection::Constant(reflection) => *reflection,
                    other => other.at(self.cosine[i], || (self.normal_of(i), self.direction(i))),
                };
                (self.reflection[0][i], self.reflection[1][i]) = (re, im);
                if turn > 0.0 {
                    for (axis, width) in [plane.du, plane.dv].into_iter().enumerate() {
                        let change = turn * (wavenumber * self.distance[i] * width) as f32;
                        self.least_slope[axis][i] = (self.least_slope[axis][i] - change).max(0.0);
                    }
                }
            }
        }
    }

    /// Weights of the cells of the tile with the taper of their slopes; cells of weight zero make no point. Points of
    /// bodies that turn get the mean over the phase of their cell when they are evaluated.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn weigh<I: Isa>(&mut self) {
        for packet in 0..PACKETS {
            if self.hits(packet) == 0 {
                continue;
            }
            let first = packet * PACKET;
            let u = I::F32::load(&self.least_slope[0][first..]);
            let v = I::F32::load(&self.least_slope[1][first..]);
            let turning = (self.turning >> first) as u32 & 0xffff;
            let mut factor = tapers(u).mul(tapers(v));
            if turning != 0 {
                factor = roll_off(u).mul(roll_off(v)).select(turning, factor);
            }
            let weight = I::F32::load(&self.weight[first..]);
            weight.mul(factor).store(&mut self.weight[first..]);
        }
    }

    /// A bit per cell of a packet with a hit.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn hits(&self, packet: usize) -> u32 {
        (self.hit >> (packet * PACKET)) as u32 & 0xffff
    }

    /// A bit per cell of a packet whose weight is not zero, once cells are weighed.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn with_weight<I: Isa>(&self, packet: usize) -> u32 {
        let first = packet * PACKET;
        let weight = I::F32::load(&self.weight[first..]);
        let [re, im] = &self.reflection;
        let reflection = magnitude(I::F32::load(&re[first..])).max(magnitude(I::F32::load(&im[first..])));
        self.hits(packet) & !weight.mul(reflection).at_most(<I::F32 as Vector>::splat(0.0))
    }

    /// A bit per cell with a hit of a body.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn hits_of<I: Isa>(&self, body: u32) -> u64 {
        let mut hits = 0;
        for packet in 0..PACKETS {
            hits |= u64::from(I::equal(&self.bodies(packet), body) & 0xffff) << (packet * PACKET);
        }
        hits & self.hit
    }

    /// Bodies of the cells of a packet.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn bodies(&self, packet: usize) -> [u32; PACKET] {
        let mut bodies = [NO_BODY; PACKET];
        bodies.copy_from_slice(&self.body[packet * PACKET..(packet + 1) * PACKET]);
        bodies
    }

    /// Scattering length of all cells together, `sum Gamma cos dA T T exp(-j phi)`, magnitude [m^2].
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn scattering_length(&self) -> f64 {
        let mut turns = [0.0; MOST_RAYS];
        for i in 0..MOST_RAYS {
            turns[i] = f64::from(self.phase[i]) / TAU;
        }
        let (cosine, sine) = cos_sin_turns::<f32, MOST_RAYS>(&turns);
        let mut sum = [0.0_f32; 2];
        for i in 0..MOST_RAYS {
            let one = if self.hit >> i & 1 == 1 { 1.0 } else { 0.0 };
            let field = one * self.weight[i] * self.cosine[i];
            let (re, im) = (self.reflection[0][i], self.reflection[1][i]);
            sum[0] += field * (re * cosine[i] + im * sine[i]);
            sum[1] += field * (im * cosine[i] - re * sine[i]);
        }
        8.0 * PI * f64::from(sum[0].hypot(sum[1]))
    }

    /// Unit direction through the centre of a cell.
    pub(super) fn direction(&self, cell: usize) -> DVec3 {
        DVec3::new(1.0, self.u[cell], self.v[cell]).normalize()
    }

    /// Rectangle of a plane that a cell covers.
    pub(super) fn cell(&self, cell: usize, plane: &ImagePlane) -> Cell {
        Cell {
            u: self.u[cell],
            v: self.v[cell],
            du: plane.du,
            dv: plane.dv,
        }
    }

    /// Area of the surface behind a cell [m^2].
    pub(super) fn area(&self, cell: usize, plane: &ImagePlane) -> f64 {
        let (distance, rectangle) = (self.distance[cell], self.cell(cell, plane));
        let cosine = -self.normal_of(cell).dot(rectangle.direction());
        distance * distance * rectangle.solid_angle() / cosine
    }

    /// Edges of the surface behind a cell, along u and v [m].
    pub(super) fn edges(&self, cell: usize, plane: &ImagePlane) -> [DVec3; 2] {
        self.cell(cell, plane).edges(self.distance[cell], self.normal_of(cell))
    }

    /// Unit normal at the hit of a cell.
    pub(super) fn normal_of(&self, cell: usize) -> DVec3 {
        DVec3::new(self.normal[0][cell], self.normal[1][cell], self.normal[2][cell])
    }
}

/// Magnitudes of numbers.
#[cfg_attr(optimised, inline(always))]
pub(super) fn magnitude<V: Vector<Scalar = f32>>(numbers: V) -> V {
    numbers.max(V::splat(0.0).sub(numbers))
}
