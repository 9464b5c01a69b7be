//! Shooting and bouncing of ray tubes through a scene, from the transmitters and from the receivers (bidirectional).

use std::f64::consts::TAU;

use glam::{DMat3, DVec2, DVec3, Vec3Swizzles};
use num_complex::Complex64;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::numeric::random::mix;
use crate::rays::camera::ImagePlane;
use crate::rays::scene::PosedScene;
use crate::rays::watertight::Ray;
use crate::scattering::material::Material;
use crate::scattering::refinement::Sampling;
use crate::scattering::taper::taper;

use super::direction::Direction;
use super::interaction::Interaction;
use super::launch::Launch;
use super::path::BouncePath;
use super::tube::Tube;
use crate::antennas::polarization::transverse;

/// The parts of image planes where tubes start.
pub(super) struct TubeView {
    /// For every plane the rotation from its axes to the sensor axes, and smallest and largest plane coordinates.
    planes: Vec<(DMat3, [DVec2; 2])>,
}

impl TubeView {
    /// View of whole image planes, each with the rotation from its axes to the sensor axes.
    pub(super) fn new<'a>(planes: impl Iterator<Item = (DMat3, &'a ImagePlane)>) -> Self {
        let of = |(rotation, plane): (DMat3, &ImagePlane)| {
            // To the outer edges of the pixels.
            let ([u, v], half) = (plane.ranges(), 0.5 * DVec2::new(plane.du, plane.dv));
            let [low, high] = [0, 1].map(|end| DVec2::new(u[end], v[end]));
            (rotation, [low - half, high + half])
        };
        Self {
            planes: planes.map(of).collect(),
        }
    }

    /// Weight of a tube over these interactions to an antenna by the balance heuristic, between 0 and 1.
    ///
    /// A tube in the other direction finds the same path. As in multiple importance sampling (Veach and Guibas,
    /// "Optimally combining sampling techniques for Monte Carlo rendering", 1995), each counts in proportion to the
    /// density of its rays at the path, which falls as the tube spreads, and both weights add up to one. One where no
    /// tube starts in the other direction.
    fn balance_weight(&self, tube: &Tube, interactions: &[Interaction], antenna: DVec3) -> f64 {
        let reverse = self
            .shows(tube.interaction.point)
            .then(|| Tube::reverse_spreading(interactions, antenna));
        let Some(reverse) = reverse.flatten() else { return 1.0 };
        let weight = reverse / (tube.spreading() + reverse);
        if weight.is_finite() { weight } else { 0.5 }
    }

    fn shows(&self, point: DVec3) -> bool {
        self.planes.iter().any(|(rotation, [low, high])| {
            let point = rotation.transpose() * point;
            let position = point.yz() / point.x;
            point.x > 0.0 && position.cmpge(*low).all() && position.cmple(*high).all()
        })
    }
}

/// Limits of the length of paths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Most reflections of a path.
    pub max_bounces: usize,
    /// Smallest power of a tube relative to the launched power, weighted with the gain of the antenna in the direction
    /// of launch relative to the peak; weaker tubes end. Zero: none.
    pub floor: f64,
}

/// Counts of rays and of tubes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TubeCounts {
    /// Rays from one surface to the next.
    pub rays: usize,
    /// Tubes that ended at the floor.
    pub stopped: usize,
    /// Cells that were not quartered, as the most tubes were reached.
    pub coarse: usize,
    /// Sums over the cells of their squared fields, and of the squared errors of those not quartered [m^4].
    pub power: f64,
    pub error_power: f64,
}

impl TubeCounts {
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            stopped: self.stopped + other.stopped,
            coarse: self.coarse + other.coarse,
            power: self.power + other.power,
            error_power: self.error_power + other.error_power,
        }
    }
}

/// Scene, materials and limits that ray tubes are traced with.
pub(super) struct Shooter<'a> {
    pub(super) scene: &'a PosedScene,
    /// Material of every body.
    pub(super) materials: &'a [Material],
    pub(super) wavelength: f64,
    pub(super) limits: Limits,
}

