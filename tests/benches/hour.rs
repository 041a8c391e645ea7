//! An hour of a cell at 1 kHz: what its replay check takes, beside `rosbags` only reading the same bag; and the processor time
//! of a whole cell that works live, every node with its DDS: in one process, and each node a process of its own.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use abbe_tests::scenario::Scenario;

use crate::python;

/// What the check of an hour may take, s.
const BUDGET_S: f64 = 10.0;
/// Clock ticks of `/proc`, 1/s.
const TICKS_PER_S: f64 = 100.0;

/// A process that has ended.
struct Took {
    wall_s: f64,
    processor_s: f64,
    most_mib: f64,
    said: String,
}

/// Processor time of the children that have ended, and of those that they have waited for, s.
fn of_children_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    // Behind the name in parentheses the third field is the first; cutime and cstime are the 16th and 17th.
    let fields = stat.rsplit(')').next().unwrap().split_whitespace();
    let ticks = fields.skip(13).take(2).map(|t| t.parse::<f64>().unwrap());
    ticks.sum::<f64>() / TICKS_PER_S
}

fn took(mut command: Command) -> Took {
    let (began, before_s) = (Instant::now(), of_children_s());
    let log = tempfile::NamedTempFile::new().unwrap();
    command.stdin(Stdio::null());
    command.stdout(log.reopen().unwrap()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut most_mib = 0.0_f64;
    let ended = loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find(|line| line.starts_with("VmHWM:"));
        let kib = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
        most_mib = most_mib.max(kib.unwrap_or(0.0) / 1024.0);
        if let Some(ended) = child.try_wait().unwrap() {
            break ended;
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    assert!(ended.success(), "{command:?}: {ended}");
    Took {
        wall_s: began.elapsed().as_secs_f64(),
        processor_s: of_children_s() - before_s,
        most_mib,
        said: std::fs::read_to_string(log.path()).unwrap(),
    }
}

fn run(program: &Path, scenario: &Scenario, more: &[&str]) -> Took {
    let mut command = Command::new(program);
    command.arg("run").args(more).arg(scenario.folder());
    command.arg("--runs").arg(scenario.out());
    took(command)
}

fn at_1_khz() -> Scenario {
    let scenario = Scenario::copy_of("short_cell");
    let often = "background_rate_hz: 1000.0";
    scenario.replace("fake_cnc.yaml", "background_rate_hz: 10.0", often);
    scenario
}

/// An hour simulated, checked, and read by the peer.
pub fn check(program: &Path) {
    let scenario = at_1_khz();
    scenario.replace("plan.yaml", "minutes: 0.1", "minutes: 57.0");
    scenario.replace("scenario.yaml", "limit_min: 3.0", "limit_min: 120.0");
    scenario.append(
        "scenario.yaml",
        "simulated_start_s: 1767600000\ndiagnose: false\n",
    );
    let made = run(program, &scenario, &["--no-dds"]);
    println!(
        "an hour of the cell simulated and recorded in {:.0} s",
        made.wall_s
    );
    let bag = scenario.new_run(&[]).join("bag");
    let mut command = Command::new(program);
    command.arg("check").arg(&bag);
    let own = took(command);
    let verdict = if own.wall_s <= BUDGET_S {
        "kept"
    } else {
        "MISSED"
    };
    let last = own.said.lines().last().unwrap_or_default();
    println!(
        "checked in {:.2} s ({verdict}: {BUDGET_S:.0} s), most memory {:.0} MiB: {last}",
        own.wall_s, own.most_mib
    );
    let Some(mut peer) = python::peer("bench_bag.py") else {
        return;
    };
    let messages = messages(&bag);
    peer.args(["read", &messages.to_string(), "1"]).arg(&bag);
    let peer = took(peer);
    println!(
        "rosbags: {messages} messages read, none computed, in {:.1} s, ratio {:.1}",
        peer.wall_s,
        peer.wall_s / own.wall_s
    );
}

/// How many messages a bag holds, as its index says.
fn messages(bag: &Path) -> u64 {
    let text = std::fs::read_to_string(bag.join("metadata.yaml")).unwrap();
    let count = text.lines().find_map(|line| {
        let line = line.trim_start();
        let is_whole = line.starts_with("message_count:");
        is_whole.then(|| line.split_whitespace().nth(1)?.parse().ok())?
    });
    count.expect("metadata.yaml tells how many messages there are")
}

/// Both forms of a live cell; of `--separate`, the program waits for each node's process, so their time is in its own.
pub fn cell(program: &Path) {
    for (form, switches) in [
        ("one process", &[][..]),
        ("a process each", &["--separate"]),
    ] {
        let took = run(program, &at_1_khz(), switches);
        println!(
            "a cell live at 1 kHz, its nodes {form}, {:.0} s: {:.1} s of processor time, {:.2} of one core",
            took.wall_s,
            took.processor_s,
            took.processor_s / took.wall_s
        );
    }
}
