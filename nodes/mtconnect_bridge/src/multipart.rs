//! The parts of an answer that does not end (`multipart/x-mixed-replace`).
//!
//! ```text
//!   --boundary CRLF  headers CRLF  CRLF  document CRLF   again and again
//! ```
//!
//! A part is as long as its `Content-length` says, or reaches to the next boundary where it does not say it. Headers
//! that end in a line feed alone are taken as well.
//!
//! # References
//! \[1\] RFC 2046, 5.1.1.

/// A part, or a whole answer, over this length is refused, bytes: reading one takes about a second at most, and 1,000
/// observations, as asked for by default, have 150 kB.
pub const PART_LIMIT: usize = 4 << 20;
/// A header over this length is none, bytes.
const HEADER_LIMIT: usize = 4096;

/// Why the parts cannot be read on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PartFlaw {
    /// A part is too long.
    #[error(
        "a part of {length} bytes, limit {PART_LIMIT}: ask for fewer observations at a time (agent.count), or for one device (agent.device)"
    )]
    TooLong {
        /// Its length, or what has come of it.
        length: usize,
    },
    /// No boundary where one must be.
    #[error("no boundary within {HEADER_LIMIT} bytes")]
    NoBoundary,
}

/// The boundary in a `Content-Type`, where it is multipart.
#[must_use]
pub fn boundary(content_type: &str) -> Option<&str> {
    let mut parts = content_type.split(';').map(str::trim);
    let kind = parts.next()?.to_ascii_lowercase();
    if !kind.starts_with("multipart/") {
        return None;
    }
    let named = parts.find_map(|part| {
        let (name, value) = part.split_once('=')?;
        name.trim()
            .eq_ignore_ascii_case("boundary")
            .then_some(value.trim())
    })?;
    let plain = named.trim_matches('"');
    (!plain.is_empty()).then_some(plain)
}

/// Cuts an answer into its parts.
#[derive(Clone, Debug)]
pub struct Parts {
    mark: Vec<u8>,
    bytes: Vec<u8>,
    /// Bytes that must be there before the next part is whole.
    least: usize,
    /// Bytes of its body that have been searched for the next boundary, where its length is not said.
    searched: usize,
}

fn find(bytes: &[u8], wanted: &[u8]) -> Option<usize> {
    bytes
        .windows(wanted.len())
        .position(|window| window == wanted)
}

impl Parts {
    /// For parts between `boundary`.
    #[must_use]
    pub fn new(boundary: &str) -> Self {
        Self {
            mark: format!("--{boundary}").into_bytes(),
            bytes: Vec::new(),
            least: 0,
            searched: 0,
        }
    }

    /// Takes bytes and hands over every part that is whole by them.
    ///
    /// # Errors
    /// When what comes is no sequence of parts; the connection is then of no more use.
    pub fn receive(&mut self, bytes: &[u8], mut take: impl FnMut(&[u8])) -> Result<(), PartFlaw> {
        self.bytes.extend_from_slice(bytes);
        if self.bytes.len() < self.least {
            return Ok(());
        }
        let mut used = 0;
        let ended = loop {
            match self.next(used, &mut take) {
                Ok(Some(length)) => {
                    used += length;
                    (self.least, self.searched) = (0, 0);
                }
                Ok(None) => break Ok(()),
                Err(flaw) => break Err(flaw),
            }
        };
        self.bytes.drain(..used);
        ended
    }

    /// Hands over the part that begins at `from` where it is whole, and says how many bytes it took.
    fn next(
        &mut self,
        from: usize,
        take: &mut impl FnMut(&[u8]),
    ) -> Result<Option<usize>, PartFlaw> {
        let bytes = &self.bytes[from..];
        let lost = |length: usize| match length > HEADER_LIMIT {
            true => Err(PartFlaw::NoBoundary),
            false => Ok(None),
        };
        let Some(mark_at) = find(bytes, &self.mark) else {
            return lost(bytes.len());
        };
        let header_at = mark_at + self.mark.len();
        let behind = &bytes[header_at..];
        let head = &behind[..behind.len().min(HEADER_LIMIT)];
        let Some((header_length, body_at)) = header_end(head) else {
            return match behind.len() >= HEADER_LIMIT {
                true => Err(PartFlaw::NoBoundary),
                false => Ok(None),
            };
        };
        let body = &behind[body_at..];
        let told = content_length(&behind[..header_length]);
        // What was searched before is not searched again, but for the begin of a boundary at its end.
        let searched = self.searched.min(body.len());
        let found = || find(&body[searched..], &self.mark).map(|at| searched + at);
        let length = told.or_else(found);
        if let Some(length) = length.filter(|length| *length > PART_LIMIT) {
            return Err(PartFlaw::TooLong { length });
        }
        match length.and_then(|length| body.get(..length)) {
            Some(part) => {
                take(part);
                Ok(Some(header_at + body_at + part.len()))
            }
            None if body.len() > PART_LIMIT => Err(PartFlaw::TooLong { length: body.len() }),
            None => {
                match told {
                    Some(length) => self.least = header_at + body_at + length,
                    None => self.searched = (body.len() + 1).saturating_sub(self.mark.len()),
                }
                Ok(None)
            }
        }
    }
}