impl Shooter<'_> {
    /// Trace a tube that was launched with a gain relative to the largest; `arrive` receives the tube at every surface
    /// from the second on, with all interactions so far.
    pub(super) fn trace(&self, mut tube: Tube, gain: f64, mut arrive: impl FnMut(&Tube, &[Interaction])) -> TubeCounts {
        let mut counts = TubeCounts::default();
        let mut interactions = vec![tube.interaction];
        for _ in 2..=self.limits.max_bounces {
            tube.reflect(self.reflection_coefficients(&tube));
            if tube.field.power() * gain < self.limits.floor {
                counts.stopped += 1;
                break;
            }
            counts.rays += 1;
            if !tube.advance(self.scene) {
                break;
            }
            interactions.push(tube.interaction);
            arrive(&tube, &interactions);
        }
        counts
    }

    /// Reflection coefficients `r_TE` and `r_TM` of the surface where a tube arrives.
    pub(super) fn reflection_coefficients(&self, tube: &Tube) -> [Complex64; 2] {
        self.materials[tube.interaction.body as usize].reflection_coefficients(tube.cosine(), self.wavelength)
    }

    /// Field radiated by the footprint of a cell of a size in a unit direction, to an antenna of a polarisation. None
    /// where the illuminated side faces away.
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

        // W sqrt(dOmega / dA_perp) dA of docs/theory.md eq. (7).
        let received = polarization.map(|e| transverse(e, direction));
        let radiated = tube.radiate(self.reflection_coefficients(tube), direction, received);
        let amplitude = radiated * (tube.spread * tube.section()).sqrt() * (size[0] * size[1]) / tube.cosine();
        (amplitude != Complex64::ZERO).then_some(Radiation { amplitude, weight })
    }

    /// Field radiated by the footprint to an antenna at a position of the sensor frame, and the distance of the antenna
    /// [m]. None where the antenna is occluded.
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
        let is_occluded = self.is_occluded(&tube.interaction, antenna - tube.interaction.offset_origin, 1.0 - 1e-9);
        (!is_occluded).then_some((radiated, distance))
    }

    /// True if a surface occludes the ray from an interaction up to `far` lengths of the direction.
    pub(super) fn is_occluded(&self, interaction: &Interaction, direction: DVec3, far: f64) -> bool {
        let ray = Ray {
            origin: interaction.offset_origin,
            direction,
            start: 0.0,
        };
        self.scene.blocks(&ray, far)
    }
}

/// Field radiated by the footprint of a cell.
pub(super) struct Radiation {
    /// Amplitude at unit distance: a path to an antenna at a distance R has `sqrt(P Gt Gr) j / (4 pi)` times this over
    /// R.
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
    fn new(scene: &'a PosedScene, materials: &'a [Material], array: &'a Array, limits: Limits) -> Self {
        let shooter = Shooter {
            scene,
            materials,
            wavelength: SPEED_OF_LIGHT / array.frequency,
            limits,
        };
        Self { shooter, array }
    }

    /// Trace the tube from an antenna to the hit of a cell.
    fn shoot(
        &self,
        launch: &Launch,
        (antenna, pattern): (DVec3, &Pattern),
        arrive: impl FnMut(&Tube, &[Interaction]),
    ) -> TubeCounts {
        let Some(tube) = Tube::launch(self.shooter.scene, launch, antenna, self.array.polarization) else {
            return TubeCounts::default();
        };
        let gain = pattern.gain(tube.interaction.point - antenna) / pattern.peak();
        self.shooter.trace(tube, gain, arrive)
    }

    /// Field that arrives at an antenna from a footprint, and the distance [m].
    fn receive(&self, tube: &Tube, launch: &Launch, antenna: DVec3, sampling: Sampling) -> Option<(Radiation, f64)> {
        self.shooter
            .radiate_to(tube, launch.size, antenna, self.array.polarization, sampling)
    }
}

