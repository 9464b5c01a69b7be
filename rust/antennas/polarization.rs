//! Polarisation: reflections between linearly polarised antennas.

use glam::DVec3;

/// Square of the sine of the angle to the normal below which a direction has no plane of incidence.
pub(crate) const NORMAL: f64 = 1e-20;

/// Transverse part of a unit vector to a unit direction, normalised; zero where both are parallel.
pub(crate) fn transverse(e: DVec3, direction: DVec3) -> DVec3 {
    (e - direction * e.dot(direction)).normalize_or_zero()
}

/// Weights of the two polarisations in the reflection coefficient between antennas: `Gamma = te r_TE - tm r_TM`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolarizationWeights {
    /// Weight of the field across the plane of incidence.
    pub te: f64,
    /// Weight of the field in the plane of incidence.
    pub tm: f64,
}

impl PolarizationWeights {
    /// Weights of the field across the plane of incidence alone.
    pub const TE: Self = Self { te: 1.0, tm: 0.0 };

    /// Weights of the field in the plane of incidence alone.
    pub const TM: Self = Self { te: 0.0, tm: 1.0 };

    /// Weights of antennas whose fields lie along a unit vector projected across the rays; unit `normal` of the
    /// surface, unit directions `t` and `r` from transmitter and receiver to the point.
    ///
    /// With `t = r` this is `|e.s|^2` and `|e.p|^2`, with the mirror's directions what `E_r = r_TE (E.s) s + r_TM (E.p)
    /// p'` leaves in the receiver; transmitter and receiver may change places.
    pub fn by(polarization: DVec3, normal: DVec3, t: DVec3, r: DVec3) -> Self {
        let (e_t, e_r) = (transverse(polarization, t), transverse(polarization, r));

        // Normals of the planes of incidence and of departure, turned alike.
        let across = |d: DVec3| {
            let across = normal.cross(d);
            (across.length_squared() > NORMAL).then(|| across.normalize())
        };
        let (s_t, s_r) = match (across(t), across(r)) {
            (Some(s_t), Some(s_r)) => (s_t, if s_t.dot(s_r) < 0.0 { -s_r } else { s_r }),
            (Some(s), None) | (None, Some(s)) => (s, s),
            (None, None) => {
                return Self {
                    te: e_t.dot(e_r),
                    tm: 0.0,
                };
            }
        };
        Self {
            te: e_t.dot(s_t) * e_r.dot(s_r),
            tm: e_t.dot(t.cross(s_t)) * e_r.dot(r.cross(s_r)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NORMAL_TO_WALL: DVec3 = DVec3::NEG_X;

    #[test]
    fn one_antenna_sees_all_of_what_comes_back_to_it() {
        for (x, y, z) in [(1.0, 0.0, 0.0), (1.0, 1e-11, 0.0), (1.0, 1e-9, 1e-9), (1.0, 0.7, -0.4)] {
            let d = DVec3::new(x, y, z).normalize();
            for e in [DVec3::Z, DVec3::Y, DVec3::new(0.0, 0.6, 0.8)] {
                let seen = PolarizationWeights::by(e, NORMAL_TO_WALL, d, d);
                assert!((seen.te + seen.tm - 1.0).abs() < 1e-12, "{d} {e} {seen:?}");
            }
        }
    }

    #[test]
    fn vertical_antennas_see_across_a_horizontal_plane_and_horizontal_ones_in_it() {
        let [t, r] = [1.0, -1.0].map(|y| DVec3::new(1.0, y, 0.0).normalize());
        for (t, r) in [(t, r), (t, t)] {
            let vertical = PolarizationWeights::by(DVec3::Z, NORMAL_TO_WALL, t, r);
            let horizontal = PolarizationWeights::by(DVec3::Y, NORMAL_TO_WALL, t, r);
            assert!((vertical.te - 1.0).abs() < 1e-15 && vertical.tm.abs() < 1e-15);
            assert!(horizontal.te.abs() < 1e-15 && (horizontal.tm - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn nothing_is_seen_along_the_antenna() {
        let seen = PolarizationWeights::by(DVec3::X, NORMAL_TO_WALL, DVec3::X, DVec3::X);
        assert_eq!(seen, PolarizationWeights { te: 0.0, tm: 0.0 });
    }
}
