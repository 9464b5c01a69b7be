//! Sixteen material points of rigid bodies at once: places, distances, gains and amplitudes in vectors.

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::pose::Pose;
use crate::numeric::simd::{Isa, Precision, Real, Vector};
use crate::numeric::trig::{angle, exp_of_negative, sinc_turns};
use crate::paths::kinematics::Kinematics;
use crate::paths::scatterers::Scatterers;

/// Paths of a step: numbers of two vectors in double precision, and of one in single precision.
pub(super) const STEP: usize = 16;

/// Numbers of a vector in double precision.
pub(super) const HALF: usize = STEP / 2;

/// One number of sixteen paths each.
pub(super) type Lanes<T> = [T; STEP];

/// Sixteen material points in coordinates of their bodies.
pub(super) struct Sixteen {
    bodies: Lanes<usize>,
    pub(super) position: [Lanes<f64>; 3],
    pub(super) normal: [Lanes<f64>; 3],
    pub(super) edges: [[Lanes<f64>; 3]; 2],
    pub(super) has_edges: bool,
}

/// Poses of the bodies of sixteen points.
#[allow(clippy::large_enum_variant)] // on the stack of a kernel; a box would be memory of the heap for every sixteen
pub(super) enum Poses<'a> {
    /// One body.
    One(&'a Pose),
    /// Several bodies: body axes as columns, and origins.
    Each([[Lanes<f64>; 3]; 3], [Lanes<f64>; 3]),
}

/// Directions, distances and field gains from an antenna to points, see [`crate::antennas::array::Sight`].
#[derive(Clone, Copy)]
pub(super) struct Sights<V> {
    distance: V,
    direction: [V; 3],
    gain: V,
}

/// Weights of sixteen points, see [`crate::paths::scatterers::Weight`].
#[derive(Clone, Copy)]
pub(super) struct Weights<T> {
    specular: [Lanes<T>; 2],
    diffuse: [Lanes<T>; 2],
}

/// Normals of points, and edges of their patches, in the sensor frame.
pub(super) struct Surface<V> {
    pub(super) normal: [V; 3],
    pub(super) edges: Option<[[V; 3]; 2]>,
}

