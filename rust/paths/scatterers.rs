//! Material points and point targets that return power, and their paths one by one.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antennas::array::{Array, Sight};
use crate::constants::SPEED_OF_LIGHT;
use crate::numeric::trig::sinc;
use crate::paths::kinematics::Kinematics;

/// Material points and the weights of their amplitudes, in arrays.
pub struct Scatterers {
    pub(crate) array: Array,
    /// Number of the pixel that the point was sampled by, row by row. Empty: no point has one.
    pub(crate) cell: Vec<u32>,
    pub(crate) body: Vec<u32>,
    /// Power of the frequency by which the field falls; empty: zero.
    pub(crate) frequency_exponent: Vec<u8>,
    /// Vertices of the triangle that carries the point, where the body deforms; empty: no body does.
    pub(crate) corners: Vec<Option<[u32; 3]>>,
    /// Position in coordinates of the body [m], or of the triangle.
    pub(crate) position: Vec<DVec3>,
    /// Unit normal towards the incident side, in body coordinates, or its slopes along the triangle.
    pub(crate) normal: Vec<DVec3>,
    /// Edges of the patch that the specular part is a mean over; empty: points.
    pub(crate) patch: Vec<Edges>,
    /// Weights `(scatterer, channel)`, or `(scatterer,)` where they are those of all channels.
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

/// Some neighbouring material points, followed by point targets.
#[derive(Clone, Debug)]
pub struct PathRange {
    /// Numbers of the material points.
    pub surfaces: Range<usize>,
    /// Number of point targets.
    pub num_points: usize,
}

impl PathRange {
    /// Number of paths.
    pub fn len(&self) -> usize {
        self.surfaces.len() + self.num_points
    }

    /// Number of a path among those of [`Scatterers::path`].
    #[inline]
    pub fn number(&self, scatterers: &Scatterers, path: usize) -> usize {
        match path.checked_sub(self.surfaces.len()) {
            Some(point) => scatterers.len() + point,
            None => self.surfaces.start + path,
        }
    }
}

impl Weight {
    /// Weight of nothing.
    pub(crate) const NONE: Self = Self {
        specular: Complex64::ZERO,
        diffuse: Complex64::ZERO,
    };

    pub(crate) fn is_silent(&self) -> bool {
        self.specular == Complex64::ZERO && self.diffuse == Complex64::ZERO
    }
}

impl Scatterers {
    /// Append the material points of others; those of no cell have the number `u32::MAX` of one.
    pub(crate) fn append(&mut self, mut others: Self) {
        if self.is_empty() {
            *self = others;
            return;
        }
        for of in [&mut *self, &mut others] {
            let number = of.len();
            let num_weights = of.num_weights();
            if num_weights == 1 {
                let each = of.weights.iter();
                of.weights = each
                    .flat_map(|weight| std::iter::repeat_n(*weight, of.array.num_channels()))
                    .collect();
            }
            of.cell.resize(number, u32::MAX);
            of.frequency_exponent.resize(number, 0);
            of.corners.resize(number, None);
            of.patch.resize(number, Edges::default());
        }
        self.body.append(&mut others.body);
        self.position.append(&mut others.position);
        self.normal.append(&mut others.normal);
        self.weights.append(&mut others.weights);
        self.cell.append(&mut others.cell);
        self.frequency_exponent.append(&mut others.frequency_exponent);
        self.corners.append(&mut others.corners);
        self.patch.append(&mut others.patch);
    }

    /// Order the material points by a key of body and power of the frequency, and bodies within it.
    pub fn sort_by(&mut self, key: impl Fn(u32, u8) -> u8) {
        let number = self.num_weights();
        let keys: Vec<(u8, u32)> = (0..self.len())
            .map(|i| (key(self.body[i], self.frequency_exponent(i)), self.body[i]))
            .collect();
        if keys.is_sorted() {
            return;
        }
        // Points of one body are evaluated together.
        let mut rows: Vec<usize> = (0..self.len()).collect();
        rows.sort_by_key(|row| keys[*row]);
        permute(&mut self.cell, &rows);
        permute(&mut self.body, &rows);
        permute(&mut self.frequency_exponent, &rows);
        permute(&mut self.corners, &rows);
        permute(&mut self.position, &rows);
        permute(&mut self.normal, &rows);
        permute(&mut self.patch, &rows);
        let weights = rows.iter().flat_map(|row| &self.weights[number * row..][..number]);
        self.weights = weights.copied().collect();
    }

