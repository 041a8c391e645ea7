//! The probe node's whole computation: states, triggers, latencies and segments in, points, blocks
//! and shapes out.
//!
//! A trigger may overtake the position that it needs, since the two come on different topics: it
//! waits for `hold_ms` at most. The end of a segment may overtake its last trigger and waits as long
//! before the run is evaluated; where a test ran to its end and a feature of it was not touched yet, the touches are
//! still on their way and it waits for `MISSING_TOUCHES`. All are settled by whatever event comes next, a tick at the latest.

use std::collections::VecDeque;

use machine::file::Latch;
use machine::{Kinematics, MachineFile};
use metrology::bound::TOUCHES_OF_RUN;
use metrology::sample::{
    AxisState, BlockMeasurement, Correction, NewTouches, ProbeLatency, ProbeTrigger, ProbedFeature,
    ProbedPoint, Rejection, TestKind, TestSegment,
};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, Host, Stage, Stamp};

use crate::config::ProbeConfig;
use crate::correction::{AtContact, TouchModel, TouchUncertainty, axes_at_contact, rejected};
use crate::diagnostic::Diagnostic;
use crate::error::ProbeError;
use crate::latency_in_use::LatencyInUse;
use crate::queue::{CoordinateQueue, Stored};
use crate::run::{Run, RunTouch, is_probing};
use crate::{block, shape};

/// Touches and segments that may wait at once: a touch waits for `hold_ms`, and a machine makes a few in a second.
const MOST_WAITING: usize = 10_000;
/// How long the end of a test waits for touches that must have been made: as long as the sequencer does.
const MISSING_TOUCHES: Span = Span::from_nanos(10_000_000_000);
/// Rounding allowed in the length of an approach.
const UNIT_ROUNDING: f64 = 1e-6;

/// What the node is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Positions at one servo tick.
    State(AxisState),
    /// A touch.
    Trigger(ProbeTrigger),
    /// A calibrated latency.
    Latency(ProbeLatency),
    /// Begin or end of a test.
    Segment(TestSegment),
    /// Time passes.
    Tick,
}

/// What the node says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// A corrected or rejected touch.
    Point(ProbedPoint),
    /// Three faces of a block.
    Block(BlockMeasurement),
    /// A fitted shape.
    Feature(ProbedFeature),
    /// A condition worth reporting.
    Diagnostic(Diagnostic),
}

/// The probe node's computation.
#[derive(Clone, Debug)]
pub struct ProbeStage {
    file: MachineFile,
    axes: AxisSet,
    model: TouchModel,
    queue: CoordinateQueue,
    hold: Span,
    allow_feed_correction: bool,
    latency: Option<LatencyInUse>,
    /// When the latency in use was calibrated, where it was.
    calibrated_at: Option<Stamp<Host>>,
    waiting: VecDeque<Waiting>,
    run: Option<Run>,
    last_sequence: Option<u32>,
    touches: NewTouches,
}

/// An event that waits, and since when.
#[derive(Clone, Debug)]
struct Waiting {
    since: Stamp<Host>,
    event: WaitingEvent,
}

#[derive(Clone, Debug)]
enum WaitingEvent {
    Trigger {
        trigger: ProbeTrigger,
        clock_went_back: bool,
    },
    Begin(TestSegment),
    End(TestSegment),
}

impl ProbeStage {
    /// From parameters and machine file.
    ///
    /// # Errors
    /// Parameters out of range, a given latency without its uncertainty, a machine file without the
    /// mounted stylus or with a chain that cannot be read.
    pub fn new(config: &ProbeConfig, file: &MachineFile) -> Result<Self, ProbeError> {
        config.check()?;
        if file.mounted_stylus().is_none() {
            return Err(ProbeError::UnknownStylus {
                stylus: file.probe.mounted.clone(),
            });
        }
        let poll_period_s = match file.control.latch {
            Latch::Hardware => 0.0,
            Latch::Polled => file.control.servo_period_ms / 1e3,
        };
        Ok(Self {
            axes: file.axis_set(),
            model: TouchModel {
                kinematics: Kinematics::new(file).map_err(|error| ProbeError::Chain { error })?,
                repeatability_mm: file.probe.repeatability_um / 1e3,
                poll_period_s,
            },
            queue: CoordinateQueue::new(config.queue_samples, config.longest_gap()),
            hold: config.hold(),
            allow_feed_correction: config.allow_feed_correction,
            latency: config.given_latency(file)?.map(LatencyInUse::from),
            calibrated_at: None,
            waiting: VecDeque::with_capacity(64),
            run: None,
            last_sequence: None,
            touches: NewTouches::default(),
            file: file.clone(),
        })
    }

