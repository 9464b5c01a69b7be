//! Cells of a tile: hits of the rays through their centres, slopes of the phase, fields and weights.

use std::f64::consts::PI;

use glam::DVec3;

use crate::numeric::simd::Isa;
use crate::rays::camera::ImagePlane;
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS};
use crate::rays::scene::NO_BODY;
use crate::rays::search::Scratch;
use crate::scattering::patch::MIN_COSINE;
use crate::scattering::reflection_table::Reflection;
use crate::scattering::taper::{roll_off_f32, taper_f32};

/// Cells of a tile, in the order of its rays: packet by packet.
pub(super) struct Cells {
    /// Plane coordinates of the centres.
    pub(super) u: [f64; MOST_RAYS],
    pub(super) v: [f64; MOST_RAYS],
    /// Distances to the curved surface [m], and the shortest.
    pub(super) distance: [f64; MOST_RAYS],
    pub(super) shortest: f64,
    /// Unit normals on the incident side, axis by axis.
    pub(super) normal: [[f64; MOST_RAYS]; 3],
    /// Cosine of incidence.
    pub(super) cosine: [f32; MOST_RAYS],
    /// Half of what the phase turns over a cell, along u and v [rad].
    pub(super) slope: [[f32; MOST_RAYS]; 2],
    /// Least magnitude of the slopes while the body turns, and a bit per cell whose body turns.
    pub(super) least_slope: [[f32; MOST_RAYS]; 2],
    pub(super) turning: u64,
    /// Phase beyond that of the shortest distance [rad].
    pub(super) phase: [f32; MOST_RAYS],
    /// Reflection coefficient.
    pub(super) reflection: [[f32; MOST_RAYS]; 2],
    /// Field per solid angle times distance squared, relative to a conductor where the gain is largest [m^2]; zero
    /// without a hit.
    pub(super) field: [f32; MOST_RAYS],
    pub(super) body: [u32; MOST_RAYS],
    pub(super) triangle: [u32; MOST_RAYS],
    /// A bit per cell with a ray, and with a hit that returns power.
    pub(super) valid: u64,
    pub(super) hit: u64,
    /// Largest weight factor `(1/8 pi) dA T T` of every cell [m^2]; see [`Self::weigh`].
    pub(super) weight: [f32; MOST_RAYS],
}

impl Cells {
    pub(super) const EMPTY: Self = Self {
        u: [0.0; MOST_RAYS],
        v: [0.0; MOST_RAYS],
        distance: [0.0; MOST_RAYS],
        shortest: 0.0,
        normal: [[0.0; MOST_RAYS]; 3],
        cosine: [0.0; MOST_RAYS],
        slope: [[0.0; MOST_RAYS]; 2],
        least_slope: [[0.0; MOST_RAYS]; 2],
        turning: 0,
        phase: [0.0; MOST_RAYS],
        reflection: [[0.0; MOST_RAYS]; 2],
        field: [0.0; MOST_RAYS],
        body: [NO_BODY; MOST_RAYS],
        triangle: [0; MOST_RAYS],
        valid: 0,
        hit: 0,
        weight: [0.0; MOST_RAYS],
    };

