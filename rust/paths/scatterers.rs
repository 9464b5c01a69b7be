//! Material points and point targets that return power, and their paths one by one.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antennas::array::{Array, Sight};
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::moving_triangle::MovingTriangle;
use crate::numeric::trig::sinc;
use crate::paths::kinematics::Kinematics;

/// Material points and the weights of their amplitudes, in arrays.
pub struct Scatterers {
    pub(crate) array: Array,
    /// Number of the cell that the point was sampled by: of the pixel, row by row, or in the order of the leaves of a
    /// quadtree.
    pub(crate) cell: Vec<u32>,
    pub(crate) body: Vec<u32>,
    /// Power of the frequency by which the field falls.
    pub(crate) order: Vec<u8>,
    /// Vertices of the triangle that carries the point, where the body deforms.
    pub(crate) facet: Vec<Option<[u32; 3]>>,
    /// Position in coordinates of the body [m], or of the triangle.
    pub(crate) position: Vec<DVec3>,
    /// Unit normal towards the incident side, in body coordinates, or its slopes along the triangle.
    pub(crate) normal: Vec<DVec3>,
    /// Edges of the patch that the specular part is a mean over.
    pub(crate) patch: Vec<Edges>,
    /// Bodies that deform and their numbers of vertices.
    pub(crate) deforming: Vec<(u32, usize)>,
    /// Weights `(scatterer, channel)`.
    pub(crate) weights: Vec<Weight>,
}

/// Weight of a material point for one channel: its amplitude without cosines, gains and distances.
#[derive(Clone, Copy)]
pub struct Weight {
    /// Specular part `(j / 4 pi) Gamma dA / 2`, times the factors of pixels and of edge terms.
    pub(crate) specular: Complex64,
    /// Diffuse part `(lambda / 4 pi) sqrt(rho dA / pi) exp(j psi)`.
    pub(crate) diffuse: Complex64,
}

/// Edges of the patch that a material point stands for, along u and v, in coordinates of the body [m], or of the
/// triangle. The phase varies linearly over the patch in any orientation; zero edges stand for a point.
pub type Edges = [DVec3; 2];

impl Weight {
    pub(crate) fn is_silent(&self) -> bool {
        self.specular == Complex64::ZERO && self.diffuse == Complex64::ZERO
    }
}

impl Scatterers {
    /// Add the numbers of vertices of the bodies that deform.
    pub fn with_vertices(mut self, number: impl Fn(u32) -> usize) -> Self {
        let on_facets = self.body.iter().zip(&self.facet);
        let mut bodies: Vec<u32> = on_facets.filter_map(|(body, facet)| facet.and(Some(*body))).collect();
        bodies.sort_unstable();
        bodies.dedup();
        self.deforming = bodies.into_iter().map(|body| (body, number(body))).collect();
        self
    }

    /// Select material points by body and by the power of the frequency, ordered by body.
    pub fn select(&self, is_wanted: impl Fn(u32, u8) -> bool) -> Self {
        let channels = self.array.num_channels();
        let rows = 0..self.len();
        let mut rows: Vec<usize> = rows.filter(|i| is_wanted(self.body[*i], self.order[*i])).collect();
        // Points of one body are evaluated together.
        rows.sort_by_key(|i| self.body[*i]);
        let weights = rows
            .iter()
            .flat_map(|i| &self.weights[channels * i..channels * (i + 1)]);
        let chosen = Self {
            array: self.array.clone(),
            cell: rows.iter().map(|i| self.cell[*i]).collect(),
            body: rows.iter().map(|i| self.body[*i]).collect(),
            order: rows.iter().map(|i| self.order[*i]).collect(),
            facet: rows.iter().map(|i| self.facet[*i]).collect(),
            position: rows.iter().map(|i| self.position[*i]).collect(),
            normal: rows.iter().map(|i| self.normal[*i]).collect(),
            patch: rows.iter().map(|i| self.patch[*i]).collect(),
            deforming: Vec::new(),
            weights: weights.copied().collect(),
        };
        let number = |body| self.deforming.iter().find(|d| d.0 == body).map_or(0, |d| d.1);
        chosen.with_vertices(number)
    }

    /// Number of material points.
    pub fn len(&self) -> usize {
        self.body.len()
    }

    /// True when there are no material points.
    pub fn is_empty(&self) -> bool {
        self.body.is_empty()
    }

    /// Body of every material point, in image order.
    pub fn bodies(&self) -> &[u32] {
        &self.body
    }

    /// Power of the frequency by which the field of every material point falls.
    pub fn orders(&self) -> &[u8] {
        &self.order
    }

    /// Cell of every material point; see [`Scatterers`].
    pub fn cells(&self) -> &[u32] {
        &self.cell
    }

