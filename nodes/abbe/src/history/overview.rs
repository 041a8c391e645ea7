//! One machine: its figures with their last values, the tests that are due, and the changes between two dates.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use history::{
    Difference, Due, Point, Series, SeriesKey, Store, Trend, Verdict, Window, YEAR_S, difference,
    due, latest_until,
};
use reports::section::{Rows, Section, head};
use reports::terminal::Rank;
use serde_json::{Value, json};

use super::dates::{DAY_S, Moment, date, time};
use super::numbers::{shown, title};
use super::view::{Line, Page, SCHEMA};

/// Most figures of an overview: each is read.
const MOST_FIGURES: usize = 2_000;

/// Most names in a sentence.
const MOST_NAMES: usize = 3;
/// Begin of the names of coefficients, of which a geometric model has hundreds.
const GEOMETRY_PREFIX: &str = "geometry.";

/// The overview of a machine.
///
/// # Errors
/// When the store cannot be read, or has too many figures.
pub fn of(
    store: &Store,
    machine: &str,
    key: &SeriesKey,
    every_days: Option<f64>,
    window: Window,
) -> Result<Page> {
    let (mut values, mut list) = (Vec::new(), Vec::new());
    let (mut rows, mut geometry, mut changing) = (Vec::new(), Vec::new(), Vec::new());
    for series in chosen(store, key)? {
        let kept = store.points(series.id, window)?;
        let points: Vec<Point> = kept.iter().map(|one| one.point).collect();
        let Some(last) = kept.into_iter().next_back() else {
            continue;
        };
        let (row, entry) = last_value(&series, &points, last.point);
        if entry["significant"] == true {
            changing.push(title(&series));
        }
        let is_geometry = series.name.starts_with(GEOMETRY_PREFIX);
        if is_geometry {
            &mut geometry
        } else {
            &mut rows
        }
        .push(row);
        list.push(entry);
        values.push(Line {
            series,
            point: last.point,
            status: last.status,
            source: last.source,
        });
    }
    let mut figures = Section::new("Figures").ranked(Rank::Answer);
    if !values.is_empty() {
        figures.answers.push(in_short(values.len(), &changing));
    }
    figures.tables.push(table(rows));
    let mut places = Section::new("Coefficients and places of geometric errors");
    places.answers.push(format!("{} figures.", geometry.len()));
    let has_places = !geometry.is_empty();
    places.tables.push(table(geometry));
    let (tests, due_list) = due_tests(store, machine, every_days)?;
    Ok(Page {
        title: format!("History of {machine}"),
        sections: std::iter::once(figures)
            .chain(has_places.then_some(places))
            .chain([tests])
            .collect(),
        values,
        json: json!({ "schema": SCHEMA, "machine": machine, "figures": list, "due": due_list }),
    })
}

/// Which figures change, in one sentence.
fn in_short(n: usize, changing: &[String]) -> String {
    let names = changing.iter().take(MOST_NAMES).cloned();
    let names = names.collect::<Vec<_>>().join("; ");
    match changing.len() {
        0 => format!("none of {n} changes significantly over the kept tests."),
        k if k > MOST_NAMES => format!(
            "{k} of {n} change significantly: {names}; and {} more.",
            k - MOST_NAMES
        ),
        k => format!("{k} of {n} change significantly: {names}."),
    }
}

fn table(rows: Vec<Vec<String>>) -> Rows {
    Rows {
        head: head(&[
            "figure",
            "values",
            "last",
            "value",
            "± U (k = 2)",
            "per year (95 %)",
        ]),
        rows,
        note: "*: significant. --figure or --effect shows changes, limits and the plot.".to_owned(),
    }
}

/// A figure in the overview: its row, and for machines.
fn last_value(series: &Series, points: &[Point], last: Point) -> (Vec<String>, Value) {
    let shown = shown(series);
    let trend = Trend::of(points);
    let slope = trend.as_ref().map_or_else(
        || "—".to_owned(),
        |trend| {
            let half_width = trend.slope_half_width_per_s() * YEAR_S;
            let slope = shown.with_half_width(trend.slope_per_s * YEAR_S, half_width);
            if trend.is_significant() {
                format!("{slope} *")
            } else {
                slope
            }
        },
    );
    let u = last.standard_uncertainty;
    let row = vec![
        title(series),
        points.len().to_string(),
        date(last.at_s),
        format!("{} {}", shown.value(last.value, u), shown.unit),
        shown.expanded(u),
        slope,
    ];
    let entry = json!({
        "test": series.test, "figure": series.name, "axis": series.axis, "unit": series.unit,
        "values": points.len(), "time": time(last.at_s), "value": last.value,
        "standard_uncertainty": u,
        "slope_per_year": trend.map(|trend| trend.slope_per_s * YEAR_S),
        "significant": trend.map(|trend| trend.is_significant()),
    });
    (row, entry)
}

/// The series of a key, as many as an overview takes.
fn chosen(store: &Store, key: &SeriesKey) -> Result<Vec<Series>> {
    let all = store.series(key)?;
    if all.len() > MOST_FIGURES {
        bail!(
            "{} figures match, at most {MOST_FIGURES} are shown at once: choose with --test, --figure or --effect",
            all.len()
        );
    }
    Ok(all)
}

