//! Sequentially thresholded least squares: fit all, strike out what is small, fit again.
//!
//! # Model
//!
//! ```text
//!   beta = (G_SS)^-1 b_S,   S <- { g in S: |J_g beta_g| > lambda }        (1)
//!   BIC(lambda) = z'z - b_S' beta + q ln n                                (2)
//! ```
//!
//! from S = the best form of every effect until S stays the same; lambda, a size in standard deviations, is the one of
//! [`THRESHOLDS`] with the least (2).
//!
//! # References
//! \[1\] S. L. Brunton, J. L. Proctor, J. N. Kutz, PNAS 113 (2016) 3932 (sequential thresholding; from memory).

use std::collections::BTreeSet;

use gap_diagnosis::regression::Regression;

use super::{best_forms, fit};

/// Sizes below which an effect is struck out.
const THRESHOLDS: [f64; 7] = [2.0, 3.0, 4.5, 6.5, 10.0, 15.0, 25.0];

pub(super) fn chosen(regression: &Regression) -> BTreeSet<usize> {
    let all = best_forms(regression);
    let mut best = (regression.square, vec![]);
    for least in THRESHOLDS {
        let kept = thresholded(regression, all.clone(), least);
        let parameters: usize = kept
            .iter()
            .map(|place| regression.candidates[*place].parameters)
            .sum();
        let gain = fit(regression, &columns(regression, &kept)).gain;
        let price = parameters as f64 * regression.freedom.ln();
        let score = regression.square - gain + price;
        if score < best.0 {
            best = (score, kept);
        }
    }
    let kept = best.1.into_iter();
    kept.map(|place| regression.candidates[place].effect)
        .collect()
}

/// (1).
fn thresholded(regression: &Regression, mut kept: Vec<usize>, least: f64) -> Vec<usize> {
    loop {
        let sizes = fit(regression, &columns(regression, &kept)).sizes;
        let mut first = 0;
        let large: Vec<usize> = kept
            .iter()
            .copied()
            .filter(|place| {
                let own = regression.candidates[*place].columns.clone();
                let part = sizes.rows(first, own.len());
                first += own.len();
                let gram = regression
                    .gram
                    .view((own.start, own.start), (own.len(), own.len()));
                part.dot(&(gram * part)).max(0.0).sqrt() > least
            })
            .collect();
        if large.len() == kept.len() {
            return kept;
        }
        kept = large;
    }
}

fn columns(regression: &Regression, kept: &[usize]) -> Vec<usize> {
    let all = kept.iter().map(|place| &regression.candidates[*place]);
    all.flat_map(|candidate| candidate.columns.clone())
        .collect()
}
