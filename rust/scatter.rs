//! From hits to paths: what every hit sends back to every antenna pair.
//!
//! Two mechanisms per material (README eqs. (2) and (3)): the mirror-like one is physical optics written on the
//! solid angle of a pixel, the diffuse one is Lambert's law with a phase that belongs to the surface point.
//! A hit becomes a material point of its body; from then on it moves with the body, and its delay and
//! amplitude follow from the geometry at any time of the frame.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antenna::{Array, Sight};
use crate::material::Material;
use crate::motion::Pose;
use crate::shading::shade;
use crate::trace::{Hits, NO_BODY, Snapshot};

/// Speed of light in vacuum [m/s].
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// Rays that graze a surface closer than this cosine return nothing.
const GRAZING: f64 = 1e-6;

/// Surface points in one cube of this edge, in wavelengths, share their diffuse phase. Waves from its ends arrive at
/// most a quarter of a turn apart, which costs 0.2 dB at grazing incidence.
const SPECKLE_CELL: f64 = 1.0 / 16.0;

/// Where the cubes begin, in edges: apart from the planes through the body's origin, where rounding would toss
/// points of a plate between two cubes.
const SPECKLE_ORIGIN: DVec3 = DVec3::new(0.381_966, 0.414_214, 0.302_776);

/// How a pixel stands for the patch it covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// One point, no phase variation over the patch and no random phase: the coherent sum over pixels of Stetco
    /// et al., ICRA 2020. It does not converge; for comparison.
    Point,
    /// The phase varies linearly over the patch, tapered so that steep patches drop out.
    Footprint,
}

/// Material points with what their amplitude needs besides the geometry.
pub struct Samples {
    array: Array,
    body: Vec<u32>,
    pixel: Vec<u32>,
    /// In body coordinates [m].
    position: Vec<DVec3>,
    /// Unit normal towards the incident side, in body coordinates.
    normal: Vec<DVec3>,
    /// `(sample, channel)`: `(j / 4 pi) Gamma F dA / 2`.
    mirror: Vec<Complex64>,
    /// `(lambda / 4 pi) sqrt(rho dA / pi) exp(j psi)`.
    diffuse: Vec<Complex64>,
}

/// Delays and amplitudes, `(node, channel, path)`, row-major.
pub struct Paths {
    /// Two-way delay [s].
    pub delay: Vec<f64>,
    /// Amplitude without the phase of propagation [sqrt(W)].
    pub amplitude: Vec<Complex64>,
}

/// Point targets at one time, in the sensor frame.
#[derive(Clone, Copy, Debug)]
pub struct Points<'a> {
    /// Position of every target at every node, `(node, point)` [m].
    pub position: &'a [DVec3],
    /// Radar cross-section of every target [m^2].
    pub rcs: &'a [f64],
}

/// A hit with its shading.
struct Shaded {
    /// Unit direction of the ray.
    direction: DVec3,
    /// Distance to the curved surface that the facet stands for [m].
    distance: f64,
    /// Unit normal towards the incident side, sensor frame.
    normal: DVec3,
}

/// Cosine of the angle of incidence of every pixel; zero where nothing was hit.
pub fn cos_incidence(snapshot: &Snapshot, hits: &Hits) -> Vec<f64> {
    (0..hits.plane.num_pixels())
        .into_par_iter()
        .map(|pixel| shaded(snapshot, hits, pixel).map_or(0.0, |s| (-s.normal.dot(s.direction)).clamp(0.0, 1.0)))
        .collect()
}

/// Shading of the hit of one pixel.
fn shaded(snapshot: &Snapshot, hits: &Hits, pixel: usize) -> Option<Shaded> {
    let hit = hits.get(pixel);
    if hit.body == NO_BODY {
        return None;
    }
    let (surface, pose) = (snapshot.surface(hit.body), snapshot.pose(hit.body));
    let direction = hits
        .plane
        .direction(pixel / hits.plane.columns, pixel % hits.plane.columns);
    let corners = surface.corners(hit.triangle);
    let face_normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
    let normals = surface.corner_normals(hit.triangle);
    let (normal, correction) = shade(
        corners,
        normals,
        hit.barycentric,
        face_normal,
        pose.direction_to_body(direction),
    );
    Some(Shaded {
        direction,
        distance: hit.distance + correction,
        normal: pose.direction(normal),
    })
}

