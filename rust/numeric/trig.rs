//! Elementary functions over arrays and vectors: loops that the compiler vectorises, or vectors themselves.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, LOG2_E, PI, TAU};

use crate::numeric::simd::{Real, Vector};

/// Taylor series of exp(x) on |x| <= ln(2) / 2: the remainder is below 5e-18.
const EXP: [f64; 14] = taylor(0, 1, 1.0);

/// Taylor series of sin(x) / x over x^2 on |x| <= pi/2: the remainder is below 1e-18; on |x| <= pi/4, that after eight
/// terms is below 1e-17.
const SINC: [f64; 11] = taylor(1, 2, -1.0);

/// Taylor series of cos(x) over x^2 on |x| <= pi/4: the remainder is below 1e-17.
const COS: [f64; 9] = taylor(0, 2, -1.0);

/// `sign^k / (first + step k)!`
const fn taylor<const N: usize>(first: usize, step: usize, sign: f64) -> [f64; N] {
    let mut series = [0.0; N];
    // Factorials up to 22! are exact.
    let (mut k, mut number, mut factorial, mut signs) = (0, 0, 1.0, 1.0);
    while k < N {
        while number < first + step * k {
            number += 1;
            factorial *= number as f64;
        }
        series[k] = signs / factorial;
        signs *= sign;
        k += 1;
    }
    series
}

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

/// Largest number of lanes of a vector.
const MOST_LANES: usize = 16;

/// ln 2 in two parts; the first ends with zero bits.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
const LN_2_SINGLE: [f64; 2] = [0.693_359_375, -2.121_944_400_546_905_8e-4];

/// Nearest integers.
#[cfg_attr(optimised, inline(always))]
pub fn round<V: Vector>(x: V) -> V {
    let magic = V::splat(V::Scalar::ROUND);
    x.add(magic).sub(magic)
}

/// Cosine and sine of phases of -1/2 to 1/2 turns: to 1e-15 in f64 and 2e-7 in f32.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin_turn<V: Vector>(phase: V) -> [V; 2] {
    let splat = splat::<V>;
    // Quarters of a turn, -2 to 2, and the rest: at most an eighth to either side.
    let magic = V::splat(V::Scalar::ROUND);
    let quarters = phase.mul_add(splat(4.0), magic).sub(magic);
    let x = quarters.neg_mul_add(splat(0.25), phase).mul(splat(TAU));
    let z = x.mul(x);
    let (c, s) = (polynomial(&COS, 6, z), x.mul(polynomial(&SINC[..8], 5, z)));
    // Turn back by the quarters t = -2 ..= 2: cos = 1 - t^2 (7 - t^2) / 6, sin = t (4 - t^2) / 3.
    let square = quarters.mul(quarters);
    let cos = square
        .mul(splat(7.0).sub(square))
        .neg_mul_add(splat(1.0 / 6.0), splat(1.0));
    let sin = quarters.mul(splat(4.0).sub(square)).mul(splat(1.0 / 3.0));
    [s.neg_mul_add(sin, c.mul(cos)), s.mul_add(cos, c.mul(sin))]
}

/// Cosine and sine of phases in turns, below 2^50 turns: to 1e-15 in f64. In f32, phases are reduced in f64. Nothing is
/// fused, so that every instruction set gives the same bits.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin_turns<T: Real, const N: usize>(phase: &[f64; N]) -> ([T; N], [T; N]) {
    let num_terms = if size_of::<T>() == 4 { 5 } else { 8 };
    let (mut cos, mut sin) = ([T::zero(); N], [T::zero(); N]);
    for i in 0..N {
        let quarters = (4.0 * phase[i] + f64::ROUND) - f64::ROUND;
        let x = T::of(TAU * (phase[i] - 0.25 * quarters));
        let z = x * x;
        let (mut c, mut s) = (T::of(COS[num_terms]), T::zero());
        for k in (0..num_terms).rev() {
            c = T::of(COS[k]) + z * c;
            s = T::of(SINC[k]) + z * s;
        }
        s = s * x;
        // Turn back by the quarters, -2 ..= 2 of them: multiply by (1, j, -1, -j).
        let turn = T::of(quarters - 4.0 * ((0.25 * quarters + f64::ROUND) - f64::ROUND));
        let (cos_q, sin_q) = (T::one() - turn.abs(), turn * (T::of(2.0) - turn.abs()));
        cos[i] = c * cos_q - s * sin_q;
        sin[i] = s * cos_q + c * sin_q;
    }
    (cos, sin)
}

