//! All machines: a list, or one figure of each beside the others.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use history::{Fleet, LEAST_MACHINES, Last, SeriesKey, Store, Window, fleet};
use reports::section::{Rows, Section, head};
use reports::terminal::Rank;
use serde_json::json;

use super::dates::{date, time};
use super::numbers::{shown, title};
use super::view::{Line, Page, SCHEMA};

/// The list of all machines.
///
/// # Errors
/// When the store cannot be read.
pub fn list(store: &Store) -> Result<Page> {
    let all = store.machines()?;
    let mut section = Section::new("Machines").ranked(Rank::Answer);
    if all.is_empty() {
        section.lines.push("The history is empty.".to_owned());
    }
    section.tables.push(Rows {
        head: head(&["machine", "entries", "first", "last"]),
        rows: all
            .iter()
            .map(|one| {
                vec![
                    one.machine.clone(),
                    one.entries.to_string(),
                    date(one.first_s as f64),
                    date(one.last_s as f64),
                ]
            })
            .collect(),
        note: String::new(),
    });
    let entry = |one: &history::MachineSummary| {
        json!({
            "machine": one.machine, "entries": one.entries,
            "first": time(one.first_s as f64), "last": time(one.last_s as f64),
        })
    };
    let entries: Vec<_> = all.iter().map(entry).collect();
    Ok(Page {
        title: "History".to_owned(),
        sections: vec![section],
        values: Vec::new(),
        json: json!({ "schema": SCHEMA, "machines": entries }),
    })
}

/// The last value of a figure of each machine, beside the others.
///
/// # Errors
/// When the store cannot be read, or has no such figure.
pub fn compare(store: &Store, key: &SeriesKey, name: &str, window: Window) -> Result<Page> {
    let is_within = |last: &Last| {
        let at_s = last.point.at_s as i64;
        (window.since_s..=window.until_s).contains(&at_s)
    };
    let mut groups: BTreeMap<[String; 4], Vec<Last>> = BTreeMap::new();
    for last in store.last_values(key)?.into_iter().filter(is_within) {
        let series = &last.series;
        let of = [&series.name, &series.axis, &series.test, &series.unit].map(Clone::clone);
        groups.entry(of).or_default().push(last);
    }
    if groups.is_empty() {
        bail!(
            "{name}: no machine has such a figure with this axis, test and dates: `abbe history MACHINE` lists those of one"
        );
    }
    let (mut sections, mut lists, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for group in groups.into_values() {
        let pairs: Vec<(String, f64)> = group
            .iter()
            .map(|last| (last.series.machine.clone(), last.point.value))
            .collect();
        let found = fleet(&pairs);
        sections.push(section(&group, &found));
        let machine = |(last, standing): (&Last, &history::Standing)| {
            json!({
                "machine": standing.machine, "value": standing.value,
                "standard_uncertainty": last.point.standard_uncertainty,
                "time": time(last.point.at_s), "values": last.n,
                "score": standing.score, "is_outlier": standing.is_outlier,
            })
        };
        let machines: Vec<_> = group.iter().zip(&found.machines).map(machine).collect();
        if let Some(last) = group.first() {
            lists.push(json!({
                "figure": last.series.name, "axis": last.series.axis, "test": last.series.test,
                "unit": last.series.unit, "median": found.median, "machines": machines,
            }));
        }
        values.extend(group.into_iter().map(|last| Line {
            series: last.series,
            point: last.point,
            status: String::new(),
            source: String::new(),
        }));
    }
    Ok(Page {
        title: format!("Machines beside each other: {name}"),
        sections,
        values,
        json: json!({ "schema": SCHEMA, "fleet": lists }),
    })
}

fn section(group: &[Last], found: &Fleet) -> Section {
    let Some(first) = group.first() else {
        return Section::default();
    };
    let shown = shown(&first.series);
    let mut section = Section::new(title(&first.series));
    let outliers: Vec<&str> = found
        .machines
        .iter()
        .filter(|one| one.is_outlier)
        .map(|one| one.machine.as_str())
        .collect();
    section.lines.push(if group.len() < LEAST_MACHINES {
        format!("Outliers are looked for from {LEAST_MACHINES} machines on.")
    } else if outliers.is_empty() {
        "No machine is an outlier.".to_owned()
    } else {
        format!("Outliers: {}.", outliers.join(", "))
    });
    let row = |(last, standing): (&Last, &history::Standing)| {
        let u = last.point.standard_uncertainty;
        vec![
            standing.machine.clone(),
            date(last.point.at_s),
            format!("{} {}", shown.value(standing.value, u), shown.unit),
            shown.expanded(u),
            standing
                .score
                .map_or_else(|| "—".to_owned(), |score| format!("{score:.1}")),
            if standing.is_outlier {
                "outlier".to_owned()
            } else {
                String::new()
            },
        ]
    };
    section.tables.push(Rows {
        head: head(&["machine", "last", "value", "± U (k = 2)", "score", ""]),
        rows: group.iter().zip(&found.machines).map(row).collect(),
        note:
            "Score: distance from the median in robust standard deviations; beyond 3.5 an outlier."
                .to_owned(),
    });
    section
}
