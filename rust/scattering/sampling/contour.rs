//! Flat regions that nothing occludes: their field is an integral along their outline, and a mirror image.
//!
//! Over a plane, the field depends on the distance alone, so that its integral over polar coordinates about the foot of
//! the perpendicular from the sensor is one over the angle, along the outline (docs/theory.md eqs. (10) and (11)). Along
//! a straight edge the phase has one stationary point, the nearest. Points represent short pieces of the edge around it.
//! Their weight rolls off where the phase changes quickly along a piece. Farther out only the two ends of the edge
//! contribute. Where the foot lies within the outline, the region reflects like a mirror. The error is about a
//! thousandth of the field at 0.5 m, for any tilt and shape, with a few dozen points per region; cells of a flat surface
//! would have to be far smaller than a wavelength.
//!
//! A region is left to cells where another surface may occlude a part of it, or where it moves so far during its use
//! that the foot nears an edge.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use super::cells::TileCells;
use crate::antennas::array::{Array, specular_point};
use crate::constants::SPEED_OF_LIGHT;
use crate::geometry::aabb::Bounds;
use crate::geometry::flat_regions::FlatRegion;
use crate::geometry::pose::Pose;
use crate::numeric::trig::sinc;
use crate::paths::scatterers::PointKind;
use crate::rays::camera::Cell;
use crate::rays::pyramid::{Pyramid, THROUGH_BASE, THROUGH_SIDE, extent};
use crate::rays::scene::PosedScene;
use crate::rays::tree::Tree;
use crate::scattering::material::Material;
use crate::scattering::refinement::{SHARE, field_of};
use crate::scattering::sector::Sector;
use crate::scattering::tile_point::{NearestHit, TilePoint, TilePoints};

/// Number of pieces of a long edge. Of 120 plates of at least 1e-5 m^2, the worst error was 0.05 % of the field with 32,
/// 0.1 % with 24 and 11 % with 16.
const PIECES: f64 = 24.0;

/// Half the phase change over a piece at which its point begins to roll off, and at which it is zero [rad].
const ROLLS_OFF: f64 = 0.25 * PI;
const ZERO: f64 = PI;

/// Least field of an edge relative to the field of the smallest cross-section of interest: weaker edges are dropped,
/// such as the far edges of a floor.
const LEAST_EDGE: f64 = 0.1;

/// Distance of an edge from the specular point relative to the height of the sensor at which it passes through it, and
/// least part of a turn about a point that is not outside: far above rounding, far below a wavelength.
const TOUCHING: f64 = 1e-12;
const WINDING: f64 = 1e-6;

/// Least height of the sensor above the plane of a region, and largest coordinate of its outline [m].
const LEAST_HEIGHT: f64 = 1e-6;
const FARTHEST: f64 = 1e6;

/// Largest number of pieces to either side of the nearest point.
const MOST_PIECES: f64 = 2048.0;

/// Distances by which the foot of the perpendicular may move while a region is used: relative to its distance from the
/// outline, and to the width of the zone about a nearest point (the root of wavelength times distance), at least and at
/// most.
const OF_DISTANCE: f64 = 0.1;
const OF_ZONE: [f64; 2] = [0.05, 0.7];

/// Flat regions in place of cells, and their points.
pub(super) struct Contours {
    /// For every body, a flag per flat region; empty where none is set.
    is_contour: Vec<Vec<bool>>,
    /// Points of all regions, in the axes of the first sector.
    pub(super) points: Vec<Arc<TilePoints>>,
    /// Nearest point of every region in view.
    pub(super) nearest: Vec<NearestHit>,
}

