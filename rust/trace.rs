//! Two levels of trees: surfaces with poses, and what the rays of an image hit.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::bvh::{Bounds, Ray, Tree};
use crate::error::{Result, fits_memory};
use crate::motion::Pose;
use crate::rays::{ImagePlane, TILE, Tile};
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
        Self {
            surfaces,
            poses,
            top: Tree::build(&boxes),
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

    /// Hits of all pixels, tile by tile in parallel.
    pub fn cast_image(&self, plane: &ImagePlane) -> Result<Hits> {
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
        let tiles: Vec<(Tile, [Hit; TILE * TILE])> = (0..plane.num_tiles())
            .into_par_iter()
            .map(|index| {
                let tile = plane.tile(index);
                (tile, self.cast_tile(plane, &tile))
            })
            .collect();
        for (tile, tile_hits) in tiles {
            for row in 0..tile.rows {
                for column in 0..tile.columns {
                    let hit = &tile_hits[row * TILE + column];
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

    /// Hits of one tile, [`TILE`] per row.
    fn cast_tile(&self, plane: &ImagePlane, tile: &Tile) -> [Hit; TILE * TILE] {
        let mut hits = [Hit::MISS; TILE * TILE];
        for row in 0..tile.rows {
            for column in 0..tile.columns {
                let direction = plane.direction(tile.row + row, tile.column + column);
                let ray = Ray {
                    origin: DVec3::ZERO,
                    direction,
                    start: NEAREST,
                };
                hits[row * TILE + column] = self.cast(&ray);
            }
        }
        hits
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
