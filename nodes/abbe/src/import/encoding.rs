//! The text of a table in whatever encoding: UTF-8, UTF-16 with a byte order mark, or Windows-1252, which holds Latin-1.
//!
//! Old programs write `Position µm` and `Temperatur °C` with one byte a letter. Bytes that are not UTF-8 are therefore taken for
//! Windows-1252, each by itself; letters of UTF-8 beside them stay. A byte that Windows-1252 has no letter for makes the file no text.

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use encoding_rs::{Encoding, UTF_16BE, UTF_16LE, WINDOWS_1252};
use metrology::text::{self, TextError};
use node_runtime::text_file::{self, Comments};

/// A text, and what was done where it was not UTF-8.
#[derive(Debug, PartialEq)]
pub struct Decoded {
    /// Its lines, each ended by a line feed.
    pub text: String,
    /// The encoding, and where it showed.
    pub note: Option<String>,
}

/// Reads the file of a table.
///
/// # Errors
/// When it cannot be read, or holds bytes that are no letters.
pub fn read(path: &Path) -> Result<Decoded> {
    let bytes = text_file::bytes(path)?;
    decode(&bytes).map_err(|error| anyhow!("{}:{error:#}", path.display()))
}

/// The text of some bytes.
///
/// # Errors
/// With line and column of a byte that is no letter.
pub fn decode(bytes: &[u8]) -> Result<Decoded> {
    let not_utf8 = match text::decode(bytes, Comments::Csv) {
        Ok(text) => return Ok(Decoded { text, note: None }),
        Err(not_utf8) => not_utf8,
    };
    let (text, note) = match not_utf8 {
        TextError::NotUtf8 { line, column, byte } => (
            single_bytes(bytes).context(not_utf8)?,
            format!(
                "encoding: line {line}, column {column}: byte 0x{byte:02X} is not UTF-8: such bytes were read as Windows-1252 (Latin-1): save \
                 the file as UTF-8 where a letter is another one"
            ),
        ),
        TextError::Utf16 => {
            let is_little = bytes.starts_with(&[0xFF, 0xFE]);
            let encoding: &Encoding = if is_little { UTF_16LE } else { UTF_16BE };
            let (text, _, is_damaged) = encoding.decode(bytes);
            if is_damaged {
                bail!("1:1: the file is UTF-16 and holds half a letter: save it as UTF-8");
            }
            let name = encoding.name();
            (
                text.into_owned(),
                format!("encoding: read as {name}, by the byte order mark in line 1, column 1"),
            )
        }
        TextError::Utf32 => return Err(not_utf8.into()),
    };
    let text = text::decode(text.as_bytes(), Comments::Csv)?;
    let note = Some(note);
    Ok(Decoded { text, note })
}

/// A text of which bytes that are not UTF-8 are letters of Windows-1252.
fn single_bytes(bytes: &[u8]) -> Result<String> {
    let mut text = String::with_capacity(bytes.len());
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        let (letters, _) = WINDOWS_1252.decode_without_bom_handling(chunk.invalid());
        text.push_str(&letters);
    }
    // It has no letter for five bytes, and no text has zeros before its end.
    let is_no_letter = |letter: char| letter == '\0' || ('\u{80}'..='\u{9f}').contains(&letter);
    let whole = text.trim_end_matches(['\0', '\u{1a}']);
    if let Some(letter) = whole.chars().find(|letter| is_no_letter(*letter)) {
        bail!(
            "byte 0x{:02X} is no letter of Windows-1252 (Latin-1) either",
            u32::from(letter)
        );
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "n;Position µm;Temperatur °C\r\n1;0,5;20\r\n";
    const LINES: &str = "n;Position µm;Temperatur °C\n1;0,5;20\n";

    fn latin(text: &str) -> Vec<u8> {
        WINDOWS_1252.encode(text).0.into_owned()
    }

    #[test]
    fn a_table_is_read_in_each_encoding_and_the_place_is_said() {
        let wide = |order: fn(u16) -> [u8; 2]| -> Vec<u8> {
            let marked = format!("\u{feff}{TABLE}");
            marked.encode_utf16().flat_map(order).collect()
        };
        for (bytes, words) in [
            (TABLE.as_bytes().to_vec(), None),
            (format!("\u{feff}{TABLE}").into_bytes(), None),
            (
                latin(TABLE),
                Some(
                    "encoding: line 1, column 12: byte 0xB5 is not UTF-8: such bytes were read as Windows-1252",
                ),
            ),
            (
                wide(u16::to_le_bytes),
                Some("encoding: read as UTF-16LE, by the byte order mark"),
            ),
            (wide(u16::to_be_bytes), Some("encoding: read as UTF-16BE")),
        ] {
            let decoded = decode(&bytes).expect("a text");
            assert_eq!(decoded.text, LINES);
            let note = decoded.note.unwrap_or_default();
            assert!(note.starts_with(words.unwrap_or_default()), "{note}");
            assert_eq!(note.is_empty(), words.is_none());
        }
    }

    #[test]
    fn letters_of_both_kinds_and_bytes_in_comments_stay() {
        let mixed = [TABLE.as_bytes(), &latin("2;0,5;20 °C €\n")].concat();
        let decoded = decode(&mixed).expect("a text");
        assert_eq!(decoded.text, format!("{LINES}2;0,5;20 °C €\n"));
        let note = decoded.note.expect("a note");
        assert!(
            note.starts_with("encoding: line 3, column 10: byte 0xB0"),
            "{note}"
        );
        let commented = [b"# \xB5\n".to_vec(), TABLE.into()].concat();
        assert_eq!(decode(&commented).expect("a text").note, None);
    }

    #[test]
    fn what_is_no_text_is_refused_with_its_place() {
        for (bytes, words) in [
            (&b"n;d\n1;\x81\n"[..], "2:3: byte 0x81 is not UTF-8"),
            (b"n;d\n\xB5\0\0;2\n", "2:1: byte 0xB5 is not UTF-8"),
            (
                b"\xFF\xFEn\0;",
                "1:1: the file is UTF-16 and holds half a letter",
            ),
            (b"\xFF\xFE\0\0n\0\0\0", "1:1: the file is UTF-32"),
        ] {
            let refused = format!("{:#}", decode(bytes).expect_err(words));
            assert!(refused.contains(words), "{refused}");
        }
    }
}
