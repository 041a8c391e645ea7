//! Finds rows of a table that do not split into as many cells as its header line, and columns by name or number.

use std::path::Path;

use anyhow::{Result, bail};

use super::encoding;

/// Lines from the first on that are looked at for what parts their columns.
const FIRST_LINES: usize = 100;

/// Refuses a row of another length than the line with the names; separators at its end do no harm.
pub(super) fn check_length(cells: &[String], wanted: usize, line: u64) -> Result<()> {
    let used = cells.iter().rposition(|cell| !cell.is_empty());
    let used = used.map_or(0, |last| last + 1);
    if cells.len() < wanted || used > wanted {
        bail!(
            "line {line}: {} cells, the first line has {wanted}: check separators and quotes{}",
            cells.len(),
            of_block(cells),
        );
    }
    Ok(())
}

/// The remedy for a line that begins with a word, as a block of statistics does below a table.
fn of_block(cells: &[String]) -> String {
    let first = cells.iter().find(|cell| !cell.is_empty());
    let word = first.filter(|cell| !is_number(cell));
    word.map_or_else(String::new, |word| {
        format!(
            "; where \"{word}\" begins something else below the table, such as statistics, take that away or begin its lines with #"
        )
    })
}

/// Where a column stands.
pub(super) fn place_of(name: &str, head: &[String], separator: Option<char>) -> Result<usize> {
    let mut named = head.iter().enumerate().filter(|(_, cell)| *cell == name);
    let first = named.next().map(|(place, _)| place);
    let Some(place) = first.or_else(|| by_number(name, head.len())) else {
        let remedy = match separator {
            Some(separator) if head.len() == 1 => {
                format!(" (one column alone: is the separator \"{separator}\"?)")
            }
            _ => String::new(),
        };
        bail!(
            "no column \"{name}\"; there are {}{remedy}",
            head.join(", ")
        );
    };
    if named.next().is_some() {
        bail!("column \"{name}\" is there twice: rename one of them");
    }
    Ok(place)
}

/// The place of `column 2` in a table whose columns have other names, or names that were given to them.
pub(super) fn by_number(name: &str, n_columns: usize) -> Option<usize> {
    let number: usize = name.strip_prefix("column ")?.parse().ok()?;
    number.checked_sub(1).filter(|place| *place < n_columns)
}

/// That no names of columns were found; a separator that is not read is named as the reason.
pub(super) fn no_names(path: &Path) -> String {
    let read = encoding::read(path).ok();
    let text = read.map(|read| read.text);
    let remedy = match text.as_deref().and_then(foreign) {
        Some(by) => format!(
            "its columns seem to be apart by {by}, and no line has a name for each of them: put commas, semicolons or tabs between the cells"
        ),
        None if text.as_deref().is_some_and(has_one_number_each) => {
            "each row has one number: add a column of positions (target_mm), times (time_s) or angles (angle_deg) beside that of the readings"
                .to_owned()
        }
        None => "write a map (docs/reference/scenario.md#import-map)".to_owned(),
    };
    format!(
        "no line with the names of columns that has rows of numbers below it was found: {remedy}"
    )
}

/// How the columns of a text seem to be parted, where that is no separator that is read; `None`: nothing is seen.
fn foreign(text: &str) -> Option<&'static str> {
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    let lines = lines
        .filter(|line| !line.starts_with('#'))
        .take(FIRST_LINES);
    let lines: Vec<&str> = lines.collect();
    if lines.iter().any(|line| line.contains([';', '\t'])) {
        return None;
    }
    // Two rows of two numbers or more are no text by chance.
    let n_rows = |pieces: fn(&str) -> Vec<&str>| {
        let rows = lines.iter().map(|line| pieces(line));
        rows.filter(|row| row.iter().filter(|cell| is_number(cell)).count() > 1)
            .count()
    };
    if n_rows(|line| line.split('|').map(str::trim).collect()) > 1 {
        return Some("bars (|)");
    }
    (n_rows(|line| line.split_whitespace().collect()) > 1).then_some("spaces")
}

/// Whether most lines hold one number, as a list of readings without their positions.
fn has_one_number_each(text: &str) -> bool {
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    let lines: Vec<&str> = lines.take(FIRST_LINES).collect();
    let is_one = |line: &&str| {
        let cells = line.split([',', ';', '\t']).map(str::trim);
        is_number(line.trim()) || cells.filter(|cell| is_number(cell)).count() == 1
    };
    let n = lines.iter().filter(|line| is_one(line)).count();
    n > 1 && 2 * n > lines.len()
}

fn is_number(cell: &str) -> bool {
    cell.replace(',', ".").parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    fn cells(line: &str) -> Vec<String> {
        line.split(',').map(str::to_owned).collect()
    }

    #[test]
    fn a_line_that_begins_with_a_word_may_be_of_another_block() {
        use super::check_length;

        for (line, is_block) in [
            ("Statistics", true),
            ("A,8.18", true),
            ("Mean reversal,-5,0", true),
            ("1,2", false),
            ("1", false),
            ("1,2,3,4,5", false),
        ] {
            let error = check_length(&cells(line), 4, 40).unwrap_err().to_string();
            assert!(error.starts_with("line 40: "), "{error}");
            assert!(error.contains("check separators and quotes"), "{error}");
            assert_eq!(error.contains("such as statistics"), is_block, "{error}");
        }
        for good in ["1,2,3,4", "1,2,3,4,,"] {
            check_length(&cells(good), 4, 1).unwrap();
        }
    }

    #[test]
    fn columns_apart_by_spaces_or_bars_are_seen() {
        use super::foreign;

        for (text, found) in [
            ("run target dev\n1 0.0 -0.1\n1  50.1  0.7\n", Some("spaces")),
            ("x y\n 0,0   1,5\n 10,0  1,7\n", Some("spaces")),
            ("run | target\n1 | 0.0\n2 | 1.0\n", Some("bars (|)")),
            ("|run|target|\n|1|0.0|\n|1|5.0|\n", Some("bars (|)")),
            ("# 1 2\n# 3 4\nrun,target\n1,2\n", None),
            ("a;b\n1 2;3 4\n5 6;7 8\n", None),
            ("a\tb\n1\t2\n3\t4\n", None),
            ("a letter of 3 lines\nand 4 words\n", None),
            ("x y\n1 2\n", None),
            ("", None),
        ] {
            assert_eq!(foreign(text), found, "{text:?}");
        }
    }
}
