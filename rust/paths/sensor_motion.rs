//! Motion over a frame: bodies, point targets and vertices in the sensor frame at the Chebyshev times of the frame, and
//! the series through these samples.
//!
//! Times are `x` from -1 at the start of the first ramp to 1 at the last sample.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::geometry::pose::Pose;
use crate::numeric::chebyshev::{interpolation_weights, series_beyond, series_tail, slope_weights};
use crate::paths::kinematics::Kinematics;

/// Relative error of coordinates by rounding, of which no number of times frees a series.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Largest number of vertices of a body that the error of the motion is estimated from.
const NUM_PROBED_VERTICES: usize = 1024;

/// Positions of the vertices of a body that deforms, `(time, vertex)` [m].
#[derive(Clone, Debug, Default)]
pub struct VertexMotion {
    num_times: usize,
    positions: Vec<[f64; 3]>,
}

impl VertexMotion {
    /// Motion from positions `(time, vertex)` [m], body coordinates.
    pub fn new(num_times: usize, positions: Vec<[f64; 3]>) -> Self {
        Self { num_times, positions }
    }

    /// Number of vertices.
    pub fn num_vertices(&self) -> usize {
        self.positions.len() / self.num_times.max(1)
    }

    /// Positions at the time `x`, in body coordinates [m].
    pub fn at(&self, x: f64) -> Vec<[f64; 3]> {
        let mut at = Vec::with_capacity(self.num_vertices());
        self.append_at(x, &mut at);
        at
    }

    /// Derivative by `x` at the middle, as a motion with one time.
    fn slope(&self) -> Self {
        let mut positions = vec![[0.0; 3]; self.num_vertices()];
        let rows = self.positions.chunks(self.num_vertices().max(1));
        for (weight, row) in slope_weights(self.num_times).iter().zip(rows) {
            for (sum, position) in positions.iter_mut().zip(row) {
                for axis in 0..3 {
                    sum[axis] += weight * position[axis];
                }
            }
        }
        Self::new(1, positions)
    }

    fn append_at(&self, x: f64, out: &mut Vec<[f64; 3]>) {
        let number = self.num_vertices();
        let weights = interpolation_weights(self.num_times, x);
        if let Some(only) = weights.iter().position(|weight| *weight == 1.0) {
            out.extend_from_slice(&self.positions[only * number..(only + 1) * number]);
            return;
        }
        let first = out.len();
        out.resize(first + number, [0.0; 3]);
        for (weight, row) in weights.iter().zip(self.positions.chunks(number.max(1))) {
            for (sum, position) in out[first..].iter_mut().zip(row) {
                for axis in 0..3 {
                    sum[axis] += weight * position[axis];
                }
            }
        }
    }

    /// Largest error of a vertex [m], from the errors of the coordinates of a series.
    fn error(&self, error: impl Fn(&[[f64; 3]]) -> [f64; 3]) -> f64 {
        let number = self.num_vertices();
        let stride = number.div_ceil(NUM_PROBED_VERTICES).max(1);
        let tail = |vertex: usize| {
            let values: Vec<[f64; 3]> = (0..self.num_times)
                .map(|time| self.positions[time * number + vertex])
                .collect();
            DVec3::from_array(error(&values)).length()
        };
        (0..number).step_by(stride).map(tail).fold(0.0, f64::max)
    }
}

/// Motion over a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Motion {
    /// The same pose at all times.
    Static,
    /// Few times describe it.
    Smooth,
    /// Series through few times leave out too much.
    FastVarying,
}

impl Motion {
    /// All motions, from the smoothest on.
    pub const ALL: [Self; 3] = [Self::Static, Self::Smooth, Self::FastVarying];
}

/// Tail of a series of coordinates of a size, or zero where it is rounding.
fn beyond_rounding(tail: f64, size: f64) -> f64 {
    if tail <= ROUNDING * size { 0.0 } else { tail }
}

/// Poses of bodies, positions of point targets and vertices in the sensor frame, or the time derivatives of all.
///
/// `poses`: `(time, body)` maps of body coordinates to the axes of `sensor`; likewise `points` `(time, point)` [m].
#[derive(Clone, Debug)]
pub struct SensorMotion {
    num_times: usize,
    poses: Vec<Pose>,
    points: Vec<DVec3>,
    /// Motion of the vertices, per body that deforms.
    vertices: Vec<VertexMotion>,
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
    pub vertices: Vec<VertexMotion>,
}

impl World {
    /// Number of times.
    pub fn num_times(&self) -> usize {
        self.sensor.len()
    }

    /// SensorMotion in the axes of the sensor, with the origin at `center`, the middle of the array in sensor axes [m].
    pub fn seen(&self, center: DVec3) -> SensorMotion {
        let num_times = self.num_times();
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
        SensorMotion {
            num_times,
            poses: poses.collect(),
            points: points.collect(),
            vertices: self.vertices.clone(),
        }
    }

