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
use crate::evaluate::imported::{Imported, OfMap};
use crate::evaluate::linear::LinearTest;
use crate::evaluate::test_conditions::{Readings, TestConditions};

mod artefacts;
mod facts;

/// The conditions: whole for page and JSON, a few lines for a terminal.
pub struct Conditions {
    /// The whole.
    pub section: Section,
    /// Instruments, operator and temperatures, for the first screen: name and text.
    pub facts: Vec<(String, String)>,
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
    let artefacts = artefacts::conditions(tests);
    section
        .tables
        .push(table_of([&run, &instruments, &artefacts], &correction));
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
    for (name, dead) in seen.dead() {
        let words = format!("Dead instrument: {}.", dead.in_words(name));
        section.lines.push(words.clone());
        short.push(words);
    }
    match drawing(seen) {
        Ok(drawn) => section.drawings.extend(drawn),
        Err(error) => section
            .lines
            .push(format!("Temperatures are not drawn: {error:#}.")),
    }
    short.push(format!("Correction to 20 °C: {correction}."));
    short.retain(|line| !line.is_empty());
    section.figures = figures_of(seen, (budget, tests), &correction);
    Conditions {
        facts: facts::of(seen, budget, tests),
        section,
        short,
    }
}

fn table_of(conditions: [&[Condition]; 3], correction: &str) -> Rows {
    let rows = conditions.into_iter().flatten().map(Condition::row);
    let last = vec!["correction to 20 °C".to_owned(), correction.to_owned()];
    Rows {
        head: head(&["condition", "value"]),
        rows: rows.chain([last]).collect(),
        note: String::new(),
    }
}

/// The conditions for machines.
fn figures_of(
    seen: &TestConditions,
    (budget, tests): (Option<&Budget>, Option<&Tests>),
    correction: &str,
) -> Value {
    let imported = seen.imported.as_ref();
    let is_made_up = imported.is_some_and(Imported::is_motion_made_up);
    let later = seen.production_before_later.iter();
    let later: Vec<Value> = later
        .map(|(run, before_s)| json!({ "run": run, "production_before_s": before_s }))
        .collect();
    json!({
        "begin": seen.nanos().map(|(first, _)| date(Stamp::from_nanos(first))),
        "end": seen.nanos().filter(|_| !is_made_up).map(|(_, last)| date(Stamp::from_nanos(last))),
        "feeds_mm_min": feeds_mm_min(seen),
        "production_before_s": seen.imported.is_none().then_some(seen.production_before_s),
        "production_before_later": later,
        "warm_up": budget.and_then(|budget| budget.warm_up.clone()),
        "operator": budget.and_then(|budget| budget.operator.clone()),
        "instruments": instruments_json(seen, budget, tests),
        "thermometers": seen.thermometers.iter().map(temperature_json).collect::<Vec<Value>>(),
        "correction_to_20_degc": correction,
    })
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
    let of_stations = tests.into_iter().flat_map(|tests| &tests.station_circles);
    let dwells = of_lines
        .filter_map(|test| test.longest_rest)
        .chain(of_rotary.filter_map(|test| test.longest_rest))
        .chain(of_stations.filter_map(|circle| circle.longest_rest));
    let dwells = listed(dwells.map(|rest| format!("{:.1}", rest.as_secs_f64())));
    let mut conditions = match &seen.imported {
        Some(table) => vec![
            date_of_table(table, between),
            of_table("feed", table.feed()),
            of_table("dwell", table.dwell()),
            Condition::new("production before the first test", None, NOT_IN_TABLE),
        ],
        None => of_recording(seen, between, feeds, dwells),
    };
    conditions.extend(people(budget));
    conditions
}

/// Productions between tests that are listed one by one.
const FEW_PRODUCTIONS: usize = 3;

/// The conditions of a recording.
fn of_recording(
    seen: &TestConditions,
    between: Option<String>,
    feeds: Option<String>,
    dwells: Option<String>,
) -> Vec<Condition> {
    let before_min = seen.production_before_s / 60.0;
    let mut conditions = vec![
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
    ];
    let later = production_before_later(seen)
        .map(|later| Condition::new("production before later tests", Some(later), ""));
    conditions.extend(later);
    conditions
}

/// How long production had run when later tests began; empty where nothing was produced between the tests.
fn production_before_later(seen: &TestConditions) -> Option<String> {
    let words = |(run, before_s): &(u32, f64)| {
        format!("{:.0} min in this bag before run {run} on", before_s / 60.0)
    };
    let later = &seen.production_before_later;
    if later.len() > FEW_PRODUCTIONS {
        let (first, last) = (later.first()?, later.last()?);
        return Some(format!("{}, to {}", words(first), words(last)));
    }
    let each: Vec<String> = later.iter().map(words).collect();
    (!each.is_empty()).then(|| each.join("; "))
}

/// Where a table and its map say nothing.
const NOT_IN_TABLE: &str = "not in the table";

/// When the measurement of a table began; a log has times of its own.
fn date_of_table(table: &Imported, between: Option<String>) -> Condition {
    let begin = of_table("date", table.begin());
    if table.is_motion_made_up() || begin.value.is_none() {
        return begin;
    }
    Condition::new("date", between, NOT_IN_TABLE)
}

/// A value of a map; one that was assumed is no condition of the measurement.
fn of_table(name: &str, value: OfMap) -> Condition {
    match value {
        OfMap::Stated(words) => Condition::new(name, Some(words), ""),
        OfMap::Assumed(words) => {
            let place = format!("{NOT_IN_TABLE}; {words} was assumed");
            Condition::new(name, None, place)
        }
        OfMap::Absent => Condition::new(name, None, NOT_IN_TABLE),
    }
}

/// Programmed feeds, mm/min; of a table that which a person stated.
fn feeds_mm_min(seen: &TestConditions) -> Vec<f64> {
    match &seen.imported {
        Some(table) => table.stated_feed_mm_min().into_iter().collect(),
        None => seen.feeds_mm_s.iter().map(|feed| feed * 60.0).collect(),
    }
}

/// What a person states beside the recording.
fn people(budget: Option<&Budget>) -> [Condition; 2] {
    let stated = |text: fn(&Budget) -> &Option<String>| budget.and_then(|one| text(one).clone());
    [
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
mod tests;
