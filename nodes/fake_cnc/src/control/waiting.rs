//! A program that waits: M0, M1, M60, feed hold and single block, and what lets it go on.
//!
//! A feed hold slows down along the path and goes on with what is left of the motion. A touch is finished
//! before it holds: one that was begun at rest in the middle of its way would tell another latency.

use super::phase::Phase;
use super::{Control, Event};
use crate::diagnostic::Diagnostic;
use crate::hardware::Hardware;
use crate::rs274::program::Wait;

/// What follows a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Then {
    /// The next step.
    Step,
    /// What is left of the path.
    Path,
    /// What is left of a dwell, in servo periods.
    Dwell(u64),
}

impl<H: Hardware> Control<H> {
    /// Lets the program on its way come to rest until it is resumed.
    ///
    /// # Errors
    /// Why there is nothing to hold.
    pub fn pause(&mut self, events: &mut Vec<Event>) -> Result<(), &'static str> {
        if self.run.is_none() {
            return Err("no program is running");
        }
        if self.phase.ending() {
            return Err("the program is ending");
        }
        match self.phase {
            Phase::Waiting { .. } => return Err("the program waits already"),
            Phase::Following => {
                self.chain.stop();
                self.phase = Phase::Pausing;
            }
            Phase::Dwelling { left } => self.wait(Wait::FeedHold, Then::Dwell(left), events),
            _ => self.hold_wanted = true,
        }
        Ok(())
    }

    /// Lets a program that waits go on, for one block where `one_block`.
    ///
    /// # Errors
    /// Why there is nothing to resume.
    pub fn resume(&mut self, one_block: bool, events: &mut Vec<Event>) -> Result<(), &'static str> {
        if std::mem::take(&mut self.hold_wanted) {
            self.step_wanted = one_block;
            return Ok(());
        }
        let Phase::Waiting { then } = self.phase else {
            return Err(match (self.run.is_some(), &self.phase) {
                (false, _) => "no program is running",
                (true, Phase::Pausing) => "the axes are not at rest yet",
                (true, _) => "the program does not wait",
            });
        };
        self.step_wanted = one_block;
        let line = self.progress().0;
        if let Some(run) = &mut self.run {
            // What is left of a block is part of it.
            run.block = if then == Then::Step { 0 } else { line };
        }
        self.no_longer_waits(events);
        self.phase = match then {
            Then::Step => Phase::Settling { left: 0 },
            Then::Dwell(left) => Phase::Dwelling { left },
            Then::Path => {
                if !self.begin_chain() {
                    self.phase = Phase::Settling { left: 0 };
                }
                return Ok(());
            }
        };
        Ok(())
    }

    /// Whether every block waits for the next to be asked for.
    pub(super) const fn is_single(&self) -> bool {
        self.settings.single_block || self.step_wanted
    }

    /// Whether the program waits here rather than begin the block of `line`, or go on with it.
    pub(super) fn waits_before(&mut self, line: u32, events: &mut Vec<Event>) -> bool {
        let is_single = self.is_single();
        let Some(run) = &mut self.run else {
            return false;
        };
        let is_other = run.block != 0 && run.block != line;
        let has_to_wait = self.hold_wanted || (is_single && is_other);
        if !has_to_wait {
            run.block = line;
            return false;
        }
        let why = if std::mem::take(&mut self.hold_wanted) {
            Wait::FeedHold
        } else {
            Wait::SingleBlock
        };
        self.wait(why, Then::Step, events);
        true
    }

    /// Waits, and says so.
    pub(super) fn wait(&mut self, why: Wait, then: Then, events: &mut Vec<Event>) {
        let line = self.progress().0;
        self.step_wanted = false;
        self.waits = true;
        self.phase = Phase::Waiting { then };
        events.push(Event::Noted(Diagnostic::Waiting { line, why }));
    }

    /// At rest after a feed hold within a path.
    pub(super) fn rest_in_path(&mut self, events: &mut Vec<Event>) {
        let tag = self.chain.tag();
        self.rest = self.chain.rest(&self.settings.limits);
        self.chain.clear();
        if let (Some(run), Some(tag)) = (&mut self.run, tag) {
            run.next = tag + 1;
        }
        self.wait(Wait::FeedHold, Then::Path, events);
    }

    /// Takes back that the program waits.
    pub(super) fn no_longer_waits(&mut self, events: &mut Vec<Event>) {
        if std::mem::take(&mut self.waits) {
            events.push(Event::Noted(Diagnostic::WaitsNoLonger));
        }
    }
}
