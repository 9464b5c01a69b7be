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
use crate::rays::tests::scenes::grid;
use crate::rays::tests::{furnished, square};

#[test]
fn tiles_without_bodies_are_skipped_and_the_image_is_the_same() {
    let plane = ImagePlane::centered(64, 64, 0.5, 0.5);
    let (surfaces, poses) = furnished();
    let scene = PosedScene::new(surfaces[1..].to_vec(), poses[1..].to_vec());
    let skipping = scene.cast_image(&plane, &Cast::default()).unwrap();
    let cast = Cast {
        skip_empty: false,
        ..Cast::default()
    };
    let whole = scene.cast_image(&plane, &cast).unwrap();
    assert_eq!(skipping.distance, whole.distance);
    assert_eq!(skipping.body, whole.body);
    assert_eq!((whole.counts.tiles_skipped, whole.counts.rays), (0, 64 * 64));
    let Counts {
        rays, tiles_skipped, ..
    } = skipping.counts;
    assert!(tiles_skipped > 20, "{tiles_skipped}");
    assert_eq!(rays + 64 * tiles_skipped, 64 * 64);
}

fn gaussian(azimuth: f64, elevation: f64) -> Pattern {
    Pattern::Gaussian {
        peak: 7.0,
        azimuth,
        elevation,
    }
}

/// As many transmitters as receivers.
fn array(places: &[DVec3], patterns: &[Pattern]) -> Array {
    Array {
        tx: places.to_vec(),
        rx: places.iter().rev().copied().collect(),
        tx_patterns: patterns.to_vec(),
        rx_patterns: patterns.to_vec(),
        power: 1.0,
        frequency: 60e9,
        polarization: None,
        responses: Vec::new(),
    }
}

/// Number of pixels whose hits change with a beam; at none of them has any pair of antennas a gain above the floor.
fn num_out_of_beam(scene: &PosedScene, plane: &ImagePlane, array: &Array, peaks: &[f64], floor: f64) -> usize {
    let whole = scene.cast_image(plane, &Cast::default()).unwrap();
    let [u, v] = plane.ranges();
    let beam = Beam::new(array, floor)
        .in_front(|| scene.nearest_in_front(), u, v)
        .unwrap();
    let cast = Cast {
        outside: Some(&|u, v| beam.misses(u, v)),
        ..Cast::default()
    };
    let within = scene.cast_image(plane, &cast).unwrap();
    let pixels = 0..plane.num_pixels();
    let changed: Vec<usize> = pixels.filter(|i| within.distance[*i] != whole.distance[*i]).collect();
    for pixel in &changed {
        let point = whole.distance[*pixel] * plane.direction(pixel / plane.columns, pixel % plane.columns);
        for channel in 0..array.num_channels() {
            let (t, r) = array.pair(channel, point);
            let most = peaks[channel / array.rx.len()] * peaks[channel % array.rx.len()];
            assert!(t.gain * r.gain < floor * most, "{pixel} {channel}");
        }
    }
    changed.len()
}

#[test]
fn directions_out_of_the_beam_are_not_cast() {
    let plane = ImagePlane::centered(64, 96, 1.0, 0.7);
    let (surfaces, poses) = furnished();
    let scene = PosedScene::new(surfaces, poses);
    let array = array(&[DVec3::ZERO], &[gaussian(20.0, 60.0)]);
    assert!(num_out_of_beam(&scene, &plane, &array, &[7.0], 1e-5) > 500);
}

#[test]
fn what_one_pair_of_antennas_sees_from_beside_the_centre_is_cast() {
    // Walls from a tenth of a metre on, antennas up to 10 cm apart that look into different directions.
    let plane = ImagePlane::centered(96, 128, 1.5, 1.0);
    let (mut surfaces, mut poses) = furnished();
    surfaces[0] = square(20.0);
    let angles: Vec<f64> = (-6..=6).map(|i| 0.1 * f64::from(i)).collect();
    let gains: Vec<f64> = (0..169)
        .map(|i| -8.0 * (f64::from(i / 13 - 9).abs() + 0.5 * f64::from(i % 13 - 6).abs()))
        .collect();
    let table = Pattern::Table(Arc::new(GainTable::new(&angles, &angles, &gains).unwrap()));
    let places = [
        DVec3::new(0.0, 0.05, 0.0),
        DVec3::new(0.01, -0.05, 0.02),
        DVec3::new(-0.02, 0.0, -0.05),
    ];
    let array = array(&places, &[gaussian(30.0, 60.0), table, gaussian(60.0, 60.0)]);
    let mut num_out = Vec::new();
    for (i, distance) in [0.1, 0.2, 0.5, 6.0].into_iter().enumerate() {
        poses[0].translation.x = distance;
        let scene = PosedScene::new(surfaces.clone(), poses.clone());
        num_out.push(num_out_of_beam(&scene, &plane, &array, &[7.0, 1.0, 7.0], 1e-6));
        assert!(
            (scene.nearest_in_front() - distance.min(3.0)).abs() < 0.1 * distance,
            "{i}"
        );
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
fn sheet() -> Surface {
    let bump = |z: f64, y: f64| DVec3::new(0.4 * (3.0 * y).sin() * (2.0 * z).cos(), y, z);
    let (vertices, triangles) = grid(24, bump);
    Surface::new(
        &vertices,
        &triangles,
        ShadingMode::Smooth { crease_angle: 0.16 },
        &Cancel::default(),
    )
    .unwrap()
}

#[test]
fn smooth_hits_are_those_of_shading_one_hit_after_the_other() {
    let surface = Arc::new(sheet());
    let turned = |angle: f64, x: f64| Pose {
        rotation: DMat3::from_rotation_z(angle) * DMat3::from_rotation_x(0.3),
        translation: DVec3::new(x, 0.1, 0.0),
    };
    let poses = vec![turned(0.5, 2.0), turned(3.5, 3.0)];
    let scene = PosedScene::new(vec![surface.clone(), surface], poses);
    let plane = ImagePlane::centered(61, 83, 0.7, 0.6);
    for level in Level::available() {
        let hits = scene
            .cast_image(
                &plane,
                &Cast {
                    level,
                    ..Cast::default()
                },
            )
            .unwrap();
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
            assert!(
                (DVec3::from_array(hits.normal[pixel]) - normal).length() < 1e-11,
                "{pixel} {level:?}"
            );
            assert!((hits.surface_distance[pixel] - hits.distance[pixel] - correction).abs() < 1e-12);
            let cosine = (-normal.dot(direction.normalize())).clamp(0.0, 1.0);
            assert!((hits.cosine[pixel] - cosine).abs() < 1e-11);
            num_curved += usize::from(correction != 0.0);
            num_flat += usize::from(correction == 0.0);
        }
        assert!(num_curved > 500 && num_flat > 500, "{num_curved} {num_flat}");
    }
}
