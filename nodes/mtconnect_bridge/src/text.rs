//! From bytes of any encoding to text: nothing is lost for one letter.
//!
//! A byte order mark says UTF-8 or UTF-16, an XML declaration may say Latin-1; everything else is taken for UTF-8.
//! What is no letter then (and what XML and a topic cannot hold) becomes U+FFFD and is counted.

use std::borrow::Cow;

/// What stands for a byte that is no letter.
pub const REPLACED: char = char::REPLACEMENT_CHARACTER;

/// Text, and how many of its letters were replaced.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Decoded<'a> {
    /// The text, without a byte order mark.
    pub text: Cow<'a, str>,
    /// How many letters stand for invalid ones.
    pub replaced: usize,
}

/// Reads one line or text of an adapter.
#[must_use]
pub fn utf8(bytes: &[u8]) -> Decoded<'_> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let is_plain = |text: &str| text.chars().all(is_letter);
    match std::str::from_utf8(bytes) {
        Ok(text) if is_plain(text) => Decoded {
            text: Cow::Borrowed(text),
            replaced: 0,
        },
        _ => cleaned(&lossy(bytes)),
    }
}

/// The encoding of a log.
#[derive(Clone, Copy, Debug)]
enum Encoding {
    Utf8,
    Utf16(fn([u8; 2]) -> u16),
}

/// Turns the bytes of a log, piece by piece, into UTF-8 by their byte order mark; what is no letter of UTF-8 stays.
#[derive(Clone, Debug, Default)]
pub struct Transcoder {
    encoding: Option<Encoding>,
    kept: Vec<u8>,
}

impl Transcoder {
    /// Takes the next piece; with `is_last`, half a letter at its end is invalid.
    pub fn take(&mut self, bytes: &[u8], is_last: bool) -> Vec<u8> {
        self.kept.extend_from_slice(bytes);
        let encoding = match self.encoding {
            Some(encoding) => encoding,
            None if self.kept.len() < 2 && !is_last => return Vec::new(),
            None => {
                let (encoding, mark) = match self.kept.as_slice() {
                    [0xff, 0xfe, ..] => (Encoding::Utf16(u16::from_le_bytes), 2),
                    [0xfe, 0xff, ..] => (Encoding::Utf16(u16::from_be_bytes), 2),
                    _ => (Encoding::Utf8, 0),
                };
                self.kept.drain(..mark);
                *self.encoding.insert(encoding)
            }
        };
        match encoding {
            Encoding::Utf8 => std::mem::take(&mut self.kept),
            Encoding::Utf16(order) => self.pairs(order, is_last),
        }
    }

    fn pairs(&mut self, order: fn([u8; 2]) -> u16, is_last: bool) -> Vec<u8> {
        let mut units: Vec<u16> = self
            .kept
            .chunks_exact(2)
            .map(|pair| order([pair[0], pair[1]]))
            .collect();
        let is_half = |unit: &u16| (0xd800..0xdc00).contains(unit);
        if !is_last {
            // The other half may come with the next piece.
            units.pop_if(|unit| is_half(unit));
        }
        self.kept.drain(..2 * units.len());
        if is_last && !self.kept.is_empty() {
            self.kept.clear();
            units.push(0xfffd);
        }
        let letters = char::decode_utf16(units).map(|letter| letter.unwrap_or(REPLACED));
        letters.collect::<String>().into_bytes()
    }
}

/// Reads a file or a document, which may say its encoding.
#[must_use]
pub fn decode(bytes: &[u8]) -> Decoded<'_> {
    let pairs = |order: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks(2).map(|pair| match pair {
            [a, b] => order([*a, *b]),
            // A cut file: half a letter is invalid.
            _ => 0xfffd,
        });
        let text: Vec<char> = char::decode_utf16(units)
            .map(|letter| letter.unwrap_or(REPLACED))
            .collect();
        cleaned(&text)
    };
    match bytes {
        [0xff, 0xfe, ..] => pairs(u16::from_le_bytes),
        [0xfe, 0xff, ..] => pairs(u16::from_be_bytes),
        _ if is_latin(bytes) => cleaned(&bytes.iter().copied().map(char::from).collect::<Vec<_>>()),
        _ => utf8(bytes),
    }
}

