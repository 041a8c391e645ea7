//! Makes the noise of every row one and independent of the others.
//!
//! # Model
//!
//! Noise of a block is an autoregression (of which the white part of `form_error` is one more term) plus the
//! smooth fields of `field` and `form_error`, B Lambda B' in covariance:
//!
//! ```text
//!   x_t = (y_t - sum_j phi_j y_(t-j)) / v_p                               (1)
//!   W = (I + U S^2 U')^(-1/2) = I - U (1 - 1 / sqrt(1 + S^2)) U'          (2)
//! ```
//!
//! with U S the singular vectors and values of the filtered B Lambda^(1/2). The first rows of a block are
//! predicted with fewer terms (Levinson's recursion), so that (1) is exact from the first row.
//!
//! R repeats share one error of form F, which is in none of their differences. With F as though each had its own of R times the
//! variance (`form_error`), W of (2) is right of their mean alone. At targets, whose rows are the same in every repeat, both have
//! their own, and the repeats are white together, as Cov y = E (I - J/R) + (E + R F) J/R with J of ones:
//!
//! ```text
//!   x_r = W_E (y_r - mean y) + W_(E + R F) mean y                         (3)
//! ```
//!
//! # Holds when
//! Rows of a block follow each other at one spacing in time.
//!
//! # References
//! \[1\] G. E. P. Box, G. M. Jenkins, G. C. Reinsel, Time Series Analysis, 4th ed., Wiley 2008, 3.2
//! (autoregression, recursion).

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use twin::{Channel, Run, Session};

use crate::noise::form_error::{self, FormError};
use crate::noise::repeats::Label;
use crate::search::field::{self, Smooth};
use crate::search::rows::{Block, Rows, count};

/// Autoregression of a channel: predictors of order 0 to p with the variance that each leaves.
#[derive(Clone, Debug, PartialEq)]
pub struct Autoregression {
    /// Coefficients of order 0, 1, .. p.
    pub coefficients: Vec<Vec<f64>>,
    /// Variance that the predictor of each order leaves, mm2.
    pub variances: Vec<f64>,
}

impl Autoregression {
    /// White noise of a variance.
    pub fn white(variance_mm2: f64) -> Self {
        Self {
            coefficients: vec![vec![]],
            variances: vec![variance_mm2],
        }
    }

    /// Levinson's recursion from autocovariances of lag 0 to p; stops where it would not be stationary.
    pub fn levinson(autocovariance: &[f64]) -> Self {
        let mut all = Self::white(autocovariance[0]);
        for order in 1..autocovariance.len() {
            let before = &all.coefficients[order - 1];
            let left = all.variances[order - 1];
            let told: f64 = before
                .iter()
                .enumerate()
                .map(|(j, phi)| phi * autocovariance[order - 1 - j])
                .sum();
            let reflection = (autocovariance[order] - told) / left;
            if !reflection.is_finite() || reflection.abs() >= 0.999 {
                break;
            }
            let mut next: Vec<f64> = (0..before.len())
                .map(|j| before[j] - reflection * before[before.len() - 1 - j])
                .collect();
            next.push(reflection);
            all.coefficients.push(next);
            all.variances.push(left * (1.0 - reflection.powi(2)));
        }
        all
    }

    /// The same noise with white noise beside it, to the order that is wanted.
    ///
    /// Where the noise is no white one itself the sum is an autoregression of no finite order; three terms leave
    /// less than the repeats tell of it.
    pub fn with_white(&self, variance_mm2: f64, order: usize) -> Self {
        if variance_mm2 <= 0.0 {
            return self.clone();
        }
        let mut all = vec![self.variances[0]];
        for lag in 1..=order.max(self.order()) {
            let told = self.coefficients[lag.min(self.order())].iter().enumerate();
            all.push(told.map(|(j, phi)| phi * all[lag - 1 - j]).sum());
        }
        all[0] += variance_mm2;
        Self::levinson(&all)
    }

    /// The same noise with another variance.
    pub fn scaled(&self, ratio: f64) -> Self {
        let mut scaled = self.clone();
        for variance in &mut scaled.variances {
            *variance *= ratio;
        }
        scaled
    }

    /// Keeps the orders up to one.
    pub fn up_to(mut self, order: usize) -> Self {
        self.coefficients.truncate(order + 1);
        self.variances.truncate(order + 1);
        self
    }

    /// Greatest order.
    pub fn order(&self) -> usize {
        self.coefficients.len() - 1
    }

    /// (1), in place.
    pub fn filter(&self, rows: &mut [f64]) {
        let order = self.order();
        let (phi, scatter) = (&self.coefficients[order], self.variances[order].sqrt());
        for t in (order..rows.len()).rev() {
            let (before, rest) = rows.split_at_mut(t);
            let latest_first = before.iter().rev();
            let told: f64 = phi
                .iter()
                .zip(latest_first)
                .map(|(phi, row)| phi * row)
                .sum();
            rest[0] = (rest[0] - told) / scatter;
        }
        // The first rows have fewer before them.
        for t in (0..order.min(rows.len())).rev() {
            let [told, scatter] = self.told(rows, t);
            rows[t] = (rows[t] - told) / scatter;
        }
    }

