//! Joined points: cells whose phases differ little become one material point.

use glam::DVec3;
use num_complex::Complex64;

use super::cells::TileCells;
use crate::numeric::simd::{Isa, Vector};
use crate::numeric::trig::cos_sin_quarter;
use crate::rays::packet::{MOST_RAYS, PACKET};
use crate::rays::tile_hits::HALF;
use crate::scattering::tile_point::TilePoint;

/// Phase by which the cells of a joined point may turn against each other while their body turns [rad], from the first to
/// the last: half of it to either side of the mean costs 0.3 dB at the ends of a frame.
const MOST_TURNED: f32 = 0.5;

/// Limits of joined points of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Join {
    /// Largest phase from the mean [rad]; 0: no points are joined.
    pub(super) phase: f32,
    /// Angle by which the body turns from the cast on [rad].
    pub(super) turn: f32,
}

impl Join {
    /// True if cells over a length may be joined: the phase between them changes little while the body turns.
    /// `wavenumber` [rad/m], `length` [m].
    #[cfg_attr(optimised, inline(always))] // part of a kernel
    pub(super) fn allows(self, wavenumber: f64, length: f64) -> bool {
        self.phase > 0.0 && 2.0 * self.turn * (wavenumber * length) as f32 <= MOST_TURNED
    }
}

/// Point and weight that stand for the cells of a quarter in a mask; none if they belong to several bodies or if their
/// phases differ by more than `most` [rad] from the mean.
///
/// Delay and weight belong to the sum at the centre of the band: with fields `f_i = w_i cos_i exp(-j phi_i)` the
/// phase is `Re(sum f_i phi_i / sum f_i)`, the delay of the sum, and the weight is turned to it. The point lies on the
/// mean ray.
#[cfg_attr(optimised, inline(always))] // part of a kernel
pub(super) fn joined<I: Isa>(
    cells: &TileCells,
    first: usize,
    lit: u32,
    wavenumber: f64,
    most: f32,
) -> Option<(TilePoint, Complex64)> {
    let leader = first + lit.trailing_zeros() as usize;
    let body = cells.body[leader];
    let splat = <I::F32 as Vector>::splat;
    let (phase, zero) = (I::F32::load(&cells.phase[first..]), splat(0.0));
    let far = splat(f32::NEG_INFINITY);
    let most_phase = phase.select(lit, far).largest();
    let least_phase = -zero.sub(phase).select(lit, far).largest();
    // Also false for a limit of zero.
    if most_phase - least_phase >= 2.0 * most {
        return None;
    }
    if lit & !I::equal(&cells.bodies(first / PACKET), body) != 0 {
        return None;
    }
    let mean = 0.5 * (least_phase + most_phase);

    let turn = phase.sub(splat(mean)).select(lit, zero);
    let weight = I::F32::load(&cells.weight[first..]).select(lit, zero);
    let field = weight.mul(I::F32::load(&cells.cosine[first..]));
    // `cos_sin_quarter` reaches a quarter of a turn, the limits half a turn.
    let (half_cosine, half_sine) = cos_sin_quarter(turn.mul(splat(0.5)));
    let twice = half_sine.add(half_sine);
    let (cosine, sine) = (splat(1.0).sub(twice.mul(half_sine)), twice.mul(half_cosine));
    let re = I::F32::load(&cells.reflection[0][first..]);
    let im = I::F32::load(&cells.reflection[1][first..]);
    // j Gamma exp(-j turn)
    let turned = [
        field.mul(re.mul(sine).sub(im.mul(cosine))),
        field.mul(re.mul(cosine).add(im.mul(sine))),
    ];
    let sum = [total(turned[0]), total(turned[1])];
    let moment = [total(turned[0].mul(turn)), total(turned[1].mul(turn))];
    let number = f64::from(lit.count_ones());
    let [x, y, z] = &cells.normal;
    let u = total_of::<I>(&cells.u, first, lit);
    let v = total_of::<I>(&cells.v, first, lit);
    let normal = [
        total_of::<I>(x, first, lit),
        total_of::<I>(y, first, lit),
        total_of::<I>(z, first, lit),
    ];
    let power = sum[0] * sum[0] + sum[1] * sum[1];
    let delay = (moment[0] * sum[0] + moment[1] * sum[1]) / power;
    // Also false where the fields cancel.
    if delay.is_nan() || delay.abs() > most {
        return None;
    }
    let direction = DVec3::new(1.0, u / number, v / number).normalize();
    let normal = DVec3::from_array(normal).normalize();
    let cosine = -normal.dot(direction);
    let phase = f64::from(mean) + f64::from(delay);
    let distance = cells.shortest + phase / (2.0 * wavenumber);
    let weight = Complex64::new(f64::from(sum[0]), f64::from(sum[1])) * Complex64::cis(f64::from(delay)) / cosine;
    let point = TilePoint {
        position: distance * direction,
        normal,
        body,
        triangle: cells.triangle[leader],
    };
    (cosine > 0.0).then_some((point, weight))
}

/// Sum of all numbers, in one order for every instruction set.
#[cfg_attr(optimised, inline(always))]
fn total<V: Vector<Scalar = f32>>(numbers: V) -> f32 {
    let mut lanes = [0.0; PACKET];
    numbers.store(&mut lanes);
    for width in [8, 4, 2, 1] {
        for lane in 0..width {
            lanes[lane] += lanes[lane + width];
        }
    }
    lanes[0]
}

/// Sum of the numbers of a quarter's cells in a mask.
#[cfg_attr(optimised, inline(always))]
fn total_of<I: Isa>(numbers: &[f64; MOST_RAYS], first: usize, lit: u32) -> f64 {
    let zero = <I::F64 as Vector>::splat(0.0);
    let low = I::F64::load(&numbers[first..]).select(lit & 0xff, zero);
    let high = I::F64::load(&numbers[first + HALF..]).select(lit >> HALF & 0xff, zero);
    let mut lanes = [0.0; HALF];
    low.add(high).store(&mut lanes);
    for width in [4, 2, 1] {
        for lane in 0..width {
            lanes[lane] += lanes[lane + width];
        }
    }
    lanes[0]
}
