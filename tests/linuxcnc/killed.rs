//! The bridge's process is killed with SIGKILL while a program of its own runs and offsets are on the axes.
//!
//! LinuxCNC is a process of its own and goes on. Its HAL hears no heartbeat any more: the offset stays where it is for
//! 2 s, then fades at HAL's own rate. Where LinuxCNC was started by others the next bridge finds it, and takes a program when the one
//! that nobody watches has ended. Where the bridge had started it, LinuxCNC ends, and the next bridge starts another one.

use std::process::Command;
use std::time::{Duration, Instant};

use abbe_msgs::msg::{AxisState, PlanStatus};
use abbe_msgs::topics;
use abbe_tests::graph::{Graph, Voice, now, port};
use abbe_tests::namespace::isolated;
use abbe_tests::program::{Process, command, domain};
use abbe_tests::said::compensation;
use abbe_tests::scenario::Scenario;
use linuxcnc_bridge::BridgeConfig;
use linuxcnc_bridge::io::start::Controller;
use nix::sys::signal::Signal;
use serde_json::Value;

use crate::{installed, root};

/// What is asked for on X, mm.
pub const OFFSET_MM: f64 = 0.030;
/// HAL's rate, mm/s, and its servo period, s.
pub const RATE_MM_S: f64 = 0.02;
const PERIOD_S: f64 = 0.001;
/// The heartbeat is missed after 2 s.
const MISSED: Duration = Duration::from_secs(2);
/// How long before the kill the last heartbeat may have been.
const SLACK: Duration = Duration::from_millis(500);
/// An offset of nothing. Homing under a moving offset shifts the zero by the drive's lag, 0.02 mm/s over 60 per second: 0.33 um.
pub const NONE_MM: f64 = 0.1e-3;
/// LinuxCNC, a bridge and its positions.
pub const START: Duration = Duration::from_secs(90);
/// X goes there and back for half a minute and more.
const PROGRAM: &str = "G21 G90\nG1 X0 Y0 Z10 F3000\nG1 X100 F300\nG1 X0 F300\nM2\n";
const SHORT: &str = "G21 G90\nG1 X5 F600\nM2\n";

/// LinuxCNC as others start it; its owner ends it.
pub fn controller() -> Controller {
    let folder = root().join("launch_configs/linuxcnc_latency");
    let text = std::fs::read_to_string(folder.join("linuxcnc_bridge.yaml")).unwrap();
    let file: Value = serde_saphyr::from_str(&text).unwrap();
    let parameters = file["/**"]["ros__parameters"].clone();
    let config: BridgeConfig = serde_json::from_value(parameters).unwrap();
    let ini = folder.join("controller/latency.ini");
    Controller::start(&config, &ini).unwrap_or_else(|error| panic!("{error}"))
}

pub struct Desk {
    scenario: Scenario,
    pub domain: u16,
    pub graph: Graph,
    pub voice: Voice,
}

impl Desk {
    /// In the domain of the test of this number.
    pub fn new(test: u16) -> Self {
        let scenario = Scenario::copy_of("linuxcnc_latency");
        let start = "    start_ini: controller/latency.ini\n";
        scenario.replace("linuxcnc_bridge.yaml", start, "");
        let domain = domain(test);
        let graph = Graph::join(domain);
        let voice = graph.voice(&[port(&topics::COMPENSATION)]);
        Self {
            scenario,
            domain,
            graph,
            voice,
        }
    }

    pub fn node(&self, name: &str) -> Process {
        let file = self.scenario.argument(&format!("{name}.yaml"));
        Process::node(self.domain, name, &["--params-file", &file])
    }

    /// A sequencer that has one program run.
    pub fn running(&self, program: &str) -> Process {
        let plan = "title: one program\nsteps:\n  - {do: run, program: part.ngc}\n";
        self.scenario.write("plan.yaml", plan);
        self.scenario.write("part.ngc", program);
        self.node("sequencer")
    }

    /// Waits for a state that `pick` takes while an offset is asked for, ten times a second.
    fn with_offset(&mut self, since: Instant, pick: impl Fn(&AxisState) -> bool) -> AxisState {
        let (graph, voice) = (&self.graph, &mut self.voice);
        graph.wait_longer(START, "a state under an offset", |graph| {
            voice.say(0, &compensation(&now(), OFFSET_MM * 1e-3));
            std::thread::sleep(Duration::from_millis(80));
            let states = graph.since(&topics::AXES_STATE, since);
            states.into_iter().map(|(_, state)| state).find(&pick)
        })
    }

