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

use crate::adaptive::Leaf;
use crate::antennas::array::Array;
use crate::antennas::polarization::Seen;
use crate::constants::SPEED_OF_LIGHT;
use crate::diffuse::Speckle;
use crate::error::{Error, Result, fits_memory};
use crate::geometry::moving_triangle::Facet;
use crate::geometry::pose::Pose;
use crate::geometry::triangle::area;
use crate::material::{Material, Response};
use crate::numeric::random::mix;
use crate::numeric::trig::sinc;
use crate::paths::scatterers::{Edges, Scatterers, Weight, bisector};
use crate::rays::batch::Found;
use crate::rays::camera::{Cell, ImagePlane};
use crate::rays::image::Hits;
use crate::rays::scene::{NO_BODY, Snapshot};
use crate::rays::smooth_hits::Shown;
use crate::samples::Samples;

/// Surfaces seen at a smaller cosine of incidence return nothing.
const MIN_COSINE: f64 = 1e-6;

/// Surface points in one cube of this edge share their diffuse phase [m]. It is a sixteenth of a wavelength at 60 GHz:
/// waves from its ends arrive at most a quarter of a turn apart, which costs 0.2 dB at grazing incidence.
const SPECKLE_CELL: f64 = 0.3e-3;

/// The phase turns at the end of a cell at least at this part of the rate that it turns at in its centre, else at that.
const LEAST_TURN: f64 = 0.5;

/// Cell of points that belong to none.
pub const NO_CELL: u32 = u32::MAX;

/// Where the cubes begin, in edges: apart from the planes through the body's origin, where rounding would toss
/// points of a plate between two cubes.
const SPECKLE_ORIGIN: DVec3 = DVec3::new(0.381_966, 0.414_214, 0.302_776);

/// How a cell stands for the patch it covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// One point, no phase variation over the patch and no random phase: the coherent sum over pixels of Stetco
    /// et al., ICRA 2020. It does not converge; for comparison.
    Point,
    /// The phase varies linearly over the patch, tapered so that steep patches drop out.
    Footprint,
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
        fits_memory("scatterers", &[self.plane.rows, self.plane.columns], POINT_SIZE)?;
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
            index: pixel,
            body: u32::try_from(self.body[pixel]).ok()?,
            cell: self.plane.cell(pixel / self.plane.columns, pixel % self.plane.columns),
            distance,
            normal,
        })
    }
}

/// What one cell shows.
#[derive(Clone, Copy)]
struct Patch {
    /// Number of the cell.
    index: usize,
    body: u32,
    cell: Cell,
    /// Distance to the curved surface that the facet stands for [m].
    distance: f64,
    /// Unit normal towards the incident side, sensor frame.
    normal: DVec3,
}

impl Patch {
    const NOTHING: Self = Self {
        index: 0,
        body: NO_BODY,
        cell: Cell {
            u: 0.0,
            v: 0.0,
            du: 0.0,
            dv: 0.0,
        },
        distance: 0.0,
        normal: DVec3::ZERO,
    };

    /// The same about the point of the plane that is so many widths of the cell away; none where the plane is seen at too small
    /// an angle for that.
    fn about(&self, sides: [f64; 2]) -> Option<Self> {
        let cell = self.cell.about(sides);
        let distance = self.distance * self.normal.dot(self.cell.direction()) / self.normal.dot(cell.direction());
        let is_near = distance > 0.5 * self.distance && distance < 2.0 * self.distance;
        is_near.then_some(Self {
            cell,
            distance,
            ..*self
        })
    }

    /// The point in its middle [m].
    fn point(&self) -> DVec3 {
        self.distance * self.cell.direction()
    }

    /// Of surface behind the cell [m^2], if that faces the sensor.
    fn area(&self) -> Option<f64> {
        let cosine = -self.normal.dot(self.cell.direction());
        let area = self.distance * self.distance * self.cell.solid_angle() / cosine;
        (cosine >= MIN_COSINE && self.distance > 0.0).then_some(area)
    }
}

/// The vertices of the triangle that the ray of a cell hit and their weights there.
pub fn place_on_mesh(snapshot: &Snapshot, cell: &Cell, body: u32, triangle: u32) -> ([u32; 3], [f64; 3]) {
    let weights = snapshot.barycentric(body, triangle, DVec3::new(1.0, cell.u, cell.v));
    (snapshot.surface(body).vertices_of(triangle), weights)
}

