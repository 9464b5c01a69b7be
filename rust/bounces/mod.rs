//! Paths of several reflections, by shooting and bouncing rays: README eqs. (7) to (9).
//!
//! A cell of the image launches a ray tube. It goes from surface to surface as geometrical optics says (`tube`, `place`),
//! carries a field (`field`), and at every surface after the first its footprint sends on what physical optics says to
//! every receiver that is in sight: the first reflection is that of [`crate::scattering::gather`]. The places where it was reflected
//! become a route of material points, which move with their bodies (`route`).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec3Swizzles};
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::rays::image::Hits;
use crate::rays::scene::{NO_BODY, Snapshot};
use crate::rays::tree::Ray;
use crate::scattering::material::Material;
use crate::scattering::physical_optics::Sampling;
use crate::scattering::taper::taper;

mod cross_section;
mod direction;
mod field;
mod interaction;
mod path;
mod tube;

pub use cross_section::{Aspect, cross_sections};
pub use path::Bounces;

use direction::Way;
use interaction::Place;
use path::Route;
use tube::Tube;

/// How far before a surface rays leave it, of their largest coordinate, and of a metre at least [m].
const LEAVING: f64 = 1e-7;

/// What a cell of the image plane has hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Launch {
    /// Plane coordinates of its centre, y/x and z/x.
    pub center: [f64; 2],
    /// Its width and height in them.
    pub size: [f64; 2],
    /// Number of the body that the ray through its centre hits.
    pub body: u32,
    /// Number of the triangle in the body's surface.
    pub triangle: u32,
}

impl Launch {
    /// Of all pixels that hit something, row by row.
    pub fn of_image(hits: &Hits) -> Vec<Self> {
        let plane = &hits.plane;
        let pixels = (0..plane.num_pixels()).filter(|pixel| hits.body[*pixel] != NO_BODY);
        let launch = |pixel: usize| {
            let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
            Self {
                center: [u, v],
                size: [plane.du, plane.dv],
                body: hits.body[pixel],
                triangle: hits.triangle[pixel],
            }
        };
        pixels.map(launch).collect()
    }
}

/// The part of the image plane where tubes start.
struct View {
    /// Smallest and largest plane coordinates.
    corners: [DVec2; 2],
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
    fn share(&self, tube: &Tube, places: &[Place], antenna: DVec3) -> f64 {
        let back = self
            .shows(tube.place.point)
            .then(|| Tube::widening_back(places, antenna));
        let Some(back) = back.flatten() else { return 1.0 };
        let share = back / (tube.widening() + back);
        if share.is_finite() { share } else { 0.5 }
    }

    fn shows(&self, point: DVec3) -> bool {
        let (place, [low, high]) = (point.yz() / point.x, self.corners);
        point.x > 0.0 && place.cmpge(low).all() && place.cmple(high).all()
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

/// What one cell returns to the centre of the array by its last reflection of a number of reflections, as a sampling that
/// refines cells has to know it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo {
    /// Number of reflections, from 2 on.
    pub order: usize,
    /// Half the length of the path [m].
    pub half_path: f64,
    /// Its derivatives by the plane coordinates of the image [m]; times the width of the cell and the wave number they
    /// are half the change of the phase over the cell.
    pub slope: [f64; 2],
    /// Such that the path has the amplitude `sqrt(P Gt Gr) j / (4 pi)` times this; one reflection has `Gamma dOmega` here.
    pub amplitude: Complex64,
    /// `sqrt(Gt Gr)` of the directions of departure and arrival.
    pub gain: f64,
}

/// The scene as ray tubes see it.
struct Shooter<'a> {
    snapshot: &'a Snapshot,
    /// One per body.
    materials: &'a [Material],
    wavelength: f64,
    limits: Limits,
}

impl Shooter<'_> {
    /// Follow a tube that was launched with a share of the largest gain; `arrive` gets it at every surface from the second on,
    /// with all places so far.
    fn follow(&self, mut tube: Tube, share: f64, mut arrive: impl FnMut(&Tube, &[Place])) -> Counts {
        let mut counts = Counts::default();
        let mut places = vec![tube.place];
        for _ in 2..=self.limits.max_bounces {
            tube.reflect(self.mirrored(&tube));
            if tube.field.power() * share < self.limits.floor {
                counts.stopped += 1;
                break;
            }
            counts.rays += 1;
            if !tube.advance(self.snapshot) {
                break;
            }
            places.push(tube.place);
            arrive(&tube, &places);
        }
        counts
    }

    /// Coefficients of the surface where a tube arrives.
    fn mirrored(&self, tube: &Tube) -> [Complex64; 2] {
        self.materials[tube.place.body as usize].mirrored(tube.cosine(), self.wavelength)
    }

    /// What the footprint of a cell of some size sends in a unit direction, to an antenna of a polarisation, if its lit side
    /// faces there.
    fn send(
        &self,
        tube: &Tube,
        size: [f64; 2],
        direction: DVec3,
        polarization: Option<DVec3>,
        sampling: Sampling,
    ) -> Option<Sent> {
        let place = &tube.place;
        if place.normal.dot(direction) <= 0.0 || place.face.dot(direction) <= 0.0 {
            return None;
        }

        // The phase of the tube and of the way to the antenna along the edges of the footprint.
        let slope = tube.edges.map(|edge| 0.5 * (tube.direction - direction).dot(edge));
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
        let received = polarization.map(|e| field::transverse(e, direction));
        let sent = tube.send(self.mirrored(tube), direction, received);
        let amplitude = sent * (tube.spread * tube.section()).sqrt() * (size[0] * size[1]) / tube.cosine();
        (amplitude != Complex64::ZERO).then_some(Sent {
            slope,
            amplitude,
            weight,
        })
    }

    /// The same to an antenna at a place of the sensor frame, if that is in sight, and its distance [m].
    fn send_to(
        &self,
        tube: &Tube,
        size: [f64; 2],
        antenna: DVec3,
        polarization: Option<DVec3>,
        sampling: Sampling,
    ) -> Option<(Sent, f64)> {
        let offset = antenna - tube.place.point;
        let distance = offset.length();
        if distance == 0.0 {
            return None;
        }
        let sent = self.send(tube, size, offset / distance, polarization, sampling)?;
        let is_hidden = self.is_hidden(&tube.place, antenna - tube.place.before, 1.0 - 1e-9);
        (!is_hidden).then_some((sent, distance))
    }

    /// Whether something stands in the way from a place before `far`, in lengths of the direction.
    fn is_hidden(&self, place: &Place, direction: DVec3, far: f64) -> bool {
        let ray = Ray {
            origin: place.before,
            direction,
            start: 0.0,
        };
        self.snapshot.blocks(&ray, far)
    }
}

