//! Figures that are kept in a history, and pages as PDF: of a table of an instrument.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use abbe_tests::chromium;
use abbe_tests::program::{Ended, Process, command, root};
use abbe_tests::scenario::Scenario;
use nix::sys::signal::Signal;
use serde_json::Value;

/// Width and height of A4, points.
const A4_PT: [f64; 2] = [595.28, 841.89];

fn table(ending: &str) -> PathBuf {
    root()
        .join("tests/import")
        .join(format!("positioning.{ending}"))
}

fn ran(arguments: &[&str], more: &[(&str, &Path)]) -> Ended {
    let mut program = command(0, arguments);
    for (option, path) in more {
        program.arg(option).arg(path);
    }
    Process::start(program).ended_within(Duration::from_secs(120))
}

fn report(arguments: &[&str], more: &[(&str, &Path)]) -> Ended {
    let csv = table("csv");
    let first = ["report", csv.to_str().unwrap()];
    let map = table("yaml");
    let more: Vec<(&str, &Path)> = [("--map", map.as_path())]
        .into_iter()
        .chain(more.iter().copied())
        .collect();
    ran(&[&first[..], arguments].concat(), &more)
}

fn json(ended: &Ended) -> Value {
    let begin = ended
        .said
        .find('{')
        .unwrap_or_else(|| panic!("{}", ended.said));
    let mut values = serde_json::Deserializer::from_str(&ended.said[begin..]).into_iter();
    values.next().unwrap().unwrap()
}

#[test]
fn scenario_a_report_is_kept_once_and_its_history_shows_its_figures() {
    let home = tempfile::tempdir().unwrap();
    let store = home.path().join("history.sqlite");
    let keep = ["--keep", "--kept-as", "mill_1"];
    let first = report(&keep, &[("--store", store.as_path())]);
    assert_eq!(first.status.code(), Some(0), "{}", first.said);
    assert!(
        first.said.contains("figures of a report of mill_1"),
        "{}",
        first.said
    );
    let again = report(&keep, &[("--store", store.as_path())]);
    assert_eq!(again.status.code(), Some(0), "{}", again.said);
    assert!(
        again.said.contains("already, nothing was added"),
        "{}",
        again.said
    );
    let shown = ran(
        &["history", "mill_1", "--json"],
        &[("--store", store.as_path())],
    );
    assert_eq!(shown.status.code(), Some(0), "{}", shown.said);
    let json = json(&shown);
    let figures = json["figures"].as_array().unwrap();
    let accuracy = figures
        .iter()
        .find(|it| it["figure"].as_str().unwrap().ends_with("accuracy"));
    let accuracy = accuracy.unwrap_or_else(|| panic!("{json}"));
    assert_eq!(
        (&accuracy["values"], &accuracy["unit"]),
        (&1.into(), &"mm".into())
    );
    let unknown = ran(&["history", "mill_2"], &[("--store", store.as_path())]);
    assert_eq!(unknown.status.code(), Some(1), "{}", unknown.said);
    assert!(
        unknown.said.contains("no such machine, but mill_1"),
        "{}",
        unknown.said
    );
}

#[test]
fn scenario_a_report_without_a_machine_is_not_kept_and_nothing_is_made_without_keep() {
    let home = tempfile::tempdir().unwrap();
    let store = home.path().join("history.sqlite");
    let nameless = report(&["--keep"], &[("--store", store.as_path())]);
    assert_eq!(nameless.status.code(), Some(1), "{}", nameless.said);
    assert!(nameless.said.contains("--kept-as"), "{}", nameless.said);
    // The table alone has no date: it is asked for, and 1970 is none.
    let csv = table("csv");
    let undated = ["report", csv.to_str().unwrap(), "--keep", "--kept-as", "m"];
    let refused = ran(&undated, &[("--store", store.as_path())]);
    assert_eq!(refused.status.code(), Some(1), "{}", refused.said);
    assert!(refused.said.contains("--kept-at"), "{}", refused.said);
    let plain = report(&[], &[]);
    assert_eq!(plain.status.code(), Some(0), "{}", plain.said);
    assert!(!store.exists());
    let absent = ran(&["history"], &[("--store", store.as_path())]);
    assert_eq!(absent.status.code(), Some(1), "{}", absent.said);
    assert!(absent.said.contains("is not there"), "{}", absent.said);
}

