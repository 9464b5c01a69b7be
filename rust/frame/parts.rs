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
    /// Largest angle by which every body turns from the cast to any time of the part, seen from the sensor [rad].
    pub turns: Vec<f64>,
    /// True for the part that contains the middle of the frame, which gives the truth.
    pub has_middle: bool,
}

/// Parts within which no body turns by more than the limit of the settings from the pose in which it is cast.
pub fn of_frame(model: &Model, placement: &Placement) -> Vec<Part> {
    let (waveform, most) = (&model.waveform, model.settings.retrace);
    let most_parts = 2 * waveform.chirp_times.len() + 1;
    let mut number = 1;
    let turns = loop {
        // A depth image has no boxes, and is never cast.
        let turns = turns(&model.boxes, placement, number);
        let largest = turns.iter().flatten().copied().fold(0.0, f64::max);
        if largest <= most || number >= most_parts {
            break turns;
        }
        // An odd number, so that one part contains the middle of the frame.
        let wanted = (number as f64 * largest / most).ceil().min(most_parts as f64);
        number = (wanted as usize | 1).max(number + 2);
    };
    let middle = 0.5 * waveform.duration();
    let mut parts: Vec<Part> = split(waveform, number)
        .into_iter()
        .map(|(at, chirps)| Part {
            turns: turns[at].clone(),
            ..Part::new(waveform, chirps, number)
        })
        .collect();
    let distance = |part: &Part| (part.start + 0.5 * part.waveform.duration() - middle).abs();
    let nearest = (0..parts.len()).min_by(|a, b| distance(&parts[*a]).total_cmp(&distance(&parts[*b])));
    if let Some(nearest) = nearest {
        parts[nearest].has_middle = true;
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

/// Largest angles by which bodies turn, as the sensor sees them, from the middle of a part of the frame to any time of it
/// [rad], (part, body), for a number of parts of equal duration: by rotation, or by passing the sensor.
fn turns(boxes: &[[DVec3; 2]], placement: &Placement, number: usize) -> Vec<Vec<f64>> {
    // Series through n times have at most n - 1 turning points.
    let steps = placement.num_times().div_ceil(number).max(4).next_multiple_of(2);
    let are_still = placement.are_still();
    if are_still.iter().all(|is_still| *is_still) {
        return vec![vec![0.0; boxes.len()]; number];
    }
    let time = |step: usize| 2.0 * step as f64 / (number * steps) as f64 - 1.0;
    let poses: Vec<Vec<Pose>> = (0..=number * steps)
        .map(|step| placement.poses_at(time(step)))
        .collect();
    let of_body = |part: usize, body: usize| {
        if are_still[body] {
            return 0.0;
        }
        let sensor = |step: usize| poses[step][body].point_to_body(DVec3::ZERO);
        let (first, last) = (part * steps, (part + 1) * steps);
        let from = sensor(first + steps / 2);
        let turns = (first..=last).map(|step| turn(&boxes[body], from, sensor(step)));
        turns.fold(Turn::NONE, Turn::max).angle()
    };
    let of_part = |part: usize| (0..boxes.len()).map(|body| of_body(part, body)).collect();
    (0..number).map(of_part).collect()
}

/// Angle between two vectors, by the length of their cross product and their dot product.
#[derive(Clone, Copy)]
struct Turn {
    cross: f64,
    dot: f64,
}

impl Turn {
    const NONE: Self = Self { cross: 0.0, dot: 1.0 };

    /// Angle [rad].
    fn angle(self) -> f64 {
        self.cross.atan2(self.dot)
    }

    /// The larger of two angles.
    fn max(self, other: Self) -> Self {
        // The sine of their difference.
        if other.cross * self.dot > self.cross * other.dot {
            other
        } else {
            self
        }
    }
}

/// Angle between the directions to two places of the sensor in body axes: the largest over the corners of the bounding box
/// and the point of the box nearest to the first place.
fn turn(&[low, high]: &[DVec3; 2], from: DVec3, to: DVec3) -> Turn {
    if low.cmpgt(high).any() {
        return Turn::NONE;
    }
    let nearest = from.clamp(low, high);
    let corner = |number: u32| {
        DVec3::new(
            if number & 1 == 0 { low.x } else { high.x },
            if number & 2 == 0 { low.y } else { high.y },
            if number & 4 == 0 { low.z } else { high.z },
        )
    };
    let places = (0..8).map(corner).chain((nearest != from).then_some(nearest));
    places.fold(Turn::NONE, |most, place| {
        let (a, b) = (from - place, to - place);
        most.max(Turn {
            cross: a.cross(b).length(),
            dot: a.dot(b),
        })
    })
}

/// Split the chirps into a number of parts of equal duration; chirps are not cut. Parts without a chirp are left out: with
/// the number of every part.
fn split(waveform: &Waveform, number: usize) -> Vec<(usize, Range<usize>)> {
    let starts = &waveform.chirp_times;
    let (first, last) = (starts[0], waveform.duration());
    let edge = |i: usize| first + (last - first) * i as f64 / number as f64 - 1e-9 * (last - first);
    let mut ends = vec![0];
    for i in 1..number {
        ends.push(starts.partition_point(|start| *start < edge(i)));
    }
    ends.push(starts.len());
    let parts = ends.windows(2).map(|pair| pair[0]..pair[1]).enumerate();
    parts.filter(|(_, chirps)| !chirps.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paths::placement::World;
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
    fn parts_have_all_chirps_once() {
        let wf = waveform();
        for number in [1, 3, 5, 64, 129] {
            let parts = split(&wf, number);
            assert_eq!(parts.len(), number.min(64));
            assert_eq!(parts.iter().map(|(_, chirps)| chirps.len()).sum::<usize>(), 64);
            assert!(parts.windows(2).all(|pair| pair[0].1.end == pair[1].1.start));
        }
    }

    /// Poses of one body at Chebyshev times, and a sensor at the origin.
    fn placement(pose: impl Fn(f64) -> Pose) -> Placement {
        let poses: Vec<Pose> = chebyshev_nodes(9).into_iter().map(pose).collect();
        let sensor = Pose {
            rotation: DMat3::IDENTITY,
            translation: DVec3::ZERO,
        };
        let world = World {
            sensor: vec![sensor; poses.len()],
            poses,
            points: Vec::new(),
            vertices: Vec::new(),
        };
        world.seen(DVec3::ZERO)
    }

    #[test]
    fn bodies_turn_by_the_largest_angle_from_the_middle_of_a_part() {
        let surface = [DVec3::new(0.0, -0.1, -0.1), DVec3::new(0.0, 0.1, 0.1)];
        let at = |y: f64, angle: f64| Pose {
            rotation: DMat3::from_rotation_z(angle),
            translation: DVec3::new(2.0, y, 0.0),
        };
        // Passing by 2 m away, as seen from the point of the body that is nearest: its middle.
        let passing = placement(|x| at(0.3 * x, 0.0));
        let expected = 0.15_f64.atan();
        let got = turns(&[surface], &passing, 1)[0][0];
        assert!((expected..1.01 * expected).contains(&got), "{got}");
        // A swing rests in the middle of the frame.
        let swinging = placement(|x| at(0.0, 0.7 * x * x));
        let got = turns(&[surface], &swinging, 1)[0][0];
        assert!((0.69..0.75).contains(&got), "{got}");
        let parts = turns(&[surface], &swinging, 3);
        assert!(parts[1][0] < 0.09 && parts[0][0] > 0.35, "{parts:?}");
        // What stands still turns in no part.
        assert_eq!(turns(&[surface], &placement(|_| at(0.0, 1.0)), 3), vec![vec![0.0]; 3]);
    }
}
