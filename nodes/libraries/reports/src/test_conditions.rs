//! Under which conditions the tests of a page ran, and what is not stated about them.

use chrono::DateTime;
use metrology::stamp::{Host, Stamp};
use serde_json::{Value, json};

use super::plot::{self, Plot, Trace};
use super::section::{Drawing, Rows, Section, head};
use crate::evaluate::Tests;
use crate::evaluate::budget::{Budget, Instrument, NOT_STATED};
use crate::evaluate::circle_reading::CircleReading;
use crate::evaluate::circles::{self, CircleRecording};
use crate::evaluate::correction::{About, Measured};
use crate::evaluate::course::Course;
use crate::evaluate::linear::LinearTest;
use crate::evaluate::test_conditions::{Readings, TestConditions};

/// The conditions: whole for page and JSON, a few lines for a terminal.
pub struct Conditions {
    /// The whole.
    pub section: Section,
    short: Vec<String>,
}

impl Conditions {
    /// For a terminal.
    #[must_use]
    pub fn terminal(&self) -> String {
        let lines = self.short.iter().map(|line| format!("{line}\n"));
        format!("{}\n{}", self.section.title, lines.collect::<String>())
    }
}

/// One condition.
struct Condition {
    name: String,
    value: Option<String>,
    /// Where it is stated.
    place: String,
}

impl Condition {
    fn new(name: impl Into<String>, value: Option<String>, place: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            value,
            place: place.into(),
        }
    }

    fn row(&self) -> Vec<String> {
        let missing = || format!("{NOT_STATED} ({})", self.place);
        vec![
            self.name.clone(),
            self.value.clone().unwrap_or_else(missing),
        ]
    }

    fn short(&self) -> String {
        format!(
            "{} {}",
            self.name,
            self.value.as_deref().unwrap_or(NOT_STATED)
        )
    }
}

/// Columns of the table of thermometers.
const THERMOMETER_COLUMNS: [&str; 6] = [
    "thermometer / °C",
    "first",
    "last",
    "least",
    "greatest",
    "range / K",
];

/// The conditions of a bag; `tests` where they were evaluated.
#[must_use]
pub fn of(seen: &TestConditions, budget: Option<&Budget>, tests: Option<&Tests>) -> Conditions {
    let mut section = Section::new("Conditions of the measurement");
    let run = run_of(seen, budget, tests);
    let instruments = instruments_of(seen, budget, tests);
    let correction = correction_of(tests, budget);
    let rows = run.iter().chain(&instruments).map(Condition::row);
    let last = vec!["correction to 20 °C".to_owned(), correction.clone()];
    section.tables.push(Rows {
        head: head(&["condition", "value"]),
        rows: rows.chain([last]).collect(),
        note: String::new(),
    });
    let temperatures: Vec<Vec<String>> = (seen.thermometers.iter())
        .map(|(name, read)| temperature_row(name, read))
        .collect();
    let mut short = vec![joined(&run), joined(&instruments)];
    if temperatures.is_empty() {
        let words = without_thermometer(budget);
        section.lines.push(words.clone());
        short.push(words);
    } else {
        let of = |(name, read): (&String, &Readings)| {
            format!(
                "{name} {:.2} to {:.2} °C (range {:.2} K)",
                read.first_degc,
                read.last_degc,
                read.range_k()
            )
        };
        let all: Vec<String> = seen.thermometers.iter().map(of).collect();
        short.push(format!("Thermometers, first to last: {}.", all.join(", ")));
        section.tables.push(Rows {
            head: head(&THERMOMETER_COLUMNS),
            rows: temperatures,
            note: "From the first test to the last one.".to_owned(),
        });
    }
    match drawing(seen) {
        Ok(drawn) => section.drawings.extend(drawn),
        Err(error) => section
            .lines
            .push(format!("Temperatures are not drawn: {error:#}.")),
    }
    short.push(format!("Correction to 20 °C: {correction}."));
    short.retain(|line| !line.is_empty());
    section.figures = json!({
        "begin": seen.between.map(|(first, _)| date(first)),
        "end": seen.between.map(|(_, last)| date(last)),
        "feeds_mm_min": seen.feeds_mm_s.iter().map(|feed| feed * 60.0).collect::<Vec<f64>>(),
        "production_before_s": seen.production_before_s,
        "warm_up": budget.and_then(|budget| budget.warm_up.clone()),
        "operator": budget.and_then(|budget| budget.operator.clone()),
        "instruments": instruments_json(seen, budget, tests),
        "thermometers": seen.thermometers.iter().map(temperature_json).collect::<Vec<Value>>(),
        "correction_to_20_degc": correction,
    });
    Conditions { section, short }
}

