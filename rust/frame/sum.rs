//! Groups of paths, their node times, and the sum over all of them.

use num_complex::Complex64;
use rayon::prelude::*;

use super::model::{Cancel, Model, Source};
use super::parts::Part;
use super::rays::{Image, Rays};
use super::stages::{StageTimes, timed};
use crate::bounces::{self, Bounces};
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result};
use crate::paths::node_times::{self, NodeTimes};
use crate::paths::placement::Placement;
use crate::paths::scatterers::Scatterers;
use crate::paths::series::{Paths, Selection};
use crate::scattering::material_points::NO_CELL;
use crate::synthesis::beat::{self, SINGLE_TOLERANCE, Samples};
use crate::synthesis::block::Class;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::plan::Method;

/// Largest number of path-samples of one piece of a direct sum: half a second.
const PIECE_PATH_SAMPLES: usize = 1 << 28;

/// Largest number of delays and amplitudes of one piece of the sum, which bounds memory.
const PIECE_NUMBERS: usize = 1 << 25;

/// Paths of a frame, or of a part of one.
pub struct Groups {
    all: Vec<Group>,
    /// Numbers of the bodies that deform.
    deforming: Vec<u32>,
    /// Number of point targets.
    num_points: usize,
    /// Number of material points, over all groups.
    num_scatterers: usize,
    /// Cells that have a material point.
    num_cells: usize,
    /// Distance of the farthest cell of paths that fall with the frequency [m]: edge terms of cells may lie beyond the
    /// surface.
    farthest: f64,
    /// Number of paths of several reflections, and counts of their rays.
    num_bounces: usize,
    bounces: bounces::Counts,
}

/// Paths that are summed together.
struct Group {
    paths: GroupPaths,
    /// True if delays and amplitudes do not change within the frame.
    is_still: bool,
    /// Amplitudes fall with this power of the frequency; they are given for the centre of the band.
    order: u8,
}

enum GroupPaths {
    /// Material points, followed by the point targets where these belong to the group.
    Scatterers(Scatterers, bool),
    /// Paths of several reflections.
    Bounces(Bounces),
}

/// Statistics of a sum.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Node times of the group whose series is the worst.
    pub nodes: Option<NodeTimes>,
    /// Number of static paths.
    pub still_paths: usize,
    /// Velocity rows that were transformed.
    pub rows: usize,
    /// Velocity rows that no path touches.
    pub rows_skipped: usize,
    /// Half the length of the longest path that carries power [m].
    pub farthest: f64,
    /// Description of the plan, a line per group.
    pub plan: String,
    /// Run time of the stages.
    pub times: StageTimes,
}

impl Outcome {
    /// Add the statistics of another sum.
    pub fn add(&mut self, other: &Self) {
        let residual = |nodes: &Option<NodeTimes>| nodes.map_or(-1.0, |nodes| nodes.residual());
        if residual(&other.nodes) >= residual(&self.nodes) {
            self.nodes = other.nodes;
        }
        self.still_paths += other.still_paths;
        self.rows += other.rows;
        self.rows_skipped += other.rows_skipped;
        self.farthest = self.farthest.max(other.farthest);
        if !self.plan.is_empty() && !other.plan.is_empty() {
            self.plan.push('\n');
        }
        self.plan.push_str(&other.plan);
    }
}

/// Paths at one time, `(channel, path)`.
pub struct PathArrays {
    /// Two-way delay [s].
    pub delay: Vec<f64>,
    /// Rate of the delay [s/s].
    pub delay_rate: Vec<f64>,
    /// Amplitude without the phase of propagation [sqrt(W)].
    pub amplitude: Vec<Complex64>,
    /// Number of the body in the scene, of every path; for several reflections the last body.
    pub body: Vec<u32>,
    /// Power of the frequency by which amplitudes fall, of every path.
    pub order: Vec<u8>,
}

