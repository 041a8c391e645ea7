use std::collections::BTreeMap;

use machine::MachineFile;

use super::*;
use crate::config::Config;
use crate::recordings::recordings;
use crate::stage::Sequencer;

const MACHINE: &str = include_str!("../../../../launch_configs/grid_xy/machine.yaml");
const BENCH: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "machine.yaml").unwrap()
}

fn text(step: &str) -> String {
    format!("title: t\nsteps:\n  - {{do: wait, seconds: 1.0}}\n  - {step}\n")
}

/// Errors on a step from reading the plan, running it and planning its recordings.
fn said(step: &str) -> Vec<String> {
    let read = Plan::from_yaml(&text(step)).unwrap_err().to_string();
    // A plan that was built without a text.
    let plan: Plan = serde_saphyr::from_str(&text(step)).unwrap();
    let run = Sequencer::new(
        Config::default(),
        machine(),
        Some(plan.clone()),
        BTreeMap::new(),
    );
    let planned = recordings(&plan, &machine()).unwrap_err().to_string();
    let all = vec![read, run.err().unwrap().to_string(), planned];
    all
}

const GRID: &str =
    "do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0";
const RUN: &str = "axis: X, feed_mm_min: 2000.0, overrun_mm: 5.0, at_mm: [0.0, 0.0, 200.0]";

#[test]
#[expect(
    clippy::too_many_lines,
    reason = "a table of cases, read from top to bottom"
)]
fn every_count_of_a_plan_is_refused_above_its_bound_by_line_key_value_and_bound() {
    let grid = |keys: &str| format!("{{{GRID}, {keys}}}");
    let run = |keys: &str| format!("{{do: positioning, {RUN}, dwell_s: 1.0, {keys}}}");
    for (step, words) in [
        (
            run("targets_mm: [0.0, 50.0], runs: 1000000000"),
            "steps[1].runs = 1000000000: at most 10000",
        ),
        (
            run("from_mm: 0.0, to_mm: 300.0, spacing_mm: 1.0e-9, runs: 1"),
            "steps[1].spacing_mm: 300000000001 targets: at most 100000",
        ),
        (
            run("from_mm: 0.0, to_mm: 100.0, spacing_mm: 1.0, runs: 9000"),
            "steps[1].runs: 9000 runs x 2 ways x 101 targets = 1818000 stops: at most 1000000",
        ),
        (
            format!("{{do: scan, {RUN}, targets_mm: [0.0, 50.0], runs: 4000000000}}"),
            "steps[1].runs = 4000000000: at most 10000",
        ),
        (
            grid("on_the_fly: true, repeats: 4000000000"),
            "steps[1].repeats = 4000000000: at most 10000",
        ),
        (
            grid("stations: 4000000000, dwell_s: 1.0"),
            "steps[1].stations = 4000000000: at most 100000",
        ),
        (
            grid("stations: 20000, dwell_s: 1.0, sense: both, repeats: 10000"),
            "steps[1].repeats: 10000 repeats x 2 senses x 20000 stations = 400000000 stops: at most 1000000",
        ),
        (
            grid("stations: 36, dwell_s: 1.0e9"),
            "steps[1].dwell_s = 1000000000 s: must be from 0 to 3600 s",
        ),
        (
            "{do: diagonals, beams: [a], targets: 4000000000, runs: 1, dwell_s: 1.0, feed_mm_min: 1000.0, overrun_mm: 5.0}".to_owned(),
            "steps[1].targets = 4000000000: at most 100000",
        ),
        (
            "{do: latency, feature: block_1.z, feeds_mm_min: [120.0, 360.0], repeats: 100000000}".to_owned(),
            "steps[1].repeats = 100000000: at most 10000",
        ),
        (
            format!("{{do: latency, feature: block_1.z, feeds_mm_min: [120.0{}], repeats: 10000}}", ", 1.0".repeat(20)),
            "steps[1].repeats: 21 feeds x 10000 repeats = 210000 touches: at most 100000",
        ),
        (
            format!("{{do: latency, feature: block_1.z, feeds_mm_min: [1.0{}], repeats: 1}}", ", 1.0".repeat(200)),
            "steps[1].feeds_mm_min: 201 entries: at most 100",
        ),
        (
            "{do: artefact, id: ball, points: 4294967295}".to_owned(),
            "steps[1].points = 4294967295: at most 1000",
        ),
        (
            "{do: rotary, sphere: ball, planned: 4000000000, points: 5}".to_owned(),
            "steps[1].planned = 4000000000: at most 1000",
        ),
        (
            "{do: rotary, sphere: ball, planned: 1000, points: 1000, repeats: 10000}".to_owned(),
            "steps[1].repeats: 1000 poses x 10000 repeats = 10000000 visits: at most 500",
        ),
        (
            "{do: wait, seconds: 1.0e300}".to_owned(),
            "must be from 0.001 to 60000000 s",
        ),
        (
            "{do: produce, program: a.ngc, minutes: 1.0e12, serve_updates: true}".to_owned(),
            "steps[1].minutes = 1000000000000 min: must be from 0.001 to 1000000 min",
        ),
        (
            format!("{{do: blocks, blocks: [a{}]}}", ", a".repeat(1_000)),
            "steps[1].blocks: 1001 entries: at most 1000",
        ),
        (
            format!("{{do: verify, program: a.ngc, label: {}}}", "x".repeat(256)),
            "steps[1].label: 256 bytes of text: at most 255",
        ),
    ] {
        let all = said(&step);
        for one in &all {
            assert!(one.contains(words), "{one}\nnot {words}");
        }
        assert!(all[0].starts_with("4:"), "{}", all[0]);
    }
}

