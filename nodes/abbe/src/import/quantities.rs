//! Words by which the name of a column of numbers is that of a quantity, and those that make another one of it.

use super::pass_names::axis_of;
use super::recognise::Role;
use super::units::Unit;

/// What a column of numbers holds by a word of its name: by the word's begin, or as a whole. The first that fits holds.
const ROLE_WORDS: [(Role, &[&str], &[&str]); 9] = [
    (Role::Temperature, &["temp", "therm"], &[]),
    (
        Role::Time,
        &["time", "zeit", "stamp", "epoch"],
        &["t", "date", "datum"],
    ),
    (Role::Radial, &["radial", "radius", "ballbar"], &[]),
    (Role::Angle, &["angle", "winkel", "theta", "phi"], &[]),
    (
        Role::Deviation,
        &["dev", "err", "abweich", "fehler", "diff", "delta"],
        &["abw", "posabw"],
    ),
    (
        Role::Measured,
        &["measur", "actual", "reading", "mess"],
        &["ist", "istwert", "laser"],
    ),
    (
        Role::Target,
        &["target", "soll", "nominal", "position", "command", "ziel"],
        &["pos"],
    ),
    (
        Role::Run,
        &[
            "run",
            "cycle",
            "lauf",
            "zyklus",
            "pass",
            "durchgang",
            "durchlauf",
        ],
        &["nr", "no", "n"],
    ),
    (
        Role::Displacement,
        &["displ", "drift", "growth", "weg"],
        &["x", "y", "z"],
    ),
];
/// Words of runs that begin like those of readings.
const READING_WORDS_OF_RUNS: [&str; 5] = [
    "messreihe",
    "messreihen",
    "messlauf",
    "messdurchgang",
    "messzyklus",
];
/// Words of a reading, and those beside them that make a number of one: of whole numbers that count, they number runs.
const READING_WORDS: [&str; 13] = [
    "messung",
    "mess",
    "measurement",
    "measure",
    "mesure",
    "mesurage",
    "misura",
    "misurazione",
    "medición",
    "medicion",
    "medida",
    "medição",
    "pomiar",
];
const OF_NUMBERS: [&str; 9] = [
    "nr", "no", "n", "num", "nummer", "number", "numéro", "numero", "id",
];
/// First letters of words for statistics, limits, other errors and computed values. A column with such a word has no readings.
const OF_NO_READING: &[&str] = &[
    "limit",
    "grenz",
    "toleran",
    "threshold",
    "allow",
    "permiss",
    "zuläss",
    "zulaess",
    "specif",
    "mean",
    "averag",
    "mittel",
    "moyenn",
    "media",
    "sigma",
    "stdev",
    "stddev",
    "varianc",
    "range",
    "spread",
    "spannweite",
    "minimum",
    "maximum",
    "uncertain",
    "unsicher",
    "straight",
    "geradheit",
    "flat",
    "ebenheit",
    "squareness",
    "parallel",
    "filter",
    "gefilter",
    "smooth",
    "geglätt",
    "fitted",
    "repeatab",
    "hysteres",
    "reversal",
    "umkehr",
];
/// Other such words, whole.
const OF_NO_READING_WHOLE: &[&str] = &[
    "tol", "avg", "ave", "std", "rms", "min", "max", "fit", "spec", "ucl", "lcl", "usl", "lsl",
    "yaw", "roll", "sd", "2s", "3s",
];
/// Roles that no column of statistics or limits has.
const OF_READINGS: [Role; 5] = [
    Role::Radial,
    Role::Deviation,
    Role::Measured,
    Role::Target,
    Role::Displacement,
];
/// Words that make no other quantity of one.
const PLAIN: &[&str] = &[
    "axis", "achse", "value", "wert", "of", "the", "in", "point", "punkt", "no", "nr",
];

/// Whether a word is one of a role.
fn is_of(role: Role, word: &str) -> bool {
    let own = ROLE_WORDS.iter().find(|(other, ..)| *other == role);
    own.is_some_and(|(_, begins, whole)| {
        whole.contains(&word)
            || begins.iter().any(|begin| word.starts_with(begin))
            || role == Role::Deviation && is_joined_deviation(word)
    })
}

