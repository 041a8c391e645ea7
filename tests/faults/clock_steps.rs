//! The computer's clock is set under a working cell, as NTP does: no axis steps, every node goes on and says so, and the
//! bag holds what was said.

use std::time::{Duration, Instant};

use abbe_msgs::msg::{AxisCompensation, AxisState, BlockMeasurement, PlanStatus};
use abbe_msgs::topics;
use abbe_tests::computer_clock::Faketime;
use abbe_tests::graph::{Graph, Voice, port};
use abbe_tests::namespace;
use abbe_tests::program::domain;

use crate::bag_of_steps;
use crate::offsets::steps;
use crate::said::model;
use crate::stepped_cell::{Cell, seconds};

/// Drift of every axis, m.
const DRIFT_M: f64 = 20e-6;
/// How near an offset is to what is wanted, m; the motors creep.
const NEAR_M: f64 = 0.2e-6;
const NEAR_MOTORS_M: f64 = 1.5e-6;
/// Rate at which fake_cnc follows an offset at most, here, m/s, and what friction lets the motors creep, m.
const FOLLOW_M_S: f64 = 25e-6;
const CREEP_M: f64 = 1e-6;
/// Over which steps of the motors are looked for, s.
const WINDOW_S: f64 = 0.1;
/// Steps of the clock, s: forward, and back by more.
const FORWARD_S: i64 = 30;
const BACK_S: i64 = 60;
/// What a cell is watched for after a step.
const WATCH: Duration = Duration::from_secs(3);

const BLOCKS: [(&str, [f64; 3]); 2] = [
    ("block_1", [-0.22, -0.18, 0.02]),
    ("block_2", [0.22, 0.18, 0.2]),
];

/// Says both blocks as a cycle measures them; the first is cold.
fn measure(cell: &Cell, voice: &mut Voice, run: u32) {
    let at = cell.now();
    for (id, position_m) in BLOCKS {
        let drift_m = if run == 1 { 0.0 } else { DRIFT_M };
        let mut block = BlockMeasurement::default();
        block.header.stamp = at.clone();
        block.block_id = id.to_owned();
        block.position_m = position_m.map(|m| m + drift_m);
        block.standard_uncertainty_m = [3e-7; 3];
        block.touched = [at.clone(), at.clone(), at.clone()];
        block.cold = run == 1;
        block.run = run;
        voice.say(0, &block);
    }
}

/// Whether every axis has the offset `wanted_m`.
fn has(message: &AxisCompensation, wanted_m: f64) -> bool {
    let mut totals = message.total.iter();
    totals.all(|total| (total - wanted_m).abs() < NEAR_M)
}

fn added_m(state: &AxisState, axis: usize) -> f64 {
    state.motor[axis] - state.commanded[axis]
}

fn motors_have(state: &AxisState, wanted_m: f64) -> bool {
    (0..3).all(|axis| (added_m(state, axis) - wanted_m).abs() < NEAR_MOTORS_M)
}

/// Waits until offsets and motors are there and what is followed is said; s since `since`.
fn at_offset(graph: &Graph, wanted_m: f64, since: Instant) -> f64 {
    let last_has = |graph: &Graph| {
        let all = graph.since(&topics::COMPENSATION, since);
        let states = graph.since(&topics::AXES_STATE, since);
        let is_there = has(&all.last()?.1, wanted_m) && motors_have(&states.last()?.1, wanted_m);
        is_there.then_some(())
    };
    graph.wait(&format!("offset and motors at {wanted_m} m"), last_has);
    since.elapsed().as_secs_f64()
}

/// No offset leaves the whole drift.
fn offsets_stay(graph: &Graph, since: Instant) {
    for (at, message) in graph.since(&topics::COMPENSATION, since) {
        let after_s = at.duration_since(since).as_secs_f64();
        assert!(has(&message, DRIFT_M), "after {after_s} s: {message:?}");
    }
}

/// No motor leaves it either.
fn motors_stay(graph: &Graph, since: Instant) {
    for (at, state) in graph.since(&topics::AXES_STATE, since) {
        let after_s = at.duration_since(since).as_secs_f64();
        assert!(motors_have(&state, DRIFT_M), "after {after_s} s: {state:?}");
    }
}

