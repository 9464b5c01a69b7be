//! Meshes that are hard on rays, and scenes drawn by lot.

use std::sync::Arc;

use crate::{Pose, ShadingMode, Surface};
use glam::{DMat3, DQuat, DVec3};

/// Vertices and triangles.
pub type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// Surfaces at their poses.
pub type Bodies = Vec<(Arc<Surface>, Pose)>;

/// Numbers drawn by lot: splitmix64 (Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    pub fn chance(&mut self, share: f64) -> bool {
        self.between(0.0, 1.0) < share
    }

    /// In the cube from -1 to 1.
    pub fn point(&mut self) -> DVec3 {
        DVec3::new(
            self.between(-1.0, 1.0),
            self.between(-1.0, 1.0),
            self.between(-1.0, 1.0),
        )
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let point = self.point();
            if (0.01..1.0).contains(&point.length()) {
                return point.normalize();
            }
        }
    }

    pub fn rotation(&mut self) -> DMat3 {
        DMat3::from_quat(DQuat::from_axis_angle(self.direction(), self.between(-3.2, 3.2)))
    }
}

pub fn surface((vertices, triangles): &Mesh) -> Arc<Surface> {
    Arc::new(Surface::new(vertices, triangles, ShadingMode::Flat).unwrap())
}

/// The six turns of a cube that bring another of its faces to the front, exactly.
pub fn turns() -> [DMat3; 6] {
    let rows = |x, y, z| DMat3::from_cols(x, y, z).transpose();
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    [
        rows(x, y, z),
        rows(-x, -y, z),
        rows(y, -x, z),
        rows(-y, x, z),
        rows(z, y, -x),
        rows(-z, y, x),
    ]
}

/// A pose after which everything is turned about the sensor.
pub fn turned(turn: DMat3, pose: &Pose) -> Pose {
    Pose {
        rotation: turn * pose.rotation,
        translation: turn * pose.translation,
    }
}

