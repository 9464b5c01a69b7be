//! The pipeline: poses in, ideal beat signal of a frame out.
//!
//! ```text
//! motion ── posed scene ── rays ── scatterers, bounces ── node times ── delays, amplitudes ── samples
//!                            └──────────────────────────────────────────────────────────────── truth
//! ```
//!
//! [`simulate`] has one line per stage. A frame whose bodies turn fast is cast in spans of chirps, one after the other.

mod counts;
mod model;
mod path_groups;
mod rays;
mod spans;
mod truth;

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use crate::cancel::Cancel;
use crate::error::{Result, fits_memory};
use crate::paths::kinematics::World;
use crate::rays::hits::Hits;
use crate::rays::surface::Surface;
use crate::synthesis::beat_signal::sum_groups;
use crate::synthesis::report::Samples;

pub use counts::FrameCounts;
pub use model::{Model, RaySampling, Scene, Settings, Source, Switches};
pub use path_groups::PathArrays;

use path_groups::{PathGroups, PathsAtNodes, motions};
use rays::Rays;
use spans::Span;

/// Share of the tolerance for the error of the series of motions.
const MOTION_SHARE: f64 = 0.1;

/// Largest number of times of a motion.
const MOST_TIMES: usize = 65;

/// A simulated frame before the receiver.
pub struct Frame {
    /// Beat samples `(channel, chirp, sample)`.
    pub cube: Samples,
    /// Range [m], range rate [m/s], azimuth and elevation [rad] of the nearest visible point of every body and point
    /// target, in the order of the scene; NaN where no ray hit. None for images.
    pub truth: Option<Vec<[f64; 4]>>,
    /// Counts of rays and paths, errors and run times.
    pub counts: FrameCounts,
}

/// Rays and surfaces kept from frame to frame: static tiles are not cast again. Results do not depend on the memory.
#[derive(Default)]
pub struct Memory {
    /// Rays of the frame before.
    rays: Option<Rays>,
    /// Surfaces of bodies that deform, by body.
    deformed: HashMap<usize, Arc<Surface>>,
}

/// Answer to the motion of a frame.
pub enum Answer {
    /// The frame.
    Done(Box<Frame>),
    /// The times are too few for the motion.
    MoreTimes,
}

/// Simulate a frame. `world`: positions at the Chebyshev times of the frame; `rates`: time derivatives, which a frame
/// of a single sample needs, as its times are all the same.
pub fn simulate(
    model: &Model,
    world: &World,
    rates: Option<&World>,
    memory: &mut Memory,
    cancel: &Cancel,
) -> Result<Answer> {
    let mut counts = FrameCounts::default();
    let motion = counts.timed("motion", || model.motion(world))?;
    counts.motion_error = model.phase_error(&motion);
    if counts.motion_error > MOTION_SHARE * model.settings.tolerance && motion.num_times() < MOST_TIMES {
        return Ok(Answer::MoreTimes);
    }
    let rates = counts.timed("motion", || match rates {
        Some(rates) => model.rates(world, rates),
        None => Ok(motion.rates(model.waveform.duration())),
    })?;

    fits_memory("samples", &model.shape(), 2 * size_of::<num_complex::Complex64>())?;
    let mut cube = Samples::zeros(model.shape(), model.settings.tolerance);
    let mut truth = None;
    for span in spans::of_frame(model, &motion) {
        cancel.check()?;
        let (rays, motions) = counts.timed("rays", || {
            let scene = model.posed(&motion, span.cast, &mut memory.deformed)?;
            let rays = || Rays::cast(model, &scene, &span.rotation_angles, memory.rays.as_ref(), cancel);
            let (rays, motions) = rayon::join(rays, || motions(model, &motion, &span));
            Ok((rays?, motions))
        })?;
        // Freeing thousands of tiles takes as long as a stage: beside the next ones.
        if let Some(before) = memory.rays.take() {
            rayon::spawn(move || drop(before));
        }
        let groups = counts.timed("scatterers", || PathGroups::new(model, &motions, &rays, cancel))?;
        let options = model.options(groups.len(), span.chirps.len(), cancel);
        let paths = counts.timed("node times", || {
            groups.at_nodes(model, &motion, &span, options.is_parallel)
        });
        let (samples, report) = counts.timed("sum over paths", || {
            let sources: Vec<_> = paths.iter().map(PathsAtNodes::group).collect();
            let num_channels = model.array.num_channels();
            sum_groups(&span.waveform, num_channels, &sources, model.settings.method, &options)
        })?;
        place(&mut cube, model.shape(), &span, samples);
        counts.add(&rays, &groups, &paths, &report);
        if span.has_middle {
            truth = counts.timed("truth", || truth::of(model, &rays, &motion, &rates));
        }
        memory.rays = Some(rays);
    }
    Ok(Answer::Done(Box::new(Frame { cube, truth, counts })))
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
    let scene = model.posed(&motion, span.cast, &mut memory.deformed)?;
    let rays = Rays::cast(model, &scene, &span.rotation_angles, memory.rays.as_ref(), cancel)?;
    let motions = motions(model, &motion, span);
    let groups = PathGroups::new(model, &motions, &rays, cancel)?;
    memory.rays = Some(rays);
    groups.arrays(model, &model.motion(at)?, &model.rates(at, rates_at)?)
}

/// Hits of the rays of an image at one time.
pub fn image(model: &Model, at: &World, memory: &mut Memory, cancel: &Cancel) -> Result<Hits> {
    let motion = model.motion(at)?;
    let scene = model.posed(&motion, 0.0, &mut memory.deformed)?;
    model.cast_image(&scene, cancel)
}

/// Points of the sensor frame (about the middle of the array) that bodies occlude at one time.
pub fn occluded(model: &Model, at: &World, points: &[DVec3], memory: &mut Memory) -> Result<Vec<bool>> {
    let motion = model.motion(at)?;
    let scene = model.posed(&motion, 0.0, &mut memory.deformed)?;
    Ok(scene.occluded(points))
}

/// Put the samples of a span in their place.
fn place(cube: &mut Samples, [_, num_chirps, num_samples]: [usize; 3], span: &Span, samples: Samples) {
    fn copy<T: Copy>(cube: &mut [T], samples: &[T], per_channel: usize, chirps: Range<usize>) {
        let channels = samples.chunks_exact(chirps.len());
        for (channel, samples) in cube.chunks_exact_mut(per_channel).zip(channels) {
            channel[chirps.clone()].copy_from_slice(samples);
        }
    }
    let per_channel = num_chirps * num_samples;
    let chirps = span.chirps.start * num_samples..span.chirps.end * num_samples;
    match (cube, samples) {
        (cube, samples) if chirps.len() == per_channel => *cube = samples,
        (Samples::Single(cube), Samples::Single(samples)) => copy(cube, &samples, per_channel, chirps),
        (Samples::Double(cube), Samples::Double(samples)) => copy(cube, &samples, per_channel, chirps),
        _ => unreachable!("one tolerance, one precision"),
    }
}
