//! Groups of paths that are summed together, and the paths of a group at node times: a source of delays and amplitudes.

use std::ops::Range;

use num_complex::Complex64;
use rayon::prelude::*;

use super::model::{Model, Scene, Source};
use super::rays::Rays;
use super::spans::Span;
use crate::bounces::{self, Bounces};
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result};
use crate::numeric::parallel;
use crate::numeric::simd::Precision;
use crate::paths::kinematics::{Kinematics, Motion};
use crate::paths::node_times::{self, NodeTimes};
use crate::paths::scatterers::Scatterers;
use crate::synthesis::chunk::{CHUNK, Chunk};
use crate::synthesis::delay::Basis;
use crate::synthesis::source::{PathGroup, PathSource, Request, Shape};

/// Most times that describe a smooth motion: with more, a chirp-wise sum has blocks of chirps.
const SMOOTH_TIMES: usize = 8;

/// Share of the tolerance for the phase error of a series over the times of a smooth motion.
const SMOOTH_SHARE: f64 = 0.5;

/// Power of two that brings amplitudes of radars to the middle of single precision.
const SCALE: f64 = 1_073_741_824.0; // 2^30

/// Paths of a span of a frame, by motion of the bodies and power of the frequency.
pub struct PathGroups {
    groups: Vec<MotionGroup>,
    /// Material points and point targets of all groups.
    scatterers: Scatterers,
    /// Number of paths of several reflections, and counts of their rays.
    pub bounces: (usize, bounces::TubeCounts),
    /// Numbers, in the scene, of the bodies and point targets in fast-varying motion that have a path, increasing.
    pub fast_varying: Vec<usize>,
}

/// Paths that are summed together.
struct MotionGroup {
    paths: Paths,
    /// Motion of the bodies and points; delays and amplitudes of static ones do not change within the frame.
    motion: Motion,
    /// Amplitudes fall with this power of the frequency; they are given for the centre of the band.
    frequency_exponent: u8,
}

enum Paths {
    /// Material points, or all point targets, by number.
    Scatterers(Range<usize>),
    /// Paths of several reflections.
    Bounces(Box<Bounces>),
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
    pub frequency_exponent: Vec<u8>,
}

/// Paths of a group at node times of delays and of amplitudes.
pub struct PathsAtNodes<'a> {
    model: &'a Model,
    scatterers: &'a Scatterers,
    group: &'a MotionGroup,
    /// Kinematics at the node times of the delays, and at the node times of the amplitudes.
    nodes: [Kinematics; 2],
    /// Node times of the delays after the start of the frame [s].
    elapsed: Vec<f64>,
    /// The node times, and what they leave out.
    pub node_times: NodeTimes,
}

impl PathGroups {
    /// Group the scatterers of all hits and the paths of several reflections by motion, and by the power of the
    /// frequency; `motions`: of every body, and last of all point targets.
    pub fn new(model: &Model, motions: &[Motion], rays: &Rays, cancel: &Cancel) -> Result<Self> {
        let motion_of = |body: u32| motions[body as usize];
        let mut scatterers = rays.scatterers(model, |body| motion_of(body) as u8);
        scatterers.rcs = model.source.rcs().to_vec();
        cancel.check()?;
        let (bounces, bounce_counts) = rays.bounces(model, cancel)?;
        let num_bounces = bounces.len();

        // Static ones come first, and within each the powers of the frequency.
        let key = |number: usize| match scatterers.body.get(number) {
            Some(body) => (motion_of(*body), scatterers.kind(number).frequency_exponent(), false),
            None => (motions[motions.len() - 1], 0, true),
        };
        let mut groups = Vec::new();
        let (mut first, num_paths) = (0, scatterers.num_paths());
        while first < num_paths {
            let of_first = key(first);
            let end = first + (first..num_paths).take_while(|number| key(*number) == of_first).count();
            groups.push(MotionGroup {
                paths: Paths::Scatterers(first..end),
                motion: of_first.0,
                frequency_exponent: of_first.1,
            });
            first = end;
        }
        // Paths over several bodies vary as the fastest of these.
        let mut rest = bounces;
        for motion in [Motion::Static, Motion::Smooth, Motion::FastVarying] {
            let [group, others] = rest.split(|body| motion_of(body) <= motion);
            if group.len() > 0 {
                groups.push(MotionGroup {
                    paths: Paths::Bounces(Box::new(group)),
                    motion,
                    frequency_exponent: 0,
                });
            }
            rest = others;
        }
        Ok(Self {
            fast_varying: fast_varying(model, &groups, &scatterers),
            groups,
            scatterers,
            bounces: (num_bounces, bounce_counts),
        })
    }

    /// Number of paths.
    pub fn len(&self) -> usize {
        self.scatterers.num_paths() + self.bounces.0
    }

