//! What a run leaves behind for its report: decoded messages of a few topics, and the truth where a scenario may see it.

use std::collections::{BTreeMap, BTreeSet};

use abbe_msgs::{Defect, Message, Wire, WireError, from_cdr, topics};
use metrology::Axis;
use metrology::epoch::utc_of_nanos;
use metrology::sample::{
    AxisCompensation, BlockMeasurement, GeometryModel, PlanStatus, ProbeLatency, ProbeTrigger,
    ProbedPoint, TestKind, TestSegment, ThermalModel,
};
use metrology::stamp::{Host, Stamp};
use nalgebra::Vector3;
use node_runtime::{Diagnostic, Level};

mod start_up;

use crate::evaluate::acts;
use crate::evaluate::course::Course;
use start_up::StartUp;

/// One pose of a verification: the machine stood still there.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseError {
    /// Where the program sent the tool, mm.
    pub commanded_mm: Vector3<f64>,
    /// True error of the tool relative to the workpiece, machine frame, mm.
    pub error_mm: Vector3<f64>,
}

/// One verification program.
#[derive(Clone, Debug, PartialEq)]
pub struct Verification {
    /// Its label in the plan.
    pub label: String,
    /// When it began.
    pub at: Stamp<Host>,
    /// Whether an offset acted at one of its poses at least.
    pub is_compensated: bool,
    /// Poses in the order of the program.
    pub poses: Vec<PoseError>,
}

/// A condition that a node reported.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// When.
    pub at: Stamp<Host>,
    /// By whom.
    pub node: String,
    /// What.
    pub diagnostic: Diagnostic,
    /// Whether it came while the node was starting.
    pub is_of_start: bool,
}

/// How well each way of predicting the drift did at one update.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// When.
    pub at: Stamp<Host>,
    /// Residual by the way's name, µm; empty: not there.
    pub residuals_um: Vec<(&'static str, String)>,
}

/// Value that only the thermal model's score of its predictions has.
const PREDICTION_KEY: &str = "hold_um";

/// What the calibration of the rotary axes says when all is well.
const JUDGEMENTS: [&str; 2] = ["calibrated", "verified"];

/// How the sequencer says which angles point the probe along a direction.
const PROBE_AXIS: &str = "probe_axis";

/// The condition of a controller whose program does not go on by itself.
const PROGRAM_WAITS: &str = "program_waits";

/// Everything that a report is written from.
#[derive(Debug, Default)]
pub struct Evidence {
    /// Latency estimates in order.
    pub latencies: Vec<ProbeLatency>,
    /// Corrected touches in order, each with the run it belongs to.
    pub points: Vec<(u32, ProbedPoint)>,
    /// Block measurements in order.
    pub blocks: Vec<BlockMeasurement>,
    /// Models in order.
    pub models: Vec<ThermalModel>,
    /// Segments in order.
    pub segments: Vec<TestSegment>,
    /// Models of the rotary axes in order.
    pub rotary_models: Vec<GeometryModel>,
    /// What the calibration of the rotary axes said of itself and of its verifications.
    pub judgements: Vec<Condition>,
    /// How directions of the probe's axis were taken.
    pub pointings: Vec<Diagnostic>,
    /// Last word of the sequencer.
    pub status: Option<PlanStatus>,
    /// Its first word on each step, in order.
    pub begun: Vec<PlanStatus>,
    /// Last compensation.
    pub compensation: Option<AxisCompensation>,
    /// Offsets of X, Y and Z that were applied, mm.
    pub offsets: Course<[f64; 3]>,
    /// How well each way of predicting the drift did at each update, values in µm by name.
    pub predictions: Vec<Prediction>,
    /// Conditions above `Ok` in order.
    pub conditions: Vec<Condition>,
    /// Node and name of conditions that were `Ok` again when last heard of.
    pub over: BTreeSet<(String, String)>,
    /// The start of each node.
    pub start_up: StartUp,
    /// Verifications with the plant's truth.
    pub verifications: Vec<Verification>,
    /// Touches of latency runs as the control latched them, each with the run it belongs to.
    pub latched: Vec<(u32, ProbeTrigger)>,
    /// The latency that the simulated probe has, s.
    pub true_latency_s: Option<f64>,
    /// Where the true latency is stated, where that is not the plant.
    pub true_latency_source: Option<String>,
    /// Messages that could not be used, by topic and reason.
    pub undecoded: BTreeMap<(String, Defect), Undecoded>,
}

