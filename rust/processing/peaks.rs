//! Peaks of a map of powers over velocity and range: where they are between the cells, and the noise around them.

/// Least power of neighbours relative to their peak, because zero has no logarithm.
const LEAST: f64 = 1e-30;

/// Curvature of the log power instead of none; neighbours are as high as the peak then, and there is no slope.
const FLAT: f64 = 1e-30;

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

impl Map<'_> {
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
        let [height, width] = self.shape;
        let cyclic = |index: usize, number: usize| [(index + number - 1) % number, index, (index + 1) % number];
        let mut columns = cyclic(column, width);
        if !self.is_cyclic && width > 1 {
            columns[0] = column.abs_diff(1);
            columns[2] = if column + 1 < width { column + 1 } else { width - 2 };
        }
        [cyclic(row, height), columns]
    }
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
    fn top_is_that_of_a_gaussian() {
        // exp(-(x - 0.3)^2) over columns of one row.
        let power: Vec<f64> = (0..5)
            .map(|column| (-(f64::from(column) - 2.3).powi(2)).exp())
            .collect();
        let map = Map {
            power: &power,
            shape: [1, 5],
            is_cyclic: false,
        };
        let top = map.top([0, 2]);
        assert!((top.offset[1] - 0.3).abs() < 1e-14 && top.offset[0] == 0.0);
        assert!((top.height - 1.0).abs() < 1e-14);
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
