//! Runs and recordings that are called off, and a run that is killed over its nodes.

use std::process::Stdio;
use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::program::{Process, command, domain};
use abbe_tests::scenario::Scenario;
use metrology::sample::CompensationState;
use nix::sys::signal::Signal;
use recorder::{Bag, Event, Order};

use abbe_tests::graph::Graph;

/// A cell in real time takes this long to its first probed point, with discovery.
const FIRST_POINT: Duration = Duration::from_secs(60);
const END: Duration = Duration::from_secs(30);

fn started(scenario: &Scenario, domain: u16, more: &[&str]) -> (Graph, Process) {
    heard(scenario, domain, more, Stdio::piped())
}

/// The same, its standard error somewhere else.
fn heard(scenario: &Scenario, domain: u16, more: &[&str], stderr: Stdio) -> (Graph, Process) {
    let graph = Graph::join(domain);
    let mut command = command(domain, &["run"]);
    command
        .arg(scenario.folder())
        .arg("--runs")
        .arg(scenario.out());
    command.args(more).stderr(stderr);
    let began = Instant::now();
    let run = Process::start(command);
    graph.wait_longer(FIRST_POINT, "a probed point", |graph| {
        (!graph.since(&topics::PROBE_POINT, began).is_empty()).then_some(())
    });
    (graph, run)
}

/// Topics of a closed bag with their number of messages; it must be whole.
fn whole(bag: &Bag) -> Vec<(String, u64)> {
    let mut counts = std::collections::BTreeMap::<String, u64>::new();
    let mut messages = bag.messages(Order::LogTime);
    while let Some(event) = messages.next_event() {
        match event {
            Event::Message(message) => {
                let name = bag.topic(message.topic).topic.clone();
                *counts.entry(name).or_default() += 1;
            }
            Event::Loss(loss) => panic!("{loss:?}"),
        }
    }
    counts.into_iter().collect()
}

/// A pipe whose reader has left, as `tee` does at the Ctrl-C that ends the run.
fn left() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

#[test]
fn an_interrupted_run_closes_its_bag_and_writes_its_page() {
    for (more, is_heard, signal) in [
        (&[][..], true, Signal::SIGINT),
        (&["--separate"], true, Signal::SIGINT),
        (&[], false, Signal::SIGINT),
        // A terminal that is closed takes the reader of its standard error with it.
        (&[], false, Signal::SIGHUP),
        (&["--separate"], true, Signal::SIGHUP),
    ] {
        let scenario = Scenario::copy_of("short_cell");
        let stderr = if is_heard { Stdio::piped() } else { left() };
        let (graph, run) = heard(&scenario, domain(9), more, stderr);
        let asked = Instant::now();
        run.signal(signal);
        let ended = run.ended_within(END);
        eprintln!("{more:?}: {signal} to exit: {:?}", asked.elapsed());
        assert_eq!(ended.status.code(), Some(130), "{}", ended.said);
        let is_told = ended.said.contains("it was interrupted");
        assert_eq!(is_told, is_heard, "{}", ended.said);
        let folder = scenario.new_run(&[]);
        assert!(folder.join("report.html").is_file());
        let bag = Bag::open(folder.join("bag")).unwrap();
        let parameters = bag.attachment("params/axis_compensation.yaml").unwrap();
        let parameters = String::from_utf8(parameters.unwrap().data).unwrap();
        assert!(
            parameters.contains("gap_s: 0.5") && parameters.contains("hold_s: "),
            "{more:?}: a default is not among what is recorded:\n{parameters}"
        );
        let counts = whole(&bag);
        assert!(
            counts
                .iter()
                .any(|(topic, n)| topic == "/probe/point" && *n > 0),
            "{counts:?}"
        );
        let last = graph.inner_since(&topics::COMPENSATION, asked).pop();
        if let Some(last) = last {
            assert!(
                last.total.0.iter().all(|offset| offset.abs() < 1e-9),
                "{last:?}"
            );
            assert!(
                last.state
                    .0
                    .iter()
                    .all(|state| *state != CompensationState::Active)
            );
        }
    }
}

