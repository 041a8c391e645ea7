//! Whatever is said to the two nodes that move axes, no axis steps.

use std::time::{Duration, Instant};

use abbe_msgs::msg::{AxisCompensation, AxisState};
use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::{to_cdr, topics};
use abbe_tests::graph::{Graph, Voice, now, port};
use abbe_tests::namespace;
use abbe_tests::program::{Process, domain};
use abbe_tests::said::compensation;
use abbe_tests::scenario::Scenario;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::said::{later, model, state};

/// Between two messages of a voice.
const BEAT: Duration = Duration::from_millis(10);
const BEAT_NANOS: i64 = 10_000_000;
/// How long each fault goes on.
const FAULT: Duration = Duration::from_millis(1500);
/// Limit of the compensation's rate in these scenarios, m/s.
const RATE_M_S: f64 = 20e-6;
/// What a message's stamp may be ahead of the one before, beside the time that passed between them, s.
const SHUFFLED_S: f64 = 0.1;
/// How long after a silence messages come that were made during it.
const RECENT: Duration = Duration::from_secs(1);
/// Drift per length: 20 um at X = 200 mm.
const SLOPE: f64 = 1e-4;
const SECOND_NANOS: i64 = 1_000_000_000;

/// Says what `form` makes of the time, at an even pace, while `time` passes.
fn keep_saying(time: Duration, mut form: impl FnMut(u64)) {
    let began = Instant::now();
    let mut beat = 0;
    while began.elapsed() < time {
        form(beat);
        beat += 1;
        std::thread::sleep(BEAT);
    }
}

/// Checks that no offset changes faster than its limit; gives the largest change from one message to the next, m, and
/// how many there were. Messages that come at once after a silence were made during it.
pub fn steps(graph: &Graph, since: Instant) -> (f64, usize) {
    let all = graph.since(&topics::COMPENSATION, since);
    let mut worst_m = 0.0_f64;
    for (place, pair) in all.windows(2).enumerate() {
        let at = pair[1].0;
        let recent = all[..=place + 1].iter().rev();
        let recent: Vec<Instant> = recent
            .map(|(came, _)| *came)
            .take_while(|came| at.duration_since(*came) <= RECENT)
            .collect();
        let silences = recent.windows(2).map(|two| two[0].duration_since(two[1]));
        let passed_s = pair[1].0.duration_since(pair[0].0).as_secs_f64();
        let silence_s = silences.max().unwrap_or_default().as_secs_f64();
        for axis in 0..3 {
            let step_m = (pair[1].1.total[axis] - pair[0].1.total[axis]).abs();
            let limit_m = RATE_M_S * (SHUFFLED_S + 2.0 * passed_s + silence_s);
            assert!(
                step_m <= limit_m,
                "{step_m} m in {passed_s} s, silence {silence_s} s"
            );
            worst_m = worst_m.max(step_m);
        }
    }
    (worst_m, all.len())
}

fn x_m(message: &AxisCompensation) -> f64 {
    message.total[0]
}

#[test]
fn axis_compensation_never_steps_whatever_order_age_or_clock_its_states_have() {
    let test = "axis_compensation among faulty axis states";
    namespace::alone(test, || {
        let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(0));
        scenario.replace("axis_compensation.yaml", "enabled: false", "enabled: true");
        let graph = Graph::join(domain);
        let file = scenario.argument("axis_compensation.yaml");
        let node = Process::node(domain, "axis_compensation", &["--params-file", &file]);
        let ports = [port(&topics::AXES_STATE), port(&topics::THERMAL_MODEL)];
        let mut voice = graph.voice(&ports);
        let mut other = graph.voice(&ports[..1]);
        voice.say(1, &model(&now(), SLOPE));
        let began = Instant::now();
        graph.wait("an offset of 20 um", |graph| {
            voice.say(0, &state(&now(), 0.2));
            std::thread::sleep(BEAT);
            let all = graph.since(&topics::COMPENSATION, began);
            (x_m(&all.last()?.1) > 19.9e-6).then_some(())
        });
        faulty_states(&graph, &mut voice, &mut other);
        // The first voice alone again: the offset is what it was.
        let since = Instant::now();
        graph.wait("the offset of 20 um again", |graph| {
            voice.say(0, &state(&now(), 0.2));
            std::thread::sleep(BEAT);
            let all = graph.since(&topics::COMPENSATION, since);
            ((x_m(&all.last()?.1) - 20e-6).abs() < 0.1e-6).then_some(())
        });
        let (worst_m, answers) = steps(&graph, began);
        eprintln!("{answers} offsets, largest step {:.4} um", worst_m * 1e6);
        assert!(answers > 1000);
        voice.stop();
        other.stop();
        node.stop();
    });
}

