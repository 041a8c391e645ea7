//! From what was heard to the parts of the page.

use std::collections::BTreeMap;

use live_view::{Condition, Input, LiveViewStage, MOST_NAMES, MOST_TOUCHES, Output};
use metrology::sample::{
    AxisCompensation, AxisState, CompensationState, Correction, PlanState, PlanStatus, ProbedPoint,
    Rejection, TemperatureSample,
};
use metrology::stamp::{Host, Span};
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};
use nalgebra::Vector3;
use serde_json::{Value, json};

fn at_ms(ms: i64) -> Stamp<Host> {
    Stamp::from_nanos(ms * 1_000_000)
}

/// A page whose values are stale after 5 s, with a limit of X.
fn page() -> LiveViewStage {
    LiveViewStage::new(
        Span::from_nanos(5_000_000_000),
        BTreeMap::from([(Axis::X, 150.0)]),
    )
}

fn hear(page: &mut LiveViewStage, ms: i64, input: Input) {
    let mut out = Vec::new();
    page.step(at_ms(ms), input, &mut out).unwrap();
    assert_eq!(out, [], "only a look says something");
}

/// The parts that have changed by then.
fn look(page: &mut LiveViewStage, ms: i64) -> BTreeMap<&'static str, Value> {
    let mut out = Vec::new();
    page.step(at_ms(ms), Input::Look, &mut out).unwrap();
    let one = |Output::Changed { part, json }: Output| (part, serde_json::from_str(&json).unwrap());
    out.into_iter().map(one).collect()
}

fn axes(x_mm: f64) -> Input {
    let mut state = AxisState::standing(
        at_ms(1_000),
        Stamp::from_nanos(0),
        AxisSet::XYZ,
        PerAxis([x_mm, 2.0, 3.0, 0.0, 0.0, 0.0]),
    );
    state.scale[Axis::X] = x_mm + 0.001;
    Input::Axes(state)
}

fn reading(sensor: &str, degc: f64) -> Input {
    Input::Temperature(TemperatureSample {
        at: at_ms(1_000),
        sensor: sensor.to_owned(),
        temperature_degc: degc,
        variance_k2: 0.0,
    })
}

#[test]
fn of_a_thousand_positions_the_last_is_said_once_with_its_numbers() {
    let mut page = page();
    for n in 0..1000 {
        hear(&mut page, 1_000, axes(f64::from(n) / 7.0));
    }
    let changed = look(&mut page, 1_100);
    let x = &changed["axes"]["axes"][0];
    assert_eq!(x["axis"], "X");
    assert_eq!(x["commanded"].as_f64(), Some(999.0 / 7.0));
    assert_eq!(x["scale"].as_f64(), Some(999.0 / 7.0 + 0.001));
    assert_eq!(changed["axes"]["axes"][1]["scale"], Value::Null);
    assert_eq!(
        look(&mut page, 1_300),
        BTreeMap::new(),
        "nothing has changed"
    );
    hear(&mut page, 1_400, reading("bed", 20.5));
    let changed = look(&mut page, 1_500);
    assert_eq!(changed.keys().collect::<Vec<_>>(), [&"temperatures"]);
}

