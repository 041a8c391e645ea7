//! The protocol against what `linuxcncrsh` of LinuxCNC 2.9 was recorded to say, and against rubbish.

use linuxcnc_bridge::condition::{Condition, Lost};
use linuxcnc_bridge::config::{ConnectionConfig, Prepare};
use linuxcnc_bridge::protocol::{
    Client, MESSAGE_LIMIT_BYTES, Mode, ProgramStatus, Query, Reply, Request, Setting, Signal,
};
use linuxcnc_bridge::run::Outcome;
use linuxcnc_bridge::stage::{IoCommand, IoEvent};
use linuxcnc_bridge::{BridgeStage, Input, Output, Settings};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, AxisSet, PerAxis, Severity, Stage};
use proptest::prelude::*;

const SECOND: i64 = 1_000_000_000;

fn at(seconds_s: f64) -> Stamp<Host> {
    Stamp::from_nanos(1000 * SECOND) + Span::from_secs_f64(seconds_s)
}

fn client() -> Client {
    Client::new(Span::from_nanos(5 * SECOND))
}

/// One request, its line on the wire, the recorded answer, and what that means.
#[track_caller]
fn check(request: Request, line: &str, answer: &[u8], expected: &Signal) {
    let mut client = client();
    client.ask(request);
    assert_eq!(client.send(at(0.0)).as_deref(), Some(line));
    let mut signals = Vec::new();
    client.receive(answer, &mut signals);
    assert_eq!(signals, std::slice::from_ref(expected));
    assert!(client.is_idle());
}

#[test]
fn the_recorded_greeting_is_understood() {
    let greeted = Signal::Reply(Reply::Greeted);
    let hello = Request::Hello("EMC".to_owned());
    check(
        hello,
        "hello EMC abbe 1.0\r\n",
        b"HELLO ACK EMCNETSVR 1.1\r\n",
        &greeted,
    );
    check(
        Request::EchoOff,
        "set echo off\r\n",
        b"set echo off\r\n",
        &greeted,
    );
    check(
        Request::VerboseOn,
        "set verbose on\r\n",
        b"SET VERBOSE ACK\n\r",
        &greeted,
    );
    let enable = Request::Enable("EMCTOO".to_owned());
    check(
        enable.clone(),
        "set enable EMCTOO\r\n",
        b"SET ENABLE ACK\n\r",
        &greeted,
    );
    let denied = Signal::Denied(enable.clone());
    check(
        enable,
        "set enable EMCTOO\r\n",
        b"SET ENABLE NAK\n\r",
        &denied,
    );
}

#[test]
fn recorded_answers_are_understood() {
    let get = Request::Get;
    let reply = Signal::Reply;
    check(
        get(Query::Estop),
        "get estop\r\n",
        b"ESTOP ON\r\n",
        &reply(Reply::Estop(true)),
    );
    check(
        get(Query::Machine),
        "get machine\r\n",
        b"MACHINE OFF\r\n",
        &reply(Reply::Machine(false)),
    );
    check(
        get(Query::Mode),
        "get mode\r\n",
        b"MODE MANUAL\r\n",
        &reply(Reply::Mode(Mode::Manual)),
    );
    check(
        get(Query::ProgramStatus),
        "get program_status\r\n",
        b"PROGRAM_STATUS PAUSED\r\n",
        &reply(Reply::ProgramStatus(ProgramStatus::Paused)),
    );
    check(
        get(Query::ProgramLine),
        "get program_line\r\n",
        b"PROGRAM_LINE -1\r\n",
        &reply(Reply::ProgramLine(0)),
    );
    check(
        get(Query::Error),
        "get error\r\n",
        b"ERROR OK\r\n",
        &reply(Reply::Error(None)),
    );
    check(
        get(Query::Error),
        "get error\r\n",
        b"ERROR Linear move on line 2 would exceed X's positive limit\r\n",
        &reply(Reply::Error(Some(
            "Linear move on line 2 would exceed X's positive limit".to_owned(),
        ))),
    );
    let mut homed = [false; 16];
    homed[..3].fill(true);
    check(
        get(Query::JointHomed),
        "get joint_homed\r\n",
        b"JOINT_HOMED YES YES YES NO NO NO\r\n",
        &reply(Reply::JointHomed(homed)),
    );
    check(
        Request::Set(Setting::HomeAll),
        "set home -1\r\n",
        b"SET HOME ACK\n\r",
        &reply(Reply::Taken(Setting::HomeAll)),
    );
}