impl Scatterers {
    /// Sixteen material points in coordinates of their bodies; none if one of the bodies deforms or one is no material
    /// point.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn sixteen(&self, numbers: &Lanes<usize>) -> Option<Sixteen> {
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
            if self.corners.get(number).is_some_and(Option::is_some) {
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
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn weigh<T: Real>(&self, numbers: &Lanes<usize>, weights: &mut [Weights<T>]) {
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

impl Sixteen {
    /// Poses of the bodies at a node.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn poses<'a>(&self, kinematics: &'a Kinematics, node: usize) -> Poses<'a> {
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
    #[cfg_attr(optimised, inline(always))]
    fn axis<I: Isa>(&self, column: usize, row: usize, half: usize) -> I::F64 {
        match self {
            Self::One(pose) => I::F64::splat(pose.rotation.col(column)[row]),
            Self::Each(axes, _) => I::F64::load(&axes[column][row][half..]),
        }
    }

    /// Points of bodies in the sensor frame, of the eight lanes from `half` on.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn placed<I: Isa>(&self, points: &[Lanes<f64>; 3], half: usize) -> [I::F64; 3] {
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
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn turned<I: Isa>(&self, vectors: &[Lanes<f64>; 3], half: usize) -> [I::F64; 3] {
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

    /// Vectors of bodies, rotated to the axes of the sensor, in a precision: of the lanes of one vector from `first` on.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn turned_to<T: Precision, I: Isa>(&self, vectors: &[Lanes<f64>; 3], first: usize) -> [T::In<I>; 3] {
        narrow::<T, I>(&self.turned::<I>(vectors, first), &self.turned::<I>(vectors, HALF))
    }
}

impl<T: Real> Weights<T> {
    pub(super) fn nothing() -> Self {
        Self {
            specular: [[T::zero(); STEP]; 2],
            diffuse: [[T::zero(); STEP]; 2],
        }
    }

    /// Specular and diffuse weights of a vector, from a lane on.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn load<V: Vector<Scalar = T>>(&self, first: usize) -> [[V; 2]; 2] {
        let (specular, diffuse) = (&self.specular, &self.diffuse);
        [
            [V::load(&specular[0][first..]), V::load(&specular[1][first..])],
            [V::load(&diffuse[0][first..]), V::load(&diffuse[1][first..])],
        ]
    }
}

impl<V: Vector> Surface<V> {
    /// Amplitudes times a factor, real and imaginary part, as [`Scatterers::surface_amplitude`].
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn amplitude(
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

/// Amplitudes of a channel behind the receiver.
#[cfg_attr(optimised, inline(always))]
pub(super) fn received<V: Vector>(
    array: &Array,
    channel: usize,
    amplitude: [V; 2],
    t: &Sights<V>,
    r: &Sights<V>,
) -> [V; 2] {
    let Some(response) = array.response(channel) else {
        return amplitude;
    };
    let mut length = [V::Scalar::of(0.0); STEP];
    t.distance.add(r.distance).store(&mut length);
    let mut gain = [length; 2];
    for lane in 0..V::LANES {
        let Complex64 { re, im } = response.gain(length[lane].wide());
        (gain[0][lane], gain[1][lane]) = (V::Scalar::of(re), V::Scalar::of(im));
    }
    let [re, im] = [V::load(&gain[0]), V::load(&gain[1])];
    [
        amplitude[0].mul(re).sub(amplitude[1].mul(im)),
        amplitude[0].mul(im).add(amplitude[1].mul(re)),
    ]
}

impl<V: Vector> Sights<V> {
    pub(super) fn nothing() -> Self {
        let zero = splat::<V>(0.0);
        Self {
            distance: zero,
            direction: [zero; 3],
            gain: zero,
        }
    }

    /// Directions, distances and field gains from an antenna, for offsets of the points from it [m].
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn new(pattern: &Pattern, offsets: &[V; 3]) -> Self {
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

#[cfg_attr(optimised, inline(always))]
fn splat<V: Vector>(x: f64) -> V {
    V::splat(V::Scalar::of(x))
}

/// Vectors in a precision: of the lower and upper eight lanes in single precision, of the lower ones in double precision.
#[cfg_attr(optimised, inline(always))]
pub(super) fn narrow<T: Precision, I: Isa>(low: &[I::F64; 3], high: &[I::F64; 3]) -> [T::In<I>; 3] {
    let mut narrowed = [T::narrow::<I>([low[0], high[0]]); 3];
    for axis in 1..3 {
        narrowed[axis] = T::narrow::<I>([low[axis], high[axis]]);
    }
    narrowed
}

#[cfg_attr(optimised, inline(always))]
pub(super) fn dot<V: Vector>(a: &[V; 3], b: &[V; 3]) -> V {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0].mul(b[0])))
}

/// Position and pattern of an antenna; transmitters come first.
#[cfg_attr(optimised, inline(always))]
pub(super) fn antenna_of(array: &Array, antenna: usize) -> (DVec3, &Pattern) {
    match antenna.checked_sub(array.tx.len()) {
        None => (array.tx[antenna], &array.tx_patterns[antenna]),
        Some(receiver) => (array.rx[receiver], &array.rx_patterns[receiver]),
    }
}

/// Offsets of points from a position [m].
#[cfg_attr(optimised, inline(always))]
pub(super) fn offsets<V: Vector>(points: &[V; 3], place: DVec3) -> [V; 3] {
    let mut offsets = *points;
    for axis in 0..3 {
        offsets[axis] = offsets[axis].sub(splat::<V>(place[axis]));
    }
    offsets
}

/// Square roots of the gains towards directions of any length.
#[cfg_attr(optimised, inline(always))]
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
        Pattern::Table(_) | Pattern::Turned(_) => {
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
