//! Antenna patterns: power gain over directions.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::antennas::gain_table::GainTable;

/// Power gain of an antenna over directions of the sensor frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// Gaussian beam `peak exp(-azimuth az^2 - elevation el^2)`; zero exponents: isotropic.
    Gaussian {
        /// Power gain on boresight.
        peak: f64,
        /// Exponent over azimuth [1/rad^2].
        azimuth: f64,
        /// Exponent over elevation [1/rad^2].
        elevation: f64,
    },
    /// Table of gains over angles.
    Table(Arc<GainTable>),
    /// Another pattern, in axes that are turned against its own.
    Turned(Arc<Turned>),
}

/// Pattern in axes that are turned against its own.
#[derive(Debug, PartialEq)]
pub struct Turned {
    /// Rotation of directions to the axes of the pattern.
    pub rotation: DMat3,
    /// The pattern in its own axes.
    pub pattern: Pattern,
}

impl Pattern {
    /// True if two patterns are known to be equal without comparing tables number by number.
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Table(a), Self::Table(b)) => Arc::ptr_eq(a, b),
            (Self::Turned(a), Self::Turned(b)) => a.rotation == b.rotation && a.pattern.is_same(&b.pattern),
            _ => self == other,
        }
    }

    /// Power gain towards a direction of the sensor frame (any length).
    pub fn gain(&self, d: DVec3) -> f64 {
        if let Self::Gaussian {
            peak,
            azimuth: 0.0,
            elevation: 0.0,
        } = self
        {
            return *peak;
        }
        if let Self::Turned(turned) = self {
            return turned.pattern.gain(turned.rotation * d);
        }
        // Adding +0 turns -0 into +0: straight up has azimuth 0, straight back +180 degrees.
        let azimuth = (d.y + 0.0).atan2(d.x + 0.0);
        self.gain_at(azimuth, d.z.atan2(d.x.hypot(d.y)))
    }

    /// Power gain at angles [rad], azimuth within half a turn.
    pub fn gain_at(&self, az: f64, el: f64) -> f64 {
        match self {
            Self::Gaussian {
                peak,
                azimuth,
                elevation,
            } => peak * (-azimuth * az * az - elevation * el * el).exp(),
            Self::Table(table) => table.level(az, el).map_or(0.0, f64::exp),
            Self::Turned(_) => {
                let ((sine, cosine), (z, along)) = (az.sin_cos(), el.sin_cos());
                self.gain(DVec3::new(along * cosine, along * sine, z))
            }
        }
    }

    /// Largest power gain.
    pub fn peak(&self) -> f64 {
        match self {
            Self::Gaussian { peak, .. } => *peak,
            Self::Table(table) => table.peak.exp(),
            Self::Turned(turned) => turned.pattern.peak(),
        }
    }

    /// Bounds of ln(peak / gain) over directions `(1, u, v)` within ranges.
    pub fn decay(&self, u: [f64; 2], v: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Gaussian { azimuth, elevation, .. } => {
                let least = |[low, high]: [f64; 2]| low.max(-high).max(0.0);
                let most = |[low, high]: [f64; 2]| high.max(-low).max(0.0);
                let decay = |az: f64, el: f64| azimuth * az * az + elevation * el * el;
                [
                    decay(least(u).atan(), least(v).atan2(1.0_f64.hypot(most(u)))),
                    decay(most(u).atan(), most(v).atan()),
                ]
            }
            Self::Table(table) => table.decay(u, v),
            Self::Turned(turned) => turned.decay(u, v),
        }
    }
}

