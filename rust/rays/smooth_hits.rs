//! Smooth hits: distance and normal of the curved surface that a mesh approximates, tile by tile.

use glam::DVec3;
use rayon::prelude::*;

use crate::cancel::Cancel;
use crate::error::Result;
use crate::numeric::simd::{Isa, Kernel, Level};
use crate::rays::camera::{TILE, Tile};
use crate::rays::hits::Hits;
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS, TileRays};
use crate::rays::scene::{NO_BODY, PosedScene};
use crate::rays::shade::Shade;

/// Hits on the curved surface that a mesh approximates, for all pixels of an image, row by row.
pub struct SmoothHits {
    /// Cosine of the angle of incidence; zero where nothing was hit.
    pub cosine: Vec<f64>,
    /// Distance along the ray to the curved surface [m]; infinite where nothing was hit.
    pub distance: Vec<f64>,
    /// Unit normal of the curved surface on the incident side, in the sensor frame; zero where nothing was hit.
    pub normal: Vec<DVec3>,
}

impl SmoothHits {
    /// Smooth hits from the hits of an image.
    pub fn new(scene: &PosedScene, hits: &Hits) -> Self {
        Self::at(scene, hits, Level::best())
    }

    /// [`Self::new`] with a given instruction set.
    pub fn at(scene: &PosedScene, hits: &Hits, level: Level) -> Self {
        match Self::shaded(scene, hits, level, &Cancel::default()) {
            Ok(smooth) => smooth,
            Err(_) => unreachable!("nobody asks it to stop"),
        }
    }

    /// [`Self::new`] until a request to stop.
    pub fn until(scene: &PosedScene, hits: &Hits, cancel: &Cancel) -> Result<Self> {
        Self::shaded(scene, hits, Level::best(), cancel)
    }

    fn shaded(scene: &PosedScene, hits: &Hits, level: Level, cancel: &Cancel) -> Result<Self> {
        let num_pixels = hits.plane.num_pixels();
        let mut smooth = Self {
            cosine: vec![0.0; num_pixels],
            distance: vec![0.0; num_pixels],
            normal: vec![DVec3::ZERO; num_pixels],
        };
        let band = TILE * hits.plane.columns;
        let cosine = smooth.cosine.par_chunks_mut(band);
        let distance = smooth.distance.par_chunks_mut(band);
        let normal = smooth.normal.par_chunks_mut(band);
        let bands = cosine.zip_eq(distance).zip_eq(normal).enumerate();
        bands.try_for_each(|(index, ((cosine, distance), normal))| {
            cancel.check()?;
            level.run(ShadeBand {
                scene,
                hits,
                index,
                cosine,
                distance,
                normal,
            });
            Ok(())
        })?;
        Ok(smooth)
    }
}

/// Kernel that shades the pixels of a row of tiles.
struct ShadeBand<'a> {
    scene: &'a PosedScene,
    hits: &'a Hits,
    /// Number of the row of tiles.
    index: usize,
    cosine: &'a mut [f64],
    distance: &'a mut [f64],
    normal: &'a mut [DVec3],
}

impl Kernel for ShadeBand<'_> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let plane = &self.hits.plane;
        let tiles = plane.columns.div_ceil(TILE);
        let mut rays = TileRays::EMPTY;
        let mut seen = Seen::NOTHING;
        let mut shade = Shade::NOTHING;
        for index in 0..tiles {
            let tile = plane.tile(self.index * tiles + index);
            rays.aim::<I>(plane, &tile);
            seen.read(self.hits, &tile);
            shade.fill::<I, true>(self.scene, &rays, &seen.body, &seen.triangle, &seen.distance);
            self.write(&tile, &shade);
        }
    }
}

