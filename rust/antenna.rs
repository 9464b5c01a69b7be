//! Antennas of the sensor: where they are, what they weigh directions with.

use glam::DVec3;

/// Gaussian beam `peak exp(-azimuth az^2 - elevation el^2)`; zero exponents: isotropic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pattern {
    /// Power gain on boresight.
    pub peak: f64,
    /// Exponent over azimuth [1/rad^2].
    pub azimuth: f64,
    /// Exponent over elevation [1/rad^2].
    pub elevation: f64,
}

impl Pattern {
    /// Power gain towards a direction of the sensor frame (any length).
    pub fn gain(&self, d: DVec3) -> f64 {
        if self.azimuth == 0.0 && self.elevation == 0.0 {
            return self.peak;
        }
        let (az, el) = (d.y.atan2(d.x), d.z.atan2(d.x.hypot(d.y)));
        self.peak * (-self.azimuth * az * az - self.elevation * el * el).exp()
    }

    /// At most ln(peak / gain) of directions `(1, u, v)` within ranges.
    pub fn least_decay(&self, u: [f64; 2], v: [f64; 2]) -> f64 {
        let least = |[low, high]: [f64; 2]| low.max(-high).max(0.0);
        let most = u[0].abs().max(u[1].abs());
        let (az, el) = (least(u).atan(), least(v).atan2(1.0_f64.hypot(most)));
        self.azimuth * az * az + self.elevation * el * el
    }
}

/// Transmitters and receivers; channel = tx * `num_rx` + rx.
#[derive(Clone, Debug)]
pub struct Array {
    /// Transmit antennas in the sensor frame [m].
    pub tx: Vec<DVec3>,
    /// Receive antennas in the sensor frame [m].
    pub rx: Vec<DVec3>,
    /// Pattern of every element.
    pub pattern: Pattern,
    /// Power of one transmitter [W].
    pub power: f64,
    /// Centre of the sampled band [Hz].
    pub frequency: f64,
    /// Unit vector along the field of every element, as far as it is transverse; none: antennas without a polarisation.
    pub polarization: Option<DVec3>,
}

/// One antenna's view of a point.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Distance [m].
    pub distance: f64,
    /// Unit vector from the antenna to the point.
    pub direction: DVec3,
    /// Power gain towards the point.
    pub gain: f64,
}

impl Array {
    /// Field that is sent to a direction and received from there, relative to the peak.
    pub fn relative_gain(&self, direction: DVec3) -> f64 {
        self.pattern.gain(direction) / self.pattern.peak
    }

    /// Number of TX-RX pairs.
    pub fn num_channels(&self) -> usize {
        self.tx.len() * self.rx.len()
    }

    /// Unit vectors from transmitter and receiver of a channel to a point of the sensor frame.
    pub fn directions(&self, channel: usize, point: DVec3) -> [DVec3; 2] {
        [self.tx[channel / self.rx.len()], self.rx[channel % self.rx.len()]].map(|antenna| {
            let offset = point - antenna;
            offset / offset.length()
        })
    }

    /// What transmitter and receiver of a channel see of a point of the sensor frame.
    pub fn pair(&self, channel: usize, point: DVec3) -> (Sight, Sight) {
        let sight = |antenna: DVec3| {
            let offset = point - antenna;
            let distance = offset.length();
            Sight {
                distance,
                direction: offset / distance,
                gain: self.pattern.gain(offset),
            }
        };
        (
            sight(self.tx[channel / self.rx.len()]),
            sight(self.rx[channel % self.rx.len()]),
        )
    }
}
