//! Paths over material points: delays and amplitudes evaluated from the kinematics of the bodies.

use glam::DVec3;
use num_complex::Complex64;

use super::direction::Direction;
use super::interaction::Interaction;
use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::moving_triangle::MovingTriangle;
use crate::numeric::simd::Precision;
use crate::paths::evaluate::{fill_one_by_one, finish};
use crate::paths::kinematics::Kinematics;
use crate::rays::scene::PosedScene;
use crate::synthesis::chunk::Chunk;
use crate::synthesis::source::Request;

/// Paths between the transmitters and the receivers over two and more surfaces, one per cell of the image and number of
/// reflections.
pub struct Bounces {
    array: Array,
    /// Antennas where tubes start and end, see [`tube_antennas`].
    tube_antennas: Array,
    /// Index of the first point of every path, and the number of all points.
    first: Vec<usize>,
    /// Material points of every path, one block per antenna where tubes start; an antenna without the path has the
    /// points of another.
    points: Vec<Point>,
    /// Direction of the tubes of every path.
    directions: Vec<Direction>,
    /// `(path, pair of antennas of tubes)`: amplitude without the gains of the antennas and the lengths to and from the last point.
    weights: Vec<Complex64>,
}

/// A material point.
#[derive(Clone, Copy, Debug)]
struct Point {
    body: u32,
    /// Vertices of the triangle that carries the point, where the body deforms.
    corners: Option<[u32; 3]>,
    /// Position in coordinates of the body [m], or of the triangle.
    position: DVec3,
}

/// One path of several reflections, for all channels.
pub struct BouncePath {
    direction: Direction,
    order: usize,
    points: Vec<Point>,
    /// Weight per pair of antennas, see [`Bounces`].
    weights: Vec<Complex64>,
}

impl Point {
    /// Material point at an interaction, in coordinates of its body.
    fn new(scene: &PosedScene, interaction: &Interaction) -> Self {
        let surface = scene.surface(interaction.body);
        let position = scene.pose(interaction.body).point_to_body(interaction.point);
        if !surface.is_deformed() {
            return Self {
                body: interaction.body,
                corners: None,
                position,
            };
        }
        Self {
            body: interaction.body,
            corners: Some(surface.vertices_of(interaction.triangle)),
            position: MovingTriangle::new(surface.corners(interaction.triangle)).coordinates(position),
        }
    }
}

impl BouncePath {
    /// Path over these interactions for all antennas where tubes start, with weights of zero.
    pub fn new(direction: Direction, array: &Array, scene: &PosedScene, interactions: &[Interaction]) -> Self {
        let points: Vec<Point> = interactions
            .iter()
            .map(|interaction| Point::new(scene, interaction))
            .collect();
        Self {
            direction,
            order: interactions.len(),
            points: points.repeat(direction.antennas(array)[0].len()),
            weights: vec![Complex64::ZERO; array.num_channels()],
        }
    }

    /// Direction of the tubes and number of reflections.
    pub fn kind(&self) -> (Direction, usize) {
        (self.direction, self.order)
    }

    /// Set the points and weights of the antenna `start`; `weights` are per antenna where tubes end.
    pub fn set(
        &mut self,
        array: &Array,
        scene: &PosedScene,
        start: usize,
        interactions: &[Interaction],
        weights: &[Complex64],
    ) {
        let points = interactions.iter().map(|interaction| Point::new(scene, interaction));
        for (i, point) in points.enumerate() {
            self.points[start * self.order + i] = point;
        }
        for (end, weight) in weights.iter().enumerate() {
            self.weights[self.direction.channel(array, start, end)] = *weight;
        }
    }
}

impl Bounces {
    pub(super) fn of_paths(array: Array, tube_antennas: Array, paths: Vec<BouncePath>) -> Self {
        let mut bounces = Self {
            tube_antennas,
            ..Self::empty(array)
        };
        for path in paths {
            bounces.push(path.direction, &path.points, &path.weights);
        }
        bounces
    }

    /// An empty list of paths.
    pub fn empty(array: Array) -> Self {
        Self {
            tube_antennas: array.clone(),
            array,
            first: vec![0],
            points: Vec::new(),
            directions: Vec::new(),
            weights: Vec::new(),
        }
    }

    fn push(&mut self, direction: Direction, points: &[Point], weights: &[Complex64]) {
        self.directions.push(direction);
        self.points.extend(points);
        self.weights.extend(weights);
        self.first.push(self.points.len());
    }

    /// Split into the paths over wanted bodies alone and all others, both in the same order.
    pub fn split(&self, is_wanted: impl Fn(u32) -> bool) -> [Self; 2] {
        let empty = || Self {
            tube_antennas: self.tube_antennas.clone(),
            ..Self::empty(self.array.clone())
        };
        let mut parts = [empty(), empty()];
        for path in 0..self.len() {
            let points = &self.points[self.first[path]..self.first[path + 1]];
            let are_wanted = points.iter().all(|point| is_wanted(point.body));
            let number = self.tube_antennas.num_channels();
            let weights = &self.weights[number * path..number * (path + 1)];
            parts[usize::from(!are_wanted)].push(self.directions[path], points, weights);
        }
        parts
    }