    /// Undoes [`Self::filter`], in place.
    pub fn unfilter(&self, rows: &mut [f64]) {
        for t in 0..rows.len() {
            let [told, scatter] = self.told(rows, t);
            rows[t] = rows[t] * scatter + told;
        }
    }

    /// What the rows before one tell of it, and the standard deviation about that.
    fn told(&self, rows: &[f64], t: usize) -> [f64; 2] {
        let used = self.order().min(t);
        let before = self.coefficients[used].iter().enumerate();
        let told = before.map(|(j, phi)| phi * rows[t - 1 - j]).sum();
        [told, self.variances[used].sqrt()]
    }
}

/// Order of an autoregression with white noise beside it.
const WHITE_ORDER: usize = 3;

/// (2) of every block, and (3) of groups of repeats.
#[derive(Clone, Debug)]
pub struct Whitener {
    blocks: Vec<BlockWhitener>,
    /// Groups of repeats whose differences have no error of form.
    apart: Vec<Apart>,
}

#[derive(Clone, Debug)]
struct BlockWhitener {
    range: Range<usize>,
    filter: Autoregression,
    vectors: DMatrix<f64>,
    shrink: DVector<f64>,
}

/// Repeats of one test with the same rows.
#[derive(Clone, Debug)]
struct Apart {
    /// Their blocks.
    blocks: Vec<usize>,
    /// W_E of (3).
    differences: BlockWhitener,
}

impl Whitener {
    /// The whitener of a stack; `noise` gives autoregression and field of a block's channel.
    pub fn new<'n>(
        session: &Session,
        rows: &Rows,
        noise: impl Fn(&Block) -> (Autoregression, &'n Smooth),
        form: &FormError,
    ) -> Self {
        let sharing = form_error::sharing(session, rows);
        let touched = form_error::touched(session, rows);
        let of_block = |(block, sharing): (&Block, &f64)| {
            let run = &session.runs[block.run];
            BlockWhitener::new(run, block, noise(block), (form, *sharing), &touched)
        };
        let of_group = |blocks: Vec<usize>| {
            let first = &rows.blocks[blocks[0]];
            let run = &session.runs[first.run];
            let nothing = (&FormError::default(), 1.0);
            let differences = BlockWhitener::new(run, first, noise(first), nothing, &touched);
            Apart {
                blocks,
                differences,
            }
        };
        let alike = if form.is_of_targets() {
            form_error::alike(session, rows)
        } else {
            vec![]
        };
        Self {
            blocks: rows.blocks.iter().zip(&sharing).map(of_block).collect(),
            apart: alike.into_iter().map(of_group).collect(),
        }
    }

    /// Whitens a stack, in place.
    pub fn apply(&self, stack: &mut [f64]) {
        let differences = self.differences(stack, |one, part| one.apply(part));
        for block in &self.blocks {
            block.apply(&mut stack[block.range.clone()]);
        }
        add(stack, &differences);
    }

    /// A whitened stack in mm again, without what the smooth fields took, in place.
    pub fn unfilter(&self, stack: &mut [f64]) {
        let differences = self.differences(stack, |one, part| one.filter.unfilter(part));
        for block in &self.blocks {
            block.filter.unfilter(&mut stack[block.range.clone()]);
        }
        add(stack, &differences);
    }

    /// Leaves the mean of each group in its blocks, and gives what `of` makes of the differences from it.
    fn differences(
        &self,
        stack: &mut [f64],
        of: impl Fn(&BlockWhitener, &mut [f64]),
    ) -> Vec<(Range<usize>, Vec<f64>)> {
        let mut all = vec![];
        for group in &self.apart {
            let ranges = || {
                group
                    .blocks
                    .iter()
                    .map(|block| self.blocks[*block].range.clone())
            };
            let mut mean = vec![0.0; group.differences.range.len()];
            for (sum, k) in mean.iter_mut().zip(0..) {
                let sums: f64 = ranges().map(|range| stack[range.start + k]).sum();
                *sum = sums / count(group.blocks.len());
            }
            for range in ranges() {
                let part = &mut stack[range.clone()];
                let rows = part.iter().zip(&mean);
                let mut difference: Vec<f64> = rows.map(|(row, mean)| row - mean).collect();
                of(&group.differences, &mut difference);
                part.copy_from_slice(&mean);
                all.push((range, difference));
            }
        }
        all
    }
}

fn add(stack: &mut [f64], differences: &[(Range<usize>, Vec<f64>)]) {
    for (range, difference) in differences {
        for (row, more) in stack[range.clone()].iter_mut().zip(difference) {
            *row += more;
        }
    }
}

