//! Triangles of one polygon.

use glam::DVec3;

/// Corners are trusted to this fraction of the polygon's largest coordinate: files carry about six digits, and edges
/// that touch in the drawing may cross by that much in the file.
const ROUNDING: f64 = 1e-5;

/// Rounding of the areas here, in the same unit.
const ARITHMETIC: f64 = 1e-12;

/// Time is quadratic in the number of corners: up to seconds for this one.
const MAX_CORNERS: usize = 1 << 14;

/// Triangles of one polygon, as positions of their corners in `polygon`, with its winding.
///
/// `polygon` has shape (corner,), in any unit, and may be concave; a hole is part of the ring if an edge leads to it
/// and back. Corners that repeat the one before add nothing, nor does a ring that runs round more than once. A quad
/// need not be flat: it is cut along the diagonal that gives the smaller area. Larger polygons are cut as seen along
/// their mean normal. The error says why there is no answer, as for edges that cross one another.
pub fn triangulate(polygon: &[DVec3]) -> Result<Vec<[u32; 3]>, String> {
    let ring = one_lap(polygon);
    if ring.len() > MAX_CORNERS {
        return Err(format!(
            "face: expected at most {MAX_CORNERS} corners, got {}",
            ring.len()
        ));
    }
    let points = scaled(polygon, &ring);
    let triangles = match points[..] {
        [] | [_] | [_, _] => Some(Vec::new()),
        [_, _, _] => Some(vec![[0, 1, 2]]),
        [a, b, c, d] => split_quad(a, b, c, d),
        _ => cut_flat(&points),
    };
    let triangles = triangles.ok_or("face: expected a polygon whose edges do not cross, got one whose edges do")?;
    Ok(triangles
        .into_iter()
        .map(|triangle| triangle.map(|corner| ring[corner as usize]))
        .collect())
}

/// Corners of the ring without those that repeat the one before, and without all laps but the first.
fn one_lap(polygon: &[DVec3]) -> Vec<u32> {
    let at = |corner: u32| polygon[corner as usize];
    let mut ring: Vec<u32> = (0..polygon.len() as u32).collect();
    ring.dedup_by(|next, last| at(*next) == at(*last));
    while ring.len() > 1 && at(ring[0]) == at(ring[ring.len() - 1]) {
        ring.pop();
    }
    let laps_of = |period: usize| (period..ring.len()).all(|i| at(ring[i]) == at(ring[i - period]));
    let period = (1..ring.len()).find(|&period| ring.len().is_multiple_of(period) && laps_of(period));
    ring.truncate(period.unwrap_or(ring.len()));
    ring
}

/// Corners relative to the first, in a unit that makes the largest coordinate 1 to 2.
///
/// The unit is a power of two, so nothing is rounded by it, and products neither overflow nor vanish.
fn scaled(polygon: &[DVec3], ring: &[u32]) -> Vec<DVec3> {
    const EXPONENT: u64 = 0x7ff << 52;
    let points = || ring.iter().map(|&corner| polygon[corner as usize]);
    let largest = points()
        .map(|point| point.abs().max_element())
        .fold(f64::MIN_POSITIVE, f64::max);
    let unit = f64::from_bits(largest.to_bits() & EXPONENT);
    points()
        .map(|point| point / unit - polygon[ring[0] as usize] / unit)
        .collect()
}

/// Two triangles along the diagonal that gives the smaller area; `None` for a flat quad whose edges cross.
fn split_quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Option<Vec<[u32; 3]>> {
    let area = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a).length() / 2.0;
    let areas = [area(a, b, c), area(a, c, d), area(a, b, d), area(b, c, d)];

    // In a flat quad the inner diagonal gives the smaller area, and in a convex one both give the same.
    let (along_ac, along_bd) = (areas[0] + areas[1], areas[2] + areas[3]);
    let (triangles, total) = if along_ac <= along_bd * (1.0 + 1e-12) {
        (vec![[0, 1, 2], [0, 2, 3]], along_ac)
    } else {
        (vec![[0, 1, 3], [1, 2, 3]], along_bd)
    };

    // What exceeds the area of the ring is due to a bend or to edges that cross; a bend lifts a corner off the plane.
    let ring_area = (c - a).cross(d - b).length() / 2.0;
    let widest = areas.into_iter().fold(f64::MIN_POSITIVE, f64::max);
    let lift = (b - a).cross(c - a).dot(d - a).abs() / (2.0 * widest);
    let perimeter = perimeter(&[a, b, c, d]);
    (total - ring_area <= (ROUNDING + lift) * perimeter).then_some(triangles)
}

/// Triangles of five corners or more, cut in the plane; `None` where they do not make up the ring.
fn cut_flat(points: &[DVec3]) -> Option<Vec<[u32; 3]>> {
    if repeats_an_edge(points) {
        return None;
    }
    let tolerance = ROUNDING * perimeter(points);

    // Drop the coordinate along which the polygon is thinnest. Unlike a rotation this rounds nothing.
    let ring_area = newell(points);
    let normal = if ring_area.length() > tolerance {
        ring_area
    } else {
        widest_normal(points)
    };
    let mut flat: Vec<[f64; 2]> = match normal.abs().max_position() {
        0 => points.iter().map(|point| [point.y, point.z]).collect(),
        1 => points.iter().map(|point| [point.z, point.x]).collect(),
        _ => points.iter().map(|point| [point.x, point.y]).collect(),
    };

    // Make the ring counter-clockwise.
    let mut flat_area = edges(&flat).map(|(a, b)| doubled_area(flat[0], a, b)).sum::<f64>() / 2.0;
    if flat_area < 0.0 {
        flat_area = -flat_area;
        for point in &mut flat {
            point.swap(0, 1);
        }
    }

    // Corners that were dropped for being nearly on a line may add up.
    let triangles = cut_ears(&flat)?;
    let area = |&[a, b, c]: &[u32; 3]| doubled_area(flat[a as usize], flat[b as usize], flat[c as usize]) / 2.0;
    let total: f64 = triangles.iter().map(area).sum();
    ((total - flat_area).abs() <= tolerance).then_some(triangles)
}

