//! Cosine and sine of phases in turns, as loops over arrays that the compiler vectorises.

use crate::simd::Real;

/// Adding and subtracting this rounds to the nearest integer; unlike `round`, it vectorises everywhere.
pub const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// Taylor series on an eighth of a turn to either side, |x| <= pi/4: after seven terms, what is left out is below
/// 1e-17; after four, below 3e-9.
const SIN: [f64; 7] = [
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5_040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
];
const COS: [f64; 7] = [
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];

/// A phase without its whole turns, -1/2 to 1/2.
#[inline(always)]
pub fn reduce(phase: f64) -> f64 {
    phase - ((phase + ROUND) - ROUND)
}

/// Cosine and sine of phases in turns, below 2^50 turns: to 2e-16 in f64. In f32, phases are reduced in f64.
#[inline(always)]
pub fn cos_sin_turns<T: Real, const N: usize>(phase: &[f64; N]) -> ([T; N], [T; N]) {
    let num_terms = if size_of::<T>() == 4 { 4 } else { 7 };
    let (mut cos, mut sin) = ([T::zero(); N], [T::zero(); N]);
    let (one, two, half) = (T::one(), T::of(2.0), T::of(0.5));
    for i in 0..N {
        let quarters = (4.0 * phase[i] + ROUND) - ROUND;
        let x = T::of(std::f64::consts::TAU * (phase[i] - 0.25 * quarters));
        let z = x * x;
        let (mut s, mut c) = (T::of(SIN[num_terms - 1]), T::of(COS[num_terms - 1]));
        for k in (0..num_terms - 1).rev() {
            s = T::of(SIN[k]) + z * s;
            c = T::of(COS[k]) + z * c;
        }
        let s = x + x * z * s;
        let c = one - half * z + z * z * c;
        // Turn back by the quarters, -2 ..= 2 of them: multiply by (1, j, -1, -j).
        let turn = T::of(quarters - 4.0 * ((0.25 * quarters + ROUND) - ROUND));
        let (cos_q, sin_q) = (one - turn.abs(), turn * (two - turn.abs()));
        cos[i] = c * cos_q - s * sin_q;
        sin[i] = s * cos_q + c * sin_q;
    }
    (cos, sin)
}

/// `frequency * delay` without its whole turns, the rounding of the product put back (Dekker's product: no level needs
/// a fused multiply-add for it).
#[inline(always)]
pub fn turns(frequency: f64, delay: f64) -> f64 {
    let split = |x: f64| {
        let big = 134_217_729.0 * x; // 2^27 + 1
        let high = big - (big - x);
        (high, x - high)
    };
    let product = frequency * delay;
    let ((fh, fl), (dh, dl)) = (split(frequency), split(delay));
    let rounding = ((fh * dh - product) + fh * dl + fl * dh) + fl * dl;
    reduce(product) + rounding
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn cosine_and_sine_agree_with_the_library_to_rounding() {
        const N: usize = 64;
        let mut phase = [0.0; N];
        for trial in 0..1000 {
            for (i, x) in phase.iter_mut().enumerate() {
                *x = (f64::from(trial) - 500.0) * 0.731 + i as f64 * 0.125;
            }
            let (cos, sin) = cos_sin_turns::<f64, N>(&phase);
            let (cos_single, sin_single) = cos_sin_turns::<f32, N>(&phase);
            for i in 0..N {
                let x = TAU * phase[i].fract();
                assert!((cos[i] - x.cos()).abs() < 1e-15 && (sin[i] - x.sin()).abs() < 1e-15);
                assert!((f64::from(cos_single[i]) - x.cos()).abs() < 1.5e-7);
                assert!((f64::from(sin_single[i]) - x.sin()).abs() < 1.5e-7);
            }
        }
    }

    #[test]
    fn turns_of_long_delays_keep_all_digits() {
        for (frequency, delay) in [
            (60e9, 66.712_819_039_630_4e-6),
            (61.25e9, 3.3e-9),
            (57.1e9, 0.0),
            (60e9, -1e-5),
        ] {
            let (frequency, delay): (f64, f64) = (frequency, delay);
            let product = frequency * delay;
            let expected = product.fract() + frequency.mul_add(delay, -product);
            let difference = turns(frequency, delay) - expected;
            assert!((difference - difference.round()).abs() < 1e-15);
        }
    }
}