    /// The paths of all groups at node times of a span, which are chosen for the tolerance.
    pub fn at_nodes<'a>(
        &'a self,
        model: &'a Model,
        motion: &Kinematics,
        span: &Span,
        is_parallel: bool,
    ) -> Vec<PathsAtNodes<'a>> {
        parallel::map(is_parallel, self.groups.iter().collect(), |group| {
            let at = |node_times| PathsAtNodes::new(model, &self.scatterers, group, motion, span, node_times);
            if group.motion == Motion::Static {
                return at(NodeTimes::ONCE);
            }
            let probe = |number| {
                let probed = NodeTimes {
                    delays: number,
                    amplitudes: number,
                    ..NodeTimes::ONCE
                };
                at(probed).probe()
            };
            let (num_channels, frequency) = (model.array.num_channels(), model.highest_frequency());
            at(node_times::choose(
                num_channels,
                frequency,
                model.settings.tolerance,
                probe,
            ))
        })
    }

    /// Evaluate all paths at one time: `at` and `rates` have one time each.
    pub fn arrays(&self, model: &Model, at: &Kinematics, rates: &Kinematics) -> Result<PathArrays> {
        let Source::Scene(scene) = &model.source else {
            return Err(Error::value("source", "a scene", "an image"));
        };
        let num_channels = model.array.num_channels();
        let mut per_channel: Vec<Vec<(f64, f64, Complex64)>> = vec![Vec::new(); num_channels];
        let (mut body, mut frequency_exponent) = (Vec::new(), Vec::new());
        for group in &self.groups {
            let paths = PathsAtNodes {
                model,
                scatterers: &self.scatterers,
                group,
                nodes: [at.clone(), at.clone()],
                elapsed: Vec::new(),
                node_times: NodeTimes::ONCE,
            };
            let num_paths = group.len();
            let delay_rate = |i: usize| match &group.paths {
                Paths::Scatterers(range) => {
                    let path = range.start + i % num_paths;
                    self.scatterers.delay_rate(at, rates, i / num_paths, path)
                }
                Paths::Bounces(bounces) => bounces.delay_rate(at, rates, i / num_paths, i % num_paths),
            };
            let all = (0..num_channels * num_paths).into_par_iter();
            let delay_rates: Vec<f64> = all.map(delay_rate).collect();
            let (shape, level) = (paths.shape(), model.settings.debug.level);
            let mut chunk = Chunk::<f64>::new(&shape, num_channels);
            for number in 0..num_paths.div_ceil(CHUNK) {
                let request = Request::of_chunk(number, &shape, 0..num_channels, 1.0, level);
                paths.fill_double(&request, &mut chunk);
                for (channel, rows) in per_channel.iter_mut().enumerate() {
                    for (lane, path) in request.paths.clone().enumerate() {
                        let amplitude = Complex64::new(chunk.re[channel][lane], chunk.im[channel][lane]);
                        if !amplitude.is_finite() {
                            return Err(paths.not_finite());
                        }
                        let rate = delay_rates[channel * num_paths + path];
                        rows.push((chunk.delay[channel][lane], rate, amplitude));
                    }
                }
            }
            match &group.paths {
                Paths::Scatterers(range) => body.extend(numbers_in_scene(scene, &self.scatterers, range)),
                Paths::Bounces(bounces) => {
                    body.extend(bounces.last_bodies().map(|body| scene.body_numbers[body as usize]));
                }
            }
            frequency_exponent.extend(std::iter::repeat_n(group.frequency_exponent, num_paths));
        }
        let all = || per_channel.iter().flatten();
        Ok(PathArrays {
            delay: all().map(|row| row.0).collect(),
            delay_rate: all().map(|row| row.1).collect(),
            amplitude: all().map(|row| row.2).collect(),
            body: body.into_iter().map(|number| number as u32).collect(),
            frequency_exponent,
        })
    }
}

impl MotionGroup {
    /// Number of paths.
    fn len(&self) -> usize {
        match &self.paths {
            Paths::Scatterers(range) => range.len(),
            Paths::Bounces(bounces) => bounces.len(),
        }
    }

    fn has_body(&self, scatterers: &Scatterers, body: u32) -> bool {
        match &self.paths {
            Paths::Scatterers(range) => range.clone().any(|number| scatterers.body.get(number) == Some(&body)),
            Paths::Bounces(bounces) => bounces.has_body(body),
        }
    }
}

impl<'a> PathsAtNodes<'a> {
    /// Paths of a group at times of a span.
    fn new(
        model: &'a Model,
        scatterers: &'a Scatterers,
        group: &'a MotionGroup,
        motion: &Kinematics,
        span: &Span,
        node_times: NodeTimes,
    ) -> Self {
        let times = [node_times.delays, node_times.amplitudes].map(|number| span.node_times(number));
        let elapsed = |x: &f64| 0.5 * model.waveform.duration() * (1.0 + x);
        Self {
            model,
            scatterers,
            group,
            elapsed: times[0].iter().map(elapsed).collect(),
            nodes: times.map(|times| motion.over(&times, |body| group.has_body(scatterers, body as u32))),
            node_times,
        }
    }

