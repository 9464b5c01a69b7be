//! What the pixels of an image show: the curved surface that a facet stands for, its distance and its normal, tile by tile.

use glam::DVec3;
use rayon::prelude::*;

use crate::bundle::{Fan, MOST_RAYS, PACKET, PACKETS};
use crate::rays::{TILE, Tile};
use crate::shading::MAX_CORRECTED_COSINE;
use crate::simd::{Isa, Kernel, Level, Vector};
use crate::trace::{Hits, NO_BODY, Snapshot};

/// What all pixels show, row by row.
pub struct Shown {
    /// Cosine of the angle of incidence; zero where nothing was hit.
    pub cosine: Vec<f64>,
    /// Distance along the ray to the surface that the facets stand for [m]; infinite where nothing was hit.
    pub distance: Vec<f64>,
    /// Its unit normal towards the incident side in the sensor frame; zero where nothing was hit.
    pub normal: Vec<DVec3>,
}

impl Shown {
    /// Of the hits of an image.
    pub fn new(snapshot: &Snapshot, hits: &Hits) -> Self {
        Self::at(snapshot, hits, Level::best())
    }

    /// The same with an instruction set.
    pub fn at(snapshot: &Snapshot, hits: &Hits, level: Level) -> Self {
        let num_pixels = hits.plane.num_pixels();
        let mut shown = Self {
            cosine: vec![0.0; num_pixels],
            distance: vec![0.0; num_pixels],
            normal: vec![DVec3::ZERO; num_pixels],
        };
        let band = TILE * hits.plane.columns;
        let cosine = shown.cosine.par_chunks_mut(band);
        let distance = shown.distance.par_chunks_mut(band);
        let normal = shown.normal.par_chunks_mut(band);
        let bands = cosine.zip_eq(distance).zip_eq(normal).enumerate();
        bands.for_each(|(index, ((cosine, distance), normal))| {
            level.run(ShadeBand {
                snapshot,
                hits,
                index,
                cosine,
                rest: Some((distance, normal)),
            });
        });
        shown
    }

    /// Only the cosines.
    pub fn cosines(snapshot: &Snapshot, hits: &Hits) -> Vec<f64> {
        let mut cosine = vec![0.0; hits.plane.num_pixels()];
        let bands = cosine.par_chunks_mut(TILE * hits.plane.columns).enumerate();
        bands.for_each(|(index, cosine)| {
            Level::best().run(ShadeBand {
                snapshot,
                hits,
                index,
                cosine,
                rest: None,
            });
        });
        cosine
    }
}

/// Shades the pixels of a row of tiles.
struct ShadeBand<'a> {
    snapshot: &'a Snapshot,
    hits: &'a Hits,
    /// Number of the row of tiles.
    index: usize,
    cosine: &'a mut [f64],
    /// Distances and normals, where these are wanted.
    rest: Option<(&'a mut [f64], &'a mut [DVec3])>,
}

/// What the rays of a tile see, packet by packet.
struct Seen {
    body: [[u32; PACKET]; PACKETS],
    triangle: [[u32; PACKET]; PACKETS],
    /// Along the ray [m].
    distance: [f64; MOST_RAYS],
    cosine: [f64; MOST_RAYS],
    /// In the sensor frame, axis by axis.
    normal: [[f64; MOST_RAYS]; 3],
}

impl Kernel for ShadeBand<'_> {
    type Output = ();

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let plane = &self.hits.plane;
        let tiles = plane.columns.div_ceil(TILE);
        let mut fan = Fan::EMPTY;
        let mut seen = Seen {
            body: [[NO_BODY; PACKET]; PACKETS],
            triangle: [[0; PACKET]; PACKETS],
            distance: [0.0; MOST_RAYS],
            cosine: [0.0; MOST_RAYS],
            normal: [[0.0; MOST_RAYS]; 3],
        };
        for index in 0..tiles {
            let tile = plane.tile(self.index * tiles + index);
            fan.aim::<I>(plane, &tile);
            seen.read(self.hits, &tile);
            seen.shade::<I>(self.snapshot, &fan);
            self.write(&tile, &seen);
        }
    }
}

