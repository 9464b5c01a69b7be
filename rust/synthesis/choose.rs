//! The rule that chooses an engine, and its constants: times on one thread [s], fitted to the groups of
//! `benches/beat.rs` that are named beside them; of use for comparison only.

use crate::synthesis::chirp::Waveform;
use crate::synthesis::source::PathGroup;

/// Direct sum of a path in a sample (`beat/paths/direct`).
const DIRECT: f64 = 5e-9;

/// Chirp-wise NUFFT: tables, a path, a moving path in a group of 16 chirps, a cell of a group (`beat/take_over/chirp`).
const CHIRP: [f64; 4] = [10e-6, 50e-9, 24e-9, 25e-9];

/// Its times in double precision relative to single precision.
const DOUBLE: f64 = 5.0;

/// Least tolerance of its single precision.
const SINGLE: f64 = 5e-5;

/// Range-Doppler NUFFT: planning, a chirp of a channel, a pair of a chirp and one that sets the number of velocity rows,
/// a path (`beat/take_over/doppler`).
const DOPPLER: [f64; 4] = [50e-6, 2.5e-6, 10.7e-9, 14e-9];

/// Its times for chirps and for paths, over those: down to a tolerance with several strengths or fine grids in single
/// precision, and in double precision.
const DOPPLER_LEVELS: [(f64, [f64; 2]); 3] = [(2e-6, [1.0, 1.0]), (1e-6, [2.0, 2.5]), (0.0, [4.5, 12.0])];

/// Least tolerance of the NUFFTs.
const LEAST: f64 = 2e-12;

/// Methods that a caller may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The fastest engine.
    Auto,
    /// The oracle.
    Direct,
    /// The faster NUFFT that takes the paths.
    Grid,
}

/// Engines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Direct sum.
    Direct,
    /// One range grid per chirp, for any motion.
    Chirp,
    /// One range-velocity grid, for constant rates.
    Doppler,
}

/// Fastest engine of a method for some paths and a tolerance.
pub fn choose(waveform: &Waveform, groups: &[PathGroup], tolerance: f64, method: Method) -> Engine {
    let shapes = || groups.iter().map(|group| group.source.shape());
    if method == Method::Direct || tolerance < LEAST || !shapes().all(|shape| shape.is_smooth(waveform)) {
        return Engine::Direct;
    }
    let (num_chirps, num_samples) = (waveform.chirp_times.len() as f64, waveform.num_samples as f64);
    let (mut all, mut moving, mut channels) = (0.0, 0.0, 0.0);
    for shape in shapes() {
        channels = shape.channels as f64;
        all += channels * shape.paths as f64;
        if !shape.is_static() {
            moving += channels * shape.paths as f64;
        }
    }
    let direct = DIRECT * num_samples * (all - moving + moving * num_chirps);
    let [tables, path, spread, cell] = CHIRP;
    let lanes = if tolerance < SINGLE { DOUBLE } else { 1.0 };
    let grids = (num_chirps / 16.0).ceil();
    let chirp = tables + lanes * (path * all + grids * (spread * moving + cell * channels * 2.0 * num_samples));
    let [tables, chirp_time, pair, path] = DOPPLER;
    let level = DOPPLER_LEVELS.into_iter().find(|(least, _)| tolerance >= *least);
    let [per_chirp, per_path] = level.map_or([1.0; 2], |(_, times)| times);
    let is_constant =
        shapes().all(|shape| shape.has_constant_rates()) && groups.iter().all(|g| g.frequency_exponent == 0);
    let doppler = if is_constant {
        let num_slow = if moving > 0.0 { channels } else { 0.0 };
        let slow = num_slow * num_chirps * (chirp_time + pair * num_chirps);
        tables + per_path * path * all + per_chirp * slow
    } else {
        f64::INFINITY
    };
    if method == Method::Auto && direct < chirp.min(doppler) {
        Engine::Direct
    } else if doppler < chirp {
        Engine::Doppler
    } else {
        Engine::Chirp
    }
}
