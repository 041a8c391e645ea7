//! From the bytes of a connection to lines.
//!
//! A line ends at a line feed, with or without a carriage return before it. A line over the limit is not kept:
//! its bytes are counted to its end, and it is handed over as refused with its length.

/// What came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Framed<'a> {
    /// A line without its end.
    Line(&'a str),
    /// A line that is no UTF-8.
    NotText {
        /// Its length, bytes.
        length: usize,
    },
    /// A line over the limit.
    TooLong {
        /// Its length, bytes.
        length: usize,
    },
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

    /// Forgets a line that has begun.
    pub fn restart(&mut self) {
        self.kept.clear();
        self.length = 0;
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
            } else if let Ok(line) = std::str::from_utf8(line) {
                take(Framed::Line(line));
            } else {
                let length = line.len();
                take(Framed::NotText { length });
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
        assert_eq!(found, ["Line(\"a|b\")", "Line(\"c\")", "Line(\"\")"]);
    }

    #[test]
    fn a_line_over_the_limit_is_refused_with_its_length_and_the_next_is_read() {
        let found = framed(4, &[b"12345", b"678\nab\n\xff\xfe\n"]);
        assert_eq!(
            found,
            [
                "TooLong { length: 8 }",
                "Line(\"ab\")",
                "NotText { length: 2 }"
            ]
        );
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
