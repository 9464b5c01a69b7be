//! Spans of a frame: consecutive chirps whose rays are cast together, as bodies turn too far for one cast.

use std::ops::Range;

use glam::DVec3;

use super::model::Model;
use crate::geometry::pose::Pose;
use crate::numeric::chebyshev::chebyshev_nodes;
use crate::paths::kinematics::Kinematics;
use crate::synthesis::chirp::Waveform;

/// Consecutive chirps of a frame with a cast of their own, in the middle of their time.
pub struct Span {
    /// Numbers of the chirps.
    pub chirps: Range<usize>,
    /// Waveform of these chirps alone; the first starts at time 0.
    pub waveform: Waveform,
    /// Time of the cast, `x` from -1 to 1 over the frame, and half the duration in that unit.
    pub cast: f64,
    /// Half the duration of the span, in the unit of `cast`.
    pub half: f64,
    /// Largest angle by which every body turns from the cast to any time of the span, seen from the sensor [rad].
    pub rotation_angles: Vec<f64>,
    /// True for the span that contains the middle of the frame, which gives the truth.
    pub has_middle: bool,
}

/// Spans within which no body turns by more than the limit of the settings from the pose in which it is cast.
pub fn of_frame(model: &Model, motion: &Kinematics) -> Vec<Span> {
    let (waveform, most) = (&model.waveform, model.settings.retrace);
    let most_parts = 2 * waveform.chirp_times.len() + 1;
    let mut number = 1;
    let angles = loop {
        // A depth image has no boxes, and is never cast.
        let angles = rotation_angles(&model.boxes, motion, number);
        let largest = angles.iter().flatten().copied().fold(0.0, f64::max);
        if largest <= most || number >= most_parts {
            break angles;
        }
        // An odd number, so that one span contains the middle of the frame.
        let wanted = (number as f64 * largest / most).ceil().min(most_parts as f64);
        number = (wanted as usize | 1).max(number + 2);
    };
    let mut spans: Vec<Span> = split(waveform, number)
        .into_iter()
        .map(|(at, chirps)| {
            // The whole frame keeps its time.
            let start = if number == 1 {
                0.0
            } else {
                waveform.chirp_times[chirps.start]
            };
            let chirp_times = waveform.chirp_times[chirps.clone()].iter();
            let of_chirps = Waveform {
                chirp_times: chirp_times.map(|time| time - start).collect(),
                ..waveform.clone()
            };
            let (duration, of_frame) = (of_chirps.duration(), waveform.duration());
            let (cast, half) = match number {
                1 => (0.0, 1.0),
                _ => ((2.0 * start + duration) / of_frame - 1.0, duration / of_frame),
            };
            Span {
                chirps,
                waveform: of_chirps,
                cast,
                half,
                rotation_angles: angles[at].clone(),
                has_middle: false,
            }
        })
        .collect();
    let nearest = (0..spans.len()).min_by(|a, b| spans[*a].cast.abs().total_cmp(&spans[*b].cast.abs()));
    if let Some(nearest) = nearest {
        spans[nearest].has_middle = true;
    }
    spans
}

impl Span {
    /// Chebyshev times of the span as times of the frame, `x` from -1 to 1.
    pub fn node_times(&self, number: usize) -> Vec<f64> {
        let nodes = chebyshev_nodes(number).into_iter();
        nodes.map(|x| self.cast + self.half * x).collect()
    }
}

/// Largest angles by which bodies turn, as the sensor sees them, from the middle of a span of the frame to any time of
/// it [rad], (span, body), for a number of spans of equal duration: by rotation, or by passing the sensor.
fn rotation_angles(boxes: &[[DVec3; 2]], motion: &Kinematics, number: usize) -> Vec<Vec<f64>> {
    // Series through n times have at most n - 1 turning points.
    let steps = motion.num_times().div_ceil(number).max(4).next_multiple_of(2);
    let are_static = motion.poses.are_static();
    if are_static.iter().all(|is_static| *is_static) {
        return vec![vec![0.0; boxes.len()]; number];
    }
    let time = |step: usize| 2.0 * step as f64 / (number * steps) as f64 - 1.0;
    let poses: Vec<Vec<Pose>> = (0..=number * steps).map(|step| motion.poses.at(time(step))).collect();
    let of_body = |span: usize, body: usize| {
        if are_static[body] {
            return 0.0;
        }
        let sensor = |step: usize| poses[step][body].point_to_body(DVec3::ZERO);
        let (first, last) = (span * steps, (span + 1) * steps);
        let from = sensor(first + steps / 2);
        let angles = (first..=last).map(|step| rotation(&boxes[body], from, sensor(step)));
        angles.fold(0.0, f64::max)
    };
    let of_part = |span: usize| (0..boxes.len()).map(|body| of_body(span, body)).collect();
    (0..number).map(of_part).collect()
}

