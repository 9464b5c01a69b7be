//! From hits to paths: what every hit, or pixel of somebody else's depth image, sends back to every antenna pair.
//!
//! Two mechanisms per material (README eqs. (2) and (3)): the mirror-like one is physical optics written on the
//! solid angle of a pixel, the diffuse one is Lambert's law with a phase that belongs to the surface point.
//! A hit becomes a material point of its body; from then on it moves with the body, or with its facet where the body
//! deforms, and its delay and amplitude follow from the geometry at any time of the frame.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antenna::{Array, Sight};
use crate::error::{Error, Result, fits_memory};
use crate::facet::Facet;
use crate::hash::mix;
use crate::material::{Material, Response};
use crate::motion::Pose;
use crate::polarization::Seen;
use crate::rays::ImagePlane;
use crate::shown::Shown;
use crate::trace::{Hits, NO_BODY, Snapshot};

/// Speed of light in vacuum [m/s].
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// Surfaces seen at a smaller cosine of incidence return nothing.
const MIN_COSINE: f64 = 1e-6;

/// Surface points in one cube of this edge share their diffuse phase [m]. It is a sixteenth of a wavelength at 60 GHz:
/// waves from its ends arrive at most a quarter of a turn apart, which costs 0.2 dB at grazing incidence.
const SPECKLE_CELL: f64 = 0.3e-3;

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
pub struct Scatterers {
    array: Array,
    /// Number of the pixel that shows it, row by row.
    pixel: Vec<u32>,
    body: Vec<u32>,
    /// Vertices of the facet that it stays with, where the body deforms.
    facet: Vec<Option<[u32; 3]>>,
    /// In body coordinates [m], or those of the facet.
    position: Vec<DVec3>,
    /// Unit normal towards the incident side, in body coordinates, or its slopes along the facet.
    normal: Vec<DVec3>,
    /// Bodies of facets and their numbers of vertices.
    deforming: Vec<(u32, usize)>,
    /// `(scatterer, channel)`.
    weights: Vec<Weight>,
}

/// What a material point sends back by one channel, but for the cosines and distances.
#[derive(Clone, Copy)]
struct Weight {
    /// `(j / 4 pi) Gamma F dA / 2`.
    mirror: Complex64,
    /// `(lambda / 4 pi) sqrt(rho dA / pi) exp(j psi)`.
    diffuse: Complex64,
}

impl Weight {
    fn is_silent(&self) -> bool {
        self.mirror == Complex64::ZERO && self.diffuse == Complex64::ZERO
    }
}

/// Delays and amplitudes, `(node, channel, path)`, row-major.
pub struct Paths {
    /// Two-way delay [s].
    pub delay: Vec<f64>,
    /// Amplitude without the phase of propagation [sqrt(W)].
    pub amplitude: Vec<Complex64>,
}

/// Where everything is at a number of times, in the sensor frame.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// Number of times.
    pub num_nodes: usize,
    /// Number of bodies.
    pub num_bodies: usize,
    /// Poses `(node, body)`.
    pub poses: &'a [Pose],
    /// Positions of the point targets `(node, point)` [m].
    pub points: &'a [DVec3],
    /// Radar cross-sections of the point targets [m^2].
    pub rcs: &'a [f64],
    /// Vertices `(node, vertex)` of the bodies of [`Scatterers::deforming`], one after the other, in body coordinates [m].
    pub vertices: &'a [&'a [[f64; 3]]],
}

/// Every `step`-th path from `first` up to `last`.
#[derive(Clone, Copy, Debug)]
pub struct Selection {
    /// First path.
    pub first: usize,
    /// The path behind the last.
    pub last: usize,
    /// From one path to the next, at least 1.
    pub step: usize,
}

impl Selection {
    /// Number of paths.
    pub fn len(&self) -> usize {
        self.last.saturating_sub(self.first).div_ceil(self.step)
    }