impl Turned {
    fn decay(&self, u: [f64; 2], v: [f64; 2]) -> [f64; 2] {
        // The rectangle is a convex quadrilateral in the plane of the pattern, if it lies in front.
        let [mut across, mut up] = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for (u, v) in u.into_iter().flat_map(|u| v.map(|v| (u, v))) {
            let d = self.rotation * DVec3::new(1.0, u, v);
            if d.x <= 0.0 {
                return [0.0, f64::INFINITY];
            }
            for (range, x) in [(&mut across, d.y / d.x), (&mut up, d.z / d.x)] {
                *range = [range[0].min(x), range[1].max(x)];
            }
        }
        self.pattern.decay(across, up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    /// Gains 1 to n dB, `(azimuth, elevation)`.
    fn counting(azimuth_deg: &[f64], elevation_deg: &[f64]) -> Pattern {
        let [azimuth, elevation] = [azimuth_deg, elevation_deg].map(|angles| angles.iter().map(|x| x.to_radians()));
        let gains: Vec<f64> = (1..=azimuth.len() * elevation.len()).map(|i| i as f64).collect();
        let table = GainTable::new(&azimuth.collect::<Vec<_>>(), &elevation.collect::<Vec<_>>(), &gains);
        Pattern::Table(Arc::new(table.unwrap()))
    }

    fn gaussian(azimuth: f64, elevation: f64) -> Pattern {
        Pattern::Gaussian {
            peak: 2.0,
            azimuth,
            elevation,
        }
    }

    /// A pattern in axes turned by 30 degrees to the left and a little up.
    fn turned(pattern: Pattern) -> Pattern {
        let rotation = DMat3::from_rotation_z(-0.5) * DMat3::from_rotation_y(0.2);
        Pattern::Turned(Arc::new(Turned { rotation, pattern }))
    }

    #[test]
    fn turned_pattern_has_the_gains_of_its_own_axes() {
        let pattern = counting(&[-180.0, -40.0, 0.0, 10.0, 170.0], &[-90.0, -20.0, 30.0, 90.0]);
        let there = turned(pattern.clone());
        let Pattern::Turned(axes) = &there else { unreachable!() };
        let d = DVec3::new(0.3, -0.5, 0.4);
        assert!((there.gain(axes.rotation.transpose() * d) / pattern.gain(d) - 1.0).abs() < 1e-12);
        let (azimuth, elevation) = (0.3_f64, -0.4_f64);
        let direction = DVec3::new(azimuth.cos(), azimuth.sin(), elevation.tan());
        assert!((there.gain_at(azimuth, elevation) / there.gain(direction) - 1.0).abs() < 1e-12);
        assert!(there.is_same(&turned(pattern.clone())) && !there.is_same(&pattern));
    }

    #[test]
    fn tables_are_closed_by_a_gap_as_wide_as_a_step_but_for_rounding_and_know_no_negative_zeros() {
        let gain_db = |pattern: &Pattern, direction: DVec3| 10.0 * pattern.gain(direction).log10();
        let steps: Vec<f64> = (0..36).map(|i| 10.0 * f64::from(i) - 175.0).collect();
        assert!((gain_db(&counting(&steps, &[-90.0, 90.0]), DVec3::NEG_X) - 36.5).abs() < 1e-12);
        // Straight up and down are at azimuth zero.
        let ahead = counting(&[-180.0, 0.0, 180.0], &[-90.0, 90.0]);
        for (direction, expected) in [(DVec3::Z, 4.0), (DVec3::new(-0.0, -0.0, 2.0), 4.0), (-DVec3::Z, 3.0)] {
            assert!((gain_db(&ahead, direction) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn decay_bounds_what_directions_within_ranges_have() {
        let random = &mut Random(3);
        let around: Vec<f64> = (0..24).map(|i| 15.0 * f64::from(i) - 172.0).collect();
        let seam: Vec<f64> = vec![-170.0, -120.0, -60.0, 5.0, 60.0, 120.0, 170.0];
        let patterns = [
            gaussian(3.0, 7.0),
            counting(&around, &[-90.0, -30.0, -10.0, 0.0, 10.0, 50.0, 90.0]),
            counting(&seam, &[-40.0, -5.0, 5.0, 20.0]),
            counting(&[-10.0, 30.0], &[0.0, 1.0]),
            turned(gaussian(1.0, 2.0)),
            turned(counting(&around, &[-90.0, -30.0, 0.0, 30.0, 90.0])),
        ];
        for (number, pattern) in patterns.iter().enumerate() {
            let peak = pattern.peak().ln();
            let (mut num_out, mut num_within) = (0, 0);
            for _ in 0..300 {
                let mut range = |most: f64| {
                    let (middle, half) = (random.between(-most, most), random.between(0.0, 0.3));
                    [middle - half, middle + half]
                };
                let (u, v) = (range(2.0), range(1.5));
                let [least, most] = pattern.decay(u, v);
                let (mut nearest, mut farthest) = (f64::INFINITY, 0.0_f64);
                let at = |[low, high]: [f64; 2], i: i32| low + (high - low) * f64::from(i) / 15.0;
                for (i, j) in (0..=15).flat_map(|i| (0..=15).map(move |j| (i, j))) {
                    let decay = peak - pattern.gain(DVec3::new(1.0, at(u, i), at(v, j))).ln();
                    (nearest, farthest) = (nearest.min(decay), farthest.max(decay));
                }
                assert!(
                    least <= nearest + 1e-9 && farthest <= most + 1e-9,
                    "{number} {u:?} {v:?}"
                );
                num_out += usize::from(least.is_infinite());
                num_within += usize::from(most.is_finite());
            }
            assert_eq!(num_out > 0, number == 2 || number == 3);
            assert_eq!(num_within > 0, number != 3);
        }
    }

    #[test]
    fn what_is_no_table_is_refused() {
        let two = [0.0, 1.0];
        let refused = |azimuth: &[f64], elevation: &[f64], gain_db: &[f64]| {
            GainTable::new(azimuth, elevation, gain_db).unwrap_err().to_string()
        };
        assert_eq!(
            refused(&[0.0], &two, &two),
            "azimuth: expected at least two angles, got 1"
        );
        assert_eq!(refused(&two, &two, &two), "gain_db: expected 4 gains, got 2");
        let limits = "angles from -1.570796 to 1.570796 [rad]";
        for (angles, message) in [
            ([1.0, 1.0], "increasing angles [rad], got 1 and then 1"),
            ([0.0, 1.6], &format!("{limits}, got 1.6")),
            ([f64::NAN, 1.0], &format!("{limits}, got NaN")),
        ] {
            assert_eq!(
                refused(&two, &angles, &[0.0; 4]),
                format!("elevation: expected {message}")
            );
        }
        for gain in [f64::NAN, f64::NEG_INFINITY, 1e9] {
            assert!(refused(&two, &two, &[0.0, gain, 0.0, 0.0]).starts_with("gain_db: expected -1000 to 1000 dB"));
        }
    }
}
