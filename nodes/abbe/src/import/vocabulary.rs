//! Words in the names of columns: those that name no unit, those that stand for a unit that no map knows, and those that
//! turn the sign of a deviation.

use super::map::Direction;
use super::units::Unit;

/// Words of units that no map knows, lower case, and of parts of units (`hundredths mm`).
const FOREIGN: &[&str] = &[
    "mil",
    "mils",
    "tenth",
    "tenths",
    "hundredth",
    "hundredths",
    "thousandth",
    "thousandths",
    "zehntel",
    "hundertstel",
    "tausendstel",
    "dm",
    "dmm",
    "km",
    "ft",
    "foot",
    "feet",
    "yd",
    "yard",
    "yards",
    "angstrom",
    "angstroms",
    "å",
    "pm",
    "v",
    "mv",
    "uv",
    "volt",
    "volts",
    "millivolt",
    "millivolts",
    "microvolt",
    "microvolts",
    "count",
    "counts",
    "cnt",
    "cnts",
    "cts",
    "inc",
    "incs",
    "incr",
    "increment",
    "increments",
    "inkrement",
    "inkremente",
    "digit",
    "digits",
    "tick",
    "ticks",
    "pulse",
    "pulses",
    "puls",
    "impuls",
    "impulse",
    "step",
    "steps",
    "schritt",
    "schritte",
    "lsb",
    "bit",
    "bits",
    "div",
    "divs",
    "division",
    "divisions",
    "skt",
    "ppm",
    "ppb",
    "percent",
    "prozent",
    "promille",
    "permille",
    "mgon",
    "ohm",
    "ohms",
    "nrad",
    "u",
    "uu",
    "mu",
    "my",
    "line",
    "lines",
    "fringe",
    "fringes",
    "lambda",
    "λ",
    "wavelength",
    "wavelengths",
    "furlong",
    "furlongs",
    "ångström",
    "angström",
    "ångstrom",
    "percentage",
    "pixel",
    "pixels",
    "radiant",
    "teilstrich",
    "teilstriche",
    "skalenteil",
    "skalenteile",
    "wellenlänge",
    "wellenlängen",
    "pouce",
    "pouces",
    "pollice",
    "pollici",
    "pulgada",
    "pulgadas",
    "milli",
    "micro",
    "mikro",
    "nano",
    "ma",
    "ampere",
];
/// Names of parts of a unit, long and short, and what a short one stands before.
const LONG_PARTS: &[&str] = &[
    "milli", "micro", "mikro", "nano", "pico", "piko", "centi", "zenti", "deci", "dezi", "kilo",
];
const SHORT_PARTS: &[char] = &['m', 'u', 'n', 'p', 'c', 'd', 'k'];
const SHORT_WHOLES: &[&str] = &[
    "deg", "degree", "degrees", "°", "arcsec", "arcmin", "rad", "gon", "turn", "rev", "volt",
    "inch",
];
/// Short words beside a quantity that are no unit; in brackets too.
const NOTE_WORDS: &[&str] = &[
    "abs", "rel", "avg", "raw", "ist", "max", "act", "cmd", "dev", "opt", "cw", "ccw", "lh", "rh",
    "1st", "2nd", "3rd", "mid", "top", "utc", "gmt", "cet", "mez", "sum", "ref", "iso", "low",
    "uni", "bi", "old", "new", "all", "any", "c", "net", "api",
];
/// Other words of names, whole.
const WORDS: &[&str] = &[
    "x", "y", "z", "a", "b", "r", "n", "i", "xy", "yz", "zx", "xz", "nr", "no", "id", "of", "to",
    "at", "on", "off", "by", "from", "the", "and", "or", "val", "std", "rms", "pv", "ch", "set",
    "tcp", "cap", "ave", "ein", "aus", "mit", "von", "an", "bei", "pt", "bar", "hot", "cold",
    "tip", "warm", "kalt", "heiss", "heiß", "gesamt", "rate", "renishaw", "zygo", "agilent",
    "keysight", "sios",
];
/// Begins of other words of names.
const BEGINS: &[&str] = &[
    "dev",
    "err",
    "abweich",
    "fehler",
    "diff",
    "delta",
    "target",
    "soll",
    "nominal",
    "pos",
    "command",
    "ziel",
    "measur",
    "actual",
    "read",
    "mess",
    "laser",
    "run",
    "cycle",
    "lauf",
    "zyklus",
    "pass",
    "dir",
    "richt",
    "approach",
    "displ",
    "drift",
    "growth",
    "weg",
    "radial",
    "radius",
    "ballbar",
    "angle",
    "angular",
    "winkel",
    "theta",
    "phi",
    "temp",
    "therm",
    "axis",
    "achse",
    "axe",
    "linear",
    "rotary",
    "mean",
    "average",
    "mittel",
    "value",
    "wert",
    "total",
    "sigma",
    "stand",
    "correct",
    "korrig",
    "compensated",
    "uncompensated",
    "kompensiert",
    "roh",
    "signal",
    "data",
    "daten",
    "channel",
    "kanal",
    "sensor",
    "probe",
    "taster",
    "gauge",
    "indicator",
    "encoder",
    "scale",
    "interferometer",
    "test",
    "left",
    "right",
    "upper",
    "lower",
    "front",
    "rear",
    "back",
    "start",
    "end",
    "first",
    "last",
    "begin",
    "spindle",
    "spindel",
    "table",
    "tisch",
    "tool",
    "machine",
    "maschine",
    "control",
    "reference",
    "absolute",
    "relative",
    "signed",
    "sign",
    "before",
    "after",
    "with",
    "horizontal",
    "vertical",
    "straight",
    "pitch",
    "yaw",
    "roll",
    "sample",
    "series",
    "column",
    "point",
    "punkt",
    "number",
    "plus",
    "minus",
    "position",
    "motor",
    "screw",
    "best",
    "fit",
    "slope",
    "result",
    "ergebnis",
    "final",
    "nose",
    "head",
    "kopf",
    "bed",
    "vor",
    "nach",
    "ohne",
    "time",
    "zeit",
    "plane",
    "ebene",
    "circle",
    "kreis",
    "optic",
    "nomin",
    "ideal",
    "true",
    "real",
    "calc",
    "estimat",
    "filter",
    "rohwert",
    "original",
    "circular",
    "reversal",
    "up",
    "down",
    "forw",
    "backw",
    "revers",
    "negativ",
    "bidirect",
    "unidirect",
    "mirror",
    "microscop",
    "mikroskop",
    "heidenhain",
];
/// Most letters of a word that stands for a unit without being a known one; longer ones are words.
const LONGEST_SHORT: usize = 4;
/// Ends of plurals and of declined words.
const PLURALS: &[&str] = &["s", "es", "n", "en"];
/// Begins of the words of a quantity whose unit has to be known.
const QUANTITIES: &[&str] = &[
    "dev", "err", "abweich", "fehler", "diff", "delta", "target", "soll", "nominal", "pos",
    "command", "ziel", "measur", "actual", "reading", "mess", "displ", "drift", "growth", "weg",
    "radial", "radius", "angle", "winkel", "theta", "phi",
];
/// What changes a machine, in words whose sign is no deviation's.
const CORRECTIONS: &[&str] = &[
    "compensation",
    "correction",
    "korrektur",
    "kompensation",
    "correcting",
    "compensating",
];
/// Words beside a correction with which a column holds what was measured under it.
const UNDER_IT: &[&str] = &[
    "with", "without", "before", "after", "no", "mit", "ohne", "vor", "nach", "under",
];
const STATES: &[&str] = &["on", "off", "ein", "aus", "active", "inactive", "aktiv"];

