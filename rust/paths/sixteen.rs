//! Sixteen material points of rigid bodies at once: places, distances, gains and amplitudes in vectors.

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::pose::Pose;
use crate::numeric::simd::{Isa, Precision, Real, Vector};
use crate::numeric::trig::{angle, exp_of_negative, sinc_turns, splat};
use crate::numeric::wide;
use crate::paths::scatterers::{PointKind, Scatterers};

/// Paths of a step: numbers of two vectors in double precision, and of one in single precision.
pub(super) const STEP: usize = 16;

/// Numbers of a vector in double precision.
pub(super) const HALF: usize = STEP / 2;

/// Sixteen material points in coordinates of their bodies.
pub(super) struct Sixteen {
    bodies: [usize; STEP],
    pub(super) position: [[f64; STEP]; 3],
    pub(super) normal: [[f64; STEP]; 3],
    pub(super) edges: [[[f64; STEP]; 3]; 2],
    pub(super) has_edges: bool,
}

/// Poses of the bodies of sixteen points: body axes as columns, and origins.
#[allow(clippy::large_enum_variant)] // on the stack of a kernel; a box would be memory of the heap for every sixteen
pub(super) enum Poses {
    /// One body.
    One([f64; 12]),
    /// Several bodies.
    Each([[f64; STEP]; 12]),
}

/// Directions, distances and field gains from an antenna to points, see [`crate::antennas::array::Sight`].
#[derive(Clone, Copy)]
pub(super) struct Sights<V> {
    distance: V,
    direction: [V; 3],
    gain: V,
}

impl Scatterers {
    /// Sixteen material points in coordinates of their bodies; none if one of the bodies deforms or one is a mirror or no
    /// material point.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn sixteen(&self, numbers: &[usize; STEP]) -> Option<Sixteen> {
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
            if self.corners.get(number).is_some_and(Option::is_some) || self.kind(number) == PointKind::Mirror {
                return None;
            }
            for axis in 0..3 {
                points.position[axis][lane] = self.position[number][axis];
                points.normal[axis][lane] = self.normal[number][axis];
            }
            if let Some(edges) = self.patch.get(number) {
                points.has_edges |= *edges != [DVec3::ZERO; 2];
                for axis in 0..3 {
                    points.edges[0][axis][lane] = edges[0][axis];
                    points.edges[1][axis][lane] = edges[1][axis];
                }
            }
        }
        Some(points)
    }

    /// Weights of sixteen material points, by channel: real and imaginary parts.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn weigh<T: Real>(&self, numbers: &[usize; STEP], weights: &mut [[[T; STEP]; 2]]) {
        for (channel, weights) in weights.iter_mut().enumerate() {
            for lane in 0..STEP {
                let weight = self.weight(numbers[lane], channel);
                weights[0][lane] = T::of(weight.re);
                weights[1][lane] = T::of(weight.im);
            }
        }
    }
}

impl Sixteen {
    /// Poses of the bodies, from the poses of all bodies.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn poses(&self, all: &[Pose]) -> Poses {
        let mut is_one = true;
        for lane in 1..STEP {
            is_one &= self.bodies[lane] == self.bodies[0];
        }
        if is_one {
            return Poses::One(numbers(&all[self.bodies[0]]));
        }
        let mut each = [[0.0; STEP]; 12];
        for lane in 0..STEP {
            let pose = numbers(&all[self.bodies[lane]]);
            for i in 0..12 {
                each[i][lane] = pose[i];
            }
        }
        Poses::Each(each)
    }
}

/// Columns of the rotation of a pose, and its translation.
#[cfg_attr(optimised, inline(always))]
fn numbers(pose: &Pose) -> [f64; 12] {
    let mut numbers = [0.0; 12];
    pose.rotation.write_cols_to_slice(&mut numbers);
    pose.translation.write_to_slice(&mut numbers[9..]);
    numbers
}

impl Poses {
    /// Body axis by number, or origin, number 3, of the eight lanes from `half` on.
    #[cfg_attr(optimised, inline(always))]
    fn column<I: Isa>(&self, number: usize, half: usize) -> [I::F64; 3] {
        let mut column = [splat::<I::F64>(0.0); 3];
        for row in 0..3 {
            column[row] = match self {
                Self::One(pose) => splat(pose[3 * number + row]),
                Self::Each(poses) => I::F64::load(&poses[3 * number + row][half..]),
            };
        }
        column
    }

