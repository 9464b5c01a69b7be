//! Peaks of a map of powers over velocity and range: where they are between the cells, and the noise around them.

use std::ops::Range;

/// Least power of neighbours relative to their peak, because zero has no logarithm.
const LEAST: f64 = 1e-30;

/// Curvature of the log power instead of none; neighbours are as high as the peak then, and there is no slope.
const FLAT: f64 = 1e-30;

/// Points of an envelope per cell.
const PER_CELL: f64 = 16.0;

/// Error of the parabola through three cells, in noise [cells].
const OFF_PEAK: f64 = 0.1;

/// Limit of a training cell's power over the level of its range. Fewer than one cell of noise in a hundred exceed it, so
/// that the threshold falls by at most 0.03 dB, and a strong echo hardly raises the threshold of a weak one nearby.
const CLIPPED_ABOVE: f64 = 5.0;

/// Powers `(row, column)`. Rows are cyclic.
pub struct Map<'a> {
    pub power: &'a [f64],
    pub shape: [usize; 2],
    /// Columns are cyclic, too; if not, the map is even about both its ends, as the spectrum of real samples is.
    pub is_cyclic: bool,
}

/// Top of a peak.
pub struct Top {
    /// From the middle of the cell along rows and columns [cells], at most half of one.
    pub offset: [f64; 2],
    pub height: f64,
}

/// Amplitudes of the sidelobes of echoes, relative to their peaks.
pub struct Sidelobes<'a> {
    /// Envelopes by the distance along rows and columns, 16 points per cell; constant after the last.
    pub envelopes: [&'a [f64]; 2],
    /// Envelope along rows of echoes in the subtracted mean of the chirps.
    pub mean_envelope: &'a [f64],
    /// Gain of this mean in every row.
    pub mean_gain: &'a [f64],
    /// Rows, and columns of the whole transform.
    pub periods: [f64; 2],
    /// Cells crossed by a target during a frame, per row of its velocity.
    pub smear: f64,
    /// The spectrum of real samples contains a mirror image of every echo.
    pub is_mirrored: bool,
}

impl Sidelobes<'_> {
    /// Largest amplitude of the lobes of a peak in a cell.
    fn of(&self, peak: [f64; 2], cell: [f64; 2]) -> f64 {
        // Motion of a target during the frame widens its lobes along both axes equally.
        let middle = (0.5 * self.periods[0]).floor();
        let speed = (peak[0] - middle).abs();
        let widened = OFF_PEAK + 0.5 * self.smear * speed.min(self.periods[0] - speed);
        let images = [peak, [2.0 * middle - peak[0], -peak[1]]];
        let of_image = |image: &[f64; 2]| {
            let [row, column] = [0, 1].map(|axis| {
                let distance = (cell[axis] - image[axis]).abs();
                ((distance.min(self.periods[axis] - distance) - widened).max(0.0) * PER_CELL) as usize
            });
            let at = |envelope: &[f64], point: usize| *envelope.get(point).or(envelope.last()).unwrap_or(&0.0);
            let in_mean = self.mean_gain[cell[0].rem_euclid(self.periods[0]) as usize] * at(self.mean_envelope, row);
            at(self.envelopes[0], row).max(in_mean) * at(self.envelopes[1], column)
        };
        images[..=usize::from(self.is_mirrored)].iter().map(of_image).sum()
    }
}

