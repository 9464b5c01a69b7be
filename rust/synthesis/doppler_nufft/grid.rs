//! Grids of cells of range and rows of velocity, and their spectra over range.

use crate::numeric::kaiser_bessel::{KaiserBessel, degree};
use crate::numeric::simd::{Isa, Kernel, Level, Precision, Vector};
use crate::numeric::{fft, parallel};

/// Size of a vector [bytes].
pub const VECTOR: usize = 64;

/// Padding of a row [cells], in whole vectors of either precision.
pub const PAD: usize = 16;

/// Largest phase over half of the frame from one velocity row to the next [turns].
pub const STEP: f64 = 0.25;

/// Layout of a grid: sizes and strides.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Width of the kernel [cells].
    pub width: usize,
    /// Number of samples of a chirp.
    pub num_samples: usize,
    /// Length of the range transform [cells].
    pub num_cells: usize,
    /// Numbers from one row to the next.
    pub stride: usize,
    /// Velocity rows of one term; 1 for static paths.
    pub rows: usize,
}

impl Layout {
    /// Layout for a number of samples, a width of the kernel and a number of rows.
    pub fn new(num_samples: usize, width: usize, rows: usize) -> Self {
        let num_cells = fft::num_cells(num_samples.max(width));
        let cells = num_cells + 2 * width + PAD;
        Self {
            width,
            num_samples,
            num_cells,
            stride: 2 * cells.next_multiple_of(PAD),
            rows,
        }
    }

    /// Size of the grid of one term [numbers].
    pub fn size(&self) -> usize {
        self.rows * self.stride
    }

    /// Cells in front of the origin.
    pub fn origin(&self) -> usize {
        self.width / 2
    }

    /// First cell of a patch in the middle of some cells.
    pub fn first(&self, cells: usize) -> f64 {
        0.5 * (cells as f64 - self.width as f64) + 0.5
    }

    /// Samples of a row of a spectrum, in whole vectors.
    pub fn padded(&self) -> usize {
        self.num_samples.next_multiple_of(PAD)
    }

    /// Kernel along velocity.
    pub fn velocity_kernel(&self) -> KaiserBessel {
        KaiserBessel::new(self.width, 2.0 * STEP)
    }
}

/// Grids of a layout: taps of the kernels, and the transform over range, see [`fft`].
pub struct Grid<T> {
    /// Sizes and strides.
    pub layout: Layout,
    /// See [`tap_table`].
    pub taps: Vec<T>,
    twiddles: Vec<T>,
    /// One over the transform of the kernel, per sample.
    factors: Vec<T>,
}

impl<T: Precision> Grid<T> {
    /// Grids of a layout.
    pub fn new(layout: Layout) -> Self {
        let kernel = KaiserBessel::new(layout.width, layout.num_samples as f64 / layout.num_cells as f64);
        let middle = layout.num_samples / 2;
        let frequency = |sample: usize| (sample as f64 - middle as f64) / layout.num_cells as f64;
        let factor = |sample| T::of(kernel.transform(frequency(sample)).recip());
        Self {
            layout,
            taps: tap_table(&[kernel, layout.velocity_kernel()]),
            twiddles: fft::twiddles(layout.num_cells),
            factors: (0..layout.num_samples).map(factor).collect(),
        }
    }

    /// Spectra `(term, row, part, sample)` of a grid `(term, row, cell)`.
    pub fn spectra(&self, level: Level, is_parallel: bool, cells: &[T]) -> Vec<T> {
        let lanes = VECTOR / size_of::<T>();
        let mut spectra = vec![T::zero(); cells.len() / self.layout.stride * 2 * self.layout.padded()];
        let of_rows = spectra.chunks_mut(lanes * 2 * self.layout.padded());
        let tasks = cells.chunks(lanes * self.layout.stride).zip(of_rows).collect();
        parallel::map(is_parallel, tasks, |(rows, spectra)| {
            let grid = self;
            level.run(Transform { grid, rows, spectra });
        });
        spectra
    }
}

/// Polynomials of the cells of the kernels along range and velocity, `[power][cell]`: of either axis in whole halves of
/// vectors, one after the other.
fn tap_table<T: Precision>(kernels: &[KaiserBessel; 2]) -> Vec<T> {
    let width = kernels[0].width;
    let padded = width.next_multiple_of(VECTOR / size_of::<T>() / 2);
    let taps = [kernels[0].taps::<T>(), kernels[1].taps::<T>()];
    let mut table = Vec::new();
    for power in 0..=degree(width) {
        for of_axis in &taps {
            table.extend((0..padded).map(|cell| of_axis.coefficient(cell, power)));
        }
    }
    table
}

/// Kernel that transforms one row per lane.
struct Transform<'a, T> {
    grid: &'a Grid<T>,
    rows: &'a [T],
    spectra: &'a mut [T],
}

impl<T: Precision> Kernel for Transform<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let layout = self.grid.layout;
        let (num_samples, num_cells, padded) = (layout.num_samples, layout.num_cells, layout.padded());
        let lanes = <T::In<I>>::LANES;
        let mut cells = vec![T::zero(); num_cells * 2 * lanes];
        let mut scratch = vec![T::zero(); num_cells * 2 * lanes];
        let num_rows = self.rows.len() / layout.stride;
        for lane in 0..num_rows {
            let row = &self.rows[lane * layout.stride..][..layout.stride];
            // Padding belongs to the other end of the period, whose middle is the first cell of the transform.
            for cell in 0..layout.stride / 2 {
                let to = ((cell + num_cells / 2 - layout.origin()) & (num_cells - 1)) * 2 * lanes + lane;
                cells[to] = cells[to] + row[2 * cell];
                cells[to + lanes] = cells[to + lanes] + row[2 * cell + 1];
            }
        }
        let spectrum = fft::inverse::<T::In<I>>(&mut cells, &mut scratch, num_cells, &self.grid.twiddles);
        for lane in 0..num_rows {
            let (re, im) = self.spectra[lane * 2 * padded..][..2 * padded].split_at_mut(padded);
            for sample in 0..num_samples {
                let cell = (sample + num_cells - num_samples / 2) & (num_cells - 1);
                let parts = &spectrum[cell * 2 * lanes..][..2 * lanes];
                re[sample] = self.grid.factors[sample] * parts[lane];
                im[sample] = self.grid.factors[sample] * parts[lanes + lane];
            }
        }
    }
}
