//! Arithmetic on arrays of f64 vectors: one vector for 8 numbers, two for the 16 of an f32 vector.

use crate::numeric::simd::{Isa, Precision, Real, Vector};
use crate::numeric::trig;

/// Array of `P` vectors of f64.
pub type Wide<I, const P: usize> = [<I as Isa>::F64; P];

/// Broadcast a number to all lanes.
#[cfg_attr(optimised, inline(always))]
pub fn splat<I: Isa, const P: usize>(x: f64) -> Wide<I, P> {
    [I::F64::splat(x); P]
}

/// Load the first numbers of a slice.
#[cfg_attr(optimised, inline(always))]
pub fn load<I: Isa, const P: usize>(from: &[f64]) -> Wide<I, P> {
    load_vectors(from)
}

/// Load vectors of any type from the first numbers of a slice.
#[cfg_attr(optimised, inline(always))]
pub fn load_vectors<V: Vector, const P: usize>(from: &[V::Scalar]) -> [V; P] {
    let mut vectors = [V::load(from); P];
    for p in 1..P {
        vectors[p] = V::load(&from[V::LANES * p..]);
    }
    vectors
}

/// Store to the first numbers of a slice.
#[cfg_attr(optimised, inline(always))]
pub fn store<V: Vector, const P: usize>(wide: [V; P], to: &mut [V::Scalar]) {
    for p in 0..P {
        wide[p].store(&mut to[V::LANES * p..]);
    }
}

