//! A bridge at work on LinuxCNC among strangers: others on the graph who say, ask and flood what no good node does.
//!
//! A program moves Y, and an author's offset is on X, which stands: whatever X's motor does is an offset, in every servo
//! period. The bridge refuses what strangers ask for, and names it on `/diagnostics`. While a stranger publishes offsets
//! beside the author, nobody is followed: the offset fades at HAL's rate, and is there again when the author is alone. No
//! stranger moves an axis beyond that, ends the program or keeps the offset of an author who fell silent.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use abbe_msgs::action::{RunProgram, RunProgramResult};
use abbe_msgs::action_msgs::srv::{CancelGoal, CancelGoalRequest, CancelGoalResponse};
use abbe_msgs::lifecycle_msgs::srv::{ChangeState, ChangeStateRequest};
use abbe_msgs::msg::{AxisCompensation, AxisState, PlanStatus, ProbeTrigger};
use abbe_msgs::rcl_interfaces::msg::{Parameter, ParameterType};
use abbe_msgs::rcl_interfaces::srv::{SetParameters, SetParametersRequest};
use abbe_msgs::{
    GetResult, GetResultRequest, SendGoal, SendGoalRequest, std_msgs::msg::Header, to_cdr, topics,
};
use abbe_tests::asker::{Asker, service};
use abbe_tests::graph::{Graph, Voice, now, port};
use abbe_tests::namespace::isolated;
use abbe_tests::said::compensation;
use abbe_tests::zenoh::environment;
use linuxcnc_bridge::io::start::Controller;
use nix::sys::signal::Signal;
use node_runtime::node::TopicPort;

use crate::installed;
use crate::killed::{Desk, NONE_MM, OFFSET_MM, RATE_MM_S, START, controller, offset_mm, pin};

const BRIDGE: &str = "linuxcnc_bridge";
/// Y goes there and back in a minute; X stands.
const PROGRAM: &str = "G21 G90\nG1 X0 Y0 Z10 F3000\nG1 Y100 F200\nG1 Y0 F200\nM2\n";
/// Ends of its way, mm.
const TRAVEL_MM: [[f64; 2]; 3] = [[0.0, 0.0], [0.0, 100.0], [0.0, 10.0]];
/// What strangers want on X, m.
const WANTED_M: f64 = 40e-6;
/// HAL's limit of size, mm.
const LIMIT_MM: f64 = 0.2;
/// Messages of a flood, and how many of them come in a millisecond.
const FLOOD: u64 = 10_000;
const FLOOD_PER_MS: u64 = 4;
/// How long what is not named goes on.
const WHILE: Duration = Duration::from_millis(1500);
const HOUR_S: i32 = 3_600;

/// Topics that the stranger speaks on, by their places.
const OFFSETS: usize = 0;
const STATES: usize = 1;
const TRIGGERS: usize = 2;
/// Services that the stranger calls, by their places.
const SEND: usize = 0;
const RESULT: usize = 1;
const CANCEL: usize = 2;
const STEP: usize = 3;
const SET: usize = 4;
/// Frame of what it says in the bridge's place.
const FRAME: &str = "stranger";