    /// How a plan ended.
    pub fn ended(&self, since: Instant) -> PlanStatus {
        self.graph.wait_longer(START, "the end of a plan", |graph| {
            let all = graph.since(&topics::PLAN_STATUS, since);
            let is_over = |status: &PlanStatus| status.state >= PlanStatus::STATE_DONE;
            all.into_iter().map(|(_, status)| status).find(is_over)
        })
    }
}

pub fn offset_mm(state: &AxisState) -> f64 {
    (state.motor[0] - state.commanded[0]) * 1e3
}

/// Motor minus command in motion lags behind it: what is asked for shows at rest.
pub fn stands(state: &AxisState) -> bool {
    state.velocity[0].abs() < 1e-6
}

pub fn pin(controller: &Controller, name: &str) -> f64 {
    let told = controller.command("halcmd", &["getp", name]).unwrap();
    let number = told.trim().parse();
    number.unwrap_or_else(|_| panic!("{name}: {told:?}"))
}

/// Looks at HAL until its offset has faded: it is never larger than it was, steps by no more than its rate allows, stays
/// for the time in which the heartbeat is missed, and goes to zero. The command goes on meanwhile.
fn fades(controller: &Controller, killed: Instant) {
    let offset = "compensation.x.out";
    let from_mm = pin(controller, "joint.0.pos-cmd");
    // A look takes its value at some instant between its begin and its end.
    let mut before = Instant::now();
    let mut before_mm = pin(controller, offset);
    assert!((before_mm - OFFSET_MM).abs() < 1e-3, "{before_mm}");
    let faded = loop {
        std::thread::sleep(Duration::from_millis(20));
        let begin = Instant::now();
        let (now_mm, at) = (pin(controller, offset), Instant::now());
        let passed_s = (at - before).as_secs_f64();
        let limit_mm = RATE_MM_S * (passed_s + 2.0 * PERIOD_S);
        assert!(now_mm <= before_mm + 1e-6, "{before_mm} to {now_mm}");
        assert!(
            before_mm - now_mm < limit_mm,
            "{before_mm} to {now_mm} in {passed_s} s"
        );
        if before_mm.abs() < 1e-6 {
            break at;
        }
        (before_mm, before) = (now_mm, begin);
    };
    let took = faded - killed;
    println!(
        "the offset had faded {:.1} s after the kill",
        took.as_secs_f64()
    );
    let fading = Duration::from_secs_f64(OFFSET_MM / RATE_MM_S);
    let held = MISSED.checked_sub(SLACK).unwrap();
    assert!(
        took > held + fading,
        "{took:?}: it stays while the heartbeat may come"
    );
    assert!(
        took < MISSED + 2 * fading + Duration::from_secs(2),
        "{took:?}"
    );
    let moved_mm = (pin(controller, "joint.0.pos-cmd") - from_mm).abs();
    assert!(
        moved_mm > 1.0,
        "LinuxCNC's program went on by {moved_mm} mm"
    );
}

#[test]
fn a_bridge_killed_in_mid_program_leaves_an_offset_that_hal_fades_and_the_next_one_goes_on() {
    isolated(|| {
        if !installed() {
            return;
        }
        let controller = controller();
        let mut desk = Desk::new(18);
        let began = Instant::now();
        let bridge = desk.node("linuxcnc_bridge");
        let settled = |state: &AxisState| stands(state) && offset_mm(state) > OFFSET_MM - NONE_MM;
        desk.with_offset(began, settled);
        let sequencer = desk.running(PROGRAM);
        let begun = Instant::now();
        desk.with_offset(begun, |state| state.commanded[0] > 5e-3 && !stands(state));
        bridge.signal(Signal::SIGKILL);
        let killed = Instant::now();
        fades(&controller, killed);
        drop(bridge);
        sequencer.signal(Signal::SIGINT);
        let ended = sequencer.ended_within(Duration::from_secs(30));
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);

        let again = Instant::now();
        let bridge = desk.node("linuxcnc_bridge");
        desk.graph.wait_longer(START, "positions", |graph| {
            graph.since(&topics::AXES_STATE, again).pop()
        });
        // Nobody watches the program: another one is not begun beside it.
        let refused = Instant::now();
        let sequencer = desk.running(SHORT);
        let status = desk.ended(refused);
        let words = "the controller is running something else";
        assert!(status.message.contains(words), "{status:?}");
        drop(sequencer);
        desk.graph
            .wait_longer(START, "the program's own end", |graph| {
                let states = graph.since(&topics::AXES_STATE, refused);
                let last = states.iter().rev().take(1_000);
                let at_rest =
                    last.filter(|(_, state)| stands(state) && state.commanded[0].abs() < 1e-6);
                (at_rest.count() == 1_000).then_some(())
            });
        let done = Instant::now();
        let sequencer = desk.running(SHORT);
        let status = desk.ended(done);
        assert_eq!(status.state, PlanStatus::STATE_DONE, "{status:?}");
        // Its drives have come to rest, and nobody asks for an offset.
        let at_rest = desk.graph.next(&topics::AXES_STATE, Instant::now(), stands);
        assert!(offset_mm(&at_rest).abs() < NONE_MM, "{at_rest:?}");
        desk.with_offset(Instant::now(), settled);
        sequencer.stop();
        bridge.signal(Signal::SIGINT);
        let ended = bridge.ended_within(Duration::from_secs(60));
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        desk.voice.stop();
    });
}