impl Groups {
    /// Group the scatterers of all hits and the paths of several reflections into static and moving ones, and by the
    /// power of the frequency.
    pub fn new(
        model: &Model,
        placement: &Placement,
        rays: &Rays,
        tubes: &mut Option<Image>,
        cancel: &Cancel,
    ) -> Result<Self> {
        let scatterers = rays.scatterers(model)?;
        cancel.check()?;
        let (bounces, bounce_counts) = rays.bounces(model, tubes)?;
        let (mut are_still, points_are_still) = (placement.are_still(), placement.points_are_still());
        let (deforming, num_points) = match &model.source {
            Source::Scene(scene) => (scene.deforming.clone(), scene.rcs.len()),
            Source::Depth(_) => (Vec::new(), 0),
        };
        for body in &deforming {
            are_still[*body] = false;
        }
        if matches!(&model.source, Source::Depth(image) if image.range_rate.is_some()) {
            are_still.fill(false);
        }

        let mut groups = Vec::new();
        let smooth = scatterers.cells().iter().zip(scatterers.orders());
        let farthest = smooth
            .filter(|(_, order)| **order > 0)
            .map(|(cell, _)| rays.distance(*cell));
        let farthest = farthest.fold(0.0, f64::max);
        let (num_scatterers, num_bounces) = (scatterers.len(), bounces.len());
        let num_cells = num_cells(scatterers.cells());
        let last_order = scatterers.orders().iter().copied().max().unwrap_or(0);
        for is_still in [true, false] {
            for order in 0..=last_order {
                let has_points = num_points > 0 && points_are_still == is_still && order == 0;
                let chosen = scatterers.select(|body, of| are_still[body as usize] == is_still && of == order);
                groups.push(Group {
                    paths: GroupPaths::Scatterers(chosen, has_points),
                    is_still,
                    order,
                });
            }
        }
        let parts = bounces.split(|body| are_still[body as usize]);
        for (bounces, is_still) in parts.into_iter().zip([true, false]) {
            groups.push(Group {
                paths: GroupPaths::Bounces(bounces),
                is_still,
                order: 0,
            });
        }
        groups.retain(|group| group.len(num_points) > 0);
        Ok(Self {
            all: groups,
            deforming: deforming.into_iter().map(|body| body as u32).collect(),
            num_points,
            num_scatterers,
            num_cells,
            farthest,
            num_bounces,
            bounces: bounce_counts,
        })
    }

    /// Number of paths.
    pub fn num_paths(&self) -> usize {
        self.num_scatterers + self.num_points + self.num_bounces
    }

    /// Cells that have a material point.
    pub fn num_cells(&self) -> usize {
        self.num_cells
    }

    /// Number of paths of several reflections, and counts of their rays.
    pub fn bounces(&self) -> (usize, bounces::Counts) {
        (self.num_bounces, self.bounces)
    }

