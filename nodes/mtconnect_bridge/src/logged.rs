//! Lines that an adapter sent on another day, told again at their own pace.
//!
//! A line is told when the clock reaches its stamp. Where the first stamp has passed when the log begins, all are
//! later by as much, so that the first is told at once:
//!
//! ```text
//!   t_told = t_sent + max(0, t_begin − t_first)                                            (1)
//! ```
//!
//! A line without a date is told with the one before it. Lines keep their order: one whose stamp lies before that of
//! the line before it does not wait for it to come again.

use metrology::stamp::{Host, Machine, Span, Stamp};

use crate::observation::read_stamp;

/// A log that is told.
#[derive(Clone, Debug, Default)]
pub struct Log {
    lines: Vec<(Stamp<Machine>, String)>,
    next: usize,
    later: Option<Span>,
}

impl Log {
    /// From the log's text.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut last = Stamp::default();
        let lines = text.lines().map(|line| {
            let stamp = line.split(['|', '@']).next().and_then(read_stamp);
            last = stamp.map_or(last, |stamp| stamp.max(last));
            (last, line.to_owned())
        });
        Self {
            lines: lines.collect(),
            next: 0,
            later: None,
        }
    }

    /// Hands over every line whose time (1) has come by `now`; the log begins with the first call.
    pub fn due(&mut self, now: Stamp<Host>, mut take: impl FnMut(&str)) {
        let Some((first, _)) = self.lines.first() else {
            return;
        };
        let passed = now - Stamp::from_nanos(first.nanos());
        let later = *self.later.get_or_insert(passed.max(Span::default()));
        while let Some((at, line)) = self.lines.get(self.next) {
            if Stamp::from_nanos(at.nanos()) + later > now {
                break;
            }
            take(line);
            self.next += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "2016-11-29T10:00:00Z|a|1\n|b|2\n2016-11-29T10:00:05Z@3|c|3\n2016-11-29T10:00:01Z|d|4\n";

    /// Keys of the lines that are told at a stamp.
    fn told(log: &mut Log, at: &str) -> String {
        let mut keys = String::new();
        let now = Stamp::from_nanos(read_stamp(at).unwrap().nanos());
        log.due(now, |line| keys.push_str(line.split('|').nth(1).unwrap()));
        keys
    }

    #[test]
    fn lines_are_told_once_in_order_when_their_time_has_come() {
        let mut log = Log::new(TEXT);
        assert_eq!(told(&mut log, "2016-11-29T09:59:59Z"), "");
        assert_eq!(told(&mut log, "2016-11-29T10:00:04Z"), "ab");
        assert_eq!(told(&mut log, "2016-11-29T10:00:05Z"), "cd");
        assert_eq!(told(&mut log, "2016-11-29T11:00:00Z"), "");
        assert_eq!(told(&mut Log::new(""), "2016-11-29T11:00:00Z"), "");
    }

    #[test]
    fn eq1_a_log_of_another_day_begins_at_once_and_keeps_its_pace() {
        let mut log = Log::new(TEXT);
        assert_eq!(told(&mut log, "2026-01-01T12:00:00Z"), "ab");
        assert_eq!(told(&mut log, "2026-01-01T12:00:04.9Z"), "");
        assert_eq!(told(&mut log, "2026-01-01T12:00:05Z"), "cd");
    }
}
