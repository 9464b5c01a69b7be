//! The range-velocity grid: paths spread once, one FFT per velocity row, and a dense transform over slow time.
//!
//! How phases become places on the grid and strengths is said in `residual_phase` and `cross_approximation`. Every mode has a grid of its
//! own and shares the kernel's weights with the others.

mod coordinates;
pub mod kernel;
mod slow_time;
mod spread;

pub use spread::Checked;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use num_complex::Complex;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};

use self::coordinates::{Map, Points, Tracks};

use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel, Level, Precision, Real};
use crate::synthesis::block::{CHUNK, Rows, Selection};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;
use crate::synthesis::low_rank::block_plan::Expansion;
use crate::synthesis::nufft::kernel::{KaiserBessel, OVERSAMPLING};

/// Cells of a row that no output needs, in whole vectors of either precision.
const PAD: usize = 16;

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

/// Most parts of the paths of a job.
pub const MAX_PARTS: usize = 8;

/// One class of paths of a channel on the grid of one block.
pub struct Job<'a> {
    /// The waveform.
    pub waveform: &'a Waveform,
    /// All paths.
    pub series: &'a PathSeries<'a>,
    /// Number of the channel.
    pub channel: usize,
    /// The paths that take part.
    pub selection: Selection<'a>,
    /// Amplitudes are multiplied by this power of two.
    pub scale: f64,
    /// How they are expanded.
    pub expansion: &'a Expansion,
    /// Width of the kernel.
    pub width: usize,
    /// Instruction set.
    pub level: Level,
    /// Parts of the paths that are spread on grids of their own, at the same time where there are threads.
    pub num_parts: usize,
    /// Run parts and tiles on the threads of the pool.
    pub is_parallel: bool,
    /// Transform velocity rows that no path has touched as well, for tests.
    pub keep_empty_rows: bool,
}

/// Most channels whose spectra are held at the same time.
pub const MAX_CHANNELS: usize = 4;

/// Add the samples `(chirp, sample)` of a block to `out`, for channels that share an expansion. Returns for each the number
/// of rows that were transformed, and how far residuals are from their interpolation.
pub fn add_channels<T: Widths>(jobs: &[Job], mut out: Vec<&mut [Complex<T>]>) -> Vec<(usize, Checked)> {
    let Some(job) = jobs.first() else {
        return Vec::new();
    };
    let layout = Layout::new(job.waveform.num_samples, job.width, job.expansion.rows);
    let kernel = KaiserBessel::new(job.width);
    let channels = parallel::map(job.is_parallel, jobs.iter().collect(), |job| {
        job.spectra::<T>(&layout, &kernel)
    });
    if job.expansion.rows == 1 {
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
        .iter()
        .map(|channel| (count(channel), channel.checked))
        .collect()
}

/// The paths of a channel on the grid, after the range transform.
struct Channel<T> {
    spectra: Spectra<T>,
    /// Rows that were transformed; there is nothing in the others.
    is_used: Vec<bool>,
    checked: Checked,
}

impl Job<'_> {
    /// Spread the paths and transform the rows that they touch.
    fn spectra<T: Widths>(&self, layout: &Layout, kernel: &KaiserBessel) -> Channel<T> {
        let (grid, checked) = self.fill::<T>(layout);
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
            checked,
        }
    }

    /// Spread all paths: (term, row, cell).
    fn fill<T: Widths>(&self, layout: &Layout) -> (Vec<T>, Checked) {
        let num_chunks = self.series.num_paths.div_ceil(CHUNK);
        let part = |i: usize| {
            let bound = |i: usize| i * num_chunks / self.num_parts;
            let mut grid = T::take_zeros(self.expansion.modes.num_sets() * layout.size());
            let checked = spread::spread_chunks(self, layout, bound(i)..bound(i + 1), &mut grid);
            (grid, checked)
        };
        let parts = parallel::map(self.is_parallel, (0..self.num_parts).collect(), part);
        let mut parts = parts.into_iter();
        let Some((mut sum, mut checked)) = parts.next() else {
            unreachable!("at least one part")
        };
        for (other, others) in parts {
            for (a, b) in sum.iter_mut().zip(&other) {
                *a = *a + *b;
            }
            T::give_back(other);
            checked = checked.join(others);
        }
        // In units of the amplitudes.
        checked.sum *= self.expansion.modes.check_factor / self.scale / self.scale;
        (sum, checked)
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
        let fft = T::fft(n);
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
        let size = self.expansion.modes.num_sets() * layout.rows * padded;
        let mut spectra = Spectra {
            re: vec![T::zero(); size],
            im: vec![T::zero(); size],
            padded,
        };
        // A buffer for the row and one for the transform.
        let room = || [n, fft.get_inplace_scratch_len()].map(|len| vec![Complex::new(T::zero(), T::zero()); len]);
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
                .for_each_init(room, |room, (index, (re, im))| transform(room, index, re, im));
        } else {
            let mut room = room();
            for (index, (re, im)) in re.chunks_mut(padded).zip(im.chunks_mut(padded)).enumerate() {
                transform(&mut room, index, re, im);
            }
        }
        spectra
    }
}

