//! Groups of paths that are summed together, and the paths of a group at node times: a source of delays and amplitudes.

use num_complex::Complex64;

use super::model::{Model, Scene, Source};
use super::rays::{Image, Rays};
use super::spans::Span;
use crate::bounces::{self, Bounces};
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result};
use crate::numeric::parallel;
use crate::numeric::simd::{Level, Precision};
use crate::paths::kinematics::Kinematics;
use crate::paths::node_times::{self, NodeTimes};
use crate::paths::scatterers::{PathRange, Scatterers};
use crate::paths::sensor_motion::{Motion, SensorMotion};
use crate::scattering::material_points::NO_CELL;
use crate::synthesis::chunk::{CHUNK, Chunk};
use crate::synthesis::delay::Basis;
use crate::synthesis::source::{PathGroup, PathSource, Request, Shape};

/// Most times that describe a smooth motion: with more, a chirp-wise sum has blocks of chirps.
const SMOOTH_TIMES: usize = 8;

/// Share of the tolerance that as many times may leave out of the phases of a body that moves smoothly.
const SMOOTH_SHARE: f64 = 0.5;

/// Power of two that brings amplitudes of radars to the middle of single precision.
const SCALE: f64 = 1_073_741_824.0; // 2^30

/// Motion over a span of the frame of every body, and of all point targets.
pub struct Motions {
    of_bodies: Vec<Motion>,
    of_points: Motion,
}

/// Paths of a span of a frame, by motion of the bodies and power of the frequency.
pub struct PathGroups {
    groups: Vec<Group>,
    /// Material points of all groups.
    scatterers: Scatterers,
    /// Number of point targets.
    num_points: usize,
    /// Number of paths of several reflections, and counts of their rays.
    pub bounces: (usize, bounces::Counts),
    /// Distance of the farthest cell of paths that fall with the frequency [m]: edge terms of cells may lie beyond the
    /// surface.
    pub farthest: f64,
    /// Numbers, in the scene, of the bodies and point targets in fast-varying motion that have a path, increasing.
    pub fast_varying: Vec<usize>,
}

/// Paths that are summed together.
struct Group {
    paths: Paths,
    /// Motion of the bodies and points; delays and amplitudes of static ones do not change within the frame.
    motion: Motion,
    /// Amplitudes fall with this power of the frequency; they are given for the centre of the band.
    frequency_exponent: u8,
}

enum Paths {
    /// Material points, followed by the point targets where these belong to the group.
    Scatterers(PathRange),
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
    group: &'a Group,
    delays: Kinematics,
    amplitudes: Kinematics,
    /// Times of the delays after a depth image [s].
    elapsed: Vec<f64>,
    /// The node times, and what they leave out.
    pub node_times: NodeTimes,
}

impl PathGroups {
    /// Group the scatterers of all hits and the paths of several reflections by motion, and by the power of the frequency.
    pub fn new(model: &Model, motions: &Motions, rays: &Rays, tubes: &mut Vec<Image>, cancel: &Cancel) -> Result<Self> {
        let motion_of = |body: u32| motions.of_bodies[body as usize];
        let num_points = rcs(&model.source).len();
        let mut scatterers = rays.scatterers(model, |body| motion_of(body) as u8)?;
        cancel.check()?;
        let (bounces, bounce_counts) = rays.bounces(model, tubes, cancel)?;

        let mut groups = Vec::new();
        let num_bounces = bounces.len();
        // Static ones first, and within each by the power of the frequency.
        let exponents = (0..scatterers.len()).map(|i| scatterers.frequency_exponent(i));
        let largest = exponents.max().unwrap_or(0);
        let key = |motion: Motion, exponent: u8| motion as u8 * (1 + largest) + exponent;
        scatterers.sort_by(|body, exponent| key(motion_of(body), exponent));
        let mut first = 0;
        for motion in Motion::ALL {
            for frequency_exponent in 0..=largest {
                let has_points = motions.of_points == motion && frequency_exponent == 0;
                let range = scatterers.range(first, if has_points { num_points } else { 0 }, |body, exponent| {
                    key(motion_of(body), exponent) == key(motion, frequency_exponent)
                });
                first = range.surfaces.end;
                groups.push(Group {
                    paths: Paths::Scatterers(range),
                    motion,
                    frequency_exponent,
                });
            }
        }
        // Paths over several bodies vary as the fastest of these.
        let mut rest = bounces;
        for motion in Motion::ALL {
            let [group, others] = rest.split(|body| motion_of(body) <= motion);
            groups.push(Group {
                paths: Paths::Bounces(Box::new(group)),
                motion,
                frequency_exponent: 0,
            });
            rest = others;
        }
        groups.retain(|group| group.len() > 0);
        Ok(Self {
            fast_varying: fast_varying(model, &groups, &scatterers),
            groups,
            scatterers,
            num_points,
            bounces: (num_bounces, bounce_counts),
            farthest: rays.farthest(),
        })
    }