#[test]
fn scenario_a_plan_whose_bag_holds_nothing_is_not_kept_and_that_is_no_failed_plan() {
    let home = tempfile::tempdir().unwrap();
    let store = home.path().join("history.sqlite");
    let scenario = Scenario::copy_of("cold_reference");
    // One that leaves out everything at once is refused.
    let all: Vec<String> = ('a'..='z')
        .map(|letter| format!("\"/{letter}*\""))
        .collect();
    let recording = format!("recording: {{exclude: [{}]}}\n", all.join(", "));
    scenario.append("scenario.yaml", &recording);
    let keep = ["--keep", "--store", store.to_str().unwrap()];
    let ended = scenario.run_to_end(&keep);
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    let words = "--keep: the plan ran to its end, but its bag holds no message";
    assert!(ended.said.contains(words), "{}", ended.said);
    assert!(
        !ended.said.contains("did not run to its end"),
        "{}",
        ended.said
    );
    assert!(!store.exists());
}

#[test]
fn scenario_a_bag_keeps_its_own_date() {
    let home = tempfile::tempdir().unwrap();
    let store = home.path().join("history.sqlite");
    let bag = root().join("bags/cold_reference");
    let bag = bag.to_str().unwrap();
    let dated = |given: &[&str]| ran(given, &[("--store", store.as_path())]);
    for given in [
        &["report", bag, "--keep", "--kept-at", "2020-01-01"][..],
        &["history", "add", bag, "--at", "2020-01-01"],
    ] {
        let refused = dated(given);
        assert_eq!(refused.status.code(), Some(1), "{}", refused.said);
        for words in ["2020-01-01T00:00:00Z", "has a time of its own, 2026-01-05T"] {
            assert!(refused.said.contains(words), "{}", refused.said);
        }
    }
}

#[test]
fn scenario_five_diagnoses_show_the_trend_of_an_effect_and_when_its_limit_is_reached() {
    let home = tempfile::tempdir().unwrap();
    let store = home.path().join("history.sqlite");
    for (month, width_um) in [(1, 5.0), (2, 6.1), (3, 6.9), (4, 8.0), (5, 9.1)] {
        let gap = serde_json::json!({
            "schema": "abbe.gap/1", "inputs": {"bags": [], "machine_sha256": ""},
            "gap": {"rms_um": width_um, "p95_um": 9.0, "floor_um": 1.0}, "shrink": {},
            "causes": [{"effect": "backlash", "axis": "X", "status": "named", "parameters":
                [{"name": "width_um", "value": width_um, "low": width_um - 0.4, "high": width_um + 0.4}]}],
        });
        let path = home.path().join(format!("gap_{month}.json"));
        std::fs::write(&path, gap.to_string()).unwrap();
        let at = format!("2026-0{month}-01");
        let given = [
            "history",
            "add",
            path.to_str().unwrap(),
            "--machine",
            "mill_1",
            "--at",
            &at,
        ];
        let added = ran(&given, &[("--store", store.as_path())]);
        assert_eq!(added.status.code(), Some(0), "{}", added.said);
    }
    let asked = [
        "history", "mill_1", "--effect", "backlash", "--axis", "X", "--upper", "12",
    ];
    let page = home.path().join("history.html");
    let text = ran(
        &asked,
        &[("--store", store.as_path()), ("--html", page.as_path())],
    );
    assert_eq!(text.status.code(), Some(0), "{}", text.said);
    assert!(
        text.said
            .contains("The upper limit of 12 µm is expected on 2026-0"),
        "{}",
        text.said
    );
    assert!(std::fs::read_to_string(&page).unwrap().contains("<svg"));
    let json = json(&ran(
        &[&asked[..], &["--json"]].concat(),
        &[("--store", store.as_path())],
    ));
    let series = &json["series"][0];
    assert_eq!(series["values"].as_array().unwrap().len(), 5);
    assert_eq!(series["limits"][0]["verdict"], "expected", "{json}");
    // 4.1 µm in 120 days.
    let slope = series["trend"]["slope_per_year"].as_f64().unwrap();
    assert!((slope - 12.4).abs() < 1.0, "{slope}");
}