/// Who publishes the offset that is wanted, until it is stopped.
struct Author {
    stops: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Author {
    fn of(graph: &Graph) -> Self {
        let mut voice = graph.voice(&[port(&topics::COMPENSATION)]);
        let stops = Arc::<AtomicBool>::default();
        let is_over = Arc::clone(&stops);
        let thread = std::thread::spawn(move || {
            while !is_over.load(Ordering::Relaxed) {
                voice.say(0, &compensation(&now(), OFFSET_MM * 1e-3));
                std::thread::sleep(Duration::from_millis(20));
            }
            voice.stop();
        });
        Self { stops, thread }
    }

    fn stop(self) {
        self.stops.store(true, Ordering::Relaxed);
        self.thread.join().unwrap();
    }
}

/// Who says and asks what nobody should.
struct Stranger {
    voice: Voice,
    asker: Asker,
    /// Of the last goal.
    number: u8,
}

impl Stranger {
    fn on(desk: &Desk) -> Self {
        let ports = [
            port(&topics::COMPENSATION),
            port(&topics::AXES_STATE),
            port(&topics::PROBE_TRIGGER),
        ];
        let of_goals = |name: &str| format!("/{}/_action/{name}", topics::RUN_PROGRAM.name);
        let services = vec![
            service::<SendGoal<RunProgram>>(&of_goals("send_goal")),
            service::<GetResult<RunProgram>>(&of_goals("get_result")),
            service::<CancelGoal>(&of_goals("cancel_goal")),
            service::<ChangeState>(&format!("/{BRIDGE}/change_state")),
            service::<SetParameters>(&format!("/{BRIDGE}/set_parameters")),
        ];
        Self {
            voice: desk.graph.voice(&ports),
            asker: Asker::join(&environment(desk.domain), services),
            number: 0,
        }
    }

    fn goal(&mut self, program: &str) -> SendGoalRequest<RunProgram> {
        self.number += 1;
        let mut request = SendGoalRequest::<RunProgram>::default();
        request.goal_id.uuid = [self.number; 16];
        request.goal.program = program.to_owned();
        request.goal.name = FRAME.to_owned();
        request
    }

    /// What becomes of a program that it wants to have run.
    fn propose(&mut self, program: &str) -> RunProgramResult {
        let request = self.goal(program);
        // A refused program is taken and ended: it has a result. Whoever asks twice hears of the first time by that alone.
        let _ = self.asker.ask::<SendGoal<RunProgram>>(SEND, &request);
        let wanted = GetResultRequest {
            goal_id: request.goal_id,
            ..GetResultRequest::default()
        };
        self.asker
            .ask::<GetResult<RunProgram>>(RESULT, &wanted)
            .result
    }

    /// Whether the bridge takes a step that it asks for.
    fn steps(&self, id: u8, label: &str) -> bool {
        let mut request = ChangeStateRequest::default();
        request.transition.id = id;
        request.transition.label = label.to_owned();
        self.asker.ask::<ChangeState>(STEP, &request).success
    }

    /// Says something over and over until the bridge names it.
    fn until_named(
        &mut self,
        graph: &Graph,
        (condition, words): (&str, &[&str]),
        mut say: impl FnMut(&mut Voice),
    ) {
        let since = Instant::now();
        let what = format!("{condition} with {words:?}");
        let named = graph.wait_longer(START, &what, |graph| {
            for _ in 0..2 {
                say(&mut self.voice);
            }
            graph.hears_condition(BRIDGE, condition, words, since)
        });
        println!("{}: {}", named.name, named.message);
    }

