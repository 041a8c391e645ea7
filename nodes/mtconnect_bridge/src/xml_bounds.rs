//! Bounds of an XML text, checked in one pass before it is parsed.
//!
//! The parser compares each attribute of an element with all those before it, looks every prefix up among all that are
//! declared, and copies a text for each section that is joined to it: its time grows with the square of these. It also makes
//! room for as many elements and attributes as a text has `<` and `=`. Documents of machines and launch files have a few of
//! each; a text that has more is refused with its line and column.

/// Attributes of one element.
pub const ATTRIBUTES: usize = 256;
/// Elements within each other.
pub const DEPTH: usize = 128;
/// Prefixes that are declared around one place.
pub const PREFIXES: usize = 64;
/// Declarations of prefixes in all.
pub const DECLARATIONS: usize = 20_000;
/// Sections of raw text (`<![CDATA[`) between two tags.
pub const SECTIONS: usize = 100;
/// Tags, comments and sections in all: `<` in the text.
pub const TAGS: usize = 1_000_000;
/// `=` in the text.
pub const EQUALS: usize = 2_000_000;

/// What a text has more of than is read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Beyond {
    /// It is too long.
    #[error("{length} bytes of XML: must be at most {most}")]
    Length {
        /// Its length.
        length: usize,
        /// The limit.
        most: usize,
    },
    /// It has too many of something.
    #[error("{line}:{column}: more than {most} {what}, the most that is read")]
    Count {
        /// Line of the first that is too many, from 1.
        line: usize,
        /// Its column, from 1.
        column: usize,
        /// The limit.
        most: usize,
        /// What it has too many of.
        what: &'static str,
    },
}

/// Checks a text.
///
/// # Errors
/// What it has more of than is read, with the limit, and line and column where it is not the length.
pub fn check(text: &str, most_bytes: usize) -> Result<(), Beyond> {
    if text.len() > most_bytes {
        return Err(Beyond::Length {
            length: text.len(),
            most: most_bytes,
        });
    }
    let mut scan = Scan::default();
    let checked = count(text, '<', TAGS, "tags")
        .and_then(|()| count(text, '=', EQUALS, "equals signs"))
        .and_then(|()| scan.over(text));
    checked.map_err(|TooMany { at, most, what }| {
        let before = text.get(..at).unwrap_or_default();
        let line = before.rfind('\n').map_or(before, |end| &before[end + 1..]);
        Beyond::Count {
            line: before.matches('\n').count() + 1,
            column: line.chars().count() + 1,
            most,
            what,
        }
    })
}

/// What there is too much of, and where.
struct TooMany {
    at: usize,
    most: usize,
    what: &'static str,
}

fn count(text: &str, letter: char, most: usize, what: &'static str) -> Result<(), TooMany> {
    match text.match_indices(letter).nth(most) {
        Some((at, _)) => Err(TooMany { at, most, what }),
        None => Ok(()),
    }
}

/// What one opening tag has.
#[derive(Default)]
struct Tag {
    /// Bytes from its `<` on.
    length: usize,
    attributes: usize,
    declarations: usize,
    is_empty: bool,
}

#[derive(Default)]
struct Scan {
    /// Declarations of each element that is open.
    open: Vec<usize>,
    in_scope: usize,
    declarations: usize,
    sections: usize,
}

impl Scan {
    fn over(&mut self, text: &str) -> Result<(), TooMany> {
        let mut at = 0;
        while let Some(found) = text.get(at..).and_then(|rest| rest.find('<')) {
            at += found;
            let rest = &text[at..];
            let to = |end: &str| rest.find(end).map_or(rest.len(), |found| found + end.len());
            at += if rest.starts_with("<!--") {
                to("-->")
            } else if rest.starts_with("<![CDATA[") {
                self.sections += 1;
                bounded(
                    at,
                    self.sections,
                    SECTIONS,
                    "sections of raw text between two tags",
                )?;
                to("]]>")
            } else if rest.starts_with("<?") {
                to("?>")
            } else if rest.starts_with("</") {
                self.close();
                to(">")
            } else {
                let tag = tag(rest);
                if opens(rest) {
                    self.open(at, &tag)?;
                }
                tag.length
            };
        }
        Ok(())
    }

    fn close(&mut self) {
        self.sections = 0;
        self.in_scope -= self.open.pop().unwrap_or(0);
    }

    fn open(&mut self, at: usize, tag: &Tag) -> Result<(), TooMany> {
        self.sections = 0;
        self.declarations += tag.declarations;
        bounded(at, tag.attributes, ATTRIBUTES, "attributes of one element")?;
        bounded(
            at,
            self.declarations,
            DECLARATIONS,
            "declarations of prefixes",
        )?;
        let in_scope = self.in_scope + tag.declarations;
        bounded(at, in_scope, PREFIXES, "prefixes declared around one place")?;
        bounded(at, self.open.len() + 1, DEPTH, "elements within each other")?;
        if !tag.is_empty {
            self.in_scope = in_scope;
            self.open.push(tag.declarations);
        }
        Ok(())
    }
}

