//! Columns that no key of a map names and that part a table into several tests, or mark rows as bad.
//!
//! What holds for whole runs and differs between them (a machine, a second axis, a line, a feed, a correction that was on)
//! makes them different tests. They are known by their names and by cells that change with the runs, not within them.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use metrology::yaml::shown;

use super::map::{Map, Test, What};
use super::stated;
use super::table::{Row, number_of};
use super::times;
use super::units::Kind;
use super::vocabulary::words;

/// Lines of cells with their numbers.
type Lines = [(u64, Vec<String>)];

/// Begins of names of what a whole test has.
const OF_A_TEST: &[&str] = &[
    "machine",
    "maschine",
    "axis",
    "achse",
    "serial",
    "compensation",
    "kompensation",
    "correction",
    "korrektur",
    "feed",
    "vorschub",
    "radius",
    "nominal",
    "plane",
    "ebene",
    "linie",
    "location",
    "date",
    "datum",
    "instrument",
    "placement",
    "setup",
    "quantity",
    "messgröße",
    "messgroesse",
    "grandeur",
];
/// Other words of such names, whole but for digits at their ends.
const WHOLE: &[&str] = &["line", "place", "height", "type", "typ", "kind"];
/// First words of such names.
const WORDS_OF_A_TEST: &[&str] = &["x", "y", "z", "a", "b", "c", "comp", "day", "tag"];
/// Words of names of what a log is of, and those that may stand beside them; `machine state` may change.
const OF_A_LOG: &[&str] = &["machine", "maschine", "serial", "instrument"];
const BESIDE_OF_A_LOG: &[&str] = &[
    "number", "no", "nr", "id", "name", "laser", "sensor", "gauge",
];
/// Parts of names of temperatures, humidities and pressures, and units of them. One reading for each run parts no tests.
const AMBIENT: &[&str] = &["temp", "therm", "humid", "feucht", "pressure", "druck"];
const AMBIENT_UNITS: &[&str] = &["hpa", "kpa", "mbar", "rh", "rf"];
/// Parts of names of settings, whatever stands beside them (`temperature compensation`, `feed %`).
const SETTINGS: &[&str] = &["compens", "kompens", "correct", "korrekt"];
const FEED_WORDS: &[&str] = &["feed", "vorschub"];
/// First words of columns that mark rows.
const MARKS: &[&str] = &[
    "valid",
    "validity",
    "invalid",
    "status",
    "ok",
    "flag",
    "flags",
    "quality",
    "bad",
    "gültig",
    "gueltig",
    "ungültig",
    "fehlercode",
    "errorcode",
    "warning",
    "beam",
    "signalstatus",
    "reject",
    "rejected",
    "outlier",
    "outliers",
    "ausreißer",
    "ausreisser",
    "exclude",
    "excluded",
    "exclusion",
    "include",
    "included",
    "use",
    "used",
    "verwendet",
    "verwenden",
    "weight",
    "weights",
    "gewicht",
    "skip",
    "skipped",
    "ignore",
    "ignored",
    "omit",
    "omitted",
    "discard",
    "discarded",
    "accept",
    "accepted",
    "keep",
    "kept",
    "good",
    "masked",
    "valide",
    "valable",
];
/// Words before them that say nothing.
const BEFORE_MARKS: &[&str] = &["is", "row", "point", "data", "reading", "to", "be", "not"];
/// First words of columns of notes, in which a sign alone marks a row.
const NAMES_OF_NOTES: &[&str] = &[
    "note",
    "notes",
    "remark",
    "remarks",
    "comment",
    "comments",
    "bemerkung",
    "kommentar",
    "mark",
];
/// Notes that mark their row, lower case.
const MARKING: &[&str] = &[
    "x",
    "bad",
    "exclude",
    "excluded",
    "outlier",
    "reject",
    "rejected",
    "invalid",
    "ignore",
    "ignored",
    "discard",
    "discarded",
    "ausreißer",
    "ungültig",
];
/// Words of a note with which it marks nothing (`no outlier`).
const DENYING: &[&str] = &[
    "no", "not", "nothing", "none", "kein", "keine", "nicht", "nichts",
];
/// Those whose numbers are codes.
const CODES: &[&str] = &[
    "status",
    "flag",
    "flags",
    "fehlercode",
    "errorcode",
    "warning",
    "signalstatus",
];
/// Most values of a column that marks rows.
const MOST_MARK_VALUES: usize = 3;
/// Rows for one change at least, where no column numbers the runs.
const ROWS_A_CHANGE: usize = 4;
/// A test that runs over midnight has two dates, s.
const DAY_S: f64 = 86_400.0;

