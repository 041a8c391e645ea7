//! The nodes of a scenario's folder in the harness, and everything they said.

use std::cell::RefCell;
use std::rc::Rc;

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Wire, from_cdr};
use abbe_tests::scenario::Scenario;
use metrology::sample::{PlanState, PlanStatus};
use metrology::stamp::{Span, Stamp};
use node_runtime::arguments::Arguments;
use node_runtime::{Diagnostic, Harness, Level, Node, Setup};

type Builder = fn(&Setup) -> anyhow::Result<Box<dyn Node>>;

const NODES: [(&str, Builder); 6] = [
    ("fake_cnc", fake_cnc_node::node),
    ("probe", probe_node::node),
    ("latency_calibrator", latency_calibrator_node::node),
    ("thermal_model", thermal_model_node::node),
    ("axis_compensation", axis_compensation_node::node),
    ("sequencer", sequencer_node::node),
];

/// Start of simulated time, s since the epoch; as in first_run.
const START_S: i64 = 1_767_600_000;

/// A condition as it was reported.
#[derive(Clone, Debug)]
pub struct Condition {
    /// Seconds since the start.
    pub at_s: f64,
    pub node: String,
    pub diagnostic: Diagnostic,
}

#[derive(Default)]
struct Said {
    conditions: Vec<Condition>,
    /// Topic and serialised message, in total order.
    messages: Vec<(String, Vec<u8>)>,
}

/// A cell whose plan has run.
pub struct Cell {
    said: Rc<RefCell<Said>>,
    /// The sequencer's last word.
    pub status: PlanStatus,
}

/// first_run's cell with a probe whose latency is known, so that no plan need begin with finding it.
pub fn known_latency() -> Scenario {
    let scenario = Scenario::copy_of("first_run");
    let latency = "    latency_ms: 3.7\n    latency_standard_uncertainty_ms: 0.01\n";
    scenario.append("probe.yaml", latency);
    scenario
}

/// What one node of the scenario is told before it is built.
pub fn setup(scenario: &Scenario, name: &str) -> anyhow::Result<Setup> {
    let file = scenario.argument(&format!("{name}.yaml"));
    let arguments = ["--ros-args".to_owned(), "--params-file".to_owned(), file];
    Ok(Setup::new(name, &Arguments::parse(arguments)?)?)
}

/// Builds one node of the scenario.
pub fn build(scenario: &Scenario, name: &str) -> anyhow::Result<Box<dyn Node>> {
    let (_, builder) = NODES.iter().find(|(known, _)| *known == name).unwrap();
    builder(&setup(scenario, name)?)
}

impl Cell {
    /// Runs the scenario's plan until it is done or has failed, `limit_min` at most.
    pub fn run(scenario: &Scenario, limit_min: i64) -> Self {
        let nodes = NODES.map(|(name, _)| build(scenario, name).unwrap());
        let start = Stamp::from_nanos(START_S * 1_000_000_000);
        let mut harness = Harness::compose(nodes.into(), start).unwrap();
        let said = Rc::new(RefCell::new(Said::default()));
        let topics: Vec<String> = harness.topics().map(|port| port.topic.clone()).collect();
        let heard = Rc::clone(&said);
        harness.observe(Box::new(move |published| {
            let topic = topics[published.topic].clone();
            let bytes = published.bytes.to_vec();
            heard.borrow_mut().messages.push((topic, bytes));
        }));
        let heard = Rc::clone(&said);
        harness.observe_conditions(Box::new(move |at, node, diagnostic| {
            heard.borrow_mut().conditions.push(Condition {
                at_s: (at - start).as_secs_f64(),
                node: node.to_owned(),
                diagnostic: diagnostic.clone(),
            });
        }));
        let mut cell = Self {
            said,
            status: PlanStatus {
                at: start,
                state: PlanState::Waiting,
                step: 0,
                steps: 0,
                activity: String::new(),
                run: 0,
                progress: 0.0,
                message: String::new(),
            },
        };
        let mut read = 0;
        while cell.status.state != PlanState::Done && cell.status.state != PlanState::Failed {
            let now = harness.advance().unwrap();
            assert!(
                now - start < Span::from_nanos(limit_min * 60_000_000_000),
                "after {limit_min} min the plan is at: {:?}",
                cell.status
            );
            let said = cell.said.borrow();
            for (topic, bytes) in &said.messages[read..] {
                if topic == topics::PLAN_STATUS.name {
                    cell.status = from_cdr::<abbe_msgs::msg::PlanStatus>(bytes)
                        .and_then(Wire::into_inner)
                        .unwrap();
                }
            }
            read = said.messages.len();
        }
        // Touches and the ends of runs are evaluated a little later.
        harness.run_until(harness.now() + Span::from_nanos(2_000_000_000));
        cell
    }

    /// Every message of a topic.
    pub fn all<M: Wire>(&self, topic: &Topic<M>) -> Vec<M::Inner> {
        let said = self.said.borrow();
        let of_topic = said.messages.iter().filter(|(name, _)| name == topic.name);
        of_topic
            .map(|(_, bytes)| from_cdr::<M>(bytes).and_then(Wire::into_inner).unwrap())
            .collect()
    }

    /// Conditions of a node by the beginning of their names, those that ended included.
    pub fn conditions(&self, node: &str, name: &str) -> Vec<Condition> {
        let said = self.said.borrow();
        let mut found = said.conditions.clone();
        found.retain(|c| c.node == node && c.diagnostic.name.starts_with(name));
        found
    }

    /// Checks that a node reported a condition, above `Ok`, whose message holds all of `words`.
    pub fn expect(&self, node: &str, name: &str, words: &[&str]) -> Condition {
        let found = self.conditions(node, name);
        let fits = |c: &&Condition| {
            c.diagnostic.level > Level::Ok
                && words.iter().all(|word| c.diagnostic.message.contains(word))
        };
        let Some(condition) = found.iter().find(fits) else {
            let said = self.said.borrow();
            let bad: Vec<String> = said
                .conditions
                .iter()
                .filter(|c| c.diagnostic.level > Level::Ok)
                .map(|c| {
                    let (name, message) = (&c.diagnostic.name, &c.diagnostic.message);
                    format!("{:.1} s {} {name}: {message}", c.at_s, c.node)
                })
                .collect();
            panic!("no {node} {name} with {words:?} in:\n{}", bad.join("\n"));
        };
        eprintln!("{node} {name}: {}", condition.diagnostic.message);
        condition.clone()
    }

    /// Checks that the plan failed, and that the reason holds all of `words`.
    pub fn expect_failed(&self, words: &[&str]) {
        assert_eq!(self.status.state, PlanState::Failed);
        let message = &self.status.message;
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
        self.expect("sequencer", "plan_failed", words);
    }

    /// Checks that the axes stand still at the end.
    pub fn expect_at_rest(&self) {
        let last = self.all(&topics::AXES_STATE).pop().unwrap();
        for axis in last.axes.iter() {
            assert!(last.velocity[axis].abs() < 1.0, "{axis}: {last:?}");
        }
    }

    /// Checks that every offset was a finite number of at most `limit_mm`.
    pub fn expect_offsets_within(&self, limit_mm: f64) {
        let all = self.all(&topics::COMPENSATION);
        assert!(!all.is_empty());
        for compensation in all {
            for axis in compensation.axes.iter() {
                let total_mm = compensation.total[axis];
                assert!(total_mm.abs() <= limit_mm, "{axis}: {total_mm} mm");
            }
        }
    }
}