/// Angle between the directions to two places of the sensor in body axes [rad]: the largest over the corners of the
/// bounding box and the point of the box nearest to the first place.
fn rotation(&[low, high]: &[DVec3; 2], from: DVec3, to: DVec3) -> f64 {
    if low.cmpgt(high).any() {
        return 0.0;
    }
    let corner = |number: u32| {
        DVec3::new(
            if number & 1 == 0 { low.x } else { high.x },
            if number & 2 == 0 { low.y } else { high.y },
            if number & 4 == 0 { low.z } else { high.z },
        )
    };
    let places = (0..8).map(corner).chain([from.clamp(low, high)]);
    let angles = places.map(|place| (from - place).angle_between(to - place));
    angles.fold(0.0, f64::max)
}

/// Split the chirps into a number of spans of equal duration; chirps are not cut. Spans without a chirp are left out:
/// with the number of every span.
fn split(waveform: &Waveform, number: usize) -> Vec<(usize, Range<usize>)> {
    let starts = &waveform.chirp_times;
    let (first, last) = (starts[0], waveform.duration());
    let edge = |i: usize| first + (last - first) * i as f64 / number as f64 - 1e-9 * (last - first);
    let mut ends = vec![0];
    for i in 1..number {
        ends.push(starts.partition_point(|start| *start < edge(i)));
    }
    ends.push(starts.len());
    let spans = ends.windows(2).map(|pair| pair[0]..pair[1]).enumerate();
    spans.filter(|(_, chirps)| !chirps.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paths::kinematics::TimeSeries;
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
            let spans = split(&wf, number);
            assert_eq!(spans.len(), number.min(64));
            assert_eq!(spans.iter().map(|(_, chirps)| chirps.len()).sum::<usize>(), 64);
            assert!(spans.windows(2).all(|pair| pair[0].1.end == pair[1].1.start));
        }
    }

    /// Poses of one body at Chebyshev times.
    fn motion(pose: impl Fn(f64) -> Pose) -> Kinematics {
        Kinematics {
            poses: TimeSeries::new(9, chebyshev_nodes(9).into_iter().map(pose).collect()),
            points: TimeSeries::new(9, Vec::new()),
            vertices: Vec::new(),
        }
    }

    #[test]
    fn bodies_turn_by_the_largest_angle_from_the_middle_of_a_part() {
        let surface = [DVec3::new(0.0, -0.1, -0.1), DVec3::new(0.0, 0.1, 0.1)];
        let at = |y: f64, angle: f64| Pose {
            rotation: DMat3::from_rotation_z(angle),
            translation: DVec3::new(2.0, y, 0.0),
        };
        // Passing by 2 m away, as seen from the point of the body that is nearest: its middle.
        let passing = motion(|x| at(0.3 * x, 0.0));
        let expected = 0.15_f64.atan();
        let got = rotation_angles(&[surface], &passing, 1)[0][0];
        assert!((expected..1.01 * expected).contains(&got), "{got}");
        // A swing rests in the middle of the frame.
        let swinging = motion(|x| at(0.0, 0.7 * x * x));
        let got = rotation_angles(&[surface], &swinging, 1)[0][0];
        assert!((0.69..0.75).contains(&got), "{got}");
        let spans = rotation_angles(&[surface], &swinging, 3);
        assert!(spans[1][0] < 0.09 && spans[0][0] > 0.35, "{spans:?}");
        // Static bodies turn in no span.
        assert_eq!(
            rotation_angles(&[surface], &motion(|_| at(0.0, 1.0)), 3),
            vec![vec![0.0]; 3]
        );
    }
}