/// When each test is due.
fn due_tests(
    store: &Store,
    machine: &str,
    every_days: Option<f64>,
) -> Result<(Section, Vec<Value>)> {
    let mut times: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (test, at_s) in store.test_times(machine)? {
        times.entry(test).or_default().push(at_s as f64);
    }
    let interval_s = every_days.map(|days| days * DAY_S);
    let now_s = chrono::Utc::now().timestamp() as f64;
    let mut all: Vec<(String, Due)> = times
        .into_iter()
        .filter_map(|(test, times)| Some((test, due(&times, interval_s)?)))
        .collect();
    // The longest due first; those without an interval last.
    let rank = |due: &Due| due.due_s.unwrap_or(f64::INFINITY);
    all.sort_by(|(_, a), (_, b)| rank(a).total_cmp(&rank(b)));
    let is_due = |due: &Due| due.due_s.is_some_and(|due_s| due_s <= now_s);
    let mut section = Section::new("Tests");
    let n_due = all.iter().filter(|(_, due)| is_due(due)).count();
    section
        .answers
        .push(format!("{n_due} of {} are due.", all.len()));
    let row = |(test, due): &(String, Due)| {
        let dash = || "—".to_owned();
        vec![
            test.clone(),
            date(due.last_s),
            due.interval_s
                .map_or_else(dash, |s| format!("{:.0}", s / DAY_S)),
            due.due_s.map_or_else(dash, date),
            if is_due(due) {
                "due".to_owned()
            } else {
                String::new()
            },
        ]
    };
    section.tables.push(Rows {
        head: head(&["test", "last", "interval / d", "due on", ""]),
        rows: all.iter().map(row).collect(),
        note: "The interval is that of --every-days, or the median of the machine's own from three tests on.".to_owned(),
    });
    let entry = |(test, due): &(String, Due)| {
        json!({
            "test": test, "last": time(due.last_s), "interval_s": due.interval_s,
            "due": due.due_s.map(time), "is_due": is_due(due),
        })
    };
    let list = all.iter().map(entry).collect();
    Ok((section, list))
}

/// The changes of a machine's figures between two dates: the last value up to each.
///
/// # Errors
/// When the store cannot be read, or the dates are not in order.
pub fn changes(
    store: &Store,
    machine: &str,
    key: &SeriesKey,
    [from, to]: [Moment; 2],
) -> Result<Page> {
    if from.end_s >= to.end_s {
        bail!("--between: the first date must come before the second");
    }
    let (mut rows, mut list, mut n_alone) = (Vec::new(), Vec::new(), 0_usize);
    for series in chosen(store, key)? {
        let kept = store.points(series.id, Window::ALL)?;
        let points: Vec<Point> = kept.iter().map(|one| one.point).collect();
        let ends = [from.end_s, to.end_s].map(|end_s| latest_until(&points, end_s as f64));
        let [Some(before), Some(after)] = ends else {
            n_alone += 1;
            continue;
        };
        let (row, entry) = changed(&series, &difference(before, after));
        rows.push(row);
        list.push(entry);
    }
    let mut section = Section::new("Changes").ranked(Rank::Answer);
    if n_alone > 0 {
        section.lines.push(format!(
            "{n_alone} figures have no value up to the first date."
        ));
    }
    section.tables.push(Rows {
        head: head(&["figure", "before", "after", "change ± U (k = 2)", ""]),
        rows,
        note: "U has the uncertainties of both values as if they shared no error.".to_owned(),
    });
    let dates = [from, to]
        .map(|moment| date(moment.end_s as f64))
        .join(" and ");
    Ok(Page {
        title: format!("Changes of {machine} between {dates}"),
        sections: vec![section],
        values: Vec::new(),
        json: json!({ "schema": SCHEMA, "machine": machine, "changes": list }),
    })
}

/// A figure's change: its row, and for machines.
fn changed(series: &Series, found: &Difference) -> (Vec<String>, Value) {
    let shown = shown(series);
    let (word, verdict) = match found.verdict {
        Verdict::Changed => ("changed", "changed"),
        Verdict::WithinUncertainty => ("within U", "within_uncertainty"),
        Verdict::NotDecided => ("not decided: no uncertainty", "not_decided"),
    };
    let of = |point: Point| {
        let value = shown.value(point.value, point.standard_uncertainty);
        format!("{value} ({})", date(point.at_s))
    };
    let half_width = found.expanded_uncertainty.unwrap_or(0.0);
    let row = vec![
        title(series),
        of(found.before),
        of(found.after),
        shown.with_half_width(found.change, half_width),
        word.to_owned(),
    ];
    let entry = json!({
        "test": series.test, "figure": series.name, "axis": series.axis, "unit": series.unit,
        "before": found.before.value, "before_time": time(found.before.at_s),
        "after": found.after.value, "after_time": time(found.after.at_s),
        "change": found.change, "expanded_uncertainty": found.expanded_uncertainty,
        "verdict": verdict,
    });
    (row, entry)
}
