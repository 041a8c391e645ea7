//! Text out of the bytes of a file: UTF-8, with or without a byte order mark, with line ends of any system.
//!
//! A comment may hold any byte: a `µ` or an umlaut of Latin-1 in it is replaced by U+FFFD and harms nothing. Anywhere
//! else a byte that is not UTF-8 would become part of a name or a value, and is refused with its line and column.

use std::borrow::Cow;

/// How comments of a file look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comments {
    /// From `#` at the begin of a line or behind white space, outside of quotes, to the end of the line.
    Yaml,
    /// Whole lines that begin with `#`.
    Csv,
    /// From `(` to `)`, and from `;` to the end of the line.
    Gcode,
    /// From `<!--` to `-->`.
    Xml,
    /// The format has no comments.
    None,
}

/// A byte that is not UTF-8 where it would count.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TextError {
    /// One byte.
    #[error(
        "{line}:{column}: byte 0x{byte:02X} is not UTF-8: save the file as UTF-8 (in comments any byte is allowed)"
    )]
    NotUtf8 {
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
        /// The byte.
        byte: u8,
    },
    /// The whole file is in another encoding.
    #[error("1:1: the file is UTF-16: save it as UTF-8")]
    Utf16,
    /// The same, with four bytes a letter.
    #[error("1:1: the file is UTF-32: save it as UTF-8")]
    Utf32,
}

/// Replaces a byte of a comment that is not UTF-8.
const REPLACEMENT: char = '\u{FFFD}';

/// The text of a file, without a byte order mark, each line ended by `\n` alone.
///
/// # Errors
/// Line and column of the first byte that is not UTF-8 outside of comments.
pub fn decode(bytes: &[u8], comments: Comments) -> Result<String, TextError> {
    if bytes.starts_with(&[0xFF, 0xFE, 0, 0]) || bytes.starts_with(&[0, 0, 0xFE, 0xFF]) {
        return Err(TextError::Utf32);
    }
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err(TextError::Utf16);
    }
    let bytes = with_line_feeds(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes));
    let mut text = String::with_capacity(bytes.len());
    let mut scanner = Scanner::new(comments);
    for chunk in bytes.utf8_chunks() {
        for letter in chunk.valid().chars() {
            scanner.take(letter);
            text.push(letter);
        }
        if let Some(byte) = chunk.invalid().first() {
            if !scanner.is_comment {
                return Err(TextError::NotUtf8 {
                    line: scanner.line,
                    column: scanner.column,
                    byte: *byte,
                });
            }
            scanner.take(REPLACEMENT);
            text.push(REPLACEMENT);
        }
    }
    Ok(text)
}

/// The bytes with every line ended by a line feed alone. A carriage return is no part of another character, in UTF-8
/// as in the encodings that people mistake for it.
fn with_line_feeds(bytes: &[u8]) -> Cow<'_, [u8]> {
    if !bytes.contains(&b'\r') {
        return Cow::Borrowed(bytes);
    }
    let mut ended = Vec::with_capacity(bytes.len());
    for (at, byte) in bytes.iter().enumerate() {
        match byte {
            b'\r' if bytes.get(at + 1) == Some(&b'\n') => {}
            b'\r' => ended.push(b'\n'),
            _ => ended.push(*byte),
        }
    }
    Cow::Owned(ended)
}

/// Where in a text it is, and whether that is within a comment.
struct Scanner {
    comments: Comments,
    line: usize,
    column: usize,
    is_comment: bool,
    /// The quote that is open (YAML).
    quote: Option<char>,
    /// The last characters, newest last.
    before: [char; 3],
}

impl Scanner {
    const fn new(comments: Comments) -> Self {
        Self {
            comments,
            line: 1,
            column: 1,
            is_comment: false,
            quote: None,
            before: ['\n'; 3],
        }
    }

    fn take(&mut self, letter: char) {
        match self.comments {
            Comments::Yaml => self.yaml(letter),
            Comments::Csv if self.column == 1 => self.is_comment = letter == '#',
            Comments::Gcode => self.gcode(letter),
            Comments::Xml => self.xml(letter),
            Comments::Csv | Comments::None => {}
        }
        if letter == '\n' {
            (self.line, self.column) = (self.line + 1, 1);
            self.is_comment &= self.comments == Comments::Xml;
        } else {
            self.column += 1;
        }
        self.before = [self.before[1], self.before[2], letter];
    }

