//! The links of models and archive break, shortly again and again and for long: the controller lets the compensation fade and
//! has it back soon after the links are, and the archive fetches what it missed.

use std::path::{Path, PathBuf};
use std::time::Duration;

use abbe_msgs::topics;
use abbe_tests::drift::{self, COMPENSATED_M, FADED_M, FRESH_S};
use abbe_tests::hosts::bag;
use abbe_tests::hosts::network::Network;
use abbe_tests::hosts::switch::{Link, Way};
use abbe_tests::program::Process;
use metrology::Axis;
use metrology::sample::AxisState;
use metrology::stamp::{Host, Stamp};

use crate::cell::{HOSTS, during};
use crate::figures::{After, Window, after, states};

/// Of both links of a way together: 5 ms, up to 1 ms of jitter.
const WAY: Way = Way {
    delay_s: 2.5e-3,
    jitter_s: 0.5e-3,
    loss: 0.0,
    reorder: 0.0,
};
/// Until everybody has met and the controller has all of the compensation.
const MEETING: Duration = Duration::from_secs(8);
/// How long the links are cut: shorter than the routers' lease, longer, and longer than a deep topic keeps.
const CUTS: [Duration; 8] = [
    Duration::from_millis(1500),
    Duration::from_millis(1500),
    Duration::from_millis(1500),
    Duration::from_millis(1500),
    Duration::from_millis(1500),
    Duration::from_secs(3),
    Duration::from_secs(16),
    Duration::from_secs(60),
];
/// What each is given to come back.
const AFTER: Duration = Duration::from_secs(4);
/// What a deep topic keeps, at 1 kHz, less a second.
const KEPT: u64 = 19_000;

/// Before a cut numbers were heard at 1 kHz.
const BEFORE_NANOS: i64 = 500_000_000;

/// What a cut was like, s after the links' return.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    lasted_s: f64,
    /// Least that the controller added before the links were back, m.
    left_m: f64,
    /// The first compensation at the controller, one that answers a fresh state, and all of it added.
    first_s: Option<f64>,
    fresh_s: Option<f64>,
    whole_s: Option<f64>,
    /// The archive's states of the axes.
    archive: After,
    /// What the archive misses of the compensation.
    compensation_missing: u64,
}

/// Runs it over Zenoh; `None` where this computer has no network namespaces, else whether each cut was over within
/// `recovery_s`.
pub fn are_over_within(recovery_s: f64, python: &PathBuf) -> Option<bool> {
    let mut network = Network::of(&HOSTS, 64, 20_261_125)?;
    network.over_zenoh(python);
    network.links(Link::even(WAY));
    let scenario = drift::scenario();
    let bags = ["controller", "archive"].map(|host| (host, scenario.path(&format!("at_{host}"))));
    let mut nodes: Vec<Process> = Vec::new();
    for (host, into) in &bags {
        let bag = format!("bag:={}", into.display());
        let name = format!("__node:=recorder_of_{host}");
        let words = ["-r".to_owned(), name, "-p".to_owned(), bag];
        nodes.push(network.node(host, "recorder", &words));
    }
    let file = |node: &str| {
        let file = scenario.argument(&format!("{node}.yaml"));
        ["--params-file".to_owned(), file]
    };
    let teller = env!("CARGO_BIN_EXE_drift_teller");
    nodes.push(network.node("controller", "fake_cnc", &file("fake_cnc")));
    nodes.push(network.node("models", "axis_compensation", &file("axis_compensation")));
    nodes.push(network.program("models", teller, &[]));
    std::thread::sleep(MEETING);
    let windows = CUTS.map(|lasts| {
        for host in ["models", "archive"] {
            network.cut(host, true);
        }
        let cut = during(lasts);
        for host in ["models", "archive"] {
            network.cut(host, false);
        }
        (cut, during(AFTER))
    });
    for node in nodes.into_iter().rev() {
        node.stop();
    }
    let seen = seen(&bags[0].1, &bags[1].1, &windows);
    Some(judge(&seen, recovery_s))
}