/// Lower case with `u` for a micro sign.
pub fn plain(word: &str) -> String {
    word.to_lowercase().replace(['µ', 'μ'], "u")
}

/// Whether a word is a unit, or a part of one, that no map knows.
pub fn is_foreign(word: &str) -> bool {
    let word = plain(word);
    if Unit::of_word(&word).is_some() {
        return false;
    }
    let of_long = || {
        let rest = LONG_PARTS.iter().find_map(|part| word.strip_prefix(part));
        rest.is_some_and(|rest| is_whole(rest) || Unit::of_word(rest).is_some())
    };
    let of_short = || {
        let rest = word.strip_prefix(SHORT_PARTS);
        rest.is_some_and(|rest| is_whole(rest) || word == "mas" || word == "uas")
    };
    FOREIGN.contains(&word.as_str()) || of_long() || of_short()
}

fn is_whole(rest: &str) -> bool {
    SHORT_WHOLES.contains(&rest)
}

/// Whether a short word is a note and no unit.
pub fn is_note_word(lower: &str) -> bool {
    NOTE_WORDS.contains(&lower)
}

/// Whether a word is too long for a short name of a unit, and no form or multiple of one.
fn is_long(word: &str) -> bool {
    let is_letter = |letter: char| letter.is_alphabetic() && !matches!(letter, 'µ' | 'μ');
    let lower = plain(word);
    let is_unit = |word: &str| Unit::of_word(word).is_some() || is_foreign(word);
    let mut singles = PLURALS.iter().filter_map(|end| lower.strip_suffix(*end));
    word.chars().count() > LONGEST_SHORT
        && word.chars().all(is_letter)
        && !is_unit(&lower)
        && !singles.any(is_unit)
        && !LONG_PARTS.iter().any(|part| lower.starts_with(part))
}

