//! Routes of material points: delays and amplitudes follow from where their bodies are.

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use super::place::Place;
use crate::antenna::Array;
use crate::error::Result;
use crate::facet::Facet;
use crate::scatter::{Paths, Places, SPEED_OF_LIGHT, Selection};
use crate::trace::Snapshot;

/// Routes from the transmitters over two and more surfaces to the receivers: what one cell of the image returns by one
/// number of reflections.
pub struct Bounces {
    array: Array,
    /// Where the points of every route begin, and where those of the last end.
    first: Vec<usize>,
    /// Those of one transmitter after the other; of one that has no such route those of another.
    points: Vec<Point>,
    /// `(route, channel)`: amplitude but for the antennas and for the lengths of the ways to the last point and from there.
    weights: Vec<Complex64>,
    /// Bodies that deform and their numbers of vertices.
    deforming: Vec<(u32, usize)>,
}

/// A material point.
#[derive(Clone, Copy, Debug)]
struct Point {
    body: u32,
    /// Vertices of the facet that it stays with, where the body deforms.
    facet: Option<[u32; 3]>,
    /// In body coordinates [m], or those of the facet.
    position: DVec3,
}

/// One route.
pub struct Route {
    order: usize,
    points: Vec<Point>,
    /// Per channel.
    weights: Vec<Complex64>,
}

impl Point {
    /// At a place that stays with its body.
    fn new(snapshot: &Snapshot, place: &Place) -> Self {
        let surface = snapshot.surface(place.body);
        let position = snapshot.pose(place.body).point_to_body(place.point);
        if !surface.is_deformed() {
            return Self {
                body: place.body,
                facet: None,
                position,
            };
        }
        Self {
            body: place.body,
            facet: Some(surface.vertices_of(place.triangle)),
            position: Facet::new(surface.corners(place.triangle)).coordinates(position),
        }
    }
}

impl Route {
    /// Over these places, for all transmitters; nothing comes back yet.
    pub fn new(array: &Array, snapshot: &Snapshot, places: &[Place]) -> Self {
        let points: Vec<Point> = places.iter().map(|place| Point::new(snapshot, place)).collect();
        Self {
            order: places.len(),
            points: points.repeat(array.tx.len()),
            weights: vec![Complex64::ZERO; array.num_channels()],
        }
    }

    /// Number of reflections.
    pub fn order(&self) -> usize {
        self.order
    }

    /// What comes back of one transmitter: `weights` per receiver.
    pub fn set(&mut self, snapshot: &Snapshot, transmitter: usize, places: &[Place], weights: &[Complex64]) {
        let points = places.iter().map(|place| Point::new(snapshot, place));
        for (i, point) in points.enumerate() {
            self.points[transmitter * self.order + i] = point;
        }
        let first = transmitter * weights.len();
        self.weights[first..first + weights.len()].copy_from_slice(weights);
    }
}

impl Bounces {
    pub(super) fn of_routes(snapshot: &Snapshot, array: Array, routes: impl Iterator<Item = Route>) -> Self {
        let mut bounces = Self::empty(array);
        for route in routes {
            bounces.push(&route.points, &route.weights);
        }
        let on_facets = bounces.points.iter().filter(|point| point.facet.is_some());
        let mut bodies: Vec<u32> = on_facets.map(|point| point.body).collect();
        bodies.sort_unstable();
        bodies.dedup();
        let with_number = |body: u32| (body, snapshot.surface(body).vertices().len());
        bounces.deforming = bodies.into_iter().map(with_number).collect();
        bounces
    }

    fn empty(array: Array) -> Self {
        Self {
            array,
            first: vec![0],
            points: Vec::new(),
            weights: Vec::new(),
            deforming: Vec::new(),
        }
    }

    fn push(&mut self, points: &[Point], weights: &[Complex64]) {
        self.points.extend(points);
        self.weights.extend(weights);
        self.first.push(self.points.len());
    }

    /// The routes over wanted bodies alone, and the others, both in the same order.
    pub fn split(&self, is_wanted: impl Fn(u32) -> bool) -> [Self; 2] {
        let mut parts = [Self::empty(self.array.clone()), Self::empty(self.array.clone())];
        for route in 0..self.len() {
            let points = &self.points[self.first[route]..self.first[route + 1]];
            let are_wanted = points.iter().all(|point| is_wanted(point.body));
            let channels = self.num_channels();
            let weights = &self.weights[channels * route..channels * (route + 1)];
            parts[usize::from(!are_wanted)].push(points, weights);
        }
        for part in &mut parts {
            let is_met = |body: u32| part.points.iter().any(|point| point.body == body);
            part.deforming = self.deforming.iter().copied().filter(|d| is_met(d.0)).collect();
        }
        parts
    }

    /// Number of routes.
    pub fn len(&self) -> usize {
        self.first.len() - 1
    }

    /// True when nothing comes back.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of TX-RX pairs.
    pub fn num_channels(&self) -> usize {
        self.array.num_channels()
    }