/// What the footprint of a cell sends.
struct Sent {
    /// Derivatives of half the path by the plane coordinates [m].
    slope: [f64; 2],
    /// Such that a path to an antenna at a distance R has the amplitude `sqrt(P Gt Gr) j / (4 pi)` times this over R.
    amplitude: Complex64,
    /// Mean of the phase over the footprint, tapered.
    weight: f64,
}

/// Ray tubes from the antennas of an array.
struct Sensor<'a> {
    shooter: Shooter<'a>,
    array: &'a Array,
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
        arrive: impl FnMut(&Tube, &[Place]),
    ) -> Counts {
        let Some(tube) = Tube::launch(self.shooter.snapshot, launch, antenna, self.array.polarization) else {
            return Counts::default();
        };
        let share = pattern.gain(tube.place.point - antenna) / pattern.peak();
        self.shooter.follow(tube, share, arrive)
    }

    /// What comes to an antenna.
    fn receive(&self, tube: &Tube, launch: &Launch, antenna: DVec3, sampling: Sampling) -> Option<(Sent, f64)> {
        self.shooter
            .send_to(tube, launch.size, antenna, self.array.polarization, sampling)
    }
}

/// How far before a point of a surface a ray leaves it [m].
fn leaving(point: DVec3) -> f64 {
    LEAVING * point.abs().max_element().max(1.0)
}

/// What every cell returns to the centre of the array by two and more reflections, with the patterns of the first antennas;
/// one material per body.
pub fn echoes(
    snapshot: &Snapshot,
    launches: &[Launch],
    materials: &[Material],
    array: &Array,
    limits: Limits,
) -> Vec<Vec<Echo>> {
    let (Some(transmitter), Some(receiver)) = (array.tx_patterns.first(), array.rx_patterns.first()) else {
        return launches.iter().map(|_| Vec::new()).collect();
    };
    let sensor = Sensor::new(snapshot, materials, array, limits);
    let of = |launch: &Launch| {
        let mut echoes = Vec::new();
        sensor.shoot(launch, (DVec3::ZERO, transmitter), |tube, places| {
            let Some((sent, distance)) = sensor.receive(tube, launch, DVec3::ZERO, Sampling::Point) else {
                return;
            };
            echoes.push(Echo {
                order: places.len(),
                half_path: 0.5 * (tube.length + distance),
                slope: sent.slope,
                amplitude: sent.amplitude / distance,
                gain: (transmitter.gain(places[0].point) * receiver.gain(tube.place.point)).sqrt(),
            });
        });
        echoes
    };
    launches.par_iter().map(of).collect()
}

impl Bounces {
    /// Routes of two and more reflections of all cells, in their order, and what they took; one material per body.
    pub fn new(
        snapshot: &Snapshot,
        launches: &[Launch],
        materials: &[Material],
        array: Array,
        limits: Limits,
        sampling: Sampling,
    ) -> (Self, Counts) {
        let sensor = Sensor::new(snapshot, materials, &array, limits);
        let (ways, view) = (Way::of(&array), View::of(launches));
        let twice = 2.0 / ways.len() as f64; // of shares that add up to one
        let of = |launch: &Launch| {
            let mut routes: Vec<Route> = Vec::new();
            let mut counts = Counts::default();
            for way in ways {
                let [starts, ends] = way.antennas(&array);
                for start in 0..starts.len() {
                    let arrive = |tube: &Tube, places: &[Place]| {
                        let weight = |end: usize| {
                            let sent = sensor.receive(tube, launch, ends.get(end).0, sampling);
                            sent.map_or(Complex64::ZERO, |(sent, _)| {
                                let share = twice * view.share(tube, places, ends.get(end).0);
                                Complex64::I / (2.0 * TAU) * sent.amplitude * (share * sent.weight * tube.length)
                            })
                        };
                        let weights: Vec<Complex64> = (0..ends.len()).map(weight).collect();
                        if weights.iter().all(|weight| *weight == Complex64::ZERO) {
                            return;
                        }
                        let kind = (*way, places.len());
                        let known = routes.iter().position(|route| route.kind() == kind);
                        let index = known.unwrap_or_else(|| {
                            routes.push(Route::new(*way, &array, snapshot, places));
                            routes.len() - 1
                        });
                        routes[index].set(&array, snapshot, start, places, &weights);
                    };
                    counts = counts.plus(sensor.shoot(launch, starts.get(start), arrive));
                }
            }
            (routes, counts)
        };
        let (routes, counts): (Vec<Vec<Route>>, Vec<Counts>) = launches.par_iter().map(of).unzip();
        let counts = counts.into_iter().fold(Counts::default(), Counts::plus);
        (Self::of_routes(snapshot, array, routes.into_iter().flatten()), counts)
    }
}

#[cfg(test)]
mod tests;
