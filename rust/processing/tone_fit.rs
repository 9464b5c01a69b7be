//! Frequencies of a tone from the cells about its peak, by maximum likelihood.

use num_complex::Complex;
use num_traits::AsPrimitive;

use crate::numeric::simd::Level;

type Complex64 = Complex<f64>;

/// Steps of Fisher's scoring from the parabola, which is 0.02 cells off: each about squares the error, or divides it by
/// the ratio of the amplitudes of signal and noise. The residual is far below the noise up to 100 dB.
const NUM_STEPS: usize = 2;

/// Refits after subtraction of other tones by their previous fits; each divides the error by about 100.
const NUM_REFITS: usize = 2;

/// A fit that goes farther than this many cells from its start has lost the peak; the start is then kept.
const FARTHEST: f64 = 1.0;

/// Map of all channels, `(look, row, column)`.
pub struct MapCells<'a, T> {
    pub values: &'a [Complex<T>],
    pub shape: [usize; 3],
    /// Columns are cyclic, as rows always are.
    pub is_cyclic: bool,
    /// Tones are real: each is a complex tone and its conjugate, whose main lobes overlap near column 0.
    pub has_images: bool,
}

/// Shape of a tone in neighbouring cells of slow and of fast time, and the noise in them.
pub struct Axes<'a> {
    /// Power series `(axis, place, degree, 8 cell)` by the distance from the middle cell, of a tone and of its
    /// derivative, both as they are and as the conjugate of their product with the inverse of the noise's covariance:
    /// complex numbers (2, 2, cell), in the cells of a patch that has `place` cells before the middle one.
    pub series: &'a [f64],
    /// Places and cells; the shorter axis has zeros beyond its own.
    pub most: usize,
    /// Rows and columns of a patch.
    pub num_cells: [usize; 2],
    /// Power series `(axis, degree, cell)` of a tone of amplitude 1, the middle cell in the middle.
    pub lobes: &'a [Complex64],
}

/// Cells of lobes.
pub const NUM_LOBES: usize = 4 * FARTHEST_OTHER + 1;

/// Largest number of rows or columns from a tone to another beside it; patches reach as far.
const FARTHEST_OTHER: usize = 8;

/// Last column where the conjugate of a real tone disturbs its fit. Farther on a Hann window attenuates by 60 dB. Lobes
/// reach from here to the conjugate of a tone at the same column.
const FARTHEST_IMAGE: usize = 6;

/// The tone that fits best.
#[derive(Clone)]
pub struct Tone {
    /// From the middle cell along slow and fast time [cells].
    pub offset: [f64; 2],
    /// Of every look.
    pub amplitude: Vec<Complex64>,
    /// Power over the noise of the cells together, for a tone of amplitude 1 and noise of 1 per cell.
    pub energy_gain: f64,
    /// Of the offset, see [`fit`].
    pub information: [f64; 2],
}

/// A tone beside another.
struct Neighbour {
    index: usize,
    /// The conjugate of the tone.
    is_image: bool,
    /// Rows and columns from its peak to the other's.
    steps: [isize; 2],
}

/// Another tone in the cells of a patch.
struct Other<'a> {
    /// Along rows and columns, for an amplitude of 1.
    parts: [Vec<Complex64>; 2],
    amplitude: &'a [Complex64],
    is_image: bool,
}

