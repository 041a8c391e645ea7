//! What the machine file refuses, and how it says so.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use machine::{Chain, MachineFile};
use serde_json::Value;

const BENCH: &str = include_str!("../data/bench.yaml");
const GRID: &str = include_str!("../../../../../launch_configs/grid_xy/machine.yaml");
const FIRST_RUN: &str = include_str!("../../../../../launch_configs/first_run/machine.yaml");

/// Error of the bench file with one text replaced by another.
fn refusal(from: &str, to: &str) -> String {
    assert!(BENCH.contains(from), "{from}");
    let text = BENCH.replacen(from, to, 1);
    MachineFile::parse(&text, "m.yaml").unwrap_err().to_string()
}

/// A message without the line and column that follow the name of its file; both must be there.
fn unplaced(message: &str) -> String {
    let mut parts = message.splitn(4, ':');
    let mut next = || parts.next().unwrap();
    let (file, line, column, rest) = (next(), next(), next(), next());
    for number in [line, column] {
        assert!(number.parse::<usize>().is_ok(), "{message}");
    }
    format!("{file}:{rest}")
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

/// Touches are weighted by the inverse square of their scatter.
#[test]
fn a_scatter_of_touches_that_no_probe_has_is_refused_and_one_nanometre_is_not() {
    for text in [
        "0.0", "-0.0", "1.0e-150", "4.9e-324", "9.9e-4", "1001.0", ".nan", ".inf",
    ] {
        let said = refusal(
            "repeatability_um: 0.3",
            &format!("repeatability_um: {text}"),
        );
        let begin = "m.yaml:";
        assert!(said.starts_with(begin), "{text}: {said}");
        assert!(said.contains("probe.repeatability_um = "), "{text}: {said}");
        assert!(
            said.ends_with("must be from 0.001 to 1000 µm"),
            "{text}: {said}"
        );
    }
    let mut file = MachineFile::parse(BENCH, "m.yaml").unwrap();
    for repeatability_um in [1e-3, 0.3, 1e3] {
        file.probe.repeatability_um = repeatability_um;
        assert!(file.check("m.yaml").is_ok(), "{repeatability_um}");
    }
}

#[test]
fn numbers_outside_their_range_are_named_with_value_and_rule() {
    let cases = [
        (
            "travel_mm: [-320.0, 320.0]",
            "travel_mm: [320.0, -320.0]",
            "m.yaml: axes.X.travel_mm = [320, -320] mm: the first must be below the second",
        ),
        (
            "travel_mm: [-320.0, 320.0]",
            "travel_mm: [-320.0, .nan]",
            "m.yaml: axes.X.travel_mm[1] = NaN mm: must be from -100000 to 100000 mm",
        ),
        (
            "scale_resolution_um: 0.05",
            "scale_resolution_um: 0.0",
            "m.yaml: axes.X.scale_resolution_um = 0 µm: must be from 1e-6 to 1000 µm",
        ),
        (
            "velocity_feedforward: 0.98",
            "velocity_feedforward: 1.2",
            "m.yaml: axes.X.velocity_feedforward = 1.2: must be from 0 to 1",
        ),
        (
            "velocity_feedforward: 0.98",
            "velocity_feedforward: 0.98, velocity_loop: {frequency_hz: 0.0, damping: 1.1, filter_ms: 0.0}",
            "m.yaml: axes.X.velocity_loop.frequency_hz = 0 Hz: must be from 0.1 to 100000 Hz",
        ),
        (
            "velocity_feedforward: 0.98",
            "velocity_feedforward: 0.98, velocity_loop: {frequency_hz: 35.0, damping: 1.1, filter_ms: -0.1}",
            "m.yaml: axes.X.velocity_loop.filter_ms = -0.1 ms: must be from 0 to 10000 ms",
        ),
        (
            "feed_mm_min: 120.0",
            "feed_mm_min: 0.0",
            "m.yaml: probe.feed_mm_min = 0 mm/min: must be from 0.01 to 100000 mm/min",
        ),
        (
            "repeatability_um: 0.3",
            "repeatability_um: -0.3",
            "m.yaml: probe.repeatability_um = -0.3 µm: must be from 0.001 to 1000 µm",
        ),
        (
            "approach_sign: [1, 1, -1]",
            "approach_sign: [1, 0, -1]",
            "m.yaml: blocks[0].approach_sign[1] = 0: must be 1 or -1",
        ),
        (
            "inset_mm: 6.0",
            "inset_mm: .inf",
            "m.yaml: blocks[0].inset_mm = inf mm: must be from 0.001 to 10000 mm",
        ),
        (
            "normal: [0.0, 0.0, 1.0]",
            "normal: [0.0, 0.0, 0.0]",
            "m.yaml: artefacts[3].normal = 0: must have a length above 1e-9",
        ),
    ];
    for (from, to, message) in cases {
        assert_eq!(unplaced(&refusal(from, to)), message);
    }
}

#[test]
fn the_stem_of_a_stylus_is_given_of_each_or_of_none_and_ends_at_the_nose() {
    let long = "length_mm: 150.0, stem_length_mm: 160.0";
    assert_eq!(
        unplaced(&refusal("length_mm: 150.0", long)),
        "m.yaml: probe.styli.ruby_6.stem_length_mm = 160 mm: must be at most length_mm, which reaches from the spindle nose to the ball"
    );
    let other =
        "length_mm: 150.0, stem_length_mm: 50.0}, ruby_2: {radius_mm: 1.0, length_mm: 150.0";
    assert_eq!(
        unplaced(&refusal("length_mm: 150.0", other)),
        "m.yaml: probe.styli.ruby_2.stem_length_mm = \"\": must be given of each stylus or of none"
    );
    let both = BENCH.replacen(
        "length_mm: 150.0",
        "length_mm: 150.0, stem_length_mm: 50.0",
        1,
    );
    let file = MachineFile::parse(&both, "m.yaml").unwrap();
    assert!((file.probe.styli["ruby_6"].bending_length_mm() - 50.0).abs() < 1e-12);
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
        assert_eq!(unplaced(&refusal(from, to)), message);
    }
}