    /// PathRange from `first` on for which a condition on body and power of the frequency holds, where the material
    /// points are [in an order](Self::sort_by) by which they are neighbours.
    pub fn range(&self, first: usize, num_points: usize, belongs: impl Fn(u32, u8) -> bool) -> PathRange {
        let rest = first..self.len();
        let number = rest
            .take_while(|i| belongs(self.body[*i], self.frequency_exponent(*i)))
            .count();
        PathRange {
            surfaces: first..first + number,
            num_points,
        }
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

    /// Power of the frequency by which the field of a material point falls.
    pub fn frequency_exponent(&self, number: usize) -> u8 {
        self.frequency_exponent.get(number).copied().unwrap_or(0)
    }

    /// Cell of every material point, see [`Scatterers`]; empty if no point has one.
    pub fn cells(&self) -> &[u32] {
        &self.cell
    }

    /// Weight of a material point for a channel.
    #[inline]
    pub(crate) fn weight(&self, number: usize, channel: usize) -> &Weight {
        let num_weights = self.num_weights();
        &self.weights[number * num_weights + channel.min(num_weights - 1)]
    }

    fn num_weights(&self) -> usize {
        self.weights.len() / self.len().max(1)
    }

    /// Number of TX-RX pairs.
    pub fn num_channels(&self) -> usize {
        self.array.num_channels()
    }

    /// Delay and amplitude of one path of one channel at one time; point targets follow the material points.
    pub fn path(&self, kinematics: &Kinematics, node: usize, channel: usize, path: usize) -> (f64, Complex64) {
        let Some(&body) = self.body.get(path) else {
            let point = path - self.len();
            let (t, r) = self
                .array
                .pair(channel, kinematics.points[node * kinematics.rcs.len() + point]);
            let amplitude = self.point_amplitude(kinematics.rcs[point], &t, &r);
            return (delay(&t, &r), self.array.received(channel, amplitude, length(&t, &r)));
        };
        let pose = &kinematics.poses[node * kinematics.num_bodies + body as usize];
        let (mut position, mut normal) = (self.position[path], self.normal[path]);
        let mut edges = self.patch.get(path).copied().unwrap_or_default();
        if let Some(triangle) = kinematics.moving_triangle(node, body, self.corners_of(path)) {
            (position, normal) = (triangle.point(position), triangle.normal(normal));
            edges = edges.map(|edge| triangle.vector(edge));
        }
        let (t, r) = self.array.pair(channel, pose.point(position));
        let (normal, edges) = (pose.direction(normal), edges.map(|edge| pose.direction(edge)));
        let amplitude = self.surface_amplitude(path, channel, (normal, edges), &t, &r);
        (delay(&t, &r), self.array.received(channel, amplitude, length(&t, &r)))
    }

    /// Triangle that carries a scatterer; none on bodies that do not deform.
    fn corners_of(&self, path: usize) -> Option<[u32; 3]> {
        self.corners.get(path).copied().flatten()
    }

    /// Rate of every delay of a range [s/s], `(channel, path)`, at the first node of `kinematics`; `rates` are the
    /// time derivatives. Distances do not depend on the frame of reference, so the rates are exact for a moving sensor
    /// too.
    pub fn delay_rates(&self, kinematics: &Kinematics, rates: &Kinematics, range: &PathRange) -> Vec<f64> {
        let num_paths = range.len();
        (0..self.num_channels() * num_paths)
            .into_par_iter()
            .map(|i| {
                let (channel, path) = (i / num_paths, range.number(self, i % num_paths));
                let (position, velocity) = match self.body.get(path) {
                    Some(&body) => kinematics.motion(rates, body, self.corners_of(path), self.position[path]),
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
        let weight = self.weight(path, channel);
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

/// Bring elements into an order, unless there are none.
fn permute<T: Copy>(elements: &mut Vec<T>, rows: &[usize]) {
    if !elements.is_empty() {
        *elements = rows.iter().map(|row| elements[*row]).collect();
    }
}

/// Length of a path, there and back [m].
fn length(t: &Sight, r: &Sight) -> f64 {
    t.distance + r.distance
}

fn delay(t: &Sight, r: &Sight) -> f64 {
    length(t, r) / SPEED_OF_LIGHT
}

/// Half the sum of the wave vectors to the transmitter and to the receiver [rad/m].
pub fn bisector(frequency: f64, t: DVec3, r: DVec3) -> DVec3 {
    0.5 * (TAU * frequency / SPEED_OF_LIGHT) * (t + r)
}
