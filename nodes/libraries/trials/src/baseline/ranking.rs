//! The effect that explains most by itself.
//!
//! ```text
//!   R2_g = max over forms of b' G^-1 b / z'z                              (1)
//! ```
//!
//! | symbol | here |
//! |---|---|
//! | z | whitened rows, set-ups floated |
//! | b | inner products of the form's columns with z |
//! | G | inner products of the columns with each other |
//!
//! b' G^-1 b is the gain in chi-square. The effect with the greatest is named where that is more than the form's price
//! (`Regression::price`, chi-square); a ballbar's ranking names one in any case, and would
//! name one on every healthy machine.

use std::collections::BTreeSet;

use gap_diagnosis::regression::Regression;

use super::{best_forms, fit};

pub(super) fn chosen(regression: &Regression) -> BTreeSet<usize> {
    let gains = best_forms(regression).into_iter().map(|place| {
        let candidate = &regression.candidates[place];
        let columns: Vec<usize> = candidate.columns.clone().collect();
        (fit(regression, &columns).gain, candidate)
    });
    let best = gains.max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(gain, candidate)| *gain > regression.price(1, candidate.parameters))
        .map(|(_, candidate)| candidate.effect)
        .into_iter()
        .collect()
}
