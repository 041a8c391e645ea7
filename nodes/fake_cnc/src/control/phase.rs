//! Phases of a program and what follows each.

use metrology::PerAxis;

use super::waiting::Then;
use super::{Control, Event, Run};
use crate::diagnostic::Diagnostic;
use crate::hardware::Hardware;
use crate::lookahead::Command;
use crate::outcome::{Ending, ProgramState};
use crate::path::{Segment, target};
use crate::rs274::program::{Action, Motion, Touch, Wait};

/// Periods for which the velocity loops brake after a following error.
const BRAKING_PERIODS: u64 = 500;

/// What the control is doing; times in servo periods.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Phase {
    Idle,
    /// Along a chain of motions.
    Following,
    /// At rest after a motion.
    Settling {
        left: u64,
    },
    /// At rest before the touch that is the last step taken.
    Leading {
        left: u64,
    },
    /// Towards a surface; `rest` counts once the way is at its end.
    Touching {
        touch: Touch,
        rest: u64,
    },
    /// Slowing down after a trigger.
    Touched,
    Dwelling {
        left: u64,
    },
    /// Slowing down along the path before a feed hold.
    Pausing,
    /// At rest until somebody lets the program go on.
    Waiting {
        then: Then,
    },
    /// Slowing down along the path before the end.
    Stopping {
        ending: Ending,
    },
    /// Position loops open, velocity loops braking.
    Braking {
        left: u64,
        ending: Ending,
    },
}

impl Phase {
    /// Whether a probe that closes now has met something that no touch is about; one that leans on what it touched may
    /// tremble there.
    pub(super) const fn is_watched(&self, leans: bool) -> bool {
        match self {
            Self::Following | Self::Pausing => true,
            Self::Settling { .. }
            | Self::Leading { .. }
            | Self::Dwelling { .. }
            | Self::Waiting { .. } => !leans,
            _ => false,
        }
    }

    pub(super) fn ending(&self) -> bool {
        matches!(self, Self::Stopping { .. } | Self::Braking { .. })
    }

    pub(super) fn state(&self, running: bool) -> ProgramState {
        match self {
            Self::Idle if running => ProgramState::Running,
            Self::Idle => ProgramState::Idle,
            Self::Leading { .. } | Self::Touching { .. } | Self::Touched => ProgramState::Probing,
            Self::Pausing | Self::Waiting { .. } => ProgramState::Holding,
            Self::Stopping { ending } | Self::Braking { ending, .. } => match ending {
                Ending::Fault { .. } => ProgramState::Fault,
                _ => ProgramState::Holding,
            },
            _ => ProgramState::Running,
        }
    }
}

impl<H: Hardware> Control<H> {
    pub(super) fn brake(&mut self, ending: Ending) {
        let is_along = matches!(
            self.phase,
            Phase::Following | Phase::Pausing | Phase::Stopping { .. }
        );
        let along = self.chain.tag().filter(|_| is_along);
        if let (Some(run), Some(tag)) = (&mut self.run, along) {
            // What follows on the path has not been done.
            run.next = tag + 1;
        }
        self.rest = None;
        self.chain.clear();
        self.command.velocity = PerAxis::default();
        self.phase = Phase::Braking {
            left: BRAKING_PERIODS,
            ending,
        };
    }

    pub(super) fn next_phase(&mut self, events: &mut Vec<Event>) {
        let moving = !self.chain.done();
        let settle = self.settings.settle;
        match &mut self.phase {
            Phase::Idle => {}
            Phase::Following | Phase::Touched | Phase::Pausing | Phase::Stopping { .. }
                if moving => {}
            Phase::Pausing => self.rest_in_path(events),
            Phase::Waiting { .. } => {}
            Phase::Following | Phase::Touched => self.phase = Phase::Settling { left: settle },
            Phase::Settling { left }
            | Phase::Leading { left }
            | Phase::Dwelling { left }
            | Phase::Braking { left, .. }
                if *left > 0 =>
            {
                *left -= 1;
            }
            Phase::Settling { .. } | Phase::Dwelling { .. } => self.next_step(events),
            Phase::Leading { .. } => self.begin_touch(events),
            Phase::Touching { .. } if moving => {}
            Phase::Touching { rest, .. } if *rest < settle => *rest += 1,
            Phase::Touching { touch, .. } => {
                let touch = *touch;
                self.missed(touch, events);
            }
            Phase::Stopping { ending } => {
                let ending = ending.clone();
                self.end(ending, events);
            }
            Phase::Braking { ending, .. } => {
                let ending = ending.clone();
                let offset = *self.offset.applied();
                self.command.position = PerAxis::from_fn(|axis| {
                    if self.settings.limits.axes.contains(axis) {
                        self.measured(axis) - offset[axis]
                    } else {
                        0.0
                    }
                });
                self.end(ending, events);
            }
        }
    }

    fn end(&mut self, ending: Ending, events: &mut Vec<Event>) {
        self.spindle_rpm = 0.0;
        self.leave_registers(&ending);
        self.phase = Phase::Idle;
        self.rest = None;
        self.no_longer_waits(events);
        events.push(Event::Ended(ending));
    }

    /// The state that the next program finds.
    fn leave_registers(&mut self, ending: &Ending) {
        let along = self.chain.tag().filter(|_| !self.chain.at_end());
        let Some(run) = &self.run else {
            return;
        };
        self.change_up_to(along.unwrap_or(run.next));
        let restored = self
            .run
            .as_ref()
            .and_then(|run| run.program.restored.as_deref());
        match (restored, ending) {
            (Some(found), _) => self.registers = *found,
            (None, Ending::Done) => self.registers.end_program(),
            (None, _) => {}
        }
    }