/// Fit tones to the cells about peaks from offsets near them, then again those beside stronger ones or conjugates.
pub fn fit_all<T: AsPrimitive<f64>>(
    cells: &MapCells<T>,
    peaks: &[[usize; 2]],
    starts: &[[f64; 2]],
    axes: &Axes,
) -> Vec<Tone> {
    let both = peaks.iter().zip(starts);
    let mut tones: Vec<_> = both
        .map(|(peak, start)| fit(cells, *peak, *start, axes, |_| Vec::new()))
        .collect();
    let power = |tone: &Tone| tone.amplitude.iter().map(Complex::norm_sqr).sum::<f64>();
    let powers: Vec<_> = tones.iter().map(power).collect();
    let neighbours: Vec<_> = (0..peaks.len())
        .map(|index| cells.neighbours(index, peaks, &powers))
        .collect();
    let mut is_new = vec![true; peaks.len()];
    for _ in 0..NUM_REFITS {
        let disturbs = |index: usize| neighbours.iter().flatten().any(|neighbour| neighbour.index == index);
        let lobes_of = |(index, tone): (usize, &Tone)| disturbs(index).then(|| axes.lobes(tone.offset));
        let lobes: Vec<_> = tones
            .iter()
            .enumerate()
            .map(lobes_of)
            .map(Option::unwrap_or_default)
            .collect();
        let refitted: Vec<_> = neighbours
            .iter()
            .enumerate()
            .map(|(index, neighbours)| {
                let others = |places: [usize; 2]| {
                    let other = |neighbour: &Neighbour| Other {
                        parts: neighbour.parts(&lobes[neighbour.index], places, axes.num_cells),
                        amplitude: &tones[neighbour.index].amplitude,
                        is_image: neighbour.is_image,
                    };
                    neighbours.iter().map(other).collect()
                };
                let is_changed = neighbours.iter().any(|neighbour| is_new[neighbour.index]);
                is_changed.then(|| fit(cells, peaks[index], tones[index].offset, axes, others))
            })
            .collect();
        is_new = refitted.iter().map(Option::is_some).collect();
        for (tone, refitted) in tones.iter_mut().zip(refitted) {
            *tone = refitted.unwrap_or_else(|| tone.clone());
        }
    }
    tones
}

impl Neighbour {
    /// The tone of amplitude 1 in the rows and in the columns of a patch that begins `places` before its middle.
    fn parts(&self, lobes: &[Vec<Complex64>; 2], places: [usize; 2], num_cells: [usize; 2]) -> [Vec<Complex64>; 2] {
        [0, 1].map(|axis| {
            let first = self.steps[axis] - places[axis].cast_signed();
            let steps = first..first + num_cells[axis].cast_signed();
            let (middle, lobes) = (NUM_LOBES / 2, &lobes[axis]);
            if self.is_image {
                // The weights are real: at the opposite offset the lobes are conjugate and in reverse order.
                steps
                    .map(|step| lobes[middle.wrapping_add_signed(-step)].conj())
                    .collect()
            } else {
                steps.map(|step| lobes[middle.wrapping_add_signed(step)]).collect()
            }
        })
    }
}

/// [`tone_at`], compiled for this processor.
fn fit<'a, T: AsPrimitive<f64>>(
    cells: &MapCells<T>,
    peak: [usize; 2],
    start: [f64; 2],
    axes: &Axes,
    others: impl Fn([usize; 2]) -> Vec<Other<'a>>,
) -> Tone {
    Level::best().run_loops(
        #[inline(always)]
        || tone_at(cells, peak, start, axes, others),
    )
}