#[test]
fn an_offset_stands_beside_its_parts_and_its_limit() {
    let mut page = page();
    let mut state = PerAxis::from_fn(|_| CompensationState::Off);
    state[Axis::X] = CompensationState::Limited;
    let part = |um: f64| PerAxis([um / 1000.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let offsets = AxisCompensation {
        at: at_ms(900),
        axes: AxisSet::XYZ,
        total: part(150.0),
        thermal: part(140.0),
        geometric: part(20.0),
        positioning: part(-5.0),
        pulses: PerAxis::default(),
        remainder: PerAxis::default(),
        state,
    };
    hear(&mut page, 1_000, Input::Offsets(offsets));
    let x = look(&mut page, 1_000)["offsets"]["axes"][0].clone();
    let expected = json!({
        "axis": "X", "unit": "mm", "total": 0.15, "thermal": 0.14, "geometric": 0.02, "positioning": -0.005,
        "limit_um": 150.0, "state": "limited",
    });
    assert_eq!(x, expected);
}

#[test]
fn a_periodic_value_is_stale_since_it_was_heard_last_and_fresh_again_with_the_next() {
    let mut page = page();
    hear(&mut page, 1_000, axes(1.0));
    hear(&mut page, 1_000, reading("bed", 20.0));
    let changed = look(&mut page, 6_000);
    assert_eq!(changed["axes"]["stale_since_ms"], Value::Null);
    let changed = look(&mut page, 6_001);
    assert_eq!(changed["axes"]["stale_since_ms"], 1_000);
    assert_eq!(changed["temperatures"][0]["stale_since_ms"], 1_000);
    assert_eq!(look(&mut page, 9_000), BTreeMap::new());
    hear(&mut page, 9_100, axes(1.0));
    let changed = look(&mut page, 9_200);
    assert_eq!(changed["axes"]["stale_since_ms"], Value::Null);
    assert!(!changed.contains_key("temperatures"), "still stale");
}

#[test]
fn a_condition_stands_with_its_begin_until_it_is_over_and_the_worst_is_first() {
    let mut page = page();
    let condition = |name: &str, level, message: &str| {
        Input::Condition(Condition {
            name: name.to_owned(),
            level,
            message: message.to_owned(),
        })
    };
    hear(&mut page, 1_000, condition("/a: old", 1, "first"));
    hear(&mut page, 2_000, condition("/b: lost", 2, "gone"));
    hear(&mut page, 3_000, condition("/a: old", 1, "second"));
    let stands = look(&mut page, 3_000)["conditions"].clone();
    let expected = json!([
        {"name": "/b: lost", "level": "error", "message": "gone", "since_ms": 2_000},
        {"name": "/a: old", "level": "warning", "message": "second", "since_ms": 1_000},
    ]);
    assert_eq!(stands, expected);
    hear(&mut page, 4_000, condition("/b: lost", 0, "over"));
    hear(&mut page, 4_000, condition("/a: old", 0, "over"));
    assert_eq!(look(&mut page, 4_000)["conditions"], json!([]));
}

#[test]
fn what_strangers_send_without_end_is_not_kept_and_is_counted() {
    let mut page = page();
    for n in 0..MOST_NAMES + 3 {
        let (name, message) = (format!("/x: {n}"), "ä".repeat(5_000));
        let level = 1;
        hear(
            &mut page,
            1_000,
            Input::Condition(Condition {
                name,
                level,
                message,
            }),
        );
    }
    for n in 0..MOST_NAMES + 4 {
        hear(&mut page, 1_000, reading(&format!("s{n}"), 20.0));
    }
    let changed = look(&mut page, 1_000);
    assert_eq!(changed["conditions"].as_array().unwrap().len(), MOST_NAMES);
    assert_eq!(
        changed["temperatures"].as_array().unwrap().len(),
        MOST_NAMES
    );
    assert_eq!(changed["trouble"]["left_out"], 7);
    let message = changed["conditions"][0]["message"].as_str().unwrap();
    assert!(message.ends_with("… (4000 more characters)"), "{message}");
}

#[test]
fn what_cannot_be_used_is_said_with_its_count() {
    let mut page = page();
    for reason in ["first", "last"] {
        let (topic, reason) = ("axes/state".to_owned(), reason.to_owned());
        hear(&mut page, 1_000, Input::Refused { topic, reason });
    }
    let expected = json!({"refused": [{"topic": "axes/state", "messages": 2, "reason": "last"}], "left_out": 0});
    assert_eq!(look(&mut page, 1_000)["trouble"], expected);
}

#[test]
fn the_newest_touches_are_kept_and_a_rejected_one_says_why() {
    let mut page = page();
    for n in 0..MOST_TOUCHES as u32 + 5 {
        let touch = ProbedPoint {
            received_at: at_ms(1_000 + i64::from(n)),
            feature_id: "block_1.z".to_owned(),
            axes_at_contact: PerAxis::default(),
            axes: AxisSet::XYZ,
            point_in_machine_mm: Vector3::new(1.0, 2.0, f64::from(n)),
            point_in_workpiece_mm: Vector3::zeros(),
            applied_latency_s: 0.002,
            correction: Correction::Queue,
            standard_uncertainty_mm: 0.0005,
            approach: -Vector3::z(),
            feed_mm_s: 2.0,
            rejection: if n == 24 {
                Rejection::Gap
            } else {
                Rejection::None
            },
            sequence: n,
        };
        hear(&mut page, 1_000, Input::Touch(touch));
    }
    let touches = look(&mut page, 1_000)["touches"].clone();
    assert_eq!(touches.as_array().unwrap().len(), MOST_TOUCHES);
    assert_eq!(touches[0]["z_mm"].as_f64(), Some(24.0));
    assert_eq!(
        touches[0]["rejected"],
        "positions are missing at the contact"
    );
    assert_eq!(touches[1]["rejected"], Value::Null);
}

/// The plan at a share of step 2, the time of the message.
fn plan(step: u32, ms: i64, progress: f64) -> Input {
    Input::Plan(PlanStatus {
        at: at_ms(ms),
        state: PlanState::Running,
        step,
        steps: 4,
        activity: "warm-up".to_owned(),
        run: 3,
        progress,
        message: String::new(),
    })
}

#[test]
fn eq1_the_time_left_of_a_step_follows_from_its_share_by_the_time_of_its_messages() {
    let mut page = page();
    hear(&mut page, 50, plan(2, 10_000, 0.0));
    assert_eq!(look(&mut page, 50)["plan"]["step_left_s"], Value::Null);
    hear(&mut page, 60, plan(2, 40_000, 0.25));
    let shown = look(&mut page, 60)["plan"].clone();
    assert_eq!(shown["step_left_s"].as_f64(), Some(90.0));
    assert_eq!(shown["steps"], 4);
    hear(&mut page, 70, plan(3, 60_000, 0.5));
    assert_eq!(
        look(&mut page, 70)["plan"]["step_left_s"],
        Value::Null,
        "it begins anew"
    );
}
