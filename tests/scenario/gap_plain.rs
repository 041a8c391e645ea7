//! Tables without a machine file: one command, on a plain machine that the text states.

use std::path::Path;
use std::time::Duration;

use abbe_tests::program::{Ended, Process, command, root};
use tempfile::TempDir;

use crate::gap_import::shown;

const ASSUMED: &str = "warning, no machine file: a plain machine is assumed (";

fn diagnosed(arguments: &[&str]) -> Ended {
    let mut command = command(0, &[&["diagnose"], arguments].concat());
    command.current_dir(root());
    Process::start(command).ended_within(Duration::from_secs(300))
}

fn written(home: &Path, name: &str, text: &str) -> String {
    let path = home.join(name);
    std::fs::write(&path, text).unwrap();
    shown(&path)
}

#[test]
fn a_table_is_diagnosed_in_one_command_and_the_machine_that_is_assumed_is_stated() {
    for (table, travels, cause) in [
        ("positioning.csv", "X −300 to 300 mm", "backlash X"),
        (
            "ballbar.csv",
            "X −110 to 110 mm, Y −110 to 110 mm",
            "squareness XY",
        ),
        ("drift.csv", "Z −250 to 250 mm", "growth of the spindle"),
    ] {
        let ended = diagnosed(&[&format!("tests/import/{table}")]);
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        let first = ended.said.find(ASSUMED).expect(ASSUMED);
        assert!(ended.said[first..].contains(travels), "{}", ended.said);
        assert!(ended.said.contains(cause), "{}", ended.said);
    }
    for (table, words) in [("rotary.csv", "abbe report"), ("touches.csv", "ISO 230-10")] {
        let ended = diagnosed(&[&format!("tests/import/{table}")]);
        assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
        assert!(ended.said.contains(words), "{}", ended.said);
    }
}

/// A thermometer with a name of its own may be anywhere: what goes with it is called a shift with it, and no part of the machine.
#[test]
fn a_thermometer_without_a_place_in_its_name_makes_no_part_of_the_machine_a_cause() {
    let home = TempDir::new().unwrap();
    let table = std::fs::read_to_string(root().join("tests/import/drift.csv")).unwrap();
    for (name, is_placed) in [("T1", false), ("Spindellager vorn °C", true)] {
        let own = table.replace(",spindle,", &format!(",{name},"));
        assert_ne!(own, table);
        let path = written(home.path(), "log.csv", &own);
        let ended = diagnosed(&[&path]);
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        let said = &ended.said;
        let stated = said.contains("for its name has no place");
        assert_eq!(stated, !is_placed, "{said}");
        let cause = if is_placed {
            "growth of the spindle"
        } else {
            "shift with a temperature t1"
        };
        assert!(said.contains(&format!("Which: {cause}")), "{said}");
    }
}

#[test]
fn a_bag_beside_a_table_has_the_machine_and_a_copy_is_named_as_it_was_given() {
    let home = TempDir::new().unwrap();
    let twice = diagnosed(&[
        "tests/import/positioning.csv",
        "tests/import/positioning.csv",
    ]);
    assert_eq!(twice.status.code(), Some(1), "{}", twice.said);
    let named = "tests/import/positioning.csv: is the same as tests/import/positioning.csv";
    assert!(twice.said.contains(named), "{}", twice.said);
    let table = "tests/import/positioning.csv";
    let beside = diagnosed(&[table, "bags/cold_reference"]);
    assert!(!beside.said.contains(ASSUMED), "{}", beside.said);
    // Tables of several machines would be one series.
    let store = shown(&home.path().join("h.sqlite"));
    let kept = [
        table,
        "--keep",
        "--kept-at",
        "2026-03-01",
        "--store",
        &store,
    ];
    let refused = diagnosed(&kept);
    assert_eq!(refused.status.code(), Some(1), "{}", refused.said);
    assert!(refused.said.contains("--kept-as"), "{}", refused.said);
    let named = diagnosed(&[&kept[..], &["--kept-as", "mill"]].concat());
    assert_eq!(named.status.code(), Some(0), "{}", named.said);
}