    /// Number of paths.
    pub fn len(&self) -> usize {
        self.first.len() - 1
    }

    /// Number of TX-RX pairs.
    pub fn num_channels(&self) -> usize {
        self.array.num_channels()
    }

    /// Pair of antennas of tubes for a channel: the only one of a small array.
    fn tube_channel(&self, channel: usize) -> usize {
        channel.min(self.tube_antennas.num_channels() - 1)
    }

    /// Number of reflections of every path.
    pub fn orders(&self) -> impl Iterator<Item = usize> {
        let paths = self.first.windows(2).zip(&self.directions);
        paths.map(|(ends, direction)| (ends[1] - ends[0]) / direction.antennas(&self.tube_antennas)[0].len())
    }

    /// Body of every path that is the last before a receiver, for the first antenna where tubes start.
    pub fn last_bodies(&self) -> impl Iterator<Item = u32> {
        let paths = self.first.iter().zip(&self.directions).zip(self.orders());
        paths.map(|((first, direction), order)| match direction {
            Direction::Forward => self.points[first + order - 1].body,
            Direction::Backward => self.points[*first].body,
        })
    }

    /// True if a body is on a path.
    pub fn has_body(&self, body: u32) -> bool {
        self.points.iter().any(|point| point.body == body)
    }

    /// Fill a chunk with paths, by number: delays at the times of the first kinematics, amplitudes at the times of the
    /// second.
    pub fn fill<T: Precision>(
        &self,
        nodes: [&Kinematics; 2],
        numbers: &[usize],
        request: &Request,
        chunk: &mut Chunk<T>,
    ) {
        let path = |kinematics: &Kinematics, time, channel, path| self.path(kinematics, time, channel, path);
        fill_one_by_one(path, nodes, numbers, 0..numbers.len(), request, chunk);
        chunk.num_paths = numbers.len();
        finish(chunk, nodes.map(Kinematics::num_times), request.channels.len());
    }

    /// Rate of the delay of one path [s/s] at the first time; `rates` are the time derivatives.
    pub fn delay_rate(&self, kinematics: &Kinematics, rates: &Kinematics, channel: usize, path: usize) -> f64 {
        let [start, end] = self.antennas(channel, path).map(|antenna| (antenna.0, DVec3::ZERO));
        let (mut rate, mut from) = (0.0, start);
        let points = self.points(path, channel).iter();
        let moving = points.map(|point| kinematics.motion(rates, point.body, point.corners, point.position));
        for to in moving.chain([end]) {
            rate += (to.0 - from.0).normalize_or_zero().dot(to.1 - from.1);
            from = to;
        }
        rate / SPEED_OF_LIGHT
    }

    /// Points of a path for the antenna of a channel where tubes start.
    fn points(&self, path: usize, channel: usize) -> &[Point] {
        let points = &self.points[self.first[path]..self.first[path + 1]];
        let direction = self.directions[path];
        let order = points.len() / direction.antennas(&self.tube_antennas)[0].len();
        let [start, _] = direction.numbers(&self.tube_antennas, self.tube_channel(channel));
        &points[start * order..(start + 1) * order]
    }

    /// Positions and patterns of the antennas of a channel where the tubes of a path start and end.
    fn antennas(&self, channel: usize, path: usize) -> [(DVec3, &Pattern); 2] {
        let direction = self.directions[path];
        let ([starts, ends], [start, end]) = (direction.antennas(&self.array), direction.numbers(&self.array, channel));
        [starts.get(start), ends.get(end)]
    }

    /// Delay and amplitude of one path of one channel at one time, docs/theory.md eq. (7).
    fn path(&self, kinematics: &Kinematics, time: usize, channel: usize, path: usize) -> (f64, Complex64) {
        let [start, end] = self.antennas(channel, path);
        let points = self.points(path, channel);
        let departure = position(kinematics, time, &points[0]) - start.0;
        let (mut length, mut last) = (0.0, start.0);
        for point in points {
            let next = position(kinematics, time, point);
            length += (next - last).length();
            last = next;
        }
        let arrival = last - end.0;
        let distance = arrival.length();
        let gains = start.1.gain(departure) * end.1.gain(arrival);
        let weight = self.weights[path * self.tube_antennas.num_channels() + self.tube_channel(channel)];
        let amplitude = weight * ((self.array.power * gains).sqrt() / (length * distance));
        let length = length + distance;
        (length / SPEED_OF_LIGHT, self.array.received(channel, amplitude, length))
    }
}

/// Position of a material point at a time, sensor frame [m].
fn position(kinematics: &Kinematics, time: usize, point: &Point) -> DVec3 {
    let pose = &kinematics.poses.row(time)[point.body as usize];
    let triangle = kinematics.moving_triangle(time, point.body, point.corners);
    pose.point(triangle.map_or(point.position, |triangle| triangle.point(point.position)))
}
