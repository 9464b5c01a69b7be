//! Motion over a frame: bodies, point targets and vertices in the sensor frame at the Chebyshev times of the frame, and
//! the series through these samples.
//!
//! Times are `x` from -1 at the start of the first ramp to 1 at the last sample.

use std::ops::{Add, Mul, Sub};

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::geometry::moving_triangle::MovingTriangle;
use crate::geometry::pose::Pose;
use crate::numeric::chebyshev::{chebyshev_matrix, interpolation_weights, slope_weights};

/// Relative rounding error of coordinates; more times do not reduce it.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Largest number of vertices of a body that the error of the motion is estimated from.
const NUM_PROBED_VERTICES: usize = 1024;

/// Values of items at the Chebyshev times of a frame, `(time, item)`.
#[derive(Clone, Debug)]
pub struct TimeSeries<T> {
    num_times: usize,
    values: Vec<T>,
}

impl<T: Copy + PartialEq + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>> TimeSeries<T> {
    /// Series from values `(time, item)`.
    pub fn new(num_times: usize, values: Vec<T>) -> Self {
        Self { num_times, values }
    }

    /// Number of items.
    pub fn num_items(&self) -> usize {
        self.values.len() / self.num_times.max(1)
    }

    /// Values of all items at a time.
    pub fn row(&self, time: usize) -> &[T] {
        &self.values[time * self.num_items()..][..self.num_items()]
    }

    /// True for every item that has one value at all times.
    pub fn are_static(&self) -> Vec<bool> {
        let is_static = |item: usize| (1..self.num_times).all(|time| self.row(time)[item] == self.values[item]);
        (0..self.num_items()).map(is_static).collect()
    }

    /// Values of all items at the time `x`; exact at the times of the series and for static items.
    pub fn at(&self, x: f64) -> Vec<T> {
        let weights = interpolation_weights(self.num_times, x);
        if let Some(time) = weights.iter().position(|weight| *weight == 1.0) {
            return self.row(time).to_vec();
        }
        let values = self.row(0).iter().zip(self.weighted(&weights));
        values.map(|(first, change)| *first + change).collect()
    }

    /// The series at other times `x`.
    fn over(&self, times: &[f64]) -> Self {
        Self::new(times.len(), times.iter().flat_map(|x| self.at(*x)).collect())
    }

    /// Derivative at the middle, times a factor, as a series of one time.
    fn rate(&self, factor: f64) -> Self {
        let slopes = self.weighted(&slope_weights(self.num_times));
        Self::new(1, slopes.into_iter().map(|slope| slope * factor).collect())
    }

    /// Sums over the times of the differences from the first, times weights.
    fn weighted(&self, weights: &[f64]) -> Vec<T> {
        let first = self.row(0);
        let mut sums: Vec<T> = first.iter().map(|value| *value * 0.0).collect();
        for (time, weight) in weights.iter().enumerate().skip(1) {
            for ((sum, value), first) in sums.iter_mut().zip(self.row(time)).zip(first) {
                *sum = *sum + (*value - *first) * *weight;
            }
        }
        sums
    }

    /// Bounds of what the first `number` terms leave out of the series of every item, by the size of a value of an
    /// item; zero where that is rounding.
    fn beyond(&self, number: usize, size: impl Fn(usize, &T) -> f64) -> Vec<f64> {
        let mut beyond = vec![0.0; self.num_items()];
        for weights in chebyshev_matrix(self.num_times).chunks(self.num_times).skip(number) {
            for (item, coefficient) in self.weighted(weights).iter().enumerate() {
                beyond[item] += size(item, coefficient);
            }
        }
        for (item, beyond) in beyond.iter_mut().enumerate() {
            if *beyond <= ROUNDING * size(item, &self.values[item]) {
                *beyond = 0.0;
            }
        }
        beyond
    }
}

impl TimeSeries<DVec3> {
    /// The largest of [`Self::beyond`] of positions, of some of them where there are many.
    fn most_beyond(&self, number: usize) -> f64 {
        let step = self.num_items().div_ceil(NUM_PROBED_VERTICES).max(1);
        let some = (0..self.num_times).flat_map(|time| self.row(time).iter().step_by(step).copied());
        let some = Self::new(self.num_times, some.collect());
        let beyond = some.beyond(number, |_, position| position.length());
        beyond.into_iter().fold(0.0, f64::max)
    }
}

/// Motion over a span of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Motion {
    /// Constant pose at all times.
    Static,
    /// Few times describe it.
    Smooth,
    /// Series through few times leave out too much.
    FastVarying,
}