/// Fewest readings of a thermometer that make a curve.
const FEWEST_READINGS: usize = 3;
/// Most thermometers of one drawing.
const MOST_THERMOMETERS: usize = 12;

/// What the thermometers read over the time of the bag; `None` where none was read often enough.
fn drawing(seen: &TestConditions) -> anyhow::Result<Option<Drawing>> {
    let curves = || {
        seen.courses
            .iter()
            .filter(|(_, one)| one.points().len() >= FEWEST_READINGS)
    };
    let first = curves()
        .filter_map(|(_, one)| Some(one.points().first()?.0))
        .min();
    let last = curves()
        .filter_map(|(_, one)| Some(one.points().last()?.0))
        .max();
    let (Some(first), Some(last)) = (first, last) else {
        return Ok(None);
    };
    let is_short = (last - first).as_secs_f64() < 3600.0;
    let (unit, unit_s) = if is_short {
        ("min", 60.0)
    } else {
        ("h", 3600.0)
    };
    let trace = |(name, one): (&String, &Course<f64>)| Trace {
        name: name.clone(),
        points: { one.points().iter() }
            .map(|(at, degc)| ((*at - first).as_secs_f64() / unit_s, *degc))
            .collect(),
        marks: false,
    };
    let left = curves().count().saturating_sub(MOST_THERMOMETERS);
    let more = match left {
        0 => String::new(),
        n => format!(" {n} more are in the table alone."),
    };
    Ok(Some(Drawing {
        svg: plot::svg(&Plot {
            x: format!("time since the first reading / {unit}"),
            y: "temperature / °C".to_owned(),
            traces: curves().take(MOST_THERMOMETERS).map(trace).collect(),
        })?,
        caption: format!("Thermometers over the whole bag.{more}"),
    }))
}

const NO_THERMOMETER: &str = "Temperatures not stated: no thermometer was read. Name thermometers in temperature_sensors of the machine file, or state temperature_deviation_k in budget.yaml.";

/// What is known of the temperatures where no thermometer was read.
fn without_thermometer(budget: Option<&Budget>) -> String {
    let stated = budget.map_or_else(Vec::new, Budget::stated_temperatures);
    if stated.is_empty() {
        return NO_THERMOMETER.to_owned();
    }
    format!(
        "Temperatures as the budget states them, no thermometer was read: {}.",
        stated.join(", ")
    )
}

fn joined(conditions: &[Condition]) -> String {
    let all: Vec<String> = conditions.iter().map(Condition::short).collect();
    if all.is_empty() {
        return String::new();
    }
    format!("{}.", all.join("; "))
}

/// Date and time, feed, dwell, what was before, and who measured.
fn run_of(seen: &TestConditions, budget: Option<&Budget>, tests: Option<&Tests>) -> Vec<Condition> {
    let between = seen.between.map(|(first, last)| {
        let (first, last) = (date(first), date(last));
        format!("{first} to {last}")
    });
    let feeds = listed(
        seen.feeds_mm_s
            .iter()
            .map(|feed| format!("{:.0}", feed * 60.0)),
    );
    let of_lines = tests.into_iter().flat_map(|tests| &tests.linear);
    let of_rotary = tests
        .into_iter()
        .flat_map(|tests| &tests.rotary_positioning);
    let dwells = of_lines
        .filter_map(|test| test.longest_rest)
        .chain(of_rotary.filter_map(|test| test.longest_rest));
    let dwells = listed(dwells.map(|rest| format!("{:.1}", rest.as_secs_f64())));
    let stated = |text: fn(&Budget) -> &Option<String>| budget.and_then(|one| text(one).clone());
    let before_min = seen.production_before_s / 60.0;
    vec![
        Condition::new("date", between, "the bag holds no test"),
        Condition::new(
            "feed",
            feeds.map(|feeds| format!("{feeds} mm/min")),
            "feed_mm_min of the plan's steps",
        ),
        Condition::new(
            "dwell",
            dwells.map(|dwells| format!("{dwells} s")),
            "dwell_s of the plan's steps; no stop was evaluated",
        ),
        Condition::new(
            "production before the first test",
            Some(format!("{before_min:.0} min in this bag")),
            "",
        ),
        Condition::new(
            "warm-up",
            stated(|budget| &budget.warm_up),
            "warm_up in budget.yaml",
        ),
        Condition::new(
            "operator",
            stated(|budget| &budget.operator),
            "operator in budget.yaml",
        ),
    ]
}

/// Each text once, in the order of coming.
fn listed(texts: impl Iterator<Item = String>) -> Option<String> {
    let mut once: Vec<String> = Vec::new();
    for text in texts {
        if !once.contains(&text) {
            once.push(text);
        }
    }
    (!once.is_empty()).then(|| once.join(", "))
}

