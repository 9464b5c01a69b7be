//! Antennas: positions, patterns and polarisation of an array, and the directions that it illuminates.

pub mod array;
pub mod beam;
pub mod gain_table;
pub mod pattern;
pub mod polarization;
pub mod response;
