//! A cell at 1 kHz on three hosts, over a free link, a lossy one and one that is cut.

use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use abbe_tests::hosts::network::Network;
use abbe_tests::hosts::switch::{Link, Way};
use abbe_tests::program::Process;
use abbe_tests::scenario::Scenario;

use crate::figures::{Figures, Use, Window};

/// How long each state of the link lasts.
#[derive(Clone, Copy)]
pub struct Times {
    pub free: Duration,
    pub lossy: Duration,
    pub cut: Duration,
    pub after: Duration,
}

pub const HOSTS: [&str; 3] = ["controller", "models", "archive"];
/// Until everybody has met.
const MEETING: Duration = Duration::from_secs(6);
/// What a link is given to carry what was said before its state changed.
const TAIL: Duration = Duration::from_secs(1);

/// A link that does nothing to frames.
const FREE: Way = Way {
    delay_s: 0.0,
    jitter_s: 0.0,
    loss: 0.0,
    reorder: 0.0,
};
/// Of both links of a way together: 5 ms, up to 1 ms of jitter, 1 % loss, 1 % overtaking.
const LOSSY: Way = Way {
    delay_s: 2.5e-3,
    jitter_s: 0.5e-3,
    loss: 0.005,
    reorder: 0.005,
};

fn now_nanos() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    i64::try_from(now.as_nanos()).unwrap()
}

/// Lets the link be as it is for a while and tells when that was.
pub fn during(time: Duration) -> Window {
    let from = now_nanos();
    std::thread::sleep(time);
    Window {
        from,
        until: now_nanos(),
    }
}

/// Runs it over Zenoh with routers of `python`, or over DDS without; `None` where this computer has no
/// network namespaces.
pub fn run(python: Option<&PathBuf>, times: Times) -> Option<Figures> {
    let mut network = Network::of(&HOSTS, 63, 20_261_122)?;
    if let Some(python) = python {
        network.over_zenoh(python);
    }
    network.links(Link::even(FREE));
    let scenario = Scenario::copy_of("short_cell");
    let often = "background_rate_hz: 1000.0";
    scenario.replace("fake_cnc.yaml", "background_rate_hz: 10.0", often);
    let into = scenario.path("bag");
    let bag = ["-p".to_owned(), format!("bag:={}", into.display())];
    let mut nodes = vec![network.node("archive", "recorder", &bag)];
    let of_file = |host: &str, node: &str| {
        let file = scenario.argument(&format!("{node}.yaml"));
        network.node(host, node, &["--params-file".to_owned(), file])
    };
    for node in ["axis_compensation", "latency_calibrator", "thermal_model"] {
        nodes.push(of_file("models", node));
    }
    nodes.push(of_file("controller", "fake_cnc"));
    std::thread::sleep(MEETING);

    let before = Use::of(nodes.iter().map(Process::id));
    let free = during(times.free);
    let used = Use::of(nodes.iter().map(Process::id)).since(&before, times.free);
    network.links(Link::even(LOSSY));
    let lossy = during(times.lossy);
    std::thread::sleep(TAIL);
    network.cut("archive", true);
    let cut = during(times.cut);
    network.cut("archive", false);
    std::thread::sleep(times.after);
    // The recorder leaves last: what the others say at their end is recorded too.
    for node in nodes.into_iter().rev() {
        node.stop();
    }
    Some(Figures::of(&into, [free, lossy, cut], used))
}
