//! Arithmetic on arrays of f64 vectors: one vector for 8 numbers, two for the 16 of an f32 vector.

use crate::numeric::simd::{Isa, Precision, Vector};

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
    let mut wide = splat::<I, P>(0.0);
    for p in 0..P {
        wide[p] = I::F64::load(&from[8 * p..]);
    }
    wide
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
    ($(#[$doc:meta])* $name:ident($($argument:ident),*)) => {
        $(#[$doc])*
        #[cfg_attr(optimised, inline(always))]
        pub fn $name<V: Vector, const P: usize>(mut x: [V; P], $($argument: [V; P]),*) -> [V; P] {
            for p in 0..P {
                x[p] = x[p].$name($($argument[p]),*);
            }
            x
        }
    };
}

each_vector!(
    /// `x + b`
    add(b)
);
each_vector!(
    /// `x - b`
    sub(b)
);
each_vector!(
    /// `x b`
    mul(b)
);
each_vector!(
    /// `x / b`
    div(b)
);
each_vector!(
    /// `x b + c`
    mul_add(b, c)
);
each_vector!(
    /// `c - x b`
    neg_mul_add(b, c)
);
each_vector!(
    /// Minimum, lane by lane.
    min(b)
);
each_vector!(
    /// Maximum, lane by lane.
    max(b)
);

/// Constant whose addition and subtraction rounds to the nearest integer; unlike `round`, it vectorises everywhere.
pub const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// [`ROUND`] for f32.
const ROUND_SINGLE: f64 = 12_582_912.0; // 1.5 * 2^23

/// Round to the nearest integers.
#[cfg_attr(optimised, inline(always))]
pub fn round<I: Isa, const P: usize>(x: Wide<I, P>) -> Wide<I, P> {
    let magic = splat::<I, P>(ROUND);
    sub(add(x, magic), magic)
}

/// Reduce phases in turns to -1/2 to 1/2.
#[cfg_attr(optimised, inline(always))]
pub fn reduce<I: Isa, const P: usize>(turns: Wide<I, P>) -> Wide<I, P> {
    sub(turns, round::<I, P>(turns))
}

/// Exact phase `frequency * delay`, reduced to -1/2 to 1/2 turns, with the rounding error of the product restored: by a
/// fused multiply-add, or by Dekker's product where the level has none.
#[cfg_attr(optimised, inline(always))]
pub fn turns<I: Isa, const P: usize>(frequency: f64, delay: Wide<I, P>) -> Wide<I, P> {
    const SPLIT: f64 = 134_217_729.0; // 2^27 + 1
    if I::IS_FUSED {
        let f = splat::<I, P>(frequency);
        let product = mul(delay, f);
        let rounding = neg_mul_add(delay, f, product); // with the other sign
        return sub(reduce::<I, P>(product), rounding);
    }
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
    of_reduced::<T, I>(narrow::<T, I, P>(reduce::<I, P>(phase)))
}

/// Cosine and sine of phases in turns in the precision of `T`, below 2^20 turns.
#[cfg_attr(optimised, inline(always))]
pub fn cos_sin_of<T: Precision, I: Isa>(phase: T::In<I>) -> [T::In<I>; 2] {
    let magic = number::<T, I>(magic::<T>());
    of_reduced::<T, I>(phase.sub(phase.add(magic).sub(magic)))
}

/// Constant that rounds to the nearest integer in the precision of `T`; see [`ROUND`].
#[cfg_attr(optimised, inline(always))]
fn magic<T>() -> f64 {
    if size_of::<T>() == 4 { ROUND_SINGLE } else { ROUND }
}

/// Cosine and sine of -1/2 to 1/2 turns.
#[cfg_attr(optimised, inline(always))]
fn of_reduced<T: Precision, I: Isa>(phase: T::In<I>) -> [T::In<I>; 2] {
    // Quarters of a turn, -2 to 2, and the rest: at most an eighth to either side.
    let magic = number::<T, I>(magic::<T>());
    let turn = phase.mul_add(number::<T, I>(4.0), magic).sub(magic);
    let x = turn.neg_mul_add(number::<T, I>(0.25), phase);

    // Taylor series; the first term left out is below 2e-9 (f32), 5e-17 (f64).
    let degree = if size_of::<T>() == 4 { 10 } else { 16 };
    let z = x.mul(x);
    let (mut c, mut s) = (number::<T, I>(COS_SIN[degree]), number::<T, I>(COS_SIN[degree - 1]));
    let mut n = degree - 2;
    while n > 0 {
        c = c.mul_add(z, number::<T, I>(COS_SIN[n]));
        s = s.mul_add(z, number::<T, I>(COS_SIN[n - 1]));
        n -= 2;
    }
    let (c, s) = (c.mul_add(z, number::<T, I>(1.0)), s.mul(x));

    // Turn back by the quarters t = -2 ..= 2: cos = 1 - t^2 (7 - t^2) / 6, sin = t (4 - t^2) / 3.
    let square = turn.mul(turn);
    let cos_q = square
        .mul(number::<T, I>(7.0).sub(square))
        .neg_mul_add(number::<T, I>(1.0 / 6.0), number::<T, I>(1.0));
    let sin_q = turn.mul(number::<T, I>(4.0).sub(square)).mul(number::<T, I>(1.0 / 3.0));
    [s.neg_mul_add(sin_q, c.mul(cos_q)), s.mul_add(cos_q, c.mul(sin_q))]
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

const COS_SIN: [f64; 17] = taylor_of_turns();

/// Taylor coefficients `(2 pi)^n / n!` with the signs of the cosine (even n) and the sine (odd n).
const fn taylor_of_turns() -> [f64; 17] {
    let mut series = [1.0; 17];
    let mut n = 1;
    while n < 17 {
        series[n] = series[n - 1] * std::f64::consts::TAU / n as f64;
        n += 1;
    }
    n = 2;
    while n < 17 {
        if n % 4 >= 2 {
            series[n] = -series[n];
        }
        n += 1;
    }
    series
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::numeric::simd::{Kernel, Level};

    struct CosSin<T, const P: usize>(f64, std::marker::PhantomData<T>);

    impl<T: Precision, const P: usize> Kernel for CosSin<T, P> {
        type Output = [Vec<T>; 2];
        #[cfg_attr(optimised, inline(always))]
        fn run<I: Isa>(self) -> Self::Output {
            let lanes = <T::In<I>>::LANES;
            let mut out = [vec![T::zero(); lanes], vec![T::zero(); lanes]];
            let [c, s] = cos_sin::<T, I, P>(splat::<I, P>(self.0));
            c.store(&mut out[0]);
            s.store(&mut out[1]);
            out
        }
    }

    #[test]
    fn cosine_and_sine_agree_with_the_library_to_rounding() {
        for level in Level::available() {
            for trial in 0..5000 {
                let phase = (f64::from(trial) - 2500.0) * 0.06125;
                let x = TAU * phase.fract();
                let [c, s] = level.run(CosSin::<f64, 1>(phase, std::marker::PhantomData));
                assert!(
                    (c[0] - x.cos()).abs() < 2e-15 && (s[7] - x.sin()).abs() < 2e-15,
                    "{phase}"
                );
                let [c, s] = level.run(CosSin::<f32, 2>(phase, std::marker::PhantomData));
                assert!((f64::from(c[0]) - x.cos()).abs() < 3e-7, "{phase}");
                assert!((f64::from(s[15]) - x.sin()).abs() < 3e-7, "{phase}");
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
            (60e9, 66.712_819_039_630_4e-6),
            (61.25e9, 3.3e-9),
            (57.1e9, 0.0),
            (60e9, -1e-5),
        ] {
            let (frequency, delay): (f64, f64) = (frequency, delay);
            let product = frequency * delay;
            let expected = product.fract() + frequency.mul_add(delay, -product);
            for level in Level::available() {
                let difference = level.run(Turns(frequency, delay)) - expected;
                assert!((difference - difference.round()).abs() < 1e-15);
            }
        }
    }
}