#[test]
fn scenario_a_page_is_printed_as_a_pdf_of_a4_sheets() {
    if !chromium::is_there("a PDF of abbe report") {
        return;
    }
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("report.pdf");
    let printed = report(&[], &[("--pdf", path.as_path())]);
    assert_eq!(printed.status.code(), Some(0), "{}", printed.said);
    let pdf = std::fs::read(&path).unwrap();
    assert!(pdf.starts_with(b"%PDF-"));
    let text = String::from_utf8_lossy(&pdf);
    let sheets = text.matches("/Type /Page\n").count();
    let boxes: Vec<&str> = text.split("/MediaBox [").skip(1).collect();
    assert!(sheets >= 1 && !boxes.is_empty(), "{sheets} sheets");
    for one in boxes {
        let numbers = one.split(']').next().unwrap().split_whitespace();
        let numbers: Vec<f64> = numbers.map(|it| it.parse().unwrap()).collect();
        assert!((numbers[2] - A4_PT[0]).abs() < 1.0, "{numbers:?}");
        assert!((numbers[3] - A4_PT[1]).abs() < 1.0, "{numbers:?}");
    }
    // Nothing of it stays beside the file.
    let left: Vec<_> = std::fs::read_dir(home.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
}

#[test]
fn scenario_without_chromium_a_pdf_is_refused_with_the_remedy() {
    let home = tempfile::tempdir().unwrap();
    let csv = table("csv");
    let mut program = command(0, &["report", csv.to_str().unwrap()]);
    program.arg("--map").arg(table("yaml"));
    program.arg("--pdf").arg(home.path().join("report.pdf"));
    program.env("PATH", home.path());
    let ended = Process::start(program).ended_within(Duration::from_secs(120));
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    assert!(
        ended
            .said
            .contains("install one (Debian: `apt install chromium`)"),
        "{}",
        ended.said
    );
}

/// Ends by a signal while the browser prints: neither it nor its folder stays.
#[test]
fn scenario_a_pdf_that_is_called_off_leaves_no_folder_and_no_browser() {
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP] {
        let home = tempfile::tempdir().unwrap();
        let (programs, temporary) = (home.path().join("bin"), home.path().join("tmp"));
        for folder in [&programs, &temporary] {
            std::fs::create_dir(folder).unwrap();
        }
        let browser = programs.join("chromium");
        let (began, ended) = (home.path().join("began"), home.path().join("ended"));
        // It writes its profile again and again, for ten minutes.
        let script = format!(
            "#!/bin/sh\nfor a in \"$@\"; do case $a in --user-data-dir=*) p=${{a#*=}};; esac; done\necho $$ > {}\nfor i in $(seq 6000); do mkdir -p \"$p\"; echo x > \"$p/$i\"; sleep 0.1; done\n: > {}\n",
            began.display(),
            ended.display()
        );
        std::fs::write(&browser, script).unwrap();
        std::fs::set_permissions(&browser, Permissions::from_mode(0o755)).unwrap();
        let csv = table("csv");
        let mut program = command(0, &["report", csv.to_str().unwrap()]);
        program.arg("--map").arg(table("yaml"));
        program.arg("--pdf").arg(home.path().join("report.pdf"));
        let path = std::env::var("PATH").unwrap_or_default();
        program.env("PATH", format!("{}:{path}", programs.display()));
        program.env("TMPDIR", &temporary);
        let printing = Process::start(program);
        let is_begun = || std::fs::metadata(&began).is_ok_and(|file| file.len() > 0);
        let deadline = Instant::now() + Duration::from_secs(120);
        while !is_begun() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(is_begun(), "the browser was not started");
        printing.signal(signal);
        let stopped = printing.ended_within(Duration::from_secs(30));
        assert_eq!(
            stopped.status.code(),
            Some(130),
            "{signal}: {}",
            stopped.said
        );
        let deadline = Instant::now() + Duration::from_secs(60);
        let number = std::fs::read_to_string(&began).unwrap();
        let process = Path::new("/proc").join(number.trim()).join("cmdline");
        let runs = || std::fs::read(&process).is_ok_and(|words| !words.is_empty());
        while runs() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(!runs() && !ended.exists(), "{signal}: the browser goes on");
        let left: Vec<_> = std::fs::read_dir(&temporary).unwrap().collect();
        assert!(left.is_empty(), "{signal}: {left:?}");
    }
}

