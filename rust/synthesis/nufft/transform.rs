//! Transform of paths to samples: spreading, FFT of the rows over range, sum over rows for every chirp.

use num_complex::Complex;
use rayon::prelude::*;

use super::job::Job;
use super::layout::{Layout, PAD, origin};
use super::measured::Measured;
use super::slow_time;
use super::spectra::{Channel, Spectra};
use super::spread::{Widths, spread_chunks};
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Real};
use crate::synthesis::block::CHUNK;
use crate::synthesis::nufft::kernel::KaiserBessel;

/// Add the samples `(chirp, sample)` of a block to `out`, for channels that share a block plan. Returns for each the
/// number of rows that were transformed, and what was measured.
pub fn add_channels<T: Widths>(jobs: &[Job], mut out: Vec<&mut [Complex<T>]>) -> Vec<(usize, Measured)> {
    let Some(job) = jobs.first() else {
        return Vec::new();
    };
    let layout = Layout::new(job.waveform.num_samples, job.width, job.block_plan.rows);
    let kernel = KaiserBessel::new(job.width);
    let channels = parallel::map(job.is_parallel, jobs.iter().collect(), |job| {
        job.spectra::<T>(&layout, &kernel)
    });
    if job.block_plan.rows == 1 {
        for (out, channel) in out.iter_mut().zip(&channels) {
            let (re, im) = (&channel.spectra.re, &channel.spectra.im);
            for chirp in out.chunks_exact_mut(job.waveform.num_samples) {
                for ((sample, re), im) in chirp.iter_mut().zip(re).zip(im) {
                    *sample = *sample + Complex::new(*re, *im);
                }
            }
        }
    } else {
        slow_time::add_chirps(job, &layout, &kernel, &channels, &mut out);
    }
    let count = |channel: &Channel<T>| channel.is_used.iter().filter(|is_used| **is_used).count();
    channels
        .into_iter()
        .map(|channel| (count(&channel), channel.measured))
        .collect()
}