#[test]
fn a_physical_number_that_no_plan_needs_is_refused_by_key_value_range_and_time() {
    let run = |keys: &str| {
        format!(
            "{{do: positioning, axis: X, at_mm: [0.0, 0.0, 200.0], dwell_s: 1.0, runs: 5, {keys}}}"
        )
    };
    for (step, words) in [
        (
            run("feed_mm_min: 1.0e-9, overrun_mm: 5.0, targets_mm: [0.0, 50.0]"),
            "steps[1].feed_mm_min = 1e-9 mm/min: must be from 0.01 to 10000000 mm/min; 500 mm of way take 950643 years at this feed",
        ),
        (
            run("feed_mm_min: 1.0e-300, overrun_mm: 5.0, from_mm: 0.0, to_mm: 50.0, spacing_mm: 10.0"),
            "steps[1].feed_mm_min = 1e-300 mm/min: must be from 0.01 to 10000000 mm/min; 500 mm of way take 9.50643e296 years",
        ),
        (
            run("feed_mm_min: 0.0, overrun_mm: 5.0, targets_mm: [0.0, 50.0]"),
            "steps[1].feed_mm_min = 0 mm/min: must be from 0.01 to 10000000 mm/min",
        ),
        (
            run("feed_mm_min: 1000.0, overrun_mm: 5.0, from_mm: 0.0, to_mm: 50.0, spacing_mm: 0.0"),
            "steps[1].spacing_mm = 0 mm: must be from 1e-9 to 100000 mm",
        ),
        (
            run("feed_mm_min: 1000.0, overrun_mm: 5.0, from_mm: 0.0, to_mm: 50.0, spacing_mm: -1.0"),
            "steps[1].spacing_mm = -1 mm: must be from 1e-9 to 100000 mm",
        ),
        (
            run("feed_mm_min: 1000.0, overrun_mm: 1.0e9, targets_mm: [0.0, 50.0]"),
            "steps[1].overrun_mm = 1000000000 mm: must be from 0 to 100000 mm",
        ),
        (
            run("feed_mm_min: 1000.0, overrun_mm: 5.0, targets_mm: [0.0, 1.0e300]"),
            "steps[1].targets_mm[1] = 1e300 mm: must be from -100000 to 100000 mm",
        ),
        (
            "{do: grid, placement: middle, trajectory: circle, radius_mm: 1.0e-9, feed_mm_min: 1500.0, stations: 36, dwell_s: 1.0}".to_owned(),
            "steps[1].radius_mm = 1e-9 mm: must be from 0.001 to 100000 mm",
        ),
        (
            "{do: latency, feature: block_1.z, feeds_mm_min: [120.0, 1.0e-9], repeats: 3}".to_owned(),
            "steps[1].feeds_mm_min[1] = 1e-9 mm/min: must be from 0.01 to 10000000 mm/min",
        ),
        (
            "{do: wait, seconds: -1.0}".to_owned(),
            "steps[1].seconds = -1 s: must be from 0.001 to 60000000 s",
        ),
        (
            "{do: produce, program: a.ngc, minutes: 0.0, serve_updates: true}".to_owned(),
            "steps[1].minutes = 0 min: must be from 0.001 to 1000000 min",
        ),
    ] {
        for one in said(&step) {
            assert!(one.contains(words), "{one}\nnot {words}");
        }
    }
    let slow = "{do: positioning, axis: X, feed_mm_min: 0.01, overrun_mm: 5.0, at_mm: [0.0, 0.0, 200.0], dwell_s: 1.0, targets_mm: [0.0, 500.0], runs: 100}";
    for one in said(slow) {
        assert!(one.contains("way of the plan so far = 10000"), "{one}");
    }
}

#[test]
fn what_steps_add_up_to_is_bounded_over_the_whole_plan() {
    let step = format!("  - {{{GRID}, stations: 100, dwell_s: 1.0, repeats: 4000}}\n");
    let text = format!("title: t\nsteps:\n{}", step.repeat(3));
    let said = Plan::from_yaml(&text).unwrap_err().to_string();
    assert!(said.starts_with("5:"), "{said}");
    assert_eq!(
        said.split_once(": ").unwrap().1,
        "steps[2].repeats: 1200000 stops of the plan so far: at most 1000000; divide the plan into several"
    );
    let rests = "  - {do: wait, seconds: 5.0e7}\n".repeat(2);
    let said = Plan::from_yaml(&format!("title: t\nsteps:\n{rests}")).unwrap_err();
    assert!(said.to_string().contains("of the plan so far"), "{said}");
    let many = format!(
        "title: t\nsteps:\n{}",
        "  - {do: wait, seconds: 1.0}\n".repeat(1_001)
    );
    let said = Plan::from_yaml(&many).unwrap_err().to_string();
    assert!(said.contains("steps: 1001 entries: at most 1000"), "{said}");
}

