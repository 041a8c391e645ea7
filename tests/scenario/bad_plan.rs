//! Plans that cannot work are refused whole, with step and values, before anything moves.

use std::time::{Duration, Instant};

use abbe_tests::program::{Process, command};
use abbe_tests::scenario::Scenario;

use crate::cell::build;

fn refusal(step: &str) -> String {
    let scenario = Scenario::copy_of("first_run");
    scenario.write(
        "plan.yaml",
        &format!("title: bad\nsteps:\n  - {{do: wait, seconds: 1.0}}\n  - {step}\n"),
    );
    let Err(error) = build(&scenario, "sequencer") else {
        panic!("{step} was not refused");
    };
    let error = format!("{error:#}");
    eprintln!("{error}");
    error
}

#[test]
fn bad_steps_are_refused_with_their_place_and_values() {
    let latency = |feeds: &str, repeats: u32| {
        format!("{{do: latency, feature: block_1.z, feeds_mm_min: [{feeds}], repeats: {repeats}}}")
    };
    for (step, words) in [
        (
            latency("0.0, 240.0", 3),
            &["steps[1]", "feeds_mm_min[0] = 0 mm/min"][..],
        ),
        (
            latency("120.0, -60.0", 3),
            &["steps[1]", "feeds_mm_min[1] = -60 mm/min"],
        ),
        (
            latency(".nan, 240.0", 3),
            &["plan.yaml", "plan.yaml:4:54", ".nan"],
        ),
        (
            latency("60.0, 240.0, 60.0", 3),
            &["steps[1]", "feeds[0] and feeds[2] are both 60 mm/min"],
        ),
        (latency("60.0", 3), &["steps[1]", "1 feeds"]),
        (latency("60.0, 30000.0", 3), &["steps[1]", "30000 mm/min"]),
        (
            "{do: scan, axis: X, from_mm: -50.0, to_mm: 50.0, spacing_mm: 10.0, runs: 1, feed_mm_min: 6000.0, overrun_mm: 2.0, at_mm: [0.0, 0.0, 120.0]}".to_owned(),
            &["steps[1]", "overrun_mm = 2", "6000 mm/min", "must be at least 14.2 mm"],
        ),
        (
            "{do: artefact, id: bore_9, points: 8}".to_owned(),
            &["steps[1]", "bore_9"],
        ),
        (
            "{do: blocks, blocks: [block_7]}".to_owned(),
            &["steps[1]", "block_7"],
        ),
        (
            "{do: produce, program: no.ngc, minutes: 1.0, serve_updates: true}".to_owned(),
            &["steps[1]", "no.ngc", "plan.yaml"],
        ),
        (
            "{do: produce, program: production.ngc, minutes: 0.0, serve_updates: true}".to_owned(),
            &["steps[1].minutes = 0"],
        ),
        (
            "{do: wait, seconds: .nan}".to_owned(),
            &["plan.yaml:4:25", ".nan"],
        ),
        (
            "{do: wait, minutes: 1.0}".to_owned(),
            &["plan.yaml", "minutes"],
        ),
        ("{do: dance}".to_owned(), &["plan.yaml", "dance"]),
    ] {
        let error = refusal(&step);
        assert!(
            words.iter().all(|word| error.contains(word)),
            "{step}: {error}"
        );
    }
}

#[test]
fn a_step_that_touches_nothing_is_refused() {
    let latency = "{do: latency, feature: block_1.z, feeds_mm_min: [60.0, 240.0], repeats: 0}";
    let artefact = "{do: artefact, id: bore_1, points: 0}";
    for (step, key) in [(latency, "repeats"), (artefact, "points")] {
        let said = refusal(step);
        let words = format!("steps[1].{key} = 0: must be above 0");
        assert!(said.contains(&words), "{said}");
    }
}

/// The command line says the same and fails; no bag is begun.
#[test]
fn a_run_with_a_bad_plan_ends_at_once_with_exit_code_1() {
    let scenario = Scenario::copy_of("first_run");
    scenario.replace(
        "plan.yaml",
        "feeds_mm_min: [60.0, 120.0, 240.0, 480.0, 960.0]",
        "feeds_mm_min: [60.0, 60.0]",
    );
    let ended = scenario.run_to_end(&[]);
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    for word in [
        "sequencer",
        "steps[0]",
        "feeds[0] and feeds[1] are both 60 mm/min",
    ] {
        assert!(ended.said.contains(word), "{word}: {}", ended.said);
    }
    // Nor does a folder of a run stay that was none.
    let runs = std::fs::read_dir(scenario.out()).unwrap();
    assert_eq!(runs.count(), 0);
}

/// Running such a plan or looking at it before takes as long as reading it.
const AT_ONCE: Duration = Duration::from_secs(10);

#[test]
fn counts_beyond_their_bound_end_run_and_preflight_at_once_with_line_key_value_and_bound() {
    let grid = "{do: grid, placement: table, trajectory: circle, radius_mm: 100.0, feed_mm_min: 3000.0, on_the_fly: true, repeats: 4000000000}";
    let latency =
        "{do: latency, feature: block_1.z, feeds_mm_min: [120.0, 360.0], repeats: 100000000}";
    let positioning = "{do: positioning, axis: X, targets_mm: [0.0, 50.0, 100.0], runs: 1000000000, dwell_s: 1.0, feed_mm_min: 2000.0, overrun_mm: 5.0, at_mm: [0.0, 0.0, 200.0]}";
    for (step, words) in [
        (grid, "steps[0].repeats = 4000000000: at most 10000"),
        (latency, "steps[0].repeats = 100000000: at most 10000"),
        (positioning, "steps[0].runs = 1000000000: at most 10000"),
    ] {
        let scenario = Scenario::copy_of("cold_reference");
        scenario.write("plan.yaml", &format!("title: t\nsteps:\n  - {step}\n"));
        let folder = scenario.folder().display().to_string();
        let preflight = Process::start(command(0, &["preflight", &folder]));
        for process in [scenario.start(&[]), preflight] {
            let since = Instant::now();
            let ended = process.ended_within(AT_ONCE);
            assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
            let column = |place: &str| place.bytes().all(|byte| byte.is_ascii_digit());
            let placed = ended.said.lines().any(|line| {
                let (_, place) = line.split_once("plan.yaml:3:").unwrap_or_default();
                let at = place.split_once(": ");
                at.is_some_and(|(place, rest)| column(place) && rest.starts_with(words))
            });
            assert!(placed, "{words}: {}", ended.said);
            eprintln!("{words}: {:?}", since.elapsed());
        }
    }
}