/// Each kind of fault for a while, and what the node says of it.
fn faulty_states(graph: &Graph, voice: &mut Voice, other: &mut Voice) {
    let mut rng = Pcg64Mcg::seed_from_u64(20_240_229);
    // Each said twice: equal stamps move nothing.
    keep_saying(FAULT, |_| {
        let bytes = to_cdr(&state(&now(), 0.2));
        voice.bytes(0, &bytes);
        voice.bytes(0, &bytes);
    });
    // Out of order, by up to five beats.
    let since = Instant::now();
    keep_saying(FAULT, |_| {
        let late = rng.random_range(0..5) * BEAT_NANOS;
        voice.say(0, &state(&later(&now(), -late), 0.2));
    });
    let words = ["went back by"];
    graph.condition("axis_compensation", "controller_clock", &words, since);
    // Stale: as they were five seconds ago, at another place.
    keep_saying(FAULT, |_| {
        voice.say(0, &state(&later(&now(), -5 * SECOND_NANOS), -0.2));
    });
    // The clock steps there and back, by a second, an hour, a day.
    for step_s in [1, 3_600, 86_400] {
        keep_saying(FAULT / 3, |beat| {
            let ahead = if beat % 20 < 10 { 0 } else { step_s };
            let at = later(&now(), ahead * SECOND_NANOS);
            voice.say(0, &state(&at, 0.2));
        });
    }
    // Senseless numbers among good ones.
    for bad in [f64::NAN, f64::INFINITY, f64::MAX, -1e300] {
        let since = Instant::now();
        keep_saying(FAULT / 3, |beat| {
            let mut said = state(&now(), 0.2);
            if beat % 3 == 1 {
                said.commanded[0] = bad;
            }
            voice.say(0, &said);
        });
        if !bad.is_finite() {
            let words = ["axes/state", "commanded", "X"];
            graph.condition("axis_compensation", "input_refused", &words, since);
        }
    }
    // A second publisher, elsewhere and with a clock of its own.
    let since = Instant::now();
    keep_saying(2 * FAULT, |_| {
        voice.say(0, &state(&now(), 0.2));
        other.say(0, &state(&later(&now(), -3_600 * SECOND_NANOS), -0.2));
    });
    let words = ["/axes/state", "more than one publisher"];
    graph.condition("axis_compensation", "second_publisher", &words, since);
}

/// Limit of the controller's own rate here, m/s, and what friction lets the motors creep behind, m.
const FOLLOW_M_S: f64 = 25e-6;
const CREEP_M: f64 = 1e-6;
/// Largest that is asked for, m.
const ASKED_M: f64 = 40e-6;

#[test]
fn fake_cnc_never_steps_whatever_offsets_it_is_told() {
    namespace::alone("fake_cnc among faulty offsets", || {
        let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(1));
        scenario.replace(
            "fake_cnc.yaml",
            "background_rate_hz: 10.0",
            "background_rate_hz: 250.0\n    compensation_rate_limit_um_s: 25.0",
        );
        let graph = Graph::join(domain);
        let file = scenario.argument("fake_cnc.yaml");
        let node = Process::node(domain, "fake_cnc", &["--params-file", &file]);
        let ports = [port(&topics::COMPENSATION)];
        let (mut voice, mut other) = (graph.voice(&ports), graph.voice(&ports));
        graph.next(&topics::AXES_STATE, Instant::now(), |_| true);
        let began = Instant::now();
        faulty_offsets(&graph, &mut voice, &mut other);
        // Silence: what is in effect fades.
        let since = Instant::now();
        let words = ["no compensation for", "fading"];
        graph.condition("fake_cnc", "compensation_input", &words, since);
        let states = graph.since(&topics::AXES_STATE, began);
        let states: Vec<AxisState> = states.into_iter().map(|(_, state)| state).collect();
        let (worst_m, greatest_m) = worst_motion(&states);
        eprintln!(
            "{} states, offsets up to {:.1} um, at most {:.3} um in 0.1 s",
            states.len(),
            greatest_m * 1e6,
            worst_m * 1e6
        );
        assert!(greatest_m > 5e-6, "the axes were compensated at all");
        assert!(greatest_m < ASKED_M + CREEP_M, "{greatest_m} m");
        assert!(worst_m <= FOLLOW_M_S * 0.1 + CREEP_M, "{worst_m} m");
        voice.stop();
        other.stop();
        node.stop();
    });
}

fn faulty_offsets(graph: &Graph, voice: &mut Voice, other: &mut Voice) {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    keep_saying(FAULT, |_| voice.say(0, &compensation(&now(), 20e-6)));
    // Twice each, out of order, and jumping.
    keep_saying(FAULT, |_| {
        let age = rng.random_range(0..9) * (SECOND_NANOS / 10);
        let asked_m = rng.random_range(-ASKED_M..ASKED_M);
        let bytes = to_cdr(&compensation(&later(&now(), -age), asked_m));
        voice.bytes(0, &bytes);
        voice.bytes(0, &bytes);
    });
    // Words that only this value brings: the condition before may still stand.
    for (bad, condition, words) in [
        (f64::NAN, "input_refused", ["total[X]", "NaN"]),
        (f64::NEG_INFINITY, "input_refused", ["total[X]", "-inf"]),
        (0.1, "compensation_input", ["axis X is 100 mm", "limit"]),
        (-1e300, "input_refused", ["total[X]", "in magnitude"]),
    ] {
        let since = Instant::now();
        keep_saying(FAULT / 3, |beat| {
            let asked_m = if beat % 4 == 2 { bad } else { 20e-6 };
            voice.say(0, &compensation(&now(), asked_m));
        });
        graph.condition("fake_cnc", condition, &words, since);
    }
    unsound_offsets(graph, voice);
    let since = Instant::now();
    keep_saying(2 * FAULT, |_| {
        voice.say(0, &compensation(&now(), ASKED_M));
        other.say(0, &compensation(&now(), -ASKED_M));
    });
    let words = ["/compensation", "more than one publisher"];
    graph.condition("fake_cnc", "second_publisher", &words, since);
    let words = ["two publishers", "fade to zero"];
    graph.condition("fake_cnc", "compensation_publishers", &words, since);
    // One has been alone for 2 s: it is followed, so that its silence is one afterwards.
    keep_saying(2 * FAULT, |_| voice.say(0, &compensation(&now(), 20e-6)));
}

