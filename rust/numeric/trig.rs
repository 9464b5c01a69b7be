//! Elementary functions over arrays and vectors: loops that the compiler vectorises, or vectors themselves.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, LOG2_E, PI, TAU};

use crate::numeric::simd::{Real, Vector};

/// Constant whose addition and subtraction rounds to the nearest integer; unlike `round`, it vectorises everywhere.
pub const ROUND: f64 = <f64 as Real>::ROUND;

/// Taylor series on an eighth of a turn to either side, |x| <= pi/4: the remainder after seven terms is below 1e-17;
/// after four, below 3e-9.
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

/// atan(t) / t over t^2, up to t = tan(pi / 8): the polynomial through eleven Chebyshev nodes, to 6e-17.
const ATAN: [f64; 11] = [
    1.0,
    -0.333_333_333_333_283_9,
    0.199_999_999_988_456_52,
    -0.142_857_141_802_161_52,
    0.111_111_061_495_774_31,
    -0.090_907_723_577_993_97,
    0.076_899_434_013_481_94,
    -0.066_401_462_775_585_77,
    0.056_878_907_624_411_02,
    -0.043_467_283_739_266_3,
    0.021_119_168_302_201_03,
];

/// tan(pi / 8)
const TAN_EIGHTH: f64 = 0.414_213_562_373_095_05;

/// sin(x) / x over x^2, up to |x| = pi/2: the remainder of Taylor's series after eleven terms is below 1e-18.
const SINC: [f64; 11] = [
    1.0,
    SIN[0],
    SIN[1],
    SIN[2],
    SIN[3],
    SIN[4],
    SIN[5],
    SIN[6],
    1.0 / 355_687_428_096_000.0,
    -1.0 / 121_645_100_408_832_000.0,
    1.0 / 51_090_942_171_709_440_000.0,
];

/// 1 / k!: Taylor's series of exp(x) on |x| <= ln(2) / 2; the remainder is below 5e-18.
const EXP: [f64; 14] = [
    1.0,
    1.0,
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5_040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];

/// Largest number of lanes of a vector.
const MOST_LANES: usize = 16;

/// ln 2 in two parts, of which the first has zeros at its end.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
const LN_2_SINGLE: [f64; 2] = [0.693_359_375, -2.121_944_400_546_905_8e-4];

/// Phase in turns reduced to -1/2 to 1/2.
#[cfg_attr(optimised, inline(always))]
pub fn reduce(phase: f64) -> f64 {
    phase - ((phase + ROUND) - ROUND)
}

/// Cosine and sine of phases in turns, below 2^50 turns: to 2e-16 in f64. In f32, phases are reduced in f64.
#[cfg_attr(optimised, inline(always))]
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

/// Cosine and sine of angles up to a quarter of a turn to either side [rad], by Taylor series: to 2e-7.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin_quarter<V: Vector<Scalar = f32>>(x: V) -> (V, V) {
    const TERMS: usize = 5;
    let splat = V::splat;
    let z = x.mul(x);
    let (mut s, mut c) = (splat(SIN[TERMS - 1] as f32), splat(COS[TERMS - 1] as f32));
    for k in (0..TERMS - 1).rev() {
        s = s.mul(z).add(splat(SIN[k] as f32));
        c = c.mul(z).add(splat(COS[k] as f32));
    }
    let cos = splat(1.0).sub(z.mul(splat(0.5).sub(z.mul(c))));
    (cos, x.add(x.mul(z).mul(s)))
}

/// Magnitude of `atan2(y, x)`: angles from 0 to pi, to 3e-16 in f64 and 4e-7 in f32; 0 where both are zero.
#[cfg_attr(optimised, inline(always))]
pub fn angle<V: Vector>(y: V, x: V) -> V {
    let splat = splat::<V>;
    let (across, along) = (y.max(splat(0.0).sub(y)), x.max(splat(0.0).sub(x)));
    let least = splat(V::Scalar::LEAST_EXPONENT.exp2());
    let ratio = across.min(along).div(across.max(along).max(least));
    // atan(t) = pi/4 + atan((t - 1) / (t + 1))
    let is_large = splat(TAN_EIGHTH).at_most(ratio);
    let turned = ratio.sub(splat(1.0)).div(ratio.add(splat(1.0)));
    let t = turned.select(is_large, ratio);
    let sum = polynomial::<V>(&ATAN, 7, t.mul(t));
    let angle = t.mul_add(sum, splat(FRAC_PI_4).select(is_large, splat(0.0)));
    let angle = angle.select(across.at_most(along), splat(FRAC_PI_2).sub(angle));
    angle.select(splat(0.0).at_most(x), splat(PI).sub(angle))
}

