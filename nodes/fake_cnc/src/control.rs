//! The control proper: runs a checked program, one servo period at a time.
//!
//! Each period it closes the loops with the command and the feedback of its beginning, lets the machine
//! move, looks at the probe, moves the command along the path to the end of the period, looks at the
//! following errors and decides what comes next. Command and feedback with one stamp thus belong to
//! one instant, and an axis at constant speed v lags by (1 - f) v / K_p. It allocates
//! when a program is accepted and when a touch or an end is reported, never otherwise.
//!
//! # Stops
//! A chain of motions ends in an exact stop with a rest of `settle_s`. A touch begins after a rest of
//! `touch_margin_s` more. After the trigger, on cancel and on a fault of the probe the command slows
//! down along its path. On a following error the position loops open and the velocity loops brake to
//! rest; the command is then put where the axes stand. A fault does not latch: the next program runs.
//! Every end stops the spindle, as M2 does.
//!
//! # State between programs
//! Changes of [`Registers`] are steps of a program, so an end at any line leaves the state of that line.
//! M2 then resets what LinuxCNC resets. A program in machine coordinates leaves the state that it found.

mod homing;
mod phase;
mod verification;
mod waiting;

use metrology::stamp::Span;
use metrology::{Author, Axis, Machine, PerAxis, Stamp};

use crate::config::{FeedbackSource, Settings};
use crate::diagnostic::Diagnostic;
use crate::error::ProgramError;
use crate::hardware::Hardware;
use crate::lookahead::{Chain, Command};
use crate::offset::OffsetInput;
use crate::outcome::{Ending, ProgramState};
use crate::path::Segment;
use crate::plant::Feedback;
use crate::rs274::program::{Action, FirstMotion, Program};
use crate::rs274::{self, Registers};
use crate::servo::Servo;
use crate::touching::{Approach, Latched};
use homing::Homing;
use phase::Phase;

/// What happened in a period.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A touch was latched.
    Touched(Latched),
    /// The program ended.
    Ended(Ending),
    /// A condition worth telling.
    Noted(Diagnostic),
}

/// A program on its way.
#[derive(Clone, Debug)]
struct Run {
    goal: u64,
    program: Program,
    next: usize,
    /// Steps whose changes are in the registers.
    changed: usize,
    /// What is still to be verified.
    first_motion: Option<FirstMotion>,
    /// Line of the block that was begun last; 0 where the next may begin.
    block: u32,
}

/// The control of one machine.
#[derive(Clone, Debug)]
pub struct Control<H> {
    hardware: H,
    settings: Settings,
    command: Command,
    feedback: Feedback,
    servos: PerAxis<Servo>,
    offset: OffsetInput,
    chain: Chain,
    phase: Phase,
    run: Option<Run>,
    approach: Approach,
    spindle_rpm: f64,
    full_left: u64,
    registers: Registers,
    homing: Homing,
    /// What a feed hold left of a motion, with its step.
    rest: Option<(Segment, usize)>,
    hold_wanted: bool,
    step_wanted: bool,
    /// Whether the wait of the program was reported.
    waits: bool,
    /// Whether the probe may still lean on what it touched.
    leans: bool,
    /// Whether it stands that a count was to be zero that nothing mounted has.
    zeroed_nothing: bool,
    /// Two publishers of offsets: nothing is touched meanwhile.
    contested: Option<(Author, Author)>,
}

impl<H: Hardware> Control<H> {
    /// A control at rest at the configured start position.
    pub fn new(settings: Settings, mut hardware: H) -> Self {
        hardware.settle_at(&settings.start);
        Self {
            feedback: hardware.feedback(),
            hardware,
            command: Command {
                position: settings.start,
                velocity: PerAxis::default(),
            },
            servos: PerAxis::from_fn(|axis| Servo::new(settings.gains[axis])),
            offset: OffsetInput::new(
                settings.offset_rule(),
                settings.offset,
                settings.compensation_hold,
            ),
            chain: Chain::with_capacity(0),
            phase: Phase::Idle,
            run: None,
            approach: Approach::default(),
            spindle_rpm: 0.0,
            full_left: 0,
            registers: Registers::default(),
            homing: Homing::begin(settings.homing),
            rest: None,
            hold_wanted: false,
            step_wanted: false,
            waits: false,
            leans: false,
            zeroed_nothing: false,
            contested: None,
            settings,
        }
    }

    /// The modal state, as programs leave it to each other.
    pub const fn registers(&self) -> &Registers {
        &self.registers
    }

    /// Its settings.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The machine that it drives.
    pub const fn hardware(&self) -> &H {
        &self.hardware
    }