/// What the hit of one pixel shows.
fn patch(hits: &Hits, shown: &Shown, pixel: usize) -> Option<Patch> {
    let body = hits.body[pixel];
    let (row, column) = (pixel / hits.plane.columns, pixel % hits.plane.columns);
    (body != NO_BODY).then(|| Patch {
        index: pixel,
        body,
        cell: hits.plane.cell(row, column),
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
        Self::gather(hits.plane.num_pixels(), array, sampling, |weigh, pixel, points| {
            if let Some(patch) = patch(hits, shown, pixel) {
                let ground = Ground::of_mesh(snapshot, patch.body, hits.triangle[pixel], seed);
                weigh.patch(&patch, &ground, &materials[patch.body as usize], points);
            }
        })
        .with_vertices(|body| snapshot.surface(body).vertices().len())
    }

    /// Material points of samples: those of the leaves, which belong to the cell of their leaf's number, and the diffuse ones,
    /// which belong to [`NO_CELL`].
    pub fn of_samples(snapshot: &Snapshot, samples: &Samples, materials: &[Material], array: Array) -> Self {
        let weigh = Weigh {
            array: &array,
            sampling: Sampling::Footprint,
        };
        let mut points = gather(samples.leaves.len(), |index, points| {
            let leaf = &samples.leaves[index];
            let Found {
                body,
                triangle,
                distance,
                normal,
                ..
            } = leaf.found;
            let patch = Patch {
                index,
                body,
                cell: leaf.cell,
                distance,
                normal,
            };
            let ground = Ground::of_mesh(snapshot, body, triangle, 0);
            weigh.leaf(&patch, leaf, &ground, &materials[body as usize], points);
        });
        for (body, speckle) in samples.speckles.iter().enumerate() {
            let Some(speckle) = speckle else { continue };
            points.append(gather(speckle.normal.len(), |point, points| {
                if speckle.normal[point] != DVec3::ZERO {
                    weigh.diffuse_point(snapshot, body as u32, speckle, point, &materials[body], points);
                }
            }));
        }
        points
            .with_array(array)
            .with_vertices(|body| snapshot.surface(body).vertices().len())
    }

    /// Material points of all surface elements that send anything back; `seed` for the diffuse phases.
    pub fn from_surfels(surfels: &Surfels, array: Array, sampling: Sampling, seed: u64) -> Result<Self> {
        surfels.check()?;
        let num_pixels = surfels.plane.num_pixels();
        Ok(Self::gather(num_pixels, array, sampling, |weigh, pixel, points| {
            if let Some(patch) = surfels.patch(pixel) {
                let material = Material::Constant(Response {
                    reflection: surfels.reflection[pixel],
                    albedo: surfels.albedo[pixel],
                });
                let ground = Ground {
                    pose: &Pose::IDENTITY,
                    carrier: None,
                    speckle: mix(seed ^ u64::from(patch.body)),
                };
                weigh.patch(&patch, &ground, &material, points);
            }
        }))
    }

    /// The material points of all cells of an image.
    fn gather(
        num_cells: usize,
        array: Array,
        sampling: Sampling,
        add: impl Fn(&Weigh, usize, &mut Points) + Sync,
    ) -> Self {
        let weigh = Weigh {
            array: &array,
            sampling,
        };
        let mut points = gather(num_cells, |cell, points| add(&weigh, cell, points));
        if sampling == Sampling::Footprint {
            points.share_speckle(array.num_channels());
        }
        points.with_array(array)
    }
}

/// The material points of a number of things, block by block in parallel.
fn gather(number: usize, add: impl Fn(usize, &mut Points) + Sync) -> Points {
    const BLOCK: usize = 1024;
    let blocks: Vec<Points> = (0..number.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut points = Points::default();
            for thing in block * BLOCK..number.min((block + 1) * BLOCK) {
                add(thing, &mut points);
            }
            points
        })
        .collect();
    let mut points = Points::default();
    for block in blocks {
        points.append(block);
    }
    points
}

/// Memory of a material point, without its weights [bytes].
const POINT_SIZE: usize = size_of::<(u32, u32, u8, Option<[u32; 3]>, [DVec3; 2], Edges, f64, u64)>();

