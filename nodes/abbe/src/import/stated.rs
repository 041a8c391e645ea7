//! The unit that a column's name, or a line of units below the names, states.
//!
//! A stated unit holds. One that is not known, or that is not the one of the map's key, is refused with what to state: only
//! `units` of the map states that a name is wrong. In brackets stands a unit or a note; without them the last word may be a
//! unit, or a clear one before it. Where a name has deviation, target or another length or angle, what stands there is a
//! unit, a word that is known to be none, or one that is longer than what stands for units.

use anyhow::{Result, bail};
use metrology::yaml::shown;

use super::map::{Column, Direction, Map, What};
use super::units::{Kind, Unit};
use super::vocabulary::{is_foreign, is_known, is_note_word, is_quantity, plain};

/// Units that hold in the middle of a name too: no other word is written so.
const CLEAR_UNITS: &[&str] = &[
    "nm", "um", "mm", "uin", "inch", "inches", "micron", "microns", "arcsec", "arcmin", "urad",
    "mrad", "gon", "degc", "degf",
];
/// Words with which a name of an angle begins.
const ANGLES: &[&str] = &["angle", "winkel", "phi", "theta", "target", "pos", "soll"];

/// What is stated of a unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stated {
    Nothing,
    /// A unit, with its word.
    Unit(Unit, String),
    /// A word that is no unit that is known.
    Unknown(String),
}

impl Stated {
    /// The unit, where it is known.
    pub const fn unit(&self) -> Option<Unit> {
        match self {
            Self::Unit(unit, _) => Some(*unit),
            Self::Nothing | Self::Unknown(_) => None,
        }
    }

    /// The word that is no unit.
    pub fn unknown(self) -> Option<String> {
        match self {
            Self::Unknown(word) => Some(word),
            Self::Nothing | Self::Unit(..) => None,
        }
    }
}

/// A name as YAML takes any.
pub fn quoted(name: &str) -> String {
    let mut text = String::from('"');
    for letter in name.chars() {
        match letter {
            '\\' | '"' => text.extend(['\\', letter]),
            '\n' => text.push_str("\\n"),
            '\r' => text.push_str("\\r"),
            '\t' => text.push_str("\\t"),
            '\u{feff}' | '\u{2028}' | '\u{2029}' => {
                text.push_str(&format!("\\u{:04X}", u32::from(letter)));
            }
            _ if letter.is_control() => text.push_str(&format!("\\u{:04X}", u32::from(letter))),
            _ => text.push(letter),
        }
    }
    text.push('"');
    text
}

/// A text without line breaks and other controls, as a comment takes it.
pub fn in_one_line(text: &str) -> String {
    let blank = |letter: char| letter.is_control() || matches!(letter, '\u{2028}' | '\u{2029}');
    let letters = text.chars();
    letters
        .map(|letter| if blank(letter) { ' ' } else { letter })
        .collect()
}

/// What a column's name states of its unit.
pub fn of(name: &str) -> Stated {
    let (plain, inner) = apart(name);
    let is_closed = is_quantity(name);
    let is_open = |open: char| open != '[' && !is_closed;
    let mut found: Vec<Stated> = inner
        .iter()
        .map(|(open, text)| in_brackets(text, *open == '[', is_open(*open)))
        .filter(|stated| *stated != Stated::Nothing)
        .collect();
    let Some(first) = found.pop() else {
        return in_words(&plain, is_closed);
    };
    let is_other = |stated: &&Stated| stated.unit() != first.unit() || first.unit().is_none();
    match found.iter().find(is_other) {
        Some(_) => {
            let words: Vec<&str> = inner.iter().map(|(_, text)| text.trim()).collect();
            Stated::Unknown(words.join(", "))
        }
        None => first,
    }
}

