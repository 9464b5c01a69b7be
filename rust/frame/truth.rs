//! Truth: range, range rate and direction of the nearest visible point of every body, at the middle of the frame.

use glam::DVec3;

use super::model::{Model, Source};
use super::rays::Rays;
use crate::paths::sensor_motion::SensorMotion;

/// Per body and point target of the scene: range [m], range rate [m/s], azimuth and elevation [rad]; NaN where no ray
/// hit.
pub type Truth = Vec<[f64; 4]>;

/// Truth of a scene; none for images.
pub fn of(model: &Model, rays: &Rays, motion: &SensorMotion, rates: &SensorMotion) -> Option<Truth> {
    let Source::Scene(scene) = &model.source else {
        return None;
    };
    let mut truth = vec![[f64::NAN; 4]; scene.body_numbers.len() + scene.point_numbers.len()];
    let (poses, pose_rates) = (motion.poses_at(0.0), rates.poses_at(0.0));
    for hit in rays.nearest(model) {
        // The material point that was hit, at the middle of the frame.
        let (pose, rate) = (&poses[hit.body], &pose_rates[hit.body]);
        let deforming = scene.deforming.iter().position(|body| *body == hit.body);
        let (position, velocity) = match deforming {
            None => (rays.pose(hit.body).point_to_body(hit.point), DVec3::ZERO),
            Some(index) => {
                let on_mesh = |vertices: &[[f64; 3]]| {
                    let (corners, weights) = &hit.corners;
                    let terms = corners.iter().zip(weights);
                    terms
                        .map(|(corner, weight)| *weight * DVec3::from_array(vertices[*corner as usize]))
                        .sum()
                };
                let [at, rates] = [motion, rates].map(|of| of.vertices()[index].at(0.0));
                (on_mesh(&at), on_mesh(&rates))
            }
        };
        let moving = rate.point(position) + pose.direction(velocity);
        truth[scene.body_numbers[hit.body]] = row(pose.point(position), moving);
    }
    let points = motion.points_at(0.0).into_iter().zip(rates.points_at(0.0));
    for (number, (point, velocity)) in scene.point_numbers.iter().zip(points) {
        truth[*number] = row(point, velocity);
    }
    Some(truth)
}

fn row(point: DVec3, velocity: DVec3) -> [f64; 4] {
    let range = point.length();
    let rate = point.dot(velocity) / range.max(f64::MIN_POSITIVE);
    [
        range,
        rate,
        point.y.atan2(point.x),
        point.z.atan2(point.x.hypot(point.y)),
    ]
}
