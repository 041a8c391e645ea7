//! Names of columns that hold a pass each: a direction, with at most the words of a run, a number, an axis, a deviation and a
//! unit (`1 up`, `Run 2 ↓ [µm]`, `3-`). Anything more is a statistic, a tolerance or another quantity.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use metrology::Axis;

use super::map::Direction;
use super::recognise::{Known, Recognised, Role, parts};
use super::stated::{self, Stated};

/// Words of runs.
const OF_RUNS: &[&str] = &[
    "run",
    "runs",
    "pass",
    "cycle",
    "lauf",
    "durchlauf",
    "durchgang",
    "zyklus",
    "test",
    "series",
    "serie",
    "measurement",
    "messung",
    "nr",
    "no",
    "number",
    "direction",
    "dir",
    "approach",
    "richtung",
];
/// Begins of the words of a deviation.
const OF_DEVIATIONS: &[&str] = &["dev", "err", "abweich", "fehler"];
/// Begins of words beside one of a deviation.
const BESIDE_DEVIATIONS: &[&str] = &["pos"];
/// Signs of the directions.
const ARROWS: [(char, Direction); 4] = [
    ('↑', Direction::Up),
    ('→', Direction::Up),
    ('↓', Direction::Down),
    ('←', Direction::Down),
];
/// Other signs that a name of a pass has, beside letters and digits.
const OTHER_SIGNS: &str = " \t\n\r\u{a0}_-+.,:;#/()[]°'\"\u{2212}\u{2013}";

/// What tells one pass of a table from another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PassName {
    /// From which side its targets are approached.
    pub direction: Direction,
    /// Its axis, where the name has the letter of one.
    pub axis: Option<Axis>,
    /// Its numbers.
    numbers: Vec<u32>,
}

/// The direction at the end of a name with a number: `3-`.
fn by_sign(name: &str) -> Option<Direction> {
    let trimmed = name.trim();
    let numbered = trimmed.trim_end_matches(['+', '-', '\u{2212}']);
    let sign = trimmed.get(numbered.len()..).unwrap_or_default();
    let is_numbered = numbered.chars().any(|letter| letter.is_ascii_digit());
    Direction::of_word(sign).filter(|_| is_numbered && !sign.is_empty())
}

/// The direction that a word names; `None` for a number and for short names of positions.
fn of_word(word: &str) -> Option<Direction> {
    let is_other = word.parse::<f64>().is_ok() || word == "pos" || word == "neg";
    Direction::of_word(word).filter(|_| !is_other)
}

/// The directions in a name.
fn directions(name: &str, words: &[String]) -> Vec<Direction> {
    let arrows = name.chars().filter_map(|sign| {
        let mut known = ARROWS.iter();
        known.find(|(arrow, _)| *arrow == sign).map(|(_, way)| *way)
    });
    let told = words.iter().filter_map(|word| of_word(word));
    let all: Vec<Direction> = arrows.chain(told).collect();
    if all.is_empty() {
        return by_sign(name).into_iter().collect();
    }
    all
}

/// Whether a name has a direction, whatever else it has.
pub fn has_direction(name: &str) -> bool {
    let (mut words, inner) = parts(name);
    words.extend(
        inner
            .iter()
            .flat_map(|inner| super::vocabulary::words(inner)),
    );
    !directions(name, &words).is_empty()
}

/// The axis of a word that is its letter, with or without a number (`x`, `x1`).
pub fn axis_of(word: &str) -> Option<Axis> {
    let letter = word.trim_end_matches(|letter: char| letter.is_ascii_digit());
    let axis = letter.to_uppercase().parse::<Axis>().ok();
    axis.filter(|_| letter.len() == 1)
}

fn begins(word: &str, all: &[&str]) -> bool {
    all.iter().any(|begin| word.starts_with(begin))
}

/// The pass of a name; none where it says anything more.
pub fn of(name: &str) -> Option<PassName> {
    let (mut words, inner) = parts(name);
    // What stands where a unit does is one, or words as any others.
    if let (Some(inner), Stated::Nothing) = (inner, stated::of(name)) {
        words.extend(super::vocabulary::words(&inner));
    }
    let is_sign = |sign: char| {
        let is_arrow = ARROWS.iter().any(|(arrow, _)| *arrow == sign);
        sign.is_alphanumeric() || is_arrow || OTHER_SIGNS.contains(sign)
    };
    let [direction] = directions(name, &words)[..] else {
        return None;
    };
    if !name.chars().all(is_sign) {
        return None;
    }
    let is_deviation = words.iter().any(|word| begins(word, OF_DEVIATIONS));
    let mut pass = PassName {
        direction,
        axis: None,
        numbers: vec![],
    };
    for word in words.iter().filter(|word| of_word(word).is_none()) {
        let bare = word.trim_end_matches(|letter: char| letter.is_ascii_digit());
        let digits = word.trim_start_matches(|letter: char| !letter.is_ascii_digit());
        let ordinals = ["st", "nd", "rd", "th"];
        let ordinal = ordinals.iter().find_map(|end| word.strip_suffix(*end));
        if let Ok(number) = ordinal.unwrap_or(word.as_str()).parse() {
            pass.numbers.push(number);
            continue;
        }
        let is_beside = is_deviation && begins(bare, BESIDE_DEVIATIONS);
        let axis = axis_of(word);
        if let (Some(axis), None) = (axis, pass.axis) {
            pass.axis = Some(axis);
        } else if !OF_RUNS.contains(&bare) && !begins(bare, OF_DEVIATIONS) && !is_beside {
            return None;
        }
        pass.numbers.extend(digits.parse::<u32>().ok());
    }
    Some(pass)
}

