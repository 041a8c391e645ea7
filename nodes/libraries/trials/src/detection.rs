//! How large an effect must be to be named nineteen times of twenty.
//!
//! # Model
//!
//! ```text
//!   P(named) = 1 / (1 + exp(-(a + b ln D)))                               (1)
//!   D95 = exp((ln 19 - a) / b)                                            (2)
//! ```
//!
//! with a and b of greatest likelihood, b held towards `SLOPE` by a normal prior as wide as itself, so that trials
//! that separate cleanly have an answer too.
//!
//! # Holds when
//! There are trials of D above 0: (1) is 0 at D = 0, where no reading shows anything, so that these say nothing of a and
//! b. (2) is told within the D that were tried; outside them, on which side it lies.
//!
//! # Agreement
//! `eq2_is_found_again_where_names_follow_the_model`: within 8 % for 4000 trials.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::proportion::{Proportion, median};

/// Slope b that is expected: from one half to 95 % within a factor 2 of D.
const SLOPE: f64 = 4.0;
/// Newton steps.
const NEWTON_STEPS: usize = 60;
/// ln 19.
const LOG_ODDS: f64 = 2.944_438_979_166_44;

/// Where a detection limit lies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// At this D.
    At(f64),
    /// Below the least D that was tried.
    Below(f64),
    /// Beyond the largest D that was tried.
    Beyond(f64),
    /// Between these two, where it is of several of which some are known on one side only.
    Between(f64, f64),
}

impl Limit {
    /// The D itself, where it is known.
    #[must_use]
    pub fn value(self) -> Option<f64> {
        match self {
            Self::At(d) => Some(d),
            _ => None,
        }
    }

    /// Least and largest D that it can have.
    #[must_use]
    pub fn ends(self) -> [f64; 2] {
        match self {
            Self::At(d) => [d, d],
            Self::Below(d) => [0.0, d],
            Self::Beyond(d) => [d, f64::INFINITY],
            Self::Between(low, high) => [low, high],
        }
    }

    fn within([low, high]: [f64; 2]) -> Self {
        match (low > 0.0, high.is_finite()) {
            (_, false) => Self::Beyond(low),
            (false, true) => Self::Below(high),
            (true, true) if high > low => Self::Between(low, high),
            (true, true) => Self::At(high),
        }
    }

    /// What `whole` makes of several: it must grow with each of them.
    fn of(all: &[Self], whole: impl Fn(Vec<f64>) -> Option<f64>) -> Option<Self> {
        let end = |place: usize| whole(all.iter().map(|limit| limit.ends()[place]).collect());
        Some(Self::within([end(0)?, end(1)?]))
    }

    /// The middle one; none of nothing.
    #[must_use]
    pub fn middle(all: &[Self]) -> Option<Self> {
        Self::of(all, median)
    }

    /// The largest; none of nothing.
    #[must_use]
    pub fn largest(all: &[Self]) -> Option<Self> {
        Self::of(all, |ends| ends.into_iter().reduce(f64::max))
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::At(d) => write!(f, "{d:.3}"),
            Self::Below(d) => write!(f, "< {d:.3}"),
            Self::Beyond(d) => write!(f, "> {d:.3}"),
            Self::Between(low, high) => write!(f, "{low:.3} to {high:.3}"),
        }
    }
}

/// D beyond which an effect should be found in any case.
pub const MIN_D_TO_FIND: f64 = 20.0;
/// Edge between the two lower bins of [`by_d`].
const MIDDLE_D: f64 = 10.0;

/// How often effects were found: below D 10, from 10 to 20, and above.
#[must_use]
pub fn by_d(all: &[(f64, bool)]) -> [Proportion; 3] {
    [
        [0.0, MIDDLE_D],
        [MIDDLE_D, MIN_D_TO_FIND],
        [MIN_D_TO_FIND, f64::INFINITY],
    ]
    .map(|[low, high]| {
        let own = all.iter().filter(|(d, _)| *d > low && *d <= high);
        Proportion::of(own.map(|(_, is_found)| *is_found))
    })
}

/// The size that has D 20 in the middle of effects of a size and a D.
#[must_use]
pub fn size_to_find(all: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let sizes = all.map(|(size, d)| size.abs() * MIN_D_TO_FIND / d.max(1e-9));
    median(sizes.collect())
}

/// (2) of trials: D, and whether it was named; none without trials.
#[must_use]
pub fn d95(trials: &[(f64, bool)]) -> Option<Limit> {
    let seen: Vec<(f64, bool)> = trials.iter().copied().filter(|(d, _)| *d > 0.0).collect();
    let least = seen.iter().map(|(d, _)| *d).reduce(f64::min)?;
    let most = seen.iter().map(|(d, _)| *d).reduce(f64::max)?;
    if seen.iter().all(|(_, named)| *named) {
        return Some(Limit::Below(least));
    }
    if !seen.iter().any(|(_, named)| *named) {
        return Some(Limit::Beyond(most));
    }
    let [a, b] = match fit(&seen)? {
        [a, b] if b > 0.0 => [a, b],
        // Nothing grows rarer with its size: all are named alike.
        _ => {
            let share = Proportion::of(seen.iter().map(|(_, named)| *named)).share()?;
            [(share / (1.0 - share)).ln(), 0.0]
        }
    };
    let is_reached = |d: f64| a + b * d.ln() >= LOG_ODDS;
    Some(match (is_reached(least), is_reached(most)) {
        (_, false) => Limit::Beyond(most),
        (true, true) => Limit::Below(least),
        (false, true) => Limit::At(((LOG_ODDS - a) / b).exp()),
    })
}

