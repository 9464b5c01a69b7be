//! Antenna array of the sensor: positions and patterns, and gain towards a point.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use num_complex::Complex64;

use crate::antennas::pattern::{Pattern, Turned};
use crate::antennas::response::ReceiverResponse;
use crate::error::{Error, Result};

/// Transmitters and receivers; channel = tx * `num_rx` + rx.
#[derive(Clone, Debug)]
pub struct Array {
    /// Transmit antennas in the sensor frame [m].
    pub tx: Vec<DVec3>,
    /// Receive antennas in the sensor frame [m].
    pub rx: Vec<DVec3>,
    /// Patterns of the transmit antennas.
    pub tx_patterns: Vec<Pattern>,
    /// Patterns of the receive antennas.
    pub rx_patterns: Vec<Pattern>,
    /// Power of one transmitter [W].
    pub power: f64,
    /// Centre of the sampled band [Hz].
    pub frequency: f64,
    /// Unit vector along the field of every element, projected across the ray; none: antennas without a polarisation.
    pub polarization: Option<DVec3>,
    /// Gain of the receiver for what every transmit antenna sent; empty: one.
    pub responses: Vec<Arc<ReceiverResponse>>,
}

/// View of a point from one antenna.
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
    /// The array in other axes, by the rotation to them.
    pub fn turned(&self, rotation: &DMat3) -> Self {
        let all = |places: &[DVec3]| places.iter().map(|place| *rotation * *place).collect();
        let patterns = |patterns: &[Pattern]| {
            let turned = |pattern: &Pattern| {
                Pattern::Turned(Arc::new(Turned {
                    rotation: rotation.transpose(),
                    pattern: pattern.clone(),
                }))
            };
            patterns.iter().map(turned).collect()
        };
        Self {
            tx: all(&self.tx),
            rx: all(&self.rx),
            tx_patterns: patterns(&self.tx_patterns),
            rx_patterns: patterns(&self.rx_patterns),
            polarization: self.polarization.map(|field| *rotation * field),
            responses: self.responses.clone(),
            ..*self
        }
    }

    /// Two-way field gain in a direction `(1, u, v)`, relative to the peaks, of the pair with the most.
    pub fn relative_gain(&self, u: f64, v: f64) -> f64 {
        let least = |patterns: &[Pattern]| {
            let others = (0..patterns.len()).filter(|i| *i == 0 || !patterns[*i].is_same(&patterns[*i - 1]));
            let decays = others.map(|i| patterns[i].decay([u; 2], [v; 2])[0]);
            decays.fold(f64::INFINITY, f64::min)
        };
        (-0.5 * (least(&self.tx_patterns) + least(&self.rx_patterns))).exp()
    }

    /// Refuse other numbers of patterns than of antennas, and a frequency without a wavelength.
    pub fn check(&self) -> Result<()> {
        if !(self.frequency > 0.0 && self.frequency.is_finite()) {
            return Err(Error::value("frequency", "a positive frequency in Hz", self.frequency));
        }
        for (name, antennas, patterns) in [
            ("tx_patterns", &self.tx, &self.tx_patterns),
            ("rx_patterns", &self.rx, &self.rx_patterns),
        ] {
            if antennas.len() != patterns.len() {
                let expected = format!("{}, one per antenna", antennas.len());
                return Err(Error::value(name, expected, patterns.len()));
            }
        }
        if !self.responses.is_empty() && self.responses.len() != self.tx.len() {
            let expected = format!("none, or {}, one per transmit antenna", self.tx.len());
            return Err(Error::value("responses", expected, self.responses.len()));
        }
        Ok(())
    }

    /// Gain of the receiver for what the transmitter of a channel sent; none: one.
    #[inline]
    pub fn response(&self, channel: usize) -> Option<&ReceiverResponse> {
        self.responses.get(channel / self.rx.len()).map(Arc::as_ref)
    }

    /// An amplitude behind the receiver, of a path of a length [m].
    #[inline]
    pub fn received(&self, channel: usize, amplitude: Complex64, length: f64) -> Complex64 {
        match self.response(channel) {
            Some(response) => amplitude * response.gain(length),
            None => amplitude,
        }
    }

    /// Number of TX-RX pairs.
    pub fn num_channels(&self) -> usize {
        self.tx.len() * self.rx.len()
    }

    /// Unit vectors from transmitter and receiver of a channel to a point of the sensor frame.
    pub fn directions(&self, channel: usize, point: DVec3) -> [DVec3; 2] {
        self.antennas(channel).map(|antenna| {
            let offset = point - antenna;
            offset / offset.length()
        })
    }

    /// Positions of the transmitter and the receiver of a channel [m].
    pub fn antennas(&self, channel: usize) -> [DVec3; 2] {
        [self.tx[channel / self.rx.len()], self.rx[channel % self.rx.len()]]
    }

    /// Views of a point of the sensor frame from transmitter and receiver of a channel.
    pub fn pair(&self, channel: usize, point: DVec3) -> (Sight, Sight) {
        let sight = |antenna: DVec3, pattern: &Pattern| {
            let offset = point - antenna;
            let distance = offset.length();
            Sight {
                distance,
                direction: offset / distance,
                gain: pattern.gain(offset),
            }
        };
        let (tx, rx) = (channel / self.rx.len(), channel % self.rx.len());
        (
            sight(self.tx[tx], &self.tx_patterns[tx]),
            sight(self.rx[rx], &self.rx_patterns[rx]),
        )
    }
}

/// Point of a plane that reflects from one antenna to another, both on one side of it [m].
pub fn specular_point(antennas: [DVec3; 2], on_plane: DVec3, normal: DVec3) -> DVec3 {
    let [t, r] = antennas.map(|antenna| normal.dot(antenna - on_plane));
    let [below_t, below_r] = [antennas[0] - t * normal, antennas[1] - r * normal];
    (r * below_t + t * below_r) / (t + r)
}

#[cfg(test)]
impl Array {
    /// Isotropic antennas of 1 W at 60 GHz, without a polarisation.
    pub fn isotropic(tx: &[DVec3], rx: &[DVec3]) -> Self {
        let isotropic = Pattern::Gaussian {
            peak: 1.0,
            azimuth: 0.0,
            elevation: 0.0,
        };
        Self {
            tx: tx.to_vec(),
            rx: rx.to_vec(),
            tx_patterns: vec![isotropic.clone(); tx.len()],
            rx_patterns: vec![isotropic; rx.len()],
            power: 1.0,
            frequency: 60e9,
            polarization: None,
            responses: Vec::new(),
        }
    }
}
