//! Runs a trial's programme on its plant in simulated time, as fast as the computer can.
//!
//! The same stages as in a scenario, wired to each other without a wire: the sequencer proposes programs, the fake
//! machine's control runs them on the plant, servo period by servo period, and every sample that a recorder would
//! have got is handed on in the order of the recording.

use fake_cnc::{Cnc, Input as ToControl, Outcome, Output as FromControl, Plant};
use metrology::sample::{
    AxisState, GridSample, LengthSample, PlanState, ProbeTrigger, TemperatureSample, TestSegment,
};
use metrology::stamp::{Host, Machine, NANOS_PER_S, Span};
use metrology::{PerAxis, Stage, Stamp};
use nalgebra::Vector3;
use sequencer::{Config, Input as ToSequencer, Output as FromSequencer, ProgramEnd, Sequencer};

use crate::error::TrialError;
use crate::rig::Rig;
use crate::scatter::Scattering;
use crate::shift::{PlateWay, Spell};

/// Time between two looks of the sequencer, s.
const LOOK_S: f64 = 0.1;
/// Time in which late stamps go through all that they wander, s.
const LATE_TURN_S: f64 = 97.0;
/// Longest programme, s.
const LIMIT_S: f64 = 4.0 * 3600.0;

/// One sample of a session.
#[derive(Clone, Debug, PartialEq)]
pub enum Sample {
    /// Positions at one tick.
    State(AxisState),
    /// A reading of the grid encoder.
    Grid(GridSample),
    /// A reading of the length reference.
    Length(LengthSample),
    /// A touch.
    Trigger(ProbeTrigger),
    /// A temperature.
    Temperature(TemperatureSample),
    /// Begin or end of a test.
    Segment(TestSegment),
}

/// A session under way.
struct Session<'a> {
    rig: &'a Rig,
    sequencer: Sequencer,
    control: Cnc<Plant>,
    began: Stamp<Host>,
    now: Stamp<Host>,
    end: Stamp<Host>,
    /// How much of the time its clock does not know, for it passed in coarse steps.
    skipped: Span,
    /// Its clock at the last state.
    controller: (Stamp<Host>, Stamp<Machine>),
    plate: PlateWay<'a>,
    scattering: Scattering<'a>,
    commanded: PerAxis<f64>,
    take: &'a mut dyn FnMut(Stamp<Host>, Sample),
    ended: Option<Result<(), TrialError>>,
    said: Vec<FromSequencer>,
    heard: Vec<FromControl>,
    /// What the control is told next.
    told: Vec<ToControl>,
}

/// Runs the whole programme; every sample goes to `take` with the instant of its recording.
///
/// # Errors
/// When the rig's files do not fit each other, or a program does not run to its end.
pub fn measure(rig: &Rig, take: &mut dyn FnMut(Stamp<Host>, Sample)) -> Result<(), TrialError> {
    let config = Config {
        start_delay_s: 0.0,
        ..Config::default()
    };
    let plan = Some(rig.plan.clone());
    let mut session = Session {
        sequencer: Sequencer::new(config, rig.machine.clone(), plan, rig.programs.clone())?,
        control: Cnc::new(
            &rig.config,
            &rig.control,
            worked(Plant::new(&rig.control, &rig.plant)?, &rig.past),
        )?,
        began: Stamp::from_nanos(rig.start_s * NANOS_PER_S),
        now: Stamp::from_nanos(rig.start_s * NANOS_PER_S),
        end: Stamp::from_nanos(rig.start_s * NANOS_PER_S) + Span::from_secs_f64(LIMIT_S),
        skipped: Span::default(),
        controller: (Stamp::default(), Stamp::default()),
        plate: PlateWay::new(rig.plate_moves.as_ref()),
        scattering: Scattering::new(&rig.scatter),
        commanded: PerAxis::default(),
        take,
        ended: None,
        said: vec![],
        heard: vec![],
        told: vec![],
        rig,
    };
    let period = Span::from_secs_f64(rig.machine.control.servo_period_ms / 1e3);
    let look = Span::from_secs_f64(LOOK_S);
    let mut next_look = session.now;
    while session.ended.is_none() {
        if session.now >= next_look {
            session.ask(ToSequencer::Tick)?;
            next_look += look;
        }
        session.tell(ToControl::Tick)?;
        if session.now > session.end {
            return Err(TrialError::Endless { limit_s: LIMIT_S });
        }
        session.now += period;
    }
    session.ended.unwrap_or(Ok(()))
}