/// Paths over one cell.
pub(super) struct CellPaths {
    pub(super) paths: Vec<BouncePath>,
    /// Sum of the weights of all paths with their phases, per channel [m^2].
    pub(super) fields: Vec<Complex64>,
    /// Hash of the surfaces that the tubes meet: of their bodies, and planes where they are flat.
    pub(super) surfaces: u64,
    pub(super) counts: TubeCounts,
}

/// Ray tubes of all antennas through the cells of a view.
pub(super) struct Launcher<'a> {
    sensor: Sensor<'a>,
    directions: &'static [Direction],
    view: TubeView,
    sampling: Sampling,
}

impl<'a> Launcher<'a> {
    /// Tubes through cells of a view.
    pub(super) fn new(
        scene: &'a PosedScene,
        view: TubeView,
        materials: &'a [Material],
        array: &'a Array,
        limits: Limits,
        sampling: Sampling,
    ) -> Self {
        Self {
            sensor: Sensor::new(scene, materials, array, limits),
            directions: Direction::of(array),
            view,
            sampling,
        }
    }

    /// Paths over a cell by tubes of all antennas, there and back.
    pub(super) fn shoot(&self, launch: &Launch) -> CellPaths {
        let Sensor { shooter, array } = &self.sensor;
        let twice = 2.0 / self.directions.len() as f64; // of weights that add up to one
        let mut cell = CellPaths::empty(array.num_channels());
        for direction in self.directions {
            let [starts, ends] = direction.antennas(array);
            for start in 0..starts.len() {
                let mut met = 0;
                let CellPaths { paths, fields, .. } = &mut cell;
                let arrive = |tube: &Tube, interactions: &[Interaction]| {
                    met = interactions.iter().fold(0, |hash, at| mix(hash ^ at.surface()));
                    let weight = |end: usize| {
                        let antenna = ends.get(end).0;
                        let radiated = self.sensor.receive(tube, launch, antenna, self.sampling);
                        radiated.map_or((Complex64::ZERO, 0.0), |(radiated, distance)| {
                            let balance = twice * self.view.balance_weight(tube, interactions, antenna);
                            let magnitude = balance * radiated.weight * tube.length;
                            let weight = Complex64::I / (2.0 * TAU) * radiated.amplitude * magnitude;
                            (weight, tube.length + distance)
                        })
                    };
                    let arrivals: Vec<(Complex64, f64)> = (0..ends.len()).map(weight).collect();
                    let weights: Vec<Complex64> = arrivals.iter().map(|arrival| arrival.0).collect();
                    if weights.iter().all(|weight| *weight == Complex64::ZERO) {
                        return;
                    }
                    for (end, (weight, length)) in arrivals.iter().enumerate() {
                        let phasor = Complex64::cis(-TAU * (length / shooter.wavelength).fract());
                        fields[direction.channel(array, start, end)] += weight * phasor;
                    }
                    let kind = (*direction, interactions.len());
                    let known = paths.iter().position(|path| path.kind() == kind);
                    let index = known.unwrap_or_else(|| {
                        paths.push(BouncePath::new(*direction, array, shooter.scene, interactions));
                        paths.len() - 1
                    });
                    paths[index].set(array, shooter.scene, start, interactions, &weights);
                };
                let counts = self.sensor.shoot(launch, starts.get(start), arrive);
                cell.counts = cell.counts.plus(counts);
                // In any order: transmitters and receivers may change places.
                cell.surfaces = cell.surfaces.wrapping_add(met);
            }
        }
        cell
    }
}

impl CellPaths {
    pub(super) fn empty(num_channels: usize) -> Self {
        Self {
            paths: Vec::new(),
            fields: vec![Complex64::ZERO; num_channels],
            surfaces: 0,
            counts: TubeCounts::default(),
        }
    }
}

#[cfg(test)]
mod tests;