impl Samples {
    /// Material points of all hits that send anything back; `materials` per body, `seed` for the diffuse phases.
    pub fn new(
        snapshot: &Snapshot,
        hits: &Hits,
        materials: &[Material],
        array: Array,
        sampling: Sampling,
        seed: u64,
    ) -> Self {
        let weigh = Weigh {
            snapshot,
            hits,
            materials,
            array: &array,
            sampling,
            seed,
        };
        let mut samples: Vec<Sample> = (0..hits.plane.num_pixels())
            .into_par_iter()
            .filter_map(|pixel| weigh.sample(pixel))
            .collect();
        if sampling == Sampling::Footprint {
            share_speckle(&mut samples);
        }
        Self {
            body: samples.iter().map(|s| s.body).collect(),
            pixel: samples.iter().map(|s| s.pixel).collect(),
            position: samples.iter().map(|s| s.position).collect(),
            normal: samples.iter().map(|s| s.normal).collect(),
            diffuse: samples.iter().map(|s| s.diffuse).collect(),
            mirror: samples.into_iter().flat_map(|s| s.mirror).collect(),
            array,
        }
    }

    /// Number of material points.
    pub fn len(&self) -> usize {
        self.body.len()
    }

    /// True when nothing sends anything back.
    pub fn is_empty(&self) -> bool {
        self.body.is_empty()
    }

    /// Body of every material point.
    pub fn bodies(&self) -> &[u32] {
        &self.body
    }

    /// Pixel of every material point, in image order.
    pub fn pixels(&self) -> &[u32] {
        &self.pixel
    }

    /// Number of TX-RX pairs.
    pub fn num_channels(&self) -> usize {
        self.array.num_channels()
    }

    /// Delays and amplitudes with the bodies at `poses` `(node, body)`; the points follow the samples.
    pub fn paths(&self, poses: &[Pose], num_bodies: usize, num_nodes: usize, points: &Points) -> Paths {
        const BLOCK: usize = 1024;
        let (num_channels, num_points) = (self.num_channels(), points.rcs.len());
        let num_paths = self.len() + num_points;
        let num_blocks = num_paths.div_ceil(BLOCK);

        // Blocks of paths at one node, each (path, channel).
        let blocks: Vec<Vec<(f64, Complex64)>> =
            (0..num_nodes * num_blocks)
                .into_par_iter()
                .map(|i| {
                    let (node, first) = (i / num_blocks, i % num_blocks * BLOCK);
                    let node_poses = &poses[node * num_bodies..][..num_bodies];
                    let node_points = &points.position[node * num_points..][..num_points];
                    let (mut tx, mut rx) = (Vec::new(), Vec::new());
                    let mut block = Vec::with_capacity(BLOCK * num_channels);
                    for path in first..num_paths.min(first + BLOCK) {
                        if path < self.len() {
                            let pose = &node_poses[self.body[path] as usize];
                            self.array.sights(pose.point(self.position[path]), &mut tx, &mut rx);
                            let normal = pose.direction(self.normal[path]);
                            block.extend(pairs(&tx, &rx).map(|(channel, t, r)| {
                                (delay(t, r), self.surface_amplitude(path, channel, normal, t, r))
                            }));
                        } else {
                            let point = path - self.len();
                            self.array.sights(node_points[point], &mut tx, &mut rx);
                            block.extend(
                                pairs(&tx, &rx)
                                    .map(|(_, t, r)| (delay(t, r), self.point_amplitude(points.rcs[point], t, r))),
                            );
                        }
                    }
                    block
                })
                .collect();

        // To (node, channel, path).
        let total = num_nodes * num_channels * num_paths;
        let mut paths = Paths {
            delay: vec![0.0; total],
            amplitude: vec![Complex64::ZERO; total],
        };
        for (i, block) in blocks.iter().enumerate() {
            let (node, first) = (i / num_blocks, i % num_blocks * BLOCK);
            for (k, (delay, amplitude)) in block.iter().enumerate() {
                let (path, channel) = (first + k / num_channels, k % num_channels);
                let at = (node * num_channels + channel) * num_paths + path;
                (paths.delay[at], paths.amplitude[at]) = (*delay, *amplitude);
            }
        }
        paths
    }

    /// Rate of every delay [s/s], `(channel, path)`, from poses and their time derivatives at one time.
    /// Distances do not depend on the frame they are measured in, so this is exact for a moving sensor too.
    pub fn delay_rates(&self, poses: &[Pose], rates: &[Pose], points: &[DVec3], point_rates: &[DVec3]) -> Vec<f64> {
        let num_channels = self.num_channels();
        let num_paths = self.len() + points.len();
        let rows: Vec<Vec<f64>> = (0..num_paths)
            .into_par_iter()
            .map(|path| {
                let (position, velocity) = if path < self.len() {
                    let body = self.body[path] as usize;
                    (
                        poses[body].point(self.position[path]),
                        rates[body].point(self.position[path]),
                    )
                } else {
                    (points[path - self.len()], point_rates[path - self.len()])
                };
                let (mut tx, mut rx) = (Vec::new(), Vec::new());
                self.array.sights(position, &mut tx, &mut rx);
                pairs(&tx, &rx)
                    .map(|(_, t, r)| velocity.dot(t.direction + r.direction) / SPEED_OF_LIGHT)
                    .collect()
            })
            .collect();
        (0..num_channels * num_paths)
            .map(|i| rows[i % num_paths][i / num_paths])
            .collect()
    }

