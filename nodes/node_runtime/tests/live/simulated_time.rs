use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::{Qos, from_cdr, to_cdr, topics};
use metrology::stamp::Span;
use node_runtime::node::Ports;
use node_runtime::{Emission, Event};

use super::puppet::{Puppet, environment, start, start_with, topic, wait};

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
