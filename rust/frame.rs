//! The pipeline: poses in, ideal beat signal of a frame out.
//!
//! ```text
//! motion ── posed scene ── rays ── scatterers, bounces ── node times ── delays, amplitudes ── samples
//!                            └──────────────────────────────────────────────────────────────── truth
//! ```
//!
//! [`simulate`] has one line per stage. A frame whose bodies turn fast is cast in parts, one after the other.

mod groups;
mod lanes;
mod model;
mod outcome;
mod parts;
mod rays;
mod stages;
mod sum;
mod truth;

use std::sync::Arc;

use glam::DVec3;

use crate::cancel::Cancel;
use crate::error::{Result, fits_memory};
use crate::paths::placement::World;
use crate::rays::scene::Occlusion;
use crate::synthesis::beat::Samples;

pub use groups::PathArrays;
pub use model::{DepthImage, Model, RaySampling, Scene, Settings, Source};
pub use outcome::Outcome;
pub use rays::Image;
pub use truth::Truth;

use groups::{Groups, Motions};
use model::Shapes;
use parts::Part;
use rays::Rays;
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

/// Counts of rays and paths of a frame, summed over its parts, and the worst errors.
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
    /// Statistics of the sum.
    pub sum: Outcome,
    /// Distance of the farthest echo [m].
    pub farthest: f64,
    /// Error of phases by the series of the motion [rad].
    pub motion_error: f64,
    /// Numbers, in the scene, of the bodies and point targets whose motion needs more times than the others', and which
    /// have a sum of their own.
    pub rough: Vec<usize>,
    /// Run time of every stage.
    pub times: StageTimes,
}

/// Simulate a frame. `motion`: positions at the Chebyshev times of the frame, in the world; `rates`: time derivatives,
/// which a frame of a single sample needs, as its times are all the same. None where the times are too few for the motion.
pub fn simulate(
    model: &Model,
    motion: &World,
    rates: Option<&World>,
    memory: &mut Memory,
    cancel: &Cancel,
) -> Result<Option<Frame>> {
    let mut times = StageTimes::default();
    let placement = timed(&mut times.motion, || model.placement(motion))?;
    let motion_error = model.phase_error(&placement);
    if motion_error > MOTION_SHARE * model.settings.tolerance && placement.num_times() < MOST_TIMES {
        return Ok(None);
    }
    let rates = timed(&mut times.motion, || match rates {
        Some(rates) => model.rates(&placement, motion, rates),
        None => Ok(placement.rates(model.waveform.duration())),
    })?;

    let mut frame = FrameBuilder::new(model)?;
    for part in parts::of_frame(model, &placement) {
        cancel.check()?;
        let (rays, motions) = timed(&mut times.rays, || {
            let scene = model.posed(&placement, part.cast, &mut memory.shapes)?;
            let rays = || Rays::cast(model, &scene, &part.turns, memory.rays.as_ref(), cancel);
            let (rays, motions) = rayon::join(rays, || Motions::new(model, &placement, &part));
            Ok((rays?, motions))
        })?;
        // Freeing thousands of tiles takes as long as a stage: beside the next ones.
        if let Some(before) = memory.rays.take() {
            rayon::spawn(move || drop(before));
        }
        let groups = timed(&mut times.scatterers, || {
            Groups::new(model, motions, &rays, &mut memory.tubes, cancel)
        })?;
        let (samples, outcome) = groups.sum(model, &placement, &part, cancel)?;
        frame.add(&part, samples, &outcome, &rays, &groups);
        if part.has_middle {
            frame.truth = timed(&mut times.truth, || truth::of(model, &rays, &placement, &rates));
        }
        memory.rays = Some(rays);
    }
    frame.counts.times.add(&times);
    Ok(Some(frame.finish(motion_error)))
}

/// Paths at one time, from the rays of the first part of the frame of a motion; `at` and `rates_at`: positions and time
/// derivatives at that time.
pub fn paths(
    model: &Model,
    motion: &World,
    (at, rates_at): (&World, &World),
    memory: &mut Memory,
    cancel: &Cancel,
) -> Result<PathArrays> {
    let placement = model.placement(motion)?;
    let part = &parts::of_frame(model, &placement)[0];
    let scene = model.posed(&placement, part.cast, &mut memory.shapes)?;
    let rays = Rays::cast(model, &scene, &part.turns, memory.rays.as_ref(), cancel)?;
    let motions = Motions::new(model, &placement, part);
    let groups = Groups::new(model, motions, &rays, &mut memory.tubes, cancel)?;
    memory.rays = Some(rays);
    let at_seen = model.placement(at)?;
    groups.arrays(model, &at_seen, &model.rates(&at_seen, at, rates_at)?)
}

