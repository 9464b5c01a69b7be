//! Physical optics of a plane wave over the triangles that it illuminates.
//!
//! The phase over a triangle follows its curved surface. Where it is linear but for a small quadratic part, the mean
//! of the phasor has a closed form (`mean_phasor`), else the triangle is quartered: a flat face costs one evaluation,
//! whatever its size in wavelengths. Triangles that are illuminated in part are quartered along the shadow's edge;
//! those below a wavelength are illuminated if their middle is.

use std::f64::consts::TAU;
use std::ops::{AddAssign, Range};

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use super::aspect::Aspect;
use super::field::{Field, Incidence};
use super::interaction::Interaction;
use super::lattice::{Illumination, ShadowLattice};
use super::shooting::Shooter;
use crate::antennas::polarization::{PolarizationWeights, transverse};
use crate::cancel::Cancel;
use crate::error::Result;
use crate::geometry::aabb::Bounds;
use crate::numeric::trig::sinc;
use crate::rays::watertight::Ray;

/// Largest quadratic part of the phase in the middle of a side of a triangle [rad]. Ten times this value leaves 0.3 dB
/// on a cylinder with facets wider than half a wavelength: residuals of steep facets add up as on a grating.
const MOST_CURVED: f64 = 0.03;

/// Largest change of the unit normal between two corners of a triangle.
const MOST_TURNED: f64 = 0.3;

/// Triangles of a lattice of points whose shadows are looked for have this share of the size of the scene at most.
const LATTICE: f64 = 1.0 / 64.0;

/// Side of the smallest triangles along the edge of a shadow, and across the wave of curved triangles that are not
/// quartered further, at grazing incidence [wavelengths].
const FINEST: f64 = 0.25;

/// Shift of a point of a lattice towards the middle of its triangle, relative to its distance: a ray to a corner would
/// meet any of the triangles round it.
const INWARDS: f64 = 1e-4;

/// Difference of two distances relative to a ray below which they are equal.
const TOUCHING: f64 = 1e-9;

/// Number of tasks of a body of few triangles.
const TASKS: usize = 256;

/// Most triangles of a task.
const TASK: usize = 64;

/// Field and power of the first reflection.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reflected {
    /// Far field of the specular part [m], without the factor `j / lambda`.
    pub(super) field: Complex64,
    /// Cross-section of the diffuse part by Lambert's law, in the mean over speckle [m^2].
    pub(super) diffuse: f64,
}

impl AddAssign for Reflected {
    fn add_assign(&mut self, other: Self) {
        self.field += other.field;
        self.diffuse += other.diffuse;
    }
}

/// First reflection of a plane wave by all bodies.
pub(super) fn first_reflection(shooter: &Shooter, aspect: &Aspect, cancel: &Cancel) -> Result<Reflected> {
    let scene = shooter.scene;
    let mut bounds = Bounds::EMPTY;
    for body in 0..scene.num_bodies() as u32 {
        bounds = bounds.union(&Bounds::of(scene.corners(body)));
    }
    let wave = Wave {
        shooter,
        aspect,
        reach: 2.0 * (bounds.max - bounds.min).length(),
        finest: FINEST * shooter.wavelength,
    };
    let task = |(body, triangles): (u32, Range<usize>)| -> Result<Reflected> {
        cancel.check()?;
        let mut sum = Reflected::default();
        for triangle in triangles {
            sum += wave.triangle(body, triangle as u32);
        }
        Ok(sum)
    };
    let tasks: Vec<(u32, Range<usize>)> = (0..scene.num_bodies() as u32)
        .flat_map(|body| {
            let number = scene.surface(body).num_triangles();
            let step = number.div_ceil(TASKS).clamp(1, TASK);
            (0..number)
                .step_by(step)
                .map(move |first| (body, first..(first + step).min(number)))
        })
        .collect();
    let sums = tasks.into_par_iter().map(task).collect::<Result<Vec<Reflected>>>()?;

    // In the order of the tasks: threads do not change the sum.
    let mut total = Reflected::default();
    for sum in sums {
        total += sum;
    }
    Ok(total)
}

/// A plane wave on its way to the receiver.
struct Wave<'a> {
    shooter: &'a Shooter<'a>,
    aspect: &'a Aspect,
    /// Length of a ray that begins outside the scene [m].
    reach: f64,
    /// Side of the smallest triangles along the edge of a shadow [m].
    finest: f64,
}

