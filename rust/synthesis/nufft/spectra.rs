//! Spectra of a channel after the range transform.

use super::spread::Checked;

/// The paths of a channel on the grid, after the range transform.
pub(super) struct Channel<T> {
    pub(super) spectra: Spectra<T>,
    /// Rows that were transformed; there is nothing in the others.
    pub(super) is_used: Vec<bool>,
    pub(super) checked: Checked,
}

/// Rows after the range transform: (term, row, sample), samples padded to whole vectors.
pub(super) struct Spectra<T> {
    pub(super) re: Vec<T>,
    pub(super) im: Vec<T>,
    pub(super) padded: usize,
}
