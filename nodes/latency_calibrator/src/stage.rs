//! The latency calibrator's whole computation: states, triggers and segments in, latencies out.
//!
//! Touches of a latency segment are collected with their feed at contact, as soon as the log reaches
//! their latch; `hold_ms` after the segment's end they are evaluated, feature by feature.

use std::collections::{BTreeMap, VecDeque};

use machine::file::Latch;
use machine::{Kinematics, MachineFile};
use metrology::bound::TOUCHES_OF_RUN;
use metrology::sample::{AxisState, NewTouches, ProbeLatency, ProbeTrigger, TestKind, TestSegment};
use metrology::{Axis, AxisSet, Host, Machine, Stage, Stamp};

use crate::config::LatencyCalibratorConfig;
use crate::diagnostic::{Refusal, TouchFault};
use crate::error::LatencyCalibratorError;
use crate::evaluation::{FeedTouch, LatencyEvaluation, TouchNoise, evaluate};
use crate::motion_log::MotionLog;

/// Touches whose latch the log has not reached yet: of more the oldest is read as the log is now.
const MOST_UNREAD: usize = 1_000;
/// Rounding allowed in the length of an approach.
const UNIT_ROUNDING: f64 = 1e-6;
/// Least cosine between the approaches of one feature: 0.1°.
const SAME_APPROACH: f64 = 0.999_998;

/// What the node is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Positions at one servo tick.
    State(AxisState),
    /// A touch.
    Trigger(ProbeTrigger),
    /// Begin or end of a test.
    Segment(TestSegment),
    /// Time passes.
    Tick,
}

/// What the node says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// A latency, ready to be used.
    Latency(ProbeLatency),
    /// Every value behind it.
    Evaluation(Box<LatencyEvaluation>),
    /// What is refused or doubtful.
    Refused(Refusal),
    /// The controller's stamps ran backwards; the log was emptied.
    ClockWentBack {
        /// Newest stamp before.
        from: Stamp<Machine>,
        /// Stamp that came.
        to: Stamp<Machine>,
    },
}

/// The latency calibrator's computation.
#[derive(Clone, Debug)]
pub struct LatencyCalibratorStage {
    config: LatencyCalibratorConfig,
    axes: AxisSet,
    kinematics: Kinematics,
    noise: TouchNoise,
    log: MotionLog,
    run: Option<Run>,
    touches: NewTouches,
}

/// An open or ending latency run.
#[derive(Clone, Debug)]
struct Run {
    number: u32,
    touches: Vec<Touch>,
    /// Places of those whose feed is not read yet, in order.
    unread: VecDeque<usize>,
    /// End and when it was told.
    end: Option<(Stamp<Host>, TestSegment)>,
}

#[derive(Clone, Debug)]
struct Touch {
    trigger: ProbeTrigger,
    /// Feed at contact, mm/s; `None`: the log has not reached the latch yet.
    feed: Option<Result<f64, TouchFault>>,
}

impl LatencyCalibratorStage {
    /// From parameters and machine file.
    ///
    /// # Errors
    /// Parameters or repeatability out of range, a chain that cannot be read.
    pub fn new(
        config: &LatencyCalibratorConfig,
        file: &MachineFile,
    ) -> Result<Self, LatencyCalibratorError> {
        config.check()?;
        let repeatability_um = file.probe.repeatability_um;
        // Touches are weighted by its inverse square.
        if !machine::file::REPEATABILITY_UM.contains(&repeatability_um) {
            return Err(LatencyCalibratorError::NoRepeatability { repeatability_um });
        }
        check_log(config, file.control.servo_period_ms)?;
        let poll_period_s = match file.control.latch {
            Latch::Hardware => 0.0,
            Latch::Polled => file.control.servo_period_ms / 1e3,
        };
        Ok(Self {
            axes: file.axis_set(),
            kinematics: Kinematics::new(file)
                .map_err(|error| LatencyCalibratorError::Chain { error })?,
            noise: TouchNoise {
                repeatability_mm: repeatability_um / 1e3,
                poll_period_s,
                ball_radius_mm: file.ball_radius_mm(),
                resolution_mm: Axis::LINEAR
                    .into_iter()
                    .filter_map(|axis| file.linear(axis))
                    .map(|entry| entry.encoder_resolution_um / 1e3)
                    .fold(0.0, f64::max),
            },
            log: MotionLog::new(config.log_samples),
            run: None,
            touches: NewTouches::default(),
            config: config.clone(),
        })
    }

