//! The first screen of the tests of a bag: what was decided, the greatest figures, what was not evaluated.

use std::fmt::Display;

use maud::html;
use reports::evaluate::Tests;
use reports::evaluate::limits::CONFORMS;
use reports::loss;
use reports::page::figure;
use reports::screen::{Screen, Tile, Tone};
use reports::section::Section;
use reports::terminal::Rank;

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
    let tiles = answered()
        .into_iter()
        .take(MOST_ANSWERS_ON_TILES)
        .map(tile)
        .collect();
    let drawn = { answered().into_iter() }
        .chain(sections)
        .find_map(|one| Some((&one.title, one.drawings.first()?)));
    Screen {
        verdict: verdict(tests, &answered(), judged),
        tiles,
        lacks: lacks(tests, sections, stated),
        picture: drawn.map(|(title, drawing)| {
            let caption = format!("{title}. {}", drawing.caption);
            html! { (figure(&drawing.svg, &caption)) }
        }),
        ..Screen::default()
    }
}

/// The answer of a part: the first number of its sentence large, the rest below.
fn tile(section: &Section) -> Tile {
    let answer = section.answers.first().map_or("", String::as_str);
    let answer = answer.trim_end_matches('.');
    let (value, more) = answer.split_once(&[',', ';'][..]).unwrap_or((answer, ""));
    let more = more.trim_start();
    let title = section.title.split(':').next().unwrap_or_default();
    match figure_of(value) {
        Some((name, figure)) if more.is_empty() => Tile::new(title, figure, name),
        Some((name, figure)) => Tile::new(title, figure, format!("{name}; {more}")),
        None => Tile::new(title, value, more),
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
    answered: &[&Section],
    judged: Option<&Section>,
) -> Option<(String, Tone)> {
    if !tests.reading.is_whole() {
        let line = loss::in_words(&tests.reading).into_iter().next()?;
        return Some((line, Tone::Bad));
    }
    if let Some(broken) = tests.broken_off.first() {
        return Some((broken.to_string(), Tone::Bad));
    }
    if let Some(judged) = judged {
        let answer = judged.answers.first()?.clone();
        let rows = judged.tables.first().map_or(&[][..], |table| &table.rows);
        let mut decisions = rows.iter().filter_map(|row| row.get(4));
        let all_pass = decisions.all(|decision| decision == CONFORMS);
        let tone = if all_pass { Tone::Good } else { Tone::Bad };
        return Some((answer, tone));
    }
    let first = answered.first()?;
    let answer = first.answers.first()?;
    Some((format!("{}: {answer}", first.title), Tone::Plain))
}

fn lacks(tests: &Tests, sections: &[Section], stated: bool) -> Vec<String> {
    let mut lacks: Vec<String> = tests.broken_off.iter().map(as_text).collect();
    for section in sections {
        let warnings = section.warnings.iter();
        lacks.extend(warnings.map(|warning| format!("{}: {}", section.title, warning.line)));
    }
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
            "Space diagonals: Systematic deviation E_d 12.00 µm."
        );
        assert_eq!(tone, Tone::Plain);
        assert_eq!(screen.tiles[1].name, "Positioning X, run 1 on");
        assert_eq!(screen.tiles[1].value, "8.50 ± 0.40 µm");
        assert!(screen.tiles[1].more.starts_with("accuracy A; systematic"));
        assert_eq!(screen.lacks, ["Circle XY: Not evaluated: one sense only."]);
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
    fn without_a_test_and_without_a_budget_that_is_said() {
        let none = of(&Tests::default(), &[], None, true);
        assert!(none.verdict.is_none() && none.lacks.len() == 1);
        let all = [section("Circle XY", "G 3.00 µm.", Rank::Table)];
        let lacks = of(&Tests::default(), &all, None, false).lacks;
        assert!(lacks[0].contains("--budget"), "{lacks:?}");
    }
}
