//! Sparse matrices in compressed rows.

use std::sync::Arc;

use super::vectors::for_each_chunk;

/// Where the entries of a sparse matrix are: compressed rows, columns ascending within each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern {
    /// Row starts into `columns`, one more than there are rows.
    pub starts: Vec<usize>,
    /// The column of each entry.
    pub columns: Vec<u32>,
}

impl Pattern {
    /// How many rows there are.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// The entries of a row, as a range into `columns`.
    ///
    /// # Panics
    /// Where there is no such row.
    #[must_use]
    pub fn row(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row]..self.starts[row + 1]
    }

    /// The entry of the diagonal in each row; `None` where a row lacks it.
    #[must_use]
    pub fn diagonal(&self) -> Option<Vec<usize>> {
        (0..self.rows())
            .map(|row| {
                let range = self.row(row);
                let found =
                    self.columns[range.clone()].binary_search(&u32::try_from(row).ok()?).ok()?;
                Some(range.start + found)
            })
            .collect()
    }
}

/// A sparse matrix.
#[derive(Debug, Clone)]
pub struct Matrix {
    /// Where the entries are.
    pub pattern: Arc<Pattern>,
    /// The entries.
    pub values: Vec<f64>,
    /// How many columns there are.
    pub columns: usize,
}

impl Matrix {
    /// A square matrix of zeros.
    #[must_use]
    pub fn zeros(pattern: Arc<Pattern>) -> Self {
        let (values, columns) = (vec![0.0; pattern.columns.len()], pattern.rows());
        Self { pattern, values, columns }
    }

    /// The first `rows` rows and columns.
    #[must_use]
    pub fn leading_block(&self, rows: usize) -> Self {
        let mut starts = vec![0];
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        for row in 0..rows {
            let range = self.pattern.row(row);
            let inside = self.pattern.columns[range.clone()]
                .partition_point(|&column| (column as usize) < rows);
            columns.extend_from_slice(&self.pattern.columns[range.start..range.start + inside]);
            values.extend_from_slice(&self.values[range.start..range.start + inside]);
            starts.push(columns.len());
        }
        Self { pattern: Arc::new(Pattern { starts, columns }), values, columns: rows }
    }

    /// `result = self * vector`.
    pub fn multiply(&self, vector: &[f64], result: &mut [f64]) {
        for_each_chunk(result, |start, chunk| {
            for (offset, value) in chunk.iter_mut().enumerate() {
                *value = self.row_times(start + offset, vector);
            }
        });
    }

    /// `result = right - self * vector`.
    pub fn residual(&self, right: &[f64], vector: &[f64], result: &mut [f64]) {
        for_each_chunk(result, |start, chunk| {
            for (offset, value) in chunk.iter_mut().enumerate() {
                *value = right[start + offset] - self.row_times(start + offset, vector);
            }
        });
    }

    /// One row times a vector.
    #[inline]
    #[must_use]
    pub fn row_times(&self, row: usize, vector: &[f64]) -> f64 {
        let range = self.pattern.row(row);
        let mut total = 0.0;
        for (value, &column) in self.values[range.clone()].iter().zip(&self.pattern.columns[range])
        {
            total += value * vector[column as usize];
        }
        total
    }

    /// One row times vectors of three components at once.
    #[inline]
    #[must_use]
    pub fn row_times_tuples(&self, row: usize, vector: &[[f64; 3]]) -> [f64; 3] {
        let range = self.pattern.row(row);
        let mut total = [0.0; 3];
        for (value, &column) in self.values[range.clone()].iter().zip(&self.pattern.columns[range])
        {
            let entry = &vector[column as usize];
            total[0] += value * entry[0];
            total[1] += value * entry[1];
            total[2] += value * entry[2];
        }
        total
    }

    /// The transpose.
    #[must_use]
    pub fn transpose(&self) -> Self {
        let mut starts = vec![0usize; self.columns + 1];
        for &column in &self.pattern.columns {
            starts[column as usize + 1] += 1;
        }
        for row in 0..self.columns {
            starts[row + 1] += starts[row];
        }
        let mut next = starts.clone();
        let mut columns = vec![0u32; self.values.len()];
        let mut values = vec![0.0; self.values.len()];
        for row in 0..self.pattern.rows() {
            for entry in self.pattern.row(row) {
                let slot = &mut next[self.pattern.columns[entry] as usize];
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "rows are numbered as vertices are, in 32 bits"
                )]
                {
                    columns[*slot] = row as u32;
                }
                values[*slot] = self.values[entry];
                *slot += 1;
            }
        }
        Self {
            pattern: Arc::new(Pattern { starts, columns }),
            values,
            columns: self.pattern.rows(),
        }
    }

    /// The product of two sparse matrices (Gustavson 1978).
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        let mut starts = vec![0usize];
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        let mut place = vec![usize::MAX; other.columns];
        let mut row_columns: Vec<u32> = Vec::new();
        let mut accumulated = vec![0.0; other.columns];
        for row in 0..self.pattern.rows() {
            row_columns.clear();
            for entry in self.pattern.row(row) {
                let middle = self.pattern.columns[entry] as usize;
                let factor = self.values[entry];
                for inner in other.pattern.row(middle) {
                    let column = other.pattern.columns[inner];
                    if place[column as usize] != row {
                        place[column as usize] = row;
                        accumulated[column as usize] = 0.0;
                        row_columns.push(column);
                    }
                    accumulated[column as usize] += factor * other.values[inner];
                }
            }
            row_columns.sort_unstable();
            columns.extend_from_slice(&row_columns);
            values.extend(row_columns.iter().map(|&column| accumulated[column as usize]));
            starts.push(columns.len());
        }
        Self { pattern: Arc::new(Pattern { starts, columns }), values, columns: other.columns }
    }
}
