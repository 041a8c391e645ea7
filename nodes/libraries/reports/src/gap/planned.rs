//! The page of a forecast: what a programme will be able to show.

use gap_diagnosis::preflight::{Foreseen, IMITATED, Preflight, WANTED_REPEATS};
use maud::{Markup, html};

use super::words::{name_of, with_unit};
use super::{look_alikes, name, section, three};
use crate::Report;
use crate::bars::{self, Bar};
use crate::page::figure;
use crate::screen::{Screen, Tile, Tone};
use crate::section::Section;
use crate::terminal::{self, Part, Rank};

/// Most bars of the first screen.
const MOST_BARS_OF_KINDS: usize = 8;
/// Names of other effects in one cell.
const MOST_NAMES: usize = 3;

/// What a rehearsal of a programme has besides its forecast.
#[derive(Clone, Copy, Debug)]
pub struct Rehearsed<'r> {
    /// How long it takes.
    pub minutes: f64,
    /// Block cycles that the thermal model asks for.
    pub requested: u32,
    /// Whether production serves block cycles, and nobody is known that asks for them.
    pub is_unasked: bool,
    /// How far each thermometer is assumed to change, K.
    pub changes_k: &'r [(String, f64)],
}

/// The page of a programme.
pub fn page(title: &str, forecast: &Preflight, rehearsed: &Rehearsed<'_>) -> Report {
    let mut lines = sentences(forecast, rehearsed.minutes);
    lines.extend(besides(rehearsed));
    let sections: Vec<Section> = [
        effects(forecast),
        hidden(forecast),
        temperatures(rehearsed).ranked(Rank::Detail),
        floor(forecast).ranked(Rank::Detail),
    ]
    .into_iter()
    .filter(|section| section.tables.iter().any(|table| !table.rows.is_empty()))
    .collect();
    Report {
        title: title.to_owned(),
        parts: terminal::apart(sections.iter().map(Part::of)),
        screen: screen(forecast, rehearsed.minutes),
        body: html! {
            h2 { (title) }
            @for line in &lines { p { (line) } }
            @for section in &sections { (section.html()) }
            @if let Some(section) = look_alikes::section(&forecast.isolability) { (section.html()) }
        },
        figures: serde_json::json!({
            "minutes": rehearsed.minutes,
            "requested_block_cycles": rehearsed.requested,
            "temperature_changes_k": rehearsed.changes_k.iter().cloned().collect::<std::collections::BTreeMap<_, _>>(),
            "forecast": forecast,
        }),
        lines,
    }
}

/// The first screen: time, what would show, and what would not.
fn screen(forecast: &Preflight, minutes: f64) -> Screen {
    let n = forecast.effects.len();
    let alike = imitated_effects(forecast);
    let minutes = three(minutes);
    let sentence = format!(
        "In {minutes} min this plan would show {n} effects; {} of them look like others, and {} kinds would not show.",
        alike.len(),
        forecast.not_excited.len()
    );
    let hidden = forecast.not_excited.iter();
    let hidden: Vec<String> = hidden.map(|effect| name(&effect.effect, "")).collect();
    Screen {
        verdict: Some((sentence, Tone::Plain)),
        tiles: vec![
            Tile::new(
                "time on an ideal machine",
                format!("{minutes} min"),
                format!("{} runs", forecast.runs),
            ),
            Tile::new("would show and separate", (n - alike.len()).to_string(), ""),
            Tile::new("look like others", alike.len().to_string(), few(&alike)),
            Tile::new(
                "kinds that would not show",
                hidden.len().to_string(),
                few(&hidden),
            ),
        ],
        picture: picture(forecast),
        ..Screen::default()
    }
}

