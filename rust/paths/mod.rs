//! Paths from a transmitter over scatterers to a receiver: delays and amplitudes at any time of a frame.

pub mod evaluate;
pub mod kinematics;
pub mod node_times;
pub mod scatterers;
mod sixteen;
