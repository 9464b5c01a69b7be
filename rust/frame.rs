//! The pipeline: poses in, ideal beat signal of a frame out.
//!
//! ```text
//! motion ── posed scene ── rays ── scatterers, bounces ── node times ── delays, amplitudes ── samples
//!                            └──────────────────────────────────────────────────────────────── truth
//! ```
//!
//! [`simulate`] has one line per stage. A frame whose bodies turn fast is cast in spans of chirps, one after the other.

mod model;
mod path_groups;
mod rays;
mod spans;
mod stages;
mod truth;

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Result, fits_memory};
use crate::paths::node_times::NodeTimes;
use crate::paths::sensor_motion::World;
use crate::rays::scene::Occlusion;
use crate::synthesis::beat_signal::sum_groups;
use crate::synthesis::report::{Report, Samples};
use crate::synthesis::source::{PathSource, Shape};

pub use model::{DepthImage, Model, RaySampling, Scene, Settings, Source};
pub use path_groups::PathArrays;
pub use rays::Image;
pub use truth::Truth;

use model::Shapes;
use path_groups::{Motions, PathGroups, PathsAtNodes};
use rays::Rays;
use spans::Span;
use stages::{StageTimes, timed};

/// Share of the tolerance for the error of the series of motions.
const MOTION_SHARE: f64 = 0.1;

/// Largest number of times of a motion.
const MOST_TIMES: usize = 65;

/// A simulated frame before the receiver.
pub struct Frame {
    /// Beat samples `(channel, chirp, sample)`.
    pub cube: Samples,
    /// Per body and point target, in the order of the scene; none for images.
    pub truth: Option<Truth>,
    /// Counts of rays and paths, errors and run times.
    pub counts: Counts,
}

/// Rays and surfaces kept from frame to frame: static tiles are not cast again. Results do not depend on the memory.
#[derive(Default)]
pub struct Memory {
    /// Rays of the frame before.
    rays: Option<Rays>,
    /// Rays that launched ray tubes, with adaptive sampling, of every sector.
    tubes: Vec<Image>,
    /// The image before.
    image: Option<Arc<Image>>,
    shapes: Shapes,
}

/// Counts of rays and paths of a frame, summed over its spans, and the worst errors.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Times at which rays were cast.
    pub casts: usize,
    /// Rays that were cast.
    pub rays_cast: usize,
    /// Rays that hit a body.
    pub rays_hit: usize,
    /// Tiles left out.
    pub tiles_skipped: usize,
    /// Tiles taken over from the frame before.
    pub tiles_reused: usize,
    /// Cells of adaptive sampling that could be split further; none without adaptive sampling.
    pub cells_not_split: Option<usize>,
    /// Paths, those of several reflections included.
    pub paths: usize,
    /// Hits that return nothing.
    pub paths_skipped: usize,
    /// Paths of several reflections.
    pub bounce_paths: usize,
    /// Rays from one surface to the next.
    pub bounce_rays: usize,
    /// Ray tubes that ended at the floor.
    pub bounces_stopped: usize,
    /// Cells of ray tubes that were not quartered, as there were too many.
    pub bounces_not_split: usize,
    /// Static paths.
    pub static_paths: usize,
    /// The most node times of all groups of paths, and the largest errors of the series through them.
    pub node_times: NodeTimes,
    /// Descriptions of the sums, a line per span.
    pub plan: Vec<String>,
    /// Distance of the farthest echo [m].
    pub farthest: f64,
    /// Error of phases by the series of the motion [rad].
    pub motion_error: f64,
    /// Numbers, in the scene, of the bodies and point targets in fast-varying motion, which needs more node times than the
    /// others'.
    pub fast_varying: Vec<usize>,
    /// Run time of every stage.
    pub times: StageTimes,
}

/// Answer to the motion of a frame.
pub enum Answer {
    /// The frame.
    Done(Box<Frame>),
    /// The times are too few for the motion.
    MoreTimes,
}