/// Exponential exp(x) of numbers that are not positive, to 5e-16 in f64 and 2e-7 in f32; zero where it is about to leave
/// the range of normal numbers.
#[cfg_attr(optimised, inline(always))]
pub fn exp_of_negative<V: Vector>(x: V) -> V {
    let splat = splat::<V>;
    let least = splat((V::Scalar::LEAST_EXPONENT + 1.0) / LOG2_E);
    let number = x.max(least);
    let magic = V::splat(V::Scalar::ROUND);
    let power = number.mul_add(splat(LOG2_E), magic).sub(magic);
    let [high, low] = if is_single::<V>() { LN_2_SINGLE } else { LN_2 };
    let r = power.neg_mul_add(splat(low), power.neg_mul_add(splat(high), number));
    let sum = polynomial::<V>(&EXP, 8, r);
    let mut scales = [V::Scalar::of(0.0); MOST_LANES];
    power.store(&mut scales);
    for lane in 0..V::LANES {
        scales[lane] = scales[lane].power_of_two();
    }
    let exp = sum.mul(V::load(&scales));
    exp.select(least.at_most(x), splat(0.0))
}

/// Sinc sin(x) / x of angles in turns, below 2^50 turns (2^20 in f32): to 5e-16 in f64 and 3e-7 in f32.
#[cfg_attr(optimised, inline(always))]
pub fn sinc_turns<V: Vector>(turns: V) -> V {
    let splat = splat::<V>;
    let magic = V::splat(V::Scalar::ROUND);
    // Sine of the angle reduced by half turns, with the sign of these.
    let halves = turns.add(turns).add(magic).sub(magic);
    let wholes = halves.mul(splat(0.5)).add(magic).sub(magic);
    let is_odd = wholes.neg_mul_add(splat(2.0), halves);
    let sign = is_odd.mul(is_odd).neg_mul_add(splat(2.0), splat(1.0));
    let x = halves.neg_mul_add(splat(0.5), turns).mul(splat(TAU));
    let sum = polynomial::<V>(&SINC, 7, x.mul(x));
    let sine = sign.mul(x).mul(sum);
    // Near zero the series itself is the result.
    let is_first = halves.mul(halves).at_most(splat(0.0));
    let angle = splat(1.0).select(is_first, turns.mul(splat(TAU)));
    sum.select(is_first, sine.div(angle))
}

/// Broadcast of the nearest number.
#[cfg_attr(optimised, inline(always))]
fn splat<V: Vector>(x: f64) -> V {
    V::splat(V::Scalar::of(x))
}

#[cfg_attr(optimised, inline(always))]
const fn is_single<V: Vector>() -> bool {
    size_of::<V::Scalar>() == 4
}

/// Polynomial with coefficients by degree, of which the first few are enough in single precision.
#[cfg_attr(optimised, inline(always))]
fn polynomial<V: Vector>(coefficients: &[f64], enough: usize, x: V) -> V {
    let number = if is_single::<V>() { enough } else { coefficients.len() };
    let mut sum = splat::<V>(coefficients[number - 1]);
    for k in (0..number - 1).rev() {
        sum = sum.mul_add(x, splat::<V>(coefficients[k]));
    }
    sum
}

/// Exact phase `frequency * delay`, reduced to -1/2 to 1/2 turns, with the rounding error of the product restored
/// (Dekker's product: no level needs a fused multiply-add for it).
#[cfg_attr(optimised, inline(always))]
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