    /// The machine that it drives, to read its sensors.
    pub const fn hardware_mut(&mut self) -> &mut H {
        &mut self.hardware
    }

    /// Commanded positions without compensation, mm or rad.
    pub const fn commanded(&self) -> &PerAxis<f64> {
        &self.command.position
    }

    /// What the encoders said at the end of the last period.
    pub const fn feedback(&self) -> &Feedback {
        &self.feedback
    }

    /// The compensation input.
    pub const fn offset_mut(&mut self) -> &mut OffsetInput {
        &mut self.offset
    }

    /// Compensation in effect, mm or rad.
    pub const fn offset(&self) -> &PerAxis<f64> {
        self.offset.applied()
    }

    /// Whether no compensation is in effect.
    pub fn offset_is_zero(&self) -> bool {
        Axis::ALL.iter().all(|axis| self.offset()[*axis] == 0.0)
    }

    /// Goal of the program on its way.
    pub fn goal(&self) -> Option<u64> {
        self.run.as_ref().map(|run| run.goal)
    }

    /// Line of the step that is executed, and the share of steps that are done.
    pub fn progress(&self) -> (u32, f64) {
        let Some(run) = &self.run else {
            return (0, 0.0);
        };
        let along = matches!(
            self.phase,
            Phase::Following | Phase::Pausing | Phase::Stopping { .. }
        );
        let step = match self.chain.tag().filter(|_| along) {
            Some(step) => step,
            None => run.next.saturating_sub(1),
        };
        let steps = &run.program.steps;
        let line = steps.get(step).map_or(0, |step| step.line);
        (line, step as f64 / steps.len() as f64)
    }

    /// Name of a feature of the program on its way.
    pub fn feature(&self, index: usize) -> String {
        self.run
            .as_ref()
            .and_then(|run| run.program.features.get(index))
            .cloned()
            .unwrap_or_default()
    }

    /// What it is doing.
    pub fn state(&self) -> ProgramState {
        self.phase.state(self.run.is_some())
    }

    /// Whether axis states are wanted at the full rate.
    pub const fn full_rate(&self) -> bool {
        self.full_left > 0
    }

    /// Checks `text` and starts it; the control must be idle.
    ///
    /// # Errors
    /// What the program asks that this control could not do; nothing has moved.
    pub fn start(&mut self, goal: u64, text: &str) -> Result<(), ProgramError> {
        let start = &self.command.position;
        let program = rs274::read_in(text, &self.settings.envelope, start, &self.registers)?;
        program.check_devices(|name| self.hardware.has_device(name))?;
        if let (Some((one, other)), Some(line)) = (self.contested, program.first_touch()) {
            let why = Diagnostic::CompensationContested { one, other };
            let why = Box::new(why);
            return Err(ProgramError::Contested { line, why });
        }
        self.leans = self.hardware.probe_closed();
        self.chain.reserve(program.longest_chain().max(1));
        self.run = Some(Run {
            goal,
            first_motion: program.first_motion,
            program,
            next: 0,
            changed: 0,
            block: 0,
        });
        self.phase = Phase::Settling { left: 0 };
        Ok(())
    }

    /// Two publishers of offsets speak, or one alone again: what is applied fades, and a program that touches ends.
    pub fn contest(&mut self, contested: Option<(Author, Author)>) {
        self.contested = contested;
        let Some((one, other)) = contested else {
            return;
        };
        self.offset.release();
        let touches = { self.run.as_ref() }.is_some_and(|run| run.program.first_touch().is_some());
        if touches && !self.phase.ending() {
            let line = self.progress().0;
            let diagnostic = Diagnostic::CompensationContested { one, other };
            self.stop(Ending::Fault { line, diagnostic });
        }
    }

    /// Slows down along the path and ends the program.
    pub fn cancel(&mut self) {
        if self.run.is_some() && !self.phase.ending() {
            let line = self.progress().0;
            self.stop(Ending::Cancelled { line });
        }
    }

    /// One servo period that begins at `began`.
    pub fn tick(&mut self, began: Stamp<Machine>, events: &mut Vec<Event>) {
        let period = self.settings.period;
        let demand = self.demand();
        self.feedback = self.hardware.step(&demand, self.spindle_rpm, period);
        self.watch_probe(began, period, events);
        match self.chain.advance(self.settings.limits.period_s) {
            Some(command) => self.command = command,
            None => self.command.velocity = PerAxis::default(),
        }
        self.go_on_homing(events);
        if let Some(stale) = self.offset.advance() {
            events.push(Event::Noted(stale));
        }
        self.watch_following(events);
        self.verify_first_motion();
        self.next_phase(events);
        if self.wants_full_rate() {
            self.full_left = self.settings.touch_margin.max(1);
        } else {
            self.full_left = self.full_left.saturating_sub(1);
        }
    }

