//! Rounds: a node of a running cell is killed with SIGKILL at a random time. The others go on and say so, no axis
//! steps, no process hangs, the killed node joins again, and what was flushed is in the bag.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use abbe_msgs::msg::{AxisCompensation, AxisState, PlanStatus};
use abbe_msgs::topics;
use abbe_tests::drift::DRIFT_M;
use abbe_tests::graph::Graph;
use abbe_tests::namespace;
use abbe_tests::program::domain;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::cell::{Cell, NODES, RATE_LIMIT_M_S, RECORDER};
use crate::recorded::{self, End};

/// Nodes start, meet and work within this time, and are killed anywhere in it, s.
const LATEST_KILL_S: f64 = 9.0;
/// A killed node is started again within this time, s.
const LATEST_RESTART_S: f64 = 3.0;
/// A killed controller is missed when its lease is over, 60 s.
const MISSED: Duration = Duration::from_secs(100);
/// Limit of the compensation's rate, m/s.
const OFFSET_RATE_M_S: f64 = 20e-6;
/// What arrives later than it was sent, s.
const DELAY_S: f64 = 0.1;
/// Friction lets the motors creep behind by less than this, m.
const CREEP_M: f64 = 1e-6;
/// Over which steps of the motors are looked for, s.
const WINDOW_S: f64 = 0.1;

/// What a seed decides.
#[derive(Debug)]
struct Draw {
    victim: &'static str,
    works: bool,
    kill_after: Duration,
    restart_after: Duration,
}

fn draw(seed: u64) -> Draw {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let place = rng.random_range(0..=NODES.len());
    Draw {
        victim: NODES.get(place).copied().unwrap_or(RECORDER),
        works: rng.random_bool(0.5),
        kill_after: Duration::from_secs_f64(rng.random_range(0.05..LATEST_KILL_S)),
        restart_after: Duration::from_secs_f64(rng.random_range(0.0..LATEST_RESTART_S)),
    }
}

/// Runs rounds with the seeds from `first` on, where `victims` are named with those that draw one of them; true when all passed.
pub fn run(rounds: u64, first: u64, victims: &[&str]) -> bool {
    let known = |victim: &&str| NODES.contains(victim) || *victim == RECORDER;
    assert!(
        victims.iter().all(known),
        "not all of {victims:?} are nodes of the cell"
    );
    let is_wanted = |seed: &u64| victims.is_empty() || victims.contains(&draw(*seed).victim);
    let mut failed = Vec::new();
    let seeds = (first..).filter(is_wanted);
    for seed in seeds.take(usize::try_from(rounds).unwrap()) {
        let began = Instant::now();
        let Some(outcome) = namespace::alone("kills", || {
            // The recorder's tap is the thirteenth participant.
            namespace::multicast_on_loopback();
            catch_unwind(AssertUnwindSafe(|| round(&draw(seed)))).map_err(|panic| {
                let text = panic.downcast_ref::<String>().cloned();
                let text = text.or_else(|| panic.downcast_ref::<&str>().map(|&s| s.to_owned()));
                text.unwrap_or_else(|| "a panic without words".to_owned())
            })
        }) else {
            return true;
        };
        let took_s = began.elapsed().as_secs_f64();
        match outcome {
            Ok(compared) => {
                eprintln!("round {seed}: passed in {took_s:.1} s, {compared} messages compared");
            }
            Err(reason) => {
                eprintln!("round {seed}: FAILED after {took_s:.1} s: {reason}");
                failed.push((seed, reason));
            }
        }
    }
    let passed = rounds - failed.len() as u64;
    eprintln!("kills: {passed} of {rounds} rounds passed");
    for (seed, reason) in &failed {
        let draw = draw(*seed);
        eprintln!("  round {seed} ({draw:?}): {reason}");
    }
    failed.is_empty()
}

/// One round; gives how many messages of bags were compared.
fn round(draw: &Draw) -> usize {
    eprintln!("{draw:?}");
    let began = Instant::now();
    let mut cell = Cell::launch_all(draw.works, domain(9));
    std::thread::sleep(draw.kill_after.saturating_sub(began.elapsed()));
    let before = Before::of(&cell.graph, began);
    let killed = cell.kill(draw.victim);
    cell.others_go_on(killed);
    said_so(&cell.graph, draw.victim, &before, killed);
    std::thread::sleep(draw.restart_after.saturating_sub(killed.elapsed()));
    let restarted = Instant::now();
    cell.launch(draw.victim);
    joined_again(&mut cell, draw, &before, restarted);
    cell.compensated(restarted);
    if draw.victim == RECORDER {
        // Something has to be in the second bag.
        std::thread::sleep(Duration::from_secs(2));
    }
    let stopped = cell.stop();
    no_offset_stepped(&cell.graph, began, restarted, draw.victim);
    if !draw.works {
        no_motor_stepped(&cell.graph, began);
    }
    let mut compared = 0;
    let bags = cell.bags();
    for (place, bag) in bags.iter().enumerate() {
        let is_last = place + 1 == bags.len();
        let (until, end) = if is_last {
            (stopped, End::Stopped)
        } else {
            (killed, End::Killed)
        };
        compared += recorded::check(bag, &cell.graph, began, until, end);
    }
    assert!(compared > 100, "only {compared} messages were compared");
    cell.leave();
    compared
}

/// What the graph was like before the kill.
struct Before {
    offset: bool,
    compensation: bool,
    program: bool,
}

