//! Times of the steps of a sum on one thread [s], by which the cheapest is chosen.
//!
//! Fitted to the groups of `benches/beat.rs` that are named beside them; of use for comparison only.

/// Recurrence sum: planning, a path, and a path in a sample in double precision, which takes twice as long as in
/// single precision (`beat/take_over/recurrence`, `beat/paths/direct_f64`).
const RECURRENCE: [f64; 3] = [0.03e-3, 110e-9, 0.2e-9];

/// Sum in lanes: tables, a moving path in a group of 16 chirps, a cell of a group, and the record of a path
/// (`beat/take_over/lanes`).
const LANES: [f64; 4] = [0.03e-3, 24e-9, 25e-9, 50e-9];

/// NUFFT before it is planned: planning, a chirp, a path, and a path per chirp and row of its series; of paths at
/// constant rates, and of others (`beat/take_over/grid`, `beat/paths/grid_1e-5`).
const STEADY_NUFFT: [f64; 4] = [0.2e-3, 3e-6, 15e-9, 0.0];
const NUFFT: [f64; 4] = [0.8e-3, 10e-6, 15e-9, 0.33e-9];

/// Memory that stays in the L2 cache [bytes].
const FAST_MEMORY: f64 = 2e6;

/// Paths per batch of the NUFFT, spread on one grid after the other.
const BATCH: f64 = 2048.0;

/// Planning of the NUFFT for more blocks, the statistics of all paths in them included.
pub(super) const MORE_BLOCKS: f64 = 5e-4;

/// Sums that take less are not worth the planning of a NUFFT.
pub(super) const NO_NUFFT: f64 = 2e-4;

/// Direct sum of a path in a sample.
pub(super) const DIRECT: f64 = 5e-9;

/// Recurrence sum of a path in a sample, by the numbers of terms of the series of delays and of amplitudes.
pub(super) fn recurrence_of_sample(is_single: bool, (delays, amplitudes): (usize, usize)) -> f64 {
    let detail = 1.0 + 0.03 * (delays as f64 - 2.0).max(0.0) + 0.06 * (amplitudes as f64 - 1.0);
    RECURRENCE[2] * if is_single { 0.5 * detail } else { detail }
}

/// Recurrence sum of some paths in some samples each.
pub fn recurrence(num_paths: f64, num_samples: f64) -> f64 {
    let [planning, path, sample] = RECURRENCE;
    planning + num_paths * (path + sample * num_samples)
}

/// Sum in lanes of some paths, of which some move, with some cells in each group of chirps.
pub fn lanes(num_paths: f64, num_moving: f64, (num_groups, num_cells): (f64, f64)) -> f64 {
    let [tables, path, cell, record] = LANES;
    tables + num_groups * (num_moving * path + num_cells * cell) + num_paths * record
}

/// NUFFT of some paths over some chirps, by the number of rows of their series. What stands still has one spectrum for
/// all chirps.
pub fn nufft(num_paths: f64, num_chirps: f64, num_terms: usize, has_motion: bool) -> f64 {
    let [planning, chirp, path, row] = if num_terms <= 2 { STEADY_NUFFT } else { NUFFT };
    let slow_time = if has_motion { num_chirps * chirp } else { 0.0 };
    planning + slow_time + num_paths * (path + row * num_terms as f64 * num_chirps)
}

/// Spreading of a path on the grids of some terms, with a kernel of some width (`beat/tolerance`).
pub(super) fn spreading(width: usize, is_single: bool, num_terms: usize) -> f64 {
    let w = width as f64;
    let (first, further) = if is_single {
        (7.0 + 1.2 * w, 0.5 + w)
    } else {
        (8.0 + 2.2 * w, 2.0 * w)
    };
    1e-9 * (first + further * (num_terms as f64 - 1.0))
}

/// Fetching of grids of some size [bytes] that do not stay in the L2 cache, for each of the paths.
pub(super) fn fetching(bytes: f64) -> f64 {
    1e-9 * 0.02 * (bytes - FAST_MEMORY).max(0.0) / BATCH
}

/// Reading of the series of a path, which every block does; rows of amplitudes are twice as long (`beat/chirps`).
pub(super) fn reading(num_delays: usize, num_amplitudes: usize) -> f64 {
    1e-9 * (2.0 * (num_delays as f64 - 2.0).max(0.0) + 3.0 * (num_amplitudes as f64 - 1.0))
}

/// Transforms of the grids of a channel over range and over velocity, by the numbers of velocity rows, terms, chirps
/// and samples (`beat/samples`, `beat/chirps`).
pub(super) fn transforms(rows: usize, num_terms: usize, (chirps, samples): (usize, usize), is_single: bool) -> f64 {
    if rows == 1 {
        return 2e-6;
    }
    let slow = 0.6 + 0.01 * chirps as f64;
    let scale = if is_single { 1.0 } else { 2.0 };
    1e-6 * (rows as f64 * num_terms as f64 * slow * (samples as f64 / 128.0) * scale + 1.0)
}
