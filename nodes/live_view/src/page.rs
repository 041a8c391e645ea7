//! The latest of each value with its time of receipt, and its form as JSON.
//!
//! Lengths in it are mm, angles rad, times seconds or, with `_ms`, milliseconds since 1970; an unknown number is
//! `null`. The browser's page converts them to µm and seconds of arc.

use std::collections::{BTreeMap, VecDeque};

use metrology::sample::{
    AxisCompensation, AxisState, MachineValue, PlanStatus, ProbeLatency, ProbedPoint,
    TemperatureSample, TestSegment, ThermalModel,
};
use metrology::stamp::{Host, Span};
use metrology::{Axis, Stamp};
use serde_json::{Value, json};

use crate::stage::Input;

mod conditions;
mod models;
mod motion;
mod progress;

pub use conditions::Condition;
use conditions::ConditionState;
use progress::StepBegin;

/// Touches that are kept.
pub const MOST_TOUCHES: usize = 20;
/// Sensors, values, nodes, conditions and topics that are kept, each; one more is counted.
pub const MOST_NAMES: usize = 256;
/// Longest text of a message that is shown, characters.
const LONGEST_TEXT: usize = 1000;

/// A value and its time of receipt.
#[derive(Clone, Debug)]
struct Latest<T> {
    at: Stamp<Host>,
    value: T,
}

type Last<T> = Option<Latest<T>>;

/// The latest of everything.
#[derive(Clone, Debug, Default)]
pub(crate) struct Page {
    stale_after: Span,
    limits_um: BTreeMap<Axis, f64>,
    axes: Last<AxisState>,
    offsets: Last<AxisCompensation>,
    plan: Last<PlanStatus>,
    step: Option<StepBegin>,
    test: Last<TestSegment>,
    drift: Last<Box<ThermalModel>>,
    temperatures: BTreeMap<String, Latest<TemperatureSample>>,
    touches: VecDeque<ProbedPoint>,
    latency: Last<ProbeLatency>,
    geometry: Option<Value>,
    rotary: Option<Value>,
    positioning: BTreeMap<Axis, Value>,
    gap: Option<Value>,
    values: BTreeMap<String, Latest<MachineValue>>,
    nodes: BTreeMap<String, Stamp<Host>>,
    conditions: BTreeMap<String, ConditionState>,
    refused: BTreeMap<String, (u64, String)>,
    /// Names and messages beyond the limits.
    left_out: u64,
}

/// An instant in the JSON.
pub(crate) fn ms(at: Stamp<Host>) -> i64 {
    at.nanos().div_euclid(1_000_000)
}

/// A text cut to its longest; the cut characters are counted.
fn short(text: &str) -> String {
    let letters = text.chars().count();
    if letters <= LONGEST_TEXT {
        return text.to_owned();
    }
    let kept: String = text.chars().take(LONGEST_TEXT).collect();
    format!("{kept}… ({} more characters)", letters - LONGEST_TEXT)
}

impl Page {
    pub fn new(stale_after: Span, limits_um: BTreeMap<Axis, f64>) -> Self {
        Self {
            stale_after,
            limits_um,
            ..Self::default()
        }
    }

    /// Takes an input received `at` an instant.
    pub fn take(&mut self, at: Stamp<Host>, input: Input) {
        match input {
            Input::Axes(value) => self.axes = Some(Latest { at, value }),
            Input::Offsets(value) => self.offsets = Some(Latest { at, value }),
            Input::Plan(value) => self.take_plan(at, value),
            Input::Test(mut value) => {
                value.features.clear();
                self.test = Some(Latest { at, value });
            }
            Input::Drift(value) => self.drift = Some(Latest { at, value }),
            Input::Temperature(value) => {
                let name = value.sensor.clone();
                let latest = Latest { at, value };
                keep(&mut self.temperatures, &mut self.left_out, name, latest);
            }
            Input::Touch(mut value) => {
                value.feature_id = short(&value.feature_id);
                self.touches.push_front(value);
                self.touches.truncate(MOST_TOUCHES);
            }
            Input::Latency(value) => self.latency = Some(Latest { at, value }),
            Input::Geometry(model) => self.geometry = Some(models::geometry(&model)),
            Input::Rotary(model) => self.rotary = Some(models::geometry(&model)),
            Input::Positioning(table) => {
                self.positioning
                    .insert(table.axis, models::positioning(&table));
            }
            Input::Gap(report) => self.gap = Some(models::gap(&report)),
            Input::Value(mut value) => {
                value.text = short(&value.text);
                let name = value.name.clone();
                let latest = Latest { at, value };
                keep(&mut self.values, &mut self.left_out, name, latest);
            }
            Input::Node(name) => keep(&mut self.nodes, &mut self.left_out, name, at),
            Input::Condition(condition) => self.take_condition(at, condition),
            Input::Refused { topic, reason } => self.take_refused(topic, reason),
            Input::LeftOut(messages) => self.left_out = self.left_out.saturating_add(messages),
            Input::Look => {}
        }
    }

