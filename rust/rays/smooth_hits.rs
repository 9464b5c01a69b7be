//! Smooth hits: distance and normal of the curved surface that a mesh approximates, tile by tile.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::geometry::curved_triangle::MAX_CORRECTED_COSINE;
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::rays::camera::{TILE, Tile};
use crate::rays::hits::Hits;
use crate::rays::packet::{MOST_RAYS, PACKET, PACKETS, TileRays};
use crate::rays::scene::{NO_BODY, PosedScene};

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
        bands.for_each(|(index, ((cosine, distance), normal))| {
            level.run(ShadeBand {
                scene,
                hits,
                index,
                cosine,
                distance,
                normal,
            });
        });
        smooth
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

    #[inline(always)] // see `Kernel`
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
    #[inline(always)]
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

    #[inline(always)]
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

/// Smooth hits of the rays of a tile; see [`SmoothHits`].
pub struct Shade {
    /// Cosine of incidence.
    pub cosine: [f64; MOST_RAYS],
    /// Distance to the curved surface [m].
    pub distance: [f64; MOST_RAYS],
    /// Unit normal in the sensor frame, axis by axis.
    normal: [[f64; MOST_RAYS]; 3],
}

impl Shade {
    /// Shade of rays that hit nothing.
    pub const NOTHING: Self = Self {
        cosine: [0.0; MOST_RAYS],
        distance: [f64::INFINITY; MOST_RAYS],
        normal: [[0.0; MOST_RAYS]; 3],
    };

    /// Unit normal at the hit of a ray, in the sensor frame.
    pub fn normal_of(&self, ray: usize) -> DVec3 {
        let [x, y, z] = &self.normal;
        DVec3::new(x[ray], y[ray], z[ray])
    }

