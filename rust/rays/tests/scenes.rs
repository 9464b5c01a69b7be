//! Meshes that are hard on rays, and the table of scenes that all searches are tested with.

use std::sync::Arc;

use crate::cancel::Cancel;
use crate::numeric::random::Random;
use crate::rays::scene::NO_BODY;
use crate::rays::single_ray::Hit;
use crate::rays::watertight::Ray;
use crate::{ImagePlane, Pose, ShadingMode, Surface};
use glam::{DMat3, DVec3};

/// Vertices and triangles.
pub type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// Surfaces at their poses.
pub type Bodies = Vec<(Arc<Surface>, Pose)>;

/// Check of the hit of a ray.
type Criterion = dyn Fn(&Ray, &Hit) -> bool + Sync;

/// Scene of the table, with its rays and the expected hits.
pub struct Case {
    pub name: String,
    pub bodies: Bodies,
    pub planes: Vec<ImagePlane>,
    pub rays: Vec<Ray>,
    pub expect: Box<Criterion>,
}

impl Case {
    fn new(name: impl Into<String>, bodies: Bodies) -> Self {
        Self {
            name: name.into(),
            bodies,
            planes: Vec::new(),
            rays: Vec::new(),
            expect: Box::new(|_, _| true),
        }
    }

    fn seen(mut self, plane: ImagePlane) -> Self {
        self.planes.push(plane);
        self
    }

    fn with_rays(self, rays: Vec<Ray>) -> Self {
        Self { rays, ..self }
    }

    fn expect(mut self, expect: impl Fn(&Ray, &Hit) -> bool + Sync + 'static) -> Self {
        self.expect = Box::new(expect);
        self
    }

    /// Expect a hit of every ray, at the parameter that `distance` has for it.
    fn at(self, distance: impl Fn(&Ray) -> f64 + Sync + 'static) -> Self {
        self.expect(move |ray, hit| is_near(hit.distance, distance(ray)))
    }

    /// Expect a hit of every ray.
    fn closed(self) -> Self {
        self.expect(|_, hit| hit.body != NO_BODY)
    }
}

fn is_near(distance: f64, expected: f64) -> bool {
    (distance - expected).abs() <= 1e-9 * expected
}

/// Surface of a mesh.
pub fn shaded((vertices, triangles): &Mesh, mode: ShadingMode) -> Arc<Surface> {
    Arc::new(Surface::new(vertices, triangles, mode, &Cancel::default()).unwrap())
}

/// Surface of a mesh, with the normals of its triangles.
pub fn surface(mesh: &Mesh) -> Arc<Surface> {
    shaded(mesh, ShadingMode::Flat)
}

/// The six rotations of a cube that bring another of its faces to the front, exactly.
fn cube_rotations() -> [DMat3; 6] {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let rows = [(x, y, z), (-x, -y, z), (y, -x, z), (-y, x, z), (z, y, -x), (-z, y, x)];
    rows.map(|(x, y, z)| DMat3::from_cols(x, y, z).transpose())
}

/// Bodies where their meshes are.
fn fixed<const N: usize>(meshes: [&Mesh; N]) -> Bodies {
    meshes.map(|mesh| (surface(mesh), Pose::IDENTITY)).to_vec()
}

/// Two meshes as two bodies and as one, with body and triangle where the second begins.
fn apart_and_joined(first: Mesh, second: Mesh) -> [(Bodies, [u32; 2]); 2] {
    let num = first.1.len() as u32;
    let two = fixed([&first, &second]);
    [(two, [1, 0]), (fixed([&join(first, second)]), [0, num])]
}

/// Grid of `cells` x `cells` squares, two triangles each, at the places that rows and columns from -1 to 1 have.
pub fn grid(cells: usize, mut place: impl FnMut(f64, f64) -> DVec3) -> Mesh {
    let at = |i: usize| (2 * i) as f64 / cells as f64 - 1.0;
    let all = |end: usize| (0..end).flat_map(move |row| (0..end).map(move |column| (row, column)));
    let vertices = all(cells + 1).map(|(row, column)| place(at(row), at(column))).collect();
    let number = |row: usize, column: usize| (row * (cells + 1) + column) as u32;
    let squares = all(cells).flat_map(|(row, column)| {
        let [a, b] = [number(row, column), number(row, column + 1)];
        let [c, d] = [number(row + 1, column), number(row + 1, column + 1)];
        [[a, b, c], [b, d, c]]
    });
    (vertices, squares.collect())
}