/// a and b of (1).
fn fit(trials: &[(f64, bool)]) -> Option<[f64; 2]> {
    let middle = median(trials.iter().map(|(d, _)| d.ln()).collect())?;
    let (mut a, mut b) = (0.0_f64, SLOPE);
    for _ in 0..NEWTON_STEPS {
        let mut pull = [0.0, (SLOPE - b) / SLOPE.powi(2)];
        let mut curve = [1e-9, 0.0, 1.0 / SLOPE.powi(2)];
        for (d, named) in trials {
            let x = d.ln() - middle;
            let p = 1.0 / (1.0 + (-(a + b * x)).exp());
            let miss = f64::from(u8::from(*named)) - p;
            pull[0] += miss;
            pull[1] += miss * x;
            let weight = p * (1.0 - p);
            curve[0] += weight;
            curve[1] += weight * x;
            curve[2] += weight * x * x;
        }
        let whole = curve[0] * curve[2] - curve[1] * curve[1];
        if whole <= 0.0 {
            return None;
        }
        let step = [
            (curve[2] * pull[0] - curve[1] * pull[1]) / whole,
            (curve[0] * pull[1] - curve[1] * pull[0]) / whole,
        ];
        // A step of more than one on the scale of odds may overshoot.
        let shorter = (1.0 / step[0].abs().max(step[1].abs()).max(1e-12)).min(1.0);
        a += shorter * step[0];
        b += shorter * step[1];
    }
    Some([a - b * middle, b])
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// D from 2 to 200, named as (1) says.
    fn drawn(wanted: f64) -> Vec<(f64, bool)> {
        let mut random = Pcg64Mcg::seed_from_u64(2);
        let trial = |_| {
            let d = 2.0 * 100.0_f64.powf(random.random());
            let odds = 5.0 * (d / wanted).ln() + LOG_ODDS;
            (d, random.random::<f64>() < 1.0 / (1.0 + (-odds).exp()))
        };
        (0..4000).map(trial).collect()
    }

    #[test]
    fn eq2_is_found_again_where_names_follow_the_model() {
        let found = d95(&drawn(7.5)).unwrap().value().unwrap();
        assert!((found / 7.5 - 1.0).abs() < 0.08, "{found}");
    }

    #[test]
    fn eq1_learns_nothing_where_nothing_can_be_seen() {
        let mut trials = drawn(7.5);
        let before = d95(&trials);
        trials.extend([(0.0, false); 40]);
        assert_eq!(d95(&trials), before);
        assert_eq!(d95(&[(0.0, false); 40]), None);
    }

    #[test]
    fn trials_that_separate_cleanly_have_it_between() {
        let clean: Vec<(f64, bool)> = (1..40).map(|d| (f64::from(d), d > 9)).collect();
        let found = d95(&clean).unwrap().value().unwrap();
        assert!((9.0..20.0).contains(&found), "{found}");
    }

    #[test]
    fn what_is_never_or_always_named_has_it_outside_of_what_was_tried() {
        let trials = |named: fn(u8) -> bool| -> Vec<(f64, bool)> {
            (20..60).map(|d| (f64::from(d), named(d))).collect()
        };
        assert_eq!(d95(&trials(|_| false)), Some(Limit::Beyond(59.0)));
        assert_eq!(d95(&trials(|_| true)), Some(Limit::Below(20.0)));
        // Half of them at every D, and one of forty missed.
        assert_eq!(d95(&trials(|d| d % 2 > 0)), Some(Limit::Beyond(59.0)));
        assert_eq!(d95(&trials(|d| d != 58)), Some(Limit::Below(20.0)));
        assert_eq!(d95(&[]), None);
    }

    #[test]
    fn several_are_no_better_known_than_those_that_decide() {
        let told = |all: &[Limit]| {
            let both = [Limit::middle(all), Limit::largest(all)];
            both.map(|limit| limit.unwrap().to_string())
        };
        let (at, beyond, below) = (Limit::At, Limit::Beyond, Limit::Below);
        assert_eq!(told(&[at(5.0), at(9.0), at(7.0)]), ["7.000", "9.000"]);
        // One beyond 200 moves no middle; two of three are it.
        assert_eq!(
            told(&[at(5.0), beyond(200.0), at(7.0)]),
            ["7.000", "> 200.000"]
        );
        let most = told(&[at(5.0), beyond(200.0), beyond(150.0)]);
        assert_eq!(most, ["> 150.000", "> 200.000"]);
        let open = told(&[below(20.0), at(10.0), at(30.0), at(15.0)]);
        assert_eq!(open, ["12.500 to 17.500", "30.000"]);
        assert_eq!(told(&[below(20.0)]), ["< 20.000", "< 20.000"]);
        assert_eq!(Limit::middle(&[]), None);
    }
}
