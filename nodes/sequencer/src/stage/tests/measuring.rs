//! Steps that a grid encoder, a length reference or scales measure.

use metrology::sample::{Sense, TestPlane};

use super::*;

const BENCH: &str = include_str!("../../../../libraries/machine/tests/data/bench.yaml");

fn plan(steps: &str) -> Result<Sequencer, String> {
    let text = format!("title: test\nsteps:\n{steps}");
    let plan = Plan::from_yaml(&text).map_err(|error| error.to_string())?;
    let machine = MachineFile::parse(BENCH, "bench.yaml").unwrap();
    let programs = BTreeMap::from([("part.ngc".to_owned(), "G0 X1\nM2\n".to_owned())]);
    Sequencer::new(Config::default(), machine, Some(plan), programs)
        .map_err(|error| error.to_string())
}

/// Runs the plan with a controller that ends every program; segments at their begin and the texts.
fn play(steps: &str) -> Vec<(TestSegment, String)> {
    let mut sequencer = plan(steps).unwrap();
    give(&mut sequencer, 0.0, Input::Tick);
    let mut outputs = give(&mut sequencer, 1.0, Input::Tick);
    let mut seen = Vec::new();
    for second in 2..200 {
        let begun = outputs.iter().find_map(|output| match output {
            Output::Segment(segment) if segment.begin => Some(segment.clone()),
            _ => None,
        });
        let sent = outputs.iter().find_map(|output| match output {
            Output::SendProgram { id, text, .. } => Some((*id, text.clone())),
            _ => None,
        });
        let (Some(segment), Some((id, text))) = (begun, sent) else {
            return seen;
        };
        seen.push((segment, text));
        let end = Input::ProgramEnd { id, end: done() };
        outputs = give(&mut sequencer, f64::from(second), end);
    }
    panic!("the plan does not end");
}

fn is_setup((segment, text): &(TestSegment, String)) -> bool {
    segment.kind == TestKind::Production && text.contains("(zero: ")
}

const CIRCLE: &str = "trajectory: circle, feed_mm_min: 1500.0, stations: 36, dwell_s: 1.0";

#[test]
fn recordings_on_one_plate_share_a_zero_until_it_is_set_anew_or_lost() {
    let runs = play(&format!(
        "  - {{do: grid, placement: table, {CIRCLE}, radius_mm: 50.0, sense: both}}\n  \
           - {{do: grid, placement: table, {CIRCLE}, radius_mm: 25.0}}\n  \
           - {{do: grid, placement: table, {CIRCLE}, radius_mm: 25.0, rezero: true}}\n  \
           - {{do: run, program: part.ngc}}\n  \
           - {{do: grid, placement: table, {CIRCLE}, radius_mm: 25.0}}\n  \
           - {{do: grid, placement: upright_x, {CIRCLE}, radius_mm: 25.0, repeats: 2}}\n"
    ));
    let (setups, runs): (Vec<_>, Vec<_>) = runs.into_iter().partition(is_setup);
    let ids: Vec<_> = runs
        .iter()
        .map(|(segment, _)| (segment.zero_id, segment.setup_id, segment.repeat))
        .collect();
    let expected = [
        (1, 1, 0),
        (1, 1, 0),
        (1, 1, 0),
        (2, 1, 0),
        (0, 0, 0),
        (3, 1, 0),
        (4, 2, 0),
        (4, 2, 1),
    ];
    assert_eq!(ids, expected);
    assert!(
        runs.iter()
            .all(|(_, text)| !text.contains("(mount") && !text.contains("(zero"))
    );
    let zeroed: Vec<_> = setups
        .iter()
        .map(|(segment, text)| {
            assert_eq!(text.matches("(zero: grid)").count(), 1);
            (segment.zero_id, segment.setup_id, text.contains("(mount: "))
        })
        .collect();
    assert_eq!(
        zeroed,
        [(1, 1, true), (2, 1, false), (3, 1, false), (4, 2, true)],
        "as many as the recordings' segments say, each before the first of them"
    );
    let (first, _) = &runs[0];
    assert_eq!((first.kind, first.plane), (TestKind::Circle, TestPlane::Xy));
    assert_eq!((first.sense, first.stations), (Sense::CounterClockwise, 36));
    assert_eq!(first.features, ["table"]);
    assert!((first.radius_mm - 50.0).abs() < 1e-12 && (first.feed_mm_s - 25.0).abs() < 1e-12);
    assert_eq!(runs[1].0.sense, Sense::Clockwise);
    let upright = &runs[6].0;
    assert!((upright.tool_offset_mm.x - 40.0).abs() < 1e-12);
    assert!(
        (upright.centre_mm.x - 10.0).abs() < 1e-12,
        "plate less head offset"
    );
}