/// Image of the hits of rays at one time.
pub fn image(model: &Model, at: &World, memory: &mut Memory, cancel: &Cancel) -> Result<Arc<Image>> {
    let placement = model.placement(at)?;
    let scene = model.posed(&placement, 0.0, &mut memory.shapes)?;
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
    let placement = model.placement(at)?;
    let scene = model.posed(&placement, 0.0, &mut memory.shapes)?;
    Ok(scene.occluded(points, ends_early))
}

/// Frame under construction, part by part.
struct FrameBuilder<'a> {
    model: &'a Model,
    cube: Option<Samples>,
    truth: Option<Truth>,
    counts: Counts,
}

impl<'a> FrameBuilder<'a> {
    fn new(model: &'a Model) -> Result<Self> {
        let shape = [
            model.array.num_channels(),
            model.waveform.chirp_times.len(),
            model.waveform.num_samples,
        ];
        fits_memory("samples", &shape, 2 * size_of::<num_complex::Complex64>())?;
        Ok(Self {
            model,
            cube: None,
            truth: None,
            counts: Counts::default(),
        })
    }

    fn add(&mut self, part: &Part, samples: Samples, outcome: &Outcome, rays: &Rays, groups: &Groups) {
        let counts = &mut self.counts;
        let (cast, hit, (num_bounces, bounces)) = (rays.counts(), rays.num_hit(), groups.bounces());
        counts.casts += 1;
        counts.rays_cast += cast.rays;
        counts.rays_hit += hit;
        counts.tiles_skipped += cast.tiles_skipped;
        counts.tiles_reused += cast.tiles_reused;
        if let Some(number) = rays.num_coarse() {
            *counts.cells_not_split.get_or_insert(0) += number;
        }
        counts.paths += groups.num_paths();
        let lit = rays.num_lit().unwrap_or_else(|| groups.num_cells());
        counts.paths_skipped += hit.saturating_sub(lit);
        counts.bounce_paths += num_bounces;
        counts.bounce_rays += bounces.rays;
        counts.bounces_stopped += bounces.stopped;
        counts.bounces_not_split += bounces.coarse;
        counts.farthest = counts.farthest.max(outcome.farthest).max(groups.farthest());
        counts.rough.extend_from_slice(groups.rough());
        counts.rough.sort_unstable();
        counts.rough.dedup();
        counts.sum.add(outcome);
        counts.times.add(&outcome.times);

        // A part has some of the chirps of every channel.
        let (num_chirps, num_samples) = (self.model.waveform.chirp_times.len(), self.model.waveform.num_samples);
        if part.chirps.len() == num_chirps {
            self.cube = Some(samples);
            return;
        }
        let shape = [self.model.array.num_channels(), num_chirps, num_samples];
        let cube = self
            .cube
            .get_or_insert_with(|| sum::zeros(shape, self.model.settings.tolerance));
        match (cube, samples) {
            (Samples::Single(cube), Samples::Single(samples)) => place(cube, &samples, part, num_chirps, num_samples),
            (Samples::Double(cube), Samples::Double(samples)) => place(cube, &samples, part, num_chirps, num_samples),
            _ => unreachable!("one tolerance, one precision"),
        }
    }

    fn finish(self, motion_error: f64) -> Frame {
        let shape = [
            self.model.array.num_channels(),
            self.model.waveform.chirp_times.len(),
            self.model.waveform.num_samples,
        ];
        Frame {
            cube: self
                .cube
                .unwrap_or_else(|| sum::zeros(shape, self.model.settings.tolerance)),
            truth: self.truth,
            counts: Counts {
                motion_error,
                ..self.counts
            },
        }
    }
}

/// Put the samples of a part into the cube of its frame.
fn place<T: Copy>(cube: &mut [T], samples: &[T], part: &Part, num_chirps: usize, num_samples: usize) {
    let rows = samples.chunks_exact(part.chirps.len() * num_samples);
    for (frame, rows) in cube.chunks_exact_mut(num_chirps * num_samples).zip(rows) {
        let first = part.chirps.start * num_samples;
        frame[first..first + rows.len()].copy_from_slice(rows);
    }
}
