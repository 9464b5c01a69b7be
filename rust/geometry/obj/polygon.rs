//! Triangles of one polygon.

use earcut::Earcut;
use glam::DVec3;

/// Accuracy of corners as a fraction of the polygon's largest coordinate: files carry about six digits, and edges
/// that touch in the drawing may cross by that much in the file.
const ROUNDING: f64 = 1e-5;

/// Largest number of corners: where edges cross time is cubic in it, up to seconds for this one.
const MAX_CORNERS: usize = 1 << 12;

/// Triangles of one polygon, as positions of their corners in `polygon`, with its winding.
///
/// `polygon` has shape (corner,), in any unit, and may be concave; a hole is part of the ring if an edge leads to it
/// and back. Corners that repeat the one before add nothing. A quad may be bent: it is cut along the diagonal with the
/// smaller area. Larger polygons are cut by earcut, as seen along the axis nearest to their mean normal. The error says
/// what was expected in place of a polygon without an answer, as for edges that cross one another.
pub fn triangulate(polygon: &[DVec3]) -> Result<Vec<[u32; 3]>, String> {
    let at = |corner: u32| polygon[corner as usize];
    let mut ring: Vec<u32> = (0..polygon.len() as u32).collect();
    ring.dedup_by(|next, last| at(*next) == at(*last));
    while ring.len() > 1 && at(ring[0]) == at(ring[ring.len() - 1]) {
        ring.pop();
    }
    let num_corners = ring.len();
    if num_corners > MAX_CORNERS {
        return Err(format!("at most {MAX_CORNERS} corners"));
    }

    let points: Vec<DVec3> = ring.iter().map(|&corner| at(corner) - at(ring[0])).collect();
    let rounding = ROUNDING
        * polygon
            .iter()
            .map(|point| point.abs().max_element())
            .fold(0.0, f64::max);
    let triangles = match points[..] {
        [] | [_] | [_, _] => Some(Vec::new()),
        [_, _, _] => Some(vec![[0, 1, 2]]),
        [a, b, c, d] => split_quad(a, b, c, d, rounding),
        _ => cut_ears(&points, rounding),
    };
    let triangles = triangles.ok_or("a polygon whose edges do not cross")?;
    Ok(triangles
        .into_iter()
        .map(|triangle| triangle.map(|corner| ring[corner as usize]))
        .collect())
}

/// Two triangles along the diagonal that gives the smaller area; `None` for a flat quad whose edges cross.
fn split_quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3, rounding: f64) -> Option<Vec<[u32; 3]>> {
    let area = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a).length() / 2.0;
    let areas = [area(a, b, c), area(a, c, d), area(a, b, d), area(b, c, d)];

    // In a flat quad the inner diagonal gives the smaller area, and in a convex one both give the same.
    let (along_ac, along_bd) = (areas[0] + areas[1], areas[2] + areas[3]);
    let (triangles, total) = if along_ac <= along_bd * (1.0 + 1e-12) {
        (vec![[0, 1, 2], [0, 2, 3]], along_ac)
    } else {
        (vec![[0, 1, 3], [1, 2, 3]], along_bd)
    };

    // Area beyond the ring comes from a bend or from crossing edges; a bend lifts a corner off the plane.
    let ring_area = (c - a).cross(d - b).length() / 2.0;
    let widest = areas.into_iter().fold(f64::MIN_POSITIVE, f64::max);
    let lift = (b - a).cross(c - a).dot(d - a).abs() / (2.0 * widest);
    (total - ring_area <= (rounding + lift) * perimeter(&[a, b, c, d])).then_some(triangles)
}

/// Triangles of five corners or more, cut in the plane; `None` where they do not make up the ring.
fn cut_ears(points: &[DVec3], rounding: f64) -> Option<Vec<[u32; 3]>> {
    if repeats_an_edge(points) {
        return None;
    }

    // Area times mean normal, by Newell's method; for a ring that encloses none, the normal of its widest wedge.
    let wedges = || edges(points).map(|(a, b)| a.cross(b) / 2.0);
    let widest = wedges().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let area = wedges().sum::<DVec3>();
    let normal = if area.length() > ROUNDING * widest.length() {
        area
    } else {
        widest
    };

    // Drop the coordinate along which the polygon is thinnest, and keep it counter-clockwise. Unlike a rotation this
    // rounds nothing.
    let axis = normal.abs().max_position();
    let flat = points.iter().map(|point| match axis {
        0 => [point.y, point.z],
        1 => [point.z, point.x],
        _ => [point.x, point.y],
    });
    let flat: Vec<[f64; 2]> = if normal[axis] < 0.0 {
        flat.map(|[x, y]| [y, x]).collect()
    } else {
        flat.collect()
    };
    let mut corners: Vec<u32> = Vec::new();
    Earcut::new().earcut(flat.iter().copied(), &[], &mut corners);

    // Where edges cross, ears overlap, leave gaps, or reverse their winding: their areas sum to the ring's area with
    // and without signs.
    let triangles: Vec<[u32; 3]> = corners.as_chunks().0.to_vec();
    let doubled_area = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|corner| flat[corner as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let areas = || triangles.iter().map(|triangle| doubled_area(triangle) / 2.0);
    let excess = |total: f64| (total - area[axis].abs()).abs();
    let worst = excess(areas().sum()).max(excess(areas().map(f64::abs).sum()));
    (worst <= rounding * perimeter(points)).then_some(triangles)
}

/// True if the ring traverses one edge twice in the same direction, so that it lies over itself: earcut would take
/// minutes for a ring of many laps.
fn repeats_an_edge(points: &[DVec3]) -> bool {
    let bits = |point: DVec3| point.to_array().map(|x| (x + 0.0).to_bits()); // -0 becomes 0
    let mut edges: Vec<_> = edges(points).map(|(a, b)| (bits(a), bits(b))).collect();
    edges.sort_unstable();
    edges.windows(2).any(|pair| pair[0] == pair[1])
}

fn perimeter(points: &[DVec3]) -> f64 {
    edges(points).map(|(a, b)| a.distance(b)).sum()
}

/// Ends of the edges of a ring.
fn edges(ring: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    ring.iter().copied().zip(ring.iter().copied().cycle().skip(1))
}