#[test]
fn one_request_is_outstanding_at_a_time_and_a_late_answer_is_noticed() {
    let mut client = client();
    client.ask(Request::Get(Query::Estop));
    client.ask(Request::Get(Query::Machine));
    assert!(client.send(at(0.0)).is_some());
    assert_eq!(client.send(at(0.0)), None);
    assert_eq!(client.expire(at(5.0)), None);
    let late = Signal::TimedOut(Request::Get(Query::Estop));
    assert_eq!(client.expire(at(5.1)), Some(late));
    assert_eq!(client.send(at(5.1)).as_deref(), Some("get machine\r\n"));
}

#[test]
fn an_answer_to_something_else_is_not_taken_for_the_answer() {
    let mut client = client();
    client.ask(Request::Get(Query::Estop));
    client.send(at(0.0));
    let mut signals = Vec::new();
    client.receive(
        b"ESTOPPED ON\r\nMACHINE ON\r\nESTOP MAYBE\r\n\r\nESTOP ON\r\n",
        &mut signals,
    );
    let unexpected = |line: &str| Signal::Unexpected(line.to_owned());
    assert_eq!(
        signals,
        [
            unexpected("ESTOPPED ON"),
            unexpected("MACHINE ON"),
            unexpected("ESTOP MAYBE"),
            Signal::Reply(Reply::Estop(true))
        ]
    );
}

#[test]
fn a_line_without_end_is_refused() {
    let mut signals = Vec::new();
    client().receive(&vec![b'x'; 10 * MESSAGE_LIMIT_BYTES], &mut signals);
    assert_eq!(
        signals,
        [Signal::LineTooLong {
            length_bytes: MESSAGE_LIMIT_BYTES
        }]
    );
}

proptest! {
    #[test]
    fn prop_no_bytes_panic_the_client(chunks in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 0..20)) {
        let mut client = client();
        client.ask(Request::Get(Query::JointLimit));
        client.send(at(0.0));
        let mut signals = Vec::new();
        for chunk in &chunks {
            client.receive(chunk, &mut signals);
        }
    }

    #[test]
    fn prop_no_bytes_panic_the_stage(samples in prop::collection::vec(any::<u8>(), 0..2000), replies in "[ -~\r\n]{0,400}") {
        let mut desk = Desk::new(Prepare::Observe);
        desk.make_ready();
        desk.tell(Input::Io(IoEvent::Sampled(samples)));
        desk.tell(Input::Io(IoEvent::Received(replies.into_bytes())));
        desk.tell(Input::Tick);
    }

    #[test]
    fn prop_chunking_changes_nothing(cut in 1_usize..60) {
        let text = b"ESTOP ON\r\nERROR following error\r\n\r\nPROGRAM_STATUS RUNNING\r\n";
        let run = |size: usize| {
            let mut client = client();
            let mut signals = Vec::new();
            for query in [Query::Estop, Query::Error, Query::ProgramStatus] {
                client.ask(Request::Get(query));
            }
            client.send(at(0.0));
            for byte_chunk in text.chunks(size) {
                client.receive(byte_chunk, &mut signals);
                client.send(at(0.0));
            }
            signals.len()
        };
        // All in one chunk leaves no time to ask; byte by byte every answer finds its question.
        prop_assert_eq!(run(1), 3);
        prop_assert!(run(cut) >= 3);
    }
}

/// A stage on a desk, with a controller that is played by the test.
struct Desk {
    stage: BridgeStage,
    now_s: f64,
    out: Vec<Output>,
    number: i32,
}

impl Desk {
    fn new(prepare: Prepare) -> Self {
        let connection = ConnectionConfig::default();
        let settings = Settings {
            joints: Axis::LINEAR.to_vec(),
            scales: vec![],
            axes: AxisSet::XYZ,
            servo_period: Span::from_nanos(1_000_000),
            prepare,
            connect_password: connection.connect_password,
            enable_password: connection.enable_password,
            poll_period: Span::from_nanos(50_000_000),
            reply_timeout: Span::from_nanos(5 * SECOND),
            reconnect_period: Span::from_nanos(500_000_000),
            homing_timeout: Span::from_nanos(60 * SECOND),
            compensation_limit: PerAxis([0.2; 6]),
            compensation_stale_after: Span::from_nanos(SECOND),
            pulse_mm: 1e-4,
            mark: None,
        };
        Self {
            stage: BridgeStage::new(&settings),
            now_s: 0.0,
            out: Vec::new(),
            number: 0,
        }
    }

