//! Figures of a history held against limits: which exceed them.
//!
//! The rule of `limits.yaml` decides, as for conformance: a figure that does not conform is an alarm. A figure without an
//! uncertainty is judged by its value alone. An alarm is no statement of conformance: figures that are not corrected to 20 °C
//! are judged too.

use std::collections::BTreeSet;

use anyhow::{Result, anyhow};
use iso230::ExpandedLength;
use iso230::conformance::{Decision, Policy, Specification, decide};

use super::{Limit, Limits};

/// Coverage factor of expanded uncertainties.
const COVERAGE_FACTOR: f64 = 2.0;

/// A figure of a machine, by the names that a history has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observed<'f> {
    /// Name of the figure.
    pub name: &'f str,
    /// Axis; empty: none.
    pub axis: &'f str,
    /// Unit of the numbers.
    pub unit: &'f str,
    /// Value.
    pub value: f64,
    /// Standard uncertainty; `None`: not known.
    pub standard_uncertainty: Option<f64>,
}

/// Where a figure stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// It conforms.
    Within,
    /// Neither can be proven.
    Undecided,
    /// It does not conform.
    Alarm,
}

impl State {
    /// Its name for machines.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Within => "within",
            Self::Undecided => "undecided",
            Self::Alarm => "alarm",
        }
    }
}

/// A figure and its limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// Key of its limits in the file.
    pub key: String,
    /// Lower limit, in the figure's unit.
    pub lower: Option<f64>,
    /// Upper limit, in the figure's unit.
    pub upper: Option<f64>,
    /// Where it stands.
    pub state: State,
}

impl Limits {
    /// Judges a figure of a machine; `None`: it has no limit.
    ///
    /// # Errors
    /// When its limits are of another unit than it is.
    pub fn judge(&self, machine: &str, figure: &Observed<'_>) -> Result<Option<Judged>> {
        let Some((key, limit)) = self.of_figure(machine, figure.name, figure.axis) else {
            return Ok(None);
        };
        let [lower, upper] = limit
            .in_unit(figure.unit)
            .map_err(|why| anyhow!("{key}: {} {why}", figure.name))?;
        // The rule is the same in every unit.
        let zone = Specification {
            lower_mm: lower,
            upper_mm: upper,
        };
        let (expanded, rule) = match figure.standard_uncertainty {
            Some(u) => (COVERAGE_FACTOR * u, self.rule),
            None => (0.0, Policy::Simple),
        };
        let value = ExpandedLength {
            value_mm: figure.value,
            expanded_uncertainty_mm: expanded,
        };
        let decision = decide(&value, &zone, rule)
            .map_err(|error| anyhow!("{key}: {}: {error}", figure.name))?
            .decision;
        Ok(Some(Judged {
            key,
            lower,
            upper,
            state: match decision {
                Decision::Conforms => State::Within,
                Decision::CannotBeDecided => State::Undecided,
                Decision::DoesNotConform => State::Alarm,
            },
        }))
    }

    /// Keys of limits that are for a machine, or for any (`None`), and not among those that were used.
    #[must_use]
    pub fn unused(&self, machine: Option<&str>, used: &BTreeSet<String>) -> Vec<String> {
        let common = self.limits.keys().map(|name| format!("limits.{name}"));
        let own = self
            .machines
            .iter()
            .filter(|(name, _)| machine.is_none_or(|machine| machine == name.as_str()));
        let own = own.flat_map(|(machine, limits)| {
            let names = limits.keys();
            names.map(move |name| format!("machines.{machine}.{name}"))
        });
        common
            .chain(own)
            .filter(|key| !used.contains(key))
            .collect()
    }

    /// Whether a figure of a machine has limits.
    #[must_use]
    pub fn has(&self, machine: &str, name: &str, axis: &str) -> bool {
        self.of_figure(machine, name, axis).is_some()
    }