    /// Distance of the farthest cell of paths that fall with the frequency [m], see [`Outcome::farthest`].
    pub fn farthest(&self) -> f64 {
        self.farthest
    }

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
        let mut cube = zeros(shape, model.settings.tolerance);
        let (mut outcome, mut times) = (Outcome::default(), StageTimes::default());
        if num_channels == 0 {
            return Ok((cube, outcome));
        }
        for group in &self.all {
            let paths = Evaluate {
                model,
                placement,
                group,
                deforming: &self.deforming,
            };
            let num_paths = group.len(self.num_points);
            let nodes = if group.is_still {
                NodeTimes::ONCE
            } else {
                let (highest, tolerance) = (model.highest_frequency(), model.settings.tolerance);
                let probe =
                    |number, selection| paths.take(&part.node_times(number), &part.node_times(number), selection);
                timed(&mut times.node_times, || {
                    node_times::choose(num_paths, num_channels, highest, tolerance, probe)
                })?
            };
            let [delays_at, amplitudes_at] = [nodes.delays, nodes.amplitudes].map(|number| part.node_times(number));
            let most = delays_at.len().max(amplitudes_at.len());
            let mut size = PIECE_NUMBERS / (num_channels * most);
            if model.settings.method == Method::Direct {
                size = size.min(PIECE_PATH_SAMPLES / shape.iter().product::<usize>());
            }
            for first in (0..num_paths).step_by(size.max(1)) {
                cancel.check()?;
                let selection = Selection {
                    first,
                    last: num_paths.min(first + size.max(1)),
                    step: 1,
                };
                let piece = timed(&mut times.paths, || paths.take(&delays_at, &amplitudes_at, selection))?;
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
                let options = model.options(selection.len(), shape[1]);
                let report = timed(&mut times.sum, || {
                    let (samples, report) = beat::beat_signal(&part.waveform, &series, &options)?;
                    add(&mut cube, samples, &over_frequency(&part.waveform, group.order));
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

    /// Evaluate all paths at one time: `at` and `rates` have one time each.
    pub fn arrays(&self, model: &Model, at: &Placement, rates: &Placement) -> Result<PathArrays> {
        let num_channels = model.array.num_channels();
        let Source::Scene(scene) = &model.source else {
            return Err(Error::value("source", "a scene", "an image"));
        };
        let mut per_channel: Vec<Vec<(f64, f64, Complex64)>> = vec![Vec::new(); num_channels];
        let (mut body, mut order) = (Vec::new(), Vec::new());
        for group in &self.all {
            let deforming = group.deforming(&self.deforming);
            let [kinematics, changes] = [at, rates].map(|placement| placement.at(&[0.0], &deforming));
            let rcs: &[f64] = if group.has_points() { &scene.rcs } else { &[] };
            let number = group.len(self.num_points);
            let selection = Selection {
                first: 0,
                last: number,
                step: 1,
            };
            let (paths, delay_rates) = kinematics.with(rcs, |kinematics| {
                changes.with(rcs, |changes| match &group.paths {
                    GroupPaths::Scatterers(scatterers, _) => (
                        scatterers.paths(kinematics, kinematics, selection),
                        scatterers.delay_rates(kinematics, changes),
                    ),
                    GroupPaths::Bounces(bounces) => (
                        bounces.paths(kinematics, kinematics, selection),
                        bounces.delay_rates(kinematics, changes),
                    ),
                })
            });
            let paths = finite(paths?, model)?;
            for (channel, rows) in per_channel.iter_mut().enumerate() {
                for path in channel * number..(channel + 1) * number {
                    rows.push((paths.delay[path], delay_rates[path], paths.amplitude[path]));
                }
            }
            match &group.paths {
                GroupPaths::Scatterers(scatterers, has_points) => {
                    body.extend(
                        scatterers
                            .bodies()
                            .iter()
                            .map(|body| scene.body_numbers[*body as usize] as u32),
                    );
                    if *has_points {
                        body.extend(scene.point_numbers.iter().map(|number| *number as u32));
                    }
                }
                GroupPaths::Bounces(bounces) => {
                    body.extend(
                        bounces
                            .last_bodies()
                            .map(|body| scene.body_numbers[body as usize] as u32),
                    );
                }
            }
            order.extend(std::iter::repeat_n(group.order, number));
        }
        let all = || per_channel.iter().flatten();
        Ok(PathArrays {
            delay: all().map(|path| path.0).collect(),
            delay_rate: all().map(|path| path.1).collect(),
            amplitude: all().map(|path| path.2).collect(),
            body,
            order,
        })
    }
}

impl Group {
    /// Number of paths, with `num_points` point targets.
    fn len(&self, num_points: usize) -> usize {
        match &self.paths {
            GroupPaths::Scatterers(scatterers, has_points) => {
                scatterers.len() + if *has_points { num_points } else { 0 }
            }
            GroupPaths::Bounces(bounces) => bounces.len(),
        }
    }

    fn has_points(&self) -> bool {
        matches!(self.paths, GroupPaths::Scatterers(_, true))
    }

    /// Indices, among `all` bodies that deform, of the bodies on the paths.
    fn deforming(&self, all: &[u32]) -> Vec<usize> {
        let met = match &self.paths {
            GroupPaths::Scatterers(scatterers, _) => scatterers.deforming(),
            GroupPaths::Bounces(bounces) => bounces.deforming(),
        };
        let place = |body: u32| all.iter().position(|other| *other == body);
        met.iter().filter_map(|(body, _)| place(*body)).collect()
    }
}

/// Evaluation of delays and amplitudes of a group at times of the frame.
struct Evaluate<'a> {
    model: &'a Model,
    placement: &'a Placement,
    group: &'a Group,
    deforming: &'a [u32],
}

impl Evaluate<'_> {
    /// Evaluate delays and amplitudes of the selected paths, each at their own times, `x` from -1 to 1 over the frame.
    fn take(&self, delays_at: &[f64], amplitudes_at: &[f64], selection: Selection) -> Result<Paths> {
        let rcs: &[f64] = match &self.model.source {
            Source::Scene(scene) if self.group.has_points() => &scene.rcs,
            _ => &[],
        };
        let deforming = self.group.deforming(self.deforming);
        let [delays, amplitudes] = [delays_at, amplitudes_at].map(|times| self.placement.at(times, &deforming));
        let paths = delays.with(rcs, |delays| {
            amplitudes.with(rcs, |amplitudes| match &self.group.paths {
                GroupPaths::Scatterers(scatterers, _) => scatterers.paths(delays, amplitudes, selection),
                GroupPaths::Bounces(bounces) => bounces.paths(delays, amplitudes, selection),
            })
        });
        let mut paths = finite(paths?, self.model)?;
        if let (Source::Depth(image), GroupPaths::Scatterers(scatterers, _)) = (&self.model.source, &self.group.paths)
            && let Some(rates) = &image.range_rate
        {
            // The surface of a pixel moves on at the range rate of the pixel.
            let cells = &scatterers.cells()[selection.first..selection.last];
            let num_channels = scatterers.num_channels();
            for (row, delays) in paths.delay.chunks_mut(selection.len().max(1)).enumerate() {
                let x = delays_at[row / num_channels];
                let elapsed = image.age + 0.5 * self.model.waveform.duration() * (1.0 + x);
                for (delay, cell) in delays.iter_mut().zip(cells.iter().step_by(selection.step)) {
                    *delay += 2.0 / SPEED_OF_LIGHT * rates[*cell as usize] * elapsed;
                }
            }
        }
        Ok(paths)
    }
}

/// Check that no path has length zero.
fn finite(paths: Paths, model: &Model) -> Result<Paths> {
    let sum: Complex64 = paths.amplitude.iter().sum();
    if sum.is_finite() {
        return Ok(paths);
    }
    let name = match model.source {
        Source::Scene(_) => "scene",
        Source::Depth(_) => "distance",
    };
    Err(Error::value(
        name,
        "nothing at the place of an antenna",
        "a path of length zero",
    ))
}

fn count_of_times(number: usize) -> String {
    format!("{number} time{}", if number == 1 { "" } else { "s" })
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

/// Cells that have a material point.
fn num_cells(cells: &[u32]) -> usize {
    let mut cells: Vec<u32> = cells.iter().copied().filter(|cell| *cell != NO_CELL).collect();
    cells.sort_unstable();
    cells.dedup();
    cells.len()
}

/// Field at the frequency of every sample over the field at the centre of the band, for fields that fall with a power
/// of the frequency; empty for power 0.
fn over_frequency(waveform: &Waveform, order: u8) -> Vec<f64> {
    if order == 0 {
        return Vec::new();
    }
    let frequency = |sample| waveform.start_frequency + waveform.slope * waveform.sample_time(sample);
    let ratio = |sample| (waveform.center_frequency() / frequency(sample)).powi(i32::from(order));
    (0..waveform.num_samples).map(ratio).collect()
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
