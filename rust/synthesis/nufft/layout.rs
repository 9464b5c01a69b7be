//! Layout of a grid: cells of range, rows of velocity.

use crate::synthesis::nufft::kernel::OVERSAMPLING;

/// Cells of a row that no output needs, in whole vectors of either precision.
pub(super) const PAD: usize = 16;

/// Numbers of a grid's layout.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Length of the range transform.
    pub num_cells: usize,
    /// Numbers from one row to the next.
    pub stride: usize,
    /// Rows of one term.
    pub rows: usize,
}

impl Layout {
    /// The layout for a number of samples and rows.
    pub fn new(num_samples: usize, width: usize, rows: usize) -> Self {
        let num_cells = good_size((OVERSAMPLING * num_samples).max(2 * width));
        let cells = num_cells + 2 * width + PAD;
        Self {
            num_cells,
            stride: 2 * cells.next_multiple_of(PAD),
            rows,
        }
    }

    /// Numbers of one term's grid.
    pub fn size(&self) -> usize {
        self.rows * self.stride
    }
}

/// Smallest even product of 2, 3 and 5 that is not below `n`.
pub fn good_size(n: usize) -> usize {
    // There is a power of two below.
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
