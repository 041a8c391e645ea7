//! `abbe preflight` as a person uses it: what a plan will determine, what to add, and what is wrong with a question.

use std::time::Duration;

use abbe_tests::program::{Ended, Process, command, root};
use abbe_tests::scenario::Scenario;
use serde_json::Value;

fn preflight(arguments: &[&str]) -> Ended {
    let mut command = command(0, &["preflight"]);
    command.args(arguments).current_dir(root());
    Process::start(command).ended_within(Duration::from_secs(300))
}

fn told(arguments: &[&str]) -> Value {
    let mut all = arguments.to_vec();
    all.push("--json");
    let ended = preflight(&all);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let begin = ended.said.find('{').unwrap();
    // The expected time of a long one may stand behind it.
    let mut values = serde_json::Deserializer::from_str(&ended.said[begin..]).into_iter();
    values.next().unwrap().unwrap()
}

fn verdict<'a>(told: &'a Value, name: &str) -> &'a str {
    let all = told["seen"]["coefficients"].as_array().unwrap();
    let found = all.iter().find(|c| c["name"] == name);
    found.unwrap()["verdict"].as_str().unwrap()
}

/// Names of the members of each sum.
fn sums(told: &Value) -> Vec<Vec<&str>> {
    let all = told["seen"]["sums"].as_array().unwrap().iter();
    all.map(|sum| {
        let members = sum["members"].as_array().unwrap().iter();
        members.map(|member| member[1].as_str().unwrap()).collect()
    })
    .collect()
}

#[test]
fn five_places_of_one_head_leave_straightness_and_yaw_together_and_another_head_splits_them() {
    let grid_xy = "launch_configs/grid_xy";
    let one_head = told(&[grid_xy, "--want", "ECY"]);
    // As many as `grid_xy` finds when the plan is run.
    assert_eq!(one_head["seen"]["rank"], 33);
    for name in ["ECX1", "ECX3", "ECY3"] {
        assert_eq!(verdict(&one_head, name), "determined", "{name}");
    }
    assert_eq!(verdict(&one_head, "ECY1"), "only_together");
    assert_eq!(verdict(&one_head, "EZZ1"), "unseen");
    // Tilts act through the height of the plate.
    let together = sums(&one_head);
    for sum in [
        &["EXX1", "EBX1"][..],
        &["EXY2", "EBY2", "ECY1"],
        &["EXY3", "EBY3", "ECY2"],
    ] {
        assert!(
            together.iter().any(|found| found == sum),
            "{sum:?}: {together:?}"
        );
    }
    let beyond = &one_head["wanted"][0]["beyond_what_was_tried"];
    assert_eq!(*beyond, serde_json::json!(["ECY1", "ECY2"]));

    let two_heads = told(&[grid_xy, "--want", "ECY", "--head-offset", "60,0,0"]);
    let wanted = &two_heads["wanted"][0];
    assert_eq!(wanted["beyond_what_was_tried"], serde_json::json!([]));
    assert_eq!(wanted["is_least"], true);
    let add = wanted["add"].as_array().unwrap();
    assert_eq!(add.len(), 2, "{wanted}");
    let other_head = serde_json::json!([60.0, 0.0, 0.0]);
    assert!(
        add.iter()
            .any(|circle| circle["head_offset_mm"] == other_head),
        "{wanted}"
    );
    let known = told(&[grid_xy, "--want", "ECX1"]);
    assert_eq!(known["wanted"][0]["open"], serde_json::json!([]));
}

/// An effect as a name of the isolability matrix.
fn title(effect: &Value) -> String {
    let of = |key: &str| effect[key].as_str().unwrap();
    format!("{} {}", of("effect"), of("axis"))
        .trim_end()
        .to_owned()
}

fn foreseen<'t>(told: &'t Value, name: &str) -> &'t Value {
    let all = told["gap"]["forecast"]["effects"].as_array().unwrap();
    let found = all.iter().find(|effect| title(effect) == name);
    found.unwrap_or_else(|| panic!("no {name}"))
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

/// Names that cannot be told from an effect.
fn alike(effect: &Value) -> Vec<&str> {
    let pairs = effect["alike"].as_array().unwrap().iter();
    pairs.map(|pair| pair[0].as_str().unwrap()).collect()
}

