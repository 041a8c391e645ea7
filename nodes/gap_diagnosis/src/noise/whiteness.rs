//! Whether what is left is white: a remark beside the search, which decides nothing.
//!
//! # Model
//!
//! ```text
//!   Q = n (n + 2) sum_(k=1..m) r_k2 / (n - k),   chi-square of m          (1)
//! ```
//!
//! over every block of rows that is long enough, r_k its autocorrelation. Blocks of white noise fail at 1 % one
//! time in a hundred; a channel is called not white where more fail than noise would in one of a thousand sessions.
//! The error of form that every simulator is granted (`form_error`) colours rows that have less of it, so that this is said of
//! machines with nothing hidden as well; whether a search may stop is asked of families and channels (`unknown`).
//!
//! # Agreement
//! `val_statsmodels_acorr_ljungbox`: 1e-5 of Q and p on sixty fixed numbers.
//!
//! # References
//! \[1\] G. M. Ljung, G. E. P. Box, Biometrika 65, 1978.

use std::collections::BTreeMap;

use nalgebra::DVector;
use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF};

use crate::noise::stack::Stack;
use crate::search::rows::count;

/// Lags of (1).
const TESTED_LAGS: usize = 10;
/// Shortest block that is tested.
const SHORTEST: usize = 40;
/// Probability at which a block fails.
const LEVEL: f64 = 0.01;
/// Share of sessions of white noise in which a channel is called not white.
const SESSIONS: f64 = 0.001;

/// A channel with more failing blocks than white noise has.
#[derive(Clone, Debug, PartialEq)]
pub struct Coloured {
    /// Channel.
    pub channel: String,
    /// Blocks that fail.
    pub blocks: usize,
    /// Blocks that were tested.
    pub of: usize,
}

/// (1) and its probability.
pub fn ljung_box(values: &[f64], lags: usize) -> (f64, f64) {
    let n = count(values.len());
    let mean = values.iter().sum::<f64>() / n;
    let product = |lag: usize| -> f64 {
        let pairs = values.iter().zip(&values[lag..]);
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum()
    };
    let square = product(0);
    if square <= 0.0 {
        return (0.0, 1.0);
    }
    let term = |lag: usize| (product(lag) / square).powi(2) / (n - count(lag));
    let q = n * (n + 2.0) * (1..=lags).map(term).sum::<f64>();
    let p = ChiSquared::new(count(lags)).map_or(1.0, |law| law.sf(q));
    (q, p)
}

/// Channels whose leftover is not white.
pub fn coloured(stack: &Stack<'_>, left: &DVector<f64>) -> Vec<Coloured> {
    let mut channels = BTreeMap::<String, (usize, usize)>::new();
    for block in stack
        .rows
        .blocks
        .iter()
        .filter(|block| block.rows.len() >= SHORTEST)
    {
        let (_, p) = ljung_box(&left.as_slice()[block.range()], TESTED_LAGS);
        let entry = channels.entry(block.channel.to_string()).or_default();
        entry.0 += usize::from(p < LEVEL);
        entry.1 += 1;
    }
    let is_coloured = |(blocks, of): (usize, usize)| {
        let more = Binomial::new(LEVEL, of as u64)
            .map_or(1.0, |law| law.sf(blocks.saturating_sub(1) as u64));
        blocks > 0 && more < SESSIONS
    };
    channels
        .into_iter()
        .filter(|(_, counts)| is_coloured(*counts))
        .map(|(channel, (blocks, of))| Coloured {
            channel,
            blocks,
            of,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sixty values of z_k = 0.4 z_(k-1) + u_k, u from a linear congruential generator; the figures are those of
    /// statsmodels 0.15.0, `acorr_ljungbox(z, lags=[5, 10])`.
    #[test]
    fn val_statsmodels_acorr_ljungbox() {
        let z = [
            0.155154, -0.133124, 0.121711, -0.344548, -0.121245, -0.058832, 0.078939, -0.098469,
            -0.282721, -0.238906, 0.230023, -0.235271, -0.296296, 0.025013, 0.29966, 0.607675,
            0.543641, 0.181713, 0.111684, 0.170167, -0.181941, 0.131112, 0.268729, 0.58701,
            0.063826, -0.029012, 0.196797, 0.318614, -0.199776, -0.564205, 0.056895, -0.436036,
            -0.076981, -0.285095, -0.057577, -0.007812, -0.105675, -0.359653, 0.002096, 0.217382,
            -0.108105, 0.428237, 0.505827, 0.092423, 0.241842, -0.277747, -0.003334, 0.047742,
            0.218981, 0.491579, 0.093506, 0.369715, 0.266351, -0.377307, -0.27594, -0.500807,
            -0.14007, -0.185844, -0.424468, 0.133914,
        ];
        for (lags, q, p) in [(5, 11.720_670, 0.038_822), (10, 16.758_845, 0.079_873)] {
            let found = ljung_box(&z, lags);
            assert!((found.0 - q).abs() < 1e-5 * q, "{found:?}");
            assert!((found.1 - p).abs() < 1e-5, "{found:?}");
        }
    }

    #[test]
    fn a_constant_has_no_colour() {
        assert_eq!(ljung_box(&[2.0; 50], 5), (0.0, 1.0));
    }
}
