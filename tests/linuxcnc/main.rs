//! The LinuxCNC scenarios as a person runs them, judged by their bags.
//!
//! The only truth is the delay in the scenario's HAL file, which nothing but LinuxCNC and this test
//! reads. Only one LinuxCNC runs on a computer: each test has namespaces of its own. Where LinuxCNC is not
//! installed nothing can be tested: that is a failure where `CI=true`, and is said elsewhere.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![expect(clippy::print_stdout, reason = "the figures seen are worth showing")]
#![expect(
    clippy::disallowed_methods,
    reason = "programs are run, files read, and CI is asked"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Wire, from_cdr};
use abbe_tests::foreseen::Foreseen;
use abbe_tests::namespace::isolated;
use linuxcnc_bridge::fault::QUEUE_FAULT;
use metrology::Axis;
use metrology::sample::{ProbedPoint, Rejection, TestKind, TestSegment};
use recorder::{Bag, Event, Order};
use serde_json::Value;

mod killed;
mod simulated;
mod strangers;

/// Free of everybody else's traffic.
const DOMAIN: &str = "87";
const TICK_S: f64 = 1e-3;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn installed() -> bool {
    let missing = ["linuxcnc", "halcmd", "halsampler"]
        .into_iter()
        .find(|program| !Path::new("/usr/bin").join(program).exists());
    let Some(program) = missing else {
        return true;
    };
    let on_ci = std::env::var("CI").is_ok_and(|value| value == "true");
    assert!(
        !on_ci,
        "{program} is not installed (package linuxcnc-uspace)"
    );
    eprintln!("NOT TESTED: {program} is not installed (package linuxcnc-uspace)");
    false
}

/// A finished run; its folder goes with it.
struct Finished {
    bag: Bag,
    said: String,
    report: Value,
    gap: Option<Value>,
    _folder: tempfile::TempDir,
}

/// LinuxCNC's interpreter sometimes finds its own queue not empty after a touch when the computer is
/// busy, and gives the program up. That is said, and the scenario is run again this often.
const ATTEMPTS: u32 = 3;