    /// True when there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// An image of surface elements that another program has seen: one per pixel, row by row. The bodies' frames are the
/// sensor frame at the time of the image.
#[derive(Clone, Copy, Debug)]
pub struct Surfels<'a> {
    /// The image.
    pub plane: ImagePlane,
    /// Distance along the ray [m]; no return where it is not a positive, finite number.
    pub distance: &'a [f64],
    /// Unit normals towards the incident side, sensor frame.
    pub normal: &'a [DVec3],
    /// Field reflection coefficient of the mirror-like part.
    pub reflection: &'a [Complex64],
    /// Diffuse albedo.
    pub albedo: &'a [f64],
    /// Number of the body; no return where it is negative.
    pub body: &'a [i32],
    /// Number of bodies.
    pub num_bodies: usize,
}

impl Surfels<'_> {
    /// Refuses images that cannot be, and bodies that are not there.
    fn check(&self) -> Result<()> {
        self.plane.check()?;
        fits_memory(
            "scatterers",
            &[self.plane.rows, self.plane.columns],
            size_of::<Scatterer>(),
        )?;
        let is_beyond = |body: &&i32| usize::try_from(**body).is_ok_and(|body| body >= self.num_bodies);
        match self.body.iter().find(is_beyond) {
            Some(body) => Err(Error::value("body", format!("numbers below {}", self.num_bodies), body)),
            None => Ok(()),
        }
    }

    /// What one pixel shows.
    fn patch(&self, pixel: usize) -> Option<Patch> {
        let (distance, normal) = (self.distance[pixel], self.normal[pixel]);
        if !(distance > 0.0 && distance.is_finite() && normal.is_finite()) {
            return None;
        }
        Some(Patch {
            pixel,
            body: u32::try_from(self.body[pixel]).ok()?,
            direction: self
                .plane
                .direction(pixel / self.plane.columns, pixel % self.plane.columns),
            distance,
            normal,
        })
    }
}

/// What one pixel shows.
struct Patch {
    pixel: usize,
    body: u32,
    /// Unit direction of the ray.
    direction: DVec3,
    /// Distance to the curved surface that the facet stands for [m].
    distance: f64,
    /// Unit normal towards the incident side, sensor frame.
    normal: DVec3,
}

/// The vertices of the triangle that a pixel hit and their weights there, if it hit anything.
pub fn place_on_mesh(snapshot: &Snapshot, hits: &Hits, pixel: usize) -> Option<([u32; 3], [f64; 3])> {
    let body = hits.body.get(pixel).copied().filter(|body| *body != NO_BODY)?;
    let (plane, triangle) = (&hits.plane, hits.triangle[pixel]);
    let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
    let weights = snapshot.barycentric(body, triangle, DVec3::new(1.0, u, v));
    Some((snapshot.surface(body).vertices_of(triangle), weights))
}

/// What the hit of one pixel shows.
fn patch(hits: &Hits, shown: &Shown, pixel: usize) -> Option<Patch> {
    let body = hits.body[pixel];
    let (row, column) = (pixel / hits.plane.columns, pixel % hits.plane.columns);
    (body != NO_BODY).then(|| Patch {
        pixel,
        body,
        direction: hits.plane.direction(row, column),
        distance: shown.distance[pixel],
        normal: shown.normal[pixel],
    })
}

impl Scatterers {
    /// Material points of all hits that send anything back; `materials` per body, `seed` for the diffuse phases.
    pub fn new(
        snapshot: &Snapshot,
        hits: &Hits,
        shown: &Shown,
        materials: &[Material],
        array: Array,
        sampling: Sampling,
        seed: u64,
    ) -> Self {
        Self::gather(&hits.plane, array, sampling, |weigh, pixel| {
            let patch = patch(hits, shown, pixel)?;
            let surface = snapshot.surface(patch.body);
            let speckle = mix(seed ^ surface.fingerprint());
            let material = &materials[patch.body as usize];
            let triangle = hits.triangle[pixel];
            let carrier = surface.is_deformed().then(|| Carrier {
                vertices: surface.vertices_of(triangle),
                facet: Facet::new(surface.corners(triangle)),
                rest: Facet::new(surface.rest_corners(triangle)),
            });
            weigh.scatterer(&patch, material, snapshot.pose(patch.body), carrier.as_ref(), speckle)
        })
        .with_vertices(|body| snapshot.surface(body).vertices().len())
    }

