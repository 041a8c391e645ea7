//! Blocks that cannot show a slope, and a block that is knocked.

use abbe_msgs::topics;
use metrology::Axis;

use crate::cell::{Cell, known_latency};

/// Cold, a part's time, and again.
const TWICE: &str = "\
title: twice
steps:
  - {do: blocks, cold: true}
  - {do: compensation, enable: true}
  - {do: produce, program: production.ngc, minutes: 12.0, serve_updates: false}
  - {do: blocks}
  - {do: wait, seconds: 30.0}
";

#[test]
fn blocks_at_one_coordinate_give_a_shift_and_no_slope() {
    let scenario = known_latency();
    scenario.write("plan.yaml", TWICE);
    scenario.replace(
        "machine.yaml",
        "corner_mm: [220.0, 180.0, 200.0], approach_sign: [-1, -1, -1]",
        "corner_mm: [-220.0, 180.0, 200.0], approach_sign: [1, -1, -1]",
    );
    let cell = Cell::run(&scenario, 40);
    assert_eq!(cell.status.message, "");
    cell.expect("thermal_model", "", &["X"]);
    let models = cell.all(&topics::THERMAL_MODEL);
    let hot = models.last().unwrap();
    let x = hot.axes[Axis::X].as_ref().unwrap();
    assert!(!x.slope_identifiable && x.offset_identifiable, "{x:?}");
    assert!(x.slope_mm_per_mm.abs() < 1e-15, "{x:?}");
    assert!(x.k0_mm.is_finite() && x.k0_mm.abs() > 1e-4, "{x:?}");
    let y = hot.axes[Axis::Y].as_ref().unwrap();
    assert!(y.slope_identifiable, "{y:?}");
    cell.expect_offsets_within(0.15);
    let last = cell.all(&topics::COMPENSATION).pop().unwrap();
    assert!((last.total[Axis::X] - x.k0_mm).abs() < 1e-3, "{last:?}");
}

/// 0.2 mm in X between two cycles is no heat: kept back, said, and not compensated.
#[test]
fn a_bumped_block_is_quarantined_and_moves_no_axis() {
    let scenario = known_latency();
    scenario.write("plan.yaml", TWICE);
    scenario.append(
        "plant.yaml",
        "\nfaults: {bumped_blocks: [{id: block_2, at_s: 300.0, shift_um: [200.0, 0.0, 0.0]}]}\n",
    );
    let cell = Cell::run(&scenario, 40);
    assert_eq!(cell.status.message, "");
    let words = ["block \"block_2\"", "face X", "jumped by", "heat allows"];
    cell.expect("thermal_model", "", &words);
    let hot = cell.all(&topics::THERMAL_MODEL).pop().unwrap();
    assert!(hot.quarantined, "{hot:?}");
    cell.expect_offsets_within(0.05);
}
