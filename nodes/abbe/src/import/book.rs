//! Bounds of a workbook (xlsx), checked before its cells are read.
//!
//! A workbook is a ZIP archive of XML. Its directory states how long each part is; a part is unpacked here once, its bytes
//! counted, and nothing of it kept, since a directory may state anything. The reader of the cells counts with 32 bits and
//! fails at a reference beyond them: every reference of a row, a cell and a dimension is looked at here first, by the rules
//! of the reader, in every part, since the workbook itself names those that are worksheets.

use std::io::{Cursor, Read};

use anyhow::{Context, Result, bail};
use zip::ZipArchive;

use super::formats::Formats;
use super::hidden::Hidden;

/// Most parts of a workbook.
const MOST_PARTS: usize = 2_000;
/// Longest of all parts together, unpacked, bytes.
const MOST_UNPACKED_BYTES: u64 = 128 << 20;
/// Longest tag of a part, bytes.
const LONGEST_TAG_BYTES: usize = 64 << 10;
/// Last row of a worksheet (ECMA-376).
const LAST_ROW: u32 = 1_048_576;
/// Last column of a worksheet.
pub const LAST_COLUMN: u32 = 16_384;
/// Most of each list that the reader keeps whole, by the tag of an entry: an entry of 5 bytes takes ten times as many in memory.
const MOST_OF_LIST: [(&[u8], u64); 6] = [
    (b"si", 2_000_000),
    (b"xf", 100_000),
    (b"numFmt", 100_000),
    (b"definedName", 100_000),
    (b"Relationship", 100_000),
    (b"sheet", 1_000),
];
/// Bytes that are unpacked at a time.
const PIECE_BYTES: usize = 64 << 10;

/// What a workbook holds beside its cells.
#[derive(Debug, Default)]
pub struct Checked {
    /// A line for each part with hidden rows or columns.
    pub hidden: Vec<String>,
    /// Number formats of cells.
    pub formats: Formats,
}

/// Checks a workbook.
///
/// # Errors
/// With the part and the limit, or with the reference.
pub fn check(bytes: &[u8]) -> Result<Checked> {
    check_within(bytes, MOST_UNPACKED_BYTES)
}

fn check_within(bytes: &[u8], most_bytes: u64) -> Result<Checked> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).context("xlsx")?;
    if archive.len() > MOST_PARTS {
        bail!(
            "{} parts: must be at most {MOST_PARTS}: save it as CSV",
            archive.len()
        );
    }
    let mut unpacked = 0_u64;
    let mut checked = Checked::default();
    for place in 0..archive.len() {
        let mut part = archive.by_index(place).context("xlsx")?;
        let name = part.name().context("xlsx")?.into_owned();
        let too_long = || {
            format!(
                "part {name}: the file unpacks to more than {most_bytes} bytes, the most that is read: save it as CSV"
            )
        };
        if unpacked.saturating_add(part.size()) > most_bytes {
            bail!("{}", too_long());
        }
        let mut tags = Tags {
            is_xml: name.ends_with(".xml"),
            formats: std::mem::take(&mut checked.formats),
            ..Tags::default()
        };
        let mut piece = vec![0; PIECE_BYTES];
        loop {
            let n = part
                .read(&mut piece)
                .with_context(|| format!("part {name}"))?;
            if n == 0 {
                break;
            }
            unpacked = unpacked.saturating_add(n as u64);
            if unpacked > most_bytes {
                bail!("{}", too_long());
            }
            tags.take(&piece[..n])
                .with_context(|| format!("part {name}"))?;
        }
        checked.hidden.extend(tags.hidden.in_words(&name));
        checked.formats = tags.formats;
    }
    Ok(checked)
}

/// Where in an XML text a scan is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    Text,
    /// In a tag, maybe in quotes.
    Tag(Option<u8>),
    /// In a comment, a section of raw text or an instruction, with the end of it.
    Until(&'static [u8]),
}

/// Looks over the tags of an XML text that comes in pieces.
#[derive(Default)]
struct Tags {
    state: State,
    tag: Vec<u8>,
    /// Whether the part's name says that it is XML, and no image.
    is_xml: bool,
    /// Tags of each kind of [`MOST_OF_LIST`] so far.
    entries: [u64; MOST_OF_LIST.len()],
    hidden: Hidden,
    formats: Formats,
}