    /// With the numbers of vertices of the bodies that deform.
    fn with_vertices(mut self, number: impl Fn(u32) -> usize) -> Self {
        let on_facets = self.body.iter().zip(&self.facet);
        let mut bodies: Vec<u32> = on_facets.filter_map(|(body, facet)| facet.and(Some(*body))).collect();
        bodies.sort_unstable();
        bodies.dedup();
        self.deforming = bodies.into_iter().map(|body| (body, number(body))).collect();
        self
    }

    /// Material points of all surface elements that send anything back; `seed` for the diffuse phases.
    pub fn from_surfels(surfels: &Surfels, array: Array, sampling: Sampling, seed: u64) -> Result<Self> {
        surfels.check()?;
        Ok(Self::gather(&surfels.plane, array, sampling, |weigh, pixel| {
            let patch = surfels.patch(pixel)?;
            let material = Material::Constant(Response {
                reflection: surfels.reflection[pixel],
                albedo: surfels.albedo[pixel],
            });
            let speckle = mix(seed ^ u64::from(patch.body));
            weigh.scatterer(&patch, &material, &Pose::IDENTITY, None, speckle)
        }))
    }

    /// Those of some bodies, in the same order.
    pub fn select(&self, is_wanted: impl Fn(u32) -> bool) -> Self {
        let channels = self.array.num_channels();
        let rows: Vec<usize> = (0..self.len()).filter(|i| is_wanted(self.body[*i])).collect();
        let weights = rows
            .iter()
            .flat_map(|i| &self.weights[channels * i..channels * (i + 1)]);
        Self {
            array: self.array.clone(),
            pixel: rows.iter().map(|i| self.pixel[*i]).collect(),
            body: rows.iter().map(|i| self.body[*i]).collect(),
            facet: rows.iter().map(|i| self.facet[*i]).collect(),
            position: rows.iter().map(|i| self.position[*i]).collect(),
            normal: rows.iter().map(|i| self.normal[*i]).collect(),
            deforming: self.deforming.iter().copied().filter(|d| is_wanted(d.0)).collect(),
            weights: weights.copied().collect(),
        }
    }

