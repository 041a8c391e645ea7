//! The diagnosis beside a machine at work: play that a screw develops during the shift is named within one test cycle
//! and told of once, and before that the machine is quiet.

use std::cell::RefCell;
use std::rc::Rc;

use abbe_msgs::{Wire, from_cdr, topics};
use abbe_tests::scenario::Scenario;
use metrology::sample::{GapStatus, GapSummary, PlanState, TestKind};
use metrology::stamp::{Span, Stamp};
use node_runtime::arguments::Arguments;
use node_runtime::{Harness, Level, Node, Setup};

/// Start of simulated time, s since the epoch; as the scenario has it.
const START_S: i64 = 1_767_600_000;
/// Runs of a cycle, and cycles before the one in which the play is there.
const CYCLE_RUNS: usize = 8;
const HEALTHY: usize = 3;
/// When the plant's screw begins to have play, s, and how much wider its gap is from then on, µm.
const WORN_AT_S: f64 = 400.0;
const WIDER_UM: f64 = 6.0 - 0.3;
/// Rest between two cycles, s.
const REST_S: f64 = 60.0;

type Builder = fn(&Setup) -> anyhow::Result<Box<dyn Node>>;

const NODES: [(&str, Builder); 3] = [
    ("fake_cnc", fake_cnc_node::node),
    ("gap_diagnosis", gap_diagnosis_node::node),
    ("sequencer", sequencer_node::node),
];

/// A warning with the seconds since the start.
#[derive(Clone, Debug)]
struct Warning {
    at_s: f64,
    condition: String,
    message: String,
}

#[derive(Default)]
struct Said {
    state: Option<PlanState>,
    warnings: Vec<Warning>,
    reports: Vec<(f64, GapSummary)>,
    /// Begin and end of each test, s.
    tests: Vec<[f64; 2]>,
}

fn since(start: Stamp<metrology::Host>, at: Stamp<metrology::Host>) -> f64 {
    (at - start).as_secs_f64()
}

fn run() -> Said {
    let scenario = Scenario::copy_of("gap_wear");
    let build = |(name, builder): (&str, Builder)| {
        let file = scenario.argument(&format!("{name}.yaml"));
        let arguments = ["--ros-args".to_owned(), "--params-file".to_owned(), file];
        builder(&Setup::new(name, &Arguments::parse(arguments).unwrap()).unwrap()).unwrap()
    };
    let start = Stamp::from_nanos(START_S * 1_000_000_000);
    let mut harness = Harness::compose(NODES.map(build).into(), start).unwrap();
    let said = Rc::new(RefCell::new(Said::default()));
    let names: Vec<String> = harness.topics().map(|port| port.topic.clone()).collect();
    let heard = Rc::clone(&said);
    harness.observe(Box::new(move |published| {
        let (name, bytes) = (&names[published.topic], published.bytes);
        let mut said = heard.borrow_mut();
        if *name == topics::PLAN_STATUS.name {
            let status = from_cdr::<abbe_msgs::msg::PlanStatus>(bytes).unwrap();
            said.state = Some(status.into_inner().unwrap().state);
        } else if *name == topics::GAP_REPORT.name {
            let report = from_cdr::<abbe_msgs::msg::GapReport>(bytes).unwrap();
            let at_s = since(start, published.at);
            said.reports.push((at_s, report.into_inner().unwrap()));
        } else if *name == topics::TEST_SEGMENT.name {
            let segment = from_cdr::<abbe_msgs::msg::TestSegment>(bytes).unwrap();
            let segment = segment.into_inner().unwrap();
            let at_s = since(start, published.at);
            if segment.kind == TestKind::Circle && segment.begin {
                said.tests.push([at_s; 2]);
            } else if segment.kind == TestKind::Circle {
                said.tests.last_mut().unwrap()[1] = at_s;
            }
        }
    }));
    let heard = Rc::clone(&said);
    harness.observe_conditions(Box::new(move |at, node, diagnostic| {
        if node == "gap_diagnosis" && diagnostic.level >= Level::Warn {
            heard.borrow_mut().warnings.push(Warning {
                at_s: since(start, at),
                condition: diagnostic.name.to_string(),
                message: diagnostic.message.to_string(),
            });
        }
    }));
    loop {
        let now = harness.advance().unwrap();
        assert!(since(start, now) < 3600.0, "an hour");
        match said.borrow().state {
            Some(PlanState::Done) => break,
            Some(PlanState::Failed) => panic!("the plan failed"),
            _ => {}
        }
    }
    harness.run_until(harness.now() + Span::from_secs_f64(REST_S));
    drop(harness);
    Rc::try_unwrap(said).ok().unwrap().into_inner()
}

#[test]
fn play_that_develops_during_the_shift_is_named_within_one_cycle_and_told_of_once() {
    let said = run();
    for warning in &said.warnings {
        eprintln!("{warning:?}");
    }
    for (at_s, report) in &said.reports {
        let causes = report.causes.iter().map(|cause| {
            let value = cause.parameters.first().map_or(f64::NAN, |p| p.value);
            format!(
                "{} {} {value:.2} {:?}",
                cause.effect, cause.axis, cause.status
            )
        });
        eprintln!(
            "{at_s:.1} s, runs {:?}: {:?}",
            report.runs,
            causes.collect::<Vec<_>>()
        );
    }
    assert_eq!(said.tests.len(), 5 * CYCLE_RUNS, "five cycles");
    let healthy_until_s = said.tests[HEALTHY * CYCLE_RUNS - 1][1];
    let worn_from_s = said.tests[HEALTHY * CYCLE_RUNS][0];
    assert!(
        healthy_until_s < WORN_AT_S && WORN_AT_S < worn_from_s,
        "between two cycles"
    );
    let [before, after]: [Vec<&Warning>; 2] = [false, true].map(|is_worn| {
        said.warnings
            .iter()
            .filter(|w| (w.at_s > WORN_AT_S) == is_worn)
            .collect()
    });
    assert!(before.is_empty(), "{before:?}");
    let healthy = said
        .reports
        .iter()
        .filter(|(at_s, _)| *at_s < WORN_AT_S)
        .count();
    assert!(healthy >= HEALTHY, "{healthy} reports");

    let [told] = after[..] else {
        panic!("told of once: {after:?}");
    };
    assert_eq!(told.condition, "new_effect");
    assert!(told.message.contains("backlash X"), "{}", told.message);
    let cycle_until_s = said.tests[(HEALTHY + 1) * CYCLE_RUNS - 1][1];
    assert!(
        told.at_s <= cycle_until_s + REST_S,
        "{} {cycle_until_s}",
        told.at_s
    );
    let (_, last) = said.reports.last().unwrap();
    let play = last
        .causes
        .iter()
        .find(|cause| cause.effect == "backlash" && cause.axis == "X");
    let play = play.expect("the play is still named");
    assert_eq!(play.status, GapStatus::Named);
    let width = &play.parameters[0];
    assert!((width.value - WIDER_UM).abs() < 0.1 * WIDER_UM, "{width:?}");
}
