//! Odd times in maps, tables and scenarios: those of 1970 to 2106 are taken everywhere, across 2038 too, and others are
//! refused by name, value, range and the unit that they look like.

use std::path::{Path, PathBuf};
use std::process::Output;

use abbe_tests::program::command;
use abbe_tests::scenario::Scenario;

fn said(output: &Output) -> String {
    let texts = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    texts.concat()
}

fn abbe(arguments: &[&str]) -> (Option<i32>, String) {
    let output = command(0, arguments).output().unwrap();
    (output.status.code(), said(&output))
}

const MACHINE: &str = "launch_configs/gap_first/machine.yaml";

/// Imports a table under a map; exit code, what was said, and the bag.
fn import(home: &Path, csv: &str, map: &str) -> (Option<i32>, String, PathBuf) {
    let (table, map_file, bag) = (home.join("t.csv"), home.join("map.yaml"), home.join("bag"));
    std::fs::write(&table, csv).unwrap();
    std::fs::write(&map_file, map).unwrap();
    let _ = std::fs::remove_dir_all(&bag);
    let paths = [&table, &map_file, &bag].map(|path| path.display().to_string());
    let [table, map_file, out] = &paths;
    let (code, said) = abbe(&[
        "import",
        table,
        "--map",
        map_file,
        "--machine",
        MACHINE,
        "-o",
        out,
    ]);
    (code, said, bag)
}

fn positioning(start_s: &str) -> String {
    format!(
        "start_s: {start_s}\nat_mm: {{Y: 0.0, Z: 120.0}}\ntest:\n  positioning: {{axis: X, feed_mm_min: 6000.0, dwell_s: 2.0, overrun_mm: 5.0, run: run, target_mm: t, deviation_um: d}}\n"
    )
}

/// Three runs up and down over eleven stops, with a scale of 4 um/m and 5 um of backlash.
fn stops() -> String {
    let mut text = "run,t,d\n".to_owned();
    for run in 1..=3_i32 {
        let up = (-5..=5_i32).map(|k| (k, -2.5));
        let down = (-5..=5_i32).rev().map(|k| (k, 2.5));
        for (k, backlash_um) in up.chain(down) {
            let at_mm = 50.0 * f64::from(k);
            let noise_um = 0.1 * f64::from((k * 7 + run * 3_i32).rem_euclid(5) - 2);
            let deviation_um = 4e-3 * at_mm + backlash_um + noise_um;
            text.push_str(&format!("{run},{at_mm},{deviation_um:.2}\n"));
        }
    }
    text
}

const RANGE: &str = "must be from 0 to ";

#[test]
fn a_begin_of_a_measurement_is_checked_where_it_comes_in() {
    let home = tempfile::tempdir().unwrap();
    let looks = |unit: &str| format!("; it looks like {unit}: write 1767600000");
    for (start_s, remedy) in [
        ("-1", String::new()),
        ("1767600000000", looks("milliseconds")),
        ("1767600000000000", looks("microseconds")),
        ("1767600000000000000", looks("nanoseconds")),
        (
            "1000000000000",
            "; it looks like milliseconds: write 1000000000".to_owned(),
        ),
        ("4294967295", String::new()),
        ("9223372036854775807", String::new()),
        ("-9223372036854775808", String::new()),
    ] {
        let (code, said, bag) = import(home.path(), &stops(), &positioning(start_s));
        assert_eq!(code, Some(1), "{start_s}: {said}");
        assert!(
            said.contains("start_s = ") && said.contains(RANGE),
            "{start_s}: {said}"
        );
        assert!(said.contains(&remedy), "{start_s}: {said}");
        assert!(!bag.exists(), "{start_s}");
    }
    for start_s in ["NaN", "1e300", "2026-01-05"] {
        let (code, said, _) = import(home.path(), &stops(), &positioning(start_s));
        assert!(
            code == Some(1) && said.contains("start_s"),
            "{start_s}: {said}"
        );
    }
}

