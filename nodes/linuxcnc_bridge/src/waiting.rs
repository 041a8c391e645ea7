//! What a program waits for while nothing moves.
//!
//! LinuxCNC tells that a program is paused, never by what; a tool change by hand, a feed of zero and a held feed it
//! does not tell at all. What it waits for follows from its text and from whether the axes stand.

use std::fmt;

use metrology::stamp::{Host, Span, Stamp};

use crate::samples::Record;
use crate::watch::{plain_words, tenths};

/// Axes that have stood still for so long wait for something that was not asked for.
const STILL: Span = Span::from_nanos(1_000_000_000);
/// Less than this between two records is standing still, mm or rad: LinuxCNC prints 1e-6.
const STANDS: f64 = 5e-7;

/// A word at which a program may stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stop {
    Pause(&'static str),
    ToolChange,
    Input,
    Dwell,
    /// The line commands a move.
    Motion,
}

/// Stops and moves of a program, by line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stops(Vec<(u32, Stop)>);

/// Why a program does not go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// M0, M1 with optional stop, or M60.
    Stopped {
        /// Its line.
        line: u32,
        /// Its word.
        word: &'static str,
    },
    /// A pause or single block at the control.
    Paused {
        /// The line that was being executed; 0: none yet.
        line: u32,
    },
    /// A tool is to be changed by hand.
    ToolChange {
        /// Line of the M6.
        line: u32,
    },
    /// An input of the machine is waited for.
    Input {
        /// Line of the M66.
        line: u32,
    },
    /// A move is under way and nothing moves.
    FeedHeld {
        /// Its line.
        line: u32,
    },
}

impl fmt::Display for Wait {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stopped { line, word } => {
                write!(
                    f,
                    "the program is paused at line {line} ({word}): resume it at the control"
                )
            }
            Self::Paused { line: 0 } => {
                write!(
                    f,
                    "the program is paused before its first move: resume it at the control"
                )
            }
            Self::Paused { line } => write!(
                f,
                "the program is paused in line {line} (pause or single block): resume it at the control"
            ),
            Self::ToolChange { line } => write!(
                f,
                "the program waits at line {line} (M6): change the tool and confirm it at the control"
            ),
            Self::Input { line } => {
                write!(
                    f,
                    "the program waits at line {line} (M66) for an input of the machine"
                )
            }
            Self::FeedHeld { line } => write!(
                f,
                "nothing moves in line {line}: feed hold, a feed override of 0 %, or a spindle that is not at its \
                 speed; release it at the control"
            ),
        }
    }
}

fn stop_of(letter: &str, value: f64) -> Option<Stop> {
    match (letter, tenths(value)) {
        ("M", Some(0)) => Some(Stop::Pause("M0")),
        ("M", Some(10)) => Some(Stop::Pause("M1")),
        ("M", Some(60)) => Some(Stop::ToolChange),
        ("M", Some(600)) => Some(Stop::Pause("M60")),
        ("M", Some(660)) => Some(Stop::Input),
        ("G", Some(40)) => Some(Stop::Dwell),
        ("X" | "Y" | "Z" | "A" | "B" | "C" | "U" | "V" | "W", _) => Some(Stop::Motion),
        _ => None,
    }
}

impl Stops {
    /// Takes the next line of the program.
    pub fn line(&mut self, line: u32, text: &str) {
        // A line with expressions and the like has no plain words, so no stop.
        let upper = text.to_ascii_uppercase();
        for (letter, value) in plain_words(&upper).unwrap_or_default() {
            if let Some(stop) = stop_of(letter, value) {
                self.0.push((line, stop));
            }
        }
    }

    fn after(&self, line: u32) -> &[(u32, Stop)] {
        &self.0[self.0.partition_point(|(known, _)| *known < line)..]
    }

    /// At a standstill between two moves, the last of which stands in `line`: the stop that LinuxCNC reports.
    fn paused_at(&self, line: u32) -> Wait {
        let stop = self.after(line).iter().find_map(|(at, stop)| match stop {
            Stop::Pause(word) => Some(Wait::Stopped { line: *at, word }),
            _ => None,
        });
        stop.unwrap_or(Wait::Paused { line })
    }