impl Tags {
    fn take(&mut self, bytes: &[u8]) -> Result<()> {
        for byte in bytes.iter().copied() {
            match self.state {
                State::Text if byte == b'<' => {
                    self.state = State::Tag(None);
                    self.tag.clear();
                }
                State::Text => {}
                State::Tag(quote) => self.in_tag(quote, byte)?,
                State::Until(end) => {
                    self.tag.push(byte);
                    let kept = self.tag.len().saturating_sub(end.len());
                    self.tag.drain(..kept);
                    if self.tag == end {
                        self.state = State::Text;
                    }
                }
            }
        }
        Ok(())
    }

    fn in_tag(&mut self, quote: Option<u8>, byte: u8) -> Result<()> {
        match (quote, byte) {
            (None, b'>') => {
                self.state = State::Text;
                self.count()?;
                self.hidden.take(&self.tag);
                self.formats.take(&self.tag);
                return checked(&self.tag);
            }
            (None, b'"' | b'\'') => self.state = State::Tag(Some(byte)),
            (Some(open), _) if open == byte => self.state = State::Tag(None),
            _ => {}
        }
        self.tag.push(byte);
        let begins: [(&[u8], &[u8]); 3] = [(b"!--", b"-->"), (b"![CDATA[", b"]]>"), (b"?", b"?>")];
        for (begin, end) in begins {
            if self.tag == begin {
                self.state = State::Until(end);
                self.tag.clear();
            }
        }
        if self.tag.len() > LONGEST_TAG_BYTES {
            if self.is_xml || attribute(&self.tag).is_some() {
                bail!("a tag of more than {LONGEST_TAG_BYTES} bytes, the most that is read");
            }
            self.tag.truncate(LONGEST_TAG_BYTES);
        }
        Ok(())
    }

    /// Counts a tag of an entry that the reader keeps.
    fn count(&mut self) -> Result<()> {
        let (name, _) = named(&self.tag);
        let known = MOST_OF_LIST.iter().position(|(entry, _)| *entry == name);
        let Some(place) = known else {
            return Ok(());
        };
        self.entries[place] += 1;
        let most = MOST_OF_LIST[place].1;
        if self.entries[place] > most {
            let name = String::from_utf8_lossy(name);
            bail!("more than {most} entries <{name}>, the most that is read: save it as CSV");
        }
        Ok(())
    }
}

/// The name of a tag without its prefix, and what follows it.
pub fn named(tag: &[u8]) -> (&[u8], &[u8]) {
    let is_blank = |byte: &u8| byte.is_ascii_whitespace() || *byte == b'/';
    let (name, rest) = tag.split_at(tag.iter().position(is_blank).unwrap_or(tag.len()));
    (
        name.rsplit(|byte| *byte == b':').next().unwrap_or(name),
        rest,
    )
}

/// The attribute with the reference of a tag, and what follows the tag's name: of a cell and a row `r`, of a dimension `ref`.
fn attribute(tag: &[u8]) -> Option<(&'static [u8], &[u8])> {
    let (local, rest) = named(tag);
    match local {
        b"c" | b"row" => Some((&b"r"[..], rest)),
        b"dimension" => Some((&b"ref"[..], rest)),
        _ => None,
    }
}

/// Checks the references of a tag.
fn checked(tag: &[u8]) -> Result<()> {
    let Some((key, rest)) = attribute(tag) else {
        return Ok(());
    };
    for value in values(rest, key) {
        for reference in value.split(|byte| *byte == b':') {
            within(reference)?;
        }
    }
    Ok(())
}

/// The values of an attribute in what follows the name of a tag.
pub fn values<'t>(mut rest: &'t [u8], key: &[u8]) -> Vec<&'t [u8]> {
    let mut found = vec![];
    while let Some(equals) = rest.iter().position(|byte| *byte == b'=') {
        let name = rest[..equals].trim_ascii();
        let name = name
            .rsplit(|byte| byte.is_ascii_whitespace())
            .next()
            .unwrap_or(name);
        let behind = rest[equals + 1..].trim_ascii_start();
        let Some((quote, inner)) = behind.split_first() else {
            break;
        };
        let Some(end) = inner.iter().position(|byte| byte == quote) else {
            break;
        };
        if name == key {
            found.push(&inner[..end]);
        }
        rest = &inner[end + 1..];
    }
    found
}

