//! Delays and amplitudes of many paths: sixteen material points of rigid bodies at a time, all others one by one.
//!
//! Two forms: arrays in double precision of any paths, and rows of a chunk of paths for sums in lanes, whose amplitudes
//! have single precision.

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::geometry::pose::Pose;
use crate::numeric::simd::{Isa, Kernel, Level, Real, Vector};
use crate::numeric::trig::{angle, exp_of_negative, sinc_turns};
use crate::paths::kinematics::Kinematics;
use crate::paths::scatterers::{Members, Scatterers};
use crate::paths::series::{Paths, Selection};

/// Paths of a step: numbers of two vectors in double precision, and of one in single precision.
const STEP: usize = 16;

/// Numbers of a vector in double precision.
const HALF: usize = STEP / 2;

/// Number of paths that one thread evaluates together, at all times.
const BLOCK: usize = 16 * STEP;

/// One number of sixteen paths each.
type Lanes<T> = [T; STEP];

/// Rows of up to `N` paths of all channels, `(channel, node)`: values at the first node, and differences to them at the
/// others.
pub struct Rows<const N: usize> {
    /// Two-way delays [s].
    pub delay: Vec<[f64; N]>,
    /// Real parts of amplitudes times a factor [sqrt(W)].
    pub re: Vec<[f32; N]>,
    /// Imaginary parts.
    pub im: Vec<[f32; N]>,
}

impl<const N: usize> Rows<N> {
    /// Rows for numbers of nodes of delays and of amplitudes.
    pub fn new(num_channels: usize, num_nodes: [usize; 2]) -> Self {
        Self {
            delay: vec![[0.0; N]; num_channels * num_nodes[0]],
            re: vec![[0.0; N]; num_channels * num_nodes[1]],
            im: vec![[0.0; N]; num_channels * num_nodes[1]],
        }
    }
}

impl Scatterers {
    /// Delays of the selected members at the nodes of `kinematics`, and amplitudes at those of `amplitudes_at`.
    pub fn paths(
        &self,
        kinematics: &Kinematics,
        amplitudes_at: &Kinematics,
        members: &Members,
        selection: Selection,
    ) -> Result<Paths> {
        self.paths_by(kinematics, amplitudes_at, members, selection, Level::best())
    }