impl Before {
    fn of(graph: &Graph, began: Instant) -> Self {
        let compensations = graph.since(&topics::COMPENSATION, began);
        let last = compensations.last();
        let status = graph.since(&topics::PLAN_STATUS, began);
        Self {
            offset: last.is_some_and(|(_, m)| m.total.iter().any(|total| total.abs() > 1e-6)),
            compensation: last.is_some(),
            program: status.last().is_some_and(|(_, status)| status.run > 0),
        }
    }
}

/// Those who miss the killed node say so.
fn said_so(graph: &Graph, victim: &str, before: &Before, killed: Instant) {
    if victim == "axis_compensation" && before.offset {
        let words = ["no compensation for", "fading"];
        graph.condition("fake_cnc", "compensation_input", &words, killed);
    }
    if victim == "fake_cnc" && before.compensation {
        let words = ["no axis state for"];
        graph.condition("axis_compensation", "axis_states", &words, killed);
    }
}

/// The node is there again, and its part of the cell works.
fn joined_again(cell: &mut Cell, draw: &Draw, before: &Before, restarted: Instant) {
    let victim = draw.victim;
    cell.graph.alive(victim, restarted);
    match victim {
        "fake_cnc" => {
            cell.graph.next(&topics::AXES_STATE, restarted, |_| true);
            if draw.works {
                plan_ends_or_moves(&cell.graph, before, restarted);
            }
        }
        "axis_compensation" => {
            let first = cell.graph.next(&topics::COMPENSATION, restarted, |_| true);
            let mut totals = first.total.iter();
            assert!(totals.all(|total| total.abs() < 1e-6), "{first:?}");
        }
        "sequencer" => {
            let running = PlanStatus::STATE_RUNNING;
            let is_told = |status: &PlanStatus| status.state == running;
            cell.graph.next(&topics::PLAN_STATUS, restarted, is_told);
        }
        "mtconnect_bridge" => cell.reported(restarted),
        "replayer" => {
            cell.graph.next(&topics::GRID_POSITION, restarted, |_| true);
        }
        _ => {}
    }
    cell.others_go_on(restarted);
}

/// The plan fails and says why, or its program runs on the controller that came back.
fn plan_ends_or_moves(graph: &Graph, before: &Before, restarted: Instant) {
    let patience = if before.program {
        MISSED
    } else {
        Duration::from_secs(30)
    };
    let what = "the plan fails with a reason, or the axes move";
    let word = graph.wait_longer(patience, what, |graph| {
        let all = graph.since(&topics::PLAN_STATUS, restarted);
        let failed = all
            .into_iter()
            .find(|(_, status)| status.state == PlanStatus::STATE_FAILED);
        if let Some((_, status)) = failed {
            return Some(status.message);
        }
        let states = graph.since(&topics::AXES_STATE, restarted);
        let speed = states.last()?.1.velocity.iter().map(|v| v.abs());
        let moves = speed.fold(0.0, f64::max) > 1e-3;
        moves.then(|| "the axes move".to_owned())
    });
    eprintln!("{word}");
    let words = ["vanished", "no controller took", "move"];
    assert!(words.iter().any(|w| word.contains(w)), "{word}");
}

/// Offsets go from message to message no further than the limiter's rate allows, and begin at zero.
fn no_offset_stepped(graph: &Graph, began: Instant, restarted: Instant, victim: &str) {
    let all = graph.since(&topics::COMPENSATION, began);
    assert!(!all.is_empty());
    let restarts = |at: Instant| victim == "axis_compensation" && at >= restarted;
    let mut before: Option<&(Instant, AxisCompensation)> = None;
    for next in &all {
        let from = before.filter(|(at, _)| restarts(*at) == restarts(next.0));
        for (axis, total) in next.1.total.iter().enumerate() {
            let from_m = from.map_or(0.0, |(_, message)| message.total[axis]);
            let step_m = (total - from_m).abs();
            // Where the first that is heard is not the first that was sent, the node has had the time since it started.
            let start = if restarts(next.0) { restarted } else { began };
            let since = from.map_or(start, |(at, _)| *at);
            let passed_s = next.0.duration_since(since).as_secs_f64();
            let limit_m = OFFSET_RATE_M_S * (DELAY_S + 2.0 * passed_s);
            assert!(step_m <= limit_m, "axis {axis}: {step_m} m in {passed_s} s");
            assert!(total.abs() <= DRIFT_M * 1.01, "axis {axis}: {total} m");
        }
        before = Some(next);
    }
}

/// Motor minus commanded of a machine at rest moves no faster than fake_cnc's own limit.
fn no_motor_stepped(graph: &Graph, began: Instant) {
    let states: Vec<AxisState> = graph
        .since(&topics::AXES_STATE, began)
        .into_iter()
        .map(|(_, state)| state)
        .collect();
    let at_s = |state: &AxisState| {
        f64::from(state.controller_stamp.sec) + f64::from(state.controller_stamp.nanosec) * 1e-9
    };
    let added_m = |state: &AxisState, axis: usize| state.motor[axis] - state.commanded[axis];
    let limit_m = RATE_LIMIT_M_S * WINDOW_S + CREEP_M;
    for (place, state) in states.iter().enumerate() {
        let later = states[place + 1..]
            .iter()
            .take_while(|later| (0.0..=WINDOW_S).contains(&(at_s(later) - at_s(state))));
        for later in later {
            for axis in 0..3 {
                let moved_m = (added_m(later, axis) - added_m(state, axis)).abs();
                assert!(moved_m <= limit_m, "motor {axis} stepped by {moved_m} m");
            }
        }
    }
}
