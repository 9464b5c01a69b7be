//! Spectra of a channel after the range transform.

use super::measured::Measured;

/// Spectra of the paths of a channel, after the range transform.
pub(super) struct Channel<T> {
    pub(super) spectra: Spectra<T>,
    /// True for rows that were transformed; the others are zero.
    pub(super) is_used: Vec<bool>,
    pub(super) measured: Measured,
}

/// Spectra after the range transform, (term, row, sample), samples padded to whole vectors.
pub(super) struct Spectra<T> {
    pub(super) re: Vec<T>,
    pub(super) im: Vec<T>,
    pub(super) padded: usize,
}
