//! Errors of XML in plain words, and letters that make a text none.

use metrology::yaml::shown;

use crate::text::REPLACED;
use crate::xml_bounds::{self, Beyond};

/// Why a text cannot be read as XML.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum XmlFlaw {
    /// It is beyond a bound.
    #[error("{0}")]
    Beyond(Beyond),
    /// It is no XML: in own words, with line and column.
    #[error("{0}")]
    NotXml(String),
}

/// Parses a text of at most `most_bytes` bytes within the bounds of [`xml_bounds`]. A document type is refused.
///
/// # Errors
/// With line and column, when it is beyond a bound or no XML.
pub fn parse(text: &str, most_bytes: usize) -> Result<roxmltree::Document<'_>, XmlFlaw> {
    xml_bounds::check(text, most_bytes).map_err(XmlFlaw::Beyond)?;
    roxmltree::Document::parse(text).map_err(|error| XmlFlaw::NotXml(in_own_words(&error, text)))
}

/// What is wrong with a text that is no XML, after its line and column: `2:7: </b> closes <a>`.
#[must_use]
pub fn in_own_words(error: &roxmltree::Error, text: &str) -> String {
    use roxmltree::Error;
    let what = match error {
        Error::DtdDetected => "a document type (`<!DOCTYPE`) is not read: remove it".to_owned(),
        Error::NoRootNode => "no element stands there".to_owned(),
        Error::UnclosedRootNode => "the text ends inside of an element".to_owned(),
        Error::UnexpectedCloseTag(open, close, _) => {
            format!("</{}> closes <{}>", shown(close), shown(open))
        }
        Error::DuplicatedAttribute(name, _) => {
            format!("the attribute {} stands there twice", shown(name))
        }
        Error::UnknownEntityReference(name, _) => format!(
            "&{}; is not defined: write &amp; for an ampersand",
            shown(name)
        ),
        Error::MalformedEntityReference(_) => {
            "an ampersand begins no reference, or one to a letter that may not stand in XML: write &amp; for an ampersand".to_owned()
        },
        Error::UnknownNamespace(prefix, _) => {
            format!("the prefix {} is not declared", shown(prefix))
        }
        Error::NodesLimitReached => "it has more elements than are read".to_owned(),
        Error::AttributesLimitReached => "it has more attributes than are read".to_owned(),
        Error::NonXmlChar(letter, _) => {
            format!("U+{:04X} may not stand in XML", u32::from(*letter))
        }
        _ => "the text is no XML: check tags, quotes and brackets".to_owned(),
    };
    let at = error.pos();
    let (line, column) = match error {
        // Of a text that is cut the library names no place.
        Error::UnclosedRootNode => end_of(text),
        _ => (at.row as usize, at.col as usize),
    };
    format!("{line}:{column}: {what}")
}

/// Line and column behind a text.
fn end_of(text: &str) -> (usize, usize) {
    let last = text.rsplit('\n').next().unwrap_or(text);
    let line = text.bytes().filter(|byte| *byte == b'\n').count() + 1;
    (line, last.chars().count() + 1)
}

/// Longest reference that is looked for, bytes.
const REFERENCE_LIMIT: usize = 12;

/// A text in which each letter that may not stand there is U+FFFD, and how many these were: an ampersand that begins no
/// reference, a reference to a letter that XML has not, a `<` that begins no tag.
#[must_use]
pub fn mended(text: &str) -> (String, usize) {
    let (mut found, mut count, mut left) = (String::with_capacity(text.len()), 0, text);
    while let Some(at) = left.find(['&', '<']) {
        let (front, behind) = left.split_at(at);
        let (length, may_stand) = piece(behind);
        let (piece, rest) = behind.split_at(length);
        found.push_str(front);
        if may_stand {
            found.push_str(piece);
        } else {
            found.push(REPLACED);
            count += 1;
        }
        left = rest;
    }
    found.push_str(left);
    (found, count)
}

/// How many bytes from a `<` or an ampersand on belong together, and whether they may stand there.
fn piece(text: &str) -> (usize, bool) {
    for (begin, end) in [("<![CDATA[", "]]>"), ("<!--", "-->")] {
        if text.starts_with(begin) {
            let length = text.find(end).map_or(text.len(), |at| at + end.len());
            return (length, true);
        }
    }
    match text.strip_prefix('<') {
        Some(behind) => {
            let opens = |letter: char| letter.is_alphabetic() || "_:/!?".contains(letter);
            (1, behind.starts_with(opens))
        }
        None => reference(text),
    }
}

fn reference(text: &str) -> (usize, bool) {
    let end = text.bytes().take(REFERENCE_LIMIT).position(|b| b == b';');
    let Some(end) = end else {
        return (1, false);
    };
    let name = &text[1..end];
    let Some(number) = name.strip_prefix('#') else {
        let is_known = ["amp", "lt", "gt", "quot", "apos"].contains(&name);
        return if is_known {
            (end + 1, true)
        } else {
            (1, false)
        };
    };
    let (digits, radix) = match number.strip_prefix('x') {
        Some(digits) => (digits, 16),
        None => (number, 10),
    };
    if digits.is_empty() || !digits.chars().all(|digit| digit.is_digit(radix)) {
        return (1, false);
    }
    let code = u32::from_str_radix(digits, radix).ok();
    let letter = code.and_then(char::from_u32);
    (end + 1, letter.is_some_and(is_xml_letter))
}

const fn is_xml_letter(letter: char) -> bool {
    matches!(
        letter,
        '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..='\u{10ffff}'
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By XML 1.0, productions 2 (Char), 66 (CharRef), 67 (Reference) and 20 (CData).
    #[test]
    fn letters_that_may_not_stand_in_xml_are_replaced_and_others_stay() {
        for (text, wanted, count) in [
            (
                "<a b='&quot;'>&amp;&#65;&#x41;</a>",
                "<a b='&quot;'>&amp;&#65;&#x41;</a>",
                0,
            ),
            ("<a>A&B</a>", "<a>A\u{fffd}B</a>", 1),
            ("<a>A&#1;B&#x0;</a>", "<a>A\u{fffd}B\u{fffd}</a>", 2),
            ("<a>&#xD800;&#x110000;</a>", "<a>\u{fffd}\u{fffd}</a>", 2),
            (
                "<a>&nbsp;&;&#;</a>",
                "<a>\u{fffd}nbsp;\u{fffd};\u{fffd}#;</a>",
                3,
            ),
            (
                "<a>1 < 2 & 3</a>&",
                "<a>1 \u{fffd} 2 \u{fffd} 3</a>\u{fffd}",
                3,
            ),
            (
                "<a><![CDATA[A&B<1]]>&</a>",
                "<a><![CDATA[A&B<1]]>\u{fffd}</a>",
                1,
            ),
            ("<?xml?><!-- & --><a/>", "<?xml?><!-- & --><a/>", 0),
        ] {
            assert_eq!(mended(text), (wanted.to_owned(), count), "{text}");
        }
    }

    #[test]
    fn a_reference_to_a_control_letter_is_no_ampersand_that_stands_alone() {
        let text = "<a>&#1;</a>";
        let error = roxmltree::Document::parse(text).unwrap_err();
        let words = in_own_words(&error, text);
        assert!(
            words.contains("a letter that may not stand in XML"),
            "{words}"
        );
    }
}