#[test]
fn chain_and_axes_must_agree() {
    assert_eq!(
        unplaced(&refusal("[w C' A' Y' b X Z t]", "[w A' Y' b X Z t]")),
        "m.yaml: axes.C: is described but does not stand in the chain"
    );
    assert_eq!(
        unplaced(&refusal("[w C' A' Y' b X Z t]", "[w C' A' Y' B' b X Z t]")),
        "m.yaml: axes.B: stands in the chain but is not described"
    );
    assert_eq!(
        unplaced(&refusal("[w C' A' Y' b X Z t]", "[w C' A Y' b X Z t]")),
        "m.yaml: chain: column 7, \"A\": an axis between w and b moves the workpiece and needs a prime"
    );
    assert_eq!(
        unplaced(&refusal("A: [0.0, 0.0, 50.0], ", "")),
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
            "m.yaml: grid_encoder.radius_mm = -110 mm: must be from 0.001 to 100000 mm",
        ),
        (
            "centre_mm: [50.0, 0.0, 150.0]",
            "centre_mm: [50.0, .nan, 150.0]",
            "m.yaml: grid_encoder.placements[1].centre_mm[1] = NaN mm: must be from -100000 to 100000 mm",
        ),
        (
            "to_mm: [300.0, 20.0, 100.0]",
            "to_mm: [-300.0, 20.0, 100.0]",
            "m.yaml: length_reference.beams[0] = 0: is its length, which must be at least 1 mm",
        ),
    ];
    for (from, to, message) in cases {
        assert_eq!(unplaced(&refusal(from, to)), message);
    }
    let told = refusal("plane: yz,", "plane: xz,");
    assert!(told.contains("xz") && told.contains("zx"), "{told}");
    let told = refusal("plane: yz,", "plane: yz, radius_mm: 3.0,");
    assert!(
        told.contains("radius_mm") && told.contains("tool_offset_mm"),
        "{told}"
    );
}

#[test]
fn a_spindle_has_a_speed_that_a_spindle_can_have() {
    for speed in ["0.0", "-1.0", ".nan", ".inf", "500001.0"] {
        let message = refusal("max_speed_rpm: 12000.0", &format!("max_speed_rpm: {speed}"));
        assert!(
            message.contains("spindle.max_speed_rpm") && message.contains("to 500000 1/min"),
            "{message}"
        );
    }
    let without = BENCH.replacen("spindle: {max_speed_rpm: 12000.0}\n", "", 1);
    let file = MachineFile::parse(&without, "m.yaml").unwrap();
    assert_eq!(file.spindle, None, "older files have none");
}

