//! Titles and other lines above the names of columns that say what a table is of: another quantity, a sign, a plane, a radius.

use anyhow::{Result, bail};
use metrology::yaml::shown;

use super::beside::plane_of;
use super::map::Plane;
use super::recognise::Recognised;
use super::times;
use super::units::{Kind, Unit};
use super::vocabulary::{is_reversed, words};

/// Begins of words of quantities that no positioning deviation is.
const OTHER_QUANTITIES: &[&str] = &[
    "straightness",
    "geradheit",
    "rectitude",
    "nickwinkel",
    "gierwinkel",
    "rollwinkel",
    "squareness",
    "rechtwinklig",
    "flatness",
    "ebenheit",
    "parallelism",
    "parallelität",
    "diagonal",
    "backlash",
    "umkehrspanne",
    "standardabweichung",
    "mittelwert",
];
/// Other such words, whole.
const OTHER_WHOLE: &[&str] = &[
    "pitch", "yaw", "roll", "nicken", "gieren", "rollen", "velocity",
];
/// Two words of such a quantity.
const OTHER_PAIRS: [[&str; 2]; 4] = [
    ["standard", "deviation"],
    ["standard", "deviations"],
    ["mean", "values"],
    ["mean", "deviations"],
];
/// Begins of words beside which such a quantity is a setting, a condition or a part of a machine.
const OF_SETTINGS: &[&str] = &[
    "comp", "kompens", "correct", "korrek", "temp", "screw", "spindel", "ball", "thread", "table",
    "optic", "no", "without", "off", "ohne",
];
/// Keys behind which a person, a file or a remark stands.
const OF_PERSONS: &[&str] = &[
    "operator",
    "user",
    "name",
    "bediener",
    "prüfer",
    "customer",
    "kunde",
    "company",
    "firma",
    "file",
    "datei",
    "machine",
    "maschine",
    "comment",
    "kommentar",
    "remark",
    "bemerkung",
    "note",
    "location",
];
const OF_SIGNS: &[&str] = &["sign", "vorzeichen", "signe", "segno", "polarity"];
const TURNED: &[&str] = &[
    "revers",
    "invert",
    "negat",
    "umgekehrt",
    "opposite",
    "minus",
];
const OF_INVALID: &[&str] = &[
    "invalid",
    "ungültig",
    "ungueltig",
    "void",
    "rejected",
    "aborted",
];
/// Most words of a line that is a title.
const MOST_TITLE_WORDS: usize = 8;
/// Most words of a line that marks a whole table as bad.
const MOST_MARK_WORDS: usize = 3;
/// Words beside the plane, and beside the radius, of circles.
const OF_PLANES: &[&str] = &["plane", "ebene", "plan", "piano"];
const OF_RADII: &[&str] = &[
    "radius",
    "nennradius",
    "rayon",
    "raggio",
    "radio",
    "ballbar",
    "kugelstab",
    "r",
];
const OF_FEEDS: &[&str] = &["feed", "feedrate", "vorschub", "avance", "avanzamento"];
/// Words before the date of a measurement.
const OF_DATES: &[&str] = &[
    "date",
    "datum",
    "start",
    "started",
    "begin",
    "begun",
    "beginn",
    "messbeginn",
    "messdatum",
    "startzeit",
    "fecha",
    "data",
];
/// Dates begin with it, s since 1970: 1990.
pub const LEAST_DATE_S: f64 = 631_152_000.0;
/// Feeds, mm/min: others are no feeds.
const FEEDS_MM_MIN: [f64; 2] = [1.0, 200_000.0];
/// Radii of circles, mm: others are no radii.
const RADII_MM: [f64; 2] = [10.0, 5_000.0];

/// Lines above the names, comments too.
fn numbered(found: &Recognised) -> impl Iterator<Item = &(u64, String)> {
    found.above.iter().chain(&found.comments)
}

/// The same without their numbers.
fn lines(found: &Recognised) -> impl Iterator<Item = &String> {
    numbered(found).map(|(_, line)| line)
}

/// A line as its key and what stands behind it; without a colon all is key.
fn key_of(line: &str) -> (&str, &str) {
    line.split_once([':', '=']).unwrap_or((line, ""))
}

/// Refuses a table of deviations above which a line says that they are something else.
///
/// # Errors
/// With the line and the word.
pub fn check(found: &Recognised) -> Result<()> {
    for (n, line) in numbered(found) {
        let Some(word) = other(line) else {
            continue;
        };
        bail!(
            "line {n}: \"{}\" stands above the names: \"{word}\" says something else than positioning deviations (measured position less target): \
             remove the line where it is wrong, or write a map",
            shown(line)
        );
    }
    Ok(())
}

