//! Decimal commas between commas, where the line of names has a cell more.
//!
//! `8,6` comes apart into a deviation of 8 and a cell of 6 without a name. Such cells are whole numbers beside whole readings.

use metrology::yaml::shown;

use super::recognise::{Known, Role};
use super::vocabulary::words;

/// Lines of cells with their numbers.
type Lines = [(u64, Vec<String>)];

/// Fewest rows by which that is seen.
const LEAST_SPLIT_ROWS: usize = 3;
/// Most digits of decimals that are looked for.
const MOST_DIGITS: usize = 4;
/// First words of names that no column of numbers has.
const OF_TEXTS: &[&str] = &[
    "remark",
    "remarks",
    "comment",
    "comments",
    "note",
    "notes",
    "bemerkung",
    "bemerkungen",
    "kommentar",
    "notiz",
];

/// What is wrong with a column that holds the decimals of the readings before it.
pub fn odd(columns: &[Known], head: &[String], lines: &Lines) -> Option<String> {
    let is_reading = |name: &String| {
        let role = columns.iter().find(|column| column.name == *name)?.role?;
        let is_one = matches!(
            role,
            Role::Deviation | Role::Measured | Role::Displacement | Role::Radial | Role::Pass(_)
        );
        is_one.then_some(())
    };
    let at = (1..head.len()).find(|k| {
        let (before, own) = (head.get(k - 1), head.get(*k));
        before.and_then(is_reading).is_some()
            && own.is_some_and(|name| is_of_no_number(name))
            && are_decimals(lines, *k)
    })?;
    let (line, cells) = lines.iter().find(|(_, cells)| cells.len() > at)?;
    let [whole, decimals] = [at - 1, at].map(|k| cells.get(k).map_or("", String::as_str));
    Some(format!(
        "line {line}, column \"{}\": \"{whole}\" has \"{decimals}\" behind it in a column without a name of numbers: are these decimals \
         ({whole},{decimals})? Write decimals with a point, or put semicolons between the cells",
        shown(head.get(at - 1)?)
    ))
}

fn is_of_no_number(name: &str) -> bool {
    let words = words(name);
    let first = words.first().map(String::as_str);
    first.is_none_or(|first| OF_TEXTS.contains(&first))
}

/// Whether a column has digits alone and the one before it whole numbers, in every row.
fn are_decimals(lines: &Lines, k: usize) -> bool {
    let is_digits = |text: &str| {
        !text.is_empty() && text.len() <= MOST_DIGITS && text.bytes().all(|b| b.is_ascii_digit())
    };
    let whole = |cell: &str| is_digits(cell.trim_start_matches(['-', '+', '\u{2212}']));
    let rows = lines
        .iter()
        .filter(|(_, cells)| cells.iter().any(|cell| !cell.is_empty()));
    let mut n = 0;
    for (_, cells) in rows {
        let [before, own] = [k - 1, k].map(|k| cells.get(k).map_or("", String::as_str));
        if !whole(before) || !is_digits(own) {
            return false;
        }
        n += 1;
    }
    n >= LEAST_SPLIT_ROWS
}

#[cfg(test)]
mod tests {
    use super::super::recognise::of_text;

    fn odd(text: &str) -> Option<String> {
        of_text(text).expect("rows").expect("names").odd
    }

    #[test]
    fn decimals_in_a_column_of_no_numbers_are_refused_with_line_and_both_parts() {
        for end in ["", "remark", "Bemerkung"] {
            let text = format!(
                "run,direction,target_mm,deviation_um,{end}\n1,up,0,8,6\n1,up,37,10,25\n1,up,81,-12,47\n"
            );
            let said = odd(&text).expect(end);
            assert!(
                said.starts_with("line 2, column \"deviation_um\": \"8\" has \"6\" behind it"),
                "{said}"
            );
        }
        for text in [
            "run,direction,target_mm,deviation_um,remark\n1,up,0,8,\n1,up,37,10,\n1,up,81,12,47\n",
            "run,direction,target_mm,deviation_um,humidity\n1,up,0,8,46\n1,up,37,10,45\n1,up,81,12,47\n",
            "run,direction,target_mm,deviation_um,\n1,up,0,8.5,1\n1,up,37,10.2,1\n1,up,81,12.1,1\n",
            "run,direction,target_mm,deviation_um,,\n1,up,0,8,,\n1,up,37,10,,\n1,up,81,12,,\n",
        ] {
            assert_eq!(odd(text), None, "{text}");
        }
    }
}