/// Spoils a message.
type Spoil = fn(&mut AxisCompensation);

/// Offsets that contradict themselves or are not of now, each with the words that it brings.
fn unsound_offsets(graph: &Graph, voice: &mut Voice) {
    let unsound: [(Spoil, [&str; 2]); 4] = [
        (
            |said| said.state[0] = AxisCompensation::STATE_OFF,
            ["axis X is 0.02 mm with STATE_OFF", "limit 0"],
        ),
        (
            |said| said.pulses[0] = 4_900,
            ["its pulses and remainder are", "one pulse"],
        ),
        (
            |said| said.header.stamp.sec -= 30_000_000,
            ["s ago", "limit 1 s"],
        ),
        (
            |said| said.header.stamp.sec += 300_000_000,
            ["s in the future", "limit 1 s"],
        ),
    ];
    for (spoil, words) in unsound {
        let since = Instant::now();
        keep_saying(FAULT / 3, |beat| {
            let mut said = compensation(&now(), 20e-6);
            if beat % 4 == 2 {
                spoil(&mut said);
            }
            voice.say(0, &said);
        });
        graph.condition("fake_cnc", "compensation_input", &words, since);
    }
}

/// Fastest change of motor minus commanded in 0.1 s, and its greatest value, m.
fn worst_motion(states: &[AxisState]) -> (f64, f64) {
    let at_s = |state: &AxisState| {
        f64::from(state.controller_stamp.sec) + f64::from(state.controller_stamp.nanosec) * 1e-9
    };
    let added_m = |state: &AxisState, axis: usize| state.motor[axis] - state.commanded[axis];
    let (mut worst_m, mut greatest_m) = (0.0_f64, 0.0_f64);
    for (place, state) in states.iter().enumerate() {
        let later = states[place + 1..]
            .iter()
            .take_while(|later| (0.0..=0.1).contains(&(at_s(later) - at_s(state))));
        for later in later {
            for axis in 0..3 {
                worst_m = worst_m.max((added_m(later, axis) - added_m(state, axis)).abs());
                greatest_m = greatest_m.max(added_m(state, axis).abs());
            }
        }
    }
    (worst_m, greatest_m)
}

#[test]
fn a_clock_that_steps_is_said_by_the_machine_and_its_axes_stand() {
    namespace::alone("fake_cnc under a clock that steps", || {
        let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(2));
        let graph = Graph::join(domain);
        let file = scenario.argument("fake_cnc.yaml");
        let arguments = ["--params-file", file.as_str(), "-p", "use_sim_time:=true"];
        let node = Process::node(domain, "fake_cnc", &arguments);
        let mut voice = graph.voice(&[port(&topics::CLOCK)]);
        let start = now();
        let mut elapsed = 0;
        let mut tell = |jump: i64| {
            elapsed += jump;
            keep_saying(FAULT, |_| {
                elapsed += BEAT_NANOS;
                let clock = later(&start, elapsed);
                voice.say(0, &Clock { clock });
            });
        };
        let began = Instant::now();
        graph.wait("a state of the machine", |graph| {
            tell(0);
            (!graph.since(&topics::AXES_STATE, began).is_empty()).then_some(())
        });
        let since = Instant::now();
        tell(300 * SECOND_NANOS);
        // Timers run after the clock for a while, then they are armed anew.
        let words = ["time jumped by", "limit 60"];
        graph.condition("fake_cnc", "time", &words, since);
        let since = Instant::now();
        tell(-100 * SECOND_NANOS);
        graph.condition("fake_cnc", "time", &["time went back by"], since);
        let since = Instant::now();
        tell(120 * SECOND_NANOS);
        graph.wait("a state after the clock's step", |graph| {
            tell(0);
            (!graph.since(&topics::AXES_STATE, since).is_empty()).then_some(())
        });
        for (_, state) in graph.since(&topics::AXES_STATE, began) {
            let added_m = state.motor.iter().zip(&state.commanded);
            let worst_m = added_m.map(|(m, c)| (m - c).abs()).fold(0.0, f64::max);
            assert!(worst_m < 10.0 * CREEP_M, "{state:?}");
        }
        voice.stop();
        node.stop();
    });
}
