//! Batches of records: all that the sum needs of the paths of a channel in every block of chirps.

use super::errors::Errors;
use super::number::{FEWEST_TURNS, Head, MAX_AMPLITUDES, MAX_LANES, MAX_TURNS, Number, PathRecord, Static};

/// Some paths of a channel.
#[derive(Clone, Debug)]
pub struct Batch<T: Number> {
    /// Moving paths of every block; an amplitude whose argument changes takes two records.
    pub blocks: Vec<Vec<T::Record>>,
    /// Static paths.
    pub statics: Vec<Static<T>>,
    /// Errors of these paths.
    pub errors: Errors,
}

/// Numbers of as many paths as a vector has lanes.
pub struct Numbers<T> {
    /// See [`Head`].
    pub phase: [T; MAX_LANES],
    pub offset: [T; MAX_LANES],
    pub carrier_offset: [T; MAX_LANES],
    pub cell: [T; MAX_LANES],
    /// Number of cells less one.
    pub mask: u32,
    /// Bit masks of the paths for which each coefficient of the phase counts.
    pub counts: [u32; MAX_TURNS],
    /// Number of coefficients of amplitudes.
    pub num_amplitudes: usize,
    pub turns: [[T; MAX_LANES]; MAX_TURNS],
    /// Amplitudes in phase with the first coefficient, and in quadrature.
    pub in_phase: [[T; MAX_LANES]; MAX_AMPLITUDES],
    pub quadrature: [[T; MAX_LANES]; MAX_AMPLITUDES],
    /// Bit mask of the paths whose quadrature counts.
    pub has_quadrature: u32,
}

impl<T: Number> Numbers<T> {
    /// Memory for paths on a grid of `mask + 1` cells.
    #[cfg_attr(optimised, inline(always))]
    pub fn new(mask: u32, num_amplitudes: usize) -> Self {
        let none = [T::zero(); MAX_LANES];
        Self {
            phase: none,
            offset: none,
            carrier_offset: none,
            cell: none,
            mask,
            counts: [0; MAX_TURNS],
            num_amplitudes: num_amplitudes.min(T::NUM_AMPLITUDES),
            turns: [none; MAX_TURNS],
            in_phase: [none; MAX_AMPLITUDES],
            quadrature: [none; MAX_AMPLITUDES],
            has_quadrature: 0,
        }
    }

    #[cfg_attr(optimised, inline(always))]
    fn cell(&self, lane: usize) -> u32 {
        (self.cell[lane].wide() as i32).cast_unsigned() & self.mask
    }

    /// Add one static path.
    #[cfg_attr(optimised, inline(always))]
    pub fn add_static(&self, lane: usize, to: &mut Vec<Static<T>>) {
        to.push(Static {
            phase: self.phase[lane],
            offset: self.offset[lane],
            cell: self.cell(lane),
            amplitude: self.in_phase[0][lane],
        });
    }

    /// Add one moving path.
    #[cfg_attr(optimised, inline(always))]
    pub fn add_moving(&self, lane: usize, to: &mut Vec<T::Record>) {
        let mut degree = FEWEST_TURNS as u32;
        for k in FEWEST_TURNS..T::NUM_TURNS {
            degree += self.counts[k] >> lane & 1;
        }
        let mut head = Head {
            phase: self.phase[lane],
            offset: self.offset[lane],
            carrier_offset: self.carrier_offset[lane],
            cell: self.cell(lane),
            degrees: [degree as u16, self.num_amplitudes as u16],
        };
        to.push(T::Record::new(head, &self.turns, &self.in_phase, lane));
        if self.has_quadrature >> lane & 1 == 1 {
            head.phase = head.phase + T::of(0.25);
            to.push(T::Record::new(head, &self.turns, &self.quadrature, lane));
        }
    }
}
