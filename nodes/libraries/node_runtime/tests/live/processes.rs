//! Nodes as programs: arguments, parameters, signals, exit codes.

use std::collections::{BTreeMap, BTreeSet};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::rcl_interfaces::msg::Log;
use abbe_msgs::std_msgs::msg::Int64;
use abbe_msgs::{Qos, from_cdr, to_cdr, topics};
use metrology::stamp::Span;
use node_runtime::environment::Environment;
use node_runtime::node::Ports;
use node_runtime::{Emission, Event, Running};

use super::puppet::{Puppet, environment, put_into, start, topic, wait};

fn relay(environment: &Environment, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relay"));
    command
        .args(arguments)
        .env_remove("RUST_LOG")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    put_into(&mut command, environment);
    command
}

/// Ends its process whatever happens to the test.
struct Process(Option<Child>);

impl Process {
    fn start(environment: &Environment, arguments: &[&str]) -> Self {
        Self(Some(relay(environment, arguments).spawn().unwrap()))
    }

    fn signal(&self, signal: &str) {
        let id = self.0.as_ref().unwrap().id().to_string();
        assert!(
            Command::new("kill")
                .args([signal, &id])
                .status()
                .unwrap()
                .success()
        );
    }

    fn output(mut self) -> Output {
        self.0.take().unwrap().wait_with_output().unwrap()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if let Some(mut child) = self.0.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

fn now_nanos() -> i64 {
    i64::try_from(
        SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap()
            .as_nanos(),
    )
    .unwrap()
}

/// Sends the time on `/in` at `period_us` and hands on what comes back on `/out` with its time.
fn pinger(environment: &Environment, period_us: i64) -> (Running, Receiver<(i64, i64)>) {
    let (sender, received) = channel();
    let ports = Ports {
        subscriptions: vec![topic::<Int64>("/out", Qos::RELIABLE_DEEP)],
        publications: vec![topic::<Int64>("/in", Qos::RELIABLE_DEEP)],
        timers: vec![Span::from_nanos(period_us * 1_000)],
        ..Ports::default()
    };
    let puppet = Puppet::new("pinger", ports, move |_, event, out| {
        match event {
            Event::Message { bytes, .. } => {
                let message: Int64 = from_cdr(bytes).unwrap();
                let _ = sender.send((message.data, now_nanos()));
            }
            Event::Timer { .. } => {
                let bytes = Arc::from(to_cdr(&Int64 { data: now_nanos() }));
                out.push(Emission::Publish {
                    publication: 0,
                    bytes,
                });
            }
            _ => {}
        }
        Ok(())
    });
    (start(environment, puppet), received)
}

#[test]
fn a_program_relays_between_processes_at_1_khz_and_stops_at_sigint_within_2_s() {
    let environment = environment(10);
    let process = Process::start(&environment, &[]);
    let (pinging, received) = pinger(&environment, 1_000);
    wait(&received, "the first echo", Some);
    let mut round_trips_us: Vec<_> = (0..2_000)
        .map(|_| {
            wait(&received, "an echo", |(sent, came)| {
                Some((came - sent) / 1_000)
            })
        })
        .collect();
    round_trips_us.sort_unstable();
    let at = |share: usize| round_trips_us[share * round_trips_us.len() / 1_000];
    eprintln!(
        "round trip, 1 kHz: p50 {} us, p99 {} us, p99.9 {} us",
        at(500),
        at(990),
        at(999)
    );
    process.signal("-INT");
    let asked = Instant::now();
    let output = process.output();
    assert!(
        asked.elapsed() < Duration::from_secs(2),
        "stopped after {:?}",
        asked.elapsed()
    );
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    pinging.stop().unwrap();
}

#[test]
fn a_second_sigint_ends_a_node_that_winds_down_and_is_said() {
    let environment = environment(16);
    let mut process = Process::start(&environment, &["--ros-args", "-p", "stubborn:=true"]);
    let (pinging, received) = pinger(&environment, 10_000);
    wait(&received, "the first echo", Some);
    process.signal("-INT");
    std::thread::sleep(Duration::from_millis(100));
    // A terminal and a launcher pass the same Ctrl-C on.
    process.signal("-INT");
    std::thread::sleep(Duration::from_millis(1_000));
    process.signal("-TERM");
    std::thread::sleep(Duration::from_millis(200));
    assert!(
        process.0.as_mut().unwrap().try_wait().unwrap().is_none(),
        "one Ctrl-C and a SIGTERM leave it its patience"
    );
    process.signal("-INT");
    let asked = Instant::now();
    let output = process.output();
    let took = asked.elapsed();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(took < Duration::from_secs(4), "{took:?}: {said}");
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("second SIGINT: ending at once"), "{said}");
    assert!(
        said.contains("not wound down: the end was forced"),
        "{said}"
    );
    pinging.stop().unwrap();
}

/// `nohup` and `trap '' HUP` start a program with the signal ignored.
#[test]
fn a_closed_terminal_ends_a_node_in_good_order_unless_the_signal_was_ignored_before() {
    let environment = environment(24);
    let (pinging, received) = pinger(&environment, 10_000);
    let process = Process::start(&environment, &[]);
    wait(&received, "the first echo", Some);
    process.signal("-HUP");
    let output = process.output();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");

    let mut ignoring = Command::new("sh");
    ignoring
        .args(["-c", "trap '' HUP; exec \"$0\""])
        .arg(env!("CARGO_BIN_EXE_relay"))
        .env_remove("RUST_LOG")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    put_into(&mut ignoring, &environment);
    // Echoes of the one before.
    while received.try_recv().is_ok() {}
    let mut process = Process(Some(ignoring.spawn().unwrap()));
    wait(&received, "the first echo", Some);
    process.signal("-HUP");
    std::thread::sleep(Duration::from_millis(1_000));
    let ended = process.0.as_mut().unwrap().try_wait().unwrap();
    assert!(ended.is_none(), "{ended:?}");
    process.signal("-TERM");
    let output = process.output();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    pinging.stop().unwrap();
}

#[test]
fn arguments_rename_place_and_parametrise_a_program() {
    let environment = environment(11);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("relay.yaml");
    std::fs::write(&file, "/cell/adder:\n  ros__parameters:\n    offset: 7\n").unwrap();
    let arguments = [
        "--ros-args",
        "-r",
        "__node:=adder",
        "-r",
        "__ns:=/cell",
        "-r",
        "in:=/in",
        "-r",
        "/cell/out:=/out",
        "--params-file",
        file.to_str().unwrap(),
        "--log-level",
        "warn",
    ];
    let process = Process::start(&environment, &arguments);
    let (pinging, received) = pinger(&environment, 20_000);
    let (first, _) = wait(&received, "an echo", Some);
    let (second, _) = wait(&received, "an echo", Some);
    assert!(second > first);
    pinging.stop().unwrap();
    process.signal("-TERM");
    assert_eq!(process.output().status.code(), Some(0));
}

#[test]
fn bad_arguments_and_parameters_are_refused_with_their_names() {
    let environment = environment(12);
    for (arguments, code, named) in [
        (&["--fast"][..], 2, "--fast"),
        (&["--ros-args", "-r", "in"], 2, "`in`"),
        (&["--ros-args", "-p", "offset:=1.5"], 1, "`offset` = 1.5"),
        (
            &["--ros-args", "-p", "ofset:=1"],
            1,
            "`ofset` = 1: unknown key, is offset meant?",
        ),
        (
            &["--ros-args", "--params-file", "/nowhere.yaml"],
            1,
            "/nowhere.yaml",
        ),
        (&["--ros-args", "-r", "__node:=1st"], 2, "1st"),
    ] {
        let output = relay(&environment, arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(named), "{arguments:?}: {said}");
    }
    let output = relay(&environment, &[])
        .env("ROS_DOMAIN_ID", "many")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("ROS_DOMAIN_ID=many"));
}

