//! The first screen of the tests of a bag: what was decided, the greatest figures, what was not evaluated.

use std::fmt::Display;

use maud::{Markup, html};
use reports::evaluate::Tests;
use reports::evaluate::limits::CONFORMS;
use reports::loss;
use reports::page::figure;
use reports::screen::{Screen, Tile, Tone};
use reports::section::{Section, capitalised};
use reports::terminal::Rank;

/// What a verdict without limits says.
const NOT_JUDGED: &str = "Not judged: no limits were given.";
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
    let tiles = { shown.iter() }
        .take(MOST_ANSWERS_ON_TILES)
        .map(|one| tile(one));
    let tiles = tiles.collect();
    Screen {
        verdict: verdict(tests, (&shown, sections), judged),
        tiles,
        lacks: lacks(tests, sections, stated),
        picture: picture(&shown, sections),
        ..Screen::default()
    }
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
            "No budget (--budget): expanded uncertainties of ISO 230-2, -4 and -6 are not stated."
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
mod tests {
    use super::*;

    fn section(title: &str, answer: &str, rank: Rank) -> Section {
        let mut section = Section::new(title).ranked(rank);
        if !answer.is_empty() {
            section.answer(answer.to_owned());
        }
        section
    }

    #[test]
    fn the_most_important_answer_is_the_verdict_and_each_has_a_tile() {
        let mut silent = section("Circle XY", "", Rank::Table);
        silent.not_evaluated("one sense only");
        let all = [
            section(
                "Positioning X, run 1 on: laser",
                "accuracy A 8.50 ± 0.40 µm, systematic deviation E 5.00 µm.",
                Rank::Table,
            ),
            silent,
            section(
                "Space diagonals",
                "Systematic deviation E_d 12.00 µm.",
                Rank::Answer,
            ),
        ];
        let screen = of(&Tests::default(), &all, None, true);
        let (verdict, tone) = screen.verdict.clone().unwrap();
        assert_eq!(
            verdict,
            "Space diagonals: systematic deviation E_d 12.00 µm. Not judged: no limits were given."
        );
        assert_eq!(tone, Tone::Plain);
        assert_eq!(screen.tiles[1].name, "Positioning X, run 1 on");
        assert_eq!(screen.tiles[1].value, "8.50 ± 0.40 µm");
        assert!(screen.tiles[1].more.starts_with("accuracy A; systematic"));
        assert_eq!(screen.lacks, ["Circle XY: Not evaluated: one sense only."]);
    }

    fn circle(title: &str, error_mm: f64) -> Section {
        let answer = format!("circular error G of both senses {:.2} µm.", error_mm * 1e3);
        let mut circle = section(title, &answer, Rank::Table);
        circle.figures =
            serde_json::json!({"iso230_4": {"both": {"circular_error": {"value_mm": error_mm}}}});
        circle
    }