/// Whether an XML declaration says Latin-1 (or Windows' form of it).
fn is_latin(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(200)];
    let head = String::from_utf8_lossy(head).to_ascii_lowercase();
    let Some((declaration, _)) = head.trim_start().split_once("?>") else {
        return false;
    };
    let says = |name: &str| declaration.contains(name);
    declaration.starts_with("<?xml")
        && [
            "iso-8859-1\"",
            "iso-8859-1'",
            "windows-1252",
            "latin1",
            "latin-1",
        ]
        .into_iter()
        .any(says)
}

fn lossy(bytes: &[u8]) -> Vec<char> {
    let chunks = bytes.utf8_chunks().flat_map(|chunk| {
        let broken = (!chunk.invalid().is_empty()).then_some(REPLACED);
        chunk.valid().chars().chain(broken)
    });
    chunks.collect()
}

/// XML has no other letters below a space, and a text on the wire ends at a NUL.
fn is_letter(letter: char) -> bool {
    let is_control = letter < ' ' && !"\t\n\r".contains(letter);
    !is_control && letter != REPLACED && letter != '\u{fffe}' && letter != '\u{ffff}'
}

fn cleaned(letters: &[char]) -> Decoded<'static> {
    let replaced = letters.iter().filter(|letter| !is_letter(**letter)).count();
    let plain = letters.iter().map(|letter| {
        if is_letter(*letter) {
            *letter
        } else {
            REPLACED
        }
    });
    Decoded {
        text: Cow::Owned(plain.collect()),
        replaced,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(bytes: &[u8]) -> (String, usize) {
        let decoded = decode(bytes);
        (decoded.text.into_owned(), decoded.replaced)
    }

    #[test]
    fn one_byte_that_is_no_letter_costs_one_letter() {
        let wide = |text: &str, order: fn(u16) -> [u8; 2]| -> Vec<u8> {
            text.encode_utf16().flat_map(order).collect()
        };
        let plain = ("a|ö\r\n".to_owned(), 0);
        assert_eq!(read("a|ö\r\n".as_bytes()), plain);
        assert_eq!(read("\u{feff}a|ö\r\n".as_bytes()), plain);
        assert_eq!(read(&wide("\u{feff}a|ö\r\n", u16::to_le_bytes)), plain);
        assert_eq!(read(&wide("\u{feff}a|ö\r\n", u16::to_be_bytes)), plain);
        assert_eq!(read(b"a|\xf6 b"), ("a|\u{fffd} b".to_owned(), 1));
        assert_eq!(read(b"a\0b\x01"), ("a\u{fffd}b\u{fffd}".to_owned(), 2));
        assert_eq!(read(b"\xff\xfea\0b"), ("a\u{fffd}".to_owned(), 1));
        let latin = b"<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><a>\xf6</a>";
        assert!(read(latin).0.ends_with("<a>ö</a>"));
        assert_eq!(read(b""), (String::new(), 0));
    }

    proptest! {
        #[test]
        fn prop_pieces_of_a_log_are_the_text_of_the_whole(
            letters in "[a|ö\u{10400}\n]{0,40}",
            tail in proptest::collection::vec(any::<u8>(), 0..6),
            piece in 1_usize..7,
            encoding in 0_usize..3,
        ) {
            let marked = format!("\u{feff}{letters}");
            let mut bytes: Vec<u8> = match encoding {
                0 => letters.into_bytes(),
                1 => marked.encode_utf16().flat_map(u16::to_le_bytes).collect(),
                _ => marked.encode_utf16().flat_map(u16::to_be_bytes).collect(),
            };
            bytes.extend(tail);
            let mut transcoder = Transcoder::default();
            let mut found: Vec<u8> = bytes
                .chunks(piece)
                .flat_map(|piece| transcoder.take(piece, false))
                .collect();
            found.extend(transcoder.take(&[], true));
            prop_assert_eq!(utf8(&found).text, decode(&bytes).text);
        }

        #[test]
        fn prop_every_byte_string_is_text(bytes in proptest::collection::vec(any::<u8>(), 0..80)) {
            let decoded = decode(&bytes);
            let seen = decoded.text.chars().filter(|letter| *letter == REPLACED).count();
            prop_assert_eq!(seen, decoded.replaced);
            prop_assert!(decoded.text.len() <= 3 * bytes.len());
        }
    }
}
