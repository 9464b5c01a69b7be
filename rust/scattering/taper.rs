//! Mean of a phase that varies linearly over a patch, tapered where patches are steep.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::numeric::simd::Vector;
use crate::numeric::trig::{cos_sin_quarter, sinc};

/// Half of what the phase turns over a patch from which on [`taper`] is zero [rad].
pub const STEEPEST: f32 = std::f32::consts::PI;

/// Half of what the phase turns over a patch from which on [`taper`] rolls off [rad].
const QUARTER: f32 = std::f32::consts::FRAC_PI_2;

/// Mean of exp(-2jx s) over s in [-1/2, 1/2], tapered to zero at x = pi so that aliases of steep patches vanish.
pub fn taper(x: f64) -> f64 {
    let x = x.abs();
    if x >= PI {
        0.0
    } else if x <= FRAC_PI_2 {
        sinc(x)
    } else {
        sinc(x) * (x - FRAC_PI_2).cos()
    }
}

/// Roll-off of [`taper`] in single precision: its ratio to the mean of the phase. `x` is not negative.
#[cfg_attr(optimised, inline(always))] // part of kernels
pub fn roll_off<V: Vector<Scalar = f32>>(x: V) -> V {
    let (half, most) = (V::splat(QUARTER), V::splat(STEEPEST));
    let (cosine, _) = cos_sin_quarter(x.max(half).min(most).sub(half));
    V::splat(0.0).select(most.at_most(x), cosine)
}

/// [`taper`] in single precision. `x` is not negative.
#[cfg_attr(optimised, inline(always))] // part of kernels
pub fn tapers<V: Vector<Scalar = f32>>(x: V) -> V {
    let splat = V::splat;
    let (half, most) = (splat(QUARTER), splat(STEEPEST));
    // sin(x) = cos(x - pi/2).
    let (sine, _) = cos_sin_quarter(x.min(most).sub(half));
    let square = x.mul(x);
    let near = splat(1.0 / 120.0).sub(square.mul(splat(1.0 / 5040.0)));
    let near = splat(1.0).sub(square.mul(splat(1.0 / 6.0).sub(square.mul(near))));
    let mean = near.select(x.at_most(splat(0.5)), sine.div(x));
    let rolled = mean.select(x.at_most(half), mean.mul(sine));
    splat(0.0).select(most.at_most(x), rolled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::simd::{Isa, Kernel, Level};

    #[test]
    fn taper_is_sinc_then_falls_to_zero_without_a_step() {
        assert_eq!((taper(0.0), taper(PI), taper(7.0)), (1.0, 0.0, 0.0));
        assert!((taper(1e-4) - taper(1.000_000_1e-4)).abs() < 1e-12);
        assert!((taper(FRAC_PI_2 + 1e-9) - taper(FRAC_PI_2 - 1e-9)).abs() < 1e-8);
        assert!((taper(-1.0) - 1.0_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn taper_in_single_precision_is_that_in_double_precision() {
        struct Tapers([f32; 16]);
        impl Kernel for Tapers {
            type Output = [[f32; 16]; 2];
            #[cfg_attr(optimised, inline(always))]
            fn run<I: Isa>(self) -> [[f32; 16]; 2] {
                let mut values = [[0.0; 16]; 2];
                let x = I::F32::load(&self.0);
                tapers(x).store(&mut values[0]);
                roll_off(x).store(&mut values[1]);
                values
            }
        }
        for level in Level::available() {
            for trial in 0..256_u16 {
                let x: [f32; 16] = std::array::from_fn(|lane| 1e-3 * (16.0 * f32::from(trial) + lane as f32));
                let [tapers, rolls] = level.run(Tapers(x));
                for lane in 0..16 {
                    let x = f64::from(x[lane]);
                    assert!((f64::from(tapers[lane]) - taper(x)).abs() < 1e-6, "{x}");
                    if x < 3.1 {
                        assert!((f64::from(rolls[lane]) - taper(x) / sinc(x)).abs() < 1e-6, "{x}");
                    }
                }
            }
            let mut ends = [0.0; 16];
            (ends[1], ends[2]) = (std::f32::consts::PI, 9.0);
            let ends = level.run(Tapers(ends));
            assert_eq!(ends[0][..3], [1.0, 0.0, 0.0]);
        }
    }
}
