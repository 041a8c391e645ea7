//! Names of columns that hold the deviations of a positioning test, word by word.
//!
//! A table of a laser has columns beside the readings whose names hold the same word: `Pitch error`, `Standard deviation`,
//! `Abs. error`, `Fehlergrenze`, `error*10`. None of a name's words may therefore be unknown here. Any other column is named
//! with the word that is in doubt, and read where a map names it.

use super::pass_names::axis_of;
use super::recognise::{Known, Recognised, Role, parts};
use super::stated;
use super::units::{Kind, Unit};
use super::vocabulary::words;

/// Words for a deviation.
const DEVIATION: &[&str] = &[
    "dev",
    "devs",
    "devn",
    "deviation",
    "deviations",
    "err",
    "errs",
    "error",
    "errors",
    "abw",
    "posabw",
    "abweichung",
    "abweichungen",
    "fehler",
    "diff",
    "diffs",
    "difference",
    "differences",
    "differenz",
    "delta",
];
/// What one of them is joined to in one word.
const JOINED: &[&str] = &[
    "positions",
    "position",
    "positionier",
    "positionierungs",
    "gesamt",
    "lage",
    "laser",
    "mess",
    "linear",
    "weg",
    "pos",
    "achs",
    "achsen",
    "x",
    "y",
    "z",
];
/// Other words of such a name: they name the instrument, the state of the machine, or the readings as such.
const HARMLESS: &[&str] = &[
    // Grammar, numbers of repetitions.
    "of",
    "the",
    "in",
    "at",
    "on",
    "off",
    "and",
    "from",
    "for",
    "to",
    "und",
    "der",
    "des",
    "die",
    "bei",
    "axis",
    "achse",
    "axe",
    "value",
    "values",
    "wert",
    "werte",
    "data",
    "point",
    "punkt",
    "no",
    "nr",
    "n",
    "i",
    "j",
    "ij",
    "run",
    "cycle",
    "test",
    "series",
    "lauf",
    "zyklus",
    "messung",
    "reihe",
    "column",
    "vom",
    "von",
    "zu",
    "zum",
    // The quantity itself.
    "set",
    "setpoint",
    "sollposition",
    "comp",
    "position",
    "positional",
    "positioning",
    "pos",
    "posn",
    "linear",
    "axial",
    "rotary",
    "angular",
    "angle",
    "length",
    "displacement",
    "travel",
    "target",
    "nominal",
    "commanded",
    "command",
    "soll",
    "sollwert",
    "ist",
    "istwert",
    "messwert",
    "measured",
    "measurement",
    "meas",
    "actual",
    "indicated",
    "observed",
    "recorded",
    "read",
    "reading",
    "readings",
    "gemessen",
    "gemessene",
    "total",
    "overall",
    "gesamt",
    "signed",
    "minus",
    "radial",
    // How it was come by.
    "raw",
    "roh",
    "final",
    "original",
    "corrected",
    "uncorrected",
    "korrigiert",
    "korrigierte",
    "compensated",
    "uncompensated",
    "kompensiert",
    "unkompensiert",
    "with",
    "without",
    "before",
    "after",
    "under",
    "mit",
    "ohne",
    "vor",
    "nach",
    "compensation",
    "correction",
    "kompensation",
    "korrektur",
    "active",
    "inactive",
    "aktiv",
    "ein",
    "aus",
    "cold",
    "warm",
    "hot",
    "kalt",
    // Instruments and machines.
    "laser",
    "interferometer",
    "lasertracker",
    "tracker",
    "scale",
    "encoder",
    "probe",
    "sensor",
    "gauge",
    "ballbar",
    "renishaw",
    "xl80",
    "xl",
    "ml10",
    "xm60",
    "agilent",
    "keysight",
    "hp",
    "zygo",
    "sios",
    "heidenhain",
    "lasertex",
    "api",
    "machine",
    "maschine",
    "exx",
    "eyy",
    "ezz",
    "eaa",
    "ebb",
    "ecc",
];
/// Signs by which a name says that its numbers were multiplied, divided or turned.
const SCALING_MARKS: &[char] = &['*', '×', '·', '²', '^', '=', '%'];