    /// Number of reflections of every route.
    pub fn orders(&self) -> impl Iterator<Item = usize> {
        let transmitters = self.array.tx.len();
        self.first
            .windows(2)
            .map(move |ends| (ends[1] - ends[0]) / transmitters)
    }

    /// The last body of every route, as the first transmitter has it.
    pub fn last_bodies(&self) -> impl Iterator<Item = u32> {
        let ends = self.first.iter().zip(self.orders());
        ends.map(|(first, order)| self.points[first + order - 1].body)
    }

    /// Bodies that deform and are met here, in increasing order, and their numbers of vertices.
    pub fn deforming(&self) -> &[(u32, usize)] {
        &self.deforming
    }

    /// Delays of the selected routes at `places`, which need no point targets, and amplitudes at others.
    pub fn paths(&self, places: &Places, amplitudes_at: &Places, selection: Selection) -> Result<Paths> {
        Paths::of(
            [places.num_nodes, amplitudes_at.num_nodes],
            self.num_channels(),
            selection,
            |node, channel, route| self.path(places, node, channel, route).0,
            |node, channel, route| self.path(amplitudes_at, node, channel, route).1,
        )
    }

    /// Rate of every delay [s/s], `(channel, route)`, at the first node of `places`; `rates` are the time derivatives.
    pub fn delay_rates(&self, places: &Places, rates: &Places) -> Vec<f64> {
        let num_routes = self.len();
        (0..self.num_channels() * num_routes)
            .into_par_iter()
            .map(|i| {
                let (channel, route) = (i / num_routes, i % num_routes);
                let (tx, rx) = self.antennas(channel);
                let (mut rate, mut from) = (0.0, (tx, DVec3::ZERO));
                let points = self.points(route, channel);
                let moving = points.iter().map(|point| self.motion(places, rates, point));
                for to in moving.chain([(rx, DVec3::ZERO)]) {
                    rate += (to.0 - from.0).normalize_or_zero().dot(to.1 - from.1);
                    from = to;
                }
                rate / SPEED_OF_LIGHT
            })
            .collect()
    }

    /// Of the transmitter of a channel.
    fn points(&self, route: usize, channel: usize) -> &[Point] {
        let points = &self.points[self.first[route]..self.first[route + 1]];
        let order = points.len() / self.array.tx.len();
        let transmitter = channel / self.array.rx.len();
        &points[transmitter * order..(transmitter + 1) * order]
    }

    fn antennas(&self, channel: usize) -> (DVec3, DVec3) {
        let receivers = self.array.rx.len();
        (self.array.tx[channel / receivers], self.array.rx[channel % receivers])
    }

    /// Delay and amplitude of one route of one channel at one time, README eq. (7).
    fn path(&self, places: &Places, node: usize, channel: usize, route: usize) -> (f64, Complex64) {
        let (tx, rx) = self.antennas(channel);
        let (transmitter, receiver) = (channel / self.array.rx.len(), channel % self.array.rx.len());
        let points = self.points(route, channel);
        let departure = self.position(places, node, &points[0]) - tx;
        let (mut length, mut last) = (0.0, tx);
        for point in points {
            let next = self.position(places, node, point);
            length += (next - last).length();
            last = next;
        }
        let arrival = last - rx;
        let distance = arrival.length();
        let gains =
            self.array.tx_patterns[transmitter].gain(departure) * self.array.rx_patterns[receiver].gain(arrival);
        let weight = self.weights[route * self.num_channels() + channel];
        let amplitude = weight * ((self.array.power * gains).sqrt() / (length * distance));
        ((length + distance) / SPEED_OF_LIGHT, amplitude)
    }

    /// Where a material point is [m].
    fn position(&self, places: &Places, node: usize, point: &Point) -> DVec3 {
        let pose = &places.poses[node * places.num_bodies + point.body as usize];
        let facet = self.facet_of(places, node, point);
        pose.point(facet.map_or(point.position, |facet| facet.point(point.position)))
    }

    /// Where a material point is at the first node [m], and how it moves [m/s].
    fn motion(&self, places: &Places, rates: &Places, point: &Point) -> (DVec3, DVec3) {
        let (pose, rate) = (&places.poses[point.body as usize], &rates.poses[point.body as usize]);
        let facets = [places, rates].map(|places| self.facet_of(places, 0, point));
        let (position, velocity) = match facets {
            [Some(facet), Some(facet_rate)] => {
                (facet.point(point.position), facet.velocity(&facet_rate, point.position))
            }
            _ => (point.position, DVec3::ZERO),
        };
        (pose.point(position), rate.point(position) + pose.direction(velocity))
    }

    /// The facet of a material point of a body that deforms; its corners may be velocities.
    fn facet_of(&self, places: &Places, node: usize, point: &Point) -> Option<Facet> {
        let corners = point.facet?;
        let index = self.deforming.iter().position(|deforming| deforming.0 == point.body)?;
        let vertices = &places.vertices[index][node * self.deforming[index].1..];
        Some(Facet::new(
            corners.map(|vertex| DVec3::from_array(vertices[vertex as usize])),
        ))
    }
}
