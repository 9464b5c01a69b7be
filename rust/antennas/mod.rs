//! Antennas: their places, patterns and polarisation, and the directions that they illuminate.

pub mod array;
pub mod beam;
pub mod gain_table;
pub mod pattern;
pub mod polarization;