/// Material points as they are found; see [`Scatterers`].
#[derive(Default)]
struct Points {
    cell: Vec<u32>,
    body: Vec<u32>,
    order: Vec<u8>,
    facet: Vec<Option<[u32; 3]>>,
    position: Vec<DVec3>,
    normal: Vec<DVec3>,
    patch: Vec<Edges>,
    /// `(point, channel)`.
    weights: Vec<Weight>,
    /// Area of the patch [m^2].
    area: Vec<f64>,
    /// Number of the cube whose diffuse phase it has.
    cube: Vec<u64>,
}

/// Where on a patch a material point is, and what it stands for.
#[derive(Clone, Copy)]
struct Spot {
    /// On its ground.
    position: DVec3,
    edges: Edges,
    order: u8,
    /// Area [m^2], and number of the cube, whose diffuse phase it has.
    area: f64,
    cube: u64,
}

impl Points {
    /// One more, unless it sends nothing back; its weights are there already.
    fn push(&mut self, patch: &Patch, ground: &Ground, spot: Spot, num_channels: usize) {
        let first = self.weights.len() - num_channels;
        if self.weights[first..].iter().all(Weight::is_silent) {
            self.weights.truncate(first);
            return;
        }
        self.cell.push(patch.index as u32);
        self.body.push(patch.body);
        self.order.push(spot.order);
        self.facet.push(ground.carrier.as_ref().map(|carrier| carrier.vertices));
        self.position.push(spot.position);
        self.normal.push(ground.normal(patch.normal));
        self.patch.push(spot.edges);
        self.area.push(spot.area);
        self.cube.push(spot.cube);
    }

    fn with_array(self, array: Array) -> Scatterers {
        Scatterers {
            cell: self.cell,
            body: self.body,
            order: self.order,
            facet: self.facet,
            position: self.position,
            normal: self.normal,
            patch: self.patch,
            deforming: Vec::new(),
            weights: self.weights,
            array,
        }
    }

    fn append(&mut self, mut other: Self) {
        self.cell.append(&mut other.cell);
        self.body.append(&mut other.body);
        self.order.append(&mut other.order);
        self.facet.append(&mut other.facet);
        self.position.append(&mut other.position);
        self.normal.append(&mut other.normal);
        self.patch.append(&mut other.patch);
        self.weights.append(&mut other.weights);
        self.area.append(&mut other.area);
        self.cube.append(&mut other.cube);
    }

    /// Patches with one phase add up like fields, not like powers: weigh them so that the power of a cube is that of its
    /// area, however many cells it was sampled with.
    fn share_speckle(&mut self, num_channels: usize) {
        let is_diffuse = |weights: &[Weight]| weights.iter().any(|w| w.diffuse != Complex64::ZERO);
        let mut areas: HashMap<u64, f64> = HashMap::new();
        for (point, weights) in self.weights.chunks(num_channels.max(1)).enumerate() {
            if is_diffuse(weights) {
                *areas.entry(self.cube[point]).or_default() += self.area[point];
            }
        }
        for (point, weights) in self.weights.chunks_mut(num_channels.max(1)).enumerate() {
            if is_diffuse(weights) {
                let share = (self.area[point] / areas[&self.cube[point]]).sqrt();
                for weight in weights {
                    weight.diffuse *= share;
                }
            }
        }
    }
}

/// What material points stay with.
struct Ground<'a> {
    pose: &'a Pose,
    /// Where the body deforms.
    carrier: Option<Carrier>,
    /// Number that diffuse phases begin with.
    speckle: u64,
}

impl<'a> Ground<'a> {
    /// A triangle of a body.
    fn of_mesh(snapshot: &'a Snapshot, body: u32, triangle: u32, seed: u64) -> Self {
        let surface = snapshot.surface(body);
        let carrier = surface.is_deformed().then(|| Carrier {
            vertices: surface.vertices_of(triangle),
            facet: Facet::new(surface.corners(triangle)),
            rest: Facet::new(surface.rest_corners(triangle)),
        });
        Self {
            pose: snapshot.pose(body),
            carrier,
            speckle: mix(seed ^ surface.fingerprint()),
        }
    }

    /// A point of the sensor frame, on the body or on its facet where the body deforms.
    fn position(&self, point: DVec3) -> DVec3 {
        let position = self.pose.point_to_body(point);
        self.carrier
            .as_ref()
            .map_or(position, |c| c.facet.coordinates(position))
    }

