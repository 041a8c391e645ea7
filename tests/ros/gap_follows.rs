//! The diagnosis follows a machine on the graph: a report within seconds of each test, and play that the screw develops
//! told of on /diagnostics while the tests go on.

use std::path::Path;
use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::graph::Graph;
use abbe_tests::program::{Process, command, domain};
use abbe_tests::scenario::Scenario;

const NODE: &str = "gap_diagnosis";
/// Three circles in each sense, a rest in which the screw gets its play, the same again.
const PLAN: &str = "\
title: two test cycles
steps:
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 2400.0, sense: both, on_the_fly: true, repeats: 3}
  - {do: wait, seconds: 60.0}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 2400.0, sense: both, on_the_fly: true, repeats: 3}
";
const CYCLE_RUNS: usize = 6;
/// Time of the machine over time. Readings may come up to 2 s of the machine's time after the end of their run.
const RATE: &str = "3";
/// The longest from the end of a test to a report that has looked at it, on a busy computer.
const LIMIT: Duration = Duration::from_secs(15);

/// The machine's own recording, from a plant that wears.
fn recorded() -> (Scenario, std::path::PathBuf) {
    let scenario = Scenario::copy_of("gap_wear");
    scenario.write("plan.yaml", PLAN);
    scenario.replace("scenario.yaml", "diagnose: true", "diagnose: false");
    scenario.replace("plant.yaml", "after_s: 400.0", "after_s: 110.0");
    // Nobody diagnoses while it is recorded.
    scenario.replace("gap_diagnosis.yaml", "least_runs: 8", "least_runs: 5000");
    let bag = scenario.run().join("bag");
    (scenario, bag)
}

fn follower(scenario: &Scenario, domain: u16) -> Process {
    scenario.replace("gap_diagnosis.yaml", "least_runs: 5000", "least_runs: 6");
    scenario.replace("gap_diagnosis.yaml", "cycle_runs: 8", "cycle_runs: 6");
    scenario.replace("gap_diagnosis.yaml", "period_s: 40.0", "period_s: 1.0");
    let file = scenario.argument("gap_diagnosis.yaml");
    Process::node(domain, NODE, &["--params-file", &file])
}

/// What the machine says of itself, as it said it.
fn machine(bag: &Path, domain: u16) -> Process {
    let mut play = command(domain, &["play"]);
    play.arg(bag).args(["--rate", RATE, "--delay", "2"]);
    for topic in [
        "/axes/state",
        "/grid/position",
        "/test/segment",
        "/temperature/*",
    ] {
        play.args(["--topics", topic]);
    }
    Process::start(play)
}

/// When each test ended, with its run.
fn ends(graph: &Graph, began: Instant) -> Vec<(Instant, u32)> {
    let segments = graph.since(&topics::TEST_SEGMENT, began);
    let ends = segments.into_iter().filter(|(_, segment)| !segment.begin);
    ends.map(|(at, segment)| (at, segment.run)).collect()
}

#[test]
fn a_report_follows_each_test_within_seconds_and_new_play_is_told_of_on_diagnostics() {
    let (scenario, bag) = recorded();
    let (domain, began) = (domain(14), Instant::now());
    let graph = Graph::join(domain);
    let node = follower(&scenario, domain);
    graph.alive(NODE, began);
    let playing = machine(&bag, domain);
    let patience = Duration::from_secs(120);
    graph.wait_longer(patience, "the last test", |graph| {
        (ends(graph, began).len() == 2 * CYCLE_RUNS).then_some(())
    });
    let ends = ends(&graph, began);
    let seen: Vec<Duration> = ends[CYCLE_RUNS - 1..]
        .iter()
        .map(|(ended, run)| {
            let reports = |graph: &Graph| {
                let all = graph.since(&topics::GAP_REPORT, *ended);
                all.into_iter()
                    .find(|(_, report)| report.runs.contains(run))
            };
            let (at, _) = graph.wait_longer(LIMIT, "a report of the last test", reports);
            at - *ended
        })
        .collect();
    eprintln!("gap/report after the end of each test: {seen:.1?}");
    for (at, report) in graph.since(&topics::GAP_REPORT, began) {
        let causes = report.causes.iter().map(|cause| {
            let [effect, axis] = [&cause.effect, &cause.axis];
            let [d, confidence] = [cause.whitened_size, cause.confidence];
            format!(
                "{effect} {axis} status {} D {d:.1} at {confidence:.2}",
                cause.status
            )
        });
        let (after, causes) = (at - began, causes.collect::<Vec<_>>().join(", "));
        eprintln!("{after:.1?} {:?}: {causes}", report.runs);
    }
    assert!(seen.iter().all(|took| *took < LIMIT), "{seen:?}");
    let told = ["new effect: backlash X"];
    graph.condition(NODE, "new_effect", &told, ends[CYCLE_RUNS - 1].0);
    let healthy = graph.hears_condition(NODE, "new_effect", &[], began);
    assert!(healthy.is_some_and(|first| first.message.contains(told[0])));
    let _ = playing.ended_within(patience);
    node.stop();
}
