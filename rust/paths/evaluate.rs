//! Delays and amplitudes of many paths: eight material points of rigid bodies at a time, all others one by one.

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::numeric::trig::{angle, exp_of_negative, sinc_turns};
use crate::paths::kinematics::Kinematics;
use crate::paths::scatterers::Scatterers;
use crate::paths::series::{Paths, Selection};

/// Numbers of a vector.
const LANES: usize = 8;

/// Number of paths that one thread evaluates together, at all times.
const BLOCK: usize = 32 * LANES;

/// One number of eight paths each.
type Lanes = [f64; LANES];

/// A vector of eight paths each, by coordinate.
type Lanes3 = [Lanes; 3];

impl Scatterers {
    /// Delays of the selected paths at the nodes of `kinematics`, and amplitudes at those of `amplitudes_at`: first the
    /// material points, then the point targets.
    pub fn paths(&self, kinematics: &Kinematics, amplitudes_at: &Kinematics, selection: Selection) -> Result<Paths> {
        self.paths_by(kinematics, amplitudes_at, selection, Level::best())
    }

    /// Delays and amplitudes as [`Self::paths`], by an instruction set.
    pub fn paths_by(
        &self,
        kinematics: &Kinematics,
        amplitudes_at: &Kinematics,
        selection: Selection,
        level: Level,
    ) -> Result<Paths> {
        let num_nodes = [kinematics.num_nodes, amplitudes_at.num_nodes];
        let mut paths = Paths::zeros(num_nodes, self.num_channels(), selection)?;
        let num_paths = selection.len();
        if num_paths == 0 {
            return Ok(paths);
        }
        let mut blocks: Vec<EvaluateBlock> = (0..num_paths.div_ceil(BLOCK))
            .map(|block| EvaluateBlock {
                scatterers: self,
                kinematics,
                amplitudes_at,
                selection,
                first: block * BLOCK,
                count: BLOCK.min(num_paths - block * BLOCK),
                delays: Vec::with_capacity(kinematics.num_nodes * self.num_channels()),
                amplitudes: Vec::with_capacity(amplitudes_at.num_nodes * self.num_channels()),
            })
            .collect();
        for row in paths.delay.chunks_mut(num_paths) {
            for (block, part) in blocks.iter_mut().zip(row.chunks_mut(BLOCK)) {
                block.delays.push(part);
            }
        }
        for row in paths.amplitude.chunks_mut(num_paths) {
            for (block, part) in blocks.iter_mut().zip(row.chunks_mut(BLOCK)) {
                block.amplitudes.push(part);
            }
        }
        blocks.into_par_iter().for_each(|block| level.run(block));
        Ok(paths)
    }

    /// Eight material points in coordinates of their bodies; none if one of the bodies deforms.
    #[inline(always)]
    fn eight(&self, numbers: &[usize; LANES]) -> Option<Eight> {
        let mut bodies = [0; LANES];
        for lane in 0..LANES {
            let number = numbers[lane];
            bodies[lane] = *self.body.get(number)? as usize;
            if self.facet[number].is_some() {
                return None;
            }
        }
        let mut eight = Eight {
            bodies,
            position: [[0.0; LANES]; 3],
            normal: [[0.0; LANES]; 3],
            edges: [[[0.0; LANES]; 3]; 2],
            has_edges: false,
        };
        for (lane, number) in numbers.iter().enumerate() {
            let edges = self.patch[*number];
            eight.has_edges |= edges != [DVec3::ZERO; 2];
            for axis in 0..3 {
                eight.position[axis][lane] = self.position[*number][axis];
                eight.normal[axis][lane] = self.normal[*number][axis];
                eight.edges[0][axis][lane] = edges[0][axis];
                eight.edges[1][axis][lane] = edges[1][axis];
            }
        }
        Some(eight)
    }
}

/// Evaluation of a block of paths.
struct EvaluateBlock<'a> {
    scatterers: &'a Scatterers,
    kinematics: &'a Kinematics<'a>,
    amplitudes_at: &'a Kinematics<'a>,
    selection: Selection,
    /// First path of the block and number of paths, among the selected ones.
    first: usize,
    count: usize,
    /// Part of the block in every row `(node, channel)`.
    delays: Vec<&'a mut [f64]>,
    amplitudes: Vec<&'a mut [Complex64]>,
}