    #[test]
    fn the_worst_circle_of_a_plane_and_its_largest_cause_come_first() {
        let mut causes = section(
            "Causes in XY, not compensated",
            "Largest cause: play.",
            Rank::Table,
        );
        causes.figures = serde_json::json!({"breakdown": {}});
        causes.tile = Some(Tile::new(
            "largest cause in XY",
            "backlash X 5.0 ± 0.2 µm",
            "",
        ));
        let all = [
            circle(
                "Circle XY, R 50.000 mm, 1500 mm/min about (0.0, 0.0, 30.0), runs 5 and 6: not compensated",
                0.0108,
            ),
            circle(
                "Circle XY, R 50.000 mm, 6000 mm/min about (0.0, 0.0, 30.0), runs 9 and 10: not compensated",
                0.0132,
            ),
            section(
                "Geometric errors",
                "4 of 51 coefficients are known.",
                Rank::Table,
            ),
            causes,
        ];
        let screen = of(&Tests::default(), &all, None, true);
        assert_eq!(
            screen.verdict.unwrap().0,
            "Circle XY, R 50.000 mm, 6000 mm/min, runs 9 and 10: circular error G of both senses 13.20 µm; the greatest of 2; largest cause in XY: backlash X 5.0 ± 0.2 µm. Not judged: no limits were given."
        );
        let names: Vec<&str> = screen.tiles.iter().map(|tile| tile.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "Circle XY, R 50.000 mm, 6000 mm/min, runs 9 and 10",
                "largest cause in XY",
                "Geometric errors"
            ]
        );
    }

    #[test]
    fn a_number_is_taken_out_of_its_words_where_they_stay_readable() {
        for (value, name, figure) in [
            ("accuracy A 8.50 ± 0.40 µm", "accuracy A", "8.50 ± 0.40 µm"),
            (
                "G of both senses 10.84 ± 0.60 µm (k = 2)",
                "G of both senses (k = 2)",
                "10.84 ± 0.60 µm",
            ),
            ("reversal -3.0 µm", "reversal", "-3.0 µm"),
            ("accuracy A — µm", "", ""),
            ("6 recordings", "", ""),
            ("X: scale and motor are up to 39.71 µm apart", "", ""),
            ("", "", ""),
        ] {
            let wanted = (!name.is_empty()).then(|| (name.to_owned(), figure.to_owned()));
            assert_eq!(figure_of(value), wanted, "{value:?}");
        }
    }

    #[test]
    fn a_tile_shows_a_number_and_no_sentence() {
        let shown = |title: &str, answer: &str| {
            let one = tile(&section(title, answer, Rank::Table));
            (one.value, one.more)
        };
        let positioning = shown(
            "Positioning X, run 1 on: not compensated, by the length reference",
            "as measured, not at 20 °C: accuracy A 127.39 µm, systematic deviation E 121.89 µm.",
        );
        assert_eq!(positioning.0, "127.39 µm");
        assert_eq!(
            positioning.1,
            "accuracy A; systematic deviation E 121.89 µm; as measured, not at 20 °C"
        );
        let widest = "Widest corner of run 18: 39.41 µm between the greatest deviations.";
        assert_eq!(shown("Lines", widest).0, "39.41 µm");
        let tables = "X: scale and motor are up to 39.71 µm apart; up minus down -4.24 µm.";
        let (value, more) = shown("Positioning tables", tables);
        assert_eq!(value, "39.71 µm");
        assert!(more.starts_with("X: scale and motor"), "{more}");
        assert_eq!(
            shown("t", "4 of 51 coefficients are known.").0,
            "4 of 51 coefficients are known"
        );
    }

    #[test]
    fn a_verdict_has_one_colon_before_its_figures() {
        let one = section(
            "Positioning X, run 1 on: not compensated, by the length reference",
            "as measured, not at 20 °C: accuracy A 127.39 µm.",
            Rank::Table,
        );
        assert_eq!(
            of(&Tests::default(), &[one], None, true).verdict.unwrap().0,
            "Positioning X, run 1 on, by the length reference: accuracy A 127.39 µm (as measured, not at 20 °C). Not judged: no limits were given."
        );
    }

    #[test]
    fn the_greatest_of_several_drifts_is_the_verdict_and_like_warnings_are_one() {
        let drift = |run: u32, range_mm: f64| {
            let title = format!("Thermal drift of Z, run {run}, ISO 230-3: cause not stated");
            let mut one = section(
                &title,
                &format!("range {:.2} µm.", range_mm * 1e3),
                Rank::Table,
            );
            one.figures =
                serde_json::json!({"iso230_3_log": {"figures": {"range": {"value_mm": range_mm}}}});
            one.warn("Recorded too briefly", "Recorded for 1.00 h.".to_owned());
            one
        };
        let all = [drift(1, 0.0237), drift(2, 0.0242), drift(3, 0.0232)];
        let screen = of(&Tests::default(), &all, None, true);
        assert_eq!(
            screen.verdict.unwrap().0,
            "Thermal drift of Z, run 2, ISO 230-3, cause not stated: range 24.20 µm; the greatest of 3. Not judged: no limits were given."
        );
        assert_eq!(screen.tiles.len(), 1);
        assert_eq!(
            screen.lacks,
            ["Thermal drift of Z, run 1, ISO 230-3 and 2 more: Recorded for 1.00 h."]
        );
    }

    #[test]
    fn without_a_test_and_without_a_budget_that_is_said() {
        let none = of(&Tests::default(), &[], None, true);
        assert!(none.verdict.is_none() && none.lacks.len() == 1);
        let all = [section("Circle XY", "G 3.00 µm.", Rank::Table)];
        let lacks = of(&Tests::default(), &all, None, false).lacks;
        assert!(lacks[0].contains("--budget"), "{lacks:?}");
    }
}