impl Contours {
    /// Regions of the bodies that sectors show.
    pub(super) fn new(sectors: &[Sector], materials: &[Material], has_common_weight: bool) -> Self {
        let first = &sectors[0];
        let num_bodies = first.scene.num_bodies();
        let mut contours = Self {
            is_contour: vec![Vec::new(); num_bodies],
            points: Vec::new(),
            nearest: Vec::new(),
        };
        let Some(refinement) = first.refinement.filter(|_| first.has_contours && first.image.is_none()) else {
            return contours;
        };
        let wavelength = SPEED_OF_LIGHT / first.array.frequency;
        let regions = (0..num_bodies as u32).flat_map(|body| {
            let flat = first.scene.surface(body).flat_regions();
            flat.iter()
                .flat_map(|flat| &flat.regions)
                .map(move |region| (body, region))
                .collect::<Vec<_>>()
        });
        let regions: Vec<(u32, &FlatRegion)> = regions.collect();
        let pairs = pairs(first.array, has_common_weight);
        let floor = field_of(refinement.rcs_floor, wavelength);
        let points = |(body, region): &(u32, &FlatRegion)| {
            let outline = Outline::new(first.scene.pose(*body), region);
            let turn = first.turns.get(*body as usize).copied().unwrap_or(0.0);
            let is_contour = outline.is_in_range(&pairs)
                && outline.moves_little(turn, wavelength)
                && first.scene.is_empty(&outline.pyramid());
            is_contour.then(|| {
                let region = Region {
                    sectors,
                    body: *body,
                    triangle: region.triangle,
                    material: &materials[*body as usize],
                    wavenumber: TAU / wavelength,
                    pairs: &pairs,
                    floor,
                    outline,
                };
                (region.points(), region.nearest(), region.outline)
            })
        };
        let mut points: Vec<Option<_>> = regions.par_iter().map(points).collect();
        leave_out_coincident(&mut points);
        for ((body, _), points) in regions.iter().zip(points) {
            contours.is_contour[*body as usize].push(points.is_some());
            let Some((points, nearest, _)) = points else { continue };
            contours.nearest.extend(nearest);
            if !points.points.is_empty() {
                contours.points.push(Arc::new(points));
            }
        }
        for flags in &mut contours.is_contour {
            if !flags.contains(&true) {
                flags.clear();
            }
        }
        contours
    }

    /// Boxes of the regions that have switched between cells and contours since another time; `before`: the flags of that
    /// time.
    pub(super) fn changed(&self, before: &[Vec<bool>], scene: &PosedScene) -> Tree {
        let mut boxes = Vec::new();
        for (body, (now, before)) in (0..).zip(self.is_contour.iter().zip(before)) {
            let regions = scene.surface(body).flat_regions().map_or(&[][..], |flat| &flat.regions);
            for (number, region) in regions.iter().enumerate() {
                if now.get(number).unwrap_or(&false) != before.get(number).unwrap_or(&false) {
                    let ends = region.outline.iter().flatten();
                    boxes.push(Bounds::of(ends.map(|end| scene.pose(body).point(*end))));
                }
            }
        }
        Tree::build(boxes.len(), 1, |i| boxes[i]).0
    }

    /// Flags of the regions of all bodies.
    pub(super) fn into_flags(self) -> Vec<Vec<bool>> {
        self.is_contour
    }

    /// Number the surfaces of cells, and remove the hits in regions that are integrated along their outline.
    pub(super) fn number_surfaces(&self, cells: &mut TileCells, sector: &Sector) {
        let mut rest = cells.hit;
        while rest != 0 {
            let cell = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let body = cells.body[cell];
            let flat = sector.scene.surface(body).flat_regions();
            let region = flat.and_then(|flat| flat.of_triangle(cells.triangle[cell]));
            // Exact in single precision, as a body has at most 255 regions. From 65 536 bodies on, some share a number.
            cells.surface[cell] = body | region.map_or(0, |region| region as u32 + 1) << 16;
            if region.is_some_and(|region| self.is_contour[body as usize].get(region) == Some(&true)) {
                cells.remove(cell);
            }
        }
    }
}