/// A table of one axis over `targets_mm`, three runs up and down.
fn stops(targets_mm: &[f64]) -> String {
    let mut text = "run,direction,target_mm,deviation_um\n".to_owned();
    for run in 1..=3 {
        for (way, sign) in [("up", 0.0), ("down", 3.0)] {
            let mut targets = targets_mm.to_vec();
            if way == "down" {
                targets.reverse();
            }
            for target in targets {
                let deviation = 0.02 * target + sign + 0.1 * f64::from(run);
                text.push_str(&format!("{run},{way},{target},{deviation}\n"));
            }
        }
    }
    text
}

#[test]
fn scenario_tests_of_another_travel_are_another_series_and_a_report_is_known_by_its_table() {
    let home = tempfile::tempdir().unwrap();
    let store = home.path().join("history.sqlite");
    let table = |name: &str, targets_mm: &[f64]| {
        let path = home.path().join(name);
        std::fs::write(&path, stops(targets_mm)).unwrap();
        path
    };
    let long = table("long.csv", &[0.0, 50.0, 100.0, 150.0, 200.0, 250.0]);
    let short = table("short.csv", &[0.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
    for (path, date) in [(&long, "2026-01-05"), (&short, "2026-02-05")] {
        let path = path.to_str().unwrap();
        let keep = [
            "report",
            path,
            "--keep",
            "--kept-as",
            "m1",
            "--kept-at",
            date,
        ];
        let kept = ran(&keep, &[("--store", store.as_path())]);
        assert_eq!(kept.status.code(), Some(0), "{}", kept.said);
    }
    let shown = ran(
        &["history", "m1", "--json"],
        &[("--store", store.as_path())],
    );
    let figures = json(&shown);
    let figures = figures["figures"].as_array().unwrap();
    let of_accuracy = figures
        .iter()
        .filter(|it| it["figure"] == "iso230_2.accuracy");
    let tests: Vec<&str> = of_accuracy.map(|it| it["test"].as_str().unwrap()).collect();
    assert_eq!(tests.len(), 2, "{tests:?}");
    for range in ["0 to 250 mm", "0 to 50 mm"] {
        assert!(tests.iter().any(|test| test.contains(range)), "{tests:?}");
    }
    let report = ran(&["report", long.to_str().unwrap(), "--json"], &[]);
    let path = home.path().join("long.json");
    std::fs::write(&path, json(&report).to_string()).unwrap();
    let add = ["history", "add", path.to_str().unwrap(), "--machine", "m1"];
    let again = [&add[..], &["--at", "2026-01-05"]].concat();
    let again = ran(&again, &[("--store", store.as_path())]);
    assert_eq!(again.status.code(), Some(0), "{}", again.said);
    assert!(
        again.said.contains("already, nothing was added"),
        "{}",
        again.said
    );
}
