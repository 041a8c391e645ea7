//! Rows and columns of a worksheet that are hidden and hold something: a filter hides rows, and they count all the same.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use super::book::{LAST_COLUMN, named, values};

/// Looks at the tags of one part of a workbook.
#[derive(Debug, Default)]
pub struct Hidden {
    /// Columns that are hidden.
    columns: Vec<RangeInclusive<u32>>,
    /// Columns with a value.
    filled: BTreeSet<u32>,
    /// Column of the cell that is read, from 1.
    column: u32,
    /// Whether the row that is read is hidden and had no value yet.
    is_open: bool,
    n_rows: usize,
}

impl Hidden {
    /// Looks at a tag.
    pub fn take(&mut self, tag: &[u8]) {
        let (name, rest) = named(tag);
        match name {
            b"col" if is_hidden(rest) && self.columns.len() < LAST_COLUMN as usize => {
                if let (Some(first), Some(last)) = (whole(rest, b"min"), whole(rest, b"max")) {
                    self.columns.push(first..=last);
                }
            }
            b"row" => {
                self.column = 0;
                self.is_open = is_hidden(rest);
            }
            b"c" => {
                let of_reference = values(rest, b"r").first().copied().and_then(column);
                self.column = of_reference.unwrap_or(self.column + 1).min(LAST_COLUMN);
            }
            b"v" | b"is" => {
                self.filled.insert(self.column);
                self.n_rows += usize::from(std::mem::take(&mut self.is_open));
            }
            _ => {}
        }
    }

    /// How many rows and columns are hidden; nothing where none is.
    pub fn in_words(&self, part: &str) -> Option<String> {
        let is_hidden = |column: &&u32| self.columns.iter().any(|range| range.contains(*column));
        let n_columns = self.filled.iter().filter(is_hidden).count();
        let counts = [(self.n_rows, "rows"), (n_columns, "columns")];
        let counts = counts.iter().filter(|(n, _)| *n > 0);
        let counts: Vec<String> = counts.map(|(n, what)| format!("{n} {what}")).collect();
        (!counts.is_empty()).then(|| {
            format!(
                "warning, {part}: {} are hidden, by a filter or by hand, and were read as any others: delete them where they do not count",
                counts.join(" and ")
            )
        })
    }
}

fn is_hidden(rest: &[u8]) -> bool {
    let mut all = values(rest, b"hidden").into_iter();
    let mut sizes = [&b"ht"[..], b"width"].into_iter();
    all.any(|value| value == b"1" || value.eq_ignore_ascii_case(b"true"))
        || sizes.any(|size| values(rest, size).iter().any(|value| is_zero(value)))
}

/// Whether a height or width is zero.
fn is_zero(value: &[u8]) -> bool {
    let size = std::str::from_utf8(value)
        .ok()
        .and_then(|text| text.parse::<f64>().ok());
    size.is_some_and(|size| size <= 0.0)
}

/// A whole number of an attribute.
fn whole(rest: &[u8], key: &[u8]) -> Option<u32> {
    let value = values(rest, key).first().copied()?;
    std::str::from_utf8(value).ok()?.parse().ok()
}

/// The column of a reference, from 1; none where it has no letters.
pub fn column(reference: &[u8]) -> Option<u32> {
    let letters = reference
        .iter()
        .take_while(|byte| byte.is_ascii_alphabetic());
    let place = |byte: &u8| u32::from(byte.to_ascii_uppercase() - b'A') + 1;
    let column = letters.fold(0_u32, |all, byte| {
        all.saturating_mul(26).saturating_add(place(byte))
    });
    (column > 0).then_some(column)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(tags: &[&str]) -> String {
        let mut hidden = Hidden::default();
        for tag in tags {
            hidden.take(tag.as_bytes());
        }
        hidden.in_words("sheet1").unwrap_or_default()
    }

    #[test]
    fn hidden_rows_and_columns_with_values_are_counted_and_empty_ones_are_not() {
        let rows = [
            "row r='1' hidden=\"1\"",
            "c r='A1'",
            "v",
            "/v",
            "c r='B1'",
            "v",
            "/row",
            "x:row r='2'",
            "c r='A2'",
            "v",
            "row hidden='true'",
            "c",
            "is",
            "t",
            "row r='4' hidden='1'/",
            "row r='5' hidden='1'",
            "c r='A5' s='3'/",
            "row r='6' hidden='0'",
            "c r='A6'",
            "v",
        ];
        let found = said(&rows);
        assert!(
            found.starts_with("warning, sheet1: 2 rows are hidden"),
            "{found}"
        );
        for (col, n) in [
            ("col min='2' max='2' hidden='1'", 1),
            ("col max='16384' min='2' width='0' hidden='true'", 2),
            ("col min='1' max='3' hidden='1'", 3),
            ("col min='4' max='16384' hidden='1'", 0),
            ("col min='1' max='3'", 0),
            ("col min='1' max='1' width='0' customWidth='1'", 1),
            ("col min='1' max='1' width='8.5'", 0),
            ("col min='1' max='3' hidden='0'", 0),
        ] {
            let cells = ["row", "c r='A1'", "v", "c r='B1'", "is", "c", "v"];
            let found = said(&[&[col], &cells[..]].concat());
            let words = format!("warning, sheet1: {n} columns are hidden");
            assert_eq!(found.starts_with(&words), n > 0, "{col}: {found}");
            assert_eq!(found.is_empty(), n == 0, "{col}: {found}");
        }
        assert!(said(&["row r='1'", "c r='A1'", "v"]).is_empty());
    }
}
