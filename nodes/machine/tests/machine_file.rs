//! What the machine file refuses, and how it says so.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use machine::{Chain, MachineFile};

const BENCH: &str = include_str!("data/bench.yaml");
const FIRST_RUN: &str = include_str!("../../../launch_configs/first_run/machine.yaml");

/// Error of the bench file with one text replaced by another.
fn refusal(from: &str, to: &str) -> String {
    assert!(BENCH.contains(from), "{from}");
    let text = BENCH.replacen(from, to, 1);
    MachineFile::parse(&text, "m.yaml").unwrap_err().to_string()
}

#[test]
fn the_machine_of_the_first_run_is_valid() {
    let file = MachineFile::parse(FIRST_RUN, "machine.yaml").unwrap();
    let chain: Chain = file.chain.parse().unwrap();
    assert_eq!(chain.axes(), file.axis_set());
    assert!(file.blocks.len() >= 2);
}

#[test]
fn a_file_survives_being_written_and_read() {
    let file = MachineFile::parse(BENCH, "m.yaml").unwrap();
    let text = serde_saphyr::to_string(&file).unwrap();
    assert_eq!(MachineFile::parse(&text, "again.yaml").unwrap(), file);
}

#[test]
fn unknown_and_missing_keys_are_named_with_their_place() {
    let unknown = refusal("lead_mm: 10.0", "leed_mm: 10.0");
    assert!(unknown.starts_with("m.yaml:4:"), "{unknown}");
    assert!(unknown.contains("leed_mm"), "{unknown}");
    let unit = refusal("standoff_mm: 2.0", "standoff_um: 2000.0");
    assert!(
        unit.starts_with("m.yaml:15:") && unit.contains("standoff_um"),
        "{unit}"
    );
    let missing = refusal("  repeatability_um: 0.3\n", "");
    assert!(missing.contains("repeatability_um"), "{missing}");
    let linear_key = refusal("travel_deg: [-120.0, 30.0]", "travel_mm: [-120.0, 30.0]");
    assert!(
        linear_key.starts_with("m.yaml:7:") && linear_key.contains("travel_mm"),
        "{linear_key}"
    );
    let axis = refusal("  X: {", "  U: {");
    assert!(
        axis.starts_with("m.yaml:4:") && axis.contains('U'),
        "{axis}"
    );
    let word = refusal("servo_period_ms: 1.0", "servo_period_ms: fast");
    assert!(word.starts_with("m.yaml:11:"), "{word}");
    let cut = MachineFile::parse("name: [", "m.yaml")
        .unwrap_err()
        .to_string();
    assert!(cut.starts_with("m.yaml:"), "{cut}");
}

#[test]
fn numbers_outside_their_range_are_named_with_value_and_rule() {
    let cases = [
        (
            "travel_mm: [-320.0, 320.0]",
            "travel_mm: [320.0, -320.0]",
            "m.yaml: axes.X.travel_mm = [320, -320]: the first must be below the second",
        ),
        (
            "travel_mm: [-320.0, 320.0]",
            "travel_mm: [-320.0, .nan]",
            "m.yaml: axes.X.travel_mm[1] = NaN: must be a finite number",
        ),
        (
            "scale_resolution_um: 0.05",
            "scale_resolution_um: 0.0",
            "m.yaml: axes.X.scale_resolution_um = 0: must be a finite number above 0",
        ),
        (
            "velocity_feedforward: 0.98",
            "velocity_feedforward: 1.2",
            "m.yaml: axes.X.velocity_feedforward = 1.2: must be from 0 to 1",
        ),
        (
            "velocity_feedforward: 0.98",
            "velocity_feedforward: 0.98, velocity_loop: {frequency_hz: 0.0, damping: 1.1, filter_ms: 0.0}",
            "m.yaml: axes.X.velocity_loop.frequency_hz = 0: must be a finite number above 0",
        ),
        (
            "velocity_feedforward: 0.98",
            "velocity_feedforward: 0.98, velocity_loop: {frequency_hz: 35.0, damping: 1.1, filter_ms: -0.1}",
            "m.yaml: axes.X.velocity_loop.filter_ms = -0.1: must be a finite number, 0 or above",
        ),
        (
            "feed_mm_min: 120.0",
            "feed_mm_min: 0.0",
            "m.yaml: probe.feed_mm_min = 0: must be a finite number above 0",
        ),
        (
            "repeatability_um: 0.3",
            "repeatability_um: -0.3",
            "m.yaml: probe.repeatability_um = -0.3: must be a finite number, 0 or above",
        ),
        (
            "approach_sign: [1, 1, -1]",
            "approach_sign: [1, 0, -1]",
            "m.yaml: blocks[0].approach_sign[1] = 0: must be 1 or -1",
        ),
        (
            "inset_mm: 6.0",
            "inset_mm: .inf",
            "m.yaml: blocks[0].inset_mm = inf: must be a finite number above 0",
        ),
        (
            "normal: [0.0, 0.0, 1.0]",
            "normal: [0.0, 0.0, 0.0]",
            "m.yaml: artefacts[3].normal = 0: must have a length above 1e-9",
        ),
    ];
    for (from, to, message) in cases {
        assert_eq!(refusal(from, to), message);
    }
}