/// Eight material points in coordinates of their bodies.
struct Eight {
    bodies: [usize; LANES],
    position: Lanes3,
    normal: Lanes3,
    edges: [Lanes3; 2],
    has_edges: bool,
}

/// Poses of the bodies of eight points: body axes as columns, and origins.
struct Poses {
    axes: [Lanes3; 3],
    origin: Lanes3,
}

/// Directions, distances and field gains from an antenna to eight points, see [`crate::antennas::array::Sight`].
#[derive(Clone, Copy)]
struct Sights {
    distance: Lanes,
    direction: Lanes3,
    gain: Lanes,
}

/// Weights of eight points, see [`crate::paths::scatterers::Weight`].
#[derive(Clone, Copy)]
struct Weights {
    specular: [Lanes; 2],
    diffuse: [Lanes; 2],
}

impl Kernel for EvaluateBlock<'_> {
    type Output = ();

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let scatterers = self.scatterers;
        let array = &scatterers.array;
        let (num_channels, num_antennas) = (array.num_channels(), array.tx.len() + array.rx.len());
        let nothing = [0.0; LANES];
        let mut sights = vec![
            Sights {
                distance: nothing,
                direction: [nothing; 3],
                gain: nothing,
            };
            num_antennas
        ];
        let mut weights = vec![
            Weights {
                specular: [nothing; 2],
                diffuse: [nothing; 2],
            };
            num_channels
        ];
        let mut distances = vec![nothing; num_antennas];
        for first in (0..self.count).step_by(LANES) {
            let count = LANES.min(self.count - first);
            let mut numbers = [0; LANES];
            for lane in 0..LANES {
                let place = self.first + first + lane.min(count - 1);
                numbers[lane] = self.selection.first + place * self.selection.step;
            }
            let Some(eight) = scatterers.eight(&numbers) else {
                self.one_by_one(first, &numbers[..count]);
                continue;
            };
            for channel in 0..num_channels {
                for lane in 0..LANES {
                    let weight = &scatterers.weights[numbers[lane] * num_channels + channel];
                    weights[channel].specular[0][lane] = weight.specular.re;
                    weights[channel].specular[1][lane] = weight.specular.im;
                    weights[channel].diffuse[0][lane] = weight.diffuse.re;
                    weights[channel].diffuse[1][lane] = weight.diffuse.im;
                }
            }
            for node in 0..self.kinematics.num_nodes {
                let position = placed::<I>(&eight.poses::<I>(self.kinematics, node), &eight.position);
                for antenna in 0..num_antennas {
                    let (place, _) = antenna_of(array, antenna);
                    distance::<I>(&offsets::<I>(&position, place)).store(&mut distances[antenna]);
                }
                for channel in 0..num_channels {
                    let tx = I::F64::load(&distances[channel / array.rx.len()]);
                    let rx = I::F64::load(&distances[array.tx.len() + channel % array.rx.len()]);
                    let mut delay = nothing;
                    let speed = <I::F64 as Vector>::splat(SPEED_OF_LIGHT);
                    tx.add(rx).div(speed).store(&mut delay);
                    let row = &mut self.delays[node * num_channels + channel];
                    row[first..first + count].copy_from_slice(&delay[..count]);
                }
            }
            for node in 0..self.amplitudes_at.num_nodes {
                let there = eight.at::<I>(&eight.poses::<I>(self.amplitudes_at, node));
                for antenna in 0..num_antennas {
                    sights[antenna] = sights_of::<I>(array, antenna, &there.position);
                }
                for channel in 0..num_channels {
                    let tx = &sights[channel / array.rx.len()];
                    let rx = &sights[array.tx.len() + channel % array.rx.len()];
                    let amplitude = there.surface_amplitude::<I>(array, &weights[channel], tx, rx);
                    let row = &mut self.amplitudes[node * num_channels + channel];
                    for lane in 0..count {
                        row[first + lane] = Complex64::new(amplitude[0][lane], amplitude[1][lane]);
                    }
                }
            }
        }
    }
}

