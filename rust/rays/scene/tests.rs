use super::*;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Cast;
use crate::rays::packet_search::Traversals;
use crate::rays::surface::ShadingMode;
use glam::DMat3;

pub fn square(half: f64) -> Arc<Surface> {
    let vertices = [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[y, z]| DVec3::new(0.0, y, z));
    Arc::new(Surface::new(&vertices, &[[0, 2, 1], [0, 3, 2]], ShadingMode::Flat).unwrap())
}

fn at(x: f64, angle: f64) -> Pose {
    Pose {
        rotation: DMat3::from_rotation_z(angle),
        translation: DVec3::new(x, 0.0, 0.0),
    }
}

const PLANE: ImagePlane = ImagePlane::centered(17, 23, 0.5, 0.5);

/// Assert that every pixel has the hit of [`PosedScene::cast`] on every instruction set, in one traversal per tile and
/// in four.
fn check(scene: &PosedScene, plane: &ImagePlane) -> usize {
    let mut count = 0;
    for level in Level::available() {
        let [hits, apart] = [Traversals::Together, Traversals::Apart].map(|traversals| {
            let cast = Cast {
                level,
                traversals,
                ..Cast::default()
            };
            scene.cast_image_with(plane, &cast).unwrap()
        });
        assert_eq!(hits.distance, apart.distance);
        assert_eq!((&hits.body, &hits.triangle), (&apart.body, &apart.triangle));
        for pixel in 0..plane.num_pixels() {
            let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
            let direction = DVec3::new(1.0, u, v);
            let ray = Ray {
                origin: DVec3::ZERO,
                direction,
                start: NEAREST,
            };
            let one = scene.cast_at(&ray, level);
            let all = (hits.body[pixel], hits.triangle[pixel], hits.distance[pixel]);
            let distance = one.distance * direction.length();
            assert_eq!((one.body, one.triangle, distance), all, "{pixel} {level:?}");
            count += usize::from(one.body != NO_BODY);
        }
    }
    count
}

fn random(state: &mut u64) -> f64 {
    *state = crate::numeric::random::mix(*state);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
fn groups_of_rays_hit_what_rays_hit_one_by_one() {
    let mut count = 0;
    for seed in 0..60 {
        let mut state = 1000 + seed;
        let mut unit = || 2.0 * random(&mut state) - 1.0;
        // Bodies of triangle soup, from a tenth of a millimetre to a hundred metres, at, around and far from the
        // sensor.
        let scale = 10_f64.powf(3.0 * unit() - 1.0);
        let num_bodies = 1 + seed as usize % 5;
        let (mut surfaces, mut poses) = (Vec::new(), Vec::new());
        for _ in 0..num_bodies {
            let fineness = if unit() > 0.0 { 0.05 } else { 1.0 };
            let offset = if seed % 7 == 0 { 1000.0 } else { 0.0 };
            let mut vertices = Vec::new();
            for _ in 0..(20.0 + 180.0 * unit().abs()) as usize {
                let place = scale * DVec3::new(unit(), unit(), unit()) + offset;
                for _ in 0..3 {
                    vertices.push(place + fineness * scale * DVec3::new(unit(), unit(), unit()));
                }
            }
            // Doubles, and neighbours that share corners.
            let mut triangles: Vec<[u32; 3]> = (0..vertices.len() as u32 / 3)
                .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
                .collect();
            triangles.extend((0..10).map(|i| [i, i + 1, i + 4]));
            triangles.extend((0..5).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]));
            surfaces.push(Arc::new(
                Surface::new(&vertices, &triangles, ShadingMode::Flat).unwrap(),
            ));
            let rotation = DMat3::from_euler(glam::EulerRot::XYZ, 3.0 * unit(), 3.0 * unit(), 3.0 * unit());
            let forward = DVec3::X * scale * (1.0 + unit());
            poses.push(Pose {
                rotation,
                translation: forward - rotation * DVec3::splat(offset),
            });
        }
        let half = 0.3 + 0.6 * unit().abs();
        let plane = ImagePlane::centered(19 + seed as usize % 9, 22, half, 0.5);
        count += check(&PosedScene::new(surfaces, poses), &plane);
    }
    assert!(count > 10_000, "{count}");
}

#[test]
fn rays_at_edges_and_corners_of_a_grid_are_met_by_groups() {
    // A wall of squares whose edges and corners are where pixels look, at several distances and from its plane.
    for (distance, cells) in [(1.0, 16), (1e3, 16), (1e-3, 32), (7.3, 8)] {
        let mut vertices = Vec::new();
        for row in 0..=cells {
            for column in 0..=cells {
                let place = |i: usize| (2.0 * i as f64 / cells as f64 - 1.0) * distance;
                vertices.push(DVec3::new(distance, place(column), place(row)));
            }
        }
        let mut triangles = Vec::new();
        for row in 0..cells as u32 {
            for column in 0..cells as u32 {
                let (a, b) = (
                    row * (cells as u32 + 1) + column,
                    (row + 1) * (cells as u32 + 1) + column,
                );
                triangles.extend([[a, a + 1, b], [a + 1, b + 1, b]]);
            }
        }
        let wall = Arc::new(Surface::new(&vertices, &triangles, ShadingMode::Flat).unwrap());
        let mut plane = ImagePlane::centered(cells, cells, 1.0, 1.0);
        (plane.axis_row, plane.axis_column) = (plane.axis_row - 0.5, plane.axis_column - 0.5);
        let scene = PosedScene::new(vec![wall.clone()], vec![Pose::IDENTITY]);
        let hits = check(&scene, &plane) / Level::available().len();
        assert_eq!(hits, cells * cells);
        check(&PosedScene::new(vec![wall], vec![at(-distance, 0.3)]), &plane);
    }
}