/// A name without its brackets, and what stands in them with the bracket that opens.
fn apart(name: &str) -> (String, Vec<(char, String)>) {
    let (mut plain, mut inner) = (String::new(), vec![]);
    let mut rest = name;
    while let Some(from) = rest.find(['[', '(']) {
        let open = if rest[from..].starts_with('[') {
            '['
        } else {
            '('
        };
        let close = if open == '[' { ']' } else { ')' };
        let Some(length) = rest[from..].find(close) else {
            break;
        };
        plain.push_str(&rest[..from]);
        plain.push(' ');
        inner.push((open, rest[from + 1..from + length].to_owned()));
        rest = &rest[from + length + 1..];
    }
    plain.push_str(rest);
    (plain, inner)
}

fn is_digits(word: &str) -> bool {
    !word.is_empty() && word.chars().all(|letter| letter.is_ascii_digit())
}

fn is_letters(word: &str) -> bool {
    word.chars().all(char::is_alphabetic)
}

/// A unit in brackets; `is_open`: a single longer word may be any note.
fn in_brackets(text: &str, is_square: bool, is_open: bool) -> Stated {
    let word = text.trim();
    let letter = match word {
        "F" | "f" => Some(Unit::Degf),
        "K" | "k" => Some(Unit::Kelvin),
        _ => None,
    };
    if let Some(unit) = Unit::of_word(word).or(letter) {
        return Stated::Unit(unit, word.to_owned());
    }
    if is_note(word) {
        return Stated::Nothing;
    }
    let words: Vec<&str> = word
        .split(|letter: char| letter.is_whitespace() || matches!(letter, ',' | ';' | ':'))
        .filter(|word| !word.is_empty())
        .collect();
    let is_plain = |word: &&str| is_letters(word) && !is_foreign(word);
    if words.len() > 1 && words.iter().all(is_plain) {
        let units = words.iter().filter(|word| **word != "in");
        let mut units = units.filter_map(|word| Some((Unit::of_word(word)?, *word)));
        match (units.next(), units.next()) {
            (Some((unit, word)), None) => return Stated::Unit(unit, word.to_owned()),
            (Some(_), Some(_)) => return Stated::Unknown(word.to_owned()),
            (None, _) => {}
        }
    }
    let is_long = |word: &&str| is_plain(word) && (word.chars().count() > 3 || is_note(word));
    let is_open = is_open || words.len() > 1 || is_known(word);
    if !is_square && is_open && words.iter().all(is_long) {
        return Stated::Nothing;
    }
    Stated::Unknown(word.to_owned())
}

/// Whether a word in brackets is no unit: a direction, an axis, a number with or without what it numbers, signs alone.
fn is_note(word: &str) -> bool {
    let lower = word.to_lowercase();
    let numbered = lower.trim_start_matches(['#', 'n', 'o', 'r', '.', ' ']);
    let numbers = [
        "run", "pass", "lauf", "cycle", "zyklus", "test", "set", "no", "nr",
    ];
    let numbered = numbers
        .iter()
        .find_map(|name| lower.strip_prefix(name))
        .unwrap_or(numbered);
    let is_sign = |letter: char| !letter.is_alphanumeric() && !"%°'\"′″‰".contains(letter);
    let is_axis = |letter: char| ('X'..='Z').contains(&letter) || ('A'..='C').contains(&letter);
    is_note_word(&lower)
        || Direction::of_word(word).is_some()
        || is_digits(numbered.trim_matches([' ', '.', '#', '_']))
        || word.chars().all(is_sign)
        || (word.len() <= 3 && word.chars().all(is_axis))
}

/// A sign of a unit behind the last word: `deviation %`, `error µ"`.
fn sign_behind(text: &str, last: &str, rest: &str) -> Option<Stated> {
    const SIGNS: &[char] = &['%', '‰', '"', '\''];
    let sign = rest.trim();
    let is_quoted = |sign: char| text.matches(sign).count() > 1;
    let first = sign.chars().find(|letter| SIGNS.contains(letter))?;
    if is_quoted(first) {
        return None;
    }
    let is_apart = rest.starts_with(char::is_whitespace) || is_known(last);
    let word = if is_apart {
        sign.to_owned()
    } else {
        format!("{last}{sign}")
    };
    Some(match Unit::of_word(&word) {
        Some(unit) => Stated::Unit(unit, word),
        None => Stated::Unknown(word),
    })
}

