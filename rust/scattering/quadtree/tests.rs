use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;

use super::cells::{NONE, SIDES};
use super::*;
use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::pose::Pose;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Cast;
use crate::rays::scene::PosedScene;
use crate::rays::surface::{ShadingMode, Surface};
use crate::rays::tree::Tree;
use crate::scattering::material::{Material, Response};
use crate::scattering::refinement::{MAX_LEVEL, Refinement, SHARE};

fn plate(half: [f64; 2]) -> Arc<Surface> {
    let corner = |y: f64, z: f64| DVec3::new(0.0, y * half[0], z * half[1]);
    let vertices = [
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ];
    Arc::new(Surface::new(&vertices, &[[0, 2, 1], [0, 3, 2]], ShadingMode::Flat).unwrap())
}

fn at(x: f64, y: f64, z: f64, yaw: f64) -> Pose {
    Pose {
        rotation: glam::DMat3::from_rotation_z(yaw),
        translation: DVec3::new(x, y, z),
    }
}

const ISOTROPIC: Pattern = Pattern::Gaussian {
    peak: 1.0,
    azimuth: 0.0,
    elevation: 0.0,
};

fn array() -> Array {
    Array {
        tx: vec![DVec3::ZERO],
        rx: vec![DVec3::ZERO],
        tx_patterns: vec![ISOTROPIC],
        rx_patterns: vec![ISOTROPIC],
        power: 1.0,
        frequency: 60e9,
        polarization: None,
    }
}

const BASE: ImagePlane = ImagePlane::centered(33, 40, 0.5, 0.6);
const REFINEMENT: Refinement<'static> = Refinement {
    beam: None,
    base: BASE,
    rcs_floor: 1e-6,
    follows_echo: false,
    join: 0.0,
    skip_dark: true,
    turns: &[],
    reflections: &[],
    budget: None,
    end_points: true,
};

fn grow(scene: &PosedScene, refinement: &Refinement, previous: Option<(&Quadtree, &Tree)>) -> Quadtree {
    let conductor = Material::Constant(Response {
        reflection: Complex64::from(-1.0),
        albedo: 0.0,
    });
    let materials = vec![conductor; scene.num_bodies()];
    Quadtree::grow(scene, &Cast::default(), &materials, &array(), refinement, previous).unwrap()
}

/// A wall and two plates, of which one is shifted.
fn scene(shift: f64) -> PosedScene {
    scene_of(&[plate([2.0, 2.0]), plate([0.1, 0.2]), plate([0.15, 0.1])], shift)
}

fn scene_of(surfaces: &[Arc<Surface>], shift: f64) -> PosedScene {
    let poses = vec![
        at(3.0, 0.0, 0.0, 0.6),
        at(1.5, -0.4, 0.2, 0.1),
        at(1.2, 0.3 + shift, -0.1, -0.2),
    ];
    PosedScene::new(surfaces.to_vec(), poses)
}

#[test]
fn cells_that_were_not_split_cover_the_image_once() {
    let tree = grow(&scene(0.0), &REFINEMENT, None);
    let finest = 1_usize << MAX_LEVEL;
    let (rows, columns) = (BASE.rows * finest, BASE.columns * finest);
    let mut covered = vec![false; rows * columns];
    for (node, _) in tree.nodes.iter().zip(&tree.parts).filter(|(_, parts)| **parts == NONE) {
        let side = finest >> node.place.level;
        let (row, column) = (node.place.row as usize * side, node.place.column as usize * side);
        for row in row..row + side {
            let cells = &mut covered[row * columns + column..row * columns + column + side];
            assert!(cells.iter().all(|cell| !cell));
            cells.fill(true);
        }
    }
    assert!(covered.into_iter().all(|cell| cell));
}

#[test]
fn what_is_found_does_not_depend_on_threads_nor_on_what_is_known() {
    let alike = |a: &Quadtree, b: &Quadtree| {
        assert_eq!(a.parts, b.parts);
        for (a, b) in a.nodes.iter().zip(&b.nodes) {
            assert_eq!((a.place, a.found, a.residual), (b.place, b.found, b.residual));
        }
    };
    let surfaces = [plate([2.0, 2.0]), plate([0.1, 0.2]), plate([0.15, 0.1])];
    let (before, now) = (scene_of(&surfaces, 0.0), scene_of(&surfaces, 0.01));
    let fresh = grow(&now, &REFINEMENT, None);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    alike(&fresh, &pool.install(|| grow(&now, &REFINEMENT, None)));

    let old = grow(&before, &REFINEMENT, None);
    let moved = now.moved(&before).unwrap();
    let again = grow(&now, &REFINEMENT, Some((&old, &moved)));
    alike(&fresh, &again);
    assert!(again.counts.tiles_reused > 50 && again.counts.rays < fresh.counts.rays);
}

#[test]
fn a_small_target_between_the_rays_of_the_base_grid_is_found() {
    // 6 mm at 2 m, where cells are 60 mm wide.
    let (y, z) = (2.0 * 4.0 * BASE.du, 2.0 * 3.0 * BASE.dv + 0.5 * 2.0 * BASE.dv);
    let scene = PosedScene::new(vec![plate([3e-3, 3e-3])], vec![at(2.0, y, z, 0.0)]);
    let leaves = grow(&scene, &REFINEMENT, None).leaves();
    let area: f64 = leaves.iter().map(|leaf| leaf.cell.du * leaf.cell.dv * 4.0).sum();
    assert!((area / 36e-6 - 1.0).abs() < 0.3, "{area}");
    // One that is less than asked for is not looked for.
    let dim = Refinement {
        rcs_floor: 10.0,
        ..REFINEMENT
    };
    assert!(grow(&scene, &dim, None).leaves().is_empty());
}