/// Fit one tone to the cells about a peak, less other tones, from an offset near it. The others are asked for with the
/// numbers of rows and columns before the peak.
///
/// With noise of covariance C along an axis, `t^H C^-1 x` is what cells x have of a tone t: all that is needed is
/// products of this kind, of the tone and of its derivatives. `1 / (2 snr information)` is the variance of the offset
/// [cells^2], the Cramér-Rao bound for these cells.
#[cfg_attr(optimised, inline(always))]
fn tone_at<'a, T: AsPrimitive<f64>>(
    cells: &MapCells<T>,
    peak: [usize; 2],
    start: [f64; 2],
    axes: &Axes,
    others: impl Fn([usize; 2]) -> Vec<Other<'a>>,
) -> Tone {
    let ([num_looks, ..], [num_rows, num_columns]) = (cells.shape, axes.num_cells);
    let (places, patch) = cells.patch(peak, axes.num_cells);
    let others = others(places);
    let mut offset = start;
    let mut tone = None;
    for _ in 0..NUM_STEPS {
        // Tone and derivative in the cells, both through the inverse; their products with each other.
        let at = |axis: usize| axes.at(axis, places[axis], offset[axis]);
        let (slow, fast) = (at(0), at(1));
        let products = [slow.products(), fast.products()];

        // Their projections on the cells: `found[i][j]` of the row's i and the column's j, 1 the derivative.
        let mut found = [[(); 2]; 2].map(|row| row.map(|()| vec![Complex64::default(); num_looks]));
        for (look, rows) in patch.chunks_exact(num_rows * num_columns).enumerate() {
            let mut sums = vec![[Complex64::ZERO; 2]; num_columns];
            for (row, cells) in rows.chunks_exact(num_columns).enumerate() {
                let across = [0, 1].map(|i| slow.through(i)[row]);
                for (sums, cell) in sums.iter_mut().zip(cells) {
                    *sums = [sums[0] + across[0] * cell, sums[1] + across[1] * cell];
                }
            }
            for (column, sums) in sums.iter().enumerate() {
                for i in 0..2 {
                    for j in 0..2 {
                        found[i][j][look] += sums[i] * fast.through(j)[column];
                    }
                }
            }
        }

        for other in &others {
            let [across, along] =
                [(&slow, 0), (&fast, 1)].map(|(cells, axis)| [0, 1].map(|i| dot(cells.through(i), &other.parts[axis])));
            for (look, amplitude) in other.amplitude.iter().enumerate() {
                let amplitude = if other.is_image { amplitude.conj() } else { *amplitude };
                for i in 0..2 {
                    for j in 0..2 {
                        found[i][j][look] -= amplitude * across[i] * along[j];
                    }
                }
            }
        }

        // Fisher's scoring. Parts of the derivatives orthogonal to the tone: a change of phase is not a change of
        // frequency.
        let power = |of: &[Complex64]| found[0][0].iter().zip(of).map(|(a, b)| (a.conj() * b).re).sum::<f64>();
        let total = power(&found[0][0]).max(f64::MIN_POSITIVE);
        let mut information = [0.0; 2];
        for (axis, slope) in [&found[1][0], &found[0][1]].into_iter().enumerate() {
            let [[one, other], [derivative, square]] = products[axis];
            information[axis] = (square / one - derivative / one * (other / one)).re;
            let step = (power(slope) / total - (derivative / one).re) / information[axis].max(f64::MIN_POSITIVE);
            offset[axis] += step.clamp(-0.5, 0.5);
        }
        // The last step is too small to change the amplitude, whose slope is zero at the peak.
        let gain = products[0][0][0].re * products[1][0][0].re;
        tone = Some((found, gain, information));
    }
    let ([[found, _], _], energy_gain, information) = tone.expect("there are steps");
    if (0..2).any(|axis| (offset[axis] - start[axis]).abs() > FARTHEST) {
        offset = start;
    }
    Tone {
        offset,
        amplitude: found.into_iter().map(|sum| sum / energy_gain).collect(),
        energy_gain,
        information,
    }
}

impl<T: AsPrimitive<f64>> MapCells<'_, T> {
    /// Cells from one row or column to another, the shorter way around if they are cyclic.
    fn step(&self, axis: usize, to: usize, from: usize) -> isize {
        let (step, length) = (
            to.cast_signed() - from.cast_signed(),
            self.shape[axis + 1].cast_signed(),
        );
        let half = length / 2;
        if axis == 0 || self.is_cyclic {
            (step + half).rem_euclid(length) - half
        } else {
            step
        }
    }

    /// Tones that disturb the fit of one: stronger ones beside it, and near column 0 the conjugates of all.
    fn neighbours(&self, index: usize, peaks: &[[usize; 2]], powers: &[f64]) -> Vec<Neighbour> {
        let is_near = |steps: &[isize; 2], axis: usize| steps[axis].unsigned_abs() <= FARTHEST_OTHER;
        let has_image = |index: usize| self.has_images && peaks[index][1] <= FARTHEST_IMAGE;
        let mut found = Vec::new();
        for other in 0..peaks.len() {
            let neighbour = |is_image: bool, steps: [isize; 2]| Neighbour {
                index: other,
                is_image,
                steps,
            };
            let steps = [0, 1].map(|axis| self.step(axis, peaks[index][axis], peaks[other][axis]));
            if powers[other] > powers[index] && is_near(&steps, 0) && is_near(&steps, 1) {
                found.push(neighbour(false, steps));
            }
            // At the opposite velocity and range.
            let row = (2 * (self.shape[1] / 2) + self.shape[1] - peaks[other][0]) % self.shape[1];
            let column = (peaks[index][1] + peaks[other][1]).cast_signed();
            let steps = [self.step(0, peaks[index][0], row), column];
            if has_image(index) && has_image(other) && is_near(&steps, 0) {
                found.push(neighbour(true, steps));
            }
        }
        found
    }

    /// Cells about a peak (look, row, column), and how many of its rows and columns are before it.
    fn patch(&self, peak: [usize; 2], num_cells: [usize; 2]) -> ([usize; 2], Vec<Complex64>) {
        let [num_looks, height, width] = self.shape;
        let mut places = num_cells.map(|number| number / 2);
        if !self.is_cyclic {
            // No columns beyond the edges.
            let left = peak[1].saturating_sub(places[1]).min(width - num_cells[1]);
            places[1] = peak[1] - left;
        }
        let columns = (0..num_cells[1]).map(|column| (peak[1] + width + column - places[1]) % width);
        let columns: Vec<_> = columns.collect();
        let mut patch = Vec::with_capacity(num_looks * num_cells[0] * num_cells[1]);
        for look in 0..num_looks {
            for row in 0..num_cells[0] {
                let row = (peak[0] + height + row - places[0]) % height;
                let cells = &self.values[(look * height + row) * width..][..width];
                let of_row = columns.iter().map(|column| cells[*column]);
                patch.extend(of_row.map(|cell| Complex::new(cell.re.as_(), cell.im.as_())));
            }
        }
        (places, patch)
    }
}