/// The words of a name, each with what stands before it; and what stands behind the last one.
fn split(text: &str) -> (Vec<(&str, &str)>, &str) {
    let is_part = |letter: char| letter.is_alphanumeric() || matches!(letter, '°' | '′' | '″');
    let mut words: Vec<(&str, &str)> = vec![];
    let mut rest = text;
    while let Some(from) = rest.find(is_part) {
        let between = &rest[..from];
        let behind = &rest[from..];
        let end = behind
            .find(|letter| !is_part(letter))
            .unwrap_or(behind.len());
        words.push((between, &behind[..end]));
        rest = &behind[end..];
    }
    (words, rest)
}

/// A unit without brackets: the last word, or a clear one before it.
fn in_words(text: &str, is_closed: bool) -> Stated {
    let (words, rest) = split(text);
    let [before @ .., (between, last)] = words.as_slice() else {
        return Stated::Nothing;
    };
    if let Some(stated) = sign_behind(text, last, rest) {
        return stated;
    }
    let Some((apart, previous)) = before.last() else {
        return Stated::Nothing;
    };
    if previous.eq_ignore_ascii_case("arc")
        && let Some(unit) = Unit::of_word(&format!("arc{last}"))
    {
        return Stated::Unit(unit, format!("{previous} {last}"));
    }
    let unit = Unit::of_word(last);
    let is_share = matches!(previous.to_lowercase().as_str(), "per" | "pro" | "je");
    let is_part = unit.is_some() && is_foreign(previous);
    if is_part || (is_share && (unit.is_some() || is_foreign(last))) {
        return Stated::Unknown(format!("{previous} {last}"));
    }
    // `d/mm` is a quantity and its unit, `um/m` one unit.
    let is_quantity = before.len() == 1 && previous.chars().count() == 1 && !is_digits(previous);
    let is_ratio = *between == "/" && !is_quantity;
    if is_ratio && (Unit::of_word(previous).is_some() || (is_digits(previous) && unit.is_some())) {
        return Stated::Unknown(format!("{previous}/{last}"));
    }
    let first = before.len().checked_sub(2).and_then(|k| before.get(k));
    let first = first.map_or("", |(_, word)| *word);
    if unit.is_some() && is_digits(previous) && is_digits(first) {
        let is_part = *apart == "/" || (matches!(*apart, "." | ",") && first == "0");
        if is_part {
            return Stated::Unknown(format!("{first}{apart}{previous} {last}"));
        }
    }
    if let Some(unit) = unit {
        return Stated::Unit(unit, (*last).to_owned());
    }
    let begins = |starts: &[&str]| {
        let mut all = words.iter().map(|(_, word)| word.to_lowercase());
        all.any(|word| starts.iter().any(|start| word.starts_with(start)))
    };
    let is_letter = matches!(*last, "F" | "f" | "K" | "k") && begins(&["temp", "therm"]);
    if is_foreign(last) || is_letter {
        return Stated::Unknown((*last).to_owned());
    }
    let is_clear = |word: &str| {
        let word = plain(word);
        CLEAR_UNITS.contains(&word.as_str())
            || (word == "rad" && begins(ANGLES))
            || (is_closed && is_long_unit(&word))
    };
    // `100 mm bar` is no unit of the column.
    let is_numbered = |k: usize| k > 0 && is_digits(words[k - 1].1);
    let mut clear = (0..before.len()).filter(|k| is_clear(words[*k].1) && !is_numbered(*k));
    let clear = clear.next_back().map(|k| words[k].1);
    let clear = clear.and_then(|word| Some((Unit::of_word(word)?, word)));
    if let Some((unit, word)) = clear {
        return Stated::Unit(unit, word.to_owned());
    }
    in_place(&words, is_closed)
}

