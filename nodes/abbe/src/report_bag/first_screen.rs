//! The first screen of the tests of a bag: what was decided, the greatest figures, what was not evaluated.

use std::fmt::Display;

use maud::{Markup, html};
use reports::evaluate::Tests;
use reports::evaluate::limits::CONFORMS;
use reports::loss;
use reports::page::figure;
use reports::screen::{Screen, Tile, Tone};
use reports::section::{Section, capitalised, um};
use reports::terminal::Rank;

/// What a verdict without limits says.
const NOT_JUDGED: &str = "Not judged: no limits were given.";
/// Most tiles of figures that do not conform.
const MOST_FAILED_ON_TILES: usize = 2;
/// Most tiles of answers.
const MOST_ANSWERS_ON_TILES: usize = 4;

/// The screen of these parts; `judged`: the decisions of limits, `stated`: whether a budget was given.
pub(super) fn of(
    tests: &Tests,
    sections: &[Section],
    judged: Option<&Section>,
    stated: bool,
) -> Screen {
    let answered = || {
        let mut all: Vec<&Section> = sections
            .iter()
            .filter(|one| !one.answers.is_empty())
            .collect();
        all.retain(|one| one.rank < Rank::Detail);
        all.sort_by_key(|one| one.rank);
        all
    };
    let mut shown = worst_of_kind(answered());
    if shown.iter().any(|one| !one.figures["iso230_6"].is_null()) {
        // The space diagonals together have the figures of each.
        shown.retain(|one| !one.title.starts_with("Diagonal "));
    }
    let tiles: Vec<Tile> = match shown.as_slice() {
        [only] if only.tile.is_none() => tiles_of(only),
        several => {
            let tiles = several.iter().take(MOST_ANSWERS_ON_TILES);
            tiles.map(|one| tile(one)).collect()
        }
    };
    let mut all = judged.map(judged_tiles).unwrap_or_default();
    all.extend(tiles);
    all.extend(shown.first().and_then(|first| range(first, sections)));
    Screen {
        verdict: verdict(tests, (&shown, sections), judged),
        tiles: all,
        lacks: lacks(tests, sections, stated),
        picture: picture(&shown, sections),
        ..Screen::default()
    }
}

/// The figures that do not conform or cannot be decided, each beside its limits; else how many conform.
fn judged_tiles(judged: &Section) -> Vec<Tile> {
    let rows = judged.tables.first().map_or(&[][..], |table| &table.rows);
    let mut failed: Vec<Tile> = Vec::new();
    for row in rows {
        if let [figure, test, value, limits, decision, ..] = row.as_slice()
            && !decision.starts_with(CONFORMS)
        {
            let test = test.split(": ").next().unwrap_or(test);
            let more = format!("{decision}: must be {limits}; {test}");
            failed.push(Tile::new(figure, value, more).toned(Tone::Bad));
        }
    }
    if failed.is_empty() && !rows.is_empty() {
        let n = rows.len();
        let all = Tile::new("figures within their limits", format!("{n} of {n}"), "");
        return vec![all.toned(Tone::Good)];
    }
    // `does not conform` comes before `cannot be decided`.
    failed.sort_by(|a, b| b.more.cmp(&a.more));
    failed.truncate(MOST_FAILED_ON_TILES);
    failed
}

/// The parts without the circles and drifts that another of their plane or axis exceeds, each worst circle followed by the
/// causes of its plane.
fn worst_of_kind(answered: Vec<&Section>) -> Vec<&Section> {
    let is_worst = |one: &&Section| {
        let Some(own) = size_mm(one) else {
            return true;
        };
        let mut rivals = rivals(one, answered.iter().copied());
        rivals.all(|other| size_mm(other) <= Some(own))
    };
    let mut shown: Vec<&Section> = answered.iter().copied().filter(is_worst).collect();
    // A stable sort: the part of the causes moves behind the circles alone.
    shown.sort_by_key(|one| (one.rank, !is_of_circles(one)));
    shown
}

/// Parts of the same plane or axis with a size, itself among them.
fn rivals<'s>(
    one: &Section,
    all: impl Iterator<Item = &'s Section>,
) -> impl Iterator<Item = &'s Section> {
    all.filter(|other| kind_of(other) == kind_of(one) && size_mm(other).is_some())
}