/// Closed mesh about the origin: the surface of the cube from -1 to 1 in `cells` x `cells` squares per face, every vertex
/// moved along its ray by the factor that `radius` has for it. Every ray from the origin meets one point of it. Faces
/// share the vertices of their seams if `cells` is a power of two.
pub fn star(cells: usize, mut radius: impl FnMut(DVec3) -> f64) -> Mesh {
    let mut mesh: Mesh = (Vec::new(), Vec::new());
    let mut numbers = std::collections::HashMap::new();
    for rotation in cube_rotations() {
        let (corners, triangles) = grid(cells, |row, column| rotation.transpose() * DVec3::new(1.0, column, row));
        let number = |corner: &DVec3| {
            // Without negative zeros.
            let key = corner.to_array().map(|x| (x + 0.0).to_bits());
            *numbers.entry(key).or_insert_with(|| {
                mesh.0.push(*corner * radius(*corner));
                mesh.0.len() as u32 - 1
            })
        };
        let numbers: Vec<u32> = corners.iter().map(number).collect();
        mesh.1
            .extend(triangles.into_iter().map(|t| t.map(|i| numbers[i as usize])));
    }
    mesh
}

/// Closed prism about the z axis, from z = -1 to 1, with 65 corners every `width` in front, bent by up to `bend` widths:
/// walls of slivers, and fans of needles from points at z = `apex` and its opposite.
fn needle_prism(width: f64, bend: f64, apex: f64, random: &mut Random) -> Mesh {
    let mut polygon = vec![[1.0, -1.0]];
    for k in -32..=32 {
        let x = 1.0 + bend * width * random.between(-1.0, 1.0);
        polygon.push([x, x * f64::from(k) * width]);
    }
    polygon.extend([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]);
    let num = polygon.len() as u32;
    let ring = |z: f64| polygon.iter().map(move |[x, y]| DVec3::new(*x, *y, z));
    let mut vertices: Vec<DVec3> = ring(-1.0).chain(ring(1.0)).collect();
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
    grid(1, |row, column| DVec3::new(distance, half * column, half * row))
}

/// Triangles in the plane y = 0, seen edge-on, after a wall behind them at x = 2.
fn blades(random: &mut Random) -> Mesh {
    let mut mesh = wall(2.0, 4.0);
    for _ in 0..20 {
        let corner = |_| DVec3::new(random.between(0.5, 1.5), 0.0, random.between(-1.0, 1.0));
        mesh = join(mesh, ([0; 3].map(corner).to_vec(), vec![[0, 1, 2]]));
    }
    mesh
}

/// Both meshes in one.
pub fn join(mut first: Mesh, second: Mesh) -> Mesh {
    let shift = first.0.len() as u32;
    first.0.extend(second.0);
    first.1.extend(second.1.into_iter().map(|t| t.map(|i| i + shift)));
    first
}

/// The mesh in other body coordinates: body and pose that bring it back to where it was.
fn moved((vertices, triangles): &Mesh, rotation: DMat3, translation: DVec3) -> (Arc<Surface>, Pose) {
    let back = |v: &DVec3| rotation.transpose() * (*v - translation);
    let mesh = (vertices.iter().map(back).collect(), triangles.clone());
    (surface(&mesh), Pose { rotation, translation })
}

/// `num` pixels to either side of one that looks along the axis, `shift` more on top and on the left.
fn odd(num: [usize; 2], size: [f64; 2], shift: usize) -> ImagePlane {
    ImagePlane {
        rows: 2 * num[0] + 1 + shift,
        columns: 2 * num[1] + 1 + shift,
        du: size[1],
        dv: size[0],
        axis_column: (num[1] + shift) as f64 + 0.5,
        axis_row: (num[0] + shift) as f64 + 0.5,
    }
}