impl EvaluateBlock<'_> {
    /// Evaluate paths one by one, for the entries of the block from `first` on.
    #[inline(never)]
    fn one_by_one(&mut self, first: usize, numbers: &[usize]) {
        let (scatterers, num_channels) = (self.scatterers, self.scatterers.num_channels());
        for (row, out) in self.delays.iter_mut().enumerate() {
            let (node, channel) = (row / num_channels, row % num_channels);
            for (lane, number) in numbers.iter().enumerate() {
                out[first + lane] = scatterers.path(self.kinematics, node, channel, *number).0;
            }
        }
        for (row, out) in self.amplitudes.iter_mut().enumerate() {
            let (node, channel) = (row / num_channels, row % num_channels);
            for (lane, number) in numbers.iter().enumerate() {
                out[first + lane] = scatterers.path(self.amplitudes_at, node, channel, *number).1;
            }
        }
    }
}

impl Eight {
    /// Poses of the bodies at a node.
    #[inline(always)]
    fn poses<I: Isa>(&self, kinematics: &Kinematics, node: usize) -> Poses {
        let of = &kinematics.poses[node * kinematics.num_bodies..];
        let mut poses = Poses {
            axes: [[[0.0; LANES]; 3]; 3],
            origin: [[0.0; LANES]; 3],
        };
        let first = &of[self.bodies[0]];
        for row in 0..3 {
            for column in 0..3 {
                let number = <I::F64 as Vector>::splat(first.rotation.col(column)[row]);
                number.store(&mut poses.axes[column][row]);
            }
            <I::F64 as Vector>::splat(first.translation[row]).store(&mut poses.origin[row]);
        }
        for lane in 1..LANES {
            if self.bodies[lane] != self.bodies[0] {
                let pose = &of[self.bodies[lane]];
                for row in 0..3 {
                    for column in 0..3 {
                        poses.axes[column][row][lane] = pose.rotation.col(column)[row];
                    }
                    poses.origin[row][lane] = pose.translation[row];
                }
            }
        }
        poses
    }

    /// Points, normals and edges in the sensor frame, for poses of the bodies.
    #[inline(always)]
    fn at<I: Isa>(&self, pose: &Poses) -> Self {
        let mut there = Self {
            bodies: self.bodies,
            position: placed::<I>(pose, &self.position),
            normal: turned::<I>(pose, &self.normal),
            edges: [[[0.0; LANES]; 3]; 2],
            has_edges: self.has_edges,
        };
        if self.has_edges {
            for side in 0..2 {
                there.edges[side] = turned::<I>(pose, &self.edges[side]);
            }
        }
        there
    }

    /// Amplitudes, real and imaginary part, as [`Scatterers::surface_amplitude`].
    #[inline(always)]
    fn surface_amplitude<I: Isa>(&self, array: &Array, weights: &Weights, t: &Sights, r: &Sights) -> [Lanes; 2] {
        let splat = <I::F64 as Vector>::splat;
        let load = |lanes: &Lanes| I::F64::load(lanes);
        let zero = splat(0.0);
        let cos_t = zero.sub(dot::<I>(&self.normal, &t.direction)).max(zero);
        let cos_r = zero.sub(dot::<I>(&self.normal, &r.direction)).max(zero);
        let mut specular = cos_t.add(cos_r);
        if self.has_edges {
            // Half the wave vectors' sum, in turns per metre.
            let rate = splat(0.5 * array.frequency / SPEED_OF_LIGHT);
            let mut sum = [[0.0; LANES]; 3];
            for axis in 0..3 {
                let both = load(&t.direction[axis]).add(load(&r.direction[axis]));
                both.store(&mut sum[axis]);
            }
            for side in 0..2 {
                let turns = dot::<I>(&sum, &self.edges[side]).mul(rate);
                specular = specular.mul(sinc_turns(turns));
            }
        }
        let diffuse = cos_t.mul(cos_r).sqrt();
        let way = load(&t.distance).mul(load(&r.distance));
        let spreading = splat(array.power.sqrt()).mul(load(&t.gain)).mul(load(&r.gain)).div(way);
        let mut amplitude = [[0.0; LANES]; 2];
        for part in 0..2 {
            let sum = load(&weights.specular[part])
                .mul(specular)
                .add(load(&weights.diffuse[part]).mul(diffuse));
            sum.mul(spreading).store(&mut amplitude[part]);
        }
        amplitude
    }
}

