//! Sum over all paths of a frame: in lanes where these are the fastest, else group by group with node times of its own.
//! Bodies in rough motion, which needs many times, have a sum of their own in any case.

use num_complex::Complex64;
use rayon::prelude::*;

use super::groups::{Evaluate, Group, Groups};
use super::lanes;
use super::model::Model;
use super::outcome::{Outcome, count_of_times};
use super::parts::Part;
use super::stages::timed;
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::paths::node_times::{self, NodeTimes};
use crate::paths::placement::{Motion, Placement};
use crate::paths::series::{Paths, Selection};
use crate::synthesis::beat::{self, SINGLE_TOLERANCE, Samples};
use crate::synthesis::block::Class;
use crate::synthesis::delay::{Basis, PathSeries};

/// Largest number of delays and amplitudes of one piece of the sum, which bounds memory.
const PIECE_NUMBERS: usize = 1 << 25;

impl Groups {
    /// Beat samples of a part of the frame, group by group, in pieces of bounded memory.
    pub fn sum(
        &self,
        model: &Model,
        placement: &Placement,
        part: &Part,
        cancel: &Cancel,
    ) -> Result<(Samples, Outcome)> {
        let num_channels = model.array.num_channels();
        let shape = [num_channels, part.waveform.chirp_times.len(), part.waveform.num_samples];
        let (rough, others): (Vec<&Group>, Vec<&Group>) =
            self.all.iter().partition(|group| group.motion == Motion::Rough);
        let (mut rest, mut done) = (rough, None);
        match lanes::sum(self, &others, model, placement, part, cancel)? {
            Some(sum) => done = Some(sum),
            None => rest = self.all.iter().collect(),
        }
        let (mut cube, mut outcome) =
            done.unwrap_or_else(|| (zeros(shape, model.settings.tolerance), Outcome::default()));
        if num_channels == 0 {
            return Ok((cube, outcome));
        }
        let mut times = std::mem::take(&mut outcome.times);
        for group in rest {
            let paths = Evaluate {
                model,
                placement,
                groups: self,
                group,
            };
            let num_paths = group.len();
            let nodes = if group.motion == Motion::Still {
                NodeTimes::ONCE
            } else {
                let (highest, tolerance) = (model.highest_frequency(), model.settings.tolerance);
                let probe = |number, selection| {
                    let times = part.node_times(number);
                    paths.at(&times, &times).take(selection)
                };
                timed(&mut times.node_times, || {
                    node_times::choose(num_paths, num_channels, highest, tolerance, probe)
                })?
            };
            let [delays_at, amplitudes_at] = [nodes.delays, nodes.amplitudes].map(|number| part.node_times(number));
            let evaluate = paths.at(&delays_at, &amplitudes_at);
            let most = delays_at.len().max(amplitudes_at.len());
            let size = (PIECE_NUMBERS / (num_channels * most)).max(1);
            for first in (0..num_paths).step_by(size) {
                cancel.check()?;
                let selection = Selection {
                    first,
                    last: num_paths.min(first + size),
                    step: 1,
                };
                let piece = timed(&mut times.paths, || evaluate.take(selection))?;
                let plane = num_channels * selection.len();
                let delay: Vec<&[f64]> = piece.delay.chunks(plane).collect();
                let amplitude: Vec<&[Complex64]> = piece.amplitude.chunks(plane).collect();
                let series = PathSeries {
                    basis: Basis::Chebyshev,
                    delay: &delay,
                    amplitude: &amplitude,
                    num_channels,
                    num_paths: selection.len(),
                };
                let options = beat::Options {
                    cancel: Some(cancel),
                    ..model.options(selection.len(), shape[1])
                };
                let report = timed(&mut times.sum, || {
                    let (samples, report) = beat::beat_signal(&part.waveform, &series, &options)?;
                    add(&mut cube, samples, &part.waveform.over_frequency(group.order));
                    Ok(report)
                })?;
                let still = report.plan.parts.iter().filter(|part| part.class == Class::Still);
                let [delays, amplitudes] = [&delays_at, &amplitudes_at].map(|times| count_of_times(times.len()));
                outcome.add(&Outcome {
                    nodes: Some(nodes),
                    still_paths: still.map(|part| part.num_paths).sum::<usize>() / num_channels,
                    rows: report.rows,
                    rows_skipped: report.rows_skipped,
                    farthest: if group.order == 0 {
                        0.5 * SPEED_OF_LIGHT * longest(&piece, plane)
                    } else {
                        0.0
                    },
                    plan: format!("delays at {delays}, amplitudes at {amplitudes}; {}", report.plan),
                    ..Outcome::default()
                });
            }
        }
        outcome.times = times;
        Ok((cube, outcome))
    }
}

/// Longest delay of paths with power [s], in rows of `plane` paths of all channels.
fn longest(paths: &Paths, plane: usize) -> f64 {
    let carries = |path: usize| {
        paths.amplitude[path..]
            .iter()
            .step_by(plane)
            .any(|a| *a != Complex64::ZERO)
    };
    let longest = |path: usize| paths.delay[path..].iter().step_by(plane).copied().fold(0.0, f64::max);
    // Nearly always the longest of all carries power.
    let mut by_delay = (0.0, None);
    for (i, delay) in paths.delay.iter().enumerate() {
        if *delay > by_delay.0 {
            by_delay = (*delay, Some(i % plane));
        }
    }
    match by_delay {
        (delay, Some(path)) if carries(path) => delay,
        _ => (0..plane)
            .filter(|path| carries(*path))
            .map(longest)
            .fold(0.0, f64::max),
    }
}

/// Cube of zeros (channel, chirp, sample) in the precision of a tolerance.
pub fn zeros(shape: [usize; 3], tolerance: f64) -> Samples {
    let number = shape.iter().product();
    if tolerance >= SINGLE_TOLERANCE {
        Samples::Single(vec![num_complex::Complex32::ZERO; number])
    } else {
        Samples::Double(vec![Complex64::ZERO; number])
    }
}

/// Add samples, times weights over fast time unless `weights` is empty.
fn add(cube: &mut Samples, samples: Samples, weights: &[f64]) {
    fn each<T: Copy + Send + Sync + std::ops::AddAssign>(
        cube: &mut [T],
        samples: &[T],
        weights: &[f64],
        times: impl Fn(T, f64) -> T + Sync,
    ) {
        const BLOCK: usize = 1 << 14;
        let row = weights.len().max(1);
        let block = row * (BLOCK / row).max(1);
        let blocks = cube.par_chunks_mut(block).zip(samples.par_chunks(block));
        blocks.for_each(|(sums, samples)| {
            for (i, (sum, sample)) in sums.iter_mut().zip(samples).enumerate() {
                *sum += if weights.is_empty() {
                    *sample
                } else {
                    times(*sample, weights[i % row])
                };
            }
        });
    }
    match (cube, samples) {
        (Samples::Single(cube), Samples::Single(samples)) => each(cube, &samples, weights, |a, w| a * w as f32),
        (Samples::Double(cube), Samples::Double(samples)) => each(cube, &samples, weights, |a, w| a * w),
        _ => unreachable!("one tolerance, one precision"),
    }
}