    fn take_refused(&mut self, topic: String, reason: String) {
        match self.refused.get_mut(&topic) {
            Some((messages, last)) => {
                *messages = messages.saturating_add(1);
                *last = reason;
            }
            None => keep(&mut self.refused, &mut self.left_out, topic, (1, reason)),
        }
    }

    /// Time of the newest positions: the time of the cell, simulated or real.
    fn time_of_the_cell(&self) -> Option<Stamp<Host>> {
        self.axes.as_ref().map(|latest| latest.value.received_at)
    }

    /// Last receipt of a periodic value that is stale, in the JSON.
    fn stale_since(&self, now: Stamp<Host>, latest: Stamp<Host>) -> Option<i64> {
        (now - latest > self.stale_after).then(|| ms(latest))
    }

    /// Every part that has something to show.
    pub fn parts(&self, now: Stamp<Host>) -> Vec<(&'static str, Value)> {
        let parts = [
            ("axes", self.axes_part(now)),
            ("offsets", self.offsets_part(now)),
            ("plan", self.plan_part()),
            ("test", self.test_part()),
            ("drift", self.drift_part()),
            ("temperatures", self.temperatures_part(now)),
            ("touches", self.touches_part()),
            ("latency", self.latency_part()),
            ("geometry", self.geometry.clone()),
            ("rotary", self.rotary.clone()),
            (
                "positioning",
                list(self.positioning.values().cloned().collect()),
            ),
            ("gap", self.gap.clone()),
            ("values", self.values_part(now)),
            ("nodes", self.nodes_part(now)),
            ("conditions", Some(self.conditions_part())),
            ("trouble", self.trouble_part()),
        ];
        let shown = parts.into_iter();
        shown
            .filter_map(|(part, value)| Some((part, value?)))
            .collect()
    }

    fn temperatures_part(&self, now: Stamp<Host>) -> Option<Value> {
        let one = |(name, latest): (&String, &Latest<TemperatureSample>)| {
            json!({
                "name": name,
                "degc": latest.value.temperature_degc,
                "at_ms": ms(latest.value.at),
                "stale_since_ms": self.stale_since(now, latest.at),
            })
        };
        list(self.temperatures.iter().map(one).collect())
    }

    fn values_part(&self, now: Stamp<Host>) -> Option<Value> {
        let one = |(name, latest): (&String, &Latest<MachineValue>)| {
            let value = &latest.value;
            json!({
                "name": name,
                "quantity": format!("{:?}", value.quantity),
                "verdict": format!("{:?}", value.verdict),
                "value": value.value,
                "text": value.text,
                "at_ms": ms(value.received_at),
                "silent_s": (now - latest.at).as_secs_f64().max(0.0).round(),
            })
        };
        list(self.values.iter().map(one).collect())
    }

    fn nodes_part(&self, now: Stamp<Host>) -> Option<Value> {
        let one = |(name, &latest): (&String, &Stamp<Host>)| json!({"name": name, "stale_since_ms": self.stale_since(now, latest)});
        list(self.nodes.iter().map(one).collect())
    }

    /// Messages that could not be shown; `None`: all were shown.
    fn trouble_part(&self) -> Option<Value> {
        let one = |(topic, (messages, reason)): (&String, &(u64, String))| json!({"topic": topic, "messages": messages, "reason": short(reason)});
        let refused: Vec<Value> = self.refused.iter().map(one).collect();
        let is_quiet = refused.is_empty() && self.left_out == 0;
        (!is_quiet).then(|| json!({"refused": refused, "left_out": self.left_out}))
    }
}

/// A list that is shown when it has something.
fn list(all: Vec<Value>) -> Option<Value> {
    (!all.is_empty()).then(|| Value::from(all))
}

/// Keeps a value by its name; a name beyond the most that are kept is counted.
fn keep<T>(all: &mut BTreeMap<String, T>, left_out: &mut u64, name: String, value: T) {
    if all.len() >= MOST_NAMES && !all.contains_key(&name) {
        *left_out = left_out.saturating_add(1);
    } else {
        all.insert(name, value);
    }
}