    /// The material points of the pixels that have one.
    fn gather(
        plane: &ImagePlane,
        array: Array,
        sampling: Sampling,
        scatterer: impl Fn(&Weigh, usize) -> Option<Scatterer> + Sync,
    ) -> Self {
        let weigh = Weigh {
            plane,
            array: &array,
            sampling,
        };
        let mut scatterers: Vec<Scatterer> = (0..plane.num_pixels())
            .into_par_iter()
            .filter_map(|pixel| scatterer(&weigh, pixel))
            .collect();
        if sampling == Sampling::Footprint {
            share_speckle(&mut scatterers);
        }
        Self {
            pixel: scatterers.iter().map(|s| s.pixel).collect(),
            body: scatterers.iter().map(|s| s.body).collect(),
            facet: scatterers.iter().map(|s| s.facet).collect(),
            position: scatterers.iter().map(|s| s.position).collect(),
            normal: scatterers.iter().map(|s| s.normal).collect(),
            deforming: Vec::new(),
            weights: scatterers.into_iter().flat_map(|s| s.weights).collect(),
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

    /// Body of every material point, in image order.
    pub fn bodies(&self) -> &[u32] {
        &self.body
    }

    /// Pixel of every material point, in image order.
    pub fn pixels(&self) -> &[u32] {
        &self.pixel
    }

    /// Bodies that deform and have material points here, in increasing order, and their numbers of vertices.
    pub fn deforming(&self) -> &[(u32, usize)] {
        &self.deforming
    }

    /// Number of TX-RX pairs.
    pub fn num_channels(&self) -> usize {
        self.array.num_channels()
    }

    /// Delays and amplitudes of the selected paths: first the material points, then the point targets.
    pub fn paths(&self, places: &Places, selection: Selection) -> Result<Paths> {
        const BLOCK: usize = 1024;
        let (num_channels, num_paths) = (self.num_channels(), selection.len());
        let shape = [places.num_nodes, num_channels, num_paths];
        fits_memory("paths", &shape, size_of::<(f64, Complex64)>())?;
        let total = shape.iter().product();
        let mut paths = Paths {
            delay: vec![0.0; total],
            amplitude: vec![Complex64::ZERO; total],
        };
        if total == 0 {
            return Ok(paths);
        }

        // Rows (node, channel) in parallel, and blocks of every row.
        let rows = paths
            .delay
            .par_chunks_mut(num_paths)
            .zip(paths.amplitude.par_chunks_mut(num_paths));
        rows.enumerate().for_each(|(row, (delay, amplitude))| {
            let (node, channel) = (row / num_channels, row % num_channels);
            let blocks = delay.par_chunks_mut(BLOCK).zip(amplitude.par_chunks_mut(BLOCK));
            blocks.enumerate().for_each(|(block, (delay, amplitude))| {
                for (i, (delay, amplitude)) in delay.iter_mut().zip(amplitude).enumerate() {
                    let path = selection.first + (block * BLOCK + i) * selection.step;
                    (*delay, *amplitude) = self.path(places, node, channel, path);
                }
            });
        });
        Ok(paths)
    }

    /// Delay and amplitude of one path of one channel at one time.
    fn path(&self, places: &Places, node: usize, channel: usize, path: usize) -> (f64, Complex64) {
        let Some(&body) = self.body.get(path) else {
            let point = path - self.len();
            let (t, r) = self.array.pair(channel, places.points[node * places.rcs.len() + point]);
            return (delay(&t, &r), self.point_amplitude(places.rcs[point], &t, &r));
        };
        let pose = &places.poses[node * places.num_bodies + body as usize];
        let (mut position, mut normal) = (self.position[path], self.normal[path]);
        if let Some(facet) = self.facet_of(places, node, path) {
            (position, normal) = (facet.point(position), facet.normal(normal));
        }
        let (t, r) = self.array.pair(channel, pose.point(position));
        let normal = pose.direction(normal);
        (delay(&t, &r), self.surface_amplitude(path, channel, normal, &t, &r))
    }

    /// The facet of a material point of a body that deforms; its corners may be velocities.
    fn facet_of(&self, places: &Places, node: usize, path: usize) -> Option<Facet> {
        let corners = self.facet[path]?;
        let body = self.body[path];
        let index = self.deforming.iter().position(|deforming| deforming.0 == body)?;
        let vertices = &places.vertices[index][node * self.deforming[index].1..];
        Some(Facet::new(
            corners.map(|vertex| DVec3::from_array(vertices[vertex as usize])),
        ))
    }

    /// Rate of every delay [s/s], `(channel, path)`, at the first node of `places`; `rates` are the time derivatives.
    /// Distances do not depend on the frame they are measured in, so this is exact for a moving sensor too.
    pub fn delay_rates(&self, places: &Places, rates: &Places) -> Vec<f64> {
        let num_paths = self.len() + places.points.len();
        (0..self.num_channels() * num_paths)
            .into_par_iter()
            .map(|i| {
                let (channel, path) = (i / num_paths, i % num_paths);
                let (position, velocity) = match self.body.get(path) {
                    Some(&body) => {
                        let (pose, rate) = (&places.poses[body as usize], &rates.poses[body as usize]);
                        let (mut position, mut velocity) = (self.position[path], DVec3::ZERO);
                        let facets = [places, rates].map(|places| self.facet_of(places, 0, path));
                        if let [Some(facet), Some(facet_rate)] = facets {
                            velocity = facet.velocity(&facet_rate, position);
                            position = facet.point(position);
                        }
                        (pose.point(position), rate.point(position) + pose.direction(velocity))
                    }
                    None => (places.points[path - self.len()], rates.points[path - self.len()]),
                };
                let (t, r) = self.array.pair(channel, position);
                velocity.dot(t.direction + r.direction) / SPEED_OF_LIGHT
            })
            .collect()
    }

    /// README eqs. (2) and (3) at a material point that may have moved since it was hit.
    fn surface_amplitude(&self, path: usize, channel: usize, normal: DVec3, t: &Sight, r: &Sight) -> Complex64 {
        let (cos_t, cos_r) = ((-normal.dot(t.direction)).max(0.0), (-normal.dot(r.direction)).max(0.0));
        let weight = &self.weights[path * self.num_channels() + channel];
        let mirror = weight.mirror * (cos_t + cos_r);
        let diffuse = weight.diffuse * (cos_t * cos_r).sqrt();
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

fn delay(t: &Sight, r: &Sight) -> f64 {
    (t.distance + r.distance) / SPEED_OF_LIGHT
}

/// One material point; see [`Scatterers`].
struct Scatterer {
    pixel: u32,
    body: u32,
    facet: Option<[u32; 3]>,
    position: DVec3,
    normal: DVec3,
    /// Per channel.
    weights: Vec<Weight>,
    /// Area of the patch [m^2].
    area: f64,
    /// Number of the cell whose diffuse phase it has.
    cell: u64,
}

/// Patches with one phase add up like fields, not like powers: weigh them so that the power of a cell is that of its
/// area, however many pixels it was sampled with.
fn share_speckle(scatterers: &mut [Scatterer]) {
    let is_diffuse = |s: &Scatterer| s.weights.iter().any(|w| w.diffuse != Complex64::ZERO);
    let mut areas: HashMap<u64, f64> = HashMap::new();
    for scatterer in scatterers.iter().filter(|s| is_diffuse(s)) {
        *areas.entry(scatterer.cell).or_default() += scatterer.area;
    }
    for scatterer in scatterers.iter_mut().filter(|s| is_diffuse(s)) {
        let share = (scatterer.area / areas[&scatterer.cell]).sqrt();
        for weight in &mut scatterer.weights {
            weight.diffuse *= share;
        }
    }
}

/// What carries a material point of a body that deforms.
struct Carrier {
    vertices: [u32; 3],
    /// When the rays were cast.
    facet: Facet,
    /// Before the body was deformed.
    rest: Facet,
}

struct Weigh<'a> {
    plane: &'a ImagePlane,
    array: &'a Array,
    sampling: Sampling,
}

impl Weigh<'_> {
    /// What the material of a surface with a unit normal returns to antennas in unit directions. The angle of incidence is
    /// that whose cosine is the mean of both, which is the mirror's where it matters.
    fn response(&self, material: &Material, normal: DVec3, t: DVec3, r: DVec3) -> Response {
        let cosine = 0.5 * ((-normal.dot(t)).max(0.0) + (-normal.dot(r)).max(0.0));
        let polarization = self.array.polarization;
        let seen = polarization.map_or(Seen::SCALAR, |e| Seen::by(e, normal, t, r));
        material.response(cosine, SPEED_OF_LIGHT / self.array.frequency, seen)
    }

    /// The material point of one patch, if it sends anything back.
    fn scatterer(
        &self,
        patch: &Patch,
        material: &Material,
        pose: &Pose,
        carrier: Option<&Carrier>,
        speckle: u64,
    ) -> Option<Scatterer> {
        let &Patch {
            pixel,
            body,
            direction,
            distance,
            normal,
        } = patch;
        let cos = -normal.dot(direction);
        if cos < MIN_COSINE || distance <= 0.0 {
            return None;
        }
        let wavelength = SPEED_OF_LIGHT / self.array.frequency;

        // The patch of surface behind the pixel.
        let solid_angle = self
            .plane
            .solid_angle(pixel / self.plane.columns, pixel % self.plane.columns);
        let area = distance * distance * solid_angle / cos;

        // The place on the body, or on its facet where the body deforms.
        let point = distance * direction;
        let (mut position, mut normal_to_body) = (pose.point_to_body(point), pose.direction_to_body(normal));
        let mut on_surface = position;
        if let Some(Carrier { facet, rest, .. }) = carrier {
            (position, normal_to_body) = (facet.coordinates(position), facet.slopes(normal_to_body));
            on_surface = rest.point(position);
        }

        // The diffuse phase belongs to the surface, which is told by where it was before it was deformed.
        let cell = speckle_cell(speckle, on_surface / SPECKLE_CELL + SPECKLE_ORIGIN);
        let phase = match self.sampling {
            Sampling::Point => 0.0,
            Sampling::Footprint => TAU * speckle_turns(cell),
        };

        // What the material sends back, mirror-like and diffuse, by every channel.
        let edges = footprint(self.plane, pixel, direction, distance, normal);
        let phasor = Complex64::cis(phase);
        let weights: Vec<Weight> = (0..self.array.num_channels())
            .map(|channel| {
                let [t, r] = self.array.directions(channel, point);
                let Response { reflection, albedo } = self.response(material, normal, t, r);
                let mut mirror = Complex64::new(0.0, 1.0 / (8.0 * PI)) * reflection * area;
                if self.sampling == Sampling::Footprint && mirror != Complex64::ZERO {
                    let bisector = 0.5 * (TAU / wavelength) * (t + r);
                    mirror *= taper(bisector.dot(edges.0)) * taper(bisector.dot(edges.1));
                }
                let magnitude = wavelength / (4.0 * PI) * (albedo * area / PI).sqrt();
                Weight {
                    mirror,
                    diffuse: phasor * magnitude,
                }
            })
            .collect();

        let is_silent = weights.iter().all(Weight::is_silent);
        (!is_silent).then_some(Scatterer {
            pixel: pixel as u32,
            body,
            facet: carrier.map(|carrier| carrier.vertices),
            position,
            normal: normal_to_body,
            weights,
            area,
            cell,
        })
    }
}

/// Power that the material at every pixel returns, mirror-like and diffuse, over incident power, to antennas at the centre
/// of the array; zero where nothing was hit. `shown` is asked only where it depends on the angle.
pub fn reflectance<'a>(
    hits: &Hits,
    materials: &[Material],
    frequency: f64,
    polarization: Option<DVec3>,
    shown: impl FnOnce() -> &'a Shown,
) -> Vec<f64> {
    let wavelength = SPEED_OF_LIGHT / frequency;
    if materials.iter().all(|m| matches!(m, Material::Constant(_))) {
        let of = |m: &Material| m.response(1.0, wavelength, Seen::SCALAR).power();
        let per_body: Vec<f64> = materials.iter().map(of).collect();
        let of = |body: &u32| per_body.get(*body as usize).copied().unwrap_or(0.0);
        return hits.body.iter().map(of).collect();
    }
    let shown = shown();
    (0..hits.plane.num_pixels())
        .into_par_iter()
        .map(|pixel| {
            let Some(material) = materials.get(hits.body[pixel] as usize) else {
                return 0.0;
            };
            let direction = hits
                .plane
                .direction(pixel / hits.plane.columns, pixel % hits.plane.columns);
            let seen = polarization.map_or(Seen::SCALAR, |e| Seen::by(e, shown.normal[pixel], direction, direction));
            material.response(shown.cosine[pixel], wavelength, seen).power()
        })
        .collect()
}

/// The two edges of a pixel's patch on the tangent plane, dx/du du and dx/dv dv [m].
fn footprint(plane: &ImagePlane, pixel: usize, d: DVec3, distance: f64, normal: DVec3) -> (DVec3, DVec3) {
    let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
    let w = (1.0 + u * u + v * v).sqrt();
    let edge = |axis: DVec3, coordinate: f64, width: f64| {
        let turn = (axis - d * (coordinate / w)) / w; // dd/du of d = (1, u, v) / w
        let stretch = -distance * normal.dot(turn) / normal.dot(d); // dR/du on the tangent plane
        (stretch * d + distance * turn) * width
    };
    (edge(DVec3::Y, u, plane.du), edge(DVec3::Z, v, plane.dv))
}

/// Mean of exp(-2jx s) over s in [-1/2, 1/2], tapered to zero at x = pi so that aliases of steep patches vanish.
pub(crate) fn taper(x: f64) -> f64 {
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
fn speckle_cell(speckle: u64, cell: DVec3) -> u64 {
    let cell = cell.floor().to_array().map(|x| x as i64 as u64);
    cell.into_iter().fold(speckle, |state, word| mix(state ^ word))
}

/// The phase of a cell in turns: uniform in [0, 1).
fn speckle_turns(cell: u64) -> f64 {
    (cell >> 11) as f64 / (1_u64 << 53) as f64
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
            .map(|i| speckle_turns(speckle_cell(3, DVec3::new(f64::from(i) + 0.5, -2.5, 0.5))))
            .collect();
        let mean = |values: &mut dyn Iterator<Item = Complex64>| values.sum::<Complex64>().norm() / 20_000.0;
        // Sums of n random phasors have rms sqrt(n): four sigma of 1 / sqrt(20000).
        let phasors: Vec<Complex64> = turns.iter().map(|t| Complex64::cis(TAU * t)).collect();
        assert!(mean(&mut phasors.iter().copied()) < 0.03);
        assert!(mean(&mut phasors.windows(2).map(|p| p[0] * p[1].conj())) < 0.03);
    }
}