impl ShadeBand<'_> {
    #[cfg_attr(optimised, inline(always))]
    fn write(&mut self, tile: &Tile, shade: &Shade) {
        let columns = self.hits.plane.columns;
        for row in 0..tile.rows {
            for column in 0..tile.columns {
                let (ray, pixel) = (TileRays::ray(row, column), row * columns + tile.column + column);
                self.cosine[pixel] = shade.cosine[ray];
                self.distance[pixel] = shade.distance[ray];
                self.normal[pixel] = shade.normal_of(ray);
            }
        }
    }
}

/// Hits of a tile, packet by packet.
struct Seen {
    body: [[u32; PACKET]; PACKETS],
    triangle: [[u32; PACKET]; PACKETS],
    distance: [f64; MOST_RAYS],
}

impl Seen {
    const NOTHING: Self = Self {
        body: [[NO_BODY; PACKET]; PACKETS],
        triangle: [[0; PACKET]; PACKETS],
        distance: [f64::INFINITY; MOST_RAYS],
    };

    #[cfg_attr(optimised, inline(always))]
    fn read(&mut self, hits: &Hits, tile: &Tile) {
        self.body = [[NO_BODY; PACKET]; PACKETS];
        for row in 0..tile.rows {
            for column in 0..tile.columns {
                let ray = TileRays::ray(row, column);
                let pixel = (tile.row + row) * hits.plane.columns + tile.column + column;
                self.body[ray / PACKET][ray % PACKET] = hits.body[pixel];
                self.triangle[ray / PACKET][ray % PACKET] = hits.triangle[pixel];
                self.distance[ray] = hits.distance[pixel];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DMat3;

    use super::*;
    use crate::geometry::curved_triangle::shade;
    use crate::geometry::pose::Pose;
    use crate::rays::camera::ImagePlane;
    use crate::rays::hits::Cast;
    use crate::rays::surface::{ShadingMode, Surface};

    /// Bumpy sheet, curved where its triangles meet at small angles, seen from both sides.
    fn sheet() -> Surface {
        let side = 24;
        let mut vertices = Vec::new();
        for i in 0..=side {
            for j in 0..=side {
                let (y, z) = (f64::from(i) / 12.0 - 1.0, f64::from(j) / 12.0 - 1.0);
                vertices.push(DVec3::new(0.4 * (3.0 * y).sin() * (2.0 * z).cos(), y, z));
            }
        }
        let mut triangles = Vec::new();
        for i in 0..side as u32 {
            for j in 0..side as u32 {
                let a = i * (side as u32 + 1) + j;
                let b = a + side as u32 + 1;
                triangles.extend([[a, b, a + 1], [a + 1, b, b + 1]]);
            }
        }
        Surface::new(&vertices, &triangles, ShadingMode::Smooth { crease_angle: 0.16 }).unwrap()
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
            let cast = Cast {
                level,
                with_cosines: true,
                ..Cast::default()
            };
            let hits = scene.cast_image_with(&plane, &cast).unwrap();
            let cosines = hits.cosine.as_ref().unwrap();
            let smooth = SmoothHits::at(&scene, &hits, level);
            let (mut num_curved, mut num_flat) = (0, 0);
            for pixel in 0..plane.num_pixels() {
                let (body, triangle) = (hits.body[pixel], hits.triangle[pixel]);
                if body == NO_BODY {
                    assert_eq!((smooth.cosine[pixel], smooth.normal[pixel]), (0.0, DVec3::ZERO));
                    assert!(smooth.distance[pixel].is_infinite());
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
                assert!((smooth.normal[pixel] - normal).length() < 1e-11, "{pixel} {level:?}");
                assert!((smooth.distance[pixel] - hits.distance[pixel] - correction).abs() < 1e-12);
                let cosine = (-normal.dot(direction.normalize())).clamp(0.0, 1.0);
                assert!((smooth.cosine[pixel] - cosine).abs() < 1e-11);
                assert!((cosines[pixel] - cosine).abs() < 1e-11);
                num_curved += usize::from(correction != 0.0);
                num_flat += usize::from(correction == 0.0);
            }
            assert!(num_curved > 500 && num_flat > 500, "{num_curved} {num_flat}");
        }
    }
}
