//! A probe that does not work, and blocks that are not where they should be.

use abbe_msgs::topics;
use abbe_tests::scenario::Scenario;

use crate::cell::{Cell, known_latency};

const BLOCKS_ONLY: &str = "title: blocks\nsteps:\n  - {do: blocks, cold: true}\n";

fn with_fault(fault: &str) -> Scenario {
    let scenario = known_latency();
    scenario.write("plan.yaml", BLOCKS_ONLY);
    scenario.append("plant.yaml", &format!("\nfaults: {{{fault}}}\n"));
    scenario
}

fn no_touch_was_taken(cell: &Cell) {
    assert_eq!(cell.all(&topics::PROBE_TRIGGER), []);
    for model in cell.all(&topics::THERMAL_MODEL) {
        let drifts = model.axes.0.iter().flatten();
        assert!(drifts.into_iter().all(|drift| drift.k0_mm.abs() < 1e-12));
    }
    cell.expect_at_rest();
    cell.expect_offsets_within(0.0);
}

/// The block stands 8 mm deeper than the machine file says, and the overtravel is 3 mm.
#[test]
fn a_touch_that_never_triggers_ends_the_plan_with_its_place() {
    let bump = "bumped_blocks: [{id: block_1, at_s: 0.0, shift_um: [8000.0, 8000.0, -8000.0]}]";
    let cell = Cell::run(&with_fault(bump), 10);
    cell.expect_failed(&[
        "line 9",
        "touch of \"block_1.x\"",
        "without the probe closed",
    ]);
    no_touch_was_taken(&cell);
}

#[test]
fn a_dead_probe_ends_the_plan_at_the_first_touch() {
    let cell = Cell::run(&with_fault("probe: {kind: dead, from_s: 0.0}"), 10);
    cell.expect_failed(&[
        "line 9",
        "touch of \"block_1.x\"",
        "without the probe closed",
    ]);
    no_touch_was_taken(&cell);
}

#[test]
fn a_probe_stuck_closed_ends_the_plan_before_the_touch() {
    let cell = Cell::run(&with_fault("probe: {kind: stuck_closed, from_s: 0.0}"), 10);
    cell.expect_failed(&["line 9", "already closed", "\"block_1.x\""]);
    no_touch_was_taken(&cell);
}

/// It sticks while the machine works: the cycle fails, the production before it does not.
#[test]
fn a_probe_that_sticks_later_spoils_the_cycle_and_not_the_reference() {
    let scenario = with_fault("probe: {kind: stuck_closed, from_s: 120.0}");
    scenario.write(
        "plan.yaml",
        "title: late\nsteps:\n  - {do: blocks, cold: true}\n  - {do: wait, seconds: 120.0}\n  - {do: blocks}\n",
    );
    let cell = Cell::run(&scenario, 10);
    cell.expect_failed(&["line 9", "already closed", "\"block_1.x\""]);
    let blocks = cell.all(&topics::BLOCKS_MEASUREMENT);
    let measured =
        |block: &&metrology::sample::BlockMeasurement| block.faces.0.iter().any(Option::is_some);
    assert_eq!(blocks.iter().filter(measured).count(), 2);
    assert_eq!(cell.all(&topics::THERMAL_MODEL).len(), 1);
    cell.expect_at_rest();
}

#[test]
fn a_missing_block_is_named_and_no_drift_is_made_up_for_it() {
    let cell = Cell::run(&with_fault("missing_blocks: [block_2]"), 10);
    cell.expect_failed(&[
        "line 27",
        "touch of \"block_2.x\"",
        "without the probe closed",
    ]);
    cell.expect("probe", "face_missing", &["block_2"]);
    for model in cell.all(&topics::THERMAL_MODEL) {
        let drifts = model.axes.0.iter().flatten();
        assert!(drifts.into_iter().all(|drift| drift.k0_mm.abs() < 1e-12));
    }
    cell.expect_at_rest();
}