/// Pixels of size `du` x `dv` about (u, v) = `middle`.
pub fn cut_out(rows: usize, columns: usize, du: f64, dv: f64, middle: [f64; 2]) -> ImagePlane {
    ImagePlane {
        axis_column: 0.5 * columns as f64 + middle[0] / du,
        axis_row: 0.5 * rows as f64 + middle[1] / dv,
        ..ImagePlane::centered(rows, columns, 0.5 * du * columns as f64, 0.5 * dv * rows as f64)
    }
}

/// Ray in the order of its fields.
pub fn half_line(origin: DVec3, direction: DVec3, start: f64) -> Ray {
    Ray {
        origin,
        direction,
        start,
    }
}

/// Rays from points to vertices, middles and other points of the edges of a mesh: they meet it there, at t = 1.
fn rays_to_edges(mesh: &Mesh, origins: Vec<DVec3>, random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::new();
    for origin in origins {
        for triangle in &mesh.1 {
            let [a, b, _] = triangle.map(|i| mesh.0[i as usize]);
            for share in [0.0, 0.5, random.between(0.0, 1.0)] {
                rays.push(half_line(origin, a + share * (b - a) - origin, 0.0));
            }
        }
    }
    rays
}

/// All scenes.
pub fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = (0..60).map(random_scene).collect();
    for add in [closed, slender, coincident, edge_on, extreme, at_sensor] {
        add(&mut cases);
    }
    cases
}

/// Closed meshes, whose edges and vertices rays must not leak through.
fn closed(cases: &mut Vec<Case>) {
    // Half the pixels between two vertices of a star: every pixel looks at a vertex or at the middle of an edge.
    const CELLS: usize = 16;
    let face = |shift: usize| odd([CELLS, CELLS], [1.0 / CELLS as f64; 2], shift % 8);
    for i in 0..27 {
        let scale = [1e-4, 1.0, 1e3][i / 9];
        let roughness = [0.0, 0.05, 0.8][i / 3 % 3];
        let offset = [0.0, 0.3, 1e3][i % 3];
        let random = &mut Random(i as u64);
        let mut mesh = star(CELLS, |_| scale * random.between(1.0 - roughness, 1.0));
        if i % 2 == 0 {
            mesh.1.iter_mut().for_each(|triangle| triangle.reverse());
        }
        // The others keep coordinates that nothing rounds.
        let rotation = if i % 4 < 2 { random.rotation() } else { DMat3::IDENTITY };
        let translation = scale * offset * random.direction();
        let bodies = if i % 4 == 0 {
            // Every second triangle is of the other body.
            let half = |first: usize| mesh.1.iter().skip(first).step_by(2).copied().collect();
            let halves = [half(0), half(1)].map(|half| moved(&(mesh.0.clone(), half), rotation, translation));
            halves.to_vec()
        } else {
            vec![moved(&mesh, rotation, translation)]
        };
        for side in [i % 3, 3 + i / 3 % 3] {
            let turned = |(surface, pose): &(_, Pose)| (Arc::clone(surface), pose.turned(&cube_rotations()[side]));
            let name = format!("star {scale} {roughness} {offset} {side}");
            let case = Case::new(name, bodies.iter().map(turned).collect()).seen(face(side + i));
            cases.push(if roughness == 0.0 {
                case.at(move |ray| scale / ray.direction.abs().max_element())
            } else {
                case.closed()
            });
        }
    }
    for seed in 0..6 {
        let random = &mut Random(seed);
        let scale = 10_f64.powf(random.between(-4.0, 3.0));
        let mesh = star(8, |corner| scale / corner.length());
        let offset = if seed % 3 == 0 { 1e3 * scale } else { scale };
        let body = moved(&mesh, random.rotation(), offset * random.direction());
        let origins = [0.0, 0.4].map(|share| share * scale * random.point()).to_vec();
        let rays = rays_to_edges(&mesh, origins, random);
        let case = Case::new(format!("sphere {seed}"), vec![body]).with_rays(rays);
        cases.push(case.at(|_| 1.0));
    }
}