impl Map<'_> {
    /// Cells above their thresholds that no neighbour exceeds, and their thresholds.
    ///
    /// A threshold is `scale` times the sum of the clipped training cells; cells without a scale are not tested.
    /// `trained` and `scale` (row, column) hold the columns `searched`.
    pub fn maxima_above(
        &self,
        trained: &[f64],
        scale: &[f64],
        searched: Range<usize>,
        guards: [usize; 2],
        trainings: [usize; 2],
    ) -> (Vec<[usize; 2]>, Vec<f64>) {
        let (height, width) = (self.shape[0], searched.len());
        if trained.is_empty() {
            return (Vec::new(), Vec::new());
        }
        let outer = [0, 1].map(|axis| guards[axis] + trainings[axis]);
        let levels = levels(trained, width, outer[1]);
        // Sums of all cells before a row and a column; then of windows about a cell.
        let mut sums = vec![0.0; (height + 1) * (width + 1)];
        for (row, trained) in trained.chunks_exact(width).enumerate() {
            let (above, below) = sums[row * (width + 1)..].split_at_mut(width + 1);
            let mut of_row = 0.0;
            for (((below, above), power), level) in below[1..].iter_mut().zip(&above[1..]).zip(trained).zip(&levels) {
                of_row += power.min(CLIPPED_ABOVE * level);
                *below = above + of_row;
            }
        }
        let window = |row: usize, column: usize, reach: [usize; 2]| {
            let [top, bottom] =
                [row.saturating_sub(reach[0]), height.min(row + reach[0] + 1)].map(|row| row * (width + 1));
            let [left, right] = [column.saturating_sub(reach[1]), width.min(column + reach[1] + 1)];
            (sums[bottom + right] - sums[bottom + left]) - (sums[top + right] - sums[top + left])
        };
        let (before, after) = (
            self.columns_around(searched.start)[0],
            self.columns_around(searched.end - 1)[2],
        );
        let columns: Vec<_> = [before].into_iter().chain(searched.clone()).chain([after]).collect();
        let mut found = (Vec::new(), Vec::new());
        for (row, scales) in scale.chunks_exact(width).enumerate() {
            let rows = cyclic(row, height).map(|row| &self.power[row * self.shape[1]..][..self.shape[1]]);
            let larger = |a: f64, b: f64| if a > b { a } else { b }; // one instruction
            let highest = |column: &usize| larger(larger(rows[0][*column], rows[1][*column]), rows[2][*column]);
            let highest: Vec<_> = columns.iter().map(highest).collect();
            let of_row = rows[1][searched.clone()].iter().zip(scales).zip(highest.windows(3));
            for (column, ((power, scale), highest)) in of_row.enumerate() {
                let highest = larger(larger(highest[0], highest[1]), highest[2]);
                if *power >= highest && *power > 0.0 && *scale > 0.0 {
                    let threshold = scale * (window(row, column, outer) - window(row, column, guards)).max(0.0);
                    if *power > threshold {
                        found.0.push([row, searched.start + column]);
                        found.1.push(threshold);
                    }
                }
            }
        }
        found
    }

    /// Indices of `peaks` that exceed the powers `least` after subtraction of the sidelobes of all stronger echoes, the
    /// strongest first, and their offsets from the middle of their cells.
    ///
    /// Also the largest local maximum of every column outside of `searched`, such as leakage, has sidelobes. Peaks below
    /// `smallest` times the highest are left out.
    pub fn above_sidelobes(
        &self,
        peaks: &[[usize; 2]],
        least: &[f64],
        lobes: &Sidelobes,
        searched: Range<usize>,
        smallest: f64,
    ) -> Vec<(usize, [f64; 2])> {
        let beside = (0..searched.start)
            .chain(searched.end..self.shape[1])
            .filter_map(|column| {
                let higher = |best, row| {
                    if self.at([row, column]) > self.at([best, column]) {
                        row
                    } else {
                        best
                    }
                };
                let highest = [(0..self.shape[0]).reduce(higher)?, column];
                self.is_local_maximum(highest).then_some(highest)
            });
        let cells: Vec<_> = peaks.iter().copied().chain(beside).collect();
        let tops: Vec<_> = cells.iter().map(|cell| self.top(*cell)).collect();
        let weakest = smallest * tops[..peaks.len()].iter().map(|top| top.height).fold(0.0, f64::max);
        let margin = |index: usize| {
            let least = least.get(index).map(|least| least.max(weakest).sqrt());
            least.map_or(f64::INFINITY, |least| self.at(cells[index]).sqrt() - least)
        };
        let places: Vec<_> = cells
            .iter()
            .zip(&tops)
            .map(|(cell, top)| [0, 1].map(|axis| cell[axis] as f64 + top.offset[axis]))
            .collect();

        let mut order: Vec<_> = (0..cells.len()).filter(|index| margin(*index) > 0.0).collect();
        order.sort_by(|a, b| tops[*b].height.total_cmp(&tops[*a].height));
        let mut kept: Vec<usize> = Vec::new();
        for index in order {
            let cell = places[index].map(f64::round_ties_even);
            let leaked: f64 = kept
                .iter()
                .map(|other| lobes.of(places[*other], cell) * tops[*other].height.sqrt())
                .sum();
            if leaked < margin(index) {
                kept.push(index);
            }
        }
        kept.retain(|index| *index < peaks.len());
        kept.into_iter().map(|index| (index, tops[index].offset)).collect()
    }

    /// True for cells with power that none of eight neighbours exceeds.
    pub fn is_local_maximum(&self, cell: [usize; 2]) -> bool {
        let [rows, columns] = self.around(cell);
        let power = self.at(cell);
        power > 0.0
            && rows
                .iter()
                .all(|row| columns.iter().all(|column| self.at([*row, *column]) <= power))
    }

    /// Top of the parabolas through the log power of a local maximum and of its four neighbours.
    pub fn top(&self, cell: [usize; 2]) -> Top {
        let [rows, columns] = self.around(cell);
        let power = self.at(cell);
        let level = power.ln();
        let over = |row, column| self.at([row, column]).max(LEAST * power).ln() - level;
        let along_rows = [over(rows[0], columns[1]), over(rows[2], columns[1])];
        let along_columns = [over(rows[1], columns[0]), over(rows[1], columns[2])];
        let (mut offset, mut above) = ([0.0; 2], 0.0);
        for (offset, [before, after]) in offset.iter_mut().zip([along_rows, along_columns]) {
            let (slope, curvature) = (before - after, (before + after).min(-FLAT));
            *offset = (0.5 * slope / curvature).clamp(-0.5, 0.5);
            above -= 0.25 * slope * *offset;
        }
        Top {
            offset,
            height: (level + above).exp(),
        }
    }

    /// Median of the cells at most `guards + trainings` rows and columns away, but those within `guards`; the map's
    /// edges are edges here. NaN if there are none.
    pub fn training_median(&self, cell: [usize; 2], guards: [usize; 2], trainings: [usize; 2]) -> f64 {
        let [rows, columns] = [0, 1].map(|axis| {
            let reach = guards[axis] + trainings[axis];
            cell[axis].saturating_sub(reach)..(cell[axis] + reach + 1).min(self.shape[axis])
        });
        let mut powers = Vec::with_capacity(rows.len() * columns.len());
        for row in rows {
            let is_beside = row.abs_diff(cell[0]) > guards[0];
            let of_row = columns
                .clone()
                .filter(|column| is_beside || column.abs_diff(cell[1]) > guards[1]);
            powers.extend(of_row.map(|column| self.at([row, column])));
        }
        let number = powers.len();
        if number == 0 {
            return f64::NAN;
        }
        let (below, middle, _) = powers.select_nth_unstable_by(number / 2, f64::total_cmp);
        let upper = *middle;
        let lower = if number % 2 == 1 {
            upper
        } else {
            below.iter().copied().fold(0.0, f64::max)
        };
        0.5 * lower + 0.5 * upper
    }

    fn at(&self, [row, column]: [usize; 2]) -> f64 {
        self.power[row * self.shape[1] + column]
    }

    /// Rows and columns before, of and after a cell.
    fn around(&self, [row, column]: [usize; 2]) -> [[usize; 3]; 2] {
        [cyclic(row, self.shape[0]), self.columns_around(column)]
    }

    fn columns_around(&self, column: usize) -> [usize; 3] {
        let width = self.shape[1];
        if self.is_cyclic || width == 1 {
            return cyclic(column, width);
        }
        let after = if column + 1 < width { column + 1 } else { width - 2 };
        [column.abs_diff(1), column, after]
    }
}

