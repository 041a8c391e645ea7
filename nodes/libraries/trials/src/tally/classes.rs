//! Every class with how often it was found, by its size, and what it was taken for.

use serde::{Deserialize, Serialize};

use super::{D_BINS, bin, most_frequent, name};
use crate::arm::Arm;
use crate::detection::Limit;
use crate::effect::Class;
use crate::proportion::Proportion;
use crate::target::limit;
use crate::verdict::Verdict;

/// A class with how often it was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClassLine {
    /// The class.
    pub class: Class,
    /// Named with its axis, by bin of D.
    pub named: [Proportion; D_BINS],
    /// Their 95 % intervals.
    pub named_intervals: [[f64; 2]; D_BINS],
    /// D from which it is named in 95 %; none of too few trials, or where it is left out of the catalogue.
    pub limit: Option<Limit>,
    /// Least and greatest D that its physical range allowed.
    pub d_range: [f64; 2],
    /// Shown as a surrogate with its axis, over all D.
    pub surrogate: Proportion,
    /// 95 % interval (Wilson) of the share in `surrogate`, 0 to 1.
    pub surrogate_interval: [f64; 2],
    /// What else was named in those trials that hide it alone, the most frequent first.
    pub taken_for: Vec<(String, usize)>,
}

/// Every class that an arm hides.
pub fn of(arm: Arm, own: &[&Verdict]) -> Vec<ClassLine> {
    let line = |class: Class| {
        let pairs = || {
            let said = own.iter().filter(|v| v.said.is_some());
            let all = said.flat_map(|v| v.truth.effects.iter().map(move |e| (*v, e)));
            all.filter(move |(_, effect)| effect.class == class)
        };
        let mut named = [Proportion::default(); D_BINS];
        for (verdict, effect) in pairs() {
            let own = &mut named[bin(effect.d)];
            own.k += usize::from(verdict.has(effect));
            own.n += 1;
        }
        let alone = pairs().filter(|(v, _)| v.truth.effects.len() == 1);
        let others = alone.flat_map(|(v, _)| v.wrong().map(name).collect::<Vec<_>>());
        let shown: Vec<bool> = pairs().map(|(v, e)| v.shows(e)).collect();
        let surrogate = Proportion::of(shown.into_iter());
        let limit = (!arm.leaves_out()).then(|| limit(own, Some(class)));
        ClassLine {
            class,
            named,
            named_intervals: named.map(|bin| bin.wilson()),
            limit: limit.flatten(),
            d_range: pairs().fold([f64::INFINITY, 0.0], |[low, high], (_, effect)| {
                [effect.d.min(low), effect.d.max(high)]
            }),
            surrogate,
            surrogate_interval: surrogate.wilson(),
            taken_for: most_frequent(others),
        }
    };
    let lines = Class::every().map(line);
    lines
        .filter(|line| line.named.iter().any(|bin| bin.n > 0))
        .collect()
}