/// Real and imaginary parts of some numbers, times others.
struct Scaled<'a, T> {
    from: &'a [Complex<T>],
    scale: &'a [T],
    re: &'a mut [T],
    im: &'a mut [T],
}

impl<T: Real> Kernel for Scaled<'_, T> {
    type Output = ();

    #[inline(always)] // see `Kernel`
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

/// Cells in front of the grid's origin.
fn origin(width: usize) -> usize {
    width.div_ceil(2)
}

/// Cells of a row, the pads put back to the other end of the period.
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

/// Whether any number is not zero. Runs of zeros are passed without a branch per number.
fn is_any<T: Real>(numbers: &[T]) -> bool {
    let mut runs = numbers.chunks(64);
    runs.any(|run| run.iter().fold(false, |any, x| any | !x.is_zero()))
}

/// Rows after the range transform: (term, row, sample), samples padded to whole vectors.
struct Spectra<T> {
    re: Vec<T>,
    im: Vec<T>,
    padded: usize,
}

/// Precisions: the kernel widths that are compiled for each, and its transforms.
pub trait Widths: Precision {
    /// Numbers in a vector.
    const LANES: usize;
    /// Gather a chunk of paths and put them in their places, see [`place::Place`].
    fn place(
        job: &Job,
        map: &Map<Self>,
        first: usize,
        rows: &mut Rows,
        tracks: &mut Tracks<Self>,
        points: &mut Points<Self>,
    ) -> f64;
    /// Spread the points of a chunk of paths.
    fn add_points(chunk: spread::Patches<Self>);
    /// The inverse FFT of a length.
    fn fft(n: usize) -> Arc<dyn Fft<Self>>;
    /// Zeros, in memory that was given back if there is some: fresh pages cost a tenth of a large sum.
    fn take_zeros(len: usize) -> Vec<Self>;
    /// See [`Self::take_zeros`].
    fn give_back(memory: Vec<Self>);
    /// What was given back.
    fn kept() -> MutexGuard<'static, Vec<Vec<Self>>>;
}

/// Most numbers of grids that are kept for the next sum.
const MAX_KEPT: usize = 1 << 22;

/// What both precisions do alike; vectors of f64 that fill one of the precision.
macro_rules! alike {
    ($scalar:ty, $vectors:literal) => {
        const LANES: usize = 8 * $vectors;

        fn place(
            job: &Job,
            map: &Map<Self>,
            first: usize,
            rows: &mut Rows,
            tracks: &mut Tracks<Self>,
            points: &mut Points<Self>,
        ) -> f64 {
            job.level.run(coordinates::Place::<Self, $vectors> {
                job,
                map,
                first,
                rows,
                tracks,
                points,
            })
        }

        // Plans of transforms are made once per length.
        fn fft(n: usize) -> Arc<dyn Fft<Self>> {
            static PLANNER: Mutex<Option<FftPlanner<$scalar>>> = Mutex::new(None);
            let mut planner = PLANNER.lock().unwrap_or_else(PoisonError::into_inner);
            planner.get_or_insert_with(FftPlanner::new).plan_fft_inverse(n)
        }

        fn take_zeros(len: usize) -> Vec<Self> {
            let mut memory = Self::kept().pop().unwrap_or_default();
            memory.clear();
            memory.resize(len, 0.0);
            memory
        }

        fn give_back(memory: Vec<Self>) {
            let mut kept = Self::kept();
            if kept.iter().map(Vec::capacity).sum::<usize>() + memory.capacity() <= MAX_KEPT {
                kept.push(memory);
            }
        }

        fn kept() -> MutexGuard<'static, Vec<Vec<Self>>> {
            static KEPT: Mutex<Vec<Vec<$scalar>>> = Mutex::new(Vec::new());
            KEPT.lock().unwrap_or_else(PoisonError::into_inner)
        }
    };
}

impl Widths for f32 {
    alike!(f32, 2);

    fn add_points(chunk: spread::Patches<Self>) {
        match chunk.width {
            3 => chunk.add::<3, 1, true>(),
            4 => chunk.add::<4, 1, true>(),
            5 => chunk.add::<5, 1, true>(),
            6 => chunk.add::<6, 1, true>(),
            7 => chunk.add::<7, 1, true>(),
            _ => chunk.add::<8, 1, true>(),
        }
    }
}

impl Widths for f64 {
    alike!(f64, 1);

    fn add_points(chunk: spread::Patches<Self>) {
        // Wider patches do not fit into the registers that merging needs.
        match chunk.width {
            8 => chunk.add::<8, 2, true>(),
            10 => chunk.add::<10, 3, true>(),
            12 => chunk.add::<12, 3, false>(),
            _ => chunk.add::<14, 4, false>(),
        }
    }
}