    /// A unit normal of the sensor frame likewise.
    fn normal(&self, normal: DVec3) -> DVec3 {
        let normal = self.pose.direction_to_body(normal);
        self.carrier.as_ref().map_or(normal, |c| c.facet.slopes(normal))
    }

    /// Edges of a patch likewise.
    fn edges(&self, edges: [DVec3; 2]) -> Edges {
        edges.map(|edge| {
            let edge = self.pose.direction_to_body(edge);
            self.carrier
                .as_ref()
                .map_or(edge, |c| c.facet.coordinates_of_vector(edge))
        })
    }

    /// Number of the cube of the surface, as it was before it was deformed, at a position on it.
    fn cube(&self, position: DVec3) -> u64 {
        let on_surface = self.carrier.as_ref().map_or(position, |c| c.rest.point(position));
        speckle_cube(self.speckle, on_surface / SPECKLE_CELL + SPECKLE_ORIGIN)
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

    /// The material point of a patch: what its material sends back by every channel, mirror-like and diffuse.
    fn patch(&self, patch: &Patch, ground: &Ground, material: &Material, points: &mut Points) {
        let Some(area) = patch.area() else { return };
        let point = patch.point();
        let position = ground.position(point);
        let cube = ground.cube(position);
        let phase = match self.sampling {
            Sampling::Point => 0.0,
            Sampling::Footprint => TAU * speckle_turns(cube),
        };
        let phasor = Complex64::cis(phase);
        let [along_u, along_v] = patch.cell.edges(patch.distance, patch.normal);
        for channel in 0..self.array.num_channels() {
            let [t, r] = self.array.directions(channel, point);
            let response = self.response(material, patch.normal, t, r);
            let mut mirror = mirror(&response, area);
            if self.sampling == Sampling::Footprint && mirror != Complex64::ZERO {
                let bisector = bisector(self.array.frequency, t, r);
                mirror *= taper(bisector.dot(along_u)) * taper(bisector.dot(along_v));
            }
            let diffuse = phasor * self.diffuse(&response, area);
            points.weights.push(Weight { mirror, diffuse });
        }
        let spot = Spot {
            position,
            edges: Edges::default(),
            order: 0,
            area,
            cube,
        };
        points.push(patch, ground, spot, self.array.num_channels());
    }

    /// The material points of a leaf: its ends for what is mirror-like where the phase turns fast, else its centre.
    fn leaf(&self, patch: &Patch, leaf: &Leaf, ground: &Ground, material: &Material, points: &mut Points) {
        let Some(area) = patch.area() else { return };
        let num_channels = self.array.num_channels();
        let point = patch.point();
        let edges = patch.cell.edges(patch.distance, patch.normal);
        let of_channel = |channel: usize| {
            let [t, r] = self.array.directions(channel, point);
            let bisector = bisector(self.array.frequency, t, r);
            (
                self.response(material, patch.normal, t, r),
                edges.map(|edge| bisector.dot(edge)),
            )
        };

        // What is mirror-like, by centre, ends or corners.
        let axes: Vec<usize> = (0..2).filter(|axis| leaf.has_ends[*axis]).collect();
        for number in (0..1_u8 << axes.len()).filter(|number| leaf.kept >> number & 1 == 1) {
            let side = |axis: usize| axes.iter().position(|a| *a == axis).map(|place| number >> place & 1);
            let sides = [0, 1].map(|axis| side(axis).map_or(0.0, |side| f64::from(side) - 0.5));
            let there = patch.about(sides).unwrap_or(*patch);
            let area = there.area().unwrap_or(area);
            let edges_there = there.cell.edges(there.distance, there.normal);
            // Only at glancing angles the end is not in the plane.
            let is_there = there.cell != patch.cell || sides == [0.0; 2];
            let end = if is_there {
                there.point()
            } else {
                point + sides[0] * edges[0] + sides[1] * edges[1]
            };
            for channel in 0..num_channels {
                let (response, slopes) = of_channel(channel);
                let mut mirror = mirror(&response, area);
                let [t, r] = self.array.directions(channel, end);
                let bisector = bisector(self.array.frequency, t, r);
                if !leaf.is_linear {
                    mirror *= taper(slopes[0]) * taper(slopes[1]);
                }
                for axis in axes.iter().copied() {
                    // (j/2x) exp(-j(phi+x)) at the upper end, less (j/2x) exp(-j(phi-x)) at the lower.
                    let (x, x_there) = (slopes[axis], bisector.dot(edges_there[axis]));
                    let x = if x_there / x > LEAST_TURN { x_there } else { x };
                    mirror *= Complex64::new(0.0, sides[axis] / x);
                }
                let diffuse = Complex64::ZERO;
                points.weights.push(Weight { mirror, diffuse });
            }
            let is_across = |axis: usize| leaf.is_linear && !leaf.has_ends[axis];
            let across = [0, 1].map(|axis| {
                if is_across(axis) {
                    edges_there[axis]
                } else {
                    DVec3::ZERO
                }
            });
            let spot = Spot {
                position: ground.position(end),
                edges: ground.edges(across),
                order: axes.len() as u8,
                area: 0.0,
                cube: 0,
            };
            points.push(patch, ground, spot, num_channels);
        }
    }

    /// A diffuse point of a surface.
    fn diffuse_point(
        &self,
        snapshot: &Snapshot,
        body: u32,
        speckle: &Speckle,
        point: usize,
        material: &Material,
        points: &mut Points,
    ) {
        let Speckle {
            points: spread, normal, ..
        } = speckle;
        let ground = Ground::of_mesh(snapshot, body, spread.triangle[point], 0);
        let (surface, triangle) = (snapshot.surface(body), spread.triangle[point]);
        let position = spread.position(surface, point);
        let place = ground.pose.point(position);
        // A surface that stretches has the same points with more area each.
        let stretch = area(&surface.corners(triangle)) / area(&surface.rest_corners(triangle));
        let phasor = Complex64::cis(TAU * spread.turns[point]);
        for channel in 0..self.array.num_channels() {
            let [t, r] = self.array.directions(channel, place);
            let response = self.response(material, normal[point], t, r);
            points.weights.push(Weight {
                mirror: Complex64::ZERO,
                diffuse: phasor * self.diffuse(&response, stretch * spread.area),
            });
        }
        let patch = Patch {
            index: NO_CELL as usize,
            body,
            normal: normal[point],
            ..Patch::NOTHING
        };
        let spot = Spot {
            position: ground.position(place),
            edges: Edges::default(),
            order: 0,
            area: 0.0,
            cube: 0,
        };
        points.push(&patch, &ground, spot, self.array.num_channels());
    }

    /// `(lambda / 4 pi) sqrt(rho dA / pi)`.
    fn diffuse(&self, response: &Response, area: f64) -> f64 {
        SPEED_OF_LIGHT / self.array.frequency / (4.0 * PI) * (response.albedo * area / PI).sqrt()
    }
}

/// `(j / 4 pi) Gamma dA / 2`.
fn mirror(response: &Response, area: f64) -> Complex64 {
    Complex64::new(0.0, 1.0 / (8.0 * PI)) * response.reflection * area
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

/// Mean of exp(-2jx s) over s in [-1/2, 1/2], tapered to zero at x = pi so that aliases of steep patches vanish.
pub(crate) fn taper(x: f64) -> f64 {
    let x = x.abs();
    if x >= PI {
        0.0
    } else if x <= FRAC_PI_2 {
        sinc(x)
    } else {
        sinc(x) * (x - FRAC_PI_2).cos()
    }
}

/// A random number that belongs to a cube of the surface: the same in every chirp, frame and cell.
fn speckle_cube(speckle: u64, cube: DVec3) -> u64 {
    let cube = cube.floor().to_array().map(|x| x as i64 as u64);
    cube.into_iter().fold(speckle, |state, word| mix(state ^ word))
}

/// The phase of a cube in turns: uniform in [0, 1).
fn speckle_turns(cube: u64) -> f64 {
    (cube >> 11) as f64 / (1_u64 << 53) as f64
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
            .map(|i| speckle_turns(speckle_cube(3, DVec3::new(f64::from(i) + 0.5, -2.5, 0.5))))
            .collect();
        let mean = |values: &mut dyn Iterator<Item = Complex64>| values.sum::<Complex64>().norm() / 20_000.0;
        // Sums of n random phasors have rms sqrt(n): four sigma of 1 / sqrt(20000).
        let phasors: Vec<Complex64> = turns.iter().map(|t| Complex64::cis(TAU * t)).collect();
        assert!(mean(&mut phasors.iter().copied()) < 0.03);
        assert!(mean(&mut phasors.windows(2).map(|p| p[0] * p[1].conj())) < 0.03);
    }
}
