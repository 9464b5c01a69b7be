//! Core of radarcore: triangles in, samples of an FMCW millimetre-wave radar out.
//!
//! ```text
//! mesh ── geometry ── rays ──┬── scattering ──┬── paths ── synthesis ── samples
//!          pose     antennas ┘   bounces ─────┘
//! ```
//!
//! `frame` is the pipeline on a screen: poses in, samples, truth and counts out, one line a stage. The stages, in the order
//! of the work, have one folder each:
//!
//! - `numeric`: vectors for every instruction set, exact phase, Chebyshev series, random numbers, threads.
//! - `geometry`: poses, boxes, triangles, normals of the smooth surface that a mesh stands for, OBJ files.
//! - `antennas`: places, patterns and polarisation of an array, and the beam that it illuminates.
//! - `rays`: image of a posed scene, by traversal of a bounding-volume tree and a watertight test of triangles.
//! - `scattering`: hits to scatterers, by physical optics for the specular part and Lambert's law for the diffuse one.
//! - `bounces`: paths of several reflections, by shooting and bouncing rays.
//! - `paths`: delay and amplitude of every path at every time of a frame, as bodies move and deform.
//! - `synthesis`: sum over all paths, to a tolerance: direct, by chirp-wise NUFFT, or by range-Doppler NUFFT.
//! - `processing`: peaks of maps, and tones in the cells about them: often called on small arrays.
//! - `python`: boundary, one file per stage.
//!
//! Folders import downwards only, and files of a folder without circles; `tests/layers.rs` has the table and holds it.
//!
//! # Conventions
//!
//! - SI units and radians; a name says so when it means something else (`gain_db`).
//! - Sensor frame: x forward (boresight), y left, z up. Poses map body coordinates to the sensor frame.
//! - The mixer forms TX times conj(RX): the phase `2 pi (f0 tau + S tau t - S tau^2 / 2)` grows with the
//!   delay. Range is at positive beat frequency and a receding body has positive velocity.
//! - Amplitudes are in sqrt(W): the squared magnitude is the received power.
//! - f32 bounds, f64 measures: boxes of the trees are f32, every distance, delay and phase is f64.
//! - Results do not depend on the number of threads: every sum has a fixed order.
//! - Kernels take the fastest instruction set of the processor. The environment variable `RADARCORE_SIMD`
//!   names the highest: `baseline`, `avx2` or `avx512`.
//! - Threads need 512 kB of stack, also without optimisation.
//!
//! # Glossary
//!
//! | | |
//! |---|---|
//! | beat signal | product of the sent and the received wave, sampled; its frequency grows with range |
//! | channel | pair of a transmitter and a receiver |
//! | chirp, frame | one linear ramp of frequency; ramps that are processed together |
//! | delay | two-way travel time of a wave along a path |
//! | hit | nearest triangle along a ray, with distance and cosine of incidence |
//! | node times | Chebyshev times of a frame at which paths are evaluated; polynomials lie between |
//! | NUFFT | non-uniform FFT: points spread on a grid by a kernel, FFT, division by the kernel's transform |
//! | occluded | in sight of the radar but for a body in front |
//! | packet | 16 rays of an 8 x 8 tile that traverse a tree together |
//! | path | way of a wave from a transmitter over one or more surfaces to a receiver |
//! | physical optics | currents on a lit surface as if it were an infinite plane, and what they radiate |
//! | scatterer | material point with the amplitude that it returns to every channel |
//! | shooting and bouncing rays | ray tubes by geometrical optics, radiating at their last surface by physical optics |
//! | specular, diffuse | reflected coherently as from a mirror; scattered into all directions with random phase |
//! | traversal | walk through a tree of boxes, near children first |
//! | triangle block | up to 16 triangles of a leaf, tested at once in single precision |
//! | watertight test | ray against triangle without gaps along shared edges, in double precision |
//!
//! # From a mesh to samples
//!
//! A metal plate of 3 cm, 2 m in front of one antenna:
//!
//! ```
//! use std::sync::Arc;
//!
//! use glam::{DMat3, DVec3};
//! use radarcore::*;
//!
//! # fn main() -> Result<()> {
//! let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| 0.015 * DVec3::new(0.0, y, z));
//! let plate = Arc::new(Surface::new(&corners, &[[0, 2, 1], [0, 3, 2]], ShadingMode::Flat, &Cancel::default())?);
//! let scene = Scene {
//!     surfaces: vec![plate],
//!     deforming: vec![],
//!     rcs: vec![],
//!     body_numbers: vec![0],
//!     point_numbers: vec![],
//! };
//! let isotropic = Pattern::Gaussian { peak: 1.0, azimuth: 0.0, elevation: 0.0 };
//! let antennas = Array {
//!     tx: vec![DVec3::ZERO],
//!     rx: vec![DVec3::ZERO],
//!     tx_patterns: vec![isotropic.clone()],
//!     rx_patterns: vec![isotropic],
//!     power: 1e-3,
//!     frequency: 60e9,
//!     polarization: None,
//!     responses: Vec::new(),
//! };
//! let waveform = Waveform {
//!     start_frequency: 59.5e9,
//!     slope: 1e9 / 64e-6,
//!     sample_rate: 2e6,
//!     adc_delay: 0.0,
//!     num_samples: 128,
//!     chirp_times: (0..16).map(|chirp| f64::from(chirp) * 400e-6).collect(),
//! };
//! let plane = ImagePlane::centered(64, 64, 0.01, 0.01);
//! let settings = Settings {
//!     rotations: vec![DMat3::IDENTITY],
//!     rays: RaySampling { planes: vec![plane], sampling: Sampling::Footprint, refinement: None },
//!     tubes: vec![plane],
//!     image: plane,
//!     gain_floor: None,
//!     debug: Switches::default(),
//!     limits: Limits { max_bounces: 1, floor: 1e-3 },
//!     retrace: f64::INFINITY,
//!     seed: 0,
//!     tolerance: 1e-3,
//!     method: Method::Auto,
//! };
//! let model = Model::new(Source::Scene(scene), vec![CONDUCTOR], antennas, waveform, DVec3::ZERO, settings)?;
//!
//! // Nothing moves: poses at one time.
//! let world = World {
//!     sensor: vec![Pose::IDENTITY],
//!     poses: vec![Pose { translation: DVec3::new(2.0, 0.0, 0.0), ..Pose::IDENTITY }],
//!     points: vec![],
//!     vertices: vec![],
//! };
//! let answer = simulate(&model, &world, None, &mut Memory::default(), &Cancel::default())?;
//! let Answer::Done(frame) = answer else { unreachable!("one time does for what stands still") };
//! let Samples::Single(samples) = frame.cube else { unreachable!("asked for single precision") };
//! assert_eq!(samples.len(), 16 * 128);
//!
//! // The radar equation with the cross-section 4 pi A^2 / lambda^2 of a plate: P (A / (4 pi R^2))^2.
//! let power = samples.iter().map(|sample| f64::from(sample.norm_sqr())).sum::<f64>() / samples.len() as f64;
//! let expected = 1e-3 * (9e-4 / (4.0 * std::f64::consts::PI * 4.0)).powi(2);
//! assert!((power / expected - 1.0).abs() < 0.05, "{power} {expected}");
//! # Ok(())
//! # }
//! ```