/// Messages of one topic that could not be used for one reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Undecoded {
    /// How many.
    pub messages: u64,
    /// When the first of them came.
    pub first: Stamp<Host>,
    /// What is wrong with the first of them.
    pub what: String,
}

impl Evidence {
    /// Whether [`Self::message`] looks at `topic`.
    pub fn wants(topic: &str) -> bool {
        [
            topics::LATENCY.name,
            topics::PROBE_POINT.name,
            topics::PROBE_TRIGGER.name,
            topics::BLOCKS_MEASUREMENT.name,
            topics::THERMAL_MODEL.name,
            topics::GEOMETRY_ROTARY.name,
            topics::COMPENSATION.name,
            topics::PLAN_STATUS.name,
            topics::TEST_SEGMENT.name,
        ]
        .contains(&topic)
    }

    /// Takes one publication of `topic`.
    pub fn message(&mut self, topic: &str, at: Stamp<Host>, bytes: &[u8]) {
        if topic == topics::LATENCY.name {
            let taken = self.decode(&topics::LATENCY, (at, bytes));
            self.latencies.extend(taken);
        } else if topic == topics::PROBE_POINT.name {
            let run = self.current_run();
            let taken = self.decode(&topics::PROBE_POINT, (at, bytes));
            if taken.is_some() {
                self.start_up.work();
            }
            self.points.extend(taken.map(|point| (run, point)));
        } else if topic == topics::PROBE_TRIGGER.name {
            let run = self.current_run();
            let is_of_latency = |segment: &TestSegment| segment.kind == TestKind::Latency;
            if self.segments.last().is_some_and(is_of_latency) {
                let taken = self.decode(&topics::PROBE_TRIGGER, (at, bytes));
                self.latched.extend(taken.map(|touch| (run, touch)));
            }
        } else if topic == topics::BLOCKS_MEASUREMENT.name {
            let taken = self.decode(&topics::BLOCKS_MEASUREMENT, (at, bytes));
            self.blocks.extend(taken);
        } else if topic == topics::THERMAL_MODEL.name {
            let taken = self.decode(&topics::THERMAL_MODEL, (at, bytes));
            self.models.extend(taken);
        } else if topic == topics::GEOMETRY_ROTARY.name {
            let taken = self.decode(&topics::GEOMETRY_ROTARY, (at, bytes));
            self.rotary_models.extend(taken);
        } else if topic == topics::COMPENSATION.name {
            let taken = self.decode(&topics::COMPENSATION, (at, bytes));
            if let Some(taken) = &taken {
                self.offsets
                    .add(at, Axis::LINEAR.map(|axis| taken.total[axis]));
            }
            self.compensation = taken.or(self.compensation.take());
        } else if topic == topics::PLAN_STATUS.name {
            let status = self.decode(&topics::PLAN_STATUS, (at, bytes));
            status.into_iter().for_each(|status| self.plan(status));
        } else if topic == topics::TEST_SEGMENT.name {
            let taken = self.decode(&topics::TEST_SEGMENT, (at, bytes));
            taken.into_iter().for_each(|segment| self.segment(segment));
        }
    }

    /// What a program was waiting for when last heard of, behind a colon; empty where none waits.
    pub fn waiting_for(&self) -> String {
        let waits = { self.conditions.iter().rev() }.find(|condition| {
            let name = condition.diagnostic.name.to_string();
            name == PROGRAM_WAITS && !self.over.contains(&(condition.node.clone(), name))
        });
        waits.map_or_else(String::new, |condition| {
            let message = &condition.diagnostic.message;
            format!(": {}: {message}", condition.node)
        })
    }

    /// Takes one condition.
    pub fn condition(&mut self, at: Stamp<Host>, node: &str, diagnostic: &Diagnostic) {
        let (level, name) = (diagnostic.level, diagnostic.name.as_ref());
        let is_of_start = self.start_up.hear(at, node, name, level);
        let key = (node.to_owned(), name.to_owned());
        if diagnostic.level == Level::Ok {
            self.over.insert(key);
        } else {
            self.over.remove(&key);
        }
        if diagnostic
            .values
            .iter()
            .any(|(name, _)| *name == PREDICTION_KEY)
        {
            let diagnostic = diagnostic.clone();
            self.predictions.push(Prediction {
                at,
                residuals_um: diagnostic.values,
            });
        } else if name == PROBE_AXIS {
            self.pointings.push(diagnostic.clone());
        } else if JUDGEMENTS.contains(&diagnostic.name.as_ref()) {
            let (node, diagnostic) = (node.to_owned(), diagnostic.clone());
            self.judgements.push(Condition {
                at,
                node,
                diagnostic,
                is_of_start,
            });
        } else if diagnostic.level != Level::Ok {
            let (node, diagnostic) = (node.to_owned(), diagnostic.clone());
            self.conditions.push(Condition {
                at,
                node,
                diagnostic,
                is_of_start,
            });
        }
    }