    /// The same where LinuxCNC reports no stop: the wait that stands before the next move.
    fn waits_at(&self, line: u32) -> Option<Wait> {
        for (at, stop) in self.after(line) {
            match stop {
                Stop::ToolChange => return Some(Wait::ToolChange { line: *at }),
                Stop::Input => return Some(Wait::Input { line: *at }),
                Stop::Motion if *at > line => return None,
                // A dwell ends by itself, and what stands behind it has not begun.
                Stop::Dwell => return None,
                _ => {}
            }
        }
        None
    }
}

/// Notices that a running program stands still.
#[derive(Clone, Debug, Default)]
pub struct Standstill {
    before: Option<Record>,
    since: Option<Stamp<Host>>,
}

impl Standstill {
    /// Takes the next record.
    pub fn step(&mut self, at: Stamp<Host>, record: &Record) {
        let moved = self.before.replace(*record).is_none_or(|before| {
            let pairs = record.commanded.0.iter().zip(&before.commanded.0);
            let same = { pairs }.all(|(now, before)| (now - before).abs() < STANDS);
            !same || before.line != record.line || before.motion_type != record.motion_type
        });
        if moved {
            self.since = Some(at);
        }
    }

    /// What a program waits for whose last move stands in `line`; LinuxCNC says that it is `paused`.
    #[must_use]
    pub fn wait(&self, at: Stamp<Host>, stops: &Stops, line: u32, paused: bool) -> Option<Wait> {
        let in_move = self.before.is_some_and(|record| record.motion_type != 0);
        if paused {
            return Some(if in_move {
                Wait::Paused { line }
            } else {
                stops.paused_at(line)
            });
        }
        let still = self.since.is_some_and(|since| at - since >= STILL);
        match (still, in_move) {
            (false, _) => None,
            (true, true) => Some(Wait::FeedHeld { line }),
            (true, false) => stops.waits_at(line),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stops(text: &str) -> Stops {
        let mut stops = Stops::default();
        for (line, text) in (1..).zip(text.lines()) {
            stops.line(line, text);
        }
        stops
    }

    #[test]
    fn the_stop_behind_the_last_move_is_named() {
        let text = "G21 G90\nG0 X5\nM0 (look)\ng0 x6\n(M0)\nm1\nG0 X7\nT1 M6\nG0 X8 M60\nG4 P100\nM66 P1 L3\nM2\n";
        let stops = stops(text);
        let stopped = |line, word| Wait::Stopped { line, word };
        assert_eq!(stops.paused_at(0), stopped(3, "M0"));
        assert_eq!(stops.paused_at(2), stopped(3, "M0"));
        assert_eq!(stops.paused_at(4), stopped(6, "M1"));
        assert_eq!(stops.paused_at(9), stopped(9, "M60"));
        assert_eq!(stops.paused_at(10), Wait::Paused { line: 10 });
        assert_eq!(stops.waits_at(2), None, "a pause is told by LinuxCNC");
        assert_eq!(stops.waits_at(7), Some(Wait::ToolChange { line: 8 }));
        assert_eq!(stops.waits_at(9), None, "it dwells");
        assert_eq!(stops.waits_at(11), Some(Wait::Input { line: 11 }));
    }

    #[test]
    fn only_a_standstill_of_a_second_is_a_wait() {
        let stops = stops("G21\nG1 X5 F60\nT1 M6\nG0 X6\nM2\n");
        let at = |ms: i64| Stamp::from_nanos(1_000_000_000_000 + ms * 1_000_000);
        let mut still = Standstill::default();
        let mut record = Record {
            line: 2,
            motion_type: 2,
            ..Record::default()
        };
        for ms in 0..500 {
            record.commanded.0[0] += 0.001;
            still.step(at(ms), &record);
        }
        assert_eq!(still.wait(at(900), &stops, 2, false), None);
        let held = Wait::FeedHeld { line: 2 };
        assert_eq!(still.wait(at(1600), &stops, 2, false), Some(held));
        let paused = Wait::Paused { line: 2 };
        assert_eq!(still.wait(at(501), &stops, 2, true), Some(paused));
        record.motion_type = 0;
        still.step(at(1700), &record);
        assert_eq!(still.wait(at(1800), &stops, 2, false), None);
        let change = Wait::ToolChange { line: 3 };
        assert_eq!(still.wait(at(2800), &stops, 2, false), Some(change));
    }
}
