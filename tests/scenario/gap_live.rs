//! The diagnosis beside a machine at work: play that a drive develops during the shift is told of within one test
//! cycle, and a machine that stays as it is gives no alarm.

use std::cell::RefCell;
use std::rc::Rc;

use abbe_msgs::{Wire, from_cdr, topics};
use abbe_tests::scenario::Scenario;
use metrology::sample::{GapSummary, PlanState};
use metrology::stamp::{Span, Stamp};
use node_runtime::arguments::Arguments;
use node_runtime::{Harness, Level, Node, Setup};

/// Start of simulated time, s since the epoch; as in gap_first.
const START_S: i64 = 1_767_600_000;
/// Circles of one cycle, each twice.
const CYCLE: &str = "\
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0, sense: both, on_the_fly: true, repeats: 2}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 4500.0, sense: both, on_the_fly: true, repeats: 2}
";
/// Rest between cycles, so that a cycle begins at a known time.
const WAIT: &str = "  - {do: wait, seconds: 20.0}\n";
/// Runs of a cycle.
const CYCLE_RUNS: usize = 8;

type Builder = fn(&Setup) -> anyhow::Result<Box<dyn Node>>;

const NODES: [(&str, Builder); 3] = [
    ("fake_cnc", fake_cnc_node::node),
    ("gap_diagnosis", gap_diagnosis_node::node),
    ("sequencer", sequencer_node::node),
];

/// A warning with the seconds since the start.
type Warning = (f64, String, String);

#[derive(Default)]
struct Said {
    state: Option<PlanState>,
    warnings: Vec<Warning>,
    reports: Vec<GapSummary>,
    /// When the last run ended, and how many ended.
    ends: Vec<(u32, f64)>,
}

fn scenario(cycles: usize) -> Scenario {
    let scenario = Scenario::copy_of("gap_first");
    let steps = vec![CYCLE; cycles].join(WAIT);
    scenario.write("plan.yaml", &format!("title: cycles\nsteps:\n{steps}"));
    scenario.replace("plant.yaml", "backlash_um: 6.0", "backlash_um: 0.3");
    scenario.write(
        "gap_diagnosis.yaml",
        &format!(
            "/**:\n  ros__parameters:\n    machine_file: machine.yaml\n    least_runs: {CYCLE_RUNS}\n    cycle_runs: {CYCLE_RUNS}\n    least_period_s: 30.0\n"
        ),
    );
    scenario
}

fn run(scenario: &Scenario) -> Said {
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
            said.reports.push(report.into_inner().unwrap());
        } else if *name == topics::TEST_SEGMENT.name {
            let segment = from_cdr::<abbe_msgs::msg::TestSegment>(bytes).unwrap();
            let segment = segment.into_inner().unwrap();
            if !segment.begin {
                let at_s = (published.at - start).as_secs_f64();
                said.ends.push((segment.run, at_s));
            }
        }
    }));
    let heard = Rc::clone(&said);
    harness.observe_conditions(Box::new(move |at, node, diagnostic| {
        if node == "gap_diagnosis" && diagnostic.level >= Level::Warn {
            heard.borrow_mut().warnings.push((
                (at - start).as_secs_f64(),
                diagnostic.name.clone(),
                diagnostic.message.clone(),
            ));
        }
    }));
    loop {
        let now = harness.advance().unwrap();
        assert!(now - start < Span::from_nanos(3_600_000_000_000), "an hour");
        match said.borrow().state {
            Some(PlanState::Done) => break,
            Some(PlanState::Failed) => panic!("the plan failed"),
            _ => {}
        }
    }
    harness.run_until(harness.now() + Span::from_nanos(40_000_000_000));
    drop(harness);
    Rc::try_unwrap(said).ok().unwrap().into_inner()
}

#[test]
fn play_that_develops_during_the_shift_is_named_within_one_cycle() {
    let healthy = scenario(5);
    let ends = run(&healthy);
    eprintln!("nothing develops: {:?}", ends.warnings);
    let new: Vec<&Warning> = ends.warnings.iter().filter(|w| w.0 > 0.0).collect();
    // What the machine has from the start may be told of once, in the first cycle; nothing is new after that.
    let first_cycle_s = ends.ends[CYCLE_RUNS - 1].1 + 40.0;
    let later: Vec<_> = new.iter().filter(|w| w.0 > first_cycle_s).collect();
    assert!(later.is_empty(), "{later:?}");
    assert!(ends.reports.len() >= 5, "{}", ends.reports.len());

    // In the rest before the fourth cycle.
    let worn_at_s = ends.ends[3 * CYCLE_RUNS - 1].1 + 10.0;
    let worn = scenario(5);
    let plant = format!(
        "backlash_um: 0.3\n    wear: [{{after_s: {worn_at_s:.1}, backlash_um: 6.0}}]\n    backlash_softness_um: 0.3\n    motor_friction: {{coulomb_n: 40.0"
    );
    let was =
        "backlash_um: 0.3\n    backlash_softness_um: 0.3\n    motor_friction: {coulomb_n: 40.0";
    let text = std::fs::read_to_string(worn.path("plant.yaml")).unwrap();
    // X stands first.
    worn.write("plant.yaml", &text.replacen(was, &plant, 1));
    let said = run(&worn);
    eprintln!("play develops at {worn_at_s:.0} s: {:?}", said.warnings);
    let cycle_ends_s = said.ends[4 * CYCLE_RUNS - 1].1;
    let of_play = said.warnings.iter().find(|(at_s, name, message)| {
        *at_s > worn_at_s && name == "new_effect" && message.contains("backlash X")
    });
    let (at_s, _, message) = of_play.expect("play in X is warned of");
    eprintln!("{at_s:.0} s (cycle ends at {cycle_ends_s:.0} s): {message}");
    assert!(*at_s <= cycle_ends_s + 35.0, "{at_s} {cycle_ends_s}");
    let wrong: Vec<_> = said
        .warnings
        .iter()
        .filter(|w| w.0 > worn_at_s && !w.2.contains("backlash X"))
        .collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}
