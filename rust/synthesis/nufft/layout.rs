//! Layout of a grid: cells of range, rows of velocity.

use crate::synthesis::nufft::kernel::OVERSAMPLING;

/// Padding of a row [cells], in whole vectors of either precision.
pub(super) const PAD: usize = 16;

/// Layout of a grid: sizes and strides.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Length of the range transform [cells].
    pub num_cells: usize,
    /// Numbers from one row to the next.
    pub stride: usize,
    /// Velocity rows of one term.
    pub rows: usize,
}

impl Layout {
    /// Layout for a number of samples, a width of the kernel and a number of rows.
    pub fn new(num_samples: usize, width: usize, rows: usize) -> Self {
        let num_cells = good_size((OVERSAMPLING * num_samples).max(2 * width));
        let cells = num_cells + 2 * width + PAD;
        Self {
            num_cells,
            stride: 2 * cells.next_multiple_of(PAD),
            rows,
        }
    }

    /// Size of the grid of one term [numbers].
    pub fn size(&self) -> usize {
        self.rows * self.stride
    }
}

/// Smallest even product of 2, 3 and 5 that is not below `n`.
pub fn good_size(n: usize) -> usize {
    // The range contains a power of two.
    (n.max(2)..=2 * n.max(2))
        .find(|candidate| {
            let mut rest = *candidate;
            for prime in [2, 3, 5] {
                while rest % prime == 0 {
                    rest /= prime;
                }
            }
            rest == 1 && candidate % 2 == 0
        })
        .unwrap_or(n)
}

/// Cells in front of the grid's origin.
pub(super) fn origin(width: usize) -> usize {
    width.div_ceil(2)
}
