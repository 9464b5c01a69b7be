//! Steps of a tracker, all targets at once, for states of any length.

use super::assignment::{self, Gate, Known, Pair};
use super::kalman::predict;
use super::matrix::{Matrix, sum};
use super::state_space::{Expected, begin, expect};
use crate::error::{Error, Result};

/// Vectors (target, length) and covariances (target, length, length), row by row.
pub struct Targets<'a> {
    pub length: usize,
    pub values: &'a [f64],
    pub covariances: &'a [f64],
}

/// As [`Targets`], with memory of their own.
pub struct OwnTargets {
    pub length: usize,
    pub values: Vec<f64>,
    pub covariances: Vec<f64>,
}

/// Call a function that is generic by the numbers of a state and of its measurement, by the first of them.
macro_rules! by_length {
    ($targets:expr, $function:ident($($argument:expr),*)) => {
        match $targets.length {
            2 => Ok($function::<2, 2>($($argument),*)),
            4 => Ok($function::<4, 3>($($argument),*)),
            6 => Ok($function::<6, 4>($($argument),*)),
            length => Err(Error::value("state", "2, 4 or 6 numbers of each target", length)),
        }
    };
}

/// Targets after a time [s], by the white-acceleration model, see [`predict`].
pub fn predicted(tracks: &Targets, time: f64, density: f64) -> Result<OwnTargets> {
    fn all<const N: usize, const M: usize>(tracks: &Targets, time: f64, density: f64) -> OwnTargets {
        tracks.changed::<N>(|states, covariances| {
            for (state, covariance) in states.iter_mut().zip(covariances) {
                predict(state, covariance, time, density);
            }
        })
    }
    by_length!(tracks, all(tracks, time, density))
}

/// Expected measurements of targets and their covariance, see [`expect`].
pub fn expected(tracks: &Targets) -> Result<OwnTargets> {
    fn all<const N: usize, const M: usize>(tracks: &Targets) -> OwnTargets {
        let tracks = tracks.known::<N>();
        OwnTargets::collect(tracks.value.iter().zip(tracks.covariance).map(|(state, covariance)| {
            let expected: Expected<N, M> = expect(state, covariance);
            (expected.value, sum(&expected.covariance, &expected.curvature))
        }))
    }
    by_length!(tracks, all(tracks))
}

/// See [`assignment::gated_pairs`]; detections have the numbers that tracks measure.
pub fn gated_pairs(tracks: &Targets, detections: &Targets, gate: &Gate) -> Result<(Vec<Pair>, Vec<f64>)> {
    fn all<const N: usize, const M: usize>(
        tracks: &Targets,
        detections: &Targets,
        gate: &Gate,
    ) -> (Vec<Pair>, Vec<f64>) {
        assignment::gated_pairs::<N, M>(tracks.known(), detections.known(), gate)
    }
    by_length!(tracks, all(tracks, detections, gate))
}

/// Tracks that take in detections, pair by pair; see [`gated_pairs`].
pub fn updated(tracks: &Targets, detections: &Targets, pairs: &[Pair], gate: &Gate) -> Result<OwnTargets> {
    fn all<const N: usize, const M: usize>(
        tracks: &Targets,
        detections: &Targets,
        pairs: &[Pair],
        gate: &Gate,
    ) -> OwnTargets {
        tracks.changed::<N>(|states, covariances| {
            assignment::update_pairs::<N, M>(states, covariances, detections.known(), pairs, gate);
        })
    }
    by_length!(tracks, all(tracks, detections, pairs, gate))
}

/// Tracks of `length` numbers that begin with detections, see [`begin`].
pub fn begun(length: usize, detections: &Targets, speed_deviation: f64) -> Result<OwnTargets> {
    fn all<const N: usize, const M: usize>(detections: &Targets, speed_deviation: f64) -> OwnTargets {
        let all = detections.known::<M>();
        let pairs = all.value.iter().zip(all.covariance);
        OwnTargets::collect(pairs.map(|(measured, noise)| begin::<N, M>(measured, noise, speed_deviation)))
    }
    let tracks = Targets {
        length,
        values: &[],
        covariances: &[],
    };
    by_length!(tracks, all(detections, speed_deviation))
}

impl Targets<'_> {
    fn known<const N: usize>(&self) -> Known<'_, N> {
        Known {
            value: self.values.as_chunks().0,
            covariance: self.covariances.as_chunks().0.as_chunks().0,
        }
    }

    /// A copy with changes.
    fn changed<const N: usize>(&self, change: impl FnOnce(&mut [[f64; N]], &mut [Matrix<N, N>])) -> OwnTargets {
        let (mut values, mut covariances) = (self.values.to_vec(), self.covariances.to_vec());
        change(
            values.as_chunks_mut().0,
            covariances.as_chunks_mut().0.as_chunks_mut().0,
        );
        OwnTargets {
            length: N,
            values,
            covariances,
        }
    }
}

impl OwnTargets {
    fn collect<const N: usize>(targets: impl Iterator<Item = ([f64; N], Matrix<N, N>)>) -> Self {
        let (values, covariances): (Vec<_>, Vec<_>) = targets.unzip();
        Self {
            length: N,
            values: values.into_flattened(),
            covariances: covariances.into_flattened().into_flattened(),
        }
    }
}