    /// Time derivative of [`Self::seen`] at a single time, from positions `at` and time derivatives `rates` in the
    /// world.
    pub fn seen_rates(at: &Self, rates: &Self, center: DVec3) -> SensorMotion {
        let (sensor, rate) = (&at.sensor[0], &rates.sensor[0]);
        let seen = at.seen(center);
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
        SensorMotion {
            num_times: 1,
            poses: seen.poses.iter().zip(&rates.poses).map(pose).collect(),
            points: seen.points.iter().zip(&rates.points).map(point).collect(),
            vertices: rates.vertices.clone(),
        }
    }
}

impl SensorMotion {
    /// Number of bodies.
    pub fn num_bodies(&self) -> usize {
        self.poses.len() / self.num_times
    }

    /// Number of point targets.
    pub fn num_points(&self) -> usize {
        self.points.len() / self.num_times
    }

    /// Number of times.
    pub fn num_times(&self) -> usize {
        self.num_times
    }

    /// Vertices of the bodies that deform.
    pub fn vertices(&self) -> &[VertexMotion] {
        &self.vertices
    }

    /// True for every body whose pose is the same at all times.
    pub fn are_static(&self) -> Vec<bool> {
        let number = self.num_bodies();
        let is_static =
            |body: usize| (1..self.num_times).all(|time| self.poses[time * number + body] == self.poses[body]);
        (0..number).map(is_static).collect()
    }

    /// True when all point targets are at the same place at all times.
    pub fn points_are_static(&self) -> bool {
        let number = self.num_points();
        self.points
            .iter()
            .enumerate()
            .all(|(i, point)| *point == self.points[i % number.max(1)])
    }

    /// Largest error of the series through all positions [m]: bodies reach `radii` (body,) beyond their origin [m].
    pub fn tail(&self, radii: &[f64]) -> f64 {
        let bodies = self.errors_of_bodies(radii, series_tail);
        let vertices = self.vertices.iter().map(|motion| motion.error(series_tail));
        bodies
            .into_iter()
            .chain(vertices)
            .fold(self.error_of_points(series_tail), f64::max)
    }

    /// Motion of every body, and of all point targets together: fast-varying where series through `number` times leave out more
    /// than a length [m]. `deforming`: the bodies that deform; `radii` as above.
    pub fn motions(&self, number: usize, length: f64, deforming: &[usize], radii: &[f64]) -> (Vec<Motion>, Motion) {
        let motion = |is_static: bool, error: f64| match (is_static, error > length) {
            (true, _) => Motion::Static,
            (false, true) => Motion::FastVarying,
            (false, false) => Motion::Smooth,
        };
        let are_static = self.are_static();
        let mut errors = self.errors_of_bodies(radii, |values| series_beyond(values, number));
        for (body, motion) in deforming.iter().zip(&self.vertices) {
            errors[*body] += motion.error(|values| series_beyond(values, number));
        }
        let of_body = |body: usize| motion(are_static[body] && !deforming.contains(&body), errors[body]);
        let points = self.error_of_points(|values| series_beyond(values, number));
        (
            (0..self.num_bodies()).map(of_body).collect(),
            motion(self.points_are_static(), points),
        )
    }

    /// Largest error of every body [m], from the errors of the coordinates of a series; zero where it is rounding.
    fn errors_of_bodies(&self, radii: &[f64], error: impl Fn(&[[f64; 12]]) -> [f64; 12]) -> Vec<f64> {
        let num_bodies = self.num_bodies();
        let of_body = |body: usize| {
            let pose = |time: usize| {
                let pose = &self.poses[time * num_bodies + body];
                let (turned, moved) = (pose.rotation.to_cols_array(), pose.translation.to_array());
                let mut values = [0.0; 12];
                values[..9].copy_from_slice(&turned);
                values[9..].copy_from_slice(&moved);
                values
            };
            let values: Vec<[f64; 12]> = (0..self.num_times).map(pose).collect();
            let tail = error(&values);
            let norm = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>().sqrt();
            beyond_rounding(
                norm(&tail[9..]) + radii[body] * norm(&tail[..9]),
                norm(&values[0][9..]) + radii[body],
            )
        };
        (0..num_bodies).map(of_body).collect()
    }

    /// Largest error of a point target, likewise.
    fn error_of_points(&self, error: impl Fn(&[[f64; 3]]) -> [f64; 3]) -> f64 {
        let num_points = self.num_points();
        let of_point = |point: usize| {
            let place = |time: usize| self.points[time * num_points + point].to_array();
            let values: Vec<[f64; 3]> = (0..self.num_times).map(place).collect();
            beyond_rounding(
                DVec3::from_array(error(&values)).length(),
                DVec3::from_array(values[0]).length(),
            )
        };
        (0..num_points).map(of_point).fold(0.0, f64::max)
    }

