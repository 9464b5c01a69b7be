//! Table of gains over angles, interpolated bilinearly in decibels.

use std::f64::consts::{FRAC_PI_2, LN_10, PI, TAU};

use crate::error::{Error, Result};

/// Tolerance within which angles are equal [rad]: rounding of degrees and of directions.
const SAME_ANGLE: f64 = 1e-9;

/// Largest magnitude of a gain [dB]; powers stay far from the limits of f64.
const LARGEST_GAIN_DB: f64 = 1000.0;

/// Gains at angles, bilinear in decibels between them; the gain is zero outside of the table.
#[derive(Debug, PartialEq)]
pub struct GainTable {
    /// Increasing angles [rad]; over a whole turn if the table is closed.
    azimuth: Vec<f64>,
    /// Increasing angles [rad].
    elevation: Vec<f64>,
    /// Natural logarithm of the power gain, `(azimuth, elevation)`.
    level: Vec<f64>,
    /// Largest of the levels.
    pub peak: f64,
}

impl GainTable {
    /// Table from angles [rad] and gains [dB] `(azimuth, elevation)`. A table round the whole turn, with no wider a gap
    /// behind the antenna than between its other azimuths, is closed there.
    pub fn new(azimuth: &[f64], elevation: &[f64], gain_db: &[f64]) -> Result<Self> {
        check_angles("azimuth", azimuth, PI)?;
        check_angles("elevation", elevation, FRAC_PI_2)?;
        let number = azimuth.len() * elevation.len();
        if gain_db.len() != number {
            return Err(Error::value("gain_db", format!("{number} gains"), gain_db.len()));
        }
        if let Some(bad) = gain_db
            .iter()
            .find(|gain| !(-LARGEST_GAIN_DB..=LARGEST_GAIN_DB).contains(*gain))
        {
            let expected = format!("-{LARGEST_GAIN_DB} to {LARGEST_GAIN_DB} dB");
            return Err(Error::value("gain_db", expected, bad));
        }
        let mut level: Vec<f64> = gain_db.iter().map(|gain| gain * (LN_10 / 10.0)).collect();
        let mut azimuth = azimuth.to_vec();
        let gap = azimuth[0] + TAU - azimuth[azimuth.len() - 1];
        let widest = azimuth
            .windows(2)
            .fold(0.0, |most: f64, pair| most.max(pair[1] - pair[0]));
        if gap > SAME_ANGLE && gap <= widest + SAME_ANGLE {
            azimuth.push(azimuth[0] + TAU);
            level.extend_from_within(..elevation.len());
        }
        Ok(Self {
            azimuth,
            elevation: elevation.to_vec(),
            peak: level.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            level,
        })
    }

    /// Natural logarithm of the power gain at angles [rad]; none outside of the table.
    pub fn level(&self, az: f64, el: f64) -> Option<f64> {
        let (first, last) = (self.azimuth[0], self.azimuth[self.azimuth.len() - 1]);
        let az = if az < first {
            az + TAU
        } else if az > last {
            az - TAU
        } else {
            az
        };
        let ((i, s), (j, t)) = (between(&self.azimuth, az)?, between(&self.elevation, el)?);
        let at = |i: usize| {
            let row = &self.level[i * self.elevation.len()..];
            row[j] + t * (row[j + 1] - row[j])
        };
        let (low, high) = (at(i), at(i + 1));
        Some(low + s * (high - low))
    }

    /// Bounds of ln(peak / gain) over directions `(1, u, v)` within ranges, from the gains at the corners of the cells.
    pub fn decay(&self, u: [f64; 2], v: [f64; 2]) -> [f64; 2] {
        // Elevation atan(v / hypot(1, u)) grows with v, and away from the axis shrinks towards 0 with |u|.
        let most = u[0].abs().max(u[1].abs());
        let least = u[0].max(-u[1]).max(0.0);
        let elevation = |v: f64, is_outward: bool| v.atan2(1.0_f64.hypot(if is_outward { least } else { most }));
        let az = [u[0].atan() - SAME_ANGLE, u[1].atan() + SAME_ANGLE];
        let el = [
            elevation(v[0], v[0] < 0.0) - SAME_ANGLE,
            elevation(v[1], v[1] > 0.0) + SAME_ANGLE,
        ];

        let rows = touched(&self.elevation, el);
        let (mut highest, mut lowest) = (f64::NEG_INFINITY, f64::INFINITY);
        // Where a table goes round and begins within the range, the rest of the range is at its end.
        for turn in [0.0, TAU] {
            for i in touched(&self.azimuth, az.map(|az| az + turn)) {
                let column = &self.level[i * self.elevation.len()..][rows.clone()];
                for level in column {
                    highest = highest.max(*level);
                    lowest = lowest.min(*level);
                }
            }
        }
        let is_within = |nodes: &[f64], [low, high]: [f64; 2]| nodes[0] <= low && high <= nodes[nodes.len() - 1];
        let goes_round = self.azimuth[self.azimuth.len() - 1] - self.azimuth[0] > TAU - SAME_ANGLE;
        if !(is_within(&self.elevation, el) && (goes_round || is_within(&self.azimuth, az))) {
            lowest = f64::NEG_INFINITY;
        }
        [self.peak - highest, self.peak - lowest]
    }
}

/// Interval of increasing nodes that holds a number, and fraction of the interval, 0 to 1; none outside of all.
fn between(nodes: &[f64], x: f64) -> Option<(usize, f64)> {
    if !(nodes[0]..=nodes[nodes.len() - 1]).contains(&x) {
        return None;
    }
    let next = nodes.partition_point(|node| *node <= x).clamp(1, nodes.len() - 1);
    Some((next - 1, (x - nodes[next - 1]) / (nodes[next] - nodes[next - 1])))
}

/// Nodes of all intervals that a range touches.
fn touched(nodes: &[f64], [low, high]: [f64; 2]) -> std::ops::Range<usize> {
    if high < nodes[0] || low > nodes[nodes.len() - 1] {
        return 0..0;
    }
    let first = nodes.partition_point(|node| *node <= low).saturating_sub(1);
    let last = nodes.partition_point(|node| *node < high).min(nodes.len() - 1);
    first..last + 1
}

/// Refuse angles that do not increase or exceed a limit.
fn check_angles(name: &str, angles: &[f64], limit: f64) -> Result<()> {
    if angles.len() < 2 {
        return Err(Error::value(name, "at least two angles", angles.len()));
    }
    let most = limit + SAME_ANGLE;
    if let Some(bad) = angles.iter().find(|angle| !(-most..=most).contains(*angle)) {
        let expected = format!("angles from -{limit:.6} to {limit:.6} [rad]");
        return Err(Error::value(name, expected, bad));
    }
    if let Some([before, after, ..]) = angles.windows(2).find(|pair| pair[1] <= pair[0]) {
        return Err(Error::value(
            name,
            "increasing angles [rad]",
            format!("{before} and then {after}"),
        ));
    }
    Ok(())
}
