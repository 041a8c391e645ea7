//! The node's computation: programs, compensation and time in; states, touches and readings out.

use machine::{MachineFile, program_machine};
use metrology::sample::{
    AxisCompensation, AxisState, GridSample, LengthSample, ProbeTrigger, TemperatureSample,
};
use metrology::stamp::Span;
use metrology::{Author, AuthorNews, Host, SoleAuthor, Stage, Stamp};

use crate::clock::Clocks;
use crate::config::{Config, Settings};
use crate::control::{Control, Event};
use crate::diagnostic::Diagnostic;
use crate::error::CncError;
use crate::hardware::Hardware;
use crate::outcome::{Outcome, ProgramState};
use crate::plant::Plant;
use crate::rs274::Registers;
use crate::touching::Latched;

/// A clock that goes back by less is waited for: messages that tell the time may overtake each other. By more, it was set.
const DISORDER: Span = Span::from_nanos(100_000_000);

/// What the control is told.
#[expect(
    clippy::large_enum_variant,
    reason = "a box would allocate at every compensation message"
)]
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Run a program.
    RunProgram {
        /// Number of the request.
        goal: u64,
        /// RS-274/NGC.
        text: String,
        /// For displays.
        name: String,
    },
    /// End a program.
    CancelProgram {
        /// Number of the request that started it.
        goal: u64,
    },
    /// Offsets to add to the commands.
    Compensation(AxisCompensation),
    /// The control may act, or is to come to rest and say when it has.
    Active(bool),
    /// Hold the program on its way.
    Pause,
    /// Let a program that waits go on.
    Resume,
    /// Let a program that waits go on for one block.
    StepBlock,
    /// Home every axis anew.
    Home,
    /// Time has come this far: simulate the servo periods that fit.
    Tick,
}

/// What the control says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Positions at one servo tick.
    State(AxisState),
    /// A touch.
    Trigger(ProbeTrigger),
    /// A temperature reading.
    Temperature(TemperatureSample),
    /// A grid encoder reading.
    Grid(GridSample),
    /// A reading of the length reference.
    Length(LengthSample),
    /// The request is taken; a program that is not executable ends at once with [`Outcome::Refused`].
    Accepted {
        /// Its request.
        goal: u64,
    },
    /// The request is not taken: another program is on its way, or the control is not active.
    Refused {
        /// Its request.
        goal: u64,
        /// Why.
        message: String,
    },
    /// Where the program is.
    Feedback {
        /// Its request.
        goal: u64,
        /// Line, from 1.
        line: u32,
        /// What the control is doing.
        state: ProgramState,
        /// Share of steps that are done.
        progress: f64,
    },
    /// The program ended.
    Finished {
        /// Its request.
        goal: u64,
        /// How.
        outcome: Outcome,
        /// Why, with line, column, value and limit where it was refused; empty when done.
        message: String,
        /// Last line that was executed, from 1.
        line: u32,
    },
    /// A condition worth telling.
    Diagnostic(Diagnostic),
    /// The answer to [`Input::Pause`], [`Input::Resume`], [`Input::StepBlock`] and [`Input::Home`]: done, or why not.
    Answer(Result<(), &'static str>),
    /// After [`Input::Active`] with false: no program is on its way, and no offset is in effect.
    AtRest,
}

/// Whether programs and offsets are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Activity {
    Active,
    /// On the way to rest.
    Ending,
    Inactive,
}

#[derive(Clone, Debug)]
struct Sensor {
    id: String,
    every: u64,
}

/// A control and the machine it drives, as one stage.
#[derive(Clone, Debug)]
pub struct Cnc<H = Plant> {
    control: Control<H>,
    clocks: Clocks,
    sensors: Vec<Sensor>,
    authors: SoleAuthor,
    last_tick: Option<Stamp<Host>>,
    activity: Activity,
    /// The mark of the machine file, by which programs name the one that they are made for.
    mark: Option<u64>,
    touches: u32,
    faulted: bool,
    time_disturbed: bool,
    events: Vec<Event>,
}