/// `Positionsabweichung`, `Schleppfehler`.
fn is_joined_deviation(word: &str) -> bool {
    ["abweichung", "abweichungen", "fehler"]
        .iter()
        .any(|end| word.ends_with(end))
}

/// Whether words of a name are those of a statistic, a limit or what was worked out of readings.
pub fn is_no_reading(words: &[String]) -> bool {
    words.iter().any(|word| {
        OF_NO_READING_WHOLE.contains(&word.as_str())
            || OF_NO_READING.iter().any(|begin| word.starts_with(begin))
    })
}

/// Whether a column numbers its readings (`Messung`, `Measurement no.`): its name says no more, and its cells count from 0 or 1
/// up, each number for one row or several.
fn numbers_readings(words: &[String], cells: &[&str]) -> bool {
    let is_among = |all: &[&str]| words.iter().any(|word| all.contains(&word.as_str()));
    let is_bare = |word: &String| {
        READING_WORDS.contains(&word.as_str()) || OF_NUMBERS.contains(&word.as_str())
    };
    let numbers: Option<Vec<u32>> = cells.iter().map(|cell| cell.parse().ok()).collect();
    let numbers = numbers.unwrap_or_default();
    let Some(least) = numbers.iter().min() else {
        return false;
    };
    let counts = |two: &[u32]| two[1] == two[0] || two[1] == two[0] + 1 || two[1] == *least;
    let has_rows = numbers.windows(2).any(|two| two[1] != two[0] + 1);
    is_among(&READING_WORDS)
        && words.iter().all(is_bare)
        && *least <= 1
        && has_rows
        && numbers.windows(2).all(counts)
}

/// What a column of numbers holds by the words of its name and its cells; one of a length without others holds a displacement.
pub fn of(words: &[String], is_length: bool, cells: &[&str]) -> Option<Role> {
    let is_of_runs = words
        .iter()
        .any(|word| READING_WORDS_OF_RUNS.contains(&word.as_str()));
    if is_of_runs || !is_length && numbers_readings(words, cells) {
        return Some(Role::Run);
    }
    let mut roles = ROLE_WORDS.iter().map(|(role, ..)| *role);
    let named = roles.find(|role| words.iter().any(|word| is_of(*role, word)));
    let role = named.or_else(|| is_length.then_some(Role::Displacement))?;
    (!OF_READINGS.contains(&role) || !is_no_reading(words)).then_some(role)
}

/// How many words of a name qualify the quantity of its role.
pub fn n_qualifiers(words: &[String], role: Role) -> usize {
    let is_number = |word: &str| word.chars().all(|letter| letter.is_ascii_digit());
    let is_plain = |word: &str| {
        is_of(role, word)
            || PLAIN.contains(&word)
            || Unit::of_word(word).is_some()
            || is_number(word)
            || axis_of(word).is_some()
    };
    words.iter().filter(|word| !is_plain(word.as_str())).count()
}

/// Whether a column without a unit is that of a thermometer: named by a place, with numbers that are degrees Celsius.
pub fn is_warm(words: &[String], numbers: &[f64]) -> bool {
    const SENSOR_PLACES: [&str; 28] = [
        "spindle",
        "bearing",
        "ambient",
        "room",
        "air",
        "bed",
        "column",
        "nut",
        "coolant",
        "table",
        "raum",
        "luft",
        "spindel",
        "bett",
        "headstock",
        "head",
        "nose",
        "rear",
        "front",
        "motor",
        "base",
        "hall",
        "lager",
        "ständer",
        "säule",
        "tisch",
        "halle",
        "umgebung",
    ];
    let is_sensor = |word: &str| {
        let number = ["ptc", "pt", "tc", "ntc", "t"]
            .iter()
            .find_map(|kind| word.strip_prefix(kind));
        let is_numbered =
            |rest: &str| !rest.is_empty() && rest.bytes().all(|one| one.is_ascii_digit());
        SENSOR_PLACES.contains(&word)
            || word.starts_with("spindellager")
            || number.is_some_and(is_numbered)
    };
    let named = words.iter().any(|word| is_sensor(word));
    // A broken wire reads far off, and is left out by its line.
    let n_warm = numbers
        .iter()
        .filter(|degc| (-20.0..=150.0).contains(*degc))
        .count();
    named && !numbers.is_empty() && 10 * n_warm >= 9 * numbers.len()
}

