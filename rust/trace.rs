//! Two levels of trees: surfaces with poses, and what the rays of an image hit.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::bundle::{Bundle, MOST_RAYS, Visit, farthest};
use crate::bvh::{Bounds, Ray, Tree, WideTree};
use crate::error::{Result, fits_memory};
use crate::motion::Pose;
use crate::rays::{ImagePlane, Tile};
use crate::simd::{Isa, Level};
use crate::surface::Surface;

/// Body number of a ray that hit nothing.
pub const NO_BODY: u32 = u32::MAX;

/// Nearer than this a camera ray does not hit: the antenna's own place [m].
const NEAREST: f64 = 1e-9;

/// Surfaces at their places in the sensor frame at one time.
pub struct Snapshot {
    surfaces: Vec<Arc<Surface>>,
    poses: Vec<Pose>,
    /// Tree over the boxes of the bodies that have triangles; its primitive `i` is body `bodies[i]`.
    top: Tree,
    /// The same tree for bundles of rays.
    wide: WideTree,
    bodies: Vec<u32>,
}

/// Nearest surface along a ray.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray [m]; infinite where nothing was hit.
    pub distance: f64,
    /// Number of the body, or [`NO_BODY`].
    pub body: u32,
    /// Number of the triangle in the body's surface.
    pub triangle: u32,
    /// Weights of the triangle's corners.
    pub barycentric: [f64; 3],
}

impl Hit {
    /// Nothing was hit.
    pub const MISS: Self = Self {
        distance: f64::INFINITY,
        body: NO_BODY,
        triangle: u32::MAX,
        barycentric: [0.0; 3],
    };
}

/// Hits of all pixels of an image, row by row.
pub struct Hits {
    /// The image they belong to.
    pub plane: ImagePlane,
    /// Distance along the ray [m]; infinite where nothing was hit.
    pub distance: Vec<f64>,
    /// Number of the body, or [`NO_BODY`].
    pub body: Vec<u32>,
    /// Number of the triangle in the body's surface.
    pub triangle: Vec<u32>,
    /// Weights of the triangle's corners.
    pub barycentric: Vec<[f64; 3]>,
}

impl Hits {
    /// The hit of one pixel.
    pub fn get(&self, pixel: usize) -> Hit {
        Hit {
            distance: self.distance[pixel],
            body: self.body[pixel],
            triangle: self.triangle[pixel],
            barycentric: self.barycentric[pixel],
        }
    }
}

impl Snapshot {
    /// Put surface `i` at pose `i`. Trees of surfaces stay as they are; only the few boxes above are sorted anew.
    pub fn new(surfaces: Vec<Arc<Surface>>, poses: Vec<Pose>) -> Self {
        let with_triangles = |i: &u32| surfaces[*i as usize].num_triangles() > 0;
        let bodies: Vec<u32> = (0..surfaces.len() as u32).filter(with_triangles).collect();
        let boxes: Vec<Bounds> = bodies
            .iter()
            .map(|&i| {
                Bounds::of(
                    surfaces[i as usize]
                        .bounds()
                        .corners()
                        .map(|c| poses[i as usize].point(c)),
                )
            })
            .collect();
        let top = Tree::build(&boxes);
        Self {
            surfaces,
            poses,
            wide: top.widen(1),
            top,
            bodies,
        }
    }

    /// Surface of a body.
    pub fn surface(&self, body: u32) -> &Surface {
        &self.surfaces[body as usize]
    }

    /// Pose of a body in the sensor frame.
    pub fn pose(&self, body: u32) -> &Pose {
        &self.poses[body as usize]
    }

    /// Number of bodies, with triangles or without.
    pub fn num_bodies(&self) -> usize {
        self.surfaces.len()
    }

