//! Lines that an adapter sent on another day, replayed at their own pace.
//!
//! A line is replayed when the clock reaches its stamp. Where the first stamp has passed when the log begins, or lies ahead
//! by more than the longest pause, the log begins at once; from there on [`crate::pacing`] says when:
//!
//! ```text
//!   T_k = T_0 + τ_k,   T_0 = t_first while 0 < t_first − T_begin ≤ longest pause, else T_begin   (1)
//! ```
//!
//! A log may be longer than the memory: it is read in pieces, and no more than [`WINDOW_BYTES`] of lines wait for their
//! time, beside what a block of several lines may take. Lines without a date before the first dated one belong to it
//! where it is among those.

use metrology::stamp::{Host, Machine, Span, Stamp};

use std::collections::VecDeque;

use crate::framing::{Framed, LineEnds, Lines};
use crate::leap::Leap;
use crate::observation::MachineTime;
use crate::pacing::{AHEAD, Moment, Paced, Pacing, Timed, first_date};
use crate::shdr::block::{Assembly, BLOCK_LIMIT};
use crate::shdr::{Record, time_of};
use crate::text::Transcoder;

/// Lines that are handed over at a time, so that a log without stamps leaves its node time for others.
const LINES_AT_A_TIME: usize = 10_000;
/// While fewer bytes of lines wait, more of the log is read.
pub const WINDOW_BYTES: usize = 1 << 20;

/// A line whose time has come.
#[derive(Clone, Copy, Debug)]
pub struct Due<'a> {
    /// The line.
    pub record: &'a Record,
    /// The date that it has or is replayed with.
    pub dated: Option<Stamp<Machine>>,
    /// The leap that it makes.
    pub leap: Option<Leap>,
}

/// A log that is replayed.
#[derive(Clone, Debug)]
pub struct Log {
    transcoder: Transcoder,
    ends: LineEnds,
    lines: Lines,
    limit: usize,
    assembly: Assembly,
    /// Records whose time has not come, and the bytes that they take.
    waiting: VecDeque<(Record, Moment)>,
    bytes: usize,
    /// The times of those records that have one.
    timed: VecDeque<Timed>,
    pacing: Option<Pacing>,
    next: Option<(Record, Paced)>,
    is_whole: bool,
    has_ended: bool,
    longest: Span,
    begin: Option<Stamp<Host>>,
    replaced: usize,
}

/// When a record was, by its own word.
pub(crate) fn moment(record: &Record) -> Moment {
    match time_of(record) {
        MachineTime::Absolute(stamp) => Moment::Dated(stamp),
        MachineTime::Relative(at_ms) => Moment::Counted(Span::from_secs_f64(at_ms * 1e-3)),
        MachineTime::Absent => Moment::Untold,
    }
}

impl Log {
    /// A log of which nothing has been read; no pause is longer than `longest`, and a line longer than `limit` bytes, at
    /// least those of a block, is left out.
    #[must_use]
    pub fn new(longest: Span, limit: usize) -> Self {
        let limit = limit.max(BLOCK_LIMIT);
        Self {
            transcoder: Transcoder::default(),
            ends: LineEnds::default(),
            lines: Lines::new(limit),
            limit,
            assembly: Assembly::default(),
            waiting: VecDeque::new(),
            bytes: 0,
            timed: VecDeque::new(),
            pacing: None,
            next: None,
            is_whole: false,
            has_ended: false,
            longest,
            begin: None,
            replaced: 0,
        }
    }

    /// Whether more of it is to be read.
    #[must_use]
    pub const fn wants_more(&self) -> bool {
        !self.is_whole && self.bytes < WINDOW_BYTES
    }

    /// Takes the next bytes of the file.
    pub fn feed(&mut self, bytes: &[u8]) {
        let text = self.transcoder.take(bytes, false);
        self.cut(text);
        self.gather();
    }

    /// Takes the end of the file.
    pub fn finish(&mut self) {
        let text = self.transcoder.take(&[], true);
        self.cut(text);
        let (assembly, limit, replaced) = (&mut self.assembly, self.limit, &mut self.replaced);
        self.lines
            .finish(|framed| take(&framed, assembly, limit, replaced));
        self.is_whole = true;
        self.gather();
    }

    fn cut(&mut self, mut text: Vec<u8>) {
        self.ends.unify(&mut text);
        let (assembly, limit, replaced) = (&mut self.assembly, self.limit, &mut self.replaced);
        self.lines
            .receive(&text, |framed| take(&framed, assembly, limit, replaced));
    }

    fn gather(&mut self) {
        while let Some(record) = self.assembly.next(self.is_whole) {
            let moment = moment(&record);
            self.bytes += record.bytes();
            self.timed.extend(moment.on_its_scale());
            self.waiting.push_back((record, moment));
        }
        self.look_ahead();
    }

    /// Whether the next record can be paced: the moments behind it are known, or a good part of the log waits.
    fn knows_enough(&self) -> bool {
        let has_begun = self.pacing.is_some();
        let is_full = self.bytes >= WINDOW_BYTES / if has_begun { 2 } else { 1 };
        self.is_whole || is_full || (has_begun && self.timed.len() > AHEAD)
    }

