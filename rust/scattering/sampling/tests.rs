use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DMat3, DVec3};
use num_complex::Complex64;

use super::*;
use crate::antennas::array::Array;
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::pose::Pose;
use crate::numeric::trig::sinc;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Cast;
use crate::rays::scene::PosedScene;
use crate::rays::surface::{ShadingMode, Surface};
use crate::rays::tests::scenes::{cut_out, grid, join, shaded, star, surface};
use crate::scattering::material::CONDUCTOR;
use crate::scattering::refinement::{MAX_LEVEL, Refinement, Sampling, field_of};
use crate::scattering::reflection_table::Reflection;
use crate::scattering::sector::Sector;
use crate::scattering::surface_image::SurfaceImage;
use crate::scattering::taper::taper;
use crate::scattering::tile_point::{TilePoint, TilePoints};

const FREQUENCY: f64 = 60e9;
const WAVENUMBER: f64 = TAU * FREQUENCY / SPEED_OF_LIGHT;

fn array() -> Array {
    Array::isotropic(&[DVec3::ZERO], &[DVec3::ZERO])
}

/// Boxes in the plane x = 0, as `[y, z, width, height]`, facing the sensor.
fn plates(boxes: &[[f64; 4]]) -> Arc<Surface> {
    let plate = |[y, z, width, height]: &[f64; 4]| {
        let (half_width, half_height) = (0.5 * width, 0.5 * height);
        grid(1, |row, column| {
            DVec3::new(0.0, y + half_width * column, z + half_height * row)
        })
    };
    surface(&boxes.iter().map(plate).reduce(join).unwrap())
}

/// Smooth sphere.
fn sphere(radius: f64) -> Arc<Surface> {
    let mesh = star(32, |corner| radius / corner.length());
    shaded(&mesh, ShadingMode::Smooth { crease_angle: 0.5 })
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose {
        rotation: DMat3::IDENTITY,
        translation: DVec3::new(x, y, z),
    }
}

fn refinement(rcs_floor: f64) -> Refinement {
    Refinement {
        rcs_floor,
        follows_echo: false,
        budget: None,
    }
}

fn tiles(scene: &PosedScene, base: ImagePlane, refinement: Refinement) -> Tiles {
    of_sectors(&[sector(scene, &array(), base, refinement)])
}

fn of_sectors(sectors: &[Sector]) -> Tiles {
    Tiles::new(sectors, &[CONDUCTOR; 4], None).unwrap()
}

/// The one sector of a field of view.
fn sector<'a>(scene: &'a PosedScene, array: &'a Array, plane: ImagePlane, refinement: Refinement) -> Sector<'a> {
    static CONDUCTORS: [Reflection; 4] = [const { Reflection::Constant([-1.0, 0.0]) }; 4];
    Sector {
        scene,
        image: None,
        array,
        reflections: &CONDUCTORS,
        cast: Cast::default(),
        plane,
        beam: None,
        sampling: Sampling::Footprint,
        refinement: Some(refinement),
        join: 0.0,
        has_contours: false,
        skip_aliased: true,
        turns: &[],
        seed: 0,
    }
}

/// Transfer function of material points, `sum w 2 cos exp(-2 j k R) / R^2`, at a wavenumber.
fn transfer(points: &TilePoints, wavenumber: f64) -> Complex64 {
    let numbered = points.points.iter().zip(&points.weights).enumerate();
    numbered
        .map(|(number, (point, weight))| {
            let distance = point.position.length();
            let cosine = -point.normal.dot(point.position) / distance;
            let slopes = points
                .edges(number)
                .map(|edge| wavenumber * edge.dot(point.position) / distance);
            let falls = (WAVENUMBER / wavenumber).powi(i32::from(points.kind(number).frequency_exponent()));
            let size = sinc(slopes[0]) * sinc(slopes[1]) * falls * 2.0 * cosine / (distance * distance);
            weight * size * Complex64::cis(-2.0 * wavenumber * distance)
        })
        .sum()
}