    fn take_state(
        &mut self,
        state: &AxisState,
        out: &mut Vec<Output>,
    ) -> Result<(), LatencyCalibratorError> {
        self.check_axes("axis state", state.axes)?;
        let newest = self.log.newest();
        if !self.log.push(state)
            && let Some(from) = newest
        {
            out.push(Output::ClockWentBack {
                from,
                to: state.controller_at,
            });
            if let Some(run) = &mut self.run {
                for place in run.unread.drain(..) {
                    run.touches[place].feed = Some(Err(TouchFault::ClockWentBack));
                }
            }
        }
        self.read_feeds(false);
        Ok(())
    }

    /// Reads the feed of every touch whose latch the log has reached, or of all.
    fn read_feeds(&mut self, all: bool) {
        let newest = self.log.newest();
        let Some(run) = &mut self.run else { return };
        let mut surplus = run.unread.len().saturating_sub(MOST_UNREAD);
        let (log, config, touches) = (&self.log, &self.config, &mut run.touches);
        run.unread.retain(|place| {
            let touch = &mut touches[*place];
            let latch_at = touch.trigger.controller_at;
            let is_reached = newest.is_some_and(|newest| newest >= latch_at);
            if !(all || is_reached || surplus > 0) {
                return true;
            }
            surplus = surplus.saturating_sub(1);
            touch.feed = Some(log.feed_at_contact_mm_s(
                latch_at,
                &touch.trigger.approach,
                config.feed_window(),
                config.steady_share,
            ));
            false
        });
    }

    fn take_trigger(
        &mut self,
        at: Stamp<Host>,
        trigger: ProbeTrigger,
        out: &mut Vec<Output>,
    ) -> Result<(), LatencyCalibratorError> {
        self.check_axes("trigger", trigger.axes)?;
        let length = trigger.approach.norm();
        if (length - 1.0).abs() > UNIT_ROUNDING {
            return Err(LatencyCalibratorError::ApproachNotUnit {
                sequence: trigger.sequence,
                length,
            });
        }
        if !self.touches.is_new(at, &trigger) {
            out.push(Output::Refused(Refusal::ToldBefore {
                sequence: trigger.sequence,
            }));
            return Ok(());
        }
        if let Some(run) = &mut self.run {
            let held = run.touches.len();
            if held >= TOUCHES_OF_RUN {
                out.push(Output::Refused(Refusal::TooManyTouches {
                    run: run.number,
                    held,
                    sequence: trigger.sequence,
                }));
                return Ok(());
            }
            let finite = trigger.approach.iter().all(|c| c.is_finite())
                && self
                    .axes
                    .iter()
                    .all(|axis| trigger.latched[axis].is_finite());
            let feed = (!finite).then_some(Err(TouchFault::NotFinite));
            if finite {
                run.unread.push_back(held);
            }
            run.touches.push(Touch { trigger, feed });
            self.read_feeds(false);
        }
        Ok(())
    }

    fn take_segment(&mut self, at: Stamp<Host>, segment: TestSegment, out: &mut Vec<Output>) {
        if segment.kind != TestKind::Latency {
            return;
        }
        if segment.begin {
            self.close(at, true, out);
            if let Some(open) = self.run.take() {
                out.push(Output::Refused(Refusal::NotEnded {
                    run: open.number,
                    next: segment.run,
                }));
            }
            self.run = Some(Run {
                number: segment.run,
                touches: Vec::new(),
                unread: VecDeque::new(),
                end: None,
            });
        } else if let Some(run) = &mut self.run
            && run.number == segment.run
        {
            run.end = Some((at, segment));
        } else {
            out.push(Output::Refused(Refusal::NotBegun { run: segment.run }));
        }
    }

    /// Evaluates a run whose end was told at least `hold_ms` ago, or at once.
    fn close(&mut self, at: Stamp<Host>, at_once: bool, out: &mut Vec<Output>) {
        let Some((told_at, _)) = self.run.as_mut().and_then(|run| run.end.as_mut()) else {
            return;
        };
        *told_at = (*told_at).min(at); // host time went back: the wait begins anew
        if !at_once && at - *told_at < self.config.hold() {
            return;
        }
        self.read_feeds(true);
        let Some(run) = self.run.take() else {
            return;
        };
        let Some((_, end)) = &run.end else {
            return;
        };
        let made = run.touches.len();
        if !end.completed {
            out.push(Output::Refused(Refusal::NotCompleted {
                run: run.number,
                made,
            }));
        } else if made == 0 {
            out.push(Output::Refused(Refusal::NothingTouched { run: run.number }));
        } else {
            for (feature, touches) in by_feature(&run.touches) {
                self.evaluate_feature(feature, at, &touches, out);
            }
        }
    }