    fn take_state(&mut self, state: &AxisState, out: &mut Vec<Output>) -> Result<(), ProbeError> {
        self.check_axes("axis state", state.axes)?;
        match self.queue.push(state, self.axes) {
            Stored::InOrder | Stored::Repeated => {}
            Stored::NotFinite { axis } => {
                out.push(Output::Diagnostic(Diagnostic::PositionNotFinite {
                    axis,
                    at: state.controller_at,
                    value: state.motor[axis],
                }));
            }
            Stored::WentBack { from } => {
                let waiting = self.distrust_waiting();
                // Touches of the new time line come before those of the old one.
                self.touches = NewTouches::default();
                out.push(Output::Diagnostic(Diagnostic::ClockWentBack {
                    from,
                    to: state.controller_at,
                    waiting,
                }));
            }
        }
        Ok(())
    }

    /// Marks waiting touches: the positions that they wait for are on another time line.
    fn distrust_waiting(&mut self) -> u32 {
        let mut marked = 0;
        for waiting in &mut self.waiting {
            if let WaitingEvent::Trigger {
                clock_went_back, ..
            } = &mut waiting.event
            {
                *clock_went_back = true;
                marked += 1;
            }
        }
        marked
    }

    fn take_trigger(
        &mut self,
        at: Stamp<Host>,
        trigger: ProbeTrigger,
        out: &mut Vec<Output>,
    ) -> Result<(), ProbeError> {
        self.check_axes("trigger", trigger.axes)?;
        let length = trigger.approach.norm();
        // A length that is no number is a bad measurement, not a broken contract.
        if (length - 1.0).abs() > UNIT_ROUNDING {
            return Err(ProbeError::ApproachNotUnit {
                sequence: trigger.sequence,
                length,
            });
        }
        if !self.touches.is_new(at, &trigger) {
            out.push(Output::Diagnostic(Diagnostic::ToldBefore {
                sequence: trigger.sequence,
            }));
            return Ok(());
        }
        if let Some(after) = self.last_sequence
            && trigger.sequence > after.saturating_add(1)
        {
            out.push(Output::Diagnostic(Diagnostic::TriggersLost {
                after,
                before: trigger.sequence,
            }));
        }
        self.last_sequence = Some(trigger.sequence);
        if self.is_full(out) {
            return Ok(());
        }
        // The last touch of a run may come after the end of its segment.
        let behind_end = self
            .waiting
            .back()
            .is_some_and(|last| matches!(last.event, WaitingEvent::End(_)));
        let place = self.waiting.len() - usize::from(behind_end);
        let waiting = Waiting {
            since: at,
            event: WaitingEvent::Trigger {
                trigger,
                clock_went_back: false,
            },
        };
        self.waiting.insert(place, waiting);
        Ok(())
    }

    fn take_latency(&mut self, at: Stamp<Host>, latency: &ProbeLatency, out: &mut Vec<Output>) {
        // One of the future is of before the host's clock was set back.
        let in_use = self.calibrated_at.filter(|in_use| *in_use <= at);
        if let Some(in_use) = in_use
            && latency.at < in_use
        {
            out.push(Output::Diagnostic(Diagnostic::LatencyOlder {
                by_s: (in_use - latency.at).as_secs_f64(),
            }));
            return;
        }
        match LatencyInUse::from_calibration(latency) {
            Ok(usable) => {
                self.latency = Some(usable);
                self.calibrated_at = Some(latency.at);
            }
            Err(diagnostic) => out.push(Output::Diagnostic(diagnostic)),
        }
    }