/// The least and the greatest of the circles or drifts of one kind, where there are several.
fn range(first: &Section, sections: &[Section]) -> Option<Tile> {
    size_mm(first)?;
    let sizes_mm: Vec<f64> = rivals(first, sections.iter()).filter_map(size_mm).collect();
    let n = sizes_mm.len();
    let least_mm = sizes_mm.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest_mm = sizes_mm.iter().copied().fold(0.0, f64::max);
    let value = format!("{} to {} µm", um(least_mm), um(greatest_mm));
    let more = "least and greatest of its kind; run by run below";
    (n > 1).then(|| Tile::new(&format!("all {n}"), value, more))
}

fn is_of_circles(section: &Section) -> bool {
    !section.figures["iso230_4"].is_null() || !section.figures["breakdown"].is_null()
}

/// Such as `Circle XY` with its state of compensation, or `Thermal drift of Z` with its cause.
fn kind_of(section: &Section) -> (&str, &str) {
    let (title, state) = section
        .title
        .split_once(": ")
        .unwrap_or((section.title.as_str(), ""));
    (title.split(',').next().unwrap_or(title), state)
}

/// By what a circle or a drift is worse than another, mm.
fn size_mm(section: &Section) -> Option<f64> {
    let range_mm = section.figures["iso230_3_log"]["figures"]["range"]["value_mm"].as_f64();
    circular_error_mm(section).or(range_mm)
}

/// The greatest circular error of a circle's part, mm.
fn circular_error_mm(section: &Section) -> Option<f64> {
    let of = |who: &str| section.figures["iso230_4"][who]["circular_error"]["value_mm"].as_f64();
    let all = ["both", "clockwise", "counter_clockwise"].into_iter();
    all.filter_map(of).reduce(f64::max)
}

/// The first drawing, beside that of the causes where it is of a circle.
fn picture(shown: &[&Section], sections: &[Section]) -> Option<Markup> {
    let mut all = shown.iter().copied().chain(sections);
    let (section, drawing) = all.find_map(|one| Some((one, one.drawings.first()?)))?;
    let caption = format!("{}. {}", section.title, drawing.caption);
    let first = figure(&drawing.svg, &caption);
    let has_causes = |one: &&&Section| !one.figures["breakdown"].is_null();
    let causes = shown
        .iter()
        .find(has_causes)
        .filter(|_| circular_error_mm(section).is_some());
    let beside = causes.and_then(|one| Some((one, one.drawings.first()?)));
    let beside = beside.map(|(one, drawing)| {
        let caption = format!("{}. {}", one.title, drawing.caption);
        figure(&drawing.svg, &caption)
    });
    // The temperatures of a logged drift are drawn behind it.
    let meanwhile = section.drawings.get(1);
    let meanwhile = meanwhile.filter(|_| !section.figures["iso230_3_log"].is_null());
    let beside = beside.or_else(|| Some(figure(&meanwhile?.svg, &meanwhile?.caption)));
    Some(match beside {
        Some(beside) => html! { div.pair { (first) (beside) } },
        None => first,
    })
}

/// The answer of a part: the first number of its sentence large, the rest below.
fn tile(section: &Section) -> Tile {
    if let Some(tile) = &section.tile {
        return tile.clone();
    }
    let answer = section.answers.first().map_or("", String::as_str);
    let (reservation, answer) = apart(answer.trim_end_matches('.'));
    let (value, more) = answer.split_once(&[',', ';'][..]).unwrap_or((answer, ""));
    let more = [more.trim_start(), reservation];
    let more = more.into_iter().filter(|text| !text.is_empty());
    let more = more.collect::<Vec<_>>().join("; ");
    let title = &short_title(section);
    match figure_of(value) {
        Some((name, figure)) if more.is_empty() => Tile::new(title, figure, name),
        Some((name, figure)) => Tile::new(title, figure, format!("{name}; {more}")),
        None => match number_of(answer) {
            Some(figure) => Tile::new(title, figure, answer),
            None => Tile::new(title, value, more),
        },
    }
}