/// Closed prisms of slivers and needles, 1 to 2 long: aspects of 1e-6 and 1e-9, halved exactly.
fn slender(cases: &mut Vec<Case>) {
    for i in 0..12 {
        let width = 0.5_f64.powi([19, 20, 29][i / 4]);
        let (bend, apex) = [(0.0, 1.0), (0.1, 1.0), (0.1, 0.5), (3.0, 2.0)][i % 4];
        let random = &mut Random(i as u64);
        let mesh = needle_prism(width, bend, apex, random);
        let rotation = if i % 3 == 0 { DMat3::IDENTITY } else { random.rotation() };
        let (surface, pose) = moved(&mesh, rotation, [0.0, 1.0, 1e3][i % 3] * random.direction());
        let case = |name: &str, side: usize| {
            let pose = pose.turned(&cube_rotations()[side]);
            Case::new(format!("{name} {width:e} {bend} {apex}"), vec![(surface.clone(), pose)])
        };
        // A pixel at every vertical edge and one between, where the diagonals are met at half their height.
        let mut walls = case("slivers", 0);
        for size in [1.0, 0.25] {
            walls = walls.seen(odd([9, 70], [0.125, 0.5 * width * size], i / 4));
        }
        cases.push(if bend == 0.0 && width > 1e-8 {
            walls.at(|ray| 1.0 / ray.direction.abs().max_element())
        } else {
            walls.closed()
        });
        // Fans, from their common corner outwards: in every row, pixels at all spokes.
        for side in [4, 5] {
            let fans = odd([5, 8 * 33], [0.25, width / 8.0], i / 4);
            cases.push(case("needles", side).seen(fans).closed());
        }
        if bend == 0.0 {
            let origins = (0..5).map(|_| 0.9 * random.point()).collect();
            let rays = rays_to_edges(&mesh, origins, random);
            cases.push(case("single rays to needles", 0).with_rays(rays).closed());
        }
    }
}

/// Triangles that coincide, and others a billionth behind: rays hit the first, and the nearer.
fn coincident(cases: &mut Vec<Case>) {
    let random = &mut Random(1);
    let mesh = star(4, |_| random.between(0.5, 1.0));
    let plane = ImagePlane::centered(20, 30, 1.0, 0.8);
    let num = mesh.1.len() as u32;
    for copies in [2, 3, 20] {
        let repeated = (mesh.0.clone(), mesh.1.repeat(copies));
        let one_body = vec![moved(&repeated, random.rotation(), random.point())];
        let bodies = vec![moved(&mesh, random.rotation(), random.point()); copies];
        for bodies in [one_body, bodies] {
            let case = Case::new(format!("{copies} copies"), bodies).seen(plane);
            cases.push(case.expect(move |_, hit| hit.triangle < num && hit.body == 0));
        }
    }
    // Both halves of a square, with coordinates that nothing rounds, and others that overlap them in their plane.
    let corners = [[-4, -4], [4, -4], [4, 4], [-4, 4], [0, 8], [0, -8]];
    let vertices = corners.map(|[y, z]| DVec3::new(2.0, f64::from(y), f64::from(z)));
    let halves = [[2, 0, 1], [0, 2, 3]];
    let [a, b, c] = [[0, 1, 2], [5, 1, 4], [5, 4, 3]];
    let others = [a, [2, 1, 0], [1, 2, 0], b, c, [3, 4, 5], [0, 3, 2]];
    for behind in [1, 2, 7, 14, 15, 20, 100] {
        let triangles = halves.into_iter().chain(others.into_iter().cycle().take(behind));
        let bodies = fixed([&(vertices.to_vec(), triangles.collect())]);
        let case = Case::new(format!("{behind} in one plane"), bodies).seen(ImagePlane::centered(24, 24, 0.99, 0.99));
        cases.push(case.expect(|ray, hit| hit.triangle < 2 && is_near(hit.distance, 2.0 / ray.direction.x)));
    }
    // The nearer sheet comes last.
    for (distance, gap) in [(1.0, 1e-9), (1e3, 1e-6), (1e-3, 1e-12)] {
        let [back, front] = [distance + gap, distance].map(|x| wall(x, 2.0 * distance));
        for (bodies, first) in apart_and_joined(back, front) {
            let name = format!("sheets with gaps of {gap:e}");
            let case = Case::new(name, bodies).seen(ImagePlane::centered(17, 23, 0.8, 0.9));
            cases.push(case.expect(move |ray, hit| {
                [hit.body, hit.triangle] >= first && is_near(hit.distance, distance / ray.direction.x)
            }));
        }
    }
    // Squares just before a slanted wall, whose box begins before the boxes of the squares.
    for gap in [1e-3, 1e-6, 1e-9] {
        let slanted = grid(1, |row, column| DVec3::new(1.0 + 0.5 * column, column, row));
        let mut squares: Mesh = (Vec::new(), Vec::new());
        let mut planes = Vec::new();
        for i in 0..36 {
            let [y, z] = [i % 6, i / 6].map(|k| 0.3 * f64::from(k) - 0.8);
            // The corner of a square that is nearest to the wall is `gap` from it.
            let x = 1.0 + 0.5 * y - 1.5 * gap;
            let square = grid(1, |row, column| DVec3::new(x, y + gap * column, z + gap * row));
            squares = join(squares, square);
            planes.push(cut_out(12, 12, 0.13 * gap / x, 0.13 * gap / x, [y / x, z / x]));
        }
        for (bodies, first) in apart_and_joined(slanted, squares) {
            let case = Case::new(format!("squares {gap:e} before a wall"), bodies);
            let case = case.expect(move |_, hit| [hit.body, hit.triangle] >= first && hit.body != NO_BODY);
            let planes = planes.clone();
            cases.push(Case { planes, ..case });
        }
    }
}

