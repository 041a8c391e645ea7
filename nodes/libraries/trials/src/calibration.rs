//! Whether named causes are right as often as they are said to be.
//!
//! ```text
//!   ECE = sum_b n_b |mean confidence_b - share right_b| / n                               (1)
//!   Brier = sum_i (confidence_i - right_i)^2 / n                                          (2)
//! ```
//!
//! over ten bins of confidence of equal width.

use serde::{Deserialize, Serialize};

use crate::proportion::Proportion;
use crate::tally::Figure;
use crate::verdict::Verdict;

/// Bins of confidence.
const CONFIDENCE_BINS: usize = 10;

/// One bin of the reliability diagram.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reliability {
    /// Ends of the bin.
    pub bin: [f64; 2],
    /// Mean confidence of the named causes in it.
    pub confidence: f64,
    /// How many of them were right.
    pub right: Proportion,
    /// Its 95 % interval.
    pub interval: [f64; 2],
}

/// Every named cause as (confidence, whether it is right).
fn named(own: &[&Verdict]) -> Vec<(f64, bool)> {
    let all = own
        .iter()
        .flat_map(|v| v.named().map(|c| (c.confidence, v.is_right(c))));
    all.collect()
}

pub(crate) fn calibration(own: &[&Verdict]) -> [Figure; 2] {
    let named = named(own);
    let n = named.len();
    let of = |sum: f64| (n > 0).then(|| sum / n as f64);
    let brier: f64 = named
        .iter()
        .map(|(confidence, right)| (confidence - f64::from(u8::from(*right))).powi(2))
        .sum();
    let apart = reliability(own).into_iter().map(|bin| {
        let share = bin.right.share().unwrap_or(0.0);
        bin.right.n as f64 * (bin.confidence - share).abs()
    });
    [
        Figure::new(
            "expected calibration error of named causes",
            of(apart.sum()),
            n,
        ),
        Figure::new("Brier score of named causes", of(brier), n),
    ]
}

pub(crate) fn reliability(own: &[&Verdict]) -> Vec<Reliability> {
    let mut bins = vec![Vec::<(f64, bool)>::new(); CONFIDENCE_BINS];
    for (confidence, right) in named(own) {
        let place = (confidence * CONFIDENCE_BINS as f64) as usize;
        bins[place.min(CONFIDENCE_BINS - 1)].push((confidence, right));
    }
    let full = bins.iter().enumerate().filter(|(_, bin)| !bin.is_empty());
    full.map(|(place, bin)| {
        let right = Proportion::of(bin.iter().map(|(_, right)| *right));
        Reliability {
            bin: [place, place + 1].map(|edge| edge as f64 / CONFIDENCE_BINS as f64),
            confidence: bin.iter().map(|(c, _)| c).sum::<f64>() / bin.len() as f64,
            right,
            interval: right.wilson(),
        }
    })
    .collect()
}