impl<H: Hardware> Cnc<H> {
    /// A control of `hardware` as `machine` describes it, that may act at once.
    ///
    /// # Errors
    /// A parameter out of its range, by name.
    pub fn new(config: &Config, machine: &MachineFile, hardware: H) -> Result<Self, CncError> {
        let settings = Settings::new(config, machine)?;
        let sensors = machine
            .temperature_sensors
            .iter()
            .map(|sensor| Sensor {
                id: sensor.id.clone(),
                every: settings.periods(sensor.period_s).max(1),
            })
            .collect();
        Ok(Self {
            clocks: Clocks::new(settings.period, settings.clock_offset, settings.clock_drift),
            control: Control::new(settings, hardware),
            sensors,
            authors: SoleAuthor::default(),
            last_tick: None,
            activity: Activity::Active,
            mark: program_machine::mark_of(machine),
            touches: 0,
            faulted: false,
            time_disturbed: false,
            events: Vec::new(),
        })
    }

    /// The same, but it takes programs and offsets only once [`Input::Active`] says so.
    #[must_use]
    pub fn inactive(mut self) -> Self {
        self.activity = Activity::Inactive;
        self
    }

    /// The machine, whose truth a scenario may read and no node may.
    pub const fn hardware(&self) -> &H {
        self.control.hardware()
    }

    /// The machine, to set up what a test lets it do.
    pub const fn hardware_mut(&mut self) -> &mut H {
        self.control.hardware_mut()
    }

    /// Whether no program is on its way.
    pub fn idle(&self) -> bool {
        self.control.goal().is_none()
    }

    /// Commanded positions without compensation, mm or rad.
    pub const fn commanded(&self) -> &metrology::PerAxis<f64> {
        self.control.commanded()
    }

    /// Compensation in effect, mm or rad.
    pub const fn offset(&self) -> &metrology::PerAxis<f64> {
        self.control.offset()
    }

    /// The modal state, as programs leave it to each other.
    pub const fn registers(&self) -> &Registers {
        self.control.registers()
    }

    /// Whether every axis is homed.
    pub const fn is_homed(&self) -> bool {
        self.control.is_homed()
    }

    /// The offsets that come next are of this publisher, whether they can be read or not.
    pub fn hears(&mut self, at: Stamp<Host>, author: Author) {
        self.authors.hear(at, author);
    }

    /// Nobody is followed while two publishers speak.
    fn watch_authors(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let diagnostic = match self.authors.tick(at) {
            Some(AuthorNews::Contested(one, other)) => {
                self.control.contest(Some((one, other)));
                Diagnostic::CompensationContested { one, other }
            }
            Some(AuthorNews::Alone) => {
                self.control.contest(None);
                Diagnostic::CompensationUncontested
            }
            None => return,
        };
        out.push(Output::Diagnostic(diagnostic));
    }

    fn run_program(&mut self, goal: u64, text: &str, out: &mut Vec<Output>) {
        let refused = match self.control.goal() {
            Some(other) => Some(format!("program {other} is running")),
            None if self.activity != Activity::Active => {
                Some("the control is not active".to_owned())
            }
            None if !self.control.is_homed() => {
                Some("the axes are not homed: wait until they are".to_owned())
            }
            None => None,
        };
        if let Some(message) = refused {
            out.push(Output::Refused { goal, message });
            return;
        }
        out.push(Output::Accepted { goal });
        if let Err(other) = program_machine::check(text, self.mark) {
            out.push(Output::Finished {
                goal,
                outcome: Outcome::Refused,
                line: 1,
                message: other.to_string(),
            });
            return;
        }
        match self.control.start(goal, text) {
            Ok(()) => {
                if std::mem::take(&mut self.faulted) {
                    out.push(Output::Diagnostic(Diagnostic::FaultCleared));
                }
            }
            Err(error) => out.push(Output::Finished {
                goal,
                outcome: Outcome::Refused,
                line: error.line(),
                message: error.to_string(),
            }),
        }
    }