    /// Number of paths.
    pub fn len(&self) -> usize {
        self.scatterers.len() + self.num_points + self.bounces.0
    }

    /// Number of cells that have a material point.
    pub fn num_cells(&self) -> usize {
        let cells = self.scatterers.cells().iter();
        let mut cells: Vec<u32> = cells.copied().filter(|cell| *cell != NO_CELL).collect();
        cells.sort_unstable();
        cells.dedup();
        cells.len()
    }

    /// The paths of all groups at node times of a span, which are chosen for the tolerance.
    pub fn at_nodes<'a>(
        &'a self,
        model: &'a Model,
        motion: &SensorMotion,
        span: &Span,
        is_parallel: bool,
    ) -> Vec<PathsAtNodes<'a>> {
        parallel::map(is_parallel, self.groups.iter().collect(), |group| {
            let at = |node_times: NodeTimes| {
                let [delays, amplitudes] = [node_times.delays, node_times.amplitudes].map(|n| span.node_times(n));
                PathsAtNodes {
                    node_times,
                    ..PathsAtNodes::new(model, &self.scatterers, group, motion, [&delays, &amplitudes])
                }
            };
            if group.motion == Motion::Static {
                return at(NodeTimes::ONCE);
            }
            let (num_channels, tolerance) = (model.array.num_channels(), model.settings.tolerance);
            let level = Level::best();
            let chosen = node_times::choose(num_channels, model.highest_frequency(), tolerance, level, |number| {
                at(NodeTimes {
                    delays: number,
                    amplitudes: number,
                    ..NodeTimes::ONCE
                })
                .probe(level)
            });
            at(chosen)
        })
    }

    /// Evaluate all paths at one time: `at` and `rates` have one time each.
    pub fn arrays(&self, model: &Model, at: &SensorMotion, rates: &SensorMotion) -> Result<PathArrays> {
        let num_channels = model.array.num_channels();
        let Source::Scene(scene) = &model.source else {
            return Err(Error::value("source", "a scene", "an image"));
        };
        let mut per_channel: Vec<Vec<(f64, f64, Complex64)>> = vec![Vec::new(); num_channels];
        let (mut body, mut frequency_exponent) = (Vec::new(), Vec::new());
        for group in &self.groups {
            let [paths, changes] =
                [at, rates].map(|motion| PathsAtNodes::new(model, &self.scatterers, group, motion, [&[0.0]; 2]));
            let delay_rates = match &group.paths {
                Paths::Scatterers(range) => self.scatterers.delay_rates(&paths.delays, &changes.delays, range),
                Paths::Bounces(bounces) => bounces.delay_rates(&paths.delays, &changes.delays),
            };
            let mut chunk = Chunk::<f64>::new(&paths.shape(), num_channels);
            for first in (0..group.len()).step_by(CHUNK) {
                let request = Request {
                    channels: 0..num_channels,
                    paths: first..group.len().min(first + CHUNK),
                    scale: 1.0,
                    level: Level::best(),
                };
                paths.fill(&request, &mut chunk);
                for (channel, rows) in per_channel.iter_mut().enumerate() {
                    for (i, path) in request.paths.clone().enumerate() {
                        let amplitude = Complex64::new(chunk.re[channel][i], chunk.im[channel][i]);
                        if !amplitude.is_finite() {
                            return Err(paths.not_finite());
                        }
                        let rate = delay_rates[channel * group.len() + path];
                        rows.push((chunk.delay[channel][i], rate, amplitude));
                    }
                }
            }
            match &group.paths {
                Paths::Scatterers(range) => body.extend(numbers_in_scene(scene, &self.scatterers, range)),
                Paths::Bounces(bounces) => {
                    body.extend(bounces.last_bodies().map(|body| scene.body_numbers[body as usize]));
                }
            }
            frequency_exponent.extend(std::iter::repeat_n(group.frequency_exponent, group.len()));
        }
        let all = || per_channel.iter().flatten();
        Ok(PathArrays {
            delay: all().map(|path| path.0).collect(),
            delay_rate: all().map(|path| path.1).collect(),
            amplitude: all().map(|path| path.2).collect(),
            body: body.into_iter().map(|number| number as u32).collect(),
            frequency_exponent,
        })
    }
}

