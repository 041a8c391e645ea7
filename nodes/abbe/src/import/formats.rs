//! Units and scales in the number formats of a worksheet: `0.000" mm"` shows a unit, and `0.0,` thousands, that no cell holds.

use std::collections::BTreeMap;

use metrology::yaml::shown;

use super::book::{LAST_COLUMN, named, values};
use super::hidden::column;
use super::units::{Kind, Unit};

/// Most styles and columns that are kept.
const MOST_STYLES: usize = 100_000;

/// The word for a format that shows a number times a hundred; no length has it as its unit.
const PERCENT: &str = "percent";

/// Looks at the tags of all parts of a workbook.
#[derive(Debug, Default)]
pub struct Formats {
    /// Codes of formats by their numbers.
    codes: BTreeMap<u32, String>,
    /// Numbers of the formats of styles, in their order.
    styles: Vec<u32>,
    is_in_styles: bool,
    /// Column of the cell that is read, from 1, with its style.
    cell: (u32, Option<usize>),
    /// Styles of columns, with the reference of a first cell.
    used: BTreeMap<(u32, usize), String>,
}

impl Formats {
    /// Looks at a tag; `/` begins that of an end.
    pub fn take(&mut self, tag: &[u8]) {
        let (name, rest) = named(tag);
        match name {
            b"cellXfs" => self.is_in_styles = true,
            b"cellStyles" | b"cellStyleXfs" | b"dxfs" => self.is_in_styles = false,
            b"xf" if self.is_in_styles && self.styles.len() < MOST_STYLES => {
                self.styles.push(whole(rest, b"numFmtId").unwrap_or(0));
            }
            b"numFmt" if self.codes.len() < MOST_STYLES => {
                let code = values(rest, b"formatCode").first().copied();
                if let (Some(id), Some(code)) = (whole(rest, b"numFmtId"), code) {
                    self.codes.insert(id, unescaped(code));
                }
            }
            b"row" => self.cell = (0, None),
            b"c" => {
                let reference = values(rest, b"r").first().copied();
                let place = reference.and_then(column).unwrap_or(self.cell.0 + 1);
                let style = whole(rest, b"s").map(|style| style as usize);
                self.cell = (place.min(LAST_COLUMN), style);
                let key = style.map(|style| (place.min(LAST_COLUMN), style));
                let is_room = self.used.len() < MOST_STYLES;
                if let Some(key) = key.filter(|_| is_room) {
                    let text = String::from_utf8_lossy(reference.unwrap_or_default());
                    self.used.entry(key).or_insert_with(|| text.into_owned());
                }
            }
            _ => {}
        }
    }

    fn code(&self, style: usize) -> Option<&String> {
        self.codes.get(self.styles.get(style)?)
    }

    /// The word for a unit that the cells of each column show, by the place of the column from 0; none of one with several.
    pub fn units(&self) -> BTreeMap<usize, String> {
        let mut found: BTreeMap<usize, Option<String>> = BTreeMap::new();
        for (place, style) in self.used.keys() {
            let Some(word) = self.code(*style).and_then(|code| unit_of(code)) else {
                continue;
            };
            let place = (*place as usize).saturating_sub(1);
            let one = found.entry(place).or_insert_with(|| Some(word.clone()));
            if one.as_ref() != Some(&word) {
                *one = None;
            }
        }
        let words = found.into_iter();
        words
            .filter_map(|(place, word)| Some((place, word?)))
            .collect()
    }

    /// What is wrong with a format that shows a number divided by thousands; a sentence with its first cell.
    pub fn scaled(&self) -> Option<String> {
        self.used.iter().find_map(|((_, style), cell)| {
            let code = self.code(*style).filter(|code| is_scaled(code))?;
            Some(format!(
                "cell {cell}: its number format \"{}\" shows thousands of what it holds: give the column a plain format, and its unit in its name",
                shown(code)
            ))
        })
    }
}

