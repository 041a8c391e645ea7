//! The axis that a column, a line above the names or a file's name states.
//!
//! `Y drift`, `dy` and `in y` are of Y. A name with the letter of another axis (`W`, `Y2`) or of a side (`lateral`) says that the
//! axis is not the usual one, and the table is refused until a line `Axis: ...` states it.

use anyhow::{Result, bail};
use metrology::Axis;
use metrology::yaml::shown;

use super::pass_names;
use super::prose;
use super::recognise::{Known, Recognised, Role};
use super::units::Kind;
use super::vocabulary::words;

/// What a name says of an axis.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Said {
    /// The axis.
    Axis(Axis),
    /// A word for a side or for an axis beyond X to C.
    Other(String),
    /// Nothing.
    Nothing,
}

/// What stands before the letter of an axis in one word, and behind it.
const PREFIXES: &[&str] = &["", "d", "δ", "delta", "e", "et", "p1", "p2", "p3"];
const SUFFIXES: &[&str] = &[
    "",
    "drift",
    "displ",
    "displacement",
    "error",
    "err",
    "dev",
    "growth",
    "shift",
    "verlagerung",
    "weg",
    "achse",
    "axis",
    "richtung",
    "um",
    "µm",
    "mm",
];
/// Letters of axes that are no linear one of X to Z, where they are capital.
const OTHER_LETTERS: &str = "ABCUVW";
/// Words before a letter that names a sensor or a run.
const BEFORE_LETTERS: &[&str] = &[
    "sensor", "probe", "channel", "kanal", "ch", "taster", "gauge", "machine", "test", "run",
];
/// Sides of a displacement across the spindle.
const OTHER_SIDES: &[&str] = &["horizontal", "lateral", "seitlich", "transverse"];
/// Words that name an axis or ask for one.
const AXIS_KEYS: &[&str] = &[
    "axis",
    "achse",
    "axe",
    "messachse",
    "asse",
    "eje",
    "軸",
    "轴",
];
/// Words with which a line above the names says where an axis stood.
const OF_STANDING: &[&str] = &[
    "parked",
    "geparkt",
    "standing",
    "locked",
    "clamped",
    "head",
    "at",
    "nut",
    "temperature",
    "of",
    "steht",
];
/// Most words of a line above the names that says an axis without a colon.
const MOST_LABEL_WORDS: usize = 4;

/// Words of a name, where letters of another script are words of their own (`Y方向`, but `Δx`, `µm`).
fn tokens(name: &str) -> Vec<String> {
    let mut all: Vec<String> = vec![];
    let mut before: Option<bool> = None;
    for letter in name.chars() {
        let is_latin = letter.is_ascii() || "ΔδµμäöüÄÖÜßéèê".contains(letter);
        if !letter.is_alphanumeric() {
            before = None;
            continue;
        }
        match all.last_mut().filter(|_| before == Some(is_latin)) {
            Some(word) => word.push(letter),
            None => all.push(letter.to_string()),
        }
        before = Some(is_latin);
    }
    all
}

/// The axis X, Y or Z of a word, with its number where it has one.
fn linear(word: &str) -> Option<(Axis, String)> {
    let lower = word.to_lowercase();
    let bare = PREFIXES.iter().find_map(|prefix| {
        let rest = lower.strip_prefix(prefix)?;
        SUFFIXES.iter().find_map(|suffix| {
            let own = rest.strip_suffix(suffix)?;
            let digits = own.get(1..)?;
            let is_number = digits.bytes().all(|byte| byte.is_ascii_digit());
            let is_letter = own.starts_with(['x', 'y', 'z']);
            (is_letter && is_number).then(|| own.to_owned())
        })
    })?;
    let (letter, digits) = bare.split_at_checked(1)?;
    Some((letter.to_uppercase().parse().ok()?, digits.to_owned()))
}

/// What a name says; one of a log may number its sensors (`x1`, `x2`).
fn of_name(name: &str, is_log: bool) -> Said {
    let tokens = tokens(name);
    for (k, word) in tokens.iter().enumerate() {
        let before = k.checked_sub(1).and_then(|k| tokens.get(k));
        let before = before.map(|word| word.to_lowercase()).unwrap_or_default();
        match linear(word) {
            Some((_, digits)) if !is_log && digits.parse::<u32>().is_ok_and(|n| n > 1) => {
                return Said::Other(word.clone());
            }
            Some((axis, _)) => return Said::Axis(axis),
            None => {}
        }
        let bare = word.trim_end_matches(|letter: char| letter.is_ascii_digit());
        let is_letter = bare.len() == 1 && OTHER_LETTERS.contains(bare);
        if is_letter && !BEFORE_LETTERS.contains(&before.as_str()) {
            let axis = word.parse::<Axis>().ok();
            return axis.map_or_else(|| Said::Other(word.clone()), Said::Axis);
        }
        if is_log && OTHER_SIDES.contains(&word.to_lowercase().as_str()) {
            return Said::Other(word.clone());
        }
    }
    Said::Nothing
}

