//! Hash to pseudorandom numbers: equal input gives an equal number on every machine.

/// One step of `SplitMix64`: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, OOPSLA 2014.
pub fn mix(state: u64) -> u64 {
    let z = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Random numbers for tests, one after the other.
#[cfg(test)]
pub struct Random(pub u64);

#[cfg(test)]
impl Random {
    /// Number from 0 to below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        self.0 = mix(self.0);
        (self.0 % end as u64) as usize
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = mix(self.0);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Point in the cube from -1 to 1.
    pub fn point(&mut self) -> glam::DVec3 {
        glam::DVec3::from_array([0; 3].map(|_| self.between(-1.0, 1.0)))
    }

    /// Unit vector.
    pub fn direction(&mut self) -> glam::DVec3 {
        loop {
            let point = self.point();
            if (0.01..1.0).contains(&point.length()) {
                return point.normalize();
            }
        }
    }

    pub fn rotation(&mut self) -> glam::DMat3 {
        glam::DMat3::from_axis_angle(self.direction(), self.between(-3.2, 3.2))
    }
}
