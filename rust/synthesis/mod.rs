//! Synthesis of the beat signal: delays and amplitudes of paths to samples of every chirp and channel.

pub mod beat;
pub mod block;
pub mod chirp;
pub mod coherence;
pub mod delay;
pub mod direct;
pub mod interval;
pub mod lanes;
pub mod low_rank;
pub mod nufft;
pub mod plan;
pub mod recurrence;
pub mod statistics;