/// One effect of a forecast: a size, what of it stands alone, and what it cannot be told from; as the matrix has it.
fn is_foreseen(told: &Value, effect: &Value) {
    let matrix = &told["gap"]["forecast"]["isolability"];
    let names: Vec<&str> = matrix["names"]
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_str().unwrap())
        .collect();
    let place = |name: &str| names.iter().position(|one| *one == name).unwrap();
    let own = place(&title(effect));
    let [from, sin] = ["found_from", "sin_alone"].map(|key| number(&effect[key]));
    assert!(from > 0.0 && from.is_finite(), "{effect}");
    assert!((0.0..=1.0).contains(&sin), "{effect}");
    assert!(
        (number(&matrix["detectable"][own]) - from).abs() <= 1e-9 * from,
        "{effect}"
    );
    assert!(
        (number(&matrix["sin_alone"][own]) - sin).abs() <= 1e-12,
        "{effect}"
    );
    assert_eq!(matrix["unit"][own], effect["parameter"], "{effect}");
    if let Some(apart) = effect["told_apart_from"].as_f64() {
        assert!((apart * sin - from).abs() <= 1e-9 * from, "{effect}");
    }
    for pair in effect["alike"].as_array().unwrap() {
        let other = pair[0].as_str().unwrap();
        let cos = number(&pair[1]);
        assert!((0.95..=1.0 + 1e-9).contains(&cos), "{effect}");
        assert!(
            (number(&matrix["cos"][own][place(other)]).abs() - cos).abs() < 1e-6,
            "{effect}"
        );
        assert!(
            alike(foreseen(told, other)).contains(&title(effect).as_str()),
            "{effect} {other}"
        );
    }
}

#[test]
fn each_effect_has_the_size_it_shows_from_what_of_it_stands_alone_and_what_it_cannot_be_told_from()
{
    let told = told(&["launch_configs/gap_first"]);
    let effects = told["gap"]["forecast"]["effects"].as_array().unwrap();
    assert!(effects.len() > 40, "{}", effects.len());
    for effect in effects {
        is_foreseen(&told, effect);
    }
    // What the run of this plan really names, at the size that its plant has.
    for (name, seen) in [
        ("backlash X", 6.4),
        ("backlash Y", 0.77),
        ("probe_latency", 3.7),
    ] {
        let effect = foreseen(&told, name);
        assert!(number(&effect["found_from"]) < seen, "{effect}");
    }
    // Over a plate in one place, a bow of Y's guide is its straightness, and angles lean the plate's scales.
    let bow = foreseen(&told, "guide_bow XY");
    assert!(number(&bow["sin_alone"]) < 1e-3, "{bow}");
    assert!(alike(bow).contains(&"straightness XY"), "{bow}");
}

#[test]
fn circles_about_one_place_cannot_tell_squareness_from_the_plates_and_more_runs_show_less_of_it() {
    let scenario = Scenario::copy_of("gap_first");
    let forecast = |sense: &str| {
        let circle = |radius_mm: f64, feed: f64| {
            format!(
                "  - {{do: grid, placement: middle, trajectory: circle, radius_mm: {radius_mm:?}, feed_mm_min: {feed:?}, sense: {sense}, on_the_fly: true, repeats: 3}}\n"
            )
        };
        let steps = [circle(80.0, 2400.0), circle(50.0, 1500.0)].concat();
        scenario.write("plan.yaml", &format!("title: circles\nsteps:\n{steps}"));
        let (plan, machine) = ("plan.yaml", "machine.yaml");
        told(&[
            &scenario.argument(plan),
            "--machine",
            &scenario.argument(machine),
        ])
    };
    let (one, both) = (forecast("ccw"), forecast("both"));
    for told in [&one, &both] {
        let squareness = foreseen(told, "squareness XY");
        assert!(alike(squareness).contains(&"plate_error"), "{squareness}");
        assert!(number(&squareness["sin_alone"]) < 0.1, "{squareness}");
        // A lag makes the same oval, and is told from it by the motors.
        let lag = foreseen(told, "servo_lag X");
        assert!(number(&lag["sin_alone"]) > 0.5, "{lag}");
    }
    for name in ["squareness XY", "servo_lag X", "servo_lag Y"] {
        let [few, many] = [&one, &both].map(|told| number(&foreseen(told, name)["found_from"]));
        eprintln!("{name}: from {few:.4} in one sense, {many:.4} in both");
        assert!(many < 0.9 * few, "{name}: {few} {many}");
    }
}

#[test]
fn a_plan_for_another_control_is_rehearsed_with_the_lag_that_its_own_loops_leave() {
    let ended = preflight(&["launch_configs/linuxcnc_gap"]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    assert!(ended.said.contains("scale.X"), "{}", ended.said);
}

#[test]
fn a_question_that_cannot_be_answered_is_refused_with_its_place_and_value() {
    let grid_xy = "launch_configs/grid_xy";
    for (arguments, words) in [
        (&[grid_xy, "--want", "EQQ"][..], &["--want EQQ", "EXX"][..]),
        (
            &[grid_xy, "--station-uncertainty-um", "-1"],
            &["--station-uncertainty-um -1", "above 0"],
        ),
        (
            &["launch_configs/first_run", "--want", "EXX1"],
            &["launch_configs/first_run", "no grid step"],
        ),
        (
            &["launch_configs/grid_xy/plan.yaml"],
            &["plan.yaml", "--machine FILE is needed"],
        ),
        (
            &[
                "launch_configs/grid_xy/machine.yaml",
                "--machine",
                "launch_configs/grid_xy/machine.yaml",
            ],
            &["plan launch_configs/grid_xy/machine.yaml"],
        ),
    ] {
        let ended = preflight(arguments);
        assert!(!ended.status.success(), "{arguments:?}: {}", ended.said);
        for word in words {
            assert!(ended.said.contains(word), "{arguments:?}: {}", ended.said);
        }
    }
}