/// Leave overlapping regions of one plane to cells: rays decide which of them is in front.
fn leave_out_coincident<T, U>(regions: &mut [Option<(T, U, Outline)>]) {
    let mut is_covered = vec![false; regions.len()];
    let mut found: Vec<(usize, &Outline)> = (regions.iter().enumerate())
        .filter_map(|(number, region)| region.as_ref().map(|region| (number, &region.2)))
        .collect();
    found.sort_by(|a, b| a.1.height.total_cmp(&b.1.height));
    for (at, (number, first)) in found.iter().enumerate() {
        let alike = found[at + 1..].iter();
        for (other, second) in alike.take_while(|(_, second)| second.height - first.height <= THROUGH_BASE) {
            if first.covers(second) {
                (is_covered[*number], is_covered[*other]) = (true, true);
            }
        }
    }
    for (region, is_covered) in regions.iter_mut().zip(is_covered) {
        if is_covered {
            *region = None;
        }
    }
}

/// Antennas that weights are for: both at the middle of the array for all channels, or a pair per channel.
fn pairs(array: &Array, has_common_weight: bool) -> Vec<[DVec3; 2]> {
    if has_common_weight {
        return vec![[DVec3::ZERO; 2]];
    }
    (0..array.num_channels())
        .map(|channel| array.antennas(channel))
        .collect()
}

/// Outline of a flat region in the sensor frame.
struct Outline {
    /// Unit normal away from the sensor, and height of the sensor above the plane [m].
    normal: DVec3,
    height: f64,
    /// Directed edges, counterclockwise about the normal.
    edges: Vec<[DVec3; 2]>,
}

impl Outline {
    fn new(pose: &Pose, region: &FlatRegion) -> Self {
        let edges = region.outline.iter().map(|edge| edge.map(|end| pose.point(end)));
        let normal = pose.direction(region.normal);
        let height = normal.dot(pose.point(region.outline[0][0]));
        if height > 0.0 {
            return Self {
                normal,
                height,
                edges: edges.collect(),
            };
        }
        Self {
            normal: -normal,
            height: -height,
            edges: edges.map(|[a, b]| [b, a]).collect(),
        }
    }

    /// True if all antennas are on one side of the plane, and no coordinate is beyond what a scene has.
    fn is_in_range(&self, pairs: &[[DVec3; 2]]) -> bool {
        let is_off = |antenna: &DVec3| self.height - self.normal.dot(*antenna) > LEAST_HEIGHT;
        let is_near = |end: &DVec3| end.abs().max_element() <= FARTHEST;
        let antennas = pairs.as_flattened().iter();
        antennas.chain(&[DVec3::ZERO]).all(is_off) && self.edges.as_flattened().iter().all(is_near)
    }

    /// Foot of the perpendicular from the sensor.
    fn foot(&self) -> DVec3 {
        self.height * self.normal
    }

    /// Point of the plane that reflects from one antenna to the other.
    fn specular_point(&self, pair: [DVec3; 2]) -> DVec3 {
        specular_point(pair, self.foot(), -self.normal)
    }

    /// Point of an edge nearest to the sensor.
    fn nearest(&self, edge: [DVec3; 2]) -> DVec3 {
        let ([from, to], _) = self.about(self.foot(), edge);
        edge[0] + (from.max(0.0).min(to) - from) * (edge[1] - edge[0]).normalize()
    }

    /// Coordinates of both ends along an edge, from the point nearest to a point of the plane, and the distance of that
    /// point from the edge, positive on the inner side [m].
    fn about(&self, point: DVec3, [a, b]: [DVec3; 2]) -> ([f64; 2], f64) {
        let along = (b - a).normalize();
        let outward = along.cross(self.normal);
        ([a, b].map(|end| (end - point).dot(along)), (a - point).dot(outward))
    }

    /// Part of a whole turn that the outline makes about a point of the plane: 1 inside, a half on an edge, 0 outside.
    fn winding(&self, point: DVec3) -> f64 {
        let angle = |edge: &[DVec3; 2]| {
            let ([from, to], offset) = self.about(point, *edge);
            if offset.abs() < self.touching() {
                0.0
            } else {
                (to / offset).atan() - (from / offset).atan()
            }
        };
        let turn = self.edges.iter().map(angle).sum::<f64>() / TAU;
        if turn < WINDING { 0.0 } else { turn }
    }

