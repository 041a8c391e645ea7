//! A compensation that is deactivated and activated while the machine works, asked for as anybody asks.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::{Arc, Mutex};

use abbe_msgs::lifecycle_msgs::msg::TransitionEvent;
use abbe_msgs::{SERVICE_EVENT_SUFFIX, Wire, from_cdr, msg, to_cdr, topics};
use abbe_tests::operator::Operator;
use abbe_tests::scenario::Scenario;
use metrology::sample::{AxisDrift, ThermalModel};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, PerAxis};
use node_runtime::{Harness, Node};

use crate::cell;

const START_S: i64 = 1_767_600_000;
const NODE: &str = "axis_compensation";
/// What the model wants of X, mm.
const DRIFT_MM: f64 = 0.012;
/// The scenario's limit of rate over a servo period, mm.
const STEP_MM: f64 = 0.02 * 1e-3 + 1e-12;
/// The fake machine follows no faster than this over a servo period, mm.
const CONTROL_STEP_MM: f64 = 0.1 * 1e-3 + 1e-12;

fn after(seconds: f64) -> Stamp<Host> {
    Stamp::from_nanos(START_S * 1_000_000_000) + Span::from_secs_f64(seconds)
}

fn model() -> Vec<u8> {
    let mut axes = PerAxis::default();
    axes[Axis::X] = Some(AxisDrift {
        k0_mm: DRIFT_MM,
        span_mm: (-220.0, 220.0),
        measured_at: after(0.0),
        ..AxisDrift::default()
    });
    let model = ThermalModel {
        at: after(0.0),
        axes,
        valid_from: after(0.0),
        valid_until: after(3600.0),
        n_blocks: 1,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence: 1,
    };
    to_cdr(&msg::ThermalModel::from_inner(&model))
}

/// A publication: when, where, what.
type Said = Rc<RefCell<Vec<(Stamp<Host>, String, Vec<u8>)>>>;

fn listen(harness: &mut Harness) -> Said {
    let said = Said::default();
    let names: Vec<String> = harness.topics().map(|port| port.topic.clone()).collect();
    let heard = Rc::clone(&said);
    harness.observe(Box::new(move |published| {
        let name = names[published.topic].clone();
        let bytes = published.bytes.to_vec();
        heard.borrow_mut().push((published.at, name, bytes));
    }));
    said
}

/// Offsets of X as they were published: time, s, and offset, mm.
fn offsets(said: &Said) -> Vec<(f64, f64)> {
    let said = said.borrow();
    let of_topic = said
        .iter()
        .filter(|(_, topic, _)| topic == topics::COMPENSATION.name);
    let offset = |(at, _, bytes): &(Stamp<Host>, String, Vec<u8>)| {
        let message = from_cdr::<msg::AxisCompensation>(bytes).unwrap();
        let offset = message.into_inner().unwrap().total[Axis::X];
        ((*at - after(0.0)).as_secs_f64(), offset)
    };
    of_topic.map(offset).collect()
}

fn steps_of(said: &Said, node: &str) -> Vec<String> {
    let topic = format!("{node}/transition_event");
    let said = said.borrow();
    let events = said.iter().filter(|(_, name, _)| *name == topic);
    let step = |(at, _, bytes): &(Stamp<Host>, String, Vec<u8>)| {
        let event: TransitionEvent = from_cdr(bytes).unwrap();
        assert_eq!(i128::from(event.timestamp), i128::from(at.nanos()));
        format!("{} to {}", event.start_state.label, event.goal_state.label)
    };
    events.map(step).collect()
}

fn scenario() -> Scenario {
    let scenario = Scenario::copy_of("first_run");
    scenario.replace("axis_compensation.yaml", "enabled: false", "enabled: true");
    // A state at every servo period, so that every step of the offset is seen.
    scenario.replace(
        "fake_cnc.yaml",
        "background_rate_hz: 10.0",
        "background_rate_hz: 0.0",
    );
    scenario
}

/// The offset in effect on X of the machine, mm, tick by tick.
type InEffect = Arc<Mutex<Vec<f64>>>;