    /// Motion over a part of the frame, at times `x` of the frame.
    pub fn over(&self, times: &[f64]) -> Self {
        let vertices = self.vertices.iter().map(|motion| {
            let positions = times.iter().flat_map(|x| motion.at(*x)).collect();
            VertexMotion::new(times.len(), positions)
        });
        Self {
            num_times: times.len(),
            poses: times.iter().flat_map(|x| self.poses_at(*x)).collect(),
            points: times.iter().flat_map(|x| self.points_at(*x)).collect(),
            vertices: vertices.collect(),
        }
    }

    /// Poses of the bodies at the time `x`.
    pub fn poses_at(&self, x: f64) -> Vec<Pose> {
        let (number, weights) = (self.num_bodies(), interpolation_weights(self.num_times, x));
        let at = |body: usize| {
            let first = self.poses[body];
            let differs = (1..self.num_times).any(|time| self.poses[time * number + body] != first);
            if !differs {
                return first;
            }
            if let Some(only) = weights.iter().position(|weight| *weight == 1.0) {
                return self.poses[only * number + body];
            }
            let terms = weights.iter().enumerate();
            let zero = Pose {
                rotation: DMat3::ZERO,
                translation: DVec3::ZERO,
            };
            terms.fold(zero, |sum, (time, weight)| {
                let pose = &self.poses[time * number + body];
                Pose {
                    rotation: sum.rotation + pose.rotation * *weight,
                    translation: sum.translation + pose.translation * *weight,
                }
            })
        };
        (0..number).map(at).collect()
    }

    /// Time derivatives at the middle of a frame that takes `duration` [s]: those of the series,
    /// zero for a frame of a single sample.
    pub fn rates(&self, duration: f64) -> Self {
        let per_second = if duration > 0.0 { 2.0 / duration } else { 0.0 };
        let slopes = slope_weights(self.num_times);
        let weights: Vec<f64> = slopes.iter().map(|weight| weight * per_second).collect();
        let (num_bodies, num_points) = (self.num_bodies(), self.num_points());
        // Differences from the first time, which are exactly zero for what stands still.
        let pose = |body: usize| {
            let first = self.poses[body];
            let zero = Pose {
                rotation: DMat3::ZERO,
                translation: DVec3::ZERO,
            };
            weights.iter().enumerate().fold(zero, |sum, (time, weight)| {
                let pose = &self.poses[time * num_bodies + body];
                Pose {
                    rotation: sum.rotation + (pose.rotation - first.rotation) * *weight,
                    translation: sum.translation + (pose.translation - first.translation) * *weight,
                }
            })
        };
        let point = |point: usize| {
            let moved = |time: usize| self.points[time * num_points + point] - self.points[point];
            let terms = weights.iter().enumerate();
            terms.map(|(time, weight)| moved(time) * *weight).sum()
        };
        let vertices = self.vertices.iter().map(|motion| {
            let mut slope = motion.slope();
            slope.positions.iter_mut().flatten().for_each(|x| *x *= per_second);
            slope
        });
        Self {
            num_times: 1,
            poses: (0..num_bodies).map(pose).collect(),
            points: (0..num_points).map(point).collect(),
            vertices: vertices.collect(),
        }
    }

    /// Positions of the point targets at the time `x` [m].
    pub fn points_at(&self, x: f64) -> Vec<DVec3> {
        let (number, weights) = (self.num_points(), interpolation_weights(self.num_times, x));
        let at = |point: usize| {
            let first = self.points[point];
            let differs = (1..self.num_times).any(|time| self.points[time * number + point] != first);
            if !differs {
                return first;
            }
            let terms = weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            terms.fold(DVec3::ZERO, |sum, (time, weight)| {
                sum + self.points[time * number + point] * *weight
            })
        };
        (0..number).map(at).collect()
    }

    /// Kinematics at times `x`, with the cross-sections of the point targets [m^2] (none: no point targets), and with the
    /// vertices of bodies that deform: `deforming` has the body of every motion of vertices, and whether it is wanted.
    pub fn at(&self, times: &[f64], rcs: &[f64], deforming: impl Iterator<Item = (u32, bool)>) -> Kinematics {
        let wanted = deforming.zip(&self.vertices).filter(|((_, is_wanted), _)| *is_wanted);
        let vertices = wanted.map(|((body, _), motion)| {
            let mut positions = Vec::with_capacity(times.len() * motion.num_vertices());
            for x in times {
                motion.append_at(*x, &mut positions);
            }
            (body, positions)
        });
        let points_at = if rcs.is_empty() { &[] } else { times };
        Kinematics {
            num_nodes: times.len(),
            num_bodies: self.num_bodies(),
            poses: times.iter().flat_map(|x| self.poses_at(*x)).collect(),
            points: points_at.iter().flat_map(|x| self.points_at(*x)).collect(),
            rcs: rcs.to_vec(),
            vertices: vertices.collect(),
        }
    }

