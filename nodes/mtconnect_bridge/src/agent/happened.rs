//! A part of an agent's stream: what is new in it, and what is missing.

use metrology::stamp::{Host, Span, Stamp};

use super::{AgentLink, Asked, Heard};
use crate::document::{Header, Numbered};
use crate::stage::IoCommand;

/// Numbers that are missing: the first, and the first behind them that is there.
type Hole = (u64, u64);

impl AgentLink {
    /// A part of the stream, or the answer to what was asked again; `unread` are the numbers of observations that could not
    /// be read, which are not missing.
    pub(super) fn happened(
        &mut self,
        at: Stamp<Host>,
        header: Header,
        (mut observations, unread): (Vec<Numbered>, &[u64]),
        out: &mut Vec<Heard>,
    ) {
        self.progress = true;
        self.unreadable = 0;
        self.out_of_range = 0;
        if self.meet(header.instance_id, out) {
            return self.ask_again(at, out);
        }
        let next = self.next.unwrap_or(header.next_sequence);
        if header.next_sequence < next {
            self.went_back(next, header.next_sequence, out);
            return self.ask_again(at, out);
        }
        let is_whole = self.config.device.is_empty();
        // Behind a part that could not be read the head alone tells of a loss.
        let passes_over = std::mem::take(&mut self.passes_over);
        let told = observations.iter().map(|numbered| numbered.sequence);
        let begins = told.chain(unread.iter().copied()).min();
        let begins = begins.or(passes_over.then_some(header.next_sequence));
        let before = begins.filter(|begins| (is_whole || passes_over) && *begins > next);
        let lost_to = match header.first_sequence > next {
            true => Some(header.first_sequence),
            false => before,
        };
        let holes = match is_whole {
            true => holes(next, &observations, unread),
            false => vec![],
        };
        if let Some((missing, _)) = holes.first().filter(|_| self.may_ask(lost_to)) {
            observations.retain(|numbered| numbered.sequence < *missing);
            self.tell_new(next, observations, out);
            self.next = Some(*missing);
            return self.ask_missing(*missing, out);
        }
        let follows = !observations.is_empty() && lost_to.is_none() && holes.is_empty();
        self.tell_new(next, observations, out);
        self.next = Some(header.next_sequence);
        if let Some(to) = lost_to {
            self.gap(next, to, out);
        }
        for (from, to) in &holes {
            self.gap(*from, *to, out);
        }
        if lost_to.is_some() || !holes.is_empty() {
            // The agent has lost nothing behind such a part.
            self.resumes = passes_over;
            return self.ask_again(at, out);
        }
        if follows {
            self.pause = Span::default();
        }
        if matches!(self.asked, Asked::Again) {
            self.ask_sample(header.next_sequence, out);
        }
    }

    /// Whether what is missing within a part is asked again: once, and not while losses follow each other.
    fn may_ask(&self, lost_to: Option<u64>) -> bool {
        let is_again = matches!(self.asked, Asked::Again);
        lost_to.is_none() && !is_again && self.pause == Span::default()
    }

    /// Asks once for what is missing; the stream goes on behind the answer.
    fn ask_missing(&mut self, from: u64, out: &mut Vec<Heard>) {
        self.asked = Asked::Again;
        let (path, count) = (self.path("sample"), self.config.count);
        let path = format!("{path}?from={from}&count={count}");
        out.push(Heard::Io(IoCommand::Disconnect));
        out.push(Heard::Io(IoCommand::Get { path }));
    }

    /// Tells the observations of a part from a number on, each once.
    fn tell_new(&mut self, from: u64, mut observations: Vec<Numbered>, out: &mut Vec<Heard>) {
        let n_all = observations.len();
        observations.dedup();
        observations.retain(|numbered| numbered.sequence >= from);
        let count = (n_all - observations.len()) as u64;
        for numbered in observations {
            self.note(&numbered);
            out.push(Heard::Observation(numbered.observation));
        }
        if count > 0 {
            out.push(Heard::Repeated { count });
        }
    }
}

/// What is missing between the numbers of a part, from `from` on. What is missing before the first of them is not among it.
fn holes(from: u64, observations: &[Numbered], unread: &[u64]) -> Vec<Hole> {
    let told = observations.iter().map(|numbered| numbered.sequence);
    let mut numbers: Vec<u64> = told.chain(unread.iter().copied()).collect();
    numbers.retain(|number| *number >= from);
    numbers.sort_unstable();
    let two = numbers.windows(2).map(|two| (two[0], two[1]));
    two.filter(|(one, next)| next - one > 1)
        .map(|(one, next)| (one + 1, next))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{MachineTime, Observation, Told};

    fn numbered(sequence: u64) -> Numbered {
        Numbered {
            sequence,
            observation: Observation {
                time: MachineTime::Absent,
                key: "x".to_owned(),
                name: None,
                told: Told::Unavailable,
            },
        }
    }

    #[test]
    fn holes_are_between_numbers_and_those_that_cannot_be_read_are_none() {
        for (from, numbers, unread, wanted) in [
            (1, &[1, 2, 3][..], &[][..], &[][..]),
            (1, &[5, 6], &[], &[]),
            (1, &[1, 4, 5, 9], &[], &[(2, 4), (6, 9)]),
            (1, &[1, 4], &[3, 2], &[]),
            (1, &[1, 5], &[3], &[(2, 3), (4, 5)]),
            (4, &[1, 4, 5], &[], &[]),
            (2, &[2, 2, 3, 3, 5], &[], &[(4, 5)]),
            (1, &[1, u64::MAX], &[], &[(2, u64::MAX)]),
            (1, &[], &[], &[]),
        ] {
            let observations: Vec<_> = numbers.iter().copied().map(numbered).collect();
            let found = holes(from, &observations, unread);
            assert_eq!(found, wanted, "{numbers:?} {unread:?}");
        }
    }
}