#[test]
fn a_thin_tilted_strip_is_found_all_along() {
    // 8 mm x 1 m at 2 m, where cells are 60 mm wide, rolled by 33 and 45 degrees.
    for roll in [0.6, 0.25 * PI] {
        let mut pose = at(2.0, 0.013, 0.007, 0.0);
        pose.rotation = glam::DMat3::from_rotation_x(roll);
        let scene = PosedScene::new(vec![plate([0.5, 4e-3])], vec![pose]);
        let leaves = grow(&scene, &REFINEMENT, None).leaves();
        let area: f64 = leaves.iter().map(|leaf| leaf.cell.du * leaf.cell.dv * 4.0).sum();
        assert!((area / 8e-3 - 1.0).abs() < 0.1, "{roll} {area}");
    }
}

#[test]
fn a_budget_is_kept_and_cells_leave_as_little_open_as_it_pays_for() {
    let needed = grow(&scene(0.0), &REFINEMENT, None).nodes.len();
    let mut last = f64::INFINITY;
    for budget in [needed / 8, needed / 2, 2 * needed] {
        let refinement = Refinement {
            budget: Some(budget),
            ..REFINEMENT
        };
        let tree = grow(&scene(0.0), &refinement, None);
        assert!(tree.counts.rays <= budget);
        assert!(
            tree.nodes.len() >= (budget / 2).min(needed) && tree.nodes.len() <= needed,
            "{} of {budget}, {needed}",
            tree.nodes.len()
        );
        let could_be = (0..tree.nodes.len()).filter(|node| tree.could_be_split(*node));
        let residual = could_be.map(|node| tree.nodes[node].residual).fold(0.0, f64::max);
        assert!(residual <= tree.allowed && tree.allowed < last);
        last = tree.allowed;
    }
    assert_eq!(last, 1.0);
}

#[test]
fn links_are_those_of_the_neighbours_in_the_end() {
    // Steps are taken back where there is a budget.
    let needed = grow(&scene(0.0), &REFINEMENT, None).nodes.len();
    for budget in [None, Some(needed / 2)] {
        let tree = grow(&scene(0.0), &Refinement { budget, ..REFINEMENT }, None);
        let mut num_finer = 0;
        for index in (0..tree.nodes.len()).filter(|index| tree.parts[*index] == NONE) {
            for (link, (axis, side)) in tree.links[index].iter().zip(SIDES) {
                let other = tree.neighbour(index, axis, side);
                assert_eq!(link.other, other.map_or(NONE, |other| other as u32));
                if let Some(other) = other {
                    assert_eq!(link.pair, tree.compare(index, other, axis));
                    num_finer += usize::from(tree.nodes[other].place.level < tree.nodes[index].place.level);
                }
            }
        }
        assert!(num_finer > 100);
    }
}

#[test]
fn the_inside_of_an_oblique_wall_is_neither_split_nor_summed() {
    let wall = PosedScene::new(vec![plate([9.0, 9.0])], vec![at(3.0, 0.0, 0.0, 0.9)]);
    let tree = grow(&wall, &REFINEMENT, None);
    assert_eq!(tree.nodes.len(), BASE.num_pixels());
    assert!(tree.leaves().iter().all(|leaf| leaf.kept == 0));
    // Without edge terms every cell has to be fine enough for its centre to stand for it.
    let centres = Refinement {
        end_points: false,
        ..REFINEMENT
    };
    assert!(grow(&wall, &centres, None).nodes.len() > 10 * BASE.num_pixels());
}

#[test]
fn ends_of_all_cells_add_up_to_those_that_are_kept() {
    // The field of a plate by all ends of its linear cells, and by those that no neighbour cancels.
    let scene = scene(0.0);
    let tree = grow(&scene, &REFINEMENT, None);
    let (mut all, mut kept, mut size) = (Complex64::ZERO, Complex64::ZERO, 0.0);
    for leaf in tree.leaves().iter().filter(|leaf| leaf.has_edge_terms == [true, false]) {
        let cell = leaf.cell;
        let edges = cell.edges(leaf.found.distance, leaf.found.normal);
        let wavenumber = TAU * 60e9 / SPEED_OF_LIGHT;
        for side in 0..2_u8 {
            let there = cell.about([f64::from(side) - 0.5, 0.0]);
            let distance = leaf.found.distance * leaf.found.normal.dot(cell.direction())
                / leaf.found.normal.dot(there.direction());
            let slope = wavenumber * there.edges(distance, leaf.found.normal)[0].dot(there.direction());
            let across = wavenumber * edges[1].dot(cell.direction());
            let end = Complex64::cis(-2.0 * wavenumber * distance)
                * (f64::from(side) - 0.5)
                * (there.solid_angle() / slope * across.sin() / across);
            all += end;
            size += end.norm();
            if leaf.kept >> side & 1 == 1 {
                kept += end;
            }
        }
    }
    let tolerance = SHARE * super::cells::field(&REFINEMENT, 2.0, SPEED_OF_LIGHT / 60e9);
    assert!((all - kept).norm() < 1e-4 * size, "{all} {kept} {size}");
    assert!(size > 1000.0 * tolerance, "{size} {tolerance}");
}
