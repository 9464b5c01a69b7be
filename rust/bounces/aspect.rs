//! Directions in which a body is seen.

use glam::DVec3;

/// Directions and polarisations of incidence and of reception.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aspect {
    /// Unit vectors from the body to the transmitter and to the receiver.
    pub directions: [DVec3; 2],
    /// Field vectors of both antennas, whose transverse part counts; none: antennas without a polarisation.
    pub polarizations: Option<[DVec3; 2]>,
}