/// Cells before, of and after one of a cyclic axis.
fn cyclic(index: usize, number: usize) -> [usize; 3] {
    [(index + number - 1) % number, index, (index + 1) % number]
}

/// Noise level of every column: the median over its rows, then over `reach` columns on each side, mirrored at the ends.
///
/// Clutter that fills all rows of a column, or most columns of a map of one row, counts as noise.
fn levels(power: &[f64], width: usize, reach: usize) -> Vec<f64> {
    // Powers are not negative: their bits have their order.
    let upper_median = |mut values: Vec<u64>| {
        let middle = values.len() / 2;
        *values.select_nth_unstable(middle).1
    };
    let bits: Vec<_> = power.iter().copied().map(f64::to_bits).collect();
    let of_column = |column| bits[column..].iter().step_by(width).copied().collect();
    let of_columns: Vec<_> = (0..width).map(of_column).map(upper_median).collect();
    let (last, reach) = (width.cast_signed() - 1, reach.cast_signed());
    let mirrored = |column: isize| of_columns[(last - (column.rem_euclid((2 * last).max(1)) - last).abs()) as usize];
    let near = |column| (column - reach..=column + reach).map(mirrored).collect();
    (0..=last).map(near).map(upper_median).map(f64::from_bits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three rows; the first and the last are neighbours, too.
    const POWER: [f64; 12] = [4.0, 1.0, 2.0, 3.0, 1.0, 1.0, 8.0, 9.0, 2.0, 2.0, 4.0, 1.0];

    fn map(is_cyclic: bool) -> Map<'static> {
        Map {
            power: &POWER,
            shape: [3, 4],
            is_cyclic,
        }
    }

    #[test]
    fn local_maxima_are_those_of_neighbours_around_the_edges() {
        let maxima = |is_cyclic| {
            let map = map(is_cyclic);
            let is_maximum = |k: &usize| map.is_local_maximum([k / 4, k % 4]);
            (0..12).filter(is_maximum).collect::<Vec<_>>()
        };
        // The first cell's neighbour around the edge is the largest of all.
        assert_eq!(maxima(true), [7]);
        assert_eq!(maxima(false), [0, 7]);
    }

    #[test]
    fn maxima_exceed_their_scale_times_the_training_cells() {
        // The training cells of the last column's 9 are the first searched column: 2, 8 and 4.
        let found = |scale: f64| {
            let trained: Vec<f64> = POWER.chunks_exact(4).flat_map(|row| row[2..].to_vec()).collect();
            map(false).maxima_above(&trained, &[scale; 6], 2..4, [1, 0], [0, 1]).0
        };
        assert_eq!(found(8.9 / 14.0), [[1, 3]]);
        assert!(found(9.1 / 14.0).is_empty());
        assert!(found(0.0).is_empty());
    }

    #[test]
    fn level_of_a_column_is_the_median_of_a_mirrored_axis() {
        assert_eq!(levels(&[1.0, 5.0, 2.0, 4.0, 3.0], 5, 1), [5.0, 2.0, 4.0, 3.0, 4.0]);
        assert_eq!(levels(&[1.0, 5.0, 2.0], 3, 4), [2.0, 5.0, 2.0]); // of 1 5 2 5 1 5 2 5 1 for the first
        assert_eq!(levels(&[4.0, 7.0, 1.0], 1, 3), [4.0]);
    }

    #[test]
    fn sidelobes_of_a_stronger_echo_count_also_beside_the_searched_columns() {
        let (none, lobes) = ([0.0], [1.0; 200]);
        let sidelobes = Sidelobes {
            envelopes: [&lobes, &lobes],
            mean_envelope: &none,
            mean_gain: &[0.0; 3],
            periods: [3.0, 6.0],
            smear: 0.0,
            is_mirrored: false,
        };
        let kept = |searched, peaks: &[[usize; 2]]| {
            let found = map(false).above_sidelobes(peaks, &vec![0.0; peaks.len()], &sidelobes, searched, 0.0);
            found.into_iter().map(|(index, _)| index).collect::<Vec<_>>()
        };
        // Lobes as high as the echo itself: nothing weaker remains.
        assert_eq!(kept(0..4, &[[0, 0], [1, 3]]), [1]);
        assert_eq!(kept(0..4, &[[0, 0]]), [0]);
        assert!(kept(0..3, &[[0, 0]]).is_empty());
    }

    #[test]
    fn training_cells_are_those_beside_the_guard_cells_within_the_map() {
        // Of the third cell of the second row: the first column.
        let median = map(false).training_median([1, 2], [1, 1], [0, 1]);
        assert_eq!(median, 2.0); // of 4, 1 and 2
        // All but the first column of the first and of the last row: 1, 2, 3, 2, 4 and 1.
        assert_eq!(map(false).training_median([1, 2], [0, 1], [1, 0]), 2.0);
        assert!(map(false).training_median([1, 2], [1, 1], [0, 0]).is_nan());
    }
}
