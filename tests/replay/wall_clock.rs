//! How fast a computer is, and whether it stands in between, is in no result.

use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use abbe_tests::program::{Process, command};
use abbe_tests::scenario::{SHORT_PLAN, Scenario, mcap_file};
use nix::sys::signal::Signal;

use crate::contract::{check, short_run};
use crate::recorded_output::stripped;

#[test]
fn replay_ignores_wall_clock() {
    let scenario = Scenario::copy_of("first_run");
    scenario.write("plan.yaml", SHORT_PLAN);
    let mut run = scenario.start(&["--pace", "100"]);
    std::thread::sleep(Duration::from_secs(1));
    run.signal(Signal::SIGSTOP);
    std::thread::sleep(Duration::from_secs(1));
    assert!(run.is_running(), "it was stopped too late");
    run.signal(Signal::SIGCONT);
    let ended = run.ended_within(Duration::from_secs(600));
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let slow = scenario.new_run(&[]).join("bag");
    let bags = [slow.as_path(), short_run()].map(|bag| std::fs::read(mcap_file(bag)).unwrap());
    assert_eq!(bags[0], bags[1], "a paced run that stood has another bag");
    assert_eq!(check(&slow).0, 0);
}

/// What `abbe check --json` of a bag without results says, which has the SHA-256 of all that was computed; it stands for
/// `stands` and runs for `runs` in turn, at most `times`. Also says how often it stood.
pub fn replayed(bag: &Path, (stands, runs): (Duration, Duration), times: u32) -> (String, u32) {
    let mut checking = command(0, &["check", "--json"]);
    checking.arg(bag).stderr(Stdio::null());
    let mut checking = Process::start(checking);
    let mut stood = 0;
    std::thread::sleep(runs);
    while stood < times && checking.is_running() {
        checking.signal(Signal::SIGSTOP);
        std::thread::sleep(stands);
        checking.signal(Signal::SIGCONT);
        stood += 1;
        std::thread::sleep(runs);
    }
    (checking.ended_within(Duration::from_secs(300)).said, stood)
}

#[test]
fn replay_run_slowly_quickly_and_stopped_midway_computes_the_same() {
    let bag = stripped();
    let millis = Duration::from_millis;
    let (quick, _) = replayed(bag.path(), (millis(0), millis(0)), 0);
    assert!(quick.contains("sha256"), "{quick}");
    let (slow, steps) = replayed(bag.path(), (millis(20), millis(4)), u32::MAX);
    let (stopped, stops) = replayed(bag.path(), (millis(1_500), millis(30)), 1);
    eprintln!("slowly: stood {steps} times; stopped: {stops} times");
    assert!(steps > 3 && stops == 1, "{steps} and {stops}");
    assert_eq!(slow, quick);
    assert_eq!(stopped, quick);
}