    /// Nearest hit of one ray of the sensor frame (unit direction); of several at the same distance the first body's.
    pub fn cast(&self, ray: &Ray) -> Hit {
        let mut best = Hit::MISS;
        self.top.walk(ray, f64::INFINITY, |i, far| {
            let body = self.bodies[i as usize];
            let pose = &self.poses[body as usize];
            let local = Ray {
                origin: pose.point_to_body(ray.origin),
                direction: pose.direction_to_body(ray.direction),
                start: ray.start,
            };
            let Some(hit) = self.surfaces[body as usize].nearest(&local, far) else {
                return far;
            };
            if hit.distance < best.distance || (hit.distance <= best.distance && body < best.body) {
                best = Hit {
                    distance: hit.distance,
                    body,
                    triangle: hit.triangle,
                    barycentric: hit.barycentric,
                };
            }
            best.distance
        });
        best
    }

    /// Hits of all pixels, tile by tile in parallel: those of rays one by one, [`Self::cast`], to the last bit.
    pub fn cast_image(&self, plane: &ImagePlane) -> Result<Hits> {
        self.cast_image_at(plane, Level::best())
    }

    /// The same with an instruction set.
    pub fn cast_image_at(&self, plane: &ImagePlane, level: Level) -> Result<Hits> {
        plane.check()?;
        // Twice: by tiles and, copied from them, by rows.
        fits_memory("hits", &[plane.rows, plane.columns], 2 * size_of::<Hit>())?;
        let num_pixels = plane.num_pixels();
        let mut hits = Hits {
            plane: *plane,
            distance: vec![f64::INFINITY; num_pixels],
            body: vec![NO_BODY; num_pixels],
            triangle: vec![u32::MAX; num_pixels],
            barycentric: vec![[0.0; 3]; num_pixels],
        };
        let tiles: Vec<(Tile, [Hit; MOST_RAYS])> = (0..plane.num_tiles())
            .into_par_iter()
            .map(|index| {
                let tile = plane.tile(index);
                (tile, self.cast_tile(plane, &tile, level))
            })
            .collect();
        for (tile, tile_hits) in tiles {
            for row in 0..tile.rows {
                for column in 0..tile.columns {
                    let hit = &tile_hits[row * tile.columns + column];
                    let pixel = (tile.row + row) * plane.columns + tile.column + column;
                    hits.distance[pixel] = hit.distance;
                    hits.body[pixel] = hit.body;
                    hits.triangle[pixel] = hit.triangle;
                    hits.barycentric[pixel] = hit.barycentric;
                }
            }
        }
        Ok(hits)
    }

    /// Hits of one tile, row by row.
    fn cast_tile(&self, plane: &ImagePlane, tile: &Tile, level: Level) -> [Hit; MOST_RAYS] {
        let mut directions = [DVec3::ZERO; MOST_RAYS];
        let num_rays = tile.rows * tile.columns;
        for (i, direction) in directions[..num_rays].iter_mut().enumerate() {
            *direction = plane.direction(tile.row + i / tile.columns, tile.column + i % tile.columns);
        }
        let directions = &directions[..num_rays];
        let mut hits = [Hit::MISS; MOST_RAYS];
        let bodies = Bodies {
            snapshot: self,
            level,
            directions,
            best: [f64::INFINITY; MOST_RAYS],
            hits: &mut hits,
        };
        Bundle::new(DVec3::ZERO, directions).walk(level, &self.wide, f32::INFINITY, bodies);
        hits
    }
}

/// Casts the rays of a tile at bodies.
struct Bodies<'a> {
    snapshot: &'a Snapshot,
    level: Level,
    directions: &'a [DVec3],
    best: [f64; MOST_RAYS],
    hits: &'a mut [Hit; MOST_RAYS],
}

