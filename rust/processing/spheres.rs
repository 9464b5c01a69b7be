//! Directions of targets near an array, whose waves are spherical.

use num_complex::Complex64;

/// Largest number of steps; with curvatures of tenths of a radian the second is exact to a millionth.
const MOST_STEPS: usize = 3;

/// The iteration ends with a change of the sines below this.
const SMALL_STEP: f64 = 1e-3;

/// Smallest component of a direction along x in slopes, which would be infinite at the rim.
const LEAST_FORWARD: f64 = 1e-3;

/// Antennas and channels about the centre of an array.
pub struct Aperture<'a> {
    /// Transmitters, if they have channels of their own, and receivers [m].
    pub antennas: &'a [[f64; 3]],
    pub num_receivers: usize,
    /// Phases per direction component along x, y and z [rad], about their means; zero along unobservable axes.
    pub channels: &'a [[f64; 3]],
    /// True for sines along y and z that the channels determine.
    pub observable: [bool; 2],
    /// Phase per distance [rad/m].
    pub wavenumber: f64,
}

/// Direction of a target.
pub struct Fit {
    pub sines: [f64; 2],
    /// Share of the power of the channels that one target does not explain.
    pub missing: f64,
}

/// Direction of a target at a distance [m]; `plane` is the direction of the plane wave that fits its channels best.
///
/// The wave is plane if the distance is not finite, or within twice the size of the array.
pub fn fit(array: &Aperture, waves: &[Complex64], plane: [f64; 2], distance: f64) -> Fit {
    let largest = array
        .antennas
        .iter()
        .map(|place| dot(*place, *place))
        .fold(0.0, f64::max);
    let is_near = distance.is_finite() && distance * distance > 4.0 * largest;
    let mut sines = plane;
    let mut turns = vec![Complex64::ONE; waves.len()];
    if is_near {
        for _ in 0..MOST_STEPS {
            let longer = path_excesses(array, sines, distance);
            let phases: Vec<_> = longer.iter().map(|(path, _)| array.wavenumber * path).collect();
            for ((turn, phase), (_, attenuation)) in turns.iter_mut().zip(&phases).zip(&longer) {
                *turn = Complex64::from_polar(*attenuation, -phase);
            }
            let shift = shift(array, sines, &phases);
            let next = within_front([plane[0] + shift[0], plane[1] + shift[1]]);
            let change = (next[0] - sines[0]).abs().max((next[1] - sines[1]).abs());
            sines = next;
            if change <= SMALL_STEP {
                break;
            }
        }
    }
    let toward = direction(sines);
    let (mut power, mut sum) = (0.0, Complex64::ZERO);
    for ((wave, turn), channel) in waves.iter().zip(&turns).zip(array.channels) {
        let flat = wave * turn;
        power += flat.norm_sqr();
        sum += flat * Complex64::cis(dot(*channel, toward));
    }
    let missing = (1.0 - sum.norm_sqr() / (waves.len() as f64 * power)).max(0.0);
    Fit { sines, missing }
}

/// Path of every channel less the path of the plane wave [m], and its distances relative to the centre's.
fn path_excesses(array: &Aperture, sines: [f64; 2], distance: f64) -> Vec<(f64, f64)> {
    let toward = direction(sines);
    let of_antenna = |place: &[f64; 3]| {
        // |d u - a| - d + a u without cancellation: distance d, direction u, antenna at a.
        let (along, square) = (dot(*place, toward), dot(*place, *place));
        let change = (square / distance - 2.0 * along) / distance;
        let ratio = (1.0 + change).sqrt();
        (along + change * distance / (1.0 + ratio), ratio)
    };
    let (senders, receivers) = array.antennas.split_at(array.antennas.len() - array.num_receivers);
    let receivers: Vec<_> = receivers.iter().map(of_antenna).collect();
    if senders.is_empty() {
        return receivers;
    }
    let senders = senders.iter().map(of_antenna);
    senders
        .flat_map(|(path, ratio)| receivers.iter().map(move |(back, other)| (path + back, ratio * other)))
        .collect()
}

/// Change of the sines when the phases are subtracted from the channels (least squares).
fn shift(array: &Aperture, sines: [f64; 2], phases: &[f64]) -> [f64; 2] {
    let forward = direction(sines)[0].max(LEAST_FORWARD);
    let slope = |channel: &[f64; 3]| -> [f64; 2] {
        [0, 1].map(|axis| {
            let along = channel[axis + 1] - channel[0] * sines[axis] / forward;
            if array.observable[axis] { along } else { 0.0 }
        })
    };
    let number = phases.len() as f64;
    let slopes: Vec<_> = array.channels.iter().map(slope).collect();
    let mean = [0, 1].map(|axis| slopes.iter().map(|slope| slope[axis]).sum::<f64>() / number);
    let (mut yy, mut zz, mut yz, mut by) = (0.0, 0.0, 0.0, [0.0; 2]);
    for (slope, phase) in slopes.iter().zip(phases) {
        let [y, z] = [slope[0] - mean[0], slope[1] - mean[1]];
        yy += y * y;
        zz += z * z;
        yz += y * z;
        by = [by[0] + y * phase, by[1] + z * phase];
    }
    // A sine that is not observable does not move.
    let [yy, zz] = [(yy, array.observable[0]), (zz, array.observable[1])]
        .map(|(sum, observable)| if observable { sum } else { 1.0 });
    let determinant = yy * zz - yz * yz;
    if determinant <= 0.0 {
        return [0.0; 2];
    }
    [
        (zz * by[0] - yz * by[1]) / determinant,
        (yy * by[1] - yz * by[0]) / determinant,
    ]
}

fn direction(sines: [f64; 2]) -> [f64; 3] {
    let [y, z] = sines;
    [(1.0 - y * y - z * z).max(0.0).sqrt(), y, z]
}

fn within_front(sines: [f64; 2]) -> [f64; 2] {
    let length = sines[0].hypot(sines[1]);
    if length > 1.0 {
        sines.map(|sine| sine / length)
    } else {
        sines
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