/// The word by which a line says that numbers are no deviations.
fn other(line: &str) -> Option<String> {
    let all = words(line);
    let (key, value) = key_of(line);
    let begins = |word: &str, begins: &[&str]| begins.iter().any(|begin| word.starts_with(begin));
    let is_person = words(key)
        .first()
        .is_some_and(|word| OF_PERSONS.contains(&word.as_str()));
    let is_number = value
        .trim_start()
        .starts_with(|letter: char| letter.is_ascii_digit() || letter == '-');
    if is_reversed(line) {
        return Some("-".to_owned());
    }
    if all.is_empty() || all.len() > MOST_TITLE_WORDS || is_person {
        return None;
    }
    if let Some(factor) = factor(&all) {
        return Some(factor);
    }
    if is_number {
        return None;
    }
    let is_sign = words(key)
        .iter()
        .any(|word| OF_SIGNS.contains(&word.as_str()));
    if let Some(turned) = words(value).iter().find(|word| begins(word, TURNED))
        && is_sign
    {
        return Some(turned.clone());
    }
    if all == ["not", "valid"] {
        return Some("not valid".to_owned());
    }
    let is_invalid = |word: &&String| OF_INVALID.contains(&word.as_str());
    if let Some(word) = all.iter().find(is_invalid)
        && all.len() <= MOST_MARK_WORDS
    {
        return Some(word.clone());
    }
    if all.iter().any(|word| begins(word, OF_SETTINGS)) {
        return None;
    }
    let of_pair = all.windows(2).find_map(|two| {
        let is_one = |pair: &&[&str; 2]| pair.iter().zip(two).all(|(a, b)| a == b);
        OTHER_PAIRS.iter().find(is_one).map(|pair| pair.join(" "))
    });
    let quantity =
        |word: &&String| begins(word, OTHER_QUANTITIES) || OTHER_WHOLE.contains(&word.as_str());
    of_pair.or_else(|| all.iter().find(quantity).cloned())
}

/// A factor behind a word for a deviation.
fn factor(all: &[String]) -> Option<String> {
    const OF_ERRORS: [&str; 4] = ["dev", "err", "abweich", "fehler"];
    let is_error = |word: &String| OF_ERRORS.iter().any(|begin| word.starts_with(begin));
    let is_ten = |word: &str| matches!(word, "10" | "100" | "1000");
    let is_factor = |word: &String| {
        matches!(
            word.as_str(),
            "factor" | "faktor" | "multiplier" | "facteur"
        )
    };
    if all.iter().any(is_factor) {
        return all.iter().find(|word| is_ten(word)).cloned();
    }
    let at = all.iter().position(is_error)?;
    let rest = all.get(at + 1..)?;
    let joined = |word: &str| word.strip_prefix('x').is_some_and(is_ten);
    match rest {
        [times, number, ..] if times == "x" && is_ten(number) => Some(format!("x {number}")),
        [word, ..] if joined(word) || is_ten(word) => Some(word.clone()),
        _ => None,
    }
}

/// The plane of circles that a line above the names, or the file's name, states.
///
/// # Errors
/// With the line, where it names XZ.
pub fn plane(found: &Recognised, stem: &str) -> Result<Option<Plane>> {
    let is_key = |line: &&String| {
        words(line)
            .iter()
            .any(|word| OF_PLANES.contains(&word.as_str()))
    };
    let of_keys = lines(found).filter(is_key);
    let others = lines(found).filter(|line| !is_key(line));
    let stem = stem.to_owned();
    for line in of_keys.chain(others).chain([&stem]) {
        let capitals = line.split(|letter: char| !letter.is_alphanumeric());
        for word in capitals {
            if let Some(plane) = plane_of(word).filter(|_| word == word.to_uppercase()) {
                return Ok(Some(plane));
            }
            if word == "XZ" {
                bail!(
                    "\"{}\": must be XY, YZ or ZX; XZ is ZX seen from the other side: write ZX and turn the sense round",
                    shown(line)
                );
            }
        }
    }
    Ok(None)
}

/// The nominal radius of circles that a line above the names, or the file's name, states, mm.
pub fn radius_mm(found: &Recognised, stem: &str) -> Option<f64> {
    let is_key = |line: &&String| {
        words(line)
            .iter()
            .any(|word| OF_RADII.contains(&word.as_str()))
    };
    let of_lines = || lines(found).filter(is_key).find_map(|line| length_mm(line));
    let of_stem = || {
        let mut words = stem.split(|letter: char| !letter.is_alphanumeric() && letter != '.');
        words.find_map(|word| {
            let lower = word.to_lowercase();
            let number = lower
                .strip_prefix('r')
                .or_else(|| lower.strip_suffix("mm"))?;
            in_range(number.parse().ok()?)
        })
    };
    of_lines().or_else(of_stem)
}