/// Points of bodies in the sensor frame.
#[inline(always)]
fn placed<I: Isa>(poses: &Poses, points: &Lanes3) -> Lanes3 {
    let mut placed = turned::<I>(poses, points);
    for axis in 0..3 {
        let place = I::F64::load(&placed[axis]).add(I::F64::load(&poses.origin[axis]));
        place.store(&mut placed[axis]);
    }
    placed
}

/// Vectors of bodies, rotated to the axes of the sensor.
#[inline(always)]
fn turned<I: Isa>(poses: &Poses, vectors: &Lanes3) -> Lanes3 {
    let mut turned = [[0.0; LANES]; 3];
    for axis in 0..3 {
        let mut sum = I::F64::load(&vectors[0]).mul(I::F64::load(&poses.axes[0][axis]));
        for other in 1..3 {
            sum = I::F64::load(&vectors[other]).mul_add(I::F64::load(&poses.axes[other][axis]), sum);
        }
        sum.store(&mut turned[axis]);
    }
    turned
}

#[inline(always)]
fn dot<I: Isa>(a: &Lanes3, b: &Lanes3) -> I::F64 {
    let mut sum = I::F64::load(&a[0]).mul(I::F64::load(&b[0]));
    for axis in 1..3 {
        sum = I::F64::load(&a[axis]).mul_add(I::F64::load(&b[axis]), sum);
    }
    sum
}

/// Position and pattern of an antenna; transmitters come first.
#[inline(always)]
fn antenna_of(array: &Array, antenna: usize) -> (DVec3, &Pattern) {
    match antenna.checked_sub(array.tx.len()) {
        None => (array.tx[antenna], &array.tx_patterns[antenna]),
        Some(receiver) => (array.rx[receiver], &array.rx_patterns[receiver]),
    }
}

/// Offsets of points from a position [m].
#[inline(always)]
fn offsets<I: Isa>(points: &Lanes3, place: DVec3) -> Lanes3 {
    let mut offsets = [[0.0; LANES]; 3];
    for axis in 0..3 {
        let offset = I::F64::load(&points[axis]).sub(<I::F64 as Vector>::splat(place[axis]));
        offset.store(&mut offsets[axis]);
    }
    offsets
}

#[inline(always)]
fn distance<I: Isa>(offsets: &Lanes3) -> I::F64 {
    dot::<I>(offsets, offsets).sqrt()
}

/// Directions, distances and field gains from an antenna to points of the sensor frame.
#[inline(always)]
fn sights_of<I: Isa>(array: &Array, antenna: usize, points: &Lanes3) -> Sights {
    let (place, pattern) = antenna_of(array, antenna);
    let splat = <I::F64 as Vector>::splat;
    let offsets = offsets::<I>(points, place);
    let distance = distance::<I>(&offsets);
    let mut sights = Sights {
        distance: [0.0; LANES],
        direction: [[0.0; LANES]; 3],
        gain: field_gain::<I>(pattern, &offsets),
    };
    distance.store(&mut sights.distance);
    let inverse = splat(1.0).div(distance);
    for axis in 0..3 {
        let direction = I::F64::load(&offsets[axis]).mul(inverse);
        direction.store(&mut sights.direction[axis]);
    }
    sights
}