/// Cosine and sine of angles up to a quarter of a turn to either side [rad]: to 2e-7 in f32 and 1e-12 in f64.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin_quarter<V: Vector>(x: V) -> (V, V) {
    let z = x.mul(x);
    (polynomial(&COS, 7, z), x.mul(polynomial(&SINC, 6, z)))
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
    let sum = polynomial(&ATAN, 7, t.mul(t));
    let angle = t.mul_add(sum, splat(FRAC_PI_4).select(is_large, splat(0.0)));
    let angle = angle.select(across.at_most(along), splat(FRAC_PI_2).sub(angle));
    angle.select(splat(0.0).at_most(x), splat(PI).sub(angle))
}

/// Exponential exp(x) of numbers that are not positive, to 5e-16 in f64 and 2e-7 in f32; zero where it is about to
/// leave the range of normal numbers.
#[cfg_attr(optimised, inline(always))]
pub fn exp_of_negative<V: Vector>(x: V) -> V {
    let splat = splat::<V>;
    let least = splat((V::Scalar::LEAST_EXPONENT + 1.0) / LOG2_E);
    let number = x.max(least);
    let power = round(number.mul(splat(LOG2_E)));
    let [high, low] = if is_single::<V>() { LN_2_SINGLE } else { LN_2 };
    let r = power.neg_mul_add(splat(low), power.neg_mul_add(splat(high), number));
    let sum = polynomial(&EXP, 8, r);
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
    // Sine of the angle reduced by half turns, with the sign of these.
    let halves = round(turns.add(turns));
    let wholes = round(halves.mul(splat(0.5)));
    let is_odd = wholes.neg_mul_add(splat(2.0), halves);
    let sign = is_odd.mul(is_odd).neg_mul_add(splat(2.0), splat(1.0));
    let x = halves.neg_mul_add(splat(0.5), turns).mul(splat(TAU));
    let sum = polynomial(&SINC, 7, x.mul(x));
    let sine = sign.mul(x).mul(sum);
    // Near zero the series itself is the result.
    let is_first = halves.mul(halves).at_most(splat(0.0));
    let angle = splat(1.0).select(is_first, turns.mul(splat(TAU)));
    sum.select(is_first, sine.div(angle))
}

/// Broadcast of the nearest number.
#[cfg_attr(optimised, inline(always))]
pub fn splat<V: Vector>(x: f64) -> V {
    V::splat(V::Scalar::of(x))
}

#[cfg_attr(optimised, inline(always))]
const fn is_single<V: Vector>() -> bool {
    size_of::<V::Scalar>() == 4
}

/// Polynomial with coefficients by degree; the first few are enough in single precision.
#[cfg_attr(optimised, inline(always))]
fn polynomial<V: Vector>(coefficients: &[f64], enough: usize, x: V) -> V {
    let number = if is_single::<V>() { enough } else { coefficients.len() };
    let mut sum = splat::<V>(coefficients[number - 1]);
    for k in (0..number - 1).rev() {
        sum = sum.mul_add(x, splat::<V>(coefficients[k]));
    }
    sum
}

/// Exact phase `frequency * delay`, reduced to -1/2 to 1/2 turns, with the rounding error of the product restored.
pub fn turns(frequency: f64, delay: f64) -> f64 {
    let product = frequency * delay;
    product - product.round() + frequency.mul_add(delay, -product)
}

