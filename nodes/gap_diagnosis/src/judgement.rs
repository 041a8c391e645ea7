//! The checks of a cause, and the status that follows from them.
//!
//! Every rule that speaks for or against a cause yields a [`Check`]: its value, its limit and its verdict. [`status`] is
//! the only place that decides from them whether a cause is named, one of a set, or a surrogate.

pub(crate) mod along;
pub(crate) mod aside;
pub(crate) mod at_instant;
pub(crate) mod by_clock;
pub(crate) mod by_heat;
pub(crate) mod by_thermometer;
pub(crate) mod cause;
pub(crate) mod confidence;
pub(crate) mod confirm;
pub(crate) mod form_doubt;
pub(crate) mod guard;
pub(crate) mod in_common;
pub(crate) mod in_course;
pub(crate) mod one_feed;
pub(crate) mod one_plane;
pub(crate) mod other_thermometer;
pub(crate) mod plain;
pub(crate) mod recalibration;
pub mod rule;
pub(crate) mod unknown;
pub(crate) mod unresolved;
pub(crate) mod veto;
pub(crate) mod with_heat;

use serde::{Deserialize, Serialize};

use crate::judgement::veto::Veto;
use crate::report::{Constancy, Status};

/// A rule that a cause is checked by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CheckId {
    /// It has one size under all conditions.
    OneSize,
    /// No size, and no shape that the recording determines, stands at the end of its physical range; time constants of heat may.
    OffBounds,
    /// Its curve is no straight line where it was read.
    Curved,
    /// It begins after the first reading that shows it.
    Begins,
    /// It is larger than what noise makes now and then.
    AboveNoise,
    /// It rises above the error of form that every simulator has.
    AboveForm,
    /// Its size differs little from run to run.
    Sure,
    /// It predicts runs that were left out.
    HeldOutGain,
    /// It predicts most of these runs.
    HeldOutShare,
    /// With it the runs that were held out are predicted no worse than without it.
    HeldOutRms,
    /// The recording determines its size, where it has one.
    Determined,
    /// It explains more than what stays unexplained.
    BesideUnexplained,
    /// It is not one of several alike on every axis.
    OwnCause,
    /// Other effects do not take most of it away again.
    NotCancelled,
    /// No shape without a physics fits better in its place.
    BeatsShapes,
    /// The rest explains much less without it.
    Needed,
    /// It explains a scatter better than a scatter of its own for each run.
    BeatsRuns,
    /// It is found in the scatter within the stations alone.
    WithinStations,
    /// The log goes with a thermometer that drives it.
    OwnThermometer,
    /// No shift with a temperature explains more than a drift in time.
    BeatsHeat,
    /// The noise of the session is that of its repeats.
    NoiseFloor,
    /// No other effect does nearly as well; if one does, the cause is one of a set.
    NoRival,
}

/// The side of its limit on which a value passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// At the limit or above.
    AtLeast,
    /// Above the limit.
    Above,
    /// At the limit or below.
    AtMost,
    /// Below the limit.
    Below,
}

/// What a check found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The value is on the right side of its limit, or the recording cannot speak against the cause here.
    Passed,
    /// It is on the wrong side.
    Failed,
    /// The recording has nothing to try it on, or the rule is switched off.
    NotTried,
}

/// One check of a cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// Its rule.
    pub check: CheckId,
    /// What is compared with the limit, in plain words.
    pub name: String,
    /// The value, in `unit`; absent if the check has no number.
    pub value: Option<f64>,
    /// The limit, in `unit`; absent if the check has no number.
    pub limit: Option<f64>,
    /// On which side of the limit a value passes.
    pub passes: Side,
    /// Unit of value and limit; empty for numbers without a unit.
    pub unit: String,
    /// What came out.
    pub verdict: Verdict,
}

impl Check {
    /// A check without figures.
    pub(crate) fn new(check: CheckId, has_passed: bool) -> Self {
        let (name, passes) = check.words();
        Self {
            check,
            name: name.to_owned(),
            value: None,
            limit: None,
            passes,
            unit: String::new(),
            verdict: if has_passed {
                Verdict::Passed
            } else {
                Verdict::Failed
            },
        }
    }

    /// The same with its value and limit; a number that is not finite is absent.
    pub(crate) fn with(mut self, value: f64, limit: f64) -> Self {
        let finite = |number: f64| Some(number).filter(|number| number.is_finite());
        self.value = finite(value);
        self.limit = finite(limit);
        self
    }

    /// The same in a unit.
    pub(crate) fn in_unit(mut self, unit: &str) -> Self {
        unit.clone_into(&mut self.unit);
        self
    }

    /// The same with other words for its value.
    pub(crate) fn named(mut self, name: String) -> Self {
        self.name = name;
        self
    }

    /// The same where there is nothing to try it on.
    pub(crate) fn not_tried(mut self) -> Self {
        self.verdict = Verdict::NotTried;
        self
    }

    /// Whether it speaks against the status that the cause would have.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.verdict == Verdict::Failed
    }
}