/// Triangles of a counter-clockwise ring, cut off its ears one by one; `None` where no ear is left.
///
/// Ears are found as in Eberly, "Triangulation by Ear Clipping". Time is quadratic in the number of corners for any
/// ring: a corner that is no ear is looked at again when one of its neighbours has gone, and once per slack.
fn cut_ears(flat: &[[f64; 2]]) -> Option<Vec<[u32; 3]>> {
    let num_corners = flat.len();
    let mut ring = Ring {
        previous: [num_corners - 1].into_iter().chain(0..num_corners - 1).collect(),
        next: (1..num_corners).chain([0]).collect(),
        flat,
    };
    let mut triangles = Vec::with_capacity(num_corners - 2);
    let (mut num_left, mut corner) = (num_corners, 0);
    for slack in [0.0, ARITHMETIC, ROUNDING] {
        let mut is_known = vec![false; num_corners];
        let mut num_failed = 0;
        while num_left > 2 && num_failed < num_left {
            let (previous, next) = (ring.previous[corner], ring.next[corner]);
            if is_known[corner] || !ring.is_ear(corner, slack) {
                is_known[corner] = true;
                num_failed += 1;
                corner = next;
                continue;
            }
            if ring.turn(corner) > 0.0 {
                triangles.push([previous, corner, next].map(|corner| corner as u32));
            }
            (ring.next[previous], ring.previous[next]) = (next, previous);
            (is_known[previous], is_known[next]) = (false, false);
            num_left -= 1;
            num_failed = 0;
            corner = ring.next[next]; // every other corner: a fan would have needles
        }
    }
    (num_left <= 2).then_some(triangles)
}

/// Corners that are left of a ring, each linked to its neighbours.
struct Ring<'a> {
    flat: &'a [[f64; 2]],
    previous: Vec<usize>,
    next: Vec<usize>,
}

impl Ring<'_> {
    /// Doubled area of the triangle at a corner, positive where the corner is convex.
    fn turn(&self, corner: usize) -> f64 {
        let [a, b, c] = [self.previous[corner], corner, self.next[corner]].map(|corner| self.flat[corner]);
        doubled_area(a, b, c)
    }

    /// Whether the triangle at a corner can be cut off: the corner is convex, and no reflex corner lies deeper than
    /// `slack` in the triangle.
    fn is_ear(&self, corner: usize, slack: f64) -> bool {
        let [a, b, c] = [self.previous[corner], corner, self.next[corner]].map(|corner| self.flat[corner]);
        let turn = self.turn(corner);

        // Where the ring turns back on itself, nothing is cut off.
        let turns_back = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) <= 0.0;
        if turn == 0.0 && turns_back {
            return true;
        }
        let sides = [(a, b), (b, c), (c, a)];
        let margins = sides.map(|(a, b)| slack * (b[0] - a[0]).hypot(b[1] - a[1]));
        if turn <= -margins[2] {
            return false;
        }

        // Corners at the ends of the cut are no obstacle: edges that lead to a hole and back have two of each.
        let low = [0, 1].map(|axis| a[axis].min(b[axis]).min(c[axis]));
        let high = [0, 1].map(|axis| a[axis].max(b[axis]).max(c[axis]));
        let mut others = std::iter::successors(Some(self.next[self.next[corner]]), |&other| Some(self.next[other]))
            .take_while(|&other| other != self.previous[corner]);
        !others.any(|other| {
            let point = self.flat[other];
            (0..2).all(|axis| low[axis] <= point[axis] && point[axis] <= high[axis])
                && (0..3).all(|side| doubled_area(sides[side].0, sides[side].1, point) >= margins[side])
                && point != a
                && point != c
                && self.turn(other) <= 0.0
        })
    }
}

/// Whether the ring runs along one edge twice in the same direction, so that it lies over itself.
///
/// Ears of such a ring would have its area, counted twice.
fn repeats_an_edge(points: &[DVec3]) -> bool {
    let bits = |point: DVec3| point.to_array().map(|x| (x + 0.0).to_bits()); // -0 becomes 0
    let mut edges: Vec<_> = edges(points).map(|(a, b)| (bits(a), bits(b))).collect();
    edges.sort_unstable();
    edges.windows(2).any(|pair| pair[0] == pair[1])
}

/// Area of a ring times its mean normal, by Newell's method.
fn newell(points: &[DVec3]) -> DVec3 {
    edges(points)
        .map(|(a, b)| (a - points[0]).cross(b - points[0]))
        .sum::<DVec3>()
        / 2.0
}

/// Normal of the widest triangle over the longest line from the first corner; zero if all corners lie on a line.
fn widest_normal(points: &[DVec3]) -> DVec3 {
    let longest = |a: DVec3, b: DVec3| if b.length_squared() > a.length_squared() { b } else { a };
    let line = points.iter().map(|&point| point - points[0]).fold(DVec3::ZERO, longest);
    points
        .iter()
        .map(|&point| line.cross(point - points[0]))
        .fold(DVec3::ZERO, longest)
}

fn perimeter(points: &[DVec3]) -> f64 {
    edges(points).map(|(a, b)| a.distance(b)).sum()
}

fn edges<T: Copy>(ring: &[T]) -> impl Iterator<Item = (T, T)> {
    ring.iter().copied().zip(ring.iter().copied().cycle().skip(1))
}

fn doubled_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