fn whole(rest: &[u8], key: &[u8]) -> Option<u32> {
    let value = values(rest, key).first().copied()?;
    std::str::from_utf8(value).ok()?.parse().ok()
}

fn unescaped(code: &[u8]) -> String {
    let text = String::from_utf8_lossy(code);
    text.replace("&quot;", "\"").replace("&amp;", "&")
}

/// The unit that a format shows behind its numbers: the text in its quotes, or behind backslashes.
fn unit_of(code: &str) -> Option<String> {
    let first = code.split(';').next()?;
    if { first.split('"').step_by(2) }.any(|part| part.contains('%')) {
        return Some(PERCENT.to_owned());
    }
    let mut parts = first.split('"');
    let quoted = parts.nth(1).map(str::to_owned);
    let text = quoted.or_else(|| {
        let escaped = first.split('\\').skip(1);
        let letters: String = escaped.filter_map(|part| part.chars().next()).collect();
        (!letters.is_empty()).then_some(letters)
    })?;
    let word = text.trim().trim_matches(['[', ']', '(', ')']);
    let unit = Unit::of_word(word)?;
    matches!(unit.kind(), Kind::Length | Kind::Angle).then(|| word.to_owned())
}

/// Whether commas stand behind the last digit of a format, each of which divides by a thousand.
fn is_scaled(code: &str) -> bool {
    let first = code.split(';').next().unwrap_or_default();
    let bare: String = { first.split('"').step_by(2) }.collect();
    let is_digit = |letter: char| "0#?".contains(letter);
    bare.rsplit_once(is_digit)
        .is_some_and(|(_, behind)| behind.starts_with(','))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(codes: &[&str], cells: &[&str]) -> Formats {
        let mut formats = Formats::default();
        for cell in cells {
            formats.take(cell.as_bytes());
        }
        for (k, code) in codes.iter().enumerate() {
            formats.take(format!("numFmt numFmtId='{}' formatCode='{code}'/", 170 + k).as_bytes());
        }
        formats.take(b"cellStyleXfs count='1'");
        formats.take(b"xf/");
        formats.take(b"cellXfs count='3'");
        formats.take(b"xf numFmtId='0'/");
        for k in 0..codes.len() {
            formats.take(format!("xf numFmtId='{}'/", 170 + k).as_bytes());
        }
        formats
    }

    #[test]
    fn the_unit_that_cells_show_is_that_of_their_column() {
        let codes = [
            "0.0&quot; in&quot;",
            "0.000\\ \\m\\m",
            "#,##0.0",
            "0.0&quot; x&quot;",
            "0.0%",
        ];
        let cells = [
            "row r='2'",
            "c r='A2'",
            "c r='C2' s='1'",
            "c r='D2' s='2'",
            "c s='3'",
            "c r='F2' s='4'",
            "c r='G2' s='5'",
        ];
        let formats = of(&codes, &cells);
        let units: Vec<(usize, String)> = formats.units().into_iter().collect();
        assert_eq!(
            units,
            [
                (2, "in".to_owned()),
                (3, "mm".to_owned()),
                (6, PERCENT.to_owned())
            ]
        );
        assert_eq!(formats.scaled(), None);
        let two = of(&codes, &["c r='C2' s='1'", "c r='C3' s='2'"]);
        assert!(two.units().is_empty());
    }

    #[test]
    fn a_format_that_shows_thousands_is_named_with_its_cell() {
        for (code, is_scaled) in [
            ("0.0,", true),
            ("#,##0,,&quot; M&quot;", true),
            ("#,##0.000", false),
            ("0.00", false),
            ("0,0", false),
        ] {
            let said = of(&[code], &["c r='D2' s='1'"]).scaled();
            assert_eq!(said.is_some(), is_scaled, "{code}");
            if let Some(said) = said {
                assert!(said.starts_with("cell D2: its number format"), "{said}");
            }
        }
    }
}
