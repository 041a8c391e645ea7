//! How noisy each channel is by itself, and sizes of what comes beside it.
//!
//! Every row has one level, so that levels are taken out of all else block by block; what is left is solved as a whole
//! (Frisch and Waugh).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use twin::Channel;

use super::squares::{is_touch, passed};
use crate::judgement::cause::Scope;
use crate::noise::normal::Normal;
use crate::search::rows::{Row, count};

/// The floor of a block of rows that no other has a share in.
pub(super) struct Levels {
    /// Whose it is, of each row.
    of: Vec<usize>,
    /// What one unit of it makes of each row.
    value: DVector<f64>,
    /// How many there are.
    count: usize,
}

impl Levels {
    /// Something of the rows beside the levels, both over a scatter.
    pub(super) fn beside(&self, mut rows: DVector<f64>, scatter: &DVector<f64>) -> DVector<f64> {
        let value = self.value.component_div(scatter);
        let mut along = vec![[0.0; 2]; self.count];
        for (row, of) in self.of.iter().enumerate() {
            along[*of][0] += value[row] * rows[row];
            along[*of][1] += value[row] * value[row];
        }
        for (row, of) in self.of.iter().enumerate() {
            let [sum, square] = along[*of];
            rows[row] -= value[row] * sum / square.max(f64::MIN_POSITIVE);
        }
        rows
    }
}

/// g: of a path for each of its runs, for it is as noisy as its feed makes it; touches have one for all.
pub(super) fn levels(scope: &Scope<'_, '_>, scales: &BTreeMap<Channel, f64>) -> Levels {
    let rows = scope.stack.rows.len;
    let mut known = BTreeMap::<(&Channel, usize), usize>::new();
    let (mut of, mut value) = (vec![0; rows], DVector::zeros(rows));
    for block in &scope.stack.rows.blocks {
        let even = vec![1.0; block.rows.len()];
        let own = if scales.contains_key(&block.channel) {
            even
        } else {
            passed(scope, block, &even)
        };
        let run = if is_touch(block) { 0 } else { block.run };
        let next = known.len();
        let whose = *known.entry((&block.channel, run)).or_insert(next);
        of[block.range()].fill(whose);
        value.as_mut_slice()[block.range()].copy_from_slice(&own);
    }
    Levels {
        of,
        value,
        count: known.len(),
    }
}

/// Columns of e / m, of every channel whose rows are means.
pub(super) fn means(scope: &Scope<'_, '_>) -> Vec<DVector<f64>> {
    let mut columns = BTreeMap::<&Channel, DVector<f64>>::new();
    let blocks = scope.stack.rows.blocks.iter();
    for block in blocks.filter(|block| !is_touch(block)) {
        let of_row = |row: &Row| 1.0 / count(row.readings.len());
        let of_readings: Vec<f64> = block.rows.iter().map(of_row).collect();
        let column = columns
            .entry(&block.channel)
            .or_insert_with(|| DVector::zeros(scope.stack.rows.len));
        let own = passed(scope, block, &of_readings);
        column.as_mut_slice()[block.range()].copy_from_slice(&own);
    }
    columns.into_values().collect()
}

/// Sizes of columns by least squares, of which none is negative: those that would be are left out.
pub(super) fn positive(columns: &[DVector<f64>], rows: &DVector<f64>) -> Vec<f64> {
    let mut sizes = vec![0.0; columns.len()];
    if columns.is_empty() {
        return sizes;
    }
    let normal = Normal::new(&DMatrix::from_columns(columns), rows);
    let mut kept: Vec<usize> = (0..columns.len()).collect();
    while !kept.is_empty() {
        let found = normal.solve(&kept).sizes;
        let least = (0..kept.len()).min_by(|a, b| found[*a].total_cmp(&found[*b]));
        match least.filter(|place| found[*place] < 0.0) {
            Some(place) => {
                kept.remove(place);
            }
            None => {
                for (column, size) in kept.iter().zip(found) {
                    sizes[*column] = size;
                }
                break;
            }
        }
    }
    sizes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_taken_out_block_by_block() {
        let levels = Levels {
            of: vec![0, 0, 1, 1, 1],
            value: DVector::from_vec(vec![1.0, 1.0, 2.0, 2.0, 2.0]),
            count: 2,
        };
        let even = DVector::from_element(5, 1.0);
        let rows = DVector::from_vec(vec![1.0, 3.0, 10.0, 11.0, 12.0]);
        let left = levels.beside(rows, &even);
        let expected = DVector::from_vec(vec![-1.0, 1.0, -1.0, 0.0, 1.0]);
        assert!((left - expected).norm() < 1e-12);
    }

    #[test]
    fn a_size_that_would_be_negative_is_left_out_and_the_others_solved_without_it() {
        let columns = [
            DVector::from_vec(vec![1.0, 0.0, 0.0]),
            DVector::from_vec(vec![1.0, 1.0, 0.0]),
        ];
        let rows = DVector::from_vec(vec![1.0, 3.0, 0.0]);
        // Freely solved: -2 and 3; the second alone is 4 / 2.
        let sizes = positive(&columns, &rows);
        assert!(
            sizes[0] == 0.0 && (sizes[1] - 2.0).abs() < 1e-9,
            "{sizes:?}"
        );
    }
}
