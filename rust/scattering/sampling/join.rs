//! Joined points: cells whose phases differ little become one material point.

use glam::DVec3;
use num_complex::Complex64;

use super::cells::Cells;
use crate::rays::packet::PACKET;
use crate::scattering::tile_point::TilePoint;

/// Point and weight that stand for the cells of a quarter in a mask; none if they belong to several bodies or if their
/// phases differ by more than `join` [rad], per body, from the mean.
///
/// Delay and weight are those of the sum at the centre of the band: with fields `f_i = w_i cos_i exp(-j phi_i)` the
/// phase is `Re(sum f_i phi_i / sum f_i)`, the delay of the sum, and the weight is turned to it. The point lies on the
/// mean ray.
#[inline(always)] // part of a kernel
pub(super) fn joined(
    cells: &Cells,
    first: usize,
    lit: u32,
    wavenumber: f64,
    join: &[f32],
) -> Option<(TilePoint, Complex64)> {
    let leader = first + lit.trailing_zeros() as usize;
    let body = cells.body[leader];
    let most = join[body as usize];
    let (mut least_phase, mut most_phase, mut is_one) = (f32::INFINITY, f32::NEG_INFINITY, true);
    for i in 0..PACKET {
        let is_lit = lit >> i & 1 == 1;
        let phase = cells.phase[first + i];
        least_phase = if is_lit && phase < least_phase {
            phase
        } else {
            least_phase
        };
        most_phase = if is_lit && phase > most_phase {
            phase
        } else {
            most_phase
        };
        is_one &= !is_lit || (cells.body[first + i] == body);
    }
    // Also false for a limit of zero.
    if !is_one || most_phase - least_phase >= 2.0 * most {
        return None;
    }
    let mean = 0.5 * (least_phase + most_phase);

    let mut number = 0.0;
    let (mut sum, mut moment) = ([0.0_f32; 2], [0.0_f32; 2]);
    let (mut u, mut v, mut normal) = (0.0, 0.0, [0.0; 3]);
    for i in 0..PACKET {
        let cell = first + i;
        let one: f32 = if lit >> i & 1 == 1 { 1.0 } else { 0.0 };
        let turn = one * (cells.phase[cell] - mean);
        let field = one * cells.weight[cell] * cells.cosine[cell];
        let [sine, cosine] = sin_cos(turn);
        let (re, im) = (cells.reflection[0][cell], cells.reflection[1][cell]);
        // j Gamma exp(-j turn)
        let turned = [re * sine - im * cosine, re * cosine + im * sine].map(|part| field * part);
        for part in 0..2 {
            sum[part] += turned[part];
            moment[part] += turned[part] * turn;
        }
        let one = f64::from(one);
        number += one;
        u += one * cells.u[cell];
        v += one * cells.v[cell];
        for axis in 0..3 {
            normal[axis] += one * cells.normal[axis][cell];
        }
    }
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
        edges: [DVec3::ZERO; 2],
    };
    (cosine > 0.0).then_some((point, weight))
}

/// Sine and cosine of angles up to 1.5 rad, by Taylor series.
#[inline(always)]
fn sin_cos(x: f32) -> [f32; 2] {
    let s = x * x;
    let sine = x
        * (1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s * (1.0 / 362_880.0 - s / 39_916_800.0)))));
    let cosine = 1.0
        + s * (-0.5
            + s * (1.0 / 24.0
                + s * (-1.0 / 720.0 + s * (1.0 / 40_320.0 + s * (-1.0 / 3_628_800.0 + s / 479_001_600.0)))));
    [sine, cosine]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_cosines_of_joined_phases_are_exact_to_single_precision() {
        for i in -150..=150 {
            let x = f64::from(i) * 0.01;
            let [sine, cosine] = sin_cos(x as f32).map(f64::from);
            assert!((sine - x.sin()).abs() < 1e-6 && (cosine - x.cos()).abs() < 1e-6, "{x}");
        }
    }
}