/// The word, or the sign, by which a column may hold something else than readings; none where each is known.
pub fn doubt(name: &str) -> Option<String> {
    if let Some(sign) = sign_of(name) {
        return Some(sign);
    }
    let digit_beside = |slash: usize| {
        let is_digit = |letter: Option<char>| letter.is_some_and(|letter| letter.is_ascii_digit());
        is_digit(name[..slash].trim_end().chars().next_back())
            || is_digit(name[slash + 1..].trim_start().chars().next())
    };
    let (mut all, inner) = parts(name);
    let is_unit = |text: &String| Unit::of_word(text).is_some();
    let note = inner.filter(|inner| !is_unit(inner));
    all.extend(note.iter().flat_map(|note| words(note)));
    // A word in the place of a unit is refused as one that is not known.
    let unit = stated::of(name).unknown();
    let mut slashes = name.match_indices('/').map(|(slash, _)| slash);
    if unit.is_none() && slashes.any(digit_beside) {
        return Some("/".to_owned());
    }
    let is_length = |word: &&String| {
        Unit::of_word(word).is_some_and(|unit| matches!(unit.kind(), Kind::Length | Kind::Angle))
    };
    // `in` is a word beside a unit, and one by itself in brackets.
    let every = words(name);
    let mut lengths = every.iter().filter(|word| *word != "in").filter(is_length);
    if let (Some(first), Some(second)) = (lengths.next(), lengths.next())
        && first != second
    {
        return Some(format!("{first}, {second}"));
    }
    if let Some(odd) = odd_number(&every).or_else(|| two_axes(&every)) {
        return Some(odd);
    }
    let is_unit = |word: &String| unit.as_ref().is_some_and(|unit| words(unit).contains(word));
    all.into_iter()
        .find(|word| !is_known(word) && !is_unit(word))
}

/// `Error No.` without what is numbered, and `x 10`, `x 0.1`.
fn odd_number(words: &[String]) -> Option<String> {
    // `X 2` is the second run of X.
    let is_factor = |word: &String| word.parse::<u32>().is_ok_and(|n| n == 0 || n >= 10);
    let is_times = |two: &[String]| two[0] == "x" && is_factor(&two[1]);
    if words.windows(2).any(is_times) {
        return Some("x".to_owned());
    }
    const NUMBERED: [&str; 10] = [
        "run", "cycle", "test", "series", "lauf", "zyklus", "messung", "reihe", "point", "punkt",
    ];
    let number = words
        .iter()
        .find(|word| matches!(word.as_str(), "no" | "nr"))?;
    let is_of = |word: &String| NUMBERED.contains(&word.as_str());
    // `no compensation`, `Error no comp`.
    let is_denial = words
        .iter()
        .any(|word| word.starts_with("comp") || word.starts_with("corr"));
    (!is_denial && !words.iter().any(is_of)).then(|| number.clone())
}

/// Two letters of axes: a difference of axes, or a deviation across.
fn two_axes(words: &[String]) -> Option<String> {
    let mut axes = words
        .iter()
        .filter(|word| word.len() == 1 && axis_of(word).is_some());
    let first = axes.next()?;
    let second = axes.find(|other| *other != first)?;
    Some(format!("{first}, {second}"))
}

