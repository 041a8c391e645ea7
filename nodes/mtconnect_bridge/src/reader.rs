//! What becomes of the lines of an adapter or a log: values, conditions, and an account.

use metrology::stamp::{Host, Machine, Span, Stamp};

use crate::account::{Account, Reporting};
use crate::condition::Condition;
use crate::document::DocumentFlaw;
use crate::framing::Lines;
use crate::observation::MachineTime;
use crate::shdr::block::{Blocks, GivenUp};
use crate::shdr::{self, Flaw, Line, Record};
use crate::stage::Output;
use crate::values::Values;

/// An adapter that wants to be asked more or less often than this is not watched, ms.
const HEARTBEATS_MS: std::ops::RangeInclusive<f64> = 100.0..=3.6e6;

/// Reads records.
#[derive(Clone, Debug)]
pub struct Reader {
    /// The values published so far.
    pub values: Values,
    /// What was taken and left out, without what the values count.
    pub account: Account,
    version: u32,
    refused: u64,
    reporting: Reporting,
}

impl Reader {
    /// Of an adapter that has said nothing yet.
    #[must_use]
    pub fn new(values: Values) -> Self {
        Self {
            values,
            account: Account::default(),
            version: 1,
            refused: 0,
            reporting: Reporting::default(),
        }
    }

    /// The account with what the values count.
    #[must_use]
    pub fn account(&self) -> Account {
        self.values.account(&self.account)
    }

    /// Reports the account of a connection where it has changed.
    pub fn tell_account(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        if self.account.lines == 0 || !self.reporting.is_due(at) {
            return;
        }
        let account = self.account();
        if self.reporting.is_news(at, &account) {
            out.push(Output::Condition(Condition::Account { account }));
        }
    }

    /// Takes one record; `dated`: when an undated line of a log was. Returns the heartbeat that the adapter asks for.
    pub fn take(
        &mut self,
        record: &Record,
        at: Stamp<Host>,
        dated: Option<Stamp<Machine>>,
        out: &mut Vec<Output>,
    ) -> Option<Option<Span>> {
        let reading = shdr::read(record, self.version, |key| self.values.shape(key));
        if reading.line == Line::Empty {
            return None;
        }
        self.account.lines += record.lines as u64;
        self.account.assets += u64::from(reading.has_asset);
        for flaw in reading.flaws {
            self.flawed(flaw, record.line, out);
        }
        match reading.line {
            Line::Observations(observations) => {
                let is_log = record.line > 0;
                self.values.at_line(record.line);
                for mut observation in observations {
                    if let (MachineTime::Absent, Some(dated)) = (observation.time, dated) {
                        observation.time = MachineTime::Absolute(dated);
                    }
                    // The leaps of a log are found where it is paced.
                    if is_log {
                        self.values.hear_held(observation, at, out);
                    } else {
                        self.values.hear(observation, at, out);
                    }
                }
            }
            Line::Pong { period_ms } => {
                let is_sensible = HEARTBEATS_MS.contains(&period_ms);
                return Some(is_sensible.then(|| Span::from_secs_f64(period_ms * 1e-3)));
            }
            Line::Version(version) => self.version = version,
            Line::Command | Line::Empty => {}
        }
        None
    }

    fn flawed(&mut self, flaw: Flaw, line: usize, out: &mut Vec<Output>) {
        self.refused += 1;
        self.account.leave(flaw.reason(), line);
        let count = self.refused;
        out.push(Output::Condition(Condition::Malformed {
            line,
            flaw,
            count,
        }));
    }

    /// A connection has ended: what is open of a line or a block is left out.
    pub fn end_of_connection(
        &mut self,
        lines: &mut Lines,
        blocks: &mut Blocks,
        out: &mut Vec<Output>,
    ) {
        let bytes = lines.restart();
        if bytes > 0 {
            self.flawed(Flaw::Cut { bytes }, 0, out);
        }
        if let Some(given_up) = blocks.restart() {
            self.give_up(given_up, out);
        }
    }

    /// A block of a connection without its end.
    pub fn give_up(&mut self, block: GivenUp, out: &mut Vec<Output>) {
        let GivenUp { mark, lines } = block;
        self.account.lines += lines as u64;
        self.flawed(Flaw::Block { mark, lines }, 0, out);
    }

    /// A line over the limit.
    pub fn too_long(&mut self, length: usize, limit: usize, out: &mut Vec<Output>) {
        self.refused += 1;
        self.account.lines += 1;
        self.account.leave("lines over the limit", 0);
        out.push(Output::Condition(Condition::LineTooLong {
            length,
            limit,
            count: self.refused,
        }));
    }

    /// Observations that an agent repeats.
    pub fn repeated(&mut self, count: u64) {
        self.account
            .leave_many("observations that came before", count, 0);
    }

    /// Takes what an agent's numbers show into the account.
    pub fn of_numbers(&mut self, condition: &Condition) {
        let (reason, n) = match condition {
            Condition::SequenceGap { lost, .. } => ("observations that the agent lost", *lost),
            Condition::DeviceGap { .. } => ("gaps in the numbers of all devices", 1),
            Condition::SequenceBack { .. } => ("numbers of the agent that go back", 1),
            _ => return,
        };
        self.account.leave_many(reason, n, 0);
    }

    /// A part of an agent's stream that cannot be read.
    pub fn part_left_out(&mut self, path: String, flaw: DocumentFlaw, out: &mut Vec<Output>) {
        self.refused += 1;
        self.account.is_of_agent = true;
        self.account.lines += 1;
        self.account.leave("parts that cannot be read", 0);
        let count = self.refused;
        out.push(Output::Condition(Condition::PartLeftOut {
            path,
            flaw,
            count,
        }));
    }

    /// Counts and reports invalid letters.
    pub fn replaced(&mut self, letters: usize, out: &mut Vec<Output>) {
        if letters > 0 {
            self.account.replaced += letters as u64;
            let count = self.account.replaced;
            out.push(Output::Condition(Condition::Replaced { letters, count }));
        }
    }
}