macro_rules! each_vector {
    ($($(#[$doc:meta])* $name:ident($($argument:ident),*)),*) => {
        $(
            $(#[$doc])*
            #[cfg_attr(optimised, inline(always))]
            pub fn $name<V: Vector, const P: usize>(mut x: [V; P], $($argument: [V; P]),*) -> [V; P] {
                for p in 0..P {
                    x[p] = x[p].$name($($argument[p]),*);
                }
                x
            }
        )*
    };
}

each_vector! {
    /// `x + b`
    add(b),
    /// `x - b`
    sub(b),
    /// `x b`
    mul(b),
    /// `x b + c`
    mul_add(b, c),
    /// `c - x b`
    neg_mul_add(b, c),
    /// Minimum, lane by lane.
    min(b),
    /// Maximum, lane by lane.
    max(b)
}

/// Round to the nearest integers.
#[cfg_attr(optimised, inline(always))]
pub fn round<I: Isa, const P: usize>(mut x: Wide<I, P>) -> Wide<I, P> {
    for p in 0..P {
        x[p] = trig::round(x[p]);
    }
    x
}

/// Reduce phases in turns to -1/2 to 1/2.
#[cfg_attr(optimised, inline(always))]
pub fn reduce<I: Isa, const P: usize>(turns: Wide<I, P>) -> Wide<I, P> {
    sub(turns, round::<I, P>(turns))
}

/// Exact phase `frequency * delay`, reduced to -1/2 to 1/2 turns, with the rounding error of the product restored by
/// Dekker's product, which needs no fused multiply-add.
#[cfg_attr(optimised, inline(always))]
pub fn turns<I: Isa, const P: usize>(frequency: f64, delay: Wide<I, P>) -> Wide<I, P> {
    const SPLIT: f64 = 134_217_729.0; // 2^27 + 1
    let big = SPLIT * frequency;
    let high = big - (big - frequency);
    let (f, f_high, f_low) = (
        splat::<I, P>(frequency),
        splat::<I, P>(high),
        splat::<I, P>(frequency - high),
    );
    let big = mul(delay, splat::<I, P>(SPLIT));
    let high = sub(big, sub(big, delay));
    let low = sub(delay, high);
    let product = mul(delay, f);
    let rounding = sub(mul(high, f_high), product);
    let rounding = add(add(rounding, mul(low, f_high)), add(mul(high, f_low), mul(low, f_low)));
    add(reduce::<I, P>(product), rounding)
}

/// Cosine and sine of phases in turns, below 2^49 of them, to the precision of `T`.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin<T: Precision, I: Isa, const P: usize>(phase: Wide<I, P>) -> [T::In<I>; 2] {
    trig::cos_sin_turn(narrow::<T, I, P>(reduce::<I, P>(phase)))
}

/// Cosine and sine of phases in turns in the precision of `T`, below 2^20 turns.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin_of<T: Precision, I: Isa>(phase: T::In<I>) -> [T::In<I>; 2] {
    trig::cos_sin_turn(phase.sub(trig::round(phase)))
}

/// Product of two complex numbers.
#[cfg_attr(optimised, inline(always))]
pub fn product<V: Vector>(a: [V; 2], b: [V; 2]) -> [V; 2] {
    [
        a[1].neg_mul_add(b[1], a[0].mul(b[0])),
        a[1].mul_add(b[0], a[0].mul(b[1])),
    ]
}

/// Sum of the lanes.
#[cfg_attr(optimised, inline(always))]
pub fn total<V: Vector>(numbers: V) -> f64 {
    let mut lanes = [V::Scalar::default(); 16];
    numbers.store(&mut lanes);
    let mut sum = 0.0;
    for number in lanes {
        sum += number.wide();
    }
    sum
}

/// Convert to a vector in the precision of `T`.
#[cfg_attr(optimised, inline(always))]
pub fn narrow<T: Precision, I: Isa, const P: usize>(wide: Wide<I, P>) -> T::In<I> {
    T::narrow::<I>([wide[0], wide[P - 1]])
}

/// Broadcast a number to all lanes in the precision of `T`.
#[cfg_attr(optimised, inline(always))]
pub fn number<T: Precision, I: Isa>(x: f64) -> T::In<I> {
    <T::In<I>>::splat(T::of(x))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::marker::PhantomData;

    use super::*;
    use crate::numeric::simd::{Kernel, Level};

    struct CosSin<T>([f64; 16], PhantomData<T>);

    impl<T: Precision> Kernel for CosSin<T> {
        type Output = [[T; 16]; 2];
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> Self::Output {
            let mut out = [[T::zero(); 16]; 2];
            for at in (0..16).step_by(<T::In<I>>::LANES) {
                let [cos, sin] = cos_sin::<T, I, 2>([I::F64::load(&self.0[at..]), I::F64::load(&self.0[8..])]);
                cos.store(&mut out[0][at..]);
                sin.store(&mut out[1][at..]);
            }
            out
        }
    }

    #[test]
    fn cosine_and_sine_agree_with_the_library_to_rounding() {
        let check = |phase: f64, got: [f64; 2], tolerance: f64| {
            let (sin, cos) = (TAU * phase.fract()).sin_cos();
            assert!(
                (got[0] - cos).abs() < tolerance && (got[1] - sin).abs() < tolerance,
                "{phase} {got:?}"
            );
        };
        for trial in 0..2000 {
            let phase: [f64; 16] = std::array::from_fn(|i| (f64::from(trial) - 1000.0) * 0.731 + i as f64 * 0.06125);
            let (cos, sin) = trig::cos_sin_turns::<f64, 16>(&phase);
            let (cos_single, sin_single) = trig::cos_sin_turns::<f32, 16>(&phase);
            for i in 0..16 {
                check(phase[i], [cos[i], sin[i]], 1e-15);
                check(phase[i], [cos_single[i], sin_single[i]].map(f64::from), 1.5e-7);
            }
            for level in Level::available() {
                let [cos, sin] = level.run(CosSin::<f64>(phase, PhantomData));
                let [cos_single, sin_single] = level.run(CosSin::<f32>(phase, PhantomData));
                for i in 0..16 {
                    check(phase[i], [cos[i], sin[i]], 2e-15);
                    check(phase[i], [cos_single[i], sin_single[i]].map(f64::from), 3e-7);
                }
            }
        }
    }

    struct Turns(f64, f64);

    impl Kernel for Turns {
        type Output = f64;
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> f64 {
            let mut out = [0.0; 8];
            store(turns::<I, 1>(self.0, splat::<I, 1>(self.1)), &mut out);
            out[3]
        }
    }

    #[test]
    fn turns_of_long_delays_keep_all_digits() {
        for (frequency, delay) in [
            (60e9_f64, 66.712_819_039_630_4e-6),
            (61.25e9, 3.3e-9),
            (57.1e9, 0.0),
            (60e9, -1e-5),
        ] {
            let product = frequency * delay;
            let expected = product.fract() + frequency.mul_add(delay, -product);
            let of_levels = Level::available()
                .into_iter()
                .map(|level| level.run(Turns(frequency, delay)));
            for turns in of_levels.chain([trig::turns(frequency, delay)]) {
                assert!((turns - expected - (turns - expected).round()).abs() < 1e-15);
            }
        }
    }
}
