//! Columns that a test needs by their names, whose cells are no numbers: which cell stands in the way.

use metrology::yaml::shown;

use super::recognise::{Known, Recognised, Role, role_of_name};
use super::sheet::Sheet;
use super::stated;

/// Names of quantities that a line of names has at least.
const LEAST_NAMES: usize = 2;

/// Whether a cell has a digit of any script.
pub fn has_digit(cell: &str) -> bool {
    cell.contains(char::is_numeric)
}

/// Whether every column of a text that was cut at its blanks has a number in every row, as a table has.
pub fn is_even(found: &Recognised) -> bool {
    let n = |column: &Known| column.numbers.len();
    let most = found.columns.iter().map(n).max().unwrap_or(0);
    let is_full = |column: &Known| n(column) == most || column.role.is_some();
    most > 1 && found.columns.iter().all(is_full)
}

/// Rows among which a line of units may stand below the names.
const UNIT_ROWS: usize = 2;

/// The first line of names above numbers; `n_words` and `n_numbers` count those of a line's cells.
pub fn names_at(
    lines: &[(u64, Vec<String>)],
    n_words: impl Fn(&[String]) -> usize,
    n_numbers: impl Fn(&[String]) -> usize,
) -> Option<usize> {
    let at = (0..lines.len()).find(|k| {
        let cells = &lines[*k].1;
        let mut below = lines[k + 1..].iter().take(UNIT_ROWS);
        n_words(cells) >= LEAST_NAMES
            && n_words(cells) > n_numbers(cells)
            && below.any(|(_, cells)| n_numbers(cells) >= 2)
    })?;
    // `Units;inch` above the names is no line of names.
    let is_next = lines.get(at + 1).is_some_and(|(_, next)| {
        let is_unit_row = stated::is_row(next.iter().map(String::as_str));
        !is_unit_row && n_numbers(next) == 0 && n_words(next) > n_words(&lines[at].1)
    });
    Some(if is_next { at + 1 } else { at })
}

/// The line of names above cells of which hardly one is a number.
pub fn head(lines: &[(u64, Vec<String>)]) -> Option<usize> {
    let is_quantity = |cell: &&String| {
        let role = role_of_name(cell);
        let is_name = cell.chars().next().is_some_and(char::is_alphabetic);
        is_name && role.is_some_and(|role| role != Role::Run)
    };
    lines.windows(2).position(|two| {
        let [(_, names), (_, below)] = two else {
            return false;
        };
        names.iter().filter(is_quantity).count() >= LEAST_NAMES
            && below.iter().filter(|cell| has_digit(cell)).count() >= LEAST_NAMES
            && !below.iter().any(|cell| is_quantity(&cell))
    })
}

/// Whether cells have commas before decimals: not three digits alone behind each, as thousands have.
pub fn has_decimal_commas(sheet: &Sheet) -> bool {
    let mut cells = sheet.lines.iter().flat_map(|(_, cells)| cells);
    cells.any(|cell| {
        cell.split_once(',').is_some_and(|(whole, decimals)| {
            let is_digit = |letter: char| letter.is_ascii_digit();
            whole.ends_with(is_digit)
                && !decimals.is_empty()
                && decimals.len() != 3
                && decimals.chars().all(is_digit)
        })
    })
}

/// Two cells by which the separators of a column are those of thousands and not of decimals: three digits stand behind each, none
/// begins with a zero, and some cells have none. One with and one without.
pub fn thousands(cells: &[&str], separator: char) -> Option<[String; 2]> {
    let bare = |cell: &str| {
        let signs = ['-', '+', '\u{2212}', '\u{2013}', ' '];
        cell.trim_start_matches(signs).to_owned()
    };
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let mut found = [None, None];
    for cell in cells {
        let text = bare(cell);
        match text.split_once(separator) {
            Some((front, behind)) if is_digits(front) && is_digits(behind) => {
                if behind.len() != 3 || front.starts_with('0') {
                    return None;
                }
                found[0].get_or_insert((*cell).to_owned());
            }
            None if is_digits(&text) && text.len() <= 3 && !text.starts_with('0') => {
                found[1].get_or_insert((*cell).to_owned());
            }
            _ => {}
        }
    }
    let [with, without] = found;
    Some([with?, without?])
}

/// A cell by which separators of numbers in a unit of so small a size mark thousands: three digits stand behind each, and none
/// begins with a zero. Nanometres have no decimals that an instrument reads, and targets in micrometres none of three digits.
pub fn thousands_of_small(cells: &[&str], separator: char) -> Option<[String; 2]> {
    let (mut first, mut plain) = (None, String::new());
    for cell in cells {
        let signs = ['-', '+', '\u{2212}', '\u{2013}', ' '];
        let text = cell.trim_start_matches(signs);
        let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        match text.split_once(separator) {
            Some((front, behind)) => {
                let is_one = is_digits(front) && is_digits(behind) && !front.starts_with('0');
                if !is_one || behind.len() != 3 {
                    return None;
                }
                first.get_or_insert((*cell).to_owned());
            }
            None if is_digits(text) => (*cell).clone_into(&mut plain),
            None => return None,
        }
    }
    first.map(|cell| [cell, plain])
}

/// Why a column whose separators are those of thousands is not read; the second cell, which has none, may be missing.
pub fn of_thousands(name: &str, [with, without]: &[String; 2]) -> String {
    let (and, others) = match without.as_str() {
        "" => (String::new(), ""),
        plain => (
            format!(" and \"{}\"", shown(plain)),
            " and other numbers have none",
        ),
    };
    format!(
        "column \"{}\": \"{}\"{and}: every separator has three digits behind it{others}, as where it marks thousands: write the numbers \
         without it; or all with decimals, where it stands before decimals",
        shown(name),
        shown(with),
    )
}

/// A sentence for each column that is a quantity by its name and has cells that are no numbers; none without any.
pub fn in_words(found: &Recognised) -> Option<String> {
    let columns = found.columns.iter().filter_map(|column| {
        let role = role_of_name(&column.name).filter(|role| *role != Role::Run)?;
        let (line, cell) = column.odd.as_ref().filter(|_| column.role != Some(role))?;
        let remedy = if cell.contains(',') && found.decimal == '.' {
            "; with decimal commas the map needs `decimal: \",\"`"
        } else {
            ""
        };
        Some(format!(
            "line {line}, column \"{}\": \"{}\": must be a number{remedy}",
            shown(&column.name),
            shown(cell)
        ))
    });
    let lines: Vec<String> = columns.collect();
    (!lines.is_empty()).then(|| lines.join("; "))
}
