//! Which antennas ray tubes start from, and which they end at.

use glam::DVec3;

use crate::antennas::array::Array;
use crate::antennas::pattern::Pattern;

/// From the antennas of one kind to those of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the transmitters to the receivers.
    Forward,
    /// From the receivers to the transmitters.
    Backward,
}

/// Antennas of one kind.
#[derive(Clone, Copy, Debug)]
pub struct Antennas<'a> {
    positions: &'a [DVec3],
    patterns: &'a [Pattern],
}

impl<'a> Antennas<'a> {
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Place and pattern of one.
    pub fn get(&self, number: usize) -> (DVec3, &'a Pattern) {
        (self.positions[number], &self.patterns[number])
    }
}

impl Direction {
    /// Those that tubes go: both, but only one where one antenna sends and receives, which stands for the other.
    pub fn of(array: &Array) -> &'static [Self] {
        let is_one = array.tx.len() == 1 && array.tx == array.rx && array.tx_patterns == array.rx_patterns;
        if is_one {
            &[Self::Forward]
        } else {
            &[Self::Forward, Self::Backward]
        }
    }

    /// Antennas where tubes start, and those where they end.
    pub fn antennas(self, array: &Array) -> [Antennas<'_>; 2] {
        let transmitters = Antennas {
            positions: &array.tx,
            patterns: &array.tx_patterns,
        };
        let receivers = Antennas {
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

    /// What belongs to where tubes start, and to where they end.
    fn ordered<T>(self, transmitter: T, receiver: T) -> [T; 2] {
        match self {
            Self::Forward => [transmitter, receiver],
            Self::Backward => [receiver, transmitter],
        }
    }
}
