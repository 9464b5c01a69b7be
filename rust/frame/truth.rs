//! Truth: range, range rate and direction of the nearest visible point of every body, at the middle of the frame.

use glam::DVec3;

use super::model::{Model, Source};
use super::rays::Rays;
use crate::paths::kinematics::Kinematics;

/// Truth of a scene, per body and point target: range [m], range rate [m/s], azimuth and elevation [rad]; NaN where no
/// ray hit. None for images.
pub fn of(model: &Model, rays: &Rays, motion: &Kinematics, rates: &Kinematics) -> Option<Vec<[f64; 4]>> {
    let Source::Scene(scene) = &model.source else {
        return None;
    };
    let mut truth = vec![[f64::NAN; 4]; scene.body_numbers.len() + scene.point_numbers.len()];
    let (poses, pose_rates) = (motion.poses.at(0.0), rates.poses.at(0.0));
    for (cast, hit) in rays.nearest() {
        // The material point that was hit, at the middle of the frame.
        let body = hit.body as usize;
        let deforming = motion.vertices.iter().position(|deforming| deforming.0 == body);
        let (position, velocity) = match deforming {
            None => {
                let point = hit.distance * hit.cell.direction();
                (cast.pose(hit.body).point_to_body(point), DVec3::ZERO)
            }
            Some(index) => {
                let corners = cast.surface(hit.body).vertices_of(hit.triangle);
                let direction = DVec3::new(1.0, hit.cell.u, hit.cell.v);
                let weights = cast.barycentric(hit.body, hit.triangle, direction);
                let on_mesh = |kinematics: &Kinematics| -> DVec3 {
                    let vertices = kinematics.vertices[index].1.at(0.0);
                    let terms = corners.iter().zip(weights);
                    terms.map(|(corner, weight)| weight * vertices[*corner as usize]).sum()
                };
                (on_mesh(motion), on_mesh(rates))
            }
        };
        let moving = pose_rates[body].point(position) + poses[body].direction(velocity);
        truth[scene.body_numbers[body]] = row(poses[body].point(position), moving);
    }
    let points = motion.points.at(0.0).into_iter().zip(rates.points.at(0.0));
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