/// Positions in the world at the same times: sensor `(time,)`, bodies `(time, body)`, point targets `(time, point)`
/// [m].
#[derive(Clone, Debug)]
pub struct World {
    /// Pose of the sensor, sensor to world.
    pub sensor: Vec<Pose>,
    /// Poses of the bodies, body to world.
    pub poses: Vec<Pose>,
    /// Positions of the point targets in the world [m].
    pub points: Vec<DVec3>,
    /// Vertices of every body that deforms, in body coordinates [m]; may have fewer times than the poses.
    pub vertices: Vec<TimeSeries<DVec3>>,
}

impl World {
    /// Kinematics in the axes of the sensor, with the origin at `center`, the middle of the array in sensor axes [m];
    /// `deforming`: the bodies that deform.
    pub fn seen(&self, center: DVec3, deforming: &[usize]) -> Kinematics {
        let num_times = self.sensor.len();
        let bodies = self.poses.chunks((self.poses.len() / num_times).max(1));
        let points = self.points.chunks((self.points.len() / num_times).max(1));
        let poses = self.sensor.iter().zip(bodies).flat_map(|(sensor, bodies)| {
            bodies.iter().map(move |body| Pose {
                rotation: sensor.rotation.transpose() * body.rotation,
                translation: sensor.point_to_body(body.translation) - center,
            })
        });
        let points = self
            .sensor
            .iter()
            .zip(points)
            .flat_map(|(sensor, points)| points.iter().map(move |point| sensor.point_to_body(*point) - center));
        Kinematics {
            poses: TimeSeries::new(num_times, poses.collect()),
            points: TimeSeries::new(num_times, points.collect()),
            vertices: deforming.iter().copied().zip(self.vertices.clone()).collect(),
        }
    }

    /// Time derivative of [`Self::seen`] at a single time, from positions `at` and time derivatives `rates` in the
    /// world.
    pub fn seen_rates(at: &Self, rates: &Self, center: DVec3, deforming: &[usize]) -> Kinematics {
        let (sensor, rate) = (&at.sensor[0], &rates.sensor[0]);
        let seen = at.seen(center, deforming);
        let to_sensor = sensor.rotation.transpose();
        // The sensor turns about its own origin, not about the middle of the array.
        let turning: DMat3 = rate.rotation.transpose() * sensor.rotation;
        let pose = |(seen, rate_world): (&Pose, &Pose)| Pose {
            rotation: to_sensor * rate_world.rotation + turning * seen.rotation,
            translation: to_sensor * (rate_world.translation - rate.translation)
                + turning * (seen.translation + center),
        };
        let point = |(seen, velocity): (&DVec3, &DVec3)| {
            to_sensor * (*velocity - rate.translation) + turning * (*seen + center)
        };
        Kinematics {
            poses: TimeSeries::new(1, seen.poses.row(0).iter().zip(&rates.poses).map(pose).collect()),
            points: TimeSeries::new(1, seen.points.row(0).iter().zip(&rates.points).map(point).collect()),
            vertices: deforming.iter().copied().zip(rates.vertices.clone()).collect(),
        }
    }

    /// Check that the arrays fit a scene with some bodies and point targets, and numbers of vertices of the bodies that
    /// deform.
    pub fn check(&self, num_bodies: usize, num_points: usize, num_vertices: &[usize]) -> Result<()> {
        let checks = [
            ("poses", num_bodies, self.poses.len() / self.sensor.len()),
            ("points", num_points, self.points.len() / self.sensor.len()),
            ("vertices", num_vertices.len(), self.vertices.len()),
        ];
        for (name, expected, got) in checks {
            if expected != got {
                return Err(Error::value(name, format!("{expected} of them as the scene has"), got));
            }
        }
        for (vertices, expected) in self.vertices.iter().zip(num_vertices) {
            if vertices.num_items() != *expected {
                let expected = format!("{expected} as the mesh has");
                return Err(Error::value("vertices", expected, vertices.num_items()));
            }
        }
        Ok(())
    }
}

/// Poses of bodies, positions of point targets and vertices in the sensor frame, or the time derivatives of all.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// Maps of body coordinates to the axes of the sensor, `(time, body)`.
    pub poses: TimeSeries<Pose>,
    /// Positions of the point targets, `(time, point)` [m].
    pub points: TimeSeries<DVec3>,
    /// Bodies that deform, with their vertices in body coordinates, `(time, vertex)` [m].
    pub vertices: Vec<(usize, TimeSeries<DVec3>)>,
}

impl Kinematics {
    /// Number of times of the poses and points.
    pub fn num_times(&self) -> usize {
        self.poses.num_times
    }