    /// Whether nothing more can wait; reports it then.
    fn is_full(&self, out: &mut Vec<Output>) -> bool {
        let held = self.waiting.len();
        let is_full = held >= MOST_WAITING;
        if is_full {
            let what = "touches and segments that wait";
            out.push(Output::Diagnostic(Diagnostic::TooMany { held, what }));
        }
        is_full
    }

    fn take_segment(&mut self, at: Stamp<Host>, segment: TestSegment, out: &mut Vec<Output>) {
        if is_probing(segment.kind) && !self.is_full(out) {
            let event = if segment.begin {
                WaitingEvent::Begin(segment)
            } else {
                WaitingEvent::End(segment)
            };
            self.waiting.push_back(Waiting { since: at, event });
        }
    }

    /// Handles waiting events in order, up to the first that must wait on.
    fn settle(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        while let Some(mut waiting) = self.waiting.pop_front() {
            waiting.since = waiting.since.min(at); // host time went back: the wait begins anew
            let waited = at - waiting.since;
            let may_wait = waited < self.hold;
            match waiting.event {
                WaitingEvent::Trigger {
                    ref trigger,
                    clock_went_back,
                } => {
                    let Some(touch) = self.resolve(trigger, clock_went_back, may_wait, out) else {
                        self.waiting.push_front(waiting);
                        return;
                    };
                    out.push(Output::Point(touch.point.clone()));
                    if let Some(run) = &mut self.run {
                        let held = run.touches.len();
                        if held < TOUCHES_OF_RUN {
                            run.touches.push(touch);
                        } else {
                            let what = "touches of a run";
                            out.push(Output::Diagnostic(Diagnostic::TooMany { held, what }));
                        }
                    }
                }
                WaitingEvent::Begin(segment) => self.begin(segment, out),
                WaitingEvent::End(ref segment)
                    if may_wait || (waited < MISSING_TOUCHES && self.lacks_touches(segment)) =>
                {
                    self.waiting.push_front(waiting);
                    return;
                }
                WaitingEvent::End(segment) => self.end(segment, out),
            }
        }
    }

    /// Corrects a touch; `None`: it must wait.
    fn resolve(
        &self,
        trigger: &ProbeTrigger,
        clock_went_back: bool,
        may_wait: bool,
        out: &mut Vec<Output>,
    ) -> Option<RunTouch> {
        let unusable = |rejection| {
            Some(RunTouch {
                point: rejected(trigger, rejection),
                uncertainty: TouchUncertainty {
                    independent_mm: f64::NAN,
                    common_mm: f64::NAN,
                },
                latency: None,
            })
        };
        if clock_went_back {
            return unusable(Rejection::ClockWentBack);
        }
        let finite = trigger.feed_mm_s.is_finite()
            && trigger.approach.iter().all(|c| c.is_finite())
            && self
                .axes
                .iter()
                .all(|axis| trigger.latched[axis].is_finite());
        if !finite {
            return unusable(Rejection::NotFinite);
        }
        let Some(latency) = &self.latency else {
            return unusable(Rejection::NoLatency);
        };
        let allow = self.allow_feed_correction;
        let (axes, correction) =
            match axes_at_contact(&self.queue, trigger, latency, allow, may_wait)? {
                AtContact::Queued(axes) => (axes, Correction::Queue),
                AtContact::Extrapolated(axes, miss) => {
                    let sequence = trigger.sequence;
                    out.push(Output::Diagnostic(Diagnostic::CorrectedByFeed {
                        sequence,
                        miss,
                    }));
                    (axes, Correction::Feed)
                }
                AtContact::Unknown(rejection) => return unusable(rejection),
            };
        let radius_mm = self.ball_radius_mm();
        Some(RunTouch {
            point: self
                .model
                .point(trigger, (&axes, correction), latency, radius_mm),
            uncertainty: self.model.uncertainty(trigger.feed_mm_s, latency),
            latency: Some(*latency),
        })
    }

