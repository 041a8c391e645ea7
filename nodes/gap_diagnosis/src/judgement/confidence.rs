//! How likely each effect is, and what it cannot be told from.
//!
//! # Model
//!
//! Over all sets S that the search visited, C of `selection`, each set of instances once with its best form:
//!
//! ```text
//!   p(g) = sum_(S has g) exp(-C(S)/2) / sum_S exp(-C(S)/2)  times  p(adequate)   (1)
//!   g alone is named where every S with C <= C* + 2 ln 20 has g                  (2)
//! ```
//!
//! p(adequate) is one where the leftover is within noise and falls with the share of the gap that is left. (1) is a
//! probability only as far as the catalogue holds the truth; `recalibration` is behind it.

use std::collections::{BTreeMap, BTreeSet};

use crate::judgement::{Check, CheckId};
use crate::search::selection::Set;
use crate::search::signature::Library;

/// Best C of every set of instances that was visited.
pub struct Rivals {
    sets: BTreeMap<BTreeSet<usize>, f64>,
    best: f64,
}

/// Odds beyond which a rival is excluded.
pub const ODDS: f64 = 20.0;

impl Rivals {
    /// Of a search's visits.
    pub fn new(signatures: &Library, visited: &BTreeMap<Set, f64>) -> Self {
        let mut sets = BTreeMap::<BTreeSet<usize>, f64>::new();
        for (set, score) in visited {
            let instances = set
                .iter()
                .map(|form| signatures.forms[*form].instance)
                .collect();
            let entry = sets.entry(instances).or_insert(*score);
            *entry = entry.min(*score);
        }
        let best = sets.values().copied().fold(f64::INFINITY, f64::min);
        Self { sets, best }
    }

    /// (1) without p(adequate).
    pub fn probability(&self, instance: usize) -> f64 {
        let weight = |score: &f64| (-0.5 * (score - self.best)).exp();
        let all: f64 = self.sets.values().map(weight).sum();
        let own = self.sets.iter().filter(|(set, _)| set.contains(&instance));
        own.map(|(_, score)| weight(score)).sum::<f64>() / all
    }

    /// Whether a set without this member, and with nothing in its place, is worse by the odds that exclude a rival. A
    /// member that is barely worth its price is what chance brings.
    fn is_needed(&self, best: &BTreeSet<usize>, instance: usize) -> bool {
        let mut without = best.clone();
        without.remove(&instance);
        let less = self.sets.get(&without);
        less.is_none_or(|score| *score > self.best + 2.0 * ODDS.ln())
    }

    /// By how much a set without this member, and with nothing in its place, is worse; infinite where none was visited.
    fn loss_without(&self, best: &BTreeSet<usize>, instance: usize) -> f64 {
        let mut without = best.clone();
        without.remove(&instance);
        let less = self.sets.get(&without).copied();
        less.unwrap_or(f64::INFINITY) - self.best
    }

    /// By how much the best set without an instance is worse, whatever stands in its place; infinite where none was visited.
    fn loss_with_rival(&self, instance: usize) -> f64 {
        let others = self.sets.iter().filter(|(set, _)| !set.contains(&instance));
        let least = others
            .map(|(_, score)| *score)
            .fold(f64::INFINITY, f64::min);
        least - self.best
    }

    /// The checks that (2) and [`Self::is_needed`] are; of a member that another effect was set aside for (2) does not hold.
    pub fn checks(&self, best: &BTreeSet<usize>, instance: usize, is_shared: bool) -> [Check; 2] {
        let limit = 2.0 * ODDS.ln();
        let loss = if is_shared {
            0.0
        } else {
            self.loss_with_rival(instance)
        };
        [
            Check::new(CheckId::Needed, self.is_needed(best, instance))
                .with(self.loss_without(best, instance), limit),
            Check::new(CheckId::NoRival, !is_shared && self.is_alone(instance)).with(loss, limit),
        ]
    }

    /// Instances that stand in sets nearly as good that do without this one, and not in the best set itself.
    pub fn instead_of(&self, best: &BTreeSet<usize>, instance: usize) -> BTreeSet<usize> {
        let near = |score: &f64| *score <= self.best + 2.0 * ODDS.ln();
        self.sets
            .iter()
            .filter(|(set, score)| near(score) && !set.contains(&instance))
            .flat_map(|(set, _)| set.difference(best).copied())
            .collect()
    }

    /// Whether (2) holds.
    fn is_alone(&self, instance: usize) -> bool {
        let near = |score: &f64| *score <= self.best + 2.0 * ODDS.ln();
        self.sets
            .iter()
            .all(|(set, score)| !near(score) || set.contains(&instance))
    }
}

/// p(adequate): one less the share of what is beyond noise that stays unexplained, where the leftover is flagged.
pub fn adequacy(flagged: bool, before: f64, after: f64, freedom: f64) -> f64 {
    if !flagged {
        return 1.0;
    }
    let left = (after - freedom).max(0.0) / (before - freedom).max(1.0);
    (1.0 - left.sqrt()).clamp(0.2, 0.95)
}