#[test]
fn bags_from_1970_to_2106_and_across_2038_are_written_read_reported_and_diagnosed() {
    let home = tempfile::tempdir().unwrap();
    // Across 2038 in the midst of the second run.
    for start_s in ["0", "2147483570", "4000000000", "4263000000"] {
        let (code, said, bag) = import(home.path(), &stops(), &positioning(start_s));
        assert_eq!(code, Some(0), "{start_s}: {said}");
        let bag = bag.display().to_string();
        let page = home
            .path()
            .join(format!("page_{start_s}"))
            .display()
            .to_string();
        let (code, report) = abbe(&["report", &bag, "--out", &page]);
        assert_eq!(code, Some(0), "{start_s}: {report}");
        assert!(
            report.contains("positioning") || report.contains("Positioning"),
            "{report}"
        );
        let (code, diagnosis) = abbe(&["diagnose", &bag, "--machine", MACHINE]);
        assert_eq!(code, Some(0), "{start_s}: {diagnosis}");
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "one case after another")]
fn times_of_a_table_are_seconds_that_go_on() {
    let home = tempfile::tempdir().unwrap();
    let map = "start_s: 1767600000\nat_mm: {X: 0.0, Y: 0.0, Z: 100.0}\ntest:\n  log: {axis: Z, time_s: time, displacement_um: z}\n";
    let table = |times: &[f64]| {
        let rows = times.iter().map(|time| format!("{time},1.0\n"));
        format!("time,z\n{}", rows.collect::<String>())
    };
    let even = |scale: f64| {
        (0..40)
            .map(|k| (1_767_600_000.0 + 60.0 * f64::from(k)) * scale)
            .collect::<Vec<_>>()
    };
    let since = |scale: f64| {
        (0..40)
            .map(|k| 60.0 * f64::from(k) * scale)
            .collect::<Vec<_>>()
    };
    let mut back = since(1.0);
    back[20] -= 3600.0;
    let mut leap = since(1.0);
    leap[39] = 9e8;
    let mut one = since(1.0);
    one[20] = 1.7676e12;
    let divide =
        |unit: &str, scale: &str| format!("it looks like {unit}: divide the column by {scale}");
    for (what, times, words) in [
        ("seconds", since(1.0), String::new()),
        ("seconds since 1970", even(1.0), String::new()),
        (
            "a night",
            vec![0.0, 60.0, 120.0, 40_000.0, 40_060.0],
            String::new(),
        ),
        (
            "a step of a day",
            vec![0.0, 60.0, 86_460.0, 86_520.0],
            String::new(),
        ),
        ("milliseconds", since(1e3), divide("milliseconds", "1000")),
        (
            "microseconds",
            since(1e6),
            divide("microseconds", "1000000"),
        ),
        (
            "nanoseconds",
            since(1e9),
            "the column is in seconds: divide it where its unit is another".to_owned(),
        ),
        ("ms since 1970", even(1e3), divide("milliseconds", "1000")),
        (
            "us since 1970",
            even(1e6),
            divide("microseconds", "1000000"),
        ),
        (
            "ns since 1970",
            even(1e9),
            divide("nanoseconds", "1000000000"),
        ),
        ("an hour back", back, "line 22: time -2400 s".to_owned()),
        (
            "2054",
            leap,
            "the greatest leap is at row 40, from 2280 to 900000000 s".to_owned(),
        ),
        (
            "one in ms",
            one,
            "line 22, column \"time\": 1767600000000: must be from".to_owned(),
        ),
        (
            "NaN",
            vec![0.0, f64::NAN, 120.0],
            "line 3, column \"time\": \"NaN\": must be a number".to_owned(),
        ),
    ] {
        let (code, said, bag) = import(home.path(), &table(&times), map);
        if words.is_empty() {
            assert_eq!(code, Some(0), "{what}: {said}");
            continue;
        }
        assert_eq!(code, Some(1), "{what}: {said}");
        assert!(said.contains(&words), "{what}: {said}");
        assert!(!bag.exists(), "{what}");
    }
}

#[test]
fn a_run_begins_in_1970_to_2106_and_is_checked_across_2038() {
    for (start_s, words) in [
        (
            "1767600000000",
            "simulated_start_s = 1767600000000: must be from 0 to ",
        ),
        (
            "1767600000000",
            "it looks like milliseconds: write 1767600000",
        ),
        ("-5", "simulated_start_s = -5: must be from 0 to "),
        (
            "4294967295",
            "simulated_start_s = 4294967295: must be from 0 to ",
        ),
        ("9223372036854775807", "simulated_start_s = "),
    ] {
        let scenario = started(start_s);
        let ended = scenario.run_to_end(&[]);
        assert_eq!(ended.status.code(), Some(1), "{start_s}: {}", ended.said);
        assert!(ended.said.contains(words), "{start_s}: {}", ended.said);
    }
    for start_s in ["0", "2147483640", "4200000000"] {
        let scenario = started(start_s);
        let store = scenario.argument("history.sqlite");
        let ended = scenario.run_to_end(&["--keep", "--store", &store]);
        assert_eq!(ended.status.code(), Some(0), "{start_s}: {}", ended.said);
        let is_kept = ended.said.contains("figures of a report of");
        assert!(is_kept, "{start_s}: {}", ended.said);
        let run = scenario.new_run(&[]);
        let [bag, page] = ["bag", "page"].map(|name| run.join(name).display().to_string());
        for verb in ["check", "report"] {
            let mut arguments = vec![verb, bag.as_str()];
            if verb == "report" {
                arguments.extend(["--out", page.as_str()]);
            }
            let (code, said) = abbe(&arguments);
            assert_eq!(code, Some(0), "{verb} of {start_s}: {said}");
        }
    }
}

/// The cold reference, begun at another time.
fn started(start_s: &str) -> Scenario {
    let scenario = Scenario::copy_of("cold_reference");
    let text = std::fs::read_to_string(scenario.path("scenario.yaml")).unwrap();
    let line = text
        .lines()
        .find(|line| line.starts_with("simulated_start_s:"))
        .unwrap();
    scenario.replace(
        "scenario.yaml",
        line,
        &format!("simulated_start_s: {start_s}"),
    );
    scenario
}