    /// Forgets the ended program; gives its goal and the line of its last step taken.
    pub fn take_ended(&mut self) -> Option<(u64, u32)> {
        let (line, _) = self.progress();
        self.run.take().map(|run| (run.goal, line))
    }

    /// Takes steps until one of them needs time.
    pub(super) fn next_step(&mut self, events: &mut Vec<Event>) {
        while let Some(step) = self
            .run
            .as_ref()
            .and_then(|run| run.program.steps.get(run.next).copied())
        {
            if self.waits_before(step.line, events) {
                return;
            }
            if matches!(step.action, Action::Move(_)) {
                if self.begin_chain() {
                    return;
                }
                continue;
            }
            if let Some(run) = &mut self.run {
                run.next += 1;
            }
            if self.take(&step.action, events) {
                return;
            }
        }
    }

    /// Takes a step that is no motion; true where it needs time.
    fn take(&mut self, action: &Action, events: &mut Vec<Event>) -> bool {
        match *action {
            Action::Move(_) => return false,
            Action::Touch(..) => {
                self.phase = Phase::Leading {
                    left: self.settings.touch_margin,
                };
            }
            Action::Dwell(time_s) => {
                self.phase = Phase::Dwelling {
                    left: self.settings.periods(time_s),
                };
            }
            Action::Wait(Wait::OptionalStop) if !self.settings.optional_stop => return false,
            Action::Wait(why) => self.wait(why, Then::Step, events),
            Action::End => self.end(Ending::Done, events),
            Action::Spindle(rpm) => {
                self.spindle_rpm = rpm;
                return false;
            }
            Action::Mount(device) => {
                self.mount(device);
                return false;
            }
            Action::ZeroGrid => {
                self.hardware.zero_grid();
                self.note_zero("grid", self.hardware.has_grid(), events);
                return false;
            }
            Action::ZeroLength => {
                self.hardware.zero_length();
                self.note_zero("length", self.hardware.has_length(), events);
                return false;
            }
            Action::Set(_) => {
                let next = self.run.as_ref().map_or(0, |run| run.next);
                self.change_up_to(next);
                return false;
            }
        }
        true
    }

    /// Says once that nothing is mounted whose count could be set to zero, and once that something is.
    fn note_zero(&mut self, what: &'static str, is_mounted: bool, events: &mut Vec<Event>) {
        if std::mem::replace(&mut self.zeroed_nothing, !is_mounted) == is_mounted {
            let line = self.progress().0;
            events.push(Event::Noted(if is_mounted {
                Diagnostic::CountZeroed
            } else {
                Diagnostic::NothingToZero { line, what }
            }));
        }
    }

    fn mount(&mut self, device: usize) {
        let device = self
            .run
            .as_ref()
            .and_then(|run| run.program.devices.get(device));
        if let Some((name, _)) = device {
            self.hardware.mount(name);
        }
    }

    /// Plans every motion up to the next stop and begins it; false where none of them has a length.
    pub(super) fn begin_chain(&mut self) -> bool {
        let is_single = self.is_single();
        let Some(Run { program, next, .. }) = &mut self.run else {
            return false;
        };
        self.chain.clear();
        let mut at = self.command.position;
        let mut is_full = false;
        if let Some((rest, tag)) = self.rest.take() {
            at = *rest.end();
            self.chain.push(rest, tag);
            is_full = is_single;
        }
        while let Some(step) = program.steps.get(*next).filter(|_| !is_full) {
            match &step.action {
                Action::Move(motion) => {
                    if let Some(segment) = Segment::new(motion, &at, &self.settings.limits) {
                        self.chain.push(segment, *next);
                    }
                    at = target(motion, &at);
                    is_full = is_single;
                }
                Action::Set(_) => {}
                _ => break,
            }
            *next += 1;
        }
        self.chain.plan(&self.settings.limits);
        if self.chain.done() {
            self.command = Command {
                position: at,
                velocity: PerAxis::default(),
            };
            return false;
        }
        self.leans = false;
        self.phase = Phase::Following;
        true
    }

    fn current_touch(&self) -> Option<(usize, u32, Motion, Touch)> {
        let run = self.run.as_ref()?;
        let index = run.next.checked_sub(1)?;
        let step = run.program.steps.get(index)?;
        match step.action {
            Action::Touch(motion, touch) => Some((index, step.line, motion, touch)),
            _ => None,
        }
    }

    fn begin_touch(&mut self, events: &mut Vec<Event>) {
        let Some((step, line, motion, touch)) = self.current_touch() else {
            return self.next_step(events);
        };
        if self.hardware.probe_closed() == touch.until_closed {
            let ending = Ending::Stuck {
                line,
                feature: self.feature(touch.feature),
                state: signal(touch.until_closed),
            };
            return self.end(ending, events);
        }
        let at = self.command.position;
        self.chain.clear();
        if let Some(segment) = Segment::new(&motion, &at, &self.settings.limits) {
            self.approach
                .begin(segment.start(), segment.end(), &self.feedback.motor);
            self.chain.push(segment, step);
        }
        self.chain.plan(&self.settings.limits);
        self.phase = Phase::Touching { touch, rest: 0 };
    }

    fn missed(&mut self, touch: Touch, events: &mut Vec<Event>) {
        if !touch.must_happen {
            return self.next_step(events);
        }
        let line = self.current_touch().map_or(0, |(_, line, ..)| line);
        let ending = Ending::Missed {
            line,
            feature: self.feature(touch.feature),
            wanted: signal(touch.until_closed),
        };
        self.end(ending, events);
    }
}

fn signal(closed: bool) -> &'static str {
    if closed { "closed" } else { "open" }
}