fn machine(scenario: &Scenario) -> (Box<dyn Node>, InEffect) {
    let in_effect = InEffect::default();
    let seen = Arc::clone(&in_effect);
    let witness = Box::new(move |_, cnc: &fake_cnc::Cnc| {
        seen.lock().unwrap().push(cnc.offset()[Axis::X]);
    });
    let setup = cell::setup(scenario, "fake_cnc").unwrap();
    let node = fake_cnc_node::witnessed(&setup, Some(witness)).unwrap();
    (node, in_effect)
}

fn greatest_step(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    steps.fold(0.0, f64::max)
}

/// A run of machine and compensation in which an operator asks `node` for steps.
struct Steered {
    /// When an answer came, to what, and what it says.
    answers: Vec<(f64, &'static str, bool)>,
    said: Said,
    /// The offset in effect on X at the end of every servo period, mm.
    in_effect: Vec<f64>,
}

impl Steered {
    fn run(scenario: &Scenario, node: &str, plan: &[(f64, &'static str)], until_s: f64) -> Self {
        let (cnc, in_effect) = machine(scenario);
        let (operator, answers) = Operator::of(after(0.0), node, plan);
        let compensation = cell::build(scenario, NODE).unwrap();
        let nodes = vec![cnc, operator, compensation];
        let mut harness = Harness::compose(nodes, after(0.0)).unwrap();
        let said = listen(&mut harness);
        assert!(harness.inject(topics::THERMAL_MODEL.name, &model()));
        harness.run_until(after(until_s));
        let answers = answers.lock().unwrap().clone();
        eprintln!("{answers:?}");
        let in_effect = in_effect.lock().unwrap().clone();
        assert!(greatest_step(&in_effect) <= CONTROL_STEP_MM);
        Self {
            answers,
            said,
            in_effect,
        }
    }

    fn told(&self) -> Vec<(&'static str, bool)> {
        let answers = self.answers.iter();
        answers.map(|(_, label, good)| (*label, *good)).collect()
    }

    /// Offsets published from one time to before another, mm.
    fn between(&self, from_s: f64, to_s: f64) -> Vec<f64> {
        let mut inside = offsets(&self.said);
        inside.retain(|(at_s, _)| (from_s..to_s).contains(at_s));
        inside.into_iter().map(|(_, mm)| mm).collect()
    }
}

fn is_reached(offset_mm: f64) -> bool {
    (offset_mm - DRIFT_MM).abs() < 1e-6
}

fn is_zero(offset_mm: &f64) -> bool {
    offset_mm.abs() <= 0.0
}

#[test]
fn deactivating_in_the_middle_of_a_run_fades_and_activating_takes_it_up_and_nothing_steps() {
    let plan = [
        (3.0, "deactivate"),
        // Refused: it is on its way.
        (3.5, "activate"),
        (3.6, "configure"),
        (8.0, "activate"),
    ];
    let run = Steered::run(&scenario(), NODE, &plan, 12.0);
    let expected = [
        ("activate", false),
        ("configure", false),
        ("deactivate", true),
        ("activate", true),
    ];
    assert_eq!(run.told(), expected);
    let at_rest_s = run.answers[2].0;
    // shutdown_fade_s is 2 s by default, and the limits add a little.
    assert!((5.0..6.0).contains(&at_rest_s), "{at_rest_s}");
    assert!(run.between(2.5, 3.0).into_iter().all(is_reached));
    let fade = run.between(3.0, at_rest_s + 1e-9);
    assert!(fade.len() > 1_500, "{}", fade.len());
    assert!(fade.last().is_some_and(is_zero));
    assert!(run.between(at_rest_s + 1e-9, 8.0).is_empty());
    let again = run.between(8.0, 12.0);
    assert!(again[0].abs() <= STEP_MM, "{}", again[0]);
    assert!(is_reached(again[again.len() - 1]));
    let greatest_mm = greatest_step(&run.between(0.0, 12.0));
    eprintln!("greatest step {} µm", greatest_mm * 1e3);
    assert!(greatest_mm <= STEP_MM, "{greatest_mm}");
    assert!(run.in_effect[6_500..8_000].iter().all(is_zero));
    assert_eq!(
        steps_of(&run.said, NODE),
        [
            "unconfigured to configuring",
            "configuring to inactive",
            "inactive to activating",
            "activating to active",
            "active to deactivating",
            "deactivating to inactive",
            "inactive to activating",
            "activating to active",
        ]
    );
}

#[test]
fn a_run_with_changes_of_state_is_computed_again_byte_for_byte() {
    let scenario = scenario();
    let plan = [
        (1.0, "deactivate"),
        (4.0, "cleanup"),
        (4.5, "configure"),
        (5.0, "activate"),
    ];
    let run = Steered::run(&scenario, NODE, &plan, 7.0);
    let done = plan.map(|(_, label)| (label, true));
    assert_eq!(run.told(), done);
    // What was forgotten when it was cleaned up, it has from the latched topic again.
    assert!(run.between(6.5, 7.0).into_iter().all(is_reached));

    let alone = vec![cell::build(&scenario, NODE).unwrap()];
    let mut replay = Harness::compose(alone, after(0.0)).unwrap();
    let computed = listen(&mut replay);
    let inputs = [topics::AXES_STATE.name, topics::THERMAL_MODEL.name];
    for (at, topic, bytes) in run.said.borrow().iter() {
        while replay.next_tick().is_some_and(|due| due < *at) {
            replay.tick_next();
            while replay.deliver_next() {}
        }
        replay.wait_until(*at);
        if inputs.contains(&topic.as_str()) {
            let place = replay.place_of_topic(topic).unwrap();
            replay.put(place, bytes);
        } else if topic.ends_with(SERVICE_EVENT_SUFFIX) {
            assert!(replay.put_request(topic, bytes));
        }
        while replay.deliver_next() {}
    }
    let results = |said: &Said| {
        let mut results = said.borrow().clone();
        let own = [
            topics::COMPENSATION.name,
            "axis_compensation/transition_event",
        ];
        results.retain(|(_, topic, _)| own.contains(&topic.as_str()));
        results
    };
    let (recorded, computed) = (results(&run.said), results(&computed));
    assert!(recorded.len() > 3_000, "{}", recorded.len());
    assert_eq!(recorded.len(), computed.len());
    assert!(recorded == computed);
}

#[test]
fn a_controller_that_is_not_active_takes_no_offset_and_comes_to_rest_gently() {
    let plan = [(3.0, "deactivate"), (7.0, "activate")];
    let run = Steered::run(&scenario(), "fake_cnc", &plan, 9.0);
    assert_eq!(run.told(), [("deactivate", true), ("activate", true)]);
    // 12 µm at 5 µm/s.
    let at_rest_s = run.answers[0].0;
    assert!((5.3..5.6).contains(&at_rest_s), "{at_rest_s}");
    assert!(is_reached(run.in_effect[2_900]));
    assert!(run.in_effect[5_700..6_900].iter().all(is_zero));
    assert!(is_reached(run.in_effect[8_900]));
    // Positions go on all the while.
    let said = run.said.borrow();
    let states = said.iter().filter(|(at, topic, _)| {
        topic == topics::AXES_STATE.name && (after(6.0)..after(6.5)).contains(at)
    });
    assert!(states.count() >= 499);
}

#[test]
fn without_autostart_nothing_is_done_until_somebody_asks_for_it() {
    let scenario = scenario();
    scenario.append("axis_compensation.yaml", "    autostart: false\n");
    let plan = [
        (1.0, "activate"),
        (1.5, "configure"),
        (2.5, "activate"),
        (6.0, "shutdown"),
        (9.0, "activate"),
    ];
    let run = Steered::run(&scenario, NODE, &plan, 10.0);
    let good: Vec<_> = run.told().into_iter().map(|(_, good)| good).collect();
    assert_eq!(good, [false, true, true, true, false]);
    assert!(run.between(0.0, 2.5).is_empty());
    assert!(run.between(5.5, 6.0).into_iter().all(is_reached));
    let last = run.between(6.0, 10.0);
    assert!(
        last.last().is_some_and(is_zero),
        "shut down, it faded first"
    );
    let steps = steps_of(&run.said, NODE);
    assert_eq!(steps.last().unwrap(), "shuttingdown to finalized");
}
