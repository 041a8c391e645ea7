//! Counts as proportions with their interval, and scores as the area under their curve.
//!
//! ```text
//!   (k/n + z2/2n +- z sqrt(k/n (1 - k/n)/n + z2/4n2)) / (1 + z2/n)                        (1)
//!   AUROC = P(positive > negative) + P(equal)/2                                           (2)
//! ```
//!
//! # Agreement
//! `eq1_ends_where_the_score_test_turns`: to 1e-12, the proportions p at which (k/n - p)2 = z2 p (1 - p)/n.
//!
//! # References
//! \[1\] E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209 (from memory).

use std::fmt;

use serde::{Deserialize, Serialize};

/// Standard score of a two-sided 95 % interval.
const Z: f64 = 1.959_963_984_540_054;

/// k of n.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Proportion {
    /// How many were.
    pub k: usize,
    /// Of how many.
    pub n: usize,
}

impl Proportion {
    /// Counts those that hold.
    pub fn of(all: impl Iterator<Item = bool>) -> Self {
        all.fold(Self::default(), |sum, holds| Self {
            k: sum.k + usize::from(holds),
            n: sum.n + 1,
        })
    }

    /// k/n; none of nothing.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        (self.n > 0).then(|| self.k as f64 / self.n as f64)
    }

    /// 95 % interval, equation (1); 0 to 1 of nothing.
    #[must_use]
    pub fn wilson(&self) -> [f64; 2] {
        let Some(share) = self.share() else {
            return [0.0, 1.0];
        };
        let n = self.n as f64;
        let middle = share + Z * Z / (2.0 * n);
        let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
        let whole = 1.0 + Z * Z / n;
        [
            ((middle - half) / whole).max(0.0),
            ((middle + half) / whole).min(1.0),
        ]
    }
}

impl fmt::Display for Proportion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(share) = self.share() else {
            return f.write_str("-");
        };
        let [low, high] = self.wilson();
        let percent = |share: f64| share * 100.0;
        write!(
            f,
            "{}/{} = {:.0} % ({:.0}-{:.0})",
            self.k,
            self.n,
            percent(share),
            percent(low),
            percent(high)
        )
    }
}

/// (2); none where one side is empty.
#[must_use]
pub fn auroc(positive: &[f64], negative: &[f64]) -> Option<f64> {
    let pairs = positive.len() * negative.len();
    let wins = positive.iter().flat_map(|p| {
        negative.iter().map(move |n| match p.total_cmp(n) {
            std::cmp::Ordering::Greater => 1.0,
            std::cmp::Ordering::Equal => 0.5,
            std::cmp::Ordering::Less => 0.0,
        })
    });
    let wins: f64 = wins.sum();
    (pairs > 0).then(|| wins / pairs as f64)
}

/// The middle value; none of nothing.
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match (n, n % 2) {
        (0, _) => None,
        (_, 1) => Some(values[n / 2]),
        _ => Some(0.5 * (values[n / 2 - 1] + values[n / 2])),
    }
}

/// The value below which a share of all lies, between its two neighbours in proportion; none of nothing.
#[must_use]
pub fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let place = share.clamp(0.0, 1.0) * values.len().checked_sub(1)? as f64;
    let below = values.get(place.floor() as usize)?;
    let above = values.get(place.ceil() as usize)?;
    Some(below + place.fract() * (above - below))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_ends_where_the_score_test_turns() {
        for (k, n) in [(8, 10), (57, 60), (1, 1), (0, 60), (250, 500)] {
            let proportion = Proportion { k, n };
            let share = k as f64 / n as f64;
            for p in proportion.wilson() {
                let score = (share - p).powi(2) - Z * Z * p * (1.0 - p) / n as f64;
                assert!(score.abs() < 1e-12, "{k}/{n}: {p}");
            }
            let [low, high] = proportion.wilson();
            assert!((0.0..=share).contains(&low) && (share..=1.0).contains(&high));
        }
        let [low, high] = Proportion::default().wilson();
        assert!(low.abs() < 1e-15 && (high - 1.0).abs() < 1e-15);
    }

    #[test]
    fn eq2_scores_that_never_overlap_have_the_whole_area() {
        assert_eq!(auroc(&[2.0, 3.0], &[0.0, 1.0]), Some(1.0));
        assert_eq!(auroc(&[0.0, 1.0], &[2.0]), Some(0.0));
        assert_eq!(auroc(&[1.0], &[1.0]), Some(0.5));
        assert_eq!(auroc(&[], &[1.0]), None);
    }

    #[test]
    fn the_middle_of_an_even_number_is_between_two() {
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![]), None);
    }

    #[test]
    fn a_quantile_lies_between_its_neighbours() {
        let values = || (0..=10).rev().map(f64::from).collect::<Vec<f64>>();
        for (share, wanted) in [(0.0, 0.0), (0.5, 5.0), (0.95, 9.5), (1.0, 10.0)] {
            let found = quantile(values(), share).unwrap();
            assert!((found - wanted).abs() < 1e-12, "{share}: {found}");
        }
        assert_eq!(quantile(vec![], 0.5), None);
    }
}
