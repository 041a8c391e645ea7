//! Every node of a cell killed in mid-run and restarted: the others go on and say so, the axes never
//! step, and what was recorded is read.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use abbe_msgs::msg::AxisState;
use abbe_msgs::topics;
use abbe_tests::drift::{self, DRIFT_M};
use abbe_tests::program::{Process, domain};
use abbe_tests::scenario::Scenario;
use metrology::sample::PlanState;
use nix::sys::signal::Signal;
use recorder::{Bag, Event, Order};

use abbe_tests::graph::{Graph, Voice, now, port};

const NODES: [&str; 6] = [
    "fake_cnc",
    "probe",
    "latency_calibrator",
    "thermal_model",
    "axis_compensation",
    "sequencer",
];

/// Rate at which fake_cnc follows a compensation at most, here, m/s.
const RATE_LIMIT_M_S: f64 = 25e-6;
/// Friction lets the motors creep behind by less than this, m.
const CREEP_M: f64 = 1e-6;
/// Over which steps are looked for, s.
const WINDOW_S: f64 = 0.1;

struct Cell {
    scenario: Scenario,
    domain: u16,
    graph: Graph,
    nodes: BTreeMap<&'static str, Process>,
}

impl Cell {
    fn start(scenario: Scenario, domain: u16, names: &[&'static str]) -> Self {
        let mut cell = Self {
            scenario,
            domain,
            graph: Graph::join(domain),
            nodes: BTreeMap::new(),
        };
        for name in names {
            cell.launch(name);
        }
        let since = Instant::now();
        for name in names {
            cell.graph.alive(name, since);
        }
        cell
    }

    fn launch(&mut self, name: &'static str) {
        let file = self.scenario.argument(&format!("{name}.yaml"));
        let process = Process::node(self.domain, name, &["--params-file", &file]);
        self.nodes.insert(name, process);
    }

    fn kill(&mut self, name: &str) -> Instant {
        let process = self.nodes.remove(name).unwrap();
        process.signal(Signal::SIGKILL);
        let at = Instant::now();
        let ended = process.ended_within(Duration::from_secs(5));
        assert_eq!(ended.status.code(), None, "{name} was killed");
        eprintln!("{name} killed");
        at
    }

    /// Every node that was not killed speaks after `since`.
    fn others_go_on(&self, since: Instant) {
        // What was on its way at the kill does not count.
        let since = since + Duration::from_millis(500);
        for name in self.nodes.keys() {
            self.graph.alive(name, since);
        }
        if self.nodes.contains_key("fake_cnc") {
            self.graph.next(&topics::AXES_STATE, since, |_| true);
            self.graph.next(&topics::JOINT_STATES, since, |_| true);
            if self.nodes.contains_key("axis_compensation") {
                self.graph.next(&topics::COMPENSATION, since, |_| true);
            }
        }
    }

    fn compensated(&self, since: Instant) {
        self.graph.next(&topics::COMPENSATION, since, |message| {
            message
                .total
                .iter()
                .all(|total| (total - DRIFT_M).abs() < 0.2e-6)
        });
    }

    /// Stops every node with SIGINT; each ends with exit code 0.
    fn stop(self) {
        for process in self.nodes.into_values() {
            process.stop();
        }
    }
}

fn quiet_cell() -> Scenario {
    let scenario = Scenario::copy_of("short_cell");
    scenario.write(
        "plan.yaml",
        "title: rest\nsteps:\n  - {do: wait, seconds: 3600.0}\n",
    );
    scenario.replace(
        "fake_cnc.yaml",
        "background_rate_hz: 10.0",
        "background_rate_hz: 250.0\n    compensation_rate_limit_um_s: 25.0",
    );
    scenario.replace("axis_compensation.yaml", "enabled: false", "enabled: true");
    scenario
}

fn tell_drift(voice: &mut Voice) {
    voice.say(0, &drift::model(&now()));
}

fn recorder(domain: u16, bag: &Path) -> Process {
    let bag = format!("bag:={}", bag.display());
    Process::node(domain, "recorder", &["-p", &bag])
}

#[test]
fn each_node_is_killed_and_restarted_and_the_others_go_on() {
    let (scenario, domain) = (quiet_cell(), domain(7));
    let bags = [scenario.path("killed"), scenario.path("whole")];
    let recording = recorder(domain, &bags[0]);
    let began = Instant::now();
    let mut cell = Cell::start(scenario, domain, &NODES);
    let mut voice = cell.graph.voice(&[port(&topics::THERMAL_MODEL)]);
    tell_drift(&mut voice);
    cell.compensated(began);

    let killed = cell.kill("axis_compensation");
    let words = ["no compensation for", "fading"];
    cell.graph
        .condition("fake_cnc", "compensation_input", &words, killed);
    cell.others_go_on(killed);
    let restarted = Instant::now();
    cell.launch("axis_compensation");
    let first = cell.graph.next(&topics::COMPENSATION, restarted, |_| true);
    assert!(
        first.total.iter().all(|total| total.abs() < 1e-6),
        "{first:?}"
    );
    cell.compensated(restarted);

    for name in ["thermal_model", "probe", "latency_calibrator", "sequencer"] {
        let killed = cell.kill(name);
        cell.others_go_on(killed);
        let restarted = Instant::now();
        cell.launch(name);
        cell.graph.alive(name, restarted);
    }

    let killed = cell.kill("fake_cnc");
    let words = ["no axis state for"];
    cell.graph
        .condition("axis_compensation", "axis_states", &words, killed);
    cell.others_go_on(killed);
    let restarted = Instant::now();
    cell.launch("fake_cnc");
    cell.graph.next(&topics::AXES_STATE, restarted, |_| true);
    cell.compensated(restarted + Duration::from_secs(2));

    recording.signal(Signal::SIGKILL);
    let killed = Instant::now();
    assert_eq!(
        recording.ended_within(Duration::from_secs(5)).status.code(),
        None
    );
    cell.others_go_on(killed);
    let recording = recorder(domain, &bags[1]);
    cell.graph.alive("recorder", Instant::now());
    std::thread::sleep(Duration::from_secs(1));
    check_never_stepped(&cell.graph, began);
    recording.stop();
    voice.stop();
    check_bags(&bags);
    cell.stop();
}

/// Motor minus commanded moves no faster than fake_cnc's own limit, whoever is killed.
fn check_never_stepped(graph: &Graph, since: Instant) {
    let states: Vec<AxisState> = graph
        .since(&topics::AXES_STATE, since)
        .into_iter()
        .map(|(_, state)| state)
        .collect();
    let at_s = |state: &AxisState| {
        f64::from(state.controller_stamp.sec) + f64::from(state.controller_stamp.nanosec) * 1e-9
    };
    let (mut worst_tick_m, mut worst_window_m, mut greatest_m) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (place, state) in states.iter().enumerate() {
        let later = states[place + 1..]
            .iter()
            .take_while(|later| (0.0..=WINDOW_S).contains(&(at_s(later) - at_s(state))));
        for (ticks, later) in later.enumerate() {
            for axis in 0..3 {
                let added_m = |s: &AxisState| s.motor[axis] - s.commanded[axis];
                let moved_m = (added_m(later) - added_m(state)).abs();
                greatest_m = greatest_m.max(added_m(state).abs());
                worst_window_m = worst_window_m.max(moved_m);
                if ticks == 0 {
                    worst_tick_m = worst_tick_m.max(moved_m);
                }
            }
        }
    }
    eprintln!(
        "{} states: added at most {:.2} um, moved at most {:.3} um in 4 ms, {:.3} um in 0.1 s",
        states.len(),
        greatest_m * 1e6,
        worst_tick_m * 1e6,
        worst_window_m * 1e6
    );
    assert!(
        greatest_m > 0.9 * DRIFT_M,
        "the axes were compensated at all"
    );
    assert!(worst_window_m <= RATE_LIMIT_M_S * WINDOW_S + CREEP_M);
    assert!(worst_tick_m <= RATE_LIMIT_M_S * 0.004 + CREEP_M);
}

/// The killed recording is read up to its cut, the stopped one to its end.
fn check_bags(bags: &[std::path::PathBuf; 2]) {
    for (bag, is_whole) in bags.iter().zip([false, true]) {
        let bag = Bag::open(bag).unwrap();
        let names: Vec<String> = bag.topics().iter().map(|t| t.topic.clone()).collect();
        let mut counts = vec![0_u64; names.len()];
        let mut losses = Vec::new();
        let mut events = bag.messages(Order::File);
        while let Some(event) = events.next_event() {
            match event {
                Event::Message(message) => counts[message.topic.index()] += 1,
                Event::Loss(loss) => losses.push(loss.to_string()),
            }
        }
        let of = |topic: &str| {
            let place = names
                .iter()
                .position(|name| name.trim_start_matches('/') == topic.trim_start_matches('/'));
            place.map_or(0, |place| counts[place])
        };
        let (states, offsets) = (of(topics::AXES_STATE.name), of(topics::COMPENSATION.name));
        let said = of(topics::DIAGNOSTICS.name);
        eprintln!("bag: {states} states, {offsets} compensations, {said} diagnostics; {losses:?}");
        let least = if is_whole { 100 } else { 1000 };
        assert!(states > least && offsets > least && said > 3);
        assert_eq!(losses.is_empty(), is_whole, "{losses:?}");
    }
}

/// The controller dies under a program: the sequencer says so once the lease is over, and the plan
/// has failed rather than hangs.
#[test]
fn a_controller_that_dies_under_a_program_fails_the_plan_and_says_so() {
    dies_under_a_program(domain(8), |_| ());
}

/// The same when it is there again before its lease is over, and knows nothing of the program.
#[test]
fn a_controller_that_comes_back_without_its_program_fails_the_plan_and_says_so() {
    dies_under_a_program(domain(13), |cell| {
        let restarted = Instant::now();
        cell.launch("fake_cnc");
        cell.graph.next(&topics::AXES_STATE, restarted, |_| true);
    });
}

fn dies_under_a_program(domain: u16, then: impl FnOnce(&mut Cell)) {
    let scenario = Scenario::copy_of("short_cell");
    scenario.write(
        "plan.yaml",
        "title: part\nsteps:\n  - {do: produce, program: production.ngc, minutes: 10.0, serve_updates: false}\n",
    );
    let mut cell = Cell::start(scenario, domain, &["fake_cnc", "sequencer"]);
    let began = Instant::now() - Duration::from_secs(60);
    cell.graph.wait("the axes move", |graph| {
        let states = graph.inner_since(&topics::AXES_STATE, began);
        let last = states.last()?;
        let speed = last.axes.iter().map(|axis| last.velocity[axis].abs());
        speed.fold(0.0, f64::max).gt(&10.0).then_some(())
    });
    let killed = cell.kill("fake_cnc");
    cell.others_go_on(killed);
    then(&mut cell);
    let patience = Duration::from_secs(90);
    let words = ["vanished"];
    cell.graph
        .condition_within(patience, "sequencer", "plan_failed", &words, killed);
    eprintln!("missed after {:.1} s", killed.elapsed().as_secs_f64());
    let status = cell
        .graph
        .inner_since(&topics::PLAN_STATUS, killed)
        .pop()
        .unwrap();
    assert_eq!(status.state, PlanState::Failed);
    cell.stop();
}