    /// Kinematics at other times `x`, with the vertices of the wanted bodies alone.
    pub fn over(&self, times: &[f64], is_wanted: impl Fn(usize) -> bool) -> Self {
        let wanted = self.vertices.iter().filter(|(body, _)| is_wanted(*body));
        Self {
            poses: self.poses.over(times),
            points: self.points.over(times),
            vertices: wanted.map(|(body, vertices)| (*body, vertices.over(times))).collect(),
        }
    }

    /// Time derivatives at the middle of a frame that takes `duration` [s]: of the series, zero for a frame of a single
    /// sample.
    pub fn rates(&self, duration: f64) -> Self {
        let per_second = if duration > 0.0 { 2.0 / duration } else { 0.0 };
        let vertices = self.vertices.iter();
        Self {
            poses: self.poses.rate(per_second),
            points: self.points.rate(per_second),
            vertices: vertices
                .map(|(body, vertices)| (*body, vertices.rate(per_second)))
                .collect(),
        }
    }

    /// Error of the series through all positions [m], twice their last two terms: bodies reach `radii` (body,) beyond
    /// their origin [m].
    pub fn tail(&self, radii: &[f64]) -> f64 {
        let before_last = |num_times: usize| num_times.saturating_sub(2).max(1);
        let vertices = self.vertices.iter().map(|(_, vertices)| vertices);
        let positions = vertices
            .chain([&self.points])
            .map(|series| series.most_beyond(before_last(series.num_times)));
        let bodies = self.bodies_beyond(before_last(self.num_times()), radii);
        2.0 * bodies.into_iter().chain(positions).fold(0.0, f64::max)
    }

    /// Motion of every body, and of all point targets together, the last: fast-varying where series through `number`
    /// times leave out more than a length [m]; `radii` as in [`Self::tail`].
    pub fn motions(&self, number: usize, length: f64, radii: &[f64]) -> Vec<Motion> {
        let mut errors = self.bodies_beyond(number, radii);
        let mut are_static = self.poses.are_static();
        for (body, vertices) in &self.vertices {
            errors[*body] += vertices.most_beyond(number);
            are_static[*body] = false;
        }
        errors.push(self.points.most_beyond(number));
        are_static.push(self.points.are_static().into_iter().all(|is_static| is_static));
        let motions = are_static.into_iter().zip(errors);
        motions
            .map(|(is_static, error)| match (is_static, error > length) {
                (true, _) => Motion::Static,
                (false, true) => Motion::FastVarying,
                (false, false) => Motion::Smooth,
            })
            .collect()
    }

    /// Bounds of what series through `number` times leave out of the positions on every body [m].
    fn bodies_beyond(&self, number: usize, radii: &[f64]) -> Vec<f64> {
        self.poses.beyond(number, |body, pose| {
            let squares = pose.rotation.to_cols_array().map(|x| x * x);
            pose.translation.length() + radii[body] * squares.iter().sum::<f64>().sqrt()
        })
    }

    /// Triangle that carries a material point of a body that deforms; the corners may be velocities.
    ///
    /// `corners`: vertices of the triangle, none on bodies that do not deform.
    pub fn moving_triangle(&self, time: usize, body: u32, corners: Option<[u32; 3]>) -> Option<MovingTriangle> {
        let corners = corners?;
        let (_, vertices) = self.vertices.iter().find(|deforming| deforming.0 == body as usize)?;
        Some(MovingTriangle::new(
            corners.map(|vertex| vertices.row(time)[vertex as usize]),
        ))
    }