/// A machine behind what it has done before.
fn worked(mut plant: Plant, past: &[Spell]) -> Plant {
    let rest = plant.feedback().motor;
    for spell in past {
        plant.switch(spell.is_on);
        for (slides, step) in spell.steps(&rest) {
            plant.work(&slides, spell.spindle_rpm, step);
        }
    }
    plant
}

impl Session<'_> {
    fn ask(&mut self, input: ToSequencer) -> Result<(), TrialError> {
        let rig = self.rig;
        let mut said = std::mem::take(&mut self.said);
        let Ok(()) = self.sequencer.step(self.now, input, &mut said);
        for output in said.drain(..) {
            match output {
                FromSequencer::SendProgram { id, name, text } => match rig.production.get(&name) {
                    Some(spells) => self.produce(id, spells)?,
                    None => self.told.push(ToControl::RunProgram {
                        goal: id,
                        text,
                        name,
                    }),
                },
                FromSequencer::CancelProgram(goal) => {
                    self.told.push(ToControl::CancelProgram { goal });
                }
                FromSequencer::Segment(segment) => {
                    if segment.begin {
                        self.scattering.begin(&segment);
                    }
                    (self.take)(self.now, Sample::Segment(segment));
                }
                FromSequencer::ProgramFailed { run, message, .. } => {
                    self.ended = Some(Err(TrialError::Failed { run, message }));
                }
                FromSequencer::Status(status) => match status.state {
                    PlanState::Done => self.ended = Some(Ok(())),
                    PlanState::Failed if self.ended.is_none() => {
                        let (run, message) = (status.run, status.message);
                        self.ended = Some(Err(TrialError::Failed { run, message }));
                    }
                    _ => {}
                },
                _ => {}
            }
        }
        self.said = said;
        for input in std::mem::take(&mut self.told) {
            self.tell(input)?;
        }
        Ok(())
    }

    /// Answers for a program that nobody measures, and lets its time pass in coarse steps.
    fn produce(&mut self, id: u64, spells: &[Spell]) -> Result<(), TrialError> {
        let accepted = true;
        self.ask(ToSequencer::ProgramAnswer { id, accepted })?;
        let rest = self.control.hardware().feedback().motor;
        for spell in spells {
            self.control.hardware_mut().switch(spell.is_on);
            for (slides, step) in spell.steps(&rest) {
                let plant = self.control.hardware_mut();
                plant.work(&slides, spell.spindle_rpm, step);
                self.now += step;
                self.end += step;
                self.skipped = Span::from_nanos(self.skipped.nanos() + step.nanos());
                self.tell_work(slides, step);
            }
        }
        self.control.hardware_mut().settle_at(&rest);
        let end = Some(ProgramEnd {
            done: true,
            message: String::new(),
        });
        self.ask(ToSequencer::ProgramEnd { id, end })
    }

    /// What a recorder gets of work in coarse steps: where the axes are commanded, and the thermometers at their periods.
    fn tell_work(&mut self, slides: PerAxis<f64>, step: Span) {
        let rig = self.rig;
        let (host_at, controller_at) = self.controller;
        let axes = rig.machine.axis_set();
        let controller_at = controller_at + (self.now - host_at);
        let state = AxisState::standing(self.now, controller_at, axes, slides);
        (self.take)(self.now, Sample::State(state));
        let since = self.now - self.began;
        for sensor in &rig.machine.temperature_sensors {
            let period = Span::from_secs_f64(sensor.period_s);
            if since.nanos() % period.nanos() >= step.nanos() {
                continue;
            }
            let plant = self.control.hardware_mut();
            if let Some(temperature_degc) = plant.sensor_reading(&sensor.id) {
                let sample = TemperatureSample {
                    at: self.now,
                    sensor: sensor.id.clone(),
                    temperature_degc,
                    variance_k2: 0.0,
                };
                (self.take)(self.now, Sample::Temperature(sample));
            }
        }
    }

    fn tell(&mut self, input: ToControl) -> Result<(), TrialError> {
        let mut heard = std::mem::take(&mut self.heard);
        self.control.step(self.now, input, &mut heard)?;
        for output in heard.drain(..) {
            self.hear(output)?;
        }
        self.heard = heard;
        Ok(())
    }

    fn hear(&mut self, output: FromControl) -> Result<(), TrialError> {
        match output {
            FromControl::State(mut state) => {
                self.commanded = state.commanded;
                state.controller_at += self.skipped;
                self.controller = (state.received_at, state.controller_at);
                if !self.rig.has_motors {
                    state.motor = state.commanded;
                }
                (self.take)(state.received_at, Sample::State(state));
            }
            FromControl::Grid(sample) => self.grid(sample),
            FromControl::Length(mut sample) => {
                let place_mm = self.commanded.xyz();
                let direction = sample.axis.index();
                sample.displacement_mm += self.scattering.reading_mm(direction, &place_mm);
                (self.take)(sample.at, Sample::Length(sample));
            }
            FromControl::Trigger(trigger) => self.trigger(trigger)?,
            FromControl::Temperature(sample) => {
                (self.take)(sample.at, Sample::Temperature(sample));
            }
            FromControl::Accepted { goal } => self.ask(ToSequencer::ProgramAnswer {
                id: goal,
                accepted: true,
            })?,
            FromControl::Refused { goal, .. } => self.ask(ToSequencer::ProgramAnswer {
                id: goal,
                accepted: false,
            })?,
            FromControl::Finished {
                goal,
                outcome,
                message,
                ..
            } => {
                let done = outcome == Outcome::Done;
                let end = Some(ProgramEnd { done, message });
                self.ask(ToSequencer::ProgramEnd { id: goal, end })?;
            }
            FromControl::Feedback { .. }
            | FromControl::Diagnostic(_)
            | FromControl::Answer(_)
            | FromControl::AtRest => {}
        }
        Ok(())
    }

    /// A grid reading; late stamps are the instrument's.
    fn grid(&mut self, mut sample: GridSample) {
        let recorded_at = sample.at;
        let place_mm = self.commanded.xyz();
        let [u, v] = plane_axes(sample.plane);
        sample.u_mm += self.scattering.reading_mm(u, &place_mm);
        sample.v_mm += self.scattering.reading_mm(v, &place_mm);
        let moved_mm = self.plate.moved_mm(self.now - self.began, &sample);
        sample.u_mm += moved_mm[0];
        sample.v_mm += moved_mm[1];
        let since_s = (self.now - self.began).as_secs_f64();
        let turns = since_s / LATE_TURN_S;
        let wander = self.rig.grid_late_wander * (std::f64::consts::TAU * turns).sin();
        let late_s = self.rig.grid_late_s * (1.0 + wander) + self.rig.grid_fast * since_s;
        sample.at += Span::from_secs_f64(late_s);
        (self.take)(recorded_at, Sample::Grid(sample));
    }

    /// A touch; the run's deviation moves the surface along the approach.
    fn trigger(&mut self, mut trigger: ProbeTrigger) -> Result<(), TrialError> {
        trigger.controller_at += self.skipped;
        let place_mm = trigger.latched.xyz();
        let deviation_mm =
            Vector3::from_fn(|axis, _| self.scattering.deviation_mm(axis, &place_mm));
        let along_mm = deviation_mm.dot(&trigger.approach);
        for axis in metrology::Axis::LINEAR {
            trigger.latched[axis] += along_mm * trigger.approach[axis.index()];
        }
        (self.take)(trigger.received_at, Sample::Trigger(trigger.clone()));
        self.ask(ToSequencer::Touch(trigger))
    }
}

/// First and second direction of a plane: 0, 1, 2 for X, Y, Z.
pub(crate) const fn plane_axes(plane: metrology::sample::TestPlane) -> [usize; 2] {
    use metrology::sample::TestPlane;
    match plane {
        TestPlane::Xy | TestPlane::None => [0, 1],
        TestPlane::Yz => [1, 2],
        TestPlane::Zx => [2, 0],
    }
}