    /// Evaluate the hits of a tile; `gain`: relative two-way field gain in its middle.
    #[inline(always)] // part of a kernel
    pub(super) fn evaluate<I: Isa>(
        &mut self,
        scratch: &Scratch,
        plane: &ImagePlane,
        wavenumber: f64,
        gain: f64,
        (reflections, turns): (&[Reflection], &[f32]),
    ) {
        self.u = scratch.rays.u;
        self.v = scratch.rays.v;
        self.body = scratch
            .best
            .body
            .as_flattened()
            .try_into()
            .unwrap_or([NO_BODY; MOST_RAYS]);
        self.triangle = scratch
            .best
            .triangle
            .as_flattened()
            .try_into()
            .unwrap_or([0; MOST_RAYS]);
        self.distance = scratch.shade.distance;
        self.normal = *scratch.shade.normal();
        (self.valid, self.hit) = (0, 0);
        for packet in 0..PACKETS {
            self.valid |= u64::from(scratch.rays.valid[packet]) << (packet * PACKET);
            self.hit |= u64::from(!I::equal(&scratch.best.body[packet], NO_BODY) & 0xffff) << (packet * PACKET);
        }
        self.hit &= self.valid;

        let mut inverse = [0.0_f64; MOST_RAYS];
        let mut cosine = [0.0_f64; MOST_RAYS];
        for i in 0..MOST_RAYS {
            let (u, v) = (self.u[i], self.v[i]);
            inverse[i] = 1.0 / (1.0 + u * u + v * v).sqrt();
            cosine[i] = -(self.normal[0][i] + u * self.normal[1][i] + v * self.normal[2][i]) * inverse[i];
        }
        self.shortest = f64::INFINITY;
        for i in 0..MOST_RAYS {
            let is_lit = (self.hit >> i & 1 == 1) && cosine[i] >= MIN_COSINE && self.distance[i] > 0.0;
            self.hit &= !(u64::from(!is_lit) << i);
            let distance = if is_lit { self.distance[i] } else { f64::INFINITY };
            self.shortest = if distance < self.shortest {
                distance
            } else {
                self.shortest
            };
        }
        let shortest = if self.hit == 0 { 0.0 } else { self.shortest };
        for i in 0..MOST_RAYS {
            // Numbers of cells without a hit stay finite; their fields are zero.
            let is_hit = self.hit >> i & 1 == 1;
            let distance = if is_hit { self.distance[i] } else { shortest };
            let (u, v, w) = (self.u[i], self.v[i], inverse[i]);
            let c = if is_hit { cosine[i] } else { 1.0 };
            let along = wavenumber * distance * w;
            let one = if is_hit { 1.0 } else { 0.0 };
            self.distance[i] = distance;
            self.cosine[i] = c as f32;
            self.slope[0][i] = (one * along * plane.du * (self.normal[1][i] / c + u * w)) as f32;
            self.slope[1][i] = (one * along * plane.dv * (self.normal[2][i] / c + v * w)) as f32;
            self.phase[i] = (2.0 * wavenumber * (distance - shortest)) as f32;
            self.field[i] = (one * gain * distance * distance) as f32;
            self.weight[i] = (one * distance * distance * plane.du * plane.dv * w * w * w / (c * 8.0 * PI)) as f32;
        }
        self.least_slope = self.slope;
        for axis in 0..2 {
            for slope in &mut self.least_slope[axis] {
                *slope = slope.abs();
            }
        }
        self.turning = 0;
        let mut rest = self.hit;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let turn = turns[self.body[i] as usize];
            if turn > 0.0 {
                self.turning |= 1 << i;
                for (axis, width) in [plane.du, plane.dv].into_iter().enumerate() {
                    let change = turn * (wavenumber * self.distance[i] * width) as f32;
                    self.least_slope[axis][i] = (self.least_slope[axis][i] - change).max(0.0);
                }
            }
        }
        self.reflect(reflections);
    }

    /// Reflection coefficients of the materials, and fields times their magnitudes.
    #[inline(always)]
    fn reflect(&mut self, reflections: &[Reflection]) {
        let mut rest = self.hit;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let reflection = &reflections[self.body[i] as usize];
            let [re, im] = match reflection {
                Reflection::Constant(reflection) => *reflection,
                _ => reflection.at(self.cosine[i], || (self.normal_of(i), self.direction(i))),
            };
            (self.reflection[0][i], self.reflection[1][i]) = (re, im);
            self.field[i] *= re.hypot(im);
        }
    }

    /// Weights of the cells of the tile with the taper of their slopes; cells of weight zero make no point. Points of
    /// bodies that turn get the mean over the phase of their cell when they are evaluated.
    #[inline(always)]
    pub(super) fn weigh(&mut self) {
        for i in 0..MOST_RAYS {
            let [u, v] = [self.least_slope[0][i], self.least_slope[1][i]];
            let is_turning = self.turning >> i & 1 == 1;
            let tapered = taper_f32(u) * taper_f32(v);
            let rolled = roll_off_f32(u) * roll_off_f32(v);
            self.weight[i] *= if is_turning { rolled } else { tapered };
        }
    }

    /// Number of the body that a cell shows, or [`NO_BODY`].
    #[inline(always)]
    pub(super) fn body_of(&self, cell: usize) -> u32 {
        if self.hit >> cell & 1 == 1 {
            self.body[cell]
        } else {
            NO_BODY
        }
    }

    /// Echo of all cells together, `sum Gamma cos dA T T exp(-j phi)`, magnitude [m^2].
    #[inline(always)]
    pub(super) fn echo(&self) -> f64 {
        let mut sum = [0.0_f32; 2];
        for i in 0..MOST_RAYS {
            let one = if self.hit >> i & 1 == 1 { 1.0 } else { 0.0 };
            let field = one * self.weight[i] * self.cosine[i];
            // Turns beyond what the tapers let pass add up to little.
            let [sine, cosine] = sin_cos_turns(self.phase[i] * std::f32::consts::FRAC_1_PI * 0.5);
            let (re, im) = (self.reflection[0][i], self.reflection[1][i]);
            sum[0] += field * (re * cosine + im * sine);
            sum[1] += field * (im * cosine - re * sine);
        }
        8.0 * PI * f64::from(sum[0].hypot(sum[1]))
    }

    /// Unit direction through the centre of a cell.
    pub(super) fn direction(&self, cell: usize) -> DVec3 {
        DVec3::new(1.0, self.u[cell], self.v[cell]).normalize()
    }

    /// Unit normal at the hit of a cell.
    pub(super) fn normal_of(&self, cell: usize) -> DVec3 {
        DVec3::new(self.normal[0][cell], self.normal[1][cell], self.normal[2][cell])
    }
}

/// Sine and cosine of a phase in turns, to 1e-4.
#[inline(always)]
fn sin_cos_turns(turns: f32) -> [f32; 2] {
    let wave = |turns: f32| {
        // Parabola of half a turn, corrected by its square.
        let x = 2.0 * (turns - turns.round());
        let y = 4.0 * x * (1.0 - x.abs());
        y * (0.775 + 0.225 * y.abs())
    };
    [wave(turns), wave(turns + 0.25)]
}