/// Rays in the planes of triangles.
fn edge_on(cases: &mut Vec<Case>) {
    // The middle column looks along the blades; blades and rays have exact coordinates.
    let case = Case::new("blades", fixed([&blades(&mut Random(1))])).seen(odd([60, 3], [0.025, 0.1], 0));
    cases.push(case.expect(|ray, hit| hit.triangle < 2 && is_near(hit.distance, 2.0 / ray.direction.x)));
    for seed in 0..20 {
        let random = &mut Random(seed);
        let mesh = blades(random);
        let body = moved(&mesh, random.rotation(), random.point());
        // From anywhere in the plane, inside of triangles too.
        let mut place = || DVec3::new(random.between(0.0, 1.9), 0.0, random.between(-1.0, 1.0));
        let rays = (0..500)
            .map(|_| [(); 2].map(|()| place()))
            .map(|[a, b]| half_line(a, b - a, 0.0));
        let case = Case::new(format!("rotated blades {seed}"), vec![body]).with_rays(rays.collect());
        cases.push(case.seen(odd([60, 3], [0.025, 0.1], seed as usize % 8)));
    }
}

/// Sizes from a tenth of a millimetre to a kilometre, and numbers with zeros in them.
fn extreme(cases: &mut Vec<Case>) {
    for seed in 0..2 {
        let random = &mut Random(seed);
        // Parts ten times larger from one to the next, within a closed shell.
        let mut mesh = star(2, |_| 500.0);
        let mut planes = Vec::new();
        for size in [5e-5, 5e-4, 5e-3, 0.05, 0.5, 5.0, 50.0] {
            let place = 4.0 * size * (DVec3::X + 0.5 * random.point());
            let (vertices, triangles) = star(2, |_| size * random.between(0.5, 1.0));
            mesh = join(mesh, (vertices.iter().map(|v| *v + place).collect(), triangles));
            for half in [1e-6, 1e-2, 0.3, 2.0] {
                let middle = [place.y / place.x, place.z / place.x];
                planes.push(cut_out(31, 27, 2.0 * half / 27.0, 2.0 * half / 31.0, middle));
            }
        }
        let body = moved(&mesh, random.rotation(), 100.0 * random.point());
        let case = Case::new(format!("all sizes {seed}"), vec![body]).closed();
        cases.push(Case { planes, ..case });
    }
    // A band of 1, 2, 3, ... triangles: nothing is hit after the last triangle of a leaf.
    for num in 1..=40_u32 {
        let place = |i: u32| {
            let side = if i.is_multiple_of(2) { -1.0 } else { 1.0 };
            DVec3::new(1.0, 0.9 - 1.7 * f64::from(i) / f64::from(num + 1), 0.7 * side)
        };
        let triangles = (0..num).map(|i| [i, i + 1, i + 2]).collect();
        let bodies = fixed([&((0..num + 2).map(place).collect(), triangles)]);
        cases.push(Case::new(format!("band {num}"), bodies).seen(ImagePlane::centered(17, 33, 1.0, 1.0)));
    }
    // Rays in faces of the boxes of the tree, with zeros of both signs among their numbers.
    let cube = surface(&star(8, |_| 1.0));
    for rotation in cube_rotations() {
        let places = (0..49).map(|i| [i / 7, i % 7].map(|k| f64::from(k - 3) / 4.0));
        let rays = places.flat_map(|[y, z]| {
            [(0.0, -3.0), (-0.0, -3.0), (0.0, 0.25), (-0.0, 0.25)]
                .map(|(zero, x)| half_line(DVec3::new(x, y, z), DVec3::new(1.0, zero, zero), 0.0))
        });
        let bodies = vec![(cube.clone(), Pose::IDENTITY.turned(&rotation))];
        let case = Case::new("along the axes", bodies).with_rays(rays.collect());
        cases.push(case.at(|ray| if ray.origin.x < 0.0 { 2.0 } else { 0.75 }));
    }
}

