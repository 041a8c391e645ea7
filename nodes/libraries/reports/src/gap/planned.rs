//! The page of a forecast: what a programme will be able to show.

use gap_diagnosis::preflight::{Foreseen, IMITATED, Preflight, WANTED_REPEATS};
use maud::html;

use super::{matrix, name, section, three};
use crate::Report;
use crate::screen::Screen;
use crate::section::Section;
use crate::terminal::{self, Part, Rank};

/// Names of other effects in one cell.
const MOST_NAMES: usize = 3;

/// The page of a programme of so many minutes.
pub fn page(title: &str, forecast: &Preflight, minutes: f64) -> Report {
    let lines = sentences(forecast, minutes);
    let sections: Vec<Section> = [
        effects(forecast),
        hidden(forecast),
        floor(forecast).ranked(Rank::Detail),
    ]
    .into_iter()
    .filter(|section| section.tables.iter().any(|table| !table.rows.is_empty()))
    .collect();
    Report {
        title: title.to_owned(),
        parts: terminal::apart(sections.iter().map(Part::of)),
        screen: Screen::default(),
        body: html! {
            h2 { (title) }
            (matrix::style())
            @for line in &lines { p { (line) } }
            @for section in &sections { (section.html()) }
            (matrix::isolability(&forecast.isolability))
        },
        figures: serde_json::json!({ "minutes": minutes, "forecast": forecast }),
        lines,
    }
}

fn title_of(effect: &Foreseen) -> String {
    name(&effect.effect, &effect.axis)
}

fn sentences(forecast: &Preflight, minutes: f64) -> Vec<String> {
    let few: Vec<&str> = forecast
        .channels
        .iter()
        .filter(|channel| channel.repeats < WANTED_REPEATS)
        .map(|channel| channel.channel.as_str())
        .collect();
    let beyond = forecast.effects.iter();
    let beyond = beyond
        .filter(|effect| effect.found_from > effect.greatest)
        .count();
    let beyond = match beyond {
        0 => String::new(),
        n => format!(", {n} of them only beyond what is physical"),
    };
    let mut lines = vec![
        format!(
            "{} runs in {} min on an ideal machine; {}.",
            forecast.runs,
            three(minutes),
            held_out(forecast)
        ),
        format!(
            "{} effects of the catalogue would show{beyond}; {} kinds would not.",
            forecast.effects.len(),
            forecast.not_excited.len()
        ),
    ];
    if !few.is_empty() {
        lines.push(format!(
            "A noise floor wants {WANTED_REPEATS} repeats of one test: {} would have fewer.",
            few.join(", ")
        ));
    }
    lines.push(imitated(forecast));
    lines
}

fn held_out(forecast: &Preflight) -> String {
    let runs: Vec<String> = forecast.held_out_runs.iter().map(u32::to_string).collect();
    match runs.len() {
        0 => {
            "nothing could be held out: run each test at a second radius, feed or place".to_owned()
        }
        _ => format!("runs {} would be held out", runs.join(", ")),
    }
}

fn imitated(forecast: &Preflight) -> String {
    let imitated = forecast.effects.iter();
    let imitated = imitated.filter(|effect| effect.sin_alone < IMITATED);
    let names: Vec<String> = imitated.map(title_of).collect();
    if names.is_empty() {
        return "Every one of them can be told from the others.".to_owned();
    }
    format!(
        "Cannot be told from others (sine below {IMITATED}): {}.",
        names.join(", ")
    )
}

/// From which size others cannot imitate it; never where that is beyond what is physical.
fn told_apart(effect: &Foreseen) -> String {
    let from = effect
        .told_apart_from
        .filter(|from| *from <= effect.greatest);
    from.map_or_else(|| "never".to_owned(), three)
}

fn effects(forecast: &Preflight) -> Section {
    let rows = forecast.effects.iter().map(|effect| {
        let alike: Vec<String> = effect
            .alike
            .iter()
            .take(MOST_NAMES)
            .map(|(name, cos)| format!("{name} {cos:.2}"))
            .collect();
        vec![
            title_of(effect),
            three(effect.found_from),
            told_apart(effect),
            three(effect.typical),
            effect.parameter.clone(),
            three(effect.sin_alone),
            alike.join(", "),
        ]
    });
    section(
        "What would be found",
        &[
            "effect",
            "found from",
            "told apart from",
            "typical",
            "key of the machine file",
            "sine alone",
            "looks like (cosine)",
        ],
        rows.collect(),
        "Found from: the smallest size that 95 of 100 such recordings would show; told apart from: the smallest that no combination of other effects would imitate (never: some combination does at any size; a diagnosis names what explains with the fewest). Both for the noise below.",
    )
}

fn hidden(forecast: &Preflight) -> Section {
    let rows = forecast.not_excited.iter();
    let rows = rows.map(|effect| vec![name(&effect.effect, ""), effect.needs.clone()]);
    section(
        "What would not show",
        &["effect", "needs"],
        rows.collect(),
        "Temperatures stand still in a forecast: what follows a thermometer shows only in a recording.",
    )
}

fn floor(forecast: &Preflight) -> Section {
    let rows = forecast.channels.iter().map(|channel| {
        vec![
            channel.channel.clone(),
            channel.runs.to_string(),
            channel.repeats.to_string(),
            three(channel.floor.reading_um),
            three(channel.floor.between_runs_um),
        ]
    });
    section(
        "Noise that is assumed",
        &[
            "channel",
            "runs",
            "repeats",
            "of a reading µm",
            "between runs µm",
        ],
        rows.collect(),
        "Rotary axes in mrad. Say what your instruments have with --floor INSTRUMENT=READING/BETWEEN.",
    )
}