#![cfg_attr(
    not(feature = "python"),
    expect(dead_code, reason = "the boundary uses more than the names below")
)]

mod antennas;
mod bounces;
mod cancel;
mod constants;
mod error;
mod frame;
mod geometry;
mod numeric;
mod paths;
mod processing;
#[cfg(feature = "python")]
mod python;
mod rays;
mod scattering;
mod synthesis;

pub use antennas::array::Array;
pub use antennas::pattern::Pattern;
pub use bounces::Limits;
pub use cancel::Cancel;
pub use error::{Error, Result};
pub use frame::{Answer, Memory, Model, RaySampling, Scene, Settings, Source, Switches, simulate};
pub use geometry::pose::Pose;
pub use paths::kinematics::World;
pub use rays::camera::ImagePlane;
pub use rays::surface::{ShadingMode, Surface};
pub use scattering::material::CONDUCTOR;
pub use scattering::refinement::{Refinement, Sampling};
pub use synthesis::chirp::Waveform;
pub use synthesis::choose::Method;
pub use synthesis::report::Samples;

/// Stages by themselves, for benches and tests.
#[doc(hidden)]
pub mod stages {
    pub use crate::bounces::{Aspect, cross_sections};
    pub use crate::frame::{image, paths};
    pub use crate::geometry::aabb::Bounds;
    pub use crate::numeric::normal::add_normal;
    pub use crate::numeric::simd::Level;
    pub use crate::paths::kinematics::TimeSeries;
    pub use crate::rays::hits::Cast;
    pub use crate::rays::scene::PosedScene;
    pub use crate::rays::tree::{Tree, WIDTH};
    pub use crate::rays::watertight::Ray;
    pub use crate::scattering::material::{Material, SurfaceResponse};
    pub use crate::synthesis::beat_signal::beat_signal;
    pub use crate::synthesis::delay::{Basis, PathSeries};
    pub use crate::synthesis::report::{Known, Options};
}
