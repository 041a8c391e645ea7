//! What no effect of the catalogue explains, and what it looks like.
//!
//! # Model
//!
//! The score of a leftover and the score that noise exceeds in one of a hundred sessions:
//!
//! ```text
//!   L = max(max_F z_F, max_c z_c)                                         (1)
//!   z_c = (|z_c|^2 / n_c - 1) / sqrt(2 / n_c + 2 / nu_c)                  (2)
//! ```
//!
//! over families F (`families`) and channels c, with n_c rows less floats and nu_c rows that the noise is known
//! from. Draws of (1) take the fitted effects out of the families' covariance as the fit does.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use twin::Channel;

use crate::config::GapConfig;
use crate::noise::Noise;
use crate::noise::stack::Stack;
use crate::report::description::describe;
use crate::report::localise::{self, Score, noise_maxima};
use crate::report::{Description, Unknown};
use crate::search::families::Slot;
use crate::search::rows::count;

/// (1) of a leftover, and what it goes with.
pub struct Leftover {
    /// Score and threshold.
    pub score: f64,
    /// See [`Leftover::score`].
    pub threshold: f64,
    /// Scores of the families.
    pub families: Vec<Score>,
}

impl Leftover {
    /// Whether noise would hardly do so.
    pub fn flagged(&self) -> bool {
        self.score > self.threshold
    }
}

/// Draws of the threshold.
const THRESHOLD_DRAWS: usize = 999;

/// Scores a leftover from which the columns of `fitted` were taken.
pub fn leftover(
    stack: &Stack<'_>,
    slots: &[Slot],
    noise: &BTreeMap<Channel, Noise>,
    left: &DVector<f64>,
    fitted: &[DVector<f64>],
    config: &GapConfig,
) -> Leftover {
    let families = localise::scores(stack, slots, noise, left, config);
    let of_families = families.iter().map(|score| score.z).fold(0.0, f64::max);
    let (of_channels, channels) = channel_score(stack, noise, left);
    let grams = left_grams(slots, fitted);
    let all: Vec<&Slot> = slots.iter().collect();
    let mut maxima = noise_maxima(&all, noise, &grams, THRESHOLD_DRAWS, config.seed ^ 0x51);
    let mut random = Pcg64Mcg::seed_from_u64(config.seed ^ 0x52);
    for greatest in &mut maxima {
        for _ in 0..channels {
            let draw: f64 = StandardNormal.sample(&mut random);
            *greatest = greatest.max(draw);
        }
    }
    maxima.sort_by(f64::total_cmp);
    Leftover {
        score: of_families.max(of_channels),
        threshold: maxima[(maxima.len() * 99) / 100],
        families,
    }
}

/// Greatest (2), and the number of channels.
fn channel_score(
    stack: &Stack<'_>,
    noise: &BTreeMap<Channel, Noise>,
    left: &DVector<f64>,
) -> (f64, usize) {
    let share = stack.freedom() / count(stack.rows.len);
    let mut sums = BTreeMap::<&Channel, (f64, f64)>::new();
    for block in &stack.rows.blocks {
        let sum = sums.entry(&block.channel).or_default();
        sum.0 += left.rows(block.start, block.rows.len()).norm_squared();
        sum.1 += share * count(block.rows.len());
    }
    let score = |(channel, (square, n)): (&&Channel, &(f64, f64))| {
        let known = noise[*channel].freedom;
        (square / n - 1.0) / (2.0 / n + 2.0 / known.max(1.0)).sqrt()
    };
    (sums.iter().map(score).fold(0.0, f64::max), sums.len())
}

/// Covariance of U'z once some columns are fitted.
fn left_grams(slots: &[Slot], fitted: &[DVector<f64>]) -> Vec<DMatrix<f64>> {
    let plain = |slot: &Slot| slot.basis.tr_mul(&slot.basis);
    if fitted.is_empty() {
        return slots.iter().map(plain).collect();
    }
    let fitted = crate::search::nuisance::orthonormal(fitted[0].len(), fitted.iter().cloned());
    let of = |slot: &Slot| {
        let part = slot.basis.tr_mul(&fitted.select_rows(&slot.rows));
        plain(slot) - &part * part.transpose()
    };
    slots.iter().map(of).collect()
}

/// The report's part on what the named effects leave (`rest`, mm): whether it is flagged, or the held-out runs alone are.
pub fn unknown(
    stack: &Stack<'_>,
    slots: &[Slot],
    leftover: &Leftover,
    (flagged, is_late): (bool, bool),
    rest: &[f64],
) -> Unknown {
    let left = &stack.whitened(rest.to_vec());
    let floated = &stack.floated(rest.to_vec());
    let description = match leftover.families.first() {
        Some(_) if flagged => describe(stack, slots, &leftover.families, left, floated),
        _ => Description::default(),
    };
    Unknown {
        flagged: flagged || is_late,
        score: leftover.score,
        threshold: leftover.threshold,
        description,
    }
}