/// The first names of a list, and how many follow.
fn few(names: &[String]) -> String {
    let shown = names.iter().take(MOST_NAMES).cloned();
    let shown = shown.collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(MOST_NAMES) {
        0 => shown,
        n => format!("{shown} and {n} more"),
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

/// What is foreseen beside the plan.
fn besides(rehearsed: &Rehearsed<'_>) -> Option<String> {
    if rehearsed.is_unasked {
        return Some("Production serves block cycles; who asks for them stands in a scenario: give its folder to count them.".to_owned());
    }
    let n = rehearsed.requested;
    (n > 0).then(|| {
        format!("The thermal model asks for {n} block cycles during production, which are counted; changes of the load and drift of the real machine can ask for more.")
    })
}

fn temperatures(rehearsed: &Rehearsed<'_>) -> Section {
    let changes = rehearsed.changes_k.iter();
    let rows = changes.map(|(sensor, change_k)| vec![sensor.clone(), three(*change_k)]);
    section(
        "Temperatures that are assumed",
        &["thermometer", "changes by / K"],
        rows.collect(),
        "Of a machining centre of usual size that begins cold, by its axes and spindle as the plan moves them, in a room that swings by 2 K within a day. The machine itself does not grow in a forecast.",
    )
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

/// Names of the effects that others imitate.
fn imitated_effects(forecast: &Preflight) -> Vec<String> {
    let imitated = forecast.effects.iter();
    let imitated = imitated.filter(|effect| effect.sin_alone < IMITATED);
    imitated.map(title_of).collect()
}

fn imitated(forecast: &Preflight) -> String {
    let names = imitated_effects(forecast);
    if names.is_empty() {
        return "Every one of them can be told from the others.".to_owned();
    }
    format!(
        "Cannot be told from others (sine below {IMITATED}): {}.",
        names.join(", ")
    )
}

/// From which size others cannot imitate it; never where that is beyond what is physical.
fn told_apart(effect: &Foreseen, factor: f64) -> String {
    let from = effect
        .told_apart_from
        .filter(|from| *from <= effect.greatest);
    from.map_or_else(|| "never".to_owned(), |from| three(from * factor))
}

/// Of each kind the target that is found worst, as a bar: the smallest size that would be found over the usual one.
fn picture(forecast: &Preflight) -> Option<Markup> {
    let share = |effect: &Foreseen| effect.found_from / effect.typical;
    let mut worst: Vec<&Foreseen> = Vec::new();
    for effect in &forecast.effects {
        match worst.iter_mut().find(|one| one.effect == effect.effect) {
            Some(one) if share(one) < share(effect) => *one = effect,
            Some(_) => {}
            None => worst.push(effect),
        }
    }
    worst.retain(|effect| share(effect).is_finite());
    worst.sort_by(|a, b| share(a).total_cmp(&share(b)));
    let left = worst.len().saturating_sub(MOST_BARS_OF_KINDS);
    let bars: Vec<Bar> = { worst.iter().take(MOST_BARS_OF_KINDS) }
        .map(|effect| {
            let (size, factor) = with_unit(&effect.parameter, effect.typical);
            let unit = size.rsplit_once(" / ").map_or("", |(_, unit)| unit);
            let from = three(effect.found_from * factor);
            Bar {
                name: format!("{}: from {from} {unit}", title_of(effect)),
                size: 100.0 * share(effect),
                is_beyond: effect.sin_alone >= IMITATED,
            }
        })
        .collect();
    let more = match left {
        0 => String::new(),
        n => format!(" {n} more kinds need larger sizes."),
    };
    let caption = format!(
        "The kinds of effects that are found best, each at its worst place. Faint: looks like others.{more}"
    );
    let axis = "smallest size that would be found / % of its usual size";
    (!bars.is_empty()).then(|| figure(&bars::svg(axis, &bars), &caption))
}

fn effects(forecast: &Preflight) -> Section {
    let rows = forecast.effects.iter().map(|effect| {
        let alike: Vec<String> = effect
            .alike
            .iter()
            .take(MOST_NAMES)
            .map(|(id, cos)| format!("{} {cos:.2}", name_of(id)))
            .collect();
        let (size, factor) = with_unit(&effect.parameter, effect.typical);
        vec![
            title_of(effect),
            size,
            three(effect.found_from * factor),
            told_apart(effect, factor),
            three(effect.typical * factor),
            format!("{:.3}", effect.sin_alone),
            alike.join(", "),
        ]
    });
    section(
        "What would be found",
        &[
            "effect",
            "size",
            "found from",
            "told apart from",
            "typical",
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
        "What follows a thermometer is judged by the temperatures that are assumed; a recording shows what they were.",
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
            "of a reading / µm",
            "between runs / µm",
        ],
        rows.collect(),
        "Rotary axes in mrad. Say what your instruments have with --floor INSTRUMENT=READING/BETWEEN.",
    )
}
