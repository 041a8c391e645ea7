//! From lines to records: a block of several lines is one field.
//!
//! ```text
//!   time|@ASSET@|T12|CuttingTool|--multiline--AB12     begins a block; the mark is from `--multiline--` on
//!   <CuttingTool>                                      whatever stands here belongs to it
//!   --multiline--AB12                                  ends it: the same mark on a line of its own
//! ```
//!
//! The lines between are the end of the field in which the mark stood. In a log what follows is known: a mark that does
//! not come again within [`BLOCK_LIMIT`] begins nothing, its field is left out and reported, and no other line is lost.
//! Live, a block that is too long or stays open too long is given up and counted; its end may still come, and begins no
//! new one. A block of which one line is over the limit is no value: its field is left out and reported.
//!
//! # References
//! \[1\] `mtconnect/cppagent`, `ShdrAdapter::processData`, which waits for the end without limit and drops blank lines.

use std::collections::{BTreeMap, VecDeque};

use metrology::stamp::{Host, Span, Stamp};

use super::Flaw;
use crate::framing::Framed;

/// What begins a mark.
const MARK: &str = "--multiline--";
/// A block over this length is given up, bytes.
pub const BLOCK_LIMIT: usize = 1 << 20;
/// A block that is open for longer is given up.
pub const BLOCK_PATIENCE: Span = Span::from_nanos(10_000_000_000);

/// One line, or a line with the block that it began.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// The line, without its mark.
    pub head: String,
    /// The lines of the block.
    pub body: Option<String>,
    /// Its first line's number, from 1 on; 0: of a connection.
    pub line: usize,
    /// Lines that it takes, blank ones not counted.
    pub lines: usize,
    /// What was wrong with it before it was read: its block does not end, or it is too long and is left out.
    pub flaw: Option<Flaw>,
}

impl Record {
    /// A line that begins no block.
    #[must_use]
    pub fn plain(head: &str) -> Self {
        Self {
            head: head.to_owned(),
            body: None,
            line: 0,
            lines: 1,
            flaw: None,
        }
    }

    /// Bytes that it takes, about.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.head.len() + self.body.as_ref().map_or(0, String::len)
    }
}

/// A block that was given up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenUp {
    /// Its mark.
    pub mark: String,
    /// Its lines so far.
    pub lines: usize,
}

#[derive(Clone, Debug)]
struct Open {
    head: String,
    mark: String,
    body: Vec<String>,
    bytes: usize,
    lines: usize,
    /// A line of it that is left out.
    flaw: Option<Flaw>,
    since: Stamp<Host>,
}

/// Puts the blocks of a connection together.
#[derive(Clone, Debug, Default)]
pub struct Blocks {
    open: Option<Open>,
    given_up: Option<String>,
}

fn begins(line: &str) -> Option<(&str, &str)> {
    line.find(MARK).map(|at| line.split_at(at))
}

impl Open {
    fn new(head: &str, mark: &str, since: Stamp<Host>) -> Self {
        Self {
            head: head.to_owned(),
            mark: mark.to_owned(),
            body: Vec::new(),
            bytes: 0,
            lines: 1,
            flaw: None,
            since,
        }
    }

    fn take(&mut self, line: &str) {
        self.lines += 1;
        self.bytes += line.len() + 1;
        if self.bytes <= BLOCK_LIMIT {
            self.body.push(line.to_owned());
        }
    }

    /// A line of it is over the limit and is not kept.
    fn spoil(&mut self, flaw: Flaw) {
        self.lines += 1;
        self.flaw = Some(flaw);
    }

    /// Its record, with the line that ends it.
    fn record(self, line: usize) -> Record {
        Record {
            head: self.head,
            body: Some(self.body.join("\n")),
            line,
            lines: self.lines + 1,
            flaw: self.flaw,
        }
    }
}

impl Blocks {
    /// Takes a line that came at `at`; hands over what is whole by it, or what was given up.
    pub fn push(
        &mut self,
        line: &str,
        at: Stamp<Host>,
        mut take: impl FnMut(Result<Record, GivenUp>),
    ) {
        let line = line.trim_end();
        if self.given_up.as_deref() == Some(line) {
            self.given_up = None;
            return;
        }
        if let Some(mut open) = self.open.take() {
            let is_end = line == open.mark;
            let is_late = at - open.since > BLOCK_PATIENCE;
            if is_end && open.bytes <= BLOCK_LIMIT {
                return take(Ok(open.record(0)));
            }
            if !is_end && !is_late {
                open.take(line);
                self.open = Some(open);
                return;
            }
            take(Err(self.give_up(open, !is_end)));
            if is_end {
                return;
            }
        }
        match begins(line) {
            Some((head, mark)) => self.open = Some(Open::new(head, mark, at)),
            None => take(Ok(Record::plain(line))),
        }
    }

