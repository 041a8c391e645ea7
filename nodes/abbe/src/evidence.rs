//! What a run leaves behind for its report: decoded messages of a few topics, and the truth where a scenario may see it.

use std::collections::BTreeSet;

use abbe_msgs::{Message, Wire, from_cdr, topics};
use metrology::sample::{
    AxisCompensation, BlockMeasurement, GeometryModel, PlanStatus, ProbeLatency, ProbedPoint,
    TestKind, TestSegment, ThermalModel,
};
use metrology::stamp::{Host, Stamp};
use nalgebra::Vector3;
use node_runtime::{Diagnostic, Level};

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
    /// Last word of the sequencer.
    pub status: Option<PlanStatus>,
    /// Its first word on each step, in order.
    pub begun: Vec<PlanStatus>,
    /// Last compensation.
    pub compensation: Option<AxisCompensation>,
    /// How well each way of predicting the drift did at each update, values in µm by name.
    pub predictions: Vec<Prediction>,
    /// Conditions above `Ok` in order.
    pub conditions: Vec<Condition>,
    /// Node and name of conditions that were `Ok` again when last heard of.
    pub over: BTreeSet<(String, String)>,
    /// Verifications with the plant's truth.
    pub verifications: Vec<Verification>,
    /// The plant's latency, s.
    pub true_latency_s: Option<f64>,
    /// Messages that could not be decoded, by topic.
    pub undecoded: Vec<String>,
}

impl Evidence {
    /// Whether [`Self::message`] looks at `topic`.
    pub fn wants(topic: &str) -> bool {
        [
            topics::LATENCY.name,
            topics::PROBE_POINT.name,
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
    pub fn message(&mut self, topic: &str, bytes: &[u8]) {
        if topic == topics::LATENCY.name {
            let taken = self.decode(&topics::LATENCY, bytes);
            self.latencies.extend(taken);
        } else if topic == topics::PROBE_POINT.name {
            let run = self.current_run();
            let taken = self.decode(&topics::PROBE_POINT, bytes);
            self.points.extend(taken.map(|point| (run, point)));
        } else if topic == topics::BLOCKS_MEASUREMENT.name {
            let taken = self.decode(&topics::BLOCKS_MEASUREMENT, bytes);
            self.blocks.extend(taken);
        } else if topic == topics::THERMAL_MODEL.name {
            let taken = self.decode(&topics::THERMAL_MODEL, bytes);
            self.models.extend(taken);
        } else if topic == topics::GEOMETRY_ROTARY.name {
            let taken = self.decode(&topics::GEOMETRY_ROTARY, bytes);
            self.rotary_models.extend(taken);
        } else if topic == topics::COMPENSATION.name {
            self.compensation = self.decode(&topics::COMPENSATION, bytes);
        } else if topic == topics::PLAN_STATUS.name {
            let status = self.decode(&topics::PLAN_STATUS, bytes);
            self.plan(status);
        } else if topic == topics::TEST_SEGMENT.name {
            let taken = self.decode(&topics::TEST_SEGMENT, bytes);
            taken.into_iter().for_each(|segment| self.segment(segment));
        }
    }

    /// Takes one condition.
    pub fn condition(&mut self, at: Stamp<Host>, node: &str, diagnostic: &Diagnostic) {
        let key = (node.to_owned(), diagnostic.name.to_string());
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
        } else if JUDGEMENTS.contains(&diagnostic.name.as_ref()) {
            let (node, diagnostic) = (node.to_owned(), diagnostic.clone());
            self.judgements.push(Condition {
                at,
                node,
                diagnostic,
            });
        } else if diagnostic.level != Level::Ok {
            let (node, diagnostic) = (node.to_owned(), diagnostic.clone());
            self.conditions.push(Condition {
                at,
                node,
                diagnostic,
            });
        }
    }

    fn plan(&mut self, status: Option<PlanStatus>) {
        if let Some(status) = &status
            && !status.activity.is_empty()
            && self
                .begun
                .last()
                .is_none_or(|last| last.step != status.step)
        {
            self.begun.push(status.clone());
        }
        self.status = status;
    }

    /// The run that is under way; 0: none.
    fn current_run(&self) -> u32 {
        self.segments
            .last()
            .filter(|segment| segment.begin)
            .map_or(0, |segment| segment.run)
    }

    fn segment(&mut self, segment: TestSegment) {
        if segment.begin && segment.kind == TestKind::Verification {
            let label = segment.features.first().cloned().unwrap_or_default();
            self.verifications.push(Verification {
                label,
                at: segment.at,
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
        if let Some(verification) = self.verifications.last_mut() {
            verification.poses.push(pose);
        }
    }

    fn decode<M: Message + Wire>(
        &mut self,
        topic: &topics::Topic<M>,
        bytes: &[u8],
    ) -> Option<M::Inner> {
        let decoded = from_cdr::<M>(bytes).and_then(M::into_inner);
        if let Err(error) = &decoded {
            self.undecoded.push(format!("{}: {error}", topic.name));
        }
        decoded.ok()
    }
}