    /// Radius of the open run's stylus, else of the mounted one, mm.
    fn ball_radius_mm(&self) -> f64 {
        self.run
            .as_ref()
            .and_then(|run| run.ball_radius_mm)
            .unwrap_or_else(|| self.file.ball_radius_mm())
    }

    /// Whether a test ran to its end and the run has no touch yet of a feature that it names.
    fn lacks_touches(&self, end: &TestSegment) -> bool {
        let run = self.run.as_ref().filter(|run| run.number() == end.run);
        end.completed && run.is_some_and(|run| !run.has_touched(&end.features))
    }

    fn begin(&mut self, segment: TestSegment, out: &mut Vec<Output>) {
        if let Some(open) = &self.run {
            out.push(Output::Diagnostic(Diagnostic::RunNotEnded {
                run: open.number(),
                next: segment.run,
            }));
        }
        let styli = &self.file.probe.styli;
        let ball_radius_mm = if segment.stylus.is_empty() {
            Some(self.file.ball_radius_mm())
        } else {
            styli.get(&segment.stylus).map(|stylus| stylus.radius_mm)
        };
        if ball_radius_mm.is_none() {
            out.push(Output::Diagnostic(Diagnostic::UnknownStylus {
                run: segment.run,
                stylus: segment.stylus.clone(),
            }));
        }
        self.run = Some(Run {
            segment,
            ball_radius_mm,
            touches: Vec::new(),
        });
    }

    fn end(&mut self, segment: TestSegment, out: &mut Vec<Output>) {
        let number = segment.run;
        match self.run.take() {
            Some(mut run) if run.number() == number => {
                if run.segment.features.is_empty() {
                    run.segment.features = segment.features;
                }
                if let Some(radius_mm) = run.ball_radius_mm {
                    self.evaluate(&run, radius_mm, out);
                }
            }
            other => {
                self.run = other;
                out.push(Output::Diagnostic(Diagnostic::RunNotBegun { run: number }));
            }
        }
    }

    fn evaluate(&self, run: &Run, radius_mm: f64, out: &mut Vec<Output>) {
        for owner in run.owners() {
            let block = self.file.blocks.iter().find(|block| block.id == owner);
            let mut artefacts = self.file.artefacts.iter();
            let artefact = artefacts.find(|entry| machine::cycle::artefact_id(entry) == owner);
            match (run.segment.kind, block, artefact) {
                (_, None, None) => {
                    out.push(Output::Diagnostic(Diagnostic::UnknownFeature {
                        run: run.number(),
                        feature: owner,
                    }));
                }
                (TestKind::Block, Some(block), _) => block::evaluate(run, block, radius_mm, out),
                (
                    TestKind::Plane
                    | TestKind::Bore
                    | TestKind::Sphere
                    | TestKind::Rotary
                    | TestKind::RotaryVerification,
                    _,
                    Some(artefact),
                ) => {
                    shape::evaluate(run, artefact, radius_mm, out);
                }
                _ => {}
            }
        }
    }

    fn check_axes(&self, sample: &'static str, axes: AxisSet) -> Result<(), ProbeError> {
        let mut missing = self.axes.iter().filter(|axis: &Axis| !axes.contains(*axis));
        match missing.next() {
            Some(axis) => Err(ProbeError::AxisMissing { sample, axis }),
            None => Ok(()),
        }
    }
}

impl Stage for ProbeStage {
    type Input = Input;
    type Output = Output;
    type Error = ProbeError;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), ProbeError> {
        match input {
            Input::State(state) => self.take_state(&state, out)?,
            Input::Trigger(trigger) => self.take_trigger(at, trigger, out)?,
            Input::Latency(latency) => self.take_latency(at, &latency, out),
            Input::Segment(segment) => self.take_segment(at, segment, out),
            Input::Tick => {}
        }
        self.settle(at, out);
        Ok(())
    }
}
