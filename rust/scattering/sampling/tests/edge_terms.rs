use super::super::cells::TileCells;
use super::super::context::Context;
use super::super::edge_terms::{CellIndex, steep};
use super::super::residual::block;
use super::*;
use crate::rays::camera::TILE;
use crate::rays::packet::{PACKET, TileRays};

const BASE: ImagePlane = ImagePlane::centered(33, 40, 0.5, 0.6);

fn ends(rcs_floor: f64) -> Refinement {
    Refinement {
        end_points: true,
        ..refinement(rcs_floor)
    }
}

/// Three oblique plates, none of which reaches the border of the image.
fn scene() -> PosedScene {
    let turned = |x: f64, y: f64, z: f64, yaw: f64| Pose {
        rotation: DMat3::from_rotation_z(yaw),
        ..at(x, y, z)
    };
    let sizes = [[2.0, 2.0], [0.2, 0.4], [0.3, 0.2]];
    let surfaces = sizes.map(|[width, height]| plates(&[[0.0, 0.0, width, height]]));
    let poses = vec![
        turned(3.0, 0.0, 0.0, 0.6),
        turned(1.5, -0.4, 0.2, 0.1),
        turned(1.2, 0.3, -0.1, -0.2),
    ];
    PosedScene::new(surfaces.to_vec(), poses)
}

/// Cells that were cast and not split, with those of their tile and their number in it, if any hit a body.
fn leaves(tiles: &Tiles) -> Vec<(CellIndex, Option<(&TileCells, usize)>)> {
    let mut leaves = Vec::new();
    for (depth, level) in tiles.levels.iter().enumerate() {
        let plane = BASE.divided(1 << depth);
        for (tile, split) in level.tiles.iter().zip(&level.split) {
            let first = CellIndex::first(&tile.place);
            for (row, column) in (0..TILE).flat_map(|row| (0..TILE).map(move |column| (row, column))) {
                let cell = TileRays::ray(row, column);
                let place = CellIndex {
                    row: first.row + row,
                    column: first.column + column,
                    ..first
                };
                let is_cast = place.row < plane.rows && place.column < plane.columns;
                let is_cast = is_cast && tile.packets >> (cell / PACKET) & 1 == 1;
                if is_cast && split >> block(row, column) & 1 == 0 {
                    leaves.push((place, tile.cells.as_deref().map(|cells| (cells, cell))));
                }
            }
        }
    }
    leaves
}

#[test]
fn cells_that_were_not_split_cover_the_image_once() {
    let found = tiles(&scene(), BASE, ends(1e-5));
    assert!(found.levels.len() > 4);
    let finest = 1_usize << MAX_LEVEL;
    let (rows, columns) = (BASE.rows * finest, BASE.columns * finest);
    let mut covered = vec![false; rows * columns];
    for (place, _) in leaves(&found) {
        let side = finest >> place.level;
        for row in place.row * side..(place.row + 1) * side {
            let first = row * columns + place.column * side;
            let cells = &mut covered[first..first + side];
            assert!(cells.iter().all(|cell| !cell));
            cells.fill(true);
        }
    }
    assert!(covered.into_iter().all(|cell| cell));
}

#[test]
fn inside_of_an_oblique_wall_is_neither_split_nor_summed() {
    let pose = Pose {
        rotation: DMat3::from_rotation_z(0.9),
        ..at(3.0, 0.0, 0.0)
    };
    let wall = PosedScene::new(vec![plates(&[[0.0, 0.0, 18.0, 18.0]])], vec![pose]);
    let found = tiles(&wall, BASE, ends(1e-6));
    assert_eq!(found.num_rays(), BASE.num_pixels());
    assert_eq!((found.num_hit, found.num_lit), (BASE.num_pixels(), 0));
    assert!(found.pieces.is_empty());
}

#[test]
fn terms_of_all_cells_add_up_to_those_that_are_kept() {
    let (scene, array, settings) = (scene(), array(), ends(1e-5));
    let (found, sector) = (tiles(&scene, BASE, settings), sector(&scene, &array, BASE, settings));
    let context = Context::new(&sector, &[CONDUCTOR; 3], BASE.du);
    let mut all = TilePoints::default();
    for (place, cells) in leaves(&found) {
        let Some((cells, cell)) = cells.filter(|(cells, cell)| cells.hit >> cell & 1 == 1) else {
            continue;
        };
        let plane = BASE.divided(1 << place.level);
        let [u, v] = steep(cells, cell, &plane, &context).map(|is_steep| if is_steep { &[-1, 1][..] } else { &[0] });
        for sides in u.iter().flat_map(|u| v.iter().map(move |v| [*u, *v])) {
            if sides == [0, 0] {
                all.add_center(&context, cells, cell, &plane);
            } else {
                all.add_edge_term(&context, cells, cell, &plane, sides);
            }
        }
    }
    let kept = found.points();
    // Most cells lie at silhouettes, where no term is left out; inside the plates nearly all are.
    assert!(kept.points.len() + 20_000 < all.points.len());
    for order in [0, 1, 2] {
        assert!((0..kept.points.len()).any(|point| kept.order(point) == order));
    }
    // Terms that cancel are large: those of the wall's cells alone are a hundred times its echo.
    let size: f64 = all
        .points
        .iter()
        .zip(&all.weights)
        .enumerate()
        .filter(|(number, _)| all.order(*number) > 0)
        .map(|(_, (point, weight))| 2.0 * weight.norm() / point.position.length_squared())
        .sum();
    for detuned in [-0.05, 0.0, 0.05] {
        let [kept, all] = [&kept, &all].map(|points| transfer(points, WAVENUMBER * (1.0 + detuned)));
        let difference = (kept - all).norm();
        assert!(difference < 1e-3 * size, "{difference} of {kept}, {size}");
    }
}