    /// The paths as a sum takes them.
    pub fn group(&self) -> PathGroup<'_> {
        PathGroup {
            source: self,
            frequency_exponent: self.group.frequency_exponent,
        }
    }

    /// A chunk of paths, spread over all, of all channels.
    fn probe(&self) -> Chunk<f64> {
        let (shape, number) = (self.shape(), self.group.len());
        let request = Request {
            channels: 0..shape.channels,
            paths: 0..0,
            scale: SCALE,
            level: self.model.settings.debug.level,
        };
        let mut chunk = Chunk::new(&shape, shape.channels);
        let step = number.div_ceil(CHUNK);
        self.fill_with((0..number).step_by(step), &request, &mut chunk);
        chunk
    }

    /// Fill a chunk with some paths of the group.
    fn fill_with<T: Precision>(&self, paths: impl Iterator<Item = usize>, request: &Request, chunk: &mut Chunk<T>) {
        let nodes = self.nodes.each_ref();
        match &self.group.paths {
            Paths::Scatterers(range) => {
                let numbers: Vec<usize> = paths.map(|path| range.start + path).collect();
                self.scatterers.fill(nodes, &numbers, request, chunk);
                if let Source::Depth(image) = &self.model.source
                    && image.range_rate.is_some()
                {
                    self.add_range_rates(image.age, &numbers, request.channels.len(), chunk);
                }
            }
            Paths::Bounces(bounces) => bounces.fill(nodes, &paths.collect::<Vec<_>>(), request, chunk),
        }
    }

    /// The surface of a pixel of a depth image moves on at the range rate of the pixel, from the time of the image on.
    fn add_range_rates<T>(&self, age: f64, numbers: &[usize], num_channels: usize, chunk: &mut Chunk<T>) {
        let (rates, num_nodes) = (&self.scatterers.range_rate, self.elapsed.len());
        for (row, delays) in chunk.delay.iter_mut().enumerate().take(num_channels * num_nodes) {
            // Rows after the first are differences from it.
            let elapsed = match row % num_nodes {
                0 => age + self.elapsed[0],
                node => self.elapsed[node] - self.elapsed[0],
            };
            for (i, delay) in delays.iter_mut().enumerate() {
                let rate = rates[numbers[i.min(numbers.len() - 1)]];
                *delay += 2.0 / SPEED_OF_LIGHT * rate * elapsed;
            }
        }
    }
}

impl PathSource for PathsAtNodes<'_> {
    fn shape(&self) -> Shape {
        Shape {
            channels: self.model.array.num_channels(),
            paths: self.group.len(),
            delay_rows: self.nodes[0].num_times(),
            amplitude_rows: self.nodes[1].num_times(),
            basis: Basis::Chebyshev,
        }
    }

    fn channels_together(&self) -> usize {
        self.model.array.num_channels()
    }

    fn scale(&self) -> f64 {
        SCALE
    }

    fn fill_single(&self, request: &Request, chunk: &mut Chunk<f32>) {
        self.fill_with(request.paths.clone(), request, chunk);
    }

    fn fill_double(&self, request: &Request, chunk: &mut Chunk<f64>) {
        self.fill_with(request.paths.clone(), request, chunk);
    }

    fn not_finite(&self) -> Error {
        let name = match self.model.source {
            Source::Scene(_) => "scene",
            Source::Depth(_) => "distance",
        };
        Error::value(name, "nothing at the place of an antenna", "a path of length zero")
    }
}

/// Motion over a span of every body, and of all point targets, the last.
pub fn motions(model: &Model, motion: &Kinematics, span: &Span) -> Vec<Motion> {
    let within = (span.half < 1.0).then(|| motion.over(&span.node_times(motion.num_times()), |_| true));
    let length = SMOOTH_SHARE * model.settings.tolerance / model.phase_per_length();
    let motion = within.as_ref().unwrap_or(motion);
    let mut motions = motion.motions(SMOOTH_TIMES, length, &model.radii);
    if matches!(&model.source, Source::Depth(image) if image.range_rate.is_some()) {
        // The surface of a pixel moves on at the range rate of the pixel.
        for motion in &mut motions {
            *motion = (*motion).max(Motion::Smooth);
        }
    }
    motions
}

/// Numbers, in the scene, of the bodies and point targets of a range of paths.
fn numbers_in_scene<'a>(
    scene: &'a Scene,
    scatterers: &'a Scatterers,
    range: &Range<usize>,
) -> impl Iterator<Item = usize> + 'a {
    range.clone().map(|number| match scatterers.body.get(number) {
        Some(body) => scene.body_numbers[*body as usize],
        None => scene.point_numbers[number - scatterers.len()],
    })
}

/// See [`PathGroups::fast_varying`].
fn fast_varying(model: &Model, groups: &[MotionGroup], scatterers: &Scatterers) -> Vec<usize> {
    let Source::Scene(scene) = &model.source else {
        return Vec::new();
    };
    let mut numbers = Vec::new();
    for group in groups.iter().filter(|group| group.motion == Motion::FastVarying) {
        if let Paths::Scatterers(range) = &group.paths {
            numbers.extend(numbers_in_scene(scene, scatterers, range));
        }
    }
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}
