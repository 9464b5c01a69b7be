//! Synthesis of the beat signal: delays and amplitudes of paths to samples of every chirp and channel.

pub mod arrays;
pub mod beat_signal;
pub mod chirp;
pub mod chirp_nufft;
pub mod choose;
pub mod chunk;
pub mod coherence;
pub mod delay;
pub mod direct;
pub mod doppler_nufft;
pub mod report;
pub mod source;

#[cfg(test)]
mod tests;