    /// Distance of an edge from the specular point at which it passes through it [m].
    fn touching(&self) -> f64 {
        TOUCHING * self.height
    }

    /// Gradient of the path length from one antenna over a point of the plane to the other, along the plane.
    fn gradient(&self, pair: [DVec3; 2], point: DVec3) -> DVec3 {
        let sum: DVec3 = pair.iter().map(|antenna| (point - antenna).normalize()).sum();
        sum - self.normal.dot(sum) * self.normal
    }

    /// Integral along a piece of an edge of the outward part of the gradient over its square [m], with the mean phase
    /// of the piece relative to its middle.
    ///
    /// Distances from the specular point, where the gradient vanishes, say how it varies: their inverse square has a closed
    /// integral, and the rest is nearly constant. The phase is linear but for the square of these distances.
    fn arc(&self, wavenumber: f64, pair: [DVec3; 2], piece: [DVec3; 2]) -> Complex64 {
        let (length, along) = (piece[0].distance(piece[1]), (piece[1] - piece[0]).normalize());
        let ([from, to], offset) = self.about(self.specular_point(pair), piece);
        let over_squares = if offset.abs() < self.touching() {
            from.recip() - to.recip()
        } else {
            ((to / offset).atan() - (from / offset).atan()) / offset
        };
        let nearest = from.max(0.0).min(to);
        let square = offset * offset + nearest * nearest;
        if square.sqrt() < self.touching() {
            // Half of the mirror image stands for an edge through the specular point.
            return Complex64::ZERO;
        }
        let gradient = self.gradient(pair, piece[0] + (nearest - from) * along);
        let arc = gradient.dot(along.cross(self.normal)) * square / gradient.length_squared() * over_squares;

        let middle = 0.5 * (piece[0] + piece[1]);
        let slope = 0.5 * self.gradient(pair, middle).dot(along);
        let closeness = pair.iter().map(|antenna| 0.5 / middle.distance(*antenna)).sum::<f64>();
        let x = wavenumber * slope * length;
        let spread = length * length / 12.0;
        let of_middle = offset * offset + 0.25 * (from + to) * (from + to);
        let beyond = length / over_squares - of_middle - spread + spread * (1.0 - slope * slope) * bend(x);
        Complex64::cis(-wavenumber * closeness * beyond) * (arc * sinc(x))
    }

    /// True if the foot of the perpendicular and the nearest points move little where the body turns by an angle [rad].
    fn moves_little(&self, turn: f64, wavelength: f64) -> bool {
        if turn == 0.0 {
            return true;
        }
        let farthest = self.edges.iter().map(|edge| edge[0].length()).fold(0.0, f64::max);
        let to_edge = |edge: &[DVec3; 2]| self.nearest(*edge).distance(self.foot());
        let from_foot = self.edges.iter().map(to_edge).fold(f64::INFINITY, f64::min);
        let zone = (wavelength * self.height).sqrt();
        let [least, most] = OF_ZONE.map(|factor| factor * zone);
        turn * farthest <= (OF_DISTANCE * from_foot).clamp(least, most)
    }

    /// Direction of the longest edge.
    fn along(&self) -> DVec3 {
        let lengths = self.edges.iter().map(|edge| edge[1] - edge[0]);
        let longest = lengths.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        longest.unwrap_or(DVec3::X).normalize()
    }

    /// Pyramid from the sensor to the region.
    fn pyramid(&self) -> Pyramid {
        Pyramid::over(self.edges.as_flattened(), self.normal, self.along())
    }

