//! Core of radarcore: triangles in, radar samples out.
//!
//! ```text
//! Mesh ── tree ──┐
//! poses ─────────┴─ Scene ── image tiles ── Hits ── scattering ── Paths ── beat signal
//! ```
//!
//! Images: `rays` (pixels and tiles), `trace` (bodies at their places and images of them), `surface` (triangles of one body),
//! `bvh` (trees), `walk` (ways through them), `bundle` (rays of a tile that search together), `leaf` (triangles in single
//! precision), `woop` (the exact test), `shown`, `shading` and `facet` (the curved surfaces that facets stand for). `samples`:
//! what a frame takes of a scene, `adaptive` cells (`parts`: what these must not miss) and `diffuse` points. `scatter` makes
//! paths of what they show (`material` and `polarization`: what comes back of a wave; `antenna` and `pattern`: what is sent
//! and received of it), which stays with its `facet` where a body deforms; `bounce` makes those of several reflections, and
//! far-field cross-sections. `near` tells how near bodies are, for directions that no antenna sees; `quality` what a mesh is
//! good for, with `echo`.
//!
//! The beat signal, in the order of its work: `delay` and `block` (series of delays in blocks of chirps), `survey` (bounds
//! on all paths), `plan` (what is done with them, by which `expansion` and `modes`), then `grid` (places, spreading with the `kernel`,
//! transforms), `lanes` (chirps side by side) or `direct`; `beat` runs it and sees to the tolerance. Kernels are written
//! once, with `simd` and `wide`, and compiled for every instruction set.
//!
//! Conventions, stated once and used everywhere:
//!
//! - SI units and radians; a name says so when it means something else (`gain_db`).
//! - Sensor frame: x forward (boresight), y left, z up. Poses map body coordinates to the sensor frame.
//! - The mixer forms TX times conj(RX): the phase `2 pi (f0 tau + S tau t - S tau^2 / 2)` grows with the
//!   delay. Range is at positive beat frequency and a receding body has positive velocity.
//! - Amplitudes are in sqrt(W): the squared magnitude is the received power.
//! - f32 bounds, f64 measures: boxes of the trees are f32, every distance, delay and phase is f64.
//! - Results do not depend on the number of threads: every sum has a fixed order.

pub mod antennas;
pub mod bounces;
pub mod constants;
pub mod error;
pub mod frame;
pub mod geometry;
pub mod numeric;
pub mod paths;
#[cfg(feature = "python")]
mod python;
pub mod rays;
pub mod scattering;
pub mod synthesis;

pub use error::{Error, Result};