/// Simulate a frame. `world`: positions at the Chebyshev times of the frame; `rates`: time derivatives, which a frame of a
/// single sample needs, as its times are all the same.
pub fn simulate(
    model: &Model,
    world: &World,
    rates: Option<&World>,
    memory: &mut Memory,
    cancel: &Cancel,
) -> Result<Answer> {
    let mut times = StageTimes::default();
    let motion = timed(&mut times.motion, || model.motion(world))?;
    let motion_error = model.phase_error(&motion);
    if motion_error > MOTION_SHARE * model.settings.tolerance && motion.num_times() < MOST_TIMES {
        return Ok(Answer::MoreTimes);
    }
    let rates = timed(&mut times.motion, || match rates {
        Some(rates) => model.rates(&motion, world, rates),
        None => Ok(motion.rates(model.waveform.duration())),
    })?;

    let mut frame = Frame::zeros(model)?;
    for span in spans::of_frame(model, &motion) {
        cancel.check()?;
        let (rays, motions) = timed(&mut times.rays, || {
            let scene = model.posed(&motion, span.cast, &mut memory.shapes)?;
            let rays = || Rays::cast(model, &scene, &span.rotation_angles, memory.rays.as_ref(), cancel);
            let (rays, motions) = rayon::join(rays, || Motions::new(model, &motion, &span));
            Ok((rays?, motions))
        })?;
        // Freeing thousands of tiles takes as long as a stage: beside the next ones.
        if let Some(before) = memory.rays.take() {
            rayon::spawn(move || drop(before));
        }
        let groups = timed(&mut times.scatterers, || {
            PathGroups::new(model, &motions, &rays, &mut memory.tubes, cancel)
        })?;
        let options = model.options(groups.len(), span.chirps.len(), cancel);
        let paths = timed(&mut times.node_times, || {
            groups.at_nodes(model, &motion, &span, options.is_parallel)
        });
        let (samples, report) = timed(&mut times.sum, || {
            let sources: Vec<_> = paths.iter().map(PathsAtNodes::group).collect();
            let num_channels = model.array.num_channels();
            sum_groups(&span.waveform, num_channels, &sources, model.settings.method, &options)
        })?;
        frame.add(model.shape(), &span, samples);
        frame.counts.add(&rays, &groups, &paths, &report);
        if span.has_middle {
            frame.truth = timed(&mut times.truth, || truth::of(model, &rays, &motion, &rates));
        }
        memory.rays = Some(rays);
    }
    frame.counts.motion_error = motion_error;
    frame.counts.times = times;
    Ok(Answer::Done(Box::new(frame)))
}

/// Paths at one time, from the rays of the first span of the frame of a motion; `at` and `rates_at`: positions and time
/// derivatives at that time.
pub fn paths(
    model: &Model,
    world: &World,
    (at, rates_at): (&World, &World),
    memory: &mut Memory,
    cancel: &Cancel,
) -> Result<PathArrays> {
    let motion = model.motion(world)?;
    let span = &spans::of_frame(model, &motion)[0];
    let scene = model.posed(&motion, span.cast, &mut memory.shapes)?;
    let rays = Rays::cast(model, &scene, &span.rotation_angles, memory.rays.as_ref(), cancel)?;
    let motions = Motions::new(model, &motion, span);
    let groups = PathGroups::new(model, &motions, &rays, &mut memory.tubes, cancel)?;
    memory.rays = Some(rays);
    let at_seen = model.motion(at)?;
    groups.arrays(model, &at_seen, &model.rates(&at_seen, at, rates_at)?)
}

/// Image of the hits of rays at one time.
pub fn image(model: &Model, at: &World, memory: &mut Memory, cancel: &Cancel) -> Result<Arc<Image>> {
    let motion = model.motion(at)?;
    let scene = model.posed(&motion, 0.0, &mut memory.shapes)?;
    let image = Arc::new(model.cast_image(scene, memory.image.as_deref(), cancel)?);
    memory.image = Some(image.clone());
    Ok(image)
}