/// A tone and its derivative in the cells of an axis, both as they are and through the inverse.
struct InCells {
    values: Vec<Complex64>,
    most: usize,
}

impl Axes<'_> {
    /// Tones of amplitude 1 at offsets along rows and columns, the middle cell in the middle.
    fn lobes(&self, offset: [f64; 2]) -> [Vec<Complex64>; 2] {
        [0, 1].map(|axis| {
            let series = &self.lobes[axis * self.lobes.len() / 2..][..self.lobes.len() / 2];
            let mut values = vec![Complex64::ZERO; NUM_LOBES];
            Level::best().run_loops(
                #[inline(always)]
                || {
                    for coefficients in series.chunks_exact(NUM_LOBES).rev() {
                        for (value, coefficient) in values.iter_mut().zip(coefficients) {
                            *value = *value * offset[axis] + coefficient;
                        }
                    }
                },
            );
            values
        })
    }

    /// The series of an axis at an offset.
    #[cfg_attr(optimised, inline(always))]
    fn at(&self, axis: usize, place: usize, offset: f64) -> InCells {
        let length = 8 * self.most;
        let per_place = self.series.len() / (2 * self.most);
        let series = &self.series[(axis * self.most + place) * per_place..][..per_place];
        let mut values = Vec::with_capacity(length / 2);
        for first in (0..length).step_by(8) {
            let mut of_four = [0.0; 8]; // in registers
            for coefficients in series.chunks_exact(length).rev() {
                for (value, coefficient) in of_four.iter_mut().zip(&coefficients[first..first + 8]) {
                    *value = *value * offset + coefficient;
                }
            }
            values.extend(of_four.as_chunks().0.iter().map(|[re, im]| Complex::new(*re, *im)));
        }
        InCells {
            values,
            most: self.most,
        }
    }
}

impl InCells {
    /// The tone (0) or its derivative (1).
    #[cfg_attr(optimised, inline(always))]
    fn plain(&self, which: usize) -> &[Complex64] {
        &self.values[which * self.most..][..self.most]
    }

    /// The conjugate of its product with the inverse.
    #[cfg_attr(optimised, inline(always))]
    fn through(&self, which: usize) -> &[Complex64] {
        &self.values[(2 + which) * self.most..][..self.most]
    }

    #[cfg_attr(optimised, inline(always))]
    fn products(&self) -> [[Complex64; 2]; 2] {
        [0, 1].map(|i| [0, 1].map(|j| dot(self.plain(i), self.through(j))))
    }
}

/// Sum of products, over the shorter of both.
#[cfg_attr(optimised, inline(always))]
fn dot(a: &[Complex64], b: &[Complex64]) -> Complex64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