#[test]
fn numbers_and_lists_beyond_their_bounds_are_refused_by_key_value_and_bound() {
    for (from, to, words) in [
        (
            "servo_period_ms: 1.0",
            "servo_period_ms: 1.0e-9",
            "control.servo_period_ms = 1e-9 ms: must be from 0.05 to 100 ms",
        ),
        (
            "standoff_mm: 2.0",
            "standoff_mm: 1.0e300",
            "probe.standoff_mm = 1e300 mm: must be from 0.001 to 1000 mm",
        ),
        (
            "repeatability_um: 0.3",
            "repeatability_um: 1.0e13",
            "probe.repeatability_um = 10000000000000 µm: must be from 0.001 to 1000 µm",
        ),
        (
            "lead_mm: 10.0",
            "lead_mm: 0.01",
            "axes.X.lead_mm = 0.01 mm: must be from 0.2 to 500 mm, the leads of screws and racks: state it in mm, not in m or µm",
        ),
        (
            "lead_mm: 10.0",
            "lead_mm: 10000.0",
            "axes.X.lead_mm = 10000 mm: must be from 0.2 to 500 mm, the leads",
        ),
    ] {
        let said = refusal(from, to);
        assert!(said.contains(words), "{said}");
    }
    let mut file = MachineFile::parse(BENCH, "m.yaml").unwrap();
    file.blocks[1].corner_mm = file.blocks[0].corner_mm;
    let said = file.check("m.yaml").unwrap_err().to_string();
    let begin = "m.yaml: blocks[1].corner_mm less blocks[0].corner_mm = 0";
    assert!(said.starts_with(begin), "{said}");
    assert!(
        said.ends_with("must be at least 1 mm: two blocks stand at two places"),
        "{said}"
    );
    let mut file = MachineFile::parse(BENCH, "m.yaml").unwrap();
    let block = file.blocks[0].clone();
    file.blocks = vec![block; 1_001];
    let said = file.check("m.yaml").unwrap_err().to_string();
    assert_eq!(said, "m.yaml: blocks: 1001 entries: at most 1000");
    let mut file = MachineFile::parse(BENCH, "m.yaml").unwrap();
    file.name = "x".repeat(129);
    let said = file.check("m.yaml").unwrap_err().to_string();
    assert_eq!(said, "m.yaml: name: 129 bytes of text: at most 128");
}

/// Every number of a value with its place in it: `/axes/X/travel_mm/1`.
fn numbers_of(value: &Value, place: &str, all: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                numbers_of(value, &format!("{place}/{key}"), all);
            }
        }
        Value::Array(list) => {
            for (at, value) in list.iter().enumerate() {
                numbers_of(value, &format!("{place}/{at}"), all);
            }
        }
        Value::Number(number) if number.is_f64() => all.push(place.to_owned()),
        _ => {}
    }
}

/// The path of a place as messages show it: `axes.X.travel_mm[1]`.
fn path_of(place: &str) -> String {
    let mut path = String::new();
    for segment in place.split('/').skip(1) {
        if segment.parse::<usize>().is_ok() {
            path.push_str(&format!("[{segment}]"));
        } else {
            if !path.is_empty() {
                path.push('.');
            }
            path.push_str(segment);
        }
    }
    path
}

#[test]
fn every_physical_number_has_a_range_that_a_machine_can_have() {
    let mut n = 0;
    for text in [BENCH, FIRST_RUN, GRID] {
        let file = MachineFile::parse(text, "m.yaml").unwrap();
        let whole = serde_json::to_value(&file).unwrap();
        let mut places = vec![];
        numbers_of(&whole, "", &mut places);
        for place in places {
            for wrong in [1e300, -1e300, 1e12, -1e12, 1e-300] {
                let may_be_zero = file_takes_zero(&place);
                if wrong < 1.0 && wrong > 0.0 && may_be_zero {
                    continue;
                }
                let mut changed = whole.clone();
                *changed.pointer_mut(&place).unwrap() = wrong.into();
                let changed: MachineFile = serde_json::from_value(changed).unwrap();
                let shown = match changed.check("m.yaml") {
                    Ok(()) => panic!("{place} = {wrong} is taken"),
                    Err(error) => error.to_string(),
                };
                let begin = format!("m.yaml: {} = ", path_of(&place));
                assert!(
                    shown.starts_with(&begin) && shown.contains("must be from "),
                    "{place}: {shown}"
                );
                n += 1;
            }
        }
    }
    assert!(n > 500, "{n} wrong numbers");
}