    /// Position [m] and velocity [m/s] of a material point at the first time, sensor frame; `rates` are the time
    /// derivatives. See [`Self::moving_triangle`].
    pub fn motion(&self, rates: &Self, body: u32, corners: Option<[u32; 3]>, mut position: DVec3) -> (DVec3, DVec3) {
        let [pose, rate] = [self, rates].map(|kinematics| &kinematics.poses.row(0)[body as usize]);
        let triangles = [self, rates].map(|kinematics| kinematics.moving_triangle(0, body, corners));
        let mut velocity = DVec3::ZERO;
        if let [Some(triangle), Some(triangle_rate)] = triangles {
            velocity = triangle.velocity(&triangle_rate, position);
            position = triangle.point(position);
        }
        (pose.point(position), rate.point(position) + pose.direction(velocity))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::chebyshev::chebyshev_nodes;

    fn series<T>(number: usize, value: impl Fn(f64) -> T) -> TimeSeries<T> {
        TimeSeries {
            num_times: number,
            values: chebyshev_nodes(number).into_iter().map(value).collect(),
        }
    }

    fn largest(matrix: DMat3) -> f64 {
        matrix.to_cols_array().iter().fold(0.0, |most, x| x.abs().max(most))
    }

    #[test]
    fn series_leave_out_the_coefficients_beyond_theirs() {
        // T_2 + 0.1 T_9 - 0.01 T_11, T_k(x) = cos(k arccos(x)).
        let chebyshev = |k: f64, x: f64| (k * x.acos()).cos();
        let value = |x: f64| DVec3::X * (chebyshev(2.0, x) + 0.1 * chebyshev(9.0, x) - 0.01 * chebyshev(11.0, x));
        for (number, expected) in [(2, 1.11), (8, 0.11), (10, 0.01), (12, 0.0)] {
            let beyond = series(17, value).most_beyond(number);
            assert!((beyond - expected).abs() < 1e-13, "{number} {beyond}");
        }
        // |x| has the coefficients (4 / pi) / (k^2 - 1) or so: 5e-3 of its 1 cm at 16.
        let kink = Kinematics {
            poses: TimeSeries::new(17, Vec::new()),
            points: series(17, |x| DVec3::X * (1.0 + 0.01 * x.abs())),
            vertices: Vec::new(),
        };
        assert!(kink.tail(&[]) > 5e-5);
    }

    #[test]
    fn series_through_a_turning_pose_is_exact_between_its_times() {
        // Coefficients of cos(0.2 x) and sin(0.2 x) are 2 J_k(0.2): 4e-11 for k = 7 in four entries, 5e-15 for k = 9,
        // then rounding.
        let pose = |x: f64| Pose {
            rotation: DMat3::from_rotation_z(0.2 * x),
            translation: DVec3::new(1.0 + 0.01 * x, 0.3 * x * x, 0.0),
        };
        for (number, tail, error) in [(9, 2e-10, 1e-13), (17, 1e-15, 4e-15)] {
            let turning = Kinematics {
                poses: series(number, pose),
                points: TimeSeries::new(number, Vec::new()),
                vertices: Vec::new(),
            };
            assert!(turning.tail(&[1.0]) < tail);
            for x in [-1.0, -0.37, 0.0, 0.91, 1.0] {
                let off = turning.poses.at(x)[0] - pose(x);
                assert!(
                    largest(off.rotation) < error && off.translation.length() < error,
                    "{off:?}"
                );
            }
        }
    }

    #[test]
    fn middle_of_an_odd_number_of_times_and_poses_at_rest_are_kept_to_the_last_bit() {
        let pose = |x: f64| Pose {
            rotation: DMat3::from_rotation_x(x),
            translation: DVec3::splat(x / 3.0),
        };
        let (rest, nodes) = (pose(0.123), chebyshev_nodes(17));
        let poses = TimeSeries::new(17, nodes.iter().flat_map(|x| [pose(*x), rest]).collect());
        assert_eq!(poses.at(0.0)[0], pose(nodes[8]));
        assert_eq!(poses.at(0.777)[1], rest);
        assert_eq!(poses.are_static(), [false, true]);
    }

    #[test]
    fn rates_seen_are_the_derivatives_of_places_seen() {
        let world = |t: f64| World {
            sensor: vec![Pose {
                rotation: DMat3::from_rotation_z(0.3 + 0.7 * t) * DMat3::from_rotation_x(0.2 * t),
                translation: DVec3::new(0.1 * t, 0.2, -0.3 * t),
            }],
            poses: vec![Pose {
                rotation: DMat3::from_rotation_y(1.1 * t),
                translation: DVec3::new(2.0 + t, 0.5 * t, 0.1),
            }],
            points: vec![DVec3::new(1.0, 2.0 * t, 0.3)],
            vertices: Vec::new(),
        };
        let (h, t, center) = (1e-5, 0.4, DVec3::new(0.01, -0.02, 0.03));
        let per_step = 1.0 / (2.0 * h);
        let [before, after] = [world(t - h), world(t + h)];
        let rates = World {
            sensor: vec![(after.sensor[0] - before.sensor[0]) * per_step],
            poses: vec![(after.poses[0] - before.poses[0]) * per_step],
            points: vec![(after.points[0] - before.points[0]) * per_step],
            vertices: Vec::new(),
        };
        let got = World::seen_rates(&world(t), &rates, center, &[]);
        let [before, after] = [before, after].map(|world| world.seen(center, &[]));
        let off = got.poses.row(0)[0] - (after.poses.row(0)[0] - before.poses.row(0)[0]) * per_step;
        assert!(
            off.translation.length() < 1e-9 && largest(off.rotation) < 1e-9,
            "{off:?}"
        );
        let expected = (after.points.row(0)[0] - before.points.row(0)[0]) * per_step;
        assert!((got.points.row(0)[0] - expected).length() < 1e-9);
    }
}