    fn tell(&mut self, input: Input) {
        let Ok(()) = self.stage.step(at(self.now_s), input, &mut self.out);
    }

    fn sent(&mut self) -> Vec<String> {
        let mut lines = Vec::new();
        self.out.retain(|output| match output {
            Output::Io(IoCommand::Send(line)) => {
                lines.push(line.trim().to_owned());
                false
            }
            _ => true,
        });
        lines
    }

    /// Plays the controller until it is not asked any more; what it was told to do comes back.
    fn play(&mut self, answer: impl Fn(&str) -> Option<String>) -> Vec<String> {
        let mut told = Vec::new();
        loop {
            let lines = self.sent();
            if lines.is_empty() {
                return told;
            }
            for line in lines {
                let reply = answer(&line).unwrap_or_else(|| usual(&line));
                if line.starts_with("set ") {
                    told.push(line);
                }
                self.tell(Input::Io(IoEvent::Received(
                    format!("{reply}\r\n").into_bytes(),
                )));
            }
        }
    }

    fn sample(&mut self, x_mm: f64, probe: u8, motion_type: i32, line: u32) {
        self.number += 1;
        let text = format!(
            "{} {x_mm} 0 0 {x_mm} 0 0 {probe} {motion_type} {line} 1\n",
            self.number
        );
        self.tell(Input::Io(IoEvent::Sampled(text.into_bytes())));
    }

    fn make_ready(&mut self) {
        self.tell(Input::Tick);
        self.tell(Input::Io(IoEvent::Connected));
        self.play(|_| None);
        self.later(0.1);
        self.sample(0.0, 0, 0, 0);
    }

    fn later(&mut self, seconds_s: f64) {
        self.tick_for(seconds_s);
        self.play(|_| None);
    }

    /// Time passes, and the bridge is at work in it.
    fn tick_for(&mut self, seconds_s: f64) {
        let end_s = self.now_s + seconds_s;
        while self.now_s < end_s {
            self.now_s = (self.now_s + 0.1).min(end_s);
            self.tell(Input::Tick);
        }
    }

    fn has(&self, condition: &Condition) -> bool {
        self.out
            .iter()
            .any(|output| matches!(output, Output::Condition(c) if c == condition))
    }

    fn ending(&self) -> Option<(Outcome, String, u32)> {
        self.out.iter().find_map(|output| match output {
            Output::Refused { refusal, .. } => {
                let ending = refusal.ending();
                Some((ending.outcome, ending.message, ending.line))
            }
            Output::Finished { ending, .. } => {
                Some((ending.outcome, ending.message.clone(), ending.line))
            }
            _ => None,
        })
    }

    fn begin(&mut self, program: &str) {
        self.tell(Input::Goal {
            goal: 7,
            program: program.to_owned(),
        });
        self.tell(Input::Io(IoEvent::Stored {
            number: 1,
            path: "/p/abbe_1.ngc".to_owned(),
        }));
    }
}

/// What a homed, idle LinuxCNC says.
fn usual(line: &str) -> String {
    match line {
        "hello EMC abbe 1.0" => "HELLO ACK EMCNETSVR 1.1",
        "set echo off" => "set echo off",
        "get estop" => "ESTOP OFF",
        "get machine" => "MACHINE ON",
        "get mode" => "MODE AUTO",
        "get error" => "ERROR OK",
        "get program_status" => "PROGRAM_STATUS IDLE",
        "get joint_homed" => "JOINT_HOMED YES YES YES NO NO NO",
        "get joint_limit" => "JOINT_LIMIT OK OK OK OK OK OK",
        "get program" => "PROGRAM /p/abbe_1.ngc",
        set => {
            let word = set.split(' ').nth(1).unwrap_or("?");
            return format!("SET {} ACK", word.to_uppercase());
        }
    }
    .to_owned()
}