/// Sensors on surfaces, and scenes without triangles.
fn at_sensor(cases: &mut Vec<Case>) {
    // The sensor on the front face of a cube from x = 0 to 1: in the middle of it, on an edge and at a corner. Where a
    // ray leaves: x = 1, y +- 1/2 and z +- 1/2. On an edge a ray may hit the faces that meet there.
    for seed in 0..20 {
        let [y, z] = [[0.1, 0.2], [0.0, 0.0], [0.0, 0.5], [0.5, 0.0]][seed % 4];
        let random = &mut Random(seed as u64);
        let (vertices, triangles) = star(2, |_| 1.0);
        let place = |v: &DVec3| 0.5 * *v + DVec3::new(0.5, y, z);
        let mesh = (vertices.iter().map(place).collect(), triangles);
        let (surface, pose) = if seed < 4 {
            (surface(&mesh), Pose::IDENTITY)
        } else {
            moved(&mesh, random.rotation(), random.point())
        };
        // Without pixels that look along faces.
        let plane = ImagePlane::centered(16, 20, 0.9, 1.1);
        let inwards = Case::new(format!("sensor on a cube {seed}"), vec![(surface.clone(), pose)]).seen(plane);
        cases.push(inwards.expect(move |ray, hit| {
            let d = ray.direction;
            let exit = |at: f64, d: f64| (at + 0.5 * d.signum()) / d;
            let side = exit(y, d.y).min(exit(z, d.z));
            side < 1e-3 || is_near(hit.distance, (1.0 / d.x).min(side))
        }));
        let outwards = vec![(surface, pose.turned(&cube_rotations()[1]))];
        let outwards = Case::new(format!("sensor behind a cube {seed}"), outwards).seen(plane);
        cases.push(outwards.expect(|_, hit| hit.body == NO_BODY));
    }
    // Images begin a billionth of a metre from the sensor.
    let plane = ImagePlane::centered(9, 9, 0.5, 0.5);
    for (distance, nearest) in [(0.0, 1.0), (0.4e-9, 1.0), (2e-9, 2e-9), (1e-6, 1e-6)] {
        let bodies = fixed([&wall(distance, 3.0), &wall(1.0, 3.0)]);
        let case = Case::new(format!("sensor {distance:e} from a wall"), bodies).seen(plane);
        cases.push(case.at(move |ray| nearest / ray.direction.x));
    }
    let empty = (Vec::new(), Vec::new());
    for bodies in [vec![], fixed([&empty])] {
        let case = Case::new("nothing", bodies).seen(plane);
        cases.push(case.expect(|_, hit| hit.body == NO_BODY));
    }
    let case = Case::new("an empty body", fixed([&empty, &wall(1.0, 2.0)])).seen(plane);
    cases.push(case.expect(|_, hit| hit.body == 1));
}