/// Triangle of a body.
struct Facet {
    body: u32,
    triangle: u32,
    corners: [DVec3; 3],
    is_flat: bool,
}

/// Point of a facet.
#[derive(Clone, Copy)]
struct Corner {
    /// Barycentric weights.
    weights: DVec3,
    /// Path from the front of the wave to the receiver by way of the curved surface, both through the origin [m].
    path: f64,
    /// Unit normal of the curved surface.
    normal: DVec3,
}

impl Facet {
    fn point(&self, weights: DVec3) -> DVec3 {
        weights.x * self.corners[0] + weights.y * self.corners[1] + weights.z * self.corners[2]
    }

    /// Longest side [m] of a part with these weights of its corners.
    fn size(&self, corners: &[DVec3; 3]) -> f64 {
        let [a, b, c] = corners.map(|weights| self.point(weights));
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    }
}

impl Wave<'_> {
    fn triangle(&self, body: u32, triangle: u32) -> Reflected {
        let (surface, pose) = (self.shooter.scene.surface(body), self.shooter.scene.pose(body));
        let facet = Facet {
            body,
            triangle,
            corners: surface.corners(triangle).map(|corner| pose.point(corner)),
            is_flat: surface.corner_normals(triangle).is_none(),
        };
        let [from, to] = self.aspect.directions;
        let [a, b, c] = facet.corners;
        let face = (b - a).cross(c - a);
        if face.dot(from) * face.dot(to) <= 0.0 {
            return Reflected::default();
        }

        let whole = [DVec3::X, DVec3::Y, DVec3::Z];
        let size = facet.size(&whole);
        let mut sum = Reflected::default();
        if size <= self.shooter.wavelength {
            if self.is_seen(&facet, DVec3::splat(1.0 / 3.0)) {
                self.add(&facet, whole.map(|at| self.corner(&facet, at)), 1.0, &mut sum);
            }
            return sum;
        }

        // A lattice fine enough for the shadows of other parts of the scene.
        let parts = size / (LATTICE * 0.5 * self.reach);
        let side = 1 << parts.log2().ceil().max(0.0) as i32;
        let lattice = ShadowLattice::new(side, |weights| self.is_seen(&facet, weights));
        self.add_visible_part(&facet, &lattice, [[0, 0], [side, 0], [0, side]], side, &mut sum);
        sum
    }

    /// Add the illuminated part of a triangle of the lattice, `side` steps long.
    fn add_visible_part(
        &self,
        facet: &Facet,
        lattice: &ShadowLattice,
        corners: [[i32; 2]; 3],
        side: i32,
        sum: &mut Reflected,
    ) {
        let weights = corners.map(|corner| lattice.weights(corner));
        match lattice.seen(corners, side) {
            Illumination::Full => self.add(facet, weights.map(|at| self.corner(facet, at)), 1.0, sum),
            Illumination::None => {}
            Illumination::Partial if side == 1 => {
                self.edge_of_shadow(facet, weights, corners.map(|corner| lattice.at(corner)), sum);
            }
            Illumination::Partial => {
                let middle = |[a, b]: [[i32; 2]; 2]| [0, 1].map(|axis| i32::midpoint(a[axis], b[axis]));
                for part in quarters(corners, middle) {
                    self.add_visible_part(facet, lattice, part, side / 2, sum);
                }
            }
        }
    }

    /// Add the illuminated part of a triangle with some occluded corners.
    fn edge_of_shadow(&self, facet: &Facet, weights: [DVec3; 3], seen: [bool; 3], sum: &mut Reflected) {
        let number = seen.iter().filter(|seen| **seen).count();
        if number == 0 {
            return;
        }
        if number == 3 || facet.size(&weights) <= self.finest {
            let share = number as f64 / 3.0;
            self.add(facet, weights.map(|at| self.corner(facet, at)), share, sum);
            return;
        }
        let middle = |[a, b]: [(DVec3, bool); 2]| {
            let weights = 0.5 * (a.0 + b.0);
            (weights, self.is_seen(facet, weights))
        };
        let corners = [0, 1, 2].map(|i| (weights[i], seen[i]));
        for part in quarters(corners, middle) {
            self.edge_of_shadow(facet, part.map(|corner| corner.0), part.map(|corner| corner.1), sum);
        }
    }

    /// Add a share of a triangle that is illuminated, quartered where its phase is not linear.
    fn add(&self, facet: &Facet, corners: [Option<Corner>; 3], share: f64, sum: &mut Reflected) {
        let [Some(a), Some(b), Some(c)] = corners else { return };
        if facet.is_flat {
            self.add_linear(facet, [a, b, c], 0.0, share, sum);
            return;
        }
        let middles = [[a, b], [b, c], [c, a]].map(|[a, b]| self.corner(facet, 0.5 * (a.weights + b.weights)));
        let [Some(ab), Some(bc), Some(ca)] = middles else {
            return;
        };
        let wavenumber = TAU / self.shooter.wavelength;
        let bent = [[a, ab, b], [b, bc, c], [c, ca, a]].map(|[a, middle, b]| {
            let turned = a.normal.distance(b.normal) > MOST_TURNED;
            (wavenumber * (middle.path - 0.5 * (a.path + b.path)), turned)
        });
        let is_bent = |(phase, turned): &(f64, bool)| phase.abs() > MOST_CURVED || *turned;
        if bent.iter().any(is_bent) && self.section(facet, &[a, b, c]) > 0.5 * self.finest * self.finest {
            for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]] {
                self.add(facet, part.map(Some), share, sum);
            }
        } else {
            // The mean of 4 (m_ab w_a w_b + ...) over the triangle.
            let mean = bent.iter().map(|(phase, _)| phase).sum::<f64>() / 3.0;
            self.add_linear(facet, [a, b, c], mean, share, sum);
        }
    }

    /// Add a triangle over which the phase is linear but for a mean [rad].
    fn add_linear(&self, facet: &Facet, corners: [Corner; 3], mean: f64, share: f64, sum: &mut Reflected) {
        let [from, to] = self.aspect.directions;
        let middle = (corners[0].weights + corners[1].weights + corners[2].weights) / 3.0;
        let Some(interaction) = self.interaction(facet, middle) else {
            return;
        };
        if interaction.normal.dot(to) <= 0.0 || interaction.face.dot(to) <= 0.0 {
            return;
        }
        let section = share * self.section(facet, &corners);

        let (material, wavelength) = (&self.shooter.materials[facet.body as usize], self.shooter.wavelength);
        let cosine = interaction.normal.dot(from);
        let incidence = Incidence {
            direction: -from,
            normal: interaction.normal,
            coefficients: material.reflection_coefficients(cosine, wavelength),
        };
        let polarizations = self.aspect.polarizations;
        let field = Field::launch(polarizations.map(|e| e[0]), -from);
        let radiated = field.radiate(&incidence, to, polarizations.map(|e| transverse(e[1], to)));
        let wavenumber = TAU / wavelength;
        let phasor = mean_phasor(corners.map(|corner| wavenumber * corner.path)) * Complex64::cis(-mean);
        sum.field += radiated * phasor * (section / cosine);
        if material.is_diffuse() {
            let seen = polarizations.map(|e| PolarizationWeights::by(e[0], interaction.normal, -from, -to));
            let albedo = material.response(cosine, wavelength, seen).albedo;
            sum.diffuse += 4.0 * albedo * section * interaction.normal.dot(to);
        }
    }

    /// Area across the wave [m^2].
    fn section(&self, facet: &Facet, corners: &[Corner; 3]) -> f64 {
        let [a, b, c] = corners.map(|corner| facet.point(corner.weights));
        0.5 * (b - a).cross(c - a).dot(self.aspect.directions[0]).abs()
    }

    /// Interaction with a point of a facet; none at grazing incidence.
    fn interaction(&self, facet: &Facet, weights: DVec3) -> Option<Interaction> {
        let direction = -self.aspect.directions[0];
        let origin = facet.point(weights) - self.reach * direction;
        let found = Interaction::new(self.shooter.scene, facet.body, facet.triangle, origin, direction);
        found.map(|(interaction, _)| interaction)
    }

    fn corner(&self, facet: &Facet, weights: DVec3) -> Option<Corner> {
        let [from, to] = self.aspect.directions;
        let interaction = self.interaction(facet, weights)?;
        Some(Corner {
            weights,
            path: -(from + to).dot(interaction.point),
            normal: interaction.normal,
        })
    }

    /// True if a point of a facet is illuminated, and seen by the receiver.
    fn is_seen(&self, facet: &Facet, weights: DVec3) -> bool {
        let weights = weights + INWARDS * (DVec3::splat(1.0 / 3.0) - weights);
        let [from, to] = self.aspect.directions;
        let point = facet.point(weights);
        let hit = self.shooter.scene.cast(&Ray {
            origin: point + self.reach * from,
            direction: -from,
            start: 0.0,
        });
        let is_this = (hit.body, hit.triangle) == (facet.body, facet.triangle);
        if !is_this {
            // A neighbour that was met by rounding is at its edge; the copy of a triangle is met inside.
            let is_inside = hit.barycentric.iter().all(|weight| *weight > 0.1 * INWARDS);
            if is_inside || hit.distance < (1.0 - TOUCHING) * self.reach {
                return false;
            }
        }
        if from == to {
            return true;
        }
        let interaction = self.interaction(facet, weights);
        interaction.is_some_and(|interaction| !self.shooter.is_occluded(&interaction, to, f64::INFINITY))
    }
}