/// Closed mesh round the origin, of which every ray from there meets one point: the surface of the cube from -1 to 1 in
/// `cells` x `cells` squares per face, every vertex moved along its ray by the factor that `radius` has for it.
pub fn star(cells: usize, mut radius: impl FnMut(DVec3) -> f64) -> Mesh {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let mut numbers = std::collections::HashMap::new();
    for turn in turns() {
        let mut vertex = |row: usize, column: usize| {
            let place = |i: usize| (2 * i) as f64 / cells as f64 - 1.0;
            let corner = turn.transpose() * DVec3::new(1.0, place(column), place(row));
            // Without negative zeros: faces share the vertices of their seams.
            let key = corner.to_array().map(|x| (x + 0.0).to_bits());
            *numbers.entry(key).or_insert_with(|| {
                vertices.push(corner * radius(corner));
                vertices.len() as u32 - 1
            })
        };
        for row in 0..cells {
            for column in 0..cells {
                let [a, b] = [vertex(row, column), vertex(row, column + 1)];
                let [c, d] = [vertex(row + 1, column), vertex(row + 1, column + 1)];
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
    }
    (vertices, triangles)
}

/// Closed lens before the sensor: a front and, 1 % farther, a back of `cells` x `cells` squares each, to `half` on either
/// side of the axis in (u, v), every vertex at the x that `depth` has for it. The front's triangles come first.
pub fn lens(cells: usize, half: f64, mut depth: impl FnMut(DVec3) -> f64) -> Mesh {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for side in [1.0, 1.01] {
        for (row, column) in (0..=cells).flat_map(|row| (0..=cells).map(move |column| (row, column))) {
            let place = |i: usize| half * ((2 * i) as f64 / cells as f64 - 1.0);
            let direction = DVec3::new(1.0, place(column), place(row));
            vertices.push(side * depth(direction) * direction);
        }
    }
    let num_front = vertices.len() as u32 / 2;
    let last = cells as u32;
    let number = |row: u32, column: u32| row * (last + 1) + column;
    for first in [0, num_front] {
        for (row, column) in (0..last).flat_map(|row| (0..last).map(move |column| (row, column))) {
            let [a, b] = [number(row, column), number(row, column + 1)].map(|i| i + first);
            let [c, d] = [number(row + 1, column), number(row + 1, column + 1)].map(|i| i + first);
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    for i in 0..last {
        for [a, b] in [
            [number(0, i), number(0, i + 1)],
            [number(last, i), number(last, i + 1)],
            [number(i, 0), number(i + 1, 0)],
            [number(i, last), number(i + 1, last)],
        ] {
            let (c, d) = (a + num_front, b + num_front);
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    (vertices, triangles)
}

/// Closed prism of a polygon round the z axis, from z = -1 to 1, with fans of triangles above and below whose common
/// corners are at z = `apex` and its opposite. Walls are two triangles each. Of its points every ray from the origin meets one.
pub fn prism(polygon: &[[f64; 2]], apex: f64) -> Mesh {
    let num = polygon.len() as u32;
    let mut vertices: Vec<DVec3> = Vec::new();
    for z in [-1.0, 1.0] {
        vertices.extend(polygon.iter().map(|[x, y]| DVec3::new(*x, *y, z)));
    }
    vertices.extend([DVec3::Z * -apex, DVec3::Z * apex]);
    let mut triangles = Vec::new();
    for i in 0..num {
        let (a, b) = (i, (i + 1) % num);
        let (c, d) = (a + num, b + num);
        triangles.extend([[a, b, d], [a, d, c], [b, a, 2 * num], [c, d, 2 * num + 1]]);
    }
    (vertices, triangles)
}

/// Square of two triangles at x = `distance`, from -`half` to `half`.
pub fn wall(distance: f64, half: f64) -> Mesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let vertices = corners.map(|[y, z]| DVec3::new(distance, half * y, half * z));
    (vertices.to_vec(), vec![[0, 2, 1], [0, 3, 2]])
}

/// Both meshes in one.
pub fn join(mut first: Mesh, second: Mesh) -> Mesh {
    let shift = first.0.len() as u32;
    first.0.extend(second.0);
    first.1.extend(second.1.into_iter().map(|t| t.map(|i| i + shift)));
    first
}

/// The mesh where `vertex -> rotation vertex + translation` sees it as it was: body and pose.
pub fn moved((vertices, triangles): &Mesh, rotation: DMat3, translation: DVec3) -> (Mesh, Pose) {
    let back = |v: &DVec3| rotation.transpose() * (*v - translation);
    let pose = Pose { rotation, translation };
    ((vertices.iter().map(back).collect(), triangles.clone()), pose)
}

/// A few bodies of 4 to 100 triangles each, from a millimetre to a kilometre in size, at and round and before the sensor.
pub fn scene(random: &mut Random) -> (Bodies, f64) {
    let scale = 10_f64.powf(random.between(-3.0, 3.0));
    let mut bodies = Bodies::new();
    for _ in 0..=random.below(4) {
        let size = scale * 10_f64.powf(random.between(-1.5, 0.0));
        let (vertices, triangles) = match random.below(5) {
            0 => soup(random),
            1 => strip(random),
            2 => needles(random),
            3 => star(1, |_| 1.0),
            _ => {
                let roughness = random.between(0.0, 0.8);
                star(2 + random.below(2), |_| random.between(1.0 - roughness, 1.0))
            }
        };
        // Far from the origin of its own coordinates, or not.
        let offset = if random.chance(0.2) {
            1e3 * scale * random.direction()
        } else {
            DVec3::ZERO
        };
        let rotation = match random.below(4) {
            0 => turns()[random.below(6)],
            _ => random.rotation(),
        };
        let place = match random.below(3) {
            0 => 0.3 * size * random.point(),
            _ => scale * (random.point() + DVec3::X * random.between(0.0, 2.0)),
        };
        let vertices: Vec<DVec3> = vertices.iter().map(|v| size * *v + offset).collect();
        let pose = Pose {
            rotation,
            translation: place - rotation * offset,
        };
        bodies.push((surface(&(vertices, triangles)), pose));
    }
    (bodies, scale)
}

/// Triangles that have nothing to do with each other, and some of them twice.
fn soup(random: &mut Random) -> Mesh {
    let fineness = if random.chance(0.5) { 0.1 } else { 1.0 };
    let mut mesh = (Vec::new(), Vec::new());
    for i in 0..4 + random.below(80) as u32 {
        let place = random.point();
        mesh.0.extend([0; 3].map(|_| place + fineness * random.point()));
        mesh.1.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    for i in 0..random.below(4) {
        mesh.1.push(mesh.1[i]);
    }
    mesh
}

/// Triangles that share edges with the one before and the one after.
fn strip(random: &mut Random) -> Mesh {
    let num = 4 + random.below(80) as u32;
    let mut place = random.point();
    let vertices = (0..num + 2).map(|_| {
        place += 0.4 * random.point();
        place
    });
    (vertices.collect(), (0..num).map(|i| [i, i + 1, i + 2]).collect())
}

/// Long and narrow triangles.
fn needles(random: &mut Random) -> Mesh {
    let mut mesh = (Vec::new(), Vec::new());
    for i in 0..4 + random.below(40) as u32 {
        let (place, along) = (random.point(), random.direction());
        let width = 10_f64.powf(random.between(-6.0, -1.0));
        mesh.0
            .extend([place, place + along, place + 0.7 * along + width * random.direction()]);
        mesh.1.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}
