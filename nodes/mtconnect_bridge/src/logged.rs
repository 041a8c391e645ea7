//! Lines that an adapter sent on another day, told again when the clock reaches their stamps.
//!
//! A line without a date is told with the one before it. Lines keep their order: one whose stamp lies before that of
//! the line before it does not wait for it to come again.

use metrology::stamp::{Host, Machine, Stamp};

use crate::observation::read_stamp;

/// A log that is told.
#[derive(Clone, Debug, Default)]
pub struct Log {
    lines: Vec<(Stamp<Machine>, String)>,
    next: usize,
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
        }
    }

    /// Hands over every line whose time has come by `now`.
    pub fn due(&mut self, now: Stamp<Host>, mut take: impl FnMut(&str)) {
        while let Some((at, line)) = self.lines.get(self.next) {
            if at.nanos() > now.nanos() {
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

    #[test]
    fn lines_are_told_once_in_order_when_their_time_has_come() {
        let text = "2016-11-29T10:00:00Z|a|1\n|b|2\n2016-11-29T10:00:05Z@3|c|3\n2016-11-29T10:00:01Z|d|4\n";
        let mut log = Log::new(text);
        let mut told = |s: &str| {
            let mut lines = String::new();
            let now = Stamp::from_nanos(read_stamp(s).unwrap().nanos());
            log.due(now, |line| lines.push_str(line.split('|').nth(1).unwrap()));
            lines
        };
        assert_eq!(told("2016-11-29T09:59:59Z"), "");
        assert_eq!(told("2016-11-29T10:00:04Z"), "ab");
        assert_eq!(told("2016-11-29T10:00:05Z"), "cd");
        assert_eq!(told("2016-11-29T11:00:00Z"), "");
    }
}
