//! Samples in; at each look, the parts of the page that have changed.

use std::collections::BTreeMap;
use std::convert::Infallible;

use metrology::sample::{
    AxisCompensation, AxisState, GapSummary, GeometryModel, MachineValue, PlanStatus,
    PositioningTable, ProbeLatency, ProbedPoint, TemperatureSample, TestSegment, ThermalModel,
};
use metrology::stamp::{Host, Span};
use metrology::{Axis, Stage, Stamp};

use crate::page::{Condition, Page};

/// Inputs of the page.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Positions of the axes.
    Axes(AxisState),
    /// Offsets applied now.
    Offsets(AxisCompensation),
    /// State of the plan.
    Plan(PlanStatus),
    /// Begin or end of a test.
    Test(TestSegment),
    /// Drift since cold.
    Drift(Box<ThermalModel>),
    /// A temperature.
    Temperature(TemperatureSample),
    /// A touch after correction.
    Touch(ProbedPoint),
    /// Latency of the probe signal.
    Latency(ProbeLatency),
    /// Geometric errors of the linear axes.
    Geometry(GeometryModel),
    /// Geometric errors of the rotary axes.
    Rotary(GeometryModel),
    /// Positioning deviations of an axis.
    Positioning(PositioningTable),
    /// Report of a diagnosis.
    Gap(GapSummary),
    /// A value that a machine reports.
    Value(MachineValue),
    /// A node is alive, by its full name.
    Node(String),
    /// A condition of a node, or its end.
    Condition(Condition),
    /// A message of a topic could not be used.
    Refused {
        /// Topic.
        topic: String,
        /// Reason.
        reason: String,
    },
    /// Number of messages beyond the limits.
    LeftOut(u64),
    /// Output the changed parts.
    Look,
}

/// Outputs of the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Output {
    /// A part of the page changed.
    Changed {
        /// Name of the part.
        part: &'static str,
        /// The part as JSON.
        json: String,
    },
}

/// The page of a cell.
#[derive(Clone, Debug)]
pub struct LiveViewStage {
    page: Page,
    sent: BTreeMap<&'static str, String>,
}

impl LiveViewStage {
    /// An empty page; `limits_um` are the greatest offsets of the axes where known.
    #[must_use]
    pub fn new(stale_after: Span, limits_um: BTreeMap<Axis, f64>) -> Self {
        Self {
            page: Page::new(stale_after, limits_um),
            sent: BTreeMap::new(),
        }
    }

    fn look(&mut self, now: Stamp<Host>, out: &mut Vec<Output>) {
        for (part, value) in self.page.parts(now) {
            let json = value.to_string();
            if self.sent.get(part) != Some(&json) {
                self.sent.insert(part, json.clone());
                out.push(Output::Changed { part, json });
            }
        }
    }
}

impl Stage for LiveViewStage {
    type Input = Input;
    type Output = Output;
    type Error = Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        if input == Input::Look {
            self.look(at, out);
        } else {
            self.page.take(at, input);
        }
        Ok(())
    }
}
