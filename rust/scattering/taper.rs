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
}