    /// Points of bodies in the sensor frame, of the eight lanes from `half` on.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn placed<I: Isa>(&self, points: &[[f64; STEP]; 3], half: usize) -> [I::F64; 3] {
        wide::add(self.turned::<I>(points, half), self.column::<I>(3, half))
    }

    /// Vectors of bodies, rotated to the axes of the sensor, of the eight lanes from `half` on.
    #[cfg_attr(optimised, inline(always))]
    fn turned<I: Isa>(&self, vectors: &[[f64; STEP]; 3], half: usize) -> [I::F64; 3] {
        let mut sum = wide::mul([I::F64::load(&vectors[0][half..]); 3], self.column::<I>(0, half));
        for axis in 1..3 {
            sum = wide::mul_add(
                [I::F64::load(&vectors[axis][half..]); 3],
                self.column::<I>(axis, half),
                sum,
            );
        }
        sum
    }

    /// Vectors of bodies, rotated to the axes of the sensor, in a precision: of the lanes of one vector from `first`
    /// on.
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn turned_to<T: Precision, I: Isa>(&self, vectors: &[[f64; STEP]; 3], first: usize) -> [T::In<I>; 3] {
        narrow::<T, I>(&self.turned::<I>(vectors, first), &self.turned::<I>(vectors, HALF))
    }
}

/// Amplitudes of points of surfaces times a factor, real and imaginary part, as [`Scatterers::path`] before the
/// receiver: with normals and edges of patches in the sensor frame, and weights as in [`Scatterers::weigh`].
#[cfg_attr(optimised, inline(always))]
pub(super) fn surface_amplitude<V: Vector>(
    array: &Array,
    factor: f64,
    (normal, edges): (&[V; 3], Option<&[[V; 3]; 2]>),
    weight: &[V; 2],
    t: &Sights<V>,
    r: &Sights<V>,
) -> [V; 2] {
    let zero = splat::<V>(0.0);
    let cos_t = zero.sub(dot(normal, &t.direction)).max(zero);
    let cos_r = zero.sub(dot(normal, &r.direction)).max(zero);
    let mut cosines = cos_t.add(cos_r);
    if let Some(edges) = edges {
        // Half the wave vectors' sum, in turns per metre.
        let rate = splat::<V>(0.5 * array.frequency / SPEED_OF_LIGHT);
        let sum = wide::add(t.direction, r.direction);
        for side in 0..2 {
            cosines = cosines.mul(sinc_turns(dot(&sum, &edges[side]).mul(rate)));
        }
    }
    let way = t.distance.mul(r.distance);
    let spreading = splat::<V>(factor * array.power.sqrt()).mul(t.gain).mul(r.gain).div(way);
    wide::mul(wide::mul(*weight, [cosines; 2]), [spreading; 2])
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
    let [re, im] = each_lane([t.distance.add(r.distance)], |[length]| {
        let Complex64 { re, im } = response.gain(length);
        [re, im]
    });
    [
        amplitude[0].mul(re).sub(amplitude[1].mul(im)),
        amplitude[0].mul(im).add(amplitude[1].mul(re)),
    ]
}

/// Function of numbers of every lane, where it has no form in vectors.
#[cfg_attr(optimised, inline(always))]
fn each_lane<V: Vector, const N: usize, const M: usize>(
    vectors: [V; N],
    function: impl Fn([f64; N]) -> [f64; M],
) -> [V; M] {
    let mut lanes = [[V::Scalar::of(0.0); STEP]; N];
    for i in 0..N {
        vectors[i].store(&mut lanes[i]);
    }
    let mut results = [[V::Scalar::of(0.0); STEP]; M];
    for lane in 0..V::LANES {
        let result = function(lanes.map(|numbers| numbers[lane].wide()));
        for i in 0..M {
            results[i][lane] = V::Scalar::of(result[i]);
        }
    }
    let mut loaded = [splat(0.0); M];
    for i in 0..M {
        loaded[i] = V::load(&results[i]);
    }
    loaded
}

impl<V: Vector> Sights<V> {
    /// Directions, distances and field gains from an antenna, for offsets of the points from it [m].
    #[cfg_attr(optimised, inline(always))]
    pub(super) fn new(pattern: &Pattern, offsets: &[V; 3]) -> Self {
        let distance = dot(offsets, offsets).sqrt();
        Self {
            distance,
            direction: wide::mul(*offsets, [splat::<V>(1.0).div(distance); 3]),
            gain: field_gain(pattern, offsets),
        }
    }
}

/// Vectors in a precision: of the lower and upper eight lanes in single precision, of the lower ones in double
/// precision.
#[cfg_attr(optimised, inline(always))]
pub(super) fn narrow<T: Precision, I: Isa>(low: &[I::F64; 3], high: &[I::F64; 3]) -> [T::In<I>; 3] {
    let mut narrowed = [splat::<T::In<I>>(0.0); 3];
    for axis in 0..3 {
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
    wide::sub(*points, [splat(place.x), splat(place.y), splat(place.z)])
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
        Pattern::Table(_) | Pattern::Turned(_) => each_lane(*directions, |direction| {
            [pattern.gain(DVec3::from_array(direction)).sqrt()]
        })[0],
    }
}
