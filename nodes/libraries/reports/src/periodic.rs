//! Periodic positioning error of linear axes (ISO 230-2): what repeats with the lead of the screw.
//!
//! The mean deviations of one direction are taken over the longest part of a test whose targets lie at most a quarter of the
//! lead apart and cover one lead at least. Elsewhere targets alias, and a periodic error of another length would be told.

use iso230::Direction;
use iso230::positioning::periodic::{self, PeriodicResult, PeriodicRun};
use metrology::Axis;
use metrology::sample::TestKind;
use serde::Serialize;
use serde_json::{Value, json};

use super::positioning::figure;
use super::section::{NOT_EVALUATED, Rows, Section, head, um};
use crate::evaluate::Tests;
use crate::evaluate::budget::{Budget, unstate};
use crate::evaluate::correction::{About, BY_OWN_SCALE, Measured};
use crate::evaluate::linear::LinearTest;

/// Share of a period by which targets may be apart.
const GREATEST_STEP: f64 = 0.25;
/// Most harmonics that are looked for.
const MOST_HARMONICS: f64 = 4.0;
/// p values above this are no period.
const SIGNIFICANT: f64 = 0.05;

/// One direction of one test.
#[derive(Serialize)]
struct Found {
    name: String,
    first_run: u32,
    direction: Direction,
    from_mm: f64,
    to_mm: f64,
    targets: usize,
    /// Why it is no figure of the standard.
    #[serde(skip_serializing_if = "Option::is_none")]
    label: Option<&'static str>,
    #[serde(skip)]
    is_stated: bool,
    result: PeriodicResult,
}

/// The part for all positioning tests along linear axes; none without any.
pub fn section(tests: &Tests, budget: Option<&Budget>) -> Option<Section> {
    let of_axes = { tests.linear.iter() }.filter(|test| {
        // What has no targets says why in its own part.
        let has_targets = test.targets_mm.len() > 1;
        test.kind == TestKind::Positioning && test.axis.is_some() && has_targets
    });
    let mut section = Section::new("Periodic positioning error, ISO 230-2");
    let (mut found, mut refused) = (vec![], vec![]);
    for test in of_axes {
        match evaluated(test, tests, budget) {
            Ok(mut both) => found.append(&mut both),
            Err(why) => refused.push((format!("{}, run {} on", test.name, test.first_run), why)),
        }
    }
    // One remark, however many tests there are.
    if !refused.is_empty() {
        section.warn(NOT_EVALUATED, refused_in_words(&refused));
    }
    if found.is_empty() && section.lines.is_empty() {
        return None;
    }
    if !found.is_empty() {
        let stated = found.iter().any(|one| one.is_stated);
        section.tables.push(Rows {
            head: head(&[
                "test",
                "from to / mm",
                "period / mm",
                "P / µm",
                "amplitudes / µm",
                "p of the 1st",
                "rest, s / µm",
            ]),
            rows: found.iter().map(Found::row).collect(),
            note: format!(
                "P: greatest minus least value of what repeats with the lead, a straight line taken out; its shape is that of the harmonics whose amplitudes stand in the table; sharper ones are not in it. A probability p above {SIGNIFICANT} says that scatter alone shows as much.{}",
                if stated { " ± expanded uncertainty, k = 2, of the fit and of drift." } else { "" }
            ),
        });
        section
            .lines
            .extend(found.iter().filter_map(Found::unclear));
    }
    let all: Vec<Value> = found.iter().map(Found::as_json).collect();
    section.figures = json!({ "test": section.title, "iso230_2_periodic": all });
    Some(section)
}

/// Which tests were not evaluated: each reason once, with the tests that it is of.
fn refused_in_words(refused: &[(String, String)]) -> String {
    let mut by_reason: Vec<(&str, Vec<&str>)> = vec![];
    for (test, why) in refused {
        match by_reason.iter_mut().find(|(known, _)| known == why) {
            Some((_, tests)) => tests.push(test),
            None => by_reason.push((why, vec![test])),
        }
    }
    let sentence =
        |(why, tests): &(&str, Vec<&str>)| format!("{}: not evaluated: {why}.", tests.join("; "));
    let all: Vec<String> = by_reason.iter().map(sentence).collect();
    all.join(" ")
}

