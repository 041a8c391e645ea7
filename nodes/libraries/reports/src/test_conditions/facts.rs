//! Instruments, operator and temperatures in a few words, for the first screen of a page.

use super::artefacts::certificates;
use super::{read_by, stated};
use crate::evaluate::Tests;
use crate::evaluate::budget::{Budget, NOT_STATED};
use crate::evaluate::test_conditions::{Readings, TestConditions};
use crate::section::capitalised;

/// What the first screen says of instruments, operator and temperatures; the date stands there already.
pub(super) fn of(
    seen: &TestConditions,
    budget: Option<&Budget>,
    tests: Option<&Tests>,
) -> Vec<(String, String)> {
    let instrument = |(key, name): (&str, &str)| {
        let [name_of_it, serial, certificate] = stated(budget, key)
            .texts()
            .map(|(_, text)| text.unwrap_or(NOT_STATED).to_owned());
        let text = format!("{name_of_it}; serial number {serial}; certificate {certificate}");
        (capitalised(name), text)
    };
    let mut facts: Vec<(String, String)> = { read_by(seen, tests).into_iter() }
        .map(instrument)
        .collect();
    facts.extend(certificates(tests).into_iter().map(|one| {
        let number = one.number.as_deref().unwrap_or("without number");
        (
            format!("Artefact {}", one.artefact),
            format!("certificate {number}"),
        )
    }));
    let operator = budget.and_then(|budget| budget.operator.clone());
    let operator = operator.unwrap_or_else(|| NOT_STATED.to_owned());
    facts.push(("Operator".to_owned(), operator));
    facts.push(("Temperature".to_owned(), temperatures(seen, budget)));
    facts
}

/// The temperatures in few words: those of one or two thermometers, of more the least and the greatest.
fn temperatures(seen: &TestConditions, budget: Option<&Budget>) -> String {
    let all = || seen.thermometers.values();
    let least_degc = all()
        .map(|read| read.least_degc)
        .fold(f64::INFINITY, f64::min);
    let greatest_degc = all()
        .map(|read| read.greatest_degc)
        .fold(f64::NEG_INFINITY, f64::max);
    match seen.thermometers.len() {
        0 => {
            let stated = budget.map_or_else(Vec::new, Budget::stated_temperatures);
            if stated.is_empty() {
                NOT_STATED.to_owned()
            } else {
                format!("stated: {}", stated.join(", "))
            }
        }
        1 | 2 => {
            let of = |(name, read): (&String, &Readings)| {
                format!(
                    "{name} {:.2} to {:.2} °C",
                    read.least_degc, read.greatest_degc
                )
            };
            let each: Vec<String> = seen.thermometers.iter().map(of).collect();
            each.join(", ")
        }
        n => format!("{least_degc:.2} to {greatest_degc:.2} °C at {n} thermometers"),
    }
}
