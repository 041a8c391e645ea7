use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::rcl_interfaces::msg::Log;
use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::{Qos, from_cdr, to_cdr, topics};
use metrology::stamp::Span;
use node_runtime::node::Ports;
use node_runtime::{Emission, Event};

use super::puppet::{Puppet, environment, start, start_with, topic, wait};

/// Both tests are on one domain: there can be one `/clock` on it.
static TURN: Mutex<()> = Mutex::new(());

/// Publishes simulated times, one at each 20 ms of real time, after everybody has met.
fn clock(times_ms: &'static [i32]) -> Puppet {
    let ports = Ports {
        publications: vec![topic::<Clock>(topics::CLOCK.name, topics::CLOCK.qos)],
        timers: vec![Span::from_nanos(20_000_000)],
        ..Ports::default()
    };
    let mut ticks = 0_usize;
    Puppet::new("clock", ports, move |_, event, out| {
        if matches!(event, Event::Timer { .. }) {
            ticks += 1;
            if let Some(ms) = ticks.checked_sub(50).and_then(|tick| times_ms.get(tick)) {
                let nanosec = u32::try_from(ms % 1_000 * 1_000_000).unwrap();
                let message = Clock {
                    clock: Time {
                        sec: ms / 1_000,
                        nanosec,
                    },
                };
                let bytes = Arc::from(to_cdr(&message));
                out.push(Emission::Publish {
                    publication: 0,
                    bytes,
                });
            }
        }
        Ok(())
    })
}

#[test]
fn timers_follow_clock_and_a_step_back_is_said() {
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let environment = environment(9);
    let ports = Ports {
        subscriptions: vec![topic::<DiagnosticArray>(
            topics::DIAGNOSTICS.name,
            Qos::RELIABLE,
        )],
        ..Ports::default()
    };
    let (sender, diagnostics) = channel();
    let watch = Puppet::new("watch", ports, move |_, event, _| {
        if let Event::Message { bytes, .. } = event {
            let _ = sender.send(from_cdr::<DiagnosticArray>(bytes).unwrap());
        }
        Ok(())
    });
    let watching = start(&environment, watch);
    let (sender, ticks) = channel();
    let ports = Ports {
        timers: vec![Span::from_nanos(100_000_000)],
        ..Ports::default()
    };
    let timed = Puppet::new("timed", ports, move |at, event, _| {
        if matches!(event, Event::Timer { .. }) {
            let _ = sender.send(at.nanos() / 1_000_000);
        }
        Ok(())
    });
    let simulated = ["--ros-args", "-p", "use_sim_time:=true"];
    let timing = start_with(&environment, timed, &simulated);
    std::thread::sleep(Duration::from_millis(300));
    assert!(ticks.try_recv().is_err(), "no tick before the first /clock");
    let clocking = start(
        &environment,
        clock(&[5_000, 5_050, 5_350, 5_360, 2_000, 2_250]),
    );
    let mut seen = Vec::new();
    while seen.len() < 5 {
        seen.push(wait(&ticks, "a simulated tick", Some));
    }
    assert_eq!(seen, [5_100, 5_200, 5_300, 2_100, 2_200]);
    let said = wait(&diagnostics, "the step back", |array| {
        let mut status = array.status.into_iter();
        status.find(|s| s.name == "/timed: clock_stepped_back" && s.level == 1)
    });
    assert!(said.message.contains("3.36"), "{}", said.message);
    clocking.stop().unwrap();
    timing.stop().unwrap();
    watching.stop().unwrap();
}

/// `/diagnostics` of `/timed` and its lines on `/rosout`: name or message, and second of the stamp.
fn stamps(sender: Sender<(String, i32)>) -> Puppet {
    let ports = Ports {
        subscriptions: vec![
            topic::<DiagnosticArray>(topics::DIAGNOSTICS.name, Qos::RELIABLE),
            topic::<Log>(topics::ROSOUT.name, topics::ROSOUT.qos),
        ],
        ..Ports::default()
    };
    Puppet::new("watch", ports, move |_, event, _| {
        match event {
            Event::Message {
                subscription: 0,
                bytes,
            } => {
                let array: DiagnosticArray = from_cdr(bytes).unwrap();
                let stamp_s = array.header.stamp.sec;
                for status in array.status {
                    let _ = sender.send((status.name, stamp_s));
                }
            }
            Event::Message { bytes, .. } => {
                let line: Log = from_cdr(bytes).unwrap();
                let _ = sender.send((format!("{} says {}", line.name, line.msg), line.stamp.sec));
            }
            _ => {}
        }
        Ok(())
    })
}

#[test]
fn diagnostics_and_log_carry_the_nodes_time_and_not_the_computers() {
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let environment = environment(21);
    let (sender, seen) = channel();
    let watching = start(&environment, stamps(sender));
    let simulated = ["--ros-args", "-p", "use_sim_time:=true"];
    let timed = Puppet::new("timed", Ports::default(), |_, _, _| Ok(()));
    let timing = start_with(&environment, timed, &simulated);
    let clocking = start(&environment, clock(&[7_000, 7_050, 7_100, 3_000, 3_050]));
    let mut of_timed = Vec::new();
    let mut is_all = |(name, stamp_s): (String, i32)| {
        let is_own = name.starts_with("/timed") || name.starts_with("timed");
        of_timed.extend(is_own.then_some((name, stamp_s)));
        let any = |start: &str| {
            let mut own = of_timed.iter();
            own.any(|(name, stamp_s)| name.starts_with(start) && *stamp_s == 3)
        };
        (any("/timed: clock_stepped_back") && any("timed says /clock went back")).then_some(())
    };
    wait(&seen, "the step back on both", &mut is_all);
    let late = of_timed.iter().find(|(_, stamp_s)| *stamp_s > 7);
    assert_eq!(late, None, "the computer's time among {of_timed:?}");
    clocking.stop().unwrap();
    timing.stop().unwrap();
    watching.stop().unwrap();
}
