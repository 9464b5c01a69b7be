//! Ray tubes: a ray, the derivatives of its neighbours, and the field along it.

use glam::DVec3;
use num_complex::Complex64;

use super::field::{Field, Incidence};
use super::interaction::{Interaction, ray_epsilon};
use super::launch::Launch;
use crate::rays::scene::{NO_BODY, PosedScene};
use crate::rays::watertight::Ray;

/// A ray tube where it meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Tube {
    /// Unit direction of arrival, or of departure after the reflection.
    pub direction: DVec3,
    /// Interaction with the surface of arrival.
    pub interaction: Interaction,
    /// Length of the path [m]: from the antenna, or from the front of a plane wave through the origin.
    pub length: f64,
    /// Derivatives of the position by the plane coordinates of the cell, along the surface [m].
    pub edges: [DVec3; 2],
    /// Derivatives of the direction by the plane coordinates of the cell.
    pub direction_slopes: [DVec3; 2],
    /// Field relative to the launched field, without spreading.
    pub field: Field,
    /// Size at launch per unit of both plane coordinates: solid angle [sr], or section of a plane wave [m^2].
    pub spread: f64,
}

impl Tube {
    /// Tube from an antenna to the hit of the centre of a cell, which was cast from the centre of the array.
    pub fn launch(scene: &PosedScene, launch: &Launch, antenna: DVec3, polarization: Option<DVec3>) -> Option<Self> {
        // The patch of surface behind the cell.
        let [u, v] = launch.center;
        let w = (1.0 + u * u + v * v).sqrt();
        let ray = launch.rotation * (DVec3::new(1.0, u, v) / w);
        let (interaction, distance) = Interaction::new(scene, launch.body, launch.triangle, DVec3::ZERO, ray)?;
        let edges = [(launch.rotation.y_axis, u), (launch.rotation.z_axis, v)].map(|(axis, x)| {
            let slope = (axis - ray * (x / w)) / w; // of (1, u, v) / w
            project(distance * slope, ray, interaction.normal)
        });

        Self::onto(interaction, edges, antenna, polarization)
    }

    /// Tube from an antenna to a patch of surface with these edges. None where the patch faces away.
    fn onto(interaction: Interaction, edges: [DVec3; 2], antenna: DVec3, polarization: Option<DVec3>) -> Option<Self> {
        let offset = interaction.point - antenna;
        let length = offset.length();
        let direction = offset / length;
        let is_lit = interaction.normal.dot(offset) < 0.0 && interaction.face.dot(offset) < 0.0;
        is_lit.then(|| Self {
            direction,
            interaction,
            length,
            edges,
            direction_slopes: edges.map(|edge| (edge - direction * direction.dot(edge)) / length),
            field: Field::launch(polarization, direction),
            spread: direction.dot(edges[0].cross(edges[1])).abs() / (length * length),
        })
    }

    /// Tube of a plane wave in a unit direction, from a point in front of the scene to the hit of the ray; plane
    /// coordinates are lengths along `axes` [m].
    pub fn plane_wave(
        scene: &PosedScene,
        origin: DVec3,
        direction: DVec3,
        axes: [DVec3; 2],
        polarization: Option<DVec3>,
    ) -> Option<Self> {
        let ray = Ray {
            origin,
            direction,
            start: 0.0,
        };
        let hit = scene.cast(&ray);
        if hit.body == NO_BODY {
            return None;
        }
        let (interaction, _) = Interaction::new(scene, hit.body, hit.triangle, origin, direction)?;
        Some(Self {
            direction,
            interaction,
            length: direction.dot(interaction.point),
            edges: axes.map(|axis| project(axis, direction, interaction.normal)),
            direction_slopes: [DVec3::ZERO; 2],
            field: Field::launch(polarization, direction),
            spread: axes[0].cross(axes[1]).length(),
        })
    }

    /// Cosine of the angle of incidence.
    pub fn cosine(&self) -> f64 {
        -self.interaction.normal.dot(self.direction)
    }

    /// Area across the tube per unit of both plane coordinates [m^2].
    pub fn section(&self) -> f64 {
        self.direction.dot(self.edges[0].cross(self.edges[1])).abs()
    }

    /// Spreading factor: ratio of the section on arrival to the section between plane mirrors, for a tube from an antenna.
    pub fn spreading(&self) -> f64 {
        self.section() / (self.spread * self.length * self.length)
    }