    fn evaluate_feature(
        &self,
        feature: &str,
        at: Stamp<Host>,
        touches: &[&Touch],
        out: &mut Vec<Output>,
    ) {
        let mut usable: Vec<FeedTouch> = Vec::new();
        for touch in touches {
            match self.usable(touch, usable.first()) {
                Ok(touch) => usable.push(touch),
                Err(fault) => out.push(Output::Refused(Refusal::Touch {
                    feature: feature.to_owned(),
                    sequence: touch.trigger.sequence,
                    fault,
                })),
            }
        }
        let made = touches.len();
        match evaluate(feature, at, &usable, made, &self.noise, &self.config) {
            Ok(evaluation) => self.publish(evaluation, out),
            Err(refusal) => out.push(Output::Refused(refusal)),
        }
    }

    fn usable(&self, touch: &Touch, first: Option<&FeedTouch>) -> Result<FeedTouch, TouchFault> {
        let feed_mm_s = touch.feed.unwrap_or(Err(TouchFault::NotFinite))?;
        let trigger = &touch.trigger;
        let approach = self
            .kinematics
            .direction_in_workpiece(&trigger.latched, &trigger.approach);
        if let Some(first) = first {
            let cosine = approach.dot(&first.approach);
            if cosine < SAME_APPROACH {
                return Err(TouchFault::OtherApproach { cosine });
            }
        }
        Ok(FeedTouch {
            feed_mm_s,
            ball_mm: self.kinematics.ball_in_workpiece_mm(&trigger.latched),
            approach,
        })
    }

    fn publish(&self, evaluation: LatencyEvaluation, out: &mut Vec<Output>) {
        let (p, limit) = (
            evaluation.latency.lack_of_fit_p,
            self.config.lack_of_fit_limit,
        );
        if p < limit {
            out.push(Output::Refused(Refusal::LackOfFit {
                feature: evaluation.feature.clone(),
                p,
                limit,
            }));
        }
        if evaluation.latency.negative {
            out.push(Output::Refused(Refusal::Negative {
                feature: evaluation.feature.clone(),
                latency_s: evaluation.latency.latency_s,
            }));
        }
        out.push(Output::Latency(evaluation.latency.clone()));
        out.push(Output::Evaluation(Box::new(evaluation)));
    }

    fn check_axes(
        &self,
        sample: &'static str,
        axes: AxisSet,
    ) -> Result<(), LatencyCalibratorError> {
        match self.axes.iter().find(|axis| !axes.contains(*axis)) {
            Some(axis) => Err(LatencyCalibratorError::AxisMissing { sample, axis }),
            None => Ok(()),
        }
    }
}

/// The touches of each feature, features in the order in which they were first touched.
fn by_feature(touches: &[Touch]) -> Vec<(&str, Vec<&Touch>)> {
    let mut places = BTreeMap::new();
    let mut features: Vec<(&str, Vec<&Touch>)> = Vec::new();
    for touch in touches {
        let feature = touch.trigger.feature_id.as_str();
        let place = *places.entry(feature).or_insert_with(|| {
            features.push((feature, Vec::new()));
            features.len() - 1
        });
        features[place].1.push(touch);
    }
    features
}

/// Whether the log reaches from the latest moment at which a touch may be read back over its window.
fn check_log(
    config: &LatencyCalibratorConfig,
    servo_period_ms: f64,
) -> Result<(), LatencyCalibratorError> {
    let covered_ms = config.log_samples as f64 * servo_period_ms;
    let needed_ms = config.feed_window_ms + config.hold_ms;
    if covered_ms >= needed_ms {
        return Ok(());
    }
    Err(LatencyCalibratorError::LogTooShort {
        log_samples: config.log_samples,
        servo_period_ms,
        covered_ms,
        needed_ms,
    })
}

impl Stage for LatencyCalibratorStage {
    type Input = Input;
    type Output = Output;
    type Error = LatencyCalibratorError;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), LatencyCalibratorError> {
        match input {
            Input::State(state) => self.take_state(&state, out)?,
            Input::Trigger(trigger) => self.take_trigger(at, trigger, out)?,
            Input::Segment(segment) => self.take_segment(at, segment, out),
            Input::Tick => {}
        }
        self.close(at, false, out);
        Ok(())
    }
}