/// Transfer function of a conducting surface of an area that faces the sensor far away, at a distance [m].
fn facing(area: f64, distance: f64) -> Complex64 {
    Complex64::new(0.0, -area / (4.0 * PI)) * Complex64::cis(-2.0 * WAVENUMBER * distance) / (distance * distance)
}

fn decibels(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// Transfer function of the pixels of an image, tapered.
fn of_pixels(scene: &PosedScene, plane: &ImagePlane) -> Complex64 {
    let hits = scene.cast_image(plane, &Cast::default()).unwrap();
    let is_hit = |pixel: &usize| hits.surface_distance[*pixel].is_finite();
    let of_pixel = |pixel: usize| {
        let cell = plane.cell(pixel / plane.columns, pixel % plane.columns);
        let (distance, normal) = (hits.surface_distance[pixel], DVec3::from_array(hits.normal[pixel]));
        let direction = cell.direction();
        let tapers = cell
            .edges(distance, normal)
            .map(|edge| taper(WAVENUMBER * edge.dot(direction)));
        let weight = Complex64::new(0.0, -cell.solid_angle() * tapers[0] * tapers[1] / (8.0 * PI));
        weight * 2.0 * Complex64::cis(-2.0 * WAVENUMBER * distance)
    };
    (0..plane.num_pixels()).filter(is_hit).map(of_pixel).sum()
}

#[test]
fn tiles_split_nowhere_and_everywhere_are_the_pixels_of_the_base_and_of_the_finest_plane() {
    let scene = PosedScene::new(vec![plates(&[[0.0, 0.0, 2.0, 2.0]])], vec![at(0.5, 0.0, 0.0)]);
    // The finest plane of few cells has millions of pixels.
    let coarse = ImagePlane::centered(11, 10, 0.1, 0.12);
    let fine = ImagePlane::centered(1, 9, 0.1, 0.12);
    for (base, rcs_floor, is_adaptive, level) in [
        (coarse, 1.0, false, 0),
        (coarse, 1e6, true, 0),
        (fine, 1e-30, true, MAX_LEVEL),
    ] {
        let tiles = of_sectors(&[Sector {
            refinement: is_adaptive.then_some(refinement(rcs_floor)),
            ..sector(&scene, &array(), base, refinement(rcs_floor))
        }]);
        let plane = base.divided(1 << level);
        let expected = of_pixels(&scene, &plane);
        let got = transfer(&tiles.points(), WAVENUMBER);
        let error = (got - expected).norm() / expected.norm();
        assert!(error < 1e-6, "{level}: {got} {expected}");
        assert_eq!(tiles.num_hit, plane.num_pixels());
        let has_coarse = tiles.num_coarse.map(|number| number > 0);
        assert_eq!(has_coarse, is_adaptive.then_some(level > 0));
    }
}

#[test]
fn image_of_the_hits_of_rays_has_their_points() {
    let plane = ImagePlane::centered(45, 50, 0.3, 0.3);
    let array = array();
    let scene = PosedScene::new(
        vec![sphere(0.1), plates(&[[0.0, 0.0, 0.3, 0.3]])],
        vec![at(1.0, 0.1, 0.0), at(1.6, -0.3, 0.1)],
    );
    let hits = scene.cast_image(&plane, &Cast::default()).unwrap();
    let number = plane.num_pixels();
    let image = SurfaceImage {
        plane,
        distance: hits.surface_distance,
        normal: hits.normal.into_iter().map(DVec3::from_array).collect(),
        reflection: vec![Complex64::from(-1.0); number],
        albedo: vec![0.0; number],
        body: hits.body.into_iter().map(u32::cast_signed).collect(),
        num_bodies: 2,
        range_rate: None,
        age: 0.0,
    };
    for sampling in [Sampling::Footprint, Sampling::Point] {
        let of_scene = Sector {
            sampling,
            refinement: None,
            ..sector(&scene, &array, plane, refinement(1.0))
        };
        let of_image = Sector {
            image: Some(&image),
            ..of_scene
        };
        let [rays, pixels] = [of_scene, of_image].map(|sector| of_sectors(&[sector]).points());
        assert_eq!(rays.points.len(), pixels.points.len());
        for (one, other) in rays.points.iter().zip(&pixels.points) {
            let of = |point: &TilePoint| (point.position, point.normal, point.body);
            assert_eq!(of(one), of(other));
        }
        let largest = rays.weights.iter().map(|weight| weight.norm()).fold(0.0, f64::max);
        for (one, other) in rays.weights.iter().zip(&pixels.weights) {
            assert!((one - other).norm() < 1e-6 * largest, "{one} {other}");
        }
    }
}

#[test]
fn plates_at_borders_of_tiles_keep_their_echo() {
    // A plate about as wide as a cell of the base grid, moved across the borders of cells and tiles.
    let base = ImagePlane::centered(32, 32, 0.15, 0.15);
    let plate = plates(&[[0.0, 0.0, 0.1, 0.1]]);
    for step in 0..12 {
        let place = at(10.0, 0.013 * f64::from(step), 0.007 * f64::from(step));
        let scene = PosedScene::new(vec![plate.clone()], vec![place]);
        let found = tiles(&scene, base, refinement(1e-2));
        // Physical optics of a plate seen at small angles to its normal.
        let [y, z] = [place.translation.y, place.translation.z].map(|offset| sinc(WAVENUMBER * 0.1 * offset / 10.0));
        let level = decibels(transfer(&found.points(), WAVENUMBER).norm() / (facing(0.01, 10.0).norm() * y * z));
        assert!(level.abs() < 0.8, "{step}: {level} dB");
    }
}

#[test]
fn fences_and_rods_thinner_than_cells_keep_their_echo() {
    // Cells of the base grid are 2 cm wide at 2.5 m.
    let base = ImagePlane::centered(128, 128, 0.5, 0.5);
    let bar = |i: i32| [0.037 * f64::from(i) - 0.26, 0.0, 0.004, 0.05];
    for (name, boxes) in [
        ("fence of 4 mm bars", (0..15).map(bar).collect()),
        ("2 mm rod", vec![[0.213, 0.1, 0.002, 0.1]]),
        ("two blades", vec![[0.0, 0.05, 0.012, 0.06], [3e-3, -0.05, 0.012, 0.06]]),
    ] {
        let scene = PosedScene::new(vec![plates(&boxes)], vec![at(2.5, 0.0, 0.0)]);
        let found = tiles(&scene, base, refinement(1e-2));
        // Far-field sum over the plates, each at its distance.
        let echo = |[y, z, width, height]: &[f64; 4]| -> Complex64 {
            let part = |i: i32, size: f64| size * ((f64::from(i) + 0.5) / 40.0 - 0.5);
            let places = (0..1600).map(|i| DVec3::new(2.5, y + part(i / 40, *width), z + part(i % 40, *height)));
            let patch = |place: DVec3| facing(width * height / 1600.0, place.length()) * (2.5 / place.length());
            places.map(patch).sum()
        };
        let expected: Complex64 = boxes.iter().map(echo).sum();
        let level = decibels(transfer(&found.points(), WAVENUMBER).norm() / expected.norm());
        assert!(level.abs() < 1.0, "{name}: {level} dB");
    }
}

#[test]
fn spheres_have_their_cross_section_and_joined_points_change_little() {
    let base = ImagePlane::centered(128, 128, 0.5, 0.5);
    for radius in [0.2, 0.1, 0.05] {
        let scene = PosedScene::new(vec![sphere(radius)], vec![at(1.0, 0.03, 0.02)]);
        let antennas = array();
        let unjoined = sector(&scene, &antennas, base, refinement(1e-4));
        let sectors = |join| [Sector { join, ..unjoined }];
        let separate = of_sectors(&[unjoined]);
        // Reflection at the nearest point of a sphere seen from a distance d of its centre.
        let distance = DVec3::new(1.0, 0.03, 0.02).length();
        let expected = radius / (2.0 * WAVENUMBER) / (2.0 * (distance - radius) * distance);
        let level = decibels(transfer(&separate.points(), WAVENUMBER).norm() / expected);
        assert!(level.abs() < 0.5, "{radius}: {level} dB");
        // The largest phases of joined points in wide, narrow and very narrow bands, and what changes at their ends.
        for (join, detuned, change) in [
            (1.0, 6e-2, 5e-2),
            (1.5, 4e-2, 5e-2),
            (2.5, 24e-3, 5e-2),
            (2.5, 5e-3, 1e-2),
        ] {
            let joined = of_sectors(&sectors(join));
            assert!(joined.points().points.len() < 9 * separate.points().points.len() / 10);
            let at_center = if join > 2.0 { 1e-2 } else { 5e-3 };
            for (detuned, change) in [(0.0, at_center), (-detuned, change), (detuned, change)] {
                let wavenumber = WAVENUMBER * (1.0 + detuned);
                let [a, b] = [&separate, &joined].map(|tiles| transfer(&tiles.points(), wavenumber));
                let got = (a - b).norm() / a.norm();
                assert!(got < change, "{radius} {join} {detuned}: {got}");
            }
        }
    }
}

#[test]
fn parts_that_are_left_out_return_next_to_nothing() {
    let base = ImagePlane::centered(64, 64, 0.5, 0.5);
    let surfaces = vec![sphere(0.2), sphere(0.05), plates(&[[0.0, 0.0, 3.0, 3.0]])];
    let oblique = Pose {
        rotation: DMat3::from_rotation_z(0.6),
        translation: DVec3::new(2.0, 0.0, 0.0),
    };
    let scene = PosedScene::new(surfaces, vec![at(1.2, 0.2, 0.1), at(0.8, -0.2, 0.0), oblique]);
    for rcs_floor in [1e-2, 1e-4] {
        let with = tiles(&scene, base, refinement(rcs_floor));
        let without = of_sectors(&[Sector {
            skip_aliased: false,
            ..sector(&scene, &array(), base, refinement(rcs_floor))
        }]);
        assert!(with.counts.rays < 19 * without.counts.rays / 20);
        for detuned in [-0.05, -0.02, 0.0, 0.03, 0.05] {
            let wavenumber = WAVENUMBER * (1.0 + detuned);
            let [a, b] = [&with, &without].map(|tiles| transfer(&tiles.points(), wavenumber));
            // Echo of the smallest cross-section of interest where the nearest sphere is.
            let least = field_of(rcs_floor, SPEED_OF_LIGHT / FREQUENCY) / (4.0 * PI * 0.8_f64.powi(2));
            assert!((a - b).norm() < 0.1 * least, "{rcs_floor} {detuned}: {a} {b} {least}");
        }
    }
}

#[test]
fn budget_is_kept_by_a_larger_residual_error_everywhere() {
    let base = ImagePlane::centered(64, 64, 0.5, 0.5);
    let scene = PosedScene::new(vec![sphere(0.2)], vec![at(1.0, 0.0, 0.0)]);
    let free = tiles(&scene, base, refinement(1e-5));
    let budget = 8000;
    let settings = Refinement {
        budget: Some(budget),
        ..refinement(1e-5)
    };
    let limited = tiles(&scene, base, settings);
    assert!(free.counts.rays > budget && free.num_coarse == Some(0));
    assert!(limited.rcs_floor > Some(1e-5) && limited.num_coarse > Some(0));
    let [free, limited] = [free, limited].map(|tiles| transfer(&tiles.points(), WAVENUMBER));
    assert!((free - limited).norm() < 0.2 * free.norm());
}

#[test]
fn budget_is_kept_where_small_parts_alone_exceed_it() {
    let bars: Vec<[f64; 4]> = (-100..100).map(|k| [0.012 * f64::from(k), 0.0, 0.001, 2.0]).collect();
    let scene = PosedScene::new(vec![plates(&bars)], vec![at(2.5, 0.0, 0.0)]);
    let base = ImagePlane::centered(64, 64, 0.5, 0.5);
    let fewest = base.rows * base.columns;
    for budget in [fewest, 2 * fewest, 20 * fewest] {
        let settings = Refinement {
            budget: Some(budget),
            ..refinement(1e-2)
        };
        let found = tiles(&scene, base, settings);
        assert!(found.num_rays() <= budget, "{} of {budget}", found.num_rays());
        assert!(found.num_coarse > Some(0));
    }
}

#[test]
fn weak_echoes_alone_in_view_lower_the_floor() {
    let base = ImagePlane::centered(64, 64, 0.5, 0.5);
    let scene = PosedScene::new(vec![sphere(0.02)], vec![at(1.0, 0.0, 0.0)]);
    let settings = Refinement {
        follows_echo: true,
        ..refinement(1e-2)
    };
    let found = tiles(&scene, base, settings);
    // pi r^2 is 1.3e-3 m^2.
    let floor = found.rcs_floor.unwrap();
    assert!((1e-3..1e-2).contains(&floor), "{floor}");
}

#[test]
fn wide_arrays_have_a_weight_per_channel() {
    let base = ImagePlane::centered(64, 64, 0.5, 0.5);
    let scene = PosedScene::new(vec![plates(&[[0.0, 0.0, 0.2, 0.2]])], vec![at(1.0, 0.0, 0.0)]);
    for (offset, number) in [(0.003, 1), (0.3, 2)] {
        let place = DVec3::new(0.0, offset, 0.0);
        let antennas = Array::isotropic(&[place], &[DVec3::ZERO, place]);
        let found = of_sectors(&[sector(&scene, &antennas, base, refinement(1e-2))]);
        assert_eq!(found.num_weights, number);
        assert_eq!(found.points().weights.len(), number * found.points().points.len());
    }
}

#[test]
fn body_on_the_seam_of_two_sectors_echoes_as_in_the_middle_of_one() {
    let array = array();
    let sight = DMat3::from_rotation_z(45.0_f64.to_radians());
    let to_left = DMat3::from_rotation_z(-90.0_f64.to_radians());
    let turned = array.turned(&to_left);
    // The finer the cells, the less the seam matters: one cell of a fan of cells is another.
    let floor = 1e-5;
    for (surface, most) in [(sphere(0.1), 0.3), (plates(&[[0.0, 0.0, 0.1, 0.1]]), 0.1)] {
        let ahead = PosedScene::new(vec![surface.clone()], vec![at(1.0, 0.0, 0.0)]);
        let front = ImagePlane::centered(64, 64, 0.5, 0.5);
        let middle = transfer(&tiles(&ahead, front, refinement(floor)).points(), WAVENUMBER);

        let aside = ahead.turned(&sight);
        let left = aside.turned(&to_left);
        let bases = [
            ImagePlane::centered(64, 128, 1.0, 0.5),
            cut_out(32, 23, 0.7 / 23.0, 1.0 / 32.0, [-0.65, 0.0]),
        ];
        let sectors = [
            sector(&aside, &array, bases[0], refinement(floor)),
            sector(&left, &turned, bases[1], refinement(floor)),
        ];
        let found = of_sectors(&sectors);
        // The points of both are in axes of their own, about one origin.
        let on_seam = transfer(&found.points(), WAVENUMBER);
        let halves = [0, 1].map(|number| found.pieces.iter().filter(|piece| piece.sector == number).count());
        assert!(halves.iter().all(|number| *number > 0), "{halves:?}");
        let ratio = on_seam / middle;
        assert!(
            decibels(ratio.norm()).abs() < most && ratio.arg().abs() < 0.05,
            "{ratio}"
        );
    }
}