    fn plan(&mut self, status: PlanStatus) {
        if !status.activity.is_empty()
            && self
                .begun
                .last()
                .is_none_or(|last| last.step != status.step)
        {
            self.begun.push(status.clone());
        }
        self.status = Some(status);
    }

    /// The run that is under way; 0: none.
    fn current_run(&self) -> u32 {
        self.segments
            .last()
            .filter(|segment| segment.begin)
            .map_or(0, |segment| segment.run)
    }

    fn segment(&mut self, segment: TestSegment) {
        if segment.begin {
            self.start_up.propose(segment.at);
        } else {
            self.start_up.work();
        }
        if segment.begin && segment.kind == TestKind::Verification {
            let label = segment.features.first().cloned().unwrap_or_default();
            self.verifications.push(Verification {
                label,
                at: segment.at,
                is_compensated: false,
                poses: Vec::new(),
            });
        }
        self.segments.push(segment);
    }

    /// Whether a verification is under way.
    pub fn verifying(&self) -> bool {
        self.segments
            .last()
            .is_some_and(|segment| segment.begin && segment.kind == TestKind::Verification)
    }

    /// Adds a pose to the verification that is under way.
    pub fn pose(&mut self, pose: PoseError) {
        let is_compensated = self.compensation.as_ref().is_some_and(acts);
        if let Some(verification) = self.verifications.last_mut() {
            verification.is_compensated |= is_compensated;
            verification.poses.push(pose);
        }
    }

    fn decode<M: Message + Wire>(
        &mut self,
        topic: &topics::Topic<M>,
        (at, bytes): (Stamp<Host>, &[u8]),
    ) -> Option<M::Inner> {
        let decoded = from_cdr::<M>(bytes).and_then(M::into_inner);
        if let Err(error) = &decoded {
            self.cannot_use(topic.name, at, error);
        }
        decoded.ok()
    }

    /// A sentence for each topic and reason of messages that could not be used.
    pub fn not_used(&self) -> impl Iterator<Item = String> {
        self.undecoded.iter().map(|((topic, defect), it)| {
            let (n, what) = (it.messages, &it.what);
            let first = utc_of_nanos(it.first.nanos(), 3);
            let reason = defect.words();
            format!(
                "{topic}: {n} messages could not be used, {reason}: {what} (the first came at {first})"
            )
        })
    }

    /// Counts a message that cannot be used.
    pub fn cannot_use(&mut self, topic: &str, at: Stamp<Host>, error: &WireError) {
        let key = (topic.to_owned(), error.defect());
        let known = self.undecoded.entry(key).or_insert_with(|| Undecoded {
            messages: 0,
            first: at,
            what: error.to_string(),
        });
        known.messages += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_that_cannot_be_used_came_at_a_date() {
        let mut evidence = Evidence::default();
        let at = Stamp::from_nanos(1_700_003_585_250_000_000);
        evidence.message(topics::LATENCY.name, at, &[0, 1]);
        let line: String = evidence.not_used().collect();
        assert!(
            line.ends_with("(the first came at 2023-11-14 23:13:05.250 UTC)"),
            "{line}"
        );
    }

    #[test]
    fn what_a_program_waits_for_is_named_until_it_goes_on() {
        let mut evidence = Evidence::default();
        let at = Stamp::from_nanos(0);
        let tell = |evidence: &mut Evidence, level, name: &'static str, message: &str| {
            let diagnostic = Diagnostic::new(level, name, message.to_owned());
            evidence.condition(at, "linuxcnc_bridge", &diagnostic);
        };
        assert_eq!(evidence.waiting_for(), "");
        let paused = "the program is paused at line 3 (M0)";
        tell(&mut evidence, Level::Warn, PROGRAM_WAITS, paused);
        tell(&mut evidence, Level::Warn, "homing", "not homed");
        let expected = format!(": linuxcnc_bridge: {paused}");
        assert_eq!(evidence.waiting_for(), expected);
        tell(&mut evidence, Level::Ok, PROGRAM_WAITS, "it goes on");
        assert_eq!(evidence.waiting_for(), "");
    }
}