/// The axis that a line above the names states.
///
/// # Errors
/// With the line, where it names an axis beyond X to C, or several.
fn of_line((n, line): (u64, &str), is_comment: bool) -> Result<Option<Axis>> {
    let all = words(line);
    let key = line.split([':', '=']).next().unwrap_or_default();
    let is_key = |word: &String| AXIS_KEYS.contains(&word.as_str());
    let keys = words(key);
    let is_keyed = !keys.is_empty() && keys.len() < all.len() && keys.iter().all(is_key);
    let is_pair = all.len() == 2 && all.first().is_some_and(is_key);
    if !is_keyed && !is_pair {
        let is_label = all.len() <= MOST_LABEL_WORDS || is_comment;
        let is_standing = all.iter().any(|word| OF_STANDING.contains(&word.as_str()));
        let stated = prose::axis(line, is_comment);
        return Ok(stated.filter(|_| is_label && !is_standing));
    }
    // `Axis: X; position Y 200` goes on with something else.
    let own = words(line.split(';').next().unwrap_or_default());
    let n_keys = if is_keyed { keys.len() } else { 1 };
    let rest = own.get(n_keys..).unwrap_or_default();
    let is_first = |word: &String| is_axis_word(word) || word.parse::<f64>().is_ok();
    let Some(first) = rest.first().filter(|first| is_first(first)) else {
        // `Axis: linear X` has its letter behind other words.
        let letters = rest
            .iter()
            .filter(|word| matches!(word.as_str(), "x" | "y" | "z"));
        let letters: Vec<&String> = letters.collect();
        return Ok(match letters.as_slice() {
            [one] => pass_names::axis_of(one),
            _ => None,
        });
    };
    // "a" is a word of prose as well.
    let mut others = rest
        .iter()
        .skip(1)
        .filter(|word| is_axis_word(word) && *word != "a");
    let axis = pass_names::axis_of(first).filter(|_| !is_numbered(first));
    let is_one = others.all(|other| pass_names::axis_of(other) == axis);
    if axis.is_none() || !is_one {
        bail!(
            "line {n}: \"{}\": must name one of X, Y, Z, A, B and C: correct the line, or write a map",
            shown(line)
        );
    }
    Ok(axis)
}

/// Whether a word is made of letters of axes, with or without a number: `x`, `y2`, `xy`, `w`.
fn is_axis_word(word: &str) -> bool {
    let bare = word.trim_end_matches(|letter: char| letter.is_ascii_digit());
    let are_letters = bare.chars().all(|letter| "xyzuvw".contains(letter));
    let is_rotary = matches!(bare, "a" | "b" | "c");
    (1..=3).contains(&bare.len()) && (are_letters || is_rotary)
}

/// `Y2`: another axis than the only or the first one of its letter.
fn is_numbered(word: &str) -> bool {
    let digits = word.trim_start_matches(|letter: char| !letter.is_ascii_digit());
    digits.parse::<u32>().is_ok_and(|n| n > 1)
}

/// The axis of a file's name: its one capital letter, or the one beside `axis`.
fn of_stem(stem: &str) -> Option<Axis> {
    let words = stem.split(|letter: char| !letter.is_alphanumeric());
    // Of a name of a file a capital alone: `c.csv` is no axis.
    let mut letters: Vec<Axis> = words.filter_map(prose::letter).collect();
    letters.dedup();
    match letters.as_slice() {
        [one] => Some(*one),
        _ => None,
    }
}

impl Recognised {
    /// The axis that a column or the lines above the table state.
    ///
    /// # Errors
    /// With the line, where it states an axis beyond X to C.
    pub fn axis_stated(&self) -> Result<Option<Axis>> {
        if let Some((_, axis)) = &self.axis_column {
            return Ok(Some(*axis));
        }
        let above = self.above.iter().map(|line| (line, false));
        let comments = self.comments.iter().map(|line| (line, true));
        for ((n, line), is_comment) in above.chain(comments) {
            if let Some(axis) = of_line((*n, line), is_comment)? {
                return Ok(Some(axis));
            }
        }
        Ok(None)
    }

    /// The axis that is named by the lines above the table, a column, or the file.
    ///
    /// # Errors
    /// With line or column, where it names an axis that the test cannot have.
    pub fn axis(&self, stem: &str, is_log: bool) -> Result<Option<Axis>> {
        let stated = self.axis_stated()?;
        if stated.is_some() {
            return Ok(stated);
        }
        let roles: &[Role] = if is_log {
            &[Role::Displacement, Role::Deviation]
        } else {
            &[Role::Target, Role::Deviation]
        };
        let read: Vec<&Known> = match is_log {
            true => { roles.iter() }
                .find_map(|role| self.first(*role))
                .into_iter()
                .collect(),
            false => roles.iter().filter_map(|role| self.first(*role)).collect(),
        };
        let mut found = None;
        for column in read {
            let is_length = column.unit.is_none_or(|unit| unit.kind() == Kind::Length);
            // `error [V]` has volts, and no axis.
            let is_unit = |word: &str| column.unknown.as_deref() == Some(word);
            match of_name(&column.name, is_log) {
                Said::Other(word) if is_unit(&word) => {}
                Said::Axis(axis) if axis.is_linear() => found = found.or(Some(axis)),
                Said::Axis(axis) if !is_length => found = found.or(Some(axis)),
                Said::Axis(axis) if column.unit.is_some() || is_log => {
                    bail!("{}", refusal(&column.name, axis.letter()));
                }
                Said::Other(word) => bail!("{}", refusal(&column.name, &word)),
                Said::Axis(_) | Said::Nothing => {}
            }
        }
        let of_passes = || {
            let mut passes = self.passes().into_iter();
            passes.find_map(|(column, _)| pass_names::of(&column.name)?.axis)
        };
        let of_first_word = || {
            let mut columns = roles.iter().filter_map(|role| self.first(*role));
            columns.find_map(|column| pass_names::axis_of(words(&column.name).first()?))
        };
        let of_columns = found.or_else(of_passes).or_else(of_first_word);
        Ok(of_columns.or_else(|| of_stem(stem)))
    }
}