fn bounded(at: usize, n: usize, most: usize, what: &'static str) -> Result<(), TooMany> {
    if n > most {
        return Err(TooMany { at, most, what });
    }
    Ok(())
}

/// Whether a `<` begins an element, and not a letter of a text.
fn opens(rest: &str) -> bool {
    let first = rest.chars().nth(1);
    first.is_some_and(|letter| letter.is_alphabetic() || "_:".contains(letter))
}

/// Looks over a tag up to its end, or to a `<` that may not stand in it.
fn tag(rest: &str) -> Tag {
    let mut tag = Tag::default();
    let mut quote = None;
    let (mut word, mut is_in_word, mut last) = (0, false, b'<');
    let bytes = rest.as_bytes();
    tag.length = bytes.len();
    for (at, byte) in bytes.iter().copied().enumerate().skip(1) {
        match (quote, byte) {
            (_, b'<') => {
                tag.length = at;
                break;
            }
            (Some(open), _) if byte == open => (quote, is_in_word) = (None, false),
            (Some(_), _) => {}
            (None, b'>') => {
                tag.length = at + 1;
                tag.is_empty = last == b'/';
                break;
            }
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'=') => {
                tag.attributes += 1;
                let name = &bytes[word..at];
                tag.declarations += usize::from(name.starts_with(b"xmlns"));
                is_in_word = false;
            }
            (None, b' ' | b'\t' | b'\n' | b'\r') => is_in_word = false,
            (None, _) if !is_in_word => (word, is_in_word) = (at, true),
            (None, _) => {}
        }
        last = byte;
    }
    tag
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST: usize = 16 << 20;

    fn refused(text: &str) -> String {
        match check(text, MOST) {
            Ok(()) => "read".to_owned(),
            Err(beyond) => beyond.to_string(),
        }
    }

    fn attributes(n: usize) -> String {
        (0..n)
            .map(|k| format!(" a{k} = \"<=>\"").replace('<', ""))
            .collect()
    }

    #[test]
    fn what_the_parser_needs_the_square_of_is_refused_with_its_place() {
        let deep = |n: usize| format!("{}{}", "<a>".repeat(n), "</a>".repeat(n));
        let sections = |n: usize| format!("<a>{}</a>", "<![CDATA[x]]>".repeat(n));
        let prefixes = |n: usize| {
            let each = |k: usize| format!("<b xmlns:p{k}='u'>");
            (0..n).map(each).collect::<String>()
        };
        let one = |n: usize| {
            let each = |k: usize| format!("<b xmlns:p{k} = \"u\"/>");
            format!("<a>{}</a>", (0..n).map(each).collect::<String>())
        };
        for (text, words) in [
            (
                format!("<a>\n <b{}/></a>", attributes(257)),
                "2:2: more than 256 attributes of one element",
            ),
            (
                format!("<b{}>", attributes(60_000)),
                "1:1: more than 256 attributes",
            ),
            (deep(129), "1:385: more than 128 elements within each other"),
            (deep(200_000), "more than 128 elements within each other"),
            (
                sections(101),
                "more than 100 sections of raw text between two tags",
            ),
            (
                prefixes(65),
                "more than 64 prefixes declared around one place",
            ),
            (one(20_001), "more than 20000 declarations of prefixes"),
            ("<a/>".repeat(1_000_001), "more than 1000000 tags"),
            (
                "=".repeat(2_000_001),
                "1:2000001: more than 2000000 equals signs",
            ),
            ("<".repeat(1_000_001), "more than 1000000 tags"),
            (
                " ".repeat(MOST + 1),
                "16777217 bytes of XML: must be at most 16777216",
            ),
        ] {
            let shown = refused(&text);
            assert!(shown.contains(words), "{words}: {shown}");
        }
        for text in [
            format!("<a{}/>", attributes(256)),
            deep(128),
            format!("{}{}", sections(100), sections(100)),
            prefixes(64),
            one(20_000),
            "<a/>".repeat(1_000_000),
            "<a b='>'><!-- don't <b> --><?x <y ?><![CDATA[<c d=\"]]></a>".repeat(500),
            "1 < 2 ".repeat(1_000),
        ] {
            assert_eq!(refused(&text), "read", "{}", &text[..text.len().min(80)]);
        }
    }

    #[test]
    fn no_text_makes_the_check_fail_otherwise() {
        let pieces = [
            "<",
            "a",
            " b",
            "=",
            "'",
            "\"",
            "/",
            ">",
            "<!--",
            "-->",
            "<![CDATA[",
            "]]>",
            "<?",
            "?>",
            "</a>",
            "é",
            "\n",
        ];
        for first in pieces {
            for second in pieces {
                for third in pieces {
                    assert_eq!(check(&[first, second, third].concat(), MOST), Ok(()));
                }
            }
        }
    }
}