/// Whether a word of a name is known to be none of a unit, or too long for one; digits at its end only number it.
pub fn is_known(word: &str) -> bool {
    let lower = plain(word);
    let bare = lower.trim_end_matches(|letter: char| letter.is_ascii_digit());
    !is_foreign(word)
        && (is_note_word(&lower)
            || WORDS.contains(&bare)
            || BEGINS.iter().any(|begin| bare.starts_with(begin))
            || is_long(word)
            || Direction::of_word(word).is_some())
}

/// Whether a name is that of a length, a position or an angle: what stands where a unit does is one, or a known word.
pub fn is_quantity(name: &str) -> bool {
    let words = words(name);
    let begins = |begins: &[&str]| {
        let mut all = words.iter();
        all.any(|word| begins.iter().any(|begin| word.starts_with(begin)))
    };
    begins(QUANTITIES) && !begins(&["temp", "therm"])
}

/// Words of a name in lower case.
pub fn words(name: &str) -> Vec<String> {
    let words = name.split(|letter: char| !letter.is_alphanumeric());
    let words = words.filter(|word| !word.is_empty());
    words.map(str::to_lowercase).collect()
}

/// Whether a name is that of a correction, whose sign is the other one of the deviation on many controls.
/// `error after compensation` and `deviation (compensation on)` are deviations.
pub fn is_correction(name: &str) -> bool {
    let words = words(name);
    let is_one = |word: &str| {
        CORRECTIONS.iter().any(|part| word.contains(part))
            || matches!(word, "corr" | "korr" | "komp" | "cmp")
            || word.ends_with("comp")
    };
    let is_under = |k: usize| {
        let before = k.checked_sub(1).and_then(|k| words.get(k));
        let stands = |word: Option<&String>, all: &[&str]| {
            word.is_some_and(|word| all.contains(&word.as_str()))
        };
        stands(before, UNDER_IT) || stands(words.get(k + 1), STATES)
    };
    (0..words.len()).any(|k| is_one(&words[k]) && !is_under(k))
}

/// Whether the measured position comes first in a name and the target is taken from it (`Ist-Soll`, `actual - nominal`): a
/// deviation.
pub fn is_difference(name: &str) -> bool {
    has_minus_between(name, OF_MEASURED, OF_TARGETS)
}