fn is_known(word: &str) -> bool {
    let bare = word.trim_end_matches(|letter: char| letter.is_ascii_digit());
    let is_number = bare.is_empty() && !is_factor(word);
    let joined = || {
        let mut begins = JOINED.iter().filter_map(|begin| bare.strip_prefix(begin));
        begins.any(|rest| DEVIATION.contains(&rest))
    };
    // `deviationX`, `error_um` in one word.
    let with_end = || {
        let mut ends = DEVIATION
            .iter()
            .filter_map(|begin| bare.strip_prefix(begin));
        ends.any(|end| axis_of(end).is_some() || Unit::of_word(end).is_some())
    };
    is_number
        || DEVIATION.contains(&bare)
        || HARMLESS.contains(&word)
        || HARMLESS.contains(&bare)
        || (axis_of(word).is_some() && !is_times(word))
        || Unit::of_word(word).is_some()
        || joined()
        || with_end()
}

/// Whether a number is one that numbers are multiplied by.
fn is_factor(word: &str) -> bool {
    matches!(word, "10" | "100" | "1000" | "10000")
}

/// `x10`: times ten, and no axis of that number; `x1` is the first run of X.
fn is_times(word: &str) -> bool {
    let number = word
        .strip_prefix('x')
        .and_then(|number| number.parse::<u32>().ok());
    number.is_some_and(|number| number >= 10)
}

/// Begins of words of quantities that no displacement and no radial deviation is, and of what was done to its numbers.
const NO_READING_BEGINS: &[&str] = &[
    "veloc",
    "accel",
    "setpoint",
    "command",
    "residual",
    "model",
    "predict",
    "simul",
    "cumul",
    "rough",
    "vibrat",
    "thick",
    "clearance",
    "invert",
    "negat",
    "squared",
    "geschwind",
    "rauheit",
    "schwing",
    "dicke",
];
/// Other such words, whole.
const NO_READING_WORDS: &[&str] = &[
    "neg", "minus", "abs", "absolute", "sum", "cum", "dt", "times",
];

/// The word, or the sign, by which a column of a log or of circles holds no plain readings; none where none is seen.
fn doubt_of_reading(name: &str) -> Option<String> {
    if let Some(sign) = sign_of(name) {
        return Some(sign);
    }
    let every = words(name);
    // `mm/s` is a unit, `z/2` a half and `dz/dt` a speed.
    let after_slash = name.split('/').skip(1).map(str::trim_start);
    let is_digit = |text: &str| text.starts_with(|letter: char| letter.is_ascii_digit());
    if after_slash.into_iter().any(is_digit) && stated::of(name).unknown().is_none() {
        return Some("/".to_owned());
    }
    let is_other = |word: &&String| {
        NO_READING_WORDS.contains(&word.as_str())
            || NO_READING_BEGINS
                .iter()
                .any(|begin| word.starts_with(begin))
            || is_times(word)
    };
    odd_number(&every).or_else(|| every.iter().find(is_other).cloned())
}

/// A sign before a name, or one of a multiplication in it.
fn sign_of(name: &str) -> Option<String> {
    let first = name.trim_start().chars().next();
    if let Some(minus) = first.filter(|first| ['-', '\u{2212}', '\u{2013}', '±'].contains(first)) {
        return Some(minus.to_string());
    }
    if words(name).first().is_some_and(|first| first == "minus") {
        return Some("minus".to_owned());
    }
    let mark = name.chars().find(|letter| SCALING_MARKS.contains(letter));
    mark.map(|mark| mark.to_string())
}

/// The columns of a table, where beside targets or angles only those hold deviations whose names say nothing else.
pub fn plain_alone(mut columns: Vec<Known>) -> Vec<Known> {
    let is_place = |column: &Known| matches!(column.role, Some(Role::Target | Role::Angle));
    for column in &mut columns {
        let is_reading = matches!(column.role, Some(Role::Displacement | Role::Radial));
        if is_reading && doubt_of_reading(&column.name).is_some() {
            column.role = None;
        }
    }
    if columns.iter().any(is_place) {
        let deviations = columns.iter_mut();
        for column in deviations.filter(|column| column.role == Some(Role::Deviation)) {
            if doubt(&column.name).is_some() {
                column.role = None;
            }
        }
    }
    columns
}