fn evaluated(
    test: &LinearTest,
    tests: &Tests,
    budget: Option<&Budget>,
) -> Result<Vec<Found>, String> {
    let Some(machine) = &tests.machine else {
        return Err("the bag has no machine file, which would have the lead of the screw".into());
    };
    let entry = test.axis.and_then(|axis: Axis| machine.linear(axis));
    let Some(entry) = entry else {
        return Err("the machine file has no such linear axis".into());
    };
    let period_mm = entry.lead_mm;
    let (first, last) = dense(&test.targets_mm, period_mm)?;
    let targets_mm = &test.targets_mm[first..=last];
    let measured = Measured::of(tests, budget, About::line(test));
    let greatest_step_mm =
        { targets_mm.windows(2) }.fold(0.0, |step: f64, two| step.max(two[1] - two[0]));
    let n_harmonics = harmonics(targets_mm.len(), greatest_step_mm / period_mm);
    let sides = [
        (Direction::Up, &test.up_mm),
        (Direction::Down, &test.down_mm),
    ];
    let one = |(direction, rows): (Direction, &Vec<Vec<f64>>)| {
        let mean =
            |place: usize| rows.iter().map(|row| row[place]).sum::<f64>() / rows.len() as f64;
        let run = PeriodicRun {
            positions_mm: targets_mm.to_vec(),
            deviations_mm: (first..=last).map(mean).collect(),
            period_mm,
            n_harmonics,
        };
        let result =
            periodic::evaluate(&run, &measured.budget).map_err(|error| error.to_string())?;
        Ok(Found {
            name: test.name.clone(),
            first_run: test.first_run,
            direction,
            from_mm: targets_mm[0],
            to_mm: targets_mm[targets_mm.len() - 1],
            targets: targets_mm.len(),
            label: measured.is_by_own_scale.then_some(BY_OWN_SCALE),
            // What a scale is off by within a lead no certificate states.
            is_stated: measured.is_stated && !measured.is_by_own_scale,
            result,
        })
    };
    let read = sides.into_iter().filter(|(_, rows)| !rows.is_empty());
    read.map(one).collect()
}

/// As many harmonics as the steps (in periods) show without aliasing, and with twice as many targets as parameters.
fn harmonics(n_targets: usize, step: f64) -> usize {
    let by_step = (0.5 / step + 1e-6).floor() - 1.0;
    let by_number = (n_targets as f64 / 4.0 - 1.0).floor();
    by_step.min(by_number).clamp(1.0, MOST_HARMONICS) as usize
}

/// First and last target of the longest part in which no step is too great.
fn dense(targets_mm: &[f64], period_mm: f64) -> Result<(usize, usize), String> {
    let limit_mm = GREATEST_STEP * period_mm * (1.0 + 1e-9);
    let (mut best, mut begin) = ((0, 0), 0);
    let span_mm = |(from, to): (usize, usize)| {
        targets_mm.get(to).copied().unwrap_or(0.0) - targets_mm.get(from).copied().unwrap_or(0.0)
    };
    for at in 1..targets_mm.len() {
        if targets_mm[at] - targets_mm[at - 1] > limit_mm {
            begin = at;
        }
        if span_mm((begin, at)) > span_mm(best) {
            best = (begin, at);
        }
    }
    if span_mm(best) >= period_mm * (1.0 - 1e-9) {
        return Ok(best);
    }
    let mean_mm = span_mm((0, targets_mm.len().saturating_sub(1)))
        / targets_mm.len().saturating_sub(1).max(1) as f64;
    Err(format!(
        "targets lie {mean_mm:.3} mm apart on the average; an error with the period of {period_mm} mm, the lead, needs steps of at most {:.3} mm over {period_mm} mm at least",
        GREATEST_STEP * period_mm
    ))
}

impl Found {
    fn row(&self) -> Vec<String> {
        let result = &self.result;
        let amplitudes: Vec<String> = result
            .harmonics
            .iter()
            .map(|harmonic| um(harmonic.amplitude.value_mm))
            .collect();
        let p = result.harmonics.first().and_then(|first| first.p_value);
        vec![
            self.test(),
            format!("{:.2} to {:.2}", self.from_mm, self.to_mm),
            format!("{}", result.period_mm),
            figure(&result.periodic_error, self.is_stated),
            amplitudes.join(", "),
            p.map_or_else(|| "—".to_owned(), |p| format!("{p:.3}")),
            um(result.residual_standard_deviation_mm),
        ]
    }

    fn test(&self) -> String {
        let label = self
            .label
            .map_or_else(String::new, |why| format!(" ({why})"));
        format!(
            "{}, run {} on, {}{label}",
            self.name, self.first_run, self.direction
        )
    }

    /// For machines.
    fn as_json(&self) -> Value {
        let mut entry = json!(self);
        if !self.is_stated {
            unstate(&mut entry);
        }
        entry
    }

