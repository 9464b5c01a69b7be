use glam::{DMat3, DVec3};

use super::*;
use crate::antennas::array::Array;
use crate::antennas::beam::Beam;
use crate::antennas::gain_table::GainTable;
use crate::antennas::pattern::Pattern;
use crate::geometry::curved_triangle::shade;
use crate::geometry::pose::Pose;
use crate::numeric::simd::Level;
use crate::rays::surface::{ShadingMode, Surface};
use crate::rays::tests::furnished;
use crate::rays::tests::scenes::{grid, shaded, surface, wall};

#[test]
fn directions_that_no_pair_of_antennas_sees_are_not_cast() {
    // Walls from a tenth of a metre on, antennas with spacings up to 10 cm and different directions.
    let plane = ImagePlane::centered(96, 128, 1.5, 1.0);
    let (mut surfaces, mut poses) = furnished();
    surfaces[0] = surface(&wall(0.0, 20.0));
    let angles: Vec<f64> = (-6..=6).map(|i| 0.1 * f64::from(i)).collect();
    let fall = |i: i32| f64::from(i / 13 - 9).abs() + 0.5 * f64::from(i % 13 - 6).abs();
    let gains: Vec<f64> = (0..169).map(|i| -8.0 * fall(i)).collect();
    let table = Pattern::Table(Arc::new(GainTable::new(&angles, &angles, &gains).unwrap()));
    let [wide, narrow] = [30.0, 60.0].map(|azimuth| Pattern::Gaussian {
        peak: 7.0,
        azimuth,
        elevation: 60.0,
    });
    let (patterns, peaks) = (vec![wide, table, narrow], [7.0, 1.0, 7.0]);
    let tx = [[0.0, 0.05, 0.0], [0.01, -0.05, 0.02], [-0.02, 0.0, -0.05]].map(DVec3::from);
    let array = Array {
        tx_patterns: patterns.clone(),
        rx_patterns: patterns,
        ..Array::isotropic(&tx, &[tx[2], tx[1], tx[0]])
    };
    let mut num_out = Vec::new();
    for distance in [0.1, 0.2, 0.5, 6.0] {
        poses[0].translation.x = distance;
        let scene = PosedScene::new(surfaces.clone(), poses.clone());
        let near = scene.nearest_in_front() - distance.min(3.0);
        assert!(near.abs() < 0.1 * distance, "{distance}: {near}");

        let whole = scene.cast_image(&plane, &Cast::default()).unwrap();
        let ([u, v], floor) = (plane.ranges(), 1e-6);
        let beam = Beam::new(&array, floor)
            .in_front(|| scene.nearest_in_front(), u, v)
            .unwrap();
        let cast = Cast {
            outside: Some(&|u, v| beam.misses(u, v)),
            ..Cast::default()
        };
        let within = scene.cast_image(&plane, &cast).unwrap();
        let pixels = 0..plane.num_pixels();
        let changed: Vec<usize> = pixels.filter(|i| within.distance[*i] != whole.distance[*i]).collect();
        for pixel in &changed {
            let point = whole.distance[*pixel] * plane.direction(pixel / plane.columns, pixel % plane.columns);
            for channel in 0..9 {
                let (t, r) = array.pair(channel, point);
                let most = peaks[channel / 3] * peaks[channel % 3];
                assert!(t.gain * r.gain < floor * most, "{pixel} {channel}");
            }
        }
        num_out.push(changed.len());
    }
    assert!(num_out[0] < num_out[3] && num_out[3] > 2000, "{num_out:?}");
}

#[test]
fn what_is_behind_the_sensor_does_not_widen_the_beam() {
    let (surfaces, mut poses) = furnished();
    poses[1].translation = DVec3::new(-0.01, 0.0, 0.0);
    poses[1].rotation = glam::DMat3::IDENTITY;
    let nearest = PosedScene::new(surfaces, poses).nearest_in_front();
    assert!((2.8..3.1).contains(&nearest), "{nearest}");
    assert_eq!(PosedScene::new(vec![], vec![]).nearest_in_front(), f64::INFINITY);
}

/// Bumpy sheet, curved where its triangles meet at small angles, seen from both sides.
fn sheet() -> Arc<Surface> {
    let bump = |z: f64, y: f64| DVec3::new(0.4 * (3.0 * y).sin() * (2.0 * z).cos(), y, z);
    shaded(&grid(24, bump), ShadingMode::Smooth { crease_angle: 0.16 })
}

#[test]
fn smooth_hits_are_those_of_shading_one_hit_after_the_other() {
    let surface = sheet();
    let turned = |angle: f64, x: f64| Pose {
        rotation: DMat3::from_rotation_z(angle) * DMat3::from_rotation_x(0.3),
        translation: DVec3::new(x, 0.1, 0.0),
    };
    let poses = vec![turned(0.5, 2.0), turned(3.5, 3.0)];
    let scene = PosedScene::new(vec![surface.clone(), surface], poses);
    let plane = ImagePlane::centered(61, 83, 0.7, 0.6);
    for level in Level::available() {
        let options = Cast {
            level,
            ..Cast::default()
        };
        let hits = scene.cast_image(&plane, &options).unwrap();
        let (mut num_curved, mut num_flat) = (0, 0);
        for pixel in 0..plane.num_pixels() {
            let (body, triangle) = (hits.body[pixel], hits.triangle[pixel]);
            if body == NO_BODY {
                assert_eq!((hits.cosine[pixel], hits.normal[pixel]), (0.0, [0.0; 3]));
                assert!(hits.surface_distance[pixel].is_infinite());
                continue;
            }
            let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
            let direction = DVec3::new(1.0, u, v);
            let (surface, pose) = (scene.surface(body), scene.pose(body));
            let corners = surface.corners(triangle);
            let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let (normal, correction) = shade(
                corners,
                surface.corner_normals(triangle),
                scene.barycentric(body, triangle, direction),
                face,
                pose.direction_to_body(direction.normalize()),
            );
            let normal = pose.direction(normal);
            let error = DVec3::from_array(hits.normal[pixel]).distance(normal);
            assert!(error < 1e-11, "{pixel} {level:?}");
            assert!((hits.surface_distance[pixel] - hits.distance[pixel] - correction).abs() < 1e-12);
            let cosine = (-normal.dot(direction.normalize())).clamp(0.0, 1.0);
            assert!((hits.cosine[pixel] - cosine).abs() < 1e-11);
            num_curved += usize::from(correction != 0.0);
            num_flat += usize::from(correction == 0.0);
        }
        assert!(num_curved > 500 && num_flat > 500, "{num_curved} {num_flat}");
    }
}