/// Refuses passes of one table that are those of several: of two axes, or with one number and direction twice, or of which
/// some have a number and others none.
///
/// # Errors
/// With both names.
pub fn check(found: &Recognised) -> Result<()> {
    let columns = found.columns.iter();
    let passes = columns.filter(|column| matches!(column.role, Some(Role::Pass(_))));
    let passes: Vec<(&str, PassName)> = passes
        .filter_map(|column| Some((column.name.as_str(), of(&column.name)?)))
        .collect();
    let own = "write each test into a table of its own, or name the passes in a map (passes_um)";
    let mut seen: BTreeMap<(bool, &[u32]), &str> = BTreeMap::new();
    for (name, pass) in &passes {
        let Some((first, of_first)) = passes.first() else {
            return Ok(());
        };
        if pass.axis != of_first.axis {
            bail!("columns \"{first}\" and \"{name}\" are passes of two axes: {own}");
        }
        if pass.numbers.is_empty() != of_first.numbers.is_empty() {
            bail!(
                "columns \"{first}\" and \"{name}\": one pass has a number, and the other has none: {own}"
            );
        }
        let key = (pass.direction == Direction::Up, pass.numbers.as_slice());
        // Of one name twice the reader of the cells has its own words.
        if let Some(other) = seen.insert(key, name).filter(|other| other != name) {
            bail!(
                "columns \"{other}\" and \"{name}\" are one pass, from one side with one number: {own}"
            );
        }
    }
    Ok(())
}

/// Refuses passes from one side beside as many columns of numbers that nobody names: they may be those from the other side.
///
/// # Errors
/// With the first name of each.
pub fn check_sides(found: &Recognised) -> Result<()> {
    let passes = found.passes();
    let is_one_way = passes.windows(2).all(|two| two[0].1 == two[1].1);
    let n_rows = passes.first().map_or(0, |(column, _)| column.numbers.len());
    let is_open = |column: &&Known| {
        matches!(column.role, None | Some(Role::Displacement)) && 2 * column.numbers.len() > n_rows
    };
    let others: Vec<&Known> = found.columns.iter().filter(is_open).collect();
    match (&passes[..], &others[..]) {
        ([(pass, _), _, ..], [other, ..]) if is_one_way && others.len() == passes.len() => bail!(
            "columns \"{}\" and others are passes from one side, and as many columns as \"{}\" are not known: where they are those from \
             the other side, name all in a map (passes_um); otherwise take them out",
            pass.name,
            other.name
        ),
        _ => Ok(()),
    }
}