/// One run; `None` where LinuxCNC gave the program up as above.
fn attempted(program: &Path, scenario: &str, out: &Path) -> Option<String> {
    let output = Command::new(program)
        .current_dir(root())
        .args(["run", "--full", &format!("launch_configs/{scenario}")])
        .arg("--runs")
        .arg(out)
        .env("ROS_DOMAIN_ID", DOMAIN)
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .output()
        .unwrap();
    let complained = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() && complained.contains(QUEUE_FAULT) {
        println!("{scenario}: LinuxCNC: {QUEUE_FAULT}; once more");
        return None;
    }
    assert!(output.status.success(), "{}\n{complained}", output.status);
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Stops of 82 with which a table is still judged, its largest error left out.
const ENOUGH_STOPS: u64 = 78;

/// Runs a scenario to its end; `None` where LinuxCNC is not installed.
fn run(scenario: &str) -> Option<Finished> {
    if !installed() {
        return None;
    }
    let program = abbe_tests::program::abbe();
    let folder = tempfile::tempdir().unwrap();
    let said = (1..=ATTEMPTS)
        .find_map(|attempt| attempted(&program, scenario, &folder.path().join(attempt.to_string())))
        .expect("LinuxCNC refused to go on after probing at every attempt");
    println!("{said}");
    let attempt = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .max();
    let run = std::fs::read_dir(attempt.unwrap()).unwrap().next().unwrap();
    let run = run.unwrap().path();
    assert!(run.join("report.html").is_file());
    let shipped = root().join("launch_configs").join(scenario);
    Foreseen::begin(&shipped).agrees(&shipped, &run);
    let bag = Bag::open(run.join("bag")).unwrap();
    let report = std::fs::read_to_string(run.join("report.json")).unwrap();
    let gap = std::fs::read_to_string(run.join("gap.json")).ok();
    Some(Finished {
        bag,
        said,
        report: serde_json::from_str(&report).unwrap(),
        gap: gap.map(|text| serde_json::from_str(&text).unwrap()),
        _folder: folder,
    })
}

/// Every message of a topic with its place in the bag, which must be whole.
fn read<M: Message + Wire>(bag: &Bag, topic: &Topic<M>) -> Vec<(usize, M::Inner)> {
    let mut found = Vec::new();
    let mut messages = bag.messages(Order::LogTime);
    let mut place = 0;
    while let Some(event) = messages.next_event() {
        match event {
            Event::Message(message) => {
                let name = &bag.topic(message.topic).topic;
                if name.trim_start_matches('/') == topic.name {
                    let decoded: M = from_cdr(message.data).unwrap();
                    found.push((place, decoded.into_inner().unwrap()));
                }
                place += 1;
            }
            Event::Loss(loss) => panic!("{}: {loss:?}", topic.name),
        }
    }
    found
}

/// The number that a HAL file gives to a pin.
fn in_hal(scenario: &str, hal: &str, pin: &str) -> f64 {
    let path = root().join(format!("launch_configs/{scenario}/controller/{hal}"));
    let text = std::fs::read_to_string(path).unwrap();
    let setting = format!("setp {pin} ");
    let line = text
        .lines()
        .find(|line| line.starts_with(&setting))
        .unwrap();
    line.split_whitespace()
        .next_back()
        .unwrap()
        .parse()
        .unwrap()
}

/// Named causes of the run's diagnosis, and value with 95 % interval of one parameter of an effect among them.
fn named(finished: &Finished, effect: &str, parameter: &str) -> (Vec<String>, [f64; 3]) {
    let gap = finished.gap.as_ref().expect("the scenario is diagnosed");
    let causes = gap["causes"].as_array().unwrap();
    let causes: Vec<&Value> = causes.iter().filter(|c| c["status"] == "named").collect();
    let names = causes
        .iter()
        .map(|c| {
            format!(
                "{} {}",
                c["effect"].as_str().unwrap(),
                c["axis"].as_str().unwrap()
            )
        })
        .collect();
    println!(
        "named: {names:?}; held out: {}; unknown: {}",
        gap["shrink"], gap["unknown"]["flagged"]
    );
    let cause = causes.iter().find(|c| c["effect"] == effect);
    let cause = cause.unwrap_or_else(|| panic!("{effect} is not among {names:?}"));
    let parameters = cause["parameters"].as_array().unwrap();
    let found = parameters.iter().find(|p| p["name"] == parameter).unwrap();
    println!("{found}");
    (
        names,
        ["value", "low", "high"].map(|key| found[key].as_f64().unwrap()),
    )
}

/// Mean apparent latency of a delay made in the servo thread, s: whole ticks, the first of which
/// sees the contact, and half a tick until the contact is looked at.
fn expected_s(delay_s: f64) -> f64 {
    ((delay_s / TICK_S).ceil() - 1.0) * TICK_S + TICK_S / 2.0
}

/// Usable touches between the begin and the end of each latency run, in the order of runs.
fn latency_touches(bag: &Bag) -> Vec<Vec<ProbedPoint>> {
    let segments: Vec<TestSegment> = read(bag, &topics::TEST_SEGMENT)
        .into_iter()
        .map(|(_, segment)| segment)
        .filter(|segment| segment.kind == TestKind::Latency)
        .collect();
    let points: Vec<ProbedPoint> = read(bag, &topics::PROBE_POINT)
        .into_iter()
        .map(|(_, point)| point)
        .filter(|point| point.rejection == Rejection::None)
        .collect();
    let begins = segments.iter().filter(|segment| segment.begin);
    begins
        .map(|begin| {
            let end = segments
                .iter()
                .find(|segment| !segment.begin && segment.run == begin.run)
                .unwrap();
            let within = |point: &&ProbedPoint| (begin.at..=end.at).contains(&point.received_at);
            points.iter().filter(within).cloned().collect()
        })
        .collect()
}

/// Mean of the corrected surface along the approach, mm, by feed in mm/s.
fn by_feed(touches: &[ProbedPoint]) -> Vec<(f64, f64, usize)> {
    let mut groups: BTreeMap<i64, Vec<(f64, f64)>> = BTreeMap::new();
    for point in touches {
        let bin = point.feed_mm_s.round() as i64;
        let along_mm = point.point_in_machine_mm.dot(&point.approach);
        groups
            .entry(bin)
            .or_default()
            .push((point.feed_mm_s, along_mm));
    }
    groups
        .into_values()
        .map(|group| {
            let n = group.len() as f64;
            let feed_mm_s = group.iter().map(|(feed, _)| feed).sum::<f64>() / n;
            let along_mm = group.iter().map(|(_, along)| along).sum::<f64>() / n;
            (feed_mm_s, along_mm, group.len())
        })
        .collect()
}

#[test]
fn val_linuxcnc_the_latency_is_the_delay_that_only_hal_holds_and_corrected_points_agree() {
    isolated(|| {
        let Some(finished) = run("linuxcnc_latency") else {
            return;
        };
        let latencies = read(&finished.bag, &topics::LATENCY);
        let delay_s = in_hal("linuxcnc_latency", "latency.hal", "probe-latency.on-delay");
        let expected_s = expected_s(delay_s);
        assert_eq!(latencies.len(), 3, "one estimate for each run");
        for (_, latency) in &latencies {
            println!(
                "latency {:.4} ms, u {:.4} ms, in HAL {:.4} ms, with the tick's share {:.4} ms",
                latency.latency_s * 1e3,
                latency.standard_uncertainty_s * 1e3,
                delay_s * 1e3,
                expected_s * 1e3
            );
            assert_eq!(latency.n, 40, "{latency:?}");
            assert!(
                (latency.latency_s - expected_s).abs() < 0.1e-3,
                "{latency:?}"
            );
            assert!(
                (latency.latency_s - delay_s).abs() < 0.1e-3 + TICK_S / 2.0,
                "{latency:?}"
            );
        }
        let runs = latency_touches(&finished.bag);
        assert_eq!(runs.len(), 3);
        assert!(
            runs[0].is_empty(),
            "before the first estimate nothing is corrected"
        );
        for touches in &runs[1..] {
            assert_eq!(touches.len(), 40);
            let feeds = by_feed(touches);
            assert_eq!(feeds.len(), 5, "{feeds:?}");
            let (slow_mm_s, slow_mm, _) = feeds[0];
            for (feed_mm_s, along_mm, n) in &feeds {
                let away_mm = along_mm - slow_mm;
                println!(
                    "{:>6.0} mm/min: {n} touches, {:+.3} um from the slowest, a tick's travel {:.1} um",
                    feed_mm_s * 60.0,
                    away_mm * 1e3,
                    feed_mm_s * TICK_S * 1e3
                );
                assert_eq!(*n, 8);
                assert!(
                    away_mm.abs() <= (feed_mm_s + slow_mm_s) * TICK_S,
                    "{feeds:?}"
                );
            }
        }
        assert!(finished.said.contains("Probe latency"), "{}", finished.said);
        // The machine file of the scenario has no latency: the diagnosis of its bag finds it as a gap.
        let (names, [found_ms, low_ms, high_ms]) = named(&finished, "probe_latency", "latency_ms");
        assert_eq!(names.len(), 1, "{names:?}");
        assert!((found_ms - expected_s * 1e3).abs() < 0.1, "{found_ms}");
        assert!(low_ms < found_ms && found_ms < high_ms && high_ms - low_ms < 0.5);
    });
}

#[test]
fn val_linuxcnc_lost_motion_that_only_hal_holds_is_named_with_its_size_from_the_runs_own_bag() {
    isolated(|| {
        let Some(finished) = run("linuxcnc_gap") else {
            return;
        };
        let half_mm = in_hal("linuxcnc_gap", "effect.hal", "slide-greatest.x.offset");
        let width_um = 2e3 * half_mm;
        let (names, [found_um, low_um, high_um]) = named(&finished, "backlash", "width_um");
        assert_eq!(names, ["backlash X"]);
        assert!(
            low_um <= width_um && width_um <= high_um,
            "{low_um} to {high_um}, {width_um} in HAL"
        );
        assert!(low_um < found_um && found_um < high_um && high_um - low_um < 0.2);
        let gap = finished.gap.as_ref().unwrap();
        assert_eq!(gap["unknown"]["flagged"], false, "{}", gap["unknown"]);
        let closed = gap["shrink"]["gap_closed"]["low"].as_f64().unwrap();
        assert!(closed > 0.99, "{closed}");
    });
}

#[test]
fn val_linuxcnc_both_blocks_are_measured_twice_and_every_face_of_them() {
    isolated(|| {
        let Some(finished) = run("linuxcnc_block_cycle") else {
            return;
        };
        let blocks: Vec<_> = read(&finished.bag, &topics::BLOCKS_MEASUREMENT)
            .into_iter()
            .map(|(_, block)| block)
            .collect();
        let seen: Vec<(&str, bool)> = blocks
            .iter()
            .map(|block| (block.block_id.as_str(), block.cold))
            .collect();
        assert_eq!(
            seen,
            [
                ("block_1", true),
                ("block_2", true),
                ("block_1", false),
                ("block_2", false)
            ]
        );
        // Corners of the machine file are those of the HAL file: the simulated blocks stand true.
        let corners_mm = [[-220.0, -180.0, 20.0], [220.0, 180.0, 200.0]];
        for (place, block) in blocks.iter().enumerate() {
            for (axis, corner_mm) in Axis::LINEAR.into_iter().zip(corners_mm[place % 2]) {
                let face = block.faces[axis].expect("every face is measured");
                let away_um = (face.position_mm - corner_mm) * 1e3;
                println!(
                    "{} {axis}: {away_um:+.2} um from nominal, u {:.2} um",
                    block.block_id,
                    face.standard_uncertainty_mm * 1e3
                );
                // One touch at 2 mm/s on a control that polls: a tick's travel and the latency's 0.1 ms.
                assert!(away_um.abs() < 2.5, "{block:?}");
            }
        }
        let models = read(&finished.bag, &topics::THERMAL_MODEL);
        assert!(!models.is_empty(), "two block cycles make a model");
    });
}

#[test]
fn val_linuxcnc_the_table_of_a_run_takes_out_nine_tenths_of_the_screws_error_when_it_is_loaded() {
    isolated(|| {
        // On a busy computer the sampler loses records, and a stop with them: the table has a hole then.
        let mut finished = None;
        for attempt in 1..=ATTEMPTS {
            let Some(one) = run("linuxcnc_screw_error") else {
                return;
            };
            let runs = one.report["linuxcnc_table"].as_array().unwrap();
            let stops: Vec<u64> = runs
                .iter()
                .map(|run| run["stops"].as_u64().unwrap())
                .collect();
            let whole = stops == [82; 3];
            println!("attempt {attempt}: {stops:?} of 41 stops up and 41 down");
            let enough = stops.iter().all(|stops| *stops >= ENOUGH_STOPS);
            finished = Some((one.report, one.said, whole));
            if enough {
                break;
            }
        }
        let (report, said, whole) = finished.unwrap();
        let runs = report["linuxcnc_table"].as_array().unwrap();
        let of = |name: &str| runs.iter().find(|one| one["run"] == name).unwrap();
        let um = |name: &str, key: &str| of(name)[key].as_f64().unwrap() * 1e3;
        let (bare, with, turned) = ("without a table", "with the table", "with its sign turned");
        for name in [bare, with, turned] {
            println!(
                "{name}: at most {:.2} um, p95 {:.2} um, between the table's points {:.2} um, rms {:.3} um",
                um(name, "max_mm"),
                um(name, "p95_mm"),
                um(name, "p95_between_mm"),
                um(name, "rms_mm")
            );
        }
        assert!(
            um(bare, "max_mm") > 30.0,
            "the scenario has a screw with errors"
        );
        let judged = ["rms_mm", "p95_mm", "p95_between_mm", "max_mm"];
        for key in &judged[..if whole { 4 } else { 2 }] {
            assert!(um(with, key) < 0.1 * um(bare, key), "{key}");
        }
        let ratio = um(turned, "rms_mm") / um(bare, "rms_mm");
        assert!((1.9..2.1).contains(&ratio), "{ratio}");
        let title = "The exported table on the control itself";
        assert!(said.contains(title), "{said}");
    });
}