    /// True if both of the same height are in one plane, and the rectangles around them along a side of this one overlap.
    fn covers(&self, other: &Self) -> bool {
        if self.normal.dot(other.normal) < 1.0 - 1e-9 {
            return false;
        }
        let along = self.along();
        [along, self.normal.cross(along)].iter().all(|axis| {
            let [a, b] = [self, other].map(|outline| extent(outline.edges.as_flattened(), *axis));
            a[1].min(b[1]) - a[0].max(b[0]) > THROUGH_SIDE
        })
    }
}

/// Flat region of a body, and what its points depend on.
struct Region<'a> {
    sectors: &'a [Sector<'a>],
    body: u32,
    triangle: u32,
    material: &'a Material,
    wavenumber: f64,
    /// Antennas that the weights of the points are for.
    pairs: &'a [[DVec3; 2]],
    /// Field of the smallest cross-section of interest, see [`field_of`] [m^2].
    floor: f64,
    outline: Outline,
}

impl Region<'_> {
    /// Points of the edges, of their ends, and of the mirror image.
    fn points(&self) -> TilePoints {
        let mut points = TilePoints::default();
        for edge in &self.outline.edges {
            self.add_edge(*edge, &mut points);
        }
        self.add(&mut points, self.outline.foot(), PointKind::Mirror, |pair| {
            let share = self.outline.winding(self.outline.specular_point(pair));
            Complex64::from(0.5 * share / self.wavenumber)
        });
        points
    }

    fn add_edge(&self, edge: [DVec3; 2], points: &mut TilePoints) {
        let (k, outline, along) = (self.wavenumber, &self.outline, (edge[1] - edge[0]).normalize());
        let ([start, end], offset) = outline.about(outline.foot(), edge);
        let distance = outline.height.hypot(offset);
        let zone = (TAU / k * distance).sqrt();
        let length = zone / PIECES.sqrt();
        let field = |point: DVec3, weight: Complex64| 8.0 * PI * outline.height / point.length() * weight.norm();
        let nearest = outline.nearest(edge);
        let gradient = outline.gradient([DVec3::ZERO; 2], nearest).length();
        let strength = field(nearest, self.edge_weight() * zone / gradient);
        if self.pairs.len() == 1 && strength < LEAST_EDGE * self.floor {
            return;
        }
        // Half of what the phase turns over a piece.
        let slope = |pair, point| 0.5 * k * outline.gradient(pair, point).dot(along) * length;
        // Pieces farther from the nearest point are rolled off for any pair of antennas.
        let sine = ZERO / (k * length);
        let rolled_off = if sine < 1.0 {
            distance * sine / (1.0 - sine * sine).sqrt()
        } else {
            f64::INFINITY
        };
        let reach = self.pairs.as_flattened().iter().map(|antenna| antenna.length());
        let farthest = rolled_off + reach.fold(0.0, f64::max);

        // Piece 0 has its middle at the nearest point.
        let [low, high] = [start.max(-farthest), end.min(farthest)];
        let [first, last] = [low, high].map(|place| (place / length).round().clamp(-MOST_PIECES, MOST_PIECES) as i64);
        for number in first..=last {
            let borders = [-0.5, 0.5].map(|half| (number as f64 + half) * length);
            let (from, to) = (low.max(borders[0]), high.min(borders[1]));
            if to <= from {
                continue;
            }
            let [from, to] = [from, to].map(|place| edge[0] + (place - start) * along);
            let middle = 0.5 * (from + to);
            self.add(points, middle, PointKind::Edge, |pair| {
                match share(slope(pair, middle)) {
                    0.0 => Complex64::ZERO,
                    share => self.edge_weight() * outline.arc(k, pair, [from, to]) * share,
                }
            });
        }
        for (end, sign) in [(edge[0], -1.0), (edge[1], 1.0)] {
            let weight = |pair: [DVec3; 2]| {
                let rest = 1.0 - share(slope(pair, end));
                if rest == 0.0 {
                    return Complex64::ZERO;
                }
                // The arc by the place, over j times the rate of the phase.
                let gradient = outline.gradient(pair, end);
                let arc = gradient.dot(along.cross(outline.normal)) / gradient.length_squared();
                self.edge_weight() * arc * Complex64::new(0.0, sign * rest / (k * gradient.dot(along)))
            };
            if field(end, weight([DVec3::ZERO; 2])) > SHARE * self.floor {
                self.add(points, end, PointKind::Corner, weight);
            }
        }
    }

    /// Weight of an arc of an edge for a reflection coefficient of one [m]: of an area, `j / 8 pi`, over `-j k`.
    fn edge_weight(&self) -> Complex64 {
        Complex64::from(-1.0 / (8.0 * PI * self.wavenumber))
    }

    /// Append a point, if it is in view and has a weight; `weight`: of a pair of antennas, for a reflection coefficient of
    /// one.
    fn add(&self, points: &mut TilePoints, position: DVec3, kind: PointKind, weight: impl Fn([DVec3; 2]) -> Complex64) {
        if self.place(position).is_none() {
            return;
        }
        let (array, normal) = (self.sectors[0].array, -self.outline.normal);
        let weight = |pair: &[DVec3; 2]| {
            let directions = pair.map(|antenna| (position - antenna).normalize());
            weight(*pair) * self.material.response_to(array, normal, directions).reflection
        };
        let weights: Vec<Complex64> = self.pairs.iter().map(weight).collect();
        if weights.iter().any(|weight| *weight != Complex64::ZERO) {
            points.points.push(TilePoint {
                position,
                normal,
                body: self.body,
                triangle: self.triangle,
            });
            points.weights.extend(weights);
            points.set_kind(kind);
        }
    }

    /// Nearest point in view: the foot of the perpendicular, or a point of the outline.
    fn nearest(&self) -> Option<NearestHit> {
        let foot = self.outline.foot();
        let inside = (self.outline.winding(foot) > 0.0).then_some(foot);
        let on_edges = self.outline.edges.iter().map(|edge| self.outline.nearest(*edge));
        let points = on_edges.chain(inside);
        let hits = points.filter_map(|point| {
            let (sector, [u, v]) = self.place(point)?;
            let cell = Cell { u, v, du: 0.0, dv: 0.0 };
            let (body, triangle, distance) = (self.body, self.triangle, point.length());
            Some(NearestHit {
                body,
                triangle,
                distance,
                cell,
                sector,
            })
        });
        hits.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    /// Number of the first sector that shows a point, and the coordinates u and v there.
    fn place(&self, position: DVec3) -> Option<(usize, [f64; 2])> {
        let on_body = self.sectors[0].scene.pose(self.body).point_to_body(position);
        let mut places = self.sectors.iter().enumerate().filter_map(|(number, sector)| {
            let [x, y, z] = sector.scene.pose(self.body).point(on_body).to_array();
            let (u, v) = (y / x, z / x);
            let (row, column) = sector.plane.pixel([u, v]);
            let is_within = |place: f64, number: usize| (0.0..=number as f64).contains(&place);
            let is_shown = x > 0.0 && is_within(row, sector.plane.rows) && is_within(column, sector.plane.columns);
            let is_outside = sector.cast.outside.is_some_and(|is_outside| is_outside([u; 2], [v; 2]));
            (is_shown && !is_outside).then_some((number, [u, v]))
        });
        places.next()
    }
}

/// Mean squared place on a piece weighted by the phase, with a change of its half by `x` over the piece, relative to a
/// constant phase: -3 times the ratio of the second derivative of sinc to sinc.
fn bend(x: f64) -> f64 {
    if x.abs() < 0.1 {
        // To the fourth power of x.
        1.0 - 2.0 / 15.0 * x * x
    } else {
        3.0 - 6.0 / (x * x) + 6.0 / (x * x.tan())
    }
}

/// Share of a point over whose piece half the phase turns by `slope` [rad].
fn share(slope: f64) -> f64 {
    let t = ((slope.abs() - ROLLS_OFF) / (ZERO - ROLLS_OFF)).clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}