impl Job<'_> {
    /// Spread the paths and transform the rows that are not zero.
    fn spectra<T: Widths>(&self, layout: &Layout, kernel: &KaiserBessel) -> Channel<T> {
        let (grid, measured) = self.fill::<T>(layout);
        let is_touched = |row: usize| {
            let mut terms = grid.chunks_exact(layout.size());
            terms.any(|term| is_any(&term[row * layout.stride..][..layout.stride]))
        };
        let is_used: Vec<bool> = (0..layout.rows)
            .map(|row| self.keep_empty_rows || is_touched(row))
            .collect();
        let spectra = self.transform_rows(layout, kernel, &grid, &is_used);
        T::give_back(grid);
        Channel {
            spectra,
            is_used,
            measured,
        }
    }

    /// Spread all paths: (term, row, cell).
    fn fill<T: Widths>(&self, layout: &Layout) -> (Vec<T>, Measured) {
        let num_chunks = self.series.num_paths.div_ceil(CHUNK);
        let part = |i: usize| {
            let bound = |i: usize| i * num_chunks / self.num_parts;
            let mut grid = T::take_zeros(self.block_plan.approximation.num_sets() * layout.size());
            let measured = spread_chunks(self, layout, bound(i)..bound(i + 1), &mut grid);
            (grid, measured)
        };
        let parts = parallel::map(self.is_parallel, (0..self.num_parts).collect(), part);
        let mut parts = parts.into_iter();
        let Some((mut sum, mut measured)) = parts.next() else {
            unreachable!("at least one part")
        };
        for (other, others) in parts {
            for (a, b) in sum.iter_mut().zip(&other) {
                *a = *a + *b;
            }
            T::give_back(other);
            measured.join(&others);
        }
        // In units of the unscaled power [W].
        measured.rest = measured.rest / self.scale / self.scale;
        (sum, measured)
    }

    /// FFT over range of the used rows of every term, divided by the kernel's transform: (term, row, sample).
    fn transform_rows<T: Widths>(
        &self,
        layout: &Layout,
        kernel: &KaiserBessel,
        grid: &[T],
        is_used: &[bool],
    ) -> Spectra<T> {
        let (n, num_samples) = (layout.num_cells, self.waveform.num_samples);
        let padded = num_samples.next_multiple_of(PAD);
        let fft = T::inverse_fft(n);
        // The grid's origin is shifted by half a period: a sign per output.
        let middle = num_samples / 2;
        let scale: Vec<T> = (0..num_samples)
            .map(|m| {
                let frequency = (m as f64 - middle as f64) / n as f64;
                let sign = if (m + middle) % 2 == 0 { 1.0 } else { -1.0 };
                T::of(sign / kernel.transform(frequency))
            })
            .collect();
        let first = (m_index(0, middle, n), num_samples.min(middle));
        let size = self.block_plan.approximation.num_sets() * layout.rows * padded;
        let mut spectra = Spectra {
            re: vec![T::zero(); size],
            im: vec![T::zero(); size],
            padded,
        };
        // A buffer for the row and one for the transform.
        let buffers = || [n, fft.get_inplace_scratch_len()].map(|len| vec![Complex::new(T::zero(), T::zero()); len]);
        let transform = |[buffer, scratch]: &mut [Vec<Complex<T>>; 2], index: usize, re: &mut [T], im: &mut [T]| {
            let (term, row) = (index / layout.rows, index % layout.rows);
            if !is_used[row] {
                return;
            }
            let cells = &grid[term * layout.size() + row * layout.stride..][..layout.stride];
            fold(cells, origin(self.width), buffer);
            fft.process_with_scratch(buffer, scratch);
            // Outputs -middle .. 0 are at the end of the buffer, the others at its start.
            let (negative, num_negative) = first;
            let parts = [
                (&buffer[negative..][..num_negative], 0),
                (&buffer[..num_samples - middle], middle),
            ];
            for (from, to) in parts {
                self.level.run(Scaled {
                    from,
                    scale: &scale[to..],
                    re: &mut re[to..],
                    im: &mut im[to..],
                });
            }
        };
        let (re, im) = (&mut spectra.re, &mut spectra.im);
        if self.is_parallel {
            re.par_chunks_mut(padded)
                .zip(im.par_chunks_mut(padded))
                .enumerate()
                .with_min_len(16)
                .for_each_init(buffers, |buffers, (index, (re, im))| transform(buffers, index, re, im));
        } else {
            let mut buffers = buffers();
            for (index, (re, im)) in re.chunks_mut(padded).zip(im.chunks_mut(padded)).enumerate() {
                transform(&mut buffers, index, re, im);
            }
        }
        spectra
    }
}

/// Kernel that scales numbers and separates real and imaginary parts.
struct Scaled<'a, T> {
    from: &'a [Complex<T>],
    scale: &'a [T],
    re: &'a mut [T],
    im: &'a mut [T],
}

impl<T: Real> Kernel for Scaled<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let n = self.from.len();
        let (from, scale, re, im) = (self.from, &self.scale[..n], &mut self.re[..n], &mut self.im[..n]);
        for i in 0..n {
            re[i] = from[i].re * scale[i];
            im[i] = from[i].im * scale[i];
        }
    }
}

/// Index in the FFT's output of output number `m - middle`.
fn m_index(m: usize, middle: usize, n: usize) -> usize {
    (m + n - middle) % n
}

/// Fold the padding of a row onto the other end of the period.
fn fold<T: Real>(cells: &[T], origin: usize, buffer: &mut [Complex<T>]) {
    let n = buffer.len();
    let cells = cells.as_chunks::<2>().0;
    for (value, [re, im]) in buffer.iter_mut().zip(&cells[origin..origin + n]) {
        *value = Complex::new(*re, *im);
    }
    // Without a division per cell.
    let before = (0..origin).map(|i| (i, i + n - origin));
    let behind = (origin + n..cells.len()).zip((0..n).cycle());
    for (i, place) in before.chain(behind) {
        let at = &mut buffer[place];
        *at = *at + Complex::new(cells[i][0], cells[i][1]);
    }
}

/// True if any number is not zero; runs of zeros take no branch per number.
fn is_any<T: Real>(numbers: &[T]) -> bool {
    let mut runs = numbers.chunks(64);
    runs.any(|run| run.iter().fold(false, |any, x| any | !x.is_zero()))
}
