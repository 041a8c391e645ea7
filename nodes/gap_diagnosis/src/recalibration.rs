//! From the probability that the catalogue gives to the share of right names that trials saw at it.
//!
//! # Model
//!
//! ```text
//!   confidence = f(p), f rising, linear between the points of the table   (1)
//! ```
//!
//! p of `confidence` holds as far as the catalogue holds the truth. Trials on other physics than the catalogue's
//! show how often names at p were right; their isotonic fit is the table. It is measured by trials of their own,
//! never by those that judge the diagnosis.
//!
//! # Holds when
//! [`PROVENANCE`] names trials. Until then the table is the identity, a page says so, and a confidence above 0.9
//! means "no rival in the catalogue", not one error in ten.
//!
//! # References
//! \[1\] B. Zadrozny, C. Elkan, Transforming classifier scores into accurate multiclass probability estimates,
//! KDD 2002 (isotonic recalibration).

use crate::config::GapConfig;
use crate::rule::Rule;

/// Where a table is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// Trials that it was fitted to.
    pub trials: u32,
    /// The arm of those trials.
    pub arm: &'static str,
}

/// Points of f: probability, share of right names; both rise from 0 to 1.
pub const TABLE: &[[f64; 2]] = &[[0.0, 0.0], [1.0, 1.0]];
/// Trials behind [`TABLE`]: none yet.
pub const PROVENANCE: Option<Provenance> = None;

/// (1); the probability itself where that rule is switched off.
pub fn recalibrated(config: &GapConfig, probability: f64) -> f64 {
    if config.applies(Rule::Recalibration) {
        along(TABLE, probability)
    } else {
        probability
    }
}

fn along(table: &[[f64; 2]], probability: f64) -> f64 {
    let after = table.partition_point(|[p, _]| *p < probability);
    let (Some([q, g]), Some([p, f])) = (table.get(after), table.get(after.saturating_sub(1)))
    else {
        return table.last().map_or(probability, |[_, f]| *f);
    };
    if after == 0 || q <= p {
        return *g;
    }
    f + (g - f) * (probability - p) / (q - p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_rises_from_nothing_to_certainty_and_is_the_identity_without_trials() {
        assert_eq!(TABLE.first(), Some(&[0.0, 0.0]));
        assert_eq!(TABLE.last(), Some(&[1.0, 1.0]));
        for pair in TABLE.windows(2) {
            assert!(
                pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1],
                "{pair:?}"
            );
        }
        for p in [0.0, 0.3, 0.97, 1.0] {
            let is_identity = (recalibrated(&GapConfig::default(), p) - p).abs() < 1e-12;
            assert!(is_identity || PROVENANCE.is_some(), "{p}");
        }
    }

    #[test]
    fn eq1_is_linear_between_points() {
        let table = [[0.0, 0.0], [0.5, 0.2], [1.0, 1.0]];
        for (p, wanted) in [(0.0, 0.0), (0.25, 0.1), (0.5, 0.2), (0.75, 0.6), (1.0, 1.0)] {
            assert!((along(&table, p) - wanted).abs() < 1e-12, "{p}");
        }
    }
}