/// A room of six walls round the sensor, of `side` metres, and ten small squares in front of it.
pub fn furnished() -> (Vec<Arc<Surface>>, Vec<Pose>) {
    let mut surfaces = vec![square(4.0)];
    let mut poses = vec![at(6.0, 0.0)];
    for i in 0..10 {
        let place = DVec3::new(3.0, 0.4 * f64::from(i % 5) - 0.8, 0.5 * f64::from(i / 5) - 0.25);
        surfaces.push(square(0.05 + 0.01 * f64::from(i)));
        poses.push(Pose {
            rotation: DMat3::from_rotation_z(0.1 * f64::from(i)),
            translation: place,
        });
    }
    (surfaces, poses)
}

#[test]
fn points_are_occluded_by_bodies_whether_searches_end_early_or_not() {
    let (surfaces, poses) = furnished();
    let scene = PosedScene::new(surfaces, poses);
    let mut state = 5;
    let mut unit = || 2.0 * random(&mut state) - 1.0;
    let points: Vec<DVec3> = (0..5000)
        .map(|_| DVec3::new(4.0 + 4.0 * unit(), 2.0 * unit(), 2.0 * unit()))
        .collect();
    let occluded = scene.occluded(&points, true).is_occluded;
    assert_eq!(occluded, scene.occluded(&points, false).is_occluded);
    let behind_wall = points.iter().zip(&occluded).filter(|(p, _)| p.x > 6.0);
    assert!(behind_wall.clone().count() > 500 && behind_wall.clone().all(|(_, occluded)| *occluded));
    let before = points.iter().zip(&occluded).filter(|(p, _)| p.x < 2.9);
    assert!(before.clone().count() > 500 && before.clone().all(|(_, occluded)| !occluded));
    let between = points.iter().zip(&occluded).filter(|(p, _)| p.x > 3.2 && p.x < 6.0);
    assert!(between.clone().any(|(_, occluded)| *occluded) && between.clone().any(|(_, occluded)| !occluded));
}

#[test]
fn searches_end_early_where_boxes_overlap() {
    // Slanting squares one behind the other: a ray enters the boxes of all before it meets the first.
    let poses = [3.0, 3.1, 3.2].map(|x| at(x, 0.8)).to_vec();
    let scene = PosedScene::new(vec![square(1.0); 3], poses);
    let points: Vec<DVec3> = (0..100).map(|i| DVec3::new(6.0, 0.01 * f64::from(i), 0.0)).collect();
    let [first, nearest] = [true, false].map(|ends_early| scene.occluded(&points, ends_early));
    assert_eq!((first.ended_early, nearest.ended_early), (100, 0));
    assert!(first.is_occluded == [true; 100] && nearest.is_occluded == [true; 100]);
    // Where nothing is in the way a search goes to its end.
    let above: Vec<DVec3> = points.iter().map(|p| p.with_z(4.0)).collect();
    let free = scene.occluded(&above, true);
    assert!(free.ended_early == 0 && free.is_occluded == [false; 100]);
}

#[test]
fn nearer_body_occludes_the_one_behind() {
    let scene = PosedScene::new(vec![square(2.0), square(0.1)], vec![at(3.0, 0.0), at(2.0, 0.0)]);
    let hits = scene.cast_image(&PLANE).unwrap();
    let middle = 8 * 23 + 11;
    assert_eq!((hits.body[middle], hits.distance[middle]), (1, 2.0));
    assert_eq!(hits.body[0], 0);
    let w = PLANE.direction(0, 0).x.recip();
    assert!((hits.distance[0] - 3.0 * w).abs() < 1e-14);
}

#[test]
fn misses_are_data() {
    let scene = PosedScene::new(vec![square(0.5)], vec![at(-1.0, 0.0)]);
    let hits = scene.cast_image(&PLANE).unwrap();
    assert!(hits.distance.iter().all(|d| d.is_infinite()) && hits.body.iter().all(|b| *b == NO_BODY));
    let empty = PosedScene::new(vec![], vec![]).cast_image(&PLANE).unwrap();
    assert!(empty.body.iter().all(|b| *b == NO_BODY));
}

#[test]
fn a_turned_body_is_met_at_its_turned_plane() {
    let angle = 0.7_f64;
    let scene = PosedScene::new(vec![square(5.0)], vec![at(2.0, angle)]);
    let hits = scene.cast_image(&PLANE).unwrap();
    let normal = DVec3::new(angle.cos(), angle.sin(), 0.0);
    for row in 0..PLANE.rows {
        for column in 0..PLANE.columns {
            let expected = 2.0 * normal.x / normal.dot(PLANE.direction(row, column));
            let got = hits.distance[row * PLANE.columns + column];
            assert!((got - expected).abs() < 1e-12 * expected, "{got} {expected}");
        }
    }
}