    fn demand(&mut self) -> PerAxis<f64> {
        let period_s = self.settings.limits.period_s;
        let braking = matches!(self.phase, Phase::Braking { .. });
        let mut demand = PerAxis::default();
        for axis in Axis::ALL {
            if !self.settings.limits.axes.contains(axis) {
                continue;
            }
            let velocity = self.feedback.velocity[axis];
            let measured = self.measured(axis);
            let servo = &mut self.servos[axis];
            demand[axis] = if braking {
                servo.follow_velocity(0.0, velocity, period_s)
            } else {
                let wanted = self.command.position[axis] + self.offset.applied()[axis];
                let error = wanted - measured;
                servo.demand(error, self.command.velocity[axis], velocity, period_s)
            };
        }
        demand
    }

    /// The position that closes this axis' loop, mm or rad.
    fn measured(&self, axis: Axis) -> f64 {
        match self.settings.feedback[axis] {
            FeedbackSource::Motor => self.feedback.motor[axis],
            FeedbackSource::Scale => self.feedback.scale[axis],
        }
    }

    fn watch_probe(&mut self, began: Stamp<Machine>, period: Span, events: &mut Vec<Event>) {
        if matches!(self.phase, Phase::Touching { .. }) {
            self.approach.record(&self.feedback.motor);
        }
        let Some(edge) = self.hardware.probe_edge() else {
            return;
        };
        match self.phase {
            Phase::Touching { touch, .. } if touch.until_closed == edge.closed => {
                let latch = self.settings.latch;
                let mut latched = self
                    .approach
                    .latch(latch, &edge, &self.feedback, began, period);
                latched.feature = touch.feature;
                events.push(Event::Touched(latched));
                self.chain.stop();
                self.leans = true;
                self.phase = Phase::Touched;
            }
            _ if edge.closed && self.phase.is_watched(self.leans) => {
                let line = self.progress().0;
                let diagnostic = Diagnostic::ProbeTripped {
                    line,
                    place: self.place(),
                };
                events.push(Event::Noted(diagnostic.clone()));
                self.stop(Ending::Fault { line, diagnostic });
            }
            _ => {}
        }
    }

    /// Where the axes are, as a person writes it: machine coordinates, mm and deg.
    fn place(&self) -> String {
        let axes = self.settings.limits.axes.iter();
        let each = axes.map(|axis| {
            let motor = self.feedback.motor[axis];
            if axis.is_linear() {
                format!("{axis}{motor:.3}")
            } else {
                format!("{axis}{:.3}", motor.to_degrees())
            }
        });
        each.collect::<Vec<_>>().join(" ")
    }

    fn watch_following(&mut self, events: &mut Vec<Event>) {
        if matches!(self.phase, Phase::Braking { .. }) {
            return;
        }
        for axis in Axis::ALL {
            if !self.settings.limits.axes.contains(axis) {
                continue;
            }
            let wanted = self.command.position[axis] + self.offset.applied()[axis];
            let error = wanted - self.measured(axis);
            let limit = self.settings.following_error_limit[axis];
            // Also true for an error that is not a number.
            if error.abs() <= limit {
                continue;
            }
            let diagnostic = Diagnostic::FollowingError { axis, error, limit };
            events.push(Event::Noted(diagnostic.clone()));
            let line = self.progress().0;
            self.brake(Ending::Fault { line, diagnostic });
            return;
        }
    }

    /// Puts the changes of the steps before `end` into the registers.
    fn change_up_to(&mut self, end: usize) {
        let Some(run) = &mut self.run else {
            return;
        };
        for step in run.program.steps.iter().take(end).skip(run.changed) {
            if let Action::Set(change) = &step.action {
                self.registers.apply(change);
            }
        }
        run.changed = run.changed.max(end);
    }

    fn stop(&mut self, ending: Ending) {
        self.rest = None;
        self.chain.stop();
        self.phase = Phase::Stopping { ending };
    }

    fn wants_full_rate(&self) -> bool {
        match self.phase {
            Phase::Leading { .. } | Phase::Touching { .. } | Phase::Touched => true,
            Phase::Following | Phase::Pausing | Phase::Stopping { .. } => self
                .run
                .as_ref()
                .zip(self.chain.tag())
                .is_some_and(|(run, tag)| run.program.steps[tag].full_rate),
            _ => false,
        }
    }
}
