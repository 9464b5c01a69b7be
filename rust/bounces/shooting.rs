//! Shooting and bouncing of ray tubes from the antennas through a scene.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec3Swizzles};
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::rays::scene::Snapshot;
use crate::rays::tree::Ray;
use crate::scattering::material::Material;
use crate::scattering::physical_optics::Sampling;
use crate::scattering::taper::taper;

use super::direction::Direction;
use super::field::transverse;
use super::interaction::Interaction;
use super::launch::Launch;
use super::path::{BouncePath, Bounces};
use super::tube::Tube;

/// The part of the image plane where tubes start.
struct View {
    /// Smallest and largest plane coordinates.
    pub(super) corners: [DVec2; 2],
}

impl View {
    fn of(launches: &[Launch]) -> Self {
        let corners = launches
            .iter()
            .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], launch| {
                let (center, half) = (DVec2::from(launch.center), 0.5 * DVec2::from(launch.size));
                [low.min(center - half), high.max(center + half)]
            });
        Self { corners }
    }

    /// What a tube over these places to an antenna counts of what goes this way: the less, the more it widens beside one
    /// from the antenna that goes the same way back; all of it where none starts. Both add up to one.
    fn share(&self, tube: &Tube, interactions: &[Interaction], antenna: DVec3) -> f64 {
        let back = self
            .shows(tube.interaction.point)
            .then(|| Tube::widening_back(interactions, antenna));
        let Some(back) = back.flatten() else { return 1.0 };
        let share = back / (tube.widening() + back);
        if share.is_finite() { share } else { 0.5 }
    }

    fn shows(&self, point: DVec3) -> bool {
        let (position, [low, high]) = (point.yz() / point.x, self.corners);
        point.x > 0.0 && position.cmpge(low).all() && position.cmple(high).all()
    }
}

/// How far ray tubes are followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Most reflections of a path.
    pub max_bounces: usize,
    /// A tube ends where its power, weighed with the gain of the antenna towards where it was launched relative to the
    /// peak, is less than this share of what was launched: no later reflection adds to it. Zero: never.
    pub floor: f64,
}

/// What was done for the paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rays from surfaces to the next.
    pub rays: usize,
    /// Tubes that ended at the floor.
    pub stopped: usize,
}

impl Counts {
    fn plus(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            stopped: self.stopped + other.stopped,
        }
    }
}

/// The scene as ray tubes see it.
pub(super) struct Shooter<'a> {
    pub(super) snapshot: &'a Snapshot,
    /// One per body.
    pub(super) materials: &'a [Material],
    pub(super) wavelength: f64,
    pub(super) limits: Limits,
}

impl Shooter<'_> {
    /// Follow a tube that was launched with a share of the largest gain; `arrive` gets it at every surface from the second on,
    /// with all places so far.
    pub(super) fn follow(&self, mut tube: Tube, share: f64, mut arrive: impl FnMut(&Tube, &[Interaction])) -> Counts {
        let mut counts = Counts::default();
        let mut interactions = vec![tube.interaction];
        for _ in 2..=self.limits.max_bounces {
            tube.reflect(self.reflection_coefficients(&tube));
            if tube.field.power() * share < self.limits.floor {
                counts.stopped += 1;
                break;
            }
            counts.rays += 1;
            if !tube.advance(self.snapshot) {
                break;
            }
            interactions.push(tube.interaction);
            arrive(&tube, &interactions);
        }
        counts
    }

    /// Coefficients of the surface where a tube arrives.
    pub(super) fn reflection_coefficients(&self, tube: &Tube) -> [Complex64; 2] {
        self.materials[tube.interaction.body as usize].reflection_coefficients(tube.cosine(), self.wavelength)
    }

    /// What the footprint of a cell of some size sends in a unit direction, to an antenna of a polarisation, if its lit side
    /// faces there.
    pub(super) fn radiate(
        &self,
        tube: &Tube,
        size: [f64; 2],
        direction: DVec3,
        polarization: Option<DVec3>,
        sampling: Sampling,
    ) -> Option<Radiation> {
        let interaction = &tube.interaction;
        if interaction.normal.dot(direction) <= 0.0 || interaction.face.dot(direction) <= 0.0 {
            return None;
        }

        // The phase over the footprint.
        let slope = tube.slope(direction);
        let weight = match sampling {
            Sampling::Point => 1.0,
            Sampling::Footprint => (0..2)
                .map(|i| taper(TAU / self.wavelength * slope[i] * size[i]))
                .product(),
        };
        if weight == 0.0 {
            return None;
        }

        // W sqrt(dOmega / dA_perp) dA of README eq. (7).
        let received = polarization.map(|e| transverse(e, direction));
        let radiated = tube.radiate(self.reflection_coefficients(tube), direction, received);
        let amplitude = radiated * (tube.spread * tube.section()).sqrt() * (size[0] * size[1]) / tube.cosine();
        (amplitude != Complex64::ZERO).then_some(Radiation { amplitude, weight })
    }

    /// The same to an antenna at a place of the sensor frame, if that is in sight, and its distance [m].
    pub(super) fn radiate_to(
        &self,
        tube: &Tube,
        size: [f64; 2],
        antenna: DVec3,
        polarization: Option<DVec3>,
        sampling: Sampling,
    ) -> Option<(Radiation, f64)> {
        let offset = antenna - tube.interaction.point;
        let distance = offset.length();
        if distance == 0.0 {
            return None;
        }
        let radiated = self.radiate(tube, size, offset / distance, polarization, sampling)?;
        let is_occluded = self.is_occluded(&tube.interaction, antenna - tube.interaction.before, 1.0 - 1e-9);
        (!is_occluded).then_some((radiated, distance))
    }

    /// Whether something stands in the way from a place before `far`, in lengths of the direction.
    pub(super) fn is_occluded(&self, interaction: &Interaction, direction: DVec3, far: f64) -> bool {
        let ray = Ray {
            origin: interaction.before,
            direction,
            start: 0.0,
        };
        self.snapshot.blocks(&ray, far)
    }
}

