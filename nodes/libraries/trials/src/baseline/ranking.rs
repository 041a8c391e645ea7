//! The effect that explains most by itself.
//!
//! ```text
//!   R2_g = max over forms of b' G^-1 b / z'z                              (1)
//! ```
//!
//! The greatest is named where its gain is more than its price; a ballbar's ranking names one in any case, and would
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
