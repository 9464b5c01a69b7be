//! Interval arithmetic.

/// A closed range of numbers; empty if `low > high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Smallest number.
    pub low: f64,
    /// Largest number.
    pub high: f64,
}

impl Interval {
    /// Empty interval.
    pub const EMPTY: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };
    /// Interval of zero alone.
    pub const ZERO: Self = Self { low: 0.0, high: 0.0 };

    /// Smallest interval that contains both.
    pub fn join(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// Interval of all products.
    pub fn times(self, other: Self) -> Self {
        let ends = [
            self.low * other.low,
            self.low * other.high,
            self.high * other.low,
            self.high * other.high,
        ];
        Self {
            low: ends.into_iter().fold(f64::INFINITY, f64::min),
            high: ends.into_iter().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// Interval multiplied by a number.
    pub fn scaled(self, factor: f64) -> Self {
        self.times(Self {
            low: factor,
            high: factor,
        })
    }

    /// Middle of the interval.
    pub fn middle(self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// Half of the length.
    pub fn half(self) -> f64 {
        0.5 * (self.high - self.low)
    }

    /// Largest absolute value.
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }
}