/// Refuses columns whose cells differ between runs where a test has one of them, and columns that mark some rows.
///
/// # Errors
/// With line, column and both values.
pub fn check(map: &Map, head: &[String], lines: &Lines, rows: &[Row]) -> Result<()> {
    let own = map.test.columns();
    let run = own.iter().position(|column| column.what == What::Run);
    let runs: BTreeMap<u64, f64> = rows
        .iter()
        .map(|row| (row.line, run.map_or(0.0, |k| row.cells[k])))
        .collect();
    // What changes during a log is part of it.
    let is_log = matches!(map.test, Test::Log { .. });
    for (k, name) in head.iter().enumerate() {
        if name.is_empty() || own.iter().any(|column| column.name == name) {
            continue;
        }
        let cells: Vec<Cell<'_>> = lines
            .iter()
            .filter_map(|(line, cells)| {
                let run = *runs.get(line)?;
                let text = cells.get(k).map_or("", String::as_str);
                Some(Cell {
                    line: *line,
                    run,
                    text,
                })
            })
            .collect();
        if is_mark(name) {
            marked(name, &cells, map.decimal)?;
        } else if is_first(name, NAMES_OF_NOTES) {
            noted(name, &cells)?;
        } else if (is_log && is_of_an_instrument(name)) || (!is_log && is_of_a_test(name)) {
            parted(name, &cells, (run.is_some(), map.decimal))?;
        }
    }
    Ok(())
}

/// A cell with its line and the number of its run.
struct Cell<'t> {
    line: u64,
    run: f64,
    text: &'t str,
}

/// Whether the first word of a name is one of these.
fn is_first(name: &str, whole: &[&str]) -> bool {
    let words = words(name);
    let first = words.first();
    first.is_some_and(|first| whole.contains(&first.as_str()))
}

/// Whether a name is that of a column that marks rows.
fn is_mark(name: &str) -> bool {
    let words = words(name);
    let mut own = words.iter().map(String::as_str);
    let first = own.find(|word| !BEFORE_MARKS.contains(word));
    first.is_some_and(|first| MARKS.contains(&first))
}