    /// Spreading factor of a tube from an antenna in the opposite direction, to the first of the interactions.
    pub fn reverse_spreading(interactions: &[Interaction], antenna: DVec3) -> Option<f64> {
        let (last, others) = interactions.split_last()?;
        let mut tube = Self::onto(*last, last.normal.any_orthonormal_pair().into(), antenna, None)?;
        for interaction in others.iter().rev() {
            tube.reflect([Complex64::ONE; 2]);
            tube.arrive(*interaction, tube.interaction.point.distance(interaction.point));
        }
        Some(tube.spreading())
    }

    /// Reflect in the specular direction; `coefficients` are `r_TE` and `r_TM`.
    pub fn reflect(&mut self, coefficients: [Complex64; 2]) {
        let (n, k) = (self.interaction.normal, self.direction);
        let incidence = self.incidence(coefficients);
        self.field = self.field.reflect(&incidence);
        self.direction = incidence.reflected();
        for i in 0..2 {
            // Derivatives of k - 2 (n.k) n.
            let (dk, dn) = (
                self.direction_slopes[i],
                self.interaction.shape_operator * self.edges[i],
            );
            self.direction_slopes[i] = dk - 2.0 * ((n.dot(dk) + dn.dot(k)) * n + n.dot(k) * dn);
        }
    }

    /// Advance to the next surface; false if there is none.
    pub fn advance(&mut self, scene: &PosedScene) -> bool {
        if self.interaction.face.dot(self.direction) <= 0.0 {
            return false;
        }
        // The ray starts before the triangle, the length counts from the curved surface.
        let origin = self.interaction.offset_origin;
        let hit = scene.cast(&Ray {
            origin,
            direction: self.direction,
            start: 0.0,
        });
        if hit.body == NO_BODY {
            return false;
        }
        let Some((mut interaction, distance)) =
            Interaction::new(scene, hit.body, hit.triangle, self.interaction.point, self.direction)
        else {
            return false;
        };
        if distance < 2.0 * ray_epsilon(origin) {
            interaction.offset_origin = origin; // of both surfaces, which touch
        }

        self.arrive(interaction, distance);
        true
    }

    /// Advance to an interaction at a distance [m].
    fn arrive(&mut self, interaction: Interaction, distance: f64) {
        // Every focal line passed advances the phase by a quarter of a turn.
        let caustics = self.caustics(distance);
        self.field = self.field.times(Complex64::I.powu(caustics));
        for i in 0..2 {
            self.edges[i] = project(
                self.edges[i] + distance * self.direction_slopes[i],
                self.direction,
                interaction.normal,
            );
        }
        self.length += distance;
        self.interaction = interaction;
    }

    /// Field radiated by the surface in a unit direction, see [`Field::radiate`].
    pub fn radiate(&self, coefficients: [Complex64; 2], direction: DVec3, received: Option<DVec3>) -> Complex64 {
        self.field.radiate(&self.incidence(coefficients), direction, received)
    }

    fn incidence(&self, coefficients: [Complex64; 2]) -> Incidence {
        Incidence {
            direction: self.direction,
            normal: self.interaction.normal,
            coefficients,
        }
    }

    /// Number of focal lines of the reflected tube within a distance [m]: zeros of the section.
    fn caustics(&self, distance: f64) -> u32 {
        let ([p, q], [d, e]) = (self.edges, self.direction_slopes);
        let section = |a: DVec3, b: DVec3| self.direction.dot(a.cross(b));
        // a + b t + c t^2; its roots are real but for rounding, and where normals that are interpolated have a curl.
        let (a, b, c) = (section(p, q), section(p, e) + section(d, q), section(d, e));
        let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
        let sum = -0.5 * (b + root.copysign(b));
        let roots = [sum / c, a / sum];
        roots.iter().filter(|t| **t > 0.0 && **t < distance).count() as u32
    }

    /// Derivatives of half the path length by the plane coordinates of the image [m], over the footprint and on to an
    /// antenna in a unit direction.
    pub fn slope(&self, direction: DVec3) -> [f64; 2] {
        self.edges.map(|edge| 0.5 * (self.direction - direction).dot(edge))
    }
}

/// Project a displacement along a direction onto a plane with a normal.
fn project(displacement: DVec3, direction: DVec3, normal: DVec3) -> DVec3 {
    displacement - direction * (normal.dot(displacement) / normal.dot(direction))
}