/// Points of the sensor frame (about the middle of the array) that bodies occlude at one time.
pub fn occluded(
    model: &Model,
    at: &World,
    points: &[DVec3],
    ends_early: bool,
    memory: &mut Memory,
) -> Result<Occlusion> {
    let motion = model.motion(at)?;
    let scene = model.posed(&motion, 0.0, &mut memory.shapes)?;
    Ok(scene.occluded(points, ends_early))
}

impl Frame {
    /// Samples of zero and no counts.
    fn zeros(model: &Model) -> Result<Self> {
        let shape = model.shape();
        fits_memory("samples", &shape, 2 * size_of::<num_complex::Complex64>())?;
        Ok(Self {
            cube: Samples::zeros(shape, model.settings.tolerance),
            truth: None,
            counts: Counts::default(),
        })
    }

    /// Take the samples of a span.
    fn add(&mut self, [_, num_chirps, num_samples]: [usize; 3], span: &Span, samples: Samples) {
        fn place<T: Copy>(cube: &mut [T], samples: &[T], per_channel: usize, chirps: Range<usize>) {
            let channels = samples.chunks_exact(chirps.len());
            for (channel, samples) in cube.chunks_exact_mut(per_channel).zip(channels) {
                channel[chirps.clone()].copy_from_slice(samples);
            }
        }
        let per_channel = num_chirps * num_samples;
        let chirps = span.chirps.start * num_samples..span.chirps.end * num_samples;
        match (&mut self.cube, samples) {
            (cube, samples) if chirps.len() == per_channel => *cube = samples,
            (Samples::Single(cube), Samples::Single(samples)) => place(cube, &samples, per_channel, chirps),
            (Samples::Double(cube), Samples::Double(samples)) => place(cube, &samples, per_channel, chirps),
            _ => unreachable!("one tolerance, one precision"),
        }
    }
}

impl Counts {
    /// Add the counts of a span.
    fn add(&mut self, rays: &Rays, groups: &PathGroups, paths: &[PathsAtNodes], report: &Report) {
        let (cast, hit, (num_bounces, bounces)) = (rays.counts(), rays.num_hit(), groups.bounces);
        self.casts += 1;
        self.rays_cast += cast.rays;
        self.rays_hit += hit;
        self.tiles_skipped += cast.tiles_skipped;
        self.tiles_reused += cast.tiles_reused;
        if let Some(number) = rays.num_coarse() {
            *self.cells_not_split.get_or_insert(0) += number;
        }
        self.paths += groups.len();
        let lit = rays.num_lit().unwrap_or_else(|| groups.num_cells());
        self.paths_skipped += hit.saturating_sub(lit);
        self.bounce_paths += num_bounces;
        self.bounce_rays += bounces.rays;
        self.bounces_stopped += bounces.stopped;
        self.bounces_not_split += bounces.coarse;
        let shapes = paths.iter().map(PathsAtNodes::shape).filter(Shape::is_static);
        self.static_paths += shapes.map(|shape| shape.paths).sum::<usize>();
        self.farthest = self
            .farthest
            .max(0.5 * SPEED_OF_LIGHT * report.longest)
            .max(groups.farthest);
        self.fast_varying.extend_from_slice(&groups.fast_varying);
        self.fast_varying.sort_unstable();
        self.fast_varying.dedup();
        let nodes = paths.iter().map(|paths| paths.node_times).reduce(NodeTimes::max);
        if let Some(nodes) = nodes {
            let [delays, amplitudes] = [nodes.delays, nodes.amplitudes].map(|n| match n {
                1 => "1 time".to_owned(),
                _ => format!("{n} times"),
            });
            self.plan
                .push(format!("delays at {delays}, amplitudes at {amplitudes}; {report}"));
            self.node_times = self.node_times.max(nodes);
        }
    }
}