#[test]
fn a_program_runs_from_its_text_to_its_end() {
    let mut desk = Desk::new(Prepare::Observe);
    desk.make_ready();
    desk.begin("G21\n(feature: ring)\nG38.2 X5 F60\nM2\n");
    let told =
        desk.play(|line| (line == "get program_status").then(|| "PROGRAM_STATUS RUNNING".into()));
    assert_eq!(told, ["set mode auto", "set open /p/abbe_1.ngc", "set run"]);
    desk.sample(1.00, 0, 5, 3);
    desk.sample(1.01, 0, 5, 3);
    desk.sample(1.02, 1, 5, 3);
    let touch = desk.out.iter().find_map(|output| match output {
        Output::Trigger(trigger) => Some(trigger.clone()),
        _ => None,
    });
    assert_eq!(touch.map(|touch| touch.feature_id).as_deref(), Some("ring"));
    desk.later(0.1);
    assert_eq!(desk.ending(), Some((Outcome::Done, String::new(), 3)));
}

/// LinuxCNC tells it in the midst of a program, once, and goes on.
#[test]
fn a_servo_thread_that_was_late_once_is_warned_of_and_ends_no_program() {
    let mut desk = Desk::new(Prepare::Observe);
    desk.make_ready();
    desk.begin("G21\nG1 X5 F60\nM2\n");
    let _ = desk.play(|line| match line {
        "get program_status" => Some("PROGRAM_STATUS RUNNING".into()),
        "get error" => Some("ERROR Unexpected realtime delay on task 0 with period 1000000".into()),
        _ => None,
    });
    desk.sample(1.00, 0, 2, 2);
    desk.later(0.1);
    assert_eq!(desk.ending(), Some((Outcome::Done, String::new(), 2)));
    let warned = desk.out.iter().any(|output| match output {
        Output::Condition(condition) => {
            condition.name() == "controller_error" && condition.severity() == Severity::Warn
        }
        _ => false,
    });
    assert!(warned);
}

#[test]
fn a_fresh_controller_is_made_ready_only_where_that_is_wanted() {
    for (prepare, expected) in [
        (Prepare::Observe, &[][..]),
        (
            Prepare::PowerOnAndHome,
            &[
                "set estop off",
                "set machine on",
                "set mode manual",
                "set home -1",
            ][..],
        ),
    ] {
        let mut desk = Desk::new(prepare);
        desk.tell(Input::Tick);
        desk.tell(Input::Io(IoEvent::Connected));
        let fresh = |line: &str| match line {
            "get estop" => Some("ESTOP ON".to_owned()),
            "get machine" => Some("MACHINE OFF".to_owned()),
            "get joint_homed" => Some("JOINT_HOMED NO NO NO NO NO NO".to_owned()),
            _ => None,
        };
        let mut told = desk.play(fresh);
        told.retain(|line| {
            !["echo", "verbose", "enable"]
                .iter()
                .any(|word| line.contains(word))
        });
        assert_eq!(told, expected);
    }
}

#[test]
fn an_emergency_stop_of_a_homed_machine_stays_until_a_person_releases_it() {
    let mut desk = Desk::new(Prepare::PowerOnAndHome);
    desk.tell(Input::Tick);
    desk.tell(Input::Io(IoEvent::Connected));
    let told = desk.play(|line| (line == "get estop").then(|| "ESTOP ON".into()));
    assert!(!told.contains(&"set estop off".to_owned()), "{told:?}");
    assert!(desk.has(&Condition::Estop { on: true }));
    desk.sample(0.0, 0, 0, 0);
    desk.begin("G21\n");
    assert_eq!(
        desk.ending(),
        Some((Outcome::Refused, "emergency stop is on".to_owned(), 0))
    );
}