impl ShadeBand<'_> {
    #[inline(always)]
    fn write(&mut self, tile: &Tile, seen: &Seen) {
        let columns = self.hits.plane.columns;
        for row in 0..tile.rows {
            for column in 0..tile.columns {
                let (ray, pixel) = (Fan::ray(row, column), row * columns + tile.column + column);
                self.cosine[pixel] = seen.cosine[ray];
                if let Some((distance, normal)) = &mut self.rest {
                    distance[pixel] = seen.distance[ray];
                    let [x, y, z] = &seen.normal;
                    normal[pixel] = DVec3::new(x[ray], y[ray], z[ray]);
                }
            }
        }
    }
}

impl Seen {
    #[inline(always)]
    fn read(&mut self, hits: &Hits, tile: &Tile) {
        self.body = [[NO_BODY; PACKET]; PACKETS];
        for row in 0..tile.rows {
            for column in 0..tile.columns {
                let ray = Fan::ray(row, column);
                let pixel = (tile.row + row) * hits.plane.columns + tile.column + column;
                self.body[ray / PACKET][ray % PACKET] = hits.body[pixel];
                self.triangle[ray / PACKET][ray % PACKET] = hits.triangle[pixel];
                self.distance[ray] = hits.distance[pixel];
            }
        }
    }