/// Motor minus commanded moves no faster than fake_cnc's own limit, by the controller's clock; the fastest, m.
fn no_motor_stepped(graph: &Graph, since: Instant) -> f64 {
    let states = graph.since(&topics::AXES_STATE, since);
    let states: Vec<AxisState> = states.into_iter().map(|(_, state)| state).collect();
    let at_s = |state: &AxisState| seconds(&state.controller_stamp);
    let mut worst_m = 0.0_f64;
    for (place, state) in states.iter().enumerate() {
        let following = states[place + 1..]
            .iter()
            .take_while(|later| (0.0..=WINDOW_S).contains(&(at_s(later) - at_s(state))));
        for later in following {
            for axis in 0..3 {
                worst_m = worst_m.max((added_m(later, axis) - added_m(state, axis)).abs());
            }
        }
    }
    let limit_m = FOLLOW_M_S * WINDOW_S + CREEP_M;
    assert!(worst_m <= limit_m, "a motor moved by {worst_m} m");
    worst_m
}

/// The controller's own clock went on all the time, whatever the computer's showed.
fn controller_went_on(graph: &Graph, since: Instant) {
    let states = graph.since(&topics::AXES_STATE, since);
    for pair in states.windows(2) {
        let [before, after] =
            [&pair[0].1, &pair[1].1].map(|state| seconds(&state.controller_stamp));
        assert!((0.0..1.0).contains(&(after - before)), "{before} {after}");
    }
}

/// The plan rests as it was told.
fn plan_goes_on(graph: &Graph, began: Instant) {
    let all = graph.since(&topics::PLAN_STATUS, began);
    let (_, last) = all.last().unwrap();
    assert_eq!(last.state, PlanStatus::STATE_RUNNING, "{last:?}");
}

#[test]
fn a_cell_whose_clock_is_set_forward_and_back_keeps_its_offsets_and_says_so() {
    let test = "a cell whose computer's clock is set";
    let Some(faketime) = Faketime::found(test) else {
        return;
    };
    namespace::alone(test, || {
        let mut cell = Cell::new(&faketime, domain(9));
        let mut voice = cell.graph.voice(&[port(&topics::BLOCKS_MEASUREMENT)]);
        let began = Instant::now();
        let nodes = [
            "fake_cnc",
            "probe",
            "thermal_model",
            "axis_compensation",
            "sequencer",
        ];
        cell.launch(&nodes);
        measure(&cell, &mut voice, 1);
        let mut run = 1;
        cell.graph.wait("the whole offset", |graph| {
            run += 1;
            measure(&cell, &mut voice, run);
            std::thread::sleep(Duration::from_millis(500));
            let all = graph.since(&topics::COMPENSATION, began);
            has(&all.last()?.1, DRIFT_M).then_some(())
        });
        at_offset(&cell.graph, DRIFT_M, Instant::now());
        let forward = cell.step_clock(FORWARD_S);
        set_forward(&mut cell, forward);
        measured_again(&cell, &mut voice, run + 1);
        let back = cell.step_clock(-BACK_S);
        set_back(&mut cell, back);
        measured_again(&cell, &mut voice, run + 2);
        plan_goes_on(&cell.graph, began);
        let stopped = cell.stop();
        voice.stop();
        let (worst_m, offsets) = steps(&cell.graph, began);
        let moved_m = no_motor_stepped(&cell.graph, began);
        controller_went_on(&cell.graph, began);
        eprintln!(
            "{offsets} offsets, largest step {:.4} um; motors at most {:.3} um in {WINDOW_S} s",
            worst_m * 1e6,
            moved_m * 1e6
        );
        bag_of_steps::check(&cell, began, back, stopped, BACK_S as f64);
    });
}

/// The machine lives what the clock left out at once, and follows its offsets again afterwards.
fn set_forward(cell: &mut Cell, forward: Instant) {
    cell.goes_on(forward);
    let graph = &cell.graph;
    // Which of its two reasons it says depends on whether an offset of before the step was still under way.
    let said =
        |words: &[&str]| graph.hears_condition("fake_cnc", "compensation_input", words, forward);
    graph.wait("fake_cnc without offsets", |_| {
        let silent = said(&["no compensation for", "fading"]);
        silent.or_else(|| said(&["is stamped", "s ago", "refused"]))
    });
    let after_s = at_offset(graph, DRIFT_M, forward);
    eprintln!("set forward by {FORWARD_S} s: motors at their offset after {after_s:.1} s");
    std::thread::sleep(WATCH);
    offsets_stay(graph, forward);
}

/// The model in use lies in the future until thermal_model has moved it: meanwhile the offsets are held.
fn set_back(cell: &mut Cell, back: Instant) {
    cell.goes_on(back);
    cell.said_set_back(BACK_S as f64, back);
    let graph = &cell.graph;
    let words = ["valid only in"];
    graph.condition("axis_compensation", "axis_x", &words, back);
    graph.condition("thermal_model", "clock", &["clock went back by"], back);
    graph.condition("fake_cnc", "time", &["went back by", "goes on"], back);
    graph.wait("offsets that follow the model again", |graph| {
        let all = graph.since(&topics::COMPENSATION, back);
        let mut states = all.last()?.1.state.iter();
        let is_active = states.all(|state| *state == AxisCompensation::STATE_ACTIVE);
        is_active.then_some(())
    });
    let after_s = back.elapsed().as_secs_f64();
    eprintln!("set back by {BACK_S} s: the model is followed again after {after_s:.1} s");
    std::thread::sleep(WATCH);
    offsets_stay(graph, back);
    motors_stay(graph, back);
}

