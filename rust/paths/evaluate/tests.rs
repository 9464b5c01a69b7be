use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::*;
use crate::antennas::array::Array;
use crate::antennas::gain_table::Table;
use crate::antennas::pattern::Pattern;
use crate::geometry::pose::Pose;
use crate::numeric::simd::Isa;
use crate::paths::rows::Rows;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Cast;
use crate::rays::scene::PosedScene;
use crate::rays::smooth_hits::SmoothHits;
use crate::rays::surface::{ShadingMode, Surface as Mesh};
use crate::scattering::material::{Material, Response};
use crate::scattering::physical_optics::Sampling;
use crate::scattering::refinement::Refinement;
use crate::scattering::samples::Samples;
use crate::scattering::sector::Sector;

fn array(pattern: &Pattern) -> Array {
    Array {
        tx: vec![DVec3::new(0.0, 0.01, 0.0), DVec3::new(0.0, -0.03, 0.01)],
        rx: vec![DVec3::ZERO, DVec3::new(0.0, 0.0, 0.02)],
        tx_patterns: vec![pattern.clone(); 2],
        rx_patterns: vec![pattern.clone(); 2],
        power: 2.0,
        frequency: 60e9,
        polarization: None,
        responses: Vec::new(),
    }
}

fn pose(x: f64, y: f64, turn: f64) -> Pose {
    Pose {
        rotation: DMat3::from_euler(glam::EulerRot::XYZ, turn, 0.3 * turn, -0.2),
        translation: DVec3::new(x, y, 0.1),
    }
}

fn plate() -> Arc<Mesh> {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let vertices = corners.map(|[y, z]| DVec3::new(0.0, 0.3 * y, 0.3 * z));
    Arc::new(Mesh::new(&vertices, &[[0, 2, 1], [0, 3, 2]], ShadingMode::Flat).unwrap())
}

/// Most paths of the rows.
const ROW: usize = 128;

struct OfRows<'a>([&'a Kinematics<'a>; 2], &'a Scatterers, &'a Members, Selection);

impl Kernel for OfRows<'_> {
    type Output = Rows<ROW>;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Rows<ROW> {
        let Self([delays, amplitudes], scatterers, members, selection) = self;
        let mut rows = Rows::new(scatterers.num_channels(), [delays.num_nodes, amplitudes.num_nodes]);
        let numbers: Vec<usize> = (selection.first..selection.last)
            .step_by(selection.step)
            .take(ROW)
            .map(|member| members.number(scatterers, member))
            .collect();
        scatterers.rows::<I, ROW>(delays, amplitudes, &numbers, 1024.0, &mut rows);
        rows
    }
}

/// Check rows of four channels, of two nodes of delays and one of amplitudes, times 1024.
fn assert_rows_are(rows: &Rows<ROW>, expected: &Paths, num_paths: usize, strongest: f64) {
    for (row, expected) in expected.delay.chunks(num_paths).enumerate() {
        // Rows are by channel and node, differences to the first node.
        let (node, channel) = (row / 4, row % 4);
        for (i, expected) in expected.iter().enumerate().take(ROW) {
            let [first, this] = [0, node].map(|node| rows.delay[2 * channel + node][i]);
            let delay = if node == 0 { first } else { first + this };
            assert!((delay - expected).abs() <= 1e-15 * expected);
        }
    }
    for (channel, expected) in expected.amplitude.chunks(num_paths).enumerate() {
        for (i, expected) in expected.iter().enumerate().take(ROW) {
            let [re, im] = [&rows.re, &rows.im].map(|rows| f64::from(rows[channel][i]) / 1024.0);
            let error = (Complex64::new(re, im) - expected).norm();
            assert!(error <= 2e-6 * expected.norm() + 1e-7 * strongest, "{error}");
        }
    }
}

