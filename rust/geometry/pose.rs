//! Rigid poses relative to the sensor.

use std::ops::{Add, Mul, Sub};

use glam::{DMat3, DVec3};

/// Affine map of a body's coordinates to the sensor frame: `rotation * x + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Body axes in the sensor frame, as columns.
    pub rotation: DMat3,
    /// Body origin in the sensor frame [m].
    pub translation: DVec3,
}

impl Pose {
    /// Pose of a body at the sensor with aligned axes.
    pub const IDENTITY: Self = Self {
        rotation: DMat3::IDENTITY,
        translation: DVec3::ZERO,
    };

    /// Pose from the rows of a 3 x 4 matrix.
    pub fn from_rows(m: &[f64; 12]) -> Self {
        Self {
            rotation: DMat3::from_cols(
                DVec3::new(m[0], m[4], m[8]),
                DVec3::new(m[1], m[5], m[9]),
                DVec3::new(m[2], m[6], m[10]),
            ),
            translation: DVec3::new(m[3], m[7], m[11]),
        }
    }

    /// The pose in other axes at the sensor, by the rotation to them.
    pub fn turned(&self, rotation: &DMat3) -> Self {
        Self {
            rotation: *rotation * self.rotation,
            translation: *rotation * self.translation,
        }
    }

    /// Transform a point from body coordinates to the sensor frame.
    pub fn point(&self, position: DVec3) -> DVec3 {
        self.rotation * position + self.translation
    }

    /// Rotate a direction from body coordinates to the sensor frame.
    pub fn direction(&self, direction: DVec3) -> DVec3 {
        self.rotation * direction
    }

    /// Transform a point from the sensor frame to body coordinates.
    pub fn point_to_body(&self, position: DVec3) -> DVec3 {
        self.rotation.transpose() * (position - self.translation)
    }

    /// Rotate a direction from the sensor frame to body coordinates.
    pub fn direction_to_body(&self, direction: DVec3) -> DVec3 {
        self.rotation.transpose() * direction
    }
}

impl Add for Pose {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            rotation: self.rotation + other.rotation,
            translation: self.translation + other.translation,
        }
    }
}

impl Sub for Pose {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + other * -1.0
    }
}

impl Mul<f64> for Pose {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            rotation: self.rotation * factor,
            translation: self.translation * factor,
        }
    }
}
