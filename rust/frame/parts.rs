//! Parts of a frame: consecutive chirps whose rays are cast together, as bodies turn too far for one cast.

use std::ops::Range;

use glam::DVec3;

use super::model::Model;
use crate::geometry::pose::Pose;
use crate::numeric::chebyshev::chebyshev_nodes;
use crate::paths::placement::Placement;
use crate::synthesis::chirp::Waveform;

/// Consecutive chirps of a frame with a cast of their own, in the middle of their time.
pub struct Part {
    /// Numbers of the chirps.
    pub chirps: Range<usize>,
    /// Waveform of these chirps alone; the first starts at time 0.
    pub waveform: Waveform,
    /// Start of the first ramp after that of the frame [s].
    pub start: f64,
    /// Time of the cast, `x` from -1 to 1 over the frame, and half the duration in that unit.
    pub cast: f64,
    /// Half the duration of the part, in the unit of `cast`.
    pub half: f64,
    /// Angle by which every body turns from the cast to either end of the part, seen from the sensor [rad].
    pub turns: Vec<f64>,
    /// True for the part that contains the middle of the frame, which gives the truth.
    pub has_middle: bool,
}

/// Parts within which no body turns by more than the limit of the settings, at the rates of the middle of the frame.
pub fn of_frame(model: &Model, placement: &Placement, rates: &Placement) -> Vec<Part> {
    let (poses, pose_rates) = (placement.poses_at(0.0), rates.poses_at(0.0));
    // A depth image has no boxes, and is never cast.
    let each = model.boxes.iter().zip(poses.iter().zip(&pose_rates));
    let turn_rates: Vec<f64> = each
        .map(|(corners, (pose, rate))| turn_rate(corners, pose, rate))
        .collect();
    let fastest = turn_rates.iter().copied().fold(0.0, f64::max);
    let ranges = split(&model.waveform, fastest, model.settings.retrace);
    let number = ranges.len();
    let middle = 0.5 * model.waveform.duration();
    let mut parts: Vec<Part> = ranges
        .into_iter()
        .map(|chirps| Part::new(&model.waveform, chirps, number))
        .collect();
    let distance = |part: &Part| (part.start + 0.5 * part.waveform.duration() - middle).abs();
    let nearest = (0..number).min_by(|a, b| distance(&parts[*a]).total_cmp(&distance(&parts[*b])));
    if let Some(nearest) = nearest {
        parts[nearest].has_middle = true;
    }
    for part in &mut parts {
        let half = 0.5 * part.waveform.duration();
        part.turns = turn_rates.iter().map(|rate| rate * half).collect();
    }
    parts
}

impl Part {
    /// Chebyshev times of the part as times of the frame, `x` from -1 to 1.
    pub fn node_times(&self, number: usize) -> Vec<f64> {
        let nodes = chebyshev_nodes(number).into_iter();
        nodes.map(|x| self.cast + self.half * x).collect()
    }

    fn new(waveform: &Waveform, chirps: Range<usize>, number: usize) -> Self {
        let duration = waveform.duration();
        if number == 1 {
            let waveform = waveform.clone();
            return Self {
                chirps,
                waveform,
                start: 0.0,
                cast: 0.0,
                half: 1.0,
                turns: Vec::new(),
                has_middle: false,
            };
        }
        let start = waveform.chirp_times[chirps.start];
        let own = Waveform {
            chirp_times: waveform.chirp_times[chirps.clone()]
                .iter()
                .map(|time| time - start)
                .collect(),
            ..waveform.clone()
        };
        Self {
            chirps,
            start,
            cast: (2.0 * start + own.duration()) / duration - 1.0,
            half: own.duration() / duration,
            waveform: own,
            turns: Vec::new(),
            has_middle: false,
        }
    }
}