/// Refuses a reference beyond the last row or column; letters and digits in another order are left to the reader, which says so.
fn within(reference: &[u8]) -> Result<()> {
    let digits = reference.iter().position(u8::is_ascii_digit);
    let (letters, digits) = reference.split_at(digits.unwrap_or(reference.len()));
    let letter = |column: u32, byte: &u8| {
        let place = u32::from(byte.to_ascii_uppercase().saturating_sub(b'A')) + 1;
        column.saturating_mul(26).saturating_add(place)
    };
    let digit = |row: u32, byte: &u8| {
        let place = u32::from(byte.saturating_sub(b'0'));
        row.saturating_mul(10).saturating_add(place)
    };
    let column = letters.iter().fold(0, letter);
    let row = digits.iter().fold(0, digit);
    if column > LAST_COLUMN || row > LAST_ROW {
        let shown: String = String::from_utf8_lossy(reference)
            .chars()
            .take(40)
            .collect();
        bail!(
            "cell {shown}: must be at most row {LAST_ROW} and column {LAST_COLUMN} (XFD), the last of a worksheet"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    /// A workbook with one part.
    fn book(text: &str) -> Vec<u8> {
        let mut writer = zip::ZipWriter::new(Cursor::new(vec![]));
        let options = zip::write::SimpleFileOptions::default();
        writer
            .start_file("xl/worksheets/sheet1.xml", options)
            .unwrap();
        writer.write_all(text.as_bytes()).unwrap();
        writer.finish().unwrap().into_inner()
    }

    fn refused(text: &str) -> String {
        check(&book(text)).map_or_else(|error| format!("{error:#}"), |_| String::new())
    }

    #[test]
    fn a_reference_beyond_the_last_cell_is_refused_with_its_part() {
        for reference in [
            "A99999999999999",
            "ZZZZZZZZZZZZZZZ1",
            "A4294967297",
            "A1048577",
            "XFE1",
            "AAAAAAAA",
            "99999999999",
            "a1:B99999999999",
        ] {
            for tag in [
                format!("<c r=\"{reference}\">"),
                format!("<x:c s = '1' r = '{reference}' />"),
                format!("<row r='{reference}'>"),
                format!("<dimension\n ref=\"{reference}\"/>"),
                format!("<!-- don't --><![CDATA[<c r='A']]><c a='>' r='{reference}'/>"),
            ] {
                let shown = refused(&tag);
                assert!(
                    shown.contains("part xl/worksheets/sheet1.xml: cell "),
                    "{tag}: {shown}"
                );
                assert!(shown.contains("1048576"), "{shown}");
            }
        }
        for text in [
            "<c r='XFD1048576'/>",
            "<row r='1'/><c r='A1' s='9999999999'/>",
            "<!-- <c r='A99999999999'/> --><f r='A99999999999'/>",
            "",
            "<",
            "<c r=",
        ] {
            assert_eq!(refused(text), "", "{text}");
        }
    }

    #[test]
    fn more_entries_of_a_list_than_are_kept_are_refused_with_part_and_limit() {
        for (name, most) in MOST_OF_LIST
            .into_iter()
            .filter(|(_, most)| *most <= 100_000)
        {
            let name = String::from_utf8_lossy(name);
            for entry in [format!("<{name}/>"), format!("<x:{name} a='1'></x:{name}>")] {
                assert_eq!(refused(&entry.repeat(usize::try_from(most).unwrap())), "");
                let many = entry.repeat(usize::try_from(most).unwrap() + 1);
                let words =
                    format!("part xl/worksheets/sheet1.xml: more than {most} entries <{name}>");
                let shown = refused(&many);
                assert!(shown.contains(&words), "{shown}");
            }
        }
    }

    #[test]
    fn what_unpacks_to_more_than_is_read_is_refused_whatever_the_directory_states() {
        let text = "<a>x</a>".repeat(50_000);
        let mut bytes = book(&text);
        assert!(bytes.len() < 10_000);
        assert!(check_within(&bytes, 400_000).is_ok());
        let words = "part xl/worksheets/sheet1.xml: the file unpacks to more than 399999 bytes";
        let shown = check_within(&bytes, 399_999).unwrap_err().to_string();
        assert!(shown.contains(words), "{shown}");
        // The directory states 1 byte: bytes 24 to 27 of its entry (APPNOTE 4.3.12).
        let entry = bytes
            .windows(4)
            .position(|four| four == b"PK\x01\x02")
            .unwrap();
        bytes[entry + 24..entry + 28].copy_from_slice(&[1, 0, 0, 0]);
        let shown = check_within(&bytes, 399_999).unwrap_err();
        assert!(!format!("{shown:#}").is_empty());
        let long = format!("<a b='{}'/>", "x".repeat(LONGEST_TAG_BYTES));
        assert!(refused(&long).contains("a tag of more than 65536 bytes"));
    }
}
