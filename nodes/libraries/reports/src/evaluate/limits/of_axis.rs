//! Limits of a figure of one axis: `iso230_2.accuracy X`.

use std::collections::BTreeSet;

use anyhow::{Result, bail};
use metrology::Axis;
use serde_json::Value;

use super::judged::Figure;
use super::{Limits, names, title};

/// The name of a figure, and the axis behind it.
pub(super) fn parted(name: &str) -> (&str, Option<&str>) {
    let parts = name.split_once(' ');
    parts.map_or((name, None), |(figure, axis)| (figure, Some(axis)))
}

/// The one axis that the title of a test names; of several, as circles have them, none.
#[must_use]
pub fn named_in(title: &str) -> Option<Axis> {
    let (about, _) = title.split_once(": ").unwrap_or((title, ""));
    let words = about.split(|letter: char| !letter.is_alphanumeric());
    let axes = words.filter_map(|word| word.parse::<Axis>().ok());
    let axes: BTreeSet<Axis> = axes.collect();
    let mut axes = axes.into_iter();
    axes.next().filter(|_| axes.next().is_none())
}

impl Limits {
    /// The tests with a figure that a name of a limit is for: those of its axis, or those of which no axis has an own limit.
    ///
    /// # Errors
    /// When no test has such a figure, or the axis does not exist. The message lists the figures that exist.
    pub(super) fn found<'t>(
        &self,
        name: &str,
        tests: &'t [Value],
    ) -> Result<Vec<(&'t Value, Figure)>> {
        let (figure, axis) = parted(name);
        let all = tests.iter();
        let all = all.filter_map(|test| Some((test, Figure::of(test, figure)?)));
        let all: Vec<(&Value, Figure)> = all.collect();
        if all.is_empty() {
            let known: BTreeSet<String> = tests.iter().flat_map(names).collect();
            bail!("limits.{name}: no test has such a figure; there are {known:?}");
        }
        let axis = match axis.map(|word| (word, word.parse::<Axis>())) {
            None => None,
            Some((_, Ok(axis))) => Some(axis),
            Some((word, Err(_))) => bail!(
                "limits.{name}: \"{word}\" is no axis: must be one of X, Y, Z, A, B, C, behind one blank, or not be there"
            ),
        };
        let is_meant = |test: &Value| {
            let own = named_in(title(test));
            let has_own =
                || own.is_some_and(|own| self.limits.contains_key(&format!("{figure} {own}")));
            axis.map_or_else(|| !has_own(), |axis| own == Some(axis))
        };
        Ok(all.into_iter().filter(|(test, _)| is_meant(test)).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Positioning tests of two axes, 8.5 and 11.5 µm.
    fn tests() -> Vec<Value> {
        let length =
            |value: f64| serde_json::json!({"value_mm": value, "expanded_uncertainty_mm": 0.001});
        vec![
            serde_json::json!({"test": "Positioning X, run 1 on: not compensated", "iso230_2": {"accuracy": length(0.0085)}}),
            serde_json::json!({"test": "Positioning Y", "iso230_2": {"accuracy": length(0.0115)}}),
        ]
    }

    /// Decisions with the limits of each row, or the refusal.
    fn decided(limits: &str, machine: Option<&str>) -> Result<Vec<String>, String> {
        let text = format!("rule: simple\n{limits}");
        let limits = Limits::read(&text, Path::new("limits.yaml")).map_err(|e| format!("{e:#}"))?;
        let section = limits.of_machine(machine).section(&tests());
        let section = section.map_err(|error| format!("{error:#}"))?;
        let rows = section.tables.iter().flat_map(|table| &table.rows);
        Ok(rows
            .map(|row| format!("{} {} {}", &row[1][12..13], row[3], row[4]))
            .collect())
    }

    #[test]
    fn the_limit_of_an_axis_holds_before_that_of_the_figure() {
        const A: &str = "  iso230_2.accuracy";
        for (limits, rows) in [
            (
                format!("limits:\n{A}: {{upper_um: 20.0}}\n{A} X: {{upper_um: 5.0}}\n"),
                vec!["Y ≤ 20 µm conforms", "X ≤ 5 µm does not conform"],
            ),
            (
                format!("limits:\n{A} Y: {{upper_um: 12.0}}\n{A} X: {{upper_um: 5.0}}\n"),
                vec!["X ≤ 5 µm does not conform", "Y ≤ 12 µm conforms"],
            ),
            (
                format!("limits:\n{A} X: {{upper_um: 5.0}}\n"),
                vec!["X ≤ 5 µm does not conform"],
            ),
            (format!("limits:\n{A} Z: {{upper_um: 5.0}}\n"), vec![]),
            (
                format!(
                    "limits:\n{A} X: {{upper_um: 5.0}}\nmachines:\n  mill:\n  {A}: {{upper_um: 30.0}}\n"
                ),
                vec!["X ≤ 30 µm conforms", "Y ≤ 30 µm conforms"],
            ),
            (
                format!(
                    "limits:\n{A}: {{upper_um: 5.0}}\nmachines:\n  mill:\n  {A} X: {{upper_um: 30.0}}\n"
                ),
                vec!["Y ≤ 5 µm does not conform", "X ≤ 30 µm conforms"],
            ),
        ] {
            assert_eq!(decided(&limits, Some("mill")).unwrap(), rows, "{limits}");
        }
    }

    #[test]
    fn a_name_with_an_axis_that_no_test_has_is_refused_with_what_there_is() {
        for (name, words) in [
            ("iso230_2.acuracy X", "there are {\"iso230_2.accuracy\"}"),
            ("accuracy X", "there are {\"iso230_2.accuracy\"}"),
            ("iso230_2.accuracy Q", "\"Q\" is no axis"),
            ("iso230_2.accuracy x", "\"x\" is no axis"),
            ("iso230_2.accuracy XY", "\"XY\" is no axis"),
            ("iso230_2.accuracy ", "\"\" is no axis"),
            ("iso230_2.accuracy  X", "\" X\" is no axis"),
            ("iso230_2.accuracy X ", "\"X \" is no axis"),
        ] {
            let refused = decided(&format!("limits:\n  \"{name}\": {{upper_um: 5.0}}\n"), None);
            let refused = refused.expect_err(name);
            assert!(refused.contains(words), "{name}: {refused}");
        }
        let kept = decided(
            "limits:\n  effect.backlash.width_um X: {upper_um: 5.0}\n",
            None,
        );
        assert_eq!(kept, Ok(vec![]));
    }

    #[test]
    fn a_title_names_one_axis_or_none() {
        for (title, wanted) in [
            (
                "Positioning X, run 3 on: not compensated, by Y",
                Some(Axis::X),
            ),
            ("Thermal drift of Z", Some(Axis::Z)),
            ("Rotary positioning C", Some(Axis::C)),
            ("Circle XY, radius 100 mm", None),
            ("Tilt of Z about X", None),
            ("", None),
        ] {
            assert_eq!(named_in(title), wanted, "{title}");
        }
    }
}