/// Refuses a column of notes in which a sign or a word alone marks a row.
fn noted(name: &str, cells: &[Cell<'_>]) -> Result<()> {
    let is_marking = |text: &str| {
        let is_sign = |letter: char| !letter.is_alphanumeric() && !matches!(letter, '-' | '.');
        let lower = text.to_lowercase();
        let words: Vec<&str> = lower
            .split(|letter: char| !letter.is_alphanumeric())
            .collect();
        let is_denied = words.iter().any(|word| DENYING.contains(word));
        let is_word = |word: &&str| word.len() > 1 && MARKING.contains(word);
        MARKING.contains(&lower.as_str())
            || (!is_denied && words.iter().any(is_word))
            || (!text.is_empty() && text.chars().all(is_sign))
    };
    // A letter beside other letters is the name of an axis.
    let is_letter = |text: &str| text.len() == 1 && text.chars().all(char::is_alphabetic);
    let has_other_letters =
        { cells.iter() }.any(|cell| is_letter(cell.text) && !is_marking(cell.text));
    let counts = |text: &str| is_marking(text) && !(has_other_letters && is_letter(text));
    let odd = cells.iter().find(|cell| counts(cell.text));
    match odd.filter(|_| !cells.iter().all(|cell| is_marking(cell.text))) {
        Some(odd) => bail!("{}", refusal(odd, name, "other text in other rows")),
        None => Ok(()),
    }
}

/// Why rows that a table marks itself are refused.
fn refusal(odd: &Cell<'_>, name: &str, others: &str) -> String {
    format!(
        "line {}, column \"{}\": \"{}\", and {others}: the table marks rows itself: remove those that do not count, and \
         the column with them",
        odd.line,
        shown(name),
        shown(odd.text)
    )
}

/// Whether a name is that of what a whole test has.
fn is_of_a_test(name: &str) -> bool {
    let is_one = |word: &String| {
        let bare = word.trim_end_matches(|letter: char| letter.is_ascii_digit());
        WHOLE.contains(&bare) || OF_A_TEST.iter().any(|begin| word.starts_with(begin))
    };
    let is_named = is_first(name, WORDS_OF_A_TEST) || words(name).iter().any(is_one);
    is_named && !is_ambient(name)
}

/// Whether a name or its unit is that of a temperature, a humidity or a pressure.
fn is_ambient(name: &str) -> bool {
    let lower = name.to_lowercase();
    let has = |parts: &[&str]| parts.iter().any(|part| lower.contains(*part));
    let has_unit = || {
        let is_unit = |word: &String| AMBIENT_UNITS.contains(&word.as_str());
        words(name).iter().any(is_unit) || (lower.contains('%') && !has(FEED_WORDS))
    };
    let is_degree = || {
        let unit = stated::of(name).unit();
        unit.is_some_and(|unit| unit.kind() == Kind::Temperature)
    };
    !has(SETTINGS) && (has(AMBIENT) || has_unit() || is_degree())
}

/// Whether values mark rows: they are few, and where all are numbers, 0 and 1 alone, except for codes.
fn are_marks(name: &str, values: &BTreeMap<&str, usize>, decimal: char) -> bool {
    let filled = values.keys().filter(|text| !text.is_empty());
    let numbers: Vec<Option<f64>> = filled
        .map(|text| number_of(text.trim_end_matches([' ', '%']), decimal))
        .collect();
    let is_switch = |number: &Option<f64>| {
        let is = |wanted: f64| number.is_some_and(|number| number.total_cmp(&wanted).is_eq());
        is(0.0) || is(1.0)
    };
    let are_numbers = numbers.iter().all(Option::is_some);
    let is_of_marks = !are_numbers || is_first(name, CODES) || numbers.iter().all(is_switch);
    values.len() <= MOST_MARK_VALUES && is_of_marks
}

fn marked(name: &str, cells: &[Cell<'_>], decimal: char) -> Result<()> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for cell in cells {
        *counts.entry(cell.text).or_default() += 1;
    }
    if !are_marks(name, &counts, decimal) {
        return Ok(());
    }
    let usual = counts
        .iter()
        .max_by_key(|(_, n)| **n)
        .map(|(text, _)| *text);
    let Some(odd) = cells.iter().find(|cell| Some(cell.text) != usual) else {
        return Ok(());
    };
    let others = format!("\"{}\" in most rows", shown(usual.unwrap_or_default()));
    bail!("{}", refusal(odd, name, &others))
}

fn parted(name: &str, cells: &[Cell<'_>], (has_runs, decimal): (bool, char)) -> Result<()> {
    let filled = cells.iter().filter(|cell| !cell.text.is_empty());
    let filled: Vec<&Cell<'_>> = filled.collect();
    let is_same = |a: &Cell<'_>, b: &Cell<'_>| {
        let [first, second] = [a, b].map(|cell| number_of(cell.text, decimal));
        let is_one_day = || {
            let day = |cell: &Cell<'_>| times::of_text(cell.text).ok().flatten();
            day(a)
                .zip(day(b))
                .is_some_and(|(a, b)| (a - b).abs() <= DAY_S)
        };
        let is_equal = first
            .zip(second)
            .is_some_and(|(a, b)| a.total_cmp(&b).is_eq());
        a.text == b.text || is_equal || is_one_day()
    };
    let mut changes = filled.windows(2).filter(|two| !is_same(two[0], two[1]));
    let n_changes = changes.clone().count();
    let is_within = |two: &[&Cell<'_>]| two[0].run.total_cmp(&two[1].run).is_eq();
    let is_of_runs = if has_runs {
        !changes.clone().any(is_within)
    } else {
        n_changes * ROWS_A_CHANGE <= filled.len()
    };
    let Some(two) = changes.next().filter(|_| is_of_runs) else {
        return Ok(());
    };
    bail!(
        "line {}, column \"{}\": \"{}\", and \"{}\" in line {}: the rows are of different tests: write each into a table of its own, or \
         rename the column where it holds something else",
        two[1].line,
        shown(name),
        shown(two[1].text),
        shown(two[0].text),
        two[0].line
    );
}

/// Whether a column names the machine or the instrument of a log.
fn is_of_an_instrument(name: &str) -> bool {
    let words = words(name);
    let is_own = |word: &String| OF_A_LOG.contains(&word.as_str());
    let is_beside = |word: &String| BESIDE_OF_A_LOG.contains(&word.as_str());
    words.iter().any(is_own) && words.iter().all(|word| is_own(word) || is_beside(word))
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Sheet;
    use super::super::table::Table;
    use super::*;

    #[test]
    fn columns_that_mark_no_row_are_taken() {
        let taken = |name: &str, values: [&str; 3]| {
            let cell = |run: u32, target: u32| values[((run + target) % 3) as usize].to_owned();
            assert_eq!(refusal("run: n, ", name, cell), "", "{name}");
        };
        taken("excluded", ["", "", ""]);
        taken("use", ["yes", "yes", "yes"]);
        taken("weight", ["12.5", "11", "12"]);
        taken("note", ["slow", "", "with the door open"]);
        taken("remark", ["-", "", "-"]);
        taken("comment", ["*", "*", "*"]);
        taken("user", ["anna", "ben", ""]);
        taken("usage", ["1", "0", "1"]);
    }

    /// The refusal of three runs over six targets with another column; `cell` by run and target.
    fn refusal(keys: &str, name: &str, cell: impl Fn(u32, u32) -> String) -> String {
        let test = format!(
            "{{axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, {keys}target_mm: t, deviation_um: d}}"
        );
        let map = format!("start_s: 0\ntest:\n  positioning: {test}\n");
        let map: Map = serde_saphyr::from_str(&map).expect("a map");
        let mut text = format!("n,t,d,{name}\n");
        for (run, target) in (1..=3).flat_map(|run| (0..6).map(move |target| (run, target))) {
            let cell = cell(run, target);
            text.push_str(&format!("{run},{},0.5,{cell}\n", 50 * target));
        }
        let sheet = Sheet::of_text(&text, ',').expect("rows");
        let ranges = vec![None; map.test.columns().len()];
        match Table::of(&sheet, &map, &ranges) {
            Ok(_) => String::new(),
            Err(error) => format!("{error:#}"),
        }
    }

    #[test]
    fn a_log_of_two_machines_is_refused_and_states_of_a_machine_may_change() {
        let refusal = |name: &str| {
            let map = "start_s: 0\ntest:\n  log: {axis: Z, time_s: t, displacement_um: d}\n";
            let map: Map = serde_saphyr::from_str(map).expect("a map");
            let row = |k: u32| format!("{},0.5,{}\n", 60 * k, if k < 10 { "A" } else { "B" });
            let rows: String = (0..20).map(row).collect();
            let sheet = Sheet::of_text(&format!("t,d,{name}\n{rows}"), ',').expect("rows");
            let ranges = vec![None; map.test.columns().len()];
            let read = Table::of(&sheet, &map, &ranges);
            read.map_or_else(|error| format!("{error:#}"), |_| String::new())
        };
        for name in ["machine", "Maschine Nr.", "Instrument", "laser serial"] {
            let said = refusal(name);
            let words = format!(
                "line 12, column \"{name}\": \"B\", and \"A\" in line 11: the rows are of different tests"
            );
            assert!(said.starts_with(&words), "{said}");
        }
        for name in ["machine state", "operator", "machine mode"] {
            assert_eq!(refusal(name), "", "{name}");
        }
    }

    #[test]
    fn columns_that_change_with_the_runs_are_refused_with_both_values() {
        for (name, values) in [
            ("machine", ["mill_1", "mill_1", "mill_2"]),
            ("axis", ["1", "1", "2"]),
            ("Achse", ["X1", "Y1", "Y1"]),
            ("y_mm", ["0", "400", "400"]),
            ("compensation", ["off", "off", "on"]),
            ("feed_mm_min", ["500", "5000", "5000"]),
            ("nominal radius mm", ["100", "150", "150"]),
            ("date", ["2026-01-05", "2026-01-05", "2026-03-05"]),
            ("Datum", ["05.01.2026", "09.01.2026", "09.01.2026"]),
            ("serial no", ["A1", "A2", "A2"]),
            ("line", ["1", "1", "2"]),
            ("line2 height", ["0", "0", "100"]),
            ("temperature compensation", ["off", "on", "on"]),
            ("feed %", ["50", "100", "100"]),
        ] {
            for keys in ["run: n, ", ""] {
                let value = |run: u32, _| values[run as usize - 1].to_owned();
                let refused = refusal(keys, name, value);
                assert!(
                    refused.contains("of different tests"),
                    "{name} {keys}: {refused}"
                );
                assert!(refused.contains(&format!("column \"{name}\"")), "{refused}");
            }
        }
        for (name, bad) in [
            ("valid", "0"),
            ("status", "ERR beam"),
            ("OK", "n"),
            ("flag", "x"),
            ("fehlercode", "17"),
            ("beam", "0"),
            ("beam strength", "lost"),
            ("excluded", "x"),
            ("Excluded?", "yes"),
            ("is outlier", "true"),
            ("use", "no"),
            ("used", "0"),
            ("include", "0"),
            ("weight", "0"),
            ("Gewicht", "0"),
            ("skip row", "x"),
            ("not used", "x"),
            ("point accepted", "n"),
            ("note", "*"),
            ("Bemerkung", "x"),
            ("remark", "outlier"),
            ("comment", "!!"),
        ] {
            let value = |run, target| if (run, target) == (2, 3) { bad } else { "1" }.to_owned();
            let refused = refusal("run: n, ", name, value);
            assert!(
                refused.contains(&format!("line 11, column \"{name}\": \"{bad}\"")),
                "{refused}"
            );
        }
    }

    #[test]
    fn columns_that_hold_one_value_or_change_within_runs_are_no_tests() {
        let taken = |name: &str, cell: &dyn Fn(u32, u32) -> String| {
            assert_eq!(refusal("run: n, ", name, cell), "", "{name}");
        };
        taken("machine", &|_, _| "mill_1".to_owned());
        taken("feed_mm_min", &|run, _| {
            if run == 1 { "500" } else { "500.0" }.to_owned()
        });
        taken("x_mm", &|_, target| (50 * target).to_string());
        taken("remark", &|run, _| format!("run {run}"));
        taken("operator", &|run, _| format!("person {run}"));
        taken("air temperature", &|run, _| format!("2{run}.5"));
        taken("date", &|run, _| {
            if run < 3 { "2026-01-05" } else { "2026-01-06" }.to_owned()
        });
        taken("compensation", &|run, _| {
            if run < 3 { "" } else { "on" }.to_owned()
        });
        taken("valid", &|_, _| "1".to_owned());
        taken("status", &|_, _| String::new());
    }

    #[test]
    fn ambient_readings_of_each_run_part_no_tests() {
        for name in [
            "machine temperature",
            "Maschinentemperatur [°C]",
            "axis temperature X",
            "Achse [K]",
            "machine RH %",
            "Luftdruck Maschine hPa",
            "place mbar",
            "x °C",
            "Linearity",
            "placeholder",
        ] {
            for keys in ["run: n, ", ""] {
                let refused = refusal(keys, name, |run, _| format!("2{run}.5"));
                assert_eq!(refused, "", "{name} {keys}");
            }
        }
    }

    #[test]
    fn numbers_of_each_reading_and_many_words_are_no_marks() {
        let number = |numbers: [&'static str; 3]| {
            move |run: u32, target: u32| numbers[((run + target) % 3) as usize].to_owned()
        };
        for (name, numbers) in [
            ("Beam strength", ["96", "95", "96"]),
            ("quality", ["96", "95", "94"]),
            ("quality %", ["96 %", "95 %", "95 %"]),
            ("beam", ["0.98", "1", ""]),
            ("valid", ["20", "19", "20"]),
        ] {
            let refused = refusal("run: n, ", name, number(numbers));
            assert_eq!(refused, "", "{name}");
        }
        let words = refusal("run: n, ", "quality", |_, target| format!("note {target}"));
        assert_eq!(words, "");
        let refused = refusal("run: n, ", "status", number(["0", "4", "0"]));
        assert!(refused.contains("marks rows itself"), "{refused}");
    }
}