/// A sentence on columns with a direction that are no passes by what else their names say; empty without any.
pub fn unsure(found: &Recognised) -> String {
    let columns = found.columns.iter().filter(|column| {
        !column.numbers.is_empty() && column.role.is_none() && has_direction(&column.name)
    });
    let names: Vec<String> = columns
        .map(|column| format!("\"{}\"", column.name))
        .collect();
    if names.is_empty() {
        return String::new();
    }
    format!(
        "column {}: says more than a direction, a run, a number, a deviation and a unit: name those that are passes in a map (passes_um); ",
        names.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::super::recognise::of_text;
    use super::*;

    /// Rows of five passes up and down, with further columns.
    fn table(pass: &dyn Fn(u32, &str) -> String, others: &[&str]) -> Recognised {
        let mut names = vec!["target_mm".to_owned()];
        for run in 1..=5 {
            names.extend(["up", "down"].map(|way| pass(run, way)));
        }
        names.extend(others.iter().map(|&name| name.to_owned()));
        let mut text = names.join(";") + "\n";
        for target in [0, 50, 100] {
            let cells = (1..names.len()).map(|k| format!(";{}.{target}", k % 7));
            text += &format!("{target}{}\n", cells.collect::<String>());
        }
        of_text(&text).unwrap().unwrap()
    }

    #[test]
    fn a_direction_with_a_run_a_number_an_error_and_a_unit_is_a_pass() {
        let arrow = |way: &str| if way == "up" { '↑' } else { '↓' };
        let sign = |way: &str| if way == "up" { '+' } else { '-' };
        type Layout<'f> = &'f dyn Fn(u32, &str) -> String;
        let layouts: [Layout<'_>; 14] = [
            &|k, way| format!("{way} {k} [um]"),
            &|k, way| format!("{k} {way}"),
            &|k, way| format!("{k}{}", arrow(way)),
            &|k, way| format!("Run {k} {}", sign(way)),
            &|k, way| format!("{k}{}", sign(way)),
            &|k, way| format!("Run {k} {} [µm]", arrow(way)),
            &|k, way| format!("Error run {k} {way} (µm)"),
            &|k, way| format!("{way}_{k}_um"),
            &|k, way| format!("Abweichung {k} {way} µm"),
            &|k, way| format!("cycle{k} {way}"),
            &|k, way| format!("X {way} {k} [um]"),
            &|k, way| format!("Pos. deviation {k} {way} (mm)"),
            &|k, way| format!("{k}. Lauf {way}"),
            &|k, way| format!("{k}th pass, {way}"),
        ];
        for layout in layouts {
            let found = table(layout, &[]);
            let name = layout(1, "up");
            assert_eq!(found.passes().len(), 10, "{name}");
            check(&found).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
    }

    #[test]
    fn statistics_tolerances_and_other_quantities_with_a_direction_are_no_passes() {
        let words = "mean average avg x\u{304} x̄ ȳ Mittel moyenne media s sigma 2s R range spread max min fit nominal limit tolerance temperature ISO U M compensated corrected filtered Soll-Ist ± 平均 σ s² median std B spec straightness reversal";
        let mut n = 0;
        for word in words.split(' ') {
            for (up, down) in [
                (format!("{word} up [um]"), format!("{word} down [um]")),
                (format!("up {word}"), format!("down {word}")),
                (format!("{word}↑"), format!("{word}↓")),
                (format!("up 1 {word} [um]"), format!("down 1 {word} [um]")),
                (format!("error {word} up"), format!("error {word} down")),
                (format!("up 1 ({word})"), format!("down 1 ({word})")),
            ] {
                let found = table(&|k, way| format!("{way} {k} [um]"), &[&up, &down]);
                let taken = found.passes().len();
                // A letter of an axis, and a unit, are refused beside the others.
                assert!(taken == 10 || check(&found).is_err(), "{up}: {taken}");
                n += usize::from(taken == 10);
            }
        }
        assert!(n > 190, "{n}");
    }

    #[test]
    fn passes_that_differ_by_more_than_their_number_are_refused_by_name() {
        for (name, others, words) in [
            ("X", ["Y up 1 [um]", "Y down 1 [um]"], "of two axes"),
            ("X1", ["Y1 up 1 [um]", "Y1 down 1 [um]"], "of two axes"),
            ("", ["Y up 1 [um]", "Y down 1 [um]"], "of two axes"),
            ("", ["up [um]", "down [um]"], "the other has none"),
            ("", ["error up 1 [um]", "error down 1 [um]"], "one pass"),
        ] {
            let found = table(&|k, way| format!("{name} {way} {k} [um]"), &others);
            let refused = check(&found).expect_err(name).to_string();
            assert!(refused.contains(words), "{name} {others:?}: {refused}");
            assert!(refused.contains(others[0]), "{refused}");
        }
    }

    #[test]
    fn columns_with_a_direction_that_are_no_passes_are_named_where_nothing_else_is_read() {
        let found = table(&|k, way| format!("{way} {k} compensated [um]"), &[]);
        assert!(found.passes().is_empty());
        assert!(unsure(&found).contains("\"up 1 compensated [um]\""));
        assert_eq!(unsure(&table(&|k, way| format!("{way} {k}"), &[])), "");
    }

    #[test]
    fn as_many_unknown_columns_beside_passes_from_one_side_may_be_the_others() {
        use super::super::recognise::of_text;
        for (head, is_refused) in [
            ("target_mm,1 up,1 zurueck,2 up,2 zurueck", true),
            ("target_mm,1 up,1 down,2 up,2 down", false),
            ("target_mm,1 up,2 up,humidity", false),
            ("target_mm,1 up,2 up", false),
        ] {
            let n = head.split(',').count();
            let row = |k: usize| {
                let cells = (0..n).map(|column| format!("{}.{k}", 7 * column + k));
                cells.collect::<Vec<_>>().join(",")
            };
            let rows: Vec<String> = (1..5).map(row).collect();
            let found = of_text(&format!("{head}\n{}\n", rows.join("\n")))
                .unwrap()
                .unwrap();
            assert_eq!(check_sides(&found).is_err(), is_refused, "{head}");
        }
    }
}