/// Coordinates, shares and what may be absent; everything else is above 0.
fn file_takes_zero(place: &str) -> bool {
    let coordinates = [
        "travel_mm",
        "travel_deg",
        "origin_mm",
        "corner_mm",
        "centre_mm",
        "point_mm",
        "normal",
        "top_z_mm",
        "tool_offset_mm",
        "from_mm",
        "to_mm",
    ];
    let from_zero = [
        "velocity_feedforward",
        "filter_ms",
        "viscous_per_s",
        "repeatability_um",
        "latency_ms",
    ];
    place.starts_with("/effects/")
        || coordinates
            .iter()
            .chain(&from_zero)
            .any(|key| place.contains(key))
}

#[test]
fn styli_of_a_size_in_metres_or_micrometres_are_refused_with_the_remedy() {
    let with = |change: fn(&mut machine::file::StylusEntry)| {
        let mut file = MachineFile::parse(BENCH, "m.yaml").unwrap();
        let stylus = file.probe.styli.values_mut().next().unwrap();
        change(stylus);
        file.check("m.yaml").unwrap_err().to_string()
    };
    for (said, words) in [
        (
            with(|it| it.radius_mm = 0.003),
            "radius_mm = 0.003 mm: must be from 0.02 to 30 mm",
        ),
        (
            with(|it| it.radius_mm = 3000.0),
            "radius_mm = 3000 mm: must be from 0.02 to 30 mm",
        ),
        (
            with(|it| it.length_mm = 0.15),
            "length_mm = 0.15 mm: must be from 1 to 3000 mm",
        ),
        (
            with(|it| it.stem_length_mm = Some(0.05)),
            "stem_length_mm = 0.05 mm: must be from 1 to 3000 mm",
        ),
    ] {
        assert!(said.starts_with("m.yaml: probe.styli."), "{said}");
        assert!(said.contains(words), "{said}");
        assert!(said.ends_with("state it in mm, not in m or µm"), "{said}");
    }
}

#[test]
fn machines_at_the_ends_of_what_is_built_are_taken() {
    // A machine for watch parts and a gantry of 30 m.
    let small = BENCH
        .replacen("lead_mm: 10.0", "lead_mm: 0.5", 1)
        .replacen("travel_mm: [-320.0, 320.0]", "travel_mm: [-5.0, 5.0]", 1)
        .replacen("standoff_mm: 2.0", "standoff_mm: 0.05", 1)
        .replacen("feed_mm_min: 120.0", "feed_mm_min: 1.0", 1);
    MachineFile::parse(&small, "m.yaml").unwrap();
    let large = BENCH
        .replacen("lead_mm: 10.0", "lead_mm: 320.0", 1)
        .replacen(
            "travel_mm: [-320.0, 320.0]",
            "travel_mm: [-15000.0, 15000.0]",
            1,
        )
        .replacen("standoff_mm: 2.0", "standoff_mm: 20.0", 1);
    MachineFile::parse(&large, "m.yaml").unwrap();
}

#[test]
fn a_scale_is_described_whole_and_gives_the_axis_its_period_where_it_closes_the_loop() {
    let known = "scale_resolution_um: 0.05";
    let half = refusal(
        known,
        &format!("{known}, scale_expanded_uncertainty_um: 1.0"),
    );
    assert!(
        half.contains("needs both scale_expanded_uncertainty_um"),
        "{half}"
    );
    let none = refusal(known, "scale_signal_period_um: 20.0");
    assert!(none.contains("no scale_resolution_um"), "{none}");
    let wrong = refusal(known, &format!("{known}, periods_mm: [12.0, 0.0]"));
    assert_eq!(
        unplaced(&wrong),
        "m.yaml: axes.X.periods_mm[1] = 0 mm: must be from 0.001 to 100000 mm"
    );
    // A lead of 10 mm, a belt of 5 mm, a signal period of 20 µm.
    for (feedback, repeats_mm) in [("motor", &[10.0, 5.0][..]), ("scale", &[10.0, 5.0, 0.02])] {
        let more = format!(
            "{known}, periods_mm: [5.0], scale_signal_period_um: 20.0, position_feedback: {feedback}"
        );
        let text = BENCH.replacen(known, &more, 1);
        let file = MachineFile::parse(&text, "m.yaml").unwrap();
        let found = file.linear(metrology::Axis::X).unwrap().repeats_mm();
        assert_eq!(found.len(), repeats_mm.len(), "{found:?}");
        for (found, expected) in found.iter().zip(repeats_mm) {
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
    }
}