impl BlockWhitener {
    /// (2) of a block with an error of form that so many repeats share.
    fn new(
        run: &Run,
        block: &Block,
        (within, between): (Autoregression, &Smooth),
        (form, sharing): (&FormError, f64),
        touched: &BTreeMap<Label, f64>,
    ) -> Self {
        let size = form.of(block) * sharing.sqrt();
        let (kinds, mut columns) = field::modes(run, block);
        let is_touch = block.channel == Channel::Touch;
        let (filter, form_field) = if is_touch {
            (within, Smooth::default())
        } else {
            let rough_mm2 = (form_error::ROUGH_STATION_SHARE * size).powi(2);
            (
                within.with_white(rough_mm2, WHITE_ORDER),
                form_error::smooth(size),
            )
        };
        for (kind, mut column) in kinds.iter().zip(columns.column_iter_mut()) {
            column *= form_error::joined(between, &form_field, *kind);
        }
        let of_touches = form_error::touch_columns(run, block, touched)
            .into_iter()
            .map(|(column, repeats)| {
                let size = form.of(block) * repeats.sqrt();
                column.into_iter().map(|v| v * size).collect::<Vec<f64>>()
            });
        let of_edges = form.edges(block).iter().map(|(row, height)| {
            let mut column = vec![0.0; block.rows.len()];
            column[*row] = height * sharing.sqrt();
            column
        });
        let more: Vec<Vec<f64>> = of_touches.into_iter().chain(of_edges).collect();
        let mut columns = form_error::beside(columns, &more);
        for mut column in columns.column_iter_mut() {
            filter.filter(column.as_mut_slice());
        }
        let (vectors, singular) = singular(&columns);
        Self {
            range: block.range(),
            filter,
            vectors,
            shrink: singular.map(|s| 1.0 - 1.0 / (1.0 + s * s).sqrt()),
        }
    }

    /// Whitens the rows of the block, in place.
    fn apply(&self, rows: &mut [f64]) {
        self.filter.filter(rows);
        let n = rows.len();
        let mut part = nalgebra::DVectorViewMut::from_slice(rows, n);
        let mut along = self.vectors.tr_mul(&part);
        along.component_mul_assign(&self.shrink);
        part.gemv(-1.0, &self.vectors, &along, 1.0);
    }
}

/// Left singular vectors and singular values of a tall matrix, those of size only.
fn singular(columns: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let eigen = SymmetricEigen::new(columns.tr_mul(columns));
    let keep: Vec<usize> = (0..eigen.eigenvalues.len())
        .filter(|k| eigen.eigenvalues[*k] > 1e-6)
        .collect();
    let values = DVector::from_iterator(
        keep.len(),
        keep.iter().map(|k| eigen.eigenvalues[*k].sqrt()),
    );
    let mut vectors = columns * eigen.eigenvectors.select_columns(&keep);
    for (mut vector, value) in vectors.column_iter_mut().zip(values.iter()) {
        vector /= *value;
    }
    (vectors, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_noise_beside_white_noise_adds_up() {
        let both = Autoregression::white(3.0).with_white(1.0, 3);
        assert!((both.variances[3] - 4.0).abs() < 1e-12);
        assert!(both.coefficients[3].iter().all(|phi| phi.abs() < 1e-12));
    }

    #[test]
    fn eq1_is_undone() {
        let one = Autoregression::levinson(&[2.0, 1.2, 0.9]);
        let told = [0.4, -1.0, 2.5, 0.1, 0.0, -0.7];
        let mut rows = told;
        one.filter(&mut rows);
        assert!((rows[3] - told[3]).abs() > 0.1);
        one.unfilter(&mut rows);
        for (row, told) in rows.iter().zip(told) {
            assert!((row - told).abs() < 1e-12, "{rows:?}");
        }
    }

    #[test]
    fn eq1_white_noise_beside_an_autoregression_keeps_its_autocovariances() {
        // An autoregression of first order with phi 0.6 and variance 1: 0.6^lag.
        let one = Autoregression::levinson(&[1.0, 0.6]);
        let both = one.with_white(0.5, 3);
        // Yule and Walker's equations of the sum, solved by hand for order one: 0.6 / 1.5.
        assert!((both.coefficients[1][0] - 0.4).abs() < 1e-12);
        assert!((both.variances[0] - 1.5).abs() < 1e-12);
        for row in 0..3_usize {
            let lag = |a: usize| {
                let far = a.abs_diff(row);
                0.6_f64.powi(i32::try_from(far).expect("small")) + if far == 0 { 0.5 } else { 0.0 }
            };
            let told: f64 = (0..3).map(|j| both.coefficients[3][j] * lag(j)).sum();
            let expected = 0.6_f64.powi(i32::try_from(row + 1).expect("small"));
            assert!((told - expected).abs() < 1e-12, "{row}");
        }
        assert_eq!(one.with_white(0.0, 3), one);
    }
}