#[test]
fn numbers_at_their_bounds_are_taken() {
    let long = format!(
        "title: t\nsteps:\n{}",
        "  - {do: wait, seconds: 1.0}\n".repeat(1_000)
    );
    for text in [
        text(&format!(
            "{{do: scan, {RUN}, targets_mm: [0.0, 50.0], runs: 10000}}"
        )),
        text(&format!(
            "{{{GRID}, on_the_fly: true, sense: both, repeats: 10000}}"
        )),
        text("{do: wait, seconds: 5.9e7}"),
        long,
    ] {
        Plan::from_yaml(&text).unwrap();
    }
}

fn order(kind: CycleKind) -> CycleOrder {
    let is_latency = kind == CycleKind::Latency;
    CycleOrder {
        kind,
        features: if is_latency {
            vec!["block_1.z".to_owned()]
        } else {
            vec![]
        },
        feeds_mm_min: if is_latency {
            vec![120.0, 360.0]
        } else {
            vec![]
        },
        points: 0,
        repeats: 1,
        cold: false,
    }
}

const KINDS: [CycleKind; 6] = [
    CycleKind::Blocks,
    CycleKind::Latency,
    CycleKind::Touch,
    CycleKind::Plane,
    CycleKind::Bore,
    CycleKind::Sphere,
];

const fn a_feature(kind: CycleKind) -> &'static str {
    match kind {
        CycleKind::Blocks => "block_1",
        CycleKind::Latency | CycleKind::Touch => "block_1.z",
        CycleKind::Plane => "top",
        CycleKind::Bore => "ring",
        CycleKind::Sphere => "ball",
    }
}

/// Every combination of sensible and extreme counts is refused or planned at once, and never above its bound.
#[test]
fn prop_no_order_makes_more_than_its_bound_of_touches() {
    let counts = [0, 5, 16, 1_000, 10_000, 1_000_000_000, u32::MAX];
    let machine = MachineFile::parse(BENCH, "bench.yaml").unwrap();
    for kind in KINDS {
        let mut taken = 0;
        for points in counts {
            for repeats in counts {
                for n in [1, 7, 1_001] {
                    let order = CycleOrder {
                        points,
                        repeats,
                        features: vec![a_feature(kind).to_owned(); n],
                        ..order(kind)
                    };
                    if let Ok(cycle) = crate::cycle::plan(&machine, &order) {
                        taken += 1;
                        assert!(cycle.touches.len() as u64 <= TOUCHES.greatest());
                        assert!(cycle.program.lines().count() <= 1_000_000);
                    }
                }
            }
        }
        assert!(taken > 2, "{kind:?}: {taken}");
    }
}

#[test]
fn an_order_says_which_number_its_cycle_has_no_use_for() {
    let machine = machine();
    let said = |order: &CycleOrder| crate::cycle::plan(&machine, order).unwrap_err().to_string();
    let two = CycleOrder {
        features: vec!["block_1.z".to_owned(), "x y".to_owned()],
        ..order(CycleKind::Latency)
    };
    assert_eq!(
        said(&two),
        "features: 2 names (block_1.z, x y): a latency cycle touches exactly one feature"
    );
    let none = CycleOrder {
        features: vec![],
        ..order(CycleKind::Latency)
    };
    assert!(said(&none).contains("features: 0 names"));
    for kind in KINDS {
        let unknown = CycleOrder {
            features: vec!["no_such".to_owned()],
            ..order(kind)
        };
        assert!(
            said(&unknown).contains("no_such") || said(&unknown).contains("has no"),
            "{}",
            said(&unknown)
        );
        let fast = CycleOrder {
            feeds_mm_min: vec![120.0, -360.0],
            ..order(kind)
        };
        assert!(
            said(&fast).contains("feeds[1] = -360 mm/min"),
            "{}",
            said(&fast)
        );
        let has_points = matches!(kind, CycleKind::Plane | CycleKind::Bore | CycleKind::Sphere);
        let points = CycleOrder {
            points: 9,
            ..order(kind)
        };
        if !has_points {
            assert!(
                said(&points).starts_with("points = 9: "),
                "{}",
                said(&points)
            );
        }
        let cold = CycleOrder {
            cold: true,
            ..order(kind)
        };
        if kind != CycleKind::Blocks {
            assert!(said(&cold).starts_with("cold = true: "), "{}", said(&cold));
        }
    }
    let many = CycleOrder {
        repeats: 1_000_000_000,
        ..order(CycleKind::Latency)
    };
    assert_eq!(said(&many), "repeats = 1000000000: at most 10000");
}