    /// Delays and amplitudes as [`Self::paths`], by an instruction set.
    pub fn paths_by(
        &self,
        kinematics: &Kinematics,
        amplitudes_at: &Kinematics,
        members: &Members,
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
                members,
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

    /// Rows of some paths, by number: delays at the nodes of `kinematics`, and amplitudes times `factor` at those of
    /// `amplitudes_at`.
    #[inline(always)] // part of kernels
    pub fn rows<I: Isa, const N: usize>(
        &self,
        kinematics: &Kinematics,
        amplitudes_at: &Kinematics,
        numbers: &[usize],
        factor: f64,
        rows: &mut Rows<N>,
    ) {
        let array = &self.array;
        let (num_channels, num_tx) = (array.num_channels(), array.tx.len());
        let num_antennas = num_tx + array.rx.len();
        let num_nodes = [kinematics.num_nodes, amplitudes_at.num_nodes];
        let nothing = [0.0_f64; STEP];
        let mut distances = vec![nothing; num_antennas];
        let mut sights = vec![Sights::<I::F32>::nothing(); num_antennas];
        let mut weights = vec![Weights::<f32>::nothing(); num_channels];
        for first in (0..numbers.len()).step_by(STEP) {
            let count = STEP.min(numbers.len() - first);
            let mut sixteen = [numbers[first + count - 1]; STEP];
            sixteen[..count].copy_from_slice(&numbers[first..first + count]);
            let Some(points) = self.sixteen(&sixteen) else {
                self.rows_one_by_one([kinematics, amplitudes_at], &sixteen[..count], first, factor, rows);
                continue;
            };
            self.weigh(&sixteen, &mut weights);
            for node in 0..num_nodes[0] {
                let poses = points.poses(kinematics, node);
                for half in [0, HALF] {
                    let position = poses.placed::<I>(&points.position, half);
                    for antenna in 0..num_antennas {
                        let offset = offsets(&position, antenna_of(array, antenna).0);
                        let distance = dot(&offset, &offset).sqrt();
                        distance.store(&mut distances[antenna][half..]);
                    }
                }
                for channel in 0..num_channels {
                    let row = &mut rows.delay[channel * num_nodes[0] + node][first..first + STEP];
                    let (tx, rx) = (
                        &distances[channel / array.rx.len()],
                        &distances[num_tx + channel % array.rx.len()],
                    );
                    for lane in 0..STEP {
                        row[lane] = (tx[lane] + rx[lane]) * (1.0 / SPEED_OF_LIGHT);
                    }
                }
            }
            for node in 0..num_nodes[1] {
                let poses = points.poses(amplitudes_at, node);
                let low = poses.placed::<I>(&points.position, 0);
                let high = poses.placed::<I>(&points.position, HALF);
                for antenna in 0..num_antennas {
                    let (place, pattern) = antenna_of(array, antenna);
                    // Rounded after the difference: near antennas keep their digits.
                    let offset = narrow::<I>(&offsets(&low, place), &offsets(&high, place));
                    sights[antenna] = Sights::new(pattern, &offset);
                }
                let normal = poses.turned_single::<I>(&points.normal);
                let mut edges = None;
                if points.has_edges {
                    let [u, v] = &points.edges;
                    edges = Some([poses.turned_single::<I>(u), poses.turned_single::<I>(v)]);
                }
                for channel in 0..num_channels {
                    let (t, r) = (
                        &sights[channel / array.rx.len()],
                        &sights[num_tx + channel % array.rx.len()],
                    );
                    let surface = Surface { normal, edges };
                    let amplitude = surface.amplitude(array, factor, &weights[channel].load(0), t, r);
                    let row = channel * num_nodes[1] + node;
                    for (part, rows) in [&mut rows.re, &mut rows.im].into_iter().enumerate() {
                        amplitude[part].store(&mut rows[row][first..]);
                        rows[row][first + count..first + STEP].fill(0.0);
                    }
                }
            }
        }
        subtract_first(&mut rows.delay, num_nodes[0]);
        subtract_first(&mut rows.re, num_nodes[1]);
        subtract_first(&mut rows.im, num_nodes[1]);
    }

    /// Rows of paths that are evaluated one by one, for the entries from `first` on.
    #[inline(never)]
    fn rows_one_by_one<const N: usize>(
        &self,
        [kinematics, amplitudes_at]: [&Kinematics; 2],
        numbers: &[usize],
        first: usize,
        factor: f64,
        rows: &mut Rows<N>,
    ) {
        let num_nodes = kinematics.num_nodes;
        for (row, out) in rows.delay.iter_mut().enumerate() {
            let (channel, node) = (row / num_nodes, row % num_nodes);
            let last = numbers[numbers.len() - 1];
            out[first..first + STEP].fill(self.path(kinematics, node, channel, last).0);
            for (lane, number) in numbers.iter().enumerate() {
                out[first + lane] = self.path(kinematics, node, channel, *number).0;
            }
        }
        let num_nodes = amplitudes_at.num_nodes;
        for (row, (re, im)) in rows.re.iter_mut().zip(&mut rows.im).enumerate() {
            let (channel, node) = (row / num_nodes, row % num_nodes);
            re[first..first + STEP].fill(0.0);
            im[first..first + STEP].fill(0.0);
            for (lane, number) in numbers.iter().enumerate() {
                let amplitude = factor * self.path(amplitudes_at, node, channel, *number).1;
                (re[first + lane], im[first + lane]) = (amplitude.re as f32, amplitude.im as f32);
            }
        }
    }

    /// Sixteen material points in coordinates of their bodies; none if one of the bodies deforms or one is no material
    /// point.
    #[inline(always)]
    fn sixteen(&self, numbers: &Lanes<usize>) -> Option<Sixteen> {
        let mut points = Sixteen {
            bodies: [0; STEP],
            position: [[0.0; STEP]; 3],
            normal: [[0.0; STEP]; 3],
            edges: [[[0.0; STEP]; 3]; 2],
            has_edges: false,
        };
        for lane in 0..STEP {
            let number = numbers[lane];
            points.bodies[lane] = *self.body.get(number)? as usize;
            if self.facet.get(number).is_some_and(Option::is_some) {
                return None;
            }
            for axis in 0..3 {
                points.position[axis][lane] = self.position[number][axis];
                points.normal[axis][lane] = self.normal[number][axis];
            }
        }
        if !self.patch.is_empty() {
            for lane in 0..STEP {
                let edges = self.patch[numbers[lane]];
                points.has_edges |= edges != [DVec3::ZERO; 2];
                for axis in 0..3 {
                    points.edges[0][axis][lane] = edges[0][axis];
                    points.edges[1][axis][lane] = edges[1][axis];
                }
            }
        }
        Some(points)
    }

    /// Weights of sixteen material points, by channel.
    #[inline(always)]
    fn weigh<T: Real>(&self, numbers: &Lanes<usize>, weights: &mut [Weights<T>]) {
        for (channel, weights) in weights.iter_mut().enumerate() {
            for lane in 0..STEP {
                let weight = self.weight(numbers[lane], channel);
                weights.specular[0][lane] = T::of(weight.specular.re);
                weights.specular[1][lane] = T::of(weight.specular.im);
                weights.diffuse[0][lane] = T::of(weight.diffuse.re);
                weights.diffuse[1][lane] = T::of(weight.diffuse.im);
            }
        }
    }
}

/// Subtract the first row of every channel from its other rows.
#[inline(always)]
fn subtract_first<T: Real, const N: usize>(rows: &mut [[T; N]], num_nodes: usize) {
    for rows in rows.chunks_mut(num_nodes) {
        if let [first, others @ ..] = rows {
            for row in others {
                for i in 0..N {
                    row[i] = row[i] - first[i];
                }
            }
        }
    }
}

/// Evaluation of a block of paths.
struct EvaluateBlock<'a> {
    scatterers: &'a Scatterers,
    kinematics: &'a Kinematics<'a>,
    amplitudes_at: &'a Kinematics<'a>,
    members: &'a Members,
    selection: Selection,
    /// First path of the block and number of paths, among the selected ones.
    first: usize,
    count: usize,
    /// Part of the block in every row `(node, channel)`.
    delays: Vec<&'a mut [f64]>,
    amplitudes: Vec<&'a mut [Complex64]>,
}