impl CheckId {
    /// What is compared with the limit, and on which side it passes.
    const fn words(self) -> (&'static str, Side) {
        match self {
            Self::OneSize => ("one size under all conditions", Side::Below),
            Self::OffBounds => ("determined values at an end of their range", Side::AtMost),
            Self::Curved => ("bend of its curve beside a straight line", Side::AtLeast),
            Self::Begins => (
                "difference from the same effect begun before the recording",
                Side::AtLeast,
            ),
            Self::AboveNoise => ("size over noise, D", Side::AtLeast),
            Self::AboveForm => (
                "height above the simulator's own error of form",
                Side::Above,
            ),
            Self::Sure => (
                "size over its standard uncertainty between runs",
                Side::Above,
            ),
            Self::HeldOutGain => ("gain on runs left out over its standard error", Side::Above),
            Self::HeldOutShare => ("share of the runs left out that gain", Side::AtLeast),
            Self::HeldOutRms => (
                "rms of the held-out runs with it over that without it",
                Side::AtMost,
            ),
            Self::Determined => (
                "share of its physical range that the interval of its size spans",
                Side::Below,
            ),
            Self::BesideUnexplained => (
                "gain in chi-square beside twice what stays unexplained",
                Side::AtLeast,
            ),
            Self::OwnCause => ("effects of one kind that have the same size", Side::AtMost),
            Self::NotCancelled => (
                "D squared beside the chi-square that all effects explain together",
                Side::AtMost,
            ),
            Self::BeatsShapes => (
                "advantage of the best shape without a physics in its place",
                Side::AtMost,
            ),
            Self::Needed => ("score lost without it", Side::Above),
            Self::BeatsRuns => (
                "score beside that of a scatter of its own for each run",
                Side::Below,
            ),
            Self::WithinStations => (
                "found in the scatter within the stations as well",
                Side::AtLeast,
            ),
            Self::OwnThermometer => (
                "thermometers of its own that the log goes with",
                Side::AtLeast,
            ),
            Self::BeatsHeat => ("score lost with a thermometer's shift", Side::AtLeast),
            Self::NoiseFloor => (
                "variance of the session's noise over that of the repeats",
                Side::AtMost,
            ),
            Self::NoRival => ("score lost with the best rival in its place", Side::Above),
        }
    }

    /// What its failure says against naming an effect of the mean.
    fn veto(self, constancy: &Constancy) -> Option<Veto> {
        Some(match self {
            Self::OneSize => Veto::Constancy {
                split_by: constancy.split_by.clone(),
            },
            Self::OffBounds => Veto::AtBound,
            Self::Curved => Veto::Straight,
            Self::Begins => Veto::NoChange,
            Self::AboveNoise => Veto::NearNoise,
            Self::AboveForm => Veto::BelowForm,
            Self::Sure => Veto::NotSure,
            Self::HeldOutGain | Self::HeldOutShare => Veto::HeldOut,
            Self::HeldOutRms => Veto::WorseHeldOut,
            Self::Determined => Veto::NotDetermined,
            Self::BesideUnexplained => Veto::SmallBesideLeft,
            Self::OwnCause => Veto::InCommon,
            Self::NotCancelled => Veto::Cancels,
            Self::BeatsShapes => Veto::Shape,
            Self::Needed => Veto::NotNeeded,
            Self::OwnThermometer => Veto::OtherThermometer,
            Self::BeatsHeat => Veto::Heat,
            Self::NoiseFloor => Veto::NoiseFloor,
            // The first two are of scatter alone, the last makes a set.
            Self::BeatsRuns | Self::WithinStations | Self::NoRival => return None,
        })
    }
}

/// The status of a cause with these checks: a failed one makes it a surrogate, a rival that does nearly as well one of a set.
#[must_use]
pub fn status(checks: &[Check]) -> Status {
    if !holds(checks) {
        return Status::Surrogate;
    }
    if checks.iter().any(Check::has_failed) {
        return Status::Set;
    }
    Status::Named
}

/// Whether no check speaks against a cause, alone or as one of a set.
pub(crate) fn holds(checks: &[Check]) -> bool {
    let mut failed = checks.iter().filter(|check| check.has_failed());
    failed.all(|check| check.check == CheckId::NoRival)
}

/// What the failed checks say against naming an effect of the mean, each once.
pub(crate) fn vetoes(checks: &[Check], constancy: &Constancy) -> Vec<Veto> {
    let failed = checks.iter().filter(|check| check.has_failed());
    let mut vetoes: Vec<Veto> = failed
        .filter_map(|check| check.check.veto(constancy))
        .collect();
    vetoes.dedup();
    vetoes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checks(of: &[(CheckId, bool)]) -> Vec<Check> {
        let all = of.iter();
        all.map(|(id, passed)| Check::new(*id, *passed)).collect()
    }

    #[test]
    fn one_failed_check_makes_a_surrogate_and_a_rival_alone_a_set() {
        use CheckId::{AboveNoise, HeldOutGain, HeldOutShare, NoRival};
        let table = [
            (vec![(AboveNoise, true), (NoRival, true)], Status::Named),
            (vec![(AboveNoise, true), (NoRival, false)], Status::Set),
            (
                vec![(AboveNoise, false), (NoRival, true)],
                Status::Surrogate,
            ),
            (
                vec![(AboveNoise, false), (NoRival, false)],
                Status::Surrogate,
            ),
            (vec![], Status::Named),
        ];
        for (of, wanted) in table {
            assert_eq!(status(&checks(&of)), wanted, "{of:?}");
        }
        let constancy = Constancy {
            passed: true,
            worst_z: 0.0,
            split_by: String::new(),
        };
        let both = checks(&[
            (HeldOutGain, false),
            (HeldOutShare, false),
            (NoRival, false),
        ]);
        assert_eq!(vetoes(&both, &constancy), [Veto::HeldOut]);
    }

    #[test]
    fn what_cannot_be_tried_speaks_against_nothing() {
        let not_tried = Check::new(CheckId::HeldOutGain, false).not_tried();
        assert_eq!(status(&[not_tried]), Status::Named);
    }

    #[test]
    fn numbers_that_are_not_finite_are_absent() {
        let check = Check::new(CheckId::NoRival, true).with(f64::INFINITY, 6.0);
        assert_eq!((check.value, check.limit), (None, Some(6.0)));
    }
}