#[test]
fn nodes_of_a_killed_run_stop_by_themselves() {
    let scenario = Scenario::copy_of("short_cell");
    let (graph, run) = started(&scenario, domain(10), &["--separate"]);
    run.signal(Signal::SIGKILL);
    let _ = run.ended_within(END);
    let killed = Instant::now();
    let silent = Duration::from_secs(3);
    graph.wait_longer(END, "silence of every node", |graph| {
        let since = Instant::now().checked_sub(silent)?;
        let is_over = killed.elapsed() > silent
            && graph.since(&topics::AXES_STATE, since).is_empty()
            && graph.since(&topics::DIAGNOSTICS, since).is_empty();
        is_over.then_some(())
    });
    eprintln!("silent {:?} after the kill", killed.elapsed() - silent);
}

#[test]
fn a_node_that_dies_in_a_separate_run_is_named_and_the_plan_ends() {
    let scenario = Scenario::copy_of("short_cell");
    let (_graph, run) = started(&scenario, domain(11), &["--separate"]);
    let killed = std::process::Command::new("pkill")
        .args(["-KILL", "-f"])
        .arg(format!(
            "node --while-input-is-open fake_cnc.*{}",
            scenario.folder().display()
        ))
        .status()
        .unwrap();
    assert!(killed.success(), "{killed}");
    let ended = run.ended_within(END);
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    assert!(
        ended.said.contains("node fake_cnc ended: signal: 9"),
        "{}",
        ended.said
    );
    whole(&Bag::open(scenario.new_run(&[]).join("bag")).unwrap());
}

#[test]
fn a_recording_ends_with_a_signal_and_holds_what_was_said() {
    let scenario = Scenario::copy_of("short_cell");
    let domain = domain(12);
    let bag = scenario.out().join("recorded");
    std::fs::create_dir_all(scenario.out()).unwrap();
    let mut command = command(domain, &["record", "-o"]);
    command.arg(&bag).args(["/probe/*", "/test/segment"]);
    let recording = Process::start(command);
    let runs = Scenario::copy_of("short_cell");
    let (_graph, run) = started(&runs, domain, &[]);
    run.signal(Signal::SIGTERM);
    let _ = run.ended_within(END);
    recording.signal(Signal::SIGHUP);
    let ended = recording.ended_within(END);
    let said = ended.said;
    assert_eq!(ended.status.code(), Some(0), "{said}");
    assert!(said.contains("0 lost"), "{said}");
    let counts = whole(&Bag::open(&bag).unwrap());
    eprintln!("{counts:?}");
    let n = |name: &str| {
        counts
            .iter()
            .find(|(topic, _)| topic == name)
            .map_or(0, |(_, n)| *n)
    };
    assert!(
        n("/probe/point") > 0 && n("/probe/trigger") >= n("/probe/point"),
        "{counts:?}"
    );
    assert!(
        n("/test/segment") > 0 && n("/axes/state") == 0,
        "{counts:?}"
    );
}

#[test]
fn a_simulated_run_that_is_interrupted_closes_its_bag_and_names_the_steps_that_were_skipped() {
    for signal in [Signal::SIGINT, Signal::SIGHUP] {
        closes_its_bag_after(signal);
    }
}

fn closes_its_bag_after(signal: Signal) {
    let scenario = Scenario::copy_of("short_cell");
    // As the scenario, but in simulated time and no faster than real time.
    scenario.append("scenario.yaml", "simulated_start_s: 1767600000\n");
    let mut command = command(0, &["run", "--no-dds", "--pace", "1"]);
    command
        .arg(scenario.folder())
        .arg("--runs")
        .arg(scenario.out());
    let run = Process::start(command);
    std::thread::sleep(Duration::from_secs(6));
    run.signal(signal);
    let ended = run.ended_within(END);
    assert_eq!(ended.status.code(), Some(130), "{}", ended.said);
    assert!(ended.said.contains("it was interrupted"), "{}", ended.said);
    let skipped = "were skipped: the run ended in step";
    assert!(ended.said.contains(skipped), "{}", ended.said);
    let folder = scenario.new_run(&[]);
    assert!(folder.join("report.html").is_file());
    assert!(!whole(&Bag::open(folder.join("bag")).unwrap()).is_empty());
}