    fn stop(self) {
        self.voice.stop();
        self.asker.stop();
    }
}

/// The bridge's own states since `since`.
fn states(graph: &Graph, since: Instant) -> Vec<AxisState> {
    let all = graph.since(&topics::AXES_STATE, since).into_iter();
    all.map(|(_, state)| state)
        .filter(|state| state.header.frame_id != FRAME)
        .collect()
}

/// Waits until X has had an offset for a while.
fn settles(graph: &Graph, wanted_mm: f64, mut meanwhile: impl FnMut()) {
    graph.wait_longer(START, &format!("an offset of {wanted_mm} mm"), |graph| {
        meanwhile();
        let recent = Instant::now().checked_sub(Duration::from_millis(400))?;
        let states = states(graph, recent);
        let is_there = |state: &AxisState| (offset_mm(state) - wanted_mm).abs() < NONE_MM;
        (states.len() > 100 && states.iter().all(is_there)).then_some(())
    });
}

/// Every axis is where a rightful program may have it, and X's offset never steps: from one servo period to another it
/// changes by no more than HAL's rate allows.
fn judge(states: &[AxisState]) {
    let at_nanos = |state: &AxisState| {
        i64::from(state.controller_stamp.sec) * 1_000_000_000
            + i64::from(state.controller_stamp.nanosec)
    };
    let (mut worst_mm_s, mut greatest_mm) = (0.0_f64, 0.0_f64);
    for state in states {
        for (command_m, [low_mm, high_mm]) in state.commanded.iter().zip(TRAVEL_MM) {
            let command_mm = command_m * 1e3;
            let allowed = low_mm - 1e-6..=high_mm + 1e-6;
            assert!(allowed.contains(&command_mm), "{state:?}");
        }
        greatest_mm = greatest_mm.max(offset_mm(state).abs());
    }
    for pair in states.windows(2) {
        let passed_s = (at_nanos(&pair[1]) - at_nanos(&pair[0])) as f64 * 1e-9;
        assert!(passed_s > 0.0, "{pair:?}");
        let step_mm = (offset_mm(&pair[1]) - offset_mm(&pair[0])).abs();
        // Positions are told to 1 nm.
        let most_mm = RATE_MM_S * passed_s * 1.01 + 3e-6;
        assert!(step_mm < most_mm, "{step_mm} mm in {passed_s} s: {pair:?}");
        worst_mm_s = worst_mm_s.max(step_mm / passed_s);
    }
    println!(
        "{} states, offsets up to {:.1} um, at most {:.1} um/s",
        states.len(),
        greatest_mm * 1e3,
        worst_mm_s * 1e3
    );
    assert!(greatest_mm > 0.9 * OFFSET_MM && greatest_mm < LIMIT_MM);
}

/// No axis was commanded to move since `since`.
fn stood(graph: &Graph, since: Instant) {
    let states = states(graph, since);
    assert!(states.len() > 100, "{}", states.len());
    let first = &states[0].commanded;
    let moved = states.iter().find(|state| state.commanded != *first);
    assert!(moved.is_none(), "{first:?} to {moved:?}");
}

/// Waits until Y is under way.
fn under_way(graph: &Graph, since: Instant) {
    graph.wait_longer(START, "Y under way", |graph| {
        let recent = Instant::now().checked_sub(Duration::from_millis(200))?;
        let last = states(graph, recent.max(since)).pop()?;
        (last.commanded[1] > 5e-3 && last.velocity[1].abs() > 1e-3).then_some(())
    });
}

/// Programs, calls and steps that nobody should ask for while a program runs.
fn asks(graph: &Graph, stranger: &mut Stranger) {
    for program in ["G21 G90\nG1 X50 F6000\nM2\n", "", "%\u{0}\u{202e}"] {
        let result = stranger.propose(program);
        assert_eq!(result.outcome, RunProgramResult::OUTCOME_REFUSED);
        assert_eq!(result.message, "another program is running");
    }
    // The same goal twice, and one that nobody has.
    let request = stranger.goal(PROGRAM);
    let _ = stranger.asker.ask::<SendGoal<RunProgram>>(SEND, &request);
    let again = stranger.asker.ask::<SendGoal<RunProgram>>(SEND, &request);
    assert!(!again.accepted);
    let mut unknown = CancelGoalRequest::default();
    unknown.goal_info.goal_id.uuid = [0xee; 16];
    for (uuid, code) in [
        ([0xee; 16], CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID),
        (
            request.goal_id.uuid,
            CancelGoalResponse::ERROR_GOAL_TERMINATED,
        ),
    ] {
        unknown.goal_info.goal_id.uuid = uuid;
        let answer = stranger.asker.ask::<CancelGoal>(CANCEL, &unknown);
        assert_eq!(answer.return_code, code);
    }
    // Steps that do not begin in this state, or are none.
    for (id, label) in [(1, ""), (2, ""), (3, ""), (0, "fly"), (77, ""), (255, "")] {
        assert!(!stranger.steps(id, label), "{id} {label}");
    }
    let mut limit = Parameter {
        name: "compensation.limit_um".to_owned(),
        ..Parameter::default()
    };
    limit.value.r#type = ParameterType::PARAMETER_DOUBLE;
    limit.value.double_value = 5_000.0;
    let request = SetParametersRequest {
        parameters: vec![limit],
    };
    let answer = stranger.asker.ask::<SetParameters>(SET, &request);
    assert!(!answer.results[0].successful, "{answer:?}");
    cut_requests(graph, stranger);
}

/// Requests that end too early.
fn cut_requests(graph: &Graph, stranger: &mut Stranger) {
    let goal = to_cdr(&stranger.goal(PROGRAM));
    let step = to_cdr(&ChangeStateRequest::default());
    let set = [0, 1, 0, 0, 1, 0, 0, 0];
    for (place, bytes, condition, port) in [
        (SEND, &goal[..24], "input_refused", "cnc/run_program"),
        (STEP, &step[..5], "input_refused", "change_state"),
        (SET, &set[..], "request_malformed", "set_parameters"),
    ] {
        let since = Instant::now();
        let id = stranger.asker.send(place, bytes);
        graph.condition(BRIDGE, condition, &[port], since);
        match place {
            SEND => assert!(!stranger.asker.wait::<SendGoal<RunProgram>>(id).accepted),
            STEP => assert!(!stranger.asker.wait::<ChangeState>(id).success),
            // An answer would say which parameters could not be set.
            _ => {}
        }
    }
}

/// Offsets that are refused, each named by what is wrong with it.
fn bad_offsets(graph: &Graph, stranger: &mut Stranger) {
    type Spoil = fn(&mut AxisCompensation);
    let faults: [(&str, &[&str], Spoil); 8] = [
        ("input_refused", &["total[X]", "NaN"], |m| {
            m.total[0] = f64::NAN;
        }),
        ("input_refused", &["total[X]", "-inf"], |m| {
            m.total[0] = f64::NEG_INFINITY;
        }),
        ("input_refused", &["total[X]", "in magnitude"], |m| {
            m.total[0] = -1e300;
        }),
        ("input_refused", &["axis \"Q\""], |m| {
            m.axis[0] = "Q".to_owned();
        }),
        ("input_refused", &["axis X appears twice"], |m| {
            m.axis[1] = "X".to_owned();
        }),
        ("input_refused", &["thermal", "entries for 3 axes"], |m| {
            m.thermal.truncate(1);
        }),
        ("input_refused", &["state[Y]", "value 77"], |m| {
            m.state[1] = 77;
        }),
        ("input_refused", &["header.stamp", "1970 to 2106"], |m| {
            m.header.stamp.nanosec = u32::MAX;
        }),
    ];
    for (condition, words, spoil) in faults {
        stranger.until_named(graph, (condition, words), |voice| {
            let mut said = compensation(&now(), WANTED_M);
            spoil(&mut said);
            voice.say(OFFSETS, &said);
        });
    }
    let whole = to_cdr(&compensation(&now(), WANTED_M));
    let mut endless = whole.clone();
    // The number of letters, behind encapsulation, stamp and an empty frame.
    endless[20..24].copy_from_slice(&u32::MAX.to_le_bytes());
    for bytes in [&whole[..whole.len() / 2], &whole[..5], &endless] {
        // The network fills up to whole words.
        let len = bytes.len().next_multiple_of(4);
        let words: [&str; 2] = ["malformed at byte", &format!("of {len}")];
        stranger.until_named(graph, ("input_refused", &words), |voice| {
            voice.bytes(OFFSETS, bytes);
        });
    }
}

/// An offset beyond the limit of one who is alone; beside another author nobody's offsets are looked at.
fn too_large_offset(graph: &Graph, stranger: &mut Stranger) {
    let words = ["axis X", "limit 0.2 mm"];
    stranger.until_named(graph, ("compensation_refused", &words), |voice| {
        let mut said = compensation(&now(), WANTED_M);
        said.total[0] = 0.1;
        voice.say(OFFSETS, &said);
    });
}

/// Offsets that nothing is wrong with but their author: the offset of the one before fades, and none of theirs is taken.
fn anothers_offsets(graph: &Graph, stranger: &mut Stranger) {
    let words = ["/compensation", "more than one publisher"];
    let mut sign = 1.0;
    stranger.until_named(graph, ("second_publisher", &words), |voice| {
        sign = -sign;
        voice.say(OFFSETS, &compensation(&now(), sign * WANTED_M));
    });
    let words = ["two publishers", "fade to zero"];
    stranger.until_named(graph, ("compensation_publishers", &words), |voice| {
        sign = -sign;
        voice.say(OFFSETS, &compensation(&now(), sign * WANTED_M));
    });
    settles(graph, 0.0, || {
        for _ in 0..2 {
            let said = compensation(&now(), WANTED_M);
            stranger.voice.say(OFFSETS, &said);
        }
    });
    for (later_s, frame, axis) in [
        (-HOUR_S, "", "X"),
        (HOUR_S, "", "X"),
        (0, "another/machine", "X"),
        (0, "", "A"),
    ] {
        let began = Instant::now();
        while began.elapsed() < WHILE {
            let mut said = compensation(&now(), -WANTED_M);
            said.header.stamp.sec += later_s;
            said.header.frame_id = frame.to_owned();
            said.axis[0] = axis.to_owned();
            stranger.voice.say(OFFSETS, &said);
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Thousands of messages a second, good and bad.
fn flood(graph: &Graph, stranger: &mut Stranger) {
    let began = Instant::now();
    for n in 0..FLOOD {
        let wanted_m = match n % 5 {
            0 => f64::NAN,
            1 => 1.0,
            2 => -3.0 * WANTED_M,
            _ => 3.0 * WANTED_M,
        };
        let said = compensation(&now(), wanted_m);
        if n % 7 == 0 {
            stranger.voice.bytes(OFFSETS, &to_cdr(&said)[..30]);
        } else {
            stranger.voice.say(OFFSETS, &said);
        }
        if n % FLOOD_PER_MS == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    stranger.voice.settle();
    println!("{FLOOD} messages in {:.1} s", began.elapsed().as_secs_f64());
    graph.alive(BRIDGE, Instant::now());
}

/// What only the bridge may say; who listens names it.
fn speaks_for_the_bridge(graph: &Graph, stranger: &mut Stranger) {
    let since = Instant::now();
    let is_its_own = |state: &AxisState| state.header.frame_id != FRAME;
    let mut state = graph.next(&topics::AXES_STATE, since, is_its_own);
    FRAME.clone_into(&mut state.header.frame_id);
    state.commanded[0] = 0.1;
    state.motor[0] = 0.1;
    let trigger = ProbeTrigger {
        header: Header {
            frame_id: FRAME.to_owned(),
            ..Header::default()
        },
        axis: state.axis.clone(),
        latched: state.motor.clone(),
        ..ProbeTrigger::default()
    };
    let words = ["/axes/state", "more than one publisher"];
    graph.wait_longer(START, "a second publisher of axis states", |graph| {
        state.header.stamp = now();
        state.controller_stamp = now();
        stranger.voice.say(STATES, &state);
        stranger.voice.say(TRIGGERS, &trigger);
        graph.hears_condition("probe", "second_publisher", &words, since)
    });
}

/// Another type on the topic of offsets.
fn another_type(graph: &Graph) {
    let since = Instant::now();
    let foreign = TopicPort {
        topic: topics::COMPENSATION.name.to_owned(),
        ..port(&topics::PROBE_TRIGGER)
    };
    let mut voice = graph.voice(&[foreign]);
    let words = ["compensation", "ProbeTrigger"];
    graph.wait_longer(START, "another type of offsets", |graph| {
        voice.say(0, &ProbeTrigger::default());
        graph.hears_condition(BRIDGE, "type_mismatch", &words, since)
    });
    voice.stop();
}

/// What a stranger wants to have run while nothing runs, and what no machine can run.
fn bad_programs(graph: &Graph, stranger: &mut Stranger) {
    let began = Instant::now();
    let long = "(a comment)\n".repeat(20_000);
    for program in [
        " \n",
        "G21 G90\nG1 X1O F600\nM2\n",
        "(frame: machine)\nG92 X5\nM2\n",
        "G1 X\u{fffd}",
        &format!("{long}G1 X1O F600\nM2\n"),
    ] {
        let result = stranger.propose(program);
        println!("outcome {}: {:.120}", result.outcome, result.message);
        assert_ne!(result.outcome, RunProgramResult::OUTCOME_DONE);
        assert!(!result.message.is_empty());
    }
    stood(graph, began);
}

/// A stranger may let the bridge rest, as anybody may: the program is called off, the offset fades, and nothing moves.
fn puts_to_rest(desk: &Desk, stranger: &mut Stranger) {
    let begun = Instant::now();
    let sequencer = desk.running(PROGRAM);
    under_way(&desk.graph, begun);
    let since = Instant::now();
    // Whether it succeeded is lost where the answer to the first of two calls came late.
    let _ = stranger.steps(0, "deactivate");
    desk.graph.condition(BRIDGE, "not_active", &[], since);
    let status = desk.ended(begun);
    assert_ne!(status.state, PlanStatus::STATE_DONE, "{status:?}");
    desk.graph
        .next(&topics::AXES_STATE, Instant::now(), |state| {
            state.header.frame_id != FRAME && state.velocity[1].abs() < 1e-6
        });
    let rests = Instant::now();
    let result = stranger.propose(PROGRAM);
    assert_eq!(result.message, "the bridge is not active");
    settles(&desk.graph, 0.0, || {});
    stood(&desk.graph, rests);
    sequencer.stop();
    let _ = stranger.steps(0, "activate");
    settles(&desk.graph, OFFSET_MM, || {});
    stood(&desk.graph, rests);
}

/// The bridge ends under offsets; HAL has none of them soon.
fn ends_at_zero(controller: &Controller, ended_at: Instant) {
    while pin(controller, "compensation.x.out").abs() > 1e-6 {
        assert!(ended_at.elapsed() < START, "HAL keeps an offset");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(pin(controller, "joint.0.pos-cmd").abs() < 1e-6);
}

#[test]
fn strangers_neither_move_a_machine_nor_step_its_offsets_nor_end_its_program() {
    isolated(|| {
        if !installed() {
            return;
        }
        let controller = controller();
        let desk = Desk::new(17);
        let graph = &desk.graph;
        let author = Author::of(graph);
        let (bridge, probe) = (desk.node(BRIDGE), desk.node("probe"));
        settles(graph, OFFSET_MM, || {});
        let began = Instant::now();
        let mut stranger = Stranger::on(&desk);

        let begun = Instant::now();
        let sequencer = desk.running(PROGRAM);
        under_way(graph, begun);
        asks(graph, &mut stranger);
        anothers_offsets(graph, &mut stranger);
        bad_offsets(graph, &mut stranger);
        flood(graph, &mut stranger);
        speaks_for_the_bridge(graph, &mut stranger);
        another_type(graph);
        let status = desk.ended(begun);
        assert_eq!(status.state, PlanStatus::STATE_DONE, "{status:?}");
        sequencer.stop();
        settles(graph, OFFSET_MM, || {});
        bad_programs(graph, &mut stranger);
        puts_to_rest(&desk, &mut stranger);

        // Its author falls silent; who names other axes alone does not keep the offset.
        author.stop();
        settles(graph, 0.0, || {
            let mut said = compensation(&now(), WANTED_M);
            said.axis[0] = "A".to_owned();
            stranger.voice.say(OFFSETS, &said);
        });
        too_large_offset(graph, &mut stranger);
        let author = Author::of(graph);
        settles(graph, OFFSET_MM, || {});
        judge(&states(graph, began));
        bridge.signal(Signal::SIGINT);
        let ended = bridge.ended_within(Duration::from_secs(60));
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        assert!(!ended.said.contains("panicked"), "{}", ended.said);
        // What the library says of every broken message would fill a disk.
        assert!(!ended.said.contains("null terminator"), "{}", ended.said);
        ends_at_zero(&controller, Instant::now());
        author.stop();
        stranger.stop();
        probe.stop();
        desk.voice.stop();
    });
}