/// A bridge that starts LinuxCNC itself, as soon as there are positions.
fn starting(domain: u16, graph: &Graph) -> Process {
    let file = root().join("launch_configs/linuxcnc_latency/linuxcnc_bridge.yaml");
    let mut starts = command(domain, &["node", "linuxcnc_bridge", "--ros-args"]);
    starts.arg("--params-file").arg(&file);
    let since = Instant::now();
    let mut process = Process::start(starts);
    while process.is_running() {
        if !graph.since(&topics::AXES_STATE, since).is_empty() {
            return process;
        }
        assert!(since.elapsed() < START, "no positions");
        std::thread::sleep(Duration::from_millis(50));
    }
    let ended = process.ended_within(Duration::from_secs(1));
    panic!("{}", ended.said);
}

#[test]
fn after_a_bridge_that_was_killed_with_its_linuxcnc_the_next_one_starts_at_once() {
    isolated(|| {
        if !installed() {
            return;
        }
        let domain = domain(19);
        let graph = Graph::join(domain);
        let bridge = starting(domain, &graph);
        bridge.signal(Signal::SIGKILL);
        let killed = Instant::now();
        drop(bridge);
        // Its LinuxCNC is still there, and about to end.
        let file = root().join("launch_configs/linuxcnc_latency/linuxcnc_bridge.yaml");
        let mut starts = command(domain, &["node", "linuxcnc_bridge", "--ros-args"]);
        starts.arg("--params-file").arg(&file);
        let mut next = Process::start(starts);
        graph.wait_longer(START, "positions of the next one", |graph| {
            if !next.is_running() {
                return Some(false);
            }
            // What the first one said last may be on its way.
            let states = graph.since(&topics::AXES_STATE, killed + Duration::from_secs(3));
            (!states.is_empty()).then_some(true)
        });
        next.signal(Signal::SIGINT);
        let ended = next.ended_within(Duration::from_secs(60));
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        assert!(nothing_runs(), "LinuxCNC is left behind");
    });
}

fn nothing_runs() -> bool {
    let mut found = Command::new("pidof");
    found.args(["rtapi_app", "milltask", "linuxcncrsh"]);
    found.output().unwrap().stdout.is_empty()
}

/// The process that ends LinuxCNC when its bridge is gone.
fn has_guard() -> bool {
    let mut found = Command::new("pgrep");
    found.args(["-f", "abbe-linuxcnc-guard"]);
    !found.output().unwrap().stdout.is_empty()
}

#[test]
fn a_linuxcnc_that_was_only_starting_when_its_bridge_was_killed_ends_too() {
    isolated(|| {
        if !installed() {
            return;
        }
        assert!(!has_guard(), "somebody else's LinuxCNC runs");
        let deadline = Instant::now() + START;
        let file = root().join("launch_configs/linuxcnc_latency/linuxcnc_bridge.yaml");
        let mut starts = command(domain(19), &["node", "linuxcnc_bridge", "--ros-args"]);
        starts.arg("--params-file").arg(&file);
        let mut bridge = Process::start(starts);
        while !has_guard() {
            assert!(bridge.is_running() && Instant::now() < deadline, "no guard");
            std::thread::sleep(Duration::from_millis(10));
        }
        bridge.signal(Signal::SIGKILL);
        drop(bridge);
        let until = Instant::now() + START;
        while has_guard() || !nothing_runs() {
            assert!(Instant::now() < until, "LinuxCNC is left behind");
            std::thread::sleep(Duration::from_millis(200));
        }
    });
}