/// Whether the target comes first in a name and the measured position is taken from it (`Soll-Ist`,
/// `target - measured`): the negative of a deviation.
pub fn is_reversed(name: &str) -> bool {
    has_minus_between(name, OF_TARGETS, OF_MEASURED)
}

/// Begins of words of targets, and of measured positions.
const OF_TARGETS: &[&str] = &["target", "soll", "nominal", "command", "ziel"];
const OF_MEASURED: &[&str] = &["measur", "actual", "ist", "reading", "laser", "messwert"];

/// Whether a word of the first kind, a minus and a word of the second kind follow one another.
fn has_minus_between(name: &str, first: &[&str], second: &[&str]) -> bool {
    let lower = name.to_lowercase().replace(['\u{2212}', '\u{2013}'], "-");
    let lower = lower.replace(" minus ", " - ");
    let mut sides = lower.split('-').peekable();
    while let (Some(left), Some(right)) = (sides.next(), sides.peek()) {
        let (left, right) = (words(left), words(right));
        let begins = |word: Option<&String>, all: &[&str]| {
            word.is_some_and(|word| all.iter().any(|begin| word.starts_with(begin)))
        };
        if begins(left.last(), first) && begins(right.first(), second) {
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_correction_or_a_reversed_difference_is_no_deviation() {
        use super::{is_correction, is_reversed};

        for name in [
            "error compensation um",
            "compensation",
            "Korrektur [µm]",
            "Fehlerkorrektur",
            "correction_um",
            "err comp",
            "errcomp (um)",
            "deviation (correction)",
            "1 up compensation",
            "Kompensationswert",
        ] {
            assert!(is_correction(name), "{name}");
        }
        for name in [
            "deviation",
            "error after compensation",
            "deviation without compensation",
            "deviation (compensation on)",
            "corrected deviation",
            "uncompensated error",
            "component",
            "computed error",
            "Fehler ohne Korrektur",
        ] {
            assert!(!is_correction(name), "{name}");
        }
        for name in [
            "target - measured",
            "Soll-Ist",
            "Soll-Ist-Abweichung [µm]",
            "error (nominal minus actual)",
            "deviation = target \u{2212} actual um",
        ] {
            assert!(is_reversed(name), "{name}");
        }
        for name in ["measured - target", "Ist-Soll", "target", "Soll", "x-y", ""] {
            assert!(!is_reversed(name), "{name}");
        }
        for name in [
            "Ist-Soll [um]",
            "Actual - Nominal [um]",
            "measured-target [um]",
            "Messwert-Sollwert [um]",
            "Reading - target [um]",
            "Laser\u{2212}Nominal (um)",
        ] {
            assert!(super::is_difference(name) && !is_reversed(name), "{name}");
        }
    }

    #[test]
    fn parts_of_units_are_foreign_and_words_of_the_trade_are_not() {
        use super::{is_foreign, is_known};

        for word in [
            "mdeg",
            "µdeg",
            "udeg",
            "m°",
            "millideg",
            "mas",
            "steps",
            "V",
            "dmm",
            "inc",
            "digit",
            "milli",
            "nrad",
            "kilometer",
            "µ",
            "centideg",
        ] {
            assert!(is_foreign(word), "{word}");
        }
        for word in [
            "mm",
            "mrad",
            "urad",
            "min",
            "grad",
            "mean",
            "das",
            "pos",
            "micrometer",
        ] {
            assert!(!is_foreign(word), "{word}");
        }
        let known = "laser run1 x Mittelwert forward 3rd warm kalt heiß gesamt net rate Renishaw API Zygo2 Heidenhain Lasertex SIOS links Gegenlauf Mikroskop turbine";
        for word in known.split(' ') {
            assert!(is_known(word), "{word}");
        }
        let unknown = "mdeg furlongs foo 1um u abcd mdegs thous arcsecs uinches mrads Millimetern millistrain µstrain pixel Ångström km/h foobar7";
        for word in unknown.split(' ') {
            assert!(!is_known(word), "{word}");
        }
    }
}