/// Sinc sin(x) / x of an angle [rad].
pub fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::simd::{Isa, Kernel, Level, Precision};

    #[derive(Clone, Copy, Debug)]
    enum Function {
        Angle,
        Exp,
        Sinc,
        CosQuarter,
        SinQuarter,
    }

    /// Kernel of a function of sixteen numbers x and y.
    struct Of<T>(Function, [[T; 16]; 2]);

    impl<T: Precision> Kernel for Of<T> {
        type Output = [T; 16];
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> [T; 16] {
            let mut values = [T::zero(); 16];
            for at in (0..16).step_by(<T::In<I>>::LANES) {
                let (x, y) = (<T::In<I>>::load(&self.1[0][at..]), <T::In<I>>::load(&self.1[1][at..]));
                let value = match self.0 {
                    Function::Angle => angle(y, x),
                    Function::Exp => exp_of_negative(x),
                    Function::Sinc => sinc_turns(x),
                    Function::CosQuarter => cos_sin_quarter(x).0,
                    Function::SinQuarter => cos_sin_quarter(x).1,
                };
                value.store(&mut values[at..]);
            }
            values
        }
    }

    fn expected(function: Function, x: f64, y: f64) -> f64 {
        match function {
            Function::Angle => y.atan2(x).abs(),
            Function::Exp => x.exp(),
            Function::Sinc if x == 0.0 => 1.0,
            Function::Sinc => (TAU * x.fract()).sin() / (TAU * x),
            Function::CosQuarter => x.cos(),
            Function::SinQuarter => x.sin(),
        }
    }

    /// Compare with the library; errors relative and absolute.
    fn check<T: Precision + std::fmt::Debug>(
        function: Function,
        numbers: &[(f64, f64)],
        [relative, absolute]: [f64; 2],
    ) {
        for numbers in numbers.chunks(16) {
            let number = |i: usize| numbers[i.min(numbers.len() - 1)];
            let [x, y]: [[T; 16]; 2] = [
                std::array::from_fn(|i| T::of(number(i).0)),
                std::array::from_fn(|i| T::of(number(i).1)),
            ];
            for level in Level::available() {
                let values = level.run(Of(function, [x, y]));
                for ((x, y), value) in x.iter().zip(&y).zip(values) {
                    let expected = expected(function, x.wide(), y.wide());
                    let error = (value.wide() - expected).abs();
                    assert!(
                        error <= relative * expected.abs() + absolute,
                        "{function:?} {x:?} {y:?} {value:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn functions_agree_with_the_library_to_rounding() {
        let circle = |i: i32| (3.0 * (0.0016 * f64::from(i)).cos(), 3.0 * (0.0016 * f64::from(i)).sin());
        let line = |step: f64| move |i: i32| (step * f64::from(i), 1.0);
        let numbers = |numbers: &dyn Fn(i32) -> (f64, f64)| (-4000..=4000).map(numbers).collect::<Vec<_>>();
        let negative = |step: f64| (0..=7000).map(|i: i32| (-step * f64::from(i), 0.0)).collect::<Vec<_>>();
        for (function, numbers, double, single) in [
            (Function::Angle, numbers(&circle), 5e-16, 5e-7),
            (Function::Angle, numbers(&line(0.025)), 5e-16, 5e-7),
            (Function::Sinc, numbers(&line(0.0037)), 5e-16, 5e-7),
            (Function::Sinc, numbers(&line(0.025)), 5e-16, 5e-7),
            (Function::CosQuarter, numbers(&line(FRAC_PI_2 / 4000.0)), 1e-12, 2e-7),
            (Function::SinQuarter, numbers(&line(FRAC_PI_2 / 4000.0)), 1e-12, 2e-7),
        ] {
            check::<f64>(function, &numbers, [0.0, double]);
            check::<f32>(function, &numbers, [0.0, single]);
        }
        check::<f64>(Function::Exp, &negative(0.1), [5e-16, 0.0]);
        check::<f32>(Function::Exp, &negative(0.0125), [3e-7, 1e-37]);
    }

    #[test]
    fn functions_are_exact_at_the_ends_of_their_ranges() {
        let axes = [
            (1.0, 0.0),
            (-1.0, 0.0),
            (0.0, 1.0),
            (-0.0, -1.0),
            (0.0, 0.0),
            (1.0, 1e-300),
            (-1e300, 0.0),
            (-2.0, -2.0),
        ];
        check::<f64>(Function::Angle, &axes, [0.0, 5e-16]);
        let turns = [0.0, 1e-300, -1e-12, 1e-9, 0.25, -0.25, 0.5, 1.0].map(|x| (x, 0.0));
        check::<f64>(Function::Sinc, &turns, [0.0, 5e-16]);
        for level in Level::available() {
            assert_eq!(level.run(Of(Function::Exp, [[-1e9; 16], [0.0; 16]])), [0.0; 16]);
        }
    }
}