    fn cancel(&mut self, goal: u64, out: &mut Vec<Output>) {
        if self.control.goal() == Some(goal) {
            self.control.cancel();
        } else {
            out.push(Output::Diagnostic(Diagnostic::NothingToCancel { goal }));
        }
    }

    /// Does what somebody asks of the control, and answers.
    fn serve(&mut self, input: &Input, out: &mut Vec<Output>) {
        let answer = match input {
            Input::Pause => self.control.pause(&mut self.events),
            Input::Resume => self.control.resume(false, &mut self.events),
            Input::StepBlock => self.control.resume(true, &mut self.events),
            _ => self.control.home(),
        };
        for event in self.events.drain(..) {
            if let Event::Noted(diagnostic) = event {
                out.push(Output::Diagnostic(diagnostic));
            }
        }
        out.push(Output::Answer(answer));
    }

    fn act(&mut self, active: bool, out: &mut Vec<Output>) {
        match (self.activity, active) {
            (_, true) => self.activity = Activity::Active,
            (Activity::Active, false) => {
                self.activity = Activity::Ending;
                self.control.cancel();
                self.control.offset_mut().release();
                self.look_whether_at_rest(out);
            }
            (Activity::Ending, false) => {}
            (Activity::Inactive, false) => out.push(Output::AtRest),
        }
    }

    fn look_whether_at_rest(&mut self, out: &mut Vec<Output>) {
        if self.activity == Activity::Ending && self.idle() && self.control.offset_is_zero() {
            self.activity = Activity::Inactive;
            out.push(Output::AtRest);
        }
    }

    fn pass_time(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        if let Some(last) = self.last_tick.filter(|last| at < *last) {
            self.time_went_back(at, last - at, out);
            return;
        }
        self.last_tick = Some(at);
        let Some(now) = self.clocks.host_ahead(0) else {
            self.clocks.anchor(at);
            return;
        };
        let limit = self.control.settings().longest_catch_up;
        if at - now > limit {
            self.clocks.anchor(at);
            self.time_disturbed = true;
            out.push(Output::Diagnostic(Diagnostic::TimeJumped {
                by_s: (at - now).as_secs_f64(),
                limit_s: limit.as_secs_f64(),
            }));
            return;
        }
        if std::mem::take(&mut self.time_disturbed) {
            out.push(Output::Diagnostic(Diagnostic::TimePasses));
        }
        while let Some(end) = self.clocks.host_ahead(1).filter(|end| *end <= at) {
            self.period(end, out);
        }
    }

    /// A control has a clock of its own, which goes on where the host's was set back.
    fn time_went_back(&mut self, at: Stamp<Host>, by: Span, out: &mut Vec<Output>) {
        let by_s = by.as_secs_f64();
        self.time_disturbed = true;
        out.push(Output::Diagnostic(if by > DISORDER {
            self.clocks.anchor(at);
            self.last_tick = Some(at);
            Diagnostic::TimeSetBack { by_s }
        } else {
            Diagnostic::TimeWentBack { by_s }
        }));
    }

    /// One servo period that ends at host time `end`.
    fn period(&mut self, end: Stamp<Host>, out: &mut Vec<Output>) {
        let began = self.clocks.machine_now();
        self.control.tick(began, &mut self.events);
        self.clocks.advance();
        self.report_state(end, out);
        if !self.events.is_empty() {
            self.report_events(end, out);
        }
        self.report_progress(out);
        self.report_temperatures(end, out);
        self.look_whether_at_rest(out);
    }