/// A tile for each figure of the answer of a part that stands alone on the page.
fn tiles_of(section: &Section) -> Vec<Tile> {
    let answer = section.answers.first().map_or("", String::as_str);
    let (reservation, answer) = apart(answer.trim_end_matches('.'));
    // What holds for all figures stands in brackets behind them.
    let in_brackets = answer.strip_suffix(')');
    let in_brackets = in_brackets.and_then(|answer| answer.rsplit_once(" ("));
    let (figures, for_all) = in_brackets.unwrap_or((answer, ""));
    let about = [short_title(section).as_str(), for_all, reservation]
        .into_iter()
        .filter(|text| !text.is_empty())
        .collect::<Vec<_>>()
        .join("; ");
    let parts = figures.split([',', ';']).map(str::trim);
    let parts = parts.map(|part| part.strip_prefix("and ").unwrap_or(part));
    let figures: Option<Vec<(String, String)>> = parts
        .map(|part| figure_of(part).or_else(|| figure_first(part)))
        .collect();
    let Some(figures) = figures.filter(|figures| figures.len() > 1) else {
        return vec![tile(section)];
    };
    let tiles = figures
        .into_iter()
        .enumerate()
        .map(|(place, (name, figure))| {
            let more = if place == 0 { about.as_str() } else { for_all };
            Tile::new(&name, figure, more)
        });
    tiles.take(MOST_ANSWERS_ON_TILES).collect()
}

/// `-14.69 µm after an hour` as its words and its number; `None` where no number with a unit comes first.
fn figure_first(part: &str) -> Option<(String, String)> {
    let words: Vec<&str> = part.split(' ').collect();
    let [number, unit, rest @ ..] = words.as_slice() else {
        return None;
    };
    let is_figure = number.parse::<f64>().is_ok() && TILE_UNITS.contains(unit);
    (is_figure && !rest.is_empty()).then(|| (rest.join(" "), format!("{number} {unit}")))
}

/// A title without place, cause and instrument.
fn short_title(section: &Section) -> String {
    let title = section.title.split(':').next().unwrap_or_default();
    let is_compensated = section.title.contains(": compensated");
    let state = if is_compensated { ", compensated" } else { "" };
    without_place(title) + state
}

/// What an answer reserves before its figures, such as `as measured, not at 20 °C`, and the rest.
fn apart(answer: &str) -> (&str, &str) {
    match answer.split_once(": ") {
        Some((before, rest)) if before.contains("not ") => (before, rest),
        _ => ("", answer),
    }
}

/// Units of a number that a tile shows alone.
const TILE_UNITS: [&str; 6] = ["µm", "mm", "µrad", "arcsec", "ms", "K"];

/// The first number with a unit in a sentence, such as `39.71 µm`.
fn number_of(sentence: &str) -> Option<String> {
    let words: Vec<&str> = sentence.split([' ', ';', ',']).collect();
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let pair =
        { words.windows(2) }.find(|pair| is_number(pair[0]) && TILE_UNITS.contains(&pair[1]))?;
    Some(pair.join(" "))
}

/// A title without the place of a circle, which a tile has no room for.
fn without_place(title: &str) -> String {
    match (title.split_once(" about ("), title.rsplit_once(')')) {
        (Some((before, _)), Some((_, behind))) => format!("{before}{behind}"),
        _ => title.to_owned(),
    }
}

/// `accuracy A 8.50 ± 0.40 µm (k = 2)` as its words, `accuracy A (k = 2)`, and its number, `8.50 ± 0.40 µm`; `None` where the
/// number is the first word, or where more words follow it.
fn figure_of(value: &str) -> Option<(String, String)> {
    let words: Vec<&str> = value.split(' ').collect();
    let begin = words.iter().position(|word| word.parse::<f64>().is_ok())?;
    let has_u = words.get(begin + 1) == Some(&"±");
    let end = (begin + if has_u { 4 } else { 2 }).min(words.len());
    let behind = &words[end..];
    let is_whole = behind.first().is_none_or(|word| word.starts_with('('));
    (begin > 0 && is_whole).then(|| {
        let name = [&words[..begin], behind].concat().join(" ");
        (name, words[begin..end].join(" "))
    })
}

