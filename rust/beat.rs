//! The beat signal of a set of paths: checks the input and chooses the method.

use num_complex::Complex64;

use crate::chirp::Waveform;
use crate::delay::PathSeries;
use crate::direct;
use crate::error::{Result, fits_memory};
use crate::simd::Level;

/// Complex beat samples `(channel, chirp, sample)`, row-major, eq. (1): the sum over all paths of
/// `conj(amplitude) exp(2 pi j (f0 tau + S tau t - S tau^2 / 2))`. No paths give zeros.
pub fn beat_signal(waveform: &Waveform, series: &PathSeries) -> Result<Vec<Complex64>> {
    waveform.check()?;
    series.check()?;
    // The sums of all blocks and, copied from them, the samples.
    let num_samples = waveform.num_samples.saturating_add(direct::BLOCK);
    let shape = [series.num_channels, waveform.chirp_times.len(), num_samples];
    fits_memory("samples", &shape, 2 * size_of::<Complex64>())?;
    Ok(direct::beat_signal(waveform, series, Level::best()))
}