/// Whether a word is the full name of a unit of a length or an angle.
fn is_long_unit(word: &str) -> bool {
    let is_turn = word.starts_with("turn");
    let unit = Unit::of_word(word).filter(|_| word.chars().count() > 3 && !is_turn);
    unit.is_some_and(|unit| matches!(unit.kind(), Kind::Length | Kind::Angle))
}

/// What stands in the place of a unit, where no unit that is known does.
fn in_place(words: &[(&str, &str)], is_closed: bool) -> Stated {
    let [.., (_, previous), (between, last)] = words else {
        return Stated::Nothing;
    };
    let is_slash = between.trim() == "/";
    if is_slash && is_digits(last) && !is_digits(previous) && !is_known(previous) {
        return Stated::Unknown(format!("{previous}/{last}"));
    }
    if !is_closed {
        return Stated::Nothing;
    }
    if is_digits(last) || is_known(last) {
        // `deviation mdeg run 1`; a step or a line may be counted there.
        let is_counted = |word: &str| matches!(word.to_lowercase().as_str(), "line" | "step");
        let mut inner = words[1..words.len() - 1].iter().map(|(_, word)| *word);
        let foreign = inner.find(|word| is_foreign(word) && !is_counted(word));
        return foreign.map_or(Stated::Nothing, |word| Stated::Unknown(word.to_owned()));
    }
    // `0.1um` is cut behind its point.
    if last.starts_with(|letter: char| letter.is_ascii_digit()) && is_digits(previous) {
        return Stated::Unknown(format!("{previous}{between}{last}"));
    }
    Stated::Unknown((*last).to_owned())
}

/// A word without the brackets round it.
fn bare(word: &str) -> &str {
    word.trim_matches(['[', ']', '(', ')'])
}

/// What a cell of a line of units states.
pub fn of_cell(word: &str) -> Stated {
    in_brackets(bare(word), true, false)
}

/// Whether a line below the names has units: one at least, and no number.
pub fn is_row<'c>(cells: impl Iterator<Item = &'c str>) -> bool {
    let mut has_unit = false;
    for cell in cells {
        let word = bare(cell);
        if word.replace(',', ".").parse::<f64>().is_ok() || cell.contains(':') {
            return false;
        }
        has_unit |= Unit::of_word(word).is_some() || is_foreign(word);
    }
    has_unit
}

/// Refuses columns of a map whose names state another unit than they are read in. Times are looked at with their cells.
///
/// # Errors
/// With the column, both units, and what to state.
pub fn check_names(map: &Map) -> Result<()> {
    let columns = map.test.columns();
    let mut open = columns.iter().filter(|column| {
        !matches!(column.what, What::Time) && !map.units.contains_key(column.name)
    });
    open.try_for_each(|column| check(*column, &of(column.name), "its name"))
}

/// Refuses a line of units below the names that states others than the columns are read in.
///
/// # Errors
/// With the column, both units, and what to state.
pub fn check_row(map: &Map, column: Column<'_>, word: &str) -> Result<()> {
    if column.what.unit().is_none() || map.units.contains_key(column.name) {
        return Ok(());
    }
    let stated = of_cell(word);
    check(column, &stated, "the line below its name")
}

/// Refuses a column of plain numbers of time whose name has a word that is no unit.
///
/// # Errors
/// With the column, the word and what to state.
pub fn check_time(name: &str) -> Result<()> {
    let column = Column {
        name,
        what: What::Time,
    };
    match of(name) {
        stated @ Stated::Unknown(_) => check(column, &stated, "its name"),
        Stated::Nothing | Stated::Unit(..) => Ok(()),
    }
}