#[test]
fn silence_rubbish_and_refusals_end_the_connection_and_it_is_tried_again() {
    let lost = |input: Input, wait_s: f64| {
        let mut desk = Desk::new(Prepare::Observe);
        desk.tell(Input::Tick);
        desk.tell(Input::Io(IoEvent::Connected));
        desk.tell(input);
        desk.tick_for(wait_s);
        desk.out
            .retain(|output| !matches!(output, Output::Io(IoCommand::Connect)));
        desk.later(0.6);
        assert!(
            desk.out.contains(&Output::Io(IoCommand::Connect)),
            "{:?}",
            desk.out
        );
        desk.out
            .iter()
            .find_map(|output| match output {
                Output::Condition(Condition::Disconnected(lost)) => Some(lost.to_string()),
                _ => None,
            })
            .unwrap_or_default()
    };
    assert_eq!(lost(Input::Tick, 5.1), "no answer to `hello` within 5 s");
    let refused = Input::Io(IoEvent::Received(b"HELLO NAK\r\n".to_vec()));
    assert_eq!(lost(refused, 0.0), "the greeting was refused at `hello`");
    let rubbish = Input::Io(IoEvent::Received(vec![7; 4000]));
    assert_eq!(
        lost(rubbish, 0.0),
        Lost::Nonsense {
            limit_bytes: MESSAGE_LIMIT_BYTES
        }
        .to_string()
    );
    let closed = Input::Io(IoEvent::Closed {
        reason: "gone".to_owned(),
    });
    assert_eq!(
        lost(closed, 0.0),
        "the controller closed the connection: gone"
    );
}

#[test]
fn lost_records_are_counted_and_silence_restarts_the_sampler() {
    let mut desk = Desk::new(Prepare::Observe);
    desk.make_ready();
    desk.number += 4;
    desk.sample(0.0, 0, 0, 0);
    assert!(desk.has(&Condition::SamplerOverrun { lost: 4 }));
    desk.out.clear();
    desk.later(2.5);
    assert!(desk.out.contains(&Output::Io(IoCommand::StartSampler)));
}

#[test]
fn a_bridge_that_stood_still_begins_its_waits_anew() {
    let mut desk = Desk::new(Prepare::Observe);
    desk.make_ready();
    desk.tick_for(0.1);
    assert!(desk.sent().contains(&"get estop".to_owned()));
    desk.out.clear();
    desk.now_s += 30.0;
    desk.tell(Input::Tick);
    assert!(desk.has(&Condition::StoodStill { for_s: 30.0 }));
    let asked = |desk: &Desk, what| desk.out.contains(&Output::Io(what));
    assert!(!asked(&desk, IoCommand::StartSampler), "{:?}", desk.out);
    // Silence from now on counts.
    desk.tick_for(2.2);
    assert!(asked(&desk, IoCommand::StartSampler), "{:?}", desk.out);
    desk.tick_for(3.0);
    assert!(asked(&desk, IoCommand::Connect) || asked(&desk, IoCommand::Disconnect));
}

#[test]
fn under_a_clock_that_is_set_back_the_controller_is_looked_at_and_silence_is_noticed() {
    let mut desk = Desk::new(Prepare::Observe);
    desk.make_ready();
    desk.now_s -= 3600.0;
    desk.tell(Input::Tick);
    desk.sent();
    desk.now_s += 0.1;
    desk.tell(Input::Tick);
    assert!(desk.sent().contains(&"get estop".to_owned()));
    desk.later(2.5);
    assert!(desk.out.contains(&Output::Io(IoCommand::StartSampler)));
}

#[test]
fn a_controller_that_loads_another_program_is_not_told_to_run_it() {
    let mut desk = Desk::new(Prepare::Observe);
    desk.make_ready();
    desk.begin("G21\nM2\n");
    let told = desk.play(|line| (line == "get program").then(|| "PROGRAM /p/other.ngc".into()));
    assert!(!told.contains(&"set run".to_owned()), "{told:?}");
    let (outcome, message, _) = desk.ending().unwrap_or((Outcome::Done, String::new(), 0));
    assert_eq!(outcome, Outcome::Refused);
    assert_eq!(
        message,
        "the controller holds /p/other.ngc, not /p/abbe_1.ngc"
    );
}

#[test]
fn shutdown_calls_the_program_off_first() {
    let mut desk = Desk::new(Prepare::Observe);
    desk.make_ready();
    desk.begin("G1 X5 F60\n");
    desk.play(|line| (line == "get program_status").then(|| "PROGRAM_STATUS RUNNING".into()));
    desk.tell(Input::Shutdown);
    assert!(!desk.out.contains(&Output::Stopped));
    let told = desk.play(|_| None);
    assert!(told.contains(&"set abort".to_owned()));
    desk.later(0.1);
    assert!(desk.out.contains(&Output::Stopped));
    assert_eq!(
        desk.ending().map(|(outcome, _, _)| outcome),
        Some(Outcome::Stopped)
    );
}
