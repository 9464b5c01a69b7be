//! Groups of paths that are summed together, and the evaluation of their delays and amplitudes.

use num_complex::Complex64;

use super::model::{Model, Source};
use super::parts::Part;
use super::rays::{Image, Rays};
use crate::bounces::{self, Bounces};
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result};
use crate::paths::kinematics::Kinematics;
use crate::paths::placement::{Motion, NodePlaces, Placement};
use crate::paths::scatterers::{Members, Scatterers};
use crate::paths::series::{Paths, Selection};
use crate::scattering::material_points::NO_CELL;
use crate::synthesis::lanes::MOST_TERMS;

/// Share of the tolerance that the terms of sums in lanes may leave out of the phases of a body that moves smoothly.
const ROUGH: f64 = 0.5;

/// Motion over a part of the frame of every body, and of all point targets: rough where as many times as sums in lanes
/// take leave out a large share of the tolerance.
pub struct Motions {
    of_bodies: Vec<Motion>,
    of_points: Motion,
}

/// Paths of a frame, or of a part of one.
pub struct Groups {
    pub(super) all: Vec<Group>,
    /// Material points of all groups.
    pub(super) scatterers: Scatterers,
    /// Numbers of the bodies that deform.
    pub(super) deforming: Vec<u32>,
    /// Number of point targets.
    num_points: usize,
    /// Cells that have a material point.
    num_cells: usize,
    /// Distance of the farthest cell of paths that fall with the frequency [m]: edge terms of cells may lie beyond the
    /// surface.
    farthest: f64,
    /// Number of paths of several reflections, and counts of their rays.
    num_bounces: usize,
    bounces: bounces::Counts,
    /// Numbers, in the scene, of the bodies in rough motion that have a path.
    rough: Vec<usize>,
}

/// Paths that are summed together.
pub(super) struct Group {
    pub(super) paths: GroupPaths,
    /// Motion of the bodies and points; delays and amplitudes of still ones do not change within the frame.
    pub(super) motion: Motion,
    /// Amplitudes fall with this power of the frequency; they are given for the centre of the band.
    pub(super) order: u8,
}

pub(super) enum GroupPaths {
    /// Material points, followed by the point targets where these belong to the group.
    Scatterers(Members),
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
    pub order: Vec<u8>,
}

impl Groups {
    /// Group the scatterers of all hits and the paths of several reflections by motion, and by the power of the frequency.
    pub fn new(model: &Model, motions: Motions, rays: &Rays, tubes: &mut Vec<Image>, cancel: &Cancel) -> Result<Self> {
        let (deforming, num_points) = (deforming(&model.source), num_points(&model.source));
        let Motions {
            of_bodies: motions,
            of_points,
        } = motions;
        let rank = |body: u32| motions[body as usize] as u8;
        let mut scatterers = rays.scatterers(model, rank)?;
        cancel.check()?;
        let (bounces, bounce_counts) = rays.bounces(model, tubes, cancel)?;

        let mut groups = Vec::new();
        let num_bounces = bounces.len();
        let num_cells = num_cells(scatterers.cells());
        // Still ones first, and within each by the power of the frequency.
        let last_order = (0..scatterers.len()).map(|i| scatterers.order_of(i)).max().unwrap_or(0);
        let number = |motion: Motion, order: u8| motion as u8 * (1 + last_order) + order;
        scatterers.order_by(|body, order| number(motions[body as usize], order));
        let mut first = 0;
        for motion in Motion::ALL {
            for order in 0..=last_order {
                let has_points = of_points == motion && order == 0;
                let members = scatterers.members(first, if has_points { num_points } else { 0 }, |body, of| {
                    number(motions[body as usize], of) == number(motion, order)
                });
                first = members.surfaces.end;
                groups.push(Group {
                    paths: GroupPaths::Scatterers(members),
                    motion,
                    order,
                });
            }
        }
        // Paths over several bodies move as the roughest of these.
        let mut rest = bounces;
        for motion in Motion::ALL {
            let [own, others] = rest.split(|body| motions[body as usize] <= motion);
            groups.push(Group {
                paths: GroupPaths::Bounces(Box::new(own)),
                motion,
                order: 0,
            });
            rest = others;
        }
        groups.retain(|group| group.len() > 0);
        let rough = rough(model, &groups, &scatterers);
        Ok(Self {
            all: groups,
            scatterers,
            deforming: deforming.iter().map(|body| *body as u32).collect(),
            num_points,
            num_cells,
            farthest: rays.farthest(),
            num_bounces,
            bounces: bounce_counts,
            rough,
        })
    }