#[test]
fn a_failed_recording_loses_the_count() {
    let step = format!("{{do: grid, placement: table, {CIRCLE}, radius_mm: 25.0, repeats: 2}}");
    let mut sequencer = plan(&format!("  - {step}\n")).unwrap();
    give(&mut sequencer, 0.0, Input::Tick);
    let (id, _) = sent(&give(&mut sequencer, 1.0, Input::Tick)).unwrap();
    let end = Some(ProgramEnd {
        done: false,
        message: "following error".to_owned(),
    });
    let outputs = give(&mut sequencer, 2.0, Input::ProgramEnd { id, end });
    assert!(outputs.iter().any(|output| matches!(
        output,
        Output::Status(PlanStatus {
            state: PlanState::Failed,
            ..
        })
    )));
    assert_eq!(sent(&outputs), None, "the runs that follow are not begun");
}

#[test]
fn positioning_runs_scans_and_diagonals_are_programs_of_their_own() {
    let runs = play(
        "  - {do: positioning, axis: X, from_mm: -250.0, to_mm: 250.0, spacing_mm: 20.0, runs: 3, \
             dwell_s: 1.0, feed_mm_min: 6000.0, overrun_mm: 5.0, beam: along_x}\n  \
           - {do: positioning, axis: Y, targets_mm: [-100.0, 0.0, 90.0], runs: 1, dwell_s: 1.0, \
             feed_mm_min: 6000.0, overrun_mm: 5.0, at_mm: [0.0, 0.0, 100.0]}\n  \
           - {do: scan, axis: X, from_mm: -200.0, to_mm: 200.0, spacing_mm: 400.0, runs: 1, \
             feed_mm_min: 2000.0, overrun_mm: 20.0, beam: along_x}\n  \
           - {do: diagonals, beams: [corner_to_corner], targets: 7, runs: 2, dwell_s: 1.0, \
             feed_mm_min: 3000.0, overrun_mm: 3.0}\n",
    );
    let runs: Vec<_> = runs.into_iter().filter(|run| !is_setup(run)).collect();
    let seen: Vec<_> = runs
        .iter()
        .map(|(s, _)| {
            (
                s.kind,
                s.features.join(" "),
                s.zero_id,
                s.setup_id,
                s.repeat,
            )
        })
        .collect();
    let expected = [
        (TestKind::Positioning, "X along_x", 1, 1, 0),
        (TestKind::Positioning, "X along_x", 1, 1, 1),
        (TestKind::Positioning, "X along_x", 1, 1, 2),
        (TestKind::Positioning, "Y", 0, 0, 0),
        (TestKind::Line, "X along_x", 2, 1, 0),
        (TestKind::Diagonal, "corner_to_corner", 3, 2, 0),
        (TestKind::Diagonal, "corner_to_corner", 3, 2, 1),
    ]
    .map(|(kind, names, zero, setup, repeat)| (kind, names.to_owned(), zero, setup, repeat));
    assert_eq!(seen, expected);
    assert_eq!(runs[0].0.stations, 52, "26 targets, up and down");
}

#[test]
fn steps_with_missing_or_superfluous_keys_are_refused_before_anything_moves() {
    let told = |step: &str| plan(&format!("  - {{{step}}}\n")).err().unwrap();
    let grid = "do: grid, placement: table, feed_mm_min: 1500.0";
    assert_eq!(
        told(&format!("{grid}, trajectory: circle, on_the_fly: true")),
        "steps[0].radius_mm: missing, a circle needs it"
    );
    assert_eq!(
        told(&format!(
            "{grid}, trajectory: line, angle_deg: 45.0, length_mm: 80.0, radius_mm: 5.0, on_the_fly: true"
        )),
        "steps[0].radius_mm: a line has none"
    );
    assert_eq!(
        told(&format!("{grid}, trajectory: circle, radius_mm: 50.0")),
        "steps[0].stations: missing, a trajectory with stops needs it"
    );
    assert_eq!(
        told(&format!(
            "{grid}, trajectory: circle, radius_mm: 50.0, stations: 36, dwell_s: 1.0, on_the_fly: true"
        )),
        "steps[0].stations: on_the_fly has none"
    );
    assert!(told(&format!("{grid}, trajectory: circle, radios_mm: 50.0")).contains("radios_mm"));
    assert!(told(&format!("{grid}, trajectory: oval")).contains("oval"));
    let run = "do: positioning, axis: X, dwell_s: 1.0, feed_mm_min: 100.0, overrun_mm: 5.0";
    assert_eq!(
        told(&format!(
            "{run}, runs: 0, targets_mm: [0.0, 1.0], at_mm: [0.0, 0.0, 0.0]"
        )),
        "steps[0]: no beam, run or repetition: there is nothing to run"
    );
    assert_eq!(
        told(&format!("{run}, runs: 1, at_mm: [0.0, 0.0, 0.0]")),
        "steps[0].from_mm: missing, a run whose targets are not listed needs it"
    );
    assert_eq!(
        told(&format!("{run}, runs: 1, targets_mm: [0.0, 1.0]")),
        "steps[0].at_mm: missing, a run without a beam needs it"
    );
    assert!(
        told(&format!(
            "{run}, runs: 1, targets_mm: [0.0, 1.0], beam: along_z"
        ))
        .contains("known: along_x, corner_to_corner")
    );
}
