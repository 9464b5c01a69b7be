//! Axis-aligned bounding boxes.

use glam::DVec3;

/// Axis-aligned box in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: DVec3,
    /// Largest coordinates.
    pub max: DVec3,
}

impl Bounds {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    /// The smallest box round some points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        let mut bounds = Self::EMPTY;
        for point in points {
            bounds.min = bounds.min.min(point);
            bounds.max = bounds.max.max(point);
        }
        bounds
    }

    /// The smallest box round a triangle.
    #[inline]
    pub fn of_triangle([a, b, c]: &[DVec3; 3]) -> Self {
        Self {
            min: a.min(*b).min(*c),
            max: a.max(*b).max(*c),
        }
    }

    /// The smallest box round both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The same box elsewhere.
    pub fn moved(&self, by: DVec3) -> Self {
        Self {
            min: self.min + by,
            max: self.max + by,
        }
    }

    /// Halfway between; the origin for the box that holds nothing.
    pub fn middle(&self) -> DVec3 {
        let middle = 0.5 * (self.min + self.max);
        if middle.is_finite() { middle } else { DVec3::ZERO }
    }

    /// The eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    self.min[axis]
                } else {
                    self.max[axis]
                }
            };
            DVec3::new(pick(0), pick(1), pick(2))
        })
    }
}
