//! Hosts whose computers' clocks differ, by up to a minute and a half: that is no matter to routers and sessions, which say
//! nothing of it; nothing is lost at 1 kHz, who comes late gets what is latched, and a cut link carries again as ever.

use std::path::PathBuf;
use std::time::Duration;

use abbe_msgs::topics;
use abbe_tests::computer_clock::{ClockError, Faketime};
use abbe_tests::drift;
use abbe_tests::hosts::network::Network;
use abbe_tests::hosts::site::{Site, file_of, parameter};
use abbe_tests::hosts::switch::{Link, Way};
use abbe_tests::hosts::{bag, clocks};
use abbe_tests::scenario::Scenario;
use metrology::stamp::Span;

use crate::cell::during;
use crate::cuts;
use crate::figures::Window;

const HOSTS: [&str; 4] = ["controller", "models", "desk", "archive"];
/// Of both links of a way together: 5 ms, up to 1 ms of jitter.
const WAY: Way = Way {
    delay_s: 2.5e-3,
    jitter_s: 0.5e-3,
    loss: 0.0,
    reorder: 0.0,
};
/// What a host's clock may be off by, s: a tenth of the way. Routers hold questions up as they do samples, unlike each way on a
/// busy computer; how well clocks can be found is judged over DDS (tests/hosts).
const LIMIT_S: f64 = 0.5e-3;
/// The clocks are judged by their maps of the end.
const JUDGED: Span = Span::from_nanos(4_000_000_000);
/// Until everybody has met and the controller has all of the compensation.
const MEETING: Duration = Duration::from_secs(8);
const FREE: Duration = Duration::from_secs(6);
/// Longer than the routers' lease, and shorter than what a deep topic keeps.
const CUT: Duration = Duration::from_secs(6);
const AFTER: Duration = Duration::from_secs(4);
/// In which who comes late gets what is latched, and the clocks are found again.
const LATE: Duration = Duration::from_secs(8);
/// More than this is said at 1 kHz in all.
const SAID: usize = 15_000;
/// Lines in which a router or the nodes of a host may complain, of a cut for the most part.
const COMPLAINTS: usize = 20;

/// What there is of a run: bags, the cut with the time after it, and each who spoke with his lines.
struct Run {
    at_controller: PathBuf,
    at_archive: PathBuf,
    late: PathBuf,
    windows: [(Window, Window); 1],
    said: Vec<(String, Vec<String>)>,
}

/// Runs it over Zenoh; `None` where this computer has no network namespaces or no libfaketime, else whether it was as wanted.
pub fn are_no_matter(recovery_s: f64, python: &PathBuf) -> Option<bool> {
    let faketime = Faketime::found("hosts over Zenoh whose computers' clocks differ")?;
    let mut network = Network::of(&HOSTS, 65, 20_261_126)?;
    let errors = [
        ("models", ClockError::of(90.0, 40e-6)),
        ("desk", ClockError::of(0.35, 10e-6)),
        ("archive", ClockError::of(-1.2, -25e-6)),
    ];
    for (host, error) in errors {
        network.computer_clock(host, error, &faketime);
    }
    network.over_zenoh(python);
    network.links(Link::even(WAY));
    let scenario = drift::scenario();
    let mut run = run(&network, &scenario);
    for (host, lines) in network.end_routers() {
        run.said.push((format!("router of {host}"), lines));
    }
    let is_well = judge(&run, recovery_s);
    for (host, error) in errors {
        clocks::is_found(&run.at_archive, host, error, 0.0, (LIMIT_S, JUDGED));
    }
    Some(is_well)
}

/// Starts the cell, cuts models and archive off for a while, and lets a recorder come late.
fn run(network: &Network, scenario: &Scenario) -> Run {
    let [at_controller, at_archive, late] =
        ["controller", "archive", "late"].map(|name| scenario.path(&format!("at_{name}")));
    let record = |into: &PathBuf, host: &str| {
        let mut words = parameter("bag", &into.display().to_string()).to_vec();
        words.extend(["-r".to_owned(), format!("__node:=recorder_of_{host}")]);
        words
    };
    let [mut controller, mut models, mut desk, mut archive] =
        HOSTS.map(|host| Site::new(network, host, None));
    controller.start("recorder", record(&at_controller, "controller"));
    archive.start("recorder", record(&at_archive, "archive"));
    controller.start("fake_cnc", file_of(scenario, "fake_cnc"));
    models.start("axis_compensation", file_of(scenario, "axis_compensation"));
    desk.start_program(env!("CARGO_BIN_EXE_drift_teller"), vec![]);
    std::thread::sleep(MEETING + FREE);
    for host in ["models", "archive"] {
        network.cut(host, true);
    }
    let cut = during(CUT);
    for host in ["models", "archive"] {
        network.cut(host, false);
    }
    let windows = [(cut, during(AFTER))];
    models.start("recorder", record(&late, "models"));
    std::thread::sleep(LATE);
    let sites = [
        ("archive", archive),
        ("desk", desk),
        ("models", models),
        ("controller", controller),
    ];
    let said = sites.map(|(host, site)| {
        let lines = site.stop().lines().map(str::to_owned).collect();
        (format!("nodes of {host}"), lines)
    });
    Run {
        at_controller,
        at_archive,
        late,
        windows,
        said: said.into(),
    }
}

/// Tells what was seen, and whether it was as wanted.
fn judge(run: &Run, recovery_s: f64) -> bool {
    let seen = cuts::seen(&run.at_controller, &run.at_archive, &run.windows);
    let mut is_well = cuts::judge(&seen, recovery_s);
    for topic in [topics::AXES_STATE.name, topics::COMPENSATION.name] {
        let (there, missing) = bag::missing(&run.at_archive, topic);
        let lost = missing.len();
        eprintln!("  {topic}: {there} at the archive, {lost} missing");
        is_well &= there > SAID && lost == 0;
    }
    let latched = bag::messages(&run.late, &topics::THERMAL_MODEL).len();
    eprintln!("  the model that was said once reached who came late {latched} times");
    is_well &= latched == 1;
    for (who, lines) in &run.said {
        is_well &= are_few(who, lines);
    }
    is_well
}

/// Counts the lines in which somebody complains.
fn are_few(who: &str, lines: &[String]) -> bool {
    let complaints = lines.iter().filter(|line| line.contains("ERROR"));
    eprintln!("  {who}: {} errors", complaints.clone().count());
    for line in complaints.clone().take(3) {
        eprintln!("    {line}");
    }
    complaints.count() <= COMPLAINTS
}