    /// README eqs. (2) and (3) at a material point that may have moved since it was hit.
    fn surface_amplitude(&self, path: usize, channel: usize, normal: DVec3, t: &Sight, r: &Sight) -> Complex64 {
        let (cos_t, cos_r) = ((-normal.dot(t.direction)).max(0.0), (-normal.dot(r.direction)).max(0.0));
        let mirror = self.mirror[path * self.num_channels() + channel] * (cos_t + cos_r);
        let diffuse = self.diffuse[path] * (cos_t * cos_r).sqrt();
        (mirror + diffuse) * self.spreading(t, r)
    }

    /// Radar equation: sqrt(P Gt Gr) (lambda / 4 pi) sqrt(sigma / 4 pi) / (Rt Rr).
    fn point_amplitude(&self, rcs: f64, t: &Sight, r: &Sight) -> Complex64 {
        let wavelength = SPEED_OF_LIGHT / self.array.frequency;
        Complex64::from(wavelength / (4.0 * PI) * (rcs / (4.0 * PI)).sqrt() * self.spreading(t, r))
    }

    fn spreading(&self, t: &Sight, r: &Sight) -> f64 {
        (self.array.power * t.gain * r.gain).sqrt() / (t.distance * r.distance)
    }
}

/// All TX-RX pairs with their channel.
fn pairs<'a>(tx: &'a [Sight], rx: &'a [Sight]) -> impl Iterator<Item = (usize, &'a Sight, &'a Sight)> {
    tx.iter()
        .flat_map(|t| rx.iter().map(move |r| (t, r)))
        .enumerate()
        .map(|(channel, (t, r))| (channel, t, r))
}

fn delay(t: &Sight, r: &Sight) -> f64 {
    (t.distance + r.distance) / SPEED_OF_LIGHT
}

/// One material point; see [`Samples`].
struct Sample {
    body: u32,
    pixel: u32,
    position: DVec3,
    normal: DVec3,
    mirror: Vec<Complex64>,
    diffuse: Complex64,
    /// Area of the patch [m^2].
    area: f64,
    /// Number of the cell whose diffuse phase it has.
    cell: u64,
}

/// Patches with one phase add up like fields, not like powers: weigh them so that the power of a cell is that of its
/// area, however many pixels it was sampled with.
fn share_speckle(samples: &mut [Sample]) {
    let is_diffuse = |s: &Sample| s.diffuse != Complex64::ZERO;
    let mut areas: HashMap<u64, f64> = HashMap::new();
    for sample in samples.iter().filter(|s| is_diffuse(s)) {
        *areas.entry(sample.cell).or_default() += sample.area;
    }
    for sample in samples.iter_mut().filter(|s| is_diffuse(s)) {
        sample.diffuse *= (sample.area / areas[&sample.cell]).sqrt();
    }
}

struct Weigh<'a> {
    snapshot: &'a Snapshot,
    hits: &'a Hits,
    materials: &'a [Material],
    array: &'a Array,
    sampling: Sampling,
    seed: u64,
}