    /// Shade the hits of a tile, all rays of one triangle together, as [`crate::geometry::curved_triangle::shade`]
    /// does. Distances and normals are computed only if `ALL`.
    #[inline(always)]
    pub fn fill<I: Isa, const ALL: bool>(
        &mut self,
        scene: &PosedScene,
        rays: &TileRays,
        bodies: &[[u32; PACKET]; PACKETS],
        triangles: &[[u32; PACKET]; PACKETS],
        distances: &[f64; MOST_RAYS],
    ) {
        let lanes = I::F64::LANES;
        let zero = <I::F64 as Vector>::splat(0.0);
        let mut rest = [0; PACKETS];
        for packet in 0..PACKETS {
            rest[packet] = rays.valid[packet] & !I::equal(&bodies[packet], NO_BODY);
            for first in (packet * PACKET..(packet + 1) * PACKET).step_by(lanes) {
                zero.store(&mut self.cosine[first..]);
                if ALL {
                    I::F64::load(&distances[first..]).store(&mut self.distance[first..]);
                    for axis in 0..3 {
                        zero.store(&mut self.normal[axis][first..]);
                    }
                }
            }
        }
        for packet in 0..PACKETS {
            while rest[packet] != 0 {
                let lane = rest[packet].trailing_zeros() as usize;
                let (body, triangle) = (bodies[packet][lane], triangles[packet][lane]);
                let facet = ShadedTriangle::new(scene, body, triangle);
                let view = scene.view(body);
                for other in packet..PACKETS {
                    let same = rest[other] & I::equal(&triangles[other], triangle) & I::equal(&bodies[other], body);
                    rest[other] &= !same;
                    for half in 0..PACKET / lanes {
                        let bits = same >> (half * lanes) & 0xff;
                        if bits == 0 {
                            continue;
                        }
                        let first = other * PACKET + half * lanes;
                        let (u, v) = (I::F64::load(&rays.u[first..]), I::F64::load(&rays.v[first..]));
                        let length = <I::F64 as Vector>::splat(1.0).add(u.mul(u)).add(v.mul(v)).sqrt();
                        let distance = I::F64::load(&distances[first..]);
                        let (cosine, correction, normal) = facet.shade(view.direction(u, v), length, distance);
                        let keep = I::F64::load(&self.cosine[first..]);
                        cosine.select(bits, keep).store(&mut self.cosine[first..]);
                        if ALL {
                            let keep = I::F64::load(&self.distance[first..]);
                            let corrected = distance.add(correction);
                            corrected.select(bits, keep).store(&mut self.distance[first..]);
                            let normal = turn(&scene.pose(body).rotation, normal);
                            for axis in 0..3 {
                                let keep = I::F64::load(&self.normal[axis][first..]);
                                normal[axis].select(bits, keep).store(&mut self.normal[axis][first..]);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Triangle in the frame of its body, prepared to shade all rays that meet it.
struct ShadedTriangle {
    /// First corner relative to the sensor [m].
    corner: DVec3,
    /// Normal of twice the area's length, and the inverse of that length.
    face: DVec3,
    inverse: f64,
    smooth: Option<Smooth>,
}

/// Data of a triangle that approximates a curved surface.
struct Smooth {
    /// Vectors whose scalar products with a point relative to the first corner are the weights of the second and the
    /// third.
    weights: [DVec3; 2],
    /// Normal at the first corner, and differences of the other two from it.
    normal: DVec3,
    turns: [DVec3; 2],
    /// Heights of the second and the third corner over the first, along the normals at them [m].
    heights: [f64; 2],
}

impl ShadedTriangle {
    #[inline(always)]
    fn new(scene: &PosedScene, body: u32, triangle: u32) -> Self {
        let (surface, view) = (scene.surface(body), scene.view(body));
        let [a, b, c] = surface.corners(triangle);
        let (first, second) = (b - a, c - a);
        let face = first.cross(second);
        let square = face.length_squared();
        let mut facet = Self {
            corner: a - view.origin,
            face,
            inverse: square.sqrt().recip(),
            smooth: None,
        };
        if let Some([a, b, c]) = surface.corner_normals(triangle) {
            let scale = square.recip();
            facet.smooth = Some(Smooth {
                weights: [second.cross(face) * scale, face.cross(first) * scale],
                normal: a,
                turns: [b - a, c - a],
                heights: [first.dot(b), second.dot(c)],
            });
        }
        facet
    }

    /// Cosine of incidence, distance from the triangle to the curved surface along the ray [m], and unit normal on the
    /// incident side, from directions, their lengths, and distances along them [m].
    #[inline(always)]
    fn shade<V: Vector<Scalar = f64>>(&self, direction: [V; 3], length: V, distance: V) -> (V, V, [V; 3]) {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let inverse = one.div(length);
        let face = vector::<V>(self.face);
        let slope = dot(face, direction);
        // Sign that turns the normal to the incident side.
        let side = V::splat(-1.0).select(zero.at_most(slope), one);
        let turn = side.mul(V::splat(self.inverse));
        let mut normal = scale(face, turn);
        let mut cosine = slope.mul(turn).mul(inverse);
        let mut correction = zero;
        if let Some(smooth) = &self.smooth {
            let mut place = scale(direction, distance.mul(inverse));
            let corner = vector::<V>(self.corner);
            for axis in 0..3 {
                place[axis] = place[axis].sub(corner[axis]);
            }
            let second = dot(vector::<V>(smooth.weights[0]), place);
            let third = dot(vector::<V>(smooth.weights[1]), place);
            let mut mean = vector::<V>(smooth.normal);
            let (turn, other) = (vector::<V>(smooth.turns[0]), vector::<V>(smooth.turns[1]));
            for axis in 0..3 {
                mean[axis] = other[axis].mul_add(third, turn[axis].mul_add(second, mean[axis]));
            }
            let unit = side.div(dot(mean, mean).sqrt());
            let curved = dot(mean, direction).mul(unit).mul(inverse);
            let is_curved = curved.at_most(V::splat(MAX_CORRECTED_COSINE));
            let height = second
                .mul(V::splat(smooth.heights[0]))
                .add(third.mul(V::splat(smooth.heights[1])))
                .sub(dot(mean, place))
                .mul(side);
            correction = height.div(curved.add(curved)).select(is_curved, correction);
            cosine = curved.select(is_curved, cosine);
            let mean = scale(mean, unit);
            for axis in 0..3 {
                normal[axis] = mean[axis].select(is_curved, normal[axis]);
            }
        }
        (zero.sub(cosine).max(zero).min(one), correction, normal)
    }
}

#[inline(always)]
fn vector<V: Vector<Scalar = f64>>(x: DVec3) -> [V; 3] {
    [V::splat(x.x), V::splat(x.y), V::splat(x.z)]
}

#[inline(always)]
fn dot<V: Vector>(a: [V; 3], b: [V; 3]) -> V {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
}

#[inline(always)]
fn scale<V: Vector>(a: [V; 3], by: V) -> [V; 3] {
    [a[0].mul(by), a[1].mul(by), a[2].mul(by)]
}

#[inline(always)]
fn turn<V: Vector<Scalar = f64>>(rotation: &DMat3, x: [V; 3]) -> [V; 3] {
    let (a, b, c) = (
        vector::<V>(rotation.x_axis),
        vector::<V>(rotation.y_axis),
        vector::<V>(rotation.z_axis),
    );
    let mut turned = x;
    for axis in 0..3 {
        turned[axis] = c[axis].mul_add(x[2], b[axis].mul_add(x[1], a[axis].mul(x[0])));
    }
    turned
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