/// What the controller adds to X, m.
fn added_m(state: &AxisState) -> f64 {
    (state.motor[Axis::X] - state.commanded[Axis::X]) * 1e-3
}

/// What cuts were like, by the bags of both hosts; each cut with the time after it.
pub fn seen(controller: &Path, archive: &Path, windows: &[(Window, Window)]) -> Vec<Cut> {
    let of_machine = bag::messages(controller, &topics::AXES_STATE);
    let offsets = bag::messages(controller, &topics::COMPENSATION);
    let archived = states(archive);
    let answered = bag::messages(archive, &topics::COMPENSATION).into_iter();
    let numbers = bag::numbers(archive, topics::COMPENSATION.name);
    let came = answered.map(|(came, _)| came);
    let answers: Vec<(Stamp<Host>, u32)> = came.zip(numbers).collect();
    let of_cut = |(cut, after_it): &(Window, Window)| {
        let back = Stamp::<Host>::from_nanos(cut.until);
        let since_s = |at: Stamp<Host>| (at - back).as_secs_f64();
        let before = of_machine.iter().rev().find(|(came, _)| *came < back);
        let mut later = of_machine.iter().filter(|(came, _)| *came > back);
        let whole = later.find(|(_, state)| added_m(state) > COMPENSATED_M);
        let mut back_again = offsets.iter().filter(|(came, _)| *came > back);
        let first = back_again.clone().next();
        let fresh = back_again.find(|(came, offset)| (*came - offset.at).as_secs_f64() < FRESH_S);
        let around = Window {
            from: cut.from - BEFORE_NANOS,
            until: after_it.until,
        };
        let within = answers.iter().filter(|(came, _)| around.holds(*came));
        let numbers: Vec<u32> = within.map(|(_, number)| *number).collect();
        let missing = |two: &[u32]| u64::from(two[1].saturating_sub(two[0] + 1));
        let steps = numbers.windows(2).map(missing);
        Cut {
            lasted_s: cut.lasted_s(),
            left_m: before.map_or(f64::NAN, |(_, state)| added_m(state)),
            first_s: first.map(|(came, _)| since_s(*came)),
            fresh_s: fresh.map(|(came, _)| since_s(*came)),
            whole_s: whole.map(|(came, _)| since_s(*came)),
            archive: after(&archived, *cut),
            compensation_missing: steps.sum(),
        }
    };
    windows.iter().map(of_cut).collect()
}

/// Tells what each cut was like, and whether it was as wanted.
pub fn judge(cuts: &[Cut], recovery_s: f64) -> bool {
    let words = |value: Option<f64>| value.map_or("never".to_owned(), |s| format!("{s:.2} s"));
    let mut is_well = true;
    for seen in cuts {
        eprintln!(
            "  cut for {:.1} s: left {:.2} um; compensation again after {}, fresh after {}, whole after {}; the archive's states \
             fresh after {}, {} late, {} missing, of the compensation {}",
            seen.lasted_s,
            seen.left_m * 1e6,
            words(seen.first_s),
            words(seen.fresh_s),
            words(seen.whole_s),
            words(seen.archive.recovery_s),
            seen.archive.kept,
            seen.archive.missed,
            seen.compensation_missing,
        );
        let times = [
            seen.first_s,
            seen.fresh_s,
            seen.whole_s,
            seen.archive.recovery_s,
        ];
        let is_back = times.iter().all(|s| s.is_some_and(|s| s < recovery_s));
        let is_whole = seen.archive.missed == 0 || seen.archive.kept >= KEPT;
        let is_one =
            seen.left_m.abs() < FADED_M && is_back && is_whole && seen.compensation_missing == 0;
        if !is_one {
            eprintln!(
                "NOT AS WANTED: faded, back within {recovery_s} s, nothing missing that is kept: {seen:?}"
            );
        }
        is_well &= is_one;
    }
    is_well
}