impl Weigh<'_> {
    /// The material point of one pixel, if it sends anything back.
    fn sample(&self, pixel: usize) -> Option<Sample> {
        let Shaded {
            direction,
            distance,
            normal,
        } = shaded(self.snapshot, self.hits, pixel)?;
        let cos = -normal.dot(direction);
        if cos < GRAZING || distance <= 0.0 {
            return None;
        }
        let plane = &self.hits.plane;
        let body = self.hits.body[pixel];
        let material = &self.materials[body as usize];
        let wavelength = SPEED_OF_LIGHT / self.array.frequency;

        // The patch of surface behind the pixel.
        let area = distance * distance * plane.solid_angle(pixel / plane.columns, pixel % plane.columns) / cos;

        // Mirror-like part of every channel.
        let point = distance * direction;
        let scale = Complex64::new(0.0, 1.0 / (8.0 * PI)) * material.reflection * area;
        let (mut tx, mut rx) = (Vec::new(), Vec::new());
        self.array.sights(point, &mut tx, &mut rx);
        let mirror: Vec<Complex64> = match self.sampling {
            _ if scale == Complex64::ZERO => vec![scale; self.array.num_channels()],
            Sampling::Point => vec![scale; self.array.num_channels()],
            Sampling::Footprint => {
                let (across, down) = footprint(plane, pixel, direction, distance, normal);
                let k = TAU / wavelength;
                let factor = |t: &Sight, r: &Sight| {
                    let bisector = 0.5 * k * (t.direction + r.direction);
                    taper(bisector.dot(across)) * taper(bisector.dot(down))
                };
                pairs(&tx, &rx).map(|(_, t, r)| scale * factor(t, r)).collect()
            }
        };

        // Diffuse part.
        let pose = self.snapshot.pose(body);
        let position = pose.point_to_body(point);
        let magnitude = wavelength / (4.0 * PI) * (material.albedo * area / PI).sqrt();
        let cell = speckle_cell(self.seed, body, position / (SPECKLE_CELL * wavelength) + SPECKLE_ORIGIN);
        let phase = match self.sampling {
            Sampling::Point => 0.0,
            Sampling::Footprint => TAU * speckle_turns(cell),
        };
        let diffuse = Complex64::from_polar(magnitude, phase);

        let is_silent = diffuse == Complex64::ZERO && mirror.iter().all(|m| *m == Complex64::ZERO);
        let normal = pose.direction_to_body(normal);
        (!is_silent).then_some(Sample {
            body,
            pixel: pixel as u32,
            position,
            normal,
            mirror,
            diffuse,
            area,
            cell,
        })
    }
}

/// The two edges of a pixel's patch on the tangent plane, dx/du du and dx/dv dv [m].
fn footprint(plane: &crate::rays::ImagePlane, pixel: usize, d: DVec3, distance: f64, normal: DVec3) -> (DVec3, DVec3) {
    let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
    let w = (1.0 + u * u + v * v).sqrt();
    let edge = |axis: DVec3, coordinate: f64, width: f64| {
        let turn = (axis - d * (coordinate / w)) / w; // dd/du of d = (1, u, v) / w
        let stretch = -distance * normal.dot(turn) / normal.dot(d); // dR/du on the tangent plane
        (stretch * d + distance * turn) * width
    };
    (edge(DVec3::Y, u, plane.du()), edge(DVec3::Z, v, plane.dv()))
}

/// Mean of exp(-2jx s) over s in [-1/2, 1/2], tapered to zero at x = pi so that aliases of steep patches vanish.
fn taper(x: f64) -> f64 {
    let x = x.abs();
    if x >= PI {
        return 0.0;
    }
    let sinc = if x < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x };
    if x <= FRAC_PI_2 {
        sinc
    } else {
        sinc * (x - FRAC_PI_2).cos()
    }
}

/// A random number that belongs to a cell of the surface: the same in every chirp, frame and pixel.
fn speckle_cell(seed: u64, body: u32, cell: DVec3) -> u64 {
    let cell = cell.floor();
    let words = [
        seed,
        u64::from(body),
        cell.x as i64 as u64,
        cell.y as i64 as u64,
        cell.z as i64 as u64,
    ];
    words.into_iter().fold(0, |state, word| mix(state ^ word))
}

/// The phase of a cell in turns: uniform in [0, 1).
fn speckle_turns(cell: u64) -> f64 {
    (cell >> 11) as f64 / (1_u64 << 53) as f64
}

/// One step of `SplitMix64`: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, OOPSLA 2014.
fn mix(state: u64) -> u64 {
    let z = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taper_is_sinc_then_falls_to_zero_without_a_step() {
        assert_eq!((taper(0.0), taper(PI), taper(7.0)), (1.0, 0.0, 0.0));
        assert!((taper(1e-4) - taper(1.000_000_1e-4)).abs() < 1e-12);
        assert!((taper(FRAC_PI_2 + 1e-9) - taper(FRAC_PI_2 - 1e-9)).abs() < 1e-8);
        assert!((taper(-1.0) - 1.0_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn speckle_phases_are_uniform_and_uncorrelated_between_neighbours() {
        let turns: Vec<f64> = (0..20_000)
            .map(|i| speckle_turns(speckle_cell(0, 3, DVec3::new(f64::from(i) + 0.5, -2.5, 0.5))))
            .collect();
        let mean = |values: &mut dyn Iterator<Item = Complex64>| values.sum::<Complex64>().norm() / 20_000.0;
        // Sums of n random phasors have rms sqrt(n): four sigma of 1 / sqrt(20000).
        let phasors: Vec<Complex64> = turns.iter().map(|t| Complex64::cis(TAU * t)).collect();
        assert!(mean(&mut phasors.iter().copied()) < 0.03);
        assert!(mean(&mut phasors.windows(2).map(|p| p[0] * p[1].conj())) < 0.03);
    }
}