    /// Number of paths.
    pub fn num_paths(&self) -> usize {
        self.scatterers.len() + self.num_points + self.num_bounces
    }

    /// Cells that have a material point.
    pub fn num_cells(&self) -> usize {
        self.num_cells
    }

    /// Number of paths of several reflections, and counts of their rays.
    pub fn bounces(&self) -> (usize, bounces::Counts) {
        (self.num_bounces, self.bounces)
    }

    /// Numbers, in the scene, of the bodies and point targets in rough motion, increasing; see [`Motion`].
    pub fn rough(&self) -> &[usize] {
        &self.rough
    }

    /// Distance of the farthest cell of paths that fall with the frequency [m], see [`Outcome::farthest`].
    pub fn farthest(&self) -> f64 {
        self.farthest
    }

    /// Indices, among all bodies that deform, of the bodies on the paths of a group.
    fn deforming(&self, group: &Group) -> Vec<usize> {
        let met = match &group.paths {
            GroupPaths::Scatterers(_) => self.scatterers.deforming(),
            GroupPaths::Bounces(bounces) => bounces.deforming(),
        };
        let place = |body: u32| self.deforming.iter().position(|other| *other == body);
        met.iter().filter_map(|(body, _)| place(*body)).collect()
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
            let deforming = self.deforming(group);
            let [kinematics, changes] = [at, rates].map(|placement| placement.at(&[0.0], &deforming));
            let rcs: &[f64] = if group.has_points() { &scene.rcs } else { &[] };
            let number = group.len();
            let selection = Selection {
                first: 0,
                last: number,
                step: 1,
            };
            let (paths, delay_rates) = kinematics.with(rcs, |kinematics| {
                changes.with(rcs, |changes| match &group.paths {
                    GroupPaths::Scatterers(members) => (
                        self.scatterers.paths(kinematics, kinematics, members, selection),
                        self.scatterers.delay_rates(kinematics, changes, members),
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
                GroupPaths::Scatterers(members) => {
                    let bodies = self.scatterers.bodies()[members.surfaces.clone()].iter();
                    body.extend(bodies.map(|body| scene.body_numbers[*body as usize] as u32));
                    let points = scene.point_numbers.iter().take(members.num_points);
                    body.extend(points.map(|number| *number as u32));
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
    /// Number of paths.
    pub(super) fn len(&self) -> usize {
        match &self.paths {
            GroupPaths::Scatterers(members) => members.len(),
            GroupPaths::Bounces(bounces) => bounces.len(),
        }
    }

    fn has_points(&self) -> bool {
        matches!(&self.paths, GroupPaths::Scatterers(members) if members.num_points > 0)
    }
}

/// Evaluation of delays and amplitudes of a group at times of the frame.
pub(super) struct Evaluate<'a> {
    pub(super) model: &'a Model,
    pub(super) placement: &'a Placement,
    pub(super) groups: &'a Groups,
    pub(super) group: &'a Group,
}

impl<'a> Evaluate<'a> {
    /// Places of everything at the times of delays and of amplitudes, `x` from -1 to 1 over the frame.
    pub(super) fn at(&self, delays_at: &[f64], amplitudes_at: &[f64]) -> EvaluateAt<'a> {
        let deforming = self.groups.deforming(self.group);
        EvaluateAt {
            model: self.model,
            scatterers: &self.groups.scatterers,
            group: self.group,
            delays_at: delays_at.to_vec(),
            delays: self.placement.at(delays_at, &deforming),
            amplitudes: self.placement.at(amplitudes_at, &deforming),
        }
    }
}

/// Evaluation at given times.
pub(super) struct EvaluateAt<'a> {
    model: &'a Model,
    scatterers: &'a Scatterers,
    group: &'a Group,
    delays_at: Vec<f64>,
    delays: NodePlaces,
    amplitudes: NodePlaces,
}

impl EvaluateAt<'_> {
    /// Evaluate delays and amplitudes of the selected paths, each at their own times.
    pub(super) fn take(&self, selection: Selection) -> Result<Paths> {
        let paths = self.with(|delays, amplitudes| match &self.group.paths {
            GroupPaths::Scatterers(members) => self.scatterers.paths(delays, amplitudes, members, selection),
            GroupPaths::Bounces(bounces) => bounces.paths(delays, amplitudes, selection),
        });
        let mut paths = finite(paths?, self.model)?;
        if let (Source::Depth(image), GroupPaths::Scatterers(members)) = (&self.model.source, &self.group.paths)
            && let Some(rates) = &image.range_rate
        {
            // The surface of a pixel moves on at the range rate of the pixel.
            let cells = &self.scatterers.cells()[members.surfaces.clone()][selection.first..selection.last];
            let num_channels = self.scatterers.num_channels();
            for (row, delays) in paths.delay.chunks_mut(selection.len().max(1)).enumerate() {
                let x = self.delays_at[row / num_channels];
                let elapsed = image.age + 0.5 * self.model.waveform.duration() * (1.0 + x);
                for (delay, cell) in delays.iter_mut().zip(cells.iter().step_by(selection.step)) {
                    *delay += 2.0 / SPEED_OF_LIGHT * rates[*cell as usize] * elapsed;
                }
            }
        }
        Ok(paths)
    }

    /// Run a function with the places at the times of delays and of amplitudes.
    fn with<T>(&self, run: impl FnOnce(&Kinematics, &Kinematics) -> T) -> T {
        let rcs: &[f64] = match &self.model.source {
            Source::Scene(scene) if self.group.has_points() => &scene.rcs,
            _ => &[],
        };
        self.delays.with(rcs, |delays| {
            self.amplitudes.with(rcs, |amplitudes| run(delays, amplitudes))
        })
    }

    /// Run a function with the material points of the group and the places at the times of delays and of amplitudes; none
    /// for paths whose delays are not those of points.
    pub(super) fn with_points<T>(&self, run: impl FnOnce(&Scatterers, &Members, [&Kinematics; 2]) -> T) -> Option<T> {
        let has_rates = matches!(&self.model.source, Source::Depth(image) if image.range_rate.is_some());
        match &self.group.paths {
            GroupPaths::Scatterers(members) if !has_rates => {
                Some(self.with(|delays, amplitudes| run(self.scatterers, members, [delays, amplitudes])))
            }
            _ => None,
        }
    }
}

impl Motions {
    /// Motions over a part of the frame.
    pub fn new(model: &Model, placement: &Placement, part: &Part) -> Self {
        let own = (part.half < 1.0).then(|| placement.over(&part.node_times(placement.num_times())));
        let length = ROUGH * model.settings.tolerance / model.phase_per_length();
        let placement = own.as_ref().unwrap_or(placement);
        let deforming = deforming(&model.source);
        let (mut of_bodies, of_points) = placement.motions(MOST_TERMS, length, deforming, &model.radii);
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

/// Number of point targets.
fn num_points(source: &Source) -> usize {
    match source {
        Source::Scene(scene) => scene.rcs.len(),
        Source::Depth(_) => 0,
    }
}

/// See [`Groups::rough`].
fn rough(model: &Model, groups: &[Group], scatterers: &Scatterers) -> Vec<usize> {
    let Source::Scene(scene) = &model.source else {
        return Vec::new();
    };
    let mut rough = Vec::new();
    for group in groups.iter().filter(|group| group.motion == Motion::Rough) {
        if let GroupPaths::Scatterers(members) = &group.paths {
            let bodies = scatterers.bodies()[members.surfaces.clone()].iter();
            rough.extend(bodies.map(|body| scene.body_numbers[*body as usize]));
            rough.extend(scene.point_numbers.iter().take(members.num_points));
            rough.dedup();
        }
    }
    rough.sort_unstable();
    rough.dedup();
    rough
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

/// Cells that have a material point.
fn num_cells(cells: &[u32]) -> usize {
    let mut cells: Vec<u32> = cells.iter().copied().filter(|cell| *cell != NO_CELL).collect();
    cells.sort_unstable();
    cells.dedup();
    cells.len()
}
