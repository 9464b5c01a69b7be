//! A ray tube: a ray, how its neighbours differ from it, and the field that it carries.

use glam::DVec3;
use num_complex::Complex64;

use super::field::{Field, Incidence};
use super::interaction::{Interaction, leaving};
use super::launch::Launch;
use crate::rays::scene::{NO_BODY, Snapshot};
use crate::rays::tree::Ray;

/// A ray tube where it meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Tube {
    /// Unit direction in which it arrives, or leaves once it is reflected.
    pub direction: DVec3,
    /// Where it arrives.
    pub interaction: Interaction,
    /// Length of its path [m]: from the antenna, or from the front of a plane wave through the origin.
    pub length: f64,
    /// Derivatives of the place by the plane coordinates of the cell, along the surface [m].
    pub edges: [DVec3; 2],
    /// Derivatives of the direction by them.
    pub turns: [DVec3; 2],
    /// Field relative to the one that was launched, but for its spreading.
    pub field: Field,
    /// Of what was launched, per unit of both plane coordinates: solid angle [sr], or section of a plane wave [m^2].
    pub spread: f64,
}

impl Tube {
    /// From an antenna to what the middle of a cell has hit, as seen from the centre of the array.
    pub fn launch(snapshot: &Snapshot, launch: &Launch, antenna: DVec3, polarization: Option<DVec3>) -> Option<Self> {
        // The patch of surface behind the cell.
        let [u, v] = launch.center;
        let w = (1.0 + u * u + v * v).sqrt();
        let ray = DVec3::new(1.0, u, v) / w;
        let (interaction, distance) = Interaction::new(snapshot, launch.body, launch.triangle, DVec3::ZERO, ray)?;
        let edges = [(DVec3::Y, u), (DVec3::Z, v)].map(|(axis, x)| {
            let turn = (axis - ray * (x / w)) / w; // of (1, u, v) / w
            land(distance * turn, ray, interaction.normal)
        });

        Self::onto(interaction, edges, antenna, polarization)
    }

    /// From an antenna to a patch of surface with these edges, if it sees the lit side.
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
            turns: edges.map(|edge| (edge - direction * direction.dot(edge)) / length),
            field: Field::launch(polarization, direction),
            spread: direction.dot(edges[0].cross(edges[1])).abs() / (length * length),
        })
    }

    /// Of a plane wave in a unit direction, from a point in front of everything to what the ray from there hits; plane
    /// coordinates count along `axes`.
    pub fn plane_wave(
        snapshot: &Snapshot,
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
        let hit = snapshot.cast(&ray);
        if hit.body == NO_BODY {
            return None;
        }
        let (interaction, _) = Interaction::new(snapshot, hit.body, hit.triangle, origin, direction)?;
        Some(Self {
            direction,
            interaction,
            length: direction.dot(interaction.point),
            edges: axes.map(|axis| land(axis, direction, interaction.normal)),
            turns: [DVec3::ZERO; 2],
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

    /// Its section where it arrives, over that between plane mirrors; it comes from an antenna.
    pub fn widening(&self) -> f64 {
        self.section() / (self.spread * self.length * self.length)
    }

    /// Widening of a tube from an antenna that goes back to the first of the places.
    pub fn widening_back(interactions: &[Interaction], antenna: DVec3) -> Option<f64> {
        let (last, others) = interactions.split_last()?;
        let mut tube = Self::onto(*last, last.normal.any_orthonormal_pair().into(), antenna, None)?;
        for interaction in others.iter().rev() {
            tube.reflect([Complex64::ONE; 2]);
            tube.arrive(*interaction, tube.interaction.point.distance(interaction.point));
        }
        Some(tube.widening())
    }

    /// Turn into the mirror's direction; the surface has the coefficients `r_TE` and `r_TM`.
    pub fn reflect(&mut self, coefficients: [Complex64; 2]) {
        let (n, k) = (self.interaction.normal, self.direction);
        let incidence = self.incidence(coefficients);
        self.field = self.field.reflect(&incidence);
        self.direction = incidence.reflected();
        for i in 0..2 {
            // Of k - 2 (n.k) n.
            let (turn, bend) = (self.turns[i], self.interaction.bend * self.edges[i]);
            self.turns[i] = turn - 2.0 * ((n.dot(turn) + bend.dot(k)) * n + n.dot(k) * bend);
        }
    }

    /// Go on to the next surface. Returns whether there is one.
    pub fn advance(&mut self, snapshot: &Snapshot) -> bool {
        if self.interaction.face.dot(self.direction) <= 0.0 {
            return false;
        }
        // It starts before the facet, the length counts from the curved surface.
        let origin = self.interaction.before;
        let hit = snapshot.cast(&Ray {
            origin,
            direction: self.direction,
            start: 0.0,
        });
        if hit.body == NO_BODY {
            return false;
        }
        let Some((mut interaction, distance)) =
            Interaction::new(snapshot, hit.body, hit.triangle, self.interaction.point, self.direction)
        else {
            return false;
        };
        if distance < 2.0 * leaving(origin) {
            interaction.before = origin; // of both surfaces, which touch
        }

        self.arrive(interaction, distance);
        true
    }

    /// Go on to a place at a distance [m].
    fn arrive(&mut self, interaction: Interaction, distance: f64) {
        // Every focal line on the way puts the wave a quarter of a turn ahead.
        let caustics = self.caustics(distance);
        self.field = self.field.times(Complex64::I.powu(caustics));
        for i in 0..2 {
            self.edges[i] = land(
                self.edges[i] + distance * self.turns[i],
                self.direction,
                interaction.normal,
            );
        }
        self.length += distance;
        self.interaction = interaction;
    }

    /// What the surface sends in a unit direction, see [`Field::radiate`].
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

    /// How often the section of the reflected tube vanishes within a distance [m].
    fn caustics(&self, distance: f64) -> u32 {
        let ([p, q], [d, e]) = (self.edges, self.turns);
        let section = |a: DVec3, b: DVec3| self.direction.dot(a.cross(b));
        // a + b t + c t^2; its roots are real but for rounding, and where normals that are interpolated have a curl.
        let (a, b, c) = (section(p, q), section(p, e) + section(d, q), section(d, e));
        let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
        let sum = -0.5 * (b + root.copysign(b));
        let roots = [sum / c, a / sum];
        roots.iter().filter(|t| **t > 0.0 && **t < distance).count() as u32
    }

    /// Derivatives of half the path by the plane coordinates of the image [m], on to an antenna in a direction: along the edges
    /// of the footprint, of the tube and of the way to the antenna.
    pub fn slope(&self, direction: DVec3) -> [f64; 2] {
        self.edges.map(|edge| 0.5 * (self.direction - direction).dot(edge))
    }
}

/// Where a displacement comes to lie that is carried along a direction onto a plane with a normal.
fn land(displacement: DVec3, direction: DVec3, normal: DVec3) -> DVec3 {
    displacement - direction * (normal.dot(displacement) / normal.dot(direction))
}
