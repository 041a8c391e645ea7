//! From the bytes of a connection to lines.
//!
//! A line ends at a line feed, with or without a carriage return before it. A line over the limit is not kept:
//! its bytes are counted to its end, and it is handed over as refused with its length. What is no letter of a line is
//! replaced and counted ([`crate::text`]).

use crate::text;

/// What came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Framed<'a> {
    /// A line without its end.
    Line {
        /// The line.
        text: &'a str,
        /// How many of its letters were invalid and were replaced.
        replaced: usize,
    },
    /// A line over the limit.
    TooLong {
        /// Its length, bytes.
        length: usize,
    },
}

/// Makes a line feed of every end of a line in the pieces of a log: of CR LF, of LF, and of CR alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct LineEnds {
    follows_return: bool,
}

impl LineEnds {
    /// Takes the next piece.
    pub fn unify(&mut self, bytes: &mut Vec<u8>) {
        bytes.retain_mut(|byte| {
            let is_return = *byte == b'\r';
            let follows = std::mem::replace(&mut self.follows_return, is_return);
            let is_second = follows && *byte == b'\n';
            if is_return {
                *byte = b'\n';
            }
            !is_second
        });
    }
}

/// Cuts bytes into lines.
#[derive(Clone, Debug)]
pub struct Lines {
    limit: usize,
    kept: Vec<u8>,
    length: usize,
}

impl Lines {
    /// For lines of at most `limit` bytes.
    #[must_use]
    pub const fn new(limit: usize) -> Self {
        Self {
            limit,
            kept: Vec::new(),
            length: 0,
        }
    }

    /// Drops a line that has begun and returns its length, bytes.
    pub fn restart(&mut self) -> usize {
        self.kept.clear();
        std::mem::take(&mut self.length)
    }

    /// Hands over a last line that has no end.
    pub fn finish(&mut self, take: impl FnMut(Framed<'_>)) {
        if self.length > 0 {
            self.receive(b"\n", take);
        }
    }

    /// Takes bytes and hands over every line that ends in them.
    pub fn receive(&mut self, bytes: &[u8], mut take: impl FnMut(Framed<'_>)) {
        let mut pieces = bytes.split(|byte| *byte == b'\n').peekable();
        while let Some(piece) = pieces.next() {
            self.length += piece.len();
            if self.length <= self.limit {
                self.kept.extend_from_slice(piece);
            }
            if pieces.peek().is_none() {
                return;
            }
            let line = self.kept.strip_suffix(b"\r").unwrap_or(&self.kept);
            if self.length > self.limit {
                let length = self.length;
                take(Framed::TooLong { length });
            } else {
                let line = text::utf8(line);
                take(Framed::Line {
                    text: &line.text,
                    replaced: line.replaced,
                });
            }
            self.restart();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn framed(limit: usize, chunks: &[&[u8]]) -> Vec<String> {
        let mut lines = Lines::new(limit);
        let mut found = Vec::new();
        for chunk in chunks {
            lines.receive(chunk, |framed| found.push(format!("{framed:?}")));
        }
        found
    }

    #[test]
    fn lines_are_whole_however_they_come() {
        let found = framed(10, &[b"a|", b"b\r", b"\nc\n\nd"]);
        let line = |text: &str| format!("Line {{ text: {text:?}, replaced: 0 }}");
        assert_eq!(found, [line("a|b"), line("c"), line("")]);
    }

    #[test]
    fn a_line_over_the_limit_is_refused_with_its_length_and_the_next_is_read() {
        let found = framed(4, &[b"12345", b"678\nab\na\xff\xfe\n"]);
        assert_eq!(
            found,
            [
                "TooLong { length: 8 }",
                "Line { text: \"ab\", replaced: 0 }",
                "Line { text: \"a\u{fffd}\u{fffd}\", replaced: 2 }"
            ]
        );
    }

    #[test]
    fn every_end_of_a_line_of_a_log_is_a_line_feed_however_it_comes() {
        let whole = b"a\rb\r\nc\nd\r\re\n\r\nf\r";
        for piece in 1..=whole.len() {
            let (mut ends, mut found) = (LineEnds::default(), Vec::new());
            for piece in whole.chunks(piece) {
                let mut bytes = piece.to_vec();
                ends.unify(&mut bytes);
                found.extend(bytes);
            }
            assert_eq!(found, b"a\nb\nc\nd\n\ne\n\nf\n", "pieces of {piece}");
        }
    }

    proptest! {
        #[test]
        fn prop_cuts_in_the_stream_change_no_line(
            bytes in proptest::collection::vec(prop_oneof![Just(b'\n'), any::<u8>()], 0..200),
            cut in 0_usize..200,
        ) {
            let (front, back) = bytes.split_at(cut.min(bytes.len()));
            prop_assert_eq!(framed(16, &[&bytes]), framed(16, &[front, back]));
        }
    }
}