/// Instruments that were read, by the name of their key and in words.
fn read_by(seen: &TestConditions, tests: Option<&Tests>) -> Vec<(&'static str, &'static str)> {
    let has_angles =
        tests.is_some_and(|tests| tests.rotary_positioning.iter().any(|one| one.has_readings));
    let is_by_ballbar =
        |circle: &CircleRecording| circle.instrument == circles::Instrument::Ballbar;
    let has_ballbar = tests.is_some_and(|tests| tests.circles.iter().any(is_by_ballbar));
    let has_line = tests.is_some_and(|tests| !tests.linear.is_empty());
    let has_reference = seen.has_length && (has_line || !has_ballbar);
    [
        (has_reference, "length_reference", "length reference"),
        (has_angles, "angular_reference", "angular reference"),
        (has_ballbar, "ballbar", "ballbar"),
        (seen.has_grid, "grid_encoder", "grid encoder"),
        (seen.has_touches, "touch_probe", "touch probe"),
    ]
    .into_iter()
    .filter_map(|(is_read, key, name)| is_read.then_some((key, name)))
    .collect()
}

fn stated(budget: Option<&Budget>, key: &str) -> Instrument {
    let all = budget.map(|budget| budget.instruments.clone());
    let all = all.unwrap_or_default();
    match key {
        "length_reference" => all.length_reference,
        "angular_reference" => all.angular_reference,
        "ballbar" => all.ballbar,
        "grid_encoder" => all.grid_encoder,
        _ => all.touch_probe,
    }
}

fn instruments_of(
    seen: &TestConditions,
    budget: Option<&Budget>,
    tests: Option<&Tests>,
) -> Vec<Condition> {
    let mut all = Vec::new();
    for (key, name) in read_by(seen, tests) {
        for (what, text) in stated(budget, key).texts() {
            let place = format!("instruments.{key}.{what} in budget.yaml");
            let name = match what {
                "instrument" => name.to_owned(),
                what => format!("{name}, {}", what.replace('_', " ")),
            };
            all.push(Condition::new(name, text.map(str::to_owned), place));
        }
    }
    all
}

fn instruments_json(
    seen: &TestConditions,
    budget: Option<&Budget>,
    tests: Option<&Tests>,
) -> Value {
    let of = |(key, _): (&str, &str)| {
        let instrument = stated(budget, key);
        json!({
            "kind": key,
            "instrument": instrument.instrument,
            "serial_number": instrument.serial_number,
            "certificate": instrument.certificate,
        })
    };
    read_by(seen, tests).into_iter().map(of).collect()
}

/// Which of the tests have the lengths that they have at 20 °C.
fn correction_of(tests: Option<&Tests>, budget: Option<&Budget>) -> String {
    let Some(tests) = tests.filter(|t| !t.linear.is_empty() || !t.circles.is_empty()) else {
        return "not done: lengths, radii and locations are as measured".to_owned();
    };
    let of_line = |test: &LinearTest| {
        Measured::of(tests, budget, About::line(test))
            .correction
            .lacks()
    };
    let of_circle = |circle: &CircleRecording| {
        let read = tests.conditions.during(&[circle.segment.run]);
        let reading = CircleReading::of(budget, &read, circle.instrument);
        reading.no_verdict_on_radii()
    };
    let lines = tests.linear.iter().map(of_line).collect();
    let circles = tests.circles.iter().map(of_circle).collect();
    let parts: [(Vec<Option<String>>, &str); 2] = [
        (lines, "tests of positioning and diagonals"),
        (circles, "circles (D and F)"),
    ];
    let of_part = |(all, what): &(Vec<Option<String>>, &str)| {
        let n_done = all.iter().filter(|why| why.is_none()).count();
        (!all.is_empty()).then(|| format!("{n_done} of {} {what}", all.len()))
    };
    let done: Vec<String> = parts.iter().filter_map(of_part).collect();
    let done = format!("done for {}", done.join(", "));
    match listed(parts.into_iter().flat_map(|(all, _)| all).flatten()) {
        None => done,
        Some(why) => format!("{done}; {why}"),
    }
}

fn date(at: Stamp<Host>) -> String {
    let known = DateTime::from_timestamp_nanos(at.nanos());
    known.format("%Y-%m-%d %H:%M:%S UTC").to_string()
}

fn temperature_row(name: &str, read: &Readings) -> Vec<String> {
    let of = |value: f64| format!("{value:.2}");
    vec![
        name.to_owned(),
        of(read.first_degc),
        of(read.last_degc),
        of(read.least_degc),
        of(read.greatest_degc),
        of(read.range_k()),
    ]
}

