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

/// What is heard.
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
    /// Where simulator and machine differ.
    Gap(GapSummary),
    /// What a machine reports of itself.
    Value(MachineValue),
    /// A node is at work, by its full name.
    Node(String),
    /// A condition of a node, or its end.
    Condition(Condition),
    /// A message of a topic could not be used.
    Refused {
        /// Which topic.
        topic: String,
        /// Why.
        reason: String,
    },
    /// So many messages came faster than they could be looked at.
    LeftOut(u64),
    /// The page is looked at.
    Look,
}

/// What is said.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Output {
    /// A part of the page is another than before.
    Changed {
        /// Which part.
        part: &'static str,
        /// What it is now, as JSON.
        json: String,
    },
}

/// The page of a cell.
#[derive(Clone, Debug)]
pub struct LiveViewStage {
    page: Page,
    told: BTreeMap<&'static str, String>,
}

impl LiveViewStage {
    /// A page on which nothing has been heard; `limits_um` are the greatest offsets of the axes where they are known.
    #[must_use]
    pub fn new(stale_after: Span, limits_um: BTreeMap<Axis, f64>) -> Self {
        Self {
            page: Page::new(stale_after, limits_um),
            told: BTreeMap::new(),
        }
    }

    fn look(&mut self, now: Stamp<Host>, out: &mut Vec<Output>) {
        for (part, value) in self.page.parts(now) {
            let json = value.to_string();
            if self.told.get(part) != Some(&json) {
                self.told.insert(part, json.clone());
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
            self.page.hear(at, input);
        }
        Ok(())
    }
}