    fn unclear(&self) -> Option<String> {
        let p = self.result.harmonics.first()?.p_value?;
        (p > SIGNIFICANT).then(|| {
            format!(
                "{}, run {} on, {}: scatter alone shows as much with a probability of {p:.2}: no period is proven.",
                self.name, self.first_run, self.direction
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::path::Path;

    use machine::MachineFile;

    use super::*;
    use crate::evaluate::linear::Reference;

    #[test]
    fn the_longest_part_of_short_steps_is_taken_and_targets_that_alias_are_refused() {
        let mut targets = vec![0.0, 33.0];
        targets.extend((0..9).map(|k| 60.0 + 2.5 * f64::from(k)));
        targets.push(120.0);
        assert_eq!(dense(&targets, 10.0), Ok((2, 10)));
        // Steps of a fifth cover three quarters of a lead.
        assert!(dense(&[0.0, 2.0, 4.0, 6.0, 7.5], 10.0).is_err());
        let wide: Vec<f64> = (0..15).map(|k| 10.0 * f64::from(k)).collect();
        let said = dense(&wide, 10.0).unwrap_err();
        assert!(said.starts_with("targets lie 10.000 mm apart"), "{said}");
        assert!(said.contains("at most 2.500 mm"), "{said}");
        assert!(dense(&[], 10.0).is_err());
    }

    #[test]
    fn a_periodic_error_that_the_machines_scale_read_is_labelled_and_has_no_uncertainty() {
        let machine = include_str!("../../../../launch_configs/full_closed/machine.yaml");
        let budget = include_str!("../../../../launch_configs/full_closed/budget.yaml");
        let budget = Budget::read(budget, Path::new("budget.yaml")).unwrap();
        let targets_mm: Vec<f64> = (0..17).map(|k| 1.25 * f64::from(k)).collect();
        let wave = |at: &f64| 2e-3 * (TAU * at / 10.0).sin();
        let run: Vec<f64> = targets_mm.iter().map(wave).collect();
        for (reference, is_own) in [(Reference::Scale, true), (Reference::Length, false)] {
            let test = LinearTest {
                reference,
                ..LinearTest::along_x(3, targets_mm.clone(), run.clone())
            };
            let tests = Tests {
                linear: vec![test],
                machine: Some(MachineFile::parse(machine, "machine.yaml").unwrap()),
                ..Tests::default()
            };
            let section = section(&tests, Some(&budget)).unwrap();
            let entry = &section.figures["iso230_2_periodic"][0];
            let stated = &entry["result"]["periodic_error"];
            assert!(
                (stated["value_mm"].as_f64().unwrap() - 4e-3).abs() < 2e-4,
                "{entry}"
            );
            assert_eq!(entry["label"] == BY_OWN_SCALE, is_own, "{entry}");
            assert_eq!(
                stated["expanded_uncertainty_mm"].is_null(),
                is_own,
                "{entry}"
            );
            let row = &section.tables[0].rows[0];
            assert_eq!(row[0].contains(BY_OWN_SCALE), is_own, "{row:?}");
        }
    }

    #[test]
    fn tests_that_are_not_evaluated_are_one_remark_with_each_reason_once() {
        let refused = [
            ("X, run 3 on", "15 mm"),
            ("X, run 15 on", "20 mm"),
            ("X, run 46 on", "20 mm"),
        ];
        let refused =
            refused.map(|(test, why)| (test.to_owned(), format!("targets lie {why} apart")));
        assert_eq!(
            refused_in_words(&refused),
            "X, run 3 on: not evaluated: targets lie 15 mm apart. X, run 15 on; X, run 46 on: not evaluated: targets lie 20 mm apart."
        );
        let machine = include_str!("../../../../launch_configs/dual_loop/machine.yaml");
        let targets_mm: Vec<f64> = (0..9).map(|k| 20.0 * f64::from(k)).collect();
        let wide = |run: u32| LinearTest::along_x(run, targets_mm.clone(), vec![0.0; 9]);
        let tests = Tests {
            linear: [3, 15, 46].map(wide).to_vec(),
            machine: Some(MachineFile::parse(machine, "machine.yaml").unwrap()),
            ..Tests::default()
        };
        let section = section(&tests, None).unwrap();
        assert_eq!(section.warnings.len(), 1, "{:?}", section.lines);
    }

    #[test]
    fn steps_and_their_number_limit_the_harmonics() {
        for (n, step, wanted) in [
            (25, 0.125, 3),
            (25, 0.25, 1),
            (25, 0.2, 1),
            (100, 0.01, 4),
            (9, 0.125, 1),
            (5, 0.25, 1),
        ] {
            assert_eq!(harmonics(n, step), wanted, "{n} {step}");
        }
    }
}