    fn report_state(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let settings = self.control.settings();
        let every = if self.control.full_rate() {
            settings.state_every
        } else {
            settings.background_every
        };
        if !self.clocks.count().is_multiple_of(every) {
            return;
        }
        let feedback = self.control.feedback();
        out.push(Output::State(AxisState {
            received_at: at,
            controller_at: self.clocks.machine_now(),
            axes: settings.limits.axes,
            commanded: *self.control.commanded(),
            motor: feedback.motor,
            scale: feedback.scale,
            velocity: feedback.velocity,
        }));
        let hardware = self.control.hardware_mut();
        if let Some(reading) = hardware.grid_reading() {
            out.push(Output::Grid(GridSample {
                at,
                plane: reading.plane,
                u_mm: reading.u_mm,
                v_mm: reading.v_mm,
                zero_id: reading.zero_id,
            }));
        }
        if let Some(reading) = hardware.length_reading() {
            out.push(Output::Length(LengthSample {
                at,
                axis: reading.axis,
                displacement_mm: reading.displacement_mm,
                zero_id: reading.zero_id,
            }));
        }
    }

    fn report_events(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let mut events = std::mem::take(&mut self.events);
        for event in events.drain(..) {
            match event {
                Event::Noted(diagnostic) => out.push(Output::Diagnostic(diagnostic)),
                Event::Touched(latched) => out.push(self.trigger(at, &latched)),
                Event::Ended(ending) => {
                    self.faulted |= ending.outcome() == Outcome::Fault;
                    if let Some((goal, line)) = self.control.take_ended() {
                        out.push(Output::Finished {
                            goal,
                            outcome: ending.outcome(),
                            message: ending.to_string(),
                            line: ending.line().unwrap_or(line),
                        });
                    }
                }
            }
        }
        self.events = events;
    }

    fn trigger(&mut self, at: Stamp<Host>, latched: &Latched) -> Output {
        self.touches += 1;
        Output::Trigger(ProbeTrigger {
            received_at: at,
            controller_at: latched.at,
            feature_id: self.control.feature(latched.feature),
            approach: latched.approach,
            feed_mm_s: latched.feed_mm_s,
            axes: self.control.settings().limits.axes,
            latched: latched.positions,
            sequence: self.touches,
        })
    }

    fn report_progress(&self, out: &mut Vec<Output>) {
        let every = self.control.settings().feedback_every;
        if !self.clocks.count().is_multiple_of(every) {
            return;
        }
        if let Some(goal) = self.control.goal() {
            let (line, progress) = self.control.progress();
            out.push(Output::Feedback {
                goal,
                line,
                state: self.control.state(),
                progress,
            });
        }
    }

    fn report_temperatures(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let count = self.clocks.count();
        for sensor in &self.sensors {
            if !count.is_multiple_of(sensor.every) {
                continue;
            }
            let reading = self.control.hardware_mut().sensor_reading_degc(&sensor.id);
            if let Some(temperature_degc) = reading {
                out.push(Output::Temperature(TemperatureSample {
                    at,
                    sensor: sensor.id.clone(),
                    temperature_degc,
                    variance_k2: 0.0,
                }));
            }
        }
    }
}

impl<H: Hardware> Stage for Cnc<H> {
    type Input = Input;
    type Output = Output;
    type Error = CncError;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), CncError> {
        match input {
            Input::RunProgram { goal, text, .. } => self.run_program(goal, &text, out),
            Input::CancelProgram { goal } => self.cancel(goal, out),
            Input::Active(active) => self.act(active, out),
            Input::Pause | Input::Resume | Input::StepBlock | Input::Home => {
                self.serve(&input, out);
            }
            Input::Compensation(_)
                if self.activity != Activity::Active || !self.authors.follows_last() => {}
            Input::Compensation(message) => {
                let told = self.control.offset_mut().receive(at, &message);
                out.extend(told.map(Output::Diagnostic));
            }
            Input::Tick => {
                self.watch_authors(at, out);
                self.pass_time(at, out);
            }
        }
        Ok(())
    }
}