/// The feed that a line above the names states, mm/min; of several with different ones none.
pub fn feed_mm_min(found: &Recognised) -> Option<f64> {
    let is_key = |line: &&String| {
        words(line)
            .iter()
            .any(|word| OF_FEEDS.contains(&word.as_str()))
    };
    let mut all = lines(found).filter(is_key).filter_map(|line| feed_of(line));
    let first = all.next()?;
    all.all(|other| other.total_cmp(&first).is_eq())
        .then_some(first)
}

/// The only number of a line, by its unit of speed; mm/min where it has none.
fn feed_of(line: &str) -> Option<f64> {
    let plain: String = line.to_lowercase().split_whitespace().collect();
    let is_part = |letter: char| letter.is_ascii_digit() || letter == '.';
    let mut numbers = plain
        .split(|letter: char| !is_part(letter))
        .filter_map(|part| part.parse::<f64>().ok());
    let (number, None) = (numbers.next()?, numbers.next()) else {
        return None;
    };
    // The longer word of two that end alike comes first.
    let units = [
        ("mm/min", 1.0),
        ("inch/min", 25.4),
        ("in/min", 25.4),
        ("ipm", 25.4),
        ("m/min", 1000.0),
        ("mm/s", 60.0),
        ("/rev", f64::NAN),
    ];
    let unit = units.iter().find(|(word, _)| plain.contains(word));
    let feed = number * unit.map_or(1.0, |(_, factor)| *factor);
    let [least, most] = FEEDS_MM_MIN;
    (least..=most).contains(&feed).then_some(feed)
}

fn in_range(radius_mm: f64) -> Option<f64> {
    let [least, most] = RADII_MM;
    (least..=most).contains(&radius_mm).then_some(radius_mm)
}

/// When the measurement began, by a line above the names that states a date, s since 1970.
pub fn start_s(found: &Recognised) -> Option<f64> {
    lines(found).find_map(|line| {
        let line = line.trim();
        let end = line.find(|letter: char| !letter.is_alphabetic())?;
        let (key, rest) = line.split_at_checked(end)?;
        let is_date = OF_DATES.contains(&key.to_lowercase().as_str());
        let rest = rest.trim_start_matches([':', '=', ',', ';', ' ', '\t']);
        let read = times::of_text(rest.trim()).ok().flatten();
        // A time of the day alone is no date.
        read.filter(|read| is_date && *read > LEAST_DATE_S)
    })
}

/// The first number of a line with its unit, mm where it has none.
fn length_mm(line: &str) -> Option<f64> {
    let is_part = |letter: char| letter.is_alphanumeric() || letter == '.';
    let parts: Vec<&str> = line
        .split(|letter: char| !is_part(letter))
        .filter(|part| !part.is_empty())
        .collect();
    let at = parts.iter().position(|part| number(part).is_some())?;
    let read = number(parts.get(at)?)?;
    let units = parts.get(at + 1).into_iter().chain(parts.iter());
    let unit = units.copied().find_map(Unit::of_word);
    let unit = unit.filter(|unit| unit.kind() == Kind::Length);
    in_range(unit.unwrap_or(Unit::Mm).convert(read, Unit::Mm))
}

/// `150`, `150mm`.
fn number(part: &str) -> Option<f64> {
    let bare = part.strip_suffix("mm").unwrap_or(part);
    let is_digit = |letter: char| letter.is_ascii_digit();
    bare.parse().ok().filter(|_| bare.starts_with(is_digit))
}

#[cfg(test)]
mod tests {
    use super::super::recognise::of_text;
    use super::*;

    const ROWS: &str =
        "run,direction,target_mm,deviation_um\n1,up,0,8.6\n1,up,37.3,10.25\n1,up,81.9,12.47\n";
    const CIRCLE: &str = "run,angle_deg,radial_um\n1,0,6.0\n1,1,6.1\n1,2,6.2\n";

    fn found(line: &str, rows: &str) -> Recognised {
        of_text(&format!("{line}\n{rows}"))
            .expect("rows")
            .expect("names")
    }

