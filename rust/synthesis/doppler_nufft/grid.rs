//! Grids of cells of range and rows of velocity, and their spectra over range.

use crate::numeric::simd::{Isa, Kernel, Level, Precision, Vector};
use crate::numeric::{fft, parallel};
use crate::synthesis::kaiser_bessel::KaiserBessel;

/// Size of a vector [bytes].
const VECTOR: usize = 64;

/// Padding of a row [cells], in whole vectors of either precision.
pub const PAD: usize = 16;

/// Largest phase over half of the frame from one velocity row to the next [turns], and for fine grids.
pub const STEP: f64 = 0.25;
pub const FINE_STEP: f64 = 0.2;

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
    /// Velocity rows of one term.
    pub rows: usize,
    /// True for cells and rows at half and at 4/5 of the usual distances.
    pub is_fine: bool,
}

impl Layout {
    /// Layout for a number of samples, a width of the kernel and a number of rows.
    pub fn new(num_samples: usize, (width, is_fine): (usize, bool), rows: usize) -> Self {
        let num_outputs = if is_fine { 2 * num_samples } else { num_samples };
        let num_cells = fft::num_cells(num_outputs.max(width));
        let cells = num_cells + 2 * width + PAD;
        Self {
            width,
            num_samples,
            num_cells,
            stride: 2 * cells.next_multiple_of(PAD),
            rows,
            is_fine,
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

    /// Samples of a row of a spectrum, in whole vectors.
    pub fn padded(&self) -> usize {
        self.num_samples.next_multiple_of(PAD)
    }

    /// Kernel along velocity.
    pub fn velocity_kernel(&self) -> KaiserBessel {
        let turns_per_row = if self.is_fine { FINE_STEP } else { STEP };
        KaiserBessel::new(self.width, 2.0 * turns_per_row)
    }

    /// Kernel along range.
    pub fn kernel(&self) -> KaiserBessel {
        KaiserBessel::new(self.width, self.num_samples as f64 / self.num_cells as f64)
    }
}

/// Transform of grids over range, see [`fft`].
pub struct RangeTransform<T> {
    layout: Layout,
    twiddles: Vec<T>,
    /// Per sample, one over the transform of the kernel, with a sign: the grid's origin is half a period away.
    factors: Vec<f64>,
}

impl<T: Precision> RangeTransform<T> {
    /// Transform of grids of a layout.
    pub fn new(layout: Layout) -> Self {
        let (kernel, middle) = (layout.kernel(), layout.num_samples / 2);
        let factor = |sample: usize| {
            let sign = if (sample + middle).is_multiple_of(2) { 1.0 } else { -1.0 };
            sign / kernel.transform((sample as f64 - middle as f64) / layout.num_cells as f64)
        };
        Self {
            layout,
            twiddles: fft::twiddles(layout.num_cells),
            factors: (0..layout.num_samples).map(factor).collect(),
        }
    }

    /// Add the spectra of a grid `(term, row, cell)`, times a factor per sample or none, to `spectra`
    /// `(term, row, part, sample)`.
    pub fn add(&self, level: Level, is_parallel: bool, grid: &[T], over_frequency: &[f64], spectra: &mut [T]) {
        let factor = |(sample, factor): (usize, &f64)| T::of(factor * over_frequency.get(sample).unwrap_or(&1.0));
        let factors: Vec<T> = self.factors.iter().enumerate().map(factor).collect();
        let lanes = VECTOR / size_of::<T>();
        let spectra = spectra.chunks_mut(lanes * 2 * self.layout.padded());
        let tasks = grid.chunks(lanes * self.layout.stride).zip(spectra).collect();
        parallel::map(is_parallel, tasks, |(rows, spectra)| {
            level.run(AddSpectra {
                transform: self,
                factors: &factors,
                rows,
                spectra,
            });
        });
    }
}

/// Kernel that adds the spectra of one row per lane.
struct AddSpectra<'a, T> {
    transform: &'a RangeTransform<T>,
    factors: &'a [T],
    rows: &'a [T],
    spectra: &'a mut [T],
}

impl<T: Precision> Kernel for AddSpectra<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let Layout {
            num_samples,
            num_cells,
            stride,
            ..
        } = self.transform.layout;
        let (origin, padded) = (self.transform.layout.origin(), self.transform.layout.padded());
        let lanes = <T::In<I>>::LANES;
        let mut grid = vec![T::zero(); num_cells * 2 * lanes];
        let mut scratch = vec![T::zero(); num_cells * 2 * lanes];
        let num_rows = self.rows.len() / stride;
        if self
            .rows
            .chunks(PAD)
            .all(|some| some.iter().fold(true, |none, x| none & x.is_zero()))
        {
            return; // no path is so fast
        }
        for lane in 0..num_rows {
            let row = &self.rows[lane * stride..][..stride];
            for cell in 0..num_cells {
                let at = 2 * (cell + origin);
                grid[cell * 2 * lanes + lane] = row[at];
                grid[cell * 2 * lanes + lanes + lane] = row[at + 1];
            }
            // Padding belongs to the other end of the period.
            for cell in 0..origin {
                let to = (cell + num_cells - origin) * 2 * lanes + lane;
                grid[to] = grid[to] + row[2 * cell];
                grid[to + lanes] = grid[to + lanes] + row[2 * cell + 1];
            }
            for cell in origin + num_cells..stride / 2 {
                let to = (cell - origin - num_cells) % num_cells * 2 * lanes + lane;
                grid[to] = grid[to] + row[2 * cell];
                grid[to + lanes] = grid[to + lanes] + row[2 * cell + 1];
            }
        }
        let spectrum = fft::inverse::<T::In<I>>(&mut grid, &mut scratch, num_cells, &self.transform.twiddles);
        for lane in 0..num_rows {
            let (re, im) = self.spectra[lane * 2 * padded..][..2 * padded].split_at_mut(padded);
            for sample in 0..num_samples {
                let cell = (sample + num_cells - num_samples / 2) & (num_cells - 1);
                let parts = &spectrum[cell * 2 * lanes..][..2 * lanes];
                re[sample] = re[sample] + self.factors[sample] * parts[lane];
                im[sample] = im[sample] + self.factors[sample] * parts[lanes + lane];
            }
        }
    }
}