    /// Paces the next record, where enough of the log is known for it.
    fn look_ahead(&mut self) {
        if self.next.is_some() || !self.knows_enough() {
            return;
        }
        let Some((record, moment)) = self.waiting.pop_front() else {
            return;
        };
        self.bytes -= record.bytes();
        if moment.on_its_scale().is_some() {
            self.timed.pop_front();
        }
        let pacing = self.pacing.get_or_insert_with(|| {
            let behind = self.waiting.iter().map(|(_, moment)| *moment);
            let mut pacing = Pacing::default();
            pacing.begin_at(first_date(std::iter::once(moment).chain(behind)));
            pacing
        });
        let paced = pacing.pace(moment, self.timed.iter().copied(), self.longest);
        self.next = Some((record, paced));
    }

    /// Whether the last line was handed over; true once.
    pub fn ends(&mut self) -> bool {
        let is_over = self.is_whole && self.next.is_none();
        is_over && !std::mem::replace(&mut self.has_ended, true)
    }

    /// Invalid letters that were replaced.
    #[must_use]
    pub const fn replaced(&self) -> usize {
        self.replaced
    }

    /// (1); the leap between the present and a first stamp that is too far ahead.
    fn begin(&self, now: Stamp<Host>) -> (Stamp<Host>, Option<Leap>) {
        let Some(first) = self.next.as_ref().and_then(|(_, paced)| paced.dated) else {
            return (now, None);
        };
        let at = Stamp::from_nanos(first.nanos());
        let wait = at - now;
        if wait > self.longest {
            let leap = Leap {
                from: Stamp::from_nanos(now.nanos()),
                to: first,
                passed: None,
            };
            return (now, Some(leap));
        }
        (at.max(now), None)
    }

    /// Hands over lines whose time (1) has come by `now`, the rest with the next calls where they are many; the log
    /// begins with the first call that has a line.
    pub fn due(&mut self, now: Stamp<Host>, mut take: impl FnMut(Due<'_>)) {
        if self.next.is_none() {
            return;
        }
        let (begin, mut ahead) = match self.begin {
            Some(begin) => (begin, None),
            None => self.begin(now),
        };
        self.begin = Some(begin);
        for _ in 0..LINES_AT_A_TIME {
            let is_due = |next: &mut (Record, Paced)| begin + next.1.after <= now;
            let Some((record, paced)) = self.next.take_if(is_due) else {
                break;
            };
            take(Due {
                record: &record,
                dated: paced.dated,
                leap: paced.leap.or(ahead.take()),
            });
            self.look_ahead();
        }
    }

    /// Lines that have not been replayed, as far as they have been read, and the time to the next of them.
    #[must_use]
    pub fn left(&self, now: Stamp<Host>) -> Option<Left> {
        let (_, paced) = self.next.as_ref()?;
        let next = self.begin.unwrap_or(now) + paced.after;
        Some(Left {
            lines: self.waiting.len() + 1,
            is_all: self.is_whole,
            next: next - now,
        })
    }
}

/// The part of a log that has not been replayed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left {
    /// Lines that have been read and not replayed.
    pub lines: usize,
    /// Whether the end of the log was read.
    pub is_all: bool,
    /// Time until the next of them is due.
    pub next: Span,
}