/// Refuses a column that is read in another unit than a place of the table states.
///
/// # Errors
/// With the column, the place, both units, and what to state.
pub fn check(column: Column<'_>, stated: &Stated, place: &str) -> Result<()> {
    let Some(wanted) = column.what.unit() else {
        return Ok(());
    };
    let (name, shown_name) = (quoted(column.name), shown(column.name));
    let (kind, of_map) = (wanted.kind(), wanted.name());
    match stated {
        Stated::Nothing => Ok(()),
        Stated::Unit(unit, _) if *unit == wanted => Ok(()),
        Stated::Unit(unit, word) if unit.kind() == kind => bail!(
            "column \"{shown_name}\": {place} says {word}, the map {of_map}: state `units: {{{name}: {}}}` in the map, or \
             `{of_map}` where {place} is wrong",
            unit.name()
        ),
        Stated::Unit(_, word) => bail!(
            "column \"{shown_name}\": {place} says {word}, the map {of_map}: name a column in one of {}, or state \
             `units: {{{name}: {of_map}}}` in the map where {place} is wrong",
            kind.units()
        ),
        Stated::Unknown(word) => bail!(
            "column \"{shown_name}\": {place} says \"{}\", which is no unit that is known, and the map {of_map}: known are {}: \
             state one of them as `units: {{{name}: {of_map}}}` in the map (abbe import --propose prints one), or convert the column",
            shown(word),
            kind.units()
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_found_in_brackets_at_the_end_and_where_it_is_clear_before_it() {
        for (name, unit) in [
            ("deviation_um", Unit::Um),
            ("error [µin]", Unit::Uin),
            ("Position (inch)", Unit::Inch),
            ("deviation [cm]", Unit::Cm),
            ("target\n(mm)", Unit::Mm),
            ("Abweichung in µm", Unit::Um),
            ("Abweichung in [µm]", Unit::Um),
            ("Position / mm", Unit::Mm),
            ("d/mm", Unit::Mm),
            ("deviation_mm_run1", Unit::Mm),
            ("x_um_mean", Unit::Um),
            ("Deviation (µm) (mean)", Unit::Um),
            ("Deviation (mean) [nm]", Unit::Nm),
            ("Deviation (µm, mean)", Unit::Um),
            ("deviation um (run 1)", Unit::Um),
            ("Run 1 ↑ [µm]", Unit::Um),
            ("spindle_temperature_degF", Unit::Degf),
            ("Temp (°F)", Unit::Degf),
            ("spindle °F", Unit::Degf),
            ("room [K]", Unit::Kelvin),
            ("room (degC)", Unit::Degc),
            ("phi_µrad", Unit::Urad),
            ("deviation arc-sec", Unit::Arcsec),
            ("error \"", Unit::Arcsec),
            ("Abweichung Mikrometer Lauf 1", Unit::Um),
            ("target millimeters", Unit::Mm),
            ("Abweichung Bogensekunden", Unit::Arcsec),
            ("error [thou]", Unit::Thou),
        ] {
            assert_eq!(of(name).unit(), Some(unit), "{name}: {:?}", of(name));
        }
    }

    #[test]
    fn what_stands_for_a_unit_and_is_none_is_unknown_and_a_note_is_nothing() {
        for name in [
            "Deviation (mil)",
            "deviation mils",
            "Abweichung [1/100 mm]",
            "Abweichung 1/100 mm",
            "error in 0.01 mm",
            "target (ft)",
            "target [yard]",
            "target (km)",
            "target_ft",
            "deviation [Å]",
            "deviation [V]",
            "deviation (counts)",
            "deviation counts",
            "error (ppm)",
            "error [tenths]",
            "error hundredths mm",
            "error um/m",
            "error [um/m]",
            "deviation (microvolts)",
            "spindle mV",
            "temp F",
            "deviation [10 µm]",
            "load [%]",
            "error (µm) [mm]",
            "deviation [furlong]",
            "deviation_mgon",
        ] {
            assert!(
                matches!(of(name), Stated::Unknown(_)),
                "{name}: {:?}",
                of(name)
            );
        }
        for name in [
            "deviation",
            "target",
            "run",
            "target (laser)",
            "deviation (run 1)",
            "Position [X]",
            "deviation (up)",
            "deviation (1)",
            "error [-]",
            "mm",
            "1 up",
            "Run 2 ↓",
            "d",
            "z",
            "radial 100 mm bar",
            "sensor F",
            "bearing (front)",
            "deviation (mean)",
            "grade",
            "radius angle",
            "deviation (abs)",
            "",
        ] {
            assert_eq!(of(name), Stated::Nothing, "{name}");
        }
    }

    #[test]
    fn parts_of_units_and_words_that_a_name_does_not_know_are_unknown() {
        let names = "deviation (mdeg);deviation_mdeg;deviation/µdeg;error m°;target (millideg);error mas;deviation (steps);deviation 0.1um;deviation V;deviation dmm;error/inc;deviation %;error lambda/4;error µ\";deviation milli;deviation um per m;deviation furlongs;deviation foo;target foo;Abweichung mdeg Lauf 1;deviation thous;error uinches;drift pixels;error µstrain;deviation (abcd9);deviation [gesamt];deviation counts gesamt";
        for name in names.split(';') {
            let found = of(name);
            assert!(matches!(found, Stated::Unknown(_)), "{name}: {found:?}");
        }
        let names = "deviation Laser;Soll-Ist-Abweichung;target position X;error mean value;deviation run1;spindle (Heidenhain);bearing rear;deviation step 3;Deviation, forward;deviation warm;Abweichung kalt;Abweichung gesamt;deviation net;deviation (net);growth rate;Position error (Renishaw);error (API);deviation Zygo;error SIOS;Abweichung links;target drawing;deviation (cold state);\"deviation\"";
        for name in names.split(';') {
            assert_eq!(of(name), Stated::Nothing, "{name}");
        }
    }

    fn checked(units: &str, [target, read]: [&str; 2]) -> Result<()> {
        let text = format!(
            "start_s: 0\nunits: {units}\ntest:\n  positioning: {{axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, target_mm: {}, deviation_um: {}}}\n",
            quoted(target),
            quoted(read)
        );
        let map: Map = serde_saphyr::from_str(&text).expect("a map");
        map.check_columns()
    }

    #[test]
    fn a_name_that_contradicts_its_key_is_refused_until_units_states_the_unit() {
        for (target, read, words) in [
            (
                "t",
                "deviation mm",
                "its name says mm, the map um: state `units: {\"deviation mm\": mm}`",
            ),
            ("t", "deviation [µin]", "its name says µin, the map um"),
            ("t", "deviation [nm]", "its name says nm, the map um"),
            (
                "t",
                "deviation arcsec",
                "its name says arcsec, the map um: name a column in one of nm, um",
            ),
            ("target inch", "d", "its name says inch, the map mm"),
            (
                "t",
                "Deviation (mil)",
                "\"mil\", which is no unit that is known, and the map um: known are nm, um, mm, cm, m",
            ),
            ("target\n(ft)", "d", "`units: {\"target\\n(ft)\": mm}`"),
        ] {
            let said = checked("{}", [target, read]).expect_err(read).to_string();
            assert!(said.contains(words), "{said}");
            let name = if target == "t" { read } else { target };
            for unit in ["um", "mm", "thou"] {
                let units = format!("{{{}: {unit}}}", quoted(name));
                assert!(checked(&units, [target, read]).is_ok(), "{units}");
            }
        }
        assert!(checked("{}", ["target_mm", "deviation_um"]).is_ok());
    }

    #[test]
    fn a_line_of_units_has_one_and_no_number() {
        for (cells, is) in [
            (&["-", "", "mm", "µm"][..], true),
            (&["[mm]", "[1/100 mm]"], true),
            (&["mils", "mils"], true),
            (&["1", "up", "0", "0.5"], false),
            (&["mm", "0,5"], false),
            (&["see", "below"], false),
            (&[], false),
        ] {
            assert_eq!(is_row(cells.iter().copied()), is, "{cells:?}");
        }
    }
}