/// Quarters of a triangle.
fn quarters<T: Copy>([a, b, c]: [T; 3], middle: impl Fn([T; 2]) -> T) -> [[T; 3]; 4] {
    let (ab, bc, ca) = (middle([a, b]), middle([b, c]), middle([c, a]));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
}

/// Mean of `exp(-j phi)` over a triangle on which the phase is linear, from the phases of its corners [rad].
///
/// Twice the divided difference of the exponential at the three phases (W. B. Gordon, IEEE Trans. Antennas Propag.,
/// 1975, gives the integral as a sum over edges).
fn mean_phasor([a, b, c]: [f64; 3]) -> Complex64 {
    // The outer two have the largest distance.
    let (ab, bc, ca) = ((a - b).abs(), (b - c).abs(), (c - a).abs());
    let [low, middle, high] = if ab >= bc && ab >= ca {
        [a, c, b]
    } else if bc >= ca {
        [b, a, c]
    } else {
        [a, b, c]
    };
    let apart = high - low;
    if apart.abs() < 0.02 {
        // exp(-j m) sum h_n(-j d) 2 / (n + 2)!, d from the mean m: h_0 = 1, h_1 = 0, h_2 = sum d^2 / 2, h_3 = sum d^3 / 3.
        let mean = (a + b + c) / 3.0;
        let [a, b, c] = [a, b, c].map(|phase| phase - mean);
        let second = (a * a + b * b + c * c) / 24.0;
        let third = (a * a * a + b * b * b + c * c * c) / 180.0;
        return Complex64::cis(-mean) * Complex64::new(1.0 - second, third);
    }
    // First differences: means over two sides.
    let side = |from: f64, to: f64| Complex64::cis(-0.5 * (from + to)) * sinc(0.5 * (to - from));
    (side(middle, high) - side(low, middle)) * Complex64::new(0.0, 2.0 / apart)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean over a triangle by the midpoint rule on `n` by `n` parts.
    fn mean_by_parts(phases: [f64; 3], n: usize) -> Complex64 {
        let mut sum = Complex64::ZERO;
        for i in 0..n {
            for j in 0..n - i {
                let mut add = |third: f64| {
                    let at = |k: usize| (k as f64 + third) / n as f64;
                    let (s, t) = (at(i), at(j));
                    sum += Complex64::cis(-(phases[0] + s * (phases[1] - phases[0]) + t * (phases[2] - phases[0])));
                };
                add(1.0 / 3.0);
                if j + 1 < n - i {
                    add(2.0 / 3.0);
                }
            }
        }
        sum / (n * n) as f64
    }

    #[test]
    fn mean_phasor_is_the_integral_over_the_triangle() {
        for phases in [
            [0.0, 0.0, 0.0],
            [0.3, 0.301, 0.299],
            [1.0, 1.03, 0.99],
            [2.0, 2.0, 5.0],
            [-4.0, 1.0, 3.0],
            [100.0, 103.0, 100.000_001],
            [7.0, -7.0, 0.0],
        ] {
            let (got, expected) = (mean_phasor(phases), mean_by_parts(phases, 600));
            assert!((got - expected).norm() < 2e-5, "{phases:?} {got} {expected}");
        }
        // Both sides of the switch to the series.
        let of = |apart: f64| mean_phasor([0.4, 0.4 + apart, 0.4 + 0.3 * apart]);
        assert!((of(0.02 - 1e-12) - of(0.02 + 1e-12)).norm() < 1e-9);
    }
}