impl Group {
    /// Number of paths.
    fn len(&self) -> usize {
        match &self.paths {
            Paths::Scatterers(range) => range.len(),
            Paths::Bounces(bounces) => bounces.len(),
        }
    }

    fn has_body(&self, scatterers: &Scatterers, body: u32) -> bool {
        match &self.paths {
            Paths::Scatterers(range) => scatterers.bodies()[range.surfaces.clone()].contains(&body),
            Paths::Bounces(bounces) => bounces.has_body(body),
        }
    }
}

impl<'a> PathsAtNodes<'a> {
    /// Paths of a group at times of delays and of amplitudes, `x` from -1 to 1 over the frame.
    fn new(
        model: &'a Model,
        scatterers: &'a Scatterers,
        group: &'a Group,
        motion: &SensorMotion,
        times: [&[f64]; 2],
    ) -> Self {
        let rcs = match &group.paths {
            Paths::Scatterers(range) if range.num_points > 0 => rcs(&model.source),
            _ => &[],
        };
        let [delays, amplitudes] = times.map(|times| {
            let bodies = deforming(&model.source).iter().map(|body| *body as u32);
            motion.at(times, rcs, bodies.map(|body| (body, group.has_body(scatterers, body))))
        });
        let elapsed = |x: &f64| 0.5 * model.waveform.duration() * (1.0 + x);
        Self {
            model,
            scatterers,
            group,
            delays,
            amplitudes,
            elapsed: times[0].iter().map(elapsed).collect(),
            node_times: NodeTimes::ONCE,
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
    fn probe(&self, level: Level) -> Chunk<f64> {
        let (shape, number) = (self.shape(), self.group.len());
        let request = Request {
            channels: 0..shape.channels,
            paths: 0..0,
            scale: SCALE,
            level,
        };
        let mut chunk = Chunk::new(&shape, shape.channels);
        let step = number.div_ceil(CHUNK);
        self.fill_with((0..number).step_by(step), &request, &mut chunk);
        chunk
    }

    fn fill<T: Precision>(&self, request: &Request, chunk: &mut Chunk<T>) {
        self.fill_with(request.paths.clone(), request, chunk);
    }

    /// Fill a chunk with some paths of the group.
    fn fill_with<T: Precision>(&self, paths: impl Iterator<Item = usize>, request: &Request, chunk: &mut Chunk<T>) {
        let nodes = [&self.delays, &self.amplitudes];
        match &self.group.paths {
            Paths::Scatterers(range) => {
                let numbers: Vec<usize> = paths.map(|path| range.number(self.scatterers, path)).collect();
                self.scatterers.fill(nodes, &numbers, request, chunk);
                if let Source::Depth(image) = &self.model.source
                    && let Some(rates) = &image.range_rate
                {
                    self.add_range_rates(rates, image.age, &numbers, request.channels.len(), chunk);
                }
            }
            Paths::Bounces(bounces) => bounces.fill(nodes, &paths.collect::<Vec<_>>(), request, chunk),
        }
    }

    /// The surface of a pixel of a depth image moves on at the range rate of the pixel, from the time of the image on.
    fn add_range_rates<T>(
        &self,
        rates: &[f64],
        age: f64,
        numbers: &[usize],
        num_channels: usize,
        chunk: &mut Chunk<T>,
    ) {
        let (cells, num_nodes) = (self.scatterers.cells(), self.elapsed.len());
        for (row, delays) in chunk.delay.iter_mut().enumerate().take(num_channels * num_nodes) {
            // Rows after the first are differences from it.
            let elapsed = match row % num_nodes {
                0 => age + self.elapsed[0],
                node => self.elapsed[node] - self.elapsed[0],
            };
            for (i, delay) in delays.iter_mut().enumerate() {
                let cell = cells[numbers[i.min(numbers.len() - 1)]];
                *delay += 2.0 / SPEED_OF_LIGHT * rates[cell as usize] * elapsed;
            }
        }
    }
}

impl PathSource for PathsAtNodes<'_> {
    fn shape(&self) -> Shape {
        Shape {
            channels: self.model.array.num_channels(),
            paths: self.group.len(),
            delay_rows: self.delays.num_nodes,
            amplitude_rows: self.amplitudes.num_nodes,
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
        self.fill(request, chunk);
    }

    fn fill_double(&self, request: &Request, chunk: &mut Chunk<f64>) {
        self.fill(request, chunk);
    }

    fn not_finite(&self) -> Error {
        let name = match self.model.source {
            Source::Scene(_) => "scene",
            Source::Depth(_) => "distance",
        };
        Error::value(name, "nothing at the place of an antenna", "a path of length zero")
    }
}

impl Motions {
    /// Motions over a span of the frame.
    pub fn new(model: &Model, motion: &SensorMotion, span: &Span) -> Self {
        let within = (span.half < 1.0).then(|| motion.over(&span.node_times(motion.num_times())));
        let length = SMOOTH_SHARE * model.settings.tolerance / model.phase_per_length();
        let motion = within.as_ref().unwrap_or(motion);
        let deforming = deforming(&model.source);
        let (mut of_bodies, of_points) = motion.motions(SMOOTH_TIMES, length, deforming, &model.radii);
        if matches!(&model.source, Source::Depth(image) if image.range_rate.is_some()) {
            // The surface of a pixel moves on at the range rate of the pixel.
            for motion in &mut of_bodies {
                *motion = (*motion).max(Motion::Smooth);
            }
        }
        Self { of_bodies, of_points }
    }
}

/// Numbers of the bodies that deform.
fn deforming(source: &Source) -> &[usize] {
    match source {
        Source::Scene(scene) => &scene.deforming,
        Source::Depth(_) => &[],
    }
}

/// Radar cross-sections of the point targets [m^2].
fn rcs(source: &Source) -> &[f64] {
    match source {
        Source::Scene(scene) => &scene.rcs,
        Source::Depth(_) => &[],
    }
}

/// Numbers, in the scene, of the bodies and point targets of a range.
fn numbers_in_scene<'a>(
    scene: &'a Scene,
    scatterers: &'a Scatterers,
    range: &PathRange,
) -> impl Iterator<Item = usize> + 'a {
    let bodies = scatterers.bodies()[range.surfaces.clone()].iter();
    let points = scene.point_numbers.iter().take(range.num_points).copied();
    bodies.map(|body| scene.body_numbers[*body as usize]).chain(points)
}

/// See [`PathGroups::fast_varying`].
fn fast_varying(model: &Model, groups: &[Group], scatterers: &Scatterers) -> Vec<usize> {
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
