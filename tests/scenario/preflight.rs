//! `abbe preflight` as a person uses it: what a plan will determine, what to add, and what is wrong with a question.

use std::time::Duration;

use abbe_tests::program::{Ended, Process, command, root};
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
    serde_json::from_str(&ended.said[begin..]).unwrap()
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