/// Angular rate of the aspect of a body [rad/s], by rotation or by passing the sensor: the largest rate of the
/// direction to the sensor, in body axes, over the corners of the bounding box and the point of the box nearest to the
/// sensor.
fn turn_rate(&[low, high]: &[DVec3; 2], pose: &Pose, rate: &Pose) -> f64 {
    if low.cmpgt(high).any() {
        return 0.0;
    }
    let sensor = pose.point_to_body(DVec3::ZERO);
    let velocity = -(rate.rotation.transpose() * pose.translation) - pose.rotation.transpose() * rate.translation;
    let nearest = sensor.clamp(low, high);
    let corner = |number: u32| {
        DVec3::new(
            if number & 1 == 0 { low.x } else { high.x },
            if number & 2 == 0 { low.y } else { high.y },
            if number & 4 == 0 { low.z } else { high.z },
        )
    };
    let places = (0..8).map(corner).chain((nearest != sensor).then_some(nearest));
    places.fold(0.0, |fastest: f64, place| {
        let offset = sensor - place;
        let distance = offset.length().max(f64::MIN_POSITIVE);
        let along = velocity.dot(offset) / distance;
        fastest.max((velocity.length_squared() - along * along).max(0.0).sqrt() / distance)
    })
}

/// Split the chirps into an odd number of parts of equal duration, so that one contains the middle; chirps are not cut.
/// Within a part no body turns by more than `most` [rad] from the middle of the part.
fn split(waveform: &Waveform, turn_rate: f64, most: f64) -> Vec<Range<usize>> {
    let starts = &waveform.chirp_times;
    let (first, last) = (starts[0], waveform.duration());
    let wanted = (0.5 * turn_rate * (last - first) / most)
        .ceil()
        .clamp(1.0, 2.0 * starts.len() as f64);
    let number = wanted as usize | 1;
    let edge = |i: usize| first + (last - first) * i as f64 / number as f64 - 1e-9 * (last - first);
    let mut ends = vec![0];
    for i in 1..number {
        ends.push(starts.partition_point(|start| *start < edge(i)));
    }
    ends.push(starts.len());
    ends.dedup();
    ends.windows(2).map(|pair| pair[0]..pair[1]).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;
    use glam::DMat3;

    fn waveform() -> Waveform {
        Waveform {
            start_frequency: 60e9,
            slope: 1e13,
            sample_rate: 2e6,
            adc_delay: 0.0,
            num_samples: 64,
            chirp_times: (0..64).map(|chirp| f64::from(chirp) * 3e-4).collect(),
        }
    }

    #[test]
    fn parts_are_odd_in_number_and_have_all_chirps_once() {
        let wf = waveform();
        assert_eq!(split(&wf, 0.0, 0.1).len(), 1);
        assert_eq!(split(&wf, 1e9, f64::INFINITY).len(), 1);
        for turn_rate in [5.0, 20.0, 100.0, 1e9] {
            let parts = split(&wf, turn_rate, 0.1);
            assert!(parts.len() % 2 == 1 || parts.len() == 64, "{}", parts.len());
            assert_eq!(parts.iter().map(ExactSizeIterator::len).sum::<usize>(), 64);
            assert!(parts.windows(2).all(|pair| pair[0].end == pair[1].start));
            // Half the duration of a part, at this rate, is within 0.1 rad, unless a chirp is cut no more.
            let longest = parts.iter().map(ExactSizeIterator::len).max().unwrap();
            assert!(longest == 1 || 0.5 * turn_rate * 3e-4 * (longest - 1) as f64 <= 0.1);
        }
    }

    #[test]
    fn body_that_passes_by_turns_as_seen_from_its_nearest_point() {
        let surface = [DVec3::new(0.0, -0.1, -0.1), DVec3::new(0.0, 0.1, 0.1)];
        let pose = Pose {
            rotation: DMat3::IDENTITY,
            translation: DVec3::new(2.0, 0.0, 0.0),
        };
        let still = DMat3::ZERO;
        let passing = Pose {
            rotation: still,
            translation: DVec3::new(0.0, 3.0, 0.0),
        };
        assert!((turn_rate(&surface, &pose, &passing) - 1.5).abs() < 1e-12);
        let turning = Pose {
            rotation: DMat3::from_rotation_z(FRAC_PI_2) * 4.0,
            translation: DVec3::ZERO,
        };
        let got = turn_rate(&surface, &pose, &turning);
        // d/dt R = 4 (z x) R up to the part along z; the direction to the sensor turns at 4 rad/s seen from the origin,
        // and a little faster where that is nearer.
        assert!((4.0..4.1).contains(&got), "{got}");
    }
}