    /// Takes a line over the limit into the block that is open; whether one is.
    pub fn spoil(&mut self, length: usize, limit: usize) -> bool {
        let open = self.open.as_mut();
        open.map(|open| open.spoil(Flaw::TooLong { length, limit }))
            .is_some()
    }

    fn give_up(&mut self, open: Open, may_end: bool) -> GivenUp {
        self.given_up = may_end.then(|| open.mark.clone());
        GivenUp {
            mark: open.mark,
            lines: open.lines,
        }
    }

    /// The connection has ended: what is open is given up.
    pub fn restart(&mut self) -> Option<GivenUp> {
        let open = self.open.take();
        let given_up = open.map(|open| self.give_up(open, false));
        self.given_up = None;
        given_up
    }
}

/// A line of a log that is no record yet.
#[derive(Clone, Debug)]
struct Raw {
    line: usize,
    /// Bytes of the log before its end.
    end: usize,
    text: Result<String, Flaw>,
}

/// Puts the records of a log together from its lines, of which it keeps no more than a block may be long.
#[derive(Clone, Debug, Default)]
pub struct Assembly {
    waiting: VecDeque<Raw>,
    /// Where a mark stands on a line of its own: number and end of the line, of those that wait.
    marks: BTreeMap<String, VecDeque<(usize, usize)>>,
    lines: usize,
    end: usize,
}

impl Assembly {
    /// Takes the next line; one over `limit` bytes becomes a record without contents.
    pub fn push(&mut self, framed: &Framed<'_>, limit: usize) {
        self.lines += 1;
        let text = match framed {
            Framed::Line { text, .. } => Ok(text.trim_end().to_owned()),
            Framed::TooLong { length } => Err(Flaw::TooLong {
                length: *length,
                limit,
            }),
        };
        // Nothing stands in it, within a block as outside.
        if text.as_ref().is_ok_and(String::is_empty) {
            return;
        }
        let length = text.as_ref().map_or(0, String::len);
        self.end = self.end.saturating_add(length + 1);
        if let Ok(mark) = &text
            && mark.starts_with(MARK)
        {
            let places = self.marks.entry(mark.clone()).or_default();
            places.push_back((self.lines, self.end));
        }
        self.waiting.push_back(Raw {
            line: self.lines,
            end: self.end,
            text,
        });
    }

    fn pop(&mut self) -> Option<Raw> {
        let raw = self.waiting.pop_front()?;
        if let Ok(text) = &raw.text
            && let Some(places) = self.marks.get_mut(text)
        {
            places.pop_front();
            if places.is_empty() {
                self.marks.remove(text);
            }
        }
        Some(raw)
    }

    /// The next record, where what waits is enough to know it; with `is_last`, no other line comes.
    pub fn next(&mut self, is_last: bool) -> Option<Record> {
        let first = self.waiting.front()?;
        if !is_last && self.end - first.end <= BLOCK_LIMIT {
            return None;
        }
        let Raw { line, end, text } = self.pop()?;
        let text = match text {
            Ok(text) => text,
            Err(flaw) => {
                return Some(Record {
                    line,
                    lines: 1,
                    flaw: Some(flaw),
                    ..Record::default()
                });
            }
        };
        let Some((head, mark)) = begins(&text) else {
            return Some(Record {
                line,
                ..Record::plain(&text)
            });
        };
        let ends = self.marks.get(mark).and_then(VecDeque::front);
        let Some((last, _)) = ends.filter(|(_, at)| at - end <= BLOCK_LIMIT).copied() else {
            let mark = mark.to_owned();
            return Some(Record {
                line,
                flaw: Some(Flaw::Block { mark, lines: 1 }),
                ..Record::plain(head)
            });
        };
        let mut block = Open::new(head, mark, Stamp::default());
        while let Some(raw) = self.pop().filter(|raw| raw.line < last) {
            match raw.text {
                Ok(text) => block.take(&text),
                Err(flaw) => block.spoil(flaw),
            }
        }
        Some(block.record(line))
    }
}

