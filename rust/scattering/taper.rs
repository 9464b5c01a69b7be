//! Mean of a phase that varies linearly over a patch, tapered where patches are steep.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::numeric::trig::sinc;

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

/// Roll-off of [`taper`] in single precision: its ratio to the mean of the phase.
#[inline(always)] // part of kernels
pub fn roll_off_f32(x: f32) -> f32 {
    const HALF: f32 = std::f32::consts::FRAC_PI_2;
    let x = x.abs();
    let y = (x.clamp(HALF, std::f32::consts::PI)) - HALF;
    if x < std::f32::consts::PI { cos_f32(y) } else { 0.0 }
}

/// Cosine of angles up to half a turn, by its Taylor series.
#[inline(always)]
fn cos_f32(y: f32) -> f32 {
    let s = y * y;
    1.0 + s
        * (-0.5
            + s * (1.0 / 24.0
                + s * (-1.0 / 720.0 + s * (1.0 / 40_320.0 + s * (-1.0 / 3_628_800.0 + s / 479_001_600.0)))))
}

/// [`taper`] in single precision, without branches.
#[inline(always)] // part of kernels
pub fn taper_f32(x: f32) -> f32 {
    const HALF: f32 = std::f32::consts::FRAC_PI_2;
    let x = x.abs();
    let y = x.min(std::f32::consts::PI) - HALF;
    // sin(x) = cos(y).
    let sine = cos_f32(y);
    let square = x * x;
    let near = 1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0));
    let mean = if x < 0.5 { near } else { sine / x };
    let rolled = if x > HALF { mean * sine } else { mean };
    if x < std::f32::consts::PI { rolled } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taper_is_sinc_then_falls_to_zero_without_a_step() {
        assert_eq!((taper(0.0), taper(PI), taper(7.0)), (1.0, 0.0, 0.0));
        assert!((taper(1e-4) - taper(1.000_000_1e-4)).abs() < 1e-12);
        assert!((taper(FRAC_PI_2 + 1e-9) - taper(FRAC_PI_2 - 1e-9)).abs() < 1e-8);
        assert!((taper(-1.0) - 1.0_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn taper_in_single_precision_is_that_in_double_precision() {
        for i in -4000..=4000 {
            let x = f64::from(i) * 1e-3;
            assert!((f64::from(taper_f32(x as f32)) - taper(x)).abs() < 1e-6, "{x}");
        }
        assert_eq!((taper_f32(0.0), taper_f32(std::f32::consts::PI)), (1.0, 0.0));
        for x in [0.3, 1.5, 1.7, 2.5, 3.1] {
            let ratio = taper(x) / sinc(x);
            assert!((f64::from(roll_off_f32(x as f32)) - ratio).abs() < 1e-6, "{x}");
        }
    }
}
