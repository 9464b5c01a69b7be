//! Directions of ray tubes: antennas where they start and end.

use glam::DVec3;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;

/// Direction of ray tubes between transmitters and receivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Tubes start at the transmitters and end at the receivers.
    Forward,
    /// Tubes start at the receivers and end at the transmitters.
    Backward,
}

/// Antennas of one kind.
#[derive(Clone, Copy, Debug)]
pub struct TubeEnds<'a> {
    positions: &'a [DVec3],
    patterns: &'a [Pattern],
}

impl<'a> TubeEnds<'a> {
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Position [m] and pattern of an antenna.
    pub fn get(&self, number: usize) -> (DVec3, &'a Pattern) {
        (self.positions[number], &self.patterns[number])
    }
}

/// Largest distance of an antenna from the middle of an array [m] whose tubes start and end in the middle: lengths of
/// paths over points of reflection are stationary, so that phases differ to second order, 0.01 rad at arm's length.
const SMALL_ARRAY: f64 = 0.01;

/// Antennas where ray tubes start and end: all antennas of an array, or, of a small one, the middle of its transmitters
/// and the middle of its receivers.
pub fn tube_antennas(array: &Array) -> Array {
    let all = || array.tx.iter().chain(&array.rx);
    if all().next().is_none() || all().any(|antenna| antenna.length() > SMALL_ARRAY) {
        return array.clone();
    }
    let middle = |antennas: &[DVec3]| vec![antennas.iter().sum::<DVec3>() / antennas.len() as f64];
    Array {
        tx: middle(&array.tx),
        rx: middle(&array.rx),
        tx_patterns: array.tx_patterns[..1].to_vec(),
        rx_patterns: array.rx_patterns[..1].to_vec(),
        ..array.clone()
    }
}

impl Direction {
    /// Directions that tubes are traced in: both, but only forward for a single antenna that transmits and receives,
    /// where both give the same paths.
    pub fn of(array: &Array) -> &'static [Self] {
        let is_one = array.tx.len() == 1 && array.tx == array.rx && array.tx_patterns == array.rx_patterns;
        if is_one {
            &[Self::Forward]
        } else {
            &[Self::Forward, Self::Backward]
        }
    }

    /// Antennas where tubes start, and antennas where tubes end.
    pub fn antennas(self, array: &Array) -> [TubeEnds<'_>; 2] {
        let transmitters = TubeEnds {
            positions: &array.tx,
            patterns: &array.tx_patterns,
        };
        let receivers = TubeEnds {
            positions: &array.rx,
            patterns: &array.rx_patterns,
        };
        self.ordered(transmitters, receivers)
    }

    /// Numbers of the antennas of a channel where tubes start and end.
    pub fn numbers(self, array: &Array, channel: usize) -> [usize; 2] {
        self.ordered(channel / array.rx.len(), channel % array.rx.len())
    }

    /// Channel of the antennas where a tube starts and ends.
    pub fn channel(self, array: &Array, start: usize, end: usize) -> usize {
        let [transmitter, receiver] = self.ordered(start, end);
        transmitter * array.rx.len() + receiver
    }

    /// Order a property of transmitters and one of receivers as start and end of tubes.
    fn ordered<T>(self, transmitter: T, receiver: T) -> [T; 2] {
        match self {
            Self::Forward => [transmitter, receiver],
            Self::Backward => [receiver, transmitter],
        }
    }
}