/// Sinc sin(x) / x of an angle [rad].
pub fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::simd::{Isa, Kernel, Level};

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
    fn cosine_and_sine_of_a_quarter_turn_agree_with_the_library_to_rounding() {
        struct Quarter([f32; 16]);
        impl Kernel for Quarter {
            type Output = [[f32; 16]; 2];
            #[cfg_attr(optimised, inline(always))]
            fn run<I: Isa>(self) -> [[f32; 16]; 2] {
                let mut values = [[0.0; 16]; 2];
                let (cos, sin) = cos_sin_quarter(I::F32::load(&self.0));
                cos.store(&mut values[0]);
                sin.store(&mut values[1]);
                values
            }
        }
        for level in Level::available() {
            for trial in -98..98_i16 {
                let x: [f32; 16] = std::array::from_fn(|lane| 0.016 * (f32::from(trial) + lane as f32 / 16.0));
                let [cos, sin] = level.run(Quarter(x));
                for lane in 0..16 {
                    let x = f64::from(x[lane]);
                    assert!((f64::from(cos[lane]) - x.cos()).abs() < 2e-7, "{x}");
                    assert!((f64::from(sin[lane]) - x.sin()).abs() < 2e-7, "{x}");
                }
            }
        }
    }

    #[test]
    fn angles_agree_with_the_library_to_rounding() {
        struct Angle([f64; 8], [f64; 8]);
        impl Kernel for Angle {
            type Output = [f64; 8];
            #[cfg_attr(optimised, inline(always))]
            fn run<I: Isa>(self) -> [f64; 8] {
                let mut angles = [0.0; 8];
                angle(I::F64::load(&self.0), I::F64::load(&self.1)).store(&mut angles);
                angles
            }
        }
        for level in Level::available() {
            for trial in 0..500 {
                let (mut x, mut y) = ([0.0; 8], [0.0; 8]);
                for lane in 0..8 {
                    let turn = f64::from(trial) * 0.0126 + lane as f64 * 0.79;
                    (x[lane], y[lane]) = (3.0 * turn.cos(), 3.0 * turn.sin());
                }
                let angles = level.run(Angle(y, x));
                for lane in 0..8 {
                    assert!((angles[lane] - y[lane].atan2(x[lane]).abs()).abs() < 5e-16);
                }
            }
            let axes = level.run(Angle(
                [0.0, 0.0, 1.0, -1.0, 0.0, 1e-300, 0.0, -2.0],
                [1.0, -1.0, 0.0, -0.0, 0.0, 1.0, -1e300, -2.0],
            ));
            let expected = [0.0, PI, FRAC_PI_2, FRAC_PI_2, 0.0, 0.0, PI, 0.75 * PI];
            for lane in 0..8 {
                assert!((axes[lane] - expected[lane]).abs() < 5e-16, "{axes:?}");
            }
        }
    }

    /// Kernel of a function of eight numbers.
    struct Of<'a>(Function, &'a [f64; 8]);

    enum Function {
        Exp,
        Sinc,
    }

    impl Kernel for Of<'_> {
        type Output = [f64; 8];
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> [f64; 8] {
            let mut values = [0.0; 8];
            let x = I::F64::load(self.1);
            match self.0 {
                Function::Exp => exp_of_negative(x),
                Function::Sinc => sinc_turns(x),
            }
            .store(&mut values);
            values
        }
    }

    /// Kernel of all functions of sixteen numbers in single precision: angles of (x, 1), exponentials of -|x|, sincs.
    struct Single<'a>(&'a [f32; 16]);

    impl Kernel for Single<'_> {
        type Output = [[f32; 16]; 3];
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> [[f32; 16]; 3] {
            let mut values = [[0.0; 16]; 3];
            let x = I::F32::load(self.0);
            let zero = I::F32::splat(0.0);
            angle(x, I::F32::splat(1.0)).store(&mut values[0]);
            exp_of_negative(zero.sub(x.max(zero.sub(x)))).store(&mut values[1]);
            sinc_turns(x).store(&mut values[2]);
            values
        }
    }

    #[test]
    fn functions_in_single_precision_are_those_in_double_precision_to_rounding() {
        for level in Level::available() {
            for trial in -300..300_i16 {
                let x: [f32; 16] = std::array::from_fn(|lane| f32::from(trial) * 0.337 + lane as f32 * 0.02);
                let values = level.run(Single(&x));
                for lane in 0..16 {
                    let [angle, exp, sinc_] = values.map(|values| f64::from(values[lane]));
                    let x = f64::from(x[lane]);
                    assert!((angle - x.abs().atan()).abs() < 5e-7, "{x} {angle}");
                    let expected = (-x.abs()).exp();
                    assert!((exp - expected).abs() <= 3e-7 * expected + 1e-37, "{x} {exp}");
                    assert!((sinc_ - sinc(TAU * x)).abs() < 5e-7, "{x} {sinc_}");
                }
            }
        }
    }

    #[test]
    fn exponentials_agree_with_the_library_to_rounding() {
        for level in Level::available() {
            for trial in 0..900 {
                let x: [f64; 8] = std::array::from_fn(|lane| -0.1 * (f64::from(8 * trial) + lane as f64));
                for (x, exp) in x.iter().zip(level.run(Of(Function::Exp, &x))) {
                    assert!(
                        (exp - x.exp()).abs() <= 5e-16 * x.exp() || *x < -700.0 && exp == 0.0,
                        "{x} {exp}"
                    );
                }
            }
            assert_eq!(level.run(Of(Function::Exp, &[-1e9; 8])), [0.0; 8]);
        }
    }

    #[test]
    fn sines_over_angles_agree_with_the_library_to_rounding() {
        for level in Level::available() {
            for trial in -400..400 {
                let turns: [f64; 8] = std::array::from_fn(|lane| 0.003_7 * (f64::from(8 * trial) + lane as f64));
                for (turns, value) in turns.iter().zip(level.run(Of(Function::Sinc, &turns))) {
                    let x = TAU * turns;
                    let expected = if x == 0.0 { 1.0 } else { (TAU * turns.fract()).sin() / x };
                    assert!((value - expected).abs() < 5e-16, "{turns} {value} {expected}");
                }
            }
            let near = level.run(Of(Function::Sinc, &[0.0, 1e-300, -1e-12, 1e-9, 0.25, -0.25, 0.5, 1.0]));
            let expected = [1.0, 1.0, 1.0, 1.0, 2.0 / PI, 2.0 / PI, 0.0, 0.0];
            for (value, expected) in near.into_iter().zip(expected) {
                assert!((value - expected).abs() < 5e-16, "{near:?}");
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