    /// The limits of a figure with their key: a machine's own before those of all, an axis's own before those of the figure.
    fn of_figure(&self, machine: &str, name: &str, axis: &str) -> Option<(String, Limit)> {
        let of_axis = format!("{name} {axis}");
        let names = [of_axis.as_str(), name];
        let own = self.machines.get(machine).into_iter().flat_map(|limits| {
            let found = names.iter().filter_map(|name| limits.get_key_value(*name));
            found.map(|(name, limit)| (format!("machines.{machine}.{name}"), *limit))
        });
        let common = names.iter().filter_map(|name| {
            let (name, limit) = self.limits.get_key_value(*name)?;
            Some((format!("limits.{name}"), *limit))
        });
        own.chain(common).next()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn limits(rule: &str) -> Limits {
        let text = format!(
            "rule: {rule}\nlimits:\n  iso230_2.accuracy: {{upper_um: 10.0}}\n  effect.backlash.width_um: {{upper_um: 8.0}}\n  effect.backlash.width_um X: {{lower_um: -1.0, upper_um: 5.0}}\n  geometry.EC0Y: {{upper_arcsec: 2.0}}\n  gap.closed: {{lower: 0.5}}\nmachines:\n  old:\n    iso230_2.accuracy: {{upper_um: 30.0}}\n"
        );
        Limits::read(&text, Path::new("limits.yaml")).unwrap()
    }

    fn observed<'f>(name: &'f str, axis: &'f str, unit: &'f str, value: f64) -> Observed<'f> {
        Observed {
            name,
            axis,
            unit,
            value,
            standard_uncertainty: None,
        }
    }

    #[test]
    fn a_machines_and_an_axiss_own_limits_come_first() {
        let limits = limits("guard_band");
        let of = |machine: &str, figure: &Observed<'_>| {
            let judged = limits.judge(machine, figure).unwrap();
            judged.map(|it| (it.key, it.state))
        };
        let accuracy = observed("iso230_2.accuracy", "", "mm", 0.020);
        let key = "limits.iso230_2.accuracy".to_owned();
        assert_eq!(of("new", &accuracy), Some((key, State::Alarm)));
        let key = "machines.old.iso230_2.accuracy".to_owned();
        assert_eq!(of("old", &accuracy), Some((key, State::Within)));
        for (axis, key, state) in [
            ("X", "limits.effect.backlash.width_um X", State::Alarm),
            ("Y", "limits.effect.backlash.width_um", State::Within),
        ] {
            let play = observed("effect.backlash.width_um", axis, "um", 6.0);
            assert_eq!(of("new", &play), Some((key.to_owned(), state)));
        }
        assert_eq!(of("new", &observed("gap.rms", "", "mm", 9.0)), None);
    }

    #[test]
    fn limits_hold_in_the_unit_of_the_figure_and_another_unit_is_refused() {
        let limits = limits("simple");
        let state = |figure: &Observed<'_>| limits.judge("m", figure).unwrap().unwrap().state;
        let arcsec = 1_f64.to_radians() / 3600.0;
        for (value, wanted) in [(1.9 * arcsec, State::Within), (2.1 * arcsec, State::Alarm)] {
            let figure = observed("geometry.EC0Y", "", "rad", value);
            assert_eq!(state(&figure), wanted);
        }
        for (value, wanted) in [(0.6, State::Within), (0.4, State::Alarm)] {
            assert_eq!(state(&observed("gap.closed", "", "", value)), wanted);
        }
        for (unit, words) in [
            ("rad", "is an angle: lower_arcsec"),
            ("s", "is neither length nor angle"),
        ] {
            let figure = observed("iso230_2.accuracy", "", unit, 1.0);
            let said = format!("{:#}", limits.judge("m", &figure).unwrap_err());
            assert!(said.contains(words), "{said}");
        }
    }

    #[test]
    fn the_rule_decides_with_the_uncertainty_where_there_is_one() {
        let limits = limits("guard_band");
        for (value, u, wanted) in [
            (0.0085, Some(0.001), State::Undecided),
            (0.0075, Some(0.001), State::Within),
            (0.0115, Some(0.001), State::Undecided),
            (0.0125, Some(0.001), State::Alarm),
            (0.0101, None, State::Alarm),
            (0.0099, None, State::Within),
        ] {
            let figure = Observed {
                standard_uncertainty: u,
                ..observed("iso230_2.accuracy", "", "mm", value)
            };
            let judged = limits.judge("m", &figure).unwrap().unwrap();
            assert_eq!(judged.state, wanted, "{value} {u:?}");
        }
    }

    #[test]
    fn limits_without_a_figure_are_named_by_their_key() {
        let limits = limits("simple");
        let used = BTreeSet::from(["limits.gap.closed".to_owned()]);
        let all = limits.unused(None, &used);
        assert_eq!(all.len(), 5, "{all:?}");
        assert!(all.contains(&"machines.old.iso230_2.accuracy".to_owned()));
        assert_eq!(limits.unused(Some("new"), &used).len(), 4);
        assert_eq!(limits.unused(Some("old"), &used).len(), 5);
    }
}