    /// Bodies that deform and have material points here, in increasing order, and their numbers of vertices.
    pub fn deforming(&self) -> &[(u32, usize)] {
        &self.deforming
    }

    /// Number of TX-RX pairs.
    pub fn num_channels(&self) -> usize {
        self.array.num_channels()
    }

    /// Delay and amplitude of one path of one channel at one time.
    pub fn path(&self, kinematics: &Kinematics, node: usize, channel: usize, path: usize) -> (f64, Complex64) {
        let Some(&body) = self.body.get(path) else {
            let point = path - self.len();
            let (t, r) = self
                .array
                .pair(channel, kinematics.points[node * kinematics.rcs.len() + point]);
            return (delay(&t, &r), self.point_amplitude(kinematics.rcs[point], &t, &r));
        };
        let pose = &kinematics.poses[node * kinematics.num_bodies + body as usize];
        let (mut position, mut normal) = (self.position[path], self.normal[path]);
        let mut edges = self.patch[path];
        if let Some(facet) = self.facet_of(kinematics, node, path) {
            (position, normal) = (facet.point(position), facet.normal(normal));
            edges = edges.map(|edge| facet.vector(edge));
        }
        let (t, r) = self.array.pair(channel, pose.point(position));
        let (normal, edges) = (pose.direction(normal), edges.map(|edge| pose.direction(edge)));
        (
            delay(&t, &r),
            self.surface_amplitude(path, channel, (normal, edges), &t, &r),
        )
    }

    /// Triangle that carries a material point of a body that deforms; the corners may be velocities.
    fn facet_of(&self, kinematics: &Kinematics, node: usize, path: usize) -> Option<MovingTriangle> {
        let corners = self.facet[path]?;
        let body = self.body[path];
        let index = self.deforming.iter().position(|deforming| deforming.0 == body)?;
        let vertices = &kinematics.vertices[index][node * self.deforming[index].1..];
        Some(MovingTriangle::new(
            corners.map(|vertex| DVec3::from_array(vertices[vertex as usize])),
        ))
    }

    /// Rate of every delay [s/s], `(channel, path)`, at the first node of `kinematics`; `rates` are the time
    /// derivatives. Distances do not depend on the frame of reference, so the rates are exact for a moving sensor too.
    pub fn delay_rates(&self, kinematics: &Kinematics, rates: &Kinematics) -> Vec<f64> {
        let num_paths = self.len() + kinematics.points.len();
        (0..self.num_channels() * num_paths)
            .into_par_iter()
            .map(|i| {
                let (channel, path) = (i / num_paths, i % num_paths);
                let (position, velocity) = match self.body.get(path) {
                    Some(&body) => {
                        let (pose, rate) = (&kinematics.poses[body as usize], &rates.poses[body as usize]);
                        let (mut position, mut velocity) = (self.position[path], DVec3::ZERO);
                        let facets = [kinematics, rates].map(|kinematics| self.facet_of(kinematics, 0, path));
                        if let [Some(facet), Some(facet_rate)] = facets {
                            velocity = facet.velocity(&facet_rate, position);
                            position = facet.point(position);
                        }
                        (pose.point(position), rate.point(position) + pose.direction(velocity))
                    }
                    None => (kinematics.points[path - self.len()], rates.points[path - self.len()]),
                };
                let (t, r) = self.array.pair(channel, position);
                velocity.dot(t.direction + r.direction) / SPEED_OF_LIGHT
            })
            .collect()
    }

    /// Amplitude of a material point, docs/theory.md eqs. (2) and (3), with the kinematics of the node.
    fn surface_amplitude(
        &self,
        path: usize,
        channel: usize,
        (normal, edges): (DVec3, [DVec3; 2]),
        t: &Sight,
        r: &Sight,
    ) -> Complex64 {
        let (cos_t, cos_r) = ((-normal.dot(t.direction)).max(0.0), (-normal.dot(r.direction)).max(0.0));
        let weight = &self.weights[path * self.num_channels() + channel];
        let mut specular = weight.specular * (cos_t + cos_r);
        if edges != [DVec3::ZERO; 2] {
            let bisector = bisector(self.array.frequency, t.direction, r.direction);
            specular *= sinc(bisector.dot(edges[0])) * sinc(bisector.dot(edges[1]));
        }
        let diffuse = weight.diffuse * (cos_t * cos_r).sqrt();
        (specular + diffuse) * self.spreading(t, r)
    }

    /// Amplitude of a point target by the radar equation: sqrt(P Gt Gr) (lambda / 4 pi) sqrt(sigma / 4 pi) / (Rt Rr).
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

/// Half the sum of the wave vectors to the transmitter and to the receiver [rad/m].
pub fn bisector(frequency: f64, t: DVec3, r: DVec3) -> DVec3 {
    0.5 * (TAU * frequency / SPEED_OF_LIGHT) * (t + r)
}
