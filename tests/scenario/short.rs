//! What `run`, `report`, `diagnose` and `preflight` print without `--full`: at most 40 lines, the answer first, what is left
//! last. With it they print all.

use std::process::Output;

use abbe_tests::program::{as_given, command};
use abbe_tests::scenario::Scenario;

/// Most lines of the short text.
const MOST_LINES: usize = 40;

fn printed(output: &Output) -> String {
    let complained = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}\n{complained}", output.status);
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// The short and the whole text of the same words.
fn both(words: &[&str]) -> [String; 2] {
    [as_given(0, words), command(0, words)].map(|mut command| printed(&command.output().unwrap()))
}

/// The short text is short, begins as it must and names the option for the rest; the first line of the answer is in the whole.
fn is_short(text: &str, begin: &str) {
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines.len() <= MOST_LINES, "{} lines: {text}", lines.len());
    assert!(lines[0].starts_with(begin), "{begin:?}: {text}");
    let last = lines[lines.len() - 1];
    assert!(last.contains("onditions and remarks: --full"), "{text}");
}

#[test]
fn reports_of_all_bags_take_forty_lines_and_have_every_part_with_full() {
    // The lines of the whole text, counted by `abbe report BAG --full | wc -l`.
    let bags = [
        (
            "cold_reference",
            38,
            "Drift of the readings, after ISO 230-3: greatest range 0.65 µm, at block_1 Y",
        ),
        (
            "dual_loop",
            22,
            "Positioning tables: scale minus motor: X: ",
        ),
        ("grid_circles", 202, "Geometric errors of the linear axes: "),
        (
            "host_clocks",
            38,
            "Drift of the readings, after ISO 230-3: greatest range 0.74 µm, at block_1 Z",
        ),
        (
            "lifecycle",
            9,
            "The bag holds no test that can be evaluated.",
        ),
        (
            "rosbag2_touches",
            10,
            "The bag holds no test that can be evaluated.",
        ),
        (
            "rotary_sphere",
            52,
            "Geometric errors of the rotary axes: All 8 coefficients are known by themselves.",
        ),
    ];
    for (bag, lines, begin) in bags {
        let [short, whole] = both(&["report", &format!("bags/{bag}")]);
        is_short(&short, begin);
        assert_eq!(whole.lines().count(), lines, "{bag}: {whole}");
        assert!(whole.contains("Conditions of the measurement"), "{whole}");
    }
    let [short, whole] = both(&["report", "bags/rotary_sphere"]);
    // Errors of shape are what the others come from; those are left for --full.
    assert!(short.contains(" EY0A "), "{short}");
    assert!(!short.contains("Conditions of the measurement"), "{short}");
    for title in [
        "Geometric errors of the rotary axes",
        "Shapes, ISO 230-10",
        "Probing errors of form and size, ISO 230-10",
    ] {
        assert!(whole.lines().any(|line| line == title), "{title}: {whole}");
    }
}

#[test]
fn diagnoses_take_forty_lines_and_explain_prints_all() {
    // Of the second no effect is named, so it has no causes to show.
    for (bag, lines, begin, table) in [
        (
            "cold_reference",
            137,
            "Where: machine and simulator differ by ",
            "Causes",
        ),
        (
            "host_clocks",
            109,
            "Where: no gap above the noise floor; ",
            "Gap and noise floor",
        ),
    ] {
        let bag = format!("bags/{bag}");
        let [short, whole] = both(&["diagnose", &bag]);
        is_short(&short, begin);
        assert!(short.contains("\nWhich: "), "{short}");
        assert!(short.contains("\nHow far: "), "{short}");
        assert!(short.lines().any(|line| line == table), "{short}");
        assert_eq!(whole.lines().count(), lines, "{whole}");
        for title in [
            table,
            "Effects that this recording could not show",
            "Effects that look alike in this recording",
            "Conditions of the measurement",
        ] {
            assert!(whole.lines().any(|line| line == title), "{title}: {whole}");
        }
    }
    let mut explain = as_given(0, &["diagnose", "bags/cold_reference", "--explain"]);
    let explained = printed(&explain.output().unwrap());
    for title in ["Why each cause has its status", "Where the gap lies"] {
        assert!(explained.contains(title), "{title}: {explained}");
    }
}

#[test]
fn a_preflight_takes_forty_lines() {
    let geometry = "What the recordings over the plate determine: Chain ";
    for (scenario, lines) in [("first_run", 103), ("gap_first", 159), ("grid_xy", 141)] {
        let [short, whole] = both(&["preflight", &format!("launch_configs/{scenario}")]);
        is_short(&short, "");
        let first = short.lines().next().unwrap();
        assert!(first.contains(" runs in "), "{short}");
        assert!(short.contains("\nWhat would be found\n"), "{short}");
        assert_eq!(short.contains(geometry), scenario != "first_run", "{short}");
        assert_eq!(whole.lines().count(), lines, "{whole}");
        // Its machine has no thermometer.
        let warms = whole.contains("\nTemperatures that are assumed\n");
        assert_eq!(warms, scenario != "grid_xy", "{whole}");
    }
}

#[test]
fn a_run_takes_forty_lines_with_the_place_of_bag_and_page_at_the_end() {
    let scenario = Scenario::copy_of("cold_reference");
    let (folder, runs) = (scenario.folder(), scenario.out());
    let words = [
        "run",
        "--no-dds",
        &folder.display().to_string(),
        "--runs",
        &runs.display().to_string(),
    ];
    let [short, whole] = both(&words);
    is_short(&short, "Probe latency ");
    let lines: Vec<&str> = short.lines().collect();
    let bag = lines[lines.len() - 2];
    assert!(bag.starts_with("Bag:  "), "{short}");
    assert!(lines[lines.len() - 1].ends_with("/report.html"), "{short}");
    assert!(whole.starts_with("scenario: "), "{whole}");
    let last = whole.lines().last().unwrap();
    assert!(last.starts_with("Page: "), "{whole}");
    assert!(last.ends_with("/report.html"), "{whole}");
}