fn refusal(name: &str, word: &str) -> String {
    format!(
        "column \"{}\": \"{word}\" is no axis that this table can be of: write a line such as \"Axis: Y\" above the names, or write a map",
        shown(name)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_of_a_log_is_in_every_spelling_of_its_name() {
        for (name, axis) in [
            ("dx um", Axis::X),
            ("dX [µm]", Axis::X),
            ("Δx µm", Axis::X),
            ("delta x um", Axis::X),
            ("drift in y um", Axis::Y),
            ("dy(um)", Axis::Y),
            ("ex um", Axis::X),
            ("EX um", Axis::X),
            ("ETX um", Axis::X),
            ("xdrift um", Axis::X),
            ("P1Y um", Axis::Y),
            ("sensor_x1 um", Axis::X),
            ("Y方向変位 μm", Axis::Y),
            ("X変位 μm", Axis::X),
            ("x_um", Axis::X),
            ("Verlagerung X µm", Axis::X),
            ("in X-Richtung µm", Axis::X),
            ("déplacement suivant Y [µm]", Axis::Y),
            ("z um", Axis::Z),
        ] {
            assert_eq!(of_name(name, true), Said::Axis(axis), "{name}");
        }
        for (name, word) in [
            ("W um", "W"),
            ("horizontal um", "horizontal"),
            ("lateral um", "lateral"),
        ] {
            assert_eq!(of_name(name, true), Said::Other(word.to_owned()), "{name}");
        }
        for name in [
            "displacement um",
            "Sensor A um",
            "drift_um",
            "spindle growth um",
            "axial um",
            "Weg [µm]",
        ] {
            assert_eq!(of_name(name, true), Said::Nothing, "{name}");
        }
    }

    #[test]
    fn small_letters_and_numbered_axes_of_positions_are_heard() {
        for (name, said) in [
            ("position y mm", Said::Axis(Axis::Y)),
            ("deviation in y um", Said::Axis(Axis::Y)),
            ("error X1 um", Said::Axis(Axis::X)),
            ("position Y2 (mm)", Said::Other("Y2".to_owned())),
            ("W position mm", Said::Other("W".to_owned())),
            ("target A mm", Said::Axis(Axis::A)),
            ("target_mm", Said::Nothing),
            ("Position [mm]", Said::Nothing),
        ] {
            assert_eq!(of_name(name, false), said, "{name}");
        }
    }

    #[test]
    fn a_line_states_an_axis_or_is_refused_where_it_names_none() {
        for (line, axis) in [
            ("Axis: Y", Some(Axis::Y)),
            ("Axis Y", Some(Axis::Y)),
            ("Achse = Z", Some(Axis::Z)),
            ("Axis: Y1", Some(Axis::Y)),
            ("Positioning X axis", Some(Axis::X)),
            ("Axis: linear", None),
            ("Axis: X; position Y 200", Some(Axis::X)),
            ("Axis: X, 600 mm", Some(Axis::X)),
            ("Axis: X-axis", Some(Axis::X)),
            ("Achse: X-Achse, a new screw", Some(Axis::X)),
            ("Axis: linear X", Some(Axis::X)),
            ("Axis of rotation", None),
            ("Operator: Y. Sato", None),
            ("Y axis parked", None),
            ("Y axis of the laser head", None),
            ("Axis travel: 500", None),
            ("Axis", None),
        ] {
            assert_eq!(of_line((3, line), false).expect(line), axis, "{line}");
        }
        for line in [
            "Axis: Y2",
            "Axis: W",
            "Axis: 2",
            "Axis: XY",
            "Axis: X/Y",
            "Axis: Y and Z",
        ] {
            let said = of_line((3, line), false).expect_err(line).to_string();
            assert!(
                said.starts_with(&format!("line 3: \"{line}\": must name one of X, Y, Z")),
                "{said}"
            );
        }
        for (stem, axis) in [
            ("lead_Y", Some(Axis::Y)),
            ("Straightness_Y_of_X", None),
            ("machine_Y_axis_X", None),
            ("haas_vf2_y", None),
        ] {
            assert_eq!(of_stem(stem), axis, "{stem}");
        }
    }
}