/// Sixteen material points in coordinates of their bodies.
struct Sixteen {
    bodies: Lanes<usize>,
    position: [Lanes<f64>; 3],
    normal: [Lanes<f64>; 3],
    edges: [[Lanes<f64>; 3]; 2],
    has_edges: bool,
}

/// Poses of the bodies of sixteen points.
enum Poses<'a> {
    /// One body.
    One(&'a Pose),
    /// Several bodies: body axes as columns, and origins.
    Each([[Lanes<f64>; 3]; 3], [Lanes<f64>; 3]),
}

/// Directions, distances and field gains from an antenna to points, see [`crate::antennas::array::Sight`].
#[derive(Clone, Copy)]
struct Sights<V> {
    distance: V,
    direction: [V; 3],
    gain: V,
}

/// Weights of sixteen points, see [`crate::paths::scatterers::Weight`].
#[derive(Clone, Copy)]
struct Weights<T> {
    specular: [Lanes<T>; 2],
    diffuse: [Lanes<T>; 2],
}

/// Normals of points, and edges of their patches, in the sensor frame.
struct Surface<V> {
    normal: [V; 3],
    edges: Option<[[V; 3]; 2]>,
}

impl Kernel for EvaluateBlock<'_> {
    type Output = ();

    #[inline(always)] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let scatterers = self.scatterers;
        let array = &scatterers.array;
        let (num_channels, num_tx) = (array.num_channels(), array.tx.len());
        let num_antennas = num_tx + array.rx.len();
        let mut sights = vec![Sights::<I::F64>::nothing(); num_antennas];
        let mut weights = vec![Weights::<f64>::nothing(); num_channels];
        let mut distances = vec![<I::F64 as Vector>::splat(0.0); num_antennas];
        for first in (0..self.count).step_by(STEP) {
            let count = STEP.min(self.count - first);
            let mut numbers = [0; STEP];
            for lane in 0..STEP {
                let place = self.first + first + lane.min(count - 1);
                let member = self.selection.first + place * self.selection.step;
                numbers[lane] = self.members.number(scatterers, member);
            }
            let Some(points) = scatterers.sixteen(&numbers) else {
                self.one_by_one(first, &numbers[..count]);
                continue;
            };
            scatterers.weigh(&numbers, &mut weights);
            for half in (0..count).step_by(HALF) {
                let some = first + half..first + count.min(half + HALF);
                for node in 0..self.kinematics.num_nodes {
                    let position = points.poses(self.kinematics, node).placed::<I>(&points.position, half);
                    for antenna in 0..num_antennas {
                        let offset = offsets(&position, antenna_of(array, antenna).0);
                        distances[antenna] = dot(&offset, &offset).sqrt();
                    }
                    for channel in 0..num_channels {
                        let tx = distances[channel / array.rx.len()];
                        let rx = distances[num_tx + channel % array.rx.len()];
                        let speed = <I::F64 as Vector>::splat(SPEED_OF_LIGHT);
                        let mut delay = [0.0; HALF];
                        tx.add(rx).div(speed).store(&mut delay);
                        let row = &mut self.delays[node * num_channels + channel];
                        row[some.clone()].copy_from_slice(&delay[..some.len()]);
                    }
                }
                for node in 0..self.amplitudes_at.num_nodes {
                    let poses = points.poses(self.amplitudes_at, node);
                    let position = poses.placed::<I>(&points.position, half);
                    for antenna in 0..num_antennas {
                        let (place, pattern) = antenna_of(array, antenna);
                        sights[antenna] = Sights::new(pattern, &offsets(&position, place));
                    }
                    let normal = poses.turned::<I>(&points.normal, half);
                    let mut edges = None;
                    if points.has_edges {
                        let [u, v] = &points.edges;
                        edges = Some([poses.turned::<I>(u, half), poses.turned::<I>(v, half)]);
                    }
                    let surface = Surface { normal, edges };
                    for channel in 0..num_channels {
                        let tx = &sights[channel / array.rx.len()];
                        let rx = &sights[num_tx + channel % array.rx.len()];
                        let amplitude = surface.amplitude(array, 1.0, &weights[channel].load(half), tx, rx);
                        let mut parts = [[0.0; HALF]; 2];
                        for part in 0..2 {
                            amplitude[part].store(&mut parts[part]);
                        }
                        let row = &mut self.amplitudes[node * num_channels + channel];
                        for (lane, out) in row[some.clone()].iter_mut().enumerate() {
                            *out = Complex64::new(parts[0][lane], parts[1][lane]);
                        }
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

impl Sixteen {
    /// Poses of the bodies at a node.
    #[inline(always)]
    fn poses<'a>(&self, kinematics: &Kinematics<'a>, node: usize) -> Poses<'a> {
        let of = &kinematics.poses[node * kinematics.num_bodies..];
        let mut is_one = true;
        for lane in 1..STEP {
            is_one &= self.bodies[lane] == self.bodies[0];
        }
        if is_one {
            return Poses::One(&of[self.bodies[0]]);
        }
        let (mut axes, mut origin) = ([[[0.0; STEP]; 3]; 3], [[0.0; STEP]; 3]);
        for lane in 0..STEP {
            let pose = &of[self.bodies[lane]];
            for row in 0..3 {
                for column in 0..3 {
                    axes[column][row][lane] = pose.rotation.col(column)[row];
                }
                origin[row][lane] = pose.translation[row];
            }
        }
        Poses::Each(axes, origin)
    }
}

impl Poses<'_> {
    /// Component of a body axis, of the eight lanes from `half` on.
    #[inline(always)]
    fn axis<I: Isa>(&self, column: usize, row: usize, half: usize) -> I::F64 {
        match self {
            Self::One(pose) => I::F64::splat(pose.rotation.col(column)[row]),
            Self::Each(axes, _) => I::F64::load(&axes[column][row][half..]),
        }
    }

    /// Points of bodies in the sensor frame, of the eight lanes from `half` on.
    #[inline(always)]
    fn placed<I: Isa>(&self, points: &[Lanes<f64>; 3], half: usize) -> [I::F64; 3] {
        let mut placed = self.turned::<I>(points, half);
        for axis in 0..3 {
            let origin = match self {
                Self::One(pose) => I::F64::splat(pose.translation[axis]),
                Self::Each(_, origin) => I::F64::load(&origin[axis][half..]),
            };
            placed[axis] = placed[axis].add(origin);
        }
        placed
    }

    /// Vectors of bodies, rotated to the axes of the sensor, of the eight lanes from `half` on.
    #[inline(always)]
    fn turned<I: Isa>(&self, vectors: &[Lanes<f64>; 3], half: usize) -> [I::F64; 3] {
        let first = I::F64::load(&vectors[0][half..]);
        let mut turned = [first; 3];
        for axis in 0..3 {
            let mut sum = first.mul(self.axis::<I>(0, axis, half));
            for other in 1..3 {
                let part = I::F64::load(&vectors[other][half..]);
                sum = part.mul_add(self.axis::<I>(other, axis, half), sum);
            }
            turned[axis] = sum;
        }
        turned
    }

    /// Vectors of bodies, rotated to the axes of the sensor, in single precision.
    #[inline(always)]
    fn turned_single<I: Isa>(&self, vectors: &[Lanes<f64>; 3]) -> [I::F32; 3] {
        narrow::<I>(&self.turned::<I>(vectors, 0), &self.turned::<I>(vectors, HALF))
    }
}

impl<T: Real> Weights<T> {
    fn nothing() -> Self {
        Self {
            specular: [[T::zero(); STEP]; 2],
            diffuse: [[T::zero(); STEP]; 2],
        }
    }

    /// Specular and diffuse weights of a vector, from a lane on.
    #[inline(always)]
    fn load<V: Vector<Scalar = T>>(&self, first: usize) -> [[V; 2]; 2] {
        let (specular, diffuse) = (&self.specular, &self.diffuse);
        [
            [V::load(&specular[0][first..]), V::load(&specular[1][first..])],
            [V::load(&diffuse[0][first..]), V::load(&diffuse[1][first..])],
        ]
    }
}

impl<V: Vector> Surface<V> {
    /// Amplitudes times a factor, real and imaginary part, as [`Scatterers::surface_amplitude`].
    #[inline(always)]
    fn amplitude(
        &self,
        array: &Array,
        factor: f64,
        [specular_weight, diffuse_weight]: &[[V; 2]; 2],
        t: &Sights<V>,
        r: &Sights<V>,
    ) -> [V; 2] {
        let zero = splat::<V>(0.0);
        let cos_t = zero.sub(dot(&self.normal, &t.direction)).max(zero);
        let cos_r = zero.sub(dot(&self.normal, &r.direction)).max(zero);
        let mut specular = cos_t.add(cos_r);
        if let Some(edges) = &self.edges {
            // Half the wave vectors' sum, in turns per metre.
            let rate = splat::<V>(0.5 * array.frequency / SPEED_OF_LIGHT);
            let mut sum = t.direction;
            for axis in 0..3 {
                sum[axis] = sum[axis].add(r.direction[axis]);
            }
            for side in 0..2 {
                specular = specular.mul(sinc_turns(dot(&sum, &edges[side]).mul(rate)));
            }
        }
        let diffuse = cos_t.mul(cos_r).sqrt();
        let way = t.distance.mul(r.distance);
        let spreading = splat::<V>(factor * array.power.sqrt()).mul(t.gain).mul(r.gain).div(way);
        let mut amplitude = [zero; 2];
        for part in 0..2 {
            let sum = specular_weight[part].mul(specular);
            amplitude[part] = diffuse_weight[part].mul_add(diffuse, sum).mul(spreading);
        }
        amplitude
    }
}

impl<V: Vector> Sights<V> {
    fn nothing() -> Self {
        let zero = splat::<V>(0.0);
        Self {
            distance: zero,
            direction: [zero; 3],
            gain: zero,
        }
    }

    /// Directions, distances and field gains from an antenna, for offsets of the points from it [m].
    #[inline(always)]
    fn new(pattern: &Pattern, offsets: &[V; 3]) -> Self {
        let distance = dot(offsets, offsets).sqrt();
        let inverse = splat::<V>(1.0).div(distance);
        let mut direction = *offsets;
        for axis in 0..3 {
            direction[axis] = direction[axis].mul(inverse);
        }
        Self {
            distance,
            direction,
            gain: field_gain(pattern, offsets),
        }
    }
}

#[inline(always)]
fn splat<V: Vector>(x: f64) -> V {
    V::splat(V::Scalar::of(x))
}

/// Vectors in single precision, from their lower and upper eight lanes.
#[inline(always)]
fn narrow<I: Isa>(low: &[I::F64; 3], high: &[I::F64; 3]) -> [I::F32; 3] {
    let mut narrowed = [I::narrow(low[0], high[0]); 3];
    for axis in 1..3 {
        narrowed[axis] = I::narrow(low[axis], high[axis]);
    }
    narrowed
}

#[inline(always)]
fn dot<V: Vector>(a: &[V; 3], b: &[V; 3]) -> V {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
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
fn offsets<V: Vector>(points: &[V; 3], place: DVec3) -> [V; 3] {
    let mut offsets = *points;
    for axis in 0..3 {
        offsets[axis] = offsets[axis].sub(splat::<V>(place[axis]));
    }
    offsets
}

/// Square roots of the gains towards directions of any length.
#[inline(always)]
fn field_gain<V: Vector>(pattern: &Pattern, directions: &[V; 3]) -> V {
    match *pattern {
        Pattern::Gaussian {
            peak,
            azimuth,
            elevation,
        } => {
            let peak = splat::<V>(peak.sqrt());
            if azimuth == 0.0 && elevation == 0.0 {
                return peak;
            }
            let [x, y, z] = *directions;
            let az = angle(y, x);
            let el = angle(z, x.mul(x).add(y.mul(y)).sqrt());
            let along = az.mul(az).mul(splat::<V>(-0.5 * azimuth));
            let across = el.mul(el).mul(splat::<V>(-0.5 * elevation));
            exp_of_negative(along.add(across)).mul(peak)
        }
        Pattern::Table(_) => {
            let mut lanes = [[V::Scalar::of(0.0); STEP]; 3];
            for axis in 0..3 {
                directions[axis].store(&mut lanes[axis]);
            }
            let mut gain = [V::Scalar::of(0.0); STEP];
            for lane in 0..V::LANES {
                let [x, y, z] = [0, 1, 2].map(|axis| lanes[axis][lane].wide());
                gain[lane] = V::Scalar::of(pattern.gain(DVec3::new(x, y, z)).sqrt());
            }
            V::load(&gain)
        }
    }
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

    /// Most paths of the rows.
    const ROW: usize = 128;

    struct OfRows<'a>([&'a Kinematics<'a>; 2], &'a Scatterers, &'a Members, Selection);

    impl Kernel for OfRows<'_> {
        type Output = Rows<ROW>;

        #[inline(always)]
        fn run<I: Isa>(self) -> Rows<ROW> {
            let Self([delays, amplitudes], scatterers, members, selection) = self;
            let mut rows = Rows::new(scatterers.num_channels(), [delays.num_nodes, amplitudes.num_nodes]);
            let numbers: Vec<usize> = (selection.first..selection.last)
                .step_by(selection.step)
                .take(ROW)
                .map(|member| members.number(scatterers, member))
                .collect();
            scatterers.rows::<I, ROW>(delays, amplitudes, &numbers, 1024.0, &mut rows);
            rows
        }
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
                    reflections: &[],
                };
                let samples =
                    Samples::new(&snapshot, &Cast::default(), &materials, &array, &refinement, 1, None).unwrap();
                Scatterers::of_samples(&snapshot, &samples, &materials, array.clone(), |_| 0)
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
                    let members = Members::all(&scatterers, 1);
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
                        let paths = scatterers
                            .paths_by(&kinematics, &other, &members, selection, level)
                            .unwrap();
                        for (path, expected) in paths.delay.iter().zip(&expected.delay) {
                            assert!((path - expected).abs() <= 1e-15 * expected);
                        }
                        for (path, expected) in paths.amplitude.iter().zip(&expected.amplitude) {
                            assert!((path - expected).norm() <= 1e-13 * strongest, "{path} {expected}");
                        }
                        let rows = level.run(OfRows([&kinematics, &other], &scatterers, &members, selection));
                        for (row, expected) in expected.delay.chunks(selection.len()).enumerate() {
                            // Rows are by channel and node, differences to the first node.
                            let (node, channel) = (row / 4, row % 4);
                            for (i, expected) in expected.iter().enumerate().take(ROW) {
                                let [first, this] = [0, node].map(|node| rows.delay[2 * channel + node][i]);
                                let delay = if node == 0 { first } else { first + this };
                                assert!((delay - expected).abs() <= 1e-15 * expected);
                            }
                        }
                        for (channel, expected) in expected.amplitude.chunks(selection.len()).enumerate() {
                            for (i, expected) in expected.iter().enumerate().take(ROW) {
                                let [re, im] = [&rows.re, &rows.im].map(|rows| f64::from(rows[channel][i]) / 1024.0);
                                let error = (Complex64::new(re, im) - expected).norm();
                                assert!(error <= 2e-6 * expected.norm() + 1e-7 * strongest, "{error}");
                            }
                        }
                    }
                }
            }
        }
    }
}