/// Square roots of the gains towards directions of any length.
#[inline(always)]
fn field_gain<I: Isa>(pattern: &Pattern, directions: &Lanes3) -> Lanes {
    let splat = <I::F64 as Vector>::splat;
    let mut gain = [0.0; LANES];
    match *pattern {
        Pattern::Gaussian {
            peak,
            azimuth,
            elevation,
        } => {
            gain = [peak.sqrt(); LANES];
            if azimuth != 0.0 || elevation != 0.0 {
                let x = I::F64::load(&directions[0]);
                let (y, z) = (I::F64::load(&directions[1]), I::F64::load(&directions[2]));
                let az = angle(y, x);
                let el = angle(z, x.mul(x).add(y.mul(y)).sqrt());
                let along = az.mul(az).mul(splat(-0.5 * azimuth));
                let across = el.mul(el).mul(splat(-0.5 * elevation));
                let decay = exp_of_negative(along.add(across));
                decay.mul(splat(peak.sqrt())).store(&mut gain);
            }
        }
        Pattern::Table(_) => {
            for lane in 0..LANES {
                let direction = DVec3::new(directions[0][lane], directions[1][lane], directions[2][lane]);
                gain[lane] = pattern.gain(direction).sqrt();
            }
        }
    }
    gain
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DMat3;

    use super::*;
    use crate::antennas::gain_table::Table;
    use crate::geometry::pose::Pose;
    use crate::rays::camera::ImagePlane;
    use crate::rays::hits::Cast;
    use crate::rays::scene::PosedScene;
    use crate::rays::smooth_hits::SmoothHits;
    use crate::rays::surface::{ShadingMode, Surface};
    use crate::scattering::material::{Material, Response};
    use crate::scattering::physical_optics::Sampling;
    use crate::scattering::refinement::Refinement;
    use crate::scattering::samples::Samples;

    fn array(pattern: &Pattern) -> Array {
        Array {
            tx: vec![DVec3::new(0.0, 0.01, 0.0), DVec3::new(0.0, -0.03, 0.01)],
            rx: vec![DVec3::ZERO, DVec3::new(0.0, 0.0, 0.02)],
            tx_patterns: vec![pattern.clone(); 2],
            rx_patterns: vec![pattern.clone(); 2],
            power: 2.0,
            frequency: 60e9,
            polarization: None,
        }
    }

    fn pose(x: f64, y: f64, turn: f64) -> Pose {
        Pose {
            rotation: DMat3::from_euler(glam::EulerRot::XYZ, turn, 0.3 * turn, -0.2),
            translation: DVec3::new(x, y, 0.1),
        }
    }

    fn plate() -> Arc<Surface> {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let vertices = corners.map(|[y, z]| DVec3::new(0.0, 0.3 * y, 0.3 * z));
        Arc::new(Surface::new(&vertices, &[[0, 2, 1], [0, 3, 2]], ShadingMode::Flat).unwrap())
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
        let snapshot = PosedScene::new(vec![plate(), plate()], poses.clone());
        for pattern in [beam, all_round, table] {
            let array = array(&pattern);
            let materials = vec![half_matt; 2];
            let hits = snapshot.cast_image(&plane).unwrap();
            let smooth = SmoothHits::at(&snapshot, &hits, Level::best());
            let of_pixels = Scatterers::new(
                &snapshot,
                &hits,
                &smooth,
                &materials,
                array.clone(),
                Sampling::Footprint,
                1,
            );
            let of_cells = [false, true].map(|end_points| {
                let refinement = Refinement {
                    base: plane,
                    rcs_floor: 1e-3,
                    follows_echo: false,
                    budget: None,
                    end_points,
                    beam: None,
                    join: 1.5,
                    skip_dark: true,
                    turns: &[],
                };
                let samples =
                    Samples::new(&snapshot, &Cast::default(), &materials, &array, &refinement, 1, None).unwrap();
                Scatterers::of_samples(&snapshot, &samples, &materials, array.clone())
            });
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
                        let paths = scatterers.paths_by(&kinematics, &other, selection, level).unwrap();
                        for (path, expected) in paths.delay.iter().zip(&expected.delay) {
                            assert!((path - expected).abs() <= 1e-15 * expected);
                        }
                        for (path, expected) in paths.amplitude.iter().zip(&expected.amplitude) {
                            assert!((path - expected).norm() <= 1e-13 * strongest, "{path} {expected}");
                        }
                    }
                }
            }
        }
    }
}