impl Visit for Bodies<'_> {
    #[inline(always)] // part of a kernel
    fn visit<I: Isa>(&mut self, leaf: usize, count: usize) -> Option<f32> {
        let snapshot = self.snapshot;
        for i in &snapshot.wide.leaves[leaf][..count] {
            let body = snapshot.bodies[*i as usize];
            let pose = &snapshot.poses[body as usize];
            let mut rays = [Ray {
                origin: pose.point_to_body(DVec3::ZERO),
                direction: DVec3::ZERO,
                start: NEAREST,
            }; MOST_RAYS];
            for (ray, direction) in rays.iter_mut().zip(self.directions) {
                ray.direction = pose.direction_to_body(*direction);
            }
            let hits = &mut *self.hits;
            let surface = &snapshot.surfaces[body as usize];
            surface.search(
                self.level,
                &rays[..self.directions.len()],
                &mut self.best,
                |ray, hit| {
                    let best = &mut hits[ray];
                    if hit.distance < best.distance || (body, hit.triangle) < (best.body, best.triangle) {
                        *best = Hit {
                            distance: hit.distance,
                            body,
                            triangle: hit.triangle,
                            barycentric: hit.barycentric,
                        };
                    }
                    best.distance
                },
            );
        }
        Some(farthest(&self.best[..self.directions.len()]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::ShadingMode;
    use glam::DMat3;

    fn square(half: f64) -> Arc<Surface> {
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

    /// Every pixel as [`Snapshot::cast`] sees it, whatever the instruction set.
    fn check(scene: &Snapshot, plane: &ImagePlane) -> usize {
        let mut count = 0;
        for level in Level::available() {
            let hits = scene.cast_image_at(plane, level).unwrap();
            for pixel in 0..plane.num_pixels() {
                let direction = plane.direction(pixel / plane.columns, pixel % plane.columns);
                let ray = Ray {
                    origin: DVec3::ZERO,
                    direction,
                    start: NEAREST,
                };
                let (one, all) = (scene.cast(&ray), hits.get(pixel));
                assert_eq!((one.body, one.triangle), (all.body, all.triangle), "{pixel} {level:?}");
                assert_eq!(
                    (one.distance, one.barycentric),
                    (all.distance, all.barycentric),
                    "{pixel}"
                );
                count += usize::from(one.body != NO_BODY);
            }
        }
        count
    }

    fn random(state: &mut u64) -> f64 {
        *state = crate::hash::mix(*state);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    }

    #[test]
    fn bundles_of_rays_hit_what_rays_hit_one_by_one() {
        let mut count = 0;
        for seed in 0..60 {
            let mut state = 1000 + seed;
            let mut unit = || 2.0 * random(&mut state) - 1.0;
            // Bodies of triangle soup, from a tenth of a millimetre to a hundred metres, at, around and far from the sensor.
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
            count += check(&Snapshot::new(surfaces, poses), &plane);
        }
        assert!(count > 10_000, "{count}");
    }

    #[test]
    fn rays_at_edges_and_corners_of_a_grid_are_met_by_bundles() {
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
            let scene = Snapshot::new(vec![wall.clone()], vec![Pose::IDENTITY]);
            let hits = check(&scene, &plane) / Level::available().len();
            assert_eq!(hits, cells * cells);
            check(&Snapshot::new(vec![wall], vec![at(-distance, 0.3)]), &plane);
        }
    }

    #[test]
    fn nearer_body_hides_the_one_behind() {
        let scene = Snapshot::new(vec![square(2.0), square(0.1)], vec![at(3.0, 0.0), at(2.0, 0.0)]);
        let hits = scene.cast_image(&PLANE).unwrap();
        let middle = 8 * 23 + 11;
        assert_eq!((hits.body[middle], hits.distance[middle]), (1, 2.0));
        assert_eq!(hits.body[0], 0);
        let w = PLANE.direction(0, 0).x.recip();
        assert!((hits.distance[0] - 3.0 * w).abs() < 1e-14);
    }

    #[test]
    fn misses_are_data() {
        let scene = Snapshot::new(vec![square(0.5)], vec![at(-1.0, 0.0)]);
        let hits = scene.cast_image(&PLANE).unwrap();
        assert!(hits.distance.iter().all(|d| d.is_infinite()) && hits.body.iter().all(|b| *b == NO_BODY));
        let empty = Snapshot::new(vec![], vec![]).cast_image(&PLANE).unwrap();
        assert!(empty.body.iter().all(|b| *b == NO_BODY));
    }

    #[test]
    fn a_turned_body_is_met_at_its_turned_plane() {
        let angle = 0.7_f64;
        let scene = Snapshot::new(vec![square(5.0)], vec![at(2.0, angle)]);
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
}
