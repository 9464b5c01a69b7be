//! Material points and point targets that return power, and their paths one by one.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::array::{Array, Sight, specular_point};
use crate::constants::SPEED_OF_LIGHT;
use crate::numeric::trig::sinc;
use crate::paths::kinematics::Kinematics;

/// Kind of a material point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PointKind {
    /// Part of a surface, or of one edge or corner of a flat region, docs/theory.md eqs. (10) and (11).
    #[default]
    Area,
    Edge,
    Corner,
    /// Mirror image of the antennas in a flat region: the point lies on its plane, and the path reflects from the plane.
    Mirror,
}

impl PointKind {
    /// Exponent n of a field that falls with frequency^-n.
    pub fn frequency_exponent(self) -> u8 {
        match self {
            Self::Area => 0,
            Self::Edge | Self::Mirror => 1,
            Self::Corner => 2,
        }
    }
}

/// Material points and the weights of their amplitudes, in arrays.
pub struct Scatterers {
    pub(crate) array: Array,
    pub(crate) body: Vec<u32>,
    /// Kinds of the points; empty: all are areas.
    pub(crate) kind: Vec<PointKind>,
    /// Vertices of the triangle that carries the point, where the body deforms; empty: no body does.
    pub(crate) corners: Vec<Option<[u32; 3]>>,
    /// Position in coordinates of the body [m], or of the triangle.
    pub(crate) position: Vec<DVec3>,
    /// Unit normal towards the incident side, in body coordinates, or its slopes along the triangle.
    pub(crate) normal: Vec<DVec3>,
    /// Edges of the patch that a point stands for, along u and v, in coordinates of the body [m], or of the triangle.
    /// The phase varies linearly over the patch in any orientation; zero edges stand for a point. Empty: points.
    pub(crate) patch: Vec<[DVec3; 2]>,
    /// Weights `(scatterer, channel)`, or `(scatterer,)` where all channels share them: amplitudes without gains
    /// and distances over the sum of both cosines of incidence. Specular parts are `(j / 4 pi) Gamma dA / 2` times the
    /// factors of cells, edges and corners; mirrors have `Gamma / 2 k`, over the sum of both distances; for
    /// diffuse ones see [`crate::scattering::material::SurfaceResponse::diffuse`].
    pub(crate) weights: Vec<Complex64>,
    /// Range rate beside the motion of the body [m/s]; empty: zero.
    pub(crate) range_rate: Vec<f64>,
    /// Radar cross-sections of the point targets [m^2], whose paths follow the paths of the material points.
    pub(crate) rcs: Vec<f64>,
}

impl Scatterers {
    /// Number of material points.
    pub fn len(&self) -> usize {
        self.body.len()
    }

    /// Number of paths of a channel: of material points, then of point targets.
    pub fn num_paths(&self) -> usize {
        self.len() + self.rcs.len()
    }

    /// Kind of a material point.
    pub fn kind(&self, number: usize) -> PointKind {
        self.kind.get(number).copied().unwrap_or_default()
    }

    /// Weight of a material point for a channel.
    #[inline]
    pub(crate) fn weight(&self, number: usize, channel: usize) -> Complex64 {
        let num_weights = self.num_weights();
        self.weights[number * num_weights + channel.min(num_weights - 1)]
    }

    pub(super) fn num_weights(&self) -> usize {
        self.weights.len() / self.len().max(1)
    }

    /// Delay and amplitude of one path of one channel at one time; point targets follow the material points.
    pub fn path(&self, kinematics: &Kinematics, time: usize, channel: usize, path: usize) -> (f64, Complex64) {
        let (t, r, amplitude);
        if let Some(&body) = self.body.get(path) {
            let pose = &kinematics.poses.row(time)[body as usize];
            let (mut position, mut normal) = (self.position[path], self.normal[path]);
            let mut edges = self.patch.get(path).copied().unwrap_or_default();
            if let Some(triangle) = kinematics.moving_triangle(time, body, self.corners_of(path)) {
                (position, normal) = (triangle.point(position), triangle.normal(normal));
                edges = edges.map(|edge| triangle.vector(edge));
            }
            let (mut position, normal) = (pose.point(position), pose.direction(normal));
            if self.kind(path) == PointKind::Mirror {
                position = specular_point(self.array.antennas(channel), position, normal);
                (t, r) = self.array.pair(channel, position);
                let distances = t.distance * r.distance / (t.distance + r.distance);
                amplitude = self.weight(path, channel) * distances * self.spreading(&t, &r);
            } else {
                (t, r) = self.array.pair(channel, position);
                let surface = (normal, edges.map(|edge| pose.direction(edge)));
                amplitude = self.surface_amplitude(path, channel, surface, &t, &r);
            }
        } else {
            let point = path - self.len();
            (t, r) = self.array.pair(channel, kinematics.points.row(time)[point]);
            amplitude = self.point_amplitude(self.rcs[point], &t, &r);
        }
        let length = t.distance + r.distance;
        (length / SPEED_OF_LIGHT, self.array.received(channel, amplitude, length))
    }

    /// Triangle that carries a scatterer; none on bodies that do not deform.
    fn corners_of(&self, path: usize) -> Option<[u32; 3]> {
        self.corners.get(path).copied().flatten()
    }

    /// Rate of the delay of one path [s/s] at the first time; `rates` are the time derivatives. Distances do not depend
    /// on the frame of reference, so the rate is exact for a moving sensor too.
    pub fn delay_rate(&self, kinematics: &Kinematics, rates: &Kinematics, channel: usize, path: usize) -> f64 {
        let (position, velocity) = if let Some(&body) = self.body.get(path) {
            let mut position = self.position[path];
            if self.kind(path) == PointKind::Mirror {
                let pose = &kinematics.poses.row(0)[body as usize];
                let (on_plane, normal) = (pose.point(position), pose.direction(self.normal[path]));
                position = pose.point_to_body(specular_point(self.array.antennas(channel), on_plane, normal));
            }
            kinematics.motion(rates, body, self.corners_of(path), position)
        } else {
            let point = path - self.len();
            (kinematics.points.row(0)[point], rates.points.row(0)[point])
        };
        let (t, r) = self.array.pair(channel, position);
        velocity.dot(t.direction + r.direction) / SPEED_OF_LIGHT
    }

    /// Amplitude of a material point, docs/theory.md eqs. (2) and (3).
    fn surface_amplitude(
        &self,
        path: usize,
        channel: usize,
        (normal, edges): (DVec3, [DVec3; 2]),
        t: &Sight,
        r: &Sight,
    ) -> Complex64 {
        let (cos_t, cos_r) = ((-normal.dot(t.direction)).max(0.0), (-normal.dot(r.direction)).max(0.0));
        let mut amplitude = self.weight(path, channel) * (cos_t + cos_r);
        if edges != [DVec3::ZERO; 2] {
            let bisector = bisector(self.array.frequency, t.direction, r.direction);
            amplitude *= sinc(bisector.dot(edges[0])) * sinc(bisector.dot(edges[1]));
        }
        amplitude * self.spreading(t, r)
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

/// Half the sum of the wave vectors to the transmitter and to the receiver [rad/m].
pub fn bisector(frequency: f64, t: DVec3, r: DVec3) -> DVec3 {
    0.5 * (TAU * frequency / SPEED_OF_LIGHT) * (t + r)
}