    fn yaml(&mut self, letter: char) {
        let last = self.before[2];
        match (letter, self.quote) {
            _ if self.is_comment => {}
            ('#', None) => self.is_comment = last.is_whitespace(),
            ('"', Some('"')) if last != '\\' => self.quote = None,
            ('\'', Some('\'')) => self.quote = None,
            // A quote within a plain word is a letter of it.
            ('"' | '\'', None) if last.is_whitespace() || "[{,:".contains(last) => {
                self.quote = Some(letter);
            }
            _ => {}
        }
    }

    fn gcode(&mut self, letter: char) {
        // A bracket ends no comment to the end of the line.
        let to_the_end = self.quote == Some(';');
        match letter {
            ';' if !self.is_comment => (self.is_comment, self.quote) = (true, Some(';')),
            '(' => self.is_comment = true,
            ')' if !to_the_end => self.is_comment = false,
            '\n' => self.quote = None,
            _ => {}
        }
    }

    fn xml(&mut self, letter: char) {
        let [a, b, c] = self.before;
        if (a, b, c, letter) == ('<', '!', '-', '-') {
            self.is_comment = true;
        } else if (b, c, letter) == ('-', '-', '>') {
            self.is_comment = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_and_line_ends_of_other_systems_change_nothing() {
        for comments in [
            Comments::Yaml,
            Comments::Csv,
            Comments::Gcode,
            Comments::Xml,
            Comments::None,
        ] {
            for bytes in [
                &b"a: 1\nb: 2\n"[..],
                b"\xEF\xBB\xBFa: 1\nb: 2\n",
                b"a: 1\r\nb: 2\r\n",
                b"\xEF\xBB\xBFa: 1\r\nb: 2\r\n",
                b"a: 1\rb: 2\r",
            ] {
                assert_eq!(decode(bytes, comments).as_deref(), Ok("a: 1\nb: 2\n"));
            }
        }
        assert_eq!(decode(b"\xFF\xFEa\0", Comments::Csv), Err(TextError::Utf16));
    }

    #[test]
    fn any_byte_is_allowed_in_a_comment_and_named_with_its_place_elsewhere() {
        use Comments::{Csv, Gcode, None, Xml, Yaml};
        let good: &[(Comments, &[u8])] = &[
            (Yaml, b"a: 1 # \xB5m\nb: 2\n"),
            (Yaml, b"# gr\xFC\xDFe \"offen\nb: \"c # d\"  # \xB5\n"),
            (Yaml, b"a: it's # \xB5\n"),
            (Csv, b"# \xB5m\nn;x\n1;2\n"),
            (Gcode, b"G1 X1 (\xB5m) F1\n; \xB5 ) \xB5\nM2\n"),
            (Xml, b"<launch><!-- \xB5\n \xB5 --></launch>"),
        ];
        for (comments, bytes) in good {
            let text = decode(bytes, *comments).unwrap();
            assert!(text.contains(REPLACEMENT), "{text}");
        }
        let bad: &[(Comments, &[u8], usize, usize)] = &[
            (Yaml, b"a: 1\nname: \xB5m # c\n", 2, 7),
            (Yaml, b"a: \"x # \xB5\"\n", 1, 9),
            (Yaml, b"a: x#\xB5\n", 1, 6),
            (Yaml, "µ: 1\nä: ".as_bytes(), 0, 0),
            (Csv, b"n;d \xB5m\n", 1, 5),
            (Csv, b"n;x\n1;#\xB5\n", 2, 4),
            (Gcode, b"G1 (a) \xB5\n", 1, 8),
            (Gcode, b"; a\n\xB5\n", 2, 1),
            (Xml, b"<a><!-- --> \xB5</a>", 1, 13),
            (None, b"# \xB5", 1, 3),
            (Yaml, b"a: 1\r\n\xE4: 2\r\n", 2, 1),
            (Yaml, b"a: 1\r\xE4: 2\r", 2, 1),
        ];
        for (comments, bytes, line, column) in bad {
            let found = decode(bytes, *comments);
            if *line == 0 {
                assert!(found.is_ok());
                continue;
            }
            let wanted = format!("{line}:{column}: byte 0x");
            let words = found.unwrap_err().to_string();
            assert!(words.starts_with(&wanted), "{bytes:?}: {words}");
        }
    }
}