    #[test]
    fn titles_of_other_quantities_signs_and_factors_are_refused() {
        for line in [
            "Straightness of X in Y",
            "Test: straightness",
            "Geradheit",
            "Pitch error",
            "Nickwinkel",
            "Yaw",
            "Roll",
            "Squareness XY",
            "Flatness",
            "Diagonal test",
            "Backlash",
            "Standard deviation",
            "Mean values of 5 runs",
            "Deviation = target - measured",
            "Sign: reversed",
            "Vorzeichen: umgekehrt",
            "Error x 10",
            "Multiplier: 1000",
            "Scale factor 10",
            "INVALID",
            "Not valid",
            "Velocity",
            "# Straightness of X",
        ] {
            let said = check(&found(line, ROWS)).expect_err(line).to_string();
            assert!(
                said.starts_with("line 1: \"") && said.contains("above the names"),
                "{said}"
            );
        }
        for line in [
            "Positioning of X",
            "Pitch error compensation: off",
            "Backlash compensation on",
            "Pitch: 10 mm",
            "Average of 3 readings at each stop",
            "Parallel kinematic machine",
            "Ball screw pitch 10",
            "Operator: Roll",
            "Mean temperature: 20.1",
            "Deviation = measured - target",
            "Sign: measured - target",
            "Comment: yaw optics are in the other case",
            "Invalid readings: 0",
            "Expansion factor: 11.7",
            "Machine: VF2; 5 runs",
        ] {
            check(&found(line, ROWS)).unwrap_or_else(|error| panic!("{line}: {error}"));
        }
    }

    #[test]
    fn a_plane_and_a_radius_above_the_names_are_heard() {
        for (line, wanted) in [
            ("Plane: YZ", Some(Plane::Yz)),
            ("Ebene: YZ", Some(Plane::Yz)),
            ("Plane,YZ", Some(Plane::Yz)),
            ("G19", Some(Plane::Yz)),
            ("Test plane ZX", Some(Plane::Zx)),
            ("Circle", None),
        ] {
            let plane = plane(&found(line, CIRCLE), "a").expect(line);
            assert_eq!(plane, wanted, "{line}");
        }
        assert!(plane(&found("Plane: XZ", CIRCLE), "a").is_err());
        let of_stem = plane(&found("", CIRCLE), "ballbar_YZ").expect("a plane");
        assert_eq!(of_stem, Some(Plane::Yz));
        for (line, wanted) in [
            ("Radius: 150 mm", Some(150.0)),
            ("R=150 mm", Some(150.0)),
            ("Nominal radius (mm),150", Some(150.0)),
            ("Ballbar 150 mm", Some(150.0)),
            ("Ballbar length 150.003 mm", Some(150.003)),
            ("Radius 150", Some(150.0)),
            ("Radius: 6 inch", Some(152.4)),
            ("Feed: 500 mm/min", None),
            ("Ballbar QC20, serial H12345678", None),
        ] {
            let radius = radius_mm(&found(line, CIRCLE), "a");
            let is_one = match (radius, wanted) {
                (Some(a), Some(b)) => (a - b).abs() < 1e-9,
                (a, b) => a.is_none() && b.is_none(),
            };
            assert!(is_one, "{line}: {radius:?}");
        }
        assert_eq!(radius_mm(&found("", CIRCLE), "R150_YZ"), Some(150.0));
    }

    #[test]
    fn a_feed_above_the_names_is_taken_by_its_unit() {
        for (line, wanted) in [
            ("Feed: 2000 mm/min", Some(2000.0)),
            ("Feed rate (mm/min): 1500", Some(1500.0)),
            ("Vorschub 800", Some(800.0)),
            ("feed_mm_min: 500", Some(500.0)),
            ("Feedrate = 2 m/min", Some(2000.0)),
            ("Feed: 100 inch/min", Some(2540.0)),
            ("Feed: 10 mm/s", Some(600.0)),
            ("Feed: 0.1 mm/rev", None),
            ("Feed: 500 and 5000 mm/min", None),
            ("Feed 0", None),
            ("Radius: 100 mm", None),
        ] {
            assert_eq!(feed_mm_min(&found(line, CIRCLE)), wanted, "{line}");
        }
        let two = found("Feed: 500\nFeed: 900", CIRCLE);
        assert_eq!(feed_mm_min(&two), None);
    }

    /// Seconds by `date -u -d "2026-01-05 08:00" +%s`.
    #[test]
    fn a_date_above_the_names_is_the_begin() {
        for (line, wanted) in [
            ("Date: 2026-01-05", Some(1_767_571_200.0)),
            ("Messbeginn: 05.01.2026 08:00", Some(1_767_600_000.0)),
            ("Start,2026-01-05 08:00:00", Some(1_767_600_000.0)),
            ("# Date: 2026-01-05", Some(1_767_571_200.0)),
            ("Start: 08:00", None),
            ("Date: unknown", None),
            ("Calibrated: 2025-11-05", None),
        ] {
            assert_eq!(start_s(&found(line, ROWS)), wanted, "{line}");
        }
    }
}
