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
//! [`PROVENANCE`] names trials; without, the table is the identity and a page says so. The machines of those trials are of
//! one kind: on others a confidence says which name is surer, and not how often it is right.
//!
//! # References
//! \[1\] B. Zadrozny, C. Elkan, Transforming classifier scores into accurate multiclass probability estimates,
//! KDD 2002 (isotonic recalibration).

use crate::config::GapConfig;
use crate::judgement::rule::Rule;

/// Where a table is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// Trials that it was fitted to.
    pub trials: u32,
    /// The arms of those trials.
    pub arm: &'static str,
}

/// Points of f: probability, share of right names; both rise. Of names with a p of 0.2 to 0.5 3 of 5 were right, to 0.8 15
/// of 22, to 0.95 31 of 35, to 0.99 82 of 90, to 0.999999 83 of 92, which together with those before is 165 of 182,
/// beyond 670 of 673.
pub const TABLE: &[[f64; 2]] = &[
    [0.0, 0.0],
    [0.4, 0.6],
    [0.65, 0.68],
    [0.91, 0.89],
    [0.98, 0.905],
    [0.999_99, 0.908],
    [0.999_999, 0.97],
    [1.0, 0.9955],
];
/// Trials behind [`TABLE`]: 500 of arm i and 500 of arm iii that were judged by commit 7f82715, and judge nothing later.
pub const PROVENANCE: Option<Provenance> = Some(Provenance {
    trials: 1000,
    arm: "i, iii",
});

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
    fn the_table_rises_from_nothing_and_promises_certainty_to_nobody() {
        assert_eq!(TABLE.first(), Some(&[0.0, 0.0]));
        assert!(TABLE.last().is_some_and(|[p, f]| *p >= 1.0 && *f < 1.0));
        for pair in TABLE.windows(2) {
            assert!(
                pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1],
                "{pair:?}"
            );
        }
        assert!(PROVENANCE.is_some_and(|behind| behind.trials >= 100));
    }

    #[test]
    fn a_diagnosis_without_this_rule_tells_the_probability_itself() {
        let mut config = GapConfig::default();
        assert!(recalibrated(&config, 0.97) < 0.91);
        config.ablated = [Rule::Recalibration].into();
        assert!((recalibrated(&config, 0.97) - 0.97).abs() < 1e-12);
    }

    #[test]
    fn eq1_is_linear_between_points() {
        let table = [[0.0, 0.0], [0.5, 0.2], [1.0, 1.0]];
        for (p, wanted) in [(0.0, 0.0), (0.25, 0.1), (0.5, 0.2), (0.75, 0.6), (1.0, 1.0)] {
            assert!((along(&table, p) - wanted).abs() < 1e-12, "{p}");
        }
    }
}