/// Whether words are those of a nut with the letter of its axis, which is no displacement along it.
pub fn is_nut(words: &[String]) -> bool {
    words
        .iter()
        .any(|word| matches!(word.as_str(), "nut" | "screw" | "mutter" | "spindelmutter"))
}

#[cfg(test)]
mod tests {
    use super::super::recognise::of_text;
    use super::*;

    /// The column that is taken as one of a role, and others that fit as well.
    fn taken(head: &str, role: Role) -> (Option<String>, Vec<String>) {
        let n = head.split(',').count();
        let row = |k: usize| {
            let cells = (0..n).map(|column| format!("{}.{k}", 7 * column + k));
            cells.collect::<Vec<_>>().join(",")
        };
        let rows: Vec<String> = (1..5).map(row).collect();
        let found = of_text(&format!("{head}\n{}\n", rows.join("\n")));
        let found = found.unwrap().unwrap();
        let first = found.first(role).map(|column| column.name.clone());
        let others = found.first(role).map(|column| found.as_plain(column));
        let others = others
            .into_iter()
            .flatten()
            .map(|column| column.name.clone());
        (first, others.collect())
    }

    #[test]
    fn the_plain_name_is_taken_before_one_that_says_more() {
        for (role, plain, others) in [
            (
                Role::Deviation,
                "deviation um",
                "deviation limit um;straightness deviation um;mean deviation um;error compensated (um);error tolerance;max error um;filtered deviation;std error;corrected deviation um",
            ),
            (
                Role::Displacement,
                "z um",
                "z limit um;mean z um;z um (filtered);smoothed z um;sensor z um;z max um",
            ),
            (
                Role::Radial,
                "radial um",
                "filtered radial um;radial mean um;radial limit um;raw radial um",
            ),
            (
                Role::Measured,
                "measured mm",
                "mean measured mm;measured limit mm;measured filtered mm",
            ),
            (
                Role::Target,
                "target mm",
                "target limit mm;old target mm;target tolerance mm",
            ),
        ] {
            for other in others.split(';') {
                for head in [format!("n,{other},{plain}"), format!("n,{plain},{other}")] {
                    let wanted = (Some(plain.to_owned()), vec![]);
                    assert_eq!(taken(&head, role), wanted, "{head}");
                }
            }
        }
    }

    #[test]
    fn a_limit_a_mean_and_a_straightness_are_none_of_the_quantity() {
        for name in [
            "straightness deviation um",
            "deviation limit um",
            "mean error um",
            "Mittelwert Abweichung",
            "Geradheitsabweichung um",
            "error tolerance [um]",
            "filtered deviation um",
            "deviation uncertainty um",
            "squareness error",
            "range of deviation um",
        ] {
            assert_eq!(
                taken(&format!("n,{name},k"), Role::Deviation).0,
                None,
                "{name}"
            );
        }
        for name in [
            "z limit um",
            "mean z um",
            "filtered um",
            "z um (filtered)",
            "z (mean) um",
        ] {
            assert_eq!(
                taken(&format!("n,{name},k"), Role::Displacement).0,
                None,
                "{name}"
            );
        }
    }

    #[test]
    fn of_two_that_fit_as_well_the_other_is_named() {
        for (role, head, other) in [
            (Role::Displacement, "time_s,x1_um,x2_um", "x2_um"),
            (
                Role::Deviation,
                "target_mm,deviation um,error um",
                "error um",
            ),
            (
                Role::Deviation,
                "target_mm,raw error um,final error um",
                "final error um",
            ),
            (Role::Radial, "angle_deg,radial um,ballbar um", "ballbar um"),
        ] {
            assert_eq!(taken(head, role).1, [other], "{head}");
        }
        assert!(
            taken("run,target_mm,deviation_um", Role::Deviation)
                .1
                .is_empty()
        );
    }
}