/// A few bodies of 4 to 100 triangles each, from a millimetre to a kilometre in size, at and about and before the sensor,
/// with rays of images and from anywhere.
fn random_scene(seed: u64) -> Case {
    let random = &mut Random(seed);
    let scale = 10_f64.powf(random.between(-3.0, 3.0));
    let mut bodies = Bodies::new();
    for _ in 0..=random.below(4) {
        let size = scale * 10_f64.powf(random.between(-1.5, 0.0));
        let (vertices, triangles) = match random.below(5) {
            0..3 => soup(random),
            3 => star(1, |_| 1.0),
            _ => star(2 + random.below(2), |_| random.between(0.2, 1.0)),
        };
        // Far from the origin of its own coordinates, or not.
        let offset = [1e3 * scale, 0.0][random.below(5).min(1)] * random.direction();
        let rotation = [cube_rotations()[random.below(6)], random.rotation()][random.below(4).min(1)];
        let ahead = scale * (random.point() + DVec3::X * random.between(0.0, 2.0));
        let place = [0.3 * size * random.point(), ahead][random.below(3).min(1)];
        let vertices: Vec<DVec3> = vertices.iter().map(|v| size * *v + offset).collect();
        let pose = Pose {
            rotation,
            translation: place - rotation * offset,
        };
        bodies.push((surface(&(vertices, triangles)), pose));
    }
    let at = |random: &mut Random, share: f64| {
        let (surface, pose) = &bodies[random.below(bodies.len())];
        let [s, t] = [0; 2].map(|_| share * random.between(0.0, 1.0));
        let [a, b, c] = surface.corners(random.below(surface.num_triangles()) as u32);
        pose.point(a + s * (b - a) + s * t * (c - b))
    };
    let planes = (0..6).map(|_| {
        // Towards some vertex, from a wide angle to a thousandth of a radian.
        let target = at(random, 0.0);
        let middle = [target.y, target.z].map(|x| (x / target.x.abs()).clamp(-5.0, 5.0));
        let half = 10_f64.powf(random.between(-3.0, 0.7));
        let (rows, columns) = (1 + random.below(40), 1 + random.below(40));
        let dv = half * random.between(1.0, 3.0) / rows as f64;
        cut_out(rows, columns, 2.0 * half / columns as f64, dv, middle)
    });
    let mut case = Case::new(format!("random {seed}"), Vec::new());
    case.planes = planes.collect();
    let rays = (0..1000).map(|_| {
        let origin = 3.0 * scale * random.between(0.0, 1.0) * random.point();
        let direction = match random.below(8) {
            0 => cube_rotations()[random.below(6)].x_axis,
            1 => random.direction() * DVec3::new(1.0, 1.0, 1e-20),
            2..5 => random.direction(),
            _ => at(random, 1.0) - origin,
        };
        let length = 10_f64.powf(random.between(-3.0, 3.0));
        let start = [0.0, 1e-9, random.between(0.0, scale)][random.below(3)] / length;
        half_line(origin, length * direction.normalize(), start)
    });
    case.rays = rays.collect();
    case.bodies = bodies;
    case
}

/// Triangles that have nothing to do with each other, many of them needles, and some of them twice.
fn soup(random: &mut Random) -> Mesh {
    let mut mesh: Mesh = (Vec::new(), Vec::new());
    let size = [0.1, 1.0][random.below(2)];
    for i in 0..4 + random.below(80) as u32 {
        let (place, along) = (random.point(), size * random.point());
        let width = size * 10_f64.powf(random.between(-6.0, 0.0));
        mesh.0
            .extend([place, place + along, place + 0.7 * along + width * random.point()]);
        mesh.1.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    for i in 0..random.below(4) {
        mesh.1.push(mesh.1[i]);
    }
    mesh
}