/// Hands on whose line it hears, and who tells of itself on `/diagnostics`.
fn listener(environment: &Environment) -> (Running, Receiver<(&'static str, String)>) {
    let (sender, heard) = channel();
    let (lines, tellers) = (&topics::ROSOUT, &topics::DIAGNOSTICS);
    let ports = Ports {
        subscriptions: vec![
            topic::<Log>(lines.name, lines.qos),
            topic::<DiagnosticArray>(tellers.name, tellers.qos),
        ],
        ..Ports::default()
    };
    let puppet = Puppet::new("listener", ports, move |_, event, _| {
        let Event::Message {
            subscription,
            bytes,
            ..
        } = event
        else {
            return Ok(());
        };
        if subscription == 0 {
            let line: Log = from_cdr(bytes).unwrap();
            let _ = sender.send(("rosout", line.name));
        } else {
            let told: DiagnosticArray = from_cdr(bytes).unwrap();
            for status in told.status {
                let name = status.name.trim_start_matches('/').to_owned();
                let _ = sender.send(("diagnostics", name));
            }
        }
        Ok(())
    });
    (start(environment, puppet), heard)
}

#[test]
fn a_program_is_silent_on_the_console_or_on_rosout_where_it_is_told_to_be() {
    let environment = environment(22);
    let (listening, heard) = listener(&environment);
    let silences = [
        ("open", "--enable-rosout-logs", true, true),
        ("hidden", "--disable-rosout-logs", false, true),
        ("mute", "--disable-stdout-logs", true, false),
        ("plain", "--disable-external-lib-logs", true, true),
    ];
    let programs = silences.map(|(name, switch, ..)| {
        let name = format!("__node:={name}");
        Process::start(&environment, &["--ros-args", "-r", &name, switch])
    });
    let (mut on_rosout, mut met) = (BTreeSet::new(), BTreeMap::<String, usize>::new());
    // Each tells of itself three times, by when every latched line has come.
    wait(&heard, "all programs", |(topic, name): (&str, String)| {
        if topic == "rosout" {
            on_rosout.insert(name);
        } else {
            *met.entry(name).or_default() += 1;
        }
        let often = |name: &str| met.get(name).is_some_and(|times| *times >= 3);
        silences.iter().all(|(name, ..)| often(name)).then_some(())
    });
    for ((name, switch, rosout, console), program) in silences.into_iter().zip(programs) {
        program.signal("-INT");
        let output = program.output();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert_eq!(on_rosout.contains(name), rosout, "{switch}: {on_rosout:?}");
        assert_eq!(said.contains("started"), console, "{switch}: {said}");
        assert_eq!(said.is_empty(), !console, "{switch}: {said}");
    }
    listening.stop().unwrap();
}

#[test]
fn a_second_program_of_the_same_name_does_not_start() {
    let environment = environment(13);
    let first = Process::start(&environment, &[]);
    let (pinging, received) = pinger(&environment, 20_000);
    wait(&received, "the first program", Some);
    let output = relay(&environment, &[]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("node /relay is already running"), "{said}");
    wait(&received, "the first program, still there", Some);
    pinging.stop().unwrap();
    first.signal("-INT");
    assert_eq!(first.output().status.code(), Some(0));
}

#[test]
fn a_killed_subscriber_holds_nobody_up() {
    // Past 8,192 unacknowledged samples RustDDS refuses to write unless told otherwise.
    const AFTER_THE_KILL: usize = 10_000;
    let environment = environment(15);
    let second = ["--ros-args", "-r", "__node:=second", "-r", "out:=/unheard"];
    let killed = Process::start(&environment, &second);
    let living = Process::start(&environment, &[]);
    let (pinging, received) = pinger(&environment, 1_000);
    wait(&received, "the first echo", Some);
    std::thread::sleep(Duration::from_secs(1));
    killed.signal("-KILL");
    let mut last = wait(&received, "an echo", Some).0;
    let mut longest_gap_ms = 0;
    for _ in 0..AFTER_THE_KILL {
        let (sent, _) = wait(&received, "an echo after the kill", Some);
        longest_gap_ms = longest_gap_ms.max((sent - last) / 1_000_000);
        last = sent;
    }
    // A writer that waits for the dead one waits until its lease ends, 4 s on Zenoh and 60 s on DDS; a busy computer holds it up for less.
    assert!(
        longest_gap_ms < 3_000,
        "nothing was sent for {longest_gap_ms} ms"
    );
    let started = Process::start(&environment, &second);
    std::thread::sleep(Duration::from_secs(2));
    started.signal("-INT");
    let output = started.output();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        output.status.code(),
        Some(0),
        "restarted after the kill: {said}"
    );
    assert!(!said.contains("ERROR"), "{said}");
    pinging.stop().unwrap();
    living.signal("-INT");
    assert_eq!(living.output().status.code(), Some(0));
}