    /// As [`crate::shading::shade`] does, for all rays that meet one triangle.
    #[inline(always)]
    fn shade<I: Isa>(&mut self, snapshot: &Snapshot, fan: &Fan) {
        let splat = <I::F64 as Vector>::splat;
        let lanes = I::F64::LANES;
        let zero = splat(0.0);
        let mut rest = [0; PACKETS];
        for packet in 0..PACKETS {
            rest[packet] = fan.valid[packet] & !I::equal(&self.body[packet], NO_BODY);
            for first in (packet * PACKET..(packet + 1) * PACKET).step_by(lanes) {
                zero.store(&mut self.cosine[first..]);
                for axis in 0..3 {
                    zero.store(&mut self.normal[axis][first..]);
                }
            }
        }
        for packet in 0..PACKETS {
            while rest[packet] != 0 {
                let lane = rest[packet].trailing_zeros() as usize;
                let (body, triangle) = (self.body[packet][lane], self.triangle[packet][lane]);
                let facet = Facet::new(snapshot, body, triangle);
                for other in packet..PACKETS {
                    let same =
                        rest[other] & I::equal(&self.triangle[other], triangle) & I::equal(&self.body[other], body);
                    rest[other] &= !same;
                    for half in 0..PACKET / lanes {
                        let bits = same >> (half * lanes) & 0xff;
                        if bits == 0 {
                            continue;
                        }
                        let first = other * PACKET + half * lanes;
                        let (u, v) = (I::F64::load(&fan.u[first..]), I::F64::load(&fan.v[first..]));
                        let distance = I::F64::load(&self.distance[first..]);
                        let (cosine, correction, normal) = facet.shade(u, v, distance);
                        let keep = I::F64::load(&self.cosine[first..]);
                        cosine.select(bits, keep).store(&mut self.cosine[first..]);
                        let corrected = distance.add(correction);
                        corrected.select(bits, distance).store(&mut self.distance[first..]);
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

/// A triangle in the sensor frame, prepared for all rays that meet it.
struct Facet {
    /// First corner [m].
    corner: DVec3,
    /// Unit normal.
    face: DVec3,
    smooth: Option<Smooth>,
}

/// What a facet of a curved surface has besides.
struct Smooth {
    /// Weight of the second and the third corner: scalar products with the place relative to the first corner.
    weights: [DVec3; 2],
    /// Normal at the first corner, and what the others differ by.
    normal: DVec3,
    turns: [DVec3; 2],
    /// Of the second and the third corner over the plane of its normal through the first.
    heights: [f64; 2],
}

impl Facet {
    fn new(snapshot: &Snapshot, body: u32, triangle: u32) -> Self {
        let (surface, pose) = (snapshot.surface(body), snapshot.pose(body));
        let corners = surface.corners(triangle);
        let (first, second) = (
            pose.direction(corners[1] - corners[0]),
            pose.direction(corners[2] - corners[0]),
        );
        let normal = first.cross(second);
        let smooth = surface.corner_normals(triangle).map(|normals| {
            let [a, b, c] = normals.map(|n| pose.direction(n));
            let square = normal.length_squared();
            Smooth {
                weights: [second.cross(normal) / square, normal.cross(first) / square],
                normal: a,
                turns: [b - a, c - a],
                heights: [first.dot(b), second.dot(c)],
            }
        });
        Self {
            corner: pose.point(corners[0]),
            face: normal.normalize(),
            smooth,
        }
    }

    /// Cosine of incidence, how much farther the curved surface is, and its normal towards the incident side.
    #[inline(always)]
    fn shade<V: Vector<Scalar = f64>>(&self, u: V, v: V, distance: V) -> (V, V, [V; 3]) {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let length = one.add(u.mul(u)).add(v.mul(v)).sqrt();
        let inverse = one.div(length);
        let direction = [inverse, u.mul(inverse), v.mul(inverse)];
        let face = vector::<V>(self.face);
        let slope = dot(face, direction);
        // Which side is lit.
        let is_behind = zero.at_most(slope);
        let side = one.select(is_behind, V::splat(-1.0));
        let side = zero.sub(side);
        let mut normal = scale(face, side);
        let mut cosine = slope.mul(side);
        let mut correction = zero;
        if let Some(smooth) = &self.smooth {
            let mut place = scale(direction, distance);
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
            let height = second
                .mul(V::splat(smooth.heights[0]))
                .add(third.mul(V::splat(smooth.heights[1])))
                .sub(dot(mean, place))
                .mul(side);
            let inverse = side.div(dot(mean, mean).sqrt());
            let smooth_cosine = dot(mean, direction).mul(inverse);
            let is_curved = smooth_cosine.at_most(V::splat(MAX_CORRECTED_COSINE));
            let later = height.div(smooth_cosine.add(smooth_cosine));
            cosine = smooth_cosine.select(is_curved, cosine);
            correction = later.select(is_curved, correction);
            let mean = scale(mean, inverse);
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DMat3;

    use super::*;
    use crate::motion::Pose;
    use crate::rays::ImagePlane;
    use crate::shading::shade;
    use crate::surface::{ShadingMode, Surface};

    /// A bumpy sheet that is curved where its facets meet at small angles, seen from both sides.
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
    fn pixels_show_what_shading_one_hit_after_the_other_shows() {
        let surface = Arc::new(sheet());
        let turned = |angle: f64, x: f64| Pose {
            rotation: DMat3::from_rotation_z(angle) * DMat3::from_rotation_x(0.3),
            translation: DVec3::new(x, 0.1, 0.0),
        };
        let poses = vec![turned(0.5, 2.0), turned(3.5, 3.0)];
        let scene = Snapshot::new(vec![surface.clone(), surface], poses);
        let plane = ImagePlane::centered(61, 83, 0.7, 0.6);
        let hits = scene.cast_image(&plane).unwrap();
        let cosines = Shown::cosines(&scene, &hits);
        for level in Level::available() {
            let shown = Shown::at(&scene, &hits, level);
            let (mut num_curved, mut num_flat) = (0, 0);
            for pixel in 0..plane.num_pixels() {
                let (body, triangle) = (hits.body[pixel], hits.triangle[pixel]);
                if body == NO_BODY {
                    assert_eq!((shown.cosine[pixel], shown.normal[pixel]), (0.0, DVec3::ZERO));
                    assert!(shown.distance[pixel].is_infinite());
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
                assert!((shown.normal[pixel] - normal).length() < 1e-11, "{pixel} {level:?}");
                assert!((shown.distance[pixel] - hits.distance[pixel] - correction).abs() < 1e-12);
                let cosine = (-normal.dot(direction.normalize())).clamp(0.0, 1.0);
                assert!((shown.cosine[pixel] - cosine).abs() < 1e-11);
                assert!((cosines[pixel] - cosine).abs() < 1e-11);
                num_curved += usize::from(correction != 0.0);
                num_flat += usize::from(correction == 0.0);
            }
            assert!(num_curved > 500 && num_flat > 500, "{num_curved} {num_flat}");
        }
    }
}