/// A new cycle is taken, by the clock as it is set, and changes no offset.
fn measured_again(cell: &Cell, voice: &mut Voice, run: u32) {
    let since = Instant::now();
    measure(cell, voice, run);
    let now_s = seconds(&cell.now());
    let updated = cell.graph.next(&topics::THERMAL_MODEL, since, |_| true);
    let age_s = now_s - seconds(&updated.header.stamp);
    assert!(age_s.abs() < 5.0, "{age_s} s old: {updated:?}");
    // On its way to axis_compensation.
    std::thread::sleep(Duration::from_secs(1));
    offsets_stay(&cell.graph, since);
}

/// Time for which a refused model is held here, and in which it then fades.
const HOLD: &str = "hold_s: 4.0";

#[test]
fn under_a_clock_that_is_set_back_before_its_model_the_offset_fades_and_comes_back_with_the_next() {
    let test = "a cell whose model lies in the future";
    let Some(faketime) = Faketime::found(test) else {
        return;
    };
    namespace::alone(test, || {
        let mut cell = Cell::new(&faketime, domain(10));
        cell.scenario
            .replace("axis_compensation.yaml", "hold_s: 60.0", HOLD);
        // A control that leaves out what its host's clock leaves out.
        cell.scenario
            .append("fake_cnc.yaml", "    longest_catch_up_s: 5.0\n");
        let mut voice = cell.graph.voice(&[port(&topics::THERMAL_MODEL)]);
        let began = Instant::now();
        cell.launch(&["fake_cnc", "axis_compensation"]);
        let mut say = |cell: &Cell, sequence| voice.say(0, &same_everywhere(cell, sequence));
        say(&cell, 1);
        at_offset(&cell.graph, DRIFT_M, began);
        let forward = cell.step_clock(FORWARD_S);
        cell.goes_on(forward);
        let words = ["time jumped by", "skipped"];
        cell.graph.condition("fake_cnc", "time", &words, forward);
        std::thread::sleep(WATCH);
        offsets_stay(&cell.graph, forward);
        motors_stay(&cell.graph, forward);
        say(&cell, 2);
        std::thread::sleep(Duration::from_secs(1));
        let back = cell.step_clock(-BACK_S);
        cell.goes_on(back);
        cell.said_set_back(BACK_S as f64, back);
        faded(&cell.graph, back);
        let next = Instant::now();
        say(&cell, 3);
        let after_s = at_offset(&cell.graph, DRIFT_M, next);
        eprintln!("at their offset {after_s:.1} s after a model of the clock as it is");
        cell.stop();
        voice.stop();
        let (worst_m, offsets) = steps(&cell.graph, began);
        let moved_m = no_motor_stepped(&cell.graph, began);
        controller_went_on(&cell.graph, began);
        eprintln!(
            "{offsets} offsets, largest step {:.4} um; motors at most {:.3} um in {WINDOW_S} s",
            worst_m * 1e6,
            moved_m * 1e6
        );
    });
}

/// A model that gives every axis the drift, as the computer of the cell would stamp it.
fn same_everywhere(cell: &Cell, sequence: u32) -> abbe_msgs::msg::ThermalModel {
    let mut said = model(&cell.now(), 0.0);
    said.sequence = sequence;
    for axis in &mut said.axes {
        axis.k0_m = DRIFT_M;
        axis.measured = said.header.stamp.clone();
    }
    said
}

/// The offset is held for its time, then goes to zero, and the reason is said.
fn faded(graph: &Graph, back: Instant) {
    let words = ["valid only in"];
    graph.condition("axis_compensation", "axis_x", &words, back);
    let after_s = at_offset(graph, 0.0, back);
    eprintln!("set back before its model: faded out after {after_s:.1} s");
    let all = graph.since(&topics::COMPENSATION, back);
    let left = all.iter().find(|(_, message)| !has(message, DRIFT_M));
    let held = left.unwrap().0.duration_since(back);
    assert!(held > Duration::from_secs(3), "held for {held:?}");
    let mut states = all.iter().flat_map(|(_, message)| &message.state);
    assert!(states.any(|state| *state == AxisCompensation::STATE_FADING));
}