/// What the footprint of a cell sends.
pub(super) struct Radiation {
    /// Such that a path to an antenna at a distance R has the amplitude `sqrt(P Gt Gr) j / (4 pi)` times this over R.
    pub(super) amplitude: Complex64,
    /// Mean of the phase over the footprint, tapered.
    pub(super) weight: f64,
}

/// Ray tubes from the antennas of an array.
struct Sensor<'a> {
    pub(super) shooter: Shooter<'a>,
    pub(super) array: &'a Array,
}

impl<'a> Sensor<'a> {
    fn new(snapshot: &'a Snapshot, materials: &'a [Material], array: &'a Array, limits: Limits) -> Self {
        let shooter = Shooter {
            snapshot,
            materials,
            wavelength: SPEED_OF_LIGHT / array.frequency,
            limits,
        };
        Self { shooter, array }
    }

    /// Follow the tube from an antenna to what a cell has hit.
    fn shoot(
        &self,
        launch: &Launch,
        (antenna, pattern): (DVec3, &Pattern),
        arrive: impl FnMut(&Tube, &[Interaction]),
    ) -> Counts {
        let Some(tube) = Tube::launch(self.shooter.snapshot, launch, antenna, self.array.polarization) else {
            return Counts::default();
        };
        let share = pattern.gain(tube.interaction.point - antenna) / pattern.peak();
        self.shooter.follow(tube, share, arrive)
    }

    /// What comes to an antenna.
    fn receive(&self, tube: &Tube, launch: &Launch, antenna: DVec3, sampling: Sampling) -> Option<(Radiation, f64)> {
        self.shooter
            .radiate_to(tube, launch.size, antenna, self.array.polarization, sampling)
    }
}

impl Bounces {
    /// Paths of two and more reflections of all cells, in their order, and what they took; one material per body.
    pub fn new(
        snapshot: &Snapshot,
        launches: &[Launch],
        materials: &[Material],
        array: Array,
        limits: Limits,
        sampling: Sampling,
    ) -> (Self, Counts) {
        let sensor = Sensor::new(snapshot, materials, &array, limits);
        let (directions, view) = (Direction::of(&array), View::of(launches));
        let twice = 2.0 / directions.len() as f64; // of shares that add up to one
        let of = |launch: &Launch| {
            let mut paths: Vec<BouncePath> = Vec::new();
            let mut counts = Counts::default();
            for direction in directions {
                let [starts, ends] = direction.antennas(&array);
                for start in 0..starts.len() {
                    let arrive = |tube: &Tube, interactions: &[Interaction]| {
                        let weight = |end: usize| {
                            let radiated = sensor.receive(tube, launch, ends.get(end).0, sampling);
                            radiated.map_or(Complex64::ZERO, |(radiated, _)| {
                                let share = twice * view.share(tube, interactions, ends.get(end).0);
                                Complex64::I / (2.0 * TAU)
                                    * radiated.amplitude
                                    * (share * radiated.weight * tube.length)
                            })
                        };
                        let weights: Vec<Complex64> = (0..ends.len()).map(weight).collect();
                        if weights.iter().all(|weight| *weight == Complex64::ZERO) {
                            return;
                        }
                        let kind = (*direction, interactions.len());
                        let known = paths.iter().position(|path| path.kind() == kind);
                        let index = known.unwrap_or_else(|| {
                            paths.push(BouncePath::new(*direction, &array, snapshot, interactions));
                            paths.len() - 1
                        });
                        paths[index].set(&array, snapshot, start, interactions, &weights);
                    };
                    counts = counts.plus(sensor.shoot(launch, starts.get(start), arrive));
                }
            }
            (paths, counts)
        };
        let (paths, counts): (Vec<Vec<BouncePath>>, Vec<Counts>) = launches.par_iter().map(of).unzip();
        let counts = counts.into_iter().fold(Counts::default(), Counts::plus);
        (Self::of_paths(snapshot, array, paths.into_iter().flatten()), counts)
    }
}

#[cfg(test)]
mod tests;