fn take(framed: &Framed<'_>, assembly: &mut Assembly, limit: usize, replaced: &mut usize) {
    if let Framed::Line { replaced: more, .. } = framed {
        *replaced += more;
    }
    assembly.push(framed, limit);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::read_stamp;

    const TEXT: &str =
        "2016-11-29T10:00:00Z|a|1\n|b|2\n2016-11-29T10:00:05Z@3|c|3\n2016-11-29T10:00:01Z|d|4\n";
    const LONGEST: Span = Span::from_nanos(43_200_000_000_000);

    fn log(text: &str) -> Log {
        let mut log = Log::new(LONGEST, 65_536);
        log.feed(text.as_bytes());
        log.finish();
        log
    }

    /// Keys of the lines that are told at a stamp.
    fn told(log: &mut Log, at: &str) -> String {
        let mut keys = String::new();
        let now = Stamp::from_nanos(read_stamp(at).unwrap().nanos());
        log.due(now, |due| {
            keys.push_str(due.record.head.split('|').nth(1).unwrap_or("-"));
        });
        keys
    }

    #[test]
    fn lines_are_told_once_in_order_when_their_time_has_come() {
        let mut log = log(TEXT);
        assert_eq!(told(&mut log, "2016-11-29T09:59:59Z"), "");
        assert_eq!(told(&mut log, "2016-11-29T10:00:04Z"), "ab");
        assert_eq!(log.left(Stamp::default()).map(|left| left.lines), Some(2));
        assert_eq!(told(&mut log, "2016-11-29T10:00:05Z"), "cd");
        assert_eq!(told(&mut log, "2016-11-29T11:00:00Z"), "");
        assert_eq!(log.left(Stamp::default()), None);
        assert_eq!(told(&mut self::log(""), "2016-11-29T11:00:00Z"), "");
    }

    #[test]
    fn eq1_a_log_of_another_day_begins_at_once_and_keeps_its_pace() {
        // What adapters begin a connection with has no date, and belongs to the first line that has one.
        for opening in [
            "",
            "* PONG 10000\n",
            "|av|AVAILABLE\n",
            "0\n",
            "\n",
            "\u{feff}",
        ] {
            for begin in ["2026-01-01T12:00:00Z", "2010-01-01T12:00:00Z"] {
                let mut log = log(&format!("{opening}{TEXT}"));
                let at = |second: &str| begin.replace("00:00Z", second);
                assert!(told(&mut log, begin).ends_with("ab"), "{opening:?}");
                assert_eq!(told(&mut log, &at("00:04.9Z")), "", "{opening:?}");
                assert_eq!(told(&mut log, &at("00:05Z")), "cd", "{opening:?}");
            }
        }
    }

    #[test]
    fn a_long_log_without_stamps_is_told_piece_by_piece() {
        let mut log = log(&"|a|1\n".repeat(LINES_AT_A_TIME + 5));
        assert_eq!(
            told(&mut log, "2026-01-01T12:00:00Z").len(),
            LINES_AT_A_TIME
        );
        assert_eq!(told(&mut log, "2026-01-01T12:00:00Z").len(), 5);
    }

    /// Keys, dates and leaps of all lines of a log, read in pieces of `piece` bytes when it wants more.
    fn streamed(text: &[u8], piece: usize) -> (Vec<String>, usize) {
        let mut log = Log::new(LONGEST, 65_536);
        let (mut left, mut found, mut most) = (text, Vec::new(), 0);
        let mut now = Stamp::default();
        loop {
            while log.wants_more() {
                let (first, behind) = left.split_at(piece.min(left.len()));
                left = behind;
                if first.is_empty() {
                    log.finish();
                } else {
                    log.feed(first);
                }
            }
            most = most.max(log.bytes);
            log.due(now, |due| {
                let Due {
                    record,
                    dated,
                    leap,
                } = due;
                found.push(format!("{record:?} {dated:?} {leap:?}"));
            });
            if log.ends() {
                return (found, most);
            }
            now += Span::from_nanos(3_600_000_000_000);
        }
    }

    #[test]
    fn a_log_in_pieces_is_that_of_one_piece_and_little_of_it_waits() {
        let mut text = String::new();
        for n in 0..200_000_u32 {
            let line = match n % 500 {
                7 => format!(
                    "2016-11-29T10:00:00Z|p|--multiline--{n}\n<a>\n|x|1\n--multiline--{n}\n"
                ),
                9 => format!("|p|--multiline--open{n}\n"),
                11 => "2035-01-01T00:00:00Z|b|ö\u{10400}\r\n".to_owned(),
                13 => "|c|\n\n".to_owned(),
                _ => format!("2016-11-29T10:{:02}:{:02}Z|k{n}|1.5\n", n / 60 % 60, n % 60),
            };
            text.push_str(&line);
        }
        let bytes = text.as_bytes();
        let (whole, all) = streamed(bytes, bytes.len());
        assert!(whole.len() > 190_000 && all > 20 * WINDOW_BYTES);
        for piece in [4096, 65_537, 300_001] {
            let (found, most) = streamed(bytes, piece);
            assert_eq!(found.len(), whole.len());
            let first = found.iter().zip(&whole).find(|(one, other)| one != other);
            assert_eq!(first, None, "pieces of {piece} bytes");
            // What waits for the end of a block becomes records at the end, each of which takes more than its line.
            assert!(most < 8 * (WINDOW_BYTES + piece), "{most} bytes waited");
        }
    }

    #[test]
    fn a_line_without_end_is_left_out_by_its_number_and_the_next_is_read() {
        let text = format!("|a|1\n|b|{}\n|c|3", "x".repeat(3 << 20));
        let mut log = log(&text);
        let mut found = Vec::new();
        log.due(Stamp::default(), |due| found.push(due.record.clone()));
        let heads: Vec<_> = found.iter().map(|record| record.head.as_str()).collect();
        assert_eq!(heads, ["|a|1", "", "|c|3"]);
        let flaw = found[1].flaw.as_ref().map(ToString::to_string);
        assert_eq!(found[1].line, 2);
        assert!(flaw.unwrap().contains("line of 3145731 bytes"));
    }

    #[test]
    fn a_block_is_told_by_its_first_line_and_no_stamp_in_it_counts() {
        let text = "2016-11-29T10:00:00Z|p|--multiline--A\n2035-01-01T00:00:00Z|x|1\n--multiline--A\n2016-11-29T10:00:02Z|q|1\n";
        let mut log = log(text);
        assert_eq!(told(&mut log, "2026-01-01T12:00:00Z"), "p");
        assert_eq!(told(&mut log, "2026-01-01T12:00:02Z"), "q");
    }
}