/// Where the headers end and where the body begins: behind an empty line.
fn header_end(bytes: &[u8]) -> Option<(usize, usize)> {
    let ends = [&b"\n\r\n"[..], b"\n\n"].map(|end| Some((find(bytes, end)?, end.len())));
    let (at, length) = ends.into_iter().flatten().min()?;
    Some((at, at + length))
}

fn content_length(headers: &[u8]) -> Option<usize> {
    let headers = std::str::from_utf8(headers).ok()?;
    headers.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        let is_length = name.trim().eq_ignore_ascii_case("content-length");
        is_length.then(|| value.trim().parse().ok()).flatten()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ANSWER: &[u8] = b"\r\n--b7\r\nContent-type: text/xml\r\nContent-length: 6\r\n\r\n<a>\r\n\r\r\n--b7\r\nContent-type: text/xml\r\n\r\n<b/>\r\n--b7\r\nContent-length: 4\r\n\r\n<c/>";

    fn parts(chunks: &[&[u8]]) -> Vec<String> {
        let mut parts = Parts::new("b7");
        let mut found = Vec::new();
        for chunk in chunks {
            let take = |part: &[u8]| found.push(String::from_utf8(part.to_vec()).unwrap());
            parts.receive(chunk, take).unwrap();
        }
        found
    }

    #[test]
    fn parts_are_as_long_as_they_say_or_reach_to_the_next_boundary() {
        assert_eq!(parts(&[ANSWER]), ["<a>\r\n\r", "<b/>\r\n", "<c/>"]);
    }

    #[test]
    fn headers_may_end_in_line_feeds_alone() {
        let plain: Vec<u8> = ANSWER
            .iter()
            .copied()
            .filter(|byte| *byte != b'\r')
            .collect();
        let shorter = String::from_utf8(plain).unwrap().replace(": 6", ": 5");
        assert_eq!(parts(&[shorter.as_bytes()]), ["<a>\n\n", "<b/>\n", "<c/>"]);
        let mixed = b"--b7\nContent-length: 4\r\n\r\n<a/>\r\n--b7\r\nContent-length: 4\n\n<b/>";
        assert_eq!(parts(&[mixed]), ["<a/>", "<b/>"]);
    }

    #[test]
    fn the_boundary_may_be_quoted_and_only_multipart_has_one() {
        let kind = "multipart/x-mixed-replace;boundary=b7";
        assert_eq!(boundary(kind), Some("b7"));
        let kind = "Multipart/X-Mixed-Replace; charset=x; Boundary=\"b 7\"";
        assert_eq!(boundary(kind), Some("b 7"));
        assert_eq!(boundary("text/xml;boundary=b7"), None);
        assert_eq!(boundary("multipart/mixed"), None);
    }

    #[test]
    fn a_part_without_end_and_a_stream_without_boundary_are_refused() {
        let mut stream = Parts::new("b7");
        let head = format!("--b7\r\nContent-length: {}\r\n\r\n", PART_LIMIT + 1);
        let refused = stream.receive(head.as_bytes(), |_| {});
        assert_eq!(
            refused,
            Err(PartFlaw::TooLong {
                length: PART_LIMIT + 1
            })
        );
        let words = refused.unwrap_err().to_string();
        assert!(
            words.contains("limit 4194304") && words.contains("agent.count"),
            "{words}"
        );
        let mut stream = Parts::new("b7");
        assert_eq!(
            stream.receive(&[b'x'; 5000], |_| {}),
            Err(PartFlaw::NoBoundary)
        );
    }

    proptest! {
        #[test]
        fn prop_cuts_in_the_stream_change_no_part(cut in 0..ANSWER.len()) {
            let (front, back) = ANSWER.split_at(cut);
            prop_assert_eq!(parts(&[front, back]), parts(&[ANSWER]));
        }

        #[test]
        fn prop_no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let mut stream = Parts::new("-");
            let _ = stream.receive(&bytes, |_| {});
        }
    }

    /// 2 MiB in pieces of 1 kB, with and without a length, and 5,000 small parts in one piece.
    #[test]
    fn bytes_are_searched_once_however_many_pieces_they_come_in() {
        let body = vec![b'x'; 2 << 20];
        for length in [format!("Content-length: {}\r\n", body.len()), String::new()] {
            let mut parts = Parts::new("a1");
            let mut taken = vec![];
            let head = format!("--a1\r\n{length}\r\n");
            let whole = [head.as_bytes(), &body, b"--a1\r\n"].concat();
            let mut come = 0;
            for piece in whole.chunks(1_000) {
                parts.receive(piece, |part| taken.push(part.len())).unwrap();
                come += piece.len();
                let is_open = taken.is_empty() && come > head.len();
                let is_noted = parts.least >= body.len() || parts.searched + head.len() + 8 > come;
                assert!(!is_open || is_noted, "{come}");
            }
            assert_eq!(taken, [body.len()]);
        }
        let mut parts = Parts::new("a1");
        let mut taken = 0;
        let many = "--a1\r\nContent-length: 2\r\n\r\nab\r\n".repeat(5_000);
        parts
            .receive(many.as_bytes(), |part| taken += part.len())
            .unwrap();
        assert_eq!((taken, parts.bytes.len()), (10_000, 2));
    }
}
