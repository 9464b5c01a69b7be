//! Delays and amplitudes of chosen paths at a number of times.

use num_complex::Complex64;
use rayon::prelude::*;

use crate::error::{Result, fits_memory};

/// Delays and amplitudes, `(node, channel, path)`, row-major; both may have their own nodes.
pub struct Paths {
    /// Two-way delay [s].
    pub delay: Vec<f64>,
    /// Amplitude without the phase of propagation [sqrt(W)].
    pub amplitude: Vec<Complex64>,
}

impl Paths {
    /// Zeros for the selected paths, with numbers of nodes for delays and for amplitudes.
    pub fn zeros(num_nodes: [usize; 2], num_channels: usize, selection: Selection) -> Result<Self> {
        let shape = |nodes: usize| [nodes, num_channels, selection.len()];
        let most = num_nodes[0].max(num_nodes[1]);
        fits_memory("paths", &shape(most), size_of::<(f64, Complex64)>())?;
        let [delays, amplitudes] = num_nodes.map(|nodes| shape(nodes).iter().product());
        Ok(Self {
            delay: vec![0.0; delays],
            amplitude: vec![Complex64::ZERO; amplitudes],
        })
    }

    /// Evaluate the selected paths; `delay` and `amplitude` are functions of node, channel and path.
    pub fn of(
        num_nodes: [usize; 2],
        num_channels: usize,
        selection: Selection,
        delay: impl Fn(usize, usize, usize) -> f64 + Sync,
        amplitude: impl Fn(usize, usize, usize) -> Complex64 + Sync,
    ) -> Result<Self> {
        let mut paths = Self::zeros(num_nodes, num_channels, selection)?;
        fill(&mut paths.delay, num_channels, selection, delay);
        fill(&mut paths.amplitude, num_channels, selection, amplitude);
        Ok(paths)
    }
}

/// Fill `(node, channel, path)` with values of the selected paths, rows and blocks of rows in parallel.
fn fill<T: Send>(
    numbers: &mut [T],
    num_channels: usize,
    selection: Selection,
    number: impl Fn(usize, usize, usize) -> T + Sync,
) {
    const BLOCK: usize = 512;
    let rows = numbers.par_chunks_mut(selection.len().max(1)).enumerate();
    rows.for_each(|(row, numbers)| {
        let (node, channel) = (row / num_channels, row % num_channels);
        let blocks = numbers.par_chunks_mut(BLOCK).enumerate();
        blocks.for_each(|(block, numbers)| {
            for (i, out) in numbers.iter_mut().enumerate() {
                let path = selection.first + (block * BLOCK + i) * selection.step;
                *out = number(node, channel, path);
            }
        });
    });
}

/// Every `step`-th path from `first` up to `last`.
#[derive(Clone, Copy, Debug)]
pub struct Selection {
    /// First path.
    pub first: usize,
    /// End of the range, exclusive.
    pub last: usize,
    /// Step from one path to the next, at least 1.
    pub step: usize,
}

impl Selection {
    /// Number of paths.
    pub fn len(&self) -> usize {
        self.last.saturating_sub(self.first).div_ceil(self.step)
    }

    /// True when no path is selected.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