#[test]
fn names_that_refer_to_nothing_or_break_ros_rules_are_refused() {
    let cases = [
        (
            "mounted: ruby_6",
            "mounted: ruby_4",
            "m.yaml: probe.mounted = \"ruby_4\": must be one of probe.styli",
        ),
        (
            "id: block_2",
            "id: block_1",
            "m.yaml: blocks[1].id = \"block_1\": is used twice",
        ),
        (
            "id: ball",
            "id: block_1",
            "m.yaml: artefacts[0].id = \"block_1\": is used twice",
        ),
        (
            "id: ball",
            "id: 2nd",
            "m.yaml: artefacts[0].id = \"2nd\": must begin with a letter and consist of letters, digits and single underscores",
        ),
        (
            "id: ball",
            "id: a.b",
            "m.yaml: artefacts[0].id = \"a.b\": must begin with a letter and consist of letters, digits and single underscores",
        ),
        (
            "name: bench",
            "name: \"\"",
            "m.yaml: name = \"\": must begin with a letter and consist of letters, digits and single underscores",
        ),
    ];
    for (from, to, message) in cases {
        assert_eq!(refusal(from, to), message);
    }
}

#[test]
fn chain_and_axes_must_agree() {
    assert_eq!(
        refusal("[w C' A' Y' b X Z t]", "[w A' Y' b X Z t]"),
        "m.yaml: axes.C: is described but does not stand in the chain"
    );
    assert_eq!(
        refusal("[w C' A' Y' b X Z t]", "[w C' A' Y' B' b X Z t]"),
        "m.yaml: axes.B: stands in the chain but is not described"
    );
    assert_eq!(
        refusal("[w C' A' Y' b X Z t]", "[w C' A Y' b X Z t]"),
        "m.yaml: chain: column 7, \"A\": an axis between w and b moves the workpiece and needs a prime"
    );
    assert_eq!(
        refusal("A: [0.0, 0.0, 50.0], ", ""),
        "m.yaml: axes.A: needs a point on its line in rotary.origin_mm"
    );
}

#[test]
fn placements_and_beams_that_contradict_or_say_too_much_are_refused_by_name() {
    let cases = [
        (
            "id: upright_x",
            "id: table",
            "m.yaml: grid_encoder.placements[1].id = \"table\": is used twice",
        ),
        (
            "id: along_x",
            "id: upright_y",
            "m.yaml: length_reference.beams[0].id = \"upright_y\": is used twice",
        ),
        (
            "radius_mm: 110.0",
            "radius_mm: -110.0",
            "m.yaml: grid_encoder.radius_mm = -110: must be a finite number above 0",
        ),
        (
            "centre_mm: [50.0, 0.0, 150.0]",
            "centre_mm: [50.0, .nan, 150.0]",
            "m.yaml: grid_encoder.placements[1].centre_mm[1] = NaN: must be a finite number",
        ),
        (
            "to_mm: [300.0, 20.0, 100.0]",
            "to_mm: [-300.0, 20.0, 100.0]",
            "m.yaml: length_reference.beams[0] = 0: is its length, which must be at least 1 mm",
        ),
    ];
    for (from, to, message) in cases {
        assert_eq!(refusal(from, to), message);
    }
    let told = refusal("plane: yz,", "plane: xz,");
    assert!(told.contains("xz") && told.contains("zx"), "{told}");
    let told = refusal("plane: yz,", "plane: yz, radius_mm: 3.0,");
    assert!(
        told.contains("radius_mm") && told.contains("tool_offset_mm"),
        "{told}"
    );
}