fn verdict(
    tests: &Tests,
    (answered, sections): (&[&Section], &[Section]),
    judged: Option<&Section>,
) -> Option<(String, Tone)> {
    if !tests.reading.is_whole() {
        let line = loss::in_words(&tests.reading).into_iter().next()?;
        return Some((line, Tone::Bad));
    }
    if let Some(broken) = tests.broken_off.first() {
        return Some((broken.to_string(), Tone::Bad));
    }
    if let Some(run) = tests.not_evaluated.first() {
        return Some((run.to_string(), Tone::Bad));
    }
    if let Some(judged) = judged {
        let answer = judged.answers.first()?.clone();
        let rows = judged.tables.first().map_or(&[][..], |table| &table.rows);
        let mut decisions = rows.iter().filter_map(|row| row.get(4));
        let all_pass = decisions.all(|decision| decision == CONFORMS);
        let tone = if all_pass { Tone::Good } else { Tone::Bad };
        return Some((capitalised(&answer), tone));
    }
    let first = answered.first()?;
    let (reservation, answer) = apart(first.answers.first()?.trim_end_matches('.'));
    let reservation = match reservation {
        "" => String::new(),
        text => format!(" ({text})"),
    };
    let n_rivals = match size_mm(first) {
        Some(_) => rivals(first, sections.iter()).count(),
        None => 1,
    };
    let worst = match n_rivals {
        1 => String::new(),
        n => format!("; the greatest of {n}"),
    };
    let causes = answered
        .iter()
        .filter(|one| !one.figures["breakdown"].is_null());
    let mut causes = causes.filter(|_| circular_error_mm(first).is_some());
    let cause = causes.find_map(|one| one.tile.as_ref());
    let cause = cause.map_or_else(String::new, |tile| {
        format!("; {}: {}", tile.name, tile.value)
    });
    let title = without_place(first.title.trim_end_matches(": not compensated"));
    let title = title
        .replace(": not compensated, ", ", ")
        .replace(": ", ", ");
    let answer = uncapitalised(answer);
    Some((
        format!("{title}: {answer}{worst}{cause}{reservation}. {NOT_JUDGED}"),
        Tone::Plain,
    ))
}

/// A sentence behind a colon: its first word, where it is one, without a capital.
fn uncapitalised(sentence: &str) -> String {
    let mut letters = sentence.chars();
    match (letters.next(), letters.next()) {
        (Some(first), Some(second)) if second.is_lowercase() => first
            .to_lowercase()
            .chain(sentence.chars().skip(1))
            .collect(),
        _ => sentence.to_owned(),
    }
}

fn lacks(tests: &Tests, sections: &[Section], stated: bool) -> Vec<String> {
    let mut lacks: Vec<String> = tests.broken_off.iter().map(as_text).collect();
    lacks.extend(tests.not_evaluated.iter().map(ToString::to_string));
    lacks.extend(warnings(sections));
    if sections.is_empty() {
        lacks.push("The bag holds no test that can be evaluated.".to_owned());
    } else if !stated {
        lacks.push(
            "No budget (--budget): expanded uncertainties of ISO 230-2, 230-4 and 230-6 are not stated."
                .to_owned(),
        );
    }
    lacks
}

/// Warnings with the tests that they are of, each sentence once.
fn warnings(sections: &[Section]) -> Vec<String> {
    let mut all: Vec<(&str, Vec<String>)> = Vec::new();
    for section in sections {
        for warning in &section.warnings {
            let title = short_title(section);
            match all.iter_mut().find(|(line, _)| *line == warning.line) {
                Some((_, titles)) => titles.push(title),
                None => all.push((&warning.line, vec![title])),
            }
        }
    }
    let in_words = |(line, titles): (&str, Vec<String>)| match titles.as_slice() {
        [first, others @ ..] if !others.is_empty() => {
            format!("{first} and {} more: {line}", others.len())
        }
        _ => format!("{}: {line}", titles.concat()),
    };
    all.into_iter().map(in_words).collect()
}

fn as_text(one: &impl Display) -> String {
    one.to_string()
}

#[cfg(test)]
mod tests;