    /// Check that the arrays fit a scene.
    pub fn check(&self, num_bodies: usize, num_points: usize, num_vertices: &[usize]) -> Result<()> {
        let checks = [
            ("poses", num_bodies, self.num_bodies()),
            ("points", num_points, self.num_points()),
            ("vertices", num_vertices.len(), self.vertices.len()),
        ];
        for (name, expected, got) in checks {
            if expected != got {
                return Err(Error::value(name, format!("{expected} of them as the scene has"), got));
            }
        }
        for (motion, expected) in self.vertices.iter().zip(num_vertices) {
            if motion.num_vertices() != *expected {
                let expected = format!("{expected} as the mesh has");
                return Err(Error::value("vertices", expected, motion.num_vertices()));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::chebyshev::chebyshev_nodes;

    #[test]
    fn series_through_a_turning_pose_is_exact_between_its_times() {
        // Coefficients of cos(0.2 x) and sin(0.2 x) are 2 J_k(0.2): 4e-11 for k = 7 in four entries, 5e-15 for k = 9, then rounding.
        let pose = |x: f64| Pose {
            rotation: DMat3::from_rotation_z(0.2 * x),
            translation: DVec3::new(1.0 + 0.01 * x, 0.3 * x * x, 0.0),
        };
        for (number, tail, error) in [(9, 2e-10, 1e-13), (17, 1e-15, 4e-15)] {
            let placement = SensorMotion {
                num_times: number,
                poses: chebyshev_nodes(number).into_iter().map(pose).collect(),
                points: Vec::new(),
                vertices: Vec::new(),
            };
            assert!(placement.tail(&[1.0]) < tail);
            for x in [-1.0, -0.37, 0.0, 0.91, 1.0] {
                let (got, expected) = (placement.poses_at(x)[0], pose(x));
                let off = got.rotation - expected.rotation;
                assert!(off.to_cols_array().iter().all(|v| v.abs() < error), "{off}");
                assert!((got.translation - expected.translation).length() < error);
            }
        }
    }

    #[test]
    fn middle_of_an_odd_number_of_times_and_poses_at_rest_are_kept_to_the_last_bit() {
        let pose = |x: f64| Pose {
            rotation: DMat3::from_rotation_x(x),
            translation: DVec3::splat(x / 3.0),
        };
        let rest = pose(0.123);
        let nodes = chebyshev_nodes(17);
        let placement = SensorMotion {
            num_times: 17,
            poses: nodes.iter().flat_map(|x| [pose(*x), rest]).collect(),
            points: Vec::new(),
            vertices: Vec::new(),
        };
        assert_eq!(placement.poses_at(0.0)[0], pose(nodes[8]));
        assert_eq!(placement.poses_at(0.777)[1], rest);
        assert_eq!(placement.are_static(), [false, true]);
    }

    #[test]
    fn kink_shows_in_the_tail() {
        let kink = |x: f64| DVec3::new(1.0 + 0.01 * x.abs(), 0.0, 0.0);
        let placement = SensorMotion {
            num_times: 17,
            poses: Vec::new(),
            points: chebyshev_nodes(17).into_iter().map(kink).collect(),
            vertices: Vec::new(),
        };
        // |x| has the coefficients (4 / pi) / (k^2 - 1) or so: 5e-3 of its 1 cm at 16.
        assert!(placement.tail(&[]) > 5e-5);
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
        let difference = |a: &Pose, b: &Pose, step: f64| Pose {
            rotation: (b.rotation - a.rotation) * (1.0 / step),
            translation: (b.translation - a.translation) / step,
        };
        let (h, t, center) = (1e-5, 0.4, DVec3::new(0.01, -0.02, 0.03));
        let [before, after] = [world(t - h), world(t + h)];
        let rates = World {
            sensor: vec![difference(&before.sensor[0], &after.sensor[0], 2.0 * h)],
            poses: vec![difference(&before.poses[0], &after.poses[0], 2.0 * h)],
            points: vec![(after.points[0] - before.points[0]) / (2.0 * h)],
            vertices: Vec::new(),
        };
        let got = World::seen_rates(&world(t), &rates, center);
        let [before, after] = [before.seen(center), after.seen(center)];
        let expected = difference(&before.poses[0], &after.poses[0], 2.0 * h);
        assert!((got.poses[0].translation - expected.translation).length() < 1e-9);
        assert!(
            (got.poses[0].rotation - expected.rotation)
                .to_cols_array()
                .iter()
                .all(|v| v.abs() < 1e-9)
        );
        let expected = (after.points[0] - before.points[0]) / (2.0 * h);
        assert!((got.points[0] - expected).length() < 1e-9);
    }
}