/// Material points of adaptive samples.
fn of_cells(
    scene: &PosedScene,
    array: &Array,
    materials: &[Material],
    base: ImagePlane,
    end_points: bool,
) -> Scatterers {
    let refinement = Refinement {
        base,
        rcs_floor: 1e-3,
        follows_echo: false,
        budget: None,
        end_points,
        beam: None,
        join: 1.5,
        skip_dark: true,
        turns: &[],
        reflections: &[],
    };
    let sector = Sector {
        scene,
        array,
        cast: Cast::default(),
        refinement,
    };
    let samples = Samples::new(&[sector], materials, 1, None).unwrap();
    Scatterers::of_samples(&[(scene, array)], &samples, materials, array.clone(), |_| 0)
}

#[test]
fn paths_together_are_those_one_by_one_on_every_instruction_set() {
    let beam = Pattern::Gaussian {
        peak: 3.0,
        azimuth: 2.0,
        elevation: 1.0,
    };
    let all_round = Pattern::Gaussian {
        peak: 3.0,
        azimuth: 0.0,
        elevation: 0.0,
    };
    let angles = [-1.5, 0.0, 1.5];
    let gains = [-20.0, 3.0, -20.0, 0.0, 10.0, 0.0, -20.0, 3.0, -20.0];
    let table = Pattern::Table(Arc::new(Table::new(&angles, &angles, &gains).unwrap()));
    let half_matt = Material::Constant(Response {
        reflection: Complex64::new(-0.7, 0.1),
        albedo: 0.3,
    });
    let plane = ImagePlane::centered(20, 20, 0.6, 0.6);
    let poses = vec![pose(1.0, -0.3, 0.1), pose(1.5, 0.4, -0.3)];
    let scene = PosedScene::new(vec![plate(), plate()], poses.clone());
    for pattern in [beam, all_round, table] {
        let array = array(&pattern);
        let materials = vec![half_matt; 2];
        let hits = scene.cast_image(&plane).unwrap();
        let smooth = SmoothHits::at(&scene, &hits, Level::best());
        let of_pixels = Scatterers::new(
            &scene,
            &hits,
            &smooth,
            &materials,
            array.clone(),
            Sampling::Footprint,
            1,
        );
        let of_cells = [false, true].map(|end_points| of_cells(&scene, &array, &materials, plane, end_points));
        let [of_tiles, of_leaves] = of_cells;
        for scatterers in [of_pixels, of_tiles, of_leaves] {
            let moved = [poses.clone(), vec![pose(1.1, -0.2, 0.4), pose(1.4, 0.5, 1.0)]].concat();
            let kinematics = Kinematics {
                num_nodes: 2,
                num_bodies: 2,
                poses: &moved,
                points: &[DVec3::new(2.0, 0.0, 0.0), DVec3::new(2.1, 0.0, 0.0)],
                rcs: &[1.0],
                vertices: &[],
            };
            // Amplitudes at a time of their own.
            let other = Kinematics {
                num_nodes: 1,
                poses: &moved[2..],
                points: &kinematics.points[1..],
                ..kinematics
            };
            for (first, step) in [(0, 1), (3, 7)] {
                let last = scatterers.len() + 1;
                let members = Members::all(&scatterers, 1);
                let selection = Selection { first, last, step };
                let expected = Paths::of(
                    [2, 1],
                    scatterers.num_channels(),
                    selection,
                    |node, channel, path| scatterers.path(&kinematics, node, channel, path).0,
                    |node, channel, path| scatterers.path(&other, node, channel, path).1,
                );
                let expected = expected.unwrap();
                let strongest = expected.amplitude.iter().fold(0.0, |most: f64, a| most.max(a.norm()));
                assert!(strongest > 0.0 && selection.len() > 20);
                for level in Level::available() {
                    let paths = scatterers
                        .paths_by(&kinematics, &other, &members, selection, level)
                        .unwrap();
                    for (path, expected) in paths.delay.iter().zip(&expected.delay) {
                        assert!((path - expected).abs() <= 1e-15 * expected);
                    }
                    for (path, expected) in paths.amplitude.iter().zip(&expected.amplitude) {
                        assert!((path - expected).norm() <= 1e-13 * strongest, "{path} {expected}");
                    }
                    let rows = level.run(OfRows([&kinematics, &other], &scatterers, &members, selection));
                    assert_rows_are(&rows, &expected, selection.len(), strongest);
                }
            }
        }
    }
}