/// The records of a whole log.
#[must_use]
pub fn records(text: &str) -> Vec<Record> {
    let mut assembly = Assembly::default();
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    for text in text.lines() {
        let framed = Framed::Line { text, replaced: 0 };
        assembly.push(&framed, usize::MAX);
    }
    std::iter::from_fn(|| assembly.next(true)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LOG: &str = "|a|1\n|@ASSET@|T|C|--multiline--X1\n<T>\n|Stemp|99\n\n</T>\n--multiline--X1\n|b|--multiline--X2\none\n--multiline--X9\ntwo\r\n--multiline--X2\n|c|3\n";

    fn live(text: &str, passed_s: f64) -> Vec<Result<Record, GivenUp>> {
        let (mut blocks, mut found) = (Blocks::default(), Vec::new());
        let mut at = Stamp::default();
        for line in text.lines().filter(|line| !line.is_empty()) {
            blocks.push(line, at, |one| found.push(one));
            at += Span::from_secs_f64(passed_s);
        }
        found.extend(blocks.restart().map(Err));
        found
    }

    fn shown(records: impl Iterator<Item = Record>) -> Vec<(String, Option<String>)> {
        records.map(|record| (record.head, record.body)).collect()
    }

    #[test]
    fn a_block_is_one_record_in_a_log_and_live() {
        let whole = |head: &str, body: Option<&str>| (head.to_owned(), body.map(str::to_owned));
        let wanted = [
            whole("|a|1", None),
            whole("|@ASSET@|T|C|", Some("<T>\n|Stemp|99\n</T>")),
            whole("|b|", Some("one\n--multiline--X9\ntwo")),
            whole("|c|3", None),
        ];
        assert_eq!(shown(records(LOG).into_iter()), wanted);
        assert_eq!(
            shown(live(LOG, 0.1).into_iter().map(Result::unwrap)),
            wanted
        );
        let lines: Vec<usize> = records(LOG).iter().map(|record| record.line).collect();
        assert_eq!(lines, [1, 2, 8, 13]);
    }

    #[test]
    fn a_block_without_end_loses_no_log_and_no_connection() {
        let text = "|a|--multiline--X1\n|b|2\n|c|3\n";
        let found = records(text);
        assert_eq!(found.len(), 3);
        let flaws: Vec<_> = found.iter().map(|record| record.flaw.is_some()).collect();
        assert_eq!(flaws, [true, false, false]);
        let cut = live(text, 0.1);
        let mark = "--multiline--X1".to_owned();
        assert_eq!(
            cut,
            [Err(GivenUp {
                mark: mark.clone(),
                lines: 3
            })]
        );
        // After ten seconds lines are lines again, and the end that comes late begins nothing.
        let late = live(
            "|a|--multiline--X1\n|b|2\n|c|3\n--multiline--X1\n|d|4\n",
            6.0,
        );
        let plain = |head: &str| Ok(Record::plain(head));
        let lost = Err(GivenUp { mark, lines: 2 });
        assert_eq!(late, [lost, plain("|c|3"), plain("|d|4")]);
    }

    #[test]
    fn a_block_over_the_limit_is_given_up_and_the_next_line_read() {
        let line = "x".repeat(1000);
        let lines = BLOCK_LIMIT / 1000 + 10;
        let mut text = "|a|--multiline--X1\n".to_owned();
        text.push_str(&format!("{line}\n").repeat(lines));
        text.push_str("--multiline--X1\n|b|2\n");
        let found = live(&text, 0.0);
        assert_eq!(found.len(), 2);
        assert!(matches!(&found[0], Err(lost) if lost.lines == lines + 1));
        assert_eq!(found[1], Ok(Record::plain("|b|2")));
    }

    proptest! {
        /// Whatever blocks are cut off or wrong: every line that is in no whole block is a record.
        #[test]
        fn prop_no_line_is_lost(picks in proptest::collection::vec(0_usize..5, 0..30)) {
            let words = ["|a|1", "x|--multiline--A", "--multiline--A", "--multiline--B", "<t>"];
            let lines: Vec<&str> = picks.iter().map(|pick| words[*pick]).collect();
            let found = records(&lines.join("\n"));
            let in_blocks: usize = found
                .iter()
                .filter_map(|record| record.body.as_deref())
                .map(|body| if body.is_empty() { 1 } else { body.lines().count() + 1 })
                .sum();
            prop_assert_eq!(found.len() + in_blocks, lines.len());
        }
    }
}