/// A sentence on columns that are no deviations by a word of their names; empty without any.
pub fn unsure(found: &Recognised) -> String {
    let columns = found.columns.iter().filter(|column| column.role.is_none());
    let in_doubt = columns.filter(|column| !column.numbers.is_empty());
    let named: Vec<String> = in_doubt
        .filter_map(|column| {
            let of_reading = || doubt_of_reading(&column.name);
            let of_deviation = doubt(&column.name).filter(|_| is_one(&column.name));
            let word = of_deviation.or_else(of_reading)?;
            Some(format!("\"{}\" ({word})", column.name))
        })
        .collect();
    if named.is_empty() {
        return String::new();
    }
    format!(
        "column {}: may hold no plain readings by what stands in brackets here: where it has what was measured less what was meant, \
         name it in a map (deviation_um, displacement_um, radial_um); ",
        named.join(", ")
    )
}

/// Whether a name has a word for a deviation, with whatever else.
fn is_one(name: &str) -> bool {
    const DEVIATION_BEGINS: [&str; 6] = ["dev", "err", "abw", "fehler", "diff", "delta"];
    const DEVIATION_ENDS: [&str; 4] = ["abweichung", "abweichungen", "fehler", "fehlers"];
    words(name).iter().any(|word| {
        DEVIATION_BEGINS.iter().any(|begin| word.starts_with(begin))
            || DEVIATION_ENDS.iter().any(|end| word.ends_with(end))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_of_which_each_word_is_known_is_that_of_readings() {
        for name in [
            "deviation_um",
            "Deviation [µm]",
            "X deviation (um)",
            "DeviationX",
            "Err",
            "error um",
            "Error 1 (µm)",
            "Abweichung",
            "Positionsabweichung [µm]",
            "Positionierfehler um",
            "Gesamtabweichung",
            "raw error um",
            "final error um",
            "error after compensation",
            "deviation (compensation on)",
            "uncompensated error",
            "Laser deviation um",
            "Renishaw XL80 error um",
            "diff",
            "delta_um",
            "EXX deviation um",
            "error in um",
            "deviation [1] um",
            "Fehler ohne Korrektur",
            "measured - target difference",
            "Abw. [um]",
            "Abw. X-Achse",
            "Pos.-Abw. [um]",
            "Abweichung vom Sollwert",
            "Abweichung zum Soll",
            "Deviation from set point",
            "Messabweichung",
            "Linearabweichung",
            "Posfehler",
            "Error no comp",
            "error run no 1",
        ] {
            assert_eq!(doubt(name), None, "{name}");
        }
    }

    #[test]
    fn a_statistic_a_limit_another_error_or_a_factor_is_in_doubt() {
        let names = [
            "Standard deviation;St.dev.;Abs. deviation;Absolute error;Peak error;error budget;error bar",
            "expanded error;Fehlergrenze;Abweichungsgrenze;zul. Abweichung;mittlerer Fehler;mittl. Abweichung",
            "Residual error;detrended error;predicted error;model error;Pitch error um;Abbe error",
            "cosine error;dead path error;humidity error;closure error;form error;cyclic error;drift error",
            "backlash error;lost motion error;following error;contouring error;servo error;Schleppfehler",
            "Fehlernummer;error flag;error code;deviation sum;cumulative error;incremental error",
            "diff to previous;-error um;\u{2212}error um;neg. error;inverted error;1/error;error (um)/2",
            "half error;error*10;error x10;deviation x 1000 mm;minus error [um];Error x 0.1 um;Fehler Nr;Error No. [um];diff x-y um;Deviation mm (um);EYX error um;Lateral deviation um",
            "vertical deviation um;horizontal deviation um;normal deviation um;cross deviation um",
            "median error;worst error;allowed error",
        ];
        for name in names.iter().flat_map(|names| names.split(';')) {
            // A short word is refused as a unit that is not known.
            let is_refused = doubt(name).is_some() || stated::of(name).unknown().is_some();
            assert!(is_refused, "{name}");
        }
    }
}