fn temperature_json((name, read): (&String, &Readings)) -> Value {
    json!({
        "thermometer": name,
        "first_degc": read.first_degc,
        "last_degc": read.last_degc,
        "least_degc": read.least_degc,
        "greatest_degc": read.greatest_degc,
        "range_k": read.range_k(),
        "readings": read.n,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::angular::RotaryTest;
    use metrology::Axis;
    use metrology::stamp::Span;
    use std::path::Path;

    #[test]
    fn a_rotary_test_has_its_reference_and_its_dwell_among_the_conditions() {
        let tests = Tests {
            rotary_positioning: vec![RotaryTest {
                axis: Axis::C,
                first_run: 1,
                targets_rad: vec![0.0, 1.0],
                up_rad: vec![],
                down_rad: vec![],
                mean_rad: 0.0,
                outlying: Default::default(),
                left_out: vec![],
                longest_rest: Some(Span::from_nanos(2_000_000_000)),
                has_readings: true,
            }],
            ..Tests::default()
        };
        // What stands before its own instruments.
        let text = include_str!("../../../../launch_configs/diagonals/budget.yaml");
        let text = text.split("instruments:").next().unwrap();
        let text = format!(
            "{text}\ninstruments: {{angular_reference: {{instrument: an encoder, certificate: K 9 of 2026-01-02}}}}\n"
        );
        let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
        let found = of(&TestConditions::default(), Some(&budget), Some(&tests));
        let rows = &found.section.tables[0].rows;
        for (name, value) in [
            ("dwell", "2.0 s"),
            ("angular reference", "an encoder"),
            ("angular reference, certificate", "K 9 of 2026-01-02"),
        ] {
            let row = rows.iter().find(|row| row[0] == name);
            assert_eq!(row.map(|row| row[1].as_str()), Some(value), "{rows:?}");
        }
        let kinds = &found.section.figures["instruments"];
        assert_eq!(kinds[0]["kind"], "angular_reference", "{kinds}");
    }

    #[test]
    fn what_is_not_stated_is_named_with_where_to_state_it() {
        let mut seen = TestConditions::default();
        seen.between = Some((
            Stamp::from_nanos(1_767_600_000_000_000_000),
            Stamp::from_nanos(1_767_603_600_000_000_000),
        ));
        seen.has_length = true;
        seen.feeds_mm_s = vec![100.0];
        let cell = |conditions: &Conditions, name: &str| -> String {
            let rows = &conditions.section.tables[0].rows;
            let found = rows.iter().find(|row| row[0] == name);
            found.unwrap_or_else(|| panic!("{name}: {rows:?}"))[1].clone()
        };
        let silent = of(&seen, None, None);
        assert_eq!(
            cell(&silent, "date"),
            "2026-01-05 08:00:00 UTC to 2026-01-05 09:00:00 UTC"
        );
        assert_eq!(cell(&silent, "feed"), "6000 mm/min");
        assert_eq!(
            cell(&silent, "length reference, serial number"),
            "not stated (instruments.length_reference.serial_number in budget.yaml)"
        );
        assert!(cell(&silent, "operator").starts_with("not stated (operator in budget.yaml"));
        assert!(silent.terminal().contains("Temperatures not stated"));
        assert!(silent.terminal().contains("Correction to 20 °C: not done"));
        // What stands before its own instruments.
        let text = include_str!("../../../../launch_configs/diagonals/budget.yaml");
        let text = text.split("instruments:").next().unwrap();
        let budget = Budget::read(text, Path::new("budget.yaml")).unwrap();
        let stated = of(&seen, Some(&budget), None).terminal();
        assert!(
            stated.contains("no thermometer was read: machine 2"),
            "{stated}"
        );
        assert!(!stated.contains("Temperatures not stated"), "{stated}");
        seen.thermometers
            .insert("bed".to_owned(), Readings::new(21.5));
        let text = format!(
            "{text}\ninstruments: {{length_reference: {{instrument: a laser, serial_number: 12-3, certificate: K 7 of 2026-01-02}}}}\noperator: A. B.\nwarm_up: an hour of G0 along X\n"
        );
        let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
        let whole = of(&seen, Some(&budget), None);
        assert_eq!(cell(&whole, "length reference, serial number"), "12-3");
        assert_eq!(whole.section.figures["operator"], "A. B.");
        let instrument = &whole.section.figures["instruments"][0];
        assert_eq!(instrument["certificate"], "K 7 of 2026-01-02");
        let terminal = whole.terminal();
        assert!(
            terminal.contains("dwell not stated; production"),
            "{terminal}"
        );
        assert!(terminal.contains("operator A. B."), "{terminal}");
        assert!(terminal.contains("bed 21.50 to 21.50 °C (range 0.00 K)"));
    }
}
